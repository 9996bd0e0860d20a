//! Running a plan: every group of comparable points in turn.

use super::draft::{Drafter, Hashed};
use super::group::{Open, OpenGroup};
use super::keeper::Keeper;
use super::launches::{Waiting, serve};
use super::protocol::Job;
use super::spread::measure_spread;
use super::supervisor::{Spawner, Supervisor};
use super::{Fault, Observer, Plan, Point, Results};
use crate::config::{Experiment, SceneChoice};
use crate::device::DeviceInfo;
use crate::device_lock::{LockName, Locks};
use crate::error::{Error, Result};
use crate::measure::StoppingRule;
use crate::program::Sources;
use crate::record::{CurrentPlan, Record};
use crate::scene::Loaded;
use std::collections::HashSet;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// What a run needs besides its observer.
pub struct Run<'a> {
    /// What is measured.
    pub experiment: &'a Experiment,
    /// The values that were laid over its config.
    pub overrides: &'a [(String, String)],
    /// On which devices.
    pub devices: &'a [&'a DeviceInfo],
    /// Where kernels come from.
    pub sources: &'a Sources,
    /// Kernels that are compared with those, in the same rounds.
    pub other_sources: Option<&'a Sources>,
    /// The longest that one step of a point may take: a build with its first image, or a frame.
    pub limit: Duration,
    /// Whether failed points of an earlier run are tried again.
    pub retry_failed: bool,
    /// The locks of devices: a group of points is timed while nobody else measures on its device.
    pub locks: &'a Locks,
    /// Whether points are spread over the devices, which are alike, instead of each being measured on all.
    pub spread: bool,
}

impl Run<'_> {
    /// The plan.
    pub fn plan(&self) -> Plan {
        Plan::new(self.experiment, self.planned_devices())
    }

    fn planned_devices(&self) -> usize {
        if self.spread { self.devices.len().min(1) } else { self.devices.len() }
    }

    /// The experiment's scenes, in its order.
    pub fn load_scenes(&self) -> Result<Vec<Loaded>> {
        self.experiment.scenes.iter().map(SceneChoice::load).collect()
    }

    /// The jobs of its workers, one a device; without devices one for the host. Of other kernels likewise, behind them.
    pub fn jobs(&self, folder: &Path, fault: Option<Fault>) -> Vec<Job> {
        self.all_sources().flat_map(|sources| self.jobs_of(sources, folder, fault)).collect()
    }

    fn all_sources(&self) -> impl Iterator<Item = &Sources> {
        std::iter::once(self.sources).chain(self.other_sources)
    }

    fn jobs_of(&self, sources: &Sources, folder: &Path, fault: Option<Fault>) -> Vec<Job> {
        let job = |device| Job {
            config: self.experiment.path.clone(),
            text: self.experiment.source.clone(),
            overrides: self.overrides.to_vec(),
            device_count: self.planned_devices(),
            device,
            stands_for: self.devices.first().filter(|_| self.spread).map(|&device| device.clone()),
            cl_dir: match sources {
                Sources::Embedded => None,
                Sources::Folder(folder) => Some(folder.clone()),
            },
            folder: folder.to_owned(),
            fault,
        };
        match self.devices {
            [] => vec![job(None)],
            devices => devices.iter().map(|device| job(Some(device.identity()))).collect(),
        }
    }

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

    /// What the devices of some points are locked by.
    pub fn lock_names(&self, points: &[Open]) -> Vec<LockName> {
        let count = self.devices.len().max(1);
        let device =
            |open: &Open| self.devices.get(open.device % count).filter(|_| !open.record.is_baseline());
        points.iter().map(|open| LockName::of(device(open).copied())).collect()
    }

    /// When a launch has enough samples.
    pub fn stopping_rule(&self) -> StoppingRule {
        let timing = &self.experiment.timing;
        let rule = StoppingRule {
            min_samples: timing.min_samples as usize,
            max_samples: timing.max_samples as usize,
            relative_sigma: timing.relative_sigma,
            time_limit_ms: timing.time_limit_ms,
        };
        rule.shared_by(timing.launches as usize)
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

    /// Every point of the plan with what is known of it, by groups. Scenes are loaded one at a time.
    pub(super) fn open_points(&self, plan: &Plan) -> Result<Vec<Vec<Open>>> {
        let drafters: Vec<_> =
            self.all_sources().map(|sources| Drafter { experiment: self.experiment, sources }).collect();
        let labels = self.other_sources.map(|other| labels([self.sources, other]));
        let mut groups = Vec::new();
        let mut number = 0;
        let mut held: Option<(usize, Hashed)> = None;
        let planned: Vec<&[Point]> =
            if self.spread { plan.groups_by_device().collect() } else { plan.groups().collect() };
        for group in planned {
            let mut open = Vec::new();
            for point in group {
                let at = match held.take() {
                    Some((scene, at)) if scene == point.scene => at,
                    _ => self.experiment.scenes[point.scene].load()?.into(),
                };
                let device = point.device.map(|device| self.devices[device]);
                for (place, drafter) in drafters.iter().enumerate().take(if device.is_some() { 2 } else { 1 })
                {
                    let mut record = drafter.draft(point, device, &at)?;
                    let of = labels.as_ref().filter(|_| device.is_some()).map(|labels| &labels[place]);
                    of.into_iter().for_each(|label| of_kernels(&mut record, label));
                    let name = of.map_or(String::new(), |label| format!(" ({label})"));
                    // Casters on the host have no device: any worker will do.
                    let job = point.device.unwrap_or(0) + place * self.devices.len().max(1);
                    let label = point.label(self.experiment) + &name;
                    open.push(Open::new([number, job, point.scene], label, record));
                }
                held = Some((point.scene, at));
                number += 1;
            }
            groups.push(open);
        }
        Ok(groups)
    }
}

/// What two folders of kernels are called.
fn labels(sources: [&Sources; 2]) -> [String; 2] {
    let name = |sources: &Sources| match sources {
        Sources::Embedded => "built in".to_owned(),
        Sources::Folder(folder) => {
            let name = folder.file_name().map(|name| name.to_string_lossy().into_owned());
            name.unwrap_or_else(|| folder.display().to_string())
        }
    };
    let [one, other] = sources.map(name);
    if one == other { [format!("{one}, A"), format!("{other}, B")] } else { [one, other] }
}

/// A point of one of two folders of kernels. Neither is the preset, which is what is built in.
fn of_kernels(record: &mut Record, label: &str) {
    record.name = format!("{} ({label})", record.name);
    record.preset = None;
    record.kernels_of = Some(label.to_owned());
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
