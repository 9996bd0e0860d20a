//! Interpolates a track's values between its keyframes.

use super::wire::Interpolation;
use toml::Value;

/// Returns a finite number as `f64`; `None` for infinity, NaN and values that are not numbers.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(number) if number.is_finite() => Some(*number),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    }
}

/// Returns true if a value can be interpolated. A finite number can be interpolated, and so can a list that
/// is not empty and whose elements can all be interpolated.
pub(super) fn is_numeric(value: &Value) -> bool {
    match value {
        Value::Array(elements) => !elements.is_empty() && elements.iter().all(is_numeric),
        other => number(other).is_some(),
    }
}

/// Returns true if two numeric values have the same structure. Any two numbers have the same structure. Two
/// lists have the same structure if they have the same length, and if each two corresponding elements have
/// the same structure.
pub(super) fn are_alike(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| are_alike(a, b))
        }
        (a, b) => !a.is_array() && !b.is_array(),
    }
}

/// Returns the value at the frame `frame`, which lies between the keyframes `begin` and `begin + 1`. `frames`
/// and `values` are the frames and the values of a track's keyframes. Only the keyframes from `begin - 1` to
/// `begin + 2` affect the result, so the other keyframes may be left out. Unless the interpolation is `Step`,
/// all values must have the same structure.
pub(super) fn between(
    (frames, values): (&[f64], &[&Value]),
    begin: usize,
    frame: f64,
    interpolation: Interpolation,
) -> Value {
    let (first, second) = (values[begin], values[begin + 1]);
    if first == second || interpolation == Interpolation::Step {
        return first.clone();
    }
    if let Value::Array(elements) = first {
        let at = |index: usize| {
            let elements: Vec<&Value> = values.iter().map(|value| &value[index]).collect();
            between((frames, &elements), begin, frame, interpolation)
        };
        return Value::Array((0..elements.len()).map(at).collect());
    }
    let numbers: Vec<f64> = values.iter().filter_map(|value| number(value)).collect();
    Value::Float(match interpolation {
        Interpolation::Smooth => smooth(frames, &numbers, begin, frame),
        _ => {
            let part = (frame - frames[begin]) / (frames[begin + 1] - frames[begin]);
            numbers[begin] + part * (numbers[begin + 1] - numbers[begin])
        }
    })
}

/// Returns the value at the frame `frame` of the monotone cubic interpolant of Fritsch and Butland (1984), as
/// in SciPy's `PchipInterpolator`. Between two neighbouring keyframes, the interpolant is monotone: a
/// coordinate of a camera, for example, moves only towards its value at the next keyframe, and never back. The
/// interpolant thus stays between the values of these two keyframes. Therefore, a number that lies in the
/// allowed range at all keyframes lies in this range at all frames.
fn smooth(frames: &[f64], values: &[f64], begin: usize, frame: f64) -> f64 {
    let (from, to) = (values[begin], values[begin + 1]);
    let length = frames[begin + 1] - frames[begin];
    let part = (frame - frames[begin]) / length;
    let slopes = [begin, begin + 1].map(|key| length * slope(frames, values, key));
    // This is Hermite's cubic polynomial, computed from the values and the slopes at both keyframes.
    let (square, cube) = (part * part, part * part * part);
    let value = from
        + (3.0 * square - 2.0 * cube) * (to - from)
        + (cube - 2.0 * square + part) * slopes[0]
        + (cube - square) * slopes[1];
    // Only a rounding error can move the value out of the range between `from` and `to`.
    value.clamp(from.min(to), from.max(to))
}

/// Returns the curve's slope, per frame, at the keyframe `key`. If there are only two keyframes, the curve is
/// a straight line. If there are more than two keyframes, [`end_slope`] computes the slope at the first and
/// the last of them. From each keyframe between these, two straight lines lead to the neighbouring keyframes.
/// The curve's slope is a weighted harmonic mean of the two lines' slopes, so that the curve does not
/// overshoot. If the two lines' slopes have different signs, or if one of them is 0, the curve's slope is 0.
fn slope(frames: &[f64], values: &[f64], key: usize) -> f64 {
    let length = |line: usize| frames[line + 1] - frames[line];
    let line = |line: usize| (values[line + 1] - values[line]) / length(line);
    let last = frames.len() - 1;
    match key {
        _ if last == 1 => line(0),
        0 => end_slope([length(0), length(1)], [line(0), line(1)]),
        _ if key == last => end_slope([length(last - 1), length(last - 2)], [line(last - 1), line(last - 2)]),
        _ => {
            let ([before, after], [left, right]) =
                ([line(key - 1), line(key)], [length(key - 1), length(key)]);
            if before * after <= 0.0 {
                return 0.0;
            }
            let weights = [2.0 * right + left, right + 2.0 * left];
            (weights[0] + weights[1]) / (weights[0] / before + weights[1] / after)
        }
    }
}

/// Returns the slope at the first or the last keyframe. The result is the slope of the parabola through this
/// keyframe and the two nearest keyframes, limited so that the curve does not overshoot (Moler, Numerical
/// Computing with MATLAB, 2004, section 3.6). Two straight lines connect these three keyframes. The first
/// parameter has the lengths of the two lines, in frames; the second parameter has their slopes. In both parameters,
/// the line that begins or ends at the first or last keyframe comes first.
fn end_slope([near, far]: [f64; 2], [line, next]: [f64; 2]) -> f64 {
    let slope = ((2.0 * near + far) * line - near * next) / (near + far);
    if slope * line <= 0.0 {
        0.0
    } else if line * next <= 0.0 && slope.abs() > 3.0 * line.abs() {
        3.0 * line
    } else {
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(frames: &[f64], values: &[f64], frame: f64) -> f64 {
        let begin = frames.iter().rposition(|key| *key <= frame).unwrap_or(0).min(frames.len() - 2);
        smooth(frames, values, begin, frame)
    }

    #[test]
    fn a_smooth_curve_is_fritsch_and_butlands() {
        // The expected values were calculated on paper from the slopes at the four keyframes: 5/2, 6/7, 0 and
        // -17/6.
        let (frames, values) = ([0.0, 1.0, 3.0, 4.0], [0.0, 2.0, 3.0, 1.0]);
        let slopes = [0, 1, 2, 3].map(|key| slope(&frames, &values, key));
        let expected = [5.0 / 2.0, 6.0 / 7.0, 0.0, -17.0 / 6.0];
        assert!(slopes.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{slopes:?}");
        let expected = [
            (0.25, 559.0 / 896.0),
            (0.5, 135.0 / 112.0),
            (2.0, 19.0 / 7.0),
            (2.5, 655.0 / 224.0),
            (3.5, 113.0 / 48.0),
        ];
        for (frame, value) in expected {
            assert!((at(&frames, &values, frame) - value).abs() < 1e-14, "{frame}");
        }
    }

    #[test]
    fn a_smooth_curve_goes_through_its_keys_and_never_leaves_their_range() {
        let (frames, values) = ([1.0, 4.0, 5.0, 9.0, 30.0], [3.0, 3.0, -1.0, 7.0, 7.5]);
        for (frame, value) in frames.into_iter().zip(values) {
            assert_eq!(at(&frames, &values, frame), value);
        }
        for step in 0..290 {
            let frame = 1.0 + f64::from(step) / 10.0;
            let begin = frames.iter().rposition(|key| *key <= frame).unwrap_or(0);
            let (low, high) = (values[begin].min(values[begin + 1]), values[begin].max(values[begin + 1]));
            assert!((low..=high).contains(&at(&frames, &values, frame)), "{frame}");
        }
        // With two keyframes, the curve is a straight line.
        assert_eq!(at(&[1.0, 3.0], &[0.0, 1.0], 1.5), 0.25);
    }

    #[test]
    fn lists_are_mixed_element_by_element_and_what_stays_keeps_its_type() {
        let value = |text: &str| text.parse::<Value>().unwrap_or_else(|error| panic!("{error}"));
        let (a, b) = (value("[1, [2, 0]]"), value("[1, [4, 1.0]]"));
        let middle = between((&[1.0, 3.0], &[&a, &b]), 0, 2.0, Interpolation::Linear);
        assert_eq!(middle, value("[1, [3.0, 0.5]]"));
        assert_eq!(between((&[1.0, 3.0], &[&a, &b]), 0, 2.9, Interpolation::Step), a);
        assert!(are_alike(&a, &b) && !are_alike(&a, &value("[1, 2]")) && !are_alike(&a, &value("1")));
        assert!(is_numeric(&a));
        for other in ["[1, 'a']", "[]", "[0, nan]", "inf", "true"] {
            assert!(!is_numeric(&value(other)), "{other}");
        }
    }

    /// The expected slopes of the parabola were calculated on paper. Consider three keyframes at equal distances
    /// in frames, connected by two straight lines. The first line has the slope 1, and the second line has the
    /// slope `next`. The parabola through the three keyframes has the slope (3 * 1 - next) / 2 at the first
    /// of them.
    #[test]
    fn an_end_has_the_slope_of_a_parabola_unless_the_curve_would_overshoot() {
        for (next, expected) in [(1.0, 1.0), (2.0, 0.5), (3.0, 0.0), (10.0, 0.0), (-1.0, 2.0), (-5.0, 3.0)] {
            assert_eq!(end_slope([1.0, 1.0], [1.0, next]), expected, "{next}");
            assert_eq!(end_slope([1.0, 1.0], [-1.0, -next]), -expected, "{next}");
        }
        // The first line spans twice as many frames as the second line, so the slope is
        // ((4 + 1) * 1 - 2 * 0.5) / 3.
        assert!((end_slope([2.0, 1.0], [1.0, 0.5]) - 4.0 / 3.0).abs() < 1e-15);
    }
}
