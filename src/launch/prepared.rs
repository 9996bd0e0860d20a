//! A strategy that is ready to cast a scene on a device.

use super::band::Band;
use super::held::Frames;
use super::refused::Refused;
use super::scene::{light_anew, move_lights};
use super::setup::{Setup, sees_sky};
use super::{Caster, DeviceScene, DeviceTree, LaunchError, Queue, preprocess_for};
use crate::error::Result as OrError;
use crate::program::preprocess::Preprocessed;
use crate::program::{BuildError, BuiltProgram, CompiledKernel, Kept, ProgramSpec};
use crate::scene::{Light, Sampling, Scene};
use crate::strategy::{Requirements, Strategy, Workload};
use std::sync::Arc;

/// A strategy with its program built and its scene uploaded, made by [`Session`](super::Session).
pub struct Prepared {
    /// The sizes.
    pub workload: Workload,
    /// Number of samples per pixel.
    pub sampling: Sampling,
    /// The source that was compiled.
    pub spec: ProgramSpec,
    /// The compiled program.
    pub program: BuiltProgram,
    /// The time for which building continued after the scene was loaded.
    pub build_wait_ms: f64,
    /// The largest amount of host memory that the strategy needs at any time.
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
    /// Makes a caster for the frame.
    pub fn caster(&self) -> Result<Caster, Refused> {
        self.caster_of(&self.workload, None)
    }

    /// Makes a caster for a frame of another size, or for a band of it.
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

    /// Moves the scene's lights, starting with the next frame. Their number stays the same.
    pub fn move_lights(&self, lights: &[Light]) -> Result<(), LaunchError> {
        move_lights(&self.queue, &self.uploaded.lights, lights)
    }

    /// Changes lights, sky, background and shadow bias to those of another scene, starting with the caster's next
    /// frame, for which the camera is an argument anyway. Returns `false` if the scene needs other buffers or
    /// kernels: it has another mesh or another number of lights, for example.
    pub fn show(&mut self, scene: &Arc<Scene>, caster: &Caster) -> Result<bool, LaunchError> {
        if !self.suits(scene) {
            return Ok(false);
        }
        light_anew(&self.queue, &self.uploaded, [&self.scene, scene])?;
        caster.show_background(scene)?;
        self.scene = Arc::clone(scene);
        Ok(true)
    }

    /// Returns whether the program and all buffers have the right sizes for a scene, and the same mesh.
    fn suits(&self, scene: &Arc<Scene>) -> bool {
        let Workload { image_size, local_size, stack_size, .. } = self.workload;
        let workload = Workload::of(scene, image_size, local_size).sampled(scene, &self.sampling);
        Arc::ptr_eq(&self.scene.mesh, &scene.mesh)
            && Workload { stack_size, ..workload } == self.workload
            && self.scene.transparent == scene.transparent
            && sees_sky(&self.scene) == sees_sky(scene)
    }

    /// Returns properties of a frame's compiled kernels, from the build log and the binary (PTX, or empty).
    pub fn made(&self, caster: &Caster, log: &str, ptx: &str) -> Vec<CompiledKernel> {
        let items = self.workload.local_size.iter().product();
        let made = |kernel| {
            let made = CompiledKernel::of(kernel, self.queue.device, log, ptx);
            made.predicted(self.compute_capability.as_deref(), items)
        };
        caster.kernels().map(made).collect()
    }

    /// Returns the program after preprocessing, as the device's compiler sees it.
    pub fn preprocessed(&self) -> OrError<Preprocessed> {
        preprocess_for(&self.queue, &self.spec)
    }

    /// Compiles another source for the same device, without storing the program in the cache.
    pub fn build_text(&self, spec: &ProgramSpec) -> Result<BuiltProgram, BuildError> {
        BuiltProgram::build(&self.queue.context, self.queue.device, spec, &Kept::default())
    }

    /// Returns the total size of the device's buffers.
    pub fn device_bytes(&self) -> u64 {
        let needs = Requirements::of(&self.strategy, &self.workload);
        needs.global_bytes + needs.scratch_bytes
    }

    /// Returns the time for building the tree on the host; 0 without a tree.
    pub fn tree_ms(&self) -> f64 {
        self.tree.as_ref().map_or(0.0, |tree| tree.build_ms)
    }

    /// Returns the time for uploading the scene and its tree.
    pub fn upload_ms(&self) -> f64 {
        self.uploaded.upload_ms + self.tree.as_ref().map_or(0.0, |tree| tree.upload_ms)
    }
}
