//! Compiling a [`ProgramSpec`] for a device.

use super::ProgramSpec;
use super::compiled::is_ptx;
use super::kept::{Kept, KeptProgram};
use crate::device::quieting;
use ocl::enums::{ProgramBuildInfo, ProgramInfo, ProgramInfoResult};
use ocl::{Context, Device, Program};
use std::ffi::CString;
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
    /// Whether it was kept since an earlier build, and nothing was compiled.
    pub from_cache: bool,
    device: Device,
    verbose: bool,
    /// What the compiler said when it compiled what was kept.
    kept_log: Option<String>,
    kept: Kept,
    key: String,
}

impl BuiltProgram {
    /// Takes what was kept of an earlier build, or else compiles; keeps that at once where the driver has the binary at hand.
    pub fn build(
        context: &Context,
        device: Device,
        spec: &ProgramSpec,
        kept: &Kept,
    ) -> Result<Self, BuildError> {
        let start = Instant::now();
        let verbose = prints_resources(device);
        let more = if verbose { VERBOSE } else { quieting(device) };
        let options = format!("{} {more}", spec.options).trim_end().to_owned();
        let key = kept.key(&spec.source, &options);
        let found = kept.find(&key).and_then(|found| Some((load(context, device, &found, &options)?, found)));
        let (program, kept_log) = match found {
            Some((program, found)) => (program, Some(found.log)),
            None => (compile(context, device, &spec.source, &options)?, None),
        };
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        let from_cache = kept_log.is_some();
        let kept = kept.clone();
        let built = Self { program, build_ms, from_cache, device, verbose, kept_log, kept, key };
        if built.kept.has_binaries_at_hand() {
            built.keep();
        }
        Ok(built)
    }

    /// Keeps what was compiled for later builds; says whether that is kept now. Not every driver has the binary at hand.
    pub fn keep(&self) -> bool {
        if self.from_cache || !self.kept.keeps() {
            return self.from_cache;
        }
        let log = self.log();
        // Registers are printed when a compiler compiles: what a driver's cache has answered is without them.
        if self.verbose && log.is_empty() {
            return false;
        }
        let binary = self.binary();
        !binary.is_empty() && self.kept.keep(&self.key, &KeptProgram { log, binary })
    }

    /// What the compiler said; empty where it said nothing.
    pub fn log(&self) -> String {
        if let Some(log) = &self.kept_log {
            return log.clone();
        }
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

/// A program from source.
fn compile(context: &Context, device: Device, source: &str, options: &str) -> Result<Program, BuildError> {
    let mut builder = Program::builder();
    let builder = builder.src(source).cmplr_opt(options).devices(device);
    builder.build(context).map_err(|error| BuildError { log: compiler_log(&error.to_string()) })
}

/// A program from a binary that was kept; none where the driver does not take it.
fn load(context: &Context, device: Device, found: &KeptProgram, options: &str) -> Option<Program> {
    let options = CString::new(options).ok()?;
    Program::with_binary(context.as_core(), &[device], &[&found.binary], &options).ok()
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
