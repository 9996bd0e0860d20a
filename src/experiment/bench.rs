//! A device with what points on it share, and all that a point must pass before it is timed.

use crate::config::{LimitOverrides, NamedStrategy};
use crate::device::{Device, DeviceLimits, Hardware};
use crate::error::Result;
use crate::image::Radiance;
use crate::launch::{Caster, DeviceScene, DeviceTree, LaunchError, Queue};
use crate::program::{BuiltProgram, MadeKernel, ProgramSpec};
use crate::record::{Outcome, Record};
use crate::scene::Scene;
use crate::strategy::{Layout, LeafSize, NodeWidth, Requirements, Strategy, Traversal, Workload};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// A device ready to cast, and what its points share.
pub struct Bench {
    queue: Queue,
    limits: DeviceLimits,
    hardware: Hardware,
    /// The scene at hand, by its number, in the layouts uploaded so far.
    scene: usize,
    layouts: HashMap<Layout, DeviceScene>,
    trees: HashMap<TreeKind, DeviceTree>,
}

/// What tells one tree of a scene from another.
type TreeKind = (Traversal, NodeWidth, LeafSize);

fn tree_kind(strategy: &Strategy) -> TreeKind {
    (strategy.traversal, strategy.node_width, strategy.leaf_size)
}

/// Why a point cannot be timed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refusal {
    /// What to record.
    pub outcome: Outcome,
    /// Why, in a sentence.
    pub reason: String,
}

impl Refusal {
    /// An outcome and its reason.
    pub fn new(outcome: Outcome, reason: impl Into<String>) -> Self {
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
    pub fn open(device: &Device, limits: &LimitOverrides) -> Result<Self> {
        Ok(Self {
            queue: Queue::open(device.platform, device.device)?,
            limits: limits.apply(device.info.limits),
            hardware: device.info.hardware.clone(),
            scene: usize::MAX,
            layouts: HashMap::new(),
            trees: HashMap::new(),
        })
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
        self.upload(number, scene, named.strategy.layout)?;
        let Some(device_scene) = self.layouts.get(&named.strategy.layout) else {
            return Err(Refusal::new(Outcome::LaunchFailed, "the scene was not uploaded"));
        };
        let tree = self.tree(&named.strategy);
        let caster =
            Caster::new(&self.queue, &program, &named.strategy, workload, scene, device_scene, tree)?;
        record.kernels = self.made(&program, &caster, workload);
        Ok(caster)
    }

    /// What the compiler made of a frame's kernels.
    fn made(&self, program: &BuiltProgram, caster: &Caster, workload: &Workload) -> Vec<MadeKernel> {
        let (log, ptx) = (program.log(), program.ptx());
        let capability = self.hardware.compute_capability.as_deref();
        let items = workload.local_size.iter().product();
        let made =
            |kernel| MadeKernel::of(kernel, self.queue.device, &log, &ptx).predicted(capability, items);
        caster.kernels().map(made).collect()
    }

    /// Drops what belongs to another scene.
    fn turn_to(&mut self, number: usize) {
        if self.scene != number {
            self.scene = number;
            self.layouts.clear();
            self.trees.clear();
        }
    }

    /// Builds the scene's tree, where a strategy wants one, and says in `workload` how deep it is.
    pub fn grow(
        &mut self,
        named: &NamedStrategy,
        number: usize,
        scene: &Scene,
        workload: &mut Workload,
    ) -> std::result::Result<(), Refusal> {
        self.turn_to(number);
        let strategy = &named.strategy;
        let kind = tree_kind(strategy);
        if strategy.needs_tree() && !self.trees.contains_key(&kind) {
            Requirements::check(strategy, workload, &self.limits)
                .map_err(|infeasible| Refusal::new(Outcome::Infeasible, infeasible.reason))?;
            if let Some(tree) = DeviceTree::build(&self.queue, &scene.mesh, strategy)? {
                self.trees.insert(kind, tree);
            }
        }
        workload.stack_size = self.tree(strategy).map_or(0, |tree| tree.stack_size);
        Ok(())
    }

    fn tree(&self, strategy: &Strategy) -> Option<&DeviceTree> {
        self.trees.get(&tree_kind(strategy)).filter(|_| strategy.needs_tree())
    }

    /// Uploads the scene numbered `number` in a layout; the scene before it is dropped.
    fn upload(
        &mut self,
        number: usize,
        scene: &Scene,
        layout: Layout,
    ) -> std::result::Result<(), LaunchError> {
        self.turn_to(number);
        if let Entry::Vacant(entry) = self.layouts.entry(layout) {
            entry.insert(DeviceScene::upload(&self.queue, scene, layout)?);
        }
        Ok(())
    }
}

/// The first frame, which drivers may still compile for, and its image.
pub fn first_image(caster: &Caster) -> std::result::Result<(Radiance, usize), Refusal> {
    caster.cast()?;
    Ok(caster.read()?)
}
