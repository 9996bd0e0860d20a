//! A frame of a moving picture.

use super::Radiance;
use super::display::{to_rgb8, to_rgba8};
use crate::scene::Display;
use image::{DynamicImage, RgbImage};

/// A frame of a moving picture, as it was read from the device.
pub enum Frame {
    /// Colours in 8 bits.
    Shown(RgbImage),
    /// Radiance, and how it is converted to 8 bits. A frame with a transparent background is always radiance.
    Radiance(Radiance, Display),
}

impl Frame {
    /// Returns true if pixels of the frame may be transparent.
    pub fn has_alpha(&self) -> bool {
        matches!(self, Self::Radiance(image, _) if !image.coverage.is_empty())
    }

    /// Returns the frame in 8 bits per channel, with an alpha channel if pixels may be transparent.
    pub fn into_8_bits(self) -> DynamicImage {
        match self {
            Self::Shown(picture) => picture.into(),
            Self::Radiance(image, display) => {
                to_rgba8(&image, display).map_or_else(|| to_rgb8(&image, display).into(), DynamicImage::from)
            }
        }
    }
}
