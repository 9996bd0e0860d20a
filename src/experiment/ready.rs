//! A point that has passed its check and can be cast.

use super::host;
use crate::config::Baseline;
use crate::launch::{Caster, FrameTimes, Refused};
use crate::scene::Scene;

/// A point that can be cast repeatedly.
pub enum Ready {
    /// A point that is cast by kernels on a device.
    Kernel(Box<Caster>),
    /// A point that is cast by a baseline on the host.
    Host(Baseline),
}

impl Ready {
    /// Casts `batch` frames on a device, or one frame on the host. Returns the mean times of one frame.
    pub fn frame(&self, scene: &Scene, image_size: [u32; 2], batch: u32) -> Result<FrameTimes, Refused> {
        match self {
            Self::Kernel(caster) => caster.cast_batch(batch).map_err(Refused::at("the launch")),
            Self::Host(baseline) => Ok(host::cast(*baseline, scene, image_size).1),
        }
    }
}
