//! Edits of the config, a scene, the kernels or the environment, each followed by `--resume`: only points of
//! the experiment that changed are measured again. All views of the results (summaries, report, exports and
//! comparisons) show the same points, medians and winners.

use crate::binary::{TRIANGLE, WorkFolder, device, repository};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// A folder of results with the inputs of its experiment, and the settings for the next run.
struct Ground {
    folder: WorkFolder,
    /// The config's top-level lines by their keys; `tables` is the text that follows them.
    config: BTreeMap<&'static str, String>,
    tables: String,
    variables: Vec<(&'static str, String)>,
}

/// The name of a measured point in all views of the results: scene, strategy, local size.
type Name = (String, String, String);

/// The contents of a view (a summary, report, export or comparison): the median of each point in ms, and the
/// winners.
#[derive(Clone, Debug, Default, PartialEq)]
struct Shown {
    medians: BTreeMap<Name, f64>,
    winners: BTreeSet<Name>,
}

/// An edit: its name, its action, the number of points that the run after the edit measures, and the scenes
/// that the views of the results then show.
type Edit = (&'static str, fn(&mut Ground), usize, &'static [&'static str]);

const TIMING: &str = "[timing]\nlaunches = 1\nwarmup = 0\nmin_samples = 10\nmax_samples = 10\n";

const A: &[&str] = &["scene"];
const A_AND_B: &[&str] = &["a/scene", "b/scene"];
const SWEEP: &[&str] = &["scene+power=10 (light.0.power = 10)", "scene+power=10 (light.1.power = 10)"];

/// The edits in their order. Each edit starts from the files that the previous edit left. Before the edits, the
/// experiment has three points: two strategies and a baseline.
const EDITS: [Edit; 24] = [
    ("nothing", |_| {}, 0, A),
    ("the question is worded anew", |ground| ground.set("question", "\"Which?\""), 0, A),
    ("a strategy goes", |ground| ground.set("strategies", "[\"deferred\"]"), 0, A),
    ("it comes back", |ground| ground.set("strategies", "[\"naive\", \"deferred\"]"), 0, A),
    ("a comment in a scene", |ground| ground.edit("a/scene.toml", "[camera]", "# Here.\n[camera]"), 0, A),
    ("a brighter light", |ground| ground.edit("a/scene.toml", "power = 10", "power = 11"), 3, A),
    ("the scene put back", |ground| ground.edit("a/scene.toml", "power = 11", "power = 10"), 0, A),
    (
        "another exposure",
        |ground| ground.edit("a/scene.toml", "[camera]", "[display]\nexposure = 9\n[camera]"),
        3,
        A,
    ),
    ("the scene's file moves", |ground| ground.moves("a/scene.toml", "c/scene.toml"), 0, A),
    ("and back", |ground| ground.moves("c/scene.toml", "a/scene.toml"), 0, A),
    ("a second scene of the name", Ground::second_scene, 3, A_AND_B),
    ("a local size more", |ground| ground.set("local_sizes", "[4, 8]"), 4, A_AND_B),
    ("one of the two scenes", |ground| ground.set("scenes", "[\"a/scene.toml\"]"), 0, A),
    ("another image size", |ground| ground.set("image_sizes", "[[20, 12]]"), 5, A),
    ("both as before", |ground| ground.set("image_sizes", "[[16, 10]]"), 0, A),
    ("the first local size alone", |ground| ground.set("local_sizes", "[4]"), 0, A),
    ("a strategy by another name", Ground::rename_strategy, 0, A),
    (
        "a comment in a kernel file of one strategy",
        |ground| ground.edit_kernel("cast/shading/deferred.cl"),
        1,
        A,
    ),
    ("one thread", |ground| ground.variables.push(("POCL_MAX_PTHREAD_COUNT", "1".to_owned())), 2, A),
    (
        "a setting of the driver's log, which affects no point",
        |ground| ground.variables.push(("POCL_TRACING_FILTER", "x".to_owned())),
        0,
        A,
    ),
    (
        "a compiler's flag in the environment",
        |ground| ground.variables.push(("POCL_EXTRA_BUILD_FLAGS", "-g".to_owned())),
        2,
        A,
    ),
    ("the environment as it was", |ground| ground.variables.clear(), 0, A),
    (
        "one thread for the baselines",
        |ground| ground.variables.push(("RAYON_NUM_THREADS", "1".to_owned())),
        1,
        A,
    ),
    ("two sweeps of one name", Ground::sweeps, 6, SWEEP),
];

#[test]
fn after_every_edit_all_views_agree_and_only_what_changed_is_measured() {
    let mut ground = Ground::new();
    assert_eq!(ground.run(&[]), 3);
    let mut earlier = ground.agreed("the first run", A);
    for (edit, act, measured, scenes) in EDITS {
        act(&mut ground);
        assert_eq!(ground.run(&["--resume"]), measured, "points measured after: {edit}");
        let shown = ground.agreed(edit, scenes);
        if edit == "it comes back" {
            assert_eq!(shown, earlier, "what was measured first is shown again");
        }
        if edit != "a strategy goes" {
            earlier = shown;
        }
    }
}

impl Ground {
    fn new() -> Self {
        let config = [
            ("question", "\"?\""),
            ("expectation", "\"!\""),
            ("scenes", "[\"a/scene.toml\"]"),
            ("image_sizes", "[[16, 10]]"),
            ("local_sizes", "[4]"),
            ("strategies", "[\"naive\", \"deferred\"]"),
            ("baselines", "[\"parallel\"]"),
        ];
        let folder = WorkFolder::new();
        ["a", "b", "c"].iter().for_each(|name| std::fs::create_dir(folder.path(name)).expect("a folder"));
        let ground = Self {
            folder,
            config: config.map(|(key, value)| (key, value.to_owned())).into(),
            tables: TIMING.to_owned(),
            variables: Vec::new(),
        };
        // Without the key `name`, the scene is named after its file.
        ground.write("a/scene.toml", &TRIANGLE.replace("name = \"little\"\n", ""));
        ground.folder.kernels("cast/shading/deferred.cl", "", "");
        ground
    }

    fn write(&self, name: &str, text: &str) {
        self.folder.write(name, text);
    }

    fn set(&mut self, key: &'static str, value: &str) {
        self.config.insert(key, value.to_owned());
    }

    fn edit(&mut self, name: &str, from: &str, to: &str) {
        let text = self.folder.text(name);
        assert!(text.contains(from), "{name} has no {from}");
        self.write(name, &text.replacen(from, to, 1));
    }

    fn moves(&mut self, from: &str, to: &str) {
        std::fs::rename(self.folder.path(from), self.folder.path(to)).expect("a file");
        self.set("scenes", &format!("[\"{to}\"]"));
    }

    fn second_scene(&mut self) {
        let text = self.folder.text("a/scene.toml");
        self.write("b/scene.toml", &text.replace("[0, 1, -2]", "[0, 1.5, -2]"));
        self.set("scenes", "[\"a/scene.toml\", \"b/scene.toml\"]");
    }

    fn rename_strategy(&mut self) {
        self.set("strategies", "[\"naive\"]");
        self.tables = format!("{TIMING}\n[[strategy]]\nname = \"mine\"\npreset = \"deferred\"\n");
    }

    /// Adds two `[[scene]]` entries with one value each, which set the powers of two different lights to 10.
    fn sweeps(&mut self) {
        let two =
            "[[light]]\nposition = [1, 3, 1]\npower = 7\n\n[[light]]\nposition = [-1, 3, 1]\npower = 8\n";
        self.edit("a/scene.toml", "[[light]]\nposition = [1, 3, 1]\npower = 10\n", two);
        self.set("scenes", "[]");
        let sweep =
            |light: u32| format!("[[scene]]\nfile = \"a/scene.toml\"\nset.\"light.{light}.power\" = [10]\n");
        self.tables = format!("{}{}{}", self.tables, sweep(0), sweep(1));
    }

    fn edit_kernel(&mut self, file: &str) {
        self.edit(&format!("kernels/{file}"), "\n\n", "\n// A comment.\n\n");
    }

    /// Runs the experiment, and returns how many points were measured.
    fn run(&self, more: &[&str]) -> usize {
        let lines: String = self.config.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
        self.write("config.toml", &format!("{lines}{}", self.tables));
        let before = self.record_count();
        let device = device();
        let arguments =
            ["run", "config.toml", "--out", "out", "--quiet", "--cl-dir", "kernels", "--device", &device];
        let mut command = self.folder.raycl(&[&arguments, more].concat());
        command.envs(self.variables.iter().map(|(name, value)| (name, value))).assert().success();
        self.record_count() - before
    }

    fn record_count(&self) -> usize {
        match self.folder.path("out/records.jsonl").exists() {
            true => self.folder.json_lines("out/records.jsonl").len(),
            false => 0,
        }
    }

    /// Returns the points, medians and winners of the folder. Checks that neither another file in the folder nor
    /// `raycl compare` shows other points, medians or winners. (Some files leave out baselines or winners.)
    fn agreed(&self, edit: &str, scenes: &[&str]) -> Shown {
        let csv = self.folder.text("out/summary.csv");
        assert_eq!(self.folder.text("out/exports/points.csv"), csv, "{edit}: points.csv");
        let medians = of_csv(&csv);
        let shown_scenes: BTreeSet<_> = medians.keys().map(|(scene, ..)| scene.as_str()).collect();
        assert_eq!(shown_scenes, scenes.iter().copied().collect(), "{edit}");
        let summary = of_markdown(&self.folder.text("out/summary.md"));
        let page = of_page(&self.folder.text("out/report.html"));
        assert!(!summary.winners.is_empty(), "{edit}: no winner");
        assert_eq!(summary.winners, page.winners, "{edit}: the winners of summary.md and report.html");
        same(&summary.medians, &medians, 1e-3, &format!("{edit}: summary.md"));
        same(&page.medians, &medians, 1e-3, &format!("{edit}: report.html"));
        let kernels = medians.iter().filter(|((_, _, size), _)| size != "-");
        let kernels: BTreeMap<Name, f64> = kernels.map(|(name, ms)| (name.clone(), *ms)).collect();
        same(&self.t4(), &kernels, 1e-12, &format!("{edit}: t4-results.json"));
        same(&self.kernel_tuner(), &kernels, 1e-12, &format!("{edit}: kernel-tuner-*.json"));
        same(&self.compared(), &medians, 1e-12, &format!("{edit}: compare"));
        Shown { medians, winners: summary.winners }
    }

    /// Returns the medians that `raycl compare` shows if the folder is compared with itself.
    fn compared(&self) -> BTreeMap<Name, f64> {
        let text = self.folder.output(&["compare", "out", "out", "--json"]);
        let comparison: Value = serde_json::from_str(&text).expect("JSON");
        let point = |point: &Value| {
            let size =
                point["local_size"].as_array().map_or("-".into(), |size| format!("{}x{}", size[0], size[1]));
            ((word(&point["scene"]), word(&point["name"]), size), number(&point["median_ms"][1]))
        };
        comparison["points"].as_array().expect("a list").iter().map(point).collect()
    }

    fn t4(&self) -> BTreeMap<Name, f64> {
        let results: Value =
            serde_json::from_str(&self.folder.text("out/exports/t4-results.json")).expect("JSON");
        let point = |result: &Value| {
            let at = &result["configuration"];
            let size = format!("{}x{}", at["block_size_x"], at["block_size_y"]);
            ((word(&at["scene"]), word(&at["name"]), size), number(&result["measurements"][0]["value"]))
        };
        results["results"].as_array().expect("a list").iter().map(point).collect()
    }

    /// Returns the medians in the cache files that raycl exports for Kernel Tuner, an auto-tuner. Only the name of a
    /// cache file states the scene of its points, so the scene is found by the beginning of this name.
    fn kernel_tuner(&self) -> BTreeMap<Name, f64> {
        let mut points = BTreeMap::new();
        let t4 = self.t4();
        let scenes: BTreeSet<_> = t4.keys().map(|(scene, ..)| scene.clone()).collect();
        let files = std::fs::read_dir(self.folder.path("out/exports")).expect("a folder").flatten();
        for file in files.filter(|file| file.file_name().to_string_lossy().starts_with("kernel-tuner-")) {
            let name = file.file_name().to_string_lossy().into_owned();
            let of_file =
                |scene: &&String| name.starts_with(&format!("kernel-tuner-{}-", in_file_names(scene)));
            let scene =
                scenes.iter().find(of_file).unwrap_or_else(|| panic!("{name} is of no scene of {scenes:?}"));
            let cache: Value =
                serde_json::from_str(&std::fs::read_to_string(file.path()).expect("text")).expect("JSON");
            for entry in cache["cache"].as_object().expect("an object").values() {
                let size = format!("{}x{}", entry["block_size_x"], entry["block_size_y"]);
                points.insert((scene.clone(), word(&entry["name"]), size), number(&entry["time"]));
            }
        }
        points
    }
}

fn in_file_names(scene: &str) -> String {
    scene.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' }).collect()
}

fn word(value: &Value) -> String {
    value.as_str().expect("text").to_owned()
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Fails unless `one` and `other` have the same points, and medians that differ relatively by no more than `part`.
#[track_caller]
fn same(one: &BTreeMap<Name, f64>, other: &BTreeMap<Name, f64>, part: f64, what: &str) {
    let names = |points: &BTreeMap<Name, f64>| points.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(one), names(other), "{what}: the points");
    for (name, ms) in one {
        assert!((ms / other[name] - 1.0).abs() <= part, "{what}: {name:?} is {ms}, not {}", other[name]);
    }
}

fn of_csv(text: &str) -> BTreeMap<Name, f64> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<BTreeMap<String, String>> = reader.deserialize().map(|row| row.expect("a row")).collect();
    let size = |row: &BTreeMap<String, String>| match row["local_size_x"].as_str() {
        "" => "-".to_owned(),
        across => format!("{across}x{}", row["local_size_y"]),
    };
    let point = |row: &BTreeMap<String, String>| {
        ((row["scene"].clone(), row["name"].clone(), size(row)), row["median_ms"].parse().expect("a number"))
    };
    rows.iter().map(point).collect()
}

/// Returns the name of a baseline: `parallel` for the strategy `parallel-f32 (host)`. Some files show a
/// baseline's strategy instead of its name.
fn by_name(strategy: &str) -> String {
    strategy.trim_end_matches(" (host)").replace("parallel-f32", "parallel")
}

/// Reads a summary in Markdown, which has headings such as "## scene, 16 x 10, device", and rows with
/// strategy, local size and median. The winners among the kernels are bold.
fn of_markdown(text: &str) -> Shown {
    let mut shown = Shown::default();
    let mut scene = String::new();
    for line in text.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            scene = heading.split(", ").next().unwrap_or_default().to_owned();
        }
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let [_, strategy, size, median, ..] = cells.as_slice()
            && let Ok(ms) = median.parse()
        {
            let name = (scene.clone(), by_name(strategy.trim_matches('*')), size.replace(' ', ""));
            shown.medians.insert(name.clone(), ms);
            if strategy.starts_with("**") {
                shown.winners.insert(name);
            }
        }
    }
    shown
}

/// Reads a report's page: the rows of the table in each of its `article` elements. A winner's row has the class `wins`.
fn of_page(text: &str) -> Shown {
    let mut shown = Shown::default();
    for view in text.split("<article class=\"view\"").skip(1) {
        let scene =
            between(view, "<h3>", "</h3>").split(", ").next().unwrap_or_default().replace("&#x2F;", "/");
        let table = between(view, "<tbody>", "</tbody>");
        for row in table.split("<tr").skip(1) {
            let cells: Vec<&str> = row.split("<td").skip(1).map(|cell| between(cell, ">", "</td>")).collect();
            let name = (scene.clone(), by_name(cells[0]), cells[1].to_owned());
            // After the median, the table's cell may also say that the samples have two modes (lie around two
            // values).
            let median = cells[2].split_whitespace().next().expect("a cell");
            shown.medians.insert(name.clone(), median.parse().expect("a median"));
            if row.starts_with(" class=\"wins\"") {
                shown.winners.insert(name);
            }
        }
    }
    shown
}

fn between<'t>(text: &'t str, from: &str, to: &str) -> &'t str {
    let rest = text.split_once(from).map_or("", |(_, rest)| rest);
    rest.split_once(to).map_or("", |(inner, _)| inner)
}

/// The folder of this test has six points of a run on 2026-11-20, when folders of results had no `plan.json` yet.
#[test]
fn results_of_before_are_read_without_a_plan() {
    let folder = repository("tests/data/old-results");
    let work_folder = WorkFolder::new();
    let out = work_folder.path("out");
    let names = [folder.to_str().expect("UTF-8"), out.to_str().expect("UTF-8")];
    work_folder.output(&["report", names[0], "--out", names[1]]);
    let lines = std::fs::read_to_string(folder.join("records.jsonl")).expect("records").lines().count();
    assert_eq!(work_folder.text("out/exports/points.csv").lines().count(), lines + 1);
}
