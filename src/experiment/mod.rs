//! Running an experiment: the plan, what each point needs before it can be timed, the rounds of
//! measurement, and the folder of results.

mod bench;
mod check;
mod complete;
mod dry_run;
mod host;
mod keeper;
mod observer;
mod oracle;
mod pictures;
mod plan;
mod results;
mod rounds;
mod run;
mod session;

pub use dry_run::{Forecast, dry_run};
pub use observer::Observer;
pub use plan::{KeyParts, Plan, Point, Work, key};
pub use results::Results;
pub use run::Run;
