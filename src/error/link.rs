//! Finds links that lead to nothing.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Returns the target of the link at `path` if the target does not exist; `None` if the target exists, or if `path` is
/// no link. The target is as the link names it.
pub fn missing_target(path: &Path) -> Option<PathBuf> {
    let target = path.read_link().ok()?;
    path.metadata().is_err_and(|error| error.kind() == ErrorKind::NotFound).then_some(target)
}
