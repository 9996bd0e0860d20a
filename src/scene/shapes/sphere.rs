//! The unit sphere, closed.

use super::grid::{revolve, split};
use crate::scene::Mesh;
use std::f64::consts::PI;

/// Returns a sphere of about `triangles` triangles, at least six. On the equator, pairs of triangles form
/// nearly square quads.
pub(super) fn sphere(triangles: u32) -> Mesh {
    // The equator is twice as long as a line from pole to pole, so there are about twice as many segments as
    // rings.
    let (segments, rings) = split(f64::from(triangles) / 2.0, 2.0);
    revolve(segments, rings, |t| ((PI * t).sin(), -(PI * t).cos()))
}
