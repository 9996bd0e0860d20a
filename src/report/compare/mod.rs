//! Compares two folders of results, and judges whether each point is faster, slower, the same or unclear.

mod change;
mod notes;
mod page;
mod pair;
mod regressions;
#[cfg(test)]
mod tests;

pub use pair::{Against, Pair};

use super::merged::{device_names, labels, merged};
use crate::measure::Verdict;
use crate::record::{
    Folder, HOST, MOVED, Outcome, Record, are_together, judge_with_anchors, latency_ns, median, significant,
    unshared_delay,
};
use change::References;
use notes::{different_devices, which};
use pair::{Both, name, percent};
use serde::Serialize;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::hash::Hash;

/// A pair of records in the form that `--json` prints.
#[derive(Debug, Serialize)]
pub struct PairLine<'a> {
    /// The point's name, as in the tables.
    point: String,
    scene: &'a str,
    image_size: [u32; 2],
    device: [&'a str; 2],
    name: &'a str,
    local_size: Option<[u32; 2]>,
    median_ms: [Option<f64>; 2],
    change_percent: Option<f64>,
    interval_percent: Option<[f64; 2]>,
    against: Option<Against>,
    verdict: &'static str,
}

/// The result of comparing two folders.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The labels of the two folders.
    pub labels: [String; 2],
    /// The points that both folders measured, in the order of the first folder.
    pub pairs: Vec<Pair>,
    /// The lines about points and scenes that are not compared: points that only one folder has, points whose
    /// outcome changed, and scenes whose content differs between the folders.
    pub others: Vec<String>,
    /// The lines of `others` for points that were measured in the first folder and have another outcome in
    /// the second folder, such as `infeasible` or `wrong-image`.
    pub broken: Vec<String>,
    /// The names of the points that were measured in the first folder and that the second folder lacks.
    lost: Vec<String>,
    /// True if the outcome of at least one point differs between the folders.
    pub has_changed_outcomes: bool,
    /// The notes of the folders, and notes on how the folders were compared.
    pub notes: Vec<String>,
    /// The largest change of a time that counts as "same", as a fraction.
    pub threshold: f64,
    /// Pairs of records of control points that were measured in the same rounds as compared points. In each
    /// pair, at least one record is from a block that borrowed the control point: the block measured the
    /// control point although it belongs to another block. These pairs are not in `pairs`.
    controls: Vec<[Record; 2]>,
    /// True if a folder has several devices, so that the name of a point must include its device.
    several_devices: bool,
}

/// What corresponding records of the two folders have in common.
#[derive(PartialEq, Eq, Hash)]
enum Point {
    /// The key, if both folders have a record with this key.
    Key(String),
    /// The scene's content or name, the image size, the device, the strategy's name and the local size.
    Names(String, [u32; 2], String, String, Option<[u32; 2]>),
}

/// Returns a note if the core-to-core latency of one run was more than `MOVED` times that of the other run.
/// Returns `None` if the latencies are closer to each other, or if one of them is unknown.
fn moved_between(folders: [&Folder; 2], labels: &[String; 2]) -> Option<String> {
    let [before, after] = folders.map(|folder| latency_ns(&folder.rounds, &folder.records));
    let (before, after) = (before?, after?);
    (before.max(after) > MOVED * before.min(after)).then(|| {
        let [before, after] = [before, after].map(|ns| significant(ns, 2));
        let [first, second] = labels;
        format!(
            "The core-to-core latency was {before} ns in {first} and {after} ns in {second}: the processors were at different \
             distances from each other. This difference can change times, above all those of kernels whose work-groups \
             share data."
        )
    })
}

impl Comparison {
    /// Returns true if a folder has several devices, so that the names of points include the device.
    pub fn has_several_devices(&self) -> bool {
        self.several_devices
    }

    /// Compares two folders. The largest change that counts as "same" is `threshold`, as a fraction: 0.02 is 2%. If
    /// `bare` is true, times are compared without an anchor or baselines.
    ///
    /// Points correspond if their records have the same key. Points without a record of the same key in the other
    /// folder correspond if their scenes, image sizes, strategies' names and local sizes are equal, and their devices
    /// correspond. Devices correspond if their names are equal, or if records with equal keys show that they are the
    /// same. If each folder has a single device, the two devices also correspond, so that results of different machines
    /// can be compared. Scenes correspond if their contents are equal. If either folder did not record the contents,
    /// scenes correspond if their names are equal.
    pub fn of(before: &Folder, after: &Folder, threshold: f64, bare: bool) -> Self {
        let [before, after] = &judged_with_anchors([before, after]);
        let one_each = devices(before).len() == 1 && devices(after).len() == 1;
        let by_content = [before, after].iter().all(|folder| has_content(folder));
        let common: HashSet<&str> = keys(before).intersection(&keys(after)).copied().collect();
        let names = device_names(&before.records, &after.records);
        let point = |record: &Record| {
            if common.contains(record.key.as_str()) {
                return Point::Key(record.key.clone());
            }
            let device = names.get(&record.device).unwrap_or(&record.device);
            let device = if one_each && !record.is_baseline() { "the device" } else { device };
            let scene = record.scene_hash.as_ref().filter(|_| by_content).unwrap_or(&record.scene);
            let (device, name) = (device.to_owned(), record.name.clone());
            Point::Names(scene.clone(), record.image_size, device, name, record.local_size)
        };
        let after_records = merged(std::slice::from_ref(after));
        let mut unmatched: HashMap<_, _> =
            after_records.iter().map(|record| (point(record), record)).collect();
        let mut comparison = Self::without_points([before, after], threshold);
        let mut only = [Vec::new(), Vec::new()];
        let mut corresponding = BTreeSet::new();
        for record in merged(std::slice::from_ref(before)) {
            match unmatched.remove(&point(&record)) {
                Some(other) => {
                    // A device that only has another name in the second folder does not differ.
                    let is_renamed =
                        record.device != other.device && names.get(&record.device) == Some(&other.device);
                    if !is_renamed {
                        corresponding.insert([record.device.clone(), other.device.clone()]);
                    }
                    comparison.add(record, other);
                }
                None => only[0].push(record),
            }
        }
        let others = after_records.iter().filter(|record| unmatched.contains_key(&point(record)));
        only[1].extend(others.map(|record| with_device_of_first(record, &names)));
        comparison.controls = pairs_of_controls([before, after], &comparison.pairs, point);
        comparison.say_what_only_one_has(&only, by_content);
        let lost = only[0].iter().filter(|record| record.outcome == Outcome::Measured);
        comparison.lost = lost.map(|record| name(record, comparison.several_devices)).collect();
        comparison.notes.extend(different_devices([before, after], &comparison.labels, &corresponding));
        comparison.notes.extend(moved_between([before, after], &comparison.labels));
        comparison.judge(bare);
        comparison
    }

    /// Compares two folders of kernels that one run measured. Points whose program has the same text with
    /// both folders are not compared.
    pub fn of_kernels(folder: &Folder, threshold: f64) -> Self {
        let mut comparison = Self::without_points([folder, folder], threshold);
        comparison.notes.clone_from(&folder.notes);
        let mut labels: Vec<&String> =
            folder.records.iter().filter_map(|record| record.kernels_of.as_ref()).collect();
        labels.dedup();
        let [Some(first), Some(second)] = [0, 1].map(|index| labels.get(index).map(|label| (*label).clone()))
        else {
            comparison.notes.push(
                "The two folders of kernels compile to the same programs, so no points are compared."
                    .to_owned(),
            );
            return comparison;
        };
        let of = |record: &&Record, label: &str| record.kernels_of.as_deref() == Some(label);
        let mut twins: HashMap<_, &Record> = HashMap::new();
        for after in folder.records.iter().filter(|record| of(record, &second)) {
            twins.entry(twin(after)).or_insert(after);
        }
        for before in folder.records.iter().filter(|record| of(record, &first)) {
            if let Some(after) = twins.get(&twin(before)) {
                comparison.add(before.clone(), after);
            }
        }
        comparison.labels = [first, second];
        for pair in &mut comparison.pairs {
            pair.judge(change::of_kernels(pair.both()), threshold);
        }
        comparison.say_how_kernels_were_compared();
        comparison
    }

    fn without_points(folders: [&Folder; 2], threshold: f64) -> Self {
        let labels = labels(&folders.map(Folder::clone));
        let notes_of = |(folder, label): (&&Folder, &String)| -> Vec<String> {
            folder.notes.iter().map(|note| format!("{label}: {note}")).collect()
        };
        let notes = folders.iter().zip(&labels).flat_map(notes_of).collect();
        let labels = labels.try_into().unwrap_or_default();
        Self {
            labels,
            pairs: Vec::new(),
            others: Vec::new(),
            broken: Vec::new(),
            lost: Vec::new(),
            has_changed_outcomes: false,
            notes,
            threshold,
            controls: Vec::new(),
            several_devices: folders.iter().any(|folder| devices(folder).len() > 1),
        }
    }

    /// Adds a line to `others` for each point that only one folder has. If scenes correspond by content, and
    /// the other folder has a scene of the same name with different content, adds a single line about the
    /// scene instead.
    fn say_what_only_one_has(&mut self, only: &[Vec<Record>; 2], by_content: bool) {
        let contents = only.each_ref().map(|records| contents(records));
        let changed = |record: &Record, others: &Contents<'_>| {
            let is_other = |other: &Option<&str>| *other != record.scene_hash.as_deref();
            by_content && others.get(&sized(record)).is_some_and(|hashes| hashes.iter().any(is_other))
        };
        let mut said: HashSet<String> = self.others.iter().cloned().collect();
        for (label, records) in only.iter().enumerate() {
            for record in records {
                let line = match changed(record, &contents[1 - label]) {
                    true => format!("{}: the two folders have different scenes of this name", record.scene),
                    false => {
                        format!("{}: only in {}", name(record, self.several_devices), self.labels[label])
                    }
                };
                if said.insert(line.clone()) {
                    self.others.push(line);
                }
            }
        }
    }

    fn add(&mut self, before: Record, after: &Record) {
        if let (Some(_), Some(_)) = (median(&before), median(after)) {
            // This verdict is a placeholder: `judge` sets the verdict when all points are known.
            self.pairs.push(Pair { before, after: after.clone(), verdict: Verdict::NotEnough, change: None });
        } else if before.outcome != after.outcome {
            let [a, b] = [before.outcome, after.outcome].map(Outcome::name);
            let line = format!("{}: was {a}, is {b}", name(&before, self.several_devices));
            if before.outcome == Outcome::Measured {
                self.broken.push(line.clone());
            }
            self.has_changed_outcomes = true;
            self.others.push(line);
        }
    }

    /// Adds notes on how the changes from one folder of kernels to the other were computed.
    fn say_how_kernels_were_compared(&mut self) {
        if self.has_change(Against::SameRounds) {
            self.notes.push(
                "Changes are computed from samples that were taken close together in time, so they differ somewhat \
                 from the ratio of the medians."
                    .to_owned(),
            );
        }
        if self.has_change(Against::BareTimes) {
            self.notes.push(
                "Some points were measured with one folder of kernels in an earlier session (`--resume`), and with the \
                 other folder later. Their changes are ratios of medians, and include every difference between the \
                 sessions, such as load and clock rates. A run in a new folder measures both folders of kernels in the \
                 same rounds."
                    .to_owned(),
            );
        }
    }

    /// Returns true if the change of at least one point is relative to measurements of the kind `against`.
    fn has_change(&self, against: Against) -> bool {
        self.pairs.iter().any(|pair| pair.change.is_some_and(|(_, own)| own == against))
    }

    /// Returns a note if other programs may have delayed a point and its anchor so differently that the point seems to
    /// be faster or slower; otherwise `None`.
    fn delays(&self) -> Option<String> {
        let is_anchored = |pair: &&Pair| pair.change.is_some_and(|(_, against)| against == Against::Anchor);
        let of = |pair: &Pair| unshared_delay(&pair.before, &pair.after).abs().exp_m1();
        let most = self.pairs.iter().filter(is_anchored).map(of).fold(0.0, f64::max);
        (most > self.threshold).then(|| {
            format!(
                "Other programs used the processors, and may have delayed a point and the anchor by factors that \
                 differ by up to {}%. The intervals of the changes include this difference. To compare exactly, \
                 run both experiments while no other programs run.",
                significant(100.0 * most, 2)
            )
        })
    }

    /// Returns a note on the points whose changes are relative to points that changed by similar factors, if there are
    /// such points. The note names these points, unless they are all points that have a change.
    fn without_baseline(&self) -> Option<String> {
        let is_in_common = |pair: &&Pair| matches!(pair.change, Some((_, Against::PointsInCommon)));
        let names: Vec<String> =
            self.pairs.iter().filter(is_in_common).map(|pair| pair.point(self.several_devices)).collect();
        let all = self.pairs.iter().filter(|pair| pair.change.is_some()).count();
        let (points, changes) = match names.len() {
            0 => return None,
            count if count == all => ("the points".to_owned(), "Changes"),
            _ => (which(&names), "Their changes"),
        };
        Some(format!(
            "No baseline was measured in both folders, with the same program and the same settings, in the same rounds \
             as {points}. {changes} are therefore relative to the points that changed by similar factors, so a change that \
             all points share cannot be detected."
        ))
    }

    /// Returns the pairs of records to which changes may be relative: the compared points, and the control
    /// points that blocks borrowed.
    fn measured(&self) -> Vec<Both<'_>> {
        self.pairs.iter().map(Pair::both).chain(self.controls()).collect()
    }

    /// Returns the pairs of records of borrowed control points (see the field `controls`).
    fn controls(&self) -> impl Iterator<Item = Both<'_>> {
        self.controls.iter().map(|[before, after]| (before, after))
    }

    /// Computes every point's change and verdict, and adds notes on how the changes were computed.
    fn judge(&mut self, bare: bool) {
        let references = References::among(&self.measured());
        let pairs = self.pairs.iter().map(Pair::both);
        let changes: Vec<_> = pairs
            .map(|pair| if bare { change::bare(pair) } else { change::change(pair, &references) })
            .collect();
        for (pair, change) in self.pairs.iter_mut().zip(changes) {
            pair.judge(change, self.threshold);
        }
        if self.has_change(Against::Anchor) || self.has_change(Against::Baselines) {
            self.notes.push(
                "Changes are relative to work that is the same in both runs (the anchor kernel or the baselines) and was measured in \
                 the same rounds as the points. They differ from the ratio of the medians if the machine's speed changed. With `--times`, the \
                 medians are compared."
                    .to_owned(),
            );
        }
        self.notes.extend(self.delays());
        self.notes.extend(self.without_baseline());
        self.notes.extend(self.cannot_tell());
        if self.has_change(Against::BareTimes) {
            self.notes.push(
                "Plain times are compared, not their ratios to the anchor's time. Changes therefore include every difference \
                 between the runs, such as load and clock rates."
                    .to_owned(),
            );
        }
    }

    /// Returns true if both folders measured at least one point, or if the outcome of a point changed.
    pub fn has_points_in_common(&self) -> bool {
        !self.pairs.is_empty() || self.has_changed_outcomes
    }

    /// Returns the number of compared points with the given verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.pairs.iter().filter(|pair| pair.verdict == verdict).count()
    }

    /// Returns one line for each regression of more than `limit_percent`, and for each point that was
    /// measured in the first folder and failed in the second. At most one in 50 comparisons of a program with
    /// itself reports a regression.
    pub fn regressions(&self, limit_percent: f64) -> Vec<String> {
        regressions::regressions(self, limit_percent)
    }

    /// Returns a note on the points that [`Self::regressions`] leaves out of its tests of means, if there are any.
    pub fn left_out_of_means(&self) -> Option<String> {
        regressions::left_out(self)
    }

    /// Returns the counts of verdicts, such as "12 faster, 3 slower, 40 same, 5 unclear". The counts of points without
    /// a change ("cannot tell", "not enough samples", "below the timer's resolution") follow if they are not zero.
    pub fn summary(&self) -> String {
        let counts = Verdict::ALL.map(|verdict| (verdict, self.count(verdict)));
        let shown = counts.iter().filter(|(verdict, count)| {
            matches!(verdict, Verdict::Faster | Verdict::Slower | Verdict::Same | Verdict::Unclear)
                || *count > 0
        });
        shown.map(|(verdict, count)| format!("{count} {}", verdict.name())).collect::<Vec<_>>().join(", ")
    }

    /// Returns the pairs as objects for JSON.
    pub fn lines(&self) -> Vec<PairLine<'_>> {
        self.pairs.iter().map(|pair| line(pair, self.several_devices)).collect()
    }
}

fn line(pair: &Pair, several_devices: bool) -> PairLine<'_> {
    PairLine {
        point: pair.point(several_devices),
        scene: &pair.before.scene,
        image_size: pair.before.image_size,
        device: [&pair.before.device, &pair.after.device],
        name: &pair.before.name,
        local_size: pair.before.local_size,
        median_ms: [median(&pair.before), median(&pair.after)],
        change_percent: pair.change_percent(),
        interval_percent: pair.change.map(|(change, _)| [change.low, change.high].map(percent)),
        against: pair.change.map(|(_, against)| against),
        verdict: pair.verdict.name(),
    }
}

/// Returns a record of the second folder, with the first folder's name for the record's device. `names` maps the first
/// folder's names of devices to the second folder's names. The name stays unchanged unless exactly one name of the
/// first folder is mapped to it.
fn with_device_of_first(record: &Record, names: &HashMap<String, String>) -> Record {
    let mut known = names.iter().filter(|(_, second)| **second == record.device).map(|(first, _)| first);
    let device = known.next().filter(|_| known.next().is_none()).unwrap_or(&record.device);
    Record { device: device.clone(), ..record.clone() }
}

/// Returns the values that are equal in both records of a point that was measured with two folders of
/// kernels.
fn twin(record: &Record) -> ([&str; 3], [u32; 2], Option<[u32; 2]>) {
    ([&record.scene, &record.device, &record.strategy], record.image_size, record.local_size)
}

/// The hashes of scenes' contents, by the scene's name and the image size. If raycl places a scene's camera, the
/// content depends on the image size. Each value is a set, because scenes with different contents can have one name.
/// `None` stands for an unknown hash.
type Contents<'r> = HashMap<(&'r str, [u32; 2]), HashSet<Option<&'r str>>>;

fn contents(records: &[Record]) -> Contents<'_> {
    let mut contents = Contents::new();
    for record in records {
        contents.entry(sized(record)).or_default().insert(record.scene_hash.as_deref());
    }
    contents
}

/// Returns the name of a record's scene, and the image size.
fn sized(record: &Record) -> (&str, [u32; 2]) {
    (&record.scene, record.image_size)
}

/// Returns pairs of records of the same control point, one from each folder. Each pair was measured in the
/// same rounds as a pair of compared points. At least one record of a pair is from a block that borrowed the
/// control point: the block measured the control point although it belongs to another block. `point` returns
/// what corresponding records have in common.
fn pairs_of_controls<P: Eq + Hash>(
    folders: [&Folder; 2],
    compared: &[Pair],
    point: impl Fn(&Record) -> P,
) -> Vec<[Record; 2]> {
    let points: HashSet<P> = folders.iter().flat_map(|folder| &folder.controls).map(&point).collect();
    let [before, after] = folders.map(|folder| {
        let own = folder.records.iter().map(|record| (point(record), record, false));
        let borrowed = folder.controls.iter().map(|record| (point(record), record, true));
        own.chain(borrowed).filter(|(point, ..)| points.contains(point)).collect::<Vec<_>>()
    });
    let is_beside = |one: &Record, other: &Record| {
        compared.iter().any(|pair| are_together(&pair.before, one) && are_together(&pair.after, other))
    };
    let mut pairs = Vec::new();
    for (point, one, is_borrowed) in &before {
        for (other_point, other, is_other_borrowed) in &after {
            if point == other_point && (*is_borrowed || *is_other_borrowed) && is_beside(one, other) {
                pairs.push([one, other].map(|record| (*record).clone()));
            }
        }
    }
    pairs
}

/// Returns copies of the folders in which each record also has relative times: its times divided by those of
/// the records and anchors that were measured together with it. These records include the control points that
/// blocks borrowed. The intervals of the times themselves are the same as in reports and tables.
///
/// Preempted samples of an anchor (samples that other programs delayed) are found by processor times, and
/// left out. If they were left out in only one folder, the anchor would seem to be slower in the other
/// folder. If an anchor has a sample without a processor time in either folder, all samples of this anchor
/// therefore remain in both folders.
fn judged_with_anchors(folders: [&Folder; 2]) -> [Folder; 2] {
    let samples = folders.iter().flat_map(|folder| &folder.anchors);
    let unknown = samples.filter(|sample| sample.processor_ms.is_none());
    let unknown: HashSet<&str> = unknown.map(|sample| sample.anchor.as_str()).collect();
    folders.map(|folder| {
        let mut folder = folder.clone();
        for sample in folder.anchors.iter_mut().filter(|sample| unknown.contains(sample.anchor.as_str())) {
            sample.processor_ms = None;
        }
        let count = folder.records.len();
        folder.records.append(&mut folder.controls);
        judge_with_anchors(&mut folder.records, &folder.anchors);
        folder.controls = folder.records.split_off(count);
        folder
    })
}

fn keys(folder: &Folder) -> HashSet<&str> {
    folder.records.iter().map(|record| record.key.as_str()).collect()
}

fn devices(folder: &Folder) -> Vec<&str> {
    let mut devices: Vec<&str> =
        folder.records.iter().map(|record| record.device.as_str()).filter(|device| *device != HOST).collect();
    devices.sort_unstable();
    devices.dedup();
    devices
}

/// Returns true if every record of a folder has a hash of its scene's content.
fn has_content(folder: &Folder) -> bool {
    folder.records.iter().all(|record| record.scene_hash.is_some())
}
