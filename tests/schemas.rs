//! The JSON schemas of scenes, configs and records: the stored schemas equal those of this program, every scene and
//! config of the repository conforms to its schema, and the schemas reject mistakes that raycl rejects.

use crate::binary::{WorkFolder, repository};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};
use std::path::PathBuf;

const KINDS: [(&str, &str); 2] = [("config", "configs"), ("scene", "scenes")];

/// The name of the schema of a line of records.jsonl.
const RECORD: &str = "record";

pub fn schema(kind: &str) -> Value {
    serde_json::from_str(&WorkFolder::new().output(&["schema", kind])).expect("JSON")
}

fn tomls(folder: &str) -> Vec<PathBuf> {
    let files = read_dir(repository(folder)).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<_> =
        files.filter(|path| path.extension().is_some_and(|ending| ending == "toml")).collect();
    files.sort();
    files
}

pub fn read(text: &str) -> Value {
    let table: toml::Table = text.parse().expect("TOML");
    serde_json::to_value(table).expect("JSON")
}

/// Returns the reasons why a value does not conform to a schema. Supports only those keywords of JSON schemas
/// that raycl's own schemas use.
pub fn mistakes(value: &Value, schema: &Value, path: &str) -> Vec<String> {
    // Any value conforms to the schema `true`.
    if *schema == Value::Bool(true) {
        return Vec::new();
    }
    let keywords = schema.as_object().expect("a schema");
    keywords.iter().flat_map(|(keyword, wanted)| mistake(value, keyword, wanted, path, schema)).collect()
}

fn is_of(value: &Value, name: &Value) -> bool {
    match name.as_str().expect("a type") {
        "null" => value.is_null(),
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        other => panic!("the type {other}"),
    }
}

fn mistake(value: &Value, keyword: &str, wanted: &Value, path: &str, schema: &Value) -> Vec<String> {
    let number = |holds: fn(f64, f64) -> bool| match (value.as_f64(), wanted.as_f64()) {
        (Some(value), Some(wanted)) => holds(value, wanted),
        (value, _) => value.is_none(),
    };
    let count = |holds: fn(u64, u64) -> bool| {
        let length = value.as_array().map(Vec::len).or(value.as_str().map(str::len));
        length.is_none_or(|length| holds(length as u64, wanted.as_u64().expect("a length")))
    };
    let holds = match keyword {
        "$schema" | "title" | "description" | "format" | "default" => true,
        "type" => match wanted {
            Value::Array(types) => types.iter().any(|one| is_of(value, one)),
            one => is_of(value, one),
        },
        "enum" => wanted.as_array().expect("values").contains(value),
        "const" => value == wanted || wanted.is_number() && value.as_f64() == wanted.as_f64(),
        "not" => !mistakes(value, wanted, path).is_empty(),
        "minimum" => number(|value, least| value >= least),
        "maximum" => number(|value, most| value <= most),
        "exclusiveMinimum" => number(|value, below| value > below),
        "exclusiveMaximum" => number(|value, above| value < above),
        "minItems" | "minLength" => count(|length, least| length >= least),
        "maxItems" => count(|length, most| length <= most),
        // The schemas contain only one pattern: the pattern of colours.
        "pattern" => {
            value.as_str().is_none_or(|text| text.starts_with('#') || ["black", "white"].contains(&text))
        }
        "anyOf" | "oneOf" => {
            wanted.as_array().expect("choices").iter().any(|one| mistakes(value, one, path).is_empty())
        }
        "items" => {
            let items = value.as_array().into_iter().flatten().enumerate();
            return items.flat_map(|(at, item)| mistakes(item, wanted, &format!("{path}[{at}]"))).collect();
        }
        "properties" | "additionalProperties" if !value.is_object() => true,
        "properties" => {
            let keys = value
                .as_object()
                .into_iter()
                .flatten()
                .filter_map(|(key, value)| Some((key, value, wanted.get(key)?)));
            return keys
                .flat_map(|(key, value, wanted)| mistakes(value, wanted, &format!("{path}.{key}")))
                .collect();
        }
        "additionalProperties" => match wanted {
            Value::Bool(allowed) => {
                let known = |key: &String| schema["properties"].get(key).is_some();
                *allowed || value.as_object().into_iter().flatten().all(|(key, _)| known(key))
            }
            _ => true,
        },
        "required" => {
            let mut keys = wanted.as_array().into_iter().flatten().filter_map(Value::as_str);
            keys.all(|key| value.get(key).is_some() || !value.is_object())
        }
        other => panic!("this test does not know the keyword {other}"),
    };
    if holds { Vec::new() } else { vec![format!("{path}: {keyword} {wanted}: {value}")] }
}

#[test]
fn the_stored_schemas_are_this_programs() {
    for kind in KINDS.map(|(kind, _)| kind).into_iter().chain([RECORD]) {
        let path = repository(&format!("docs/schemas/{kind}.schema.json"));
        let stored = read_to_string(&path).unwrap_or_default();
        let printed = WorkFolder::new().output(&["schema", kind]);
        assert!(stored == printed, "`raycl schema {kind} > docs/schemas/{kind}.schema.json` makes it again");
    }
}

#[test]
fn every_file_names_its_schema_and_keeps_to_it() {
    for (kind, folder) in KINDS {
        let schema = schema(kind);
        let files = tomls(folder);
        assert!(files.len() > 10, "{folder}: {} files", files.len());
        for path in files {
            let text = read_to_string(&path).expect("a file");
            let first = format!("#:schema ../docs/schemas/{kind}.schema.json");
            assert_eq!(text.lines().next(), Some(first.as_str()), "{}", path.display());
            let mistakes_found = mistakes(&read(&text), &schema, "");
            assert!(mistakes_found.is_empty(), "{}: {mistakes_found:#?}", path.display());
        }
    }
}

#[test]
fn what_raycl_refuses_the_schemas_refuse() {
    let scene = "[[light]]\nposition = [1, 3, 1]\npower = 10\n[[object]]\nshape = \"ground\"\n";
    let config = "question = \"?\"\nexpectation = \"!\"\nscenes = [\"scene.toml\"]\nimage_sizes = [[8, 5]]\nlocal_sizes = [4]\n\
        [[strategy]]\npreset = \"deferred\"\nwidth = [1, 4]\n[timing]\nseed = 1\n";
    for (kind, good, changes) in [
        (
            "scene",
            scene,
            &[
                ("shape", "shpae"),
                ("shape = \"ground\"", "shape = \"grond\""),
                ("power = 10", "pwer = 10"),
                ("power = 10", "power = -1"),
                ("[1, 3, 1]", "[1, 3]"),
                ("power = 10", "power = \"10\""),
                ("[[light]]", "shadow_bias = -1\n[[light]]"),
                ("[[light]]", "[camera]\nfov_x_degrees = 180\n[[light]]"),
                ("[[light]]", "background = \"grey\"\n[[light]]"),
                ("[[light]]", "name = \"\"\n[[light]]"),
                ("shape = \"ground\"", "shape = \"terrain\"\nseed = 4294967296"),
            ][..],
        ),
        (
            "config",
            config,
            &[
                ("image_sizes", "image_size"),
                ("image_sizes = [[8, 5]]\n", ""),
                ("[[8, 5]]", "[[8, 5, 3]]"),
                ("[[8, 5]]", "[0]"),
                ("[[8, 5]]", "[65536]"),
                ("local_sizes = [4]", "local_sizes = [65]"),
                ("preset = \"deferred\"", "preset = \"deferred\"\nlocal_sizes = [65]"),
                ("width", "wdith"),
                ("preset = \"deferred\"", "preset = \"defered\""),
                ("width = [1, 4]", "width = [1, 5]"),
                ("seed", "sede"),
                ("seed = 1", "seed = 1.5"),
                ("seed = 1", "seed = 4294967296"),
                ("preset = \"deferred\"", "preset = \"deferred\"\nname = \"\""),
            ][..],
        ),
    ] {
        let schema = schema(kind);
        assert!(mistakes(&read(good), &schema, "").is_empty(), "{:?}", mistakes(&read(good), &schema, ""));
        for &(from, to) in changes {
            let bad = good.replacen(from, to, 1);
            assert_ne!(bad, good, "{from}");
            assert!(!mistakes(&read(&bad), &schema, "").is_empty(), "the schema takes: {bad}");
            let folder = WorkFolder::with(&[("scene.toml", scene), (&format!("{kind}.toml"), &bad)]);
            match kind {
                "scene" => folder.mistake(&["render", "scene.toml", "-o", "a.png"], 2),
                _ => folder.mistake(&["run", "config.toml", "--dry-run"], 2),
            };
        }
    }
}

#[test]
fn axes_and_presets_are_completed_and_numbers_may_be_numbers() {
    let config = schema("config");
    let strategy = &config["properties"]["strategy"]["items"]["properties"];
    for axis in raycl::strategy::AXES {
        assert!(
            strategy[axis.name]["description"].as_str().is_some_and(|text| text.contains(axis.about)),
            "{}",
            axis.name
        );
    }
    let widths = strategy["width"]["anyOf"][0]["enum"].as_array().expect("values");
    assert!(widths.contains(&json!(4)) && widths.contains(&json!("4")), "{widths:?}");
    let presets = config["properties"]["strategies"]["items"]["enum"].as_array().expect("presets").len();
    assert_eq!(presets, raycl::strategy::PRESETS.len());
    // Every key at the top level of a scene or config must have a description.
    for (kind, _) in KINDS {
        for (key, value) in schema(kind)["properties"].as_object().expect("keys") {
            assert!(value["description"].is_string(), "{kind}: {key}");
        }
    }
}

/// Returns the rows of the first table after a text (a heading, or the table's own first line) of a page.
pub fn table(page: &str, after: &str) -> Vec<Vec<String>> {
    let text = read_to_string(repository(page)).expect("the page");
    let section = text.split_once(after).expect("the heading").1;
    let table = section.lines().skip_while(|line| !line.starts_with("|---")).skip(1);
    let rows = table.take_while(|line| line.starts_with('|'));
    rows.map(|row| row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
}

/// Returns the names that are in backticks in a table's cell.
pub fn names(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Returns the fields of the first table under a heading of docs/format.md: the names in backticks in the
/// table's first column.
fn documented(heading: &str) -> BTreeSet<String> {
    table("docs/format.md", heading).iter().flat_map(|row| names(&row[0])).collect()
}

/// This test reads stored records that several earlier revisions of raycl wrote; all these records conform to the
/// present schema. docs/format.md lists every field of this schema.
#[test]
fn records_keep_to_their_schema_and_the_page_has_every_field() {
    let schema = schema(RECORD);
    let fields: BTreeSet<String> =
        schema["properties"].as_object().expect("fields").keys().cloned().collect();
    assert_eq!(documented("\n## records.jsonl\n"), fields);
    let mut seen = 0;
    for device in ["2026-11-20-h200", "2026-11-20-pocl"] {
        for run in read_dir(repository("docs/results").join(device)).expect("stored results") {
            let Ok(text) = read_to_string(run.expect("a folder").path().join("records.jsonl")) else {
                continue;
            };
            for line in text.lines() {
                let mistakes_found = mistakes(&serde_json::from_str(line).expect("JSON"), &schema, "");
                assert!(mistakes_found.is_empty(), "{mistakes_found:#?}\n{line}");
                seen += 1;
            }
        }
    }
    assert!(seen > 500, "{seen} records");
}

/// Words in the code of docs/python.md that are not fields: types, names that the code defines, and words of
/// SQL.
const NO_FIELDS: [&str; 21] = [
    "properties",
    "type",
    "string",
    "integer",
    "number",
    "boolean",
    "measured",
    "diagonal_relaxed",
    "select",
    "from",
    "where",
    "order",
    "by",
    "limit",
    "unnest",
    "as",
    "sample_ms",
    "points",
    "count",
    "group",
    "float64",
];

/// All fields that the code of docs/python.md names are fields of records or, if the code reads `summary.csv`, columns
/// of this file. `make test-python` runs this code.
#[test]
fn the_python_page_names_fields_that_records_have() {
    let page = read_to_string(repository("docs/python.md")).expect("the page");
    let blocks: Vec<&str> =
        page.split("\n```python\n").skip(1).filter_map(|rest| rest.split("\n```").next()).collect();
    assert!(blocks.len() >= 8, "{} blocks", blocks.len());
    let fields = documented("\n## records.jsonl\n");
    let columns = &fields | &documented("\n## summary.csv\n");
    let is_name = |word: &&str| word.len() > 1 && word.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let mut seen = BTreeSet::new();
    for (block, line) in blocks.iter().flat_map(|block| block.lines().map(move |line| (block, line))) {
        let known = if block.contains("summary.csv") { &columns } else { &fields };
        // In this code, a text between quotes may be a field or a query. Each word of a query may be a field.
        for quoted in line.split('"').skip(1).step_by(2) {
            let words = if quoted.starts_with("select") {
                quoted.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')).collect()
            } else {
                vec![quoted]
            };
            for word in words.into_iter().filter(is_name).filter(|word| !NO_FIELDS.contains(word)) {
                assert!(known.contains(word), "records have no {word}: {line}");
                seen.insert(word);
            }
        }
    }
    assert!(seen.len() >= 6, "{seen:?}");
}
