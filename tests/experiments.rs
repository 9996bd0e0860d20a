//! docs/experiments.md has every key and default of an experiment, and every axis of strategies with its
//! values.

use crate::binary::repository;
use crate::schemas::{mistakes, names, read, schema, table};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs::read_to_string;

const EXPERIMENTS: &str = "docs/experiments.md";

/// Returns the tables of an experiment: each table's heading in docs/experiments.md, and its schema.
fn tables_of_experiment(config: &Value) -> [(&'static str, &Value); 5] {
    let keys = &config["properties"];
    [
        ("\n## Top level\n", config),
        ("\n## `[[scene]]`\n", &keys["scene"]["items"]),
        ("\n## `[[strategy]]`\n", &keys["strategy"]["items"]),
        ("\n## `[emulate]`\n", &keys["emulate"]),
        ("\n## `[timing]`\n", &keys["timing"]),
    ]
}

/// Returns the keys of a table's schema without the axes, which have a table of their own.
fn keys_of(schema: &Value) -> BTreeSet<String> {
    let is_axis = |key: &&String| raycl::strategy::AXES.iter().any(|axis| axis.name == key.as_str());
    schema["properties"].as_object().expect("keys").keys().filter(|key| !is_axis(key)).cloned().collect()
}

#[test]
fn the_experiments_page_has_every_key_with_its_default() {
    let config = schema("config");
    let mut defaults = 0;
    for (heading, schema) in tables_of_experiment(&config) {
        let rows = table(EXPERIMENTS, heading);
        let name = |row: &Vec<String>| names(&row[0]).first().map(|name| name.replace(['[', ']'], ""));
        let listed: Vec<_> = rows.iter().filter_map(name).collect();
        assert_eq!(listed.iter().cloned().collect::<BTreeSet<_>>(), keys_of(schema), "{heading}");
        assert_eq!(listed.len(), keys_of(schema).len(), "{heading}: a key is listed twice");
        for row in &rows {
            let Some(key) = name(row) else { continue };
            let required = schema["required"].as_array().is_some_and(|keys| keys.contains(&json!(key)));
            assert_eq!(row[2] == "required", required, "{heading} {key}");
            let about = schema["properties"][&key]["description"].as_str().unwrap_or_default();
            let about = about.split_whitespace().collect::<Vec<_>>().join(" ");
            let default = about.split_once("[default: ").and_then(|(_, rest)| rest.split_once(']'));
            // Only defaults that are numbers or "false" are compared: the table describes all others in words of its
            // own.
            if let Some((default, _)) =
                default.filter(|(text, _)| text.parse::<f64>().is_ok() || *text == "false")
            {
                assert_eq!(row[2], default, "{heading} {key}");
                defaults += 1;
            }
        }
    }
    assert_eq!(defaults, 11, "defaults that are numbers or booleans");
}

#[test]
fn the_experiments_page_has_every_axis_with_its_values() {
    let rows = table(EXPERIMENTS, "\n| axis | values |");
    let listed: Vec<_> = rows.iter().map(|row| (names(&row[0]), names(&row[1]))).collect();
    let values = |axis: &raycl::strategy::AxisInfo| -> Vec<String> {
        axis.values().into_iter().map(|(value, _)| value.to_owned()).collect()
    };
    let axes: Vec<_> =
        raycl::strategy::AXES.iter().map(|axis| (vec![axis.name.to_owned()], values(axis))).collect();
    assert_eq!(listed, axes);
    // The page also has every baseline.
    let baselines: Vec<_> = table(EXPERIMENTS, "\n## Baselines\n")
        .iter()
        .map(|row| [names(&row[0]), names(&row[1])].concat())
        .collect();
    let known: Vec<_> = raycl::config::Baseline::ALL
        .iter()
        .map(|baseline| vec![baseline.name().to_owned(), baseline.strategy().to_owned()])
        .collect();
    assert_eq!(baselines, known);
}

/// `tests/readme.rs` loads the complete example of docs/experiments.md. This test checks that the complete
/// example conforms to the schema of configs and has every key.
#[test]
fn the_complete_example_of_the_experiments_page_uses_every_key() {
    let page = read_to_string(repository(EXPERIMENTS)).expect("the page");
    let rest = page.split_once("\n## A complete example\n").expect("the heading").1;
    let block = rest.split("\n```").nth(1).and_then(|block| block.strip_prefix("toml\n")).expect("TOML");
    let (example, config) = (read(block), schema("config"));
    let mistakes_found = mistakes(&example, &config, "");
    assert!(mistakes_found.is_empty(), "{mistakes_found:#?}");
    let [_, (_, scene), (_, strategy), (_, emulate), (_, timing)] = tables_of_experiment(&config);
    let of = |part: &Value| -> BTreeSet<String> {
        let tables = part.as_array().cloned().unwrap_or_else(|| vec![part.clone()]);
        tables.iter().flat_map(|table| table.as_object().expect("a table").keys().cloned()).collect()
    };
    for (used, schema) in [
        (&example, &config),
        (&example["scene"], scene),
        (&example["strategy"], strategy),
        (&example["emulate"], emulate),
        (&example["timing"], timing),
    ] {
        let missing: Vec<_> = keys_of(schema).difference(&of(used)).cloned().collect();
        assert!(missing.is_empty(), "the example lacks {missing:?}");
    }
}
