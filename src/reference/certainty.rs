//! Which pixels any correct caster must agree on, whatever its arithmetic.

use super::cast::Caster;
use crate::image::RELATIVE_LIMIT;
use crate::scene::PixelFrame;
use glam::DVec3;

/// How far a pixel's ray is nudged, in radians.
const NUDGE_RADIANS: f64 = 1e-5;
/// Another triangle this near behind the closest hit, as a part of its distance, may as well be the closest.
const RIVAL: f64 = 1e-6;

/// A pixel's radiance, and what becomes of it when the question changes a little.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Through the pixel's centre.
    pub radiance: DVec3,
    /// Whether the ray hits.
    pub hit: bool,
    /// The largest change of a channel under any nudge; infinite where a hit became a miss or the reverse.
    pub change: f64,
}

/// Casts the pixel (x, y), then again with its ray nudged each way along the image's axes, and
/// with half and twice the shadow bias. Where two surfaces coincide either is right, so the one behind is asked too.
pub fn sample(caster: &Caster<'_, f64>, frame: &PixelFrame, bias: f64, [x, y]: [f64; 2]) -> Sample {
    let (ray, hit) = caster.look(x, y);
    let radiance = caster.radiance(&ray, hit.as_ref(), bias);
    let difference = |other: DVec3| (other - radiance).abs().max_element();

    let nudged = nudges(frame, [x, y]).into_iter().map(|[x, y]| {
        let (ray, other) = caster.look(x, y);
        let same_kind = hit.is_some() == other.is_some();
        if same_kind { difference(caster.radiance(&ray, other.as_ref(), bias)) } else { f64::INFINITY }
    });
    let biased = [0.5, 2.0].into_iter().filter_map(|factor| {
        let hit = hit.as_ref()?;
        Some(difference(caster.radiance(&ray, Some(hit), bias * factor)))
    });
    let rival = hit.and_then(|hit| caster.rival(&ray, &hit, RIVAL));
    let rival = rival.map(|rival| difference(caster.radiance(&ray, Some(&rival), bias)));
    let change = nudged.chain(biased).chain(rival).fold(0.0, f64::max);
    Sample { radiance, hit: hit.is_some(), change }
}

/// The pixel coordinates a small angle to the right, left, below and above.
fn nudges(frame: &PixelFrame, [x, y]: [f64; 2]) -> [[f64; 2]; 4] {
    let towards = frame.direction(x, y);
    // A step of one pixel turns the ray by about |step x towards| / |towards|^2.
    let pixels = |step: DVec3| NUDGE_RADIANS * towards.length_squared() / step.cross(towards).length();
    let (dx, dy) = (pixels(frame.step_x), pixels(frame.step_y));
    [[x + dx, y], [x - dx, y], [x, y + dy], [x, y - dy]]
}

/// Whether a change is too small to matter beside a pixel's own brightness, or beside `floor` where it is darker.
pub fn is_certain(sample: &Sample, floor: f64) -> bool {
    let brightness = sample.radiance.abs().max_element();
    sample.radiance.is_finite() && sample.change < RELATIVE_LIMIT * brightness.max(floor)
}
