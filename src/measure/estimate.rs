//! What may be said of a point by its samples: how long it takes and, where there are enough of them, how sure that is.

/// Fewer samples than these have no interval, and no verdict rests on them: of four the interval of the median would be
/// from the least to the greatest and still miss the true median in an eighth of all cases (2 x 0.5^4), of five in a sixteenth.
pub const MIN_SAMPLES: usize = 5;

/// A point's median with its 95% interval, which only enough samples have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    median_ms: f64,
    n: usize,
    interval_ms: Option<[f64; 2]>,
}

impl Estimate {
    /// Of `n` samples. An interval that came with fewer than [`MIN_SAMPLES`] is not taken over.
    pub fn new(median_ms: f64, n: usize, interval_ms: Option<[f64; 2]>) -> Self {
        Self { median_ms, n, interval_ms: interval_ms.filter(|_| n >= MIN_SAMPLES) }
    }

    /// The median.
    pub fn median_ms(&self) -> f64 {
        self.median_ms
    }

    /// The median's 95% interval; none of too few samples.
    pub fn interval_ms(&self) -> Option<[f64; 2]> {
        self.interval_ms
    }

    /// What stands in the interval's place: "not enough samples (n = 3)".
    pub fn not_enough(&self) -> Option<String> {
        self.interval_ms.is_none().then(|| not_enough(self.n))
    }

    /// The least and the greatest that this median over another's may surely be; none where one has no interval.
    pub fn ratio_interval(&self, other: &Self) -> Option<[f64; 2]> {
        let ([low, high], [other_low, other_high]) = (self.interval_ms?, other.interval_ms?);
        (other_low > 0.0).then(|| [low / other_high, high / other_low])
    }
}

/// "not enough samples (n = 3)".
pub fn not_enough(n: usize) -> String {
    format!("not enough samples (n = {n})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_samples_have_no_interval_and_five_do() {
        let of = |n| Estimate::new(2.0, n, Some([1.0, 3.0]));
        assert_eq!((of(4).interval_ms(), of(5).interval_ms()), (None, Some([1.0, 3.0])));
        assert_eq!(of(3).not_enough().as_deref(), Some("not enough samples (n = 3)"));
        assert_eq!(of(5).not_enough(), None);
    }

    #[test]
    fn a_ratio_needs_both_intervals() {
        let of = |median_ms, n| Estimate::new(median_ms, n, Some([0.9 * median_ms, 1.1 * median_ms]));
        let [low, high] = of(4.0, 5).ratio_interval(&of(2.0, 5)).expect("both have intervals");
        assert!((low - 3.6 / 2.2).abs() < 1e-12 && (high - 4.4 / 1.8).abs() < 1e-12, "{low} {high}");
        assert_eq!(of(4.0, 4).ratio_interval(&of(2.0, 5)), None);
        assert_eq!(of(4.0, 5).ratio_interval(&of(2.0, 4)), None);
        assert_eq!(of(4.0, 5).ratio_interval(&of(0.0, 5)), None);
    }
}
