//! Soft light at half resolution: the default look of bare meshes.

use crate::binary::{WorkFolder, device, has, without_optimisation};
use crate::common::{due, soon};
use image::{Rgb, RgbImage};

/// A tetrahedron, and a plate above it. The tetrahedron lies in the plate's shadow.
const MESH: &str = "v 0 1 0\nv -1 0 1\nv 1 0 1\nv 0 0 -1\nv -1 1.5 -1\nv 1 1.5 -1\nv 0 1.5 1\n\
                    f 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\nf 5 6 7\n";
/// Strategies from which `render` chooses, on a CPU or on a GPU: `tile` and `tile-group` cast tiles, `bvh` and
/// `bvh-packet` use a tree, too, and `wide-common-origin` uses no tree.
const FAMILIES: [&str; 5] = ["tile", "tile-group", "bvh", "bvh-packet", "wide-common-origin"];
/// A size at which a row of the half picture consists of whole vectors of 16 pixels.
const EVEN: [&str; 4] = ["--width", "96", "--height", "64"];
const ODD: [&str; 4] = ["--width", "75", "--height", "61"];
/// The option that makes the z axis the mesh's upward direction.
const UPWARDS: [&str; 2] = ["--up", "z"];

fn options<'a>(device: &'a str, size: [&'a str; 4], more: &[&'a str]) -> Vec<&'a str> {
    let usual = ["render", "mesh.obj", "--force", "-o", "a.png", "--device", device];
    [&usual[..], &size, more].concat()
}

fn picture(folder: &WorkFolder, size: [&str; 4], more: &[&str]) -> RgbImage {
    folder.output(&options(&device(), size, more));
    image::open(folder.path("a.png")).expect("a picture").to_rgb8()
}

#[test]
fn every_family_casts_the_same_picture_and_it_agrees_with_the_reference() {
    let folder = WorkFolder::with(&[("mesh.obj", MESH)]);
    for size in [EVEN, ODD] {
        let all = FAMILIES.map(|family| picture(&folder, size, &["--verify", "--strategy", family]));
        for (family, other) in FAMILIES.iter().zip(&all) {
            let differ = all[0]
                .pixels()
                .zip(other.pixels())
                .filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 1));
            assert!(differ.count() * 200 < all[0].pixels().len(), "{family}");
        }
    }
    picture(&folder, EVEN, &["--verify=50"]);
}

/// Soft light at half resolution approximates the picture that results if each of many samples per pixel
/// casts its own rays to lights and to the sky.
#[test]
fn it_is_nearly_the_picture_of_many_samples() {
    let folder = WorkFolder::with(&[("mesh.obj", MESH)]);
    let size = ["--width", "240", "--height", "150"];
    let psnr_db = |a: &RgbImage, b: &RgbImage| {
        let square: f64 =
            a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
        10.0 * (255.0 * 255.0 * a.as_raw().len() as f64 / square).log10()
    };
    let many = picture(&folder, size, &["--samples", "128"]);
    let [half, two] =
        [&[][..], &["--samples", "2"]].map(|more| psnr_db(&picture(&folder, size, more), &many));
    assert!(half > 35.0 && half > two + 3.0, "{half} dB at half resolution, {two} dB with two samples");
}

#[test]
fn a_transparent_background_keeps_its_coverage() {
    let folder = WorkFolder::with(&[("mesh.obj", MESH)]);
    picture(&folder, EVEN, &["--background", "transparent", "--verify"]);
    let image = image::open(folder.path("a.png")).expect("a picture").to_rgba8();
    assert_eq!(image[(0, 0)].0, [0; 4]);
    assert!(
        image.pixels().any(|pixel| pixel.0[3] == 255)
            && image.pixels().any(|pixel| (1..255).contains(&pixel.0[3]))
    );
}

/// The grey of a background is a colour, not light that surfaces could block. The background must therefore
/// not change the light of surfaces beside it. Pixels at a silhouette must keep their share of the
/// background.
#[test]
fn a_grey_background_lights_no_surface_and_is_not_shadowed() {
    let folder = WorkFolder::with(&[("mesh.obj", MESH)]);
    for (size, family) in [(EVEN, "tile"), (ODD, "tile"), (EVEN, "bvh")] {
        picture(&folder, size, &["--background", "#808080", "--verify", "--strategy", family]);
    }
}

/// The sky's zenith is in the mesh's upward direction.
#[test]
fn the_sky_is_above_a_mesh_whose_up_is_the_z_axis() {
    let folder = WorkFolder::with(&[("mesh.obj", MESH)]);
    for family in ["tile", "bvh"] {
        picture(&folder, EVEN, &[&UPWARDS[..], &["--verify", "--strategy", family]].concat());
    }
}

/// Returns options that put a sky and 17 lights over the mesh. The strategy `tile-group` processes 15 lights
/// at a time, so these lights take two rounds.
fn many_lights() -> Vec<String> {
    let light = |number: i32| {
        let [x, z] = [number % 4, number / 4].map(|place| 2 * place - 4);
        let position = format!("light.{number}.position=[{x}, 3, {z}]");
        [position, format!("light.{number}.power=6"), format!("light.{number}.radius=0.1")]
    };
    let sky = ["sky.zenith=0.1", "sky.horizon=0.05"].map(str::to_owned);
    (0..17).flat_map(light).chain(sky).flat_map(|value| ["--set".to_owned(), value]).collect()
}

/// In each round of lights, the lights are numbered from the round's first light.
#[test]
fn the_unoccluded_light_of_a_second_round_is_that_of_its_own_lights() {
    let folder = WorkFolder::with(&[("mesh.obj", MESH)]);
    let lights = many_lights();
    let lights: Vec<&str> = lights.iter().map(String::as_str).collect();
    picture(&folder, EVEN, &[&lights[..], &["--verify=500", "--strategy", "tile-group"]].concat());
}

/// Returns a folder with the mesh in one colour: the value of `Kd` in its material file.
fn coloured(colour: &str) -> WorkFolder {
    let mesh = format!("mtllib mesh.mtl\nusemtl one\n{MESH}");
    let material = format!("newmtl one\nKd {colour}\n");
    WorkFolder::with(&[("mesh.obj", &mesh), ("mesh.mtl", &material)])
}

/// A surface of one primary colour has light in one channel only, so the brightest channel may be any of the three.
#[test]
fn a_mesh_of_a_primary_colour_has_light_in_one_channel() {
    for (channel, colour) in ["1 0 0", "0 1 0", "0 0 1"].into_iter().enumerate() {
        let folder = coloured(colour);
        let shown = picture(&folder, EVEN, &["--verify", "--strategy", "bvh"]);
        let is_pure = |pixel: &&Rgb<u8>| (0..3).all(|other| (pixel.0[other] > 0) == (other == channel));
        let pure = shown.pixels().filter(is_pure).count();
        assert!(pure > 500, "{colour}: {pure}");
    }
    is_noticed(&coloured("0 0 1"), ["max(max(own.x, own.y), own.z)", "max(own.x, own.y)"]);
}

/// Fails unless verification notices a change of the filter.
#[track_caller]
fn is_noticed(folder: &WorkFolder, [from, to]: [&str; 2]) {
    let (device, kernels) = (device(), folder.kernels(FILTER, from, to));
    let changed = ["--verify", "--quiet", "--strategy", "bvh", "--cl-dir", &kernels];
    has(&folder.mistake(&options(&device, EVEN, &changed), 1), &["the picture is wrong: "]);
}

/// A pixel's ratio of arriving to unoccluded light is interpolated between four pixels of the half picture (a
/// picture of half the width and height). The unoccluded light of a black surface is 0, so none of these four
/// pixels counts as similar. Even so, their weights must not all be 0, since the kernel divides by the sum of
/// the weights. In the changed kernel of this test, all four weights are 0.
#[test]
fn a_black_mesh_is_black() {
    let folder = coloured("0 0 0");
    for family in soon(FAMILIES) {
        let shown = picture(&folder, EVEN, &["--verify", "--strategy", family]);
        let blacks = shown.pixels().filter(|pixel| pixel.0 == [0; 3]).count();
        assert!(blacks > 500, "{family}: {blacks}");
    }
    is_noticed(&folder, [" + 1e-37f", ""]);
}

const FILTER: &str = "common/half_light.cl";
const ROWS: &str = "common/pixel_rows.cl";
const SOFT: &str = "common/soft.cl";

/// Changes to kernel files, each with a strategy that uses the file: changes to the filter, to the unoccluded
/// light, and to the numbers that choose points of lights.
const CHANGES: &[[&str; 4]] = &[
    [FILTER, "across == 2 ? 0.5f : 1.0f", "across == 2 ? 1.0f : 1.0f", "bvh"],
    [FILTER, "(down == -2 || down == 2 ?", "(down == -2 ?", "bvh"],
    [FILTER, "int across = -2;", "int across = -1;", "tile"],
    [FILTER, "all = along(all, weight, there.colour);", "all = along(all, weight, own.colour);", "bvh"],
    [FILTER, "return near * near;", "return near;", "bvh"],
    [FILTER, "- (float)HALF_LIGHT_SHARPNESS * dot3", "- 0.5f * (float)HALF_LIGHT_SHARPNESS * dot3", "bvh"],
    [FILTER, "(below ? down - top : 1.0f - (down - top))", "0.5f", "bvh"],
    [FILTER, "const int to_right = corner & 1,", "const int to_right = 0,", "bvh"],
    [FILTER, "s0112233445566778, c.y", "s1122334455667788, c.y", "tile"],
    [FILTER, "* ratio.hit + least", "* ratio.hit + 100.0f * least", "bvh"],
    [FILTER, "x / 2 - 1, y)", "x / 2, y)", "tile"],
    [
        ROWS,
        "(varying_int)(0), (varying_int)(size.x - 1)",
        "(varying_int)(0), (varying_int)(size.x - 2)",
        "bvh",
    ],
    [ROWS, "clamp(y, 0, size.y - 1)", "clamp(y, 1, size.y - 1)", "bvh"],
    [ROWS, "(float16)(rb.odd, rb2.odd)", "(float16)(rb.odd, rb.odd)", "tile"],
    [ROWS, "colour.z.scdef, hit.scdef", "colour.z.s89ab, hit.scdef", "tile"],
    [SOFT, "curve &= INTERLEAVED * INTERLEAVED - 1u;", "", "bvh"],
    [SOFT, "SAMPLED && !IS_UNOCCLUDED(soft)", "SAMPLED", "bvh"],
    [SOFT, "0.2122f + cosine", "0.3122f + cosine", "bvh"],
    [SOFT, "0.1211f * cosine", "0.2211f * cosine", "bvh"],
    ["cast/shade.cl", "#if SOFT\n        if (!IS_UNOCCLUDED(&scene->soft))\n#endif", "", "bvh"],
    ["cast/shade.cl", "else if (!IS_UNOCCLUDED(&scene->soft)) lit &=", "else lit &=", "wide-common-origin"],
    ["cast/soft.cl", "if (IS_UNOCCLUDED(&scene->soft)) {", "if (0) {", "bvh"],
    ["tile_cpu/shade.cl", "if (!IS_UNOCCLUDED(&lighting->soft))\n", "if (1)\n", "tile"],
    ["tile_cpu/sky.cl", "if (IS_UNOCCLUDED(&lighting->soft)) {", "if (0) {", "tile"],
    ["tile_gpu/shadow.cl", "if (IS_UNOCCLUDED(&sources->soft)) {", "if (0) {", "tile-group"],
    [
        "tile_gpu/shadow.cl",
        "source >= sources->light_count) return hits;",
        "source >= sources->light_count) return 0;",
        "tile-group",
    ],
    ["tile_gpu/shade.cl", "IS_UNOCCLUDED(&sources->soft) ?", "0 ?", "tile-group"],
];

#[test]
fn a_broken_half_picture_is_a_wrong_picture() {
    let folder = WorkFolder::with(&[("mesh.obj", MESH)]);
    // The following changes to kernels are only visible if there is no ground behind the mesh.
    let behind = [
        [FILTER, "subtract(own, behind)", "own", "bvh"],
        [
            FILTER,
            "likeness(light, scaled_light(there.colour, factor)) * there.hit",
            "likeness(light, scaled_light(there.colour, factor))",
            "bvh",
        ],
        [ROWS, "colour.z.scdef, hit.scdef", "colour.z.scdef, hit.scdee", "tile"],
        [FILTER, "to_right ? row.hit.s1223344556677889 : row.hit", "row.hit", "tile"],
    ];
    // The change `rounds` is only visible if there are many lights, the change `upwards` only if up is not the y axis.
    let light = ["lights + LIGHT_FLOATS * source)", "lights + LIGHT_FLOATS * light)"];
    let rounds = ["tile_gpu/shadow.cl", light[0], light[1], "tile-group"];
    let upwards = [SOFT, "dot3(normal, splat(LOAD3(soft->numbers + 6)))", "normal.y", "bvh"];
    let lights = many_lights();
    let lights: Vec<&str> = lights.iter().map(String::as_str).collect();
    let mut unnoticed = Vec::new();
    let grounded = CHANGES.iter().map(|change| (*change, &[][..]));
    let all = grounded.chain(behind.map(|change| (change, &["--background", "#808080"][..])));
    let all = all.chain([(rounds, &lights[..]), (upwards, &UPWARDS[..])]);
    for ([file, from, to, family], options_of_change) in due(all) {
        let kernels = folder.kernels(file, from, to);
        let more = ["--verify", "--strategy", family, "--cl-dir", &kernels];
        let more = [&more[..], options_of_change].concat();
        let mut command = folder.raycl(&options(&device(), EVEN, &more));
        command.envs(without_optimisation());
        let output = command.output().expect("the program");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.code() != Some(1) || !said.contains("the picture is wrong: ") {
            unnoticed.push(format!("{file}: {from} -> {to}: {said}"));
        }
        std::fs::remove_dir_all(folder.path(&kernels)).expect("the folder of kernels");
    }
    assert!(unnoticed.is_empty(), "{unnoticed:#?}");
}
