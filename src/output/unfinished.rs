//! Stores the data of a file that is being written, until the file is complete.

use crate::record::{TEMPORARY_PREFIX, temporary_in};
use std::fs::File;
use std::io::{ErrorKind, Result as IoResult, Seek as _};
use std::path::Path;
use tempfile::NamedTempFile;

/// A file that is not complete yet.
#[derive(Debug)]
pub(super) enum Unfinished {
    /// A file without a name. The system removes a file without a name when this process ends, even if the
    /// process is killed. A command that writes a file for minutes therefore leaves nothing behind when it is
    /// interrupted.
    Unnamed(File),
    /// A file with a temporary name, used if the system or the file system does not support files without
    /// names.
    Named(NamedTempFile),
}

impl Unfinished {
    /// Creates an unfinished file on the file system of the folder in which the complete file will be.
    pub fn in_folder(folder: &Path) -> IoResult<Self> {
        match unnamed_in(folder) {
            Ok(file) => Ok(Self::Unnamed(file)),
            // If no file at all can be created in the folder, creating a file with a temporary name fails
            // too, and the error of this second attempt says why.
            Err(_) => temporary_in(folder).map(Self::Named),
        }
    }

    /// Returns the unfinished file, so that the caller can write it.
    pub fn file(&mut self) -> &mut File {
        match self {
            Self::Unnamed(file) => file,
            Self::Named(file) => file.as_file_mut(),
        }
    }

    /// Gives the complete file the final name `path`, and returns true. Returns false, and does nothing, if
    /// the file already has a temporary name, or can get a name only by being copied.
    ///
    /// # Errors
    ///
    /// Fails if another file has the name `path`.
    pub fn link_to(&self, path: &Path) -> IoResult<bool> {
        let Self::Unnamed(file) = self else { return Ok(false) };
        match link(file, path) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(error),
            Err(_) => Ok(false),
        }
    }

    /// Gives the complete file a temporary name in its folder, so that it can then be renamed and replace
    /// another file.
    pub fn named(self, folder: &Path) -> IoResult<NamedTempFile> {
        match self {
            Self::Unnamed(file) => linked(&file, folder).or_else(|_| copied(file, folder)),
            Self::Named(file) => Ok(file),
        }
    }
}

/// Gives a file without a name a temporary name in a folder.
fn linked(file: &File, folder: &Path) -> IoResult<NamedTempFile> {
    let link_at = |path: &Path| -> IoResult<File> {
        let file = file.try_clone()?;
        link(&file, path)?;
        Ok(file)
    };
    tempfile::Builder::new().prefix(TEMPORARY_PREFIX).make_in(folder, link_at)
}

/// Copies a file without a name to a file with a temporary name. This copy is needed where /proc is not
/// mounted, because only the superuser may then give the original file a name.
fn copied(mut file: File, folder: &Path) -> IoResult<NamedTempFile> {
    let mut copy = temporary_in(folder)?;
    file.rewind()?;
    std::io::copy(&mut file, &mut copy)?;
    // The caller may have waited until the original file was on the disk (`sync_all`). This function
    // therefore waits until the copy is on the disk too.
    copy.as_file().sync_all()?;
    Ok(copy)
}

/// Creates a file without a name on the file system of a folder.
#[cfg(target_os = "linux")]
fn unnamed_in(folder: &Path) -> IoResult<File> {
    use rustix::fs::{Mode, OFlags, open};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    // Programs usually create files with the permissions 0o666; the system removes those that the umask
    // forbids.
    let file = open(folder, flags, Mode::from_raw_mode(0o666))?;
    Ok(File::from(file))
}

#[cfg(not(target_os = "linux"))]
fn unnamed_in(_: &Path) -> IoResult<File> {
    Err(std::io::ErrorKind::Unsupported.into())
}

/// Gives a file without a name the name `path`. Fails if a file with this name exists.
#[cfg(target_os = "linux")]
fn link(file: &File, path: &Path) -> IoResult<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    use std::os::fd::AsRawFd as _;
    let open_file = format!("/proc/self/fd/{}", file.as_raw_fd());
    linkat(CWD, open_file, CWD, path, AtFlags::SYMLINK_FOLLOW)?;
    Ok(())
}

#[cfg(not(target_os = "linux"))]
fn link(_: &File, _: &Path) -> IoResult<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::io::Write as _;

    fn is_temporary(file: &NamedTempFile, folder: &Path) -> bool {
        let name = file.path().file_name().unwrap().to_string_lossy().into_owned();
        name.starts_with(TEMPORARY_PREFIX) && file.path().parent() == Some(folder)
    }

    #[test]
    fn an_unfinished_file_has_a_name_only_where_it_needs_one() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = Unfinished::in_folder(folder.path()).unwrap();
        file.file().write_all(b"whole").unwrap();
        // Where files without names are not supported, the unfinished file has a temporary name.
        let named = usize::from(unnamed_in(folder.path()).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), named);
        let file = file.named(folder.path()).unwrap();
        assert!(is_temporary(&file, folder.path()), "{file:?}");
        assert_eq!(std::fs::read(file.path()).unwrap(), b"whole");
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_file_without_a_name_gets_its_final_name_at_once_if_it_is_free() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut file = Unfinished::in_folder(folder.path()).unwrap();
        file.file().write_all(b"whole").unwrap();
        let has_name = matches!(file, Unfinished::Named(_));
        // Where /proc is not mounted, `link_to` returns false, since a file without a name must then be
        // copied.
        if file.link_to(&path).unwrap() {
            assert!(!has_name);
            assert_eq!(std::fs::read(&path).unwrap(), b"whole");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
            let other = Unfinished::in_folder(folder.path()).unwrap();
            assert_eq!(other.link_to(&path).unwrap_err().kind(), ErrorKind::AlreadyExists);
            assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        }
        let named = Unfinished::Named(temporary_in(folder.path()).unwrap());
        assert!(!named.link_to(&folder.path().join("b.png")).unwrap());
    }

    #[test]
    fn a_file_that_cannot_get_a_name_is_copied_and_one_that_has_a_name_keeps_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("removed");
        let mut removed = File::options().read(true).write(true).create_new(true).open(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert!(linked(&removed, folder.path()).is_err(), "a file whose name was removed cannot get another");
        removed.write_all(b"whole").unwrap();
        let copy = Unfinished::Unnamed(removed).named(folder.path()).unwrap();
        assert!(is_temporary(&copy, folder.path()), "{copy:?}");
        assert_eq!(std::fs::read(copy.path()).unwrap(), b"whole");
        let own = copy.path().to_owned();
        assert_eq!(Unfinished::Named(copy).named(folder.path()).unwrap().path(), own);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_can_be_read_by_whom_the_system_lets() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let usual = folder.path().join("usual");
        std::fs::write(&usual, "").unwrap();
        let file = Unfinished::in_folder(folder.path()).unwrap().named(folder.path()).unwrap();
        let mode = |path: &Path| path.metadata().unwrap().permissions().mode();
        assert_eq!(mode(file.path()), mode(&usual));
    }
}
