//! Standard errors of estimates.

use crate::measure::student::t_quantile;

/// A standard error, and its degrees of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Error {
    /// The standard error of the estimate.
    pub error: f64,
    /// The degrees of freedom with which Student's t gives an interval from the standard error.
    pub degrees: f64,
}

impl Error {
    /// Returns the half-width of an interval around the estimate. The true value lies below the interval with the
    /// probability `risk`, and above it with the same probability.
    pub fn reach(self, risk: f64) -> f64 {
        if self.error == 0.0 { 0.0 } else { self.error * t_quantile(1.0 - risk, self.degrees) }
    }

    /// Returns the error of a sum of independent estimates; its degrees of freedom follow Satterthwaite
    /// (1946) and Welch (1947).
    pub fn of_sum(errors: impl IntoIterator<Item = Self>) -> Self {
        let (mut variance, mut uncertainty) = (0.0, 0.0);
        for one in errors {
            variance += one.error.powi(2);
            uncertainty += one.error.powi(4) / one.degrees;
        }
        let degrees = if uncertainty > 0.0 { variance.powi(2) / uncertainty } else { f64::INFINITY };
        Self { error: variance.sqrt(), degrees }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Error = Error { error: 0.0, degrees: f64::INFINITY };

    #[test]
    fn a_sum_of_like_errors_has_the_degrees_of_both() {
        let one = Error { error: 3.0, degrees: 4.0 };
        let sum = Error::of_sum([one, one]);
        assert!((sum.error - 18.0_f64.sqrt()).abs() < 1e-12 && (sum.degrees - 8.0).abs() < 1e-12, "{sum:?}");
        // A summand with a tiny error hardly changes the result.
        let with_small = Error::of_sum([one, Error { error: 1e-3, degrees: 1.0 }]);
        assert!((with_small.degrees - 4.0).abs() < 1e-3, "{with_small:?}");
        assert_eq!(Error::of_sum([]), NONE);
    }

    #[test]
    fn an_interval_reaches_as_far_as_its_risk_asks() {
        let known = Error { error: 2.0, degrees: 2.0 };
        assert!((known.reach(0.025) - 2.0 * 4.303).abs() < 1e-2);
        assert!(known.reach(0.001) > 3.0 * known.reach(0.025));
        assert_eq!(
            (NONE.reach(0.025), Error { error: 1.0, degrees: 0.0 }.reach(0.025)),
            (0.0, f64::INFINITY)
        );
    }
}
