//! Tests of scenes that are built from scene files and bare meshes.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::scene::{Scene, Setting, Shot, load_scene, load_scene_for, load_scene_named_in, load_scene_with};
use glam::Vec3;
use std::path::Path;
use toml::Value;

/// A glTF file with a triangle and with a camera in front of the triangle.
const SEEN: &str = r#"{"asset": {"version": "2.0"},
"scenes": [{"nodes": [0, 1]}],
"nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 5]}],
"cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
"buffers": [{"byteLength": 36, "uri":
"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
"bufferViews": [{"buffer": 0, "byteLength": 36}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
"min": [0, 0, 0], "max": [1, 1, 0]}]}"#;

#[test]
fn only_added_lights_turn_with_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let turns = |text: &str| {
        std::fs::write(&path, text).unwrap();
        load_scene_with(&path, &[]).unwrap().orbit.with_lights
    };
    assert!(turns(SEEN));
    let light =
        r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 2}]}}, "#;
    let lit = SEEN.replacen('{', light, 1);
    let at = r#"{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}"#;
    assert!(!turns(&lit.replace(r#"{"mesh": 0}"#, at)));
}

#[test]
fn a_scene_that_turns_faces_outwards_unless_the_eye_is_inside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let turns = Shot { turns: true, ..Shot::SQUARE };
    for (eye, sign) in [("[0, 0, 3]", 1.0), ("[0, 0, 0.1]", -1.0)] {
        let camera = format!("two_sided = true\ncamera = {{ position = {eye}, look_at = [0, 0, 0] }}\n");
        std::fs::write(&path, camera + "[[object]]\nshape = \"sphere\"\ntriangles = 500\n").unwrap();
        let loaded = load_scene_for(&path, &[], turns).unwrap();
        let mesh = &loaded.scene.mesh;
        let outwards = |triangle| {
            let normals = mesh.corner_normals(triangle);
            mesh.corners(triangle).iter().zip(normals).all(|(corner, normal)| sign * corner.dot(normal) > 0.0)
        };
        assert!(mesh.triangles.iter().all(outwards), "{eye}");
        assert!(!loaded.notes.iter().any(|note| note.contains("faces away")), "{:?}", loaded.notes);
    }
}

#[test]
fn a_surface_that_turns_is_noted_if_it_faces_away_at_first() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    // The triangle hides the sphere from the camera, and the triangle's normal points away from the camera.
    // The triangle is small, so the scene counts as a closed mesh, and raycl reverses no normals.
    let text = "two_sided = true\ncamera = { position = [0, 0, 3], look_at = [0, 0, 0] }\n\
        [[object]]\nshape = \"sphere\"\ntriangles = 500\n\
        [[object]]\nvertices = [[-0.3, -0.3, 2.9], [0, 0.6, 2.9], [0.3, -0.3, 2.9]]\nfaces = [[0, 1, 2]]\n";
    std::fs::write(&path, text).unwrap();
    let notes = |turns| load_scene_for(&path, &[], Shot { turns, ..Shot::SQUARE }).unwrap().notes;
    let says =
        |turns| notes(turns).iter().any(|note| note.ends_with("raycl reverses either all normals or none"));
    assert!(says(true) && !says(false), "{:?}", notes(true));
    // Without `two_sided`, the advice depends on whether the scene turns.
    std::fs::write(&path, text.replace("two_sided = true\n", "")).unwrap();
    let advises = |turns, words: &str| notes(turns).iter().any(|note| note.ends_with(words));
    assert!(advises(true, "--two-sided (two_sided = true) reverses either all normals or none"));
    assert!(advises(false, "--two-sided (two_sided = true) reverses the normals of this part"));
}

#[test]
fn an_open_surface_that_turns_is_lit_at_first_whatever_the_order_of_its_corners() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let turns = Shot { turns: true, ..Shot::SQUARE };
    // The first triangle is vertical, and the second one is horizontal.
    for (eye, third) in [("[0.3, 0.3, 3]", "[0, 1, 0]"), ("[0.3, 3, 0.4]", "[0, 0, 1]")] {
        for face in ["[0, 1, 2]", "[0, 2, 1]"] {
            let camera =
                format!("two_sided = true\ncamera = {{ position = {eye}, look_at = [0.3, 0.2, 0.2] }}\n");
            let object =
                format!("[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], {third}]\nfaces = [{face}]\n");
            std::fs::write(&path, camera + &object).unwrap();
            let loaded = load_scene_for(&path, &[], turns).unwrap();
            let mesh = &loaded.scene.mesh;
            let normal = mesh.corner_normals(&mesh.triangles[0])[0];
            assert!(normal.dot(loaded.scene.camera.position) > 0.0, "{eye}, {face}: {normal}");
            assert!(!loaded.notes.iter().any(|note| note.contains("faces away")), "{:?}", loaded.notes);
        }
    }
}

#[test]
fn a_note_on_a_mesh_with_a_long_path_says_what_is_wrong_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("a".repeat(200));
    std::fs::create_dir(&inner).unwrap();
    std::fs::write(folder.path().join("b.png"), "").unwrap();
    std::fs::write(inner.join("m.mtl"), "newmtl m\nmap_Kd ../b.png\n").unwrap();
    let text = "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    std::fs::write(inner.join("m.obj"), text).unwrap();
    let notes = load_scene_with(&inner.join("m.obj"), &[]).unwrap().notes;
    let expected = "texture `../b.png` lies outside the mesh's folder and is not read (to allow it, set ";
    assert!(notes.iter().any(|note| note.contains(expected)), "{notes:?}");
}

#[test]
fn a_mesh_emits_light_only_if_a_triangle_does() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("m.mtl"), "newmtl wall\nKd 1 1 1\nnewmtl lamp\nKe 1 1 1\n").unwrap();
    let path = folder.path().join("a.obj");
    for (material, emits) in [("wall", false), ("lamp", true)] {
        let text = format!("mtllib m.mtl\nusemtl {material}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        std::fs::write(&path, text).unwrap();
        let loaded = load_scene_with(&path, &[]).unwrap();
        let is_noted = loaded.notes.iter().any(|note| note.contains("surfaces that emit light do not"));
        assert_eq!((loaded.scene.mesh.is_emissive(), is_noted), (emits, emits), "{:?}", loaded.notes);
    }
}

#[test]
fn a_sky_replaces_the_lights_of_a_bare_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let zenith = ("sky.zenith".to_owned(), Value::Float(0.5));
    let scene = load_scene_with(&path, &[zenith]).unwrap().scene;
    assert!(scene.lights.is_empty() && scene.sky.is_some(), "{:?}", scene.lights);
    let shot = Shot { dressed: true, ..Shot::SQUARE };
    let loaded = load_scene_for(&path, &[Setting::new("sky.zenith", Value::Float(0.5))], shot).unwrap();
    assert!(!loaded.dressed && loaded.scene.lights.is_empty(), "{:?}", loaded.scene.lights);
    assert_eq!(loaded.scene.mesh.triangles.len(), 1, "no ground was added");
}

#[test]
fn the_camera_of_a_file_counts_unless_an_upward_direction_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, SEEN).unwrap();
    let camera = |values: &[(String, Value)]| load_scene_with(&path, values).unwrap().scene.camera;
    let of_file = camera(&[]);
    assert_eq!((of_file.position, of_file.up), (Vec3::Z * 5.0, Vec3::Y));
    let up = Value::Array([0, 0, 1].map(Value::Integer).to_vec());
    let framed = camera(&[("camera.up".to_owned(), up)]);
    assert!(framed.up.z > 0.9, "{}", framed.up);
}

#[test]
fn a_file_of_several_cameras_is_noted_only_if_one_of_them_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let [path, scene] = ["a.gltf", "a.toml"].map(|name| folder.path().join(name));
    let two = SEEN.replace("[0, 0, 5]}", r#"[0, 0, 5]}, {"camera": 0}"#);
    std::fs::write(&path, two.replace("[0, 1]", "[0, 1, 2]")).unwrap();
    let text = "[[light]]\nposition = [1, 3, 5]\npower = 60\n[[object]]\nmesh = \"a.gltf\"\n";
    std::fs::write(&scene, text).unwrap();
    let notes = |path: &Path, values: &[(String, Value)]| load_scene_with(path, values).unwrap().notes;
    let note = format!("{}: of 2 cameras, the first is used", path.display());
    assert_eq!(notes(&path, &[]), [note]);
    let up = Value::Array([0, 0, 1].map(Value::Integer).to_vec());
    for value in [("camera.up".to_owned(), up), ("camera.azimuth_degrees".to_owned(), Value::Float(90.0))] {
        assert_eq!(notes(&path, &[value]), [""; 0]);
    }
    let unused =
        format!("{}: this file's cameras and lights are not used, only those of the scene", path.display());
    assert!(notes(&scene, &[]).contains(&unused));
    assert!(!notes(&scene, &[]).iter().any(|note| note.contains("of 2 cameras")));
    // A file may have lights without having a camera.
    let light = r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "range": 2}]}}, "#;
    let at = r#""extensions": {"KHR_lights_punctual": {"light": 0}}"#;
    let cameras = r#""cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],"#;
    let lit = SEEN.replacen('{', light, 1).replace(cameras, "").replace(r#""camera": 0"#, at);
    std::fs::write(&path, lit).unwrap();
    let note = format!("{}: 1 light with a range is shown without it", path.display());
    let said = notes(&scene, &[]);
    assert!(said.contains(&unused) && !said.contains(&note), "{said:?}");
    let brightness =
        "the intensity of the file's light is not used: raycl sets the brightness at the mesh's centre";
    assert_eq!(notes(&path, &[]), [&note, brightness]);
    let position = Value::Array([1, 3, 1].map(Value::Integer).to_vec());
    let light = [("position", position), ("power", Value::Integer(10))];
    let light = light.map(|(key, value)| (format!("light.0.{key}"), value));
    assert_eq!(notes(&path, &light), [""; 0]);
    // A second object has the same mesh.
    std::fs::write(&scene, format!("{text}[[object]]\nmesh = \"a.gltf\"\n")).unwrap();
    assert_eq!(notes(&scene, &[]).iter().filter(|note| **note == unused).count(), 1);
}

/// No triangle has the first of the two materials.
#[test]
fn a_file_that_asks_for_light_on_both_sides_is_noted_in_a_scene_that_lights_only_fronts() {
    let folder = tempfile::tempdir().unwrap();
    let [mesh, scene] = ["a.gltf", "a.toml"].map(|name| folder.path().join(name));
    let materials = r#"{"materials": [{"doubleSided": true}, {"doubleSided": true}], "#;
    let used = SEEN.replace(r#"{"POSITION": 0}"#, r#"{"POSITION": 0}, "material": 1"#);
    std::fs::write(&mesh, used.replacen('{', materials, 1)).unwrap();
    let notes = |path: &Path| -> Vec<String> {
        let notes = load_scene_with(path, &[]).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("doubleSided")).collect()
    };
    let of_scene = |key: &str| {
        std::fs::write(&scene, format!("{key}[[object]]\nmesh = \"a.gltf\"\n")).unwrap();
        notes(&scene)
    };
    let said = of_scene("").concat();
    assert!(said.contains("a.gltf: 1 material asks for light on both sides (doubleSided), but "), "{said}");
    assert!(["two_sided = true\n", "two_sided = false\n"].into_iter().all(|key| of_scene(key).is_empty()));
    assert!(notes(&mesh).is_empty(), "both sides of a bare mesh are lit");
}

#[test]
fn a_camera_with_a_position_only_looks_at_the_middle_of_the_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n").unwrap();
    // The position of the camera is behind the triangle. If only the position were used, the camera would
    // look along -z, away from the triangle.
    let behind = Value::Array([1, 1, -5].map(Value::Integer).to_vec());
    let scene = load_scene_with(&path, &[("camera.position".to_owned(), behind)]).unwrap().scene;
    assert!(scene.camera.forward.distance(Vec3::Z) < 1e-6, "{}", scene.camera.forward);
}

#[test]
fn a_camera_that_is_placed_keeps_its_near_plane() {
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/teapot.toml");
    let near = ("camera.z_near".to_owned(), Value::Float(0.25));
    let position = (
        "camera.position".to_owned(),
        Value::Array(vec![Value::Float(0.0), Value::Float(1.0), Value::Float(9.0)]),
    );
    for values in [vec![near.clone()], vec![near, position]] {
        assert_eq!(load_scene_with(&scene, &values).unwrap().scene.camera.z_near, 0.25);
    }
}

#[test]
fn the_crease_of_an_object_counts_before_that_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    // The two faces of the roof meet at 90 degrees.
    let roof = "vertices = [[0, 0, -1], [0, 0, 1], [1, -1, 0], [-1, -1, 0]]\nfaces = [[0, 1, 2], [1, 0, 3]]";
    let sharp = Vec3::new(1.0, 1.0, 0.0).normalize();
    for (of_scene, own, expected) in [(100, 40, sharp), (40, 100, Vec3::Y)] {
        let text = format!("crease = {of_scene}\n[[object]]\n{roof}\ncrease = {own}\n");
        std::fs::write(&path, text).unwrap();
        let mesh = load_scene_with(&path, &[]).unwrap().scene.mesh;
        let at_ridge = mesh.corner_normals(&mesh.triangles[0])[0];
        assert!(at_ridge.distance(expected) < 1e-6, "{of_scene}, {own}: {at_ridge}");
    }
}

/// Authors of low-poly meshes give each face its own vertices, so that edges stay sharp.
#[test]
fn edges_that_become_smooth_since_vertices_are_joined_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let [mesh, scene] = ["a.obj", "a.toml"].map(|name| folder.path().join(name));
    let corners = "v 0 0 0\nv 0 1 0\nv -1 0 -1\nv 0 1 0\nv 0 0 0\nv 1 0 -1\n";
    std::fs::write(&mesh, format!("{corners}f 1 2 3\nf 4 5 6\n")).unwrap();
    let notes = |path: &Path| {
        let notes = load_scene_with(path, &[]).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("joined")).collect::<Vec<_>>()
    };
    let note = "2 vertices are joined with others at equal positions, so that edges are smooth; `crease = 40` keeps \
                edges sharp";
    let noted = vec![format!("{}: {note}", mesh.display())];
    for (before, after, expected) in [
        ("", "", noted),
        ("crease = 60\n", "", vec![]),
        ("", "crease = 60\n", vec![]),
        ("", "flat = true\n", vec![]),
    ] {
        std::fs::write(&scene, format!("{before}[[object]]\nmesh = \"a.obj\"\n{after}")).unwrap();
        assert_eq!(notes(&scene), expected, "{before}{after}");
    }
    assert_eq!(notes(&mesh), Vec::<String>::new());
}

#[test]
fn without_textures_a_surface_emits_only_the_light_that_its_object_states() {
    let folder = tempfile::tempdir().unwrap();
    let [path, scene] = ["a.obj", "a.toml"].map(|name| folder.path().join(name));
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    std::fs::write(folder.path().join("a.mtl"), "newmtl a\nKe 1\nmap_Ke dot.png\n").unwrap();
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    std::fs::write(path, format!("mtllib a.mtl\nusemtl a\n{corners}f 1/1 2/1 3/1\n")).unwrap();
    std::fs::write(&scene, "[[object]]\nmesh = \"a.obj\"\n").unwrap();
    let material = |settings: &[(&str, Value)]| {
        let settings: Vec<_> =
            settings.iter().map(|(path, value)| ((*path).to_owned(), value.clone())).collect();
        let mesh = load_scene_with(&scene, &settings).unwrap().scene.mesh;
        let material = mesh.material(&mesh.triangles[0]);
        (material.emitted, material.emission_texture)
    };
    let plain = ("textures", Value::Boolean(false));
    assert_eq!(material(&[]), (Vec3::splat(1.0 / 15.0), Some(0)));
    assert_eq!(material(std::slice::from_ref(&plain)), (Vec3::ZERO, None));
    let emitted = ("object.0.material.emitted", Value::Float(0.5));
    assert_eq!(material(&[plain, emitted]), (Vec3::splat(0.5), None));
}

#[test]
fn light_that_lights_nothing_is_noted_only_if_a_triangle_emits_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(folder.path().join("a.mtl"), "newmtl wall\nKd 1\nnewmtl lamp\nKd 1\nKe 1\n").unwrap();
    for (name, expected) in [("wall", false), ("lamp", true)] {
        let text = format!("mtllib a.mtl\nusemtl {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        std::fs::write(&path, text).unwrap();
        let notes = load_scene_with(&path, &[]).unwrap().notes;
        assert_eq!(notes.iter().any(|note| note.contains("emit light")), expected, "{name}: {notes:?}");
    }
}

#[test]
fn a_scene_without_any_light_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let object = "[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\n";
    let is_noted = |more: &str| {
        std::fs::write(&path, format!("{object}{more}")).unwrap();
        let notes = load_scene_with(&path, &[]).unwrap().notes;
        notes.iter().any(|note| note.contains("no light, so surfaces that emit no light are black"))
    };
    assert!(is_noted(""));
    assert!(!is_noted("[[light]]\nposition = [1, 3, 1]\npower = 10\n"));
    assert!(!is_noted("[sky]\nzenith = 1\n"));
    // The note names the last line of the scene file. With the settings, raycl formats the scene's text
    // again, but the note does not name the last line of this new text.
    std::fs::write(&path, object).unwrap();
    let settings = [("display.exposure".to_owned(), Value::Float(2.0))];
    let notes = load_scene_with(&path, &settings).unwrap().notes;
    let expected = format!("{}:3: no light, so surfaces that emit no light are black", path.display());
    assert!(notes.iter().any(|note| note.starts_with(&expected)), "{notes:?}");
    // A bare mesh has no line to which a light could be added.
    let mesh = folder.path().join("a.obj");
    std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let none = |key: &str| Setting {
        path: key.to_owned(),
        value: Value::Array(Vec::new()),
        origin: format!("--set {key}=[]"),
    };
    let notes = load_scene_for(&mesh, &[none("light")], Shot::SQUARE).unwrap().notes;
    let expected = "--set light=[]: no light, so surfaces that emit no light are black";
    assert!(notes.iter().any(|note| note == expected), "{notes:?}");
    let error = load_scene_for(&path, &[none("object")], Shot::SQUARE).unwrap_err();
    assert_eq!(error.to_string(), "--set object=[]: the scene has no triangles");
}

#[test]
fn a_scene_whose_lights_have_no_power_is_noted() {
    let is_noted = |text: &str| {
        let notes = loaded(text).unwrap().notes;
        notes.iter().any(|note| note.contains("power 0, so surfaces that emit no light are black"))
    };
    let dark = "[[light]]\nposition = [1, 3, 1]\npower = 0\n";
    assert!(is_noted(dark) && is_noted(&dark.repeat(2)));
    assert!(!is_noted(&format!("{dark}{}", dark.replace("power = 0", "power = [0, 1, 0]"))));
    assert!(!is_noted(&format!("{dark}[sky]\nzenith = 1\n")));
    let track = "[animation]\nframes = 2\n[[animation.track]]\npath = \"light.0.power\"\nvalues = [0, 9]\n";
    assert!(is_noted(&format!("{dark}{track}")), "a still picture shows the first frame");
    assert!(!is_noted(&format!("{dark}{}", track.replace("[0, 9]", "[9, 0]"))));
}

#[test]
fn smooth_shadows_that_change_nothing_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let is_noted = |value: bool, flat: bool| {
        let object = format!("[[object]]\nshape = \"sphere\"\ntriangles = 20\nflat = {flat}\n");
        std::fs::write(&path, format!("smooth_shadows = {value}\n{object}")).unwrap();
        let notes = load_scene_with(&path, &[]).unwrap().notes;
        notes.iter().any(|note| note.contains("smooth_shadows has no effect"))
    };
    assert!(is_noted(true, true) && !is_noted(true, false) && !is_noted(false, true));
}

#[test]
fn a_mesh_of_a_scene_whose_contents_differ_from_its_name_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("a.toml");
    let light = "[[light]]\nposition = [1, 3, 1]\npower = 10\n";
    for (name, expected) in [("a.stl", true), ("a.obj", false), ("a", false)] {
        std::fs::write(folder.path().join(name), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        std::fs::write(&scene, format!("{light}[[object]]\nmesh = \"{name}\"\n")).unwrap();
        let notes = load_scene_with(&scene, &[]).unwrap().notes;
        let note = format!("{name}: read as an OBJ mesh, because of its contents and despite its name");
        assert_eq!(notes.iter().any(|own| own.ends_with(&note)), expected, "{name}: {notes:?}");
    }
}

#[test]
fn a_face_names_corners_that_exist() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let outcome = |faces: &str| {
        let vertices = "vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]";
        std::fs::write(&path, format!("[[object]]\n{vertices}\nfaces = {faces}\n")).unwrap();
        load_scene_with(&path, &[]).map(drop).map_err(|error| error.to_string())
    };
    assert_eq!(outcome("[[0, 1, 2]]"), Ok(()));
    let beyond = outcome("[[0, 1, 2], [0, 1, 3]]").unwrap_err();
    assert!(beyond.contains("3 does not exist; expected 0 to 2"), "{beyond}");
    let few = outcome("[[0, 1]]").unwrap_err();
    assert!(few.contains("a face of 2 corners; expected three or more"), "{few}");
}

#[test]
fn a_scenes_name_is_not_empty() {
    for text in ["name = \"\"\n", "name = \" \"\n"] {
        assert_eq!(message_and_line(&format!("\n{text}")), ("the name is empty".to_owned(), 2), "{text}");
    }
    assert_eq!(loaded("name = \"mine\"\n").unwrap().scene.name, "mine");
    assert_eq!(loaded("").unwrap().scene.name, "a");
    // Lines of results contain the name, so a line break in the name could forge a line.
    assert_eq!(loaded("name = \"a\\nb\"\n").unwrap().scene.name, "a\\u000ab");
}

/// Each element of the list below has a valid setting, an invalid setting and a part of the expected error.
/// Invalid numbers lie outside the range that docs/scenes.md gives.
#[test]
fn numbers_out_of_their_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let outcome = |more: &str| {
        let object = "[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\n";
        std::fs::write(&path, format!("{more}\n{object}")).unwrap();
        load_scene_with(&path, &[]).map(drop).map_err(|error| error.to_string())
    };
    for (good, bad, expected) in [
        ("background = 1e28", "background = 2e28", "2e28 is not a number from 0 to 1e28"),
        ("background = [0, 1, 0]", "background = [0, -1, 0]", "from 0 to 1e28"),
        ("display.gamma = 1", "display.gamma = 0", "more than 0"),
        ("camera.elevation_degrees = -90", "camera.elevation_degrees = -91", "from -90 to 90 degrees"),
        ("camera.azimuth_degrees = 1e30", "camera.azimuth_degrees = 1e39", "a finite number"),
        ("camera.elevation_degrees = 90", "camera.elevation_degrees = 91", "from -90 to 90 degrees"),
        ("camera.fov_x_degrees = 179", "camera.fov_x_degrees = 180", "between 0.001 and 179.99 degrees"),
        ("camera.fov_y_degrees = 1", "camera.fov_y_degrees = 0", "between 0.001 and 179.99 degrees"),
        ("camera.z_near = 0", "camera.z_near = -1", "at least 0"),
        ("camera.position = [0, 0, 1]", "camera.position = 1", "three numbers [x, y, z]"),
        ("crease = 0", "crease = -1", "from 0 to 180 degrees"),
        ("crease = 180", "crease = 181", "from 0 to 180 degrees"),
        ("shadow_bias = 0", "shadow_bias = -1", "at least 0"),
        ("display.exposure = 0", "display.exposure = -1", "at least 0"),
        ("sky.zenith = 1e28", "sky.zenith = 2e28", "from 0 to 1e28"),
        ("sky = { zenith = 1, reach = 1 }", "sky = { zenith = 1, reach = 0 }", "more than 0"),
        ("background = \"#203040\"", "background = \"#20304\"", "neither a display colour"),
    ] {
        assert_eq!(outcome(good), Ok(()), "{good}");
        let error = outcome(bad).unwrap_err();
        assert!(error.contains(expected), "{bad}: {error}");
    }
}

#[test]
fn a_background_that_is_not_displayed_as_it_is_written_is_noted() {
    let note = |text: &str| {
        let notes = loaded(text).unwrap().notes;
        notes.into_iter().find(|note| note.contains("the background is displayed as #")).unwrap_or_default()
    };
    let black = note("background = \"white\"\ndisplay.exposure = 0\n");
    let start = "the background is displayed as #000000, not as #ffffff: with display.exposure = 0.0, display.gamma = 2.2 ";
    let rest = "and display.tone = \"clip\", no allowed radiance of a background is displayed as #ffffff";
    assert!(black.contains(&format!("{start}{rest}")), "{black}");
    // White would need a radiance of 1e30, which exceeds the limit for backgrounds. The dark grey #202020
    // would need a radiance that rounds to 0 in single precision.
    assert_ne!(note("background = \"white\"\ndisplay.exposure = 1e-30\n"), "");
    assert_ne!(note("background = \"#202020\"\ndisplay.gamma = 100\n"), "");
    for colour in ["#000000", "#203040", "#ffffff"] {
        assert_eq!(note(&format!("background = \"{colour}\"\n")), "", "{colour}");
        assert_eq!(note(&format!("background = \"{colour}\"\ndisplay.tone = \"filmic\"\n")), "", "{colour}");
    }
    assert_eq!(note("background = 0.5\ndisplay.exposure = 0\n"), "");
}

#[test]
fn a_coarse_round_mesh_has_smooth_shadows_in_the_default_look_alone() {
    let folder = tempfile::tempdir().unwrap();
    // An octahedron, with the normals of a sphere or without normals.
    let corners = ["1 0 0", "-1 0 0", "0 1 0", "0 -1 0", "0 0 1", "0 0 -1"];
    let faces = [[1, 3, 5], [3, 2, 5], [2, 4, 5], [4, 1, 5], [3, 1, 6], [2, 3, 6], [4, 2, 6], [1, 4, 6]];
    let of = |is_round: bool, dressed: bool, values: &[Setting]| {
        let mut text: String = corners.map(|corner| format!("v {corner}\nvn {corner}\n")).concat();
        for face in faces {
            let corner =
                |index: i32| if is_round { format!(" {index}//{index}") } else { format!(" {index}") };
            text += &format!("f{}\n", face.map(corner).concat());
        }
        let path = folder.path().join("a.obj");
        std::fs::write(&path, text).unwrap();
        load_scene_for(&path, values, Shot { dressed, ..Shot::SQUARE }).unwrap().scene.smooth_shadows
    };
    assert!(of(true, true, &[]));
    assert!(!of(true, false, &[]), "with --plain");
    assert!(!of(false, true, &[]), "flat facets");
    let set = |value| [Setting::new("smooth_shadows", Value::Boolean(value))];
    assert!(!of(true, true, &set(false)) && of(false, false, &set(true)));
    let scene = folder.path().join("a.toml");
    std::fs::write(&scene, "[[object]]\nobj = \"a.obj\"\n").unwrap();
    assert!(!load_scene(&scene).unwrap().scene.smooth_shadows, "a scene file has what it names");
}

#[test]
fn a_dressed_mesh_stands_on_a_ground_unless_its_background_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
        .unwrap();
    let shot = Shot { dressed: true, ..Shot::SQUARE };
    let load = |values: &[Setting]| {
        let loaded = load_scene_for(&path, values, shot).unwrap();
        assert!(loaded.dressed);
        (loaded.object_starts, loaded.scene.mesh.triangles.len())
    };
    // The ground is a square of two triangles, surrounded by three square frames of eight triangles each.
    assert_eq!(load(&[]), (vec![0, 4], 4 + 2 + 3 * 8));
    assert_eq!(load(&[Setting::new("background", Value::Float(0.5))]), (vec![0], 4));
}

#[test]
fn a_dressed_mesh_whose_backs_are_seen_has_a_note_although_its_ground_is_seen_from_the_front() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n")
        .unwrap();
    let shot = Shot { dressed: true, ..Shot::SQUARE };
    let averted = |values: &[Setting]| {
        let notes = load_scene_for(&path, values, shot).unwrap().notes;
        notes.into_iter().find(|note| note.contains("faces away"))
    };
    assert_eq!(averted(&[]), None);
    let note = averted(&[Setting::new("two_sided", Value::Boolean(false))]).unwrap();
    assert!(note.starts_with("100% of the visible surface (without the ground) faces away"), "{note}");
    assert!(note.contains("--two-sided"), "{note}");
}

#[test]
fn the_shadow_bias_is_a_ten_thousandth_of_the_diagonal_unless_it_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "v 7 0 0\nv 10 0 0\nv 7 4 0\nf 1 2 3\n").unwrap();
    let bias = |values: &[(String, Value)]| load_scene_with(&path, values).unwrap().scene.shadow_bias;
    assert!((bias(&[]) - 5e-4).abs() < 1e-9, "{}", bias(&[]));
    assert_eq!(bias(&[("shadow_bias".to_owned(), Value::Float(0.25))]), 0.25);
}

/// Near the origin, the default shadow bias must be, bit for bit, the bias with which the stored records were
/// measured.
#[test]
fn the_shadow_bias_exceeds_the_rounding_of_coordinates_unless_the_scene_moves_to_an_origin_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let bias = |surface: f32, eye: f32| {
        let object = "[[object]]\nvertices = [[0, 0, 0], [3, 0, 0], [0, 4, 0]]\nfaces = [[0, 1, 2]]\n";
        let camera = format!("[camera]\nposition = [{eye}, 1, 3]\n");
        std::fs::write(&path, format!("{camera}{object}translation = [{surface}, 0, 0]\n")).unwrap();
        load_scene_with(&path, &[]).unwrap().scene.shadow_bias
    };
    let usual = 1e-4 * 5.0_f32;
    let far = |coordinate: f32| 8.0 * f32::EPSILON * coordinate;
    // If the scene gets an origin of its own, this origin is the centre of the triangle, rounded.
    for (surface, eye, expected) in [
        (0.0, 0.0, usual),
        (-30.0, -30.0, usual),
        (-50_000.0, -50_000.0, usual),
        (0.0, 100_000.0, far(100_000.0)),
        (0.0, -100_000.0, far(100_000.0)),
        (-50_000.0, 100_000.0, far(149_999.0)),
    ] {
        assert_eq!(bias(surface, eye), expected, "{surface}, {eye}");
    }
}

/// Returns a scene file with a camera, a light, two triangles and a sphere, all of which are moved by
/// `offset`. The second triangle is turned and scaled about the file's origin.
fn scene_at(offset: [f64; 3]) -> String {
    let at =
        |position: [f64; 3]| format!("{:?}", std::array::from_fn::<_, 3, _>(|i| position[i] + offset[i]));
    let vertices = [[-1.0, -1.0, -5.0], [1.0, -1.0, -5.0], [0.0, 1.0, -5.0]].map(at).join(", ");
    // A rotation by 90 degrees about z turns (x, y) to (-y, x).
    let [x, y, z] = offset;
    let turned = [
        [y / 2.0, -x / 2.0, z / 2.0 - 2.0],
        [y / 2.0 + 0.25, -x / 2.0, z / 2.0 - 2.0],
        [y / 2.0, 0.25 - x / 2.0, z / 2.0 - 2.0],
    ];
    format!(
        "[camera]\nposition = {}\nlook_at = {}\n[[light]]\nposition = {}\npower = 9\n[[object]]\n\
         vertices = [{vertices}]\nfaces = [[0, 1, 2]]\n[[object]]\nvertices = {turned:?}\nfaces = [[0, 1, 2]]\n\
         scale = 2\nrotation = [0, 0, 90]\n[[object]]\nshape = \"sphere\"\ntriangles = 8\ntranslation = {}\n",
        at([0.0, 0.25, 1.0]),
        at([0.0, 0.0, -4.0]),
        at([1.0, 2.0, 0.0]),
        at([2.0, 0.5, -6.0]),
    )
}

#[test]
fn a_scene_far_from_the_origin_is_the_scene_at_the_origin_moved_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let load = |offset: [f64; 3]| {
        std::fs::write(&path, scene_at(offset)).unwrap();
        let loaded = load_scene_with(&path, &[]).unwrap();
        assert!(loaded.notes.is_empty(), "{:?}", loaded.notes);
        loaded.scene
    };
    let (near, far) = (load([0.0; 3]), load([500_000.0, 5_400_000.0, 212.5]));
    let moved = far.camera.position - near.camera.position;
    let is_moved = |from: Vec3, to: Vec3| (from + moved - to).abs().max_element() < 1e-5;
    let positions = |scene: &Scene| scene.mesh.positions.clone();
    let all = positions(&near).into_iter().zip(positions(&far));
    assert!(moved.length() < 10.0 && all.into_iter().all(|(from, to)| is_moved(from, to)), "{moved}");
    assert!(is_moved(near.lights[0].position, far.lights[0].position));
    assert!(near.camera.forward.distance(far.camera.forward) < 1e-6);
    assert_eq!(near.lights[0].power, far.lights[0].power);
}

/// A light, and a sphere so small that the scene gets an origin of its own, the sphere's centre.
const SMALL: &str = "[[light]]\nposition = [0, 2, 0]\npower = 20\n[[object]]\nshape = \"sphere\"\ntriangles = 80\n\
    scale = 0.1\ntranslation = [0, 0, -3]\n";

#[test]
fn an_eye_that_the_file_does_not_set_is_at_the_files_origin_also_if_the_scene_has_an_origin_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    for camera in ["", "[camera]\nlook_at = [0, 0, -3]\n", "[camera]\nup = [0, 2, 0]\n"] {
        std::fs::write(&path, format!("{camera}{SMALL}")).unwrap();
        let scene = load_scene_with(&path, &[]).unwrap().scene;
        let eye = scene.camera.position;
        assert!(eye.distance(Vec3::Z * 3.0) < 0.05, "{camera}: {eye}");
        assert!((scene.lights[0].position - eye).distance(Vec3::Y * 2.0) < 1e-6, "{camera}: {eye}");
        assert!(scene.camera.forward.distance(Vec3::NEG_Z) < 1e-6, "{camera}: {}", scene.camera.forward);
    }
}

#[test]
fn a_note_names_an_object_that_is_too_far_from_the_others_for_single_precision() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let notes = |x: &str, scale: u32| {
        let sphere = "[[object]]\nshape = \"sphere\"\ntriangles = 80\n";
        let scene = format!("{sphere}{sphere}scale = {scale}\ntranslation = [{x}, 0, 0]\n");
        std::fs::write(&path, scene).unwrap();
        let mut notes = load_scene_with(&path, &[]).unwrap().notes;
        notes.retain(|note| note.contains("inexact"));
        notes
    };
    let [note] = &notes("2e8", 10)[..] else { panic!("{:?}", notes("2e8", 10)) };
    let expected = "a.toml:4: 80 of 80 triangles are shown with inexact shapes: at their distance from the origin, they are too small";
    assert!(note.contains(expected), "{note}");
    assert_eq!([notes("2e8", 10_000_000), notes("200", 10)], [[""; 0]; 2]);
}

#[test]
fn a_scene_keeps_its_coordinates_if_its_centre_is_up_to_16_radii_away() {
    let folder = tempfile::tempdir().unwrap();
    let [path, scene] = ["a.obj", "a.toml"].map(|name| folder.path().join(name));
    std::fs::write(&path, "v 4096 0 0\nv 4096.5 0 0\nv 4096 0.5 0\nf 1 2 3\n").unwrap();
    let positions = |path: &Path| load_scene_with(path, &[]).unwrap().scene.mesh.positions.clone();
    let of_scene = |more: &str| {
        std::fs::write(&scene, format!("[[object]]\nmesh = \"a.obj\"\n{more}")).unwrap();
        positions(&scene)
    };
    assert_eq!(positions(&path)[0], Vec3::new(-0.25, -0.25, 0.0));
    assert_eq!(of_scene("")[0], Vec3::new(-0.25, -0.25, 0.0));
    assert_eq!(of_scene("translation = [-4095.9, 0, 0]\n")[0], Vec3::X * (4096.0 - 4095.9_f64) as f32);
    // If the scene also contains a sphere at the origin, the scene's centre is not far from the origin.
    let both = of_scene("[[object]]\nshape = \"sphere\"\ntriangles = 8\n");
    assert_eq!(both[0], Vec3::X * 4096.0);
    // A mesh without an origin of its own is stored in single precision, and its translation is rounded likewise.
    std::fs::write(&path, "v -4096 0 0\nv 4096 0 0\nv 4096 0.5 0\nf 1 2 3\n").unwrap();
    assert_eq!(of_scene("translation = [4095.9, 0, 0]\n")[0], Vec3::X * (4095.9_f32 - 4096.0));
}

/// Near 5e6, the numbers of single precision are 0.5 apart.
#[test]
fn a_far_mesh_that_its_translation_moves_back_to_the_origin_lies_exactly_there() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), "v 5e6 5e6 0\nv 5000001 5e6 0\nv 5e6 5000001 0\nf 1 2 3\n")
        .unwrap();
    let scene = folder.path().join("a.toml");
    let text = "[[object]]\nmesh = \"a.obj\"\ntranslation = [-4999999.9, -5000000.4, 0]\n";
    std::fs::write(&scene, text).unwrap();
    let positions = load_scene_with(&scene, &[]).unwrap().scene.mesh.positions.clone();
    let expected = Vec3::new(0.1, -0.4, 0.0);
    assert!(positions[0].distance(expected) < 1e-6, "{positions:?}");
}

#[test]
fn a_mistake_of_a_far_camera_is_reported_in_the_files_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let text = scene_at([500_000.0, 0.0, 0.0])
        .replace("look_at = [500000.0, 0.0, -4.0]", "look_at = [500000, 0.25, 1]");
    let without_position = format!("[camera]\nlook_at = [0, 0, 0]\n{SMALL}");
    for (text, eye) in [(text, "[500000, 0.25, 1]"), (without_position, "[0, 0, 0]")] {
        std::fs::write(&path, text).unwrap();
        let error = load_scene_with(&path, &[]).unwrap_err().to_string();
        assert!(error.contains(&format!("the camera at {eye} looks at its own position")), "{error}");
    }
}

#[test]
fn a_mesh_of_extreme_size_is_scaled_alone_whatever_its_format() {
    let folder = tempfile::tempdir().unwrap();
    let stl = "solid a\nfacet\nvertex 0 0 0\nvertex E 0 0\nvertex 0 E 0\nendfacet\nendsolid\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\nE 0 0\n0 E 0\n3 0 1 2\n";
    let flat = "v 0 0\nv E 0\nv 0 E\nf 1 2 3\n";
    let files =
        [("a.obj", "v 0 0 0\nv E 0 0\nv 0 E 0\nf 1 2 3\n"), ("b.obj", flat), ("a.stl", stl), ("a.ply", ply)];
    for (edge, power, extreme) in [("1e-300", 998, "small"), ("1e-10", 34, "small"), ("1e12", -39, "large")] {
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::write(&path, text.replace('E', edge)).unwrap();
            let loaded = load_scene_with(&path, &[]).unwrap();
            let positions = loaded.scene.mesh.positions.iter().map(|position| position.max_element());
            let expected = (edge.parse::<f64>().unwrap() * 2_f64.powi(power)) as f32;
            assert_eq!(positions.fold(0.0, f32::max), expected, "{name}, {edge}");
            let [.., note] = &loaded.notes[..] else { panic!("no note: {name}, {edge}") };
            let start = format!("{}: the mesh is too {extreme} for single precision, ", path.display());
            assert!(note.starts_with(&start) && note.contains(&format!("by 2^{power} (")), "{note}");
        }
    }
}

#[test]
fn a_mesh_of_extreme_size_keeps_its_size_in_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let light = "[[light]]\nposition = [1, 3, 1]\npower = 10\n";
    std::fs::write(&path, format!("{light}[[object]]\nmesh = \"a.obj\"\n")).unwrap();
    let read = |edge: &str| {
        let text = format!("v 0 0 0\nv {edge} 0 0\nv 0 {edge} 0\nf 1 2 3\n");
        std::fs::write(folder.path().join("a.obj"), text).unwrap();
        let loaded = load_scene_with(&path, &[]).unwrap();
        (loaded.scene.mesh.positions[1].x, loaded.notes)
    };
    for edge in ["1e-30", "1e-10", "5e11"] {
        assert_eq!(read(edge).0, edge.parse::<f32>().unwrap());
        assert!(!read(edge).1.iter().any(|note| note.contains("single precision")), "{:?}", read(edge).1);
    }
    let (size, notes) = read("1e-300");
    assert!(size == 0.0 && notes.iter().any(|note| note.contains("nothing is visible")), "{notes:?}");
}

#[test]
fn the_camera_of_a_file_is_scaled_like_its_mesh_unless_it_is_too_far_away() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let scene = |distance: f64| {
        let tiny =
            r#"{"mesh": 0, "scale": [5.820766091346741e-11, 5.820766091346741e-11, 5.820766091346741e-11]}"#;
        let text =
            SEEN.replace(r#"{"mesh": 0}"#, tiny).replace("[0, 0, 5]", &format!("[0, 0, {distance:e}]"));
        std::fs::write(&path, text).unwrap();
        let scene = load_scene_with(&path, &[]).unwrap().scene;
        (scene.mesh.positions[1].x.max(scene.mesh.positions[2].x), scene.camera.position, scene.camera.z_near)
    };
    // The mesh has edges of length 2^-34. The mesh is scaled by 2^35, unless the camera would then be beyond
    // the limit of coordinates.
    let scale = 2_f32.powi(35);
    assert_eq!(scene(2_f64.powi(-31)), (2.0, Vec3::Z * 16.0, 0.1 * scale));
    assert_eq!(scene(16.0), (2.0, Vec3::Z * 16.0 * scale, 0.1 * scale));
    assert_eq!(scene(32.0), (2_f32.powi(-34), Vec3::Z * 32.0, 0.1));
}

#[test]
fn a_mesh_that_is_added_to_a_bare_mesh_keeps_its_place_and_size_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let [path, other] = ["a.obj", "b.obj"].map(|name| folder.path().join(name));
    let triangle = |path: &Path, [x, y]: [f64; 2], edge: f64| {
        let text = format!("v {x} {y} 0\nv {} {y} 0\nv {x} {} 0\nf 1 2 3\n", x + edge, y + edge);
        std::fs::write(path, text).unwrap();
    };
    let load = || load_scene_with(&path, &[("object.1.mesh".to_owned(), Value::from("b.obj"))]).unwrap();
    // Two neighbouring tiles of a map in UTM coordinates.
    triangle(&path, [500_000.0, 5_400_000.0], 100.0);
    triangle(&other, [500_100.0, 5_400_000.0], 100.0);
    let positions = load().scene.mesh.positions.clone();
    assert_eq!((positions[0], positions[3]), (Vec3::new(-100.0, -50.0, 0.0), Vec3::new(0.0, -50.0, 0.0)));
    // Each of these triangles alone would be scaled to a radius of at least 1.
    triangle(&path, [0.0; 2], 4e-7);
    triangle(&other, [0.0; 2], 4e-8);
    let loaded = load();
    assert_eq!([1, 4].map(|i: usize| loaded.scene.mesh.positions[i].x), [4e-7, 4e-8]);
    assert!(loaded.notes.iter().any(|note| note.contains("radius is only")), "{:?}", loaded.notes);
}

#[test]
fn a_file_that_is_added_to_a_bare_mesh_and_is_no_mesh_is_refused_with_its_format() {
    let folder = tempfile::tempdir().unwrap();
    let [path, other] = ["a.obj", "b.obj"].map(|name| folder.path().join(name));
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::fs::write(&other, "GIF89a").unwrap();
    let added = ("object.1.mesh".to_owned(), Value::from("b.obj"));
    let error = load_scene_with(&path, &[added]).unwrap_err().to_string();
    let expected =
        format!("object.1.mesh = \"b.obj\": {} is a GIF picture, which raycl does not read", other.display());
    assert_eq!(error, expected);
}

#[test]
fn the_camera_of_a_bare_mesh_is_used_with_its_notes_also_if_another_mesh_is_added() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let text = SEEN
        .replace("[0, 0, 5]}", r#"[500000, 0, 5]}, {"camera": 0}"#)
        .replace("[0, 1]", "[0, 1, 2]")
        .replace(r#"{"mesh": 0}"#, r#"{"mesh": 0, "translation": [500000, 0, 0]}"#);
    std::fs::write(&path, text).unwrap();
    std::fs::write(folder.path().join("b.obj"), "v 500003 0 0\nv 500004 0 0\nv 500003 1 0\nf 1 2 3\n")
        .unwrap();
    let other = ("object.1.mesh".to_owned(), Value::from("b.obj"));
    let loaded = load_scene_with(&path, &[other]).unwrap();
    let from_corner = loaded.scene.camera.position - loaded.scene.mesh.positions[0];
    assert!(from_corner.distance(Vec3::Z * 5.0) < 1e-5, "{from_corner}");
    assert_eq!(loaded.notes, [format!("{}: of 2 cameras, the first is used", path.display())]);
}

#[test]
fn a_sky_without_a_horizon_has_one_colour() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, SEEN).unwrap();
    let sky = |keys: &[(&str, f64)]| {
        let values: Vec<_> =
            keys.iter().map(|(key, value)| ((*key).to_owned(), Value::Float(*value))).collect();
        load_scene_with(&path, &values).unwrap().scene.sky.clone().unwrap()
    };
    let plain = sky(&[("sky.zenith", 0.5)]);
    assert_eq!((plain.zenith, plain.horizon), (Vec3::splat(0.5), Vec3::splat(0.5)));
    assert_eq!(plain.reach, f32::MAX, "occluders at every distance");
    let graded = sky(&[("sky.zenith", 0.5), ("sky.horizon", 0.25)]);
    assert_eq!((graded.zenith, graded.horizon), (Vec3::splat(0.5), Vec3::splat(0.25)));
}

/// Returns a scene of one triangle in front of the paper's camera. The scene's file begins with the text
/// `before`.
fn loaded(before: &str) -> Result<crate::scene::Loaded, crate::Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let object = "[[object]]\nvertices = [[0, 0, -2], [1, 0, -2], [0, 1, -2]]\nfaces = [[0, 1, 2]]\n";
    std::fs::write(&path, format!("{before}{object}")).unwrap();
    load_scene_with(&path, &[])
}

/// Returns the message of the error for a scene file that begins with `text`, and the line that the error
/// marks.
fn message_and_line(text: &str) -> (String, usize) {
    let crate::Error::Input(error) = loaded(text).unwrap_err() else { panic!("not an input error") };
    let source = error.source_code.as_ref().unwrap().inner();
    (error.message.clone(), crate::error::line_of(source, error.span.unwrap().offset()))
}

#[test]
fn an_azimuth_or_an_elevation_alone_frames_the_scene() {
    let camera = |keys: &str| loaded(&format!("[camera]\n{keys}\n")).unwrap().scene.camera;
    assert_eq!(camera("").position, Vec3::ZERO);
    let above = camera("elevation_degrees = 90");
    assert!(above.forward.distance(Vec3::NEG_Y) < 1e-3 && above.position.y > 1.0, "{above:?}");
    let beside = camera("azimuth_degrees = 90");
    assert!(beside.forward.x < -0.5 && beside.position.x > 1.0, "{beside:?}");
}

/// The triangle has a width and a height of 1. Seen from +z, the triangle fills 0.92 of a square picture's
/// width and height.
#[test]
fn a_camera_that_raycl_places_has_the_distance_that_fits_the_field_of_view() {
    let angles = "azimuth_degrees = 0\nelevation_degrees = 0\n";
    for (keys, degrees) in [
        ("", 35.0_f32),
        ("fov_y_degrees = 35\n", 35.0),
        ("fov_y_degrees = 10\n", 10.0),
        ("fov_x_degrees = 10\n", 10.0),
        ("fov_x_degrees = 60\n", 60.0),
    ] {
        let camera = loaded(&format!("[camera]\n{angles}{keys}")).unwrap().scene.camera;
        let tan = (degrees.to_radians() / 2.0).tan();
        let expected = Vec3::new(0.5, 0.5, 0.5 / (0.92 * tan) - 2.0);
        assert!(camera.position.distance(expected) < 1e-4, "{keys:?}: {}", camera.position);
        assert!((camera.tan_half_fov - tan).abs() < 1e-6, "{keys:?}");
    }
}

#[test]
fn an_option_that_sets_the_field_of_view_of_a_bare_mesh_also_sets_the_distance() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let camera = |values: &[(String, Value)]| load_scene_with(&path, values).unwrap().scene.camera;
    let fov = |degrees: i64| ("camera.fov_y_degrees".to_owned(), Value::Integer(degrees));
    let usual = camera(&[]);
    assert_eq!(camera(&[fov(35)]), usual);
    let centre = Vec3::new(0.5, 0.5, 0.0);
    let ratio = camera(&[fov(10)]).position.distance(centre) / usual.position.distance(centre);
    // The default field of view is 35 degrees, so the distance grows by the factor tan(17.5 degrees) / tan(5
    // degrees), which is 3.6.
    assert!((3.0..4.0).contains(&ratio), "{ratio}");
    // A position that the user sets does not change with the field of view.
    let position = Value::Array([1, 2, 5].map(Value::Integer).to_vec());
    let placed = camera(&[fov(10), ("camera.position".to_owned(), position)]);
    assert_eq!(placed.position, Vec3::new(1.0, 2.0, 5.0));
}

#[test]
fn a_scene_turns_about_its_upward_direction_whatever_its_length() {
    let orbit =
        loaded("[camera]\nup = [0, 0, 2]\nposition = [5, 0, 0]\nlook_at = [0, 0, 0]\n").unwrap().orbit;
    assert_eq!(orbit.up, glam::DVec3::Z);
}

#[test]
fn a_field_of_view_is_that_of_the_width_or_of_the_height_wherever_the_camera_stands() {
    for position in ["", "position = [0, 0, 5]\n"] {
        for (key, is_vertical) in [("fov_x_degrees", false), ("fov_y_degrees", true)] {
            let camera = loaded(&format!("[camera]\n{key} = 60\n{position}")).unwrap().scene.camera;
            assert_eq!(camera.fov_is_vertical, is_vertical, "{key}, {position}");
            assert!((camera.tan_half_fov - 0.577_350_26).abs() < 1e-6, "{key}, {position}");
        }
    }
    let (message, line) = message_and_line("[camera]\nfov_y_degrees = 60\nfov_x_degrees = 60\n");
    assert_eq!((message.as_str(), line), ("both fov_x_degrees and fov_y_degrees are set", 2));
}

#[test]
fn a_camera_without_a_direction_is_reported_at_the_key_that_is_probably_wrong() {
    let same = "the camera at [1, 2, 3] looks at its own position";
    assert_eq!(
        message_and_line("[camera]\nposition = [1, 2, 3]\nlook_at = [1, 2, 3]\n"),
        (same.to_owned(), 3)
    );
    assert_eq!(message_and_line("[camera]\nlook_at = [0, 0, 0]\n").1, 2);
    let parallel = "the camera's `up`, [0, 1, 0], is zero or parallel to its view direction [0, -4, 0]";
    let keys = "position = [0, 4, 0]\nlook_at = [0, 0, 0]\n";
    assert_eq!(message_and_line(&format!("[camera]\n{keys}up = [0, 1, 0]\n")), (parallel.to_owned(), 4));
    assert_eq!(message_and_line(&format!("[camera]\n{keys}")), (parallel.to_owned(), 3));
}

/// The light is at a corner of the triangle. raycl computes the light's brightness at the smallest distance that
/// counts, a ten-millionth of the scene's diagonal.
#[test]
fn a_light_that_is_too_bright_is_reported_at_its_power() {
    let light = "shadow_bias = 0\n[[light]]\nposition = [0, 0, -2]\npower = 1e28\n";
    let (message, line) = message_and_line(light);
    assert!(message.starts_with("a light with the power ["), "{message}");
    assert_eq!(line, 4);
}

#[test]
fn an_upward_direction_of_zeros_is_refused_however_the_camera_is_placed() {
    for (keys, line) in [("", 2), ("position = [0, 4, 5]\n", 3), ("azimuth_degrees = 30\n", 3)] {
        let (message, at) = message_and_line(&format!("[camera]\n{keys}up = [0, 0, 0]\n"));
        assert!(message.starts_with("the camera's `up`, [0, 0, 0], is zero or parallel"), "{message}");
        assert_eq!(at, line, "{keys}");
    }
}

#[test]
fn a_camera_far_from_the_origin_looks_along_z_too() {
    for z in [3.0, 33_554_432.0, -1e12] {
        let camera = loaded(&format!("[camera]\nposition = [1, 2, {z}]\n")).unwrap().scene.camera;
        assert_eq!(
            (camera.position, camera.forward, camera.up),
            (Vec3::new(1.0, 2.0, z), Vec3::NEG_Z, Vec3::Y)
        );
    }
}

#[test]
fn a_scene_that_is_too_small_for_single_precision_is_noted() {
    let is_noted = |notes: &[String]| notes.iter().any(|note| note.contains("the scene's radius is only"));
    let sphere = |scale: &str| format!("[[object]]\nshape = \"sphere\"\ntriangles = 80\nscale = {scale}\n");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    for (scale, is_small) in [("1e-20", true), ("1e-8", true), ("1e-5", false), ("1", false)] {
        std::fs::write(&path, sphere(scale)).unwrap();
        assert_eq!(is_noted(&load_scene_with(&path, &[]).unwrap().notes), is_small, "{scale}");
    }
    let with_triangle = loaded(&sphere("1e-20")).unwrap();
    assert!(!is_noted(&with_triangle.notes), "the scene is as large as its largest object");
}

/// If the mesh were scaled, its camera would be beyond raycl's limits.
#[test]
fn a_bare_mesh_that_is_too_small_is_noted_with_the_key_that_enlarges_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    // The legs of this triangle are 1e-14 long.
    let legs = [
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
        "AAAAAAAAAAAAAAAA3CQ0KAAAAAAAAAAAAAAAANwkNCgAAAAA",
    ];
    std::fs::write(&path, SEEN.replace(legs[0], legs[1])).unwrap();
    let notes = |settings: &[(String, Value)]| load_scene_with(&path, settings).unwrap().notes;
    let advice = "give the mesh (`object.0`) a larger `scale`";
    assert!(notes(&[]).iter().any(|note| note.ends_with(advice)), "{:?}", notes(&[]));
    let enlarged = notes(&[("object.0.scale".to_owned(), Value::Float(1e14))]);
    assert!(!enlarged.iter().any(|note| note.ends_with(advice)), "{enlarged:?}");
}

#[test]
fn a_sky_is_either_a_picture_or_colours() {
    for (sky, message) in [
        ("picture = \"a.hdr\"\nzenith = 1", "a sky is a picture, or has a zenith and a horizon"),
        ("picture = \"a.hdr\"\nhorizon = 1", "a sky is a picture, or has a zenith and a horizon"),
        ("zenith = 1\nstrength = 2", "strength and turn_degrees belong to a picture"),
        ("zenith = 1\nturn_degrees = 2", "strength and turn_degrees belong to a picture"),
        ("horizon = 1", "a sky has a zenith or a picture"),
    ] {
        assert_eq!(message_and_line(&format!("[sky]\n{sky}\n")).0, message, "{sky}");
    }
}

#[test]
fn a_skys_picture_that_is_not_what_it_is_used_as_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let object = "[[object]]\nshape = \"ground\"\n";
    std::fs::write(folder.path().join("a.toml"), format!("[sky]\npicture = \"sky\"\n{object}")).unwrap();
    let (scene, picture) = (folder.path().join("a.toml"), folder.path().join("sky"));
    let notes = || {
        let notes = load_scene_with(&scene, &[]).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("sky's picture")).collect::<Vec<_>>()
    };
    let hdr = |lines: &str| {
        let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{lines}\n-Y 1 +X 2\n");
        std::fs::write(&picture, [header.as_bytes(), &[128_u8, 64, 32, 129].repeat(2)].concat()).unwrap();
    };
    hdr("");
    assert_eq!(notes(), [""; 0]);
    hdr("PRIMARIES=0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329\n");
    let start = "the sky's picture `sky` has other primaries or another white than sRGB (red at 0.68 0.32,";
    assert!(notes().len() == 1 && notes()[0].starts_with(start), "{:?}", notes());
    image::Rgb32FImage::new(4, 4).save_with_format(&picture, image::ImageFormat::OpenExr).unwrap();
    let start = "the sky's picture `sky` has 4 x 4 texels, but is used as an equirectangular picture";
    assert!(notes().len() == 1 && notes()[0].starts_with(start), "{:?}", notes());
}

/// The scene file lies outside the folder of the file that names the scene. In this case, the notes name channels only
/// if the picture lies in the scene file's folder.
#[test]
fn channels_of_a_skys_picture_that_are_not_read_are_named_where_messages_may_quote_the_picture() {
    use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, WritableImage as _};
    let folder = tempfile::tempdir().unwrap();
    let [inner, other] = ["b", "c"].map(|name| folder.path().join(name));
    [&inner, &other].iter().for_each(|folder| std::fs::create_dir(folder).unwrap());
    let write = |names: &[&str]| {
        let channel = |name: &&str| AnyChannel::new(*name, FlatSamples::F32(vec![0.5; 8]));
        let channels = AnyChannels::sort(names.iter().map(channel).collect());
        let image = Image::from_encoded_channels((4, 2), Encoding::SMALL_LOSSLESS, channels);
        image.write().to_file(folder.path().join("sky.exr")).unwrap();
    };
    let notes = |scene: &Path, picture: &str| {
        let text = format!("[sky]\npicture = \"{picture}\"\n[[object]]\nshape = \"ground\"\n");
        std::fs::write(scene, text).unwrap();
        let notes = load_scene_named_in(&other, scene, &[], Shot::SQUARE).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("channel")).collect::<Vec<_>>()
    };
    let scene = folder.path().join("a.toml");
    write(&["R", "G", "B", "A"]);
    assert_eq!(notes(&scene, "sky.exr"), [""; 0]);
    write(&["R", "G", "B", "Z"]);
    let one = "the sky's picture `sky.exr` has 1 further channel that is not read: `Z`";
    assert_eq!(notes(&scene, "sky.exr"), [one]);
    write(&["R", "G", "B", "Z", "diffuse.R"]);
    let two = "has 2 further channels that are not read";
    assert_eq!(notes(&scene, "sky.exr"), [format!("the sky's picture `sky.exr` {two}: `Z`, `diffuse.R`")]);
    let withheld = notes(&inner.join("a.toml"), "../sky.exr");
    assert_eq!(withheld, [format!("the sky's picture `../sky.exr` {two}")]);
}

/// If the picture's file can be opened, its path is correct, so the help does not mention paths.
#[test]
fn a_skys_picture_without_colours_is_refused_with_its_channels() {
    use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, WritableImage as _};
    let folder = tempfile::tempdir().unwrap();
    let [scene, picture] = ["a.toml", "sky.exr"].map(|name| folder.path().join(name));
    let brightness = AnyChannel::new("Y", FlatSamples::F32(vec![0.5; 8]));
    let channels = AnyChannels::sort([brightness].into_iter().collect());
    let image = Image::from_encoded_channels((4, 2), Encoding::SMALL_LOSSLESS, channels);
    image.write().to_file(&picture).unwrap();
    let refused = |picture: &str| {
        std::fs::write(&scene, format!("[sky]\npicture = \"{picture}\"\n[[object]]\nshape = \"ground\"\n"))
            .unwrap();
        load_scene_with(&scene, &[]).unwrap_err()
    };
    let error = refused("sky.exr");
    assert!(error.to_string().contains("sky.exr` has the channels Y; expected R, G and B"), "{error}");
    assert!(error.remedy().contains("convert pictures of other formats"), "{}", error.remedy());
    assert!(
        refused("skies.exr")
            .remedy()
            .contains("the path is relative to the folder of the scene file or mesh")
    );
}

#[test]
fn faces_and_normals_that_do_not_fit_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let load = |keys: &str| {
        std::fs::write(&path, format!("[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n{keys}\n"))
            .unwrap();
        load_scene_with(&path, &[])
    };
    for (keys, message) in [
        ("", "`vertices` without `faces`"),
        ("faces = []", "`faces` is empty: no triangles"),
        ("faces = [[0, 1, 2]]\nnormals = []", "0 normals for 3 vertices"),
        ("faces = [[0, 1, 2]]\nnormals = [[0, 0, 1]]", "1 normal for 3 vertices"),
        (
            "faces = [[0, 1, 2]]\nnormals = [[0, 0, 1], [0, 0, 1], [0, 0, 1], [1, 0, 0]]",
            "4 normals for 3 vertices",
        ),
        (
            "faces = [[0, 1, 2]]\nnormals = []\nface_normals = [[0, 0, 0]]",
            "normal 0 does not exist; the object has no normal",
        ),
        (
            "faces = [[0, 1, 2]]\nnormals = [[0, 0, 1]]\nface_normals = [[0, 0, 4]]",
            "normal 4 does not exist; expected 0 to 0",
        ),
        (
            "faces = [[0, 1, 2]]\nnormals = [[0, 0, 1]]\nface_normals = [[0, 0]]",
            "the number of normals differs from the number of corners",
        ),
        (
            "faces = [[0, 1, 2]]\nnormals = [[0, 0, 1]]\nface_normals = [[0, 0, 0], [0, 0, 0]]",
            "2 lists of normals for 1 faces",
        ),
        (
            "faces = [[0, 1, 2]]\nshape = \"sphere\"",
            "an object is one of: mesh = \"FILE\", shape = \"NAME\", vertices and faces",
        ),
        ("faces = [[0, 1, 2]]\nseed = 3", "`seed` without `shape`"),
        ("faces = [[0, 1, 2]]\ntriangles = 3", "`triangles` without `shape`"),
        ("faces = [[0, 1, 2]]\nfineness = 3", "`fineness` without `shape`"),
        ("faces = [[0, 1, 2]]\noutside_materials = true", "`outside_materials` without `mesh`"),
    ] {
        assert_eq!(load(keys).unwrap_err().to_string(), message, "{keys}");
    }
    let normals = "normals = [[0, 0, 1], [1, 0, 0]]\nface_normals = [[0, 1, 0]]";
    let mesh = load(&format!("faces = [[0, 1, 2]]\n{normals}")).unwrap().scene.mesh;
    assert_eq!(mesh.corner_normals(&mesh.triangles[0]), [Vec3::Z, Vec3::X, Vec3::Z]);
}

#[test]
fn normals_and_faces_in_a_scene_file_cause_the_same_notes_as_those_of_a_mesh_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let notes = |keys: &str| {
        std::fs::write(&path, format!("[[object]]\n{keys}\nfaces = [[0, 1, 2]]\n")).unwrap();
        load_scene_with(&path, &[]).unwrap().notes
    };
    let vertices = "vertices = [[0, 0, -3], [1, 0, -3], [0, 1, -3]]\n";
    let usual = notes(&format!("{vertices}normals = [[0, 0, 1], [0, 0, 1], [0, 0, 1]]"));
    let added = |keys: &str| notes(keys).into_iter().filter(|note| !usual.contains(note)).collect::<Vec<_>>();
    let location = format!("{}:2: ", path.display());
    let zero = "1 triangle with a normal that is zero or not finite is changed: each such normal becomes the normal of \
                its triangle's plane";
    let with_zero = added(&format!("{vertices}normals = [[0, 0, 0], [0, 0, 1], [0, 0, 1]]"));
    assert_eq!(with_zero, [format!("{location}{zero}")]);
    let unused = "4 vertices that no face uses are not drawn";
    let more = vertices.replace("]]", &format!("]{}]", ", [5, 5, -3]".repeat(4)));
    assert_eq!(added(&more), [format!("{location}{unused}")]);
    let nothing = "nothing is visible, since the mesh's only triangle has no area";
    let flat = added("vertices = [[0, 0, -3], [0, 0, -3], [0, 1, -3]]");
    assert!(flat.contains(&format!("{location}{nothing}")), "{flat:?}");
}

#[test]
fn a_crease_angle_without_effect_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let [path, mesh] = ["a.toml", "a.obj"].map(|name| folder.path().join(name));
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    std::fs::write(&mesh, format!("{corners}vn 0 0 1\nf 1//1 2//1 3//1\n")).unwrap();
    std::fs::write(folder.path().join("b.obj"), format!("{corners}f 1 2 3\n")).unwrap();
    let notes_of = |path: &Path, settings: &[(String, Value)]| {
        let notes = load_scene_with(path, settings).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("crease angle")).collect::<Vec<_>>()
    };
    let notes = |text: &str| {
        std::fs::write(&path, text).unwrap();
        notes_of(&path, &[])
    };
    let at = |line: u32, reason: &str| {
        format!("{}:{line}: this crease angle has no effect, since {reason}", path.display())
    };
    let [a, b] = ["a", "b"].map(|name| format!("[[object]]\nmesh = \"{name}.obj\"\n"));
    let with_normals = "all corners of the object have normals";
    assert_eq!(notes(&format!("{a}crease = 30\n")), [at(3, with_normals)]);
    assert_eq!(notes(&format!("{b}crease = 30\n")), [""; 0]);
    assert_eq!(notes(&format!("{b}flat = true\ncrease = 30\n")), [at(4, "the object is flat")]);
    let only = "the object has normals at all corners, or is flat (as is a glTF without normals)";
    let none = "each object has normals at all corners, is flat (as is a glTF without normals), or has a crease angle \
                of its own";
    assert_eq!(notes(&format!("crease = 30\n{a}")), [at(1, only)]);
    assert_eq!(notes(&format!("crease = 30\n{a}{b}")), [""; 0]);
    let own = "the object has a crease angle of its own";
    assert_eq!(notes(&format!("crease = 30\n{b}crease = 40\n")), [at(1, own)]);
    assert_eq!(notes(&format!("crease = 30\n{a}{b}crease = 40\n")), [at(1, none)]);
    // A bare mesh has a default crease angle, which causes no note.
    assert_eq!(notes_of(&mesh, &[]), [""; 0]);
    let set = notes_of(&mesh, &[("crease".to_owned(), Value::from(20))]);
    assert!(set.len() == 1 && set[0].contains(only) && !set[0].contains("a.obj:"), "{set:?}");
}

#[test]
fn parts_of_a_mesh_file_that_the_scene_leaves_out_or_replaces_cause_no_notes() {
    let folder = tempfile::tempdir().unwrap();
    let [path, mesh] = ["a.toml", "a.obj"].map(|name| folder.path().join(name));
    image::RgbImage::new(1, 1).save(folder.path().join("dot.png")).unwrap();
    let mtl = "newmtl a\nmap_Kd -mm 0 2 dot.png\nnewmtl b\nKd 0.5 0.5 0.5\nmap_Bump no.png\nmap_Ke no.png\n";
    std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
    let corners = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvt 0 0 5\ns off\n";
    let faces = "usemtl a\nf 1/1 2/1 3/1\nf 1 2 3\nusemtl b\nf 1 2 3\n";
    std::fs::write(&mesh, format!("mtllib m.mtl\n{corners}{faces}")).unwrap();
    let notes = |above: &str, in_object: &str| {
        let text =
            format!("{above}\n[[object]]\nmesh = \"a.obj\"\n{in_object}\n[sky]\nzenith = 1\nhorizon = 1\n");
        std::fs::write(&path, text).unwrap();
        load_scene_with(&path, &[]).unwrap().notes.join("\n")
    };
    let smooth = "smoothing groups (s) are not read";
    let [tinted, darkened] = ["textures of 1 triangle are multiplied", "colours of vertices are multiplied"];
    let of_textures =
        ["options of textures", "asks for textures", "second of `vt`", "no.png", "no texture coordinates"];
    let all = [&[smooth, tinted, darkened][..], &of_textures].concat();
    let check = |notes: &str, left_out: &[&str]| {
        for part in &all {
            assert_eq!(notes.contains(part), !left_out.contains(part), "{part}: {notes}");
        }
    };
    check(&notes("", ""), &[]);
    check(&notes("crease = 40", ""), &[]);
    for (above, in_object) in [("", "flat = true"), ("crease = 0", ""), ("crease = 40", "crease = 0")] {
        check(&notes(above, in_object), &[smooth]);
    }
    check(&notes("", "material = { k_l = 1 }"), &[tinted, darkened]);
    check(&notes("textures = false", ""), &[&of_textures[..], &[tinted]].concat());
}

#[test]
fn angles_beside_a_position_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let notes = |camera: &str| {
        std::fs::write(&path, format!("[[object]]\nshape = \"sphere\"\n[camera]\n{camera}\n")).unwrap();
        let notes = load_scene_with(&path, &[]).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("the camera's position")).collect::<Vec<_>>()
    };
    let expected = |angles: &str| format!("{}:4: the camera's position is set, so {angles}", path.display());
    assert_eq!(
        notes("position = [0, 0, 3]\nazimuth_degrees = 40"),
        [expected(
            "azimuth_degrees does not turn the camera; this angle only changes the defaults of `look_at` and of the \
             field of view"
        )]
    );
    let both = "position = [0, 0, 3]\nlook_at = [0, 0, 0]\nazimuth_degrees = 40\nelevation_degrees = 20";
    let they_do = "azimuth_degrees and elevation_degrees do not turn the camera";
    let change = format!("{they_do}; these angles only change the default of the field of view");
    assert_eq!(notes(both), [expected(&change)]);
    assert_eq!(notes(&format!("{both}\nfov_y_degrees = 40")), [expected(they_do)]);
    assert_eq!(notes("position = [0, 0, 3]"), [""; 0]);
    assert_eq!(notes("azimuth_degrees = 40\nlook_at = [0, 0, 0]"), [""; 0]);
}

#[test]
fn a_shape_has_no_keys_of_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    for (key, value) in
        [("normals", "[[0, 0, 1]]"), ("face_normals", "[[0, 0, 0]]"), ("faces", "[[0, 1, 2]]")]
    {
        std::fs::write(&path, format!("[[object]]\nshape = \"sphere\"\n{key} = {value}\n")).unwrap();
        let message = load_scene_with(&path, &[]).unwrap_err().to_string();
        assert_eq!(message, format!("`{key}` without `vertices`"));
    }
}

#[test]
fn a_shape_has_its_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let load = |keys: &str| {
        std::fs::write(&path, format!("[[object]]\nshape = \"terrain\"\ntriangles = 200\n{keys}\n")).unwrap();
        load_scene_with(&path, &[]).unwrap().scene.mesh
    };
    let (one, other) = (load("seed = 1"), load("seed = 2"));
    assert!((100..400).contains(&one.triangles.len()), "{}", one.triangles.len());
    assert_ne!(one.positions, other.positions);
}

#[test]
fn a_scenes_mesh_that_is_missing_or_none_is_reported_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let [path, mesh] = ["a.toml", "teapot.obj"].map(|name| folder.path().join(name));
    std::fs::write(&mesh, "GIF89a").unwrap();
    let error = |mesh: &str| {
        std::fs::write(&path, format!("name = \"a\"\n[[object]]\nmesh = \"{mesh}\"\n")).unwrap();
        load_scene_with(&path, &[]).unwrap_err()
    };
    let foreign =
        format!("{}:3: {} is a GIF picture, which raycl does not read", path.display(), mesh.display());
    assert_eq!(error("teapot.obj").to_string(), foreign);
    let missing = error("taepot.obj");
    assert_eq!(missing.to_string(), format!("no mesh file `{}`", folder.path().join("taepot.obj").display()));
    let meant = format!("did you mean `{}`? the path is", mesh.display());
    assert!(missing.remedy().starts_with(&meant));
    assert!(error("TEAPOT.OBJ").remedy().starts_with(&meant), "the case differs");
    std::fs::create_dir(folder.path().join("m")).unwrap();
    for (mesh, expected) in [("m", "m` is a folder; expected a mesh file"), ("-", "no mesh file `")] {
        let error = error(mesh);
        assert!(error.to_string().contains(expected), "{error}");
        assert!(error.remedy().starts_with("the path is relative"), "{}", error.remedy());
    }
    #[cfg(unix)]
    assert!(error("/dev/zero").to_string().starts_with("`/dev/zero` is a pipe or a device; expected a mesh"));
    #[cfg(unix)]
    std::os::unix::fs::symlink("gone.obj", folder.path().join("link.obj")).unwrap();
    #[cfg(unix)]
    assert!(error("link.obj").to_string().ends_with("link.obj` is a link to `gone.obj`, which is missing"));
}

#[test]
fn a_scene_that_is_seen_from_behind_is_noted() {
    let notes = |position: &str| {
        loaded(&format!("[camera]\nposition = {position}\nlook_at = [0.3, 0.3, -2]\n")).unwrap().notes
    };
    assert!(!notes("[0, 0, 0]").iter().any(|note| note.contains("faces away")));
    assert!(
        notes("[0, 0, -4]").iter().any(|note| note.starts_with("100% of the visible surface faces away"))
    );
}

#[test]
fn an_eye_inside_an_object_is_noted_with_the_options_that_place_it_outside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let object = "[[object]]\nshape = \"sphere\"\ntriangles = 200\n[[object]]\nshape = \"ground\"\n";
    let light = "[[light]]\nposition = [0, 9, 9]\npower = 900\n";
    std::fs::write(&path, format!("{object}{light}")).unwrap();
    let notes = |settings: &[(&str, f64)]| {
        let settings: Vec<_> =
            settings.iter().map(|(name, value)| ((*name).to_owned(), Value::Float(*value))).collect();
        load_scene_with(&path, &settings).unwrap().notes.join("\n")
    };
    let inside = notes(&[]);
    assert!(inside.contains("the eye is inside the bounding box of an object; `--azimuth 30 "), "{inside}");
    assert!(inside.contains("% of the visible surface faces away"), "{inside}");
    let outside = notes(&[("camera.azimuth_degrees", 30.0), ("camera.elevation_degrees", 20.0)]);
    assert!(!outside.contains("the eye is inside"), "{outside}");
}

/// The note does not advise an azimuth or an elevation: beside the file's `position`, these angles would not move
/// the camera, and the author probably wants to see the inside of the object.
#[test]
fn an_eye_that_the_file_places_inside_an_object_is_not_sent_outside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    for angle in ["", "azimuth_degrees = 30\n"] {
        let camera = format!("[camera]\nposition = [0.1, 0, 0]\n{angle}");
        std::fs::write(&path, camera + "[[object]]\nshape = \"sphere\"\ntriangles = 200\n").unwrap();
        let notes = load_scene_with(&path, &[]).unwrap().notes;
        let start = "100% of the visible surface faces away";
        let is_it = |note: &String| note.starts_with(start) && note.contains("--two-sided");
        assert!(notes.iter().any(is_it), "{angle}{notes:?}");
    }
}

/// A mesh in another folder may belong to somebody else, so notes must not quote it. Notes that quote nothing
/// from the file are shown.
#[test]
fn a_note_without_text_of_the_file_is_shown_for_a_mesh_of_another_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let two = SEEN
        .replace(r#"{"camera": 0, "#, r#"{"camera": 0, "translation": [0, 0, 9]}, {"camera": 0, "#)
        .replace("[0, 1]", "[0, 1, 2]");
    std::fs::write(&path, two).unwrap();
    let notes = |of: &Path| crate::scene::load_scene_named_in(of, &path, &[], Shot::SQUARE).unwrap().notes;
    assert_eq!(notes(folder.path()).len(), 1);
    assert_eq!(notes(Path::new("/elsewhere")), notes(folder.path()));
}

#[test]
fn the_text_of_a_scene_that_the_user_names_is_quoted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    std::fs::write(&path, "[[object]]\nvertices = []\n").unwrap();
    let error = load_scene_for(&path, &[], Shot::SQUARE).unwrap_err();
    assert_eq!(error.to_string(), "`vertices` without `faces`");
}

#[test]
fn the_parts_of_a_file_are_objects_only_of_a_bare_mesh() {
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/meshes/two.gltf");
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(&mesh, folder.path().join("two.gltf")).unwrap();
    let scene = folder.path().join("a.toml");
    std::fs::write(&scene, "[[object]]\nmesh = \"two.gltf\"\n[[object]]\nshape = \"ground\"\n").unwrap();
    let starts = |path: &Path| load_scene_with(path, &[]).unwrap().object_starts;
    assert_eq!((starts(&mesh), starts(&scene)), (vec![0, 12], vec![0, 24]));
}

#[test]
fn shapes_of_too_many_triangles_are_refused_before_they_are_made() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/terrain.toml");
    let load = |triangles: i64, most| {
        let setting = Setting::new("object.0.triangles", Value::Integer(triangles));
        let shot = Shot { most_triangles: Some(most), ..Shot::SQUARE };
        load_scene_for(&path, &[setting], shot).map(|loaded| loaded.scene.mesh.triangles.len())
    };
    let refused = load(12_000, 10_000).unwrap_err();
    assert!(
        refused.to_string().contains("at least 11250 triangles in all; expected at most 10000"),
        "{refused}"
    );
    // A target slightly above the limit is accepted, because a shape may have fewer triangles than its
    // target.
    assert!(load(10_500, 10_000).unwrap() > 10_000);
}

#[test]
fn a_note_on_lights_without_power_says_whether_there_are_several() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let object = "[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\n";
    let dark = "[[light]]\nposition = [1, 3, 1]\npower = 0\n";
    for (lights, what) in [(dark.to_owned(), "the only light has"), (dark.repeat(2), "all lights have")] {
        std::fs::write(&path, format!("{object}{lights}")).unwrap();
        let notes = load_scene_with(&path, &[]).unwrap().notes;
        let expected = format!(": {what} power 0, so surfaces that emit no light are black");
        assert!(notes.iter().any(|note| note.ends_with(&expected)), "{notes:?}");
    }
}

#[test]
fn a_scene_that_only_a_black_sky_or_averted_lights_would_light_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    let object = "[[object]]\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\n";
    let dark = |lights: &str| {
        std::fs::write(&path, format!("{object}{lights}")).unwrap();
        let notes = load_scene_with(&path, &[]).unwrap().notes;
        notes.into_iter().filter(|note| note.contains("so surfaces that emit no light")).collect::<Vec<_>>()
    };
    let expected = |why: &str, end: &str| {
        [format!("{}: {why}, so surfaces that emit no light are black{end}", path.display())]
    };
    let black = expected("the sky has radiance 0 and there is no light", "");
    assert_eq!(dark("[sky]\nzenith = 0\n"), black);
    assert_eq!(dark("[sky]\nzenith = 0\nhorizon = 0.1\n"), [""; 0]);
    image::Rgb32FImage::new(2, 1).save(folder.path().join("black.hdr")).unwrap();
    assert_eq!(dark("[sky]\npicture = \"black.hdr\"\n"), black);

    let area = |edges: &str| format!("[[light]]\nposition = [0, 0, 3]\npower = 9\nedges = [{edges}]\n");
    let [away, towards] = [area("[1, 0, 0], [0, 1, 0]"), area("[0, 1, 0], [1, 0, 0]")];
    let end = "; the order of a light's `edges` decides which side shines";
    assert_eq!(dark(&away), expected("the only light shines away from all surfaces", end));
    let several = format!("{away}{away}[[light]]\nposition = [0, 0, 3]\npower = 0\n[sky]\nzenith = 0\n");
    assert_eq!(dark(&several), expected("all lights shine away from all surfaces", end));
    let beside = area("[0, 0, 1], [0, 1, 0]").replace("0, 0, 3", "0.5, 0, 3");
    for lit in [towards.clone(), format!("{away}{towards}"), format!("{away}[sky]\nzenith = 1\n"), beside] {
        assert_eq!(dark(&lit), [""; 0], "{lit}");
    }
}

#[test]
fn a_note_on_a_files_lights_speaks_of_emitted_light_if_there_is_any() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let top = r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
"materials": [{"emissiveFactor": [1, 1, 1]}], "#;
    let at = r#"{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}"#;
    let text = SEEN.replacen('{', top, 1).replace(r#"{"mesh": 0}"#, at);
    let text = text.replace(r#"{"POSITION": 0}"#, r#"{"POSITION": 0}, "material": 0"#);
    std::fs::write(&path, text).unwrap();
    let notes = load_scene_with(&path, &[]).unwrap().notes;
    let expected = "; light that surfaces emit keeps its strength";
    assert!(notes.iter().any(|note| note.ends_with(expected)), "{notes:?}");
}

#[test]
fn of_several_settings_of_the_lights_the_last_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let settings = ["first", "second"].map(|origin| Setting {
        path: "light".to_owned(),
        value: Value::Array(Vec::new()),
        origin: origin.to_owned(),
    });
    let notes = load_scene_for(&path, &settings, Shot::SQUARE).unwrap().notes;
    let expected = "second: no light, so surfaces that emit no light are black";
    assert!(notes.iter().any(|note| note == expected), "{notes:?}");
}
