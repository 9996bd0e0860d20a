//! Joins equal positions, because generated normals can be smooth only where faces share positions. In STL files, and
//! in some OBJ and PLY files, each face has positions of its own.

use crate::scene::mesh::{Mesh, PARALLEL_TRIANGLES, Triangle};
use crate::scene::normals::MISSING;
use rayon::prelude::*;
use std::ops::Add;

/// The key of an element, by which elements are sorted, and the element's index.
pub(super) type Sorted<K> = (K, u32);

/// Returns the key by which equal positions are sorted and joined; `bits` returns the bits of a coordinate.
pub(super) fn key<T: Add<Output = T> + Default, B>(position: [T; 3], bits: impl Fn(T) -> B) -> [B; 3] {
    // Adding zero makes -0 and 0 equal.
    position.map(|x| bits(x + T::default()))
}

/// Joins elements with equal keys. Returns the distinct elements. Also returns, for each element of `all`, the index of
/// its equal among the distinct elements.
pub(super) fn joined<T: Copy, K: Ord + Send>(all: &[T], key: impl Fn(&T) -> K) -> (Vec<T>, Vec<u32>) {
    let mut order: Vec<Sorted<K>> = all.iter().map(key).zip(0..).collect();
    order.par_sort_unstable();
    let is_same = |a: &Sorted<K>, b: &Sorted<K>| a.0 == b.0;
    // The list of distinct elements is created with its final size, since a list that grows takes up to three
    // times the memory.
    let mut distinct = Vec::with_capacity(order.chunk_by(is_same).count());
    let mut numbers = vec![0; all.len()];
    for same in order.chunk_by(is_same) {
        same.iter().for_each(|(_, index)| numbers[*index as usize] = distinct.len() as u32);
        distinct.push(all[same[0].1 as usize]);
    }
    (distinct, numbers)
}

/// Joins the equal positions of a mesh if normals will be generated for it, and if it has more positions than
/// triangles. A closed mesh whose triangles share their positions has about half as many positions as
/// triangles. The comparison therefore finds the meshes whose faces share hardly any positions. Reading all
/// other meshes takes no longer than without the joining. Colours and texture coordinates belong to the corners
/// of triangles, so they do not change. Returns the number of positions that were removed.
pub(super) fn join_positions(mesh: &mut Mesh) -> usize {
    let lacks_normal = |triangle: &Triangle| triangle.normals.contains(&MISSING);
    if mesh.positions.len() <= mesh.triangles.len() || !mesh.triangles.iter().any(lacks_normal) {
        return 0;
    }
    let (positions, numbers) = joined(&mesh.positions, |position| key(position.to_array(), f32::to_bits));
    let fewer = mesh.positions.len() - positions.len();
    if fewer == 0 {
        return 0;
    }
    mesh.positions = positions;
    let triangles = mesh.triangles.par_iter_mut().with_min_len(PARALLEL_TRIANGLES);
    triangles.for_each(|triangle| triangle.positions = triangle.positions.map(|old| numbers[old as usize]));
    fewer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::normals;
    use glam::Vec3;

    /// Returns an octahedron without normals whose faces share no positions. In some positions, 0 is written as -0.
    fn octahedron() -> Mesh {
        octahedron_of([Vec3::X, Vec3::Y, Vec3::Z])
    }

    /// Returns an octahedron without normals whose faces share no positions. Its corners are the ends of `axes`, in
    /// both directions from the origin.
    fn octahedron_of(axes: [Vec3; 3]) -> Mesh {
        let mut mesh = Mesh::default();
        for [x, y, z] in [0, 1, 2, 3, 4, 5, 6, 7].map(|face| [1, 2, 4].map(|bit| face & bit != 0)) {
            let corner = |axis: Vec3, is_negative: bool| if is_negative { -axis } else { axis };
            let [a, b, c] = [corner(axes[0], x), corner(axes[1], y), corner(axes[2], z)];
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([a, b, c].map(|corner| if x { corner + Vec3::ZERO } else { corner }));
            let positions =
                if x ^ y ^ z { [first, first + 2, first + 1] } else { [first, first + 1, first + 2] };
            mesh.triangles.push(Triangle { positions, normals: [MISSING; 3], material: 0 });
        }
        mesh
    }

    #[test]
    fn faces_with_positions_of_their_own_become_smooth() {
        let (apart, mut mesh) = (octahedron(), octahedron());
        assert_eq!((join_positions(&mut mesh), mesh.positions.len()), (18, 6));
        for (own, shared) in apart.triangles.iter().zip(&mesh.triangles) {
            assert_eq!(apart.corners(own), mesh.corners(shared));
        }
        normals::complete(&mut mesh, None);
        for triangle in &mesh.triangles {
            let mut pairs = mesh.corners(triangle).into_iter().zip(mesh.corner_normals(triangle));
            assert!(pairs.all(|(corner, normal)| corner.distance(normal) < 1e-6));
        }
    }

    /// The normals at a position cancel each other, except for rounding errors.
    #[test]
    fn both_sides_of_a_sheet_have_the_normals_of_their_faces() {
        let axes = [[0.9, 0.1, -0.03], [-0.2, 1.1, 0.07], [0.011, -0.3, 0.7]].map(Vec3::from_array);
        let [mut mesh, mut back] = [(); 2].map(|()| octahedron_of(axes));
        back.triangles.iter_mut().for_each(|triangle| triangle.positions.swap(1, 2));
        mesh.append(back);
        join_positions(&mut mesh);
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (6, 16));
        normals::complete(&mut mesh, None);
        for triangle in &mesh.triangles {
            let [a, b, c] = mesh.corners(triangle);
            let face = (b - a).cross(c - a).normalize();
            assert!(mesh.corner_normals(triangle).iter().all(|normal| normal.distance(face) < 1e-6));
        }
    }

    #[test]
    fn a_mesh_that_has_normals_or_shares_its_positions_does_not_change() {
        let mut with_normals = octahedron();
        with_normals.normals = vec![Vec3::Z];
        with_normals.triangles.iter_mut().for_each(|triangle| triangle.normals = [0; 3]);
        // This mesh has as many triangles as positions.
        let mut shared = octahedron();
        shared.triangles = [&shared.triangles[..]; 3].concat();
        // No two positions of this triangle are equal.
        let triangle = Triangle { positions: [0, 1, 2], normals: [MISSING; 3], material: 0 };
        let positions = vec![Vec3::Z, Vec3::X, Vec3::Y];
        let distinct = Mesh { positions, triangles: vec![triangle], ..Mesh::default() };
        for mesh in [with_normals, shared, distinct] {
            let mut read = mesh.clone();
            assert_eq!(join_positions(&mut read), 0);
            assert_eq!(read, mesh);
        }
    }
}
