//! Lets the background processes that store into the same cache work one at a time. Each `raycl render` may start a
//! background process, which needs about 150 MB of memory while it compiles. After many commands in a row, these
//! processes would otherwise all compile at the same time.

use std::fs::{File, TryLockError};
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The interval at which a waiting process checks whether it may work.
const LOOK_UP: Duration = Duration::from_millis(100);

/// The right to work with a cache. Dropping the right, or the end of the process, lets the next process work.
pub struct Turn {
    /// The cache's folder, which this process has locked. `None` if the folder cannot be opened or locked; then,
    /// nothing keeps other processes from working at the same time.
    _folder: Option<File>,
}

/// Waits until no other process has the right to work with the cache in `folder`. Returns `None` if another process
/// still has this right after the time `longest`: that process may be stuck in a driver. If the folder cannot be opened
/// or locked, returns at once, and nothing keeps other processes from working with the cache.
pub fn wait(folder: &Path, longest: Duration) -> Option<Turn> {
    let end = Instant::now() + longest;
    let Ok(file) = File::open(folder) else { return Some(Turn { _folder: None }) };
    loop {
        match file.try_lock() {
            Ok(()) => return Some(Turn { _folder: Some(file) }),
            Err(TryLockError::Error(_)) => return Some(Turn { _folder: None }),
            Err(TryLockError::WouldBlock) if Instant::now() >= end => return None,
            Err(TryLockError::WouldBlock) => sleep(LOOK_UP),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn one_process_works_at_a_time_and_the_next_one_works_after_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = wait(folder.path(), Duration::ZERO);
        assert!(first.is_some() && wait(folder.path(), Duration::ZERO).is_none());
        drop(first);
        assert!(wait(folder.path(), Duration::ZERO).is_some());
    }

    #[test]
    fn a_folder_that_cannot_be_locked_does_not_keep_a_process_from_its_work() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("missing");
        let both = [(); 2].map(|()| wait(&missing, Duration::ZERO));
        assert!(both.iter().all(Option::is_some));
    }
}
