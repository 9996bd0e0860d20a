//! A sample of a point, and how a line of `samples.jsonl` stores it.

use crate::launch::FrameTimes;
use crate::measure::utilization;
use crate::record::{Record, Sample};

/// A sample: the launch in which it was taken, the moment at which it was taken, and its times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// The launch's number in the folder of results.
    pub launch: u32,
    /// Milliseconds since the launch's rounds began.
    pub at_ms: f64,
    /// The core-to-core latency around the sample in nanoseconds; `None` if the latency was not measured.
    pub core_to_core_ns: Option<f64>,
    /// The times of one frame of the sample. If the sample is a batch of frames, these are means over the
    /// batch.
    pub times: FrameTimes,
}

impl Taken {
    /// Returns the ratio of the sample's processor time to its elapsed time; `None` if the processor time is unknown or
    /// the elapsed time is 0.
    pub(super) fn utilization(&self) -> Option<f64> {
        utilization(self.times.processor_ms, self.times.host_ms)
    }

    /// Returns the line of `samples.jsonl` that stores the sample. `record` is the record of the sample's point so far,
    /// and `round` is the number of the sample's round in the launch. `measured_by` is the UUID or the PCI address of
    /// the point's device, if points are distributed over several devices of the same model and the UUID or the address
    /// is known.
    pub(super) fn to_sample(self, record: &Record, round: u32, measured_by: Option<&str>) -> Sample {
        let times = self.times;
        Sample {
            key: record.key.clone(),
            launch: self.launch,
            round,
            at_ms: Some(self.at_ms),
            ms: times.frame_ms,
            primary_ms: times.primary_ms,
            shadow_ms: times.shadow_ms,
            shade_ms: times.shade_ms,
            host_ms: Some(times.host_ms),
            processor_ms: times.processor_ms,
            core_to_core_ns: self.core_to_core_ns,
            batch: times.batch,
            sensed: times.sensed,
            measured_on: record.measured_on.clone(),
            measured_by: measured_by.map(str::to_owned),
            origin: None,
        }
    }

    /// Returns the sample that a line of `samples.jsonl` stores.
    pub(super) fn of_sample(sample: &Sample) -> Self {
        let times = FrameTimes {
            frame_ms: sample.ms,
            primary_ms: sample.primary_ms,
            shadow_ms: sample.shadow_ms,
            shade_ms: sample.shade_ms,
            host_ms: sample.host_ms.unwrap_or(sample.ms),
            processor_ms: sample.processor_ms,
            batch: sample.batch,
            sensed: sample.sensed,
        };
        // Samples of earlier versions of raycl state only the round in which they were taken, not the time.
        let at_ms = sample.at_ms.unwrap_or(f64::from(sample.round));
        Self { launch: sample.launch, at_ms, core_to_core_ns: sample.core_to_core_ns, times }
    }
}
