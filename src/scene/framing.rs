//! A camera and lights for a mesh that comes without.

use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use super::{Camera, Light};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Across the height: a portrait lens, little distortion.
const FOV_Y_DEGREES: f32 = 35.0;
/// The mesh takes this part of the half height, so also of any wider image's.
const FILL: f64 = 0.92;
/// From right, above and in front, for meshes with y up and their front towards +z.
const THREE_QUARTER: DVec3 = DVec3::new(0.6, 0.45, 1.0);
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
    /// The mesh's ball; of some size even where the mesh is a point, or too small
    /// beside its distance from the origin for f32 to tell its corners apart.
    pub fn around(mesh: &Mesh) -> Self {
        let (low, high) = mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let centre = (low + high) / 2.0;
        let radius = ((high - low).length() / 2.0).max(1e-4 * centre.length()).max(1e-9);
        Self { centre, radius, opening: opening(mesh) }
    }
}

/// A view of the whole mesh, in images of any shape at least as wide as high.
pub(super) fn camera(mesh: &Mesh, ball: Ball) -> Camera {
    // An open mesh is looked into; any other is seen from three quarters.
    let towards_eye = ball.opening.unwrap_or(THREE_QUARTER.normalize());
    let look = Camera::looking_at(Vec3::ZERO, -towards_eye.as_vec3(), Vec3::Y, FOV_Y_DEGREES, true);
    // The direction is never along y, so there always is a look.
    let look = look.unwrap_or(Camera::PAPER);
    let tan = f64::from(look.tan_half_fov) * FILL;
    let (right, up) = (look.right.as_dvec3(), look.up.as_dvec3());
    // A corner is in view from a distance of its height / tan, and its depth towards the eye more.
    let distance = |corner: Vec3| {
        let offset = corner.as_dvec3() - ball.centre;
        offset.dot(right).abs().max(offset.dot(up).abs()) / tan + offset.dot(towards_eye)
    };
    let needed = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).map(|triangle| {
        let [a, b, c] = mesh.corners(triangle).map(distance);
        a.max(b).max(c)
    });
    let distance = needed.reduce(|| 0.0, f64::max).max(1.2 * ball.radius);
    Camera { position: (ball.centre + towards_eye * distance).as_vec3(), z_near: 0.0, ..look }
}

/// The level direction that an open mesh's faces have their fronts to.
fn opening(mesh: &Mesh) -> Option<DVec3> {
    let areas = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).map(|triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        let area = (b - a).cross(c - a);
        (area, area.length())
    });
    // The oriented areas of a closed mesh cancel out.
    let (open, total) = areas.reduce(|| (DVec3::ZERO, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let open = DVec3::new(open.x, 0.0, open.z);
    (open.length() > 0.1 * total).then(|| open.try_normalize()).flatten()
}

/// A key light from the upper left of the viewer and a weaker fill from the right.
/// Their power goes with the square of the size, so that a k_L of 0.8 facing the
/// key shows as 80 to 88% grey at any scale.
pub(super) fn lights(camera: &Camera, ball: Ball) -> Vec<Light> {
    let axes = [camera.right, camera.up, camera.forward].map(|axis| axis.as_dvec3());
    let light = |right: f64, up: f64, back: f64, strength: f64| {
        let direction = (axes[0] * right + axes[1] * up - axes[2] * back).normalize();
        let position = ball.centre + direction * (LIGHT_RADII * ball.radius);
        let power = strength * key_power((LIGHT_RADII - 1.0) * ball.radius);
        Light { position: position.as_vec3(), power: Vec3::splat(power as f32) }
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
mod tests {
    use super::*;
    use crate::scene::{Shape, generate};

    /// The largest |tan| over the mesh, right and up.
    fn extent(camera: &Camera, mesh: &Mesh) -> (f32, f32) {
        mesh.positions.iter().map(|p| *p - camera.position).fold((0.0, 0.0), |(x, y), d| {
            let depth = d.dot(camera.forward);
            assert!(depth > 0.0);
            ((d.dot(camera.right).abs() / depth).max(x), (d.dot(camera.up).abs() / depth).max(y))
        })
    }

    #[test]
    fn the_whole_mesh_is_in_a_square_view_at_any_scale() {
        for scale in [1e-6, 1.0, 1e6_f32] {
            let mut mesh = generate(&Shape::Teapot { fineness: 4 });
            mesh.positions.iter_mut().for_each(|p| *p = *p * scale + 3.0 * scale);
            let camera = camera(&mesh, Ball::around(&mesh));
            let (x, y) = extent(&camera, &mesh);
            let largest = x.max(y) / camera.tan_half_fov;
            assert!((0.9..0.95).contains(&largest), "{largest} of the half height at {scale}");
        }
    }

    #[test]
    fn a_facing_surface_shows_80_to_90_percent_at_any_scale() {
        for scale in [1e-3, 1.0, 1e4_f32] {
            let mut mesh = generate(&Shape::Sphere { triangles: 100 });
            mesh.positions.iter_mut().for_each(|p| *p *= scale);
            let ball = Ball::around(&mesh);
            let key = lights(&camera(&mesh, ball), ball)[0];
            for distance in [ball.centre.distance(key.position.as_dvec3()), 9.5 * ball.radius] {
                let pi = std::f64::consts::PI;
                let radiance = f64::from(key.power.x) / (4.0 * pi * distance * distance) * 0.8 / pi;
                let grey = (15.0 * radiance).powf(1.0 / 2.2);
                assert!((0.79..0.9).contains(&grey), "{grey}");
            }
        }
    }

    #[test]
    fn a_point_is_framed_too() {
        let mut mesh = generate(&Shape::Ground);
        mesh.positions.iter_mut().for_each(|p| *p = Vec3::new(1.0, 1.0, -2.0));
        let ball = Ball::around(&mesh);
        let camera = camera(&mesh, ball);
        assert!(camera.position.is_finite() && camera.position.distance(ball.centre.as_vec3()) > 0.0);
        assert!(lights(&camera, ball).iter().all(|light| light.power.min_element() > 0.0));
    }
}
