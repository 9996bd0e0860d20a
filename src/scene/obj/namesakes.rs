//! Finds files that are perhaps not those that a mesh means: raycl looks for a file in several folders, and uses the
//! first that it can use.

use super::mtl::Reach;
use super::text::{possible_names, quoted_name, stated_paths};
use super::textures::paths;
use crate::words::counted;
use std::collections::BTreeMap;

/// The names of files that may be meant but are not used. After each name is the name of the file that is used instead.
#[derive(Default)]
pub(super) struct Namesakes(BTreeMap<String, String>);

impl Namesakes {
    /// Records the file `used` if another file may be meant. `text` is the text that names the file, and `folder` the
    /// folder of the MTL file that contains the text (see [`paths`]).
    pub fn look_at(&mut self, reach: Reach<'_>, text: &str, folder: &str, used: &str) {
        if let Some(unused) = unused(reach, text, folder, used) {
            self.0.insert(unused, used.to_owned());
        }
    }

    /// Returns a note on the recorded files; `None` if there are none. `what` is the word for a file, such as
    /// "texture". If `quotes` is true, the note contains the files' names.
    pub fn note(&self, what: &str, quotes: bool) -> Option<String> {
        let (unused, used) = self.0.first_key_value()?;
        let such_as = if self.0.len() == 1 { "" } else { "for example, " };
        let example = || format!(": {such_as}{} is used, not {}", quoted_name(used), quoted_name(unused));
        let example = if quotes { example() } else { String::new() };
        Some(format!("for {}, another file may be meant{example}", counted(self.0.len(), what)))
    }
}

/// Returns the name of a file that may be meant instead of `used`; `None` if `used` is certainly the file that is
/// meant.
fn unused(reach: Reach<'_>, text: &str, folder: &str, used: &str) -> Option<String> {
    let is_stated = stated_paths(text).any(|path| path == used || format!("{folder}{path}") == used);
    // If raycl has read the text as a path from the mesh's folder, a path from the MTL file's folder may be meant
    // instead.
    let is_beside_mesh = stated_paths(text).any(|path| path == used);
    let beside_materials = is_beside_mesh.then(|| format!("{folder}{used}"));
    let mut others = paths(text, folder).take_while(|path| path != used).chain(beside_materials);
    let name = || possible_names(text)[1].to_owned();
    others.find(|path| reach.is_another_file(path, used)).or_else(|| (!is_stated).then(name))
}
