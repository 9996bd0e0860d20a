//! Kernel sources: embedded in the binary, or a folder that replaces them; flattened to one text.

use crate::error::{Error, Result, nearest};
use crate::strategy::Strategy;
use include_dir::{Dir, include_dir};
use std::path::PathBuf;

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/cl");

/// Where kernel files come from.
#[derive(Clone, Debug, Default)]
pub enum Sources {
    /// The files this binary was built with.
    #[default]
    Embedded,
    /// A folder laid out as `cl/` is, for who edits kernels.
    Folder(PathBuf),
}

impl Sources {
    /// The text of one file, named relative to `cl/`.
    pub fn read(&self, name: &str) -> Result<String> {
        match self {
            Self::Embedded => {
                let text = EMBEDDED.get_file(name).and_then(|file| file.contents_utf8());
                text.map(str::to_owned).ok_or_else(|| Error::run(format!("there is no kernel file {name}")))
            }
            Self::Folder(folder) => {
                let path = folder.join(name);
                std::fs::read_to_string(&path)
                    .map_err(|error| Error::input(format!("cannot read {}: {error}", path.display())))
                    .map_err(|error| error.with_help("--cl-dir wants a folder laid out as raycl's cl/"))
            }
        }
    }

    /// BLAKE3 of all files that the program has of its own, by name: those a folder has in their places, if it is one.
    pub fn hash(&self) -> Option<String> {
        let mut names = Vec::new();
        file_names(&EMBEDDED, &mut names);
        names.sort();
        let mut hasher = blake3::Hasher::new();
        for name in names {
            for part in [self.read(&name).ok()?, name] {
                hasher.update(&(part.len() as u64).to_le_bytes());
                hasher.update(part.as_bytes());
            }
        }
        Some(hasher.finalize().to_hex().to_string())
    }

    /// `cast.cl` with everything it includes for `strategy`, one text. `#line` keeps compilers' messages at
    /// the file and line a person would edit.
    pub fn flatten(&self, strategy: &Strategy) -> Result<String> {
        let mut text = String::new();
        self.append("cast.cl", strategy, &mut text)?;
        Ok(text)
    }

    fn append(&self, name: &str, strategy: &Strategy, text: &mut String) -> Result<()> {
        text.push_str(&format!("#line 1 \"{name}\"\n"));
        for (number, line) in self.read(name)?.lines().enumerate() {
            match line.strip_prefix("#include \"").and_then(|rest| rest.split('"').next()) {
                Some(included) => {
                    self.append(&fill_in(included, strategy)?, strategy, text)?;
                    text.push_str(&format!("#line {} \"{name}\"\n", number + 2));
                }
                None => {
                    text.push_str(line);
                    text.push('\n');
                }
            }
        }
        Ok(())
    }
}

fn file_names(folder: &Dir<'_>, names: &mut Vec<String>) {
    names.extend(folder.files().filter_map(|file| file.path().to_str().map(str::to_owned)));
    folder.dirs().for_each(|inner| file_names(inner, names));
}

/// Puts the file name of the strategy's value where a path names an axis in braces.
fn fill_in(path: &str, strategy: &Strategy) -> Result<String> {
    let Some((before, rest)) = path.split_once('{') else { return Ok(path.to_owned()) };
    let Some((axis, after)) = rest.split_once('}') else {
        return Err(Error::input(format!("kernel include \"{path}\" has a brace that is not closed")));
    };
    let axes = strategy.axes();
    let value = axes.iter().find(|(name, _)| *name == axis).map(|(_, value)| *value).ok_or_else(|| {
        let meant = nearest(axis, axes.iter().map(|(name, _)| *name)).unwrap_or("vectors");
        Error::input(format!("kernel include \"{path}\" names no axis; did you mean {{{meant}}}?"))
    })?;
    Ok(format!("{before}{}{after}", file_of(axis, value)))
}

/// The file of a value: its name, but 16- and 32-bit indices share one file, what is rasterised casts its shadow
/// rays exhaustively, and what walks a tree in tiles casts single rays as `bvh` does.
fn file_of(axis: &str, value: &str) -> String {
    match (axis, value) {
        ("layout", "indexed16" | "indexed32") => "indexed".to_owned(),
        ("traversal", "raster") => "exhaustive".to_owned(),
        ("traversal", "tile") => "bvh".to_owned(),
        _ => value.replace('-', "_"),
    }
}
