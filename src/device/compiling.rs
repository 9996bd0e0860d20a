//! Compiles the source of a program.

use ocl::{Context, Device, Program};
use std::ffi::CString;

/// Compiles exactly the text of `source`. The program builder of the crate `ocl` puts two empty lines before the text,
/// so the compiler's messages would name wrong line numbers.
pub fn compile(context: &Context, device: Device, source: &str, options: &str) -> ocl::Result<Program> {
    let (source, options) = (CString::new(source)?, CString::new(options)?);
    Program::with_source(context.as_core(), &[source], Some(&[device]), &options)
}
