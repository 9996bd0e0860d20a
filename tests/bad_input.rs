//! Messages about mistakes of the user: the exit code, the file and line, and the remedy.

use crate::binary::{TRIANGLE, WorkFolder, has, program, run};

/// Renders a `scene.toml` with this text, checks that rendering fails, and returns the message.
fn scene_mistake(text: &str) -> String {
    WorkFolder::with(&[("scene.toml", text)]).mistake(&["render", "scene.toml"], 2)
}

/// Renders a `mesh.obj` with this text, checks that rendering fails, and returns the message.
fn mesh_mistake(text: &str) -> String {
    WorkFolder::with(&[("mesh.obj", text)]).mistake(&["render", "mesh.obj"], 2)
}

/// Renders a correct scene with these arguments, checks that the command fails and writes no picture, and returns the
/// message.
fn argument_mistake(arguments: &[&str]) -> String {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let message = folder.mistake(&[&["render", "scene.toml"], arguments].concat(), 2);
    assert!(!folder.path("scene.png").exists());
    message
}

/// A small experiment on `scene.toml`.
const CONFIG: &str = r#"question = "?"
expectation = "!"
scenes = ["scene.toml"]
image_sizes = [[8, 5]]
local_sizes = [4]
strategies = ["naive"]
"#;

/// Runs CONFIG with a part of its text replaced, checks that the run fails and writes nothing, and returns the message.
fn config_mistake(from: &str, to: &str) -> String {
    assert!(CONFIG.contains(from));
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("config.toml", &CONFIG.replace(from, to))]);
    let message = folder.mistake(&["run", "config.toml", "--out", "out"], 2);
    assert!(!folder.path("out").exists());
    message
}

#[test]
fn a_misspelt_key_of_a_scene() {
    let message = scene_mistake(&TRIANGLE.replace("z_near", "z_naer"));
    has(&message, &["scene.toml:4", "z_naer", "did you mean `z_near`"]);
    let message = scene_mistake(&TRIANGLE.replace("[[light]]", "[[lamp]]"));
    has(&message, &["scene.toml:6", "`lamp`", "the valid keys here are", "light"]);
}

#[test]
fn a_misspelt_key_of_an_experiment() {
    let message = config_mistake("strategies", "stratgies");
    has(&message, &["config.toml:6", "unknown key 'stratgies'", "did you mean 'strategies'"]);
}

#[test]
fn a_wrong_type() {
    let message = scene_mistake(&TRIANGLE.replace("z_near = 0.1", "z_near = \"near\""));
    has(&message, &["scene.toml:4", "wrong type: string \"near\"", "expected a finite number of at least 0"]);
    let message = config_mistake("local_sizes = [4]", "local_sizes = \"4\"");
    has(&message, &["config.toml:5", "wrong type: string \"4\"", "expected a list"]);
}

#[test]
fn a_missing_file_is_answered_with_the_nearest() {
    let files = [("scene.toml", TRIANGLE), ("config.toml", CONFIG), ("house.mtl", ""), ("house.obj", "")];
    let folder = WorkFolder::with(&files);
    has(&folder.mistake(&["render", "secne.toml"], 2), &["secne.toml", "did you mean `scene.toml`"]);
    has(&folder.mistake(&["render", "house.mlt"], 2), &["house.mlt", "did you mean `house.obj`"]);
    has(&folder.mistake(&["run", "confg.toml"], 2), &["confg.toml", "did you mean `config.toml`"]);
    has(&folder.mistake(&["run", "nothing-like-it"], 2), &["nothing-like-it", "configs/quick.toml"]);
    let message = config_mistake("\"scene.toml\"", "\"scene.tml\"");
    has(&message, &["config.toml:3", "scene.tml", "did you mean scene.toml"]);
}

#[test]
fn a_missing_mesh_is_answered_with_the_nearest() {
    let text = "[[object]]\nobj = \"tepot.obj\"\n";
    let folder = WorkFolder::with(&[("scene.toml", text), ("teapot.obj", "")]);
    let message = folder.mistake(&["render", "scene.toml"], 2);
    has(&message, &["scene.toml:2", "no mesh file `tepot.obj`", "did you mean `teapot.obj`", "relative"]);
}

#[test]
fn a_negative_size() {
    has(&argument_mistake(&["--width", "-5"]), &["-5", "--width", "a whole number from 1 to 65536"]);
    has(&argument_mistake(&["--height=-5"]), &["-5", "--height", "a whole number from 1 to 65536"]);
    has(&argument_mistake(&["--local-size", "8x-8"]), &["8x-8", "WIDTHxHEIGHT", "16x8"]);
    let message = config_mistake("[[8, 5]]", "[[8, -5]]");
    has(&message, &["config.toml:4", "image size -5", "expected a whole number from 1 to 65536"]);
    let message = config_mistake("local_sizes = [4]", "local_sizes = [-4]");
    has(&message, &["config.toml:5", "local size -4", "expected a whole number from 1 to 4096"]);
    let message = scene_mistake(&TRIANGLE.replace("z_near = 0.1", "z_near = -0.1"));
    has(&message, &["scene.toml:4", "-0.1 is not a finite number of at least 0"]);
}

#[test]
fn an_image_that_the_device_cannot_hold() {
    let message = argument_mistake(&["--width", "65536", "--height", "65536", "--strategy", "deferred"]);
    has(&message, &["largest buffer: image 16 B x 4294967296 pixels = 68719476736 B > ", "smaller image"]);
}

#[test]
fn a_scene_without_light_is_rendered_with_a_remark() {
    let dark = TRIANGLE.replace("[[light]]\nposition = [1, 3, 1]\npower = 10\n", "");
    let folder = WorkFolder::with(&[("scene.toml", &dark)]);
    let small =
        ["render", "scene.toml", "--width", "16", "--height", "10", "--device", &crate::binary::device()];
    let small = [&small[..], &["--strategy", "deferred"]].concat();
    has(&folder.output(&small), &["note", "scene.toml:", "no light", "add [[light]] with position"]);
    assert!(folder.path("scene.png").exists());
    let json: serde_json::Value =
        serde_json::from_str(&folder.output(&[&small[..], &["--json"]].concat())).expect("JSON");
    has(json["notes"][0].as_str().expect("a note"), &["no light"]);
    assert_eq!(json["shadow_rays_per_s"], 0.0);
}

#[test]
fn an_obj_without_triangles() {
    has(&mesh_mistake(""), &["mesh.obj:1", "no triangles", "`f 1 2 3`"]);
    has(&mesh_mistake("v 0 0 0\nv 1 0 0\n"), &["mesh.obj:3", "2 vertices and no face", "`f 1 2 3`"]);
}

#[test]
fn nan_in_an_obj() {
    let message = mesh_mistake("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n");
    has(&message, &["mesh.obj:3", "`nan` in a vertex", "expected a finite decimal number"]);
}

#[test]
fn values_of_an_obj_that_are_not_valid_and_not_needed_are_remarked_on() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 inf 1\nv nan 0 0\nf 1//1 2//1 3//1\n";
    let folder = WorkFolder::with(&[("mesh.obj", text)]);
    let device = crate::binary::device();
    let text = folder.output(&["render", "mesh.obj", "--width", "16", "--height", "10", "--device", &device]);
    has(
        &text,
        &[
            "mesh.obj: line 4: `inf` in a normal; expected a finite decimal number",
            "1 such normal is ignored",
            "mesh.obj: line 5: `nan` in a vertex; expected a finite decimal number",
            "1 such vertex that no face uses is ignored",
        ],
    );
}

#[test]
fn a_normal_index_that_does_not_exist() {
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n";
    // Incorrect faces that some exporters write and other programs accept cause only a note.
    let device = crate::binary::device();
    let folder =
        WorkFolder::with(&[("mesh.obj", &format!("{corners}f 1//1 2//1 3//2\nf 1//0 2//1 3//1\nf 1 2\n"))]);
    let text = folder.output(&["render", "mesh.obj", "--width", "16", "--height", "10", "--device", &device]);
    has(
        &text,
        &[
            "mesh.obj: line 5: 2 faces name normals (vn) that do not exist in the file",
            "line 7: 1 face of fewer than three corners is left out",
        ],
    );
    let message = scene_mistake(&TRIANGLE.replace(
        "faces = [[0, 1, 2]]",
        "faces = [[0, 1, 2]]\nnormals = [[0, 0, 1]]\nface_normals = [[0, 0, 1]]",
    ));
    has(&message, &["scene.toml:14", "normal 1 does not exist", "expected 0 to 0"]);
}

#[test]
fn a_normal_index_that_is_left_out_is_remarked_on() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3\n";
    let folder = WorkFolder::with(&[("mesh.obj", text)]);
    let device = crate::binary::device();
    let text = folder.output(&["render", "mesh.obj", "--width", "16", "--height", "10", "--device", &device]);
    has(&text, &["mesh.obj: line 5", "a normal index at some corners only", "`f 1//1 2//1 3//1`"]);
}

#[test]
fn a_vertex_that_does_not_exist() {
    let message = scene_mistake(&TRIANGLE.replace("[[0, 1, 2]]", "[[0, 1, 9]]"));
    has(&message, &["scene.toml:12", "vertex 9 does not exist", "expected 0 to 2"]);
}

#[test]
fn unknown_names_are_answered_with_the_nearest() {
    has(&argument_mistake(&["--strategy", "naiv"]), &["'naiv' is not a preset", "did you mean 'naive'"]);
    let message = argument_mistake(&["--strategy", "naive,vectros=local"]);
    has(&message, &["'vectros' is not an axis", "did you mean 'vectors'"]);
    let message = argument_mistake(&["--strategy", "naive,vectors=lokal"]);
    has(&message, &["'lokal' is not a value of the axis 'vectors'", "did you mean 'local'"]);
    has(&argument_mistake(&["--set", "wdith=4"]), &["'wdith' is neither", "did you mean 'width'"]);
    let message = argument_mistake(&["--set", "local_size=8"]);
    has(&message, &["'local_size' is neither", "local_size is an option: --local-size 8"]);
    has(&argument_mistake(&["--set", "camera.positoin=1"]), &["`positoin`", "did you mean `position`"]);
    let message = argument_mistake(&["--set", "light.0.power=-3"]);
    has(&message, &["--set light.0.power=-3: -3 is not a number from 0 to 1e28", "help:"]);
    let message = argument_mistake(&["--device", "portabel"]);
    has(&message, &["no device matches 'portabel'", "did you mean 'portable'", "The devices are:"]);
    let message = config_mistake("[\"naive\"]", "[\"navie\"]");
    has(&message, &["config.toml:6", "'navie' is not a preset", "did you mean 'naive'"]);
    let message = config_mistake("[\"naive\"]", "[\"naive\"]\ndevices = [\"portabel\"]");
    has(&message, &["config.toml:7: no device matches 'portabel'", "did you mean 'portable'"]);
}

#[test]
fn axes_that_contradict_each_other() {
    let message = argument_mistake(&["--strategy", "naive,triangles=tiled"]);
    has(&message, &["shading = eager with triangles = tiled", "barrier", "raycl strategies"]);
    let message = argument_mistake(&["--strategy", "watertight", "--set", "math=fast"]);
    has(&message, &["watertight needs exact signs", "`math=strict` allows it", "raycl strategies"]);
    let entry = "[[strategy]]\npreset = \"watertight\"\nmath = \"fast\"\n";
    let message = config_mistake("strategies = [\"naive\"]\n", entry);
    has(
        &message,
        &["config.toml:6", "watertight needs exact signs", "math = \"strict\" allows it; or change one"],
    );
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_any_work() {
    has(&argument_mistake(&["-o", "a.pgn"]), &["'a.pgn'", ".exr", "did you mean 'a.png'"]);
    has(&argument_mistake(&["-o", "a.png/"]), &["'a.png/' names a folder"]);
    has(&argument_mistake(&["-o", "."]), &["name the file './picture.png'"]);
    has(&argument_mistake(&["-o", "nowhere/a.png"]), &["no folder 'nowhere'", "mkdir"]);
    // The output is checked before the scene is read: the message does not mention the missing scene.
    let message = WorkFolder::new().mistake(&["render", "no-scene.toml", "-o", "nowhere/a.png"], 2);
    has(&message, &["no folder 'nowhere'"]);
}

#[test]
fn a_picture_in_a_deleted_folder_is_refused_before_any_work() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let raycl = program();
    let mut bash = std::process::Command::new("bash");
    bash.args(["-c", "mkdir gone && cd gone && rmdir ../gone && exec \"$@\"", "bash"]);
    bash.arg(raycl.get_program()).arg("render").arg(folder.path("scene.toml")).args(["-o", "t.png"]);
    bash.envs(raycl.get_envs().filter_map(|(name, value)| Some((name, value?))));
    // If `OCL_ICD_VENDORS` names a folder that does not exist, no driver is found, so a command that began to
    // work would fail with another message.
    let output = run(bash.current_dir(folder.path("")).env("OCL_ICD_VENDORS", "/nonexistent"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    has(&said, &["cannot write 't.png': the current folder no longer exists", "change to a folder"]);
}

#[test]
fn an_image_larger_than_memory_is_refused_with_arithmetic() {
    let message =
        argument_mistake(&["--width", "65536", "--height", "65536", "--device", &crate::binary::device()]);
    has(&message, &["cannot cast this frame: largest buffer: image 16 B x 4294967296 pixels", " B > "]);
}

#[test]
fn a_local_size_that_no_device_holds_is_refused_with_arithmetic() {
    let message = argument_mistake(&["--local-size", "4096x4096", "--device", &crate::binary::device()]);
    has(&message, &["4096 x 4096 = 16777216 work-items > the device's"]);
}

#[test]
fn a_folder_of_kernels_that_is_not_there() {
    let message = argument_mistake(&["--cl-dir", "nowhere"]);
    has(&message, &["cannot read nowhere", "laid out like raycl's cl/"]);
}

#[test]
fn a_kernel_that_does_not_compile_shows_the_compilers_words() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let kernels = folder.kernels("cast/shade.cl", "// Computes", "oops;\n// Computes");
    let device = crate::binary::device();
    let render =
        ["render", "scene.toml", "--device", &device, "--strategy", "deferred", "--cl-dir", &kernels];
    let message = folder.mistake(&render, 2);
    has(&message, &["does not compile", &format!("{kernels}/cast/shade.cl:1:"), "raycl kernel"]);
    assert!(!message.contains("####"), "{message}");
}

#[test]
fn without_a_platform_every_command_says_so() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("config.toml", CONFIG)]);
    for arguments in [&["render", "scene.toml"], &["run", "config.toml"], &["devices", "--json"]] {
        let mut command = folder.raycl(arguments);
        let output = command.env("OCL_ICD_VENDORS", "/nonexistent").assert().code(1).get_output().clone();
        let message = String::from_utf8(output.stderr).expect("UTF-8");
        has(&message, &["no OpenCL platform", "pocl-opencl-icd", "make setup"]);
    }
}
