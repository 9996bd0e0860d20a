//! What a strategy asks of a device, with its arithmetic, before anything is compiled.

use super::Strategy;
use crate::device::DeviceLimits;

/// The sizes a strategy's needs depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Workload {
    /// Triangles in the scene.
    pub triangles: usize,
    /// Entries of the mesh's set of positions.
    pub positions: usize,
    /// Entries of the mesh's set of normals.
    pub normals: usize,
    /// Lights in the scene.
    pub lights: usize,
    /// Pixels across and down.
    pub image_size: [u32; 2],
    /// Work-items of a work-group across and down.
    pub local_size: [u32; 2],
}

/// Bytes a strategy needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requirements {
    /// `__local` bytes a work-group.
    pub local_bytes: u64,
    /// `__constant` bytes.
    pub constant_bytes: u64,
    /// Global scratch or heap bytes beside scene and image.
    pub scratch_bytes: u64,
    /// Private bytes of a whole work-group's working vectors.
    pub private_bytes: u64,
}

/// Why a device cannot hold a point: the arithmetic, as a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Infeasible {
    /// For example "__local: 108 B x 24 x 24 = 62208 B > 49152 B".
    pub reason: String,
}

impl Requirements {
    /// What `strategy` needs for `workload`.
    pub fn of(_strategy: &Strategy, _workload: &Workload) -> Self {
        Self::default()
    }

    /// Whether a device with these limits can hold it.
    pub fn check(
        _strategy: &Strategy,
        _workload: &Workload,
        _limits: &DeviceLimits,
    ) -> Result<Self, Infeasible> {
        Ok(Self::default())
    }
}
