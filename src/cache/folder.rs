//! Finds the folder of raycl's cache, and checks who owns the folder. raycl runs compiled programs from the
//! cache, so only the user may write to the cache's folder.

use crate::error::{Error, Result};
use std::ffi::OsStr;
use std::fs::ReadDir;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The environment variable that limits the cache's size in MiB; 0 turns the cache off.
pub const LIMIT: &str = "RAYCL_CACHE_MIB";
const DEFAULT_LIMIT_MIB: u64 = 512;
/// The longest name of a file or folder, in bytes, that the usual file systems allow.
const LONGEST_NAME_BYTES: usize = 255;

/// Returns the limit of the cache's size in bytes, from the environment. If the value of `RAYCL_CACHE_MIB` is
/// not a whole number of MiB, returns the default limit. raycl's commands, and the functions of the library
/// that use devices, refuse such a value ([`check_limit`]) before they call this function.
pub fn limit_bytes() -> u64 {
    limit_of(std::env::var_os(LIMIT).as_deref()).unwrap_or(DEFAULT_LIMIT_MIB << 20)
}

/// Returns an input error if the environment variable that limits the cache's size is set and not blank, but is not a
/// whole number of MiB below 2^64.
pub fn check_limit() -> Result<()> {
    limit_of(std::env::var_os(LIMIT).as_deref()).map(|_| ())
}

/// Returns the limit of the cache's size in bytes from the text of the environment variable, or the default
/// limit if the text is blank.
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

/// Returns the folder `raycl` in the user's cache folder (`XDG_CACHE_HOME`, otherwise `.cache` in the home folder);
/// `None` if the environment names neither folder.
pub fn of_user() -> Option<PathBuf> {
    crate::xdg::folder("XDG_CACHE_HOME", ".cache")
}

/// Returns the path of the user's private folder in the system's folder of temporary files. The private
/// folder need not exist.
#[cfg(unix)]
pub fn temporary_path() -> Option<PathBuf> {
    let user = rustix::process::geteuid().as_raw();
    Some(std::env::temp_dir().join(format!("raycl-{user}")))
}

/// On systems other than Unix, raycl does not check who owns a folder, so it uses no private folder of
/// temporary files.
#[cfg(not(unix))]
pub fn temporary_path() -> Option<PathBuf> {
    None
}

/// Makes the user's private folder in the system's folder of temporary files ([`temporary_path`]). Later
/// processes of the same user get the same folder. Returns `None` if the folder cannot be made, if the path
/// is a link, or if somebody else owns the folder or may write into it.
pub fn temporary() -> Option<PathBuf> {
    private(temporary_path()?)
}

/// Makes a private folder, if it does not exist. The parent folder may be one into which everybody may write, as is the
/// case for some volumes of containers. Returns `None` for the same reasons as [`temporary`]. Also returns `None` if
/// the folder does not exist, and its nearest ancestor that exists belongs neither to this user nor to the superuser.
pub fn private_in_shared(folder: PathBuf) -> Option<PathBuf> {
    let around = existing_ancestor(&folder)?.metadata().ok()?;
    if is_own_or_roots(&around) { private(folder) } else { None }
}

/// Makes a folder, if it does not exist. Returns `None` if the folder cannot be made, if the path is a link, or if
/// somebody else owns the folder or may write into it.
fn private(folder: PathBuf) -> Option<PathBuf> {
    make(&folder).ok()?;
    let own = folder.symlink_metadata().is_ok_and(|metadata| metadata.is_dir());
    (own && trusted(&folder).is_some()).then_some(folder)
}

/// Makes a folder that only the folder's owner can list, read or write.
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

/// Returns true if this process can write into a folder, or can create the folder if it does not exist. To
/// test whether the process can write, a temporary file is created in the folder or, if the folder does not
/// exist, in its nearest ancestor that exists. A test of the permission bits is not sufficient: they permit
/// the superuser to write even if the file system is read-only.
pub fn can_be_written(folder: &Path) -> bool {
    let existing = existing_ancestor(folder);
    existing.is_some_and(|existing| existing.is_dir() && tempfile::tempfile_in(existing).is_ok())
}

/// Returns a folder or, if the folder does not exist, its nearest ancestor that exists. Returns `None` if no ancestor
/// exists, or if the folder cannot be created because a name in its path is too long.
pub fn existing_ancestor(folder: &Path) -> Option<&Path> {
    if folder.iter().any(|name| name.len() > LONGEST_NAME_BYTES) {
        return None;
    }
    folder.ancestors().find(|folder| folder.symlink_metadata().is_ok())
}

/// Returns true if no other user except the superuser can put files into a folder, or can replace the folder
/// by writing into its parent. A parent into which a group may write is accepted (see `keeps_names`). Ancestors
/// further up are not examined. If the folder does not exist, this function checks only whether another user
/// could create the folder in its nearest ancestor that exists.
pub fn is_private(folder: &Path) -> bool {
    if folder.symlink_metadata().is_ok() && trusted(folder).is_none() {
        return false;
    }
    let around = folder.parent().and_then(existing_ancestor);
    around.and_then(|around| around.metadata().ok()).is_some_and(|metadata| keeps_names(&metadata))
}

/// Reads an ordinary file that belongs to the user and that nobody else may write. Returns `None` for a file that
/// another user owns or may write, and for links.
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

/// Returns true if no other user except the superuser can rename what this user has put into a folder. A
/// folder that everybody may write, such as /tmp, must have the sticky bit, which forbids renaming files of
/// other users. A folder that a group may write is accepted: on many systems, each user has a private group,
/// which may write the user's folders.
#[cfg(unix)]
fn keeps_names(metadata: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    const EVERYBODY_WRITES: u32 = 0o002;
    const STICKY: u32 = 0o1000;
    is_own_or_roots(metadata) && (metadata.mode() & EVERYBODY_WRITES == 0 || metadata.mode() & STICKY != 0)
}

#[cfg(not(unix))]
fn keeps_names(_: &std::fs::Metadata) -> bool {
    true
}

/// Returns true if a file or folder belongs to this user or to the superuser.
#[cfg(unix)]
fn is_own_or_roots(metadata: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let owner = metadata.uid();
    owner == rustix::process::geteuid().as_raw() || owner == 0
}

#[cfg(not(unix))]
fn is_own_or_roots(_: &std::fs::Metadata) -> bool {
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
        // The name of a file or folder may have up to 255 bytes.
        let named = |bytes: usize| folder.path().join("missing").join("n".repeat(bytes)).join("a");
        assert!(can_be_written(&named(255)) && !can_be_written(&named(256)));
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_is_private_if_others_can_neither_write_into_it_nor_replace_it() {
        use std::os::unix::fs::PermissionsExt as _;
        let parent = tempfile::tempdir().expect("a folder");
        let folder = parent.path().join("folder");
        let mode = |path: &Path, mode| {
            std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).expect("a mode");
        };
        assert!(is_private(&folder) && is_private(&folder.join("a/b")), "it can be made");
        std::fs::create_dir(&folder).expect("a folder");
        for (around, own, private) in [
            (0o700, 0o700, true),
            (0o770, 0o755, true),
            (0o1777, 0o700, true),
            (0o777, 0o700, false),
            (0o700, 0o770, false),
            (0o700, 0o707, false),
        ] {
            mode(parent.path(), around);
            mode(&folder, own);
            assert_eq!(is_private(&folder), private, "{own:o} in {around:o}");
        }
        mode(&folder, 0o777);
        let below = folder.join("a/b");
        assert!(!is_private(&below), "everybody could make this folder first");
        assert_eq!(private_in_shared(below.clone()).as_deref(), Some(&*below));
        assert!(is_private(&below) && private_in_shared(folder).is_none());
        mode(parent.path(), 0o700);
        std::os::unix::fs::symlink("nowhere", parent.path().join("broken")).expect("a link");
        assert!(!is_private(&parent.path().join("broken")));
    }

    #[cfg(unix)]
    #[test]
    fn a_private_folder_is_made_once_and_neither_a_link_nor_a_shared_folder_is_taken_for_one() {
        use std::os::unix::fs::PermissionsExt as _;
        let parent = tempfile::tempdir().expect("a folder");
        let folder = parent.path().join("folder");
        for _ in 0..2 {
            assert_eq!(private(folder.clone()).as_deref(), Some(&*folder));
        }
        let link = parent.path().join("link");
        std::os::unix::fs::symlink(&folder, &link).expect("a link");
        assert_eq!(private(link), None);
        std::fs::set_permissions(&folder, std::fs::Permissions::from_mode(0o777)).expect("a mode");
        assert_eq!(private(folder), None);
        assert!(temporary_path().is_some_and(|path| path.starts_with(std::env::temp_dir())));
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
