//! The processes of a run: workers that measure, and builders that compile programs before workers need them.

use super::Args;
use crate::cache::Cache;
use crate::device::DeviceInfo;
use crate::device_lock::LockName;
use crate::error::Result;
use crate::experiment::{Ahead, Builder, Observer, Processes, Results, Run, Spawner};
use crate::program::ProgramCache;
use crate::record::Record;
use crate::threads::cores;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The largest number of builders (groups of processes that compile programs before workers need them).
const MOST_BUILDERS: usize = 16;
/// Bytes of device memory per builder, by which the number of builders is limited. A driver needs some hundreds of
/// megabytes for each process that opens the device.
const BYTES_PER_BUILDER: u64 = 1 << 30;

/// Measures the missing points; workers write their pictures into `folder`.
pub fn execute(
    args: &Args,
    run: Run<'_>,
    folder: &Path,
    results: &mut Results,
    observer: &mut dyn Observer,
    interrupted: &AtomicBool,
) -> Result<Vec<Record>> {
    let programs = of_workers(&run, |device| ProgramCache::of(Cache::of_user(), device));
    let ahead = Ahead::new(programs, of_workers(&run, |device| LockName::of(Some(device))));
    // With the option `--asleep` (for tests), workers only wait instead of casting, so they need no programs.
    let has_cache = args.asleep.is_none() && run.caches_programs;
    let run = Run { ahead: Some(&ahead).filter(|_| has_cache), ..run };
    let builders = if has_cache { builders(&run, folder) } else { Vec::new() };
    let measured = ahead.beside(builders, args.hang_limit, interrupted, || {
        let workers = || Processes::new(run.jobs(folder, args.fault));
        let workers = || if has_cache { workers().using_driver_cache() } else { workers() };
        if !run.spread {
            return run.execute(results, observer, &mut workers(), interrupted);
        }
        let mut spawners: Vec<Box<dyn Spawner + Send>> = Vec::new();
        for _ in run.devices {
            spawners.push(Box::new(workers()));
        }
        run.execute_spread(results, observer, spawners, interrupted)
    })?;
    if measured.is_ok() && !args.quiet {
        ahead.tally().text().into_iter().for_each(|line| observer.says(&line));
    }
    measured
}

/// Returns the builders of a run, as many as `builder_count` returns.
fn builders(run: &Run<'_>, folder: &Path) -> Vec<Builder> {
    let processes = || Processes::new(run.jobs(folder, None));
    let builder = |_| Builder {
        usual: Box::new(processes().using_driver_cache()),
        without_driver_cache: Box::new(processes()),
    };
    (0..builder_count(cores(), run.devices)).map(builder).collect()
}

/// Returns the number of builders (groups of processes that compile programs before workers need them). There is one
/// builder per core, but there are at most `MOST_BUILDERS` builders, and at most one for each `BYTES_PER_BUILDER` bytes
/// of a device's memory. There is always at least one builder. (For small scenes, `BYTES_PER_BUILDER` bytes suffice for
/// a builder. If a scene is large, only some of the builders hold the scene.)
fn builder_count(cores: usize, devices: &[&DeviceInfo]) -> usize {
    let room = |device: &&DeviceInfo| (device.limits.global_bytes / BYTES_PER_BUILDER).max(1) as usize;
    cores.min(devices.iter().map(room).fold(MOST_BUILDERS, usize::min))
}

/// Returns the value of `of` for the device of each worker, in the order of [`Run::jobs`]: one worker per
/// device and, if the run compares two folders of kernels, one more worker per device for the second folder.
fn of_workers<T: Clone>(run: &Run<'_>, of: impl Fn(&DeviceInfo) -> T) -> Vec<T> {
    let own: Vec<T> = run.devices.iter().map(|&device| of(device)).collect();
    let sets = 1 + usize::from(run.other_sources.is_some());
    std::iter::repeat_n(own, sets).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::asleep;

    #[test]
    fn there_are_as_many_builders_as_cores_unless_a_device_has_less_memory() {
        let device = |global_bytes| {
            let mut device = asleep::device(1.0);
            device.limits.global_bytes = global_bytes;
            device
        };
        let (large, small, tiny) = (device(80 << 30), device(3 << 30), device(1 << 20));
        assert_eq!([2, 64].map(|cores| builder_count(cores, &[&large])), [2, 16]);
        assert_eq!([2, 64].map(|cores| builder_count(cores, &[&large, &small])), [2, 3]);
        assert_eq!((builder_count(64, &[&tiny]), builder_count(64, &[])), (1, 16));
    }
}
