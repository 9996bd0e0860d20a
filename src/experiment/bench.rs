//! A device with what points on it share, and all that a point must pass before it is timed.

use crate::config::{Emulate, NamedStrategy};
use crate::device::{Device, DeviceLimits, Hardware};
use crate::error::Result;
use crate::image::Radiance;
use crate::launch::{Caster, DeviceScene, DeviceTree, LaunchError, Queue};
use crate::memory::{Available, resident_bytes};
use crate::program::{BuiltProgram, MadeKernel, ProgramSpec};
use crate::record::{Outcome, Record};
use crate::scene::Scene;
use crate::strategy::{
    HostNeeds, Infeasible, Layout, LeafSize, NodeWidth, Requirements, Strategy, Traversal, Workload,
};
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
    layouts: HashMap<LayoutKind, DeviceScene>,
    trees: HashMap<TreeKind, DeviceTree>,
    /// Bytes of the buffers of points that are ready: they are cast in rounds, so none is dropped before the others.
    point_bytes: u64,
    /// Bytes of what points of a kind share, scene and tree.
    shared_bytes: HashMap<Kind, u64>,
}

/// What tells what one point shares with others from what another does.
type Kind = (LayoutKind, Option<TreeKind>);

fn kind(strategy: &Strategy) -> Kind {
    (layout_kind(strategy), strategy.needs_tree().then(|| tree_kind(strategy)))
}

/// What tells one tree of a scene from another.
type TreeKind = (Traversal, NodeWidth, LeafSize);

fn tree_kind(strategy: &Strategy) -> TreeKind {
    (strategy.traversal, strategy.node_width, strategy.leaf_size)
}

/// What tells one upload of a scene from another: a layout, and whether the triangles are in it.
type LayoutKind = (Layout, bool);

fn layout_kind(strategy: &Strategy) -> LayoutKind {
    (strategy.layout, strategy.reads_mesh())
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
    /// Opens `device`, imitating a smaller one where `emulate` says so.
    pub fn open(device: &Device, emulate: &Emulate) -> Result<Self> {
        Ok(Self {
            queue: Queue::open(device.platform, device.device)?,
            limits: emulate.apply(device.info.limits),
            hardware: device.info.hardware.clone(),
            scene: usize::MAX,
            layouts: HashMap::new(),
            trees: HashMap::new(),
            point_bytes: 0,
            shared_bytes: HashMap::new(),
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
        self.fits(&named.strategy, workload)?;
        let program = BuiltProgram::build(&self.queue.context, self.queue.device, spec)
            .map_err(|error| Refusal::new(Outcome::BuildFailed, error.log))?;
        record.build_ms = Some(program.build_ms);
        self.upload(number, scene, &named.strategy)?;
        let Some(device_scene) = self.layouts.get(&layout_kind(&named.strategy)) else {
            return Err(Refusal::new(Outcome::LaunchFailed, "the scene was not uploaded"));
        };
        let tree = self.tree(&named.strategy);
        let caster =
            Caster::new(&self.queue, &program, &named.strategy, workload, scene, device_scene, tree)?;
        // What is left without pixels is shared.
        let shared = Requirements::of(&named.strategy, &Workload { image_size: [0, 0], ..*workload });
        self.shared_bytes.insert(kind(&named.strategy), shared.global_bytes);
        self.point_bytes += needs.global_bytes - shared.global_bytes + needs.scratch_bytes;
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

    /// Says that no point is ready any more: those of another group come.
    pub fn let_go(&mut self) {
        self.point_bytes = 0;
    }

    /// Refuses what the device or the host cannot hold beside what other points hold.
    fn fits(&self, strategy: &Strategy, workload: &Workload) -> std::result::Result<(), Refusal> {
        let own = kind(strategy);
        let others = self.shared_bytes.iter().filter(|(kind, _)| **kind != own).map(|(_, bytes)| bytes);
        let held_bytes = self.point_bytes + others.sum::<u64>();
        let infeasible = |refused: Infeasible| {
            // Of what is refused, only memory is shared with other points.
            let shared =
                ["global memory", "the host's memory"].iter().any(|own| refused.reason.starts_with(own));
            let held = if shared && held_bytes > 0 {
                format!(", beside {held_bytes} B of other points")
            } else {
                String::new()
            };
            Refusal::new(Outcome::Infeasible, refused.reason + &held)
        };
        let left = self.limits.global_bytes.saturating_sub(held_bytes);
        let limits = DeviceLimits { global_bytes: left, ..self.limits };
        Requirements::check(strategy, workload, &limits).map_err(infeasible)?;
        let shared = self.queue.shares_memory;
        let held = if shared { held_bytes } else { 0 };
        let own_bytes = resident_bytes().unwrap_or(0).saturating_sub(held);
        HostNeeds::of(strategy, workload, shared, true)
            .check(&Available::read(), own_bytes)
            .map_err(infeasible)
    }

    /// Drops what belongs to another scene.
    fn turn_to(&mut self, number: usize) {
        if self.scene != number {
            self.scene = number;
            self.layouts.clear();
            self.trees.clear();
            self.shared_bytes.clear();
            self.point_bytes = 0;
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
            self.fits(strategy, workload)?;
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

    /// Uploads the scene numbered `number` as a strategy reads it; the scene before it is dropped.
    fn upload(
        &mut self,
        number: usize,
        scene: &Scene,
        strategy: &Strategy,
    ) -> std::result::Result<(), LaunchError> {
        self.turn_to(number);
        if let Entry::Vacant(entry) = self.layouts.entry(layout_kind(strategy)) {
            entry.insert(DeviceScene::upload(&self.queue, scene, strategy)?);
        }
        Ok(())
    }
}

/// The first frame, which drivers may still compile for, and its image.
pub fn first_image(caster: &Caster) -> std::result::Result<(Radiance, usize), Refusal> {
    caster.cast()?;
    Ok(caster.read()?)
}
