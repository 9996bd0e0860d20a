//! Finds textures with a picture in an extension, such as `EXT_texture_webp`. raycl reads none of these extensions, but
//! uses the texture's other picture (its fallback), if there is one.

use super::quoted;
use super::textures;
use crate::words::{counted, first};
use gltf::json::Root;
use gltf::json::texture::Texture;
use std::collections::{BTreeMap, HashSet};

/// Largest number of extensions that a note names.
const MOST_LISTED: usize = 8;

/// Returns the names of the extensions that give a texture another picture.
fn of_texture(texture: &Texture) -> impl Iterator<Item = &str> {
    let others = texture.extensions.iter().flat_map(|extensions| &extensions.others);
    others.filter(|(_, value)| value.get("source").is_some()).map(|(name, _)| name.as_str())
}

/// Returns words on a texture without a picture that raycl could read.
pub(super) fn missing(texture: &Texture) -> String {
    let names: Vec<_> = of_texture(texture).map(|name| quoted(name.as_bytes())).collect();
    let other = if names.is_empty() {
        String::new()
    } else {
        format!(" (its picture is in {})", first(&names, MOST_LISTED))
    };
    format!("has no picture of a format that raycl reads{other}")
}

/// The other pictures of the textures that raycl uses.
pub(super) struct Fallbacks<'a> {
    /// The names of the extensions with these pictures. An extension has the value true if one of its textures has a
    /// fallback.
    extensions: BTreeMap<&'a str, bool>,
    /// The number of textures with a fallback.
    count: usize,
}

impl<'a> Fallbacks<'a> {
    /// Finds the extensions of the textures of the materials with the indices `used`. `unread` has the indices of the
    /// textures that cannot be read. A texture whose fallback cannot be read does not count.
    pub fn of(root: &'a Root, used: &HashSet<usize>, unread: &HashSet<usize>) -> Self {
        let mut found = Self { extensions: BTreeMap::new(), count: 0 };
        for index in textures::used_by(root, used) {
            let Some(texture) = root.textures.get(index) else { continue };
            let has_fallback = root.get(texture.source).is_some();
            if has_fallback && unread.contains(&index) {
                continue;
            }
            found.count += usize::from(has_fallback && of_texture(texture).next().is_some());
            for name in of_texture(texture) {
                *found.extensions.entry(name).or_default() |= has_fallback;
            }
        }
        found
    }

    /// Returns true if there is a note on this extension: a note on fallbacks or on a missing picture.
    pub fn are_noted(&self, extension: &str) -> bool {
        self.extensions.contains_key(extension)
    }

    /// Returns a note on the textures with a fallback. The note names the extensions only if `quotes` is true.
    pub fn note(&self, quotes: bool) -> Option<String> {
        let names = self.extensions.iter().filter(|(_, has_fallback)| **has_fallback);
        let names: Vec<_> = names.map(|(name, _)| quoted(name.as_bytes())).collect();
        let textures = counted(self.count, "texture");
        let fallbacks = match self.count {
            1 => "uses its fallback picture instead of the one in",
            _ => "use their fallback pictures instead of those in",
        };
        let others = if quotes { first(&names, MOST_LISTED) } else { "an extension".to_owned() };
        (self.count > 0).then(|| format!("{textures} {fallbacks} {others}"))
    }
}
