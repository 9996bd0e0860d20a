//! What was found: one flat record a point, kept as JSON lines, and the
//! summaries that are made of nothing but records.

mod environment;
mod journal;
mod kernel_tuner;
mod markdown;
mod numbers;
mod parameters;
mod spreadsheet;
mod summary;
mod t4;
mod terminal;
mod types;
mod whole;

pub use environment::{DeviceEnvironment, Environment, Host};
pub use journal::{JsonLines, Lines, read_lines};
pub use kernel_tuner::kernel_tuner_caches;
pub use markdown::summary_markdown;
pub(crate) use numbers::{by, duration, ms, significant};
pub use spreadsheet::summary_csv;
#[cfg(test)]
pub(crate) use summary::tests as fixtures;
pub use summary::{Group, groups};
pub(crate) use summary::{interval, median};
pub use t4::t4_results;
pub use terminal::summary_terminal;
pub(crate) use terminal::word;
pub use types::{HOST, Outcome, Record, Sample};
pub use whole::{TEMPORARY_PREFIX, ordinary, own_file, own_folder, sync_folder, write_page, write_whole};
