//! The scenes of the repository, and the messages about mistakes in scene files.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::common::is_long;
use glam::Vec3;
use raycl::Error;
use raycl::scene::{Camera, Loaded, MaterialKind, load_scene, load_scene_with};
use std::path::{Path, PathBuf};
use toml::Value;

fn scene_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

fn shipped(name: &str) -> Loaded {
    load_scene(&scene_path(&format!("{name}.toml"))).unwrap()
}

/// Returns a scene file in a new folder.
fn scene_file(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

/// Returns the message of an error, and the part of the file's text to which the error points.
fn mistake(error: Error) -> (String, String) {
    let Error::Input(input) = error else { panic!("not the user's mistake: {error}") };
    let pointed = input
        .source_code
        .as_ref()
        .zip(input.span)
        .map(|(source, span)| source.inner()[span.offset()..span.offset() + span.len()].to_owned());
    (input.message, pointed.unwrap_or_default())
}

fn mistake_in(text: &str) -> (String, String) {
    let (_folder, path) = scene_file(text);
    mistake(load_scene(&path).unwrap_err())
}

#[test]
fn the_papers_scenes_have_its_triangles_lights_and_constants() {
    let counts = [
        ("triangle", 1),
        ("figure-4", 4),
        ("pyramid-upper", 6),
        ("pyramid-lower", 6),
        ("gourd", 650),
        ("teapot", 1026),
    ];
    for (name, triangles) in counts {
        let Loaded { scene, notes, .. } = shipped(name);
        assert_eq!(scene.name, name);
        assert_eq!(scene.mesh.triangles.len(), triangles, "{name}");
        assert_eq!(scene.camera, Camera::PAPER, "{name}");
        let lower = name == "pyramid-lower";
        assert_eq!(scene.shadow_bias, if lower { 1e-2 } else { 1e-4 }, "{name}");
        let light = if lower { Vec3::new(3.0, 0.95, -1.5) } else { Vec3::new(1.0, 3.0, 1.0) };
        assert_eq!((scene.lights[0].position, scene.lights[0].power), (light, Vec3::splat(10.0)));
        assert_eq!((scene.lights.len(), notes.len()), (1, 0));
    }
    let still_life = shipped("still-life").scene.mesh.triangles.len();
    assert!((7..=100).contains(&still_life) && still_life == 94, "{still_life}");
}

#[test]
fn the_single_triangle_is_the_papers_to_the_last_bit() {
    let mesh = shipped("triangle").scene.mesh;
    let corners = [Vec3::new(0.0, 1.0, -2.0), Vec3::new(-1.9, -1.0, -2.0), Vec3::new(1.6, -0.5, -2.0)];
    let normals = [Vec3::new(0.0, 0.6, 1.0), Vec3::new(-0.4, -0.4, 1.0), Vec3::new(0.4, -0.4, 1.0)];
    assert_eq!(mesh.corners(&mesh.triangles[0]), corners);
    assert_eq!(mesh.corner_normals(&mesh.triangles[0]), normals);
    let material = mesh.material(&mesh.triangles[0]);
    assert_eq!(material.to_floats(), [2.5, 2.0, 0.0, 0.2, 0.2, 0.2, 100.0, 1.0]);
}

/// Returns overrides that replace millions of triangles in a scene file by fewer, since generating millions
/// takes half a minute if raycl is not optimised. `make test-long` replaces none. raycl must accept the scene
/// file's own numbers of triangles, too.
fn with_fewer_triangles(path: &Path) -> Vec<(String, Value)> {
    if is_long() {
        return Vec::new();
    }
    let document: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
    let objects = document.get("object").and_then(Value::as_array).into_iter().flatten().enumerate();
    let triangles = |(index, object): (usize, &Value)| Some((index, object.get("triangles")?.as_integer()?));
    let many = objects.filter_map(triangles).filter(|(_, triangles)| *triangles > 300_000);
    let fewer = |(index, triangles): (usize, i64)| {
        assert!(triangles <= 100_000_000, "{path:?}: {triangles} triangles");
        (format!("object.{index}.triangles"), Value::Integer(20_000))
    };
    many.map(fewer).collect()
}

#[test]
fn every_shipped_scene_loads() {
    let files = std::fs::read_dir(scene_path("")).unwrap().map(|entry| entry.unwrap().path());
    let scenes: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    assert!(scenes.len() >= 11);
    for path in scenes {
        let loaded = load_scene_with(&path, &with_fewer_triangles(&path)).unwrap();
        assert!(!loaded.scene.mesh.triangles.is_empty() && loaded.notes.is_empty(), "{path:?}");
    }
}

#[test]
fn overrides_change_a_scene_and_its_hash() {
    let set = |key: &str, value: &str| {
        let table: toml::Table = format!("x = {value}").parse().unwrap();
        (key.to_owned(), table["x"].clone())
    };
    let path = scene_path("sphere.toml");
    let overrides = [
        set("object.0.triangles", "800"),
        set("camera.position", "[0, 0, 1]"),
        set("light.1.position", "[0, 9, 0]"),
    ];
    let mut with_power = overrides.to_vec();
    with_power.push(set("light.1.power", "3"));
    let scene = load_scene_with(&path, &with_power).unwrap().scene;
    assert_eq!((scene.mesh.triangles.len(), scene.lights.len()), (802, 2));
    assert_eq!((scene.camera.position, scene.camera.forward), (Vec3::Z, Vec3::NEG_Z));
    assert_ne!(scene.content_hash(), load_scene(&path).unwrap().scene.content_hash());

    let (message, pointed) =
        mistake(load_scene_with(&path, &[set("camera.positon", "[0, 0, 1]")]).unwrap_err());
    let expected = "camera.positon = [0, 0, 1]: unknown key `positon`; did you mean `position`?";
    assert_eq!((message.as_str(), pointed.as_str()), (expected, ""));
    let wrong = load_scene_with(&path, &[("name.x".to_owned(), Value::Integer(1))]).unwrap_err();
    assert!(mistake(wrong).0.contains("`name` is of the type string"));
}

#[test]
fn mistakes_in_a_scene_file_have_a_message_and_a_position() {
    let object = "[[object]]\nshape = \"ground\"\n";
    let cases = [
        ("[camera]\npositon = [0, 0, 0]\n", "did you mean `position`", "positon"),
        ("[camera]\nz_near = \"near\"\n", "wrong type: string", "\"near\""),
        ("[camera]\nz_near = -1\n", "-1 is not a finite number of at least 0", "-1"),
        ("[camera]\nposition = [0, nan, 0]\n", "NaN is not a finite number", "nan"),
        ("[camera]\nposition = [0, 0]\n", "three numbers [x, y, z]", "[0, 0]"),
        ("[camera]\nfov_x_degrees = 90\nfov_y_degrees = 60\n", "both fov_x_degrees and fov_y_degrees", "60"),
        ("[camera]\nfov_x_degrees = 180\n", "180 is not an angle between 0.001 and 179.99 degrees", "180"),
        ("[camera]\nlook_at = [0, 0, 0]\n", "looks at its own position", "[0, 0, 0]"),
        ("[camera]\nlook_at = [0, 5, 0]\n", "parallel to its view", "[0, 5, 0]"),
        ("[[light]]\nposition = [0, 1, 0]\npower = -3\n", "-3 is not", "-3"),
        ("[display]\ngamma = 0\n", "0 is not a finite number of more than 0", "0"),
        ("[[object]]\nshape = \"spere\"\n", "did you mean `sphere`", "\"spere\""),
        ("[[object]]\nshape = \"ground\"\ntriangles = 7\n", "no `triangles`", "7"),
        ("[[object]]\nobj = \"none.obj\"\n", "no mesh file", "\"none.obj\""),
        ("[[object]]\nmesh = \"a.obj\"\nobj = \"a.obj\"\n", "both `mesh` and `obj` are set", ""),
        ("[[object]]\nshape = \"ground\"\nscale = [1, 0, 1]\n", "0 is not", "0"),
        (
            "[[object]]\nshape = \"ground\"\nfaces = [[0, 1, 2]]\n",
            "`faces` without `vertices`",
            "[[0, 1, 2]]",
        ),
        ("[[object]]\nvertices = [[0, 0, 0]]\nfaces = [[0, 0, 1]]\n", "vertex 1 does not exist", "[0, 0, 1]"),
        ("[[object]]\nscale = 2\n", "an object is one of", ""),
        ("camera = 5\n", "wrong type: integer", "5"),
        ("display = [3, 1.0]\n", "wrong type: list, expected a table", "[3, 1.0]"),
        ("animation = [3, 30, []]\n", "wrong type: list, expected a table", "[3, 30, []]"),
        ("light = [[[1, 3, 2], 20, 0.1]]\n", "wrong type: list, expected a table", "[[1, 3, 2], 20, 0.1]"),
        (
            "[[object]]\nshape = \"sphere\"\nmaterial = [1, 0, 0]\n",
            "wrong type: list, expected a table",
            "[1, 0, 0]",
        ),
        ("x = [\n", "", ""),
    ];
    for (text, message, position) in cases {
        let (actual, pointed) = mistake_in(&format!("{text}{object}"));
        assert!(actual.contains(message), "{text:?}: {actual}");
        assert!(position.is_empty() || pointed == position, "{text:?}: points at {pointed:?}");
    }
    let (message, _) = mistake_in("name = \"empty\"\n");
    assert!(message.contains("no triangles"), "{message}");
}

#[test]
fn the_advised_up_is_not_parallel_to_the_view() {
    for (camera, advised) in
        [("look_at = [0, 5, 0]", "[0, 0, 1]"), ("look_at = [0, 0, 5]\nup = [0, 0, 1]", "[0, 1, 0]")]
    {
        let (_folder, path) = scene_file(&format!("[camera]\n{camera}\n[[object]]\nshape = \"ground\"\n"));
        let Error::Input(input) = load_scene(&path).unwrap_err() else { panic!("{camera}") };
        assert!(input.help.ends_with(advised), "{camera}: {}", input.help);
    }
}

#[test]
fn a_missing_file_is_named_with_the_nearest_one() {
    let (_folder, path) = scene_file("");
    let error = load_scene(&path.with_file_name("scen.toml")).unwrap_err();
    let Error::Input(input) = error else { panic!() };
    assert!(input.message.contains("scen.toml") && input.help.contains("scene.toml"));
}

#[test]
fn a_scene_without_lights_is_legal_and_absent_values_have_defaults() {
    let (_folder, path) = scene_file("[[object]]\nshape = \"sphere\"\nmaterial = { shininess = 5 }");
    let scene = load_scene(&path).unwrap().scene;
    assert!(scene.lights.is_empty());
    assert_eq!(scene.name, "scene");
    assert_eq!(scene.camera, Camera { z_near: 0.0, ..Camera::PAPER });
    let diagonal = 12.0_f32.sqrt();
    assert!((scene.shadow_bias - 1e-4 * diagonal).abs() < 1e-6, "{}", scene.shadow_bias);
    assert_eq!(scene.mesh.materials[0].kind, MaterialKind::BlinnPhong);
}

#[test]
fn materials_come_from_mtl_and_an_override_replaces_them() {
    let (folder, path) = scene_file(
        "[[object]]\nobj = \"m.obj\"\n[[object]]\nobj = \"m.obj\"\nmaterial = { k_l = 0.3 }\n[[light]]\nposition = [0, 0, 3]\npower = 1\n",
    );
    let mtl = "newmtl dull red \nKd 1 0 0\nnewmtl shiny\nKd 0.5\nKs 1 1 1\nNs 20\n";
    std::fs::write(folder.path().join("my file.mtl"), mtl).unwrap();
    let obj =
        "mtllib my file.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl dull red\nf 1 2 3\nusemtl shiny\nf 1 2 3\n";
    std::fs::write(folder.path().join("m.obj"), obj).unwrap();
    let Loaded { scene, notes, .. } = load_scene(&path).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    let floats: Vec<_> = scene.mesh.triangles.iter().map(|t| scene.mesh.material(t).to_floats()).collect();
    assert_eq!(floats[0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(floats[1], [0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 20.0, 1.0]);
    assert_eq!(floats[2][..3], [0.3; 3]);
    assert_eq!(floats[3], [0.3, 0.3, 0.3, 1.0, 1.0, 1.0, 20.0, 1.0]);
}

#[test]
fn odd_mesh_files_end_in_a_picture_or_a_reason() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/obj");
    // A part of the error's message, or an empty text if the scene must load.
    let expected = [
        ("01_zero_bytes", ":1: no triangles"),
        ("04_nan_vertex", ":1: `nan`"),
        ("11_zero_area_collinear", ""),
        ("15_index_zero", ":4: vertex index `0`"),
        ("19_index_i32max", ":4: vertex index `2147483647`"),
        ("29_concave_pentagon", ""),
        ("38_cr_only", ""),
        ("39_bom", ""),
        ("42_line_continuation", ""),
        ("46_invalid_utf8", ""),
        ("47_utf16le", ":1: UTF-16"),
        ("52_mtllib_traversal", ""),
        ("53_mtl_bad_kd", ""),
        ("58_mixed_normals", ""),
        ("61_normal_missing", ""),
        ("70_only_lines", ":5: no triangles"),
    ];
    for (name, reason) in expected {
        match load_scene(&folder.join(format!("{name}.obj"))) {
            Ok(loaded) => {
                assert!(reason.is_empty(), "{name} was read");
                assert!(loaded.scene.mesh.normals.iter().all(|n| n.is_finite() && *n != Vec3::ZERO));
                assert_eq!(loaded.scene.lights.len(), 2);
            }
            Err(error) => {
                assert!(!reason.is_empty() && error.to_string().contains(reason), "{name}: {error}")
            }
        }
    }
}

#[test]
fn a_bare_mesh_takes_overrides_as_a_scene_does() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/obj/29_concave_pentagon.obj");
    let eye = Value::Array(vec![Value::Integer(0), Value::Integer(0), Value::Integer(-9)]);
    let scene = load_scene_with(&path, &[("camera.position".to_owned(), eye)]).unwrap().scene;
    assert_eq!(scene.camera.position, Vec3::new(0.0, 0.0, -9.0));
    // For an eye behind the mesh, the normals point backwards, towards the eye.
    for triangle in &scene.mesh.triangles {
        assert!(scene.mesh.corner_normals(triangle).iter().all(|n| n.z < 0.0));
    }
}
