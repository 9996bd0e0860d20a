//! Formats numbers for people.

/// Formats `value` with `digits` significant digits, but with at most 12 digits after the point. If the integer part
/// has more than `digits` digits, all its digits are shown.
pub fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    // The exponent of the rounded number: 99.98 with three digits is 1.00e2.
    let rounded = format!("{value:.*e}", (digits - 1).max(0) as usize);
    let magnitude: i32 = rounded.rsplit('e').next().and_then(|exponent| exponent.parse().ok()).unwrap_or(0);
    let decimals = (digits - 1 - magnitude).clamp(0, 12) as usize;
    format!("{value:.decimals$}")
}

/// Formats a time with four significant digits, for a column of milliseconds.
pub fn ms(value: f64) -> String {
    significant(value, 4)
}

/// Formats a time with its unit for a sentence: 1.234 s, 12.34 ms, 56.70 us.
pub fn duration(value_ms: f64) -> String {
    let (unit, per_ms) = unit_of(value_ms);
    format!("{} {unit}", significant(value_ms * per_ms, 4))
}

/// Formats an interval of a time, in the unit in which [`duration`] formats the time: "52.10 to 61.30 us".
pub fn duration_range([low_ms, high_ms]: [f64; 2], value_ms: f64) -> String {
    let (unit, per_ms) = unit_of(value_ms);
    format!("{} to {} {unit}", significant(low_ms * per_ms, 4), significant(high_ms * per_ms, 4))
}

/// Returns the unit for a time, and the number of these units per millisecond.
fn unit_of(value_ms: f64) -> (&'static str, f64) {
    match value_ms.abs() {
        x if x >= 1000.0 => ("s", 1e-3),
        x if x >= 0.1 || x == 0.0 => ("ms", 1.0),
        _ => ("us", 1e3),
    }
}

/// Formats a size: "800 x 500".
pub fn by([across, down]: [u32; 2]) -> String {
    format!("{across} x {down}")
}

/// Pads the numbers of a right-aligned column so that their decimal points are aligned.
pub fn align_points(column: Vec<&mut String>) {
    let fraction = |cell: &str| cell.find('.').map_or(0, |index| cell.len() - index);
    let widest = column.iter().map(|cell| fraction(cell)).max().unwrap_or(0);
    for cell in column {
        let missing = widest - fraction(cell);
        cell.push_str(&" ".repeat(missing));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_as_many_digits_as_they_mean() {
        assert_eq!(ms(0.012_342), "0.01234");
        assert_eq!(ms(12.3456), "12.35");
        assert_eq!(ms(163_000.4), "163000");
        assert_eq!(duration(1234.4), "1.234 s");
        assert_eq!(duration(0.0123), "12.30 us");
        let times = [0.0, 0.0999, 0.1, 999.9, 1000.0, -2000.0].map(duration);
        assert_eq!(times, ["0 ms", "99.90 us", "0.1000 ms", "999.9 ms", "1.000 s", "-2.000 s"]);
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(duration_range([0.0647, 0.1234], 0.0705), "64.70 to 123.4 us");
        assert_eq!(duration_range([999.0, 1100.0], 1050.0), "0.9990 to 1.100 s");
    }

    #[test]
    fn a_number_that_is_rounded_up_has_no_more_digits_than_others() {
        let three = [99.94, 99.98, 9.996, -0.099_96, 0.9996].map(|value| significant(value, 3));
        assert_eq!(three, ["99.9", "100", "10.0", "-0.100", "1.00"]);
        assert_eq!([999.94, 999.96].map(ms), ["999.9", "1000"]);
    }

    #[test]
    fn points_stand_below_each_other() {
        let mut column = ["1.25".to_string(), "100".into(), "31.5".into()];
        align_points(column.iter_mut().collect());
        assert_eq!(column, ["1.25", "100   ", "31.5 "]);
    }
}
