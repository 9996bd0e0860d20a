//! The end of a shadow ray that a device casts from a light, as in cl/common/shadow_end.cl.

use super::shade::Sight;
use glam::DVec3;

/// A bound of the rounding error of a hit's distance from a light, relative to this distance: twice the error of four
/// roundings (of at most 6e-8 each), rounded up.
const ROUNDING_AT_DISTANCE: f64 = 5e-7;
/// If the gap between a shadow ray's end and the hit is larger than the shadow bias, the gap grows in proportion
/// to 1 / cosine, up to this value of 1 / cosine. The cosine is that of the angle between the light's direction
/// and the surface's normal.
const MOST_PER_COSINE: f64 = 50.0;

/// Returns the least and the greatest distance between a hit and the end of a shadow ray that a device casts
/// from a light towards the hit.
///
/// The least distance is the one that cl/common/shadow_end.cl computes. Usually, the least distance is the
/// shadow bias. If the light is so distant that rounding may move the hit's triangle by more than the bias,
/// the least distance is the length of this move. The greatest distance is the sum of the least distance and
/// the longest such move. (The longest move is the move of a surface that the light grazes.) A surface whose
/// distance from the hit lies between these two may or may not block the light. If even the longest move does
/// not exceed the bias, or if the light is behind the surface, the least and the greatest distance both equal
/// the bias. `normal` is the unit normal at the hit.
pub fn ends_before_hit(bias: f64, sight: &Sight<f64>, normal: DVec3) -> [f64; 2] {
    ends(bias, sight.distance, sight.w_i.dot(normal))
}

/// Returns the two distances of [`ends_before_hit`] for a light at `distance` from the hit. `cosine` is the
/// cosine of the angle between the light's direction and the surface's normal. If the cosine is not positive,
/// both returned distances equal the shadow bias, since light from behind does not reach the surface.
pub fn ends(bias: f64, distance: f64, cosine: f64) -> [f64; 2] {
    let largest = ROUNDING_AT_DISTANCE * distance * MOST_PER_COSINE;
    if cosine <= 0.0 || largest <= bias {
        return [bias; 2];
    }
    let gap = bias.max(ROUNDING_AT_DISTANCE * distance * cosine.recip().min(MOST_PER_COSINE));
    [gap, gap + largest]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::launch::alone::Alone;

    #[test]
    fn a_near_light_leaves_the_bias_and_a_distant_one_a_gap_that_grows_with_its_distance() {
        for (distance, cosine, expected) in [
            (10.0, 1.0, 1e-3),
            (1e5, 1.0, 0.05),
            (1e5, 0.1, 0.5),
            (1e5, 0.01, 2.5),
            (2e5, 0.01, 5.0),
            (1e5, -1.0, 1e-3),
        ] {
            let [gap, farthest] = ends(1e-3, distance, cosine);
            let rounding = if cosine > 0.0 && distance > 40.0 { 2.5e-5 * distance } else { 0.0 };
            assert!((farthest - gap - rounding).abs() < 1e-9, "{distance} {cosine}: {farthest}");
            assert!((gap / expected - 1.0).abs() < 1e-9, "{distance} {cosine}: {gap}");
        }
    }

    #[test]
    fn devices_end_their_rays_at_the_same_distance() {
        let kernel = "__kernel void gaps(__global float *out) {\n\
                      const int at = get_global_id(0);\n\
                      const float distance = pow(10.0f, (float)(at / 8));\n\
                      out[at] = distance * gap_before_hit(1e-3f / distance, exp2((float)(at % 8)));\n}\n";
        let options = "-D WIDTH=1 -D BLOCK_X=1 -D REDUCE_BUILTIN=0";
        let device = Alone::of(["", kernel], &["common/width.cl", "common/shadow_end.cl"], options);
        let gaps: Vec<f32> = device.results(56, |gaps| device.kernel("gaps", 56).arg(gaps).build());
        for (at, gap) in gaps.into_iter().enumerate() {
            let (distance, per_cosine) = (10_f64.powi(at as i32 / 8), 2_f64.powi(at as i32 % 8));
            let [expected, _] = ends(1e-3, distance, per_cosine.recip());
            let gap = f64::from(gap);
            assert!((gap / expected - 1.0).abs() < 1e-5, "{distance} {per_cosine}: {gap}");
        }
    }
}
