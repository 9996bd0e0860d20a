//! The microscope of `raycl compile`: each source line with the instructions that the device's compiler
//! generated from it.
//!
//! The working vectors are the vectors of a ray, such as its origin and direction. In the source, three
//! adjacent lines write a working vector, one line for each component, and a single line reads a working
//! vector. With these four lines of source, the tests check whether the microscope attributes instructions to
//! the right lines. The source lines before and after the three that write must have no store instructions.
//! The source line that reads must have no store instructions, and the line after it must have no load
//! instructions.

use crate::binary::{WorkFolder, device, has, repository, run};
use crate::common::is_long;
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the device on which tests run, as `raycl devices --json` lists it.
fn listed_device() -> Value {
    let devices: Value =
        serde_json::from_str(&WorkFolder::new().output(&["devices", "--json"])).expect("JSON");
    let wanted = device().to_lowercase();
    let all = devices["devices"].as_array().expect("a list");
    let used = all.iter().find(|one| one.to_string().to_lowercase().contains(&wanted));
    used.expect("the device").clone()
}

/// Returns true if the device's driver is PoCL, which keeps compiled kernels in the folder of `POCL_CACHE_DIR`.
fn is_pocl() -> bool {
    listed_device()["platform"] == "Portable Computing Language"
}

/// Returns true if the device's driver is a PoCL that names LLVM 16 or a later LLVM as its compiler. PoCL 3.1 has LLVM
/// 15, and PoCL 6.0 has LLVM 18, whose line tables are less complete.
fn compiles_with_a_later_llvm() -> bool {
    let used = listed_device();
    let version = used["platform_version"].as_str().expect("a text");
    let llvm =
        version.split_once("LLVM ").and_then(|(_, number)| number.split('.').next()?.parse::<u32>().ok());
    llvm.is_some_and(|llvm| llvm > 15)
}

/// Returns the output of `raycl compile --json` for the whole-frame kernel of a strategy, as compiled by the driver.
fn listing(strategy: &str) -> Value {
    listing_of(&WorkFolder::new(), "cast_frame", &["--strategy", strategy])
}

/// Runs `raycl compile` with a folder of its own for PoCL's compiled kernels, and returns its standard output. If two
/// processes compile a program with a line table into one folder at the same time, PoCL 3.1 sometimes stores kernels
/// without the table.
fn compile(folder: &WorkFolder, arguments: &[&str]) -> String {
    std::fs::create_dir_all(folder.path("pocl")).expect("a folder");
    let mut command = folder.raycl(arguments);
    let output = command.env("POCL_CACHE_DIR", folder.path("pocl")).assert().success().get_output().clone();
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Returns the output of `raycl compile --json`, with these options, for a kernel as compiled by the driver. `raycl`
/// runs in `folder`.
fn listing_of(folder: &WorkFolder, kernel: &str, options: &[&str]) -> Value {
    let scene = repository("scenes/teapot.toml");
    let device = device();
    let usual = ["compile", scene.to_str().expect("a path"), "--device", &device, "--json"];
    let text = compile(folder, &[&usual, options].concat());
    let made: Value = serde_json::from_str(&text).expect("JSON");
    let listings = made["microscope"]["listings"].as_array().expect("a list");
    let of_kernel = listings.iter().find(|listing| listing["kernel"] == kernel);
    let listing = of_kernel.unwrap_or_else(|| panic!("no {kernel}: {}", made["microscope"]["notes"])).clone();
    assert_eq!(listing["rows_are"], "lines", "the compiler wrote no line table");
    listing
}

/// Returns the name of the memory under which the listing counts loads and stores: `named` if the device's
/// instructions are PTX, otherwise `generic`.
fn memory<'a>(listing: &Value, named: &'a str) -> &'a str {
    if listing["made_by"].as_str().is_some_and(|made_by| made_by.starts_with("PTX")) {
        named
    } else {
        "generic"
    }
}

/// Returns the number of a line's instructions of a kind; 0 for a line without instructions.
fn count(listing: &Value, line: u64, kind: &str) -> u64 {
    let rows = listing["rows"].as_array().expect("a list");
    let row = rows.iter().find(|row| row["line"] == line);
    row.and_then(|row| row["counts"][kind].as_u64()).unwrap_or(0)
}

/// Returns the number of the only line with this text.
fn line_of(listing: &Value, source: &str) -> u64 {
    let rows = listing["rows"].as_array().expect("a list");
    let lines: Vec<_> = rows.iter().filter(|row| row["source"] == source).collect();
    assert_eq!(lines.len(), 1, "{source}: {lines:?}");
    lines[0]["line"].as_u64().expect("a number")
}

/// Checks that the source lines of working vectors store to a memory and load from it, and that the source lines beside
/// them do not. In a listing of PTX, this memory is `named`; other listings do not tell memories apart.
fn check_working_vectors(strategy: &str, named: &str) {
    let listing = listing(strategy);
    let [load, store] = ["load", "store"].map(|verb| format!("{verb} {}", memory(&listing, named)));
    let [x, y, z] =
        ["at[0] = value.x;", "at[1] = value.y;", "at[2] = value.z;"].map(|text| line_of(&listing, text));
    assert_eq!([y, z], [x + 1, x + 2]);
    // The kernel sets four of the working vectors at the start, and all other working vectors at each hit.
    let stores = count(&listing, x, &store);
    assert!(stores >= 4, "{strategy}: {stores} stores of x");
    assert_eq!([y, z].map(|line| count(&listing, line, &store)), [stores; 2], "{strategy}");
    assert_eq!(
        [x - 1, z + 1].map(|line| count(&listing, line, &store)),
        [0; 2],
        "{strategy}: beside the stores"
    );
    // A ray's origin and direction, three numbers each, are read at each test. The vectors are volatile, so the
    // compiler removes no load.
    let get = line_of(&listing, "return vec3(at[0], at[1], at[2]);");
    let loads = count(&listing, get, &load);
    assert!(loads >= 12, "{strategy}: {loads} loads");
    assert_eq!(count(&listing, get, &store), 0, "{strategy}");
    assert_eq!(count(&listing, get + 1, &load), 0, "{strategy}: after the loads");
}

#[test]
fn lines_of_naive_show_that_its_vectors_are_in_global_memory() {
    check_working_vectors("naive", "global");
}

#[test]
fn lines_of_local_vectors_show_that_they_are_in_local_memory() {
    check_working_vectors("local-vectors", "local");
}

#[test]
fn every_instruction_is_counted_once_and_most_have_a_line() {
    let listing = listing("private");
    assert_eq!(listing["same_as_timed"], true, "a line table changes no instruction");
    let sum =
        |of: &dyn Fn(&Value) -> u64| listing["rows"].as_array().expect("rows").iter().map(of).sum::<u64>();
    let all = listing["instructions"].as_u64().expect("a number");
    let with_line = listing["with_line"].as_u64().expect("a number");
    assert_eq!(sum(&|row| row["instructions"].as_u64().expect("a number")), with_line);
    // With LLVM 18, 78% of the instructions have a line of the source.
    let percent = if compiles_with_a_later_llvm() { 75 } else { 80 };
    assert!(with_line * 100 > all * percent, "{with_line} of {all} instructions have a line");
}

/// Renders the teapot with these options and with a new folder for PoCL's compiled kernels, which `compile`
/// may use afterwards. Returns the path of the file with the machine code of the kernel that the frame ran;
/// the file's folder is named by the local size. Returns `None` if the driver is not PoCL, since other
/// drivers do not use the folder for compiled kernels.
fn rendered(folder: &WorkFolder, kernel: &str, local_size: &str, options: &[&str]) -> Option<PathBuf> {
    if !is_pocl() {
        return None;
    }
    let (scene, device) = (repository("scenes/teapot.toml"), device());
    let scene = scene.to_str().expect("a path");
    let usual = ["render", scene, "--device", &device, "--width", "72", "--height", "45", "-o", "out.png"];
    std::fs::create_dir(folder.path("pocl")).expect("a folder");
    let mut command = folder.raycl(&[&usual, options].concat());
    command.env("POCL_CACHE_DIR", folder.path("pocl")).assert().success();
    let files = files(&folder.path("pocl"));
    let version = format!("{}-1-goffs0", local_size.replace('x', "-"));
    let is_run = |file: &&PathBuf| {
        let names: Vec<_> = file.iter().rev().map(|name| name.to_string_lossy()).take(2).collect();
        names[0] == format!("{kernel}.so") && names[1].starts_with(&version)
    };
    let ran: Vec<_> = files.iter().filter(is_run).collect();
    assert_eq!(ran.len(), 1, "{kernel} {local_size}: {ran:?} of {files:?}");
    Some(ran[0].clone())
}

/// Returns the files of a folder and of all folders in it.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    paths.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Returns the number of instructions of a kernel that PoCL compiled, including the functions that the kernel
/// calls.
fn instructions(file: &Path, kernel: &str) -> u64 {
    let output = run(Command::new("objdump").args(["--disassemble", "--no-show-raw-insn"]).arg(file));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let function = |part: &str| {
        let (head, body) = part.trim_start().split_once('\n')?;
        let name = head.split_once(" <")?.1.strip_suffix(">:")?.to_owned();
        Some((name, body.lines().filter(|line| line.contains(":\t")).map(str::to_owned).collect::<Vec<_>>()))
    };
    let functions: HashMap<String, Vec<String>> = text.split("\n\n").filter_map(function).collect();
    // PoCL 7.1 keeps only the function that runs a work-group.
    let own = format!("_pocl_kernel_{kernel}");
    let whole = format!("{own}_workgroup");
    let mut reached = vec![if functions.contains_key(&own) { own } else { whole }];
    let mut at = 0;
    while let Some(name) = reached.get(at) {
        let called = functions[name].iter().filter_map(|line| {
            let (_, text) = line.split_once(":\t")?;
            // objdump names the addresses of data in comments.
            let (name, _) = text.split(" # ").next()?.split_once('<')?.1.split_once('>')?;
            // AArch64's `adrp` computes an address. Stubs of the linker lead to other files, as in "memset@plt".
            let goes = !text.starts_with("adrp") && !name.contains("@plt");
            goes.then(|| name.to_owned())
        });
        let called: Vec<_> = called.filter(|name| functions.contains_key(name)).collect();
        for name in called {
            if !reached.contains(&name) {
                reached.push(name);
            }
        }
        at += 1;
    }
    reached.iter().map(|name| functions[name].len() as u64).sum()
}

/// PoCL compiles a kernel for each local size with which it is launched, and once for any local size. The version for
/// any local size, which no frame runs, has other instructions.
#[test]
fn of_pocls_versions_of_a_kernel_the_one_that_a_frame_runs_is_counted() {
    let all = [
        ("naive", "cast_frame", "8x8"),
        ("naive", "cast_frame", "16x16"),
        ("private", "cast_frame", "64x1"),
        ("tile-group", "tile_cast", "32x1"),
    ];
    // PoCL compiles the last strategy twice: for the frame, and with a line table. Together, this takes a minute.
    for (strategy, kernel, local_size) in all.into_iter().take(if is_long() { 4 } else { 3 }) {
        let options = ["--strategy", strategy, "--local-size", local_size];
        let folder = WorkFolder::new();
        // The instructions are counted before `raycl compile` adds files to the folder of compiled kernels. PoCL need
        // not compile the timed program again, since `raycl render` has stored it in this folder.
        let ran = rendered(&folder, kernel, local_size, &options).map(|file| instructions(&file, kernel));
        let listing = listing_of(&folder, kernel, &options);
        // LLVM 18 compiles `tile-group` to other instructions if it writes a line table. raycl reports this
        // difference.
        let is_same = listing["same_as_timed"] == true;
        let may_differ = strategy == "tile-group" && compiles_with_a_later_llvm();
        assert!(is_same || may_differ, "{strategy} {local_size}");
        assert_eq!(listing["for_any_local_size"], false, "{strategy} {local_size}");
        let Some(ran) = ran else { return };
        assert!(!is_same || listing["instructions"] == ran, "{strategy} {local_size}: {ran} {listing}");
    }
}

/// With POCL_WORK_GROUP_SPECIALIZATION=0, PoCL compiles only the version for any local size.
#[test]
fn a_version_for_any_local_size_is_named_and_not_called_the_timed_one() {
    let (folder, device) = (WorkFolder::with(&[("scene.toml", crate::binary::TRIANGLE)]), device());
    std::fs::create_dir(folder.path("kernels")).expect("a folder");
    let arguments = ["compile", "scene.toml", "--device", &device, "--strategy", "private", "--out", "made"];
    let mut command = folder.raycl(&arguments);
    command.env("POCL_WORK_GROUP_SPECIALIZATION", "0").env("POCL_CACHE_DIR", folder.path("kernels"));
    command.assert().success();
    if !is_pocl() {
        return;
    }
    assert!(!files(&folder.path("kernels")).is_empty(), "PoCL stored no kernel in POCL_CACHE_DIR");
    let made: Value = serde_json::from_str(&folder.text("made/private/made.json")).expect("JSON");
    let listing = &made["microscope"]["listings"][0];
    assert_eq!((&listing["for_any_local_size"], &listing["same_as_timed"]), (&true.into(), &false.into()));
    let said = "of the version that PoCL compiles for any local size";
    has(&made["microscope"]["notes"].to_string(), &["of cast_frame", said]);
    let page = folder.text("made/private/microscope.html");
    assert_eq!(page.matches(said).count(), 2, "a note on the page, and one on the kernel");
}

#[test]
fn the_page_stands_alone_with_source_and_instructions() {
    let scene = repository("scenes/teapot.toml");
    let (folder, device) = (WorkFolder::new(), device());
    let arguments = ["compile", scene.to_str().expect("a path"), "--device", &device, "--out", "made"];
    compile(&folder, &[&arguments[..], &["--strategy", "naive"]].concat());
    let page = folder.text("made/naive/microscope.html");
    has(&page, &["<h1>naive</h1>", "at[0] = value.x;", "data-line=", "default-src 'none'", "cast_frame: "]);
    for outside in ["<link", "src=\"http", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert_eq!(page.matches("<script").count(), 1);
    let made: Value = serde_json::from_str(&folder.text("made/naive/made.json")).expect("JSON");
    let rows = &made["microscope"]["listings"][0]["rows"];
    assert!(rows.as_array().is_some_and(|rows| rows.len() > 20), "{rows}");
}

#[test]
fn without_objdump_the_page_says_what_is_missing() {
    let (work_folder, device) = (WorkFolder::with(&[("scene.toml", crate::binary::TRIANGLE)]), device());
    let mut command =
        work_folder.raycl(&["compile", "scene.toml", "--device", &device, "--strategy", "naive", "--json"]);
    // In this `PATH`, raycl does not find `objdump`; PoCL finds the linker, which it needs for kernels that are not in
    // its cache.
    std::fs::create_dir(work_folder.path("tools")).expect("a folder");
    let path = std::env::var_os("PATH").expect("a PATH");
    if let Some(linker) =
        std::env::split_paths(&path).map(|folder| folder.join("ld")).find(|file| file.exists())
    {
        std::os::unix::fs::symlink(linker, work_folder.path("tools/ld")).expect("a link");
    }
    for cache in ["XDG_CACHE_HOME", "POCL_CACHE_DIR"] {
        command.env(cache, work_folder.path("cache"));
    }
    let output = command.env("PATH", work_folder.path("tools")).output().expect("it runs");
    let made: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    if made["binary_is_ptx"] == false {
        let notes = made["microscope"]["notes"].to_string();
        has(&notes, &["objdump is missing", "binutils"]);
        assert_eq!(made["microscope"]["listings"].as_array().map(Vec::len), Some(0));
    }
}
