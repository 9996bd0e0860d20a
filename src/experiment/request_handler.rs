//! What does the work of a run: checks points and casts their frames, one request at a time.

use super::check::Checker;
use super::draft::{Drafter, Hashed};
use super::point_failure::PointFailure;
use super::protocol::{Reply, Request};
use super::ready::Ready;
use super::{Plan, Point};
use crate::anchor::Anchor;
use crate::device::{Device, DeviceInfo};
use crate::error::{Error, Result};
use crate::launch::FrameTimes;
use crate::measure::batch_size;
use crate::sensor::{Watch, watch};
use std::collections::HashMap;
use std::time::Instant;

/// A point to be cast, and whether it was warmed up.
struct Entry {
    ready: Ready,
    /// Frames of a sample, once it is warm.
    batch: Option<u32>,
}

/// Does what is asked of one device.
pub struct RequestHandler<'a> {
    drafter: Drafter<'a>,
    plan: Plan,
    checker: Checker<'a>,
    /// The scene at hand, by its number.
    scene: Option<(usize, Hashed)>,
    /// The points at hand: those of one group that passed.
    group: Option<Point>,
    entries: HashMap<usize, Entry>,
    /// Once it was asked for.
    anchor: Option<Anchor>,
    /// The device's sensors, once something is checked: who only builds needs none.
    watch: Option<Watch>,
    /// The device in whose name it measures, where that is another.
    stands_for: Option<DeviceInfo>,
}

impl<'a> RequestHandler<'a> {
    /// A handler without work yet.
    pub fn new(
        drafter: Drafter<'a>,
        plan: Plan,
        checker: Checker<'a>,
        stands_for: Option<DeviceInfo>,
    ) -> Self {
        Self {
            drafter,
            plan,
            checker,
            scene: None,
            group: None,
            entries: HashMap::new(),
            anchor: None,
            watch: None,
            stands_for,
        }
    }

    /// Does what a request asks.
    pub fn answer(&mut self, request: &Request) -> Result<Reply> {
        match request {
            Request::Build { point } => self.build(*point),
            Request::Check { point, key, verified } => self.check(*point, key, verified.as_deref()),
            Request::Cast { point } => self.cast(*point),
            Request::Anchor => self.anchor(),
        }
    }

    fn build(&mut self, number: usize) -> Result<Reply> {
        let point = *self.plan.points.get(number).ok_or_else(no_such_point)?;
        self.turn_to(point)?;
        let Some((_, at)) = &self.scene else { return Err(no_such_point()) };
        Ok(Reply::Built(self.checker.build(&point, &at.scene)))
    }

    fn check(&mut self, number: usize, key: &str, verified: Option<&str>) -> Result<Reply> {
        let point = *self.plan.points.get(number).ok_or_else(no_such_point)?;
        self.turn_to(point)?;
        if self.watch.is_none() {
            self.watch = self.checker.device().map(|device| watch(&device.info.hardware));
        }
        let Some((_, at)) = &self.scene else { return Err(no_such_point()) };
        let own = point.device.and(self.checker.device()).map(|device: &Device| &device.info);
        let device = self.stands_for.as_ref().filter(|_| own.is_some()).or(own);
        let mut record = self.drafter.draft(&point, device, at)?;
        record.measured_on = own.filter(|_| self.stands_for.is_some()).map(DeviceInfo::slug);
        if record.key != key {
            return Err(changed(device));
        }
        let ready = match self.checker.check(&point, &at.scene, verified, &mut record)? {
            Ok(ready) => self.entries.insert(number, Entry { ready, batch: None }).is_none(),
            Err(refusal) => {
                record = refusal.write_into(record);
                false
            }
        };
        Ok(Reply::Checked { record: Box::new(record), ready })
    }

    /// Drops what belongs to another group, and loads the scene of a point where another is at hand.
    fn turn_to(&mut self, point: Point) -> Result<()> {
        if self.group.is_none_or(|group| !group.is_beside(&point)) {
            self.entries.clear();
            self.group = Some(point);
        }
        if self.scene.as_ref().is_none_or(|(held, _)| *held != point.scene) {
            // The old one goes first: two large scenes may not fit.
            self.scene = None;
            self.checker.leave_scene();
            let choice = self.drafter.experiment.scenes.get(point.scene).ok_or_else(no_such_point)?;
            self.scene = Some((point.scene, choice.load()?.into()));
        }
        Ok(())
    }

    fn anchor(&mut self) -> Result<Reply> {
        let anchor = match self.anchor.take() {
            Some(anchor) => anchor,
            None => self.checker.anchor()?,
        };
        self.anchor.insert(anchor).run().map(Reply::Sample)
    }

    fn cast(&mut self, number: usize) -> Result<Reply> {
        let timing = &self.drafter.experiment.timing;
        let (Some(point), Some((_, at)), Some(entry)) =
            (self.plan.points.get(number), &self.scene, self.entries.get_mut(&number))
        else {
            return Err(no_such_point());
        };
        let frame = |batch| entry.ready.frame(&at.scene, point.image_size, batch);
        let batch = match entry.batch {
            Some(batch) => batch,
            None => {
                let timer_ns =
                    self.checker.device().and_then(|device| device.info.hardware.timer_resolution_ns);
                // With a coarse timer, a sample may be a batch. One frame's time is needed to choose the batch's size.
                let frames = timing.warmup.max(u32::from(timer_ns.is_some_and(|step| step > 1)));
                let shortest_ms = warm_up(|| frame(1), frames, timing.time_limit_ms);
                batch_size(shortest_ms, timer_ns)
            }
        };
        entry.batch = Some(batch);
        let start = Instant::now();
        let sample = frame(batch);
        let sense = |ms| self.watch.as_ref()?.sense(start, Instant::now(), ms);
        Ok(match sample {
            Ok(times) if point.device.is_some() => {
                Reply::Sample(FrameTimes { sensed: sense(times.frame_ms), ..times })
            }
            Ok(times) => Reply::Sample(times),
            Err(refusal) => Reply::Refused(refusal),
        })
    }
}

/// Casts frames that are not kept; the check has cast one already, so where frames are long in comparison
/// with the time limit fewer will do. A frame that fails here fails again when it is timed, and is told then.
/// Gives the shortest part of the fastest frame; infinity where there was none.
fn warm_up(
    frame: impl Fn() -> std::result::Result<FrameTimes, PointFailure>,
    frames: u32,
    time_limit_ms: f64,
) -> f64 {
    let (mut spent_ms, mut shortest_ms) = (0.0, f64::INFINITY);
    for _ in 0..frames {
        let Ok(times) = frame() else { break };
        spent_ms += times.host_ms;
        shortest_ms = shortest_ms.min(times.shortest_ms());
        if spent_ms > 0.1 * time_limit_ms {
            break;
        }
    }
    shortest_ms
}

fn no_such_point() -> Error {
    Error::fault("a worker was asked for a point it does not have")
}

fn changed(device: Option<&DeviceInfo>) -> Error {
    let what = if device.is_some() { "a scene, a kernel file or the device" } else { "a scene" };
    Error::run(format!("{what} changed while the run was going on"))
        .with_help("the same command with --resume measures what changed")
}
