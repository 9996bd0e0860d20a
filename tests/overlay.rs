//! `--cl-dir`: a folder of kernel files that differ from the built-in ones, or add values to an axis, as docs/kernels.md tells.

use crate::binary::{Place, TRIANGLE, device, has, repository};
use serde_json::Value;

/// The example of docs/kernels.md: one file, `cast/intersect/baldwin_weber.cl`.
fn example() -> String {
    repository("docs/kernels").to_str().expect("UTF-8").to_owned()
}

const ADDED: &str = "intersector=baldwin-weber";
const FILE: &str = "cast/intersect/baldwin_weber.cl";

/// A folder with the example's file, changed, under another name or not.
fn changed(place: &Place, file: &str, from: &str, to: &str) -> String {
    let text = std::fs::read_to_string(repository("docs/kernels").join(FILE)).expect("the example");
    assert!(from.is_empty() || text.contains(from), "the example no longer says {from}");
    let path = place.path("kernels").join(file);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    std::fs::write(&path, if from.is_empty() { text } else { text.replacen(from, to, 1) }).expect("a file");
    "kernels".to_owned()
}

const CONFIG: &str = r#"
question = "?"
expectation = "!"
scenes = ["scene.toml"]
image_sizes = [[40, 30]]
local_sizes = [4]

[[strategy]]
preset = "deferred"
intersector = ["moller-trumbore", "baldwin-weber"]

[[strategy]]
preset = "bvh"
intersector = "baldwin-weber"

[timing]
warmup = 0
min_samples = 5
max_samples = 5
"#;

#[test]
fn a_file_is_a_value_at_once() {
    let (place, cl) = (Place::new(), example());
    has(&place.output(&["strategies", "--cl-dir", &cl]), &["  baldwin-weber", "a matrix a triangle"]);
    assert!(!place.output(&["strategies"]).contains("baldwin-weber"));
    let scene = repository("scenes/gourd.toml");
    let device = device();
    let render = |strategy: &str| {
        let text = ["render", scene.to_str().expect("UTF-8"), "--device", &device, "--cl-dir", &cl];
        let size = ["--width", "75", "--height", "47", "--local-size", "4x4", "--verify", "--force"];
        place.output(&[&text[..], &size, &["--strategy", strategy, "-o", "a.png"]].concat())
    };
    for strategy in
        ["deferred", "naive,epsilons=relative", "deferred,width=4,triangles=tiled", "bvh", "bvh-packet"]
    {
        render(&format!("{strategy},intersector=baldwin-weber"));
    }
    let kernel = place.output(&["kernel", "deferred,intersector=baldwin-weber", "--cl-dir", &cl]);
    has(&kernel, &[FILE, "const float nx"]);
}

#[test]
fn an_experiment_takes_it_and_its_text_is_in_the_key() {
    let place = Place::with(&[("scene.toml", TRIANGLE), ("test.toml", CONFIG)]);
    let device = device();
    let run = |cl: &str| {
        let run =
            ["run", "test.toml", "--device", &device, "--out", "out", "--quiet", "--resume", "--cl-dir", cl];
        place.output(&run);
        place.json_lines("out/records.jsonl")
    };
    let first = run(&changed(&place, FILE, "", ""));
    let names: Vec<_> = first.iter().filter_map(|record| record["name"].as_str()).collect();
    assert_eq!(names.iter().filter(|name| name.ends_with(ADDED)).count(), 2, "{names:?}");
    assert!(
        first.iter().all(|record| record["outcome"] == "measured" && record["unexplained_pixels"] == 0),
        "{first:?}"
    );
    has(&place.text("out/report.html"), &["baldwin-weber"]);
    let second = run(&changed(&place, FILE, "typedef struct", "// changed\ntypedef struct"));
    // Older records are kept; only what has the changed text is measured again.
    let is_new = |record: &&Value| first.iter().all(|other| other["key"] != record["key"]);
    let new: Vec<_> = second.iter().filter(is_new).collect();
    assert_eq!((new.len(), second.len()), (2, first.len() + 2), "{new:?}");
    assert!(new.iter().all(|record| record["name"].as_str().is_some_and(|name| name.ends_with(ADDED))));
}

#[test]
fn a_wrong_name_is_answered_with_the_nearest_and_a_contradiction_with_its_reason() {
    let (place, cl) = (Place::with(&[("scene.toml", TRIANGLE)]), example());
    let mistake =
        |strategy: &str| place.mistake(&["render", "scene.toml", "--cl-dir", &cl, "--strategy", strategy], 2);
    has(&mistake("deferred,intersector=baldwin-webber"), &["did you mean 'baldwin-weber'?"]);
    let said = mistake("deferred,intersector=baldwin-weber,culling=back");
    has(&said, &["intersector = baldwin-weber contradicts culling = back, as its file says", "help: "]);
    has(&mistake("tile,intersector=baldwin-weber"), &["intersector"]);
}

#[test]
fn a_mistake_in_a_folder_has_its_place_and_remedy() {
    let mistake = |place: &Place, folder: &str| place.mistake(&["strategies", "--cl-dir", folder], 2);
    let place = Place::new();
    let folder = changed(&place, FILE, "// like: moller-trumbore", "// like: mollertrumbore");
    let said = mistake(&place, &folder);
    has(
        &said,
        &[
            FILE,
            "line 3",
            "'mollertrumbore' is not a built-in value of intersector",
            "did you mean 'moller-trumbore'?",
        ],
    );

    let place = Place::new();
    let folder = changed(&place, "cast/intersct/baldwin_weber.cl", "", "");
    has(&mistake(&place, &folder), &["nothing includes it", "cast/intersect/"]);
    let place = Place::new();
    let folder = changed(&place, "cast/exhaustve.cl", "", "");
    has(&mistake(&place, &folder), &["nothing includes it", "did you mean cast/exhaustive.cl?"]);

    has(&mistake(&Place::new(), "nowhere"), &["cannot read nowhere", "--cl-dir wants a folder"]);
    let place = Place::with(&[("empty/readme.txt", "")].map(|_| ("note.txt", "no kernel")));
    has(&mistake(&place, "."), &["holds no kernel file"]);
}

/// One file that differs takes the place of the built-in one; the rest is built in.
#[test]
fn a_folder_holds_what_differs() {
    let place = Place::with(&[("scene.toml", TRIANGLE)]);
    let store = std::fs::read_to_string(repository("cl/common/store_radiance.cl")).expect("a kernel file");
    std::fs::create_dir_all(place.path("kernels/common")).expect("a folder");
    std::fs::write(place.path("kernels/common/store_radiance.cl"), format!("#error \"mine\"\n{store}"))
        .expect("a file");
    let message = place.mistake(&["kernel", "naive", "--cl-dir", "kernels"], 2);
    has(&message, &["common/store_radiance.cl, line 1: #error \"mine\""]);
}
