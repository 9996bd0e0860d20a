//! Tests of colours that vary between the corners of a triangle, in every kernel family.

use crate::binary::{WorkFolder, apart};
use crate::common::{due, soon};
use image::RgbImage;
use std::fmt::Write as _;

const SCENE: &str = include_str!("data/colours.toml");
const MESH: &str = include_str!("data/colours.ply");
const STRATEGIES: [&str; 10] = [
    "naive",
    "deferred,layout=indexed16,passes=separate",
    "tiled-common-origin",
    "wide-common-origin",
    "raster",
    "bvh",
    "bvh-packet,passes=separate",
    "tile",
    "tile,passes=separate,intersector=watertight",
    "tile-group",
];

fn folder() -> WorkFolder {
    WorkFolder::with(&[("scene.toml", SCENE), ("colours.ply", MESH)])
}

/// Returns the numbers in each vertex's line of the mesh file, and the indices of each face's corners.
fn lines() -> (Vec<Vec<f32>>, Vec<Vec<usize>>) {
    let lines = MESH.lines().skip_while(|line| *line != "end_header").skip(1);
    let words =
        |line: &str| line.split(' ').map(|word| word.parse().expect("a number")).collect::<Vec<f32>>();
    let all: Vec<_> = lines.map(words).collect();
    let (vertices, faces) = all.split_at(5);
    let faces = faces.iter().map(|face| face[1..].iter().map(|index| *index as usize).collect());
    (vertices.to_vec(), faces.collect())
}

/// Returns the mesh as an OBJ with a material. `changed` takes a vertex's number and colour, and returns the colour
/// in the OBJ.
fn obj(changed: impl Fn(usize, [f32; 3]) -> [f32; 3]) -> String {
    let (vertices, faces) = lines();
    let mut text = "mtllib a.mtl\nusemtl a\n".to_owned();
    for (number, line) in vertices.iter().enumerate() {
        let [x, y, z, r, g, b] = line[..] else { panic!("six numbers") };
        let [r, g, b] = changed(number, [r, g, b]);
        writeln!(text, "v {x} {y} {z} {r} {g} {b}").expect("text");
    }
    for face in faces {
        writeln!(text, "f {} {} {}", face[0] + 1, face[1] + 1, face[2] + 1).expect("text");
    }
    text
}

#[test]
fn every_family_interpolates_colours_like_the_reference() {
    let folder = folder();
    let (expected, said) = folder.picture(&[]);
    assert!(!said.contains("colour"), "{said}");
    for strategy in due(soon(STRATEGIES)) {
        let (picture, _) = folder.picture(&["--verify", "--strategy", strategy]);
        assert!(apart(&picture, &expected) <= 8, "{strategy}");
    }
    for strategy in due(soon(["tile", "tile-group", "bvh", "raster"])) {
        folder.picture(&["--verify", "--samples", "4", "--strategy", strategy]);
    }
    let shown = expected.pixels().map(|pixel| pixel.0).collect::<std::collections::BTreeSet<_>>().len();
    assert!(shown > 500, "{shown} colours");
}

#[test]
fn a_colour_is_the_same_in_every_format_and_times_that_of_the_material() {
    let folder = folder();
    let of_ply = folder.picture(&[]).0;
    folder.write("scene.toml", &SCENE.replace("colours.ply", "a.obj"));
    let of_obj = |mtl: &str, obj: String| -> RgbImage {
        folder.write("a.mtl", mtl);
        folder.write("a.obj", &obj);
        folder.picture(&["--verify"]).0
    };
    let white = "newmtl a\nKd 1 1 1\n";
    let own = |_: usize, colour: [f32; 3]| colour;
    assert!(apart(&of_obj(white, obj(own)), &of_ply) <= 8);
    // A red material leaves only the red channel.
    let red = of_obj("newmtl a\nKd 1 0 0\n", obj(own));
    let background = of_ply[(0, 0)];
    let pairs = || red.pixels().zip(of_ply.pixels()).filter(|(_, ply)| **ply != background);
    assert!(pairs().count() > 800);
    assert!(pairs().all(|(red, ply)| red.0[0].abs_diff(ply.0[0]) <= 1 && red.0[1] == 0 && red.0[2] == 0));
    // A k_l of the scene replaces all colours.
    folder.write("scene.toml", &(SCENE.replace("colours.ply", "a.obj") + "material = { k_l = 0.5 }\n"));
    let grey = of_obj(white, obj(own));
    let same = of_obj(white, obj(|number, colour| if number == 0 { [9.0, 9.0, 9.0] } else { colour }));
    assert_eq!(grey, same);
}

#[test]
fn corners_of_one_colour_give_the_triangle_a_material() {
    let folder = folder();
    folder.write("scene.toml", &SCENE.replace("colours.ply", "a.obj"));
    folder.write("a.mtl", "newmtl a\nKd 1 1 1\n");
    folder.write("a.obj", &obj(|_, _| [180.0, 90.0, 40.0]));
    let even = folder.picture(&["--verify"]).0;
    // The reflectances in this material are the linear light of the 8-bit values 180, 90 and 40.
    folder.write("a.mtl", "newmtl a\nKd 0.456411 0.102242 0.021219\n");
    let plain: String = obj(|_, _| [0.0; 3])
        .lines()
        .map(|line| match line.strip_suffix(" 0 0 0") {
            Some(vertex) => format!("{vertex}\n"),
            None => format!("{line}\n"),
        })
        .collect();
    folder.write("a.obj", &plain);
    assert!(apart(&even, &folder.picture(&["--verify"]).0) <= 8);
}

#[test]
fn objects_with_and_without_colours_share_a_scene_and_a_mirrored_object_keeps_its_corners() {
    let folder = folder();
    let beside = "translation = [0, -0.4, 0]\n[[object]]\nshape = \"sphere\"\ntriangles = 200\nscale = 0.4\n\
                  translation = [-0.6, 0.5, -2]\n[[object]]\nmesh = \"colours.ply\"\nscale = [-0.5, 0.5, 0.5]\n\
                  translation = [0.8, 0.6, -0.6]\n";
    folder.write("scene.toml", &format!("{SCENE}{beside}"));
    let all: Vec<_> = soon(["naive", "raster", "bvh", "tile", "tile-group"])
        .map(|strategy| folder.picture(&["--verify", "--strategy", strategy]).0)
        .collect();
    assert!(all.iter().all(|picture| apart(picture, &all[0]) <= 8));
    // Seen in a mirror, the mirrored object looks like the object itself.
    folder.write(
        "scene.toml",
        &SCENE.replace("position = [0.3,", "position = [0,").replace("[1, 2, 1]", "[0, 2, 1]"),
    );
    let own = folder.picture(&[]).0;
    let mirrored = SCENE.replace("position = [0.3,", "position = [0,").replace("[1, 2, 1]", "[0, 2, 1]");
    folder.write("scene.toml", &(mirrored + "scale = [-1, 1, 1]\n"));
    let seen = image::imageops::flip_horizontal(&folder.picture(&["--verify"]).0);
    assert!(apart(&own, &seen) <= 8);
}

/// Each changed kernel interpolates the corners' colours wrongly. For example, a changed kernel swaps
/// channels or corners.
#[test]
fn a_broken_interpolation_is_a_wrong_picture() {
    let folder = folder();
    let changes = [
        ("word >> 20 & COLOUR_STEPS", "word >> 10 & COLOUR_STEPS"),
        ("kb * b.x + kc * c.x", "kc * b.x + kb * c.x"),
        ("uniform3(red * red,", "uniform3(red,"),
        ("colours + 3 * (size_t)", "colours + 2 * (size_t)"),
    ];
    let all = ["deferred", "tile", "raster"].into_iter().flat_map(|of| changes.map(|change| (of, change)));
    for (strategy, (from, to)) in due(all) {
        folder.notices(("common/corner_colours.cl", from, to), strategy, &["--verify"]);
    }
}
