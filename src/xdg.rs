//! The user's folders, as the XDG base directory specification says (<https://specifications.freedesktop.org/basedir-spec/latest/>).

use std::path::{Path, PathBuf};

/// `raycl` in the folder that `variable` names, or else in `below` of the home folder; none where neither is known.
pub fn folder(variable: &str, below: &str) -> Option<PathBuf> {
    let base = named(variable).or_else(|| Some(home()?.join(below)))?;
    Some(base.join("raycl"))
}

/// A path whose first part is `~` with the home folder in its place.
pub fn expanded(path: &Path) -> PathBuf {
    let Ok(rest) = path.strip_prefix("~") else { return path.to_owned() };
    home().map_or_else(|| path.to_owned(), |home| home.join(rest))
}

fn home() -> Option<PathBuf> {
    named("HOME")
}

/// A path that is not absolute counts as none.
fn named(variable: &str) -> Option<PathBuf> {
    std::env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute())
}
