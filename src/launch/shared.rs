//! Buffers that pass results from kernel to kernel, for tiles that are shared by groups of work-items.

use super::Queue;
use super::buffers::allocate;
use ocl::Buffer;
use ocl::enums::{DeviceInfo, DeviceInfoResult};
use ocl::prm::Uint2;

/// Number of groups per compute unit that cast leftover shadow rays. With fewer, scenes of millions of small
/// triangles take longer (16: 14% more at three million); with more, all other scenes take longer (64: 3 to 4%
/// more on the bunny and the dragon; NVIDIA H200, 2026-11-20).
const GROUPS_A_UNIT: usize = 32;

/// Buffers between the kernels of a round of lights.
pub(super) struct Shared {
    /// The lights that reach the hit of a ray from the eye, one bit per light.
    pub lit: Buffer<u32>,
    /// Rays from the eye that have leftover shadow rays, each with the lights of these shadow rays; at most one entry
    /// per ray from the eye.
    pub queue: Buffer<Uint2>,
    /// Number of entries in the queue.
    pub queued: Buffer<i32>,
    /// Number of groups that process the queue, whatever its length.
    pub groups: usize,
}

impl Shared {
    /// Allocates buffers for all rays from the eye.
    pub fn allocate(queue: &Queue, rays: usize) -> ocl::Result<Self> {
        let units = match queue.device.info(DeviceInfo::MaxComputeUnits)? {
            DeviceInfoResult::MaxComputeUnits(units) => units as usize,
            _ => 1,
        };
        Ok(Self {
            lit: allocate(queue, rays)?,
            queue: allocate(queue, rays)?,
            queued: allocate(queue, 1)?,
            groups: units * GROUPS_A_UNIT,
        })
    }
}
