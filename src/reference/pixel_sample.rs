//! One pixel's radiance, and how it changes under nudges of the pixel's ray and other small changes.

use crate::image::RELATIVE_LIMIT;
use glam::DVec3;

/// A pixel's radiance, and how it changes under nudges of the pixel's ray and other small changes (see
/// [`super::certainty`]). If the pixel has several samples, `change`, `near_change` and `range` are means over the
/// samples, like the radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelSample {
    /// The radiance without nudges and without other small changes.
    pub radiance: DVec3,
    /// True if the pixel's ray, or the ray of one of its samples, hits something.
    pub hit: bool,
    /// The share of the pixel's samples that hit something, from 0 to 1. With a transparent background, this
    /// share is the pixel's alpha.
    pub coverage: f32,
    /// True if a nudge (a small turn of the ray) or another small change turns a hit into a miss or the
    /// reverse.
    pub turns: bool,
    /// The largest change of a channel under any small change; infinite if a hit becomes a miss or the
    /// reverse.
    pub change: f64,
    /// The largest change of a channel under all small changes except wide nudges (the larger of two kinds of
    /// small turns of the ray); infinite if one of these small changes turns a hit into a miss or the
    /// reverse.
    pub near_change: f64,
    /// The least and the greatest value that each channel takes, either without any change or under a small
    /// change. Wide nudges (the larger of two kinds of small turns of the ray) are not included.
    pub range: [DVec3; 2],
}

impl PixelSample {
    /// Returns a sample with the given radiance, before any nudge or other small change is included. `hit` is
    /// true if the ray hits something.
    pub(super) fn of(radiance: DVec3, hit: bool) -> Self {
        let (coverage, range) = (f32::from(hit), [radiance; 2]);
        Self { radiance, hit, coverage, turns: false, change: 0.0, near_change: 0.0, range }
    }

    /// Includes another possible value of the radiance in `change`, `near_change` and `range`.
    pub(super) fn consider(&mut self, other: DVec3) {
        self.nudge(Reach::Near, other);
    }

    /// Includes the radiance of a nudged (slightly turned) ray in `change`. If `reach` is [`Reach::Near`],
    /// also includes this radiance in `near_change` and `range`.
    pub(super) fn nudge(&mut self, reach: Reach, other: DVec3) {
        let change = (other - self.radiance).abs().max_element();
        self.change = self.change.max(change);
        if reach == Reach::Near {
            self.near_change = self.near_change.max(change);
            self.range = [self.range[0].min(other), self.range[1].max(other)];
        }
    }

    /// Marks the sample as one in which a nudge (a small turn of the ray) or another small change turned a hit
    /// into a miss, or the reverse.
    pub(super) fn turn(&mut self, reach: Reach) {
        (self.turns, self.change) = (true, f64::INFINITY);
        if reach == Reach::Near {
            self.near_change = f64::INFINITY;
        }
    }

    /// Adds another sample of the same pixel. The pixel counts as a hit if any of its samples hits something.
    pub fn add(&mut self, other: &Self) {
        self.radiance += other.radiance;
        // If one sample certainly hits something, the pixel certainly hits something.
        let surely = |sample: &Self| sample.hit && !sample.turns;
        self.turns = (self.turns || other.turns) && !surely(self) && !surely(other);
        self.hit |= other.hit;
        self.coverage += other.coverage;
        self.change += other.change;
        self.near_change += other.near_change;
        self.range = [self.range[0] + other.range[0], self.range[1] + other.range[1]];
    }

    /// Divides the sum of `count` samples by `count`, which yields the mean of the samples.
    pub fn divide(&mut self, count: f64) {
        self.radiance /= count;
        self.coverage /= count as f32;
        self.change /= count;
        self.near_change /= count;
        self.range = self.range.map(|end| end / count);
    }
}

/// The size of a nudge (a small change to a ray's direction) or of another small change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// A wide nudge: it turns a ray by ten times the angle of a nudge of the size [`Self::Near`].
    Wide,
    /// A narrow nudge (a small turn of a ray), or another small change. These changes are about as large as
    /// those that rounding causes.
    Near,
}

/// Returns true if a pixel is certain: its radiance is finite, and no small change alters a channel by
/// [`RELATIVE_LIMIT`] or more, relative to the greater of the pixel's brightest channel and `floor`.
pub fn is_certain(sample: &PixelSample, floor: f64) -> bool {
    is_small(sample.change, sample, floor)
}

/// Returns true if a pixel is certain or nearly certain. The conditions are those of [`is_certain`], but
/// changes under wide nudges (larger turns of the ray) do not count.
pub fn is_nearly_certain(sample: &PixelSample, floor: f64) -> bool {
    is_small(sample.near_change, sample, floor)
}

fn is_small(change: f64, sample: &PixelSample, floor: f64) -> bool {
    let brightness = sample.radiance.abs().max_element();
    sample.radiance.is_finite() && change < RELATIVE_LIMIT * brightness.max(floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_remembers_changes_in_both_directions_and_adds_up() {
        let mut one = PixelSample::of(DVec3::splat(1.0), true);
        one.consider(DVec3::splat(0.25));
        one.consider(DVec3::splat(1.5));
        assert_eq!((one.change, one.range), (0.75, [DVec3::splat(0.25), DVec3::splat(1.5)]));
        one.add(&PixelSample::of(DVec3::splat(3.0), false));
        one.divide(2.0);
        assert_eq!((one.radiance, one.change, one.hit), (DVec3::splat(2.0), 0.375, true));
        assert_eq!(one.coverage, 0.5, "one of two samples hits something");
        assert_eq!(one.range, [DVec3::splat(1.625), DVec3::splat(2.25)]);
        // If one sample certainly hits something, the pixel certainly hits something. If no sample certainly
        // hits something, but some sample may hit something, the pixel's hit is uncertain.
        let sample = |hit, turns| PixelSample { turns, ..PixelSample::of(DVec3::ZERO, hit) };
        for (samples, hit, turns) in [
            ([(true, false), (false, true)], true, false),
            ([(true, true), (false, false)], true, true),
            ([(false, false), (false, true)], false, true),
        ] {
            let mut sum = PixelSample::default();
            samples.into_iter().for_each(|(hit, turns)| sum.add(&sample(hit, turns)));
            assert_eq!((sum.hit, sum.turns), (hit, turns), "{samples:?}");
        }
    }

    #[test]
    fn beside_the_dark_a_change_is_relative_to_the_floor() {
        let sample = |radiance: f64, change: f64| PixelSample {
            change,
            ..PixelSample::of(DVec3::splat(radiance), true)
        };
        // A pixel is certain if it changes by less than a thousandth of its radiance or of the floor, whichever
        // is greater.
        assert!(is_certain(&sample(1e-6, 0.9e-7), 1e-4) && !is_certain(&sample(1e-6, 1.1e-7), 1e-4));
        assert!(is_certain(&sample(1.0, 0.9e-3), 1e-4) && !is_certain(&sample(1.0, 1.1e-3), 1e-4));
    }
}
