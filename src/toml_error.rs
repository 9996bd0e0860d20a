//! Errors of the `toml` crate, with their location and the most similar valid name.

mod syntax;

pub use syntax::syntax;

use crate::error::{Error, or_meant};
use serde_json::{Map, Value};
use std::ops::Range;

/// Returns the part of a message of serde (the library that converts TOML to Rust's types) that states which
/// value was expected; `None` if the message has no such part. The part about the expected value contains no
/// text of the document. A message may therefore contain this part even if the message must not quote the
/// document.
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

/// The keys that have two names. The first name is the name of the Rust type's field; serde's messages use
/// the first name.
const TWO_NAMES: [[&str; 2]; 1] = [["obj", "mesh"]];

/// Names that users may take for the key `mesh`, which names the file of a mesh.
const LIKE_MESH: [&str; 6] = ["ply", "stl", "gltf", "glb", "file", "path"];
/// The beginning of the remedy if a table has a key in [`LIKE_MESH`] instead of the key `mesh`.
const MESH_READS: &str = "`mesh` reads OBJ, PLY, STL, glTF and GLB files; ";

/// The message about a table in place of a list.
pub const NO_LIST: &str = "wrong type: table, expected a list";
/// The message about a list in place of a table.
pub const NO_TABLE: &str = "wrong type: list, expected a table";

/// A mistake in a TOML document, in words for a user.
pub struct Mistake {
    /// The mistake, with the wrong value and the expected value.
    pub message: String,
    /// The text that is printed at the mark under the mistake, such as "not a key here".
    label: String,
    /// The remedy for this particular mistake; `None` if the caller's general remedy applies.
    remedy: Option<String>,
    /// The key, if it is unknown in its table but may be a key of another table.
    unknown_key: Option<String>,
}

impl Mistake {
    /// Returns the remedy for this particular mistake or, if there is none, `otherwise`.
    pub fn remedy<'a>(&'a self, otherwise: &'a str) -> &'a str {
        self.remedy.as_deref().unwrap_or(otherwise)
    }

    /// Returns the mistake at the byte `at` of `text`. The mistake gets a better remedy in three cases: an unknown key
    /// is a key of another table; a list of tables stands in place of a single table; or a single table stands in place
    /// of a list of tables. `schema` is the JSON schema of the file.
    pub fn with_table(mut self, schema: &Value, text: &str, at: usize) -> Self {
        if let Some(key) = self.unknown_key.take()
            && let Some(place) = elsewhere(schema, text, at, &key)
        {
            self.message = format!("unknown key `{key}`");
            self.remedy = self.remedy.map(|keys| format!("{place}; {keys}"));
        }
        self.remedy = other_brackets(&self.message, schema, text, at).or(self.remedy);
        self
    }

    /// Returns the error for the mistake at `span` of a text.
    pub fn in_file(self, name: &str, text: &str, span: Range<usize>, otherwise: &str) -> Error {
        let remedy = self.remedy(otherwise).to_owned();
        Error::in_file(name, text, span, self.message, self.label).with_help(remedy)
    }
}

/// Returns the error for a document that cannot be read, with the location of the mistake. `help` is the remedy
/// if the mistake has none of its own. Common syntax mistakes have their own remedies; for an unknown key or
/// value, the remedy names the valid ones.
pub fn toml_error(name: &str, text: &str, error: &toml::de::Error, help: &str) -> Error {
    mistake(error, text).in_file(name, text, error.span().unwrap_or(0..0), help)
}

/// Converts an error of the crate `toml` about `text` to a mistake in words for a user.
pub fn mistake(error: &toml::de::Error, text: &str) -> Mistake {
    if let Some((message, remedy)) = syntax(error, text) {
        return Mistake { message, label: "here".to_owned(), remedy: Some(remedy), unknown_key: None };
    }
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
                unknown_key: (one == "key" && !is_mesh).then(|| (*key).to_owned()),
            }
        }
        _ => Mistake {
            message: in_plain_words(&message),
            label: "here".to_owned(),
            remedy: None,
            unknown_key: None,
        },
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
        unknown_key: None,
    })
}

/// A table of a file: the line in brackets that begins the table, and the schemas of its keys. For keys that
/// belong to no table (the file's top level), the line is empty.
type TableInFile<'s> = (String, &'s Map<String, Value>);

/// Returns the remedy for an unknown key at the byte `at` of `text`. Returns a remedy only if the key is valid in
/// another table. `schema` is the JSON schema of the file.
pub fn elsewhere(schema: &Value, text: &str, at: usize, key: &str) -> Option<String> {
    let mut tables = Vec::new();
    add_tables(&mut tables, schema, "", String::new());
    let owners = tables.iter().filter(|(_, keys)| keys.contains_key(key));
    let owners: Vec<&str> = owners.map(|(header, _)| header.as_str()).collect();
    match (&owners[..], header_above(text, at, &tables)) {
        ([], _) => None,
        (["", ..], Some(header)) => Some(format!(
            "`{key}` is a key of the top level, but this line belongs to the table {header}: move the line above the \
             first line in brackets"
        )),
        (["", ..], None) => Some(format!("`{key}` is a key of the top level")),
        (owners, _) => Some(format!("`{key}` is a key of {}", owners.join(" and "))),
    }
}

/// Returns the remedy for wrong brackets in the line that contains the byte `at` of `text`. For example, the
/// line is `[light]` where the file needs a list of tables (`[[light]]`), or the line is `[[camera]]` where the
/// file needs a single table (`[camera]`). `message` is the message about the mistake, and `schema` is the JSON
/// schema of the file.
pub fn other_brackets(message: &str, schema: &Value, text: &str, at: usize) -> Option<String> {
    let mut tables = Vec::new();
    add_tables(&mut tables, schema, "", String::new());
    let begin = text.get(..at)?.rfind('\n').map_or(0, |end| end + 1);
    let line = text.get(begin..)?.lines().next()?.split('#').next()?.replace([' ', '\t'], "");
    let (meant, brackets) = match message {
        NO_LIST => (format!("[{line}]"), "double"),
        NO_TABLE => (format!("[{}]", line.strip_prefix("[[")?.strip_suffix("]]")?), "single"),
        _ => return None,
    };
    let is_table = tables.iter().any(|(header, _)| *header == meant);
    is_table.then(|| format!("write {meant} with {brackets} brackets"))
}

/// Adds to `all` the table that `schema` describes, and the tables inside this table. `path` is the table's dotted
/// path, and `header` is the line in brackets that begins the table; both are empty for the top level.
fn add_tables<'s>(all: &mut Vec<TableInFile<'s>>, schema: &'s Value, path: &str, header: String) {
    let Some(keys) = schema["properties"].as_object() else { return };
    all.push((header, keys));
    for (key, value) in keys {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        add_tables(all, value, &path, format!("[{path}]"));
        add_tables(all, &value["items"], &path, format!("[[{path}]]"));
    }
}

/// Finds the table that contains the byte `at` of `text`, and returns the line in brackets that begins this
/// table. Returns `None` if no table contains the byte, or if the byte's line is the line in brackets of a
/// table.
fn header_above<'t>(text: &str, at: usize, tables: &'t [TableInFile<'_>]) -> Option<&'t str> {
    let begin = text.get(..at)?.rfind('\n')? + 1;
    if text.get(begin..)?.trim_start().starts_with('[') {
        return None;
    }
    text.get(..begin)?.lines().rev().find_map(|line| {
        // In a line that begins a table, TOML allows blanks: `[[ object ]]`.
        let line = line.split('#').next().unwrap_or_default().replace([' ', '\t'], "");
        tables.iter().map(|(header, _)| header.as_str()).find(|header| !line.is_empty() && *header == line)
    })
}

/// Returns serde's message, with TOML's words instead of serde's names for types.
pub fn in_plain_words(message: &str) -> String {
    let message = message.replace("invalid type: ", "wrong type: ");
    let Some((actual, expected)) = message.rsplit_once(", expected ") else {
        return match message.as_str() {
            // If a value must be one of several names, but is neither a string nor a table, the message of the
            // crate `toml` is "wanted string or table".
            "wanted string or table" => "wrong type: expected a string".to_owned(),
            // Instead of a string with the name, the crate `toml` also accepts a table with a single key: the
            // key is then the name. For a table with no key or several keys, the message of the crate `toml` is
            // "wanted exactly 1 element".
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

/// Returns words that a user knows for the name of a Rust type; returns any other text unchanged.
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
    fn a_key_in_the_wrong_table_is_answered_with_the_table_that_has_it() {
        let schema = serde_json::json!({ "properties": {
            "devices": {},
            "entry": { "items": { "properties": { "preset": {}, "seed": {} } } },
            "timing": { "properties": { "seed": {}, "inner": { "properties": { "deep": {} } } } },
        } });
        // In each text, the last line begins with the unknown key or, in one text, with a table's name that
        // ends in the unknown key.
        let remedy = |text: &str| {
            let at = text.rfind('\n').map_or(0, |end| end + 1);
            let key = text[at..].split([' ', ']']).next().unwrap_or_default().trim_start_matches('[');
            elsewhere(&schema, text, at, key.rsplit('.').next().unwrap_or_default())
        };
        let top = |table: &str| {
            let belongs = format!("but this line belongs to the table {table}");
            Some(format!(
                "`devices` is a key of the top level, {belongs}: move the line above the first line in brackets"
            ))
        };
        assert_eq!(remedy("[timing] # How long.\nseed = [\n[8]\n]\ndevices = 1"), top("[timing]"));
        assert_eq!(remedy("[timing]\n[[entry]]\npreset = 1\ndevices = 1"), top("[[entry]]"));
        assert_eq!(remedy("[timing]\n[[ entry ]]\ndevices = 1"), top("[[entry]]"));
        assert_eq!(remedy("[timing.inner]\ndevices = 1"), top("[timing.inner]"));
        let of_top = Some("`devices` is a key of the top level".to_owned());
        assert_eq!(remedy("# [timing]\ndevices = 1"), of_top);
        assert_eq!(remedy("[entry]\n[timing.devices]"), of_top);
        assert_eq!(remedy("devices = 1"), of_top);
        assert_eq!(remedy("deep = 1").as_deref(), Some("`deep` is a key of [timing.inner]"));
        assert_eq!(remedy("seed = 1").as_deref(), Some("`seed` is a key of [[entry]] and [timing]"));
        assert_eq!(remedy("[timing]\nfruit = 1"), None);
    }

    #[test]
    fn a_table_in_place_of_a_list_of_tables_or_the_reverse_is_answered_with_the_brackets() {
        let schema = serde_json::json!({ "properties": {
            "entry": { "items": { "properties": { "preset": {} } } },
            "timing": { "properties": { "seed": {} } },
        } });
        let of =
            |message, text: &str| other_brackets(message, &schema, text, text.find('[').unwrap_or_default());
        let remedy = |text: &str| of(NO_LIST, text);
        let double = Some("write [[entry]] with double brackets".to_owned());
        assert_eq!(
            [remedy("[entry]"), remedy("seed = 1\n[entry] # One.\npreset = 1")],
            [double.clone(), double]
        );
        assert_eq!([remedy("[timing]"), remedy("entry = 1"), remedy("[other]")], [None, None, None]);
        let single = Some("write [timing] with single brackets".to_owned());
        assert_eq!(
            [of(NO_TABLE, "[[timing]]"), of(NO_TABLE, "a = 1\n [[ timing ]] # b")],
            [single.clone(), single]
        );
        for text in ["[[entry]]", "[[other]]", "timing = [1]", "timing = [[\n]]", "[]"] {
            assert_eq!(of(NO_TABLE, text), None, "{text}");
        }
        assert_eq!(of("wrong type: string, expected a table", "[[timing]]"), None);
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
