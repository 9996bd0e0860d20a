//! Everything one point needs to cast a frame again and again.

use super::band::Band;
use super::buffers::{allocate, read_with};
use super::frame::{FrameTimes, Phase};
use super::parts::{Parts, Working};
use super::scene::DeviceScene;
use super::shared::Shared;
use super::steps::{CameraArguments, Step, Steps};
use super::tree::DeviceTree;
use super::{LaunchError, Queue, ROW_FLOATS};
use crate::image::Radiance;
use crate::program::BuiltProgram;
use crate::scene::Scene;
use crate::strategy::{Passes, Requirements, Strategy, Traversal, Vectors, Workload};
use ocl::prm::{Float4, Int2};
use ocl::{Buffer, Kernel};
use rayon::prelude::*;
use std::time::Instant;

/// A frame's kernels with their arguments, ready to be cast.
pub struct Caster {
    queue: Queue,
    steps: Steps,
    image: Buffer<Float4>,
    working: Working,
    size: [u32; 2],
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
        let prepared = prepared_planes(queue, strategy, workload)?;
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
        if let (Some(prepared), false) = (&prepared, strategy.shares_tiles()) {
            steps.extend(parts.prepare_origins(prepared)?);
        }
        match strategy.passes {
            _ if strategy.shares_tiles() => {
                let nearest = allocate::<i32>(queue, pixels)?;
                let shared = Shared::allocate(queue, pixels)?;
                steps.extend(parts.cast_shared(&image, &nearest, &shared)?);
            }
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
                steps.push((Phase::Shadow, Step::Run(parts.shade_nearest(&image, &nearest)?)));
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

/// Room for each triangle's planes, for the eye and each light, or those of a round.
fn prepared_planes(
    queue: &Queue,
    strategy: &Strategy,
    workload: &Workload,
) -> ocl::Result<Option<Buffer<f32>>> {
    let rows = workload.prepared_origins(strategy) * workload.triangles;
    strategy.intersector.prepares_planes().then(|| allocate(queue, ROW_FLOATS * rows)).transpose()
}
