//! Notes on a comparison: how the devices of the two folders differ, which points have the verdict "cannot
//! tell", and which points `--fail-on-regression` does not test.

use super::Comparison;
use super::pair::Pair;
use crate::device::variables::determines_threads;
use crate::measure::Verdict;
use crate::record::Folder;
use crate::words::counted;
use serde_json::Value;
use std::collections::BTreeSet;

/// Returns a note for each pair of corresponding devices that differ in their names, or in properties that
/// affect times. `devices` has the names of corresponding devices in the two folders. A property that one of
/// the folders has not stored is not compared. The note names the environment variables that the user has
/// set. A variable that raycl has set is marked. If such a variable only determines the number of threads, it
/// is left out, because the number of threads is a separate property.
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

/// Returns the parts of the property `own` that `other` lacks. `other` is the same property of another
/// device.
fn not_in<'a>(other: &'a [String], own: &'a [String]) -> impl Iterator<Item = &'a String> {
    own.iter().filter(move |part| !other.contains(part))
}

/// Returns how a note names a part of a device's property; `None` if the note leaves this part out.
fn shown(part: &str, device: &Value) -> Option<String> {
    let mut by_raycl = device["set_by_raycl"].as_array().into_iter().flatten();
    match by_raycl.any(|setting| setting == part) {
        false => Some(part.to_owned()),
        true if determines_threads(part) => None,
        true => Some(format!("{part} (set by raycl)")),
    }
}

/// Returns the description of a device in a folder's `environment.json`; null if there is none.
fn described(folder: &Folder, device: &str) -> Value {
    let mut all = folder.environment["devices"].as_array().into_iter().flatten();
    all.find(|one| one["device"] == device).cloned().unwrap_or_default()
}

/// Returns the properties of a device that affect its times, each as the parts that a note can name; `None` for a
/// property that is not known. PoCL has as many compute units as threads, so a device with threads has no property for
/// its compute units.
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

impl Comparison {
    /// Returns a note on the kernels whose change cannot be told, if there are any. The note says why, and which option
    /// compares them nevertheless.
    pub(super) fn cannot_tell(&self) -> Option<String> {
        let is_unknown = |pair: &&Pair| pair.verdict == Verdict::CannotTell && !pair.before.is_baseline();
        let unknown = self.pairs.iter().filter(is_unknown);
        let names: Vec<String> = unknown.map(|pair| pair.point(self.several_devices)).collect();
        (!names.is_empty()).then(|| {
            format!(
                "The verdict is \"cannot tell\" for {}. In the rounds in which they were measured, the two folders \
                 have neither the same anchor kernel nor the same baselines nor at least three kernels in common, so \
                 nothing shows how much the machine's speed changed. With `--times`, the measured times are compared, \
                 and changes include every difference between the runs.",
                which(&names)
            )
        })
    }

    /// Returns a note on the points that [`Self::regressions`] does not test because the second folder lacks them, if
    /// there are any.
    pub fn lost_points(&self) -> Option<String> {
        (!self.lost.is_empty()).then(|| {
            format!(
                "`--fail-on-regression` does not test {}. They were measured in {}, and {} has no records of them.",
                which(&self.lost),
                self.labels[0],
                self.labels[1]
            )
        })
    }
}

/// Returns a text with the points' names. For more than four points, the text has their number and the first
/// four names.
pub(super) fn which(names: &[String]) -> String {
    match names.len() {
        count if count > 4 => format!("{count} of the points ({}, ...)", names[..4].join("; ")),
        _ => format!("these points: {}", names.join("; ")),
    }
}
