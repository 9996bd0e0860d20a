//! Measures one experiment on many machines. A launcher (Slurm, MPI, Kubernetes, a CI system, a shell loop) starts the
//! processes. This module splits the plan among the processes, lets each process write to its own folder, and merges
//! the results.
//!
//! `number` and `launcher` find out which shard a process measures. `plan` reads and writes the file that all shards
//! share. For each kind of device, `kind` reads and writes the list of points that are measured on this kind. `attempt`
//! makes the folder of one process. With `pulse`, other processes can see that an attempt's process is alive. `watch`
//! checks that the launcher (the program, such as `mpirun`, that started an attempt's process) is alive. `merge` merges
//! attempts into one folder of results. `missing` finds the points that still have to be measured, and makes the
//! commands that measure these points. `status` finds the state of each attempt. `sbatch` makes scripts for Slurm.

mod attempt;
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
pub use kind::{Kind, KindPoint};
pub use merge::{Merged, merge, no_shards};
pub use missing::{Missing, MissingKind, missing};
pub use number::{Asked, Shard};
pub use plan::{Header, ShardPlan};
pub use pulse::{Beat, Pulse, Steps};
pub use sbatch::{Wishes, scripts};
pub use status::{State, Status, status};
pub use watch::watch_launcher;
