//! Computes the change of a point's time from one run to another. A machine's speed differs from run to run.
//! Each time is therefore first divided by a reference time from the same rounds: the time of the anchor (a
//! fixed kernel), or the mean time of baselines or of other kernels. If the two runs used different devices,
//! times are not divided by the times of other kernels, because this would cancel the factor by which one
//! device is faster than the other.

use super::pair::{Against, Both};
use crate::measure::Interval;
use crate::record::{
    Record, anchored, are_together, median, ratio, ratio_apart, ratio_of_means, rounds_of, unshared_delay,
};
use std::collections::{HashMap, HashSet};

/// Returns the ratio of the second time of `pair` to the first time, and the kind of reference time by which
/// both times are divided. The reference is the time of the device's anchor, if both runs measured the same
/// anchor. Otherwise, the reference is the mean time of the point's `references`. If the two runs used different
/// devices and have no reference in common, the times themselves are compared. Returns `None` if both runs used
/// the same device and the point has no reference, or if a record has too few samples or times of 0.
pub(super) fn change(pair: Both<'_>, references: &References<'_>) -> Option<(Interval, Against)> {
    if let Some(change) = against_anchor(pair) {
        return Some((change, Against::Anchor));
    }
    if references.are_bare(pair) {
        return bare(pair);
    }
    let (references, against) = references.of(&[pair])?;
    let (first, second): (Vec<&Record>, Vec<&Record>) = references.into_iter().unzip();
    let (before, after) = pair;
    Some((ratio_of_means(&[after], &second)?.over(ratio_of_means(&[before], &first)?), against))
}

/// The references of some points, and the kind of these references. References are points by whose mean time
/// the times of other points are divided.
type Found<'a> = (Vec<Both<'a>>, Against);

/// The names of the devices of a pair of records.
type Devices<'a> = [&'a str; 2];

/// The references of all compared points. Which points are the references of a point depends only on the rounds
/// in which the two runs measured this point and, if the references are kernels, on the point's device. The key
/// of the map identifies these rounds (see [`rounds`]). In a value of the map, `Some` contains the names of the
/// device whose points have the references, and `None` means that all points of the rounds have the references.
pub(super) struct References<'a>(HashMap<[blake3::Hash; 2], Vec<(Option<Devices<'a>>, Found<'a>)>>);

impl<'a> References<'a> {
    /// Finds the references (points by whose mean time other times are divided) among `all`. `all` contains
    /// the compared points, and the control points that blocks borrowed. A block borrows a control point if
    /// the block measures the control point although the point belongs to another block.
    pub fn among(all: &[Both<'a>]) -> Self {
        let other_devices = other_devices(all);
        let mut groups: HashMap<[blake3::Hash; 2], Vec<Both<'a>>> = HashMap::new();
        for &pair in all {
            if let Some(rounds) = rounds(pair) {
                groups.entry(rounds).or_default().push(pair);
            }
        }
        let found = |beside: Vec<Both<'a>>| among_group(&beside, &other_devices);
        Self(groups.into_iter().map(|(rounds, beside)| (rounds, found(beside))).collect())
    }

    /// Returns the references of `points`, and the kind of these references. The references are other points of
    /// the same rounds, by whose mean time the times of `points` are divided. The points in `points` must have
    /// been measured together. Returns `None` if no other point can be a reference.
    pub fn of(&self, points: &[Both<'_>]) -> Option<(Vec<Both<'a>>, Against)> {
        let (references, against) = self.found(*points.first()?)?;
        let is_own = |one: &Record| points.iter().any(|(own, _)| std::ptr::eq(one, *own));
        let others: Vec<Both<'a>> = references.iter().filter(|(one, _)| !is_own(one)).copied().collect();
        (!others.is_empty()).then_some((others, *against))
    }

    /// Returns the references of a point, which may include the point itself. Kernels are references only of
    /// kernels on the same device: the speeds of two devices, or of a device and the host, may change by
    /// different factors.
    fn found(&self, pair: Both<'_>) -> Option<&Found<'a>> {
        let is_own = |device: Devices<'_>| device == devices(&pair);
        let of_rounds = self.0.get(&rounds(pair)?)?;
        of_rounds.iter().find(|(device, _)| device.is_none_or(is_own)).map(|(_, found)| found)
    }

    /// Returns true if the point's times are compared without a reference. This is so if the two runs have
    /// no baseline in common, and measured every kernel of the point's rounds on different devices.
    fn are_bare(&self, pair: Both<'_>) -> bool {
        self.found(pair).is_some_and(|(_, against)| *against == Against::BareTimes)
    }
}

/// Returns the names of the devices of a pair of records.
fn devices<'a>((before, after): &Both<'a>) -> Devices<'a> {
    [&before.device, &after.device]
}

/// Returns those pairs of devices' names in `all` that name two different devices. Two names belong to the
/// same device if the names are equal, or if records with equal keys show that the device only has another
/// name in the second run.
fn other_devices<'a>(all: &[Both<'a>]) -> HashSet<Devices<'a>> {
    let renamed: HashSet<_> =
        all.iter().filter(|(before, after)| before.key == after.key).map(devices).collect();
    let differ = |names: &[&str; 2]| names[0] != names[1] && !renamed.contains(names);
    all.iter().map(devices).filter(differ).collect()
}

/// Returns two hashes, which identify the rounds in which the first and the second run measured a point;
/// `None` if either record has no relative times.
fn rounds((before, after): Both<'_>) -> Option<[blake3::Hash; 2]> {
    Some([rounds_of(before)?, rounds_of(after)?])
}

/// Returns the references among the points `beside`, which were measured in the same rounds. (Other times are
/// divided by the mean time of the references.) Each list of references is returned with the names of the
/// device whose points have these references, or with `None` if all points have them. The baselines that have
/// the same key in both runs are the references of all points. Without such baselines, the references are
/// kernels (see [`of_each_device`]). If the two devices of every kernel are a pair of `other_devices`, there
/// are no references, because dividing by the times of kernels would cancel the factor by which one device is
/// faster.
fn among_group<'a>(
    beside: &[Both<'a>],
    other_devices: &HashSet<Devices<'a>>,
) -> Vec<(Option<Devices<'a>>, Found<'a>)> {
    let untouched = |(one, other): &&Both<'_>| one.is_baseline() && one.key == other.key;
    let baselines: Vec<Both<'a>> = beside.iter().filter(untouched).copied().collect();
    let kernels: Vec<Both<'a>> = beside.iter().filter(|(one, _)| !one.is_baseline()).copied().collect();
    let differ = |pair: &Both<'_>| other_devices.contains(&devices(pair));
    match baselines.is_empty() {
        false => vec![(None, (baselines, Against::Baselines))],
        true if !other_devices.is_empty() && kernels.iter().all(differ) => {
            vec![(None, (Vec::new(), Against::BareTimes))]
        }
        true => of_each_device(&kernels),
    }
}

/// Returns, for each device, the half of the device's `kernels` whose changes are closest to the median change (see
/// [`alike`]). If one half of these kernels has clearly larger changes than the other half, returns no kernels of the
/// device. Leaves out devices with fewer than three kernels: if the times of two kernels change by different factors,
/// nobody can know which of the two kernels became faster or slower.
fn of_each_device<'a>(kernels: &[Both<'a>]) -> Vec<(Option<Devices<'a>>, Found<'a>)> {
    let mut of_devices: HashMap<Devices<'a>, Vec<Both<'a>>> = HashMap::new();
    for &pair in kernels {
        of_devices.entry(devices(&pair)).or_default().push(pair);
    }
    let several = of_devices.into_iter().filter(|(_, kernels)| kernels.len() >= 3);
    several.map(|(device, kernels)| (Some(device), (alike(kernels), Against::PointsInCommon))).collect()
}

/// Compares the two times of a point, each divided by the time of the anchor (fixed work that shows the
/// machine's speed) in the same run. The interval of the change is wider if other programs may have delayed
/// the point and the anchor by different factors. Returns `None` if the two runs do not have the same anchor.
fn against_anchor(pair: Both<'_>) -> Option<Interval> {
    let ((first, before), (second, after)) = (anchored(pair.0)?, anchored(pair.1)?);
    let change = (first == second).then(|| after.over(before))?;
    Some(change.over_up_to(unshared_delay(pair.0, pair.1)))
}

/// The changes of two points are clearly apart if the larger change, divided by the smaller change, exceeds 1 by more
/// than this fraction in the whole 95% interval.
const APART: f64 = 0.02;

/// Returns the half of the points in `beside` whose changes are closest to the median change. `beside` must
/// not be empty. If a change of code made a minority of points slower, these points are not in the returned
/// half. Returns no points if the number of points is even, and one half has clearly larger changes than the other
/// half: nobody can know whether one half became slower, or the other half faster.
fn alike(mut beside: Vec<Both<'_>>) -> Vec<Both<'_>> {
    let own = |(before, after): &Both<'_>| match (median(before), median(after)) {
        (Some(before), Some(after)) => (after / before).ln(),
        _ => 0.0,
    };
    beside.sort_by(|a, b| own(a).total_cmp(&own(b)));
    // If the number of points is odd, `below` and `above` are both the point in the middle.
    let (below, above) = (beside[(beside.len() - 1) / 2], beside[beside.len() / 2]);
    if are_apart(below, above) {
        return Vec::new();
    }
    let middle = (own(&below) + own(&above)) / 2.0;
    beside.sort_by(|a, b| (own(a) - middle).abs().total_cmp(&(own(b) - middle).abs()));
    beside.truncate(beside.len().div_ceil(2));
    beside
}

/// Returns true if the change of the point `above` is clearly larger than the change of the point `below` (see
/// [`APART`]). Both points were measured in the same rounds of both runs.
fn are_apart(below: Both<'_>, above: Both<'_>) -> bool {
    let of_runs = ratio(above.1, below.1).zip(ratio(above.0, below.0));
    of_runs.is_some_and(|(after, before)| after.over(before).low > 1.0 + APART)
}

/// Returns the ratio of the measured times without a reference, even if the runs have a control point in common. The
/// ratio includes every difference between the runs, such as the machine's speed. Returns `None` if a record has too
/// few samples or times of 0.
pub fn bare((before, after): Both<'_>) -> Option<(Interval, Against)> {
    Some((ratio_apart(after, before)?, Against::BareTimes))
}

/// Compares the two times that a point has in a run of two folders of kernels: one time with the kernels of the
/// first folder, and one with those of the second folder. `raycl run --resume` may have measured the point with the
/// kernels of one folder in an earlier session. If the point's two records were measured in different sessions,
/// their samples are not close in time, and the times are compared like times of two runs. Returns `None` if a
/// record has too few samples or times of 0.
pub fn of_kernels((before, after): Both<'_>) -> Option<(Interval, Against)> {
    if !are_together(before, after) {
        return bare((before, after));
    }
    Some((ratio(after, before)?, Against::SameRounds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{judged, measured};

    #[test]
    fn the_half_with_the_changes_closest_to_the_median_is_alike() {
        let before = measured("gpu", "naive", 8, 1.0);
        let alike_of = |times: &[f64]| -> Vec<f64> {
            let after: Vec<Record> = times.iter().map(|ms| measured("gpu", "naive", 8, *ms)).collect();
            let pairs = after.iter().map(|after| (&before, after)).collect();
            let mut medians: Vec<f64> = alike(pairs).iter().filter_map(|(_, after)| median(after)).collect();
            medians.sort_by(f64::total_cmp);
            medians
        };
        assert_eq!(alike_of(&[2.0, 1.01, 0.4, 1.0, 1.02]), [1.0, 1.01, 1.02]);
        assert_eq!(alike_of(&[0.5, 1.0, 4.0]), [0.5, 1.0]);
    }

    /// Returns the records of two groups with different launches. Each group has a kernel and a baseline.
    /// `kernels` and `baselines` contain the time of the kernel and of the baseline in each group.
    fn two_groups([kernels, baselines]: [[f64; 2]; 2]) -> Vec<Record> {
        let of = |group: u32, record: Record| {
            let sample_launches = record.sample_launches.iter().map(|launch| launch + 2 * group).collect();
            Record { sample_launches, key: format!("{} {group}", record.key), ..record }
        };
        let group = |number: usize| {
            let kernel = measured("gpu", "naive", 8, kernels[number]);
            let baseline = measured("host", "serial", 8, baselines[number]);
            [kernel, baseline].map(|record| of(number as u32, record))
        };
        judged([group(0), group(1)].concat())
    }

    fn middle(change: Option<(Interval, Against)>) -> Option<(f64, Against)> {
        change.map(|(change, against)| ((100.0 * change.middle).round() / 100.0, against))
    }

    #[test]
    fn a_kernel_is_compared_with_the_baselines_of_its_own_group() {
        let before = two_groups([[1.0, 10.0], [100.0, 300.0]]);
        // In the second run, the machine was half as fast for the first group. For the second group of
        // points, the machine's speed was the same in both runs, but the kernel was half as fast in the
        // second run.
        let after = two_groups([[2.0, 20.0], [200.0, 300.0]]);
        let all: Vec<Both<'_>> = before.iter().zip(&after).collect();
        let references = References::among(&all);
        let [first, _, second, _] = all[..] else { panic!("{} pairs", all.len()) };
        assert_eq!(middle(change(first, &references)), Some((1.0, Against::Baselines)));
        assert_eq!(middle(change(second, &references)), Some((2.0, Against::Baselines)));
        assert_eq!(middle(bare(first)), Some((2.0, Against::BareTimes)));
    }

    #[test]
    fn a_group_has_the_references_that_were_measured_in_its_own_rounds() {
        let records = two_groups([[1.0, 10.0], [100.0, 300.0]]);
        let all: Vec<Both<'_>> = records.iter().map(|record| (record, record)).collect();
        let references = References::among(&all);
        assert_eq!(references.0.len(), 2, "they are found once for each group");
        for (kernel, baseline) in [(0, 1), (2, 3)] {
            let (actual, against) = references.of(&all[kernel..=kernel]).expect("a baseline");
            assert_eq!((actual, against), (vec![all[baseline]], Against::Baselines));
            assert_eq!(references.of(&all[baseline..=baseline]), None, "no reference of itself");
        }
    }

    #[test]
    fn a_point_is_no_reference_of_itself() {
        let run = |records: &[(&str, &str, f64)]| {
            judged(
                records.iter().map(|(device, name, ms)| measured(device, name, 8, *ms)).collect::<Vec<_>>(),
            )
        };
        let changes = |before: &[(&str, &str, f64)], after: &[(&str, &str, f64)]| -> Vec<_> {
            let (before, after) = (run(before), run(after));
            let all: Vec<Both<'_>> = before.iter().zip(&after).collect();
            let references = References::among(&all);
            all.iter().map(|pair| middle(change(*pair, &references))).collect()
        };
        let [naive, wide, bvh] = ["naive", "wide", "bvh"].map(|name| ("gpu", name, 1.0));
        let slow = ("gpu", "naive", 1.5);
        // With only two points, raycl cannot know which of the two points became slower or faster.
        assert_eq!(changes(&[naive, wide], &[slow, wide]), [None, None]);
        let in_common = |factor| Some((factor, Against::PointsInCommon));
        let of_three = changes(&[naive, wide, bvh], &[slow, wide, bvh]);
        assert_eq!(of_three, [in_common(1.5), in_common(1.0), in_common(1.0)]);
        // A baseline's references are all other baselines.
        let [serial, parallel] = ["serial", "parallel"].map(|name| ("host", name, 10.0));
        let later = [slow, wide, ("host", "serial", 20.0)];
        let against = |factor| Some((factor, Against::Baselines));
        assert_eq!(changes(&[naive, wide, serial], &later), [against(0.75), against(0.5), None]);
        let both = changes(&[naive, serial, parallel], &[naive, ("host", "serial", 20.0), parallel]);
        assert_eq!(both[1..], [against(2.0), against(0.5)]);
    }

    /// If half of the kernels became slower, nobody knows whether the other half became faster instead.
    #[test]
    fn two_halves_that_changed_by_different_factors_are_no_references_of_each_other() {
        let names = ["naive", "wide", "bvh", "tile"];
        let run =
            |ms: [f64; 4]| judged([0, 1, 2, 3].map(|index| measured("gpu", names[index], 8, ms[index])));
        let changes = |factors: [f64; 4]| -> Vec<_> {
            let (before, after) = (run([1.0; 4]), run(factors));
            let all: Vec<Both<'_>> = before.iter().zip(&after).collect();
            let references = References::among(&all);
            all.iter().map(|pair| middle(change(*pair, &references))).collect()
        };
        assert_eq!(changes([1.0, 1.0, 1.5, 1.5]), [None; 4]);
        assert_eq!(changes([0.5, 1.0, 0.5, 1.0]), [None; 4]);
        let [same, slower] = [1.0, 1.5].map(|factor| Some((factor, Against::PointsInCommon)));
        assert_eq!(changes([1.5, 1.0, 1.0, 1.0]), [slower, same, same, same]);
        // A difference of 1% may come from differences between the runs.
        assert!(changes([1.0, 1.0, 1.01, 1.01]).iter().all(Option::is_some));
    }

    /// In this test, the first device became twice as fast, and its kernels are the majority.
    #[test]
    fn kernels_are_relative_to_kernels_of_their_own_device() {
        let run = |first: f64, kernels_of_second: usize| {
            let kernels = ["naive", "wide", "bvh", "tile"];
            let all = kernels.map(|name| measured("gpu", name, 8, first));
            let others = kernels.map(|name| measured("cpu", name, 8, 3.0));
            judged([&all[..], &others[..kernels_of_second]].concat())
        };
        let changes = |kernels_of_second: usize| -> Vec<_> {
            let [before, after] = [1.0, 0.5].map(|first| run(first, kernels_of_second));
            let all: Vec<Both<'_>> = before.iter().zip(&after).collect();
            let references = References::among(&all);
            all.iter().map(|pair| middle(change(*pair, &references))).collect()
        };
        let unchanged = Some((1.0, Against::PointsInCommon));
        assert_eq!(changes(3), [unchanged; 7]);
        assert_eq!(changes(2), [[unchanged; 4].to_vec(), vec![None; 2]].concat());
    }

    /// In this test, the two runs have a control point in common, whose time changed by the factor 10 from
    /// run to run.
    #[test]
    fn plain_times_are_not_relative_to_a_control_point() {
        let run = |control: f64, naive: f64| {
            let records = [("wide", control), ("naive", naive)].map(|(name, ms)| Record {
                control: Some("control".into()),
                key: if name == "wide" { "control" } else { name }.into(),
                ..measured("gpu", name, 8, ms)
            });
            judged(records)
        };
        let (before, after) = (run(1.0, 3.0), run(10.0, 6.0));
        assert_eq!(middle(bare((&before[1], &after[1]))), Some((2.0, Against::BareTimes)));
    }

    #[test]
    fn a_baseline_that_one_of_the_runs_measured_in_another_group_is_none() {
        let kernels = |factor: f64| ["naive", "wide", "bvh"].map(|name| measured("gpu", name, 8, factor));
        let baseline = |ms: f64, first_launch: u32| {
            let record = measured("host", "serial", 8, ms);
            let sample_launches = record.sample_launches.iter().map(|launch| launch + first_launch).collect();
            Record { sample_launches, ..record }
        };
        let run = |factor: f64, first_launch: u32| {
            judged([&kernels(factor)[..], &[baseline(100.0, first_launch)]].concat())
        };
        let against = |before: &[Record], after: &[Record]| {
            let all: Vec<Both<'_>> = before.iter().zip(after).collect();
            middle(change(all[0], &References::among(&all)))
        };
        let ([together, apart], [slow, slow_apart]) =
            ([run(1.0, 0), run(1.0, 2)], [run(3.0, 0), run(3.0, 2)]);
        assert_eq!(against(&together, &slow), Some((3.0, Against::Baselines)));
        for (before, after) in [(&together, &slow_apart), (&apart, &slow), (&apart, &slow_apart)] {
            assert_eq!(against(before, after), Some((1.0, Against::PointsInCommon)));
        }
    }
}
