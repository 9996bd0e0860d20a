//! Combines several folders of results into one list of records.

use crate::record::{CurrentPlan, Folder, Group, HOST, Record, latest, point};
use crate::words::counted_are;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Returns the records of all folders. If two folders measured the same point under different conditions (driver,
/// machine, program or timing), the keys of the two records differ. If a device has records with such different keys,
/// the label of the record's folder is added to the device's name in all of the device's records. The results are
/// then shown separately. If the point is a baseline, its device is the host, whose name does not change. For a
/// baseline, the folder's label is added to the names of all baselines in the folder's records, not to the name of
/// the host. Scenes that have the same name but different content also get the label of their folder. If a point was
/// measured twice under the same conditions, the keys of the two records are equal. Of two records with equal keys,
/// only the later folder's record is returned, with the later folder's names for the device and the strategy. (Both
/// records are returned if the earlier record cannot get these names, because another record of its folder has them.)
/// The records of a single folder are returned unchanged.
pub fn merged(folders: &[Folder]) -> Vec<Record> {
    let all = labelled(folders, &labels(folders)).concat();
    if folders.len() == 1 { all } else { latest(all, point) }
}

/// The folders from which the records of [`merged`] come.
#[derive(Debug)]
pub struct Origins<'a> {
    folders: &'a [Folder],
    labels: Vec<String>,
    /// Each folder's baselines, with the names that [`merged`] gives them.
    baselines: Vec<Vec<Record>>,
    /// Maps the point of each merged record ([`point`]) to the index of the record's folder.
    folder_indices: HashMap<String, usize>,
    /// The number of points, without baselines, that several folders measured.
    repeated: usize,
}

impl<'a> Origins<'a> {
    /// Finds out, for each record in the list that [`merged`] returns for `folders`, from which folder the
    /// record comes.
    pub fn of(folders: &'a [Folder]) -> Self {
        let labels = labels(folders);
        let records = labelled(folders, &labels);
        let points = |(index, records): (usize, &Vec<Record>)| -> Vec<(String, usize)> {
            records.iter().map(|record| (point(record), index)).collect()
        };
        // If several folders have a point, the index of the last of these folders is stored, since `merged`
        // uses the last folder's record.
        let folder_indices = records.iter().enumerate().flat_map(points).collect();
        let repeated = repeated(&records);
        let baselines_of = |records: Vec<Record>| -> Vec<Record> {
            records.into_iter().filter(Record::is_baseline).collect()
        };
        // Only the baselines are kept. A second copy of all records would need much memory, and the
        // function `baselines` would search all of them for each group.
        let baselines = records.into_iter().map(baselines_of).collect();
        Self { folders, labels, baselines, folder_indices, repeated }
    }

    /// Returns the path of a merged record's folder; `None` if the record is not among the merged records.
    pub fn folder(&self, record: &Record) -> Option<&'a Path> {
        Some(self.folders[self.index(record)?].path.as_path())
    }

    /// Returns the label of a merged record's folder; `None` if only one folder was merged, or if the record
    /// is not among the merged records.
    pub fn label(&self, record: &Record) -> Option<&str> {
        let index = self.index(record).filter(|_| self.folders.len() > 1)?;
        Some(self.labels[index].as_str())
    }

    /// Returns true if a merged record comes from the folder, or if the folder has no records. `folder` must be one of
    /// the merged folders.
    pub fn shows(&self, folder: &Folder) -> bool {
        let is_own = |index: &usize| std::ptr::eq(folder, &self.folders[*index]);
        folder.records.is_empty() || self.folder_indices.values().any(is_own)
    }

    /// Returns a note on the points that several folders measured: of each such point, [`merged`] returns only the
    /// last folder's record. Returns `None` if there are no such points.
    pub fn left_out(&self) -> Option<String> {
        (self.repeated > 0).then(|| {
            format!(
                "{} in several folders. Of each such point, the page shows only the record of the last of these folders.",
                counted_are(self.repeated, "point")
            )
        })
    }

    /// Returns the baselines of the machine that measured a group's fastest point. `groups` contains the groups of all
    /// baselines. If the point's own folder has baselines of the same scene and image size, only these are returned,
    /// with the times that this folder measured. Otherwise, the baselines of other folders from the same machine are
    /// returned. If the folder of the fastest point is unknown, all baselines of the scene and image size are returned.
    /// A group of baselines has no baselines.
    pub fn baselines<'r>(&'r self, group: &Group<'r>, groups: &[Group<'r>]) -> Vec<&'r Record> {
        if group.device == HOST {
            return Vec::new();
        }
        let all = group.baselines(groups);
        let best = group.best_where(|_| true).or(group.records.first().copied());
        let Some(index) = best.and_then(|best| self.index(best)) else { return all };
        // A baseline can have the same key in several folders of a machine; `groups` then has only the last folder's
        // record of this baseline. The folder's own record was measured together with the point.
        let own = group.baselines(&crate::record::groups(&self.baselines[index]));
        if !own.is_empty() {
            return own;
        }
        let is_near = |other: &Record| self.index(other).is_some_and(|other| self.share_host(index, other));
        all.into_iter().filter(|other| is_near(other)).collect()
    }

    /// Returns the index of a merged record's folder; `None` if the record is not among the merged records.
    fn index(&self, record: &Record) -> Option<usize> {
        self.folder_indices.get(&point(record)).copied()
    }

    /// Returns true if the environments of two folders name the same machine, with the same processor.
    fn share_host(&self, one: usize, other: usize) -> bool {
        let host = |index: usize| {
            let host = &self.folders[index].environment["host"];
            [&host["name"], &host["cpu"], &host["cores"]]
        };
        host(one) == host(other) && host(one).iter().all(|part| !part.is_null())
    }
}

/// Returns the number of points, without baselines, that have records in several folders. `records` contains
/// the records of each folder, with the names of [`labelled`]. (A group of points is compared with the
/// baselines of its own folder, even if a later folder has the same baselines.)
fn repeated(records: &[Vec<Record>]) -> usize {
    let points = |records: &Vec<Record>| -> HashSet<String> {
        records.iter().filter(|record| !record.is_baseline()).map(point).collect()
    };
    let mut folders: HashMap<String, usize> = HashMap::new();
    for point in records.iter().flat_map(points) {
        *folders.entry(point).or_default() += 1;
    }
    folders.into_values().filter(|count| *count > 1).count()
}

/// Returns the records of each folder. The label of a folder is added to the names of devices, baselines and
/// scenes by the rules that [`merged`] describes.
fn labelled(folders: &[Folder], labels: &[String]) -> Vec<Vec<Record>> {
    if let [one] = folders {
        return vec![one.records.clone()];
    }
    let mut all = with_one_name_a_scene(folders, labels);
    for index in (0..all.len()).rev() {
        let (earlier, later) = all.split_at_mut(index + 1);
        later.iter().for_each(|later| rename(&mut earlier[index], later));
    }
    let clashing = clashing(&all);
    for (records, label) in all.iter_mut().zip(labels) {
        for record in records.iter_mut().filter(|record| clashing.contains(&record.device)) {
            if record.is_baseline() {
                record.name = format!("{} ({label})", record.name);
                record.strategy = format!("{} ({label})", record.strategy);
            } else {
                record.device = format!("{} ({label})", record.device);
            }
        }
    }
    all
}

/// Returns a label for each folder: the folder's name, or its path if another folder has the same name.
pub fn labels(folders: &[Folder]) -> Vec<String> {
    let alone = |label: &str| folders.iter().filter(|folder| folder.label == label).count() == 1;
    let name = |folder: &Folder| match alone(&folder.label) {
        true => folder.label.clone(),
        false => folder.path.display().to_string(),
    };
    folders.iter().map(name).collect()
}

/// Returns each folder's records. Scenes with the same content get the same name. If scenes in different
/// folders have the same name but different content, the scene's name gets the folder's label in each of
/// these folders.
fn with_one_name_a_scene(folders: &[Folder], labels: &[String]) -> Vec<Vec<Record>> {
    let mut scenes: Vec<(&str, &str, &str)> = Vec::new();
    for (folder, label) in folders.iter().zip(labels) {
        for record in &folder.records {
            let Some(hash) = record.scene_hash.as_deref() else { continue };
            if !scenes.iter().any(|(known, ..)| *known == hash) {
                scenes.push((hash, &record.scene, label));
            }
        }
    }
    // Within a folder, records with the same scene name belong to one scene, even if their hashes differ: the
    // content of a scene may depend on the images' shape. A scene's name therefore clashes only with the same
    // name in another folder.
    let has_namesake =
        |name: &str, label: &str| scenes.iter().any(|(_, other, of)| *other == name && *of != label);
    let named = |(hash, name, label): &(&str, &str, &str)| match has_namesake(name, label) {
        false => ((*hash).to_owned(), (*name).to_owned()),
        true => ((*hash).to_owned(), format!("{name} ({label})")),
    };
    let names: HashMap<String, String> = scenes.iter().map(named).collect();
    let renamed = |record: &Record| {
        let name = record.scene_hash.as_ref().and_then(|hash| names.get(hash));
        Record { scene: name.unwrap_or(&record.scene).clone(), ..record.clone() }
    };
    folders.iter().map(|folder| folder.records.iter().map(renamed).collect()).collect()
}

/// Gives the devices and strategies of a folder's records the names that they have in the records `later` of
/// a later folder. Two records with equal keys, one from each folder, show which names in the two folders
/// belong to the same device or strategy. A record keeps its names if, with the new names, it would seem to
/// belong to the same point as another record of its folder. But if all devices have different new names, the
/// function first renames the devices in all records; a record can then keep only the old name of its strategy.
fn rename(records: &mut [Record], later: &[Record]) {
    let devices = device_names(records, later);
    let stay_apart = stay_apart(records, &devices);
    if stay_apart {
        records.iter_mut().for_each(|record| rename_device(record, &devices));
    }
    let named: HashMap<&str, &Record> = later.iter().map(|record| (record.key.as_str(), record)).collect();
    let mut taken: HashSet<String> = records.iter().map(point).collect();
    for record in records {
        let mut renamed = record.clone();
        if !stay_apart {
            rename_device(&mut renamed, &devices);
        }
        if let Some(later) = named.get(record.key.as_str()) {
            renamed.name.clone_from(&later.name);
            renamed.kernels_of.clone_from(&later.kernels_of);
        }
        if point(&renamed) == point(record) || taken.insert(point(&renamed)) {
            *record = renamed;
        }
    }
}

/// Renames a record's device if `names` has a new name for the device.
fn rename_device(record: &mut Record, names: &HashMap<String, String>) {
    if let Some(name) = names.get(&record.device) {
        record.device.clone_from(name);
    }
}

/// Returns true if all devices of the records still have different names after they get their new names from `names`.
fn stay_apart(records: &[Record], names: &HashMap<String, String>) -> bool {
    let devices: HashSet<&String> = records.iter().map(|record| &record.device).collect();
    let renamed: HashSet<&String> =
        devices.iter().map(|device| names.get(*device).unwrap_or(device)).collect();
    renamed.len() == devices.len()
}

/// Returns a map from the devices' names in the records `own` to the names of the same devices in the records
/// `other`. A device's name depends on the machine's other devices. Records with equal keys were measured on
/// the same device, so these records show which names belong to the same device.
pub fn device_names(own: &[Record], other: &[Record]) -> HashMap<String, String> {
    let other = CurrentPlan::of(other);
    let points = || own.iter().map(|record| (record.key.as_str(), record.device.as_str()));
    let devices: HashSet<&str> = own.iter().map(|record| record.device.as_str()).collect();
    let named = |device: &str| Some((device.to_owned(), other.device_called(device, points())?.to_owned()));
    devices.into_iter().filter_map(named).collect()
}

/// Returns the devices, including the host, that have two records with different keys for the same
/// point.
fn clashing(all: &[Vec<Record>]) -> HashSet<String> {
    let mut keys: HashMap<String, &str> = HashMap::new();
    let mut clashing = HashSet::new();
    for record in all.iter().flatten() {
        if *keys.entry(point(record)).or_insert(&record.key) != record.key {
            clashing.insert(record.device.clone());
        }
    }
    clashing
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{judged, measured};
    use crate::record::groups;
    use serde_json::json;

    fn folder(label: &str, gpu_key: &str, scene_hash: Option<&str>) -> Folder {
        let record = |key: &str, device: &str| Record {
            key: key.into(),
            scene: "teapot".into(),
            scene_hash: scene_hash.map(str::to_owned),
            device: device.into(),
            ..Record::default()
        };
        let records = vec![record(gpu_key, "gpu"), record(&format!("{scene_hash:?} on the host"), "host")];
        Folder { label: label.into(), records, ..Folder::default() }
    }

    fn scenes_and_devices(folders: &[Folder]) -> Vec<(String, String)> {
        merged(folders).into_iter().map(|record| (record.scene, record.device)).collect()
    }

    #[test]
    fn the_same_point_measured_in_another_way_stands_side_by_side() {
        let devices = |folders: &[Folder]| -> Vec<_> {
            scenes_and_devices(folders).into_iter().map(|(_, device)| device).collect()
        };
        let old = || folder("old", "driver 1", None);
        assert_eq!(devices(&[old(), folder("new", "driver 2", None)]), ["gpu (old)", "host", "gpu (new)"]);
        assert_eq!(devices(&[old(), folder("new", "driver 1", None)]), ["gpu", "host"]);
    }

    #[test]
    fn a_scene_whose_content_depends_on_the_images_shape_has_one_name_in_a_folder() {
        let record = |hash: &str, image_size| Record {
            key: hash.into(),
            scene: "bunny".into(),
            scene_hash: Some(hash.into()),
            image_size,
            ..Record::default()
        };
        let folder = |label: &str, [square, wide]: [&str; 2]| Folder {
            label: label.into(),
            records: vec![record(square, [8, 8]), record(wide, [8, 5])],
            ..Folder::default()
        };
        let scenes = |folders: &[Folder]| -> Vec<_> {
            merged(folders).into_iter().map(|record| record.scene).collect()
        };
        let (old, new) = (folder("old", ["1", "2"]), folder("new", ["3", "4"]));
        assert_eq!(scenes(std::slice::from_ref(&old)), ["bunny", "bunny"]);
        assert_eq!(scenes(&[old, new]), ["bunny (old)", "bunny (old)", "bunny (new)", "bunny (new)"]);
    }

    fn on(device: &str, name: &str, key: &str) -> Record {
        Record { key: key.into(), device: device.into(), name: name.into(), ..Record::default() }
    }

    fn names(folders: &[Folder]) -> Vec<(String, String, String)> {
        merged(folders).into_iter().map(|record| (record.key, record.device, record.name)).collect()
    }

    /// In this test, the second folder's machine has two devices of the same name. For this reason, the first
    /// folder's device has a longer name in the second folder. The second folder's config gives another name to a
    /// strategy.
    #[test]
    fn a_record_whose_key_a_later_folder_has_too_is_shown_once_under_the_later_names() {
        let [one, other] = [
            ("one", vec![on("gpu", "before", "1"), on("gpu", "wide", "2"), on("gpu", "bvh", "3")]),
            ("other", vec![on("cuda-gpu", "after", "1"), on("cuda-gpu-2", "wide", "4")]),
        ]
        .map(|(label, records)| Folder { label: label.into(), records, ..Folder::default() });
        let expected = [
            ("1", "cuda-gpu", "after"),
            ("2", "cuda-gpu", "wide"),
            ("3", "cuda-gpu", "bvh"),
            ("4", "cuda-gpu-2", "wide"),
        ]
        .map(|(key, device, name)| (key.to_owned(), device.to_owned(), name.to_owned()));
        let folders = [one, other];
        assert_eq!(names(&folders), expected);
        let origins = Origins::of(&folders);
        let labels: Vec<_> =
            merged(&folders).iter().map(|record| origins.label(record) == Some("one")).collect();
        assert_eq!(labels, [false, true, true, false], "the first record is that of the later folder");
    }

    /// In this test, the second folder's config gives a strategy the name that another strategy has in the
    /// first folder.
    #[test]
    fn no_record_is_lost_if_a_strategy_gets_the_name_of_another_one() {
        let [one, other] =
            [("one", vec![on("gpu", "a", "1"), on("gpu", "b", "2")]), ("other", vec![on("gpu", "b", "1")])]
                .map(|(label, records)| Folder { label: label.into(), records, ..Folder::default() });
        let keys: Vec<String> = names(&[one, other]).into_iter().map(|(key, ..)| key).collect();
        assert_eq!(keys, ["1", "2", "1"]);
    }

    /// In this test, the second folder has other names for both a strategy and the device. The point of
    /// strategy `b` in the first folder, which the second folder lacks, was measured on the same device.
    #[test]
    fn every_record_gets_the_new_name_of_its_device_even_if_a_strategys_name_is_taken() {
        let mut one = vec![on("gpu", "a", "1"), on("gpu", "b", "2")];
        rename(&mut one, &[on("cuda-gpu", "b", "1")]);
        let names = one.iter().map(|record| (record.device.as_str(), record.name.as_str()));
        assert_eq!(names.collect::<Vec<_>>(), [("cuda-gpu", "a"), ("cuda-gpu", "b")]);
        // In this part of the test, two devices have the same name, and the two folders number these devices
        // in opposite orders.
        let mut two = vec![on("gpu", "a", "1"), on("gpu-2", "a", "2")];
        rename(&mut two, &[on("gpu", "a", "2"), on("gpu-2", "a", "1")]);
        assert_eq!(two.iter().map(|record| record.device.as_str()).collect::<Vec<_>>(), ["gpu-2", "gpu"]);
        // In the second folder, the records with the keys 1 and 2 have the same device. The two names of
        // devices in the first folder therefore belong to one device.
        let mut both = vec![on("gpu", "a", "1"), on("old", "a", "2")];
        rename(&mut both, &[on("gpu", "b", "1"), on("gpu", "c", "2")]);
        let names = both.iter().map(|record| (record.device.as_str(), record.name.as_str()));
        assert_eq!(names.collect::<Vec<_>>(), [("gpu", "b"), ("gpu", "c")]);
    }

    #[test]
    fn scenes_of_one_name_and_two_contents_stand_side_by_side() {
        let (one, other) = (folder("one", "a", Some("1")), folder("other", "b", Some("2")));
        let scenes: Vec<_> = scenes_and_devices(&[one, other]).into_iter().map(|(scene, _)| scene).collect();
        assert_eq!(scenes, ["teapot (one)", "teapot (one)", "teapot (other)", "teapot (other)"]);
    }

    #[test]
    fn a_scene_has_one_name_even_if_folders_call_it_differently() {
        let mut other = folder("other", "b", Some("1"));
        other.records.iter_mut().for_each(|record| record.scene = "pot".into());
        let actual = scenes_and_devices(&[folder("one", "a", Some("1")), other]);
        assert!(actual.iter().all(|(scene, _)| scene == "teapot"), "{actual:?}");
    }

    #[test]
    fn baselines_of_two_hosts_stand_side_by_side() {
        let with = |label: &str, key: &str| {
            let mut folder = folder(label, "gpu", None);
            let host = &mut folder.records[1];
            (host.key, host.name, host.strategy) = (key.into(), "serial".into(), "serial-f32".into());
            folder
        };
        let records = merged(&[with("one", "1"), with("two", "2")]);
        let hosts: Vec<_> = records.iter().filter(|record| record.is_baseline()).collect();
        let names: Vec<_> = hosts.iter().map(|host| (host.name.as_str(), host.strategy.as_str())).collect();
        assert_eq!(names, [("serial (one)", "serial-f32 (one)"), ("serial (two)", "serial-f32 (two)")]);
        assert!(hosts.iter().all(|host| host.device == crate::record::HOST));
    }

    /// Returns a folder of the machine `host` with a point of `device`. If the folder has a baseline, `key` is
    /// the baseline's key.
    fn with_baseline(label: &str, host: Option<&str>, device: &str, key: Option<&str>) -> Folder {
        let environment = host.map(|name| json!({ "host": { "name": name, "cpu": "EPYC", "cores": 2 } }));
        let baseline = key.map(|key| Record { key: key.into(), ..measured("host", "serial", 0, 400.0) });
        let records =
            judged([measured(device, "naive", 8, 10.0)].into_iter().chain(baseline).collect::<Vec<_>>());
        let environment = environment.unwrap_or_default();
        Folder { label: label.into(), environment, records, ..Folder::default() }
    }

    #[test]
    fn the_baselines_of_a_point_are_those_of_its_own_machine() {
        let names = |folders: &[Folder], device: &str| -> Vec<String> {
            let records = merged(folders);
            let groups = groups(&records);
            let group = groups.iter().find(|group| group.device == device).expect("a group");
            let origins = Origins::of(folders);
            let baselines = origins.baselines(group, &groups);
            baselines.into_iter().map(|record| record.name.clone()).collect()
        };
        let gpu = |host, key| with_baseline("gpus", host, "gpu", key);
        let cpu = |host| with_baseline("cpus", host, "cpu", Some("epyc"));
        let [one, two] = [Some("one"), Some("two")];
        // Both folders have a baseline. On the same processor, the baseline has the same key.
        assert_eq!(names(&[gpu(one, Some("xeon")), cpu(two)], "gpu"), ["serial (gpus)"]);
        assert_eq!(names(&[gpu(one, Some("xeon")), cpu(two)], "cpu"), ["serial (cpus)"]);
        assert_eq!(names(&[gpu(two, Some("xeon")), cpu(two)], "gpu"), ["serial (gpus)"]);
        assert_eq!(names(&[gpu(one, Some("epyc")), cpu(two)], "gpu"), ["serial"]);
        // Only one of the folders has a baseline.
        assert_eq!(names(&[gpu(one, None), cpu(two)], "gpu"), [""; 0]);
        assert_eq!(names(&[gpu(None, None), cpu(None)], "gpu"), [""; 0], "the machines are unknown");
        assert_eq!(names(&[gpu(two, None), cpu(two)], "gpu"), ["serial"]);
    }

    #[test]
    fn the_baselines_of_a_point_have_the_times_of_its_own_folder() {
        let folder = |device: &str, serial_ms: f64| {
            let serial = Record { key: "epyc".into(), ..measured("host", "serial", 0, serial_ms) };
            let records = judged([measured(device, "naive", 8, 10.0), serial]);
            Folder { label: device.into(), records, ..Folder::default() }
        };
        let folders = [folder("gpu", 400.0), folder("cpu", 800.0)];
        let (records, origins) = (merged(&folders), Origins::of(&folders));
        assert_eq!(records.len(), 3, "the two records of the baseline have one key");
        let copied: Vec<usize> = origins.baselines.iter().map(Vec::len).collect();
        assert_eq!(copied, [1, 1], "only baselines are copied");
        let groups = groups(&records);
        let times = |device: &str| -> Vec<Option<f64>> {
            let group = groups.iter().find(|group| group.device == device).expect("a group");
            origins.baselines(group, &groups).into_iter().map(|record| record.median_ms).collect()
        };
        assert_eq!(["gpu", "cpu", "host"].map(times), [vec![Some(400.0)], vec![Some(800.0)], Vec::new()]);
    }

    /// Without a plan, a folder may have records of a scene under two names.
    #[test]
    fn all_records_of_a_single_folder_are_shown_with_their_own_names() {
        let of = |scene: &str, key: &str| Record {
            scene: scene.into(),
            scene_hash: Some("1".into()),
            ..on("gpu", "naive", key)
        };
        let folder = Folder { records: vec![of("teapot", "1"), of("pot", "2")], ..Folder::default() };
        let folders = std::slice::from_ref(&folder);
        let records = merged(folders);
        let scenes: Vec<_> = records.iter().map(|record| record.scene.as_str()).collect();
        assert_eq!(scenes, ["teapot", "pot"]);
        let origins = Origins::of(folders);
        assert!(records.iter().all(|record| origins.folder(record).is_some()));
    }

    #[test]
    fn folders_of_one_name_are_distinguished_by_their_paths() {
        let at = |label: &str, path: &str| Folder { path: path.into(), ..folder(label, "a", None) };
        let labels = labels(&[at("a", "x/a"), at("a", "y/a"), at("b", "y/b")]);
        assert_eq!(labels, ["x/a", "y/a", "b"]);
    }

    /// In this test, the first and the last of three folders have no point in common. The second folder has a
    /// point in common with each of them, and thus shows that they have the same device.
    #[test]
    fn the_names_of_the_last_folder_reach_the_first_one_through_the_second() {
        let folders = [
            ("one", vec![on("gpu", "a", "1")]),
            ("two", vec![on("cuda-gpu", "a", "1"), on("cuda-gpu", "b", "2")]),
            ("three", vec![on("nvidia-gpu", "b", "2")]),
        ]
        .map(|(label, records)| Folder { label: label.into(), records, ..Folder::default() });
        let devices: Vec<String> = merged(&folders).into_iter().map(|record| record.device).collect();
        assert_eq!(devices, ["nvidia-gpu", "nvidia-gpu"]);
    }

    #[test]
    fn the_folder_of_a_record_is_named_only_if_there_are_several() {
        let label = |folders: &[Folder]| {
            let records = merged(folders);
            Origins::of(folders).label(&records[0]).map(str::to_owned)
        };
        let [one, other] = ["one", "other"].map(|label| folder(label, label, None));
        assert_eq!(label(std::slice::from_ref(&one)), None);
        assert_eq!(label(&[one, other]).as_deref(), Some("one"));
    }
}
