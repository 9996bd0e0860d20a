//! Tests of textures, their coordinates and their samplers.

use super::*;
use crate::scene::INPUTS;

/// Returns a picture of one texel, which is white with an alpha of 0.7.
fn png() -> Vec<u8> {
    white(178)
}

/// Returns a picture of one white texel.
fn white(alpha: u8) -> Vec<u8> {
    let mut png = Vec::new();
    let picture = image::RgbaImage::from_pixel(1, 1, image::Rgba([255, 255, 255, alpha]));
    picture.write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    png
}

/// Returns the file of [`triangle`] with a material and with texture coordinates. The texture coordinates are
/// the first six of the positions' nine numbers. Texture 0 is the picture of [`png`].
fn textured(material: &str) -> String {
    let png = STANDARD.encode(png());
    let lists = format!(
        r#"{{"materials": [{material}],
"textures": [{{"source": 0}}], "images": [{{"uri": "data:image/png;base64,{png}"}}], "#
    );
    triangle()
        .replace(
            r#"{"POSITION": 0}, "indices": 1"#,
            r#"{"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0"#,
        )
        .replace(
            r#""type": "SCALAR"}"#,
            r#""type": "SCALAR"}, {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"}"#,
        )
        .replacen('{', &lists, 1)
}

#[test]
fn a_mask_has_holes_where_its_alpha_times_the_materials_is_below_the_cutoff() {
    // A cutoff that is not given is 0.5.
    for (factor, cutoff, has_holes) in [
        (0.8, r#""alphaCutoff": 0.5,"#, false),
        (0.6, r#""alphaCutoff": 0.5,"#, true),
        (0.8, "", false),
        (0.6, "", true),
        (0.8, r#""alphaCutoff": 0.6,"#, true),
    ] {
        let material = format!(
            r#"{{"alphaMode": "MASK", {cutoff} "pbrMetallicRoughness":
{{"baseColorFactor": [1, 1, 1, {factor}], "baseColorTexture": {{"index": 0}}}}}}"#
        );
        let file = read(&textured(&material)).unwrap();
        assert_eq!(file.mesh.textures.list.len(), 1, "{:?}", file.notes);
        assert_eq!(file.mesh.textures.have_holes(), has_holes, "{factor} {cutoff}");
    }
}

#[test]
fn a_picture_may_lie_in_a_buffer_behind_other_data() {
    let text = textured(r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#);
    let image = format!(r#"{{"uri": "data:image/png;base64,{}"}}"#, STANDARD.encode(png()));
    let view = r#"{"buffer": 0, "byteOffset": 36, "byteLength": 6}"#;
    let views = format!(r#"{view}, {{"buffer": 0, "byteOffset": 42, "byteLength": {}}}"#, png().len());
    let behind = text
        .replace(&image, r#"{"bufferView": 2, "mimeType": "image/png"}"#)
        .replace(&STANDARD.encode(bytes()), &STANDARD.encode([bytes(), png()].concat()))
        .replace(r#""byteLength": 42"#, &format!("\"byteLength\": {}", 42 + png().len()))
        .replace(view, &views);
    assert!(!behind.contains("data:image/png"), "{behind}");
    let (file, expected) = (read(&behind).unwrap(), read(&text).unwrap());
    assert_eq!((&file.mesh.textures, &file.notes), (&expected.mesh.textures, &expected.notes));
    assert_eq!(file.mesh.textures.list[0].texels[..], [0xb2ff_ffff]);
}

#[test]
fn corners_of_a_mirrored_triangle_keep_their_texture_coordinates() {
    let text = textured(r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#);
    let mesh = read(&text.replace(r#"{"mesh": 0,"#, r#"{"mesh": 0, "scale": [-1, 1, 1],"#)).unwrap().mesh;
    // The node mirrors the triangle, so its second and third corner change places.
    assert_eq!(corners(&mesh), [Vec3::Z * 5.0, Vec3::new(0.0, 1.0, 5.0), Vec3::new(-1.0, 0.0, 5.0)]);
    assert_eq!(mesh.textures.mapped[0].corners, [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]);
}

#[test]
fn a_texture_coordinate_that_is_not_finite_counts_as_missing() {
    let text = textured(r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#);
    let with = |first: f32| {
        let floats = [first, 0.0, 1.0, 0.0, 0.0, 1.0].map(f32::to_le_bytes).concat();
        let data = [&bytes()[..], &[0, 0], &floats].concat();
        let view = r#"{"buffer": 0, "byteOffset": 36, "byteLength": 6}, {"buffer": 0, "byteOffset": 44, "byteLength": 24}"#;
        let text = text
            .replace(&STANDARD.encode(bytes()), &STANDARD.encode(data))
            .replace(r#"{"buffer": 0, "byteOffset": 36, "byteLength": 6}"#, view)
            .replace(r#""count": 3, "type": "VEC2""#, r#""count": 3, "type": "VEC2", "byteOffset": 0"#)
            .replace(
                r#"{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2""#,
                r#"{"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2""#,
            );
        read(&text).unwrap()
    };
    let whole = with(0.5);
    assert_eq!(whole.mesh.textures.mapped[0].corners, [[0.5, 0.0], [1.0, 0.0], [0.0, 1.0]]);
    for odd in [f32::NAN, f32::INFINITY] {
        let file = with(odd);
        assert_eq!(file.mesh.textures.mapped, []);
        let notes = file.notes.join("\n");
        for note in [
            "1 texture coordinate with a number that is not finite is ignored",
            "1 triangle has a texture but no texture",
        ] {
            assert!(notes.contains(note), "{notes}");
        }
    }
}

/// Returns a material whose texture has the KHR_texture_transform `transform`.
fn transformed(transform: &str) -> String {
    let extensions = format!(r#"{{"KHR_texture_transform": {{{transform}}}}}"#);
    format!(
        r#"{{"pbrMetallicRoughness": {{"metallicFactor": 0,
"baseColorTexture": {{"index": 0, "extensions": {extensions}}}}}}}"#
    )
}

#[test]
fn a_transform_far_away_places_a_picture_as_exactly_as_a_near_one() {
    let mapped = |offset: &str| {
        let material = transformed(&format!(r#""scale": [0.5, 0.25], "offset": {offset}"#));
        read(&textured(&material)).unwrap().mesh.textures.mapped
    };
    let near = mapped("[0.3, 0.7]");
    assert_eq!(near[0].corners, [[0.3, 0.7], [0.3, 0.95], [0.3, 0.7]]);
    assert_eq!(mapped("[1000000.3, -999999.3]"), near);
}

#[test]
fn stored_texture_coordinates_far_from_0_are_noted_unless_the_picture_is_clamped() {
    let notes = |transform: &str, sampler: &str| {
        let samplers = format!(r#""samplers": [{sampler}], "textures": [{{"source": 0, "sampler": 0}}]"#);
        let text = textured(&transformed(transform)).replace(r#""textures": [{"source": 0}]"#, &samplers);
        read(&text).unwrap().notes
    };
    let expected = "1 triangle with texture coordinates beyond +-4096 is shown with an inexact texture: in single \
         precision, such numbers have steps of at least 1/2048; expected numbers near 0";
    // The second coordinates of the triangle's corners are 0, 1 and 0.
    assert_eq!(notes(r#""scale": [1, -4097]"#, "{}"), [expected]);
    for (transform, sampler) in [
        (r#""scale": [4097, 4096]"#, "{}"),
        (r#""offset": [5000, 5000]"#, "{}"),
        (r#""scale": [1, 4097]"#, r#"{"wrapT": 33071}"#),
    ] {
        assert_eq!(notes(transform, sampler), [""; 0], "{transform} {sampler}");
    }
}

#[test]
fn a_sampler_says_how_a_texture_goes_on_in_each_direction() {
    use crate::scene::Wrap;
    let material = r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#;
    let wrap = |sampler: &str| {
        let text = textured(material).replace(
            r#""textures": [{"source": 0}]"#,
            &format!(r#""samplers": [{sampler}], "textures": [{{"source": 0, "sampler": 0}}]"#),
        );
        read(&text).unwrap().mesh.textures.list[0].wrap
    };
    assert_eq!(wrap(r#"{"wrapS": 33071, "wrapT": 33648}"#), [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(wrap(r#"{"wrapS": 33648, "wrapT": 10497}"#), [Wrap::Mirror, Wrap::Repeat]);
    assert_eq!(wrap("{}"), [Wrap::Repeat; 2]);
}

#[test]
fn a_sampler_that_asks_for_another_filter_or_does_not_exist_is_noted() {
    let material = r#"{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}"#;
    let notes = |filter: &str| {
        let samplers = format!(r#""samplers": [{{{filter}}}], "textures": [{{"source": 0, "sampler": 0}}]"#);
        read(&textured(material).replace(r#""textures": [{"source": 0}]"#, &samplers)).unwrap().notes
    };
    let expected = "1 material asks for options of textures (magFilter NEAREST), which raycl does not support: \
         they are ignored";
    assert_eq!(notes(r#""magFilter": 9728"#), [expected]);
    for (filter, option) in [
        (r#""magFilter": 1234"#, "unknown magFilter"),
        (r#""minFilter": 9728"#, "minFilter NEAREST"),
        (r#""minFilter": 9729"#, "minFilter LINEAR"),
        (r#""minFilter": 9984"#, "minFilter NEAREST_MIPMAP_NEAREST"),
        (r#""minFilter": 1"#, "unknown minFilter"),
    ] {
        assert_eq!(notes(filter), [expected.replace("magFilter NEAREST", option)], "{filter}");
    }
    for filter in
        [r#""magFilter": 9729"#, r#""minFilter": 9985"#, r#""minFilter": 9986"#, r#""minFilter": 9987"#]
    {
        assert_eq!(notes(filter), [""; 0], "{filter}");
    }
    let missing = r#""samplers": [{}], "textures": [{"source": 0, "sampler": 1}]"#;
    let missing = read(&textured(material).replace(r#""textures": [{"source": 0}]"#, missing)).unwrap().notes;
    assert_eq!(missing, [expected.replace("magFilter NEAREST", "a sampler that does not exist")]);
}

#[test]
fn an_unknown_wrap_mode_of_a_sampler_is_noted_and_the_picture_repeats() {
    let material = r#"{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}"#;
    for (key, valid) in [("wrapS", "wrapT"), ("wrapT", "wrapS")] {
        // 10496 was a wrap mode of older versions of OpenGL.
        let sampler = format!(r#""samplers": [{{"{key}": 10496, "{valid}": 10497}}]"#);
        let textures = format!(r#"{sampler}, "textures": [{{"source": 0, "sampler": 0}}]"#);
        let file = read(&textured(material).replace(r#""textures": [{"source": 0}]"#, &textures)).unwrap();
        let asked = format!("1 material asks for options of textures (unknown {key})");
        assert_eq!(file.notes, [format!("{asked}, which raycl does not support: they are ignored")]);
        assert_eq!(file.mesh.textures.list[0].wrap, [crate::scene::Wrap::Repeat; 2]);
    }
}

#[test]
fn a_picture_that_cannot_be_decoded_from_its_uri_is_noted_in_a_sentence() {
    let material = r#"{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}"#;
    for (uri, why) in [
        ("data:image/png,abc", "is a data: URI without base64"),
        ("data:image/png;base64,!AAA", "has damaged base64 (Invalid symbol 33, offset 0)"),
    ] {
        let whole = format!("data:image/png;base64,{}", STANDARD.encode(png()));
        let notes = read(&textured(material).replace(&whole, uri)).unwrap().notes;
        assert_eq!(notes, [format!("texture 0 {why}: its material's own colour is used")]);
        let masked = textured(&material.replacen('{', r#"{"alphaMode": "MASK", "#, 1)).replace(&whole, uri);
        let note = format!("texture 0 {why}: its material's own colour is used, without holes");
        assert_eq!(read(&masked).unwrap().notes, [note]);
    }
}

/// Two surfaces show the same picture. The opaque surface uses the picture as its colour texture. The masked
/// surface uses the picture both as its colour texture and as its mask.
#[test]
fn a_picture_has_the_same_mip_levels_in_the_file_and_beside_it() {
    let mut bytes = Cursor::new(Vec::new());
    let colours = [image::Rgba([0, 255, 0, 255]), image::Rgba([255, 0, 255, 0])];
    let picture = image::RgbaImage::from_fn(4, 4, |x, y| colours[(x + y) as usize % 2]);
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.png"), bytes.get_ref()).unwrap();
    let material = r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#;
    let masked = material.replacen('{', r#"{"alphaMode": "MASK", "#, 1);
    let textures = |materials: &str, uri: &str| {
        let whole = format!("data:image/png;base64,{}", STANDARD.encode(png()));
        let primitive = r#"{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}"#;
        let other = primitive.replace(r#""material": 0"#, r#""material": 1"#);
        let text =
            textured(materials).replace(&whole, uri).replace(primitive, &format!("{primitive}, {other}"));
        let reach = Reach { folder: folder.path(), permitted: PERMITTED };
        let mut textures = parse("a.gltf", reach, text.as_bytes()).unwrap().mesh.textures;
        textures.add_levels(&mut []);
        textures
    };
    let embedded = format!("data:image/png;base64,{}", STANDARD.encode(bytes.get_ref()));
    let two = format!("{material}, {masked}");
    let (inside, beside) = (textures(&two, &embedded), textures(&two, "a.png"));
    assert_eq!(inside, beside);
    assert!(inside.have_levels() && inside.have_holes());
    let opaque = textures(&format!("{material}, {material}"), "a.png");
    let texels = |textures: &crate::scene::Textures, triangle: usize| {
        textures.list[textures.mapped[triangle].texture.unwrap() as usize].texels.clone()
    };
    assert_eq!(texels(&inside, 0), texels(&opaque, 0), "a mask of another surface changes no colour");
    assert_ne!(texels(&inside, 1), texels(&inside, 0));
}

/// The alpha of the picture is 0.7.
#[test]
fn blending_makes_holes_where_a_point_or_of_a_faint_surface_its_texture_is_less_than_half_opaque() {
    let of = |factor: f32| {
        let material = format!(
            r#"{{"alphaMode": "BLEND", "pbrMetallicRoughness": {{"metallicFactor": 0,
"baseColorFactor": [1, 1, 1, {factor}], "baseColorTexture": {{"index": 0}}}}}}"#
        );
        let file = read(&textured(&material)).unwrap();
        (file.mesh.textures.have_holes(), file.notes.join("\n"))
    };
    // With a factor of alpha below 0.5, every point would be a hole, so raycl ignores a factor between 0 and
    // 0.5: the texture's alpha alone decides which points are holes.
    for (factor, expected) in [(0.8, false), (0.6, true), (0.2, false)] {
        let (has_holes, notes) = of(factor);
        assert_eq!(has_holes, expected, "{factor}");
        assert!(notes.contains("half opaque"), "{notes}");
    }
    let (has_holes, notes) = of(0.0);
    assert!(!has_holes && !notes.contains("half opaque"), "{notes}");
    assert!(notes.contains("(alphaMode BLEND)") && notes.contains("every surface is opaque"), "{notes}");
}

#[test]
fn blending_with_an_opaque_texture_is_noted_only_if_the_materials_own_alpha_is_below_1() {
    let notes = |factor: f32, alpha: u8| {
        let material = format!(
            r#"{{"alphaMode": "BLEND", "pbrMetallicRoughness": {{"metallicFactor": 0,
"baseColorFactor": [1, 1, 1, {factor}], "baseColorTexture": {{"index": 0}}}}}}"#
        );
        let text = textured(&material).replace(&STANDARD.encode(png()), &STANDARD.encode(white(alpha)));
        read(&text).unwrap().notes.concat()
    };
    assert_eq!(notes(1.0, 255), "");
    let opaque = "1 material asks for transparency (alphaMode BLEND), which raycl does not support: every surface is opaque";
    for factor in [0.3, 0.7] {
        assert_eq!(notes(factor, 255), opaque);
    }
    assert!(notes(1.0, 254).contains("half opaque"), "{}", notes(1.0, 254));
}

#[test]
fn the_texture_of_a_material_that_no_triangle_uses_is_neither_read_nor_noted() {
    let material = |texture: u32| {
        format!(
            r#"{{"pbrMetallicRoughness": {{"metallicFactor": 0, "baseColorTexture": {{"index": {texture}}}}}}}"#
        )
    };
    // The second texture has no picture.
    let text = textured(&format!("{}, {}", material(1), material(0)))
        .replace(r#""textures": [{"source": 0}]"#, r#""textures": [{"source": 0}, {}]"#);
    let read_with = |number: u32| {
        let file = read(&text.replace(r#""material": 0"#, &format!("\"material\": {number}"))).unwrap();
        (file.mesh.textures.list.len(), file.notes)
    };
    assert_eq!(read_with(1), (1, Vec::new()));
    let note = "texture 1 has no picture of a format that raycl reads: its material's own colour is used";
    assert_eq!(read_with(0), (0, vec![note.to_owned()]));
}

#[test]
fn of_many_textures_that_cannot_be_used_the_first_are_noted_and_the_others_counted() {
    let all = |of: fn(usize) -> String| (0..1_000).map(of).collect::<Vec<_>>().join(", ");
    let materials = all(|number| {
        format!(
            r#"{{"pbrMetallicRoughness": {{"metallicFactor": 0, "baseColorTexture": {{"index": {number}}}}}}}"#
        )
    });
    let primitives = all(|number| {
        format!(r#"{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 2}}, "indices": 1, "material": {number}}}"#)
    });
    let primitive = r#"{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}"#;
    let textures = format!(r#""textures": [{}]"#, all(|_| "{}".to_owned()));
    let text = textured(&materials)
        .replace(r#""textures": [{"source": 0}]"#, &textures)
        .replace(primitive, &primitives);
    let notes = read(&text).unwrap().notes;
    assert_eq!(notes.len(), 4, "{notes:?}");
    assert!(notes[2].starts_with("texture 2 has no picture of a format that raycl reads: "), "{notes:?}");
    assert_eq!(notes[3], "997 more textures cannot be used either");
}

#[test]
fn no_command_writes_to_the_path_of_a_picture_that_raycl_does_not_use() {
    let whole = format!("data:image/png;base64,{}", STANDARD.encode(png()));
    let text = textured(r#"{"normalTexture": {"index": 0}}"#).replace(&whole, "a%20normal.png");
    for exists in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let picture = folder.path().canonicalize().unwrap().join("a normal.png");
        if exists {
            std::fs::write(&picture, "not read").unwrap();
        }
        let reach = Reach { folder: folder.path(), permitted: PERMITTED };
        assert!(parse("a.gltf", reach, text.as_bytes()).unwrap().mesh.textures.list.is_empty());
        assert!(INPUTS.contains(&picture), "{exists}");
    }
}

#[test]
fn a_missing_picture_is_named_with_a_file_that_differs_only_in_upper_and_lower_case() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("wood.png"), png()).unwrap();
    let material = r#"{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}"#;
    let whole = format!("data:image/png;base64,{}", STANDARD.encode(png()));
    let text = textured(material).replace(&whole, "Wood.PNG");
    let notes = parse("a.gltf", Reach { folder: folder.path(), permitted: PERMITTED }, text.as_bytes())
        .unwrap()
        .notes;
    let expected = "), but there is a file `wood.png`: its material's own colour is used";
    assert!(notes.len() == 1 && notes[0].ends_with(expected), "{notes:?}");
}

#[test]
fn an_escape_in_the_name_of_a_picture_stands_for_its_character() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a b.png"), png()).unwrap();
    let text = textured(r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#);
    let whole = format!("data:image/png;base64,{}", STANDARD.encode(png()));
    let reach = Reach { folder: folder.path(), permitted: PERMITTED };
    let beside = parse("a.gltf", reach, text.replace(&whole, "a%20b.png").as_bytes()).unwrap();
    assert_eq!(beside.mesh.textures, read(&text).unwrap().mesh.textures);
}

#[test]
fn a_transform_may_choose_another_set_of_texture_coordinates_than_the_texture() {
    let second =
        r#""VEC2"}, {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 3, "type": "VEC2"}"#;
    let mapped = |texture: &str| {
        let material = format!(
            r#"{{"pbrMetallicRoughness": {{"metallicFactor": 0, "baseColorTexture": {{"index": 0{texture}}}}}}}"#
        );
        let text = textured(&material)
            .replace(r#""TEXCOORD_0": 2"#, r#""TEXCOORD_0": 2, "TEXCOORD_1": 3"#)
            .replace(r#""VEC2"}"#, second);
        read(&text).unwrap().mesh.textures.mapped
    };
    let [first, second] = ["", r#", "texCoord": 1"#].map(mapped);
    assert_ne!(first, second);
    let chosen = |own: &str, set: u32| {
        mapped(&format!(r#"{own}, "extensions": {{"KHR_texture_transform": {{"texCoord": {set}}}}}"#))
    };
    assert_eq!([chosen("", 1), chosen(r#", "texCoord": 1"#, 0)], [second, first]);
}

/// The last of the three pairs of texture coordinates is finite. In each of the first two pairs, one number
/// is not finite.
#[test]
fn pairs_of_coordinates_with_one_number_that_is_not_finite_are_counted() {
    let coordinates: [f32; 6] = [f32::NAN, 0.0, 0.0, f32::INFINITY, 1.0, 1.0];
    let data: Vec<u8> = coordinates.iter().flat_map(|value| value.to_le_bytes()).collect();
    let view = r#"{"buffer": 0, "byteOffset": 36, "byteLength": 6}"#;
    let views = format!(r#"{view}, {{"buffer": 0, "byteOffset": 42, "byteLength": 24}}"#);
    let own = r#"{"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"}"#;
    let text = textured(r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#)
        .replace(r#""byteLength": 42"#, r#""byteLength": 66"#)
        .replace(&STANDARD.encode(bytes()), &STANDARD.encode([bytes(), data].concat()))
        .replace(view, &views)
        .replace(r#"{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"}"#, own);
    let notes = read(&text).unwrap().notes;
    let expected = "2 texture coordinates with a number that is not finite are ignored";
    assert!(notes.iter().any(|note| note == expected), "{notes:?}");
}

#[test]
fn emitted_light_is_the_factor_times_its_strength_and_its_texture() {
    let with = |keys: &str, colour: &str| {
        let colour = format!(r#""pbrMetallicRoughness": {{"metallicFactor": 0{colour}}}"#);
        let file = read(&textured(&format!("{{{keys}, {colour}}}"))).unwrap();
        let material = *file.mesh.material(&file.mesh.triangles[0]);
        let (radiance, texture) = (material.emitted.to_array(), material.emission_texture);
        (radiance, texture, file.mesh.textures.list.len(), file.notes.join("\n"))
    };
    let (of, none) = (|keys: &str| with(keys, ""), String::new);
    let factor = r#""emissiveFactor": [0, 0.5, 1]"#;
    assert_eq!(of(factor), ([0.0, 0.5, 1.0], None, 0, none()));
    let strength = r#", "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}"#;
    assert_eq!(of(&format!("{factor}{strength}")).0, [0.0, 2.0, 4.0]);
    // An emissive texture is multiplied by `emissiveFactor`, which is 0 by default.
    let texture = r#""emissiveTexture": {"index": 0}"#;
    assert_eq!(of(texture), ([0.0; 3], None, 0, none()));
    let both = format!("{factor}, {texture}");
    assert_eq!(of(&both), ([0.0, 0.5, 1.0], Some(0), 1, none()));
    // The base-colour texture is the same picture as the emissive texture, with the same transform or with
    // another one.
    let colour =
        |transform: &str| with(&both, &format!(r#", "baseColorTexture": {{"index": 0{transform}}}"#));
    assert_eq!(colour(""), ([0.0, 0.5, 1.0], Some(0), 1, none()));
    let moved = colour(r#", "extensions": {"KHR_texture_transform": {"offset": [0.5, 0]}}"#);
    let note = "1 material asks for emitted light from a texture that is placed differently from the colour texture \
                (emissiveTexture), which raycl does not support: the surface emits no light, unless \
                the scene sets `emitted`";
    assert_eq!((moved.0, moved.1, moved.3.as_str()), ([0.0; 3], None, note));
    // A material whose emissive texture does not exist emits no light, although without an emissive texture it would.
    let note =
        "texture 1 does not exist: its material emits no light, unless the scene sets `emitted`".to_owned();
    assert_eq!(of(&both.replace(r#""index": 0"#, r#""index": 1"#)), ([0.0; 3], None, 0, note));
    let bright = of(r#""emissiveFactor": [2, 0, 0]"#);
    assert_eq!(bright.0, [1.0, 0.0, 0.0]);
    assert!(bright.3.contains("a colour outside 0 to 1 (emissiveFactor)"), "{}", bright.3);
}

#[test]
fn fallbacks_and_missing_pictures_are_noted_with_the_extensions_of_their_textures() {
    let material = |texture: u32| {
        let texture = format!(r#""baseColorTexture": {{"index": {texture}}}"#);
        format!(r#"{{"pbrMetallicRoughness": {{"metallicFactor": 0, {texture}}}}}"#)
    };
    let webp = r#""extensions": {"EXT_texture_webp": {"source": 0}, "EXT_odd": {}}"#;
    let text = textured(&format!("{}, {}", material(0), material(1))).replace(
        r#""textures": [{"source": 0}]"#,
        &format!(
            r#""extensionsUsed": ["EXT_texture_webp"], "textures": [{{"source": 0, {webp}}}, {{{webp}}}]"#
        ),
    );
    let read_with = |text: &str, number: u32| {
        let file = read(&text.replace(r#""material": 0"#, &format!("\"material\": {number}"))).unwrap();
        (file.mesh.textures.list.len(), file.notes)
    };
    let odd = "unsupported extensions are ignored: `EXT_odd` (2 times)".to_owned();
    let note = "1 texture uses its fallback picture instead of the one in `EXT_texture_webp`".to_owned();
    assert_eq!(read_with(&text, 0), (1, vec![note, odd.clone()]));
    let reach = Reach { folder: Path::new("/nowhere"), permitted: Permitted { quotes: false, ..PERMITTED } };
    let notes = parse("a.gltf", reach, text.as_bytes()).unwrap().notes;
    let note = "1 texture uses its fallback picture instead of the one in an extension";
    assert_eq!(notes, [note, "unsupported extensions are ignored"]);
    let note = "texture 1 has no picture of a format that raycl reads (its picture is in `EXT_texture_webp`): its \
                material's own colour is used";
    assert_eq!(read_with(&text, 1), (0, vec![note.to_owned(), odd]));
    // The other picture cannot be read, either.
    let damaged =
        text.replace(r#"[{"uri": "data:image/png;"#, r#"[{"uri": "data:;base64,QUJD"}, {"uri": ";"#);
    let (pictures, notes) = read_with(&damaged, 0);
    assert!(pictures == 0 && notes.len() == 2 && notes[0].starts_with("texture 0 "), "{notes:?}");
    assert_eq!(
        notes[1],
        "unsupported extensions are ignored: `EXT_odd` (2 times), `EXT_texture_webp` (2 times)"
    );
    // The extension of a texture that raycl does not use is named as every other extension.
    let plain = text.replace("baseColorTexture", "metallicRoughnessTexture");
    let note =
        "unsupported extensions are ignored: `EXT_odd` (2 times), `EXT_texture_webp` (2 times)".to_owned();
    assert!(read_with(&plain, 0).1.contains(&note), "{:?}", read_with(&plain, 0).1);
}

#[test]
fn fallbacks_of_several_textures_and_of_emitted_light_are_counted() {
    let notes = |materials: &str, textures: &str| {
        let second = r#""material": 0}, {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 1}"#;
        let text = textured(materials).replace(r#""material": 0}"#, second);
        read(&text.replace(r#"[{"source": 0}]"#, &format!("[{textures}]"))).unwrap().notes
    };
    let webp = r#""extensions": {"EXT_texture_webp": {"source": 0}}"#;
    let with_fallback = format!(r#"{{"source": 0, {webp}}}"#);
    let pbr = |texture: u32| {
        let texture = format!(r#""baseColorTexture": {{"index": {texture}}}"#);
        format!(r#""pbrMetallicRoughness": {{"metallicFactor": 0, {texture}}}"#)
    };
    let both = format!("{{{}}}, {{{}}}", pbr(0), pbr(1));
    let one = "1 texture uses its fallback picture instead of the one in `EXT_texture_webp`".to_owned();
    let noted = notes(&both, &format!("{with_fallback}, {{{webp}}}"));
    assert!(noted.contains(&one), "{noted:?}");
    let two = "2 textures use their fallback pictures instead of those in `EXT_texture_webp`".to_owned();
    let noted = notes(&both, &format!("{with_fallback}, {with_fallback}"));
    assert!(noted.contains(&two), "{noted:?}");
    let emitted = r#""emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}"#;
    let emissive = format!("{{{}, {emitted}}}, {{{}}}", pbr(1), pbr(1));
    let noted = notes(&emissive, &format!(r#"{with_fallback}, {{"source": 0}}"#));
    assert!(noted.contains(&one), "{noted:?}");
}
