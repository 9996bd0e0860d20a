//! The folder in which PoCL stores compiled kernels. Without a folder that it can write, PoCL lists no device.

use std::path::{Path, PathBuf};

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
    let folder = crate::cache::temporary().map(|folder| folder.join("pocl"));
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

/// Returns whether this process can write into a folder, or can create it if it does not exist. The function tests
/// this by creating a temporary file in the nearest existing folder. Permission bits alone show too little: for
/// the superuser they permit writing even if the file system does not.
fn can_be_written(folder: &Path) -> bool {
    let existing = folder.ancestors().find(|folder| folder.symlink_metadata().is_ok());
    existing.is_some_and(|existing| existing.is_dir() && tempfile::tempfile_in(existing).is_ok())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_folder_can_be_written_if_its_nearest_existing_ancestor_can() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        std::fs::write(&file, "").expect("a file");
        assert!(can_be_written(folder.path()) && can_be_written(&folder.path().join("a/b/c")));
        assert!(!can_be_written(&file) && !can_be_written(&file.join("a/b")));
        #[cfg(target_os = "linux")]
        assert!(!can_be_written(Path::new("/proc/a/b")), "not even the superuser can");
        std::os::unix::fs::symlink("nowhere", folder.path().join("broken")).expect("a link");
        assert!(!can_be_written(&folder.path().join("broken/a")));
    }
}
