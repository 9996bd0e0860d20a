//! Reads experiments. The TOML file of an experiment, here called a config, is read into the types of the module
//! `wire`. The module `validate` checks the values that were read from the file and from `--set`, and makes an
//! [`Experiment`] of them. A mistake in the file is reported with its line, unless the file is empty or no experiment.
//! A mistake in a value of `--set` has no line of the file, so it is reported with this value.

mod document;
mod lists;
mod numbers;
mod scenes;
mod schema;
mod sizes;
mod strategies;
#[cfg(test)]
mod tests;
mod types;
mod validate;
mod wire;

pub use document::with_absolute_paths;
pub use types::{
    Baseline, DeviceWord, Emulate, Experiment, NamedStrategy, SceneChoice, Timing, have_one_shape,
};

use std::path::Path;

use crate::error::{Error, Result};
use crate::filetype::{Opened, Wanted, is_standard_input, scene_instead};
use crate::reader::Kind;
use document::Document;

/// Returns the JSON schema of an experiment's file.
pub fn schema() -> serde_json::Value {
    crate::schema::of::<wire::Experiment>("raycl experiment")
}

/// Reads the experiment at `path`, with `overrides` (dotted key, value) merged into it.
///
/// An override's value is read as TOML if it is valid TOML without a line break, otherwise as a string. An array in
/// the file is replaced by the override's array, and a table is merged with the override's table. A key may contain
/// the index of an element of an array: `strategy.0.width`. Paths of scenes are relative to the folder of the file.
/// Any mistake in the file or in an override is returned as an input error (a mistake of the user), which contains a
/// remedy. The error names the file and, unless the file is empty or no experiment, the mistake's line. For a mistake
/// in an override, the error names `--set` and quotes the override instead.
pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<Experiment> {
    let unreadable = |error| {
        let otherwise = "name an experiment file (.toml), such as configs/quick.toml in raycl's repository; \
            `raycl reproduce` runs the experiments of the student paper (docs/paper.md) without a file";
        Error::unreadable("experiment", path, &error, otherwise)
    };
    if is_standard_input(path) {
        return Err(Error::input("an experiment is not read from standard input (`-`)").with_help(
            "save the experiment as a file, and name this file: raycl reads the file again, for example when a run is resumed",
        ));
    }
    let opened = Opened::at(path).map_err(unreadable)?;
    if let Some(refusal) = opened.filetype.refusal(&path.display().to_string(), Wanted::Experiment) {
        return Err(refusal);
    }
    let text = opened.text(Kind::Toml).map_err(unreadable)?;
    if text.trim().is_empty() {
        return Err(Error::input(format!("{} is empty", path.display())).with_help(
            "docs/experiments.md lists every key of an experiment, and configs/quick.toml is an example",
        ));
    }
    parse(path, text, overrides)
}

/// Returns the experiment that the `text` of a config describes. `path` is the config's name in messages; paths of
/// scenes are relative to the folder of `path`.
pub fn parse(path: &Path, text: String, overrides: &[(String, String)]) -> Result<Experiment> {
    parse_as(path.display().to_string(), path, text, overrides)
}

/// Like [`parse`], for the `text` of a config that is built into raycl. `path` may be a file that the user does not
/// know, so messages show `name` instead.
pub fn parse_built_in(
    path: &Path,
    name: &str,
    text: &str,
    overrides: &[(String, String)],
) -> Result<Experiment> {
    parse_as(format!("{name} (built in)"), path, text.to_owned(), overrides)
}

fn parse_as(shown: String, path: &Path, text: String, overrides: &[(String, String)]) -> Result<Experiment> {
    let document = Document::new(shown, text, overrides)?;
    let wire = document.read().map_err(|error| scene_instead(path, document.text()).unwrap_or(error))?;
    validate::experiment(wire, path, &document)
}
