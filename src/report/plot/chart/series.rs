//! Draws a series of a chart: the line, the markers and the intervals.

use super::super::look::Look;
use super::super::svg::{Svg, number};
use super::Frame;
use crate::entry::entry;

/// A mark: a sign in a plot, such as a disc, that shows a pair of values by its position.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// The mark's x value.
    pub x: f64,
    /// The mark's y value.
    pub y: f64,
    /// The 95% interval of the y value; `None` if the interval is unknown.
    pub interval: Option<[f64; 2]>,
    /// The mark's tooltip, one fact per line.
    pub tip: String,
}

/// A series of marks, such as the times of one strategy.
#[derive(Clone, Debug)]
pub struct Series {
    /// The series' name in the legend. A series without a name is a line without markers, such as a fitted
    /// line. A line without a name belongs to the previous series, and is hidden when the previous series is
    /// hidden.
    pub name: String,
    /// The appearance of the series.
    pub look: Look,
    /// True if a line joins the series' marks, in the order of `marks`.
    pub joined: bool,
    /// The series' marks.
    pub marks: Vec<Mark>,
}

impl Series {
    /// Adds a mark to the series with the name `name`. If `all` contains no series with this name, first adds
    /// one with the appearance `look`. If `joined` is true, a line joins the marks of the new series.
    pub fn add(all: &mut Vec<Self>, name: &str, look: Look, joined: bool, mark: Mark) {
        let new = || Self { name: name.to_owned(), look, joined, marks: Vec::new() };
        entry(all, |series| series.name == name, new).marks.push(mark);
    }

    /// Draws the series. A series without a name, such as a fitted line, has no markers. `index` is the series' index
    /// among the series that have a name. For a series without a name, `index` is the index of the last named series
    /// before it.
    pub(super) fn draw(&self, svg: &mut Svg, frame: &Frame, index: usize) {
        let class = format!("series {}", self.look.class());
        svg.open("g", &[("class", &class), ("data-series", &index)]);
        let placed: Vec<_> = self
            .marks
            .iter()
            .filter_map(|mark| Some((mark, [frame.across.position(mark.x)?, frame.up.position(mark.y)?])))
            .collect();
        if self.joined {
            draw_path(svg, self.look, placed.iter().map(|(_, at)| *at));
        }
        for (mark, at) in placed.into_iter().filter(|_| !self.name.is_empty()) {
            svg.open("g", &[("class", &"mark"), ("data-tip", &mark.tip)]);
            draw_interval(svg, frame, self.look, mark, at[0]);
            self.look.marker(svg, at);
            svg.close("g");
        }
        svg.close("g");
    }
}

fn draw_path(svg: &mut Svg, look: Look, points: impl Iterator<Item = [f64; 2]>) {
    let path: Vec<_> = points.map(|[x, y]| format!("{} {}", number(x), number(y))).collect();
    if path.len() < 2 {
        return;
    }
    let class = if look.dashed { "line dashed" } else { "line" };
    let dashes = if look.dashed { "5 4" } else { "none" };
    svg.element(
        "path",
        &[
            ("class", &class),
            ("d", &format!("M{}", path.join("L"))),
            ("fill", &"none"),
            ("stroke", &look.colour()),
            ("stroke-width", &2),
            ("stroke-linejoin", &"round"),
            ("stroke-dasharray", &dashes),
        ],
    );
}

/// Draws the interval of a mark as a vertical bar with a short line at each end. Leaves out an interval
/// shorter than two units of length of the SVG.
fn draw_interval(svg: &mut Svg, frame: &Frame, look: Look, mark: &Mark, x: f64) {
    let Some([low, high]) = mark.interval else { return };
    let (Some(low), Some(high)) = (frame.up.position(low), frame.up.position(high)) else { return };
    if (low - high).abs() < 2.0 {
        return;
    }
    let path = format!(
        "M{x} {low}V{high}M{left} {low}H{right}M{left} {high}H{right}",
        x = number(x),
        low = number(low),
        high = number(high),
        left = number(x - 3.5),
        right = number(x + 3.5)
    );
    let colour = look.colour();
    svg.element("path", &[("class", &"interval"), ("d", &path), ("stroke", &colour), ("stroke-width", &1.5)]);
}
