//! The number of samples that a verdict needs.

/// The smallest number of samples of a point per launch of the worker processes. If a point has fewer than
/// `MIN_SAMPLES` samples in one of the launches, raycl computes no interval for this point, and does not
/// compare its times. (Launches in which no point has enough samples, for example because they were
/// interrupted, are ignored.) The widest interval that samples can give for the median reaches from the least
/// sample to the greatest. With four samples, even the interval from the least to the greatest sample misses
/// the true median in an eighth of all cases (2 x 0.5^4). With five samples, this widest interval misses the
/// true median in a sixteenth of all cases.
pub const MIN_SAMPLES: usize = 5;

/// Says why a point has no interval although it has enough samples: some of its times are 0.
pub const BELOW_RESOLUTION: &str = "times below the timer's resolution";

/// Returns a text such as "not enough samples (n = 3)". `n` is the number of samples in the launch with the fewest.
pub fn not_enough(n: usize) -> String {
    format!("not enough samples (n = {n})")
}
