//! The names of the journals in a folder of results. Each holds one JSON object per line.

/// The journal of records: what was measured at each point.
pub const RECORDS: &str = "records.jsonl";
/// The journal of samples: single times of each point, in the order taken.
pub const SAMPLES: &str = "samples.jsonl";
/// The journal of rounds, with the machine's load in each.
pub const ROUNDS: &str = "rounds.jsonl";
/// The journal of the anchor's times.
pub const ANCHORS: &str = "anchors.jsonl";
/// The journal of control points, by which blocks of a plan are compared.
pub const CONTROLS: &str = "controls.jsonl";
