//! What the kernels of tiles shared by groups hand on to each other.

use super::buffers::allocate;
use super::{LaunchError, Queue};
use ocl::Buffer;
use ocl::enums::{DeviceInfo, DeviceInfoResult};
use ocl::prm::Uint2;

/// Groups that cast them, for each compute unit: as many as a large GPU's can hold at a time.
const GROUPS_A_UNIT: usize = 64;

/// Between the kernels of a round of lights.
pub(super) struct Shared {
    /// The lights that reach a pixel, a bit each.
    pub lit: Buffer<u32>,
    /// Pixels with the lights whose shadow rays were left over, at most one entry a pixel.
    pub queue: Buffer<Uint2>,
    /// How many entries the queue has.
    pub queued: Buffer<i32>,
}

impl Shared {
    /// Room for every pixel.
    pub fn allocate(queue: &Queue, pixels: usize) -> ocl::Result<Self> {
        Ok(Self {
            lit: allocate(queue, pixels)?,
            queue: allocate(queue, pixels)?,
            queued: allocate(queue, 1)?,
        })
    }

    /// Work-items across and down that work off any number of them.
    pub fn global_size(&self, queue: &Queue, local_size: [u32; 2]) -> Result<[usize; 2], LaunchError> {
        let units = match queue.device.info(DeviceInfo::MaxComputeUnits)? {
            DeviceInfoResult::MaxComputeUnits(units) => units as usize,
            _ => 1,
        };
        let [across, down] = local_size.map(|n| n as usize);
        Ok([across * (units * GROUPS_A_UNIT).div_ceil(down), down])
    }
}
