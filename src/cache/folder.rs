//! Finds the cache's folder, and checks who owns it. raycl runs programs from the cache, so only the user may
//! write to this folder.

use crate::error::{Error, Result};
use std::ffi::OsStr;
use std::fs::ReadDir;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The environment variable that limits the cache's size in MiB; 0 turns the cache off.
pub const LIMIT: &str = "RAYCL_CACHE_MIB";
const DEFAULT_LIMIT_MIB: u64 = 512;

/// Returns the limit of the cache's size in bytes, from the environment. If the variable's value is not a
/// whole number of MiB, this function returns the default limit. raycl's commands refuse such a value
/// ([`check_limit`]).
pub fn limit_bytes() -> u64 {
    limit_of(std::env::var_os(LIMIT).as_deref()).unwrap_or(DEFAULT_LIMIT_MIB << 20)
}

/// Returns an input error if the environment variable that limits the cache's size is not a whole number of MiB.
pub fn check_limit() -> Result<()> {
    limit_of(std::env::var_os(LIMIT).as_deref()).map(|_| ())
}

/// Returns the limit in bytes that the variable's text gives, or the default if the text is blank.
fn limit_of(text: Option<&OsStr>) -> Result<u64> {
    let text = text.map(OsStr::to_string_lossy).filter(|text| !text.trim().is_empty());
    let mib = text.map_or(Ok(DEFAULT_LIMIT_MIB), |text| {
        let message = format!("{LIMIT}: '{text}' is not a whole number of MiB");
        let error =
            |_| Error::input(message).with_help("set it to a number such as 512, or to 0 for no cache");
        text.trim().parse().map_err(error)
    })?;
    Ok(mib.saturating_mul(1 << 20))
}

/// Returns the folder `raycl` in the user's cache folder; `None` if the environment names no cache folder.
pub fn of_user() -> Option<PathBuf> {
    crate::xdg::folder("XDG_CACHE_HOME", ".cache")
}

/// Makes a private folder among the temporary files. Later processes of this user get the same folder.
/// Returns `None` if the folder cannot be made, if the path is a link, or if somebody else owns the folder or
/// may write into it.
#[cfg(unix)]
pub fn temporary() -> Option<PathBuf> {
    let user = rustix::process::geteuid().as_raw();
    let folder = std::env::temp_dir().join(format!("raycl-{user}"));
    make(&folder).ok()?;
    let own = folder.symlink_metadata().is_ok_and(|metadata| metadata.is_dir());
    (own && trusted(&folder).is_some()).then_some(folder)
}

#[cfg(not(unix))]
pub fn temporary() -> Option<PathBuf> {
    None
}

/// Makes a folder that only its owner can use.
#[cfg(unix)]
pub fn make(folder: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::DirBuilderExt as _;
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

#[cfg(not(unix))]
pub fn make(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)
}

/// Returns the folder if it belongs to the user and nobody else may write into it; otherwise `None`.
pub fn trusted(folder: &Path) -> Option<&Path> {
    let metadata = folder.metadata().ok()?;
    (metadata.is_dir() && is_own(&metadata)).then_some(folder)
}

/// Returns why raycl cannot use a folder for the cache; `None` if raycl can use the folder, or can make it.
pub fn why_unusable(folder: &Path) -> Option<&'static str> {
    match folder.metadata() {
        Ok(metadata) if !metadata.is_dir() => Some("it is not a folder"),
        Ok(metadata) if !is_own(&metadata) => {
            Some("another user owns it, or users other than its owner may write into it")
        }
        _ if files(folder).is_err() => Some("raycl cannot list its files"),
        _ => (!can_be_written(folder)).then_some("raycl cannot write into it"),
    }
}

/// Returns the files in a folder; `None` if `folder` does not exist or is not a folder.
pub fn files(folder: &Path) -> std::io::Result<Option<ReadDir>> {
    match std::fs::read_dir(folder) {
        Ok(files) => Ok(Some(files)),
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Returns true if this process can write into a folder, or can create the folder if it does not exist. The
/// function tests this by creating a temporary file in the folder or, if the folder does not exist, in its
/// nearest ancestor that exists. A test of the permission bits is not sufficient: they permit the superuser
/// to write even if the file system is read-only.
pub fn can_be_written(folder: &Path) -> bool {
    let existing = folder.ancestors().find(|folder| folder.symlink_metadata().is_ok());
    existing.is_some_and(|existing| existing.is_dir() && tempfile::tempfile_in(existing).is_ok())
}

/// Reads an ordinary file that belongs to the user and that nobody else may write. Returns `None` for all other files,
/// and for links.
pub fn read_own(path: &Path) -> Option<Vec<u8>> {
    let metadata = path.symlink_metadata().ok()?;
    if !metadata.is_file() || !is_own(&metadata) {
        return None;
    }
    std::fs::read(path).ok()
}

#[cfg(unix)]
fn is_own(metadata: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    const OTHERS_WRITE: u32 = 0o022;
    metadata.uid() == rustix::process::geteuid().as_raw() && metadata.mode() & OTHERS_WRITE == 0
}

#[cfg(not(unix))]
fn is_own(_: &std::fs::Metadata) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
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

    #[test]
    fn the_limit_is_set_in_mebibytes_and_is_512_of_them_otherwise() {
        const MIB: u64 = 1024 * 1024;
        let limit = |text: &str| limit_of(Some(OsStr::new(text)));
        for (text, bytes) in [("64", 64 * MIB), (" 64\n", 64 * MIB), ("0", 0), ("", 512 * MIB)] {
            assert_eq!(limit(text).ok(), Some(bytes), "{text:?}");
        }
        assert_eq!(limit_of(None).ok(), Some(512 * MIB));
        assert_eq!(limit(&u64::MAX.to_string()).ok(), Some(u64::MAX));
        for wrong in ["1G", "-1", "1.5"] {
            let error = limit(wrong).expect_err(wrong);
            let expected = format!("RAYCL_CACHE_MIB: '{wrong}' is not a whole number of MiB");
            assert_eq!((error.to_string(), error.exit_code()), (expected, 2));
        }
    }
}
