//! Hills: fractal value noise with its exact slope.

use super::grid::{grid, split};
use crate::scene::Mesh;
use glam::DVec3;

const OCTAVES: u32 = 7;
/// Number of lattice cells across the terrain in the first octave (the coarsest layer of noise).
const FIRST_FREQUENCY: f64 = 3.5;
const HEIGHT: f64 = 0.6;

/// Returns a terrain of about `triangles` triangles, at least two.
pub(super) fn terrain(triangles: u32, seed: u32) -> Mesh {
    let (columns, rows) = split(f64::from(triangles) / 2.0, 1.0);
    grid(columns, rows, |u, v| {
        // v goes from front to back, so that the cross product of the derivatives by u and by v points up.
        let (x, z) = (2.0 * u - 1.0, 1.0 - 2.0 * v);
        let (height, slope_x, slope_z) = fractal(x, z, seed);
        (DVec3::new(x, height, z), DVec3::new(-slope_x, 1.0, -slope_z).normalize())
    })
}

/// Returns the height and its slopes along x and z. In each octave after the first, the hills are half as
/// wide and two fifths as high as in the previous octave.
fn fractal(x: f64, z: f64, seed: u32) -> (f64, f64, f64) {
    let (mut frequency, mut amplitude) = (FIRST_FREQUENCY / 2.0, HEIGHT / 2.0);
    let mut sum = (0.0, 0.0, 0.0);
    for octave in 0..OCTAVES {
        // Without the shift, the lattices of all octaves would have a common point at the origin.
        let shift = 17.3 * f64::from(octave);
        let noise = noise(x * frequency + shift, z * frequency - shift, seed.wrapping_add(octave));
        sum.0 += amplitude * noise.0;
        sum.1 += amplitude * frequency * noise.1;
        sum.2 += amplitude * frequency * noise.2;
        frequency *= 2.0;
        amplitude *= 0.4;
    }
    sum
}

/// Returns noise from 0 to 1, and its slopes along x and z.
fn noise(x: f64, z: f64, seed: u32) -> (f64, f64, f64) {
    let (i, k) = (x.floor(), z.floor());
    let ((sx, dx), (sz, dz)) = (fade(x - i), fade(z - k));
    let corner = |a: i32, b: i32| hash(i as i32 + a, k as i32 + b, seed);
    let (v00, v10, v01, v11) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1));
    let (along_x, along_z, twist) = (v10 - v00, v01 - v00, v00 - v10 - v01 + v11);
    let value = v00 + along_x * sx + along_z * sz + twist * sx * sz;
    (value, (along_x + twist * sz) * dx, (along_z + twist * sx) * dz)
}

/// Returns Perlin's 6t^5 - 15t^4 + 10t^3, and its slope.
fn fade(t: f64) -> (f64, f64) {
    let value = t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    (value, 30.0 * t * t * (t - 1.0) * (t - 1.0))
}

/// Returns a pseudo-random number from 0 to 1 for a lattice point and a seed. The function mixes the
/// coordinates and the seed by the finaliser of MurmurHash3.
fn hash(x: i32, z: i32, seed: u32) -> f64 {
    let mut h = (x as u32).wrapping_mul(0x8da6_b343) ^ (z as u32).wrapping_mul(0xd816_3841) ^ seed;
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    f64::from(h ^ (h >> 16)) / f64::from(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slopes_are_those_of_the_height() {
        let (seed, step) = (7, 1e-6);
        let rise =
            |from: (f64, f64), to: (f64, f64)| fractal(to.0, to.1, seed).0 - fractal(from.0, from.1, seed).0;
        for (x, z) in [(0.3, -0.2), (-0.75, 0.5), (0.9, 0.8)] {
            let (_, slope_x, slope_z) = fractal(x, z, seed);
            let along_x = rise((x - step, z), (x + step, z)) / (2.0 * step);
            let along_z = rise((x, z - step), (x, z + step)) / (2.0 * step);
            assert!((slope_x - along_x).abs() < 1e-5, "{x}, {z}: {slope_x} {along_x}");
            assert!((slope_z - along_z).abs() < 1e-5, "{x}, {z}: {slope_z} {along_z}");
        }
    }

    /// Times of a terrain can be compared with stored records only if the terrain stays the same.
    #[test]
    fn a_terrain_is_the_same_in_every_version() {
        for (x, z, expected) in [(0.3, -0.2, 0.152_599_691_183), (-0.75, 0.5, 0.333_235_183_409)] {
            let height = fractal(x, z, 7).0;
            assert!((height - expected).abs() < 1e-9, "{x}, {z}: {height}");
        }
    }
}
