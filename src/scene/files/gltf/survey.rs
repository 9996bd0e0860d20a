//! Looks through the JSON of a glTF file for things that the crate `gltf-json` does not report: keys that occur twice
//! in an object, the names of the extensions that parts of the file have, and keys and names of attributes that glTF
//! does not define.

use super::kinds::{self, Kind};
use super::{Flaw, Named, Result, quoted};
use crate::words::{counted_are, first};
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde::de::value::{Error as NoError, StrDeserializer};
use serde::de::{
    DeserializeSeed, Deserializer, Error as _, IgnoredAny, IntoDeserializer, MapAccess, SeqAccess, Visitor,
};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Formatter};

/// Largest number of attributes or keys that a note names.
const MOST_LISTED: usize = 8;

/// Keys whose values are skipped. Applications may store anything in `extras`. The values of the other keys contain no
/// objects, and are most of the text of a large file.
const SKIPPED: [&str; 9] =
    ["extras", "uri", "children", "matrix", "max", "min", "rotation", "scale", "translation"];

/// The reason for which raycl refuses a key, and the remedy.
#[derive(Clone, Copy)]
struct Refusal {
    why: &'static str,
    remedy: &'static str,
}

const REPEATED: Refusal =
    Refusal { why: "occurs twice in the same object", remedy: "remove one of the two keys, or rename it" };
const ODD_NUMBER: Refusal = Refusal {
    why: "has a zero or a sign before its number",
    remedy: "rename the attribute, for example from COLOR_00 to COLOR_0",
};

/// What raycl found in the JSON.
#[derive(Default)]
pub(super) struct Survey {
    /// The names of the extensions that parts of the file have, with the number of objects that have them.
    pub extensions: BTreeMap<String, usize>,
    /// The names of the extensions in objects of kinds to which they do not belong (see [`Kind::takes`]), with the
    /// names of these kinds, and with the number of such objects.
    pub misplaced: BTreeMap<(String, &'static str), usize>,
    /// For each key that glTF does not define, words on its place (and perhaps on the key that is meant), with the
    /// number of objects that have the key.
    unknown: BTreeMap<String, usize>,
    /// The names of attributes that glTF does not define, with the number of primitives that have them. Names that
    /// begin with `_` are left out, because applications may choose such names.
    attributes: BTreeMap<String, usize>,
    /// The first key that raycl refuses.
    refused: Option<(String, Refusal)>,
}

impl Survey {
    /// Looks through `json`. Returns an error if a key occurs twice in an object: then raycl would have to ignore one
    /// of its values. The function also refuses an attribute's name if `gltf-json` takes it for the name of another
    /// attribute. JSON that is not valid is no error here, because [`super::json::read`] reports it.
    pub fn of(named: Named<'_>, json: &[u8]) -> Result<Self> {
        let mut survey = Self::default();
        let walk = Walk { survey: &mut survey, keys: Keys::Of(&kinds::FILE) };
        let walked = walk.deserialize(&mut serde_json::Deserializer::from_slice(json));
        match (walked, &survey.refused) {
            (Err(error), Some((key, Refusal { why, remedy }))) => {
                let text = |key: &str| format!("{key} {why}");
                let quoting = text(&format!("the key {}", quoted(key.as_bytes())));
                let flaw = Flaw::quoting(quoting, text("a key")).at(error.line());
                Err(named.error(flaw.with_remedy(remedy)))
            }
            _ => Ok(survey),
        }
    }

    /// Returns notes on keys and attributes with names that glTF does not define. The notes contain these names only if
    /// `quotes` is true.
    pub fn notes(&self, quotes: bool) -> impl Iterator<Item = String> {
        let attributes =
            self.attributes.iter().map(|(name, count)| (quoted(name.as_bytes()), *count)).collect();
        let kinds = [
            (attributes, "attribute with a name that glTF does not define"),
            (self.unknown.clone(), "key that glTF does not define"),
        ];
        let note = |(counts, what): (BTreeMap<String, usize>, _)| {
            let names: Vec<_> = counts.keys().collect();
            let listed = if quotes { format!(": {}", first(&names, MOST_LISTED)) } else { String::new() };
            let count = counts.values().sum();
            (count > 0).then(|| format!("{} ignored{listed}", counted_are(count, what)))
        };
        kinds.map(note).into_iter().flatten()
    }
}

/// A key of an object. The key is only copied if it contains escapes.
#[derive(Clone, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
struct Key<'a>(#[serde(borrow)] Cow<'a, str>);

/// The meaning of the keys of an object.
#[derive(Clone, Copy)]
enum Keys {
    /// The keys are those of this kind of object.
    Of(&'static Kind),
    /// The keys are names of extensions of an object. The object has this kind, if its kind is known.
    Extensions(Option<&'static Kind>),
    /// The keys are names of a primitive's attributes.
    Attributes,
    /// The keys are those of an object of an unknown kind, such as an object in an extension that raycl does not read.
    Others,
}

impl Keys {
    /// Returns the meaning of the keys of the object under `key`, or of the objects in a list under `key`.
    fn below(self, key: &str) -> Self {
        let of = |kind: Option<_>| kind.map_or(Self::Others, Self::Of);
        match self {
            Self::Extensions(kind) => of(kind.and_then(|kind| kind.extension(key))),
            Self::Of(kind) if key == "extensions" => Self::Extensions(Some(kind)),
            Self::Of(kind) if key == "attributes" && kind.has(key) => Self::Attributes,
            Self::Of(kind) => of(kind.part(key)),
            _ if key == "extensions" => Self::Extensions(None),
            _ => Self::Others,
        }
    }
}

/// Looks through a value and all values in it. If the value is an object, `keys` is the meaning of its keys. If the
/// value is a list, `keys` is the meaning of the keys of the objects in the list.
struct Walk<'s> {
    survey: &'s mut Survey,
    keys: Keys,
}

impl Walk<'_> {
    /// Adds a key of an object, if the survey needs it. The object has no earlier key of the same name.
    fn add(&mut self, key: &str) {
        match self.keys {
            Keys::Extensions(kind) => {
                // The file's own object only defines what its parts use.
                let is_of_file = kind.is_some_and(|kind| std::ptr::eq(kind, &kinds::FILE));
                *self.survey.extensions.entry(key.to_owned()).or_default() += usize::from(!is_of_file);
                if let Some(kind) = kind.filter(|kind| !kind.takes(key)) {
                    *self.survey.misplaced.entry((key.to_owned(), kind.name)).or_default() += 1;
                }
            }
            Keys::Of(kind) if !kind.has(key) => {
                let place = format!("{} in {}{}", quoted(key.as_bytes()), kind.name, kind.meant(key));
                *self.survey.unknown.entry(place).or_default() += 1;
            }
            Keys::Attributes if !key.starts_with('_') && !is_attribute(key) => {
                *self.survey.attributes.entry(key.to_owned()).or_default() += 1;
            }
            _ => {}
        }
    }
}

impl<'de> DeserializeSeed<'de> for Walk<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> std::result::Result<(), D::Error> {
        value.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Walk<'_> {
    type Value = ();

    fn expecting(&self, text: &mut Formatter<'_>) -> fmt::Result {
        text.write_str("any value")
    }

    fn visit_unit<E>(self) -> std::result::Result<(), E> {
        Ok(())
    }

    fn visit_bool<E>(self, _: bool) -> std::result::Result<(), E> {
        Ok(())
    }

    fn visit_u64<E>(self, _: u64) -> std::result::Result<(), E> {
        Ok(())
    }

    fn visit_i64<E>(self, _: i64) -> std::result::Result<(), E> {
        Ok(())
    }

    fn visit_f64<E>(self, _: f64) -> std::result::Result<(), E> {
        Ok(())
    }

    fn visit_str<E>(self, _: &str) -> std::result::Result<(), E> {
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> std::result::Result<(), A::Error> {
        while list.next_element_seed(Walk { survey: self.survey, keys: self.keys })?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut object: A) -> std::result::Result<(), A::Error> {
        let mut known = BTreeSet::new();
        while let Some(key) = object.next_key::<Key<'de>>()? {
            let refused = if !known.insert(key.clone()) {
                Some(REPEATED)
            } else if matches!(self.keys, Keys::Attributes) && is_odd_number(&key.0) {
                Some(ODD_NUMBER)
            } else {
                None
            };
            if let Some(refusal) = refused {
                self.survey.refused = Some((key.0.into_owned(), refusal));
                return Err(A::Error::custom(refusal.why));
            }
            self.add(&key.0);
            let keys = self.keys.below(&key.0);
            match &*key.0 {
                key if SKIPPED.contains(&key) => object.next_value::<IgnoredAny>().map(|_| ())?,
                _ => object.next_value_seed(Walk { survey: self.survey, keys })?,
            }
        }
        Ok(())
    }
}

/// Returns true if `gltf-json` takes this name for that of another attribute: `COLOR_00` and `COLOR_+0` for `COLOR_0`.
fn is_odd_number(name: &str) -> bool {
    let number = name.rsplit_once('_').map_or("", |(_, number)| number);
    let is_odd = number.starts_with('+') || number.len() > 1 && number.starts_with('0');
    is_odd && is_attribute(name)
}

/// Returns true if glTF defines an attribute with this name, or with this name without zeros and signs before its
/// number.
fn is_attribute(name: &str) -> bool {
    let name: StrDeserializer<'_, NoError> = name.into_deserializer();
    matches!(Checked::<Semantic>::deserialize(name), Ok(Checked::Valid(_)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn survey(json: &str) -> Result<Survey> {
        Survey::of(Named { name: "a.gltf", quotes: true }, json.as_bytes())
    }

    fn notes(json: &str, quotes: bool) -> Vec<String> {
        survey(json).unwrap().notes(quotes).collect()
    }

    #[test]
    fn a_key_that_occurs_twice_in_an_object_is_refused_wherever_the_object_is() {
        for (json, key) in [
            (r#"{"nodes": [], "nodes": []}"#, "nodes"),
            ("{\"nodes\": [{\"scale\": 1,\n\"scale\": 1}]}", "scale"),
            (r#"{"attributes": {"POSITION": 0, "POSITION": 3}}"#, "POSITION"),
            (r#"{"extensions": {"KHR_a": {"scale": 1, "sc\u0061le": 1}}}"#, "scale"),
        ] {
            let error = survey(json).err().unwrap().to_string();
            let line = 1 + json.matches('\n').count();
            assert_eq!(error, format!("a.gltf:{line}: the key `{key}` occurs twice in the same object"));
        }
        let with = |name: &str| {
            format!(r#"{{"meshes": [{{"primitives": [{{"attributes": {{"COLOR_0": 1, "{name}": 0}}}}]}}]}}"#)
        };
        for name in ["COLOR_00", "COLOR_+0", "TEXCOORD_01"] {
            let error = survey(&with(name)).err().unwrap();
            let expected = format!("a.gltf:1: the key `{name}` has a zero or a sign before its number");
            assert_eq!((error.to_string(), error.remedy()), (expected, ODD_NUMBER.remedy));
        }
        for name in ["TEXCOORD_0", "TEXCOORD_10", "_COLOR_00", "POSITION"] {
            assert!(survey(&with(name)).is_ok(), "{name}");
        }
        let others = Survey::of(Named { name: "a.gltf", quotes: false }, br#"{"secret": 1, "secret": 2}"#);
        assert_eq!(others.err().unwrap().to_string(), "a.gltf:1: a key occurs twice in the same object");
        for valid in
            [r#"[{"a": {"a": 0}}, {"a": null}]"#, r#"{"extras": {"a": 1, "a": 2}}"#, "{", "{\"a\": 1,"]
        {
            assert!(survey(valid).is_ok(), "{valid}");
        }
    }

    #[test]
    fn extensions_are_found_in_all_objects_but_not_in_extras() {
        let json = r#"{"extensions": {"A": {"extensions": {"B": {}}}}, "nodes": [{"extensions": {"C": 1, "A": 2}}],
"extras": {"extensions": {"D": {}}}, "extensionsUsed": ["E"]}"#;
        let names: Vec<_> = survey(json).unwrap().extensions.into_iter().collect();
        assert_eq!(names, [("A".to_owned(), 1), ("B".to_owned(), 1), ("C".to_owned(), 1)]);
    }

    #[test]
    fn attributes_are_noted_if_neither_gltf_nor_an_application_defines_them() {
        let note = |names: &[&str], quotes| {
            let keys = names.iter().map(|name| format!("\"{name}\": 0")).collect::<Vec<_>>().join(", ");
            let primitives = format!("[{{\"attributes\": {{{keys}}}}}, {{\"attributes\": {{{keys}}}}}]");
            notes(&format!("{{\"meshes\": [{{\"primitives\": {primitives}}}]}}"), quotes)
        };
        assert_eq!(note(&["POSITION", "COLOR_7", "TANGENT", "_COLOR"], true), [""; 0]);
        let expected = "4 attributes with a name that glTF does not define are ignored";
        assert_eq!(note(&["COLOR", "Normal"], true), [format!("{expected}: `COLOR`, `Normal`")]);
        assert_eq!(note(&["COLOR", "Normal"], false), [expected]);
        // This extension has attributes of its own.
        let instances = r#"{"extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}}"#;
        assert_eq!(notes(&format!("{{\"nodes\": [{instances}]}}"), true), [""; 0]);
    }

    #[test]
    fn keys_that_gltf_does_not_define_are_noted_with_their_places() {
        let json = r#"{"lights": [], "material": [], "materials": [{"baseColorFactor": [1, 0, 0, 1], "Name": "a",
"pbrMetallicRoughness": {"metalicFactor": 0, "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"ofset": 1}}}}}],
"nodes": [{"position": [1, 2, 3]}, {"position": [1, 2, 3], "extras": {"light": 1}, "extensions": {"EXT_a": {"b": {"c": 1}}}}]}"#;
        let expected = "8 keys that glTF does not define are ignored";
        let names = "`Name` in a material (did you mean `name`?), `baseColorFactor` in a material (a key of \
                     `pbrMetallicRoughness`), `lights` in the file (a key of `KHR_lights_punctual`), `material` in the \
                     file (did you mean `materials`?), `metalicFactor` in pbrMetallicRoughness (did you mean \
                     `metallicFactor`?), `ofset` in KHR_texture_transform (did you mean `offset`?), `position` in a node";
        assert_eq!(notes(json, true), [format!("{expected}: {names}")]);
        assert_eq!(notes(json, false), [expected]);
        // glTF defines no name for primitives, but exporters write one.
        assert_eq!(notes(r#"{"meshes": [{"primitives": [{"name": "a"}]}]}"#, true), [""; 0]);
    }

    #[test]
    fn the_places_of_extensions_are_known() {
        let json = r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"spot": {}}]}, "KHR_materials_ior": {}},
"nodes": [{"extensions": {"KHR_lights_punctual": {"light": 0}}}],
"materials": [{"extensions": {"KHR_materials_ior": {}, "KHR_materials_clearcoat":
{"clearcoatTexture": {"extensions": {"KHR_texture_transform": {}}}}}, "normalTexture": {"extensions": {"KHR_texture_transform": {}}}}],
"textures": [{"extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}]}"#;
        let misplaced: Vec<_> = survey(json).unwrap().misplaced.into_iter().collect();
        let at = |name: &str, place| ((name.to_owned(), place), 1);
        assert_eq!(
            misplaced,
            [at("KHR_materials_ior", "the file"), at("KHR_texture_transform", "a texture")]
        );
    }
}
