//! Compares records that were measured together. All outputs of raycl, such as the report, the summaries and `raycl
//! compare`, use the rule in this file to decide whether two times differ; docs/methodology.md explains the rule.

use super::anchors::{AnchorSample, AnchorTimes, AnchorUtilization};
use super::control::find_controls;
use super::numbers::{by, significant};
use super::relative_times::{MeasuredAnchor, RelativeTimes};
use super::types::{HOST, Outcome, Record};
use crate::device::DeviceKind;
use crate::measure::{
    BetweenRuns, Interval, MIN_SAMPLES, Paired, PairedSample, Ranking, Relative, Standing, median_of,
};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// A point ties with the fastest point unless the samples show that the point takes longer by more than this
/// fraction.
const TIE: f64 = 0.01;
/// The times of points are noisy if the points must differ by more than this fraction before the samples show
/// a difference. The smallest difference that can be shown between noisy points is stated as a factor and not
/// as a percentage.
const NOISY: f64 = 1.0;
/// The largest factor that is stated for noisy times. A larger factor would mean nothing, since factors are
/// computed from the spread of only a few launches.
const LARGEST_FACTOR: f64 = 100.0;
/// The properties of a point on which the smallest difference that can be shown between two points may depend.
const PROPERTIES: [&str; 3] = ["scene", "image size", "device"];

/// Computes the relative times of each measured record: its times relative to the times of the records that
/// were measured together. Records of the same launches were measured together. Records of earlier versions
/// have no launch numbers. These records are treated as measured together if their scene, image size and
/// device are equal.
pub fn judge(records: &mut [Record]) {
    write_all_relative_times(records, &[]);
}

/// Computes each record's relative times like [`judge`], and also those of the anchors. If the records already have
/// relative times from `judge`, the intervals of their medians stay as they are, since every output of raycl must show
/// the same intervals.
pub fn judge_with_anchors(records: &mut [Record], anchors: &[AnchorSample]) {
    let of_judge = |record: &Record| Some(record.relative_times.as_ref()?.median_ms);
    let medians: Vec<Option<Interval>> = records.iter().map(of_judge).collect();
    write_all_relative_times(records, anchors);
    for (record, median) in records.iter_mut().zip(medians) {
        if let (Some(times), Some(median)) = (&mut record.relative_times, median) {
            times.median_ms = median;
        }
    }
}

/// Computes each record's relative times, and those of the anchors. A record with times of 0 among its
/// samples has no relative times, since a time of 0 only says that the time is below the timer's resolution.
fn write_all_relative_times(records: &mut [Record], anchors: &[AnchorSample]) {
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, record) in records.iter().enumerate().filter(|(_, record)| has_time(record)) {
        groups.entry(measured_with(record)).or_default().push(index);
    }
    let mut machines: BTreeMap<_, Vec<Table>> = BTreeMap::new();
    for indices in groups.into_values() {
        let table = Table::of(indices, records, anchors);
        machines.entry(table.machine(records)).or_default().push(table);
    }
    for tables in machines.into_values() {
        let mut paired: Vec<Paired> = tables.iter().map(|table| table.paired.clone()).collect();
        Paired::borrow_from_each_other(&mut paired);
        for (table, paired) in tables.iter().zip(&paired) {
            table.write_relative_times(paired, records);
        }
    }
    find_controls(records);
}

/// Returns true if a record was measured and none of its times is 0.
fn has_time(record: &Record) -> bool {
    median(record).is_some() && record.samples_ms.iter().all(|ms| *ms > 0.0)
}

/// Records that were measured together, and the anchors that were measured in the same launches.
struct Table {
    /// A hash that identifies these records.
    together: blake3::Hash,
    /// The indices of these records in the list of all records.
    indices: Vec<usize>,
    /// The anchors. In `paired`, the indices of the anchors follow the indices of the records.
    anchors: Vec<Anchor>,
    paired: Paired,
}

/// An anchor that was measured with the records of a table.
struct Anchor {
    name: String,
    device: String,
    utilization: Option<AnchorUtilization>,
}

impl Table {
    fn of(indices: Vec<usize>, records: &[Record], anchors: &[AnchorSample]) -> Self {
        let own = || indices.iter().map(|index| &records[*index]);
        let samples = in_order(own(), &[]);
        let together = name(&samples);
        let launches: HashSet<u32> = samples.iter().map(|sample| sample.launch).collect();
        let mut anchor_times = AnchorTimes::of_launches(&launches, anchors);
        // An anchor with times of 0 cannot be compared. The same is true of a point with times of 0.
        anchor_times.retain(|anchor| anchor.remaining.iter().all(|sample| sample.ms > 0.0));
        let record_of = |anchor: &AnchorTimes<'_>| own().find(|record| record.device == anchor.device);
        let on_processors: Vec<bool> =
            anchor_times.iter().map(|anchor| record_of(anchor).is_some_and(is_on_processors)).collect();
        // Baselines do not show how much the times of kernels vary.
        let are_kernels: Vec<bool> = own().map(|record| !record.is_baseline()).collect();
        let paired = Paired::with_anchors(&in_order(own(), &anchor_times), &are_kernels, &on_processors);
        let of_anchors =
            anchor_times.iter().map(|anchor| record_of(anchor).map(between_runs).unwrap_or_default());
        let paired = paired.over_runs(own().map(between_runs).chain(of_anchors).collect());
        let anchor = |AnchorTimes { name, device, utilization, .. }: &AnchorTimes<'_>| {
            let (name, device) = ((*name).to_owned(), (*device).to_owned());
            Anchor { name, device, utilization: *utilization }
        };
        let anchors = anchor_times.iter().map(anchor).collect();
        Self { together, indices, anchors, paired }
    }

    /// Returns the machine and the devices that measured the records. Only tables with the same machine and
    /// devices show each other how much times differ between launches. If devices of the same model share the
    /// points, all records name the first device, and only `measured_on` tells which device measured a point.
    fn machine(&self, records: &[Record]) -> BTreeSet<(Option<String>, String, Option<String>)> {
        let of = |index: &usize| {
            let Record { host, device, measured_on, .. } = &records[*index];
            (host.clone(), device.clone(), measured_on.clone())
        };
        self.indices.iter().map(of).collect()
    }

    fn write_relative_times(&self, paired: &Paired, records: &mut [Record]) {
        for (point, index) in self.indices.iter().enumerate() {
            let record = &mut records[*index];
            let is_own = |(_, anchor): &(usize, &Anchor)| anchor.device == record.device;
            let anchor = self.anchors.iter().enumerate().find(is_own).and_then(|(at, anchor)| {
                let standing = paired.standing(self.indices.len() + at)?;
                Some(MeasuredAnchor { name: anchor.name.clone(), standing, utilization: anchor.utilization })
            });
            let together = self.together;
            record.relative_times = paired.standing(point).map(|standing| {
                let median_ms = standing.median_ms();
                RelativeTimes { together, standing, median_ms, anchor, control: None }
            });
        }
    }
}

/// Returns by how much times on a record's device may differ from one run to the next.
fn between_runs(record: &Record) -> BetweenRuns {
    if is_on_processors(record) { BetweenRuns::ON_PROCESSORS } else { BetweenRuns::ON_OTHER_DEVICES }
}

/// Returns true if a record's device is a CPU, or the host without OpenCL. Records of earlier versions do not
/// contain the device's kind; if such a record contains a number of threads, the device is a CPU.
fn is_on_processors(record: &Record) -> bool {
    match record.device_kind.as_deref() {
        Some(kind) => kind == DeviceKind::Cpu.name(),
        None => record.device == HOST || record.threads.is_some(),
    }
}

fn measured_with(record: &Record) -> String {
    let mut launches = record.sample_launches.clone();
    launches.dedup();
    match launches.is_empty() {
        true => format!("{:?} {} {:?} {}", record.scene_hash, record.scene, record.image_size, record.device),
        false => format!("{launches:?}"),
    }
}

/// Returns the samples of some records and anchors, sorted by launch and then by time. In a sample, `point`
/// is the record's index. The indices of the anchors follow the indices of the records.
fn in_order<'a>(
    records: impl ExactSizeIterator<Item = &'a Record>,
    anchors: &[AnchorTimes<'_>],
) -> Vec<PairedSample> {
    let (mut samples, count) = (Vec::new(), records.len());
    for (number, anchor) in anchors.iter().enumerate() {
        let point = count + number;
        let of = |sample: &&AnchorSample| {
            (sample.at_ms, PairedSample { point, launch: sample.launch, ms: sample.ms })
        };
        samples.extend(anchor.remaining.iter().map(of));
    }
    for (point, record) in records.enumerate() {
        for (index, ms) in record.samples_ms.iter().enumerate() {
            let launch = record.sample_launches.get(index).copied().unwrap_or(0);
            let at_ms = record.samples_at_ms.get(index).copied().unwrap_or(index as f64);
            samples.push((at_ms, PairedSample { point, launch, ms: *ms }));
        }
    }
    samples.sort_by(|(a, one), (b, other)| one.launch.cmp(&other.launch).then(a.total_cmp(b)));
    samples.into_iter().map(|(_, sample)| sample).collect()
}

/// Returns a hash of the samples. The hash identifies the records that were measured together. Launch numbers
/// cannot identify these records, since two folders may use the same numbers.
fn name(samples: &[PairedSample]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for sample in samples {
        hasher.update(&sample.launch.to_le_bytes());
        hasher.update(&sample.ms.to_le_bytes());
    }
    hasher.finalize()
}

/// Returns the median of a record's samples in milliseconds; `None` if the record's outcome is not "measured".
pub fn median(record: &Record) -> Option<f64> {
    record.median_ms.filter(|_| record.outcome == Outcome::Measured)
}

/// Returns the number of launches in which a record was measured.
pub(crate) fn launches(record: &Record) -> usize {
    let mut numbers = record.sample_launches.clone();
    numbers.dedup();
    numbers.len().max(usize::from(!record.samples_ms.is_empty()))
}

/// Returns the number of samples in the launch that has the fewest samples. Samples with a time of 0 do not count.
pub(crate) fn fewest(record: &Record) -> usize {
    fewest_where(record, |ms| ms > 0.0)
}

/// Counts, in each launch, the samples for which `counts` returns true. Returns the smallest of these counts.
fn fewest_where(record: &Record, counts: impl Fn(f64) -> bool) -> usize {
    // A launch in which no sample counts must have the number 0 in the map, so the map first gets an entry for every
    // launch.
    let mut of_launches: HashMap<u32, usize> =
        record.sample_launches.iter().map(|launch| (*launch, 0)).collect();
    for (launch, ms) in record.sample_launches.iter().zip(&record.samples_ms) {
        *of_launches.entry(*launch).or_default() += usize::from(counts(*ms));
    }
    let all = || record.samples_ms.iter().filter(|ms| counts(**ms)).count();
    of_launches.into_values().min().unwrap_or_else(all)
}

/// Returns true if a measured record has enough samples, but no rank, because some of its times are 0. A time
/// is 0 if a frame takes less than a step of the device's timer.
pub(crate) fn is_below_resolution(record: &Record) -> bool {
    let has_zero = record.samples_ms.iter().any(|ms| *ms <= 0.0);
    median(record).is_some()
        && record.relative_times.is_none()
        && has_zero
        && fewest_where(record, |_| true) >= MIN_SAMPLES
}

/// Returns the time of `slow` divided by the time of `fast`. If the records were measured together, samples
/// that were measured close in time are compared. Otherwise, the ratio is computed from the control point
/// that the records' blocks share. If the blocks share no control point, the ratio is that of
/// [`ratio_apart`]. Returns `None` if either record has too few samples.
pub(crate) fn ratio(slow: &Record, fast: &Record) -> Option<Interval> {
    let (slow, fast) = (slow.relative_times.as_ref()?, fast.relative_times.as_ref()?);
    if slow.together == fast.together {
        return Some(slow.standing.ratio(&fast.standing));
    }
    slow.ratio_by_control(fast).or_else(|| Some(slow.standing.ratio_apart(&fast.standing)))
}

/// Returns the time of `slow` divided by the time of `fast`, from the medians of all samples. Records that
/// were measured together are treated as measured apart. Returns `None` if either record has too few samples.
pub(crate) fn ratio_apart(slow: &Record, fast: &Record) -> Option<Interval> {
    Some(slow.relative_times.as_ref()?.standing.ratio_apart(&fast.relative_times.as_ref()?.standing))
}

/// Returns a hash that is equal for all records that were measured in the same rounds; `None` if the record has no
/// relative times.
pub(crate) fn rounds_of(record: &Record) -> Option<blake3::Hash> {
    Some(record.relative_times.as_ref()?.together)
}

/// Returns true if two records were measured in the same rounds.
pub(crate) fn are_together(one: &Record, other: &Record) -> bool {
    rounds_of(one).zip(rounds_of(other)).is_some_and(|(one, other)| one == other)
}

/// Returns the name of the anchor of the record's device, and the ratio of the record's time to the anchor's
/// time. Returns `None` if the record has no relative times, or if its anchor was not measured or not
/// requested (see [`judge_with_anchors`]).
pub(crate) fn anchored(record: &Record) -> Option<(&str, Interval)> {
    let times = record.relative_times.as_ref()?;
    let anchor = times.anchor.as_ref()?;
    Some((&anchor.name, times.standing.ratio(&anchor.standing)))
}

/// Returns the ratio of the mean time of some records to the anchor's time; `None` if there is no anchor, or if a
/// record has no relative times. The records must have been measured together.
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

/// Returns the ratio of the times of two passes of the same frames of a record. `ratios` has each sample's
/// launch and ratio. A pass is treated like a point. From run to run, the time of a pass changes by two
/// factors: its own factor, and a factor that all points share. The shared factor cancels in the ratio.
/// Returns `None` if there are too few samples.
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

/// Returns the 95% interval of the median; `None` with too few samples.
pub(crate) fn interval(record: &Record) -> Option<[f64; 2]> {
    let interval = record.relative_times.as_ref()?.median_ms;
    Some([interval.low, interval.high])
}

/// Ranks the measured records by their times. The winners are the fastest record and every record that ties
/// with it. A record ties if the samples do not show that the record takes more than 1% longer. A record with
/// too few samples has no rank.
///
/// Records are ranked by their levels, which are logarithms of times ([`RelativeTimes::level`]). Only levels of one
/// family of records can be compared ([`RelativeTimes::family`]). The ratio of two records of different families is the
/// ratio of their medians (see [`ratio`]). The levels of each family are therefore shifted by a constant, so that the
/// mean of the levels equals the mean of the logarithms of the family's medians.
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

/// Returns the smallest difference, as a fraction, that can be shown between two records of typical spread.
/// Each set of records that were measured together has its own value. The function returns the least and the
/// greatest of these values, or `None` if no value is known.
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
/// longer. `part` is the smallest difference, as a fraction, that the samples can show at all.
fn beyond_a_tie(part: f64) -> f64 {
    (1.0 + part) * (1.0 + TIE) - 1.0
}

/// Returns the smallest difference between two of these records that a single launch can show, as a fraction, by the
/// rule of [`resolution`]. The result is the median over launches. Records with equal launch numbers must have been
/// measured together, on one device. Records with times of 0 are left out.
pub(crate) fn resolution_within(records: &[Record]) -> Option<f64> {
    let records: Vec<&Record> = records.iter().filter(|record| has_time(record)).collect();
    let samples = in_order(records.iter().copied(), &[]);
    let between: Vec<BetweenRuns> = records.iter().map(|record| between_runs(record)).collect();
    let launches = samples.chunk_by(|one, other| one.launch == other.launch);
    let of = |launch: &[PairedSample]| {
        Paired::of(launch, records.len()).over_runs(between.clone()).resolution().map(beyond_a_tie)
    };
    median_of(&launches.filter_map(of).collect::<Vec<_>>())
}

/// Returns notes on the certainty of results: which points were measured in a single launch only, and which differences
/// are too small to be detected.
pub(crate) fn how_sure(records: &[Record]) -> Vec<String> {
    let of_one_launch = || records.iter().filter(|record| has_one_launch(record));
    let mut notes = Vec::new();
    if let Some(one) = of_one_launch().next() {
        let measured = records.iter().filter(|record| record.relative_times.is_some()).count();
        let whose = match of_one_launch().count() {
            all if all == measured => "all points".to_owned(),
            some => format!("{some} of {measured} points, such as {} {}", one.scene, by(one.image_size)),
        };
        notes.push(format!(
            "Measured in only one launch of the program: {whose}. The intervals of these points do not include differences between launches; more launches (`launches` in the config's `[timing]`) measure these differences. If a note says that launches were left out, run the experiment again."
        ));
    }
    notes.extend(smallest_difference_note(records));
    notes
}

/// Returns the note on the smallest difference that can be shown between two points. The smallest difference
/// that can be shown between baselines says nothing about kernels, so baselines count only if there are no
/// other points. Returns `None` if the smallest difference is unknown.
pub(crate) fn smallest_difference_note<'a>(records: impl IntoIterator<Item = &'a Record>) -> Option<String> {
    let judged = records.into_iter().filter(|record| record.relative_times.is_some());
    let (baselines, kernels): (Vec<&Record>, Vec<&Record>) = judged.partition(|record| record.is_baseline());
    let points = if kernels.is_empty() { baselines } else { kernels };
    let is_noisy = |point: &&Record| resolution([*point]).is_some_and(|[part, _]| part > NOISY);
    let known = points.into_iter().filter(|point| resolution([*point]).is_some());
    let (noisy, fine): (Vec<&Record>, Vec<&Record>) = known.partition(is_noisy);
    let below =
        |amount: &str| format!("Differences below {amount} between two points are mostly not detected here.");
    let count =
        |points: &[&Record]| points.iter().filter_map(|point| rounds_of(point)).collect::<HashSet<_>>().len();
    match (smallest_difference(&fine), smallest_difference(&noisy)) {
        (None, None) => None,
        (Some(amount), None) | (None, Some(amount)) => Some(below(&amount)),
        (Some(percents), Some(factors)) => Some(format!(
            "{} In {} of {} groups of points, the times are noisier: differences below {factors} are mostly not \
             detected there.",
            below(&percents),
            count(&noisy),
            count(&[&noisy[..], &fine].concat())
        )),
    }
}

/// Returns the smallest difference that can be shown between two of the points, such as "2.1 to 4.1%
/// (depending on device)". For noisy points, the difference is a factor, such as "a factor of 3.2". Either
/// all points must be noisy, or none. Returns `None` if the difference is unknown.
fn smallest_difference(points: &[&Record]) -> Option<String> {
    let [part, _] = resolution(points.iter().copied())?;
    let amount = |shown: &str| match part > NOISY {
        true => format!("a factor of {shown}"),
        false => format!("{shown}%"),
    };
    let [least, most] = shown_resolution(points)?;
    Some(match least == most {
        true => amount(&most),
        false => {
            format!("{} (depending on {})", amount(&format!("{least} to {most}")), what_it_depends_on(points))
        }
    })
}

/// Returns the two values of [`resolution`] as texts: percentages or, for noisy points, factors. Returns `None` if the
/// values are unknown.
fn shown_resolution(points: &[&Record]) -> Option<[String; 2]> {
    let shown = |part: f64| match part > NOISY {
        true => significant((1.0 + part).min(LARGEST_FACTOR), 2),
        false => significant(100.0 * part, 2),
    };
    Some(resolution(points.iter().copied())?.map(shown))
}

/// Names what the smallest difference between points depends on: "scene", "scene and device", "when the
/// points were measured". The smallest difference depends on a property if the difference varies among points
/// that are equal in all other properties. This test finds no property if, for example, points of different
/// scenes also have different devices. If the properties that this test finds do not explain why the smallest
/// difference varies, all properties in which the points differ are named.
fn what_it_depends_on(points: &[&Record]) -> String {
    let mut equal: BTreeMap<[String; 3], Vec<&Record>> = BTreeMap::new();
    for point in points {
        let properties = [point.scene.clone(), by(point.image_size), point.device.clone()];
        equal.entry(properties).or_default().push(point);
    }
    let shown: Vec<([String; 3], Option<[String; 2]>)> =
        equal.into_iter().map(|(properties, points)| (properties, shown_resolution(&points))).collect();
    let explain = |named: [bool; 3]| {
        let are_equal = |one: &[String; 3], other: &[String; 3]| {
            (0..named.len()).all(|index| !named[index] || one[index] == other[index])
        };
        let is_explained = |(one, range): &([String; 3], Option<[String; 2]>)| {
            shown.iter().all(|(other, others)| range == others || !are_equal(one, other))
        };
        shown.iter().all(is_explained)
    };
    let without = |left_out: usize| std::array::from_fn(|index| index != left_out);
    let mut named: [bool; 3] = std::array::from_fn(|index| !explain(without(index)));
    if !explain(named) {
        let differs = |index: usize| shown.iter().any(|(one, _)| one[index] != shown[0].0[index]);
        named = std::array::from_fn(differs);
    }
    let of_times = |range: &Option<[String; 2]>| range.as_ref().is_some_and(|[least, most]| least != most);
    let times = shown.iter().any(|(_, range)| of_times(range)).then_some("when the points were measured");
    let properties = PROPERTIES.into_iter().zip(named).filter(|(_, named)| *named).map(|(name, _)| name);
    let names: Vec<&str> = properties.chain(times).collect();
    match names[..] {
        [] => String::new(),
        [one] => one.to_owned(),
        [ref first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Returns true if a record has relative times from only one launch.
fn has_one_launch(record: &Record) -> bool {
    record.relative_times.as_ref().is_some_and(|times| times.standing.launches() == 1)
}

#[cfg(test)]
mod tests;
