//! Pictures: radiance per pixel, the conversion to 8-bit colours, differences between pictures, and picture
//! files.

mod bmp;
mod colour;
mod colour_space;
mod compare;
mod decode;
mod display;
mod encode;
mod exif;
mod file;
mod frame;
mod hdr_header;
mod icc;
mod incoming;
mod jpeg;
mod jpeg_bits;
mod jpeg_blocks;
mod jpeg_frame;
mod jpeg_scan;
mod jpeg_scans;
mod layers;
mod movie;
mod png_chunks;
mod png_rows;
mod stated;
mod tga;

pub use bmp::has_fourth_channel;
pub use colour::{SCALE_HEIGHT, viridis};
pub use colour_space::other_colour_space;
pub use compare::{
    RELATIVE_LIMIT, alpha_difference, dark_floor, difference_image, psnr_db, relative_difference,
};
#[cfg(test)]
pub use decode::ODD_PALETTE;
pub use decode::{decoder_message, is_animated, picture_reader};
pub use display::{Shown, TOGETHER, to_rgb8, to_rgba8, transform};
pub use file::{
    Values, check_alpha, check_image, check_png, check_target, frame_key, holds_radiance, read_picture, save,
    save_frame, save_rgb8, shows_8_bits,
};
pub use frame::Frame;
pub use hdr_header::{HdrExposure, with_usual_signature};
pub use incoming::Incoming;
pub use jpeg_scan::is_damaged;
pub use layers::{counts, layer_targets, save_layers};
pub use movie::Movie;
pub use stated::{check_channels, exr_rest, header_remarks, unread_channels};
#[cfg(test)]
pub use tga::tests::tga;
pub use tga::{TGA_FOOTER, TgaAlpha, has_alpha_bits};

use rayon::prelude::*;

/// Radiance at every pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Radiance {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Red, green and blue of each of the `width * height` pixels.
    pub pixels: Vec<[f32; 3]>,
    /// If the background is transparent, the share of each pixel that surfaces cover, from 0 to 1; otherwise
    /// empty. If `coverage` is not empty, each element of `pixels` is multiplied by the pixel's coverage, except
    /// in pictures that were read from files with integer channels, such as PNG files.
    pub coverage: Vec<f32>,
}

impl Radiance {
    /// Makes a black image, which takes 12 bytes per pixel. If the system does not have this much memory, the
    /// function panics or the process ends.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![[0.0; 3]; width as usize * height as usize], coverage: Vec::new() }
    }

    /// Adds the values of another image, pixel by pixel. Both images must have the same size; the function does not
    /// check their sizes. If this image has no coverage, its coverage counts as 0. If the other image has no coverage,
    /// the sum has none.
    pub fn add(&mut self, other: &Self) {
        let (sums, values) = (self.pixels.as_flattened_mut(), other.pixels.as_flattened());
        sums.par_iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        self.coverage.resize(other.coverage.len(), 0.0);
        self.coverage.iter_mut().zip(&other.coverage).for_each(|(sum, value)| *sum += value);
    }

    /// Divides all values of the image by `parts`, so that the sum of `parts` images becomes the mean of
    /// these images.
    #[must_use]
    pub fn part(mut self, parts: usize) -> Self {
        let part = 1.0 / parts.max(1) as f32;
        self.pixels.as_flattened_mut().par_iter_mut().for_each(|value| *value *= part);
        self.coverage.iter_mut().for_each(|value| *value *= part);
        self
    }

    /// Returns the column and row of the first pixel that is not finite, and the number of pixels that are
    /// not finite. Returns `None` if all pixels are finite.
    pub fn not_finite(&self) -> Option<([u32; 2], usize)> {
        let infinite = |pixel: &[f32; 3]| !pixel.iter().all(|channel| channel.is_finite());
        let first = self.pixels.iter().position(infinite)? as u32;
        let count = self.pixels.iter().filter(|pixel| infinite(pixel)).count();
        Some(([first % self.width, first / self.width], count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_pixel_that_is_not_finite_has_its_column_and_row() {
        let mut image = Radiance::new(4, 3);
        assert_eq!(image.not_finite(), None);
        (image.pixels[6][1], image.pixels[11][0]) = (f32::NAN, f32::INFINITY);
        assert_eq!(image.not_finite(), Some(([2, 1], 2)));
    }

    #[test]
    fn a_mean_is_the_sum_of_images_divided_by_their_number() {
        let image = |value: f32, coverage: f32| Radiance {
            pixels: vec![[value, 2.0 * value, 0.0]; 2],
            coverage: vec![coverage; 2],
            ..Radiance::new(2, 1)
        };
        let mut sum = image(1.0, 1.0);
        sum.add(&image(4.0, 0.5));
        assert_eq!((sum.pixels[1], sum.coverage[1]), ([5.0, 10.0, 0.0], 1.5));
        let mean = sum.part(2);
        assert_eq!((mean.pixels[1], mean.coverage[1]), ([2.5, 5.0, 0.0], 0.75));
        let mut first = Radiance::new(2, 1);
        first.add(&image(1.0, 0.5));
        assert_eq!(first.coverage, [0.5; 2], "the first image that is added");
        let mut opaque = Radiance::new(2, 1);
        opaque.add(&Radiance::new(2, 1));
        assert!(opaque.coverage.is_empty());
        assert_eq!(opaque.part(0), Radiance::new(2, 1));
    }
}
