//! Finds OpenCL devices, describes them and their limits, and selects devices.

mod alike;
mod asked;
mod common_name;
mod compiling;
mod direct;
mod discover;
pub mod drivers;
mod errors;
mod hardware;
mod kernel_cache;
mod known;
mod lanes;
mod limits;
pub mod occupancy;
mod outer_loops;
mod panics;
pub mod patience;
mod quieting;
mod select;
mod threads;
pub mod variables;

pub use alike::check_alike;
pub(crate) use common_name::{both_names, common_name, common_names};
pub(crate) use compiling::compile;
pub(crate) use direct::{build, sub_group_size};
pub use discover::{Survey, discover, no_device_advice, survey};
pub(crate) use errors::{CallError, lacks_resources, without_frame};
pub use hardware::Hardware;
pub use kernel_cache::{cache_variables, folder_advice};
pub use known::{list, pick_one};
pub use lanes::{LaneOperations, LaneTest};
pub use limits::DeviceLimits;
pub(crate) use limits::power_of_two;
#[cfg(test)]
pub(crate) use limits::tests::EXAMPLE as EXAMPLE_LIMITS;
pub use outer_loops::loop_variables;
pub use panics::report_panics;
pub(crate) use panics::{forget_failures, guarded, note_device, note_failure, noted, tell_panics};
pub(crate) use quieting::{Hush, quieting};
pub(crate) use select::has_part;
pub use select::{default_index, matching_indices, select};
pub use threads::{pinning_variables, thread_variables};

use crate::error::Result;
use crate::sources::Sources;
use crate::words::counted;
use serde::{Deserialize, Serialize};

/// Returns true if the text `platform` begins with the name of PoCL's platform.
pub(crate) fn is_pocl(platform: &str) -> bool {
    platform.to_lowercase().starts_with("portable computing language")
}

/// The type of device (`CL_DEVICE_TYPE`) that a device reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// The processors of a host.
    Cpu,
    /// A graphics processor.
    Gpu,
    /// A dedicated accelerator.
    Accelerator,
    /// A device that is neither a CPU, nor a GPU, nor an accelerator.
    Other,
}

impl DeviceKind {
    /// Returns the name of this kind of device in records and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Accelerator => "accelerator",
            Self::Other => "other",
        }
    }

    /// Returns the plural of this kind of device, for messages.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Cpu => "CPUs",
            Self::Gpu => "GPUs",
            Self::Accelerator => "accelerators",
            Self::Other => "devices of no known kind",
        }
    }

    /// Returns the kind of a device with this `CL_DEVICE_TYPE`. A simulator that reports every type
    /// (Oclgrind) counts as a GPU, since it has neither wide vectors nor thread stacks.
    fn from_type(flags: u64) -> Self {
        let is = |flag| flags & flag != 0;
        if is(ocl::ffi::CL_DEVICE_TYPE_GPU) {
            Self::Gpu
        } else if is(ocl::ffi::CL_DEVICE_TYPE_CPU) {
            Self::Cpu
        } else if is(ocl::ffi::CL_DEVICE_TYPE_ACCELERATOR) {
            Self::Accelerator
        } else {
            Self::Other
        }
    }
}

/// What a device's compiler supports beyond OpenCL C 1.2. Kernels use each of these features only if the
/// compiler supports it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Builtins {
    /// True if kernels may call `__builtin_reduce_or` on vectors.
    pub reduce: bool,
    /// True if kernels may call `__builtin_prefetch` and `__builtin_nontemporal_store` for global memory.
    pub prefetch: bool,
    /// How work-items that share a tile exchange values.
    pub lanes: LaneOperations,
    /// True if the compiler accepts `-cl-std=CL3.0`.
    pub opencl_3: bool,
}

/// The properties of a device. The device and its driver report most properties, but raycl itself determines
/// `settings`, `cores`, `threads`, `twins_before`, `label` and `unusable`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// The name of the device's OpenCL platform.
    pub platform: String,
    /// The version of the device's OpenCL platform, which distinguishes drivers with the same name.
    pub platform_version: String,
    /// The device's name, as its driver reports it.
    pub name: String,
    /// The device's vendor.
    pub vendor: String,
    /// The OpenCL version that the device supports.
    pub version: String,
    /// The version of the device's driver.
    pub driver: String,
    /// The type of device (CPU, GPU, ...) that the device reports.
    pub kind: DeviceKind,
    /// The OpenCL extensions that the device supports.
    pub extensions: Vec<String>,
    /// The device's limits.
    pub limits: DeviceLimits,
    /// Properties of the hardware that only some drivers report.
    #[serde(default)]
    pub hardware: Hardware,
    /// Environment variables that affect what the device's driver compiles or how the driver runs, with their values in
    /// the process that listed the device.
    #[serde(default)]
    pub settings: Vec<variables::Setting>,
    /// Number of cores that the process may use; `None` if the device is not a CPU.
    #[serde(default)]
    pub cores: Option<usize>,
    /// Number of threads with which the device runs kernels; `None` if unknown. The number of threads is
    /// known only for PoCL.
    #[serde(default)]
    pub threads: Option<u32>,
    /// Number of devices that have the same platform and name and precede this device in the list of devices.
    pub twins_before: usize,
    /// The device's name in records: its own name, or its name for files (`slug`) if another device has the same name.
    pub label: String,
    /// The reason why raycl cannot use the device; `None` if the device is usable.
    pub unusable: Option<String>,
}

impl DeviceInfo {
    /// Returns one line of text that distinguishes the device from every other device.
    pub fn describe(&self) -> String {
        let Self { platform, driver, limits, .. } = self;
        let threads = self
            .threads
            .map(|threads| format!(", {}", counted(threads as usize, "thread")))
            .unwrap_or_default();
        let twin = if self.twins_before > 0 { format!(" #{}", self.twins_before + 1) } else { String::new() };
        let name = common_name(&self.name);
        let of_driver = if name == self.name { String::new() } else { format!("{}, ", self.name) };
        format!(
            "{name}{twin} ({of_driver}{platform}, driver {driver}): {}, {}{threads}, {} KiB __local",
            self.kind.name(),
            counted(limits.compute_units as usize, "compute unit"),
            limits.local_bytes / 1024
        )
    }

    /// Returns the name under which people know the device, or the device's label if other devices have the same name.
    pub fn common_name(&self) -> String {
        self.own_label().map_or_else(|| common_name(&self.name), str::to_owned)
    }

    /// Returns the device's name for use in file names: in lower case, and the same in every run.
    pub fn slug(&self) -> String {
        let words = format!("{} {}", self.platform, self.name).to_lowercase();
        let parts: Vec<_> =
            words.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
        match self.twins_before {
            0 => parts.join("-"),
            twins => format!("{}-{}", parts.join("-"), twins + 1),
        }
    }

    /// Returns the label if other devices have the same name; `None` if the label is the device's own name.
    pub fn own_label(&self) -> Option<&str> {
        (self.label != self.name).then_some(self.label.as_str())
    }

    /// Returns a text that identifies the device and its driver. raycl uses this text to find the device
    /// again, and as a part of the keys under which measured points are stored.
    pub fn identity(&self) -> String {
        let twin =
            if self.twins_before > 0 { format!(" | #{}", self.twins_before + 1) } else { String::new() };
        format!("{}{twin}", self.model())
    }

    /// Returns the text of [`Self::identity`] without the number that distinguishes the device from other
    /// devices with the same name.
    fn model(&self) -> String {
        let Self { platform, platform_version, name, driver, .. } = self;
        format!("{platform} | {platform_version} | {name} | {driver}")
    }

    /// Returns the number that makes the device's programs differ from those of other devices with the same
    /// name (twins). For a CPU, the function returns `twins_before`. For a device that is no CPU, the
    /// function returns 0, since GPUs with the same name can share a compiled program.
    pub fn program_twin(&self) -> usize {
        if self.limits.is_cpu { self.twins_before } else { 0 }
    }

    /// Returns a text that names what may affect the compiled code of a program, besides the program's source and
    /// options. The text names the device, its driver, and the driver's environment variables, except variables that
    /// certainly do not affect compiled code.
    pub fn compiler(&self) -> String {
        let settings = self.settings.iter().filter(|setting| variables::compiles(setting)).cloned();
        std::iter::once(self.model()).chain(settings).collect::<Vec<_>>().join(" | ")
    }

    /// Returns a text of the properties that affect times measured on the device, beyond the device's
    /// identity: compute units, cores, threads and the driver's variables. The text of the device's
    /// properties is part of the keys under which measured points are stored.
    pub fn state(&self) -> String {
        let units = Some(format!("{} compute units", self.limits.compute_units));
        let cores = self.cores.map(|cores| format!("{cores} cores"));
        let threads = self.threads.map(|threads| format!("{threads} threads"));
        units
            .into_iter()
            .chain(cores)
            .chain(threads)
            .chain(self.settings.iter().cloned())
            .collect::<Vec<_>>()
            .join(" | ")
    }

    /// Returns which built-in functions kernels may use with the device's compiler. For reductions, the
    /// kernel's source also tests `__has_builtin`.
    pub fn builtins(&self) -> Builtins {
        let platform = self.platform.to_lowercase();
        // Oclgrind's compiler aborts on reductions.
        let simulated = platform.contains("oclgrind");
        // raycl cannot try out whether a compiler supports `__builtin_prefetch`: a compiler without this
        // function may end the process, as those of Oclgrind and Mesa do. The compilers of PoCL and Intel for
        // CPUs support `__builtin_prefetch`.
        let prefetches = is_pocl(&platform) || platform.starts_with("intel");
        Builtins {
            reduce: !simulated,
            prefetch: prefetches && self.kind == DeviceKind::Cpu,
            lanes: self.limits.lane_operations,
            opencl_3: self.speaks_opencl_3(),
        }
    }

    /// Returns true if the device's driver supports OpenCL 3.
    pub fn speaks_opencl_3(&self) -> bool {
        self.version.starts_with("OpenCL 3")
    }

    /// Returns true if the device's compiler has an option to print registers and spills. NVIDIA's compiler has this
    /// option, and returns PTX as the binary of a program.
    pub fn prints_resources(&self) -> bool {
        self.extensions.iter().any(|extension| extension == "cl_nv_compiler_options")
    }

    /// Returns true if the device's driver can return a compiled program's binary without compiling again. PoCL is a
    /// driver that cannot do this: it usually compiles a kernel when the kernel starts, for the kernel's local size.
    /// PoCL would have to compile every kernel again before it could return a binary.
    pub fn has_binaries_at_hand(&self) -> bool {
        !is_pocl(&self.platform)
    }
}

/// A device's properties, with the OpenCL handles to use the device.
#[derive(Clone, Debug)]
pub struct Device {
    /// The device's properties.
    pub info: DeviceInfo,
    /// The OpenCL handle of the device's platform.
    pub platform: ocl::Platform,
    /// The OpenCL handle of the device.
    pub device: ocl::Device,
    /// True if `info.limits.lane_operations` is the result of a test, or if no test is needed because
    /// raycl uses only barriers on the device, for example because it is a CPU. If false, `lane_operations`
    /// is assumed from the device's extensions, or is `Barriers` because the device could not be tested.
    pub lanes_are_tested: bool,
}

impl Device {
    /// Finds the device's lane operations (how its work-items exchange values) by a test, unless they are
    /// known already. If the device cannot be used now, for example because its memory is full, its lane
    /// operations become barriers, which work on any device; the next call of this function tests the device
    /// again.
    ///
    /// # Errors
    ///
    /// Fails if one of the user's kernel files is wrong, or if no thread can be started.
    pub fn test_lanes(&mut self, sources: &Sources) -> Result<()> {
        if !self.lanes_are_tested {
            let _patience = patience::Patience::of_guarded()?;
            let operations = LaneOperations::find(&self.info, self.platform, self.device, sources)?;
            self.take_lanes(operations);
        }
        Ok(())
    }

    /// Sets the lane operations (how work-items exchange values) to the operations that the test found.
    /// `None` means that the device could not be tested.
    fn take_lanes(&mut self, operations: Option<LaneOperations>) {
        self.info.limits.lane_operations = operations.unwrap_or(LaneOperations::Barriers);
        self.lanes_are_tested = operations.is_some();
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn example(platform: &str, name: &str, kind: DeviceKind, compute_units: u32) -> DeviceInfo {
        DeviceInfo {
            platform: platform.into(),
            platform_version: "OpenCL 3.0 PoCL 3.1".into(),
            name: name.into(),
            vendor: "A Vendor".into(),
            version: "OpenCL 3.0".into(),
            driver: "3.1".into(),
            kind,
            extensions: vec!["cl_khr_fp64".into()],
            limits: DeviceLimits { compute_units, ..limits::tests::EXAMPLE },
            hardware: Hardware::default(),
            settings: Vec::new(),
            cores: None,
            threads: None,
            twins_before: 0,
            label: name.into(),
            unusable: None,
        }
    }

    #[test]
    fn slugs_fit_file_names_and_tell_twins_apart() {
        let mut device = example("NVIDIA CUDA", "NVIDIA H200 (80 GB)", DeviceKind::Gpu, 132);
        assert_eq!(device.slug(), "nvidia-cuda-nvidia-h200-80-gb");
        device.twins_before = 1;
        assert_eq!(device.slug(), "nvidia-cuda-nvidia-h200-80-gb-2");
        assert!(device.describe().contains("#2") && device.identity().ends_with("#2"));
    }

    #[test]
    fn a_simulator_of_everything_is_a_gpu() {
        assert_eq!(DeviceKind::from_type(0b1111), DeviceKind::Gpu);
        assert_eq!(DeviceKind::from_type(0b0010), DeviceKind::Cpu);
        assert_eq!(DeviceKind::from_type(0b1000), DeviceKind::Accelerator);
        assert_eq!(DeviceKind::from_type(0), DeviceKind::Other);
    }

    #[test]
    fn a_description_has_the_driver_the_units_and_the_kibibytes() {
        let mut device = example("PoCL", "EPYC", DeviceKind::Cpu, 8);
        assert_eq!(device.describe(), "EPYC (PoCL, driver 3.1): cpu, 8 compute units, 48 KiB __local");
        device.threads = Some(1);
        assert!(device.describe().ends_with("cpu, 8 compute units, 1 thread, 48 KiB __local"));
    }

    #[test]
    fn kernels_use_built_ins_that_the_compiler_has() {
        let of = |platform: &str, kind| {
            let builtins = example(platform, "a device", kind, 2).builtins();
            (builtins.reduce, builtins.prefetch)
        };
        assert_eq!(of("Portable Computing Language", DeviceKind::Cpu), (true, true));
        assert_eq!(of("Portable Computing Language", DeviceKind::Gpu), (true, false));
        assert_eq!(of("Intel(R) OpenCL", DeviceKind::Cpu), (true, true));
        assert_eq!(of("NVIDIA CUDA", DeviceKind::Gpu), (true, false));
        assert_eq!(of("rusticl", DeviceKind::Cpu), (true, false));
        assert_eq!(of("Oclgrind", DeviceKind::Cpu), (false, false));
    }
}
