//! The kernels of a frame with their arguments.

use super::LaunchError;
use super::arguments::Arguments;
use super::band::Band;
use super::buffers::allocate;
use super::frame::Pass;
use super::setup::{Setup, Working, sees_sky};
use super::steps::{Step, Steps};
use crate::device::{LaneOperations, sub_group_size};
use crate::manifest::{self, GROUP_LANES, NO_HIT, Role};
use crate::strategy::Requirements;
use ocl::enums::{KernelWorkGroupInfo, KernelWorkGroupInfoResult};
use ocl::prm::Float4;
use ocl::{Buffer, Kernel};

/// A driver may report up to this many bytes of `__local` memory more than a kernel's arrays have, since the
/// driver aligns arrays. NVIDIA's driver 580 reports up to 16 B more than the arrays have.
const PADDING_BYTES: u64 = 128;

/// The inputs from which all kernels of a frame are made.
pub(super) struct Parts<'a> {
    pub setup: Setup<'a>,
    /// Arguments for the scene, the camera and the frame's buffers, such as those of working vectors, planes, records
    /// and samples.
    pub arguments: Arguments<'a>,
    pub working: &'a Working,
    pub prepared: Option<&'a Buffer<f32>>,
    pub band: Option<Band>,
}

impl<'a> Parts<'a> {
    /// Returns a kernel with `items` work-items across and down. If `items` is `None`, the kernel gets as many
    /// work-items as the frame's pixels need ([`Self::pixel_items`]). Returns an error if the kernel does not support
    /// the local size, has sub-groups of a wrong size, or uses more `__local` memory than the headers of the user's kernel
    /// files state.
    pub fn pixel_kernel(
        &self,
        kernel: &'static manifest::Kernel,
        arguments: &Arguments<'a>,
        items: Option<[usize; 2]>,
    ) -> Result<Kernel, LaunchError> {
        let mut builder = self.setup.builder(kernel, arguments)?;
        if let Some(band) = &self.band {
            builder.global_work_offset([0, band.start * self.setup.workload.local_size[1] as usize]);
        }
        builder.global_work_size(items.unwrap_or_else(|| self.pixel_items()));
        builder.local_work_size(self.setup.workload.local_size.map(|n| n as usize));
        let built = self.setup.build(kernel, &builder)?;
        self.check_work_group(&built, kernel.name)?;
        self.check_sub_groups(&built, kernel.name)?;
        self.check_local_memory(&built, kernel.name)?;
        Ok(built)
    }

    /// Returns the number of work-items, across and down, that the pixels of the frame or band need. Each work-item
    /// casts the rays of one block of pixels ([`Strategy::block`](crate::strategy::Strategy::block)) or of one tile. If
    /// work-items share tiles, each tile needs 32 work-items.
    pub fn pixel_items(&self) -> [usize; 2] {
        let [across, down] = self.setup.workload.global_size(self.setup.strategy);
        let rows = |band: &Band| band.len() * self.setup.workload.local_size[1] as usize;
        [across, self.band.as_ref().map_or(down, rows)]
    }

    /// Returns [`LaunchError::WorkGroup`] if the local size has more work-items than the built kernel
    /// supports.
    fn check_work_group(&self, kernel: &Kernel, name: &str) -> Result<(), LaunchError> {
        let items = self.setup.workload.local_size.iter().product::<u32>() as usize;
        match kernel.wg_info(self.setup.queue.device, KernelWorkGroupInfo::WorkGroupSize)? {
            KernelWorkGroupInfoResult::WorkGroupSize(most) if most < items => {
                Err(LaunchError::WorkGroup { kernel: name.to_owned(), most, items })
            }
            _ => Ok(()),
        }
    }

    /// Returns [`LaunchError::SubGroups`] if work-items exchange values by sub-groups, and the sub-groups of the
    /// kernel have another size than a tile needs. The test of lane operations shows only that the sub-groups of its
    /// own kernel have the right size: a driver may choose another size for each kernel.
    fn check_sub_groups(&self, kernel: &Kernel, name: &str) -> Result<(), LaunchError> {
        let Setup { queue, workload, lanes, .. } = self.setup;
        if lanes != LaneOperations::SubGroups {
            return Ok(());
        }
        let local_size = workload.local_size.map(|n| n as usize);
        sub_groups_suit(name, sub_group_size(queue.device, kernel, local_size))
    }

    /// Returns [`LaunchError::OwnHeader`] if the kernel uses more `__local` memory than the headers of the
    /// user's files state. From the headers, raycl computes whether the kernel fits on the device; some
    /// drivers crash if a kernel does not fit.
    fn check_local_memory(&self, kernel: &Kernel, name: &str) -> Result<(), LaunchError> {
        let Setup { queue, strategy, workload, .. } = self.setup;
        let files = self.setup.files_that_state_local_memory();
        if files.is_empty() {
            return Ok(());
        }
        let stated = Requirements::of(strategy, workload, LaneOperations::Barriers).local_bytes;
        match kernel.wg_info(queue.device, KernelWorkGroupInfo::LocalMemSize) {
            Ok(KernelWorkGroupInfoResult::LocalMemSize(used))
                if used > stated.saturating_add(PADDING_BYTES) =>
            {
                Err(LaunchError::of_local_memory(name, [used, stated], &files))
            }
            _ => Ok(()),
        }
    }

    /// Returns the steps of a frame in which one kernel casts all rays and shades. Before this kernel, steps prepare
    /// planes and empty the heap, if the strategy needs planes or a heap.
    pub fn cast_fused(&self, image: &'a Buffer<Float4>) -> Result<Steps, LaunchError> {
        let mut steps: Steps = self.prepare_origins(Pass::Whole)?.into_iter().collect();
        steps.extend(self.reset_heap(Pass::Whole));
        let arguments = self.arguments.clone().with("image", image);
        let kernel = self.pixel_kernel(self.setup.kernel_for(Role::Frame)?, &arguments, None)?;
        steps.push((Pass::Whole, Step::Cast(kernel)));
        Ok(steps)
    }

    /// Returns the steps of a frame with separate passes: the first pass finds the nearest hits, the second pass casts
    /// shadow rays and shades. If the strategy needs planes, the first step prepares the planes. If the strategy has a
    /// heap, a step empties the heap before each kernel that casts rays.
    pub fn cast_separate(
        &self,
        image: &'a Buffer<Float4>,
        nearest: &'a Buffer<i32>,
    ) -> Result<Steps, LaunchError> {
        let arguments = self.arguments.clone().with("image", image);
        let arguments = arguments.with("nearest_triangle", nearest).with("nearest", nearest);
        let mut steps: Steps = self.prepare_origins(Pass::Primary)?.into_iter().collect();
        if self.setup.strategy.family().kernel(Role::Resolve).is_some() {
            steps.extend(self.rasterise(&arguments, nearest)?);
        } else {
            steps.extend(self.reset_heap(Pass::Primary));
            let kernel = self.pixel_kernel(self.setup.kernel_for(Role::Primary)?, &arguments, None)?;
            steps.push((Pass::Primary, Step::Run(kernel)));
        }
        steps.extend(self.reset_heap(Pass::Shadow));
        let kernel = self.pixel_kernel(self.setup.kernel_for(Role::Shade)?, &arguments, None)?;
        steps.push((Pass::Shadow, Step::Run(kernel)));
        Ok(steps)
    }

    /// Returns the step that shows the sky's picture behind everything; `None` if the sky has no picture, or if rays
    /// that hit nothing see the background instead of the picture. The kernel takes little time, so it processes the
    /// whole image even if the frame's other kernels cast only a band (some of the rows).
    pub fn show_sky(
        &self,
        image: &'a Buffer<Float4>,
        pass: Pass,
    ) -> Result<Option<(Pass, Step)>, LaunchError> {
        if !sees_sky(self.setup.scene) {
            return Ok(None);
        }
        let arguments = self.arguments.clone().with("image", image);
        let [width, height] = self.setup.workload.image_size.map(|side| side as usize);
        let (across, down) = self.setup.strategy.block();
        let blocks = [width.div_ceil(across), height.div_ceil(down)];
        let kernel = self.setup.row_kernel(self.setup.kernel_for(Role::Background)?, &arguments, blocks)?;
        Ok(Some((pass, Step::Run(kernel))))
    }

    /// Returns the step that empties the heap before a kernel starts. The heap is the buffer from which a kernel
    /// allocates its working vectors (`vectors = heap`). Returns `None` if the strategy has no heap.
    fn reset_heap(&self, pass: Pass) -> Option<(Pass, Step)> {
        match self.working {
            Working::Heap { top, .. } => Some((pass, Step::Fill(top.clone(), 0))),
            _ => None,
        }
    }

    /// Returns the step that prepares the planes through the edges of each triangle and each ray origin (the eye and
    /// the lights), with one work-item per triangle and origin. Returns `None` if the strategy uses no planes or there
    /// are no triangles.
    fn prepare_origins(&self, pass: Pass) -> Result<Option<(Pass, Step)>, LaunchError> {
        let uploaded = self.setup.uploaded;
        if self.prepared.is_none() || uploaded.triangle_count == 0 {
            return Ok(None);
        }
        let items = [uploaded.triangle_count, 1 + uploaded.light_count];
        let kernel = self.setup.row_kernel(self.setup.kernel_for(Role::Prepare)?, &self.arguments, items)?;
        Ok(Some((pass, Step::Run(kernel))))
    }

    /// Returns the steps of a rasteriser. The first two steps clear buffers, the third finds the depth of
    /// each pixel, and the last finds the triangle at this depth. If there are no triangles, the steps only clear the
    /// buffers.
    fn rasterise(&self, arguments: &Arguments<'a>, nearest: &Buffer<i32>) -> Result<Steps, LaunchError> {
        let [width, height] = self.setup.workload.image_size.map(|side| side as usize);
        let depth = allocate::<i32>(self.setup.queue, width * height)?;
        let mut steps = vec![
            (Pass::Primary, Step::Fill(depth.clone(), NO_HIT)),
            (Pass::Primary, Step::Fill(nearest.clone(), NO_HIT)),
        ];
        let triangles = self.setup.uploaded.triangle_count;
        if triangles == 0 {
            return Ok(steps);
        }
        let arguments = arguments.clone().with("depth", &depth);
        for role in [Role::Primary, Role::Resolve] {
            let kernel = self.setup.row_kernel(self.setup.kernel_for(role)?, &arguments, [triangles, 1])?;
            steps.push((Pass::Primary, Step::Run(kernel)));
        }
        Ok(steps)
    }
}

/// Returns an error if the sub-groups of a kernel have another size than a tile needs. If `size` is `None`, the size of
/// the sub-groups is unknown, and the function returns no error.
fn sub_groups_suit(kernel: &str, size: Option<usize>) -> Result<(), LaunchError> {
    match size {
        Some(size) if size != GROUP_LANES as usize => {
            Err(LaunchError::SubGroups { kernel: kernel.to_owned(), size })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_groups_of_another_size_than_a_tile_needs_are_refused() {
        let suit = |size| sub_groups_suit("tile_cast", size).is_ok();
        assert_eq!([None, Some(32), Some(16), Some(64)].map(suit), [true, true, false, false]);
    }
}
