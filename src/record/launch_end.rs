//! Defines a line of `launches.jsonl`. `docs/format.md` documents every field of a line of `launches.jsonl`.

use crate::measure::StopReason;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The end of a launch in which all points got enough samples. A launch that was interrupted, or that lost a
/// worker process, has no line in `launches.jsonl`, and a later session repeats such a launch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LaunchEnd {
    /// The launch's number, which is unique in the folder of results.
    pub launch: u32,
    /// The rule because of which no further samples were taken in this launch.
    pub stop_reason: StopReason,
    /// For each point that did not fail: the point's key and its number of samples.
    pub samples: BTreeMap<String, usize>,
}
