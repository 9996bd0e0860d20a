//! Suggests corrections of misspelt names.

use crate::reader::folder_of;
use std::path::{Path, PathBuf};

/// Returns the candidate most similar to `word`, or `None` if no candidate is similar enough. Upper and lower
/// case matter only if several candidates are equally similar apart from case.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // A word that is much longer than every name is not a misspelt name, and comparing it would take long.
    let candidates = candidates.into_iter().filter(|_| word.len() <= 100);
    let small = word.to_lowercase();
    candidates
        .map(|candidate| (strsim::damerau_levenshtein(&small, &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len() / 3)
        // Words without a common character are not similar, however short they are.
        .filter(|(distance, candidate)| *distance < word.chars().count().max(candidate.chars().count()))
        .min_by_key(|(distance, candidate)| (*distance, strsim::damerau_levenshtein(word, candidate)))
        .map(|(_, candidate)| candidate)
}

/// Returns a question with the name most similar to `word`: "did you mean 'vectors'?". Returns `None` if no
/// name is similar enough.
pub fn meant<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(word, names).map(|name| format!("did you mean '{name}'?"))
}

/// Returns the end of a message about an unknown word: "; did you mean `vectors`?", or nothing if no name is similar
/// enough.
pub fn or_meant<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(word, names).map_or(String::new(), |name| format!("; did you mean `{name}`?"))
}

/// Returns the file with the most similar name in the folder of a missing file, or `None` if no name is
/// similar enough.
pub fn nearest_file(missing: &Path) -> Option<PathBuf> {
    nearest_file_among(missing, |_| true)
}

/// Like [`nearest_file`], but returns only a file whose path `fits` accepts.
pub fn nearest_file_among(missing: &Path, fits: impl Fn(&Path) -> bool) -> Option<PathBuf> {
    nearest_entry(missing, |path| path.is_file() && fits(path))
}

/// Returns the folder with the most similar name beside a missing folder, or `None` if no name is similar
/// enough.
pub fn nearest_folder(missing: &Path) -> Option<PathBuf> {
    nearest_entry(missing, Path::is_dir)
}

/// Returns the file or folder with the most similar name in the folder of `missing`, among the files and
/// folders whose paths `fits` accepts. Returns `None` if no name is similar enough.
fn nearest_entry(missing: &Path, fits: impl Fn(&Path) -> bool) -> Option<PathBuf> {
    let names: Vec<String> = std::fs::read_dir(folder_of(missing))
        .ok()?
        .filter_map(|entry| entry.ok().filter(|entry| fits(&entry.path()))?.file_name().into_string().ok())
        .collect();
    let wanted = missing.file_name()?.to_string_lossy();
    let meant = nearest(&wanted, names.iter().map(String::as_str)).filter(|name| *name != wanted)?;
    Some(missing.with_file_name(meant))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn nearest_finds_a_misspelt_name_and_refuses_a_strange_one() {
        let names = ["private", "global", "local"];
        assert_eq!(nearest("globl", names), Some("global"));
        assert_eq!(nearest("zzzzzzzz", names), None);
        // For a candidate with five letters, a word with two wrong letters is similar enough, and a word with three is
        // not.
        assert_eq!((nearest("lcl", names), nearest("loxyz", names)), (Some("local"), None));
        let [most, longer] = [100, 101].map(|length| "k".repeat(length));
        assert_eq!((nearest(&most, [&*most]), nearest(&longer, [&*longer])), (Some(&*most), None));
        let materials = ["red", "RED", "Red"];
        assert_eq!((nearest("Red", materials), nearest("reD", materials)), (Some("Red"), Some("red")));
        assert_eq!(nearest("M1.OBJ", ["M2.stl", "m1.obj"]), Some("m1.obj"));
        assert_eq!((nearest("-", ["k", "x"]), nearest("", ["k"])), (None, None));
        // Of equally similar names, the first is returned. A more similar name is preferred to an earlier name.
        assert_eq!((nearest("a1", ["a2", "a3"]), nearest("a1", ["b2", "a1b"])), (Some("a2"), Some("a1b")));
    }

    #[test]
    fn nearest_file_looks_beside_the_missing_one() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("teapot.toml"), "").unwrap();
        let meant = nearest_file(&folder.path().join("taepot.toml"));
        assert_eq!(meant, Some(folder.path().join("teapot.toml")));
        assert_eq!(nearest_file(&folder.path().join("nowhere/teapot.toml")), None);
        std::fs::create_dir(folder.path().join("taepot")).unwrap();
        assert_eq!(nearest_file(&folder.path().join("teapot")), None, "a folder is no file");
        let meant = nearest_folder(&folder.path().join("teapot"));
        assert_eq!(meant, Some(folder.path().join("taepot")));
        assert_eq!(nearest_folder(&folder.path().join("teapot.tom")), None, "a file is no folder");
    }
}
