//! A device ready for commands.

use crate::error::{Error, Result};
use ocl::enums::{DeviceInfo, DeviceInfoResult};
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
    /// Whether the device works in the host's own memory, as a CPU does.
    pub shares_memory: bool,
}

impl Queue {
    /// Opens a device.
    pub fn open(platform: Platform, device: Device) -> Result<Self> {
        let open = || -> ocl::Result<Self> {
            let context = Context::builder().platform(platform).devices(device).build()?;
            let commands = ocl::Queue::new(&context, device, Some(CommandQueueProperties::PROFILING_ENABLE))?;
            let shared = device.info(DeviceInfo::HostUnifiedMemory);
            let shares_memory = matches!(shared, Ok(DeviceInfoResult::HostUnifiedMemory(true)));
            Ok(Self { context, commands, device, shares_memory })
        };
        open().map_err(|error| {
            Error::run(format!("cannot open the OpenCL device: {error}"))
                .with_help("another process may hold its memory; `raycl devices` lists the others")
        })
    }
}
