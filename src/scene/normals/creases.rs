//! Makes creases sharp in a mesh whose normals were generated.

use crate::scene::mesh::{Mesh, PARALLEL_TRIANGLES};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// At a position with more than `MOST_FACES` faces, each face gets the normal of its own plane, since comparing every
/// two of these faces would take too long.
const MOST_FACES: usize = 1024;
/// An edge stays smooth if the angle between its faces' normals exceeds the crease angle by at most `ROUNDING_DEGREES`.
/// Rounding of positions turns faces slightly. Without this tolerance, rounding would decide which edges of a regular
/// prism are sharp if the normals of neighbouring faces differ by exactly the crease angle.
const ROUNDING_DEGREES: f64 = 0.01;

/// A face at a position: its unit normal, and this normal multiplied by twice the face's area.
struct Face {
    unit: DVec3,
    weighted: DVec3,
}

impl Face {
    fn of(mesh: &Mesh, triangle: u32) -> Self {
        let weighted = weighted_normal(mesh, triangle);
        Self { unit: weighted.normalize_or_zero(), weighted }
    }
}

/// Returns the normal of a triangle's plane. The normal's length is twice the triangle's area.
fn weighted_normal(mesh: &Mesh, triangle: u32) -> DVec3 {
    let [a, b, c] = mesh.corners(&mesh.triangles[triangle as usize]).map(|p| p.as_dvec3());
    (b - a).cross(c - a)
}

/// Replaces the smooth normals of the triangles `triangles` at all positions that have a crease: at such a
/// position, the normals of two faces differ by more than the crease angle. Each face at the position gets a
/// separate normal: a mean of face normals, weighted by area. The mean includes the faces at the position
/// whose normals differ from the face's normal by at most the crease angle.
pub(super) fn sharpen(mesh: &mut Mesh, triangles: &[u32], crease_degrees: f32) {
    let crease_degrees = f64::from(crease_degrees.max(0.0)) + ROUNDING_DEGREES;
    // No two normals differ by more than 180 degrees.
    if crease_degrees >= 180.0 {
        return;
    }
    let crease = crease_degrees.to_radians();
    let least_cosine = crease.cos();
    let corners = sharp_corners(mesh, triangles, (crease / 2.0).cos());
    let normals_around = |around: &[(u32, u32)]| {
        let faces: Vec<Face> = around.iter().map(|(_, triangle)| Face::of(mesh, *triangle)).collect();
        let normal = |face| mean(face, &faces, least_cosine).normalize_or_zero().as_vec3();
        faces.iter().map(normal).collect::<Vec<_>>()
    };
    let normals: Vec<Vec3> = corners.par_chunk_by(|a, b| a.0 == b.0).flat_map_iter(normals_around).collect();
    for (index, (position, triangle)) in (mesh.normals.len() as u32..).zip(corners) {
        let triangle = &mut mesh.triangles[triangle as usize];
        for (corner, normal) in triangle.positions.iter().zip(&mut triangle.normals) {
            if *corner == position {
                *normal = index;
            }
        }
    }
    mesh.normals.extend(normals);
}

/// Returns sorted pairs: the index of a position, and the index of a triangle at this position. A position is
/// included only if a face's normal at this position differs from the smooth normal by more than half the
/// crease angle. `least_cosine` is the cosine of half the crease angle. At all other positions, the normals
/// of two faces cannot differ by more than the crease angle.
fn sharp_corners(mesh: &Mesh, triangles: &[u32], least_cosine: f64) -> Vec<(u32, u32)> {
    let parted = |triangle: &u32| {
        let weighted = weighted_normal(mesh, *triangle);
        let length = weighted.length();
        let triangle = &mesh.triangles[*triangle as usize];
        let corners = triangle.positions.into_iter().zip(triangle.normals);
        let cosine = move |normal: u32| mesh.normals[normal as usize].as_dvec3().dot(weighted) / length;
        corners.filter(move |(_, normal)| cosine(*normal) < least_cosine).map(|(position, _)| position)
    };
    let parted: Vec<u32> =
        triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).flat_map_iter(parted).collect();
    if parted.is_empty() {
        return Vec::new();
    }
    let mut sharp = vec![false; mesh.positions.len()];
    parted.iter().for_each(|position| sharp[*position as usize] = true);
    let corners = |triangle: &u32| {
        let positions = mesh.triangles[*triangle as usize].positions.into_iter();
        let triangle = *triangle;
        positions.filter(|position| sharp[*position as usize]).map(move |position| (position, triangle))
    };
    let mut corners: Vec<(u32, u32)> =
        triangles.par_iter().with_min_len(PARALLEL_TRIANGLES).flat_map_iter(corners).collect();
    corners.par_sort_unstable();
    corners
}

fn mean(face: &Face, around: &[Face], least_cosine: f64) -> DVec3 {
    if around.len() > MOST_FACES {
        return face.weighted;
    }
    let near = |other: &&Face| other.unit.dot(face.unit) >= least_cosine;
    around.iter().filter(near).map(|other| other.weighted).sum()
}

#[cfg(test)]
mod tests {
    use super::super::complete;
    use crate::scene::Mesh;
    use crate::scene::material::Material;
    use crate::scene::mesh::Triangle;
    use crate::scene::normals::MISSING;
    use crate::scene::{Shape, generate};
    use glam::{DVec3, Vec3};
    use std::f64::consts::TAU;

    /// Returns a mesh without normals.
    fn bare(positions: Vec<Vec3>, triangles: impl Iterator<Item = [u32; 3]>) -> Mesh {
        let triangle = |positions| Triangle { positions, normals: [MISSING; 3], material: 0 };
        let materials = vec![Material::default()];
        Mesh { positions, triangles: triangles.map(triangle).collect(), materials, ..Mesh::default() }
    }

    /// Returns a cube with eight corners that its faces share.
    fn cube() -> Mesh {
        let bit = |number: u32, bit: u32| if number >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let positions = (0..8).map(|n| Vec3::new(bit(n, 0), bit(n, 1), bit(n, 2))).collect();
        let squares = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let halves = squares.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
        bare(positions, halves)
    }

    /// Returns the side wall of a regular prism whose corners have a distance of `scale` from its axis. The
    /// prism is turned and moved, so that rounding turns each face differently.
    fn wall(sides: u32, scale: f64) -> Mesh {
        let corner = |number: u32, height: f64| {
            let (sin, cos) = (TAU * f64::from(number) / f64::from(sides) + 0.1).sin_cos();
            (scale * DVec3::new(cos, height, sin) + 3.0).as_vec3()
        };
        let positions = (0..sides).flat_map(|number| [-1.0, 1.0].map(|height| corner(number, height)));
        let halves = (0..sides).flat_map(|number| {
            let [a, b] = [2 * number, 2 * ((number + 1) % sides)];
            [[a, b, b + 1], [a, b + 1, a + 1]]
        });
        bare(positions.collect(), halves)
    }

    #[test]
    fn a_cube_has_flat_faces_and_without_creases_round_ones() {
        let (mut flat, mut round) = (cube(), cube());
        complete(&mut flat, Some(40.0));
        complete(&mut round, None);
        for triangle in &flat.triangles {
            let [a, b, c] = flat.corners(triangle);
            let face = (b - a).cross(c - a).normalize();
            assert!(flat.corner_normals(triangle).iter().all(|n| n.distance(face) < 1e-6));
        }
        let corner = round.corner_normals(&round.triangles[0])[0];
        assert!(corner.abs().max_element() < 0.9, "{corner}");
        let mut wide = cube();
        complete(&mut wide, Some(180.0));
        assert!(wide.triangles.iter().zip(&round.triangles).all(|(a, b)| {
            wide.corner_normals(a).iter().zip(round.corner_normals(b)).all(|(a, b)| a.distance(b) < 1e-6)
        }));
    }

    #[test]
    fn an_edge_is_sharp_if_its_faces_meet_at_more_than_the_angle() {
        // The normals of the two faces are 30 degrees to the right and to the left of y.
        let (sin, cos) = 30.0_f32.to_radians().sin_cos();
        let [right, left] = [Vec3::new(cos, -sin, 0.0), Vec3::new(-cos, -sin, 0.0)];
        let triangle = |positions| Triangle { positions, normals: [MISSING; 3], material: 0 };
        let triangles = vec![triangle([0, 1, 2]), triangle([1, 0, 3])];
        let roof = Mesh { triangles, materials: vec![Material::default()], ..Mesh::default() };
        // If the left face is three times as large, its normal counts three times.
        let [alone, leaning] = [(sin, cos), (-2.0 * sin, 4.0 * cos)].map(|(x, y)| Vec3::new(x, y, 0.0));
        for (larger, crease, at_edge) in
            [(1.0_f32, 55.0, alone), (1.0, 65.0, Vec3::Y), (3.0, 65.0, leaning.normalize())]
        {
            let mut mesh = roof.clone();
            mesh.positions = vec![Vec3::NEG_Z, Vec3::Z, right, larger * left];
            complete(&mut mesh, Some(crease));
            let normal = mesh.corner_normals(&mesh.triangles[0])[0];
            assert!(normal.distance(at_edge) < 1e-6, "{larger}, {crease}: {normal}");
        }
    }

    #[test]
    fn rounding_does_not_decide_which_edges_are_sharp() {
        for sides in [8, 9, 12, 36] {
            for scale in [1.0, 3.7, 10.0] {
                // The normals of neighbouring sides of the wall differ by this angle, in degrees.
                let between = 360.0 / sides as f32;
                let [smooth, equal, less] = [None, Some(between), Some(between - 0.1)].map(|crease| {
                    let mut mesh = wall(sides, scale);
                    complete(&mut mesh, crease);
                    mesh
                });
                for number in 0..smooth.triangles.len() {
                    let normals = |mesh: &Mesh| mesh.corner_normals(&mesh.triangles[number]);
                    let is_smooth = (0..3).all(|i| normals(&equal)[i].distance(normals(&smooth)[i]) < 1e-3);
                    assert!(is_smooth, "{sides}, {scale}: an edge is sharp");
                    let [a, b, c] = less.corners(&less.triangles[number]);
                    let face = (b - a).cross(c - a).normalize();
                    let is_flat = normals(&less).iter().all(|normal| normal.distance(face) < 1e-3);
                    assert!(is_flat, "{sides}, {scale}: an edge is smooth");
                }
            }
        }
    }

    #[test]
    fn the_tip_of_a_cone_is_round_although_many_faces_meet_there() {
        // The cone's side slopes by 60 degrees. The normals of opposite faces differ by about 120 degrees, those of
        // neighbours by about 10.
        let sides = 32_u32;
        let ring = (0..sides).map(|number| {
            let (sin, cos) = (TAU * f64::from(number) / f64::from(sides)).sin_cos();
            (DVec3::new(cos, 0.0, sin) / 3.0_f64.sqrt()).as_vec3()
        });
        let positions = std::iter::once(Vec3::Y).chain(ring).collect();
        let mut cone = bare(positions, (0..sides).map(|number| [0, 1 + (number + 1) % sides, 1 + number]));
        complete(&mut cone, Some(40.0));
        for triangle in &cone.triangles {
            let [a, b, c] = cone.corners(triangle);
            let face = (b - a).cross(c - a).normalize();
            let at_tip = cone.corner_normals(triangle)[0];
            // The mean of the normals within 40 degrees points further up than each of them.
            assert!((0.03..0.3).contains(&at_tip.distance(face)), "{at_tip} {face}");
        }
    }

    #[test]
    fn a_smooth_ball_keeps_its_bits() {
        let mut smooth = generate(&Shape::Sphere { triangles: 1000 });
        smooth.normals.clear();
        smooth.triangles.iter_mut().for_each(|triangle| triangle.normals = [MISSING; 3]);
        // A triangle without area has no direction that could differ from the smooth normals.
        let [a, b, _] = smooth.triangles[0].positions;
        smooth.triangles.push(Triangle { positions: [a, b, b], ..smooth.triangles[0] });
        let mut creased = smooth.clone();
        complete(&mut smooth, None);
        complete(&mut creased, Some(40.0));
        assert_eq!(smooth, creased);
    }
}
