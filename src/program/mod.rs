//! Makes a compiled program from a strategy: joins source files, computes the defines, and compiles.

mod build;
pub mod compiled;
mod defines;
mod frame_kernels;
mod include;
mod kept;
pub mod preprocess;
mod source;
mod spec;

pub use crate::sources::Sources;
pub use build::{BuildError, BuiltProgram, CACHE_DISABLE};
pub use compiled::CompiledKernel;
pub use frame_kernels::frame_kernels;
pub use kept::Kept;
#[cfg(test)]
pub(crate) use kept::KeptProgram;
pub use spec::ProgramSpec;
