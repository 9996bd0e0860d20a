//! Experiments whose scenes have several samples per pixel.

use crate::binary::{WorkFolder, device, has};
use serde_json::Value;
use std::collections::HashSet;

/// A triangle above the ground, and a light with a radius.
const SOFT: &str = r#"name = "soft"
background = [0.02, 0.02, 0.03]
camera = { position = [0, 2, 4], look_at = [0, 0.3, 0] }

[[light]]
position = [1, 4, 1]
power = 30
radius = 0.6

[[object]]
vertices = [[-4, 0, -4], [4, 0, -4], [4, 0, 4], [-4, 0, 4]]
faces = [[0, 3, 2, 1]]

[[object]]
vertices = [[-1, 0.8, 0], [1, 0.8, 0], [0, 0.8, -1]]
faces = [[0, 1, 2]]
"#;

const CONFIG: &str = r#"question = "What do four samples cost?"
expectation = "Four times as much."
image_sizes = [[33, 20]]
local_sizes = [1]
strategies = ["bvh", "raster"]
baselines = ["serial"]

[[scene]]
file = "soft.toml"
samples = [1, 4]

[timing]
launches = 1
warmup = 0
min_samples = 5
max_samples = 5
"#;

fn run(folder: &WorkFolder, options: &[&str]) -> Vec<Value> {
    let device = device();
    folder.output(&[&["run", "config.toml", "--out", "out", "--device", &device], options].concat());
    folder.json_lines("out/records.jsonl")
}

/// Returns the record of a strategy and a scene.
fn of<'a>(records: &'a [Value], name: &str, scene: &str) -> &'a Value {
    let is_it = |record: &&Value| record["name"] == name && record["scene"] == scene;
    records.iter().find(is_it).unwrap_or_else(|| panic!("no {name} of {scene}: {records:?}"))
}

#[test]
fn points_with_several_samples_are_verified_timed_and_named_and_show_what_render_shows() {
    let folder = WorkFolder::with(&[("soft.toml", SOFT), ("config.toml", CONFIG)]);
    let records = run(&folder, &[]);
    assert_eq!(records.len(), 6);
    let (one, four) = (of(&records, "bvh", "soft"), of(&records, "bvh", "soft+samples=4"));
    assert!(one.get("samples_per_pixel").is_none());
    assert_eq!(four["samples_per_pixel"], 4);
    let number = |record: &Value, field: &str| record[field].as_f64().expect("a number");
    for (record, samples) in [(one, 1.0), (four, 4.0)] {
        assert_eq!(
            (&record["outcome"], record["samples_ms"].as_array().map(Vec::len)),
            (&"measured".into(), Some(5))
        );
        assert!(number(record, "max_difference") < 1e-3);
        let primary_rays = number(record, "rays_per_s") * number(record, "primary_ms") / 1e3;
        assert!((primary_rays / (33.0 * 20.0 * samples) - 1.0).abs() < 1e-9, "{record}");
    }
    assert!(number(four, "shadow_rays") > 3.5 * number(one, "shadow_rays"));
    assert_ne!((&one["key"], &one["image_hash"]), (&four["key"], &four["image_hash"]));
    for (record, samples) in [(one, "1"), (four, "4")] {
        let rendered = format!("{samples}.png");
        let device = device();
        let size = ["--width", "33", "--height", "20", "--samples", samples, "--strategy", "bvh"];
        let usual = ["render", "soft.toml", "--device", &device, "--local-size", "1", "-o", &rendered];
        folder.output(&[&usual[..], &size].concat());
        let picture = |path| image::open(path).expect("a picture").to_rgb8();
        let of_run = folder.path("out").join(record["image"].as_str().expect("a picture"));
        assert_eq!(picture(of_run), picture(folder.path(&rendered)), "{samples} samples");
    }
    // With four samples, a point is infeasible if its baseline or strategy does not support several samples or soft
    // light. The record states the reason.
    let refusals = [
        ("serial", "serial-f32 casts only one sample per pixel, but the scene has samples = 4"),
        (
            "raster",
            "does not support lights with a radius or edges, which the scene has: with one sample per pixel",
        ),
    ];
    for (name, reason) in refusals {
        assert_eq!(of(&records, name, "soft")["outcome"], "measured");
        let refused = of(&records, name, "soft+samples=4");
        assert_eq!(refused["outcome"], "infeasible");
        has(refused["reason"].as_str().expect("a reason"), &[reason]);
    }
    for file in ["summary.md", "summary.csv", "report.html"] {
        has(&folder.text(&format!("out/{file}")), &["soft+samples=4"]);
    }
}

#[test]
fn a_resumed_run_measures_only_new_numbers_of_samples() {
    let folder = WorkFolder::with(&[("soft.toml", SOFT), ("config.toml", CONFIG)]);
    let only = ["--set", "strategies=[\"bvh\"]", "--set", "baselines=[]"];
    let keys = |records: &[Value]| -> Vec<String> {
        records.iter().map(|record| record["key"].as_str().expect("a key").to_owned()).collect()
    };
    let first = keys(&run(&folder, &only));
    assert_eq!(first.len(), 2);
    let resume = [&only[..], &["--resume"]].concat();
    assert_eq!(keys(&run(&folder, &resume)), first, "nothing is measured again");
    let more = [&resume[..], &["--set", "scene.0.samples=[1, 4, 5]"]].concat();
    let all = keys(&run(&folder, &more));
    assert_eq!((all.len(), &all[..2]), (3, &first[..]));
    assert_eq!(all.iter().collect::<HashSet<_>>().len(), 3);
    has(&folder.text("out/summary.md"), &["soft+samples=4", "soft+samples=5"]);
}
