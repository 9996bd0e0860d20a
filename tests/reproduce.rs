//! `raycl reproduce`: one command that runs all configs of the student paper that raycl reproduces, and
//! continues where it stopped.

use crate::binary::{WorkFolder, device, has};

/// Overrides of config keys. With them, each config measures only one point (one combination of strategy,
/// scene and sizes).
const SMALL: [&str; 8] = [
    "image_sizes=[[16, 10]]",
    concat!("scenes=['", env!("CARGO_MANIFEST_DIR"), "/scenes/triangle.toml']"),
    "local_sizes=[4]",
    "strategies=['naive']",
    "strategy=[]",
    "baselines=[]",
    "timing.time_limit_ms=1",
    "timing.launches=1",
];

/// Runs the command, and returns its standard output and its standard error.
fn reproduce(folder: &WorkFolder, more: &[&str]) -> (String, String) {
    let device = device();
    let set = SMALL.iter().flat_map(|value| ["--set", value]);
    let command = ["reproduce", "--out", "out", "--device", &device];
    let arguments: Vec<&str> = command.into_iter().chain(set).chain(more.iter().copied()).collect();
    let output = folder.raycl(&arguments).assert().success().get_output().clone();
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (text(output.stdout), text(output.stderr))
}

#[test]
fn a_reproduction_goes_on_where_it_stopped() {
    let folder = WorkFolder::new();
    let (said, progress) = reproduce(&folder, &[]);
    assert!(said.trim_end().ends_with("out/reproduction.html"), "the page comes last: {said}");
    has(&progress, &["pictures (1 of 5)", "next-steps (5 of 5)", "[1/5, about ", "[5/5] "]);
    let first = folder.text("out/figure-6/records.jsonl");
    let message = folder.mistake(&["reproduce", "--out", "out", "--device", &device()], 2);
    has(&message, &["out/pictures already holds results", "--resume"]);

    // Without the fourth config's folder, only the fourth config has points that are not measured.
    std::fs::remove_dir_all(folder.path("out/figure-8")).expect("it is there");
    let (_, progress) = reproduce(&folder, &["--resume"]);
    has(&progress, &["1 of 5 points are done already", "3 of 5 points are done already", "[4/5, about "]);
    // The point of the experiment that this command has just measured is not counted as done already.
    has(&progress, &["4 of 5 points are done already"]);
    assert_eq!(progress.lines().filter(|line| line.starts_with('[')).count(), 1, "{progress}");
    assert_eq!(folder.text("out/figure-6/records.jsonl"), first);
    assert!(folder.path("out/figure-8/report.html").exists());
}
