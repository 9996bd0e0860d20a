//! How many samples a verdict needs.

/// Fewer samples in a launch than these have no interval, and no verdict rests on them: of four the interval of the median would
/// be from the least to the greatest and still miss the true median in an eighth of all cases (2 x 0.5^4), of five in a sixteenth.
pub const MIN_SAMPLES: usize = 5;

/// "not enough samples (n = 3)".
pub fn not_enough(n: usize) -> String {
    format!("not enough samples (n = {n})")
}
