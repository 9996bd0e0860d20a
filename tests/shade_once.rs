//! Tiles on a CPU shade many pixels only once, although these pixels have several samples (cl/tile_cpu/shade_once.cl).

use crate::binary::WorkFolder;
use crate::common::due;

/// Coloured lights shine on a smooth, shiny ball on the ground. Most pixels can be shaded once instead of
/// once per sample, but not those at edges, at edges of shadows, in highlights, and where light grazes the
/// surface. The lights are distant, and the camera has a long focal length, so that light hardly differs
/// within a pixel, as in a large picture.
const BALL: &str = "[camera]
position = [0, 1, 3]
look_at = [-0.5, -0.35, -2.3]
fov_x_degrees = 16
[[light]]
position = [40, 60, 40]
power = [30e3, 20e3, 10e3]
[[light]]
position = [-60, 10, 60]
power = [5e3, 15e3, 25e3]
[[object]]
shape = \"sphere\"
triangles = 300
translation = [0, 0, -3]
material = { k_l = [0.5, 0.7, 0.9], k_g = 0.4, shininess = 300 }
[[object]]
shape = \"ground\"
";

/// The picture's height is no multiple of the height of a tile, which has 8 x 4 pixels. A frame has 16 rays per pixel,
/// each for one sample; with 13 samples, some rays have no sample, and 35 samples need three frames.
#[test]
fn pixels_shaded_once_agree_with_the_reference() {
    let folder = WorkFolder::with(&[("scene.toml", BALL)]);
    for strategy in ["tile", "tile,intersector=watertight"] {
        for samples in ["13", "16", "35"] {
            folder.picture(&["--strategy", strategy, "--samples", samples, "--verify"]);
        }
        folder.picture(&["--strategy", strategy, "--samples", "16", "--adaptive", "--verify"]);
    }
}

/// A ball whose diffuse reflection is green, and whose highlight is red, under a red light: only the highlight is
/// visible.
const COLOURED: &str = "[camera]
position = [0, 1, 3]
look_at = [0.2, 0, -3]
fov_x_degrees = 10
[[light]]
position = [40, 60, 40]
power = [30e3, 0, 0]
[[object]]
shape = \"sphere\"
triangles = 300
translation = [0, 0, -3]
material = { k_l = [0, 10, 0], k_g = [0.4, 0, 0], shininess = 30 }
";

/// A plane seen from behind. The light and the plane's normals are on the side that the eye does not see. The highlight
/// ends at a line. Beyond this line, the half vector (halfway between the directions to light and eye) points to the
/// eye's side of the plane.
const BEHIND: &str = "[camera]
position = [0, 1, 3]
look_at = [0.8, -1, 1]
fov_x_degrees = 12
[[light]]
position = [0.3, -2, 0.2]
power = 30
[[object]]
vertices = [[-3, -1, -3], [3, -1, -3], [3, -1, 3], [-3, -1, 3]]
normals = [[0, -1, 0]]
faces = [[3, 2, 1, 0]]
face_normals = [[0, 0, 0, 0]]
material = { k_l = 0.001, k_g = 1, shininess = 2 }
";

/// From the surface's diffuse reflection alone, raycl would find that the radiance hardly differs within a pixel. In
/// the two scenes of this test, however, the highlight differs much more within some pixels.
#[test]
fn pixels_with_the_end_of_a_highlight_or_nothing_but_a_highlight_agree_with_the_reference() {
    for scene in [COLOURED, BEHIND] {
        let folder = WorkFolder::with(&[("scene.toml", scene)]);
        folder.picture(&["--strategy", "tile", "--samples", "16", "--verify"]);
    }
    let folder = WorkFolder::with(&[("scene.toml", COLOURED)]);
    let white =
        ("tile_cpu/shade_once.cl", "multiply(colour, mean->surface.lambertian)", "mean->surface.lambertian");
    folder.notices_in(["60", "43"], white, "tile", &["--verify", "--samples", "16"]);
}

/// Each changed kernel shades pixels once that must be shaded per sample, or makes a mistake in shading,
/// bounding or storing pixels that are shaded once.
#[test]
fn a_mistake_in_shading_once_is_a_wrong_picture() {
    let folder = WorkFolder::with(&[("scene.toml", BALL)]);
    let (find, light) = ("tile_cpu/shade_once.cl", "tile_cpu/light_once.cl");
    for (file, from, to) in due([
        (light, "if (bits == all) whole |=", "if (bits) whole |="),
        (find, "ONCE_ERROR 1e-4f", "ONCE_ERROR 1.0f"),
        (find, "return one_side & (direction", "return (direction"),
        (find, "ANY(samples->filled & (hits != first))", "0"),
        (light, "if (bits == all || !bits) continue;", "continue;"),
        (light, "add(sum[vector], splat(mean))", "sum[vector]"),
        (light, "SELECT(pixels, arriving.y, ", "SELECT(pixels, arriving.x, "),
        (light, "VALUE_OF(once->inverse_depth[1], vector)", "VALUE_OF(once->inverse_depth[0], vector)"),
        (light, "SELECT(lit, least[axis] - rounding,", "SELECT(lit, most[axis] + rounding,"),
        (light, "end[part] = per_reach[part] / (1.0f - gap);", "end[part] = 0.9f * per_reach[part];"),
        (light, "&corner)), x, across), y, down)", "&corner)), y, across), x, down)"),
        (find, "high = vec3(max(high.x, hit.x)", "high = vec3(min(high.x, hit.x)"),
        (
            "tile_cpu/store_tile.cl",
            "vload16(0, (const float *)(sums + vector))",
            "vload16(0, (const float *)sums)",
        ),
    ]) {
        // Four pixels of a row are stored together if the width is a multiple of four.
        folder.notices_in(["60", "43"], (file, from, to), "tile", &["--verify", "--samples", "16"]);
    }
}
