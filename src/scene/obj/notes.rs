//! Notes for the user on features of a mesh that raycl does not support.

use super::asked::Asked;
use super::points::PointChunk;
use crate::scene::Mesh;

/// Adds notes on statements that are not supported, except on smoothing groups.
pub(super) fn of_statements(points: &[PointChunk], quotes: bool, notes: &mut Vec<String>) {
    let mut asked = Asked::default();
    points.iter().for_each(|chunk| asked.extend(&chunk.asked));
    notes.extend(asked.notes("statement", quotes));
}

/// Adds notes on unsupported features of the materials that triangles use.
pub(in crate::scene) fn of_materials(asked: &[Asked], mesh: &Mesh, quotes: bool, notes: &mut Vec<String>) {
    if asked.iter().all(Asked::is_empty) {
        return;
    }
    let used = mesh.materials_of_triangles();
    let mut all = Asked::default();
    asked.iter().zip(used).filter(|(_, used)| *used).for_each(|(asked, _)| all.add_material(asked));
    notes.extend(all.notes("material", quotes));
}
