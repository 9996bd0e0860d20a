//! Tests of raycl's cache on disk: programs are compiled once, and a damaged entry of the cache is replaced.

use crate::binary::{TRIANGLE, WorkFolder, device, has, until};
use assert_cmd::Command;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// An experiment with two scenes and two strategies, one of which uses a tree.
const CONFIG: &str = r#"question = "Is it compiled again?"
expectation = "No."
scenes = ["scene.toml", "other.toml"]
image_sizes = [[17, 9]]
local_sizes = [2]
strategies = ["deferred", "bvh"]

[timing]
launches = 2
warmup = 0
min_samples = 10
max_samples = 10
"#;

/// An experiment with a preset that is meant for another kind of device than the test device.
const OTHERS: &str = r#"question = "Is a preset for GPUs measured on a CPU?"
expectation = "Where somebody asks for it."
scenes = ["scene.toml"]
image_sizes = [[17, 9]]
local_sizes = [[8, 4]]
strategies = ["deferred", "tiled-wide"]

[timing]
launches = 1
warmup = 0
min_samples = 5
max_samples = 5
"#;

fn folder_with(config: &str) -> WorkFolder {
    let other = TRIANGLE.replace("little", "other").replace("[0, 1, -2]", "[0, 0.7, -2]");
    WorkFolder::with(&[("scene.toml", TRIANGLE), ("other.toml", &other), ("config.toml", config)])
}

/// Returns a command that starts raycl with a cache of its own in the folder, but with the user's cache of
/// PoCL.
fn raycl(folder: &WorkFolder, arguments: &[&str]) -> Command {
    let home = PathBuf::from(std::env::var_os("HOME").unwrap_or_default());
    let caches = std::env::var_os("XDG_CACHE_HOME").map_or(home.join(".cache"), PathBuf::from);
    let mut command = folder.raycl(arguments);
    if std::env::var_os("POCL_CACHE_DIR").is_none() {
        command.env("POCL_CACHE_DIR", caches.join("pocl/kcache"));
    }
    command.env("XDG_CACHE_HOME", folder.path(".caches")).env("RAYCL_CACHE_MIB", "64");
    command
}

/// Runs the config with its results in the folder `out`, and returns its records.
fn records(folder: &WorkFolder, out: &str, more: &[&str]) -> Vec<Value> {
    let device = device();
    let arguments = [&["run", "config.toml", "--out", out, "--device", &device], more].concat();
    raycl(folder, &arguments).assert().success();
    folder.json_lines(&format!("{out}/records.jsonl"))
}

fn fields<'a>(records: &'a [Value], field: &str) -> Vec<&'a Value> {
    records.iter().map(|record| &record[field]).collect()
}

fn entries(folder: &WorkFolder) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder.path(".caches/raycl")).expect("a cache");
    let programs = files.map(|file| file.expect("a file").path());
    programs.filter(|path| path.to_string_lossy().contains("/program-")).collect()
}

fn spoil(path: &Path) {
    let mut bytes = std::fs::read(path).expect("an entry");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(path, bytes).expect("an entry");
}

#[test]
fn a_program_is_compiled_once_and_a_spoilt_entry_again() {
    let folder = folder_with(CONFIG);
    let from_cache = |records: &[Value]| {
        fields(records, "build_from_cache").into_iter().filter(|value| **value == Value::Bool(true)).count()
    };
    let first = records(&folder, "first", &[]);
    assert_eq!(fields(&first, "outcome"), vec!["measured"; 4]);
    // The second scene uses the programs of the first scene, since the two scenes differ only in their name and in
    // the place of a vertex.
    assert_eq!(from_cache(&first), 2, "{first:?}");
    assert_eq!(entries(&folder).len(), 2);
    let second = records(&folder, "second", &[]);
    assert_eq!(from_cache(&second), 4, "{second:?}");
    assert_eq!(fields(&first, "image_hash"), fields(&second, "image_hash"));
    entries(&folder).iter().for_each(|path| spoil(path));
    let third = records(&folder, "third", &[]);
    assert_eq!(from_cache(&third), 2, "{third:?}");
    assert_eq!(fields(&first, "image_hash"), fields(&third, "image_hash"));
    assert_eq!(fields(&first, "program_hash"), fields(&third, "program_hash"));
}

#[test]
fn the_cache_is_shown_cleared_and_named() {
    let work_folder = folder_with(CONFIG);
    let said = |arguments: &[&str]| {
        let output = raycl(&work_folder, arguments).assert().success().get_output().clone();
        String::from_utf8(output.stdout).expect("UTF-8")
    };
    let folder = work_folder.path(".caches/raycl").display().to_string();
    assert_eq!(said(&["cache", "path"]).trim(), folder);
    let path: Value = serde_json::from_str(&said(&["cache", "path", "--json"])).expect("JSON");
    assert_eq!(path, serde_json::json!({ "folder": folder }));
    // A folder's name may contain a colour code, which must not reach the terminal.
    let red = work_folder.path("a\u{1b}[31mb");
    let path = raycl(&work_folder, &["cache", "path"]).env("XDG_CACHE_HOME", red).assert().success();
    has(&String::from_utf8_lossy(&path.get_output().stdout), &["/a\\u001b[31mb/raycl"]);
    has(&said(&["cache"]), &[&folder, "0 entries", "of at most 67.1 MB"]);
    records(&work_folder, "out", &["--set", "strategies=[\"deferred\"]"]);
    let others = work_folder.path(".caches/raycl/somebody-elses");
    std::fs::write(&others, "a file").expect("a file");
    let shown: Value = serde_json::from_str(&said(&["cache", "show", "--json"])).expect("JSON");
    assert!(shown["entries"].as_u64() > Some(0) && shown["bytes"].as_u64() > Some(1000), "{shown}");
    let removed: Value = serde_json::from_str(&said(&["cache", "clear", "--json"])).expect("JSON");
    for key in ["folder", "entries", "bytes", "limit_bytes"] {
        assert_eq!(removed[key], shown[key], "{key}");
    }
    has(&said(&["cache", "clear"]), &["0 entries removed"]);
    assert!(entries(&work_folder).is_empty() && others.exists());
    let none = raycl(&work_folder, &["cache"]).env("RAYCL_CACHE_MIB", "0").assert().success();
    has(&String::from_utf8_lossy(&none.get_output().stdout), &["Nothing is stored", "RAYCL_CACHE_MIB is 0"]);
    raycl(&work_folder, &["cache", "path"]).env("RAYCL_CACHE_MIB", "0").assert().code(1);
    assert!(!said(&["cache"]).contains("stores nothing"));
    std::fs::remove_dir_all(work_folder.path(".caches/raycl")).expect("the cache's folder");
    work_folder.write(".caches/raycl", "a file");
    has(&said(&["cache"]), &["raycl stores nothing in this folder", "it is not a folder"]);
    let shown: Value = serde_json::from_str(&said(&["cache", "--json"])).expect("JSON");
    assert_eq!(shown["unusable"], "it is not a folder");
}

#[test]
fn a_preset_for_another_kind_of_device_is_measured_where_that_is_asked_for() {
    let folder = folder_with(OTHERS);
    let outcomes = |records: &[Value]| -> Vec<String> {
        fields(records, "outcome")
            .into_iter()
            .map(|outcome| outcome.as_str().unwrap_or("?").to_owned())
            .collect()
    };
    let run = |out: &str, more: &[&str]| {
        let device = device();
        let arguments = [&["run", "config.toml", "--out", out, "--device", &device], more].concat();
        folder.raycl(&arguments).assert().success();
        folder.json_lines(&format!("{out}/records.jsonl"))
    };
    let mut passed_over = run("out", &[]);
    passed_over.sort_by_key(|record| record["name"].as_str().map(str::to_owned));
    assert_eq!(outcomes(&passed_over), ["measured", "other-kind"]);
    let record = &passed_over[1];
    assert_eq!((&record["name"], &record["build_ms"]), (&"tiled-wide".into(), &Value::Null));
    has(record["reason"].as_str().expect("a reason"), &["meant for GPUs", "any_kind = true"]);
    let summary = folder.text("out/summary.md");
    has(&summary, &["other-kind", "meant for GPUs"]);
    let named = run("named", &["--set", "strategies=[\"tiled-wide\"]"]);
    assert_eq!(outcomes(&named), ["measured"]);
    // Points of the experiment that were skipped are measured if the user requests them, and points that were
    // measured before are not measured again.
    let resumed = run("out", &["--set", "any_kind=true", "--resume"]);
    assert_eq!(outcomes(&resumed), ["other-kind", "measured", "measured"].map(str::to_owned));
    let dry = folder.output(&["run", "config.toml", "--device", &device(), "--dry-run"]);
    has(&dry, &["meant for GPUs", "1 is meant for devices of another kind"]);
}

#[test]
fn a_pictures_time_is_all_in_parts_and_what_was_found_of_devices_is_stored() {
    let folder = folder_with(CONFIG);
    let device = device();
    let arguments =
        ["render", "scene.toml", "--width", "40", "--height", "25", "--json", "--device", &device];
    let report = || -> Value {
        let output = raycl(&folder, &arguments).assert().success().get_output().clone();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!said.contains("generated"), "a compiler's chatter: {said}");
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    let first = report();
    let is_stored = || !entries(&folder).is_empty();
    // If the driver does not return a program's binary immediately, a separate process compiles the program
    // and stores its binary.
    until("the program is kept", is_stored);
    let second = report();
    assert_eq!([&first["build_from_cache"], &second["build_from_cache"]], [false, true]);
    let note =
        "another process is storing the compiled program, so that raycl need not compile it the next time";
    let is_noted =
        |report: &Value| report["notes"].as_array().is_some_and(|notes| notes.contains(&note.into()));
    // If the driver returns a binary at once, raycl stores it without another process.
    let in_background = device.to_lowercase().contains("portable computing language");
    assert_eq!([is_noted(&first), is_noted(&second)], [in_background, false], "{first} {second}");
    // The kernels of a folder are probably being edited, so their programs are not stored in the background.
    let cl = crate::binary::repository("cl");
    let edited = [&arguments[..], &["--strategy", "naive", "--cl-dir", cl.to_str().expect("text")]].concat();
    let output = raycl(&folder, &edited).assert().success().get_output().clone();
    let edited: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&edited["build_from_cache"], is_noted(&edited)), (&Value::Bool(false), false), "{edited}");
    for report in [&first, &second] {
        let parts = report["parts"].as_array().expect("parts");
        let sum: f64 = parts.iter().filter_map(|part| part["ms"].as_f64()).sum();
        let total = report["total_ms"].as_f64().expect("a total");
        assert!((sum - total).abs() < 1e-6 * total, "{report}");
        for wanted in ["start", "load", "discover", "build", "casting", "read", "save"] {
            assert!(parts.iter().any(|part| part["part"] == wanted), "{wanted}: {report}");
        }
    }
    assert_eq!(first["device"], second["device"]);
    let files = std::fs::read_dir(folder.path(".caches/raycl")).expect("a cache");
    let names: Vec<_> =
        files.map(|file| file.expect("a file").file_name().into_string().expect("text")).collect();
    assert!(names.iter().any(|name| name.starts_with("devices-")), "{names:?}");
}

#[test]
fn a_variable_that_leaves_pocl_without_devices_is_named() {
    let folder = folder_with(CONFIG);
    let listed = folder.raycl(&["devices"]).env("POCL_DEVICES", "nonsense").assert().success();
    let said = String::from_utf8_lossy(&listed.get_output().stdout).into_owned();
    has(
        &said,
        &["Note: PoCL lists only the devices", "'nonsense'", "unset POCL_DEVICES, or set it to pthread."],
    );
}

#[test]
#[cfg(target_os = "linux")]
fn without_a_cache_folder_that_can_be_written_pictures_are_cast_all_the_same() {
    let folder = folder_with(CONFIG);
    std::fs::create_dir(folder.path("temporary")).expect("a folder");
    let device = device();
    let render = |name: &str, value: &str| {
        let arguments =
            ["render", "scene.toml", "--width", "17", "--height", "9", "-o", "a.png", "--device", &device];
        let mut command = folder.raycl(&arguments);
        command
            .env_remove("XDG_CACHE_HOME")
            .env_remove("POCL_CACHE_DIR")
            .env("TMPDIR", folder.path("temporary"));
        command.env(name, value).assert()
    };
    render("HOME", "/dev/null").success();
    let user = rustix::process::geteuid().as_raw();
    let programs = folder.path(&format!("temporary/raycl-{user}/pocl"));
    assert!(std::fs::read_dir(programs).is_ok_and(|files| files.count() > 0), "PoCL stored nothing");
    let refused = render("POCL_CACHE_DIR", "/dev/null/kernels").code(1);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    has(&said, &["POCL_CACHE_DIR", "'/dev/null/kernels'"]);
}

/// Returns a command that lists the devices, so that PoCL creates its folder for compiled kernels. The folder for
/// temporary files is `temporary`. Neither the home folder nor any folder for caches is set.
#[cfg(target_os = "linux")]
fn devices_without_folders(folder: &WorkFolder) -> Command {
    let mut command = folder.raycl(&["devices"]);
    for name in ["HOME", "XDG_CACHE_HOME", "POCL_CACHE_DIR"] {
        command.env_remove(name);
    }
    command.env("TMPDIR", folder.path("temporary"));
    command
}

/// Creates a folder, and gives it this mode.
#[cfg(target_os = "linux")]
fn create_with_mode(folder: &Path, mode: u32) {
    use std::os::unix::fs::PermissionsExt as _;
    std::fs::create_dir_all(folder).expect("a folder");
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(mode)).expect("a mode");
}

/// Without `HOME` and `XDG_CACHE_HOME`, PoCL would use /tmp/pocl/kcache, which may belong to another user. PoCL runs
/// the kernels that it finds in its cache folder. If `HOME` or `XDG_CACHE_HOME` leads to a cache folder to which
/// other users may write, raycl therefore rejects this folder, too. In the last case, the path is too long for a
/// folder.
#[test]
#[cfg(target_os = "linux")]
fn pocl_keeps_its_kernels_where_no_other_user_can_write() {
    let user = rustix::process::geteuid().as_raw();
    let too_long = format!("/tmp/{}", "n".repeat(300));
    for (variable, value) in
        [(None, String::new()), (Some("HOME"), "home".to_owned()), (Some("XDG_CACHE_HOME"), too_long)]
    {
        let folder = WorkFolder::with(&[]);
        create_with_mode(&folder.path("temporary"), 0o700);
        let shared = folder.path("home/.cache/pocl/kcache");
        create_with_mode(&shared, 0o777);
        let mut command = devices_without_folders(&folder);
        if let Some(variable) = variable {
            // If `value` begins with `/`, `folder.path` returns `value` itself.
            command.env(variable, folder.path(&value));
        }
        command.assert().success();
        let own = folder.path(&format!("temporary/raycl-{user}/pocl"));
        assert!(own.is_dir(), "{variable:?}: PoCL has not used {}", own.display());
        assert!(std::fs::read_dir(&shared).is_ok_and(|mut files| files.next().is_none()), "{variable:?}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn an_empty_variable_for_pocls_folder_counts_as_not_set() {
    let folder = WorkFolder::with(&[]);
    let home = folder.path("home");
    create_with_mode(&home, 0o700);
    create_with_mode(&folder.path("temporary"), 0o700);
    devices_without_folders(&folder).env("HOME", &home).env("POCL_CACHE_DIR", "").assert().success();
    assert!(home.join(".cache/pocl/kcache").is_dir());
    let other = format!("temporary/raycl-{}", rustix::process::geteuid().as_raw());
    assert!(!folder.path(&other).exists());
}

#[test]
#[cfg(target_os = "linux")]
fn folders_that_pocl_may_not_use_are_named_if_there_is_no_other() {
    let folder = folder_with(CONFIG);
    let user = rustix::process::geteuid().as_raw();
    let shared = folder.path(&format!("temporary/raycl-{user}"));
    create_with_mode(&shared, 0o777);
    let device = device();
    let arguments =
        ["render", "scene.toml", "--width", "17", "--height", "9", "-o", "a.png", "--device", &device];
    let mut command = folder.raycl(&arguments);
    command.env_remove("XDG_CACHE_HOME").env_remove("POCL_CACHE_DIR").env("HOME", "/dev/null");
    let refused = command.env("TMPDIR", folder.path("temporary")).assert().code(1);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    let own = format!("'{}' cannot be used: another user owns this folder", shared.display());
    has(
        &said,
        &[
            "'/dev/null/.cache/pocl/kcache' cannot be used: raycl cannot write to it",
            &own,
            "set POCL_CACHE_DIR",
        ],
    );
    assert!(!shared.join("pocl").exists());
}
