//! A folder of results as a report reads it.

use crate::error::{Error, Result};
use crate::record::{Record, ordinary, read_lines};
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// The records of a run, and where and how it was made.
#[derive(Clone, Debug, Default)]
pub struct Folder {
    /// Where it lies.
    pub path: PathBuf,
    /// What a report calls it: the folder's name.
    pub label: String,
    /// Its records; where a key comes twice, the later one.
    pub records: Vec<Record>,
    /// `environment.json` as it is, so that what a newer raycl wrote is shown too; null where there is none.
    pub environment: Value,
    /// What is to be said of the reading, such as a line that a crash cut short.
    pub notes: Vec<String>,
}

impl Folder {
    /// Reads a folder. One without records is the user's mistake.
    pub fn read(path: &Path) -> Result<Self> {
        let records_path = path.join("records.jsonl");
        if !records_path.is_file() {
            let error =
                Error::input(format!("{} holds no results: records.jsonl is missing", path.display()));
            return Err(error.with_help("name a folder that `raycl run` wrote, such as results/quick"));
        }
        let lines = read_lines::<Record>(&records_path)?;
        let mut notes = Vec::new();
        if lines.torn {
            notes.push("The last record was cut short by a crash and is left out.".to_owned());
        }
        let environment = path.join("environment.json");
        let environment = ordinary(&environment).and_then(|()| std::fs::read(environment)).ok();
        let environment = environment.and_then(|text| serde_json::from_slice(&text).ok());
        if environment.is_none() {
            notes.push(
                "environment.json is missing or cannot be read: what the run depended on is unknown.".into(),
            );
        }
        Ok(Self {
            path: path.to_owned(),
            label: label(path),
            records: latest(lines.lines, |record| record.key.clone()),
            environment: environment.unwrap_or_default(),
            notes,
        })
    }

    /// The machine and devices it was made with, as one text.
    fn machine(&self) -> String {
        format!("{}{}", self.environment["host"], self.environment["devices"])
    }

    /// A value of the config that the run was made with.
    pub fn config(&self, key: &str) -> Option<String> {
        let table: toml::Table = toml::from_str(self.environment["config"].as_str()?).ok()?;
        Some(table.get(key)?.as_str()?.to_owned())
    }
}

fn label(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    whole.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// The last record of every name, in the order in which names first came.
fn latest(records: Vec<Record>, name: impl Fn(&Record) -> String) -> Vec<Record> {
    let mut places: HashMap<String, usize> = HashMap::new();
    let mut kept: Vec<Record> = Vec::new();
    for record in records {
        let name = name(&record);
        match places.get(&name) {
            Some(&place) => kept[place] = record,
            None => {
                places.insert(name, kept.len());
                kept.push(record);
            }
        }
    }
    kept
}

/// The records of all folders. Where two folders measured the same point with another driver, machine or program,
/// the devices of each get the folder's label, so that they stand side by side instead of mixed. The same thing
/// measured twice is one point: the later folder's.
pub fn merged(folders: &[Folder]) -> Vec<Record> {
    let mut seen: HashMap<String, String> = HashMap::new();
    let mut clashing: HashSet<&str> = HashSet::new();
    for folder in folders {
        for record in &folder.records {
            let how = format!("{}{:?}", folder.machine(), record.program_hash);
            let other = seen.insert(point(record), how.clone());
            if other.is_some_and(|other| other != how) {
                clashing.insert(&record.device);
            }
        }
    }
    let relabelled = |folder: &Folder, record: &Record| {
        let mut record = record.clone();
        if clashing.contains(record.device.as_str()) && !record.is_baseline() {
            record.device = format!("{} ({})", record.device, folder.label);
        }
        record
    };
    let all =
        folders.iter().flat_map(|folder| folder.records.iter().map(|record| relabelled(folder, record)));
    latest(all.collect(), point)
}

/// What two records of the same point share.
pub fn point(record: &Record) -> String {
    format!(
        "{}|{}|{:?}|{}|{:?}",
        record.scene, record.device, record.image_size, record.name, record.local_size
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(label: &str, driver: &str) -> Folder {
        let record = |key: &str, device: &str| Record {
            key: format!("{label} {key}"),
            scene: "teapot".into(),
            device: device.into(),
            ..Record::default()
        };
        Folder {
            label: label.into(),
            records: vec![record("a", "gpu"), record("b", "host")],
            environment: serde_json::json!({"devices": [{"device": "gpu", "driver": driver}]}),
            ..Folder::default()
        }
    }

    #[test]
    fn the_same_point_on_another_driver_stands_side_by_side() {
        let devices = |folders: &[Folder]| -> Vec<String> {
            merged(folders).into_iter().map(|record| record.device).collect()
        };
        assert_eq!(devices(&[folder("old", "1"), folder("new", "2")]), ["gpu (old)", "host", "gpu (new)"]);
        assert_eq!(devices(&[folder("old", "1"), folder("new", "1")]), ["gpu", "host"]);
    }

    #[test]
    fn a_folder_without_records_is_a_mistake_that_names_it() {
        let error = Folder::read(Path::new("/nonexistent/x")).expect_err("it is not there");
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("/nonexistent/x"));
    }
}
