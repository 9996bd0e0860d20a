//! Defines a line of `launches.jsonl`. `docs/format.md` documents every field of a line of `launches.jsonl`.

use crate::measure::StopReason;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The end of a complete launch: a stopping rule ended the sampling of all points that did not fail. A launch that
/// was interrupted, or that lost a worker process, has no line in `launches.jsonl`. If a worker process was lost,
/// the same session repeats the launch; a later session repeats an interrupted launch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LaunchEnd {
    /// The launch's number, which is unique in the folder of results.
    pub launch: u32,
    /// The rule that ended the sampling in this launch.
    pub stop_reason: StopReason,
    /// For each point that did not fail: the point's key and its number of samples.
    pub samples: BTreeMap<String, usize>,
}
