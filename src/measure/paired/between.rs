//! Differences between runs, which no single run can show.

use super::error::Error;

/// The variation of times from run to run, in addition to their variation between the launches of one run.
/// The launches of a run are minutes apart at most, but a machine may be slower for hours, for example
/// because of other virtual machines on the same host. All errors and variances that the functions of this
/// type compute are those of logarithms: of the logarithm of a time or, where a function says so, of the
/// logarithm of a ratio of times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BetweenRuns {
    /// From run to run, the times of all points on one kind of device are multiplied by a common factor. The
    /// field `shared` is the standard deviation of the logarithm of this factor, which is common to all
    /// points. In ratios of times on the same kind of device, the factor that is common to all points
    /// cancels.
    pub shared: f64,
    /// From run to run, the time of each point is also multiplied by a factor of its own. The field `own` is
    /// the standard deviation of the logarithm of a point's own factor.
    pub own: f64,
}

impl BetweenRuns {
    /// The variation of times on CPUs from run to run. The values of `ON_PROCESSORS` apply to kernels that an
    /// OpenCL driver runs on a CPU, and to baselines, which run on the host without OpenCL. `shared` and
    /// `own` were measured with two experiments, each of which was run several times on quiet virtual
    /// machines of two cores (docs/log.md, 2026-11-23 and 2026-11-25).
    pub const ON_PROCESSORS: Self = Self { shared: 0.027, own: 0.011 };
    /// The variation of times on all other devices from run to run. For devices other than CPUs, `shared` and
    /// `own` were measured with one experiment, in four series of runs on GPUs (docs/log.md, 2026-11-23 and
    /// 2026-11-25). Records of earlier runs, which were made on three different days, were also used.
    pub const ON_OTHER_DEVICES: Self = Self { shared: 0.005, own: 0.004 };

    /// Returns the error that the differences between runs add to the mean time of `points` points on the
    /// same kind of device.
    pub(super) fn of_level(self, points: usize) -> Error {
        known(self.shared.powi(2) + self.own_variance(points))
    }

    /// Returns the error that the differences between runs add to the ratio of two mean times. The first is
    /// the mean over `points[0]` points, and the second is the mean over `points[1]` points. `other` states
    /// how much the times of the points in the second mean differ from run to run.
    pub(super) fn of_ratio(self, other: Self, points: [usize; 2]) -> Error {
        let own = self.own_variance(points[0]) + other.own_variance(points[1]);
        known(own + self.shared_variance(other))
    }

    /// Returns the error that the points' own factors (`own`) add to the mean time of `points` points. From
    /// run to run, the time of each point is multiplied by such a factor of its own. If the mean time is
    /// divided by a reference time, this error affects only this ratio, and not the ratios of other points to
    /// the same reference time.
    pub(super) fn of_points(self, points: usize) -> Error {
        known(self.own_variance(points))
    }

    /// All ratios of points (on the same kind of device) to the same reference time have an error in common.
    /// Returns the part of this error's variance that comes from the differences between runs. The reference
    /// time is the mean time of `points` points. The returned variance comes from the own factor (`own`) of
    /// each of the `points` points and, if `self` and `reference` belong to different kinds of device, from
    /// the common factors (`shared`) of both kinds.
    pub(super) fn variance_of_reference(self, reference: Self, points: usize) -> f64 {
        reference.own_variance(points) + self.shared_variance(reference)
    }

    /// Returns the variance of the logarithm of a quotient: the common factor (`shared`) of all points on one
    /// kind of device, divided by the common factor of another kind of device. If `self` and `other` are
    /// equal, both kinds of device are taken to be the same kind, whose common factor cancels in the
    /// quotient.
    fn shared_variance(self, other: Self) -> f64 {
        if self == other { 0.0 } else { self.shared.powi(2) + other.shared.powi(2) }
    }

    fn own_variance(self, points: usize) -> f64 {
        self.own.powi(2) / points as f64
    }
}

/// Returns an error whose variance, `variance`, is known beforehand and not estimated from the samples (type
/// B in the *Guide to the Expression of Uncertainty in Measurement*, JCGM 100:2008).
pub(super) fn known(variance: f64) -> Error {
    Error { error: variance.sqrt(), degrees: f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW_HOURS: BetweenRuns = BetweenRuns { shared: 0.04, own: 0.03 };

    #[test]
    fn a_time_has_both_factors_and_a_ratio_only_those_of_its_points() {
        assert!((SLOW_HOURS.of_level(1).error - 0.05).abs() < 1e-12);
        assert!((SLOW_HOURS.of_ratio(SLOW_HOURS, [1, 1]).error - 0.03 * 2.0_f64.sqrt()).abs() < 1e-12);
        // Each of nine points has a factor of its own. The mean of these factors has a third of the standard
        // deviation of one factor.
        assert!((SLOW_HOURS.of_ratio(SLOW_HOURS, [9, 9]).error - 0.01 * 2.0_f64.sqrt()).abs() < 1e-12);
        for points in [[1, 9], [9, 1]] {
            assert!((SLOW_HOURS.of_ratio(SLOW_HOURS, points).error - 0.01 * 10.0_f64.sqrt()).abs() < 1e-12);
        }
    }

    #[test]
    fn devices_of_two_kinds_are_not_slow_together() {
        let steady = BetweenRuns::default();
        assert!((SLOW_HOURS.of_ratio(steady, [1, 1]).error - 0.05).abs() < 1e-12);
        assert!((steady.of_ratio(SLOW_HOURS, [1, 1]).error - 0.05).abs() < 1e-12);
    }
}
