//! The programs under examples/, which use the stable part of the library, do what their comments say. The
//! command `cargo test` builds these programs. The command `cargo test --test all` does not build the example
//! programs, so `cargo build --examples` must be run first.

use crate::binary::{NO_SETTINGS, TRIANGLE, WorkFolder, config, device, has};
use std::path::Path;
use std::process::{Command, Output};

/// Returns the command that runs an example in a folder.
pub fn example(folder: &WorkFolder, name: &str, words: &[&str]) -> Command {
    let program = Path::new(env!("CARGO_BIN_EXE_raycl")).with_file_name("examples").join(name);
    assert!(program.is_file(), "{}: `cargo build --examples` makes it", program.display());
    let mut command = Command::new(program);
    command.args(words).current_dir(folder.path("")).env("XDG_CONFIG_HOME", NO_SETTINGS);
    command.env("RAYCL_LOCK_DIR", folder.path(".locks")).env("RAYCL_CACHE_MIB", "0");
    command
}

/// Runs an example in a folder.
fn run(folder: &WorkFolder, name: &str, words: &[&str]) -> Output {
    crate::binary::run(&mut example(folder, name, words))
}

fn said(output: Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[test]
fn one_casts_a_picture() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let text = said(run(&folder, "cast", &["scene.toml", "a.png", &device()]));
    has(&text, &[" ms, ", " pixels hit something"]);
    assert!(!text.contains(" 0 pixels"), "{text}");
    let picture = image::open(folder.path("a.png")).expect("a picture");
    assert_eq!((picture.width(), picture.height()), (320, 200));
    // The message about a mistake shows the line, as in raycl's own commands.
    folder.write("bad.toml", &TRIANGLE.replace("power", "pwer"));
    let output = run(&folder, "cast", &["bad.toml", "b.png"]);
    assert!(!output.status.success());
    has(&String::from_utf8_lossy(&output.stderr), &["bad.toml:8", "did you mean `power`"]);
}

#[test]
fn a_transparent_picture_is_saved_only_with_its_alpha() {
    let folder = WorkFolder::with(&[("scene.toml", &format!("background = \"transparent\"\n{TRIANGLE}"))]);
    let output = run(&folder, "cast", &["scene.toml", "a.jpg", &device()]);
    assert!(!output.status.success() && !folder.path("a.jpg").exists());
    has(&String::from_utf8_lossy(&output.stderr), &["'a.jpg': a JPEG has no alpha channel"]);
    said(run(&folder, "cast", &["scene.toml", "a.png", &device()]));
    assert!(image::open(folder.path("a.png")).expect("a picture").color().has_alpha());
}

#[test]
fn a_file_of_somebody_else_stays_and_no_option_of_raycl_is_advised() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("a.png", "mine")]);
    let output = run(&folder, "cast", &["scene.toml", "a.png", &device()]);
    assert!(!output.status.success());
    assert_eq!(folder.text("a.png"), "mine");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    has(&message, &["'a.png' exists", "save(OTHER_PATH)"]);
    assert!(!message.contains("--force"), "{message}");
}

#[test]
fn one_reads_hits() {
    let folder =
        WorkFolder::with(&[("scene.toml", &format!("{TRIANGLE}\n[[object]]\nshape = \"ground\"\n"))]);
    let text = said(run(&folder, "hits", &["scene.toml"]));
    has(&text, &["object 0: ", "the nearest at depth 2.000", "object 1: "]);
    assert_eq!(text.lines().count(), 2, "{text}");
}

#[test]
fn one_runs_an_experiment() {
    let points = "image_sizes = [[8, 5]]\nlocal_sizes = [4]\nstrategies = [\"naive\", \"deferred\"]\n";
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("config.toml", &config(points, 0, 1))]);
    let text = said(run(&folder, "experiment", &["config.toml", "out", &device()]));
    has(&text, &["naive on ", "deferred on ", "2 of 2 points were measured"]);
    assert_eq!(folder.json_lines("out/records.jsonl").len(), 2);
    // The report is written as by `raycl run`.
    for file in ["report.html", "plots", "exports/points.csv"] {
        assert!(folder.path("out").join(file).exists(), "{file}");
    }
}

/// The library checks the same environment variables as raycl's commands.
#[test]
fn a_variable_that_cannot_be_used_is_a_mistake_and_named() {
    let folder = crate::binary::one_point();
    for (name, words) in [("cast", ["scene.toml", "a.png"]), ("experiment", ["config.toml", "out"])] {
        for (variable, value) in
            [("RAYCL_CACHE_MIB", "1G"), ("RAYCL_MOVED_SAMPLES", "kep"), ("RAYCL_LOCK_DIR", "locks")]
        {
            let output = crate::binary::run(example(&folder, name, &words).env(variable, value));
            assert!(!output.status.success(), "{name}, {variable}");
            has(&String::from_utf8_lossy(&output.stderr), &[&format!("{variable}: '{value}' is not")]);
        }
    }
    assert!(!folder.path("a.png").exists() && !folder.path("out").exists());
}

/// Without a call of `serve_if_worker`, a worker would run the experiment again and start further workers
/// without end. raycl therefore refuses to run an experiment in a process that has a worker's environment
/// variable. This test starts an example program with a worker's environment variable, but without a worker's
/// arguments.
#[test]
fn a_worker_runs_no_experiment_of_its_own() {
    let folder = crate::binary::one_point();
    let mut command = example(&folder, "experiment", &["config.toml", "out", &device()]);
    let output = crate::binary::run(command.env("RAYCL_WORKER", "1"));
    assert!(!output.status.success() && !folder.path("out").exists());
    has(&String::from_utf8_lossy(&output.stderr), &["as a worker", "raycl::serve_if_worker"]);
}

/// A program that uses the library may have a first argument `worker` of its own. In this test, the config's
/// file has the name `worker`.
#[test]
fn an_argument_of_the_users_own_makes_no_worker() {
    let folder = crate::binary::one_point();
    std::fs::rename(folder.path("config.toml"), folder.path("worker")).expect("a config");
    let text = said(run(&folder, "experiment", &["worker", "out", &device()]));
    has(&text, &["1 of 1 points were measured"]);
}

/// `raycl run` limits the threads of PoCL, unless the user has set their number. A program that uses raycl's
/// library limits PoCL's threads, too, so that it measures the same times as `raycl run`.
#[test]
fn an_experiment_runs_with_the_variables_of_drivers_that_raycl_run_sets() {
    let folder = crate::binary::one_point();
    said(run(&folder, "experiment", &["config.toml", "of-library", &device()]));
    folder.output(&["run", "config.toml", "--out", "of-raycl", "--device", &device(), "--quiet"]);
    let variables = |out: &str| {
        let text = folder.text(&format!("{out}/environment.json"));
        serde_json::from_str::<serde_json::Value>(&text).expect("JSON")["variables"].clone()
    };
    let variables_of_library = variables("of-library");
    assert_eq!(variables_of_library, variables("of-raycl"));
    let is_set = |name: &str| {
        variables_of_library
            .as_array()
            .is_some_and(|all| all.iter().any(|one| one.as_str().is_some_and(|text| text.starts_with(name))))
    };
    assert!(is_set("POCL_CPU_MAX_CU_COUNT=") || is_set("POCL_MAX_COMPUTE_UNITS="), "{variables_of_library}");
}
