//! A camera and lights for a mesh that comes without.

use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use super::{Camera, Light, Shot};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// Across the height: a portrait lens, little distortion.
const FOV_Y_DEGREES: f32 = 35.0;
/// The mesh takes this part of the half height, so also of any wider image's.
const FILL: f64 = 0.92;
/// From right, above and in front: how far along each, for meshes with y up and their front towards +z.
const THREE_QUARTER: DVec3 = DVec3::new(0.6, 0.45, 1.0);
/// Positions of a turntable's turn at which the whole mesh has to be visible.
const TURNS: u32 = 24;
/// The eye is no nearer to a mesh's nearest point than this part of its radius.
const NEAREST_RADII: f64 = 0.3;
/// Lights stand this many radii from the centre: near enough to model the shape,
/// far enough to light it evenly.
const LIGHT_RADII: f64 = 10.0;

/// The ball that a mesh is framed and lit as.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// The middle of the bounding box.
    pub centre: DVec3,
    radius: f64,
    /// Where an open mesh, such as a room without its front wall, is open to.
    opening: Option<DVec3>,
}

impl Ball {
    /// The ball of a mesh with a direction upwards; of some size even where the mesh is a point, or too small
    /// beside its distance from the origin for f32 to tell its corners apart.
    pub fn around(mesh: &Mesh, up: DVec3) -> Self {
        let (low, high) = mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let centre = (low + high) / 2.0;
        let radius = ((high - low).length() / 2.0).max(1e-4 * centre.length()).max(1e-9);
        Self { centre, radius, opening: opening(mesh, up) }
    }

    /// Its centre and radius.
    pub fn place(&self) -> (DVec3, f64) {
        (self.centre, self.radius)
    }

    /// Whether it is a room that is looked into.
    pub fn is_open(&self) -> bool {
        self.opening.is_some()
    }
}

/// From where a mesh is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// The direction upwards, of unit length.
    pub up: DVec3,
    /// From the front to the right.
    pub azimuth_degrees: Option<f64>,
    /// From level upwards.
    pub elevation_degrees: Option<f64>,
    /// What it is framed for.
    pub shot: Shot,
}

impl View {
    /// How the mesh stands while it is seen.
    fn turns(&self) -> Vec<DMat3> {
        let count = if self.shot.turns { TURNS } else { 1 };
        let angle = |number: u32| f64::from(number) / f64::from(count) * std::f64::consts::TAU;
        (0..count).map(|number| DMat3::from_axis_angle(self.up, angle(number))).collect()
    }

    /// Right and front of a mesh with this direction upwards: with y up its front is towards +z, with z up towards -y.
    fn level(&self) -> [DVec3; 2] {
        let front = if self.up.z.abs() < 0.9 { DVec3::Z } else { DVec3::NEG_Y };
        let front = front.reject_from_normalized(self.up).normalize_or(DVec3::X);
        [self.up.cross(front), front]
    }

    /// The direction towards the eye, and one that is upwards in the picture.
    fn towards_eye(&self, opening: Option<DVec3>) -> [DVec3; 2] {
        let [right, front] = self.level();
        let DVec3 { x, y, z } = THREE_QUARTER;
        if self.azimuth_degrees.is_none() && self.elevation_degrees.is_none() {
            // An open mesh is looked into; any other is seen from three quarters.
            let three_quarter = (right * x + self.up * y + front * z).normalize();
            return [opening.unwrap_or(three_quarter), self.up];
        }
        let azimuth = self.azimuth_degrees.map_or_else(|| x.atan2(z), f64::to_radians);
        let elevation = self.elevation_degrees.map_or_else(|| y.atan2(x.hypot(z)), f64::to_radians);
        let level = right * azimuth.sin() + front * azimuth.cos();
        // From straight above the front is at the bottom of the picture.
        let upright = self.up * elevation.cos() - level * elevation.sin();
        [self.up * elevation.sin() + level * elevation.cos(), upright]
    }
}

/// A view of the whole mesh that fills a picture across or down.
pub(super) fn camera(mesh: &Mesh, ball: Ball, view: &View) -> Camera {
    let [towards_eye, upright] = view.towards_eye(ball.opening);
    let look = Camera::looking_at(Vec3::ZERO, -towards_eye.as_vec3(), upright.as_vec3(), FOV_Y_DEGREES, true);
    // Upright is never along the view, so there always is a look.
    let look = look.unwrap_or(Camera::PAPER);
    let tan_y = f64::from(look.tan_half_fov) * FILL;
    let tan_x = tan_y * view.shot.aspect;
    let (right, up) = (look.right.as_dvec3(), look.up.as_dvec3());
    // How far a corner reaches beyond each of the four planes through the centre that bound the view, measured across.
    let reach_after = |turn: &DMat3, corner: Vec3| {
        let offset = *turn * (corner.as_dvec3() - ball.centre);
        let (x, y, depth) = (offset.dot(right), offset.dot(up), offset.dot(towards_eye));
        [x + tan_x * depth, tan_x * depth - x, y + tan_y * depth, tan_y * depth - y, depth]
    };
    let turns = view.turns();
    let most = |a: [f64; 5], b: [f64; 5]| std::array::from_fn(|i| a[i].max(b[i]));
    let reach =
        |corner| turns.iter().map(|turn| reach_after(turn, corner)).fold([f64::NEG_INFINITY; 5], most);
    let reaches = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).map(|triangle| {
        let [a, b, c] = mesh.corners(triangle).map(reach);
        most(most(a, b), c)
    });
    let [east, west, north, south, nearest] = reaches.reduce(|| [f64::NEG_INFINITY; 5], most);
    // Opposite planes meet where the mesh touches both; the farther of the two places sees all.
    let across = (east + west) / (2.0 * tan_x);
    let down = (north + south) / (2.0 * tan_y);
    let distance = across.max(down).max(nearest + NEAREST_RADII * ball.radius);
    let aside = right * ((east - west) / 2.0) + up * ((north - south) / 2.0);
    Camera { position: (ball.centre + aside + towards_eye * distance).as_vec3(), z_near: 0.0, ..look }
}

/// The level direction that an open mesh's faces have their fronts to.
fn opening(mesh: &Mesh, up: DVec3) -> Option<DVec3> {
    let areas = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).map(|triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        let area = (b - a).cross(c - a);
        (area, area.length())
    });
    // The oriented areas of a closed mesh cancel out.
    let (open, total) = areas.reduce(|| (DVec3::ZERO, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let open = open.reject_from_normalized(up);
    (open.length() > 0.1 * total).then(|| open.try_normalize()).flatten()
}

/// The key light's power, and how far it stands from the nearest surface.
pub(super) fn key_at(ball: Ball) -> (f64, f64) {
    let distance = (LIGHT_RADII - 1.0) * ball.radius;
    (key_power(distance), distance)
}

/// A key light from the upper left of the viewer and a weaker fill from the right.
/// Their power goes with the square of the size, so that a k_L of 0.8 facing the
/// key shows as 80 to 88% grey at any scale.
pub(super) fn lights(camera: &Camera, ball: Ball) -> Vec<Light> {
    let axes = [camera.right, camera.up, camera.forward].map(|axis| axis.as_dvec3());
    let light = |right: f64, up: f64, back: f64, strength: f64| {
        let direction = (axes[0] * right + axes[1] * up - axes[2] * back).normalize();
        let position = ball.centre + direction * (LIGHT_RADII * ball.radius);
        let power = strength * key_at(ball).0;
        Light { position: position.as_vec3(), power: Vec3::splat(power as f32), radius: 0.0 }
    };
    match ball.opening {
        // Into an opening light only gets from about where the viewer is.
        Some(_) => vec![light(-0.12, 0.08, 1.0, 1.0), light(0.3, 0.05, 1.0, 0.3)],
        None => vec![light(-0.55, 0.75, 0.9, 1.0), light(0.9, 0.15, 0.6, 0.3)],
    }
}

/// The power that shows 88% on a facing k_L of 0.8 at `distance`, from
/// `15 L = 0.88^2.2` and `L = power / (4 pi distance^2) * 0.8 / pi`.
fn key_power(distance: f64) -> f64 {
    let radiance = 0.88_f64.powf(2.2) / 15.0;
    radiance * 4.0 * std::f64::consts::PI.powi(2) * distance * distance / 0.8
}

#[cfg(test)]
mod tests;
