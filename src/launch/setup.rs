//! The inputs of a frame, and the kernel arguments derived from them.

use super::arguments::Arguments;
use super::scene::Geometry;
use super::{DeviceScene, DeviceTree, LaunchError, Queue};
use crate::device::{LaneOperations, power_of_two};
use crate::manifest::{self, Role};
use crate::program::BuiltProgram;
use crate::scene::{Camera, Sample, SampleLight, Scene};
use crate::strategy::{FOLDERS, Strategy, Workload};
use glam::Vec3;
use ocl::builders::KernelBuilder;
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult};
use ocl::prm::{Float4, Int2, Uint2};
use ocl::{Buffer, Kernel};
use std::path::Path;
use std::sync::Arc;

/// The inputs from which a frame's kernels and their arguments are made.
#[derive(Clone, Copy)]
pub(super) struct Setup<'a> {
    /// The open device on which the frame is cast.
    pub queue: &'a Queue,
    pub program: &'a BuiltProgram,
    pub strategy: &'a Strategy,
    /// The sizes and features of the scene, the image and the work-groups.
    pub workload: &'a Workload,
    pub scene: &'a Scene,
    /// The scene's buffers on the device.
    pub uploaded: &'a DeviceScene,
    /// The scene's tree on the device, if the strategy uses a tree.
    pub tree: Option<&'a Arc<DeviceTree>>,
    /// How work-items that share a tile exchange values.
    pub lanes: LaneOperations,
    /// The paths of the program's kernel files that the user added or changed.
    pub own_files: &'a [String],
}

impl<'a> Setup<'a> {
    /// Returns the program's kernel for a role (some work, such as shading). A program contains only the
    /// kernels that its strategy and workload need. Returns [`LaunchError::Kernel`] if the program lacks this
    /// kernel.
    pub fn kernel_for(&self, role: Role) -> Result<&'static manifest::Kernel, LaunchError> {
        let family = self.strategy.family();
        let kernel = family.kernel(role).filter(|kernel| self.strategy.holds_of(kernel.when, self.workload));
        kernel.ok_or_else(|| LaunchError::Kernel { family: family.name, work: role.work() })
    }

    /// Returns the paths of the user's files whose headers state how much `__local` memory the kernels need.
    pub fn files_that_state_local_memory(&self) -> Vec<String> {
        self.own_files.iter().filter(|path| states_local_memory(path)).cloned().collect()
    }

    /// Returns the builder of a kernel with its arguments. The numbers of work-items are not set yet.
    pub fn builder(
        &self,
        kernel: &'static manifest::Kernel,
        arguments: &Arguments<'a>,
    ) -> Result<KernelBuilder<'a>, LaunchError> {
        let mut builder = Kernel::builder();
        builder.program(&self.program.program).name(kernel.name).queue(self.queue.commands.clone());
        // SAFETY: `bind` compares each argument with its parameter in the manifest, from which the kernels'
        // parameter lists are generated. `ocl`'s own check compares the names of types, and would refuse the
        // buffer of `u32` for the nodes of a tree, which kernels read as floats.
        unsafe { builder.disable_arg_type_check() };
        arguments.bind(kernel, |fact| self.strategy.holds_of(fact, self.workload), &mut builder)?;
        Ok(builder)
    }

    /// Makes the kernel that `builder` describes.
    pub fn build(
        &self,
        kernel: &'static manifest::Kernel,
        builder: &KernelBuilder<'a>,
    ) -> Result<Kernel, LaunchError> {
        builder.build().map_err(|error| LaunchError::of_kernel(kernel.name, self.own_files, error))
    }

    /// Returns a kernel with its arguments and with at least `across` x `down` work-items. The kernel must
    /// support work-groups of any size, and must ignore work-items beyond `across` and `down`. The function
    /// sets the size of the work-groups itself, because OpenCL would choose a divisor of the number of
    /// work-items, perhaps 1. A work-group is N x 1 work-items, because on some devices a work-group can have
    /// several work-items only in the first dimension. N is `self.queue.group`, or less if the compiled
    /// kernel does not support so many.
    pub fn row_kernel(
        &self,
        kernel: &'static manifest::Kernel,
        arguments: &Arguments<'a>,
        [across, down]: [usize; 2],
    ) -> Result<Kernel, LaunchError> {
        let queue = self.queue;
        let mut kernel = self.build(kernel, &self.builder(kernel, arguments)?)?;
        let group = match kernel.wg_info(queue.device, KernelWorkGroupInfo::WorkGroupSize)? {
            KernelWorkGroupInfoResult::WorkGroupSize(most) => queue.group.min(power_of_two(most)),
            _ => queue.group,
        };
        kernel.set_default_global_work_size([across.next_multiple_of(group), down].into());
        kernel.set_default_local_work_size([group, 1].into());
        Ok(kernel)
    }

    /// Returns the arguments that depend on the scene, the camera and the image size.
    pub fn arguments(&self) -> Arguments<'a> {
        let [width, height] = self.workload.image_size;
        let arguments = scene_arguments(self.uploaded, self.tree);
        let arguments = soft_arguments(arguments, self.uploaded, self.workload);
        let arguments = background_arguments(arguments, self.scene);
        camera_arguments(arguments, &self.scene.camera, [width, height])
            .with("image_size", Int2::new(width as i32, height as i32))
    }
}

/// Returns true if `path` is that of a kernel file for a value of the strategy's axis `vectors` or
/// `triangles`. The headers of these files state how much `__local` memory the kernels need.
fn states_local_memory(path: &str) -> bool {
    let is_in = |folder: &str| Path::new(path).parent().is_some_and(|parent| parent.ends_with(folder));
    FOLDERS.iter().any(|(folder, axis)| matches!(*axis, "vectors" | "triangles") && is_in(folder))
}

/// The buffers for a frame's working vectors.
pub(super) enum Working {
    /// The working vectors are in private or `__local` memory, so they need no buffer.
    None,
    /// A buffer in which each work-item has a fixed range for its working vectors.
    Scratch(Buffer<f32>),
    /// A pool from which work-items allocate their working vectors, and a counter of the varyings that they
    /// have allocated. `size` is the number of varyings in the pool (a varying has one float for each ray of
    /// a work-item).
    Heap { pool: Buffer<f32>, top: Buffer<i32>, size: u32 },
}

impl Working {
    /// Adds the buffers of the working vectors to `arguments`.
    pub fn add_to<'a>(&'a self, arguments: Arguments<'a>) -> Arguments<'a> {
        match self {
            Self::None => arguments,
            Self::Scratch(scratch) => arguments.with("scratch", scratch),
            Self::Heap { pool, top, size } => {
                arguments.with("heap", pool).with("heap_top", top).with("heap_size", *size)
            }
        }
    }
}

/// Returns kernel arguments: the scene's buffers, and the numbers of its triangles and lights.
pub(super) fn scene_arguments<'a>(
    scene: &'a DeviceScene,
    tree: Option<&'a Arc<DeviceTree>>,
) -> Arguments<'a> {
    let triangles = scene.triangle_count as i32;
    let arguments = match &scene.geometry {
        Geometry::Soup(soup) => Arguments::default().with("soup", soup),
        Geometry::Indexed16(sets) => sets.arguments(|indices| indices.into()),
        Geometry::Indexed32(sets) => sets.arguments(|indices| indices.into()),
    };
    let arguments = arguments
        .with("triangle_count", triangles)
        .with("prepared_row", triangles)
        .with("lights", &scene.lights)
        .with("light_count", scene.light_count as i32);
    let arguments = match &scene.textures {
        Some(textures) => textures.add_to(arguments),
        None => arguments,
    };
    let arguments = match &scene.corner_colours {
        Some(colours) => arguments.with("corner_colours", colours),
        None => arguments,
    };
    let Some(tree) = tree else { return arguments };
    let arguments = arguments.with("nodes", &tree.nodes).with("leaves", &tree.leaves);
    let Some(surfaces) = &tree.surfaces else { return arguments };
    surfaces.add_to(arguments)
}

/// If the workload has soft light, adds its arguments to `arguments`: the buffer with the sky and the lights'
/// radii, and the arguments for one sample per pixel.
pub(super) fn soft_arguments<'a>(
    arguments: Arguments<'a>,
    scene: &'a DeviceScene,
    workload: &Workload,
) -> Arguments<'a> {
    if !workload.is_soft() {
        return arguments;
    }
    sample_argument(arguments.with("soft", &scene.soft), &Sample::CENTRE)
}

/// Adds three numbers to `arguments`: how many samples of each pixel were cast before this sample, the
/// sample's number in its round (a round consists of the first samples of a pixel, or of the later ones), and
/// the number of samples in the round. If the third number is 0, kernels compute unoccluded light.
pub(super) fn sample_argument<'a>(arguments: Arguments<'a>, sample: &Sample) -> Arguments<'a> {
    let arguments = arguments.with("earlier", sample.earlier);
    let count = if sample.light == SampleLight::Unoccluded { 0 } else { sample.count };
    arguments.with("sample", Uint2::new(sample.number, count))
}

/// Returns true if rays that hit nothing see a picture of the sky.
pub(super) fn sees_sky(scene: &Scene) -> bool {
    let picture = scene.sky.as_ref().and_then(|sky| sky.picture.as_ref());
    picture.is_some_and(|picture| picture.is_seen)
}

/// Adds the shadow bias (the gap between a hit and the near end of its shadow rays) and the background to
/// `arguments`.
pub(super) fn background_arguments<'a>(arguments: Arguments<'a>, scene: &Scene) -> Arguments<'a> {
    // If rays see a picture of the sky, the background is black, and a later kernel adds the picture.
    let background = if sees_sky(scene) { Vec3::ZERO } else { scene.background };
    let [red, green, blue] = background.to_array();
    arguments.with("bias", scene.shadow_bias).with("background", Float4::new(red, green, blue, 0.0))
}

/// Adds the origin and the directions of the camera's rays, and the pixels' ray cones, to `arguments`.
pub(super) fn camera_arguments<'a>(
    arguments: Arguments<'a>,
    camera: &Camera,
    size: [u32; 2],
) -> Arguments<'a> {
    let frame = camera.pixel_frame(size[0], size[1]);
    let float4 = |v: glam::DVec3, w: f64| Float4::new(v.x as f32, v.y as f32, v.z as f32, w as f32);
    arguments
        .with("eye", float4(frame.eye, frame.z_near))
        .with("corner", float4(frame.corner, 0.0))
        .with("step_x", float4(frame.step_x, 0.0))
        .with("step_y", float4(frame.step_y, 0.0))
        .with("cone", float4(frame.cone, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::PRESETS;

    /// The program of the whole picture also casts the half pictures, so its kernels' parameters must not depend
    /// on whether a picture is a half picture.
    #[test]
    fn a_kernel_has_the_same_parameters_for_half_pictures() {
        let whole =
            Workload { sky: true, sky_texels: 1, many_samples: true, half_light: true, ..Workload::CUBE };
        for strategy in PRESETS.iter().map(|preset| preset.strategy) {
            for kernel in strategy.family().kernels {
                let list =
                    |workload: &Workload| kernel.parameter_macro(|fact| strategy.holds_of(fact, workload));
                assert_eq!(list(&whole), list(&whole.halved()), "{strategy}");
            }
        }
    }

    #[test]
    fn files_of_vectors_and_triangles_state_the_local_memory() {
        for (file, expected) in [
            ("mine/cast/vectors/local.cl", true),
            ("mine/cast/triangles/local.cl", true),
            ("mine/cast/layout/soup.cl", false),
            ("mine/cast/entry.cl", false),
        ] {
            assert_eq!(states_local_memory(file), expected, "{file}");
        }
    }
}
