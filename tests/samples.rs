//! Pictures with several samples per pixel (`--samples`).

use crate::binary::{TRIANGLE, WorkFolder, device};
use crate::common::{due, is_long, soon};
use image::RgbImage;
use std::collections::BTreeSet;

fn picture(folder: &WorkFolder, options: &[&str]) -> RgbImage {
    let device = device();
    let usual =
        ["render", "scene.toml", "--width", "60", "--height", "40", "-o", "a.png", "--device", &device];
    folder.output(&[&usual[..], options].concat());
    image::open(folder.path("a.png")).expect("a picture").to_rgb8()
}

#[test]
fn edges_are_smooth_and_every_sample_agrees_with_the_reference() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let colours = |picture: &RgbImage| picture.pixels().map(|pixel| pixel.0).collect::<BTreeSet<_>>().len();
    let one = picture(&folder, &["--samples", "1"]);
    assert_eq!(one, picture(&folder, &[]));
    // The strategies differ in the number of rays per work-item, in fused and separate passes, and in the use
    // of a tree.
    for strategy in soon(["naive", "wide-common-origin", "tile", "tile-group", "bvh-packet"]) {
        let many = picture(&folder, &["--samples", "9", "--strategy", strategy, "--verify"]);
        // Far from edges, the filtered mean of nine samples is close to the single sample.
        let inside = (many[(30, 20)].0, one[(30, 20)].0);
        assert!(inside.0.iter().zip(inside.1).all(|(a, b)| a.abs_diff(b) < 3), "{strategy}: {inside:?}");
        assert!(colours(&many) > colours(&one) + 20, "{strategy}: {} {}", colours(&many), colours(&one));
    }
    folder.mistake(&["render", "scene.toml", "--samples", "0"], 2);
}

/// If a pixel has 4 samples, a vector of the strategy `tile` has 2 x 2 pixels. At the edges of a picture of an odd
/// size, some pixels of a vector lie outside the picture. In this scene, no pixel inside the picture shows the
/// background.
#[test]
fn pixels_outside_a_picture_of_an_odd_size_change_none_inside() {
    let scene = "[[light]]\nposition = [0, 0, 1]\npower = 10\n[[object]]\n\
        vertices = [[-99, -99, -1], [99, -99, -1], [99, 99, -1], [-99, 99, -1]]\nfaces = [[0, 1, 2, 3]]\n";
    let folder = WorkFolder::with(&[("scene.toml", scene)]);
    for strategy in soon(["bvh", "tile", "tile-group"]) {
        report(&folder, &["--samples", "4", "--strategy", strategy, "--verify"]);
    }
}

/// Renders a picture, and returns what the report of `raycl render` says about samples. At the picture's size
/// of 61 x 43 pixels, the last block of pixels in each row and in each column is partial.
fn report(folder: &WorkFolder, options: &[&str]) -> serde_json::Value {
    report_of_size(folder, ["61", "43"], options)
}

fn report_of_size(folder: &WorkFolder, [width, height]: [&str; 2], options: &[&str]) -> serde_json::Value {
    let device = device();
    let usual =
        ["render", "scene.toml", "--width", width, "--height", height, "-o", "b.png", "--json", "--device"];
    serde_json::from_str(&folder.output(&[&usual[..], &[&device, "--force"], options].concat()))
        .expect("JSON")
}

#[test]
fn adaptive_samples_are_cast_where_pixels_differ_and_agree_with_the_reference() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let families =
        ["naive", "wide-common-origin", "tile", "tile,passes=separate", "tile-group", "bvh-packet", "raster"];
    let means: Vec<f64> = soon(families)
        .map(|strategy| {
            let options = ["--samples", "16", "--adaptive", "--verify", "--strategy", strategy];
            let said = report(&folder, &options);
            assert_eq!(said["samples"], 16, "{strategy}");
            said["mean_samples"].as_f64().expect("a number")
        })
        .collect();
    // The number of samples that a pixel gets is the same in all kernel families. The scene's triangle has pixels at
    // its edges and pixels inside.
    assert!(means.iter().all(|mean| mean == &means[0]) && (3.0..12.0).contains(&means[0]), "{means:?}");
    let all = report(&folder, &["--samples", "16"]);
    assert_eq!((&all["samples"], &all["mean_samples"]), (&16.into(), &16.0.into()));
    assert_eq!(report(&folder, &["--adaptive"])["samples"], 16);
    folder.mistake(&["render", "scene.toml", "--adaptive", "--devices", "all"], 2);
}

/// The square's edge lies between two pixels and between two blocks of 4 x 4 pixels. A line of blocks across
/// the edge has ten blocks: the two blocks at the edge get 16 samples per pixel, and the other eight blocks
/// get one sample per pixel.
#[test]
fn an_edge_between_two_blocks_makes_both_rough_whatever_its_direction_and_colour() {
    let light = "[[light]]\nposition = [0, 0, 100]\npower = 1e5\n";
    let (right, above) = (
        "[0, -99, -1], [99, -99, -1], [99, 99, -1], [0, 99, -1]",
        "[-99, 0, -1], [99, 0, -1], [99, 99, -1], [-99, 99, -1]",
    );
    for (corners, size) in [(right, ["40", "8"]), (above, ["8", "40"])] {
        for colour in ["[0.8, 0, 0]", "[0, 0.8, 0]", "[0, 0, 0.8]"] {
            let object = format!(
                "[[object]]\nvertices = [{corners}]\nfaces = [[0, 1, 2, 3]]\nmaterial.k_l = {colour}\n"
            );
            let folder = WorkFolder::with(&[("scene.toml", &format!("background = 0\n{light}{object}"))]);
            let said = report_of_size(&folder, size, &["--samples", "16", "--adaptive"]);
            assert_eq!(said["mean_samples"], 4.0, "{size:?}, {colour}");
        }
    }
}

/// The changed kernel finds every block rough whose neighbouring pixels it compares. It compares neighbours only in
/// blocks whose brightest and darkest pixel differ visibly, so no block of an evenly lit wall becomes rough.
#[test]
fn neighbours_are_compared_only_in_blocks_whose_pixels_differ() {
    let wall = "[[light]]\nposition = [0, 0, 100]\npower = 1e5\n[[object]]\n\
        vertices = [[-99, -99, -1], [99, -99, -1], [99, 99, -1], [-99, 99, -1]]\nfaces = [[0, 1, 2, 3]]\n";
    let folder = WorkFolder::with(&[("scene.toml", wall)]);
    let kernels =
        folder.kernels("common/mark_rough.cl", "return largest_channel(most_apart);", "return 255.0f;");
    let mean = |scene: &str| {
        std::fs::write(folder.path("scene.toml"), scene).expect("the scene is written");
        report(&folder, &["--samples", "16", "--adaptive", "--cl-dir", &kernels])["mean_samples"].clone()
    };
    assert_eq!(mean(wall), 1.0);
    assert!(mean(TRIANGLE).as_f64().is_some_and(|mean| mean > 3.0));
}

/// Each changed kernel makes one mistake: it counts blocks wrongly, gives a pixel a wrong number of samples,
/// marks no block as rough, or divides the sum of a pixel's samples by a wrong number.
#[test]
fn a_broken_mean_is_a_wrong_picture() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    for (file, from, to, strategy) in [
        ("common/samples.cl", "(float)((earlier) + 1)", "(float)((earlier) + 2)", "bvh"),
        ("common/samples.cl", "x / SAMPLED_BLOCK] > earlier", "x / SAMPLED_BLOCK] > earlier + 3", "tile"),
        (
            "common/samples.cl",
            "(pixels + SAMPLED_BLOCK - 1) / SAMPLED_BLOCK",
            "pixels / SAMPLED_BLOCK",
            "bvh",
        ),
        ("common/mark_rough.cl", "? most : first;", "? most : most + 1;", "bvh"),
        ("common/mark_rough.cl", "first * steps * steps > ROUGH_STEPS * ROUGH_STEPS;", "0;", "bvh"),
    ] {
        folder.notices((file, from, to), strategy, &["--verify", "--samples", "4", "--adaptive"]);
    }
}

/// Tiles that work-items share get their positions from a list of rough blocks, which are blocks of pixels that get
/// more samples than others. Shading reads the hits of all rays, including the rays of tiles that were not cast. The
/// hits of a tile that was not cast are undefined, so the driver may crash. A test in src/launch/offsets.rs checks the
/// positions that the unchanged kernels compute.
#[test]
fn a_tile_at_another_position_of_its_rough_block_is_a_wrong_picture_or_none() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let moved = ("tile_gpu/frame.cl", "tile / across * TILE_Y)", "tile % across * TILE_Y)");
    let swapped = (
        "tile_gpu/frame.cl",
        "(int2)((int)ROUGH_X(block), (int)ROUGH_Y(block))",
        "(int2)((int)ROUGH_Y(block), (int)ROUGH_X(block))",
    );
    // Each changed kernel takes PoCL half a minute to compile.
    for change in [moved, swapped].into_iter().take(if is_long() { 2 } else { 1 }) {
        is_wrong_or_none(&folder, change, ["61", "43"], &["--adaptive"]);
    }
}

/// Fails unless verification notices a change to a kernel file, or the driver crashes. The picture has 16 samples per
/// pixel, and its tiles are shared by work-items.
#[track_caller]
fn is_wrong_or_none(
    folder: &WorkFolder,
    (file, from, to): (&str, &str, &str),
    [width, height]: [&str; 2],
    options: &[&str],
) {
    let (kernels, device) = (folder.kernels(file, from, to), device());
    let usual = ["render", "scene.toml", "--width", width, "--height", height, "--device", &device];
    let ends = ["-o", "wrong.png", "--force", "--quiet", "--strategy", "tile-group", "--cl-dir", &kernels];
    let sampled = ["--samples", "16", "--verify"];
    let message = folder.mistake(&[&usual[..], &ends, &sampled, options].concat(), 1);
    let noticed = ["the picture is wrong: ", "child process crashed"];
    assert!(noticed.iter().any(|text| message.contains(text)), "{message}");
    std::fs::remove_dir_all(folder.path(&kernels)).expect("the folder of kernels");
}

/// In the words that hold a tile's or a rough block's column and row, each number has 16 bits. The picture of
/// this test has more than 256 columns of tiles and of blocks, so the column's number needs more than eight
/// bits.
#[test]
fn tiles_and_rough_blocks_on_the_right_of_a_wide_picture_are_cast_there() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let size = ["1500", "8"];
    for strategy in soon(["tile", "tile-group"]) {
        let sampled = ["--samples", "16", "--strategy", strategy];
        report_of_size(&folder, size, &[&sampled[..], &["--adaptive", "--verify"]].concat());
        report_of_size(&folder, size, &[&sampled[..], &["--verify=500"]].concat());
    }
    // Each changed kernel takes PoCL half a minute to compile.
    if is_long() {
        let block = ("common/samples.cl", "((block) & 0xffffu)", "((block) & 0xffu)");
        let tile = ("tile_gpu/frame.cl", "tile & 0xffffu", "tile & 0xffu");
        is_wrong_or_none(&folder, block, size, &["--adaptive"]);
        is_wrong_or_none(&folder, tile, size, &[]);
    }
}

/// The changed kernels cast tiles with several samples of each pixel in one frame. In each changed kernel, a sample is
/// at another position, is counted twice or is missing, or the mean is computed wrongly.
#[test]
fn a_broken_frame_of_several_samples_is_a_wrong_picture() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let vectors = [
        ("tile_cpu/camera.cl", "(LANE_Y & last) * (1 << bits)", "(LANE_Y & last) * 2", "14"),
        ("tile_cpu/camera.cl", "filled = samples->filled;", "filled = (Mask)(-1);", "14"),
        ("tile_cpu/camera.cl", "TO_FLOAT(row) + samples->y", "TO_FLOAT(row) + samples->x", "16"),
        ("tile_cpu/store_tile.cl", "missing * background.z, count);", "missing * background.z, 1.0f);", "16"),
        (
            "tile_cpu/store_tile.cl",
            "const float2 c = b.lo + b.hi;\n    return c.x + c.y;\n}\n\n// Returns four sums",
            "const float2 c = b.lo + b.hi;\n    return c.x + c.x;\n}\n\n// Returns four sums",
            "16",
        ),
        ("tile_cpu/store_tile.cl", "across.s0145 + across.s2367", "across.s0145 + across.s0167", "4"),
        ("tile_cpu/store_tile.cl", "(sum - (float)count * *mean)", "(sum - *mean)", "20"),
        ("tile_cpu/store_tile.cl", "(float4)(r.w, g.w, b.w, h.w)", "(float4)(r.z, g.z, b.z, h.z)", "4"),
    ];
    let shared = [
        ("tile_gpu/frame.cl", "(at.y & last) << group->bits", "(at.y & last) << 1", "14"),
        ("tile_gpu/frame.cl", "group->positions[2 * sample + 1]", "group->positions[2 * sample]", "16"),
        ("tile_gpu/shade.cl", "(sample & last, sample >>", "(sample & last, sample & last & sample >>", "16"),
        ("tile_gpu/shade.cl", "((sum) - (float)SAMPLES_OF_FRAME * (mean))", "((sum) - (mean))", "20"),
    ];
    for (strategy, rows) in [("tile", &vectors[..]), ("tile-group", &shared)] {
        for (file, from, to, samples) in due(rows) {
            folder.notices((file, from, to), strategy, &["--verify", "--samples", samples]);
        }
    }
}

/// With `tile-group`, a work-item needs a bit for each pair of a light and one of the work-item's rays. The work-item's
/// word has too few bits for all lights, so lights are processed in rounds. The 17 samples of each pixel take two
/// frames. In each of these two frames, each round of lights adds the radiance due to its lights to the mean.
#[test]
fn rounds_of_lights_add_up_in_the_mean_of_samples() {
    let lights: String = (0..16).map(|x| format!("[[light]]\nposition = [{x}, 2, 1]\npower = 1\n")).collect();
    let folder = WorkFolder::with(&[("scene.toml", &format!("{TRIANGLE}{lights}"))]);
    let options = ["--verify", "--samples", "17"];
    // The reference takes long to cast the rays of all samples to all lights, so the picture is small.
    for strategy in soon(["tile", "tile-group"]) {
        report_of_size(&folder, ["37", "25"], &[&options[..], &["--strategy", strategy]].concat());
    }
    let whole = (
        "tile_gpu/shade.cl",
        "(first_light ? (mean) + (sum) / SAMPLES_SO_FAR",
        "(first_light ? (mean) + (sum)",
    );
    if is_long() {
        folder.notices(whole, "tile-group", &options);
    }
}

/// A ball of triangles that are smaller than pixels, over the ground.
const FINE: &str = "[camera]
position = [0, 1.2, 1.5]
look_at = [0, -0.7, -3]
[[light]]
position = [0, 3, -3]
power = 60
[[object]]
shape = \"sphere\"
triangles = 20000
translation = [0, 0, -3]
[[object]]
shape = \"ground\"
";

/// The samples of a pixel may lie farther apart vertically than horizontally. A small box may therefore be
/// hit only by the ray of a pixel's lowest sample.
#[test]
fn a_vectors_interval_reaches_down_to_its_lowest_samples() {
    let folder = WorkFolder::with(&[("scene.toml", FINE)]);
    let options = ["--verify", "--samples", "4"];
    picture(&folder, &[&options[..], &["--strategy", "tile"]].concat());
    let across = ("tile_cpu/camera.cl", "most_lane(samples->y) - rays.y", "most_lane(samples->x) - rays.y");
    folder.notices(across, "tile", &options);
}

/// The highest of 16 samples lies farther from the pixel's centre than the leftmost sample.
#[test]
fn a_vectors_interval_reaches_up_to_its_highest_samples() {
    let folder = WorkFolder::with(&[("scene.toml", FINE)]);
    let options = ["--verify=400", "--samples", "16"];
    picture(&folder, &[&options[..], &["--strategy", "tile"]].concat());
    let leftmost =
        ("tile_cpu/camera.cl", "rays.y = least_lane(samples->y)", "rays.y = least_lane(samples->x)");
    folder.notices(leftmost, "tile", &options);
}
