//! Finds out which records of two compared folders belong to the same point.

use crate::record::{Folder, HOST, Record};
use crate::report::merged::device_names;
use std::collections::{HashMap, HashSet};

/// The rules by which the points of two compared folders correspond.
///
/// Points correspond if their records have the same key. Points without a record of the same key in the other folder
/// correspond if their scenes correspond, their devices correspond, and their image sizes, strategies' names and
/// local sizes are equal. Devices correspond if their names are equal, or if records with equal keys show that the
/// devices are the same. If each folder has results of only one device, these two devices correspond whatever their
/// names are, so that results of different machines can be compared. Scenes correspond if their contents are equal.
/// If a record of either folder lacks the hash of its scene's content, scenes correspond if their names are equal.
pub struct Correspondence<'a> {
    /// The keys that have records in both folders.
    common_keys: HashSet<&'a str>,
    /// Maps the first folder's names of devices to the second folder's names.
    device_names: HashMap<String, String>,
    /// True if each of the two folders has results of only one device.
    one_device_each: bool,
    /// True if scenes correspond by content, and false if they correspond by name.
    pub by_content: bool,
}

/// The values that are equal in two corresponding records of the two folders.
#[derive(PartialEq, Eq, Hash)]
pub enum Point {
    /// The records' key, if both folders have a record with this key.
    Key(String),
    /// The scene's content or name, the image size, the device, the strategy's name and the local size.
    Names(String, [u32; 2], String, String, Option<[u32; 2]>),
}

impl<'a> Correspondence<'a> {
    /// Finds out by which keys, devices and scenes the points of two folders correspond.
    pub fn between(before: &'a Folder, after: &'a Folder) -> Self {
        Self {
            common_keys: keys(before).intersection(&keys(after)).copied().collect(),
            device_names: device_names(&before.records, &after.records),
            one_device_each: devices(before).len() == 1 && devices(after).len() == 1,
            by_content: [before, after].iter().all(|folder| has_content(folder)),
        }
    }

    /// Returns the values that `record` and the corresponding record of the other folder have in common.
    pub fn point(&self, record: &Record) -> Point {
        if self.common_keys.contains(record.key.as_str()) {
            return Point::Key(record.key.clone());
        }
        let device = self.device_names.get(&record.device).unwrap_or(&record.device);
        let device = if self.one_device_each && !record.is_baseline() { "the device" } else { device };
        let scene = record.scene_hash.as_ref().filter(|_| self.by_content).unwrap_or(&record.scene);
        let (device, name) = (device.to_owned(), record.name.clone());
        Point::Names(scene.clone(), record.image_size, device, name, record.local_size)
    }

    /// Returns true if the device of two corresponding records is the same, but has another name in the second
    /// folder.
    pub fn is_renamed(&self, before: &Record, after: &Record) -> bool {
        before.device != after.device && self.device_names.get(&before.device) == Some(&after.device)
    }

    /// Returns a copy of `record`, a record of the second folder, in which the device has the name that the
    /// first folder gives to it. If no device of the first folder corresponds to the record's device, or if
    /// several do, the copy keeps the name that the record has.
    pub fn with_device_of_first(&self, record: &Record) -> Record {
        let of_device = |(_, second): &(&String, &String)| **second == record.device;
        let mut known = self.device_names.iter().filter(of_device).map(|(first, _)| first);
        let device = known.next().filter(|_| known.next().is_none()).unwrap_or(&record.device);
        Record { device: device.clone(), ..record.clone() }
    }
}

/// Returns the values that a point's two records have in common if one run measured the point with two
/// folders of kernels.
pub fn twin(record: &Record) -> ([&str; 3], [u32; 2], Option<[u32; 2]>) {
    ([&record.scene, &record.device, &record.strategy], record.image_size, record.local_size)
}

fn keys(folder: &Folder) -> HashSet<&str> {
    folder.records.iter().map(|record| record.key.as_str()).collect()
}

/// Returns the names of a folder's devices, without the host.
pub fn devices(folder: &Folder) -> Vec<&str> {
    let mut devices: Vec<&str> =
        folder.records.iter().map(|record| record.device.as_str()).filter(|device| *device != HOST).collect();
    devices.sort_unstable();
    devices.dedup();
    devices
}

/// Returns true if every record of a folder has a hash of its scene's content.
fn has_content(folder: &Folder) -> bool {
    folder.records.iter().all(|record| record.scene_hash.is_some())
}
