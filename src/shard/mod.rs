//! One experiment over many machines. Whatever starts n processes (Slurm, MPI, Kubernetes, a CI, a shell loop) places them; this splits
//! the plan among them, lets each write to a folder of its own, and puts the pieces together.
//!
//! `number` and `launcher`: which shard a process is. `block`: the plan cut into blocks, blocks dealt out to shards. `plan`: the file that
//! all shards share, written by the first; `kind`: the points of one kind of device. `attempt`: the folder of one process, with `pulse`,
//! by which others see whether it lives, and `watch`, by which it sees whether its launcher lives. `merge`: attempts to one folder of
//! results; `missing`: what is yet to be measured, and by which command; `status`: how attempts are. `sbatch`: scripts for Slurm.

mod attempt;
mod block;
mod kind;
mod launcher;
mod merge;
mod missing;
mod number;
mod plan;
mod pulse;
mod sbatch;
mod status;
mod watch;

pub use attempt::{About, Attempt, End};
pub use block::{Block, Cost, cut};
pub use kind::{Kind, KindPoint};
pub use merge::{Merged, merge, no_shards};
pub use missing::{Missing, missing};
pub use number::{Asked, Shard};
pub use plan::{Header, ShardPlan};
pub use pulse::{Beat, Pulse, Steps};
pub use sbatch::{Wishes, scripts};
pub use status::{State, Status, status};
pub use watch::watch_launcher;
