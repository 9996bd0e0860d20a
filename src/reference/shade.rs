//! How a hit is shaded: the twin of `cl/cast/shade`. Hughes et al., section 15.4:
//! direct light only, no ambient, no emission.

use super::intersect::Hit;
use super::ray::Ray;
use super::real::{Real, Vector};
use super::texture::texture_colour;
use crate::scene::{Light, Material, MaterialKind, Scene};

/// A light as a point of a surface sees it.
#[derive(Clone, Copy, Debug)]
pub struct Sight<R: Real> {
    /// Its place in the scene.
    pub light: usize,
    /// From where it is seen.
    pub point: R::Vector,
    /// The unit vector to it.
    pub w_i: R::Vector,
    /// How far it is.
    pub distance: R,
}

/// What says whether nothing is in a light's way.
pub type Reaches<'a, R> = &'a dyn Fn(&Sight<R>) -> bool;

/// The radiance that leaves a hit towards the ray's origin; `reaches` says of lights before the surface whether nothing is
/// in their way.
pub fn shade<R: Real>(scene: &Scene, ray: &Ray<R>, hit: &Hit<R>, reaches: Reaches<'_, R>) -> R::Vector {
    let triangle = &scene.mesh.triangles[hit.triangle as usize];
    let material = scene.mesh.material(triangle);
    let own = R::Vector::of(material.lambertian);
    let colour = texture_colour::<R>(&scene.mesh, hit.triangle, hit.weights);
    let lambertian = colour.map_or(own, |colour| own * colour);
    let [n0, n1, n2] = scene.mesh.corner_normals(triangle).map(R::Vector::of);
    let [w0, w1, w2] = hit.weights;
    let normal = (n0 * w0 + n1 * w1 + n2 * w2).normalize_or_zero();
    let point = ray.origin + ray.direction * hit.t;
    let w_o = -ray.direction;
    scene.lights.iter().enumerate().fold(R::Vector::ZERO, |sum, (number, light)| {
        let (w_i, distance) = towards::<R>(light, point);
        let cosine = w_i.dot(normal);
        if cosine <= R::ZERO || !reaches(&Sight { light: number, point, w_i, distance }) {
            return sum;
        }
        let falloff = R::from(4.0) * R::PI * distance * distance;
        let irradiance = R::Vector::of(light.power) * (cosine / falloff);
        sum + irradiance * reflectance::<R>((material, lambertian), w_i, w_o, normal)
    })
}

/// The unit direction from a point to a light, and how far it is.
pub(super) fn towards<R: Real>(light: &Light, point: R::Vector) -> (R::Vector, R) {
    let off = R::Vector::of(light.position) - point;
    (off.normalize_or_zero(), off.dot(off).sqrt())
}

/// How much of the light from `w_i` a surface of this k_L sends towards `w_o`, a steradian.
fn reflectance<R: Real>(
    (material, lambertian): (&Material, R::Vector),
    w_i: R::Vector,
    w_o: R::Vector,
    normal: R::Vector,
) -> R::Vector {
    let lambertian = lambertian * (R::ONE / R::PI);
    match material.kind {
        MaterialKind::Lambertian => lambertian,
        MaterialKind::BlinnPhong => {
            let s = R::from(material.shininess);
            let w_h = (w_i + w_o).normalize_or_zero();
            let highlight = normal.dot(w_h).max(R::ZERO).powf(s);
            let lobe = (s + R::from(8.0)) * highlight / (R::from(8.0) * R::PI);
            lambertian + R::Vector::of(material.glossy) * lobe
        }
    }
}
