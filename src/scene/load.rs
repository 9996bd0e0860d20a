//! Loads a [`Scene`] from a path.

use super::animation::Animation;
use super::assemble::{Assembled, assemble};
use super::document::Document;
use super::frame_cache::FrameCache;
use super::setting::Setting;
use super::wire::SceneWire;
use super::{Orbit, Scene};
use crate::error::{Result, shortened_note};
use crate::filetype::experiment_instead;
use crate::reader::lies_in;
use crate::toml_read::from_text;
use std::path::Path;
use toml::Value;

/// A scene, with notes about how it was read.
#[derive(Debug)]
pub struct Loaded {
    /// The validated scene; for an animation, the scene of the first frame.
    pub scene: Scene,
    /// The axis about which the scene turns on a turntable.
    pub orbit: Orbit,
    /// The index of the first triangle of each object. In a glTF file without a scene file, each node with a
    /// mesh counts as an object. A ground that raycl added counts as the last object.
    pub object_starts: Vec<u32>,
    /// True if raycl added soft light, a sky and usually a ground. raycl adds them only to a bare mesh that has
    /// neither lights nor a sky.
    pub dressed: bool,
    /// True for a bare mesh, which has no scene file.
    pub is_bare: bool,
    /// True if the camera may depend on the pictures' aspect ratio, because raycl places it so that the whole
    /// scene is visible. If this field is true, pictures with another aspect ratio may need another camera.
    pub is_framed: bool,
    /// The animation, if the scene file has one. The animation makes the scenes of all frames after the
    /// first.
    pub animation: Option<Animation>,
    /// Notes for the user, for example on parts that were ignored or replaced by defaults, such as a missing MTL
    /// file.
    pub notes: Vec<String>,
}

/// The pictures for which raycl places the camera of a bare mesh, or of a scene that sets an azimuth or an
/// elevation.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// The ratio of the pictures' width to their height.
    pub aspect: f64,
    /// True if the scene turns on a turntable. raycl then places the camera so far away that the whole scene is
    /// visible at each of 24 equally spaced angles (`TURNS` in `framing.rs`).
    pub turns: bool,
    /// True if a bare mesh without lights and without a sky gets soft light, a sky and usually a ground.
    pub dressed: bool,
    /// The largest number of triangles that can be cast; `None` if this number is not known. Shapes that certainly
    /// have more triangles in all are refused before their triangles are made.
    pub most_triangles: Option<u64>,
}

impl Shot {
    /// Square pictures. A camera that is placed for square pictures also shows the whole scene in pictures
    /// that are wider than high, unless the scene sets the field of view across the width.
    pub const SQUARE: Self = Self { aspect: 1.0, turns: false, dressed: false, most_triangles: None };
}

/// Loads a scene file (TOML), or a mesh without a scene file (OBJ, PLY, STL, glTF). The file's contents show
/// whether it is a scene or a mesh; if the contents are unclear, the file's extension decides.
///
/// For a mesh without a scene file, the camera and the lights are those of the mesh's own file. If this file has
/// no camera, raycl places the camera so that the whole mesh is visible in images that are at least as wide as
/// high. The camera looks horizontally at an open mesh: into a room through the room's open side, and at any
/// other open mesh from the side to which the mesh's normals point on average. The camera looks at all other
/// meshes from the right, above and in front. If the mesh's file has no lights, the mesh gets a key light and a
/// fill light. raycl reverses the normals of the mesh's triangles that face away from the camera. (On a
/// turntable, see [`Shot::turns`], raycl reverses either all normals of the mesh or none.)
///
/// # Errors
///
/// Returns a user error. The error names the file, and the line if the mistake is in a line of a file. Mistakes are,
/// for example, files that cannot be read, unknown keys, values out of range, indices out of bounds, and scenes without
/// triangles. A scene that needs more memory than is available is also refused.
pub fn load_scene(path: &Path) -> Result<Loaded> {
    load_scene_with(path, &[])
}

/// Loads a scene with changed values. Each element of `overrides` has the dotted path of a value in the file,
/// such as `camera.position` or `object.0.triangles`, and the new value. For these paths, a mesh without a scene
/// file counts as a scene file whose only object is the mesh.
///
/// # Errors
///
/// Fails in the same cases as [`load_scene`], and if a path in `overrides` cannot be set.
pub fn load_scene_with(path: &Path, overrides: &[(String, Value)]) -> Result<Loaded> {
    let settings: Vec<_> = overrides.iter().map(|(path, value)| Setting::new(path, value.clone())).collect();
    load(path, &settings, Shot::SQUARE, true)
}

/// Loads a scene like [`load_scene_with`], for the pictures that `shot` describes. If raycl places the camera, it
/// places the camera so that the whole scene is visible in these pictures.
///
/// # Errors
///
/// Fails in the same cases as [`load_scene_with`].
pub fn load_scene_for(path: &Path, settings: &[Setting], shot: Shot) -> Result<Loaded> {
    load(path, settings, shot, true)
}

/// Loads a scene that another file names, in the same way as [`load_scene_with`]. `folder` is the folder of
/// the file that names the scene; messages quote the scene only if the scene's file is in `folder`. `shot`
/// describes the pictures, as for [`load_scene_for`].
///
/// # Errors
///
/// Fails in the same cases as [`load_scene_with`].
pub fn load_scene_named_in(folder: &Path, path: &Path, settings: &[Setting], shot: Shot) -> Result<Loaded> {
    load(path, settings, shot, lies_in(path, folder))
}

fn load(path: &Path, settings: &[Setting], shot: Shot, quotes: bool) -> Result<Loaded> {
    let document = Document::read(path, settings, quotes)?;
    let mut wire: SceneWire = from_text(&document.text).map_err(|error| {
        experiment_instead(path, &document.text)
            .or_else(|| document.not_toml(path, &error))
            .unwrap_or_else(|| document.misread(&error))
    })?;
    let unexpected = document.unexpected_ending(path);
    let mut notes: Vec<String> = unexpected.into_iter().chain(document.note_removed_fov()).collect();
    let is_bare = document.bare;
    let (mut assembled, mut animation) = match wire.animation.take() {
        None => (assemble(&document, wire, shot, &mut FrameCache::default())?, None),
        Some(of_file) => {
            let mut animation = Animation::of(document, of_file, shot)?;
            notes.extend(animation.notes_on_replaced(settings));
            (animation.assemble(1)?, Some(animation))
        }
    };
    assembled.scene.validate()?;
    assembled.note_averted(shot);
    let Assembled { scene, orbit, starts, dressed, is_framed, notes: of_frame, .. } = assembled;
    notes.extend(of_frame.all());
    if let Some(animation) = &mut animation {
        animation.keep_notes(of_frame);
    }
    Ok(Loaded {
        scene,
        orbit,
        object_starts: starts,
        dressed,
        is_bare,
        is_framed,
        animation,
        notes: notes.into_iter().map(shortened_note).collect(),
    })
}
