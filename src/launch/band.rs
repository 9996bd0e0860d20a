//! A band of a frame consists of whole rows of work-groups. Several devices cast one frame by casting one band each.

use std::ops::Range;

/// A band of a frame: a range of the frame's rows of work-groups, counted from the top.
pub type Band = Range<usize>;

/// Number of bisections with which [`balance`] searches for the time that each part takes. After `HALVINGS`
/// bisections, the time is as precise as a floating-point number allows.
const HALVINGS: usize = 60;

/// The time that a device takes for a frame, and how this time is distributed over the frame's rows.
#[derive(Clone, Debug)]
pub struct Cost {
    /// The time that the device takes for the whole frame.
    pub whole_ms: f64,
    /// The frame is divided into parts of about the same height. For each part, from top to bottom, this list has the
    /// cost of a row of pixels, in any unit. Empty if the costs are not known.
    pub parts: Vec<f64>,
}

impl Cost {
    /// Returns the device's time for each part of the frame (see `parts`) in milliseconds. The times add up
    /// to `whole_ms`. If the sum of the costs is not a positive finite number, the whole frame is the only
    /// part.
    fn parts_ms(&self) -> Vec<f64> {
        let sum: f64 = self.parts.iter().sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return vec![self.whole_ms];
        }
        self.parts.iter().map(|part| part / sum * self.whole_ms).collect()
    }

    /// Returns the position in the frame (0 is the top, 1 the bottom) that a device reaches in `ms`
    /// milliseconds if it begins at the position `from`. `parts_ms` are the device's times for parts of equal
    /// height.
    fn reach(parts_ms: &[f64], from: f64, mut ms: f64) -> f64 {
        let count = parts_ms.len() as f64;
        let mut at = from * count;
        while at < count {
            let part = at as usize;
            let left = part as f64 + 1.0 - at;
            let cost = parts_ms[part] * left;
            if cost > ms {
                return (at + left * ms / cost) / count;
            }
            ms -= cost;
            at = part as f64 + 1.0;
        }
        1.0
    }
}

/// Divides a frame into one part per device, so that all parts take equally long. Returns where each part ends (0 is
/// the top of the frame, 1 the bottom), and the time of a part in milliseconds.
pub fn balance(costs: &[Cost]) -> (Vec<f64>, f64) {
    let parts: Vec<Vec<f64>> = costs.iter().map(Cost::parts_ms).collect();
    let ends = |ms: f64| -> Vec<f64> {
        let mut height = 0.0;
        let mut end = |parts: &Vec<f64>| {
            height = Cost::reach(parts, height, ms);
            height
        };
        parts.iter().map(&mut end).collect()
    };
    // The fastest device alone casts the whole frame in `enough` milliseconds, so `enough` milliseconds are enough for
    // all devices together.
    let (mut short, mut enough) = (0.0, costs.iter().map(|cost| cost.whole_ms).fold(f64::INFINITY, f64::min));
    for _ in 0..HALVINGS {
        let middle = (short + enough) / 2.0;
        let all = ends(middle).last().is_none_or(|end| *end >= 1.0);
        if all { enough = middle } else { short = middle }
    }
    let mut ends = ends(enough);
    if let Some(last) = ends.last_mut() {
        *last = 1.0;
    }
    (ends, enough)
}

/// Returns the rows of pixels of each device's part: the first row, and the row after the last. `ends` are
/// the ends of the parts, as [`balance`] returns them. `height` is the frame's height in pixels, and
/// `group_heights` are the heights in pixels of the devices' work-groups. A device's part of the frame,
/// unless it is empty, begins at a multiple of the height of the device's work-groups.
pub fn rows(ends: &[f64], height: u32, group_heights: &[u32]) -> Vec<[u32; 2]> {
    let mut starts = vec![0_u32];
    for (end, group) in ends.iter().zip(&group_heights[1..]) {
        let groups = (end * f64::from(height) / f64::from(*group)).round() as u32;
        let last = starts.last().copied().unwrap_or(0);
        starts.push((groups * group).max(last.next_multiple_of(*group)).min(height));
    }
    let next = starts.iter().skip(1).copied().chain([height]);
    starts.iter().zip(next).map(|(start, next)| [*start, next]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(whole_ms: f64, parts: &[f64]) -> Cost {
        Cost { whole_ms, parts: parts.to_vec() }
    }

    fn cut(costs: &[Cost], height: u32) -> Vec<[u32; 2]> {
        rows(&balance(costs).0, height, &vec![1; costs.len()])
    }

    #[test]
    fn equal_costs_make_equal_parts() {
        assert_eq!(cut(&vec![cost(8.0, &[1.0; 4]); 4], 100), [[0, 25], [25, 50], [50, 75], [75, 100]]);
        assert_eq!(cut(&vec![cost(8.0, &[]); 2], 100), [[0, 50], [50, 100]]);
        assert_eq!(cut(&[cost(5.0, &[2.0])], 7), [[0, 7]]);
        assert!((balance(&vec![cost(8.0, &[]); 4]).1 - 2.0).abs() < 1e-9);
    }

    #[test]
    fn costly_rows_and_slow_devices_make_smaller_parts() {
        // The lower half of the frame costs three times as much as the upper half. If the frame costs 8
        // units, each device gets 4 units: the first device casts the upper half (2 units) and a third of the
        // lower half (2 of 6 units).
        let lower = [1.0, 3.0];
        assert_eq!(cut(&vec![cost(1.0, &lower); 2], 80), [[0, 53], [53, 80]]);
        assert_eq!(cut(&[cost(1.0, &[1.0]), cost(3.0, &[1.0])], 80), [[0, 60], [60, 80]]);
        // Each device has its own costs of casting the frame's rows. The second device needs time only for
        // the lower half. The two devices take equally long if the first device casts the upper two thirds
        // and the second device casts the lowest third.
        let (ends, ms) = balance(&[cost(4.0, &[1.0, 1.0]), cost(4.0, &[0.0, 1.0])]);
        assert!((ends[0] - 2.0 / 3.0).abs() < 1e-9 && (ms - 8.0 / 3.0).abs() < 1e-9, "{ends:?} {ms}");
    }

    #[test]
    fn a_part_begins_where_its_devices_work_groups_do() {
        let ends = balance(&vec![cost(1.0, &[]); 3]).0;
        assert_eq!(rows(&ends, 100, &[8, 16, 1]), [[0, 32], [32, 67], [67, 100]]);
        // The part of a device whose work-groups are 64 pixels high can begin only at row 0 or at the end of the
        // ten rows. In the first case, the second device begins at row 0, so the first device gets no rows. In the
        // second case, the third device begins at the end, so it gets no rows itself.
        assert_eq!(rows(&ends, 10, &[1, 64, 1]), [[0, 0], [0, 7], [7, 10]]);
        assert_eq!(rows(&ends, 10, &[1, 1, 64]), [[0, 3], [3, 10], [10, 10]]);
        // The nearest row at which a work-group of the third device may begin is row 8, but row 8 belongs to the
        // first device.
        assert_eq!(rows(&[0.09, 0.1, 1.0], 100, &[1, 3, 8]), [[0, 9], [9, 16], [16, 100]]);
    }

    /// If the costs have no finite positive sum, the frame is divided as if all its rows cost the same.
    #[test]
    fn costs_without_a_finite_sum_do_not_tell_where_the_time_goes() {
        for parts in [[1.0, f64::INFINITY], [1.0, f64::NAN], [0.0, 0.0]] {
            assert_eq!(cut(&vec![cost(8.0, &parts); 2], 100), [[0, 50], [50, 100]], "{parts:?}");
        }
    }

    #[test]
    fn parts_cover_every_row_once_whatever_was_measured() {
        let parts = [vec![], vec![0.0; 3], vec![f64::NAN], vec![0.0, 9.0, 0.0], vec![1e-9, 1e9]];
        for parts in &parts {
            for devices in 1..6 {
                for height in [1, 2, 17, 1000] {
                    for group in [1, 3, 32] {
                        let ends = balance(&vec![cost(2.0, parts); devices]).0;
                        let rows = rows(&ends, height, &vec![group; devices]);
                        assert_eq!((rows.len(), rows[0][0], rows[devices - 1][1]), (devices, 0, height));
                        assert!(rows.windows(2).all(|pair| pair[0][1] == pair[1][0]), "{rows:?}");
                        assert!(rows.iter().all(|[start, end]| start <= end), "{rows:?}");
                        assert!(
                            rows.iter().all(|[start, end]| start == end || start % group == 0),
                            "{rows:?}"
                        );
                    }
                }
            }
        }
    }
}
