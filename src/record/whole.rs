//! Writes files completely or not at all.

use super::journals::IMAGES;
use crate::error::{Error, Result};
use crate::reader::folder_of;
use serde::Serialize;
use std::fs::DirEntry;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::time::Duration;
use tempfile::NamedTempFile;

/// The prefix of the names of raycl's temporary files. A run that is killed may leave temporary files behind.
pub const TEMPORARY_PREFIX: &str = ".raycl-";

/// Writes a temporary file in the folder of `path`, and then renames the temporary file to `path`. A process
/// that reads `path` finds either the complete old file or the complete new file, even after a crash or a
/// loss of power.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, true, |file| file.write_all(bytes))
}

/// Writes `value` as indented JSON with a final newline. Like [`write_whole`], writes the file completely or
/// not at all.
pub fn write_json(path: &Path, value: &(impl Serialize + ?Sized)) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|error| Error::fault(error.to_string()))?;
    write_whole(path, format!("{text}\n").as_bytes())
}

/// Writes a file completely or not at all, as [`write_whole`] does, for contents that are too large for memory.
/// The argument `write` writes the file's contents piece by piece.
pub fn write_whole_by(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    replace(path, true, |file| {
        let mut file = std::io::BufWriter::new(file);
        write(&mut file)?;
        file.flush()
    })
}

/// Writes a file completely or not at all, as [`write_whole`] does, but does not wait until the file is on the
/// disk. `write_page` is for pages, which raycl can generate again from the records.
pub fn write_page(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, false, |file| file.write_all(bytes))
}

/// Writes a file unless a file with this path exists already. Returns true if the file was written, and false
/// if a file existed. If several processes write the same file with this function, the function returns true
/// to only one of them.
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

/// Removes temporary files that killed processes left behind in a folder of results, and in its subfolders for
/// pictures, plots, exports and kinds of device. Removes only files that nobody has changed for `age`. A temporary file
/// that cannot be removed stays in the folder, which does no harm.
pub fn remove_leftovers(folder: &Path, age: Duration) {
    let is_old = |entry: &DirEntry| {
        let changed = entry.metadata().and_then(|file| file.modified());
        // The clock of a file server may be ahead of this machine's clock. If the file's modification time is
        // in the future, the file's age counts as 0.
        changed.is_ok_and(|changed| changed.elapsed().unwrap_or_default() >= age)
    };
    // Subfolders that are links are left out, since a link may lead out of the folder of results.
    let inner = [IMAGES, "plots", "exports", "kinds"].map(|name| folder.join(name)).into_iter();
    for folder in inner.filter(|folder| !folder.is_symlink()).chain([folder.to_owned()]) {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(TEMPORARY_PREFIX) && is_old(&entry) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// Writes a folder's list of files to the disk. Does nothing on a file system that has no `fsync` for
/// folders, such as the shared folders of VirtualBox.
#[cfg(unix)]
pub fn sync_folder(folder: &Path) -> std::io::Result<()> {
    match std::fs::File::open(folder)?.sync_all() {
        Err(error) if is_unsupported(&error) => Ok(()),
        synced => synced,
    }
}

/// Returns true if an operation failed because the file system does not support the operation. If a file
/// system has no `fsync` for folders, Linux returns `EINVAL`.
#[cfg(unix)]
fn is_unsupported(error: &std::io::Error) -> bool {
    use rustix::io::Errno;
    let errors = [Errno::INVAL, Errno::NOSYS, Errno::NOTSUP, Errno::OPNOTSUPP];
    errors.iter().any(|errno| error.raw_os_error() == Some(errno.raw_os_error()))
}

/// Does nothing, since folders cannot be opened on this system.
#[cfg(not(unix))]
pub fn sync_folder(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// Creates a temporary file in a folder. The caller will rename the temporary file to another name in the
/// same folder.
pub fn temporary_in(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY_PREFIX);
    readable(&mut builder);
    builder.tempfile_in(folder)
}

/// Gives temporary files the usual permissions (those that the umask allows), since by default only the owner
/// could read a temporary file.
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
        let files = [
            ".raycl-old",
            "images/.raycl-old",
            "kinds/.raycl-old",
            ".raycl-new",
            ".raycl-future",
            "records.jsonl",
        ];
        let (old, future) = (now - 2 * hour, now + 2 * hour);
        for (name, changed) in files.into_iter().zip([old, old, old, now, future, old]) {
            let file = std::fs::File::create(folder.path().join(name)).unwrap();
            file.set_modified(changed).unwrap();
        }
        let left = || files.map(|name| folder.path().join(name).exists());
        remove_leftovers(folder.path(), hour);
        assert_eq!(left(), [false, false, false, true, true, true]);
        remove_leftovers(folder.path(), Duration::ZERO);
        assert_eq!(left(), [false, false, false, false, false, true]);
    }

    #[test]
    #[cfg(unix)]
    fn no_file_is_removed_through_a_link_to_another_folder() {
        let [folder, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let file = other.path().join(".raycl-old");
        std::fs::write(&file, "").unwrap();
        std::os::unix::fs::symlink(other.path(), folder.path().join(IMAGES)).unwrap();
        remove_leftovers(folder.path(), Duration::ZERO);
        assert!(file.exists());
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
        let error = write_whole(&taken, b"new").unwrap_err();
        let start = format!("cannot write {}: ", taken.display());
        assert!(error.to_string().starts_with(&start) && error.exit_code() == 1, "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_of_a_file_system_that_cannot_sync_folders_is_no_failure() {
        // The file system of /proc has no `fsync` for folders.
        sync_folder(Path::new("/proc")).unwrap();
        let [invalid, failed_disk] = [rustix::io::Errno::INVAL, rustix::io::Errno::IO]
            .map(|errno| is_unsupported(&std::io::Error::from_raw_os_error(errno.raw_os_error())));
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
            Err(std::io::Error::other("no more"))
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
