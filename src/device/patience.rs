//! An end for drivers that never answer.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// The variable that is set in a process that does a command's work for another, which sees how it ends.
pub const GUARDED: &str = "RAYCL_GUARDED";
/// The exit code of a process whose driver did not answer. Only raycl itself sees it.
pub const HUNG: i32 = 124;
/// Far longer than drivers take to start.
const LIMIT: Duration = Duration::from_secs(60);
/// Set, for tests, to milliseconds that a driver may take instead.
const LIMIT_OF_TEST: &str = "RAYCL_TEST_DRIVER_LIMIT_MS";

/// How often raycl checks for an answer.
const LOOK_UP: Duration = Duration::from_millis(20);

/// Ends the process with [`HUNG`], unless it is dropped in time.
pub struct Patience {
    answered: Arc<AtomicBool>,
}

impl Patience {
    /// Begins to wait for a driver, where another process sees how this one ends.
    pub(super) fn of_guarded() -> Option<Self> {
        std::env::var_os(GUARDED).is_some().then(Self::begin)
    }

    /// Begins to wait for a driver.
    pub fn begin() -> Self {
        let answered = Arc::new(AtomicBool::new(false));
        let (seen, limit) = (Arc::clone(&answered), limit());
        let (ready, is_ready) = channel();
        std::thread::spawn(move || {
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
        });
        // A driver that hangs while it is loaded holds the loader's lock. Whatever takes that, as a thread's beginning and its
        // first use of thread-local values do, has to be over before.
        let _ = is_ready.recv();
        Self { answered }
    }
}

impl Drop for Patience {
    fn drop(&mut self) {
        self.answered.store(true, Ordering::Relaxed);
    }
}

/// Ends the process without what is usually done at its end, which may wait for what hangs.
fn end(message: &str) {
    #[cfg(unix)]
    let _ = rustix::io::write(rustix::stdio::stderr(), message.as_bytes());
    #[cfg(not(unix))]
    let _ = message;
    signal_hook::low_level::exit(HUNG);
}

fn limit() -> Duration {
    let of_test = std::env::var(LIMIT_OF_TEST).ok().and_then(|text| text.parse().ok());
    of_test.map_or(LIMIT, Duration::from_millis)
}
