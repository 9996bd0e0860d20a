//! Draws strip plots, which show the samples of a few points as dots, so that noise is visible.

use super::layout::{Layout, NARROW, WIDE};
use super::palette::{FAINT, GRID, SERIES};
use super::scale::{self, Kind, Scale};
use super::shorten::shorten_all;
use super::svg::{Anchor, LINE, Svg, number};

/// A row of the strip plot: the samples of one point.
#[derive(Clone, Debug)]
pub struct Row {
    /// The point's name.
    pub name: String,
    /// The point's median as text.
    pub value: String,
    /// The difference of each sample from the median, in percent of the median, in the order of measurement.
    pub deviations: Vec<f64>,
    /// The 95% interval of the median, as differences from the median in percent; `None` for a point with too
    /// few samples, or with times of 0.
    pub interval: Option<[f64; 2]>,
    /// The first and third quartile, as differences from the median in percent; `None` for a point with too
    /// few samples, or with times of 0.
    pub quartiles: Option<[f64; 2]>,
    /// The row's tooltip.
    pub tip: String,
}

/// A strip plot.
#[derive(Clone, Debug)]
pub struct Strip {
    /// The plot's title.
    pub title: String,
    /// The plot's rows, from the top.
    pub rows: Vec<Row>,
}

/// The layout of a strip plot, for screens or for phones.
#[derive(Clone, Copy)]
struct Form {
    layout: Layout,
    /// Height of a row in pixels.
    row: f64,
    /// Height in pixels of the space for a row's name above the row's dots; 0 if names are beside the dots.
    head: f64,
    /// The largest number of characters of a row's name. Longer names are shortened.
    longest: usize,
}

/// The layout for screens, with names on the left of the dots.
const BESIDE: Form =
    Form { layout: Layout { left: 274.0, width: 510.0, ..WIDE }, row: 34.0, head: 0.0, longest: 24 };
/// The layout for phones, with names above the dots.
const ABOVE: Form = Form {
    layout: Layout { left: ABOVE_MARGIN, width: 320.0, ..NARROW },
    row: 52.0,
    head: 18.0,
    longest: 32,
};
/// The margins on both sides of a plot on a phone, in pixels. The margins have room for half of the label of
/// a tick at the end of the axis, such as "+400%".
const ABOVE_MARGIN: f64 = 18.0;
/// The margin on the right of a plot on a screen, in pixels.
const BESIDE_MARGIN: f64 = 24.0;
/// The distance from the right end of a row's name to the left end of the x axis on a screen, in pixels. The
/// row's median is between them.
const BESIDE_VALUE: f64 = 92.0;
/// The label of the x axis. The label is centred below the x axis, and must not be much longer than the axis.
const LABEL: &str = "a sample's time minus the point's median, in % of the median";
/// The largest number of dots in a row of the strip plot (the samples of one point). If a point has more
/// samples, the row shows only every second, third, ... sample.
const DOTS: usize = 120;

impl Strip {
    /// Returns the strip plot as SVG for a screen.
    pub fn svg(&self) -> String {
        self.drawn(BESIDE)
    }

    /// Returns the strip plot as SVG for a phone.
    pub fn narrow_svg(&self) -> String {
        self.drawn(ABOVE)
    }

    fn drawn(&self, form: Form) -> String {
        let Form { layout, row, .. } = form;
        let reach = self.reach();
        let right = layout.left + layout.width;
        let across = Scale::between(Kind::Linear, [-reach, reach], [layout.left, right]);
        let title = layout.lines(&self.title);
        let top = layout.top + LINE * (title.len() - 1) as f64;
        let bottom = top + self.rows.len() as f64 * row;
        let mut svg = Svg::default();
        svg.lines("title", [layout.left.min(16.0), 18.0], Anchor::Start, &title);
        for tick in across.ticks() {
            let Some(x) = across.position(tick) else { continue };
            svg.line(if tick == 0.0 { "axis" } else { "grid" }, GRID, [x, top], [x, bottom]);
            let sign = if tick > 0.0 { "+" } else { "" };
            let label = format!("{sign}{}%", scale::label(tick));
            svg.text_in("faint", FAINT, [x, bottom + 17.0], Anchor::Middle, &label);
        }
        let names: Vec<&str> = self.rows.iter().map(|row| row.name.as_str()).collect();
        let names = shorten_all(&names, form.longest);
        for (index, (one, name)) in self.rows.iter().zip(&names).enumerate() {
            draw_row(&mut svg, (one, name), top + index as f64 * row, (&across, reach), form);
        }
        let lines = layout.lines(LABEL);
        svg.lines("label", [layout.left + layout.width / 2.0, bottom + 38.0], Anchor::Middle, &lines);
        let end = bottom + 50.0 + LINE * (lines.len() - 1) as f64;
        let margin = if layout.legend_below { ABOVE_MARGIN } else { BESIDE_MARGIN };
        svg.finish([right + margin, end], &self.title, LABEL)
    }

    /// Returns how far the x axis extends on both sides of 0, in percent of the median. The x axis shows
    /// nearly all samples. To leave enough space for these samples, a few samples that are far from the
    /// median may lie beyond the ends of the x axis.
    fn reach(&self) -> f64 {
        let mut sizes: Vec<f64> =
            self.rows.iter().flat_map(|row| &row.deviations).map(|deviation| deviation.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let most = sizes.get(sizes.len() * 95 / 100).or(sizes.last()).copied().unwrap_or(1.0);
        (1.15 * most).clamp(0.5, 400.0)
    }
}

/// Draws a row of the strip plot. `name` is the row's shortened name.
fn draw_row(svg: &mut Svg, (row, name): (&Row, &str), top: f64, (across, reach): (&Scale, f64), form: Form) {
    let Form { layout: Layout { left, width, .. }, head, .. } = form;
    let x = |deviation: f64| across.position(deviation.clamp(-reach, reach)).unwrap_or(left);
    svg.open("g", &[("class", &"mark s0"), ("data-tip", &row.tip)]);
    svg.element(
        "rect",
        &[
            ("class", &"hit"),
            ("y", &number(top)),
            ("width", &number(left + width)),
            ("height", &number(form.row)),
            ("fill", &"none"),
        ],
    );
    if head > 0.0 {
        svg.text("label", [left, top + 14.0], Anchor::Start, name);
        svg.text_in("faint", FAINT, [left + width, top + 14.0], Anchor::End, &row.value);
    } else {
        let middle = top + form.row / 2.0 + 4.0;
        svg.text("label", [left - BESIDE_VALUE, middle], Anchor::End, name);
        svg.text_in("faint", FAINT, [left - 10.0, middle], Anchor::End, &row.value);
    }
    let (top, height) = (top + head, form.row - head);
    let bars = [
        ("quartiles", row.quartiles, [top + 5.0, height - 10.0]),
        ("sure", row.interval, [top + 3.0, height - 6.0]),
    ];
    for (class, ends, extent) in bars {
        ends.iter().for_each(|ends| bar(svg, class, ends.map(x), extent));
    }
    let every = row.deviations.len().div_ceil(DOTS).max(1);
    let last = row.deviations.len().saturating_sub(1).max(1) as f64;
    let dots = row.deviations.iter().enumerate().step_by(every).map(|(index, deviation)| {
        let y = top + 7.0 + (height - 14.0) * index as f64 / last;
        // A line of zero length with round ends appears as a dot. One SVG path contains all dots of a row.
        format!("M{} {}h0", number(x(*deviation)), number(y))
    });
    svg.element(
        "path",
        &[
            ("class", &"dots"),
            ("d", &dots.collect::<String>()),
            ("stroke", &SERIES[0]),
            ("stroke-width", &4),
            ("stroke-linecap", &"round"),
            ("opacity", &0.75),
        ],
    );
    svg.close("g");
}

fn bar(svg: &mut Svg, class: &str, [left, right]: [f64; 2], [top, height]: [f64; 2]) {
    let opacity = if class == "sure" { 0.4 } else { 0.16 };
    svg.element(
        "rect",
        &[
            ("class", &class),
            ("x", &number(left)),
            ("y", &number(top)),
            ("width", &number((right - left).max(1.5))),
            ("height", &number(height)),
            ("fill", &SERIES[1]),
            ("opacity", &opacity),
            ("rx", &2),
        ],
    );
}

#[cfg(test)]
mod tests {
    use super::super::layout::LETTER;
    use super::*;

    fn reach(deviations: Vec<f64>) -> f64 {
        let row = Row {
            name: String::new(),
            value: String::new(),
            deviations,
            interval: None,
            quartiles: None,
            tip: String::new(),
        };
        Strip { title: String::new(), rows: vec![row] }.reach()
    }

    #[test]
    fn the_axis_shows_nearly_all_samples_on_both_sides_and_no_outlier() {
        let close = |actual: f64, expected: f64| (actual - expected).abs() < 1e-9;
        // One sample in a hundred takes ten times as long as the median.
        let mut samples: Vec<f64> = (0..99).map(|index| if index % 2 == 0 { 2.0 } else { -4.0 }).collect();
        samples.push(900.0);
        assert!(close(reach(samples), 1.15 * 4.0));
        assert!(close(reach(vec![0.01, -0.02]), 0.5), "not less than half a per cent");
        assert!(close(reach(vec![900.0; 9]), 400.0));
        assert!(close(reach(Vec::new()), 1.15));
    }

    #[test]
    fn a_tick_at_the_end_of_the_axis_has_room_for_its_label() {
        let half = LETTER * "+400%".len() as f64 / 2.0;
        for (form, margin) in [(BESIDE, BESIDE_MARGIN), (ABOVE, ABOVE_MARGIN)] {
            assert!(half <= margin && half <= form.layout.left, "{half} > {margin}");
        }
    }

    /// Letters such as `w` are wider than most letters, so names need some more room than their usual width.
    #[test]
    fn names_have_room_beside_or_above_the_dots() {
        let wide_letter = 1.08 * LETTER;
        let room = [BESIDE.layout.left - BESIDE_VALUE, ABOVE.layout.width];
        let names = [BESIDE, ABOVE].map(|form| wide_letter * form.longest as f64);
        assert!(names[0] <= room[0] && names[1] <= room[1], "{names:?} {room:?}");
    }

    #[test]
    fn the_axis_is_long_enough_for_its_label() {
        let beyond = LETTER * LABEL.chars().count() as f64 - BESIDE.layout.width;
        assert!(beyond / 2.0 <= BESIDE_MARGIN, "{beyond}");
    }

    #[test]
    fn shorter_times_are_further_left_and_earlier_ones_further_up() {
        let row = Row {
            name: "naive".into(),
            value: "10 ms".into(),
            deviations: vec![0.0, -10.0, 10.0],
            interval: Some([-2.0, 3.0]),
            quartiles: Some([-5.0, 5.0]),
            tip: "a tip".into(),
        };
        let svg = Strip { title: "Samples".into(), rows: vec![row.clone(), row] }.svg();
        let rows: Vec<&str> = svg.split("class=\"mark s0\"").skip(1).collect();
        let dots = |row: &str| -> Vec<[f64; 2]> {
            let path = row.split("class=\"dots\" d=\"").nth(1).and_then(|rest| rest.split('"').next());
            let dot = |text: &str| {
                let (x, y) = text.strip_suffix("h0")?.split_once(' ')?;
                Some([x.parse().ok()?, y.parse().ok()?])
            };
            path.expect("dots").split('M').filter_map(dot).collect()
        };
        let [middle, left, right] = dots(rows[0])[..] else { panic!("three dots") };
        // The x axis begins at pixel 274 and is 510 pixels long.
        assert_eq!(middle[0], 274.0 + 255.0);
        assert!((middle[0] - left[0] - (right[0] - middle[0])).abs() < 0.02 && left[0] < middle[0]);
        assert!(middle[1] < left[1] && left[1] < right[1]);
        assert_eq!(dots(rows[1])[0][1] - middle[1], BESIDE.row);
        let bar = |class: &str| -> [f64; 2] {
            let rest = rows[0].split(&format!("class=\"{class}\"")).nth(1).expect("a bar");
            ["x", "width"].map(|name| {
                let value = rest.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
                value.and_then(|text| text.parse().ok()).expect("a number")
            })
        };
        let ([quartiles, wide], [sure, narrow]) = (bar("quartiles"), bar("sure"));
        // `unit` is the width of ten per cent on the x axis, in pixels.
        let unit = right[0] - middle[0];
        assert!((wide - unit).abs() < 0.1 && (narrow - unit / 2.0).abs() < 0.1, "{wide} {narrow} {unit}");
        assert!(
            (quartiles - (middle[0] - unit / 2.0)).abs() < 0.1
                && (sure - (middle[0] - unit / 5.0)).abs() < 0.1
        );
        assert!(
            rows[0].contains(">naive<")
                && rows[0].contains(">10 ms<")
                && rows[0].contains("data-tip=\"a tip\"")
        );
    }

    #[test]
    fn an_outlier_is_shown_at_the_edge_and_of_many_samples_some_are_shown() {
        let positions = |deviations: Vec<f64>| -> Vec<f64> {
            let row = Row {
                name: String::new(),
                value: String::new(),
                deviations,
                interval: None,
                quartiles: None,
                tip: String::new(),
            };
            let svg = Strip { title: String::new(), rows: vec![row] }.svg();
            let path = svg
                .split("class=\"dots\" d=\"")
                .nth(1)
                .and_then(|rest| rest.split('"').next())
                .expect("dots");
            path.split('M').filter_map(|dot| dot.split_once(' ')?.0.parse().ok()).collect()
        };
        let mut samples = vec![1.0; 39];
        samples.push(900.0);
        let actual = positions(samples);
        assert_eq!((actual.len(), actual[39]), (40, 274.0 + 510.0));
        assert_eq!([120, 121, 300].map(|count| positions(vec![1.0; count]).len()), [120, 61, 100]);
    }
}
