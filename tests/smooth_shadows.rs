//! Smooth shadows, in every kernel family, and the scenes that get smooth shadows by default.

use crate::binary::{WorkFolder, apart, device, repository};
use crate::common::{due, soon};
use image::RgbImage;

/// Strategies of several kernel families, which cast rays one by one and in vectors, with and without planes
/// through a common origin, with and without a tree, in fused and in separate passes.
const FAMILIES: [&str; 4] = ["wide-common-origin", "bvh-packet", "tile", "tile,passes=separate"];
const OFF: [&str; 2] = ["--set", "smooth_shadows=false"];
/// A light with a radius, and a sky.
const SOFT: [&str; 4] = ["--set", "light.0.radius=0.4", "--set", "sky.zenith=0.05"];

/// Returns a folder with the scene of tests/data/smooth.toml.
fn coarse() -> WorkFolder {
    let scene = std::fs::read_to_string(repository("tests/data/smooth.toml")).expect("a scene");
    WorkFolder::with(&[("scene.toml", &scene)])
}

/// Renders `scene` at a size that is not a multiple of a tile or of a block of rays.
fn picture(folder: &WorkFolder, scene: &str, options: &[&str]) -> RgbImage {
    let device = device();
    let usual = ["render", scene, "--width", "61", "--height", "43", "--device", &device];
    folder.output(&[&usual, &["-o", "a.png", "--force"][..], options].concat());
    image::open(folder.path("a.png")).expect("a picture").to_rgb8()
}

#[test]
fn smooth_shadows_of_a_point_agree_with_the_reference_in_every_family() {
    let folder = coarse();
    let off = picture(&folder, "scene.toml", &OFF);
    let more = ["naive", "deferred", "bvh,shading=eager,passes=fused,vectors=heap", "raster", "tile-group"];
    for strategy in due(soon(FAMILIES.into_iter().chain(more))) {
        let on = picture(&folder, "scene.toml", &["--verify", "--strategy", strategy]);
        assert!(apart(&on, &off) > 60, "{strategy}: {}", apart(&on, &off));
    }
}

#[test]
fn smooth_shadows_of_a_ball_and_a_sky_agree_with_the_reference() {
    let folder = coarse();
    for strategy in due(soon(FAMILIES.into_iter().chain(["tile-group"]))) {
        let options = [&["--verify=600", "--samples", "4", "--strategy", strategy][..], &SOFT].concat();
        picture(&folder, "scene.toml", &options);
    }
}

/// If there is neither soft light nor smooth shadows, the strategy `tile` shades most pixels once instead of once per
/// sample. With smooth shadows, `tile` shades every sample.
#[test]
fn smooth_shadows_of_sixteen_samples_agree_with_the_reference() {
    picture(&coarse(), "scene.toml", &["--verify=600", "--samples", "16", "--strategy", "tile"]);
}

/// Returns an OBJ file with a sphere that has twice as many segments as rings.
fn sphere(rings: u32) -> String {
    let mut text = String::new();
    for (ring, segment) in (0..=rings).flat_map(|ring| (0..2 * rings).map(move |segment| (ring, segment))) {
        let [polar, turn] = [ring, segment].map(|at| std::f64::consts::PI * f64::from(at) / f64::from(rings));
        let (x, y, z) = (polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin());
        text += &format!("v {x} {y} {z}\nvn {x} {y} {z}\n");
    }
    for (ring, segment) in (0..rings).flat_map(|ring| (0..2 * rings).map(move |segment| (ring, segment))) {
        let at = |down: u32, right: u32| {
            let index = 1 + (ring + down) * 2 * rings + (segment + right) % (2 * rings);
            format!("{index}//{index}")
        };
        text += &format!("f {} {} {} {}\n", at(0, 0), at(0, 1), at(1, 1), at(1, 0));
    }
    text
}

#[test]
fn a_coarse_bare_mesh_has_smooth_shadows_and_the_picture_of_half_light_is_right() {
    let folder = WorkFolder::with(&[("ball.obj", &sphere(6))]);
    let of = |more: &[&str]| picture(&folder, "ball.obj", &[&["--strategy", "tile"], more].concat());
    let usual = of(&["--verify"]);
    assert_eq!(usual, of(&["--set", "smooth_shadows=true"]));
    assert_ne!(usual, of(&OFF));
    // The plain look, which has no soft light, has no smooth shadows by default.
    assert_eq!(of(&["--plain"]), of(&[&["--plain"][..], &OFF].concat()));
    assert_ne!(of(&["--plain"]), of(&["--plain", "--set", "smooth_shadows=true"]));
}

#[test]
fn a_scene_file_has_smooth_shadows_only_if_it_says_so() {
    let folder = coarse();
    let of = |more: &[&str]| picture(&folder, "scene.toml", &[&["--strategy", "tile"], more].concat());
    let (on, off) = (of(&[]), of(&OFF));
    let without = folder.text("scene.toml").replace("smooth_shadows = true\n", "");
    folder.write("scene.toml", &without);
    assert_eq!(of(&[]), off);
    assert_ne!(on, off);
    folder.mistake(&["render", "scene.toml", "--set", "smooth_shadows=1"], 2);
}
