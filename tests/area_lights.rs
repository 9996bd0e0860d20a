//! Area lights (rectangles and discs) in every kernel family.

use crate::binary::{WorkFolder, device, has};
use crate::common::{due, soon};
use image::RgbImage;

/// A square over the ground, lit by four lights: a rectangle, a disc, a ball and a point. The plane of the
/// rectangle cuts the ground within the picture, so a part of the ground sees only the rectangle's back. The
/// disc is an ellipse.
const LAMPS: &str = "[camera]
position = [0, 1.2, 1.5]
look_at = [0, -0.7, -3]
[[light]]
position = [-0.4, 2, -3]
power = 20
edges = [[0.9, -0.9, 0.3], [0, 0.5, 1.5]]
[[light]]
position = [1.5, 2.5, -2]
power = [5, 10, 15]
edges = [[1.5, 0.2, 0], [0, 0, 0.8]]
shape = \"disc\"
[[light]]
position = [-3, 2, -1]
power = 5
radius = 0.3
[[light]]
position = [3, 2, 0]
power = 5
[[object]]
vertices = [[-0.7, 0, -3.7], [0.7, 0, -3.7], [0.7, 0, -2.3], [-0.7, 0, -2.3]]
faces = [[0, 3, 2, 1]]
material = { k_g = 0.3, shininess = 20 }
[[object]]
shape = \"ground\"
";

/// Strategies of several kernel families, which cast rays one by one and in vectors, with and without planes
/// through a common origin, with and without a tree, in fused and in separate passes.
const FAMILIES: [&str; 5] = ["naive", "wide-common-origin", "bvh", "tile", "tile,passes=separate"];

fn picture(folder: &WorkFolder, options: &[&str]) -> RgbImage {
    let device = device();
    let usual = ["render", "scene.toml", "--width", "60", "--height", "40", "--device", &device];
    folder.output(&[&usual, &["-o", "a.png", "--force"][..], options].concat());
    image::open(folder.path("a.png")).expect("a picture").to_rgb8()
}

#[test]
fn every_family_agrees_with_the_reference() {
    let folder = WorkFolder::with(&[("scene.toml", LAMPS)]);
    let families = soon(FAMILIES.into_iter().chain(["tile-group"]));
    let all = families.flat_map(|strategy| ["4", "1"].map(|samples| (strategy, samples)));
    for (strategy, samples) in due(all) {
        picture(&folder, &["--strategy", strategy, "--samples", samples, "--verify"]);
    }
    picture(&folder, &["--strategy", "raster", "--samples", "1", "--verify"]);
    let device = device();
    let raster = [
        "render",
        "scene.toml",
        "--device",
        &device,
        "--strategy",
        "raster",
        "--samples",
        "4",
        "-o",
        "a.png",
    ];
    has(&folder.mistake(&raster, 2), &["does not support lights with a radius or edges", "--samples 1"]);
}

#[test]
fn a_light_shines_to_the_side_of_the_edges_cross_product() {
    let text = "[camera]\nposition = [0, 3, -4]\nlook_at = [0, 0, -4]\nup = [0, 0, -1]\n[[light]]\nposition = [0, 0, -4]\npower = 1\n\
         edges = [[1, 0, 0], [0, 0, 1]]\n[[object]]\nshape = \"ground\"\n[display]\nexposure = 2\ngamma = 1\n";
    let folder = WorkFolder::with(&[("scene.toml", text)]);
    let middle = |options: &[&str]| u32::from(picture(&folder, options)[(30, 20)].0[1]);
    // The ground is 1 below the light. The expected value is 255 x 2 (exposure) x 0.8 / pi (the ground's reflectance) x
    // 1 / pi (four times power / (4 pi r^2)).
    let is_near =
        |value: u32, expected: f64| assert!((f64::from(value) - expected).abs() < 2.0, "{value} {expected}");
    is_near(middle(&["--verify"]), 510.0 * 0.8 / std::f64::consts::PI.powi(2));
    let upwards = ["--set", "light.0.edges=[[0, 0, 1], [1, 0, 0]]", "--verify"];
    assert_eq!(middle(&upwards), 0);
    assert_eq!(middle(&[&upwards[..], &["--samples", "4"]].concat()), 0);
    // The rectangle's form factor at this point is 0.2395 (Lambert's formula), and the radiance of its front is 1 / pi.
    is_near(middle(&["--samples", "64"]), 510.0 * 0.8 * 0.2395 / std::f64::consts::PI);
}

#[test]
fn an_animation_turns_an_area_light() {
    let track = "[animation]\nframes = 2\n[[animation.track]]\npath = \"light.0.edges\"\n\
                 values = [[[0.9, -0.9, 0.3], [0, 0.5, 1.5]], [[0.9, 0.9, 0.3], [0, 0.5, 1.5]]]\n";
    let folder = WorkFolder::with(&[("scene.toml", LAMPS), ("turning.toml", &format!("{LAMPS}{track}"))]);
    let device = device();
    let own = ["--strategy", "tile", "--samples", "2"];
    let usual =
        ["render", "turning.toml", "--animate", "--width", "60", "--height", "40", "--device", &device];
    folder.output(&[&usual[..], &own, &["-o", "f.png"]].concat());
    let still = |options: &[&str]| picture(&folder, &[&own[..], options].concat());
    let frames = ["f-0001.png", "f-0002.png"];
    let frames = frames.map(|name| image::open(folder.path(name)).expect("a frame").to_rgb8());
    assert!(frames == [still(&[]), still(&["--set", "light.0.edges.0.1=0.9"])]);
    assert!(frames[0] != frames[1]);
}

#[test]
fn a_light_is_a_point_a_ball_or_a_surface() {
    let folder = WorkFolder::with(&[("scene.toml", LAMPS)]);
    for (set, parts) in [
        ("light.0.radius=1", "a light has a radius of 1 and edges"),
        ("light.0.edges=[[1, 0, 0], [-2, 0, 0]]", "neither zero nor parallel"),
        ("light.0.edges=[[1, 0, 0], [0, 0, 0]]", "neither zero nor parallel"),
        ("light.0.edges=[[1, 0, 0]]", "1 edge; expected the two edges of a rectangle"),
        ("light.2.shape=disc", "a light has a shape but no edges"),
        ("light.1.shape=square", "square"),
    ] {
        has(&folder.mistake(&["render", "scene.toml", "--set", set], 2), &[parts]);
    }
}

/// Each change is one mistake in a kernel: in the choice of a light's sample point, in the received light, or
/// in the side to which a light shines.
#[test]
fn a_broken_area_light_is_a_wrong_picture() {
    let folder = WorkFolder::with(&[("scene.toml", LAMPS)]);
    for (file, from, to, strategy, samples) in due([
        ("common/area_light.cl", "max(-dot3(to_light,", "max(dot3(to_light,", "tile", "1"),
        ("common/area_light.cl", "return (varying)(1.0f);", "return (varying)(4.0f);", "bvh", "1"),
        ("common/area_light.cl", "down = b - 0.5f;", "down = a - 0.5f;", "bvh", "2"),
        ("common/area_light.cl", "0.5f * sqrt(a)", "0.5f * a", "tile", "2"),
        ("common/area_light.cl", "distance * cospi", "distance * sinpi", "tile", "2"),
        ("common/soft.cl", "off_centre(at, u.x, u.y)", "off_centre(at, u.x, u.z)", "bvh", "2"),
        ("cast/shade.cl", "share / (4.0f", "1.0f / (4.0f", "wide-common-origin", "1"),
        ("tile_cpu/light_rays.cl", "spread *= direction->share;", "", "tile", "1"),
        ("tile_cpu/soft.cl", "share * cosine", "4.0f * cosine", "tile", "2"),
        ("tile_gpu/shade.cl", "share * cosine", "4.0f * cosine", "tile-group", "1"),
        (
            "tile_gpu/soft.cl",
            "faces_it &= share_towards(at, sight.direction) > 0.0f",
            "faces_it = 0",
            "tile-group",
            "2",
        ),
    ]) {
        folder.notices((file, from, to), strategy, &["--verify", "--samples", samples]);
    }
}
