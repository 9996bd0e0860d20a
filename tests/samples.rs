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

#[test]
fn lights_with_a_radius_are_soft_and_every_sample_agrees_with_the_reference() {
    // A square over the ground, and a light above it.
    let scene = "[camera]\nposition = [0, 1.2, 1.5]\nlook_at = [0, -0.7, -3]\n[[light]]\nposition = [0, 3, -3]\npower = 60\nradius = 0.6\n\
                 [[light]]\nposition = [3, 2, 0]\npower = 10\n\
                 [[object]]\nvertices = [[-0.7, 0, -3.7], [0.7, 0, -3.7], [0.7, 0, -2.3], [-0.7, 0, -2.3]]\nfaces = [[0, 3, 2, 1]]\n\
                 [[object]]\nshape = \"ground\"\n";
    let place = Place::with(&[("scene.toml", scene)]);
    let hard = picture(&place, &["--samples", "1", "--verify"]);
    let point = ["--samples", "16", "--set", "light.0.radius=0"];
    let sharp = picture(&place, &[&point[..], &["--verify"]].concat());
    for strategy in ["naive", "wide-common-origin", "tile", "bvh"] {
        let soft = picture(&place, &["--samples", "16", "--strategy", strategy, "--verify"]);
        // Half-shadows lie on the ground around the square's shadow, and nowhere else.
        let differing =
            soft.pixels().zip(sharp.pixels()).filter(|(a, b)| a.0[1].abs_diff(b.0[1]) > 8).count();
        assert!((20..600).contains(&differing), "{strategy}: {differing}");
    }
    let differing = hard.pixels().zip(sharp.pixels()).filter(|(a, b)| a.0[1].abs_diff(b.0[1]) > 60).count();
    assert!(differing < 120, "{differing}");
    let device = device();
    let render = ["render", "scene.toml", "--width", "16", "--height", "10", "--device", &device, "--force"];
    let said = place.output(&render);
    assert!(said.contains("1 light has a radius: with one sample per pixel"), "{said}");
    place.mistake(&[&render[..], &["--set", "light.0.radius=-1"]].concat(), 2);
}
