//! Kernels in Oclgrind, which simulates every work-item: no data race, no access out of bounds, no use of what was
//! never written. `make test` installs it; without it these tests fail.

use crate::common::cover::pairwise_cover;
use crate::common::is_long;
use raycl::strategy::{PRESETS, Strategy, Traversal, Width};
use std::path::Path;
use std::process::Command;

/// Oclgrind 21.10 does not know an intrinsic of optimised code.
const OPTIONS: &str = "-cl-opt-disable";
/// What Oclgrind looks for besides accesses out of bounds.
const RACES: &str = "--data-races";
const UNINITIALISED: &str = "--uninitialized";

fn spelled(strategy: &Strategy) -> String {
    strategy.axes().iter().map(|(axis, value)| format!("{axis}={value}")).collect::<Vec<_>>().join(",")
}

/// Renders a scene under Oclgrind and compares it with the reference. Gives all that was reported; none where the
/// simulated device (32 KiB of `__local`) cannot hold the strategy, or where its program does not build.
fn reports(scene: &str, strategy: &Strategy, local: &str, plugin: &str, cl: Option<&Path>) -> Option<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let mut command = Command::new("oclgrind");
    command.args(["--build-options", OPTIONS, plugin, "--log"]).arg(&log);
    command.arg(env!("CARGO_BIN_EXE_raycl")).arg("render");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene));
    // Oclgrind has only barriers to share a tile by.
    let local = if strategy.shares_tiles() { "32x1" } else { local };
    command.args(["--device", "oclgrind", "--width", "18", "--height", "11", "--quiet", "--verify"]);
    command.args(["--strategy", &spelled(strategy), "--local-size", local, "--output"]);
    command.arg(folder.path().join("picture.png"));
    if let Some(cl) = cl {
        command.arg("--cl-dir").arg(cl);
    }
    let output = crate::binary::run(&mut command);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let does_not_fit = output.status.code() == Some(2) && said.contains("cannot hold this");
    // What no compiler takes is for tests/kernels.rs to tell.
    if does_not_fit || said.contains("the build failed") {
        return None;
    }
    // Its exit code is the program's: only the log tells.
    let logged = std::fs::read_to_string(&log).unwrap_or_default();
    let failed = if output.status.success() { String::new() } else { format!("{}: {said}", output.status) };
    Some(logged + &failed)
}

/// Runs strategies and panics with every one that something was reported of. Returns how many were run.
fn all_clean(scene: &str, strategies: &[Strategy], local: &str, plugin: &str) -> usize {
    let mut wrong = Vec::new();
    let mut run = 0;
    for strategy in strategies {
        let Some(report) = reports(scene, strategy, local, plugin, None) else { continue };
        run += 1;
        if !report.is_empty() {
            let start: String = report.chars().take(600).collect();
            wrong.push(format!("{strategy} at {local}: {start}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {run}:\n{}", wrong.len(), wrong.join("\n"));
    eprintln!("{run} strategies with {plugin}: 0 reports");
    run
}

fn presets() -> Vec<Strategy> {
    PRESETS.iter().map(|preset| preset.strategy).collect()
}

#[test]
fn presets_have_no_race_and_stay_in_bounds() {
    // Six work-items, in groups that do not divide the image.
    let run = all_clean("pyramid-lower.toml", &presets(), "3x2", RACES);
    assert_eq!(run, PRESETS.len());
}

#[test]
fn presets_of_one_ray_read_nothing_unwritten() {
    // Oclgrind crashes on wide vectors here, and takes what clEnqueueFillBuffer wrote, as raster's depths are, for
    // unwritten.
    let checkable = |s: &Strategy| s.width == Width::W1 && s.traversal != Traversal::Raster;
    let narrow: Vec<_> = presets().into_iter().filter(checkable).collect();
    assert_eq!(all_clean("pyramid-lower.toml", &narrow, "4x2", UNINITIALISED), narrow.len());
}

#[test]
fn a_pairwise_cover_has_no_race_and_stays_in_bounds() {
    let cover: Vec<_> =
        pairwise_cover().into_iter().enumerate().filter(in_this_run).map(|(_, s)| s).collect();
    let run = all_clean("figure-4.toml", &cover, "4x2", RACES);
    assert!(run * 10 > cover.len() * 8, "only {run} of {} fit", cover.len());
}

/// All of it, or the half that PoCL does not verify in tests/kernels.rs, with tiles that work-items share.
fn in_this_run((row, strategy): &(usize, Strategy)) -> bool {
    is_long() || row % 2 == 1 || strategy.shares_tiles()
}

/// A copy of `cl/` with one change, which some file must have.
fn spoiled(from: &str, to: &str) -> tempfile::TempDir {
    fn copy(source: &Path, target: &Path, from: &str, to: &str) -> usize {
        std::fs::create_dir_all(target).expect("a folder");
        let mut changed = 0;
        for entry in std::fs::read_dir(source).expect("kernels").flatten() {
            let (path, target) = (entry.path(), target.join(entry.file_name()));
            if path.is_dir() {
                changed += copy(&path, &target, from, to);
                continue;
            }
            let text = std::fs::read_to_string(&path).expect("a kernel");
            changed += text.matches(from).count();
            std::fs::write(target, text.replace(from, to)).expect("a copy");
        }
        changed
    }
    let folder = tempfile::tempdir().expect("a folder");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("cl");
    assert!(copy(&source, folder.path(), from, to) > 0, "no kernel has '{from}'");
    folder
}

#[test]
fn a_kernel_without_its_barriers_is_reported() {
    let cl = spoiled("barrier(CLK_LOCAL_MEM_FENCE)", "(void)0");
    let tiled = raycl::strategy::preset("tiled").expect("a preset").strategy;
    let report = reports("pyramid-lower.toml", &tiled, "4x4", RACES, Some(cl.path())).expect("it fits");
    assert!(report.contains("race"), "{report}");
}
