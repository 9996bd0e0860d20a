//! The processor time of this process.

use std::time::Duration;

/// Returns the processor time that all threads of this process have used since the process started; zero if
/// the system does not report this time.
#[cfg(unix)]
pub fn processor_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).unwrap_or_default()
}

/// Returns zero: raycl reads the processor time only on Unix.
#[cfg(not(unix))]
pub fn processor_time() -> Duration {
    Duration::ZERO
}
