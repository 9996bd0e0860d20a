//! Decides how the time of each compared point changed, relative to work that is the same in both folders.

use super::Comparison;
use super::change::{self, References};
use super::pair::{Both, Pair};
use super::points::{Correspondence, Point};
use crate::record::{Folder, Record, are_together, judge_with_anchors};
use std::collections::HashSet;

impl Comparison {
    /// Computes every point's change and verdict. If `bare` is true, times are compared without an anchor or baselines.
    pub(super) fn judge(&mut self, bare: bool) {
        let references = References::among(&self.measured());
        let pairs = self.pairs.iter().map(Pair::both);
        let changes: Vec<_> = pairs
            .map(|pair| if bare { change::bare(pair) } else { change::change(pair, &references) })
            .collect();
        for (pair, change) in self.pairs.iter_mut().zip(changes) {
            pair.judge(change, self.threshold);
        }
    }

    /// Returns the pairs of records by whose times other times may be divided when changes are computed.
    /// These are the pairs of the compared points, and the pairs in the field `controls`.
    pub(super) fn measured(&self) -> Vec<Both<'_>> {
        self.pairs.iter().map(Pair::both).chain(self.controls()).collect()
    }

    /// Returns the pairs of records of control points that a block measured although they belong to another
    /// block (see the field `controls`).
    pub(super) fn controls(&self) -> impl Iterator<Item = Both<'_>> {
        self.controls.iter().map(|[before, after]| (before, after))
    }
}

/// Returns copies of the folders. Each record of the copies has times relative to everything that was
/// measured in the same rounds: other records, control points and anchors. The intervals of the times
/// themselves are the same as in reports and tables.
///
/// Preempted samples of an anchor (samples that other programs probably delayed) are found by processor times, and left
/// out. If preempted samples were left out in only one of the two folders, the anchor would seem to be slower in the
/// other folder. To avoid this, all samples of an anchor remain in both folders if any of its samples, in either
/// folder, lacks the processor time.
pub fn judged_with_anchors(folders: [&Folder; 2]) -> [Folder; 2] {
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

/// Returns pairs of records of the same control point, one from each folder. A pair is returned only if there is a
/// compared point whose records were measured, in both folders, in the same rounds as the records of the pair. At
/// least one record of a pair is from a block that borrowed the control point: the block measured the control point
/// although the point belongs to another block.
pub fn pairs_of_controls(
    folders: [&Folder; 2],
    compared: &[Pair],
    correspondence: &Correspondence<'_>,
) -> Vec<[Record; 2]> {
    let point = |record: &Record| correspondence.point(record);
    let points: HashSet<Point> = folders.iter().flat_map(|folder| &folder.controls).map(point).collect();
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
