//! A line of `samples.jsonl`. `docs/format.md` documents every field.

use crate::sensor::SensorReading;
use serde::{Deserialize, Serialize};

/// One timed frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// The point's key.
    pub key: String,
    /// The launch's number in the folder; files of earlier versions have a single launch.
    #[serde(default)]
    pub launch: u32,
    /// The launch's round, counted from 0.
    pub round: u32,
    /// When it was taken, in milliseconds since the launch's rounds began.
    #[serde(default)]
    pub at_ms: Option<f64>,
    /// The frame's device time.
    pub ms: f64,
    /// Time of its primary pass, if passes are separate.
    pub primary_ms: Option<f64>,
    /// Time of its shadow pass, if passes are separate; it includes shading if `shade_ms` is null.
    pub shadow_ms: Option<f64>,
    /// Time of its shading pass, if it is separate from shadow rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shade_ms: Option<f64>,
    /// Time on the host's clock.
    pub host_ms: Option<f64>,
    /// Number of frames in one batch of which these times are the mean; null for a single frame.
    #[serde(default)]
    pub batch: Option<u32>,
    /// Readings of the device's sensors during the frame.
    #[serde(default)]
    pub sensed: Option<SensorReading>,
    /// The attempt and launch that took it, if an attempt continues an earlier one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
}
