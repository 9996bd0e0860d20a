//! Estimates which share of a picture a scene covers. If a mesh covers only a small part of the picture, few
//! tiles contain hits. For a picture with few hits, the fastest strategies are not the same as for a picture
//! that a scene fills (`src/strategy/fastest.rs`).

use super::{Camera, Scene};
use glam::{DVec2, DVec3};

/// Largest number of triangles that are projected. In a scene with more triangles, only every n-th triangle
/// is projected.
const PROJECTED: usize = 4096;
/// The picture is divided into `CELLS` columns and `CELLS` rows of cells. The cells are so large that the projected
/// triangles, a sample of all triangles, suffice: if a large scene covers a cell, some of the projected triangles
/// usually lie in this cell.
const CELLS: usize = 16;
/// The depth at which triangles are cut off if the camera's `z_near` is smaller than this depth.
const LEAST_DEPTH: f64 = 1e-6;

impl Scene {
    /// Returns the share of the picture's cells, from 0 to 1, in which triangles may be visible. `size` is
    /// the picture's size in pixels. A triangle counts for all cells that the bounding rectangle of its
    /// projection overlaps.
    pub fn covered_share(&self, size: [u32; 2]) -> f64 {
        let projection = Projection::of(&self.camera, size);
        let step = self.mesh.triangles.len().div_ceil(PROJECTED).max(1);
        let mut covered = [[false; CELLS]; CELLS];
        for triangle in self.mesh.triangles.iter().step_by(step) {
            let corners = self.mesh.corners(triangle).map(|corner| projection.in_camera(corner.as_dvec3()));
            let Some([low, high]) = projection.bounds(corners) else { continue };
            // The coordinate 1 (the picture's right or bottom edge) belongs to the last column or row of
            // cells.
            let [first, last] =
                [low, high].map(|at| (at * CELLS as f64).min(DVec2::splat(CELLS as f64 - 1.0)));
            for row in &mut covered[first.y as usize..=last.y as usize] {
                row[first.x as usize..=last.x as usize].fill(true);
            }
        }
        covered.as_flattened().iter().filter(|cell| **cell).count() as f64 / (CELLS * CELLS) as f64
    }
}

/// The projection of points to a camera's picture. Coordinates in the picture are 0 at its left and top edge,
/// and 1 at its right and bottom edge.
struct Projection {
    eye: DVec3,
    /// The camera's axes to the right, down and forward. The axis to the right is divided by the picture's
    /// width at depth 1, and the axis down by the picture's height at depth 1.
    axes: [DVec3; 3],
    least_depth: f64,
}

impl Projection {
    fn of(camera: &Camera, [width, height]: [u32; 2]) -> Self {
        let frame = camera.pixel_frame(width, height);
        let (across, down) = (frame.step_x * f64::from(width), frame.step_y * f64::from(height));
        let axes =
            [across / across.length_squared(), down / down.length_squared(), camera.forward.as_dvec3()];
        Self { eye: frame.eye, axes, least_depth: frame.z_near.max(LEAST_DEPTH) }
    }

    /// Returns a point's coordinates relative to the eye, along the three `axes`.
    fn in_camera(&self, point: DVec3) -> DVec3 {
        let from_eye = point - self.eye;
        DVec3::from_array(self.axes.map(|axis| axis.dot(from_eye)))
    }

    /// Returns the smallest and the largest coordinates of the bounding rectangle of a triangle's projection.
    /// The part of the triangle that is nearer than `least_depth` is cut off, and the rectangle is cut at the
    /// picture's edges. Returns `None` if the rectangle lies beside the picture, or if the whole triangle is
    /// nearer than `least_depth`.
    fn bounds(&self, corners: [DVec3; 3]) -> Option<[DVec2; 2]> {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let mut add = |point: DVec3| {
            let at = DVec2::new(point.x, point.y) / point.z + 0.5;
            (low, high) = (low.min(at), high.max(at));
        };
        for (one, other) in [(0, 1), (1, 2), (2, 0)].map(|(one, other)| (corners[one], corners[other])) {
            if one.z >= self.least_depth {
                add(one);
            }
            // An edge that crosses the plane at `least_depth` is cut at this plane.
            if (one.z >= self.least_depth) != (other.z >= self.least_depth) {
                let cut = one.lerp(other, (self.least_depth - one.z) / (other.z - one.z));
                add(cut.with_z(self.least_depth));
            }
        }
        let overlaps = low.cmple(DVec2::ONE).all() && high.cmpge(DVec2::ZERO).all();
        overlaps.then(|| [low, high].map(|at| at.clamp(DVec2::ZERO, DVec2::ONE)))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use crate::scene::{Mesh, Scene, load_scene_with};
    use std::path::Path;

    /// Returns the scene of `scenes/triangle.toml`, with the corners `corners` in place of the triangle's
    /// own. The camera is at the origin and looks along -z, with a field of view of 90 degrees across the
    /// width.
    fn triangle(corners: [[f32; 3]; 3]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/triangle.toml");
        let scene = load_scene_with(&path, &[]).unwrap().scene;
        let mesh = Mesh { positions: corners.map(Into::into).to_vec(), ..(*scene.mesh).clone() };
        Scene { mesh: mesh.into(), ..scene }
    }

    /// The picture has 16 x 16 cells. At depth 1, a square picture is 2 units wide, so a cell is an eighth of
    /// a unit wide.
    #[test]
    fn a_triangle_counts_for_the_cells_of_its_bounding_rectangle() {
        let cells = |corners| triangle(corners).covered_share([64, 64]) * 256.0;
        // The triangle covers the cells in the columns 8 and 9 and in the rows 6 and 7.
        assert_eq!(cells([[0.01, 0.01, -1.0], [0.24, 0.01, -1.0], [0.01, 0.24, -1.0]]), 4.0);
        // The second triangle is twice as large as the first and twice as far away, so it covers the same
        // cells.
        assert_eq!(cells([[0.02, 0.02, -2.0], [0.48, 0.02, -2.0], [0.02, 0.48, -2.0]]), 4.0);
        // The right edge of the picture cuts this triangle, which covers the columns 14 and 15 of row 8.
        assert_eq!(cells([[0.76, -0.01, -1.0], [5.0, -0.01, -1.0], [0.76, -0.02, -1.0]]), 2.0);
        assert_eq!(cells([[1.1, 0.0, -1.0], [5.0, 0.0, -1.0], [1.1, 0.5, -1.0]]), 0.0, "beside the picture");
        assert_eq!(cells([[0.0, 0.0, 1.0], [0.2, 0.0, 1.0], [0.0, 0.2, 1.0]]), 0.0, "behind the eye");
        assert_eq!(cells([[-9.0, -9.0, -1.0], [9.0, -9.0, -1.0], [0.0, 9.0, -1.0]]), 256.0);
    }

    #[test]
    fn a_triangle_that_passes_the_eye_is_cut_in_front_of_it() {
        // The triangle lies in a plane 1 unit below the eye, and begins behind the eye. The triangle's
        // farthest corner has depth 2 and is projected to the upper edge of row 12. Near the eye, the triangle is
        // wider than the picture. The bounding rectangle thus covers all columns, and the rows from 12 down.
        let floor = triangle([[-9.0, -1.0, 9.0], [9.0, -1.0, 9.0], [0.0, -1.0, -2.0]]);
        assert_eq!(floor.covered_share([64, 64]), 0.25);
        // This triangle is a needle that begins behind the eye, and ends at depth 1 below the camera's axis.
        // The needle is cut at the camera's z_near of 0.1. At this cut, the needle's distance below the
        // camera's axis is 0.91 times the depth. The needle-shaped triangle covers one column of cells, and
        // the rows 8 to 15.
        let needle = triangle([[0.0, 0.0, 9.0], [0.0, -0.1, -1.0], [0.001, -0.1, -1.0]]);
        assert_eq!(needle.covered_share([64, 64]) * 256.0, 8.0);
    }

    #[test]
    fn rows_are_counted_by_the_pictures_height() {
        // In a picture twice as wide as high, a cell at depth 1 is an eighth of a unit wide and a sixteenth of
        // a unit high.
        let upper = triangle([[0.01, 0.01, -1.0], [0.24, 0.01, -1.0], [0.01, 0.12, -1.0]]);
        assert_eq!(upper.covered_share([64, 32]) * 256.0, 4.0);
    }

    #[test]
    fn of_a_large_mesh_some_triangles_show_which_cells_it_covers() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/terrain.toml");
        let share = |triangles: i64| {
            let set = [("object.0.triangles".to_owned(), toml::Value::Integer(triangles))];
            load_scene_with(&path, &set).unwrap().scene.covered_share([640, 400])
        };
        let [few, many] = [4_000, 40_000].map(share);
        assert!(few > 0.8 && (few - many).abs() < 0.05, "{few} {many}");
    }
}
