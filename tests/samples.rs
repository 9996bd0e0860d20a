//! Several samples of each pixel.

use crate::binary::{Place, TRIANGLE, device};
use image::RgbImage;
use std::collections::BTreeSet;

fn picture(place: &Place, options: &[&str]) -> RgbImage {
    let device = device();
    let usual =
        ["render", "scene.toml", "--width", "60", "--height", "40", "-o", "a.png", "--device", &device];
    place.output(&[&usual[..], options].concat());
    image::open(place.path("a.png")).expect("a picture").to_rgb8()
}

#[test]
fn edges_are_smooth_and_every_sample_agrees_with_the_reference() {
    let place = Place::with(&[("scene.toml", TRIANGLE)]);
    let colours = |picture: &RgbImage| picture.pixels().map(|pixel| pixel.0).collect::<BTreeSet<_>>().len();
    let one = picture(&place, &["--samples", "1"]);
    assert_eq!(one, picture(&place, &[]));
    // In vectors and one by one, fused and separate, through a tree and without one.
    for strategy in ["naive", "wide-common-origin", "tile", "bvh-packet"] {
        let many = picture(&place, &["--samples", "9", "--strategy", strategy, "--verify"]);
        // Where no edge is near, the filter changes little.
        let inside = (many[(30, 20)].0, one[(30, 20)].0);
        assert!(inside.0.iter().zip(inside.1).all(|(a, b)| a.abs_diff(b) < 3), "{strategy}: {inside:?}");
        assert!(colours(&many) > colours(&one) + 20, "{strategy}: {} {}", colours(&many), colours(&one));
    }
    place.mistake(&["render", "scene.toml", "--samples", "0"], 2);
}
