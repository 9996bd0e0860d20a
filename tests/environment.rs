//! Skies that are pictures of all directions, in every kernel family that supports a sky.

use crate::binary::{WorkFolder, device, has, repository};
use crate::common::{due, one_preset_of_each_family, soon};
use image::{Rgb, Rgb32FImage};
use raycl::scene::load_scene;
use raycl::strategy::preset;

/// A ground and a shiny gourd, seen from above.
const SCENE: &str = "[camera]
position = [0, 1, 3]
look_at = [0, 0.6, 0]
[sky]
picture = \"sky.hdr\"
strength = 0.5
turn_degrees = 30
[[light]]
position = [2, 3, 2]
power = 2
[[object]]
shape = \"gourd\"
triangles = 648
scale = 0.4
translation = [0, 0, 0]
material = { k_l = 0.6, k_g = 0.3, shininess = 60 }
[[object]]
vertices = [[-2, -0.5, 2], [2, -0.5, 2], [2, -0.5, -2], [-2, -0.5, -2]]
faces = [[0, 1, 2, 3]]
";

/// A camera that sees nothing but the picture of the sky.
const EMPTY: &str = "[camera]
position = [0, 0, 0]
fov_x_degrees = 90
[sky]
picture = \"sky.exr\"
[[object]]
vertices = [[0, -9, 0], [1, -9, 0], [0, -9, 1]]
faces = [[0, 1, 2]]
";

/// Returns a picture of 16 x 8 texels: brighter above, blue to the left of the middle and red to the right.
fn sky() -> Rgb32FImage {
    Rgb32FImage::from_fn(16, 8, |x, y| {
        let height = (8 - y) as f32 / 64.0;
        let side = (x as f32 - 7.5) / 160.0;
        Rgb([height + side.max(0.0), height, height + (-side).max(0.0)])
    })
}

fn folder_with(scene: &str) -> WorkFolder {
    let folder = WorkFolder::with(&[("scene.toml", scene)]);
    sky().save(folder.path("sky.hdr")).expect("a picture");
    sky().save(folder.path("sky.exr")).expect("a picture");
    folder
}

fn render(folder: &WorkFolder, options: &[&str]) -> Rgb32FImage {
    let device = device();
    let usual = ["render", "scene.toml", "--width", "61", "--height", "43", "--device", &device];
    folder.output(&[&usual, &["-o", "out.exr", "--force"][..], options].concat());
    image::open(folder.path("out.exr")).expect("a picture").to_rgb32f()
}

/// Returns names of presets: one preset of each family that supports a sky, and two whose work-items cast 16 rays
/// side by side. In `make test`, returns only some of these names.
fn families() -> impl Iterator<Item = &'static str> {
    let usual = one_preset_of_each_family().into_iter().map(|preset| preset.name);
    due(soon(usual.filter(|name| *name != "raster").chain(["wide-common-origin", "bvh-packet"])))
}

#[test]
fn every_family_with_a_sky_agrees_with_the_reference_under_a_picture() {
    let folder = folder_with(SCENE);
    for strategy in families() {
        for samples in ["1", "4"] {
            render(&folder, &["--verify=300", "--strategy", strategy, "--samples", samples]);
        }
    }
    for strategy in ["bvh", "tile"] {
        render(&folder, &["--verify=300", "--strategy", strategy, "--samples", "16", "--adaptive"]);
    }
}

/// A camera without a `look_at` looks at the picture's middle, and the picture's columns run from left to
/// right.
#[test]
fn directions_are_where_they_belong() {
    let folder = folder_with(EMPTY);
    let ahead = render(&folder, &["--verify"]);
    let [left, middle, right] = [0, 30, 60].map(|x| ahead[(x, 21)].0);
    assert!(left[2] > left[0] + 0.005 && right[0] > right[2] + 0.005, "{left:?} {right:?}");
    assert!((middle[0] - middle[2]).abs() < 0.002, "{middle:?}");
    assert!(ahead[(30, 0)].0[1] > ahead[(30, 42)].0[1] + 0.01, "brighter above");
    // After a quarter turn (counter-clockwise, seen from above), the picture's left part is behind the
    // camera, and its middle is on the left.
    let turned = render(&folder, &["--set", "sky.turn_degrees=90", "--verify"]);
    assert!(turned[(30, 21)].0[0] > middle[0] + 0.005, "{:?}", turned[(30, 21)]);
    let stronger = render(&folder, &["--set", "sky.strength=3"]);
    assert!((stronger[(9, 9)].0[1] / ahead[(9, 9)].0[1] - 3.0).abs() < 1e-3);
    // A pixel of an HDR file has 8 bits per channel and an exponent that all channels share, so colours may differ by
    // 2%.
    let hdr = render(&folder, &["--set", "sky.picture='sky.hdr'"]);
    assert!((hdr[(9, 9)].0[1] / ahead[(9, 9)].0[1] - 1.0).abs() < 0.02);
    // A background that the user sets hides the picture of the sky.
    let hidden = render(&folder, &["--background", "black", "--verify"]);
    assert!(hidden.pixels().all(|pixel| pixel.0 == [0.0; 3]));
}

/// The first row of the sky's picture is in the direction of the camera's `up`. In the changed kernel of this test, the
/// first row is in the direction of the y axis.
#[test]
fn the_picture_s_first_row_is_where_the_cameras_up_is() {
    let folder = folder_with(SCENE);
    let turned = ["--verify=300", "--set", "camera.up=[1, 0, 0]"];
    for strategy in ["bvh", "tile"] {
        render(&folder, &[&turned[..], &["--strategy", strategy]].concat());
    }
    folder.notices(("common/environment.cl", "dot3(direction, splat(up))", "direction.y"), "bvh", &turned);
}

/// After half a turn, the seam at which the picture's edges meet is straight ahead. Each changed kernel of
/// this test fails to continue the picture beyond its left or its right edge.
#[test]
fn the_picture_s_left_edge_continues_at_its_right_edge() {
    let folder = folder_with(&EMPTY.replace("[[object]]", "turn_degrees = 180\n[[object]]"));
    let seam = render(&folder, &["--verify", "--strategy", "bvh"]);
    let [left, middle, right] = [0, 30, 60].map(|x| seam[(x, 21)].0);
    assert!(left[0] > left[2] + 0.005 && right[2] > right[0] + 0.005, "{left:?} {right:?}");
    assert!((middle[0] - middle[2]).abs() < 0.002 && middle[0] > middle[1] + 0.01, "{middle:?}");
    for (from, to) in [
        ("SELECT(x0 < 0, (varying_int)(width - 1),", "SELECT(x0 < 0, (varying_int)(0),"),
        ("first + 1, (varying_int)(0))", "first + 1, first)"),
    ] {
        folder.notices(("common/environment.cl", from, to), "bvh", &["--verify"]);
    }
}

#[test]
fn what_is_wrong_with_a_sky_is_reported() {
    let device = device();
    let refused = |folder: &WorkFolder| folder.mistake(&["render", "scene.toml", "--device", &device], 2);
    let with = |from: &str, to: &str| folder_with(&SCENE.replace(from, to));
    has(&refused(&with("sky.hdr", "skies.hdr")), &["scene.toml:5", "did you mean `sky.hdr`?"]);
    has(&refused(&with("\"sky.hdr\"", "\"scene.toml\"")), &["is neither a Radiance HDR nor an OpenEXR"]);
    has(&refused(&with("strength = 0.5", "zenith = 1")), &["a sky is a picture, or has a zenith"]);
    has(&refused(&with("picture = \"sky.hdr\"", "zenith = 1")), &["belong to a picture"]);
    has(
        &refused(&with("picture = \"sky.hdr\"\nstrength = 0.5\nturn_degrees = 30", "reach = 1")),
        &["a sky has a zenith or a picture"],
    );
    let raster = ["render", "scene.toml", "--device", &device, "--strategy", "raster"];
    has(
        &folder_with(SCENE).mistake(&raster, 2),
        &["traversal = raster does not support a sky, which the scene has"],
    );
}

#[test]
fn texels_that_are_clearly_negative_or_not_a_number_are_noted_and_infinite_ones_are_refused() {
    let folder = folder_with(EMPTY);
    let load = |blue: f32| {
        let texel = |x, _| Rgb([1.0, 1.0, if x == 1 { blue } else { 1.0 }]);
        Rgb32FImage::from_fn(4, 2, texel).save(folder.path("sky.exr")).expect("a picture");
        load_scene(&folder.path("scene.toml"))
    };
    let notes = |blue| -> Vec<String> {
        let notes = load(blue).expect("a scene").notes;
        notes.into_iter().filter(|note| note.contains("negative values")).collect()
    };
    for noted in [-0.5, f32::NAN] {
        let expected =
            "the sky's picture `sky.exr` has negative values or NaN in 2 texels; such values count as 0";
        assert_eq!(notes(noted), [expected]);
    }
    assert!(notes(-1e-5).is_empty());
    let refused = load(f32::INFINITY).expect_err("a mistake").to_string();
    has(&refused, &["in column 1, row 0", "expected at most 1e28"]);
}

/// A frame must not depend on which pixels saw the sky in the previous frame.
#[test]
fn a_frame_is_the_same_after_another_one_as_alone() {
    let folder = folder_with(SCENE);
    let device = device();
    let frames = |name: &str, strategy: &str, more: &[&str]| {
        let usual =
            ["render", "scene.toml", "--turntable", "3", "--samples", "4", "--width", "61", "--height", "43"];
        let ends = ["--device", &device, "--strategy", strategy, "-o", name, "--force"];
        folder.output(&[&usual[..], &ends, more].concat());
    };
    for strategy in ["deferred", "tile"] {
        frames("all.png", strategy, &[]);
        frames("last.png", strategy, &["--frames", "3..3"]);
        let read = |name: &str| image::open(folder.path(name)).expect("a picture").to_rgb8();
        assert!(read("all-0003.png") == read("last-0003.png"), "{strategy}");
        assert!(read("all-0002.png") != read("all-0003.png"), "{strategy}");
    }
}

/// Each change is a mistake in a kernel. For example, the changed kernel reads another channel or another row
/// of the sky's picture, shifts the picture by half a texel, or shows the sky in front of surfaces.
#[test]
fn a_broken_picture_of_the_sky_is_a_wrong_picture() {
    let folder = folder_with(SCENE);
    for (file, from, to, strategy, samples) in due([
        ("common/environment.cl", "blue.each[lane] = texel[2]", "blue.each[lane] = texel[1]", "bvh", "1"),
        ("common/environment.cl", "clamp(y0 + 1, 0, height - 1)", "clamp(y0, 0, height - 1)", "tile", "1"),
        ("common/environment.cl", "SELECT(first + 1 < width,", "SELECT(first + 1 <= width,", "deferred", "1"),
        ("common/environment.cl", "around * (float)width - 0.5f", "around * (float)width", "bvh", "1"),
        ("common/environment.cl", "(surface->shininess + 8.0f)", "(surface->shininess + 1.0f)", "bvh", "1"),
        ("common/show_sky.cl", "image[at].w == 0.0f", "image[at].w != 0.0f", "tile-group", "1"),
        ("common/show_sky.cl", "earlier ? hits_before[at] : 0", "0", "tile", "4"),
        ("common/show_sky.cl", "shown / count", "shown", "tile-group", "4"),
    ]) {
        folder.notices((file, from, to), strategy, &["--verify", "--samples", samples]);
    }
}

/// If work-items share a tile, the lights are processed in rounds, a fixed number of lights at a time. The
/// sky is processed after the last light. In this scene, the lights fill a round of lights, so that the sky
/// is processed in a round of its own. tests/mutants/kernels.toml has a change that adds the mirrored picture
/// in both rounds.
#[test]
fn a_shiny_surface_mirrors_the_sky_once_if_the_lights_fill_a_round() {
    let path = repository("tests/data/mirrors.toml");
    let lights = load_scene(&path).expect("a scene").scene.lights.len();
    let tiles = preset("tile-group").expect("a preset").strategy;
    assert_eq!(lights, tiles.lights_of_round());
    let (device, path) = (device(), path.to_str().expect("UTF-8"));
    let usual = ["render", path, "--width", "61", "--height", "43", "--device", &device];
    WorkFolder::new()
        .output(&[&usual[..], &["--verify", "--strategy", "tile-group", "-o", "a.png"]].concat());
}

/// A blunt highlight has many half vectors whose mirrored direction is below the surface.
#[test]
fn what_is_mirrored_from_below_a_surface_is_dark() {
    let folder = folder_with(&SCENE.replace("shininess = 60", "shininess = 2"));
    render(&folder, &["--verify", "--strategy", "bvh"]);
    let lighter =
        ("common/environment.cl", "max(dot3(direction, normal), (varying)(0.0f))", "dot3(direction, normal)");
    folder.notices(lighter, "bvh", &["--verify", "--samples", "1"]);
}

/// A shiny triangle whose normals lean away from the eye, so that many half vectors point away from the eye. The
/// directions that are mirrored at such half vectors may be above the surface.
const LEANING: &str = "[camera]
position = [0, 0, 3]
fov_x_degrees = 40
[sky]
picture = \"sky.hdr\"
[[object]]
vertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]
faces = [[0, 1, 2]]
normals = [[0.96, 0, -0.28]]
face_normals = [[0, 0, 0]]
material = { k_l = 0, k_g = 1, shininess = 2 }
";

#[test]
fn a_half_vector_that_points_away_from_the_eye_mirrors_nothing() {
    let folder = folder_with(LEANING);
    for strategy in ["bvh", "tile"] {
        render(&folder, &["--verify", "--strategy", strategy]);
    }
    folder.notices(
        ("common/environment.cl", "max(to_half, (varying)(0.0f))", "to_half"),
        "bvh",
        &["--verify"],
    );
}

/// A shiny square, seen from straight ahead. Kernels choose half vectors around a fixed axis, and apply the
/// shortest rotation that turns this axis to the surface's normal. The normal of this square is opposite to
/// the kernels' fixed axis, so the shortest rotation is undefined.
const OPPOSITE: &str = "[camera]
position = [-1.08, -1.44, -2.4]
look_at = [0, 0, 0]
[sky]
picture = \"sky.hdr\"
[[object]]
vertices = [[1.2, -0.9, 0], [0.72, 0.96, -0.9], [-1.2, 0.9, 0], [-0.72, -0.96, 0.9]]
faces = [[0, 1, 2, 3]]
normals = [[-0.36, -0.48, -0.8]]
face_normals = [[0, 0, 0, 0]]
material = { k_l = 0.6, k_g = 0.3, shininess = 60 }
";

#[test]
fn a_shiny_surface_whose_normal_is_opposite_to_the_turned_axis_mirrors_the_sky_too() {
    let folder = folder_with(OPPOSITE);
    for strategy in families() {
        render(&folder, &["--verify", "--strategy", strategy]);
    }
    let undefined = (
        "common/environment.cl",
        "max(1.0f + dot3(axis, normal), (varying)(1e-6f))",
        "(1.0f + dot3(axis, normal))",
    );
    folder.notices(undefined, "bvh", &["--verify"]);
}

/// Under a picture of a sky that has the same radiance everywhere, a highlight seen from straight above reflects the
/// integral of its lobe.
#[test]
fn a_shiny_surface_mirrors_what_its_highlight_says_on_average() {
    let scene = "[camera]\nposition = [0, 0, 5]\nfov_x_degrees = 1\n[sky]\npicture = \"sky.exr\"\n[[object]]\n\
                 vertices = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]\nfaces = [[0, 1, 2, 3]]\n\
                 material = { k_l = 0, k_g = 0.5, shininess = 20 }\n";
    let folder = WorkFolder::with(&[("scene.toml", scene)]);
    let radiance = 0.05;
    Rgb32FImage::from_pixel(4, 2, Rgb([radiance; 3])).save(folder.path("sky.exr")).expect("a picture");
    let picture = render(&folder, &["--samples", "64"]);
    let mean = picture.pixels().map(|pixel| pixel.0[1]).sum::<f32>() / (61.0 * 43.0);
    // An integral over half vectors, where c is the cosine of a half vector. The integrand is the product of
    // the half vectors' density, the cosine c, and the mirrored direction's cosine 2 c^2 - 1.
    let steps = 100_000;
    let density = |c: f32| (20.0 + 8.0) * c.powf(20.0) * c * (2.0 * c * c - 1.0).max(0.0);
    let integral =
        (0..steps).map(|i| density((i as f32 + 0.5) / steps as f32) as f64).sum::<f64>() / f64::from(steps);
    let expected = 0.5 * radiance * integral as f32;
    assert!((mean / expected - 1.0).abs() < 0.005, "{mean}, expected {expected}");
}
