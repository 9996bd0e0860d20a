//! Shades a hit; the counterpart for devices is `cl/cast/shade`. Following Hughes et al., section 15.4, surfaces
//! reflect only direct light. The radiance that a surface emits is added to the reflected light; emitted light
//! does not light other surfaces. A sky usually contributes the light from one direction per sample; a shiny
//! surface also mirrors a sky with a picture.

use super::intersect::Hit;
use super::ray::Ray;
use super::real::{Real, Vector};
use super::soft::{Seen, mean_of_sky, radiance_of_sky, way_to_sky};
use super::texture::{corner_colour, emission_colour, texture_colour};
use crate::scene::{Light, Material, MaterialKind, Scene};

/// A light, or the sky, as seen from a point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Sight<R: Real> {
    /// The light's index in the scene. The sky's index is the number of lights.
    pub light: usize,
    /// The point from which the light is seen.
    pub point: R::Vector,
    /// The unit vector towards the light.
    pub w_i: R::Vector,
    /// The light's distance; for the sky, the sky's reach.
    pub distance: R,
}

/// Returns the lights, then the sky, as seen from a point of a surface with this normal.
pub fn sights<'a, R: Real>(
    seen: &'a Seen<'_>,
    point: R::Vector,
    normal: R::Vector,
) -> impl Iterator<Item = Sight<R>> + 'a {
    let lights = seen.lights.iter().enumerate().map(move |(number, light)| {
        let off = R::Vector::of(light.position) - point;
        let distance = off.dot(off).sqrt();
        Sight { light: number, point, w_i: off.normalize_or_zero(), distance }
    });
    let sky = seen.sky.iter().map(move |(sky, way)| {
        let w_i = way_to_sky::<R>(*way, normal);
        Sight { light: seen.lights.len(), point, w_i, distance: R::from(sky.reach) }
    });
    lights.chain(sky)
}

/// Returns the point at which a hit is lit, and the unit normal there. The point is the hit itself or, with smooth
/// shadows, a point above it ([`smooth_point`]).
pub fn surface_at<R: Real>(scene: &Scene, ray: &Ray<R>, hit: &Hit<R>) -> [R::Vector; 2] {
    let triangle = &scene.mesh.triangles[hit.triangle as usize];
    let normals = scene.mesh.corner_normals(triangle).map(R::Vector::of);
    let ([n0, n1, n2], [w0, w1, w2]) = (normals, hit.weights);
    let mut point = ray.origin + ray.direction * hit.t;
    if scene.smooth_shadows {
        let corners = scene.mesh.corners(triangle).map(R::Vector::of);
        point = smooth_point(point, hit.weights, corners, normals);
    }
    [point, (n0 * w0 + n1 * w1 + n2 * w2).normalize_or_zero()]
}

/// Moves a point of a triangle onto a smooth surface, so that the facets of a coarse mesh do not shadow each other in
/// steps. `weights` are the point's barycentric weights. cl/common/smooth_shadows.cl explains the method.
pub fn smooth_point<R: Real>(
    point: R::Vector,
    weights: [R; 3],
    corners: [R::Vector; 3],
    normals: [R::Vector; 3],
) -> R::Vector {
    let of_corners = weights.into_iter().zip(corners).zip(normals);
    of_corners.fold(point, |moved, ((weight, corner), normal)| {
        let below = (corner - point).dot(normal).max(R::ZERO);
        moved + normal * (weight * below / normal.dot(normal))
    })
}

/// A test of whether a light is visible.
pub type Reaches<'a, R> = &'a dyn Fn(&Sight<R>) -> bool;

/// Returns a hit's base colour: its diffuse reflectance k_L. This is the material's k_L times the colours of the
/// triangle's corners and of its texture. `width` is the width of the pixel's cone at the hit.
pub fn base_colour<R: Real>(scene: &Scene, hit: &Hit<R>, direction: R::Vector, width: R) -> R::Vector {
    let mesh = &scene.mesh;
    let material = mesh.material(&mesh.triangles[hit.triangle as usize]);
    let own = R::Vector::of(material.lambertian) * corner_colour(mesh, hit);
    texture_colour(mesh, hit, direction, width).map_or(own, |colour| own * colour)
}

/// Returns the radiance that the surface emits at a hit.
fn emitted<R: Real>(scene: &Scene, hit: &Hit<R>, direction: R::Vector, width: R) -> R::Vector {
    let mesh = &scene.mesh;
    let own = R::Vector::of(mesh.material(&mesh.triangles[hit.triangle as usize]).emitted);
    emission_colour(mesh, hit, direction, width).map_or(own, |colour| own * colour)
}

/// Returns the radiance that leaves a hit towards the ray's origin; `width` is the width of the
/// pixel's cone at the hit. `reaches` tests whether a light in front of the surface is visible.
pub fn shade<R: Real>(
    scene: &Scene,
    seen: &Seen<'_>,
    (ray, width): (&Ray<R>, R),
    hit: &Hit<R>,
    reaches: Reaches<'_, R>,
) -> R::Vector {
    shade_at(scene, seen, (ray, width), (hit, surface_at(scene, ray, hit)), reaches)
}

/// Returns the radiance like [`shade`]. The caller passes the point at which the hit is lit, and the unit normal there.
/// Without a sky, the radiance is
/// L_o = emitted + sum over visible lights of share power / (4 pi r^2) f(w_i, w_o) (n . w_i), after Hughes et al.,
/// chapter 15. The share is 1 for a point light (see [`share_towards`]), and f is the reflectance.
pub fn shade_at<R: Real>(
    scene: &Scene,
    seen: &Seen<'_>,
    (ray, width): (&Ray<R>, R),
    (hit, [point, normal]): (&Hit<R>, [R::Vector; 2]),
    reaches: Reaches<'_, R>,
) -> R::Vector {
    let triangle = &scene.mesh.triangles[hit.triangle as usize];
    let material = scene.mesh.material(triangle);
    let lambertian = base_colour(scene, hit, ray.direction, width);
    let w_o = -ray.direction;
    let unlit = emitted(scene, hit, ray.direction, width) + mirrored_sky::<R>(seen, material, w_o, normal);
    sights::<R>(seen, point, normal).fold(unlit, |sum, sight| {
        let Sight { light, w_i, distance, .. } = sight;
        let cosine = w_i.dot(normal);
        let share = seen.lights.get(light).map_or(R::ONE, |light| share_towards::<R>(light, w_i));
        if cosine <= R::ZERO || share <= R::ZERO || !(seen.unoccluded || reaches(&sight)) {
            return sum;
        }
        match (seen.lights.get(light), seen.sky) {
            (Some(light), _) => {
                let falloff = R::from(4.0) * R::PI * distance * distance;
                let irradiance = R::Vector::of(light.power) * (share * cosine / falloff);
                sum + irradiance * reflectance::<R>((material, lambertian), w_i, w_o, normal)
            }
            // The direction is chosen with a probability proportional to its cosine: k_L / pi times the
            // cosine, divided by that probability, is k_L.
            (None, Some((sky, _))) if seen.unoccluded => sum + lambertian * mean_of_sky::<R>(sky, normal),
            (None, Some((sky, _))) => sum + lambertian * radiance_of_sky::<R>(sky, w_i),
            (None, None) => sum,
        }
    })
}

/// Returns how bright a light is from a direction, relative to a point light of the same power. For a point light,
/// the function returns 1. `w_i` is the unit vector towards the light. An area light has the same radiance everywhere
/// on its front, so its light is proportional to the cosine of the angle between the direction and the front's
/// normal. The factor is 4, because the mean of max(cosine, 0) over all directions is 1/4.
pub fn share_towards<R: Real>(light: &Light, w_i: R::Vector) -> R {
    let towards = |front| (R::from(-4.0) * R::Vector::of(front).dot(w_i)).max(R::ZERO);
    light.area.map_or(R::ONE, |area| towards(area.front()))
}

/// Returns the light of the sky's picture that a surface with a highlight reflects to `w_o`, regardless of occluders.
/// The result is an estimate from one half vector w_h, chosen with a probability proportional to the highlight. The
/// half vector w_h has the density (s + 1) / (2 pi) (n . w_h)^s, and w_i has this density divided by 4 w_o . w_h.
/// The highlight k_G (s + 8) / (8 pi) (n . w_h)^s, times n . w_i, divided by the density of w_i, is
/// k_G (s + 8) / (s + 1) (w_o . w_h) (n . w_i). (w_i is w_o mirrored at w_h.)
fn mirrored_sky<R: Real>(
    seen: &Seen<'_>,
    material: &Material,
    w_o: R::Vector,
    normal: R::Vector,
) -> R::Vector {
    let Some((sky, _)) = seen.sky.filter(|(sky, _)| sky.picture.is_some()) else { return R::Vector::ZERO };
    let w_h = seen.half_vector::<R>(normal, material.shininess);
    let to_half = w_o.dot(w_h);
    let w_i = w_h * (R::from(2.0) * to_half) - w_o;
    let cosines = to_half.max(R::ZERO) * w_i.dot(normal).max(R::ZERO);
    let s = R::from(material.shininess);
    let share = cosines * (R::from(8.0) + s) / (R::ONE + s);
    R::Vector::of(material.glossy) * radiance_of_sky::<R>(sky, w_i) * share
}

/// Returns the reflectance of a surface with this k_L, from `w_i` to `w_o`, per steradian. With a highlight, the
/// reflectance is f = k_L / pi + k_G (s + 8) / (8 pi) max(0, n . w_h)^s, where w_h is the unit vector halfway between
/// w_i and w_o (as in cl/common/reflectance.cl). Without a highlight, the reflectance is k_L / pi.
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
