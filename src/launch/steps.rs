//! The commands that a frame consists of.

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
    /// Returns the kernel that the step runs, if any.
    pub fn kernel(&self) -> Option<&Kernel> {
        match self {
            Self::Fill(..) => None,
            Self::Run(kernel) => Some(kernel),
        }
    }

    /// Enqueues the command.
    pub fn enqueue(&self, queue: &Queue) -> ocl::Result<Event> {
        let mut event = Event::empty();
        match self {
            Self::Fill(buffer, value) => {
                buffer.cmd().queue(&queue.commands).fill(*value, None).enew(&mut event).enq()?;
            }
            Self::Run(kernel) => {
                // SAFETY: the kernel was built with every argument that its source declares, each buffer is
                // as long as the sizes passed with it, and all of them outlive the queue's `finish` in
                // `cast`.
                unsafe { kernel.cmd().queue(&queue.commands).enew(&mut event).enq()? };
            }
        }
        Ok(event)
    }
}

/// The commands of a frame in order, each with its purpose.
pub(super) type Steps = Vec<(Phase, Step)>;
