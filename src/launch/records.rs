//! Records of triangles: the numbers that the ray-triangle test reads of each triangle. The records are computed before
//! the first frame.

use super::LaunchError;
use super::buffers::allocate;
use super::frame::duration_ms;
use super::setup::{Setup, scene_arguments};
use crate::manifest::Role;
use ocl::{Buffer, Event};

/// One record per triangle. The kernel file of the ray-triangle test states the length of a record.
pub(super) struct Records {
    pub buffer: Buffer<f32>,
    /// Device time for preparing the records.
    pub prepare_ms: f64,
}

impl Records {
    /// Prepares the records of a scene's triangles, and waits until the records are ready; `None` if the strategy uses
    /// no records.
    pub fn prepare(setup: &Setup<'_>) -> Result<Option<Self>, LaunchError> {
        let Setup { queue, strategy, uploaded, tree, .. } = *setup;
        let Some(kernel) = strategy.family().kernel(Role::Records) else { return Ok(None) };
        if !strategy.holds(kernel.when) {
            return Ok(None);
        }
        let triangles = uploaded.triangle_count;
        let buffer = allocate::<f32>(queue, strategy.intersector.record_floats() * triangles)?;
        if triangles == 0 {
            return Ok(Some(Self { buffer, prepare_ms: 0.0 }));
        }
        let arguments = scene_arguments(uploaded, tree).with("records", &buffer);
        let kernel = setup.row_kernel(kernel, &arguments, [triangles, 1])?;
        let mut event = Event::empty();
        // SAFETY: the kernel's arguments were checked; the kernel writes one record per triangle, and the buffer has
        // room for all records.
        unsafe { kernel.cmd().queue(&queue.commands).enew(&mut event).enq()? };
        queue.commands.finish()?;
        Ok(Some(Self { buffer, prepare_ms: duration_ms(&event)? }))
    }
}
