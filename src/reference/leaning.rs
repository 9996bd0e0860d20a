//! The ray-triangle test with an allowance for the rounding of devices: each triangle is either larger or smaller than
//! in the exact test.
//!
//! A test in single precision computes determinants: sums of products of edges and of corners relative to the ray's
//! origin. Their rounding errors grow with these factors, not with the determinants, which are small for long, thin
//! triangles, for grazing rays, and for triangles that are close to a light but have distant corners. Nudges of a
//! pixel's ray do not reveal these errors.

use super::ray::Ray;
use super::real::{Real, Vector};
use crate::strategy::Culling;

/// The largest rounding error of a determinant, relative to the product of the lengths of its factors. It is about
/// twice the sum of the errors of the operations that compute it (`EDGE_ON_ROUNDING` in `cl/common/hit.cl`), and
/// includes the tolerances of the tests themselves.
pub const ROUNDING: f64 = 1e-6;

/// The direction in which rounding changes triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lean {
    /// Each triangle is as large as rounding can make it.
    Larger,
    /// Each triangle is as small as rounding can make it.
    Smaller,
}

impl Lean {
    /// Both directions.
    pub const BOTH: [Self; 2] = [Self::Larger, Self::Smaller];
}

/// Returns how far outside its box a triangle may be hit whose farthest corner has this distance.
pub fn margin(reach: f64) -> f64 {
    4.0 * ROUNDING * reach
}

/// The determinants of a ray-triangle test, and their largest errors.
struct Determinants<R: Real> {
    /// The determinant of the direction and two edges, as an absolute value.
    size: R,
    error_of_size: R,
    /// 1 if the ray sees the front, else -1. The other determinants are multiplied by it.
    sign: R,
    /// Those of the three weights.
    weights: [R; 3],
    errors: [R; 3],
    /// That of the distance.
    height: R,
    error_of_height: R,
    /// The largest distance of a corner from an end of the ray.
    reach: R,
}

impl<R: Real> Determinants<R> {
    fn of(ray: &Ray<R>, [v0, v1, v2]: [R::Vector; 3]) -> Self {
        let (e1, e2) = (v1 - v0, v2 - v0);
        let q = ray.direction.cross(e2);
        let a = e1.dot(q);
        let s = ray.origin - v0;
        let r = s.cross(e1);
        let sign = if a < R::ZERO { -R::ONE } else { R::ONE };
        let (n1, n2) = (s.dot(q), ray.direction.dot(r));
        let (part, reach) = (R::of(ROUNDING), reach(ray, &[v0, v1, v2]));
        let (size1, size2) = (length(e1), length(e2));
        let (error1, error2, error_of_size) =
            (part * reach * size2, part * reach * size1, part * size1 * size2);
        Self {
            size: a * sign,
            error_of_size,
            sign,
            weights: [a - n1 - n2, n1, n2].map(|weight| weight * sign),
            errors: [error1 + error2 + error_of_size, error1, error2],
            height: e2.dot(r) * sign,
            error_of_height: part * reach * size1 * size2,
            reach,
        }
    }

    fn is_edge_on(&self) -> bool {
        self.size <= self.error_of_size
    }

    fn is_inside(&self, lean: Lean) -> bool {
        let within = |sign: R, slack: R| {
            self.weights.iter().zip(self.errors).all(|(weight, error)| *weight * sign >= slack * error)
        };
        match lean {
            Lean::Larger => within(R::ONE, -R::ONE) || self.is_edge_on() && within(-R::ONE, -R::ONE),
            Lean::Smaller => !self.is_edge_on() && within(R::ONE, R::ONE),
        }
    }

    fn is_culled(&self, lean: Lean) -> bool {
        let a = self.size * self.sign;
        match lean {
            Lean::Larger => a < -self.error_of_size,
            Lean::Smaller => a <= self.error_of_size,
        }
    }

    /// Returns the least and the greatest distance that rounding may give the hit. It lies in the box around the
    /// triangle, whatever the quotient of the determinants is. `None` if the ray misses the box.
    fn distances(&self, ray: &Ray<R>, corners: &[R::Vector; 3]) -> Option<[R; 2]> {
        let [enter, leave] = crossing(ray, corners, R::of(margin(1.0)) * self.reach)?;
        if self.is_edge_on() {
            return Some([enter, leave]);
        }
        let sizes = [self.size - self.error_of_size, self.size + self.error_of_size];
        let lows = sizes.map(|size| (self.height - self.error_of_height) / size);
        let highs = sizes.map(|size| (self.height + self.error_of_height) / size);
        Some([least(lows[0], lows[1]).max(enter), least(highs[0].max(highs[1]), leave)])
    }

    /// Returns the weights of a hit. A hit beside the exact triangle gets those of a point on its edge.
    fn weights(&self) -> [R; 3] {
        if self.size == R::ZERO {
            return [R::ONE, R::ZERO, R::ZERO];
        }
        let [_, n1, n2] = self.weights;
        let w1 = least((n1 / self.size).max(R::ZERO), R::ONE);
        let w2 = least((n2 / self.size).max(R::ZERO), R::ONE - w1);
        [R::ONE - w1 - w2, w1, w2]
    }
}

/// Tests a ray like [`super::intersect::moller_trumbore`], but on a triangle that rounding has made larger or smaller.
pub fn leaning<R: Real>(
    ray: &Ray<R>,
    corners: [R::Vector; 3],
    culling: Culling,
    lean: Lean,
) -> Option<(R, [R; 3])> {
    let found = Determinants::of(ray, corners);
    if !found.is_inside(lean) || culling == Culling::Back && found.is_culled(lean) {
        return None;
    }
    let [low, high] = found.distances(ray, &corners)?;
    let exact = found.height / found.size;
    // A ray without a near plane starts beside a surface. The shadow bias allows for rounding there, and the reference
    // also casts such a ray with other biases and from other starts.
    let is_beyond = |t: R| if ray.near == R::ZERO { exact > R::ZERO } else { t > ray.near };
    let is_between = match lean {
        Lean::Larger => is_beyond(high) && low < ray.far,
        Lean::Smaller => is_beyond(low) && high < ray.far,
    };
    // A quotient of two zeros is not a number; then `low` is the distance.
    let t = least(exact.max(low), high);
    let t = if t < ray.far { t.max(ray.near) } else { low.max(ray.near) };
    is_between.then(|| (t, found.weights()))
}

/// Returns the largest error of the distance at which a ray hits a triangle, relative to that distance; at most 1.
pub fn relative_error<R: Real>(ray: &Ray<R>, corners: [R::Vector; 3], t: R) -> R {
    let distances = Determinants::of(ray, corners).distances(ray, &corners);
    distances.map_or(R::ONE, |[low, high]| least((high - low) / t, R::ONE))
}

/// Returns the largest distance of a corner from the ray's origin, or from the light at its end: devices subtract
/// either from the corners.
fn reach<R: Real>(ray: &Ray<R>, corners: &[R::Vector; 3]) -> R {
    let farthest =
        |from: R::Vector| corners.iter().map(|corner| length(*corner - from)).fold(R::ZERO, R::max);
    let reach = farthest(ray.origin);
    if ray.to_light { reach.max(farthest(ray.origin + ray.direction * ray.far)) } else { reach }
}

/// Returns the distances at which a ray enters and leaves the box around a triangle, grown by a margin. `None` if it
/// misses the box.
fn crossing<R: Real>(ray: &Ray<R>, corners: &[R::Vector; 3], margin: R) -> Option<[R; 2]> {
    let (mut enter, mut leave) = (-R::INFINITY, R::INFINITY);
    for axis in R::Vector::AXES {
        let places = corners.map(|corner| (corner - ray.origin).dot(axis));
        let low = least(least(places[0], places[1]), places[2]) - margin;
        let high = places[0].max(places[1]).max(places[2]) + margin;
        let along = ray.direction.dot(axis);
        if along == R::ZERO {
            if low > R::ZERO || high < R::ZERO {
                return None;
            }
        } else {
            let [one, other] = [low / along, high / along];
            enter = enter.max(least(one, other));
            leave = least(leave, one.max(other));
        }
    }
    (enter <= leave).then_some([enter, leave])
}

fn length<R: Real>(vector: R::Vector) -> R {
    vector.dot(vector).sqrt()
}

fn least<R: Real>(one: R, other: R) -> R {
    -(-one).max(-other)
}
