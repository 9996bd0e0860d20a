//! JSON schemas of numbers in ranges, vectors, the background and the names of shapes. These schemas are
//! written by hand, because derived schemas would not state which values raycl allows.

use super::shapes::Shape;
use super::wire::{BackgroundWire, Number, Position, Power, Range, Triple, Vector};
use crate::schema::{names, schema_by_hand};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Value, json};
use std::borrow::Cow;

/// The name of a generated shape.
pub(super) struct ShapeName;

schema_by_hand! {
    ShapeName => names(Shape::NAMES.into_iter());
    Vector => three(json!({ "type": "number" }));
    Position => three(json!({ "type": "number" }));
    BackgroundWire => background();
}

impl<R: Range> JsonSchema for Number<R> {
    fn schema_name() -> Cow<'static, str> {
        R::EXPECTED.into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        number::<R>()
    }
}

impl<R: Range> JsonSchema for Triple<R> {
    fn schema_name() -> Cow<'static, str> {
        format!("one or three: {}", R::EXPECTED).into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [number::<R>(), three(number::<R>().to_value())] })
    }
}

/// Returns the schema of a number in a range.
fn number<R: Range>() -> Schema {
    let mut schema = json_schema!({ "type": "number" });
    if let Value::Object(bounds) = R::bounds() {
        bounds.into_iter().for_each(|(key, value)| drop(schema.insert(key, value)));
    }
    schema
}

fn three(one: Value) -> Schema {
    json_schema!({ "type": "array", "items": one, "minItems": 3, "maxItems": 3 })
}

fn background() -> Schema {
    let colour = "^(#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})|black|white|transparent)$";
    let radiance = number::<Power>();
    json_schema!({ "anyOf": [{ "type": "string", "pattern": colour }, radiance, three(radiance.clone().to_value())] })
}

/// Adds the key `mesh` to an object's schema. The derived schema has only the key's old name, `obj`, which is
/// still allowed.
pub(super) fn both_names_of_mesh(object: &mut Schema) {
    let Some(Value::Object(keys)) = object.get_mut("properties") else { return };
    if let Some(mesh) = keys.get("obj").cloned() {
        keys.insert("mesh".to_owned(), mesh);
    }
}
