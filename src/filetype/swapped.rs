//! Recognises a scene that was passed as an experiment, and an experiment that was passed as a scene.

use crate::error::Error;
use crate::words::{path_word, quote};
use std::path::Path;
use toml::de::DeTable;

/// Keys that only scenes have.
const SCENE_KEYS: [&str; 4] = ["object", "light", "camera", "display"];
/// Keys that only experiments have.
const EXPERIMENT_KEYS: [&str; 7] =
    ["question", "expectation", "image_sizes", "local_sizes", "strategies", "strategy", "scenes"];

/// Returns the error for an experiment that could not be read because the file is a scene. Returns `None` if
/// the file is no scene.
pub fn scene_instead(path: &Path, text: &str) -> Option<Error> {
    let file = path.file_name().unwrap_or_default().display();
    has_only(text, &SCENE_KEYS, &EXPERIMENT_KEYS).then(|| {
        Error::input(format!("{} is a scene, not an experiment", path.display())).with_help(format!(
            "`raycl render {}` renders this scene; an experiment in the scene's folder lists the scene as \
             scenes = [\"{file}\"]",
            quote(&path_word(path))
        ))
    })
}

/// Returns the error for a scene that could not be read because the file is an experiment. Returns `None` if
/// the file is no experiment.
pub fn experiment_instead(path: &Path, text: &str) -> Option<Error> {
    has_only(text, &EXPERIMENT_KEYS, &SCENE_KEYS).then(|| {
        Error::input(format!("{} is an experiment, not a scene", path.display())).with_help(format!(
            "`raycl run {}` runs this experiment; `raycl render` needs one of its scenes",
            quote(&path_word(path))
        ))
    })
}

/// Returns true if the TOML text has at least one key of the list `these` and no key of the list `others`.
fn has_only(text: &str, these: &[&str], others: &[&str]) -> bool {
    let Ok(table) = DeTable::parse(text) else { return false };
    let has = |keys: &[&str]| keys.iter().any(|key| table.get_ref().contains_key(*key));
    has(these) && !has(others)
}
