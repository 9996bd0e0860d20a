//! From a strategy to a compiled program: source assembly, defines, build.

mod build;
mod defines;
mod include;
pub mod made;
mod source;
mod spec;

pub use crate::sources::Sources;
pub use build::{BuildError, BuiltProgram, CACHE_DISABLE};
pub use made::MadeKernel;
pub use spec::ProgramSpec;
