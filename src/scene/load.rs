//! From a path to a [`Scene`].

use super::assemble::assemble;
use super::overrides;
use super::toml_error::toml_error;
use super::wire::SceneWire;
use super::{Scene, framing};
use crate::error::{Error, Result, line_of, nearest_file, shortened};
use crate::filetype::{FileType, Opened, Wanted, experiment_instead};
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::DeTable;
use toml::{Table, Value};

/// A scene, and what a user may want to know about how it was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The validated scene.
    pub scene: Scene,
    /// Sentences about what was passed over or made up, such as a missing material file.
    pub notes: Vec<String>,
}

/// Loads a scene file (TOML) or a bare mesh (OBJ), told apart by what they hold. A bare mesh is seen whole from
/// three quarters, lit by a key and a fill light, its normals turned to the viewer.
///
/// # Errors
/// The user's mistake with its file and line: a file that cannot be read, an
/// unknown key, a value out of range, an index out of bounds, no triangles.
pub fn load_scene(path: &Path) -> Result<Loaded> {
    load_scene_with(path, &[])
}

/// Loads a scene with values set first, each at a dotted path into the file, such as
/// `camera.position` or `object.0.triangles`. For a bare mesh they are set in a
/// scene file whose only entry is the mesh.
///
/// # Errors
/// As [`load_scene`], and for a path that leads nowhere.
pub fn load_scene_with(path: &Path, overrides: &[(String, Value)]) -> Result<Loaded> {
    let document = Document::read(path, overrides)?;
    let wire: SceneWire = toml::from_str(&document.text).map_err(|error| {
        experiment_instead(path, &document.text)
            .or_else(|| document.not_toml(path, &error))
            .unwrap_or_else(|| toml_error(&document.name, &document.text, &error))
    })?;
    let mut notes: Vec<String> = document.unexpected_ending(path).into_iter().collect();
    let scene = assemble(&document, wire, &mut notes)?;
    scene.validate()?;
    Ok(Loaded { scene, notes: notes.into_iter().map(shortened).collect() })
}

/// A scene file's text, ready to be read.
pub(super) struct Document {
    /// What messages call it.
    pub name: String,
    /// TOML, with the overrides set.
    pub text: String,
    /// What the paths in it are relative to.
    pub folder: PathBuf,
    /// The file's name without its ending.
    pub stem: String,
    /// Whether it stands for a mesh without a scene file.
    pub bare: bool,
}

impl Document {
    fn read(path: &Path, overrides: &[(String, Value)]) -> Result<Self> {
        let opened = Opened::at(path).map_err(|error| unreadable("scene", path, &error))?;
        if let Some(refusal) = opened.filetype.refusal(&path.display().to_string(), Wanted::Scene) {
            return Err(refusal);
        }
        let bare = match opened.filetype {
            FileType::Obj => true,
            FileType::Toml => false,
            _ => is_named_obj(path),
        };
        let text = if bare { bare_text(path)? } else { read_text(path, opened)? };
        let mut document = Self {
            name: path.display().to_string(),
            text,
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            stem: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            bare,
        };
        if !overrides.is_empty() {
            document.set(overrides)?;
        }
        Ok(document)
    }

    /// A remark for a file that holds something else than its name says.
    fn unexpected_ending(&self, path: &Path) -> Option<String> {
        let held = if self.bare { "an OBJ mesh" } else { "a scene (TOML)" };
        let usual = self.bare == is_named_obj(path) || path.extension().is_none();
        (!usual).then(|| format!("{}: read as {held}, which it holds whatever its name says", path.display()))
    }

    /// The mistake of a file that does not say it is TOML and is not: it is likely none of what raycl reads.
    fn not_toml(&self, path: &Path, error: &toml::de::Error) -> Option<Error> {
        if path.extension().is_some_and(|ending| ending == "toml") || DeTable::parse(&self.text).is_ok() {
            return None;
        }
        let line = line_of(&self.text, error.span().map_or(0, |span| span.start));
        let reason = error.message().trim_end();
        let message = format!("{}:{line}: neither a scene (TOML) nor an OBJ mesh: {reason}", self.name);
        Some(Error::input(shortened(message)).with_help(Wanted::Scene.read()))
    }

    /// Sets values and writes the text anew, so that a message shows what was read.
    fn set(&mut self, values: &[(String, Value)]) -> Result<()> {
        let mut table: Table = self.text.parse().map_err(|e| toml_error(&self.name, &self.text, &e))?;
        overrides::apply(&mut table, values)?;
        self.text = toml::to_string(&table)
            .map_err(|error| Error::input(format!("{} with its overrides: {error}", self.name)))?;
        self.name.push_str(" with overrides");
        Ok(())
    }

    /// Gives a mistake that has no place yet a place in this document.
    pub fn place(&self, span: Range<usize>, error: Error, label: &str) -> Error {
        error.placed(|message| self.error(span, message, label))
    }

    /// A mistake at a place in this document.
    pub fn error(&self, span: Range<usize>, message: impl Into<String>, label: &str) -> Error {
        Error::in_file(&self.name, self.text.as_str(), span, message, label)
    }
}

fn is_named_obj(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"))
}

/// The scene file that a bare mesh stands for.
fn bare_text(path: &Path) -> Result<String> {
    let file = path.file_name().and_then(|name| name.to_str());
    let file = file.ok_or_else(|| Error::input(format!("{}: the name is not UTF-8", path.display())))?;
    Ok(format!("[[object]]\nobj = {}\n", Value::from(file)))
}

fn read_text(path: &Path, opened: Opened) -> Result<String> {
    let bytes = opened.bytes().map_err(|error| unreadable("scene", path, &error))?;
    if bytes.trim_ascii().is_empty() {
        return Err(Error::input(format!("{} is empty", path.display()))
            .with_help("a scene has at least an [[object]]; docs/scenes.md has an example"));
    }
    String::from_utf8(bytes).map_err(|error| {
        let line =
            1 + error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count();
        Error::input(format!("{}:{line}: not UTF-8; a scene is a TOML file or an .obj file", path.display()))
    })
}

/// The error for a file that cannot be read, with the nearest name beside it.
pub(super) fn unreadable(what: &str, path: &Path, error: &std::io::Error) -> Error {
    let message = format!("cannot read the {what} `{}`: {error}", path.display());
    match nearest_file(path) {
        Some(meant) => Error::input(message).with_help(format!("did you mean `{}`?", meant.display())),
        None => Error::input(message).with_help("give the path of a scene (.toml) or a mesh (.obj)"),
    }
}

/// The ball a bare mesh is framed by; scenes with a file of their own have none.
pub(super) fn bare_ball(document: &Document, mesh: &super::Mesh) -> Option<framing::Ball> {
    document.bare.then(|| framing::Ball::around(mesh))
}
