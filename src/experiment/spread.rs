//! Runs an experiment on several devices of the same model. A block of points that no device has measured yet goes to
//! the next free device, which measures all launches of this block. Each device has its own worker processes, which
//! cast the points of the blocks.

use super::Run;
use super::group::OpenGroup;
use super::launches::{Waiting, serve};
use super::past::MeasuredOn;
use super::result_sink::{FolderSink, ResultSink};
use super::supervisor::Supervisor;
use super::taken::Taken;
use super::waiting::Spawner;
use crate::error::{Error, Result};
use crate::printer::muted_as_here;
use crate::record::{AnchorSample, LaunchEnd, Record, RoundLoad};
use crate::threads::locked;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::thread::Builder;

/// Measures groups on all devices at the same time; `spawners[i]` starts the workers of device `i`. All launches of a
/// group are measured on the same device. Groups of casters on the host are measured first, while no other group is
/// measured. After an error on one device, the other devices finish their current groups before the run ends.
pub fn measure_spread(
    run: &Run<'_>,
    groups: Vec<OpenGroup>,
    sink: &mut FolderSink<'_>,
    spawners: Vec<Box<dyn Spawner + Send>>,
    interrupted: &AtomicBool,
) -> Result<()> {
    let (host, mut kernels): (Vec<_>, Vec<_>) = groups.into_iter().partition(OpenGroup::is_on_host);
    kernels.iter_mut().for_each(|group| group.return_to_device(run, &*sink));
    let seed = run.experiment.timing.seed;
    let (host, kernels) = (Waiting::new(host, seed), Waiting::new(kernels, seed));
    let mut spawners = spawners.into_iter().enumerate().collect::<Vec<_>>();
    let shared = Mutex::new(sink);
    let work = |waiting: &Waiting, device: usize, spawner: &mut dyn Spawner| {
        let mut supervisor = Supervisor::new(spawner, interrupted, run.limit);
        serve(run, waiting, Some(device), &mut supervisor, &mut Shared(&shared))
    };
    if let Some((device, spawner)) = spawners.first_mut() {
        work(&host, *device, spawner.as_mut())?;
    }
    std::thread::scope(|scope| {
        let (work, kernels) = (&work, &kernels);
        let threads: Vec<_> = spawners
            .into_iter()
            .map(|(device, mut spawner)| {
                let work = muted_as_here(move || work(kernels, device, spawner.as_mut()));
                Builder::new().spawn_scoped(scope, work)
            })
            .collect();
        let ended = threads.into_iter().map(|thread| {
            match thread.map_err(|error| Error::no_thread(&error))?.join() {
                Ok(end) => end,
                Err(panic) => std::panic::resume_unwind(panic),
            }
        });
        // Waits until the threads of all devices have ended, even if one of them returned an error.
        ended.collect::<Vec<Result<()>>>().into_iter().collect()
    })
}

/// A sink (a receiver of results) that the threads of several devices use. The sink stores all results in one
/// folder.
struct Shared<'m, 'r, 'k>(&'m Mutex<&'r mut FolderSink<'k>>);

impl ResultSink for Shared<'_, '_, '_> {
    fn works_on(&mut self, what: &str) {
        locked(self.0).works_on(what);
    }

    fn says(&mut self, line: &str) {
        locked(self.0).says(line);
    }

    fn waits(&mut self) {
        locked(self.0).waits();
    }

    fn keep(&mut self, record: Record) -> Result<()> {
        locked(self.0).keep(record)
    }

    fn sample(
        &mut self,
        record: &Record,
        round: u32,
        measured_by: Option<&str>,
        taken: &Taken,
    ) -> Result<()> {
        locked(self.0).sample(record, round, measured_by, taken)
    }

    fn launch_end(&mut self, end: &LaunchEnd) -> Result<()> {
        locked(self.0).launch_end(end)
    }

    fn load(&mut self, load: &RoundLoad) -> Result<()> {
        locked(self.0).load(load)
    }

    fn anchor(&mut self, sample: &AnchorSample) -> Result<()> {
        locked(self.0).anchor(sample)
    }

    fn next_launch(&mut self) -> u32 {
        locked(self.0).next_launch()
    }

    fn advances(&mut self, steps: usize) {
        locked(self.0).advances(steps);
    }

    fn past(&self, key: &str) -> Vec<Taken> {
        locked(self.0).past(key)
    }

    fn past_end(&self, launch: u32) -> Option<LaunchEnd> {
        locked(self.0).past_end(launch)
    }

    fn measured_on(&self, launch: u32) -> Option<MeasuredOn> {
        locked(self.0).measured_on(launch)
    }

    fn near_ns(&self) -> f64 {
        locked(self.0).near_ns()
    }
}
