//! Compiles the source of an OpenCL program.

use super::direct::build;
use super::errors::CallError;
use ocl::core::create_program_with_source;
use ocl::{Context, Device, Program};
use std::ffi::CString;

/// Compiles exactly the text of `source`. The program builder of the crate `ocl` puts two empty lines before the text,
/// so the compiler's messages would name wrong line numbers.
pub fn compile(context: &Context, device: Device, source: &str, options: &str) -> Result<Program, CallError> {
    let without_zeros = |text: &str| CString::new(text).map_err(|error| CallError::new(error.to_string()));
    let (source, options) = (without_zeros(source)?, without_zeros(options)?);
    build(create_program_with_source(context.as_core(), &[source])?, device, &options)
}
