//! Compiling a [`ProgramSpec`] for a device.

use super::ProgramSpec;
use ocl::{Context, Device, Program};
use std::time::Instant;
use thiserror::Error;

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
}

impl BuiltProgram {
    /// Compiles.
    pub fn build(context: &Context, device: Device, spec: &ProgramSpec) -> Result<Self, BuildError> {
        let start = Instant::now();
        let program = Program::builder()
            .src(&spec.source)
            .cmplr_opt(spec.options.as_str())
            .devices(device)
            .build(context)
            .map_err(|error| BuildError { log: compiler_log(&error.to_string()) })?;
        Ok(Self { program, build_ms: start.elapsed().as_secs_f64() * 1e3 })
    }
}

/// The compiler's words without the frames of asterisks that `ocl` puts around them.
fn compiler_log(message: &str) -> String {
    let lines: Vec<_> =
        message.lines().filter(|line| !line.contains("####") && !line.trim().is_empty()).collect();
    lines.join("\n")
}
