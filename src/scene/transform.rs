//! The transform of an object: scale, then rotate, then translate.

use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// A scale along the object's axes, then rotations about x, y and z (in this order), then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    /// The scale; no component is zero, and a negative component mirrors.
    pub scale: Vec3,
    /// Rotation angles about x, y and z.
    pub rotation_degrees: Vec3,
    /// The translation, in the scene's units.
    pub translation: Vec3,
}

impl Transform {
    /// The transform that changes nothing.
    pub const IDENTITY: Self =
        Self { scale: Vec3::ONE, rotation_degrees: Vec3::ZERO, translation: Vec3::ZERO };

    /// Transforms a mesh's normals and positions. `origin` is the vector that was subtracted from the positions when
    /// the file was read; it is added again before the positions are transformed.
    pub fn apply(&self, mesh: &mut Mesh, origin: DVec3) {
        // An untransformed mesh stays the same bit for bit, so that the paper's scenes keep their exact coordinates.
        if *self == Self::IDENTITY && origin == DVec3::ZERO {
            return;
        }
        let [x, y, z] = self.rotation_degrees.as_dvec3().to_array().map(f64::to_radians);
        let rotation = DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x);
        let (scale, translation) = (self.scale.as_dvec3(), self.translation.as_dvec3());
        let place =
            |p: &mut Vec3| *p = (rotation * ((p.as_dvec3() + origin) * scale) + translation).as_vec3();
        mesh.positions.par_iter_mut().with_min_len(PARALLEL_TRIANGLES).for_each(place);
        // Normals are transformed by the inverse transpose, times a factor that keeps its elements within -1 and 1. The
        // factor does not change the normalised result.
        let inverse = scale.abs().min_element() / scale;
        let turn = |n: &mut Vec3| {
            let turned: DVec3 = rotation * (n.as_dvec3() * inverse);
            *n = turned.normalize_or(DVec3::Z).as_vec3();
        };
        mesh.normals.par_iter_mut().with_min_len(PARALLEL_TRIANGLES).for_each(turn);
        if scale.x * scale.y * scale.z < 0.0 {
            mesh.triangles.par_iter_mut().with_min_len(PARALLEL_TRIANGLES).for_each(|triangle| {
                // Mirroring reverses a triangle's winding.
                triangle.positions.swap(1, 2);
                triangle.normals.swap(1, 2);
            });
            mesh.textures.mirror();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Shape, generate};

    #[test]
    fn rotation_is_about_x_then_y_then_z() {
        let mut mesh = generate(&Shape::Ground);
        mesh.positions = vec![Vec3::Y];
        mesh.normals = vec![Vec3::Y];
        let quarter = Vec3::new(90.0, 90.0, 0.0);
        let transform =
            Transform { scale: Vec3::splat(2.0), rotation_degrees: quarter, translation: Vec3::ONE };
        transform.apply(&mut mesh, DVec3::ZERO);
        // The rotation about x turns y to z, and z to -y.
        assert!(mesh.positions[0].distance(Vec3::new(3.0, 1.0, 1.0)) < 1e-6);
        assert!(mesh.normals[0].distance(Vec3::X) < 1e-6);
    }

    #[test]
    fn a_squeezed_and_mirrored_sphere_keeps_its_normals_outside() {
        let mut mesh = generate(&Shape::Sphere { triangles: 400 });
        let scale = Vec3::new(-3.0, 0.5, 1.0);
        Transform { scale, ..Transform::IDENTITY }.apply(&mut mesh, DVec3::ZERO);
        for triangle in &mesh.triangles {
            let [a, b, c] = mesh.corners(triangle);
            let face = (b - a).cross(c - a);
            assert!(mesh.corner_normals(triangle).iter().all(|n| n.dot(face) > 0.0));
            assert!(face.dot(a + b + c) > 0.0);
        }
    }
}
