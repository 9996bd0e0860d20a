//! The normals that an STL file states for its facets. raycl does not use these normals, but counts those that
//! contradict the order of the facet's corners.

use super::{TRIANGLE_BYTES, vector};
use crate::scene::files::THIN;
use crate::scene::mesh::PARALLEL_TRIANGLES;
use crate::scene::obj::decimal;
use crate::words::counted;
use glam::DVec3;
use rayon::prelude::*;

/// The normal of a facet in a text file.
pub(super) struct Normal<'a> {
    /// The index of the facet's first corner.
    pub corner: usize,
    /// The words of the normal's components.
    pub words: [&'a [u8]; 3],
}

/// Returns how many facets in a text file state a normal that contradicts the order of their corners. Words that are
/// not numbers contradict nothing.
pub(super) fn opposite_of_words(normals: &[Normal<'_>], corners: &[DVec3]) -> usize {
    let is_opposite = |normal: &&Normal<'_>| {
        let [Some(x), Some(y), Some(z)] = normal.words.map(decimal) else { return false };
        let facet = corners.get(normal.corner..normal.corner + 3);
        facet.is_some_and(|facet| contradicts(DVec3::new(x, y, z), facet))
    };
    normals.par_iter().with_min_len(PARALLEL_TRIANGLES).filter(is_opposite).count()
}

/// Returns how many facets in a binary file state a normal that contradicts the order of their corners. `rows` has the
/// bytes of the facets.
pub(super) fn opposite_of_rows(rows: &[u8], corners: &[DVec3]) -> usize {
    let facets = rows.par_chunks_exact(TRIANGLE_BYTES).zip(corners.par_chunks_exact(3));
    let is_opposite = |(row, facet): &(&[u8], &[DVec3])| contradicts(vector(row), facet);
    facets.with_min_len(PARALLEL_TRIANGLES).filter(is_opposite).count()
}

/// Returns true if the angle between a facet's stated normal and the normal of its corners is more than 90 degrees. If
/// the facet is almost a line, its corners may have any normal because of rounding, so nothing contradicts them.
fn contradicts(normal: DVec3, corners: &[DVec3]) -> bool {
    let [ab, ac] = [corners[1] - corners[0], corners[2] - corners[0]];
    let cross = ab.cross(ac);
    normal.dot(cross) < 0.0 && cross.length() > THIN * ab.length() * ac.length()
}

/// Returns a note on facets whose normal contradicts their corners; `None` if there are none.
pub(super) fn note(count: usize) -> Option<String> {
    let facets = counted(count, "facet");
    let verb = if count == 1 { "states" } else { "state" };
    (count > 0).then(|| {
        format!("{facets} {verb} a normal that contradicts the order of the corners; this order decides which side is the front")
    })
}
