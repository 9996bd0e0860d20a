//! Pictures of meshes of every format, of any size and at any position.

use crate::binary::{WorkFolder, device, has};
use flate2::Compression;
use flate2::write::GzEncoder;
use image::RgbImage;
use std::io::Write as _;

/// The four corners of a tetrahedron, which its faces share. The mesh has no normals. If the tetrahedron is
/// rendered as a bare mesh, all edges stay sharp, since the faces meet at more than 40 degrees.
const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.25], [1.0, 0.0, -2.0], [1.0, 2.0, -1.0]];
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

fn moved(scale: f64, by: [f64; 3]) -> Vec<[f64; 3]> {
    CORNERS.iter().map(|corner| std::array::from_fn(|i| corner[i] * scale + by[i])).collect()
}

fn obj(corners: &[[f64; 3]]) -> String {
    let vertices = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let faces = FACES.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    vertices.chain(faces).collect()
}

fn ply(corners: &[[f64; 3]]) -> String {
    let vertices = corners.iter().map(|[x, y, z]| format!("{x} {y} {z}\n"));
    let faces = FACES.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n"));
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n\
                  element face 4\nproperty list uchar int vertex_indices\nend_header\n";
    std::iter::once(header.to_owned()).chain(vertices).chain(faces).collect()
}

fn stl(corners: &[[f64; 3]]) -> String {
    let vertex = |i: &usize| format!("vertex {} {} {}\n", corners[*i][0], corners[*i][1], corners[*i][2]);
    let facet = |face: &[usize; 3]| {
        let vertices: String = face.iter().map(vertex).collect();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    format!("solid a\n{}endsolid a\n", FACES.iter().map(facet).collect::<String>())
}

fn gltf(corners: &[[f64; 3]]) -> String {
    let mut bytes: Vec<u8> =
        corners.as_flattened().iter().flat_map(|value| (*value as f32).to_le_bytes()).collect();
    bytes.extend(FACES.as_flattened().iter().flat_map(|index| (*index as u16).to_le_bytes()));
    let uri = format!("data:application/octet-stream;base64,{}", base64(&bytes));
    serde_json::json!({
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": bytes.len(), "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
    })
    .to_string()
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let four = |three: &[u8]| {
        let bits =
            three.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
        let digit = |index: usize| DIGITS[(bits >> (18 - 6 * index) & 63) as usize] as char;
        (0..4).map(|index| if index <= three.len() { digit(index) } else { '=' }).collect::<String>()
    };
    bytes.chunks(3).map(four).collect()
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("bytes in memory")
}

/// Renders a file with options, and returns the picture and the output.
fn picture(folder: &WorkFolder, name: &str, options: &[&str]) -> (RgbImage, String) {
    let device = device();
    let size =
        ["--width", "96", "--height", "60", "--force", "--plain", "-o", "out.png", "--device", &device];
    let said = folder.output(&[&["render", name], &size[..], options].concat());
    (image::open(folder.path("out.png")).expect("a picture").to_rgb8(), said)
}

/// Returns the number of pixels in which some channel differs by more than six steps.
fn differing(a: &RgbImage, b: &RgbImage) -> usize {
    let far =
        |(a, b): (&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 6);
    a.pixels().zip(b.pixels()).filter(|pair| far(*pair)).count()
}

#[test]
fn all_formats_of_a_mesh_are_one_picture_packed_or_not_and_from_a_pipe() {
    let corners = moved(1.0, [0.0; 3]);
    let folder = WorkFolder::with(&[("a.obj", &obj(&corners))]);
    let (expected, _) = picture(&folder, "a.obj", &[]);
    let covered = expected.pixels().filter(|pixel| **pixel != expected[(0, 0)]).count();
    assert!(covered > 600, "{covered} pixels");
    for (name, text) in [("a.ply", ply(&corners)), ("a.stl", stl(&corners)), ("a.gltf", gltf(&corners))] {
        std::fs::write(folder.path(name), &text).expect("a file");
        assert_eq!(picture(&folder, name, &[]).0, expected, "{name}");
        let packed_name = format!("{name}.gz");
        std::fs::write(folder.path(&packed_name), packed(text.as_bytes())).expect("a file");
        let (unpacked, said) = picture(&folder, &packed_name, &[]);
        assert!(unpacked == expected && !said.contains("read as"), "{said}");
    }
    // If a file's name suggests another format than its content, raycl prints a note. A mesh from a pipe has no file
    // name, so there is no note.
    std::fs::write(folder.path("b.ply"), stl(&corners)).expect("a file");
    has(&picture(&folder, "b.ply", &[]).1, &["b.ply: read as an STL mesh"]);
    let device = device();
    let pipe = ["render", "-", "-o", "-", "--plain", "--width", "96", "--height", "60", "--device", &device];
    let output = folder.raycl(&pipe).write_stdin(packed(ply(&corners).as_bytes())).assert().success();
    let output = output.get_output();
    let piped = image::load_from_memory(&output.stdout).expect("a PNG").to_rgb8();
    assert_eq!(piped, expected);
    has(&String::from_utf8_lossy(&output.stderr), &["picture   -", "picture: 4 triangles"]);
}

#[test]
fn what_a_pipe_cuts_off_is_said_to_be_cut_off() {
    let folder = WorkFolder::with(&[("w", "")]);
    let message_of = |bytes: Vec<u8>| {
        let output = folder.raycl(&["render", "-"]).write_stdin(bytes).assert().code(2);
        String::from_utf8_lossy(&output.get_output().stderr).into_owned()
    };
    let mut half = packed(ply(&moved(1.0, [0.0; 3])).as_bytes());
    half.truncate(half.len() / 2);
    let message = message_of(half);
    has(&message, &["cannot read the scene `-`: it cannot be unpacked", "may be cut off or damaged"]);
    assert!(!message.contains("did you mean"), "{message}");
    // A triangle of an STL file: a normal, three corners, and two further bytes.
    let numbers = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0_f32];
    let triangle: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).chain([0; 2]).collect();
    let message = message_of([&[0; 80][..], &[9, 0, 0, 0], &triangle, &triangle[..20]].concat());
    has(&message, &["-: the header says 9 triangles, but the file holds 1", "may be cut off or damaged"]);
}

#[test]
fn scenes_take_meshes_of_any_format_with_creases_of_their_own() {
    let scene = "[camera]\nposition = [1, 1, 4]\n[[light]]\nposition = [1, 3, 5]\npower = 60\n[[object]]\n";
    let corners = moved(1.0, [0.0; 3]);
    let files = [
        ("a.stl", stl(&corners)),
        ("smooth.toml", format!("{scene}mesh = \"a.stl\"\n")),
        ("sharp.toml", format!("{scene}mesh = \"a.stl\"\ncrease = 40\n")),
        ("all.toml", format!("crease = 40\n{scene}obj = \"a.stl\"\n")),
        ("flat.toml", format!("{scene}mesh = \"a.stl\"\nflat = true\n")),
        ("odd.toml", format!("{scene}shape = \"sphere\"\ncrease = 40\n")),
    ];
    let folder = WorkFolder::with(&files.each_ref().map(|(name, text)| (*name, text.as_str())));
    let of = |name: &str| picture(&folder, name, &[]).0;
    assert_eq!(of("sharp.toml"), of("flat.toml"));
    assert_eq!(of("sharp.toml"), of("all.toml"));
    assert!(differing(&of("sharp.toml"), &of("smooth.toml")) > 100);
    assert_eq!(picture(&folder, "smooth.toml", &["--crease", "40"]).0, of("sharp.toml"));
    has(&folder.mistake(&["render", "odd.toml"], 2), &["`crease` without `mesh`"]);
}

#[test]
fn any_scale_and_position_looks_the_same() {
    let folder = WorkFolder::with(&[("a.obj", &obj(&moved(1.0, [0.0; 3])))]);
    let (expected, _) = picture(&folder, "a.obj", &["--verify"]);
    for (scale, by) in [
        (1e-4, [0.0; 3]),
        (1e4, [0.0; 3]),
        (1.0, [500_000.25, 5_400_000.5, 120.125]),
        (1e-2, [500_000.0, 5_400_000.0, 120.0]),
        (1e-4, [3.0, -7.0, 2.0]),
        (1e-20, [0.0; 3]),
        (1e-9, [1.0, 2.0, -3.0]),
        (2e11, [0.0; 3]),
    ] {
        let corners = moved(scale, by);
        std::fs::write(folder.path("b.obj"), obj(&corners)).expect("a file");
        std::fs::write(folder.path("b.ply"), ply(&corners)).expect("a file");
        for name in ["b.obj", "b.ply"] {
            let (moved_picture, said) = picture(&folder, name, &["--verify"]);
            let different = differing(&moved_picture, &expected);
            assert!(different < 30, "{name}: {different} pixels at {scale}, {by:?}");
            assert_eq!(said.contains("was subtracted from its positions"), by != [0.0; 3], "{said}");
            let is_extreme = !(1e-6..1e9).contains(&scale);
            assert_eq!(said.contains("its positions were multiplied by"), is_extreme, "{said}");
        }
    }
    // In a scene file, a mesh far from the origin, such as a map, keeps its coordinates in double precision until
    // `translation` has been added.
    let scene =
        "[camera]\nposition = [1, 1, 4]\n[[light]]\nposition = [1, 3, 5]\npower = 60\n[[object]]\nmesh = ";
    std::fs::write(folder.path("c.obj"), obj(&moved(1.0, [500_000.25, 5_400_000.5, 120.125])))
        .expect("a file");
    std::fs::write(folder.path("near.toml"), format!("{scene}\"a.obj\"\n")).expect("a file");
    let translation = "translation = [-500000.25, -5400000.5, -120.125]";
    std::fs::write(folder.path("far.toml"), format!("{scene}\"c.obj\"\n{translation}\n")).expect("a file");
    assert_eq!(differing(&picture(&folder, "near.toml", &[]).0, &picture(&folder, "far.toml", &[]).0), 0);
}

#[test]
fn up_azimuth_elevation_and_background() {
    let corners = moved(1.0, [0.0; 3]);
    let z_up: Vec<[f64; 3]> = corners.iter().map(|[x, y, z]| [*x, -z, *y]).collect();
    let folder = WorkFolder::with(&[("y.obj", &obj(&corners)), ("z.obj", &obj(&z_up))]);
    let (upright, _) = picture(&folder, "y.obj", &[]);
    let lying = picture(&folder, "z.obj", &[]).0;
    assert!(differing(&lying, &upright) > 500);
    assert!(differing(&picture(&folder, "z.obj", &["--up", "z"]).0, &upright) < 20);
    let usual = ["--azimuth", "30.9638", "--elevation", "21.1002"];
    assert!(differing(&picture(&folder, "y.obj", &usual).0, &upright) < 20);
    assert!(differing(&picture(&folder, "y.obj", &["--azimuth", "-90"]).0, &upright) > 300);
    for (colour, shown) in
        [("#204060", [0x20, 0x40, 0x60]), ("white", [255; 3]), ("black", [0; 3]), ("#fa1", [255, 170, 17])]
    {
        let (shown_picture, _) = picture(&folder, "y.obj", &["--background", colour]);
        assert_eq!(shown_picture[(0, 0)].0, shown, "{colour}");
    }
    let wrong = [("--background", "blue-ish"), ("--elevation", "91"), ("--crease", "200"), ("--up", "w")];
    for (option, value) in wrong {
        has(&folder.mistake(&["render", "y.obj", option, value], 2), &[value]);
    }
    let position = "camera.position=[0,0,5]";
    let both = ["render", "y.obj", "--azimuth", "30", "--set", position, "--turntable", "4", "-o", "a.png"];
    has(&folder.mistake(&both, 2), &["--azimuth 30: this angle", position]);
}

#[test]
fn an_interior_wound_the_other_way_is_noted_and_turned() {
    // The camera is inside the tetrahedron, whose faces point outwards.
    let room = "[camera]\nposition = [1, 0.5, -0.8]\nlook_at = [1, 0.4, -3]\n[[light]]\nposition = [1, 0.6, -0.7]\npower = 5\n\
                [[object]]\nmesh = \"a.obj\"\ncrease = 0\n";
    let folder = WorkFolder::with(&[("a.obj", &obj(&moved(1.0, [0.0; 3]))), ("room.toml", room)]);
    let (dark, said) = picture(&folder, "room.toml", &[]);
    has(&said, &["% of the visible surface faces away from the camera", "--two-sided"]);
    let (lit, said) = picture(&folder, "room.toml", &["--two-sided"]);
    assert!(!said.contains("faces away"), "{said}");
    let mean = |picture: &RgbImage| picture.iter().map(|v| u64::from(*v)).sum::<u64>() / picture.len() as u64;
    assert!(mean(&dark) < 5 && mean(&lit) > 30, "{} {}", mean(&dark), mean(&lit));
}
