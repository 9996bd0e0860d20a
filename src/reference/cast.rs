//! The ray caster: a primary ray per pixel, the closest hit, then shading once.

use super::intersect::Hit;
use super::ray::{Frame, Ray};
use super::real::{Real, Vector};
use super::shade::{shade, towards};
use super::traverse::{Exhaustive, Finder};
use crate::image::Radiance;
use crate::scene::Scene;
use crate::strategy::Culling;
use rayon::prelude::*;

/// A scene ready to be cast in one arithmetic, at one image size.
pub struct Caster<'a, R: Real> {
    scene: &'a Scene,
    finder: Box<dyn Finder<R> + 'a>,
    frame: Frame<R>,
}

impl<'a, R: Real> Caster<'a, R> {
    /// Casts `scene` at `[width, height]` pixels with what `finder` finds.
    pub fn new(scene: &'a Scene, [width, height]: [u32; 2], finder: impl Finder<R> + 'a) -> Self {
        let frame = Frame::new(&scene.camera.pixel_frame(width, height));
        Self { scene, finder: Box::new(finder), frame }
    }

    /// The ray through pixel coordinates (x, y), and the nearest triangle it meets.
    pub fn look(&self, x: R, y: R) -> (Ray<R>, Option<Hit<R>>) {
        let ray = self.frame.primary(x, y);
        (ray, self.finder.closest(&ray))
    }

    /// Every other triangle at `hit`'s distance or behind it by at most a `part` of it.
    pub fn rivals(&self, ray: &Ray<R>, hit: &Hit<R>, part: R) -> Vec<Hit<R>> {
        let reach = hit.t * (R::ONE + part);
        let mut rivals = Vec::new();
        self.finder.visit(&Ray { far: reach, ..*ray }, &mut |other| {
            if other.triangle != hit.triangle {
                rivals.push(other);
            }
            reach
        });
        rivals
    }

    /// The radiance along a ray that was looked along.
    pub fn radiance(&self, ray: &Ray<R>, hit: Option<&Hit<R>>, bias: R) -> R::Vector {
        match hit {
            Some(hit) => shade(self.scene, self.finder.as_ref(), ray, hit, &|_| bias),
            None => R::Vector::of(self.scene.background),
        }
    }

    /// What the radiance may be where light grazes the hit's triangle, so that rounding decides what shadow rays meet first:
    /// with their starts on the wrong side of it, and with the hit above and below it. Rounding moves a hit by a `part` of
    /// its distance, or of how far it is from the scene's origin if that is more. Empty where all lights stand too high.
    pub fn grazed(&self, ray: &Ray<R>, hit: &Hit<R>, bias: R, part: R) -> Vec<R::Vector> {
        let triangle = &self.scene.mesh.triangles[hit.triangle as usize];
        let [a, b, c] = self.scene.mesh.corners(triangle).map(R::Vector::of);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let point = ray.origin + ray.direction * hit.t;
        let rounding = hit.t.max(point.dot(point).sqrt()) * part;
        let grazes = |w_i: R::Vector| {
            let height = bias * w_i.dot(normal);
            height.max(R::ZERO - height) < rounding
        };
        if !self.scene.lights.iter().any(|light| grazes(towards::<R>(light, point).0)) {
            return Vec::new();
        }
        let shade =
            |ray, bias: &dyn Fn(R::Vector) -> R| shade(self.scene, self.finder.as_ref(), ray, hit, bias);
        let off_plane = |off| Ray { origin: ray.origin + normal * off, ..*ray };
        vec![
            shade(ray, &|w_i| if grazes(w_i) { R::ZERO - bias } else { bias }),
            shade(&off_plane(rounding), &|_| bias),
            shade(&off_plane(R::ZERO - rounding), &|_| bias),
        ]
    }

    fn row(&self, y: usize, row: &mut [[f32; 3]]) {
        let (half, bias) = (R::from(0.5), R::from(self.scene.shadow_bias));
        for (x, pixel) in row.iter_mut().enumerate() {
            let (ray, hit) = self.look(R::of(x as f64) + half, R::of(y as f64) + half);
            *pixel = self.radiance(&ray, hit.as_ref(), bias).to_f32();
        }
    }
}

/// The serial baseline in single precision: one thread, every ray against every triangle,
/// both faces, shaded once. `size` is width and height in pixels.
pub fn cast_serial_f32(scene: &Scene, size: [u32; 2]) -> Radiance {
    cast_serial::<f32>(scene, size)
}

/// [`cast_serial_f32`] in double precision.
pub fn cast_serial_f64(scene: &Scene, size: [u32; 2]) -> Radiance {
    cast_serial::<f64>(scene, size)
}

/// [`cast_serial_f32`] on all cores, a row of pixels at a time.
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
    fn an_image_without_pixels_is_empty() {
        assert_eq!(cast_parallel_f32(&fixtures::figure_4(), [0, 3]).pixels.len(), 0);
    }
}
