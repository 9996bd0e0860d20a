//! Running an experiment: the plan, what each point needs before it can be timed, the rounds of
//! measurement, and the folder of results.

mod bench;
mod host;
mod observer;
mod plan;
mod results;
mod rounds;
mod run;

pub use bench::Bench;
pub use observer::Observer;
pub use plan::{KeyParts, Plan, Point, Work, key};
pub use results::Results;
pub use run::{Run, dry_run};
