//! Gives different names to scenes with different contents. If several scenes have the same name, each of
//! these scenes gets a new name with the end of the scene's path. The end has as few folders as are needed to
//! make the new names differ from each other, and from the names of all other scenes. If even the scenes' whole
//! paths do not make all names differ, each of the scenes gets one of the names in [`Names::others`].

use super::types::Record;
use crate::entry::entry;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

/// The possible names of a scene.
struct Names {
    /// Names from the scene's path: the file's name alone, the file's name after one folder, the file's name
    /// after two folders, and so on.
    paths: Vec<String>,
    /// Names that are used if the names in `paths` do not differ between scenes, or if other scenes have these
    /// names. The first name in `others` contains the whole path with the file's extension, the second the values
    /// that the config changed in the scene, and the third the beginning of the scene's hash.
    others: [String; 3],
}

/// Renames scenes in records, so that different scenes have different names. Scenes in records of earlier
/// versions of raycl, which do not contain the hash of the scene's content, are not renamed.
pub fn tell_scenes_apart(records: &mut [Record]) {
    let names = new_names(records.iter());
    for record in records {
        if let Some(name) = record.scene_hash.as_ref().and_then(|hash| names.get(hash)) {
            record.scene.clone_from(name);
        }
    }
}

/// Returns a map with new names for different scenes that have the same name in the records. No other scene of
/// the records has one of the new names. The keys of the map are the hashes of the scenes' contents.
pub fn new_names<'r>(records: impl Iterator<Item = &'r Record>) -> HashMap<String, String> {
    let mut taken: HashSet<String> = HashSet::new();
    let mut contents: BTreeMap<&str, Vec<Content<'_>>> = BTreeMap::new();
    for record in records {
        taken.insert(record.scene.clone());
        let Some(hash) = record.scene_hash.as_deref() else { continue };
        let same_name = contents.entry(&record.scene).or_default();
        let new = || Content { hash, image_sizes: HashSet::new(), record };
        let content = entry(same_name, |known| known.hash == hash, new);
        content.image_sizes.insert(record.image_size);
    }
    let mut new_names = HashMap::new();
    let named = contents.into_iter().map(|(old, contents)| (old, scenes_of(contents)));
    for (old, scenes) in named.filter(|(_, scenes)| scenes.len() > 1) {
        let names: Vec<Names> = scenes.iter().map(|contents| Names::of(contents[0].record)).collect();
        let is_free = |new: &str| new == old || !taken.contains(new);
        let new: Vec<String> = distinct(&names, is_free).into_iter().map(str::to_owned).collect();
        for (contents, name) in scenes.iter().zip(&new) {
            new_names.extend(contents.iter().map(|content| (content.hash.to_owned(), name.clone())));
        }
        taken.extend(new);
    }
    new_names
}

/// The content of a scene, including the camera, as some records describe it.
struct Content<'r> {
    hash: &'r str,
    image_sizes: HashSet<[u32; 2]>,
    /// The first record of a scene with this content.
    record: &'r Record,
}

impl Content<'_> {
    /// Returns true if `self` and `other` probably belong to one scene, whose camera raycl places differently
    /// for images of different shapes. `self` and `other` must have the same scene file with the same changed
    /// values, but no image size in common. Returns false if the record of `self` states no scene file: early
    /// versions of raycl wrote such records, and placed the camera without regard to the image's shape.
    fn is_other_shape_of(&self, other: &Self) -> bool {
        let is_known = self.record.scene_file.is_some();
        is_known && self.made_of() == other.made_of() && self.image_sizes.is_disjoint(&other.image_sizes)
    }

    /// Returns the scene's file, and the scene's values that the config changes.
    fn made_of(&self) -> (Option<&str>, &[String]) {
        (self.record.scene_file.as_deref(), &self.record.scene_values)
    }
}

/// Finds out which of the contents with one scene name belong to the same scene. Several contents belong to
/// one scene if they probably differ only in the camera, which raycl placed for images of different shapes
/// (see [`Content::is_other_shape_of`]). Each inner list of the result has the contents of one scene.
fn scenes_of(contents: Vec<Content<'_>>) -> Vec<Vec<Content<'_>>> {
    let mut scenes: Vec<Vec<Content<'_>>> = Vec::new();
    for content in contents {
        let is_its = |scene: &Vec<Content<'_>>| scene.iter().all(|known| known.is_other_shape_of(&content));
        entry(&mut scenes, is_its, Vec::new).push(content);
    }
    scenes
}

/// Returns one name per scene. All names are made by the same rule (see [`Names::at`]). This is the first
/// rule by which all names differ from each other, and are free (names of no other scene). If there is no
/// such rule, returns the names with hashes.
fn distinct(scenes: &[Names], is_free: impl Fn(&str) -> bool) -> Vec<&str> {
    let depth = scenes.iter().map(|names| names.paths.len()).max().unwrap_or(0);
    let mut kinds = (0..depth + 3).map(|kind| scenes.iter().map(|names| names.at(kind, depth)).collect());
    let differ = |names: &Vec<&str>| {
        names.iter().all(|name| is_free(name)) && names.iter().collect::<HashSet<_>>().len() == names.len()
    };
    let last = depth + 2;
    kinds.find(differ).unwrap_or_else(|| scenes.iter().map(|names| names.at(last, depth)).collect())
}

impl Names {
    fn of(record: &Record) -> Self {
        let path = Path::new(record.scene_file.as_deref().unwrap_or_default());
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        // A suffix such as "+triangles=80" states a value that the config changed in the scene. If the
        // scene's old name is the file's name with such a suffix, new names with a path end with the same suffix.
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

    /// Returns the scene's name by the rule with the number `kind`. By the rules from 0 to `depth - 1`, the
    /// name is an end of the scene's path: the file after `kind` folders. If the path has fewer folders, the
    /// name is the whole path. By the following rules, the name is one of the names in `others`.
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

    /// If two scenes got the same name, their points would be in one table. Of two points with the same strategy and
    /// local size, the table that `raycl run` prints would then show only one.
    #[test]
    fn a_new_name_is_that_of_no_other_scene() {
        let stated = [
            ("tri", "p/tri.toml", "", "1"),
            ("tri", "q/tri.toml", "", "2"),
            ("p/tri", "other.toml", "", "3"),
        ];
        assert_eq!(renamed(&stated), ["p/tri.toml", "q/tri.toml", "p/tri"]);
        let both_new = [
            ("d/a", "b.toml", "", "1"),
            ("d/a", "c.toml", "", "2"),
            ("a (b)", "d/a (b).toml", "", "3"),
            ("a (b)", "e/a (b).toml", "", "4"),
        ];
        assert_eq!(renamed(&both_new), ["d/a (b.toml)", "d/a (c.toml)", "d/a (b)", "e/a (b)"]);
    }

    #[test]
    fn a_scene_that_is_framed_for_each_shape_of_the_images_keeps_one_name() {
        let record = |file: &str, hash: &str, image_size| Record {
            scene: "bunny".to_owned(),
            scene_file: Some(file.to_owned()),
            scene_hash: Some(hash.to_owned()),
            image_size,
            ..Record::default()
        };
        let (square, wide) = ([8, 8], [8, 5]);
        let renamed = |records: &[Record]| {
            let mut records = records.to_vec();
            tell_scenes_apart(&mut records);
            records.into_iter().map(|record| record.scene).collect::<Vec<_>>()
        };
        let of = |file: &str, [one, other]: [&str; 2]| [record(file, one, square), record(file, other, wide)];
        assert_eq!(renamed(&of("a/bunny.obj", ["1", "2"])), ["bunny", "bunny"]);
        let both = [of("a/bunny.obj", ["1", "2"]), of("b/bunny.obj", ["3", "4"])].concat();
        assert_eq!(renamed(&both), ["a/bunny", "a/bunny", "b/bunny", "b/bunny"]);
        // The scene's file was changed between two runs, so the records have two contents for the same image
        // size.
        let edited = [of("bunny.obj", ["1", "1"]), of("bunny.obj", ["2", "2"])].concat();
        assert_eq!(renamed(&edited), ["bunny (1)", "bunny (1)", "bunny (2)", "bunny (2)"]);
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
