//! The commands a frame consists of.

use super::Queue;
use super::frame::Phase;
use ocl::{Buffer, Event, Kernel};

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
