//! Filters soft light that was cast at half resolution, and applies it to the whole picture, in double
//! precision. On devices, `cl/common/half_light.cl` filters and applies soft light in the same way; its
//! comments explain the method.

use crate::image::Radiance;
use crate::manifest::HALF_LIGHT_SHARPNESS;
use glam::DVec3;
use rayon::prelude::*;

/// The filter's weights of five neighbouring pixels, across or down. If the points on lights repeat after four
/// pixels, these weights give the same total weight to the points of each of the four pixels.
const WEIGHTS: [f64; 5] = [0.5, 1.0, 1.0, 1.0, 0.5];

/// The two half pictures (pictures of half the width and height) in which soft light is cast.
pub struct HalfPictures<'a> {
    /// The picture of half the width and height that was cast with shadows.
    pub lit: &'a Radiance,
    /// The picture of half the width and height that was cast with unoccluded light (without shadows).
    pub unoccluded: &'a Radiance,
    /// For each pixel of the half pictures, the share of its samples that hit a surface, from 0 to 1.
    pub hit_shares: &'a [f32],
}

/// Returns the picture of full size with soft light. `whole` is the picture of full size with unoccluded
/// light (without shadows). `hit_shares` contains, for each pixel of `whole`, the share of its samples that
/// hit a surface, from 0 to 1.
pub fn with_half_light(
    whole: &Radiance,
    hit_shares: &[f32],
    halves: &HalfPictures<'_>,
    background: DVec3,
) -> Radiance {
    let ratios = filtered(halves);
    let unoccluded = halves.unoccluded;
    let [across, down] = [(unoccluded.width, whole.width), (unoccluded.height, whole.height)];
    let pixel = |index: usize| {
        let own = at(whole, index);
        let behind = background * (1.0 - f64::from(hit_shares[index]));
        let [x, y] = [index % whole.width as usize, index / whole.width as usize];
        let ratio =
            interpolated(own, [position_in_half(x, across), position_in_half(y, down)], halves, &ratios);
        (behind + (own - behind) * ratio).as_vec3().to_array()
    };
    let pixels = (0..whole.pixels.len()).into_par_iter().map(pixel).collect();
    Radiance { pixels, coverage: whole.coverage.clone(), ..*whole }
}

/// Returns where the centre of the whole picture's pixel `at` lies in the half picture (of half the width and
/// height), as a coordinate across or down. The centres of the half picture's own pixels lie at whole numbers
/// of this coordinate. `half` and `whole` are the numbers of pixels, across or down, of the half picture and
/// of the whole picture.
fn position_in_half(at: usize, (half, whole): (u32, u32)) -> f64 {
    (at as f64 + 0.5) * f64::from(half) / f64::from(whole) - 0.5
}

/// Returns the filtered ratio of arriving light to unoccluded light, for each pixel of the half pictures.
fn filtered(halves: &HalfPictures<'_>) -> Vec<DVec3> {
    let HalfPictures { lit, unoccluded, hit_shares } = halves;
    let width = unoccluded.width as usize;
    let ratio = |index: usize| {
        let [x, y] = [index % width, index / width].map(|at| at as i64);
        let factor = light_scale(at(unoccluded, index));
        let own = at(unoccluded, index) * factor;
        let (mut arrives, mut all) = (DVec3::ZERO, DVec3::ZERO);
        for (down, by_row) in (-2..).zip(WEIGHTS) {
            for (across, by_column) in (-2..).zip(WEIGHTS) {
                let there = nearest(unoccluded, [x + across, y + down]);
                let like = likeness(own, at(unoccluded, there) * factor);
                let weight = by_row * by_column * like * f64::from(hit_shares[there]);
                arrives += weight * at(lit, there);
                all += weight * at(unoccluded, there);
            }
        }
        let part_of = |part: f64, whole: f64, other| if whole > 0.0 { part / whole } else { other };
        let mean = part_of(arrives.element_sum(), all.element_sum(), 1.0);
        DVec3::from_array([0, 1, 2].map(|i| part_of(arrives[i], all[i], mean)))
    };
    (0..unoccluded.pixels.len()).into_par_iter().map(ratio).collect()
}

/// Returns the ratio of arriving light to unoccluded light at position `[x, y]` of the half pictures. The
/// ratio is interpolated from the four nearest pixels. `own` is the unoccluded light of the whole picture at
/// this position.
fn interpolated(own: DVec3, [x, y]: [f64; 2], halves: &HalfPictures<'_>, ratios: &[DVec3]) -> DVec3 {
    let HalfPictures { unoccluded, hit_shares, .. } = halves;
    let factor = light_scale(own);
    let own = own * factor;
    let least = 0.01 * own.length_squared().powi(2) + 1e-37;
    let (left, top) = (x.floor(), y.floor());
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
    let (sum, weights) = corners.into_iter().fold((DVec3::ZERO, 0.0), |(sum, weights), (right, below)| {
        let there = nearest(unoccluded, [(left + right) as i64, (top + below) as i64]);
        let part = (1.0 - (x - left - right).abs()) * (1.0 - (y - top - below).abs());
        let like = likeness(own, at(unoccluded, there) * factor);
        let weight = part * (like * f64::from(hit_shares[there]) + least);
        (sum + weight * ratios[there], weights + weight)
    });
    sum / weights
}

/// Returns the factor that scales the brightest channel of a pixel's light to 1. Without this factor, the
/// constant 1e-37 in the weights of [`interpolated`] would matter in pictures with little light.
fn light_scale(own: DVec3) -> f64 {
    own.max_element().max(f64::from(f32::MIN_POSITIVE)).recip()
}

/// Returns the weight that one pixel has in the filter for another pixel. `a` and `b` are the unoccluded
/// light of the two pixels, both multiplied by the [`light_scale`] of one of them. If `a` and `b` differ
/// much, the weight is 0.
fn likeness(a: DVec3, b: DVec3) -> f64 {
    let sharpness = f64::from(HALF_LIGHT_SHARPNESS);
    ((a + b).length_squared() - sharpness * (a - b).length_squared()).max(0.0).powi(2)
}

fn at(image: &Radiance, index: usize) -> DVec3 {
    glam::Vec3::from_array(image.pixels[index]).as_dvec3()
}

/// Returns the index of the pixel in column `x` and row `y`. For a position outside the image, returns the
/// index of the nearest pixel.
fn nearest(image: &Radiance, [x, y]: [i64; 2]) -> usize {
    let inside = |at: i64, side: u32| at.clamp(0, i64::from(side) - 1) as usize;
    inside(y, image.height) * image.width as usize + inside(x, image.width)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BACKGROUND: DVec3 = DVec3::new(0.1, 0.2, 0.3);

    fn flat(size: [u32; 2], value: f32) -> Radiance {
        let image = Radiance::new(size[0], size[1]);
        Radiance { pixels: vec![[value; 3]; image.pixels.len()], ..image }
    }

    fn close(a: [f32; 3], b: DVec3) -> bool {
        (glam::Vec3::from_array(a).as_dvec3() - b).abs().max_element() < 1e-6
    }

    #[test]
    fn light_that_repeats_after_four_pixels_is_smooth() {
        let (whole, unoccluded) = (flat([17, 13], 0.8), flat([9, 7], 0.8));
        let mut lit = unoccluded.clone();
        // In each square of 4 x 4 pixels, one pixel is in shadow.
        for (index, pixel) in lit.pixels.iter_mut().enumerate() {
            if index % 9 % 4 == 1 && index / 9 % 4 == 2 {
                *pixel = [0.0; 3];
            }
        }
        let inner = |index: usize| (4..11).contains(&(index % 17)) && (4..7).contains(&(index / 17));
        let halves = HalfPictures { lit: &lit, unoccluded: &unoccluded, hit_shares: &[1.0; 63] };
        let picture = with_half_light(&whole, &[1.0; 17 * 13], &halves, BACKGROUND);
        for (index, pixel) in picture.pixels.iter().enumerate().filter(|(index, _)| inner(*index)) {
            assert!(close(*pixel, DVec3::splat(0.8 * 15.0 / 16.0)), "{index}: {pixel:?}");
        }
    }

    #[test]
    fn other_surfaces_do_not_count() {
        // The left half is bright and lit, the right half dark and in shadow.
        let side = |image: &mut Radiance, values: [f32; 2]| {
            let width = image.width as usize;
            for (index, pixel) in image.pixels.iter_mut().enumerate() {
                *pixel = [values[usize::from(index % width >= width / 2)]; 3];
            }
        };
        let (mut whole, mut unoccluded, mut lit) = (flat([16, 8], 0.0), flat([8, 4], 0.0), flat([8, 4], 0.0));
        side(&mut whole, [0.9, 0.3]);
        side(&mut unoccluded, [0.9, 0.3]);
        side(&mut lit, [0.9, 0.0]);
        let halves = HalfPictures { lit: &lit, unoccluded: &unoccluded, hit_shares: &[1.0; 32] };
        let picture = with_half_light(&whole, &[1.0; 128], &halves, BACKGROUND);
        // In `interpolated`, pixels of another brightness keep a small weight, because `least` is added. Only
        // this weight mixes the picture's bright half and its dark half at their border.
        assert!(close(picture.pixels[6], DVec3::splat(0.9)) && close(picture.pixels[9], DVec3::ZERO));
        assert!(picture.pixels[7][0] > 0.89 && picture.pixels[8][0] < 0.01, "{:?}", &picture.pixels[6..10]);
    }

    #[test]
    fn the_background_stays() {
        let (whole, unoccluded, lit) = (flat([4, 4], 0.5), flat([2, 2], 0.5), flat([2, 2], 0.25));
        let mut shares = [1.0; 16];
        (shares[5], shares[6]) = (0.0, 0.5);
        let halves = HalfPictures { lit: &lit, unoccluded: &unoccluded, hit_shares: &[1.0; 4] };
        let picture = with_half_light(&whole, &shares, &halves, BACKGROUND);
        let halved = |share: f64| {
            let behind = BACKGROUND * (1.0 - share);
            behind + (DVec3::splat(0.5) - behind) * 0.5
        };
        assert!(close(picture.pixels[0], DVec3::splat(0.25)), "{:?}", picture.pixels[0]);
        assert!(close(picture.pixels[5], halved(0.0)) && close(picture.pixels[6], halved(0.5)));
    }

    #[test]
    fn a_background_beside_a_surface_brightens_no_shadow() {
        let (whole, unoccluded, mut lit) = (flat([8, 4], 0.5), flat([4, 2], 0.5), flat([4, 2], 0.1));
        // The right side of both half pictures shows the background. Without shadows, the background is as
        // bright as the surface on the left side.
        for index in [2, 3, 6, 7] {
            lit.pixels[index] = [0.5; 3];
        }
        let hit_shares = [1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
        let halves = HalfPictures { lit: &lit, unoccluded: &unoccluded, hit_shares: &hit_shares };
        let picture = with_half_light(&whole, &[1.0; 32], &halves, BACKGROUND);
        assert!((0..4).all(|x| (picture.pixels[x][0] - 0.1).abs() < 1e-3), "{:?}", &picture.pixels[..8]);
    }

    #[test]
    fn a_channel_without_light_has_the_ratio_of_the_others() {
        let mut whole = flat([4, 4], 0.0);
        let [mut unoccluded, mut lit] = [flat([2, 2], 0.0), flat([2, 2], 0.0)];
        whole.pixels.fill([0.5, 0.1, 0.0]);
        unoccluded.pixels.fill([0.5, 0.0, 0.0]);
        lit.pixels.fill([0.1, 0.0, 0.0]);
        let halves = HalfPictures { lit: &lit, unoccluded: &unoccluded, hit_shares: &[1.0; 4] };
        let picture = with_half_light(&whole, &[1.0; 16], &halves, BACKGROUND);
        assert!(close(picture.pixels[5], DVec3::new(0.1, 0.02, 0.0)), "{:?}", picture.pixels[5]);
    }

    /// A picture with little light, or with much, is filtered like the same picture with usual light.
    #[test]
    fn the_filter_does_not_depend_on_the_unit_of_light() {
        let picture = |unit: f32| {
            let halved = |width: u32, height: u32, values: [f32; 2]| {
                let mut image = flat([width, height], unit * values[0]);
                image.pixels.iter_mut().step_by(3).for_each(|pixel| *pixel = [unit * values[1]; 3]);
                image
            };
            let (whole, unoccluded) = (halved(16, 8, [0.9, 0.3]), halved(8, 4, [0.9, 0.3]));
            let lit = halved(8, 4, [0.6, 0.0]);
            let halves = HalfPictures { lit: &lit, unoccluded: &unoccluded, hit_shares: &[1.0; 32] };
            with_half_light(&whole, &[1.0; 128], &halves, BACKGROUND * f64::from(unit))
        };
        let usual = picture(1.0);
        for unit in [1e-12, 1e12] {
            for (actual, expected) in picture(unit).pixels.iter().zip(&usual.pixels) {
                assert!((actual[0] / unit - expected[0]).abs() < 1e-6, "{unit}: {actual:?}, {expected:?}");
            }
        }
    }

    /// If the whole picture is exactly twice as wide and high as the half picture, a pixel of the half picture
    /// covers two pixels of the whole picture along each axis. Along this axis, the centres of these two pixels
    /// lie before and after the centre of the half picture's pixel, at a quarter of this pixel's side. If both
    /// pictures have an odd number of pixels along an axis, the middle pixels of the two pictures have the same
    /// centre.
    #[test]
    fn pixels_lie_beside_the_centres_of_half_pixels() {
        assert_eq!([0, 1, 2, 3].map(|at| position_in_half(at, (2, 4))), [-0.25, 0.25, 0.75, 1.25]);
        assert_eq!(position_in_half(2, (3, 5)), 1.0, "the middle stays the middle");
    }
}
