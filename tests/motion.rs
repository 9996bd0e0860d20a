//! Turning scenes (`raycl render --turntable`): numbered pictures, animated pictures, streams, and frames that are
//! skipped because their files exist.

use crate::binary::{TRIANGLE, WorkFolder, device, finish, has, program};
use serde_json::Value;
use std::io::Read as _;
use std::process::Stdio;

const MESH: &str = "v 0 0 0\nv 2 0 0\nv 1 0 -2\nv 1 2 -1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
/// The options for the size of pictures, and for the plain look, which has no ground and a single sample per pixel.
const SIZE: [&str; 5] = ["--width", "48", "--height", "30", "--plain"];

fn new_folder() -> WorkFolder {
    WorkFolder::with(&[("mesh.obj", MESH), ("scene.toml", TRIANGLE)])
}

fn turn(folder: &WorkFolder, options: &[&str]) -> Value {
    let device = device();
    let all = [&["render", "--json", "--device", &device], &SIZE[..], options].concat();
    serde_json::from_str(&folder.output(&all)).expect("JSON")
}

fn pixels(folder: &WorkFolder, name: &str) -> Vec<u8> {
    image::open(folder.path(name)).unwrap_or_else(|error| panic!("{name}: {error}")).to_rgb8().into_raw()
}

#[test]
fn frames_are_those_of_scenes_whose_camera_stands_there() {
    let folder = new_folder();
    let report = turn(&folder, &["scene.toml", "--turntable", "4"]);
    assert_eq!((&report["frames"], &report["skipped"]), (&4.into(), &0.into()));
    assert_eq!(report["output"], "scene-0001.png to scene-0004.png");
    // The first frame is the scene's own picture.
    turn_still(&folder, "scene.toml", &[]);
    assert_eq!(pixels(&folder, "still.png"), pixels(&folder, "scene-0001.png"));
    // After half a turn, the camera is behind the middle of the triangle, at the same distance as at the
    // beginning.
    let behind = ["--set", "camera.position=[-0.3, 0, -4]", "--set", "camera.look_at=[-0.3, 0, -2]"];
    turn_still(&folder, "scene.toml", &behind);
    let (a, b) = (pixels(&folder, "still.png"), pixels(&folder, "scene-0003.png"));
    let different = a.iter().zip(&b).filter(|(a, b)| a.abs_diff(**b) > 8).count();
    assert!(different < a.len() / 50, "{different} of {}", a.len());
}

fn turn_still(folder: &WorkFolder, scene: &str, options: &[&str]) {
    let device = device();
    let still = ["-o", "still.png", "--force", "--device", &device];
    folder.output(&[&["render", scene], &still[..], &SIZE, options].concat());
}

#[test]
fn what_is_there_is_left_out_and_what_is_another_is_refused() {
    let folder = new_folder();
    let three = ["mesh.obj", "--turntable", "6", "--frames", "2..4"];
    assert_eq!(turn(&folder, &three)["frames"], 3);
    assert!(!folder.path("mesh-0001.png").exists() && !folder.path("mesh-0005.png").exists());
    std::fs::remove_file(folder.path("mesh-0003.png")).expect("a frame");
    let report = turn(&folder, &["mesh.obj", "--turntable", "6"]);
    assert_eq!((&report["frames"], &report["skipped"]), (&4.into(), &2.into()));
    assert!(report["frame_ms"].is_f64() && report["frames_per_s"].is_f64(), "{report}");
    let report = turn(&folder, &["mesh.obj", "--turntable", "6"]);
    assert_eq!(report["frames"], 0);
    assert!(report["frame_ms"].is_null() && report["frames_per_s"].is_null(), "{report}");
    // A picture that was rendered with other options or from another scene, or a file that was changed, does not count
    // as the frame, and is not overwritten.
    let before = std::fs::read(folder.path("mesh-0001.png")).expect("a frame");
    let message = folder.mistake(&[&["render", "mesh.obj", "--turntable", "5"], &SIZE[..]].concat(), 2);
    has(&message, &["'mesh-0001.png' exists and is not frame 1", "`--force`"]);
    assert_eq!(std::fs::read(folder.path("mesh-0001.png")).expect("a frame"), before);
    std::fs::write(folder.path("mesh-0002.png"), "mine").expect("a file");
    let message = folder.mistake(&[&["render", "mesh.obj", "--turntable", "6"], &SIZE[..]].concat(), 2);
    has(&message, &["'mesh-0002.png' exists, and raycl did not make it"]);
    let forced = turn(&folder, &["mesh.obj", "--turntable", "5", "--force"]);
    assert_eq!((&forced["frames"], &forced["skipped"]), (&5.into(), &0.into()));
}

#[test]
fn a_still_picture_with_the_name_of_a_frame_is_not_replaced() {
    let (folder, device) = (new_folder(), device());
    let still = ["render", "mesh.obj", "-o", "mesh-0002.png", "--device", &device];
    folder.output(&[&still[..], &SIZE].concat());
    let before = std::fs::read(folder.path("mesh-0002.png")).expect("a picture");
    let two = ["mesh.obj", "--turntable", "2"];
    let message = folder.mistake(&[&["render", "--device", &device], &two[..], &SIZE].concat(), 2);
    has(&message, &["'mesh-0002.png' exists and is not a frame", "`--force`"]);
    assert_eq!(std::fs::read(folder.path("mesh-0002.png")).expect("a picture"), before);
    assert_eq!(turn(&folder, &[&two[..], &["--force"]].concat())["frames"], 2);
}

/// Several nodes of a cluster may render parts of one turntable. All frames of this turntable must be cast
/// with the same strategy, even if the nodes have devices of different kinds.
#[test]
fn a_frame_that_another_strategy_cast_is_refused_with_the_way_to_continue() {
    let folder = new_folder();
    let two = ["mesh.obj", "--turntable", "2"];
    turn(&folder, &[&two[..], &["--strategy", "bvh"]].concat());
    let naive = [&["render"], &two[..], &SIZE, &["--strategy", "naive"]].concat();
    has(&folder.mistake(&naive, 2), &["'mesh-0001.png' exists and is not frame 1", "`--strategy`"]);
    assert_eq!(turn(&folder, &[&two[..], &["--strategy", "bvh"]].concat())["skipped"], 2);
}

#[cfg(target_os = "linux")]
#[test]
fn a_stream_onto_a_full_disk_is_a_failed_run_that_says_so() {
    let (folder, device) = (new_folder(), device());
    let mut command = program();
    command.current_dir(folder.path(".")).env("RAYCL_CACHE_MIB", "0");
    command.args(["render", "scene.toml", "--turntable", "2", "-o", "-", "--device", &device]).args(SIZE);
    let full = std::fs::File::options().write(true).open("/dev/full").expect("a device");
    let output = finish(command.stdout(full).stderr(Stdio::piped()).spawn().expect("it runs"));
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    has(&said, &["cannot write to standard output", "free up space on the file's disk"]);
}

/// A pipe holds only a small part of this stream, so most frames are cast only after somebody has read the
/// earlier ones.
#[test]
fn a_stream_that_its_reader_closes_early_has_the_frames_that_were_cast() {
    let (folder, device) = (new_folder(), device());
    let mut command = program();
    command.current_dir(folder.path(".")).env("RAYCL_CACHE_MIB", "0");
    command.args(["render", "scene.toml", "--turntable", "5000", "-o", "-", "--json", "--device", &device]);
    command.args(SIZE);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    let mut stream = child.stdout.take().expect("a stream");
    stream.read_exact(&mut [0; 10]).expect("the first bytes");
    drop(stream);
    let output = finish(child);
    assert!(output.status.success(), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stderr).expect("JSON");
    let frames = report["frames"].as_u64().expect("a number");
    assert!((1..5000).contains(&frames), "{report}");
    let note = format!("the reader closed the stream after {frames} of 5000 frames were cast");
    assert!(report["notes"].as_array().expect("a list").contains(&note.into()), "{report}");
}

#[test]
fn frames_of_other_kernels_are_other_frames_whatever_their_folder() {
    let folder = new_folder();
    let two = ["scene.toml", "--turntable", "2"];
    turn(&folder, &two);
    let file = "common/store_radiance.cl";
    // A kernel file with another text counts as a change, even if its kernels compute the same values. It does not
    // matter whether the text is that of another folder, or was edited in the same folder.
    let kernels = folder.kernels(file, "(varying)(1.0f)", "(varying)(1)");
    let with = [&two[..], &["--cl-dir", &kernels]].concat();
    let refused = || folder.mistake(&[&["render"], &with[..], &SIZE].concat(), 2);
    has(&refused(), &["is not frame 1"]);
    turn(&folder, &[&with[..], &["--force"]].concat());
    assert_eq!(turn(&folder, &with)["skipped"], 2);
    folder.kernels(file, "(varying)(1.0f)", "(varying)(2 - 1)");
    has(&refused(), &["is not frame 1"]);
}

#[test]
fn a_bare_mesh_is_lit_from_the_camera_all_around() {
    let folder = new_folder();
    turn(&folder, &["mesh.obj", "--turntable", "3", "--background", "black"]);
    for number in 1..=3 {
        let frame = pixels(&folder, &format!("mesh-000{number}.png"));
        let bright = frame.iter().filter(|value| **value > 100).count();
        assert!(bright > frame.len() / 20, "frame {number}: {bright} of {}", frame.len());
    }
}

#[test]
fn one_animated_picture_holds_the_same_frames_and_so_does_a_stream() {
    let (folder, device) = (new_folder(), device());
    turn(&folder, &["mesh.obj", "--turntable", "3"]);
    turn(&folder, &["mesh.obj", "--turntable", "3", "-o", "turn.apng", "--rate", "12"]);
    let bytes = std::fs::read(folder.path("turn.apng")).expect("a file");
    let decoder = png::Decoder::new(std::io::Cursor::new(&bytes));
    let mut reader = decoder.read_info().expect("a PNG");
    assert_eq!(reader.info().animation_control().map(|control| control.num_frames), Some(3));
    for number in 1..=3 {
        let mut frame = vec![0; reader.output_buffer_size().expect("a size")];
        reader.next_frame(&mut frame).expect("a frame");
        assert_eq!(frame, pixels(&folder, &format!("mesh-000{number}.png")), "frame {number}");
    }
    // A mark in this file shows that raycl made the picture, so raycl replaces the file.
    turn(&folder, &["mesh.obj", "--turntable", "2", "-o", "turn.apng"]);
    let stream = ["render", "mesh.obj", "--turntable", "3", "-o", "-", "-q", "--device", &device];
    let stream = folder.raycl(&[&stream[..], &SIZE].concat()).assert().success().get_output().stdout.clone();
    assert!(stream.starts_with(b"YUV4MPEG2 W48 H30 F30:1 "));
    let header = stream.iter().position(|byte| *byte == b'\n').expect("a line") + 1;
    assert_eq!(stream.len() - header, 3 * (6 + 48 * 30 * 3 / 2));
}

#[test]
fn shards_cast_each_frame_once_and_the_same_as_one_process() {
    let (folder, whole) = (new_folder(), new_folder());
    let four = ["mesh.obj", "--turntable", "4", "--frames", "2..4"];
    turn(&whole, &four);
    let cast = ["1/2", "2/2"]
        .map(|shard| turn(&folder, &[&four[..], &["--shard", shard]].concat())["frames"].clone());
    assert_eq!(cast, [1, 2]);
    for name in ["mesh-0002.png", "mesh-0003.png", "mesh-0004.png"] {
        assert_eq!(pixels(&folder, name), pixels(&whole, name), "{name}");
    }
    // Frames that exist are skipped, whichever process rendered them. If there are more processes than
    // frames, some processes get no frame.
    let device = device();
    let auto = [&["render", "--json", "--device", &device], &SIZE[..], &four, &["--shard", "auto"]].concat();
    let frames = |rank: &str| {
        let mut command = folder.raycl(&auto);
        command.env("OMPI_COMM_WORLD_RANK", rank).env("OMPI_COMM_WORLD_SIZE", "4");
        let said = command.assert().success().get_output().stdout.clone();
        let report: Value = serde_json::from_slice(&said).expect("JSON");
        (report["frames"].clone(), report["skipped"].clone())
    };
    assert_eq!((frames("0"), frames("3")), ((0.into(), 0.into()), (0.into(), 1.into())));
}

#[test]
fn mistakes_are_reported_before_anything_is_cast() {
    let folder = new_folder();
    for (options, message) in [
        (vec!["--turntable", "0"], "0"),
        (vec!["--turntable", "4", "--frames", "3..5"], "but there are 4 frames"),
        (vec!["--turntable", "4", "--frames", "3..1"], "write 1..3"),
        (vec!["--frames", "1..2"], "--turntable"),
        (vec!["--turntable", "4", "-o", "a.jpg"], "'a.jpg' is not a valid name for moving pictures"),
        (vec!["--turntable", "4", "-o", "nowhere/a.png"], "there is no folder"),
        (vec!["--turntable", "4", "--rate", "12"], "--rate 12 has no effect: "),
        (vec!["--turntable", "4", "--watch"], "--watch"),
        (vec!["--shard", "1/2"], "--turntable"),
        (vec!["--turntable", "4", "--shard", "3/2"], "there is no shard 3 of 2"),
        (
            vec!["--turntable", "4", "--shard", "1/2", "-o", "a.apng"],
            "two processes cannot write to one file or stream",
        ),
        (vec!["--turntable", "4", "--shard", "1/2", "-o", "-"], "cannot write to one file or stream"),
    ] {
        has(&folder.mistake(&[&["render", "mesh.obj"], &options[..]].concat(), 2), &[message]);
    }
}
