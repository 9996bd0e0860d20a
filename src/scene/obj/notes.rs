//! Notes for the user on features of a mesh that raycl does not support.

use super::asked::{Asked, Wish};
use super::points::PointChunk;
use crate::scene::Mesh;

/// Adds notes on statements that are not supported, except on smoothing groups.
pub(super) fn of_statements(points: &[PointChunk], quotes: bool, notes: &mut Vec<String>) {
    let mut asked = Asked::default();
    points.iter().for_each(|chunk| asked.extend(&chunk.asked));
    notes.extend(asked.notes("statement", quotes));
}

/// Returns true if vertices may belong to lines, points, curves or surfaces, which have notes of their own.
pub(super) fn have_other_elements(points: &[PointChunk]) -> bool {
    let of_vertices = [Wish::Lines, Wish::Points, Wish::FreeForm];
    points.iter().any(|chunk| of_vertices.iter().any(|wish| chunk.asked.keywords(*wish).is_some()))
}

/// Adds notes on unsupported features of the materials that triangles use.
pub(in crate::scene) fn of_materials(asked: &[Asked], mesh: &Mesh, quotes: bool, notes: &mut Vec<String>) {
    notes.extend(of_used(asked, mesh).notes("material", quotes));
}

/// Adds notes on unsupported features of the materials that triangles use, except features of textures. Returns the
/// notes on features of textures.
pub(super) fn of_materials_and_textures(
    asked: &[Asked],
    mesh: &Mesh,
    quotes: bool,
    notes: &mut Vec<String>,
) -> Vec<String> {
    let (textures, others) =
        of_used(asked, mesh).divided(&[Wish::Texture, Wish::TextureOption, Wish::TexturePlace]);
    notes.extend(others.notes("material", quotes));
    textures.notes("material", quotes).collect()
}

/// Returns the unsupported features of the materials that triangles use.
fn of_used(asked: &[Asked], mesh: &Mesh) -> Asked {
    let mut all = Asked::default();
    if asked.iter().all(Asked::is_empty) {
        return all;
    }
    let used = mesh.materials_of_triangles();
    asked.iter().zip(used).filter(|(_, used)| *used).for_each(|(asked, _)| all.add_material(asked));
    all
}
