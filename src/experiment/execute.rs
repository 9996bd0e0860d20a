//! Running a plan: what its results lack is measured, group by group, and all is summarised.

use super::group::OpenGroup;
use super::keeper::{Keep as _, Keeper};
use super::launches::{Waiting, serve};
use super::open::Open;
use super::spread::measure_spread;
use super::supervisor::{Spawner, Supervisor};
use super::{Observer, Refusal, Results, Run};
use crate::device::DeviceKind;
use crate::error::{Error, Result};
use crate::record::{CurrentPlan, Outcome, Record};
use std::collections::{HashMap, HashSet};
use std::sync::atomic::AtomicBool;

impl Run<'_> {
    /// Measures every point that the results lack, and returns the records of all, which are on disk by then.
    /// When it fails or is interrupted, everything finished before is on disk too.
    pub fn execute(
        &self,
        results: &mut Results,
        observer: &mut dyn Observer,
        spawner: &mut dyn Spawner,
        interrupted: &AtomicBool,
    ) -> Result<Vec<Record>> {
        self.measure(results, observer, |groups, keeper| {
            let mut supervisor = Supervisor::new(spawner, interrupted, self.limit);
            let waiting = Waiting::new(groups, self.experiment.timing.seed);
            serve(self, &waiting, None, &mut supervisor, keeper)
        })
    }

    /// The same with groups of points spread over the devices, `spawners[i]` starting the workers of device `i`.
    pub fn execute_spread(
        &self,
        results: &mut Results,
        observer: &mut dyn Observer,
        spawners: Vec<Box<dyn Spawner + Send>>,
        interrupted: &AtomicBool,
    ) -> Result<Vec<Record>> {
        self.measure(results, observer, |groups, keeper| {
            measure_spread(self, groups, keeper, spawners, interrupted)
        })
    }

    /// Hands the points that the results lack to `measure`, and summarises what the plan has by then.
    fn measure(
        &self,
        results: &mut Results,
        observer: &mut dyn Observer,
        measure: impl FnOnce(Vec<OpenGroup>, &mut Keeper<'_>) -> Result<()>,
    ) -> Result<Vec<Record>> {
        let plan = self.plan();
        let groups = self.open_points(&plan, &self.pieces(&plan))?;
        let own = || groups.iter().flatten().filter(|open| !open.record.is_control);
        results.plan(&CurrentPlan::of(own().map(|open| &open.record)))?;
        let points: HashMap<&str, &Open> = own().map(|open| (open.record.key.as_str(), open)).collect();
        let count = points.len();
        let counts =
            |record: &&Record| points.get(record.key.as_str()).is_some_and(|open| self.is_done(record, open));
        let taken = results.past().records.iter().filter(counts).map(|record| record.key.clone());
        let mut missing = Missing { taken: taken.collect() };
        let done = missing.taken.len();
        let launches = self.experiment.timing.launches as usize;
        let controls = groups.iter().flatten().filter(|open| open.record.is_control).count();
        observer.begins(count, (count + controls) * launches);
        observer.resumes(done, done * launches);
        let mut keeper = Keeper { results, observer, done };
        let groups: Result<Vec<_>> = groups
            .into_iter()
            .map(|group| pass_over(missing.of(group), launches, &mut keeper).map(OpenGroup::new))
            .collect();
        let end = groups.and_then(|groups| {
            if let Some(ahead) = self.ahead.filter(|_| self.builds_beside_timing()) {
                ahead.order(groups.iter().flat_map(OpenGroup::points));
            }
            measure(groups, &mut keeper)
        });
        keeper.observer.ends();
        let done = keeper.done;
        let shown = results.summarise(&self.experiment.question, &self.experiment.expectation);
        end.map_err(|error| say_how_far(error, done, count))?;
        shown
    }

    /// Whether programs of later groups are built while earlier ones are timed: where nothing that is timed needs the cores.
    fn builds_beside_timing(&self) -> bool {
        let on_cores = self.devices.iter().any(|device| device.kind == DeviceKind::Cpu);
        !on_cores && self.experiment.baselines.is_empty()
    }

    /// Whether a record of a point is all there is to find out. One that was passed over may be asked for now.
    fn is_done(&self, record: &Record, open: &Open) -> bool {
        let asked_for = record.outcome == Outcome::OtherKind && open.not_for.is_none();
        !asked_for && (!self.retry_failed || record.outcome.is_fine())
    }
}

/// Points that have no record yet. Where a plan has the same measurement twice, it is made once.
struct Missing {
    taken: HashSet<String>,
}

impl Missing {
    /// A block's control point is measured with whatever else of it is missing, also where it has a record.
    fn of(&mut self, group: Vec<Open>) -> Vec<Open> {
        let is_control = |open: &Open| open.record.control.as_ref() == Some(&open.record.key);
        let (mut controls, others): (Vec<_>, Vec<_>) = group.into_iter().partition(is_control);
        let others: Vec<_> =
            others.into_iter().filter(|open| self.taken.insert(open.record.key.clone())).collect();
        for open in controls.iter_mut().filter(|open| !open.record.is_control) {
            open.record.is_control = !self.taken.insert(open.record.key.clone());
        }
        controls.retain(|open| !others.is_empty() || !open.record.is_control);
        controls.into_iter().chain(others).collect()
    }
}

/// Completes the records of points whose presets are meant for devices of another kind; the others are left.
fn pass_over(group: Vec<Open>, launches: usize, keeper: &mut Keeper<'_>) -> Result<Vec<Open>> {
    let mut left = Vec::new();
    for mut open in group {
        match open.not_for.take() {
            None => left.push(open),
            Some(reason) => {
                keeper.keep(Refusal::new(Outcome::OtherKind, reason).write_into(open.record))?;
                keeper.advances(launches);
            }
        }
    }
    Ok(left)
}

fn say_how_far(error: Error, done: usize, count: usize) -> Error {
    match error {
        Error::Interrupted { help, .. } => {
            Error::Interrupted { message: format!("{done} of {count} points are done"), help }
        }
        error => error,
    }
}
