//! Ends a process whose OpenCL driver does not answer within a time limit.

use crate::error::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread::Builder;
use std::time::{Duration, Instant};

/// The environment variable that marks a process that does a command's work for its parent process. If a
/// process with the variable `RAYCL_GUARDED` exits because its driver hangs, the parent process reports that the driver
/// hangs.
pub const GUARDED: &str = "RAYCL_GUARDED";
/// The exit code of a process whose driver did not answer. Only processes that raycl starts for its own work
/// exit with this code.
pub const HUNG: i32 = 124;
/// The time limit for a driver's answer. Drivers usually start in much less time than `LIMIT`.
const LIMIT: Duration = Duration::from_secs(60);
/// An environment variable with which tests set the time limit for a driver's answer, in milliseconds.
const LIMIT_OF_TEST: &str = "RAYCL_TEST_DRIVER_LIMIT_MS";

/// The time between two checks whether the driver has answered.
const LOOK_UP: Duration = Duration::from_millis(20);

/// A time limit for the OpenCL driver. Ends the process with the exit code [`HUNG`], unless this value is
/// dropped within the time limit.
pub struct Patience {
    answered: Arc<AtomicBool>,
}

impl Patience {
    /// Starts the time limit if a parent process handles the exit of this process (see [`GUARDED`]). Returns
    /// `None` if no parent process handles the exit.
    ///
    /// # Errors
    ///
    /// Fails if no thread can be started.
    pub(super) fn of_guarded() -> Result<Option<Self>> {
        std::env::var_os(GUARDED).map(|_| Self::begin()).transpose()
    }

    /// Starts the time limit for a driver's answer.
    ///
    /// # Errors
    ///
    /// Fails if no thread can be started.
    pub fn begin() -> Result<Self> {
        let answered = Arc::new(AtomicBool::new(false));
        let (seen, limit) = (Arc::clone(&answered), limit());
        let (ready, is_ready) = channel();
        let wait = move || {
            let message = format!("a driver has not answered for {} s\n", limit.as_secs());
            let start = Instant::now();
            let _ = ready.send(());
            while start.elapsed() < limit {
                std::thread::sleep(LOOK_UP);
                if seen.load(Ordering::Relaxed) {
                    return;
                }
            }
            end(&message)
        };
        Builder::new().spawn(wait).map_err(|error| Error::no_thread(&error))?;
        // A driver that hangs while it is loaded holds the lock of the system's dynamic linker. Starting a
        // thread takes the linker's lock too, and so does the thread's first use of thread-local values. The
        // thread that waits for the time limit must therefore have started, and have used thread-local
        // values, before the driver is loaded.
        let _ = is_ready.recv();
        Ok(Self { answered })
    }
}

impl Drop for Patience {
    fn drop(&mut self) {
        self.answered.store(true, Ordering::Relaxed);
    }
}

/// Prints the message and ends the process without running exit handlers, since exit handlers may wait for the
/// hanging driver.
fn end(message: &str) {
    #[cfg(unix)]
    let _ = rustix::io::write(rustix::stdio::stderr(), message.as_bytes());
    #[cfg(not(unix))]
    let _ = message;
    signal_hook::low_level::exit(HUNG);
}

fn limit() -> Duration {
    limit_of(std::env::var(LIMIT_OF_TEST).ok().as_deref())
}

/// Returns the time limit if the variable [`LIMIT_OF_TEST`] has the value `variable`.
fn limit_of(variable: Option<&str>) -> Duration {
    let of_test = variable.and_then(|text| text.parse().ok());
    of_test.map_or(LIMIT, Duration::from_millis)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_has_a_minute_to_answer_unless_a_test_sets_another_limit() {
        let [minute, quarter] = [Duration::from_secs(60), Duration::from_millis(250)];
        assert_eq!([limit_of(None), limit_of(Some("a")), limit_of(Some("250"))], [minute, minute, quarter]);
    }

    /// If dropping `Patience` did not set `answered`, the process would end at the time limit although its
    /// driver has answered.
    #[test]
    fn a_driver_whose_patience_is_dropped_has_answered() {
        let answered = Arc::new(AtomicBool::new(false));
        drop(Patience { answered: Arc::clone(&answered) });
        assert!(answered.load(Ordering::Relaxed));
    }
}
