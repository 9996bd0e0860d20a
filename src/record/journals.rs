//! The names of the journals in a folder of results. Each journal contains one JSON object per
//! line.

/// The journal of records, which are the results of the points.
pub const RECORDS: &str = "records.jsonl";
/// The journal of samples, which are the single times of each point, in the order in which they
/// were measured.
pub const SAMPLES: &str = "samples.jsonl";
/// The journal of the machine's load during the rounds.
pub const ROUNDS: &str = "rounds.jsonl";
/// The journal of the anchor's times.
pub const ANCHORS: &str = "anchors.jsonl";
/// The journal of records of control points that were measured only to make blocks of a plan comparable.
pub const CONTROLS: &str = "controls.jsonl";
