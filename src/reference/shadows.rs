//! Finds the lights that reach all points near a hit. A single search of the tree, which starts at the light,
//! decides whether a light reaches all these points.

use super::certainty::AT_LIGHT;
use super::ray_packet::RayPacket;
use super::shadow_end::ends;
use super::soft::Seen;
use super::tree::Tree;
use glam::DVec3;
use std::cell::RefCell;

/// Which lights reach all points near a hit, and which lights reach none of these points. The result for a
/// light is computed when it is first needed.
#[derive(Debug)]
pub struct Shadows<'a> {
    seen: &'a Seen<'a>,
    tree: &'a Tree,
    points: Points,
    bias: f64,
    /// The result for each light, or `None` before the first search for this light.
    known: RefCell<Vec<Option<Reaches>>>,
}

/// A centre on a triangle, and points around the centre, which lie on the triangle or very close to it. Smooth
/// shadows may move the centre and these points to places above the triangle.
#[derive(Clone, Copy, Debug)]
pub struct Points {
    /// The number of the triangle on which the centre lies before smooth shadows move it.
    pub triangle: u32,
    /// The triangle's normal, on the side to which smooth shadows move the points; `None` if the points are not moved.
    pub moved_to: Option<DVec3>,
    /// The point at the centre of the points.
    pub centre: DVec3,
    /// The unit normal at the centre, with which the surface is shaded.
    pub normal: DVec3,
    /// The largest distance of a point from the centre.
    pub spread: f64,
}

/// `Some(true)` if a light certainly reaches all points near a hit, `Some(false)` if the light certainly
/// reaches none of these points, otherwise `None`.
type Reaches = Option<bool>;

impl<'a> Shadows<'a> {
    /// Returns a `Shadows` that finds out which lights of a pixel's sample reach the points `points`. This
    /// function does not search the tree yet.
    pub fn new(seen: &'a Seen<'a>, tree: &'a Tree, points: Points, bias: f64) -> Self {
        Self { seen, tree, points, bias, known: RefCell::new(vec![None; seen.lights.len()]) }
    }

    /// Returns `Some(true)` if the light with the index `light` reaches all points near the hit, and
    /// `Some(false)` if it reaches none of them. Returns `None` if it is uncertain which points the light
    /// reaches, or if `light` is the sky's index.
    pub fn reaches(&self, light: usize) -> Reaches {
        // The sky has no entry in `known`, since each point sees the sky in a different direction.
        let known = *self.known.borrow().get(light)?;
        known.unwrap_or_else(|| {
            let result = self.find(light);
            self.known.borrow_mut()[light] = Some(result);
            result
        })
    }

    /// Returns true if there is a sky, or if [`Self::reaches`] returned `None` for a light.
    pub fn some_are_unsure(&self) -> bool {
        self.seen.sky.is_some() || self.known.borrow().contains(&Some(None))
    }

    /// Computes the result of [`Self::reaches`] by one search from the light, where all shadow rays to this
    /// light meet.
    fn find(&self, light: usize) -> Reaches {
        let position = self.seen.lights[light].position.as_dvec3();
        let Points { triangle, moved_to, centre, normal, spread } = self.points;
        let off = centre - position;
        let distance = off.length();
        let at_light = 2.0 * AT_LIGHT * distance.max(position.length());
        let [_, end] = ends(self.bias, distance, -off.dot(normal) / distance);
        // The factor 1.1 allows for the points around the centre, where the light's distance and cosine
        // differ from the values at the centre.
        let end = 1.1 * end.max(2.0 * self.bias);
        let [least, most] = [distance - spread - end, distance + spread - 0.5 * self.bias];
        if least <= 4.0 * at_light || spread > 0.01 * distance {
            return None;
        }
        // The points' own triangle may block the light only if the points and the light are on different
        // sides of this triangle.
        let own = moved_to.is_none_or(|side| off.dot(side) <= 0.0).then_some(triangle);
        let packet = RayPacket::new(position, off / distance, 1.1 * spread / distance).from_light(centre);
        let blocked =
            packet.is_blocked_towards_origin(self.tree, own, [at_light, least], [-at_light, most])?;
        Some(!blocked)
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::*;
    use crate::scene::{Sample, Scene, Sky};
    use crate::strategy::Culling;
    use glam::Vec3;

    #[test]
    fn nothing_is_sure_of_a_light_that_is_near_beside_the_spread_of_points() {
        let scene = fixtures::figure_4();
        let tree = Tree::new(&scene.mesh, Culling::None);
        let seen = Seen::of(&scene, Sample::CENTRE, [0, 0]);
        // The point lies on the ground, far from the triangle and its shadow.
        let point = DVec3::new(3.0, -1.0, 1.0);
        let distance = point.distance(scene.lights[0].position.as_dvec3());
        let find = |part: f64| {
            let triangle = scene.mesh.triangles.len() as u32 - 1;
            let (normal, spread) = (DVec3::Y, part * distance);
            let points = Points { triangle, moved_to: None, centre: point, normal, spread };
            Shadows::new(&seen, &tree, points, 1e-3).find(0)
        };
        assert_eq!([find(1e-6), find(0.02)], [Some(true), None]);
    }

    #[test]
    fn what_is_sure_of_all_points_within_a_spread_is_true_of_each() {
        let scene = fixtures::figure_4();
        let tree = Tree::new(&scene.mesh, Culling::None);
        let seen = Seen::of(&scene, Sample::CENTRE, [0, 0]);
        let find = |centre: DVec3, spread: f64| {
            let triangle = scene.mesh.triangles.len() as u32 - 1;
            let points = Points { triangle, moved_to: None, centre, normal: DVec3::Y, spread };
            Shadows::new(&seen, &tree, points, 1e-3).find(0)
        };
        // The points lie on the ground, on a line from far outside the triangle's shadow to the shadow's centre.
        let light = scene.lights[0].position.as_dvec3();
        let corners = scene.mesh.corners(&scene.mesh.triangles[0]).map(|corner| corner.as_dvec3());
        let off = (corners[0] + corners[1] + corners[2]) / 3.0 - light;
        let shadow = light + off * ((-1.0 - light.y) / off.y);
        let mut results = std::collections::HashSet::new();
        for step in 0..600 {
            let centre = DVec3::new(3.0, -1.0, 1.0).lerp(shadow, f64::from(step) / 600.0);
            let spread = 0.004 * centre.distance(light);
            let of_all = find(centre, spread);
            results.insert(of_all);
            for direction in (0..16).map(|i| DVec3::new(f64::from(i).cos(), 0.0, f64::from(i).sin())) {
                let one = find(centre + 0.99 * spread * direction, 1e-9);
                assert!(
                    of_all.is_none() || one.is_none() || one == of_all,
                    "at {centre}, towards {direction}"
                );
            }
        }
        assert_eq!(results.len(), 3, "lit points, points in shadow, and points at its border: {results:?}");
    }

    #[test]
    fn something_is_unsure_under_a_sky_and_after_a_search_without_a_result() {
        let mut scene = fixtures::figure_4();
        let tree = Tree::new(&scene.mesh, Culling::None);
        // Returns the values of `some_are_unsure` before and after the search for the scene's light: true if
        // the result for some light, or for the sky, is uncertain.
        let unsure = |scene: &Scene, part: f64| {
            let seen = Seen::of(scene, Sample::CENTRE, [0, 0]);
            let centre = DVec3::new(3.0, -1.0, 1.0);
            let spread = part * centre.distance(scene.lights[0].position.as_dvec3());
            let triangle = scene.mesh.triangles.len() as u32 - 1;
            let points = Points { triangle, moved_to: None, centre, normal: DVec3::Y, spread };
            let shadows = Shadows::new(&seen, &tree, points, 1e-3);
            let before = shadows.some_are_unsure();
            assert_eq!(shadows.reaches(0), (part < 0.01).then_some(true));
            assert_eq!(shadows.reaches(scene.lights.len()), None, "the sky");
            [before, shadows.some_are_unsure()]
        };
        assert_eq!(unsure(&scene, 1e-6), [false; 2]);
        assert_eq!(unsure(&scene, 0.02), [false, true]);
        let (zenith, horizon, up) = (Vec3::ONE, Vec3::ZERO, Vec3::Y);
        scene.sky = Some(Sky { zenith, horizon, up, reach: f32::MAX, picture: None });
        assert_eq!(unsure(&scene, 1e-6), [true; 2]);
    }
}
