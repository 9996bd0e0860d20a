//! `raycl run`: its plan, its results, and points of the experiment that fail.

use crate::binary::{TRIANGLE, WorkFolder, device, has, repository};
use serde_json::Value;
use std::collections::HashSet;
use std::process::{Child, Stdio};

/// Five points: a baseline, and two strategies at two local sizes.
const CONFIG: &str = r#"question = "Which is faster?"
expectation = "The second."
scenes = ["scene.toml"]
image_sizes = [[33, 20]]
local_sizes = [4, [8, 2]]
strategies = ["naive", "local-vectors"]
baselines = ["serial"]

[timing]
launches = 1
warmup = 0
min_samples = 5
max_samples = 5
"#;

/// Fields that every record has.
const FIELDS: [&str; 21] = [
    "key",
    "scene",
    "device",
    "preset",
    "strategy",
    "local_size",
    "image_size",
    "outcome",
    "reason",
    "median_ms",
    "q1_ms",
    "q3_ms",
    "interval_ms",
    "samples_ms",
    "stop_reason",
    "rays_per_s",
    "tests_per_s",
    "max_difference",
    "uncertain_pixels",
    "shadow_rays",
    "name",
];

fn new_folder() -> WorkFolder {
    WorkFolder::with(&[("scene.toml", TRIANGLE), ("config.toml", CONFIG)])
}

/// Returns the arguments of a run on the test device, with its results in `out`.
fn arguments<'a>(device: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["run", "config.toml", "--out", "out", "--device", device], more].concat()
}

/// Runs the config, which must end with this exit code, and returns its records.
fn records(folder: &WorkFolder, more: &[&str], code: i32) -> Vec<Value> {
    let device = device();
    folder.raycl(&arguments(&device, more)).assert().code(code);
    folder.json_lines("out/records.jsonl")
}

#[test]
fn every_point_is_recorded_with_every_field() {
    let folder = new_folder();
    let records = records(&folder, &[], 0);
    assert_eq!(records.len(), 5);
    let keys: HashSet<_> = records.iter().map(|record| record["key"].as_str().expect("a key")).collect();
    assert_eq!(keys.len(), 5);
    for record in &records {
        let fields = record.as_object().expect("an object");
        for name in FIELDS {
            assert!(fields.contains_key(name), "{name}: {record}");
        }
        assert!(fields.values().all(|value| !value.is_object()), "a record is flat: {record}");
        assert_eq!(record["outcome"], "measured");
        assert_eq!(
            (&record["scene"], &record["image_size"]),
            (&"little".into(), &serde_json::json!([33, 20]))
        );
        assert_eq!(record["samples_ms"].as_array().map(Vec::len), Some(5));
        assert_eq!(record["stop_reason"], "max-samples");
        let [median_ms, q1_ms, q3_ms, tests] = ["median_ms", "q1_ms", "q3_ms", "tests_per_s"]
            .map(|name| record[name].as_f64().expect("a number"));
        assert!(q1_ms <= median_ms && median_ms <= q3_ms, "{record}");
        // The scene has one triangle, so each primary ray is tested against one triangle; the rate counts no tests of
        // shadow rays. None of the measured strategies casts primary rays in a separate pass, so raycl computes the
        // rate of tests from the time of the whole frame.
        assert!((tests / (33.0 * 20.0 / median_ms * 1e3) - 1.0).abs() < 1e-9, "{record}");
    }
    let naive = records.iter().find(|record| record["name"] == "naive").expect("naive");
    has(naive["strategy"].as_str().expect("axes"), &["traversal=exhaustive", "vectors=heap", "math=strict"]);
    assert_eq!(naive["preset"], "naive");
    let serial = records.iter().find(|record| record["device"] == "host").expect("the baseline");
    assert_eq!((&serial["strategy"], &serial["local_size"]), (&"serial-f32".into(), &Value::Null));
}

#[test]
fn the_folder_has_all_that_is_promised() {
    let folder = new_folder();
    let records = records(&folder, &["--set", "timing.seed=7"], 0);
    let samples = folder.json_lines("out/samples.jsonl");
    assert_eq!(samples.len(), 25);
    assert!(samples.iter().all(|sample| sample["processor_ms"].as_f64() > Some(0.0)), "{samples:?}");
    for record in &records {
        let own = samples.iter().filter(|sample| sample["key"] == record["key"]);
        let times: Vec<_> = own.map(|sample| sample["ms"].clone()).collect();
        assert_eq!(record["samples_ms"], Value::from(times));
        // The number of samples that were left out because another process used the processor is known, since
        // the host's processors cast all samples. The number of samples that were left out is 0, since no
        // sample is left out of a launch with only five samples.
        assert_eq!(record["preempted_samples"], 0);
        let picture = folder.path("out").join(record["image"].as_str().expect("a picture"));
        assert_eq!(image::image_dimensions(picture).expect("a picture"), (33, 20));
    }
    let summary = folder.text("out/summary.md");
    has(&summary, &["# Which is faster?", "Expected: The second.", "local-vectors at ", "serial-f32"]);
    let rules: Vec<_> = summary.lines().filter(|line| line.starts_with("| --")).collect();
    let sound = |cell: &str| cell.trim().trim_end_matches(':').len() >= 2;
    assert!(rules.iter().all(|rule| rule.trim_matches('|').split('|').all(sound)), "{rules:?}");
    let csv = folder.text("out/summary.csv");
    assert_eq!(csv.lines().count(), 6);
    assert!(csv.starts_with("key,scene,device,") && csv.contains("shadow_rays,"), "{csv}");
}

#[test]
fn launches_are_in_the_journals_and_one_is_called_a_look() {
    let folder = new_folder();
    let records = records(&folder, &["--set", "timing.launches=2"], 0);
    let samples = folder.json_lines("out/samples.jsonl");
    assert_eq!(samples.len(), 2 * 25, "five samples of each point in each launch");
    assert!(samples[..25].iter().all(|sample| sample["launch"] == 0), "no launch is mixed with another");
    assert!(samples[25..].iter().all(|sample| sample["launch"] == 1), "no launch is mixed with another");
    for record in &records {
        assert_eq!(record["sample_launches"], serde_json::json!([0, 0, 0, 0, 0, 1, 1, 1, 1, 1]));
        let [low, median, high] =
            [&record["interval_ms"][0], &record["median_ms"], &record["interval_ms"][1]]
                .map(|value| value.as_f64().expect("a number"));
        assert!(low <= median && median <= high, "{record}");
    }
    let summary = folder.text("out/summary.md");
    has(&summary, &["| 10 in 2 |", "between two points are mostly not detected in these results."]);
    assert!(!summary.contains("only one launch"), "{summary}");
    let again = ["--set", "timing.launches=1", "--resume"];
    folder.raycl(&arguments(&device(), &again)).assert().success();
    has(&folder.text("out/summary.md"), &["Measured in only one launch of the program: all points."]);
    has(&folder.text("out/report.html"), &["Measured in only one launch of the program: all points."]);
}

#[test]
fn two_folders_of_kernels_are_compared_in_the_same_rounds() {
    let folder = new_folder();
    let new = folder.kernels("cast/vectors/local.cl", "//", "// Edited.\n//");
    let (old, new) = (repository("cl"), new);
    let both = ["--cl-dir", old.to_str().expect("UTF-8"), "--cl-dir", &new, "--fail-on-regression", "9999"];
    let device = device();
    let said = folder.output(&arguments(&device, &both));
    has(&said, &["local-vectors 4x4", "kernels, ms", "verdict"]);
    let records = folder.json_lines("out/records.jsonl");
    let of = |kernels: Value| records.iter().filter(move |record| record["kernels_of"] == kernels).count();
    // If a point's program is the same with both folders, the point is measured once.
    assert_eq!([of("cl".into()), of("kernels".into()), of(Value::Null)], [4, 2, 1]);
    assert!(records.iter().all(|record| record["sample_launches"] == serde_json::json!([0, 0, 0, 0, 0])));
    let message = folder.mistake(&[&arguments(&device, &both)[..], &["--cl-dir", "third"]].concat(), 2);
    has(&message, &["3 folders of kernels", "once, or twice"]);
    let one = ["--cl-dir", &new, "--fail-on-regression", "9999"];
    has(&folder.mistake(&arguments(&device, &one), 2), &["two folders of kernels", "--cl-dir twice"]);
}

#[test]
fn two_folders_of_kernels_may_differ_in_headers_and_both_must_have_the_experiments_values() {
    let (folder, device, old) = (new_folder(), device(), repository("cl"));
    // In the new folder of kernels, moller_trumbore.cl contains a ray-triangle test that reads nine floats of
    // each triangle. The test that it replaces reads twelve.
    let (of, file) = ("tests/overlay/cast/intersect/nine_floats.cl", "cast/intersect/moller_trumbore.cl");
    let new = folder.kernels_of(of, file, "record_floats: 9", "record_floats: 9");
    let [old, new] = [old.to_str().expect("UTF-8"), &new];
    let run = |folders: [&str; 2], strategies: &str| {
        let [first, second] = folders;
        let more = ["--cl-dir", first, "--cl-dir", second, "--set", "strategies=[]", "--set", strategies];
        arguments(&device, &more).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let words = run([old, new], "strategy=[{ preset = \"deferred\" }]");
    folder.output(&words.iter().map(String::as_str).collect::<Vec<_>>());
    let records = folder.json_lines("out/records.jsonl");
    let outcomes: Vec<_> = records.iter().map(|record| record["outcome"].as_str()).collect();
    assert_eq!(outcomes, [Some("measured"); 1 + 2 * 2]);
    let text = std::fs::read_to_string(repository("cl/cast/vectors/local.cl")).expect("a kernel file");
    folder.write(&format!("{new}/cast/vectors/mine.cl"), &text);
    for folders in [[old, new], [new, old]] {
        let words = run(folders, "strategy=[{ preset = \"deferred\", vectors = \"mine\" }]");
        let message = folder.mistake(&words.iter().map(String::as_str).collect::<Vec<_>>(), 2);
        has(&message, &["'mine' is not a value of the axis 'vectors'", old, "every value"]);
    }
}

#[test]
fn the_environment_says_what_ran_where() {
    let folder = new_folder();
    records(&folder, &["--set", "timing.seed=7", "--set", "baselines=[]"], 0);
    let environment: Value = serde_json::from_str(&folder.text("out/environment.json")).expect("JSON");
    assert_eq!(environment["raycl_version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(environment["config"], CONFIG);
    assert_eq!(environment["overrides"], serde_json::json!(["timing.seed = 7", "baselines = []"]));
    assert!(environment["host"]["cores"].as_u64() > Some(0), "{environment}");
    assert_eq!(environment["command_line"][1], "run");
    let devices = environment["devices"].as_array().expect("a list");
    assert_eq!(folder.json_lines("out/records.jsonl")[0]["device"], devices[0]["device"]);
    // The revision is known in a clone of the repository, in which `.git` is a folder, and in a worktree, in which it
    // is a file.
    let revision = environment["git_revision"].as_str();
    assert_eq!(revision.is_some(), repository(".git").exists(), "{revision:?}");
    assert!(revision.is_none_or(|revision| revision.trim_end_matches("-dirty").len() >= 12), "{revision:?}");
}

#[test]
fn a_dry_run_compiles_nothing_and_writes_nothing() {
    let (folder, device) = (new_folder(), device());
    folder.write("kernels/common/hit.cl", "no C at all");
    let text = folder.output(&arguments(&device, &["--dry-run", "--cl-dir", "kernels"]));
    has(&text, &["__local B", "scratch B", "naive 4x4", "local-vectors 8x2", "host", "5 points, 0 of which"]);
    assert!(!folder.path("out").exists());
    let json = folder.output(&arguments(&device, &["--dry-run", "--json", "--set", "baselines=[]"]));
    let mut points = serde_json::Deserializer::from_str(&json).into_iter::<Value>();
    let needs = points.next().expect("a point").expect("JSON")["needs"].clone();
    // Padding makes 36 x 20 work-items, each of which needs 108 bytes.
    assert_eq!((&needs["local_bytes"], &needs["scratch_bytes"]), (&0.into(), &(36 * 20 * 108).into()));
    assert_eq!(points.count(), 3);
    assert_eq!(folder.output(&arguments(&device, &["--dry-run", "--quiet"])), "");
    let refused = folder.mistake(&["run", "config.toml", "--out", "config.toml", "--dry-run"], 2);
    has(&refused, &["'config.toml' is a file; a folder is needed here"]);
}

/// With the hidden option `--asleep`, workers only wait, so this test opens no device.
#[test]
fn a_dry_run_with_resume_says_which_points_are_done() {
    let folder = new_folder();
    let usual = ["run", "config.toml", "--out", "out", "--asleep", "0.1", "--set", "baselines=[]"];
    let with = |strategies: &str, more: &[&str]| {
        let set = format!("strategies={strategies}");
        folder.output(&[&usual[..], &["--set", &set], more].concat())
    };
    let both = r#"["naive", "deferred"]"#;
    let resumed = |more: &[&str]| with(both, &[&["--resume", "--dry-run"][..], more].concat());
    has(&resumed(&[]), &["4 points, 0 of which cannot be measured. Nothing", "4 points in 1 launch"]);
    assert!(!folder.path("out").exists());
    with(r#"["naive"]"#, &["--quiet"]);
    has(
        &resumed(&[]),
        &["4 points, 0 of which cannot be measured; 2 are done. Nothing", "2 points in 1 launch"],
    );
    let json = resumed(&["--json"]);
    let points = serde_json::Deserializer::from_str(&json).into_iter::<Value>();
    for point in points.map(|point| point.expect("JSON")) {
        let label = point["label"].as_str().expect("a label");
        assert_eq!(point["done"], label.contains("naive"), "{point}");
    }
    // Without `--resume`, the plan has all points, although the run itself would be refused.
    let note = "note: out already holds results, so the run needs --resume or another folder\n";
    let all = ["4 points, 0 of which cannot be measured. Nothing", "4 points in 1 launch"];
    let text = with(both, &["--dry-run"]);
    has(&text, &[note, all[0], all[1]]);
    // With `--json`, standard output has only the points, so the note is in standard error.
    for (more, said) in [(&["--json"][..], note), (&["--json", "--quiet"][..], "")] {
        folder.raycl(&[&usual[..], &["--dry-run"], more].concat()).assert().success().stderr(said);
    }
    assert!(!resumed(&[]).contains("already holds"), "the run would continue");
}

#[test]
fn a_dry_run_refuses_the_folders_and_files_that_the_run_refuses() {
    let folder = new_folder();
    folder.write("others/letter.txt", "Dear reader,");
    let usual = ["run", "config.toml", "--asleep", "0.1", "--set", "baselines=[]"];
    folder.output(&[&usual[..], &["--out", "shards", "--shard", "1/2", "--quiet"]].concat());
    for (options, message) in [
        (["--out=shards", "--resume"], "shards holds an experiment that is divided into 2 shards"),
        (["--out=others", "--quiet"], "'others' is not a folder of results: it contains 'letter.txt'"),
        (["--out=new", "--peak=nosuch.json"], "nosuch.json"),
    ] {
        for dry_run in [&["--dry-run"][..], &[]] {
            has(&folder.mistake(&[&usual[..], &options, dry_run].concat(), 2), &[message]);
        }
    }
    assert!(!folder.path("new").exists());
}

#[test]
fn a_dry_run_says_under_which_name_an_equal_strategy_is_measured() {
    let folder = new_folder();
    let twin = "strategy=[{ preset = \"naive\", name = \"twin\" }]";
    let text = folder.output(&["run", "config.toml", "--asleep", "0.1", "--dry-run", "--set", twin]);
    has(&text, &["note: Strategy twin equals naive on all axes; raycl measures only naive.\n"]);
}

#[test]
fn the_teapot_in_48_kib_is_refused_with_arithmetic() {
    let (folder, device, config) = (WorkFolder::new(), device(), repository("configs/figure-8.toml"));
    let config = config.to_str().expect("UTF-8");
    let text = folder.output(&["run", config, "--dry-run", "--device", &device]);
    has(&text, &["104 B x 1026 triangles = 106704 B > 49152 B", "108 B x 32 x 32 = 110592 B > 49152 B"]);
}

#[test]
fn what_a_device_cannot_hold_is_an_outcome_and_no_failure() {
    let folder = new_folder();
    let records = records(&folder, &["--set", "emulate.local_bytes=1000", "--set", "baselines=[]"], 0);
    let (infeasible, measured): (Vec<_>, Vec<_>) =
        records.iter().partition(|record| record["outcome"] == "infeasible");
    assert_eq!((infeasible.len(), measured.len()), (2, 2));
    for record in infeasible {
        assert_eq!(record["name"], "local-vectors");
        has(
            record["reason"].as_str().expect("a reason"),
            &["108 B x ", "1728 B > 1000 B, the limit in [emulate]"],
        );
        assert!(record["median_ms"].is_null() && record["samples_ms"] == serde_json::json!([]), "{record}");
    }
}

#[test]
fn a_kernel_that_does_not_compile_is_an_outcome_and_a_failure() {
    let folder = new_folder();
    let kernels = folder.kernels("cast/shade.cl", "// Computes", "oops;\n// Computes");
    let records = records(&folder, &["--cl-dir", &kernels], 1);
    let failed: Vec<_> = records.iter().filter(|record| record["outcome"] == "build-failed").collect();
    assert_eq!((records.len(), failed.len()), (5, 4));
    for record in failed {
        has(record["reason"].as_str().expect("a reason"), &["cast/shade.cl:1"]);
    }
    has(&folder.text("out/summary.md"), &["build-failed", "cast/shade.cl:1"]);
}

#[test]
fn a_wrong_image_is_never_timed_and_shows_where() {
    let folder = new_folder();
    let kernels = folder.kernels("cast/shade.cl", "4.0f * M_PI_F", "5.0f * M_PI_F");
    let more = ["--cl-dir", &kernels, "--set", "strategies=[\"naive\"]"];
    let records = records(&folder, &more, 1);
    let wrong: Vec<_> = records.iter().filter(|record| record["outcome"] == "wrong-image").collect();
    assert_eq!((records.len(), wrong.len()), (3, 2));
    for record in wrong {
        assert!(record["median_ms"].is_null() && record["samples_ms"] == serde_json::json!([]), "{record}");
        // The changed kernel loses a fifth of the light.
        let difference = record["max_difference"].as_f64().expect("a difference");
        assert!((0.1..0.3).contains(&difference), "{record}");
        let picture = record["difference_image"].as_str().expect("a picture of the differences");
        assert!(folder.path("out").join(picture).exists(), "{picture}");
        assert!(record["worst_pixel"].is_array() && record["reason"].is_string(), "{record}");
    }
}

#[test]
fn a_device_named_twice_is_used_once() {
    let (folder, device) = (new_folder(), device());
    folder
        .raycl(&arguments(&device, &["--device", &device, "--quiet"]))
        .assert()
        .success()
        .stdout("")
        .stderr("");
    assert_eq!(folder.json_lines("out/records.jsonl").len(), 5);
}

#[test]
fn results_are_never_overwritten_and_find_a_free_folder() {
    let (work_folder, device) = (new_folder(), device());
    let one_point = ["--set", "strategies=[]", "--quiet"];
    let before = records(&work_folder, &one_point, 0);
    let message = work_folder.mistake(&arguments(&device, &one_point), 2);
    has(&message, &["out already holds results", "--out"]);
    assert_eq!(work_folder.json_lines("out/records.jsonl"), before);
    for folder in ["results/config", "results/config-2"] {
        work_folder.output(&[&["run", "config.toml", "--device", &device], &one_point[..]].concat());
        assert_eq!(work_folder.json_lines(&format!("{folder}/records.jsonl")).len(), 1, "{folder}");
    }
}

/// With the hidden option `--asleep`, workers only wait, so this test opens no device.
#[test]
fn runs_of_one_config_that_begin_at_once_have_folders_of_their_own() {
    let work_folder = new_folder();
    let start = |_| {
        let mut command = crate::binary::program();
        command.args(["run", "config.toml", "--asleep", "0.1", "--set", "baselines=[]", "--quiet"]);
        command.current_dir(work_folder.path("")).env("RAYCL_LOCK_DIR", work_folder.path(".locks"));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("it starts")
    };
    let runs: Vec<Child> = (0..3).map(start).collect();
    for run in runs {
        let output = crate::binary::finish(run);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for folder in ["results/config", "results/config-2", "results/config-3"] {
        assert_eq!(work_folder.json_lines(&format!("{folder}/records.jsonl")).len(), 4, "{folder}");
    }
}

/// With the hidden option `--asleep`, the worker only waits, so this test opens no device.
#[test]
fn lines_about_the_progress_show_control_characters_of_paths_as_escapes() {
    let folder = new_folder();
    let mut command = crate::binary::program();
    command.args(["run", "config.toml", "--asleep", "0.1", "--set", "baselines=[]", "--shard", "1/1"]);
    command.args(["--out", "o\u{1b}ut"]).current_dir(folder.path(""));
    let output = crate::binary::run(command.env("RAYCL_LOCK_DIR", folder.path(".locks")));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    has(&said, &["shard 1/1: o\\u001but"]);
    assert!(!said.contains('\u{1b}'), "{said}");
}

#[test]
fn a_mistake_in_a_scene_or_in_the_peak_rates_leaves_no_folder() {
    let (folder, device) = (new_folder(), device());
    folder.write("peak.json", "no rates");
    let leaves_none = |more: &[&str], part: &str| {
        has(&folder.mistake(&arguments(&device, more), 2), &[part]);
        assert!(!folder.path("out").exists(), "{more:?}");
    };
    leaves_none(&["--peak=peak.json"], "peak.json does not contain peak rates");
    folder.write("scene.toml", &TRIANGLE.replace("power", "pwer"));
    for more in [&[][..], &["--quiet"], &["--spread"]] {
        leaves_none(more, "did you mean `power`?");
    }
}

#[test]
fn a_folder_that_cannot_be_made_is_refused() {
    let (folder, device) = (new_folder(), device());
    let message = folder.mistake(&["run", "config.toml", "--device", &device, "--out", "scene.toml/out"], 2);
    has(&message, &["cannot make scene.toml/out: 'scene.toml' is a file", "--out DIR"]);
    std::os::unix::fs::symlink("nowhere", folder.path("link")).expect("a link");
    for out in ["link", "link/out"] {
        let message = folder.mistake(&["run", "config.toml", "--device", &device, "--out", out], 2);
        has(&message, &["'link' is a link without a target", "--out DIR"]);
    }
}

#[test]
fn without_a_terminal_progress_is_plain_lines_and_the_table_comes_last() {
    let (folder, device) = (new_folder(), device());
    // The folder does not exist, so nothing is resumed.
    let output = folder.raycl(&arguments(&device, &["--resume"])).assert().success().get_output().clone();
    let (progress, table) =
        (String::from_utf8(output.stderr).expect("UTF-8"), String::from_utf8(output.stdout).expect("UTF-8"));
    assert_eq!(progress.lines().filter(|line| line.contains(" ms, n = 5")).count(), 5, "{progress}");
    has(&progress, &["out has no results yet: the run begins\n", "[1/5", "[5/5] "]);
    assert!(!progress.contains('\u{1b}') && !table.contains('\u{1b}'), "{progress}{table}");
    has(&table, &["median ms", "strategy", "4x4", "8x2", "* fastest", "out/images", "out/summary.md"]);
}

#[test]
fn configs_state_their_question_and_plan_on_any_device() {
    let (folder, device) = (WorkFolder::new(), device());
    for name in ["quick", "figure-6", "figure-7", "figure-8", "next-steps", "beyond", "samples"] {
        let config = repository(&format!("configs/{name}.toml"));
        let text = folder.output(&["run", config.to_str().expect("UTF-8"), "--dry-run", "--device", &device]);
        has(&text, &["points, ", "Nothing was compiled"]);
    }
}

#[test]
fn where_processors_are_is_not_measured_if_all_samples_are_kept() {
    // The tests start raycl with RAYCL_MOVED_SAMPLES=keep (tests/binary/mod.rs), so raycl keeps all samples, and need
    // not measure the core-to-core latency to find out where processors are.
    let folder = new_folder();
    let records = records(&folder, &[], 0);
    let samples = folder.json_lines("out/samples.jsonl");
    assert!(samples.iter().all(|sample| sample["core_to_core_ns"].is_null()), "{samples:?}");
    assert!(records.iter().all(|record| record["moved_samples"].is_null()), "{records:?}");
}
