//! Chooses a camera and lights for a mesh that has none.

use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use super::{Camera, Light, Shot};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// Field of view across the height, like the view of a portrait lens, which has little distortion.
const FOV_Y_DEGREES: f32 = 35.0;
/// The mesh fills this fraction of the picture in one direction, across or down, and at most this
/// fraction in the other direction.
const FILL: f64 = 0.92;
/// The default direction from a mesh to the camera: the components to the right, upwards and to the front.
const THREE_QUARTER: DVec3 = DVec3::new(0.6, 0.45, 1.0);
/// The camera of a turntable is placed so that the whole mesh is visible at this many equally spaced angles.
const TURNS: u32 = 24;
/// Smallest distance of the eye from the nearest point of a mesh, in radii of the ball that represents the mesh.
const NEAREST_RADII: f64 = 0.3;
/// Smallest radius of the ball that represents a mesh, as a factor of the distance of the ball's centre from the
/// origin: eight to sixteen times the smallest difference between two numbers of type f32.
const LEAST_RADIUS: f64 = 1e-6;
/// Distance of the lights from the centre of the mesh's ball, in radii of this ball: close enough that the shading
/// shows the mesh's shape, far enough to light it evenly.
const LIGHT_RADII: f64 = 10.0;

/// The ball that represents a mesh in framing and lighting.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// The centre of the bounding box.
    pub centre: DVec3,
    radius: f64,
    /// The direction in which an open mesh, such as a room without its front wall, is open; `None` for a closed mesh.
    opening: Option<DVec3>,
}

impl Ball {
    /// Returns the ball that represents a mesh whose upward direction is `up`. The ball's radius is always positive,
    /// even if the mesh is a point, or is so far from the origin that f32 cannot distinguish its corners. The radius is
    /// then so large that f32 can distinguish the centre from an eye that is `NEAREST_RADII` away.
    pub fn around(mesh: &Mesh, up: DVec3) -> Self {
        let (low, high) = mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let centre = (low + high) / 2.0;
        let radius = ((high - low).length() / 2.0).max(LEAST_RADIUS * centre.length()).max(1e-9);
        Self { centre, radius, opening: opening(mesh, up) }
    }

    /// Returns the ball's centre and radius.
    pub fn place(&self) -> (DVec3, f64) {
        (self.centre, self.radius)
    }

    /// Returns whether the mesh is a room with an open side.
    pub fn is_open(&self) -> bool {
        self.opening.is_some()
    }
}

/// The direction from which a mesh is seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// The upward direction, of length 1.
    pub up: DVec3,
    /// Angle from the front to the right; `None` if the user does not set it.
    pub azimuth_degrees: Option<f64>,
    /// Angle above the horizon; `None` if the user does not set it.
    pub elevation_degrees: Option<f64>,
    /// The pictures for which the mesh is framed.
    pub shot: Shot,
}

impl View {
    /// Returns the rotations in which the pictures show the mesh: several rotations for a turntable, otherwise one.
    fn turns(&self) -> Vec<DMat3> {
        let count = if self.shot.turns { TURNS } else { 1 };
        let angle = |number: u32| f64::from(number) / f64::from(count) * std::f64::consts::TAU;
        (0..count).map(|number| DMat3::from_axis_angle(self.up, angle(number))).collect()
    }

    /// Returns the directions to the right and to the front of a mesh with this upward direction. With y up,
    /// the front is +z; with z up, the front is -y.
    fn level(&self) -> [DVec3; 2] {
        let front = if self.up.z.abs() < 0.9 { DVec3::Z } else { DVec3::NEG_Y };
        let front = front.reject_from_normalized(self.up).normalize_or(DVec3::X);
        [self.up.cross(front), front]
    }

    /// Returns the direction towards the eye, and the direction that is upwards in the picture.
    fn towards_eye(&self, opening: Option<DVec3>) -> [DVec3; 2] {
        let [right, front] = self.level();
        let DVec3 { x, y, z } = THREE_QUARTER;
        if self.azimuth_degrees.is_none() && self.elevation_degrees.is_none() {
            // An open mesh is seen through its opening; any other mesh is seen from the right,
            // above and in front.
            let three_quarter = (right * x + self.up * y + front * z).normalize();
            return [opening.unwrap_or(three_quarter), self.up];
        }
        let azimuth = self.azimuth_degrees.map_or_else(|| x.atan2(z), f64::to_radians);
        let elevation = self.elevation_degrees.map_or_else(|| y.atan2(x.hypot(z)), f64::to_radians);
        let level = right * azimuth.sin() + front * azimuth.cos();
        // If the mesh is seen from straight above, its front is at the bottom of the picture.
        let upright = self.up * elevation.cos() - level * elevation.sin();
        [self.up * elevation.sin() + level * elevation.cos(), upright]
    }
}

/// Returns a camera that shows the whole mesh. The mesh usually fills the fraction `FILL` of the picture's width or
/// height.
pub(super) fn camera(mesh: &Mesh, ball: Ball, view: &View) -> Camera {
    let [towards_eye, upright] = view.towards_eye(ball.opening);
    let look = Camera::looking_at(Vec3::ZERO, -towards_eye.as_vec3(), upright.as_vec3(), FOV_Y_DEGREES, true);
    // `upright` is never parallel to the viewing direction, so the camera always exists.
    let look = look.unwrap_or(Camera::PAPER);
    let tan_y = f64::from(look.tan_half_fov) * FILL;
    let tan_x = tan_y * view.shot.aspect;
    let (right, up) = (look.right.as_dvec3(), look.up.as_dvec3());
    // Four planes through the ball's centre are parallel to the sides of the view pyramid. `reach_after` returns five
    // numbers.
    // The first four say how far a corner is beyond the right, left, upper and lower plane. The last number says how
    // much nearer to the eye the corner is than the centre.
    let reach_after = |turn: &DMat3, corner: Vec3| {
        let offset = *turn * (corner.as_dvec3() - ball.centre);
        let (x, y, depth) = (offset.dot(right), offset.dot(up), offset.dot(towards_eye));
        [x + tan_x * depth, tan_x * depth - x, y + tan_y * depth, tan_y * depth - y, depth]
    };
    let turns = view.turns();
    let most = |a: [f64; 5], b: [f64; 5]| std::array::from_fn(|i| a[i].max(b[i]));
    let reach =
        |corner| turns.iter().map(|turn| reach_after(turn, corner)).fold([f64::NEG_INFINITY; 5], most);
    // Triangles share corners, so it is faster to visit each position once.
    let is_corner = mesh.positions_of_triangles();
    let corners = mesh.positions.par_iter().zip(is_corner).with_min_len(PARALLEL_TRIANGLES);
    let reaches = corners.filter(|(_, is_corner)| *is_corner).map(|(position, _)| reach(*position));
    let [east, west, north, south, nearest] = reaches.reduce(|| [f64::NEG_INFINITY; 5], most);
    // Move the left and the right plane outwards until they touch the mesh: these two planes intersect in a line. Do
    // the same with the upper and the lower plane. An eye at the distance of the farther of the two lines sees the
    // whole mesh.
    let across = (east + west) / (2.0 * tan_x);
    let down = (north + south) / (2.0 * tan_y);
    let distance = across.max(down).max(nearest + NEAREST_RADII * ball.radius);
    let aside = right * ((east - west) / 2.0) + up * ((north - south) / 2.0);
    Camera { position: (ball.centre + aside + towards_eye * distance).as_vec3(), z_near: 0.0, ..look }
}

/// Returns the horizontal direction that the front sides of an open mesh face on average; `None`
/// for a closed mesh.
fn opening(mesh: &Mesh, up: DVec3) -> Option<DVec3> {
    let areas = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).map(|triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        let area = (b - a).cross(c - a);
        (area, area.length())
    });
    // The area vectors of a closed mesh's triangles (normal times area) add up to zero.
    let (open, total) = areas.reduce(|| (DVec3::ZERO, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let open = open.reject_from_normalized(up);
    (open.length() > 0.1 * total).then(|| open.try_normalize()).flatten()
}

/// Returns the key light's power, and the light's distance from the nearest point of the ball.
pub(super) fn key_at(ball: Ball) -> (f64, f64) {
    let distance = (LIGHT_RADII - 1.0) * ball.radius;
    (key_power(distance), distance)
}

/// Returns a key light from the viewer's upper left and a weaker fill light from the right. The power of both lights is
/// proportional to the square of the mesh's size, so the picture does not depend on the scale. Consider a surface with
/// a diffuse reflectance (k_L) of 0.8 that faces the key light and receives no other light. This surface is displayed
/// as 88% of white where the ball is nearest to the light, and as 80% of white at the ball's centre.
pub(super) fn lights(camera: &Camera, ball: Ball) -> Vec<Light> {
    let axes = [camera.right, camera.up, camera.forward].map(|axis| axis.as_dvec3());
    let light = |right: f64, up: f64, back: f64, strength: f64| {
        let direction = (axes[0] * right + axes[1] * up - axes[2] * back).normalize();
        let position = ball.centre + direction * (LIGHT_RADII * ball.radius);
        let power = strength * key_at(ball).0;
        Light { position: position.as_vec3(), power: Vec3::splat(power as f32), radius: 0.0 }
    };
    match ball.opening {
        // The viewer looks into a room through its open side. Only light from near the viewer enters the room.
        Some(_) => vec![light(-0.12, 0.08, 1.0, 1.0), light(0.3, 0.05, 1.0, 0.3)],
        None => vec![light(-0.55, 0.75, 0.9, 1.0), light(0.9, 0.15, 0.6, 0.3)],
    }
}

/// Returns the power of a light that makes a surface at `distance` appear as 88% of white. The surface faces the light
/// and has a diffuse reflectance (k_L) of 0.8. The power follows from `15 L = 0.88^2.2`, with the default exposure 15
/// and gamma 2.2, and from the surface's radiance `L = power / (4 pi distance^2) * 0.8 / pi`.
fn key_power(distance: f64) -> f64 {
    let radiance = 0.88_f64.powf(2.2) / 15.0;
    radiance * 4.0 * std::f64::consts::PI.powi(2) * distance * distance / 0.8
}

#[cfg(test)]
mod tests;
