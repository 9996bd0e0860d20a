//! Whether an image is right: fast but wrong never enters the results.
//!
//! Pixels the [`Reference`] is certain of agree within [`RELATIVE_LIMIT`] (see
//! [`relative_difference`] for what it is relative to) and within 1 in 8 bits as displayed.
//! Uncertain ones, where rounding may rightly decide, only have to be few and finite.

use crate::image::{RELATIVE_LIMIT, Radiance, relative_difference, to_rgb8};
use crate::reference::Reference;
use crate::scene::Display;

/// How far two certain pixels may be apart as displayed.
const STEPS_OF_256: u8 = 1;

/// What comparing an image with its reference found.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The largest relative difference over certain pixels; infinite where one is not a number.
    pub max_difference: f64,
    /// Where it is, as column and row; where any pixel is wrong, the worst of those.
    pub worst_pixel: Option<[u32; 2]>,
    /// Pixels the reference is not certain of.
    pub uncertain_pixels: usize,
    /// Certain pixels that disagree, and pixels that are not finite.
    pub wrong_pixels: usize,
    /// Whether the image is right.
    pub ok: bool,
    /// Why it is not, in a sentence.
    pub reason: Option<String>,
}

/// Judges an image of the scene, size and culling that `reference` is of.
pub fn verify(image: &Radiance, reference: &Reference, display: Display) -> Verdict {
    let uncertain_pixels = reference.certain.iter().filter(|certain| !**certain).count();
    let expected = &reference.radiance;
    let same_size = (image.width, image.height) == (expected.width, expected.height);
    if !same_size || image.pixels.len() != expected.pixels.len() {
        return refuse(uncertain_pixels, image.pixels.len(), sizes_differ(image, expected));
    }
    let findings = findings(image, reference, display);
    let worst = findings.iter().fold(None, |worst: Option<&Finding>, f| match worst {
        Some(w) if (w.wrong, w.difference) >= (f.wrong, f.difference) => Some(w),
        _ => Some(f),
    });
    let wrong_pixels = findings.iter().filter(|finding| finding.wrong).count();
    let reason = match worst {
        Some(finding) if finding.wrong => Some(finding.sentence(wrong_pixels)),
        _ => too_many_uncertain(uncertain_pixels, expected),
    };
    Verdict {
        max_difference: findings.iter().map(|finding| finding.difference).fold(0.0, f64::max),
        worst_pixel: worst.map(|finding| finding.pixel),
        uncertain_pixels,
        wrong_pixels,
        ok: reason.is_none(),
        reason,
    }
}

/// How many pixels may be uncertain: a hundredth of the image, or in an image too small for that,
/// one row and one column. So many centres an upright and a level outline can pass through exactly,
/// as they do in symmetrical scenes at odd sizes; other outlines pass through far fewer.
pub fn uncertain_limit(width: u32, height: u32) -> usize {
    let (width, height) = (width as usize, height as usize);
    (width * height / 100).max(width + height)
}

/// A pixel that was compared.
struct Finding {
    pixel: [u32; 2],
    difference: f64,
    wrong: bool,
    found: [f32; 3],
    expected: [f32; 3],
    /// As displayed: found, expected.
    shown: [[u8; 3]; 2],
}

impl Finding {
    fn sentence(&self, wrong_pixels: usize) -> String {
        let [x, y] = self.pixel;
        let (found, expected, shown) = (self.found, self.expected, self.shown);
        let what = if !found.iter().all(|channel| channel.is_finite()) {
            "is not finite".to_string()
        } else {
            format!("differs by {:.2e} relative", self.difference)
        };
        format!(
            "{wrong_pixels} pixels are wrong; the worst, ({x}, {y}), {what}: it is {found:?} and should be \
             {expected:?} (in 8 bits {:?} and {:?})",
            shown[0], shown[1]
        )
    }
}

/// All certain pixels that differ, and all pixels that are not finite.
fn findings(image: &Radiance, reference: &Reference, display: Display) -> Vec<Finding> {
    let shown = [to_rgb8(image, display), to_rgb8(&reference.radiance, display)];
    let pairs = image.pixels.iter().zip(&reference.radiance.pixels).zip(&reference.certain);
    pairs
        .enumerate()
        .filter_map(|(index, ((found, expected), certain))| {
            let finite = found.iter().all(|channel| channel.is_finite());
            if finite && (!certain || found == expected) {
                return None;
            }
            let pixel = [index as u32 % image.width, index as u32 / image.width];
            let shown = [0, 1].map(|which| shown[which].get_pixel(pixel[0], pixel[1]).0);
            let difference = relative_difference(*found, *expected, reference.floor);
            let near = difference <= RELATIVE_LIMIT && steps(shown) <= STEPS_OF_256;
            Some(Finding { pixel, difference, wrong: !near, found: *found, expected: *expected, shown })
        })
        .collect()
}

/// The largest difference of a channel as displayed.
fn steps([a, b]: [[u8; 3]; 2]) -> u8 {
    a.into_iter().zip(b).map(|(a, b)| a.abs_diff(b)).fold(0, u8::max)
}

fn too_many_uncertain(uncertain: usize, expected: &Radiance) -> Option<String> {
    let limit = uncertain_limit(expected.width, expected.height);
    (uncertain > limit).then(|| {
        format!(
            "{uncertain} of {} pixels are uncertain (a nudge of their ray changes them) and at most {limit} may \
             be: the image cannot be judged",
            expected.pixels.len()
        )
    })
}

fn sizes_differ(image: &Radiance, expected: &Radiance) -> String {
    format!(
        "the image is {} x {} with {} pixels and should be {} x {}",
        image.width,
        image.height,
        image.pixels.len(),
        expected.width,
        expected.height
    )
}

fn refuse(uncertain_pixels: usize, wrong_pixels: usize, reason: String) -> Verdict {
    Verdict {
        max_difference: f64::INFINITY,
        worst_pixel: None,
        uncertain_pixels,
        wrong_pixels,
        ok: false,
        reason: Some(reason),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{fixtures, reference};
    use crate::strategy::Culling;

    fn judged() -> Reference {
        reference(&fixtures::figure_4(), [80, 50], Culling::None)
    }

    fn judge(image: &Radiance, reference: &Reference) -> Verdict {
        verify(image, reference, Display::default())
    }

    #[test]
    fn an_equal_image_is_right() {
        let reference = judged();
        let verdict = judge(&reference.radiance, &reference);
        assert!(verdict.ok && verdict.reason.is_none() && verdict.worst_pixel.is_none(), "{verdict:?}");
        assert_eq!((verdict.max_difference, verdict.wrong_pixels), (0.0, 0));
    }

    #[test]
    fn a_shifted_image_is_wrong() {
        let reference = judged();
        let mut shifted = reference.radiance.clone();
        shifted.pixels.rotate_right(1);
        let verdict = judge(&shifted, &reference);
        assert!(!verdict.ok && verdict.wrong_pixels > 100 && verdict.max_difference > 0.5, "{verdict:?}");
    }

    #[test]
    fn rounding_is_allowed_and_reported() {
        let reference = judged();
        let mut image = reference.radiance.clone();
        image.pixels[0] = image.pixels[0].map(|channel| channel * 1.0005);
        let verdict = judge(&image, &reference);
        assert!(verdict.ok && verdict.worst_pixel == Some([0, 0]), "{verdict:?}");
        assert!((verdict.max_difference - 5e-4).abs() < 1e-6, "{verdict:?}");
    }

    #[test]
    fn one_wrong_pixel_is_named_with_both_values() {
        let reference = judged();
        let mut image = reference.radiance.clone();
        image.pixels[83] = [0.25, 0.5, 0.75];
        let verdict = judge(&image, &reference);
        let reason = verdict.reason.unwrap_or_default();
        assert_eq!((verdict.wrong_pixels, verdict.worst_pixel), (1, Some([3, 1])));
        assert!(reason.contains("(3, 1)") && reason.contains("[0.25, 0.5, 0.75]"), "{reason}");
        assert!(reason.contains("[0.0022, 0.0032, 0.0053]"), "{reason}");
    }

    #[test]
    fn what_is_not_finite_is_wrong_even_where_uncertain() {
        for value in [f32::NAN, f32::INFINITY] {
            let mut reference = judged();
            reference.certain[5] = false;
            let mut image = reference.radiance.clone();
            image.pixels[5] = [0.5; 3];
            assert!(judge(&image, &reference).ok);
            image.pixels[5][1] = value;
            let verdict = judge(&image, &reference);
            assert!(!verdict.ok && verdict.wrong_pixels == 1, "{verdict:?}");
            assert!(verdict.reason.unwrap_or_default().contains("not finite"));
        }
    }

    #[test]
    fn an_image_that_is_mostly_uncertain_cannot_be_judged() {
        let mut reference = judged();
        reference.certain[..=uncertain_limit(80, 50)].fill(false);
        let verdict = judge(&reference.radiance, &reference);
        assert!(!verdict.ok && verdict.reason.unwrap_or_default().contains("uncertain"));
    }

    #[test]
    fn an_image_of_another_size_is_wrong() {
        let reference = judged();
        let verdict = judge(&Radiance::new(50, 80), &reference);
        assert!(!verdict.ok && verdict.reason.unwrap_or_default().contains("50 x 80"));
    }
}
