//! Compares the rule by which `render` chooses a strategy with measurements. A file lists cases, a
//! sweep times every candidate strategy on them, and the rule's constants are fitted to sweeps.

mod cases;
mod fit;
mod sweep;

pub use cases::{Case, Kind, cases};
pub use fit::{fitted, source};
pub use sweep::{Measured, Sweep, Verdict};
