//! Which pixels any correct caster must agree on, whatever its arithmetic.

use super::beam::Beam;
use super::cast::Caster;
use super::intersect::{Hit, moller_trumbore};
use super::ray::Ray;
use super::shade::Sight;
use super::tree::Tree;
use crate::image::RELATIVE_LIMIT;
use crate::scene::{PixelFrame, Scene};
use glam::DVec3;
use std::cell::{Cell, RefCell};

/// How far a pixel's ray is nudged, in radians: a little, and by about a rounding, for what is narrower than a little.
const NUDGES_RADIANS: [f64; 2] = [1e-5, 1e-6];
/// Another triangle this near behind the closest hit, as a part of its distance, may as well be the closest.
const RIVAL: f64 = 1e-6;
/// How far off its triangle's plane rounding may put a hit, as a part of its distance or of its own coordinates. Where light
/// grazes, that decides whether a shadow ray starts above or below its own surface, and no turn of the ray shows it.
const OFF_PLANE: f64 = 1e-6;

/// How near to a light a surface may or may not be in its way, as a part of the light's distance or of its own coordinates.
const AT_LIGHT: f64 = 1e-6;

/// A pixel's radiance, and what becomes of it when the question changes a little.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Through the pixel's centre.
    pub radiance: DVec3,
    /// Whether the ray hits.
    pub hit: bool,
    /// Whether under some nudge a hit becomes a miss or the reverse.
    pub turns: bool,
    /// The largest change of a channel under any nudge; infinite where it turns.
    pub change: f64,
    /// The least and the most of each channel, over the centre and all nudges.
    pub range: [DVec3; 2],
}

/// Casts the pixel (x, y), then again with its ray nudged each way along the image's axes, with half and twice the shadow
/// bias, with surfaces at lights in their way and not, and as rounding may have it where light grazes. Where two surfaces
/// coincide either is right, so those behind are asked too.
pub fn sample(caster: &Caster<'_, f64>, frame: &PixelFrame, bias: f64, [x, y]: [f64; 2]) -> Found {
    let (ray, hit) = caster.look(x, y);
    let mut sample = Found::of(caster.radiance(&ray, hit.as_ref(), bias), hit.is_some());
    for [x, y] in nudges(frame, [x, y]) {
        let (ray, other) = caster.look(x, y);
        if hit.is_some() != other.is_some() {
            (sample.turns, sample.change) = (true, f64::INFINITY);
        }
        sample.consider(caster.radiance(&ray, other.as_ref(), bias));
    }
    if let Some(hit) = &hit {
        for factor in [0.5, 2.0] {
            sample.consider(caster.radiance(&ray, Some(hit), bias * factor));
        }
        for part in [AT_LIGHT, -AT_LIGHT] {
            let reaches = |sight: &Sight<f64>| {
                caster.reaches_within(sight, bias, sight.distance - part * scale(caster.scene(), sight))
            };
            sample.consider(caster.shaded(&ray, Some(hit), &reaches));
        }
        if let Some(grazing) = caster.grazing(&ray, hit, bias, OFF_PLANE) {
            caster.grazed(&ray, hit, grazing).into_iter().for_each(|radiance| sample.consider(radiance));
        }
        for rival in caster.rivals(&ray, hit, RIVAL) {
            sample.consider(caster.radiance(&ray, Some(&rival), bias));
        }
    }
    sample
}

/// What rounding at a light is relative to.
fn scale(scene: &Scene, sight: &Sight<f64>) -> f64 {
    sight.distance.max(scene.lights[sight.light].position.as_dvec3().length())
}

/// What [`sample`] gives, without searching for what every nudge finds alike: where the whole beam of nudged rays meets one
/// triangle first, or nothing, and the beam from each light to where they meet it is stopped as a whole, or not at all.
/// `None` where that is not sure.
pub fn quick_sample(
    caster: &Caster<'_, f64>,
    tree: &Tree,
    frame: &PixelFrame,
    bias: f64,
    [x, y]: [f64; 2],
) -> Option<Found> {
    let ray = caster.ray(x, y);
    let beam = Beam::new(ray.origin, ray.direction, 1.1 * NUDGES_RADIANS[0]);
    let Some(triangle) = beam.first(tree, ray.near, RIVAL)? else {
        return Some(Found::of(caster.radiance(&ray, None, bias), false));
    };
    let mesh = &caster.scene().mesh;
    let corners = mesh.corners(&mesh.triangles[triangle as usize]).map(|corner| corner.as_dvec3());
    let meet = |ray: Ray<f64>| {
        let (t, weights) = moller_trumbore(&ray, corners, tree.culling())?;
        Some((ray, Hit { t, weights, triangle }))
    };
    let (ray, hit) = meet(ray)?;
    if caster.grazing(&ray, &hit, bias, OFF_PLANE).is_some() {
        return None;
    }
    let mut nudged = [(ray, hit); 4 * NUDGES_RADIANS.len()];
    for (place, [x, y]) in nudged.iter_mut().zip(nudges(frame, [x, y])) {
        *place = meet(caster.ray(x, y))?;
    }
    let point = |(ray, hit): &(Ray<f64>, Hit<f64>)| ray.origin + ray.direction * hit.t;
    let centre = point(&(ray, hit));
    let spread = nudged.iter().map(|other| point(other).distance(centre)).fold(0.0, f64::max);
    let shadows = Shadows::new(caster.scene(), tree, triangle, centre, 1.01 * spread, bias);
    let radiance = |(ray, hit): &(Ray<f64>, Hit<f64>)| {
        let radiance = caster.shaded(ray, Some(hit), &|sight| shadows.reaches(sight.light));
        (!shadows.unsure.get()).then_some(radiance)
    };
    let mut sample = Found::of(radiance(&(ray, hit))?, true);
    for other in &nudged {
        sample.consider(radiance(other)?);
    }
    Some(sample)
}

/// Which lights reach all points near one, found out when first asked for.
struct Shadows<'a> {
    scene: &'a Scene,
    tree: &'a Tree,
    triangle: u32,
    point: DVec3,
    spread: f64,
    bias: f64,
    known: RefCell<Vec<Option<bool>>>,
    unsure: Cell<bool>,
}

impl<'a> Shadows<'a> {
    fn new(scene: &'a Scene, tree: &'a Tree, triangle: u32, point: DVec3, spread: f64, bias: f64) -> Self {
        let known = RefCell::new(vec![None; scene.lights.len()]);
        Self { scene, tree, triangle, point, spread, bias, known, unsure: Cell::new(false) }
    }

    fn reaches(&self, light: usize) -> bool {
        if self.unsure.get() {
            return false;
        }
        let known = self.known.borrow()[light];
        known.unwrap_or_else(|| {
            let found = self.find(light);
            self.unsure.set(found.is_none());
            self.known.borrow_mut()[light] = found;
            found.unwrap_or(false)
        })
    }

    /// Looks from the light, where all shadow rays meet.
    fn find(&self, light: usize) -> Option<bool> {
        let position = self.scene.lights[light].position.as_dvec3();
        let off = self.point - position;
        let distance = off.length();
        let at_light = 2.0 * AT_LIGHT * distance.max(position.length());
        let [least, most] =
            [distance - self.spread - 2.0 * self.bias, distance + self.spread - 0.5 * self.bias];
        if least <= 4.0 * at_light || self.spread > 0.01 * distance {
            return None;
        }
        let beam = Beam::new(position, off / distance, 1.1 * self.spread / distance);
        let stopped =
            beam.is_stopped_on_the_way_here(self.tree, self.triangle, [at_light, least], [-at_light, most])?;
        Some(!stopped)
    }
}

impl Found {
    fn of(radiance: DVec3, hit: bool) -> Self {
        Self { radiance, hit, turns: false, change: 0.0, range: [radiance; 2] }
    }

    /// Takes another answer to nearly the same question into account.
    fn consider(&mut self, other: DVec3) {
        self.change = self.change.max((other - self.radiance).abs().max_element());
        self.range = [self.range[0].min(other), self.range[1].max(other)];
    }

    /// Adds another sample of the same pixel; hits are those of the last, as a caster's are.
    pub fn add(&mut self, other: &Self) {
        self.radiance += other.radiance;
        (self.hit, self.turns) = (other.hit, other.turns);
        self.change += other.change;
        self.range = [self.range[0] + other.range[0], self.range[1] + other.range[1]];
    }

    /// Makes the sum of several samples their mean.
    pub fn divide(&mut self, count: f64) {
        self.radiance /= count;
        self.change /= count;
        self.range = self.range.map(|end| end / count);
    }
}

/// The pixel coordinates small angles to the right, left, below and above.
fn nudges(frame: &PixelFrame, [x, y]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let towards = frame.direction(x, y);
    // A step of one pixel turns the ray by about |step x towards| / |towards|^2.
    let per_radian = |step: DVec3| towards.length_squared() / step.cross(towards).length();
    let (across, down) = (per_radian(frame.step_x), per_radian(frame.step_y));
    NUDGES_RADIANS.into_iter().flat_map(move |radians| {
        let (dx, dy) = (radians * across, radians * down);
        [[x + dx, y], [x - dx, y], [x, y + dy], [x, y - dy]]
    })
}

/// Whether a change is too small to matter beside a pixel's own brightness, or beside `floor` where it is darker.
pub fn is_certain(sample: &Found, floor: f64) -> bool {
    let brightness = sample.radiance.abs().max_element();
    sample.radiance.is_finite() && sample.change < RELATIVE_LIMIT * brightness.max(floor)
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::super::traverse::Exhaustive;
    use super::*;
    use crate::strategy::Culling;
    use glam::vec3;

    /// How many pixels of a hundred are found quickly, each of which is what the plain caster makes of it.
    fn quickly(scene: &Scene, culling: Culling) -> usize {
        let size = [80, 50];
        let tree = Tree::new(&scene.mesh, culling);
        let caster = Caster::new(scene, size, Exhaustive::new(&scene.mesh, culling));
        let frame = scene.camera.pixel_frame(size[0], size[1]);
        let bias = f64::from(scene.shadow_bias);
        let mut quick = 0;
        for (y, x) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (y, x))) {
            let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            let Some(found) = quick_sample(&caster, &tree, &frame, bias, centre) else { continue };
            quick += 1;
            let plain = sample(&caster, &frame, bias, centre);
            assert_eq!(found, plain, "{} at ({x}, {y})", scene.name);
        }
        100 * quick / (size[0] * size[1]) as usize
    }

    #[test]
    fn what_is_found_quickly_is_what_the_plain_caster_finds() {
        for scene in [
            fixtures::single_triangle(),
            fixtures::figure_4(),
            fixtures::pyramid_upper(),
            fixtures::pyramid_lower(),
            fixtures::sphere(12),
            fixtures::random(300, 1),
        ] {
            for culling in [Culling::None, Culling::Back] {
                let percent = quickly(&scene, culling);
                assert!(percent >= 50, "{}: {percent} of 100", scene.name);
            }
        }
    }

    #[test]
    fn neither_near_planes_nor_lights_on_surfaces_nor_coincident_ones_mislead_it() {
        let mut near = fixtures::sphere(12);
        near.camera.z_near = 2.0;
        let mut light_in_ground = fixtures::figure_4();
        light_in_ground.lights[0].position = vec3(0.0, -1.0, -2.0);
        let mut light_in_triangle = fixtures::figure_4();
        let [a, b, c] = light_in_triangle.mesh.corners(&light_in_triangle.mesh.triangles[0]);
        light_in_triangle.lights[0].position = (a + b + c) / 3.0;
        let mut twice = fixtures::figure_4();
        twice.mesh.append(fixtures::figure_4().mesh);
        for scene in [near, light_in_ground, light_in_triangle, twice] {
            for culling in [Culling::None, Culling::Back] {
                quickly(&scene, culling);
            }
        }
    }
}
