//! Makes a compiled OpenCL program from a strategy: joins kernel files, computes the defines, and compiles
//! the program.

mod build;
pub mod compiled;
mod defines;
mod frame_kernels;
mod include;
pub mod preprocess;
mod source;
mod spec;
mod stored;

pub use crate::sources::Sources;
pub use build::{BuildError, BuiltProgram, CACHE_DISABLE};
pub use compiled::CompiledKernel;
pub use frame_kernels::frame_kernels;
pub use spec::ProgramSpec;
#[cfg(test)]
pub(crate) use stored::StoredProgram;
pub use stored::{AFRESH, ProgramCache};
