//! A lock that allows one run at a time in a folder.

use crate::device_lock::lacks_locks;
use crate::error::{Error, Result};
use crate::record::own_file;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Write as _};
use std::path::Path;

/// A lock on a folder, released when dropped. The operating system releases the lock when the process ends, even if the
/// process is killed.
pub struct Lock {
    file: File,
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing the file might not release the lock: while a child process is being started, it shares the open
        // file.
        let _ = self.file.unlock();
    }
}

impl Lock {
    /// Takes the lock of a folder, or returns an error that names the process that holds it.
    pub fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(".lock");
        let failed = |error: std::io::Error| Error::unwritable(&path, &error);
        own_file(&path).map_err(failed)?;
        let mut file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&path)
            .map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(taken(folder, file)),
            // On a file system without locks, raycl runs without a lock.
            Err(TryLockError::Error(error)) if lacks_locks(&error) => {}
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        file.set_len(0).and_then(|()| write!(file, "{}", std::process::id())).map_err(failed)?;
        Ok(Self { file })
    }
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
}
