//! The user's settings: options take precedence over the environment, the environment over the file, and the file
//! over raycl's defaults.

use crate::binary::{Place, TRIANGLE, config, device, has};
use assert_cmd::Command;

/// Returns a place with a settings file, a scene and an experiment of one baseline, which needs no device.
fn place(settings: &str) -> Place {
    let text = config("image_sizes = [[8, 5]]\nbaselines = [\"serial\"]\n", 0, 1);
    Place::with(&[("home/raycl/config.toml", settings), ("scene.toml", TRIANGLE), ("config.toml", &text)])
}

fn raycl(place: &Place, words: &[&str]) -> Command {
    let mut command = place.raycl(words);
    command.env("XDG_CONFIG_HOME", place.path("home"));
    command
}

fn mistake(command: &mut Command) -> String {
    String::from_utf8(command.assert().code(2).get_output().stderr.clone()).expect("UTF-8")
}

#[test]
fn the_device_is_the_options_then_the_environments_then_the_files() {
    let place = place("# mine\ndevice = \"of-the-file\"\n");
    let render = ["render", "scene.toml", "-o", "a.png", "--width", "8", "--height", "5", "--force"];
    let of_file = mistake(&mut raycl(&place, &render));
    has(
        &of_file,
        &["no device matches 'of-the-file'", "config.toml:2", "(cpu, gpu, accelerator), or by 'all'"],
    );
    let of_variable = mistake(raycl(&place, &render).env("RAYCL_DEVICE", "of-the-variable"));
    has(&of_variable, &["RAYCL_DEVICE: no device matches 'of-the-variable'"]);
    // `raycl devices` says the same about the default, although it still lists the devices.
    let devices = |options: &[&str]| {
        let words = [&["devices"][..], options].concat();
        let output = raycl(&place, &words).env("RAYCL_DEVICE", "of-the-variable").assert().success();
        String::from_utf8(output.get_output().stdout.clone()).expect("UTF-8")
    };
    has(&devices(&[]), &["does not cast: RAYCL_DEVICE: no device matches 'of-the-variable'"]);
    let listing: serde_json::Value = serde_json::from_str(&devices(&["--json"])).expect("JSON");
    assert!(listing["default"].is_null(), "{listing}");
    let device = device();
    let option = [&render[..], &["--device", &device]].concat();
    raycl(&place, &option).env("RAYCL_DEVICE", "of-the-variable").assert().success();
    // `raycl run` uses the same default device as `render`, unless its config names devices.
    let run = ["run", "config.toml", "--dry-run"];
    has(&mistake(&mut raycl(&place, &run)), &["no device matches 'of-the-file'", "config.toml:2"]);
    let named = place.text("config.toml").replace("image_sizes", "devices = [\"all\"]\nimage_sizes");
    place.write("named.toml", &named);
    raycl(&place, &["run", "named.toml", "--dry-run"]).assert().success();
}

#[test]
fn results_lie_where_the_settings_say() {
    let place = place(&format!("device = \"{}\"\nresults = \"~/kept\"\n", device()));
    let run = ["run", "config.toml", "--quiet"];
    raycl(&place, &run).env("HOME", place.path("me")).assert().success();
    assert!(place.path("me/kept/config/records.jsonl").is_file());
    raycl(&place, &run).env("RAYCL_RESULTS", "elsewhere").assert().success();
    assert!(place.path("elsewhere/config/records.jsonl").is_file());
    raycl(&place, &[&run[..], &["--out", "named"]].concat())
        .env("RAYCL_RESULTS", "elsewhere")
        .assert()
        .success();
    assert!(place.path("named/records.jsonl").is_file() && !place.path("results").exists());
}

#[test]
fn a_folder_in_the_home_folder_needs_a_home_folder() {
    let place = place("results = \"~/kept\"\n");
    let told = mistake(raycl(&place, &["run", "config.toml", "--quiet"]).env_remove("HOME"));
    has(&told, &["home/raycl/config.toml:1", "needs HOME", "name an absolute folder"]);
    let variable = ("RAYCL_RESULTS", "~nobody/kept");
    let told = mistake(raycl(&place, &["run", "config.toml", "--quiet"]).env(variable.0, variable.1));
    has(&told, &["RAYCL_RESULTS: only `~` alone", "name an absolute folder"]);
    assert!(!place.path("~").exists() && !place.path("~nobody").exists());
}

#[test]
fn colours_are_the_options_then_the_environments_then_the_files() {
    let place = place("color = \"always\"\n");
    let coloured = |words: &[&str], no_color: &str| {
        let output = raycl(&place, words).env("NO_COLOR", no_color).output().expect("it runs");
        output.stdout.contains(&0x1b)
    };
    assert!(coloured(&["--help"], ""));
    assert!(!coloured(&["--help"], "1"));
    assert!(!coloured(&["--help", "--color", "never"], ""));
    assert!(coloured(&["--help", "--color", "always"], "1"));
}

/// Every command reports a mistake in the settings file; only help and worker processes ignore it.
#[test]
fn a_mistake_in_the_file_is_told_with_its_line_and_the_nearest_name() {
    let place = place("# mine\ndevise = \"cpu\"\n");
    for command in ["strategies", "completions bash", "man", "schema scene"] {
        let words: Vec<&str> = command.split(' ').collect();
        let told = mistake(&mut raycl(&place, &words));
        has(&told, &["home/raycl/config.toml:2", "devise", "did you mean `device`?"]);
    }
    raycl(&place, &["--help"]).assert().success();
    raycl(&place, &["worker", "--list"]).assert().success();
}

#[test]
fn a_home_folder_that_is_no_folder_has_no_settings() {
    let place = place("");
    for variable in ["XDG_CONFIG_HOME", "HOME"] {
        let mut command = raycl(&place, &["strategies"]);
        command.env_remove("XDG_CONFIG_HOME").env(variable, "/dev/null").assert().success();
    }
}

#[cfg(unix)]
#[test]
fn a_variable_that_cannot_be_used_is_a_mistake_and_named() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    let place = place("");
    let no_text = OsStr::from_bytes(b"\xff");
    let told = |variable: &str, value: &OsStr| mistake(raycl(&place, &["strategies"]).env(variable, value));
    for variable in ["RAYCL_DEVICE", "RAYCL_RESULTS"] {
        has(&told(variable, no_text), &[&format!("{variable}: the value"), "is not UTF-8"]);
    }
    for value in [no_text, OsStr::new("1G")] {
        has(&told("RAYCL_CACHE_MIB", value), &["RAYCL_CACHE_MIB: '", "is not a whole number of MiB", "512"]);
    }
}
