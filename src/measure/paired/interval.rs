//! An estimate with its 95% interval.

use super::error::Error;

/// The probability that the true value lies below a 95% interval, and also the probability that it lies above.
pub(super) const RISK: f64 = 0.025;
/// [`Interval::mean`] computes the weights of values as if every value had at least the relative error
/// `LEAST_ERROR`.
const LEAST_ERROR: f64 = 1e-6;

/// A value and its 95% interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The estimated value.
    pub middle: f64,
    /// The lower end of the 95% interval.
    pub low: f64,
    /// The upper end of the 95% interval.
    pub high: f64,
    /// The standard error of the estimate's logarithm.
    pub error: f64,
    /// Degrees of freedom of the standard error `error`, for Student's t.
    pub degrees: f64,
    /// The largest amount by which the estimate's logarithm may be wrong, in either direction, for a reason
    /// that the samples do not show. The logarithm of each end of the interval is moved outwards by the
    /// amount `bias`.
    pub bias: f64,
}

impl Interval {
    /// The ratio of a time to itself, which has no error.
    pub const ONE: Self =
        Self { middle: 1.0, low: 1.0, high: 1.0, error: 0.0, degrees: f64::INFINITY, bias: 0.0 };

    /// Returns the ratio of this value to an independent value, `other`.
    pub fn over(self, other: Self) -> Self {
        let error = Error::of_sum([self.error(), other.error()]);
        biased((self.middle / other.middle).ln(), error, self.bias + other.bias)
    }

    /// Returns the geometric mean of independent values; `None` if `all` is empty. Each value is weighted by
    /// the inverse of its variance, so that an uncertain value has little weight. For the weights of the
    /// values, the square of each value's bias is added to the value's variance. The variances are only
    /// estimates, which makes the mean less certain. The error of the result includes the uncertainty of the
    /// variances, by equation 1 of Meier, "Variance of a weighted mean" (Biometrics 9, 1953). The biases of
    /// the values may all have the same sign, so they do not average out. The bias of the geometric mean is
    /// therefore the weighted mean of the biases of all values.
    pub fn mean(all: &[Self]) -> Option<Self> {
        // Without `LEAST_ERROR`, a value with neither error nor bias would have an infinite weight.
        let weight = |one: &Self| one.error.hypot(one.bias).max(LEAST_ERROR).powi(-2);
        let sum: f64 = all.iter().map(weight).sum();
        let shares = || all.iter().map(|one| (weight(one) / sum, one));
        let log = shares().map(|(share, one)| share * one.middle.ln()).sum();
        let mean =
            Error::of_sum(shares().map(|(share, one)| Error { error: share * one.error, ..one.error() }));
        let estimated: f64 = shares().map(|(share, one)| share * (1.0 - share) / one.degrees).sum();
        let error = mean.error * (1.0 + 4.0 * estimated).sqrt();
        let bias = shares().map(|(share, one)| share * one.bias).sum();
        (!all.is_empty()).then(|| biased(log, Error { error, ..mean }, bias))
    }

    /// Returns this value divided by a factor that is not known exactly. The factor's logarithm lies between
    /// 0 and `log`, which may be negative. As an estimate of the factor, its middle value is used, whose
    /// logarithm is half of `log`. The true factor may be larger than this estimate in all samples, or
    /// smaller in all samples. The absolute value of half of `log` is therefore added to the result's bias,
    /// and not to its standard error: standard errors average out in a mean.
    #[must_use]
    pub fn over_up_to(self, log: f64) -> Self {
        biased(self.middle.ln() - 0.5 * log, self.error(), self.bias + 0.5 * log.abs())
    }

    /// Returns a lower bound of the true value that this interval estimates. The true value is below the
    /// returned bound only with the probability `risk`.
    pub fn surely_above(self, risk: f64) -> f64 {
        (self.middle.ln() - self.error().reach(risk) - self.bias).exp()
    }

    pub(super) fn error(self) -> Error {
        Error { error: self.error, degrees: self.degrees }
    }
}

/// Makes an interval from the logarithm of an estimate and the logarithm's error.
pub(super) fn interval(middle: f64, error: Error) -> Interval {
    biased(middle, error, 0.0)
}

/// Makes an interval from the logarithm of an estimate, and the logarithm's error and bias.
pub(super) fn biased(middle: f64, error: Error, bias: f64) -> Interval {
    let half = error.reach(RISK) + bias;
    let [low, high] = [(middle - half).exp(), (middle + half).exp()];
    Interval { middle: middle.exp(), low, high, error: error.error, degrees: error.degrees, bias }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_leaves_a_fortieth_on_each_side() {
        let actual = interval(2.0, Error { error: 0.1, degrees: f64::INFINITY });
        // The quantiles of the normal distribution at 0.025 and 0.975 are -1.960 and 1.960. The quantiles at
        // 0.05 and 0.95 are -1.645 and 1.645.
        assert!((actual.low.ln() - (2.0 - 0.195_996)).abs() < 1e-6, "{actual:?}");
        assert!((actual.high.ln() - (2.0 + 0.195_996)).abs() < 1e-6, "{actual:?}");
    }

    #[test]
    fn the_mean_of_intervals_is_as_sure_as_its_parts_together() {
        let known = |middle, error| interval(middle, Error { error, degrees: f64::INFINITY });
        let one = known(2.0, 0.1);
        let mean = Interval::mean(&[one; 4]).unwrap();
        // The mean of four values with independent, equal errors has half of that error.
        assert!((mean.middle.ln() - 2.0).abs() < 1e-12 && (mean.error - 0.05).abs() < 1e-12, "{mean:?}");
        assert!(Interval::mean(&[]).is_none());
        // A value with three times the error has a ninth of the weight.
        let mean = Interval::mean(&[one, known(3.0, 0.3)]).unwrap();
        assert!((mean.middle.ln() - 2.1).abs() < 1e-12, "{mean:?}");
        assert!((mean.error - 0.1 * 0.9_f64.sqrt()).abs() < 1e-12, "{mean:?}");
        // Two values without any error have equal weights.
        assert!(
            (Interval::mean(&[known(2.0, 0.0), known(3.0, 0.0)]).unwrap().middle.ln() - 2.5).abs() < 1e-12
        );
    }

    #[test]
    fn weights_that_are_estimates_make_the_mean_less_certain() {
        let estimated = interval(2.0, Error { error: 0.1, degrees: 4.0 });
        let mean = Interval::mean(&[estimated; 2]).unwrap();
        // By Meier's equation, the variance of the mean, 0.1 * 0.1 / 2, grows by the fraction 4 * (1/4 + 1/4) / 4 of
        // itself.
        assert!((mean.error - (0.005_f64 * 1.5).sqrt()).abs() < 1e-12, "{mean:?}");
        assert!((mean.degrees - 8.0).abs() < 1e-9, "{mean:?}");
    }

    #[test]
    fn a_factor_that_is_unknown_between_limits_moves_the_middle_and_both_ends_allow_for_both_limits() {
        // With two degrees of freedom, the interval of the logarithm extends by 0.43 to each side of its
        // middle, without any bias.
        let one = interval(2.0, Error { error: 0.1, degrees: 2.0 });
        for log in [0.6_f64, -0.6] {
            let divided = one.over_up_to(log);
            assert!((divided.middle.ln() - (2.0 - 0.5 * log)).abs() < 1e-12, "{divided:?}");
            assert!((divided.low.ln() - (one.low.ln() - log.max(0.0))).abs() < 1e-12, "{divided:?}");
            assert!((divided.high.ln() - (one.high.ln() - log.min(0.0))).abs() < 1e-12, "{divided:?}");
            let [sure, before] = [divided, one].map(|one| one.surely_above(1e-4).ln());
            assert!((sure - (before - log.max(0.0))).abs() < 1e-12, "{divided:?}");
        }
        assert_eq!(Interval::ONE.over_up_to(0.0), Interval::ONE);
        let quotient = one.over_up_to(0.6).over(one.over_up_to(-0.2));
        assert!((quotient.bias - 0.4).abs() < 1e-12, "{quotient:?}");
    }

    #[test]
    fn what_is_surely_exceeded_lies_below_the_middle() {
        let one = interval(2.0, Error { error: 0.1, degrees: f64::INFINITY });
        assert!((one.surely_above(0.025) - one.low).abs() < 1e-12 && one.surely_above(1e-4) < one.low);
    }
}
