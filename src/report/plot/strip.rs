//! Every sample of a few points as a dot, so that noise can be seen.

use super::legend::shorten;
use super::palette::{FAINT, GRID, SERIES};
use super::scale::{self, Kind, Scale};
use super::svg::{Anchor, Svg, number};

/// The samples of one point.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// The median as text.
    pub value: String,
    /// Every sample in the order taken, as percent above or below the median.
    pub deviations: Vec<f64>,
    /// The 95% interval of the median, likewise; none of too few samples.
    pub interval: Option<[f64; 2]>,
    /// First and third quartile, likewise.
    pub quartiles: Option<[f64; 2]>,
    /// What is said of it.
    pub tip: String,
}

/// A strip plot.
#[derive(Clone, Debug)]
pub struct Strip {
    /// What it shows.
    pub title: String,
    /// Its rows, from the top.
    pub rows: Vec<Row>,
}

const LEFT: f64 = 262.0;
const WIDTH: f64 = 510.0;
const TOP: f64 = 34.0;
const ROW: f64 = 34.0;
/// No row has more dots; where there are more samples, every second, third, ... is shown.
const DOTS: usize = 120;

impl Strip {
    /// The plot as SVG.
    pub fn svg(&self) -> String {
        let reach = self.reach();
        let across = Scale::between(Kind::Linear, [-reach, reach], [LEFT, LEFT + WIDTH]);
        let bottom = TOP + self.rows.len() as f64 * ROW;
        let mut svg = Svg::default();
        svg.text("title", [16.0, 18.0], Anchor::Start, &self.title);
        for tick in across.ticks() {
            let Some(x) = across.place(tick) else { continue };
            svg.line(if tick == 0.0 { "axis" } else { "grid" }, GRID, [x, TOP], [x, bottom]);
            let sign = if tick > 0.0 { "+" } else { "" };
            let label = format!("{sign}{}%", scale::label(tick));
            svg.text_in("faint", FAINT, [x, bottom + 17.0], Anchor::Middle, &label);
        }
        for (place, row) in self.rows.iter().enumerate() {
            draw_row(&mut svg, row, TOP + place as f64 * ROW, &across, reach);
        }
        let middle = LEFT + WIDTH / 2.0;
        let label =
            "a frame's device time against the point's median; within a row, earlier samples stand higher";
        svg.text("label", [middle, bottom + 38.0], Anchor::Middle, label);
        svg.finish([LEFT + WIDTH + 24.0, bottom + 50.0], &self.title, label)
    }

    /// How far the axis reaches to both sides: past nearly all samples, but an outlier does not flatten the rest.
    fn reach(&self) -> f64 {
        let mut sizes: Vec<f64> =
            self.rows.iter().flat_map(|row| &row.deviations).map(|deviation| deviation.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let most = sizes.get(sizes.len() * 95 / 100).or(sizes.last()).copied().unwrap_or(1.0);
        (1.15 * most).clamp(0.5, 400.0)
    }
}

fn draw_row(svg: &mut Svg, row: &Row, top: f64, across: &Scale, reach: f64) {
    let middle = top + ROW / 2.0;
    let x = |deviation: f64| across.place(deviation.clamp(-reach, reach)).unwrap_or(LEFT);
    svg.open("g", &[("class", &"mark s0"), ("data-tip", &row.tip)]);
    svg.element(
        "rect",
        &[("class", &"hit"), ("y", &top), ("width", &(LEFT + WIDTH)), ("height", &ROW), ("fill", &"none")],
    );
    svg.text("label", [LEFT - 92.0, middle + 4.0], Anchor::End, &shorten(&row.name, 26));
    svg.text_in("faint", FAINT, [LEFT - 10.0, middle + 4.0], Anchor::End, &row.value);
    let bars = [
        ("quartiles", row.quartiles, [top + 5.0, ROW - 10.0]),
        ("sure", row.interval, [top + 3.0, ROW - 6.0]),
    ];
    for (class, ends, place) in bars {
        ends.iter().for_each(|ends| bar(svg, class, ends.map(x), place));
    }
    let every = row.deviations.len().div_ceil(DOTS).max(1);
    let last = row.deviations.len().saturating_sub(1).max(1) as f64;
    let dots = row.deviations.iter().enumerate().step_by(every).map(|(place, deviation)| {
        let y = top + 7.0 + (ROW - 14.0) * place as f64 / last;
        // A line of no length with round ends is a dot, and one path holds them all.
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
