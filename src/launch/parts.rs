//! The kernels of a frame with their arguments.

use super::arguments::Arguments;
use super::band::Band;
use super::buffers::allocate;
use super::frame::Phase;
use super::setup::{Setup, Working, sees_sky};
use super::steps::{Step, Steps};
use super::{LaunchError, Queue};
use crate::device::power_of_two;
use crate::manifest::{self, NO_HIT, Role};
use crate::program::BuiltProgram;
use crate::strategy::Strategy;
use ocl::builders::KernelBuilder;
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult};
use ocl::prm::Float4;
use ocl::{Buffer, Kernel};

/// Builds a kernel that works with work-groups of any size, with at least this many work-items across and down. The
/// kernel must ignore work-items beyond these numbers. The size of the groups is set explicitly, since OpenCL would
/// choose a divisor of the number of work-items, perhaps 1. A group is one row, since some devices allow only one
/// work-item per group in all dimensions but the first. It is shorter than usual if the compiled kernel supports only
/// fewer work-items.
pub(super) fn in_rows(
    queue: &Queue,
    kernel: &KernelBuilder<'_>,
    [across, down]: [usize; 2],
) -> Result<Kernel, LaunchError> {
    let mut kernel = kernel.build()?;
    let group = match kernel.wg_info(queue.device, KernelWorkGroupInfo::WorkGroupSize)? {
        KernelWorkGroupInfoResult::WorkGroupSize(most) => queue.group.min(power_of_two(most)),
        _ => queue.group,
    };
    kernel.set_default_global_work_size([across.next_multiple_of(group), down].into());
    kernel.set_default_local_work_size([group, 1].into());
    Ok(kernel)
}

/// The inputs of all kernels of a frame.
pub(super) struct Parts<'a> {
    pub setup: Setup<'a>,
    /// Arguments that depend on the scene, the camera, and the buffers of working vectors and planes.
    pub arguments: Arguments<'a>,
    pub working: &'a Working,
    pub prepared: Option<&'a Buffer<f32>>,
    pub band: Option<Band>,
}

impl<'a> Parts<'a> {
    /// Returns the program's kernel for a role.
    pub fn kernel_for(&self, role: Role) -> Result<&'static manifest::Kernel, LaunchError> {
        self.setup.kernel_for(role)
    }

    /// Returns a kernel with its arguments; its numbers of work-items are not yet set.
    pub fn builder(
        &self,
        kernel: &'static manifest::Kernel,
        arguments: &Arguments<'a>,
    ) -> Result<KernelBuilder<'a>, LaunchError> {
        let Setup { queue, program, strategy, .. } = self.setup;
        builder(queue, program, strategy, kernel, arguments)
    }

    /// Returns a kernel with one work-item per block of pixels, or with `items` work-items across and down.
    pub fn pixel_kernel(
        &self,
        kernel: &'static manifest::Kernel,
        arguments: &Arguments<'a>,
        items: Option<[usize; 2]>,
    ) -> Result<Kernel, LaunchError> {
        let mut builder = self.builder(kernel, arguments)?;
        if let Some(band) = &self.band {
            builder.global_work_offset([0, band.start * self.setup.workload.local_size[1] as usize]);
        }
        builder.global_work_size(items.unwrap_or_else(|| self.pixel_items()));
        builder.local_work_size(self.setup.workload.local_size.map(|n| n as usize));
        let built = builder.build()?;
        self.check_work_group(&built, kernel.name)?;
        Ok(built)
    }

    /// Returns the number of work-items, across and down, of a kernel with one work-item per block of pixels.
    pub fn pixel_items(&self) -> [usize; 2] {
        let [across, down] = self.setup.workload.global_size(self.setup.strategy);
        let rows = |band: &Band| band.len() * self.setup.workload.local_size[1] as usize;
        [across, self.band.as_ref().map_or(down, rows)]
    }

    /// Checks that the built kernel supports the local size.
    fn check_work_group(&self, kernel: &Kernel, name: &str) -> Result<(), LaunchError> {
        let items = self.setup.workload.local_size.iter().product::<u32>() as usize;
        match kernel.wg_info(self.setup.queue.device, KernelWorkGroupInfo::WorkGroupSize)? {
            KernelWorkGroupInfoResult::WorkGroupSize(most) if most < items => {
                Err(LaunchError::WorkGroup { kernel: name.to_owned(), most, items })
            }
            _ => Ok(()),
        }
    }

    /// Returns the steps of a frame that one kernel casts.
    pub fn cast_fused(&self, image: &'a Buffer<Float4>) -> Result<Steps, LaunchError> {
        let mut steps: Steps = self.prepare_origins(Phase::Whole)?.into_iter().collect();
        steps.extend(self.reset_heap(Phase::Whole));
        let arguments = self.arguments.clone().with("image", image);
        let kernel = self.pixel_kernel(self.kernel_for(Role::Frame)?, &arguments, None)?;
        steps.push((Phase::Whole, Step::Cast(kernel)));
        Ok(steps)
    }

    /// Returns the steps of a frame with separate passes: nearest hits first, then their shading.
    pub fn cast_separate(
        &self,
        image: &'a Buffer<Float4>,
        nearest: &'a Buffer<i32>,
    ) -> Result<Steps, LaunchError> {
        let arguments = self.arguments.clone().with("image", image);
        let arguments = arguments.with("nearest_triangle", nearest).with("nearest", nearest);
        let mut steps: Steps = self.prepare_origins(Phase::Primary)?.into_iter().collect();
        if self.setup.strategy.family().kernel(Role::Resolve).is_some() {
            steps.extend(self.rasterise(&arguments, nearest)?);
        } else {
            steps.extend(self.reset_heap(Phase::Primary));
            let kernel = self.pixel_kernel(self.kernel_for(Role::Primary)?, &arguments, None)?;
            steps.push((Phase::Primary, Step::Run(kernel)));
        }
        steps.extend(self.reset_heap(Phase::Shadow));
        let kernel = self.pixel_kernel(self.kernel_for(Role::Shade)?, &arguments, None)?;
        steps.push((Phase::Shadow, Step::Run(kernel)));
        Ok(steps)
    }

    /// Returns the step that shows the sky's picture behind everything; `None` if the sky has no picture, or the
    /// picture is not seen. The kernel processes the whole image even for a band, since it takes little time.
    pub fn show_sky(
        &self,
        image: &'a Buffer<Float4>,
        phase: Phase,
    ) -> Result<Option<(Phase, Step)>, LaunchError> {
        if !sees_sky(self.setup.scene) {
            return Ok(None);
        }
        let arguments = self.arguments.clone().with("image", image);
        let kernel = self.builder(self.kernel_for(Role::Background)?, &arguments)?;
        let [width, height] = self.setup.workload.image_size.map(|side| side as usize);
        let (across, down) = self.setup.strategy.block();
        let blocks = [width.div_ceil(across), height.div_ceil(down)];
        Ok(Some((phase, Step::Run(in_rows(self.setup.queue, &kernel, blocks)?))))
    }

    /// Returns the step that empties the heap before a kernel starts. The heap is the buffer from which a kernel
    /// allocates its working vectors (`vectors = heap`). Returns `None` if the strategy has no heap.
    fn reset_heap(&self, phase: Phase) -> Option<(Phase, Step)> {
        match self.working {
            Working::Heap { top, .. } => Some((phase, Step::Fill(top.clone(), 0))),
            _ => None,
        }
    }

    /// Returns the step that prepares planes, with one work-item per triangle and ray origin; `None` if the
    /// strategy uses no planes or there are no triangles.
    fn prepare_origins(&self, phase: Phase) -> Result<Option<(Phase, Step)>, LaunchError> {
        let uploaded = self.setup.uploaded;
        if self.prepared.is_none() || uploaded.triangle_count == 0 {
            return Ok(None);
        }
        let kernel = self.builder(self.kernel_for(Role::Prepare)?, &self.arguments)?;
        let items = [uploaded.triangle_count, 1 + uploaded.light_count];
        Ok(Some((phase, Step::Run(in_rows(self.setup.queue, &kernel, items)?))))
    }

    /// Returns the steps of a rasteriser: they clear the buffers, find the depth of each pixel, then the triangle
    /// at this depth.
    fn rasterise(&self, arguments: &Arguments<'a>, nearest: &Buffer<i32>) -> Result<Steps, LaunchError> {
        let [width, height] = self.setup.workload.image_size.map(|side| side as usize);
        let Setup { queue, program, strategy, .. } = self.setup;
        let depth = allocate::<i32>(queue, width * height)?;
        let mut steps = vec![
            (Phase::Primary, Step::Fill(depth.clone(), NO_HIT)),
            (Phase::Primary, Step::Fill(nearest.clone(), NO_HIT)),
        ];
        if self.setup.uploaded.triangle_count == 0 {
            return Ok(steps);
        }
        let arguments = arguments.clone().with("depth", &depth);
        for role in [Role::Primary, Role::Resolve] {
            let kernel = builder(queue, program, strategy, self.kernel_for(role)?, &arguments)?;
            let kernel = in_rows(queue, &kernel, [self.setup.uploaded.triangle_count, 1])?;
            steps.push((Phase::Primary, Step::Run(kernel)));
        }
        Ok(steps)
    }
}

/// Returns a kernel with its arguments; its numbers of work-items are not yet set.
pub(super) fn builder<'b>(
    queue: &Queue,
    program: &'b BuiltProgram,
    strategy: &Strategy,
    kernel: &'static manifest::Kernel,
    arguments: &Arguments<'b>,
) -> Result<KernelBuilder<'b>, LaunchError> {
    let mut builder = Kernel::builder();
    builder.program(&program.program).name(kernel.name).queue(queue.commands.clone());
    // SAFETY: `bind` compares each argument with its parameter in the manifest, from which the kernels'
    // parameter lists are generated. The check by `ocl` compares names of types, and would refuse a buffer of
    // words for a tree's floats.
    unsafe { builder.disable_arg_type_check() };
    arguments.bind(kernel, strategy, &mut builder)?;
    Ok(builder)
}
