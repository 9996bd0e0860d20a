//! Reads the text of a config, merges the `--set` values into the values of the text, and locates mistakes in the text
//! and in the `--set` values.

use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Value};

use crate::error::{Error, Result, line_of, nearest};
use crate::filetype::Wanted;
use crate::toml_error::{NO_LIST, NO_TABLE, elsewhere, in_plain_words, other_brackets, syntax};
use crate::toml_read::from_table;
use crate::words::counted;

/// The help in an error message about a mistake for which there is no more specific help.
const KEYS: &str =
    "docs/experiments.md lists every key of an experiment, and configs/quick.toml is an example";
/// The renamed keys of configs: the old name and the new name of each key.
const RENAMED: [(&str, &str); 1] = [("limits", "emulate")];
/// Keys whose values are lists, each with an example of a list.
const LISTS: [(&str, &str); 8] = [
    ("scenes", r#"["scenes/teapot.toml"]"#),
    ("scene", r#"[{ file = "scenes/teapot.toml" }]"#),
    ("devices", r#"["cpu"]"#),
    ("image_sizes", "[[800, 500]]"),
    ("local_sizes", "[8]"),
    ("strategies", r#"["naive"]"#),
    ("strategy", r#"[{ preset = "naive" }]"#),
    ("baselines", r#"["serial"]"#),
];

/// The text of a config file, and the overrides (`--set` options of the command line). A span is a range of bytes. If a
/// span begins before the end of the file's text, it lies in this text; otherwise, it lies in an override. Each
/// override has a range of bytes of its own, after the end of the file's text.
pub struct Document {
    name: String,
    text: String,
    overrides: Vec<Override>,
}

/// One `--set` option, as a line of TOML.
struct Override {
    line: String,
    /// The byte at which the range of bytes of this override's line begins, after the ranges of the file and
    /// of earlier overrides.
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

    /// Reads the config, with the overrides merged into it, as a `T`.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T> {
        let mut table = DeTable::parse(&self.text).map_err(|error| self.syntax(&error, 0))?;
        for over in &self.overrides {
            let layer = DeTable::parse(&over.line).map_err(|error| self.syntax(&error, over.start))?;
            merge_tables("", table.get_mut(), moved_table(layer.into_inner(), over.start))
                .map_err(|no_index| self.no_such_index(no_index))?;
        }
        from_table(table).map_err(|error| self.misfit(&error))
    }

    /// Returns an error for a mistake at `span`, in the file or in an override. The error's help is [`KEYS`].
    pub fn error(&self, span: Range<usize>, message: impl Into<String>, label: impl Into<String>) -> Error {
        let (name, text, start) = self.part(&span);
        Error::in_file(name, text, span.start - start..span.end.saturating_sub(start), message, label)
            .with_help(KEYS)
    }

    /// Returns the error for an override whose key contains an index that a list of the file does not have.
    fn no_such_index(&self, NoIndex { span, list, count }: NoIndex) -> Error {
        let indices = match count {
            0 => "there is no index".to_owned(),
            1 => "the only index is 0".to_owned(),
            _ => format!("the indices are 0 to {}", count - 1),
        };
        let message = format!("'{list}' has {}; {indices}", counted(count, "element"));
        let error = self.error(span, message, "no such index");
        match example_of(&list).filter(|_| count == 0) {
            Some(whole) => error.with_help(format!("set the whole list: --set {list}='{whole}'")),
            None => error,
        }
    }

    /// Returns `FILE:LINE` of `span`; for a span in an override, `--set:1`.
    pub fn location_of(&self, span: Range<usize>) -> String {
        let (name, text, start) = self.part(&span);
        format!("{name}:{}", line_of(text, span.start - start))
    }

    /// Returns true if `span` lies in an override.
    pub fn is_override(&self, span: &Range<usize>) -> bool {
        self.overrides.iter().any(|over| over.start <= span.start)
    }

    /// Returns the span of the last override that sets the whole value of one of `keys`; the file's start if there is
    /// no such override.
    pub fn override_of(&self, keys: &[&str]) -> Range<usize> {
        let sets =
            |over: &&Override| over.line.split('=').next().is_some_and(|key| keys.contains(&key.trim()));
        let span = |over: &Override| over.start..over.start + over.line.trim_end().len();
        self.overrides.iter().rfind(sets).map_or(0..0, span)
    }

    /// Returns the file or the override that contains `span`: its name, its text, and the byte at which its
    /// range of bytes begins.
    fn part(&self, span: &Range<usize>) -> (&str, &str, usize) {
        match self.overrides.iter().rev().find(|over| over.start <= span.start) {
            Some(over) => ("--set", &over.line, over.start),
            None => (&self.name, &self.text, 0),
        }
    }

    /// Adds the location `span` to an input error (a mistake of the user) that has no location.
    pub fn located(&self, span: Range<usize>, error: Error, label: &str) -> Error {
        error.placed(|message| self.error(span, message, label))
    }

    /// Returns the error for a text that is not TOML. If `start` is 0, this text is the file; otherwise, this text is
    /// the override whose range of bytes begins at `start`.
    fn syntax(&self, error: &toml::de::Error, start: usize) -> Error {
        let Range { start: from, end: to } = error.span().unwrap_or(0..0);
        let span = start + from..start + to;
        let read = Wanted::Experiment.read();
        let (reason, remedy) = match syntax(error, self.part(&span).1) {
            Some((reason, remedy)) => (reason, format!("{remedy}; {read}")),
            None => (error.message().trim().to_owned(), read.to_owned()),
        };
        self.error(span, format!("this is not TOML: {reason}"), "here").with_help(remedy)
    }

    /// Converts an error of serde (the library that converts TOML to Rust's types) to one in plain words,
    /// with its location.
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
        let message = in_plain_words(message.trim()).replace('`', "");
        let label = message.find("expected ").map_or("here", |start| &message[start..]).to_owned();
        let remedy = self.list_instead(&span, &message);
        let error = self.error(span, message, label);
        match remedy {
            Some(remedy) => error.with_help(remedy),
            None => error,
        }
    }

    /// Returns the remedy for a value of a wrong type at `span`, in two cases. In the first case, the file has `[name]`
    /// in place of `[[name]]`, or `[[name]]` in place of `[name]`. In the second case, a list is needed, and the key in
    /// front of the value is one of [`LISTS`]. Returns `None` in all other cases. `message` is the message about the
    /// wrong type.
    fn list_instead(&self, span: &Range<usize>, message: &str) -> Option<String> {
        let (_, text, start) = self.part(span);
        let at = span.start - start;
        if [NO_LIST, NO_TABLE].contains(&message) {
            return other_brackets(message, &super::schema(), text, at);
        }
        if !message.ends_with("expected a list") {
            return None;
        }
        let key = text.get(..at)?.lines().next_back()?.trim_end().strip_suffix('=')?.trim();
        let value = text.get(at..span.end.checked_sub(start)?)?;
        let example = example_of(key)?;
        let size = size_in(value).filter(|_| key.ends_with("_sizes"));
        Some(format!("{key} is a list, such as {}", size.unwrap_or_else(|| example.to_owned())))
    }

    /// Returns the error for a key of the config that is not in the list `known`.
    pub fn unknown_key(&self, span: Range<usize>, key: &str, known: &[&str]) -> Error {
        let (_, text, start) = self.part(&span);
        let place = elsewhere(&super::schema(), text, span.start - start, key);
        let error = self.error(span, format!("unknown key '{key}'"), "no such key here");
        if let Some(place) = place {
            return error.with_help(format!("{place}; the keys here are {}", known.join(", ")));
        }
        let list = format!("the keys are {}", known.join(", "));
        let renamed =
            RENAMED.iter().find(|(old, new)| *old == key && known.contains(new)).map(|(_, new)| *new);
        match renamed.or_else(|| nearest(key, known.iter().copied())) {
            Some(meant) => error.with_help(format!("did you mean '{meant}'? {list}")),
            None => error.with_help(list),
        }
    }
}

/// Returns `key = value` as TOML. A `value` that is not valid TOML, or contains a line break, becomes a string. Fails
/// if `key` is neither a name nor several names joined by dots.
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

/// Returns the overrides with all paths of scenes made absolute. A relative path in an override is taken as relative to
/// the current folder.
pub fn with_absolute_paths(overrides: &[(String, String)]) -> Vec<(String, String)> {
    overrides.iter().map(|given| absolute(&given.0, &given.1).unwrap_or_else(|| given.clone())).collect()
}

/// Returns an override (a `--set` option) with absolute paths of scenes; `None` if the override has no
/// relative path of a scene.
fn absolute(key: &str, value: &str) -> Option<(String, String)> {
    let table: toml::Table = toml::from_str(&toml_line(key, value).ok()?).ok()?;
    let (top, given) = table.into_iter().next()?;
    let mut changed = given.clone();
    if ["scenes", "scene"].contains(&top.as_str()) {
        resolve(&mut changed, &top);
    }
    (changed != given).then(|| (top, changed.to_string()))
}

/// Makes paths absolute: every text in `scenes`, and every `file` of `scene`. `key` is the key to which
/// `value` belongs; for every value inside `scenes`, at any depth, `key` is `scenes`.
fn resolve(value: &mut Value, key: &str) {
    match value {
        Value::String(path) if ["scenes", "file"].contains(&key) => {
            let whole = std::path::absolute(path.as_str());
            if let Some(whole) = whole.as_ref().ok().and_then(|whole| whole.to_str()) {
                whole.clone_into(path);
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| resolve(item, key)),
        Value::Table(table) => {
            for (name, item) in table.iter_mut() {
                resolve(item, if key == "scenes" { key } else { name.as_str() });
            }
        }
        _ => {}
    }
}

/// Adds `distance` to all spans in the table of an override, which was parsed separately from the file.
fn moved_table(table: DeTable<'_>, distance: usize) -> DeTable<'_> {
    table.into_iter().map(|(key, value)| (moved(key, distance), moved_value(value, distance))).collect()
}

/// Adds `distance` to all spans in a value.
fn moved_value(value: Spanned<DeValue<'_>>, distance: usize) -> Spanned<DeValue<'_>> {
    let value = moved(value, distance);
    let span = value.span();
    let inner = match value.into_inner() {
        DeValue::Table(table) => DeValue::Table(moved_table(table, distance)),
        DeValue::Array(items) => {
            DeValue::Array(items.into_iter().map(|item| moved_value(item, distance)).collect())
        }
        other => other,
    };
    Spanned::new(span, inner)
}

/// Adds `distance` to the span of a value, but not to the spans of the values that it contains.
fn moved<T>(value: Spanned<T>, distance: usize) -> Spanned<T> {
    let Range { start, end } = value.span();
    Spanned::new(start + distance..end + distance, value.into_inner())
}

/// Merges a table of an override, `above`, into the table `below` of the file. A table is merged into a table and, if
/// the keys of the override's table are indices, into an array (see [`merge`]). Any other value of the override
/// replaces the file's value. Returns an error if a list has no element with such an index; if the file does not
/// contain the list at all, the list is treated as an empty list. `path` is the dotted path of both tables; it is empty
/// for the whole file.
fn merge_tables<'i>(path: &str, below: &mut DeTable<'i>, above: DeTable<'i>) -> Merged {
    for (key, value) in above {
        let name = match path {
            "" => key.get_ref().to_string(),
            _ => format!("{path}.{}", key.get_ref()),
        };
        match below.get_mut(key.get_ref().as_ref()) {
            Some(old) => merge(&name, old, value)?,
            None => {
                let span = first_index(value.get_ref());
                if let Some(span) = span.filter(|_| example_of(&name).is_some()) {
                    return Err(NoIndex { span, list: name, count: 0 });
                }
                below.insert(key, value);
            }
        }
    }
    Ok(())
}

/// The result of merging an override into the file's values: an error if the override has an index for which a list has
/// no element.
type Merged = std::result::Result<(), NoIndex>;

/// An index in an override's key for which a list has no element.
struct NoIndex {
    /// Where the index stands in the document, as a range of bytes.
    span: Range<usize>,
    /// The dotted path of the list, such as `strategy`.
    list: String,
    /// The number of elements that the list has.
    count: usize,
}

/// Merges `above` into `below`, the value with the dotted path `name`.
fn merge<'i>(name: &str, below: &mut Spanned<DeValue<'i>>, above: Spanned<DeValue<'i>>) -> Merged {
    match (below.get_mut(), above.get_ref()) {
        (DeValue::Table(old), DeValue::Table(new)) => return merge_tables(name, old, new.clone()),
        (DeValue::Array(old), DeValue::Table(new)) if has_indices(new) => {
            let count = old.len();
            for (key, value) in new.clone() {
                let index = key.get_ref().parse().unwrap_or(usize::MAX);
                let no_index = || NoIndex { span: key.span(), list: name.to_owned(), count };
                let item = old.get_mut(index).ok_or_else(no_index)?;
                merge(&format!("{name}.{index}"), item, value)?;
            }
        }
        _ => *below = above,
    }
    Ok(())
}

/// Returns an example of a list with this dotted path; `None` if the last key of the path is not one of [`LISTS`].
fn example_of(path: &str) -> Option<&'static str> {
    let key = path.rsplit('.').next().unwrap_or(path);
    LISTS.iter().find(|(list, _)| *list == key).map(|(_, whole)| *whole)
}

/// If the TOML text `value` is one size, such as "400x250" (with its quotes), returns the same size as a config needs
/// it: in a list, such as `[[400, 250]]`. Returns `None` for any other text.
fn size_in(value: &str) -> Option<String> {
    let (across, down) = value.trim_matches(['"', '\'']).split_once('x')?;
    let [across, down] = [across, down].map(|side| side.trim().parse::<u32>().ok());
    Some(format!("[[{}, {}]]", across?, down?))
}

/// Returns true if `table` is not empty and each of its keys is an index. For example, in `strategy.0.width = 8`, the
/// key `0` is an index.
fn has_indices(table: &DeTable<'_>) -> bool {
    !table.is_empty() && table.keys().all(|key| key.get_ref().parse::<usize>().is_ok())
}

/// Returns the span of the first index, if `value` is a table whose keys are indices.
fn first_index(value: &DeValue<'_>) -> Option<Range<usize>> {
    let DeValue::Table(table) = value else { return None };
    table.keys().next().filter(|_| has_indices(table)).map(Spanned::span)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn spans_inside_an_override_lie_in_that_override() {
        #[derive(serde::Deserialize)]
        struct Read {
            list: Vec<Spanned<i64>>,
            table: BTreeMap<String, Spanned<i64>>,
        }
        let overrides =
            [("list", "[1, 22]"), ("table", "{ key = 3 }")].map(|(key, value)| (key.into(), value.into()));
        let document = Document::new("a.toml".into(), "list = []\n".into(), &overrides).unwrap();
        let read: Read = document.read().unwrap();
        let shown = |span: Range<usize>| {
            let (name, line, start) = document.part(&span);
            (name, line, &line[span.start - start..span.end - start])
        };
        assert_eq!(shown(read.list[1].span()), ("--set", "list = [1, 22]", "22"));
        assert_eq!(shown(read.table["key"].span()), ("--set", "table = { key = 3 }", "3"));
    }

    #[test]
    fn a_table_with_a_key_that_is_no_index_takes_the_place_of_a_list() {
        #[derive(serde::Deserialize)]
        struct Read {
            list: BTreeMap<String, i64>,
        }
        let overrides = [("list".into(), "{ 0 = 7, x = 2 }".into())];
        let document = Document::new("a.toml".into(), "list = [5]\n".into(), &overrides).unwrap();
        let read: Read = document.read().unwrap();
        assert_eq!(read.list, BTreeMap::from([("0".to_owned(), 7), ("x".to_owned(), 2)]));
    }

    #[test]
    fn of_several_overrides_of_a_key_the_last_is_named() {
        let overrides = [("list", "[1]"), ("list", "[]"), ("other", "2")]
            .map(|(key, value)| (key.to_owned(), value.to_owned()));
        let document = Document::new("a.toml".into(), "list = [3]\n".into(), &overrides).unwrap();
        let (name, line, _) = document.part(&document.override_of(&["list"]));
        assert_eq!((name, line.trim_end()), ("--set", "list = []"));
        assert_eq!(document.override_of(&["none"]), 0..0);
    }
}
