//! Tests of correct and wrong images, and of the messages.

use super::*;
use crate::reference::{fixtures, reference, reference_of, some_pixels};
use crate::scene::{PAPER_BACKGROUND, Sample, Scene};
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
    assert_eq!((verdict.max_difference, verdict.wrong_pixels), (Some(0.0), 0));
}

#[test]
fn a_shifted_image_is_wrong() {
    let reference = judged();
    let mut shifted = reference.radiance.clone();
    shifted.pixels.rotate_right(1);
    let verdict = judge(&shifted, &reference);
    assert!(!verdict.ok && verdict.wrong_pixels > 100 && verdict.max_difference > Some(0.5), "{verdict:?}");
}

#[test]
fn rounding_is_allowed_and_reported() {
    let reference = judged();
    let mut image = reference.radiance.clone();
    image.pixels[0] = image.pixels[0].map(|channel| channel * 1.0005);
    let verdict = judge(&image, &reference);
    assert!(verdict.ok && verdict.worst_pixel == Some([0, 0]), "{verdict:?}");
    let is_that_of_the_image = |difference: f64| (difference - 5e-4).abs() < 1e-6;
    assert!(verdict.max_difference.is_some_and(is_that_of_the_image), "{verdict:?}");
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

/// Makes the first `count` pixels of the reference uncertain: each channel of these pixels may have any value from 0 to
/// 0.5.
fn doubt_first(reference: &mut Reference, count: usize) {
    reference.certain[..count].fill(false);
    let pixels = &reference.radiance.pixels;
    let doubt = |pixel: usize| {
        let hit = pixels[pixel] != PAPER_BACKGROUND.to_array();
        Doubt { pixel, nearly_certain: false, hit, low: [0.0; 3], high: [0.5; 3] }
    };
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

/// Without certain pixels, the largest difference is unknown (`None`), not 0. The image is right if each
/// pixel's value lies in the pixel's range.
#[test]
fn an_image_with_hardly_any_certain_pixels_is_hardly_verified() {
    let mut reference = judged();
    let grey = Radiance { pixels: vec![[0.25; 3]; 4000], ..Radiance::new(80, 50) };
    doubt_first(&mut reference, 4000);
    let verdict = judge(&grey, &reference);
    assert!(verdict.ok && verdict.max_difference.is_none() && verdict.worst_pixel.is_none(), "{verdict:?}");
    let hits = reference.hits;
    assert!((400..4000).contains(&hits), "{hits}");
    assert_eq!([verdict.uncertain_pixels, reference.uncertain_hits()], [4000, hits]);
    let reason = hardly_verified([4000, 4000], [hits, hits]).unwrap_or_default();
    let start = format!("0 of {hits} pixels with a surface were certain or nearly certain; rounding may");
    assert!(reason.starts_with(&start), "{reason}");
    // Nearly certain pixels have narrow ranges of values, so they do not count as uncertain.
    let doubts_of_hits = reference.doubts.iter_mut().filter(|doubt| doubt.hit);
    doubts_of_hits.take(hits / 2).for_each(|doubt| doubt.nearly_certain = true);
    assert_eq!(reference.uncertain_hits(), hits - hits / 2);
    // An image counts as verified if at least one in ten of the pixels that hit something is certain or nearly certain.
    assert_eq!(hardly_verified([0, 100], [90, 100]), None);
    assert!(hardly_verified([0, 100], [91, 100]).is_some());
}

/// Pixels of the background that agree with the reference do not show that surfaces are right. But if
/// the picture has no surfaces, only the background can be compared.
#[test]
fn certain_misses_do_not_make_up_for_uncertain_hits() {
    let note = hardly_verified([50, 100], [50, 50]).unwrap_or_default();
    assert!(note.starts_with("0 of 50 pixels with a surface were certain"), "{note}");
    assert_eq!(hardly_verified([95, 100], [0, 5]), None);
    assert_eq!(hardly_verified([90, 100], [0, 0]), None);
    let note = hardly_verified([100, 100], [0, 0]).unwrap_or_default();
    assert!(note.starts_with("0 of 100 pixels were certain"), "{note}");
}

#[test]
fn uncertain_pixels_look_like_their_nudges_or_are_few() {
    let mut reference = judged();
    let limit = unexplained_limit(80 * 50);
    doubt_first(&mut reference, limit + 1);
    let mut image = reference.radiance.clone();
    image.pixels[..=limit].fill([0.4; 3]);
    assert_eq!(judge(&image, &reference).unexplained_pixels, 0);
    image.pixels[..limit].fill([0.6; 3]);
    assert!(judge(&image, &reference).ok);
    image.pixels[..=limit].fill([0.6; 3]);
    let verdict = judge(&image, &reference);
    assert!(!verdict.ok && verdict.unexplained_pixels == limit + 1, "{verdict:?}");
    let reason = verdict.reason.unwrap_or_default();
    assert!(
        reason.starts_with("17 of 4000 pixels are not certain, and their colours lie outside their ranges"),
        "{reason}"
    );
    assert!(reason.ends_with("at most 16 such pixels are allowed"), "{reason}");
}

/// A wide nudge turns a ray ten times as far as a narrow nudge, and much farther than rounding can turn a ray.
/// Pixels that only wide nudges change do not depend on rounding, so all but a few of them must agree with the
/// reference.
#[test]
fn pixels_that_only_a_wide_nudge_changes_are_judged() {
    let scene = fixtures::random(300, 1);
    let reference = reference(&scene, [201, 125], Culling::None);
    let nearly = reference.doubts.iter().filter(|doubt| doubt.nearly_certain);
    let wrong: Vec<usize> = nearly.map(|doubt| doubt.pixel).collect();
    assert_eq!(wrong.len() + reference.uncertain_pixels(), reference.doubts.len());
    assert!(wrong.len() > 2 * reference.uncertain_pixels() && wrong.len() > 16, "{}", wrong.len());
    let mut image = reference.radiance.clone();
    for &pixel in &wrong {
        let brightest = image.pixels[pixel].into_iter().fold(reference.floor as f32, f32::max);
        image.pixels[pixel] = image.pixels[pixel].map(|channel| channel + 0.01 * brightest);
    }
    let verdict = judge(&image, &reference);
    assert!(!verdict.ok && verdict.unexplained_pixels == wrong.len(), "{verdict:?}");
}

#[test]
fn the_limit_of_strays_is_a_ten_thousandth_of_the_image() {
    let limits = [[40, 25], [400, 400], [800, 500], [1920, 1080]].map(|[w, h]| unexplained_limit(w * h));
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
        assert_eq!(reason, format!("the rays of {hits} pixels hit something; expected {fewest} to {most}"));
    }
}

#[test]
fn before_a_transparent_background_the_alpha_of_certain_pixels_must_agree() {
    let scene = Scene { transparent: true, ..fixtures::figure_4() };
    let reference = reference(&scene, [80, 50], Culling::None);
    let at = |certain: bool, alpha: f32| {
        let is_it =
            |at: &usize| reference.certain[*at] == certain && reference.radiance.coverage[*at] == alpha;
        (0..4000).find(is_it).expect("a pixel")
    };
    let reason = |pixel: usize, alpha: f32| {
        let mut image = reference.radiance.clone();
        image.coverage[pixel] = alpha;
        judge(&image, &reference).reason.unwrap_or_default()
    };
    let [surface, nothing, doubtful] = [at(true, 1.0), at(true, 0.0), at(false, 1.0)];
    let [x, y] = [surface % 80, surface / 80];
    let expected = format!("the alpha of 1 pixel is wrong; the worst, ({x}, {y}), has 0.5 and should have 1");
    assert_eq!(reason(surface, 0.5), expected);
    assert_eq!([reason(surface, 0.9995), reason(nothing, 0.0005), reason(doubtful, 0.5)], [""; 3]);
    assert!(reason(nothing, 0.002).contains("has 0.002 and should have 0"));
    assert!(reason(nothing, f32::NAN).contains("has NaN"));
    // Casters on the host make pictures without alpha.
    let opaque = Radiance { coverage: Vec::new(), ..reference.radiance.clone() };
    assert!(judge(&opaque, &reference).ok);
}

#[test]
fn a_sample_judges_its_own_pixels_and_finiteness_everywhere() {
    let scene = fixtures::figure_4();
    let size = [80, 50];
    let reference =
        reference_of(&scene, size, Culling::None, &some_pixels(size, 900), (&[Sample::CENTRE], &|_| 1));
    let mut image = self::reference(&scene, [80, 50], Culling::None).radiance;
    assert!(judge(&image, &reference).ok);
    let elsewhere = (0..4000).find(|&at| reference.radiance.pixels[at] == [0.0; 3]).expect("a pixel");
    image.pixels[elsewhere] = [9.0; 3];
    assert!(judge(&image, &reference).ok);
    image.pixels[elsewhere][0] = f32::NAN;
    assert!(!judge(&image, &reference).ok);
    image.pixels.fill([0.3; 3]);
    let verdict = judge(&image, &reference);
    assert!(!verdict.ok && (800..=900).contains(&verdict.wrong_pixels), "{verdict:?}");
}

#[test]
fn an_image_of_another_size_is_wrong() {
    let reference = judged();
    let verdict = judge(&Radiance::new(50, 80), &reference);
    let expected = Verdict {
        max_difference: Some(f64::INFINITY),
        worst_pixel: None,
        uncertain_pixels: reference.uncertain_pixels(),
        unexplained_pixels: reference.uncertain_pixels(),
        wrong_pixels: 4000,
        ok: false,
        reason: Some("the image is 50 x 80 with 4000 pixels and should be 80 x 50".to_owned()),
    };
    assert_eq!(verdict, expected);
    assert!(reference.uncertain_pixels() > 0);
    let short = Radiance { pixels: vec![[0.0; 3]; 3999], ..Radiance::new(80, 50) };
    assert!(!judge(&short, &reference).ok, "a pixel is missing");
}

#[test]
fn a_certain_pixel_may_be_off_by_a_thousandth_and_no_more() {
    let reference = judged();
    let off_by = |part: f32| {
        let mut image = reference.radiance.clone();
        image.pixels[0] = image.pixels[0].map(|channel| channel * (1.0 + part));
        judge(&image, &reference)
    };
    assert!(off_by(0.0009).ok && off_by(-0.0009).ok);
    assert_eq!((off_by(0.0011).wrong_pixels, off_by(-0.0011).wrong_pixels), (1, 1));
}

/// The radiances 0 and 1e-6 differ by a thousandth of the reference's `floor`. A difference of a thousandth
/// is within the limit for relative differences. With a gamma of 4, these radiances are displayed with a
/// difference of eight 8-bit steps, which makes the pixel wrong.
#[test]
fn a_certain_pixel_may_be_off_by_one_step_as_displayed() {
    let display = Display { exposure: 1.0, gamma: 4.0, ..Display::default() };
    let mut reference = judged();
    reference.certain.fill(true);
    reference.doubts.clear();
    reference.floor = 1e-3;
    for [actual, expected] in [[1e-6, 0.0], [0.0, 1e-6]] {
        reference.radiance.pixels[0] = [expected; 3];
        let mut image = reference.radiance.clone();
        image.pixels[0] = [actual; 3];
        assert!(verify(&image, None, &reference, Display::default()).ok);
        let verdict = verify(&image, None, &reference, display);
        let is_small = |difference: f64| difference < RELATIVE_LIMIT * 1.01;
        assert!(verdict.wrong_pixels == 1 && verdict.max_difference.is_some_and(is_small), "{verdict:?}");
    }
}

#[test]
fn the_worst_pixel_is_a_wrong_one_where_there_is_any() {
    let mut reference = judged();
    reference.certain.fill(true);
    reference.doubts.clear();
    reference.floor = 1e-3;
    reference.radiance.pixels[..2].fill([0.0; 3]);
    let mut image = reference.radiance.clone();
    // The first pixel has a relative difference of nearly a thousandth, but is displayed with the same value
    // as in the reference. The image's second pixel has a smaller relative difference, but is displayed with
    // another value than in the reference. Only the second pixel is wrong.
    reference.radiance.pixels[0] = [0.5; 3];
    image.pixels[0] = [0.5 * 1.0009; 3];
    image.pixels[1] = [5e-7; 3];
    let verdict =
        verify(&image, None, &reference, Display { exposure: 1.0, gamma: 4.0, ..Display::default() });
    assert_eq!((verdict.wrong_pixels, verdict.worst_pixel), (1, Some([1, 0])), "{verdict:?}");
}

/// Pixels darker than the reference's `floor` (a radiance) are compared relative to this floor. A dark
/// uncertain pixel may therefore lie outside the range of its allowed values by a thousandth of the floor.
#[test]
fn a_dark_doubtful_pixel_may_stray_as_far_as_one_of_the_floors_brightness() {
    let mut reference = judged();
    doubt_first(&mut reference, 1);
    reference.floor = 1e-2;
    reference.doubts.iter_mut().for_each(|doubt| (doubt.low, doubt.high) = ([1e-6; 3], [2e-6; 3]));
    let strays = |actual: f32| {
        let mut image = reference.radiance.clone();
        image.pixels[0] = [actual; 3];
        judge(&image, &reference).unexplained_pixels
    };
    assert_eq!([1.1e-5, 1.3e-5, 0.0].map(strays), [0, 1, 0]);
}

#[test]
fn a_doubtful_pixel_may_be_too_dark() {
    let mut reference = judged();
    let count = unexplained_limit(80 * 50) + 1;
    doubt_first(&mut reference, count);
    reference.doubts.iter_mut().for_each(|doubt| doubt.low = [0.3; 3]);
    let mut image = reference.radiance.clone();
    image.pixels[..count].fill([0.2; 3]);
    assert_eq!(judge(&image, &reference).unexplained_pixels, count);
}

#[test]
fn one_channel_outside_its_range_is_enough() {
    for channel in 0..3 {
        let mut reference = judged();
        doubt_first(&mut reference, 1);
        let mut image = reference.radiance.clone();
        image.pixels[0] = [0.4; 3];
        image.pixels[0][channel] = 0.6;
        assert_eq!(judge(&image, &reference).unexplained_pixels, 1);
    }
}

#[test]
fn one_wrong_pixel_is_in_the_singular() {
    let reference = judged();
    let reason = |wrong: usize| {
        let mut image = reference.radiance.clone();
        image.pixels[..wrong].iter_mut().for_each(|pixel| *pixel = [f32::NAN; 3]);
        judge(&image, &reference).reason.unwrap_or_default()
    };
    assert!(reason(1).contains("1 pixel is wrong; the worst, (0, 0), is not finite"), "{}", reason(1));
    assert!(reason(2).contains("2 pixels are wrong"), "{}", reason(2));
}

#[test]
fn hits_within_the_range_that_the_reference_allows_are_right() {
    let mut reference = judged();
    reference.hits_range = [1000, 2000];
    let is_right = |hits| verify(&reference.radiance, Some(hits), &reference, Display::default()).ok;
    assert!([984, 1000, 1500, 2000, 2016].into_iter().all(is_right));
    assert!(![983, 2017].into_iter().any(is_right));
}

#[test]
fn of_a_large_image_more_pixels_may_be_unexplained() {
    assert_eq!(too_many_unexplained(40, 400_000), None);
    let reason = too_many_unexplained(41, 400_000).unwrap_or_default();
    assert!(
        reason.starts_with("41 of 400000 pixels") && reason.contains("at most 40 such pixels"),
        "{reason}"
    );
}

#[test]
fn a_certain_pixel_that_is_off_by_two_steps_as_displayed_is_wrong() {
    let display = Display { exposure: 1.0, gamma: 4.0, ..Display::default() };
    let shown = |radiance: f32| {
        let image = Radiance { pixels: vec![[radiance; 3]], ..Radiance::new(1, 1) };
        to_rgb8(&image, display).get_pixel(0, 0).0[0]
    };
    let radiance_of = |step: u8| {
        let mut all = (0..1000_u16).map(|number| f32::from(number) * 1e-7);
        all.find(|radiance| shown(*radiance) == step).expect("a radiance")
    };
    let mut reference = judged();
    reference.certain.fill(true);
    reference.doubts.clear();
    // The pixel is so dark that every difference is within the relative limit.
    reference.floor = 1e-2;
    reference.radiance.pixels[0] = [radiance_of(10); 3];
    let wrong_pixels = |step: u8| {
        let mut image = reference.radiance.clone();
        image.pixels[0] = [radiance_of(step); 3];
        verify(&image, None, &reference, display).wrong_pixels
    };
    assert_eq!([8, 9, 11, 12].map(wrong_pixels), [1, 0, 0, 1]);
}
