//! Values of a scene that change over time: the picture of each frame, the data that are loaded or computed again for
//! each frame, and the messages about mistakes in an animation.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::binary::{WorkFolder, device, has};
use glam::Vec3;
use raycl::scene::{Scene, load_scene};
use serde_json::Value;
use std::sync::Arc;

const MESH: &str = "v 0 0 0\nv 2 0 0\nv 1 0 -2\nv 1 2 -1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

/// The text of a scene file: a pyramid that is read from a mesh file, above a ground.
const STILL: &str = "background = 0.01
[camera]
position = [1, 1, 4]
look_at = [1, 0.5, 0]
[[light]]
position = [3, 4, 3]
power = 100
[sky]
zenith = 0.01
[[object]]
mesh = \"mesh.obj\"
[[object]]
vertices = [[-9, -0.1, 9], [9, -0.1, 9], [9, -0.1, -9], [-9, -0.1, -9]]
faces = [[0, 1, 2, 3]]
";

/// Tracks with one value per frame, with linear interpolation, and with steps.
const TRACKS: &str = "[animation]
frames = 4
frames_per_second = 12
[[animation.track]]
path = \"camera.position\"
values = [[1, 1, 4], [1.5, 1, 4], [2, 1.25, 4], [2.5, 1.5, 3]]
[[animation.track]]
path = \"light.0.power\"
at = [1, 3]
values = [100, 200]
interpolation = \"linear\"
[[animation.track]]
path = \"background\"
at = [1, 3]
values = [\"#102030\", \"#302010\"]
[[animation.track]]
path = \"display.exposure\"
at = [2, 4]
values = [15, 20]
interpolation = \"linear\"
";

const MOVING_OBJECT: &str = "[[animation.track]]
path = \"object.0.translation\"
at = [2, 4]
values = [[0, 0, 0], [0.5, 0.25, 0]]
interpolation = \"linear\"
";

const SIZE: [&str; 4] = ["--width", "48", "--height", "30"];

fn folder_with(tracks: &str) -> WorkFolder {
    let animated = format!("{STILL}{tracks}");
    WorkFolder::with(&[("mesh.obj", MESH), ("still.toml", STILL), ("scene.toml", &animated)])
}

fn animate(folder: &WorkFolder, options: &[&str]) -> Value {
    let device = device();
    let usual = ["render", "scene.toml", "--animate", "--json", "--device", &device];
    serde_json::from_str(&folder.output(&[&usual, &SIZE[..], options].concat())).unwrap()
}

fn pixels(folder: &WorkFolder, name: &str) -> Vec<u8> {
    image::open(folder.path(name)).unwrap_or_else(|error| panic!("{name}: {error}")).to_rgb8().into_raw()
}

/// Returns the picture of the scene without its animation, with values that are set by options.
fn still(folder: &WorkFolder, options: &[&str]) -> Vec<u8> {
    let device = device();
    let usual = ["render", "still.toml", "-o", "still.png", "--force", "--device", &device];
    folder.output(&[&usual, &SIZE[..], options].concat());
    pixels(folder, "still.png")
}

#[test]
fn frames_are_pictures_of_the_scene_with_their_values() {
    let by_hand = [
        ["camera.position=[1, 1, 4]", "light.0.power=100", "background='#102030'", "display.exposure=15"],
        ["camera.position=[1.5, 1, 4]", "light.0.power=150", "background='#102030'", "display.exposure=15"],
        [
            "camera.position=[2, 1.25, 4]",
            "light.0.power=200",
            "background='#302010'",
            "display.exposure=17.5",
        ],
        ["camera.position=[2.5, 1.5, 3]", "light.0.power=200", "background='#302010'", "display.exposure=20"],
    ];
    let translations = ["[0, 0, 0]", "[0, 0, 0]", "[0.25, 0.125, 0]", "[0.5, 0.25, 0]"];
    for (strategy, tracks, samples) in
        [("naive", TRACKS.to_owned(), "1"), ("bvh", format!("{TRACKS}{MOVING_OBJECT}"), "4")]
    {
        let folder = folder_with(&tracks);
        let options = ["--strategy", strategy, "--samples", samples];
        let report = animate(&folder, &options);
        assert_eq!((&report["frames"], &report["skipped"]), (&4.into(), &0.into()));
        assert_eq!(report["output"], "scene-0001.png to scene-0004.png");
        for (frame, values) in by_hand.iter().enumerate() {
            let moved = format!("object.0.translation={}", translations[frame]);
            let moved = (strategy == "bvh").then_some(moved);
            let values = values.iter().copied().chain(moved.as_deref());
            let set: Vec<&str> = values.flat_map(|value| ["--set", value]).chain(options).collect();
            let name = format!("scene-000{}.png", frame + 1);
            assert!(pixels(&folder, &name) == still(&folder, &set), "{strategy}: frame {}", frame + 1);
        }
        assert_ne!(pixels(&folder, "scene-0001.png"), pixels(&folder, "scene-0002.png"));
    }
}

#[test]
fn notes_concern_the_frames_that_are_rendered() {
    let tracks = "[animation]\nframes = 3\n[[animation.track]]\npath = \"object.0.mesh\"\n\
                  values = [\"mesh.obj\", \"two.obj\", \"three.obj\"]\n";
    let folder = folder_with(tracks);
    for name in ["mesh", "two", "three"] {
        folder.write(&format!("{name}.obj"), &format!("mtllib of-{name}.mtl\n{MESH}"));
    }
    let noted = |frames: &str| {
        let notes = animate(&folder, &["--frames", frames, "--force"])["notes"].to_string();
        ["mesh", "two", "three"].map(|name| notes.matches(&format!("`of-{name}.mtl`")).count())
    };
    assert_eq!(noted("1"), [1, 0, 0]);
    assert_eq!(noted("2..3"), [0, 1, 1]);
}

#[test]
fn a_single_picture_is_the_first_frame_and_says_so() {
    let folder = folder_with(TRACKS);
    let device = device();
    let usual = ["render", "scene.toml", "-o", "one.png", "--device", &device];
    let said = folder.output(&[&usual, &SIZE[..]].concat());
    has(&said, &["the picture shows the first of 4 frames: --animate renders all"]);
    animate(&folder, &["--frames", "1"]);
    assert_eq!(pixels(&folder, "one.png"), pixels(&folder, "scene-0001.png"));
    assert!(!folder.path("scene-0002.png").exists());
    // If an animation has one frame, a single picture shows all of it, so raycl does not mention `--animate`.
    let whole = folder_with("[animation]\nframes = 1\n");
    let said = whole.output(&[&usual, &SIZE[..]].concat());
    assert!(!said.contains("--animate"), "{said}");
}

#[test]
fn streams_have_the_scenes_rate_or_the_options() {
    let (folder, device) = (folder_with(TRACKS), device());
    let stream = ["render", "scene.toml", "--animate", "-o", "-", "-q", "--device", &device];
    for (options, rate) in [(&[][..], "F12:1"), (&["--rate", "25"], "F25:1")] {
        let all = [&stream[..], &SIZE, options].concat();
        let out = folder.raycl(&all).assert().success().get_output().stdout.clone();
        let header = out.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        has(&String::from_utf8_lossy(&out[..header]), &["YUV4MPEG2 W48 H30", rate]);
        assert_eq!(out.len() - header, 4 * (6 + 48 * 30 * 3 / 2));
    }
    // A turntable does not show the scene's animation, so the turntable has the usual frame rate, not the
    // animation's.
    let turning = ["render", "scene.toml", "--turntable", "1", "-o", "-", "-q", "--device", &device];
    let out = folder.raycl(&[&turning[..], &SIZE].concat()).assert().success().get_output().stdout.clone();
    assert!(out.starts_with(b"YUV4MPEG2 W48 H30 F30:1 "));
    // Each frame of an animated picture has its own exposure.
    animate(&folder, &["-o", "scene.apng"]);
    animate(&folder, &[]);
    let bytes = std::fs::read(folder.path("scene.apng")).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    for number in 1..=4 {
        let mut frame = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut frame).unwrap();
        assert!(frame == pixels(&folder, &format!("scene-000{number}.png")), "frame {number}");
    }
}

#[test]
fn frames_are_skipped_where_their_scene_is_the_same_and_refused_where_it_is_another() {
    let tracks = format!("{TRACKS}{MOVING_OBJECT}");
    let (folder, whole) = (folder_with(&tracks), folder_with(&tracks));
    let cast = |shard| animate(&folder, &["--shard", shard])["frames"].clone();
    assert_eq!(["1/3", "2/3", "3/3"].map(cast), [1, 1, 2]);
    animate(&whole, &[]);
    for number in 1..=4 {
        let name = format!("scene-000{number}.png");
        assert!(pixels(&folder, &name) == pixels(&whole, &name), "{name}");
    }
    std::fs::remove_file(folder.path("scene-0003.png")).unwrap();
    let report = animate(&folder, &[]);
    assert_eq!((&report["frames"], &report["skipped"]), (&1.into(), &3.into()));
    assert_eq!(animate(&folder, &["--frames", "2..4"])["frames"], 0);
    // If only the end of a track changes, the earlier frames stay valid and are skipped. Without `--force`, raycl
    // does not overwrite the file of a frame that has changed.
    let device = device();
    let render = ["render", "scene.toml", "--animate", "--device", &device];
    for (from, to) in
        [("[2.5, 1.5, 3]", "[2.5, 1.5, 3.5]"), ("[0.5, 0.25, 0]", "[0.5, 0.5, 0]"), ("[15, 20]", "[15, 30]")]
    {
        folder.write("scene.toml", &format!("{STILL}{}", tracks.replace(from, to)));
        assert_eq!(animate(&folder, &["--frames", "1..2"])["skipped"], 2, "{to}");
        let message = folder.mistake(&[&render[..], &SIZE].concat(), 2);
        has(&message, &["exists and is not frame", "`--force`"]);
    }
    // Another mesh with the same file name counts as a change.
    folder.write("scene.toml", &format!("{STILL}{tracks}"));
    folder.write("mesh.obj", &MESH.replace("v 1 2 -1", "v 1 1.5 -1"));
    has(&folder.mistake(&[&render[..], &SIZE].concat(), 2), &["is not frame 1"]);
    let forced = animate(&folder, &["--force"]);
    assert_eq!((&forced["frames"], &forced["skipped"]), (&4.into(), &0.into()));
}

#[test]
fn no_file_is_read_twice_and_a_mesh_that_stays_is_shared() {
    for (tracks, moves) in [(TRACKS.to_owned(), false), (format!("{TRACKS}{MOVING_OBJECT}"), true)] {
        let folder = folder_with(&tracks);
        let loaded = load_scene(&folder.path("scene.toml")).unwrap();
        std::fs::remove_file(folder.path("mesh.obj")).unwrap();
        let mut animation = loaded.animation.unwrap();
        assert_eq!((animation.frames, animation.frames_per_second), (4, Some(12)));
        animation.check(1..=4).unwrap();
        let second = animation.scene(2, &loaded.scene).unwrap();
        assert!(Arc::ptr_eq(&second.mesh, &loaded.scene.mesh), "its object stands still until frame 2");
        assert_eq!(second.camera.position, Vec3::new(1.5, 1.0, 4.0));
        let third = animation.scene(3, &second).unwrap();
        assert_eq!(Arc::ptr_eq(&third.mesh, &second.mesh), !moves);
        let apex = second.mesh.positions[3] + if moves { Vec3::new(0.25, 0.125, 0.0) } else { Vec3::ZERO };
        assert_eq!(third.mesh.positions[3], apex);
    }
}

#[test]
fn a_picture_of_the_sky_is_read_once_and_turned() {
    let sky = "[sky]\npicture = \"sky.hdr\"\n";
    let tracks = "[animation]\nframes = 3\n[[animation.track]]\npath = \"sky.turn_degrees\"\nvalues = [0, 90]\n\
                  [[animation.track]]\npath = \"sky.strength\"\nvalues = [1, 1, 2]\n";
    let folder = folder_with("");
    folder.write("scene.toml", &format!("{}{tracks}", STILL.replace("[sky]\nzenith = 0.01\n", sky)));
    let picture = image::Rgb32FImage::from_fn(8, 4, |x, y| image::Rgb([x as f32, y as f32, 0.5]));
    picture.save(folder.path("sky.hdr")).unwrap();
    let loaded = load_scene(&folder.path("scene.toml")).unwrap();
    std::fs::remove_file(folder.path("sky.hdr")).unwrap();
    let picture = |scene: &Scene| Arc::clone(scene.sky.as_ref().unwrap().picture.as_ref().unwrap());
    let mut animation = loaded.animation.unwrap();
    let [second, third] = [2, 3].map(|frame| animation.scene(frame, &loaded.scene).unwrap());
    let [first, second, third] = [&loaded.scene, &second, &third].map(picture);
    assert!(first.ahead.distance(Vec3::NEG_Z) < 1e-6 && third.ahead.distance(Vec3::NEG_X) < 1e-6);
    assert!(Arc::ptr_eq(&first.texels, &second.texels));
    assert_eq!(third.texels[9], first.texels[9].map(|value| 2.0 * value));
}

/// Returns an animation of nine frames with one track.
fn track(text: &str) -> String {
    format!("[animation]\nframes = 9\n[[animation.track]]\n{text}\n")
}

/// Checks that each animation is refused with its message and its line, and that nothing is cast.
#[track_caller]
fn are_refused(cases: &[(String, &str, &str)]) {
    let device = device();
    for (text, message, line) in cases {
        let folder = folder_with(text);
        let said = folder.mistake(&["render", "scene.toml", "--animate", "--device", &device], 2);
        has(&said, &[message, line]);
        assert!(!folder.path("scene-0001.png").exists(), "{message}");
    }
}

#[test]
fn a_wrong_path_has_its_position_and_the_nearest_name() {
    are_refused(&[
        (
            track("path = \"camera.positon\"\nvalues = [[0, 0, 1]]"),
            "did you mean `position`",
            "scene.toml:18",
        ),
        (track("path = \"camra.position\"\nvalues = [[0, 0, 1]]"), "did you mean `camera`", "scene.toml:18"),
        (track("path = \"light.7.power\"\nvalues = [1]"), "expected an index from 0 to 1", "scene.toml:18"),
        (track("path = \"light.1.power\"\nvalues = [1]"), "missing field `position`", "scene.toml:18"),
        (
            track(&format!("path = \"a{}\"\nvalues = [1]", ".a".repeat(100_000))),
            "longer than the path of any value of a scene",
            "scene.toml:18",
        ),
        (
            track("path = \"camera..x\"\nvalues = [1]"),
            "a name in the path is empty (two dots in a row, or a dot at an end)",
            "scene.toml:18",
        ),
        (track("path = \"animation.frames\"\nvalues = [1]"), "cannot change the animation", "scene.toml:18"),
        (track("path = \"light.00.power\"\nvalues = [1]"), "expected an index from 0 to 1", "scene.toml:18"),
        (
            track("path = \"camera.azimuth_degrees\"\nvalues = [0, 90]"),
            "a track of `camera.azimuth_degrees` beside `camera.position`",
            "scene.toml:18",
        ),
    ]);
}

/// The end of a message about a number that is no frame of an animation of nine frames.
const FRAME: &str = "is not a frame; expected a whole number from 1 to 9";

#[test]
fn wrong_values_have_their_position_and_what_was_expected() {
    are_refused(&[
        (track("path = \"shadow_bias\"\nvalues = []"), "a track without values", "scene.toml:19"),
        (
            track("path = \"shadow_bias\"\nvalues = [0, 1]\nat = [1]"),
            "`at` has 1 element, `values` has 2",
            "scene.toml:20",
        ),
        (track("path = \"shadow_bias\"\nvalues = [0, 1]\nat = [0, 9]"), FRAME, "scene.toml:20"),
        (track("path = \"shadow_bias\"\nvalues = [0, 1]\nat = [5, 10]"), FRAME, "scene.toml:20"),
        (track("path = \"shadow_bias\"\nvalues = [0, 1]\nat = [1.5, 3]"), FRAME, "scene.toml:20"),
        (
            track("path = \"shadow_bias\"\nvalues = [0, 1]\nat = [5, 5]"),
            "expected ascending",
            "scene.toml:20",
        ),
        (
            track("path = \"camera.position\"\nvalues = [[0, 0, 1],\n[0, 0]]"),
            "this value and the first one differ in structure",
            "scene.toml:20",
        ),
        (
            track("path = \"textures\"\nvalues = [true, false]\ninterpolation = \"linear\""),
            "only numbers",
            "scene.toml:20",
        ),
        (
            track("path = \"camera.z_near\"\nvalues = [0.1]\ninterpolation = \"smoth\""),
            "did you mean `smooth`",
            "scene.toml:20",
        ),
        (
            track("path = \"camera.z_near\"\nvalues = [0.1,\n-1]"),
            "`camera.z_near` at frame",
            "is not a finite number of at least 0",
        ),
        (track("path = \"object.0.scale\"\nvalues = [-1, 1]"), "at frame 5: 0", "scene.toml:19"),
        (track("path = \"shadow_bias\"\nvalues = [nan, nan]"), "is not a finite number", "scene.toml:19"),
        (
            track("path = \"shadow_bias\"\nvalues = [1e308, -1e308]"),
            "1e308 does not fit into single precision",
            "scene.toml:19",
        ),
        (track("paths = \"a\""), "did you mean `path`", "scene.toml:18"),
        ("[animation]\nframes = 0\n".to_owned(), "a whole number from 1 to 100000", "scene.toml:16"),
        ("[animation]\nframes = 1.5\n".to_owned(), "a whole number from 1 to 100000", "scene.toml:16"),
        (
            "[animation]\nframes = 2\nframes_per_second = 29.97\n".to_owned(),
            "floating point `29.97`, expected a whole number from 1 to 1000",
            "scene.toml:17",
        ),
        ("[animation]\n".to_owned(), "missing field `frames`", "scene.toml:15"),
        (String::new(), "scene.toml has no [animation]", "--turntable 120 moves the camera"),
    ]);
}

#[test]
fn tracks_that_do_not_go_together_have_their_position_and_a_remedy() {
    are_refused(&[
        (
            format!("{TRACKS}[[animation.track]]\npath = \"background\"\nvalues = [0]\n"),
            "a second track for `background`",
            "scene.toml:3",
        ),
        (
            track(
                "path = \"camera.position.1\"\nvalues = [1, 2]\n[[animation.track]]\npath = \"camera.position\"\nvalues = [[0, 1, 3]]",
            ),
            "`camera.position` replaces the value of the track `camera.position.1`",
            "put this track before all tracks that set a part of its value",
        ),
        // The first two tracks together make a valid light, so the third track is the mistake.
        (
            track(
                "path = \"light.1.position\"\nvalues = [[0, 3, 0]]\n[[animation.track]]\npath = \"light.1.power\"\nvalues = [9]\n[[animation.track]]\npath = \"shadow_bias\"\nvalues = [0.1, -1]",
            ),
            "`shadow_bias` at frame",
            "scene.toml:25",
        ),
        (
            track("path = \"background\"\nvalues = [\"black\", \"transparent\"]"),
            "the background is transparent in some frames only",
            "in all frames or in none",
        ),
        (
            format!(
                "{}\n[[object]]\nshape = \"sphere\"\n",
                track("path = \"object.2.triangles\"\nvalues = [100, 201]")
            ),
            "expected a whole number from 1 to 100000000",
            "\"step\" keeps a value",
        ),
    ]);
}

#[test]
fn what_one_frame_cannot_show_and_what_goes_with_no_animation_is_reported() {
    let device = device();
    let render = ["render", "scene.toml", "--animate", "--device", &device];
    // If the camera has no direction at one frame, the message comes when this frame is reached.
    let blind = track("path = \"camera.position\"\nvalues = [[0, 0.5, 0], [2, 0.5, 0]]");
    let said = folder_with(&blind).mistake(&[&render[..], &SIZE].concat(), 2);
    has(
        &said,
        &["looks at its own position", "at frame 5: the camera at", "track `camera.position` at frame 5"],
    );
    // The background is transparent from frame 3 on, and only the frames before frame 3 are rendered.
    let clear = folder_with(&track("path = \"background\"\nat = [1, 3]\nvalues = [0, \"transparent\"]"));
    assert_eq!(animate(&clear, &["--frames", "1..2"])["frames"], 2);
    let folder = folder_with(TRACKS);
    for (options, message) in [
        (&["--turntable", "3"][..], "cannot be used with"),
        (&["--verify"], "cannot be used with"),
        (&["--layers", "a.exr"], "cannot be used with"),
        (&["--frames", "3..5"], "--frames 3..5, but there are 4 frames"),
    ] {
        has(&folder.mistake(&[&["render", "scene.toml", "--animate"], options].concat(), 2), &[message]);
    }
}
