//! Files whose format is not the expected one: a message of two lines names the format and the remedy.

use crate::binary::{TRIANGLE, WorkFolder, device, has};

const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

const CONFIG: &str = r#"question = "?"
expectation = "!"
scenes = ["other"]
image_sizes = [[8, 5]]
local_sizes = [4]
strategies = ["naive"]
"#;

/// Runs a command that must fail with a message of at most two short lines, and returns the message.
fn message_of(folder: &WorkFolder, arguments: &[&str]) -> String {
    let message = folder.mistake(arguments, 2);
    let lines: Vec<_> = message.lines().filter(|line| !line.trim().is_empty()).collect();
    assert!(lines.len() <= 2 && lines.iter().all(|line| line.len() < 200), "{message}");
    message
}

/// Returns the contents of files in formats that raycl does not read, and the names of these formats.
fn foreign() -> Vec<(Vec<u8>, &'static str)> {
    vec![
        (b"OFF\n3 1 0\n".to_vec(), "an OFF mesh"),
        (b"\x89PNG\r\n\x1a\n\0\0".to_vec(), "a PNG picture"),
        (b"<COLLADA>".to_vec(), "a COLLADA scene"),
        (b"newmtl a\n".to_vec(), "an MTL material file"),
        (b"$MeshFormat\n4.1 0 8\n".to_vec(), "a Gmsh mesh (MSH)"),
        (b"AC3Db\n".to_vec(), "an AC3D model"),
        (b"\xff\xfev\0".to_vec(), "UTF-16 or UTF-32 text"),
        (b"\0\x01\x02\x03".to_vec(), "a binary file"),
    ]
}

#[test]
fn other_formats_are_named_wherever_a_file_is_taken() {
    let scene = format!("{TRIANGLE}\n[[object]]\nobj = \"other\"\n");
    let folder = WorkFolder::with(&[("scene.toml", &scene), ("config.toml", CONFIG)]);
    for (bytes, name) in foreign() {
        for ending in ["other", "other.obj", "other.toml"] {
            std::fs::write(folder.path(ending), &bytes).expect("a file");
            has(&message_of(&folder, &["render", ending]), &[name, "which raycl does not read", "help"]);
        }
        has(&message_of(&folder, &["run", "other"]), &[name, "help"]);
        has(&message_of(&folder, &["render", "scene.toml"]), &["scene.toml:15", name, "help"]);
        has(&message_of(&folder, &["run", "config.toml"]), &["config.toml:3", name, "help"]);
    }
}

#[test]
fn scenes_meshes_and_experiments_are_distinguished() {
    let config = CONFIG.replace("other", "scene.toml");
    let scene = "[[object]]\nobj = \"config.toml\"\n";
    let files = [("scene.toml", TRIANGLE), ("mesh.obj", MESH), ("config.toml", &config), ("odd.toml", scene)];
    let folder = WorkFolder::with(&files);
    has(
        &message_of(&folder, &["run", "scene.toml"]),
        &["a scene, not an experiment", "`raycl render scene.toml`"],
    );
    has(
        &message_of(&folder, &["run", "mesh.obj"]),
        &["an OBJ mesh, not an experiment", "`raycl render mesh.obj`"],
    );
    has(
        &message_of(&folder, &["render", "config.toml"]),
        &["an experiment, not a scene", "`raycl run config.toml`"],
    );
    has(
        &message_of(&folder, &["render", "odd.toml"]),
        &["odd.toml:2", "config.toml is a TOML file, not a mesh"],
    );
}

#[test]
fn a_file_is_read_by_what_it_holds_and_that_is_said() {
    let folder = WorkFolder::with(&[("mesh.txt", MESH), ("scene.obj", TRIANGLE), ("mesh", MESH)]);
    let device = device();
    let render =
        |name| folder.output(&["render", name, "--width", "16", "--height", "10", "--device", &device]);
    has(&render("mesh.txt"), &["note      mesh.txt: read as an OBJ mesh"]);
    has(&render("scene.obj"), &["note      scene.obj: read as a scene (TOML)"]);
    assert!(!render("mesh").contains("note      mesh"));
}

#[test]
fn a_binary_stl_whose_length_does_not_match_its_count_is_known_by_its_name() {
    let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0_f32];
    let triangle =
        [[0; 12].to_vec(), corners.iter().flat_map(|x| x.to_le_bytes()).collect(), vec![0; 2]].concat();
    let file = |count: u8| [&[0; 80][..], &[count, 0, 0, 0], &triangle, &[0]].concat();
    let folder = WorkFolder::with(&[("a.txt", "")]);
    for (name, count) in [("a.stl", 1), ("b.stl", 2), ("c.obj", 1)] {
        std::fs::write(folder.path(name), file(count)).expect("a file");
    }
    let device = device();
    let render = ["render", "a.stl", "--width", "16", "--height", "10", "--device", &device];
    has(&folder.output(&render), &["1 byte after the last triangle is ignored"]);
    has(&message_of(&folder, &["render", "b.stl"]), &["the header says 2 triangles, but the file holds 1"]);
    has(&message_of(&folder, &["render", "c.obj"]), &["a binary file of an unknown kind"]);
}

#[test]
fn empty_files_and_other_text() {
    let text = "Notes on my scene\nand more\n";
    let folder = WorkFolder::with(&[("a.toml", " \n"), ("a.txt", text), ("a.obj", "")]);
    has(&message_of(&folder, &["render", "a.toml"]), &["a.toml is empty", "[[object]]"]);
    has(&message_of(&folder, &["run", "a.toml"]), &["a.toml is empty", "configs/quick.toml"]);
    has(
        &message_of(&folder, &["render", "a.txt"]),
        &["a.txt:1", "neither a scene (TOML) nor a mesh", "raycl reads"],
    );
    has(&folder.mistake(&["run", "a.txt"], 2), &["a.txt:1", "not TOML", "reads experiments (TOML)"]);
    has(&folder.mistake(&["render", "a.obj"], 2), &["a.obj:1", "the file is empty", "`f 1 2 3`"]);
    for (name, format) in
        [("a.ply", "a PLY mesh"), ("a.stl", "an STL mesh"), ("a.glb", "a binary glTF scene")]
    {
        std::fs::write(folder.path(name), "").expect("a file");
        has(
            &message_of(&folder, &["render", name]),
            &[&format!("{name} is empty; expected {format}"), "help"],
        );
    }
}

#[test]
fn no_long_line_of_a_file_is_printed() {
    let long = "A".repeat(140_000);
    let text = [
        format!("[camera]\nz_near = \"{long}\"\n"),
        format!("# x\n{long} = 1\n"),
        format!("# {long}\nx = 1\n# {long}\n"),
        format!("x = 1 {long}\n"),
        format!("[[object]]\nshape = \"{long}\"\n"),
        format!("[[object]]\nobj = \"{long}\"\n"),
        format!("question = \"{long}\"\nx = 1\n"),
    ];
    for text in text {
        let folder = WorkFolder::with(&[("a.toml", &text)]);
        for command in ["render", "run"] {
            let message = folder.mistake(&[command, "a.toml"], 2);
            assert!(message.lines().all(|line| line.chars().count() < 450), "{text:.40}: {message:.2000}");
        }
    }
}

#[test]
fn what_a_mesh_asks_for_is_noted_in_text_json_and_a_run() {
    let mesh = format!("mtllib m.mtl\nusemtl a\n{MESH}l 1 2\n");
    let scene = "[[object]]\nobj = \"mesh.obj\"\n[[object]]\nobj = \"mesh.obj\"\n[[light]]\nposition = [1, 3, 1]\npower = 1\n";
    let config = CONFIG.replace("other", "scene.toml");
    let files = [
        ("mesh.obj", &*mesh),
        ("m.mtl", "newmtl a\nmap_Ks a.png\n"),
        ("scene.toml", scene),
        ("c.toml", &config),
    ];
    let folder = WorkFolder::with(&files);
    let (device, textures) = (device(), "mesh.obj: 1 material asks for textures (map_Ks)");
    let render = ["render", "scene.toml", "--width", "16", "--height", "10", "--device", &device];
    let text = folder.output(&render);
    has(&text, &[&format!("note      {textures}"), "1 statement asks for lines (l)"]);
    assert_eq!(
        text.matches("note      mesh.obj").count(),
        2,
        "each note on a mesh of two objects is printed once: {text}"
    );
    let json: serde_json::Value =
        serde_json::from_str(&folder.output(&[&render[..], &["--json"]].concat())).expect("JSON");
    has(json["notes"][1].as_str().expect("a note"), &[textures]);
    let bands = ["--devices", &device, "--json"];
    let json: serde_json::Value =
        serde_json::from_str(&folder.output(&[&render[..6], &bands].concat())).expect("JSON");
    has(json["notes"][1].as_str().expect("a note"), &[textures]);
    has(&folder.output(&["run", "c.toml", "--dry-run", "--device", &device]), &[textures]);
}
