//! The scales of a plot's axes, which convert values to positions in pixels and choose ticks.

/// Whether the scale of an axis is linear or logarithmic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Equal distances on the axis mean equal differences between values. A linear scale from [`Scale::over`]
    /// begins at 0 unless some values are negative, or there are no values.
    Linear,
    /// Equal distances on the axis mean equal ratios of values.
    Log,
}

/// The scale of an axis, given by the values at the axis's two ends and by the positions of these ends in
/// pixels.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    kind: Kind,
    values: [f64; 2],
    positions: [f64; 2],
}

impl Scale {
    /// Creates a scale that contains all `values` with some margin. Ignores values that the scale cannot show, such as
    /// 0 on a logarithmic scale. If no value is negative, a linear scale begins at 0. If no value can be shown, the
    /// scale goes from 1 to 10.
    pub fn over(kind: Kind, values: impl Iterator<Item = f64>, positions: [f64; 2]) -> Self {
        let shown = values.filter(|value| value.is_finite() && (kind == Kind::Linear || *value > 0.0));
        let (low, high) = shown
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let values = match kind {
            _ if low > high => [1.0, 10.0],
            Kind::Linear => {
                let span = high - low.min(0.0);
                // All values can be 0, for example if a timer is coarse. An axis of zeros ends at 1, so that
                // its ticks are readable numbers.
                let room = if span > 0.0 { 0.05 * span } else { 1.0 };
                [if low < 0.0 { low - room } else { 0.0 }, high + room]
            }
            Kind::Log => {
                // The axis spans at least a factor of two, since on a shorter axis, noise would look like a
                // difference.
                let room = (high / low).powf(0.05).max((2.0 / (high / low)).sqrt());
                [low / room, high * room]
            }
        };
        Self { kind, values, positions }
    }

    /// Creates a scale from the values at its two ends, and the positions of these ends in pixels.
    pub fn between(kind: Kind, values: [f64; 2], positions: [f64; 2]) -> Self {
        Self { kind, values, positions }
    }

    /// Returns the position of a value in pixels. Returns `None` for 0 and negative values on a logarithmic
    /// scale.
    pub fn position(&self, value: f64) -> Option<f64> {
        let along = match self.kind {
            Kind::Linear => (value - self.values[0]) / (self.values[1] - self.values[0]),
            Kind::Log => (value / self.values[0]).ln() / (self.values[1] / self.values[0]).ln(),
        };
        let position = self.positions[0] + along * (self.positions[1] - self.positions[0]);
        position.is_finite().then_some(position)
    }

    /// Returns the values at the two ends of the axis.
    pub fn ends(&self) -> [f64; 2] {
        self.values
    }

    /// Returns the round values at which the axis has ticks, in order.
    pub fn ticks(&self) -> Vec<f64> {
        match self.kind {
            Kind::Linear => linear_ticks(self.values),
            Kind::Log => log_ticks(self.values),
        }
    }
}

/// Returns about three to seven multiples of 1, 2 or 5 times a power of ten.
fn linear_ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let rough = (high - low) / 5.0;
    let power = 10f64.powf(rough.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|step| *step >= rough * 0.75);
    let step = step.unwrap_or(rough);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    (first..=last.min(first + 20)).map(|count| count as f64 * step).collect()
}

/// Returns the ticks of a logarithmic axis, which are powers of ten. If the axis spans a short range, also
/// returns ticks between these powers, such as 2 and 5 times a power of ten. For a long range, returns only
/// every second, third, ... power of ten.
fn log_ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = (high / low).log10();
    let between: &[f64] = match decades {
        d if d < 0.7 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
        d if d < 3.0 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let every = (decades / 8.0).ceil().max(1.0) as usize;
    (first..=last)
        .step_by(every)
        .flat_map(|power| between.iter().map(move |factor| factor * 10f64.powi(power)))
        .filter(|tick| (low..=high).contains(tick))
        .collect()
}

/// Returns the label of a tick, with as few digits as possible. Large values end with "k", "M" or "G" (thousands,
/// millions or billions), and very small values have an exponent, such as "5e-5".
pub fn label(value: f64) -> String {
    let rounded = format!("{value:.6}");
    let short =
        if rounded.contains('.') { rounded.trim_end_matches('0').trim_end_matches('.') } else { &rounded };
    match value.abs() {
        x if x >= 1e9 => format!("{}G", label(value / 1e9)),
        x if x >= 1e6 => format!("{}M", label(value / 1e6)),
        x if x >= 1e4 => format!("{}k", label(value / 1e3)),
        x if x > 0.0 && x < 1e-4 => format!("{value:.0e}"),
        _ => short.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_scale_gives_equal_factors_equal_room_and_leaves_out_zero() {
        let scale = Scale::over(Kind::Log, [0.0, 1.0, 100.0].into_iter(), [0.0, 100.0]);
        let [a, b, c] = [1.0, 10.0, 100.0].map(|value| scale.position(value).expect("it is on the scale"));
        assert!((b - a - (c - b)).abs() < 1e-9 && a > 0.0 && c < 100.0);
        assert_eq!(scale.position(0.0), None);
    }

    #[test]
    fn a_linear_axis_begins_at_0_unless_values_are_below() {
        let begins = |values: [f64; 2]| Scale::over(Kind::Linear, values.into_iter(), [0.0, 1.0]).ends()[0];
        assert_eq!(begins([100.0, 120.0]), 0.0);
        assert!(begins([-10.0, 10.0]) < -10.0);
    }

    #[test]
    fn a_linear_axis_of_zeros_ends_at_1() {
        let scale = Scale::over(Kind::Linear, [0.0, 0.0].into_iter(), [0.0, 100.0]);
        assert_eq!((scale.ends(), scale.position(0.0)), ([0.0, 1.0], Some(0.0)));
    }

    #[test]
    fn ticks_are_round_and_few() {
        let scale = Scale::over(Kind::Linear, [3.0, 163_000.0].into_iter(), [0.0, 1.0]);
        assert_eq!(scale.ticks(), [0.0, 50_000.0, 100_000.0, 150_000.0]);
        let scale = Scale::over(Kind::Log, [0.01, 5000.0].into_iter(), [0.0, 1.0]);
        assert_eq!(scale.ticks().len(), 6, "{:?}", scale.ticks());
        // A logarithmic axis that spans less than a factor of ten has ticks, too.
        assert_eq!(Scale::between(Kind::Log, [2.0, 9.0], [0.0, 1.0]).ticks(), [2.0, 3.0, 4.0, 5.0, 6.0, 8.0]);
        assert_eq!(Scale::between(Kind::Log, [30.0, 600.0], [0.0, 1.0]).ticks(), [50.0, 100.0, 200.0, 500.0]);
        // On a long logarithmic axis, only every second power of ten is a tick.
        let long = Scale::between(Kind::Log, [1.0, 1e12], [0.0, 1.0]).ticks();
        assert_eq!(long, [1.0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12]);
        assert_eq!([0.01, 1500.0, 150_000.0].map(label), ["0.01", "1500", "150k"]);
    }

    #[test]
    fn no_values_still_make_a_scale() {
        let scale = Scale::over(Kind::Log, std::iter::empty(), [0.0, 1.0]);
        assert!(!scale.ticks().is_empty());
    }

    #[test]
    fn a_linear_scale_between_values_other_than_zero_places_them_evenly() {
        let scale = Scale::between(Kind::Linear, [10.0, 20.0], [100.0, 200.0]);
        assert_eq!([10.0, 15.0, 20.0].map(|value| scale.position(value)), [100.0, 150.0, 200.0].map(Some));
        // On a vertical axis, values grow upwards, while the y coordinates of pixels grow downwards.
        let up = Scale::between(Kind::Linear, [10.0, 20.0], [200.0, 100.0]);
        assert_eq!(up.position(12.5), Some(175.0));
    }

    #[test]
    fn labels_are_as_short_as_they_can_be() {
        let values = [0.0, 0.00005, 0.0001, 0.25, 9999.0, 1e4, 2.5e6, 3e9, -2e4];
        let expected = ["0", "5e-5", "0.0001", "0.25", "9999", "10k", "2.5M", "3G", "-20k"];
        assert_eq!(values.map(label), expected);
    }

    #[test]
    fn ticks_of_an_axis_far_from_zero_are_those_of_its_range() {
        let scale = Scale::between(Kind::Linear, [100.0, 110.0], [0.0, 1.0]);
        assert_eq!(scale.ticks(), [100.0, 102.0, 104.0, 106.0, 108.0, 110.0]);
    }

    #[test]
    fn a_linear_axis_has_up_to_seven_ticks() {
        let scale = Scale::between(Kind::Linear, [0.0, 6.0], [0.0, 1.0]);
        assert_eq!(scale.ticks(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }
}
