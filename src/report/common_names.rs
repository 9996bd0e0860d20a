//! Replaces the names that drivers give to devices by common names, for pages: "pthread-znver4-AMD EPYC 9B45"
//! becomes "AMD EPYC 9B45, PoCL". Files for other programs keep the drivers' names.

use crate::device::common_names;
use crate::record::{Folder, HOST};
use serde_json::{Value, json};
use std::collections::HashMap;

/// The key under which the description of a renamed device stores the name that the driver reports.
const DRIVER: &str = "driver's_name";

/// Returns copies of the folders in which common names replace the names that drivers give to devices. Also
/// returns a map from each common name to the name that the driver reports. The returned map contains only
/// devices whose name changed.
pub(super) fn with_common_names(folders: &[Folder]) -> (Vec<Folder>, HashMap<String, String>) {
    let measured = folders.iter().flat_map(|folder| folder.records.iter().chain(&folder.controls));
    let described = folders.iter().filter_map(|folder| folder.environment["devices"].as_array()).flatten();
    let devices = measured
        .map(|record| record.device.as_str())
        .chain(described.filter_map(|entry| entry["device"].as_str()))
        .filter(|device| *device != HOST);
    let names: HashMap<String, String> = common_names(devices)
        .into_iter()
        .filter(|(name, common)| name != common)
        .map(|(name, common)| (name.to_owned(), common))
        .collect();
    let renamed = folders.iter().map(|folder| renamed(folder.clone(), &names)).collect();
    (renamed, names.into_iter().map(|(name, common)| (common, name)).collect())
}

/// Returns the name that the driver reports for a device. `entry` is the device's description in
/// `environment.json`. Returns `None` if the description contains no name.
pub(super) fn name_of_driver(entry: &Value) -> Option<&str> {
    entry[DRIVER].as_str().or(entry["device"].as_str())
}

fn renamed(mut folder: Folder, names: &HashMap<String, String>) -> Folder {
    for record in folder.records.iter_mut().chain(&mut folder.controls) {
        if let Some(common) = names.get(&record.device) {
            record.device.clone_from(common);
        }
    }
    let devices = folder.environment["devices"].as_array_mut();
    for entry in devices.into_iter().flatten() {
        let name = entry["device"].as_str().unwrap_or_default().to_owned();
        if let Some(common) = names.get(&name) {
            entry["device"] = json!(common);
            entry[DRIVER] = json!(name);
        }
    }
    folder
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Record;

    #[test]
    fn records_and_environment_get_the_common_name_and_the_driver_s_name_stays_beside() {
        let driver = "pthread-znver4-AMD EPYC 9B45";
        let record = |device: &str| Record { device: device.into(), ..Record::default() };
        let folder = Folder {
            records: vec![record(driver), record("NVIDIA H200"), record(HOST)],
            environment: json!({ "devices": [{ "device": driver }, { "device": "NVIDIA H200" }] }),
            ..Folder::default()
        };
        let (folders, drivers) = with_common_names(std::slice::from_ref(&folder));
        let names: Vec<_> = folders[0].records.iter().map(|record| record.device.as_str()).collect();
        assert_eq!(names, ["AMD EPYC 9B45, PoCL", "NVIDIA H200", HOST]);
        assert_eq!(drivers, HashMap::from([(names[0].to_owned(), driver.to_owned())]));
        let entry = |index: usize| &folders[0].environment["devices"][index];
        assert_eq!((entry(0)["device"].as_str(), name_of_driver(entry(0))), (Some(names[0]), Some(driver)));
        assert_eq!((name_of_driver(entry(1)), entry(1).get(DRIVER)), (Some("NVIDIA H200"), None));
        // The second folder's environment names a second device with the same common name. If two devices
        // would get the same common name, both keep their drivers' names.
        let environment = json!({ "devices": [{ "device": "cpu-znver4-AMD EPYC 9B45" }] });
        let without_records = Folder { environment, ..Folder::default() };
        let (folders, _) = with_common_names(&[folder.clone(), without_records]);
        assert_eq!(folders[0].records[0].device, driver);
        // In this case, a record of the second folder, and not its environment, names the second device with
        // the same common name. Both devices keep their drivers' names again.
        let other = Folder { records: vec![record("cpu-znver4-AMD EPYC 9B45")], ..Folder::default() };
        let (folders, drivers) = with_common_names(&[folder, other]);
        assert_eq!((folders[0].records[0].device.as_str(), drivers.len()), (driver, 0));
    }

    #[test]
    fn control_points_get_the_common_name_too() {
        let control = Record { device: "pthread-znver4-AMD EPYC 9B45".into(), ..Record::default() };
        let (folders, _) = with_common_names(&[Folder { controls: vec![control], ..Folder::default() }]);
        assert_eq!(folders[0].controls[0].device, "AMD EPYC 9B45, PoCL");
    }
}
