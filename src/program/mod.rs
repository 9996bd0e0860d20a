//! From a strategy to a compiled program: source assembly, defines, build.

mod build;
mod source;
mod spec;

pub use build::{BuildError, BuiltProgram};
pub use source::Sources;
pub use spec::ProgramSpec;
