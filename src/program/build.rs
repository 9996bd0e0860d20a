//! Compiling a [`ProgramSpec`] for a device.

use super::ProgramSpec;
use super::made::is_ptx;
use ocl::enums::{ProgramBuildInfo, ProgramInfo, ProgramInfoResult};
use ocl::{Context, Device, Program};
use std::time::Instant;
use thiserror::Error;

/// Makes a compiler that takes it print registers and spills into the build log; not part of a
/// [`ProgramSpec`], for it changes no code.
const VERBOSE: &str = "-cl-nv-verbose";
/// A compiler prints only when it compiles: this, set to 1 in a process's environment, keeps its cache from answering.
pub const CACHE_DISABLE: &str = "CUDA_CACHE_DISABLE";

/// The compiler refused a program.
#[derive(Debug, Error)]
#[error("{log}")]
pub struct BuildError {
    /// What the compiler said, as it said it.
    pub log: String,
}

/// A program compiled for one device.
#[derive(Debug)]
pub struct BuiltProgram {
    /// The OpenCL program.
    pub program: Program,
    /// How long the build took; drivers answer from their caches where they can.
    pub build_ms: f64,
    device: Device,
    verbose: bool,
}

impl BuiltProgram {
    /// Compiles.
    pub fn build(context: &Context, device: Device, spec: &ProgramSpec) -> Result<Self, BuildError> {
        let start = Instant::now();
        let verbose = prints_resources(device);
        let more = if verbose { format!(" {VERBOSE}") } else { String::new() };
        let program = Program::builder()
            .src(&spec.source)
            .cmplr_opt(format!("{}{more}", spec.options))
            .devices(device)
            .build(context)
            .map_err(|error| BuildError { log: compiler_log(&error.to_string()) })?;
        Ok(Self { program, build_ms: start.elapsed().as_secs_f64() * 1e3, device, verbose })
    }

    /// What the compiler said; empty where it said nothing.
    pub fn log(&self) -> String {
        let log = self.program.build_info(self.device, ProgramBuildInfo::BuildLog);
        let log = log.map(|log| log.to_string()).unwrap_or_default();
        log.trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
    }

    /// The program's binary; empty where the driver gives none. Some drivers compile every kernel anew for it.
    pub fn binary(&self) -> Vec<u8> {
        match self.program.info(ProgramInfo::Binaries) {
            Ok(ProgramInfoResult::Binaries(binaries)) => {
                binaries.into_iter().find(|binary| !binary.is_empty()).unwrap_or_default()
            }
            _ => Vec::new(),
        }
    }

    /// The binary where it is PTX text, else empty. Only a compiler of such binaries is asked.
    pub fn ptx(&self) -> String {
        let binary = if self.verbose { self.binary() } else { Vec::new() };
        if is_ptx(&binary) { String::from_utf8_lossy(&binary).into_owned() } else { String::new() }
    }
}

/// As [`DeviceInfo::prints_resources`](crate::device::DeviceInfo::prints_resources), of a bare handle.
fn prints_resources(device: Device) -> bool {
    let extensions = ocl::core::get_device_info(device, ocl::core::DeviceInfo::Extensions);
    extensions
        .is_ok_and(|names| names.to_string().split_whitespace().any(|name| name == "cl_nv_compiler_options"))
}

/// The compiler's words without the frames of asterisks that `ocl` puts around them.
fn compiler_log(message: &str) -> String {
    let lines: Vec<_> =
        message.lines().filter(|line| !line.contains("####") && !line.trim().is_empty()).collect();
    lines.join("\n")
}
