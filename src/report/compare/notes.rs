//! Notes on a comparison. They say how the devices and the distances between processors differ, to which
//! measurements the changes are relative, which points have the verdict "not comparable", and which points
//! `--fail-on-regression` does not test.

use super::Comparison;
use super::pair::{Against, Pair};
use crate::device::variables::determines_threads;
use crate::measure::Verdict;
use crate::numbers::significant;
use crate::record::{Folder, MOVED, latency_ns, unshared_delay};
use crate::words::counted;
use serde_json::Value;
use std::collections::BTreeSet;

/// The reason why times are compared without an anchor or baselines although the user did not ask for it.
const OTHER_DEVICES: &str = "because the devices differ, and no baseline was measured in both folders by the same \
                             program on the same processor";

/// Returns a note for each pair of corresponding devices that differ in their names, or in properties that
/// affect times. `devices` contains the names of corresponding devices in the two folders. A property that
/// one of the folders does not contain is not compared. One of these properties is the list of environment
/// variables that affect times. In this list, the note marks the variables that raycl has set, but leaves them
/// out if they set the number of threads, because the number of threads is a property of its own.
pub(super) fn different_devices(
    folders: [&Folder; 2],
    labels: &[String; 2],
    devices: &BTreeSet<[String; 2]>,
) -> Vec<String> {
    let note = |names: &[String; 2]| {
        let devices = [0, 1].map(|index| described(folders[index], &names[index]));
        let [before, after] = devices.each_ref().map(properties);
        let [mut first, mut second] = names.clone().map(|name| vec![name]);
        for (before, after) in before.iter().zip(&after) {
            let (Some(before), Some(after)) = (before, after) else { continue };
            first.extend(not_in(after, before).filter_map(|own| shown(own, &devices[0])));
            second.extend(not_in(before, after).filter_map(|own| shown(own, &devices[1])));
        }
        let [first, second] = [first, second].map(|parts| parts.join(", "));
        let [before, after] = labels;
        (first != second).then(|| format!("The devices differ. In {before}: {first}. In {after}: {second}."))
    };
    devices.iter().filter_map(note).collect()
}

/// Returns the elements of the list `own` that are not in the list `other`. The two lists contain the same
/// property of two devices.
fn not_in<'a>(other: &'a [String], own: &'a [String]) -> impl Iterator<Item = &'a String> {
    own.iter().filter(move |part| !other.contains(part))
}

/// Returns the text with which a note names one element of a device's property, such as a setting; `None` if
/// the note leaves this element out.
fn shown(part: &str, device: &Value) -> Option<String> {
    let mut by_raycl = device["set_by_raycl"].as_array().into_iter().flatten();
    match by_raycl.any(|setting| setting == part) {
        false => Some(part.to_owned()),
        true if determines_threads(part) => None,
        true => Some(format!("{part} (set by raycl)")),
    }
}

/// Returns the description of a device in a folder's `environment.json`; null if the file does not describe
/// the device.
fn described(folder: &Folder, device: &str) -> Value {
    let mut all = folder.environment["devices"].as_array().into_iter().flatten();
    all.find(|one| one["device"] == device).cloned().unwrap_or_default()
}

/// Returns the properties of a device that affect its times. A known property is a list of texts that a note
/// can show, such as "8 threads"; an unknown property is `None`. PoCL has as many compute units as threads,
/// so the compute units count as unknown if the number of threads is known.
fn properties(device: &Value) -> [Option<Vec<String>>; 7] {
    let text = |key: &str| device[key].as_str().map(|text| vec![text.to_owned()]);
    let count = |key: &str, what: &str| {
        let count = usize::try_from(device[key].as_u64()?).ok()?;
        Some(vec![counted(count, what)])
    };
    let driver = device["driver"].as_str().map(|version| vec![format!("driver {version}")]);
    let threads = count("threads", "thread");
    let units = if threads.is_some() { None } else { count("compute_units", "compute unit") };
    let settings = device["settings"].as_array().map(|all| {
        let each = all.iter().filter_map(Value::as_str);
        each.map(str::to_owned).collect()
    });
    [text("platform"), text("platform_version"), driver, units, count("cores", "core"), threads, settings]
}

/// Returns a note if the core-to-core latency of one run was more than `MOVED` times that of the other run.
/// Returns `None` if neither latency is more than `MOVED` times the other, or if a latency is unknown.
pub(super) fn moved_between(folders: [&Folder; 2], labels: &[String; 2]) -> Option<String> {
    let [before, after] = folders.map(|folder| latency_ns(&folder.rounds, &folder.records));
    let (before, after) = (before?, after?);
    (before.max(after) > MOVED * before.min(after)).then(|| {
        let [before, after] = [before, after].map(|ns| significant(ns, 2));
        let [first, second] = labels;
        format!(
            "The core-to-core latency was {before} ns in {first} and {after} ns in {second}. The processors \
             of one run were probably farther apart than those of the other run. The distance between \
             processors affects times, above all those of kernels whose work-groups share data."
        )
    })
}

impl Comparison {
    /// Adds notes on how the changes from one folder of results to the other were computed. `bare` is true if
    /// the user wants the times to be compared without an anchor or baselines.
    pub(super) fn say_how_results_were_compared(&mut self, bare: bool) {
        if self.has_change(Against::Anchor) || self.has_change(Against::Baselines) {
            self.notes.push(
                "Changes are relative to work that is the same in both runs (the anchor kernel or the baselines) and was measured in \
                 the same rounds as the points. Changes differ from the ratio of the medians if the machine's speed changed. With `--times`, the \
                 medians are compared."
                    .to_owned(),
            );
        }
        self.notes.extend(self.delays());
        self.notes.extend(self.without_baseline());
        self.notes.extend(self.not_comparable());
        if self.has_change(Against::BareTimes) {
            let why = if bare { "not their ratios to the anchor's time" } else { OTHER_DEVICES };
            self.notes.push(format!(
                "Plain times are compared, {why}. Changes therefore include every difference between the runs, \
                 such as load and clock rates."
            ));
        }
    }

    /// Adds notes on how the changes from one folder of kernels to the other were computed.
    pub(super) fn say_how_kernels_were_compared(&mut self) {
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
                 other folder later. The changes of these points are ratios of medians, and include every difference \
                 between the sessions, such as load and clock rates. A run in a new folder measures both folders of \
                 kernels in the same rounds."
                    .to_owned(),
            );
        }
    }

    /// Returns true if the change of at least one point was computed in the way that `against` describes.
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
                "Other programs used the processors, and may have delayed a point and the anchor (the fixed work by \
                 whose time the point's time is divided) by factors that differ by up to {}%. The intervals of the \
                 changes include the difference of these factors. To compare exactly, run both experiments while \
                 no other programs run.",
                significant(100.0 * most, 2)
            )
        })
    }

    /// Returns a note on the points whose times were divided by the times of other points, which changed by
    /// factors similar to each other; `None` if there are no such points. The note names the points, unless
    /// it concerns all points with a known change.
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
             as {points}. {changes} are therefore relative to those kernels of the same device whose times changed \
             by similar factors. A change that all kernels of a device share cannot be detected."
        ))
    }

    /// Returns a note on the kernels with the verdict "not comparable"; `None` if no kernel has this verdict.
    /// The note says why the changes of these kernels are unknown, and which option compares their times
    /// nevertheless.
    fn not_comparable(&self) -> Option<String> {
        let is_unknown = |pair: &&Pair| pair.verdict == Verdict::NotComparable && !pair.before.is_baseline();
        let unknown = self.pairs.iter().filter(is_unknown);
        let names: Vec<String> = unknown.map(|pair| pair.point(self.several_devices)).collect();
        (!names.is_empty()).then(|| {
            format!(
                "The verdict is \"not comparable\" for {}. Nothing shows how much the machine's speed changed. To show \
                 this, the rounds of these kernels would have to contain, in both folders, the same anchor kernel, the \
                 same baseline, or the same three or more kernels of one device, most of which changed by similar factors. \
                 With `--times`, the measured times are compared, and changes include every difference between the runs.",
                which(&names)
            )
        })
    }

    /// Returns a note on the points that were measured in the first folder, but that [`Self::regressions`] does
    /// not test because the second folder has no record of them; `None` if there are no such points.
    pub fn lost_points(&self) -> Option<String> {
        (!self.lost.is_empty()).then(|| {
            format!(
                "`--fail-on-regression` does not test {}. These points were measured in {}, and {} has no records of them.",
                which(&self.lost),
                self.labels[0],
                self.labels[1]
            )
        })
    }
}

/// Returns a text with the names of points. For more than four points, the text has the number of points and
/// the first four names.
fn which(names: &[String]) -> String {
    match names.len() {
        count if count > 4 => format!("{count} of the points ({}, ...)", names[..4].join("; ")),
        _ => format!("these points: {}", names.join("; ")),
    }
}
