//! Which OpenCL devices there are, what they can hold, and which one is meant.

mod alike;
mod asked;
mod discover;
pub mod drivers;
mod hardware;
mod known;
mod lanes;
mod limits;
pub mod occupancy;
pub mod patience;
mod quieting;
mod select;
mod threads;
pub mod variables;

pub use alike::check_alike;
pub use discover::{Survey, discover, survey};
pub use hardware::Hardware;
pub use known::pick_one;
pub use lanes::LaneOperations;
pub use limits::DeviceLimits;
#[cfg(test)]
pub(crate) use limits::tests::EXAMPLE as EXAMPLE_LIMITS;
pub(crate) use quieting::quieting;
pub use select::{default_place, pick_default, places, select, select_infos};
pub use threads::thread_variables;

use crate::words::counted;
use serde::{Deserialize, Serialize};

/// What a device calls itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// A host's processors.
    Cpu,
    /// A graphics processor.
    Gpu,
    /// A dedicated accelerator.
    Accelerator,
    /// None of these.
    Other,
}

impl DeviceKind {
    /// Its name in records and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Accelerator => "accelerator",
            Self::Other => "other",
        }
    }

    /// Several of them, in words.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Cpu => "CPUs",
            Self::Gpu => "GPUs",
            Self::Accelerator => "accelerators",
            Self::Other => "devices of no known kind",
        }
    }

    /// The kind of a device with this `CL_DEVICE_TYPE`. A simulator that claims to be
    /// everything (Oclgrind) is a GPU: it has no wide vectors and no thread stacks.
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

/// Compiler built-ins beyond OpenCL C that kernels use where a device's compiler takes them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Builtins {
    /// `__builtin_reduce_or` on vectors.
    pub reduce: bool,
    /// `__builtin_prefetch` and `__builtin_nontemporal_store` of global memory.
    pub prefetch: bool,
    /// What work-items that share a tile tell each other with.
    pub lanes: LaneOperations,
    /// Whether the compiler takes `-cl-std=CL3.0`.
    pub opencl_3: bool,
}

/// What a device and its driver say about themselves.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// Platform name.
    pub platform: String,
    /// Platform version, which distinguishes drivers of one name.
    pub platform_version: String,
    /// Device name.
    pub name: String,
    /// Who made the device.
    pub vendor: String,
    /// The OpenCL version the device speaks.
    pub version: String,
    /// Driver version.
    pub driver: String,
    /// What it calls itself.
    pub kind: DeviceKind,
    /// OpenCL extensions.
    pub extensions: Vec<String>,
    /// What it can hold.
    pub limits: DeviceLimits,
    /// What it tells of its hardware beyond that.
    #[serde(default)]
    pub hardware: Hardware,
    /// Environment variables that decide what its driver compiles or how it runs, as the process that listed it has them.
    #[serde(default)]
    pub settings: Vec<variables::Setting>,
    /// Cores that process may use, where the device runs on them.
    #[serde(default)]
    pub cores: Option<usize>,
    /// The threads it casts with, where that is known: of PoCL.
    #[serde(default)]
    pub threads: Option<u32>,
    /// Devices of the same platform and name found before this one.
    pub twins_before: usize,
    /// What records call it: its name, or its slug where another device has the same name.
    pub label: String,
    /// Why nothing can be cast on it, if so.
    pub unusable: Option<String>,
}

impl DeviceInfo {
    /// One line that tells it from every other device.
    pub fn describe(&self) -> String {
        let Self { name, platform, driver, limits, .. } = self;
        let threads = self
            .threads
            .map(|threads| format!(", {}", counted(threads as usize, "thread")))
            .unwrap_or_default();
        let twin = if self.twins_before > 0 { format!(" #{}", self.twins_before + 1) } else { String::new() };
        format!(
            "{name}{twin} ({platform}, driver {driver}): {}, {}{threads}, {} KiB __local",
            self.kind.name(),
            counted(limits.compute_units as usize, "compute unit"),
            limits.local_bytes / 1024
        )
    }

    /// A name for files: lower case, the same every time this device is found.
    pub fn slug(&self) -> String {
        let words = format!("{} {}", self.platform, self.name).to_lowercase();
        let parts: Vec<_> =
            words.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
        match self.twins_before {
            0 => parts.join("-"),
            twins => format!("{}-{}", parts.join("-"), twins + 1),
        }
    }

    /// Everything that names the device and its driver: what it is found by, and a part of keys.
    pub fn identity(&self) -> String {
        let twin =
            if self.twins_before > 0 { format!(" | #{}", self.twins_before + 1) } else { String::new() };
        format!("{}{twin}", self.model())
    }

    /// The same without what tells it from others of its model.
    fn model(&self) -> String {
        let Self { platform, platform_version, name, driver, .. } = self;
        format!("{platform} | {platform_version} | {name} | {driver}")
    }

    /// Everything that decides what its driver compiles of a text.
    pub fn compiler(&self) -> String {
        std::iter::once(self.model()).chain(self.settings.iter().cloned()).collect::<Vec<_>>().join(" | ")
    }

    /// The state that decides its times beside its identity, a part of keys: compute units, cores and the driver's variables.
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

    /// What its compiler takes where it says that it has it.
    pub fn builtins(&self) -> Builtins {
        // Oclgrind's aborts on both; NVIDIA's refuses a prefetch of global memory.
        let simulated = self.platform.to_lowercase().contains("oclgrind");
        Builtins {
            reduce: !simulated,
            prefetch: !simulated && self.kind == DeviceKind::Cpu,
            lanes: self.limits.lane_operations,
            opencl_3: self.speaks_opencl_3(),
        }
    }

    /// Whether its driver speaks OpenCL 3.
    pub fn speaks_opencl_3(&self) -> bool {
        self.version.starts_with("OpenCL 3")
    }

    /// Whether its compiler takes options that make it print registers and spills, and its binaries are PTX.
    pub fn prints_resources(&self) -> bool {
        self.has_extension("cl_nv_compiler_options")
    }

    /// Whether its driver has the binary of what it compiled. PoCL compiles every kernel anew for it, for local sizes that are
    /// told at the launch.
    pub fn has_binaries_at_hand(&self) -> bool {
        !self.platform.to_lowercase().contains("portable computing language")
    }

    /// Whether its extensions include `name`.
    pub fn has_extension(&self, name: &str) -> bool {
        self.extensions.iter().any(|extension| extension == name)
    }

    /// The most `__local` bytes a kernel's *arguments* may take. NVIDIA's driver (580) holds 48 KiB
    /// declared in a kernel but fails a launch with a 48 KiB argument, where 47 KiB works.
    pub fn local_argument_bytes(&self) -> u64 {
        let reserved = if self.vendor.to_lowercase().contains("nvidia") { 1024 } else { 0 };
        self.limits.local_bytes.saturating_sub(reserved)
    }
}

/// A device that was found, with the handles to work on it.
#[derive(Clone, Debug)]
pub struct Device {
    /// What it says about itself.
    pub info: DeviceInfo,
    /// Its platform's handle.
    pub platform: ocl::Platform,
    /// Its own handle.
    pub device: ocl::Device,
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
    fn nvidia_keeps_a_kibibyte_of_local_arguments() {
        let mut device = example("NVIDIA CUDA", "H200", DeviceKind::Gpu, 132);
        assert_eq!(device.local_argument_bytes(), 49152);
        device.vendor = "NVIDIA Corporation".into();
        assert_eq!(device.local_argument_bytes(), 47 * 1024);
    }
}
