//! Reports: pages that need no other file, exports, and comparisons with their exit codes.
//! `make test-browser` tests how a browser shows the pages.

use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

fn raycl(arguments: &[&str]) -> Output {
    crate::binary::run(crate::binary::program().args(arguments))
}

/// Runs raycl, which must end with this exit code, and returns its standard output and its standard error.
fn outcome(arguments: &[&str], code: i32) -> (String, String) {
    let output = raycl(arguments);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (said, complained) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}{complained}");
    (said, complained)
}

const EVIL: &str = "<script>alert(1)</script>";

/// Returns a record of a measured point, whose samples are within 1% of `ms`.
fn record(scene: &str, name: &str, side: u32, ms: f64) -> Value {
    let samples: Vec<f64> = (0..10).map(|n| ms * (0.99 + 0.002 * f64::from(n))).collect();
    json!({
        "key": format!("{scene} {name} {side}"), "scene": scene, "device": "a gpu", "name": name, "preset": name,
        "strategy": "traversal=exhaustive vectors=private", "local_size": [side, side], "image_size": [800, 500],
        "triangles": 1026, "outcome": "measured", "median_ms": ms, "q1_ms": ms * 0.995, "q3_ms": ms * 1.005,
        "samples_ms": samples,
    })
}

fn infeasible(scene: &str, name: &str, side: u32) -> Value {
    let mut record = record(scene, name, side, 1.0);
    record["outcome"] = "infeasible".into();
    record["reason"] = format!("__local memory: 110592 B > 49152 B {EVIL}").into();
    for absent in ["median_ms", "q1_ms", "q3_ms"] {
        record[absent] = Value::Null;
    }
    record["samples_ms"] = json!([]);
    record
}

fn write(folder: &Path, records: &[Value]) {
    let lines: String = records.iter().map(|record| format!("{record}\n")).collect();
    std::fs::write(folder.join("records.jsonl"), lines).expect("it writes");
    let environment =
        json!({"command_line": ["raycl", "run", EVIL], "config": format!("question = \"{EVIL}?\"")});
    std::fs::write(folder.join("environment.json"), environment.to_string()).expect("it writes");
}

fn folder(records: &[Value]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), records);
    folder
}

fn path(folder: &tempfile::TempDir) -> &str {
    folder.path().to_str().expect("UTF-8")
}

#[test]
fn a_page_stands_alone_and_names_stay_text() {
    let results =
        folder(&[record(EVIL, "naive", 8, 2.0), record(EVIL, "wide", 4, 1.0), infeasible(EVIL, "wide", 32)]);
    outcome(&["report", path(&results)], 0);
    let page = std::fs::read_to_string(results.path().join("report.html")).expect("a page");
    assert!(!page.contains(EVIL), "a name became markup");
    assert!(page.contains("alert(1)") && page.contains("110592 B"));
    for outside in ["src=\"http", "href=\"http", "@import", "url(http", "<link"] {
        assert!(!page.contains(outside), "the page refers to {outside}");
    }
    assert!(page.contains("2.00×"), "the speed-up over naive is missing");
    for file in ["exports/t4-results.json", "exports/points.csv"] {
        assert!(results.path().join(file).exists(), "{file}");
    }
    let plots: Vec<_> = std::fs::read_dir(results.path().join("plots")).expect("plots").flatten().collect();
    let ending = |ending: &str| {
        plots.iter().filter(|plot| plot.path().extension().is_some_and(|e| e == ending)).count()
    };
    assert!(ending("svg") >= 4 && ending("svg") == ending("png"));
    for plot in &plots {
        let bytes = std::fs::read(plot.path()).expect("a plot");
        assert!(bytes.starts_with(b"<svg ") || bytes.starts_with(b"\x89PNG"), "{plot:?}");
    }
}

#[test]
fn two_thousand_points_make_a_page_of_a_few_megabytes() {
    let points = |scene: &str| -> Vec<Value> {
        let strategy = |n: u32| (1..=20).map(move |side| (n, side));
        (0..20)
            .flat_map(strategy)
            .map(|(n, side)| record(scene, &format!("s{n}"), side, f64::from(n + side)))
            .collect()
    };
    let records: Vec<Value> = ["a", "b", "c", "d", "e"].iter().flat_map(|scene| points(scene)).collect();
    assert_eq!(records.len(), 2000);
    let results = folder(&records);
    let out = tempfile::tempdir().expect("a folder");
    let (said, _) = outcome(&["report", path(&results), "--out", path(&out), "--json"], 0);
    let said: Value = serde_json::from_str(&said).expect("JSON");
    let page = std::fs::metadata(said["report"].as_str().expect("a path")).expect("a page");
    assert!(page.len() < 15_000_000, "{} bytes", page.len());
    assert!(!results.path().join("report.html").exists(), "it was to be written elsewhere");
}

#[test]
fn a_slower_kernel_fails_the_ci_and_a_faster_one_does_not() {
    // The times of the points `bvh`, `tile` and `raster` do not change. The run has no baseline, so the
    // changes of the points `naive` and `wide` are compared with the changes of `bvh`, `tile` and `raster`.
    let others = ["bvh", "tile", "raster"].map(|name| record("teapot", name, 8, 2.0));
    let of = |naive: f64, wide: f64| {
        let two = [record("teapot", "naive", 8, naive), record("teapot", "wide", 4, wide)];
        folder(&[&two[..], &others].concat())
    };
    let (before, after) = (of(10.0, 1.0), of(12.0, 0.5));
    let (said, _) = outcome(&["compare", path(&before), path(&after)], 0);
    assert!(said.contains("1 faster, 1 slower, 3 same, 0 unclear"), "{said}");
    let (_, complaint) = outcome(&["compare", path(&before), path(&after), "--fail-on-regression", "5"], 1);
    assert!(complaint.contains("naive 8x8 is 20.0% slower"), "{complaint}");
    outcome(&["compare", path(&before), path(&after), "--fail-on-regression", "25%", "--quiet"], 0);
    outcome(&["compare", path(&before), path(&before), "--fail-on-regression", "0", "--quiet"], 0);
    // `raycl compare` does not test measured points that the second folder of results lacks. With a limit
    // (`--fail-on-regression`), a note names the points that are not tested; without a limit, there is no
    // note.
    let two = folder(&[record("teapot", "naive", 8, 10.0), record("teapot", "wide", 4, 1.0)]);
    let compare = ["compare", path(&before), path(&two), "--json"];
    for (limit, is_noted) in [(&["--fail-on-regression", "5"][..], true), (&[], false)] {
        let (said, _) = outcome(&[&compare[..], limit].concat(), 0);
        let said: Value = serde_json::from_str(&said).expect("JSON");
        let notes = said["notes"].to_string();
        assert_eq!(
            notes.contains("`--fail-on-regression` does not test these points: "),
            is_noted,
            "{notes}"
        );
    }
    let (markdown, _) = outcome(&["compare", path(&before), path(&after), "--markdown"], 0);
    assert!(markdown.contains("| -50.0% (-50.6 to -49.4) | faster |"), "{markdown}");
    let out = tempfile::tempdir().expect("a folder");
    outcome(&["compare", path(&before), path(&after), "--out", path(&out), "--quiet"], 0);
    assert!(out.path().join("compare.html").exists() && out.path().join("plots/compare.png").exists());
}

/// Every point of the experiment may fail in the second run, for example after an update of a driver.
#[test]
fn points_that_all_fail_now_fail_the_ci() {
    let works = folder(&[record("teapot", "wide", 32, 1.0)]);
    let fails = folder(&[infeasible("teapot", "wide", 32)]);
    let out = tempfile::tempdir().expect("a folder");
    let limit = ["--fail-on-regression", "5"];
    let compare = |before, after| [&["compare", path(before), path(after)][..], &limit].concat();
    let (said, complaint) = outcome(&[&compare(&works, &fails)[..], &["--out", path(&out)]].concat(), 1);
    let line = "teapot 800 x 500, wide 32x32: was measured, is infeasible";
    assert!(said.contains(line) && complaint.contains(line), "{said}{complaint}");
    assert!(complaint.contains("gives the reason for each point that fails"), "{complaint}");
    assert!(out.path().join("compare.html").exists());
    let (said, _) = outcome(&compare(&fails, &works), 0);
    assert!(said.contains("was infeasible, is measured"), "{said}");
    outcome(&compare(&fails, &fails), 2);
}

#[test]
fn a_comparison_in_json_has_both_folders_and_its_threshold_and_plain_times_are_a_choice() {
    let others = ["bvh", "tile", "raster"].map(|name| record("teapot", name, 8, 2.0));
    let of = |own: Value, more: Value| folder(&[&[own, more][..], &others].concat());
    let before = of(record("teapot", "naive", 8, 10.0), record("teapot", "wide", 4, 1.0));
    let after = of(record("teapot", "naive", 8, 12.0), record("teapot", "wide", 16, 1.0));
    let json = |more: &[&str]| -> Value {
        let (said, _) = outcome(&[&["compare", path(&before), path(&after), "--json"], more].concat(), 0);
        serde_json::from_str(&said).expect("JSON")
    };
    let name = |folder: &tempfile::TempDir| {
        folder.path().file_name().and_then(|name| name.to_str()).map(str::to_owned)
    };
    let said = json(&[]);
    assert_eq!(
        [said["before"].as_str(), said["after"].as_str()],
        [name(&before).as_deref(), name(&after).as_deref()]
    );
    assert_eq!(said["summary"], "0 faster, 1 slower, 3 same, 0 unclear");
    assert_eq!(said["points"].as_array().map(Vec::len), Some(4));
    let others = said["not_compared"].to_string();
    for (size, folder) in [("wide 4x4", &before), ("wide 16x16", &after)] {
        let line = format!("teapot 800 x 500, {size}: only in {}", name(folder).expect("a name"));
        assert!(others.contains(&line), "{line}: {others}");
    }
    assert!(said["notes"].to_string().contains("No baseline was measured"), "{said}");
    assert_eq!(json(&["--threshold", "30"])["summary"], "0 faster, 0 slower, 4 same, 0 unclear");
    assert!(json(&["--times"])["notes"].to_string().contains("Plain times are compared"));
}

#[test]
fn a_report_of_one_folder_renews_its_summary_with_the_configs_question() {
    let results = folder(&[record("teapot", "naive", 8, 10.0)]);
    let environment = json!({"config": "question = \"Which?\"\nexpectation = \"None.\""}).to_string();
    std::fs::write(results.path().join("environment.json"), environment).expect("it writes");
    let out = tempfile::tempdir().expect("a folder");
    outcome(&["report", path(&results), "--quiet", "--out", path(&out)], 0);
    assert!(!results.path().join("summary.md").exists(), "only the page was asked for");
    let (said, _) = outcome(&["report", path(&results), "--json"], 0);
    let said: Value = serde_json::from_str(&said).expect("JSON");
    let at = |name: &str| Some(results.path().join(name).display().to_string());
    for (key, name) in [("report", "report.html"), ("plots", "plots"), ("exports", "exports")] {
        assert_eq!(said[key].as_str().map(str::to_owned), at(name), "{key}");
    }
    let plots = std::fs::read_dir(results.path().join("plots")).expect("plots").count();
    assert_eq!(said["plot_count"].as_u64(), Some(plots as u64 / 2), "each as SVG and PNG");
    let summary = std::fs::read_to_string(results.path().join("summary.md")).expect("a summary");
    assert!(summary.starts_with("# Which?\n\nExpected: None.\n"), "{summary}");
}

#[test]
fn strategies_that_differ_in_one_axis_are_compared_in_the_page_and_in_the_summary() {
    let of = |name: &str, vectors: &str, ms: f64| {
        let mut record = record("teapot", name, 8, ms);
        record["strategy"] = format!("traversal=exhaustive vectors={vectors}").into();
        record
    };
    // The first strategy of the pair is the one whose record comes first in the folder, whichever of the two is faster.
    let results = folder(&[of("local-vectors", "local", 5.0), of("naive", "heap", 10.0)]);
    outcome(&["report", path(&results)], 0);
    let text = |name: &str| std::fs::read_to_string(results.path().join(name)).expect("it is there");
    let [page, summary] = ["report.html", "summary.md"].map(text);
    let section = |text: &str| text.split_once("One change at a time").map(|(_, rest)| rest.to_owned());
    for (text, parts) in [
        (&page, ["vectors: local → heap <small>(local-vectors → naive)", ">slower</b> <small>8 x 8<"]),
        (&summary, ["| vectors: local → heap (local-vectors → naive) | 0.500 (", "), slower, 8 x 8 |"]),
    ] {
        let section = section(text).expect("the part");
        assert!(parts.iter().all(|part| section.contains(part)), "{parts:?} are not in {section}");
    }
}

#[test]
fn few_samples_have_no_interval_and_no_verdict_in_any_view() {
    let few = |name: &str, side: u32, n: usize| {
        // Earlier versions of raycl wrote records whose 95% interval has a width of 0.
        let mut few = record("teapot", name, side, 1798.0);
        few["samples_ms"] = json!(vec![1798.0; n]);
        few["ci95_ms"] = json!([1798.0, 1798.0]);
        few
    };
    let mut serial = few("serial", 0, 1);
    (serial["device"], serial["strategy"], serial["local_size"]) =
        ("host".into(), "serial-f32".into(), Value::Null);
    let results = folder(&[serial, few("naive", 8, 4), record("teapot", "wide", 4, 2000.0)]);
    let out = tempfile::tempdir().expect("a folder");
    outcome(&["report", path(&results), "--out", path(&out)], 0);
    let text = |name: &str| std::fs::read_to_string(out.path().join(name)).expect("it is there");
    let page = text("report.html");
    for expected in
        ["not enough samples (n = 1)", "not enough samples (n = 4)", "Points without a rank: naive at 8 x 8"]
    {
        assert!(page.contains(expected), "{expected:?} is not in the page");
    }
    assert!(page.contains("wide is the fastest, which is not certain."), "four samples do not count");
    assert!(!page.contains("1798 to 1798"), "an interval of few samples");
    let points = text("exports/points.csv");
    let row = points.lines().find(|row| row.contains(",naive,")).expect("a row");
    assert!(row.contains(",1798.0,,,,,4,"), "{row}");
    let faster = folder(&[few("naive", 8, 10), record("teapot", "wide", 4, 2000.0)]);
    let (said, _) = outcome(&["compare", path(&results), path(&faster), "--fail-on-regression", "0"], 0);
    assert!(said.contains("0 unclear, 1 not comparable, 1 not enough samples"), "{said}");
}

#[test]
fn pictures_are_compared_and_distinguished() {
    let folder = tempfile::tempdir().expect("a folder");
    let path_of = |name: &str| folder.path().join(name).display().to_string();
    let mut picture = image::RgbImage::from_pixel(40, 30, image::Rgb([100; 3]));
    picture.save(path_of("a.png")).expect("it saves");
    picture.put_pixel(12, 7, image::Rgb([100, 200, 100]));
    picture.save(path_of("b.png")).expect("it saves");
    let (said, _) =
        outcome(&["compare-images", &path_of("a.png"), &path_of("a.png"), "--fail-below", "99"], 0);
    assert!(said.contains("equal in all 1200 pixels"), "{said}");
    let command =
        ["compare-images", &path_of("a.png"), &path_of("b.png"), "--output", &path_of("d.png"), "--json"];
    let (said, _) = outcome(&command, 0);
    let said: Value = serde_json::from_str(&said).expect("JSON");
    assert_eq!(said["largest_error_at"], json!([12, 7]));
    assert!((said["psnr_db"].as_f64().expect("a number") - 43.69).abs() < 0.01, "{said}");
    assert!(Path::new(&path_of("d.png")).exists());
    outcome(&["compare-images", &path_of("a.png"), &path_of("b.png"), "--fail-below", "50"], 1);
    let mut broken = image::Rgb32FImage::from_pixel(2, 1, image::Rgb([0.5; 3]));
    broken.save(path_of("whole.exr")).expect("it saves");
    broken.put_pixel(1, 0, image::Rgb([0.5, f32::NAN, 0.5]));
    broken.save(path_of("broken.exr")).expect("it saves");
    outcome(&["compare-images", &path_of("whole.exr"), &path_of("whole.exr"), "--fail-below", "1"], 0);
    let (_, complaint) =
        outcome(&["compare-images", &path_of("broken.exr"), &path_of("whole.exr"), "--fail-below", "1"], 1);
    assert!(complaint.contains("is NaN dB"), "{complaint}");
    let (_, complaint) = outcome(&["compare-images", &path_of("a.png"), &path_of("none.png")], 2);
    assert!(complaint.contains("none.png"), "{complaint}");
}

#[test]
fn displayed_values_and_radiance_are_compared_with_a_note() {
    let folder = tempfile::tempdir().expect("a folder");
    let path_of = |name: &str| folder.path().join(name).display().to_string();
    let picture = image::DynamicImage::from(image::Rgb32FImage::from_pixel(2, 1, image::Rgb([0.5; 3])));
    let shown = image::DynamicImage::from(picture.to_rgb8());
    for (name, picture) in [("a.exr", &picture), ("b.exr", &picture), ("a.png", &shown), ("b.png", &shown)] {
        picture.save(path_of(name)).expect("it saves");
    }
    let notes = |names: [&str; 2]| {
        let [actual, expected] = names.map(path_of);
        let (said, _) = outcome(&["compare-images", &actual, &expected, "--json"], 0);
        let said: Value = serde_json::from_str(&said).expect("JSON");
        said["notes"].as_array().expect("a list").clone()
    };
    assert!(notes(["a.exr", "b.exr"]).is_empty() && notes(["a.png", "b.png"]).is_empty());
    let mixed = notes(["a.png", "a.exr"]);
    assert_eq!(mixed.len(), 1, "{mixed:?}");
    let note = mixed[0].as_str().expect("a text");
    for part in ["a.png has displayed values", "a.exr has linear radiance"] {
        assert!(note.contains(part), "{note}");
    }
    assert_eq!(notes(["a.exr", "a.png"]).len(), 1);
    let (said, _) = outcome(&["compare-images", &path_of("a.png"), &path_of("a.exr")], 0);
    assert!(said.contains("a.exr has linear radiance"), "{said}");
}

#[test]
fn a_compared_picture_is_never_replaced_by_the_differences() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("inner")).expect("a folder");
    let path_of = |name: &str| folder.path().join(name).display().to_string();
    for (name, grey) in [("a.png", 100), ("b.png", 101)] {
        image::RgbImage::from_pixel(4, 3, image::Rgb([grey; 3])).save(path_of(name)).expect("it saves");
    }
    let read = || ["a.png", "b.png"].map(|name| std::fs::read(path_of(name)).expect("a file"));
    let before = read();
    for output in ["a.png", "b.png", "inner/../a.png"] {
        for force in [&[][..], &["--force"]] {
            let command =
                ["compare-images", &path_of("a.png"), &path_of("b.png"), "--output", &path_of(output)];
            let (_, complaint) = outcome(&[&command[..], force].concat(), 2);
            assert!(
                complaint.contains("is one of the compared pictures, and is not replaced"),
                "{complaint}"
            );
        }
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(path_of("b.png"), path_of("link.png")).expect("a link");
        let command =
            ["compare-images", &path_of("a.png"), &path_of("link.png"), "--output", &path_of("b.png")];
        let (_, complaint) = outcome(&[&command[..], &["--force"]].concat(), 2);
        assert!(complaint.contains("is one of the compared pictures, and is not replaced"), "{complaint}");
    }
    assert!(read() == before, "a picture was changed");
}

#[test]
fn one_of_two_compared_pictures_may_come_from_standard_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    image::RgbImage::from_pixel(4, 3, image::Rgb([100; 3])).save(&path).expect("it saves");
    let compared = |pictures: [&str; 2]| {
        let input = std::fs::File::open(&path).expect("a picture");
        let mut command = crate::binary::program();
        let output = command.arg("compare-images").args(pictures).stdin(input).output().expect("it runs");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let name = path.to_str().expect("UTF-8");
    for pictures in [["-", name], [name, "-"]] {
        let (code, said, complaint) = compared(pictures);
        assert_eq!((code, said.trim()), (Some(0), "equal in all 12 pixels"), "{complaint}");
    }
    let (code, _, complaint) = compared(["-", "-"]);
    assert_eq!(code, Some(2), "{complaint}");
    assert!(complaint.contains("standard input can only be read once"), "{complaint}");
}

/// Checks that a command overwrites neither a file that raycl did not make nor one that was changed after
/// raycl made it, except with `--force`.
fn keeps_what_was_changed(command: &[&str], out: &Path, name: &str) {
    let forced = [command, &["--force"]].concat();
    std::fs::write(out.join(name), "somebody's").expect("a file");
    let (_, complaint) = outcome(command, 2);
    assert!(complaint.contains(name) && complaint.contains("raycl did not make it"), "{complaint}");
    assert_eq!(std::fs::read_dir(out).expect("a folder").count(), 1, "nothing else was written");
    outcome(&forced, 0);
    outcome(command, 0);
    let edited = std::fs::read(out.join(name)).expect("a file");
    let edited = [&edited[..], b"\n"].concat();
    std::fs::write(out.join(name), &edited).expect("it writes");
    let (_, complaint) = outcome(command, 2);
    assert!(complaint.contains("has been changed since raycl made it"), "{complaint}");
    assert!(complaint.contains("`--force` replaces it"), "{complaint}");
    assert_eq!(std::fs::read(out.join(name)).expect("a file"), edited);
    outcome(&forced, 0);
    assert!(std::fs::read(out.join(name)).expect("a file") != edited);
}

#[test]
fn pages_and_pictures_that_somebody_made_or_changed_stay() {
    let results = folder(&[record("teapot", "naive", 8, 10.0), record("teapot", "wide", 4, 1.0)]);
    let out = || tempfile::tempdir().expect("a folder");
    let (one, two, three) = (out(), out(), out());
    let report = ["report", path(&results), "--out", path(&one), "--quiet"];
    keeps_what_was_changed(&report, one.path(), "report.html");
    let compare = ["compare", path(&results), path(&results), "--out", path(&two), "--quiet"];
    keeps_what_was_changed(&compare, two.path(), "compare.md");
    std::fs::write(two.path().join("plots/compare.svg"), "somebody's").expect("it writes");
    let (_, complaint) = outcome(&compare, 2);
    assert!(complaint.contains("plots/compare.svg' has been changed"), "{complaint}");

    let pictures = out();
    let [a, b] = ["a.png", "b.png"].map(|name| pictures.path().join(name).display().to_string());
    let plain = image::RgbImage::from_pixel(4, 3, image::Rgb([100; 3]));
    for name in [&a, &b] {
        plain.save(name).expect("it saves");
    }
    let differences = three.path().join("d.png").display().to_string();
    let images = ["compare-images", &a, &b, "--quiet", "--output", &differences];
    keeps_what_was_changed(&images, three.path(), "d.png");
    let (_, complaint) = outcome(&["compare-images", &a, &b, "--output", "d.exr"], 2);
    assert!(complaint.contains("a picture of differences must be a .png"), "{complaint}");
    // raycl may replace the files in its own folder of results.
    outcome(&["report", path(&results), "--quiet"], 0);
    outcome(&["report", path(&results), "--quiet"], 0);
}

#[test]
fn mistakes_name_the_folder_and_the_remedy() {
    let empty = tempfile::tempdir().expect("a folder");
    let (_, complaint) = outcome(&["report", path(&empty)], 2);
    assert!(complaint.contains("records.jsonl") && complaint.contains("raycl run"), "{complaint}");
    let (one, other) = (folder(&[record("a", "naive", 8, 1.0)]), folder(&[record("b", "naive", 8, 1.0)]));
    let (_, complaint) = outcome(&["compare", path(&one), path(&other)], 2);
    assert!(complaint.contains("no measured point in common"), "{complaint}");
    let (_, complaint) = outcome(&["reproduce", "--page-only", "--out", path(&empty)], 2);
    assert!(complaint.contains("--page-only"), "{complaint}");
}

#[test]
fn the_reproduction_page_is_made_of_records_alone() {
    let out = tempfile::tempdir().expect("a folder");
    let figure = out.path().join("figure-8");
    std::fs::create_dir(&figure).expect("a folder");
    let points = [("naive", 17.4), ("local-vectors", 11.3), ("local-triangles", 25.7)];
    let records: Vec<_> = points.iter().map(|(name, ms)| record("still-life", name, 8, *ms)).collect();
    write(&figure, &records);
    let (said, _) = outcome(&["reproduce", "--page-only", "--out", path(&out)], 0);
    let answer = "\n  Best memory strategy: on still-life, local-vectors (vectors local, triangles global): 11.30 ms.\n";
    assert!(said.contains(answer) && said.contains("\n  How sure: "), "{said}");
    let page = std::fs::read_to_string(out.path().join("reproduction.html")).expect("a page");
    let command = format!("raycl reproduce --out {} --resume", path(&out));
    for part in [
        "✓ held",
        "naive at 8 x 8 on still-life (17.40 ms) takes 1.54 times (1.52 to 1.56, n = 10) as long as local-vectors at 8 x 8",
        "1133 ms with optimisation 1 against 1738 ms naive",
        "no record of naive at 4 x 4 on teapot",
        &format!("the missing record: `{command}`"),
        &format!("The command <code>{command}</code> measures this data."),
        "on still-life, local-vectors (vectors local, triangles global): 11.30 ms.",
    ] {
        assert!(page.contains(part), "{part:?} is not in the page");
    }
    let heading = |number: u32| page.find(&format!("<h3>Figure {number}: ")).unwrap_or(0);
    let figures = [1, 3, 4, 5, 6, 7, 8, 9].map(heading);
    assert!(figures[0] > 0 && figures.is_sorted(), "every figure of the paper, in its order: {figures:?}");
    let [answer, claims] =
        ["Best memory strategy", "<blockquote>"].map(|part| page.find(part).expect("a part"));
    assert!(answer < figures[0] && figures[7] < claims, "first the answer, then plots, then claims");
    assert!(out.path().join("plots/figure-8-shapes.svg").exists());
}

#[test]
fn a_reproduction_removes_plots_of_its_earlier_page_and_no_others() {
    let out = tempfile::tempdir().expect("a folder");
    let figure = out.path().join("figure-8");
    std::fs::create_dir(&figure).expect("a folder");
    let points =
        |scene: &str| [("naive", 17.4), ("local-vectors", 11.3)].map(|(name, ms)| record(scene, name, 8, ms));
    let page = || outcome(&["reproduce", "--page-only", "--quiet", "--out", path(&out)], 0);
    write(&figure, &[points("still-life"), points("teapot")].concat());
    page();
    let plots = out.path().join("plots");
    let is_there = |name: &str| plots.join(name).exists();
    assert!(is_there("answer-still-life.svg") && is_there("answer-teapot.svg"));
    std::fs::write(plots.join("answer-mine.svg"), "somebody's").expect("it writes");
    std::fs::write(plots.join("answer-teapot.png"), "changed").expect("it writes");
    write(&figure, &points("still-life"));
    page();
    assert!(is_there("answer-still-life.svg") && is_there("answer-still-life.png"));
    assert!(!is_there("answer-teapot.svg"), "the page no longer shows the teapot");
    assert!(is_there("answer-mine.svg") && is_there("answer-teapot.png"), "somebody's files stay");
}

#[test]
fn shells_can_complete() {
    for shell in ["bash", "zsh", "fish"] {
        let (script, _) = outcome(&["completions", shell], 0);
        assert!(script.contains("compare-images") && script.contains("fail-on-regression"), "{shell}");
    }
}
