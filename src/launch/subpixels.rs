//! Frames that cast several samples of each pixel: a pixel is divided into sub-pixels, each with a ray of its own.

use super::arguments::Arguments;
use super::setup::{Setup, sees_sky};
use crate::manifest::SAMPLED_BLOCK;
use crate::scene::Sample;
use crate::strategy::{MOST_SUBPIXEL_BITS as MOST_BITS, Passes};
use ocl::prm::Float16;

/// The rays of a vector form a square of `SIDE` x `SIDE` rays.
const SIDE: usize = 4;
/// The centre of a pixel, as a fraction of the pixel's width and height.
const CENTRE: f32 = 0.5;

/// Returns how many samples of a pixel a frame can cast with 2^`bits` sub-pixels across and down.
const fn room(bits: u32) -> usize {
    1 << (2 * bits)
}

/// Returns the binary logarithm of the number of sub-pixels across a pixel. A pixel is divided into the fewest
/// sub-pixels that suffice for `samples` samples, but into at most 2^`MOST_BITS` sub-pixels across.
fn bits_for(samples: usize) -> u32 {
    (0..MOST_BITS).find(|bits| samples <= room(*bits)).unwrap_or(MOST_BITS)
}

/// Returns how finely a frame of a strategy can divide pixels, as the binary logarithm of the number of sub-pixels
/// across. Only strategies with `traversal = tile` can cast several rays of one pixel in a frame. If each work-item
/// casts the rays of a tile of its own (`cl/tile_cpu/`), pixels are divided only with fused passes (one kernel casts
/// primary and shadow rays). If the sky's picture is seen, pixels are not divided, since the kernel that adds the
/// picture supports only whole pixels.
pub(super) fn most_bits(setup: &Setup<'_>) -> u32 {
    let Setup { strategy, scene, workload, .. } = setup;
    if strategy.shares_tiles() {
        return workload.shared_subpixel_bits(strategy);
    }
    let vectors = strategy.traversal.casts_tiles();
    if vectors && strategy.passes == Passes::Fused && !sees_sky(scene) { MOST_BITS } else { 0 }
}

/// Returns the number of tiles in a block of pixels; `None` if a block does not consist of whole tiles.
/// `tile` is the number of rays in a tile, across and down. Each pixel has 2^`bits` rays across and down.
pub(super) fn tiles_of_block(tile: [usize; 2], bits: u32) -> Option<usize> {
    let side = (SAMPLED_BLOCK as usize) << bits;
    let fits = tile.iter().all(|rays| side.is_multiple_of(*rays));
    fits.then(|| tile.iter().map(|rays| side / rays).product())
}

/// Distributes the samples of one round of samples (the first samples of every pixel, or the later samples)
/// over frames. A frame divides a pixel into at most 2^`most_bits` sub-pixels across. At least three quarters
/// of a frame's sub-pixels have a sample. If the remaining samples fill less than three quarters of a frame's
/// sub-pixels, they are cast in frames with fewer sub-pixels per pixel.
pub(super) fn frames(mut samples: &[Sample], most_bits: u32) -> impl Iterator<Item = &[Sample]> {
    std::iter::from_fn(move || {
        let room = (0..=most_bits).rev().map(room).find(|room| 3 * room <= 4 * samples.len())?;
        let (frame, rest) = samples.split_at(room.min(samples.len()));
        samples = rest;
        Some(frame)
    })
}

/// Adds a frame's samples to the frame's arguments. Also returns how finely the frame divides pixels, as the
/// binary logarithm of the number of sub-pixels across. All samples belong to one round (the first samples of
/// every pixel, or the later ones). A single sample is placed at the centre of its pixel, because the camera
/// is shifted by the sample's offset instead.
pub(super) fn subpixel_arguments<'a>(arguments: Arguments<'a>, samples: &[Sample]) -> (Arguments<'a>, u32) {
    let bits = bits_for(samples.len());
    let coordinates = |axis: usize| {
        let of_lane = |lane| position_of(samples, number_of_lane(bits, lane))[axis];
        Float16::from(std::array::from_fn::<f32, 16, _>(of_lane))
    };
    let arguments =
        arguments.with("subpixel_bits", bits).with("samples_of_frame", samples.len().max(1) as u32);
    (arguments.with("sample_x", coordinates(0)).with("sample_y", coordinates(1)), bits)
}

/// Returns the position, within its pixel, of the sample `number` of a frame. A sub-pixel without a sample gets
/// the position of the first sample. If the frame has only one sample, the position is the pixel's centre.
fn position_of(samples: &[Sample], number: usize) -> [f32; 2] {
    let sample = samples.get(number).or(samples.first()).filter(|_| samples.len() > 1);
    sample.map_or([CENTRE; 2], |sample| sample.offset.map(|offset| CENTRE + offset))
}

/// Returns x and y of each sample's position within its pixel. The list always has as many positions as a
/// frame can have samples; [`position_of`] defines the positions after the last sample.
pub(super) fn positions(samples: &[Sample]) -> Vec<f32> {
    (0..room(MOST_BITS)).flat_map(|number| position_of(samples, number)).collect()
}

/// Returns the index of the sample that a lane casts, among the samples of the frame. cl/tile_cpu/camera.cl has the
/// same function.
fn number_of_lane(bits: u32, lane: usize) -> usize {
    let last = (1 << bits) - 1;
    ((lane % SIDE) & last) | ((lane / SIDE) & last) << bits
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::{Device, discover};
    use crate::image::Radiance;
    use crate::launch::{Caster, Session};
    use crate::program::Sources;
    use crate::scene::{Sampling, Scene, load_scene, pixel_samples};
    use crate::strategy::preset;
    use std::path::Path;
    use std::sync::Arc;

    /// The pictures' width and height, which are not multiples of the side of a block of pixels.
    const SIZE: [u32; 2] = [75, 61];

    #[test]
    fn each_sample_of_a_frame_has_a_sub_pixel() {
        for (bits, expected) in [(0, 1), (1, 4), (2, 16)] {
            let mut numbers: Vec<_> = (0..16).map(|lane| number_of_lane(bits, lane)).collect();
            numbers.sort_unstable();
            numbers.dedup();
            assert_eq!(numbers, (0..expected).collect::<Vec<_>>());
        }
        // The lanes of a vector are numbered row by row in a square of 4 x 4 lanes. Lanes 0, 1, 4 and 5 cast the four
        // samples of one pixel.
        assert_eq!([0, 1, 4, 5].map(|lane| number_of_lane(1, lane)), [0, 1, 2, 3]);
        assert_eq!([1, 2, 3, 4, 5, 16, 17].map(bits_for), [0, 1, 1, 1, 2, 2, 2]);
    }

    #[test]
    fn tiles_are_listed_if_they_fit_into_blocks() {
        let tiles = |tile| [0, 1, 2].map(|bits| tiles_of_block(tile, bits));
        assert_eq!(tiles([8, 8]), [None, Some(1), Some(4)]);
        assert_eq!(tiles([16, 8]), [None, None, Some(2)]);
        assert_eq!(tiles([16, 16]), [None, None, Some(1)]);
    }

    #[test]
    fn most_sub_pixels_of_a_frame_have_a_sample() {
        let lengths = |count| {
            let samples = pixel_samples(count);
            frames(&samples, MOST_BITS).map(<[_]>::len).collect::<Vec<_>>()
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
            let cast: Vec<_> = frames(&samples, MOST_BITS).flatten().copied().collect();
            assert_eq!(cast, samples);
            assert!(frames(&samples, 0).all(|frame| frame.len() == 1));
        }
    }

    /// Prepares the preset named `tiles` for `count` samples per pixel, and calls `cast` to cast a picture of
    /// `scene`. Returns the picture and its number of hits.
    fn picture(
        device: &Device,
        scene: &Arc<Scene>,
        (tiles, count): (&str, u32),
        cast: impl Fn(&Caster, &Scene),
    ) -> (Radiance, usize) {
        let session = Session::open(device, &Sources::Embedded, Arc::clone(scene)).unwrap();
        let strategy = preset(tiles).unwrap().strategy;
        let local_size = strategy.local_size(&device.info.limits, [1, 1]);
        let prepared = session.with_sampling(Sampling::all(count)).prepare(&strategy, SIZE, local_size);
        let caster = prepared.map_err(|refused| refused.reason()).unwrap().caster();
        let caster = caster.map_err(|refused| refused.reason()).unwrap();
        cast(&caster, scene);
        caster.read().unwrap()
    }

    /// Casting samples together or one by one rounds their rays differently, so a sample on an edge may hit
    /// another triangle.
    #[test]
    fn samples_cast_together_are_those_cast_one_by_one() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let pixels = (SIZE[0] * SIZE[1]) as usize;
        // PoCL takes half a minute to compile the kernels of `tile-group`, so this preset is tested with only
        // one number of samples. 19 samples of a pixel are cast in two frames: 16 in the first frame, and 3
        // in the second.
        let all: [(&str, &str, &[u32]); 3] = [
            ("tile", "scenes/still-life.toml", &[3, 16, 19]),
            ("tile", "scenes/table.toml", &[4, 12, 16]),
            ("tile-group", "scenes/still-life.toml", &[19]),
        ];
        for (tiles, name, counts) in all {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
            let scene = Arc::new(load_scene(&path).unwrap().scene);
            for &count in counts {
                let together = picture(&device, &scene, (tiles, count), |caster, scene| {
                    caster.cast_samples(&scene.camera, &Sampling::all(count)).unwrap();
                });
                let singly = picture(&device, &scene, (tiles, count), |caster, scene| {
                    for sample in pixel_samples(count) {
                        caster.cast_sample(&scene.camera, &sample).unwrap();
                    }
                });
                let apart = |(a, b): (&[f32; 3], &[f32; 3])| {
                    (0..3).any(|channel| {
                        (a[channel] - b[channel]).abs() > 1e-3 * (a[channel] + b[channel]) + 1e-6
                    })
                };
                let different =
                    together.0.pixels.iter().zip(&singly.0.pixels).filter(|pair| apart(*pair)).count();
                assert!(
                    different * 200 < pixels,
                    "{name}, {count} samples: {different} of {pixels} pixels differ"
                );
                assert!(
                    together.1.abs_diff(singly.1) * 1000 < pixels,
                    "{} and {} hits",
                    together.1,
                    singly.1
                );
            }
        }
    }
}
