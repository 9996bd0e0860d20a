//! Tests of frames that several devices cast together (their pixels must be the same as on one device), of
//! runs on several devices, and of samples that consist of several frames. PoCL is configured to offer the
//! same CPU as two devices.

use crate::binary::{TRIANGLE, WorkFolder, config, repository};
use crate::common::apart::apart;
use crate::common::{Stand, is_long, scene};
use raycl::strategy::preset;
use serde_json::Value;

fn render(folder: &WorkFolder, devices: Option<&str>, strategy: [&str; 2], picture: &str) -> Value {
    let scene = ["scenes/still-life.toml", "--width", "75", "--height", "61"];
    render_scene(folder, &scene, devices, strategy, picture)
}

/// Renders a scene of the repository. `scene` has the scene's file, followed by the picture's size and more
/// arguments.
fn render_scene(
    folder: &WorkFolder,
    scene: &[&str],
    devices: Option<&str>,
    [strategy, local]: [&str; 2],
    picture: &str,
) -> Value {
    let file = repository(scene[0]);
    let mut arguments = vec!["render", file.to_str().expect("UTF-8"), "--json", "-o", picture];
    arguments.extend(&scene[1..]);
    arguments.extend(["--strategy", strategy, "--local-size", local]);
    match devices {
        Some(devices) => arguments.extend(["--devices", devices, "--every-device", "--verify"]),
        None => arguments.extend(["--device", "portable computing language"]),
    }
    let mut command = folder.raycl(&arguments);
    let output =
        command.env("POCL_DEVICES", "pthread pthread").assert().success().get_output().stdout.clone();
    serde_json::from_slice(&output).expect("JSON")
}

#[test]
fn two_devices_cast_the_pixels_of_one() {
    apart!();
    let folder = WorkFolder::new();
    // With the strategy `tile`, a work-group of 1 x 1 work-items casts a tile of 32 x 16 pixels.
    let all = [
        ["tile", "1x1"],
        ["bvh", "4x2"],
        ["naive-scratch", "4x2"],
        ["deferred,width=4", "4x2"],
        ["tiled-common-origin", "4x2"],
        ["naive", "4x2"],
        ["tile-group", "32x1"],
        ["tile-group-watertight", "32x1"],
    ];
    // PoCL takes a minute and a half to compile each of the last two strategies, for whole frames and for bands of a
    // frame.
    for strategy in all.into_iter().take(if is_long() { 8 } else { 4 }) {
        let one = render(&folder, None, strategy, "one.exr");
        let two = render(&folder, Some("portable computing language"), strategy, "two.exr");
        let rows: Vec<[u64; 2]> = two["devices"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|device| [0, 1].map(|end| device["rows"][end].as_u64().expect("a row")))
            .collect();
        assert_eq!(rows.len(), 2, "{two}");
        assert_eq!((rows[0][0], rows[0][1], rows[1][1]), (0, rows[1][0], 61), "{two}");
        assert!(rows.iter().all(|[first, end]| first < end), "{two}");
        for field in ["scene", "triangles", "strategy", "local_size", "image_size", "samples", "notes"] {
            assert_eq!(two[field], one[field], "{field}");
        }
        assert_eq!((&two["output"], &two["frames"]), (&"two.exr".into(), &1.into()));
        assert_eq!(two["verified"]["pixels"], 75 * 61);
        same_rays(&one, &two);
        let longest = two["devices"].as_array().into_iter().flatten().filter_map(|d| d["frame_ms"].as_f64());
        assert_eq!(two["frame_ms"].as_f64(), longest.reduce(f64::max));
        assert!(same_pixels(&folder, "one.exr", "two.exr"), "{strategy:?}: other pixels");
    }
}

/// The bare mesh of this test has soft light under a sky, so that samples differ in more than their position in the
/// pixel.
#[test]
fn two_devices_cast_the_samples_of_one() {
    apart!();
    let folder = WorkFolder::new();
    // The reference takes long to cast all rays of several samples in soft light, so the picture is small.
    let globe = ["scenes/table/globe.obj", "--width", "35", "--height", "61"];
    let scene = [&globe[..], &["--samples", "5"]].concat();
    for strategy in [["bvh", "4x2"], ["tile", "1x1"]] {
        let one = render_scene(&folder, &scene, None, strategy, "one.exr");
        let two = render_scene(&folder, &scene, Some("portable computing language"), strategy, "two.exr");
        assert_eq!((&two["samples"], &two["samples"]), (&one["samples"], &Value::from(5)));
        assert_eq!(two["devices"].as_array().map(Vec::len), Some(2), "{two}");
        assert!(same_pixels(&folder, "one.exr", "two.exr"), "{strategy:?}: other pixels");
        same_rays(&one, &two);
    }
    let single = [&globe[..], &["--plain"]].concat();
    render_scene(&folder, &single, None, ["bvh", "4x2"], "single.exr");
    assert!(!same_pixels(&folder, "one.exr", "single.exr"));
}

/// It depends on the machine whether two devices that share a CPU are faster than one device. Whether they are faster
/// or slower, the message about a device that is left out must be true.
#[test]
fn a_device_that_slows_the_frame_is_left_out_and_each_has_its_own_strategy() {
    apart!();
    let folder = WorkFolder::new();
    let scene = repository("scenes/still-life.toml");
    let size = ["--width", "75", "--height", "61", "--devices", "portable computing language"];
    let arguments =
        [&["render", scene.to_str().expect("UTF-8"), "--verify", "-o", "p.png"][..], &size].concat();
    let run = |more: &[&str]| {
        let mut command = folder.raycl(&[&arguments[..], more].concat());
        let output =
            command.env("POCL_DEVICES", "pthread pthread").assert().success().get_output().stdout.clone();
        String::from_utf8(output).expect("UTF-8")
    };
    let json: Value = serde_json::from_str(&run(&["--json"])).expect("JSON");
    let lists = ["devices", "left_out"].map(|list| json[list].as_array().expect("a list").clone());
    assert_eq!(lists[0].len() + lists[1].len(), 2, "{json}");
    assert!(!lists[0].is_empty() && lists[0].iter().all(|device| device["strategy"].is_string()), "{json}");
    assert!(
        lists[1].iter().all(|device| device["reason"].as_str().is_some_and(|why| why.contains("fastest")))
    );
    let text = run(&[]);
    let rows = text.lines().filter(|line| line.contains(" to ")).count();
    assert_eq!(rows + text.matches("left out  ").count(), 2, "{text}");
}

/// Checks that two reports count the same rays.
fn same_rays(one: &Value, two: &Value) {
    let rays = |report: &Value| {
        let number = |field: &str| report[field].as_f64().expect("a number");
        number("frame_rays_per_s") * number("frame_ms") * 1e-3
    };
    assert!((rays(one) / rays(two) - 1.0).abs() < 1e-9, "{one}\n{two}");
}

fn same_pixels(folder: &WorkFolder, one: &str, other: &str) -> bool {
    let [one, other] =
        [one, other].map(|name| image::open(folder.path(name)).expect("a picture").to_rgb32f());
    one.dimensions() == other.dimensions() && one.as_raw() == other.as_raw()
}

const POINTS: &str = r#"
image_sizes = [[40, 30], [20, 30], [30, 20], [24, 24]]
local_sizes = [4]
strategies = ["deferred", "naive-scratch"]
baselines = ["serial"]
"#;

#[test]
fn a_run_is_spread_over_devices_of_one_kind_and_can_be_resumed() {
    apart!();
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("test.toml", &config(POINTS, 1, 5))]);
    let run = |more: &[&str]| {
        let all = [
            &["run", "test.toml", "--device", "portable computing language", "--out", "out", "--spread"],
            more,
        ];
        let mut command = folder.raycl(&all.concat());
        let ended = command.env("POCL_DEVICES", "pthread pthread").assert().success();
        let said = String::from_utf8_lossy(&ended.get_output().stderr).into_owned();
        assert!(!said.contains("waiting for"), "{said}");
        folder.json_lines("out/records.jsonl")
    };
    // Both devices are the host's processors, which have one lock, so the run's threads wait for each other.
    let records = run(&["--quiet", "--no-wait"]);
    assert_eq!(records.len(), 4 * 3);
    assert!(records.iter().all(|record| record["outcome"] == "measured"), "{records:?}");
    let mut devices: Vec<_> = records.iter().filter_map(|record| record["measured_on"].as_str()).collect();
    assert_eq!(devices.len(), 4 * 2, "every kernel says where it ran");
    devices.sort_unstable();
    devices.dedup();
    assert!(devices.len() <= 2, "{devices:?}");
    // Every sample must name the same device as the record of its point. `--resume` reads from the samples
    // which device measured a group's launches, and continues the group on the same device.
    let of_records: std::collections::HashMap<_, _> =
        records.iter().map(|record| (record["key"].as_str(), record["measured_on"].as_str())).collect();
    for sample in folder.json_lines("out/samples.jsonl") {
        assert_eq!(sample["measured_on"].as_str(), of_records[&sample["key"].as_str()], "{sample}");
    }
    // A point of the experiment has the same key on each of these equal devices, so `--resume` measures
    // nothing again. The blocks (the parts of the points that each device measures) also stay the same,
    // whatever times were measured.
    let blocks = folder.text("out/blocks.json");
    assert_eq!(run(&["--quiet", "--resume"]).len(), 4 * 3);
    assert_eq!(folder.text("out/blocks.json"), blocks);
}

#[test]
fn a_batch_has_the_mean_time_of_its_frames_and_the_same_picture() {
    apart!();
    let stand = Stand::new(scene("pyramid-lower.toml"), [45, 29]);
    let strategy = preset("deferred").expect("a preset").strategy;
    let built = stand.build(&strategy, [4, 4]).expect("it fits");
    let expected = stand.cast(&strategy, [4, 4]).expect("an image");
    let caster = built.caster().expect("a caster");
    assert_eq!(caster.cast().expect("a frame").batch, None);
    let times = caster.cast_batch(5).expect("a batch");
    assert_eq!(times.batch, Some(5));
    // The elapsed time is that of five frames, and the time per frame is a fifth of it.
    assert!((times.elapsed_ms() - 5.0 * times.host_ms).abs() < 1e-9 && times.frame_ms <= times.elapsed_ms());
    let parts = times.primary_ms.zip(times.shadow_ms).map(|(primary, shadow)| primary + shadow);
    assert!(parts.is_some_and(|sum| (sum - times.frame_ms).abs() < 1e-9), "{times:?}");
    assert_eq!(caster.read().expect("an image").0, expected);
}
