//! Tone curves. A tone curve maps each channel of exposed radiance (radiance times the exposure), which has no upper
//! limit, to the range from 0 to 1 that a display can show.

use schemars::JsonSchema;

/// The tone curve [default: clip]. The curve maps each channel of exposed radiance, which is never negative,
/// to a brightness from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// Exposed radiance up to 1 is not changed; larger values become 1, so that bright parts of the picture
    /// lose their shades.
    #[default]
    Clip,
    /// Narkowicz's curve ("ACES Filmic Tone Mapping Curve", 2015): dark parts get more contrast, and bright parts keep
    /// shades up to an exposed radiance of about 7.2.
    Filmic,
}

/// Exposed radiance is cut at this value, because larger values could overflow. All curves give this value
/// their greatest brightness.
const MOST: f64 = 1e6;

impl Tone {
    /// The names of all tone curves, as in scene files.
    pub const NAMES: [&str; 2] = ["clip", "filmic"];

    /// Returns the curve's name in scene files.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// Returns the coefficients a, b, c and d of the curve: exposed radiance x has the brightness
    /// min(x (a x + b) / (x (c x + d) + 1), 1). `cl/common/mark_rough.cl` computes the same formula in single
    /// precision.
    pub fn coefficients(self) -> [f64; 4] {
        match self {
            Self::Clip => [0.0, 1.0, 0.0, 0.0],
            // Narkowicz's coefficients, divided by his last coefficient, so that the constant term of the
            // denominator becomes 1.
            Self::Filmic => [2.51, 0.03, 2.43, 0.59].map(|coefficient| coefficient / 0.14),
        }
    }

    /// Returns the brightness of exposed radiance, from 0 to 1; 0 for NaN and for values below 0.
    pub fn apply(self, exposed: f64) -> f64 {
        let [a, b, c, d] = self.coefficients();
        let x = if exposed > 0.0 { exposed.min(MOST) } else { 0.0 }; // NaN is not above 0
        (x * (a * x + b) / (x * (c * x + d) + 1.0)).min(1.0)
    }

    /// Returns the smallest exposed radiance that has the brightness `brightness`, a number from 0 to 1.
    pub fn inverse(self, brightness: f64) -> f64 {
        // The result is the solution x of (a - c y) x^2 + (b - d y) x - y = 0 that is not negative. This form
        // needs no division by a - c y.
        let ([a, b, c, d], y) = (self.coefficients(), brightness);
        let (square, linear) = (a - c * y, b - d * y);
        2.0 * y / (linear + (linear * linear + 4.0 * square * y).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_curve_cuts_and_the_filmic_curve_has_its_published_values() {
        let clipped = [f64::NAN, -1.0, 0.25, 1.0, 7.0, f64::INFINITY].map(|x| Tone::Clip.apply(x));
        assert_eq!(clipped, [0.0, 0.0, 0.25, 1.0, 1.0, 1.0]);
        // Computed by hand from the formula: at 0.18, (0.18 * 0.4818) / (0.18 * 1.0274 + 0.14) =
        // 0.086724 / 0.324932.
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
        assert_eq!(Tone::NAMES.map(|name| read(name).name()), Tone::NAMES);
    }
}
