//! The serial caster: what every device's image is judged against, and the host's baselines.
//!
//! The algorithm is that of Hughes, van Dam, McGuire et al., *Computer Graphics: Principles and
//! Practice*, 3rd ed., chapter 15, written once for `f32` and `f64`. Read [`ray`], [`intersect`],
//! [`traverse`], [`shade`] and [`cast`] in this order; they carry the names of their twins under `cl/`.

pub mod beam;
pub mod cast;
pub mod certainty;
pub mod cost;
mod fingerprint;
pub mod intersect;
pub mod layers;
pub mod ray;
pub mod real;
pub mod shade;
pub mod soft;
pub mod texture;
pub mod traverse;
pub mod tree;

#[cfg(test)]
pub(crate) mod fixtures;

pub use cast::{cast_parallel_f32, cast_serial_f32, cast_serial_f64};
pub use fingerprint::fingerprint;

use crate::image::{Radiance, dark_floor};
use crate::scene::{Display, Sample, Scene};
use crate::strategy::Culling;
use cast::Caster;
use certainty::{Asked, PixelSample, is_certain, is_nearly_certain, quick_sample, sample};
use rand::SeedableRng as _;
use rand::seq::index::sample as sample_indices;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use soft::Seen;
use std::sync::Arc;
use traverse::Exhaustive;
use tree::Tree;

/// Scenes with more triangles than this are searched through a tree.
const EXHAUSTIVE_TRIANGLES: usize = 64;

/// What an image of a scene ought to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Each pixel's radiance, computed in double precision.
    pub radiance: Radiance,
    /// Whether a pixel's radiance changes by less than 1e-3, relative, under nudges of its ray and
    /// its shadow bias (see [`certainty`]). In the order of `radiance.pixels`.
    pub certain: Vec<bool>,
    /// The other pixels, in the same order, with what they may look like.
    pub doubts: Vec<Doubt>,
    /// How many pixels were cast: all, or the sample that an image is judged by.
    pub judged: usize,
    /// How many pixels' rays hit a triangle.
    pub hits: usize,
    /// The fewest and the most that may, where the pixels that a nudge turns from hit to miss or back are free to choose.
    pub hits_range: [usize; 2],
    /// The radiance below which "relative" means relative to this (see [`dark_floor`]).
    pub floor: f64,
}

impl Reference {
    /// How many pixels rounding alone may decide.
    pub fn uncertain_pixels(&self) -> usize {
        self.doubts.iter().filter(|doubt| !doubt.nearly_certain).count()
    }
}

/// A pixel that the reference is not certain of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doubt {
    /// Its place in `radiance.pixels`.
    pub pixel: usize,
    /// Whether only a nudge much farther than rounding changes it: then what it may look like is what it is, nearly.
    pub nearly_certain: bool,
    /// The least of each channel over the pixel's nudges, but for those that go farther than rounding.
    pub low: [f32; 3],
    /// The most of each channel.
    pub high: [f32; 3],
}

/// Casts `scene` at `size = [width, height]` in double precision, on all cores.
pub fn reference(scene: &Scene, size: [u32; 2], culling: Culling) -> Reference {
    reference_of(scene, size, culling, &all_pixels(size), &[Sample::CENTRE])
}

/// The same for some pixels alone, by the mean of several samples of each: certain where all are. The other pixels are black
/// and uncertain, and nothing is judged by them.
pub fn reference_of(
    scene: &Scene,
    size: [u32; 2],
    culling: Culling,
    pixels: &[usize],
    of_pixel: &[Sample],
) -> Reference {
    let tree = Arc::new(Tree::new(&scene.mesh, culling));
    let mut scene = scene.clone();
    let mut at = |sample: &Sample| {
        scene.camera.shift = sample.offset;
        samples(&scene, &tree, *sample, size, pixels)
    };
    let mut each = of_pixel.iter();
    let mut all = each.next().map(&mut at).unwrap_or_default();
    for sample in each {
        all.iter_mut().zip(at(sample)).for_each(|(sum, found)| sum.add(&found));
    }
    if of_pixel.len() > 1 {
        all.iter_mut().for_each(|sum| sum.divide(of_pixel.len() as f64));
    }
    judged(&all, size, pixels, scene.display)
}

/// Every pixel's place in an image.
pub fn all_pixels(size: [u32; 2]) -> Vec<usize> {
    (0..count(size)).collect()
}

/// The places of some pixels, or of all where there are no more: chosen at random, the same ones each time.
pub fn some_pixels(size: [u32; 2], some: usize) -> Vec<usize> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut pixels = sample_indices(&mut random, count(size), some.min(count(size))).into_vec();
    pixels.sort_unstable();
    pixels
}

fn count(size: [u32; 2]) -> usize {
    size[0] as usize * size[1] as usize
}

/// What samples of some pixels say of an image.
fn judged(samples: &[PixelSample], size: [u32; 2], pixels: &[usize], display: Display) -> Reference {
    let mut radiance = Radiance::new(size[0], size[1]);
    for (&pixel, sample) in pixels.iter().zip(samples) {
        radiance.pixels[pixel] = sample.radiance.as_vec3().to_array();
    }
    let floor = dark_floor(&radiance, display);
    let (mut certain, mut doubts) = (vec![false; count(size)], Vec::new());
    for (&pixel, sample) in pixels.iter().zip(samples) {
        certain[pixel] = is_certain(sample, floor);
        if !certain[pixel] {
            let [low, high] = sample.range.map(|end| end.as_vec3().to_array());
            doubts.push(Doubt { pixel, nearly_certain: is_nearly_certain(sample, floor), low, high });
        }
    }
    let hits = samples.iter().filter(|sample| sample.hit).count();
    let turning = |hit: bool| samples.iter().filter(|sample| sample.turns && sample.hit == hit).count();
    let hits_range = [hits - turning(true), hits + turning(false)];
    Reference { radiance, certain, doubts, judged: pixels.len(), hits, hits_range, floor }
}

/// What the reference makes of a sample of these pixels, in their order.
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
        let place = [pixel % width, pixel / width];
        let asked = Asked {
            caster: &caster,
            frame: &frame,
            bias,
            seen: Seen::of(scene, of_pixel, place.map(|place| place as u32)),
            centre: place.map(|place| place as f64 + 0.5),
        };
        quick_sample(&asked, tree).unwrap_or_else(|| sample(&asked))
    };
    pixels.par_iter().map(at).collect()
}

#[cfg(test)]
mod tests;
