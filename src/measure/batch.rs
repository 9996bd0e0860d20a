//! Computes how many frames a sample needs, given the resolution of the device's timer.

/// The shortest pass of a frame, added up over the frames of a batch, should take at least `STEPS` steps of
/// the device's timer. The device's timer rounds the start time and the end time of each command to whole
/// steps. If the pass takes at least `STEPS` steps, the error of its mean time is usually at most a few per
/// cent.
const STEPS: f64 = 50.0;
/// The largest number of frames in a batch, since the number of OpenCL events and the length of a queue are limited.
const MOST: u32 = 256;

/// Returns the number of frames per sample: the smallest number of frames whose shortest passes together take
/// at least `STEPS` steps of the timer, but at most `MOST`. `shortest_ms` is the time of the shortest pass of
/// one frame, and `resolution_ns` is one step of the timer. Returns 1 if the timer's resolution is unknown or
/// `shortest_ms` is not finite.
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
        assert_eq!([batch_size(0.0, Some(1000)), batch_size(1e-9, Some(1000))], [256; 2]);
    }

    #[test]
    fn fine_timers_and_unknown_ones_need_no_batch() {
        assert_eq!(batch_size(0.004, Some(1)), 1);
        assert_eq!(batch_size(0.004, None), 1);
        assert_eq!(batch_size(f64::NAN, Some(1000)), 1);
    }
}
