//! The folder in which PoCL stores compiled kernels. Without a folder that it can write, PoCL lists no device.

use crate::cache::{can_be_written, temporary};
use std::path::PathBuf;

/// PoCL's environment variable for this folder.
const FOLDER: &str = "POCL_CACHE_DIR";

/// Returns the environment variables to set before a driver is loaded. If PoCL cannot write its default folder, the
/// variables name a private folder among the temporary files instead. Returns no variables if PoCL can write its
/// default folder, or if the user has set `POCL_CACHE_DIR`.
pub fn cache_variables() -> Vec<(&'static str, String)> {
    let named = std::env::var_os(FOLDER).is_some();
    if named || default_folder().is_none_or(|folder| can_be_written(&folder)) {
        return Vec::new();
    }
    let folder = temporary().map(|folder| folder.join("pocl"));
    folder.and_then(|folder| folder.to_str().map(|name| (FOLDER, name.to_owned()))).into_iter().collect()
}

/// Returns advice if PoCL cannot write its folder, and therefore lists no device.
pub fn cache_advice() -> Option<String> {
    let named = std::env::var_os(FOLDER).map(PathBuf::from);
    let folder = named.or_else(default_folder).filter(|folder| !can_be_written(folder))?;
    Some(format!(
        "PoCL lists no device if it cannot write to its folder for compiled kernels, '{}'; \
         set {FOLDER} to a folder to which you can write",
        folder.display()
    ))
}

/// Returns the folder that PoCL uses if `POCL_CACHE_DIR` is not set. Returns `None` if `XDG_CACHE_HOME` and `HOME` are
/// not set either: PoCL then uses a folder among the temporary files.
fn default_folder() -> Option<PathBuf> {
    let place = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let caches = place("XDG_CACHE_HOME").or_else(|| Some(place("HOME")?.join(".cache")))?;
    Some(caches.join("pocl/kcache"))
}
