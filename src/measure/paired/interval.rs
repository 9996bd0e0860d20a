//! An estimate with its 95% interval.

use super::error::Error;

/// The probability that the true value lies below a 95% interval, and also the probability that it lies above.
pub(super) const RISK: f64 = 0.025;

/// A value and its 95% interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The estimate.
    pub middle: f64,
    /// The interval's lower end.
    pub low: f64,
    /// The interval's upper end.
    pub high: f64,
    /// The standard error of the estimate's logarithm.
    pub error: f64,
    /// Degrees of freedom of that standard error, for Student's t.
    pub degrees: f64,
}

impl Interval {
    /// Returns this value divided by an independent one.
    pub fn over(self, other: Self) -> Self {
        let error = Error::of_sum([self.error(), other.error()]);
        interval((self.middle / other.middle).ln(), error)
    }

    /// Returns the geometric mean of independent values; `None` if there are none.
    pub fn mean(all: &[Self]) -> Option<Self> {
        let count = all.len() as f64;
        let sum = Error::of_sum(all.iter().map(|one| one.error()));
        let log = all.iter().map(|one| one.middle.ln()).sum::<f64>() / count;
        (!all.is_empty()).then(|| interval(log, Error { error: sum.error / count, ..sum }))
    }

    /// Returns the value that the true value exceeds, except with the probability `risk`.
    pub fn surely_above(self, risk: f64) -> f64 {
        (self.middle.ln() - self.error().reach(risk)).exp()
    }

    fn error(self) -> Error {
        Error { error: self.error, degrees: self.degrees }
    }
}

/// Makes an interval from a logarithm and its error.
pub(super) fn interval(middle: f64, error: Error) -> Interval {
    let half = error.reach(RISK);
    let Error { error, degrees } = error;
    Interval { middle: middle.exp(), low: (middle - half).exp(), high: (middle + half).exp(), error, degrees }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_leaves_a_fortieth_on_each_side() {
        let found = interval(2.0, Error { error: 0.1, degrees: f64::INFINITY });
        // Quantiles of the normal distribution at 0.025 and 0.975 are 1.960; those at 0.05 and 0.95 are
        // 1.645.
        assert!((found.low.ln() - (2.0 - 0.195_996)).abs() < 1e-6, "{found:?}");
        assert!((found.high.ln() - (2.0 + 0.195_996)).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn the_mean_of_intervals_is_as_sure_as_its_parts_together() {
        let one = interval(2.0, Error { error: 0.1, degrees: f64::INFINITY });
        let found = Interval::mean(&[one; 4]).unwrap();
        // The mean of four values with independent, equal errors has half of that error.
        assert!((found.middle.ln() - 2.0).abs() < 1e-12 && (found.error - 0.05).abs() < 1e-12, "{found:?}");
        assert!(Interval::mean(&[]).is_none());
    }

    #[test]
    fn what_is_surely_exceeded_lies_below_the_middle() {
        let one = interval(2.0, Error { error: 0.1, degrees: f64::INFINITY });
        assert!((one.surely_above(RISK) - one.low).abs() < 1e-12 && one.surely_above(1e-4) < one.low);
    }
}
