//! An estimate with its 95% interval.

use super::error::Error;

/// The probability that the true value lies below a 95% interval, and also the probability that it lies above.
pub(super) const RISK: f64 = 0.025;
/// Weights are computed as if every error were at least this large (a fraction of the value).
const LEAST_ERROR: f64 = 1e-6;

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
    /// The ratio of a time to itself, which has no error.
    pub const ONE: Self = Self { middle: 1.0, low: 1.0, high: 1.0, error: 0.0, degrees: f64::INFINITY };

    /// Returns the ratio of this value to an independent value, `other`.
    pub fn over(self, other: Self) -> Self {
        let error = Error::of_sum([self.error(), other.error()]);
        interval((self.middle / other.middle).ln(), error)
    }

    /// Returns the geometric mean of independent values; `None` if there are none. Each value is weighted by the
    /// inverse of its variance, so that an uncertain value has little weight. The variances are only estimates, so the
    /// mean is less certain than they suggest. The result includes this additional error, by equation 1 of Meier,
    /// "Variance of a weighted mean" (Biometrics 9, 1953).
    pub fn mean(all: &[Self]) -> Option<Self> {
        // Without an error, a value would have an infinite weight.
        let weight = |one: &Self| one.error.max(LEAST_ERROR).powi(-2);
        let sum: f64 = all.iter().map(weight).sum();
        let shares = || all.iter().map(|one| (weight(one) / sum, one));
        let log = shares().map(|(share, one)| share * one.middle.ln()).sum();
        let mean =
            Error::of_sum(shares().map(|(share, one)| Error { error: share * one.error, ..one.error() }));
        let estimated: f64 = shares().map(|(share, one)| share * (1.0 - share) / one.degrees).sum();
        let error = mean.error * (1.0 + 4.0 * estimated).sqrt();
        (!all.is_empty()).then(|| interval(log, Error { error, ..mean }))
    }

    /// Returns a lower bound: the true value lies below it only with the probability `risk`.
    pub fn surely_above(self, risk: f64) -> f64 {
        (self.middle.ln() - self.error().reach(risk)).exp()
    }

    pub(super) fn error(self) -> Error {
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
        // The quantiles of the normal distribution at 0.025 and 0.975 are -1.960 and 1.960; those at 0.05 and 0.95 are
        // -1.645 and 1.645.
        assert!((found.low.ln() - (2.0 - 0.195_996)).abs() < 1e-6, "{found:?}");
        assert!((found.high.ln() - (2.0 + 0.195_996)).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn the_mean_of_intervals_is_as_sure_as_its_parts_together() {
        let known = |middle, error| interval(middle, Error { error, degrees: f64::INFINITY });
        let one = known(2.0, 0.1);
        let found = Interval::mean(&[one; 4]).unwrap();
        // The mean of four values with independent, equal errors has half of that error.
        assert!((found.middle.ln() - 2.0).abs() < 1e-12 && (found.error - 0.05).abs() < 1e-12, "{found:?}");
        assert!(Interval::mean(&[]).is_none());
        // A value with three times the error has a ninth of the weight.
        let found = Interval::mean(&[one, known(3.0, 0.3)]).unwrap();
        assert!((found.middle.ln() - 2.1).abs() < 1e-12, "{found:?}");
        assert!((found.error - 0.1 * 0.9_f64.sqrt()).abs() < 1e-12, "{found:?}");
        // Two values without any error have equal weights.
        assert!(
            (Interval::mean(&[known(2.0, 0.0), known(3.0, 0.0)]).unwrap().middle.ln() - 2.5).abs() < 1e-12
        );
    }

    #[test]
    fn weights_that_are_estimates_make_the_mean_less_certain() {
        let estimated = interval(2.0, Error { error: 0.1, degrees: 4.0 });
        let found = Interval::mean(&[estimated; 2]).unwrap();
        // By Meier's equation, the variance of the mean, 0.1 * 0.1 / 2, grows by 4 * (1/4 + 1/4) / 4.
        assert!((found.error - (0.005_f64 * 1.5).sqrt()).abs() < 1e-12, "{found:?}");
        assert!((found.degrees - 8.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn what_is_surely_exceeded_lies_below_the_middle() {
        let one = interval(2.0, Error { error: 0.1, degrees: f64::INFINITY });
        assert!((one.surely_above(RISK) - one.low).abs() < 1e-12 && one.surely_above(1e-4) < one.low);
    }
}
