//! A line of `launches.jsonl`. `docs/format.md` documents every field.

use crate::measure::StopReason;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The end of a launch whose points had enough samples. A launch that was interrupted, or that lost a worker
/// process, has no line, and a later session repeats this launch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LaunchEnd {
    /// The launch's number in the folder.
    pub launch: u32,
    /// The rule that ended the sampling.
    pub stop_reason: StopReason,
    /// For each point that did not fail: the point's key and its number of samples.
    pub samples: BTreeMap<String, usize>,
}
