//! What a device can hold.

use super::LaneOperations;
use serde::{Deserialize, Serialize};

/// What a device can hold and how it is shaped, as its driver reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceLimits {
    /// `__local` bytes a work-group may use. Never exceed it: PoCL 3.1 aborts the process.
    pub local_bytes: u64,
    /// `__constant` bytes a kernel may use.
    pub constant_bytes: u64,
    /// Global memory.
    pub global_bytes: u64,
    /// The largest single buffer.
    pub allocation_bytes: u64,
    /// Work-items a work-group may have.
    pub work_group_size: usize,
    /// Work-items a work-group may have across, down and deep.
    pub work_item_sizes: [usize; 3],
    /// Compute units.
    pub compute_units: u32,
    /// The widest float vector the hardware adds in one instruction (CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT).
    pub native_width: u32,
    /// Whether work-groups run on a CPU's threads, whose stacks hold private arrays.
    pub is_cpu: bool,
    /// How the work-items that share a tile tell each other things.
    #[serde(default)]
    pub lane_operations: LaneOperations,
}

impl DeviceLimits {
    /// The same device held to less, as an imitation of a smaller one. A value above the device's own changes nothing.
    #[must_use]
    pub fn with_overrides(
        self,
        local_bytes: Option<u64>,
        constant_bytes: Option<u64>,
        work_group_size: Option<usize>,
    ) -> Self {
        Self {
            local_bytes: lowered(self.local_bytes, local_bytes),
            constant_bytes: lowered(self.constant_bytes, constant_bytes),
            work_group_size: lowered(self.work_group_size, work_group_size),
            ..self
        }
    }
}

fn lowered<T: Ord>(own: T, wished: Option<T>) -> T {
    match wished {
        Some(wished) => own.min(wished),
        None => own,
    }
}

/// The ray width that suits a device whose driver reports `reported` floats a native vector:
/// on a CPU that, as one of 1, 2, 4, 8, 16; 1 elsewhere, where lanes are work-items.
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
    fn overrides_lower_but_never_raise() {
        let limits = EXAMPLE.with_overrides(Some(16384), Some(1 << 20), None);
        assert_eq!(limits, DeviceLimits { local_bytes: 16384, ..EXAMPLE });
        assert_eq!(EXAMPLE.with_overrides(None, None, Some(256)).work_group_size, 256);
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
