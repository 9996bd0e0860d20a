//! Lines of MTL files that raycl ignores or replaces. Lines of materials that no triangle uses cause no notes.

use super::text::{Seen, Source, quoted};
use super::values::{self, Ignored};
use crate::words::{counted, few};
use std::collections::{BTreeMap, BTreeSet};

/// The flaws of all MTL files of a mesh.
#[derive(Default)]
pub(super) struct Flaws {
    /// The files whose materials have flaws.
    pub files: Vec<FileFlaws>,
    /// The names of materials with several definitions that differ. After each name is the definition that is used.
    pub repeated: BTreeMap<String, Definition>,
    /// True if messages may contain these names.
    pub quotes: bool,
}

impl Flaws {
    /// Returns true if no material has flaws.
    pub fn is_empty(&self) -> bool {
        self.files.is_empty() && self.repeated.is_empty()
    }

    /// Returns notes on the materials that triangles use: those for which `used` is true.
    pub fn notes(self, used: &[bool]) -> Vec<String> {
        let names: Vec<_> =
            self.repeated.iter().filter(|(_, definition)| used[definition.index as usize]).collect();
        let several = names.first().map(|first| several_definitions(*first, names.len(), self.quotes));
        self.files.into_iter().flat_map(|file| file.notes(used)).chain(several).collect()
    }
}

/// Returns a note on `count` materials that have several different definitions, such as the material with the name and
/// the definition `first`.
fn several_definitions(first: (&String, &Definition), count: usize, quotes: bool) -> String {
    let such_as = if count == 1 { "for" } else { "for example, for" };
    let shown = || format!(" ({such_as} {}, the last one in {})", quoted(first.0.as_bytes()), first.1.file);
    let shown = if quotes { shown() } else { String::new() };
    let have = if count == 1 { "has" } else { "have" };
    let materials = counted(count, "material");
    format!(
        "{materials} {have} several definitions that differ: only one definition per material is used{shown}"
    )
}

/// A definition of a material.
#[derive(Clone)]
pub(super) struct Definition {
    /// The material's index in the list of all materials.
    pub index: u32,
    /// The name of the definition's file, for messages. Within this file, it is the last definition of its name.
    pub file: String,
}

/// The flaws of an MTL file.
pub(super) struct FileFlaws {
    /// The file's name in messages.
    pub name: String,
    pub text: Vec<u8>,
    /// True if messages may quote the file.
    pub quotes: bool,
    /// The index of the file's first material.
    pub first: usize,
    pub materials: Vec<LineFlaws>,
}

impl FileFlaws {
    fn notes(self, used: &[bool]) -> Vec<String> {
        let source = Source { name: &self.name, text: &self.text, quotes: self.quotes };
        let mut all = LineFlaws::default();
        let of_used = self.materials.into_iter().zip(used.iter().skip(self.first)).filter(|(_, used)| **used);
        of_used.for_each(|(flaws, _)| all.extend(flaws));
        all.notes(&source)
    }
}

/// The lines of a material that raycl ignores or replaces.
#[derive(Default)]
pub(super) struct LineFlaws {
    /// Lines with values that raycl cannot use.
    pub ignored: Ignored,
    /// Lines with more values than raycl reads.
    more: Seen,
    /// Lines with a colour that is probably meant as channels from 0 to 255.
    bright: Seen,
    /// Lines that replace another value of an earlier line of the same material.
    repeated: Seen,
    /// The keywords of the lines in `repeated`.
    repeated_keys: BTreeSet<String>,
}

impl LineFlaws {
    /// Returns true if there are no such lines.
    pub fn is_empty(&self) -> bool {
        self.ignored.is_empty() && [self.more, self.bright, self.repeated].iter().all(|seen| seen.count == 0)
    }

    /// Counts a line that raycl reads if the line has too many or too large values.
    pub fn look_at(&mut self, offset: usize, name: &[u8], rest: &[u8]) {
        self.more.at_if(values::has_more(name, rest), offset);
        self.bright.at_if(values::is_bright(name, rest), offset);
    }

    /// Counts a line that replaces another value.
    pub fn replaced(&mut self, offset: usize, key: String) {
        self.repeated.at(offset);
        self.repeated_keys.insert(key);
    }

    /// Adds the lines of a later material.
    fn extend(&mut self, later: Self) {
        self.ignored.extend(later.ignored);
        self.more = self.more.joined(later.more);
        self.bright = self.bright.joined(later.bright);
        self.repeated = self.repeated.joined(later.repeated);
        self.repeated_keys.extend(later.repeated_keys);
    }

    fn notes(&self, source: &Source) -> Vec<String> {
        let keys = few(&self.repeated_keys.iter().collect::<Vec<_>>());
        let repeated = format!("a later line replaces another value in the same material: {keys}");
        let counted = [(self.more, values::MORE), (self.bright, values::BRIGHT), (self.repeated, &repeated)];
        let before = format!("{}:", source.name);
        let counted =
            counted.into_iter().filter_map(|(lines, what)| source.note_on_lines(&before, lines, what));
        self.ignored.notes(source).chain(counted).collect()
    }
}
