//! Of the files that are named, raycl reads only ordinary ones, up to a maximum size. Messages of raycl show only text
//! of files that the user named, or that lie in the same folder as the file that names them.

use crate::binary::{TRIANGLE, WorkFolder, device, has};
use rustix::fs::{CWD, FileType, Mode, mknodat};

/// A word in files of these tests. No message of raycl may show this word, unless the user named the file, or the file
/// lies in the same folder as the file that names it.
const SECRET: &str = "hunter2";

const CONFIG: &str = r#"question = "?"
expectation = "!"
scenes = ["scene.toml"]
image_sizes = [[8, 5]]
local_sizes = [4]
strategies = ["naive"]
"#;

/// Writes a file, and beside it a folder `inner` with a scene or a config that names the file.
fn folder_with(outer: (&str, &str), inner: (&str, &str)) -> WorkFolder {
    let folder = WorkFolder::with(&[outer]);
    std::fs::create_dir(folder.path("inner")).expect("a folder");
    std::fs::write(folder.path("inner").join(inner.0), inner.1).expect("a file");
    folder
}

fn object(file: &str) -> String {
    format!("[[object]]\nobj = \"{file}\"\n")
}

#[test]
fn memory_beyond_a_limit_of_the_address_space_is_not_available() {
    let scene = "[[object]]\nshape = \"terrain\"\ntriangles = 16_000_000\n";
    let folder = WorkFolder::with(&[("scene.toml", scene)]);
    let program = crate::binary::program();
    let mut limited = std::process::Command::new("sh");
    limited.args(["-c", "ulimit -v 1000000; exec \"$@\"", "sh"]).arg(program.get_program());
    limited.arg("render").arg(folder.path("scene.toml")).arg("--output").arg(folder.path("picture.png"));
    let output = crate::binary::run(&mut limited);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    has(&said, &["needs about 1.1 GB", "according to /proc/self/limits"]);
}

#[test]
fn pipes_and_devices_are_refused_at_once_wherever_a_file_is_named() {
    let folder = WorkFolder::with(&[
        ("scene.toml", TRIANGLE),
        ("zero.toml", &object("/dev/zero")),
        ("piped.toml", &object("pipe")),
        ("config.toml", &CONFIG.replace("scene.toml", "pipe")),
    ]);
    mknodat(CWD, folder.path("pipe"), FileType::Fifo, Mode::RWXU, 0).expect("a pipe");
    for file in ["/dev/zero", "/dev/stdin", "pipe"] {
        for command in ["render", "run"] {
            has(&folder.mistake(&[command, file], 2), &[file, "expected an ordinary file", "help:"]);
        }
        has(&folder.mistake(&["render", file], 2), &["COMMAND | raycl render -"]);
        let compared = folder.mistake(&["compare-images", file, file], 2);
        has(&compared, &[file, "expected an ordinary file", "help:"]);
    }
    for (command, file) in [("render", "zero.toml"), ("render", "piped.toml"), ("run", "config.toml")] {
        has(&folder.mistake(&[command, file], 2), &["help:"]);
    }
}

#[test]
fn a_pipe_with_the_name_of_a_frame_is_refused_at_once() {
    let (folder, device) = (WorkFolder::with(&[("scene.toml", TRIANGLE)]), device());
    mknodat(CWD, folder.path("a-0001.png"), FileType::Fifo, Mode::RWXU, 0).expect("a pipe");
    for force in [&[][..], &["--force"]] {
        let turn = ["render", "scene.toml", "--turntable", "2", "-o", "a.png", "--device", &device];
        let message = folder.mistake(&[&turn[..], force].concat(), 2);
        has(&message, &["'a-0001.png' is not an ordinary file, and is not replaced"]);
    }
}

#[test]
fn what_is_too_large_is_refused_with_the_limit() {
    let folder = WorkFolder::with(&[
        ("scene.toml", TRIANGLE),
        ("mesh.obj", "mtllib large.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ]);
    let file = std::fs::File::create(folder.path("large.toml")).expect("a file");
    std::io::Write::write_all(&mut &file, b"name = \"x\"\n").expect("a line");
    file.set_len((16 << 20) + 1).expect("a long file");
    for command in ["render", "run"] {
        has(
            &folder.mistake(&[command, "large.toml"], 2),
            &["large.toml", "a TOML file may have at most 16 MiB"],
        );
    }
    std::fs::create_dir_all(folder.path("cl/cast")).expect("a folder");
    std::fs::write(folder.path("cl/cast/shade.cl"), vec![b'/'; (1 << 20) + 1]).expect("a file");
    let kernel = folder.mistake(&["kernel", "naive", "--cl-dir", "cl"], 2);
    has(&kernel, &["shade.cl", "a kernel file may have at most 1 MiB"]);
}

#[test]
fn text_of_a_mesh_elsewhere_is_not_shown() {
    let [secret, vertex, face] = [
        format!("root:{SECRET}:1:\nnext\n"),
        format!("v 0 {SECRET} 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        format!("v 0 0 0\nf 1 1 {SECRET}\n"),
    ];
    for (text, line) in [
        (&secret, "3: expected a mesh"),
        (&vertex, "1: expected `v x y z`"),
        (&face, "2: expected `f 1 2 3`"),
    ] {
        let folder = folder_with(("outer.obj", text), ("scene.toml", &object("../outer.obj")));
        let said = folder.mistake(&["render", "inner/scene.toml"], 2);
        has(&said, &["outer.obj", line, "help:", "not shown"]);
        assert!(!said.contains(SECRET), "{said}");
        // Messages may show the text of a file that the user named.
        if !text.starts_with("root") {
            has(&folder.mistake(&["render", "outer.obj"], 2), &[SECRET]);
        }
        std::fs::write(folder.path("beside.toml"), object("outer.obj")).expect("a scene");
        if !text.starts_with("root") {
            has(&folder.mistake(&["render", "beside.toml"], 2), &[SECRET]);
        }
    }
}

#[test]
fn text_of_a_scene_elsewhere_is_not_shown() {
    let [key, value, syntax, shape] = [
        (format!("{SECRET} = 1\n"), "1: expected one of `name`"),
        (format!("shadow_bias = \"{SECRET}\"\n"), "1: expected a finite number"),
        (format!("name = 1\n= {SECRET} =\n"), "2"),
        (
            format!("[[object]]\nshape = \"{SECRET}\"\n"),
            "2: a mistake in this line (not a shape); `raycl render ",
        ),
    ];
    for (text, line) in [key, value, syntax, shape] {
        let folder = folder_with(
            ("outer.toml", &text),
            ("config.toml", &CONFIG.replace("scene.toml", "../outer.toml")),
        );
        let said = folder.mistake(&["run", "inner/config.toml", "--dry-run"], 2);
        has(&said, &["outer.toml", line, "help:"]);
        assert!(!said.contains(SECRET), "{said}");
        has(&folder.mistake(&["render", "outer.toml"], 2), &[SECRET]);
    }
}

#[test]
fn words_of_a_mesh_elsewhere_are_in_no_note() {
    let mesh =
        format!("{SECRET} 1\nmtllib {SECRET}.mtl\nusemtl {SECRET}\nv 0 0 -1\nv 1 0 -1\nv 0 1 -1\nf 1 2 3\n");
    let folder = folder_with(("outer.obj", &mesh), ("scene.toml", &object("../outer.obj")));
    let notes = |path: &str| raycl::scene::load_scene(&folder.path(path)).expect("a scene").notes.join("\n");
    let (notes_of_scene, notes_of_mesh) = (notes("inner/scene.toml"), notes("outer.obj"));
    assert!(!notes_of_scene.contains(SECRET), "{notes_of_scene}");
    assert_eq!(
        notes_of_scene.lines().filter(|note| note.contains("outer.obj")).count(),
        3,
        "{notes_of_scene}"
    );
    assert_eq!(notes_of_mesh.matches(SECRET).count(), 3, "{notes_of_mesh}");
}

#[test]
fn kernels_that_include_themselves_or_lie_elsewhere_are_refused() {
    let folder = WorkFolder::with(&[("outer.cl", SECRET)]);
    std::fs::create_dir_all(folder.path("cl/cast")).expect("a folder");
    let refused = |text: &str| {
        std::fs::write(folder.path("cl/cast/shade.cl"), text).expect("a file");
        folder.mistake(&["kernel", "naive", "--cl-dir", "cl"], 2)
    };
    has(&refused("#include \"cast/shade.cl\"\n"), &["cast/shade.cl includes cast/shade.cl", "help:"]);
    has(&refused("#include \"cast/entry.cl\"\n"), &["a kernel file includes itself", "help:"]);
    for (text, said) in [
        ("#include \"../outer.cl\"\n", "lies outside"),
        ("#include \"/etc/passwd\"\n", "lies outside"),
        ("# include \"../outer.cl\"\n", "does not support this form of #include"),
        ("#include </etc/passwd>\n", "does not support this form of #include"),
        ("/**/ #include \"/etc/passwd\"\n", "does not support this form of #include"),
        ("#\\\ninclude \"/etc/passwd\"\n", "does not support this form of #include"),
        ("/* a comment\n", "cl/cast/shade.cl, line 1: this comment has no end"),
    ] {
        let message = refused(text);
        has(&message, &[said, "help:"]);
        assert!(!message.contains(SECRET) && !message.contains("root:"), "{message}");
    }
}

#[test]
fn values_that_leave_single_precision_are_refused_with_their_line() {
    let scene = |from: &str, to: &str| {
        assert!(TRIANGLE.contains(from));
        let folder = WorkFolder::with(&[("scene.toml", &TRIANGLE.replace(from, to))]);
        folder.mistake(&["render", "scene.toml"], 2)
    };
    let faces = "faces = [[0, 1, 2]]";
    for (from, to, said) in [
        ("power = 10", "power = 3e38", &["scene.toml:8", "from 0 to 1e28"][..]),
        (
            "[[object]]",
            "[[light]]\nposition = [0, 0, -2]\npower = 1e28\n\n[[object]]\nmaterial = { k_l = 1e6 }",
            &["scene.toml:12", "a light with the power", "single precision"],
        ),
        (faces, "faces = [[0, 1, 2]]\nmaterial = { k_l = 3e38 }", &["scene.toml:13", "from 0 to 1e6"]),
        (
            faces,
            "faces = [[0, 1, 2]]\nmaterial = { k_g = 1, shininess = 1e30 }",
            &["scene.toml:13", "from 0 to 1e6"],
        ),
        (faces, "faces = [[0, 1, 2]]\ntranslation = [1e13, 0, 0]", &["scene.toml:10", "within +-1e12"]),
        ("[1, 3, 1]", "[1e13, 3, 1]", &["scene.toml:7", "a light is at", "within +-1e12"]),
    ] {
        let message = scene(from, to);
        has(&message, said);
        has(&message, &["help:"]);
    }
}

#[test]
fn values_of_a_material_file_that_leave_single_precision_are_ignored_with_a_note() {
    let device = crate::binary::device();
    let small = ["--width", "16", "--height", "10", "--device", &device];
    let mesh = "mtllib a.mtl\nusemtl x\nv 0 1 -2\nv -1.9 -1 -2\nv 1.6 -0.5 -2\nf 1 2 3\n";
    for (line, said) in
        [("Kd 3e38", "`3e38` in Kd"), ("Ks 1 2 1e7", "`1e7` in Ks"), ("Ns 1e7", "`1e7` in Ns")]
    {
        let folder = WorkFolder::with(&[("a.obj", mesh), ("a.mtl", &format!("newmtl x\n{line}\n"))]);
        let text = folder.output(&[&["render", "a.obj"][..], &small].concat());
        has(&text, &["a.mtl:2: ", said, "from 0 to 1e6", "raycl ignores 1 such line"]);
    }
}

#[test]
fn a_picture_that_is_not_finite_is_a_failed_run_that_names_its_pixel() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let device = crate::binary::device();
    let from = "working_set(working, INCOMING, scale(splat(LOAD3(at + 3)), spread));";
    folder.kernels(
        "cast/shade.cl",
        from,
        "working_set(working, INCOMING, scale(splat(LOAD3(at + 3)), 1.0f / 0.0f));",
    );
    let render =
        ["render", "scene.toml", "--cl-dir", "kernels", "--strategy", "naive", "--local-size", "8x8"];
    let size = ["--width", "40", "--height", "30", "--device", &device];
    let said = folder.mistake(&[&render[..], &size, &["--quiet"]].concat(), 1);
    has(&said, &["pixels are not finite; the first, (", "inf", "help:", "scene.png"]);
    let said = folder.mistake(&[&render[..], &size, &["--turntable", "2"]].concat(), 1);
    has(&said, &["pixels are not finite", "help:", "frame 1 was not written"]);
}

#[test]
fn a_journal_with_damaged_lines_is_shown_reported_and_repaired() {
    let folder = WorkFolder::new();
    std::fs::create_dir(folder.path("out")).expect("a folder");
    let record = serde_json::to_string(&raycl::record::Record { key: "a".into(), ..Default::default() })
        .expect("JSON");
    let text = format!("{record}\nrubbish \u{1b}]0;x\u{7}\n{record}\n");
    std::fs::write(folder.path("out/records.jsonl"), &text).expect("a journal");
    let reported = folder.raycl(&["report", "out"]).output().expect("raycl starts");
    let notes = String::from_utf8_lossy(&reported.stderr);
    has(&notes, &["note: out: raycl ignores 1 damaged line of records.jsonl; the first is line 2."]);
    assert!(reported.status.success() && !notes.contains('\u{1b}'), "{notes}");
    let quiet = folder.raycl(&["report", "out", "--quiet"]).output().expect("raycl starts");
    assert_eq!(String::from_utf8_lossy(&quiet.stderr), "");
    has(
        &folder.text("out/summary.md"),
        &["raycl ignores 1 damaged line of records.jsonl; the first is line 2."],
    );
    has(
        &folder.output(&["repair", "out"]),
        &["records.jsonl: removed damaged lines: 1, lines kept: 2", "records.jsonl.damaged-1"],
    );
    assert_eq!(folder.text("out/records.jsonl"), format!("{record}\n{record}\n"));
    assert_eq!(folder.text("out/records.jsonl.damaged-1"), text);
    has(&folder.output(&["repair", "out"]), &["no line is damaged"]);
    // `raycl repair` can repair only journals (files with one record or sample per line), so the remedy for any other
    // damaged file is to delete it.
    std::fs::write(folder.path("out/peak.json"), "no rates").expect("a file");
    let damaged = [
        "out/peak.json does not contain peak rates: ",
        "line 1",
        "; delete the file; then measure the rates again, with `raycl run",
    ];
    let reported = folder.raycl(&["report", "out"]).output().expect("raycl starts");
    has(&String::from_utf8_lossy(&reported.stderr), &damaged);
    let repaired = folder.output(&["repair", "out"]);
    has(&repaired, &damaged);
    assert!(!repaired.contains("no line is damaged"), "{repaired}");
    has(&folder.mistake(&["repair", "nowhere"], 2), &["there is no folder nowhere", "help:"]);
}

#[test]
fn nothing_of_a_name_steers_a_terminal() {
    let hostile = "\u{1b}]0;title\u{7}\u{9b}2J";
    let name = format!("{hostile}.toml");
    let steers = |text: &str| text.contains(|c: char| c.is_control() && c != '\n');
    let folder = WorkFolder::with(&[
        (&name, "name = "),
        (
            "a.toml",
            &object(
                &format!("{hostile}.obj")
                    .escape_default()
                    .to_string()
                    .replace("\\u{1b}", "\\u001b")
                    .replace("\\u{7}", "\\u0007")
                    .replace("\\u{9b}", "\\u009b"),
            ),
        ),
        ("named.toml", &TRIANGLE.replace("little", "\\u001b]0;title\\u0007")),
    ]);
    for file in [&name, "a.toml", &format!("{hostile}.obj"), &format!("{hostile}.png")] {
        for command in ["render", "run", "repair"] {
            let said = folder.mistake(&[command, file], 2);
            assert!(!steers(&said), "{said:?}");
        }
    }
    let device = crate::binary::device();
    let said =
        folder.output(&["render", "named.toml", "--width", "16", "--height", "10", "--device", &device]);
    assert!(!steers(&said) && said.contains("\\u001b]0;title\\u0007"), "{said:?}");
}
