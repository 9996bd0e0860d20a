//! Verifies images against the reference. In a run, a point whose image is wrong gets the outcome
//! `wrong-image`.
//!
//! For the [`Reference`], each pixel is also cast with small changes. Some of the small changes are nudges,
//! which turn the pixel's ray. Wide nudges turn the ray by much more than rounding does; narrow nudges turn the
//! ray by little more than rounding does. Small changes other than nudges concern, for example, the shadow
//! bias. A pixel is certain if no small change alters its value noticeably. A certain pixel of the image must
//! agree with the reference within [`RELATIVE_LIMIT`] (see [`relative_difference`]), and within one 8-bit step
//! per channel as displayed. A pixel that is not certain has a range: from the least to the greatest value of
//! each channel under all small changes except wide nudges. The value of such a pixel should lie within its
//! range. If only wide nudges alter a pixel noticeably, no value in the pixel's range differs from the
//! reference by more than the relative limit. A pixel that only wide nudges alter (a nearly certain pixel) is
//! therefore judged almost like a certain pixel. Pixels that are not certain and whose value lies outside their
//! range are counted, and only few of them are allowed (see [`unexplained_limit`]). The number of pixels that
//! hit something must lie in, or close to, the range that the reference allows (see `wrong_hits`), since the
//! result `shadow_rays_per_s` is computed from this number if pixels have one sample each. If the background is
//! transparent, the alpha of certain pixels must agree with the reference too.

use crate::image::{RELATIVE_LIMIT, Radiance, alpha_difference, relative_difference, to_rgb8};
use crate::reference::{Doubt, Reference};
use crate::scene::Display;
use crate::words::{counted, counted_of_were};

/// Largest difference that is allowed for a certain pixel as displayed, in 8-bit steps.
const STEPS_OF_256: u8 = 1;

/// The result of comparing an image with its reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The largest relative difference over certain pixels and pixels that are not finite; `None` if there
    /// are no such pixels. Infinite if a pixel is not finite, or if the image has another size than the
    /// reference.
    pub max_difference: Option<f64>,
    /// The column and row of the pixel with the largest difference, or of the worst wrong pixel if any pixel
    /// is wrong. Only certain pixels and pixels that are not finite are compared; `None` if none of these
    /// pixels differs from the reference, or if the image has another size than the reference.
    pub worst_pixel: Option<[u32; 2]>,
    /// Number of uncertain pixels of the reference, without the nearly certain pixels.
    pub uncertain_pixels: usize,
    /// Number of pixels that are not certain and whose value lies outside their range (see the [module](self)).
    /// If the image has another size than the reference, this number equals `uncertain_pixels`.
    pub unexplained_pixels: usize,
    /// Number of wrong pixels: certain pixels that disagree, and pixels that are not finite. If the image has
    /// another size than the reference, all pixels are counted.
    pub wrong_pixels: usize,
    /// True if the image is correct.
    pub ok: bool,
    /// The reason why the image is not correct, in a sentence; `None` if it is correct.
    pub reason: Option<String>,
}

/// Verifies an image against the reference for the same scene, size and culling. The pixels that the
/// reference has cast are compared; all pixels must be finite. `hits`, if known, is the number of the image's
/// pixels that hit something.
pub fn verify(image: &Radiance, hits: Option<usize>, reference: &Reference, display: Display) -> Verdict {
    let uncertain_pixels = reference.uncertain_pixels();
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
        _ => too_many_unexplained(unexplained_pixels, reference.judged)
            .or_else(|| wrong_shares("alpha", &image.coverage, reference))
            .or_else(|| hits.and_then(|hits| wrong_hits(hits, reference))),
    };
    let agrees = || reference.certain.contains(&true).then_some(0.0);
    Verdict {
        max_difference: findings.iter().map(|finding| finding.difference).reduce(f64::max).or_else(agrees),
        worst_pixel: worst.map(|finding| finding.pixel),
        uncertain_pixels,
        unexplained_pixels,
        wrong_pixels,
        ok: reason.is_none(),
        reason,
    }
}

/// Returns why the hit shares of certain pixels are wrong; `None` if they are right, or if `shares` is empty. A
/// pixel's hit share is the share of its samples that hit something. With a transparent background, this share
/// is the pixel's alpha. `what` is the word for a share in the returned sentence, such as "alpha". Whether the
/// samples of a certain pixel hit or miss does not depend on rounding, so the pixel's hit share does not depend
/// on rounding either.
pub fn wrong_shares(what: &str, shares: &[f32], reference: &Reference) -> Option<String> {
    let pairs = shares.iter().zip(&reference.hit_shares);
    let certain = pairs.enumerate().filter(|(pixel, _)| reference.certain[*pixel]);
    let differences = certain.map(|(pixel, (actual, expected))| {
        (pixel, alpha_difference(Some(actual), Some(expected)), [actual, expected])
    });
    let wrong: Vec<_> = differences.filter(|(_, difference, _)| *difference > RELATIVE_LIMIT).collect();
    let (pixel, _, [actual, expected]) = wrong.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let width = reference.radiance.width;
    let [x, y] = [*pixel as u32 % width, *pixel as u32 / width];
    let pixels = counted(wrong.len(), "pixel");
    Some(format!(
        "the {what} of {pixels} is wrong; the worst, ({x}, {y}), has {actual} and should have {expected}"
    ))
}

/// Returns the number of pixels that are not certain and whose value lies outside the range that the reference
/// allows for them. A channel may lie outside its range by [`RELATIVE_LIMIT`] times the largest channel of the
/// range's upper end, or times the reference's `floor` if that is larger.
fn unexplained(image: &Radiance, reference: &Reference) -> usize {
    let strays = |doubt: &&Doubt| {
        let actual = image.pixels[doubt.pixel];
        let brightest = doubt.high.iter().map(|&high| f64::from(high)).fold(reference.floor, f64::max);
        let slack = (RELATIVE_LIMIT * brightest) as f32;
        !(0..3).all(|i| actual[i] >= doubt.low[i] - slack && actual[i] <= doubt.high[i] + slack)
    };
    reference.doubts.iter().filter(strays).count()
}

/// Returns how many pixels that are not certain may lie outside their range: one in ten thousand of the compared
/// pixels, but at least 16.
pub fn unexplained_limit(judged: usize) -> usize {
    (judged / 10_000).max(16)
}

/// Returns the reason why a right image is hardly verified: of the judged pixels (the pixels that the
/// reference has cast) that hit something, fewer than one in ten are certain or nearly certain. Returns
/// `None` if at least one in ten of these pixels is certain or nearly certain. Pixels that hit nothing do not
/// count in this share, because even an image with wrong surfaces shows the background where the reference
/// shows it. If no pixel hits anything, the share is computed from all judged pixels. The first argument has
/// two numbers for all judged pixels: how many of them are uncertain, and how many there are. The second
/// argument has the same two numbers for those judged pixels that hit something.
pub fn hardly_verified(
    [uncertain_pixels, judged]: [usize; 2],
    [uncertain_hits, hits]: [usize; 2],
) -> Option<String> {
    let (uncertain, judged, what) = match hits {
        0 => (uncertain_pixels, judged, "pixel"),
        _ => (uncertain_hits, hits, "pixel with a surface"),
    };
    let sure = judged.saturating_sub(uncertain);
    (10 * sure < judged).then(|| {
        let were = counted_of_were(sure, judged, what);
        format!(
            "{were} certain or nearly certain; rounding may decide the values of all other pixels, so these \
             were compared only with ranges of possible values"
        )
    })
}

/// Returns why the number of pixels that hit something is wrong; `None` if the number is right, or if the
/// reference has cast only some pixels. The reference allows a range of numbers. The number may lie outside
/// this range by as many pixels as [`unexplained_limit`] permits, since so many pixels may have values that
/// no small change explains.
fn wrong_hits(hits: usize, reference: &Reference) -> Option<String> {
    if reference.judged < reference.radiance.pixels.len() {
        return None;
    }
    let strays = unexplained_limit(reference.judged);
    let [fewest, most] = reference.hits_range;
    let apart = fewest.saturating_sub(hits).max(hits.saturating_sub(most));
    (apart > strays).then(|| format!("the rays of {hits} pixels hit something; expected {fewest} to {most}"))
}

/// A certain pixel whose value is not equal to the reference's value, or a pixel that is not finite.
struct Finding {
    pixel: [u32; 2],
    difference: f64,
    /// True if the difference is larger than allowed.
    wrong: bool,
    actual: [f32; 3],
    expected: [f32; 3],
    /// The pixel's displayed colours: first in the image, then in the reference.
    shown: [[u8; 3]; 2],
}

impl Finding {
    fn sentence(&self, wrong_pixels: usize) -> String {
        let [x, y] = self.pixel;
        let (actual, expected, shown) = (self.actual, self.expected, self.shown);
        let what = if !actual.iter().all(|channel| channel.is_finite()) {
            "is not finite".to_string()
        } else {
            format!("has a relative difference of {:.2e}", self.difference)
        };
        let pixels = if wrong_pixels == 1 { "pixel is" } else { "pixels are" };
        format!(
            "{wrong_pixels} {pixels} wrong; the worst, ({x}, {y}), {what}: its radiance is {actual:?} and should \
             be {expected:?} (as displayed, in 8 bits: {:?} and {:?})",
            shown[0], shown[1]
        )
    }
}

/// Returns all pixels that are not finite, and all certain pixels whose value is not equal to the reference's
/// value, even if the difference is allowed.
fn findings(image: &Radiance, reference: &Reference, display: Display) -> Vec<Finding> {
    let shown = [to_rgb8(image, display), to_rgb8(&reference.radiance, display)];
    let pairs = image.pixels.iter().zip(&reference.radiance.pixels).zip(&reference.certain);
    pairs
        .enumerate()
        .filter_map(|(index, ((actual, expected), certain))| {
            let finite = actual.iter().all(|channel| channel.is_finite());
            if finite && (!certain || actual == expected) {
                return None;
            }
            let pixel = [index as u32 % image.width, index as u32 / image.width];
            let shown = [0, 1].map(|which| shown[which].get_pixel(pixel[0], pixel[1]).0);
            let difference = relative_difference(*actual, *expected, reference.floor);
            let near = difference <= RELATIVE_LIMIT && steps(shown) <= STEPS_OF_256;
            Some(Finding { pixel, difference, wrong: !near, actual: *actual, expected: *expected, shown })
        })
        .collect()
}

/// Returns the largest difference between the channels of two displayed colours, in 8-bit steps.
fn steps([a, b]: [[u8; 3]; 2]) -> u8 {
    a.into_iter().zip(b).map(|(a, b)| a.abs_diff(b)).fold(0, u8::max)
}

fn too_many_unexplained(unexplained: usize, judged: usize) -> Option<String> {
    let limit = unexplained_limit(judged);
    (unexplained > limit).then(|| {
        format!(
            "{unexplained} of {judged} pixels are not certain, and their colours lie outside their ranges of possible values; at most {limit} such pixels are allowed"
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
        max_difference: Some(f64::INFINITY),
        worst_pixel: None,
        uncertain_pixels,
        unexplained_pixels: uncertain_pixels,
        wrong_pixels,
        ok: false,
        reason: Some(reason),
    }
}

#[cfg(test)]
mod tests;
