//! Commands that only print: devices, strategies, occupancy, man pages and completions. The file also tests messages
//! about mistakes, colours, and sweeps of `raycl rule`.

use crate::binary::{TRIANGLE, WorkFolder, device, finish, run};
use std::process::{Command, Stdio};

use assert_cmd::assert::OutputAssertExt as _;

fn raycl(arguments: &[&str]) -> Command {
    let mut command = crate::binary::program();
    command.args(arguments);
    command
}

/// Runs the command, which must succeed, and returns its standard output.
fn output(arguments: &[&str]) -> String {
    let output = run(&mut raycl(arguments));
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

fn json(arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&output(arguments)).expect("JSON")
}

/// Runs a command, which must end with this exit code, and returns its standard error.
fn mistake(command: &mut Command, code: i32) -> String {
    let output = run(command).assert().code(code).get_output().clone();
    assert!(output.stdout.is_empty(), "{output:?}");
    String::from_utf8(output.stderr).expect("UTF-8")
}

#[test]
fn without_a_platform_the_error_says_what_to_install() {
    let message = mistake(raycl(&["devices"]).env("OCL_ICD_VENDORS", "/nonexistent"), 1);
    for part in ["no OpenCL platform", "pocl-opencl-icd", "make setup"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(!message.contains("panicked"), "{message}");
}

#[test]
fn devices_are_listed_with_their_limits() {
    let listing = json(&["devices", "--json"]);
    let devices = listing["devices"].as_array().expect("a list");
    assert!(!devices.is_empty());
    let text = output(&["devices"]);
    for device in devices {
        assert!(device["limits"]["local_bytes"].is_u64(), "{device}");
        assert!(text.contains(device["name"].as_str().expect("a name")), "{text}");
    }
    assert!(devices.iter().any(|device| device["slug"] == listing["default"]));
}

#[test]
fn strategies_have_every_axis_of_every_preset() {
    let listing = json(&["strategies", "--json"]);
    let axes = listing["axes"].as_array().expect("axes").len();
    for preset in listing["presets"].as_array().expect("presets") {
        assert_eq!(preset["axes"].as_object().expect("axes").len(), axes, "{preset}");
    }
}

#[test]
fn the_papers_occupancy_is_contradicted() {
    let paper = json(&["occupancy", "--paper", "--local-sizes", "16x16,32x32", "--json"]);
    assert_eq!(paper["rows"][0]["predicted_threads"], 1536);
    assert_eq!(paper["rows"][0]["threads"], 512);
    assert_eq!(paper["rows"][1]["threads"], 0);
}

#[test]
fn damaged_records_are_reported_beside_json_and_beside_an_error() {
    let path = crate::binary::repository("tests/data/old-results/records.jsonl");
    let records = std::fs::read_to_string(path).expect("records");
    // The first point of the experiment was not measured, so its record has no kernels.
    let unmeasured = records.lines().next().expect("a record");
    let folder = WorkFolder::with(&[
        ("all/records.jsonl", &format!("{records}damaged\n")),
        ("none/records.jsonl", &format!("{unmeasured}\ndamaged\n")),
    ]);
    let output = folder.raycl(&["occupancy", "--results", "all", "--json"]).assert().success();
    let output = output.get_output().clone();
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(printed.contains("\"registers\": 68") && !printed.contains("damaged"), "{printed}");
    let refused = folder.mistake(&["occupancy", "--results", "none"], 1);
    for said in [String::from_utf8_lossy(&output.stderr).into_owned(), refused] {
        assert!(said.contains("raycl ignores 1 damaged line of records.jsonl"), "{said}");
    }
}

#[test]
fn mistakes_exit_with_2_and_name_the_remedy() {
    let message = mistake(&mut raycl(&["occupancy", "--compute-capability", "8.8"]), 2);
    assert!(message.contains("'8.8'") && message.contains("8.9"), "{message}");
    let message = mistake(&mut raycl(&["occupancy", "--local-sizes", "8by8"]), 2);
    assert!(message.contains("8by8") && message.contains("16x8"), "{message}");
    let message = mistake(&mut raycl(&["occupancy", "--local-bytes", "-4"]), 2);
    assert!(message.contains("'-4'") && message.contains("--local-bytes"), "{message}");
    let message = mistake(&mut raycl(&["device"]), 2);
    assert!(message.contains("'devices'"), "{message}");
    mistake(&mut raycl(&[]), 2);
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child =
        raycl(&["strategies"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    drop(child.stdout.take());
    let output = finish(child);
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_command_that_cannot_print_fails() {
    for words in [&["-V"][..], &["--help"], &["man"]] {
        let full = std::fs::File::options().write(true).open("/dev/full").expect("a device");
        let child = raycl(words).stdout(full).stderr(Stdio::piped()).spawn().expect("it runs");
        let output = finish(child);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{words:?}: {message}");
        assert!(message.contains("cannot write to standard output"), "{words:?}: {message}");
    }
}

#[test]
fn the_version_names_the_revision_and_says_where_the_tree_was_changed() {
    let printed = output(&["-V"]);
    let number = env!("CARGO_PKG_VERSION");
    let expected = match option_env!("RAYCL_GIT_REVISION")
        .map(|revision| revision.split_once('-').unwrap_or((revision, "")))
    {
        None => format!("raycl {number}\n"),
        Some((commit, "")) => format!("raycl {number} ({commit})\n"),
        Some((commit, _)) => format!("raycl {number} ({commit}, with uncommitted changes)\n"),
    };
    assert_eq!(printed, expected);
    assert_eq!(output(&["--version"]), expected);
}

#[test]
fn man_prints_a_page_and_writes_those_of_all_commands() {
    assert!(output(&["man"]).contains(".TH RAYCL 1"), "{}", output(&["man"]));
    let page = output(&["man", "render"]);
    for part in [".TH RAYCL-RENDER 1", "\\-\\-turntable", "Render pictures"] {
        assert!(page.contains(part), "{part}: {page}");
    }
    let message = mistake(&mut raycl(&["man", "rendr"]), 2);
    assert!(message.contains("did you mean 'render'"), "{message}");
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("man1");
    output(&["man", "--out", out.to_str().expect("UTF-8")]);
    let written = std::fs::read_to_string(out.join("raycl-render.1")).expect("a page");
    assert_eq!(written.trim_end(), page.trim_end());
    assert!(out.join("raycl.1").is_file() && !out.join("raycl-worker.1").exists());
    // `raycl man` does not overwrite a page that raycl did not write.
    std::fs::write(out.join("raycl-run.1"), "mine").expect("a file");
    let message = mistake(&mut raycl(&["man", "--out", out.to_str().expect("UTF-8")]), 2);
    assert!(message.contains("raycl-run.1"), "{message}");
}

/// `--color`, before or after the command's name, decides whether colours are used. Without `--color`, the
/// variable `NO_COLOR` decides. Without the option and the variable, colours are used if the output is a
/// terminal. In a test, the output is no terminal.
#[test]
fn colours_are_what_the_user_says() {
    let escapes = |words: &[&str], refused: bool| {
        let mut command = raycl(words);
        command.env_remove("NO_COLOR").env("TERM", "xterm-256color");
        if refused {
            command.env("NO_COLOR", "1");
        }
        let output = run(&mut command);
        [output.stdout, output.stderr].map(|bytes| bytes.contains(&0x1b))
    };
    let nothing = "no-such-scene.toml";
    // The cases are an unknown command, a missing file, and help. Some of the messages come from clap, the library that
    // parses arguments, others from raycl.
    assert_eq!(escapes(&["rendr"], false), [false, false]);
    assert_eq!(escapes(&["--color=always", "rendr"], true), [false, true]);
    assert_eq!(escapes(&["render", nothing, "--color", "always"], true), [false, true]);
    assert_eq!(escapes(&["render", nothing, "--color", "never"], false), [false, false]);
    assert_eq!(escapes(&["render", nothing], false), [false, false]);
    assert_eq!(escapes(&["render", "--help", "--color", "always"], true), [true, false]);
    assert_eq!(escapes(&["render", "--help"], false), [false, false]);
    let message = mistake(&mut raycl(&["devices", "--color", "allways"]), 2);
    assert!(message.contains("'always'"), "{message}");
}

/// Returns the completions that bash offers for the last of these words, after bash has loaded the script. If
/// the last word is `=`, the code passes an empty word to the script, as bash does: the cursor stands after
/// the word `=`.
#[cfg(unix)]
fn completions(script: &std::path::Path, words: &[&str]) -> Vec<String> {
    let code = r#"source "$1"; shift
        COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) word=${@: -1}
        [ "$word" != = ] || word=
        $(complete -p raycl | sed 's/.*-F \([^ ]*\).*/\1/') raycl "$word" "${@: -2:1}"
        printf '%s\n' "${COMPREPLY[@]}""#;
    let output = run(Command::new("bash").args(["--norc", "-c", code, "bash"]).arg(script).args(words));
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    String::from_utf8(output.stdout).expect("UTF-8").lines().map(str::to_owned).collect()
}

#[test]
#[cfg(unix)]
fn bash_completes_commands_options_and_presets() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = folder.path().join("raycl.bash");
    std::fs::write(&script, output(&["completions", "bash"])).expect("a script");
    let offered = |words: &[&str]| completions(&script, words);
    assert_eq!(offered(&["raycl", "rep"]), ["report", "reproduce", "repair"]);
    assert_eq!(offered(&["raycl", "render", "--loc"]), ["--local-size"]);
    for command in ["render", "compile"] {
        assert_eq!(
            offered(&["raycl", command, "--strategy", "naive"]),
            ["naive", "naive-scratch", "naive-test-vectors"]
        );
    }
    assert!(!offered(&["raycl", ""]).contains(&"worker".to_owned()), "it is hidden");
    // Bash divides `--terminal=s` into three words. After `--terminal` and a blank, no value is offered,
    // since raycl accepts a value only after `=`.
    assert_eq!(offered(&["raycl", "view", "--terminal", "=", "s"]), ["sixel"]);
    assert_eq!(offered(&["raycl", "view", "--terminal", "="]), ["blocks", "kitty", "sixel"]);
    assert!(!offered(&["raycl", "view", "--terminal", ""]).contains(&"sixel".to_owned()), "it is refused");
    assert_eq!(offered(&["raycl", "view", "--strategy", "=", "private"]), ["private"]);
}

#[test]
fn a_sweep_has_the_times_of_the_cases_that_are_wanted_and_what_was_said_of_it() {
    let case = |name: &str| {
        format!(
            "[[case]]\nname = \"{name}\"\nscene = \"scene.toml\"\nsize = [24, 15]\n\
             kinds = [\"few\"]\ndevices = [\"cpu\", \"gpu\"]\n"
        )
    };
    let cases = case("little one") + &case("another");
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("cases.toml", &cases)]);
    let device = device();
    let options = ["--only", "little", "--rounds", "2", "--conditions", "a quiet room", "-o", "sweep.json"];
    let table = folder.output(&[&["rule", "cases.toml", "--device", &device][..], &options].concat());
    let sweep: serde_json::Value = serde_json::from_str(&folder.text("sweep.json")).expect("JSON");
    assert_eq!((sweep["rounds"].as_u64(), sweep["conditions"].as_str()), (Some(2), Some("a quiet room")));
    let [case] = &sweep["cases"].as_array().expect("cases")[..] else { panic!("{sweep}") };
    for (key, expected) in [
        ("name", "\"little one\""),
        ("triangles", "1"),
        ("pixels", "360"),
        ("inside", "false"),
        ("watertight", "false"),
    ] {
        assert_eq!(case[key].to_string(), expected, "{key}");
    }
    let times = case["least_ms"].as_object().expect("times");
    assert!(times.contains_key("exhaustive") && times.contains_key("single"), "{times:?}");
    assert!(times.values().all(|ms| ms.as_f64().is_some_and(|ms| ms > 0.0)), "{times:?}");
    assert!(table.contains("shortest times of 2 rounds") && table.contains("little one"), "{table}");
    assert_eq!(folder.output(&["rule", "--show", "sweep.json"]), table);
    // With `-o -`, standard output contains only the JSON, so that a file with this output can be read as a sweep.
    let options = ["--only", "little", "--rounds", "2", "-o", "-"];
    let printed = folder.output(&[&["rule", "cases.toml", "--device", &device][..], &options].concat());
    folder.write("printed.json", &printed);
    let shown = folder.output(&["rule", "--show", "printed.json"]);
    assert!(shown.contains("shortest times of 2 rounds") && shown.contains("little one"), "{shown}");
    assert!(!folder.path("-").exists());
    let none = folder.mistake(&["rule", "cases.toml", "--device", &device, "--only", "great"], 2);
    assert!(none.contains("none of the 2 cases of 'cases.toml'") && none.contains("'great'"), "{none}");
}

#[test]
fn the_help_of_quiet_says_that_the_json_object_is_printed_nevertheless() {
    for (command, what) in [
        (
            "render",
            "Print only errors, lines about waiting for other processes and, with --json, the JSON object",
        ),
        ("view", "Print nothing but errors and, with --json, the JSON object"),
    ] {
        let help = output(&["help", command]).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains(what), "{help}");
    }
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let picture = ["render", "scene.toml", "-o", "a.png", "--width", "8", "--height", "5", "--quiet"];
    let device = device();
    let printed = |more: &[&str]| folder.output(&[&picture[..], &["--device", &device], more].concat());
    assert_eq!(printed(&[]), "");
    let report: serde_json::Value = serde_json::from_str(&printed(&["--json", "--force"])).expect("JSON");
    assert!(report["total_ms"].is_f64(), "{report}");
}
