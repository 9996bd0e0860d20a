//! An OpenCL device that has been opened, with its queue of commands.

use super::LaunchError;
use super::staging::Staging;
use crate::device;
use crate::error::{Error, Result};
use ocl::enums::{DeviceInfo, DeviceInfoResult};
use ocl::{CommandQueueProperties, Context, Device};
use std::sync::Arc;

/// A context and an in-order queue with timestamps on one device.
#[derive(Clone, Debug)]
pub struct Queue {
    /// The context that owns buffers and programs.
    pub context: Context,
    /// The queue through which the device gets its commands, in order.
    pub commands: ocl::Queue,
    /// The OpenCL handle of the device.
    pub device: Device,
    /// True if the device uses the host's own memory, as a CPU does.
    pub shares_memory: bool,
    /// Number of work-items in a work-group of the kernels that support work-groups of any size. A compiled kernel that
    /// does not support so many gets fewer.
    pub group: usize,
    /// Pinned memory of the host, for transfers.
    pub(super) staging: Arc<Staging>,
}

impl Queue {
    /// Opens a device: makes a context and a command queue for it.
    pub fn open(&device::Device { platform, device, ref info, .. }: &device::Device) -> Result<Self> {
        device::note_device(info);
        let open = || -> ocl::Result<Self> {
            let context = Context::builder().platform(platform).devices(device).build()?;
            let commands = ocl::Queue::new(&context, device, Some(CommandQueueProperties::PROFILING_ENABLE));
            let commands = commands.map_err(device::noted)?;
            let shared = device.info(DeviceInfo::HostUnifiedMemory);
            let shares_memory = matches!(shared, Ok(DeviceInfoResult::HostUnifiedMemory(true)));
            let group = info.limits.usual_group();
            Ok(Self { context, commands, device, shares_memory, group, staging: Arc::default() })
        };
        open().map_err(|error| {
            let error = LaunchError::from(error);
            let remedy = match error {
                LaunchError::Resources(_) => {
                    "another process may be using the device's memory; `raycl devices` lists other devices"
                }
                _ => "`raycl devices` lists other devices",
            };
            Error::run(format!("cannot open the OpenCL device: {}", error.on(info))).with_help(remedy)
        })
    }

    /// Returns a queue that treats its device as if the device had separate memory. The queue transfers large amounts
    /// of data in pieces of `piece_bytes` bytes. Tests use this queue to imitate a device with separate memory.
    #[must_use]
    pub fn with_separate_memory(self, piece_bytes: usize) -> Self {
        Self { shares_memory: false, staging: Arc::new(Staging::of(piece_bytes)), ..self }
    }

    /// Returns a queue that treats its device as if the device allowed only work-groups of `group` work-items
    /// (a power of two).
    #[cfg(test)]
    #[must_use]
    pub(crate) fn in_groups_of(self, group: usize) -> Self {
        Self { group, ..self }
    }

    /// Returns true if a transfer of `bytes` bytes uses pinned memory.
    pub(super) fn pins(&self, bytes: usize) -> bool {
        !self.shares_memory && self.staging.pays(bytes)
    }
}
