//! Defines a line of `samples.jsonl`. `docs/format.md` documents every field of the line.

use crate::sensor::SensorReading;
use serde::{Deserialize, Serialize};

/// One timed frame, or the mean of a batch of frames. Times are in milliseconds. An optional value is null or
/// absent if the value was not measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// The key of the point whose time was measured.
    pub key: String,
    /// The launch's number in the folder; 0 if an early version of raycl, which stored no launch, wrote the line.
    #[serde(default)]
    pub launch: u32,
    /// The round of the launch in which the sample was taken, counted from 0.
    pub round: u32,
    /// When the sample was measured, in milliseconds since the launch's rounds began.
    #[serde(default)]
    pub at_ms: Option<f64>,
    /// The frame's device time; for a baseline, the time on the host's clock.
    pub ms: f64,
    /// Device time of the frame's primary pass, if passes are separate.
    pub primary_ms: Option<f64>,
    /// Time of the frame's shadow pass, if passes are separate. The shadow pass includes shading if
    /// `shade_ms` is null.
    pub shadow_ms: Option<f64>,
    /// Time of the frame's shading pass, if the strategy has a shading pass. With fused passes, the shading pass
    /// may also cast leftover shadow rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shade_ms: Option<f64>,
    /// The time of the frame by the host's clock.
    pub host_ms: Option<f64>,
    /// The processor time that the process used for the frame; absent if the frame was cast by a device
    /// other than a CPU.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub processor_ms: Option<f64>,
    /// The core-to-core latency in nanoseconds. raycl reads the latency before and after the frame. If one reading
    /// is outside the range in which samples count, the value is this reading. If both readings are outside the
    /// range, the value is the earlier reading; if neither is, the value is the larger reading. If the frame ended
    /// less than 20 ms after the reading before it, raycl takes no new reading, and the value is the reading before
    /// the frame. Absent if the latency was not measured, and in copied lines (see `origin`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub core_to_core_ns: Option<f64>,
    /// Number of frames in the batch, if these times are means over a batch; null for a single
    /// frame.
    #[serde(default)]
    pub batch: Option<u32>,
    /// Readings of the device's sensors during the frame.
    #[serde(default)]
    pub sensed: Option<SensorReading>,
    /// The device that measured the sample, if points were distributed over several devices of the same model; absent
    /// for a baseline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured_on: Option<String>,
    /// The UUID of the device that measured the sample or, if the UUID is unknown, the device's PCI address.
    /// Absent if `measured_on` is absent. In another session, the name in `measured_on` may belong to another
    /// device, but the identifier always belongs to the same device.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured_by: Option<String>,
    /// If this line is a copy in the folder of a later attempt: the attempt and the launch that measured the
    /// sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
}
