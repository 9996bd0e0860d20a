//! A group of points that are compared with each other; baselines are points too. In every launch, each point
//! is checked, and the points that pass are then timed together. No worker process measures two launches of a
//! group.

mod locks;
#[cfg(test)]
mod tests;
mod timed;

use super::Run;
use super::complete::complete;
use super::complete_launches::complete_launches;
use super::moved_processors::{Launch, are_enough, leave_out_moved};
use super::past::MeasuredOn;
use super::pending::PendingPoint;
use super::result_sink::ResultSink;
use super::rounds::{End, measure};
use super::supervisor::{Checked, Supervisor, Task};
use super::taken::Taken;
use crate::clock::ms_since;
use crate::config::SceneChoice;
use crate::device::{DeviceInfo, DeviceKind};
use crate::error::Result;
use crate::load::Watch;
use crate::measure::StopReason;
use crate::record::{LaunchEnd, Record, judge};
use locks::{lock_names, take_locks};
use std::collections::{HashMap, HashSet};
use std::time::Instant;
use timed::{Latency, Timed};

/// The message of a run before the first additional launch of a group of points.
const ADDITIONAL: &str = "the core-to-core latency was unusual in some launches (the processors of a virtual machine may have been moved to other cores), so additional launches replace these launches";

/// A group of points that are compared with each other, and its progress.
pub struct OpenGroup {
    points: Vec<PendingPoint>,
    /// The group's complete launches: in each of these launches, each point of the group has enough samples.
    whole: Vec<Launch>,
    /// How often this session has visited the group. A visit measures one launch of the group.
    visits: u32,
    /// Why the group's last launch ended.
    reason: Option<StopReason>,
    /// The index of the device to which the group is bound, if groups are distributed over several devices.
    home: Option<usize>,
}

impl OpenGroup {
    /// Makes a group that has not been visited yet.
    pub fn new(points: Vec<PendingPoint>) -> Self {
        Self { points, whole: Vec::new(), visits: 0, reason: None, home: None }
    }

    /// Returns a group that was visited `visits` times.
    #[cfg(test)]
    pub fn visited(visits: u32, points: Vec<PendingPoint>) -> Self {
        Self { visits, ..Self::new(points) }
    }

    /// Returns how often this session has visited the group. A visit of a group of points measures one launch
    /// of the group.
    pub fn visits(&self) -> u32 {
        self.visits
    }

    /// Returns the group's unfinished points.
    pub fn points(&self) -> &[PendingPoint] {
        &self.points
    }

    fn tasks(&self) -> impl Iterator<Item = Task<'_>> {
        self.points.iter().map(PendingPoint::task)
    }

    /// Returns true if all points of the group are casters on the host.
    pub fn is_on_host(&self) -> bool {
        self.points.iter().all(|pending| pending.record.is_baseline())
    }

    /// Returns true if the group may be measured on the device with this index.
    pub fn may_go_to(&self, device: usize) -> bool {
        self.home.is_none_or(|home| home == device)
    }

    /// Binds the group to a device, so that the same device measures all launches of the group. Is called only if
    /// groups are distributed over devices. The number of a device's job is then the device's index.
    pub fn settle(&mut self, device: usize) {
        self.home = Some(device);
        self.points.iter_mut().for_each(|pending| pending.job = device);
    }

    /// Binds the group to the device that measured the group's last complete launch in an earlier session, if
    /// the run has this device. The launches of earlier sessions count only if the same device measures the
    /// group again.
    pub fn return_to_device(&mut self, run: &Run<'_>, sink: &impl ResultSink) {
        let (_, launches) = self.past(run, sink);
        let named = unnamed_device(run);
        let there = launches.last().and_then(|(launch, _)| sink.measured_on(*launch).or(named));
        self.home = there.and_then(|there| run.devices.iter().position(|device| there.may_be(device)));
    }

    /// Returns true if all points of the group have their records.
    pub fn is_finished(&self) -> bool {
        self.points.is_empty()
    }

    /// Returns true if the group has been measured in enough launches.
    fn has_enough(&self, run: &Run<'_>, sink: &impl ResultSink) -> bool {
        are_enough(&self.whole, run.launches(), self.near_ns(run, sink))
    }

    /// Returns the core-to-core latency, in nanoseconds, of near processors (processors at their usual
    /// distance). A sample is left out if the latency around the sample is much larger or smaller than the
    /// returned latency. Returns infinity if the group keeps all samples whatever their latency, or if the
    /// usual latency is not known yet.
    fn near_ns(&self, run: &Run<'_>, sink: &impl ResultSink) -> f64 {
        if leaves_out_moved(run, &self.points) { sink.near_ns() } else { f64::INFINITY }
    }

    /// Measures one launch of the group: checks the points, and times those that pass. Before this launch, the first
    /// visit takes over the complete launches of earlier sessions. If the group then has enough launches, its points
    /// are checked, but not timed. If the group has enough launches at the end of the visit, the records of the
    /// group's points are stored. If a worker process is lost while points are timed, new worker processes repeat the
    /// whole launch. While points are timed, no other raycl process measures on the points' devices.
    pub fn visit(
        &mut self,
        run: &Run<'_>,
        supervisor: &mut Supervisor<'_>,
        sink: &mut impl ResultSink,
    ) -> Result<()> {
        let launches = run.launches();
        if self.visits == 0 {
            self.adopt(run, sink);
        }
        self.visits += 1;
        supervisor.turn_to(self.visits, self.tasks());
        loop {
            self.check(run, supervisor, sink)?;
            if self.has_enough(run, sink) || self.points.is_empty() {
                break;
            }
            if self.whole.len() == launches {
                let scene = run.experiment.scenes.get(self.points[0].scene).map(SceneChoice::label);
                sink.says(&format!("{}: {ADDITIONAL}", scene.unwrap_or_default()));
            }
            match self.time(run, supervisor, sink)? {
                End::Enough(_) => {
                    if self.whole.len() <= launches {
                        sink.advances(self.points.len());
                    }
                    break;
                }
                End::AllFailed => break,
                End::Broken => {
                    sink.says("a worker process was lost or replaced: the whole launch is repeated");
                    supervisor.retire();
                }
            }
        }
        if self.has_enough(run, sink) { self.finish(run, sink) } else { Ok(()) }
    }

    /// Returns the samples of each point from earlier sessions, and the numbers of the complete launches,
    /// each with the reason why the launch ended.
    fn past(&self, run: &Run<'_>, sink: &impl ResultSink) -> (Vec<Vec<Taken>>, Vec<(u32, StopReason)>) {
        let keys = || self.points.iter().map(|pending| pending.record.key.as_str());
        let past: Vec<Vec<Taken>> = keys().map(|key| sink.past(key)).collect();
        let points: Vec<(&str, &[Taken])> = keys().zip(past.iter().map(Vec::as_slice)).collect();
        let end_of = |launch| sink.past_end(launch);
        let launches = complete_launches(&points, end_of, &run.stopping_rule());
        (past, launches)
    }

    /// Returns true if this session measures the group on the same device that measured `launch` in an
    /// earlier session, or if that device is unknown.
    fn is_of_own_device(&self, launch: u32, run: &Run<'_>, sink: &impl ResultSink) -> bool {
        let named = unnamed_device(run);
        let mut own = self.points.iter().filter_map(|pending| device_of(run, pending));
        sink.measured_on(launch).or(named).is_none_or(|there| own.all(|device| there.may_be(device)))
    }

    /// Takes over the complete launches of earlier sessions, until the group has enough launches. Incomplete launches
    /// are dropped, since the same worker processes must measure a whole launch, and the processes of the earlier
    /// session have ended. If another device of the same model measured a launch in an earlier session, this launch is
    /// dropped too.
    fn adopt(&mut self, run: &Run<'_>, sink: &mut impl ResultSink) {
        let (past, launches) = self.past(run, sink);
        for (launch, reason) in launches {
            if !self.has_enough(run, sink) && self.is_of_own_device(launch, run, sink) {
                self.whole.push(Launch::of(launch, past.iter().map(Vec::as_slice)));
                self.reason = Some(reason);
            }
        }
        for (pending, taken) in self.points.iter_mut().zip(past) {
            let adopted = |sample: &Taken| self.whole.iter().any(|launch| launch.number == sample.launch);
            pending.taken.extend(taken.into_iter().filter(adopted));
        }
        let counted = self.whole.len().min(run.launches());
        sink.advances(counted * self.points.len());
    }

    /// Checks one point after another, and stores the records of points that fail. In the session's first
    /// launch of the group, each check waits until builders (processes that compile programs) have built the
    /// point's program. During the check, builders build the programs of later points. In a run without
    /// builders, the check itself builds the program.
    fn check(
        &mut self,
        run: &Run<'_>,
        supervisor: &mut Supervisor<'_>,
        sink: &mut impl ResultSink,
    ) -> Result<()> {
        let left = run.launches().saturating_sub(self.whole.len());
        let devices = lock_names(run, &self.points);
        // The run waits until the devices are free before it starts drivers, builds programs and checks
        // points, since this work would disturb another process's measurement on these devices.
        let interrupted = supervisor.interrupted();
        drop(take_locks(run, devices.clone(), sink, interrupted)?);
        supervisor.start_ahead(self.tasks())?;
        let ahead = run.ahead.filter(|_| self.visits == 1 && left > 0);
        if let Some(ahead) = ahead {
            ahead.order(&self.points);
        }
        for mut pending in std::mem::take(&mut self.points) {
            // A check holds no device lock, but waits until the device is free, since the check would disturb
            // another process that measures on the device (and holds the lock).
            let interrupted = supervisor.interrupted();
            drop(take_locks(run, devices.clone(), sink, interrupted)?);
            if let Some(ahead) = ahead {
                sink.works_on(&format!("building {}", pending.label));
                ahead.need(&mut pending, interrupted)?;
            }
            sink.works_on(&format!("checking {}", pending.label));
            let start = Instant::now();
            match supervisor.check(pending.task())?.map(|checked| named(checked, &pending.record)) {
                Ok((record, true)) => {
                    // Only the record of the check in the first launch is used. In a later launch, the check either
                    // casts the same picture as in the first launch, or compares another picture with the reference.
                    if pending.verified.is_none() {
                        use_check(&mut pending, *record, ms_since(start));
                    }
                    self.points.push(pending);
                    continue;
                }
                Ok((record, false)) => sink.keep(pending.refused(*record))?,
                Err(refusal) => sink.keep(refusal.write_into(pending.record))?,
            }
            sink.advances(left);
        }
        Ok(())
    }

    /// Times the group's points in the rounds of one launch. Points that fail leave the group. If a worker process is
    /// lost, no sample of this launch is used.
    fn time(
        &mut self,
        run: &Run<'_>,
        supervisor: &mut Supervisor<'_>,
        sink: &mut impl ResultSink,
    ) -> Result<End> {
        let timing = &run.experiment.timing;
        let devices = lock_names(run, &self.points);
        let interrupted = supervisor.interrupted();
        let _held = take_locks(run, devices, sink, interrupted)?;
        let launch = sink.next_launch();
        let (number, losses) = (self.whole.len() + 1, supervisor.losses());
        let taken = vec![Vec::new(); self.points.len()];
        let failed = HashSet::new();
        let (points, start, watch) = (&self.points, Instant::now(), Watch::start());
        let casts = HashMap::new();
        let latency = Latency::of(leaves_out_moved(run, points));
        let mut timed = Timed {
            points,
            run,
            launch,
            number,
            start,
            watch,
            losses,
            supervisor,
            sink,
            taken,
            failed,
            casts,
            latency,
        };
        let end = measure(points.len(), &run.stopping_rule(), launch, timing.seed, &mut timed)?;
        let Timed { taken, failed, .. } = timed;
        let is_whole = matches!(end, End::Enough(_));
        let left = run.launches().saturating_sub(self.whole.len());
        sink.advances(left * failed.len());
        let points = std::mem::take(&mut self.points).into_iter().zip(taken).enumerate();
        for (_, (mut pending, taken)) in points.filter(|(index, _)| !failed.contains(index)) {
            if is_whole {
                pending.taken.extend(taken);
            }
            self.points.push(pending);
        }
        if let End::Enough(reason) = end {
            self.add_complete(launch, reason, sink)?;
        }
        Ok(end)
    }

    /// Adds a launch that has just ended to the complete launches. Stores why the launch ended, and the number of
    /// samples of each point.
    fn add_complete(
        &mut self,
        launch: u32,
        stop_reason: StopReason,
        sink: &mut impl ResultSink,
    ) -> Result<()> {
        let count = |taken: &[Taken]| taken.iter().filter(|sample| sample.launch == launch).count();
        let samples = self.points.iter().map(|pending| (pending.record.key.clone(), count(&pending.taken)));
        sink.launch_end(&LaunchEnd { launch, stop_reason, samples: samples.collect() })?;
        let samples = self.points.iter().map(|pending| pending.taken.as_slice());
        self.whole.push(Launch::of(launch, samples));
        self.reason = Some(stop_reason);
        Ok(())
    }

    /// Completes the records of the group's points, and stores them. In a launch, the sampling of all points of a group
    /// stops after the same round, so all records get the same reason for stopping.
    fn finish(&mut self, run: &Run<'_>, sink: &mut impl ResultSink) -> Result<()> {
        let reason = self.reason;
        let (launches, near_ns) = (std::mem::take(&mut self.whole), self.near_ns(run, sink));
        let completed = |mut pending: PendingPoint| {
            let left_out = leave_out_moved(&mut pending.taken, &launches, near_ns);
            pending.record.moved_samples = left_out.map(|left_out| left_out.samples);
            pending.record.moved_launches = left_out.map(|left_out| left_out.launches);
            complete(&mut pending.record, &pending.taken, reason);
            pending.record
        };
        let mut records: Vec<Record> = self.points.drain(..).map(completed).collect();
        judge(&mut records);
        for record in &mut records {
            record.interval_ms = crate::record::interval(record);
        }
        records.into_iter().try_for_each(|record| sink.keep(record))
    }
}

/// Returns the device that measured the launches whose samples name no device. If samples name no device, the
/// earlier session that took the samples did not distribute points over devices. In the current session, the
/// records of all points on devices name the first device, so earlier samples of these points come from the
/// first device. Returns `None` if the current session does not distribute points over devices.
fn unnamed_device(run: &Run<'_>) -> Option<MeasuredOn> {
    run.named_device().map(|device| MeasuredOn { slug: device.slug(), hardware: None })
}

/// Returns the device on which a point is measured; `None` for a caster on the host.
pub(super) fn device_of<'a>(run: &Run<'a>, pending: &PendingPoint) -> Option<&'a DeviceInfo> {
    let device = run.devices.get(pending.job % run.devices.len().max(1));
    device.filter(|_| !pending.record.is_baseline()).copied()
}

/// Returns true if a group leaves out samples whose core-to-core latency was far from the run's usual latency. A
/// latency far from the usual one probably means that the host has moved a virtual machine's processors to other cores.
/// Samples are left out only if this machine's processors cast every point of the group (by a caster on the host, or by
/// an OpenCL driver for CPUs). If `keeps_moved_samples` is set, the run leaves out no samples because of their latency.
pub(super) fn leaves_out_moved(run: &Run<'_>, points: &[PendingPoint]) -> bool {
    let is_on_processors =
        |pending| device_of(run, pending).is_none_or(|device| device.kind == DeviceKind::Cpu);
    !run.keeps_moved_samples && points.iter().all(is_on_processors)
}

/// Replaces the record of a point by the record that the point's check returned. The check took `check_ms`
/// milliseconds.
fn use_check(pending: &mut PendingPoint, record: Record, check_ms: f64) {
    pending.verified.clone_from(&record.image_hash);
    pending.record = record;
    pending.record.check_ms = Some(check_ms);
    if let Some(built) = &pending.built {
        pending.record.build_ms = Some(built.build_ms);
        pending.record.build_from_cache = Some(built.from_cache);
    }
}

/// Adds some values to the record that a point's check returned: the values that workers do not know. These
/// values come from the point's draft (its record before the point was tried): the names of the point and of
/// its preset, the notes on the scene, the folder of kernels, the block (the points that one machine or
/// device measures together), and the block's control point.
fn named((mut record, ready): Checked, draft: &Record) -> Checked {
    record.name.clone_from(&draft.name);
    record.preset.clone_from(&draft.preset);
    record.scene_notes.clone_from(&draft.scene_notes);
    record.kernels_of.clone_from(&draft.kernels_of);
    record.control.clone_from(&draft.control);
    (record.block, record.is_control) = (draft.block, draft.is_control);
    (record, ready)
}
