//! Cut-outs: surfaces with holes, in every kernel family that casts such surfaces.

use crate::binary::{WorkFolder, apart, device, has};
use crate::common::{due, soon};
use crate::textures::{gltf, with_picture};
use image::{Rgb, RgbImage, Rgba, RgbaImage};

/// A sheet in front of a wall and above a floor: light falls through the sheet's holes.
const ROOM: &str = "mtllib room.mtl
v -1 -1 -2
v 1 -1 -2
v 1 1 -2
v -1 1 -2
v -3 -1 -4
v 3 -1 -4
v 3 3 -4
v -3 3 -4
v -3 -1 0
v 3 -1 0
vt 0 0
vt 2 0
vt 2 2
vt 0 2
usemtl sheet
f 1/1 2/2 3/3 4/4
usemtl wall
f 5 6 7 8
f 9 10 6 5
";
const SCENE: &str = "[camera]
position = [0.3, 0.5, 0.5]
look_at = [0, 0, -2]
[[light]]
position = [0.5, 1.5, 0]
power = 30
[[light]]
position = [-1, 2.5, -1]
power = [8, 4, 2]
[[object]]
mesh = \"room.obj\"
[display]
exposure = 4
";
const MTL: &str = "newmtl sheet
Kd 0.9 0.8 0.7
Ks 0.3 0.3 0.3
Ns 40
map_Kd leaf.png
map_d leaf.png
newmtl wall
Kd 0.5 0.6 0.7
";

/// Returns a picture of eight by eight texels: a disc whose alpha decreases smoothly at its edge.
fn leaf() -> RgbaImage {
    RgbaImage::from_fn(8, 8, |x, y| {
        let [x, y] = [x, y].map(|at| at as f32 - 3.5);
        let alpha = 255.0 * (1.9 - x.hypot(y) / 2.5).clamp(0.0, 1.0);
        Rgba([(40.0 + 10.0 * (x + 4.0)) as u8, 200, (60.0 + 10.0 * (y + 4.0)) as u8, alpha as u8])
    })
}

fn room(mtl: &str) -> WorkFolder {
    let folder = WorkFolder::with(&[("room.obj", ROOM), ("room.mtl", mtl), ("scene.toml", SCENE)]);
    leaf().save(folder.path("leaf.png")).expect("a picture");
    folder
}

const STRATEGIES: [&str; 12] = [
    "naive",
    "deferred,layout=indexed16,passes=separate",
    "tiled-common-origin",
    "wide-common-origin",
    "wide-common-origin,intersector=pixel-linear",
    "bvh",
    "bvh-packet,passes=separate",
    "bvh,intersector=watertight",
    "tile",
    "tile-watertight,passes=separate",
    "tile-group",
    "tile-group-watertight",
];

#[test]
fn every_family_that_casts_cut_outs_agrees_with_the_reference() {
    let folder = room(MTL);
    let (expected, said) = folder.picture(&["--verify"]);
    assert!(!said.contains("map_d"), "{said}");
    // Holes show the wall, and let light through to the wall.
    let whole = MTL.replace("map_d leaf.png\n", "");
    let opaque = room(&whole).picture(&["--verify"]).0;
    assert!(apart(&expected, &opaque) > 300, "{}", apart(&expected, &opaque));
    for strategy in due(soon(STRATEGIES)) {
        let (cut, _) = folder.picture(&["--verify", "--strategy", strategy]);
        assert!(apart(&cut, &expected) <= 8, "{strategy}: {}", apart(&cut, &expected));
    }
}

/// The rays to soft lights and to a sky have no common origin, so kernels cast them with other code than rays
/// from a common origin. The code for rays without a common origin must take account of holes, too.
#[test]
fn soft_light_falls_through_holes() {
    let folder = room(MTL);
    let sky = "[sky]\nzenith = 0.2\nhorizon = [0.1, 0.1, 0.2]\n";
    let soft = SCENE.replace("power = 30", "power = 30\nradius = 0.2") + sky;
    std::fs::write(folder.path("scene.toml"), soft).expect("a file");
    for strategy in due(soon(["deferred", "wide-common-origin", "bvh-packet", "tile-group", "tile"])) {
        folder.picture(&["--verify", "--samples", "4", "--strategy", strategy]);
    }
}

/// A strategy whose shadow rays are cast from the light must compute the point where such a ray meets a mask from the
/// hit, not from the light: computed from a light that is nearly a million units away, the point would be rounded to
/// a sixteenth of a unit. With `bvh`, shadow rays start at the hit. The changed kernel computes the point from the
/// light.
#[test]
fn shadows_of_cut_outs_under_a_distant_light_are_not_ragged() {
    let folder = room(MTL);
    let behind = SCENE.replace("[0.3, 0.5, 0.5]", "[0, 0, -2.2]").replace("[0, 0, -2]", "[-0.6, -0.7, -4]");
    folder.write("scene.toml", &behind.replace("[0.5, 1.5, 0]\npower = 30", "[2e5, 3e5, 8e5]\npower = 1e13"));
    let expected = folder.picture(&["--strategy", "bvh"]).0;
    for strategy in due(soon(["tile", "tile-watertight", "wide-common-origin", "tile-group"])) {
        let picture = folder.picture(&["--strategy", strategy]).0;
        assert!(apart(&picture, &expected) <= 4, "{strategy}: {}", apart(&picture, &expected));
    }
    let from = "any ? bundle->hit[vector] : splat(bundle->origin)";
    let kernels = folder.kernels("tile_cpu/leaf.cl", from, "splat(bundle->origin)");
    let ragged = folder.picture(&["--strategy", "tile", "--cl-dir", &kernels]).0;
    assert!(apart(&ragged, &expected) > 30, "{}", apart(&ragged, &expected));
}

#[test]
fn a_family_without_cut_outs_says_so_and_a_scene_can_leave_them_out() {
    let folder = room(MTL);
    let device = device();
    let raster = ["render", "scene.toml", "--device", &device, "--strategy", "raster"];
    has(&folder.mistake(&raster, 2), &["traversal = raster does not support textures, which the scene has"]);
    folder.picture(&["--set", "textures=false", "--strategy", "raster", "--verify"]);
}

#[test]
fn an_opaque_mask_is_where_it_is_bright_and_needs_no_colour_texture() {
    let folder = room(&MTL.replace("map_Kd leaf.png\nmap_d leaf.png", "map_d mask.png"));
    let bright = image::DynamicImage::from(leaf()).to_rgba8();
    let bright = RgbImage::from_fn(8, 8, |x, y| Rgb([bright[(x, y)].0[3]; 3]));
    bright.save(folder.path("mask.png")).expect("a picture");
    let (cut, _) = folder.picture(&["--verify"]);
    let plain = folder.picture(&["--set", "textures=false"]).0;
    assert!(apart(&cut, &plain) > 300, "{}", apart(&cut, &plain));
    // In the next scene, the alpha of the colour texture defines the holes. The alpha of the colour texture
    // has the same values as the mask.
    let coloured = room(MTL).picture(&[]).0;
    let wall = |picture: &RgbImage, x, y| picture[(x, y)] != plain[(x, y)];
    let holes =
        |picture: &RgbImage| (0..45).map(|y| (0..72).filter(|x| wall(picture, *x, y)).count()).sum::<usize>();
    assert!(holes(&cut) > 300 && holes(&coloured) > holes(&cut));
}

#[test]
fn what_is_wrong_with_a_mask_is_noted_with_its_line() {
    let folder = room(&MTL.replace("map_d leaf.png", "map_d none.png"));
    let (cut, said) = folder.picture(&["--verify"]);
    has(&said, &["room.mtl:6: mask `none.png` cannot be read", "its surface has no holes"]);
    let whole = room(&MTL.replace("map_d leaf.png\n", ""));
    assert_eq!(cut, whole.picture(&[]).0);
    let folder = room(&MTL.replace("map_d leaf.png", "map_d -s 2 2 leaf.png"));
    has(
        &folder.picture(&[]).1,
        &["asks for different scales, offsets or wrap modes of its textures (map_d)"],
    );
}

/// Each changed kernel makes one mistake: it ignores holes, reads a wrong channel, texel or cutoff, looks at a wrong
/// point, or applies holes only to rays from the eye or only to shadow rays.
#[test]
fn a_broken_cut_out_is_a_wrong_picture() {
    let folder = room(MTL);
    for (file, from, to, strategy) in due([
        ("common/cutouts.cl", "if (!mask) return 1;", "return 1;", "deferred"),
        ("common/cutouts.cl", "(float)(words[at.d] >> 24)", "(float)(words[at.d] >> 8 & 255)", "bvh"),
        (
            "common/cutouts.cl",
            "at.ke * (float)(words[at.e] >> 24)",
            "at.ke * (float)(words[at.a] >> 24)",
            "tile",
        ),
        ("common/cutouts.cl", "(float)(head[3] >> 16) - 1.0f", "(float)(head[3] >> 17)", "bvh"),
        (
            "cast/exhaustive.cl",
            "open &= !SOLID(&scene->textures, first + k, hit);",
            "open &= !hit.lanes;",
            "deferred",
        ),
        (
            "cast/bvh.cl",
            "SOLID(&scene->textures, leaf_triangle(&scene->tree, index), hit);\n                if",
            "hit.lanes;\n                if",
            "bvh",
        ),
        (
            "tile_cpu/leaf.cl",
            "vec3(bundle->x[vector], bundle->y[vector], bundle->z[vector])",
            "vec3(bundle->y[vector], bundle->x[vector], bundle->z[vector])",
            "tile",
        ),
        ("tile_gpu/walk.cl", "vec3(x, y, 1.0f), 1);", "vec3(y, x, 1.0f), 1);", "tile-group"),
    ]) {
        folder.notices((file, from, to), strategy, &["--verify"]);
    }
}

/// A ball behind the camera has more triangles than a tile of triangles in `__local` memory, so that the
/// sheet is in the second tile. The changed kernels mistake a triangle's index in its tile for its index in
/// the scene. The rays then look up the mask of a triangle of the ball, which has no mask. In the first
/// changed kernel, shadow rays make this mistake; in the second changed kernel, rays from the eye make it.
#[test]
fn a_triangle_of_a_later_tile_has_its_own_holes() {
    let ball =
        "[[object]]\nshape = \"sphere\"\ntriangles = 300\nscale = 0.1\ntranslation = [0, 0.5, 3]\n[[object]]";
    let folder = room(MTL);
    folder.write("scene.toml", &SCENE.replace("[[object]]", ball));
    folder.picture(&["--verify", "--strategy", "tiled"]);
    for (from, to) in [
        ("open &= !SOLID(&scene->textures, first + k, hit);", "open &= !SOLID(&scene->textures, k, hit);"),
        (
            "hit.lanes = SOLID(&scene->textures, first + k, hit);",
            "hit.lanes = SOLID(&scene->textures, k, hit);",
        ),
    ] {
        folder.notices(("cast/exhaustive.cl", from, to), "tiled", &["--verify"]);
    }
}

/// The order of triangles in a tree differs from their order in the mesh. In this scene, a ball behind the
/// camera precedes the sheet in the mesh, but the sheet precedes the ball in the tree. The changed kernels
/// mistake a triangle's place in the tree for its number in the mesh. The rays then look up the mask of a
/// triangle of the ball, which has no mask. In the first changed kernel, shadow rays make this mistake; in
/// the second changed kernel, rays from the eye make it.
#[test]
fn a_triangle_has_its_own_holes_at_whichever_place_in_the_tree() {
    let ball =
        "[[object]]\nshape = \"sphere\"\ntriangles = 300\nscale = 0.1\ntranslation = [0, 0.5, 3]\n[[object]]";
    let folder = room(MTL);
    folder.write("scene.toml", &SCENE.replace("[[object]]", ball));
    for strategy in ["bvh", "tile"] {
        folder.picture(&["--verify", "--strategy", strategy]);
    }
    let of = "SOLID(&scene->textures, leaf_triangle(&scene->tree, index), hit);";
    for start in ["open &= !", "wanted & "] {
        let (from, to) = (format!("{start}{of}"), format!("{start}SOLID(&scene->textures, index, hit);"));
        folder.notices(("cast/bvh.cl", from.as_str(), to.as_str()), "bvh", &["--verify"]);
    }
}

/// Returns a folder with a scene that shows a quad from a glTF file, with the leaf's picture.
fn quad() -> WorkFolder {
    let folder = room(MTL);
    folder.write("scene.toml", &SCENE.replace("room.obj", "quad.gltf"));
    folder
}

/// Each way in which a texture continues beyond its edges also applies to its mask. In the changed kernel, all masks
/// repeat.
#[test]
fn a_mask_continues_beyond_its_edges_like_its_texture() {
    let folder = quad();
    let of = |sampler: &str| {
        let text = with_picture(&gltf(sampler, ""), "leaf.png");
        let masked = text.replace("\"materials\": [{", "\"materials\": [{\"alphaMode\": \"MASK\", ");
        folder.write("quad.gltf", &masked);
        folder.picture(&["--verify"]).0
    };
    let repeated = of("{}");
    let other = of(r#"{"wrapS": 33071, "wrapT": 33648}"#);
    assert!(apart(&repeated, &other) > 100, "{}", apart(&repeated, &other));
    let repeats =
        ("common/cutouts.cl", "(whole_texture(head), head[3],", "(whole_texture(head), WRAP_REPEAT,");
    folder.notices(repeats, "bvh", &["--verify"]);
}

#[test]
fn masks_of_gltf_have_their_cutoffs_and_blending_is_a_mask_with_a_note() {
    let folder = quad();
    let whole = with_picture(&gltf("{}", ""), "leaf.png");
    let of = |mode: &str, factor: &str| {
        let text = whole.replace("\"materials\": [{", &format!("\"materials\": [{{{mode} "));
        let text = text.replace("0.7, 1]", &format!("0.7, {factor}]"));
        std::fs::write(folder.path("quad.gltf"), text).expect("a file");
        folder.picture(&["--verify"])
    };
    let (opaque, said) = of("", "1");
    assert!(!said.contains("asks for"), "{said}");
    let (half, said) = of("\"alphaMode\": \"MASK\",", "1");
    assert!(!said.contains("asks for"), "{said}");
    let quarter = of("\"alphaMode\": \"MASK\", \"alphaCutoff\": 0.25,", "1").0;
    let factor = of("\"alphaMode\": \"MASK\", \"alphaCutoff\": 0.125,", "0.5").0;
    assert!(apart(&half, &opaque) > apart(&quarter, &opaque) && quarter != opaque);
    assert_eq!(factor, quarter);
    // In this picture, one texel is a hole, and the alpha of all other texels equals the cutoff. Rounding
    // must not turn texels whose alpha equals the cutoff into holes.
    let hole = |x, y| Rgba([90, 200, 60, if (x, y) == (0, 0) { 0 } else { 51 }]);
    RgbaImage::from_fn(8, 8, hole).save(folder.path("leaf.png")).expect("a picture");
    let whole = of("", "1").0;
    let solid = of("\"alphaMode\": \"MASK\", \"alphaCutoff\": 0.2,", "1").0;
    let kernels = folder.kernels("common/cutouts.cl", ">> 16) - 1.0f;", ">> 16) + 1.0f;");
    let holes = folder.picture(&["--cl-dir", &kernels]).0;
    assert!(apart(&solid, &holes) > 100, "{}", apart(&solid, &holes));
    // With the unchanged kernel, the picture differs from the one without a mask only at the hole. The kernel
    // subtracts one unit from the least alpha of solid texels (the cutoff). Without this subtraction, rounding would
    // turn an eighth of the solid pixels into holes. The changed kernel adds one unit instead, and turns all texels
    // into holes.
    let [few, all] = [apart(&solid, &whole), apart(&holes, &whole)];
    assert!(10 * few < all, "{few} {all}");
    leaf().save(folder.path("leaf.png")).expect("a picture");
    let (blended, said) = of("\"alphaMode\": \"BLEND\",", "0.9");
    has(
        &said,
        &[
            "asks for blended transparency (alphaMode BLEND)",
            "points that are at least half opaque are drawn",
        ],
    );
    assert_eq!(blended, of("\"alphaMode\": \"MASK\",", "0.9").0);
    let (hidden, said) = of("\"alphaMode\": \"MASK\",", "0.25");
    has(&said, &["asks for transparency (alphaMode MASK)", "every surface is opaque"]);
    assert_eq!(hidden, opaque);
}
