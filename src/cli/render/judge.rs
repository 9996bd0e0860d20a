//! Checks the picture: its values must be finite, and with `--verify` it must match the reference.

use super::report::Verified;
use crate::error::{Error, Result};
use crate::image::Radiance;
use crate::output::Target;
use crate::reference::{all_pixels, reference_of, some_pixels};
use crate::scene::{SampleCounts, Sampling, Scene};
use crate::strategy::Strategy;
use crate::verify::{Verdict, verify};
use std::path::Path;

/// Returns an error if a value of the picture is infinite or not a number, even without `--verify`.
pub(super) fn refuse_not_finite(image: &Radiance, saved: &Path) -> Result<()> {
    let Some(([x, y], count)) = image.not_finite() else { return Ok(()) };
    let found = image.pixels[(y * image.width + x) as usize];
    let message =
        format!("the picture is wrong: {count} pixels are not finite; the first, ({x}, {y}), is {found:?}");
    Err(Error::run(message).with_help(format!(
        "a light may lie too close to a surface there: move or weaken it, or set shadow_bias; the picture was saved for inspection: {}",
        saved.display()
    )))
}

/// Compares a picture, or only `some` of its pixels, with the reference. Also checks the number of pixels
/// that hit something.
pub(super) fn check(
    scene: &Scene,
    (image, hits): (&Radiance, usize),
    (strategy, sampling): (&Strategy, (Sampling, Option<&SampleCounts>)),
    saved: &Target,
    some: Option<u32>,
) -> Result<Verified> {
    let size = [image.width, image.height];
    let pixels = match some {
        Some(some) => some_pixels(size, some as usize),
        None => all_pixels(size),
    };
    let (sampling, counts) = sampling;
    if counts.is_some_and(|counts| !counts.are_of(&sampling)) {
        let Sampling { first, most } = sampling;
        let message = format!(
            "the picture is wrong: some pixels have a number of samples other than {first} or {most}"
        );
        return Err(Error::run(message).with_help("this is a fault of raycl or of the driver"));
    }
    let count = |pixel: usize| {
        let place = [pixel as u32 % size[0], pixel as u32 / size[0]];
        counts.map_or(sampling.most, |counts| counts.at(place))
    };
    let samples = sampling.rounds().concat();
    let expected = reference_of(scene, size, strategy.culling, &pixels, (&samples, &count));
    let verdict = verify(image, Some(hits), &expected, scene.display);
    let Verdict { max_difference, uncertain_pixels, .. } = verdict;
    if verdict.ok {
        let [pixels, of_pixels] = [expected.judged, image.pixels.len()];
        return Ok(Verified { max_difference, uncertain_pixels, pixels, of_pixels });
    }
    let error = Error::run(format!("the picture is wrong: {}", verdict.reason.unwrap_or_default()));
    Err(error.with_help(format!("it was saved for inspection: {}", saved.path().display())))
}
