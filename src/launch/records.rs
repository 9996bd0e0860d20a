//! Records of triangles: data that is computed once per scene, for the ray-triangle test.

use super::arguments::Arguments;
use super::buffers::allocate;
use super::frame::duration_ms;
use super::parts::{builder, in_rows};
use super::{LaunchError, Queue};
use crate::manifest::Role;
use crate::program::BuiltProgram;
use crate::strategy::Strategy;
use ocl::{Buffer, Event};

/// One record per triangle; the file of the ray-triangle test defines a record's length.
pub(super) struct Records {
    pub buffer: Buffer<f32>,
    /// Device time for preparing the records.
    pub prepare_ms: f64,
}

impl Records {
    /// Prepares the records from a scene's kernel arguments, and waits until the records are ready; `None` if the
    /// strategy uses no records.
    pub fn prepare(
        queue: &Queue,
        program: &BuiltProgram,
        strategy: &Strategy,
        triangles: usize,
        scene: Arguments<'_>,
    ) -> Result<Option<Self>, LaunchError> {
        let Some(kernel) = strategy.family().kernel(Role::Records) else { return Ok(None) };
        if !strategy.holds(kernel.when) {
            return Ok(None);
        }
        let buffer = allocate::<f32>(queue, strategy.intersector.record_floats() * triangles)?;
        if triangles == 0 {
            return Ok(Some(Self { buffer, prepare_ms: 0.0 }));
        }
        let mut event = Event::empty();
        {
            let arguments = scene.with("records", &buffer);
            let kernel = builder(queue, program, strategy, kernel, &arguments)?;
            let kernel = in_rows(queue, &kernel, [triangles, 1])?;
            // SAFETY: the kernel's arguments were checked; the kernel writes one record per triangle, and the buffer
            // has room for all records.
            unsafe { kernel.cmd().queue(&queue.commands).enew(&mut event).enq()? };
            queue.commands.finish()?;
        }
        Ok(Some(Self { buffer, prepare_ms: duration_ms(&event)? }))
    }
}
