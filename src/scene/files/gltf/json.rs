//! Reads the JSON of a glTF file. raycl does not use names, `extras` and the contents of animations, so these need not
//! be valid glTF.

use super::locals::{self, Local};
use super::{Flaw, Named, Result, quoted};
use crate::error::Error;
use gltf::json::Root;
use serde_json::{Map, Value, json};

/// The JSON of a file.
pub(super) struct Read {
    pub root: Root,
    /// The transforms of all nodes, in double precision.
    pub locals: Vec<Local>,
    /// The number of animations, which raycl does not use.
    pub animations: usize,
}

/// Reads JSON. If the crate `gltf-json` refuses the JSON, the JSON is read again without animations, names and
/// `extras`. `gltf-json` refuses some valid files, such as files with animations without a node
/// (`KHR_animation_pointer`), with scenes without nodes, or with `extras` that are single numbers.
pub(super) fn read(named: Named<'_>, json: &[u8]) -> Result<Read> {
    let read = match serde_json::from_slice::<Root>(json) {
        Ok(root) => Ok((root.animations.len(), root)),
        Err(error) => tidied(json).ok_or(error),
    };
    let whole =
        read.and_then(|(animations, root)| Ok(Read { root, locals: locals::read(json)?, animations }));
    whole.map_err(|error| misread(named, json, &error))
}

/// Returns a note if the file states a version other than 2 or 2.x, or if it needs another version
/// than 2.0. The note quotes the version only if `quotes` is true.
pub(super) fn note_version(root: &Root, quotes: bool) -> Option<String> {
    let needed = root.asset.min_version.as_ref().filter(|needed| *needed != "2.0");
    let stated = Some(&root.asset.version).filter(|stated| !is_version_2(stated));
    let version = needed.or(stated)?;
    let named =
        if quotes { format!("version {}", quoted(version.as_bytes())) } else { "another version".to_owned() };
    Some(format!("the file asks for {named} of glTF, but is read as version 2.0"))
}

fn is_version_2(version: &str) -> bool {
    version == "2" || version.starts_with("2.")
}

/// Reads the JSON without animations, names and `extras`, which raycl does not use. Adds empty `nodes` and `attributes`
/// where they are missing, because `gltf-json` demands them. Returns the number of animations and the resulting JSON;
/// `None` if `gltf-json` refuses this JSON.
fn tidied(json: &[u8]) -> Option<(usize, Root)> {
    let mut value: Value = serde_json::from_slice(json).ok()?;
    let version = &value["asset"]["version"];
    if !version.as_str().is_some_and(is_version_2) {
        return None;
    }
    let top = value.as_object_mut()?;
    let animations = top.remove("animations");
    let animations = match animations {
        Some(Value::Array(list)) => list.len(),
        Some(_) => return None,
        None => 0,
    };
    complete(top, "scenes", "nodes", &json!([]));
    for mesh in objects(top, "meshes") {
        complete(mesh, "primitives", "attributes", &json!({}));
    }
    strip(&mut value);
    Some((animations, serde_json::from_value(value).ok()?))
}

/// Returns the objects in the list that `of` has under the key `list`.
fn objects<'a>(
    of: &'a mut Map<String, Value>,
    list: &str,
) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    let list = of.get_mut(list).and_then(Value::as_array_mut);
    list.into_iter().flatten().filter_map(Value::as_object_mut)
}

/// Adds the key `key` with the value `usual` to each object that does not have this key. `list` is the key of
/// the list of objects in `of`.
fn complete(of: &mut Map<String, Value>, list: &str, key: &str, usual: &Value) {
    for object in objects(of, list) {
        object.entry(key).or_insert_with(|| usual.clone());
    }
}

/// Removes names and application-specific data (`extras`) from a value and from all values in it.
pub(super) fn strip(value: &mut Value) {
    match value {
        Value::Object(object) => {
            object.remove("extras");
            object.remove("name");
            object.values_mut().for_each(strip);
        }
        Value::Array(list) => list.iter_mut().for_each(strip),
        _ => {}
    }
}

/// The help in the error about a file of another version than glTF 2.0.
const CONVERT: &str =
    "export the file as glTF 2.0; `gltf-pipeline -i OLD.gltf -o NEW.gltf` converts version 1.0";

/// The help in the error about a list that is too long.
const SHORTEN: &str = "leave out the surplus numbers, or export the file again";

/// Returns the error for text that is not valid glTF 2.0.
fn misread(named: Named<'_>, json: &[u8], error: &serde_json::Error) -> Error {
    let value = serde_json::from_slice::<Value>(json).ok();
    let is_json = value.is_some();
    let version = value.and_then(|value| match &value["asset"]["version"] {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        // In glTF 1.0, a file need not state its version, and has objects where glTF 2.0 has lists.
        _ => value["meshes"].is_object().then(|| "1.0".to_owned()),
    });
    match version {
        Some(version) if !is_version_2(&version) => {
            let text = |version: &str| {
                format!("raycl does not read glTF of {version}; expected version 2.0 or another 2.x")
            };
            let quoting = text(&format!("version {}", quoted(version.as_bytes())));
            named.error(Flaw::quoting(quoting, text("this version"))).with_help(CONVERT)
        }
        _ => {
            let message = error.to_string();
            // The line number at the end of the message is removed, since the error's location contains it.
            let what = message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what);
            let invalid = "not valid glTF 2.0";
            let flaw = |what: &str| Flaw::quoting(format!("{invalid}: {what}"), invalid).at(error.line());
            // If the JSON is valid, this message means that a list goes on where `gltf-json` expects the list's end.
            named.error(match what {
                "trailing characters" if is_json => {
                    flaw("a list has more numbers than glTF allows").with_remedy(SHORTEN)
                }
                _ => flaw(&plain(what)),
            })
        }
    }
}

/// Returns a message of `serde_json` with plain words instead of the names of Rust's types.
fn plain(message: &str) -> String {
    let Some((found, expected)) = message.rsplit_once(", expected ") else { return message.to_owned() };
    let expected = match expected {
        "index into child of root" | "u32" | "u64" => "a whole number, 0 or more",
        "f32" => "a number",
        _ if expected.starts_with("struct ") => "an object",
        other => other,
    };
    format!("{found}, expected {expected}")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_not_valid_is_reported_without_types_of_rust() {
        for (keys, expected) in [
            (r#""scene": 0.0"#, "invalid type: floating point `0.0`, expected a whole number, 0 or more"),
            (r#""scene": -1"#, "invalid type: integer `-1`, expected a whole number, 0 or more"),
            (
                r#""buffers": [{"byteLength": 1.5}]"#,
                "invalid type: floating point `1.5`, expected a whole number, 0 or more",
            ),
            (r#""materials": [{"alphaCutoff": true}]"#, "invalid type: boolean `true`, expected a number"),
            (r#""buffers": [7]"#, "invalid type: integer `7`, expected an object"),
        ] {
            let json = format!("{{\"asset\": {{\"version\": \"2.0\"}}, {keys}}}");
            let error = read(Named { name: "a.gltf", quotes: true }, json.as_bytes()).err().unwrap();
            assert_eq!(error.to_string(), format!("a.gltf:1: not valid glTF 2.0: {expected}"));
        }
    }

    #[test]
    fn a_list_that_is_too_long_is_not_called_damaged() {
        let error_of = |materials: &str| {
            let json = format!("{{\"asset\": {{\"version\": \"2.0\"}}, \"materials\": {materials}}}");
            read(Named { name: "a.gltf", quotes: true }, json.as_bytes()).err().unwrap()
        };
        let error = error_of(r#"[{"emissiveFactor": [1, 1, 1, 1]}]"#);
        let expected = "a.gltf:1: not valid glTF 2.0: a list has more numbers than glTF allows";
        assert_eq!((error.to_string().as_str(), error.remedy()), (expected, SHORTEN));
        let error = error_of("[]}");
        assert_eq!(error.to_string(), "a.gltf:1: not valid glTF 2.0: trailing characters");
        assert_ne!(error.remedy(), SHORTEN);
    }

    #[test]
    fn a_version_that_raycl_does_not_read_is_noted() {
        let note = |asset: &str, quotes| {
            let json = format!("{{\"asset\": {{{asset}}}}}");
            let root = read(Named { name: "a.gltf", quotes }, json.as_bytes()).unwrap().root;
            note_version(&root, quotes)
        };
        for valid in
            [r#""version": "2.0""#, r#""version": "2.1""#, r#""version": "2.1", "minVersion": "2.0""#]
        {
            assert_eq!(note(valid, true), None, "{valid}");
        }
        for (asset, version) in [
            (r#""version": "1.0""#, "version `1.0`"),
            (r#""version": "3.0""#, "version `3.0`"),
            (r#""version": "20.5""#, "version `20.5`"),
            (r#""version": "2.1", "minVersion": "2.1""#, "version `2.1`"),
        ] {
            let expected = |version: &str| {
                Some(format!("the file asks for {version} of glTF, but is read as version 2.0"))
            };
            assert_eq!(note(asset, true), expected(version));
            assert_eq!(note(asset, false), expected("another version"));
        }
    }

    #[test]
    fn animations_are_counted_in_either_way_of_reading() {
        let count = |animations: &str| {
            let json = format!("{{\"asset\": {{\"version\": \"2.0\"}}, \"animations\": {animations}}}");
            read(Named { name: "a.gltf", quotes: true }, json.as_bytes()).unwrap().animations
        };
        let valid = "{\"channels\": [], \"samplers\": []}";
        // The third file has three animations without channels. `gltf-json` refuses such animations, so the
        // file is read without the contents of its animations.
        assert_eq!([count("[]"), count(&format!("[{valid}, {valid}]")), count("[{}, {}, {}]")], [0, 2, 3]);
        let table = r#"{"asset": {"version": "2.0"}, "animations": {"a": 1}}"#;
        let error = read(Named { name: "a.gltf", quotes: true }, table.as_bytes()).err().unwrap();
        assert!(error.to_string().contains("invalid type: map, expected a sequence"), "{error}");
    }
}
