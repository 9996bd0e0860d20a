//! Decides whether a bare mesh gets smooth shadows.

use super::Mesh;
use super::framing::Ball;
use glam::DVec3;

/// A triangle is coarse if smooth shadows lift its middle by more than the fraction `COARSE_LIFT` of the radius of the
/// ball around the mesh. If the mesh fills a picture that is 1000 pixels high, this fraction of the radius is about
/// half a pixel. For comparison: in a sphere of 9,000 triangles, coarse triangles have 41% of the sphere's area; a
/// sphere of 16,000 triangles has no coarse triangles.
const COARSE_LIFT: f64 = 1e-3;
/// A mesh is coarse if coarse triangles have more than the share `COARSE_SHARE` of its area. In fine scans, noise makes
/// some triangles coarse. Coarse triangles have 1.2% of the area of the Stanford bunny (69,451 triangles), and 0.1% of
/// that of the dragon (202,520 triangles).
const COARSE_SHARE: f64 = 0.05;
/// Smooth shadows lift a point above its triangle. This lift counts if it is more than the fraction `LEAST_LIFT` of the
/// triangle's edge. Smaller lifts may come from the rounding of normals to single precision.
const LEAST_LIFT: f64 = 1e-5;
/// Largest number of triangles that are examined. In a mesh of more triangles, only every n-th triangle is
/// examined, so that the decision takes little time.
const MOST_EXAMINED: usize = 1 << 13;

/// Returns true if a mesh is so coarse that its facets visibly shadow each other in steps. `ball` is the ball
/// around the mesh. A mesh that is shaded with flat facets is never coarse, since smooth shadows do not change
/// it.
pub(super) fn is_coarse(mesh: &Mesh, ball: Ball) -> bool {
    let (_, radius) = ball.centre_and_radius();
    let step = mesh.triangles.len().div_ceil(MOST_EXAMINED).max(1);
    let (mut coarse, mut all) = (0.0, 0.0);
    for triangle in mesh.triangles.iter().step_by(step) {
        let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let normals = mesh.corner_normals(triangle).map(|normal| normal.as_dvec3());
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        if lift_of_middle(corners, normals) > COARSE_LIFT * radius {
            coarse += area;
        }
        all += area;
    }
    coarse > COARSE_SHARE * all
}

/// Returns the distance by which smooth shadows lift a triangle's middle (`smooth_point` in
/// `src/reference/shade.rs`).
fn lift_of_middle(corners: [DVec3; 3], normals: [DVec3; 3]) -> f64 {
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    let lift = |(corner, normal): (DVec3, DVec3)| {
        let below = (corner - middle).dot(normal).max(0.0);
        normal * (below / (3.0 * normal.length_squared()))
    };
    corners.into_iter().zip(normals).map(lift).sum::<DVec3>().length()
}

/// Returns true if smooth shadows lift a point of the mesh: if the plane through a corner of a triangle,
/// perpendicular to the corner's normal, lies above another corner.
pub(super) fn is_lifted(mesh: &Mesh) -> bool {
    mesh.triangles.iter().any(|triangle| {
        let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let normals = mesh.corner_normals(triangle).map(|normal| normal.as_dvec3());
        corners.into_iter().zip(normals).any(|(corner, normal)| {
            let least = |edge: DVec3| LEAST_LIFT * edge.length() * normal.length();
            corners.into_iter().any(|other| (corner - other).dot(normal) > least(corner - other))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::normals;
    use super::*;
    use crate::scene::{Shape, generate};

    fn coarse(mesh: &Mesh) -> bool {
        is_coarse(mesh, Ball::around(mesh, DVec3::Y))
    }

    fn sphere(triangles: u32) -> Mesh {
        generate(&Shape::Sphere { triangles })
    }

    #[test]
    fn a_coarse_smooth_mesh_is_coarse_and_a_fine_or_flat_one_is_not() {
        for (triangles, expected) in [(200, true), (5_000, true), (20_000, false), (100_000, false)] {
            assert_eq!(coarse(&sphere(triangles)), expected, "{triangles} triangles");
        }
        let mut flat = sphere(200);
        normals::flatten(&mut flat);
        assert!(!coarse(&flat));
        assert!(!coarse(&Mesh::default()));
    }

    #[test]
    fn smooth_shadows_lift_only_convex_smooth_surfaces() {
        let mut mesh = sphere(200_000);
        assert!(is_lifted(&mesh) && !is_lifted(&Mesh::default()));
        normals::reverse(&mut mesh);
        assert!(!is_lifted(&mesh), "seen from inside, a sphere is concave");
        normals::flatten(&mut mesh);
        assert!(!is_lifted(&mesh));
    }

    #[test]
    fn the_unit_does_not_matter_and_neither_does_the_length_of_normals() {
        for (triangles, expected) in [(5_000, true), (20_000, false)] {
            let mut mesh = sphere(triangles);
            mesh.positions.iter_mut().for_each(|position| *position *= 1e-3);
            mesh.normals.iter_mut().for_each(|normal| *normal *= 50.0);
            assert_eq!(coarse(&mesh), expected, "{triangles} triangles");
        }
    }

    #[test]
    fn a_coarse_part_of_a_fine_mesh_counts_by_its_area() {
        let with_coarse_part = |scale: f32| {
            let (mut mesh, mut part) = (sphere(100_000), sphere(200));
            part.positions.iter_mut().for_each(|position| *position *= scale);
            mesh.append(part);
            mesh
        };
        // The coarse part has 20% of the first mesh's area, 8% of the second mesh's, and 2% of the third mesh's.
        assert!(coarse(&with_coarse_part(0.5)));
        assert!(coarse(&with_coarse_part(0.3)));
        assert!(!coarse(&with_coarse_part(0.15)));
    }
}
