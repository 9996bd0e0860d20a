//! The appearance of the series of plots: colours and markers. With markers, a reader can tell more series
//! apart than with colours alone.

use super::palette::SERIES;
use super::svg::{Svg, number};

/// Number of different markers.
const MARKERS: usize = 6;

/// The colour and marker of a series. Plots use seven colours and six markers. Since seven and six have no
/// common divisor, 42 series in a row have different combinations of colour and marker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Look {
    /// The number of the series, which determines the series' colour and marker.
    pub number: usize,
    /// True if the series has a dashed line and empty markers. Values that the student paper published, fitted
    /// lines and roofs (measured peak rates) are shown in this way.
    pub dashed: bool,
}

impl Look {
    /// Returns the appearance of the series with the given number.
    pub fn of(number: usize) -> Self {
        Self { number, dashed: false }
    }

    /// Returns the colour of the series in SVG and PNG files. On a page, the style sheet replaces the
    /// returned colour with its own.
    pub fn colour(self) -> &'static str {
        SERIES[self.number % SERIES.len()]
    }

    /// Returns the CSS class by which the style sheet of a page sets the colour of the series.
    pub fn class(self) -> String {
        format!("s{}", self.number % SERIES.len())
    }

    /// Draws the series' marker at a position.
    pub fn marker(self, svg: &mut Svg, [x, y]: [f64; 2]) {
        let path = shape(self.number % MARKERS, [x, y]);
        let (fill, stroke) =
            if self.dashed { ("#ffffff", self.colour()) } else { (self.colour(), "#ffffff") };
        let class = if self.dashed { "dot hollow" } else { "dot" };
        svg.element("path", &[("class", &class), ("fill", &fill), ("stroke", &stroke), ("d", &path)]);
    }
}

/// Returns the path of a marker around a position: a disc, square, triangle up, diamond, triangle down or
/// cross. All markers look similarly large.
fn shape(which: usize, [x, y]: [f64; 2]) -> String {
    let polygon = |corners: &[[f64; 2]]| {
        let points = corners.iter().map(|[dx, dy]| format!("{} {}", number(x + dx), number(y + dy)));
        format!("M{}Z", points.collect::<Vec<_>>().join("L"))
    };
    match which {
        0 => format!("M{} {}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0Z", number(x - 4.0), number(y)),
        1 => polygon(&[[-3.6, -3.6], [3.6, -3.6], [3.6, 3.6], [-3.6, 3.6]]),
        2 => polygon(&[[0.0, -4.9], [4.6, 3.4], [-4.6, 3.4]]),
        3 => polygon(&[[0.0, -5.0], [5.0, 0.0], [0.0, 5.0], [-5.0, 0.0]]),
        4 => polygon(&[[0.0, 4.9], [4.6, -3.4], [-4.6, -3.4]]),
        _ => polygon(&[
            [-1.7, -4.8],
            [1.7, -4.8],
            [1.7, -1.7],
            [4.8, -1.7],
            [4.8, 1.7],
            [1.7, 1.7],
            [1.7, 4.8],
            [-1.7, 4.8],
            [-1.7, 1.7],
            [-4.8, 1.7],
            [-4.8, -1.7],
            [-1.7, -1.7],
        ]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn forty_two_series_look_different() {
        let looks: std::collections::HashSet<_> = (0..42)
            .map(|number| {
                let mut svg = Svg::default();
                Look::of(number).marker(&mut svg, [0.0, 0.0]);
                svg.finish([1.0, 1.0], "", "")
            })
            .collect();
        assert_eq!(looks.len(), 42);
        assert_eq!(Look::of(42).colour(), Look::of(0).colour());
    }

    #[test]
    fn the_left_half_of_a_marker_is_the_mirrored_right_half() {
        let corner = |text: &str| {
            let (x, y) = text.split_once(' ').expect("two numbers");
            [x, y].map(|value| (10.0 * value.parse::<f64>().expect("a number")).round() as i32)
        };
        for which in 1..=5 {
            let path = shape(which, [0.0, 0.0]);
            let corners: BTreeSet<[i32; 2]> = path.trim_matches(['M', 'Z']).split('L').map(corner).collect();
            let mirrored: BTreeSet<[i32; 2]> = corners.iter().map(|[x, y]| [-x, *y]).collect();
            assert_eq!(corners, mirrored, "{path}");
        }
    }

    #[test]
    fn only_published_values_have_empty_markers() {
        let is_hollow = |look: Look| {
            let mut svg = Svg::default();
            look.marker(&mut svg, [0.0, 0.0]);
            let text = svg.finish([1.0, 1.0], "", "");
            let [full, empty] = [(look.colour(), "#ffffff"), ("#ffffff", look.colour())]
                .map(|(fill, stroke)| text.contains(&format!("fill=\"{fill}\" stroke=\"{stroke}\"")));
            assert_ne!(full, empty, "{text}");
            assert_eq!(text.contains("hollow"), empty, "{text}");
            empty
        };
        assert!(!is_hollow(Look::of(3)) && is_hollow(Look { dashed: true, ..Look::of(3) }));
    }
}
