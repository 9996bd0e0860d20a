//! The ray-triangle test with an allowance for the rounding of devices: each triangle is either larger or smaller than
//! in the exact test.
//!
//! A test in single precision computes determinants: sums of products of edges and of corners relative to the ray's
//! origin. The rounding error of a determinant grows with the factors of its products, not with the determinant itself.
//! Determinants are small for long, thin triangles, for grazing rays, and for triangles that are close to a light but
//! have distant corners. Nudges of a pixel's ray do not reveal these errors.

use super::intersect::{Hit, moller_trumbore};
use super::ray::Ray;
use super::real::{Real, Vector};
use crate::strategy::Culling;

/// The largest rounding error of a determinant, relative to the product of the lengths of its factors. The constant
/// is the sum of the errors of all operations that compute a determinant (`EDGE_ON_ROUNDING` in `cl/common/hit.cl`).
pub const ROUNDING: f64 = 6e-7;

/// A ray counts as running along an edge if it is inside the edge by less than this fraction of the edge's error.
const ALONG_EDGE: f32 = 1e-3;

/// The direction in which rounding changes triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lean {
    /// Each triangle is as large as rounding can make it.
    Larger,
    /// Each triangle is as small as rounding can make it.
    Smaller,
}

impl Lean {
    /// Both directions in which rounding may change triangles.
    pub const BOTH: [Self; 2] = [Self::Larger, Self::Smaller];
}

/// Returns how far outside the box around a triangle rounding may place a hit on this triangle. `reach` is
/// the distance from the ray's origin to the triangle's farthest corner.
pub fn margin(reach: f64) -> f64 {
    4.0 * ROUNDING * reach
}

/// The determinants of a ray-triangle test, and their largest errors.
struct Determinants<R: Real> {
    /// The determinant of the direction and two edges, as an absolute value.
    size: R,
    error_of_size: R,
    /// 1 if the ray sees the front, else -1. The other determinants are multiplied by this sign.
    sign: R,
    /// The determinants of the three weights.
    weights: [R; 3],
    errors: [R; 3],
    /// The determinant of the distance.
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

    /// Returns whether the ray is inside all edges if each edge is moved outwards by this fraction of its error.
    fn is_within(&self, part: R) -> bool {
        self.weights.iter().zip(self.errors).all(|(weight, error)| *weight >= -part * error)
    }

    /// Returns the least and the greatest distance that rounding may give the hit. The hit lies in the box around the
    /// triangle, whatever the quotient of the determinants is. `None` if the ray misses the box.
    fn distances(&self, ray: &Ray<R>, corners: &[R::Vector; 3]) -> Option<[R; 2]> {
        let [enter, leave] = crossing(ray, corners, R::of(margin(1.0)) * self.reach)?;
        if self.is_edge_on() {
            return Some([enter, leave]);
        }
        let sizes = [self.size - self.error_of_size, self.size + self.error_of_size];
        let lows = sizes.map(|size| (self.height - self.error_of_height) / size);
        let highs = sizes.map(|size| (self.height + self.error_of_height) / size);
        Some([lows[0].min(lows[1]).max(enter), highs[0].max(highs[1]).min(leave)])
    }

    /// Returns the weights of a hit. A hit beside the exact triangle gets the weights of a point on the triangle's
    /// edge.
    fn weights(&self) -> [R; 3] {
        if self.size == R::ZERO {
            return [R::ONE, R::ZERO, R::ZERO];
        }
        let [_, n1, n2] = self.weights;
        let w1 = (n1 / self.size).max(R::ZERO).min(R::ONE);
        let w2 = (n2 / self.size).max(R::ZERO).min(R::ONE - w1);
        [R::ONE - w1 - w2, w1, w2]
    }
}

/// A hit on a triangle that rounding has made larger.
#[derive(Clone, Copy, Debug)]
pub struct LargerHit<R> {
    /// The hit. If the ray passes beside the exact triangle, the hit point is on the triangle's edge.
    pub hit: Hit<R>,
    /// The least and the greatest distance that rounding may give this hit.
    distances: [R; 2],
    /// True if even the triangle that rounding has made smaller is hit.
    pub is_certain: bool,
    /// True if the exact triangle is hit.
    is_exact: bool,
    /// True if the ray passes beside the exact triangle or along its edge.
    is_beside: bool,
}

impl<R: Real> LargerHit<R> {
    /// Returns the distance beyond which further hits do not matter; `far` if this hit is not certain.
    pub fn limit(&self, far: R) -> R {
        if self.is_certain { self.distances[1].min(far) } else { far }
    }

    /// Returns whether this hit remains if rounding makes triangles smaller. On devices, no ray slips between two
    /// triangles that share an edge: a ray beside the edge hits at least one of them.
    pub fn remains_among(&self, all: &[Self]) -> bool {
        let [low, high] = self.distances;
        let is_neighbour = |other: &&Self| {
            other.hit.triangle != self.hit.triangle && other.distances[0] <= high && low <= other.distances[1]
        };
        self.is_certain || self.is_exact && all.iter().filter(is_neighbour).any(|other| other.is_beside)
    }
}

/// Tests a ray like [`moller_trumbore`], but on a triangle that rounding has made larger.
pub fn larger_hit<R: Real>(
    ray: &Ray<R>,
    triangle: u32,
    corners: [R::Vector; 3],
    culling: Culling,
) -> Option<LargerHit<R>> {
    let found = Determinants::of(ray, corners);
    let (culls, a) = (culling == Culling::Back, found.size * found.sign);
    if !found.is_within(R::ONE) || culls && a < -found.error_of_size {
        return None;
    }
    let [low, high] = found.distances(ray, &corners)?;
    let exact = found.height / found.size;
    // At the start of a shadow ray, the shadow bias allows for rounding. The reference also casts such a ray with other
    // biases and from other starting points.
    let is_beyond = |t: R| if ray.is_shadow { exact > R::ZERO } else { t > ray.near };
    if !is_beyond(high) || low >= ray.far {
        return None;
    }
    // A quotient of two zeros is not a number; then `low` is the distance.
    let t = exact.max(low).min(high);
    let t = if t < ray.far { t.max(ray.near) } else { low.max(ray.near) };
    let is_exact = moller_trumbore(ray, corners, culling).is_some();
    Some(LargerHit {
        hit: Hit { t, weights: found.weights(), triangle },
        distances: [low, high],
        is_certain: !found.is_edge_on()
            && found.is_within(-R::ONE)
            && !(culls && a < R::ZERO)
            && is_beyond(low)
            && high < ray.far,
        is_exact,
        is_beside: !is_exact || !found.is_within(-R::from(ALONG_EDGE)),
    })
}

/// Returns the largest error of the distance at which a ray hits a triangle, as a fraction of this distance; at
/// most 1.
pub fn relative_error<R: Real>(ray: &Ray<R>, corners: [R::Vector; 3], t: R) -> R {
    let distances = Determinants::of(ray, corners).distances(ray, &corners);
    distances.map_or(R::ONE, |[low, high]| ((high - low) / t).min(R::ONE))
}

/// Returns the largest distance of a corner from the ray's origin or from the light at the ray's end. Devices subtract
/// one of these two points from the corners.
fn reach<R: Real>(ray: &Ray<R>, corners: &[R::Vector; 3]) -> R {
    let farthest =
        |from: R::Vector| corners.iter().map(|corner| length(*corner - from)).fold(R::ZERO, R::max);
    let reach = farthest(ray.origin);
    if ray.to_light { reach.max(farthest(ray.origin + ray.direction * ray.far)) } else { reach }
}

/// Returns the distances at which a ray enters and leaves the box around a triangle, enlarged by a margin. `None` if
/// the ray misses the box.
fn crossing<R: Real>(ray: &Ray<R>, corners: &[R::Vector; 3], margin: R) -> Option<[R; 2]> {
    let (mut enter, mut leave) = (-R::INFINITY, R::INFINITY);
    for axis in R::Vector::AXES {
        let places = corners.map(|corner| (corner - ray.origin).dot(axis));
        let low = places[0].min(places[1]).min(places[2]) - margin;
        let high = places[0].max(places[1]).max(places[2]) + margin;
        let along = ray.direction.dot(axis);
        if along == R::ZERO {
            if low > R::ZERO || high < R::ZERO {
                return None;
            }
        } else {
            let [one, other] = [low / along, high / along];
            enter = enter.max(one.min(other));
            leave = leave.min(one.max(other));
        }
    }
    (enter <= leave).then_some([enter, leave])
}

fn length<R: Real>(vector: R::Vector) -> R {
    vector.dot(vector).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::cast::Caster;
    use super::super::certainty::{Asked, sample};
    use super::super::fixtures;
    use super::super::intersect::moller_trumbore;
    use super::super::soft::Seen;
    use super::super::traverse::Exhaustive;
    use super::*;
    use crate::scene::{Mesh, Sample, Scene, Triangle};
    use glam::{DVec3, Vec3, dvec3, vec3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Returns whether a ray hits the triangle that rounding has made larger, and the one that it has made smaller.
    fn hits(ray: &Ray<f64>, corners: [DVec3; 3], culling: Culling) -> [bool; 2] {
        let found = larger_hit(ray, 0, corners, culling);
        [found.is_some(), found.is_some_and(|found| found.is_certain)]
    }

    #[test]
    fn single_precision_finds_nothing_between_the_smaller_and_the_larger_triangle() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut vector = |half: f32| Vec3::from_array([(); 3].map(|()| random.random_range(-half..half)));
        let (mut count, mut doubts) = (0, 0);
        for case in 0..60_000_usize {
            // The triangles range from compact to very long. The rays aim at an edge; half of them run
            // nearly along the triangle.
            let [long, wide] = [[1.0, 1.0], [10.0, 1e-1], [100.0, 1e-2], [1.0, 1e-4]][case % 4];
            let (middle, along) = (vector(1.0), vector(1.0));
            let corners = [middle - long * along, middle + long * along, middle + vector(wide)];
            let beside = long * 0.1_f32.powi(1 + (case / 8 % 6) as i32);
            let aim = corners[0].lerp(corners[1], 0.45) + vector(beside);
            let origin = if case % 8 < 4 { vector(3.0) } else { aim + along + vector(1e-4) };
            let direction = (aim - origin).normalize();
            let ray =
                Ray { origin, direction, near: 1e-3, far: f32::INFINITY, to_light: false, is_shadow: false };
            let [e1, e2] = [corners[1] - corners[0], corners[2] - corners[0]];
            // Devices do not hit triangles that are seen edge-on.
            let is_edge_on = e1.dot(direction.cross(e2)).abs() <= 6e-7 * e1.length() * e2.length();
            let found = !is_edge_on && moller_trumbore(&ray, corners, Culling::None).is_some();
            let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
            let ray =
                Ray { origin, direction, near: 1e-3, far: f64::INFINITY, to_light: false, is_shadow: false };
            let corners = corners.map(Vec3::as_dvec3);
            let [larger, smaller] = hits(&ray, corners, Culling::None);
            assert!(!found || larger, "case {case}: hit, but not even the larger triangle is");
            assert!(found || !smaller, "case {case}: missed, but even the smaller triangle is hit");
            count += usize::from(found);
            doubts += usize::from(larger && !smaller);
        }
        assert!(count > 10_000 && (5_000..50_000).contains(&doubts), "{count} hits, {doubts} doubts");
    }

    #[test]
    fn what_rounding_does_not_change_is_as_in_the_exact_test() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let direction = dvec3(0.1, 0.2, -1.0).normalize();
        let ray = Ray {
            origin: dvec3(0.2, 0.1, 1.0),
            direction,
            near: 0.1,
            far: 9.0,
            to_light: false,
            is_shadow: false,
        };
        let exact = moller_trumbore(&ray, corners, Culling::None);
        assert!(exact.is_some());
        let found = larger_hit(&ray, 0, corners, Culling::None).unwrap();
        assert_eq!(Some((found.hit.t, found.hit.weights)), exact);
        assert!(found.is_certain && found.is_exact && !found.is_beside);
        let behind = [corners[0], corners[2], corners[1]];
        assert_eq!(hits(&ray, behind, Culling::Back), [false, false]);
    }

    #[test]
    fn a_ray_to_a_distant_light_may_be_cast_from_either_end() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let hits = |y: f64, to_light: bool| {
            let origin = dvec3(0.3, y, -1.0);
            let ray = Ray { origin, direction: DVec3::Z, near: 0.0, far: 1000.0, to_light, is_shadow: true };
            hits(&ray, corners, Culling::None)
        };
        assert_eq!(hits(1e-4, false), [true, true]);
        assert_eq!(hits(1e-4, true), [true, false], "1e-4 is less than the error of a distance of 1000");
        assert_eq!([hits(-1e-4, false), hits(-1e-4, true)], [[false, false], [true, false]]);
    }

    #[test]
    fn rounding_decides_whether_an_eye_in_a_triangles_plane_sees_the_triangle() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let hits = |height: f64, is_shadow: bool| {
            let (origin, direction) = (dvec3(0.3, 0.3, height), dvec3(0.0, 0.6, -0.8));
            let ray = Ray { origin, direction, near: 0.0, far: f64::INFINITY, to_light: false, is_shadow };
            hits(&ray, corners, Culling::None)
        };
        // The error of the height above the triangle is 6e-7 of the distance of the farthest corner, which is 0.76.
        assert_eq!([1e-8, -1e-8].map(|height| hits(height, false)), [[true, false]; 2]);
        assert_eq!([1e-5, -1e-5].map(|height| hits(height, false)), [[true; 2], [false; 2]]);
        // A shadow ray starts at the bias, and is cast with several biases.
        assert_eq!([1e-8, -1e-8].map(|height| hits(height, true)), [[true; 2], [false; 2]]);
    }

    /// Returns a scene with these triangles, which all have the same material.
    fn scene(triangles: &[[Vec3; 3]]) -> Scene {
        let mut scene = fixtures::single_triangle();
        let mut mesh =
            Mesh { materials: scene.mesh.materials.clone(), normals: vec![Vec3::Y], ..Mesh::default() };
        for corners in triangles {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            let positions = [first, first + 1, first + 2];
            mesh.triangles.push(Triangle { positions, normals: [0; 3], material: 0 });
        }
        *scene.mesh_mut() = mesh;
        scene
    }

    fn caster(scene: &Scene) -> Caster<'_, f64> {
        Caster::new(scene, [80, 50], Exhaustive::new(&scene.mesh, Culling::None))
    }

    #[test]
    fn thin_triangles_are_uncertain_where_single_precision_may_miss_them() {
        let turns = |half: f32| {
            // The ray passes 1e-4 below the triangle's upper edge.
            let scene = scene(&[[vec3(-half, 1e-4, -2.0), vec3(half, 1e-4, -2.0), vec3(0.0, -1.0, -2.0)]]);
            let caster = caster(&scene);
            let frame = scene.camera.pixel_frame(80, 50);
            let seen = Seen::of(&scene, Sample::CENTRE, [40, 25]);
            let asked = Asked { caster: &caster, frame: &frame, bias: 1e-3, seen, centre: [40.0, 25.0] };
            let found = sample(&asked);
            assert!(found.hit);
            found.turns
        };
        assert_eq!([1.0, 400.0].map(turns), [false, true]);
    }

    #[test]
    fn a_ray_beside_an_edge_that_two_triangles_share_hits_one_of_them() {
        let ray = |x: f64| {
            let origin = dvec3(x, 0.3, 2.0);
            Ray {
                origin,
                direction: DVec3::NEG_Z,
                near: 0.1,
                far: f64::INFINITY,
                to_light: false,
                is_shadow: false,
            }
        };
        let [right, left, above] =
            [DVec3::X, DVec3::NEG_X, dvec3(1.0, 0.0, 0.5)].map(|corner| [DVec3::ZERO, DVec3::Y, corner]);
        let remains = |x: f64, others: &[[DVec3; 3]]| {
            let all = [&[right], others].concat();
            let of =
                |(at, corners): (usize, &[DVec3; 3])| larger_hit(&ray(x), at as u32, *corners, Culling::None);
            let all: Vec<_> = all.iter().enumerate().filter_map(of).collect();
            all.iter().find(|one| one.hit.triangle == 0).map(|one| one.remains_among(&all))
        };
        // The ray is beside the edge, along the edge, and far from the edge.
        assert_eq!([1e-7, 0.0, 0.1].map(|x| remains(x, &[])), [Some(false), Some(false), Some(true)]);
        assert_eq!([1e-7, 0.0, 0.1].map(|x| remains(x, &[left])), [Some(true); 3]);
        assert_eq!(remains(1e-7, &[above]), Some(false), "both triangles lie on the same side of the edge");
        // A triangle in front of the edge or behind it shares no edge.
        let apart = [1.0, -1.0].map(|z| left.map(|corner| corner + DVec3::Z * z));
        assert_eq!(apart.map(|other| remains(0.0, &[other])), [Some(false); 2]);
    }

    #[test]
    fn a_hit_on_a_thin_triangle_may_be_above_or_below_its_plane() {
        let change = |depth: f32| {
            // The ground is a triangle of this depth. The shadow ray from the hit to the light passes 2e-5 above a
            // wall.
            let ground = [vec3(-1.0, -1.0, -2.0), vec3(1.0, -1.0, -2.0), vec3(0.0, -1.0, -2.0 - depth)];
            let point = vec3(0.0, -1.0, -2.0 - 0.3 * depth);
            let light = point + vec3(0.0, 0.5, -3.0);
            let top = point.lerp(light, 1.0 / 3.0) - vec3(0.0, 2e-5, 0.0);
            let wall = [top - Vec3::X, top + Vec3::X, top - 0.1 * Vec3::Y];
            let mut scene = scene(&[ground, wall]);
            scene.lights[0].position = light;
            let caster = caster(&scene);
            let frame = scene.camera.pixel_frame(80, 50);
            let seen = Seen::of(&scene, Sample::CENTRE, [40, 44]);
            let y = 25.0 - 40.0 * f64::from(point.y / -point.z);
            let found =
                sample(&Asked { caster: &caster, frame: &frame, bias: 1e-3, seen, centre: [40.0, y] });
            assert!(found.hit && found.radiance.x > 0.0);
            found.near_change / found.radiance.max_element()
        };
        let [thick, thin] = [0.5, 0.01].map(change);
        assert!(thick < 1e-3 && thin > 0.1, "{thick} {thin}");
    }

    #[test]
    fn a_surface_close_behind_one_seen_at_a_grazing_angle_is_a_rival() {
        let rivals = |height: f32, part: f32, y: f64| {
            let ground = |y: f32| [vec3(-20.0, y, 10.0), vec3(20.0, y, 10.0), vec3(0.0, y, -50.0)];
            let scene = scene(&[ground(-height), ground(-(1.0 + part) * height)]);
            let caster = caster(&scene);
            let (ray, hit) = caster.look(40.0, y);
            caster.rivals(&ray, &hit.expect("the ground"), 1e-6).len()
        };
        assert_eq!([rivals(0.01, 1e-5, 25.1), rivals(1.0, 1e-3, 45.0)], [1, 0]);
    }

    #[test]
    fn a_certain_hit_hides_only_what_rounding_cannot_move_before_it() {
        let hit = |x: f64| {
            let (origin, direction) = (dvec3(x, 0.3, 2.0), DVec3::NEG_Z);
            let ray = Ray { origin, direction, near: 0.1, far: 9.0, to_light: false, is_shadow: false };
            larger_hit(&ray, 0, [DVec3::ZERO, DVec3::X, DVec3::Y], Culling::None).unwrap()
        };
        let (inside, beside) = (hit(0.3), hit(-1e-7));
        let limit = inside.limit(9.0);
        assert!(limit > inside.hit.t && limit < inside.hit.t + 1e-4, "{inside:?}");
        assert_eq!((inside.limit(1.0), beside.limit(9.0)), (1.0, 9.0));
        // Rounding may move the hit away from the origin about as far as towards it.
        let [nearer, farther] = inside.distances.map(|distance| (distance - inside.hit.t).abs());
        assert!(nearer > 1e-6 && (0.9 * nearer..1.1 * nearer).contains(&farther), "{inside:?}");
    }
}
