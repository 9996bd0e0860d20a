//! Runs a plan: measures the missing results, group by group, and summarises all results.

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests;

use super::group::{OpenGroup, device_of};
use super::launches::{Waiting, serve};
use super::pending::PendingPoint;
use super::result_sink::{FolderSink, ResultSink as _};
use super::spread::measure_spread;
use super::supervisor::Supervisor;
use super::waiting::Spawner;
use super::{Observer, Past, PointFailure, Results, Run};
use crate::config::SceneChoice;
use crate::device::DeviceKind;
use crate::error::{Error, Result};
use crate::record::{CurrentPlan, Outcome, Record};
use std::collections::{HashMap, HashSet};
use std::sync::atomic::AtomicBool;

impl Run<'_> {
    /// Measures every point of the run that still has to be measured. Writes the records of all points to
    /// disk and returns them. After an error or an interruption, the records of all points that were finished
    /// before are on disk too.
    pub fn execute(
        &self,
        results: &mut Results,
        observer: &mut dyn Observer,
        spawner: &mut dyn Spawner,
        interrupted: &AtomicBool,
    ) -> Result<Vec<Record>> {
        self.measure(results, observer, |groups, sink| {
            let mut supervisor = Supervisor::new(spawner, interrupted, self.limit);
            let waiting = Waiting::new(groups, self.experiment.timing.seed);
            serve(self, &waiting, None, &mut supervisor, sink)
        })
    }

    /// Measures the missing points like [`Self::execute`], with groups of points distributed over the devices;
    /// `spawners[i]` starts the workers of device `i`.
    pub fn execute_spread(
        &self,
        results: &mut Results,
        observer: &mut dyn Observer,
        spawners: Vec<Box<dyn Spawner + Send>>,
        interrupted: &AtomicBool,
    ) -> Result<Vec<Record>> {
        self.measure(results, observer, |groups, sink| {
            measure_spread(self, groups, sink, spawners, interrupted)
        })
    }

    /// Calls `measure` with those points of each group that still have to be measured, then summarises the results
    /// of all points of the plan.
    fn measure(
        &self,
        results: &mut Results,
        observer: &mut dyn Observer,
        measure: impl FnOnce(Vec<OpenGroup>, &mut FolderSink<'_>) -> Result<()>,
    ) -> Result<Vec<Record>> {
        let plan = self.plan();
        let groups = self.pending_points(&plan, &self.pieces(&plan))?;
        let own = || groups.iter().flatten().filter(|pending| !pending.record.is_control);
        results.plan(&CurrentPlan::of(own().map(|pending| &pending.record)))?;
        let count = own().map(|pending| &pending.record.key).collect::<HashSet<_>>().len();
        let mut unrecorded = Unrecorded { taken: self.done(own(), results.past()) };
        let done = unrecorded.taken.len();
        let launches = self.launches();
        let controls = groups.iter().flatten().filter(|pending| pending.record.is_control).count();
        observer.begins(count, (count + controls) * launches);
        observer.resumes(done, done * launches);
        let names = self.scene_names();
        let mut sink = FolderSink { results, observer, names, done };
        let groups: Result<Vec<_>> = groups
            .into_iter()
            .map(|group| pass_over(unrecorded.of(group), launches, &mut sink).map(OpenGroup::new))
            .collect();
        let end = groups.and_then(|groups| {
            if let Some(ahead) = self.ahead.filter(|_| self.builds_while_timing()) {
                ahead.order(groups.iter().flat_map(OpenGroup::points));
            }
            measure(groups, &mut sink)
        });
        sink.observer.ends();
        let done = sink.done;
        let shown = results.summarise(&self.experiment.question, &self.experiment.expectation);
        end.map_err(|error| say_how_far(error, done, count))?;
        shown
    }

    /// Returns the names of the experiment's scenes, by the hashes of their contents.
    fn scene_names(&self) -> HashMap<String, String> {
        let named = |choice: &SceneChoice| {
            choice.hashes.iter().map(|hash| (hash.clone(), choice.label())).collect::<Vec<_>>()
        };
        self.experiment.scenes.iter().flat_map(named).collect()
    }

    /// Returns true if programs of later groups are built while earlier groups are timed. Programs are built in this
    /// way if the run measures neither kernels nor baselines on a CPU: compiling on the CPU then disturbs no sample.
    fn builds_while_timing(&self) -> bool {
        let on_cores = self.devices.iter().any(|device| device.kind == DeviceKind::Cpu);
        !on_cores && self.experiment.baselines.is_empty()
    }

    /// Returns the keys of the points that are not measured again because `past` has a record of them (see
    /// [`Self::is_done`]).
    pub(super) fn done<'p>(
        &self,
        points: impl Iterator<Item = &'p PendingPoint>,
        past: &Past,
    ) -> HashSet<String> {
        let records: HashMap<&str, &Record> =
            past.records.iter().map(|record| (record.key.as_str(), record)).collect();
        let is_done = |pending: &&PendingPoint| {
            records.get(pending.record.key.as_str()).is_some_and(|record| self.is_done(record, pending))
        };
        points.filter(is_done).map(|pending| pending.record.key.clone()).collect()
    }

    /// Returns true if `record`, an earlier record of the point, makes another measurement of the point unnecessary.
    /// If the run retries failed points, it measures two kinds of points again: points that failed, and points for
    /// which too little memory happened to be free. If an earlier session skipped a point because its preset is
    /// meant for another kind of device, a run without this restriction measures the point. If a point exceeded a
    /// limit of the device in an earlier session, but fits now, every run measures the point again. If a device
    /// other than the point's own device measured the point, a run measures the point again, unless the run
    /// distributes points over several devices.
    fn is_done(&self, record: &Record, pending: &PendingPoint) -> bool {
        let asked_for = record.outcome == Outcome::OtherKind && pending.not_for.is_none();
        let counts = !asked_for && !pending.fits_meanwhile(record) && self.is_of_own_device(record, pending);
        counts && (!self.retry_failed || record.is_final())
    }

    /// Returns true if the times in the record come from the point's own device. If an earlier session
    /// distributed points over several devices, only `measured_on` says which device measured the point. If this
    /// run distributes points over several devices, the function returns true for every record.
    fn is_of_own_device(&self, record: &Record, pending: &PendingPoint) -> bool {
        let device = device_of(self, pending).filter(|_| !self.spread);
        let measured_on = record.measured_on.as_ref();
        device.zip(measured_on).is_none_or(|(own, measured_on)| own.slug() == *measured_on)
    }
}

/// Finds the points that still have to be measured. Of several points of the plan with the same key, only one is
/// measured.
struct Unrecorded {
    /// The keys of the points that an earlier session has finished (see `Run::is_done`), and of the points that
    /// [`Self::of`] has already returned.
    taken: HashSet<String>,
}

impl Unrecorded {
    /// Returns the points of a group that still have to be measured. If the returned list is not empty, it also
    /// contains the block's control point, even if the control point is finished.
    fn of(&mut self, group: Vec<PendingPoint>) -> Vec<PendingPoint> {
        let is_control =
            |pending: &PendingPoint| pending.record.control.as_ref() == Some(&pending.record.key);
        let (mut controls, others): (Vec<_>, Vec<_>) = group.into_iter().partition(is_control);
        let others: Vec<_> =
            others.into_iter().filter(|pending| self.taken.insert(pending.record.key.clone())).collect();
        for pending in controls.iter_mut().filter(|pending| !pending.record.is_control) {
            pending.record.is_control = !self.taken.insert(pending.record.key.clone());
        }
        controls.retain(|pending| !others.is_empty() || !pending.record.is_control);
        controls.into_iter().chain(others).collect()
    }
}

/// Stores a record for each point whose preset is meant for another kind of device; the record says that the
/// point was skipped. Returns all other points of the group.
fn pass_over(
    group: Vec<PendingPoint>,
    launches: usize,
    sink: &mut FolderSink<'_>,
) -> Result<Vec<PendingPoint>> {
    let mut left = Vec::new();
    for mut pending in group {
        match pending.not_for.take() {
            None => left.push(pending),
            Some(reason) => {
                sink.keep(PointFailure::new(Outcome::OtherKind, reason).write_into(pending.record))?;
                sink.advances(launches);
            }
        }
    }
    Ok(left)
}

fn say_how_far(error: Error, done: usize, count: usize) -> Error {
    match error {
        Error::Interrupted { help, .. } => {
            let message =
                format!("{done} of {count} points are done; finished launches of other points are kept");
            Error::Interrupted { message, help }
        }
        error => error,
    }
}
