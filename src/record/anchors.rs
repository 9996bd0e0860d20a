//! `anchors.jsonl`: times of the anchor, the fixed kernel that is timed in every round. With them, runs can
//! be compared even if the machine's speed changed between them.

use serde::{Deserialize, Serialize};

/// A line of the file: one run of the anchor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AnchorSample {
    /// The anchor's name; equal names mean the same work on the same device.
    pub anchor: String,
    /// The device's name in records.
    pub device: String,
    /// The launch's number in the folder.
    pub launch: u32,
    /// The launch's round, counted from 0.
    pub round: u32,
    /// When it ended, in milliseconds since the launch's rounds began.
    pub at_ms: f64,
    /// The device time.
    pub ms: f64,
}
