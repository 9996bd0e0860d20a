//! Buffers for strategies in which the work-items of a group share each tile. A group is a row of a work-group: 32
//! work-items. The buffers pass results from one kernel to the next.

use super::Queue;
use super::buffers::allocate;
use ocl::Buffer;
use ocl::enums::{DeviceInfo, DeviceInfoResult};
use ocl::prm::Uint2;

/// Number of groups of 32 work-items, per compute unit, that cast leftover shadow rays. With fewer groups of
/// work-items, scenes of millions of small triangles take longer (16 groups: 14% longer than with 32 at three
/// million triangles). With more groups of work-items, scenes of fewer or larger triangles take longer (64
/// groups: 3 to 4% longer than with 32 on the bunny and the dragon). The times were measured on an NVIDIA
/// H200, 2026-11-20.
const GROUPS_A_UNIT: usize = 32;

/// Buffers that pass results from one kernel to the next in a round of lights (the kernels process the lights in
/// rounds, a few lights at a time).
pub(super) struct Shared {
    /// A word for each ray from the eye. The word has one bit per light of the round of lights. The bit is
    /// set if the light reaches the ray's hit. Bit 31 is set if the ray has leftover shadow rays.
    pub lit: Buffer<u32>,
    /// The queue of leftover shadow rays. Each entry belongs to a ray from the eye, and names the lights to
    /// which this ray's leftover shadow rays go.
    pub queue: Buffer<Uint2>,
    /// Number of entries in the queue of leftover shadow rays.
    pub queued: Buffer<i32>,
    /// Number of groups of 32 work-items that process the queue. The number of groups does not depend on the
    /// length of the queue of leftover shadow rays.
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
