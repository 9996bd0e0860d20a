//! The user's folders, according to the XDG base directory specification
//! (<https://specifications.freedesktop.org/basedir-spec/latest/>).

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Returns the folder `raycl` in the folder that the environment variable `variable` names. If the variable names no
/// folder, returns the folder `raycl` in the subfolder `below` of the home folder; `None` if the home folder is unknown
/// too.
pub fn folder(variable: &str, below: &str) -> Option<PathBuf> {
    let base = named(variable).or_else(|| Some(home()?.join(below)))?;
    Some(base.join("raycl"))
}

/// Replaces a leading `~` by the home folder.
///
/// # Errors
///
/// Returns a message if the path begins with `~` and the home folder is unknown. Also returns a message if
/// the path begins with `$`, or with `~` and a name: only a shell could expand this path, and nobody wants a
/// folder with this name.
pub fn expanded(path: &Path) -> Result<PathBuf, String> {
    if let Ok(rest) = path.strip_prefix("~") {
        let home = home().ok_or("`~` needs HOME, which is not set to an absolute path")?;
        return Ok(home.join(rest));
    }
    match path.as_os_str().as_encoded_bytes().first() {
        Some(b'~' | b'$') => Err("only `~` alone, or `~/` at the start, is replaced by a folder".to_owned()),
        _ => Ok(path.to_owned()),
    }
}

fn home() -> Option<PathBuf> {
    named("HOME")
}

/// Returns the path in an environment variable; `None` if the variable is not set or the path is relative.
fn named(variable: &str) -> Option<PathBuf> {
    absolute(std::env::var_os(variable))
}

/// Returns the path in the value of a variable; `None` if the variable has no value or the path is relative.
fn absolute(value: Option<OsString>) -> Option<PathBuf> {
    value.map(PathBuf::from).filter(|path| path.is_absolute())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relative_path_and_an_empty_value_name_no_folder() {
        let of = |value: &str| absolute(Some(value.into()));
        assert!([absolute(None), of(""), of("caches"), of("./caches")].iter().all(Option::is_none));
        let here = env!("CARGO_MANIFEST_DIR");
        assert_eq!(of(here), Some(PathBuf::from(here)));
    }
}
