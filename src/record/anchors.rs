//! `anchors.jsonl`: what the fixed kernel took that is timed beside points, so that runs can be compared whose machine changed.

use serde::{Deserialize, Serialize};

/// A line: the anchor was run once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AnchorSample {
    /// The anchor's name: equal where the same work was done by the same device.
    pub anchor: String,
    /// The device it was run on, as records call it.
    pub device: String,
    /// The launch's number in the folder.
    pub launch: u32,
    /// The launch's round, from 0.
    pub round: u32,
    /// When it ended, since the launch's rounds began.
    pub at_ms: f64,
    /// The device time.
    pub ms: f64,
}
