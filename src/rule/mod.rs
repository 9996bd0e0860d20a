//! The rule by which `render` chooses a strategy, held against measurements: cases in a file, sweeps of every way that may be chosen,
//! and constants fitted to them.

mod cases;
mod fit;
mod sweep;

pub use cases::{Case, Kind, cases};
pub use fit::{fitted, source};
pub use sweep::{Measured, Sweep, Verdict};
