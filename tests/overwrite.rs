//! Files that a command would overwrite. Without `--force`, raycl overwrites no file that it did not write, and no file
//! that was changed after raycl wrote it. (In a folder of results, raycl may overwrite every file that has one of
//! raycl's file names.) Reports and comparisons are tested in tests/report.rs.

use crate::binary::{TRIANGLE, WorkFolder, device, has, one_point, until};
use std::io::{BufRead as _, BufReader};
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// The contents of a user's own file.
const MINE: &str = "the only copy";

/// How long a test waits for the next line of a process. Only a process that hangs makes a test wait so long.
const LIMIT: Duration = Duration::from_secs(180);

/// Checks that a command is refused before it loads a driver, that the file is unchanged, and that the message says
/// what to do.
fn refused(folder: &WorkFolder, arguments: &[&str], file: &str, parts: &[&str]) {
    let before = std::fs::read(folder.path(file)).expect("a file");
    let mut command = folder.raycl(arguments);
    let output = command.env("OCL_ICD_VENDORS", "/nonexistent").assert().code(2).get_output().clone();
    let message = String::from_utf8(output.stderr).expect("UTF-8");
    has(&message, &[file, "`--force` ", " writes elsewhere"]);
    has(&message, parts);
    assert!(std::fs::read(folder.path(file)).expect("a file") == before, "{file} was touched");
}

const STRANGE: &str = "raycl did not make it";
const CHANGED: &str = "has been changed since raycl made it";

/// Runs `raycl render` with these arguments.
fn render(folder: &WorkFolder, more: &[&str]) {
    let device = device();
    let size = ["render", "--quiet", "--device", &device, "--width", "24", "--height", "15"];
    folder.output(&[&size, more].concat());
}

#[test]
fn a_texture_beside_its_mesh_stays() {
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let folder = WorkFolder::with(&[("spot.obj", mesh), ("spot.png", MINE)]);
    for more in [&[][..], &["--devices", "all"], &["-o", "spot.png"]] {
        let help = &[STRANGE, "`--force` replaces it", "`-o FILE` writes elsewhere"];
        refused(&folder, &[&["render", "spot.obj"], more].concat(), "spot.png", help);
    }
    render(&folder, &["spot.obj", "--force"]);
    render(&folder, &["spot.obj"]);
    assert!(image::open(folder.path("spot.png")).is_ok());
}

/// If raycl saved a picture at the path of a missing texture, the next picture would show this picture as a texture.
#[test]
fn no_picture_takes_the_place_of_a_missing_texture() {
    let mesh = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
    let device = device();
    for (texture, words) in [("a.png", &[][..]), ("a-0002.png", &["--turntable", "3", "--force"])] {
        let mtl = format!("newmtl a\nmap_Kd {texture}\n");
        let folder = WorkFolder::with(&[("a.obj", mesh), ("a.mtl", &mtl)]);
        let message = folder.mistake(&[&["render", "a.obj", "--device", &device], words].concat(), 2);
        let refusal = format!("'{texture}' is a file of the scene, but does not exist: ");
        has(&message, &[refusal.as_str(), "`-o FILE` writes elsewhere"]);
        assert!(!message.contains("cannot be read"), "{message}");
        assert!(!folder.path(texture).exists() && !folder.path("a-0001.png").exists());
    }
    // The picture's default name is a.png. Here, the scene names another file, so raycl writes a.png.
    let folder = WorkFolder::with(&[("a.obj", mesh), ("a.mtl", "newmtl a\nmap_Kd b.png\n")]);
    render(&folder, &["a.obj"]);
    assert!(image::open(folder.path("a.png")).is_ok());
}

/// Checks that `render` refuses to replace a file of the scene. `words` are the other arguments, separated by blanks;
/// `option` is `--device` or `--devices`.
#[track_caller]
fn stays(folder: &WorkFolder, file: &str, words: &str, option: &str) {
    let (device, before) = (device(), std::fs::read(folder.path(file)).expect("a file"));
    let words: Vec<&str> = words.split(' ').collect();
    let message = folder.mistake(&[&["render"], &words[..], &[option, &device]].concat(), 2);
    let refusal = format!("'{file}' is a file of the scene, and is not replaced");
    has(&message, &[refusal.as_str(), " writes elsewhere"]);
    assert!(std::fs::read(folder.path(file)).expect("a file") == before, "{file} was touched");
}

/// A picture that raycl has made may later become a file of a scene, such as a texture. raycl must then not
/// replace the picture.
#[test]
fn a_file_of_the_scene_stays_even_with_force() {
    let folder = one_point();
    for name in ["mesh.png", "turn-0002.png", "film.png", "sky.exr"] {
        render(&folder, &["scene.toml", "-o", name]);
    }
    std::fs::rename(folder.path("film.png"), folder.path("film.apng")).expect("a new name");
    folder.write("named.png", &folder.text("scene.toml"));
    let textures = ["mesh.png", "turn-0002.png", "film.apng"];
    let materials = textures.map(|name| format!("newmtl {name}\nmap_Kd {name}\n")).concat();
    let faces = textures.map(|name| format!("usemtl {name}\nf 1/1 2/2 3/3\n")).concat();
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";
    // raycl does not use normal maps, but the files of normal maps are files of the scene nevertheless.
    folder.write("d-normal.png", MINE);
    folder.write("mesh.mtl", &format!("{materials}map_Bump -bm 0.5 d-normal.png\n"));
    folder.write("mesh.obj", &format!("mtllib mesh.mtl\n{corners}{faces}"));
    stays(&folder, "mesh.png", "mesh.obj", "--device");
    for (file, words) in [
        ("mesh.png", "mesh.obj"),
        ("named.png", "named.png"),
        ("turn-0002.png", "mesh.obj --turntable 3 -o turn.png"),
        ("film.apng", "mesh.obj --turntable 3 -o film.apng"),
        ("d-normal.png", "mesh.obj -o d-normal.png"),
        ("d-normal.png", "mesh.obj -o out.png --layers d.png"),
        ("sky.exr", "scene.toml --set sky.picture=sky.exr -o sky.exr"),
        ("sky.exr", "scene.toml --set sky.picture=sky.exr --layers sky.exr"),
    ] {
        stays(&folder, file, &format!("{words} --force"), "--device");
    }
    stays(&folder, "mesh.png", "mesh.obj --force", "--devices");
}

/// Returns a scene that is animated for three frames. A value, which is a file's name, changes at frame 3.
fn changing(scene: &str, path: &str, [first, last]: [&str; 2]) -> String {
    let track =
        format!("[[animation.track]]\npath = \"{path}\"\nvalues = [\"{first}\", \"{first}\", \"{last}\"]");
    format!("{scene}\n[animation]\nframes = 3\n{track}\n")
}

#[test]
fn a_file_that_only_a_later_frame_uses_stays_even_with_force() {
    let folder = one_point();
    render(&folder, &["scene.toml", "-o", "f-0002.png"]);
    let corners = "v 0 0 -2\nv 1 0 -2\nv 0 1 -2\nvt 0 0\nvt 1 0\nvt 0 1\n";
    folder.write("plain.obj", &format!("{corners}f 1 2 3\n"));
    folder.write("late.mtl", "newmtl late\nmap_Kd f-0002.png\n");
    folder.write("late.obj", &format!("mtllib late.mtl\n{corners}usemtl late\nf 1/1 2/2 3/3\n"));
    let scene = "[[light]]\nposition = [0, 0, 0]\npower = 9\n[[object]]\nmesh = \"plain.obj\"\n";
    folder.write("mesh.toml", &changing(scene, "object.0.mesh", ["plain.obj", "late.obj"]));
    stays(&folder, "f-0002.png", "mesh.toml --animate -o f.png --force", "--device");
    stays(&folder, "f-0002.png", "mesh.toml --turntable 3 -o f.png --force", "--device");
    assert!(!folder.path("f-0001.png").exists());

    for name in ["early.exr", "film.exr"] {
        render(&folder, &["scene.toml", "-o", name]);
    }
    std::fs::rename(folder.path("film.exr"), folder.path("film.apng")).expect("a new name");
    let sky = format!("[sky]\npicture = \"early.exr\"\n{scene}");
    folder.write("sky.toml", &changing(&sky, "sky.picture", ["early.exr", "film.apng"]));
    stays(&folder, "film.apng", "sky.toml --animate -o film.apng --force", "--device");
}

#[test]
fn pictures_of_every_format_are_replaced_until_somebody_changes_them() {
    let folder = one_point();
    for name in ["a.png", "a.jpg", "a.exr", "a.hdr"] {
        let arguments = ["scene.toml", "-o", name];
        render(&folder, &arguments);
        render(&folder, &[&arguments[..], &["--set", "display.exposure=0.5"]].concat());
        let mut bytes = std::fs::read(folder.path(name)).expect("a picture");
        *bytes.last_mut().expect("a byte") ^= 1;
        std::fs::write(folder.path(name), &bytes).expect("an edit");
        let command = [&["render"], &arguments[..]].concat();
        refused(&folder, &command, name, &[CHANGED]);
        refused(&folder, &[&command[..], &["--devices", "all"]].concat(), name, &[CHANGED]);
        std::fs::write(folder.path(name), MINE).expect("a file");
        refused(&folder, &command, name, &[STRANGE]);
        render(&folder, &[&arguments[..], &["--force"]].concat());
        render(&folder, &arguments);
    }
}

#[test]
fn an_edited_picture_that_kept_its_comment_stays() {
    let folder = one_point();
    render(&folder, &["scene.toml", "-o", "a.png"]);
    let made = std::fs::read(folder.path("a.png")).expect("a picture");
    let chunk = 33..33 + 12 + u32::from_be_bytes(made[33..37].try_into().expect("a length")) as usize;
    assert_eq!(&made[37..41], b"tEXt");
    let mut picture = image::open(folder.path("a.png")).expect("a picture").to_rgb8();
    picture.put_pixel(3, 4, image::Rgb([255, 0, 0]));
    picture.save(folder.path("a.png")).expect("it saves");
    let edited = std::fs::read(folder.path("a.png")).expect("a picture");
    let edited = [&edited[..33], &made[chunk], &edited[33..]].concat();
    std::fs::write(folder.path("a.png"), edited).expect("it writes");
    assert_eq!(image::open(folder.path("a.png")).expect("a picture").to_rgb8(), picture);
    refused(&folder, &["render", "scene.toml", "-o", "a.png"], "a.png", &[CHANGED]);
}

/// A process with `--watch`, which is killed when its test ends, and the lines that it prints.
struct Watching(Child, Receiver<String>);

impl Watching {
    fn start(folder: &WorkFolder, options: &[&str]) -> Self {
        let device = device();
        let mut command = crate::binary::program();
        command.args(["render", "scene.toml", "--watch", "--width", "24", "--height", "15"]);
        command.args(["--device", &device]).args(options).current_dir(folder.path(""));
        command.env("RAYCL_CACHE_MIB", "0").stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("it starts");
        let lines = BufReader::new(child.stderr.take().expect("a pipe")).lines();
        let (sender, receiver) = channel();
        std::thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self(child, receiver)
    }

    /// Waits for a round (one rendering) whose output, up to the line "waiting until a file changes", fulfils
    /// a condition. One change of a file may cause two rounds of rendering.
    fn until(&self, holds: impl Fn(&str) -> bool) {
        let mut said = String::new();
        loop {
            let line = self.1.recv_timeout(LIMIT).unwrap_or_else(|_| panic!("it hangs, and said: {said}"));
            said += &(line + "\n");
            if said.ends_with("waiting until a file changes (Ctrl-C ends raycl)\n") {
                match holds(&said) {
                    true => return,
                    false => said.clear(),
                }
            }
        }
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Replaces the scene's file in one step, as editors do.
fn edit_scene(folder: &WorkFolder, power: &str) {
    let text = TRIANGLE.replace("power = 10", &format!("power = {power}"));
    std::fs::write(folder.path("draft"), text).expect("it writes");
    std::fs::rename(folder.path("draft"), folder.path("scene.toml")).expect("it moves");
}

#[test]
fn quiet_watching_says_nothing() {
    let folder = one_point();
    let watching = Watching::start(&folder, &["--quiet"]);
    let picture = folder.path("scene.png");
    until("there is a picture", || image::open(&picture).is_ok());
    let first = std::fs::read(&picture).expect("a picture");
    edit_scene(&folder, "20");
    until("the picture has changed", || std::fs::read(&picture).is_ok_and(|now| now != first));
    let said: Vec<String> = watching.1.try_iter().collect();
    assert!(said.is_empty(), "{said:?}");
}

#[test]
fn a_mistake_that_is_found_while_watching_has_the_colours_that_the_user_chose() {
    let folder = WorkFolder::with(&[("scene.toml", &TRIANGLE.replace("power", "pwer"))]);
    let is_coloured = |choice: &str| {
        let coloured = std::cell::Cell::new(false);
        Watching::start(&folder, &["--color", choice]).until(|said| {
            assert!(said.contains("pwer"), "{said}");
            coloured.set(said.contains('\u{1b}'));
            true
        });
        coloured.get()
    };
    assert_eq!(["always", "never"].map(is_coloured), [true, false]);
}

#[test]
fn watching_goes_on_where_the_picture_was_changed_meanwhile() {
    let folder = one_point();
    let watching = Watching::start(&folder, &[]);
    let picture = folder.path("scene.png");
    let is_picture = || image::open(&picture).is_ok();
    watching.until(|_| is_picture());
    let first = std::fs::read(&picture).expect("a picture");
    edit_scene(&folder, "20");
    watching.until(|_| is_picture() && std::fs::read(&picture).expect("a picture") != first);
    std::fs::write(&picture, MINE).expect("it writes");
    edit_scene(&folder, "30");
    watching.until(|said| said.contains("scene.png") && said.contains(STRANGE));
    assert_eq!(folder.text("scene.png"), MINE);
    std::fs::remove_file(&picture).expect("it was there");
    edit_scene(&folder, "40");
    watching.until(|_| is_picture());
}

#[test]
fn limits_and_what_was_compiled_stay_where_they_are_somebodys() {
    let folder = one_point();
    std::fs::write(folder.path("notes.json"), MINE).expect("a file");
    refused(&folder, &["peak", "--out", "notes.json"], "notes.json", &[STRANGE, "`--out FILE`"]);

    let device = device();
    let command = ["compile", "scene.toml", "--strategy", "naive", "--out", "made"];
    let again = [&command[..], &["--device", &device]].concat();
    folder.output(&again);
    folder.output(&again);
    has(&folder.text("made/raycl.b3sum"), &["  naive/source.cl\n", "  naive/made.json\n"]);
    let source = folder.text("made/naive/source.cl");
    std::fs::write(folder.path("made/naive/source.cl"), MINE).expect("it writes");
    refused(&folder, &command, "made/naive/source.cl", &[CHANGED, "`--out DIR`"]);
    folder.output(&[&again[..], &["--force"]].concat());
    assert_eq!(folder.text("made/naive/source.cl"), source);

    folder.write("other/naive/build.log", MINE);
    let command = ["compile", "scene.toml", "--strategy", "naive", "--out", "other"];
    refused(&folder, &command, "other/naive/build.log", &[STRANGE]);
}

#[test]
fn runs_write_into_folders_of_results_only() {
    let (folder, device) = (one_point(), device());
    std::fs::create_dir(folder.path("thesis")).expect("a folder");
    std::fs::write(folder.path("thesis/summary.md"), MINE).expect("a file");
    let run = ["run", "config.toml", "--out", "thesis"];
    for more in [&[][..], &["--resume"]] {
        let message = refused_folder(&folder, &[&run[..], more].concat());
        has(&message, &["'thesis' is not a folder of results: it contains 'summary.md'"]);
    }
    has(&refused_folder(&folder, &["reproduce", "--out", "thesis"]), &["it contains 'summary.md'"]);
    has(
        &refused_folder(&folder, &["reproduce", "--page-only", "--out", "thesis"]),
        &["it contains 'summary.md'"],
    );
    assert_eq!(std::fs::read_dir(folder.path("thesis")).expect("a folder").count(), 1);
    assert_eq!(folder.text("thesis/summary.md"), MINE);

    let run = [&run[..], &["--device", &device, "--quiet"]].concat();
    folder.output(&[&run[..], &["--force"]].concat());
    assert!(folder.text("thesis/summary.md") != MINE, "--force replaces it");
    // After the run with `--force`, `thesis` is a folder of results.
    folder.output(&[&run[..], &["--resume"]].concat());
    has(&folder.mistake(&[&run[..], &["--force"]].concat(), 2), &["thesis already holds results"]);
}

/// Runs a command that would write into a folder that raycl did not create, and returns its message. No
/// driver is loaded.
fn refused_folder(folder: &WorkFolder, arguments: &[&str]) -> String {
    let mut command = folder.raycl(arguments);
    let output = command.env("OCL_ICD_VENDORS", "/nonexistent").assert().code(2).get_output().clone();
    let message = String::from_utf8(output.stderr).expect("UTF-8");
    has(&message, &["`--force` writes into the folder anyway", "`--out DIR` writes elsewhere"]);
    message
}
