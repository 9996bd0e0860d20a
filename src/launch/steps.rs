//! The commands that a frame consists of.

use super::Queue;
use super::frame::Phase;
use ocl::{Buffer, Event, Kernel, SpatialDims};

/// One command of a frame.
pub(super) enum Step {
    /// Sets every value of a buffer.
    Fill(Buffer<i32>, i32),
    /// Runs a kernel.
    Run(Kernel),
    /// Runs a kernel whose work-items own rays: a frame of several samples has more of them.
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

    /// Enqueues the command; where work-items own rays, with 2^`bits` times as many of them across and down as for one
    /// sample of each pixel.
    pub fn enqueue(&self, queue: &Queue, bits: u32) -> ocl::Result<Event> {
        let mut event = Event::empty();
        match self {
            Self::Fill(buffer, value) => {
                buffer.cmd().queue(&queue.commands).fill(*value, None).enew(&mut event).enq()?;
            }
            Self::Run(kernel) | Self::Cast(kernel) => {
                let mut run = kernel.cmd().queue(&queue.commands);
                if bits > 0 && matches!(self, Self::Cast(_)) {
                    run = run.global_work_size(finer(kernel.default_global_work_size(), bits));
                    run = run.global_work_offset(finer(kernel.default_global_work_offset(), bits));
                }
                // SAFETY: the kernel was built with every argument that its source declares, each buffer is
                // as long as the sizes passed with it, and all of them outlive the queue's `finish` in
                // `cast`.
                unsafe { run.enew(&mut event).enq()? };
            }
        }
        Ok(event)
    }
}

/// Returns dimensions across and down, each times 2^`bits`.
fn finer(size: SpatialDims, bits: u32) -> SpatialDims {
    match size {
        SpatialDims::Two(across, down) => SpatialDims::Two(across << bits, down << bits),
        other => other,
    }
}

/// The commands of a frame in order, each with its purpose.
pub(super) type Steps = Vec<(Phase, Step)>;
