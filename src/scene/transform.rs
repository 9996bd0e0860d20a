//! The transform of an object: scale, then rotate, then translate.

use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// A normal counts as a unit vector if its length differs from 1 by at most `UNIT_TOLERANCE`. Rounding to single
/// precision changes the length of a unit vector by less than this tolerance.
const UNIT_TOLERANCE: f64 = 1e-6;

/// A scale along the object's axes, then rotations about x, y and z (in this order), then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    /// The scale. No component is zero, and a negative component mirrors the object.
    pub scale: Vec3,
    /// Rotation angles about x, y and z.
    pub rotation_degrees: Vec3,
    /// The translation, in the scene's units.
    pub translation: DVec3,
}

impl Transform {
    /// The transform that changes nothing.
    pub const IDENTITY: Self =
        Self { scale: Vec3::ONE, rotation_degrees: Vec3::ZERO, translation: DVec3::ZERO };

    /// Transforms a mesh's normals and positions. `from` is the vector that was subtracted from the positions
    /// when the file was read. The vector `from` is added again before the scale is applied. The transformed
    /// positions are relative to `to`.
    pub fn apply(&self, mesh: &mut Mesh, from: DVec3, to: DVec3) {
        // An untransformed mesh stays the same bit for bit, so that the paper's scenes keep their exact
        // coordinates.
        if *self == Self::IDENTITY && from == DVec3::ZERO && to == DVec3::ZERO {
            return;
        }
        let (rotation, scale) = (self.rotation(), self.scale.as_dvec3());
        let placed = self.placing(from, to);
        let transform = |p: &mut Vec3| *p = placed(*p).as_vec3();
        mesh.positions.par_iter_mut().with_min_len(PARALLEL_TRIANGLES).for_each(transform);
        // Normals are transformed by the inverse transpose of the matrix. The inverse scale is multiplied by
        // the smallest scale, so that its components are within -1 and 1. This factor does not change the direction of
        // the transformed normal. The transformed normal gets the length that the normal had before, because a longer
        // normal has more weight in the interpolation.
        let inverse = scale.abs().min_element() / scale;
        let turn = |n: &mut Vec3| {
            let turned: DVec3 = rotation * (n.as_dvec3() * inverse);
            *n = (turned.normalize_or(DVec3::Z) * weight(*n)).as_vec3();
        };
        mesh.normals.par_iter_mut().with_min_len(PARALLEL_TRIANGLES).for_each(turn);
        if scale.x * scale.y * scale.z < 0.0 {
            mesh.triangles.par_iter_mut().with_min_len(PARALLEL_TRIANGLES).for_each(|triangle| {
                // Mirroring reverses a triangle's winding.
                triangle.positions.swap(1, 2);
                triangle.normals.swap(1, 2);
            });
            mesh.textures.mirror();
            mesh.corner_colours.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
    }

    /// Returns a function that transforms a position of a mesh as [`Self::apply`] does, in double precision.
    pub fn placing(&self, from: DVec3, to: DVec3) -> impl Fn(Vec3) -> DVec3 {
        let rotation = self.rotation();
        move |position| self.position(rotation, position.as_dvec3() + from) - to
    }

    fn rotation(&self) -> DMat3 {
        let [x, y, z] = self.rotation_degrees.as_dvec3().to_array().map(f64::to_radians);
        DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x)
    }

    fn position(&self, rotation: DMat3, position: DVec3) -> DVec3 {
        rotation * (position * self.scale.as_dvec3()) + self.translation
    }

    /// Returns the bounds of a transformed box: the least and the greatest value of each coordinate in this box.
    pub fn bounds(&self, (low, high): (DVec3, DVec3)) -> (DVec3, DVec3) {
        let rotation = self.rotation();
        let corner = |number: u8| {
            let is_high = glam::BVec3::new(number & 1 != 0, number & 2 != 0, number & 4 != 0);
            let corner = self.position(rotation, DVec3::select(is_high, high, low));
            (corner, corner)
        };
        let join = |(a, b): (DVec3, DVec3), (c, d): (DVec3, DVec3)| (a.min(c), b.max(d));
        (1..8).map(corner).fold(corner(0), join)
    }
}

/// Returns a normal's length. If the length differs from 1 only by rounding to single precision, returns exactly 1.
fn weight(normal: Vec3) -> f64 {
    let length = normal.as_dvec3().length();
    if (length - 1.0).abs() <= UNIT_TOLERANCE { 1.0 } else { length }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mapped, Shape, Textures, generate};

    #[test]
    fn normals_keep_their_lengths_and_unit_normals_their_exact_direction() {
        let mut mesh = generate(&Shape::Ground);
        let unit = DVec3::new(1.0, 2.0, 3.0).normalize().as_vec3();
        let given = [unit, Vec3::Y * 3.0, Vec3::new(0.3, 0.0, 0.4)];
        mesh.normals = given.to_vec();
        Transform { translation: DVec3::X * 1e-6, ..Transform::IDENTITY }.apply(
            &mut mesh,
            DVec3::ZERO,
            DVec3::ZERO,
        );
        assert_eq!(mesh.normals[0], unit.as_dvec3().normalize().as_vec3());
        assert!(
            mesh.normals.iter().zip(given).all(|(n, given)| n.distance(given) < 1e-6),
            "{:?}",
            mesh.normals
        );
        let turned = Vec3::new(0.0, 0.0, 90.0);
        let transform =
            Transform { scale: Vec3::splat(5.0), rotation_degrees: turned, ..Transform::IDENTITY };
        transform.apply(&mut mesh, DVec3::ZERO, DVec3::ZERO);
        assert!(mesh.normals[1].distance(Vec3::NEG_X * 3.0) < 1e-6, "{:?}", mesh.normals);
        assert!(
            (mesh.normals[0].length() - 1.0).abs() < 1e-7 && (mesh.normals[2].length() - 0.5).abs() < 1e-7
        );
    }

    #[test]
    fn rotation_is_about_x_then_y_then_z() {
        let mut mesh = generate(&Shape::Ground);
        mesh.positions = vec![Vec3::Y];
        mesh.normals = vec![Vec3::Y];
        let quarter = Vec3::new(90.0, 90.0, 0.0);
        let transform =
            Transform { scale: Vec3::splat(2.0), rotation_degrees: quarter, translation: DVec3::ONE };
        transform.apply(&mut mesh, DVec3::ZERO, DVec3::ZERO);
        // The rotation about x turns y to z, and the rotation about y turns z to x.
        assert!(mesh.positions[0].distance(Vec3::new(3.0, 1.0, 1.0)) < 1e-6);
        assert!(mesh.normals[0].distance(Vec3::X) < 1e-6);
    }

    /// Mirroring swaps two corners of each triangle, with their normals and texture coordinates.
    #[test]
    fn the_corners_of_a_mirrored_mesh_keep_their_normals_and_texture_coordinates() {
        let mut mesh = generate(&Shape::Sphere { triangles: 8 });
        let mapped = [Mapped { corners: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], ..Mapped::NONE }];
        mesh.textures = Textures { list: Vec::new(), mapped: mapped.repeat(mesh.triangles.len()) };
        let corners = |mesh: &Mesh| {
            let triangles = mesh.triangles.iter().zip(&mesh.textures.mapped);
            let all = triangles.map(|(triangle, row)| (triangle.positions, triangle.normals, row.corners));
            all.collect::<Vec<_>>()
        };
        let before = corners(&mesh);
        // Mirroring along two axes is a rotation.
        let scale = Vec3::new(-1.0, -2.0, 3.0);
        Transform { scale, ..Transform::IDENTITY }.apply(&mut mesh, DVec3::ZERO, DVec3::ZERO);
        assert_eq!(corners(&mesh), before);
        let scale = Vec3::new(-1.0, 2.0, 3.0);
        Transform { scale, ..Transform::IDENTITY }.apply(&mut mesh, DVec3::ZERO, DVec3::ZERO);
        for (before, after) in before.into_iter().zip(corners(&mesh)) {
            let ([a, b, c], [d, e, f], [g, h, i]) = before;
            assert_eq!(after, ([a, c, b], [d, f, e], [g, i, h]));
        }
    }

    #[test]
    fn a_squeezed_and_mirrored_sphere_keeps_its_normals_outside() {
        let mut mesh = generate(&Shape::Sphere { triangles: 400 });
        let scale = Vec3::new(-3.0, 0.5, 1.0);
        Transform { scale, ..Transform::IDENTITY }.apply(&mut mesh, DVec3::ZERO, DVec3::ZERO);
        for triangle in &mesh.triangles {
            let [a, b, c] = mesh.corners(triangle);
            let face = (b - a).cross(c - a);
            assert!(mesh.corner_normals(triangle).iter().all(|n| n.dot(face) > 0.0));
            assert!(face.dot(a + b + c) > 0.0);
        }
    }
}
