//! `anchors.jsonl`: times of the anchor, a fixed kernel that each device runs once for every six samples of its points,
//! or once for every round of fewer samples. These times make runs comparable even if the machine's speed changed
//! between the runs.

use super::plan::CurrentPlan;
use super::types::Record;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// A line of `anchors.jsonl`: one execution of the anchor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AnchorSample {
    /// The anchor's name; equal names mean the same work on the same device, or on devices of one model that share a
    /// run's points.
    pub anchor: String,
    /// The device's name in records.
    pub device: String,
    /// The launch's number in the folder.
    pub launch: u32,
    /// The launch's round, counted from 0.
    pub round: u32,
    /// When the anchor ended, in milliseconds since the launch's rounds began.
    pub at_ms: f64,
    /// The anchor's device time in milliseconds.
    pub ms: f64,
}

/// Gives anchors the names that a plan gives to their devices. `records` are records of the same folder, with the names
/// under which they were stored. A device's name depends on the machine's other devices, so an earlier session may have
/// used another name than the plan. If no record has an anchor's launch and device, as after a session that was
/// interrupted, the anchor gets the device of other anchors with its name.
pub(super) fn name_devices<'a>(
    anchors: &mut [AnchorSample],
    plan: &CurrentPlan,
    records: impl Iterator<Item = &'a Record>,
) {
    let devices = plan.devices();
    let mut planned: HashMap<(&str, u32), &str> = HashMap::new();
    for record in records {
        let Some(device) = devices.get(record.key.as_str()) else { continue };
        for launch in record.sample_launches.chunk_by(|one, next| one == next) {
            planned.insert((record.device.as_str(), launch[0]), *device);
        }
    }
    let of_launch = |anchor: &AnchorSample| planned.get(&(anchor.device.as_str(), anchor.launch)).copied();
    let found = anchors.iter().filter_map(|anchor| Some((anchor.anchor.clone(), of_launch(anchor)?)));
    let of_name: HashMap<String, &str> = found.collect();
    for anchor in anchors {
        if let Some(device) = of_launch(anchor).or_else(|| of_name.get(&anchor.anchor).copied()) {
            anchor.device = device.to_owned();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_get_the_plans_name_of_their_device_by_launch_or_by_the_name_of_the_anchor() {
        let record = |key: &str, device: &str, launch: u32| Record {
            key: key.into(),
            device: device.into(),
            sample_launches: vec![launch; 2],
            ..Record::default()
        };
        let plan = CurrentPlan::of(&[record("a", "pocl-cpu", 0), record("b", "intel-cpu", 0)]);
        // In earlier sessions, each device was the only one and had the name "cpu". The launch 3 belongs to no record.
        let records = [record("a", "cpu", 0), record("b", "cpu", 1), record("hidden", "cpu", 2)];
        let anchor = |name: &str, launch: u32| AnchorSample {
            anchor: name.into(),
            device: "cpu".into(),
            launch,
            ..AnchorSample::default()
        };
        let mut anchors = [anchor("p", 3), anchor("p", 0), anchor("i", 1), anchor("other", 2)];
        name_devices(&mut anchors, &plan, records.iter());
        assert_eq!(anchors.map(|anchor| anchor.device), ["pocl-cpu", "pocl-cpu", "intel-cpu", "cpu"]);
    }
}
