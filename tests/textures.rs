//! Tests of textures (pictures that give surfaces their colours), in every kernel family that supports
//! textures.

use crate::binary::{WorkFolder, apart, device, has};
use crate::common::due;
use image::{ImageFormat, Rgb, RgbImage};

/// Two quads, each with its own material: a wall that shows the picture once, and a floor on which the picture repeats,
/// rotated and skewed.
const ROOM: &str = "mtllib room.mtl
v -1 -1 -3
v 1 -1 -3
v 1 1 -3
v -1 1 -3
v -2 -1 -1
v 2 -1 -1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vt 3 3
vt 0 3
usemtl picture
f 1/1 2/2 3/3 4/4
usemtl tiles
f 5/1 6/6 2/5 1/2
";
const SCENE: &str = "[camera]
position = [0, 0, -0.5]
[[light]]
position = [0.5, 1.5, 0]
power = 20
[[light]]
position = [-1, 0.5, 0]
power = [5, 2, 1]
[[object]]
mesh = \"room.obj\"
[display]
exposure = 4
";

/// Returns a picture of 8 x 4 texels in smooth colours. The first row is red, the first column green.
fn picture() -> RgbImage {
    RgbImage::from_fn(8, 4, |x, y| match (x, y) {
        (_, 0) => Rgb([250, 40, 30]),
        (0, _) => Rgb([20, 220, 60]),
        _ => Rgb([200 - 10 * x as u8, 150 + 10 * y as u8, 240 - 15 * x as u8]),
    })
}

fn room(mtl: &str) -> WorkFolder {
    let folder = WorkFolder::with(&[("room.obj", ROOM), ("room.mtl", mtl), ("scene.toml", SCENE)]);
    picture().save(folder.path("a picture.png")).expect("a picture");
    folder
}

const MTL: &str = "newmtl picture
Kd 0.9 0.8 0.7
Ks 0.3 0.3 0.3
Ns 40
map_Kd a picture.png
newmtl tiles
Kd 0 0 0
map_Kd -s 1 1 1 -o 0.1 0.2 C:\\pictures\\a picture.png
";

/// Returns true if two pictures differ in more than eight pixels. Rounding may change a few pixels at edges.
fn differ(a: &RgbImage, b: &RgbImage) -> bool {
    apart(a, b) > 8
}

#[test]
fn every_family_that_takes_textures_agrees_with_the_reference() {
    let folder = room(MTL);
    let (expected, said) = folder.picture(&[]);
    // The only notes on textures concern the floor: the path of its picture, and its black.
    has(&said, &["for 1 texture, another file may be meant", "Kd 0 0 0 beside map_Kd is read as Kd 1 1 1"]);
    assert_eq!(said.lines().filter(|line| line.contains("texture")).count(), 2, "{said}");
    let shown = expected.pixels().map(|pixel| pixel.0).collect::<std::collections::BTreeSet<_>>().len();
    assert!(shown > 300, "{shown} colours");
    for strategy in [
        "naive",
        "deferred,layout=indexed16,passes=separate",
        "deferred,layout=indexed32,triangles=constant",
        "tiled-common-origin",
        "wide-common-origin",
        "bvh",
        "bvh-packet,passes=separate",
        "tile",
        "tile,passes=separate,intersector=watertight",
    ] {
        let (textured, _) = folder.picture(&["--verify", "--strategy", strategy]);
        assert!(!differ(&textured, &expected), "{strategy}");
    }
    folder.picture(&["--verify", "--samples", "4", "--strategy", "tile"]);
}

#[test]
fn a_family_without_textures_says_so_and_a_scene_can_leave_them_out() {
    let folder = room(MTL);
    let device = device();
    let raster = ["render", "scene.toml", "--device", &device, "--strategy", "raster"];
    has(&folder.mistake(&raster, 2), &["traversal = raster does not support textures, which the scene has"]);
    let (plain, _) = folder.picture(&["--set", "textures=false", "--strategy", "raster", "--verify"]);
    assert!(!differ(&plain, &folder.picture(&["--set", "textures=false"]).0));
    // The floor's own colour is black. If the floor has a texture, raycl treats its black as white, so the
    // floor has a hue only if it has its texture.
    let hue = |picture: &RgbImage| {
        let [least, most] = [picture[(36, 40)].0.into_iter().min(), picture[(36, 40)].0.into_iter().max()];
        most.unwrap_or_default() - least.unwrap_or_default()
    };
    assert!(hue(&plain) < 12 && hue(&folder.picture(&[]).0) >= 12);
}

#[test]
fn rows_of_a_picture_are_where_they_belong() {
    let folder = room(MTL);
    let (textured, _) = folder.picture(&[]);
    // The wall spans x from 22 to 50 and y from 8 to 37. The first row of the wall's texture is at the wall's
    // top.
    let channel = |x: u32, y: u32, channel: usize| i32::from(textured[(x, y)].0[channel]);
    assert!(channel(26, 11, 0) > channel(26, 11, 1) + 60, "{:?}", textured[(26, 11)]);
    assert!(channel(23, 22, 1) > channel(23, 22, 0) + 20, "{:?}", textured[(23, 22)]);
}

#[test]
fn a_picture_that_is_not_there_is_noted_with_its_line_and_its_material_keeps_its_colour() {
    let mtl = "newmtl picture\nKd 0.9 0.8 0.7\nmap_Kd none.png\nmap_Ks shine.png\nnewmtl tiles\nKd 0.5 0.5 0.5\nmap_Kd ../up.png\n";
    let folder = room(mtl);
    let (textured, said) = folder.picture(&["--verify"]);
    has(&said, &["room.mtl:3: texture `none.png` cannot be read", "own colour is used"]);
    has(&said, &["room.mtl:7: texture `../up.png`"]);
    has(&said, &["1 material asks for textures (map_Ks), which raycl does not support"]);
    assert_eq!(textured, folder.picture(&["--set", "textures=false"]).0);
    std::fs::write(folder.path("none.png"), "no picture").expect("a file");
    has(&folder.picture(&[]).1, &["texture `none.png` is not a PNG, JPEG, BMP or TGA"]);
    // One face has no texture coordinates; another refers to coordinates that are not in the file.
    std::fs::write(folder.path("room.mtl"), MTL).expect("a file");
    std::fs::write(folder.path("room.obj"), ROOM.replace("f 1/1 2/2 3/3 4/4", "f 1 2 3\nf 1/1 3/99 4/2"))
        .expect("a file");
    has(&folder.picture(&["--verify"]).1, &["2 triangles have a texture but no texture coordinates"]);
    std::fs::write(folder.path("room.obj"), ROOM.replace("vt 1 0", "vt 1 nan")).expect("a file");
    has(
        &folder.picture(&["--verify"]).1,
        &["line 9: `nan` in a texture coordinate", "1 such texture coordinate is ignored"],
    );
}

/// A picture repeats, so a whole number that is added to all texture coordinates changes nothing. In single
/// precision, coordinates as large as those of this test have no digits after the decimal point.
#[test]
fn a_picture_is_in_the_same_place_if_its_coordinates_are_far_from_0() {
    let folder = room("");
    let of = |mesh: &str| {
        std::fs::write(folder.path("scene.toml"), SCENE.replace("room.obj", mesh)).expect("a file");
        folder.picture(&[]).0
    };
    let obj = |whole: u32, options: &str| {
        let beyond = whole + 2;
        let text = format!(
            "mtllib quad.mtl\nv -1 -1 -3\nv 1 -1 -3\nv 1 1 -3\nv -1 1 -3\nvt {whole}.1 {whole}.2\nvt {beyond}.3 {whole}.2\n\
             vt {beyond}.3 {beyond}.4\nvt {whole}.1 {beyond}.4\nusemtl picture\nf 1/1 2/2 3/3 4/4\n"
        );
        std::fs::write(folder.path("quad.obj"), text).expect("a file");
        let mtl = format!("newmtl picture\nKd 0.9 0.8 0.7\nmap_Kd {options} a picture.png\n");
        std::fs::write(folder.path("quad.mtl"), mtl).expect("a file");
        of("quad.obj")
    };
    let near = obj(0, "");
    assert!(!differ(&obj(10_000_000, ""), &near));
    assert!(!differ(&obj(0, "-o 10000000 10000000"), &near));
    let gltf = |offset: &str| {
        let extensions = format!(r#"{{"KHR_texture_transform": {{"offset": {offset}}}}}"#);
        let text = gltf("{}", &format!(r#", "extensions": {extensions}"#));
        std::fs::write(folder.path("quad.gltf"), text).expect("a file");
        of("quad.gltf")
    };
    assert!(!differ(&gltf("[10000000.3, 0]"), &gltf("[0.3, 0]")));
}

/// Each change is a mistake in a kernel. For example, the changed kernel reads another channel or a wrong
/// neighbour of a texel, shifts the picture by half a texel, or uses a wrong coordinate of a corner.
#[test]
fn a_broken_texture_is_a_wrong_picture() {
    let folder = room(MTL);
    let changes = [
        ("as_float(words[texel >> 8 & 255])", "as_float(words[texel >> 16 & 255])"),
        ("down) * (float)height - 0.5f", "down) * (float)height"),
        ("ke = to_right * to_bottom", "ke = to_right"),
        ("w2 * c.x", "w2 * c.y"),
        ("return coordinate - floor(coordinate);", "return clamp(coordinate, 0.0f, 1.0f);"),
        ("texel >= size ? -size : 0", "texel > size ? -size : 0"),
    ];
    let all = ["deferred", "tile"].into_iter().flat_map(|strategy| changes.map(|change| (strategy, change)));
    for (strategy, (from, to)) in due(all) {
        folder.notices(("common/textures.cl", from, to), strategy, &["--verify"]);
    }
}

/// In models whose texture is a palette (areas of one colour each), all corners of a face often have the same
/// texture coordinates. If these coordinates are close to the edge of a dark area, rounding decides how much
/// light of the neighbouring area a pixel shows.
#[test]
fn a_face_at_the_edge_of_a_colour_of_a_palette_is_right_unless_it_shows_another_place() {
    let cube = "mtllib cube.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                vt 0.499521484 0.5\nusemtl palette\nf 5/1 6/1 7/1 8/1\nf 2/1 3/1 7/1 6/1\nf 8/1 7/1 3/1 4/1\n";
    let scene = "[camera]\nposition = [2, 2, 3]\nlook_at = [0.5, 0.5, 0.5]\n\
                 [[light]]\nposition = [2, 3, 3]\npower = 14\n[[object]]\nmesh = \"cube.obj\"\n";
    let mtl = "newmtl palette\nmap_Kd palette.png\n";
    let folder = WorkFolder::with(&[("cube.obj", cube), ("cube.mtl", mtl), ("scene.toml", scene)]);
    let palette = RgbImage::from_fn(1024, 4, |x, _| Rgb([if x < 512 { 0 } else { 255 }; 3]));
    palette.save(folder.path("palette.png")).expect("a picture");
    // Rounding moves a position by at most 0.0004 texels.
    let moved = ("common/textures.cl", "(float)width - 0.5f", "(float)width - 0.498f");
    for strategy in ["naive", "tile"] {
        folder.picture(&["--verify", "--strategy", strategy]);
        folder.notices(moved, strategy, &["--verify"]);
    }
}

/// Returns a glTF file of one quad with this sampler, and with its picture in base64.
pub fn gltf(sampler: &str, transform: &str) -> String {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    let floats = [
        [-1.0_f32, -1.0, -3.0],
        [1.0, -1.0, -3.0],
        [1.0, 1.0, -3.0],
        [-1.0, 1.0, -3.0], // positions
        [-0.5, 1.5, 1.5],
        [1.5, 1.5, -0.5],
        [-0.5, -0.5, 0.0], // four pairs of texture coordinates, and an unused number
    ];
    let mut bytes: Vec<u8> = floats.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.truncate(48 + 32);
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    let mut png = std::io::Cursor::new(Vec::new());
    picture().write_to(&mut png, ImageFormat::Png).expect("bytes in memory");
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}], "samplers": [{sampler}],
"images": [{{"uri": "data:image/png;base64,{}"}}], "textures": [{{"source": 0, "sampler": 0}}],
"materials": [{{"pbrMetallicRoughness": {{"metallicFactor": 0, "baseColorFactor": [0.9, 0.8, 0.7, 1],
"baseColorTexture": {{"index": 0{transform}}}}}}}],
"meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "indices": 2, "material": 0}}]}}],
"buffers": [{{"byteLength": 92, "uri": "data:;base64,{}"}}],
"bufferViews": [{{"buffer": 0, "byteLength": 48}}, {{"buffer": 0, "byteOffset": 48, "byteLength": 32}}, {{"buffer": 0, "byteOffset": 80, "byteLength": 12}}],
"accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
{{"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"}},
{{"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}}]}}"#,
        STANDARD.encode(png.into_inner()),
        STANDARD.encode(&bytes)
    )
}

/// Returns a glTF file of [`gltf`] whose picture is in the file `picture`.
pub fn with_picture(gltf: &str, picture: &str) -> String {
    let (before, after) = gltf.split_once("\"uri\": \"data:image").expect("a picture in the file");
    let after = after.split_once('"').expect("its end").1;
    format!("{before}\"uri\": \"{picture}\"{after}")
}

/// The picture has four areas of one colour each, and so many texels that pixels mix two mip levels. In the changed
/// kernel, the coarser of the two levels repeats.
#[test]
fn mip_levels_continue_beyond_their_edges_like_the_picture() {
    let folder = room(MTL);
    folder.write("scene.toml", &SCENE.replace("room.obj", "quad.gltf"));
    let channel = |place: u32| if place < 32 { 250 } else { 20 };
    let fine = RgbImage::from_fn(64, 64, |x, y| Rgb([channel(x), channel(y), 60]));
    fine.save(folder.path("fine.png")).expect("a picture");
    let [from, to] = ["head[3]", "WRAP_REPEAT"].map(|wrap| format!("texels_at(next_level(level), {wrap},"));
    for wrap in [33071, 33648] {
        let sampler = format!(r#"{{"wrapS": {wrap}, "wrapT": {wrap}}}"#);
        folder.write("quad.gltf", &with_picture(&gltf(&sampler, ""), "fine.png"));
        folder.picture(&["--verify"]);
        folder.notices(("common/textures.cl", from.as_str(), to.as_str()), "bvh", &["--verify"]);
    }
}

#[test]
fn samplers_of_gltf_repeat_clamp_and_mirror() {
    let folder = room(MTL);
    std::fs::write(folder.path("scene.toml"), SCENE.replace("room.obj", "quad.gltf")).expect("a file");
    let of = |sampler: &str, transform: &str| {
        std::fs::write(folder.path("quad.gltf"), gltf(sampler, transform)).expect("a file");
        let (picture, said) = folder.picture(&["--verify"]);
        assert!(!said.contains("texture"), "{said}");
        picture
    };
    let repeat = of("{}", "");
    let clamp = of(r#"{"wrapS": 33071, "wrapT": 33071}"#, "");
    let mirror = of(r#"{"wrapS": 33648, "wrapT": 33648}"#, "");
    assert!(repeat != clamp && clamp != mirror && repeat != mirror);
    // In glTF, each of the two texture coordinates has its own wrap mode.
    let across = of(r#"{"wrapS": 33071, "wrapT": 33648}"#, "");
    let down = of(r#"{"wrapS": 33648, "wrapT": 33071}"#, "");
    assert!(
        [&clamp, &mirror, &across].iter().all(|other| **other != down) && across != clamp && across != mirror
    );
    folder.notices(
        ("common/textures.cl", "down = wrap >> 8 & 15", "down = wrap & 15"),
        "tile",
        &["--verify"],
    );
    // Beyond an edge, only a repeated picture continues with the texels of the opposite edge.
    let repeat_across = of(r#"{"wrapT": 33071}"#, "");
    let lower =
        ("texel_in_texture((int)top + 1, height, down)", "texel_in_texture((int)top + 1, height, across)");
    folder.notices(("common/textures.cl", lower.0, lower.1), "tile", &["--verify"]);
    let repeat_down = of(r#"{"wrapS": 33071}"#, "");
    assert!([&repeat, &clamp, &repeat_down].iter().all(|other| **other != repeat_across));
    // Beyond the upper left corner, a clamped picture has that corner's colour: red.
    let corner = clamp[(24, 11)].0;
    assert!(corner[0] > corner[1] && corner[0] > corner[2], "{corner:?}");
    let moved = r#", "extensions": {"KHR_texture_transform": {"offset": [0.25, 0], "scale": [2, 2]}}"#;
    assert_ne!(of("{}", moved), repeat);
    // The OBJ file below has the same texture coordinates as the glTF file, but counts rows from the bottom.
    let obj = "mtllib quad.mtl\nv -1 -1 -3\nv 1 -1 -3\nv 1 1 -3\nv -1 1 -3\nvt -0.5 -0.5\nvt 1.5 -0.5\nvt 1.5 1.5\nvt -0.5 1.5\n\
               usemtl picture\nf 1/1 2/2 3/3 4/4\n";
    std::fs::write(folder.path("quad.obj"), obj).expect("a file");
    let mtl = "newmtl picture\nKd 0.9 0.8 0.7\nmap_Kd a picture.png\n";
    std::fs::write(folder.path("quad.mtl"), mtl).expect("a file");
    std::fs::write(folder.path("scene.toml"), SCENE.replace("room.obj", "quad.obj")).expect("a file");
    assert!(!differ(&folder.picture(&[]).0, &repeat));
}
