//! Suggests corrections of misspelt names.

use std::path::{Path, PathBuf};

/// Returns the candidate most similar to `word`, if one is similar enough.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // A word that is much longer than every name is not a misspelt name, and comparing it would take long.
    let candidates = candidates.into_iter().filter(|_| word.len() <= 100);
    candidates
        .map(|candidate| (strsim::damerau_levenshtein(word, candidate), candidate))
        .filter(|(distance, candidate)| *distance <= 1 + candidate.len() / 3)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Looks for a missing file in its folder. Returns the file or folder with the most similar name, if one is similar
/// enough.
pub fn nearest_file(missing: &Path) -> Option<PathBuf> {
    let folder = missing.parent().filter(|folder| !folder.as_os_str().is_empty());
    let names: Vec<String> = std::fs::read_dir(folder.unwrap_or(Path::new(".")))
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
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
        // Of a name with five letters, two may be wrong, but not three.
        assert_eq!((nearest("lcl", names), nearest("loxyz", names)), (Some("local"), None));
        let [most, longer] = [100, 101].map(|length| "k".repeat(length));
        assert_eq!((nearest(&most, [&*most]), nearest(&longer, [&*longer])), (Some(&*most), None));
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
    }
}
