//! `--cl-dir`: a folder of kernel files that differ from the built-in ones, or add values to a strategy's
//! axis, as docs/own-kernels.md describes.

use crate::binary::{TRIANGLE, WorkFolder, config, device, has, repository};
use crate::common::{COMMON_LOCAL_SIZE, Stand, scene};
use crate::schemas::table;
use raycl::strategy::{Records, Strategy, preset};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};

/// Returns the folder of the example of docs/own-kernels.md, which has one file,
/// `cast/intersect/baldwin_weber.cl`.
fn example() -> String {
    repository("docs/kernels").to_str().expect("UTF-8").to_owned()
}

const ADDED: &str = "intersector=baldwin-weber";
const FILE: &str = "cast/intersect/baldwin_weber.cl";

/// Returns a folder with the example's file, under the name `file`, with a part of its text replaced.
fn changed(folder: &WorkFolder, file: &str, from: &str, to: &str) -> String {
    folder.kernels_of(&format!("docs/kernels/{FILE}"), file, from, to)
}

const POINTS: &str = r#"
image_sizes = [[40, 30]]
local_sizes = [4]

[[strategy]]
preset = "deferred"
intersector = ["moller-trumbore", "baldwin-weber"]

[[strategy]]
preset = "bvh"
intersector = "baldwin-weber"
records = "once"
"#;

#[test]
fn a_file_is_a_value_at_once() {
    let (folder, cl) = (WorkFolder::new(), example());
    has(&folder.output(&["strategies", "--cl-dir", &cl]), &["  baldwin-weber", "a matrix per triangle"]);
    assert!(!folder.output(&["strategies"]).contains("baldwin-weber"));
    let scene = repository("scenes/gourd.toml");
    let device = device();
    let render = |strategy: &str| {
        let text = ["render", scene.to_str().expect("UTF-8"), "--device", &device, "--cl-dir", &cl];
        let size = ["--width", "75", "--height", "47", "--local-size", "4x4", "--verify", "--force"];
        folder.output(&[&text[..], &size, &["--strategy", strategy, "-o", "a.png"]].concat())
    };
    for strategy in ["naive,epsilons=relative", "tiled-wide", "bvh-packet"] {
        render(&format!("{strategy},intersector=baldwin-weber"));
        if !strategy.starts_with("naive") {
            let said = render(&format!("{strategy},intersector=baldwin-weber,records=once"));
            assert!(said.lines().any(|line| line.starts_with("records ")), "{said}");
        }
    }
    let kernel = folder.output(&["kernel", "deferred,intersector=baldwin-weber", "--cl-dir", &cl]);
    has(&kernel, &[FILE, "const float nx"]);
}

#[test]
fn an_experiment_takes_it_and_its_text_is_in_the_key() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("test.toml", &config(POINTS, 0, 5))]);
    let device = device();
    let run = |cl: &str| {
        let run =
            ["run", "test.toml", "--device", &device, "--out", "out", "--quiet", "--resume", "--cl-dir", cl];
        folder.output(&run);
        folder.json_lines("out/records.jsonl")
    };
    let first = run(&changed(&folder, FILE, "", ""));
    let names: Vec<_> = first.iter().filter_map(|record| record["name"].as_str()).collect();
    assert_eq!(names.iter().filter(|name| name.contains(ADDED)).count(), 2, "{names:?}");
    assert!(
        first.iter().all(|record| record["outcome"] == "measured" && record["unexplained_pixels"] == 0),
        "{first:?}"
    );
    has(&folder.text("out/report.html"), &["baldwin-weber"]);
    for record in &first {
        let once = record["strategy"].as_str().is_some_and(|strategy| strategy.contains("records=once"));
        assert_eq!(record["records_ms"].as_f64().is_some_and(|ms| ms > 0.0), once, "{record}");
    }
    let second = run(&changed(&folder, FILE, "typedef struct", "// changed\ntypedef struct"));
    // Older records are kept; only points whose kernels have the changed text are measured again.
    let is_new = |record: &&Value| first.iter().all(|other| other["key"] != record["key"]);
    let new: Vec<_> = second.iter().filter(is_new).collect();
    assert_eq!((new.len(), second.len()), (2, first.len() + 2), "{new:?}");
    assert!(new.iter().all(|record| record["name"].as_str().is_some_and(|name| name.contains(ADDED))));
}

#[test]
fn a_wrong_name_is_answered_with_the_nearest_and_a_contradiction_with_its_reason() {
    let (folder, cl) = (WorkFolder::with(&[("scene.toml", TRIANGLE)]), example());
    let mistake = |strategy: &str| {
        folder.mistake(&["render", "scene.toml", "--cl-dir", &cl, "--strategy", strategy], 2)
    };
    has(&mistake("deferred,intersector=baldwin-webber"), &["did you mean 'baldwin-weber'?"]);
    let said = mistake("deferred,intersector=baldwin-weber,culling=back");
    let because =
        "intersector = baldwin-weber contradicts culling = back: the matrix keeps no sign of the normal";
    has(&said, &[because, "help: "]);
    let taken = "intersector = edge-planes or watertight";
    has(
        &mistake("tile,intersector=baldwin-weber"),
        &["intersector = baldwin-weber, but traversal = tile", taken],
    );
    let refused = ["raster,records=once", "tile,records=once", "tile-group,records=once"];
    for strategy in refused {
        has(&mistake(strategy), &["records = once, but traversal", "records = each-test"]);
    }
    has(
        &mistake("naive,records=once,triangles=local"),
        &["records = once", "triangles = global, or with triangles = tiled"],
    );
    has(
        &mistake("tiled-common-origin,records=once"),
        &["common-origin needs new data of every triangle in every frame"],
    );
}

#[test]
fn a_mistake_in_a_folder_has_its_position_and_remedy() {
    let mistake =
        |work_folder: &WorkFolder, folder: &str| work_folder.mistake(&["strategies", "--cl-dir", folder], 2);
    let work_folder = WorkFolder::new();
    let folder = changed(&work_folder, FILE, "prepared_for: any-ray", "prepared_for: any-rays");
    let said = mistake(&work_folder, &folder);
    has(&said, &[FILE, "line 4", "'any-rays' is not a valid 'prepared_for'", "did you mean 'any-ray'?"]);
    // A file that replaces a built-in value of a strategy's axis needs a header, too: comment lines such as
    // `// meaning: TEXT`.
    let work_folder = WorkFolder::new();
    let folder = changed(&work_folder, "cast/intersect/watertight.cl", "// meaning: ", "// ");
    has(
        &mistake(&work_folder, &folder),
        &["watertight.cl, line 1", "no 'meaning'", "`// record_floats: 1 to 64`"],
    );

    let work_folder = WorkFolder::new();
    let folder = changed(&work_folder, "cast/intersct/baldwin_weber.cl", "", "");
    has(
        &mistake(&work_folder, &folder),
        &["no file includes it", "did you mean cast/intersect/baldwin_weber.cl?", "tile_gpu/intersect/"],
    );
    let work_folder = WorkFolder::new();
    let folder = changed(&work_folder, "cast/exhaustve.cl", "", "");
    has(
        &mistake(&work_folder, &folder),
        &[
            "no file includes it",
            "did you mean cast/exhaustive.cl?",
            "lies in one of the folders cast/vectors/, cast/triangles/",
        ],
    );

    let work_folder = WorkFolder::new();
    let folder = changed(&work_folder, "cast/intersect/My test.cl", "", "");
    let said = mistake(&work_folder, &folder);
    has(
        &said,
        &[
            "My test.cl: this file is a value of the axis 'intersector'",
            "rename the file, for example to cast/intersect/my_test.cl",
        ],
    );

    has(&mistake(&WorkFolder::new(), "nowhere"), &["cannot read nowhere", "--cl-dir expects a folder"]);
    let work_folder = WorkFolder::with(&[("empty/readme.txt", "")].map(|_| ("note.txt", "no kernel")));
    has(&mistake(&work_folder, "."), &["contains no kernel file"]);
}

/// The compiler finds the error where a built-in file calls the user's function.
#[test]
fn a_function_with_wrong_parameters_is_a_mistake_in_the_users_file() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let cl = changed(&folder, FILE, "varying t_max, Hit *hit) {", "Hit *hit, varying t_max) {");
    let device = device();
    let strategy = "deferred,intersector=baldwin-weber";
    let file =
        format!("the built-in kernel files compile by themselves, but this program contains {cl}/{FILE}: ");
    for command in ["render", "compile"] {
        let arguments = [command, "scene.toml", "--device", &device, "--cl-dir", &cl, "--strategy", strategy];
        has(
            &folder.mistake(&arguments, 2),
            &[&file, "docs/own-kernels.md lists the functions", "--cl-dir DIR"],
        );
    }
}

/// The host computes sizes of memory and macros from the header of a kernel file. The file's code must agree with its
/// header.
#[test]
fn a_header_that_disagrees_with_its_files_code_is_a_mistake_in_the_users_file() {
    let device = device();
    // Some drivers, such as PoCL 6.0, report 0 bytes of __local memory for every kernel. With such a driver,
    // raycl cannot notice the first of the `mistakes` of this test.
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let compile = ["compile", "scene.toml", "--device", &device, "--strategy", "local-vectors", "--json"];
    let made: Value = serde_json::from_str(&folder.output(&compile)).expect("JSON");
    let kernels = made["kernels"].as_array().expect("a list");
    let is_reported =
        kernels.iter().any(|kernel| kernel["local_bytes"].as_u64().is_some_and(|bytes| bytes > 0));
    let mistakes = [
        (
            "cast/vectors/local.cl",
            "memory: local",
            "memory: private",
            "local-vectors",
            "B of __local memory, but according to the header of kernels/cast/vectors/local.cl, it uses 0 B",
        ),
        (
            "cast/triangles/local.cl",
            "copied: scene",
            "copied: nothing",
            "local-triangles",
            "`copied` in the header of this file requires STAGE_VERTICES to be 0",
        ),
    ];
    for (file, from, to, strategy, message) in mistakes.into_iter().skip(usize::from(!is_reported)) {
        let points =
            format!("image_sizes = [[16, 9]]\nlocal_sizes = [8]\nstrategies = [\"{strategy}\", \"naive\"]\n");
        let folder = WorkFolder::with(&[("scene.toml", TRIANGLE), ("test.toml", &config(&points, 0, 1))]);
        let cl = folder.kernels(file, from, to);
        let render = ["render", "scene.toml", "--device", &device, "--strategy", strategy];
        let render = [&render[..], &["--local-size", "8", "--cl-dir", &cl]].concat();
        has(&folder.mistake(&render, 2), &[file, message, "docs/own-kernels.md"]);
        // The remedy names the command `raycl kernel`, which prints the program even if it does not compile.
        has(&folder.output(&["kernel", strategy, "--cl-dir", &cl]), &[file, "__kernel "]);
        let run = ["run", "test.toml", "--device", &device, "--out", "out", "--quiet", "--cl-dir", &cl];
        folder.raycl(&run).output().expect("raycl starts");
        let records = folder.json_lines("out/records.jsonl");
        let of = |name: &str| records.iter().find(|record| record["name"] == name).expect("a record");
        has(of(strategy)["reason"].as_str().unwrap_or_default(), &[file, message]);
        assert_eq!(of("naive")["outcome"], "measured");
    }
}

/// The folder of `--cl-dir` has a single file, which replaces the built-in file of this name; all other
/// kernel files are the built-in ones.
#[test]
fn a_folder_holds_what_differs() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let kernels = folder.kernels("common/store_radiance.cl", "", "#error \"mine\"\n");
    let message = folder.mistake(&["kernel", "naive", "--cl-dir", &kernels], 2);
    has(&message, &["kernels/common/store_radiance.cl, line 1: #error \"mine\""]);
}

/// Every axis of strategies whose values are kernel files accepts an additional value: in this test, a copy
/// of a built-in value under another name.
#[test]
fn each_axis_of_files_takes_a_new_one() {
    let work_folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let copies = [
        ("cast/vectors", "private", "mine"),
        ("cast/triangles", "tiled", "mine"),
        ("cast/layout", "indexed16", "mine"),
        ("cast/shading", "deferred", "mine"),
        ("tile_cpu/intersect", "edge_planes", "my_planes"),
    ];
    for (folder, from, to) in copies {
        work_folder.kernels_of(&format!("cl/{folder}/{from}.cl"), &format!("{folder}/{to}.cl"), "", "");
    }
    let kernel = |strategy: &str| work_folder.output(&["kernel", strategy, "--cl-dir", "kernels"]);
    let canonical =
        |strategy| work_folder.output(&["kernel", strategy, "--cl-dir", "kernels", "--canonical"]);
    let same = [
        ("deferred,vectors=mine", "deferred", "vectors/mine.cl"),
        ("deferred,shading=mine", "deferred", "shading/mine.cl"),
        ("deferred,layout=mine", "deferred,layout=indexed16", "cast/indexed.cl"),
        ("tile,intersector=my-planes", "tile", "tile_cpu/intersect/my_planes.cl"),
    ];
    for (own, built_in, file) in same {
        has(&kernel(own), &[file]);
        assert_eq!(canonical(own), canonical(built_in), "{own}");
    }
    assert_eq!(canonical("tiled,triangles=mine"), canonical("tiled"));
    let refused = work_folder.mistake(&["kernel", "bvh,triangles=mine", "--cl-dir", "kernels"], 2);
    has(&refused, &["triangles = mine, but traversal = bvh", "triangles = global"]);
}

/// A record is the list of numbers that a ray-triangle test needs of a triangle. A user's test may have
/// records that are longer or shorter than those of the built-in tests. The pictures that a user's test makes
/// agree with the reference in three cases: records are read from a table in global memory, records are read
/// from a tile of triangles in `__local` memory, and records are computed at each test.
#[test]
fn a_record_is_as_long_as_its_file_says() {
    let folder = WorkFolder::new();
    let (scene, cl) = (repository("scenes/gourd.toml"), repository("tests/overlay"));
    let (scene, cl) = (scene.to_str().expect("UTF-8"), cl.to_str().expect("UTF-8"));
    let device = device();
    for strategy in ["deferred", "tiled-wide,records=once", "bvh,records=once"] {
        let strategy = format!("{strategy},intersector=nine-floats");
        let render = ["render", scene, "--device", &device, "--cl-dir", cl, "--strategy", &strategy];
        let size = ["--width", "40", "--height", "30", "--local-size", "4x4", "--verify", "--force"];
        folder.output(&[&render[..], &size, &["-o", "a.png"]].concat());
    }
}

/// With both values of the axis `records`, every certain pixel (a pixel that rounding cannot decide) agrees with the
/// reference.
#[test]
fn records_once_and_at_each_test_give_the_same_certain_pixels() {
    let mut stand = Stand::new(scene("gourd.toml"), [45, 29]);
    for name in ["deferred", "tiled", "bvh"] {
        let strategy = preset(name).expect("a preset").strategy;
        for records in [Records::EachTest, Records::Once] {
            let strategy = Strategy { records, ..strategy };
            let verdict = stand.check(&strategy, COMMON_LOCAL_SIZE).expect("it fits");
            assert!(verdict.ok, "{strategy}: {:?}", verdict.reason);
        }
    }
}

const PAGE: &str = "docs/own-kernels.md";

/// The files that values of axes share: the text of such a file belongs to each file that includes it.
const SHARED: [&str; 2] = ["cast/indexed.cl", "cast/working_in_memory.cl"];

/// Returns the text of a kernel file without comments, with the shared files that it includes.
fn code(name: &str) -> String {
    let text = read_to_string(repository("cl").join(name)).expect("a kernel file");
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default().trim_end());
    let lines =
        lines.map(|line| match line.strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"')) {
            Some(inner) if SHARED.contains(&inner) => code(inner),
            _ => line.to_owned(),
        });
    lines.collect::<Vec<_>>().join("\n")
}

fn is_in_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn words(code: &str) -> BTreeSet<String> {
    code.split(|c: char| !is_in_word(c)).map(str::to_owned).collect()
}

/// Returns the macros, types and functions that a file defines.
fn defined(code: &str) -> BTreeSet<String> {
    let name = |line: &str| {
        let start = match (line.strip_prefix("#define "), line.strip_prefix("} ")) {
            (Some(rest), _) | (_, Some(rest)) => rest,
            // A function: a type, a name and parameters.
            _ if line.starts_with(char::is_alphabetic) => line.split_once('(')?.0.rsplit(' ').next()?,
            _ => return None,
        };
        Some(start.split(|c: char| !is_in_word(c)).next()?.to_owned())
    };
    code.lines().filter_map(name).collect()
}

/// Returns the kernel files of a folder, except shared ones.
fn kernel_files(folder: &str) -> Vec<String> {
    let entries = read_dir(repository("cl").join(folder)).expect("a folder");
    let names = entries.map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8"));
    let files = names.filter(|name| name.ends_with(".cl")).map(|name| format!("{folder}/{name}"));
    files.filter(|file| !SHARED.contains(&file.as_str())).collect()
}

/// Returns the names that stand between backticks in a table's cell, without the parameters in brackets.
fn named(cell: &str) -> Vec<&str> {
    let quoted = cell.split('`').skip(1).step_by(2);
    quoted.map(|name| name.split('(').next().unwrap_or_default()).collect()
}

/// In docs/own-kernels.md, the table of helpers names a file for each helper. This test checks that each of
/// these files contains its helper.
#[test]
fn the_page_lists_helpers_with_their_files() {
    let rows = table(PAGE, "\n### Helpers\n");
    assert!(rows.len() > 10);
    for row in rows {
        let (names, files) = (named(&row[0]), named(&row[2]));
        let words = words(&code(files[0]));
        assert!(names.iter().all(|name| words.contains(*name)), "{}: {names:?}", files[0]);
    }
}

/// Returns true if a kernel file uses the name in a table's cell. A name with parameters is used where it is called.
fn uses(file: &str, cell: &str) -> bool {
    let (code, name) = (code(file), named(cell)[0]);
    if !cell.contains('(') {
        return words(&code).contains(name);
    }
    code.match_indices(&format!("{name}(")).any(|(at, _)| !code[..at].ends_with(is_in_word))
}

/// Returns the kernel files, out of `files`, that a table's cell names. A name such as `shading/` stands for all files of
/// a folder.
fn listed<'a>(cell: &str, files: &'a [String]) -> BTreeSet<&'a str> {
    let mut all = BTreeSet::new();
    for name in named(cell) {
        let ending = format!("/{name}");
        if name.ends_with('/') {
            all.extend(files.iter().filter(|file| file.contains(&ending)).map(String::as_str));
        } else if name.ends_with(".cl") {
            let file = files.iter().find(|file| file.ends_with(&ending) || *file == name);
            all.insert(file.unwrap_or_else(|| panic!("there is no {name}")).as_str());
        }
    }
    all
}

/// Checks a table of docs/own-kernels.md: the first one that follows the text `after`. The table must list exactly the
/// names that meet two conditions: all files of the folder `own` define the name, and files of the folders `outside`
/// use it. Each row of the table must list exactly the files that use its name.
fn lists_names_with_their_users(after: &str, own: &str, outside: &[String]) {
    let files: Vec<_> = kernel_files(own).iter().map(|name| code(name)).collect();
    let is_own = |name: &String| files.iter().all(|file| defined(file).contains(name));
    let outside: Vec<_> = outside.iter().flat_map(|folder| kernel_files(folder)).collect();
    let used: BTreeSet<_> = outside.iter().flat_map(|file| words(&code(file))).collect();
    let expected = defined(&files[0]).into_iter().filter(|name| is_own(name) && used.contains(name));

    let rows = table(PAGE, after);
    let names = rows.iter().map(|row| named(&row[0])[0].to_owned());
    assert_eq!(names.collect::<BTreeSet<_>>(), expected.collect::<BTreeSet<_>>(), "{own}");
    for row in &rows {
        let users = outside.iter().map(String::as_str).filter(|file| uses(file, &row[0]));
        assert_eq!(listed(&row[2], &outside), users.collect::<BTreeSet<_>>(), "{own}: {}", row[0]);
    }
}

/// Some axes have no example file on the page docs/own-kernels.md. For each of these axes, the page lists the names
/// that a file of the axis must define, and the files that use each name.
#[test]
fn the_page_lists_the_names_that_a_value_of_an_axis_defines() {
    let axes = ["vectors", "triangles", "layout", "shading"];
    for axis in axes {
        let others = axes.iter().filter(|other| **other != axis).map(|other| format!("cast/{other}"));
        let outside: Vec<_> = others.chain(["cast", "raster"].map(str::to_owned)).collect();
        lists_names_with_their_users(&format!("\n### `{axis}`\n"), &format!("cast/{axis}"), &outside);
    }
    let outside = ["tile_cpu", "tile_cpu/intersect"].map(str::to_owned);
    lists_names_with_their_users(
        "\nIn the following table, a triangle's *index*",
        "tile_cpu/layout",
        &outside,
    );
}
