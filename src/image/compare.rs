//! Computes how much two pictures differ, as a number and as a picture.

use super::{Radiance, colour};
use crate::scene::Display;
use image::{Rgb, RgbImage};

/// Two radiances count as equal if their relative difference is at most this limit.
pub const RELATIVE_LIMIT: f64 = 1e-3;

/// Returns the smallest radiance by which differences are divided. If a pixel is darker than the returned
/// radiance, its differences are divided by the returned radiance, not by the pixel's own radiance. The
/// returned radiance is a thousandth of the image's brightest channel or of 1 / exposure, whichever is less.
/// The tone curve `clip` displays a radiance of 1 / exposure as white. The returned radiance is never below the
/// smallest normal f32.
pub fn dark_floor(image: &Radiance, display: Display) -> f64 {
    let white = 1.0 / f64::from(display.exposure);
    let visible = if white > 0.0 { brightest(image).min(white) } else { brightest(image) };
    floor_below(visible)
}

fn floor_below(visible: f64) -> f64 {
    (1e-3 * visible).max(f64::from(f32::MIN_POSITIVE))
}

fn brightest(image: &Radiance) -> f64 {
    image.pixels.iter().map(|pixel| brightness(*pixel)).fold(0.0, f64::max)
}

/// Returns the relative difference of two pixels: the largest difference of a channel, divided by the
/// expected pixel's brightest channel or by `floor`, whichever is greater. The result is infinite if the
/// difference of a channel is not finite.
pub fn relative_difference(actual: [f32; 3], expected: [f32; 3], floor: f64) -> f64 {
    let apart = |channel: usize| (f64::from(actual[channel]) - f64::from(expected[channel])).abs();
    let largest = [0, 1, 2].map(apart).into_iter().fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a });
    if largest.is_finite() { largest / brightness(expected).max(floor) } else { f64::INFINITY }
}

/// Returns the difference between the alphas of two pixels, or infinity if an alpha is NaN. Returns 0 if either
/// pixel has no alpha.
pub fn alpha_difference(actual: Option<&f32>, expected: Option<&f32>) -> f64 {
    let (Some(actual), Some(expected)) = (actual, expected) else { return 0.0 };
    let apart = (f64::from(*actual) - f64::from(*expected)).abs();
    if apart.is_nan() { f64::INFINITY } else { apart }
}

fn brightness(pixel: [f32; 3]) -> f64 {
    pixel.into_iter().map(|channel| f64::from(channel.abs())).fold(0.0, f64::max)
}

/// Returns the peak signal-to-noise ratio of two pictures in decibels: infinite for equal pictures, NaN for
/// pictures of different sizes.
pub fn psnr_db(a: &RgbImage, b: &RgbImage) -> f64 {
    if a.dimensions() != b.dimensions() {
        return f64::NAN;
    }
    let square = |(a, b): (&u8, &u8)| f64::from(a.abs_diff(*b)).powi(2);
    let total: f64 = a.as_raw().iter().zip(b.as_raw()).map(square).sum();
    if total == 0.0 {
        return f64::INFINITY;
    }
    10.0 * (255.0 * 255.0 * a.as_raw().len() as f64 / total).log10()
}

/// Returns a picture of the differences between `actual` and `expected`, in false colours with a scale below.
/// A pixel's difference is the larger of [`relative_difference`] and, if both pictures have alpha, the
/// difference of alpha. The scale is logarithmic, from 1e-6 (dark) to 1 (bright). Pixels with a difference
/// below 1e-6 are black. A pixel is red if one of the compared values is not finite, or if only one of
/// the two pictures has this pixel.
pub fn difference_image(actual: &Radiance, expected: &Radiance) -> RgbImage {
    let floor = floor_below(brightest(expected));
    let (width, height) = (actual.width.max(expected.width), actual.height.max(expected.height));
    let mut picture = RgbImage::new(width, height + colour::SCALE_HEIGHT);
    for (x, y, out) in picture.enumerate_pixels_mut().filter(|(_, y, _)| *y < height) {
        *out = match (pixel_index(actual, x, y), pixel_index(expected, x, y)) {
            (Some(a), Some(b)) => {
                let alpha = alpha_difference(actual.coverage.get(a), expected.coverage.get(b));
                let colours = relative_difference(actual.pixels[a], expected.pixels[b], floor);
                colour::of_difference(colours.max(alpha))
            }
            _ => Rgb(colour::WRONG),
        };
    }
    colour::draw_scale(&mut picture, height);
    picture
}

/// Returns the index of the pixel at column `x` and row `y`; `None` if the image has no such pixel.
fn pixel_index(image: &Radiance, x: u32, y: u32) -> Option<usize> {
    let inside = x < image.width && y < image.height;
    let index = y as usize * image.width as usize + x as usize;
    (inside && index < image.pixels.len()).then_some(index)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: f32) -> Radiance {
        Radiance { pixels: vec![[value; 3]; 12], ..Radiance::new(4, 3) }
    }

    #[test]
    fn psnr_of_equal_shifted_and_unlike_pictures() {
        let picture = |value, width| RgbImage::from_pixel(width, 2, Rgb([value; 3]));
        assert_eq!(psnr_db(&picture(7, 2), &picture(7, 2)), f64::INFINITY);
        assert!((psnr_db(&picture(7, 2), &picture(8, 2)) - 48.1308).abs() < 1e-4);
        assert_eq!(psnr_db(&picture(0, 2), &picture(255, 2)), 0.0);
        assert!(psnr_db(&picture(7, 2), &picture(7, 3)).is_nan());
    }

    #[test]
    fn differences_are_relative_to_brightness_or_to_the_floor() {
        let close = |actual: f64, expected: f64| (actual - expected).abs() < 1e-6;
        assert!(close(relative_difference([1.0, 0.0, 0.5], [2.0, 0.0, 0.5], 0.1), 0.5));
        assert!(close(relative_difference([0.01, 0.0, 0.0], [0.0, 0.0, 0.0], 0.1), 0.1));
        assert_eq!(relative_difference([f32::NAN, 0.0, 9.0], [0.0; 3], 0.1), f64::INFINITY);
        assert_eq!(relative_difference([0.0; 3], [f32::INFINITY, 0.0, 0.0], 0.1), f64::INFINITY);
    }

    #[test]
    fn the_floor_ignores_what_the_display_shows_as_white_anyway() {
        let dim = dark_floor(&flat(0.01), Display::default());
        let glare = dark_floor(&flat(1e6), Display::default());
        assert!((dim - 1e-5).abs() < 1e-9 && (glare - 1e-3 / 15.0).abs() < 1e-9);
        assert!(dark_floor(&flat(0.0), Display::default()) > 0.0);
    }

    #[test]
    fn differences_brighten_from_black_and_wrong_is_red() {
        let (mut actual, expected) = (flat(1.0), flat(1.0));
        actual.pixels[1] = [1.0001; 3];
        actual.pixels[2] = [1.5; 3];
        actual.pixels[3] = [f32::NAN; 3];
        let picture = difference_image(&actual, &expected);
        let light = |x| picture.get_pixel(x, 0).0.iter().map(|c| u32::from(*c)).sum::<u32>();
        assert_eq!(light(0), 0);
        assert!(light(0) < light(1) && light(1) < light(2));
        assert_eq!(picture.get_pixel(3, 0).0, colour::WRONG);
        assert_eq!(picture.height(), 3 + colour::SCALE_HEIGHT);
    }

    #[test]
    fn a_difference_of_alpha_counts_where_both_pictures_have_alpha() {
        let with = |alpha: f32| Radiance { coverage: vec![alpha; 12], ..flat(0.0) };
        let first =
            |actual: &Radiance, expected: &Radiance| *difference_image(actual, expected).get_pixel(0, 0);
        assert_eq!(first(&with(0.25), &with(0.5)), colour::of_difference(0.25));
        assert_eq!(first(&with(f32::NAN), &with(0.5)).0, colour::WRONG);
        assert_eq!(
            [first(&with(0.5), &with(0.5)), first(&with(0.5), &flat(0.0))].map(|pixel| pixel.0),
            [[0; 3]; 2]
        );
    }

    #[test]
    fn one_bright_pixel_that_is_wrong_does_not_darken_the_others() {
        let mut expected = flat(1.0);
        expected.pixels[0] = [0.0; 3];
        let mut actual = expected.clone();
        (actual.pixels[0], actual.pixels[1]) = ([1e-3; 3], [1e6; 3]);
        let picture = difference_image(&actual, &expected);
        // The first pixel should be black, and differs by a thousandth of the brightest expected pixel. The
        // difference of a dark pixel is divided by this same thousandth, so the relative difference is 1.
        assert_eq!(*picture.get_pixel(0, 0), colour::of_difference(1.0));
    }

    #[test]
    fn pictures_of_different_sizes_differ_where_one_is_missing() {
        let small = Radiance { pixels: vec![[1.0; 3]; 6], ..Radiance::new(2, 3) };
        let picture = difference_image(&small, &flat(1.0));
        assert_eq!([(2, 0), (3, 2)].map(|(x, y)| picture.get_pixel(x, y).0), [colour::WRONG; 2]);
    }

    #[test]
    fn each_difference_stands_at_its_own_pixel() {
        let (mut actual, expected) = (flat(1.0), flat(1.0));
        actual.pixels[2 * 4 + 1] = [1.5; 3];
        let picture = difference_image(&actual, &expected);
        let above_the_scale = picture.enumerate_pixels().filter(|(_, y, _)| *y < 3);
        let different = above_the_scale.filter(|(.., pixel)| pixel.0 != [0; 3]).map(|(x, y, _)| (x, y));
        assert_eq!(different.collect::<Vec<_>>(), [(1, 2)]);
    }
}
