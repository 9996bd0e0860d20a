//! Colours of vertices and triangles.

use crate::scene::corner_colours::{CornerColours, packed};
use crate::scene::material::Material;
use crate::scene::mesh::PARALLEL_TRIANGLES;
use crate::scene::{Mesh, Triangle};
use crate::words::{counted, counted_are};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Each displayed channel of a triangle's colour is rounded to one of `STEPS` equal steps (8 bits, as in most files).
/// Triangles of almost equal colour thus share a material. Colours of corners have finer steps ([`packed`]).
const STEPS: f32 = 255.0;

/// If a colour that raycl uses has a channel larger than `MOST_OF_UNIT`, raycl reads all channels in the file as
/// numbers from 0 to 255, otherwise as numbers from 0 to 1. The same rule, with the largest alpha in place of the
/// largest channel, decides how raycl reads alphas. `MOST_OF_UNIT` is above 1, because rounded channels may be slightly
/// larger than 1.
const MOST_OF_UNIT: f32 = 1.5;
/// If raycl reads channels as numbers from 0 to 255, and the largest of them is smaller than `LEAST_OF_BYTES`, all
/// colours are almost black. It is then doubtful that channels are numbers from 0 to 255.
const LEAST_OF_BYTES: f32 = 16.0;

/// Converts a displayed channel (sRGB, IEC 61966-2-1) to linear light.
pub(in crate::scene) fn linear(displayed: f32) -> f32 {
    if displayed <= 0.04045 { displayed / 12.92 } else { ((displayed + 0.055) / 1.055).powf(2.4) }
}

/// Converts linear light to a displayed channel.
fn displayed(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Gives the triangles the colours of their corners, by which the colours of their materials are multiplied.
/// `colours` has one linear colour per position. If the three corners of each triangle have the same colour, the
/// triangles get new materials instead, as in [`paint_triangles`]. Materials take less memory than colours of corners.
pub(in crate::scene) fn paint(mesh: &mut Mesh, colours: &[Vec3]) {
    let words: Vec<u32> =
        colours.par_iter().with_min_len(PARALLEL_TRIANGLES).map(|colour| packed(*colour)).collect();
    let corners = |triangle: &Triangle| triangle.positions.map(|corner| words[corner as usize]);
    let triangles = || mesh.triangles.par_iter().with_min_len(PARALLEL_TRIANGLES);
    let is_even = |[a, b, c]: CornerColours| a == b && b == c;
    if triangles().all(|triangle| is_even(corners(triangle))) {
        paint_each(mesh, |_, triangle| colours[triangle.positions[0] as usize]);
    } else {
        mesh.corner_colours = triangles().map(corners).collect();
    }
}

/// Assigns a new material to each triangle. The material's colour is that of the triangle, multiplied by the
/// colour of the triangle's previous material. `colours` has one linear colour per triangle.
pub(super) fn paint_triangles(mesh: &mut Mesh, colours: &[Vec3]) {
    paint_each(mesh, |number, _| colours[number]);
}

/// Assigns a new material to each triangle, like [`paint_triangles`]. `colour` returns the linear colour of a
/// triangle from the triangle's index and the triangle itself.
fn paint_each(mesh: &mut Mesh, colour: impl Fn(usize, &Triangle) -> Vec3) {
    let (materials, numbers) = painted(mesh, colour);
    mesh.materials = materials;
    mesh.triangles.iter_mut().zip(numbers).for_each(|(triangle, number)| triangle.material = number);
}

/// Returns the new materials, and the index of each triangle's material.
fn painted(mesh: &Mesh, colour: impl Fn(usize, &Triangle) -> Vec3) -> (Vec<Material>, Vec<u32>) {
    let (mut materials, mut known) = (Vec::new(), HashMap::new());
    let mut number = |key: (u32, [u32; 3])| {
        *known.entry(key).or_insert_with(|| {
            let base = mesh.materials[key.0 as usize];
            let colour = Vec3::from_array(key.1.map(|channel| linear(channel as f32 / STEPS)));
            materials.push(Material { lambertian: base.lambertian * colour, ..base });
            materials.len() as u32 - 1
        })
    };
    let numbers = mesh.triangles.iter().enumerate().map(|(at, triangle)| {
        let colour = colour(at, triangle).clamp(Vec3::ZERO, Vec3::ONE);
        number((
            triangle.material,
            colour.to_array().map(|channel| (displayed(channel) * STEPS).round() as u32),
        ))
    });
    let numbers = numbers.collect();
    (materials, numbers)
}

/// Returns true if a channel of a colour is NaN, or lies outside 0 to 1 by more than half of a rounding step. A
/// rounding step is 1 / `STEPS`.
pub(in crate::scene) fn is_outside(colour: &Vec3) -> bool {
    let most = 0.5 / STEPS;
    !colour.to_array().iter().all(|channel| (-most..=1.0 + most).contains(channel))
}

/// Returns the value of a channel at full intensity, for a file whose channels are not whole numbers of a known range.
/// `brightest` is the largest channel of all colours. Some programs write colours from 0 to 255, others from 0 to 1.
/// All colours of a file have the same range.
pub(in crate::scene) fn full_channel(brightest: f32) -> f32 {
    if brightest > MOST_OF_UNIT { 255.0 } else { 1.0 }
}

/// Returns a note if raycl reads channels as numbers from 0 to 255 ([`full_channel`]), although this is doubtful.
pub(in crate::scene) fn note_bytes(brightest: f32) -> Option<String> {
    let is_doubtful = full_channel(brightest) > 1.0 && brightest < LEAST_OF_BYTES;
    is_doubtful.then(|| {
        format!(
            "channels of colours are read as numbers from 0 to 255, not from 0 to 1, since one of them is \
             {brightest}"
        )
    })
}

/// Returns a note on the `count` elements, such as vertices, whose colours have channels outside 0 to 1;
/// `None` if `count` is 0.
pub(in crate::scene) fn note_outside(count: usize, element: &str) -> Option<String> {
    let elements = || counted_are(count, &format!("{element} with a colour outside 0 to 1"));
    (count > 0).then(|| format!("{} shown with channels limited to this range", elements()))
}

/// Returns a note on the `count` elements, such as vertices, whose alpha is below 1; `None` if `count` is 0.
pub(in crate::scene) fn note_clear(count: usize, element: &str) -> Option<String> {
    let note = || format!("alpha of {} is not used: every surface is opaque", counted(count, element));
    (count > 0).then(note)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Shape, generate};

    #[test]
    fn triangles_of_one_colour_share_a_material() {
        let mut mesh = generate(&Shape::Ground);
        mesh.materials = vec![Material::lambertian(Vec3::splat(0.5))];
        let red = Vec3::new(linear(1.0), linear(0.2), 0.0);
        let colours = vec![red; mesh.positions.len()];
        paint(&mut mesh, &colours);
        assert_eq!(mesh.materials.len(), 1);
        assert!((mesh.materials[0].lambertian - red * 0.5).abs().max_element() < 1e-6);
        assert!(mesh.corner_colours.is_empty());
    }

    #[test]
    fn corners_of_several_colours_keep_them_and_the_material() {
        let mut mesh = generate(&Shape::Ground);
        mesh.materials = vec![Material::lambertian(Vec3::splat(0.5))];
        let mut colours = vec![Vec3::ONE; mesh.positions.len()];
        let [a, b, c] = mesh.triangles[1].positions;
        colours[b as usize] = Vec3::new(0.25, 0.0, 4.0);
        paint(&mut mesh, &colours);
        assert_eq!(mesh.materials, [Material::lambertian(Vec3::splat(0.5))]);
        assert_eq!(mesh.corner_colours.len(), mesh.triangles.len());
        let expected = [a, b, c].map(|corner| packed(colours[corner as usize]));
        assert_eq!(mesh.corner_colours[1], expected);
        assert_eq!(crate::scene::corner_colours::steps(expected[1]), [512, 0, 1023]);
    }

    #[test]
    fn colours_keep_their_8_bits_however_many_there_are() {
        let channels = |number: u32| [number % 256, number / 256 % 256, number / 65_536];
        let triangles = (0..70_000).map(|number| Triangle {
            positions: [3 * number, 3 * number + 1, 3 * number + 2],
            normals: [0; 3],
            material: 0,
        });
        let mut mesh = Mesh {
            positions: vec![Vec3::ZERO; 210_000],
            triangles: triangles.collect(),
            materials: vec![Material::lambertian(Vec3::ONE)],
            ..Mesh::default()
        };
        let colour =
            |number| Vec3::from_array(channels(number).map(|channel| linear(channel as f32 / 255.0)));
        let colours: Vec<Vec3> = (0..210_000).map(|corner| colour(corner / 3)).collect();
        paint(&mut mesh, &colours);
        assert_eq!(mesh.materials.len(), 70_000);
        for (number, triangle) in (0..).zip(&mesh.triangles) {
            let actual = mesh.material(triangle).lambertian.to_array();
            let actual = actual.map(|channel| (displayed(channel) * 255.0).round() as u32);
            assert_eq!(actual, channels(number), "{number}");
        }
    }

    #[test]
    fn a_colour_is_outside_if_a_channel_differs_by_more_than_half_a_step() {
        for (channel, expected) in [
            (0.0, false),
            (1.0, false),
            (1.001, false),
            (-0.001, false),
            (1.003, true),
            (-0.003, true),
            (255.0, true),
            (f32::INFINITY, true),
            (f32::NAN, true),
        ] {
            assert_eq!(is_outside(&Vec3::new(0.5, channel, 0.5)), expected, "{channel}");
        }
        let note = "2 vertices with a colour outside 0 to 1 are shown with channels limited to this range";
        assert_eq!([0, 2].map(|count| note_outside(count, "vertex")), [None, Some(note.to_owned())]);
    }

    #[test]
    fn channels_go_there_and_back() {
        for byte in 0..=255 {
            let value = byte as f32 / 255.0;
            assert!((displayed(linear(value)) - value).abs() < 1e-5);
        }
    }
}
