//! A hall with two rows of columns. The front sides of the walls face inwards, because the hall is lit and seen
//! from inside.

use super::grid::{grid, split};
use crate::scene::Mesh;
use glam::DVec3;
use std::f64::consts::TAU;

const WIDTH: f64 = 4.0;
const HEIGHT: f64 = 3.0;
const LENGTH: f64 = 10.0;
const MAX_COLUMNS: u32 = 12;
/// The hall has at most so many columns that the mean number of triangles per column is at least
/// `MIN_COLUMN_TRIANGLES`. With fewer triangles, a column would not look round.
const MIN_COLUMN_TRIANGLES: f64 = 40.0;
/// The fraction of the hall's triangles that the columns get. This fraction is large, because only the hall's
/// columns are round.
const COLUMN_SHARE: f64 = 0.75;

/// Returns a hall of about `triangles` triangles, at least twelve. With fewer than 640 triangles, the hall
/// has fewer than 12 columns.
pub(super) fn interior(triangles: u32) -> Mesh {
    let triangles = f64::from(triangles);
    let columns = ((COLUMN_SHARE * triangles / MIN_COLUMN_TRIANGLES) as u32).min(MAX_COLUMNS) & !1;
    let mut mesh = Mesh::default();
    let mut budget = COLUMN_SHARE * triangles;
    for number in 0..columns {
        // Each column gets its share of the remaining triangles, so that rounding errors do not add up.
        let (around, up) = split(budget / f64::from(columns - number) / 2.0, 0.5);
        let part = column(around.max(4), up, foot(number, columns / 2));
        budget -= part.triangles.len() as f64;
        mesh.append(part);
    }
    let mut rest = triangles - mesh.triangles.len() as f64;
    for (number, wall) in walls().into_iter().enumerate() {
        let (across, up) = split(rest / (6 - number) as f64 / 2.0, 1.0);
        let part = grid(across, up, |u, v| {
            (wall[0] + wall[1] * u + wall[2] * v, wall[1].cross(wall[2]).normalize())
        });
        rest -= part.triangles.len() as f64;
        mesh.append(part);
    }
    mesh.share_first_material();
    mesh
}

/// Returns the position on the hall's floor where the column `number` stands. Columns are alternately left
/// and right, from front to back; `a_side` is the number of columns on each side.
fn foot(number: u32, a_side: u32) -> DVec3 {
    let side = if number.is_multiple_of(2) { -1.0 } else { 1.0 };
    let depth = (f64::from(number / 2) + 0.5) / f64::from(a_side);
    DVec3::new(side * 0.27 * WIDTH, 0.0, -LENGTH * depth)
}

/// Returns a column with a base and a capital, open at both ends.
fn column(around: u32, up: u32, foot: DVec3) -> Mesh {
    let radius = |v: f64| {
        let flare = |distance: f64| 0.13 * (-(distance / 0.06).powi(2)).exp();
        0.24 - 0.05 * v + flare(v) + flare(1.0 - v)
    };
    grid(around, up, |u, v| {
        let (sin, cos) = (TAU * u).sin_cos();
        let slope = (radius(v + 1e-5) - radius(v - 1e-5)) / (2e-5 * HEIGHT);
        let position = foot + DVec3::new(radius(v) * cos, HEIGHT * v, -radius(v) * sin);
        (position, DVec3::new(cos, -slope, -sin).normalize())
    })
}

/// Returns the hall's floor, ceiling and left, right, back and front walls, each as a corner and two edges.
/// The cross product of the two edges of a wall points into the hall.
fn walls() -> [[DVec3; 3]; 6] {
    let (x, y, z) = (DVec3::X * WIDTH, DVec3::Y * HEIGHT, DVec3::Z * LENGTH);
    let corner = -x / 2.0 - z;
    [
        [corner, z, x],
        [corner + y, x, z],
        [corner, y, z],
        [corner + x, z, y],
        [corner, x, y],
        [corner + z, y, x],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_on_both_sides_from_front_to_back() {
        for (number, x, z) in [(0, -1.08, -1.0), (1, 1.08, -1.0), (2, -1.08, -3.0), (9, 1.08, -9.0)] {
            let foot = foot(number, 5);
            assert!(foot.distance(DVec3::new(x, 0.0, z)) < 1e-9, "{number}: {foot}");
        }
    }

    #[test]
    fn a_column_has_a_base_and_a_capital_and_normals_that_follow_its_outline() {
        let (around, up) = (32, 128);
        let column = column(around, up, DVec3::ZERO);
        for triangle in &column.triangles {
            let [a, b, c] = column.corners(triangle);
            let face = (b - a).cross(c - a).normalize();
            for normal in column.corner_normals(triangle) {
                assert!(normal.dot(face) > 0.95, "{triangle:?}: {normal} beside {face}");
            }
        }
        let radius = |row: u32| column.positions[(row * (around + 1)) as usize].x;
        for (row, expected) in [(0, 0.37), (up / 2, 0.215), (up, 0.32)] {
            assert!((radius(row) - expected).abs() < 1e-6, "row {row}: {}", radius(row));
        }
    }
}
