//! Counts the unsupported features that a file asks for, and writes one note for each kind of feature.

use super::text::{quoted, words};
use crate::words::counted;
use std::collections::BTreeMap;

/// Largest number of keywords that are stored for one kind of feature, since a file may contain any number of
/// keywords.
const MOST_COUNTED: usize = 16;
/// Largest number of keywords that a note lists.
const MOST_LISTED: usize = 8;

/// A kind of unsupported feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::scene) enum Wish {
    Texture,
    TextureOption,
    TexturePlace,
    Transparency,
    Blending,
    UnknownAlpha,
    Colour,
    Range,
    EmissionPlace,
    Reflection,
    Refraction,
    Unlit,
    NoHighlight,
    EvenHighlight,
    ShadowCatcher,
    UnknownModel,
    Physical,
    Metal,
    Gloss,
    Shine,
    Ambient,
    Paint,
    Lines,
    Points,
    FreeForm,
    Attribute,
    OtherFile,
    Unknown,
}

impl Wish {
    /// Returns the feature's name, and what raycl does instead, both for messages.
    pub fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Texture => {
                ("textures", "only a material's colour, holes and emitted light can come from a texture")
            }
            Self::TextureOption => ("options of textures", "they are ignored"),
            Self::TexturePlace => (
                "different scales, offsets or wrap modes of its textures",
                "those of the first of map_Kd, map_d and map_Ke count for all of them",
            ),
            Self::Transparency => ("transparency", "every surface is opaque"),
            Self::Blending => {
                ("blended transparency", "points that are at least half opaque are drawn, others are holes")
            }
            Self::UnknownAlpha => {
                ("an unknown kind of transparency", "the surface is opaque; expected OPAQUE, MASK or BLEND")
            }
            Self::Colour => ("a colour outside 0 to 1", "channels are limited to this range"),
            Self::Range => ("a value outside its range", "it is limited to this range"),
            Self::EmissionPlace => (
                "emitted light from a texture that is placed differently from the colour texture",
                "the surface emits no light, unless the scene sets `emitted`",
            ),
            Self::Reflection => ("mirror reflections", "surfaces reflect only lights"),
            Self::Refraction => ("refraction", "every surface is opaque"),
            Self::Unlit => ("a colour without light", "the surface is lit like any other"),
            Self::NoHighlight => ("no highlight", "there is a highlight, since Ks is not zero"),
            Self::EvenHighlight => ("a highlight as bright at all angles", "there is no highlight"),
            Self::ShadowCatcher => ("a surface that shows only shadows", "the surface is drawn"),
            Self::UnknownModel => ("an unknown illumination model", "Kd, Ks and Ns are used"),
            Self::Paint => ("colours of vertices in comments", "these colours are not read"),
            Self::Physical => ("physically based shading", "Kd, Ks and Ns are used"),
            Self::Metal => ("metal", "surfaces are diffuse, in their base colour"),
            Self::Gloss => ("gloss", "surfaces are diffuse, in their base colour"),
            Self::Shine => {
                ("sheen, clear coats or other reflections", "surfaces are diffuse, in their base colour")
            }
            Self::Ambient => ("ambient light", "Ka is ignored"),
            Self::Lines => ("lines", "only faces are drawn"),
            Self::Points => ("points", "only faces are drawn"),
            Self::FreeForm => ("curves and surfaces", "only faces are drawn"),
            Self::Attribute => ("display attributes", "all faces are drawn in the same way"),
            Self::OtherFile => ("another file or command", "it is neither read nor run"),
            Self::Unknown => ("unknown things", "they are ignored"),
        }
    }
}

/// For each kind of feature, the number of uses and the keywords that ask for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::scene) struct Asked(BTreeMap<Wish, Count>);

#[derive(Clone, Debug, Default, PartialEq)]
struct Count {
    total: usize,
    names: BTreeMap<String, usize>,
}

impl Count {
    fn add(&mut self, name: &str, count: usize) {
        if self.names.len() < MOST_COUNTED || self.names.contains_key(name) {
            *self.names.entry(name.to_owned()).or_default() += count;
        }
    }

    /// Returns a list of up to [`MOST_LISTED`] keywords. If there are several keywords, each is followed by
    /// its count.
    fn list(&self) -> String {
        if let [(name, _)] = self.names.iter().collect::<Vec<_>>()[..] {
            return name.clone();
        }
        let mut listed: Vec<_> =
            self.names.iter().take(MOST_LISTED).map(|(name, count)| format!("{name} {count}")).collect();
        listed.extend((self.names.len() > MOST_LISTED).then(|| "...".to_owned()));
        listed.join(", ")
    }
}

/// Returns a keyword as messages show it.
fn shown_name(wish: Wish, keyword: &[u8]) -> String {
    match wish {
        Wish::Unknown => quoted(keyword),
        _ => words(keyword),
    }
}

impl Asked {
    /// Counts one use of an unsupported feature.
    pub fn add(&mut self, wish: Wish, keyword: &[u8]) {
        let count = self.0.entry(wish).or_default();
        count.total += 1;
        count.add(&shown_name(wish, keyword), 1);
    }

    /// Removes the counts of one kind of feature.
    pub fn remove(&mut self, wish: Wish) {
        self.0.remove(&wish);
    }

    /// Returns true if nothing was counted.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns true if the keyword was counted and stored. Only the first [`MOST_COUNTED`] keywords of each
    /// kind are stored.
    pub fn has(&self, wish: Wish, keyword: &[u8]) -> bool {
        self.0.get(&wish).is_some_and(|count| count.names.contains_key(&shown_name(wish, keyword)))
    }

    /// Returns the list of the keywords of one kind of feature, for a message; `None` if there are no
    /// keywords.
    pub fn keywords(&self, wish: Wish) -> Option<String> {
        self.0.get(&wish).map(Count::list)
    }

    /// Divides the counts into those of the features `wishes` and those of the other features.
    pub fn divided(self, wishes: &[Wish]) -> (Self, Self) {
        let (these, others) = self.0.into_iter().partition(|(wish, _)| wishes.contains(wish));
        (Self(these), Self(others))
    }

    /// Adds all counts of `other`, such as those of another piece of the file.
    pub fn extend(&mut self, other: &Self) {
        self.join(other, |count| count.total);
    }

    /// Adds the counts of a material. The material counts once for each kind of feature, even if
    /// several of its lines use this kind.
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

    /// Returns a note for each kind of feature. `who` is the word for what was counted: "material" or
    /// "statement". If `quotes` is true, the notes contain the keywords from the file.
    pub fn notes(&self, who: &str, quotes: bool) -> impl Iterator<Item = String> {
        self.0.iter().map(move |(wish, count)| {
            let (what, instead) = wish.words();
            let asking = counted(count.total, who);
            let names = if quotes { format!(" ({})", count.list()) } else { String::new() };
            let verb = if count.total == 1 { "asks" } else { "ask" };
            match wish {
                Wish::Unknown => format!("unknown keywords of {asking} are ignored{names}"),
                _ => format!("{asking} {verb} for {what}{names}, which raycl does not support: {instead}"),
            }
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn eight_keywords_are_listed_and_more_are_hinted_at() {
        let listed = |count: u8| {
            let mut names = Count::default();
            (0..count).for_each(|number| names.add(&format!("k{number}"), 1));
            names.list()
        };
        assert_eq!(listed(8), "k0 1, k1 1, k2 1, k3 1, k4 1, k5 1, k6 1, k7 1");
        assert_eq!(listed(9), listed(8) + ", ...");
    }
}
