//! `raycl peak`, and how a run uses the peak rates. The tests check that each measured value is a positive number, but
//! not how large it should be. The tests need not check the kernels' results, since `raycl peak` checks them itself.

use crate::binary::{TRIANGLE, WorkFolder, config, device, has};
use serde_json::{Value, json};

const POINTS: &str = r#"
image_sizes = [[40, 30]]
local_sizes = [4]
strategies = ["naive", "watertight", "bvh"]
baselines = ["serial"]
"#;

fn new_folder() -> WorkFolder {
    WorkFolder::with(&[("scene.toml", TRIANGLE), ("test.toml", &config(POINTS, 1, 5))])
}

/// The names of the values that `raycl peak` measures on a device.
const FIGURES: [&str; 10] = [
    "fma_per_s",
    "copy_bytes_per_s",
    "local_bytes_per_s",
    "launch_device_us",
    "launch_host_us",
    "launch_batched_us",
    "private_ns",
    "private_array_ns",
    "local_ns",
    "global_ns",
];

#[test]
fn what_a_device_can_do_is_measured_and_a_run_reports_its_fraction_of_it() {
    let folder = new_folder();
    let device = device();
    let text = folder.output(&["peak", "--device", &device, "--out", "peak.json"]);
    has(&text, &["multiply-adds", "Gfma/s", "__local reads", "GB/s", "global memory", "ns"]);
    let stored: Value = serde_json::from_str(&folder.text("peak.json")).expect("JSON");
    for figure in FIGURES {
        let rate = &stored[0][figure];
        assert!(
            rate["median"].as_f64().is_some_and(|value| value > 0.0 && value.is_finite()),
            "{figure}: {rate}"
        );
        assert!(rate["repeats"].as_u64() >= Some(5) && rate["q1"].as_f64() <= rate["q3"].as_f64(), "{rate}");
    }
    let fma = stored[0]["fma_per_s"]["median"].as_f64().expect("a rate");

    let table = folder.output(&["run", "test.toml", "--device", &device, "--out", "out", "--peak=peak.json"]);
    has(&table, &["fraction of the device's peak rate of multiply-adds: "]);
    for record in folder.json_lines("out/records.jsonl") {
        let number = |field: &str| record[field].as_f64();
        let expected = match record["name"].as_str().expect("a name") {
            "naive" => Some(15.0),
            "watertight" => Some(50.0),
            _ => None,
        };
        let fraction = expected.map(|operations| number("tests_per_s").expect("tests") * operations / fma);
        assert_eq!(number("limit_fraction").is_some(), fraction.is_some(), "{record}");
        if let (Some(actual), Some(expected)) = (number("limit_fraction"), fraction) {
            assert!((actual / expected - 1.0).abs() < 1e-9, "{record}");
        }
    }
    let environment: Value = serde_json::from_str(&folder.text("out/environment.json")).expect("JSON");
    for key in ["device", "platform", "driver", "max_clock_mhz"] {
        assert_eq!(stored[0][key], environment["devices"][0][key], "{key}");
    }
    assert!(stored[0]["state"].as_str().is_some_and(|state| state.contains(" compute units")), "{stored}");
    assert!(
        stored[0]["launch_device_us"]["median"].as_f64() <= stored[0]["launch_host_us"]["median"].as_f64(),
        "{stored}"
    );
    let copied: Value = serde_json::from_str(&folder.text("out/peak.json")).expect("JSON");
    assert_eq!(copied[0]["timestamp"], stored[0]["timestamp"]);
    has(&folder.text("out/summary.md"), &["of peak"]);

    // With `--out -`, standard output contains only the JSON.
    let printed = folder.output(&["peak", "--device", &device, "--out", "-"]);
    let printed: Value = serde_json::from_str(&printed).expect("JSON");
    assert_eq!(printed[0]["device"], stored[0]["device"]);
    assert!(!folder.path("-").exists());

    let missing =
        folder.mistake(&["run", "test.toml", "--device", &device, "--out", "b", "--peak=none.json"], 2);
    has(&missing, &["none.json"]);
}

/// PoCL is configured to offer the same CPU as two devices.
#[test]
fn without_an_option_all_devices_that_the_settings_select_are_measured() {
    let folder = new_folder();
    let peak = |word: &str| {
        let mut command = folder.raycl(&["peak", "--json"]);
        command.env("POCL_DEVICES", "pthread pthread").env("RAYCL_DEVICE", word);
        command
    };
    let output = peak("portable computing language").assert().success().get_output().clone();
    let measured: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(measured.as_array().map(Vec::len), Some(2), "{measured}");
    let refused = peak("no-such-device").assert().code(2).get_output().clone();
    has(&String::from_utf8_lossy(&refused.stderr), &["RAYCL_DEVICE: no device matches 'no-such-device'"]);
}

/// With the hidden option `--asleep`, workers only wait, so this test opens no device.
#[test]
fn a_file_without_rates_of_the_device_is_reported_and_later_rates_of_one_device_keep_those_of_others() {
    let rates = |device: &str, state: Option<&str>| {
        let mut rates = json!({
            "device": device, "platform": "raycl asleep", "driver": "0.1", "state": state, "timestamp": "?",
            "raycl_version": "?", "max_clock_mhz": null,
        });
        let figure = json!({"median": 1e12, "q1": 1e12, "q3": 1e12, "repeats": 5});
        FIGURES.iter().for_each(|name| rates[*name] = figure.clone());
        rates.to_string()
    };
    let folder = new_folder();
    folder.write("h200.json", &rates("an H200", None));
    folder.write("asleep.json", &rates("asleep", None));
    folder.write("other.json", &rates("asleep", Some("2 compute units")));
    let usual = ["run", "test.toml", "--out", "out", "--asleep", "0.1", "--set", "baselines=[]"];
    let output_of = |more: &[&str]| {
        let output = folder.raycl(&[&usual[..], more].concat()).assert().success().get_output().clone();
        String::from_utf8(output.stderr).expect("UTF-8")
    };
    has(&output_of(&["--peak=h200.json"]), &["note: h200.json has no peak rates of asleep"]);
    let state = "asleep in its present state (driver 0.1, 1 compute unit), so";
    let noted = output_of(&["--peak=other.json", "--resume"]);
    has(&noted, &[&format!("note: other.json has no peak rates of {state}")]);
    let resumed = output_of(&["--peak=asleep.json", "--resume"]);
    assert!(!resumed.contains("no peak rates"), "{resumed}");
    let stored: Value = serde_json::from_str(&folder.text("out/peak.json")).expect("JSON");
    let devices: Vec<_> = stored.as_array().expect("a list").iter().map(|one| &one["device"]).collect();
    assert_eq!(devices, ["asleep", "an H200"]);
}

#[test]
fn a_point_records_what_the_compiler_made() {
    let folder = new_folder();
    folder.output(&["run", "test.toml", "--device", &device(), "--out", "out", "--quiet"]);
    for record in folder.json_lines("out/records.jsonl") {
        let kernels = record["kernels"].as_array().expect("a list");
        let names: Vec<_> = kernels.iter().filter_map(|kernel| kernel["name"].as_str()).collect();
        match record["name"].as_str().expect("a name") {
            "naive" => assert_eq!(names, ["cast_frame"]),
            "watertight" | "bvh" => assert_eq!(names, ["cast_primary", "shade_nearest"]),
            _ => assert!(names.is_empty(), "{record}"),
        }
        assert!(kernels.iter().all(|kernel| kernel["work_group_size"].as_u64() >= Some(16)), "{record}");
    }
}

#[test]
fn an_old_spelling_is_answered_with_the_new_one() {
    let text = config(POINTS, 1, 5);
    let folder = WorkFolder::with(&[("test.toml", &text), ("old.toml", &format!("{text}[limits]\n"))]);
    has(&folder.mistake(&["limits"], 2), &["did you mean `raycl peak`?"]);
    has(&folder.mistake(&["run", "test.toml", "--limits=peak.json"], 2), &["did you mean `--peak`?"]);
    has(&folder.mistake(&["run", "old.toml"], 2), &["old.toml:15", "did you mean 'emulate'?"]);
}
