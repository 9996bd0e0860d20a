//! Ray packets. A packet consists of all rays of a narrow cone from one point. One packet contains a pixel's
//! ray and all its nudged rays, so one search of the tree can find the triangle that all these rays hit.
//! Packets of a second kind contain the shadow rays between a light and the hits of these rays. Packets make
//! the reference fast.

use super::leaning::{ROUNDING, margin};
use super::ray::Ray;
use super::tree::{Indexed, Tree};
use crate::strategy::Culling;
use glam::DVec3;

/// The smallest angle of a packet in radians; far larger than the rounding errors of double precision.
const NARROWEST: f64 = 1e-9;

/// A packet of rays: all rays of a cone from a point.
#[derive(Clone, Copy, Debug)]
pub struct RayPacket {
    /// The point at which all rays of the packet start.
    pub origin: DVec3,
    /// The unit vector along the axis of the packet's cone.
    pub direction: DVec3,
    /// The largest angle between a ray and the axis, in radians.
    angle: f64,
    /// If a light is at `origin`, the point of a surface near which the rays end; otherwise equal to `origin`.
    /// Devices may cast rays between a light and a surface from either end.
    end: DVec3,
}

/// How the rays of a packet hit a triangle, with the least and the greatest possible distance of a hit from the
/// packet's origin. The distance is negative if the triangle is behind the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
enum PacketHit {
    /// No ray of the packet hits the triangle.
    None,
    /// Some rays of the packet may hit the triangle.
    Some([f64; 2]),
    /// All rays of the packet hit the triangle.
    All([f64; 2]),
}

impl RayPacket {
    /// Makes the packet of all rays from `origin` whose angle to the unit vector `direction` is at most
    /// `angle`, in radians.
    pub fn new(origin: DVec3, direction: DVec3, angle: f64) -> Self {
        Self { origin, direction, angle: angle.max(NARROWEST), end: origin }
    }

    /// Returns the same packet for rays that start at a light and end near the point `surface`.
    pub fn from_light(self, surface: DVec3) -> Self {
        Self { end: surface, ..self }
    }

    /// Returns how the packet hits a triangle. The function tests on which side of each of three planes the
    /// packet's rays lie. Each of these planes contains the origin and an edge of the triangle. The dot
    /// product of a plane's unit normal with a ray's direction differs from the normal's dot product with the
    /// cone's axis by at most the cone's angle in radians. A result that rounding could change is
    /// `PacketHit::Some` (see [`super::leaning`]).
    fn intersect(&self, corners: &[DVec3; 3], culling: Culling) -> PacketHit {
        let [ab, bc, ca] = [corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]];
        let [a, b, c] = corners.map(|corner| corner - self.origin);
        let sizes = [ab, bc, ca].map(DVec3::length);
        // `errors` are upper bounds of the rounding errors of a device's determinants for the three edges
        // (see `leaning`). The packet's rays end near `end`, not exactly at `end`; the factor 1.01 allows for
        // this.
        let part = 1.01 * ROUNDING * self.reach(corners);
        let error_of_slope = ROUNDING * sizes[0] * sizes[2];
        let errors = [part * (sizes[0] + sizes[2]) + error_of_slope, part * sizes[2], part * sizes[0]];
        // The cross product b x bc equals b x c, but has smaller rounding errors if the triangle is small and far away.
        let planes = [(b.cross(bc), errors[0]), (c.cross(ca), errors[1]), (a.cross(ab), errors[2])];
        let sides = planes.map(|(plane, error)| self.side(plane, error));
        if sides.contains(&Side::Above) && sides.contains(&Side::Below) {
            return PacketHit::None;
        }
        let normal = ca.cross(ab);
        let (height, slope) = (normal.dot(a), normal.dot(self.direction));
        let slack = self.angle * normal.length() + error_of_slope;
        let error_of_height = part * sizes[0] * sizes[2];
        match self.side(normal, error_of_slope) {
            // The triangle is seen edge-on, or is so small that rounding may decide which of its sides the rays meet.
            Side::Between => {
                PacketHit::Some([(height.abs() - error_of_height) / (slope.abs() + slack), f64::INFINITY])
            }
            Side::Above if culling == Culling::Back => PacketHit::None, // seen from behind
            face => {
                let heights = [height - error_of_height, height + error_of_height];
                let ends = heights.map(|height| [height / (slope - slack), height / (slope + slack)]);
                let ends = ends.as_flattened();
                let range = [
                    ends.iter().copied().fold(f64::INFINITY, f64::min),
                    ends.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                ];
                let outside = if face == Side::Above { Side::Below } else { Side::Above };
                if sides == [face; 3] {
                    PacketHit::All(range)
                } else if sides.contains(&outside) {
                    PacketHit::None
                } else {
                    PacketHit::Some(range)
                }
            }
        }
    }

    /// Returns the result of [`Self::intersect`], but `PacketHit::Some` instead of `PacketHit::All` if the
    /// triangle may have holes.
    fn intersect_surface(&self, indexed: &Indexed, corners: &[DVec3; 3], culling: Culling) -> PacketHit {
        match self.intersect(corners, culling) {
            PacketHit::All(range) if indexed.has_holes => PacketHit::Some(range),
            certain => certain,
        }
    }

    /// Returns on which side of a plane through the origin the rays lie. `plane` is the plane's normal, and `error` is
    /// the largest rounding error of the normal's dot product with a unit direction.
    fn side(&self, plane: DVec3, error: f64) -> Side {
        let height = plane.dot(self.direction);
        if height.abs() <= self.angle * plane.length() + error {
            Side::Between
        } else if height > 0.0 {
            Side::Above
        } else {
            Side::Below
        }
    }

    /// Returns the largest distance of a corner from `self.origin` or `self.end`.
    fn reach(&self, corners: &[DVec3; 3]) -> f64 {
        let squared =
            |from: DVec3| corners.iter().map(|corner| corner.distance_squared(from)).fold(0.0, f64::max);
        squared(self.origin).max(squared(self.end)).sqrt()
    }

    /// Returns the largest distance from the packet's axis at which a ray of the packet may hit a triangle of
    /// `tree`.
    fn around(&self, tree: &Tree) -> f64 {
        let reach = tree.reach(self.origin);
        self.angle * reach + margin(reach.max(tree.reach(self.end)))
    }

    /// Returns `Some(Some(triangle))` if, beyond the distance `near`, each ray of the packet hits this triangle
    /// first, and `Some(None)` if no ray hits a triangle beyond `near`. Returns `None` if the result is
    /// uncertain. For example, the result is uncertain if a second triangle is only slightly farther away
    /// than the first: by at most the fraction `2 * rival` of the first triangle's distance.
    pub fn first(&self, tree: &Tree, near: f64, rival: f64) -> Option<Option<u32>> {
        let around = self.around(tree);
        let ray = Ray {
            origin: self.origin,
            direction: self.direction,
            near: 0.0,
            far: f64::INFINITY,
            to_light: false,
            is_shadow: false,
        };
        // The distance of the near plane along a ray depends on the ray's direction. For all rays of the
        // packet together, the distance of the near plane is therefore a range.
        let (nearest, farthest) = (near * (1.0 - 10.0 * self.angle), near * (1.0 + 10.0 * self.angle));
        let (mut best, mut others): (Option<(u32, [f64; 2])>, f64) = (None, f64::INFINITY);
        let reach = |best: &Option<(u32, [f64; 2])>| {
            best.map_or(f64::INFINITY, |(_, range)| range[1] * (1.0 + 2.0 * rival))
        };
        tree.walk(&ray, around, |indexed, far| {
            match self.intersect_surface(indexed, &indexed.corners(), tree.culling()) {
                PacketHit::None => {}
                PacketHit::Some(range) | PacketHit::All(range) if range[1] < nearest => {}
                PacketHit::All(range) if range[0] > farthest => match best {
                    Some((_, known)) if known[1] <= range[1] => others = others.min(range[0]),
                    _ => {
                        others = others.min(best.map_or(f64::INFINITY, |(_, known)| known[0]));
                        best = Some((indexed.triangle, range));
                    }
                },
                PacketHit::Some(range) | PacketHit::All(range) => others = others.min(range[0]),
            }
            far.min(reach(&best))
        });
        (others > reach(&best) || others == f64::INFINITY).then_some(best.map(|(triangle, _)| triangle))
    }

    /// Tests whether triangles block the packet's rays if these run towards the packet's origin. If `own` is not
    /// `None`, the triangle with this index is ignored. Returns `Some(true)` if all rays hit one triangle at
    /// distances in the range `sure`. Returns `Some(false)` if no ray can hit a triangle at a distance in the
    /// range `may`. If neither condition is met, the result is uncertain, and the function returns `None`.
    /// Distances are measured from the packet's origin.
    pub fn is_blocked_towards_origin(
        &self,
        tree: &Tree,
        own: Option<u32>,
        sure: [f64; 2],
        may: [f64; 2],
    ) -> Option<bool> {
        let around = self.around(tree);
        let ray = Ray {
            origin: self.origin,
            direction: self.direction,
            near: may[0],
            far: may[1],
            to_light: true,
            is_shadow: true,
        };
        let (mut blocked, mut open) = (false, false);
        tree.walk(&ray, around, |indexed, far| {
            if blocked || own == Some(indexed.triangle) {
                return far;
            }
            // The rays run towards the origin, so they hit the triangle's other side.
            let [a, b, c] = indexed.corners();
            match self.intersect_surface(indexed, &[a, c, b], tree.culling()) {
                PacketHit::All(range) if range[0] >= sure[0] && range[1] <= sure[1] => blocked = true,
                PacketHit::Some(range) | PacketHit::All(range)
                    if range[1] >= may[0] && range[0] <= may[1] =>
                {
                    open = true;
                }
                _ => {}
            }
            if blocked { ray.near } else { far }
        });
        if blocked { Some(true) } else { (!open).then_some(false) }
    }
}

/// On which side of a plane a packet's rays lie. `Between` means that the rays lie on both sides, or that
/// rounding decides the side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Above,
    Between,
    Below,
}

#[cfg(test)]
mod tests {
    use super::super::intersect::moller_trumbore;
    use super::super::leaning::larger_hit;
    use super::*;
    use crate::scene::{Mesh, Triangle};
    use glam::Vec3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Returns directions of rays inside the packet's cone and on its surface.
    fn rays(packet: &RayPacket) -> impl Iterator<Item = DVec3> {
        let across = packet.direction.any_orthonormal_vector();
        let down = packet.direction.cross(across);
        let (direction, angle) = (packet.direction, packet.angle);
        (0..40_u8).map(move |i| {
            let turn = f64::from(i) * 0.7;
            let off = angle * [0.0, 0.3, 0.7, 1.0][usize::from(i) % 4];
            (direction + off * (turn.cos() * across + turn.sin() * down)).normalize()
        })
    }

    #[test]
    fn a_packet_hits_what_its_rays_hit() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut vector = |half: f64| DVec3::from_array([(); 3].map(|()| random.random_range(-half..half)));
        let mut counts = [0; 3];
        for case in 0..20_000 {
            let size = [1.0, 0.1, 1e-3, 1e-6][case % 4];
            let centre = vector(1.0);
            let corners = [(); 3].map(|()| centre + vector(size));
            // The packet aims at a random point near an edge of the triangle. The point at which the packet
            // aims may lie beside the triangle. One packet in seven starts in the triangle's plane, and all
            // others start at a random point.
            let aim = corners[0].lerp(corners[1], 0.3) + vector(0.3 * size);
            let origin =
                if case % 7 == 0 { corners[0] + 3.0 * (corners[1] - corners[2]) } else { vector(2.0) };
            let angle = [1e-5, 1e-2, 1e-4][case % 3];
            let packet = RayPacket::new(origin, (aim - origin).normalize(), angle);
            for culling in [Culling::None, Culling::Back] {
                let packet_hit = packet.intersect(&corners, culling);
                counts[match packet_hit {
                    PacketHit::None => 0,
                    PacketHit::Some(_) => 1,
                    PacketHit::All(_) => 2,
                }] += 1;
                for direction in rays(&packet) {
                    let ray = Ray {
                        origin,
                        direction,
                        near: 0.0,
                        far: f64::INFINITY,
                        to_light: false,
                        is_shadow: false,
                    };
                    let hit = moller_trumbore(&ray, corners, culling).map(|(t, _)| t);
                    let within =
                        |t: f64, [low, high]: [f64; 2]| t >= low * (1.0 - 1e-6) && t <= high * (1.0 + 1e-6);
                    let agrees = match (packet_hit, hit) {
                        (PacketHit::None, hit) => hit.is_none(),
                        (PacketHit::Some(_), None) => true,
                        (PacketHit::Some(range) | PacketHit::All(range), Some(t)) => within(t, range),
                        // `intersect` also counts a triangle behind the origin as hit.
                        (PacketHit::All(range), None) => range[0] <= 0.0,
                    };
                    assert!(agrees, "case {case}: {packet_hit:?}, {hit:?}");
                }
            }
        }
        assert!(counts.into_iter().all(|count| count > 500), "{counts:?}");
    }

    #[test]
    fn a_packet_is_certain_only_of_triangles_that_rounding_does_not_change() {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut vector = |half: f64| DVec3::from_array([(); 3].map(|()| random.random_range(-half..half)));
        let mut counts = [0; 3];
        for case in 0..20_000 {
            let (middle, along) = (vector(1.0), vector([1.0, 100.0][case % 2]));
            let corners = [middle - along, middle + along, middle + vector(0.1)];
            // The packet is as narrow as possible, so that only rounding can make the result uncertain.
            let aim = corners[0].lerp(corners[1], 0.45) + vector(1e-4);
            let (origin, light) = (vector(2.0), vector([2.0, 300.0][case % 3 % 2]));
            let direction = (aim - origin).normalize();
            let packet = RayPacket::new(origin, direction, NARROWEST).from_light(light);
            let ray =
                Ray { origin, direction, near: 0.0, far: f64::INFINITY, to_light: false, is_shadow: false };
            let packet_hit = packet.intersect(&corners, Culling::None);
            let hit = larger_hit(&ray, 0, corners, Culling::None);
            let (larger, smaller) = (hit.is_some(), hit.is_some_and(|hit| hit.is_certain));
            match packet_hit {
                PacketHit::None => assert!(!larger, "case {case}"),
                PacketHit::Some(_) => {}
                PacketHit::All([low, _]) => assert!(smaller || low <= 0.0, "case {case}"),
            }
            counts[match packet_hit {
                PacketHit::None => 0,
                PacketHit::Some(_) => 1,
                PacketHit::All(_) => 2,
            }] += 1;
        }
        assert!(counts.into_iter().all(|count| count > 500), "{counts:?}");
    }

    /// Returns a tree over rectangles perpendicular to the z axis, one at z = -`depth` for each element of
    /// `depths`. Rectangle `i` consists of the triangles `2 * i` and `2 * i + 1`.
    fn squares(depths: &[f32]) -> Tree {
        let mut mesh = Mesh { normals: vec![Vec3::Z], ..Mesh::default() };
        for depth in depths {
            let first = mesh.positions.len() as u32;
            let corners = [[-3.0, -2.0], [3.0, -2.0], [3.0, 2.0], [-3.0, 2.0]];
            mesh.positions.extend(corners.map(|[x, y]| Vec3::new(x, y, -depth)));
            for positions in [[0, 1, 2], [0, 2, 3]] {
                let positions = positions.map(|corner| first + corner);
                mesh.triangles.push(Triangle { positions, normals: [0; 3], material: 0 });
            }
        }
        Tree::new(&mesh, Culling::None)
    }

    /// Returns a packet that runs towards negative z, through the first triangle of each rectangle.
    fn down() -> RayPacket {
        RayPacket::new(DVec3::new(0.5, -0.5, 0.0), DVec3::NEG_Z, 1e-9)
    }

    #[test]
    fn what_is_first_is_not_sure_at_the_near_plane_or_before_a_rival() {
        let first = |depths: &[f32], near: f64| down().first(&squares(depths), near, 1e-3);
        assert_eq!(first(&[1.0], 0.5), Some(Some(0)));
        assert_eq!(first(&[1.0], 2.0), Some(None));
        assert_eq!(first(&[1.0], 1.0), None, "the rectangle lies in the near plane");
        assert_eq!(first(&[1.0, 1.1], 0.5), Some(Some(0)));
        assert_eq!(first(&[1.1, 1.0], 0.5), Some(Some(2)));
        for rivals in [[1.0_f32, 1.000_5], [1.000_5, 1.0]] {
            assert_eq!(first(&rivals, 0.5), None, "one rectangle lies only half of `rival` behind the other");
        }
    }

    #[test]
    fn a_packet_from_a_light_reaches_from_the_end_that_is_farther_from_the_triangle() {
        let corners = [DVec3::X, DVec3::Y, DVec3::Z];
        let packet = RayPacket::new(DVec3::ZERO, DVec3::X, 0.1);
        assert_eq!(packet.reach(&corners), 1.0);
        assert_eq!(packet.from_light(10.0 * DVec3::X).reach(&corners), 101.0_f64.sqrt());
        let far_light = RayPacket::new(10.0 * DVec3::X, DVec3::NEG_X, 0.1);
        assert_eq!(far_light.from_light(DVec3::ZERO).reach(&corners), 101.0_f64.sqrt());
    }

    #[test]
    fn a_surface_does_not_block_itself() {
        let tree = squares(&[1.0, 2.0]);
        let blocked = |own: u32, least: f64| {
            down().is_blocked_towards_origin(&tree, Some(own), [1e-6, least], [-1e-6, least + 1e-3])
        };
        // From the origin, the first rectangle is in front of the second one.
        assert_eq!(blocked(2, 1.9), Some(true));
        assert_eq!(blocked(0, 1.1), Some(false), "nothing else is as near");
        assert_eq!(blocked(0, 0.5), Some(false));
        assert_eq!(blocked(2, 1.0 - 1e-4), None, "the first rectangle lies in `may` but not in `sure`");
    }
}
