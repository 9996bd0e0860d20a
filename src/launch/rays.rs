//! Casts arbitrary rays, not only a camera's.

use super::buffers::{allocate, upload};
use super::records::Records;
use super::setup::{Setup, scene_arguments, soft_arguments};
use super::{LaunchError, Prepared};
use crate::manifest::{self, NO_HIT, ROW_FLOATS, Role};
use crate::strategy::WorkingMemory;
use glam::Vec3;
use ocl::Buffer;
use ocl::prm::Float4;

/// A ray that finds hits at `t > t_min` along a direction of length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// The point at which the ray starts.
    pub origin: Vec3,
    /// The ray's direction, a vector of length 1.
    pub direction: Vec3,
    /// Hits at the distance `t_min` or nearer are ignored.
    pub t_min: f32,
}

impl Prepared {
    /// Returns, for each ray, the index of the nearest triangle that the ray hits; `None` if the ray hits
    /// nothing.
    ///
    /// With the common-origin test, all rays must have the same origin. The pixel-linear test is refused,
    /// since it supports only a camera's rays. Working vectors must be in private or local memory, since the
    /// buffers for working vectors in other memories have sizes that suit only images. The strategy must have
    /// been prepared by [`Session::prepare_for_rays`](super::Session::prepare_for_rays), since other programs
    /// lack the kernel for arbitrary rays.
    pub fn cast_rays(&self, rays: &[Ray]) -> Result<Vec<Option<u32>>, LaunchError> {
        let setup = self.setup(&self.workload);
        let Setup { queue, strategy, uploaded, .. } = setup;
        let kernel = kernel_for_rays(&setup)?;
        let Some(first) = rays.first() else { return Ok(Vec::new()) };
        let packed: Vec<Float4> = rays.iter().flat_map(pack).collect();
        let packed = upload(queue, &packed)?;
        let nearest = allocate::<i32>(queue, rays.len())?;
        let prepared = prepare(&setup, first.origin)?;
        let records = Records::prepare(&setup)?;
        let arguments = scene_arguments(uploaded, setup.tree);
        let arguments = soft_arguments(arguments, uploaded, setup.workload)
            .with("bias", 0.0_f32)
            .with("cone", Float4::zero()) // hits are not shaded
            .with("rays", &packed)
            .with("ray_count", rays.len() as i32)
            .with("nearest_triangle", &nearest)
            .with_any("prepared", prepared.as_ref())
            .with_any("records", records.as_ref().map(|records| &records.buffer));
        let mut builder = setup.builder(kernel, &arguments)?;
        let items = rays.len().div_ceil(strategy.width.rays());
        let [across, down] = self.workload.local_size.map(|n| n as usize);
        builder.global_work_size([items.next_multiple_of(across), down]).local_work_size([across, down]);
        let kernel = setup.build(kernel, &builder)?;
        // SAFETY: the kernel's arguments were checked; the kernel accesses no ray beyond `ray_count`.
        unsafe { kernel.cmd().queue(&queue.commands).enq()? };
        let mut triangles = vec![0; rays.len()];
        nearest.read(&mut triangles).enq()?;
        Ok(triangles.into_iter().map(|id| u32::try_from(id).ok().filter(|_| id != NO_HIT)).collect())
    }
}

/// Returns the kernel that casts arbitrary rays. Returns an error if the strategy does not support arbitrary
/// rays. The function also returns an error if the program lacks the kernel, because the strategy was not
/// prepared for arbitrary rays.
fn kernel_for_rays(setup: &Setup<'_>) -> Result<&'static manifest::Kernel, LaunchError> {
    if !matches!(setup.strategy.vectors.memory(), WorkingMemory::Private | WorkingMemory::Local) {
        return Err(LaunchError::GivenRays(
            "arbitrary rays can be cast only with private or local working vectors",
        ));
    }
    if setup.strategy.intersector.counts_in_pixels() {
        return Err(LaunchError::GivenRays(
            "ray-triangle tests whose planes are functions of a pixel's position can be used only with \
             rays of a camera",
        ));
    }
    setup.kernel_for(Role::Rays)
}

fn pack(ray: &Ray) -> [Float4; 2] {
    let (from, to) = (ray.origin, ray.direction);
    [Float4::new(from.x, from.y, from.z, ray.t_min), Float4::new(to.x, to.y, to.z, 0.0)]
}

/// Prepares each triangle's planes for the rays' common origin. Returns `None` if the ray-triangle test needs no
/// planes, or if there are no triangles.
fn prepare(setup: &Setup<'_>, origin: Vec3) -> Result<Option<Buffer<f32>>, LaunchError> {
    let Setup { queue, strategy, uploaded, .. } = *setup;
    let Some(kernel) = strategy.family().kernel(Role::Prepare) else { return Ok(None) };
    if !strategy.holds(kernel.when) || uploaded.triangle_count == 0 {
        return Ok(None);
    }
    let prepared = allocate::<f32>(queue, ROW_FLOATS * uploaded.triangle_count)?;
    let camera = Float4::new(0.0, 0.0, 0.0, 0.0); // unused: the planes do not depend on pixels
    let arguments = scene_arguments(uploaded, None)
        .with("eye", Float4::new(origin.x, origin.y, origin.z, 0.0))
        .with("corner", camera)
        .with("step_x", camera)
        .with("step_y", camera)
        .with("prepared", &prepared);
    let kernel = setup.row_kernel(kernel, &arguments, [uploaded.triangle_count, 1])?;
    // SAFETY: the kernel's arguments were checked; `prepared` has one row per triangle.
    unsafe { kernel.cmd().queue(&queue.commands).enq()? };
    Ok(Some(prepared))
}
