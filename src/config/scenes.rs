//! The scenes of a config: scene files, and scene files with changed values.

use std::path::Path;

use toml::{Spanned, Value};

use super::document::Document;
use super::types::SceneChoice;
use super::wire::{Experiment, SceneEntry, SceneValues};
use crate::error::{Error, Result, nearest_file};
use crate::filetype::{Opened, Wanted};
use crate::scene::Setting;

/// Returns every scene of the config once, unchanged files first.
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
        let error = document.error(0..0, "there is no scene", "expected scenes = [...] or [[scene]]");
        return Err(error.with_help("add scenes = [\"FILE\"]; paths are relative to the config file"));
    }
    let mut kept: Vec<SceneChoice> = Vec::new();
    for scene in all {
        if !kept.contains(&scene) {
            kept.push(scene);
        }
    }
    Ok(kept)
}

fn find(document: &Document, name: &Spanned<String>, folder: &Path) -> Result<SceneChoice> {
    let path = folder.join(name.get_ref());
    if path.is_file() {
        let refused = refuse_foreign(document, name, &path);
        return refused.map_or(Ok(SceneChoice { named_in: folder.into(), ..SceneChoice::file(path) }), Err);
    }
    let message = format!("there is no scene file '{}'", name.get_ref());
    let error = document.error(name.span(), message, format!("{} is not a file", path.display()));
    Err(match nearest_file(&path) {
        Some(meant) => error.with_help(format!("did you mean {}?", meant.display())),
        None => error.with_help("paths are relative to the config file"),
    })
}

/// Returns an error if the file is of a type that raycl recognises but does not read as a scene, such as a picture;
/// otherwise `None`.
fn refuse_foreign(document: &Document, name: &Spanned<String>, path: &Path) -> Option<Error> {
    let filetype = Opened::at(path).ok()?.filetype;
    filetype.refusal(&format!("{}: {}", document.place_of(name.span()), path.display()), Wanted::Scene)
}

/// Returns a scene for every combination of the values in a `[[scene]]` entry.
fn product(document: &Document, entry: &SceneEntry, folder: &Path) -> Result<Vec<SceneChoice>> {
    let mut choices = vec![find(document, &entry.file, folder)?];
    for (key, values) in &entry.set {
        let values = match values.get_ref() {
            SceneValues::One(value) => vec![value],
            SceneValues::List(list) => list.iter().collect(),
        };
        if values.is_empty() {
            let message = format!("'{}' is empty", key.get_ref());
            return Err(document.error(key.span(), message, "expected at least one value"));
        }
        let vary =
            |choice: &SceneChoice| values.iter().map(|value| with(choice, document, key, value)).collect();
        choices = choices.iter().flat_map(|choice| -> Vec<_> { vary(choice) }).collect();
    }
    Ok(choices)
}

/// Returns a copy of the choice with one more changed value. The copy's suffix names the value by the last part of the
/// value's key.
fn with(choice: &SceneChoice, document: &Document, key: &Spanned<String>, value: &Value) -> SceneChoice {
    let mut choice = choice.clone();
    let (place, key) = (document.place_of(key.span()), key.get_ref());
    let short = key.rsplit('.').next().unwrap_or(key);
    choice.suffix.push_str(&format!("+{short}={value}"));
    let origin = format!("{place}: {key} = {value}");
    choice.overrides.push(Setting { path: key.clone(), value: value.clone(), origin });
    choice
}
