//! Everything one point needs to cast a frame again and again.

use super::band::Band;
use super::buffers::{allocate, read_with};
use super::frame::{FrameTimes, Phase};
use super::left_over::LeftOver;
use super::scene::DeviceScene;
use super::steps::{CameraArguments, Step, Steps, camera_arguments, geometry_arguments};
use super::tree::DeviceTree;
use super::{NO_HIT, Queue, ROW_FLOATS};
use crate::image::Radiance;
use crate::program::BuiltProgram;
use crate::scene::Scene;
use crate::strategy::{Intersector, Passes, Requirements, Strategy, Traversal, Vectors, Workload};
use ocl::builders::KernelBuilder;
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult};
use ocl::prm::{Float4, Int2};
use ocl::{Buffer, Kernel};
use rayon::prelude::*;
use std::time::Instant;
use thiserror::Error;

/// A launch the device or its driver refused, or whose result it did not vouch for.
#[derive(Debug, Error)]
pub enum LaunchError {
    /// What OpenCL said.
    #[error("{0}")]
    OpenCl(String),
    /// The built kernel holds fewer work-items than the local size has.
    #[error(
        "the built kernel {kernel} holds work-groups of {most}, but the local size has {items} work-items"
    )]
    WorkGroup {
        /// Its name.
        kernel: String,
        /// Work-items it can hold.
        most: usize,
        /// Work-items of the local size.
        items: usize,
    },
    /// The scene's tree could not be made.
    #[error("{0}")]
    Tree(String),
    /// The in-kernel allocator asked for more than the pool holds.
    #[error("the in-kernel heap ran out: {used} of {size} values were asked for")]
    HeapExhausted {
        /// Values taken.
        used: u64,
        /// Values there are.
        size: u64,
    },
}

impl From<ocl::core::Error> for LaunchError {
    fn from(error: ocl::core::Error) -> Self {
        Self::from(ocl::Error::from(error))
    }
}

impl From<ocl::Error> for LaunchError {
    /// Keeps the status and the function, and drops `ocl`'s decoration.
    fn from(error: ocl::Error) -> Self {
        let message = error.to_string();
        let lines: Vec<_> = message
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty() && !line.contains("####"))
            .collect();
        Self::OpenCl(lines.join(" "))
    }
}

/// Where working vectors that need a buffer live.
enum Working {
    None,
    Scratch(Buffer<f32>),
    Heap { pool: Buffer<f32>, top: Buffer<i32>, size: u32 },
}

/// A frame's kernels with their arguments, ready to be cast.
pub struct Caster {
    queue: Queue,
    steps: Steps,
    image: Buffer<Float4>,
    working: Working,
    size: [u32; 2],
}

/// What all kernels of a frame are made from.
struct Parts<'a> {
    queue: &'a Queue,
    program: &'a BuiltProgram,
    strategy: &'a Strategy,
    workload: &'a Workload,
    scene: &'a DeviceScene,
    bias: f32,
    background: Float4,
    camera: CameraArguments,
    working: &'a Working,
    prepared: Option<&'a Buffer<f32>>,
    tree: Option<&'a DeviceTree>,
    band: Option<Band>,
}

impl Caster {
    /// Makes buffers and kernels for a frame of `workload.image_size`.
    pub fn new(
        queue: &Queue,
        program: &BuiltProgram,
        strategy: &Strategy,
        workload: &Workload,
        scene: &Scene,
        device_scene: &DeviceScene,
        tree: Option<&DeviceTree>,
    ) -> Result<Self, LaunchError> {
        Self::of_band(queue, program, strategy, workload, scene, device_scene, tree, None)
    }

    /// The same for some rows of work-groups only. Buffers are the whole frame's; what is prepared or rasterised
    /// before pixels are cast is so for all of it.
    #[allow(clippy::too_many_arguments, reason = "a frame needs them all")]
    pub fn of_band(
        queue: &Queue,
        program: &BuiltProgram,
        strategy: &Strategy,
        workload: &Workload,
        scene: &Scene,
        device_scene: &DeviceScene,
        tree: Option<&DeviceTree>,
        band: Option<Band>,
    ) -> Result<Self, LaunchError> {
        let size = workload.image_size;
        let pixels = size[0] as usize * size[1] as usize;
        let image = allocate::<Float4>(queue, pixels)?;
        let working = working(queue, strategy, workload)?;
        let prepared = prepared_planes(queue, strategy, device_scene)?;
        let [red, green, blue] = scene.background.to_array();
        let parts = Parts {
            queue,
            program,
            strategy,
            workload,
            scene: device_scene,
            bias: scene.shadow_bias,
            background: Float4::new(red, green, blue, 0.0),
            camera: camera(scene, size),
            working: &working,
            prepared: prepared.as_ref(),
            tree,
            band,
        };
        let mut steps = Steps::new();
        if let Some(prepared) = &prepared {
            steps.extend(parts.prepare_origins(prepared)?);
        }
        match strategy.passes {
            Passes::Fused => {
                steps.extend(parts.reset_heap(Phase::Whole));
                steps.push((Phase::Whole, Step::Run(parts.cast_frame(&image)?)));
            }
            Passes::Separate => {
                let nearest = allocate::<i32>(queue, workload.nearest_count(strategy))?;
                match strategy.traversal {
                    Traversal::Raster => steps.extend(parts.rasterise(&nearest, pixels)?),
                    _ => {
                        steps.extend(parts.reset_heap(Phase::Primary));
                        steps.push((Phase::Primary, Step::Run(parts.cast_primary(&nearest)?)));
                    }
                }
                steps.extend(parts.reset_heap(Phase::Shadow));
                if strategy.shares_tiles() {
                    let left_over = LeftOver::allocate(queue, pixels)?;
                    steps.extend(parts.shade_shared(&image, &nearest, &left_over)?);
                } else {
                    steps.push((Phase::Shadow, Step::Run(parts.shade_nearest(&image, &nearest)?)));
                }
            }
        }
        Ok(Self { queue: queue.clone(), steps, image, working, size })
    }

    /// Casts the frame once and waits for it.
    pub fn cast(&self) -> Result<FrameTimes, LaunchError> {
        self.cast_batch(1)
    }

    /// Casts the frame `frames` times, waits for the last, and gives the mean times of one.
    pub fn cast_batch(&self, frames: u32) -> Result<FrameTimes, LaunchError> {
        let start = Instant::now();
        let mut events = Vec::with_capacity(self.steps.len() * frames as usize);
        for _ in 0..frames {
            for (phase, step) in &self.steps {
                events.push((*phase, step.enqueue(&self.queue)?));
            }
        }
        self.queue.commands.finish()?;
        Ok(FrameTimes::of(&events, start.elapsed().as_secs_f64() * 1e3, frames)?)
    }

    /// The kernels of a frame, in their order.
    pub fn kernels(&self) -> impl Iterator<Item = &Kernel> {
        self.steps.iter().filter_map(|(_, step)| step.kernel())
    }

    /// Reads the image of the last frame, and how many of its pixels hit something.
    pub fn read(&self) -> Result<(Radiance, usize), LaunchError> {
        self.read_rows([0, self.size[1]])
    }

    /// Reads the image's rows from the first up to, without, the last; they may be none.
    pub fn read_rows(&self, [first, end]: [u32; 2]) -> Result<(Radiance, usize), LaunchError> {
        self.check_heap()?;
        let [width, height] = [self.size[0], end - first];
        let rows = width as usize * first as usize..width as usize * end as usize;
        let (pixels, hits) = read_with(&self.queue, &self.image, rows, |values| {
            let pixels = values.par_iter().map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
            (pixels, values.par_iter().filter(|pixel| pixel[3] > 0.0).count())
        })?;
        Ok((Radiance { width, height, pixels }, hits))
    }

    /// Fails where the last kernel took more from the heap than there was.
    fn check_heap(&self) -> Result<(), LaunchError> {
        let Working::Heap { top, size, .. } = &self.working else { return Ok(()) };
        let mut used = [0];
        top.read(&mut used[..]).enq()?;
        let (used, size) = (u64::from(used[0] as u32), u64::from(*size));
        if used > size { Err(LaunchError::HeapExhausted { used, size }) } else { Ok(()) }
    }
}

fn camera(scene: &Scene, size: [u32; 2]) -> CameraArguments {
    let frame = scene.camera.pixel_frame(size[0], size[1]);
    let float4 = |v: glam::DVec3, w: f64| Float4::new(v.x as f32, v.y as f32, v.z as f32, w as f32);
    CameraArguments {
        eye: float4(frame.eye, frame.z_near),
        corner: float4(frame.corner, 0.0),
        step_x: float4(frame.step_x, 0.0),
        step_y: float4(frame.step_y, 0.0),
        image_size: Int2::new(size[0] as i32, size[1] as i32),
    }
}

fn working(queue: &Queue, strategy: &Strategy, workload: &Workload) -> ocl::Result<Working> {
    let bytes = Requirements::of(strategy, workload).scratch_bytes as usize;
    Ok(match strategy.vectors {
        Vectors::Private | Vectors::Local => Working::None,
        Vectors::Global => Working::Scratch(allocate(queue, bytes / 4)?),
        Vectors::Heap => {
            let size = (bytes / 4 / strategy.width.rays()) as u32;
            Working::Heap { pool: allocate(queue, bytes / 4)?, top: allocate(queue, 1)?, size }
        }
    })
}

/// Room for each triangle's planes, for the eye and each light.
fn prepared_planes(
    queue: &Queue,
    strategy: &Strategy,
    scene: &DeviceScene,
) -> ocl::Result<Option<Buffer<f32>>> {
    if strategy.intersector != Intersector::CommonOrigin {
        return Ok(None);
    }
    allocate(queue, ROW_FLOATS * scene.triangle_count * (1 + scene.light_count)).map(Some)
}

impl<'a> Parts<'a> {
    /// A kernel of one work-item a block of pixels.
    fn pixel_kernel(
        &self,
        name: &'static str,
        finish: impl FnOnce(&mut KernelBuilder<'a>),
    ) -> Result<Kernel, LaunchError> {
        let mut kernel = self.kernel(name);
        let mut size = self.workload.global_size(self.strategy);
        if let Some(band) = &self.band {
            let items = self.workload.local_size[1] as usize;
            size[1] = band.len() * items;
            kernel.global_work_offset([0, band.start * items]);
        }
        kernel.global_work_size(size);
        kernel.local_work_size(self.workload.local_size.map(|n| n as usize));
        match self.tree {
            Some(DeviceTree { nodes, leaves, surfaces: Some(surfaces), .. }) => {
                self.light_arguments(&mut kernel);
                kernel.arg(nodes).arg(leaves).arg(&surfaces.normals).arg(&surfaces.materials);
                kernel.arg(surfaces.material_count as i32);
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

    fn kernel(&self, name: &'static str) -> KernelBuilder<'a> {
        let mut kernel = Kernel::builder();
        kernel.program(&self.program.program).name(name).queue(self.queue.commands.clone());
        // SAFETY: the argument lists follow cast.cl's parameters; `ocl` compares type names, and refuses
        // a buffer of i32 for the allocator's uint.
        unsafe { kernel.disable_arg_type_check() };
        kernel
    }

    fn cast_frame(&self, image: &'a Buffer<Float4>) -> Result<Kernel, LaunchError> {
        let name = if self.strategy.traversal == Traversal::Tile { "tile_frame" } else { "cast_frame" };
        self.pixel_kernel(name, |kernel| {
            kernel.arg(self.background).arg(image);
        })
    }

    /// Shades in tiles that groups share; then the shadow rays that were left over have a group each.
    fn shade_shared(
        &self,
        image: &'a Buffer<Float4>,
        nearest: &'a Buffer<i32>,
        left_over: &'a LeftOver,
    ) -> Result<Steps, LaunchError> {
        let shade = self.pixel_kernel("tile_shade", |kernel| {
            kernel.arg(self.background).arg(image).arg(nearest).arg(&left_over.rays).arg(&left_over.count);
        })?;
        let groups = left_over.global_size(self.queue, self.workload.local_size)?;
        let cast = self.pixel_kernel("tile_left_over", |kernel| {
            kernel.global_work_size(groups);
            kernel.arg(image).arg(nearest).arg(&left_over.rays).arg(&left_over.count);
        })?;
        let reset = Step::Fill(left_over.count.clone(), 0);
        Ok([reset, Step::Run(shade), Step::Run(cast)].map(|step| (Phase::Shadow, step)).into())
    }

    fn cast_primary(&self, nearest: &'a Buffer<i32>) -> Result<Kernel, LaunchError> {
        let name = if self.strategy.traversal == Traversal::Tile { "tile_primary" } else { "cast_primary" };
        self.pixel_kernel(name, |kernel| {
            kernel.arg(nearest);
        })
    }

    fn shade_nearest(
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
    fn reset_heap(&self, phase: Phase) -> Option<(Phase, Step)> {
        match self.working {
            Working::Heap { top, .. } => Some((phase, Step::Fill(top.clone(), 0))),
            _ => None,
        }
    }

    /// One work-item a triangle and origin; nothing where there are no triangles.
    fn prepare_origins(&self, prepared: &'a Buffer<f32>) -> ocl::Result<Option<(Phase, Step)>> {
        if self.scene.triangle_count == 0 {
            return Ok(None);
        }
        let mut kernel = self.kernel("prepare_origins");
        kernel.global_work_size([self.scene.triangle_count, 1 + self.scene.light_count]);
        geometry_arguments(&mut kernel, self.scene);
        kernel.arg(&self.scene.lights).arg(self.camera.eye).arg(prepared);
        let phase = if self.strategy.passes == Passes::Fused { Phase::Whole } else { Phase::Primary };
        Ok(Some((phase, Step::Run(kernel.build()?))))
    }

    /// Clears, resolves depth, then finds the triangle that has it.
    fn rasterise(&self, nearest: &Buffer<i32>, pixels: usize) -> ocl::Result<Steps> {
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
