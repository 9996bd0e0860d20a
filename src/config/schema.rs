//! JSON schemas of those values in a config for which no schema is derived from a type of the module `wire`: sizes,
//! numbers of samples, strategies, the names of presets and baselines, and values of any type.

use std::borrow::Cow;
use std::ops::RangeInclusive;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value, json};

use super::scenes::SAMPLES;
use super::sizes::{IMAGE_PIXELS, IMAGE_SIDE, LOCAL_ITEMS, LOCAL_SIDE};
use super::types::Baseline;
use super::wire::StrategyEntry;
use crate::schema::{names, schema_by_hand};
use crate::strategy::{AXES, AxisInfo, preset_names};

/// The name of a preset.
pub struct PresetName;
/// The name of a caster on the host.
pub struct BaselineName;
/// The width and height of an image.
pub struct ImageSize;
/// The width and height of a work-group.
pub struct LocalSize;
/// A number of samples per pixel, or a list of such numbers.
pub struct SampleNumbers;
/// Any value.
pub struct Anything;

schema_by_hand! {
    PresetName => names(preset_names().into_iter());
    BaselineName => names(Baseline::ALL.iter().map(|baseline| baseline.name()));
    Anything => json_schema!({});
    ImageSize => size(&IMAGE_SIDE, IMAGE_PIXELS);
    LocalSize => size(&LOCAL_SIDE, LOCAL_ITEMS);
    SampleNumbers => numbers(&SAMPLES);
    StrategyEntry => strategy();
}

/// Returns the schema of a size: one side of a square, or two sides in the range `side`. A square has at most `most`
/// pixels or work-items. For two sides, a schema cannot limit their product.
fn size(side: &RangeInclusive<i64>, most: u64) -> Schema {
    let up_to = |end: u64| json!({ "type": "integer", "minimum": side.start(), "maximum": end });
    let longest = side.end().unsigned_abs();
    let (square, side) = (up_to(longest.min(most.isqrt())), up_to(longest));
    json_schema!({ "anyOf": [square, { "type": "array", "items": side, "minItems": 2, "maxItems": 2 }] })
}

/// Returns the schema of a whole number in `range`, or of a list of such numbers.
fn numbers(range: &RangeInclusive<i64>) -> Schema {
    let number = json!({ "type": "integer", "minimum": range.start(), "maximum": range.end() });
    json_schema!({ "anyOf": [number, { "type": "array", "items": number, "minItems": 1 }] })
}

/// Returns the schema of a `[[strategy]]` entry: its own keys, such as `preset`, and a key for every axis.
fn strategy() -> Schema {
    let mut keys = Map::new();
    let mut add = |key: &str, about: &str, schema: Schema| {
        let mut schema = schema.to_value();
        schema["description"] = about.into();
        keys.insert(key.to_owned(), schema);
    };
    add(
        "preset",
        "The preset whose axes this strategy changes; `raycl strategies` lists all presets.",
        PresetName::schema(),
    );
    add(
        "name",
        "The strategy's name in results; axes with several values are appended [default: the preset's name; \
         axes that differ from the preset are appended, too].",
        json_schema!({ "type": "string", "minLength": 1 }),
    );
    let sizes = json_schema!({ "type": "array", "items": size(&LOCAL_SIDE, LOCAL_ITEMS) });
    add(
        "local_sizes",
        "Work-items per work-group for this strategy, instead of the experiment's `local_sizes`.",
        sizes,
    );
    let about =
        "Also measure the strategy on kinds of devices that its preset is not meant for [default: false].";
    add("any_kind", about, json_schema!({ "type": "boolean" }));
    for axis in AXES {
        add(
            axis.name,
            &format!(
                "{}: one value, or a list of values; each combination of the values of all lists is a strategy",
                axis.about
            ),
            values(axis),
        );
    }
    json_schema!({ "type": "object", "properties": keys, "required": ["preset"], "additionalProperties": false })
}

/// Returns the schema of an axis's value or list of values. A value that is a number may be written without quotes. If
/// an axis's values are files, any string is allowed, since the folder of --cl-dir may contain more files.
fn values(axis: &AxisInfo) -> Schema {
    let known = axis.values().into_iter().map(|(name, _)| Value::from(name));
    let numbers = axis.values().into_iter().filter_map(|(name, _)| name.parse::<i64>().ok()).map(Value::from);
    let mut one = vec![json!({ "enum": known.chain(numbers).collect::<Vec<_>>() })];
    if axis.listed.is_empty() {
        one.push(json!({ "type": "string" }));
    }
    let list = json!({ "type": "array", "items": { "anyOf": one }, "minItems": 1 });
    json_schema!({ "anyOf": one.iter().cloned().chain([list]).collect::<Vec<_>>() })
}
