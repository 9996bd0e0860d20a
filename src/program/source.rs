//! The text of a strategy's program: the files of its family and of its values, joined to one.

use super::include::Branches;
use crate::error::{Error, Result, nearest};
use crate::sources::{Chain, Sources, included};
use crate::strategy::Strategy;

impl Sources {
    /// BLAKE3 of all files, by name: those built in, and what a folder has in their places or adds.
    pub fn hash(&self) -> Option<String> {
        let mut hasher = blake3::Hasher::new();
        for name in self.files().ok()? {
            for part in [self.read(&name).ok()?.as_str(), &name] {
                hasher.update(&(part.len() as u64).to_le_bytes());
                hasher.update(part.as_bytes());
            }
        }
        Some(hasher.finalize().to_hex().to_string())
    }
}

/// Joins files.
pub(super) struct Joiner<'a> {
    pub sources: &'a Sources,
    pub strategy: &'a Strategy,
    pub defines: &'a [(&'static str, u64)],
    /// The text so far.
    pub text: String,
    /// The files it is made of, each once, in their order.
    pub files: Vec<String>,
    /// The files that are being added.
    pub chain: Chain,
}

impl Joiner<'_> {
    /// Adds a file with everything it includes. `#line` keeps compilers' messages at the file and line a person would edit.
    pub fn add(&mut self, name: &str) -> Result<()> {
        self.chain.enter(name, self.text.len())?;
        self.text.push_str(&format!("#line 1 \"{name}\"\n"));
        if !self.files.iter().any(|file| file == name) {
            self.files.push(name.to_owned());
        }
        let mut branches = Branches::default();
        for (number, line) in self.sources.read(name)?.lines().enumerate() {
            branches.pass(line, self.defines);
            match included(name, number + 1, line)? {
                Some(inner) if branches.may_be_live() => {
                    self.add(&fill_in(inner, self.strategy)?)?;
                    self.text.push_str(&format!("#line {} \"{name}\"\n", number + 2));
                }
                Some(_) => self.text.push('\n'),
                None => {
                    self.text.push_str(line);
                    self.text.push('\n');
                }
            }
        }
        self.chain.leave();
        Ok(())
    }
}

/// Puts the file name of the strategy's value where a path names an axis in braces.
fn fill_in(path: &str, strategy: &Strategy) -> Result<String> {
    let Some((before, rest)) = path.split_once('{') else { return Ok(path.to_owned()) };
    let Some((axis, after)) = rest.split_once('}') else {
        let message = format!("kernel include \"{path}\" has a brace that is not closed");
        return Err(Error::input(message).with_help(
            "close it: {AXIS} in a path is replaced by the file name of the strategy's value on that axis",
        ));
    };
    let axes = strategy.axes();
    let value = axes.iter().find(|(name, _)| *name == axis).map(|(_, value)| *value).ok_or_else(|| {
        let meant = nearest(axis, axes.iter().map(|(name, _)| *name)).unwrap_or("vectors");
        Error::input(format!("kernel include \"{path}\" names no axis"))
            .with_help(format!("did you mean {{{meant}}}?"))
    })?;
    Ok(format!("{before}{}{after}", value.replace('-', "_")))
}
