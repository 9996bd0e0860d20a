//! `raycl kernel` prints the text that a compiler gets. A program built from this text casts the same image
//! as the strategy.

use crate::binary::{WorkFolder, device, has, repository};
use crate::common::Stand;
use raycl::device::{Builtins, LaneOperations};
use raycl::image::Radiance;
use raycl::launch::Prepared;
use raycl::program::preprocess::{canonical, preprocess};
use raycl::program::{ProgramSpec, Sources, frame_kernels};
use raycl::scene::load_scene;
use raycl::strategy::{PRESETS, Strategy, Workload, preset};
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

/// Returns the program of a strategy on a device with these lane operations.
fn program(strategy: &Strategy, lanes: LaneOperations) -> ProgramSpec {
    let local_size = if strategy.shares_tiles() { [32, lanes.usual_groups()] } else { [8, 8] };
    let builtins = Builtins { reduce: true, prefetch: true, lanes, ..Builtins::default() };
    let workload = Workload { local_size, ..Workload::CUBE };
    ProgramSpec::new(&Sources::Embedded, strategy, &workload, builtins).expect("a program")
}

fn preprocessed(spec: &ProgramSpec) -> String {
    preprocess(&spec.source, &spec.options, &BTreeMap::new()).expect("a text").text()
}

/// Returns a program as the C compiler's preprocessor expands it.
fn by_compiler(spec: &ProgramSpec) -> String {
    let mut words = spec.options.split_whitespace();
    let mut cc = Command::new("cc");
    cc.args(["-E", "-P", "-undef", "-x", "c"]);
    while let Some(word) = words.next() {
        if word == "-D" {
            cc.args(["-D", words.next().expect("a define")]);
        }
    }
    let mut child =
        cc.arg("-").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("cc: `make setup`");
    let (mut stdin, source) = (child.stdin.take().expect("a pipe"), spec.source.clone());
    let writer = std::thread::spawn(move || stdin.write_all(source.as_bytes()));
    let output = child.wait_with_output().expect("its output");
    writer.join().expect("a thread").expect("cc reads all");
    assert!(output.status.success());
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[test]
fn every_preset_is_what_the_c_compiler_makes_of_it() {
    let all = [
        LaneOperations::Barriers,
        LaneOperations::SubGroups,
        LaneOperations::PtxShuffles,
        LaneOperations::Ptx,
    ];
    for preset in PRESETS {
        let lanes = if preset.strategy.shares_tiles() { &all[..] } else { &all[..1] };
        for lanes in lanes {
            let spec = program(&preset.strategy, *lanes);
            let (ours, theirs) = (canonical(&preprocessed(&spec)), canonical(&by_compiler(&spec)));
            let differing = ours.lines().zip(theirs.lines()).find(|(ours, theirs)| ours != theirs);
            assert_eq!(differing, None, "{} by {lanes:?}", preset.name);
            assert_eq!(ours.len(), theirs.len(), "{} by {lanes:?}", preset.name);
            for kernel in frame_kernels(&preset.strategy, &Workload::CUBE) {
                assert!(ours.contains(&format!("void {kernel} (")), "{} has no {kernel}", preset.name);
            }
        }
    }
}

#[test]
fn what_is_preprocessed_stays_as_it_is() {
    for preset in PRESETS {
        let once = preprocessed(&program(&preset.strategy, LaneOperations::Barriers));
        let again = preprocess(&once, "", &BTreeMap::new()).expect("a text").text();
        assert!(once == again, "{}", preset.name);
        let directive = once.lines().find(|line| line.starts_with('#') && !line.starts_with("#pragma"));
        assert_eq!(directive, None, "{}", preset.name);
    }
}

/// Returns what `raycl kernel` prints for a strategy, the test device and a scene's file.
fn printed(strategy: &str, scene: &Path, local_size: [u32; 2]) -> String {
    let device = crate::binary::device();
    let (scene, [x, y]) = (scene.to_str().expect("a path"), local_size);
    let size = format!("{x}x{y}");
    WorkFolder::new().output(&[
        "kernel",
        strategy,
        "--device",
        &device,
        "--scene",
        scene,
        "--local-size",
        &size,
    ])
}

/// Returns a program like `built`, but with the source text that the command `raycl kernel` prints. The new
/// program has no defines as compiler options, since the text contains all defines.
fn reprinted(name: &str, scene: &Path, built: &Prepared) -> ProgramSpec {
    let options = built.spec.options.split_whitespace().filter(|word| word.starts_with("-cl"));
    let options = options.collect::<Vec<_>>().join(" ");
    ProgramSpec { source: printed(name, scene, built.workload.local_size), options, files: Vec::new() }
}

fn image(built: &Prepared) -> Radiance {
    let caster = built.caster().expect("a caster");
    caster.cast().expect("a frame");
    caster.read().expect("an image").0
}

/// Builds a strategy's program from the text that the binary prints for the scene of `stand`. Checks that
/// this program has all kernels that frames need and, if `casts` is true, that it casts the same image as the program
/// that raycl builds for this strategy.
fn check_printed(stand: &Stand, scene: &Path, (name, casts): (&str, bool)) {
    let mut words = name.split(',');
    let mut strategy = preset(words.next().unwrap_or_default()).expect("a preset").strategy;
    for (axis, value) in words.filter_map(|word| word.split_once('=')) {
        strategy.set(axis, value).expect("a value of an axis");
    }
    let own = stand.build(&strategy, [8, 4]).expect("a device that holds it");
    let mut session = stand.session.borrow_mut();
    let again = session.build(&strategy, &own.workload, reprinted(name, scene, &own));
    let again = again.unwrap_or_else(|refused| panic!("{name}: {}", refused.reason()));
    again.caster().unwrap_or_else(|refused| panic!("{name}: {}", refused.reason()));
    assert!(!casts || image(&again) == image(&own), "{name}: another image");
}

#[test]
fn what_is_printed_casts_the_same_image() {
    let file = repository("scenes/still-life.toml");
    let stand = Stand::new(load_scene(&file).expect("a scene").scene, [30, 20]);
    // Frames are cast with only two strategies of this list, to save time. PoCL compiles a kernel when the
    // kernel is started, which takes most of a minute for a kernel with tiles.
    for strategy in [
        ("naive", true),
        ("deferred,width=4", true),
        ("deferred,records=once", false),
        ("bvh", false),
        ("raster", false),
        ("tile", false),
    ] {
        check_printed(&stand, &file, strategy);
    }
}

/// In a scene without lights, a strategy whose work-items share tiles has other kernels.
#[test]
fn what_is_printed_for_a_dark_scene_has_all_kernels() {
    let dark = "[camera]\nposition = [0, 1, 3]\nlook_at = [0, 0, 0]\n[[object]]\n\
                vertices = [[-1, 0, 0], [1, 0, 0], [0, 1, 0]]\nfaces = [[0, 1, 2]]\n";
    let folder = WorkFolder::with(&[("dark.toml", dark)]);
    let file = folder.path("dark.toml");
    let stand = Stand::new(load_scene(&file).expect("a scene").scene, [30, 20]);
    check_printed(&stand, &file, ("tile-group", false));
}

#[test]
fn a_kernel_is_printed_to_be_read() {
    let text = WorkFolder::new().output(&["kernel", "naive"]);
    has(
        &text,
        &[
            "// raycl kernel naive\n// traversal=exhaustive vectors=heap",
            "// local size: 8 x 8 work-items; a small scene: 12 triangles",
            "// for any device",
            "WIDTH=1",
            "kernels that a frame with one sample per pixel may need: cast_frame\n",
            "// ---- cast/intersect/moller_trumbore.cl, line ",
            "working_set(working, 0 /* RAY_ORIGIN */, ray.origin);",
            "reqd_work_group_size(8 /* LOCAL_X */, 8 /* LOCAL_Y */, 1)",
            "// files that add only macros (expanded above): ",
            "are left out; --all prints them",
        ],
    );
    let mut headings = text.lines().filter(|line| line.starts_with("// ---- "));
    assert!(
        headings.next_back().is_some_and(|last| last.starts_with("// ---- cast/entry.cl, line ")),
        "{text}"
    );
    for gone in ["\n#", "cast_rays", "cast_primary", "tile_", "\n\n\n", " \n", "BIND_"] {
        assert!(!text.contains(gone), "{gone:?} is in:\n{text}");
    }
    let all = WorkFolder::new().output(&["kernel", "naive", "--all"]);
    has(&all, &["store_nearest("]);
    assert!(!text.contains("store_nearest("));
    assert!(!all.contains("left out") && all.lines().count() > text.lines().count());
}

#[test]
fn sizes_are_those_of_the_scene_and_the_local_size() {
    let scene = crate::binary::repository("scenes/teapot.toml");
    let scene = scene.to_str().expect("a path");
    let folder = WorkFolder::new();
    let text = folder.output(&["kernel", "bvh", "--scene", scene, "--local-size", "16x2"]);
    has(
        &text,
        &["// local size: 16 x 2 work-items;", "1026 triangles", "reqd_work_group_size(16 /* LOCAL_X */, 2"],
    );
    has(
        &folder.output(&["kernel", "tile-group"]),
        &["// local size: 32 x 1 ", "exchange values by barriers"],
    );
}

/// The microscope (the listing of `raycl compile`) counts the lines of a program from the first line after
/// the comment with which `raycl kernel` begins.
#[test]
fn the_kernels_page_has_the_numbers_of_lines_of_naive() {
    let page = std::fs::read_to_string(repository("docs/kernels.md")).expect("a page");
    let table =
        page.split("\nline  source").nth(1).and_then(|rest| rest.split("\n```").next()).expect("a table");
    let text = WorkFolder::new().output(&["kernel", "naive"]);
    let (_, program) = text.split_once("\n\n").expect("a comment and a program");
    let lines: Vec<&str> = program.lines().map(str::trim).collect();
    let rows: Vec<&str> = table.lines().skip(1).collect();
    for row in &rows {
        let mut cells = row.split("  ").map(str::trim).filter(|cell| !cell.is_empty());
        let number: usize = cells.next().and_then(|cell| cell.parse().ok()).expect("a number");
        assert_eq!(cells.next(), lines.get(number - 1).copied(), "{row}");
    }
    assert_eq!(rows.len(), 5);
}

#[test]
fn texts_for_the_compiler_are_equal_where_it_sees_no_difference() {
    let (work_folder, file) = (WorkFolder::new(), "cast/intersect/moller_trumbore.cl");
    let folder = work_folder.kernels(file, "// This test", "// Quite another comment:\n\n  // This test");
    let of =
        |arguments: &[&str]| work_folder.output(&[&["kernel", "naive", "--canonical"], arguments].concat());
    assert_eq!(of(&[]), of(&["--cl-dir", &folder]));
    assert_ne!(of(&[]), of(&["--local-size", "4x4"]));
}

#[test]
fn a_mistake_in_a_kernel_has_its_file_and_line() {
    let file = "cast/intersect/moller_trumbore.cl";
    // The wrong line replaces the first empty line of the file, which follows the comment that describes the file.
    let text = std::fs::read_to_string(repository("cl").join(file)).expect("a kernel file");
    let at = text.lines().take_while(|line| !line.is_empty()).count() + 1;
    for (line, said) in [
        ("#if 1 +\n#endif", "a value is missing at the condition's end"),
        ("#error \"not yet\"", "#error \"not yet\""),
    ] {
        let work_folder = WorkFolder::new();
        let folder = work_folder.kernels(file, "\n\n", &format!("\n{line}\n"));
        let message = work_folder.mistake(&["kernel", "naive", "--cl-dir", &folder], 2);
        has(&message, &[&format!(" {folder}/{file}, line {at}: {said}"), "help: "]);
    }
    let message = WorkFolder::new().mistake(&["kernel", "tile-group", "--local-size", "8x8"], 2);
    has(&message, &["cl/common/lanes.cl, line ", "32 work-items", "help: "]);
    let large = ["kernel", "naive", "--device", &device(), "--local-size", "4096x4096"];
    let advice = "help: choose another strategy, --local-size or --scene";
    has(&WorkFolder::new().mistake(&large, 2), &["work-group: 4096 x 4096", advice]);
    has(&WorkFolder::new().mistake(&["kernel", "navie"], 2), &["naive"]);
    has(
        &WorkFolder::new().mistake(&["kernel", "deferred,shading=eager,passes=separate"], 2),
        &["is not allowed"],
    );
}
