//! Reads the cameras and lights of nodes. If the mesh is an object of a scene file, raycl does not use the mesh's
//! cameras and lights.

use super::Walk;
use crate::scene::files::gltf::Parsed;
use crate::scene::files::{FileLight, Placement};
use crate::scene::mesh::{Triangle, are_apart};
use crate::scene::{Camera, validate};
use glam::{DMat4, DVec3, Vec3};
use gltf::json::camera::{Perspective, Type};
use gltf::json::extensions::scene::khr_lights_punctual as punctual;
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};

/// A perspective camera of the file.
pub(super) struct FileCamera<'a> {
    position: DVec3,
    /// The camera, moved to the origin.
    camera: Camera,
    /// The file's values.
    pub lens: &'a Perspective,
    /// True if the axes of the camera's node are not perpendicular in the scene.
    is_skewed: bool,
    /// True if the file's field of view is not between 0.001 and 179.99 degrees.
    is_odd_view: bool,
    /// True if the file's znear is below 0 or not finite.
    is_odd_near: bool,
}

impl FileCamera<'_> {
    pub fn placed_by(&self, placement: &Placement) -> Camera {
        placement.camera(self.position, &self.camera)
    }

    /// Returns notes on values of the file that the camera does not have.
    fn notes(&self) -> impl Iterator<Item = String> {
        let Perspective { yfov, znear, .. } = self.lens;
        let view = || {
            format!(
                "the camera's yfov of {yfov} radians is not between 0.001 and 179.99 degrees: raycl uses 45 degrees instead"
            )
        };
        let near =
            || format!("the camera's znear of {znear} is not a number of at least 0: raycl uses 0 instead");
        let skewed = || "the camera's transform has a skew, which the picture does not show".to_owned();
        let notes = [self.is_odd_view.then(view), self.is_odd_near.then(near), self.is_skewed.then(skewed)];
        notes.into_iter().flatten()
    }
}

impl Walk<'_> {
    /// Adds the camera of a node. The camera looks along the node's -z axis. The lengths of the node's axes have no
    /// effect (glTF 2.0, 3.10.2), so a scale does not change the camera's znear, either, and a negative scale of the
    /// node does not turn the camera. (A negative scale of a parent moves the camera and the meshes together, and may
    /// turn both, so that the camera still looks at the meshes.) A camera is counted but not added if it is not a
    /// perspective camera, or if the node's transform makes its directions zero or parallel. A camera with an
    /// impossible field of view gets one of 45 degrees. A camera with an impossible znear gets a znear of 0.
    pub(super) fn add_camera(&mut self, node: &Node, transform: DMat4) -> Parsed<()> {
        let Some(index) = node.camera else { return Ok(()) };
        let camera =
            self.numbers.root.get(index).ok_or_else(|| format!("camera {} does not exist", index.value()))?;
        let (Checked::Valid(Type::Perspective), Some(lens)) = (camera.type_, &camera.perspective) else {
            match camera.type_ {
                Checked::Valid(Type::Orthographic) => self.left_out.orthographic += 1,
                _ => self.left_out.odd_cameras += 1,
            }
            return Ok(());
        };
        let position = transform.transform_point3(DVec3::ZERO);
        let scale = node.scale.filter(|_| node.matrix.is_none());
        let signs = scale.map_or(Vec3::ONE, |scale| Vec3::from_array(scale).signum()).as_dvec3();
        let [ahead, up] = [DVec3::NEG_Z, DVec3::Y]
            .map(|axis| transform.transform_vector3(axis * signs).normalize_or_zero());
        let degrees = lens.yfov.to_degrees();
        let is_odd_view = !(degrees > 1e-3 && degrees < 179.99);
        let degrees = if is_odd_view { 45.0 } else { degrees };
        let looking = Camera::looking_at(Vec3::ZERO, ahead.as_vec3(), up.as_vec3(), degrees, true);
        self.left_out.flat_cameras += usize::from(looking.is_none());
        let is_odd_near = !lens.znear.is_finite() || lens.znear < 0.0;
        let z_near = if is_odd_near { 0.0 } else { lens.znear };
        let is_skewed = is_skewed(&transform);
        self.cameras.extend(looking.map(|looking| {
            let camera = Camera { z_near, ..looking };
            FileCamera { position, camera, lens, is_skewed, is_odd_view, is_odd_near }
        }));
        Ok(())
    }

    /// Adds the light of a node. A directional light shines along the node's -z axis.
    pub(super) fn add_light(&mut self, node: &Node, transform: DMat4) -> Parsed<()> {
        let Some(index) = light_of(node) else { return Ok(()) };
        let light = lights_of(self.numbers.root).get(index.value());
        let light = light.ok_or_else(|| format!("light {} does not exist", index.value()))?;
        let strength = Vec3::from_array(light.color).as_dvec3() * f64::from(light.intensity);
        if !strength.is_finite() || strength.min_element() < 0.0 {
            return Err(format!(
                "light {} has a strength of {strength}; expected finite numbers, 0 or more",
                index.value()
            ));
        }
        // A light without strength is left out, so that raycl adds its own lights if no light of the file
        // shines.
        if strength == DVec3::ZERO {
            self.left_out.dark += 1;
            return Ok(());
        }
        self.left_out.ranges += usize::from(light.range.is_some());
        let position = transform.transform_point3(DVec3::ZERO);
        self.lights.push(match light.type_ {
            Checked::Valid(punctual::Type::Directional) => {
                let direction = transform.transform_vector3(DVec3::NEG_Z);
                self.left_out.flat_lights += usize::from(direction.try_normalize().is_none());
                FileLight::direction(direction, strength)
            }
            other => {
                self.left_out.spots += usize::from(other == Checked::Valid(punctual::Type::Spot));
                self.left_out.odd_lights += usize::from(other == Checked::Invalid);
                FileLight::point(position, strength)
            }
        });
        Ok(())
    }

    /// Returns true if the file's first camera and the file's lights, scaled like the mesh, are within
    /// raycl's limits. If the result is false, the mesh is not scaled. If scaling moves a camera beyond
    /// the limits, the camera is at least 1e11 radii of the mesh away, so the mesh covers less than a pixel.
    pub(super) fn seen_fits(&self, placement: &Placement) -> bool {
        let camera = self.cameras.first().map(|camera| camera.placed_by(placement));
        camera.is_none_or(|camera| validate::check_camera(&camera).is_ok())
            && self.lights.iter().all(|light| light.placed_by(placement).is_valid())
    }

    /// Returns the notes that are shown if the picture is seen from the file's first camera.
    pub(super) fn camera_notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let cameras = self.cameras.len();
        notes.extend((cameras > 1).then(|| format!("of {cameras} cameras, the first is used")));
        if let Some(first) = self.cameras.first() {
            let FileCamera { position: eye, camera, lens, .. } = first;
            notes.extend(first.notes());
            let depth = |position: &DVec3| (*position - *eye).dot(camera.forward.as_dvec3());
            let corners =
                |triangle: &Triangle| triangle.positions.map(|index| self.positions[index as usize]);
            let visible = || self.triangles.iter().map(corners).filter(are_apart).flatten();
            let is_beyond = |end: f32| visible().any(|position| depth(&position) > f64::from(end));
            let unseen =
                "the file's camera sees no part of the mesh: --azimuth 31 uses raycl's own camera instead";
            notes.extend((!is_beyond(camera.z_near)).then(|| unseen.to_owned()));
            let note = |far| format!("the camera's zfar of {far} is not used: surfaces beyond it are drawn");
            notes.extend(lens.zfar.filter(|far| is_beyond(*far)).map(note));
        }
        notes
    }
}

/// Returns true if a transform makes axes that are perpendicular not perpendicular.
fn is_skewed(transform: &DMat4) -> bool {
    let [x, y, z] = DVec3::AXES.map(|axis| transform.transform_vector3(axis).normalize_or_zero());
    [x.dot(y), y.dot(z), z.dot(x)].iter().any(|cosine| cosine.abs() > 1e-3)
}

/// Returns the lights of the file.
pub(super) fn lights_of(root: &Root) -> &[punctual::Light] {
    let lights = root.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
    lights.map_or(&[], |lights| &lights.lights)
}

/// Returns the index of a node's light; `None` if the node has none.
pub(super) fn light_of(node: &Node) -> Option<Index<punctual::Light>> {
    node.extensions.as_ref()?.khr_lights_punctual.as_ref().map(|named| named.light)
}
