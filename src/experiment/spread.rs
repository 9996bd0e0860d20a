//! A run on several devices of one kind: each group of points on whichever is free, one worker a device.

use super::Run;
use super::group::{Open, measure_group};
use super::keeper::{Keep, Keeper};
use super::supervisor::{Spawner, Supervisor};
use crate::error::Result;
use crate::launch::FrameTimes;
use crate::record::Record;
use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Groups still to be measured.
type Waiting = Mutex<VecDeque<Vec<Open>>>;

/// Measures groups on all devices at once, `spawners[i]` starting the workers of device `i`. Groups on the host go
/// first and alone. The first error ends the run once the groups under way have ended.
pub fn measure_spread(
    run: &Run<'_>,
    groups: Vec<Vec<Open>>,
    keeper: &mut Keeper<'_>,
    spawners: Vec<Box<dyn Spawner + Send>>,
    interrupted: &AtomicBool,
) -> Result<()> {
    let on_host = |group: &Vec<Open>| group.iter().any(|open| open.record.is_baseline());
    let (host, kernels): (Vec<_>, Vec<_>) = groups.into_iter().partition(on_host);
    let waiting = Mutex::new(VecDeque::from(host));
    let mut spawners = spawners.into_iter().enumerate().collect::<Vec<_>>();
    let shared = Mutex::new(keeper);
    let serve = |device: usize, spawner: &mut dyn Spawner| {
        let mut supervisor = Supervisor::new(spawner, interrupted, run.limit);
        while let Some(mut group) = next(&waiting) {
            group.iter_mut().for_each(|open| open.device = device);
            let kept = measure_group(group, run, &mut supervisor, &mut Shared(&shared));
            // Nobody takes another group after an error.
            kept.inspect_err(|_| locked(&waiting).clear())?;
        }
        Ok(())
    };
    if let Some((device, spawner)) = spawners.first_mut() {
        serve(*device, spawner.as_mut())?;
    }
    locked(&waiting).extend(kernels);
    std::thread::scope(|scope| {
        let serve = &serve;
        let threads: Vec<_> = spawners
            .into_iter()
            .map(|(device, mut spawner)| scope.spawn(move || serve(device, spawner.as_mut())))
            .collect();
        let ended = threads.into_iter().map(|thread| match thread.join() {
            Ok(end) => end,
            Err(panic) => std::panic::resume_unwind(panic),
        });
        // All are waited for, whichever failed.
        ended.collect::<Vec<Result<()>>>().into_iter().collect()
    })
}

fn next(waiting: &Waiting) -> Option<Vec<Open>> {
    locked(waiting).pop_front()
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A keeper that several devices hand their findings to.
struct Shared<'m, 'r, 'k>(&'m Mutex<&'r mut Keeper<'k>>);

impl Keep for Shared<'_, '_, '_> {
    fn works_on(&mut self, what: &str) {
        locked(self.0).works_on(what);
    }

    fn says(&mut self, line: &str) {
        locked(self.0).says(line);
    }

    fn keep(&mut self, record: Record) -> Result<()> {
        locked(self.0).keep(record)
    }

    fn sample(&mut self, key: &str, round: u32, times: &FrameTimes) -> Result<()> {
        locked(self.0).sample(key, round, times)
    }

    fn past(&self, key: &str) -> (Vec<FrameTimes>, u32) {
        locked(self.0).past(key)
    }
}
