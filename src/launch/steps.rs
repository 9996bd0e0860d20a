//! The commands that a frame consists of.

use super::Queue;
use super::frame::Pass;
use ocl::{Buffer, Event, Kernel, SpatialDims};

/// The rays that a frame casts: how many rays per pixel, and the rays of how many tiles.
#[derive(Clone, Copy, Default)]
pub(super) struct Extent {
    /// Each pixel has 2^`bits` rays across and down.
    pub bits: u32,
    /// The number of tiles whose rays are cast; `None` if the rays of all tiles are cast.
    pub tiles: Option<usize>,
}

/// One command of a frame.
pub(super) enum Step {
    /// Sets every value of the buffer to this number.
    Fill(Buffer<i32>, i32),
    /// Runs a kernel with the same number of work-items in every frame.
    Run(Kernel),
    /// Runs a kernel in which every work-item casts its own rays. In a frame that casts several rays per
    /// pixel, such a kernel gets more work-items than in a frame with one ray per pixel.
    Cast(Kernel),
}

impl Step {
    /// Returns the kernel that the step runs, if any.
    pub fn kernel(&self) -> Option<&Kernel> {
        match self {
            Self::Fill(..) => None,
            Self::Run(kernel) | Self::Cast(kernel) => Some(kernel),
        }
    }

    /// Enqueues the command. A kernel in which every work-item has rays of its own gets as many work-items as the
    /// frame's rays need.
    pub fn enqueue(&self, queue: &Queue, extent: Extent) -> ocl::Result<Event> {
        let mut event = Event::empty();
        match self {
            Self::Fill(buffer, value) => {
                buffer.cmd().queue(&queue.commands).fill(*value, None).enew(&mut event).enq()?;
            }
            Self::Run(kernel) | Self::Cast(kernel) => {
                let mut run = kernel.cmd().queue(&queue.commands);
                if matches!(self, Self::Cast(_)) {
                    let finer = |dimensions| finer(dimensions, extent.bits);
                    let size = finer(kernel.default_global_work_size());
                    let local = kernel.default_local_work_size();
                    run =
                        run.global_work_size(extent.tiles.map_or(size, |tiles| rows_for(tiles, size, local)));
                    run = run.global_work_offset(finer(kernel.default_global_work_offset()));
                }
                // SAFETY: the kernel was built with every argument that its source declares, and each buffer is as long
                // as the sizes that are passed with it. Every caller waits for the queue, so all buffers outlive the
                // command.
                unsafe { run.enew(&mut event).enq()? };
            }
        }
        Ok(event)
    }
}

/// Returns the numbers of work-items across and down, each multiplied by 2^`bits`.
fn finer(size: SpatialDims, bits: u32) -> SpatialDims {
    match size {
        SpatialDims::Two(across, down) => SpatialDims::Two(across << bits, down << bits),
        other => other,
    }
}

/// Returns the dimensions `size` with only as many rows of work-groups as `tiles` tiles need. In a work-group, each row
/// of work-items casts the rays of one tile.
fn rows_for(tiles: usize, size: SpatialDims, local: SpatialDims) -> SpatialDims {
    match (size, local) {
        (SpatialDims::Two(across, down), SpatialDims::Two(local_across, local_down)) => {
            let rows = tiles.div_ceil(across / local_across * local_down).max(1);
            SpatialDims::Two(across, (rows * local_down).min(down))
        }
        _ => size,
    }
}

/// The commands of a frame in order, each with the pass to which it belongs.
pub(super) type Steps = Vec<(Pass, Step)>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_tiles_need_few_rows_of_work_groups() {
        let size = |tiles, local_down| {
            let [all, local] = [[320, 64], [32, local_down]].map(|[x, y]| SpatialDims::Two(x, y));
            rows_for(tiles, all, local).to_lens().map(|lens| lens[1])
        };
        // The frame has ten work-groups side by side. In the first assertion, each work-group casts one tile;
        // in the second, each work-group casts four tiles.
        assert_eq!([0, 1, 10, 11, 9999].map(|tiles| size(tiles, 1).ok()), [1, 1, 1, 2, 64].map(Some));
        assert_eq!([1, 40, 41, 9999].map(|tiles| size(tiles, 4).ok()), [4, 4, 8, 64].map(Some));
    }
}
