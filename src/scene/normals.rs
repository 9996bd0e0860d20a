//! Generates normals for meshes without normals, and replaces invalid normals.

mod creases;

use super::mesh::{Mesh, PARALLEL_TRIANGLES, Triangle};
use glam::{DVec3, DVec4, Vec3};
use rayon::prelude::*;

/// A placeholder in `Triangle::normals` for a normal that is still to be generated.
pub(super) const MISSING: u32 = u32::MAX;

/// The largest number of threads that add the normals of triangles at their positions. More threads would
/// gain little, because each reads all triangles.
const MOST_READERS: usize = 16;

/// A sum of plane normals counts as a rounding error if it is very short: if its length, divided by the root of the sum
/// of the normals' squared lengths, is at most `CANCELLED`.
const CANCELLED: f64 = 1e-9;

/// Gives every corner a finite normal that is not zero. Generated normals are smooth, except at creases:
/// edges whose faces' normals differ by more than `crease_degrees`. If `crease_degrees` is `None`, there are
/// no creases. Returns true if normals were generated.
pub(super) fn complete(mesh: &mut Mesh, crease_degrees: Option<f32>) -> bool {
    let triangles = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).enumerate();
    let without: Vec<u32> = triangles
        .filter(|(_, triangle)| triangle.normals.contains(&MISSING))
        .map(|(number, _)| number as u32)
        .collect();
    if !without.is_empty() {
        generate(mesh);
        if let Some(degrees) = crease_degrees {
            creases::sharpen(mesh, &without, degrees);
        }
    }
    mesh.normals.par_iter_mut().with_min_len(PARALLEL_TRIANGLES).for_each(|normal| *normal = tame(*normal));
    replace_zero(mesh);
    !without.is_empty()
}

/// Replaces all normals: each triangle gets the normal of its plane at all corners.
pub(super) fn flatten(mesh: &mut Mesh) {
    mesh.normals = mesh.triangles.iter().map(|triangle| face_normal(mesh, triangle)).collect();
    for (index, triangle) in (0..).zip(&mut mesh.triangles) {
        triangle.normals = [index; 3];
    }
}

/// Reverses the normals of every triangle whose front (the side to which its normals point) faces away from
/// `eye`. If the normals were not reversed, lights on the eye's side would leave the visible side of such a
/// triangle dark. All normals of a triangle are reversed together, since reversing only some of them
/// would disturb the shading along outlines.
pub(super) fn turn_towards(mesh: &mut Mesh, eye: Vec3) {
    let eye = eye.as_dvec3();
    let turned = |triangle: &Triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        let shading: DVec3 = mesh.corner_normals(triangle).iter().map(|n| n.as_dvec3()).sum();
        let face = (b - a).cross(c - a);
        let front = if face.dot(shading) < 0.0 { -face } else { face };
        front.dot(eye - a) < 0.0
    };
    let triangles = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES);
    let turned: Vec<bool> = triangles.map(turned).collect();
    if !turned.contains(&true) {
        return;
    }
    reverse_normals_of(mesh, &turned);
}

/// Reverses the normals of the triangles for which `turned` is true. Triangles for which `turned` is false
/// may have the same normals, so the original normals stay unchanged, and reversed copies are appended.
fn reverse_normals_of(mesh: &mut Mesh, turned: &[bool]) {
    // For each normal, the index of its reversed copy, or MISSING if there is no copy.
    let mut copies = vec![MISSING; mesh.normals.len()];
    for (triangle, _) in mesh.triangles.iter_mut().zip(turned).filter(|(_, turned)| **turned) {
        triangle.normals = triangle.normals.map(|index| {
            let copy = &mut copies[index as usize];
            if *copy == MISSING {
                *copy = mesh.normals.len() as u32;
                mesh.normals.push(-mesh.normals[index as usize]);
            }
            *copy
        });
    }
}

/// Reverses all normals of a mesh whose surface mostly faces inwards. Each triangle forms a tetrahedron with
/// the centre of the bounding box. The tetrahedron's volume counts as negative if the triangle's normals
/// point to the centre. The surface mostly faces inwards if the sum of all volumes is negative.
pub(super) fn turn_outwards(mesh: &mut Mesh) {
    let centre = mesh.bounds().map_or(DVec3::ZERO, |(low, high)| (low.as_dvec3() + high.as_dvec3()) / 2.0);
    let outwards = |triangle: &Triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3() - centre);
        let shading: DVec3 = mesh.corner_normals(triangle).iter().map(|n| n.as_dvec3()).sum();
        let volume = a.dot(b.cross(c)).abs();
        if shading.dot(a + b + c) < 0.0 { -volume } else { volume }
    };
    let triangles = mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES);
    if triangles.map(outwards).sum::<f64>() < 0.0 {
        reverse(mesh);
    }
}

/// Reverses all normals of a mesh.
pub(super) fn reverse(mesh: &mut Mesh) {
    mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
}

/// Adds one normal per position, and assigns these normals to all corners of each triangle that lacks a normal.
/// The normal of a position has the direction of the mean, weighted by area, of the plane normals of those
/// triangles at this position that lack a normal. If these plane normals cancel each other, the normal is zero.
fn generate(mesh: &mut Mesh) {
    let sums = sums_at_positions(mesh);
    let base = mesh.normals.len() as u32;
    let triangles = mesh.triangles.par_iter_mut().with_min_len(PARALLEL_TRIANGLES);
    triangles
        .filter(|triangle| triangle.normals.contains(&MISSING))
        .for_each(|triangle| triangle.normals = triangle.positions.map(|index| base + index));
    mesh.normals.par_extend(sums.into_par_iter().map(direction));
}

/// Returns a plane normal, whose length is twice the triangle's area, as a summand for [`direction`]: the fourth
/// component is the square of the normal's length.
fn summand(normal: DVec3) -> DVec4 {
    normal.extend(normal.length_squared())
}

/// Returns the direction of a sum of [`summand`]s; zero if the plane normals cancel each other. If a sheet has two
/// sides at the same positions, their normals cancel each other except for rounding errors, whose direction is
/// arbitrary.
fn direction(sum: DVec4) -> Vec3 {
    let normal = sum.truncate();
    let is_rounding = normal.length_squared() <= CANCELLED * CANCELLED * sum.w;
    if is_rounding { Vec3::ZERO } else { normal.normalize_or_zero().as_vec3() }
}

/// Returns, for each position, the sum of the plane normals of the triangles at this position that lack a
/// normal. Each plane normal is a [`summand`].
fn sums_at_positions(mesh: &Mesh) -> Vec<DVec4> {
    // The sums are f64: in f32, the cross product of very short edges could round to zero.
    let mut sums = vec![DVec4::ZERO; mesh.positions.len()];
    // Each thread computes the sums of a part of the positions, and reads all triangles. The summands of a
    // position are added by one thread, in the triangles' order, so the sums do not depend on the number of
    // threads.
    let threads = rayon::current_num_threads().min(MOST_READERS);
    let part = mesh.positions.len().div_ceil(threads).max(PARALLEL_TRIANGLES);
    sums.par_chunks_mut(part).enumerate().for_each(|(number, sums)| {
        let first = number * part;
        for triangle in mesh.triangles.iter().filter(|triangle| triangle.normals.contains(&MISSING)) {
            // `sums` has the sums of only a part of the positions. The index of a position before this part
            // wraps around to a large index, which lies outside `sums`.
            let indices = triangle.positions.map(|index| (index as usize).wrapping_sub(first));
            if indices.iter().all(|index| *index >= sums.len()) {
                continue;
            }
            let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
            let normal = summand((b - a).cross(c - a));
            for index in indices {
                if let Some(sum) = sums.get_mut(index) {
                    *sum += normal;
                }
            }
        }
    });
    sums
}

/// Returns the normal unchanged if later products of its squared length stay in the range of f32. If the
/// squared length is too small or too large for such products, returns the normal with the length 1, or zero
/// if the normal cannot be normalised.
fn tame(normal: Vec3) -> Vec3 {
    if (1e-12..1e12).contains(&normal.length_squared()) {
        return normal;
    }
    normal.as_dvec3().normalize_or_zero().as_vec3()
}

/// Replaces each zero normal at a triangle's corner by the normal of the triangle's plane.
fn replace_zero(mesh: &mut Mesh) {
    if !mesh.normals.contains(&Vec3::ZERO) {
        return;
    }
    let mut triangles = std::mem::take(&mut mesh.triangles);
    for triangle in &mut triangles {
        let zero = triangle.normals.map(|index| mesh.normals[index as usize] == Vec3::ZERO);
        if !zero.contains(&true) {
            continue;
        }
        let face = mesh.normals.len() as u32;
        mesh.normals.push(face_normal(mesh, triangle));
        for (normal, _) in triangle.normals.iter_mut().zip(zero).filter(|(_, zero)| *zero) {
            *normal = face;
        }
    }
    mesh.triangles = triangles;
    // The normals that are still zero belong to no triangle.
    mesh.normals.iter_mut().filter(|normal| **normal == Vec3::ZERO).for_each(|normal| *normal = Vec3::Z);
}

/// Returns the unit normal of a triangle's plane; the z axis if the triangle has no area.
fn face_normal(mesh: &Mesh, triangle: &Triangle) -> Vec3 {
    let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
    (b - a).cross(c - a).try_normalize().unwrap_or(DVec3::Z).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Shape, generate};

    fn triangle(positions: [Vec3; 3], normals: Vec<Vec3>, indices: [u32; 3]) -> Mesh {
        let triangle = Triangle { positions: [0, 1, 2], normals: indices, material: 0 };
        let materials = vec![Material::default()];
        Mesh {
            positions: positions.to_vec(),
            normals,
            triangles: vec![triangle],
            materials,
            ..Mesh::default()
        }
    }

    #[test]
    fn a_missing_or_zero_normal_becomes_the_faces() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for (normals, indices) in [(vec![], [MISSING; 3]), (vec![Vec3::ZERO, Vec3::X], [0, 0, 1])] {
            let mut mesh = triangle(corners, normals, indices);
            complete(&mut mesh, None);
            assert_eq!(mesh.corner_normals(&mesh.triangles[0])[0], Vec3::Z);
        }
    }

    #[test]
    fn triangles_without_area_get_a_unit_normal() {
        for corners in [[Vec3::ONE; 3], [Vec3::ZERO, Vec3::X, Vec3::X * 2.0]] {
            let mut mesh = triangle(corners, vec![], [MISSING; 3]);
            complete(&mut mesh, None);
            assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-6));
        }
    }

    #[test]
    fn normals_of_any_size_stay_within_f32() {
        let mut mesh =
            triangle([Vec3::ZERO, Vec3::X, Vec3::Y], vec![Vec3::Z * 1e38, Vec3::X * 1e-40], [0, 1, 0]);
        complete(&mut mesh, None);
        assert_eq!(mesh.normals, [Vec3::Z, Vec3::X]);
    }

    /// Later computations multiply squared lengths of normals, so a normal's squared length decides whether
    /// the normal gets the length 1.
    #[test]
    fn a_normal_gets_the_length_1_if_its_squared_length_is_extreme() {
        for (length, expected) in [(1e-7_f32, 1.0_f32), (1e-5, 1e-5), (1e5, 1e5), (1e7, 1.0)] {
            assert_eq!(tame(Vec3::X * length), Vec3::X * expected, "{length:e}");
        }
    }

    #[test]
    fn sums_at_positions_are_those_of_one_thread() {
        use rand::{RngExt as _, SeedableRng as _};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut mesh = Mesh::default();
        mesh.positions.resize_with(50_000, || Vec3::from_array(rng.random()));
        mesh.triangles.resize_with(100_000, || Triangle {
            positions: [(); 3].map(|()| rng.random_range(0..50_000)),
            normals: if rng.random_range(0..4) == 0 { [0; 3] } else { [MISSING; 3] },
            material: 0,
        });
        let mut expected = vec![DVec4::ZERO; 50_000];
        for triangle in mesh.triangles.iter().filter(|triangle| triangle.normals == [MISSING; 3]) {
            let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
            let normal = summand((b - a).cross(c - a));
            triangle.positions.iter().for_each(|&at| expected[at as usize] += normal);
        }
        for threads in [1, 2, 3, 40] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert!(pool.install(|| sums_at_positions(&mesh)) == expected, "{threads} threads");
        }
    }

    #[test]
    fn an_inward_sphere_is_turned_to_the_viewer() {
        let mut mesh = generate(&Shape::Sphere { triangles: 400 });
        mesh.triangles.iter_mut().for_each(|t| t.positions.swap(1, 2));
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
        let eye = Vec3::new(0.0, 0.0, 10.0);
        turn_towards(&mut mesh, eye);
        let front = mesh.triangles.iter().filter(|t| mesh.corners(t).iter().all(|p| p.z > 0.5));
        for triangle in front {
            assert!(mesh.corner_normals(triangle).iter().all(|n| n.z > 0.0));
        }
    }

    #[test]
    fn a_normal_is_copied_once_and_only_if_a_turned_triangle_has_it() {
        // Three triangles share the first two normals.
        let normals = [0.0, 0.1, 0.2, 0.3, 0.4].map(|x| Vec3::new(x, 0.0, 1.0));
        let triangle = |index: u32| Triangle { positions: [0; 3], normals: [0, 1, index], material: 0 };
        let mut mesh =
            Mesh { normals: normals.to_vec(), triangles: (2..5).map(triangle).collect(), ..Mesh::default() };
        reverse_normals_of(&mut mesh, &[false, false, true]);
        let indices: Vec<_> = mesh.triangles.iter().map(|triangle| triangle.normals).collect();
        assert_eq!(indices, [[0, 1, 2], [0, 1, 3], [5, 6, 7]]);
        assert_eq!(mesh.normals[5..], [0, 1, 4].map(|index: usize| -normals[index]));
        reverse_normals_of(&mut mesh, &[true, true, false]);
        assert_eq!(mesh.normals.len(), 8 + 4);
    }

    #[test]
    fn the_normals_decide_which_side_of_a_triangle_is_its_front() {
        for corners in [[Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::ZERO, Vec3::Y, Vec3::X]] {
            for eye in [Vec3::Z, Vec3::NEG_Z] {
                let mut mesh = triangle(corners, vec![Vec3::NEG_Z], [0; 3]);
                turn_towards(&mut mesh, eye);
                assert_eq!(mesh.corner_normals(&mesh.triangles[0]), [eye; 3], "{corners:?}");
            }
        }
        // The eye is behind the triangle, although the eye and the triangle are on the same side of the origin.
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner + 5.0 * Vec3::Z);
        let mut mesh = triangle(corners, vec![Vec3::Z], [0; 3]);
        turn_towards(&mut mesh, 3.0 * Vec3::Z);
        assert_eq!(mesh.corner_normals(&mesh.triangles[0]), [Vec3::NEG_Z; 3]);
    }

    #[test]
    fn the_normals_of_a_sphere_are_turned_outwards_whichever_way_it_winds() {
        let outward = generate(&Shape::Sphere { triangles: 400 });
        let mut inward = outward.clone();
        inward.triangles.iter_mut().for_each(|t| t.positions.swap(1, 2));
        for sign in [1.0_f32, -1.0] {
            for (winding, sphere) in [("outward", &outward), ("inward", &inward)] {
                let mut mesh = sphere.clone();
                mesh.normals.iter_mut().for_each(|n| *n *= sign);
                turn_outwards(&mut mesh);
                for triangle in &mesh.triangles {
                    let normals = mesh.corner_normals(triangle);
                    let outwards = mesh.corners(triangle).iter().zip(normals).all(|(p, n)| p.dot(n) > 0.0);
                    assert!(outwards, "{winding}, {sign}: {normals:?}");
                }
            }
        }
    }

    #[test]
    fn a_zero_normal_becomes_that_of_its_face() {
        let mut mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::ZERO, Vec3::new(0.6, 0.8, 0.0)],
            triangles: vec![Triangle { positions: [0, 1, 2], normals: [0, 1, 0], material: 0 }],
            ..Mesh::default()
        };
        replace_zero(&mut mesh);
        let normals = mesh.corner_normals(&mesh.triangles[0]);
        assert_eq!(normals, [Vec3::X, Vec3::new(0.6, 0.8, 0.0), Vec3::X]);
        assert!(!mesh.normals.contains(&Vec3::ZERO));
    }

    /// The centre of the box around a roof is below the roof, wherever the roof lies.
    #[test]
    fn a_roof_is_turned_upwards_at_any_height() {
        let left = [[-1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 1.0, 1.0]];
        let right = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        let upwards = [Vec3::new(-0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, 0.8)];
        let triangles = [0, 1].map(|side| {
            let first = 3 * side;
            Triangle { positions: [first, first + 1, first + 2], normals: [side; 3], material: 0 }
        });
        for height in [-10.0_f32, 0.0, 10.0] {
            for sign in [1.0_f32, -1.0] {
                let lifted = |corner: [f32; 3]| Vec3::from_array(corner) + Vec3::Z * height;
                let mut mesh = Mesh {
                    positions: [left, right].concat().into_iter().map(lifted).collect(),
                    normals: upwards.map(|normal| normal * sign).to_vec(),
                    triangles: triangles.to_vec(),
                    ..Mesh::default()
                };
                turn_outwards(&mut mesh);
                assert_eq!(mesh.normals, upwards, "{height}, {sign}");
            }
        }
    }
}
