//! Draws charts with two axes: lines with intervals, or scattered marks.

mod series;

use super::layout::{LETTER, Layout, NARROW, WIDE};
use super::legend;
use super::palette::{FAINT, GRID};
use super::scale::{self, Kind, Scale};
use super::shorten::{shorten, shorten_all};
use super::svg::{Anchor, LINE, Svg};
pub use series::{Mark, Series};

/// The largest number of characters of a slanted name at the x axis. Longer names are shortened.
const LONGEST_SLANTED: usize = 20;

/// What the x axis of a chart shows: names or numbers.
#[derive(Clone, Debug)]
pub enum Across {
    /// Names at equal distances. The x value of a mark (a sign in the chart) is the index of the mark's name
    /// in this list.
    Names(Vec<String>),
    /// Numbers, on a linear or logarithmic scale.
    Numbers(Kind),
}

/// A chart with two axes, in which each mark shows a pair of values.
#[derive(Clone, Debug)]
pub struct Chart {
    /// The chart's title.
    pub title: String,
    /// The label of the x axis: the quantity and its unit.
    pub x_label: String,
    /// The label of the y axis: the quantity and its unit.
    pub y_label: String,
    /// What the x axis shows.
    pub across: Across,
    /// Whether the scale of the y axis is linear or logarithmic.
    pub up: Kind,
    /// True if the chart shows the line y = x.
    pub diagonal: bool,
    /// The series of marks.
    pub series: Vec<Series>,
}

/// The positions of a chart's axes in pixels. If slanted names need more room than the layout has on the left
/// of the axes, `left` is larger than in `layout`.
struct Frame {
    layout: Layout,
    across: Scale,
    up: Scale,
    top: f64,
    bottom: f64,
    left: f64,
    right: f64,
}

impl Chart {
    /// Returns the chart as SVG for a screen.
    pub fn svg(&self) -> String {
        self.drawn(WIDE)
    }

    /// Returns the chart as SVG for a phone: narrow, with the legend below the axes.
    pub fn narrow_svg(&self) -> String {
        self.drawn(NARROW)
    }

    fn drawn(&self, layout: Layout) -> String {
        let frame = self.frame(layout);
        let mut svg = Svg::default();
        let title = [(layout.left - 50.0).min(16.0), 18.0];
        svg.lines("title", title, Anchor::Start, &layout.lines(&self.title));
        self.draw_axes(&mut svg, &frame);
        if self.diagonal {
            draw_diagonal(&mut svg, &frame);
        }
        let mut named = 0;
        for series in &self.series {
            named += usize::from(!series.name.is_empty());
            series.draw(&mut svg, &frame, named.saturating_sub(1));
        }
        let named = self.series.iter().filter(|series| !series.name.is_empty());
        let entries: Vec<_> = named.map(|series| (series.name.as_str(), series.look)).collect();
        let bottom = self.label_top(&frame) + LINE * layout.lines(&self.x_label).len() as f64;
        let beside = [frame.right + 18.0, frame.top + 8.0];
        let legend = if layout.legend_below { [layout.left - 40.0, bottom + 12.0] } else { beside };
        let legend_end = legend::draw(&mut svg, legend, &entries);
        let size = [layout.whole_width(), bottom.max(legend_end + 8.0)];
        let about = format!("{} against {}", self.y_label, self.x_label);
        svg.finish(size, &self.title, &about)
    }

    fn frame(&self, layout: Layout) -> Frame {
        let marks = || self.series.iter().flat_map(|series| &series.marks);
        let top = layout.top + LINE * (layout.lines(&self.title).len() - 1) as f64;
        let (right, bottom) = (layout.left + layout.width, top + layout.height);
        let heights = marks().flat_map(|mark| {
            let [low, high] = mark.interval.unwrap_or([mark.y; 2]);
            [low, mark.y, high]
        });
        let left = layout.left + self.missing_room(layout);
        let positions = [left, right];
        let across = match &self.across {
            Across::Names(names) => {
                let ends = [-0.5, names.len().max(1) as f64 - 0.5];
                Scale::between(Kind::Linear, ends, positions)
            }
            Across::Numbers(kind) => Scale::over(*kind, marks().map(|mark| mark.x), positions),
        };
        Frame { layout, across, up: Scale::over(self.up, heights, [bottom, top]), top, bottom, left, right }
    }

    /// Returns the y coordinate of the x axis's label.
    fn label_top(&self, frame: &Frame) -> f64 {
        frame.bottom + 36.0 + self.names_height(frame.layout)
    }

    fn draw_axes(&self, svg: &mut Svg, frame: &Frame) {
        let left = frame.left;
        for tick in frame.up.ticks() {
            let Some(y) = frame.up.position(tick) else { continue };
            svg.line("grid", GRID, [left, y], [frame.right, y]);
            svg.text_in("faint", FAINT, [left - 7.0, y + 4.0], Anchor::End, &scale::label(tick));
        }
        let slanted = self.names_are_slanted(frame.layout);
        let ticks = self.ticks_across(frame);
        let names: Vec<&str> = ticks.iter().map(|(_, name)| name.as_str()).collect();
        let short = shorten_all(&names, LONGEST_SLANTED);
        for ((tick, name), short) in ticks.iter().zip(&short) {
            let Some(x) = frame.across.position(*tick) else { continue };
            svg.line("grid", GRID, [x, frame.top], [x, frame.bottom]);
            if slanted {
                svg.slanted_text("faint", FAINT, [x + 4.0, frame.bottom + 14.0], short);
            } else {
                svg.text_in("faint", FAINT, [x, frame.bottom + 17.0], Anchor::Middle, name);
            }
        }
        svg.line("axis", FAINT, [left, frame.bottom], [frame.right, frame.bottom]);
        let middle = [f64::midpoint(frame.layout.left, frame.right), self.label_top(frame)];
        svg.lines("label", middle, Anchor::Middle, &frame.layout.lines(&self.x_label));
        // A shortened label keeps its end, which is usually the unit.
        let label = shorten(&self.y_label, longest_upright(frame.layout));
        svg.upright_text("label", [16.0, f64::midpoint(frame.top, frame.bottom)], &label);
    }

    /// Returns the number of characters of the longest name at the x axis, but at most `LONGEST_SLANTED`.
    fn longest_name(&self) -> usize {
        match &self.across {
            Across::Names(names) => {
                let lengths = names.iter().map(|name| name.chars().count().min(LONGEST_SLANTED));
                lengths.max().unwrap_or(0)
            }
            Across::Numbers(_) => 0,
        }
    }

    /// Returns true if the names at the x axis are slanted, because horizontal names would overlap.
    fn names_are_slanted(&self, layout: Layout) -> bool {
        let Across::Names(names) = &self.across else { return false };
        names.len() as f64 * LETTER * (self.longest_name() + 1) as f64 > layout.width
    }

    /// Returns the additional height in pixels that the names at the x axis need.
    fn names_height(&self, layout: Layout) -> f64 {
        if self.names_are_slanted(layout) { 0.57 * LETTER * self.longest_name() as f64 } else { 4.0 }
    }

    /// Returns the additional width in pixels that slanted names need on the left of the axes, so that each
    /// name begins within the chart. A slanted name ends below its tick.
    fn missing_room(&self, layout: Layout) -> f64 {
        let names = match &self.across {
            Across::Names(names) if self.names_are_slanted(layout) => names.as_slice(),
            _ => return 0.0,
        };
        let missing = names.iter().enumerate().map(|(index, name)| {
            let width = 0.82 * LETTER * name.chars().count().min(LONGEST_SLANTED) as f64;
            // The distance of the tick from the left end of the x axis, as a fraction of the axis's length. The axis
            // becomes shorter by the additional width.
            let part = (index as f64 + 0.5) / names.len() as f64;
            (width - layout.left - part * layout.width) / (1.0 - part)
        });
        missing.fold(0.0, f64::max)
    }

    /// Returns the positions and labels of the ticks of the x axis. If even slanted names would overlap, only
    /// every second, third, ... name has a tick.
    fn ticks_across(&self, frame: &Frame) -> Vec<(f64, String)> {
        match &self.across {
            Across::Names(names) => {
                let every = (names.len() as f64 * 15.0 / (frame.right - frame.left)).ceil().max(1.0) as usize;
                let labelled = names.iter().enumerate().step_by(every);
                labelled.map(|(index, name)| (index as f64, name.clone())).collect()
            }
            Across::Numbers(_) => {
                frame.across.ticks().into_iter().map(|tick| (tick, scale::label(tick))).collect()
            }
        }
    }
}

/// Returns the largest number of characters of the y axis's label. The label may extend beyond each end of the axis by
/// the distance `layout.top`.
fn longest_upright(layout: Layout) -> usize {
    ((layout.height + 2.0 * layout.top) / LETTER) as usize
}

/// Draws the line y = x, with the label "equal", within the range of both axes. Draws nothing if the two ranges do not
/// overlap.
fn draw_diagonal(svg: &mut Svg, frame: &Frame) {
    let ([x_low, x_high], [y_low, y_high]) = (frame.across.ends(), frame.up.ends());
    let ends = [x_low.max(y_low), x_high.min(y_high)];
    if ends[0] >= ends[1] {
        return;
    }
    let point_at = |value| Some([frame.across.position(value)?, frame.up.position(value)?]);
    if let (Some(low), Some(high)) = (point_at(ends[0]), point_at(ends[1])) {
        svg.line("axis dashed", FAINT, low, high);
        svg.text_in("faint small", FAINT, [high[0] - 6.0, high[1] + 16.0], Anchor::End, "equal");
    }
}

#[cfg(test)]
mod tests {
    use super::super::look::Look;
    use super::*;

    fn chart(name: &str) -> Chart {
        let mark = |x: f64, y: f64| Mark { x, y, interval: Some([y * 0.5, y * 1.5]), tip: format!("{y} ms") };
        Chart {
            title: name.into(),
            x_label: "local size".into(),
            y_label: "ms".into(),
            across: Across::Names(vec!["1x1".into(), "2x2".into()]),
            up: Kind::Log,
            diagonal: false,
            series: vec![Series {
                name: name.into(),
                look: Look::of(0),
                joined: true,
                marks: vec![mark(0.0, 10.0), mark(1.0, 1.0), mark(1.0, 0.0)],
            }],
        }
    }

    #[test]
    fn every_mark_that_the_scale_can_show_is_drawn_and_tells_of_itself() {
        let text = chart("naive").svg();
        assert_eq!(text.matches("class=\"mark\"").count(), 2, "zero has no logarithm");
        assert!(text.contains("data-tip=\"10 ms\""));
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }

    #[test]
    fn names_cannot_break_out() {
        assert!(!chart("</svg><script>alert(1)</script>").svg().contains("<script"));
    }

    #[test]
    fn only_names_that_would_overlap_are_slanted() {
        let slanted = |count: usize| {
            let names = vec!["a name of 20 letters".to_owned(); count];
            let chart = Chart { across: Across::Names(names), ..chart("naive") };
            chart.svg().contains("rotate(-35)")
        };
        assert_eq!([2, 20].map(slanted), [false, true]);
    }

    #[test]
    fn the_label_of_the_x_axis_stands_below_slanted_names() {
        let names = vec!["a name of 20 letters".to_owned(); 20];
        let chart = Chart { across: Across::Names(names), ..chart("naive") };
        let frame = chart.frame(WIDE);
        // A slanted name ends 14 pixels below the axis. Its beginning is lower, since the name rises at 35
        // degrees.
        let lowest = frame.bottom + 14.0 + 20.0 * LETTER * 35.0_f64.to_radians().sin();
        assert!(chart.label_top(&frame) > lowest, "{} is above {lowest}", chart.label_top(&frame));
    }

    #[test]
    fn slanted_names_begin_within_the_chart() {
        let names = (0..20).map(|number| format!("a scene of {number} triangles")).collect();
        let chart = Chart { across: Across::Names(names), ..chart("naive") };
        for svg in [chart.svg(), chart.narrow_svg()] {
            let slanted = svg.split("translate(").filter(|part| part.contains("rotate(-35)"));
            let begins = slanted.map(|part| {
                let end: f64 = part.split(' ').next().and_then(|x| x.parse().ok()).expect("a number");
                let name = part.split("</text>").next().and_then(|text| text.rsplit('>').next());
                end - 35.0_f64.to_radians().cos() * LETTER * name.unwrap_or_default().chars().count() as f64
            });
            let begins: Vec<f64> = begins.collect();
            assert!(begins.len() > 9 && begins.iter().all(|begin| *begin >= 0.0), "{begins:?}");
        }
        // A long name in the middle of the axis needs no additional room.
        let names = (0..20).map(|number| number.to_string().repeat(if number == 9 { 20 } else { 1 }));
        let chart = Chart { across: Across::Names(names.collect()), ..chart };
        assert!(chart.svg().contains("rotate(-35)"));
        assert_eq!(chart.frame(WIDE).left, WIDE.left);
    }

    /// A series without a name is a fitted line. A fitted line has no entry in the legend, and belongs to the
    /// series before it.
    #[test]
    fn series_have_the_numbers_of_their_entries_in_the_legend() {
        let series = |name: &str| chart(name).series.remove(0);
        let all = Chart { series: vec![series("naive"), series(""), series("wide")], ..chart("both") };
        let text = all.svg();
        let numbers: Vec<&str> =
            text.split("data-series=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
        assert_eq!(numbers[..3], ["0", "0", "1"], "{numbers:?}");
        let [marks, lines] = ["class=\"mark\"", "class=\"line\""].map(|class| text.matches(class).count());
        assert_eq!((marks, lines), (4, 3), "a line without a name has no marks");
        let one = Chart { series: vec![Series { joined: false, ..series("naive") }], ..chart("one") };
        assert!(!one.svg().contains("class=\"line\""));
    }

    /// Returns the positions of a chart's markers, which must be discs.
    fn positions(svg: &str) -> Vec<[f64; 2]> {
        let marks = svg.split("class=\"mark\"").skip(1);
        let position = |mark: &str| {
            let path = mark.split("class=\"dot\"").nth(1)?.split(" d=\"M").nth(1)?;
            let (x, y) = path.split('a').next()?.split_once(' ')?;
            // The path of a disc begins at the disc's left end, four pixels from its centre.
            Some([x.parse::<f64>().ok()? + 4.0, y.parse().ok()?])
        };
        marks.filter_map(position).collect()
    }

    #[test]
    fn marks_stand_above_their_names_and_longer_times_are_further_up() {
        let chart = chart("naive");
        let [one, other] = positions(&chart.svg())[..] else { panic!("two marks") };
        // The x axis is 640 pixels long and begins at pixel 66. Each of the two names takes half of the x
        // axis.
        assert_eq!([one[0], other[0]], [66.0 + 160.0, 66.0 + 480.0]);
        assert!(one[1] < other[1], "10 ms at {one:?}, 1 ms at {other:?}");
        let frame = chart.frame(WIDE);
        assert!(frame.top < one[1] && other[1] < frame.bottom);
        let ends =
            [15.0, 5.0].map(|ms| frame.up.position(ms).map(super::super::svg::number).expect("a position"));
        let bar = format!("M226 {}V{}", ends[1], ends[0]);
        assert!(chart.svg().contains(&bar), "{bar}: {}", chart.svg());
    }

    #[test]
    fn labels_stand_at_their_axes_and_the_legend_beside_or_below() {
        let chart = chart("naive");
        for svg in [chart.svg(), chart.narrow_svg()] {
            let upright = svg.split("rotate(-90)").nth(1).and_then(|rest| rest.split("</g>").next());
            assert!(upright.is_some_and(|label| label.contains(">ms<")), "{svg}");
            assert!(
                svg.contains("<desc>ms against local size</desc>") && svg.contains("aria-label=\"naive\""),
                "{svg}"
            );
            assert_eq!(svg.matches("class=\"entry s0\"").count(), 1);
        }
        let legend = |svg: &str| -> [f64; 2] {
            let entry = svg.split("class=\"hit\"").nth(1).expect("an entry");
            ["x", "y"].map(|name| {
                let value =
                    entry.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
                value.and_then(|text| text.parse().ok()).expect("a number")
            })
        };
        let (wide, narrow) = (chart.frame(WIDE), chart.frame(NARROW));
        let [beside, below] = [legend(&chart.svg()), legend(&chart.narrow_svg())];
        assert!(beside[0] > wide.right && beside[1] < wide.bottom, "{beside:?}");
        assert!(below[0] < narrow.right && below[1] > narrow.bottom, "{below:?}");
    }

    #[test]
    fn a_long_label_of_the_y_axis_is_shortened_to_the_height_of_the_chart_and_keeps_its_unit() {
        let chart = Chart { y_label: format!("{}: median ms", "a device ".repeat(20)), ..chart("naive") };
        for (svg, layout) in [(chart.svg(), WIDE), (chart.narrow_svg(), NARROW)] {
            let upright = svg.split("rotate(-90)").nth(1).and_then(|rest| rest.split("</text>").next());
            let label = upright.and_then(|text| text.rsplit('>').next()).expect("a label");
            let frame = chart.frame(layout);
            let half = LETTER * label.chars().count() as f64 / 2.0;
            assert!(half <= f64::midpoint(frame.top, frame.bottom) && half > layout.height / 2.0, "{label}");
            assert!(label.starts_with("a device ") && label.ends_with(": median ms"), "{label}");
        }
    }

    #[test]
    fn equal_times_are_marked_only_where_both_axes_have_the_same_values() {
        let with = |diagonal: bool, x: f64| {
            let mark = |x: f64, y: f64| Mark { x, y, interval: None, tip: String::new() };
            let mut chart = Chart { across: Across::Numbers(Kind::Log), diagonal, ..chart("naive") };
            chart.series[0].marks = vec![mark(x, 1.0), mark(10.0 * x, 10.0)];
            chart.svg().contains(">equal<")
        };
        assert_eq!([with(true, 1.0), with(false, 1.0), with(true, 1e6)], [true, false, false]);
    }
}
