//! Writes a tree's triangles in leaf order (the order of the tree's leaves), as rows of floats.

use crate::scene::Mesh;
use rayon::prelude::*;

/// Number of 32-bit words per triangle in [`write_triangle_rows`]: three float4, or 48 bytes.
pub const TRIANGLE_WORDS: usize = 12;

/// Number of floats per triangle in [`write_normal_rows`]: 9 floats, or 36 bytes.
pub const NORMAL_FLOATS: usize = 9;

/// Number of rows of zeros after the last triangle. Kernels that load several triangles at once (TOGETHER in
/// cl/tile_cpu/triangles_of_leaf.cl) may read these rows of zeros.
pub const PADDING_ROWS: usize = 8;

/// Writes the triangles of `order` into `rows`, 12 words each. The corners are copied bit by bit, because
/// watertight intersection tests need the mesh's exact corners. The words of `rows` after the last triangle
/// become zero.
///
/// | words | content |
/// |---|---|
/// | 0, 1, 2 | v0, the first corner |
/// | 3 | the triangle's number in the mesh, as bits |
/// | 4, 5, 6 and 8, 9, 10 | v1 and v2 |
/// | 7, 11 | the number of its material, as bits, and 0 |
pub fn write_triangle_rows(mesh: &Mesh, order: &[u32], rows: &mut [f32]) {
    write_rows(order, rows, |number| {
        let triangle = &mesh.triangles[number as usize];
        let [a, b, c] = mesh.corners(triangle);
        let (number, material) = (f32::from_bits(number), f32::from_bits(triangle.material));
        [a.x, a.y, a.z, number, b.x, b.y, b.z, material, c.x, c.y, c.z, 0.0]
    });
}

/// Writes the corner normals n0, n1 and n2 of each triangle of `order` into `rows`, three floats each. The
/// floats of `rows` after the last triangle become zero.
pub fn write_normal_rows(mesh: &Mesh, order: &[u32], rows: &mut [f32]) {
    write_rows(order, rows, |number| {
        let [a, b, c] = mesh.corner_normals(&mesh.triangles[number as usize]);
        [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]
    });
}

/// Writes one row for each triangle of `order`, on all cores.
fn write_rows<const N: usize>(order: &[u32], rows: &mut [f32], row: impl Fn(u32) -> [f32; N] + Sync) {
    let (rows, padding) = rows.as_chunks_mut::<N>().0.split_at_mut(order.len());
    padding.fill([0.0; N]);
    rows.par_iter_mut().zip(order).for_each(|(words, &number)| *words = row(number));
}
