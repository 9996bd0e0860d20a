//! Reads and writes `plan.json`. This file says which records of a folder belong to the current run. The file
//! also contains the names of the scenes, devices and strategies of these records in that run.

use super::types::Record;
use super::write_json;
use crate::error::{Error, Result};
use crate::existing;
use crate::reader;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::Path;

/// The file name of the plan in a folder of results.
const FILE: &str = "plan.json";

/// The points of the latest run in a folder, in the run's order and without repetitions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurrentPlan {
    /// The points of the experiment that the run measures.
    pub points: Vec<PlannedPoint>,
}

/// A point's key, and the point's names and notes, which are not part of the key. A record of an earlier run may
/// have the same key but other names and notes; raycl then shows the record with the names and notes of the
/// planned point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlannedPoint {
    /// The key that the point's record has.
    pub key: String,
    /// The scene's name.
    pub scene: String,
    /// The path of the scene's file.
    pub scene_file: Option<String>,
    /// The values that the config changes in the scene.
    #[serde(default)]
    pub scene_values: Vec<String>,
    /// Notes on the scene. Plans of earlier versions of raycl do not have this field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_notes: Option<Vec<String>>,
    /// The device's name.
    pub device: String,
    /// The strategy's name.
    pub name: String,
    /// The preset's name; null for a baseline, if an axis differs from the preset, and if two folders of
    /// kernels are compared.
    pub preset: Option<String>,
    /// The label of the folder of the point's kernels, if two folders of kernels are compared. Plans of earlier
    /// versions of raycl do not have this field.
    #[serde(default)]
    pub kernels_of: Option<String>,
}

impl PlannedPoint {
    /// Returns the planned point that has a record's key, names and notes.
    pub fn of(record: &Record) -> Self {
        let Record { key, scene, scene_file, scene_values, device, name, preset, kernels_of, .. } =
            record.clone();
        let scene_notes = Some(record.scene_notes.clone());
        Self { key, scene, scene_file, scene_values, scene_notes, device, name, preset, kernels_of }
    }

    /// Replaces a record's names and notes by the names and notes of this planned point. The notes on a
    /// scene may differ between runs although the scene is the same, since the notes also name other scenes
    /// with the same content.
    fn name(&self, record: &mut Record) {
        let Self { key: _, scene, scene_file, scene_values, scene_notes, device, name, preset, kernels_of } =
            self.clone();
        if let Some(notes) = scene_notes {
            record.scene_notes = notes;
        }
        // A plan of an earlier version of raycl does not name the folder of kernels. The point's name
        // contains the label of the folder, so a record with the same name has kernels of the same folder.
        if kernels_of.is_some() || record.name != name {
            record.kernels_of = kernels_of;
        }
        (record.scene, record.scene_file, record.scene_values) = (scene, scene_file, scene_values);
        (record.device, record.name, record.preset) = (device, name, preset);
    }
}

impl CurrentPlan {
    /// Creates the plan from drafts, which are the records of points that have not been measured yet. Of several drafts
    /// with the same key, only the first is used.
    pub fn of<'a>(drafts: impl IntoIterator<Item = &'a Record>) -> Self {
        let mut seen = HashSet::new();
        let drafts = drafts.into_iter().filter(|record| seen.insert(record.key.clone()));
        Self { points: drafts.map(PlannedPoint::of).collect() }
    }

    /// Writes the plan to a folder, and replaces the folder's previous plan.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join(FILE), self)
    }

    /// Returns true if a folder has a plan (`plan.json`).
    pub fn is_in(folder: &Path) -> bool {
        folder.join(FILE).is_file()
    }

    /// Reads the plan of a folder. Returns `None` if the folder has no plan: early versions of raycl stored none.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(FILE);
        if !existing::exists(&path)? {
            return Ok(None);
        }
        let unreadable = |error: &dyn std::fmt::Display| {
            Error::input(format!("cannot read {}: {error}", path.display())).with_help(
                "write this file again with the command that wrote the folder (`raycl run --resume`, `raycl \
                 reproduce --resume` or `raycl merge`), or delete the file: raycl then shows the latest \
                 record of each point",
            )
        };
        let text = reader::bytes(&path, reader::Kind::Plan).map_err(|error| unreadable(&error))?;
        serde_json::from_slice(&text).map(Some).map_err(|error| unreadable(&error))
    }

    /// Returns a map from the key of each point to the name of the point's device.
    pub fn devices(&self) -> HashMap<&str, &str> {
        self.points.iter().map(|point| (point.key.as_str(), point.device.as_str())).collect()
    }

    /// Returns the name that this plan gives to a device which other plans or records call `name`. `points`
    /// comes from these other plans or records, and contains the key and the device's name of each of their
    /// points. Returns `None` if the keys of the points on the device `name` belong to no device of this
    /// plan, or to several devices.
    pub fn device_called<'a>(
        &self,
        name: &str,
        points: impl Iterator<Item = (&'a str, &'a str)>,
    ) -> Option<&str> {
        let devices = self.devices();
        let own = points.filter(|(_, device)| *device == name).filter_map(|(key, _)| devices.get(key));
        let names: BTreeSet<&str> = own.copied().collect();
        names.first().copied().filter(|_| names.len() == 1)
    }

    /// Returns a record with the plan's names and notes; `None` if the record's key is not in the plan.
    pub fn named(&self, mut record: Record) -> Option<Record> {
        self.points.iter().find(|point| point.key == record.key)?.name(&mut record);
        Some(record)
    }

    /// Returns the records that belong to the plan, in the plan's order and with the plan's names,
    /// and the number of points without a record. `records` maps keys to records.
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_plan_that_cannot_be_read_is_reported_with_each_command_that_writes_it_again() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(FILE), "rubbish").unwrap();
        let error = CurrentPlan::read(folder.path()).unwrap_err();
        assert!(error.to_string().starts_with("cannot read ") && error.exit_code() == 2, "{error}");
        for command in ["raycl run --resume", "raycl reproduce --resume", "raycl merge"] {
            assert!(error.remedy().contains(&format!("`{command}`")), "{}", error.remedy());
        }
    }

    /// raycl writes plans of any size. Here, zeros follow a small plan, and the parser stops at the first zero.
    #[test]
    fn a_plan_is_read_whatever_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        std::fs::write(&path, "{\"points\":[]}").unwrap();
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len((64 << 20) + 1).unwrap();
        let error = CurrentPlan::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("trailing characters"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_plan_that_cannot_be_found_does_not_count_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(CurrentPlan::read(folder.path()).unwrap(), None);
        let path = folder.path().join(FILE);
        std::os::unix::fs::symlink(&path, &path).unwrap();
        assert!(CurrentPlan::read(folder.path()).is_err(), "the link leads to itself");
    }

    #[test]
    fn a_device_whose_points_are_on_several_devices_of_the_plan_is_none_of_them() {
        let on =
            |key: &str, device: &str| Record { key: key.into(), device: device.into(), ..Record::default() };
        let plan = CurrentPlan::of(&[on("a", "gpu 1"), on("b", "gpu 2"), on("c", "gpu 1")]);
        for (points, expected) in [
            (&[("a", "gpu"), ("c", "gpu"), ("b", "other")][..], Some("gpu 1")),
            (&[("b", "gpu"), ("unknown", "gpu")], Some("gpu 2")),
            (&[("a", "gpu"), ("b", "gpu")], None),
            (&[("a", "other"), ("unknown", "gpu")], None),
        ] {
            assert_eq!(plan.device_called("gpu", points.iter().copied()), expected, "{points:?}");
        }
    }

    #[test]
    fn a_record_gets_every_name_and_note_of_the_plan_and_keeps_its_measurements() {
        let planned = Record {
            key: "k".into(),
            scene: "room".into(),
            scene_file: Some("room.toml".into()),
            scene_values: vec!["a = 1".into()],
            scene_notes: vec!["another scene has the same content".into()],
            device: "gpu, 1".into(),
            name: "mine".into(),
            preset: Some("naive".into()),
            kernels_of: Some("new".into()),
            ..Record::default()
        };
        let plan = CurrentPlan::of([&planned]);
        let mut record = Record { key: "k".into(), median_ms: Some(2.0), ..Record::default() };
        plan.points[0].name(&mut record);
        assert_eq!(record, Record { median_ms: Some(2.0), ..planned });
        // A plan of an earlier version of raycl has neither the folder of kernels nor notes.
        let earlier = PlannedPoint { kernels_of: None, scene_notes: None, ..plan.points[0].clone() };
        earlier.name(&mut record);
        assert_eq!((record.kernels_of.as_deref(), record.scene_notes.len()), (Some("new"), 1));
        // The plan's run no longer compares two folders of kernels, so the record loses the folder's label.
        let alone = PlannedPoint { name: "alone".into(), ..earlier };
        alone.name(&mut record);
        assert_eq!((record.name.as_str(), record.kernels_of), ("alone", None));
    }
}
