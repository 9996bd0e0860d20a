//! Turns a scene as on a turntable, by moving the camera around it.

use super::{Camera, Light, Scene};
use glam::{DQuat, DVec3, Vec3};

/// A turntable: its axis, and what is needed to move the camera and the lights around the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// A point on the axis.
    pub centre: DVec3,
    /// The direction of the axis, of length 1.
    pub up: DVec3,
    /// The radius of the ball around the scene, in the scene's units; 1 if the ball was not computed.
    pub radius: f64,
    /// True if lights move with the camera. Lights move if raycl added them to a mesh without a scene file.
    /// Lights from a scene file, from the mesh's own file (glTF) or from the user's options stay in place.
    pub with_lights: bool,
}

impl Orbit {
    /// Returns the camera and the lights after the fraction `part` of a turn. If the fraction `part` is 0,
    /// returns the scene's own camera and lights.
    pub fn at(&self, scene: &Scene, part: f64) -> (Camera, Vec<Light>) {
        if part == 0.0 {
            return (scene.camera, scene.lights.clone());
        }
        let turn = DQuat::from_axis_angle(self.up, part * std::f64::consts::TAU);
        let rotated = |position: Vec3| (turn * (position.as_dvec3() - self.centre) + self.centre).as_vec3();
        let direction = |axis: Vec3| (turn * axis.as_dvec3()).as_vec3();
        let camera = &scene.camera;
        let turned = Camera {
            position: rotated(camera.position),
            right: direction(camera.right),
            up: direction(camera.up),
            forward: direction(camera.forward),
            ..*camera
        };
        let moved = |light: &Light| {
            let area = light.area.map(|area| area.turned(direction));
            Light { position: rotated(light.position), area, ..*light }
        };
        let lights = scene.lights.iter().map(|light| if self.with_lights { moved(light) } else { *light });
        (turned, lights.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures;
    use crate::scene::{Area, AreaShape};

    #[test]
    fn a_quarter_turn_takes_the_front_to_the_right_and_a_whole_one_back() {
        let mut scene = fixtures::single_triangle();
        scene.camera = Camera { position: Vec3::new(1.0, 0.5, 7.0), ..scene.camera };
        let orbit = Orbit { centre: DVec3::X, up: DVec3::Y, radius: 1.0, with_lights: false };
        let (camera, lights) = orbit.at(&scene, 0.25);
        assert!(camera.position.distance(Vec3::new(8.0, 0.5, 0.0)) < 1e-5);
        assert!(camera.forward.distance(Vec3::NEG_X) < 1e-6 && camera.right.distance(Vec3::NEG_Z) < 1e-6);
        assert_eq!((camera.up, lights), (Vec3::Y, scene.lights.clone()));
        let rolled = Scene { camera: Camera { up: Vec3::Z, ..scene.camera }, ..scene.clone() };
        assert!(orbit.at(&rolled, 0.25).0.up.distance(Vec3::X) < 1e-6);
        let (_, lights) = Orbit { with_lights: true, ..orbit }.at(&scene, 0.5);
        assert!((lights[0].position.x - (2.0 - scene.lights[0].position.x)).abs() < 1e-5);
        assert_eq!(orbit.at(&scene, 0.0).0, scene.camera);
        assert!(orbit.at(&scene, 1.0).0.position.distance(scene.camera.position) < 1e-5);
    }

    #[test]
    fn an_area_light_that_moves_with_the_camera_turns_with_it() {
        let mut scene = fixtures::single_triangle();
        scene.lights[0].area = Some(Area { shape: AreaShape::Disc, edges: [Vec3::X, Vec3::Z] });
        let orbit = Orbit { centre: DVec3::X, up: DVec3::Y, radius: 1.0, with_lights: true };
        let (_, lights) = orbit.at(&scene, 0.25);
        let edges = lights[0].area.expect("an area light").edges;
        assert!(edges[0].distance(Vec3::NEG_Z) < 1e-6 && edges[1].distance(Vec3::X) < 1e-6, "{edges:?}");
    }
}
