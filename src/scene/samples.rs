//! The samples of a pixel. The positions of the samples are distributed like the pixel filter, so that all
//! samples have the same weight (Ernst, Stamminger and Greiner, "Filter Importance Sampling", IEEE Symposium
//! on Interactive Ray Tracing 2006). A sample has the same position in every pixel (Haeberli and Akeley,
//! "The Accumulation Buffer", 1990), so that the rays of neighbouring pixels stay nearly parallel.

use crate::manifest::{INTERLEAVED, SAMPLED_BLOCK};

/// The Blackman-Harris filter's width, in pixels.
const WIDTH: f64 = 1.5;
/// The coefficients of the filter's cosine series (Harris, "On the Use of Windows for Harmonic
/// Analysis", Proceedings of the IEEE 66, 1978).
const BLACKMAN_HARRIS: [f64; 4] = [0.35875, -0.48829, 0.14128, -0.01168];
/// Number of bisections in the search for a quantile of the filter. 53 would be enough for double precision.
const HALVINGS: u32 = 54;
/// With adaptive sampling, every pixel first gets 1 / `FIRST_OF` of the largest number of samples,
/// rounded up.
const FIRST_OF: u32 = 16;
/// The least width of a sample's ray cone as a share of the pixel's width, as in pbrt.
const LEAST_CONE: f32 = 0.125;
/// Arbitrary seeds for Owen's scrambling of the two coordinates. The scrambling makes the samples' positions look
/// random. Since the seeds are fixed, all pictures with the same number of samples use the same positions.
const SEEDS: [u32; 2] = [0x8d22_f6e6, 0x1f3a_5c71];

/// One sample; its offset is the same in every pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The sample's offset from a pixel's centre, in pixels.
    pub offset: [f32; 2],
    /// The sample's number in its round of samples, from 0. A pixel's samples are cast in up to two rounds
    /// ([`Sampling::rounds`]).
    pub number: u32,
    /// The number of samples per pixel in the sample's round.
    pub count: u32,
    /// The largest number of samples that a pixel of the picture gets. If this number is 1, lights are
    /// points.
    pub most: u32,
    /// The number of samples of the same pixel that are cast before this sample, in the first and the second
    /// round together.
    pub earlier: u32,
    /// Which light the sample receives.
    pub light: SampleLight,
}

/// Which light a sample receives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleLight {
    /// The sample receives light from one point of each light and from one direction of the sky. The pixel
    /// and the sample determine the point on each light and the direction of the sky. If pixels get a single
    /// sample, lights are points.
    #[default]
    Own,
    /// The sample belongs to a half picture (of half the width and height). Like a sample with `Own`, it
    /// receives light from one point of each light and from one direction of the sky. In a half picture, the
    /// points of lights and the directions of the sky repeat after `INTERLEAVED` pixels.
    Interleaved,
    /// The sample receives light from the lights' centres, and the mean of the sky's radiance around the
    /// hit's normal, as if no surface blocked the light.
    Unoccluded,
}

/// How many samples pixels get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// The number of first samples, which every pixel gets.
    pub first: u32,
    /// The number of samples of each pixel in a rough block: a block of pixels in which neighbouring pixels
    /// differ after the first samples.
    pub most: u32,
    /// The number of samples per pixel of the half picture (of half the width and height) that has shadows.
    /// If this number is 0, there are no half pictures.
    pub half_light: u32,
}

impl Sampling {
    /// One sample per pixel.
    pub const ONE: Self = Self::all(1);

    /// Returns a sampling with `count` samples for every pixel.
    pub const fn all(count: u32) -> Self {
        Self { first: count, most: count, half_light: 0 }
    }

    /// Returns a sampling with `most` samples for each pixel of a rough block, and a sixteenth of `most`,
    /// rounded up, for other pixels.
    pub fn adaptive(most: u32) -> Self {
        Self { first: most.div_ceil(FIRST_OF), most, half_light: 0 }
    }

    /// Returns true if pixels of rough blocks get more samples than other pixels.
    pub fn is_adaptive(&self) -> bool {
        self.first < self.most
    }

    /// Returns the samples of a pixel, in two rounds. Every pixel gets the samples of the first round; only
    /// pixels of rough blocks get the samples of the second round. The samples' positions in the pixel come
    /// from one sequence, which the second round continues. The points of lights and the directions of the
    /// sky come from a sequence that begins again in each round.
    pub fn rounds(&self) -> [Vec<Sample>; 2] {
        let light = if self.half_light > 0 { SampleLight::Unoccluded } else { SampleLight::Own };
        let round = |sample: Sample| match sample.earlier < self.first {
            true => Sample { count: self.first, light, ..sample },
            false => {
                Sample { number: sample.number - self.first, count: self.most - self.first, light, ..sample }
            }
        };
        let all = pixel_samples(self.most).into_iter().map(round);
        let (first, rest) = all.partition(|sample| sample.earlier < self.first);
        [first, rest]
    }

    /// Returns the samples of each pixel of a half picture (of half the width and height). All samples are at
    /// the pixel's centre, and differ only in the points of lights and the directions of the sky. Unoccluded
    /// light depends on no such point or direction, so it needs only one sample.
    pub fn of_half_light(&self, light: SampleLight) -> Vec<Sample> {
        let Self { most, half_light, .. } = *self;
        let count = if light == SampleLight::Unoccluded { 1 } else { half_light };
        let sample = |number| Sample { number, count, most, earlier: number, light, ..Sample::CENTRE };
        (0..count).map(sample).collect()
    }
}

/// How many samples the pixels of a picture got, with one number for each block of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SampleCounts {
    size: [u32; 2],
    of_block: Vec<u32>,
}

impl SampleCounts {
    /// Makes the counts of a picture of `size` pixels. `of_block` has the number of samples of each block,
    /// row by row.
    pub fn new(size: [u32; 2], of_block: Vec<u32>) -> Self {
        Self { size, of_block }
    }

    /// Returns the number of samples of a pixel, which must be in the picture.
    pub fn at(&self, [x, y]: [u32; 2]) -> u32 {
        let block = y / SAMPLED_BLOCK * self.size[0].div_ceil(SAMPLED_BLOCK) + x / SAMPLED_BLOCK;
        self.of_block.get(block as usize).copied().unwrap_or(0)
    }

    /// Returns the mean number of samples per pixel.
    pub fn mean(&self) -> f64 {
        let [width, height] = self.size;
        let row = |y| (0..width).map(move |x| u64::from(self.at([x, y]))).sum::<u64>();
        (0..height).map(row).sum::<u64>() as f64 / (f64::from(width) * f64::from(height)).max(1.0)
    }

    /// Returns true if the pixels of every block got either `sampling.first` or `sampling.most` samples.
    pub fn are_of(&self, sampling: &Sampling) -> bool {
        self.of_block.iter().all(|count| [sampling.first, sampling.most].contains(count))
    }
}

impl Sample {
    /// A single sample, at the pixel's centre.
    pub const CENTRE: Self =
        Self { offset: [0.0; 2], number: 0, count: 1, most: 1, earlier: 0, light: SampleLight::Own };

    /// Returns after how many pixels, across and down, the numbers that choose points of lights repeat.
    /// Returns `None` if these numbers do not repeat.
    pub fn period(&self) -> Option<u32> {
        (self.light == SampleLight::Interleaved).then_some(INTERLEAVED)
    }

    /// Returns the width of the sample's ray cone as a share of the pixel's width, at least `LEAST_CONE`. In
    /// the first round, the pixel's area is divided among the samples of this round; in the second round,
    /// among the samples of both rounds. In a half picture, every cone is as wide as the pixel.
    pub fn cone_share(&self) -> f32 {
        if self.light == SampleLight::Interleaved {
            return 1.0; // all rays pass through the pixel's centre
        }
        let cast = self.earlier - self.number + self.count;
        (cast as f32).sqrt().recip().max(LEAST_CONE)
    }
}

/// Returns the samples of a pixel that gets `count` samples, at least one. The samples are the same for all
/// pixels that get `count` samples.
pub fn pixel_samples(count: u32) -> Vec<Sample> {
    let (offsets, most) = ((0..).zip(pixel_offsets(count)), count.max(1));
    let one = Sample { count: most, most, ..Sample::CENTRE };
    offsets.map(|(number, offset)| Sample { offset, number, earlier: number, ..one }).collect()
}

/// Returns the offsets of samples from a pixel's centre, in pixels. A single sample is at the centre. Several
/// samples follow Sobol's sequence (Owen-scrambled), and are denser where the filter is larger. The most
/// central sample comes first, since with adaptive sampling a pixel may get only one sample. To bring the
/// most central sample to the front, each sample's index is combined with the most central sample's index by
/// exclusive or. The exclusive or keeps together the samples of each aligned block of the sequence (2^k
/// samples, the first of which has an index divisible by 2^k). The samples of a block must stay together, because
/// Sobol's sequence distributes the points of a whole block evenly.
fn pixel_offsets(count: u32) -> Vec<[f32; 2]> {
    if count <= 1 {
        return vec![[0.0; 2]];
    }
    let offset =
        |number: u32, axis: usize| filtered(unit(scrambled(sobol(number, axis), SEEDS[axis]))) as f32;
    let block: Vec<_> =
        (0..count.next_power_of_two()).map(|number| [offset(number, 0), offset(number, 1)]).collect();
    let distance = |number: &usize| block[*number][0].hypot(block[*number][1]);
    let nearest = (0..block.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
    // The block's length is a power of two, so the exclusive or of two of its indices is again one of its
    // indices.
    (0..count as usize).map(|number| block[number ^ nearest]).collect()
}

/// Converts 32 bits to a number between 0 and 1.
fn unit(bits: u32) -> f64 {
    (f64::from(bits) + 0.5) / 4_294_967_296.0
}

/// Returns the element `number` of Sobol's sequence in the dimension `axis` (0 or 1), as a fraction of 2^32.
/// Dimension 0 is van der Corput's sequence; dimension 1 is the sequence that the polynomial x + 1 generates.
pub fn sobol(number: u32, axis: usize) -> u32 {
    if axis == 0 {
        return number.reverse_bits();
    }
    let (mut direction, mut bits) = (1_u32 << 31, 0);
    for bit in 0..32 {
        if number >> bit & 1 == 1 {
            bits ^= direction;
        }
        direction ^= direction >> 1;
    }
    bits
}

/// Applies Owen's scrambling by a hash of the reversed bits (Laine and Karras, "Stratified Sampling for
/// Stochastic Transparency", 2011, with the constants of Burley, "Practical Hash-based Owen Scrambling",
/// 2020).
pub fn scrambled(bits: u32, seed: u32) -> u32 {
    let mut hash = bits.reverse_bits();
    hash = hash.wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6_u32] {
        hash ^= hash.wrapping_mul(factor);
    }
    hash.reverse_bits()
}

/// Returns the position, in pixels from the centre, below which the fraction `part` of the filter's area
/// lies.
fn filtered(part: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = (low + high) / 2.0;
        if below(middle) < part { low = middle } else { high = middle }
    }
    ((low + high) / 2.0 - 0.5) * WIDTH
}

/// Returns the fraction of the filter's area below `position`, which is 0 at the filter's left end and 1 at
/// its right end. The fraction is the integral of the filter's cosine series up to `position`, divided by the
/// integral over the whole filter.
fn below(position: f64) -> f64 {
    let tau = std::f64::consts::TAU;
    let waves = (1..).zip(&BLACKMAN_HARRIS[1..]).map(|(k, a)| {
        let k = f64::from(k);
        a * (k * tau * position).sin() / (k * tau)
    });
    position + waves.sum::<f64>() / BLACKMAN_HARRIS[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_s_area_is_divided_among_the_cones_of_its_samples() {
        let shares = |sampling: Sampling| {
            let share = |samples: Vec<Sample>| {
                let mut shares: Vec<_> = samples.iter().map(Sample::cone_share).collect();
                shares.dedup();
                shares
            };
            sampling.rounds().map(share)
        };
        assert_eq!(shares(Sampling::ONE), [vec![1.0], vec![]]);
        assert_eq!(shares(Sampling::all(4)), [vec![0.5], vec![]]);
        assert_eq!(shares(Sampling::all(1024)), [vec![0.125], vec![]]);
        // A pixel may get only the samples of the first round. The ray cones of these samples are therefore
        // as wide as if there were no second round.
        assert_eq!(shares(Sampling { half_light: 0, first: 4, most: 16 }), [vec![0.5], vec![0.25]]);
    }

    #[test]
    fn one_sample_is_the_centre_and_many_have_the_filters_mean_and_width() {
        assert_eq!(pixel_offsets(1), [[0.0; 2]]);
        let offsets = pixel_offsets(1024);
        for axis in 0..2 {
            let values = || offsets.iter().map(|offset| f64::from(offset[axis]));
            let mean = values().sum::<f64>() / 1024.0;
            let variance = values().map(|value| value * value).sum::<f64>() / 1024.0;
            // The filter is 1.5 pixels wide. The expected variance comes from numerical integration: the integral of
            // the filter times the squared distance from its centre, divided by the integral of the filter.
            assert!(
                mean.abs() < 1e-3 && (variance / (1.5 * 1.5) - 0.019_18).abs() < 1e-3,
                "{mean} {variance}"
            );
            assert!(values().all(|value| value.abs() < 0.75));
        }
    }

    #[test]
    fn a_sixteenth_of_adaptive_samples_is_for_every_pixel_and_the_others_continue_their_positions() {
        let all = pixel_samples(16);
        for sampling in
            [Sampling::adaptive(16), Sampling::all(16), Sampling { half_light: 0, first: 3, most: 16 }]
        {
            let [first, rest] = sampling.rounds();
            assert_eq!((first.len() as u32, rest.len() as u32), (sampling.first, 16 - sampling.first));
            for round in [&first, &rest] {
                for (number, sample) in (0..).zip(round) {
                    assert_eq!((sample.number, sample.count), (number, round.len() as u32));
                    assert_eq!(sample.most, sampling.most);
                }
            }
            for (earlier, (sample, expected)) in (0..).zip(first.iter().chain(&rest).zip(&all)) {
                assert_eq!((sample.earlier, sample.offset), (earlier, expected.offset));
            }
        }
        assert_eq!([1, 2, 16, 17, 64].map(|most| Sampling::adaptive(most).first), [1, 1, 1, 2, 4]);
        assert!(Sampling::adaptive(2).is_adaptive() && !Sampling::adaptive(1).is_adaptive());
    }

    #[test]
    fn the_mean_of_counts_is_that_of_pixels_and_not_of_blocks() {
        let counts = SampleCounts::new([6, 5], vec![1, 2, 3, 4]);
        assert_eq!([[0, 0], [3, 3], [4, 3], [3, 4], [5, 4]].map(|pixel| counts.at(pixel)), [1, 1, 2, 3, 4]);
        assert_eq!(counts.mean(), f64::from(16 + 2 * 8 + 3 * 4 + 4 * 2) / 30.0);
    }

    #[test]
    fn the_first_sample_is_the_most_central_and_the_others_are_evenly_distributed() {
        let distance = |offset: &[f32; 2]| offset[0].hypot(offset[1]);
        for count in [2, 4, 16, 64] {
            let offsets = pixel_offsets(count);
            let [first, least] =
                [&offsets[..1], &offsets].map(|some| some.iter().map(distance).fold(9.0, f32::min));
            assert_eq!(first, least, "{count}");
            // In each half of the samples, half of the offsets are to the left of the centre.
            for half in offsets.chunks(count as usize / 2).filter(|half| half.len() > 1) {
                let left = half.iter().filter(|offset| offset[0] < 0.0).count();
                assert_eq!(2 * left, half.len(), "{count}");
            }
        }
        assert!(distance(&pixel_offsets(16)[0]) < 0.15, "{:?}", pixel_offsets(16)[0]);
    }

    #[test]
    fn sixteen_samples_are_one_in_each_of_16_rows_and_columns_of_the_filter() {
        let offsets = pixel_offsets(16);
        for axis in 0..2 {
            let mut strata: Vec<u32> = offsets
                .iter()
                .map(|offset| (below(f64::from(offset[axis]) / WIDTH + 0.5) * 16.0) as u32)
                .collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..16).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_half_picture_of_soft_light_needs_one_sample_of_unoccluded_light_and_several_of_the_rest() {
        let sampling = Sampling { half_light: 3, first: 1, most: 16 };
        let of = |light| {
            let sample = |sample: Sample| {
                let numbers = [sample.number, sample.earlier, sample.count];
                (numbers, sample.offset, sample.light == light)
            };
            sampling.of_half_light(light).into_iter().map(sample).collect::<Vec<_>>()
        };
        assert_eq!(of(SampleLight::Unoccluded), [([0, 0, 1], [0.0; 2], true)]);
        let expected = [0, 1, 2].map(|number| ([number, number, 3], [0.0; 2], true));
        assert_eq!(of(SampleLight::Interleaved), expected);
    }

    #[test]
    fn the_counts_of_adaptive_samples_are_the_first_or_the_most() {
        let sampling = Sampling { first: 1, most: 4, half_light: 0 };
        let are_of = |counts: &[u32]| SampleCounts::new([6, 5], counts.to_vec()).are_of(&sampling);
        assert!(are_of(&[1, 4, 4, 1]) && are_of(&[4; 4]) && are_of(&[1; 4]));
        assert!(!are_of(&[1, 4, 2, 1]) && !are_of(&[0, 4, 4, 4]));
    }

    #[test]
    fn light_of_a_half_picture_is_not_cast_again_by_the_whole_picture() {
        let lights = |half_light| {
            let [first, rest] = Sampling { half_light, first: 1, most: 4 }.rounds();
            first.into_iter().chain(rest).map(|sample| sample.light).collect::<Vec<_>>()
        };
        assert_eq!(lights(0), [SampleLight::Own; 4]);
        assert_eq!(lights(2), [SampleLight::Unoccluded; 4]);
        assert_eq!((Sampling::all(4).half_light, Sampling::adaptive(4).half_light), (0, 0));
    }

    /// Different lights use different seeds. In this test, the strata are the eighths of the range from 0 to
    /// 1. If two seeds gave the same order of strata, the points on different lights would be correlated.
    #[test]
    fn each_seed_has_its_own_order_of_the_same_strata() {
        let order = |seed: u32| -> Vec<u32> {
            (0..8).map(|number| scrambled(sobol(number, 0), seed) >> 29).collect()
        };
        let [one, other] = [1, 0x1234_5678].map(order);
        assert_ne!(one, other);
        for mut strata in [one, other] {
            strata.sort_unstable();
            assert_eq!(strata, (0..8).collect::<Vec<_>>(), "each eighth has one of the numbers");
        }
    }
}
