//! What casts the frames of a point that passed its check.

use super::host;
use super::point_failure::PointFailure;
use crate::config::Baseline;
use crate::launch::{Caster, FrameTimes};
use crate::scene::Scene;

/// A point that can be cast again and again.
pub enum Ready {
    /// On a device.
    Kernel(Box<Caster>),
    /// On the host.
    Host(Baseline),
}

impl Ready {
    /// Casts `batch` frames on a device, one on the host; the mean times of one.
    pub fn frame(&self, scene: &Scene, image_size: [u32; 2], batch: u32) -> Result<FrameTimes, PointFailure> {
        match self {
            Self::Kernel(caster) => Ok(caster.cast_batch(batch)?),
            Self::Host(baseline) => Ok(host::cast(*baseline, scene, image_size).1),
        }
    }
}
