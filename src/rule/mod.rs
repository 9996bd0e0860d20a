//! The rule by which `render` chooses a strategy, compared with measurements: cases in a file, sweeps that
//! time every candidate strategy, and constants fitted to the sweeps.

mod cases;
mod fit;
mod sweep;

pub use cases::{Case, Kind, cases};
pub use fit::{fitted, source};
pub use sweep::{Measured, Sweep, Verdict};
