//! Compares two folders of results. For each point, decides whether its time became shorter, became longer or
//! stayed the same. The result can also be that this is unclear.

mod change;
mod judging;
mod lines;
mod not_compared;
mod notes;
mod page;
mod pair;
mod points;
mod regressions;
#[cfg(test)]
mod tests;

pub use pair::Pair;

use super::merged::{labels, merged};
use crate::measure::Verdict;
use crate::record::{Folder, Outcome, Record, median};
use judging::{judged_with_anchors, pairs_of_controls};
use notes::{different_devices, moved_between};
use pair::{common_name, name};
use points::{Correspondence, devices, twin};
use std::collections::{BTreeSet, HashMap};

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
    /// The names of the points that were measured in the first folder and have no record in the second
    /// folder.
    lost: Vec<String>,
    /// True if the outcome of at least one point differs between the folders.
    pub has_changed_outcomes: bool,
    /// The notes of the folders, and notes on how the folders were compared.
    pub notes: Vec<String>,
    /// The largest change of a time that counts as "same", as a fraction.
    pub threshold: f64,
    /// Pairs of records of control points (points that each block of a group measures, so that blocks can be
    /// compared). The records of a pair were measured in the same rounds as the records of a compared point.
    /// In each pair, at least one record is from a block that borrowed the control point: the block measured
    /// the control point although the point belongs to another block. These pairs are not in the field
    /// `pairs`, which has the compared points.
    controls: Vec<[Record; 2]>,
    /// True if one of the folders has several devices. The name of a point must then include the device.
    several_devices: bool,
}

impl Comparison {
    /// Returns true if one of the folders has several devices. The names of points then include the device.
    pub fn has_several_devices(&self) -> bool {
        self.several_devices
    }

    /// Compares two folders. The largest change that counts as "same" is `threshold`, as a fraction: 0.02 is
    /// 2%. If `bare` is true, the measured times are compared, without dividing them by the times of an
    /// anchor or of baselines. The measured times are also compared where devices differ and the folders have
    /// no baseline in common.
    ///
    /// `Correspondence` says which records of the two folders are of the same point.
    pub fn of(before: &Folder, after: &Folder, threshold: f64, bare: bool) -> Self {
        let [before, after] = &judged_with_anchors([before, after]);
        let correspondence = Correspondence::between(before, after);
        let point = |record: &Record| correspondence.point(record);
        let after_records = merged(std::slice::from_ref(after));
        let mut unmatched: HashMap<_, _> =
            after_records.iter().map(|record| (point(record), record)).collect();
        let mut comparison = Self::without_points([before, after], threshold);
        let mut only = [Vec::new(), Vec::new()];
        let mut corresponding = BTreeSet::new();
        for record in merged(std::slice::from_ref(before)) {
            match unmatched.remove(&point(&record)) {
                Some(other) => {
                    // If the same device only has another name in the second folder, no note about different
                    // devices is needed.
                    if !correspondence.is_renamed(&record, other) {
                        corresponding.insert([record.device.clone(), other.device.clone()]);
                    }
                    comparison.add(record, other);
                }
                None => only[0].push(record),
            }
        }
        let others = after_records.iter().filter(|record| unmatched.contains_key(&point(record)));
        only[1].extend(others.map(|record| correspondence.with_device_of_first(record)));
        comparison.controls = pairs_of_controls([before, after], &comparison.pairs, &correspondence);
        comparison.say_what_only_one_has(&only, correspondence.by_content);
        let lost = only[0].iter().filter(|record| record.outcome == Outcome::Measured);
        comparison.lost = lost.map(|record| name(record, comparison.several_devices)).collect();
        comparison.notes.extend(different_devices([before, after], &comparison.labels, &corresponding));
        comparison.notes.extend(moved_between([before, after], &comparison.labels));
        comparison.judge(bare);
        comparison.say_how_results_were_compared(bare);
        comparison
    }

    /// Compares two folders of kernels that one run measured. Points whose program has the same source text with both
    /// folders of kernels are not compared. If no point is compared for this reason, the comparison contains no
    /// pairs, and a note says so.
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

    fn add(&mut self, before: Record, after: &Record) {
        if let (Some(_), Some(_)) = (median(&before), median(after)) {
            // The verdict `NotEnough` is a placeholder here: `judge` sets the verdict when all points are
            // known.
            self.pairs.push(Pair { before, after: after.clone(), verdict: Verdict::NotEnough, change: None });
        } else if before.outcome != after.outcome {
            let [a, b] = [before.outcome, after.outcome].map(Outcome::name);
            let line = format!("{}: was {a}, is {b}", common_name((&before, after), self.several_devices));
            if before.outcome == Outcome::Measured {
                self.broken.push(line.clone());
            }
            self.has_changed_outcomes = true;
            self.others.push(line);
        }
    }

    /// Returns true if at least one point was measured in both folders, or if the outcome of a point changed.
    pub fn has_points_in_common(&self) -> bool {
        !self.pairs.is_empty() || self.has_changed_outcomes
    }

    /// Returns the number of compared points with the given verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.pairs.iter().filter(|pair| pair.verdict == verdict).count()
    }

    /// Returns one line for each regression of more than `limit_percent`, and for each point that was measured in the
    /// first folder and has another outcome in the second folder. About one in 50 comparisons of a program with
    /// itself reports a regression (up to one in 25 with two launches).
    pub fn regressions(&self, limit_percent: f64) -> Vec<String> {
        regressions::regressions(self, limit_percent)
    }

    /// Returns a note on the points that [`Self::regressions`] leaves out of its tests of means, if there are any.
    pub fn left_out_of_means(&self) -> Option<String> {
        regressions::left_out(self)
    }

    /// Returns the counts of verdicts, such as "12 faster, 3 slower, 40 same, 5 unclear". The counts of
    /// points whose change is unknown ("not comparable", "not enough samples", "below the timer's resolution")
    /// follow if they are not zero.
    pub fn summary(&self) -> String {
        let counts = Verdict::ALL.map(|verdict| (verdict, self.count(verdict)));
        let shown = counts.iter().filter(|(verdict, count)| {
            matches!(verdict, Verdict::Faster | Verdict::Slower | Verdict::Same | Verdict::Unclear)
                || *count > 0
        });
        shown.map(|(verdict, count)| format!("{count} {}", verdict.name())).collect::<Vec<_>>().join(", ")
    }
}
