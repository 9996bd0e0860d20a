//! Running a plan: every group of comparable points in turn.

use super::check::Checker;
use super::keeper::Keeper;
use super::rounds::measure;
use super::session::Session;
use super::{Observer, Plan, Point, Results};
use crate::config::Experiment;
use crate::device::Device;
use crate::error::Result;
use crate::measure::StoppingRule;
use crate::program::Sources;
use crate::record::Record;
use crate::scene::{Scene, load_scene};

/// What a run needs besides its observer.
pub struct Run<'a> {
    /// What is measured.
    pub experiment: &'a Experiment,
    /// On which devices.
    pub devices: &'a [&'a Device],
    /// Where kernels come from.
    pub sources: &'a Sources,
}

impl Run<'_> {
    /// The plan.
    pub fn plan(&self) -> Plan {
        Plan::new(self.experiment, self.devices.len())
    }

    /// The experiment's scenes, in its order.
    pub fn load_scenes(&self) -> Result<Vec<Scene>> {
        self.experiment.scenes.iter().map(|path| load_scene(path).map(|loaded| loaded.scene)).collect()
    }

    /// Measures every point and returns their records, which are on disk by then. When it fails, everything
    /// finished before is on disk too.
    pub fn execute(&self, results: &mut Results, observer: &mut dyn Observer) -> Result<Vec<Record>> {
        let plan = self.plan();
        let scenes = self.load_scenes()?;
        let mut checker = Checker::open(self)?;
        observer.begins(plan.points.len());
        let mut keeper = Keeper { results, observer, done: Vec::new() };
        for group in plan.groups() {
            self.measure_group(group, &scenes, &mut checker, &mut keeper)?;
        }
        keeper.observer.ends();
        let done = keeper.done;
        results.summarise(&done, &self.experiment.question, &self.experiment.expectation)?;
        Ok(done)
    }

    /// Verifies the points of one scene, size and device, then times those that passed together.
    fn measure_group(
        &self,
        group: &[Point],
        scenes: &[Scene],
        checker: &mut Checker<'_>,
        keeper: &mut Keeper<'_>,
    ) -> Result<()> {
        let Some(scene) = group.first().map(|point| &scenes[point.scene]) else { return Ok(()) };
        let mut session = Session::new(scene);
        for point in group {
            let label = point.label(self.experiment);
            keeper.observer.works_on(&format!("checking {label}"));
            let mut record = checker.draft(point, scene);
            match checker.check(point, scene, keeper.results, &mut record)? {
                Ok(ready) => session.add(record, ready, label),
                Err(refusal) => keeper.keep(refusal.write_into(record))?,
            }
        }
        let timing = &self.experiment.timing;
        let rule = StoppingRule {
            min_samples: timing.min_samples as usize,
            max_samples: timing.max_samples as usize,
            relative_sigma: timing.relative_sigma,
            time_limit_ms: timing.time_limit_ms,
        };
        session.warm_up(timing.warmup, timing.time_limit_ms);
        let points = session.len();
        measure(points, &rule, timing.seed, &mut session.with(keeper))
    }
}
