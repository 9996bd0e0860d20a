//! Recognises files by their first bytes, and some also by their length or by the extension of their name. If
//! raycl recognises a format that it does not read, the error message names this format.

mod endings;
mod opened;
mod signatures;
mod stl;
mod swapped;
mod text;

#[cfg(test)]
mod tests;

pub use swapped::{experiment_instead, scene_instead};

pub use crate::reader::{STANDARD_INPUT, is_standard_input};
pub use opened::{Opened, standard_input};

use crate::error::Error;
use crate::words::{path_word, quote};
use std::path::{Path, PathBuf};

/// The name of material files in messages; only meshes refer to such files.
pub const MTL: &str = "an MTL material file";

/// The name, in messages, of a binary file that is not recognised.
const UNKNOWN: &str = "a binary file of an unknown kind";
/// The name, in messages, of JSON that is not recognised as glTF.
const JSON: &str = "a JSON file";

/// The type of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileType {
    /// A file of one or more meshes.
    Mesh(MeshFormat),
    /// TOML: a scene or an experiment.
    Toml,
    /// An empty file, or text that matches no format. The reader of the file reports the mistake.
    Unclear,
    /// UTF-16 or UTF-32 text, which raycl cannot read.
    Utf16,
    /// A format that raycl does not read.
    Foreign(Foreign),
}

/// A mesh format that raycl reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// The Stanford polygon format, ASCII or binary.
    Ply,
    /// Stereolithography, ASCII or binary.
    Stl,
    /// glTF 2.0 as JSON.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
}

impl MeshFormat {
    /// Each format with its usual file extension, and its name with an article.
    const ALL: [(Self, &'static str, &'static str); 5] = [
        (Self::Obj, "obj", "an OBJ mesh"),
        (Self::Ply, "ply", "a PLY mesh"),
        (Self::Stl, "stl", "an STL mesh"),
        (Self::Gltf, "gltf", "a glTF scene (JSON)"),
        (Self::Glb, "glb", "a binary glTF scene (GLB)"),
    ];

    /// Returns the format's name with its article: `an OBJ mesh`.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(format, ..)| *format == self).map_or("a mesh", |(.., name)| name)
    }

    /// Returns the mesh format of a file's extension; `None` for other extensions. A final `.gz` is ignored.
    pub fn from_ending(path: &Path) -> Option<Self> {
        let ending = unpacked_name(path).extension()?.to_ascii_lowercase();
        Self::ALL.iter().find(|(_, usual, _)| ending == *usual).map(|(format, ..)| *format)
    }
}

/// Returns true if a file's extension is that of a scene file or a mesh. A final `.gz` is ignored.
pub fn may_be_scene(path: &Path) -> bool {
    is_toml(path) || MeshFormat::from_ending(path).is_some()
}

/// Returns true if the file's extension is `.toml`. A final `.gz` is ignored.
fn is_toml(path: &Path) -> bool {
    unpacked_name(path).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Returns the path without a final `.gz`.
pub fn unpacked_name(path: &Path) -> PathBuf {
    let packed = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
    if packed { path.with_extension("") } else { path.to_owned() }
}

/// A format that raycl does not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Foreign {
    /// The format's name with its article: `an FBX scene (ASCII)`.
    pub name: &'static str,
    /// The remedy for a user who has a file of this format; may be empty.
    pub remedy: &'static str,
}

/// The purpose for which the user named a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The user wants to render the file: a scene or a single mesh.
    Scene,
    /// The user's scene names the file as the mesh of an object.
    Mesh,
    /// The user wants to run the file as an experiment.
    Experiment,
}

impl Wanted {
    /// Returns a part of a message: a list of the formats that raycl reads for this purpose.
    pub fn read(self) -> &'static str {
        match self {
            Self::Scene => "raycl reads scenes (TOML) and meshes (OBJ, PLY, STL, glTF), also as .gz",
            Self::Mesh => "the key `mesh` of an [[object]] accepts OBJ, PLY, STL and glTF, also as .gz",
            Self::Experiment => "`raycl run` reads experiments (TOML), such as configs/quick.toml",
        }
    }
}

impl FileType {
    /// Recognises a file of `length` bytes that begins with `head`.
    pub fn of(head: &[u8], length: u64) -> Self {
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
        signatures::recognise(head, length).unwrap_or_else(|| text::recognise(head))
    }

    /// Returns an error if raycl does not read files of this type for the purpose `wanted`; otherwise, and for an
    /// unclear type, `None`. The message contains `name`, the file's name. The message and the remedy quote nothing
    /// from the file.
    pub fn refusal(self, name: &str, wanted: Wanted) -> Option<Error> {
        let refused =
            |what: &str, help: &str| Some(Error::input(format!("{name} is {what}")).with_help(help));
        match (self, wanted) {
            (Self::Foreign(Foreign { name, remedy }), _) => {
                // A user who wanted an experiment has no use for a mesh, so the texts in `TO_MESH`, which say how
                // to get a mesh, are left out.
                let leads_to_mesh = signatures::TO_MESH.contains(&remedy);
                let none = remedy.is_empty() || wanted == Wanted::Experiment && leads_to_mesh;
                let help = if none { String::new() } else { format!("; {remedy}") };
                refused(&format!("{name}, which raycl does not read"), &format!("{}{help}", wanted.read()))
            }
            (Self::Utf16, _) => Some(
                Error::input(format!(
                    "{name}:1: UTF-16 or UTF-32 text, which raycl does not read; expected UTF-8"
                ))
                .with_help("save the file as UTF-8"),
            ),
            (Self::Mesh(format), Wanted::Experiment) => refused(
                &format!("{}, not an experiment", format.name()),
                &format!(
                    "`raycl render {}` renders this mesh; {}",
                    quote(&path_word(Path::new(name))),
                    wanted.read()
                ),
            ),
            (Self::Toml, Wanted::Mesh) => refused("a TOML file, not a mesh", wanted.read()),
            _ => None,
        }
    }
}
