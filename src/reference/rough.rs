//! Determines which blocks of pixels are rough. In a rough block, neighbouring pixels differ visibly after
//! the first samples, so the block gets more samples. On devices, `cl/common/mark_rough.cl` finds rough
//! blocks.

use super::{Reference, some_pixels};
use crate::image::{RELATIVE_LIMIT, Radiance};
use crate::manifest::{ROUGH_STEPS, SAMPLED_BLOCK};
use crate::scene::Display;
use rayon::prelude::*;

/// The number of pixels of a block and of the ring of pixels around it.
const WINDOW_PIXELS: usize = (SAMPLED_BLOCK as usize + 2).pow(2);

/// Returns the pixels of some blocks, and of the rings of pixels around these blocks, in ascending order: about `some`
/// pixels of a picture of `size = [width, height]`. The blocks are chosen at random, but every call with the same
/// arguments chooses the same blocks.
pub fn pixels_of_some_blocks(size: [u32; 2], some: usize) -> Vec<usize> {
    let starts: Vec<_> = block_starts(size).collect();
    let blocks = some_pixels(size.map(|side| side.div_ceil(SAMPLED_BLOCK)), some.div_ceil(WINDOW_PIXELS));
    let windows = blocks.into_iter().flat_map(|block| window(size, starts[block]));
    let mut pixels: Vec<usize> = windows.collect();
    pixels.sort_unstable();
    pixels.dedup();
    pixels
}

/// Returns the blocks whose roughness does not depend on rounding: the column and row of each block's first pixel, and
/// true if the block is rough. `means` contains, for each pixel, the mean of its first samples; `first` is the number
/// of these samples. A block is left out if the largest difference of its neighbouring pixels is close to the
/// limit [`rough_steps`], or if a pixel of the block or of the ring around the block is not certain. Pixels that were
/// not cast are not certain.
pub fn certain_blocks(means: &Reference, display: Display, first: u32) -> Vec<([u32; 2], bool)> {
    let size = [means.radiance.width, means.radiance.height];
    let limit = rough_steps(first);
    // The radiance of a certain pixel may be off by the fraction `RELATIVE_LIMIT` of itself. With a gamma of 2, the
    // displayed value is then off by at most half of this fraction of itself, and the difference of two displayed
    // values by at most this fraction of the largest value, 255.
    let close = 0.01 * limit + 255.0 * RELATIVE_LIMIT;
    let starts: Vec<_> = block_starts(size).collect();
    let judged = |start: &[u32; 2]| {
        let steps = window(size, *start)
            .all(|pixel| means.certain[pixel])
            .then(|| steps_of_block(&means.radiance, display, *start))?;
        ((steps - limit).abs() > close).then_some((*start, steps > limit))
    };
    starts.par_iter().filter_map(judged).collect()
}

/// Returns the difference of neighbouring pixels above which a block is rough, in 8-bit steps. The pixels'
/// difference is computed after `first` samples per pixel.
pub fn rough_steps(first: u32) -> f64 {
    f64::from(ROUGH_STEPS) / f64::from(first).sqrt()
}

/// Returns an element for each block, row by row: the largest difference of neighbouring pixels in the block
/// and in the ring of pixels around the block. `means` contains the mean of each pixel's first samples.
/// Differences are computed with a gamma of 2, in 8-bit steps, so they nearly equal the displayed
/// differences. Differences of alpha count too if the background is transparent.
pub fn steps_of_blocks(means: &Radiance, display: Display) -> Vec<f64> {
    let starts = block_starts([means.width, means.height]);
    starts.map(|start| steps_of_block(means, display, start)).collect()
}

/// Returns the column and row of the first pixel of each block, row by row.
fn block_starts(size: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let [across, down] = size.map(|side| side.div_ceil(SAMPLED_BLOCK));
    (0..down).flat_map(move |y| (0..across).map(move |x| [x, y].map(|at| at * SAMPLED_BLOCK)))
}

/// Returns the pixels of the block that starts at `start`, and of the ring of pixels around it, as far as they lie in
/// the picture.
fn window(size: [u32; 2], start: [u32; 2]) -> impl Iterator<Item = usize> {
    let [xs, ys] =
        [0, 1].map(|axis| start[axis].saturating_sub(1)..(start[axis] + SAMPLED_BLOCK + 1).min(size[axis]));
    ys.flat_map(move |y| xs.clone().map(move |x| y as usize * size[0] as usize + x as usize))
}

fn steps_of_block(means: &Radiance, display: Display, start: [u32; 2]) -> f64 {
    let [xs, ys] = start.map(|first| i64::from(first) - 1..=i64::from(first + SAMPLED_BLOCK));
    let pixels = ys.clone().flat_map(|y| xs.clone().map(move |x| [x, y]));
    let shown = |[x, y]: [i64; 2]| displayed(means, display, [x, y]);
    let steps = pixels.flat_map(|[x, y]| {
        let beside = [(x > *xs.start()).then(|| [x - 1, y]), (y > *ys.start()).then(|| [x, y - 1])];
        beside.into_iter().flatten().map(move |other| largest_difference(shown([x, y]), shown(other)))
    });
    steps.fold(0.0, f64::max)
}

/// Returns a pixel's displayed red, green and blue, then its alpha, each from 0 to 255. Without a transparent
/// background, alpha is 0. For a position outside the image, returns the values of the nearest pixel.
fn displayed(means: &Radiance, display: Display, [x, y]: [i64; 2]) -> [f64; 4] {
    let inside = |at: i64, side: u32| at.clamp(0, i64::from(side) - 1) as usize;
    let index = inside(y, means.height) * means.width as usize + inside(x, means.width);
    let exposed = |channel: f32| f64::from(display.exposure) * f64::from(channel);
    let shown = |channel: f32| 255.0 * display.tone.apply(exposed(channel)).sqrt();
    let [red, green, blue] = means.pixels[index].map(shown);
    [red, green, blue, 255.0 * means.coverage.get(index).map_or(0.0, |alpha| f64::from(*alpha))]
}

fn largest_difference(a: [f64; 4], b: [f64; 4]) -> f64 {
    a.into_iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{fixtures, reference};
    use crate::scene::Tone;
    use crate::strategy::Culling;

    fn exposed(exposure: f32) -> Display {
        Display { exposure, ..Display::default() }
    }

    #[test]
    fn a_pixel_that_differs_is_in_its_block_and_in_those_that_it_touches() {
        // Blocks have 4 x 4 pixels: on both axes, pixel 3 is the last pixel of the first block, and pixel 4
        // is the first pixel of the second block.
        for at in [3, 4] {
            let mut means = Radiance::new(13, 9);
            means.pixels[at * 13 + at] = [0.0, 0.25 / 15.0, 0.0];
            let steps = steps_of_blocks(&means, exposed(15.0));
            let rough: Vec<bool> = steps.iter().map(|steps| (steps - 127.5).abs() < 1e-3).collect();
            let expected = [[true, true, false, false], [true, true, false, false], [false; 4]];
            assert_eq!(rough, expected.concat(), "{at}: {steps:?}");
        }
    }

    /// A certain pixel may be off by a thousandth, so blocks whose difference is close to the limit are left out.
    #[test]
    fn a_block_is_certain_if_its_pixels_are_and_its_difference_is_not_close_to_the_limit() {
        let black = reference(&fixtures::single_triangle(), [8, 4], Culling::None);
        let at = |steps: f32, is_certain: bool| {
            let mut means = black.clone();
            means.radiance.pixels.fill([0.0; 3]);
            means.radiance.pixels[0] = [(steps / 255.0).powi(2); 3];
            means.certain.fill(true);
            means.certain[4] = is_certain; // the first pixel to the right of the first block
            certain_blocks(&means, exposed(1.0), 1)
        };
        let (first, second) = ([0, 0], [4, 0]);
        assert_eq!(at(29.0, true), [(first, false), (second, false)]);
        assert_eq!(at(31.0, true), [(first, true), (second, false)]);
        for close in [29.6, 30.4] {
            assert_eq!(at(close, true), [(second, false)], "{close}");
        }
        assert!(at(31.0, false).is_empty());
    }

    #[test]
    fn some_blocks_have_about_as_many_pixels_as_asked_for() {
        // A picture of 13 x 9 pixels has 4 x 3 blocks.
        assert_eq!(pixels_of_some_blocks([13, 9], 12 * 36), (0..13 * 9).collect::<Vec<_>>());
        let three = pixels_of_some_blocks([1300, 900], 3 * 36);
        assert!((3 * 25..=3 * 36).contains(&three.len()) && three.is_sorted(), "{three:?}");
        // The middle 4 x 4 pixels of a window are a block.
        assert_eq!(window([13, 9], [4, 4]).count(), 6 * 6);
        assert!(window([13, 9], [12, 8]).eq([7 * 13 + 11, 7 * 13 + 12, 8 * 13 + 11, 8 * 13 + 12]));
    }

    #[test]
    fn a_dark_pixel_differs_from_a_transparent_background_in_alpha() {
        let mut means = Radiance::new(4, 4);
        assert_eq!(steps_of_blocks(&means, exposed(1.0)), [0.0]);
        means.coverage = vec![0.0; 16];
        means.coverage[5] = 0.5;
        assert_eq!(steps_of_blocks(&means, exposed(1.0)), [127.5]);
    }

    #[test]
    fn pixels_that_are_all_displayed_as_white_do_not_differ() {
        let mut means = Radiance::new(4, 4);
        means.pixels.fill([1.0; 3]);
        means.pixels[5] = [40.0, 2.0, 1.0];
        assert_eq!(steps_of_blocks(&means, exposed(1.0)), [0.0]);
        // With an exposure of 1/4, a channel of 1 is displayed as 127.5, and a channel of 40 as white (255).
        assert_eq!(steps_of_blocks(&means, exposed(0.25)), [127.5]);
        // The filmic curve displays a channel of 1 as 255 * sqrt(2.54 / 3.16), and a channel of 40 as white.
        let filmic = steps_of_blocks(&means, Display { tone: Tone::Filmic, ..exposed(1.0) });
        assert!((filmic[0] - 255.0 * (1.0 - (2.54_f64 / 3.16).sqrt())).abs() < 1e-9, "{filmic:?}");
    }
}
