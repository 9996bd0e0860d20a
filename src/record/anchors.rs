//! `anchors.jsonl`: times of the anchor, which is a kernel that never changes. Each device runs the anchor
//! kernel once for every six samples of its points, or once in every round if a round has fewer than six
//! samples on the device. In a run with a single launch, the anchor is not run. With the anchor's times, runs
//! can be compared even if the machine's speed changed between the runs.

use super::plan::CurrentPlan;
use super::types::Record;
use crate::measure::{median_of, utilization, without_preempted};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap, HashSet};

/// A line of `anchors.jsonl`: one execution of the anchor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AnchorSample {
    /// The anchor's name. Anchors with equal names do the same work on comparable devices. Devices are comparable
    /// if they are equal in name, driver and settings, or if they are of one model and a run distributed its
    /// points over them.
    pub anchor: String,
    /// The device's name in records.
    pub device: String,
    /// The number of the launch in which the anchor was run. This number is unique in the folder of results.
    pub launch: u32,
    /// The number of the round (one sample of each point), counted from 0 in each launch.
    pub round: u32,
    /// The time at which this execution of the anchor kernel ended, in milliseconds since the first round of
    /// the launch began.
    pub at_ms: f64,
    /// The device time of this execution of the anchor kernel, in milliseconds.
    pub ms: f64,
    /// The time of this execution of the anchor kernel on the host's clock, in milliseconds; absent in files
    /// of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub host_ms: Option<f64>,
    /// The processor time that the process used for the anchor, in milliseconds; absent in files of earlier
    /// versions, and if the device is not a CPU.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub processor_ms: Option<f64>,
}

impl AnchorSample {
    /// Returns the ratio of the anchor's processor time to its elapsed time; `None` if a time is absent or the elapsed
    /// time is 0.
    fn utilization(&self) -> Option<f64> {
        utilization(self.processor_ms, self.host_ms?)
    }
}

/// The times of one anchor on one device, in some launches of a run.
pub(super) struct AnchorTimes<'a> {
    /// The anchor's name.
    pub name: &'a str,
    /// The name of the anchor's device.
    pub device: &'a str,
    /// The anchor's samples, except preempted samples (those during which other programs probably used the processors).
    /// If fewer than five samples of a launch would remain, the launch's five samples with the highest utilization
    /// remain. If the utilization of any sample is unknown, the list contains all samples.
    pub remaining: Vec<&'a AnchorSample>,
    /// The ratio of the anchor's processor time to its elapsed time; `None` if a sample lacks one of these
    /// times, or if an elapsed time is 0.
    pub utilization: Option<AnchorUtilization>,
}

/// The ratio of an anchor's processor time to its elapsed time. If other programs delay the anchor, the ratio
/// of its processor time to its elapsed time becomes smaller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AnchorUtilization {
    /// The median of the ratios of the remaining samples ([`AnchorTimes::remaining`]).
    pub remaining: f64,
    /// The ratio for all samples together, including the preempted samples. Other programs probably delay a point
    /// with long frames by about the same factor by which they delay all samples of the anchor together.
    pub overall: f64,
}

impl<'a> AnchorTimes<'a> {
    /// Returns one `AnchorTimes` for each pair of an anchor's name and a device's name. Only the samples of
    /// the given launches are included.
    pub(super) fn of_launches(launches: &HashSet<u32>, samples: &'a [AnchorSample]) -> Vec<Self> {
        let mut anchors: BTreeMap<(&str, &str), Vec<&AnchorSample>> = BTreeMap::new();
        for sample in samples.iter().filter(|sample| launches.contains(&sample.launch)) {
            anchors.entry((sample.anchor.as_str(), sample.device.as_str())).or_default().push(sample);
        }
        let of = |((name, device), all): ((&'a str, &'a str), Vec<&'a AnchorSample>)| {
            let remaining = without_preempted(&all, |sample| Some((sample.launch, sample.utilization()?)));
            let utilization = remaining.as_ref().and_then(|remaining| AnchorUtilization::of(&all, remaining));
            Self { name, device, remaining: remaining.unwrap_or(all), utilization }
        };
        anchors.into_iter().map(of).collect()
    }
}

impl AnchorUtilization {
    fn of(all: &[&AnchorSample], remaining: &[&AnchorSample]) -> Option<Self> {
        let total = |of: fn(&AnchorSample) -> Option<f64>| -> Option<f64> {
            all.iter().map(|sample| of(sample)).sum()
        };
        let overall = utilization(total(|sample| sample.processor_ms), total(|sample| sample.host_ms)?)?;
        let of_each: Vec<f64> = remaining.iter().filter_map(|sample| sample.utilization()).collect();
        Some(Self { remaining: median_of(&of_each)?, overall })
    }
}

/// Replaces the names of devices in the anchors' samples by the names in the plan (the list of a run's points).
/// `records` are records of the same folder, with the device names under which they were stored. A device's name
/// depends on the machine's other devices, so an earlier session may have used another name than the plan.
///
/// The plan has a device name for the key of each record that belongs to the plan. A sample gets the name that the plan
/// has for a record with the sample's launch and stored device name. If no record of the plan has this launch and this
/// name (for example, after an interrupted session), the sample gets the new name of another sample of the same
/// anchor. If no sample of the anchor has a new name, the sample keeps its name.
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
    let names = anchors.iter().filter_map(|anchor| Some((anchor.anchor.clone(), of_launch(anchor)?)));
    let of_name: HashMap<String, &str> = names.collect();
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
        // In each earlier session, the machine had only one device, which had the name "cpu". No record was
        // measured in launch 3.
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

    /// The utilization is the processor time divided by the time on the host's clock. The processor time includes the
    /// enqueueing of the kernel, but the device time does not.
    #[test]
    fn an_anchors_utilization_is_relative_to_the_time_on_the_hosts_clock() {
        let sample =
            AnchorSample { ms: 4.0, host_ms: Some(5.0), processor_ms: Some(10.0), ..AnchorSample::default() };
        let samples = vec![sample; 3];
        let anchors = AnchorTimes::of_launches(&HashSet::from([0]), &samples);
        assert_eq!(anchors[0].utilization, Some(AnchorUtilization { remaining: 2.0, overall: 2.0 }));
    }

    #[test]
    fn preempted_samples_of_an_anchor_are_left_out_and_count_only_in_its_overall_utilization() {
        let sample = |ms: f64| AnchorSample {
            ms,
            host_ms: Some(ms),
            processor_ms: Some(10.0),
            ..AnchorSample::default()
        };
        let mut samples = [vec![sample(5.0); 6], vec![sample(20.0); 3]].concat();
        let launches = HashSet::from([0]);
        let anchors = AnchorTimes::of_launches(&launches, &samples);
        let times: Vec<f64> = anchors[0].remaining.iter().map(|sample| sample.ms).collect();
        assert_eq!(times, [5.0; 6]);
        // The nine samples used 90 ms of processor time in 90 ms of elapsed time.
        assert_eq!(anchors[0].utilization, Some(AnchorUtilization { remaining: 2.0, overall: 1.0 }));
        // Files that earlier versions of raycl wrote have no processor times.
        samples[3].processor_ms = None;
        let anchors = AnchorTimes::of_launches(&launches, &samples);
        assert_eq!((anchors[0].remaining.len(), anchors[0].utilization), (9, None));
    }

    #[test]
    fn times_that_were_not_measured_are_absent_from_a_line() {
        let line = |sample: &AnchorSample| serde_json::to_value(sample).unwrap();
        let none = line(&AnchorSample::default());
        let has_no = |key: &str| none.get(key).is_none();
        assert!(has_no("host_ms") && has_no("processor_ms"), "{none}");
        let both =
            line(&AnchorSample { host_ms: Some(5.0), processor_ms: Some(10.0), ..AnchorSample::default() });
        assert_eq!([&both["host_ms"], &both["processor_ms"]], [5.0, 10.0]);
    }
}
