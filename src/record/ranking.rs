//! Ranks records by their times, and computes the smallest difference at which two records do not tie.

use super::point_times::{interval, median};
use super::ratios::ratio;
use super::relative_times::RelativeTimes;
use super::together::{between_runs, has_time, in_order};
use super::types::Record;
use crate::measure::{BetweenRuns, Paired, PairedSample, Ranking, median_of};
use std::collections::HashMap;

/// A point ties with the fastest point, unless the samples show that the point takes longer by more than this fraction
/// of the fastest point's time.
pub(super) const TIE: f64 = 0.01;

/// Ranks the measured records by their times. The winners are the fastest record and every record that ties
/// with it. A record ties with the fastest record if the samples do not show that it takes more than 1%
/// longer. A record with too few samples, or with times of 0, has no rank.
///
/// Records are ranked by their levels, which are logarithms of times ([`RelativeTimes::level`]). Records
/// whose levels can be compared form a family ([`RelativeTimes::family`]). docs/methodology.md calls a family
/// of records a set of comparable points; a kernel family is something else. The ratio of the times of two
/// records of different families (sets of comparable records) is the ratio of the records' medians (see
/// [`ratio`]). Therefore, if there are several families of records, a constant is added to all levels of each
/// family. The mean of the family's levels then equals the mean of the logarithms of the family's medians.
pub(crate) fn ranking<'a>(records: impl IntoIterator<Item = &'a Record>) -> Ranking<&'a Record> {
    let measured: Vec<&Record> = records.into_iter().filter(|record| median(record).is_some()).collect();
    let mut families: HashMap<String, Vec<f64>> = HashMap::new();
    for times in measured.iter().filter_map(|record| record.relative_times.as_ref()) {
        families.entry(times.family()).or_default().push(times.median_ms.middle.ln() - times.level());
    }
    let mean_of = |all: &Vec<f64>| all.iter().sum::<f64>() / all.len() as f64;
    let shifts: HashMap<&str, f64> =
        families.iter().map(|(family, all)| (family.as_str(), mean_of(all))).collect();
    let is_alone = shifts.len() < 2;
    let shift = |times: &RelativeTimes| {
        if is_alone { Some(0.0) } else { shifts.get(times.family().as_str()).copied() }
    };
    let level = |times: &RelativeTimes| Some(times.level() + shift(times)?);
    let levels = measured.into_iter().map(|record| (record, record.relative_times.as_ref().and_then(level)));
    let ties = |record: &Record, best: &Record| {
        std::ptr::eq(record, best) || ratio(record, best).is_some_and(|ratio| ratio.low <= 1.0 + TIE)
    };
    Ranking::by(levels, ties)
}

/// Returns true if a point without a rank (with too few samples, or with a time of 0) may be faster than the fastest
/// ranked point. This is so if the median of the point without a rank is not above the upper end of the ranked
/// point's 95% interval.
pub(crate) fn may_be_faster(ranking: &Ranking<&Record>) -> bool {
    let best = ranking.winners.first().and_then(|best| interval(best));
    best.is_some_and(|[_, high]| {
        ranking.unranked.iter().any(|record| median(record).is_some_and(|ms| ms <= high))
    })
}

/// Returns the smallest difference, as a fraction, that can be shown between the times of two records whose
/// samples vary by a typical amount. The smallest difference is computed for each set of records that were
/// measured together. The sets of records may have different smallest differences, so the function returns
/// the least and the greatest of them. The function returns `None` if the smallest difference is unknown for
/// every set.
pub(crate) fn resolution<'a>(records: impl IntoIterator<Item = &'a Record>) -> Option<[f64; 2]> {
    let own = |record: &Record| record.relative_times.as_ref().and_then(|times| times.standing.resolution());
    let parts = records.into_iter().filter_map(own).map(beyond_a_tie);
    parts.fold(None, |range: Option<[f64; 2]>, part| {
        let [low, high] = range.unwrap_or([part; 2]);
        Some([low.min(part), high.max(part)])
    })
}

/// Returns the smallest difference between two points, as a fraction, at which the samples can show that the
/// points do not tie. Two points tie unless the samples show that one of the points takes more than 1%
/// longer. `part` is the smallest difference, as a fraction, that the samples can distinguish from equal
/// times.
fn beyond_a_tie(part: f64) -> f64 {
    (1.0 + part) * (1.0 + TIE) - 1.0
}

/// Returns the smallest difference between two records of `device` that a single launch can show, as a
/// fraction. For each launch, this difference is computed as in [`resolution`], from all records that were
/// measured in the launch, including records of other devices. The function returns the median of the
/// differences of those launches in which at least two records of `device` have enough samples; `None` without
/// such launches. Records without a time, or with a sample of 0, are left out. Records with equal launch
/// numbers must have been measured together.
pub(crate) fn resolution_within(records: &[Record], device: &str) -> Option<f64> {
    let timed = records.iter().filter(|record| has_time(record));
    // `Paired::resolution` takes the differences between runs from the first record, so records of `device` come
    // first.
    let (own, others): (Vec<&Record>, Vec<&Record>) = timed.partition(|record| record.device == device);
    let all = [&own[..], &others].concat();
    let are_kernels: Vec<bool> = all.iter().map(|record| !record.is_baseline()).collect();
    let between: Vec<BetweenRuns> = all.iter().map(|record| between_runs(record)).collect();
    let samples = in_order(all.iter().copied(), &[]);
    let launches = samples.chunk_by(|one, other| one.launch == other.launch);
    let of = |launch: &[PairedSample]| {
        let paired = Paired::with_anchors(launch, &are_kernels, &[]).over_runs(between.clone());
        let compared = (0..own.len()).filter(|point| paired.standing(*point).is_some()).count();
        paired.resolution().filter(|_| compared > 1).map(beyond_a_tie)
    };
    median_of(&launches.filter_map(of).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{few, judged, measured, sampled};
    use super::super::together::tests::in_two_launches;
    use super::*;

    #[test]
    fn a_hundredth_is_a_tie_and_few_samples_have_no_rank() {
        let records = judged([
            measured("gpu", "naive", 8, 10.0),
            measured("gpu", "wide", 1, 10.09),
            // The samples show that this point takes at least 0.4% longer than the fastest point, but not
            // that it takes at least 1% longer.
            measured("gpu", "wide", 4, 10.15),
            measured("gpu", "wide", 2, 10.3),
            few("gpu", "naive", 4, 1.0, 4),
        ]);
        let ranking = ranking(&records);
        let names = |of: &[&Record]| of.iter().map(|record| record.samples_ms[0]).collect::<Vec<_>>();
        assert_eq!(
            (names(&ranking.winners), names(&ranking.unranked)),
            (vec![10.0, 10.09, 10.15], vec![1.0])
        );
    }

    /// The samples of two sessions cannot be paired, so the ratio of their points is the ratio of two medians. By
    /// the means of their three launches, `naive` takes longer than `wide`. By the medians of all samples,
    /// `naive` takes less time than `wide`.
    #[test]
    fn points_of_several_sessions_are_ranked_by_the_medians_of_which_their_ratios_are_computed() {
        let session = |name: &str, first_launch: u32, ms: [f64; 3]| {
            sampled(name, (0..15).map(|index| (first_launch + index / 5, ms[index as usize / 5])))
        };
        let records = judged([session("wide", 0, [1.2; 3]), session("naive", 3, [1.0, 1.0, 4.0])]);
        let ranked = ranking(&records).ranked;
        assert_eq!(ranked[0].name, "naive");
        let ratios = ranked.iter().map(|record| ratio(record, ranked[0]).expect("enough samples").middle);
        assert!(ratios.clone().all(|ratio| ratio >= 1.0), "{:?}", ratios.collect::<Vec<_>>());
        // Samples of the same rounds can be paired, so points of the same rounds are ranked by the mean over
        // their launches.
        let same = [session("wide", 0, [1.2; 3]), session("naive", 0, [1.0, 1.0, 4.0])];
        assert_eq!(ranking(&judged(same.clone())).ranked[0].name, "wide");
        // A third point, which another session measured, does not change the order of `wide` and `naive`.
        let records = judged([&same[..], &[session("tile", 3, [5.0; 3])]].concat());
        let ranked = ranking(&records).ranked;
        let names: Vec<_> = ranked.iter().map(|record| record.name.as_str()).collect();
        assert_eq!(names, ["wide", "naive", "tile"]);
    }

    #[test]
    fn a_tie_is_decided_by_the_intervals_end() {
        // In one launch, `wide` is as fast as `naive`; in the other launch, `wide` is 6% slower. The mean
        // difference is 3%, but this mean is uncertain.
        let wavers = sampled("wide", (0..10).map(|index| (index / 5, if index < 5 { 10.0 } else { 10.6 })));
        let records = judged([in_two_launches("naive", 10.0, 0.0), wavers]);
        assert!(ratio(&records[1], &records[0]).expect("enough samples").middle > 1.02);
        assert_eq!(ranking(&records).winners.len(), 2);
    }

    #[test]
    fn what_can_be_told_apart_is_beyond_a_tie() {
        let records = judged([in_two_launches("naive", 10.0, 0.0), in_two_launches("wide", 5.0, 0.0)]);
        let [low, high] = resolution(&records).expect("two points");
        let only_runs = 1.96 * BetweenRuns::ON_OTHER_DEVICES.own * 2.0_f64.sqrt();
        let expected = only_runs.exp() * 1.01 - 1.0;
        assert!((low - expected).abs() < 1e-5 && (high - expected).abs() < 1e-5, "{low} {high}");
    }
}
