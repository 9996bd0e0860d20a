//! Bands of a frame: whole rows of work-groups, so that several devices can cast one frame between them.

use std::ops::Range;

/// Rows of work-groups from the top.
pub type Band = Range<usize>;

/// Cuts `rows` rows of work-groups into a band for each device, so that all take as long. `costs` are measured from top
/// to bottom, each of an equal part of the frame; `speeds` says how fast each device is. Bands may be empty.
pub fn cut(rows: usize, costs: &[f64], speeds: &[f64]) -> Vec<Band> {
    let all_speeds: f64 = speeds.iter().sum();
    let mut bands = Vec::with_capacity(speeds.len());
    let (mut start, mut share) = (0, 0.0);
    for (place, speed) in speeds.iter().enumerate() {
        share += speed / all_speeds;
        let last = place + 1 == speeds.len();
        let end = if last { rows } else { (rows as f64 * height_of(costs, share)).round() as usize };
        let end = end.clamp(start, rows);
        bands.push(start..end);
        start = end;
    }
    bands
}

/// How far down, 0 to 1, this share of the whole cost lies; as far as the share itself where nothing costs anything.
fn height_of(costs: &[f64], share: f64) -> f64 {
    let whole: f64 = costs.iter().sum();
    if !(whole > 0.0 && whole.is_finite()) {
        return share;
    }
    let mut left = share * whole;
    for (part, cost) in costs.iter().enumerate() {
        if left <= *cost && *cost > 0.0 {
            return (part as f64 + left / cost) / costs.len() as f64;
        }
        left -= cost;
    }
    1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_costs_make_equal_bands() {
        assert_eq!(cut(100, &[1.0; 4], &[1.0; 4]), [0..25, 25..50, 50..75, 75..100]);
        assert_eq!(cut(100, &[], &[1.0, 1.0]), [0..50, 50..100]);
        assert_eq!(cut(7, &[2.0], &[5.0])[0], 0..7);
    }

    #[test]
    fn costly_rows_and_slow_devices_make_smaller_bands() {
        // The lower half costs three times as much: 2 of 8 parts of cost lie above, 6 below.
        assert_eq!(cut(80, &[1.0, 3.0], &[1.0, 1.0]), [0..53, 53..80]);
        assert_eq!(cut(80, &[1.0, 1.0], &[3.0, 1.0]), [0..60, 60..80]);
    }

    #[test]
    fn bands_cover_every_row_once_whatever_was_measured() {
        let costs = [vec![], vec![0.0; 3], vec![f64::NAN], vec![0.0, 9.0, 0.0], vec![1e-9, 1e9]];
        for costs in &costs {
            for devices in 1..6 {
                for rows in [0, 1, 2, 17] {
                    let bands = cut(rows, costs, &vec![1.0; devices]);
                    assert_eq!((bands.len(), bands[0].start, bands[devices - 1].end), (devices, 0, rows));
                    assert!(bands.windows(2).all(|pair| pair[0].end == pair[1].start), "{bands:?}");
                }
            }
        }
    }
}
