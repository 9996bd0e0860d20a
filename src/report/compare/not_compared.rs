//! Writes lines about the points and scenes that only one of two compared folders has.

use super::Comparison;
use super::pair::name;
use crate::record::Record;
use std::collections::{HashMap, HashSet};

impl Comparison {
    /// Adds a line to `others` for each point that only one of the two folders has. If scenes correspond by
    /// content, and both folders have a scene of the same name but with different contents, adds a single
    /// line about the scene instead of lines about its points.
    pub(super) fn say_what_only_one_has(&mut self, only: &[Vec<Record>; 2], by_content: bool) {
        let contents = only.each_ref().map(|records| contents(records));
        let changed = |record: &Record, others: &Contents<'_>| {
            let is_other = |other: &Option<&str>| *other != record.scene_hash.as_deref();
            by_content && others.get(&sized(record)).is_some_and(|hashes| hashes.iter().any(is_other))
        };
        let mut said: HashSet<String> = self.others.iter().cloned().collect();
        for (label, records) in only.iter().enumerate() {
            for record in records {
                let line = match changed(record, &contents[1 - label]) {
                    true => format!("{}: the two folders have different scenes of this name", record.scene),
                    false => {
                        format!("{}: only in {}", name(record, self.several_devices), self.labels[label])
                    }
                };
                if said.insert(line.clone()) {
                    self.others.push(line);
                }
            }
        }
    }
}

/// The hashes of scenes' contents, by the scene's name and the image size. If raycl places a scene's camera,
/// the content of the scene depends on the image size. Each value of the map is a set, because scenes with
/// different contents can have one name. `None` stands for an unknown hash.
type Contents<'r> = HashMap<(&'r str, [u32; 2]), HashSet<Option<&'r str>>>;

fn contents(records: &[Record]) -> Contents<'_> {
    let mut contents = Contents::new();
    for record in records {
        contents.entry(sized(record)).or_default().insert(record.scene_hash.as_deref());
    }
    contents
}

/// Returns the name of a record's scene, and the image size.
fn sized(record: &Record) -> (&str, [u32; 2]) {
    (&record.scene, record.image_size)
}
