//! Gives different names to scenes with different contents. If scenes have the same name, each gets
//! a new name: the end of its path, with as few folders as are needed to make the names differ.

use super::types::Record;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// The possible names of a scene.
struct Names {
    /// Names from the scene's path: the file's name alone, then with one folder before it, with two
    /// folders, and so on.
    paths: Vec<String>,
    /// Names for scenes whose paths are equal without the file's extension: a name with the
    /// extension, one with the values changed in the scene, and one with the scene's hash.
    others: [String; 3],
}

/// Renames scenes in records, so that different scenes have different names. Records of earlier
/// versions have no hash of the scene's content and are not renamed.
pub fn tell_scenes_apart(records: &mut [Record]) {
    let names = new_names(records.iter());
    for record in records {
        if let Some(name) = record.scene_hash.as_ref().and_then(|hash| names.get(hash)) {
            record.scene.clone_from(name);
        }
    }
}

/// Returns new names for those scenes of the records whose names are equal although their contents differ. A scene is
/// identified by the hash of its content.
pub fn new_names<'r>(records: impl Iterator<Item = &'r Record>) -> HashMap<String, String> {
    let mut scenes: HashMap<&str, Vec<(&str, Names)>> = HashMap::new();
    for record in records {
        let Some(hash) = record.scene_hash.as_deref() else { continue };
        let same_name = scenes.entry(&record.scene).or_default();
        if !same_name.iter().any(|(known, _)| *known == hash) {
            same_name.push((hash, Names::of(record)));
        }
    }
    let mut names: HashMap<String, String> = HashMap::new();
    for scenes in scenes.into_values().filter(|scenes| scenes.len() > 1) {
        let renamed = scenes.iter().zip(distinct(&scenes));
        names.extend(renamed.map(|((hash, _), name)| ((*hash).to_owned(), name.to_owned())));
    }
    names
}

/// Returns one name per scene. All names are of one kind (see [`Names::at`]): the first kind for which all names
/// differ. If no kind makes all names different, the names with hashes are returned.
fn distinct<'n>(scenes: &'n [(&str, Names)]) -> Vec<&'n str> {
    let depth = scenes.iter().map(|(_, names)| names.paths.len()).max().unwrap_or(0);
    let mut kinds =
        (0..depth + 3).map(|kind| scenes.iter().map(|(_, names)| names.at(kind, depth)).collect());
    let differ = |names: &Vec<&str>| names.iter().collect::<HashSet<_>>().len() == names.len();
    let last = depth + 2;
    kinds.find(differ).unwrap_or_else(|| scenes.iter().map(|(_, names)| names.at(last, depth)).collect())
}

impl Names {
    fn of(record: &Record) -> Self {
        let path = Path::new(record.scene_file.as_deref().unwrap_or_default());
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        // A suffix such as "+triangles=80" states a value that the config changed in the scene. It remains at the end
        // of the name.
        let suffix =
            record.scene.strip_prefix(&*stem).filter(|rest| rest.is_empty() || rest.starts_with('+'));
        let by = |what: &str| format!("{} ({what})", record.scene);
        let by_path = |path: &str| suffix.map_or_else(|| by(path), |suffix| format!("{path}{suffix}"));
        let bare = path.with_extension("");
        let parts: Vec<_> =
            bare.iter().map(|part| part.to_string_lossy()).filter(|part| part != "/").collect();
        let hash = record.scene_hash.as_deref().unwrap_or_default();
        Self {
            paths: (0..parts.len()).rev().map(|from| by_path(&parts[from..].join("/"))).collect(),
            others: [
                by_path(&path.display().to_string()),
                by(&record.scene_values.join(", ")),
                by(hash.get(..8).unwrap_or(hash)),
            ],
        }
    }

    /// Returns the scene's possible name of the given kind. Kinds from 0 to `depth - 1` are ends of
    /// the path; the following kinds are `others`. If a path has too few parts, the whole path is
    /// used.
    fn at(&self, kind: usize, depth: usize) -> &str {
        match kind.checked_sub(depth) {
            None => self.paths.get(kind).or(self.paths.last()).map_or("", String::as_str),
            Some(other) => self.others.get(other).map_or("", String::as_str),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn renamed(scenes: &[(&str, &str, &str, &str)]) -> Vec<String> {
        let record = |(name, file, value, hash): &(&str, &str, &str, &str)| Record {
            scene: (*name).to_owned(),
            scene_file: Some((*file).to_owned()),
            scene_values: vec![(*value).to_owned()],
            scene_hash: Some((*hash).to_owned()),
            ..Record::default()
        };
        let mut records: Vec<_> = scenes.iter().map(record).collect();
        tell_scenes_apart(&mut records);
        records.into_iter().map(|record| record.scene).collect()
    }

    #[test]
    fn namesakes_get_the_shortest_path_that_differs() {
        let files = [
            ("scene", "x/a/scene.obj", "", "1"),
            ("scene", "x/b/scene.obj", "", "2"),
            ("other", "", "", "3"),
        ];
        assert_eq!(renamed(&files), ["a/scene", "b/scene", "other"]);
        let deeper = [("scene", "a/x/scene.obj", "", "1"), ("scene", "b/x/scene.obj", "", "2")];
        assert_eq!(renamed(&deeper), ["a/x/scene", "b/x/scene"]);
        let above = [("scene", "scene.obj", "", "1"), ("scene", "b/scene.obj", "", "2")];
        assert_eq!(renamed(&above), ["scene", "b/scene"]);
        let endings = [("scene", "a/scene.obj", "", "1"), ("scene", "a/scene.toml", "", "2")];
        assert_eq!(renamed(&endings), ["a/scene.obj", "a/scene.toml"]);
    }

    #[test]
    fn names_that_are_not_the_files_have_it_in_brackets() {
        let files = [("a", "eighty.toml", "", "1"), ("a", "many.toml", "", "2")];
        assert_eq!(renamed(&files), ["a (eighty)", "a (many)"]);
    }

    #[test]
    fn a_file_with_values_set_keeps_them_and_the_same_scene_its_name() {
        let sweep = [
            ("s+size=1", "a/s.toml", "object.0.size = 1", "1"),
            ("s+size=1", "b/s.toml", "object.0.size = 1", "2"),
        ];
        assert_eq!(renamed(&sweep), ["a/s+size=1", "b/s+size=1"]);
        let keys = [
            ("s+size=1", "s.toml", "object.0.size = 1", "1"),
            ("s+size=1", "s.toml", "object.1.size = 1", "2"),
        ];
        assert_eq!(renamed(&keys), ["s+size=1 (object.0.size = 1)", "s+size=1 (object.1.size = 1)"]);
        let edited = [("s", "s.toml", "", "0123456789"), ("s", "s.toml", "", "9876543210")];
        assert_eq!(renamed(&edited), ["s (01234567)", "s (98765432)"]);
        assert_eq!(renamed(&[("s", "a/s.toml", "", "1"), ("s", "b/s.toml", "", "1")]), ["s", "s"]);
    }
}
