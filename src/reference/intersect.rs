//! The ray-triangle test; its counterpart for devices is `cl/cast/intersect/moller_trumbore`.

use super::ray::Ray;
use super::real::{Real, Vector};
use crate::strategy::Culling;

/// A ray's hit on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit<R> {
    /// The distance along the ray.
    pub t: R,
    /// The hit point's barycentric weights, one per corner of the triangle; they sum to 1.
    pub weights: [R; 3],
    /// The triangle's index in `Mesh::triangles`.
    pub triangle: u32,
}

/// Applies the test of Moeller and Trumbore (Journal of Graphics Tools 2(1), 1997), in the notation of
/// Hughes et al., section 15.4. The test has no tolerance. A ray counts as parallel to the triangle only if
/// it is exactly parallel. A hit on an edge counts for both triangles that share the edge. NaN counts as a
/// miss.
pub fn moller_trumbore<R: Real>(
    ray: &Ray<R>,
    [v0, v1, v2]: [R::Vector; 3],
    culling: Culling,
) -> Option<(R, [R; 3])> {
    let (e1, e2) = (v1 - v0, v2 - v0);
    let q = ray.direction.cross(e2);
    let a = e1.dot(q); // a = -direction . (e1 x e2) is positive if the ray runs against the front's normal
    let culled = culling == Culling::Back && a < R::ZERO;
    if a == R::ZERO || culled {
        return None;
    }
    let s = ray.origin - v0;
    let w1 = s.dot(q) / a;
    if w1 < R::ZERO || w1 > R::ONE {
        return None;
    }
    let r = s.cross(e1);
    let w2 = ray.direction.dot(r) / a;
    let w0 = R::ONE - w1 - w2;
    let t = e2.dot(r) / a;
    let inside = w0 >= R::ZERO && w1 >= R::ZERO && w2 >= R::ZERO;
    (inside && ray.near < t && t < ray.far).then_some((t, [w0, w1, w2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, dvec3};

    const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    fn ray(x: f64, y: f64, z: f64) -> Ray<f64> {
        let direction = dvec3(0.0, 0.0, -z.signum());
        Ray {
            origin: dvec3(x, y, z),
            direction,
            near: 0.0,
            far: f64::INFINITY,
            to_light: false,
            is_shadow: false,
        }
    }

    #[test]
    fn weights_and_distance_of_a_hit() {
        let hit = moller_trumbore(&ray(0.25, 0.5, 3.0), CORNERS, Culling::None);
        assert_eq!(hit, Some((3.0, [0.25, 0.25, 0.5])));
    }

    #[test]
    fn edges_and_corners_count_and_the_outside_does_not() {
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.0, 0.3)] {
            assert!(moller_trumbore(&ray(x, y, 1.0), CORNERS, Culling::None).is_some(), "{x}, {y}");
        }
        for (x, y) in [(-1e-15, 0.5), (0.5, -1e-15), (0.5, 0.500_000_1)] {
            assert!(moller_trumbore(&ray(x, y, 1.0), CORNERS, Culling::None).is_none(), "{x}, {y}");
        }
    }

    #[test]
    fn a_back_face_is_seen_unless_culled() {
        let (front, back) = (ray(0.2, 0.2, 1.0), ray(0.2, 0.2, -1.0));
        assert!(moller_trumbore(&back, CORNERS, Culling::None).is_some());
        assert!(moller_trumbore(&back, CORNERS, Culling::Back).is_none());
        assert!(moller_trumbore(&front, CORNERS, Culling::Back).is_some());
    }

    #[test]
    fn hits_count_only_between_near_and_far() {
        let base = ray(0.2, 0.2, 2.0);
        for (near, far, seen) in [(2.0, 3.0, false), (1.0, 2.0, false), (1.9, 2.1, true)] {
            let ray = Ray { near, far, ..base };
            assert_eq!(moller_trumbore(&ray, CORNERS, Culling::None).is_some(), seen);
        }
    }

    #[test]
    fn parallel_rays_and_degenerate_triangles_miss() {
        let along = Ray { direction: DVec3::X, ..ray(-1.0, 0.2, 0.0) };
        assert!(moller_trumbore(&along, CORNERS, Culling::None).is_none());
        let point = [DVec3::ZERO, DVec3::ZERO, DVec3::Y];
        assert!(moller_trumbore(&ray(0.0, 0.5, 1.0), point, Culling::None).is_none());
    }
}
