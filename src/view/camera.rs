//! The position of the eye in `raycl view`, relative to the camera that the scene itself has. The results of
//! all functions in this file depend only on their arguments.

use crate::scene::{Camera, Light, Orbit, Scene};
use glam::{DQuat, DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// The least angle between the view direction and the vertical, in radians: in a vertical view,
/// left and right would have no meaning.
const POLE: f64 = 0.02;
/// The least and the greatest distance of the eye from the pivot (the point towards which the eye zooms). The
/// unit is the distance of the scene's own camera from the pivot.
const DISTANCES: [f64; 2] = [1e-3, 1e3];
/// An eye counts as being in the centre of its orbit if its distance from the centre is less than the fraction
/// `CENTRAL` of the scene's radius.
const CENTRAL: f64 = 1e-3;

/// A position of the eye relative to the scene's own camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The angle by which the eye is moved around the scene's vertical axis, in radians.
    pub turn: f64,
    /// The angle by which the eye is moved upwards around the centre of its orbit, in radians.
    pub tilt: f64,
    /// The eye's distance from the pivot (the point towards which the eye zooms; see the function `pivot`).
    /// The unit is the distance of the scene's own camera from the pivot.
    pub distance: f64,
    /// How far the eye is moved to the right and upwards in the picture's plane. The unit is the eye's
    /// distance from the pivot.
    pub aside: [f64; 2],
}

impl Pose {
    /// The position of the scene's own camera.
    pub const START: Self = Self { turn: 0.0, tilt: 0.0, distance: 1.0, aside: [0.0; 2] };

    /// Moves the eye around the scene, by angles in radians to the right and upwards, but never over the scene's top or
    /// bottom. `elevation` is the angle by which the scene's own camera looks down.
    pub fn orbit(&mut self, [right, up]: [f64; 2], elevation: f64) {
        self.turn = (self.turn + right).rem_euclid(TAU);
        let most = FRAC_PI_2 - POLE;
        // If the scene's own camera is closer to the vertical than `POLE` allows, the eye may stay at the
        // position of this camera.
        let (low, high) = ((-most - elevation).min(0.0), (most - elevation).max(0.0));
        self.tilt = (self.tilt + up).clamp(low, high);
    }

    /// Moves the eye to the right and upwards, in units of the eye's distance from the pivot.
    pub fn pan(&mut self, [right, up]: [f64; 2]) {
        self.aside[0] += right;
        self.aside[1] += up;
    }

    /// Moves the eye towards the pivot for positive `steps`, and away from the pivot for negative `steps`.
    /// Ten positive steps halve the distance between the eye and the pivot. The distance stays within
    /// `DISTANCES`.
    pub fn zoom(&mut self, steps: f64) {
        self.distance = (self.distance * (-steps / 10.0).exp2()).clamp(DISTANCES[0], DISTANCES[1]);
    }

    /// Returns the camera and the lights for this position of the eye. For `START`, the result equals the
    /// scene's own camera and lights bit for bit.
    pub fn at(&self, scene: &Scene, orbit: &Orbit) -> (Camera, Vec<Light>) {
        let (mut camera, lights) = orbit.at(scene, self.turn / TAU);
        if self.tilt != 0.0 {
            let from_centre = camera.position.as_dvec3() - orbit.centre;
            let turn = DQuat::from_axis_angle(camera.right.as_dvec3().normalize(), -self.tilt);
            let turned = |axis: Vec3| (turn * axis.as_dvec3()).as_vec3();
            camera.position = (turn * from_centre + orbit.centre).as_vec3();
            (camera.up, camera.forward) = (turned(camera.up), turned(camera.forward));
        }
        let pivot = pivot(&camera, orbit);
        let from_pivot = |camera: &Camera| camera.position.as_dvec3() - pivot;
        if self.distance != 1.0 {
            camera.position = (from_pivot(&camera) * self.distance + pivot).as_vec3();
        }
        if self.aside != [0.0; 2] {
            let [right, up] = self.aside;
            let aside = camera.right.as_dvec3() * right + camera.up.as_dvec3() * up;
            let distance = from_pivot(&camera).length();
            camera.position = (camera.position.as_dvec3() + aside * distance).as_vec3();
        }
        (camera, lights)
    }
}

/// Returns the pivot: the point towards which the eye zooms. The eye pans by fractions of its distance from
/// the pivot. Usually, the pivot is the centre of the eye's orbit. If the eye itself is in the centre of its
/// orbit, as in a panorama, orbiting only turns the eye. The pivot then lies one radius of the scene ahead of
/// the eye.
fn pivot(camera: &Camera, orbit: &Orbit) -> DVec3 {
    let position = camera.position.as_dvec3();
    if position.distance(orbit.centre) < CENTRAL * orbit.radius {
        return position + camera.forward.as_dvec3() * orbit.radius;
    }
    orbit.centre
}

/// Returns how far the camera looks down, as an angle in radians: 0 is level.
pub fn elevation(camera: &Camera, orbit: &Orbit) -> f64 {
    let forward: DVec3 = camera.forward.as_dvec3();
    (-forward.dot(orbit.up)).clamp(-1.0, 1.0).asin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures;

    const ORBIT: Orbit =
        Orbit { centre: DVec3::new(0.0, 0.0, -3.0), up: DVec3::Y, radius: 1.0, with_lights: false };

    /// A scene whose camera is at the origin, three units in front of the centre of the orbit.
    fn scene() -> Scene {
        Scene { camera: Camera::PAPER, ..fixtures::single_triangle() }
    }

    fn distance(camera: &Camera) -> f64 {
        camera.position.as_dvec3().distance(ORBIT.centre)
    }

    #[test]
    fn nothing_done_is_the_scenes_own_camera() {
        let scene = scene();
        assert_eq!(Pose::START.at(&scene, &ORBIT), (scene.camera, scene.lights.clone()));
    }

    #[test]
    fn going_around_keeps_the_distance_and_looks_at_the_centre() {
        let scene = scene();
        let mut pose = Pose::START;
        for by in [[0.3, 0.2], [1.0, 0.5], [-2.0, -1.9], [0.0, 0.7]] {
            pose.orbit(by, elevation(&scene.camera, &ORBIT));
            let (camera, _) = pose.at(&scene, &ORBIT);
            assert!((distance(&camera) - 3.0).abs() < 1e-5, "{camera:?}");
            let towards = (ORBIT.centre - camera.position.as_dvec3()).normalize();
            assert!(towards.distance(camera.forward.as_dvec3()) < 1e-5, "{camera:?}");
            assert!(camera.right.dot(Vec3::Y).abs() < 1e-5, "it stays level");
            assert!(camera.up.dot(camera.forward).abs() < 1e-5 && camera.up.y > 0.0, "{camera:?}");
        }
    }

    #[test]
    fn upwards_is_upwards_and_ends_before_the_top() {
        let scene = scene();
        let mut pose = Pose::START;
        pose.orbit([0.0, 0.5], 0.0);
        assert!((f64::from(pose.at(&scene, &ORBIT).0.position.y) - 3.0 * 0.5_f64.sin()).abs() < 1e-5);
        pose.orbit([0.0, 9.0], 0.0);
        assert!((pose.tilt - (FRAC_PI_2 - 0.02)).abs() < 1e-12);
        pose.orbit([0.0, -9.0], 0.0);
        assert!((pose.tilt + FRAC_PI_2 - 0.02).abs() < 1e-12);
        // The scene's own camera looks straight down, so the eye can only go down.
        pose = Pose::START;
        pose.orbit([0.0, 0.5], FRAC_PI_2);
        assert_eq!(pose.tilt, 0.0);
    }

    #[test]
    fn right_is_where_the_turntable_goes() {
        let scene = scene();
        let mut pose = Pose::START;
        pose.orbit([FRAC_PI_2, 0.0], 0.0);
        assert_eq!(pose.at(&scene, &ORBIT), ORBIT.at(&scene, 0.25));
        assert!(pose.at(&scene, &ORBIT).0.position.x > 2.9);
    }

    #[test]
    fn ten_steps_halve_the_distance_and_there_is_a_nearest_and_a_farthest() {
        let scene = scene();
        let mut pose = Pose::START;
        pose.zoom(10.0);
        assert!((distance(&pose.at(&scene, &ORBIT).0) - 1.5).abs() < 1e-5);
        pose.zoom(-10.0);
        assert!((pose.distance - 1.0).abs() < 1e-12);
        pose.zoom(1e6);
        assert_eq!(pose.distance, 1e-3);
        pose.zoom(-1e6);
        assert_eq!(pose.distance, 1e3);
    }

    #[test]
    fn aside_is_along_the_picture() {
        let scene = scene();
        let mut pose = Pose::START;
        pose.pan([0.5, -0.25]);
        let (camera, _) = pose.at(&scene, &ORBIT);
        assert!(camera.position.distance(Vec3::new(1.5, -0.75, 0.0)) < 1e-5, "{camera:?}");
        assert_eq!(camera.forward, scene.camera.forward);
    }

    #[test]
    fn an_eye_in_the_centre_turns_there_and_zooms_and_pans_by_the_scenes_radius() {
        let (scene, orbit) = (scene(), Orbit { centre: DVec3::Z * 1e-3, radius: 4.0, ..ORBIT });
        let eye = |pose: Pose| pose.at(&scene, &orbit).0.position;
        let turned = Pose { turn: FRAC_PI_2, ..Pose::START };
        assert!(eye(turned).length() < 2e-3);
        assert!(eye(Pose { distance: 0.5, ..Pose::START }).distance(Vec3::NEG_Z * 2.0) < 1e-5);
        // After a quarter turn to the right, an eye in the centre of its orbit looks in the direction -x.
        assert!(eye(Pose { distance: 2.0, ..turned }).distance(Vec3::X * 4.0) < 2e-3);
        assert!(eye(Pose { aside: [0.5, 0.25], ..Pose::START }).distance(Vec3::new(2.0, 1.0, 0.0)) < 1e-5);
    }

    #[test]
    fn the_limits_of_the_tilt_count_from_the_scenes_own_elevation() {
        let tilt = |up: f64, elevation: f64| {
            let mut pose = Pose::START;
            pose.orbit([0.0, up], elevation);
            pose.tilt + elevation
        };
        let most = FRAC_PI_2 - POLE;
        for elevation in [-0.4, 0.4] {
            assert!((tilt(9.0, elevation) - most).abs() < 1e-12);
            assert!((tilt(-9.0, elevation) + most).abs() < 1e-12);
        }
    }

    #[test]
    fn a_camera_that_looks_down_has_a_positive_elevation() {
        let of = |forward: Vec3| elevation(&Camera { forward: forward.normalize(), ..Camera::PAPER }, &ORBIT);
        assert!((of(Vec3::new(0.0, -1.0, -1.0)) - FRAC_PI_2 / 2.0).abs() < 1e-6);
        assert!((of(Vec3::Y) + FRAC_PI_2).abs() < 1e-6 && of(Vec3::NEG_Z).abs() < 1e-6);
    }
}
