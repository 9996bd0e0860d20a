//! A point that has passed its check and can be cast.

use super::host;
use super::point_failure::PointFailure;
use crate::config::Baseline;
use crate::launch::{Caster, FrameTimes};
use crate::scene::Scene;

/// A point that can be cast repeatedly.
pub enum Ready {
    /// A point that is cast by kernels on a device.
    Kernel(Box<Caster>),
    /// A point that is cast by a baseline on the host.
    Host(Baseline),
}

impl Ready {
    /// Casts `batch` frames on a device, or one on the host; returns the mean times of one frame.
    pub fn frame(&self, scene: &Scene, image_size: [u32; 2], batch: u32) -> Result<FrameTimes, PointFailure> {
        match self {
            Self::Kernel(caster) => Ok(caster.cast_batch(batch)?),
            Self::Host(baseline) => Ok(host::cast(*baseline, scene, image_size).1),
        }
    }
}
