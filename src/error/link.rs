//! Finds links that lead to nothing.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Returns the target of the link at `path` if the target does not exist; `None` if the target exists, or if `path` is
/// no link. The target is as the link names it.
pub fn missing_target(path: &Path) -> Option<PathBuf> {
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
        assert_eq!([gone, around].map(|link| missing_target(&link)), [Some("nothing".into()), None]);
    }
}
