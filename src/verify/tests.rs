//! What is right, what is wrong, and what is said of it.

use super::*;
use crate::reference::{fixtures, reference, reference_of, some_pixels};
use crate::scene::Sample;
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
    assert!(verdict.reason.unwrap_or_default().contains("nudges"));
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
        assert!(reason.starts_with(&format!("{hits} pixels hit something")), "{reason}");
    }
}

#[test]
fn a_sample_judges_its_own_pixels_and_finiteness_everywhere() {
    let scene = fixtures::figure_4();
    let size = [80, 50];
    let reference = reference_of(&scene, size, Culling::None, &some_pixels(size, 900), &[Sample::CENTRE]);
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
    assert!(!verdict.ok && verdict.reason.unwrap_or_default().contains("50 x 80"));
}
