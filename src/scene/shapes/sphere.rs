//! The unit sphere, closed.

use super::grid::{revolve, split};
use crate::scene::Mesh;
use std::f64::consts::PI;

/// About `triangles` triangles, at least six, nearly square on the equator.
pub(super) fn sphere(triangles: u32) -> Mesh {
    // A sphere is twice as far around as from pole to pole.
    let (segments, rings) = split(f64::from(triangles) / 2.0, 2.0);
    revolve(segments, rings, |t| ((PI * t).sin(), -(PI * t).cos()))
}
