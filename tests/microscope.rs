//! The microscope of `raycl compile`: each source line with the instructions that the device's compiler
//! generated from it.
//!
//! The working vectors are the vectors of a ray, such as its origin and direction. Three adjacent lines write them, one
//! line for each component, and a single line reads them. These lines show whether instructions are attributed to the
//! right lines: the lines before and after the stores must have no stores, the line of the loads must have no stores,
//! and the line after it no loads.

use crate::binary::{WorkFolder, device, has, repository};
use serde_json::Value;

/// Returns the output of `raycl compile --json` for the whole-frame kernel of a strategy, as compiled by the driver.
fn listing(strategy: &str) -> Value {
    let scene = repository("scenes/teapot.toml");
    let device = device();
    let scene = scene.to_str().expect("a path");
    let text =
        WorkFolder::new().output(&["compile", scene, "--device", &device, "--strategy", strategy, "--json"]);
    let made: Value = serde_json::from_str(&text).expect("JSON");
    let listings = made["microscope"]["listings"].as_array().expect("a list");
    let of_frame = listings.iter().find(|listing| listing["kernel"] == "cast_frame");
    let listing =
        of_frame.unwrap_or_else(|| panic!("no cast_frame: {}", made["microscope"]["notes"])).clone();
    assert_eq!(listing["rows_are"], "lines", "the compiler wrote no line table");
    listing
}

/// Returns the memory under which accesses are counted: the memory `named` if the device's instructions are PTX,
/// otherwise `generic`.
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

/// Checks that the working vectors' lines, and not their neighbours, access a memory.
fn check_working_vectors(strategy: &str, named: &str) {
    let listing = listing(strategy);
    let [load, store] = ["load", "store"].map(|verb| format!("{verb} {}", memory(&listing, named)));
    let [x, y, z] =
        ["at[0] = value.x;", "at[1] = value.y;", "at[2] = value.z;"].map(|text| line_of(&listing, text));
    assert_eq!([y, z], [x + 1, x + 2]);
    // The kernel sets four of the vectors at the start, and the others at each hit.
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
    assert!(with_line * 10 > all * 8, "{with_line} of {all} instructions have a line");
}

#[test]
fn the_page_stands_alone_with_source_and_instructions() {
    let scene = repository("scenes/teapot.toml");
    let (folder, device) = (WorkFolder::new(), device());
    let arguments = ["compile", scene.to_str().expect("a path"), "--device", &device, "--out", "made"];
    folder.output(&[&arguments[..], &["--strategy", "naive"]].concat());
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
