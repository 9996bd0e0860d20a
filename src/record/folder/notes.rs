//! Writes the notes that raycl shows with the results of a folder.

use super::MERGE;
use crate::reader;
use crate::record::hosts::hosts_that_differ;
use crate::record::revision::{DIRTY, is_dirty};
use crate::record::rounds::{RoundLoad, disturbance, moved_processors, preempted};
use crate::record::smallest_difference::{apart_note, how_sure};
use crate::record::types::Record;
use crate::record::verification::hardly_verified_images;
use serde_json::Value;
use std::collections::HashSet;
use std::path::Path;

/// The note on an incomplete last line of a folder's journal of records.
pub(super) const TORN: &str = "The last record is incomplete, for example because raycl was killed while it wrote the record. The record is left out; `raycl run --resume` measures the record's point again.";
/// The note on a folder without a readable `environment.json`.
pub(super) const NO_ENVIRONMENT: &str =
    "environment.json is missing or cannot be read, so the machine and the drivers of the run are unknown.";

/// Returns notes on the certainty of the times and images. The notes say how small a difference between two
/// points can be shown, whether points of a group were measured apart, which machines differ in speed, what
/// disturbed the measurement, and how many images were hardly verified.
pub(super) fn certainty(records: &[Record], controls: &[Record], rounds: &[RoundLoad]) -> Vec<String> {
    let mut notes = how_sure(records);
    notes.extend(apart_note(records));
    notes.extend(hosts_that_differ(records, controls));
    notes.extend(disturbance(rounds, records));
    notes.extend(hardly_verified_images(records));
    notes.extend(preempted(records));
    if hosts(records) <= 1 {
        // The core-to-core latencies of different machines are not compared: between machines, these
        // latencies differ even if no virtual machine's processors were moved to other cores.
        notes.extend(moved_processors(rounds, records));
    }
    notes
}

/// Returns the number of machines on which the records were measured; 0 if the records name no machine.
fn hosts(records: &[Record]) -> usize {
    records.iter().flat_map(Record::hosts).collect::<HashSet<_>>().len()
}

/// Returns the notes that `raycl merge` stored in a folder; empty if the folder has no readable `merge.json`.
pub(super) fn of_merge(folder: &Path) -> Vec<String> {
    let merge: Option<Value> = reader::bytes(&folder.join(MERGE), reader::Kind::Results)
        .ok()
        .and_then(|text| serde_json::from_slice(&text).ok());
    merge.map(|merge| texts(&merge["notes"])).unwrap_or_default()
}

/// Returns the notes on the run's config in `environment` (the contents of `environment.json`).
pub(super) fn of_config(environment: Option<&Value>) -> Vec<String> {
    environment.map(|environment| texts(&environment["config_notes"])).unwrap_or_default()
}

/// Returns the texts in a list; empty if `list` is no list.
fn texts(list: &Value) -> Vec<String> {
    let elements = list.as_array().into_iter().flatten();
    elements.filter_map(|element| element.as_str().map(str::to_owned)).collect()
}

/// Returns a note on the records that come from a raycl program built from uncommitted sources. No commit
/// contains these sources, so the program cannot be built again. For a record without a revision, the revision in
/// `environment` (the contents of `environment.json`) decides. Returns `None` if no record is known to come
/// from a program built from uncommitted sources.
pub(super) fn dirty(records: &[Record], environment: Option<&Value>) -> Option<String> {
    let revision = environment.and_then(|environment| environment["git_revision"].as_str());
    let of = |record: &Record| record.revision.as_deref().or(revision).is_some_and(is_dirty);
    let count = records.iter().filter(|record| of(record)).count();
    (count > 0).then(|| format!("{count} of {} records come from {}.", records.len(), DIRTY))
}
