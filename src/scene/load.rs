//! From a path to a [`Scene`].

use super::assemble::{Assembled, assemble};
use super::document::Document;
use super::wire::SceneWire;
use super::{Orbit, Scene, facing};
use crate::error::{Result, shortened};
use crate::filetype::experiment_instead;
use crate::reader::lies_in;
use std::path::Path;
use toml::Value;

/// A scene, and what a user may want to know about how it was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The validated scene.
    pub scene: Scene,
    /// What it turns about on a turntable.
    pub orbit: Orbit,
    /// The number of each object's first triangle: of a TOML scene its objects, of a bare glTF its nodes with meshes.
    pub object_starts: Vec<u32>,
    /// Whether it is a bare mesh with a ground, soft light and a sky around it.
    pub dressed: bool,
    /// Sentences about what was passed over or made up, such as a missing material file.
    pub notes: Vec<String>,
}

/// What a scene without a camera of its own is framed for.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// Width over height of the pictures.
    pub aspect: f64,
    /// Whether it turns: it is then seen whole from all around.
    pub turns: bool,
    /// Whether a bare mesh gets a ground, soft light and a sky where it has no lights of its own.
    pub dressed: bool,
}

impl Shot {
    /// What fits pictures of any shape at least as wide as high.
    pub const SQUARE: Self = Self { aspect: 1.0, turns: false, dressed: false };
}

/// Loads a scene file (TOML) or a bare mesh (OBJ, PLY, STL, glTF), told apart by what they hold. A bare mesh is seen whole
/// from three quarters, in images at least as wide as high, lit by a key and a fill light, its normals turned to the viewer:
/// plain, as experiments cast it.
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
    load(path, overrides, Shot::SQUARE, true)
}

/// The same for a shot: a bare mesh is seen as large as its pictures have room for.
///
/// # Errors
/// As [`load_scene_with`].
pub fn load_scene_for(path: &Path, overrides: &[(String, Value)], shot: Shot) -> Result<Loaded> {
    load(path, overrides, shot, true)
}

/// The same for a scene that a file names: its text is quoted only where it lies in that file's folder.
///
/// # Errors
/// As [`load_scene_with`].
pub fn load_scene_named_in(folder: &Path, path: &Path, overrides: &[(String, Value)]) -> Result<Loaded> {
    load(path, overrides, Shot::SQUARE, lies_in(path, folder))
}

fn load(path: &Path, overrides: &[(String, Value)], shot: Shot, quotes: bool) -> Result<Loaded> {
    let document = Document::read(path, overrides, quotes)?;
    let wire: SceneWire = toml::from_str(&document.text).map_err(|error| {
        experiment_instead(path, &document.text)
            .or_else(|| document.not_toml(path, &error))
            .unwrap_or_else(|| document.misread(&error))
    })?;
    let mut notes: Vec<String> = document.unexpected_ending(path).into_iter().collect();
    let turned = wire.two_sided.unwrap_or(document.bare);
    let Assembled { scene, orbit, starts, dressed } = assemble(&document, wire, shot, &mut notes)?;
    scene.validate()?;
    notes.extend((!turned).then(|| facing::note(&scene, shot.aspect)).flatten());
    Ok(Loaded {
        scene,
        orbit,
        object_starts: starts,
        dressed,
        notes: notes.into_iter().map(shortened).collect(),
    })
}
