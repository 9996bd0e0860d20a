//! Errors for folders that raycl cannot make, or into which it cannot write.

use crate::error::{Error, Result, is_forbidden};
use crate::reader::may_write;
use std::io::{Error as IoError, ErrorKind};
use std::path::Path;

/// Returns an input error (a mistake of the user) if a folder cannot exist because its path, or the path of
/// an ancestor, is a file or a link without a target.
pub fn refuse_file(folder: &Path) -> Result<()> {
    let leads_nowhere = |path: &Path| path.is_symlink() && matches!(path.try_exists(), Ok(false));
    let is_obstacle = |path: &&Path| path.is_file() || leads_nowhere(path);
    let Some(obstacle) = folder.ancestors().find(is_obstacle) else { return Ok(()) };
    let at = obstacle.display();
    let what = if obstacle.is_file() { "a file" } else { "a link without a target" };
    Err(Error::input(match obstacle == folder {
        true => format!("'{at}' is {what}; a folder is needed here"),
        false => format!("cannot make {}: '{at}' is {what}", folder.display()),
    }))
}

/// Returns an input error (a mistake of the user) with the advice `remedy` if this process may not create
/// files in a folder. If the folder does not exist, the function checks its closest existing ancestor
/// instead, in which the missing folder would have to be made.
pub fn refuse_closed(folder: &Path, remedy: impl Into<String>) -> Result<()> {
    let Some(existing) = folder.ancestors().map(or_current).find(|path| path.is_dir()) else { return Ok(()) };
    may_write(existing).map_err(|error| {
        let reason = format!("the folder '{}' cannot be written to ({})", existing.display(), error.kind());
        let exists = existing == or_current(folder);
        let message = if exists { reason } else { format!("cannot make {}: {reason}", folder.display()) };
        Error::input(message).with_help(remedy)
    })
}

/// Returns `path`, or `.` (the current folder) if `path` is empty.
fn or_current(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

/// Returns the error for a folder that cannot be made, with the advice `remedy`. The error counts as a
/// mistake of the user in three cases: something other than a folder, such as a file, already has the path or the
/// path of an ancestor; no folder can have this path; or this process may not make folders in the parent folder.
pub fn cannot_make(folder: &Path, error: &IoError, remedy: impl Into<String>) -> Error {
    use ErrorKind::{AlreadyExists, InvalidFilename, NotADirectory, NotFound};
    let other = || {
        let message = format!("cannot make {}: {error}", folder.display());
        match error.kind() {
            AlreadyExists | InvalidFilename | NotADirectory | NotFound => Error::input(message),
            _ if is_forbidden(error) => Error::input(message),
            _ => Error::run(message),
        }
    };
    refuse_file(folder).err().unwrap_or_else(other).with_help(remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_folder_is_the_users_mistake_and_a_full_disk_is_not() {
        let code = |kind: ErrorKind| cannot_make(Path::new("nowhere/r"), &kind.into(), "").exit_code();
        let kinds = [ErrorKind::PermissionDenied, ErrorKind::ReadOnlyFilesystem, ErrorKind::StorageFull];
        assert_eq!(kinds.map(code), [2, 2, 1]);
        let folder = tempfile::tempdir().unwrap();
        assert!(refuse_closed(folder.path(), "").is_ok());
        assert!(refuse_closed(&folder.path().join("missing"), "").is_ok());
        // Nobody can create files in /proc/sys, not even the superuser.
        if cfg!(target_os = "linux") {
            let error = refuse_closed(Path::new("/proc/sys"), "elsewhere").unwrap_err();
            assert_eq!((error.exit_code(), error.remedy()), (2, "elsewhere"));
            let message = error.to_string();
            assert!(message.starts_with("the folder '/proc/sys' cannot be written to ("), "{message}");
        }
    }

    #[test]
    fn a_folder_that_would_have_to_be_made_is_refused_if_the_closest_folder_above_it_is_closed() {
        let folder = tempfile::tempdir().unwrap();
        assert!(refuse_closed(&folder.path().join("new/inner"), "").is_ok());
        // The parent of the relative path `new` is the empty path, which means the current folder.
        let above = Path::new("new").ancestors().map(or_current);
        assert_eq!(above.collect::<Vec<_>>(), ["new", "."].map(Path::new));
        if cfg!(target_os = "linux") {
            for made in ["/proc/sys/new", "/proc/sys/new/inner"] {
                let error = refuse_closed(Path::new(made), "elsewhere").unwrap_err();
                assert_eq!((error.exit_code(), error.remedy()), (2, "elsewhere"));
                let expected = format!("cannot make {made}: the folder '/proc/sys' cannot be written to (");
                assert!(error.to_string().starts_with(&expected), "{error}");
            }
        }
    }
}
