//! What a file is, by its first bytes: what raycl does not read is named, not read as something else.

mod signatures;
mod swapped;
mod text;

#[cfg(test)]
mod tests;

pub use swapped::{experiment_instead, scene_instead};

use crate::error::Error;
use crate::reader::{self, Kind};
use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

/// How much of a file is looked at.
const HEAD_BYTES: usize = 1 << 16;

/// What a file of materials is called: only meshes name such files.
pub const MTL: &str = "an MTL material file";

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileType {
    /// A Wavefront OBJ mesh.
    Obj,
    /// TOML: a scene or an experiment.
    Toml,
    /// Empty, or text that says neither: who reads it says what is wrong with it.
    Unclear,
    /// Text that no reader here takes.
    Utf16,
    /// A format that raycl does not read.
    Foreign(Foreign),
}

/// A format that raycl does not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Foreign {
    /// With its article: `an STL mesh (ASCII)`.
    pub name: &'static str,
    /// What to do with such a file; may be empty.
    pub remedy: &'static str,
}

/// What a file is wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// To be rendered: a scene or a bare mesh.
    Scene,
    /// An object of a scene.
    Mesh,
    /// To be run.
    Experiment,
}

impl Wanted {
    /// What is read there.
    pub fn read(self) -> &'static str {
        match self {
            Self::Scene => "raycl reads scenes (TOML) and OBJ meshes",
            Self::Mesh => "`obj` reads OBJ meshes",
            Self::Experiment => "`raycl run` reads experiments (TOML), such as configs/quick.toml",
        }
    }
}

impl FileType {
    /// What a file of `length` bytes that begins with `head` is.
    pub fn of(head: &[u8], length: u64) -> Self {
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        signatures::recognise(head, length).unwrap_or_else(|| text::recognise(head))
    }

    /// Why the file called `name` cannot be read as what is wanted, if it cannot: two short lines, and none of the file.
    pub fn refusal(self, name: &str, wanted: Wanted) -> Option<Error> {
        let refused =
            |what: &str, help: &str| Some(Error::input(format!("{name} is {what}")).with_help(help));
        match (self, wanted) {
            (Self::Foreign(Foreign { name, remedy }), _) => {
                // No export of a mesh is an experiment.
                let none = remedy.is_empty() || wanted == Wanted::Experiment && remedy == signatures::EXPORT;
                let help = if none { String::new() } else { format!("; {remedy}") };
                refused(&format!("{name}, which raycl does not read"), &format!("{}{help}", wanted.read()))
            }
            (Self::Utf16, _) => Some(
                Error::input(format!("{name}:1: UTF-16 text, which raycl does not read; expected UTF-8"))
                    .with_help("save it as UTF-8"),
            ),
            (Self::Obj, Wanted::Experiment) => refused(
                "an OBJ mesh, not an experiment",
                &format!("`raycl render {name}` makes a picture of it; {}", wanted.read()),
            ),
            (Self::Toml, Wanted::Mesh) => refused("a TOML file, not a mesh", wanted.read()),
            _ => None,
        }
    }
}

/// A file of which only the first bytes have been read yet.
pub struct Opened {
    file: File,
    head: Vec<u8>,
    /// What it is.
    pub filetype: FileType,
}

impl Opened {
    /// Opens an ordinary file and looks what it is.
    ///
    /// # Errors
    /// What the system says, or that it is no ordinary file.
    pub fn at(path: &Path) -> io::Result<Self> {
        let file = reader::open(path)?;
        let length = file.metadata()?.len();
        let mut head = Vec::new();
        (&file).take(HEAD_BYTES as u64).read_to_end(&mut head)?;
        let filetype = FileType::of(&head, length);
        Ok(Self { file, head, filetype })
    }

    /// The whole file, within the limit of its kind.
    ///
    /// # Errors
    /// As [`reader::rest`].
    pub fn bytes(self, kind: Kind) -> io::Result<Vec<u8>> {
        reader::rest(self.file, self.head, kind)
    }

    /// The same as text.
    ///
    /// # Errors
    /// What the system says, that it is too large, or that it is not UTF-8.
    pub fn text(self, kind: Kind) -> io::Result<String> {
        reader::utf8(self.bytes(kind)?)
    }
}
