//! Points of one scene, size and device: each is checked, then those that passed are timed together.

use super::Run;
use super::complete::complete;
use super::keeper::Keep;
use super::rounds::{Rounds, Start, measure};
use super::supervisor::{Supervisor, Task};
use crate::error::Result;
use crate::launch::FrameTimes;
use crate::measure::{StopReason, StoppingRule};
use crate::record::Record;

/// A point that is yet to be measured.
pub struct Open {
    /// Its place in the plan.
    pub point: usize,
    /// The device whose worker runs it.
    pub device: usize,
    /// For the observer.
    pub label: String,
    /// What is known of it.
    pub record: Record,
}

impl Open {
    fn task(&self) -> Task<'_> {
        Task { point: self.point, device: self.device, key: &self.record.key }
    }
}

/// Measures points that are compared with each other. While they are timed nobody else measures on their device.
pub fn measure_group(
    group: Vec<Open>,
    run: &Run<'_>,
    supervisor: &mut Supervisor<'_>,
    keeper: &mut impl Keep,
) -> Result<()> {
    let Some(device) = group.first().map(|open| run.lock_name(open)) else { return Ok(()) };
    let interrupted = supervisor.interrupted();
    let mut passed = Vec::new();
    for mut open in group {
        // A check needs no lock, but it would disturb whoever holds it: it begins when nobody does.
        drop(run.locks.take(&device, &mut |line| keeper.says(line), interrupted)?);
        keeper.works_on(&format!("checking {}", open.label));
        match supervisor.check(open.task())? {
            Ok((record, true)) => {
                open.record = *record;
                passed.push(open);
            }
            Ok((record, false)) => keeper.keep(*record)?,
            Err(refusal) => keeper.keep(refusal.write_into(open.record))?,
        }
    }
    if passed.is_empty() {
        return Ok(());
    }
    let timing = &run.experiment.timing;
    let rule = StoppingRule {
        min_samples: timing.min_samples as usize,
        max_samples: timing.max_samples as usize,
        relative_sigma: timing.relative_sigma,
        time_limit_ms: timing.time_limit_ms,
    };
    let start = start(&passed, keeper);
    let _held = run.locks.take(&device, &mut |line| keeper.says(line), interrupted)?;
    measure(start, &rule, timing.seed, &mut Timed { points: &passed, supervisor, keeper })
}

/// Where an earlier run left off: every point's samples, and a round that none of them has a sample of.
fn start(points: &[Open], keeper: &impl Keep) -> Start {
    let of = |open: &Open| keeper.past(&open.record.key);
    let (frames, rounds): (Vec<_>, Vec<u32>) = points.iter().map(of).unzip();
    Start { frames, round: rounds.into_iter().max().unwrap_or(0) }
}

/// A group whose samples and records are kept as they come.
struct Timed<'b, 's, K> {
    points: &'b [Open],
    supervisor: &'b mut Supervisor<'s>,
    keeper: &'b mut K,
}

impl<K: Keep> Rounds for Timed<'_, '_, K> {
    fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>> {
        let open = &self.points[point];
        self.keeper.works_on(&format!("timing {}", open.label));
        match self.supervisor.cast(open.task())? {
            Ok(times) => Ok(Some(times)),
            Err(refusal) => self.keeper.keep(refusal.write_into(open.record.clone())).map(|()| None),
        }
    }

    fn sampled(&mut self, point: usize, round: u32, times: &FrameTimes) -> Result<()> {
        self.keeper.sample(&self.points[point].record.key, round, times)
    }

    fn stopped(&mut self, point: usize, frames: Vec<FrameTimes>, reason: StopReason) -> Result<()> {
        let mut record = self.points[point].record.clone();
        complete(&mut record, &frames, reason);
        self.keeper.keep(record)
    }
}
