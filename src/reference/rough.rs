//! Determines which blocks of pixels get more samples: those in which neighbouring pixels differ visibly
//! after the first samples. On devices, `cl/common/mark_rough.cl` finds the blocks that get more samples.

use crate::image::Radiance;
use crate::manifest::{ROUGH_STEPS, SAMPLED_BLOCK};
use crate::scene::Display;

/// Returns the difference of neighbouring pixels above which a block is rough, in 8-bit steps. The pixels'
/// difference is computed after the first `first` samples per pixel.
pub fn rough_steps(first: u32) -> f64 {
    f64::from(ROUGH_STEPS) / f64::from(first).sqrt()
}

/// Returns an element for each block, row by row: the largest difference of neighbouring pixels in the block
/// and in the ring of pixels around the block. `means` contains the mean of each pixel's first samples.
/// Differences are computed with a gamma of 2, in 8-bit steps, so they nearly equal the displayed
/// differences. Differences of alpha count too if the background is transparent.
pub fn steps_of_blocks(means: &Radiance, display: Display) -> Vec<f64> {
    let [across, down] = [means.width, means.height].map(|side| side.div_ceil(SAMPLED_BLOCK));
    let blocks = (0..down).flat_map(|y| (0..across).map(move |x| [x, y].map(|at| at * SAMPLED_BLOCK)));
    blocks.map(|start| steps_of_block(means, display, start)).collect()
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
    use crate::scene::Tone;

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
        // With an exposure of 1/4, the white pixels are displayed as 127.5 of 255.
        assert_eq!(steps_of_blocks(&means, exposed(0.25)), [127.5]);
        // The filmic curve displays a channel of 1 as sqrt(2.54 / 3.16) of 255, and a channel of 40 as white.
        let filmic = steps_of_blocks(&means, Display { tone: Tone::Filmic, ..exposed(1.0) });
        assert!((filmic[0] - 255.0 * (1.0 - (2.54_f64 / 3.16).sqrt())).abs() < 1e-9, "{filmic:?}");
    }
}
