//! Checks whether measurements confirm the rule by which `render` chooses a strategy. A file lists cases (a scene and
//! an image size each). A sweep contains the times of candidate strategies for such cases on one device. A candidate
//! has no time if the device or the host refuses the candidate. Exhaustive casting also has no time in scenes with many
//! triangles. The constants of the rule are computed from the times in sweeps.

mod cases;
mod fit;
mod sweep;

pub use cases::{Case, Kind, LastScene, cases};
pub use fit::{fitted, source};
pub use sweep::{Measured, Sweep, Verdict};
