//! Which pixels any correct caster must agree on, whatever its arithmetic.

use super::cast::Caster;
use crate::image::RELATIVE_LIMIT;
use crate::scene::PixelFrame;
use glam::DVec3;

/// How far a pixel's ray is nudged, in radians: a little, and by about a rounding, for what is narrower than a little.
const NUDGES_RADIANS: [f64; 2] = [1e-5, 1e-6];
/// Another triangle this near behind the closest hit, as a part of its distance, may as well be the closest.
const RIVAL: f64 = 1e-6;
/// How far off its triangle's plane rounding may put a hit, as a part of its distance or of its own coordinates. Where light
/// grazes, that decides whether a shadow ray starts above or below its own surface, and no turn of the ray shows it.
const OFF_PLANE: f64 = 1e-6;

/// A pixel's radiance, and what becomes of it when the question changes a little.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Through the pixel's centre.
    pub radiance: DVec3,
    /// Whether the ray hits.
    pub hit: bool,
    /// Whether under some nudge a hit becomes a miss or the reverse.
    pub turns: bool,
    /// The largest change of a channel under any nudge; infinite where it turns.
    pub change: f64,
    /// The least and the most of each channel, over the centre and all nudges.
    pub range: [DVec3; 2],
}

/// Casts the pixel (x, y), then again with its ray nudged each way along the image's axes, with half and twice the shadow
/// bias, and as rounding may have it where light grazes. Where two surfaces coincide either is right, so those behind are asked too.
pub fn sample(caster: &Caster<'_, f64>, frame: &PixelFrame, bias: f64, [x, y]: [f64; 2]) -> Sample {
    let (ray, hit) = caster.look(x, y);
    let radiance = caster.radiance(&ray, hit.as_ref(), bias);
    let mut sample = Sample { radiance, hit: hit.is_some(), turns: false, change: 0.0, range: [radiance; 2] };
    for [x, y] in nudges(frame, [x, y]) {
        let (ray, other) = caster.look(x, y);
        if hit.is_some() != other.is_some() {
            (sample.turns, sample.change) = (true, f64::INFINITY);
        }
        sample.consider(caster.radiance(&ray, other.as_ref(), bias));
    }
    if let Some(hit) = &hit {
        for factor in [0.5, 2.0] {
            sample.consider(caster.radiance(&ray, Some(hit), bias * factor));
        }
        for radiance in caster.grazed(&ray, hit, bias, OFF_PLANE) {
            sample.consider(radiance);
        }
        for rival in caster.rivals(&ray, hit, RIVAL) {
            sample.consider(caster.radiance(&ray, Some(&rival), bias));
        }
    }
    sample
}

impl Sample {
    /// Takes another answer to nearly the same question into account.
    fn consider(&mut self, other: DVec3) {
        self.change = self.change.max((other - self.radiance).abs().max_element());
        self.range = [self.range[0].min(other), self.range[1].max(other)];
    }

    /// Adds another sample of the same pixel; hits are those of the last, as a caster's are.
    pub fn add(&mut self, other: &Self) {
        self.radiance += other.radiance;
        (self.hit, self.turns) = (other.hit, other.turns);
        self.change += other.change;
        self.range = [self.range[0] + other.range[0], self.range[1] + other.range[1]];
    }

    /// Makes the sum of several samples their mean.
    pub fn divide(&mut self, count: f64) {
        self.radiance /= count;
        self.change /= count;
        self.range = self.range.map(|end| end / count);
    }
}

/// The pixel coordinates small angles to the right, left, below and above.
fn nudges(frame: &PixelFrame, [x, y]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let towards = frame.direction(x, y);
    // A step of one pixel turns the ray by about |step x towards| / |towards|^2.
    let per_radian = |step: DVec3| towards.length_squared() / step.cross(towards).length();
    let (across, down) = (per_radian(frame.step_x), per_radian(frame.step_y));
    NUDGES_RADIANS.into_iter().flat_map(move |radians| {
        let (dx, dy) = (radians * across, radians * down);
        [[x + dx, y], [x - dx, y], [x, y + dy], [x, y - dy]]
    })
}

/// Whether a change is too small to matter beside a pixel's own brightness, or beside `floor` where it is darker.
pub fn is_certain(sample: &Sample, floor: f64) -> bool {
    let brightness = sample.radiance.abs().max_element();
    sample.radiance.is_finite() && sample.change < RELATIVE_LIMIT * brightness.max(floor)
}
