//! `anchors.jsonl`: times of the anchor, a fixed kernel that each device runs once for every six samples of its points,
//! or once for every round of fewer samples. These times make runs comparable even if the machine's speed changed
//! between the runs.

use serde::{Deserialize, Serialize};

/// A line of `anchors.jsonl`: one execution of the anchor.
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
    /// When the anchor ended, in milliseconds since the launch's rounds began.
    pub at_ms: f64,
    /// The anchor's device time in milliseconds.
    pub ms: f64,
}
