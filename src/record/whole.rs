//! Writes files completely or not at all. Also checks the paths in a folder of results. The folder may come from a
//! stranger, so its paths must not lead out of the folder or to a device file.

use super::journals::IMAGES;
use crate::error::{Error, Result, is_forbidden};
use crate::reader::{self, folder_of, may_write};
use serde::Serialize;
use std::fs::DirEntry;
use std::io::{Error as IoError, ErrorKind, Write};
use std::path::Path;
use std::time::Duration;
use tempfile::NamedTempFile;

/// Prefix of the names of temporary files. A run that is killed may leave temporary files behind.
pub const TEMPORARY_PREFIX: &str = ".raycl-";

/// Writes a temporary file in the folder of `path` and then renames it. A process that reads `path` finds
/// either the complete old file or the complete new file, even after a crash or a loss of power.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, true, |file| file.write_all(bytes))
}

/// Writes a whole file like [`write_whole`]: `value` as indented JSON, and a newline.
pub fn write_json(path: &Path, value: &(impl Serialize + ?Sized)) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|error| Error::fault(error.to_string()))?;
    write_whole(path, format!("{text}\n").as_bytes())
}

/// Writes a whole file like [`write_whole`], for contents that are too large for memory: the
/// function `write` writes the contents piece by piece.
pub fn write_whole_by(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    replace(path, true, |file| {
        let mut file = std::io::BufWriter::new(file);
        write(&mut file)?;
        file.flush()
    })
}

/// Writes a whole file like [`write_whole`], but does not wait until the file is on the disk. This
/// function is for files that can be regenerated from records.
pub fn write_page(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, false, |file| file.write_all(bytes))
}

/// Writes a file unless it exists already. Returns true if the file was written, and false if it existed. If
/// several processes write the same file with this function, only one process succeeds.
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<bool> {
    let folder = folder_of(path);
    let write = || -> std::io::Result<bool> {
        let mut file = temporary_in(folder)?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        match file.persist_noclobber(path) {
            Ok(_) => sync_folder(folder).map(|()| true),
            Err(error) if error.error.kind() == ErrorKind::AlreadyExists => Ok(false),
            Err(error) => Err(error.error),
        }
    };
    write().map_err(|error| Error::unwritable(path, &error))
}

#[allow(
    clippy::disallowed_methods,
    reason = "raycl may replace files in folders of results; elsewhere, it checks first whether it made the old file"
)]
fn replace(
    path: &Path,
    durable: bool,
    fill: impl FnOnce(&mut NamedTempFile) -> std::io::Result<()>,
) -> Result<()> {
    let folder = folder_of(path);
    let write = || -> std::io::Result<()> {
        let mut file = temporary_in(folder)?;
        fill(&mut file)?;
        if durable {
            file.as_file().sync_all()?;
        }
        file.persist(path)?;
        if durable { sync_folder(folder) } else { Ok(()) }
    };
    write().map_err(|error| Error::unwritable(path, &error))
}

/// Returns an input error if raycl cannot write into the folder because the path of the folder, or of a
/// folder above it, is a file or a link without a target.
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

/// Returns an input error with the help `remedy` if this process may not create files in a folder. If the
/// folder does not exist, the function checks the closest existing folder above it instead, in which the
/// missing folder would have to be made.
pub fn refuse_closed(folder: &Path, remedy: impl Into<String>) -> Result<()> {
    let Some(existing) = folder.ancestors().map(or_current).find(|path| path.is_dir()) else { return Ok(()) };
    may_write(existing).map_err(|error| {
        let reason = format!("the folder '{}' cannot be written to ({})", existing.display(), error.kind());
        let exists = existing == or_current(folder);
        let message = if exists { reason } else { format!("cannot make {}: {reason}", folder.display()) };
        Error::input(message).with_help(remedy)
    })
}

/// Returns the path, or `.` if the path is empty.
fn or_current(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

/// Returns the error for a folder that cannot be made; the error's help is `remedy`. The error counts as a mistake of
/// the user in these cases: something else has this path, no folder can have this path, or this process may not make
/// folders in that place.
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

/// Creates a subfolder in a folder of results. Fails if a link with this name exists.
pub fn own_folder(path: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(path)?;
    match path.symlink_metadata()?.is_symlink() {
        true => Err(IoError::new(ErrorKind::InvalidInput, LINK)),
        false => Ok(()),
    }
}

/// Fails if `path` is a link, a pipe or a device, to which raycl must not append. A missing file is
/// accepted.
pub fn own_file(path: &Path) -> std::io::Result<()> {
    match path.symlink_metadata() {
        Ok(metadata) if metadata.is_symlink() => Err(IoError::new(ErrorKind::InvalidInput, LINK)),
        Ok(_) => ordinary(path),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    }
}

/// Removes temporary files that killed processes left behind in a folder of results. Only files that nobody
/// has changed for `age` are removed. A file that cannot be removed stays in the folder, which does no harm.
pub fn remove_leftovers(folder: &Path, age: Duration) {
    let is_old = |entry: &DirEntry| {
        let changed = entry.metadata().and_then(|file| file.modified());
        // The clock of a file server may be ahead of this machine's clock. If the file's time is in the
        // future, the file's age counts as 0.
        changed.is_ok_and(|changed| changed.elapsed().unwrap_or_default() >= age)
    };
    // A folder that is a link is left out, since the link may lead out of the folder of results.
    let inner = [IMAGES, "plots", "exports", "kinds"].map(|name| folder.join(name)).into_iter();
    for folder in inner.filter(|folder| !folder.is_symlink()).chain([folder.to_owned()]) {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(TEMPORARY_PREFIX) && is_old(&entry) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

const LINK: &str = "it is a link, which may lead out of the folder";

/// Fails if `path` is a pipe or a device, since reading from a pipe or a device may never end.
pub fn ordinary(path: &Path) -> std::io::Result<()> {
    let metadata = path.metadata()?;
    match metadata.is_file() || metadata.is_dir() {
        true => Ok(()),
        false => Err(IoError::new(ErrorKind::InvalidInput, "it is not an ordinary file")),
    }
}

/// Returns the bytes of a picture's file in a folder of results. Returns `None` if the path, after links are followed,
/// leads out of the folder or to something other than an ordinary file. Also returns `None` if the file cannot be read,
/// or is larger than the pictures that reports show.
pub fn read_inside(folder: &Path, path: &str) -> Option<Vec<u8>> {
    let resolved = folder.join(path).canonicalize().ok()?;
    let inside = resolved.starts_with(folder.canonicalize().ok()?);
    inside.then(|| reader::bytes(&resolved, reader::Kind::Shown).ok())?
}

/// Writes a folder's list of files to the disk. Does nothing on a file system that cannot write a folder to
/// the disk, such as the shared folders of VirtualBox.
#[cfg(unix)]
pub fn sync_folder(folder: &Path) -> std::io::Result<()> {
    match std::fs::File::open(folder)?.sync_all() {
        Err(error) if is_unsupported(&error) => Ok(()),
        synced => synced,
    }
}

/// Returns true if an operation failed because the file system does not support it. If a file system has no
/// `fsync` for folders, Linux returns `EINVAL`.
#[cfg(unix)]
fn is_unsupported(error: &IoError) -> bool {
    use rustix::io::Errno;
    let errors = [Errno::INVAL, Errno::NOSYS, Errno::NOTSUP, Errno::OPNOTSUPP];
    errors.iter().any(|errno| error.raw_os_error() == Some(errno.raw_os_error()))
}

/// Does nothing, since folders cannot be opened on this system.
#[cfg(not(unix))]
pub fn sync_folder(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// Creates a temporary file that will be renamed to a file in this folder.
pub fn temporary_in(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY_PREFIX);
    readable(&mut builder);
    builder.tempfile_in(folder)
}

/// Gives temporary files the usual permissions (umask); otherwise only their owner could read them.
#[cfg(unix)]
fn readable(builder: &mut tempfile::Builder<'_, '_>) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(std::fs::Permissions::from_mode(0o666));
}

#[cfg(not(unix))]
fn readable(_: &mut tempfile::Builder<'_, '_>) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_temporary_files_that_are_old_enough_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let now = std::time::SystemTime::now();
        let hour = Duration::from_secs(3600);
        for inner in [IMAGES, "kinds"] {
            std::fs::create_dir(folder.path().join(inner)).unwrap();
        }
        let files = [".raycl-old", "images/.raycl-old", "kinds/.raycl-old", ".raycl-new", "records.jsonl"];
        let old = now - 2 * hour;
        for (name, changed) in files.into_iter().zip([old, old, old, now, old]) {
            let file = std::fs::File::create(folder.path().join(name)).unwrap();
            file.set_modified(changed).unwrap();
        }
        let left = || files.map(|name| folder.path().join(name).exists());
        remove_leftovers(folder.path(), hour);
        assert_eq!(left(), [false, false, false, true, true]);
        remove_leftovers(folder.path(), Duration::ZERO);
        assert_eq!(left(), [false, false, false, false, true]);
    }

    #[test]
    #[cfg(unix)]
    fn links_are_not_followed_and_devices_not_read() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let [outer, file, plots] = ["outer", "file", "plots"].map(|name| folder.path().join(name));
        std::fs::write(&outer, "untouched").unwrap();
        symlink(&outer, &file).unwrap();
        symlink("/tmp", &plots).unwrap();
        assert!(own_file(&file).unwrap_err().to_string().contains("link"));
        assert!(own_folder(&plots).unwrap_err().to_string().contains("link"));
        assert!(
            own_file(&folder.path().join("new")).is_ok() && own_folder(&folder.path().join("made")).is_ok()
        );
        assert!(ordinary(Path::new("/dev/zero")).is_err());
        write_page(&file, b"page").unwrap();
        assert_eq!(
            (std::fs::read(&outer).unwrap(), std::fs::read(&file).unwrap()),
            (b"untouched".into(), b"page".into())
        );
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.md");
        write_whole(&path, b"old").unwrap();
        write_whole(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        let taken = folder.path().join("folder");
        std::fs::create_dir(&taken).unwrap();
        assert_eq!(write_whole(&taken, b"new").unwrap_err().exit_code(), 1);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_of_a_file_system_that_cannot_sync_folders_is_no_failure() {
        // The file system of /proc has no `fsync` for folders.
        sync_folder(Path::new("/proc")).unwrap();
        let [invalid, failed_disk] = [rustix::io::Errno::INVAL, rustix::io::Errno::IO]
            .map(|errno| is_unsupported(&IoError::from_raw_os_error(errno.raw_os_error())));
        assert!(invalid && !failed_disk);
        assert!(sync_folder(Path::new("/nonexistent/x")).is_err());
    }

    #[test]
    fn a_new_file_is_written_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        assert!(write_new(&path, b"first").unwrap());
        assert!(!write_new(&path, b"second").unwrap());
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
        assert_eq!(write_new(&folder.path().join("missing/a"), b"").unwrap_err().exit_code(), 1);
    }

    #[test]
    fn a_message_names_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing/report.html");
        for error in [write_page(&path, b"").unwrap_err(), write_new(&path, b"").unwrap_err()] {
            let message = error.to_string();
            assert!(message.starts_with(&format!("cannot write {}: ", path.display())), "{message}");
            assert!(!message.contains(TEMPORARY_PREFIX), "{message}");
        }
    }

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
        // The path above the path `new` is empty, and means the current folder.
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

    #[test]
    fn a_file_written_piece_by_piece_has_all_pieces_or_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("samples.jsonl");
        write_whole_by(&path, |file| {
            ["a\n", "b\n"].iter().try_for_each(|piece| file.write_all(piece.as_bytes()))
        })
        .unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"a\nb\n");
        let failed = write_whole_by(&path, |file| {
            file.write_all(b"c\n")?;
            Err(IoError::other("no more"))
        });
        assert!(failed.unwrap_err().to_string().ends_with("no more"));
        assert_eq!(std::fs::read(&path).unwrap(), b"a\nb\n");
    }

    #[test]
    #[cfg(unix)]
    fn files_can_be_read_by_whom_the_system_lets() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [usual, whole, new] = ["usual", "whole", "new"].map(|name| folder.path().join(name));
        std::fs::write(&usual, "").unwrap();
        write_page(&whole, b"").unwrap();
        write_new(&new, b"").unwrap();
        let mode = |path: &Path| path.metadata().unwrap().permissions().mode();
        assert_eq!([mode(&whole), mode(&new)], [mode(&usual); 2]);
    }
}
