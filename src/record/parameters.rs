//! Converts a record's local size and strategy to tuning parameters, for files that auto-tuners read.

use serde_json::{Map, Value};

use super::axes::axes;
use super::types::Record;

/// Returns the names and values of a record's tuning parameters. These are the record's local size (1 x 1 if the
/// record has none) and its value on every axis. If the run compares two kernel folders, a further parameter is the
/// label of the folder from which the record's kernels come. Dots replace the commas in values, since commas
/// separate the values in the keys of Kernel Tuner's cache files.
pub fn parameters(record: &Record) -> Map<String, Value> {
    let mut parameters = Map::new();
    let [across, down] = record.local_size.unwrap_or([1, 1]);
    parameters.insert("block_size_x".into(), across.into());
    parameters.insert("block_size_y".into(), down.into());
    for (axis, value) in axes(&record.strategy) {
        let value = value.parse::<u32>().map_or_else(|_| Value::from(value.replace(',', ".")), Value::from);
        parameters.insert(axis.to_owned(), value);
    }
    if let Some(kernels) = &record.kernels_of {
        parameters.insert("kernels".into(), kernels.replace(',', ".").into());
    }
    parameters
}

/// Joins the parameters' values with commas into one key, in the order of `names`. A parameter that is
/// missing from `parameters` has an empty text in the key.
pub fn joined(parameters: &Map<String, Value>, names: &[String]) -> String {
    let text = |name: &String| match parameters.get(name) {
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
        None => String::new(),
    };
    names.iter().map(text).collect::<Vec<_>>().join(",")
}
