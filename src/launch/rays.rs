//! Casting any rays, not only a camera's.

use super::buffers::{allocate, upload};
use super::parts::size_for_preparing;
use super::scene::DeviceScene;
use super::steps::geometry_arguments;
use super::{DeviceTree, LaunchError, Queue};
use crate::program::BuiltProgram;
use crate::strategy::{Intersector, Strategy, Vectors};
use glam::Vec3;
use ocl::prm::Float4;
use ocl::{Buffer, Kernel};

/// A ray that sees hits at `t > t_min` along a direction of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes; of unit length.
    pub direction: Vec3,
    /// Hits at or before it are not seen.
    pub t_min: f32,
}

/// The nearest triangle that each ray hits, with the kernels of a strategy at `local_size`.
///
/// With the common-origin intersector all rays must start at the first one's origin; pixel-linear casts a camera's rays
/// only. Working vectors must be private or local: their buffers are sized for images.
pub fn cast_rays(
    queue: &Queue,
    program: &BuiltProgram,
    strategy: &Strategy,
    local_size: [u32; 2],
    scene: &DeviceScene,
    tree: Option<&DeviceTree>,
    rays: &[Ray],
) -> Result<Vec<Option<u32>>, LaunchError> {
    if !matches!(strategy.vectors, Vectors::Private | Vectors::Local) {
        return Err(LaunchError::OpenCl("rays are cast with private or local working vectors".to_owned()));
    }
    if strategy.intersector == Intersector::PixelLinear {
        return Err(LaunchError::OpenCl("pixel-linear planes are for a camera's rays".to_owned()));
    }
    let Some(first) = rays.first() else { return Ok(Vec::new()) };
    let packed: Vec<Float4> = rays.iter().flat_map(pack).collect();
    let packed = upload(queue, &packed)?;
    let nearest = allocate::<i32>(queue, rays.len())?;
    let prepared = prepare(queue, program, strategy, scene, first.origin)?;

    let items = rays.len().div_ceil(strategy.width.rays());
    let mut kernel = Kernel::builder();
    kernel.program(&program.program).name("cast_rays").queue(queue.commands.clone());
    // SAFETY: as in Caster: a tree's nodes are words of both kinds, which `ocl` takes for a mistake.
    unsafe { kernel.disable_arg_type_check() };
    let [across, down] = local_size.map(|n| n as usize);
    kernel.global_work_size([items.next_multiple_of(across), down]).local_work_size([across, down]);
    geometry_arguments(&mut kernel, scene);
    kernel.arg(&scene.lights).arg(scene.light_count as i32).arg(0.0_f32);
    if let Some(prepared) = &prepared {
        kernel.arg(prepared);
    }
    if let Some(tree) = tree {
        kernel.arg(&tree.nodes).arg(&tree.leaves);
    }
    kernel.arg(&packed).arg(rays.len() as i32).arg(&nearest);
    let kernel = kernel.build()?;
    // SAFETY: the arguments follow cast_rays' parameters; the kernel reads and writes no ray past their count.
    unsafe { kernel.cmd().queue(&queue.commands).enq()? };
    let mut triangles = vec![0; rays.len()];
    nearest.read(&mut triangles).enq()?;
    Ok(triangles.into_iter().map(|id| u32::try_from(id).ok().filter(|_| id != super::NO_HIT)).collect())
}

fn pack(ray: &Ray) -> [Float4; 2] {
    let (from, to) = (ray.origin, ray.direction);
    [Float4::new(from.x, from.y, from.z, ray.t_min), Float4::new(to.x, to.y, to.z, 0.0)]
}

/// The planes of every triangle for the rays' origin, where the intersector wants them.
fn prepare(
    queue: &Queue,
    program: &BuiltProgram,
    strategy: &Strategy,
    scene: &DeviceScene,
    origin: Vec3,
) -> Result<Option<Buffer<f32>>, LaunchError> {
    if !strategy.intersector.prepares_planes() || scene.triangle_count == 0 {
        return Ok(None);
    }
    let prepared = allocate::<f32>(queue, super::ROW_FLOATS * scene.triangle_count)?;
    let mut kernel = Kernel::builder();
    kernel.program(&program.program).name("prepare_origins").queue(queue.commands.clone());
    size_for_preparing(&mut kernel, scene.triangle_count, 1);
    geometry_arguments(&mut kernel, scene);
    kernel.arg(&scene.lights).arg(Float4::new(origin.x, origin.y, origin.z, 0.0));
    let camera = Float4::new(0.0, 0.0, 0.0, 0.0); // which has no part in it
    kernel.arg(camera).arg(camera).arg(camera).arg(&prepared);
    let kernel = kernel.build()?;
    // SAFETY: as above; one row of `prepared` for each triangle.
    unsafe { kernel.cmd().queue(&queue.commands).enq()? };
    Ok(Some(prepared))
}
