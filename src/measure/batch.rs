//! How many frames a sample needs so that the device's timer can tell their time.

/// A time is read twice to the timer's step, so that one of this many steps is off by at most a few per cent; a batch
/// is given at least as many.
const STEPS: f64 = 50.0;
/// The most frames of a batch: event objects and queues have their limits.
const MOST: u32 = 256;

/// Frames to cast for one sample of a frame whose shortest part takes `shortest_ms`, by a timer that counts in steps of
/// `resolution_ns`. 1 where a frame alone is long enough, or where nothing is known of the timer.
pub fn batch_size(shortest_ms: f64, resolution_ns: Option<u64>) -> u32 {
    let Some(resolution_ns) = resolution_ns else { return 1 };
    let wanted_ms = STEPS * resolution_ns as f64 * 1e-6;
    if !shortest_ms.is_finite() || shortest_ms >= wanted_ms {
        return 1;
    }
    if shortest_ms <= 0.0 {
        return MOST;
    }
    ((wanted_ms / shortest_ms).ceil() as u32).clamp(1, MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_frames_are_batched_until_the_timer_can_tell_them() {
        assert_eq!(batch_size(1.0, Some(1000)), 1);
        assert_eq!(batch_size(0.05, Some(1000)), 1);
        assert_eq!(batch_size(0.049, Some(1000)), 2);
        assert_eq!(batch_size(0.004, Some(1000)), 13);
        assert_eq!(batch_size(0.0, Some(1000)), MOST);
        assert_eq!(batch_size(1e-9, Some(1000)), MOST);
    }

    #[test]
    fn fine_timers_and_unknown_ones_need_no_batch() {
        assert_eq!(batch_size(0.004, Some(1)), 1);
        assert_eq!(batch_size(0.004, None), 1);
        assert_eq!(batch_size(f64::NAN, Some(1000)), 1);
    }
}
