//! What the kernels of tiles shared by groups hand on to each other.

use super::Queue;
use super::buffers::allocate;
use ocl::Buffer;
use ocl::enums::{DeviceInfo, DeviceInfoResult};
use ocl::prm::Uint2;

/// Groups that cast what was left over, for each compute unit: with fewer, millions of small triangles take longer (16: 14%
/// more at three million), with more all else does (64: 3 to 4% more on the bunny and the dragon; NVIDIA H200, 2026-11-20).
const GROUPS_A_UNIT: usize = 32;

/// Between the kernels of a round of lights.
pub(super) struct Shared {
    /// The lights that reach a pixel, a bit each.
    pub lit: Buffer<u32>,
    /// Pixels with the lights whose shadow rays were left over, at most one entry a pixel.
    pub queue: Buffer<Uint2>,
    /// How many entries the queue has.
    pub queued: Buffer<i32>,
    /// Groups that cast what is in the queue, any number of entries.
    pub groups: usize,
}

impl Shared {
    /// Room for every pixel.
    pub fn allocate(queue: &Queue, pixels: usize) -> ocl::Result<Self> {
        let units = match queue.device.info(DeviceInfo::MaxComputeUnits)? {
            DeviceInfoResult::MaxComputeUnits(units) => units as usize,
            _ => 1,
        };
        Ok(Self {
            lit: allocate(queue, pixels)?,
            queue: allocate(queue, pixels)?,
            queued: allocate(queue, 1)?,
            groups: units * GROUPS_A_UNIT,
        })
    }
}
