//! Which OpenCL devices there are, what they can hold, and which one is meant.

/// What a device can hold and how it is shaped, as its driver reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceLimits {
    /// `__local` bytes a work-group may use.
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
}
