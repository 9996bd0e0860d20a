//! The limits of an OpenCL device, such as memory sizes and work-group sizes.

use super::LaneOperations;
use serde::{Deserialize, Serialize};

/// The limits and the main properties of a device. The device's driver reports most of them. An experiment can replace
/// some limits by those of a smaller device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceLimits {
    /// Bytes of `__local` memory of a work-group. PoCL 3.1 aborts the process if a kernel needs more
    /// `__local` memory.
    pub local_bytes: u64,
    /// Bytes of `__constant` memory that a kernel may use.
    pub constant_bytes: u64,
    /// True if `local_bytes` is the limit of a smaller device that an experiment imitates.
    #[serde(skip)]
    pub local_is_emulated: bool,
    /// True if `constant_bytes` is the limit of a smaller device that an experiment imitates.
    #[serde(skip)]
    pub constant_is_emulated: bool,
    /// Bytes of the device's global memory.
    pub global_bytes: u64,
    /// Bytes of the largest buffer that the device can allocate.
    pub allocation_bytes: u64,
    /// Largest number of work-items in a work-group.
    pub work_group_size: usize,
    /// Largest number of work-items of a work-group along each dimension.
    pub work_item_sizes: [usize; 3],
    /// The device's number of compute units (cores or multiprocessors).
    pub compute_units: u32,
    /// Number of rays per vector that suits the device. On a CPU, `native_width` is the number of floats in
    /// the widest vector that the hardware adds in one instruction (CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT),
    /// rounded down to 1, 2, 4, 8 or 16. On all devices except CPUs, `native_width` is 1.
    pub native_width: u32,
    /// True if the device uses the host's memory, as CPUs and integrated GPUs do
    /// (CL_DEVICE_HOST_UNIFIED_MEMORY).
    #[serde(default)]
    pub shares_memory: bool,
    /// True if the device runs work-groups on threads of a CPU, so that private arrays are on the threads'
    /// stacks.
    pub is_cpu: bool,
    /// How the work-items that share a tile exchange values.
    #[serde(default)]
    pub lane_operations: LaneOperations,
}

/// The usual number of work-items in a work-group of a kernel that supports work-groups of any size.
const USUAL_GROUP: usize = 64;

impl DeviceLimits {
    /// Returns the number of work-items in a work-group of one row, for kernels that support work-groups of
    /// any size. The number of work-items is 64 or, if the device allows fewer work-items, the largest power
    /// of two that the device allows.
    pub fn usual_group(&self) -> usize {
        self.group(USUAL_GROUP)
    }

    /// Returns the largest power of two that is not larger than `most` and that the device allows as the number of
    /// work-items in a work-group of one row.
    pub fn group(&self, most: usize) -> usize {
        power_of_two(most.min(self.work_group_size).min(self.work_item_sizes[0]))
    }

    /// Returns the given local size if the device allows this size, else a smaller local size. First, each side is
    /// reduced to the device's limit for this side. Then the longer side is halved, again and again, until the device
    /// allows the number of work-items.
    pub fn fitting(&self, [across, down]: [u32; 2]) -> [u32; 2] {
        let within = |side: u32, axis: usize| {
            u32::try_from(self.work_item_sizes[axis]).map_or(side, |most| side.min(most)).max(1)
        };
        let [mut across, mut down] = [within(across, 0), within(down, 1)];
        let most = self.work_group_size.max(1) as u64;
        while u64::from(across) * u64::from(down) > most {
            let longer = if across > down { &mut across } else { &mut down };
            *longer /= 2;
        }
        [across, down]
    }
}

/// Returns the largest power of two that is not larger than a number; 1 for 0.
pub fn power_of_two(number: usize) -> usize {
    1 << number.max(1).ilog2()
}

/// Returns the number of rays per vector that suits a device. On a CPU, the number is the reported number of
/// floats per native vector, rounded down to 1, 2, 4, 8 or 16. On devices that are no CPUs, the number of
/// rays per vector is 1, because the lanes of such devices are work-items.
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
        local_is_emulated: false,
        constant_is_emulated: false,
        global_bytes: 1 << 33,
        allocation_bytes: 1 << 31,
        work_group_size: 1024,
        work_item_sizes: [1024, 1024, 64],
        compute_units: 16,
        native_width: 1,
        shares_memory: false,
        is_cpu: false,
        lane_operations: LaneOperations::Barriers,
    };

    #[test]
    fn work_groups_are_as_large_as_the_device_allows() {
        let of =
            |work_group_size, work_item_sizes| DeviceLimits { work_group_size, work_item_sizes, ..EXAMPLE };
        let usual = |items, across| of(items, [across, 1, 1]).usual_group();
        assert_eq!([usual(1024, 1024), usual(32, 1024), usual(1024, 16)], [64, 32, 16]);
        assert_eq!([usual(63, 63), usual(1, 1), usual(0, 0)], [32, 1, 1]);
        assert_eq!(EXAMPLE.group(256), 256);
        assert_eq!([0, 1, 7, 8, 9].map(power_of_two), [1, 1, 4, 8, 8]);
    }

    #[test]
    fn a_local_size_is_halved_until_the_device_allows_it() {
        let fitting = |work_group_size, size| DeviceLimits { work_group_size, ..EXAMPLE }.fitting(size);
        assert_eq!(
            [128, 127, 64, 16, 1].map(|most| fitting(most, [16, 8])),
            [[16, 8], [8, 8], [8, 8], [4, 4], [1, 1]]
        );
        assert_eq!([fitting(8, [8, 8]), fitting(8, [1, 1]), fitting(0, [2, 3])], [[4, 2], [1, 1], [1, 1]]);
        // Some devices allow only work-groups of one row.
        let one_row = DeviceLimits { work_item_sizes: [32, 1, 1], ..EXAMPLE };
        assert_eq!([one_row.fitting([64, 8]), one_row.fitting([8, 8])], [[32, 1], [8, 1]]);
    }

    #[test]
    fn widths_are_ray_widths() {
        let widths = [(0, 1), (1, 1), (3, 2), (8, 8), (16, 16), (64, 16)];
        for (reported, expected) in widths {
            assert_eq!(native_width(true, reported), expected, "{reported}");
        }
        assert_eq!(native_width(false, 4), 1);
    }
}
