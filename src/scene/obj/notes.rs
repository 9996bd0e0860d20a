//! Notes for the user on features of a mesh that raycl does not support.

use super::asked::Asked;
use super::points::PointChunk;
use crate::scene::Mesh;
use crate::scene::normals::MISSING;
use crate::words::counted_are;
use std::collections::BTreeSet;

/// Adds notes on smoothing groups and on other statements that are not supported. Must be called before
/// normals are generated for `mesh`.
pub(super) fn of_statements(points: &[PointChunk], mesh: &Mesh, quotes: bool, notes: &mut Vec<String>) {
    let groups: BTreeSet<_> = points.iter().flat_map(|chunk| &chunk.smoothing).collect();
    // A single smoothing group needs no note, since all faces without normals become smooth anyway.
    let edges = groups.len() > 1 || groups.iter().any(|group| *group == "off");
    let made = |mesh: &Mesh| mesh.triangles.iter().filter(|triangle| triangle.normals[0] == MISSING).count();
    let made = if edges { made(mesh) } else { 0 };
    if made > 0 {
        notes.push(format!(
            "smoothing groups (s) are not read: {} smooth. A `crease` in the scene (a bare mesh has a default) keeps \
             edges with a larger angle sharp; flat = true in an [[object]] gives every face its own normal",
            counted_are(made, "triangle without normals")
        ));
    }
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
