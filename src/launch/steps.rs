//! The commands a frame consists of.

use super::Queue;
use super::frame::Phase;
use ocl::builders::KernelBuilder;
use ocl::prm::{Float4, Int2};
use ocl::{Buffer, Event, Kernel};

use super::scene::{DeviceScene, Geometry};

/// One command of a frame.
pub(super) enum Step {
    /// Sets every value of a buffer.
    Fill(Buffer<i32>, i32),
    /// Runs a kernel.
    Run(Kernel),
}

impl Step {
    /// The kernel it runs.
    pub fn kernel(&self) -> Option<&Kernel> {
        match self {
            Self::Fill(..) => None,
            Self::Run(kernel) => Some(kernel),
        }
    }

    /// Puts the command into the queue.
    pub fn enqueue(&self, queue: &Queue) -> ocl::Result<Event> {
        let mut event = Event::empty();
        match self {
            Self::Fill(buffer, value) => {
                buffer.cmd().queue(&queue.commands).fill(*value, None).enew(&mut event).enq()?;
            }
            Self::Run(kernel) => {
                // SAFETY: the kernel was built with every argument its source declares, each buffer as long
                // as the sizes passed beside it, and all of them outlive the queue's `finish` in `cast`.
                unsafe { kernel.cmd().queue(&queue.commands).enew(&mut event).enq()? };
            }
        }
        Ok(event)
    }
}

/// A frame's commands in order, and what each is for.
pub(super) type Steps = Vec<(Phase, Step)>;

/// The camera as the kernels take it.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraArguments {
    pub eye: Float4,
    pub corner: Float4,
    pub step_x: Float4,
    pub step_y: Float4,
    pub image_size: Int2,
}

/// Adds the parameters of a layout: GEOMETRY_PARAMETERS in the kernels.
pub(super) fn geometry_arguments<'b>(kernel: &mut KernelBuilder<'b>, scene: &'b DeviceScene) {
    match &scene.geometry {
        Geometry::Soup(soup) => {
            kernel.arg(soup);
        }
        Geometry::Indexed16(sets) => sets.arguments(kernel),
        Geometry::Indexed32(sets) => sets.arguments(kernel),
    }
    kernel.arg(scene.triangle_count as i32);
}

impl<I: ocl::OclPrm> super::scene::Sets<I> {
    fn arguments<'b>(&'b self, kernel: &mut KernelBuilder<'b>) {
        kernel
            .arg(&self.positions)
            .arg(&self.normals)
            .arg(&self.position_indices)
            .arg(&self.normal_indices)
            .arg(&self.material_indices)
            .arg(&self.materials);
    }
}

/// Adds CAMERA_PARAMETERS and the image's size.
pub(super) fn camera_arguments(kernel: &mut KernelBuilder<'_>, camera: &CameraArguments) {
    ray_arguments(kernel, camera);
    kernel.arg(camera.image_size);
}

/// Adds CAMERA_PARAMETERS.
pub(super) fn ray_arguments(kernel: &mut KernelBuilder<'_>, camera: &CameraArguments) {
    kernel.arg(camera.eye).arg(camera.corner).arg(camera.step_x).arg(camera.step_y);
}
