//! A device with what points on it share, and all that a point must pass before it is timed.

use crate::config::{LimitOverrides, NamedStrategy};
use crate::device::{Device, DeviceLimits};
use crate::error::Result;
use crate::image::Radiance;
use crate::launch::{Caster, DeviceScene, LaunchError, Queue};
use crate::program::{BuiltProgram, ProgramSpec, Sources};
use crate::record::{Outcome, Record};
use crate::scene::Scene;
use crate::strategy::{Layout, Requirements, Workload};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// A device ready to cast, and what its points share.
pub struct Bench {
    queue: Queue,
    limits: DeviceLimits,
    reduce_builtin: bool,
    sources: Sources,
    /// The scene at hand, by its number, in the layouts uploaded so far.
    scene: usize,
    layouts: HashMap<Layout, DeviceScene>,
}

/// Why a point cannot be timed.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// What to record.
    pub outcome: Outcome,
    /// Why, in a sentence.
    pub reason: String,
}

impl Refusal {
    fn new(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self { outcome, reason: reason.into() }
    }

    /// A kernel without a device to run on.
    pub fn no_device() -> Self {
        Self::new(Outcome::LaunchFailed, "no device was chosen")
    }

    /// An image that is not the reference's.
    pub fn wrong_image(reason: String) -> Self {
        Self::new(Outcome::WrongImage, reason)
    }

    /// The record of a point refused so.
    pub fn write_into(self, mut record: Record) -> Record {
        record.outcome = self.outcome;
        record.reason = Some(self.reason);
        record
    }
}

impl From<LaunchError> for Refusal {
    fn from(error: LaunchError) -> Self {
        let outcome = match error {
            LaunchError::WorkGroup { .. } => Outcome::Infeasible,
            _ => Outcome::LaunchFailed,
        };
        Self::new(outcome, error.to_string())
    }
}

impl Bench {
    /// Opens `device`, imitating a smaller one where `limits` says so.
    pub fn open(device: &Device, limits: &LimitOverrides, sources: &Sources) -> Result<Self> {
        Ok(Self {
            queue: Queue::open(device.platform, device.device)?,
            limits: limits.apply(device.info.limits),
            reduce_builtin: device.info.supports_reduce_builtin(),
            sources: sources.clone(),
            scene: usize::MAX,
            layouts: HashMap::new(),
        })
    }

    /// The program of a strategy at a workload.
    pub fn spec(&self, named: &NamedStrategy, workload: &Workload) -> Result<ProgramSpec> {
        ProgramSpec::new(&self.sources, &named.strategy, workload, self.reduce_builtin)
    }

    /// Everything up to the first frame: whether the device can hold the point, build, upload, buffers.
    /// Writes what it finds into `record`.
    pub fn prepare(
        &mut self,
        named: &NamedStrategy,
        workload: &Workload,
        number: usize,
        scene: &Scene,
        spec: &ProgramSpec,
        record: &mut Record,
    ) -> std::result::Result<Caster, Refusal> {
        let needs = Requirements::of(&named.strategy, workload);
        record.local_bytes = Some(needs.local_bytes);
        record.constant_bytes = Some(needs.constant_bytes);
        record.scratch_bytes = Some(needs.scratch_bytes);
        record.private_bytes = Some(needs.private_bytes);
        Requirements::check(&named.strategy, workload, &self.limits)
            .map_err(|infeasible| Refusal::new(Outcome::Infeasible, infeasible.reason))?;
        let program = BuiltProgram::build(&self.queue.context, self.queue.device, spec)
            .map_err(|error| Refusal::new(Outcome::BuildFailed, error.log))?;
        record.build_ms = Some(program.build_ms);
        let queue = self.queue.clone();
        let device_scene = self.scene(number, scene, named.strategy.layout)?;
        Ok(Caster::new(&queue, &program, &named.strategy, workload, scene, device_scene)?)
    }

    /// The scene numbered `number` in a layout; the scene before it is dropped.
    fn scene(
        &mut self,
        number: usize,
        scene: &Scene,
        layout: Layout,
    ) -> std::result::Result<&DeviceScene, LaunchError> {
        if self.scene != number {
            self.scene = number;
            self.layouts.clear();
        }
        Ok(match self.layouts.entry(layout) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(DeviceScene::upload(&self.queue, scene, layout)?),
        })
    }
}

/// The first frame, which drivers may still compile for, and its image.
pub fn first_image(caster: &Caster) -> std::result::Result<(Radiance, usize), Refusal> {
    caster.cast()?;
    Ok(caster.read()?)
}
