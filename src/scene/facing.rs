//! Measures how much of the visible surface faces away from the camera. Lights on the camera's side leave such
//! surfaces dark, since only the front of a surface is lit.

use super::mesh::{Mesh, PARALLEL_TRIANGLES};
use super::{Camera, Scene, Shot};
use crate::reference::cutouts::is_solid;
use crate::reference::intersect::Hit;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Number of samples (rays that are tested) across a picture. 48 are enough to tell whether most of the
/// visible surface faces away.
const ACROSS: usize = 48;
/// If more than the fraction `MOST` of the visible surface faces away, raycl writes a note. With `two_sided` and
/// without a turntable, there is no such note, since raycl has already reversed the normals of triangles that face
/// away. With `two_sided` and a turntable, raycl reverses all normals if more than the fraction `MOST` faces away and
/// the scene has no outside, as in a room (`turn_normals` in `assemble.rs`).
const MOST: f64 = 0.5;

/// The nearest surface at each sample (a ray through the picture): the surface's depth along the camera's
/// forward axis, and true if the surface faces away. If there is no surface at a sample, the depth is
/// infinite, and the second value is `None`. The second value is also `None` for a ground that raycl added.
type Nearest = Vec<(f64, Option<bool>)>;

/// The note begins with this text if the eye is inside the bounding box of an object, and neither the scene file
/// nor a setting sets the eye's position. The eye is then usually at the origin, which is often inside an object.
/// If the position is set, the user probably wants to see an object's inside.
const INSIDE: &str = "the eye is inside the bounding box of an object; `--azimuth 30 --elevation 20` (azimuth_degrees \
                      and elevation_degrees of [camera]) places the camera outside, where it sees the whole scene; ";

/// Returns a note if most of the visible surface faces away, in images whose width divided by their height is
/// `aspect`. `starts` contains the index of the first triangle of each object. Only the first `own` triangles
/// count: all later triangles are a ground that raycl added. `two_sided` is true if raycl reverses normals. In a scene
/// on a turntable (`turns`), raycl has then already decided whether to reverse all normals or none. `eye_is_set` is
/// true if the scene file or a setting sets the eye's position.
pub(super) fn note(
    scene: &Scene,
    (starts, own): (&[u32], usize),
    Shot { aspect, turns, .. }: Shot,
    two_sided: bool,
    eye_is_set: bool,
) -> Option<String> {
    let part = averted_part_of(&scene.mesh, own, &scene.camera, aspect)?;
    let ground = if own < scene.mesh.triangles.len() { " (without the ground)" } else { "" };
    let remedy = match (two_sided, turns) {
        (true, _) => "in a scene that is seen from all sides, raycl reverses either all normals or none",
        (false, true) => {
            "in a scene that is seen from all sides, --two-sided (two_sided = true) reverses either all normals or none"
        }
        (false, false) => "--two-sided (two_sided = true) reverses the normals of this part",
    };
    (part > MOST).then(|| {
        let is_lost = !eye_is_set && is_inside(&scene.mesh, starts, scene.camera.position);
        let inside = if is_lost { INSIDE } else { "" };
        format!(
            "{inside}{:.0}% of the visible surface{ground} faces away from the camera, so lights on the camera's side leave this part dark: {remedy}",
            100.0 * part
        )
    })
}

/// Returns true if `eye` is inside the bounding box of an object. `starts` contains the index of the first
/// triangle of each object. A box without thickness, such as that of a horizontal ground, contains no eye.
fn is_inside(mesh: &Mesh, starts: &[u32], eye: Vec3) -> bool {
    let ends = starts.iter().skip(1).map(|start| *start as usize).chain([mesh.triangles.len()]);
    starts.iter().zip(ends).any(|(start, end)| {
        let triangles = mesh.triangles.get(*start as usize..end).unwrap_or_default();
        let corners = triangles.iter().flat_map(|triangle| mesh.corners(triangle));
        let (low, high) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
            (low.min(corner), high.max(corner))
        });
        low.cmplt(eye).all() && eye.cmplt(high).all()
    })
}

/// Returns true if most of the visible surface faces away, in images whose width divided by their height is
/// `aspect`.
pub(super) fn is_averted(mesh: &Mesh, camera: &Camera, aspect: f64) -> bool {
    averted_part(mesh, camera, aspect).is_some_and(|part| part > MOST)
}

/// Returns the fraction of the visible surface whose normals point away from the camera; `None` if no surface
/// is visible.
fn averted_part(mesh: &Mesh, camera: &Camera, aspect: f64) -> Option<f64> {
    averted_part_of(mesh, mesh.triangles.len(), camera, aspect)
}

/// Considers the visible surface of the first `own` triangles; holes of cut-outs are no surface. Returns the
/// fraction of the visible surface where normals point away from the camera; `None` if none of these triangles
/// is visible. Triangles after the first `own` ones hide what is behind them, but do not count as visible
/// surface.
fn averted_part_of(mesh: &Mesh, own: usize, camera: &Camera, aspect: f64) -> Option<f64> {
    let down = (ACROSS as f64 / aspect).round().clamp(1.0, 4.0 * ACROSS as f64) as usize;
    let grid = Grid::new(camera, [ACROSS, down]);
    let nothing = || vec![(f64::INFINITY, None); ACROSS * down];
    let nearer = |a: (f64, Option<bool>), b: (f64, Option<bool>)| if b.0 < a.0 { b } else { a };
    let all = mesh.triangles.len();
    let seen_of = |first: usize| {
        let mut nearest = nothing();
        let numbers = first..all.min(first + PARALLEL_TRIANGLES);
        numbers.for_each(|number| grid.draw(mesh, (number, number < own), &mut nearest));
        nearest
    };
    let seen = (0..all).into_par_iter().step_by(PARALLEL_TRIANGLES).map(seen_of);
    let seen = seen.reduce(nothing, |a, b| a.into_iter().zip(b).map(|(a, b)| nearer(a, b)).collect());
    let hits = seen.iter().filter(|(_, averted)| averted.is_some()).count();
    let averted = seen.iter().filter(|(_, averted)| *averted == Some(true)).count();
    (hits > 0).then(|| averted as f64 / hits as f64)
}

/// The samples of a picture of low resolution: one ray through the middle of each of its pixels.
struct Grid {
    size: [usize; 2],
    eye: DVec3,
    forward: DVec3,
    /// The steps across and down the picture between two samples, at depth 1.
    step: [DVec3; 2],
    corner: DVec3,
    z_near: f64,
}

impl Grid {
    fn new(camera: &Camera, [width, height]: [usize; 2]) -> Self {
        let frame = camera.pixel_frame(width as u32, height as u32);
        Self {
            size: [width, height],
            eye: frame.eye,
            forward: camera.forward.as_dvec3(),
            step: [frame.step_x, frame.step_y],
            corner: frame.corner,
            z_near: frame.z_near,
        }
    }

    /// Enters the triangle with the index `number` at the samples where it is the nearest surface so far. `counts`
    /// is false for a ground that raycl added.
    fn draw(&self, mesh: &Mesh, (number, counts): (usize, bool), nearest: &mut Nearest) {
        let triangle = &mesh.triangles[number];
        let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3() - self.eye);
        let Some([columns, rows]) = self.bounds(corners) else { return };
        let [a, b, c] = corners;
        let shading: DVec3 = mesh.corner_normals(triangle).iter().map(|normal| normal.as_dvec3()).sum();
        let averted = counts.then(|| shading.dot(a) > 0.0);
        let volume = a.dot(b.cross(c));
        let faces = [b.cross(c), c.cross(a), a.cross(b)];
        let plane = faces.iter().sum::<DVec3>();
        for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
            let ray = self.corner + self.step[0] * (x as f64 + 0.5) + self.step[1] * (y as f64 + 0.5);
            let sides = faces.map(|face| face.dot(ray) * volume.signum());
            let distance = volume / plane.dot(ray);
            let sample = &mut nearest[y * self.size[0] + x];
            let is_nearest = distance > self.z_near && distance < sample.0;
            let is_hit = is_nearest && sides.iter().all(|side| *side >= 0.0);
            let hit = || {
                let sum: f64 = sides.iter().sum();
                Hit { t: distance, weights: sides.map(|side| side / sum), triangle: number as u32 }
            };
            if is_hit && is_solid(&mesh.textures, &hit(), None) {
                *sample = (distance, averted);
            }
        }
    }

    /// Returns the columns and rows of samples that a triangle may cover; `None` for a triangle
    /// behind the eye.
    fn bounds(&self, corners: [DVec3; 3]) -> Option<[std::ops::Range<usize>; 2]> {
        let depths = corners.map(|corner| corner.dot(self.forward));
        if depths.iter().all(|depth| *depth <= 0.0) {
            return None;
        }
        if depths.iter().any(|depth| *depth <= 0.0) {
            return Some(self.size.map(|count| 0..count));
        }
        let range = |axis: usize| {
            let step = self.step[axis];
            let position = |corner: DVec3| {
                (corner / corner.dot(self.forward) - self.corner).dot(step) / step.length_squared()
            };
            let positions = corners.map(position);
            let [low, high] = [f64::min, f64::max].map(|f| positions.into_iter().reduce(f).unwrap_or(0.0));
            let clamped = |position: f64| position.clamp(0.0, self.size[axis] as f64) as usize;
            clamped(low.floor())..clamped(high.ceil())
        };
        Some([range(0), range(1)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Mapped, Shape, Texture, Textures, Triangle, Wrap, generate};

    #[test]
    fn a_ball_is_seen_from_its_front_and_its_inside_from_behind() {
        let mut mesh = generate(&Shape::Sphere { triangles: 2000 });
        let camera = Camera { position: Vec3::Z * 3.0, ..Camera::PAPER };
        assert_eq!(averted_part(&mesh, &camera, 1.6), Some(0.0));
        assert_eq!(
            averted_part(&mesh, &Camera { position: Vec3::ZERO, z_near: 0.0, ..camera }, 1.0),
            Some(1.0)
        );
        mesh.normals.iter_mut().filter(|normal| normal.x > 0.0).for_each(|normal| *normal = -*normal);
        let half = averted_part(&mesh, &camera, 1.6).unwrap_or(0.0);
        assert!((0.4..0.6).contains(&half), "{half}");
        let away = Camera { position: Vec3::NEG_Z * 3.0, ..camera };
        assert_eq!(averted_part(&mesh, &away, 1.6), None);
    }

    #[test]
    fn an_eye_is_inside_an_object_but_not_above_a_ground_or_between_objects() {
        let mut mesh = generate(&Shape::Sphere { triangles: 200 });
        let starts = [0, mesh.triangles.len() as u32];
        let mut other = generate(&Shape::Sphere { triangles: 200 });
        other.positions.iter_mut().for_each(|position| position.x += 10.0);
        mesh.append(other);
        for (eye, expected) in [(0.0, true), (5.0, false), (10.0, true), (12.0, false)] {
            assert_eq!(is_inside(&mesh, &starts, Vec3::X * eye), expected, "{eye}");
        }
        let ground = generate(&Shape::Ground);
        let height = ground.bounds().map_or(0.0, |(low, _)| low.y);
        for above in [0.0, 0.5] {
            assert!(!is_inside(&ground, &[0], Vec3::Y * (height + above)), "{above}");
        }
    }

    #[test]
    fn surfaces_count_by_their_part_of_the_picture() {
        let rectangle = |across, normal| rectangle(1.0, across, [-1.0, 1.0], normal);
        // At a distance of 1, the picture shows x from -1 to 1. In three quarters of the picture's width, the
        // rectangle that faces the camera is visible.
        let mut mesh = rectangle([-1.0, 0.5], Vec3::Z);
        mesh.append(rectangle([0.5, 1.0], Vec3::NEG_Z));
        for aspect in [1.6, 0.5] {
            assert_eq!(averted_part(&mesh, &Camera::PAPER, aspect), Some(0.25), "{aspect}");
        }
    }

    #[test]
    fn a_floor_that_reaches_behind_the_eye_counts_by_its_part_of_the_picture() {
        let rectangle = |corners: [Vec3; 4], normal: Vec3| Mesh {
            positions: corners.to_vec(),
            normals: vec![normal],
            triangles: [[0, 1, 2], [0, 2, 3]]
                .map(|positions| Triangle { positions, normals: [0; 3], material: 0 })
                .to_vec(),
            ..generate(&Shape::Ground)
        };
        // The floor fills the lower half of the picture. The banner, which faces away, fills the upper
        // quarter.
        let floor = [[-1e4, 1e4], [1e4, 1e4], [1e4, -1e4], [-1e4, -1e4]].map(|[x, z]| Vec3::new(x, -1.0, z));
        let mut mesh = rectangle(floor, Vec3::Y);
        let banner = [[-1.0, 0.5], [1.0, 0.5], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, -1.0));
        mesh.append(rectangle(banner, Vec3::NEG_Z));
        let part = averted_part(&mesh, &Camera::PAPER, 1.0).unwrap_or(0.0);
        assert!((part - 1.0 / 3.0).abs() < 0.01, "{part}");
    }

    /// Returns a rectangle at z = -`depth` with this normal, from x = `left` to `right` and from y = `low` to
    /// `high`.
    fn rectangle(depth: f32, [left, right]: [f32; 2], [low, high]: [f32; 2], normal: Vec3) -> Mesh {
        Mesh {
            positions: [[left, low], [right, low], [right, high], [left, high]]
                .map(|[x, y]| Vec3::new(x, y, -depth))
                .to_vec(),
            normals: vec![normal],
            triangles: [[0, 1, 2], [0, 2, 3]]
                .map(|positions| Triangle { positions, normals: [0; 3], material: 0 })
                .to_vec(),
            ..generate(&Shape::Ground)
        }
    }

    /// Returns a rectangle at z = -`depth`, from x = -1 to 1. `height` has the rectangle's lowest and highest
    /// y.
    fn wall(depth: f32, height: [f32; 2], normal: Vec3) -> Mesh {
        rectangle(depth, [-1.0, 1.0], height, normal)
    }

    #[test]
    fn an_added_ground_hides_surfaces_but_does_not_count() {
        let mut mesh = wall(1.0, [-1.0, 0.5], Vec3::Z);
        mesh.append(wall(1.0, [0.5, 1.0], Vec3::NEG_Z));
        let own = mesh.triangles.len();
        // The ground hides the lower half of the picture.
        mesh.append(wall(0.5, [-0.5, 0.0], Vec3::Z));
        let part = |own| averted_part_of(&mesh, own, &Camera::PAPER, 1.0);
        assert_eq!([part(own), part(mesh.triangles.len()), part(0)], [Some(0.5), Some(0.25), None]);
    }

    #[test]
    fn what_is_nearer_than_the_near_plane_does_not_count() {
        let mut mesh = wall(1.0, [-1.0, 1.0], Vec3::Z);
        for (depth, averted) in [(0.05, 0.0), (0.2, 1.0)] {
            mesh.append(wall(depth, [-1.0, 1.0], Vec3::NEG_Z));
            assert_eq!(averted_part(&mesh, &Camera::PAPER, 1.0), Some(averted), "{depth}");
        }
    }

    #[test]
    fn through_a_hole_the_surface_behind_it_is_visible() {
        // The left texel of the mask is transparent, so the left half of the wall is a hole.
        let mask = |texels: [u32; 2]| {
            let mapped = |corners| Mapped { corners, texture: None, mask: Some(0) };
            let texture =
                Texture { size: [2, 1], wrap: [Wrap::Clamp; 2], least_alpha: 1 << 15, texels: texels.into() };
            let [low, high] = [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]];
            Textures { list: vec![texture], mapped: vec![mapped(low), mapped(high)] }
        };
        let cut_out = |texels| Mesh { textures: mask(texels), ..wall(1.0, [-1.0, 1.0], Vec3::NEG_Z) };
        let mut mesh = cut_out([0, 255 << 24]);
        assert_eq!(averted_part(&mesh, &Camera::PAPER, 1.0), Some(1.0));
        mesh.append(rectangle(2.0, [-2.0, 2.0], [-2.0, 2.0], Vec3::Z));
        assert_eq!(averted_part(&mesh, &Camera::PAPER, 1.0), Some(0.5));
        assert_eq!(averted_part(&cut_out([0, 0]), &Camera::PAPER, 1.0), None);
    }

    #[test]
    fn what_is_above_a_wide_picture_does_not_count() {
        let mut mesh = wall(1.0, [-0.5, 0.5], Vec3::Z);
        mesh.append(wall(1.0, [0.5, 1.0], Vec3::NEG_Z));
        let averted = [1.0, 2.0].map(|aspect| averted_part(&mesh, &Camera::PAPER, aspect));
        assert_eq!(averted, [Some(1.0 / 3.0), Some(0.0)]);
    }
}
