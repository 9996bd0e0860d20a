//! The number of samples that a verdict needs.

/// The smallest number of samples in a launch for which an interval is computed; no verdict uses fewer. The
/// widest interval of the median, from the least to the greatest of four samples, misses the true median in
/// an eighth of all cases (2 x 0.5^4); that of five samples misses it in a sixteenth.
pub const MIN_SAMPLES: usize = 5;

/// Returns "not enough samples (n = 3)".
pub fn not_enough(n: usize) -> String {
    format!("not enough samples (n = {n})")
}
