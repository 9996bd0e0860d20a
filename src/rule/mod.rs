//! Checks whether measurements confirm the rule by which `render` chooses a strategy. A file lists cases (a scene and
//! an image size each). A sweep contains the times of every candidate strategy on all cases of a file. The
//! constants of the rule are fitted to the times in sweeps.

mod cases;
mod fit;
mod sweep;

pub use cases::{Case, Kind, LastScene, cases};
pub use fit::{fitted, source};
pub use sweep::{Measured, Sweep, Verdict};
