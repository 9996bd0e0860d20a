//! From a strategy to a compiled program: source assembly, defines, build.

mod build;
pub mod made;
mod source;
mod spec;

pub use build::{BuildError, BuiltProgram, CACHE_DISABLE};
pub use made::MadeKernel;
pub use source::Sources;
pub use spec::ProgramSpec;
