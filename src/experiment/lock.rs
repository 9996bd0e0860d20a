//! A lock that allows one run at a time in a folder.

use crate::device_lock::{LOCK_ATTEMPTS, lacks_locks};
use crate::error::{Error, Result};
use crate::existing;
use crate::printer;
use crate::reader::folder_of;
use crate::record::refuse_link;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Write as _};
use std::path::Path;

/// The name of the file in a folder of results that is locked while a run uses the folder.
const LOCK: &str = ".lock";

/// A lock on a folder, released when dropped. The operating system releases the lock when the process ends, even if the
/// process is killed.
pub struct Lock {
    file: File,
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing the file might not release the lock, because a child process that is just being started
        // shares the open file.
        let _ = self.file.unlock();
    }
}

impl Lock {
    /// Takes the lock of a folder, and writes the number of this process into the lock's file. If another process holds
    /// the lock, returns an error that names the other process. If the file system has no locks, tells the user so, and
    /// returns a lock that stops no other process.
    pub fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(LOCK);
        let mut attempts = 0;
        loop {
            attempts += 1;
            Self::refuse_link(folder)?;
            let file = open(&path).map_err(|error| Error::unwritable(&path, &error))?;
            if let Some(lock) = Self::of_file(file, &path, attempts < LOCK_ATTEMPTS)? {
                return Ok(lock);
            }
        }
    }

    /// Returns an input error (a mistake of the user) if the lock's file in a folder is a link, a pipe or a
    /// device.
    pub fn refuse_link(folder: &Path) -> Result<()> {
        refuse_link(&folder.join(LOCK))
    }

    /// Locks the open file of a folder's lock. Returns `None` if `must_be_there` is true and somebody removed
    /// the file after it was opened. A lock on a removed file would not stop other processes, since other
    /// processes lock a new file.
    fn of_file(mut file: File, path: &Path, must_be_there: bool) -> Result<Option<Self>> {
        let failed = |error: std::io::Error| Error::unwritable(path, &error);
        let is_locked = match file.try_lock() {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => return Err(taken(folder_of(path), file)),
            // On a file system that does not support locks, raycl runs without a lock.
            Err(TryLockError::Error(error)) if lacks_locks(&error) => false,
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        };
        if must_be_there && !existing::still_leads_to(path, &file).map_err(failed)? {
            return Ok(None);
        }
        if !is_locked {
            tell_unlocked(folder_of(path));
        }
        file.set_len(0).and_then(|()| write!(file, "{}", std::process::id())).map_err(failed)?;
        Ok(Some(Self { file }))
    }
}

/// Opens the file that will be locked, and creates this file if it is missing.
fn open(path: &Path) -> std::io::Result<File> {
    OpenOptions::new().create(true).truncate(false).read(true).write(true).open(path)
}

/// Tells the user that a folder cannot be locked.
fn tell_unlocked(folder: &Path) {
    let note = format!(
        "note: the file system of {} has no locks, so raycl cannot refuse a second run in this folder",
        folder.display()
    );
    printer::tell(printer::plain(&note));
}

fn taken(folder: &Path, mut file: File) -> Error {
    let mut holder = String::new();
    let _ = file.read_to_string(&mut holder);
    let who = if holder.is_empty() { String::new() } else { format!(" (process {})", holder.trim()) };
    Error::input(format!("another run{who} is writing to {}", folder.display()))
        .with_help("wait until that run ends, or choose another folder with --out")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_taken_once_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Lock::take(folder.path()).unwrap();
        let refused = Lock::take(folder.path()).err().unwrap();
        assert_eq!(refused.exit_code(), 2);
        assert!(refused.to_string().contains(&format!("process {}", std::process::id())), "{refused}");
        drop(first);
        assert!(Lock::take(folder.path()).is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_whose_file_was_removed_is_not_taken_for_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK);
        let opened = open(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let other = Lock::take(folder.path()).unwrap();
        let lock = Lock::of_file(opened, &path, true).unwrap();
        assert!(lock.is_none(), "another process holds the new file's lock");
        drop(other);
        assert!(Lock::take(folder.path()).is_ok());
    }

    #[test]
    fn the_longer_number_of_an_earlier_process_is_replaced_completely() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK);
        std::fs::write(&path, "9".repeat(30)).unwrap();
        let _lock = Lock::take(folder.path()).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), std::process::id().to_string());
    }
}
