//! One sample's line. `docs/format.md` documents every field.

use crate::sensor::SensorReading;
use serde::{Deserialize, Serialize};

/// One timed frame: a line of `samples.jsonl`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// The point's key.
    pub key: String,
    /// The launch it was taken in, by its number in the folder; files of earlier versions are one launch.
    #[serde(default)]
    pub launch: u32,
    /// The launch's round, from 0.
    pub round: u32,
    /// When it was taken, since the launch's rounds began.
    #[serde(default)]
    pub at_ms: Option<f64>,
    /// The frame's device time.
    pub ms: f64,
    /// Its primary pass, where passes are separate.
    pub primary_ms: Option<f64>,
    /// Its shadow pass, where passes are separate; it shades too, where `shade_ms` is none.
    pub shadow_ms: Option<f64>,
    /// Its shading pass, where it is apart from shadow rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shade_ms: Option<f64>,
    /// The host's clock around it.
    pub host_ms: Option<f64>,
    /// Frames that these times are the mean of, cast in one batch; none for a frame alone.
    #[serde(default)]
    pub batch: Option<u32>,
    /// What the device's sensors showed meanwhile.
    #[serde(default)]
    pub sensed: Option<SensorReading>,
    /// The attempt and launch that took it, where an attempt goes on with what another one took.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
}
