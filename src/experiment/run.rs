//! A run: what is measured, on which devices, with which kernels.

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
    /// What is measured of the plan, where it is cut into blocks: those of a shard, or all that are spread over the devices.
    pub blocks: Option<&'a [Block]>,
    /// Where programs are built before their points are checked; none builds each where it is checked.
    pub ahead: Option<&'a Ahead>,
}

impl Run<'_> {
    /// The plan.
    pub fn plan(&self) -> Plan {
        Plan::new(self.experiment, self.planned_devices())
    }

    /// What of the plan is measured together.
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

    /// The experiment's scenes, in its order.
    pub fn load_scenes(&self) -> Result<Vec<Loaded>> {
        self.experiment.scenes.iter().map(SceneChoice::load).collect()
    }

    /// The jobs of its workers, one per device; without devices one for the host. Of other kernels likewise, behind them.
    pub fn jobs(&self, folder: &Path, fault: Option<Fault>) -> Vec<Job> {
        self.all_sources().flat_map(|sources| self.jobs_of(sources, folder, fault)).collect()
    }

    /// Its kernels, and behind them those that they are compared with.
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
}
