//! Formats numbers for people.

/// Formats `value` with `digits` significant digits, or more if its integer part has more digits.
pub fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let magnitude = value.abs().log10().floor() as i32;
    let decimals = (digits - 1 - magnitude).clamp(0, 12) as usize;
    format!("{value:.decimals$}")
}

/// Formats a time for a column of milliseconds.
pub fn ms(value: f64) -> String {
    significant(value, 4)
}

/// Formats a time for a sentence: 1.234 s, 12.34 ms, 56.70 us.
pub fn duration(value_ms: f64) -> String {
    match value_ms.abs() {
        x if x >= 1000.0 => format!("{} s", significant(value_ms / 1000.0, 4)),
        x if x >= 0.1 || x == 0.0 => format!("{} ms", ms(value_ms)),
        _ => format!("{} us", significant(value_ms * 1000.0, 4)),
    }
}

/// Formats a size: "800 x 500".
pub fn by([across, down]: [u32; 2]) -> String {
    format!("{across} x {down}")
}

/// Pads the numbers of a right-aligned column so that their decimal points are aligned.
pub fn align_points(column: Vec<&mut String>) {
    let fraction = |cell: &str| cell.find('.').map_or(0, |place| cell.len() - place);
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
    }

    #[test]
    fn points_stand_below_each_other() {
        let mut column = ["1.25".to_string(), "100".into(), "31.5".into()];
        align_points(column.iter_mut().collect());
        assert_eq!(column, ["1.25", "100   ", "31.5 "]);
    }
}
