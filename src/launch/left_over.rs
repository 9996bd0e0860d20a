//! Shadow rays that tiles shared by groups leave to be cast one by one.

use super::buffers::allocate;
use super::{LaunchError, Queue};
use ocl::Buffer;
use ocl::enums::{DeviceInfo, DeviceInfoResult};
use ocl::prm::Uint2;

/// Groups that cast them, for each compute unit: as many as a large GPU's can hold at a time.
const GROUPS_A_UNIT: usize = 64;

/// Pixels with their lights, at most one entry a pixel, and how many there are.
pub(super) struct LeftOver {
    pub rays: Buffer<Uint2>,
    pub count: Buffer<i32>,
}

impl LeftOver {
    /// Room for every pixel.
    pub fn allocate(queue: &Queue, pixels: usize) -> ocl::Result<Self> {
        Ok(Self { rays: allocate(queue, pixels)?, count: allocate(queue, 1)? })
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
