//! The user's folders, as the XDG base directory specification says (<https://specifications.freedesktop.org/basedir-spec/latest/>).

use std::path::{Path, PathBuf};

/// Returns the folder `raycl` within the folder that `variable` names, or else within `below` of the home
/// folder; `None` if neither is known.
pub fn folder(variable: &str, below: &str) -> Option<PathBuf> {
    let base = named(variable).or_else(|| Some(home()?.join(below)))?;
    Some(base.join("raycl"))
}

/// Replaces a leading `~` by the home folder.
pub fn expanded(path: &Path) -> PathBuf {
    let Ok(rest) = path.strip_prefix("~") else { return path.to_owned() };
    home().map_or_else(|| path.to_owned(), |home| home.join(rest))
}

fn home() -> Option<PathBuf> {
    named("HOME")
}

/// Returns the path in a variable; a relative path is ignored.
fn named(variable: &str) -> Option<PathBuf> {
    std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute())
}
