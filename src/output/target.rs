//! One file that a command writes.

use super::mark::{self, maker};
use super::place::{Choice, folder_of, permit, put};
use crate::error::{Error, Result};
use serde::Serialize;
use std::fs::File;
use std::io::{Result as IoResult, Write as _};
use std::path::{Path, PathBuf};

/// Where a command writes a file of its own.
#[derive(Clone, Debug)]
pub struct Target {
    path: PathBuf,
    choice: Choice,
}

impl Target {
    /// A file that the user named.
    pub fn new(path: impl Into<PathBuf>, choice: Choice) -> Self {
        Self { path: path.into(), choice }
    }

    /// A file of a folder of results, where every file is raycl's.
    pub fn of_results(path: impl Into<PathBuf>) -> Self {
        Self::new(path, Choice { force: true, elsewhere: "--out DIR" })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Finds out before any work is done whether [`write`](Self::write) would refuse it.
    pub fn check(&self) -> Result<()> {
        folder_of(&self.path)?;
        permit(&self.path, self.choice, maker).map(drop)
    }

    /// Puts the file that `write` writes, with a blank mark in it, in its place, whole or not at all.
    pub fn write(&self, write: impl FnOnce(&mut File) -> IoResult<()>) -> Result<()> {
        put(&self.path, self.choice, maker, |file| {
            write(file)?;
            mark::seal(file)
        })
    }

    /// Writes indented JSON with its mark; it is on the disk when this returns.
    pub fn write_json(&self, value: &impl Serialize) -> Result<()> {
        let text = serde_json::to_string_pretty(value).map_err(|error| Error::run(error.to_string()))?;
        let text = mark::json(&text);
        put(&self.path, self.choice, maker, |file| {
            writeln!(file, "{text}")?;
            mark::seal(file)?;
            file.sync_all()
        })
    }
}
