//! Runs an experiment: makes the plan, checks each point before it is timed, measures the points in rounds, and writes
//! the folder of results.
//!
//! A [`Run`] has an experiment, devices and kernels. The experiment's points run in worker processes, one
//! point at a time on each device. [`Run::execute`] asks a worker to check a point or to cast a frame of the
//! point. The worker replies with a record or a sample. The supervisor handles workers that die or hang.

mod ahead;
pub mod asleep;
mod block;
mod check;
mod complete;
mod complete_launches;
mod device_list;
mod draft;
mod dry_run;
mod duration;
mod earlier;
mod execute;
mod fault;
#[cfg(test)]
mod fixtures;
mod group;
mod host;
mod key;
mod launches;
mod lock;
mod moved_processors;
mod observer;
mod past;
mod pending;
mod pictures;
mod piece;
mod plan;
mod point_failure;
mod process;
mod protocol;
mod ready;
mod reference_cache;
mod request_handler;
mod result_sink;
mod results;
mod rounds;
mod run;
mod scenes;
mod spread;
mod supervisor;
mod taken;
mod views;
mod waiting;
mod worker;

pub use ahead::{Ahead, Builder, Tally};
pub use block::{Block, Cost, contain_each_once, cut};
pub use device_list::{find_devices, list_devices, why_devices_are_not_listed};
pub use dry_run::{Forecast, dry_run};
pub use duration::Expected;
pub use fault::{Fault, Step};
pub use host::host_identity;
pub use lock::Lock;
pub use observer::Observer;
pub use past::Past;
pub use pictures::Pictures;
pub use plan::{Plan, Point, Work};
pub use point_failure::PointFailure;
pub use process::Processes;
pub use protocol::{Built, Job, Listed, Phase, Reply, Request};
pub use results::Results;
pub use run::{MOVED_SAMPLES, Run, check_moved_samples, keeps_moved_samples};
pub use scenes::distinct_scenes;
pub use taken::Taken;
pub use waiting::{Death, Spawner, Wait, Worker};
pub use worker::serve;
