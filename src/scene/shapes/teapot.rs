//! Newell's teapot: 32 bicubic Bezier patches.

use super::grid::{grid, split};
use crate::scene::Mesh;
use glam::DVec3;
use serde::Deserialize;

/// The patches of M. Newell's teapot of 1975. The JSON file states the source of the data.
const DATA: &str = include_str!("newell_teapot_patches.json");

#[derive(Deserialize)]
struct Data {
    patches: Vec<Vec<usize>>,
    vertices: Vec<[f64; 3]>,
}

/// A patch's 4 x 4 control points.
type Patch = [[DVec3; 4]; 4];

/// Returns the teapot with 32 x 2 x `columns` x `rows` triangles. Four patches meet at the middle of the lid,
/// and four at the middle of the base. One edge of each of these patches is a single point, so the triangles at
/// this edge have no area. The triangles without area are part of the mesh, since the paper counts them.
pub(super) fn teapot(columns: u32, rows: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for patch in patches() {
        mesh.append(grid(columns, rows, |u, v| surface(&patch, u, v)));
    }
    mesh.share_first_material();
    mesh
}

/// Returns the teapot with about `triangles` triangles, at least 64. The numbers of columns and rows into
/// which each patch is divided may differ. Different numbers of columns and rows leave no gaps between the
/// patches, because two neighbouring patches both divide their common edge by the number of columns, or both
/// by the number of rows.
pub(super) fn of_triangles(triangles: u32) -> Mesh {
    let (columns, rows) = split(f64::from(triangles) / 64.0, 1.0);
    teapot(columns, rows)
}

fn patches() -> Vec<Patch> {
    // Parsing cannot fail: the data is part of the program, and a test parses it.
    let Ok(data) = serde_json::from_str::<Data>(DATA) else { return Vec::new() };
    let point = |index: &usize| {
        let [x, y, z] = data.vertices[*index];
        // z is up in the data; a rotation about x keeps the coordinates right-handed.
        DVec3::new(x, z, -y)
    };
    let row = |patch: &[usize], j: usize| std::array::from_fn(|i| point(&patch[4 * j + i]));
    data.patches.iter().map(|patch| std::array::from_fn(|j| row(patch, j))).collect()
}

/// Returns the point at u (along the rows of control points) and v (across the rows), and the outward normal.
fn surface(patch: &Patch, u: f64, v: f64) -> (DVec3, DVec3) {
    let position = blend(patch, bernstein(u), bernstein(v));
    // Where an edge of the patch is a single point, the normal of a nearby point is used.
    let normal = normal(patch, u, v).or_else(|| normal(patch, u.clamp(1e-3, 0.999), v.clamp(1e-3, 0.999)));
    (position, normal.unwrap_or(DVec3::Y))
}

fn normal(patch: &Patch, u: f64, v: f64) -> Option<DVec3> {
    let along_u = blend(patch, slope(u), bernstein(v));
    let along_v = blend(patch, bernstein(u), slope(v));
    let normal = along_u.cross(along_v);
    (normal.length() > 1e-9).then(|| normal.normalize())
}

fn blend(patch: &Patch, u: [f64; 4], v: [f64; 4]) -> DVec3 {
    (0..4).map(|j| (0..4).map(|i| patch[j][i] * u[i]).sum::<DVec3>() * v[j]).sum()
}

fn bernstein(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

fn slope(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-3.0 * s * s, 3.0 * s * (s - 2.0 * t), 3.0 * t * (2.0 * s - t), 3.0 * t * t]
}
