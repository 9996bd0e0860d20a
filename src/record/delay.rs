//! Estimates how much more (or less) other programs may have delayed a point than the anchor (work that is
//! timed for comparison) of the point's device.
//!
//! `raycl compare` divides a point's time by the time of its anchor, so that a machine's speed cancels. Other
//! programs may delay the point and its anchor by different factors. For example, a frame of half a
//! millisecond often ends before it is preempted, whereas an anchor of five milliseconds may be preempted in
//! all samples. The utilization of a sample is its processor time divided by its elapsed time. raycl leaves
//! out samples whose utilization is clearly below the usual utilization in the run, but keeps at least five
//! samples of each launch. If other programs delay all samples of a run by about the same factor, raycl
//! therefore keeps all samples. The utilization of the samples that raycl keeps shows by how much other
//! programs may have delayed these samples.

use super::types::Record;

/// Returns the error that other programs may have caused in the change of a point's time between two runs. The
/// change is the ratio of the point's time in the second run (`after`) to its time in the first run (`before`),
/// each divided by the anchor's time in the same run. The error is the logarithm of the factor by which this
/// ratio may be too large. The error is negative if the ratio may be too small, and 0 if nothing shows an error
/// of the ratio.
pub(crate) fn unshared_delay(before: &Record, after: &Record) -> f64 {
    known(before, after).unwrap_or(0.0)
}

fn known(before: &Record, after: &Record) -> Option<f64> {
    let anchor = |record: &Record| record.relative_times.as_ref()?.anchor.as_ref()?.utilization;
    let (first, second) = (anchor(before)?, anchor(after)?);
    let of_anchor = delay(first.remaining, second.remaining)?;
    // A point's utilization also changes if its kernel changed, for example if the work-groups of the new
    // kernel take unequal times. The delay that raycl computes from the point's utilization is therefore
    // limited. raycl assumes that other programs delayed the point by at most the factor by which they
    // delayed all samples of the anchor together.
    let most = delay(first.overall, second.overall)?;
    let of_point = delay(before.utilization?, after.utilization?)?.clamp(most.min(0.0), most.max(0.0));
    Some(of_point - of_anchor)
}

/// Returns the logarithm of the factor by which times grow if other programs lower the utilization from
/// `before` to `after`. Returns `None` if a utilization is 0, as on systems that report no processor times.
fn delay(before: f64, after: f64) -> Option<f64> {
    let delay = (before / after).ln();
    delay.is_finite().then_some(delay)
}

#[cfg(test)]
mod tests {
    use super::super::anchors::AnchorUtilization;
    use super::super::relative_times::MeasuredAnchor;
    use super::super::summary::tests::{judged, measured};
    use super::*;

    /// Returns a record with the given utilization. The record's anchor has two utilizations (processor time
    /// divided by elapsed time): `remaining` for the samples that were not preempted, and `overall` for all
    /// samples.
    fn record(utilization: f64, [remaining, overall]: [f64; 2]) -> Record {
        let mut record = judged([measured("cpu", "naive", 8, 1.0)]).remove(0);
        record.utilization = Some(utilization);
        if let Some(times) = &mut record.relative_times {
            let (name, standing) = ("a".to_owned(), times.standing.clone());
            let utilization = Some(AnchorUtilization { remaining, overall });
            times.anchor = Some(MeasuredAnchor { name, standing, utilization });
        }
        record
    }

    /// Returns the factor by which the measured change of a point's time, from an undisturbed run to the run
    /// `after`, may be too large.
    fn factor(after: &Record) -> f64 {
        let quiet = record(2.0, [2.0; 2]);
        let delay = unshared_delay(&quiet, after);
        assert!((delay + unshared_delay(after, &quiet)).abs() < 1e-12, "the runs can be exchanged");
        (100.0 * delay.exp()).round() / 100.0
    }

    #[test]
    fn only_what_delayed_the_point_and_its_anchor_differently_counts() {
        assert_eq!(factor(&record(2.0, [2.0; 2])), 1.0);
        assert_eq!(factor(&record(2.0, [1.0, 1.0])), 0.5, "only the anchor was delayed");
        assert_eq!(factor(&record(1.0, [1.0, 1.0])), 1.0, "both were delayed");
        assert_eq!(factor(&record(1.0, [2.0, 1.0])), 2.0, "all samples of the point were delayed");
        assert_eq!(
            factor(&record(1.0, [2.0, 1.6])),
            1.25,
            "the anchor was delayed by a factor of 1.25, and the point is assumed to be delayed no more"
        );
        assert_eq!(factor(&record(1.0, [2.0, 2.0])), 1.0, "on a quiet machine, the kernel changed");
    }

    #[test]
    fn without_processor_times_no_error_is_known() {
        let quiet = record(2.0, [2.0; 2]);
        let without = Record { utilization: None, ..record(1.0, [1.0; 2]) };
        assert_eq!((unshared_delay(&quiet, &without), unshared_delay(&without, &quiet)), (0.0, 0.0));
        assert_eq!(unshared_delay(&quiet, &record(0.0, [0.0; 2])), 0.0);
        assert_eq!(unshared_delay(&quiet, &measured("cpu", "naive", 8, 1.0)), 0.0);
    }
}
