//! What was found: one flat record a point, kept as JSON lines, and the
//! summaries that are made of nothing but records.

mod environment;
mod journal;
mod markdown;
mod numbers;
mod spreadsheet;
mod summary;
mod terminal;
mod types;

pub use environment::{DeviceEnvironment, Environment, Host};
pub use journal::{JsonLines, Lines, read_lines};
pub use markdown::summary_markdown;
pub use spreadsheet::summary_csv;
pub use summary::{Group, groups};
pub use terminal::summary_terminal;
pub use types::{HOST, Outcome, Record, Sample};
