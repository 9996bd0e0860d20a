//! Kernel files: those built in, or a folder that replaces them.

use crate::error::{Error, Result};
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

    /// A file with what it includes in place, where no name depends on a strategy.
    pub fn read_joined(&self, name: &str) -> Result<String> {
        let mut text = format!("#line 1 \"{name}\"\n");
        for (number, line) in self.read(name)?.lines().enumerate() {
            match line.strip_prefix("#include \"").and_then(|rest| rest.split('"').next()) {
                Some(included) => {
                    text.push_str(&self.read_joined(included)?);
                    text.push_str(&format!("#line {} \"{name}\"\n", number + 2));
                }
                None => text.extend([line, "\n"]),
            }
        }
        Ok(text)
    }

    /// The names of all files that the program has of its own, in order.
    pub fn names() -> Vec<&'static str> {
        let mut names = Vec::new();
        file_names(&EMBEDDED, &mut names);
        names.sort_unstable();
        names
    }
}

fn file_names(folder: &'static Dir<'_>, names: &mut Vec<&'static str>) {
    names.extend(folder.files().filter_map(|file| file.path().to_str()));
    folder.dirs().for_each(|inner| file_names(inner, names));
}
