//! Surfaces over a rectangle and surfaces of revolution, as indexed triangles.

use crate::scene::{Material, Mesh, Triangle};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Returns a mesh of `columns` x `rows` quads of two triangles each, over u and v from 0 to 1. `surface`
/// returns the point at (u, v) and its normal. The normal must point in the direction of the cross product of two
/// derivatives of the surface: the derivative by u, then the derivative by v.
pub(super) fn grid(columns: u32, rows: u32, surface: impl Fn(f64, f64) -> (DVec3, DVec3) + Sync) -> Mesh {
    let (columns, rows) = (columns.max(1), rows.max(1));
    let stride = columns + 1;
    let vertices = (0..stride * (rows + 1)).into_par_iter().map(|index| {
        let (i, j) = (index % stride, index / stride);
        surface(f64::from(i) / f64::from(columns), f64::from(j) / f64::from(rows))
    });
    let triangles = (0..2 * columns * rows).into_par_iter().map(|index| {
        let (cell, half) = (index / 2, index % 2);
        let a = cell / columns * stride + cell % columns;
        quad(a, a + 1, a + stride, a + stride + 1)[half as usize]
    });
    mesh(vertices, triangles)
}

/// Returns the mesh of a closed surface around the y axis. The mesh has two poles and, between them, `rings`
/// circles of `segments` vertices each, and thus 2 x `segments` x `rings` triangles. `profile` returns the
/// surface's radius and height for a t from 0 (the lower pole) to 1 (the upper pole).
pub(super) fn revolve(segments: u32, rings: u32, profile: impl Fn(f64) -> (f64, f64) + Sync) -> Mesh {
    let (segments, rings) = (segments.max(3), rings.max(1));
    let pole = |t: f64, normal| (DVec3::new(0.0, profile(t).1, 0.0), normal);
    let vertices = (0..2 + segments * rings).into_par_iter().map(|index| match index {
        0 => pole(0.0, -DVec3::Y),
        1 => pole(1.0, DVec3::Y),
        _ => {
            let (i, j) = ((index - 2) % segments, (index - 2) / segments + 1);
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(segments);
            on_circle(&profile, f64::from(j) / f64::from(rings + 1), angle)
        }
    });
    let vertex = |i: u32, j: u32| 2 + j * segments + i % segments;
    // The order is: the fan of the lower pole, the quads between circles, the fan of the upper pole.
    let count = 2 * segments * rings;
    let triangles = (0..count).into_par_iter().map(|index| {
        if index < segments {
            return [0, vertex(index + 1, 0), vertex(index, 0)];
        }
        if index >= count - segments {
            let i = index + segments - count;
            return [1, vertex(i, rings - 1), vertex(i + 1, rings - 1)];
        }
        let (cell, half) = ((index - segments) / 2, (index - segments) % 2);
        let (i, j) = (cell % segments, cell / segments);
        quad(vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1))[half as usize]
    });
    mesh(vertices, triangles)
}

/// Returns the point of a surface of revolution at t and `angle`, and its normal, computed from the profile's
/// slope.
fn on_circle(profile: &impl Fn(f64) -> (f64, f64), t: f64, angle: f64) -> (DVec3, DVec3) {
    let (radius, height) = profile(t);
    let step = 1e-5;
    let (below, above) = (profile(t - step), profile(t + step));
    let (outwards, upwards) = (above.1 - below.1, below.0 - above.0);
    let (sin, cos) = angle.sin_cos();
    let normal = DVec3::new(outwards * cos, upwards, -outwards * sin);
    (DVec3::new(radius * cos, height, -radius * sin), normal.normalize_or(DVec3::Y))
}

/// Returns the numbers of columns and rows for about `quads` quads, with about `aspect` times as many columns
/// as rows. The function tries several numbers of rows, and chooses the one with which the number of quads is
/// closest to `quads`.
pub(super) fn split(quads: f64, aspect: f64) -> (u32, u32) {
    let ideal = (quads / aspect).sqrt().max(1.0);
    let columns = |rows: u32| (quads / f64::from(rows)).round().max(1.0);
    let miss = |rows: &u32| (columns(*rows) * f64::from(*rows) - quads).abs();
    let from_ideal = |rows: &u32| (f64::from(*rows) - ideal).abs();
    let reach = (0.1 * ideal).min(16.0);
    let candidates = (ideal - reach).floor() as u32..=(ideal + reach).ceil() as u32;
    let better = |a: &u32, b: &u32| miss(a).total_cmp(&miss(b)).then(from_ideal(a).total_cmp(&from_ideal(b)));
    let rows = candidates.min_by(better).unwrap_or(1).max(1);
    (columns(rows) as u32, rows)
}

/// Returns the two triangles of a quad. `a` and `b` are the lower corners, from left to right, and `c` and
/// `d` the upper corners.
fn quad(a: u32, b: u32, c: u32, d: u32) -> [[u32; 3]; 2] {
    [[a, b, d], [a, d, c]]
}

fn mesh(
    vertices: impl IndexedParallelIterator<Item = (DVec3, DVec3)>,
    triangles: impl IndexedParallelIterator<Item = [u32; 3]>,
) -> Mesh {
    let narrow = |(position, normal): (DVec3, DVec3)| (position.as_vec3(), normal.as_vec3());
    let (mut positions, mut normals): (Vec<Vec3>, Vec<Vec3>) = Default::default();
    vertices.map(narrow).unzip_into_vecs(&mut positions, &mut normals);
    let triangles =
        triangles.map(|corners| Triangle { positions: corners, normals: corners, material: 0 }).collect();
    Mesh { positions, normals, triangles, materials: vec![Material::default()], ..Mesh::default() }
}
