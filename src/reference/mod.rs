//! The ray caster on the host. The host's caster casts the reference, against which every device's image is
//! verified. The host's caster also casts the baselines (serial and parallel), whose times are compared with
//! the kernels' times.
//!
//! The algorithm comes from Hughes, van Dam, McGuire et al., *Computer Graphics: Principles and Practice*,
//! 3rd ed., chapter 15. The code is generic over `f32` and `f64`. Read [`ray`], [`intersect`], [`traverse`],
//! [`shade`] and [`cast`] in this order. Skip `visit_larger` in [`traverse`], and `Grazing`, `leaning`, `rivals`,
//! `off_plane`, `grazing` and `grazed` in [`cast`]: they serve only [`certainty`]. On devices, the files in
//! `cl/common/` and `cl/cast/` cast rays by the same algorithm.

pub mod cast;
pub mod certainty;
pub mod cost;
pub mod cutouts;
mod environment;
mod fingerprint;
pub mod half_light;
pub mod intersect;
pub mod layers;
pub mod leaning;
pub mod pixel_sample;
pub mod ray;
pub mod ray_packet;
pub mod real;
pub mod rough;
pub mod shade;
pub mod shadow_end;
pub mod shadows;
pub mod soft;
pub mod texture;
pub mod traverse;
pub mod tree;

#[cfg(test)]
pub(crate) mod fixtures;

pub use cast::{cast_parallel_f32, cast_serial_f32, cast_serial_f64};
pub use fingerprint::fingerprint;

use crate::image::{Radiance, dark_floor};
use crate::scene::{Sample, Scene};
use crate::strategy::Culling;
use cast::Caster;
use certainty::{Asked, quick_sample, sample};
use pixel_sample::{PixelSample, is_certain, is_nearly_certain};
use rand::SeedableRng as _;
use rand::seq::index::sample as sample_indices;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use soft::Seen;
use std::sync::Arc;
use traverse::Exhaustive;
use tree::Tree;

/// If a scene has more triangles than this, the reference finds the hits of single rays with a tree, otherwise
/// without a tree. Packets of rays ([`ray_packet`]) always use a tree, and baselines never do.
const EXHAUSTIVE_TRIANGLES: usize = 64;

/// The expected image of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Each pixel's radiance, computed in double precision, and its alpha if the background is transparent.
    pub radiance: Radiance,
    /// For each pixel, the share of the pixel's samples that hit a triangle, from 0 to 1. The share is 0 for pixels
    /// that were not cast. The order of the pixels is that of `radiance.pixels`.
    pub hit_shares: Vec<f32>,
    /// True for each certain pixel, in the order of `radiance.pixels`. If a pixel is certain, nudges (small
    /// turns) of its ray and other small changes (see [`certainty`]) alter its channels by less than 1e-3 of its
    /// brightest channel or of `floor`, whichever is greater. Pixels that were not cast count as uncertain.
    pub certain: Vec<bool>,
    /// The uncertain and the nearly certain pixels among those that were cast, in the order of
    /// `radiance.pixels`, each with the range of its possible values.
    pub doubts: Vec<Doubt>,
    /// Number of pixels that were cast: all, or a random selection.
    pub judged: usize,
    /// Number of pixels with at least one ray that hits a triangle.
    pub hits: usize,
    /// The smallest and the largest possible number of hits. The two numbers differ if a nudge (a small turn
    /// of a ray) or another small change turns a pixel's hit into a miss, or a miss into a hit. Such a pixel
    /// may count as a hit or as a miss.
    pub hits_range: [usize; 2],
    /// Differences of a pixel are divided by the pixel's brightest channel or, if the pixel is darker than
    /// this radiance, by this radiance (see [`dark_floor`]).
    pub floor: f64,
}

impl Reference {
    /// Returns the number of uncertain pixels among those that were cast. Nearly certain pixels are not counted.
    pub fn uncertain_pixels(&self) -> usize {
        self.doubts.iter().filter(|doubt| !doubt.nearly_certain).count()
    }

    /// Returns the number of uncertain pixels with at least one ray that hits a triangle. Nearly certain pixels,
    /// which only wide nudges change noticeably, are not counted.
    pub fn uncertain_hits(&self) -> usize {
        self.doubts.iter().filter(|doubt| doubt.hit && !doubt.nearly_certain).count()
    }
}

/// An uncertain or nearly certain pixel of the reference, with the range of values that correct casters may
/// find for the pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doubt {
    /// The pixel's index in the reference's picture (the field `radiance.pixels` of [`Reference`]).
    pub pixel: usize,
    /// True if only wide nudges (the larger of two kinds of small turns of a ray) change the pixel noticeably
    /// (see [`certainty`]). If `nearly_certain` is true, `low` and `high` are nearly equal.
    pub nearly_certain: bool,
    /// True if the pixel's ray, or the ray of one of its samples, hits a triangle.
    pub hit: bool,
    /// The least value of each channel under all small changes (see [`certainty`]) except wide nudges of the
    /// ray.
    pub low: [f32; 3],
    /// The greatest value of each channel under all small changes (see [`certainty`]) except wide nudges of
    /// the ray.
    pub high: [f32; 3],
}

/// Casts `scene` at `size = [width, height]` in double precision, on all cores.
pub fn reference(scene: &Scene, size: [u32; 2], culling: Culling) -> Reference {
    reference_of(scene, size, culling, &all_pixels(size), (&[Sample::CENTRE], &|_| 1))
}

/// Casts only the pixels with the indices `pixels`. A pixel gets the first `count(pixel)` samples of
/// `of_pixel`; the pixel's value is the mean of these samples. Small changes (see [`certainty`]) alter the
/// radiance of each sample; the pixel is certain if the mean of the samples' largest alterations is small.
/// Pixels that are not cast are black and uncertain. In an image that is verified, the values of these pixels
/// need only be finite.
pub fn reference_of(
    scene: &Scene,
    size: [u32; 2],
    culling: Culling,
    pixels: &[usize],
    (of_pixel, count): (&[Sample], &dyn Fn(usize) -> u32),
) -> Reference {
    let tree = Arc::new(Tree::new(&scene.mesh, culling));
    let mut scene = scene.clone();
    let mut all = vec![PixelSample::default(); pixels.len()];
    for sample in of_pixel {
        scene.camera = scene.camera.of_sample(sample);
        let wanted = |(_, pixel): &(_, &usize)| count(**pixel) > sample.earlier;
        let (indices, some): (Vec<usize>, Vec<usize>) = pixels.iter().enumerate().filter(wanted).unzip();
        let added = samples(&scene, &tree, *sample, size, &some);
        indices.into_iter().zip(added).for_each(|(index, added)| all[index].add(&added));
    }
    let cast = |pixel| count(pixel).min(of_pixel.len() as u32);
    all.iter_mut().zip(pixels).for_each(|(sum, pixel)| sum.divide(f64::from(cast(*pixel))));
    judged(&all, size, pixels, &scene)
}

/// Returns the indices of all pixels of an image.
pub fn all_pixels(size: [u32; 2]) -> Vec<usize> {
    (0..count(size)).collect()
}

/// Returns the indices of `some` pixels in ascending order, or of all pixels if the image has fewer pixels.
/// The pixels are chosen at random, but every call with the same arguments chooses the same pixels.
pub fn some_pixels(size: [u32; 2], some: usize) -> Vec<usize> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut pixels = sample_indices(&mut random, count(size), some.min(count(size))).into_vec();
    pixels.sort_unstable();
    pixels
}

fn count(size: [u32; 2]) -> usize {
    size[0] as usize * size[1] as usize
}

/// Makes a reference from `samples`: the means of the samples of each pixel in `pixels`, in the same order.
fn judged(samples: &[PixelSample], size: [u32; 2], pixels: &[usize], scene: &Scene) -> Reference {
    let mut radiance = Radiance::new(size[0], size[1]);
    let mut hit_shares = vec![0.0; count(size)];
    for (&pixel, sample) in pixels.iter().zip(samples) {
        radiance.pixels[pixel] = sample.radiance.as_vec3().to_array();
        hit_shares[pixel] = sample.coverage;
    }
    if scene.transparent {
        radiance.coverage = hit_shares.clone();
    }
    let floor = dark_floor(&radiance, scene.display);
    let (mut certain, mut doubts) = (vec![false; count(size)], Vec::new());
    for (&pixel, sample) in pixels.iter().zip(samples) {
        certain[pixel] = is_certain(sample, floor);
        if !certain[pixel] {
            let [low, high] = sample.range.map(|end| end.as_vec3().to_array());
            let nearly_certain = is_nearly_certain(sample, floor);
            doubts.push(Doubt { pixel, nearly_certain, hit: sample.hit, low, high });
        }
    }
    let hits = samples.iter().filter(|sample| sample.hit).count();
    let turning = |hit: bool| samples.iter().filter(|sample| sample.turns && sample.hit == hit).count();
    let hits_range = [hits - turning(true), hits + turning(false)];
    Reference { radiance, hit_shares, certain, doubts, judged: pixels.len(), hits, hits_range, floor }
}

/// Casts the sample `of_pixel` of each of the pixels with the indices `pixels`. Returns the results in the
/// order of `pixels`.
fn samples(
    scene: &Scene,
    tree: &Arc<Tree>,
    of_pixel: Sample,
    size: [u32; 2],
    pixels: &[usize],
) -> Vec<PixelSample> {
    let caster = if scene.mesh.triangles.len() > EXHAUSTIVE_TRIANGLES {
        Caster::new(scene, size, Arc::clone(tree))
    } else {
        Caster::new(scene, size, Exhaustive::new(&scene.mesh, tree.culling()))
    };
    let width = size[0] as usize;
    let frame = scene.camera.pixel_frame(size[0], size[1]);
    let bias = f64::from(scene.shadow_bias);
    let at = |&pixel: &usize| {
        let position = [pixel % width, pixel / width];
        let asked = Asked {
            caster: &caster,
            frame: &frame,
            bias,
            seen: Seen::of(scene, of_pixel, position.map(|coordinate| coordinate as u32)),
            centre: position.map(|coordinate| coordinate as f64 + 0.5),
        };
        quick_sample(&asked, tree).unwrap_or_else(|| sample(&asked))
    };
    pixels.par_iter().map(at).collect()
}

#[cfg(test)]
mod tests;
