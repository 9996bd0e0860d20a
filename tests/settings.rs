//! The user's settings: options take precedence over the environment, the environment over the file, and the file
//! over raycl's defaults.

use crate::binary::{TRIANGLE, WorkFolder, config, device, has};
use assert_cmd::Command;

/// Returns a folder with a settings file, a scene and an experiment of one baseline, which needs no device.
fn folder_with(settings: &str) -> WorkFolder {
    let text = config("image_sizes = [[8, 5]]\nbaselines = [\"serial\"]\n", 0, 1);
    WorkFolder::with(&[
        ("home/raycl/config.toml", settings),
        ("scene.toml", TRIANGLE),
        ("config.toml", &text),
    ])
}

fn raycl(folder: &WorkFolder, words: &[&str]) -> Command {
    let mut command = folder.raycl(words);
    command.env("XDG_CONFIG_HOME", folder.path("home"));
    command
}

fn mistake(command: &mut Command) -> String {
    String::from_utf8(command.assert().code(2).get_output().stderr.clone()).expect("UTF-8")
}

#[test]
fn the_device_is_the_options_then_the_environments_then_the_files() {
    let folder = folder_with("# mine\ndevice = \"of-the-file\"\n");
    let render = ["render", "scene.toml", "-o", "a.png", "--width", "8", "--height", "5", "--force"];
    let of_file = mistake(&mut raycl(&folder, &render));
    has(
        &of_file,
        &["no device matches 'of-the-file'", "config.toml:2", "(cpu, gpu, accelerator), or by 'all'"],
    );
    let of_variable = mistake(raycl(&folder, &render).env("RAYCL_DEVICE", "of-the-variable"));
    has(&of_variable, &["RAYCL_DEVICE: no device matches 'of-the-variable'"]);
    // `raycl devices` prints the same message about the default device, although it still lists the devices.
    let devices = |options: &[&str]| {
        let words = [&["devices"][..], options].concat();
        let output = raycl(&folder, &words).env("RAYCL_DEVICE", "of-the-variable").assert().success();
        String::from_utf8(output.get_output().stdout.clone()).expect("UTF-8")
    };
    has(&devices(&[]), &["does not cast: RAYCL_DEVICE: no device matches 'of-the-variable'"]);
    let listing: serde_json::Value = serde_json::from_str(&devices(&["--json"])).expect("JSON");
    assert!(listing["default"].is_null(), "{listing}");
    let device = device();
    let option = [&render[..], &["--device", &device]].concat();
    raycl(&folder, &option).env("RAYCL_DEVICE", "of-the-variable").assert().success();
    // `raycl run` uses the same default device as `render`, unless its config names devices.
    let run = ["run", "config.toml", "--dry-run"];
    has(&mistake(&mut raycl(&folder, &run)), &["no device matches 'of-the-file'", "config.toml:2"]);
    let named = folder.text("config.toml").replace("image_sizes", "devices = [\"all\"]\nimage_sizes");
    folder.write("named.toml", &named);
    raycl(&folder, &["run", "named.toml", "--dry-run"]).assert().success();
}

#[test]
fn of_a_variable_and_a_file_that_name_the_device_the_variable_is_said() {
    let device = device();
    let folder = folder_with(&format!("device = \"{device}\"\n"));
    let listed = |variable: &str| {
        let output = raycl(&folder, &["devices"]).env("RAYCL_DEVICE", variable).assert().success();
        String::from_utf8(output.get_output().stdout.clone()).expect("UTF-8")
    };
    has(&listed(&device), &["By default, raycl casts on ", " (named by RAYCL_DEVICE)."]);
    // A blank variable counts as not set.
    has(&listed(""), &["By default, raycl casts on ", " (named by your settings file)."]);
}

#[test]
fn results_lie_where_the_settings_say() {
    let folder = folder_with(&format!("device = \"{}\"\nresults = \"~/kept\"\n", device()));
    let run = ["run", "config.toml", "--quiet"];
    raycl(&folder, &run).env("HOME", folder.path("me")).assert().success();
    assert!(folder.path("me/kept/config/records.jsonl").is_file());
    raycl(&folder, &run).env("RAYCL_RESULTS", "elsewhere").assert().success();
    assert!(folder.path("elsewhere/config/records.jsonl").is_file());
    raycl(&folder, &[&run[..], &["--out", "named"]].concat())
        .env("RAYCL_RESULTS", "elsewhere")
        .assert()
        .success();
    assert!(folder.path("named/records.jsonl").is_file() && !folder.path("results").exists());
}

#[test]
fn a_folder_in_the_home_folder_needs_a_home_folder() {
    let folder = folder_with("results = \"~/kept\"\n");
    let message = mistake(raycl(&folder, &["run", "config.toml", "--quiet"]).env_remove("HOME"));
    has(&message, &["home/raycl/config.toml:1", "needs HOME", "give an absolute path"]);
    let variable = ("RAYCL_RESULTS", "~nobody/kept");
    let message = mistake(raycl(&folder, &["run", "config.toml", "--quiet"]).env(variable.0, variable.1));
    has(&message, &["RAYCL_RESULTS: only `~` alone", "give an absolute path"]);
    assert!(!folder.path("~").exists() && !folder.path("~nobody").exists());
}

#[test]
fn colours_are_the_options_then_the_environments_then_the_files() {
    let folder = folder_with("color = \"always\"\n");
    let coloured = |words: &[&str], no_color: &str| {
        let output = raycl(&folder, words).env("NO_COLOR", no_color).output().expect("it runs");
        output.stdout.contains(&0x1b)
    };
    assert!(coloured(&["--help"], ""));
    assert!(!coloured(&["--help"], "1"));
    assert!(!coloured(&["--help", "--color", "never"], ""));
    assert!(coloured(&["--help", "--color", "always"], "1"));
}

/// Every command reports a mistake in the settings file. Help, `--version`, messages about wrong arguments, and worker
/// processes ignore the mistake.
#[test]
fn a_mistake_in_the_file_is_reported_with_its_line_and_the_nearest_name() {
    let folder = folder_with("# mine\ndevise = \"cpu\"\n");
    for command in ["strategies", "completions bash", "man", "schema scene"] {
        let words: Vec<&str> = command.split(' ').collect();
        let message = mistake(&mut raycl(&folder, &words));
        has(&message, &["home/raycl/config.toml:2", "devise", "did you mean `device`?"]);
    }
    raycl(&folder, &["--help"]).assert().success();
    raycl(&folder, &["worker", "--list"]).assert().success();
}

#[test]
fn a_home_folder_that_is_no_folder_has_no_settings() {
    let folder = folder_with("");
    for variable in ["XDG_CONFIG_HOME", "HOME"] {
        let mut command = raycl(&folder, &["strategies"]);
        command.env_remove("XDG_CONFIG_HOME").env(variable, "/dev/null").assert().success();
    }
}

#[cfg(unix)]
#[test]
fn a_variable_that_cannot_be_used_is_a_mistake_and_named() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    let folder = folder_with("");
    let no_text = OsStr::from_bytes(b"\xff");
    let message_of =
        |variable: &str, value: &OsStr| mistake(raycl(&folder, &["strategies"]).env(variable, value));
    for variable in ["RAYCL_DEVICE", "RAYCL_RESULTS"] {
        has(&message_of(variable, no_text), &[&format!("{variable}: the value"), "is not UTF-8"]);
    }
    for value in [no_text, OsStr::new("1G")] {
        has(
            &message_of("RAYCL_CACHE_MIB", value),
            &["RAYCL_CACHE_MIB: '", "is not a whole number of MiB", "512"],
        );
    }
    let moved = message_of("RAYCL_MOVED_SAMPLES", OsStr::new("kep"));
    has(&moved, &["RAYCL_MOVED_SAMPLES: 'kep' is not 'keep'", "unset it"]);
}

/// A relative folder of locks would be another folder for each current folder, so that two measurements would not wait
/// for each other.
#[test]
fn a_relative_folder_of_locks_is_a_mistake_and_is_not_made() {
    let folder = folder_with("");
    let measure = ["render", "scene.toml", "-o", "a.png", "--repeat", "2"];
    for relative in ["locks", "~/l"] {
        let message = mistake(raycl(&folder, &measure).env("RAYCL_LOCK_DIR", relative));
        let expected = format!("RAYCL_LOCK_DIR: '{relative}' is not an absolute path");
        has(&message, &[&expected, "the same folder"]);
    }
    for made in ["locks", "~", "a.png"] {
        assert!(!folder.path(made).exists(), "{made}");
    }
}
