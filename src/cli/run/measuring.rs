//! The processes of a run: workers that measure, and beside them those that build programs ahead.

use super::Args;
use crate::cache::Cache;
use crate::error::Result;
use crate::experiment::{Ahead, Observer, Processes, Results, Run, Spawner};
use crate::record::Record;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The most processes that build programs at once: each opens the devices.
const MOST_BUILDERS: usize = 8;

/// Measures what the results lack; workers write their pictures into `folder`.
pub fn execute(
    args: &Args,
    run: Run<'_>,
    folder: &Path,
    results: &mut Results,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
) -> Result<Vec<Record>> {
    let ahead = Ahead::default();
    // What casts nothing has nothing to build.
    let keeps = Cache::of_user().keeps() && args.asleep.is_none();
    let run = Run { ahead: Some(&ahead).filter(|_| keeps), ..run };
    let builders = if keeps { builders(&run, folder)? } else { Vec::new() };
    let measured = ahead.beside(builders, args.hang_limit, interrupted, || {
        let workers = || Processes::new(run.jobs(folder, args.fault));
        let workers = || workers().map(|workers| if keeps { workers.after_builders() } else { workers });
        if !run.spread {
            return run.execute(results, observer, &mut workers()?, interrupted);
        }
        let mut spawners: Vec<Box<dyn Spawner + Send>> = Vec::new();
        for _ in run.devices {
            spawners.push(Box::new(workers()?));
        }
        run.execute_spread(results, observer, spawners, interrupted)
    });
    if measured.is_ok() && !args.quiet {
        ahead.tally().text().into_iter().for_each(|line| observer.says(&line));
    }
    measured
}

/// Number of processes that build programs: one per core.
fn builders(run: &Run<'_>, folder: &Path) -> Result<Vec<Box<dyn Spawner + Send>>> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let builder = |_| {
        let workers = Processes::new(run.jobs(folder, None))?;
        Ok(Box::new(workers) as Box<dyn Spawner + Send>)
    };
    (0..cores.min(MOST_BUILDERS)).map(builder).collect()
}
