//! Compiles the source of a program.

use ocl::{Context, Device, Program};
use std::ffi::CString;

/// Compiles exactly this text. The crate ocl's builder of programs puts two empty lines before it, so that the lines in
/// a compiler's messages would be those of another text.
pub fn compile(context: &Context, device: Device, source: &str, options: &str) -> ocl::Result<Program> {
    let (source, options) = (CString::new(source)?, CString::new(options)?);
    Program::with_source(context.as_core(), &[source], Some(&[device]), &options)
}
