//! Shapes of the paper's pictures whose coordinates are published, in the paper or in chapter 15 of the book
//! (Hughes et al., *Computer Graphics*).

use crate::scene::{Material, Mesh, Triangle};
use glam::Vec3;

/// Returns a mesh of flat triangles. `faces` has the corners' indices and the normal of each triangle.
fn flat<const N: usize>(positions: &[Vec3], faces: [([u32; 3], Vec3); N]) -> Mesh {
    let triangles = (0..).zip(&faces).map(|(face, (positions, _))| Triangle {
        positions: *positions,
        normals: [face; 3],
        material: 0,
    });
    Mesh {
        positions: positions.to_vec(),
        triangles: triangles.collect(),
        normals: faces.iter().map(|(_, normal)| *normal).collect(),
        materials: vec![Material::default()],
        ..Mesh::default()
    }
}

/// Returns the plane y = -1 below and in front of the paper's camera.
pub(super) fn ground() -> Mesh {
    let (x, near, far) = (10.0, -0.01, -10.0);
    let corners = [(-x, far), (-x, near), (x, near), (x, far)].map(|(x, z)| Vec3::new(x, -1.0, z));
    let mut mesh = flat(&corners, [([0, 1, 2], Vec3::Y), ([0, 2, 3], Vec3::Y)]);
    mesh.normals.truncate(1);
    mesh.triangles.iter_mut().for_each(|triangle| triangle.normals = [0; 3]);
    mesh
}

/// Returns the pyramid of the paper's Figure 3: the two visible faces with the paper's normals, then the back
/// and the base.
pub(super) fn pyramid() -> Mesh {
    let [apex, front, left, right] =
        [(0.0, 2.0, -3.5), (0.0, -1.0, -2.0), (-2.0, -1.0, -3.0), (2.0, -1.0, -3.0)].map(Vec3::from);
    let back_normal = (left - right).cross(apex - right).normalize();
    flat(
        &[apex, front, left, right],
        [
            ([0, 2, 1], Vec3::new(1.0, 2.0, 1.0)),
            ([0, 1, 3], Vec3::Z),
            ([0, 3, 2], back_normal),
            ([1, 2, 3], Vec3::NEG_Y),
        ],
    )
}
