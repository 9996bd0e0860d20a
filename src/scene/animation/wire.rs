//! The types that an `[animation]` is read into.

use crate::scene::wire::Whole;
use schemars::JsonSchema;
use toml::{Spanned, Value};

/// Largest number of frames.
const MAX_FRAMES: u32 = 100_000;
/// Largest number of frames per second.
const MAX_RATE: u32 = 1000;

/// Values of the scene that change from frame to frame. A single picture of the scene shows the animation's first
/// frame.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct AnimationWire {
    /// The number of frames, which are counted from 1.
    #[schemars(with = "u32", range(min = 1, max = MAX_FRAMES))]
    pub frames: Whole<1, MAX_FRAMES>,
    /// Frames per second of an .apng, or of a y4m stream (uncompressed video) [default: 30].
    #[schemars(with = "Option<u16>", range(min = 1, max = MAX_RATE))]
    pub frames_per_second: Option<Whole<1, MAX_RATE>>,
    /// Tracks: each is a value of the scene that changes over time.
    #[serde(default)]
    #[schemars(with = "Vec<TrackWire>")]
    pub track: Vec<TrackWire>,
}

/// A value of the scene that changes over time, given at keyframes.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(in crate::scene) struct TrackWire {
    /// The path of the value that changes, as in --set: camera.position, light.0.power, object.2.rotation.
    #[schemars(with = "String")]
    pub path: Spanned<String>,
    /// The keyframes: the number of the frame of each value in `values`, ascending [default: evenly spaced
    /// from the first frame to the last frame of the animation].
    #[schemars(with = "Option<Vec<u32>>")]
    pub at: Option<Spanned<Vec<Spanned<Value>>>>,
    /// The track's values at the keyframes in `at`.
    #[schemars(with = "Vec<serde_json::Value>", length(min = 1))]
    pub values: Spanned<Vec<Spanned<Value>>>,
    /// How the values between two keyframes are computed [default: smooth for numbers and lists of
    /// numbers, else step].
    #[schemars(with = "Option<Interpolation>")]
    pub interpolation: Option<Spanned<Interpolation>>,
}

/// How the values between two keyframes are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(in crate::scene) enum Interpolation {
    /// A smooth curve through the keyframes, which stays between the values of neighbouring keyframes.
    Smooth,
    /// A straight line between the values of neighbouring keyframes.
    Linear,
    /// The value of the earlier keyframe, until the next keyframe.
    Step,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// docs/scenes.md states these limits.
    #[test]
    fn an_animation_has_at_most_100000_frames_and_1000_frames_per_second() {
        let is_read = |text: &str| toml::from_str::<AnimationWire>(text).is_ok();
        assert!(is_read("frames = 100000\nframes_per_second = 1000"));
        assert!(!is_read("frames = 100001") && !is_read("frames = 3\nframes_per_second = 1001"));
    }
}
