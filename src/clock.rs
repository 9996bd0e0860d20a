//! Durations by the host's clock, and the interval of checks during a wait.

use std::time::{Duration, Instant};

/// The interval at which a waiting process checks whether the user has interrupted it.
pub const LOOK_UP: Duration = Duration::from_millis(100);

/// Returns the time since `start` in milliseconds.
pub fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
