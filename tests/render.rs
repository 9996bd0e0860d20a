//! `raycl render`: pictures in every format, its reports, and the effects of its options.

use crate::binary::{TRIANGLE, WorkFolder, device, finish, has, program, repository};
use serde_json::Value;
use std::process::Stdio;

/// A tetrahedron as it is often found in practice: without normals, and with a material that no file defines.
const TETRAHEDRON: &str =
    "mtllib none.mtl\nusemtl red\nv 0 0 0\nv 2 0 0\nv 1 0 2\nv 1 2 1\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n";

fn new_folder() -> WorkFolder {
    WorkFolder::with(&[("scene.toml", TRIANGLE), ("mesh.obj", TETRAHEDRON)])
}

/// Renders with these arguments and returns the report.
fn report(folder: &WorkFolder, arguments: &[&str]) -> Value {
    let device = device();
    let all = [&["render", "--json", "--device", &device], arguments].concat();
    serde_json::from_str(&folder.output(&all)).expect("JSON")
}

#[test]
fn every_format_holds_a_picture_of_the_size_asked_for() {
    let folder = new_folder();
    for name in ["a.png", "a.jpg", "a.JPEG", "a.exr", "a.hdr"] {
        report(&folder, &["scene.toml", "-o", name, "--width", "37", "--height", "23"]);
        let picture = image::open(folder.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((picture.width(), picture.height()), (37, 23), "{name}");
        let brightest = picture.to_rgb32f().into_raw().into_iter().fold(0.0, f32::max);
        let background = 0.0053;
        assert!(brightest > 2.0 * background, "{name}: {brightest}");
    }
}

/// The reader of a pipe may need only the first bytes of a picture, or none.
#[test]
fn a_picture_whose_reader_goes_away_is_no_error() {
    let (folder, device) = (new_folder(), device());
    let mut command = program();
    command.current_dir(folder.path(".")).args(["render", "scene.toml", "-o", "-", "--device", &device]);
    command.args(["--width", "37", "--height", "23"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    drop(child.stdout.take());
    let output = finish(child);
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn linear_formats_hold_radiance_and_not_what_is_displayed() {
    let folder = new_folder();
    report(&folder, &["scene.toml", "-o", "a.exr", "--width", "16", "--height", "10"]);
    let corner = image::open(folder.path("a.exr")).expect("a picture").to_rgb32f()[(0, 0)];
    assert_eq!(corner.0, [0.0022, 0.0032, 0.0053]);
}

#[test]
fn exposure_and_tone_change_what_is_displayed_and_not_the_radiance() {
    let folder = new_folder();
    let brightest = |options: &[&str]| {
        let (picture, _) = folder.picture(options);
        picture.pixels().map(|pixel| pixel.0[0]).max().expect("a pixel")
    };
    // The usual display curve shows everything brighter than white as white; the filmic curve keeps
    // differences between such bright values.
    let usual = brightest(&[]);
    assert_eq!(brightest(&["--exposure", "200", "--verify"]), 255);
    let filmic = brightest(&["--exposure", "200", "--tone", "filmic", "--verify"]);
    assert!(usual < 200 && (201..255).contains(&filmic), "{usual} {filmic}");
    let radiance = |name: &str, tone: &str| {
        folder.output(&[
            "render",
            "scene.toml",
            "--width",
            "40",
            "--tone",
            tone,
            "-o",
            name,
            "--device",
            &device(),
        ]);
        std::fs::read(folder.path(name)).expect("a picture")
    };
    assert_eq!(radiance("clip.exr", "clip"), radiance("filmic.exr", "filmic"));
}

#[test]
fn json_has_every_field() {
    let size = ["--width", "64", "--height", "40"];
    let separate = ["scene.toml", "--repeat", "3", "--strategy", "wide-common-origin"];
    let folder = new_folder();
    let report = report(&folder, &[&separate[..], &size].concat());
    let text = ["scene", "device", "strategy", "output"];
    let numbers = [
        "load_ms",
        "build_ms",
        "upload_ms",
        "primary_ms",
        "shadow_ms",
        "frame_ms",
        "save_ms",
        "total_ms",
        "frame_rays_per_s",
        "primary_rays_per_s",
        "shadow_rays_per_s",
        "tests_per_s",
    ];
    assert!(text.iter().all(|name| report[name].is_string()), "{report}");
    for name in numbers {
        assert!(report[name].as_f64().is_some_and(|value| value > 0.0), "{name}: {report}");
    }
    assert_eq!((&report["scene"], &report["triangles"]), (&"little".into(), &1.into()));
    assert_eq!(report["image_size"], serde_json::json!([64, 40]));
    assert_eq!(report["frames"], 3);
    assert_eq!(report["local_size"].as_array().map(Vec::len), Some(2));
    let ms = |name: &str| report[name].as_f64().expect("a time");
    assert!(ms("primary_ms") + ms("shadow_ms") <= 1.5 * ms("frame_ms"), "{report}");
    let parts = ["load_ms", "discover_ms", "build_ms", "upload_ms", "frame_ms", "read_ms", "save_ms"];
    assert!(parts.map(ms).iter().sum::<f64>() <= ms("total_ms"), "{report}");
    let same = |one: f64, other: f64| assert!((one / other - 1.0).abs() < 1e-9, "{one} {other}: {report}");
    for part in ["load", "discover", "build", "read", "save"] {
        let parts = report["parts"].as_array().expect("parts").iter();
        let own: f64 = parts.filter(|one| one["part"] == part).filter_map(|one| one["ms"].as_f64()).sum();
        assert!((own - ms(&format!("{part}_ms"))).abs() < 1e-9, "{part}: {report}");
    }
    let primary_rays = 64.0 * 40.0;
    same(ms("primary_rays_per_s"), primary_rays / ms("primary_ms") * 1e3);
    // The scene has one triangle, so the rate of ray-triangle tests equals the rate of primary rays.
    same(ms("tests_per_s"), ms("primary_rays_per_s"));
    let all_rays = primary_rays + ms("shadow_rays_per_s") * ms("shadow_ms") * 1e-3;
    same(ms("frame_rays_per_s"), all_rays / ms("frame_ms") * 1e3);
    assert!(all_rays > primary_rays && all_rays < 2.0 * primary_rays, "{report}");
    assert_eq!([&report["lights"], &report["samples"], &report["half_light_samples"]], [1, 1, 0]);
    assert_eq!((report["mean_samples"].as_f64(), &report["output"]), (Some(1.0), &"scene.png".into()));
    let bytes = |name: &str| report[name].as_u64().expect("a number of bytes");
    assert!(bytes("device_bytes") >= 64 * 40 * 16 && bytes("host_bytes") > bytes("device_bytes"), "{report}");
    assert!(bytes("peak_bytes") > 0, "{report}");
    let listed: Value = serde_json::from_str(&folder.output(&["devices", "--json"])).expect("JSON");
    let own = |device: &&Value| device["label"] == report["device"];
    let listed = listed["devices"].as_array().into_iter().flatten().find(own).expect("the device");
    assert_eq!(listed["threads"], report["threads"]);
}

#[test]
fn the_report_of_a_picture_on_standard_output_is_on_standard_error_also_as_json() {
    let (folder, device) = (new_folder(), device());
    let size = ["--width", "16", "--height", "10", "-o", "-"];
    for (more, magic) in [
        (&["--device", &device][..], &b"\x89PNG"[..]),
        (&["--devices", &device], b"\x89PNG"),
        (&["--device", &device, "--turntable", "2"], b"YUV4MPEG2"),
    ] {
        let command = [&["render", "scene.toml", "--json"], &size[..], more].concat();
        let output = folder.raycl(&command).assert().success().get_output().clone();
        assert!(output.stdout.starts_with(magic), "{more:?}");
        let report: Value = serde_json::from_slice(&output.stderr).expect("JSON");
        assert_eq!(report["image_size"], serde_json::json!([16, 10]), "{more:?}");
    }
}

#[test]
fn passes_that_a_strategy_does_not_have_are_null() {
    let (folder, size) = (new_folder(), ["--width", "32", "--height", "20"]);
    let fused = report(&folder, &[&["scene.toml", "--strategy", "naive"], &size[..]].concat());
    assert!(fused["primary_ms"].is_null() && fused["shadow_ms"].is_null(), "{fused}");
    assert!(fused["primary_rays_per_s"].is_null() && fused["frame_rays_per_s"].is_number(), "{fused}");
    assert!(fused["shadow_rays_per_s"].is_null() && fused["tests_per_s"].is_number(), "{fused}");
    assert_eq!(fused["preset"], "naive");
    // A rasteriser does not test every primary ray against every triangle, so its report has no rate of tests.
    let raster = report(&folder, &[&["scene.toml", "--strategy", "raster"], &size[..]].concat());
    assert!(raster["tests_per_s"].is_null() && raster["primary_ms"].is_number(), "{raster}");
    // For tiles that work-items share, shading is always a separate pass: after the pass of shadow rays or,
    // if passes are fused, after the pass that casts all rays.
    for (passes, apart) in [("separate", true), ("fused", false)] {
        let strategy = format!("tile-group,passes={passes}");
        // The program for the scene of hills takes PoCL half a minute to compile. Another test uses the same
        // program, so PoCL compiles it only once.
        let hills = crate::binary::repository("scenes/terrain.toml");
        let hills = ["--strategy", &strategy, "-o", "hills.png", hills.to_str().expect("UTF-8")];
        let tiles = report(&folder, &[&hills[..], &size].concat());
        assert!(tiles["shade_ms"].is_number() && raster["shade_ms"].is_null(), "{tiles}");
        assert_eq!(
            [&tiles["primary_ms"], &tiles["shadow_ms"]].map(|ms| ms.is_number()),
            [apart; 2],
            "{tiles}"
        );
    }
}

#[test]
fn options_choose_strategy_and_local_size() {
    let (folder, size) = (new_folder(), ["--width", "30", "--height", "20"]);
    let options = ["scene.toml", "--strategy", "deferred,width=2", "--set", "layout=indexed16"];
    let options = [&options[..], &["--local-size", "16x2"], &size].concat();
    let report = report(&folder, &options);
    has(report["strategy"].as_str().expect("a text"), &["shading=deferred", "width=2", "layout=indexed16"]);
    assert_eq!(report["local_size"], serde_json::json!([16, 2]));
    assert!(report["preset"].is_null(), "{report}");
}

#[test]
fn a_local_size_that_does_not_divide_the_image_is_padded() {
    let folder = new_folder();
    for strategy in ["naive", "local-vectors", "raster", "wide", "tiled-common-origin"] {
        let options = ["--strategy", strategy, "--local-size", "7x5", "--width", "50", "--height", "31"];
        let device = device();
        folder.output(&[&["render", "scene.toml", "--verify", "--device", &device], &options[..]].concat());
    }
}

/// Kernels that work with any number of work-items per group, and default local sizes, respect the device's limit. If
/// the environment variable `POCL_MAX_WORK_GROUP_SIZE` is set, PoCL's devices allow at most this number of work-items
/// per group.
#[test]
fn a_device_that_allows_only_small_work_groups_casts_every_picture() {
    let (folder, device) = (new_folder(), device());
    for (scene, more) in [
        ("scene.toml", &["--strategy", "raster"][..]),
        ("scene.toml", &["--strategy", "wide-common-origin"][..]),
        ("scene.toml", &["--strategy", "bvh", "--adaptive"][..]),
        ("mesh.obj", &[][..]),
    ] {
        let usual = ["render", scene, "-o", "a.png", "--force", "--verify", "--device", &device];
        let size = ["--width", "50", "--height", "31"];
        let mut command = folder.raycl(&[&usual, &size[..], more].concat());
        command.env("POCL_MAX_WORK_GROUP_SIZE", "16").assert().success();
    }
}

#[test]
fn set_changes_the_scene() {
    let folder = new_folder();
    let size = ["--width", "24", "--height", "15"];
    report(&folder, &[&["scene.toml", "-o", "dark.png", "--set", "display.exposure=0"], &size[..]].concat());
    let dark = image::open(folder.path("dark.png")).expect("a picture").to_rgb8();
    assert!(dark.iter().all(|value| *value == 0));
    let away = ["--set", "camera.look_at=[0, 0, 5]", "--set", "name=behind"];
    let behind = report(&folder, &[&["scene.toml", "-o", "sky.exr"], &away[..], &size].concat());
    assert_eq!(behind["scene"], "behind");
    let sky = image::open(folder.path("sky.exr")).expect("a picture").to_rgb32f();
    assert!(sky.pixels().all(|pixel| pixel.0 == [0.0022, 0.0032, 0.0053]), "something is behind the camera");
}

#[test]
fn a_bare_mesh_is_framed_lit_and_saved_under_its_name() {
    let folder = new_folder();
    let report = report(&folder, &["mesh.obj", "--width", "64", "--height", "40", "--plain"]);
    assert_eq!(report["output"], "mesh.png");
    assert_eq!((&report["triangles"], &report["lights"]), (&4.into(), &2.into()));
    has(&report["notes"].to_string(), &["none.mtl", "`red`", "k_L 0.8"]);
    let picture = image::open(folder.path("mesh.png")).expect("a picture").to_rgb8();
    let background = picture[(0, 0)];
    let bright = picture.pixels().filter(|pixel| pixel.0.iter().max() > Some(&100)).count();
    let covered = picture.pixels().filter(|pixel| **pixel != background).count();
    assert!(covered > 64 * 40 / 8 && covered < 64 * 40 * 3 / 4, "{covered} pixels");
    assert!(bright > covered / 2, "{bright} of {covered} pixels are bright");
}

#[test]
fn the_report_reads_well() {
    let (folder, device) = (new_folder(), device());
    let size = ["--width", "40", "--height", "25", "--repeat", "2", "--device", &device];
    let text = folder.output(&[&["render", "scene.toml", "--strategy", "wide"], &size[..]].concat());
    has(&text, &["little: 1 triangle, 1 light\n", "wide: traversal=exhaustive", "40 x 25 pixels"]);
    has(
        &text,
        &["primary ", ", shadow ", "median of 2)", "rays/s primary", "tests/s", "picture   scene.png"],
    );
    for step in ["load", "discover", "build", "upload", "kernel", "read", "save", "total"] {
        let line =
            text.lines().find(|line| line.starts_with(step)).unwrap_or_else(|| panic!("{step}: {text}"));
        assert!(line.contains(" ms"), "{line}");
    }
    assert_eq!(folder.output(&[&["render", "scene.toml", "-q"], &size[..]].concat()), "");
}

#[test]
fn verifying_says_what_was_found_and_keeps_a_wrong_picture() {
    let (folder, device) = (new_folder(), device());
    let sized = ["scene.toml", "--width", "77", "--height", "49"];
    let usual = [&["render", "--device", &device][..], &sized].concat();
    let of = |more: &[&'static str]| [&usual[..], more].concat();
    let arguments = of(&["--strategy", "naive", "--verify"]);
    let text = folder.output(&arguments);
    has(&text, &["verified  against the reference picture: largest relative difference ", " uncertain\n"]);
    let verified = &report(&folder, &[&sized[..], &["--verify"]].concat())["verified"];
    assert!(verified["max_difference"].as_f64().expect("a difference") < 1e-3, "{verified}");
    assert!(verified["uncertain_pixels"].is_u64(), "{verified}");
    assert!(verified["uncertain_hits"].is_u64() && verified["hits"].as_u64() > Some(0), "{verified}");
    assert_eq!(verified["pixels"], verified["of_pixels"], "{verified}");
    assert!(report(&folder, &sized)["verified"].is_null());
    let some = folder.output(&of(&["--verify=100"]));
    has(&some, &["verified  100 of ", " pixels, chosen at random, against the reference picture: largest"]);
    let some = report(&folder, &[&sized[..], &["--verify=100"]].concat());
    assert_eq!(some["verified"]["pixels"], 100);
    has(&folder.mistake(&["render", "scene.toml", "--verify=0"], 2), &["0", "--verify"]);

    let kernels = folder.kernels("cast/shade.cl", "4.0f * M_PI_F", "5.0f * M_PI_F");
    let wrong = ["--cl-dir", &kernels, "-o", "wrong.png"];
    let quiet = [&wrong[..], &["--quiet"]].concat();
    let sampled = of(&["--strategy", "naive", "--verify=100"]);
    has(&folder.mistake(&[&sampled[..], &quiet[..]].concat(), 1), &["the picture is wrong: "]);
    let message = folder.mistake(&[&arguments[..], &quiet[..]].concat(), 1);
    has(&message, &["the picture is wrong: ", "the picture was saved for inspection: wrong.png"]);
    assert!(folder.path("wrong.png").exists());

    // If the picture is wrong, raycl prints the report before the error.
    let output_of = |more: &[&str]| {
        let command = [&arguments[..], &wrong, more].concat();
        let output = folder.raycl(&command).assert().code(1).get_output().clone();
        has(&String::from_utf8_lossy(&output.stderr), &["the picture is wrong: "]);
        String::from_utf8(output.stdout).expect("UTF-8")
    };
    has(&output_of(&[]), &["verified  the picture is wrong: ", "kernel ", "picture   wrong.png"]);
    let json: Value = serde_json::from_str(&output_of(&["--json", "--repeat", "2"])).expect("JSON");
    let reason = json["verified"]["wrong"].as_str().expect("a reason");
    assert!(reason.starts_with("the picture is wrong: "), "{reason}");
    assert!(json["frames"] == 2 && json["frame_ms"].is_f64() && json["notes"].is_array(), "{json}");
}

#[test]
fn a_scene_of_the_repository_renders_from_any_folder() {
    let (folder, scene, device) = (WorkFolder::new(), repository("scenes/pyramid-upper.toml"), device());
    let scene = scene.to_str().expect("UTF-8");
    folder.output(&["render", scene, "--width", "80", "--height", "50", "--verify", "--device", &device]);
    assert!(folder.path("pyramid-upper.png").exists());
}
