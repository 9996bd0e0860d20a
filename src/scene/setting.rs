//! Values that options, a config or an animation's tracks set in a scene. Finds out whether a mistake lies in
//! a value that was set or in the scene file.

use crate::error::{Error, line_of, shortened};
use std::borrow::Cow;
use std::ops::Range;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Value};

/// A value to set in a scene. Two settings are equal if they set the same value at the same path.
#[derive(Clone, Debug)]
pub struct Setting {
    /// The value's dotted path in the scene file: `light.0.power`.
    pub path: String,
    /// The new value.
    pub value: Value,
    /// The setting as the user wrote it, for messages: an option with its value, or a line of a config with
    /// the path and the value.
    pub origin: String,
}

impl PartialEq for Setting {
    fn eq(&self, other: &Self) -> bool {
        (&self.path, &self.value) == (&other.path, &other.value)
    }
}

impl Setting {
    /// Returns a setting that messages show as `path = value`.
    pub fn new(path: &str, value: Value) -> Self {
        Self { path: path.to_owned(), origin: format!("{path} = {value}"), value }
    }

    /// Returns the error for a mistake in this setting.
    pub(super) fn error(&self, message: impl std::fmt::Display) -> Error {
        error_in(&self.origin, message)
    }
}

/// Returns the error for a mistake in a setting that messages show as `origin`.
pub(super) fn error_in(origin: &str, message: impl std::fmt::Display) -> Error {
    Error::input(format!("{}: {message}", shortened(origin)))
}

/// A value that a track of an animation sets in one frame.
#[derive(Debug, PartialEq)]
pub(super) struct TrackValue {
    /// The value's dotted path in the scene file: `light.0.power`.
    pub path: String,
    /// The dotted path of the track's value at a keyframe, for messages: `animation.track.0.values.2`. The
    /// keyframe is the last one at or before the frame (the first one if all are after the frame). The line
    /// of this value is not stored: few frames need this line for a message, and the file must be parsed to
    /// find the line.
    pub keyframe: String,
    /// The track and the frame, for messages.
    pub name: String,
}

/// A value that was set in a document.
#[derive(Clone, Copy)]
enum Change<'a> {
    Setting(&'a Setting),
    Track(&'a TrackValue),
}

impl<'a> Change<'a> {
    fn keys(self) -> Vec<&'a str> {
        let (Self::Setting(Setting { path, .. }) | Self::Track(TrackValue { path, .. })) = self;
        path.split('.').collect()
    }
}

/// The origin of a part of a document.
pub(super) enum Origin<'a> {
    /// The part comes from a setting, or from a track of an animation. If several settings or tracks made
    /// the part, the last one counts. The string is the name of the setting or the track in messages.
    Setting(Cow<'a, str>),
    /// The part comes from this range of the file's text.
    File(Range<usize>),
    /// The origin of the part is unknown, for example if the mistake is a missing key.
    Unknown,
}

impl Origin<'_> {
    /// Returns the location for messages: `FILE:LINE`, or the name of the setting or track. If the origin is
    /// unknown, returns only the file's name. `file` and `text` are the file's name and text.
    pub fn location(&self, file: &str, text: &str) -> String {
        match self {
            Self::Setting(setting) => shortened(&**setting),
            Self::File(span) => format!("{file}:{}", line_of(text, span.start)),
            Self::Unknown => file.to_owned(),
        }
    }
}

/// The values that were set in a document, and the name and the text of the document's file.
pub(super) struct Changed {
    pub settings: Vec<Setting>,
    /// The values that tracks set in one frame, after all settings; empty if the document does not belong to
    /// a frame of an animation.
    pub tracks: Vec<TrackValue>,
    /// The file's name.
    pub file: String,
    /// The file's text.
    pub original: String,
}

impl Changed {
    /// Returns the setting, the track or the part of the file from which the range `span` of `text` comes.
    /// `text` is the document after all values were set.
    pub fn origin(&self, text: &str, span: &Range<usize>) -> Origin<'_> {
        let table = DeTable::parse(text).ok();
        let Some(location) = table.and_then(|table| Location::find(table.get_ref(), span)) else {
            return Origin::Unknown;
        };
        let path: Vec<&str> = location.path.iter().map(String::as_str).collect();
        self.origin_of(&path, location.is_key, &self.tracks)
    }

    /// Returns the origin of the key at `path` (if `is_key` is true) or of the value at `path`. In the
    /// document, first all settings and then all `tracks` have set their values.
    fn origin_of<'a>(&'a self, path: &[&str], is_key: bool, tracks: &'a [TrackValue]) -> Origin<'a> {
        let settings = self.settings.iter().map(Change::Setting);
        let mut latest = settings.chain(tracks.iter().map(Change::Track)).rev();
        if let Some(change) = latest.clone().find(|change| path.starts_with(&change.keys())) {
            return Origin::Setting(self.shown(change));
        }
        let original = DeTable::parse(&self.original).ok();
        if let Some(span) = original.and_then(|table| span_in(table.get_ref(), path, is_key)) {
            return Origin::File(span);
        }
        // The scene file does not have `path`. A setting or a track with a longer path may have created the
        // table or list at `path`.
        let created = latest.find(|change| change.keys().starts_with(path));
        created.map_or(Origin::Unknown, |change| Origin::Setting(self.shown(change)))
    }

    /// Returns a change as messages show it. A setting is shown as the user wrote it. A track is shown by the
    /// location of its keyframe's value, followed by the track's name.
    fn shown<'a>(&self, change: Change<'a>) -> Cow<'a, str> {
        match change {
            Change::Setting(setting) => Cow::Borrowed(&setting.origin),
            Change::Track(TrackValue { keyframe, name, .. }) => {
                let path: Vec<&str> = keyframe.split('.').collect();
                let location = self.origin_of(&path, false, &[]).location(&self.file, &self.original);
                Cow::Owned(format!("{location}: {name}"))
            }
        }
    }

    /// Returns a sentence that names the values that were set; `None` if there is none to name. The sentence
    /// is for the help in an error about a mistake that was not found in one of these values. `text` is the
    /// document after all values were set. The sentence names all settings. If `near` is `None`, the
    /// sentence also names all tracks. If `near` is a range of `text`, the sentence also names the tracks
    /// that set a value in the part of the scene in which this range lies.
    pub fn summary(&self, text: &str, near: Option<&Range<usize>>) -> Option<String> {
        let part = near.map(|span| part_of(text, span));
        let is_in_part = |part: &Vec<String>, track: &TrackValue| {
            !part.is_empty() && part.iter().zip(track.path.split('.')).all(|(one, other)| one == other)
        };
        let is_named = |track: &&TrackValue| part.as_ref().is_none_or(|part| is_in_part(part, track));
        let settings = self.settings.iter().map(Change::Setting);
        let all = settings.chain(self.tracks.iter().filter(is_named).map(Change::Track));
        let shown: Vec<_> = all.map(|change| shortened(self.shown(change))).collect();
        (!shown.is_empty()).then(|| format!("values of the scene were changed: {}", shown.join("; ")))
    }
}

/// Returns the keys that lead to the part of the scene in which the range `span` of a document's text lies. A
/// part is an element of a list, such as an object (`object`, `0`), or a value of the whole scene, such as
/// the camera (`camera`). If the range lies in no key or value, the returned list of keys is empty.
fn part_of(text: &str, span: &Range<usize>) -> Vec<String> {
    let table = DeTable::parse(text).ok();
    let location = table.and_then(|table| Location::find(table.get_ref(), span));
    let mut path = location.map_or(Vec::new(), |location| location.path);
    let is_in_list = path.get(1).is_some_and(|key| key.parse::<usize>().is_ok());
    path.truncate(if is_in_list { 2 } else { 1 });
    path
}

/// A key or a value of a document.
struct Location {
    /// The keys and indices that lead to this key or value.
    path: Vec<String>,
    is_key: bool,
}

impl Location {
    /// Returns the smallest key or value that contains the range; `None` if there is none, or if the range is
    /// empty.
    fn find(table: &DeTable<'_>, span: &Range<usize>) -> Option<Self> {
        let mut search = Search { span, path: Vec::new(), smallest: None };
        if !span.is_empty() {
            search.table(table);
        }
        search.smallest.map(|(_, location)| location)
    }
}

/// A search for the smallest key or value of a document that contains a range of the document's text.
struct Search<'a> {
    span: &'a Range<usize>,
    path: Vec<String>,
    /// The length in bytes of the smallest key or value that was found so far, and this key or value.
    smallest: Option<(usize, Location)>,
}

impl Search<'_> {
    fn table(&mut self, table: &DeTable<'_>) {
        for (key, value) in table {
            self.path.push(key.get_ref().to_string());
            self.visit(&key.span(), true);
            self.value(value);
            self.path.pop();
        }
    }

    fn value(&mut self, value: &Spanned<DeValue<'_>>) {
        self.visit(&value.span(), false);
        match value.get_ref() {
            DeValue::Table(table) => self.table(table),
            DeValue::Array(array) => {
                for (index, item) in array.iter().enumerate() {
                    self.path.push(index.to_string());
                    self.value(item);
                    self.path.pop();
                }
            }
            _ => {}
        }
    }

    fn visit(&mut self, range: &Range<usize>, is_key: bool) {
        let contains = range.start <= self.span.start && self.span.end <= range.end;
        if contains && self.smallest.as_ref().is_none_or(|(length, _)| range.len() < *length) {
            self.smallest = Some((range.len(), Location { path: self.path.clone(), is_key }));
        }
    }
}

/// Returns the range of the key or the value at a path; `None` if the path does not exist.
fn span_in(table: &DeTable<'_>, path: &[&str], is_key: bool) -> Option<Range<usize>> {
    let (first, rest) = path.split_first()?;
    let (key, value) = table.iter().find(|(key, _)| key.get_ref() == first)?;
    match rest {
        [] if is_key => Some(key.span()),
        _ => span_in_value(value, rest, is_key),
    }
}

fn span_in_value(value: &Spanned<DeValue<'_>>, path: &[&str], is_key: bool) -> Option<Range<usize>> {
    let Some((first, rest)) = path.split_first() else { return Some(value.span()) };
    match value.get_ref() {
        DeValue::Table(table) => span_in(table, path, is_key),
        DeValue::Array(array) => span_in_value(array.get(first.parse::<usize>().ok()?)?, rest, is_key),
        _ => None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::{Shot, load_scene_named_in};

    const SCENE: &str =
        "# The scene.\n\n[[object]]\nshape = \"sphere\"\n\n[[light]]\nposition = [0, 9, 0]\npower = 9\n";

    /// Returns the message of the error for a scene with these values, and the line and the text that the
    /// error marks.
    fn message_and_mark(
        scene: &str,
        values: &[(&str, Value)],
        quotes: bool,
    ) -> (String, Option<(usize, String)>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, scene).unwrap();
        let set = |(path, value): &(&str, Value)| Setting {
            path: (*path).to_owned(),
            value: value.clone(),
            origin: format!("--set {path}={value}"),
        };
        let settings: Vec<_> = values.iter().map(set).collect();
        let of = if quotes { folder.path() } else { std::path::Path::new("/elsewhere") };
        let Error::Input(error) = load_scene_named_in(of, &path, &settings, Shot::SQUARE).unwrap_err() else {
            panic!("not an input error")
        };
        let marked = error.span.map(|span| {
            let text = error.source_code.as_ref().unwrap().inner();
            let line = crate::error::line_of(text, span.offset());
            (line, text[span.offset()..span.offset() + span.len()].to_owned())
        });
        (error.message.replace(&format!("{}/", folder.path().display()), ""), marked)
    }

    #[test]
    fn a_mistake_in_a_setting_names_the_setting_even_if_the_scenes_text_is_withheld() {
        for (path, value, expected) in [
            ("light.0.power", Value::from(-3), "-3 is not a number from 0 to 1e28"),
            (
                "object.0.triangles",
                Value::from(-1),
                "invalid value: integer `-1`, expected a whole number from 1 to 100000000",
            ),
            (
                "object.0.material",
                Value::Array([1, 0, 0].map(Value::from).to_vec()),
                "wrong type: list, expected a table",
            ),
            ("object.0.triangle", Value::from(50), "unknown key `triangle`; did you mean `triangles`?"),
            ("object.0.ply", Value::from("a.ply"), "unknown key `ply`; did you mean `mesh`?"),
            ("camera.z_near", Value::from(-1), "-1 is not a finite number of at least 0"),
            ("object.1.colour.red", Value::from(1), "unknown key `colour`"),
            ("light.0.position.1", Value::from("x"), "wrong type: string \"x\", expected a finite number"),
        ] {
            for quotes in [true, false] {
                let (message, marked) = message_and_mark(SCENE, &[(path, value.clone())], quotes);
                assert!(message.starts_with(&format!("--set {path}={value}: {expected}")), "{message}");
                assert_eq!(marked, None, "{path}");
            }
        }
    }

    #[test]
    fn the_setting_that_made_the_value_is_named() {
        let power = |value: i64| ("light.0.power", Value::from(value));
        let message = message_and_mark(SCENE, &[power(1), ("crease", Value::from(1)), power(-2)], true).0;
        assert!(message.starts_with("--set light.0.power=-2: "), "{message}");
        let unset = message_and_mark(SCENE, &[("name.x", Value::from(1)), power(-2)], true).0;
        assert!(unset.starts_with("--set light.0.power=-2: "), "{unset}");
        let no_element = message_and_mark(SCENE, &[("light.7.power", Value::from(1))], true).0;
        assert!(no_element.starts_with("--set light.7.power=1: `light` has 1 element"), "{no_element}");
    }

    #[test]
    fn a_mistake_in_the_file_has_the_files_own_line() {
        let wrong = SCENE.replace("power = 9", "power = -9");
        let crease = [("crease", Value::from(1))];
        let (message, marked) = message_and_mark(&wrong, &crease, true);
        assert_eq!((message.as_str(), marked), ("-9 is not a number from 0 to 1e28", Some((8, "-9".into()))));
        let (message, _) = message_and_mark(&wrong, &crease, false);
        assert_eq!(message, "a.toml:8: a mistake in this line; `raycl render a.toml` shows the line");
        let unknown = SCENE.replace("shape", "shap");
        assert_eq!(message_and_mark(&unknown, &crease, true).1, Some((4, "shap".into())));
    }

    #[test]
    fn a_mistake_between_a_setting_and_the_file_names_the_line_of_the_file() {
        let scene = format!("{SCENE}\n[camera]\nposition = [0, 0, 5]\nlook_at = [0, 0, 1]\n");
        let at = Value::Array([0, 0, 1].map(Value::from).to_vec());
        let (message, marked) = message_and_mark(&scene, &[("camera.position", at)], true);
        assert!(message.contains("looks at its own position"), "{message}");
        assert_eq!(marked, Some((12, "[0, 0, 1]".into())));
    }
}
