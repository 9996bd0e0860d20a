//! Two commands that measure on one device: the second one waits, reports which process it waits for, and never
//! measures at the same time as the first.

use crate::binary::{TRIANGLE, WorkFolder, config, device, has, repository, send_interrupt, until};
use crate::faults::{children, is_alive};
use serde_json::Value;
use std::fs::{File, TryLockError};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Five points: the baseline, and two kernels at two local sizes.
const POINTS: &str = r#"
image_sizes = [[40, 25]]
local_sizes = [2, 4]
strategies = ["naive", "deferred"]
baselines = ["serial"]
"#;
/// The text of a file with one case (a scene and an image size) for `raycl rule`.
const CASE: &str = r#"
[[case]]
name = "one"
scene = "scene.toml"
size = [24, 15]
kinds = ["few"]
devices = ["cpu", "gpu"]
"#;
/// Options that make a run hang while it times a kernel.
const HANGS: [&str; 2] = ["--fault", "hang@cast:2"];

fn new_folder() -> WorkFolder {
    WorkFolder::with(&[("scene.toml", TRIANGLE), ("test.toml", &config(POINTS, 1, 5))])
}

/// Starts raycl in the folder, and writes its standard error to the file `said` in the folder.
fn start(folder: &WorkFolder, arguments: &[&str], said: &str) -> Child {
    let mut command = crate::binary::program();
    command.args(arguments).current_dir(folder.path("")).env("RAYCL_LOCK_DIR", folder.path(".locks"));
    command.env("RAYCL_CACHE_MIB", "0");
    let said = File::create(folder.path(said)).expect("a file");
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(said).spawn().expect("it starts")
}

fn run<'a>(out: &'a str, device: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["run", "test.toml", "--quiet", "--device", device, "--out", out], more].concat()
}

/// Starts a run that hangs while it times a point of its experiment, and therefore keeps the device locked.
fn holder(folder: &WorkFolder, device: &str) -> Child {
    let holder = start(folder, &run("first", device, &HANGS), "first.txt");
    until("the first hangs", || folder.path("first/.hangs").exists());
    holder
}

/// Starts a run with the options `more`, and returns when the run waits for the process `holder`.
fn waiter(folder: &WorkFolder, device: &str, more: &[&str], holder: &Child) -> Child {
    let waiter = start(folder, &run("second", device, more), "second.txt");
    let words = format!("waiting for process {}, `raycl run test.toml", holder.id());
    until("the second waits", || folder.text("second.txt").contains(&words));
    waiter
}

fn end(mut process: Child) {
    process.kill().expect("a kill");
    process.wait().expect("a process");
}

/// Waits until a process has ended, and returns its exit code.
fn code(process: Child) -> Option<i32> {
    crate::binary::finish(process).status.code()
}

#[test]
fn a_second_run_times_nothing_until_the_first_has_ended_even_by_sigkill() {
    let (folder, device) = (new_folder(), device());
    let first = holder(&folder, &device);
    let second = waiter(&folder, &device, &[], &first);
    // While the first run holds the device, the second run may time only its baseline, with at most three
    // samples. If the device is the host's CPU, the second run must not time anything, not even its baseline
    // (a ray caster on the host).
    let timed = folder.json_lines("second/samples.jsonl").len();
    assert!(timed <= 3, "{timed} samples beside the first");
    end(first);
    assert_eq!(code(second), Some(0), "{}", folder.text("second.txt"));
    let records = folder.json_lines("second/records.jsonl");
    assert!(
        records.len() == 5 && records.iter().all(|record| record["outcome"] == "measured"),
        "{records:?}"
    );
}

#[test]
fn what_measures_is_refused_with_no_wait_and_a_picture_never_waits() {
    let (folder, device) = (new_folder(), device());
    folder.write("cases.toml", CASE);
    let first = holder(&folder, &device);
    let process = format!("process {}, `raycl run test.toml", first.id());
    let render = ["render", "scene.toml", "--width", "40", "--height", "25", "--device", &device];
    for arguments in [
        run("second", &device, &["--no-wait"]),
        [&render[..], &["--repeat", "2", "--no-wait"]].concat(),
        vec!["render", "scene.toml", "--devices", &device, "--repeat", "2", "--no-wait"],
        vec!["peak", "--device", &device, "--no-wait"],
        vec!["rule", "cases.toml", "--device", &device, "--no-wait"],
    ] {
        let message = folder.mistake(&arguments, 1);
        has(&message, &[&process, "without --no-wait, raycl waits"]);
    }
    let refused = folder.raycl(&run("third", &device, &["--peak", "--no-wait"])).assert().code(1);
    has(&String::from_utf8_lossy(&refused.get_output().stderr), &[&process]);
    // The results of `raycl noise` are in a temporary folder, so no command can continue the measurement.
    let noise = folder.mistake(&["noise", "--quiet", "--device", &device, "--no-wait"], 1);
    has(&noise, &[&process, "without --no-wait, raycl waits"]);
    assert!(!noise.contains("to continue from here"), "{noise}");
    folder.output(&render);
    end(first);
    folder.output(&[&render[..], &["--repeat", "2", "--no-wait", "-o", "other.png"]].concat());
}

#[test]
fn the_time_for_which_a_picture_waits_is_not_the_time_of_its_frames() {
    let (folder, device) = (new_folder(), device());
    let first = holder(&folder, &device);
    let render = ["render", "scene.toml", "--width", "40", "--height", "25", "--device", &device];
    // The report is on standard error, because the picture is on standard output.
    let second = start(&folder, &[&render[..], &["--repeat", "2", "--json", "-o", "-"]].concat(), "said.txt");
    let words = format!("waiting for process {}", first.id());
    until("the picture waits", || folder.text("said.txt").contains(&words));
    std::thread::sleep(Duration::from_millis(100));
    end(first);
    assert_eq!(code(second), Some(0), "{}", folder.text("said.txt"));
    let said = folder.text("said.txt");
    let report = said.find('{').map(|begin| serde_json::from_str::<Value>(&said[begin..]).expect("JSON"));
    let parts = report.expect("a report")["parts"].as_array().expect("a list").clone();
    let wait = parts.iter().find(|part| part["part"] == "wait").expect("a part");
    // raycl began to wait before it printed the message, and the first process held the device for 100 ms
    // after this message.
    assert!(wait["ms"].as_f64().is_some_and(|ms| ms >= 100.0), "{said}");
}

/// Returns true if some process holds a device lock.
fn is_held(folder: &WorkFolder) -> bool {
    let files = std::fs::read_dir(folder.path(".locks")).into_iter().flatten().flatten();
    files
        .filter_map(|file| File::open(file.path()).ok())
        .any(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

#[test]
fn a_device_is_held_while_frames_are_cast_and_while_its_rates_are_measured() {
    let device = device();
    let frames = ["--width", "400", "--height", "250", "--repeat", "3000"];
    for arguments in [
        [&["render", "scene.toml", "--device", &device], &frames[..]].concat(),
        [&["render", "scene.toml", "--devices", &device], &frames[..]].concat(),
        vec!["peak", "--device", &device],
    ] {
        let folder = new_folder();
        let mut process = start(&folder, &arguments, "said.txt");
        // The test looks ten times in a row, since a process that only checks whether a lock is free also
        // holds the lock for a moment.
        let look = || {
            std::thread::sleep(Duration::from_millis(2));
            is_held(&folder)
        };
        let held = loop {
            if (0..10).all(|_| look()) {
                break true;
            }
            if process.try_wait().expect("a process").is_some() {
                break false;
            }
        };
        assert!(held, "{arguments:?}: {}", folder.text("said.txt"));
        end(process);
    }
}

#[test]
fn ctrl_c_ends_the_waiting_and_says_how_to_go_on() {
    let (folder, device) = (new_folder(), device());
    let first = holder(&folder, &device);
    let second = waiter(&folder, &device, &[], &first);
    send_interrupt(second.id());
    assert_eq!(code(second), Some(130));
    has(&folder.text("second.txt"), &["interrupted", "to continue from here", "--resume"]);
    end(first);
    folder.output(&run("second", &device, &["--resume"]));
}

#[test]
fn a_shard_that_waits_for_its_peak_rates_is_going_and_an_interruption_ends_its_processes() {
    let (folder, device) = (new_folder(), device());
    let first = holder(&folder, &device);
    let options = ["--shard", "1/1", "--peak", "--hang-limit", "2"];
    let second = waiter(&folder, &device, &options, &first);
    // `raycl peak` measures in a child process, so that a driver's crash does not end raycl. The child
    // process of `raycl peak` waits for the device.
    let waiting: Vec<u32> = children(second.id()).into_iter().flat_map(children).collect();
    assert_eq!(waiting.len(), 1, "{waiting:?}");
    // The command `merge` reads the shard's progress twice, five seconds apart (`--between 5`). The waiting shard
    // makes no progress in this time. If the shard did not report that it waits for the device, it would count as
    // hung after two seconds (`--hang-limit`).
    let status = ["merge", "second", "--status", "--between", "5", "--json"];
    until("the shard is going", || folder.output(&status).contains("\"going\""));
    // The signal reaches only the run, unlike Ctrl-C in a terminal.
    send_interrupt(second.id());
    assert_eq!(code(second), Some(130));
    has(&folder.text("second.txt"), &["interrupted: the devices' peak rates were being measured"]);
    until("the process that waited has ended", || !is_alive(waiting[0]));
    end(first);
}

#[test]
fn two_runs_at_once_both_measure_everything() {
    let (folder, device) = (new_folder(), device());
    let runs = ["a", "b"].map(|out| (out, start(&folder, &run(out, &device, &[]), &format!("{out}.txt"))));
    for (out, process) in runs {
        assert_eq!(code(process), Some(0), "{}", folder.text(&format!("{out}.txt")));
        assert_eq!(folder.json_lines(&format!("{out}/records.jsonl")).len(), 5);
    }
}

#[test]
fn a_folder_that_cannot_hold_locks_is_an_error_with_its_remedy() {
    let folder = new_folder();
    std::fs::write(folder.path("file"), "").expect("a file");
    let mut command = folder.raycl(&run("out", &device(), &[]));
    let refused = command.env("RAYCL_LOCK_DIR", folder.path("file/locks")).assert().code(1);
    has(&String::from_utf8_lossy(&refused.get_output().stderr), &["file/locks", "RAYCL_LOCK_DIR"]);
}

#[test]
fn pocl_has_no_more_threads_than_the_process_may_run_on() {
    let scene = repository("scenes/triangle.toml");
    let threads = |program: &str, more: &[&str], variable: Option<&str>| {
        let folder = WorkFolder::new();
        let mut command = Command::new(program);
        command.env("XDG_CONFIG_HOME", crate::binary::NO_SETTINGS);
        command.args(more).arg(env!("CARGO_BIN_EXE_raycl")).arg("render").arg(&scene);
        command.args([
            "--width",
            "16",
            "--height",
            "10",
            "--device",
            "portable computing language",
            "--json",
        ]);
        command.current_dir(folder.path(""));
        for name in ["POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT", "POCL_MAX_COMPUTE_UNITS"] {
            command.env_remove(name);
        }
        command.envs(variable.map(|count| ("POCL_MAX_PTHREAD_COUNT", count)));
        let output = crate::binary::run(&mut command);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let at = text.find('{').unwrap_or_else(|| panic!("{output:?}"));
        let json: serde_json::Value = serde_json::from_str(&text[at..]).expect("JSON");
        json["threads"].as_u64().expect("PoCL's threads are known")
    };
    let all = std::thread::available_parallelism().expect("a number").get() as u64;
    assert_eq!(threads("env", &[], None), all);
    // The lowest processor that this process may run on.
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).expect("a list");
    let first = list.trim().split([',', '-']).next().expect("a processor");
    assert_eq!(threads("taskset", &["-c", first], None), 1);
    assert_eq!(threads("env", &[], Some("1")), 1, "the user's variable decides");
}
