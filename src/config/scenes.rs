//! The scenes of a config: scene files, and scene files with changed values.

use std::ffi::OsString;
use std::ops::{Range, RangeInclusive};
use std::path::Path;

use toml::{Spanned, Value};

use super::document::Document;
use super::numbers::whole;
use super::types::SceneChoice;
use super::wire::{Experiment, Numbers, SceneEntry, SceneValues};
use crate::error::{Error, Result, nearest_file_among};
use crate::filetype::{FileType, Opened, Wanted, experiment_instead, may_be_scene};
use crate::printer::line;
use crate::reader::Kind;
use crate::scene::Setting;

/// The allowed range of the number of samples per pixel.
pub(super) const SAMPLES: RangeInclusive<i64> = 1..=64;

/// Returns the scenes of the config without repetitions: first the unchanged scene files, then those with changed
/// values. Returns an error if there is no scene.
pub fn expand(document: &Document, wire: &Experiment, config: &Path) -> Result<Vec<SceneChoice>> {
    let folder = config.parent().unwrap_or(Path::new(""));
    let mut all = Vec::new();
    for name in &wire.scenes {
        all.push(find(document, name, folder)?);
    }
    for entry in &wire.scene {
        all.extend(product(document, entry, folder)?);
    }
    if all.is_empty() {
        let place = document.override_of(&["scenes", "scene"]);
        let error = document.error(place, "there is no scene", "expected scenes = [...] or [[scene]]");
        return Err(error.with_help("add scenes = [\"FILE\"]; paths are relative to the config file"));
    }
    let mut unique: Vec<SceneChoice> = Vec::new();
    for scene in all {
        if !unique.contains(&scene) {
            unique.push(scene);
        }
    }
    Ok(unique)
}

fn find(document: &Document, name: &Spanned<String>, folder: &Path) -> Result<SceneChoice> {
    let path = folder.join(name.get_ref());
    if path.is_file() {
        let refused = refuse_foreign(document, name, &path);
        return refused.map_or(Ok(SceneChoice { named_in: folder.into(), ..SceneChoice::file(path) }), Err);
    }
    let message = format!("there is no scene file '{}'", name.get_ref());
    let error = document.error(name.span(), message, format!("{} is not a file", path.display()));
    Err(match nearest_scene(&path) {
        // `meant` is in the folder of the missing file, so only the file's name in the config's path is replaced.
        Some(meant) => {
            let meant = Path::new(name.get_ref()).with_file_name(meant);
            error.with_help(format!("did you mean {}?", meant.display()))
        }
        None if Path::new(name.get_ref()).is_absolute() => error.with_help("name the file of a scene"),
        None => error.with_help("paths are relative to the config file"),
    })
}

/// Returns the name of the scene or mesh with the most similar name in the folder of a missing scene; `None` if no name
/// is similar enough. Experiments in this folder, which are TOML files like scenes, are skipped.
fn nearest_scene(missing: &Path) -> Option<OsString> {
    let is_experiment =
        |path: &Path| Opened::at(path).is_ok_and(|opened| experiment_in(opened, path).is_some());
    let meant = nearest_file_among(missing, |path| may_be_scene(path) && !is_experiment(path))?;
    meant.file_name().map(OsString::from)
}

/// Returns an error if the file is an experiment. Also returns an error if raycl recognises the file's type, but does
/// not read files of this type as scenes; pictures are an example. Returns `None` for all other files.
fn refuse_foreign(document: &Document, name: &Spanned<String>, path: &Path) -> Option<Error> {
    let opened = Opened::at(path).ok()?;
    let location = format!("{}: {}", document.location_of(name.span()), path.display());
    opened.filetype.refusal(&location, Wanted::Scene).or_else(|| {
        let experiment = experiment_in(opened, path)?;
        Some(document.located(name.span(), experiment, "not a scene"))
    })
}

/// Returns the error for an experiment in place of a scene; `None` if the file `opened` is no experiment.
fn experiment_in(opened: Opened, path: &Path) -> Option<Error> {
    // A mesh may be large, so it is not read here.
    let may_be = matches!(opened.filetype, FileType::Toml | FileType::Unclear);
    let text = may_be.then(|| opened.text(Kind::Toml))?.ok()?;
    experiment_instead(path, &text)
}

/// Returns a scene for every combination of the values and the numbers of samples in a `[[scene]]` entry.
fn product(document: &Document, entry: &SceneEntry, folder: &Path) -> Result<Vec<SceneChoice>> {
    let mut choices = vec![find(document, &entry.file, folder)?];
    for change in entry.set.iter().flat_map(|(key, values)| changes(key, values.get_ref())) {
        let Change { path, span, values } = &change;
        if values.is_empty() {
            let message = format!("'{path}' is empty");
            return Err(document.error(span.clone(), message, "expected at least one value"));
        }
        let location = document.location_of(span.clone());
        let vary =
            |choice: &SceneChoice| values.iter().map(|value| with(choice, &location, path, value)).collect();
        choices = choices.iter().flat_map(|choice| -> Vec<_> { vary(choice) }).collect();
    }
    let samples = samples(document, entry)?;
    let sampled = |choice: &SceneChoice| -> Vec<_> {
        samples.iter().map(|&samples| choice.clone().with_samples(samples)).collect()
    };
    Ok(choices.iter().flat_map(sampled).collect())
}

/// Returns the numbers of samples per pixel of a `[[scene]]` entry: 1 if the entry states none.
fn samples(document: &Document, entry: &SceneEntry) -> Result<Vec<u32>> {
    let Some(numbers) = &entry.samples else { return Ok(vec![1]) };
    let check = |number: i64, span| whole(document, number, span, "samples", &SAMPLES);
    match numbers.get_ref() {
        Numbers::One(number) => Ok(vec![check(*number, numbers.span())?]),
        Numbers::List(list) if list.is_empty() => {
            Err(document.error(numbers.span(), "'samples' is empty", "expected at least one number"))
        }
        Numbers::List(list) => list.iter().map(|number| check(*number.get_ref(), number.span())).collect(),
    }
}

/// A dotted key of a scene file, and the values that the config gives to this key.
struct Change<'a> {
    path: String,
    /// The location of the key in the config.
    span: Range<usize>,
    values: Vec<&'a Value>,
}

/// Returns the paths that a key of `set` changes, with the values of each path. A table in `set` changes only the keys
/// that it contains, since TOML does not distinguish `display = { exposure = 3 }` from `display.exposure = 3` (without
/// quotes). But if the config gives a list of values, a table in this list replaces the whole old value, with all its
/// keys.
fn changes<'a>(key: &Spanned<String>, values: &'a SceneValues) -> Vec<Change<'a>> {
    let path = key.get_ref().clone();
    let changed = match values {
        SceneValues::One(value) => below(path, value),
        SceneValues::List(list) => vec![(path, list.iter().collect())],
    };
    changed.into_iter().map(|(path, values)| Change { path, span: key.span(), values }).collect()
}

fn below(path: String, value: &Value) -> Vec<(String, Vec<&Value>)> {
    match value {
        Value::Table(table) if !table.is_empty() => {
            table.iter().flat_map(|(key, inner)| below(format!("{path}.{key}"), inner)).collect()
        }
        Value::Array(list) => vec![(path, list.iter().collect())],
        value => vec![(path, vec![value])],
    }
}

/// Returns a copy of `choice` (a scene file and the values to change in it) with one more changed value. `location` is
/// the location of the key in the config. The suffix of the scene's name gets `+key=value`, with only the last part of
/// the dotted key, and with escapes instead of line breaks (TOML writes some strings in several lines).
fn with(choice: &SceneChoice, location: &str, key: &str, value: &Value) -> SceneChoice {
    let mut choice = choice.clone();
    let short = key.rsplit('.').next().unwrap_or(key);
    choice.suffix.push_str(&line(&format!("+{short}={value}")));
    let origin = format!("{location}: {key} = {value}");
    choice.overrides.push(Setting { path: key.to_owned(), value: value.clone(), origin });
    choice
}
