//! What each sample of a pixel looks at: a place in the pixel, drawn from the filter itself, so that all samples weigh the same
//! (Ernst, Stamminger and Greiner, "Filter Importance Sampling", IEEE Symposium on Interactive Ray Tracing 2006), and a point
//! in each soft light. All pixels share them (Haeberli and Akeley, "The Accumulation Buffer", 1990): rays stay coherent, and
//! a light's shadow rays have a common origin.

use super::Light;
use glam::DVec3;
use std::f64::consts::TAU;

/// The Blackman-Harris filter's width, in pixels.
const WIDTH: f64 = 1.5;
/// Its cosine series (Harris, "On the Use of Windows for Harmonic Analysis", Proceedings of the IEEE 66, 1978).
const BLACKMAN_HARRIS: [f64; 4] = [0.35875, -0.48829, 0.14128, -0.01168];
/// How often the filter is halved to find a place in it: below double precision's steps.
const HALVINGS: u32 = 54;
/// Any two numbers: they decide how Owen's scrambling permutes.
const SEEDS: [u32; 2] = [0x8d22_f6e6, 0x1f3a_5c71];

/// The number of the samples of a light, and of its axes, decides these.
const LIGHT_SEED: u32 = 0x9e37_79b9;

/// A sample of every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// How far from a pixel's centre it lies, in pixels.
    pub offset: [f32; 2],
    /// The lights as it sees them; none where they are where the scene has them.
    pub lights: Option<Vec<Light>>,
}

impl Sample {
    /// Through pixels' centres, with lights in their middle.
    pub const CENTRE: Self = Self { offset: [0.0; 2], lights: None };
}

/// Several samples of every pixel, under these lights. One sample alone sees lights as points.
pub fn pixel_samples(lights: &[Light], count: u32) -> Vec<Sample> {
    let soft = count > 1 && lights.iter().any(|light| light.radius > 0.0);
    let offsets = pixel_offsets(count).into_iter().enumerate();
    let lights_of = |number: u32| (0..).zip(lights).map(|(light, at)| placed(at, light, number)).collect();
    offsets
        .map(|(number, offset)| Sample { offset, lights: soft.then(|| lights_of(number as u32)) })
        .collect()
}

/// A light as a sample sees it: at a point in its ball. Points are spread as the uniform ones of a sphere in four dimensions
/// are seen in three, so that from afar the ball looks equally bright all over from every side, as a disc does.
fn placed(light: &Light, number: u32, sample: u32) -> Light {
    if light.radius == 0.0 {
        return *light;
    }
    let seed = number.wrapping_add(1).wrapping_mul(LIGHT_SEED);
    // Another order than that of the places in a pixel: else a place in the light would go with a place in the pixel.
    let shuffled = scrambled(sample, seed);
    let [a, b, c] = [0_u32, 1, 2]
        .map(|axis| unit(scrambled(sobol(shuffled, axis as usize), seed.rotate_left(8 * (axis + 1)) ^ axis)));
    let (ring, turn) = ((1.0 - a).sqrt(), TAU * b);
    let off = DVec3::new(ring * turn.sin(), ring * turn.cos(), a.sqrt() * (TAU * c).sin());
    let position = (light.position.as_dvec3() + f64::from(light.radius) * off).as_vec3();
    Light { position, ..*light }
}

/// How far from a pixel's centre its samples are, in pixels: one sample is at the centre, several are spread as Sobol's
/// sequence is (Owen-scrambled), denser where the filter is higher.
fn pixel_offsets(count: u32) -> Vec<[f32; 2]> {
    if count <= 1 {
        return vec![[0.0; 2]];
    }
    let place = |number: u32, axis: usize| filtered(unit(scrambled(sobol(number, axis), SEEDS[axis]))) as f32;
    (0..count).map(|number| [place(number, 0), place(number, 1)]).collect()
}

/// 32 bits as a number between 0 and 1.
fn unit(bits: u32) -> f64 {
    (f64::from(bits) + 0.5) / 4_294_967_296.0
}

/// The first three dimensions of Sobol's sequence: van der Corput's, and those of the polynomials x + 1 and x^2 + x + 1 (the
/// direction numbers of Joe and Kuo, 2008).
fn sobol(number: u32, axis: usize) -> u32 {
    if axis == 0 {
        return number.reverse_bits();
    }
    let (mut direction, mut next) = (1_u32 << 31, 3_u32 << 30);
    let mut bits = 0;
    for place in 0..32 {
        if number >> place & 1 == 1 {
            bits ^= direction;
        }
        (direction, next) = match axis {
            1 => (direction ^ direction >> 1, 0),
            _ => (next, next ^ direction ^ direction >> 2),
        };
    }
    bits
}

/// Owen's scrambling by a hash of the reversed bits (Laine and Karras, "Stratified Sampling for Stochastic Transparency",
/// 2011, with the constants of Burley, "Practical Hash-based Owen Scrambling", 2020).
fn scrambled(bits: u32, seed: u32) -> u32 {
    let mut hash = bits.reverse_bits();
    hash = hash.wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6_u32] {
        hash ^= hash.wrapping_mul(factor);
    }
    hash.reverse_bits()
}

/// The place in the filter below which a part of it lies.
fn filtered(part: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = (low + high) / 2.0;
        if below(middle) < part { low = middle } else { high = middle }
    }
    ((low + high) / 2.0 - 0.5) * WIDTH
}

/// The part of the filter below a place, its width being 1: the integral of the series over its whole.
fn below(place: f64) -> f64 {
    let tau = std::f64::consts::TAU;
    let waves = (1..).zip(&BLACKMAN_HARRIS[1..]).map(|(k, a)| {
        let k = f64::from(k);
        a * (k * tau * place).sin() / (k * tau)
    });
    place + waves.sum::<f64>() / BLACKMAN_HARRIS[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sample_is_the_centre_and_many_have_the_filters_mean_and_width() {
        assert_eq!(pixel_offsets(1), [[0.0; 2]]);
        let offsets = pixel_offsets(1024);
        for axis in 0..2 {
            let values = || offsets.iter().map(|offset| f64::from(offset[axis]));
            let mean = values().sum::<f64>() / 1024.0;
            let variance = values().map(|value| value * value).sum::<f64>() / 1024.0;
            // By integrating the series numerically.
            assert!(
                mean.abs() < 1e-3 && (variance / (WIDTH * WIDTH) - 0.019_18).abs() < 1e-3,
                "{mean} {variance}"
            );
            assert!(values().all(|value| value.abs() < WIDTH / 2.0));
        }
    }

    fn light(radius: f32) -> Light {
        Light { position: glam::Vec3::new(5.0, 6.0, 7.0), power: glam::Vec3::ONE, radius }
    }

    #[test]
    fn three_dimensions_are_spread_over_cubes() {
        for (across, down) in [(0, 1), (0, 2), (1, 2)] {
            let cell = |number| (sobol(number, across) >> 28, sobol(number, down) >> 28);
            let cells: std::collections::BTreeSet<_> = (0..256).map(cell).collect();
            assert!(cells.len() >= 128, "{across} {down}: {}", cells.len());
        }
        let mut eighths: Vec<_> = (0..8).map(|number| sobol(number, 2) >> 29).collect();
        eighths.sort_unstable();
        assert_eq!(eighths, (0..8).collect::<Vec<_>>());
    }

    #[test]
    fn a_ball_looks_equally_bright_all_over() {
        let samples = pixel_samples(&[light(2.0), light(0.0)], 1024);
        let offs: Vec<_> = samples
            .iter()
            .map(|sample| {
                let lights = sample.lights.as_ref().expect("a soft light");
                assert_eq!(lights[1], light(0.0));
                (lights[0].position - light(0.0).position) / 2.0
            })
            .collect();
        for axis in [glam::Vec3::X, glam::Vec3::Y, glam::Vec3::Z, glam::Vec3::ONE.normalize()] {
            // Of a disc, the part of its area within a part of its radius is that part's square.
            for part in [0.25_f32, 0.5, 0.75, 1.0] {
                let inside = offs.iter().filter(|off| off.reject_from(axis).length() <= part).count();
                let expected = part * part * 1024.0;
                assert!((inside as f32 - expected).abs() < 30.0, "{axis} {part}: {inside} of {expected}");
            }
        }
    }

    #[test]
    fn one_sample_and_points_leave_lights_where_they_are() {
        assert_eq!(pixel_samples(&[light(2.0)], 1), [Sample::CENTRE]);
        assert!(pixel_samples(&[light(0.0)], 4).iter().all(|sample| sample.lights.is_none()));
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
}
