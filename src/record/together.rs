//! Computes the relative times of records: how a record's times compare with the times of records that were
//! measured in the same rounds. All outputs of raycl, such as the report, the summaries and `raycl compare`,
//! use relative times to decide whether two times differ; docs/methodology.md explains the rule.

use super::anchors::{AnchorSample, AnchorTimes, AnchorUtilization};
use super::control::find_controls;
use super::point_times::median;
use super::relative_times::{MeasuredAnchor, RelativeTimes};
use super::types::{HOST, Record};
use crate::device::DeviceKind;
use crate::measure::{BetweenRuns, Interval, Paired, PairedSample};
use std::collections::{BTreeMap, BTreeSet, HashSet};

/// Computes the relative times of each measured record: its times relative to the times of the records that
/// were measured together. Records with the same launches were measured together. Records of earlier versions
/// of raycl, which have no launch numbers, are treated as measured together if their scene, image size and
/// device are equal.
pub fn judge(records: &mut [Record]) {
    write_all_relative_times(records, &[]);
}

/// Computes the relative times of each record like [`judge`], and also the relative times of the anchors. If
/// the records already have relative times from `judge`, the intervals of their medians stay unchanged, since
/// every output of raycl must show the same intervals.
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

/// Computes the relative times of each record and of the anchors. A record with times of 0 among its samples
/// has no relative times, since a measured time of 0 says only that the true time is below the timer's resolution.
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
pub(super) fn has_time(record: &Record) -> bool {
    median(record).is_some() && record.samples_ms.iter().all(|ms| *ms > 0.0)
}

/// Records that were measured together, and the anchors that were measured in the same launches.
struct Table {
    /// A hash that identifies the set of records.
    together: blake3::Hash,
    /// The indices of the table's records in the list of all records.
    indices: Vec<usize>,
    /// The anchors that were measured in the same launches. In `paired`, the indices of the anchors follow
    /// the indices of the records.
    anchors: Vec<Anchor>,
    paired: Paired,
}

/// An anchor (work whose time shows the machine's speed) that was measured in the same launches as the
/// records of a [`Table`].
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
        // Like a point with times of 0, an anchor with times of 0 cannot be compared.
        anchor_times.retain(|anchor| anchor.remaining.iter().all(|sample| sample.ms > 0.0));
        let record_of = |anchor: &AnchorTimes<'_>| own().find(|record| record.device == anchor.device);
        let on_processors: Vec<bool> =
            anchor_times.iter().map(|anchor| record_of(anchor).is_some_and(is_on_processors)).collect();
        // The times of baselines do not show how much the times of kernels vary, so baselines are marked.
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

    /// Returns the machine and the devices that measured the records. raycl estimates from several tables
    /// together how much times differ between launches, but only if these tables have the same machine and
    /// devices. If devices of the same model share the points, all records name the first device, and only
    /// `measured_on` tells which device measured a point.
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

/// Returns by how much the same point's times on a record's device may differ from one run to the next.
pub(super) fn between_runs(record: &Record) -> BetweenRuns {
    if is_on_processors(record) { BetweenRuns::ON_PROCESSORS } else { BetweenRuns::ON_OTHER_DEVICES }
}

/// Returns true if a record's device is a CPU, or the host without OpenCL. Records of earlier versions of
/// raycl do not contain the kind of device. If a record has no kind of device but a number of threads, its
/// device is a CPU.
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

/// Returns the samples of some records and anchors, sorted by launch, and within a launch by the moment at which
/// they were taken. The field `point` of a sample is the index of the sample's record. In the sample of an
/// anchor (work whose time shows the machine's speed), `point` is the number of records plus the anchor's index.
pub(super) fn in_order<'a>(
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

/// Returns a hash of the samples, which identifies a set of records that were measured together. Launch
/// numbers cannot identify a set of records, since two folders may use the same launch numbers.
fn name(samples: &[PairedSample]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for sample in samples {
        hasher.update(&sample.launch.to_le_bytes());
        hasher.update(&sample.ms.to_le_bytes());
    }
    hasher.finalize()
}

#[cfg(test)]
pub(super) mod tests;
