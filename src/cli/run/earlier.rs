//! Predicts how long a run will take, from the records of earlier runs.

use crate::error::Result;
use crate::experiment::{Expected, Run};
use crate::record::{Record, read_lines};
use std::path::{Path, PathBuf};

/// Returns the expected duration of the run, from earlier records of points with the same names or strategies. `done`
/// contains this run's records so far. The points in `done` are not measured again, except failed points with
/// `--retry-failed`.
pub fn foreseen(run: &Run<'_>, out: &Path, done: &[Record]) -> Result<Expected> {
    let done: Vec<String> = done
        .iter()
        .filter(|record| !run.retry_failed || record.outcome.is_fine())
        .map(|record| record.key.clone())
        .collect();
    run.expected(&earlier(out), &done)
}

/// Returns the records in a folder of results and in its sibling folders, those of the latest journal last.
/// Unreadable journals are ignored.
pub fn earlier(out: &Path) -> Vec<Record> {
    let beside = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folders = std::fs::read_dir(beside).into_iter().flatten().flatten();
    let mut journals: Vec<PathBuf> =
        folders.map(|entry| entry.path().join("records.jsonl")).filter(|file| file.is_file()).collect();
    journals.sort_by_key(|file| file.metadata().and_then(|data| data.modified()).ok());
    journals.iter().filter_map(|file| read_lines::<Record>(file).ok()).flat_map(|read| read.lines).collect()
}
