//! Tests of surfaces that emit light, in every kernel family.

use crate::binary::{WorkFolder, apart, device, has};
use crate::common::{due, soon};
use image::{Rgb, RgbImage};

/// A lamp in front of a wall, and a floor. The camera and the first light are in front of the lamp; the second light
/// shines on the lamp's back.
const ROOM: &str = "mtllib room.mtl
v -2 -1 -4
v 2 -1 -4
v 2 1.5 -4
v -2 1.5 -4
v -2 -1 -1
v 2 -1 -1
v -0.6 -0.4 -2.6
v 0.5 -0.4 -2.6
v 0.5 0.5 -2.9
v -0.6 0.5 -2.9
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl wall
f 1/1 2/2 3/3 4/4
f 5/1 6/2 2/3 1/4
usemtl lamp
f 7/1 8/2 9/3 10/4
";
const SCENE: &str = "[camera]
position = [0, 0.2, 0.2]
[[light]]
position = [0.5, 1.5, -0.5]
power = 30
[[light]]
position = [-1, 0.5, -3.5]
power = [5, 2, 1]
[[object]]
mesh = \"room.obj\"
[display]
exposure = 3
";
const LAMP: &str =
    "newmtl wall\nKd 0.7 0.6 0.5\nnewmtl lamp\nKd 0.2 0.2 0.2\nKs 0.3 0.3 0.3\nKe 4.5 1.5 0.3\n";
const TEXTURED: &str = "newmtl wall\nKd 0.7 0.6 0.5\nmap_Kd wall.png\nnewmtl lamp\nKd 0.4 0.4 0.4\nmap_Kd wall.png\n\
                        Ke 4.5 4.5 4.5\nmap_Ke glow.png\n";
/// `make test` tries the first and the ninth of the strategies that compile soon. In the first, materials are in global
/// memory; in the ninth, which is the last one, they are in `__local` memory.
const STRATEGIES: [&str; 10] = [
    "naive",
    "deferred,layout=indexed16,passes=separate",
    "deferred,layout=indexed32,triangles=constant",
    "tiled-common-origin",
    "bvh",
    "bvh-packet,passes=separate",
    "tile",
    "tile,passes=separate,intersector=watertight",
    "tile-group",
    "local-triangles",
];

fn room(mtl: &str) -> WorkFolder {
    let folder = WorkFolder::with(&[("room.obj", ROOM), ("room.mtl", mtl), ("scene.toml", SCENE)]);
    let wall = RgbImage::from_fn(6, 4, |x, y| Rgb([240 - 20 * x as u8, 120 + 30 * y as u8, 90]));
    // The emission texture is not square, so that its width and its height cannot be exchanged unnoticed.
    let glow = RgbImage::from_fn(64, 16, |x, y| match (x / 4 + y / 4) % 2 {
        0 => Rgb([250, 40 + 3 * x as u8, 30]),
        _ => Rgb([0, 0, 90]),
    });
    wall.save(folder.path("wall.png")).expect("a picture");
    glow.save(folder.path("glow.png")).expect("a picture");
    folder
}

fn agree(folder: &WorkFolder, strategies: &[&str], options: &[&str]) -> RgbImage {
    let expected = folder.picture(options).0;
    for strategy in strategies {
        let (picture, _) = folder.picture(&[&["--verify", "--strategy", strategy], options].concat());
        assert!(apart(&picture, &expected) <= 8, "{strategy}");
    }
    expected
}

#[test]
fn every_family_adds_emitted_light_like_the_reference() {
    let folder = room(LAMP);
    let strategies: Vec<&str> = due(soon(STRATEGIES)).chain(["raster"]).collect();
    let bright = agree(&folder, &strategies, &[]);
    for strategy in due(soon(["tile", "tile-group", "bvh", "raster"])) {
        folder.picture(&["--verify", "--samples", "4", "--strategy", strategy]);
    }
    // The scene's value of `emitted` replaces that of the MTL file, and only the lamp looks different.
    let dark = folder.picture(&["--set", "object.0.material.emitted=0", "--verify"]).0;
    let (lamp, wall) = ((34, 22), (22, 14));
    assert_eq!(bright[wall], dark[wall]);
    assert!(bright[lamp].0[0] > dark[lamp].0[0] + 20, "{:?} {:?}", bright[lamp], dark[lamp]);
    let differ = apart(&bright, &dark);
    assert!((40..800).contains(&differ), "{differ} pixels");
}

#[test]
fn emitted_light_needs_no_other_light_and_is_added_once_if_there_are_many() {
    let folder = room(LAMP);
    let gone = SCENE.split("[[light]]").next().expect("a camera");
    let rest = &SCENE[SCENE.find("[[object]]").expect("an object")..];
    folder.write("scene.toml", &format!("{gone}{rest}"));
    let strategies: Vec<&str> = due(soon(["naive", "bvh", "tile", "tile-group"])).chain(["raster"]).collect();
    let dark = agree(&folder, &strategies, &[]);
    assert_eq!((dark[(22, 14)].0, dark[(34, 22)].0.map(|channel| channel > 0)), ([0; 3], [true; 3]));
    // The scene has more lights than `tile-group` processes together (in one round of lights).
    let lights: String = (0..70)
        .map(|i| format!("[[light]]\nposition = [{}, 1.4, -1]\npower = 0.5\n", f64::from(i) * 0.02))
        .collect();
    folder.write("scene.toml", &format!("{gone}{lights}{rest}"));
    agree(&folder, &soon(["tile", "tile-group"]).collect::<Vec<_>>(), &[]);
}

#[test]
fn every_family_with_textures_multiplies_emitted_light_by_a_texture() {
    let folder = room(TEXTURED);
    let (picture, said) = folder.picture(&[]);
    assert!(!said.contains("texture"), "{said}");
    agree(&folder, &due(soon(STRATEGIES)).collect::<Vec<_>>(), &[]);
    let strategies: Vec<&str> = due(soon(["tile", "tile-group", "bvh", "naive"])).collect();
    agree(&folder, &strategies, &["--set", "mip_levels=false"]);
    assert!(apart(&picture, &folder.picture(&["--set", "textures=false"]).0) > 100);
    let raster = ["render", "scene.toml", "--device", &device(), "--strategy", "raster"];
    has(&folder.mistake(&raster, 2), &["traversal = raster does not support textures, which the scene has"]);
    // A scene may have an emission texture and no other texture. Without `Ke`, the emission texture is
    // multiplied by white.
    folder.write("room.mtl", "newmtl wall\nKd 0.7 0.6 0.5\nnewmtl lamp\nKd 0.4 0.4 0.4\nmap_Ke glow.png\n");
    agree(&folder, &strategies, &[]);
    // If a material has an emission texture, its triangles without texture coordinates emit no light.
    folder
        .write("room.mtl", &TEXTURED.replace("newmtl wall\nKd 0.7 0.6 0.5\nmap_Kd wall.png", "newmtl wall"));
    folder.write("room.obj", &ROOM.replace("f 7/1 8/2 9/3 10/4", "f 7/1 8/2 9/3\nf 7 9 10"));
    let (_, said) = folder.picture(&["--verify"]);
    has(
        &said,
        &["1 triangle has a texture but no texture coordinates", "the emission texture gives no light on it"],
    );
}

#[test]
fn a_bare_mesh_glows_in_soft_light_and_a_note_says_that_it_lights_nothing() {
    let all =
        soon(["tile", "bvh", "tile-group"]).flat_map(|strategy| [TEXTURED, LAMP].map(|mtl| (mtl, strategy)));
    for (mtl, strategy) in due(all) {
        let folder = room(mtl);
        let usual = ["render", "room.obj", "--width", "72", "--height", "45", "--force", "-o", "a.png"];
        let options = ["--device", &device(), "--strategy", strategy, "--verify"];
        let said = folder.output(&[&usual[..], &options].concat());
        has(&said, &["surfaces that emit light do not light other surfaces"]);
    }
}

#[test]
fn broken_emission_is_a_wrong_picture() {
    let folder = room(TEXTURED);
    let textures = "common/textures.cl";
    let changes = [
        (
            "deferred",
            "cast/shade.cl",
            "const Vec3 emitted = surface->emitted;",
            "const Vec3 emitted = surface->glossy;",
        ),
        ("tile", "tile_cpu/shade.cl", "        sum[vector] = shaded[vector].surface.emitted;\n", ""),
        ("tile", "tile_cpu/surface.cl", "LOAD3(material + 8)", "LOAD3(material + 7)"),
        ("tile-group", "tile_gpu/shade.cl", "if (emits) received", "if (!emits) received"),
        ("tile", textures, "(int)number.each[lane] - 1", "(int)number.each[lane] - 2"),
        ("bvh", textures, "wanted += 0.5f * log2", "wanted -= 0.5f * log2"),
        ("bvh", textures, "(float)head[1] * (float)head[2] /", "(float)head[1] * (float)head[1] /"),
        (
            "local-triangles",
            "cast/layout/soup.cl",
            "#define MATERIAL_STRIDE MATERIAL_FLOATS",
            "#define MATERIAL_STRIDE 8",
        ),
    ];
    for (strategy, file, from, to) in due(changes) {
        folder.notices((file, from, to), strategy, &["--verify"]);
    }
}
