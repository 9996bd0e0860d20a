//! JSON schemas of the TOML files that users write, derived from the types that read them. With a schema, an
//! editor completes keys, explains them and marks mistakes. Records have a schema too, so that other programs
//! know the type of a field that is null throughout a file. `raycl schema` prints the schemas.

use schemars::generate::SchemaSettings;
use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema, json_schema};
use serde_json::Value;

/// Returns the schema of a TOML file that is read as a `T`.
pub(crate) fn of<T: JsonSchema>(title: &str) -> Value {
    let mut settings = settings();
    settings.transforms.push(Box::new(RecursiveTransform(without_null)));
    settings.transforms.push(Box::new(RecursiveTransform(with_largest)));
    titled::<T>(settings, title)
}

/// Returns the schema of a `T` stored as JSON.
pub(crate) fn of_json<T: JsonSchema>(title: &str) -> Value {
    titled::<T>(settings(), title)
}

/// Returns the settings for the generated schemas. The schemas follow the draft (version) of JSON Schema that
/// editors' TOML plugins support. The schemas contain no references (`$ref`), so each table is described
/// where it is used.
fn settings() -> SchemaSettings {
    let mut settings = SchemaSettings::draft07();
    settings.inline_subschemas = true;
    settings
}

fn titled<T: JsonSchema>(settings: SchemaSettings, title: &str) -> Value {
    let mut schema = settings.into_generator().into_root_schema_for::<T>();
    schema.insert("title".to_owned(), title.into());
    schema.to_value()
}

/// Returns the schema of a string that must be one of these names.
pub(crate) fn names(names: impl Iterator<Item = &'static str>) -> Schema {
    json_schema!({ "type": "string", "enum": names.collect::<Vec<_>>() })
}

/// Removes null from the types of a schema. TOML has no null: an optional key may be absent, but not null.
fn without_null(schema: &mut Schema) {
    if let Some(Value::Array(types)) = schema.get_mut("type") {
        types.retain(|one| one != "null");
        if let [only] = &types[..] {
            let only = only.clone();
            schema.insert("type".to_owned(), only);
        }
    }
    if let Some(Value::Array(values)) = schema.get_mut("enum") {
        values.retain(|one| !one.is_null());
    }
    let Some(Value::Array(choices)) = schema.get_mut("anyOf") else { return };
    let before = choices.len();
    choices.retain(|one| one.get("type").is_none_or(|name| name != "null"));
    if let ([Value::Object(only)], true) = (&choices[..], choices.len() < before) {
        let only = only.clone();
        schema.remove("anyOf");
        // The key keeps its own description, which says more than the description of the key's type.
        for (keyword, value) in only {
            schema.ensure_object().entry(keyword).or_insert(value);
        }
    }
}

/// Adds the largest value to the schema of an unsigned 32-bit number, if the schema states none. The crate
/// `schemars` states no largest value, only the format `uint32`, which the standard of JSON Schema does not
/// define.
fn with_largest(schema: &mut Schema) {
    if schema.get("format").is_some_and(|format| format == "uint32") && schema.get("maximum").is_none() {
        schema.insert("maximum".to_owned(), u32::MAX.into());
    }
}

/// Implements `JsonSchema` for types whose schemas are written by hand, not derived. Each argument of the macro
/// is a type, `=>` and the type's schema.
macro_rules! schema_by_hand {
    ($($type:ty => $schema:expr;)+) => {$(
        impl $type {
            fn schema() -> Schema {
                $schema
            }
        }
        impl JsonSchema for $type {
            fn schema_name() -> Cow<'static, str> {
                stringify!($type).into()
            }
            fn inline_schema() -> bool {
                true
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                Self::schema()
            }
        }
    )+};
}
pub(crate) use schema_by_hand;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_optional_key_may_be_absent_but_not_null() {
        let without_null = |mut schema: Schema| {
            without_null(&mut schema);
            schema.to_value()
        };
        assert_eq!(
            without_null(json_schema!({ "type": ["string", "null"], "enum": ["a", "b", null] })),
            serde_json::json!({ "type": "string", "enum": ["a", "b"] })
        );
        assert_eq!(
            without_null(json_schema!({ "anyOf": [{ "type": "number" }, { "type": "null" }] })),
            serde_json::json!({ "type": "number" })
        );
        let of_key = |choice: Value| json_schema!({ "description": "of the key", "anyOf": [choice, { "type": "null" }] });
        assert_eq!(
            without_null(of_key(serde_json::json!({ "description": "of the type", "oneOf": [true] }))),
            serde_json::json!({ "description": "of the key", "oneOf": [true] })
        );
        let of_two = json_schema!({ "anyOf": [{ "type": "number" }, { "type": "string" }] });
        assert_eq!(without_null(of_two.clone()), of_two.to_value());
    }
}
