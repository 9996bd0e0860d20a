//! Tests with small valid and invalid glTF files.

mod noted;
mod skins;
mod textures;

use super::*;
use crate::scene::files::FileLight;
use crate::scene::mesh::Mesh;
use crate::scene::obj::Permitted;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::{DVec3, Vec3};
use std::io::Cursor;
use std::path::Path;

const PERMITTED: Permitted = Permitted { beyond: false, quotes: true, scaled: false };

/// Returns the buffer of one triangle: three positions, then three 16-bit indices.
fn bytes() -> Vec<u8> {
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = positions.iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2].iter().flat_map(|index| index.to_le_bytes()));
    bytes
}

/// Returns a file with one triangle and an embedded buffer; tests change the file by replacing text.
fn triangle() -> String {
    let data = STANDARD.encode(bytes());
    format!(
        r#"{{"asset": {{"version": "2.0"}},
"scenes": [{{"nodes": [0]}}],
"nodes": [{{"mesh": 0, "translation": [0, 0, 5]}}],
"meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}}]}}],
"buffers": [{{"byteLength": 42, "uri": "data:application/octet-stream;base64,{data}"}}],
"bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 6}}],
"accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}},
{{"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}}]}}"#
    )
}

fn read(text: &str) -> Result<MeshFile> {
    parse("a.gltf", Reach { folder: Path::new("/nowhere"), permitted: PERMITTED }, text.as_bytes())
}

fn corners(mesh: &Mesh) -> [Vec3; 3] {
    mesh.corners(&mesh.triangles[0])
}

#[test]
fn a_triangle_stands_where_its_node_does_and_is_flat() {
    let MeshFile { mesh, notes, .. } = read(&triangle()).unwrap();
    assert_eq!(notes, Vec::<String>::new());
    assert_eq!(corners(&mesh), [Vec3::Z * 5.0, Vec3::new(1.0, 0.0, 5.0), Vec3::new(0.0, 1.0, 5.0)]);
    assert_eq!(mesh.corner_normals(&mesh.triangles[0]), [Vec3::Z; 3]);
}

/// Parses the file of [`triangle`] as a binary file with these chunks (type and contents) after its JSON.
fn parse_binary(chunks: &[(&[u8; 4], &[u8])]) -> Result<MeshFile> {
    let json = triangle();
    let (start, end) = (json.find(", \"uri\"").unwrap(), json.find("\"}],\n\"bufferViews").unwrap());
    let mut json = format!("{}{}", &json[..start], &json[end + 1..]).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
    let chunk = |(kind, contents): (&[u8; 4], &[u8])| [&length(contents), &kind[..], contents].concat();
    let rest: Vec<u8> = chunks.iter().flat_map(|of| chunk(*of)).collect();
    let contents = [chunk((b"JSON", &json)), rest].concat();
    let total = (12 + contents.len() as u32).to_le_bytes();
    let glb = [b"glTF\x02\0\0\0", &total[..], &contents].concat();
    parse("a.glb", Reach { folder: Path::new(""), permitted: PERMITTED }, &glb)
}

#[test]
fn a_binary_file_holds_the_same() {
    let mut binary = bytes();
    binary.resize(44, 0);
    let mesh = parse_binary(&[(b"BIN\0", &binary)]).unwrap().mesh;
    assert_eq!(mesh, read(&triangle()).unwrap().mesh);
}

/// A note says that zero normals are mistakes of the file, so raycl must not make such normals.
#[test]
fn a_triangle_without_normals_and_area_gets_no_zero_normals() {
    let mut data = bytes();
    data[24..36].copy_from_slice(&bytes()[12..24]);
    let mesh = read(&triangle().replace(&STANDARD.encode(bytes()), &STANDARD.encode(data))).unwrap().mesh;
    assert_eq!(corners(&mesh)[1..], [Vec3::new(1.0, 0.0, 5.0); 2]);
    assert_eq!(mesh.corner_normals(&mesh.triangles[0]), [Vec3::Z; 3]);
}

#[test]
fn a_binary_file_without_its_buffer_may_be_cut_off() {
    for chunks in [&[][..], &[(b"BIN\0", &[][..])]] {
        let error = parse_binary(chunks).err().unwrap();
        assert!(error.to_string().starts_with("a.glb: buffer 0"), "{error}");
        assert!(
            error.remedy().starts_with("the file may be cut off or damaged"),
            "{error}: {}",
            error.remedy()
        );
    }
}

/// The node moves its mesh by 5 along z.
#[test]
fn a_position_that_is_not_finite_is_reported_as_the_file_has_it() {
    let mut data = bytes();
    data[16..20].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = read(&triangle().replace(&STANDARD.encode(bytes()), &STANDARD.encode(data))).err().unwrap();
    let expected = "a.gltf: node 0: a vertex of mesh 0 is at [1, NaN, 0]; expected finite coordinates";
    assert!(error.to_string().starts_with(expected), "{error}");
}

#[test]
fn nodes_turn_scale_mirror_and_nest() {
    let nested = r#""nodes": [{"children": [1], "scale": [-2, 2, 2]}, {"mesh": 0, "rotation": [0, 0, 0.70710678, 0.70710678]}]"#;
    let mesh = read(&triangle().replace(r#""nodes": [{"mesh": 0, "translation": [0, 0, 5]}]"#, nested))
        .unwrap()
        .mesh;
    // A quarter turn about z maps x to y and y to -x; then x is mirrored, which reverses the winding.
    let [a, b, c] = corners(&mesh);
    assert!(
        a.distance(Vec3::ZERO) < 1e-6 && b.distance(Vec3::X * 2.0) < 1e-6 && c.distance(Vec3::Y * 2.0) < 1e-6
    );
    assert!(mesh.corner_normals(&mesh.triangles[0])[0].distance(Vec3::Z) < 1e-6);
}

/// Returns the file of [`triangle`], with the corners' positions stored as normalised 8-bit numbers.
fn quantised() -> String {
    let mut quantised = [[0_i8, 0, 0], [-128, 0, 0], [0, 127, -127]].concat();
    quantised.resize(36, 0);
    let quantised = quantised.iter().map(|number| number.to_le_bytes()[0]);
    let data: Vec<u8> = quantised.chain(bytes()[36..].iter().copied()).collect();
    triangle()
        .replace(&STANDARD.encode(bytes()), &STANDARD.encode(data))
        .replace(r#""componentType": 5126,"#, r#""componentType": 5120, "normalized": true,"#)
}

/// The smallest number of a signed type and the next larger number both become -1 (glTF 2.0, 3.11).
#[test]
fn normalised_numbers_go_from_minus_one_to_one() {
    let mesh = read(&quantised()).unwrap().mesh;
    assert_eq!(corners(&mesh), [Vec3::Z * 5.0, Vec3::new(-1.0, 0.0, 5.0), Vec3::new(0.0, 1.0, 4.0)]);
}

#[test]
fn a_sparse_accessor_replaces_the_elements_that_its_indices_name() {
    // The sparse accessor replaces one position. The sparse accessor's index and value are read from bytes
    // that the file also uses for the triangle. The index is the second of the triangle's three indices: 1.
    // The new position is read from the second to fourth of the positions' nine coordinates: 0, 0, 1.
    let sparse = r#""type": "VEC3", "sparse": {"count": 1,
"indices": {"bufferView": 1, "byteOffset": 2, "componentType": 5123},
"values": {"bufferView": 0, "byteOffset": 4}},"#;
    let mesh = read(&triangle().replace(r#""type": "VEC3","#, sparse)).unwrap().mesh;
    assert_eq!(corners(&mesh), [Vec3::Z * 5.0, Vec3::Z * 6.0, Vec3::new(0.0, 1.0, 5.0)]);
}

/// All elements of the accessor are sparse, so the accessor has no other data.
#[test]
fn an_accessor_with_only_sparse_elements_is_not_without_data() {
    let sparse = r#""accessors": [{"sparse": {"count": 3,
"indices": {"bufferView": 1, "byteOffset": 0, "componentType": 5123},
"values": {"bufferView": 0, "byteOffset": 0}}, "componentType": 5126,"#;
    let text = triangle().replace(r#""accessors": [{"bufferView": 0, "componentType": 5126,"#, sparse);
    assert!(text.contains("sparse"), "{text}");
    let file = read(&text).unwrap();
    assert_eq!(file.mesh, read(&triangle()).unwrap().mesh);
    assert_eq!(file.notes, Vec::<String>::new());
}

#[test]
fn sparse_elements_are_normalised_like_the_others() {
    // The sparse accessor replaces one position. The sparse accessor's index and value are read from bytes
    // that the file also uses for the triangle. The index is the second of the triangle's three indices: 1.
    // The new position is read from the sixth to eighth of the corners' nine coordinates: 0, 0, 127.
    let sparse = r#""type": "VEC3", "sparse": {"count": 1,
"indices": {"bufferView": 1, "byteOffset": 2, "componentType": 5123},
"values": {"bufferView": 0, "byteOffset": 5}},"#;
    let mesh = read(&quantised().replace(r#""type": "VEC3","#, sparse)).unwrap().mesh;
    assert_eq!(corners(&mesh), [Vec3::Z * 5.0, Vec3::Z * 6.0, Vec3::new(0.0, 1.0, 4.0)]);
}

#[test]
fn a_stride_of_zero_means_that_nothing_lies_between_elements() {
    let text = triangle().replacen(r#""byteLength": 36}"#, r#""byteLength": 36, "byteStride": 0}"#, 1);
    assert!(text.contains("byteStride"), "{text}");
    assert_eq!(read(&text).unwrap().mesh, read(&triangle()).unwrap().mesh);
}

#[test]
fn a_far_node_is_centred() {
    let file = read(&triangle().replace("[0, 0, 5]", "[500000, 5400000, 0]")).unwrap();
    assert!(file.placement.origin.distance(DVec3::new(500_000.5, 5_400_000.5, 0.0)) < 1e-9);
    assert_eq!(corners(&file.mesh)[0], Vec3::new(-0.5, -0.5, 0.0));
}

/// In single precision, 1e8 and the next larger number differ by 8.
#[test]
fn far_nodes_keep_their_distances() {
    let matrix = r#"{"mesh": 0, "matrix": [0.1,0,0,0, 0,1,0,0, 0,0,1,0, 100000003.25,0,0,1]}"#;
    let nodes = format!(r#"{{"mesh": 0, "translation": [1e8, 0, 0]}}, {matrix}"#);
    let text = triangle().replace(r#"{"mesh": 0, "translation": [0, 0, 5]}"#, &nodes);
    let file = read(&text.replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#)).unwrap();
    let [first, second] = [0, 1].map(|triangle| file.mesh.corners(&file.mesh.triangles[triangle]));
    assert_eq!(second[0] - first[0], Vec3::X * 3.25);
    assert!((second[1].x - second[0].x - 0.1).abs() < 1e-6);
}

#[test]
fn materials_cameras_and_lights() {
    let text = triangle()
        .replace(r#""indices": 1"#, r#""indices": 1, "material": 0"#)
        .replace(
            r#""scenes""#,
            r#""materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0, 1], "baseColorTexture": {"index": 0}},
"alphaMode": "BLEND", "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}}],
"cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
"extensionsUsed": ["KHR_lights_punctual"],
"extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 3, "spot": {}}]}},
"animations": [{"channels": [], "samplers": []}], "scenes""#,
        )
        .replace(
            r#""translation": [0, 0, 5]}"#,
            r#""camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 0, 5]}"#,
        );
    let file = read(&text).unwrap();
    let triangle = &file.mesh.triangles[0];
    assert_eq!(file.mesh.material(triangle).lambertian, Vec3::new(0.5, 0.25, 0.0));
    let camera = file.camera.unwrap();
    assert_eq!((camera.position, camera.forward, camera.fov_is_vertical), (Vec3::Z * 5.0, Vec3::NEG_Z, true));
    assert_eq!((camera.z_near, camera.tan_half_fov), (0.1, 0.5_f32.tan()));
    assert_eq!(file.lights.len(), 1);
    assert_eq!(file.light_notes, ["1 spot light is shown as shining in all directions"]);
    let notes = file.notes.join("\n");
    for part in [
        "texture 0 does not exist: its material's own colour is used",
        "alphaMode BLEND",
        "metal (metallicFactor)",
        "KHR_materials_clearcoat",
        "1 animation is",
    ] {
        assert!(notes.contains(part), "{part} is not in:\n{notes}");
    }
}

/// Returns the notes on a camera that looks from the origin along -z at a triangle. `range` has the camera's
/// `znear` and perhaps its `zfar`.
fn camera_notes(range: &str, z_of_triangle: i32) -> Vec<String> {
    let lens = format!(r#"{{"yfov": 1, {range}}}"#);
    let camera = format!(r#""cameras": [{{"type": "perspective", "perspective": {lens}}}], "scenes": ["#);
    let text = triangle()
        .replace(r#""scenes": ["#, &camera)
        .replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#)
        .replace("[0, 0, 5]}", &format!("[0, 0, {z_of_triangle}]}}, {{\"camera\": 0}}"));
    let file = read(&text).unwrap();
    assert!(file.camera.is_some() && file.notes.is_empty(), "{:?}", file.notes);
    file.camera_notes
}

#[test]
fn the_end_of_a_cameras_sight_is_noted_if_the_mesh_reaches_beyond_it() {
    let expected = "the camera's zfar of 1 is not used: surfaces beyond it are drawn";
    assert_eq!(camera_notes(r#""znear": 0.1, "zfar": 1"#, -5), [expected]);
    for range in [r#""znear": 0.1"#, r#""znear": 0.1, "zfar": 6"#] {
        assert_eq!(camera_notes(range, -5), [""; 0], "{range}");
    }
}

#[test]
fn a_camera_that_sees_no_part_of_the_mesh_is_noted() {
    let expected = "the file's camera sees no part of the mesh: --azimuth 31 uses raycl's own camera instead";
    assert_eq!(camera_notes(r#""znear": 0.1"#, 5), [expected], "the mesh is behind the camera");
    assert_eq!(camera_notes(r#""znear": 5.5"#, -5), [expected], "the mesh is too near");
    assert_eq!(camera_notes(r#""znear": 4.5"#, -5), [""; 0]);
}

/// A node with scale 0, by which a program hides a mesh, changes no note on the camera.
#[test]
fn a_hidden_mesh_is_not_seen_by_a_camera() {
    let lens = r#"{"yfov": 1, "znear": 0.1, "zfar": 100}"#;
    let camera = format!(r#""cameras": [{{"type": "perspective", "perspective": {lens}}}], "scenes": ["#);
    let notes = |z: i32| {
        let hidden = r#"{"mesh": 0, "scale": [0, 0, 0], "translation": [0, 0, -300]}"#;
        let text = triangle()
            .replace(r#""scenes": ["#, &camera)
            .replace(r#""nodes": [0]"#, r#""nodes": [0, 1, 2]"#)
            .replace("[0, 0, 5]}", &format!("[0, 0, {z}]}}, {{\"camera\": 0}}, {hidden}"));
        read(&text).unwrap().camera_notes
    };
    assert_eq!(notes(-5), [""; 0]);
    assert_eq!(notes(5).len(), 1);
}

#[test]
fn corners_keep_their_colours_beside_those_of_materials() {
    let text = triangle().replace(r#"{"POSITION": 0}"#, r#"{"POSITION": 0, "COLOR_0": 2}"#).replace(
        r#""type": "SCALAR"}"#,
        r#""type": "SCALAR"}, {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}"#,
    );
    let file = read(&text).unwrap();
    // The positions are used as colours: black, red and green.
    let [black, red, green, white] = [0, 1023 << 20, 1023 << 10, (1 << 30) - 1];
    let colour = |mesh: &Mesh, at: usize| mesh.material(&mesh.triangles[at]).lambertian;
    assert_eq!(
        (colour(&file.mesh, 0), &file.mesh.corner_colours[..]),
        (Vec3::ONE, &[[black, red, green]][..])
    );
    assert_eq!(file.notes, [""; 0]);
    // Two more primitives come first: one has neither a material nor colours, and the next one has both.
    let others = r#""primitives": [{"attributes": {"POSITION": 0}},
{"attributes": {"POSITION": 0, "COLOR_0": 2}, "material": 0}, "#;
    let materials = r#"{"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}], "#;
    let mixed = text.replace(r#""primitives": ["#, others).replacen('{', materials, 1);
    let mesh = read(&mixed).unwrap().mesh;
    assert_eq!([0, 1, 2].map(|at| colour(&mesh, at)), [0.8, 0.5, 1.0].map(Vec3::splat));
    assert_eq!(mesh.corner_colours, [[white; 3], [black, red, green], [black, red, green]]);
}

/// The list of normals or colours consists of the same bytes as the list of positions.
#[test]
fn whole_numbers_of_32_bits_are_in_no_list_of_vertices() {
    let last = |kind: u32| {
        format!(
            r#""type": "SCALAR"}}, {{"bufferView": 0, "componentType": {kind}, "count": 3, "type": "VEC3"}}"#
        )
    };
    for attribute in ["NORMAL", "COLOR_0"] {
        let attributes = format!(r#"{{"POSITION": 0, "{attribute}": 2}}"#);
        let text = triangle().replace(r#"{"POSITION": 0}"#, &attributes);
        assert!(read(&text.replace(r#""type": "SCALAR"}"#, &last(5126))).is_ok());
        let error = read(&text.replace(r#""type": "SCALAR"}"#, &last(5125))).err().unwrap().to_string();
        assert!(
            error.contains("accessor 2: its componentType is 5125 (unsigned int); expected 5126"),
            "{error}"
        );
    }
}

#[test]
fn a_list_that_is_not_as_long_as_the_list_of_positions_is_refused_by_its_name() {
    let two = r#""type": "SCALAR"}, {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3"}"#;
    for (attribute, what) in [("NORMAL", "normals"), ("COLOR_0", "colours")] {
        let attributes = format!(r#"{{"POSITION": 0, "{attribute}": 2}}"#);
        let text = triangle().replace(r#"{"POSITION": 0}"#, &attributes);
        let error = read(&text.replace(r#""type": "SCALAR"}"#, two)).err().unwrap().to_string();
        assert!(error.contains(&format!("2 {what} for 3 positions")), "{error}");
    }
}

#[test]
fn lights_of_intensity_0_are_left_out_and_noted() {
    let lights = r#"{"extensions": {"KHR_lights_punctual": {"lights": [
{"type": "point", "intensity": 0, "range": 1}, {"type": "spot", "color": [0, 0, 0], "spot": {}}]}},
"scenes": [{"nodes": [0, 1]}], "#;
    let dark = r#"{"extensions": {"KHR_lights_punctual": {"light": 1}}}, {"mesh": 0,
"extensions": {"KHR_lights_punctual": {"light": 0}},"#;
    let text = triangle().replacen("{", lights, 1).replace(r#""scenes": [{"nodes": [0]}],"#, "");
    let file = read(&text.replace(r#"{"mesh": 0,"#, dark)).unwrap();
    assert_eq!(
        (file.lights.len(), file.light_notes),
        (0, vec!["2 lights with an intensity or colour of 0 are left out".to_owned()])
    );
}

#[test]
fn positions_that_no_triangle_uses_are_left_out() {
    // The triangle uses two of the three positions in the list, and the list of positions also serves as the
    // list of normals.
    let text = triangle()
        .replace(r#"{"POSITION": 0}"#, r#"{"POSITION": 0, "NORMAL": 0}"#)
        .replace(&STANDARD.encode(bytes()), &STANDARD.encode([&bytes()[..36], &[1, 0, 2, 0, 1, 0]].concat()));
    let mesh = read(&text).unwrap().mesh;
    assert_eq!(mesh.positions, [Vec3::new(1.0, 0.0, 5.0), Vec3::new(0.0, 1.0, 5.0)]);
    assert_eq!(corners(&mesh), [mesh.positions[0], mesh.positions[1], mesh.positions[0]]);
    assert_eq!(mesh.corner_normals(&mesh.triangles[0]), [Vec3::X, Vec3::Y, Vec3::X]);
}

/// The test's file has almost 4 MB, and its mesh would take about 900 GB.
#[test]
fn a_mesh_that_too_many_nodes_place_is_refused_before_it_is_made() {
    let nodes = vec![r#"{"mesh": 0}"#; 200_000].join(",");
    let numbers = (0..200_000).map(|node| node.to_string()).collect::<Vec<_>>().join(",");
    let text = triangle()
        .replace(r#""nodes": [0]"#, &format!(r#""nodes": [{numbers}]"#))
        .replace(r#"{"mesh": 0, "translation": [0, 0, 5]}"#, &nodes)
        .replace(r#", "indices": 1"#, "")
        .replace(
            r#"{"bufferView": 0, "componentType": 5126, "count": 3"#,
            r#"{"componentType": 5126, "count": 65536"#,
        );
    let error = read(&text).err().unwrap().to_string();
    assert!(
        error.starts_with("reading a.gltf needs about") && error.contains("B for the meshes of all nodes"),
        "{error}"
    );
}

/// A scene file may name a mesh in another folder. This mesh may belong to somebody else, so errors and notes
/// must not quote it.
#[test]
fn words_of_a_file_of_others_are_in_no_error_and_no_note() {
    let permitted = Permitted { quotes: false, ..PERMITTED };
    let reach = Reach { folder: Path::new("/nowhere"), permitted };
    let parsed = |from: &str, to: &str| parse("a.gltf", reach, triangle().replacen(from, to, 1).as_bytes());
    let data = format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes()));
    for (from, to, message) in [
        (
            "{",
            r#"{"extensionsRequired": ["secret_compression"], "#,
            "an extension that compresses its vertices, which",
        ),
        (&data, "secret.bin", "a.gltf: buffer 0: its URI cannot be read ("),
        (&data, "https://secret", "a.gltf: buffer 0: its URI is not a file; nothing is downloaded"),
        (&data, "data:;base64,secret?", "a.gltf: buffer 0: its data: URI is damaged"),
        (
            "\"2.0\"},\n\"scenes\": [",
            "\"secret\"},\n\"scenes\": [7, ",
            "glTF of this version; expected version 2.0 or another 2.x",
        ),
        (r#""mesh": 0"#, r#""mesh": "secret""#, "a.gltf:3: not valid glTF 2.0"),
        (r#""mesh": 0"#, r#""mesh": 7"#, "a.gltf: node 0: mesh 7 does not exist"),
    ] {
        let error = parsed(from, to).err().unwrap().to_string();
        assert!(error.contains(message) && !error.contains("secret"), "{error}");
    }
    let extensions = r#"{"extensionsUsed": ["secret", "EXT_x"], "extensionsRequired": ["secret"],
"animations": [{"channels": [], "samplers": []}], "#;
    let notes = parsed("{", extensions).unwrap().notes.join("\n");
    for note in [
        "1 animation is left out",
        "requires extensions that raycl does not support",
        "extensions are ignored",
    ] {
        assert!(notes.contains(note) && !notes.contains("secret"), "{notes}");
    }
}

#[test]
fn alpha_of_vertex_colours_is_noted_where_the_material_would_use_it() {
    let text = triangle()
        .replace(r#"{"POSITION": 0}, "indices": 1"#, r#"{"POSITION": 0, "COLOR_0": 2}, "indices": 1, "material": 0"#)
        .replace(
            r#""type": "SCALAR"}"#,
            r#""type": "SCALAR"}, {"bufferView": 0, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC4"}"#,
        );
    let plain = text.replace(r#", "material": 0"#, "");
    assert!(!read(&plain).unwrap().notes.iter().any(|note| note.contains("COLOR_0")), "it has no material");
    for (mode, is_noted) in [("OPAQUE", false), ("MASK", true), ("BLEND", true)] {
        let material = format!("{{\"materials\": [{{\"alphaMode\": \"{mode}\"}}], ");
        let notes = read(&text.replacen('{', &material, 1)).unwrap().notes;
        let note = "1 primitive with alpha in its COLOR_0 is shown without this alpha";
        assert_eq!(notes.iter().any(|noted| noted == note), is_noted, "{mode}: {notes:?}");
    }
}

#[test]
fn whole_numbers_of_colours_are_shown_as_if_they_were_normalised() {
    // The bytes of the positions are the colours.
    let text = |normalised: &str| {
        let accessor = format!(
            r#""type": "SCALAR"}}, {{"bufferView": 0, "byteOffset": 24, "componentType": 5121,{normalised} "count": 3, "type": "VEC4"}}"#
        );
        let attributes = r#"{"POSITION": 0, "COLOR_0": 2}"#;
        triangle().replace(r#"{"POSITION": 0}"#, attributes).replace(r#""type": "SCALAR"}"#, &accessor)
    };
    let [whole, normalised] = ["", r#" "normalized": true,"#].map(|stated| read(&text(stated)).unwrap());
    assert_eq!(whole.mesh.corner_colours, normalised.mesh.corner_colours);
    // The bytes 28 to 31 are a one in single precision: 0, 0, 128, 63.
    let blue = ((128.0_f32 / 255.0).sqrt() * 1023.0).round() as u32;
    assert_eq!(whole.mesh.corner_colours, [[0, blue, 0]]);
    let note = "1 primitive with whole numbers in COLOR_0, but without `normalized`, is shown as if they were normalised";
    assert_eq!((&whole.notes[..], &normalised.notes[..]), (&[note.to_owned()][..], &[][..]));
}

#[test]
fn what_is_required_and_lacking_is_named_and_what_is_known_is_not() {
    let required =
        |names: &str| read(&triangle().replacen('{', &format!("{{\"extensionsRequired\": [{names}], "), 1));
    let names = r#""KHR_draco_mesh_compression", "KHR_texture_transform", "EXT_meshopt_compression""#;
    let error = required(names).err().unwrap();
    let expected = "the extensions `KHR_draco_mesh_compression`, `EXT_meshopt_compression`, which";
    assert!(error.to_string().contains(expected), "{error}");
    assert!(miette::Diagnostic::help(&error).unwrap().to_string().contains("without compression"));
    let notes = required(r#""KHR_techniques_webgl", "X_y""#).unwrap().notes;
    let expected = "requires extensions that raycl does not support, so the picture may be wrong: \
        `KHR_techniques_webgl`, `X_y`";
    assert!(notes.iter().any(|note| note.contains(expected)), "{notes:?}");
    assert!(required(r#""KHR_materials_unlit", "KHR_mesh_quantization""#).is_ok());
    let used =
        read(&triangle().replacen('{', "{\"extensionsUsed\": [\"EXT_mesh_gpu_instancing\"], ", 1)).unwrap();
    assert!(used.notes[0].contains("`EXT_mesh_gpu_instancing`"), "{:?}", used.notes);
    let used = read(&triangle().replacen(
        '{',
        "{\"extensionsUsed\": [\"KHR_materials_variants\", \"KHR_materials_ior\"], ",
        1,
    ));
    assert_eq!(used.unwrap().notes, ["unsupported extensions are ignored: `KHR_materials_variants`"]);
}

/// The second buffer stores nothing: the extension fills it.
#[test]
fn a_buffer_that_an_extension_decompresses_is_refused_with_its_cause() {
    let buffer = r#"{"byteLength": 4, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}"#;
    let text = triangle().replace(r#""buffers": ["#, &format!(r#""buffers": [{buffer}, "#));
    let error = read(&text).err().unwrap().to_string();
    let expected = "the file requires the extension `EXT_meshopt_compression`, which raycl does not support";
    assert!(error.ends_with(expected), "{error}");
}

#[test]
fn an_accessor_without_data_is_zero_and_noted() {
    let with = |attributes: &str| {
        let text = triangle().replace(r#"{"POSITION": 0}"#, attributes).replace(
            r#""type": "SCALAR"}"#,
            r#""type": "SCALAR"}, {"componentType": 5126, "count": 3, "type": "VEC3"}"#,
        );
        read(&text)
    };
    let file = with(r#"{"POSITION": 0, "NORMAL": 2}"#).unwrap();
    assert_eq!(file.mesh.corner_normals(&file.mesh.triangles[0]), [Vec3::ZERO; 3]);
    assert_eq!(file.notes, ["1 accessor without data is read as zeros"]);
    let unused = with(r#"{"POSITION": 0}"#).unwrap();
    assert_eq!(unused.notes, Vec::<String>::new());
    let point = with(r#"{"POSITION": 2}"#).unwrap();
    assert_eq!((point.mesh.positions, point.placement.origin), (vec![Vec3::ZERO; 3], DVec3::Z * 5.0));
}

#[test]
fn attributes_of_other_numbers_than_the_positions_are_refused_by_their_own_name() {
    for (attribute, what) in [("NORMAL", "normals"), ("COLOR_0", "colours")] {
        let attributes = format!(r#"{{"POSITION": 0, "{attribute}": 2}}"#);
        let text = triangle().replace(r#"{"POSITION": 0}"#, &attributes).replace(
            r#""type": "SCALAR"}"#,
            r#""type": "SCALAR"}, {"componentType": 5126, "count": 2, "type": "VEC3"}"#,
        );
        let error = read(&text).err().unwrap().to_string();
        assert!(error.contains(&format!("2 {what} for 3 positions")), "{error}");
    }
}

#[test]
fn positions_in_a_compressed_primitive_are_refused_and_a_copy_of_them_is_read() {
    let draco = r#""indices": 1, "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0}}"#;
    let text = triangle().replace(r#""indices": 1"#, draco);
    assert_eq!(corners(&read(&text).unwrap().mesh), corners(&read(&triangle()).unwrap().mesh));
    let error = read(&text.replace(r#""accessors": [{"bufferView": 0, "#, r#""accessors": [{"#));
    let error = error.err().unwrap().to_string();
    assert!(error.contains("requires the extension `KHR_draco_mesh_compression`"), "{error}");
}

#[test]
fn triangles_with_positions_that_do_not_exist_are_left_out() {
    let two = triangle()
        .replace(r#""indices": 1"#, r#""indices": 1, "mode": 5"#)
        .replace(r#""count": 3, "type": "SCALAR""#, r#""count": 4, "type": "SCALAR""#);
    let data = STANDARD.encode([&bytes()[..], &9_u16.to_le_bytes()].concat());
    let two = two
        .replace(&STANDARD.encode(bytes()), &data)
        .replace(r#""byteLength": 42"#, r#""byteLength": 44"#)
        .replace(r#""byteLength": 6"#, r#""byteLength": 8"#);
    let file = read(&two).unwrap();
    assert_eq!(file.mesh.triangles.len(), 1);
    assert_eq!(file.notes, ["1 triangle with a position that does not exist is left out"]);
}

#[test]
fn meshes_that_no_node_places_are_shown_and_other_scenes_noted() {
    let library = triangle().replace(r#""nodes": [0]"#, r#""name": "empty""#);
    let file = read(&library).unwrap();
    assert_eq!(corners(&file.mesh), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(file.notes, ["1 mesh that no node of the scene places is shown without a transform"]);
    let scenes = triangle().replace(r#""scenes": ["#, r#""scene": 1, "scenes": [{"nodes": []}, "#);
    let notes = read(&scenes).unwrap().notes;
    assert_eq!(
        notes,
        ["the file has 2 scenes, of which the file's default is shown (scene 1, counted from 0)"]
    );
    let first = scenes
        .replace(r#""scene": 1, "#, "")
        .replace(r#"[{"nodes": []}, {"nodes": [0]}]"#, r#"[{"nodes": [0]}, {}]"#);
    assert_eq!(read(&first).unwrap().notes, ["the file has 2 scenes, of which the first is shown"]);
}

#[test]
fn parts_that_are_not_used_may_have_any_form() {
    let odd = r#"{"animations": [{"channels": [{"sampler": 0, "target": {"path": "pointer"}}], "samplers": []}],
"skins": [{"joints": [], "name": 7}], "extras": 0.5, "#;
    let file =
        read(&triangle().replacen('{', odd, 1).replace(r#""mesh": 0"#, r#""mesh": 0, "name": 7"#)).unwrap();
    assert_eq!(file.mesh, read(&triangle()).unwrap().mesh);
    assert_eq!(file.notes, ["1 animation is left out: objects stay where the file places them"]);
}

#[test]
fn a_directional_light_shines_in_the_same_direction_wherever_its_node_stands() {
    let light =
        r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 2}]}}, "#;
    let text = triangle()
        .replacen('{', light, 1)
        .replace(r#"{"mesh": 0,"#, r#"{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}},"#);
    for translation in ["[0, 0, 5]", "[3, -4, 0]"] {
        let lights = read(&text.replace("[0, 0, 5]", translation)).unwrap().lights;
        assert_eq!(lights, [FileLight::direction(DVec3::NEG_Z, DVec3::splat(2.0))], "{translation}");
    }
}

#[test]
fn a_light_of_a_hidden_node_is_used_with_a_note() {
    let lights = r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}, "#;
    let node = r#"{"mesh": 0, "extensions": {"KHR_node_visibility": {"visible": false}, "KHR_lights_punctual": {"light": 0}},"#;
    let file = read(&triangle().replacen('{', lights, 1).replace(r#"{"mesh": 0,"#, node)).unwrap();
    assert_eq!(file.light_notes, ["1 light, hidden by KHR_node_visibility, is used nevertheless"]);
}

#[test]
fn a_light_with_a_range_and_a_glossy_surface_are_noted() {
    let light = r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "range": 2}]}},
"materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.2}}], "#;
    let text = triangle()
        .replacen('{', light, 1)
        .replace(r#""indices": 1"#, r#""indices": 1, "material": 0"#)
        .replace(r#"{"mesh": 0,"#, r#"{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}},"#);
    let file = read(&text).unwrap();
    assert_eq!(file.light_notes, ["1 light with a range is shown without it"]);
    let note = "1 material asks for gloss (roughnessFactor), which raycl does not support";
    assert!(file.notes.len() == 1 && file.notes[0].starts_with(note), "{:?}", file.notes);
}

#[test]
fn damaged_files_are_refused_with_what_is_wrong() {
    for (from, to, message) in [
        ("\"mesh\": 0", "\"mesh\": 7", "node 0: mesh 7 does not exist"),
        ("\"POSITION\": 0", "\"POSITION\": 9", "accessor 9: it does not exist"),
        (
            "\"count\": 3, \"type\": \"VEC3\"",
            "\"count\": 4000000000, \"type\": \"VEC3\"",
            "its buffer view holds 3",
        ),
        (
            "\"count\": 3, \"type\": \"VEC3\"",
            "\"count\": 2, \"type\": \"VEC3\"",
            "no triangle remains; 1 triangle with a position that does not exist is left out",
        ),
        ("\"type\": \"VEC3\"", "\"type\": \"VEC2\"", "have 2 numbers; expected 3"),
        ("\"componentType\": 5126", "\"componentType\": 5125", "accessor 0: its componentType is 5125"),
        ("\"componentType\": 5123", "\"componentType\": 5126", "accessor 1: its componentType is 5126"),
        (
            "\"componentType\": 5123",
            "\"componentType\": 5122",
            "accessor 1: its componentType is 5122 (short)",
        ),
        (
            "\"componentType\": 5123",
            "\"componentType\": 5120",
            "accessor 1: its componentType is 5120 (byte)",
        ),
        (
            "\"scenes\"",
            "\"nodes\": [],\n\"scenes\"",
            "a.gltf:4: the key `nodes` occurs twice in the same object",
        ),
        ("\"buffer\": 0, \"byteLength\": 36", "\"buffer\": 3, \"byteLength\": 36", "buffer 3 does not exist"),
        ("\"byteOffset\": 36", "\"byteOffset\": 18446744073709551615", "its buffer view holds 0"),
        ("\"nodes\": [0]}", "\"nodes\": [0, 0]}", "node 0 occurs twice in the scene; expected once"),
        ("base64,", "base64,?", "buffer 0: it has damaged base64 ("),
        ("data:application/octet-stream;base64,", "http://x/", "nothing is downloaded"),
        ("data:application/octet-stream;base64,", "../../etc/passwd?", "buffer 0"),
        ("\"version\": \"2.0\"", "\"version\": \"1.0\"", "a.gltf"),
        ("\"scenes\"", "\"scenes", "a.gltf:2: not valid glTF 2.0: "),
    ] {
        let text = triangle().replacen(from, to, 1);
        let error = read(&text).err();
        let remedy = error.as_ref().map(|error| error.remedy().to_owned()).unwrap_or_default();
        let actual = error.map(|error| error.to_string()).unwrap_or_default();
        let is_twice = message.contains("occurs twice in the scene");
        assert_eq!(remedy.contains("at most one parent"), is_twice, "{actual}: {remedy}");
        let version = to.contains("1.0");
        assert!(version || actual.contains(message), "{from} -> {to}: {actual}");
    }
}

#[test]
fn a_buffer_may_be_a_file_beside_the_mesh() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a b.bin"), bytes()).unwrap();
    let data = format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes()));
    let reach = Reach { folder: folder.path(), permitted: PERMITTED };
    let parsed = |uri: &str| parse("a.gltf", reach, triangle().replace(&data, uri).as_bytes());
    assert_eq!(parsed("a%20b.bin").unwrap().mesh, read(&triangle()).unwrap().mesh);
    let error = parsed("c.bin").err().unwrap();
    let missing = error.to_string();
    assert!(missing.contains("buffer 0") && missing.contains("`c.bin`"), "{missing}");
    assert!(
        error.remedy().starts_with("put the files that a glTF file names into the folder of the glTF file"),
        "{missing}"
    );
}

#[test]
fn an_older_version_of_gltf_is_named() {
    for version in ["\"1.0\"", "1"] {
        let text = triangle().replace("\"2.0\"", version).replace("\"scenes\": [", "\"scenes\": [7, ");
        let error = read(&text).err().unwrap().to_string();
        let expected = format!("a.gltf: raycl does not read glTF of version `{}`", version.trim_matches('"'));
        assert!(error.starts_with(&expected), "{error}");
    }
    let tables = r#"{"accessors": {}, "meshes": {"a": {"primitives": []}}}"#;
    let error = read(tables).err().unwrap();
    assert!(error.to_string().starts_with("a.gltf: raycl does not read glTF of version `1.0`"), "{error}");
    assert!(error.remedy().contains("gltf-pipeline"), "{}", error.remedy());
}

#[test]
fn without_scenes_the_nodes_that_are_no_children_are_shown() {
    let nested = r#""nodes": [{"mesh": 0}, {"children": [0], "translation": [0, 0, 5]}]"#;
    let text = triangle().replace(r#""nodes": [{"mesh": 0, "translation": [0, 0, 5]}]"#, nested);
    let text = text.replace("\"scenes\": [{\"nodes\": [0]}],\n", "");
    assert_eq!(corners(&read(&text).unwrap().mesh), corners(&read(&triangle()).unwrap().mesh));
}

/// Node 0 has the triangle, and nodes 1 and 2 have cameras at x = 1 and x = 2.
#[test]
fn of_several_cameras_that_of_the_first_node_in_the_scenes_order_is_used() {
    let x_of_camera = |scenes: &str, fourth_node: &str| {
        let top = r#"{"cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}], "#;
        let camera = |x: u32| format!(r#"{{"camera": 0, "translation": [{x}, 0, 9]}}"#);
        let nodes = format!("[0, 0, 5]}}, {}, {}{fourth_node}", camera(1), camera(2));
        let text = triangle()
            .replacen('{', top, 1)
            .replace("[0, 0, 5]}", &nodes)
            .replace("\"scenes\": [{\"nodes\": [0]}],\n", scenes);
        read(&text).unwrap().camera.unwrap().position.x
    };
    let scene = |nodes: &str| format!("\"scenes\": [{{\"nodes\": {nodes}}}],\n");
    assert_eq!([scene("[0, 1, 2]"), scene("[2, 0, 1]")].map(|scene| x_of_camera(&scene, "")), [1.0, 2.0]);
    // Without scenes, the nodes without a parent are shown, in the file's order.
    assert_eq!(x_of_camera("", ""), 1.0);
    // The cameras are in children of node 3.
    assert_eq!(x_of_camera(&scene("[3]"), r#", {"children": [2, 0, 1]}"#), 2.0);
}

#[test]
fn a_rotation_of_length_zero_does_not_turn() {
    let text = triangle().replace(r#""translation""#, r#""rotation": [0, 0, 0, 0], "translation""#);
    assert_eq!(corners(&read(&text).unwrap().mesh), corners(&read(&triangle()).unwrap().mesh));
    let rotated = |rotation: &str| {
        let rotation = format!(r#""rotation": [{rotation}], "translation""#);
        corners(&read(&triangle().replace(r#""translation""#, &rotation)).unwrap().mesh)
    };
    // A quaternion of another length than 1 turns by the same angle.
    assert_eq!(rotated("0, 0, 3, 3"), rotated("0, 0, 0.7071067811865476, 0.7071067811865476"));
}

#[test]
fn parts_that_are_left_out_are_noted() {
    let noted = |from: &str, to: &str| read(&triangle().replace(from, to)).unwrap().notes;
    let indices = r#""indices": 1"#;
    let targets = noted(indices, r#""indices": 1, "targets": [{}]"#);
    assert_eq!(targets, ["1 primitive with morph targets is shown without them"]);
    assert_eq!(noted(indices, r#""indices": 1, "targets": []"#), [""; 0]);
    let colours = noted(r#""attributes": {"#, r#""attributes": {"COLOR_1": 0, "#);
    assert_eq!(colours, ["1 primitive with colours other than COLOR_0 is shown without these colours"]);
    let lines = noted(r#""primitives": ["#, r#""primitives": [{"attributes": {"POSITION": 0}, "mode": 1}, "#);
    assert_eq!(lines, ["1 primitive of lines or points is left out"]);
    let material = r#""materials": [{"normalTexture": {"index": 0}, "occlusionTexture": {"index": 0},
"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}], "scenes""#;
    let text = triangle().replace(indices, r#""indices": 1, "material": 0"#).replace(r#""scenes""#, material);
    let notes = read(&text).unwrap().notes.join("\n");
    for name in ["normalTexture", "occlusionTexture", "metallicRoughnessTexture"] {
        assert!(notes.contains(name), "{name}: {notes}");
    }
}

/// Reads the file of [`triangle`] with further keys at its top, and with a second node.
fn with_node(top: &str, node: &str) -> MeshFile {
    let text = triangle()
        .replacen('{', &format!("{{{top}, "), 1)
        .replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#)
        .replace("[0, 0, 5]}", &format!("[0, 0, 5]}}, {{{node}}}"));
    read(&text).unwrap()
}

#[test]
fn a_camera_whose_values_are_not_valid_is_noted() {
    let with = |kind: &str, yfov: &str, scale: &str| {
        let lens = format!(r#""perspective": {{"yfov": {yfov}, "znear": 0.1}}"#);
        let camera = format!(r#""cameras": [{{"type": "{kind}", {lens}}}]"#);
        let file = with_node(&camera, &format!(r#""camera": 0, "scale": {scale}"#));
        (file.camera.is_some(), file.camera_notes, file.notes)
    };
    // The triangle lies at the camera's side or in its plane.
    let unseen =
        "the file's camera sees no part of the mesh: --azimuth 31 uses raycl's own camera instead".to_owned();
    assert_eq!(with("perspective", "1", "[1, 1, 1]"), (true, vec![unseen.clone()], Vec::new()));
    // The numbers are in radians: 3.1415 is 179.995 degrees, and 1.7e-5 is 0.00097 degrees.
    for yfov in ["3.5", "3.1415", "0.000017", "0", "-1"] {
        let note = format!(
            "the camera's yfov of {yfov} radians is not between 0.001 and 179.99 degrees: raycl uses 45 degrees instead"
        );
        let expected = (true, vec![note, unseen.clone()], Vec::new());
        assert_eq!(with("perspective", yfov, "[1, 1, 1]"), expected, "{yfov}");
    }
    for scale in ["[0, 0, 0]", "[1, 1, 0]", "[1, 0, 1]"] {
        let (is_used, _, notes) = with("perspective", "1", scale);
        let note = "1 camera without a viewing direction is left out: the scales of nodes must not be 0";
        assert!(!is_used && notes == [note], "{scale}: {notes:?}");
    }
    for (kind, note) in [
        ("fisheye", "1 camera of an unknown type or without the values of its type is not used"),
        ("orthographic", "1 orthographic camera is not used: all views are in perspective"),
    ] {
        assert_eq!(with(kind, "1", "[1, 1, 1]"), (false, Vec::new(), vec![note.to_owned()]), "{kind}");
    }
}

#[test]
fn a_camera_outside_the_shown_scene_is_noted() {
    let camera = r#"{"cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}], "#;
    let text = triangle().replacen('{', camera, 1).replace("[0, 0, 5]}", r#"[0, 0, 5]}, {"camera": 0}"#);
    let file = read(&text).unwrap();
    assert!(file.camera.is_none());
    assert_eq!(file.notes, ["1 camera without a place in the shown scene is not used"]);
    let shown = read(&text.replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#)).unwrap();
    assert!(shown.camera.is_some() && shown.notes.is_empty(), "{:?}", shown.notes);
}

#[test]
fn the_version_and_the_length_of_a_file_are_noted_if_they_are_not_those_that_are_read() {
    let notes = read(&triangle().replace(r#""version": "2.0""#, r#""version": "1.0""#)).unwrap().notes;
    assert_eq!(notes, ["the file asks for version `1.0` of glTF, but is read as version 2.0"]);
    let mut json = triangle().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = (json.len() as u32).to_le_bytes();
    let glb = [b"glTF\x02\0\0\0\0\0\0\0", &length[..], b"JSON", &json].concat();
    let reach = Reach { folder: Path::new(""), permitted: PERMITTED };
    let notes = parse("a.glb", reach, &glb).unwrap().notes;
    assert!(notes.len() == 1 && notes[0].starts_with("the file's header states 0 bytes, but "), "{notes:?}");
}

#[test]
fn a_light_of_an_unknown_type_is_noted() {
    let lights = r#""extensions": {"KHR_lights_punctual": {"lights": [{"type": "area", "intensity": 3}]}}"#;
    let file = with_node(lights, r#""extensions": {"KHR_lights_punctual": {"light": 0}}"#);
    let note = "1 light of an unknown type is shown as a point light; expected directional, point or spot";
    assert_eq!((file.lights.len(), file.light_notes), (1, vec![note.to_owned()]));
}

#[test]
fn a_default_scene_that_does_not_exist_is_noted() {
    let scenes = r#""scenes": [{"nodes": [0]}]"#;
    for (to, note) in [
        (
            r#""scene": 5, "scenes": [{"nodes": [0]}]"#,
            "scene 5, counted from 0, but the file has 1 scene: the first is",
        ),
        (r#""scene": 0"#, "scene 0, counted from 0, but the file has 0 scenes: all nodes are"),
    ] {
        let file = read(&triangle().replacen(scenes, to, 1)).unwrap();
        assert_eq!(file.notes, [format!("the file's default is {note} shown")]);
        assert_eq!(file.mesh.triangles.len(), 1);
    }
    assert_eq!(
        read(&triangle().replacen(scenes, &format!("\"scene\": 0, {scenes}"), 1)).unwrap().notes,
        [""; 0]
    );
}

/// Returns the file of [`triangle`] with a fourth index, 1.
fn four_indices() -> String {
    triangle()
        .replace(r#""count": 3, "type": "SCALAR""#, r#""count": 4, "type": "SCALAR""#)
        .replace(&STANDARD.encode(bytes()), &STANDARD.encode([&bytes()[..], &[1, 0]].concat()))
        .replace(r#""byteLength": 42"#, r#""byteLength": 44"#)
        .replace(r#""byteLength": 6"#, r#""byteLength": 8"#)
}

#[test]
fn corners_after_the_last_whole_triangle_are_noted() {
    let file = read(&four_indices()).unwrap();
    assert_eq!(file.mesh.triangles.len(), 1);
    assert_eq!(file.notes, ["1 corner after the last whole triangle is left out"]);
}

#[test]
fn a_vertex_of_several_flat_triangles_is_counted_once_and_its_colour_limited() {
    // The first two colours are black. The third vertex belongs to both triangles.
    let with = |third: [f32; 3]| {
        let data = [&bytes()[..], &[1, 0], &[0; 24], &third.map(f32::to_le_bytes).concat()].concat();
        let view = r#"{"buffer": 0, "byteOffset": 44, "byteLength": 36}"#;
        let accessor = r#"{"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"}"#;
        let text = four_indices()
            .replace(&STANDARD.encode([&bytes()[..], &[1, 0]].concat()), &STANDARD.encode(data))
            .replace(r#""byteLength": 44"#, r#""byteLength": 80"#)
            .replace(r#""byteLength": 8}"#, &format!(r#""byteLength": 8}}, {view}"#))
            .replace(r#""indices": 1"#, r#""indices": 1, "mode": 5"#)
            .replace(r#"{"POSITION": 0}"#, r#"{"POSITION": 0, "COLOR_0": 2}"#)
            .replace(r#""type": "SCALAR"}"#, &format!(r#""type": "SCALAR"}}, {accessor}"#));
        read(&text).unwrap()
    };
    let file = with([1.0, 0.5, 0.0]);
    assert_eq!(file.mesh.triangles.len(), 2);
    assert_eq!(file.notes, [""; 0]);
    let outside = "1 vertex with a colour outside 0 to 1 is shown with channels limited to this range";
    assert_eq!(with([2.0, 0.5, 0.0]).notes, [outside]);
}

#[test]
fn a_position_that_is_not_valid_is_named_by_its_node_and_mesh() {
    let second = r#""translation": [0, 0, 5]}, {"mesh": 0, "translation": [0, 1e13, 0]}"#;
    let text = triangle().replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#);
    let text = text.replace(r#""translation": [0, 0, 5]}"#, second);
    let start = "a.gltf: node 1: a vertex of mesh 0 is ";
    for (quotes, what) in [(true, "at [0, 10000000000000, 0]"), (false, "not valid")] {
        let reach = Reach { folder: Path::new("/nowhere"), permitted: Permitted { quotes, ..PERMITTED } };
        let error = parse("a.gltf", reach, text.as_bytes()).err().unwrap().to_string();
        let expected = format!("{start}{what}; expected finite coordinates within +-1e12");
        assert_eq!(error, expected);
    }
}

#[test]
fn nodes_that_enlarge_a_mesh_beyond_all_numbers_are_refused() {
    // The mesh is in nine nodes, each of which makes it 1e38 times as large.
    let nodes: String =
        (1..=9).map(|child| format!(r#"{{"scale": [1e38, 1e38, 1e38], "children": [{child}]}}, "#)).collect();
    let text = triangle().replace(r#""nodes": [{"mesh": 0"#, &format!(r#""nodes": [{nodes}{{"mesh": 0"#));
    let error = read(&text).err().unwrap().to_string();
    assert!(error.contains("node 8 has a transform that is not finite"), "{error}");
}
