//! Checks the picture: its values must be finite, and with `--verify` it must match the reference.

use super::report::{Verification, Verified};
use crate::error::{Error, Result};
use crate::image::{RELATIVE_LIMIT, Radiance, dark_floor, relative_difference};
use crate::launch::LightParts;
use crate::output::Target;
use crate::reference::half_light::with_half_light;
use crate::reference::rough::{certain_blocks, pixels_of_some_blocks};
use crate::reference::{all_pixels, reference_of, some_pixels};
use crate::scene::{Sample, SampleCounts, SampleLight, Sampling, Scene};
use crate::strategy::Strategy;
use crate::verify::{Verdict, verify, wrong_shares};
use crate::words::{counted, path_word, quote};
use std::path::Path;

/// Returns an error if a value of the picture is infinite or not a number, even without `--verify`. `fate` is the part
/// of the error message that says whether and where the picture was saved.
pub(super) fn refuse_not_finite(image: &Radiance, fate: &str) -> Result<()> {
    let Some(([x, y], count)) = image.not_finite() else { return Ok(()) };
    let value = image.pixels[(y * image.width + x) as usize];
    let pixels = if count == 1 { "pixel is" } else { "pixels are" };
    let message =
        format!("the picture is wrong: {count} {pixels} not finite; the first, ({x}, {y}), is {value:?}");
    Err(Error::run(message).with_help(format!(
        "move or dim the light, or raise shadow_bias, since a light may be too close to the surface at pixel ({x}, {y}); {fate}"
    )))
}

/// Returns the words that tell the user where a wrong picture was saved.
fn saved_at(path: &Path) -> String {
    format!("the picture was saved for inspection: {}", path.display())
}

/// Returns the words that tell the user how to see where a saved picture is wrong; an empty text if the
/// picture was written to standard output.
fn where_wrong(saved: &Target) -> String {
    if saved.is_standard_output() {
        return String::new();
    }
    let found = quote(&path_word(saved.path()));
    let ending = saved.path().extension().unwrap_or_default().display();
    format!(
        "; to see where it is wrong, render it with another --strategy and `-o right.{ending}`, then run \
         `raycl compare-images {found} right.{ending} -o where.png`"
    )
}

/// Checks the values of a picture and, with `--verify`, calls `compare` to compare it with the reference. Returns what
/// the report says about the verification (`None` without `--verify`) and, if the picture is wrong, the error with
/// which the command ends after the report.
pub(super) fn verified(
    image: &Radiance,
    saved: &Target,
    verify: Option<Option<u32>>,
    compare: impl FnOnce(Option<u32>) -> Result<Verified>,
) -> (Option<Verification>, Option<Error>) {
    let finite = refuse_not_finite(image, &saved_at(saved.path()));
    match finite.and_then(|()| verify.map(compare).transpose()) {
        Ok(verified) => (verified.map(Verification::Right), None),
        Err(error) => {
            let wrong = error.to_string();
            (verify.map(|_| Verification::Wrong { wrong }), Some(error))
        }
    }
}

/// Compares a picture, or only `some` of its pixels, with the reference. If all pixels are compared, the check
/// includes the number of pixels whose rays hit a triangle. If only rough blocks get all samples, the check also
/// includes which blocks got all samples (`counts`). If the picture's soft light was cast in half pictures (of half the
/// width and height), `parts` contains the pictures from which the filter made the final picture. In this case, the
/// pictures in `parts`, and the shares of their samples that hit something, are compared with the reference. The final
/// picture is compared with the picture that the host makes of `parts` by the same filter as the device.
pub(super) fn check(
    scene: &Scene,
    (image, hits): (&Radiance, usize),
    (strategy, sampling): (&Strategy, (Sampling, Option<&SampleCounts>)),
    parts: Option<&LightParts>,
    saved: &Target,
    some: Option<u32>,
) -> Result<Verified> {
    let (sampling, counts) = sampling;
    if counts.is_some_and(|counts| !counts.are_of(&sampling)) {
        let Sampling { first, most, .. } = sampling;
        let message = format!(
            "the picture is wrong: some pixels have a number of samples that is neither {first} nor {most}"
        );
        return Err(Error::run(message).with_help(
            "this is a bug in raycl or in the driver: update the driver, or report the bug with your command",
        ));
    }
    let compare = |(scene, which): (&Scene, &str), cast: Compared<'_>, samples: &[Sample], counts| {
        let compared = compare(scene, cast, strategy, (samples, counts), some);
        compared.map_err(|reason| wrong(&format!("{which}{reason}"), saved))
    };
    let cast = match parts {
        Some(LightParts { whole, hits, hit_shares, .. }) => {
            Compared { image: whole, hits: Some(*hits), hit_shares: Some(hit_shares.as_slice()) }
        }
        None => Compared { image, hits: Some(hits), hit_shares: None },
    };
    let whole = compare((scene, ""), cast, &sampling.rounds().concat(), counts)?;
    let size = [image.width, image.height];
    if let Some(counts) = counts
        && let Some(reason) = wrong_counts(scene, size, strategy, (&sampling, counts), some)
    {
        return Err(wrong(&reason, saved));
    }
    let Some(parts) = parts else { return Ok(whole) };
    // The half pictures have the same field of view as the whole picture.
    let camera = scene.camera.covering(size);
    let half_scene = Scene { camera, ..scene.clone() };
    let mut max_difference = whole.max_difference;
    // `half_hit_shares` was read from the half picture with unoccluded light, so it is compared only with that
    // picture's reference.
    for (image, hit_shares, light) in [
        (&parts.lit, None, SampleLight::Interleaved),
        (&parts.unoccluded, Some(parts.half_hit_shares.as_slice()), SampleLight::Unoccluded),
    ] {
        let half = Compared { image, hits: None, hit_shares };
        let of_half = (&half_scene, "in a picture of half the width and height, ");
        let compared = compare(of_half, half, &sampling.of_half_light(light), None)?;
        max_difference = compared.max_difference.into_iter().chain(max_difference).reduce(f64::max);
    }
    if hits != parts.hits || image.coverage != parts.whole.coverage {
        return Err(wrong("the filter of soft light changed which pixels show a surface", saved));
    }
    let filtered = check_filter(image, scene, parts).map_err(|reason| wrong(&reason, saved))?;
    let max_difference = max_difference.into_iter().chain([filtered]).reduce(f64::max);
    Ok(Verified { max_difference, ..whole })
}

/// A picture that is compared with its reference.
struct Compared<'a> {
    image: &'a Radiance,
    /// The number of pixels whose rays hit a triangle; `None` if this number is not compared.
    hits: Option<usize>,
    /// For each pixel, the share of its samples that hit something; `None` if the shares are not compared.
    hit_shares: Option<&'a [f32]>,
}

/// Compares a picture with its reference. If the picture is wrong, returns the reason as an error.
fn compare(
    scene: &Scene,
    Compared { image, hits, hit_shares }: Compared<'_>,
    strategy: &Strategy,
    (samples, counts): (&[Sample], Option<&SampleCounts>),
    some: Option<u32>,
) -> std::result::Result<Verified, String> {
    let size = [image.width, image.height];
    let pixels = match some {
        Some(some) => some_pixels(size, some as usize),
        None => all_pixels(size),
    };
    let count = |pixel: usize| {
        let position = [pixel as u32 % size[0], pixel as u32 / size[0]];
        counts.map_or(samples.len() as u32, |counts| counts.at(position))
    };
    let expected = reference_of(scene, size, strategy.culling, &pixels, (samples, &count));
    let verdict = verify(image, hits, &expected, scene.display);
    let Verdict { max_difference, uncertain_pixels, .. } = verdict;
    let wrong_shares = || hit_shares.and_then(|shares| wrong_shares("hit share", shares, &expected));
    match verdict.reason.or_else(wrong_shares) {
        Some(reason) => Err(reason),
        None => Ok(Verified {
            max_difference,
            uncertain_pixels,
            uncertain_hits: expected.uncertain_hits(),
            pixels: expected.judged,
            hits: expected.hits,
            of_pixels: image.pixels.len(),
        }),
    }
}

/// Returns why the blocks' numbers of samples are wrong; `None` if they are right. The reference's first samples say
/// which blocks are rough and get all samples. If `some` is given, only randomly chosen blocks are compared. Together
/// with the rings of pixels around them, these blocks have about `some` pixels.
fn wrong_counts(
    scene: &Scene,
    size: [u32; 2],
    strategy: &Strategy,
    (sampling, counts): (&Sampling, &SampleCounts),
    some: Option<u32>,
) -> Option<String> {
    let pixels = match some {
        Some(some) => pixels_of_some_blocks(size, some as usize),
        None => all_pixels(size),
    };
    let [first, _] = sampling.rounds();
    let means = reference_of(scene, size, strategy.culling, &pixels, (&first, &|_| sampling.first));
    let blocks = certain_blocks(&means, scene.display, sampling.first).into_iter();
    let expected = blocks.map(|(at, is_rough)| (at, if is_rough { sampling.most } else { sampling.first }));
    let wrong: Vec<_> = expected.filter(|(at, expected)| counts.at(*at) != *expected).collect();
    let (at, expected) = *wrong.first()?;
    let ([x, y], blocks) = (at, counted(wrong.len(), "block"));
    Some(format!(
        "the number of samples per pixel is wrong in {blocks}; the first block, at pixel ({x}, {y}), has {} and \
         should have {expected}, since its pixels {} visibly after {}",
        counts.at(at),
        if expected == sampling.most { "differ" } else { "do not differ" },
        counted(sampling.first as usize, "sample"),
    ))
}

/// Applies the filter of soft light to `parts` on the host, and compares `image` with the result. Returns the
/// largest relative difference or, if this difference is above `RELATIVE_LIMIT`, an error that names the
/// pixel.
fn check_filter(image: &Radiance, scene: &Scene, parts: &LightParts) -> std::result::Result<f64, String> {
    let background = scene.background.as_dvec3();
    let expected = with_half_light(&parts.whole, &parts.hit_shares, &parts.halves(), background);
    let floor = dark_floor(&expected, scene.display);
    let differences =
        image.pixels.iter().zip(&expected.pixels).map(|(a, b)| relative_difference(*a, *b, floor));
    // `relative_difference` returns infinity if a value is not a number, so no difference is NaN.
    let (worst, largest) = differences.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
    if largest <= RELATIVE_LIMIT {
        return Ok(largest);
    }
    let [x, y] = [worst as u32 % image.width, worst as u32 / image.width];
    let (value, expected) = (image.pixels[worst], expected.pixels[worst]);
    Err(format!("the filter of soft light gave pixel ({x}, {y}) the value {value:?}; expected {expected:?}"))
}

fn wrong(reason: &str, saved: &Target) -> Error {
    let error = Error::run(format!("the picture is wrong: {reason}"));
    error.with_help(format!("{}{}", saved_at(saved.path()), where_wrong(saved)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures;
    use crate::reference::rough::{rough_steps, steps_of_blocks};
    use crate::strategy::preset;

    /// One sample per pixel, and soft light at half resolution.
    const SOFT: Sampling = Sampling { half_light: 1, ..Sampling::ONE };

    /// Casts the parts of a picture of 8 x 3 pixels with soft light, in double precision.
    fn parts_of(scene: &Scene, strategy: &Strategy) -> LightParts {
        let cast = |scene: &Scene, size: [u32; 2], samples: &[Sample]| {
            reference_of(scene, size, strategy.culling, &all_pixels(size), (samples, &|_| 1))
        };
        let whole = cast(scene, [8, 3], &SOFT.rounds().concat());
        let half_scene = Scene { camera: scene.camera.covering([8, 3]), ..scene.clone() };
        let half = |light: SampleLight| cast(&half_scene, [4, 2], &SOFT.of_half_light(light));
        let unoccluded = half(SampleLight::Unoccluded);
        LightParts {
            hits: whole.hits,
            whole: whole.radiance,
            hit_shares: whole.hit_shares,
            lit: half(SampleLight::Interleaved).radiance,
            unoccluded: unoccluded.radiance,
            half_hit_shares: unoccluded.hit_shares,
        }
    }

    /// The filter uses the hit shares. If the hit shares are wrong, the host's filter and the device's filter compute
    /// the same wrong picture. Only the comparison of the hit shares with the reference shows the mistake.
    #[test]
    fn a_wrong_share_of_hits_is_noticed_in_the_whole_picture_and_in_half_pictures() {
        let (scene, strategy) = (fixtures::single_triangle(), preset("bvh").unwrap().strategy);
        let wrong_part = |change: fn(&mut LightParts)| {
            let mut parts = parts_of(&scene, &strategy);
            change(&mut parts);
            let background = scene.background.as_dvec3();
            let image = with_half_light(&parts.whole, &parts.hit_shares, &parts.halves(), background);
            let (cast, saved) = ((&image, parts.hits), Target::of_results("a.png"));
            let verified = check(&scene, cast, (&strategy, (SOFT, None)), Some(&parts), &saved, None);
            verified.map_err(|error| error.to_string()).map(|_| ())
        };
        assert_eq!(wrong_part(|parts| parts.hit_shares[12] = 0.9995), Ok(()), "it is within the tolerance");
        let wrong_at = |picture: &str, pixel: &str| {
            let wrong =
                format!("the hit share of 1 pixel is wrong; the worst, {pixel}, has 0.5 and should have 1");
            Err(format!("the picture is wrong: {picture}{wrong}"))
        };
        assert_eq!(wrong_part(|parts| parts.hit_shares[12] = 0.5), wrong_at("", "(4, 1)"));
        assert_eq!(
            wrong_part(|parts| parts.half_hit_shares[6] = 0.5),
            wrong_at("in a picture of half the width and height, ", "(2, 1)")
        );
    }

    #[test]
    fn half_pictures_of_another_shape_show_the_field_of_view_of_the_whole_one() {
        let (scene, strategy) = (fixtures::single_triangle(), preset("bvh").unwrap().strategy);
        let (sampling, parts) = (SOFT, parts_of(&scene, &strategy));
        let background = scene.background.as_dvec3();
        let image = with_half_light(&parts.whole, &parts.hit_shares, &parts.halves(), background);
        let saved = Target::of_results("a.png");
        let verified =
            check(&scene, (&image, parts.hits), (&strategy, (sampling, None)), Some(&parts), &saved, None);
        let usual = verified.expect("a correct picture");
        // The test changes one pixel of the filtered picture. The check returns the relative difference if
        // this difference is within the tolerance, and otherwise names the pixel.
        let judged = |factor: f32, hits: usize| {
            let mut image = image.clone();
            image.pixels[10] = image.pixels[10].map(|channel| factor * channel);
            check(&scene, (&image, hits), (&strategy, (sampling, None)), Some(&parts), &saved, None)
        };
        let within = judged(1.0005, parts.hits).expect("it is within the tolerance");
        let [usual, within] = [usual, within].map(|verified| verified.max_difference.unwrap_or(f64::NAN));
        assert!(usual < 1e-4 && (4e-4..6e-4).contains(&within), "{usual} {within}");
        let error = judged(1.01, parts.hits).expect_err("it is beyond the tolerance");
        assert!(
            error.to_string().contains("the filter of soft light gave pixel (2, 1) the value"),
            "{error}"
        );
        assert!(error.remedy().contains("saved for inspection: a.png; to see where"), "{}", error.remedy());
        let error = judged(1.0, parts.hits + 1).expect_err("a hit too many");
        assert!(error.to_string().contains("changed which pixels show a surface"), "{error}");
        // The picture of full size (`parts.whole`) differs slightly from the reference. The final picture is
        // computed from `parts.whole` without a mistake.
        let mut parts = parts;
        parts.whole.pixels.iter_mut().for_each(|pixel| *pixel = pixel.map(|channel| 1.0005 * channel));
        let image = with_half_light(&parts.whole, &parts.hit_shares, &parts.halves(), background);
        let verified =
            check(&scene, (&image, parts.hits), (&strategy, (sampling, None)), Some(&parts), &saved, None);
        let within = verified.expect("it is within the tolerance").max_difference.unwrap_or(f64::NAN);
        assert!((4e-4..6e-4).contains(&within), "{within}");
    }

    #[test]
    fn a_wrong_picture_is_reported_with_the_command_that_shows_where_it_is_wrong() {
        for (file, command) in [
            ("a.png", "`raycl compare-images a.png right.png -o where.png`"),
            ("my pictures/a.exr", "`raycl compare-images 'my pictures/a.exr' right.exr -o where.png`"),
        ] {
            let error = wrong("pixel (0, 0) is black", &Target::of_results(file));
            assert!(error.remedy().ends_with(command), "{}", error.remedy());
        }
        let error = wrong("pixel (0, 0) is black", &Target::of_results("-"));
        assert!(!error.remedy().contains("compare-images"), "{}", error.remedy());
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_the_first_is_named() {
        let checked = |indices: &[usize]| {
            let mut image = Radiance::new(4, 3);
            indices.iter().for_each(|&index| image.pixels[index] = [f32::INFINITY; 3]);
            refuse_not_finite(&image, "the picture was saved").map_err(|error| {
                assert!(error.remedy().ends_with("; the picture was saved"), "{}", error.remedy());
                error.to_string()
            })
        };
        assert!(checked(&[]).is_ok());
        let one = "the picture is wrong: 1 pixel is not finite; the first, (2, 1), is [inf, inf, inf]";
        assert_eq!(checked(&[6]), Err(one.to_owned()));
        assert!(
            checked(&[11, 9])
                .is_err_and(|message| message.contains("2 pixels are not finite; the first, (1, 2)"))
        );
    }

    #[test]
    fn the_report_says_what_is_wrong_only_if_the_picture_is_verified() {
        let saved = Target::of_results("a.png");
        let agrees =
            |_| Ok(Verified { max_difference: Some(0.0), pixels: 12, of_pixels: 12, ..Verified::default() });
        let differs = |_| Err(wrong("pixel (0, 0) is black", &saved));
        let (good, mut broken) = (Radiance::new(4, 3), Radiance::new(4, 3));
        broken.pixels[6] = [f32::NAN; 3];
        assert!(matches!(verified(&good, &saved, None, agrees), (None, None)));
        assert!(matches!(verified(&good, &saved, Some(None), agrees), (Some(Verification::Right(_)), None)));
        assert!(matches!(verified(&broken, &saved, None, agrees), (None, Some(_))));
        for (image, expected) in [(&good, "pixel (0, 0) is black"), (&broken, "1 pixel is not finite")] {
            let (Some(verification), Some(error)) = verified(image, &saved, Some(None), differs) else {
                panic!("the picture is wrong")
            };
            assert!(error.to_string().contains(expected), "{error}");
            assert_eq!(verification.text(), format!("verified  {error}"));
            let json = serde_json::to_value(&verification).expect("JSON");
            assert_eq!(json, serde_json::json!({ "wrong": error.to_string() }));
        }
    }

    #[test]
    fn a_picture_with_pixels_of_other_numbers_of_samples_is_wrong() {
        let scene = fixtures::single_triangle();
        let (sampling, strategy) = (Sampling::adaptive(16), preset("bvh").unwrap().strategy);
        let counts = SampleCounts::new([4, 3], vec![sampling.most + 1]);
        let image = Radiance::new(4, 3);
        let sampled = (sampling, Some(&counts));
        let saved = Target::of_results("a.png");
        let error =
            check(&scene, (&image, 0), (&strategy, sampled), None, &saved, None).expect_err("a wrong number");
        assert!(error.to_string().ends_with("a number of samples that is neither 1 nor 16"), "{error}");
    }

    /// The reference casts as many samples of each pixel as the device says, so the reference agrees with a picture
    /// even if other blocks than the rough ones got all samples.
    #[test]
    fn a_picture_in_which_other_blocks_than_the_rough_ones_got_all_samples_is_wrong() {
        let mut scene = fixtures::single_triangle();
        scene.display.exposure = 10.0;
        let (sampling, strategy, size) = (Sampling::adaptive(4), preset("bvh").unwrap().strategy, [22, 13]);
        let cast = |samples: &[Sample], count: &dyn Fn(usize) -> u32| {
            reference_of(&scene, size, strategy.culling, &all_pixels(size), (samples, count))
        };
        let means = cast(&sampling.rounds()[0], &|_| sampling.first).radiance;
        let steps = steps_of_blocks(&means, scene.display);
        let judged = |limit: f64, some: Option<u32>| {
            let of_block =
                steps.iter().map(|steps| if *steps > limit { sampling.most } else { sampling.first });
            let counts = SampleCounts::new(size, of_block.collect());
            let count = |pixel: usize| counts.at([pixel as u32 % size[0], pixel as u32 / size[0]]);
            let picture = cast(&sampling.rounds().concat(), &count);
            let (picture, sampled) = ((&picture.radiance, picture.hits), (sampling, Some(&counts)));
            let saved = Target::of_results("a.png");
            let verified = check(&scene, picture, (&strategy, sampled), None, &saved, some);
            verified.map_err(|error| error.to_string()).map(|_| ())
        };
        // The picture has 24 blocks. A block has at most 36 pixels, with the ring of pixels around it. So a request
        // for 24 x 36 pixels compares all blocks.
        for some in [None, Some(24 * 36)] {
            assert_eq!(judged(rough_steps(sampling.first), some), Ok(()));
            for (limit, end) in [
                (f64::INFINITY, "has 1 and should have 4, since its pixels differ visibly after 1 sample"),
                (-1.0, "has 4 and should have 1, since its pixels do not differ visibly after 1 sample"),
            ] {
                let message = judged(limit, some).expect_err("a wrong picture");
                let start = "the picture is wrong: the number of samples per pixel is wrong in ";
                assert!(message.starts_with(start) && message.ends_with(end), "{message}");
            }
        }
    }
}
