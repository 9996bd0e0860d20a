//! Frames that cast several samples of each pixel: a pixel is divided into sub-pixels, each with a ray of its own.

use super::arguments::Arguments;
use super::setup::{Setup, sees_sky};
use crate::scene::Sample;
use crate::strategy::{Passes, Traversal};
use ocl::prm::Float16;

/// A pixel has at most 2^2 sub-pixels across and down: as many as a vector has rays.
const MOST_BITS: u32 = 2;
/// Rays across and down in a vector.
const SIDE: usize = 4;
/// A pixel's centre.
const CENTRE: f32 = 0.5;

/// Returns how many samples a frame can cast.
const fn room(bits: u32) -> usize {
    1 << (2 * bits)
}

/// Returns the smallest division of a pixel, as the logarithm of sub-pixels across, that has room for some samples.
fn bits_for(samples: usize) -> u32 {
    (0..MOST_BITS).find(|bits| samples <= room(*bits)).unwrap_or(MOST_BITS)
}

/// Returns how finely a frame of a strategy can divide pixels, as the logarithm of sub-pixels across: tiles of vectors
/// have a place for each ray. The picture of a sky is added by a kernel that knows only whole pixels.
pub(super) fn most_bits(setup: &Setup<'_>) -> u32 {
    let Setup { strategy, scene, .. } = setup;
    let vectors = strategy.traversal == Traversal::Tile && !strategy.shares_tiles();
    if vectors && strategy.passes == Passes::Fused && !sees_sky(scene) { MOST_BITS } else { 0 }
}

/// Divides a round's samples into frames that divide pixels as finely as `most_bits`, or less. Most sub-pixels of a frame
/// have a sample; the remaining samples are cast one by one.
pub(super) fn frames(samples: &[Sample], most_bits: u32) -> Vec<&[Sample]> {
    let Some(most) = (0..=most_bits).rev().map(room).find(|room| 3 * room <= 4 * samples.len()) else {
        return vec![];
    };
    let (frame, rest) = samples.split_at(most.min(samples.len()));
    [vec![frame], frames(rest, most_bits)].concat()
}

/// Sets which samples a frame casts, all of one round, and returns how finely it divides pixels. A single sample is at
/// the centre of pixels, since the camera is shifted for it.
pub(super) fn subpixel_arguments<'a>(arguments: Arguments<'a>, samples: &[Sample]) -> (Arguments<'a>, u32) {
    let bits = bits_for(samples.len());
    let place = |axis: usize| {
        let of_lane = |lane| samples.get(number_of_lane(bits, lane)).or(samples.first());
        let offset = |lane| of_lane(lane).filter(|_| bits > 0).map_or(0.0, |sample| sample.offset[axis]);
        Float16::from(std::array::from_fn::<f32, 16, _>(|lane| CENTRE + offset(lane)))
    };
    let arguments =
        arguments.with("subpixel_bits", bits).with("samples_of_frame", samples.len().max(1) as u32);
    (arguments.with("sample_x", place(0)).with("sample_y", place(1)), bits)
}

/// Returns the number in the frame of the sample that a lane casts. cl/tile_cpu/camera.cl has the same.
fn number_of_lane(bits: u32, lane: usize) -> usize {
    let last = (1 << bits) - 1;
    lane % SIDE & last | (lane / SIDE & last) << bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::pixel_samples;

    #[test]
    fn each_sample_of_a_frame_has_a_sub_pixel() {
        for (bits, expected) in [(0, 1), (1, 4), (2, 16)] {
            let mut numbers: Vec<_> = (0..16).map(|lane| number_of_lane(bits, lane)).collect();
            numbers.sort_unstable();
            numbers.dedup();
            assert_eq!(numbers, (0..expected).collect::<Vec<_>>());
        }
        // The lanes of a pixel are next to each other.
        assert_eq!([0, 1, 4, 5].map(|lane| number_of_lane(1, lane)), [0, 1, 2, 3]);
        assert_eq!([1, 2, 3, 4, 5, 16, 17].map(bits_for), [0, 1, 1, 1, 2, 2, 2]);
    }

    #[test]
    fn most_sub_pixels_of_a_frame_have_a_sample() {
        let lengths = |count| {
            let samples = pixel_samples(count);
            frames(&samples, MOST_BITS).into_iter().map(<[_]>::len).collect::<Vec<_>>()
        };
        assert_eq!(lengths(2), [1, 1]);
        assert_eq!((lengths(3), lengths(4), lengths(6)), (vec![3], vec![4], vec![4, 1, 1]));
        assert_eq!((lengths(11), lengths(12), lengths(14)), (vec![4, 4, 3], vec![12], vec![14]));
        assert_eq!(lengths(64), [16; 4]);
    }

    #[test]
    fn frames_cast_every_sample_once() {
        for count in [1, 2, 4, 5, 16, 17, 64] {
            let samples = pixel_samples(count);
            let cast: Vec<_> = frames(&samples, MOST_BITS).into_iter().flatten().copied().collect();
            assert_eq!(cast, samples);
            assert!(frames(&samples, 0).iter().all(|frame| frame.len() == 1));
        }
    }
}
