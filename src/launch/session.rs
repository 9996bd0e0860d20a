//! The one way from a strategy to something that casts.

use super::held::Held;
use super::prepared::Prepared;
use super::refused::Refused;
use super::shared_scene::SharedScene;
use super::{HostTree, Queue};
use crate::cache::Cache;
use crate::device::{Builtins, Device, DeviceInfo, DeviceLimits};
use crate::error::Result;
use crate::memory::{Available, resident_bytes};
use crate::program::{BuiltProgram, Kept, ProgramSpec, Sources};
use crate::scene::Scene;
use crate::strategy::{HostNeeds, Infeasible, Requirements, Strategy, Workload};
use std::sync::Arc;

/// A scene on an open device. It takes a strategy and sizes; checks that they make sense, and that device and host can hold
/// them; builds tree and program, uploads, and gives what hands out casters. Its strategies share the scene.
pub struct Session {
    queue: Queue,
    scene: Arc<Scene>,
    sources: Sources,
    limits: DeviceLimits,
    builtins: Builtins,
    compute_capability: Option<String>,
    verifies: bool,
    samples: u32,
    kept: Kept,
    early: Option<(ProgramSpec, BuiltProgram)>,
    early_tree: Option<(Strategy, HostTree)>,
    shared: SharedScene,
    held: Held,
}

impl Session {
    /// Opens a device for a scene.
    pub fn open(device: &Device, sources: &Sources, scene: Arc<Scene>) -> Result<Self> {
        Ok(Self::new(Queue::open(device.platform, device.device)?, &device.info, sources, scene))
    }

    /// The same of a device that is open.
    pub fn new(queue: Queue, info: &DeviceInfo, sources: &Sources, scene: Arc<Scene>) -> Self {
        Self {
            queue,
            scene,
            sources: sources.clone(),
            limits: info.limits,
            builtins: info.builtins(),
            compute_capability: info.hardware.compute_capability.clone(),
            verifies: false,
            samples: 1,
            kept: Kept::of(Cache::of_user(), info),
            early: None,
            early_tree: None,
            shared: SharedScene::default(),
            held: Held::default(),
        }
    }

    /// With the limits of a smaller device.
    #[must_use]
    pub fn limited(self, limits: DeviceLimits) -> Self {
        Self { limits, ..self }
    }

    /// With other built-ins than the device's.
    #[must_use]
    pub fn with_builtins(self, builtins: Builtins) -> Self {
        Self { builtins, ..self }
    }

    /// With compiled programs in another cache than the user's.
    #[must_use]
    pub fn keeping(self, kept: Kept) -> Self {
        Self { kept, ..self }
    }

    /// With a program that was built before the scene was there: the next strategy may need it.
    #[must_use]
    pub fn with_program(self, early: Option<(ProgramSpec, BuiltProgram)>) -> Self {
        Self { early, ..self }
    }

    /// With a tree that was built before the device was open.
    #[must_use]
    pub fn with_tree(self, early_tree: Option<(Strategy, HostTree)>) -> Self {
        Self { early_tree, ..self }
    }

    /// Whether images are compared with the reference, which takes memory of the host beside them.
    #[must_use]
    pub fn verifying(self, verifies: bool) -> Self {
        Self { verifies, ..self }
    }

    /// With several samples per pixel, which decide whether lights with a radius are soft.
    #[must_use]
    pub fn sampling(self, samples: u32) -> Self {
        Self { samples, ..self }
    }

    /// Whether it is of this scene.
    pub fn is_of(&self, scene: &Arc<Scene>) -> bool {
        Arc::ptr_eq(&self.scene, scene)
    }

    /// What kernels may use of what the compiler has.
    pub fn builtins(&self) -> Builtins {
        self.builtins
    }

    /// Everything up to a caster.
    pub fn prepare(
        &mut self,
        strategy: &Strategy,
        image_size: [u32; 2],
        local_size: [u32; 2],
    ) -> std::result::Result<Prepared, Refused> {
        let workload = self.workload(strategy, image_size, local_size)?;
        let spec = self.spec(strategy, &workload)?;
        self.build(strategy, &workload, spec)
    }

    /// The first step: the sizes, with how deep the strategy's tree is, which is built where it walks one.
    pub fn workload(
        &mut self,
        strategy: &Strategy,
        image_size: [u32; 2],
        local_size: [u32; 2],
    ) -> std::result::Result<Workload, Refused> {
        strategy.check()?;
        let mut workload =
            Workload::of(&self.scene, image_size, local_size).sampled(&self.scene, self.samples);
        if strategy.needs_tree() && self.shared.tree(strategy).is_none() {
            self.fits(strategy, &workload)?;
            let early = self.early_tree.take_if(|(of, _)| of == strategy).map(|(_, tree)| tree);
            let built = self.shared.build_tree(&self.queue, &self.scene, strategy, early);
            built.map_err(Refused::at("the tree"))?;
        }
        workload.stack_size = self.shared.tree(strategy).map_or(0, |tree| tree.stack_size);
        Ok(workload)
    }

    /// The second step: what is compiled.
    pub fn spec(&self, strategy: &Strategy, workload: &Workload) -> Result<ProgramSpec> {
        ProgramSpec::new(&self.sources, strategy, workload, self.builtins)
    }

    /// The last step: compiles and uploads what fits.
    pub fn build(
        &mut self,
        strategy: &Strategy,
        workload: &Workload,
        spec: ProgramSpec,
    ) -> std::result::Result<Prepared, Refused> {
        self.fits(strategy, workload)?;
        let (program, build_wait_ms) = self.program(&spec)?;
        let uploaded = self.shared.layout(&self.queue, &self.scene, strategy);
        let uploaded = uploaded.map_err(Refused::at("uploading the scene"))?;
        self.held.share(strategy, workload);
        Ok(Prepared {
            queue: self.queue.clone(),
            scene: Arc::clone(&self.scene),
            strategy: *strategy,
            workload: *workload,
            samples: self.samples,
            spec,
            program,
            build_wait_ms,
            host_bytes: self.host_needs(strategy, workload).bytes(),
            uploaded,
            tree: self.shared.tree(strategy),
            compute_capability: self.compute_capability.clone(),
            frames: self.held.frames(),
        })
    }

    /// What was built early, or is built now, and how long that takes.
    fn program(&mut self, spec: &ProgramSpec) -> std::result::Result<(BuiltProgram, f64), Refused> {
        if let Some((_, program)) = self.early.take_if(|(known, _)| known == spec) {
            return Ok((program, 0.0));
        }
        let Queue { context, device, .. } = &self.queue;
        let program = BuiltProgram::build(context, *device, spec, &self.kept).map_err(Refused::Build)?;
        let build_ms = program.build_ms;
        Ok((program, build_ms))
    }

    /// The host's memory that a strategy needs.
    fn host_needs(&self, strategy: &Strategy, workload: &Workload) -> HostNeeds {
        HostNeeds::of(strategy, workload, self.queue.shares_memory, self.verifies)
    }

    /// Refuses what the device or the host cannot hold beside what other strategies hold.
    fn fits(&self, strategy: &Strategy, workload: &Workload) -> std::result::Result<(), Refused> {
        let held_bytes = self.held.beside(strategy);
        let limits =
            DeviceLimits { global_bytes: self.limits.global_bytes.saturating_sub(held_bytes), ..self.limits };
        Requirements::check(strategy, workload, &limits).map_err(|refused| {
            // Global memory is the only memory of a device that several strategies share.
            let shared = refused.reason.starts_with("global memory");
            Refused::Device(if shared { beside(refused, held_bytes) } else { refused })
        })?;
        let held_of_host = if self.queue.shares_memory { held_bytes } else { 0 };
        let own_bytes = resident_bytes().unwrap_or(0).saturating_sub(held_of_host);
        self.host_needs(strategy, workload)
            .check(&Available::read(), own_bytes)
            .map_err(|refused| Refused::Host(beside(refused, held_of_host)))
    }
}

/// Says what others hold of a memory that is shared with them.
fn beside(refused: Infeasible, held_bytes: u64) -> Infeasible {
    if held_bytes == 0 {
        return refused;
    }
    Infeasible { reason: format!("{}, beside {held_bytes} B of other points", refused.reason) }
}
