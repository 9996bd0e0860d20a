//! Finds out how small changes alter a pixel, with a few searches in the tree instead of searches for every
//! nudge. If a few searches do not suffice, the result is `None`.

use super::super::cast::Caster;
use super::super::intersect::{Hit, moller_trumbore};
use super::super::leaning::larger_hit;
use super::super::pixel_sample::{PixelSample, Reach};
use super::super::ray::Ray;
use super::super::ray_packet::RayPacket;
use super::super::shade::{Sight, surface_at};
use super::super::shadows::{Points, Shadows};
use super::super::soft::Seen;
use super::super::tree::Tree;
use super::{AT_LIGHT, Asked, NUDGES, OFF_PLANE, RIVAL, moved, nudges, off_plane, slid};
use crate::scene::Scene;
use glam::DVec3;

/// A ray, and the hit of this ray on a triangle.
type RayHit = (Ray<f64>, Hit<f64>);

/// The nudged rays of a pixel, each with the size of its nudge.
type Nudged = [(Reach, Ray<f64>); NUDGES];

/// The hits of a pixel's ray and of its nudged rays on one triangle.
struct Hits {
    triangle: u32,
    /// The hit of the pixel's own ray, which is not nudged.
    centre: RayHit,
    /// The hits of the nudged rays.
    nudged: [(Reach, RayHit); NUDGES],
    /// The hit of the pixel's own ray on the enlarged triangle. [`larger_hit`] enlarges the triangle by the
    /// largest rounding error of a device.
    leaning: RayHit,
}

impl Hits {
    /// Returns the hits of a pixel's ray and of its nudged rays on this triangle. Returns `None` if the
    /// pixel's ray or a nudged ray misses the triangle, or if rounding may make the pixel's ray miss the
    /// triangle.
    fn of(asked: &Asked<'_>, tree: &Tree, (ray, rays): (Ray<f64>, &Nudged), triangle: u32) -> Option<Self> {
        let mesh = &asked.caster.scene().mesh;
        let corners = mesh.corners(&mesh.triangles[triangle as usize]).map(|corner| corner.as_dvec3());
        let hit_of = |ray: Ray<f64>| {
            let (t, weights) = moller_trumbore(&ray, corners, tree.culling())?;
            Some((ray, Hit { t, weights, triangle }))
        };
        let centre = hit_of(ray)?;
        let mut nudged = [(Reach::Wide, centre); NUDGES];
        for (slot, (reach, ray)) in nudged.iter_mut().zip(rays) {
            *slot = (*reach, hit_of(*ray)?);
        }
        let larger =
            larger_hit(&ray, triangle, corners, tree.culling()).filter(|larger| larger.is_certain)?;
        Some(Self { triangle, centre, nudged, leaning: (ray, larger.hit) })
    }

    /// Returns the points of all hits in `self`, as a centre and a largest distance from the centre. The
    /// centre is the hit of the pixel's own ray. The points also include two copies of the centre, moved off
    /// the triangle's plane by the two offsets `offs`, and the two hits of the rays `slid` (see [`slid`]).
    fn points(&self, scene: &Scene, offs: [DVec3; 2], slid: &[RayHit; 2]) -> Points {
        let at = |(ray, hit): &RayHit| surface_at(scene, ray, hit);
        let point = |of: &RayHit| at(of)[0];
        let [centre, normal] = at(&self.centre);
        let others = self.nudged.iter().map(|(_, other)| other).chain([&self.leaning]).chain(slid);
        let spread = others.map(|other| point(other).distance(centre)).fold(0.0, f64::max);
        let spread = offs.iter().map(|off| off.length()).fold(spread, f64::max);
        Points {
            triangle: self.triangle,
            moved_to: self.moved_to(scene, centre),
            centre,
            normal,
            spread: 1.01 * spread,
        }
    }

    /// Returns the triangle's normal on the side of `point`, the point to which smooth shadows move the hit
    /// of the pixel's own ray. Returns `None` if smooth shadows do not move this hit.
    fn moved_to(&self, scene: &Scene, point: DVec3) -> Option<DVec3> {
        let (ray, hit) = &self.centre;
        let off = point - (ray.origin + ray.direction * hit.t);
        let mesh = &scene.mesh;
        let [a, b, c] = mesh.corners(&mesh.triangles[self.triangle as usize]).map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        (off != DVec3::ZERO).then(|| normal * normal.dot(off).signum())
    }
}

/// Computes the result of [`super::sample`] faster if all nudged rays (rays that differ slightly from the
/// pixel's ray) hit the same triangle first, or if all of them hit nothing. In this case, one search of the
/// tree finds the hits of all nudged rays. For each light, one more search finds out whether all shadow rays
/// between the light and the hits are blocked, or none of them. If this is uncertain for a light, shadow rays
/// to this light are cast. Returns `None` if it is uncertain what the rays hit, or if light grazes the
/// triangle.
pub fn quick_sample(asked: &Asked<'_>, tree: &Tree) -> Option<PixelSample> {
    let Asked { caster, bias, seen, centre: [x, y], .. } = asked;
    let (bias, ray) = (*bias, caster.ray(*x, *y));
    let nudged = nudged_rays(asked, ray);
    let turns = nudged.iter().map(|(_, other)| other.direction.distance(ray.direction));
    let packet = RayPacket::new(ray.origin, ray.direction, 1.1 * turns.fold(0.0, f64::max));
    let Some(triangle) = packet.first(tree, ray.near, RIVAL)? else {
        return Some(background(asked, &ray, &nudged));
    };
    let hits = Hits::of(asked, tree, (ray, &nudged), triangle)?;
    let (ray, hit) = hits.centre;
    if caster.grazing(seen, &ray, &hit, bias, OFF_PLANE).is_some() {
        return None;
    }
    let offs = off_plane(caster, &ray, &hit);
    let slid = offs.map(|off| (slid(&ray, &hit, off), hit));
    let shadows = Shadows::new(seen, tree, hits.points(caster.scene(), offs, &slid), bias);
    // If it is uncertain whether a light reaches all hit points, a shadow ray to this light is cast.
    let radiance_of = |seen: &Seen<'_>, (ray, hit): &RayHit, cast: &dyn Fn(&Sight<f64>) -> bool| {
        let reaches = |sight: &Sight<f64>| shadows.reaches(sight.light).unwrap_or_else(|| cast(sight));
        caster.shaded(seen, ray, Some(hit), &reaches)
    };
    let with_bias = |at: &RayHit, bias: f64| radiance_of(seen, at, &|sight| caster.reaches(sight, bias));
    let moved_by = |at: &RayHit, caster: &Caster<'_, f64>, off: DVec3| {
        radiance_of(seen, at, &|sight| caster.reaches(&moved(sight, off), bias))
    };
    let mut sample = PixelSample::of(with_bias(&hits.centre, bias), true);
    for (reach, other) in &hits.nudged {
        sample.nudge(*reach, with_bias(other, bias));
    }
    slid.iter().for_each(|other| sample.consider(with_bias(other, bias)));
    let are_unsure = shadows.some_are_unsure();
    let leaning = caster.leaning();
    for caster in leaning.iter().filter(|_| hits.leaning.1 != hit || are_unsure) {
        sample.consider(moved_by(&hits.leaning, caster, DVec3::ZERO));
    }
    if are_unsure {
        for factor in [0.5, 2.0] {
            sample.consider(with_bias(&hits.centre, bias * factor));
        }
        asked.end_before_hit(&mut sample, (&hits.centre.0, &hits.centre.1), |end| {
            radiance_of(seen, &hits.centre, &|sight| caster.reaches(sight, end(sight)))
        });
        for part in [AT_LIGHT, -AT_LIGHT] {
            let cast = |sight: &Sight<f64>| {
                caster.reaches_within(sight, bias, sight.distance - part * asked.scale(sight))
            };
            sample.consider(radiance_of(seen, &hits.centre, &cast));
        }
        for (off, slid) in offs.into_iter().zip(&slid) {
            for caster in [caster, &leaning[0], &leaning[1]] {
                sample.consider(moved_by(&hits.centre, caster, off));
            }
            leaning.iter().for_each(|caster| sample.consider(moved_by(slid, caster, DVec3::ZERO)));
        }
    }
    let usual = |sight: &Sight<f64>| caster.reaches(sight, bias);
    asked.turn_sky(&mut sample, |seen| radiance_of(seen, &hits.centre, &usual));
    let reaches = |sight: &Sight<f64>| shadows.reaches(sight.light).unwrap_or_else(|| usual(sight));
    asked.shift_texture(&mut sample, (&ray, &hit), &reaches);
    asked.change_highlights(&mut sample, (&ray, &hit), &reaches);
    Some(sample)
}

/// Returns the nudged rays of the pixel whose own ray is `ray`.
fn nudged_rays(asked: &Asked<'_>, ray: Ray<f64>) -> Nudged {
    let mut nudged = [(Reach::Wide, ray); NUDGES];
    for (slot, (reach, [x, y])) in nudged.iter_mut().zip(nudges(asked.frame, asked.centre)) {
        *slot = (reach, asked.caster.ray(x, y));
    }
    nudged
}

/// Returns the sample of a pixel whose ray and nudged rays hit nothing.
fn background(asked: &Asked<'_>, ray: &Ray<f64>, nudged: &Nudged) -> PixelSample {
    let Asked { caster, bias, seen, .. } = asked;
    let mut sample = PixelSample::of(caster.radiance(seen, ray, None, *bias), false);
    if caster.sky_behind().is_some() {
        for (reach, other) in nudged {
            sample.nudge(*reach, caster.background(other.direction));
        }
        asked.turn_background(&mut sample, ray);
    }
    sample
}
