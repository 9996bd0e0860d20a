//! What a file asks for and raycl does not do: counted where it is read, told once in a sentence of each kind.

use super::text::{quoted, words};
use crate::words::counted;
use std::collections::BTreeMap;

/// The most keywords of one kind that are counted separately; a file may invent any number of them.
const KEPT_NAMES: usize = 16;
/// The most of them that a note lists.
const TOLD_NAMES: usize = 8;

/// A kind of thing that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::scene) enum Wish {
    Texture,
    TextureOption,
    Transparency,
    Emission,
    Reflection,
    Refraction,
    Unlit,
    NoHighlight,
    ShadowCatcher,
    UnknownModel,
    Physical,
    Metal,
    Shine,
    Ambient,
    Lines,
    Points,
    FreeForm,
    Attribute,
    OtherFile,
    Unknown,
}

impl Wish {
    /// What is asked for, and what is done in its place.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Texture => ("textures", "only a material's colour has one"),
            Self::TextureOption => ("options of textures", "they are passed over"),
            Self::Transparency => ("transparency", "every surface is opaque"),
            Self::Emission => ("emitted light", "only lights of the scene shine"),
            Self::Reflection => ("mirror reflections", "surfaces show lights only"),
            Self::Refraction => ("refraction", "every surface is opaque"),
            Self::Unlit => ("a colour without light", "it is lit as any other"),
            Self::NoHighlight => ("no highlight", "a Ks that is not zero makes one"),
            Self::ShadowCatcher => ("an invisible surface for shadows", "it is seen"),
            Self::UnknownModel => ("a model of light unknown here", "Kd, Ks and Ns are used"),
            Self::Physical => ("physically based shading", "Kd, Ks and Ns are used"),
            Self::Metal => ("metal", "surfaces are diffuse, in their base colour"),
            Self::Shine => ("ways to shine", "surfaces are diffuse, in their base colour"),
            Self::Ambient => ("ambient light", "there is none"),
            Self::Lines => ("lines", "only faces are seen"),
            Self::Points => ("points", "only faces are seen"),
            Self::FreeForm => ("curves and surfaces", "only faces are seen"),
            Self::Attribute => ("display attributes", "all faces are seen alike"),
            Self::OtherFile => ("another file or command", "it is neither read nor run"),
            Self::Unknown => ("unknown things", "they are passed over"),
        }
    }
}

/// How often each kind of thing is asked for, and by which keywords.
#[derive(Clone, Debug, Default)]
pub(in crate::scene) struct Asked(BTreeMap<Wish, Count>);

#[derive(Clone, Debug, Default)]
struct Count {
    total: usize,
    names: BTreeMap<String, usize>,
}

impl Count {
    fn add(&mut self, name: &str, count: usize) {
        if self.names.len() < KEPT_NAMES || self.names.contains_key(name) {
            *self.names.entry(name.to_owned()).or_default() += count;
        }
    }

    /// Each keyword, with its own count where it is not the only one.
    fn told(&self) -> String {
        if let [(name, _)] = self.names.iter().collect::<Vec<_>>()[..] {
            return name.clone();
        }
        let mut told: Vec<_> =
            self.names.iter().take(TOLD_NAMES).map(|(name, count)| format!("{name} {count}")).collect();
        told.extend((self.names.len() > TOLD_NAMES).then(|| "...".to_owned()));
        told.join(", ")
    }
}

impl Asked {
    /// Counts a keyword.
    pub fn add(&mut self, wish: Wish, keyword: &[u8]) {
        let name = match wish {
            Wish::Unknown => quoted(keyword),
            _ => words(keyword),
        };
        let count = self.0.entry(wish).or_default();
        count.total += 1;
        count.add(&name, 1);
    }

    /// Whether nothing was asked for.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds another piece of the file.
    pub fn extend(&mut self, other: &Self) {
        self.join(other, |count| count.total);
    }

    /// Adds one material: it counts once of each kind, however many of its lines ask for it.
    pub fn add_material(&mut self, material: &Self) {
        self.join(material, |_| 1);
    }

    fn join(&mut self, other: &Self, total: impl Fn(&Count) -> usize) {
        for (wish, added) in &other.0 {
            let count = self.0.entry(*wish).or_default();
            count.total += total(added);
            added.names.iter().for_each(|(name, times)| count.add(name, *times));
        }
    }

    /// A sentence of each kind; `who` is a material or a statement. The keywords are the file's own words.
    pub fn notes(&self, who: &str, quotes: bool) -> impl Iterator<Item = String> {
        self.0.iter().map(move |(wish, count)| {
            let (what, instead) = wish.words();
            let asking = counted(count.total, who);
            let names = if quotes { format!(" ({})", count.told()) } else { String::new() };
            let verb = if count.total == 1 { "asks" } else { "ask" };
            match wish {
                Wish::Unknown => format!("unknown keywords of {asking} are passed over{names}"),
                _ => format!("{asking} {verb} for {what}{names}, which raycl does not do: {instead}"),
            }
        })
    }
}
