//! A gourd: our own stand-in for Figure 9's, whose data the paper does not give.

use super::grid::{revolve, split};
use crate::scene::Mesh;
use std::f64::consts::PI;

/// About `triangles` triangles; 648 give 18 segments and 18 rings exactly.
pub(super) fn gourd(triangles: u32) -> Mesh {
    let (segments, rings) = split(f64::from(triangles) / 2.0, 1.0);
    revolve(segments, rings, profile)
}

/// A sphere's outline, drawn out to a belly and a head with a waist between.
fn profile(t: f64) -> (f64, f64) {
    let (sin, cos) = (PI * t).sin_cos();
    let bulge = |at: f64, width: f64| (-((t - at) / width).powi(2)).exp();
    (sin * (0.32 + 0.56 * bulge(0.27, 0.24) + 0.34 * bulge(0.86, 0.14)), 1.0 - cos)
}
