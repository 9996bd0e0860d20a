//! Finding devices. Everything is asked once, as raw bytes, so that a driver
//! with a strange answer makes its device unusable rather than raycl.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use ocl::core::DeviceInfo as Query;

use super::limits::native_width;
use super::threads::threads_of;
use super::variables;
use super::{Device, DeviceInfo, DeviceKind, DeviceLimits, Hardware, LaneOperations};
use crate::error::{Error, Result};
use crate::sources::Sources;

/// What there is: devices, and platforms that have none.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// Every device of every platform, in the loader's order, unusable ones with the reason.
    pub devices: Vec<Device>,
    /// Platforms that list no device.
    pub empty_platforms: Vec<String>,
}

/// Every device of every platform, unusable ones with the reason. `sources` has the kernel that finds out how work-items can
/// share a tile there.
///
/// Errors at once when there is no platform, or no device on any.
pub fn discover(sources: &Sources) -> Result<Vec<Device>> {
    let Survey { devices, empty_platforms } = survey(sources)?;
    if devices.is_empty() {
        let platforms = empty_platforms.join(", ");
        return Err(Error::run(format!("no OpenCL device was found (platforms without one: {platforms})"))
            .with_help(HOW_TO_GET_ONE));
    }
    Ok(devices)
}

/// Every device and every platform that has none. Errors at once when there is no platform.
pub fn survey(sources: &Sources) -> Result<Survey> {
    // Drivers start up when they are first listed, and PoCL 3.1 lists no device to a second thread meanwhile.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    if platform_count()? == 0 {
        return Err(no_platform());
    }
    let platforms = ocl::core::get_platform_ids().map_err(|error| {
        Error::run(format!("the OpenCL platforms could not be listed: {error}"))
            .with_help("install an OpenCL driver, such as PoCL (`apt install pocl-opencl-icd`)")
    })?;
    let mut survey = Survey::default();
    for platform in platforms.into_iter().map(ocl::Platform::new) {
        let devices = ocl::Device::list(platform, Some(ocl::flags::DEVICE_TYPE_ALL)).unwrap_or_default();
        if devices.is_empty() {
            survey.empty_platforms.push(platform.name().unwrap_or_else(|_| "unnamed".into()));
        }
        for device in devices {
            survey.devices.push(inspect(platform, device, sources)?);
        }
    }
    number_twins(survey.devices.iter_mut().map(|device| &mut device.info));
    label(survey.devices.iter_mut().map(|device| &mut device.info));
    Ok(survey)
}

const HOW_TO_GET_ONE: &str = "PoCL runs OpenCL on any CPU; install it with\n  \
    sudo apt-get install pocl-opencl-icd ocl-icd-libopencl1\nor run `make setup` in raycl's folder. \
    If a driver is installed, see that OCL_ICD_VENDORS is unset or names the folder of its .icd file.";

fn no_platform() -> Error {
    Error::run("no OpenCL platform was found: no driver is installed, or the loader cannot see it")
        .with_help(HOW_TO_GET_ONE)
}

/// How many platforms the loader has. The `ocl` crate must not ask first: with none,
/// each of its enumerations sleeps 10 seconds, and some panic.
fn platform_count() -> Result<u32> {
    /// CL_PLATFORM_NOT_FOUND_KHR.
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

/// Counts, for each device, those before it with its platform and name.
fn number_twins<'a>(devices: impl Iterator<Item = &'a mut DeviceInfo>) {
    let mut seen: HashMap<String, usize> = HashMap::new();
    for device in devices {
        device.twins_before = 0;
        let count = seen.entry(device.slug()).or_default();
        device.twins_before = *count;
        *count += 1;
    }
}

/// Gives each device a label that no other has: its name where that is enough, else its slug. Asks for twins
/// to be numbered.
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

fn inspect(platform: ocl::Platform, device: ocl::Device, sources: &Sources) -> Result<Device> {
    let mut asked = Asked { device, failure: None };
    let kind = DeviceKind::from_type(asked.number(Query::Type));
    let extensions: Vec<String> =
        asked.text(Query::Extensions).split_whitespace().map(str::to_owned).collect();
    let raw = |query| ocl::core::get_device_info_raw(device.as_core(), query).ok();
    let platform_name = platform.name().unwrap_or_default().trim().to_owned();
    let mut info = DeviceInfo {
        settings: variables::deciding(&platform_name),
        cores: (kind == DeviceKind::Cpu).then(cores),
        platform: platform_name,
        platform_version: platform.version().unwrap_or_default().trim().to_owned(),
        name: asked.text(Query::Name),
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
    info.unusable = asked.why_unusable();
    if info.unusable.is_none() {
        info.limits.lane_operations = LaneOperations::find(&info, platform, device, sources)?;
    }
    Ok(Device { info, platform, device })
}

/// Cores that this process may use, by affinity and control groups.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A device under questioning, with the first question it failed to answer.
struct Asked {
    device: ocl::Device,
    failure: Option<String>,
}

impl Asked {
    fn limits(&mut self, is_cpu: bool) -> DeviceLimits {
        DeviceLimits {
            local_bytes: self.number(Query::LocalMemSize),
            constant_bytes: self.number(Query::MaxConstantBufferSize),
            global_bytes: self.number(Query::GlobalMemSize),
            allocation_bytes: self.number(Query::MaxMemAllocSize),
            work_group_size: self.number(Query::MaxWorkGroupSize) as usize,
            work_item_sizes: self.work_item_sizes(),
            compute_units: self.number(Query::MaxComputeUnits) as u32,
            native_width: native_width(is_cpu, self.number(Query::NativeVectorWidthFloat)),
            is_cpu,
            lane_operations: LaneOperations::Barriers, // until others are tried
        }
    }

    fn why_unusable(mut self) -> Option<String> {
        let available = self.number(Query::Available) != 0;
        let compiler = self.number(Query::CompilerAvailable) != 0;
        let profiling = self.number(Query::QueueProperties) & ocl::ffi::CL_QUEUE_PROFILING_ENABLE != 0;
        if self.failure.is_some() {
            return self.failure;
        }
        let reasons = [
            (available, "its driver says that it is not available"),
            (compiler, "its driver has no compiler for OpenCL C"),
            (profiling, "its queues cannot time kernels (no profiling)"),
        ];
        reasons.into_iter().find(|(fine, _)| !fine).map(|(_, reason)| reason.to_owned())
    }

    /// An answer of 4 or 8 bytes: every scalar OpenCL answers with.
    fn number(&mut self, query: Query) -> u64 {
        self.numbers(query).first().copied().unwrap_or_default()
    }

    fn work_item_sizes(&mut self) -> [usize; 3] {
        let sizes = self.numbers(Query::MaxWorkItemSizes);
        std::array::from_fn(|axis| sizes.get(axis).map_or(1, |&size| size as usize))
    }

    fn text(&mut self, query: Query) -> String {
        let bytes = self.bytes(query);
        String::from_utf8_lossy(&bytes).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
    }

    fn numbers(&mut self, query: Query) -> Vec<u64> {
        let bytes = self.bytes(query);
        let numbers = parse_numbers(&bytes);
        if numbers.is_empty() {
            self.fail(query, &format!("{} bytes", bytes.len()));
        }
        numbers
    }

    fn bytes(&mut self, query: Query) -> Vec<u8> {
        match ocl::core::get_device_info_raw(self.device.as_core(), query as u32) {
            Ok(bytes) => bytes,
            Err(error) => {
                self.fail(query, &error.to_string());
                Vec::new()
            }
        }
    }

    fn fail(&mut self, query: Query, answer: &str) {
        let answer = answer.split_whitespace().collect::<Vec<_>>().join(" ");
        self.failure.get_or_insert(format!("it does not answer CL_DEVICE query {query:?}: {answer}"));
    }
}

/// The 4-byte number, or the 8-byte numbers, in an answer; none when it is neither.
fn parse_numbers(bytes: &[u8]) -> Vec<u64> {
    if let Ok(word) = <[u8; 4]>::try_from(bytes) {
        return vec![u64::from(u32::from_ne_bytes(word))];
    }
    let (words, rest) = bytes.as_chunks::<8>();
    if rest.is_empty() { words.iter().map(|&word| u64::from_ne_bytes(word)).collect() } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::super::tests::example;
    use super::*;

    #[test]
    fn answers_are_read_by_their_length() {
        assert_eq!(parse_numbers(&7_u32.to_ne_bytes()), [7]);
        assert_eq!(parse_numbers(&(1_u64 << 40).to_ne_bytes()), [1 << 40]);
        let sizes: Vec<u8> = [4096_u64, 64, 1].iter().flat_map(|size| size.to_ne_bytes()).collect();
        assert_eq!(parse_numbers(&sizes), [4096, 64, 1]);
        assert!(parse_numbers(&[1, 2, 3]).is_empty());
        assert!(parse_numbers(&[]).is_empty());
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
}
