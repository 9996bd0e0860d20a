//! Finds the OpenCL devices that an earlier process of raycl listed and stored in the cache. If the cache
//! contains the selected device and the device has not changed, raycl starts only the driver of this device,
//! and does not repeat the test of the device's lane operations (how its work-items exchange values).

use super::asked::may_be_usable_soon;
use super::discover::{again, discover_untested};
use super::drivers::VENDORS;
use super::lanes::probe;
use super::{Device, DeviceInfo, LaneTest, Survey, variables};
use crate::cache::Cache;
use crate::error::Result;
use crate::reader::may_write;
use crate::sources::Sources;
use crate::threads::cores;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// The kind of the cache entries that contain lists of devices.
const KIND: &str = "devices";
/// Environment variables that make OpenCL loaders search for drivers at other paths than [`VENDORS`].
const ELSEWHERE: [&str; 3] = ["OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH", "OCL_ICD_FILENAMES"];
/// Folders in which Linux shows accelerators as device files.
const HARDWARE: [&str; 2] = ["/dev", "/dev/dri"];
/// The text that raycl adds to the name of an accelerator that this process may not use.
const FORBIDDEN: &str = " (may not be used)";
/// Platforms whose drivers list every accelerator of a vendor. Each pair contains a part of the platform's
/// name, and the beginning of the system's names for the vendor's accelerators. Other drivers of accelerators list
/// only devices that the user names (as rusticl does), or list no platform if they find no device.
const LISTED_BY: [(&str, &str); 2] = [("nvidia", "nvidia"), ("amd accelerated parallel processing", "kfd")];
/// The time for which raycl uses a stored list of devices that may soon change. If raycl never used a list
/// that may soon change, every process would start all drivers and query all devices, even while another
/// process measures.
const BRIEFLY: Duration = Duration::from_secs(600);
/// The file in which Linux shows an identifier that changes at every start of the system.
const BOOT: &str = "/proc/sys/kernel/random/boot_id";

/// An entry of raycl's cache that contains a list of devices.
#[derive(Serialize, Deserialize)]
struct Entry {
    devices: Vec<DeviceInfo>,
    /// The time at which the devices were listed, in seconds since the epoch, if the list may soon change; else `None`.
    listed_at: Option<u64>,
}

/// Returns the device whose index `choose` returns; `None` if `choose` picks no device. Uses the stored list of devices
/// if three conditions hold: nothing in the list's key has changed, the list is not too old, and the chosen device
/// still reports the same properties. Otherwise, lists all devices again. `lane_test` says when the lane operations
/// (how work-items exchange values) of the newly listed devices are tested.
///
/// # Errors
///
/// Fails if `choose` fails, if no device can be listed, or if one of the user's kernel files causes an error on the
/// chosen device.
pub fn pick_one(
    cache: &Cache,
    sources: &Sources,
    lane_test: LaneTest,
    choose: impl Fn(&[DeviceInfo]) -> Result<Option<usize>>,
) -> Result<Option<Device>> {
    let key = key(sources)?;
    let known = stored(cache, &key);
    // If the stored list lacks the wanted device, the device may be new: all devices are listed again, and
    // messages refer to the new list.
    let index = known.as_deref().and_then(|known| choose(known).ok().flatten());
    let device = known.as_deref().zip(index).and_then(|(known, index)| again(known.get(index)?));
    if device.is_some() {
        return Ok(device);
    }
    let devices = listed(cache, &key, sources, lane_test)?;
    chosen(devices, sources, lane_test, choose)
}

/// Returns the device whose index `choose` returns. If `lane_test` is `Now` but the device's lane operations (how its
/// work-items exchange values) are still untested, tries again to test them. If this test fails, returns the test's
/// error.
fn chosen(
    devices: Vec<Device>,
    sources: &Sources,
    lane_test: LaneTest,
    choose: impl Fn(&[DeviceInfo]) -> Result<Option<usize>>,
) -> Result<Option<Device>> {
    let infos: Vec<DeviceInfo> = devices.iter().map(|device| device.info.clone()).collect();
    let mut chosen = choose(&infos)?.and_then(|index| devices.into_iter().nth(index));
    if lane_test == LaneTest::Now {
        chosen.iter_mut().try_for_each(|device| device.test_lanes(sources))?;
    }
    Ok(chosen)
}

/// Lists all devices, and tests their lane operations (how their work-items exchange values). The lane operations of a
/// device stay untested if one of the user's kernel files causes an error on this device; [`Device::test_lanes`] then
/// returns the error. If no device stays untested, stores the list for [`pick_one`] in this and other processes.
pub fn list(cache: &Cache, sources: &Sources) -> Result<Vec<Device>> {
    listed(cache, &key(sources)?, sources, LaneTest::Now)
}

fn listed(cache: &Cache, key: &str, sources: &Sources, lane_test: LaneTest) -> Result<Vec<Device>> {
    let mut survey = discover_untested()?;
    if lane_test == LaneTest::Now {
        survey.test_lanes(sources);
    }
    let hardware: Vec<String> = HARDWARE.iter().flat_map(|folder| accelerators(Path::new(folder))).collect();
    store(cache, key, &survey, &hardware);
    Ok(survey.devices)
}

/// Stores a list of devices; `hardware` has the names of the accelerators that the system shows. Does not
/// store a list with untested lane operations, since later processes would treat the assumed operations as
/// tested. If the list may soon change, stores the current time too, since the key of the stored list may not show the
/// change.
fn store(cache: &Cache, key: &str, survey: &Survey, hardware: &[String]) {
    let Survey { devices, empty_platforms, failed_platforms } = survey;
    if !devices.iter().all(|device| device.lanes_are_tested) {
        return;
    }
    let infos: Vec<DeviceInfo> = devices.iter().map(|device| device.info.clone()).collect();
    let lasts = failed_platforms.is_empty() && is_lasting(&infos, empty_platforms, hardware);
    put(cache, key, &Entry { devices: infos, listed_at: (!lasts).then(now) });
}

fn put(cache: &Cache, key: &str, entry: &Entry) {
    if let Ok(bytes) = serde_json::to_vec(entry) {
        cache.put(KIND, key, &bytes);
    }
}

/// Returns the stored list of devices; `None` if no list is stored, or if the stored list may soon change and
/// is too old.
fn stored(cache: &Cache, key: &str) -> Option<Vec<DeviceInfo>> {
    let entry: Entry = serde_json::from_slice(&cache.get(KIND, key)?).ok()?;
    // The stored time lies in the future if the clock was ahead when the list was stored.
    let is_new = |listed_at: u64| now().abs_diff(listed_at) <= BRIEFLY.as_secs();
    entry.listed_at.is_none_or(is_new).then_some(entry.devices)
}

/// Returns the number of seconds since the epoch.
fn now() -> u64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs()
}

/// Returns true if a list of devices probably stays the same until the system starts again. A device that may
/// be usable soon may change the list before the system's next start. The list may change, too, if a driver lists no
/// device although the system shows accelerators of the driver's vendor: the driver may list these later. For example,
/// a driver lists no device while a GPU is being reset, or while the driver's kernel module is being loaded again.
fn is_lasting(infos: &[DeviceInfo], empty_platforms: &[String], hardware: &[String]) -> bool {
    let recovers = infos.iter().filter_map(|info| info.unusable.as_deref()).any(may_be_usable_soon);
    let shows =
        |start: &str| hardware.iter().any(|name| name.starts_with(start) && !name.ends_with(FORBIDDEN));
    let lacks = |platform: &String| {
        let platform = platform.to_lowercase();
        LISTED_BY.iter().any(|&(name, start)| platform.contains(name) && shows(start))
    };
    !recovers && !empty_platforms.iter().any(lacks)
}

/// Returns the key under which the list of devices is stored: a text of everything that affects the list. The list's
/// key contains raycl's version, the paths and texts of the drivers' .icd files, the drivers' variables, and a hash of
/// the kernel that tests how work-items exchange values. The list's key also contains the number of cores that the
/// process may use, and the names of the accelerators that the system shows. Names of accelerators that the process
/// may not use have a note. The list's key also contains an identifier of the system's latest start, since a driver
/// that fails may list its devices after the next start. For example, NVIDIA's driver fails after an update, until the
/// system is started again.
fn key(sources: &Sources) -> Result<String> {
    let vendors = vendor_paths(|name| std::env::var_os(name));
    // Systems other than Linux do not have the file `BOOT`, so their stored lists stay valid after the next
    // start of the system.
    let boot = std::fs::read_to_string(BOOT).unwrap_or_default();
    let (probe, _) = probe(sources)?;
    Ok(key_of(&probe, (cores(), boot.trim()), &vendors, &HARDWARE.map(Path::new), variables::all()))
}

fn key_of(
    probe: &str,
    (cores, boot): (usize, &str),
    vendors: &[PathBuf],
    hardware: &[&Path],
    variables: Vec<String>,
) -> String {
    let version =
        format!("{} {}", env!("CARGO_PKG_VERSION"), option_env!("RAYCL_GIT_REVISION").unwrap_or("-"));
    let probe = blake3::hash(probe.as_bytes()).to_hex().to_string();
    let parts = [version, format!("{cores} cores"), format!("boot {boot}"), probe];
    let vendors = vendors.iter().flat_map(|path| drivers(path));
    let hardware = hardware.iter().flat_map(|folder| accelerators(folder));
    let parts = parts.into_iter().chain(vendors).chain(hardware).chain(variables);
    parts.collect::<Vec<_>>().join("\n")
}

/// Returns the paths at which OpenCL loaders search for drivers; `variable` returns the value of an
/// environment variable.
fn vendor_paths(variable: impl Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let named = ELSEWHERE.into_iter().filter_map(variable).map(PathBuf::from);
    std::iter::once(PathBuf::from(VENDORS)).chain(named).collect()
}

/// Returns the path and the text of a file, or of every file in a folder. The text of an .icd file names the driver's
/// library.
fn drivers(path: &Path) -> Vec<String> {
    let in_folder = std::fs::read_dir(path).into_iter().flatten().filter_map(|file| Some(file.ok()?.path()));
    let mut files: Vec<PathBuf> = in_folder.collect();
    files.push(path.to_owned());
    files.sort();
    let named = |file: &PathBuf| {
        let text = std::fs::read_to_string(file).ok()?;
        Some(format!("{}: {}", file.display(), text.trim()))
    };
    files.iter().filter_map(named).collect()
}

/// Returns the names of possible accelerators in a folder of devices, such as /dev. Adds a note to the name
/// of an accelerator that this process may not use, for example because the user is not in the group
/// `render`: the driver does not list such an accelerator.
fn accelerators(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|file| file.ok()?.file_name().into_string().ok());
    let known = |name: &String| {
        ["nvidia", "kfd", "card", "render", "accel"].iter().any(|word| name.starts_with(word))
    };
    let noted = |name: String| {
        let note = if may_write(&folder.join(&name)).is_ok() { "" } else { FORBIDDEN };
        name + note
    };
    let mut names: Vec<String> = names.filter(known).map(noted).collect();
    names.sort();
    names
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::device::tests::example;
    use crate::device::{DeviceKind, select};

    fn first_usable(infos: &[DeviceInfo]) -> Result<Option<usize>> {
        Ok(infos.iter().position(|info| info.unusable.is_none()))
    }

    fn picked(cache: &Cache) -> DeviceInfo {
        pick_one(cache, &Sources::Embedded, LaneTest::Now, first_usable)
            .unwrap()
            .expect("the tests need PoCL: make setup")
            .info
    }

    #[test]
    fn what_is_known_is_what_is_listed_and_a_change_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), 1 << 20);
        let listed = picked(&Cache::none());
        let all = list(&cache, &Sources::Embedded).unwrap();
        assert!(all.iter().any(|device| device.info == listed));
        assert_eq!(cache.entries().len(), 1, "a list is stored");
        assert_eq!(picked(&cache), listed, "from the stored list");
        // The stored list is changed so that it states another version of the driver, as if the driver had
        // been replaced since.
        let key = key(&Sources::Embedded).unwrap();
        let mut devices = stored(&cache, &key).unwrap();
        devices.iter_mut().for_each(|info| info.driver = "0.1".into());
        put(&cache, &key, &Entry { devices, listed_at: None });
        assert_eq!(picked(&cache), listed);
        let cached = stored(&cache, &key).unwrap();
        assert!(cached.contains(&listed), "the cache holds the device as it is now");
    }

    /// A device that the stored list lacks may have been added after the list was stored.
    #[test]
    fn a_device_that_the_stored_list_lacks_is_searched_for_in_a_new_list() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), 1 << 20);
        let key = key(&Sources::Embedded).unwrap();
        put(&cache, &key, &Entry { devices: Vec::new(), listed_at: None });
        let named = |infos: &[DeviceInfo]| match first_usable(infos) {
            Ok(None) => Err(crate::error::Error::input("no device has this name")),
            other => other,
        };
        let device = pick_one(&cache, &Sources::Embedded, LaneTest::Now, named).unwrap().unwrap();
        assert!(device.lanes_are_tested);
        assert!(stored(&cache, &key).unwrap().contains(&device.info));
    }

    #[test]
    fn everything_that_may_change_the_list_changes_its_key() {
        let folder = tempfile::tempdir().unwrap();
        let [vendors, hardware] = ["vendors", "dev"].map(|name| folder.path().join(name));
        [&vendors, &hardware].into_iter().for_each(|folder| std::fs::create_dir(folder).unwrap());
        let of = |probe: &str, machine, variables: &[&str]| {
            let variables = variables.iter().map(|&variable| variable.to_owned()).collect();
            key_of(probe, machine, std::slice::from_ref(&vendors), &[hardware.as_path()], variables)
        };
        let usual = || of("probe", (2, "boot"), &["POCL_DEVICES=pthread"]);
        let before = usual();
        assert_eq!(before, usual());
        assert_ne!(before, of("another probe", (2, "boot"), &["POCL_DEVICES=pthread"]));
        assert_ne!(before, of("probe", (4, "boot"), &["POCL_DEVICES=pthread"]));
        assert_ne!(before, of("probe", (2, "next boot"), &["POCL_DEVICES=pthread"]));
        assert_ne!(before, of("probe", (2, "boot"), &["POCL_DEVICES=pthread pthread"]));
        std::fs::write(vendors.join("new.icd"), "libnew.so").unwrap();
        let with_driver = usual();
        assert_ne!(before, with_driver);
        std::fs::write(hardware.join("nvidia0"), "").unwrap();
        assert_ne!(with_driver, usual());
    }

    #[cfg(unix)]
    #[test]
    fn an_accelerator_that_may_be_used_now_changes_the_key() {
        let hardware = tempfile::tempdir().unwrap();
        // Nobody can open a link whose target does not exist, so the link stands for an accelerator that this
        // process may not use. A file without permissions cannot stand for such an accelerator, since the
        // superuser may open the file.
        std::os::unix::fs::symlink("node", hardware.path().join("renderD128")).unwrap();
        let key = || key_of("probe", (2, "boot"), &[], &[hardware.path()], Vec::new());
        let before = key();
        assert_eq!(before, key());
        std::fs::write(hardware.path().join("node"), "").unwrap();
        assert_ne!(before, key());
    }

    #[test]
    fn drivers_are_also_looked_for_where_the_loaders_variables_say() {
        let set = |name: &str| (name != "OPENCL_VENDOR_PATH").then(|| format!("/of/{name}").into());
        let paths = vendor_paths(set);
        let expected = ["/etc/OpenCL/vendors", "/of/OCL_ICD_VENDORS", "/of/OCL_ICD_FILENAMES"];
        assert_eq!(paths, expected.map(PathBuf::from));
        assert_eq!(vendor_paths(|name| (name == "OPENCL_VENDOR_PATH").then(|| "/a".into())).len(), 2);
    }

    #[test]
    fn a_list_with_assumptions_is_not_stored() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), 1 << 20);
        let mut survey = discover_untested().unwrap();
        // This machine may have unusable devices, or devices whose lane operations are only assumed. The test
        // removes unusable devices, and devices with assumed lane operations, from the list.
        survey.devices.retain(|device| device.lanes_are_tested && device.info.unusable.is_none());
        store(&cache, "a", &survey, &[]);
        survey.devices[0].lanes_are_tested = false;
        store(&cache, "b", &survey, &[]);
        assert_eq!([cache.get(KIND, "a"), cache.get(KIND, "b")].map(|list| list.is_some()), [true, false]);
    }

    #[test]
    fn a_list_that_lacks_a_device_for_a_while_is_used_only_for_a_while() {
        let infos = |unusable: Option<&str>| {
            let unusable = unusable.map(str::to_owned);
            [DeviceInfo { unusable, ..example("PoCL", "cpu", DeviceKind::Cpu, 2) }]
        };
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let lasts = |unusable: Option<&str>, empty: &[&str], hardware: &[&str]| {
            is_lasting(&infos(unusable), &owned(empty), &owned(hardware))
        };
        assert!(lasts(None, &[], &["nvidia0"]));
        assert!(!lasts(Some("its driver says that the device is not available"), &[], &[]));
        assert!(lasts(Some("its driver has no compiler for OpenCL C"), &[], &[]));
        let nvidias = |hardware: &str| lasts(None, &["NVIDIA CUDA"], &[hardware]);
        assert!(!nvidias("nvidia0") && nvidias("renderD128") && nvidias("nvidia0 (may not be used)"));
        assert!(!lasts(None, &["AMD Accelerated Parallel Processing"], &["kfd", "renderD128"]));
        assert!(lasts(None, &["rusticl"], &["renderD128"]));
    }

    #[test]
    fn a_list_for_a_while_is_stored_with_its_time_and_a_lasting_one_without() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), 1 << 20);
        let mut survey = discover_untested().unwrap();
        survey.devices.retain(|device| device.lanes_are_tested && device.info.unusable.is_none());
        let time = |key: &str| {
            let entry: Entry = serde_json::from_slice(&cache.get(KIND, key).unwrap()).unwrap();
            entry.listed_at
        };
        store(&cache, "lasting", &survey, &[]);
        assert_eq!(time("lasting"), None);
        survey.devices[0].info.unusable = Some("its driver says that the device is not available".to_owned());
        store(&cache, "brief", &survey, &[]);
        assert!(time("brief").is_some_and(|time| time <= now()));
        // A driver that failed may list its devices soon.
        survey.devices[0].info.unusable = None;
        survey.failed_platforms = vec!["NVIDIA CUDA".to_owned()];
        store(&cache, "failed", &survey, &[]);
        assert!(time("failed").is_some());
        assert!(["lasting", "brief", "failed"].iter().all(|key| stored(&cache, key).is_some()));
    }

    #[test]
    fn a_list_with_a_time_is_used_for_ten_minutes() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(&folder.path().join("raycl"), 1 << 20);
        let is_used = |listed_at: Option<u64>| {
            put(&cache, "key", &Entry { devices: Vec::new(), listed_at });
            stored(&cache, "key").is_some()
        };
        let now = now();
        assert!(is_used(None) && is_used(Some(now)) && is_used(Some(now - 300)));
        assert!(!is_used(Some(now - 601)) && !is_used(Some(0)));
        assert!(!is_used(Some(now + 3600)), "the clock was ahead");
    }

    #[test]
    fn a_mistake_on_one_device_stops_only_commands_that_use_this_device() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("probe")).unwrap();
        std::fs::write(folder.path().join("probe/lanes.cl"), "#include \"missing.cl\"\n").unwrap();
        let sources = Sources::Folder(folder.path().to_owned());
        let mut survey = discover_untested().unwrap();
        survey.devices.retain(|device| device.lanes_are_tested && device.info.unusable.is_none());
        survey.devices.truncate(1);
        // The second device claims to be a GPU, so its lane operations are tested.
        let mut gpu = survey.devices[0].clone();
        gpu.info.extensions.push("cl_nv_compiler_options".to_owned());
        gpu.info.limits.is_cpu = false;
        gpu.info.limits.work_group_size = 1024;
        gpu.lanes_are_tested = false;
        survey.devices.push(gpu);
        survey.test_lanes(&sources);
        assert_eq!([0, 1].map(|index| survey.devices[index].lanes_are_tested), [true, false]);
        let of = |index, lane_test| {
            chosen(survey.devices.clone(), &sources, lane_test, |_: &[DeviceInfo]| Ok(Some(index)))
        };
        assert!(of(0, LaneTest::Now).unwrap().is_some() && of(1, LaneTest::Later).unwrap().is_some());
        let error = of(1, LaneTest::Now).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("missing.cl"), "{error}");
        let all = ["all".to_owned()];
        assert!(select(&survey.devices[..1], &all, &sources).is_ok());
        assert_eq!(select(&survey.devices, &all, &sources).unwrap_err().exit_code(), 2);
    }

    #[test]
    fn drivers_are_known_by_what_their_files_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.icd");
        std::fs::write(&file, "libone.so\n").unwrap();
        let before = drivers(folder.path());
        assert_eq!(before.len(), 1);
        assert_eq!(before, drivers(&file));
        std::fs::write(&file, "libother.so\n").unwrap();
        assert_ne!(before, drivers(folder.path()));
        assert!(drivers(&folder.path().join("nothing")).is_empty());
    }

    #[test]
    fn accelerators_are_in_the_order_of_their_names_whatever_else_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["renderD128", "accel0", "tty", "nvidiactl", "card1", "kfd", "null", "card0", "nvidia0"];
        names.iter().for_each(|name| std::fs::write(folder.path().join(name), "").unwrap());
        let expected = ["accel0", "card0", "card1", "kfd", "nvidia0", "nvidiactl", "renderD128"];
        assert_eq!(accelerators(folder.path()), expected);
    }
}
