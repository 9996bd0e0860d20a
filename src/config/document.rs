//! The text of a config, with the `--set` values merged into it, and the locations of mistakes in both.

use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::de::{DeArray, DeTable, DeValue, Deserializer};
use toml::{Spanned, Value};

use crate::error::{Error, Result, line_of, nearest};
use crate::filetype::Wanted;

/// The default remedy for a mistake.
const KEYS: &str =
    "docs/experiments.md lists every key of an experiment, and configs/quick.toml is an example";
/// Keys that were renamed: the old name and the new one.
const RENAMED: [(&str, &str); 1] = [("limits", "emulate")];

/// A file, and overrides from the command line. A span is a range of bytes. Spans up to the file's length lie in the
/// file. Each override has its own range of bytes after the file's end.
pub struct Document {
    name: String,
    text: String,
    overrides: Vec<Override>,
}

/// One `--set` option, as a line of TOML.
struct Override {
    line: String,
    /// The start of the line's spans, which lie after those of the file and of earlier overrides.
    start: usize,
}

impl Document {
    /// Makes a document from the text of the file `name` and the overrides. Fails if an override's key is neither a
    /// name nor several names joined by dots.
    pub fn new(name: String, text: String, overrides: &[(String, String)]) -> Result<Self> {
        let mut start = text.len() + 1;
        let mut lines = Vec::new();
        for (key, value) in overrides {
            let line = toml_line(key, value)?;
            let next = start + line.len() + 1;
            lines.push(Override { line, start });
            start = next;
        }
        Ok(Self { name, text, overrides: lines })
    }

    /// Returns the file's text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the overrides, each as a line of TOML.
    pub fn override_lines(&self) -> Vec<String> {
        self.overrides.iter().map(|over| over.line.clone()).collect()
    }

    /// Deserialises the document as a `T`.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T> {
        // Each override is padded with spaces, so that its spans lie after those of the file and of all earlier
        // overrides.
        let padded: Vec<_> = self.overrides.iter().map(|over| " ".repeat(over.start) + &over.line).collect();
        let mut table = DeTable::parse(&self.text).map_err(|error| self.syntax(&error, 0))?;
        for (layer, over) in padded.iter().zip(&self.overrides) {
            let layer = DeTable::parse(layer).map_err(|error| self.syntax(&error, over.start))?;
            merge_tables(table.get_mut(), layer.into_inner());
        }
        T::deserialize(Deserializer::from(table)).map_err(|error| self.misfit(&error))
    }

    /// Returns an error for a mistake at `span`, in the file or in an override.
    pub fn error(&self, span: Range<usize>, message: impl Into<String>, label: impl Into<String>) -> Error {
        let (name, text, start) = self.part(&span);
        Error::in_file(name, text, span.start - start..span.end.saturating_sub(start), message, label)
            .with_help(KEYS)
    }

    /// Returns `FILE:LINE` of `span`; for a span in an override, `--set:1`.
    pub fn place_of(&self, span: Range<usize>) -> String {
        let (name, text, start) = self.part(&span);
        format!("{name}:{}", line_of(text, span.start - start))
    }

    /// Returns whether `span` lies in an override.
    pub fn is_override(&self, span: &Range<usize>) -> bool {
        self.overrides.iter().any(|over| over.start <= span.start)
    }

    /// Returns the file or the override that contains `span`: its name, its text and the start of its spans.
    fn part(&self, span: &Range<usize>) -> (&str, &str, usize) {
        match self.overrides.iter().rev().find(|over| over.start <= span.start) {
            Some(over) => ("--set", &over.line, over.start),
            None => (&self.name, &self.text, 0),
        }
    }

    /// Adds the location `span` to an input error that has no location.
    pub fn place(&self, span: Range<usize>, error: Error, label: &str) -> Error {
        error.placed(|message| self.error(span, message, label))
    }

    fn syntax(&self, error: &toml::de::Error, start: usize) -> Error {
        let span = error.span().unwrap_or(start..start);
        self.error(span, format!("this is not TOML: {}", error.message().trim()), "here")
            .with_help(Wanted::Experiment.read())
    }

    /// Rewrites serde's error in plain words.
    fn misfit(&self, error: &toml::de::Error) -> Error {
        let span = error.span().unwrap_or(0..0);
        let message = error.message();
        let mut quoted = message.split('`').skip(1).step_by(2);
        if message.starts_with("unknown field") {
            let key = quoted.next().unwrap_or_default();
            return self.unknown_key(span, key, &quoted.collect::<Vec<_>>());
        }
        if message.starts_with("missing field") {
            let key = quoted.next().unwrap_or_default();
            return self.error(span, format!("the key '{key}' is missing"), format!("'{key}' belongs here"));
        }
        let (message, expected) = in_plain_words(message);
        self.error(span, message, expected)
    }

    /// Returns the error for a key that is none of `known`.
    pub fn unknown_key(&self, span: Range<usize>, key: &str, known: &[&str]) -> Error {
        let error = self.error(span, format!("unknown key '{key}'"), "no such key here");
        let list = format!("the keys are {}", known.join(", "));
        let renamed =
            RENAMED.iter().find(|(old, new)| *old == key && known.contains(new)).map(|(_, new)| *new);
        match renamed.or_else(|| nearest(key, known.iter().copied())) {
            Some(meant) => error.with_help(format!("did you mean '{meant}'? {list}")),
            None => error.with_help(list),
        }
    }
}

/// Returns `key = value` as TOML. A `value` that is not valid TOML becomes a string.
fn toml_line(key: &str, value: &str) -> Result<String> {
    if toml::from_str::<toml::Table>(&format!("{key} = 0")).is_err() || key.contains(['=', '\n', '#']) {
        return Err(Error::input(format!("--set {key}={value}: '{key}' is not a key"))
            .with_help("a key is a name, or several names joined by dots, such as timing.seed"));
    }
    let plain = format!("{key} = {value}");
    match toml::from_str::<toml::Table>(&plain) {
        Ok(_) if !value.contains('\n') => Ok(plain),
        _ => Ok(format!("{key} = {}", Value::String(value.into()))),
    }
}

/// Merges the overrides `above` into the file's values `below`: tables are merged, and all other values are replaced.
/// [`merge`] also merges a table into an array if the table's keys are indices of the array.
fn merge_tables<'i>(below: &mut DeTable<'i>, above: DeTable<'i>) {
    for (key, value) in above {
        match below.get_mut(key.get_ref().as_ref()) {
            Some(old) => merge(old, value),
            None => {
                below.insert(key, value);
            }
        }
    }
}

fn merge<'i>(below: &mut Spanned<DeValue<'i>>, above: Spanned<DeValue<'i>>) {
    match (below.get_mut(), above.get_ref()) {
        (DeValue::Table(old), DeValue::Table(new)) => merge_tables(old, new.clone()),
        (DeValue::Array(old), DeValue::Table(new)) if in_bounds(old, new) => {
            for (key, value) in new.clone() {
                let place = key.get_ref().parse().unwrap_or(usize::MAX);
                if let Some(item) = old.get_mut(place) {
                    merge(item, value);
                }
            }
        }
        _ => *below = above,
    }
}

/// Returns whether every key of `table` is an index of `array`, as 0 is in `strategy.0.width = 8`.
fn in_bounds(array: &DeArray<'_>, table: &DeTable<'_>) -> bool {
    table.keys().all(|key| key.get_ref().parse::<usize>().is_ok_and(|place| place < array.len()))
}

/// Returns serde's message without the names of Rust types, and the part of it that says which value serde expected.
fn in_plain_words(message: &str) -> (String, String) {
    let words = [
        ("expected i64", "expected a whole number"),
        ("expected f64", "expected a number"),
        ("expected a sequence", "expected a list"),
        ("invalid type: ", "wrong type: "),
    ];
    let message =
        words.iter().fold(message.trim().replace('`', ""), |text, (from, to)| text.replace(from, to));
    let label = message.find("expected ").map_or("here", |place| &message[place..]).to_string();
    (message, label)
}
