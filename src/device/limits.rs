//! The limits of a device.

use super::LaneOperations;
use serde::{Deserialize, Serialize};

/// The limits of a device and its main properties, as its driver reports them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceLimits {
    /// Bytes of `__local` memory of a work-group. Never exceed this limit: otherwise PoCL 3.1 aborts the process.
    pub local_bytes: u64,
    /// Bytes of `__constant` memory of a kernel.
    pub constant_bytes: u64,
    /// Bytes of global memory.
    pub global_bytes: u64,
    /// Bytes of the largest buffer.
    pub allocation_bytes: u64,
    /// Largest number of work-items in a work-group.
    pub work_group_size: usize,
    /// Largest number of work-items of a work-group along each dimension.
    pub work_item_sizes: [usize; 3],
    /// Number of compute units.
    pub compute_units: u32,
    /// Number of rays per vector that suits the device. On a CPU, this is the number of floats in the widest vector
    /// that the hardware adds in one instruction (CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT), rounded down to 1, 2, 4, 8 or
    /// 16. On other devices it is 1.
    pub native_width: u32,
    /// True if work-groups run on threads of a CPU, whose stacks hold private arrays.
    pub is_cpu: bool,
    /// How the work-items that share a tile exchange values.
    #[serde(default)]
    pub lane_operations: LaneOperations,
}

/// Returns the number of rays per vector that suits a device. On a CPU, the number is the reported number of floats per
/// native vector, rounded down to 1, 2, 4, 8 or 16. On other devices it is 1, because their lanes are work-items.
pub(super) fn native_width(is_cpu: bool, reported: u64) -> u32 {
    if !is_cpu {
        return 1;
    }
    [16, 8, 4, 2].into_iter().find(|&width| u64::from(width) <= reported).unwrap_or(1)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) const EXAMPLE: DeviceLimits = DeviceLimits {
        local_bytes: 49152,
        constant_bytes: 65536,
        global_bytes: 1 << 33,
        allocation_bytes: 1 << 31,
        work_group_size: 1024,
        work_item_sizes: [1024, 1024, 64],
        compute_units: 16,
        native_width: 1,
        is_cpu: false,
        lane_operations: LaneOperations::Barriers,
    };

    #[test]
    fn widths_are_ray_widths() {
        let widths = [(0, 1), (1, 1), (3, 2), (8, 8), (16, 16), (64, 16)];
        for (reported, expected) in widths {
            assert_eq!(native_width(true, reported), expected, "{reported}");
        }
        assert_eq!(native_width(false, 4), 1);
    }
}
