//! The ray caster: casts a primary ray per pixel, finds the ray's closest hit, and shades only this hit.

use super::cutouts::Solid;
use super::intersect::Hit;
use super::leaning::relative_error;
use super::ray::{Frame, Ray};
use super::real::{Real, Vector};
use super::shade::{Reaches, Sight, base_colour, shade, shade_at, sights, surface_at};
use super::soft::{Seen, radiance_of_sky};
use super::traverse::{Exhaustive, Finder};
use crate::image::Radiance;
use crate::scene::{Sample, Scene, Sky};
use crate::strategy::Culling;
use rayon::prelude::*;

/// A bound of the rounding error of a distance from a light, relative to this distance: twice the error of four
/// roundings (of at most 6e-8 each), rounded up.
const AT_DISTANCE: f32 = 5e-7;

/// A triangle that light grazes.
#[derive(Clone, Copy, Debug)]
pub struct Grazing<R: Real> {
    normal: R::Vector,
    rounding: R,
    bias: R,
}

impl<R: Real> Grazing<R> {
    /// Returns whether the shadow ray to a light starts so close to the triangle's plane that rounding may move the
    /// start to the other side. If a device casts the ray from the light, it rounds numbers that are as large as the
    /// light's distance.
    fn is_of(&self, sight: &Sight<R>, is_light: bool) -> bool {
        let at_light = if is_light { R::from(AT_DISTANCE) * sight.distance } else { R::ZERO };
        (self.bias * sight.w_i.dot(self.normal)).abs() < self.rounding.max(at_light)
    }

    /// Returns whether a height above the triangle may be due to rounding.
    fn is_less(&self, height: R) -> bool {
        height.abs() < self.rounding
    }
}

/// A scene to be cast with one type of numbers, at one image size.
pub struct Caster<'a, R: Real> {
    scene: &'a Scene,
    finder: Solid<'a, R>,
    frame: Frame<R>,
}

impl<'a, R: Real> Caster<'a, R> {
    /// Makes a caster of `scene` at `[width, height]` pixels, which searches for hits with `finder`.
    pub fn new(scene: &'a Scene, [width, height]: [u32; 2], finder: impl Finder<R> + 'a) -> Self {
        let frame = Frame::new(&scene.camera.pixel_frame(width, height));
        Self { scene, finder: Solid::new(finder, &scene.mesh.textures), frame }
    }

    /// Returns two casters. In the first, rounding makes every triangle larger and its holes smaller. In the second,
    /// rounding makes every triangle smaller and its holes larger.
    pub fn leaning(&self) -> [Self; 2] {
        self.finder.leaning().map(|finder| Self { finder, ..*self })
    }

    /// Returns the ray through pixel coordinates (x, y), and the nearest triangle that it hits.
    pub fn look(&self, x: R, y: R) -> (Ray<R>, Option<Hit<R>>) {
        let ray = self.ray(x, y);
        (ray, self.finder.closest(&ray))
    }

    /// Returns the ray through pixel coordinates (x, y).
    pub fn ray(&self, x: R, y: R) -> Ray<R> {
        self.frame.primary(x, y)
    }

    /// Returns the scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Returns the ray's hits on other triangles that are at most slightly farther away than `hit`. The allowed
    /// difference is the fraction `part` of `hit`'s distance, or the rounding error of this distance if that is larger.
    pub fn rivals(&self, ray: &Ray<R>, hit: &Hit<R>, part: R) -> Vec<Hit<R>> {
        let corners = self.scene.mesh.corners(&self.scene.mesh.triangles[hit.triangle as usize]);
        let error = relative_error(ray, corners.map(R::Vector::of), hit.t);
        let reach = hit.t * (R::ONE + part.max(error));
        let mut rivals = Vec::new();
        self.finder.visit(&Ray { far: reach, ..*ray }, &mut |other| {
            if other.triangle != hit.triangle {
                rivals.push(other);
            }
            reach
        });
        rivals
    }

    /// Returns the radiance along a ray with this hit. `seen` contains the lights as the sample sees them.
    pub fn radiance(&self, seen: &Seen<'_>, ray: &Ray<R>, hit: Option<&Hit<R>>, bias: R) -> R::Vector {
        self.shaded(seen, ray, hit, &|sight| self.reaches(sight, bias))
    }

    /// Returns the radiance like [`Self::radiance`], with another test of whether a light is visible.
    pub fn shaded(
        &self,
        seen: &Seen<'_>,
        ray: &Ray<R>,
        hit: Option<&Hit<R>>,
        reaches: Reaches<'_, R>,
    ) -> R::Vector {
        match hit {
            Some(hit) => shade(self.scene, seen, (ray, self.frame.cone_width(ray, hit.t)), hit, reaches),
            None => self.background(ray.direction),
        }
    }

    /// Returns the diffuse reflectance at a primary ray's hit.
    pub fn base_colour(&self, ray: &Ray<R>, hit: &Hit<R>) -> R::Vector {
        base_colour(self.scene, hit, ray.direction, self.frame.cone_width(ray, hit.t))
    }

    /// Returns the radiance of a ray that hits nothing.
    pub fn background(&self, direction: R::Vector) -> R::Vector {
        match self.sky_behind() {
            Some(sky) => radiance_of_sky::<R>(sky, direction),
            None => R::Vector::of(self.scene.background),
        }
    }

    /// Returns the sky whose picture is behind everything, if there is one.
    pub fn sky_behind(&self) -> Option<&'a Sky> {
        let sky = self.scene.sky.as_ref()?;
        sky.picture.as_ref().filter(|picture| picture.is_seen).map(|_| sky)
    }

    /// Returns whether nothing lies between the light and a point on the shadow ray, at the distance `bias` from the
    /// hit. A light that is nearer to the hit than `bias` counts as inside the surface, and is not visible.
    pub fn reaches(&self, sight: &Sight<R>, bias: R) -> bool {
        self.reaches_within(sight, bias, sight.distance)
    }

    /// Tests visibility like [`Self::reaches`], but ignores occluders beyond a distance.
    pub fn reaches_within(&self, sight: &Sight<R>, bias: R, distance: R) -> bool {
        let Sight { point, w_i, .. } = *sight;
        let far = distance - bias;
        let is_sky = !self.is_light(sight);
        let (origin, near) = (point + w_i * bias, R::ZERO);
        let shadow = Ray { origin, direction: w_i, near, far, to_light: !is_sky, is_shadow: true };
        // A light that is nearer than the bias counts as hidden. A sky whose reach is shorter than the bias counts as
        // visible.
        if far > R::ZERO { !self.finder.any(&shadow) } else { is_sky }
    }

    /// Returns true for a light, false for the sky.
    fn is_light(&self, sight: &Sight<R>) -> bool {
        sight.light < self.scene.lights.len()
    }

    /// Returns by how much rounding may move a hit off its triangle's plane. This is the fraction `part` of the
    /// largest of three lengths: the hit's distance from the eye, its distance from the scene's origin, and its
    /// distance from the farthest corner of its triangle. A ray-triangle test subtracts numbers that are as large as
    /// this length. The normal of a thin triangle is a small difference of large products; for such a triangle, the
    /// result is divided by four times the sine of the angle between the edges.
    pub fn off_plane(&self, ray: &Ray<R>, hit: &Hit<R>, part: R) -> R::Vector {
        let triangle = &self.scene.mesh.triangles[hit.triangle as usize];
        let [a, b, c] = self.scene.mesh.corners(triangle).map(R::Vector::of);
        let [point, _] = surface_at(self.scene, ray, hit);
        let lengths = [point, a - point, b - point, c - point].map(|vector| vector.dot(vector).sqrt());
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let doubled_area = normal.dot(normal).sqrt();
        let thinness = (e1.dot(e1) * e2.dot(e2)).sqrt() / doubled_area;
        let thinness = if doubled_area > R::ZERO { (R::from(0.25) * thinness).max(R::ONE) } else { R::ONE };
        normal.normalize_or_zero() * (lengths.into_iter().fold(hit.t, R::max) * part * thinness)
    }

    /// Returns the hit's triangle if a light is very low above the triangle. Rounding moves the hit off the
    /// triangle's plane ([`Self::off_plane`]), and so decides what the shadow ray to this light hits first.
    pub fn grazing(
        &self,
        seen: &Seen<'_>,
        ray: &Ray<R>,
        hit: &Hit<R>,
        bias: R,
        part: R,
    ) -> Option<Grazing<R>> {
        let off = self.off_plane(ray, hit, part);
        let [point, shading_normal] = surface_at(self.scene, ray, hit);
        let grazing = Grazing { normal: off.normalize_or_zero(), rounding: off.dot(off).sqrt(), bias };
        let is_grazed = |sight: Sight<R>| grazing.is_of(&sight, self.is_light(&sight));
        sights::<R>(seen, point, shading_normal).any(is_grazed).then_some(grazing)
    }

    /// Returns the possible values of the radiance at a hit that light grazes. The values are computed with the point
    /// at which the hit is lit, with points above and below it, and with shadow rays that start on the wrong side of
    /// the triangle. (The hit itself is not moved, because smooth shadows would lift a hit below the plane back to
    /// the plane.) If a light lies in the plane, its rays run along the surface. The values are then computed both
    /// with and without this light.
    pub fn grazed(&self, seen: &Seen<'_>, ray: &Ray<R>, hit: &Hit<R>, grazing: Grazing<R>) -> Vec<R::Vector> {
        let Grazing { normal, rounding, bias } = grazing;
        let usual = |sight: &Sight<R>| self.reaches(sight, bias);
        let wrong_side = |sight: &Sight<R>| {
            let is_grazed = grazing.is_of(sight, self.is_light(sight));
            self.reaches(sight, if is_grazed { R::ZERO - bias } else { bias })
        };
        // The factor 0.5 also allows for a hit that rounding has moved.
        let in_plane =
            |sight: &Sight<R>| grazing.is_less(R::from(0.5) * sight.w_i.dot(normal) * sight.distance);
        let with = |sight: &Sight<R>| in_plane(sight) || usual(sight);
        let without = |sight: &Sight<R>| !in_plane(sight) && usual(sight);
        let answers: [Reaches<'_, R>; 4] = [&usual, &wrong_side, &with, &without];
        let places = [R::ZERO, rounding, R::ZERO - rounding];
        let [point, shading_normal] = surface_at(self.scene, ray, hit);
        let width = self.frame.cone_width(ray, hit.t);
        let lit = |off: R, reaches: Reaches<'_, R>| {
            let surface = [point + normal * off, shading_normal];
            shade_at(self.scene, seen, (ray, width), (hit, surface), reaches)
        };
        places.into_iter().flat_map(|off| answers.map(|reaches| lit(off, reaches))).collect()
    }

    fn row(&self, y: usize, row: &mut [[f32; 3]]) {
        let (half, bias) = (R::from(0.5), R::from(self.scene.shadow_bias));
        for (x, pixel) in row.iter_mut().enumerate() {
            let (ray, hit) = self.look(R::of(x as f64) + half, R::of(y as f64) + half);
            let seen = Seen::of(self.scene, Sample::CENTRE, [x as u32, y as u32]);
            *pixel = self.radiance(&seen, &ray, hit.as_ref(), bias).to_f32();
        }
    }
}

/// Casts the serial baseline in single precision, with one thread, without a tree and without culling. Only
/// the nearest hit of each primary ray is shaded. `size` is width and height in pixels.
pub fn cast_serial_f32(scene: &Scene, size: [u32; 2]) -> Radiance {
    cast_serial::<f32>(scene, size)
}

/// Casts like [`cast_serial_f32`], in double precision.
pub fn cast_serial_f64(scene: &Scene, size: [u32; 2]) -> Radiance {
    cast_serial::<f64>(scene, size)
}

/// Casts like [`cast_serial_f32`], on all cores, one row of pixels at a time.
pub fn cast_parallel_f32(scene: &Scene, size: [u32; 2]) -> Radiance {
    let caster = exhaustive::<f32>(scene, size);
    let mut image = Radiance::new(size[0], size[1]);
    image.pixels.par_chunks_mut(size[0].max(1) as usize).enumerate().for_each(|(y, row)| caster.row(y, row));
    image
}

fn cast_serial<R: Real>(scene: &Scene, size: [u32; 2]) -> Radiance {
    let caster = exhaustive::<R>(scene, size);
    let mut image = Radiance::new(size[0], size[1]);
    image.pixels.chunks_mut(size[0].max(1) as usize).enumerate().for_each(|(y, row)| caster.row(y, row));
    image
}

fn exhaustive<R: Real>(scene: &Scene, size: [u32; 2]) -> Caster<'_, R> {
    Caster::new(scene, size, Exhaustive::new(&scene.mesh, Culling::None))
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::*;
    use crate::reference::reference;
    use crate::scene::Display;
    use crate::verify::verify;

    #[test]
    fn the_baselines_equal_the_reference() {
        for scene in [fixtures::figure_4(), fixtures::pyramid_upper(), fixtures::sphere(8)] {
            let size = [80, 50];
            let reference = reference(&scene, size, Culling::None);
            assert_eq!(cast_serial_f64(&scene, size), reference.radiance, "{}", scene.name);
            let serial = cast_serial_f32(&scene, size);
            assert_eq!(cast_parallel_f32(&scene, size), serial, "{}", scene.name);
            let verdict = verify(&serial, None, &reference, Display::default());
            assert!(verdict.ok, "{}: {verdict:?}", scene.name);
        }
    }

    #[test]
    fn a_surface_is_a_rival_that_lies_no_farther_behind_the_hit_than_asked_for() {
        for (behind, count) in [(0.0, 1), (5e-7, 1), (1e-5, 0)] {
            let mut scene = fixtures::single_triangle();
            let mut other = (*fixtures::single_triangle().mesh).clone();
            // Every corner moves straight away from the eye, so that a hit's distance along its ray and its depth
            // grow by the same factor.
            other.positions.iter_mut().for_each(|position| *position *= 1.0 + behind);
            scene.mesh_mut().append(other);
            let caster = exhaustive::<f64>(&scene, [80, 50]);
            let (ray, hit) = caster.look(40.5, 25.5);
            let hit = hit.expect("the triangle");
            assert_eq!((hit.triangle, caster.rivals(&ray, &hit, 1e-6).len()), (0, count), "{behind}");
        }
    }

    #[test]
    fn an_image_without_pixels_is_empty() {
        assert_eq!(cast_parallel_f32(&fixtures::figure_4(), [0, 3]).pixels.len(), 0);
    }

    #[test]
    fn a_shadow_ray_grazes_where_rounding_hides_on_which_side_it_starts() {
        use glam::DVec3;
        let grazing = Grazing::<f64> { normal: DVec3::Y, rounding: 1e-6, bias: 1e-3 };
        // The ray starts a thousandth of `height` above the triangle's plane.
        let is_grazing = |height: f64, distance: f64, is_light: bool| {
            let w_i = DVec3::new((1.0 - height * height).sqrt(), height, 0.0);
            grazing.is_of(&Sight { light: 0, point: DVec3::ZERO, w_i, distance }, is_light)
        };
        for sign in [1.0, -1.0] {
            assert!(is_grazing(sign * 1e-4, 1.0, false) && !is_grazing(sign * 1e-2, 1.0, false), "{sign}");
            // From a light 100 units away, numbers are rounded by up to 5e-5.
            assert!(is_grazing(sign * 1e-2, 100.0, true) && !is_grazing(sign * 1e-2, 1.0, true), "{sign}");
            assert!(!is_grazing(sign * 1e-2, 100.0, false), "the sky does not round more: {sign}");
            assert!(grazing.is_less(sign * 5e-7) && !grazing.is_less(sign * 2e-6), "{sign}");
        }
    }
}
