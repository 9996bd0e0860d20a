//! The kernels of a frame with their arguments.

use super::band::Band;
use super::buffers::allocate;
use super::frame::Phase;
use super::scene::DeviceScene;
use super::shared::Shared;
use super::steps::{CameraArguments, Step, Steps, camera_arguments, geometry_arguments, ray_arguments};
use super::tree::DeviceTree;
use super::{LaunchError, NO_HIT, Queue};
use crate::program::BuiltProgram;
use crate::strategy::{Passes, Strategy, Traversal, Workload};
use ocl::builders::KernelBuilder;
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult};
use ocl::prm::Float4;
use ocl::{Buffer, Kernel};
use std::ops::Range;

/// Where working vectors that need a buffer live.
pub(super) enum Working {
    None,
    Scratch(Buffer<f32>),
    Heap { pool: Buffer<f32>, top: Buffer<i32>, size: u32 },
}

/// Triangles that a work-group prepares.
const PREPARED_TOGETHER: usize = 64;

/// A work-item a triangle and origin. The work-group is given: OpenCL would look for a divisor of the number of triangles,
/// which may be one.
pub(super) fn size_for_preparing(kernel: &mut KernelBuilder<'_>, triangles: usize, origins: usize) {
    kernel.global_work_size([triangles.next_multiple_of(PREPARED_TOGETHER), origins]);
    kernel.local_work_size([PREPARED_TOGETHER, 1]);
}

/// What all kernels of a frame are made from.
pub(super) struct Parts<'a> {
    pub queue: &'a Queue,
    pub program: &'a BuiltProgram,
    pub strategy: &'a Strategy,
    pub workload: &'a Workload,
    pub scene: &'a DeviceScene,
    pub bias: f32,
    pub background: Float4,
    pub camera: CameraArguments,
    pub working: &'a Working,
    pub prepared: Option<&'a Buffer<f32>>,
    pub tree: Option<&'a DeviceTree>,
    pub band: Option<Band>,
}

impl<'a> Parts<'a> {
    /// A kernel of one work-item a block of pixels.
    fn pixel_kernel(
        &self,
        name: &'static str,
        finish: impl FnOnce(&mut KernelBuilder<'a>),
    ) -> Result<Kernel, LaunchError> {
        let mut kernel = self.kernel(name);
        if let Some(band) = &self.band {
            kernel.global_work_offset([0, band.start * self.workload.local_size[1] as usize]);
        }
        kernel.global_work_size(self.pixel_items());
        kernel.local_work_size(self.workload.local_size.map(|n| n as usize));
        match self.tree {
            Some(DeviceTree { nodes, leaves, surfaces: Some(surfaces), .. }) => {
                self.light_arguments(&mut kernel);
                kernel.arg(nodes).arg(leaves).arg(&surfaces.normals).arg(&surfaces.materials);
                kernel.arg(surfaces.material_count as i32);
                if let Some(prepared) = self.prepared {
                    kernel.arg(prepared).arg(self.scene.triangle_count as i32);
                }
            }
            _ => self.scene_arguments(&mut kernel),
        }
        camera_arguments(&mut kernel, &self.camera);
        finish(&mut kernel);
        match self.working {
            Working::None => {}
            Working::Scratch(scratch) => {
                kernel.arg(scratch);
            }
            Working::Heap { pool, top, size } => {
                kernel.arg(pool).arg(top).arg(*size);
            }
        }
        let kernel = kernel.build()?;
        self.check_work_group(&kernel, name)?;
        Ok(kernel)
    }

    /// Its work-items across and down.
    fn pixel_items(&self) -> [usize; 2] {
        let [across, down] = self.workload.global_size(self.strategy);
        let rows = |band: &Band| band.len() * self.workload.local_size[1] as usize;
        [across, self.band.as_ref().map_or(down, rows)]
    }

    /// SCENE_PARAMETERS in the kernels.
    fn scene_arguments(&self, kernel: &mut KernelBuilder<'a>) {
        geometry_arguments(kernel, self.scene);
        self.light_arguments(kernel);
        if let Some(prepared) = self.prepared {
            kernel.arg(prepared);
        }
        if let Some(tree) = self.tree {
            kernel.arg(&tree.nodes).arg(&tree.leaves);
        }
    }

    fn light_arguments(&self, kernel: &mut KernelBuilder<'a>) {
        kernel.arg(&self.scene.lights).arg(self.scene.light_count as i32).arg(self.bias);
    }

    /// Asks the built kernel again whether it can hold the local size.
    fn check_work_group(&self, kernel: &Kernel, name: &str) -> Result<(), LaunchError> {
        let items = self.workload.local_size.iter().product::<u32>() as usize;
        match kernel.wg_info(self.queue.device, KernelWorkGroupInfo::WorkGroupSize)? {
            KernelWorkGroupInfoResult::WorkGroupSize(most) if most < items => {
                Err(LaunchError::WorkGroup { kernel: name.to_owned(), most, items })
            }
            _ => Ok(()),
        }
    }

    pub fn kernel(&self, name: &'static str) -> KernelBuilder<'a> {
        let mut kernel = Kernel::builder();
        kernel.program(&self.program.program).name(name).queue(self.queue.commands.clone());
        // SAFETY: the argument lists follow cast.cl's parameters; `ocl` compares type names, and refuses
        // a buffer of i32 for the allocator's uint.
        unsafe { kernel.disable_arg_type_check() };
        kernel
    }

    pub fn cast_frame(&self, image: &'a Buffer<Float4>) -> Result<Kernel, LaunchError> {
        let name = if self.strategy.traversal == Traversal::Tile { "tile_frame" } else { "cast_frame" };
        self.pixel_kernel(name, |kernel| {
            kernel.arg(self.background).arg(image);
        })
    }

    /// Casts in tiles that groups share. For every so many lights ([`Strategy::lights_of_round`]) there is a round: shadow
    /// rays, those that were left over, a group to each, and shading. Fused, the first round's shadow rays follow in the
    /// kernel that casts primary rays, and what was left over is cast beside shading.
    pub fn cast_shared(
        &self,
        image: &'a Buffer<Float4>,
        nearest: &'a Buffer<i32>,
        shared: &'a Shared,
    ) -> Result<Steps, LaunchError> {
        let lights = self.scene.light_count;
        let fused = self.strategy.passes == Passes::Fused && lights > 0;
        let mut steps = Steps::new();
        if !fused {
            steps.extend(self.prepare_tiles(0..1, 0, Phase::Primary, shared)?);
            steps.push((Phase::Primary, Step::Run(self.cast_primary(nearest)?)));
        }
        for first_light in (0..lights.max(1)).step_by(self.strategy.lights_of_round()) {
            if lights > 0 {
                steps.extend(self.cast_round(first_light, fused, nearest, shared)?);
            }
            let queue_rows = if fused { self.queue_rows(shared) } else { 0 };
            let shade = self.pixel_kernel("tile_shade", |kernel| {
                let [across, down] = self.pixel_items();
                let queue_items = queue_rows * self.workload.local_size[1] as usize;
                kernel.global_work_size([across, down + queue_items]);
                kernel.arg(first_light as i32).arg(self.background).arg(image).arg(nearest).arg(&shared.lit);
                kernel.arg(&shared.queue).arg(&shared.queued).arg(queue_rows as i32);
            })?;
            steps.push((Phase::Shade, Step::Run(shade)));
        }
        Ok(steps)
    }

    /// The shadow rays of a round's lights.
    fn cast_round(
        &self,
        first_light: usize,
        fused: bool,
        nearest: &'a Buffer<i32>,
        shared: &'a Shared,
    ) -> Result<Steps, LaunchError> {
        let first = fused && first_light == 0;
        let phase = if fused { Phase::Whole } else { Phase::Shadow };
        let lights = (self.scene.light_count - first_light).min(self.strategy.lights_of_round());
        let origins = if first { 0 } else { 1 }..1 + lights;
        let cast = |name, groups: Option<[usize; 2]>| {
            let kernel = self.pixel_kernel(name, |kernel| {
                if let Some(groups) = groups {
                    kernel.global_work_size(groups);
                }
                kernel.arg(first_light as i32).arg(nearest).arg(&shared.lit);
                kernel.arg(&shared.queue).arg(&shared.queued);
            })?;
            Ok::<_, LaunchError>((phase, Step::Run(kernel)))
        };
        let emptied = (phase, Step::Fill(shared.queued.clone(), 0));
        let mut steps = vec![self.prepare_tiles(origins, first_light, phase, shared)?.unwrap_or(emptied)];
        steps.push(cast(if first { "tile_cast" } else { "tile_shadow" }, None)?);
        if !fused {
            let [across, down] = self.workload.local_size.map(|n| n as usize);
            steps.push(cast("tile_left_over", Some([across * shared.groups.div_ceil(down), down]))?);
        }
        Ok(steps)
    }

    /// Rows of work-groups, as wide as the image, that have room for the groups which cast what was left over.
    fn queue_rows(&self, shared: &Shared) -> usize {
        let [across, down] = self.workload.local_size.map(|n| n as usize);
        shared.groups.div_ceil(down * (self.pixel_items()[0] / across))
    }

    pub fn cast_primary(&self, nearest: &'a Buffer<i32>) -> Result<Kernel, LaunchError> {
        let name = if self.strategy.traversal == Traversal::Tile { "tile_primary" } else { "cast_primary" };
        self.pixel_kernel(name, |kernel| {
            kernel.arg(nearest);
        })
    }

    pub fn shade_nearest(
        &self,
        image: &'a Buffer<Float4>,
        nearest: &'a Buffer<i32>,
    ) -> Result<Kernel, LaunchError> {
        let name = if self.strategy.traversal == Traversal::Tile { "tile_shade" } else { "shade_nearest" };
        self.pixel_kernel(name, |kernel| {
            kernel.arg(self.background).arg(image).arg(nearest);
        })
    }

    /// The allocator starts afresh before each kernel.
    pub fn reset_heap(&self, phase: Phase) -> Option<(Phase, Step)> {
        match self.working {
            Working::Heap { top, .. } => Some((phase, Step::Fill(top.clone(), 0))),
            _ => None,
        }
    }

    /// One work-item a triangle and origin; nothing where there are no triangles.
    pub fn prepare_origins(&self, prepared: &'a Buffer<f32>) -> ocl::Result<Option<(Phase, Step)>> {
        if self.scene.triangle_count == 0 {
            return Ok(None);
        }
        let mut kernel = self.kernel("prepare_origins");
        size_for_preparing(&mut kernel, self.scene.triangle_count, 1 + self.scene.light_count);
        geometry_arguments(&mut kernel, self.scene);
        kernel.arg(&self.scene.lights);
        ray_arguments(&mut kernel, &self.camera);
        kernel.arg(prepared);
        let phase = if self.strategy.passes == Passes::Fused { Phase::Whole } else { Phase::Primary };
        Ok(Some((phase, Step::Run(kernel.build()?))))
    }

    /// Prepares the planes of a tree's triangles for origins of a round, of which the first is the eye and the second its
    /// first light, and empties the queue; nothing where no planes are wanted.
    fn prepare_tiles(
        &self,
        origins: Range<usize>,
        first_light: usize,
        phase: Phase,
        shared: &'a Shared,
    ) -> ocl::Result<Option<(Phase, Step)>> {
        let (Some(prepared), Some(tree)) = (self.prepared, self.tree) else { return Ok(None) };
        let triangles = self.scene.triangle_count;
        if triangles == 0 || origins.is_empty() {
            return Ok(None);
        }
        let mut kernel = self.kernel("tile_prepare");
        size_for_preparing(&mut kernel, triangles, origins.len());
        kernel.arg(&self.scene.lights).arg(&tree.leaves).arg(triangles as i32).arg(self.camera.eye);
        kernel.arg(origins.start as i32).arg(first_light as i32).arg(prepared).arg(&shared.queued);
        Ok(Some((phase, Step::Run(kernel.build()?))))
    }

    /// Clears, resolves depth, then finds the triangle that has it.
    pub fn rasterise(&self, nearest: &Buffer<i32>, pixels: usize) -> ocl::Result<Steps> {
        let depth = allocate::<i32>(self.queue, pixels)?;
        let mut steps = vec![
            (Phase::Primary, Step::Fill(depth.clone(), NO_HIT)),
            (Phase::Primary, Step::Fill(nearest.clone(), NO_HIT)),
        ];
        if self.scene.triangle_count == 0 {
            return Ok(steps);
        }
        for name in ["raster_depth", "raster_nearest"] {
            let mut kernel = Kernel::builder();
            kernel.program(&self.program.program).name(name).queue(self.queue.commands.clone());
            kernel.global_work_size(self.scene.triangle_count);
            geometry_arguments(&mut kernel, self.scene);
            camera_arguments(&mut kernel, &self.camera);
            kernel.arg(&depth);
            if name == "raster_nearest" {
                kernel.arg(nearest);
            }
            steps.push((Phase::Primary, Step::Run(kernel.build()?)));
        }
        Ok(steps)
    }
}
