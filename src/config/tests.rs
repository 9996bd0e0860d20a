//! Tests of configs that load, and of configs that are refused with the location of the mistake.

use std::path::PathBuf;

use super::*;
use crate::device::{DeviceKind, DeviceLimits, EXAMPLE_LIMITS};
use crate::scene::Setting;
use crate::strategy::{Triangles, Vectors, Width};

const GOOD: &str = r#"question = "Which?"
expectation = "This."
scenes = ["../scenes/teapot.toml"]
image_sizes = [[800, 500]]
local_sizes = [8, [64, 1], 8]
strategies = ["naive", "local-vectors"]
"#;

/// Makes a folder with placeholder scenes and `text` as configs/test.toml.
fn folder(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for name in ["configs", "scenes"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    let papers = ["triangle", "figure-4", "pyramid-upper", "pyramid-lower", "still-life", "gourd", "teapot"];
    for scene in papers {
        std::fs::write(folder.path().join(format!("scenes/{scene}.toml")), "").unwrap();
    }
    let path = folder.path().join("configs/test.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn load_with(text: &str, overrides: &[(&str, &str)]) -> Result<Experiment> {
    let (_folder, path) = folder(text);
    let overrides: Vec<_> =
        overrides.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
    load(&path, &overrides)
}

/// Returns the whole error as a user sees it.
fn refusal(text: &str, overrides: &[(&str, &str)]) -> String {
    let error = load_with(text, overrides).expect_err("it was accepted");
    assert_eq!(error.exit_code(), 2);
    let mut report = String::new();
    miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::none())
        .with_width(400)
        .render_report(&mut report, &error)
        .unwrap();
    report
}

#[track_caller]
fn refuses(text: &str, expected: &[&str]) {
    let report = refusal(text, &[]);
    for words in expected {
        assert!(report.contains(words), "{words:?} is not in\n{report}");
    }
}

#[test]
fn a_good_config_becomes_an_experiment() {
    let experiment = load_with(GOOD, &[]).unwrap();
    assert_eq!(experiment.name, "test");
    assert!(experiment.devices.is_empty());
    assert_eq!(experiment.image_sizes, [[800, 500]]);
    assert_eq!(experiment.strategies[0].local_sizes, [[8, 8], [64, 1]]);
    assert_eq!(experiment.strategies[1].preset.as_deref(), Some("local-vectors"));
    assert_eq!(experiment.strategies[1].strategy.vectors, Vectors::LOCAL);
    assert_eq!(experiment.timing, Timing::default());
    assert_eq!(experiment.emulate, Emulate::default());
    assert_eq!(experiment.source, GOOD);
}

#[test]
fn every_config_of_the_repository_loads() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("configs");
    let mut count = 0;
    for file in std::fs::read_dir(root).unwrap() {
        let experiment = load(&file.unwrap().path(), &[])
            .unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)));
        assert!(!experiment.strategies.is_empty());
        // Baselines test every triangle, so they would take too long on scenes that need trees.
        let trees = experiment.strategies.iter().any(|named| named.strategy.needs_tree());
        // A config with a single strategy makes pictures and compares nothing, so it needs no baseline.
        let alone = experiment.strategies.len() == 1;
        assert!(trees || alone || !experiment.baselines.is_empty());
        count += 1;
    }
    assert!(count >= 6, "there are only {count} configs");
}

#[test]
fn a_single_scene_has_a_limit_of_triangles_if_every_strategy_needs_a_tree() {
    let most = |text: &str| load_with(text, &[]).unwrap().scenes[0].most_triangles;
    let named = |strategies: &str| GOOD.replace(r#"["naive", "local-vectors"]"#, strategies);
    let trees = named(r#"["bvh", "tile"]"#);
    assert_eq!(most(&trees), Some(1 << 25));
    assert_eq!(most(&named(r#"["bvh", "naive"]"#)), None);
    let two =
        trees.replace(r#"["../scenes/teapot.toml"]"#, r#"["../scenes/teapot.toml", "../scenes/gourd.toml"]"#);
    assert_eq!(most(&two), None);
    assert_eq!(most(&format!("baselines = [\"serial\"]\n{trees}")), None);
}

#[test]
fn lists_of_axes_give_their_product() {
    let text = format!(
        "{GOOD}[[strategy]]\npreset = \"compounded\"\nvectors = [\"private\", \"local\"]\n\
         triangles = \"constant\"\nwidth = [1, \"4\"]\nlocal_sizes = [4]\n"
    );
    let experiment = load_with(&text, &[]).unwrap();
    let names: Vec<_> = experiment.strategies[2..].iter().map(|strategy| strategy.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "compounded+vectors=private+triangles=constant+width=1",
            "compounded+vectors=private+triangles=constant+width=4",
            "compounded+vectors=local+triangles=constant+width=1",
            "compounded+vectors=local+triangles=constant+width=4",
        ]
    );
    let last = &experiment.strategies[5];
    assert_eq!((last.strategy.width, last.strategy.triangles), (Width::W4, Triangles::CONSTANT));
    assert_eq!((last.preset.clone(), last.local_sizes.clone()), (None, vec![[4, 4]]));
}

#[test]
fn of_a_list_the_strategy_that_equals_the_preset_keeps_its_name() {
    let text = format!("{GOOD}[[strategy]]\npreset = \"deferred\"\nwidth = [1, 4]\n");
    let experiment = load_with(&text, &[]).unwrap();
    let presets: Vec<_> =
        experiment.strategies[2..].iter().map(|strategy| strategy.preset.as_deref()).collect();
    assert_eq!(presets, [Some("deferred"), None]);
}

#[test]
fn a_name_stands_for_what_does_not_vary() {
    let entry = "[[strategy]]\nname = \"mine\"\npreset = \"deferred\"\nmath = \"fast\"\nwidth = [1, 2]\n";
    let experiment = load_with(&format!("{GOOD}{entry}"), &[]).unwrap();
    assert_eq!(experiment.strategies[2].name, "mine+width=1");
    let entry = "[[strategy]]\nname = \"mine\"\npreset = \"deferred\"\nmath = \"fast\"\n";
    let experiment = load_with(&format!("{GOOD}{entry}"), &[]).unwrap();
    assert_eq!(experiment.strategies[2].name, "mine");
}

#[test]
fn a_name_is_not_empty() {
    for name in ["", " "] {
        let entry = format!("[[strategy]]\nname = \"{name}\"\npreset = \"deferred\"\n");
        refuses(&format!("{GOOD}{entry}"), &["the name is empty", "test.toml:8:8"]);
    }
}

/// Tables and messages contain a strategy's name, so a line break in the name could forge a line.
#[test]
fn a_name_is_in_one_line() {
    for (name, shown) in [("a\\nb", "a\\u000ab"), ("a\\tb", "a\\u0009b"), ("\\u001b[2J", "\\u001b[2J")] {
        let entry = format!("[[strategy]]\nname = \"{name}\"\npreset = \"deferred\"\n");
        let message = format!("the name '{shown}' contains a control character");
        refuses(&format!("{GOOD}{entry}"), &[&message, "expected one line of text", "test.toml:8:8"]);
    }
    let set = [("strategy", "[{ preset = 'wide', name = \"a\\nb\" }]")];
    assert!(refusal(GOOD, &set).contains("the name 'a\\u000ab' contains a control character"));
}

#[test]
fn a_preset_is_meant_for_its_kind_of_device_unless_its_entry_says_any_kind() {
    let meant_for = |more: &str| {
        let text = format!("{GOOD}[[strategy]]\npreset = \"wide\"\n{more}");
        load_with(&text, &[]).unwrap().strategies[2].meant_for
    };
    assert_eq!([meant_for(""), meant_for("any_kind = true\n")], [Some(DeviceKind::Cpu), None]);
    let listed = |before: &str, overrides: &[(&str, &str)]| {
        let text = format!("{before}{}", GOOD.replace("\"naive\"", "\"wide\""));
        load_with(&text, overrides).unwrap().strategies[0].meant_for
    };
    assert_eq!(listed("", &[]), Some(DeviceKind::Cpu));
    assert_eq!(listed("any_kind = true\n", &[]), None);
    assert_eq!(listed("", &[("timing.seed", "3")]), Some(DeviceKind::Cpu));
    let asked = listed("", &[("timing.seed", "3"), ("strategies", "[\"wide\"]")]);
    assert_eq!(asked, None, "the command line names the preset");
}

#[test]
fn a_misspelt_key_names_the_nearest() {
    let text = GOOD.replace("local_sizes", "local_sises");
    refuses(
        &text,
        &["unknown key 'local_sises'", "test.toml:5:1", "no such key here", "did you mean 'local_sizes'?"],
    );
    let text = format!("{GOOD}[timing]\nsamples_max = 3\nwarmpu = 1\n");
    refuses(&text, &["unknown key", "test.toml:8:1", "the keys are"]);
    let text = format!("{GOOD}[[strategy]]\npreset = \"naive\"\ntriangels = 8\n");
    refuses(&text, &["unknown key 'triangels'", "test.toml:9:1", "did you mean 'triangles'?"]);
    let text = format!("{GOOD}[[strategy]]\npreset = \"naive\"\nany_kinds = true\n");
    refuses(&text, &["unknown key 'any_kinds'", "test.toml:9:1", "did you mean 'any_kind'?"]);
}

#[test]
fn a_key_below_the_wrong_table_is_answered_with_its_own_table() {
    let entry = "[[strategy]]\npreset = \"deferred\"\n";
    let text = format!("{}{entry}strategies = [\"naive\"]\n", GOOD.replace("strategies", "# "));
    let above =
        "but this line belongs to the table [[strategy]]: move the line above the first line in brackets";
    refuses(
        &text,
        &[
            "unknown key 'strategies'",
            "test.toml:9:1",
            &format!("`strategies` is a key of the top level, {above}; the keys here are name, preset, "),
        ],
    );
    refuses(
        &format!("{GOOD}{entry}launches = 2\n"),
        &["`launches` is a key of [timing]; the keys here are "],
    );
    refuses(
        &format!("{GOOD}[timing]\nseed = 1\ndevices = [\"cpu\"]\n"),
        &["`devices` is a key of the top level, but this line belongs to the table [timing]: "],
    );
    assert!(refusal(GOOD, &[("launches", "2")]).contains("`launches` is a key of [timing]"));
}

#[test]
fn an_experiment_without_a_question_is_named_after_its_file() {
    let experiment = load_with(&GOOD.replace("question", "#").replace("expectation", "#"), &[]).unwrap();
    assert_eq!((experiment.question.as_str(), experiment.expectation.as_str()), ("test", ""));
}

#[test]
fn a_missing_key_is_named() {
    refuses(&GOOD.replace("image_sizes", "#"), &["the key 'image_sizes' is missing", "test.toml:1:1"]);
    refuses(&format!("{GOOD}[[strategy]]\nwidth = 4\n"), &["no preset", "test.toml:7:1", "raycl strategies"]);
}

#[test]
fn a_wrong_type_says_what_was_expected() {
    let text = GOOD.replace("[\"naive\", \"local-vectors\"]", "3");
    refuses(&text, &["wrong type: integer 3, expected a list", "test.toml:6:14"]);
    refuses(&GOOD.replace("[64, 1]", "\"64x1\""), &["expected a size", "test.toml:5:19"]);
    for (more, actual, position) in [
        ("emulate = 3", "integer 3", "7:11"),
        ("emulate = []", "list", "7:11"),
        ("emulate = [9, 7]", "list", "7:11"),
        ("timing = \"x\"", "string \"x\"", "7:10"),
        ("timing = [0, 2, 7, 9, 20, 1, 0.5]", "list", "7:10"),
        ("scene = [3]", "integer 3", "7:10"),
        ("scene = [[\"../scenes/gourd.toml\", {}]]", "list", "7:10"),
        ("scene = [{ file = \"../scenes/gourd.toml\", set = 3 }]", "integer 3", "7:49"),
    ] {
        let message = format!("wrong type: {actual}, expected a table");
        refuses(&format!("{GOOD}{more}\n"), &[&message, &format!("test.toml:{position}")]);
    }
    refuses(&format!("{GOOD}[timing]\nseed = 1.5"), &["expected a whole number", "test.toml:8:8"]);
    refuses(&format!("{GOOD}[timing]\ntime_limit_ms = \"5 s\""), &["expected a number", "test.toml:8:17"]);
    refuses(
        &format!("{GOOD}[[strategy]]\npreset = \"naive\"\nwidth = true"),
        &["expected an axis's value", "9:9"],
    );
}

#[test]
fn a_value_in_place_of_a_list_is_answered_with_a_list() {
    let sizes = |value: &str| GOOD.replace("[[800, 500]]", value);
    let message = "wrong type: string \"400x250\", expected a list";
    refuses(&sizes("\"400x250\""), &[message, "4:15", "image_sizes is a list, such as [[400, 250]]"]);
    refuses(&sizes("'64 x 48'"), &["image_sizes is a list, such as [[64, 48]]"]);
    refuses(&sizes("512"), &["image_sizes is a list, such as [[800, 500]]"]);
    refuses(&format!("devices = \"gpu\"\n{GOOD}"), &["1:11", "devices is a list, such as [\"cpu\"]"]);
    let report = refusal(GOOD, &[("local_sizes", "8x4")]);
    assert!(report.contains("local_sizes is a list, such as [[8, 4]]"), "{report}");
}

#[test]
fn a_table_that_is_one_of_a_list_needs_double_brackets() {
    for (table, line) in [("strategy", "preset = \"deferred\""), ("scene", "file = \"../scenes/gourd.toml\"")]
    {
        let help = format!("write [[{table}]] with double brackets");
        let text = format!("{GOOD}[{table}]\n{line}\n");
        refuses(&text, &["wrong type: table, expected a list", "test.toml:7:1", &help]);
    }
    refuses(&format!("{GOOD}strategy = {{ }}\n"), &["expected a list", "docs/experiments.md"]);
    let text = format!("{GOOD}[[timing]]\nseed = 3\n");
    refuses(&text, &["wrong type: list, expected a table", "write [timing] with single brackets"]);
}

#[test]
fn sizes_out_of_range_say_the_range() {
    refuses(
        &GOOD.replace("[64, 1]", "[64, -1]"),
        &["local size -1 is out of range", "5:24", "from 1 to 4096"],
    );
    // All work-items of the largest work-group may be in one row, as with `raycl render --local-size`.
    let row = load_with(&GOOD.replace("[64, 1]", "[4096, 1]"), &[]).unwrap();
    assert!(row.strategies[0].local_sizes.contains(&[4096, 1]));
    refuses(
        &GOOD.replace("[64, 1]", "[128, 64]"),
        &["128 x 64 is too large", "5:19", "at most 4096 work-items"],
    );
    refuses(&GOOD.replace("[64, 1]", "[1, 2, 3]"), &["two numbers, not 3", "5:19", "[across, down]"]);
    refuses(&GOOD.replace("[800,", "[0,"), &["image size 0 is out of range", "4:17", "from 1 to 65536"]);
    refuses(&GOOD.replace("[800, 500]", "[65536, 65536]"), &["too large", "4294967295 pixels"]);
    refuses(&GOOD.replace("[[800, 500]]", "[]"), &["'image_sizes' is empty", "4:15"]);
}

#[test]
fn a_local_size_may_have_as_many_work_items_as_are_allowed() {
    let experiment = load_with(&GOOD.replace("[64, 1]", "[64, 64]"), &[]).unwrap();
    assert_eq!(experiment.strategies[0].local_sizes, [[8, 8], [64, 64]]);
}

#[test]
fn timing_out_of_range_says_the_range() {
    refuses(&format!("{GOOD}[timing]\ntime_limit_ms = -5"), &["time_limit_ms -5 is out of range", "8:17"]);
    refuses(
        &format!("{GOOD}[timing]\nrelative_sigma = nan"),
        &["relative_sigma NaN", "a number from 0 to 1"],
    );
    refuses(
        &format!("{GOOD}[timing]\nmax_samples = 5\nmin_samples = 6"),
        &[
            "min_samples 6 is larger than max_samples 5",
            "9:15",
            "max_samples is 5 in",
            ":8",
            "lower min_samples",
        ],
    );
    for text in ["max_samples = 5\nmin_samples = 1000001", "max_samples = 0\nmin_samples = 6"] {
        refuses(&format!("{GOOD}[timing]\n{text}"), &[" is out of range", "from 1 to 1000000"]);
    }
    let timing = load_with(&format!("{GOOD}[timing]\nmax_samples = 5"), &[]).unwrap().timing;
    assert_eq!((timing.min_samples, timing.max_samples), (5, 5));
    let timing = load_with(&format!("{GOOD}[timing]\nmin_samples = 200"), &[]).unwrap().timing;
    assert_eq!((timing.min_samples, timing.max_samples), (200, 200));
    refuses(&format!("{GOOD}[emulate]\nlocal_bytes = -1"), &["local_bytes -1 is out of range", "8:15"]);
}

#[test]
fn emulation_lowers_a_devices_limits_and_never_raises_them() {
    let emulate = Emulate { local_bytes: Some(16384), constant_bytes: Some(1 << 20) };
    let lowered = DeviceLimits { local_bytes: 16384, local_is_emulated: true, ..EXAMPLE_LIMITS };
    assert_eq!(emulate.apply(EXAMPLE_LIMITS), lowered);
    assert_eq!(Emulate::default().apply(EXAMPLE_LIMITS), EXAMPLE_LIMITS);
}

#[test]
fn an_old_spelling_is_answered_with_the_new_one() {
    let text = format!("{GOOD}[limits]\nlocal_bytes = 49152");
    refuses(&text, &["unknown key 'limits'", "test.toml:7:2", "did you mean 'emulate'?"]);
    let report = refusal(GOOD, &[("limits.local_bytes", "1000")]);
    assert!(report.contains("did you mean 'emulate'?"), "{report}");
}

#[test]
fn a_contradiction_names_reason_and_combination() {
    let text = format!("{GOOD}[[strategy]]\npreset = \"naive\"\ntriangles = [\"global\", \"tiled\"]\n");
    refuses(
        &text,
        &[
            "this combination of values is not allowed: shading = eager with triangles = tiled",
            "test.toml:7:1",
            "asks for preset=naive triangles=tiled",
        ],
    );
}

#[test]
fn unknown_names_are_refused_with_the_nearest() {
    refuses(
        &GOOD.replace("\"naive\"", "\"naïv\""),
        &["'naïv' is not a preset", "6:15", "did you mean 'naive'?"],
    );
    let text = format!("{GOOD}[[strategy]]\npreset = \"naive\"\nvectors = [\"local\", \"privat\"]\n");
    refuses(&text, &["'privat' is not a value of the axis 'vectors'", "9:21", "did you mean 'private'?"]);
    refuses(
        &format!("baselines = [\"seriel\"]\n{GOOD}"),
        &["'seriel' is not a baseline", "1:14", "'serial'?"],
    );
    refuses(
        &GOOD.replace("teapot", "teepot"),
        &["no scene file '../scenes/teepot.toml'", "3:11", "did you mean ../scenes/teapot.toml?"],
    );
    // Of all files here, the config `test.toml` has the name most similar to `tent.toml`, but a config is no scene.
    let text = GOOD.replace("../scenes/teapot.toml", "tent.toml");
    refuses(&text, &["no scene file 'tent.toml'", "paths are relative to the config file"]);
}

#[test]
fn only_a_scene_or_a_mesh_is_suggested_for_a_missing_scene() {
    let (folder, path) = folder(&GOOD.replace("../scenes/teapot.toml", "tent.toml"));
    for name in ["tent.mtl", "my-tent.toml"] {
        std::fs::write(folder.path().join("configs").join(name), "").unwrap();
    }
    assert_eq!(load(&path, &[]).unwrap_err().remedy(), "did you mean my-tent.toml?");
}

#[test]
fn a_strategy_in_the_form_of_the_option_is_answered_with_the_table_that_a_config_needs() {
    let help = |name: &str| refusal(&GOOD.replace("local-vectors", name), &[]);
    for (name, keys) in [
        ("deferred,width=4", "preset = \"deferred\" and width = 4"),
        ("naive, math = fast,width=2", "preset = \"naive\" and math = \"fast\" and width = 2"),
        ("deferred+width=4", "preset = \"deferred\" and width = 4"),
        ("width=8", "preset = \"deferred\" and width = 8"),
    ] {
        let expected = format!("in a config, write [[strategy]] with {keys}");
        assert!(help(name).contains(&expected), "{}", help(name));
    }
    for name in ["naiv", "naiv,width=4", "naive,width", "naive,"] {
        assert!(!help(name).contains("in a config"), "{}", help(name));
    }
}

#[test]
fn two_strategies_of_one_name_and_nothing_to_measure_are_refused() {
    let text = format!("{GOOD}[[strategy]]\npreset = \"naive\"\n");
    refuses(&text, &["two strategies have the name 'naive'", "test.toml:7:1"]);
    let text = text.replace("[[strategy]]\n", "[[strategy]]\nwidth = [4, 1, 4]\n");
    refuses(&text, &["'width' lists the value '4' twice", "test.toml:8:16", "remove one of the two"]);
    refuses(&GOOD.replace("strategies", "#"), &["nothing to measure"]);
    refuses(&GOOD.replace("local_sizes", "#"), &["strategy 'naive' has no local sizes", "test.toml:6:15"]);
}

/// An entry of `strategies` is only a name, so it cannot set local sizes of its own.
#[test]
fn missing_local_sizes_are_asked_for_where_they_can_be_set() {
    let preset = GOOD.replace("local_sizes", "#");
    let table = preset.replace("strategies", "#") + "[[strategy]]\npreset = \"naive\"\n";
    let sizes = "set local_sizes = [8, 16] (8 x 8 and 16 x 16 work-items)";
    let top = "at the top of the experiment's file";
    refuses(&preset, &[&format!("{sizes} {top}")]);
    refuses(&table, &[&format!("{sizes} in this [[strategy]] table, or {top}")]);
}

#[test]
fn broken_toml_and_a_missing_file_are_input_errors() {
    refuses(
        &GOOD.replace("[[800, 500]]", "[[800, 500"),
        &[
            "this is not TOML: the bracket `[` in line 4 is not closed",
            "test.toml:",
            "write `]` where the list ends",
        ],
    );
    let error = load(&PathBuf::from("no/such.toml"), &[]).expect_err("it was read");
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("cannot read the experiment `no/such.toml`"));
}

#[test]
fn a_scene_is_taken_with_each_of_the_values_set_in_it() {
    let entry = "[[scene]]\nfile = \"../scenes/gourd.toml\"\nset = { \"object.0.triangles\" = [1_000, 2_000], \"light.0.power\" = 5 }\n";
    let experiment = load_with(&format!("{GOOD}{entry}"), &[]).unwrap();
    let labels: Vec<_> = experiment.scenes.iter().map(|scene| scene.label()).collect();
    assert_eq!(labels, ["teapot", "gourd+power=5+triangles=1000", "gourd+power=5+triangles=2000"]);
    let keys: Vec<_> =
        experiment.scenes[2].overrides.iter().map(|set| format!("{} {}", set.path, set.value)).collect();
    assert_eq!(keys, ["light.0.power 5", "object.0.triangles 2000"]);
    // Lines of results contain the label, so it has no line break.
    let broken = "[[scene]]\nfile = \"../scenes/gourd.toml\"\nset = { name = \"a\\nb\" }\n";
    let label = load_with(&format!("{GOOD}{broken}"), &[]).unwrap().scenes[1].label();
    assert!(label.starts_with("gourd+name=") && !label.contains(char::is_control), "{label:?}");
    let origin = &experiment.scenes[2].overrides[1].origin;
    let line = GOOD.lines().count() + 3;
    assert!(origin.ends_with(&format!(":{line}: object.0.triangles = 2000")), "{origin}");
    // A config with `[[scene]]` entries needs no `scenes`, and a repeated entry adds no scene.
    let only = GOOD.replace("scenes = ", "# ") + entry + entry;
    assert_eq!(load_with(&only, &[]).unwrap().scenes.len(), 2);
}

#[test]
fn a_path_without_quotes_changes_only_its_own_value_and_a_table_in_a_list_is_a_value() {
    let set = |text: &str, overrides: &[(&str, &str)]| -> Vec<Vec<String>> {
        let entry = format!("[[scene]]\nfile = \"../scenes/gourd.toml\"\nset = {{ {text} }}\n");
        let experiment = load_with(&format!("{GOOD}{entry}"), overrides).unwrap();
        let text = |set: &Setting| format!("{} {}", set.path, set.value);
        experiment.scenes[1..].iter().map(|scene| scene.overrides.iter().map(text).collect()).collect()
    };
    assert_eq!(set("display.exposure = [3, 4]", &[]), [["display.exposure 3"], ["display.exposure 4"]]);
    let both = ["display.exposure 3", "light.0.power 5"];
    assert_eq!(set("light.0.power = 5, display = { exposure = 3 }", &[]), [both]);
    assert_eq!(set("light.0.power = 5", &[("scene.0.set.display.exposure", "3")]), [both]);
    assert_eq!(set("display = [{ exposure = 3 }]", &[]), [["display { exposure = 3 }"]]);
    let wrong =
        format!("{GOOD}[[scene]]\nfile = \"../scenes/gourd.toml\"\nset = {{ display.exposure = [] }}\n");
    refuses(&wrong, &["'display.exposure' is empty", "9:9"]);
}

#[test]
fn a_scene_entry_is_checked_at_its_position() {
    let refused = |entry: &str, words: &[&str]| refuses(&format!("{GOOD}[[scene]]\n{entry}\n"), words);
    refused("file = \"../scenes/gord.toml\"", &["no scene file '../scenes/gord.toml'", "8:8", "gourd.toml?"]);
    refused("set = { \"object.0.triangles\" = 4 }", &["the key 'file' is missing", "7:1"]);
    refused("file = \"../scenes/gourd.toml\"\nset = { seed = [] }", &["'seed' is empty", "9:9"]);
    refused("file = \"../scenes/gourd.toml\"\ntriangles = 4", &["unknown key 'triangles'", "9:1"]);
    refuses(&GOOD.replace("scenes = ", "# "), &["there is no scene", "scenes = [...] or [[scene]]"]);
    for (key, message) in [("scenes", "there is no scene"), ("strategies", "there is nothing to measure")] {
        let report = refusal(GOOD, &[("timing.seed", "3"), (key, "[]")]);
        assert!(report.contains(message) && report.contains("--set:1:1"), "{report}");
    }
}

#[test]
fn a_scene_is_taken_with_each_number_of_samples() {
    let of = |entry: &str, overrides: &[(&str, &str)]| -> Vec<(String, u32)> {
        let text = format!("{GOOD}[[scene]]\nfile = \"../scenes/gourd.toml\"\n{entry}\n");
        let scenes = load_with(&text, overrides).unwrap().scenes;
        scenes[1..].iter().map(|scene| (scene.label(), scene.samples)).collect()
    };
    let named = |name: &str, samples| (name.to_owned(), samples);
    let (one, four) = (named("gourd", 1), named("gourd+samples=4", 4));
    assert_eq!(of("", &[]), of("samples = 1", &[]));
    assert_eq!(of("samples = 4", &[]), std::slice::from_ref(&four));
    assert_eq!(
        of("samples = [4, 1, 4]", &[]),
        [four.clone(), one.clone()],
        "a repeated number adds no scene"
    );
    assert_eq!(of("", &[("scene.0.samples", "[1, 4]")]), [one, four]);
    assert_eq!(of("samples = 64", &[]), [named("gourd+samples=64", 64)]);
    let labels = [
        "gourd+seed=1+samples=2",
        "gourd+seed=1+samples=3",
        "gourd+seed=2+samples=2",
        "gourd+seed=2+samples=3",
    ];
    let all = of("set = { seed = [1, 2] }\nsamples = [2, 3]", &[]);
    assert_eq!(all.into_iter().map(|(label, _)| label).collect::<Vec<_>>(), labels);
    for (value, words) in [
        ("0", ["samples 0 is out of range", "expected a whole number from 1 to 64", "9:11"]),
        ("65", ["samples 65 is out of range", "from 1 to 64", "9:11"]),
        ("[4, -1]", ["samples -1 is out of range", "from 1 to 64", "9:15"]),
        ("[]", ["'samples' is empty", "expected at least one number", "9:11"]),
        ("\"4\"", ["string \"4\"", "expected a whole number or a list of whole numbers", "9:11"]),
        ("4.0", ["floating point 4.0", "expected a whole number or a list", "9:11"]),
        ("[4, \"x\"]", ["string \"x\"", "expected a whole number", "9:15"]),
    ] {
        refuses(&format!("{GOOD}[[scene]]\nfile = \"../scenes/gourd.toml\"\nsamples = {value}\n"), &words);
    }
}

#[test]
fn overrides_are_toml_or_else_strings_and_make_tables() {
    let overrides = [
        ("timing.seed", "7"),
        ("image_sizes", "[[64, 40]]"),
        ("question", "Is it so?"),
        ("emulate.local_bytes", "1_000"),
    ];
    let experiment = load_with(GOOD, &overrides).unwrap();
    assert_eq!(experiment.timing.seed, 7);
    assert_eq!(experiment.image_sizes, [[64, 40]]);
    assert_eq!(experiment.question, "Is it so?");
    assert_eq!(experiment.emulate.local_bytes, Some(1000));
    assert_eq!(experiment.overrides[2], "question = \"Is it so?\"");
}

#[test]
fn an_override_reaches_one_strategy_of_the_list() {
    let text = format!("{GOOD}[[strategy]]\npreset = \"deferred\"\nwidth = 4\n");
    let experiment = load_with(&text, &[("strategy.0.width", "8")]).unwrap();
    assert_eq!(experiment.strategies[2].strategy.width, Width::W8);
}

#[test]
fn a_bad_override_is_shown_in_its_own_words() {
    let report = refusal(GOOD, &[("timing.seed", "3"), ("timing.sede", "4")]);
    for words in ["unknown key 'sede'", "--set:1:8", "timing.sede = 4", "did you mean 'seed'?"] {
        assert!(report.contains(words), "{words:?} is not in\n{report}");
    }
    let report = refusal(GOOD, &[("timing.seed", "-3")]);
    assert!(report.contains("seed -3 is out of range") && report.contains("--set:1:15"), "{report}");
    assert!(refusal(GOOD, &[("scenes.first", "3")]).contains("expected a list"));
    assert!(
        refusal(GOOD, &[("timing..seed", "3")]).contains("--set timing..seed=3: 'timing..seed' is not a key")
    );
    // If keys were not checked, the line `#timing.seed = 3` would be a comment of TOML, and this `--set` would do
    // nothing.
    assert!(refusal(GOOD, &[("#timing.seed", "3")]).contains("'#timing.seed' is not a key"));
    for (key, whole) in [
        ("strategy.5.width", r#"--set strategy='[{ preset = "naive" }]'"#),
        ("scene.0.file", r#"--set scene='[{ file = "scenes/teapot.toml" }]'"#),
        ("baselines.0", r#"--set baselines='["serial"]'"#),
    ] {
        let report = refusal(GOOD, &[(key, "3")]);
        let (list, _) = key.split_once('.').unwrap();
        for words in [&*format!("'{list}' has 0 elements; there is no index"), "--set:1:", whole] {
            assert!(report.contains(words), "{words:?} is not in\n{report}");
        }
    }
    assert!(refusal(GOOD, &[("fruit.0", "3")]).contains("unknown key 'fruit'"));
    let with_one = format!("{GOOD}[[strategy]]\npreset = \"deferred\"\n");
    for (text, [key, value], message) in [
        (&*with_one, ["strategy.1.width", "8"], "'strategy' has 1 element; the only index is 0"),
        (GOOD, ["local_sizes.3", "8"], "'local_sizes' has 3 elements; the indices are 0 to 2"),
        (GOOD, ["local_sizes.1.2", "8"], "'local_sizes.1' has 2 elements; the indices are 0 to 1"),
        (
            &*with_one,
            ["strategy.0.local_sizes.0", "8"],
            "set the whole list: --set strategy.0.local_sizes='[8]'",
        ),
        (
            &GOOD.replace("[8, [64, 1], 8]", "[]"),
            ["local_sizes.0", "8"],
            "'local_sizes' has 0 elements; there is no index",
        ),
    ] {
        let report = refusal(text, &[(key, value)]);
        assert!(report.contains(message) && report.contains("--set:1:"), "{report}");
    }
    assert!(refusal(GOOD, &[("local_sizes", "{}")]).contains("wrong type: table, expected a list"));
    assert!(
        refusal(&with_one, &[("strategy", "{ 0 = { width = 8 }, first = 1 }")]).contains("expected a list")
    );
}

#[test]
fn a_limit_that_is_set_below_the_configs_own_is_reported_with_both_positions() {
    let text = format!("{GOOD}[timing]\nmin_samples = 100\nmax_samples = 100\n");
    let report = refusal(&text, &[("timing.max_samples", "10")]);
    for words in [
        "max_samples 10 is less than min_samples 100",
        "--set:1:22",
        "test.toml:8",
        "--set timing.min_samples=10",
    ] {
        assert!(report.contains(words), "{words:?} is not in\n{report}");
    }
    let both = [("timing.max_samples", "10"), ("timing.min_samples", "10")];
    assert_eq!(load_with(&text, &both).unwrap().timing.max_samples, 10);
    let report = refusal(&text, &[("timing.min_samples", "200")]);
    for words in [
        "min_samples 200 is larger than max_samples 100",
        "--set:1:22",
        "test.toml:9",
        "--set timing.max_samples=200",
    ] {
        assert!(report.contains(words), "{words:?} is not in\n{report}");
    }
    for most in ["0", "-5"] {
        let report = refusal(&text, &[("timing.max_samples", most)]);
        assert!(report.contains(&format!("max_samples {most} is out of range")), "{report}");
    }
}

#[test]
fn paths_of_scenes_in_overrides_become_absolute_and_nothing_else_changes() {
    let whole = |path: &str| std::path::absolute(path).unwrap().display().to_string();
    let changed = |key: &str, value: &str| {
        let (key, value) = with_absolute_paths(&[(key.into(), value.into())]).remove(0);
        toml::from_str::<toml::Table>(&format!("{key} = {value}")).unwrap()
    };
    let [a, b] = ["sc/a.toml", "../b.toml"].map(whole);
    for (key, value, expected) in [
        ("scenes", "[\"sc/a.toml\", \"/c.toml\"]", format!("scenes = [{a:?}, \"/c.toml\"]")),
        ("scenes.0", "sc/a.toml", format!("scenes.0 = {a:?}")),
        ("scene.0.file", "../b.toml", format!("scene.0.file = {b:?}")),
        (
            "scene",
            "[{ file = \"../b.toml\", set = { name = [\"x\"] } }]",
            format!("scene = [{{ file = {b:?}, set = {{ name = [\"x\"] }} }}]"),
        ),
    ] {
        let expected: toml::Table = toml::from_str(&expected).unwrap();
        assert_eq!(changed(key, value), expected, "{key} = {value}");
    }
    for (key, value) in [("strategies", "[\"naive\"]"), ("question", "a.toml"), ("scene.0.set.x", "[1]")] {
        let given = [(key.to_owned(), value.to_owned())];
        assert_eq!(with_absolute_paths(&given), given);
    }
}

#[test]
fn a_file_of_blank_lines_is_empty() {
    for text in ["", " \n\t\n"] {
        let report = refusal(text, &[]);
        assert!(report.contains(" is empty"), "{report}");
    }
}

#[test]
fn every_key_reaches_its_own_setting() {
    let text = format!(
        "compare_scenes = true\ndevices = [\"nvidia\", \"pocl\", \"nvidia\"]\n\
         baselines = [\"serial-f64\", \"parallel\", \"serial\", \"parallel\"]\n{GOOD}\
         [emulate]\nlocal_bytes = 1024\nconstant_bytes = 2048\n\
         [timing]\nwarmup = 3\nlaunches = 5\nmin_samples = 6\nmax_samples = 7\ntime_limit_ms = 8\n\
         seed = 9\nrelative_sigma = 0.25\n"
    );
    let experiment = load_with(&text, &[]).unwrap();
    assert_eq!((experiment.question.as_str(), experiment.expectation.as_str()), ("Which?", "This."));
    assert!(experiment.compare_scenes && !load_with(GOOD, &[]).unwrap().compare_scenes);
    let devices = experiment.devices.iter().map(|device| device.text.as_str());
    assert!(devices.eq(["nvidia", "pocl"]));
    assert_eq!(experiment.baselines, [Baseline::SerialF64, Baseline::Parallel, Baseline::Serial]);
    let emulate = Emulate { local_bytes: Some(1024), constant_bytes: Some(2048) };
    assert_eq!(experiment.emulate, emulate);
    let timing = Timing {
        warmup: 3,
        launches: 5,
        min_samples: 6,
        max_samples: 7,
        time_limit_ms: 8.0,
        seed: 9,
        relative_sigma: 0.25,
    };
    assert_eq!(experiment.timing, timing);
    assert_eq!(experiment.path.file_name().unwrap(), "test.toml");
    assert_eq!(experiment.path.parent(), Some(experiment.scenes[0].named_in.as_path()));
    assert!(experiment.scenes[0].path.ends_with("scenes/teapot.toml"));
}

#[test]
fn a_word_for_devices_has_its_location() {
    let text = format!("devices = [\n  \"nvidia\",\n  \"pthred\",\n]\n{GOOD}");
    let locations = |overrides: &[(&str, &str)]| -> Vec<String> {
        load_with(&text, overrides).unwrap().devices.into_iter().map(|device| device.location).collect()
    };
    let of_file = locations(&[]);
    assert!(of_file[0].ends_with("test.toml:2") && of_file[1].ends_with("test.toml:3"), "{of_file:?}");
    assert_eq!(locations(&[("devices", "[\"nosuch\"]")]), ["--set:1"]);
}

#[test]
fn the_bounds_of_a_setting_are_allowed_and_what_is_beyond_is_not() {
    for (table, key, least, most) in [
        ("timing", "warmup", "0", "1000"),
        ("timing", "launches", "1", "100"),
        ("timing", "min_samples", "1", "1000000"),
        ("timing", "max_samples", "1", "1000000"),
        ("timing", "time_limit_ms", "1", "100000000"),
        ("timing", "seed", "0", "4294967295"),
        ("timing", "relative_sigma", "0", "1"),
        ("emulate", "local_bytes", "0", "4294967295"),
        ("emulate", "constant_bytes", "0", "4294967295"),
    ] {
        let with = |value: &str| format!("{GOOD}[{table}]\n{key} = {value}\n");
        for value in [least, most] {
            assert!(load_with(&with(value), &[]).is_ok(), "{key} = {value}");
        }
        for beyond in [least.parse::<i64>().unwrap() - 1, most.parse::<i64>().unwrap() + 1] {
            let message = format!("{key} {beyond} is out of range");
            refuses(&with(&beyond.to_string()), &[&message, &format!(" from {least} to {most}")]);
        }
        let schema = schema();
        let of_key = &schema["properties"][table]["properties"][key];
        let bounds = ["minimum", "maximum"].map(|bound| of_key[bound].as_f64());
        assert_eq!(bounds, [least, most].map(|bound| bound.parse::<f64>().ok()), "the schema of {key}");
    }
}

/// An error's message says what is wrong. The label, which is printed under the marked part of the file, says what
/// was expected there.
#[test]
fn a_message_and_its_label_are_not_mixed_up() {
    for (text, message) in [
        (GOOD.replace("[64, 1]", "[128, 64]"), "local size 128 x 64 is too large"),
        (GOOD.replace("[64, 1]", "[1, 2, 3]"), "local size must have two numbers, not 3"),
        (GOOD.replace("[64, 1]", "[64, -1]"), "local size -1 is out of range"),
        (GOOD.replace("Which?", " "), "the question is empty"),
        (GOOD.replace("This.", "\t"), "the expectation is empty"),
        (format!("devices = []\n{GOOD}"), "'devices' is empty"),
        (format!("devices = [\"\"]\n{GOOD}"), "the device is empty"),
        (GOOD.replace("[[800, 500]]", "[]"), "'image_sizes' is empty"),
        (GOOD.replace("scenes = ", "# "), "there is no scene"),
        (GOOD.replace("strategies", "#"), "there is nothing to measure"),
        (format!("{GOOD}[[strategy]]\npreset = \"deferred\"\nwidth = []\n"), "'width' is empty"),
        (format!("{GOOD}[[strategy]]\nwidth = 4\n"), "this strategy has no preset"),
        (GOOD.replace("local_sizes", "#"), "strategy 'naive' has no local sizes"),
        (GOOD.replace("teapot", "xyz"), "there is no scene file '../scenes/xyz.toml'"),
        (GOOD.replace("image_sizes", "#"), "the key 'image_sizes' is missing"),
    ] {
        assert_eq!(load_with(&text, &[]).expect_err("it was accepted").to_string(), message);
    }
}

/// raycl may read an experiment several times: for each of two folders of kernels, for each shard, and to resume a run.
#[test]
fn an_experiment_is_not_read_from_standard_input() {
    let error = load(Path::new("-"), &[]).expect_err("standard input");
    assert_eq!(error.to_string(), "an experiment is not read from standard input (`-`)");
    assert!(
        error.exit_code() == 2 && error.remedy().starts_with("save the experiment as a file"),
        "{error:?}"
    );
}

#[test]
fn a_file_of_another_type_is_named() {
    let (_folder, path) = folder("[camera]\nz_near = 0.1\n");
    let error = load(&path, &[]).expect_err("a scene");
    assert_eq!(error.to_string(), format!("{} is a scene, not an experiment", path.display()));
    std::fs::write(&path, "v 0 0 0\nf 1 1 1\n").unwrap();
    let error = load(&path, &[]).expect_err("a mesh");
    assert_eq!(error.to_string(), format!("{} is an OBJ mesh, not an experiment", path.display()));
    std::fs::write(&path, GOOD).unwrap();
    let scene = path.parent().unwrap().join("../scenes/teapot.toml");
    std::fs::write(&scene, "GIF89a").unwrap();
    let error = load(&path, &[]).expect_err("a picture");
    let start = format!("{}:3: {}", path.display(), scene.display());
    assert_eq!(error.to_string(), format!("{start} is a GIF picture, which raycl does not read"));
    std::fs::write(&scene, GOOD).unwrap();
    let error = load(&path, &[]).expect_err("an experiment");
    assert_eq!(
        error.in_a_line(),
        format!("{}:3: {} is an experiment, not a scene", path.display(), scene.display())
    );
    assert!(error.remedy().starts_with("`raycl run "), "{}", error.remedy());
    std::fs::write(&scene, "GIF89a").unwrap();
    let named = [
        ("timing.seed".to_owned(), "3".to_owned()),
        ("scenes".to_owned(), "[\"../scenes/teapot.toml\"]".to_owned()),
    ];
    let error = load(&path, &named).expect_err("a picture");
    let start = format!("--set:1: {}", scene.display());
    assert_eq!(error.to_string(), format!("{start} is a GIF picture, which raycl does not read"));
}

#[test]
fn a_list_of_one_value_is_like_the_value() {
    let names = |entry: &str| {
        let text = format!("{GOOD}[[strategy]]\npreset = \"deferred\"\n{entry}\n");
        load_with(&text, &[]).unwrap().strategies[2].name.clone()
    };
    assert_eq!(names("shading = [\"deferred\"]"), "deferred");
    assert_eq!(names("math = [\"fast\"]\nname = \"mine\""), "mine");
    assert_eq!(names("math = [\"fast\"]"), "deferred+math=fast");
}
