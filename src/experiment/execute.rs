//! Running a plan: what its results lack is measured, group by group, and all is summarised.

use super::group::OpenGroup;
use super::keeper::Keeper;
use super::launches::{Waiting, serve};
use super::open::Open;
use super::spread::measure_spread;
use super::supervisor::{Spawner, Supervisor};
use super::{Observer, Results, Run};
use crate::error::{Error, Result};
use crate::record::{CurrentPlan, Record};
use std::collections::HashSet;
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
        let groups = self.open_points(&plan)?;
        results.plan(&CurrentPlan::of(groups.iter().flatten().map(|open| &open.record)))?;
        let keys: HashSet<&str> = groups.iter().flatten().map(|open| open.record.key.as_str()).collect();
        let count = keys.len();
        let counts = |record: &&Record| keys.contains(record.key.as_str()) && self.is_done(record);
        let taken = results.past().records.iter().filter(counts).map(|record| record.key.clone());
        let mut missing = Missing { taken: taken.collect() };
        let done = missing.taken.len();
        let launches = self.experiment.timing.launches as usize;
        observer.begins(count, count * launches);
        observer.resumes(done, done * launches);
        let mut keeper = Keeper { results, observer, done };
        let groups = groups.into_iter().map(|group| OpenGroup::new(missing.of(group))).collect();
        let end = measure(groups, &mut keeper);
        keeper.observer.ends();
        let done = keeper.done;
        let shown = results.summarise(&self.experiment.question, &self.experiment.expectation);
        end.map_err(|error| say_how_far(error, done, count))?;
        shown
    }

    fn is_done(&self, record: &Record) -> bool {
        !self.retry_failed || record.outcome.is_fine()
    }
}

/// Points that have no record yet. Where a plan has the same measurement twice, it is made once.
struct Missing {
    taken: HashSet<String>,
}

impl Missing {
    fn of(&mut self, group: Vec<Open>) -> Vec<Open> {
        group.into_iter().filter(|open| self.taken.insert(open.record.key.clone())).collect()
    }
}

fn say_how_far(error: Error, done: usize, count: usize) -> Error {
    match error {
        Error::Interrupted { help, .. } => {
            Error::Interrupted { message: format!("{done} of {count} points are done"), help }
        }
        error => error,
    }
}
