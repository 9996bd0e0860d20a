//! Starts the threads of the library rayon, which share the work of parallel iterators. rayon starts the
//! threads by itself when they are first needed, but panics if the system refuses a thread. The system refuses
//! a thread if `ulimit -u` or a control group's limit allows no more threads. The code of raycl starts single
//! threads with `std::thread::Builder`, which returns an error, and not with `std::thread::spawn` or a scope's
//! `spawn`, which panic. This file also locks data that threads share, and counts the processors (hardware
//! threads) that this process may use.

use crate::error::{Error, Result};
use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};
use std::error::Error as _;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Starts rayon's threads. Call this function once, before the first parallel iterator.
///
/// # Errors
///
/// Fails if the system refuses a thread. rayon does not try again to start the threads, so the process must
/// end after such a failure.
pub fn start_pool() -> Result<()> {
    no_thread_of(ThreadPoolBuilder::new().build_global().err().as_ref()).map_or(Ok(()), Err)
}

/// Returns the error for the user if the system refused a thread; `None` if the threads have been started, now or
/// before.
fn no_thread_of(error: Option<&ThreadPoolBuildError>) -> Option<Error> {
    error?.source()?.downcast_ref::<std::io::Error>().map(Error::no_thread)
}

/// Locks a mutex. If a thread panicked while it held the lock, the data stays as that thread left it.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the number of processors (hardware threads) that this process may use, according to its affinity and
/// control groups; 1 if the number is unknown.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::{Path, PathBuf};

    #[test]
    fn a_thread_that_the_system_refuses_is_an_error_and_threads_that_run_already_are_none() {
        // No address space can hold a stack of this size, so the system refuses the thread.
        let refused = ThreadPoolBuilder::new().num_threads(1).stack_size(1 << (usize::BITS - 1)).build();
        let error = no_thread_of(refused.err().as_ref()).expect("an error");
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().starts_with("a thread could not be started: "), "{error}");
        assert!(error.remedy().contains("`ulimit -u`"), "{}", error.remedy());
        rayon::current_num_threads();
        assert!(start_pool().is_ok());
    }

    /// Returns all files of a folder and its subfolders, except files `tests.rs` and folders `tests`.
    fn files(folder: &Path) -> Vec<PathBuf> {
        let mut found = Vec::new();
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            match path.file_name().and_then(|name| name.to_str()) {
                Some("tests" | "tests.rs") => {}
                _ if path.is_dir() => found.extend(files(&path)),
                _ => found.push(path),
            }
        }
        found
    }

    #[test]
    fn no_thread_is_started_by_a_function_that_panics() {
        let all = files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
        assert!(all.len() > 100, "{}", all.len());
        for path in all {
            // Files that are not UTF-8 text, such as fonts, contain no code.
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            let code = text.split("\nmod tests {").next().unwrap_or_default();
            for spawn in ["thread::spawn(", "scope.spawn("] {
                assert!(!code.contains(spawn), "{} calls {spawn})", path.display());
            }
        }
    }
}
