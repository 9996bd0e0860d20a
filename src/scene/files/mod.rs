//! Reads mesh files: OBJ, PLY, STL and glTF. The contents of a file determine its format; if they do not show the
//! format, the file's extension decides.

mod colours;
mod flaw;
mod gltf;
mod joined;
mod lights;
mod origin;
mod pictures;
mod ply;
mod stl;
mod unused_parts;

use super::obj::{self, Permitted, Reach};
use super::{Camera, Mesh, Triangle};
use crate::error::{Error, Result};
use crate::filetype::{FileType, MeshFormat, Opened, unpacked_name};
use crate::memory::Available;
use crate::reader::Kind;
use crate::words::{counted, counted_are};
use flaw::Named;
use glam::{DVec3, Vec3};
use origin::Limit;
use std::path::Path;

pub(in crate::scene) use colours::{
    full_channel, is_outside, linear, note_bytes, note_clear, note_outside, paint,
};
pub(in crate::scene) use lights::{FileLight, note as note_lights, of_file as lights_of_file};
pub(in crate::scene) use origin::{LARGEST, Placement, is_valid, note_inexact, note_rounded, placement_of};
pub(in crate::scene) use pictures::{Pictures, Usage, brightness_to_alpha, room_for};

/// Memory needed to read a mesh, as a multiple of the file's size. The memory contains the file's bytes and,
/// for a short time, two copies of the positions and triangles. On 2026-11-20, 3.2 times the file's size was
/// measured for two OBJ meshes of a dragon, with 202,520 and 810,080 triangles.
const READING_FACTOR: u64 = 4;

/// A triangle counts as almost a line if the sine of its angle at the first corner is at most this value.
const THIN: f64 = 1e-6;

/// The contents of a mesh file, with notes on ignored parts.
#[derive(Clone, Default)]
pub(in crate::scene) struct MeshFile {
    /// The mesh. Corners without a normal have the index [`MISSING`](super::normals::MISSING).
    pub mesh: Mesh,
    /// Number of vertices that were joined with other vertices at equal positions, so that edges between faces with
    /// vertices of their own can be smooth. The joined corners of an STL do not count.
    pub joined: usize,
    /// How the mesh was moved and scaled, in double precision, before its positions were rounded to single
    /// precision.
    pub placement: Placement,
    /// For a glTF file: the index of the first triangle of each node with a mesh, except the first such node. If no
    /// node has a mesh, the list has the index of the first triangle of each mesh, except the first mesh. Empty for
    /// other files.
    pub more_starts: Vec<u32>,
    /// The first usable camera of the file, moved and scaled like the mesh; `None` if there is none.
    pub camera: Option<Camera>,
    /// The ratio of a picture's width to its height for which the file's camera is meant; `None` if the file has none.
    pub camera_aspect: Option<f32>,
    /// Notes for the user that are shown only if the file's camera is used.
    pub camera_notes: Vec<String>,
    /// The file's lights, moved and scaled like the mesh.
    pub lights: Vec<FileLight>,
    /// Notes for the user that are shown only if the file's lights are used.
    pub light_notes: Vec<String>,
    /// For a glTF file: the number of the mesh's materials that ask for light on both sides of their surfaces.
    pub double_sided: usize,
    /// True if the mesh may have creases: if some of its normals were generated, and it was not made flat afterwards.
    pub creased: bool,
    /// Notes for the user on parts of the file that raycl ignores or changes.
    pub notes: Vec<String>,
    /// Notes that are shown only if the scene uses a part of the file.
    pub notes_on: Vec<(Part, String)>,
}

/// A part of a mesh file that a scene may leave out or replace. Notes on this part are then not shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::scene) enum Part {
    /// Textures and texture coordinates.
    Textures,
    /// Textures that are multiplied by the colours of vertices.
    TintedTextures,
    /// The colours of vertices.
    VertexColours,
    /// Normals that raycl generates, which make edges smooth.
    SmoothEdges,
}

impl MeshFile {
    /// Undoes the scaling of the mesh, of the file's camera and of the file's lights, so that they have the size that
    /// the file states. All objects of a scene have the same unit of length. Adds a note if no triangle of the rescaled
    /// mesh has an area.
    pub fn unscaled(mut self) -> Self {
        let scale = std::mem::replace(&mut self.placement.scale, 1.0);
        if scale != 1.0 {
            self.mesh.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() / scale).as_vec3());
            self.place_seen(&Placement { origin: DVec3::ZERO, scale: 1.0 / scale });
            self.notes.extend(invisible(&self.mesh));
        }
        self
    }

    /// Adds the notes on the parts of the file for which `is_used` returns true to the notes that are shown. Drops the
    /// other notes on parts.
    pub fn keep_notes(&mut self, is_used: impl Fn(Part) -> bool) {
        let kept = self.notes_on.drain(..).filter(|(part, _)| is_used(*part)).map(|(_, note)| note);
        self.notes.extend(kept);
    }

    /// Moves and scales the file's camera and lights, but not the mesh.
    pub fn place_seen(&mut self, placement: &Placement) {
        let placed = |camera: Camera| placement.camera(camera.position.as_dvec3(), &camera);
        self.camera = self.camera.map(placed);
        self.lights.iter_mut().for_each(|light| *light = light.placed_by(placement));
    }
}

/// Returns the format of an open mesh file. If the contents do not show the format, the extension of `path`
/// decides. Returns `None` if the file is not a mesh.
pub(in crate::scene) fn format(opened: &Opened, path: &Path) -> Option<MeshFormat> {
    match opened.filetype {
        FileType::Mesh(format) => Some(format),
        FileType::Unclear => MeshFormat::from_ending(path),
        _ => None,
    }
}

/// Returns a note if the format of a file's contents, `format`, differs from the format that the file's extension
/// stands for. `None` stands for a scene file. A file without an extension has no note.
pub(in crate::scene) fn unexpected_ending(format: Option<MeshFormat>, path: &Path) -> Option<String> {
    let usual = format == MeshFormat::from_ending(path) || unpacked_name(path).extension().is_none();
    let format = format.map_or("a scene (TOML)", MeshFormat::name);
    (!usual).then(|| format!("read as {format}, because of its contents and despite its name"))
}

/// Reads a mesh and the files that it names. The named files must be in the mesh's folder, unless files elsewhere are
/// permitted. Equal positions may be joined ([`joined`]). Adds notes if normals are zero, and if no triangle has an
/// area. Returns an error if the mesh has no triangles, or if reading it needs more memory than is available.
pub(in crate::scene) fn read(
    path: &Path,
    opened: Opened,
    format: MeshFormat,
    permitted: Permitted,
) -> Result<MeshFile> {
    let length = opened.length;
    let sum = format!("{READING_FACTOR} B x {length} bytes of the file");
    Available::read().hold(READING_FACTOR * length, &format!("reading {}", path.display()), &sum)?;
    let unreadable = |error| Error::unreadable("mesh", path, &error, "give the path of a mesh");
    let bytes = opened.bytes(Kind::Mesh).map_err(unreadable)?;
    let (name, folder) = (path.display().to_string(), path.parent().unwrap_or(Path::new("")));
    // An empty OBJ file is refused later: the reader of OBJ files has its own message for it.
    if bytes.is_empty() && format != MeshFormat::Obj {
        let message = format!("{name} is empty; expected {}", format.name());
        return Err(Error::input(message).with_help("copy, download or export the file again"));
    }
    let reach = Reach { folder, permitted };
    let named = Named { name: &name, quotes: permitted.quotes };
    let limit = Limit::of(permitted.scaled);
    let mut file = match format {
        MeshFormat::Obj => obj::parse(&name, reach, &bytes),
        MeshFormat::Ply => ply::parse(named, &bytes, limit),
        MeshFormat::Stl => stl::parse(named, &bytes, limit),
        MeshFormat::Gltf | MeshFormat::Glb => gltf::parse(&name, reach, &bytes),
    }?;
    if file.mesh.triangles.is_empty() {
        // An STL contains nothing but triangles.
        let help = match format {
            MeshFormat::Stl => {
                "the model is empty: change it in the program that wrote the file, and export it again"
            }
            _ => {
                "a mesh needs triangles: point clouds and lines are not drawn; MeshLab, for example, makes triangles of \
                  points"
            }
        };
        let message = format!("{name}: no triangles; the file is {} without a face", format.name());
        return Err(Error::input(message).with_help(help));
    }
    file.joined = joined::join_positions(&mut file.mesh);
    file.notes.extend(note_normals(&file.mesh));
    file.notes.extend(invisible(&file.mesh));
    Ok(file)
}

/// Returns a note on triangles with normals that are zero, which are later replaced by the normals of the triangles'
/// planes. Normals that are not finite have become zero, too. Triangles without area do not count, since they are not
/// visible. Must be called before normals are generated, because generated normals may be zero.
pub(in crate::scene) fn note_normals(mesh: &Mesh) -> Option<String> {
    if !mesh.normals.contains(&Vec3::ZERO) {
        return None;
    }
    // A missing normal has an index beyond the end of the list.
    let is_zero = |index: &u32| mesh.normals.get(*index as usize) == Some(&Vec3::ZERO);
    let is_concerned =
        |triangle: &&Triangle| triangle.normals.iter().any(is_zero) && has_area(mesh, triangle);
    let count = mesh.triangles.iter().filter(is_concerned).count();
    let triangles = counted_are(count, "triangle with a normal that is zero or not finite");
    let note = || format!("{triangles} changed: each such normal becomes the normal of its triangle's plane");
    (count > 0).then(note)
}

/// Returns a note if most vertices of a mesh are corners of no triangle, as in a cloud of points of which a part has
/// faces. `invalid` is the number of vertices that are not valid; these do not count. A mesh with at most as many
/// vertices as triangles causes no note: usually, most of its vertices are corners, and looking at all triangles would
/// take time.
pub(in crate::scene) fn note_points(mesh: &Mesh, invalid: usize) -> Option<String> {
    if mesh.positions.len() <= mesh.triangles.len() {
        return None;
    }
    let used = mesh.positions_of_triangles().into_iter().filter(|is_used| *is_used).count();
    let unused = mesh.positions.len().saturating_sub(used + invalid);
    (unused > used).then(|| format!("{} not drawn", counted_are(unused, "vertex that no face uses")))
}

/// Returns true if a triangle has an area and is not almost a line.
fn has_area(mesh: &Mesh, triangle: &Triangle) -> bool {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let [ab, ac] = [b - a, c - a];
    ab.cross(ac).length() > THIN * ab.length() * ac.length()
}

/// Returns a note if nothing is visible because no triangle of the mesh has an area.
pub(in crate::scene) fn invisible(mesh: &Mesh) -> Option<String> {
    let triangles = mesh.triangles.len();
    let note = || match triangles {
        1 => "nothing is visible, since the mesh's only triangle has no area".to_owned(),
        _ => format!(
            "nothing is visible, since none of the mesh's {} has an area",
            counted(triangles, "triangle")
        ),
    };
    (!mesh.triangles.iter().any(|triangle| has_area(mesh, triangle))).then(note)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
