//! A run: an experiment, devices and kernels.

use super::ahead::Ahead;
use super::asleep;
use super::piece::Piece;
use super::protocol::Job;
use super::{Fault, Plan};
use crate::config::{Experiment, SceneChoice};
use crate::device::DeviceInfo;
use crate::device_lock::Locks;
use crate::error::Result;
use crate::measure::StoppingRule;
use crate::program::Sources;
use crate::scene::Loaded;
use crate::shard::Block;
use std::path::Path;
use std::time::Duration;

/// The inputs of a run, except its observer.
pub struct Run<'a> {
    /// The experiment.
    pub experiment: &'a Experiment,
    /// The overrides of its config.
    pub overrides: &'a [(String, String)],
    /// The devices.
    pub devices: &'a [&'a DeviceInfo],
    /// The files of the kernels.
    pub sources: &'a Sources,
    /// Kernels to compare with `sources`, in the same rounds.
    pub other_sources: Option<&'a Sources>,
    /// The time limit for one step of a point: building its program and casting its first image, or casting a
    /// frame.
    pub limit: Duration,
    /// True if failed points of an earlier run are measured again.
    pub retry_failed: bool,
    /// The locks of devices. While a group of points is timed, no other process measures on its device.
    pub locks: &'a Locks,
    /// True if the points are distributed over several devices of the same model. Otherwise, each device
    /// measures all points.
    pub spread: bool,
    /// The blocks to measure, if the plan is cut into blocks: those of a shard, or all blocks for `--spread`.
    pub blocks: Option<&'a [Block]>,
    /// Builds programs before their points are checked; with `None`, each program is built during
    /// its point's check.
    pub ahead: Option<&'a Ahead>,
}

impl Run<'_> {
    /// Makes the plan.
    pub fn plan(&self) -> Plan {
        Plan::new(self.experiment, self.planned_devices())
    }

    /// Returns the parts of the plan that are measured together.
    pub(super) fn pieces(&self, plan: &Plan) -> Vec<Piece> {
        match self.blocks {
            Some(blocks) => plan.of_blocks(blocks),
            None if self.spread => plan.by_device(),
            None => plan.whole(),
        }
    }

    fn planned_devices(&self) -> usize {
        if self.spread { self.devices.len().min(1) } else { self.devices.len() }
    }

    /// Loads the experiment's scenes, in the experiment's order.
    pub fn load_scenes(&self) -> Result<Vec<Loaded>> {
        self.experiment.scenes.iter().map(SceneChoice::load).collect()
    }

    /// Returns the jobs of the run's workers: one per device, or a single one for the host if there are no devices.
    /// If the run compares two folders of kernels, the jobs for the other folder follow.
    pub fn jobs(&self, folder: &Path, fault: Option<Fault>) -> Vec<Job> {
        self.all_sources().flat_map(|sources| self.jobs_of(sources, folder, fault)).collect()
    }

    /// Returns the run's kernels. If they are compared with other kernels, the other kernels follow.
    pub(super) fn all_sources(&self) -> impl Iterator<Item = &Sources> {
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
            asleep_ms: asleep::frame_ms(self.devices),
        };
        match self.devices {
            [] => vec![job(None)],
            devices => devices.iter().map(|device| job(Some(device.identity()))).collect(),
        }
    }

    /// Returns the rule that decides when a launch has enough samples.
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
}
