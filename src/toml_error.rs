//! Errors of the `toml` crate, with their location and the most similar valid name.

use crate::error::{Error, or_meant};
use std::ops::Range;

/// Returns the part of a message of serde (the library that converts TOML to Rust's types) that states which
/// value was expected; `None` if the message has no such part. This part quotes nothing of the document, so
/// even a message that must not quote the document may contain this part.
pub fn expectation(error: &toml::de::Error) -> Option<&str> {
    let message = error.message();
    let kinds =
        ["invalid type: ", "invalid value: ", "invalid length ", "unknown field ", "unknown variant "];
    let has_expectation = kinds.iter().any(|start| message.starts_with(start));
    has_expectation
        .then(|| message.rsplit_once(", expected "))
        .flatten()
        .map(|(_, expected)| type_in_words(expected.trim_end()))
}

/// The keys that have two names. The first name is that of the Rust type's field; serde's messages use this
/// name.
const TWO_NAMES: [[&str; 2]; 1] = [["obj", "mesh"]];

/// Names that users may take for the key `mesh`, which names the file of a mesh.
const LIKE_MESH: [&str; 6] = ["ply", "stl", "gltf", "glb", "file", "path"];
/// The beginning of the remedy if a table has one of these names instead of `mesh`.
const MESH_READS: &str = "`mesh` reads OBJ, PLY, STL, glTF and GLB files; ";

/// A mistake in a document, in words for a user.
pub struct Mistake {
    /// The mistake, with the wrong value and the expected one.
    pub message: String,
    /// The text that is printed at the mark under the mistake, such as "not a key here".
    label: String,
    /// The remedy, if the mistake has its own.
    remedy: Option<String>,
}

impl Mistake {
    /// Returns the remedy: the valid names if a key or a value is unknown, and `otherwise` for other mistakes.
    pub fn remedy<'a>(&'a self, otherwise: &'a str) -> &'a str {
        self.remedy.as_deref().unwrap_or(otherwise)
    }

    /// Returns the error for the mistake at `span` of a text.
    pub fn in_file(self, name: &str, text: &str, span: Range<usize>, otherwise: &str) -> Error {
        let remedy = self.remedy(otherwise).to_owned();
        Error::in_file(name, text, span, self.message, self.label).with_help(remedy)
    }
}

/// Returns the error for a document that cannot be parsed, with the location of the mistake. `help` is the remedy
/// unless a key or a value is unknown.
pub fn toml_error(name: &str, text: &str, error: &toml::de::Error, help: &str) -> Error {
    mistake(error).in_file(name, text, error.span().unwrap_or(0..0), help)
}

/// Returns the mistake in words for a user.
pub fn mistake(error: &toml::de::Error) -> Mistake {
    let message = error.message().trim_end().to_owned();
    if let Some(mistake) = both_names(&message) {
        return mistake;
    }
    // serde's message about an unknown key is: unknown field `a`, expected one of `b`, `c`. serde's message about an
    // unknown value begins with: unknown variant `a`, expected ...
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let what = [("unknown field", "key", "keys"), ("unknown variant", "value", "values")]
        .into_iter()
        .find(|(start, ..)| message.starts_with(start));
    match (&quoted[..], what) {
        ([key, known @ ..], Some((_, one, all))) => {
            let is_mesh = known.contains(&"mesh") && LIKE_MESH.contains(&key.to_lowercase().as_str());
            let (suggestion, about) = match is_mesh {
                true => ("; did you mean `mesh`?".to_owned(), MESH_READS),
                false => (or_meant(key, known.iter().copied()), ""),
            };
            Mistake {
                message: format!("unknown {one} `{key}`{suggestion}"),
                label: format!("not a {one} here"),
                remedy: Some(format!("{about}the valid {all} here are {}", known.join(", "))),
            }
        }
        _ => Mistake { message: in_plain_words(&message), label: "here".to_owned(), remedy: None },
    }
}

/// Returns the mistake if serde's message says that a table sets a key by both of its names; `None` for any
/// other message. (A table that repeats one name is not TOML, and causes another message.)
fn both_names(message: &str) -> Option<Mistake> {
    let field = message.strip_prefix("duplicate field `")?.strip_suffix('`')?;
    let [_, name] = TWO_NAMES.into_iter().find(|[known, _]| *known == field)?;
    Some(Mistake {
        message: format!("both `{name}` and `{field}` are set"),
        label: "in this table".to_owned(),
        remedy: Some(format!("set only one of them: `{field}` is another name of `{name}`")),
    })
}

/// Returns serde's message, with TOML's words instead of serde's names for types.
pub fn in_plain_words(message: &str) -> String {
    let message = message.replace("invalid type: ", "wrong type: ");
    let Some((actual, expected)) = message.rsplit_once(", expected ") else {
        return match message.as_str() {
            // These are the words of the crate `toml` if it expects one of several names.
            "wanted string or table" => "wrong type: expected a string".to_owned(),
            // Instead of a string, the crate `toml` also accepts a table with a single key, which it takes as
            // the name. For a table with no key or several keys, the crate sends this message.
            _ if message.starts_with("wanted exactly 1 element") => {
                "wrong type: table, expected a string".to_owned()
            }
            _ => message,
        };
    };
    let actual = match actual {
        "wrong type: sequence" => "wrong type: list",
        "wrong type: map" => "wrong type: table",
        other => other,
    };
    format!("{actual}, expected {}", type_in_words(expected))
}

/// Returns words for the name of a Rust type; returns any other text unchanged.
fn type_in_words(name: &str) -> &str {
    match name {
        // serde writes the name of a Rust type after `struct`.
        _ if name.starts_with("struct ") => "a table",
        "a map" => "a table",
        "f32" | "f64" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "usize" => "a whole number of at least 0",
        "i64" => "a whole number",
        "a sequence" => "a list",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_is_set_by_both_of_its_names_is_reported_with_both() {
        let both = both_names("duplicate field `obj`").expect("a mistake");
        assert_eq!(both.message, "both `mesh` and `obj` are set");
        assert_eq!(both.remedy("no other"), "set only one of them: `obj` is another name of `mesh`");
        assert!(both_names("duplicate field `power`").is_none() && both_names("duplicate key").is_none());
    }

    #[test]
    fn messages_name_no_types_of_rust() {
        let plain = in_plain_words("invalid type: integer `3`, expected struct SkyWire");
        assert_eq!(plain, "wrong type: integer `3`, expected a table");
        let list = in_plain_words("invalid type: integer `3`, expected a sequence");
        assert_eq!(list, "wrong type: integer `3`, expected a list");
        let inner = in_plain_words("invalid type: sequence, expected struct SkyWire");
        assert_eq!(inner, "wrong type: list, expected a table");
        assert_eq!(
            in_plain_words("invalid type: map, expected a boolean"),
            "wrong type: table, expected a boolean"
        );
        assert_eq!(
            in_plain_words("invalid type: integer `3`, expected a map"),
            "wrong type: integer `3`, expected a table"
        );
        assert_eq!(in_plain_words("wanted string or table"), "wrong type: expected a string");
        for found in ["found 0 elements", "more than 1 element"] {
            let table = in_plain_words(&format!("wanted exactly 1 element, {found}"));
            assert_eq!(table, "wrong type: table, expected a string");
        }
        assert_eq!(
            in_plain_words("invalid type: string \"a\", expected f64"),
            "wrong type: string \"a\", expected a number"
        );
    }
}
