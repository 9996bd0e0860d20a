//! The display transform, from radiance to 8-bit pictures.

use super::Radiance;
use crate::scene::Display;
use image::{RgbImage, RgbaImage};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};

/// Converts an image to 8 bits: each channel with radiance L becomes `trunc(255 * tone(exposure * L)^(1/gamma))`,
/// evaluated in double precision. NaN and negative radiance become 0.
pub fn to_rgb8(image: &Radiance, display: Display) -> RgbImage {
    let shown = Shown::of(display);
    let mut picture = RgbImage::new(image.width, image.height);
    picture.par_chunks_mut(3 * TOGETHER).zip(image.pixels.par_chunks(TOGETHER)).for_each(
        |(bytes, pixels)| {
            let mut convert = shown.converter();
            for (bytes, radiance) in bytes.as_chunks_mut().0.iter_mut().zip(pixels) {
                *bytes = convert(*radiance);
            }
        },
    );
    picture
}

/// Converts an image to 8 bits with an alpha channel; returns `None` if the image has no coverage. A pixel's
/// colour is the colour of its covered part (straight alpha).
pub fn to_rgba8(image: &Radiance, display: Display) -> Option<RgbaImage> {
    if image.coverage.is_empty() {
        return None;
    }
    let shown = Shown::of(display);
    let pixel = |(radiance, coverage): (&[f32; 3], &f32)| {
        let covered = if *coverage > 0.0 { radiance.map(|channel| channel / coverage) } else { [0.0; 3] };
        let [red, green, blue] = shown.pixel(covered);
        [red, green, blue, (255.0 * coverage).round() as u8]
    };
    let bytes: Vec<[u8; 4]> = image.pixels.par_iter().zip(&image.coverage).map(pixel).collect();
    RgbaImage::from_raw(image.width, image.height, bytes.into_flattened())
}

/// Number of pixels that a thread converts to displayed values in one task.
pub const TOGETHER: usize = 1024;

/// The display transform (exposure, tone curve, gamma and conversion to 8 bits), as tables.
pub struct Shown(Thresholds);

impl Shown {
    /// Number of values that an 8-bit channel can have.
    pub const VALUES: usize = 256;
    /// Number of low bits of a radiance that the second table of [`Self::tables`] ignores.
    pub const INDEX_SHIFT: u32 = 14;

    /// Returns the tables for a scene's display settings. The function keeps the tables that it returned last, because
    /// the frames of a moving picture usually have the same settings, and new tables take longer than a small frame's
    /// conversion.
    pub fn of(display: Display) -> Arc<Self> {
        static LAST: Mutex<Option<(Display, Arc<Shown>)>> = Mutex::new(None);
        // The value is replaced as a whole, so a thread that panicked cannot have left half of it.
        let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some((of, shown)) if *of == display => Arc::clone(shown),
            _ => {
                let shown = Arc::new(Self(Thresholds::new(display)));
                *last = Some((display, Arc::clone(&shown)));
                shown
            }
        }
    }

    /// Returns the two tables of the display transform that devices read. The first table has, for each 8-bit
    /// value, the smallest radiance that is displayed as a greater value (NaN for 255). The second table has one
    /// element for each pattern of a radiance's upper bits: a lower bound of the 8-bit values of all radiances with
    /// these upper bits.
    pub fn tables(&self) -> (&[f32], &[u8]) {
        (&self.0.smallest, &self.0.at_least[..])
    }

    /// Returns the 8-bit channels with which a pixel is displayed.
    pub fn pixel(&self, radiance: [f32; 3]) -> [u8; 3] {
        radiance.map(|channel| self.0.value(channel))
    }

    /// Returns a function that converts the pixels of a picture one after another. Neighbouring pixels often have
    /// the same radiance, for example those of a plain background: the function then repeats its last result.
    pub fn converter(&self) -> impl FnMut([f32; 3]) -> [u8; 3] {
        let mut last = ([f32::NAN; 3], [0; 3]); // comparisons with NaN are false
        move |radiance| {
            if radiance != last.0 {
                last = (radiance, self.pixel(radiance));
            }
            last.1
        }
    }
}

/// Computes the display transform of one channel.
pub fn transform(radiance: f32, display: Display) -> u8 {
    let brightness = display.tone.apply(f64::from(display.exposure) * f64::from(radiance));
    (255.0 * brightness.powf(1.0 / f64::from(display.gamma))) as u8 // the cast truncates
}

/// The display transform of one channel, as tables. Without both tables, each channel of each pixel would need
/// a power or a binary search, which would take longer than writing the picture's file.
struct Thresholds {
    /// For each 8-bit value from 1 to 255, the smallest radiance that is shown as this or a greater value.
    /// The array's first element belongs to the value 1. The array's last element is NaN: comparisons with
    /// NaN are false, so that the search for a radiance's value ends at 255.
    smallest: [f32; Shown::VALUES],
    /// For each pattern of the upper 18 bits of a positive radiance, a lower bound of the 8-bit value.
    at_least: Box<[u8; ELEMENTS]>,
    /// If true, every lower bound in `at_least` is at most 1 below the 8-bit values of its radiances. With usual
    /// display settings, the field is true.
    one_step_suffices: bool,
}

/// Number of elements of [`Thresholds::at_least`]: one for each pattern of the upper bits of a radiance whose sign
/// bit is 0.
const ELEMENTS: usize = 1 << (31 - Shown::INDEX_SHIFT);

impl Thresholds {
    fn new(display: Display) -> Self {
        let mut thresholds = [f32::NAN; Shown::VALUES]; // comparisons with NaN are false
        for (value, threshold) in (1..=255).zip(&mut thresholds) {
            *threshold = smallest(value, display);
        }
        // The thresholds never fall, so each value fills `at_least` from its own threshold to the next value's
        // threshold.
        let mut at_least = Box::new([0; ELEMENTS]);
        let mut end = at_least.len();
        for (value, threshold) in (1..=255).zip(thresholds).rev() {
            let first = threshold.to_bits().div_ceil(1 << Shown::INDEX_SHIFT) as usize;
            at_least[first..end].fill(value);
            end = first;
        }
        // One step of the search for a radiance's value is enough if no two thresholds belong to the same element of
        // `at_least`.
        let elements: [u32; 255] =
            std::array::from_fn(|value| thresholds[value].to_bits() >> Shown::INDEX_SHIFT);
        Self { smallest: thresholds, at_least, one_step_suffices: elements.is_sorted_by(|a, b| a < b) }
    }

    fn value(&self, radiance: f32) -> u8 {
        // A radiance that is NaN or not positive is shown as black.
        let radiance = if radiance > 0.0 { radiance } else { 0.0 };
        // The mask changes nothing, since the sign is 0, but it tells the compiler that the index is small enough.
        let bound = self.at_least[(radiance.to_bits() >> Shown::INDEX_SHIFT) as usize & (ELEMENTS - 1)];
        // Whether the first step is needed differs from pixel to pixel, so a branch would often be predicted wrongly.
        let mut value = bound + u8::from(self.smallest[usize::from(bound)] <= radiance);
        while !self.one_step_suffices && self.smallest[usize::from(value)] <= radiance {
            value += 1;
        }
        value
    }
}

/// Returns the smallest radiance that is displayed as `value` or as a greater value. The bits of positive
/// floats are ordered like the floats, and the transform is monotonic, so a binary search over the bits finds
/// the smallest radiance.
fn smallest(value: u8, display: Display) -> f32 {
    let (mut below, mut reached) = (0, f32::INFINITY.to_bits());
    while reached - below > 1 {
        let middle = below + (reached - below) / 2;
        if transform(f32::from_bits(middle), display) >= value { reached = middle } else { below = middle }
    }
    f32::from_bits(reached)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        let plain = Display { exposure: 1.0, gamma: 1.0, ..Display::default() };
        let white = 1.0 / 15.0_f32;
        for (radiance, display, value) in [
            (0.5, plain, 127),
            (1.0, plain, 255),
            (0.999, plain, 254),
            (-1.0, plain, 0),
            (f32::NAN, plain, 0),
            (f32::INFINITY, plain, 255),
            (f32::NEG_INFINITY, plain, 0),
            (0.0, Display::default(), 0),
            (0.0022, Display::default(), 54), // 255 * 0.033^(1/2.2) = 54.1
            (0.01, Display::default(), 107),  // 255 * 0.15^(1/2.2) = 107.6
            (white * 1.001, Display::default(), 255),
        ] {
            let image = Radiance { width: 1, height: 1, pixels: vec![[radiance; 3]], coverage: Vec::new() };
            assert_eq!(to_rgb8(&image, display).into_raw(), [value; 3], "{radiance}");
        }
    }

    #[test]
    fn pixels_are_displayed_alike_whatever_their_neighbours_and_other_channels_are() {
        let channels = [0.0, 0.01, 0.05, f32::NAN, -1.0, f32::INFINITY];
        let three = |index: usize| [index / 36, index / 6 % 6, index % 6].map(|channel| channels[channel]);
        // Each pixel occurs twice in a row. Neighbours that differ often have the same red and green.
        let pixels: Vec<[f32; 3]> = (0..2 * 216).map(|index| three(index / 2)).collect();
        let expected: Vec<u8> =
            pixels.iter().flatten().map(|channel| transform(*channel, Display::default())).collect();
        let image = Radiance { width: 432, height: 1, pixels, coverage: Vec::new() };
        assert_eq!(to_rgb8(&image, Display::default()).into_raw(), expected);
    }

    #[test]
    fn each_display_has_its_own_tables() {
        let darker = Display { exposure: 1.0, ..Display::default() };
        for display in [Display::default(), darker, darker, Display::default()] {
            assert_eq!(Shown::of(display).pixel([0.01; 3]), [transform(0.01, display); 3], "{display:?}");
        }
    }

    #[test]
    fn a_partly_covered_pixel_has_the_colour_of_its_covered_part() {
        let plain = Display { exposure: 1.0, gamma: 1.0, ..Display::default() };
        let pixels = vec![[0.25, 0.125, 0.0], [0.25; 3]];
        let image = Radiance { width: 2, height: 1, pixels, coverage: vec![0.25, 0.0] };
        let shown = to_rgba8(&image, plain).map(RgbaImage::into_raw);
        assert_eq!(shown, Some(vec![255, 127, 0, 64, 0, 0, 0, 0]));
    }

    #[test]
    fn the_table_is_the_formula() {
        let of = |exposure, gamma| Display { exposure, gamma, ..Display::default() };
        for display in [Display::default(), of(0.7, 1.0), of(0.0, 2.2), of(1e30, 0.1), of(1e-30, 9.0)] {
            let thresholds = Thresholds::new(display);
            for step in 0..200_000 {
                let radiance = step as f32 * 1e-5 - 0.1;
                assert_eq!(thresholds.value(radiance), transform(radiance, display), "{radiance}");
            }
            for bits in (0..=u32::MAX).step_by(104_729) {
                let radiance = f32::from_bits(bits);
                assert_eq!(thresholds.value(radiance), transform(radiance, display), "{radiance}");
            }
        }
    }

    /// With the usual display settings, no two thresholds belong to the same element of `at_least`, so a search takes
    /// at most one step.
    #[test]
    fn with_the_usual_display_the_table_is_at_most_one_value_too_low() {
        let one_step_suffices = |display| Thresholds::new(display).one_step_suffices;
        assert!(one_step_suffices(Display::default()));
        assert!(!one_step_suffices(Display { gamma: 0.1, ..Display::default() }));
        assert!(!one_step_suffices(Display { exposure: 0.0, ..Display::default() }));
    }

    #[test]
    fn a_colour_of_eight_bits_is_displayed_unchanged() {
        let plain = Display { exposure: 1.0, gamma: 1.0, ..Display::default() };
        // With each exposure in the list `rounded`, 1 / exposure is rounded down in single precision, so the
        // radiance of white must be the next larger number.
        let rounded = [1e-5, 0.001, 0.01, 100.0].map(|exposure| Display { exposure, ..Display::default() });
        for display in [Display::default(), plain].into_iter().chain(rounded) {
            for value in 0..=255 {
                let radiance = display.radiance_of([value; 3]).to_array();
                assert_eq!(
                    radiance.map(|one| transform(one, display)),
                    [value; 3],
                    "{value} with {display:?}"
                );
            }
        }
    }
}
