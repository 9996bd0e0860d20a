//! Finds OpenCL devices. raycl reads a device's answers to queries as raw bytes, so that an unexpected answer can make
//! the device unusable, but does not stop raycl.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fmt::Display;
use std::sync::{Mutex, MutexGuard};

use ocl::core::DeviceInfo as Query;

use super::asked::Asked;
use super::direct;
use super::kernel_cache::cache_advice;
use super::patience::Patience;
use super::threads::threads_of;
use super::variables;
use super::{Device, DeviceInfo, DeviceKind, Hardware, LaneOperations, is_pocl};
use crate::error::{Error, Result};
use crate::memory::{address_space_limit, readable};
use crate::sources::Sources;
use crate::threads::{cores, locked};

/// All OpenCL devices, and the platforms that list no device.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// Every device of every platform, in the loader's order. An unusable device states why it is unusable.
    pub devices: Vec<Device>,
    /// The names of the platforms without devices.
    pub empty_platforms: Vec<String>,
    /// The names of the platforms whose drivers failed to list devices, each with the reason.
    pub failed_platforms: Vec<String>,
}

impl Survey {
    /// Tests the lane operations of every device (how its work-items exchange values). Ignores mistakes in
    /// the user's kernel files: a mistake must not stop a command that uses another device. A device on
    /// which one of the user's kernel files causes an error stays untested. If the user chooses an untested
    /// device, [`Device::test_lanes`] is called again and returns the error.
    pub(super) fn test_lanes(&mut self, sources: &Sources) {
        for device in &mut self.devices {
            let _ = device.test_lanes(sources);
        }
    }
}

/// Lists every device of every platform, and tests the lane operations of each device (how its work-items exchange
/// values). An unusable device states why it is unusable. `sources` contains the kernel of the test.
///
/// Returns an error if no platform is found, or no device.
pub fn discover(sources: &Sources) -> Result<Vec<Device>> {
    Ok(with_devices(survey(sources)?)?.devices)
}

/// Lists every device like [`discover`], and every platform without devices. Does not test lane operations
/// (how work-items exchange values).
pub(super) fn discover_untested() -> Result<Survey> {
    with_devices(survey_untested()?)
}

/// Returns an error if the survey contains no device, not even an unusable device.
fn with_devices(survey: Survey) -> Result<Survey> {
    if survey.devices.is_empty() {
        return Err(no_device(&survey));
    }
    Ok(survey)
}

/// Returns the error if platforms are found, but no device.
fn no_device(Survey { empty_platforms, failed_platforms, .. }: &Survey) -> Error {
    let parts = [
        ("platforms without a device", empty_platforms),
        ("platforms whose devices could not be listed", failed_platforms),
    ];
    let parts = parts.iter().filter(|(_, platforms)| !platforms.is_empty());
    let parts: Vec<_> = parts.map(|(what, platforms)| format!("{what}: {}", platforms.join(", "))).collect();
    let usual = if failed_platforms.is_empty() { HOW_TO_GET_ONE } else { FAILED };
    let help = no_device_advice(empty_platforms).unwrap_or_else(|| usual.to_owned());
    Error::run(format!("no OpenCL device was found ({})", parts.join("; "))).with_help(help)
}

/// PoCL's environment variable that names the devices that PoCL lists.
const CHOSEN: &str = "POCL_DEVICES";

/// Returns advice if PoCL lists no device, and an environment variable or PoCL's folder for compiled kernels
/// may be the cause.
pub fn no_device_advice(empty_platforms: &[String]) -> Option<String> {
    if !empty_platforms.iter().any(|platform| is_pocl(platform.trim())) {
        return None;
    }
    cache_advice().or_else(|| chosen_advice(std::env::var_os(CHOSEN).as_deref()))
}

/// The value of `POCL_DEVICES` with which every version of PoCL lists the CPU. PoCL 3.1 does not know the newer name
/// `cpu`.
const EVERY_CPU: &str = "pthread";

/// Returns advice if the environment variable `POCL_DEVICES` has a value, even an empty one: PoCL then lists
/// only the devices that the variable names. Returns `None` if the value is already [`EVERY_CPU`], the value that the
/// advice recommends: the variable is then not the reason why PoCL lists no device.
fn chosen_advice(value: Option<&OsStr>) -> Option<String> {
    let value = value.filter(|value| *value != EVERY_CPU)?.display();
    Some(format!(
        "PoCL lists only the devices that the environment variable {CHOSEN} names; its value is '{value}': \
         unset {CHOSEN}, or set it to {EVERY_CPU}"
    ))
}

/// Lists every device, and every platform without devices. Tests the lane operations of each device. Returns an error
/// if no platform is found.
pub fn survey(sources: &Sources) -> Result<Survey> {
    let mut survey = survey_untested()?;
    survey.test_lanes(sources);
    Ok(survey)
}

fn survey_untested() -> Result<Survey> {
    let _turn = turn();
    let _patience = Patience::of_guarded()?;
    let mut survey = Survey::default();
    for platform in platforms()? {
        match direct::devices(platform) {
            Ok(devices) if devices.is_empty() => survey.empty_platforms.push(name_of(platform).0),
            Ok(devices) => {
                survey.devices.extend(devices.into_iter().map(|device| inspect(platform, device)));
            }
            Err(why) => survey.failed_platforms.push(format!("{}: {why}", name_of(platform).0)),
        }
    }
    number_twins(survey.devices.iter_mut().map(|device| &mut device.info));
    label(survey.devices.iter_mut().map(|device| &mut device.info));
    Ok(survey)
}

/// Waits until no other thread lists devices, and returns the lock that lets this thread list them. A driver
/// starts when its devices are listed for the first time. While PoCL 3.1 starts in one thread, PoCL returns
/// no device to a second thread.
fn turn() -> MutexGuard<'static, ()> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    locked(&ONE_AT_A_TIME)
}

fn platforms() -> Result<impl Iterator<Item = ocl::Platform>> {
    if platform_count()? == 0 {
        return Err(no_platform(address_space_limit(), few_open_files()));
    }
    let platforms = ocl::core::get_platform_ids().map_err(unlisted)?;
    Ok(platforms.into_iter().map(ocl::Platform::new))
}

/// Returns the error if the OpenCL loader has platforms, but cannot list them. A driver is then installed.
fn unlisted(error: impl Display) -> Error {
    Error::run(format!("the OpenCL platforms could not be listed: {error}")).with_help(FAILED)
}

/// The name that raycl shows for a platform or device without a name.
const UNNAMED: &str = "unnamed";

/// Returns a platform's name. If the platform's driver does not report the name, also returns the reason.
fn name_of(platform: ocl::Platform) -> (String, Option<String>) {
    match direct::platform_text(platform, ocl::ffi::CL_PLATFORM_NAME) {
        Ok(name) => (or_unnamed(name), None),
        Err(why) => {
            (UNNAMED.to_owned(), Some(format!("its driver does not tell the platform's name: {why}")))
        }
    }
}

fn or_unnamed(name: String) -> String {
    if name.is_empty() { UNNAMED.to_owned() } else { name }
}

/// Opens a device that was listed in an earlier run. Returns `None` if the device is missing, if its properties have
/// changed, or if the platforms cannot be listed. Three properties are copied from `known`, so their changes are not
/// noticed: the lane operations (how work-items exchange values), the label, and `twins_before` (the number of earlier
/// devices with the same name). The loader loads all drivers, but raycl asks only platforms with the known platform's
/// name for their devices.
pub(super) fn again(known: &DeviceInfo) -> Option<Device> {
    let _turn = turn();
    let _patience = Patience::of_guarded().ok()?;
    let namesakes = platforms().ok()?.filter(|platform| name_of(*platform).0 == known.platform);
    let devices = namesakes.flat_map(|platform| {
        let devices = direct::devices(platform).unwrap_or_default();
        devices.into_iter().map(move |device| (platform, device))
    });
    let mut inspected = devices.map(|(platform, device)| inspect(platform, device));
    // `twins_before` numbers the devices with the same name in the order of `inspected`.
    let mut device =
        inspected.by_ref().filter(|device| device.info.name == known.name).nth(known.twins_before)?;
    device.info.limits.lane_operations = known.limits.lane_operations;
    device.lanes_are_tested = true;
    device.info.twins_before = known.twins_before;
    device.info.label.clone_from(&known.label);
    (device.info == *known).then_some(device)
}

/// The advice to a user if a driver is installed, but cannot list its devices.
const FAILED: &str = "a driver is installed, but could not list its devices: check that enough memory is free and that you may use the device, and run the command again";
const HOW_TO_GET_ONE: &str = "PoCL runs OpenCL on CPUs; install PoCL with\n  \
    sudo apt-get install pocl-opencl-icd ocl-icd-libopencl1\nor run `make setup` in the folder of raycl's source code. \
    If a driver is installed, check that OCL_ICD_VENDORS is unset or names the folder of its .icd file.";

/// Returns the error if no platform is found. `limit_bytes` is the limit of this process's address space, or
/// `None` if there is no limit. `files` is the number of files that this process may open, or `None` if the
/// number is not small. The OpenCL loader silently leaves out drivers that it cannot load, for example
/// because the address space is too small.
fn no_platform(limit_bytes: Option<u64>, files: Option<u64>) -> Error {
    let of_files =
        files.map(|files| (format!("open only {files} files"), "raise the limit with `ulimit -n 1024`"));
    let of_space = limit_bytes.map(|bytes| {
        let limit = readable(bytes);
        (format!("use only {limit} of address space"), "remove the limit with `ulimit -v unlimited`")
    });
    let Some((may, remedy)) = of_files.or(of_space) else {
        return Error::run(
            "no OpenCL platform was found: no driver is installed, or the OpenCL loader finds none",
        )
        .with_help(HOW_TO_GET_ONE);
    };
    let message = format!(
        "no OpenCL platform was found: either no driver is installed, or a driver could not be loaded because \
         this process may {may}"
    );
    Error::run(message).with_help(format!("{remedy}, and repeat the command. {HOW_TO_GET_ONE}"))
}

/// Returns how many files this process may open (`ulimit -n`), if this limit is so low that a driver can
/// hardly be loaded; otherwise `None`.
#[cfg(unix)]
fn few_open_files() -> Option<u64> {
    use rustix::process::{Resource, getrlimit};
    getrlimit(Resource::Nofile).current.filter(|files| *files < 16)
}

/// Returns `None`, since raycl queries the limit of open files only on Unix.
#[cfg(not(unix))]
fn few_open_files() -> Option<u64> {
    None
}

/// Returns the number of platforms. The number of platforms must be queried before the `ocl` crate is used.
/// If no platform exists, each enumeration of platforms by the `ocl` crate sleeps 10 seconds, and some
/// enumerations panic.
fn platform_count() -> Result<u32> {
    /// The status CL_PLATFORM_NOT_FOUND_KHR of OpenCL's loader.
    const NOT_FOUND: i32 = -1001;
    let mut count = 0;
    // SAFETY: with zero entries the list may be null, and `count` outlives the call.
    let status = unsafe { ocl::ffi::clGetPlatformIDs(0, std::ptr::null_mut(), &mut count) };
    match status {
        0 => Ok(count),
        NOT_FOUND => Ok(0),
        _ => Err(Error::run(format!("the OpenCL loader failed to list platforms (error {status})"))
            .with_help(HOW_TO_GET_ONE)),
    }
}

/// Sets each device's `twins_before`: the number of devices that come before this device in the list, and that have the
/// same platform and name. Platforms and names are compared as [`DeviceInfo::slug`] spells them (without capital
/// letters and special characters).
fn number_twins<'a>(devices: impl Iterator<Item = &'a mut DeviceInfo>) {
    let mut seen: HashMap<String, usize> = HashMap::new();
    for device in devices {
        device.twins_before = 0;
        let count = seen.entry(device.slug()).or_default();
        device.twins_before = *count;
        *count += 1;
    }
}

/// Assigns a unique label to each device: the device's name if no other device has this name, else the
/// device's name for files (`slug`). Devices with the same name must already be numbered (by
/// [`number_twins`]).
fn label<'a>(devices: impl Iterator<Item = &'a mut DeviceInfo>) {
    let mut devices: Vec<_> = devices.collect();
    let mut namesakes: HashMap<String, usize> = HashMap::new();
    for device in &devices {
        *namesakes.entry(device.name.clone()).or_default() += 1;
    }
    for device in &mut devices {
        let alone = namesakes.get(&device.name) == Some(&1);
        device.label = if alone { device.name.clone() } else { device.slug() };
    }
}

/// Queries all properties of a device.
fn inspect(platform: ocl::Platform, device: ocl::Device) -> Device {
    let mut asked = Asked::new(device);
    let kind = DeviceKind::from_type(asked.number(Query::Type));
    let extensions: Vec<String> =
        asked.text(Query::Extensions).split_whitespace().map(str::to_owned).collect();
    let raw = |query| direct::device_answer(device, query).ok();
    let (platform_name, without_name) = name_of(platform);
    let platform_version = direct::platform_text(platform, ocl::ffi::CL_PLATFORM_VERSION);
    let mut info = DeviceInfo {
        settings: variables::deciding(&platform_name),
        cores: (kind == DeviceKind::Cpu).then(cores),
        platform: platform_name,
        platform_version: platform_version.unwrap_or_default(),
        name: or_unnamed(asked.text(Query::Name)),
        vendor: asked.text(Query::Vendor),
        version: asked.text(Query::Version),
        driver: asked.text(Query::DriverVersion),
        kind,
        hardware: Hardware::ask(&extensions, raw),
        extensions,
        limits: asked.limits(kind == DeviceKind::Cpu),
        threads: None,
        twins_before: 0,
        label: String::new(),
        unusable: None,
    };
    info.threads = threads_of(&info.platform, kind, info.limits.compute_units);
    info.unusable = without_name.or_else(|| asked.why_unusable());
    if info.unusable.is_none() {
        info.limits.lane_operations = LaneOperations::assumed(&info);
    }
    let lanes_are_tested = info.limits.lane_operations == LaneOperations::Barriers; // barriers work everywhere
    Device { info, platform, device, lanes_are_tested }
}

#[cfg(test)]
mod tests {
    use super::super::tests::example;
    use super::*;

    #[test]
    fn a_limit_of_the_address_space_is_reported_if_there_is_no_platform() {
        let message = |limit| format!("{:?}", no_platform(limit, None));
        assert!(message(Some(409_600_000)).contains("may use only 409.6 MB of address space"));
        assert!(message(Some(1)).contains("ulimit -v unlimited") && !message(None).contains("ulimit"));
    }

    #[test]
    fn a_small_limit_on_open_files_is_reported_if_there_is_no_platform() {
        let error = no_platform(None, Some(6));
        assert!(error.to_string().contains("may open only 6 files"), "{error}");
        assert!(error.remedy().starts_with("raise the limit with `ulimit -n 1024`"), "{}", error.remedy());
    }

    #[test]
    fn a_variable_that_leaves_pocl_without_devices_is_reported() {
        for value in [None, Some("pthread".as_ref())] {
            assert_eq!(chosen_advice(value), None);
        }
        for value in ["nonsense", ""] {
            let advice = chosen_advice(Some(value.as_ref())).expect("advice");
            let expected = format!("POCL_DEVICES names; its value is '{value}': unset");
            assert!(advice.contains(&expected), "{advice}");
        }
        assert_eq!(no_device_advice(&["NVIDIA CUDA".to_owned()]), None);
    }

    #[test]
    fn a_driver_that_fails_to_list_its_devices_need_not_be_installed() {
        let [empty, failed] = ["Hollow", "Broken: clGetDeviceIDs returned CL_OUT_OF_HOST_MEMORY (-6)"]
            .map(|platform| vec![platform.to_owned()]);
        let of = |empty_platforms: &[String], failed_platforms: &[String]| {
            let error = no_device(&Survey {
                empty_platforms: empty_platforms.to_vec(),
                failed_platforms: failed_platforms.to_vec(),
                ..Survey::default()
            });
            assert_eq!(error.exit_code(), 1);
            (error.to_string(), error.remedy().to_owned())
        };
        let (message, remedy) = of(&empty, &failed);
        let expected = "no OpenCL device was found (platforms without a device: Hollow; platforms whose devices \
            could not be listed: Broken: clGetDeviceIDs returned CL_OUT_OF_HOST_MEMORY (-6))";
        assert_eq!((message.as_str(), remedy.as_str()), (expected, FAILED));
        let (message, remedy) = of(&empty, &[]);
        assert_eq!(message, "no OpenCL device was found (platforms without a device: Hollow)");
        assert_eq!(remedy, HOW_TO_GET_ONE);
        assert_eq!(unlisted("CL_OUT_OF_HOST_MEMORY").remedy(), FAILED);
    }

    #[test]
    fn twins_are_numbered() {
        let gpu = example("CUDA", "H200", DeviceKind::Gpu, 132);
        let mut devices = [gpu.clone(), example("PoCL", "cpu", DeviceKind::Cpu, 2), gpu.clone(), gpu];
        number_twins(devices.iter_mut());
        assert_eq!(devices.map(|device| device.twins_before), [0, 0, 1, 2]);
    }

    #[test]
    fn namesakes_are_labelled_apart() {
        let gpu = example("CUDA", "H200", DeviceKind::Gpu, 132);
        let pocl = example("PoCL", "EPYC", DeviceKind::Cpu, 2);
        let intel = example("Intel", "EPYC", DeviceKind::Cpu, 2);
        let lone = example("PoCL", "Ryzen", DeviceKind::Cpu, 2);
        let mut devices = [gpu.clone(), gpu, pocl, intel, lone];
        number_twins(devices.iter_mut());
        label(devices.iter_mut());
        let labels = devices.each_ref().map(|device| device.label.as_str());
        assert_eq!(labels, ["cuda-h200", "cuda-h200-2", "pocl-epyc", "intel-epyc", "Ryzen"]);
    }

    #[test]
    fn this_machine_has_a_usable_device() {
        let devices = discover(&Sources::Embedded).expect("the tests need PoCL: make setup");
        let usable: Vec<_> = devices.iter().filter(|device| device.info.unusable.is_none()).collect();
        assert!(!usable.is_empty(), "no usable device among {devices:?}");
        for Device { info, .. } in usable {
            assert!(!info.name.is_empty() && !info.platform.is_empty(), "{info:?}");
            assert!(info.limits.local_bytes >= 16 * 1024, "{info:?}");
            assert!(info.limits.work_group_size >= 64, "{info:?}");
            assert!(info.limits.allocation_bytes <= info.limits.global_bytes, "{info:?}");
            assert_eq!(info.limits.is_cpu, info.kind == DeviceKind::Cpu);
        }
    }

    #[test]
    fn every_property_is_the_answer_to_its_own_query() {
        for Device { info, device, .. } in
            discover(&Sources::Embedded).expect("the tests need PoCL: make setup")
        {
            let answer =
                |query| device.info(query).map_or_else(|error| error.to_string(), |value| value.to_string());
            let limits = &info.limits;
            for (query, property) in [
                (Query::LocalMemSize, limits.local_bytes.to_string()),
                (Query::MaxConstantBufferSize, limits.constant_bytes.to_string()),
                (Query::GlobalMemSize, limits.global_bytes.to_string()),
                (Query::MaxMemAllocSize, limits.allocation_bytes.to_string()),
                (Query::MaxWorkGroupSize, limits.work_group_size.to_string()),
                (Query::MaxComputeUnits, limits.compute_units.to_string()),
                (Query::Name, info.name),
                (Query::Vendor, info.vendor),
                (Query::DriverVersion, info.driver),
            ] {
                assert_eq!(property, answer(query).trim(), "{query:?}");
            }
            assert!(info.version.starts_with("OpenCL "), "{}", info.version);
        }
    }
}
