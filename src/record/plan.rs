//! `plan.json`: which records of a folder are the current run's, and what that run calls them.

use super::types::Record;
use super::write_whole;
use crate::error::{Error, Result};
use crate::reader;
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Its name in a folder of results.
const FILE: &str = "plan.json";

/// The points of the run that last began in a folder, in its order, each once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurrentPlan {
    /// The points.
    pub points: Vec<PlannedPoint>,
}

/// A point's key, and the names that do not decide it: an earlier record of the same key may have other ones.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlannedPoint {
    /// The record's key.
    pub key: String,
    /// The scene's name.
    pub scene: String,
    /// The scene's file.
    pub scene_file: Option<String>,
    /// The values set in it.
    #[serde(default)]
    pub scene_values: Vec<String>,
    /// The device's name.
    pub device: String,
    /// The strategy's name.
    pub name: String,
    /// The preset it is, if it is one.
    pub preset: Option<String>,
}

impl PlannedPoint {
    /// The point of a record.
    pub fn of(record: &Record) -> Self {
        let Record { key, scene, scene_file, scene_values, device, name, preset, .. } = record.clone();
        Self { key, scene, scene_file, scene_values, device, name, preset }
    }

    /// Gives a record the names of the plan.
    fn name(&self, record: &mut Record) {
        let Self { key: _, scene, scene_file, scene_values, device, name, preset } = self.clone();
        (record.scene, record.scene_file, record.scene_values) = (scene, scene_file, scene_values);
        (record.device, record.name, record.preset) = (device, name, preset);
    }
}

impl CurrentPlan {
    /// The plan whose points begin as these records.
    pub fn of<'a>(drafts: impl IntoIterator<Item = &'a Record>) -> Self {
        let mut seen = HashSet::new();
        let drafts = drafts.into_iter().filter(|record| seen.insert(record.key.clone()));
        Self { points: drafts.map(PlannedPoint::of).collect() }
    }

    /// Keeps it in a folder, in the place of the one before.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self).map_err(|error| Error::fault(error.to_string()))?;
        write_whole(&folder.join(FILE), format!("{text}\n").as_bytes())
    }

    /// That of a folder; none where it has none, as folders of raycl before 0.2 and those put together by hand.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(None);
        }
        let unreadable = |error: &dyn std::fmt::Display| {
            Error::input(format!("cannot read {}: {error}", path.display())).with_help(
                "`raycl run --resume` writes it anew; without it the latest record of each point is shown",
            )
        };
        let text = reader::bytes(&path, reader::Kind::Results).map_err(|error| unreadable(&error))?;
        serde_json::from_slice(&text).map(Some).map_err(|error| unreadable(&error))
    }

    /// The plan's records in its order and by its names, of records by key; and how many points have none yet.
    pub fn pick(&self, mut records: HashMap<String, Record>) -> (Vec<Record>, usize) {
        let named = |point: &PlannedPoint| {
            let mut record = records.remove(&point.key)?;
            point.name(&mut record);
            Some(record)
        };
        let picked: Vec<_> = self.points.iter().filter_map(named).collect();
        let missing = self.points.len() - picked.len();
        (picked, missing)
    }
}
