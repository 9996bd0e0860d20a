//! Obstacles that an attacker or a broken machine may cause: drivers that crash when they are listed, folders
//! of results with links to other places, arguments that are not UTF-8 text, and systems that allow no more threads.

use crate::binary::{TRIANGLE, WorkFolder, device, has, one_point, until};
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::symlink;
use std::process::Command;

/// Returns the arguments of a run on the test device, with its results in `out`.
fn run<'a>(device: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["run", "config.toml", "--out", "out", "--device", device, "--quiet"], more].concat()
}

/// Returns a folder of drivers with a single driver, which runs `body` as soon as it is loaded.
pub fn driver(folder: &WorkFolder, body: &str) -> std::path::PathBuf {
    let [source, library, vendors] = ["driver.c", "driver.so", "vendors"].map(|name| folder.path(name));
    let code = format!(
        "#include <stdlib.h>\n#include <unistd.h>\n__attribute__((constructor)) static void load(void) {{ {body}; }}\n"
    );
    std::fs::write(&source, code).expect("a source");
    let built =
        crate::binary::run(Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]));
    assert!(built.status.success(), "cc, which Rust links with");
    std::fs::create_dir(&vendors).expect("a folder");
    std::fs::write(vendors.join("bad.icd"), format!("{}\n", library.display())).expect("an .icd");
    vendors
}

#[test]
fn a_driver_that_dies_when_it_is_listed_ends_the_run_with_a_message() {
    let folder = one_point();
    let vendors = driver(&folder, "abort()");
    let output =
        folder.raycl(&run("all", &[])).env("OCL_ICD_VENDORS", vendors).assert().code(1).get_output().clone();
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    has(
        &said.replace("\n  │ ", " "),
        &["devices could not be listed", "a driver ended the process", "signal: 6"],
    );
}

/// Returns a folder of all drivers of this machine and of a broken driver, which runs `body` as soon as it is
/// loaded.
fn among_good_ones(folder: &WorkFolder, body: &str) -> std::path::PathBuf {
    let vendors = driver(folder, body);
    for icd in std::fs::read_dir("/etc/OpenCL/vendors").expect("PoCL: `make setup`").flatten() {
        std::fs::copy(icd.path(), vendors.join(icd.file_name())).expect("a copy");
    }
    vendors
}

/// Checks that `render` and `devices` leave out a driver that runs `body` as soon as it is loaded, and use
/// all other drivers. The two commands `render` and `devices` run at the same time, since both may have to
/// wait for the driver.
#[track_caller]
fn is_left_out(body: &str, reason: &str) {
    let folder = one_point();
    let vendors = among_good_ones(&folder, body);
    let picture = ["render", "scene.toml", "-o", "a.png", "--width", "8", "--height", "5", "--device", "cpu"];
    let check = |arguments: &[&str]| {
        let mut raycl = folder.raycl(arguments);
        // The time limit of 10 s is long enough for drivers that work, even on a busy machine.
        raycl.env("OCL_ICD_VENDORS", &vendors).env("RAYCL_TEST_DRIVER_LIMIT_MS", "10000");
        let output = raycl.assert().success().get_output().clone();
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        has(&said, &["note: the driver", "bad.icd is left out", reason]);
    };
    // The scope fails if one of its threads fails.
    std::thread::scope(|scope| {
        scope.spawn(|| check(&["devices"]));
        check(&picture);
    });
    assert!(folder.path("a.png").is_file());
}

#[test]
fn a_driver_that_dies_when_it_is_listed_is_left_out_of_pictures_and_lists() {
    is_left_out("abort()", "signal: 6");
}

/// Some OpenCL loaders overwrite the separators in the variable `OCL_ICD_FILENAMES` while they load drivers;
/// the driver of this test does the same. After the drivers are loaded, raycl starts the process that stores
/// a compiled program. This process must get the variable's original value: with another value, the process
/// would list all devices again or miss some devices.
#[test]
fn a_variable_that_is_cut_while_drivers_load_is_whole_for_the_next_process() {
    let folder = one_point();
    let cut = "for (char *c = getenv(\"OCL_ICD_FILENAMES\"); c && *c; c++) if (*c == ':') *c = 0";
    let vendors = among_good_ones(&folder, cut);
    let mut raycl =
        folder.raycl(&["render", "scene.toml", "--width", "8", "--height", "5", "--device", "cpu"]);
    raycl.env("OCL_ICD_VENDORS", vendors).env("OCL_ICD_FILENAMES", "libone.so:libtwo.so");
    raycl.env("XDG_CACHE_HOME", folder.path(".caches")).env("RAYCL_CACHE_MIB", "64").assert().success();
    let count = |kind: &str| {
        let files = std::fs::read_dir(folder.path(".caches/raycl")).expect("a cache");
        let names = files.map(|file| file.expect("a file").file_name().into_string().expect("text"));
        names.filter(|name| name.starts_with(kind)).count()
    };
    until("the program is stored", || count("program-") > 0);
    assert_eq!(count("devices-"), 1);
}

#[test]
fn a_driver_that_hangs_when_it_is_listed_is_left_out_of_pictures_and_lists() {
    is_left_out("for (;;) pause()", "has not answered");
}

#[test]
fn nothing_is_left_behind_of_a_driver_that_is_left_out_and_a_pipe_is_read_once() {
    let folder = one_point();
    let vendors = among_good_ones(&folder, "abort()");
    std::fs::create_dir(folder.path("tmp")).expect("a folder");
    let failing = |scene: &str, code| {
        let mut raycl = folder.raycl(&["render", scene, "-o", "a.png", "--device", "cpu"]);
        raycl.env("OCL_ICD_VENDORS", &vendors).env("TMPDIR", folder.path("tmp")).write_stdin(TRIANGLE);
        String::from_utf8(raycl.assert().code(code).get_output().stderr.clone()).expect("UTF-8")
    };
    has(&failing("nothing.toml", 2), &["bad.icd is left out", "nothing.toml"]);
    let said = failing("-", 1);
    has(&said, &["bad.icd fails", "standard input cannot be read again", "a file instead of `-`"]);
    let left =
        std::fs::read_dir(folder.path("tmp")).expect("the folder").map(|entry| entry.expect("a file").path());
    let left: Vec<_> = left.filter(|path| path.join("000.icd").exists()).collect();
    assert!(left.is_empty(), "{left:?}");
    assert!(!folder.path("a.png").exists());
}

#[test]
fn where_the_only_driver_dies_there_is_no_picture_but_a_message() {
    let folder = one_point();
    let vendors = driver(&folder, "abort()");
    let mut raycl = folder.raycl(&["render", "scene.toml", "-o", "a.png"]);
    let output = raycl.env("OCL_ICD_VENDORS", vendors).assert().code(1).get_output().clone();
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    has(&said, &["bad.icd is left out", "no other driver is left", "update the driver"]);
    assert!(!said.contains("pocl-opencl-icd"), "a driver is installed: {said}");
}

#[test]
fn drivers_that_die_only_together_are_named_with_the_remedy() {
    let folder = one_point();
    let body = "if (getenv(\"A_DRIVER_IS_LOADED\")) abort(); setenv(\"A_DRIVER_IS_LOADED\", \"1\", 1)";
    let vendors = driver(&folder, body);
    // If both `.icd` files named the same library, the library would be loaded only once, so the second
    // `.icd` file names a copy.
    let other = folder.path("other.so");
    std::fs::copy(folder.path("driver.so"), &other).expect("a copy");
    std::fs::write(vendors.join("other.icd"), format!("{}\n", other.display())).expect("an .icd");
    let mut raycl = folder.raycl(&["devices"]);
    let output = raycl.env("OCL_ICD_VENDORS", vendors).assert().code(1).get_output().clone();
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    has(&said, &["bad.icd", "other.icd", "cannot be loaded together", "OCL_ICD_VENDORS"]);
    assert!(!said.contains("left out"), "each driver alone works: {said}");
}

#[test]
fn arguments_that_are_no_text_are_refused_or_read_all_the_same() {
    let folder = one_point();
    let name = OsStr::from_bytes(b"o\xffut");
    for option in ["--out", "--cl-dir"] {
        let refused =
            folder.raycl(&["run", "config.toml", option]).arg(name).assert().code(2).get_output().clone();
        has(&String::from_utf8_lossy(&refused.stderr), &["o\u{fffd}ut", "not UTF-8"]);
    }
    // A name with a line break is valid text, and the record of the command keeps it as one argument.
    let device = device();
    folder.raycl(&["run", "config.toml", "--device", &device, "--quiet", "--out", "a\nb"]).assert().success();
    std::fs::rename(folder.path("a\nb"), folder.path("x").with_file_name(name)).expect("a new name");
    folder.raycl(&["report"]).arg(name).assert().success();
    // In JSON, raycl replaces the bytes of a path that are not UTF-8.
    let json = |command: &str| {
        let output =
            folder.raycl(&[command, "--json"]).arg(name).assert().success().get_output().stdout.clone();
        serde_json::from_slice::<serde_json::Value>(&output).expect("JSON")
    };
    assert_eq!(json("report")["report"], "o\u{fffd}ut/report.html");
    let journal = folder.path("x").with_file_name(name).join("records.jsonl");
    let lines = std::fs::read_to_string(&journal).expect("records") + "no JSON\n";
    std::fs::write(&journal, lines).expect("it writes");
    let repaired = &json("repair")["repaired"][0];
    assert_eq!((&repaired["file"], &repaired["damaged"]), (&"o\u{fffd}ut/records.jsonl".into(), &1.into()));
}

#[test]
fn a_folder_of_results_leads_nowhere_else() {
    let folder = one_point();
    let device = device();
    folder.raycl(&run(&device, &[])).assert().success();
    let elsewhere = folder.path("elsewhere");
    std::fs::create_dir(&elsewhere).expect("a folder");
    let victim = elsewhere.join("victim");
    std::fs::write(&victim, "precious, without a last newline").expect("a file");
    for (name, target, code) in [
        ("records.jsonl", &victim, 2),
        ("samples.jsonl", &victim, 2),
        ("launches.jsonl", &victim, 2),
        (".lock", &victim, 2),
        ("images", &elsewhere, 1),
        ("plots", &elsewhere, 1),
        ("exports", &elsewhere, 1),
    ] {
        let [at, aside] = [folder.path("out").join(name), folder.path("kept")];
        std::fs::rename(&at, &aside).expect("it was there");
        symlink(target, &at).expect("a link");
        let message = folder.mistake(&run(&device, &["--resume"]), code);
        has(&message, &[name, "link"]);
        std::fs::remove_file(&at).expect("the link");
        std::fs::rename(&aside, &at).expect("its place");
    }
    // In the results, the test replaces files by links. When raycl writes such a file again, it replaces the
    // link, and not the file to which the link leads.
    for name in ["summary.md", "summary.csv", "report.html", "environment.json"] {
        std::fs::remove_file(folder.path("out").join(name)).expect("it was there");
        symlink(&victim, folder.path("out").join(name)).expect("a link");
    }
    folder.raycl(&run(&device, &["--resume"])).assert().success();
    assert_eq!(std::fs::read_to_string(&victim).expect("a file"), "precious, without a last newline");
    assert_eq!(std::fs::read_dir(&elsewhere).expect("a folder").count(), 1);
}

#[test]
fn a_device_in_the_place_of_a_file_is_not_read() {
    let folder = one_point();
    let device = device();
    folder.raycl(&run(&device, &[])).assert().success();
    for name in ["samples.jsonl", "records.jsonl"] {
        let at = folder.path("out").join(name);
        std::fs::remove_file(&at).expect("it was there");
        symlink("/dev/zero", &at).expect("a link");
        folder.mistake(&run(&device, &["--resume"]), 2);
    }
    folder.mistake(&["report", "out"], 2);
}

#[test]
fn a_system_that_allows_no_more_threads_ends_pictures_with_a_message() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    // No address space can hold stacks of this size, so the system refuses every thread.
    let stack_bytes = (1_u64 << 62).to_string();
    let picture = ["render", "scene.toml", "-o", "a.png"];
    for arguments in [&picture[..], &["view", "scene.toml", "--terminal=blocks", "--frames", "1"]] {
        let mut raycl = folder.raycl(arguments);
        let output = raycl.env("RUST_MIN_STACK", &stack_bytes).assert().code(1).get_output().clone();
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(!said.contains("panicked"), "{said}");
        has(&said, &["a thread could not be started", "ulimit -u"]);
    }
}
