//! Tests that a note names each part of a file that raycl ignores or replaces.

use super::*;

#[track_caller]
fn assert_noted(text: &str, expected: &[&str]) {
    assert_eq!(read(text).unwrap().notes, expected);
}

#[test]
fn the_last_row_of_a_matrix_is_not_used_even_below_other_nodes() {
    let nodes = r#""nodes": [{"children": [1], "translation": [0, 0, 5]},
{"mesh": 0, "matrix": [1,0,0,3, 0,1,0,0, 0,0,1,0, 0,0,0,0.5]}]"#;
    let file =
        read(&triangle().replace(r#""nodes": [{"mesh": 0, "translation": [0, 0, 5]}]"#, nodes)).unwrap();
    assert_eq!(corners(&file.mesh), corners(&read(&triangle()).unwrap().mesh));
    assert!(
        file.notes.len() == 1 && file.notes[0].contains("whose last row is not 0 0 0 1"),
        "{:?}",
        file.notes
    );
}

/// Node 0 has the triangle, node 1 is its own child, and node 2 is a child of node 1.
#[test]
fn nodes_below_themselves_are_refused_also_without_a_scene() {
    let nodes = r#""translation": [0, 0, 5]}, {"children": [2, 1]}, {"mesh": 0}"#;
    let text = triangle().replace(r#""translation": [0, 0, 5]}"#, nodes);
    assert_noted(&text, &["1 node with a mesh, outside the shown scene, is left out"]);
    let error = read(&text.replace("\"scenes\": [{\"nodes\": [0]}],\n", "")).err().unwrap().to_string();
    assert_eq!(error, "a.gltf: node 1 descends from a node that descends from itself");
}

#[test]
fn normalised_indices_are_read_as_whole_numbers_with_a_note() {
    let text =
        triangle().replace(r#""componentType": 5123,"#, r#""componentType": 5123, "normalized": true,"#);
    assert_noted(&text, &["1 primitive with normalised indices is shown as if they were not normalised"]);
    assert_eq!(read(&text).unwrap().mesh, read(&triangle()).unwrap().mesh);
}

#[test]
fn an_empty_list_beside_positions_is_refused() {
    for (attribute, what) in [("NORMAL", "normals"), ("COLOR_0", "colours")] {
        let empty =
            r#""type": "SCALAR"}, {"bufferView": 0, "componentType": 5126, "count": 0, "type": "VEC3"}"#;
        let text = triangle()
            .replace(r#"{"POSITION": 0}"#, &format!(r#"{{"POSITION": 0, "{attribute}": 2}}"#))
            .replace(r#""type": "SCALAR"}"#, empty);
        let error = read(&text).err().unwrap().to_string();
        assert!(error.contains(&format!("0 {what} for 3 positions")), "{error}");
    }
}

const LIGHT: &str = r#""extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional"}]}}"#;
const NAMED: &str = r#""extensions": {"KHR_lights_punctual": {"light": 0}}"#;

#[test]
fn a_light_without_a_direction_and_one_outside_the_scene_are_noted() {
    let file = with_node(LIGHT, &format!(r#"{NAMED}, "scale": [1, 1, 0]"#));
    let note = "1 directional light without a direction is shown as shining along -y: the scales of nodes must not be 0";
    assert_eq!(file.light_notes, [note]);
    assert_eq!(file.lights, [FileLight::direction(DVec3::NEG_Y, DVec3::ONE)]);
    let outside = triangle()
        .replacen('{', &format!("{{{LIGHT}, "), 1)
        .replace("[0, 0, 5]}", &format!("[0, 0, 5]}}, {{{NAMED}}}"));
    assert_noted(&outside, &["1 light without a place in the shown scene is not used"]);
}

/// Of two lights and two cameras, a node names one each.
#[test]
fn cameras_and_lights_that_no_node_names_are_noted() {
    let light = LIGHT.replace("[{", r#"[{"type": "point"}, {"#);
    let camera = r#"{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}"#;
    let top = format!(r#""cameras": [{camera}, {camera}], {light}"#);
    let file = with_node(&top, &format!(r#""camera": 1, {NAMED}"#));
    let notes =
        ["camera", "light"].map(|what| format!("1 {what} without a place in the shown scene is not used"));
    assert_eq!((file.notes, file.lights.len()), (notes.to_vec(), 1));
}

/// The second camera, which is not used, has a wrong field of view and a wrong znear.
#[test]
fn values_of_the_first_camera_only_are_noted() {
    let camera = |lens: &str| format!(r#"{{"type": "perspective", "perspective": {lens}}}"#);
    let [first, second] = [r#"{"yfov": 1, "znear": 0.1}"#, r#"{"yfov": 9, "znear": -1}"#].map(camera);
    let top = format!(r#""cameras": [{first}, {second}]"#);
    let node = r#""camera": 0, "translation": [0, 0, 9]}, {"camera": 1"#;
    let text = triangle()
        .replacen('{', &format!("{{{top}, "), 1)
        .replace(r#""nodes": [0]"#, r#""nodes": [0, 1, 2]"#)
        .replace("[0, 0, 5]}", &format!("[0, 0, 5]}}, {{{node}}}"));
    let file = read(&text).unwrap();
    assert_eq!(
        (file.camera_notes, file.notes),
        (vec!["of 2 cameras, the first is used".to_owned()], Vec::new())
    );
}

#[test]
fn the_ratio_of_a_camera_is_kept_and_a_znear_that_is_not_valid_is_noted() {
    let with = |lens: &str| {
        let lens = format!(r#"{{"yfov": 1, {lens}}}"#);
        let camera = format!(r#""cameras": [{{"type": "perspective", "perspective": {lens}}}]"#);
        let file = with_node(&camera, r#""camera": 0, "translation": [0, 0, 9]"#);
        assert_eq!(file.notes, [""; 0]);
        (file.camera.unwrap().z_near, file.camera_notes, file.camera_aspect)
    };
    assert_eq!(with(r#""znear": 0.1, "aspectRatio": 1.5"#), (0.1, Vec::new(), Some(1.5)));
    for (near, shown) in [("-5", "-5"), ("1e39", "inf")] {
        let note =
            format!("the camera's znear of {shown} is not a number of at least 0: raycl uses 0 instead");
        assert_eq!(with(&format!(r#""znear": {near}"#)), (0.0, vec![note], None), "{near}");
    }
    assert_eq!(with(r#""znear": 0"#), (0.0, Vec::new(), None));
}

#[test]
fn extensions_of_all_parts_are_noted_once_and_many_are_counted() {
    let node = triangle().replace(r#"{"mesh": 0,"#, r#"{"mesh": 0, "extensions": {"EXT_node": {}},"#);
    let note = "unsupported extensions are ignored: `EXT_node`";
    assert_noted(&node, &[note]);
    let listed = node.replacen('{', r#"{"extensionsUsed": ["EXT_node"], "#, 1);
    assert_noted(&listed, &[note]);
    let again = node.replace("[0, 0, 5]}", r#"[0, 0, 5]}, {"extensions": {"EXT_node": {}}}"#);
    assert_noted(&again, &[&format!("{note} (2 times)")]);
    let list = (0..12).map(|number| format!("\"E{number:02}\"")).collect::<Vec<_>>().join(", ");
    let many = triangle().replacen('{', &format!("{{\"extensionsUsed\": [{list}], "), 1);
    let listed = "`E00`, `E01`, `E02`, `E03`, `E04`, `E05`, `E06`, `E07`, and 4 more";
    assert_noted(&many, &[&format!("unsupported extensions are ignored: {listed}")]);
    // A note names an extension of a material only once, too.
    let material =
        r#"{"materials": [{"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {"EXT_a": {}}}], "#;
    let text =
        triangle().replacen('{', material, 1).replace(r#""indices": 1"#, r#""indices": 1, "material": 0"#);
    assert_noted(&text, &["unsupported extensions are ignored: `EXT_a`"]);
}

#[test]
fn attributes_with_unknown_names_are_noted() {
    let text = triangle().replace(r#"{"POSITION": 0}"#, r#"{"POSITION": 0, "COLOR": 0, "_COLOR": 0}"#);
    assert_noted(&text, &["1 attribute with a name that glTF does not define is ignored: `COLOR`"]);
}

#[test]
fn values_of_materials_that_are_limited_or_without_effect_are_noted() {
    let notes = |keys: &str| {
        let text = triangle().replacen('{', &format!("{{\"materials\": [{{{keys}}}], "), 1);
        read(&text.replace(r#""indices": 1"#, r#""indices": 1, "material": 0"#)).unwrap().notes.join("\n")
    };
    let pbr = |keys: &str| notes(&format!(r#""pbrMetallicRoughness": {{{keys}}}"#));
    let limited = |keys: &str| {
        format!(
            "a value outside its range ({keys}), which raycl does not support: it is limited to this range"
        )
    };
    let both = pbr(r#""metallicFactor": -1, "roughnessFactor": 3"#);
    assert_eq!(both, format!("1 material asks for {}", limited("metallicFactor 1, roughnessFactor 1")));
    let metal = pbr(r#""metallicFactor": 1, "roughnessFactor": 0.1"#);
    assert!(metal.contains("metal (metallicFactor)") && metal.contains("gloss (roughnessFactor)"), "{metal}");
    let alpha = |mode: &str| {
        let pbr = r#""pbrMetallicRoughness": {"metallicFactor": 0, "baseColorFactor": [1, 0, 0, 5]}"#;
        notes(&format!(r#""alphaMode": "{mode}", {pbr}"#))
    };
    assert_eq!(alpha("OPAQUE"), "");
    assert!(alpha("MASK").contains("a colour outside 0 to 1 (baseColorFactor)"), "{}", alpha("MASK"));
    let matt = r#""pbrMetallicRoughness": {"metallicFactor": 0}"#;
    let cutoff = notes(&format!(r#"{matt}, "alphaMode": "MASK", "alphaCutoff": -1"#));
    assert_eq!(cutoff, format!("1 material asks for {}", limited("alphaCutoff")));
    let extension =
        |name: &str, values: &str| notes(&format!(r#"{matt}, "extensions": {{"{name}": {values}}}"#));
    let bright = extension("KHR_materials_emissive_strength", r#"{"emissiveStrength": 2e6}"#);
    assert_eq!(bright, format!("1 material asks for {}", limited("emissiveStrength")));
    let ior = extension("KHR_materials_ior", r#"{"ior": 3}"#);
    assert!(ior.contains("asks for sheen") && ior.contains("(KHR_materials_ior)"), "{ior}");
    for name in ["KHR_materials_common", "KHR_materials_variants"] {
        let unknown = extension(name, "{}");
        let note = format!("unsupported extensions are ignored: `{name}`");
        assert!(unknown.contains(&note) && !unknown.contains("asks for sheen"), "{unknown}");
    }
}

/// The second node places the triangle at `x`, with sides of the length `scale`.
#[test]
fn a_mesh_that_single_precision_distorts_is_noted() {
    let notes = |x: u32, scale: f32| {
        let node =
            format!(r#"{{"mesh": 0, "translation": [{x}.3, 0.0, 0.0], "scale": [{scale}, {scale}, 1]}}"#);
        let text = triangle()
            .replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#)
            .replace("[0, 0, 5]}", &format!("[0, 0, 5]}}, {node}"));
        read(&text).unwrap().notes
    };
    let note = "1 node with a mesh, far from the origin, is shown with an inexact shape: positions are stored in \
                single precision";
    for (x, scale) in [(5_400_000, 0.4), (100_000_000, 0.4), (5_400_000, 4.1)] {
        assert_eq!(notes(x, scale), [note], "{x}");
    }
    for (x, scale) in [(400, 0.4), (5_400_000, 40.0), (100_000_000, 0.0)] {
        assert_eq!(notes(x, scale), [""; 0], "{x}");
    }
}

/// Two nodes place the same primitive, whose first corners are at `x` and `x + side`.
#[test]
fn positions_that_are_coarse_in_the_file_are_noted_once() {
    let notes = |x: f32, side: f32| {
        let positions = [[x, 0.0, 0.0], [x + side, 0.0, 0.0], [x, side, 0.0]];
        let positions = positions.as_flattened().iter().flat_map(|value| value.to_le_bytes());
        let data: Vec<u8> = positions.chain(bytes()[36..].iter().copied()).collect();
        let text = triangle()
            .replace(&STANDARD.encode(bytes()), &STANDARD.encode(data))
            .replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#)
            .replace("[0, 0, 5]}", r#"[0, 0, 5]}, {"mesh": 0}"#);
        read(&text).unwrap().notes
    };
    let note = "1 primitive with coarse positions is shown with triangles that may have inexact shapes: the file \
                stores positions in single precision, which is coarse for such large coordinates";
    assert!(notes(5_400_000.0, 2.5).contains(&note.to_owned()), "{:?}", notes(5_400_000.0, 2.5));
    for (x, side) in [(5_400_000.0, 25.0), (400.0, 2.5), (5_400_000.0, 3.0)] {
        assert!(notes(x, side).iter().all(|note| !note.contains("coarse")), "{x} {side}");
    }
}

/// A node moves the triangle by 1e13, or scales it so much that single precision could not store it.
#[test]
fn a_bare_file_may_lie_beyond_the_limit_of_coordinates() {
    let node = |transform: &str| triangle().replace(r#""translation": [0, 0, 5]"#, transform);
    let read = |text: &str, scaled| {
        let permitted = Permitted { scaled, ..PERMITTED };
        parse("a.gltf", Reach { folder: Path::new("/nowhere"), permitted }, text.as_bytes())
    };
    let far = node(r#""translation": [1e13, 0, 0]"#);
    let file = read(&far, true).unwrap();
    assert_eq!(file.placement.origin.x.floor(), 1e13);
    let [a, b, _] = corners(&file.mesh);
    let [near_a, near_b, _] = corners(&read(&triangle(), true).unwrap().mesh);
    assert_eq!(b - a, near_b - near_a);
    let error = "a.gltf: node 0: a vertex of mesh 0 is at ";
    assert!(super::read(&far).err().unwrap().to_string().starts_with(error));
    let huge = node(r#""scale": [1e50, 1e50, 1e50]"#);
    assert!(read(&huge, true).unwrap().placement.scale < 1e-49 && read(&huge, false).is_err());
    // This camera would be too far away if the mesh was scaled, and the mesh is too large if it is not scaled.
    let camera = r#""cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}], "#;
    let seen = node(r#""scale": [1e20, 1e20, 1e20]}, {"camera": 0, "translation": [0, 0, 1e35]"#)
        .replacen('{', &format!("{{{camera}"), 1)
        .replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#);
    assert!(read(&seen, true).err().unwrap().to_string().contains("within +-1e12"));
}

#[test]
fn buffers_and_views_of_other_lengths_than_their_data_are_noted() {
    let noted = |from: &str, to: &str, note: &str| {
        assert_noted(&triangle().replace(from, to), &[note]);
    };
    let short = "1 buffer with fewer bytes than byteLength states is read as it is";
    noted(r#""byteLength": 42"#, r#""byteLength": 43"#, short);
    let beyond = "1 buffer view with an end beyond the buffer is read as far as there are bytes";
    noted(r#""byteLength": 42"#, r#""byteLength": 41"#, beyond);
    noted(r#""byteLength": 6"#, r#""byteLength": 7"#, beyond);
}

#[test]
fn a_binary_part_that_no_buffer_uses_is_noted() {
    let json = triangle().into_bytes();
    let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
    let notes = |binary: &[u8]| {
        let contents = [&length(&json)[..], b"JSON", &json, &length(binary), b"BIN\0", binary].concat();
        let glb = [b"glTF\x02\0\0\0", &(12 + contents.len() as u32).to_le_bytes()[..], &contents].concat();
        parse("a.glb", Reach { folder: Path::new(""), permitted: PERMITTED }, &glb).unwrap().notes
    };
    assert_eq!(notes(b""), [""; 0]);
    assert_eq!(notes(b"abcd"), ["1 BIN chunk that no buffer uses is ignored"]);
    // The first buffer has 42 bytes, but they are not those of the binary part.
    assert_eq!(notes(&[0; 60]), ["1 BIN chunk that no buffer uses is ignored"]);
}

#[test]
fn a_mesh_that_several_nodes_place_is_noted_once() {
    let primitives = r#""primitives": [{"attributes": {"POSITION": 0}, "mode": 1}, {"attributes": {"POSITION": 0}, "mode": 9},
{"attributes": {}}, {"attributes": {"POSITION": 0, "NORMAL": 2}, "targets": [{}]}, "#;
    let empty = r#""type": "SCALAR"}, {"componentType": 5126, "count": 3, "type": "VEC3"}"#;
    let text = four_indices()
        .replace(r#""primitives": ["#, primitives)
        .replace(r#""type": "SCALAR"}"#, empty)
        .replace(r#""nodes": [0]"#, r#""nodes": [0, 1, 2]"#)
        .replace("[0, 0, 5]}", "[0, 0, 5]}, {\"mesh\": 0}, {\"mesh\": 0}");
    let notes = read(&text).unwrap().notes;
    let kinds = [
        "1 primitive with morph targets is shown without them",
        "1 primitive of lines or points is left out",
        "1 primitive of an unknown mode is left out",
        "1 primitive of triangles without positions is left out",
        "1 accessor without data is read as zeros",
        "1 corner after the last whole triangle is left out",
    ];
    assert_eq!(notes, kinds);
}

#[test]
fn meshes_outside_the_shown_scene_and_meshes_without_a_node_are_noted() {
    let outside = triangle().replace("[0, 0, 5]}", r#"[0, 0, 5]}, {"mesh": 0}"#);
    assert_noted(&outside, &["1 node with a mesh, outside the shown scene, is left out"]);
    let mesh = r#"{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}"#;
    let nowhere = triangle().replace(mesh, &format!("{mesh}, {mesh}, {mesh}"));
    assert_noted(&nowhere, &["2 meshes that no node names are left out"]);
}

#[test]
fn primitives_without_corners_and_meshes_without_primitives_are_noted() {
    let note = "1 primitive of triangles without corners is left out";
    let empty = r#""indices": 2}]}, {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1"#;
    let list = r#""type": "SCALAR"}, {"bufferView": 1, "componentType": 5123, "count": 0, "type": "SCALAR"}"#;
    let text = triangle().replace(r#""indices": 1"#, empty).replace(r#""type": "SCALAR"}"#, list);
    let both = |text: &str| {
        let text = text.replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#);
        text.replace("[0, 0, 5]}", "[0, 0, 5]}, {\"mesh\": 1}")
    };
    assert_noted(&both(&text), &[note]);
    let text = triangle().replace(r#""meshes": ["#, r#""meshes": [{"primitives": []}, "#);
    assert_noted(&both(&text), &["1 mesh without primitives is left out"]);
}

#[test]
fn a_sparse_accessor_that_replaces_an_element_twice_is_noted() {
    let sparse = |view: &str| {
        format!(
            r#""sparse": {{"count": 2, "indices": {{"bufferView": {view}, "componentType": 5123}}, "values": {{"bufferView": 0}}}},
"count": 3, "type": "VEC3""#
        )
    };
    let text = |indices: [u16; 2]| {
        let data = [bytes(), vec![0, 0], indices.map(u16::to_le_bytes).concat()].concat();
        let view = r#"{"buffer": 0, "byteOffset": 36, "byteLength": 6}"#;
        triangle()
            .replace(&STANDARD.encode(bytes()), &STANDARD.encode(data))
            .replace(r#""byteLength": 42"#, r#""byteLength": 48"#)
            .replace(view, &format!(r#"{view}, {{"buffer": 0, "byteOffset": 44, "byteLength": 4}}"#))
            .replace(r#""count": 3, "type": "VEC3""#, &sparse("2"))
    };
    assert_noted(&text([0, 2]), &[]);
    let note = "1 sparse accessor with an index that occurs twice is read with the index's last value";
    assert_noted(&text([2, 2]), &[note]);
}

#[test]
fn a_binary_part_that_is_longer_than_its_buffer_is_noted() {
    let notes = |length: usize| {
        let mut binary = bytes();
        binary.resize(length, 0);
        parse_binary(&[(b"BIN\0", &binary)]).unwrap().notes
    };
    assert_eq!(notes(45), [""; 0]);
    let note = "1 BIN chunk with more bytes than its buffer's byteLength states is used as far as buffer views reach";
    assert_eq!(notes(46), [note]);
}

/// As the standard requires, raycl ignores the lengths of a camera's axes, so a scale of the node causes no note.
#[test]
fn a_camera_with_a_skewed_transform_is_noted() {
    let camera = r#""cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]"#;
    let notes = |transform: &str| {
        let notes = with_node(camera, &format!(r#""camera": 0, {transform}"#)).camera_notes;
        notes.iter().any(|note| note == "the camera's transform has a skew, which the picture does not show")
    };
    assert!(!notes(r#""scale": [-3, 1, 0.1], "rotation": [0.5, 0.5, 0.5, 0.5]"#));
    assert!(notes(r#""matrix": [1,0,0,0, 0.1,1,0,0, 0,0,1,0, 0,0,0,1]"#));
}

#[test]
fn only_a_negative_scale_above_its_node_turns_a_camera() {
    let camera = r#""cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]"#;
    let directions = |node: &str| {
        let camera = with_node(camera, node).camera.unwrap();
        (camera.forward, camera.up)
    };
    let usual = directions(r#""camera": 0"#);
    for scale in ["1, 1, -1", "1, -2, 1", "-1, -1, -1", "-3, 1, 1"] {
        assert_eq!(directions(&format!(r#""camera": 0, "scale": [{scale}]"#)), usual, "{scale}");
    }
    let below = r#""scale": [1, 1, -1], "children": [2]}, {"camera": 0"#;
    assert_eq!(directions(below), (Vec3::Z, usual.1));
}

#[test]
fn required_extensions_that_no_part_has_are_named() {
    let required = |names: &str| {
        let keys = format!("{{\"extensionsUsed\": [{names}], \"extensionsRequired\": [{names}], ");
        read(&triangle().replacen('{', &keys, 1)).unwrap().notes
    };
    assert_eq!(required(r#""KHR_texture_transform", "KHR_materials_emissive_strength""#), [""; 0]);
    let note = "the file requires extensions that raycl does not support, so the picture may be wrong: \
                `KHR_materials_sheen`, `EXT_texture_webp`";
    assert_eq!(required(r#""KHR_materials_sheen", "EXT_texture_webp""#), [note]);
}

#[test]
fn extensions_in_places_where_they_have_no_meaning_are_noted() {
    let place = r#""indices": 1, "extensions": {"KHR_materials_unlit": {}, "KHR_texture_transform": {}}"#;
    let text = triangle().replace(r#""indices": 1"#, place);
    let note = "extensions in places where they have no meaning are ignored: `KHR_materials_unlit` in a primitive, \
                `KHR_texture_transform` in a primitive";
    assert_noted(&text, &[note]);
    let place = r#""extensions": {"EXT_mesh_gpu_instancing": {}}"#;
    let text = triangle().replace(
        r#""indices": 1}"#,
        &format!(r#""indices": 1, {place}}}, {{"attributes": {{"POSITION": 0}}, {place}}}"#),
    );
    let note = "extensions in places where they have no meaning are ignored: `EXT_mesh_gpu_instancing` in a primitive \
                (2 times)";
    assert_noted(&text, &[note]);
}

/// The second node either hides itself and its children, or does not. The last node is not in the scene.
#[test]
fn nodes_that_lose_instances_or_are_drawn_although_hidden_are_counted() {
    let visible = |value| format!(r#""extensions": {{"KHR_node_visibility": {{"visible": {value}}}}}"#);
    let instances = r#""extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}"#;
    let nodes = |hidden: &str| {
        let last = format!(r#"{{"mesh": 0, {}}}"#, visible("false"));
        let nodes = format!(
            r#"{{{hidden}, "children": [2, 3]}}, {{"mesh": 0, {instances}}}, {{{instances}}}, {last}"#
        );
        let required = r#"{"extensionsRequired": ["EXT_mesh_gpu_instancing"], "#;
        triangle()
            .replacen('{', required, 1)
            .replace(r#""nodes": [0]"#, r#""nodes": [0, 1]"#)
            .replace("[0, 0, 5]}", &format!("[0, 0, 5]}}, {nodes}"))
    };
    let outside = "1 node with a mesh, outside the shown scene, is left out";
    let instance =
        "1 node with a mesh and EXT_mesh_gpu_instancing is drawn without instances, only once per node";
    assert_noted(&nodes(&format!(r#""mesh": 0, {}"#, visible("true"))), &[outside, instance]);
    let hidden = "2 nodes with a mesh, hidden by KHR_node_visibility, are drawn nevertheless";
    assert_noted(&nodes(&format!(r#""mesh": 0, {}"#, visible("false"))), &[outside, instance, hidden]);
}

#[test]
fn the_indices_of_a_sparse_accessor_may_begin_within_their_view() {
    let sparse = r#""sparse": {"count": 2, "indices": {"bufferView": 2, "byteOffset": 2, "componentType": 5123},
"values": {"bufferView": 0}}, "count": 3, "type": "VEC3""#;
    let data = [bytes(), vec![0, 0], [0_u16, 0, 2].map(u16::to_le_bytes).concat()].concat();
    let view = r#"{"buffer": 0, "byteOffset": 36, "byteLength": 6}"#;
    let text = triangle()
        .replace(&STANDARD.encode(bytes()), &STANDARD.encode(data))
        .replace(r#""byteLength": 42"#, r#""byteLength": 50"#)
        .replace(view, &format!(r#"{view}, {{"buffer": 0, "byteOffset": 44, "byteLength": 6}}"#))
        .replace(r#""count": 3, "type": "VEC3""#, sparse);
    assert_noted(&text, &[]);
}

#[test]
fn a_mesh_without_primitives_that_several_nodes_place_is_noted_once() {
    let text = triangle()
        .replace(r#""meshes": ["#, r#""meshes": [{"primitives": []}, "#)
        .replace(r#""nodes": [0]"#, r#""nodes": [0, 1, 2]"#)
        .replace("[0, 0, 5]}", r#"[0, 0, 5]}, {"mesh": 0}, {"mesh": 1}"#);
    assert_noted(&text, &["1 mesh without primitives is left out"]);
}

#[test]
fn a_primitive_of_which_all_corners_are_left_out_is_not_without_corners() {
    let with = |primitive: &str, accessor: &str| {
        let accessor = format!(r#""type": "SCALAR"}}, {{{accessor}}}"#);
        let primitive = format!(r#""indices": 1}}, {{{primitive}}}"#);
        triangle().replace(r#""indices": 1}"#, &primitive).replace(r#""type": "SCALAR"}"#, &accessor)
    };
    let two = r#""bufferView": 1, "componentType": 5123, "count": 2, "type": "SCALAR""#;
    let text = with(r#""attributes": {"POSITION": 0}, "indices": 2"#, two);
    assert_noted(&text, &["2 corners after the last whole triangle are left out"]);
    let two = r#""bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3""#;
    let text = with(r#""attributes": {"POSITION": 2}, "indices": 1"#, two);
    assert_noted(&text, &["1 triangle with a position that does not exist is left out"]);
}

#[test]
fn a_skew_between_any_two_axes_of_a_camera_is_noted() {
    let camera = r#""cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]"#;
    for axes in ["1,0,0,0, -0.1,1,0,0, 0,0,1,0", "1,0,0,0, 0,1,0,0, 0.1,0,1,0", "1,0,0,0, 0,1,0,0, 0,0.1,1,0"]
    {
        let node = format!(r#""camera": 0, "matrix": [{axes}, 0,0,0,1]"#);
        let notes = with_node(camera, &node).camera_notes;
        assert!(notes.iter().any(|note| note.contains("has a skew")), "{axes}: {notes:?}");
    }
}
