//! The code that compilers generate from the kernels. Stored PTX (`tests/ptx/make` lists its compilers) shows
//! that working vectors and triangles lie in the memory that a strategy names. The command `raycl compile`
//! stores its results, whichever device it compiles for.

use crate::binary::{TRIANGLE, WorkFolder, device, has, repository};
use raycl::program::compiled::{InstructionCounts, instruction_counts, is_ptx};
use serde_json::Value;

/// Returns the numbers of instructions of the whole-frame kernel in two stored PTX files, one from clang and one from
/// NVIDIA's driver.
fn stored(name: &str) -> [(String, InstructionCounts); 2] {
    ["clang", "driver"].map(|whose| stored_of(name, whose))
}

fn stored_of(name: &str, whose: &str) -> (String, InstructionCounts) {
    let file = format!("tests/ptx/{name}.{whose}.ptx");
    let text = std::fs::read_to_string(repository(&file)).unwrap_or_else(|e| panic!("{file}: {e}"));
    assert!(is_ptx(text.as_bytes()), "{file}");
    let counts =
        instruction_counts(&text, "cast_frame").unwrap_or_else(|| panic!("{file} has no cast_frame"));
    (file, counts)
}

/// Returns the number of instructions of a kind.
fn count(counts: &InstructionCounts, name: &str) -> u32 {
    counts.instructions.get(name).copied().unwrap_or(0)
}

/// Number of store instructions that write the picture; all other stores write working vectors.
const STORES_OF_THE_PICTURE: u32 = 4;

#[test]
fn global_vectors_are_in_global_memory() {
    for (file, counts) in stored("vectors-global") {
        assert!(count(&counts, "st.global") > STORES_OF_THE_PICTURE, "{file}: {counts}");
        assert_eq!([counts.reach("shared"), counts.reach("local")], [0, 0], "{file}: {counts}");
        assert_eq!(counts.private_array_bytes, 0, "{file}");
    }
}

#[test]
fn local_vectors_are_in_shared_memory() {
    for (file, counts) in stored("vectors-local") {
        assert!(count(&counts, "ld.shared") > 9 && count(&counts, "st.shared") > 9, "{file}: {counts}");
        assert!(count(&counts, "st.global") <= STORES_OF_THE_PICTURE, "{file}: {counts}");
        assert_eq!(counts.reach("local"), 0, "{file}: {counts}");
    }
}

#[test]
fn private_vectors_are_in_registers() {
    for (file, counts) in stored("vectors-private") {
        assert_eq!([counts.reach("shared"), counts.reach("local")], [0, 0], "{file}: {counts}");
        assert_eq!(counts.private_array_bytes, 0, "{file}: an array lies in memory");
        assert!(count(&counts, "st.global") <= STORES_OF_THE_PICTURE, "{file}: {counts}");
    }
}

/// At each ray-triangle test of primary rays and of shadow rays, the kernel of `naive-test-vectors` writes
/// and reads five vectors of three floats each. clang accesses the stack by generic addresses, so this test
/// counts generic stores and loads, too.
#[test]
fn the_tests_own_vectors_are_in_private_memory() {
    for (file, counts) in stored("test-vectors") {
        assert!(counts.private_array_bytes >= 5 * 3 * 4, "{file}: {} bytes", counts.private_array_bytes);
        let [stores, loads] = ["st", "ld"].map(|verb| {
            count(&counts, &format!("{verb}.local")) + count(&counts, &format!("{verb}.generic"))
        });
        assert!(stores >= 30 && loads >= 30, "{file}: {counts}");
    }
}

#[test]
fn constant_triangles_are_read_from_constant_memory() {
    // Each PTX file is compared with the file `vectors-private` of the same compiler. Both `triangles-constant` and
    // `vectors-private` are stored as compiled by both compilers.
    for ((file, counts), (_, global)) in stored("triangles-constant").iter().zip(stored("vectors-private")) {
        assert_eq!([counts.reach("shared"), counts.reach("local")], [0, 0], "{file}: {counts}");
        assert!(counts.reach("const") > 9, "{file}: {counts}");
        assert!(counts.reach("global") < global.reach("global"), "{file}: {counts}");
    }
}

#[test]
fn local_triangles_are_read_from_shared_memory() {
    for (file, counts) in stored("triangles-local") {
        assert!(count(&counts, "ld.shared") > 9, "{file}: {counts}");
        assert_eq!(counts.reach("local"), 0, "{file}: {counts}");
    }
}

#[test]
fn volatile_vectors_are_loaded_at_every_test() {
    // The times of a kernel show the effect of a memory only if the loop over triangles accesses this memory.
    // The kernel of the student paper that raycl reproduces reads the ray at each ray-triangle test.
    for name in ["vectors-global", "vectors-local"] {
        for ((file, counts), (_, private)) in stored(name).iter().zip(stored("vectors-private")) {
            let all = |counts: &InstructionCounts| counts.reach("global") + counts.reach("shared");
            assert!(all(counts) > all(&private) + 50, "{file}: {counts}");
        }
    }
}

/// If a script names the strategy by a shell variable that is not set, raycl gets an empty name.
#[test]
fn a_strategy_without_a_name_is_refused_and_nothing_is_written() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let said = folder.mistake(&["compile", "scene.toml", "--strategy", "", "--out", "made"], 2);
    has(&said, &["'' names no strategy", "deferred,width=4"]);
    assert!(!folder.path("made").exists());
    has(
        &folder.mistake(&["render", "scene.toml", "--strategy", ",", "-o", "a.png"], 2),
        &["',' names no strategy"],
    );
    assert!(!folder.path("a.png").exists());
}

/// The two strategies of this test have different usual local sizes, since 32 work-items share a tile in one
/// of the strategies.
#[test]
fn each_strategy_is_compiled_at_its_usual_local_size() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let device = device();
    let arguments = ["compile", "scene.toml", "--device", &device, "--strategy", "naive"];
    let text = folder.output(&[&arguments[..], &["--strategy", "tile-group"]].concat());
    has(&text, &["naive at local size 8 x 8", "tile-group at local size 32 x "]);
}

#[test]
fn a_strategy_that_does_not_compile_leaves_the_others() {
    let folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let (device, kernels) =
        (device(), folder.kernels("cast/shading/eager.cl", "void on_nearer_hit", "oops;"));
    let strategies = ["naive", "deferred", "local-vectors"].map(|name| ["--strategy", name]).concat();
    let arguments = ["compile", "scene.toml", "--device", &device, "--cl-dir", &kernels, "--out", "made"];
    let output = folder.raycl(&[&arguments[..], &strategies].concat()).assert().code(2).get_output().clone();
    let [text, said] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("UTF-8"));
    has(&text, &["deferred at local size 8 x 8", "Written to made"]);
    has(&said, &["naive:\n", "eager.cl:", "2 of 3 programs were not compiled: naive, local-vectors"]);
    assert!(folder.path("made/deferred/made.json").exists() && !folder.path("made/naive").exists());
}

#[test]
fn compile_keeps_source_log_binary_and_what_was_made() {
    let work_folder = WorkFolder::with(&[("scene.toml", TRIANGLE)]);
    let device = device();
    let arguments = ["compile", "scene.toml", "--device", &device, "--out", "made", "--local-size", "4x2"];
    let text = work_folder
        .output(&[&arguments[..], &["--strategy", "naive", "--strategy", "deferred,width=4"]].concat());
    has(
        &text,
        &["naive at local size 4 x 2", "cast_frame", "deferred,width=4", "cast_primary", "shade_nearest"],
    );
    for folder in ["made/naive", "made/deferred-width-4"] {
        let made: Value =
            serde_json::from_str(&work_folder.text(&format!("{folder}/made.json"))).expect("JSON");
        for kernel in made["kernels"].as_array().expect("a list") {
            assert!(kernel["work_group_size"].as_u64() >= Some(8), "{kernel}");
            // Memory instructions are only counted if the binary is PTX.
            assert_eq!(kernel["census"].is_null(), made["binary_is_ptx"] == false, "{kernel}");
        }
        has(&work_folder.text(&format!("{folder}/source.cl")), &["__kernel", "#line 1 \"cast/entry.cl\""]);
        has(&work_folder.text(&format!("{folder}/options.txt")), &["-D LOCAL_X=4 -D LOCAL_Y=2"]);
        let binary = if made["binary_is_ptx"] == true { "binary.ptx" } else { "binary.bin" };
        assert!(work_folder.path(folder).join(binary).metadata().expect("a binary").len() > 0);
        assert!(work_folder.path(folder).join("build.log").exists());
    }
}
