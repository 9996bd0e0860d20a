//! A point that has passed its check and can be cast.

use super::host;
use crate::config::Baseline;
use crate::launch::{Caster, FrameTimes, LaunchError, Refused};
use crate::scene::{Sampling, Scene};

/// A point of an experiment that has passed its check, so that its image can be cast repeatedly.
pub enum Ready {
    /// A point that is cast by kernels on a device, with this number of samples per pixel.
    Kernel(Box<Caster>, Sampling),
    /// A point that is cast on the host, by a baseline (a ray caster without OpenCL).
    Host(Baseline),
}

impl Ready {
    /// Casts `batch` frames on a device, or one frame on the host. Returns the mean times of one frame; a
    /// frame includes all samples of each pixel.
    pub fn frame(&self, scene: &Scene, image_size: [u32; 2], batch: u32) -> Result<FrameTimes, Refused> {
        match self {
            Self::Kernel(caster, sampling) => {
                cast_frames(caster, scene, sampling, batch).map_err(Refused::at("the launch"))
            }
            Self::Host(baseline) => Ok(host::cast(*baseline, scene, image_size).1),
        }
    }
}

/// Casts `batch` frames with all samples of each pixel. Returns the mean times of one frame.
pub(super) fn cast_frames(
    caster: &Caster,
    scene: &Scene,
    sampling: &Sampling,
    batch: u32,
) -> Result<FrameTimes, LaunchError> {
    match sampling.most {
        1 => caster.cast_batch(batch),
        _ => caster.cast_samples_batch(&scene.camera, sampling, batch),
    }
}
