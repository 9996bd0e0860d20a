//! The names of the journals and other files in a folder of results. Each journal contains one JSON object
//! per line.

/// The journal of records; a record is the result of one point of the experiment.
pub const RECORDS: &str = "records.jsonl";
/// The journal of samples (single measured times of points), in the order in which they were measured.
pub const SAMPLES: &str = "samples.jsonl";
/// The journal of complete launches: those that a stopping rule ended.
pub const LAUNCHES: &str = "launches.jsonl";
/// The journal of the machine's load during the rounds.
pub const ROUNDS: &str = "rounds.jsonl";
/// The journal of the times of anchors (kernels that never change).
pub const ANCHORS: &str = "anchors.jsonl";
/// The journal of the records that serve only to compare the blocks of a plan. They are records of control points
/// (points that every block measures).
pub const CONTROLS: &str = "controls.jsonl";
/// The file with the plan of an experiment that is divided into shards.
pub const SHARDS: &str = "shards.json";
/// The file that describes the machine, the drivers and the run's inputs.
pub const ENVIRONMENT: &str = "environment.json";
/// The summary of the records in Markdown.
pub const SUMMARY: &str = "summary.md";
/// The folder of the saved pictures, such as those that the points cast.
pub const IMAGES: &str = "images";

/// The beginning of the name of a file that describes the machine and inputs of an earlier session.
const EARLIER_ENVIRONMENT: &str = "environment-";

/// Returns the name of the file that describes the machine and inputs of an earlier session of the run. The
/// first session in a folder has the number 1.
pub fn earlier_environment(number: usize) -> String {
    format!("{EARLIER_ENVIRONMENT}{number}.json")
}

/// Returns true if `name` is a file name that [`earlier_environment`] returns for some number.
pub fn is_earlier_environment(name: &str) -> bool {
    let number = name.strip_prefix(EARLIER_ENVIRONMENT).and_then(|rest| rest.strip_suffix(".json"));
    number.and_then(|number| number.parse().ok()).is_some_and(|number| name == earlier_environment(number))
}
