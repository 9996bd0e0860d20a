//! Joins the source files of a strategy's program: the files of the strategy's family, and the files that
//! implement the strategy's values on its axes (such as `layout`).

use super::include::Branches;
use crate::error::{Error, Result, nearest};
use crate::sources::{Chain, Sources};
use crate::strategy::Strategy;

impl Sources {
    /// Returns a BLAKE3 hash of the names and contents of all kernel files, including the files of
    /// `--cl-dir`; `None` if a file cannot be read.
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

/// Joins kernel files, with the files that they include, to one text.
pub(super) struct Joiner<'a> {
    pub sources: &'a Sources,
    pub strategy: &'a Strategy,
    pub defines: &'a [(&'static str, u64)],
    /// The joined text.
    pub text: String,
    /// The files that the joined text consists of, each file once, in the order of the text.
    pub files: Vec<String>,
    /// The files that are being added, outermost first: each file of the list includes the next file.
    pub chain: Chain,
}

impl Joiner<'_> {
    /// Adds a file, and all files that this file includes. `#line` directives make compilers report the
    /// original file and line.
    pub fn add(&mut self, name: &str) -> Result<()> {
        let text = self.sources.read(name)?;
        self.add_text(name, &text)
    }

    fn add_text(&mut self, name: &str, text: &str) -> Result<()> {
        self.chain.enter(name, self.text.len())?;
        self.text.push_str(&format!("#line 1 \"{name}\"\n"));
        if !self.files.iter().any(|file| file == name) {
            self.files.push(name.to_owned());
        }
        let mut branches = Branches::default();
        let lines = self.sources.lines_of(name, text)?;
        for (number, line) in lines.iter().enumerate() {
            branches.pass(&line.directive, self.defines);
            match line.includes {
                Some(inner) if branches.may_be_live() => {
                    let (inner, text) = self
                        .included(inner)
                        .map_err(|error| self.sources.at_include(error, inner, name, number + 1))?;
                    self.add_text(&inner, &text)?;
                    self.text.push_str(&format!("#line {} \"{name}\"\n", number + 2));
                }
                Some(_) => self.text.push('\n'),
                None => {
                    self.text.push_str(line.text);
                    self.text.push('\n');
                }
            }
        }
        self.chain.leave();
        Ok(())
    }

    /// Returns the name and the text of an included file.
    fn included(&self, path: &str) -> Result<(String, String)> {
        let name = fill_in(path, self.strategy)?;
        let text = self.sources.read(&name)?;
        Ok((name, text))
    }
}

/// Replaces the first `{AXIS}` in a path by the strategy's value on this axis. Each `-` in the value becomes
/// `_`.
fn fill_in(path: &str, strategy: &Strategy) -> Result<String> {
    let Some((before, rest)) = path.split_once('{') else { return Ok(path.to_owned()) };
    let Some((axis, after)) = rest.split_once('}') else {
        return Err(Error::input("the path has a brace that is not closed").with_help(
            "close the brace: in a path, {AXIS} is replaced by the name of the strategy's value on that axis",
        ));
    };
    let axes = strategy.axes();
    let value = axes.iter().find(|(name, _)| *name == axis).map(|(_, value)| *value).ok_or_else(|| {
        let meant = nearest(axis, axes.iter().map(|(name, _)| *name)).unwrap_or("vectors");
        Error::input("the name in the path's braces is not an axis")
            .with_help(format!("did you mean {{{meant}}}?"))
    })?;
    Ok(format!("{before}{}{after}", value.replace('-', "_")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::strategy::preset;

    #[test]
    fn after_an_include_lines_are_counted_as_in_the_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("outer.cl"), "one\n#include \"inner.cl\"\nthree\n").unwrap();
        std::fs::write(folder.path().join("inner.cl"), "within\n").unwrap();
        let mut joiner = Joiner {
            sources: &Sources::Folder(folder.path().to_owned()),
            strategy: &preset("naive").unwrap().strategy,
            defines: &[],
            text: String::new(),
            files: Vec::new(),
            chain: Chain::default(),
        };
        joiner.add("outer.cl").unwrap();
        let expected =
            "#line 1 \"outer.cl\"\none\n#line 1 \"inner.cl\"\nwithin\n#line 3 \"outer.cl\"\nthree\n";
        assert_eq!(joiner.text, expected);
        joiner.add("inner.cl").unwrap();
        assert_eq!(joiner.files, ["outer.cl", "inner.cl"]);
    }

    #[test]
    fn the_hash_of_kernels_follows_the_text_and_the_name_of_every_file() {
        let folder = tempfile::tempdir().unwrap();
        let with = |name: &str, text: &str| {
            let own_folder = folder.path().join(name.replace('.', "-") + text);
            std::fs::create_dir_all(&own_folder).unwrap();
            std::fs::write(own_folder.join(name), text).unwrap();
            Sources::Folder(own_folder).hash().unwrap()
        };
        let hashes = [
            Sources::Embedded.hash().unwrap(),
            with("a.cl", "one"),
            with("a.cl", "two"),
            with("b.cl", "one"),
        ];
        let distinct: std::collections::HashSet<_> = hashes.iter().collect();
        assert_eq!(distinct.len(), hashes.len(), "{hashes:?}");
    }

    #[test]
    fn a_brace_in_a_path_is_the_strategys_value() {
        let strategy = preset("naive").unwrap().strategy;
        let intersector = strategy.axes().iter().find(|(axis, _)| *axis == "intersector").unwrap().1;
        let file = intersector.replace('-', "_");
        let of = |path: &str| fill_in(path, &strategy).map_err(|error| error.to_string());
        assert_eq!(of("cast/plain.cl").as_deref(), Ok("cast/plain.cl"));
        assert_eq!(of("cast/{intersector}.cl"), Ok(format!("cast/{file}.cl")));
        assert!(of("cast/{intersectr}.cl").unwrap_err().contains("is not an axis"));
        assert!(of("cast/{intersector.cl").unwrap_err().contains("a brace that is not closed"));
        let remedy = fill_in("cast/{intersectr}.cl", &strategy).unwrap_err().remedy().to_owned();
        assert_eq!(remedy, "did you mean {intersector}?");
    }
}
