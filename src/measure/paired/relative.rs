//! Ratios of times to a reference time, which may be the same for several ratios.

use super::between::known;
use super::error::Error;
use super::interval::{Interval, biased};

/// A ratio whose error is stored in two parts. The field `ratio` has the error of this ratio alone; the field
/// `common` has an error that several ratios have in common. For example, the ratios of several groups of
/// points to the time of the same anchor (work that is timed for comparison) all contain the error of this
/// anchor. The mean of such ratios contains the error of the common anchor as well, however many groups there
/// are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relative {
    /// The ratio of two times, with the error of this ratio alone.
    pub(super) ratio: Interval,
    /// The variance of the error that the logarithm of this ratio has in common with the logarithms of
    /// other ratios.
    pub(super) common: f64,
}

impl Relative {
    /// Returns a ratio that has no error in common with other ratios.
    pub fn alone(ratio: Interval) -> Self {
        Self { ratio, common: 0.0 }
    }

    /// Returns this ratio divided by `other`, a ratio that was measured in another run.
    pub fn over(self, other: Self) -> Self {
        Self { ratio: self.ratio.over(other.ratio), common: self.common + other.common }
    }

    /// Returns the ratio divided by a factor that is not known exactly but lies within limits, like
    /// [`Interval::over_up_to`]. The uncertainty of this factor belongs to one ratio only, so a mean of
    /// several ratios gives that ratio less weight.
    #[must_use]
    pub fn over_up_to(self, log: f64) -> Self {
        Self { ratio: self.ratio.over_up_to(log), ..self }
    }

    /// Returns the geometric mean of some ratios, like [`Interval::mean`]; `None` if `all` is empty. The
    /// error that all these ratios have in common is added to the mean's error once, after averaging. If the
    /// ratios state different variances of their common error, the largest of these variances is added. The
    /// common error cannot add more than this largest variance to the mean, whether or not the ratios really
    /// have an error in common.
    pub fn mean(all: &[Self]) -> Option<Interval> {
        let ratios: Vec<Interval> = all.iter().map(|one| one.ratio).collect();
        let mean = Interval::mean(&ratios)?;
        let common = all.iter().map(|one| one.common).fold(0.0, f64::max);
        let error = Error::of_sum([mean.error(), known(common)]);
        Some(biased(mean.middle.ln(), error, mean.bias))
    }
}

#[cfg(test)]
mod tests {
    use super::super::interval::interval;
    use super::*;

    fn ratio(middle: f64, error: f64) -> Interval {
        interval(middle, Error { error, degrees: f64::INFINITY })
    }

    #[test]
    fn an_error_that_all_ratios_share_does_not_average_out() {
        let one = Relative { ratio: ratio(2.0, 0.1), common: 0.0025 };
        let mean = Relative::mean(&[one; 4]).unwrap();
        // The four errors of 0.1 average out to 0.05. The shared error is 0.05, the square root of 0.0025.
        assert!((mean.error - 0.005_f64.sqrt()).abs() < 1e-12, "{mean:?}");
        assert!((mean.middle.ln() - 2.0).abs() < 1e-12 && Relative::mean(&[]).is_none());
        let alone = Relative::mean(&[Relative::alone(ratio(2.0, 0.1)); 4]).unwrap();
        assert!((alone.error - 0.05).abs() < 1e-12, "{alone:?}");
    }

    #[test]
    fn an_unknown_factor_of_all_ratios_does_not_average_out() {
        let one = Relative::alone(ratio(2.0, 0.0)).over_up_to(0.6);
        let mean = Relative::mean(&[one; 4]).unwrap();
        assert!((mean.middle.ln() - 1.7).abs() < 1e-12, "{mean:?}");
        assert!((mean.low.ln() - 1.4).abs() < 1e-12 && (mean.high.ln() - 2.0).abs() < 1e-12, "{mean:?}");
    }

    /// Six groups take 1.16 times as long as before (the logarithm is 0.15). While one of the groups was measured,
    /// other programs ran, which may have made the group's ratio wrong by a factor of 1.35.
    #[test]
    fn an_unknown_factor_of_one_ratio_does_not_hide_what_the_others_show() {
        let mut groups = [Relative { ratio: ratio(0.15, 0.02), common: 1e-4 }; 6];
        groups[5] = groups[5].over_up_to(0.3);
        let mean = Relative::mean(&groups).unwrap();
        assert!(mean.low.ln() > 0.11 && mean.high.ln() < 0.19, "{mean:?}");
        assert!(mean.surely_above(1e-3).ln() > 0.09, "{mean:?}");
    }

    #[test]
    fn of_two_runs_both_references_have_an_error() {
        let of = |common| Relative { ratio: ratio(1.0, 0.1), common };
        let quotient = of(0.01).over(of(0.02));
        assert!((quotient.common - 0.03).abs() < 1e-12, "{quotient:?}");
        assert!((quotient.ratio.error - 0.02_f64.sqrt()).abs() < 1e-12, "{quotient:?}");
    }
}
