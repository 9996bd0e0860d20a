//! Checks the values that raycl reads from extensions of materials. The crate `gltf-json` checks only the values of
//! glTF itself.

use super::Parsed;
use super::materials::extension;
use super::textures::{TRANSFORM, colour_texture, texture_extension, texture_info};
use gltf::json::Root;
use gltf::json::material::Material as Wire;
use serde_json::Value;

/// The valid forms of a value.
#[derive(Clone, Copy)]
enum Form {
    Number,
    /// A number, 0 or more.
    Strength,
    Index,
    /// A list of this many numbers.
    List(usize),
    Texture,
}

/// The extensions of materials that raycl reads, and the keys that it reads of each.
const OF_MATERIALS: [(&str, &[(&str, Form)]); 2] = [
    (
        "KHR_materials_pbrSpecularGlossiness",
        &[("diffuseFactor", Form::List(4)), ("diffuseTexture", Form::Texture)],
    ),
    ("KHR_materials_emissive_strength", &[("emissiveStrength", Form::Strength)]),
];
/// The keys of the extension [`TRANSFORM`].
const OF_TRANSFORMS: [(&str, Form); 4] = [
    ("offset", Form::List(2)),
    ("rotation", Form::Number),
    ("scale", Form::List(2)),
    ("texCoord", Form::Index),
];

impl Form {
    fn fits(self, value: &Value) -> bool {
        match self {
            Self::Number => value.is_number(),
            Self::Strength => value.as_f64().is_some_and(|strength| strength >= 0.0),
            Self::Index => value.as_u64().is_some_and(|index| u32::try_from(index).is_ok()),
            Self::List(count) => {
                value.as_array().is_some_and(|list| list.len() == count && list.iter().all(Value::is_number))
            }
            Self::Texture => texture_info(value).is_some(),
        }
    }

    /// Returns the form in words, for messages.
    fn words(self) -> String {
        match self {
            Self::Number => "a number".to_owned(),
            Self::Strength => "a number, 0 or more".to_owned(),
            Self::Index => "a whole number, 0 or more".to_owned(),
            Self::List(count) => format!("a list of {count} numbers"),
            Self::Texture => "a texture".to_owned(),
        }
    }
}

/// Returns an error if raycl reads a value of a wrong form from an extension. The checked extensions are those of
/// materials, and of the materials' colour textures and emission textures.
pub(super) fn check(root: &Root) -> Parsed<()> {
    root.materials
        .iter()
        .enumerate()
        .try_for_each(|(number, wire)| of_material(wire).map_err(|what| format!("material {number}: {what}")))
}

fn of_material(wire: &Wire) -> Parsed<()> {
    for (name, forms) in OF_MATERIALS {
        extension(wire, name).map_or(Ok(()), |value| of(name, value, forms))?;
    }
    let textures = [colour_texture(wire), wire.emissive_texture.clone()];
    textures.iter().flatten().try_for_each(|info| {
        texture_extension(info).map_or(Ok(()), |value| of(TRANSFORM, value, &OF_TRANSFORMS))
    })
}

/// Checks the values under the keys of the extension `name`.
fn of(name: &str, extension: &Value, forms: &[(&str, Form)]) -> Parsed<()> {
    if !extension.is_object() {
        return Err(format!("{name} is not an object"));
    }
    let wrong = forms.iter().find(|(key, form)| extension.get(key).is_some_and(|value| !form.fits(value)));
    wrong.map_or(Ok(()), |(key, form)| Err(format!("{key} of {name} is not {}", form.words())))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn checked(material: &str) -> Parsed<()> {
        let text = format!(r#"{{"asset": {{"version": "2.0"}}, "materials": [{{}}, {material}]}}"#);
        check(&serde_json::from_str(&text).unwrap())
    }

    #[test]
    fn values_of_a_wrong_form_are_refused_by_their_key() {
        let of_material =
            |name: &str, values: &str| checked(&format!(r#"{{"extensions": {{"{name}": {values}}}}}"#));
        let of_texture = |values: &str| {
            let info = format!(r#"{{"index": 0, "extensions": {{"{TRANSFORM}": {values}}}}}"#);
            checked(&format!(r#"{{"emissiveTexture": {info}}}"#))
        };
        let pair = "is not a list of 2 numbers";
        for (values, key, what) in [
            (r#"{"scale": 2}"#, "scale", pair),
            (r#"{"scale": ["2", 2]}"#, "scale", pair),
            (r#"{"scale": [2]}"#, "scale", pair),
            (r#"{"offset": [null, 0.5]}"#, "offset", pair),
            (r#"{"rotation": "1"}"#, "rotation", "is not a number"),
            (r#"{"texCoord": -1}"#, "texCoord", "is not a whole number, 0 or more"),
            (r#"{"texCoord": 1.5}"#, "texCoord", "is not a whole number, 0 or more"),
            (r#"{"texCoord": 4294967296}"#, "texCoord", "is not a whole number, 0 or more"),
        ] {
            let expected = format!("material 1: {key} of KHR_texture_transform {what}");
            assert_eq!(of_texture(values), Err(expected), "{values}");
        }
        assert_eq!(of_texture("5"), Err("material 1: KHR_texture_transform is not an object".to_owned()));
        let texture = "is not a texture";
        for (name, values, key, what) in [
            (
                "pbrSpecularGlossiness",
                r#"{"diffuseFactor": "red"}"#,
                "diffuseFactor",
                "is not a list of 4 numbers",
            ),
            ("pbrSpecularGlossiness", r#"{"diffuseTexture": {"index": "0"}}"#, "diffuseTexture", texture),
            (
                "emissive_strength",
                r#"{"emissiveStrength": -3}"#,
                "emissiveStrength",
                "is not a number, 0 or more",
            ),
        ] {
            let name = format!("KHR_materials_{name}");
            let expected = format!("material 1: {key} of {name} {what}");
            assert_eq!(of_material(&name, values), Err(expected), "{values}");
        }
    }

    #[test]
    fn valid_values_and_absent_ones_pass() {
        let transform = r#"{"offset": [0, 0.5], "rotation": -1, "scale": [2, 2e9], "texCoord": 1}"#;
        let info = |values: &str| format!(r#"{{"index": 0, "extensions": {{"{TRANSFORM}": {values}}}}}"#);
        let older = format!(r#"{{"diffuseFactor": [1, 0, 0, 1], "diffuseTexture": {}}}"#, info(transform));
        for extensions in [
            format!(r#"{{"KHR_materials_pbrSpecularGlossiness": {older}}}"#),
            r#"{"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": {"index": 0, "extras": 5}}}"#
                .to_owned(),
            r#"{"KHR_materials_emissive_strength": {"emissiveStrength": 0}}"#.to_owned(),
            r#"{"KHR_materials_emissive_strength": {}, "KHR_materials_clearcoat": 5}"#.to_owned(),
        ] {
            let emissive = info("{}");
            let material = format!(r#"{{"extensions": {extensions}, "emissiveTexture": {emissive}}}"#);
            assert_eq!(checked(&material), Ok(()), "{material}");
        }
    }
}
