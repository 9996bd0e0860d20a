//! A device ready for commands.

use crate::error::{Error, Result};
use ocl::{CommandQueueProperties, Context, Device, Platform};

/// A context and an in-order queue with timestamps on one device.
#[derive(Clone, Debug)]
pub struct Queue {
    /// The context that owns buffers and programs.
    pub context: Context,
    /// The command queue.
    pub commands: ocl::Queue,
    /// The device.
    pub device: Device,
}

impl Queue {
    /// Opens a device.
    pub fn open(platform: Platform, device: Device) -> Result<Self> {
        let open = || -> ocl::Result<Self> {
            let context = Context::builder().platform(platform).devices(device).build()?;
            let commands = ocl::Queue::new(&context, device, Some(CommandQueueProperties::PROFILING_ENABLE))?;
            Ok(Self { context, commands, device })
        };
        open().map_err(|error| Error::run(format!("cannot open the OpenCL device: {error}")))
    }
}
