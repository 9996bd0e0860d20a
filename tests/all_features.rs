//! One scene with all features together, in every family that supports textures (all except the rasteriser). The
//! tests of each feature try all families only in `make test-long`; `make test` tries a sample of them, since PoCL
//! compiles a program for each feature and family.

use crate::binary::{WorkFolder, has};
use image::{Rgb, Rgb32FImage, RgbImage, Rgba, RgbaImage};

/// A sheet with holes and colours of corners, a glowing wall, and a coarse ball with smooth shadows and a highlight.
/// They are lit by a point, a ball, a rectangle and a picture of the sky.
const SCENE: &str = "smooth_shadows = true
[camera]
position = [0.3, 0.5, 0.5]
look_at = [0, 0, -2]
[sky]
picture = \"sky.hdr\"
strength = 0.5
[[light]]
position = [0.5, 1.5, 0]
power = 20
[[light]]
position = [-1, 2.5, -1]
power = [8, 4, 2]
radius = 0.3
[[light]]
position = [1.5, 1.5, -1]
power = 6
edges = [[0.4, -0.4, 0.2], [0, 0.3, 0.6]]
[[object]]
mesh = \"room.obj\"
[[object]]
shape = \"sphere\"
triangles = 60
scale = 0.4
translation = [0.9, -0.5, -2]
material = { k_g = 0.3, shininess = 60 }
[display]
exposure = 4
";
const ROOM: &str = "mtllib room.mtl
v -1 -1 -2 0.9 0.2 0.1
v 0.6 -1 -2 0.2 0.9 0.3
v 0.6 1 -2 0.1 0.3 0.9
v -1 1 -2 0.8 0.8 0.1
v -3 -1 -4 1 1 1
v 3 -1 -4 1 1 1
v 3 3 -4 1 1 1
v -3 3 -4 1 1 1
v -3 -1 0 1 1 1
v 3 -1 0 1 1 1
vt 0 0
vt 2 0
vt 2 2
vt 0 2
usemtl sheet
f 1/1 2/2 3/3 4/4
usemtl wall
f 5/1 6/2 7/3 8/4
usemtl floor
f 9 10 6 5
";
const MTL: &str = "newmtl sheet
Kd 0.9 0.9 0.9
map_Kd leaf.png
map_d leaf.png
newmtl wall
Kd 0.5 0.6 0.7
Ke 3 3 3
map_Ke glow.png
newmtl floor
Kd 0.5 0.5 0.4
Ks 0.2 0.2 0.2
Ns 20
";

fn folder() -> WorkFolder {
    let folder = WorkFolder::with(&[("room.obj", ROOM), ("room.mtl", MTL), ("scene.toml", SCENE)]);
    let leaf = RgbaImage::from_fn(8, 8, |x, y| {
        let [dx, dy] = [x, y].map(|at| at as f32 - 3.5);
        Rgba([
            250 - 10 * x as u8,
            220,
            150 + 10 * y as u8,
            (255.0 * (1.9 - dx.hypot(dy) / 2.5).clamp(0.0, 1.0)) as u8,
        ])
    });
    leaf.save(folder.path("leaf.png")).expect("a picture");
    let glow = RgbImage::from_fn(16, 16, |x, y| match (x / 4 + y / 4) % 2 {
        0 => Rgb([250, 40 + 6 * x as u8, 30]),
        _ => Rgb([0, 0, 90]),
    });
    glow.save(folder.path("glow.png")).expect("a picture");
    let sky = Rgb32FImage::from_fn(16, 8, |x, y| Rgb([(8 - y) as f32 / 64.0, 0.06, x as f32 / 160.0]));
    sky.save(folder.path("sky.hdr")).expect("a picture");
    folder
}

#[test]
fn every_family_casts_all_features_together_like_the_reference() {
    let folder = folder();
    let (picture, said) = folder.picture(&["--verify"]);
    // The vertices of the sheet have colours.
    let note = "multiplied by the colours of vertices";
    has(&said, &[note]);
    let is_other = |line: &&str| !line.contains(note);
    let others: String = said.lines().filter(is_other).collect();
    assert!(!others.contains("texture") && !others.contains("colour"), "{said}");
    // Each feature shows.
    for off in [
        "textures=false",
        "smooth_shadows=false",
        "light.2.power=0",
        "sky.strength=0",
        "object.0.material.emitted=0",
        "object.0.material.k_l=0.5",
    ] {
        assert!(crate::binary::apart(&picture, &folder.picture(&["--set", off]).0) > 40, "{off}");
    }
    for strategy in [
        "naive",
        "naive,layout=indexed16,vectors=global",
        "deferred,layout=indexed32,triangles=constant,passes=separate",
        "tiled-common-origin",
        "wide-common-origin,intersector=pixel-linear",
        "bvh",
        "bvh-packet,passes=separate",
        "tile",
        "tile-watertight,passes=separate",
        "tile-group",
    ] {
        folder.picture(&["--verify", "--samples", "1", "--strategy", strategy]);
    }
}

#[test]
fn every_family_casts_several_samples_of_all_features_like_the_reference() {
    let folder = folder();
    for strategy in
        ["deferred", "wide-common-origin", "bvh", "bvh-packet,passes=separate", "tile", "tile-group"]
    {
        folder.picture(&["--verify", "--samples", "4", "--strategy", strategy]);
    }
}
