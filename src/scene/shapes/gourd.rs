//! Two gourds that replace those of the paper's Figures 6 and 9, since the paper does not publish
//! their data.

use super::grid::{revolve, split};
use crate::scene::Mesh;
use crate::scene::normals::flatten;
use std::f64::consts::PI;

/// Returns a gourd of about `triangles` triangles. A gourd with 648 triangles has exactly 18 segments and 18
/// rings.
pub(super) fn gourd(triangles: u32) -> Mesh {
    let (segments, rings) = split(f64::from(triangles) / 2.0, 1.0);
    revolve(segments, rings, profile)
}

/// Returns a gourd with typical modelling mistakes: vertices are displaced, facets are flat, and about one
/// facet in six is turned inwards, so that it is dark.
pub(super) fn broken(triangles: u32) -> Mesh {
    const OFF: f32 = 0.05;
    let mut mesh = gourd(triangles);
    for (index, position) in (0..).zip(&mut mesh.positions) {
        let along = 1.0 + OFF * (2.0 * scattered(index) - 1.0);
        position.x *= along;
        position.z *= along;
    }
    for (index, triangle) in (0..).zip(&mut mesh.triangles) {
        if scattered(index ^ 0x5bd1) < 1.0 / 6.0 {
            triangle.positions.swap(1, 2);
        }
    }
    flatten(&mut mesh);
    mesh
}

/// Returns a pseudo-random number from 0 to 1 for an index, the same on every machine. The function is the
/// finaliser of MurmurHash3 (A. Appleby) with other shifts.
fn scattered(index: u32) -> f32 {
    let mut bits = index.wrapping_add(0x9e37_79b9);
    for multiplier in [0x85eb_ca6b_u32, 0xc2b2_ae35] {
        bits = (bits ^ (bits >> 15)).wrapping_mul(multiplier);
    }
    ((bits ^ (bits >> 16)) >> 8) as f32 / (1 << 24) as f32
}

/// Returns the gourd's radius and height for a t from 0 (the lower pole) to 1 (the upper pole). Radius and
/// height are those of a unit sphere, but the radius is multiplied by a factor that gives the gourd a belly, a
/// waist and a head.
fn profile(t: f64) -> (f64, f64) {
    let (sin, cos) = (PI * t).sin_cos();
    let bulge = |at: f64, width: f64| (-((t - at) / width).powi(2)).exp();
    (sin * (0.32 + 0.56 * bulge(0.27, 0.24) + 0.34 * bulge(0.86, 0.14)), 1.0 - cos)
}
