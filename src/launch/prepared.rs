//! A strategy that is ready to cast a scene on a device.

use super::band::Band;
use super::held::Frames;
use super::refused::Refused;
use super::scene::move_lights;
use super::setup::Setup;
use super::{Caster, DeviceScene, DeviceTree, LaunchError, Queue};
use crate::program::{BuiltProgram, CompiledKernel, ProgramSpec};
use crate::scene::{Light, Scene};
use crate::strategy::{Requirements, Strategy, Workload};
use std::sync::Arc;

/// Its program is built, its scene uploaded; [`Session`](super::Session) makes it.
pub struct Prepared {
    /// At which sizes.
    pub workload: Workload,
    /// Samples of each pixel.
    pub samples: u32,
    /// What was compiled.
    pub spec: ProgramSpec,
    /// What became of it.
    pub program: BuiltProgram,
    /// How long its build took after the scene was there.
    pub build_wait_ms: f64,
    /// The host's memory that it needs, at the worst moment.
    pub host_bytes: u64,
    pub(super) queue: Queue,
    pub(super) scene: Arc<Scene>,
    pub(super) strategy: Strategy,
    pub(super) uploaded: Arc<DeviceScene>,
    pub(super) tree: Option<Arc<DeviceTree>>,
    pub(super) compute_capability: Option<String>,
    pub(super) frames: Frames,
}

impl Prepared {
    /// What casts the frame.
    pub fn caster(&self) -> Result<Caster, Refused> {
        self.caster_of(&self.workload, None)
    }

    /// What casts some rows of work-groups of a frame of other sizes; all of them without a band.
    pub(super) fn caster_of(&self, workload: &Workload, band: Option<Band>) -> Result<Caster, Refused> {
        let bytes = self.frames.count(&self.strategy, workload);
        Caster::new(self.setup(workload), band, bytes).map_err(Refused::at("preparing the frame"))
    }

    fn setup<'a>(&'a self, workload: &'a Workload) -> Setup<'a> {
        Setup {
            queue: &self.queue,
            program: &self.program,
            strategy: &self.strategy,
            workload,
            scene: &self.scene,
            uploaded: &self.uploaded,
            tree: self.tree.as_deref(),
        }
    }

    /// Moves the scene's lights from the next frame on. Their number stays the same.
    pub fn move_lights(&self, lights: &[Light]) -> Result<(), LaunchError> {
        move_lights(&self.queue, &self.uploaded.lights, lights)
    }

    /// What the compiler made of a frame's kernels, by its log and its binary (PTX, or empty).
    pub fn made(&self, caster: &Caster, log: &str, ptx: &str) -> Vec<CompiledKernel> {
        let items = self.workload.local_size.iter().product();
        let made = |kernel| {
            let made = CompiledKernel::of(kernel, self.queue.device, log, ptx);
            made.predicted(self.compute_capability.as_deref(), items)
        };
        caster.kernels().map(made).collect()
    }

    /// The device's buffers.
    pub fn device_bytes(&self) -> u64 {
        let needs = Requirements::of(&self.strategy, &self.workload);
        needs.global_bytes + needs.scratch_bytes
    }

    /// Time to build the tree on the host; 0 without a tree.
    pub fn tree_ms(&self) -> f64 {
        self.tree.as_ref().map_or(0.0, |tree| tree.build_ms)
    }

    /// Bringing the scene and its tree to the device.
    pub fn upload_ms(&self) -> f64 {
        self.uploaded.upload_ms + self.tree.as_ref().map_or(0.0, |tree| tree.upload_ms)
    }
}
