//! Finds the triangles that a ray hits. The search for the closest hit and the search for any hit use the
//! same traversal: a [`Finder`] passes hits to a visitor. The visitor returns the distance up to which
//! further hits matter.

use super::intersect::{Hit, moller_trumbore};
use super::leaning::{LargerHit, larger_hit};
use super::ray::Ray;
use super::real::{Real, Vector};
use crate::scene::Mesh;
use crate::strategy::Culling;
use std::sync::Arc;

/// Knows a mesh's triangles, and finds the triangles that a ray hits.
pub trait Finder<R: Real>: Send + Sync {
    /// Passes the hits along `ray` to `visitor`, in any order. The visitor returns the distance beyond which
    /// hits no longer matter; if it returns `ray.near`, the search ends.
    fn visit(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(Hit<R>) -> R);

    /// Passes the hits on triangles that rounding has made larger, in the same way as [`Self::visit`]. Finders that
    /// count tests pass no hits.
    fn visit_larger(&self, _ray: &Ray<R>, _visitor: &mut dyn FnMut(LargerHit<R>) -> R) {}

    /// Returns the hit nearest to the ray's origin; of several equally near ones, the hit on the triangle
    /// that comes first in the mesh.
    fn closest(&self, ray: &Ray<R>) -> Option<Hit<R>> {
        let mut best: Option<Hit<R>> = None;
        self.visit(ray, &mut |hit| match best {
            Some(b) if (b.t, b.triangle) <= (hit.t, hit.triangle) => b.t,
            _ => best.insert(hit).t,
        });
        best
    }

    /// Returns whether the ray hits anything.
    fn any(&self, ray: &Ray<R>) -> bool {
        let mut found = false;
        self.visit(ray, &mut |_| {
            found = true;
            ray.near
        });
        found
    }
}

impl<R: Real, F: Finder<R>> Finder<R> for &F {
    fn visit(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(Hit<R>) -> R) {
        (**self).visit(ray, visitor);
    }

    fn visit_larger(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(LargerHit<R>) -> R) {
        (**self).visit_larger(ray, visitor);
    }
}

impl<R: Real, F: Finder<R>> Finder<R> for Arc<F> {
    fn visit(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(Hit<R>) -> R) {
        (**self).visit(ray, visitor);
    }

    fn visit_larger(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(LargerHit<R>) -> R) {
        (**self).visit_larger(ray, visitor);
    }
}

/// A finder for exhaustive casting, as in the paper's program. A primary ray is tested against every triangle, and a
/// shadow ray against one triangle after another until it hits one of them.
#[derive(Clone, Debug)]
pub struct Exhaustive<R: Real> {
    triangles: Vec<[R::Vector; 3]>,
    culling: Culling,
}

impl<R: Real> Exhaustive<R> {
    /// Copies the mesh's triangles in their order, without shared vertices.
    pub fn new(mesh: &Mesh, culling: Culling) -> Self {
        let triangles = mesh.triangles.iter().map(|t| mesh.corners(t).map(Vector::of)).collect();
        Self { triangles, culling }
    }
}

impl<R: Real> Finder<R> for Exhaustive<R> {
    fn visit(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(Hit<R>) -> R) {
        let mut far = ray.far;
        for (triangle, corners) in self.triangles.iter().enumerate() {
            let Some((t, weights)) = moller_trumbore(ray, *corners, self.culling) else { continue };
            if t <= far {
                far = visitor(Hit { t, weights, triangle: triangle as u32 });
                if far <= ray.near {
                    return;
                }
            }
        }
    }

    fn visit_larger(&self, ray: &Ray<R>, visitor: &mut dyn FnMut(LargerHit<R>) -> R) {
        for (triangle, corners) in self.triangles.iter().enumerate() {
            if let Some(found) = larger_hit(ray, triangle as u32, *corners, self.culling) {
                visitor(found);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// A finder that reports hits at one distance, the last triangle first.
    struct Backwards;

    impl Finder<f64> for Backwards {
        fn visit(&self, _: &Ray<f64>, visitor: &mut dyn FnMut(Hit<f64>) -> f64) {
            for triangle in [5, 3, 4] {
                visitor(Hit { t: 1.0, weights: [1.0, 0.0, 0.0], triangle });
            }
        }
    }

    #[test]
    fn of_equally_near_hits_the_first_of_the_mesh_counts() {
        let ray = Ray {
            origin: DVec3::ZERO,
            direction: DVec3::Z,
            near: 0.0,
            far: f64::INFINITY,
            to_light: false,
            is_shadow: false,
        };
        assert_eq!(Backwards.closest(&ray).map(|hit| hit.triangle), Some(3));
    }
}
