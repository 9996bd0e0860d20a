//! The folder in which PoCL stores compiled kernels. If PoCL cannot write to this folder, it lists no device.

use crate::cache::{can_be_written, temporary};
use std::path::{Path, PathBuf};

/// PoCL's environment variable that names its folder for compiled kernels.
const FOLDER: &str = "POCL_CACHE_DIR";
/// A disk with less free space than this number of bytes counts as full. PoCL usually writes some hundred KiB
/// for each program.
const ROOM_BYTES: u64 = 1 << 20;

/// Returns the environment variables to set before a driver is loaded. If PoCL cannot write to its default
/// folder, the variables name a private folder among the temporary files instead. Returns no variables if
/// PoCL can write to its default folder, or if the user has set `POCL_CACHE_DIR`.
pub fn cache_variables() -> Vec<(&'static str, String)> {
    let named = std::env::var_os(FOLDER).is_some();
    if named || default_folder().is_none_or(|folder| can_be_written(&folder)) {
        return Vec::new();
    }
    let folder = temporary().map(|folder| folder.join("pocl"));
    folder.and_then(|folder| folder.to_str().map(|name| (FOLDER, name.to_owned()))).into_iter().collect()
}

/// Returns advice if PoCL cannot write to its folder for compiled kernels, and therefore lists no device.
pub fn cache_advice() -> Option<String> {
    let folder = folder().filter(|folder| !can_be_written(folder))?;
    Some(format!(
        "PoCL lists no device if it cannot write to its folder for compiled kernels, '{}'; \
         set {FOLDER} to a folder to which you can write",
        folder.display()
    ))
}

/// Returns advice if the disk with PoCL's folder for compiled kernels is full: PoCL then reports that the
/// build of a program has failed, or PoCL ends the process.
pub fn full_disk_advice() -> Option<String> {
    let folder = folder()?;
    advice_for(free_bytes(&folder)?, &folder)
}

/// Returns advice if a disk with `free_bytes` bytes of free space counts as full. `folder` is PoCL's folder
/// on the disk.
fn advice_for(free_bytes: u64, folder: &Path) -> Option<String> {
    (free_bytes < ROOM_BYTES).then(|| {
        format!(
            "the disk of PoCL's folder for compiled kernels, '{}', is full: free up space on it, or set {FOLDER} to a \
             folder on another disk; `raycl run` measures failed points again with --resume --retry-failed",
            folder.display()
        )
    })
}

/// Returns the free bytes on a folder's disk; `None` if the folder is missing, or if the system reports no
/// disk.
#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok().filter(|disk| disk.f_blocks > 0)?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

/// On systems other than Unix, raycl does not ask for the free space.
#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<u64> {
    None
}

/// Returns the folder that `POCL_CACHE_DIR` names or, if this variable is not set, PoCL's default folder.
fn folder() -> Option<PathBuf> {
    std::env::var_os(FOLDER).map(PathBuf::from).or_else(default_folder)
}

/// Returns the folder that PoCL uses if `POCL_CACHE_DIR` is not set. Returns `None` if `XDG_CACHE_HOME` and `HOME` are
/// not set either: PoCL then uses a folder among the temporary files.
fn default_folder() -> Option<PathBuf> {
    let path_in = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let caches = path_in("XDG_CACHE_HOME").or_else(|| Some(path_in("HOME")?.join(".cache")))?;
    Some(caches.join("pocl/kcache"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_reported_with_its_folder() {
        let advice = advice_for(40_000, Path::new("/caches/pocl")).expect("advice");
        let start = "the disk of PoCL's folder for compiled kernels, '/caches/pocl', is full: free up space";
        assert!(advice.starts_with(start), "{advice}");
        assert!(advice.contains("POCL_CACHE_DIR") && advice.ends_with("--resume --retry-failed"), "{advice}");
        assert_eq!(advice_for(ROOM_BYTES, Path::new("/caches/pocl")), None);
    }

    #[test]
    #[cfg(unix)]
    fn the_free_space_is_that_of_the_folders_disk() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(free_bytes(folder.path()).is_some_and(|bytes| bytes > 0));
        assert_eq!(free_bytes(&folder.path().join("missing")), None);
    }
}
