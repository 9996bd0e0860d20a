//! Finds out whether files and folders exist. Only a few of the system's errors mean that nothing is at a path
//! ([`is_missing`]). After any other error, such as that of a network disk that does not answer, it is unknown whether
//! something is at the path. If it is unknown whether something is at a path, the functions of this module return the
//! system's error. If these functions reported a missing file in place of the system's error, raycl would ignore
//! results that exist.

use crate::error::{Error, Result, limit_advice};
use crate::reader;
use std::fs::{File, Metadata};
use std::io::{Error as IoError, ErrorKind, Result as IoResult};
use std::path::{Path, PathBuf};

/// The remedy if this process may not read a file or a folder.
const FORBIDDEN: &str = "run the command as a user who may read this path, change the permissions of the path and of the folders above it, or choose another path";
/// The remedy if a disk does not answer, or answers with an error.
const FAILED: &str = "check that the disk with this path works and is mounted, and run the command again";

/// The remedy if a link leads back to itself.
const ENDLESS: &str = "a link in this path leads back to itself: correct the link, or choose another path";

/// Returns true if an error means that a link in a path leads back to itself.
#[cfg(unix)]
fn is_endless(error: &IoError) -> bool {
    error.raw_os_error() == Some(rustix::io::Errno::LOOP.raw_os_error())
}

/// Returns false on systems other than Unix, where raycl does not know the number of the error about a link
/// that leads back to itself.
#[cfg(not(unix))]
fn is_endless(_: &IoError) -> bool {
    false
}

/// Returns true if an error means that nothing is at a path.
fn is_missing(error: &IoError) -> bool {
    // The errors say that the path is not found, that a part of the path is an ordinary file instead of a
    // folder, or that a name is too long.
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory | ErrorKind::InvalidFilename)
}

/// Returns the result of an operation on a path; `None` if the operation failed because nothing is at the path.
fn if_any<T>(result: IoResult<T>) -> IoResult<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if is_missing(&error) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Returns the metadata of the file or folder to which a path leads; `None` if nothing is at the path.
///
/// # Errors
///
/// Returns the system's error, unless the error means that nothing is at the path.
pub fn metadata(path: &Path) -> IoResult<Option<Metadata>> {
    if_any(path.metadata())
}

/// Returns true if a path leads to a file or folder.
///
/// # Errors
///
/// Fails if the system's answer does not show whether something is at the path.
pub fn exists(path: &Path) -> Result<bool> {
    Ok(known(path)?.is_some())
}

/// Returns true if a file, a folder or a link is at a path. A link counts even if it leads nowhere.
///
/// # Errors
///
/// Fails under the same conditions as [`exists`].
pub fn is_entry(path: &Path) -> Result<bool> {
    let metadata = if_any(path.symlink_metadata()).map_err(|error| unreadable(path, &error))?;
    Ok(metadata.is_some())
}

/// Returns true if a path leads to an ordinary file.
///
/// # Errors
///
/// Fails under the same conditions as [`exists`].
pub fn is_file(path: &Path) -> Result<bool> {
    Ok(known(path)?.is_some_and(|metadata| metadata.is_file()))
}

/// Returns true if a path leads to a folder.
///
/// # Errors
///
/// Fails under the same conditions as [`exists`].
pub fn is_folder(path: &Path) -> Result<bool> {
    Ok(known(path)?.is_some_and(|metadata| metadata.is_dir()))
}

fn known(path: &Path) -> Result<Option<Metadata>> {
    metadata(path).map_err(|error| unreadable(path, &error))
}

/// Returns the paths of all entries of a folder, in any order; an empty list if there is no such folder.
///
/// # Errors
///
/// Fails if the folder exists and cannot be listed completely.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let listed = || -> IoResult<Vec<PathBuf>> {
        std::fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect()
    };
    let entries = if_any(listed()).map_err(|error| unreadable(folder, &error))?;
    Ok(entries.unwrap_or_default())
}

/// Returns the bytes of a file that raycl wrote into a folder of results; `None` if there is no such file.
///
/// # Errors
///
/// Fails if the file exists and cannot be read, is not an ordinary file, or is larger than a file of results may be.
pub fn bytes(path: &Path) -> Result<Option<Vec<u8>>> {
    if_any(reader::bytes(path, reader::Kind::Results)).map_err(|error| unreadable(path, &error))
}

/// Returns true if the open file `file` is still at a path. Returns false if somebody has removed or replaced
/// the file, or if a link is at the path.
///
/// # Errors
///
/// Returns the system's error, unless the error means that nothing is at the path.
#[cfg(unix)]
pub fn still_leads_to(path: &Path, file: &File) -> IoResult<bool> {
    use std::os::unix::fs::MetadataExt as _;
    let Some(named) = if_any(path.symlink_metadata())? else { return Ok(false) };
    let open = file.metadata()?;
    Ok(named.is_file() && (named.dev(), named.ino()) == (open.dev(), open.ino()))
}

/// Returns true if a path leads to a file or folder. The file at the path need not be the open file: on
/// systems other than Unix, raycl does not find out whether two files are the same.
///
/// # Errors
///
/// Returns the system's error, unless the error means that nothing is at the path.
#[cfg(not(unix))]
pub fn still_leads_to(path: &Path, _file: &File) -> IoResult<bool> {
    Ok(metadata(path)?.is_some())
}

/// Returns the error for a file or folder that cannot be read, and that exists or may exist.
pub fn unreadable(path: &Path, error: &IoError) -> Error {
    failed(format!("cannot read {}: {error}", path.display()), error)
}

/// Returns the error with this message for an operation that failed because of `error`. Missing permissions
/// and links that lead back to themselves count as mistakes of the user. A failure of the disk does not count
/// as a mistake of the user.
pub fn failed(message: String, error: &IoError) -> Error {
    match error.kind() {
        ErrorKind::PermissionDenied => Error::input(message).with_help(FORBIDDEN),
        _ if is_endless(error) => Error::input(message).with_help(ENDLESS),
        _ => Error::run(message).with_help(limit_advice(error).unwrap_or(FAILED)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_not_found_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "text").unwrap();
        let long = folder.path().join("k".repeat(300));
        for missing in [folder.path().join("nothing"), file.join("inner"), long] {
            assert!(!exists(&missing).unwrap() && !is_file(&missing).unwrap(), "{}", missing.display());
            assert!(entries(&missing).unwrap().is_empty() && bytes(&missing).unwrap().is_none());
        }
        assert!(exists(&file).unwrap() && is_file(&file).unwrap() && !is_folder(&file).unwrap());
        assert!(is_folder(folder.path()).unwrap() && !is_file(folder.path()).unwrap());
        assert!(is_entry(&file).unwrap() && !is_entry(&file.join("inner")).unwrap());
        assert_eq!(entries(folder.path()).unwrap(), std::slice::from_ref(&file));
        assert_eq!(bytes(&file).unwrap().as_deref(), Some(&b"text"[..]));
        assert!(bytes(folder.path()).is_err(), "a folder is there, but it has no bytes");
    }

    #[cfg(unix)]
    #[test]
    fn what_the_system_does_not_answer_is_an_error_that_names_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let endless = folder.path().join("endless");
        std::os::unix::fs::symlink(&endless, &endless).unwrap();
        let errors = [
            exists(&endless).unwrap_err(),
            is_file(&endless).unwrap_err(),
            is_folder(&endless).unwrap_err(),
            entries(&endless).unwrap_err(),
            bytes(&endless.join("inner")).unwrap_err(),
        ];
        for error in errors {
            let expected = format!("cannot read {}", endless.display());
            assert!(error.to_string().starts_with(&expected), "{error}");
            assert_eq!((error.exit_code(), error.remedy()), (2, ENDLESS));
        }
    }

    #[test]
    fn missing_permissions_are_the_users_mistake_and_a_failed_disk_is_not() {
        let code = |kind: ErrorKind| unreadable(Path::new("a"), &kind.into()).exit_code();
        assert_eq!([code(ErrorKind::PermissionDenied), code(ErrorKind::StaleNetworkFileHandle)], [2, 1]);
        assert_eq!(unreadable(Path::new("a"), &ErrorKind::Other.into()).remedy(), FAILED);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_was_removed_or_replaced_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let open = File::create(&path).unwrap();
        let still = || still_leads_to(&path, &open).unwrap();
        assert!(still());
        std::fs::rename(&path, folder.path().join("elsewhere")).unwrap();
        assert!(!still());
        std::fs::write(&path, "another").unwrap();
        assert!(!still());
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_neither_an_ordinary_file_nor_a_folder() {
        let device = Path::new("/dev/null");
        assert!(exists(device).unwrap() && !is_file(device).unwrap() && !is_folder(device).unwrap());
    }
}
