//! Tone curves: how brightness beyond the range of a display becomes brightness that it can show.

use schemars::JsonSchema;

/// A tone curve. It maps exposed radiance, from 0 on, to brightness from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// Exposed radiance up to 1 is not changed; more is 1, so bright parts lose their shades.
    #[default]
    Clip,
    /// Narkowicz's curve ("ACES Filmic Tone Mapping Curve", 2015): dark parts get more contrast, and bright parts keep
    /// shades up to an exposed radiance of about 7.2.
    Filmic,
}

/// The coefficients of Narkowicz's curve, (x (A x + B)) / (x (C x + D) + E).
const A: f64 = 2.51;
const B: f64 = 0.03;
const C: f64 = 2.43;
const D: f64 = 0.59;
const E: f64 = 0.14;

impl Tone {
    /// The names of all tone curves, as in scene files.
    pub const NAMES: [&str; 2] = ["clip", "filmic"];

    /// Returns the brightness of exposed radiance, from 0 to 1; 0 for NaN and for values below 0.
    pub fn apply(self, exposed: f64) -> f64 {
        let x = exposed.max(0.0);
        match self {
            Self::Clip => x.min(1.0),
            // The quotient of two infinite numbers is NaN; such values are the brightest.
            Self::Filmic if x > 1e6 => 1.0,
            Self::Filmic => ((x * (A * x + B)) / (x * (C * x + D) + E)).min(1.0),
        }
    }

    /// Returns the smallest exposed radiance with a brightness from 0 to 1.
    pub fn inverse(self, brightness: f64) -> f64 {
        match self {
            Self::Clip => brightness,
            // The positive root of (A - C y) x^2 + (B - D y) x - E y = 0.
            Self::Filmic => {
                let (a, b, c) = (A - C * brightness, B - D * brightness, -E * brightness);
                ((b * b - 4.0 * a * c).sqrt() - b) / (2.0 * a)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_curve_cuts_and_the_filmic_curve_has_its_published_values() {
        let clipped = [f64::NAN, -1.0, 0.25, 1.0, 7.0, f64::INFINITY].map(|x| Tone::Clip.apply(x));
        assert_eq!(clipped, [0.0, 0.0, 0.25, 1.0, 1.0, 1.0]);
        // Computed by hand from the formula: at 0.18, (0.18 * 0.4818) / (0.18 * 1.0274 + 0.14) = 0.086724 / 0.324932.
        for (x, y) in
            [(f64::NAN, 0.0), (0.0, 0.0), (0.18, 0.266_899), (1.0, 2.54 / 3.16), (7.3, 1.0), (1e300, 1.0)]
        {
            assert!((Tone::Filmic.apply(x) - y).abs() < 1e-6, "{x}: {}", Tone::Filmic.apply(x));
        }
    }

    #[test]
    fn the_inverse_leads_back_and_brightness_grows_with_radiance() {
        for tone in [Tone::Clip, Tone::Filmic] {
            let mut last = -1.0;
            for step in 0..=100 {
                let brightness = f64::from(step) / 100.0;
                let exposed = tone.inverse(brightness);
                assert!((tone.apply(exposed) - brightness).abs() < 1e-12, "{tone:?}, {brightness}");
                assert!(exposed > last, "{tone:?}, {brightness}");
                last = exposed;
            }
        }
    }

    #[test]
    fn each_curve_has_its_name_in_scene_files() {
        let read = |name: &str| serde_json::from_value::<Tone>(name.into()).expect("a tone curve");
        assert_eq!(Tone::NAMES.map(read), [Tone::Clip, Tone::Filmic]);
    }
}
