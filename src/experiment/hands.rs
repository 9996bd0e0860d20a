//! What does the work of a run: checks points and casts their frames, one request at a time.

use super::bench::Refusal;
use super::check::Checker;
use super::draft::{Drafter, Hashed};
use super::protocol::{Reply, Request};
use super::{Plan, Point, host};
use crate::config::Baseline;
use crate::device::{Device, DeviceInfo};
use crate::error::{Error, Result};
use crate::launch::{Caster, FrameTimes};
use std::collections::HashMap;

/// A point that passed its check and can be cast again and again.
pub enum Ready {
    /// On a device.
    Kernel(Box<Caster>),
    /// On the host.
    Host(Baseline),
}

/// A point to be cast, and whether it was warmed up.
struct Entry {
    ready: Ready,
    warm: bool,
}

/// Does what is asked of one device.
pub struct Hands<'a> {
    drafter: Drafter<'a>,
    plan: Plan,
    checker: Checker<'a>,
    /// The scene at hand, by its number.
    scene: Option<(usize, Hashed)>,
    /// The points at hand: those of one group that passed.
    group: Option<Point>,
    entries: HashMap<usize, Entry>,
}

impl<'a> Hands<'a> {
    /// Hands without work yet.
    pub fn new(drafter: Drafter<'a>, plan: Plan, checker: Checker<'a>) -> Self {
        Self { drafter, plan, checker, scene: None, group: None, entries: HashMap::new() }
    }

    /// Does what a request asks.
    pub fn answer(&mut self, request: &Request) -> Result<Reply> {
        match request {
            Request::Check { point, key } => self.check(*point, key),
            Request::Cast { point } => self.cast(*point),
        }
    }

    fn check(&mut self, number: usize, key: &str) -> Result<Reply> {
        let point = *self.plan.points.get(number).ok_or_else(no_such_point)?;
        if self.group.is_none_or(|group| !group.compares_with(&point)) {
            self.entries.clear();
            self.checker.let_go();
            self.group = Some(point);
        }
        let at = scene(&mut self.scene, &self.drafter, point.scene)?;
        let device = point.device.and(self.checker.device()).map(|device: &Device| &device.info);
        let mut record = self.drafter.draft(&point, device, at)?;
        if record.key != key {
            return Err(changed(device));
        }
        let ready = match self.checker.check(&point, &at.scene, &mut record)? {
            Ok(ready) => self.entries.insert(number, Entry { ready, warm: false }).is_none(),
            Err(refusal) => {
                record = refusal.write_into(record);
                false
            }
        };
        Ok(Reply::Checked { record: Box::new(record), ready })
    }

    fn cast(&mut self, number: usize) -> Result<Reply> {
        let timing = &self.drafter.experiment.timing;
        let (Some(point), Some((_, at)), Some(entry)) =
            (self.plan.points.get(number), &self.scene, self.entries.get_mut(&number))
        else {
            return Err(no_such_point());
        };
        let mut frame = || frame(&entry.ready, point, at);
        if !std::mem::replace(&mut entry.warm, true) {
            warm_up(&mut frame, timing.warmup, timing.time_limit_ms);
        }
        Ok(match frame() {
            Ok(times) => Reply::Sample(times),
            Err(refusal) => Reply::Refused(refusal),
        })
    }
}

fn scene<'s>(
    slot: &'s mut Option<(usize, Hashed)>,
    drafter: &Drafter<'_>,
    number: usize,
) -> Result<&'s Hashed> {
    if slot.as_ref().is_none_or(|(held, _)| *held != number) {
        // The old one goes first: two large scenes may not fit.
        *slot = None;
        let choice = drafter.experiment.scenes.get(number).ok_or_else(no_such_point)?;
        *slot = Some((number, choice.load()?.into()));
    }
    slot.as_ref().map(|(_, scene)| scene).ok_or_else(no_such_point)
}

fn frame(ready: &Ready, point: &Point, at: &Hashed) -> std::result::Result<FrameTimes, Refusal> {
    match ready {
        Ready::Kernel(caster) => Ok(caster.cast()?),
        Ready::Host(baseline) => Ok(host::cast(*baseline, &at.scene, point.image_size).1),
    }
}

/// Casts frames that are not kept; the check has cast one already, so where frames are long in comparison
/// with the time limit fewer will do. A frame that fails here fails again when it is timed, and is told then.
fn warm_up(
    frame: &mut impl FnMut() -> std::result::Result<FrameTimes, Refusal>,
    frames: u32,
    time_limit_ms: f64,
) {
    let mut spent_ms = 0.0;
    for _ in 0..frames {
        let Ok(times) = frame() else { break };
        spent_ms += times.host_ms;
        if spent_ms > 0.1 * time_limit_ms {
            break;
        }
    }
}

fn no_such_point() -> Error {
    Error::run("a worker was asked for a point it does not have")
}

fn changed(device: Option<&DeviceInfo>) -> Error {
    let what = if device.is_some() { "a scene, a kernel file or the device" } else { "a scene" };
    Error::run(format!("{what} changed while the run was going on"))
        .with_help("the same command with --resume measures what changed")
}
