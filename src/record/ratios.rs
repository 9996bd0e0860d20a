//! Computes ratios of the times of two records, and of the mean times of several records.

use super::together::between_runs;
use super::types::Record;
use crate::measure::{BetweenRuns, Interval, Paired, PairedSample, Relative, Standing};

/// Returns the time of `slow` divided by the time of `fast`. If the records were measured together, the ratio
/// compares samples that were measured close in time. If the records were measured in different blocks that
/// share a control point, the ratio is computed from the ratios of both times to the control point's time. If
/// the records share neither rounds nor a control point, the function returns the ratio of the records'
/// medians (see [`ratio_apart`]). Returns `None` if either record has too few samples, or times of 0.
pub(crate) fn ratio(slow: &Record, fast: &Record) -> Option<Interval> {
    let (slow, fast) = (slow.relative_times.as_ref()?, fast.relative_times.as_ref()?);
    if slow.together == fast.together {
        return Some(slow.standing.ratio(&fast.standing));
    }
    slow.ratio_by_control(fast).or_else(|| Some(slow.standing.ratio_apart(&fast.standing)))
}

/// Returns the time of `slow` divided by the time of `fast`, from the medians of all samples. The samples of
/// the two records are not compared pair by pair, even if the records were measured together. Returns `None`
/// if either record has too few samples, or times of 0.
pub(crate) fn ratio_apart(slow: &Record, fast: &Record) -> Option<Interval> {
    Some(slow.relative_times.as_ref()?.standing.ratio_apart(&fast.relative_times.as_ref()?.standing))
}

/// Returns a hash that is equal for all records that were measured in the same rounds; `None` if the record has no
/// relative times.
pub(crate) fn rounds_of(record: &Record) -> Option<blake3::Hash> {
    Some(record.relative_times.as_ref()?.together)
}

/// Returns true if two records were measured in the same rounds; false if a record has no relative times.
pub(crate) fn are_together(one: &Record, other: &Record) -> bool {
    rounds_of(one).zip(rounds_of(other)).is_some_and(|(one, other)| one == other)
}

/// Returns the name of the anchor of the record's device, and the ratio of the record's time to the anchor's
/// time. Returns `None` if the record has no relative times, if the anchor was not measured or has too few
/// samples or times of 0, or if the relative times were computed without anchors (see `judge_with_anchors`).
pub(crate) fn anchored(record: &Record) -> Option<(&str, Interval)> {
    let times = record.relative_times.as_ref()?;
    let anchor = times.anchor.as_ref()?;
    Some((&anchor.name, times.standing.ratio(&anchor.standing)))
}

/// Returns the ratio of the mean time of some records to the time of the anchor (work that is timed for
/// comparison). Returns `None` if the first record has no anchor, or if a record has no relative times. The
/// records must have been measured together.
pub(crate) fn anchored_mean(records: &[&Record]) -> Option<Relative> {
    let anchor = records.first()?.relative_times.as_ref()?.anchor.as_ref()?;
    Some(mean(records)?.relative_to(&anchor.standing))
}

/// Returns the ratio of the mean time of some records to the mean time of other records (`reference`); `None` if a
/// record has no relative times. All records must have been measured together.
pub(crate) fn mean_relative_to(records: &[&Record], reference: &[&Record]) -> Option<Relative> {
    Some(mean(records)?.relative_to(&mean(reference)?))
}

/// Returns the ratio of the mean time of `records` to the mean time of `earlier`. Like [`ratio_apart`],
/// treats the two sets of records as measured apart. The records of each set must have been measured
/// together. Returns `None` if a record has no relative times.
pub(crate) fn mean_relative_to_earlier(records: &[&Record], earlier: &[&Record]) -> Option<Relative> {
    Some(mean(records)?.relative_to_earlier(&mean(earlier)?))
}

/// Returns the ratio of the mean time of `records` to the mean time of `others`; `None` if a record has no
/// relative times. All records must have been measured together.
pub(crate) fn ratio_of_means(records: &[&Record], others: &[&Record]) -> Option<Interval> {
    Some(mean(records)?.ratio(&mean(others)?))
}

/// Returns the ratio of the times of two passes of a record's frames, with its interval. `ratios` contains
/// the launch of each sample, and the sample's ratio of the two times. A pass is treated like a point. From
/// run to run, the time of a pass changes by a factor of its own and by a factor that all points share. In
/// the ratio of two passes, the shared factor cancels. Returns `None` if the record has too few samples.
pub(crate) fn ratio_of_passes(record: &Record, ratios: &[(u32, f64)]) -> Option<Interval> {
    let sample = |(launch, ratio): &(u32, f64)| PairedSample { point: 0, launch: *launch, ms: *ratio };
    let samples: Vec<PairedSample> = ratios.iter().map(sample).collect();
    let of_both = BetweenRuns { shared: 0.0, own: between_runs(record).own * 2.0_f64.sqrt() };
    Paired::of(&samples, 1).over_runs(vec![of_both]).median_ms(0)
}

fn mean(records: &[&Record]) -> Option<Standing> {
    let standings: Option<Vec<&Standing>> =
        records.iter().map(|record| Some(&record.relative_times.as_ref()?.standing)).collect();
    Standing::mean(&standings?)
}

#[cfg(test)]
mod tests {
    use super::super::point_times::interval;
    use super::super::summary::tests::{few, judged, measured};
    use super::super::together::tests::in_two_launches;
    use super::*;

    #[test]
    fn what_slows_all_is_in_the_interval_and_not_in_the_ratio() {
        let records = judged([in_two_launches("naive", 10.0, 0.5), in_two_launches("wide", 5.0, 0.5)]);
        let ratio = ratio(&records[0], &records[1]).expect("enough samples");
        let only_runs = 1.96 * BetweenRuns::ON_OTHER_DEVICES.own * 2.0_f64.sqrt();
        assert!((ratio.high / ratio.low - (2.0 * only_runs).exp()).abs() < 1e-5, "{ratio:?}");
        let [low, high] = interval(&records[0]).expect("enough samples");
        assert!(low < 5.0 && high > 20.0, "{low} {high}");
    }

    #[test]
    fn a_ratio_of_two_kinds_of_devices_has_the_differences_between_runs_of_both() {
        let on_cpu = Record { threads: Some(2), ..in_two_launches("naive", 10.0, 0.0) };
        let records = judged([on_cpu, in_two_launches("wide", 5.0, 0.0)]);
        let variance = |of: BetweenRuns| of.shared.powi(2) + of.own.powi(2);
        let both = variance(BetweenRuns::ON_PROCESSORS) + variance(BetweenRuns::ON_OTHER_DEVICES);
        for [one, other] in [[0, 1], [1, 0]] {
            let ratio = ratio(&records[one], &records[other]).expect("enough samples");
            assert!(((ratio.high / ratio.low).ln() - 2.0 * 1.96 * both.sqrt()).abs() < 1e-4, "{ratio:?}");
        }
    }

    #[test]
    fn what_was_measured_apart_is_not_paired() {
        let mut records = judged([in_two_launches("naive", 10.0, 0.1), in_two_launches("wide", 5.0, 0.1)]);
        let paired = ratio(&records[0], &records[1]).expect("enough samples");
        records[1].sample_launches.iter_mut().for_each(|launch| *launch += 7);
        let records = judged(records);
        let apart = ratio(&records[0], &records[1]).expect("enough samples");
        assert!(apart.high / apart.low > 1.4 * paired.high / paired.low, "{apart:?} {paired:?}");
    }

    #[test]
    fn records_without_enough_samples_were_measured_with_no_other() {
        let records = judged([measured("gpu", "naive", 8, 10.0), few("gpu", "wide", 1, 5.0, 2)]);
        assert!(are_together(&records[0], &records[0]));
        assert!(!are_together(&records[0], &records[1]) && !are_together(&records[1], &records[1]));
    }
}
