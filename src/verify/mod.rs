//! Whether an image is right: fast but wrong never enters the results.
//!
//! Pixels the [`Reference`] is certain of agree within [`RELATIVE_LIMIT`] (see
//! [`relative_difference`] for what it is relative to) and within 1 in 8 bits as displayed.
//! Uncertain ones, where rounding may rightly decide, look like the pixel under one of its nudges (they lie within
//! the range that those span); those that do not are counted and have to be few. As many pixels hit something as can:
//! `shadow_rays_per_s` counts them.

use crate::image::{RELATIVE_LIMIT, Radiance, relative_difference, to_rgb8};
use crate::reference::{Doubt, Reference};
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
    /// Uncertain pixels outside the range that their nudges span.
    pub unexplained_pixels: usize,
    /// Certain pixels that disagree, and pixels that are not finite.
    pub wrong_pixels: usize,
    /// Whether the image is right.
    pub ok: bool,
    /// Why it is not, in a sentence.
    pub reason: Option<String>,
}

/// Judges an image of the scene, size and culling that `reference` is of, and where it is known the number of pixels that
/// hit something.
pub fn verify(image: &Radiance, hits: Option<usize>, reference: &Reference, display: Display) -> Verdict {
    let uncertain_pixels = reference.doubts.len();
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
    let unexplained_pixels = unexplained(image, reference);
    let wrong_pixels = findings.iter().filter(|finding| finding.wrong).count();
    let reason = match worst {
        Some(finding) if finding.wrong => Some(finding.sentence(wrong_pixels)),
        _ => too_many_unexplained(unexplained_pixels, expected)
            .or_else(|| hits.and_then(|hits| wrong_hits(hits, reference))),
    };
    Verdict {
        max_difference: findings.iter().map(|finding| finding.difference).fold(0.0, f64::max),
        worst_pixel: worst.map(|finding| finding.pixel),
        uncertain_pixels,
        unexplained_pixels,
        wrong_pixels,
        ok: reason.is_none(),
        reason,
    }
}

/// How many uncertain pixels look like none of their nudges.
fn unexplained(image: &Radiance, reference: &Reference) -> usize {
    let strays = |doubt: &&Doubt| {
        let found = image.pixels[doubt.pixel];
        let brightest = doubt.high.iter().map(|&high| f64::from(high)).fold(reference.floor, f64::max);
        let slack = (RELATIVE_LIMIT * brightest) as f32;
        !(0..3).all(|i| found[i] >= doubt.low[i] - slack && found[i] <= doubt.high[i] + slack)
    };
    reference.doubts.iter().filter(strays).count()
}

/// How many uncertain pixels may look like none of their nudges: a ten-thousandth of the image, 16 in a small one.
pub fn unexplained_limit(width: u32, height: u32) -> usize {
    (width as usize * height as usize / 10_000).max(16)
}

/// Why the number of pixels that hit something cannot be; uncertain ones may be strays here as well.
fn wrong_hits(hits: usize, reference: &Reference) -> Option<String> {
    let strays = unexplained_limit(reference.radiance.width, reference.radiance.height);
    let [fewest, most] = reference.hits_range;
    let apart = fewest.saturating_sub(hits).max(hits.saturating_sub(most));
    (apart > strays).then(|| format!("{hits} pixels hit something, and {fewest} to {most} can"))
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

fn too_many_unexplained(unexplained: usize, expected: &Radiance) -> Option<String> {
    let limit = unexplained_limit(expected.width, expected.height);
    (unexplained > limit).then(|| {
        format!(
            "{unexplained} of {} pixels are uncertain and look like none of their rays' nudges; at most {limit} may",
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
        unexplained_pixels: uncertain_pixels,
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
        verify(image, Some(reference.hits), reference, Display::default())
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

    /// Makes the first pixels uncertain, which may then be anything from black to 0.5.
    fn doubt_first(reference: &mut Reference, count: usize) {
        reference.certain[..count].fill(false);
        let doubt = |pixel| Doubt { pixel, low: [0.0; 3], high: [0.5; 3] };
        reference.doubts = (0..count).map(doubt).collect();
    }

    #[test]
    fn what_is_not_finite_is_wrong_even_where_uncertain() {
        for value in [f32::NAN, f32::INFINITY] {
            let mut reference = judged();
            doubt_first(&mut reference, 6);
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
    fn uncertain_pixels_look_like_their_nudges_or_are_few() {
        let mut reference = judged();
        let limit = unexplained_limit(80, 50);
        doubt_first(&mut reference, limit + 1);
        let mut image = reference.radiance.clone();
        image.pixels[..=limit].fill([0.4; 3]);
        assert_eq!(judge(&image, &reference).unexplained_pixels, 0);
        image.pixels[..limit].fill([0.6; 3]);
        assert!(judge(&image, &reference).ok);
        image.pixels[..=limit].fill([0.6; 3]);
        let verdict = judge(&image, &reference);
        assert!(!verdict.ok && verdict.unexplained_pixels == limit + 1, "{verdict:?}");
        assert!(verdict.reason.unwrap_or_default().contains("nudges"));
    }

    #[test]
    fn the_limit_of_strays_is_a_ten_thousandth_of_the_image() {
        let limits = [[40, 25], [400, 400], [800, 500], [1920, 1080]].map(|[w, h]| unexplained_limit(w, h));
        assert_eq!(limits, [16, 16, 40, 207]);
    }

    #[test]
    fn every_uncertain_pixel_of_a_papers_scene_wrong_is_noticed() {
        let scene = fixtures::pyramid_lower();
        let reference = reference(&scene, [401, 251], Culling::None);
        let mut image = reference.radiance.clone();
        for doubt in &reference.doubts {
            image.pixels[doubt.pixel] = doubt.high.map(|high| 2.0 * high + 0.1);
        }
        let verdict = judge(&image, &reference);
        assert!(!verdict.ok && verdict.unexplained_pixels == reference.doubts.len(), "{verdict:?}");
    }

    #[test]
    fn hits_that_cannot_be_are_noticed() {
        let reference = judged();
        let verdict = |hits| verify(&reference.radiance, hits, &reference, Display::default());
        let [fewest, most] = reference.hits_range;
        for hits in [None, Some(fewest - 16), Some(most + 16)] {
            assert!(verdict(hits).ok, "{hits:?} of {fewest} to {most}");
        }
        for hits in [0, fewest - 17, most + 17, 80 * 50] {
            let reason = verdict(Some(hits)).reason.unwrap_or_default();
            assert!(reason.starts_with(&format!("{hits} pixels hit something")), "{reason}");
        }
    }

    #[test]
    fn an_image_of_another_size_is_wrong() {
        let reference = judged();
        let verdict = judge(&Radiance::new(50, 80), &reference);
        assert!(!verdict.ok && verdict.reason.unwrap_or_default().contains("50 x 80"));
    }
}
