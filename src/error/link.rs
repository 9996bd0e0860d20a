//! Finds links that lead to nothing.

use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// Returns the end of a sentence that begins with the name of the link at `path`: it says that the link's target is
/// missing. Returns `None` if the target exists, or if `path` is no link.
pub fn broken_link(path: &Path) -> Option<String> {
    missing_target(path).map(|target| format!("is a link to `{}`, which is missing", target.display()))
}

/// Returns why the file at `path` could not be read: the end of a sentence that begins with the file's name. `error` is
/// the error of the system.
pub fn why_unread(path: &Path, error: &Error) -> String {
    let link = (error.kind() == ErrorKind::NotFound).then(|| broken_link(path)).flatten();
    link.unwrap_or_else(|| format!("cannot be read ({error})"))
}

/// Returns the target of the link at `path` if the target does not exist; `None` if the target exists, or if `path` is
/// no link. The target is as the link names it.
fn missing_target(path: &Path) -> Option<PathBuf> {
    let target = path.read_link().ok()?;
    path.metadata().is_err_and(|error| error.kind() == ErrorKind::NotFound).then_some(target)
}

#[cfg(all(test, unix))]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_link_that_leads_to_itself_has_no_missing_target() {
        let folder = tempfile::tempdir().unwrap();
        let [gone, around] = ["gone", "around"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink("nothing", &gone).unwrap();
        std::os::unix::fs::symlink("around", &around).unwrap();
        assert_eq!([&gone, &around].map(|link| missing_target(link)), [Some("nothing".into()), None]);
        let why = |path: &Path| why_unread(path, &std::fs::read(path).unwrap_err());
        assert_eq!(why(&gone), "is a link to `nothing`, which is missing");
        let others = [around, folder.path().join("no link")].map(|path| why(&path));
        assert!(others.iter().all(|why| why.starts_with("cannot be read (")), "{others:?}");
    }
}
