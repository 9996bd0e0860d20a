//! Draws heat maps with rows and columns. The cells of slow points are dark, and the cells of fast points are
//! light. The cells of points whose time is missing or cannot be compared are hatched.

use super::layout::{LETTER, lines_of};
use super::palette::{FAINT, INK};
use super::shorten::{shorten, shorten_all};
use super::svg::{Anchor, LINE, Svg, number};
use crate::image::viridis;

/// A cell of a heat map.
#[derive(Clone, Debug)]
pub enum Cell {
    /// The cell of a point whose time can be compared. In a heat map that compares devices, such a cell shows the mean
    /// of the ratios of one or more points.
    Time {
        /// The point's time divided by the time of the fastest of the compared points, or a mean of such ratios. The
        /// heat map treats a value below 1 as 1.
        slower: f64,
        /// The text in the cell: the point's time, or a ratio of times.
        text: String,
        /// True if the cell has a ring: the point is the fastest point or ties with it, or the mean of the ratios is
        /// below 1.01.
        wins: bool,
        /// The cell's tooltip.
        tip: String,
    },
    /// The cell of a point without a time, or with a time that cannot be compared because the point has too
    /// few samples or times of 0.
    Nothing {
        /// If the point has no time, the reason as a word, which the legend explains. If the point has a time
        /// that cannot be compared, this time as text.
        code: String,
        /// The cell's tooltip, which states the reason.
        tip: String,
    },
    /// A cell without content: the experiment has no point for this cell or, in a heat map that compares devices, no
    /// ratio is known.
    Empty,
}

impl Cell {
    /// Returns the text in the cell.
    fn text(&self) -> &str {
        match self {
            Self::Time { text, .. } => text,
            Self::Nothing { code, .. } => code,
            Self::Empty => "",
        }
    }
}

/// A heat map.
#[derive(Clone, Debug)]
pub struct HeatMap {
    /// A name that is unique on the page. The name of the heat map's hatching pattern contains `id`, so the pattern's
    /// name is unique on the page as well.
    pub id: String,
    /// The heat map's title.
    pub title: String,
    /// The label of the heat map's x axis.
    pub x_label: String,
    /// The columns' names.
    pub columns: Vec<String>,
    /// The rows' names and cells. Each row has one cell per column.
    pub rows: Vec<(String, Vec<Cell>)>,
    /// What a ring marks, for the legend.
    pub ringed: &'static str,
    /// Each word that cells show instead of a time, and its meaning for the legend.
    pub codes: Vec<(String, String)>,
}

/// The largest number of characters of a row's name. Longer names are shortened.
const LONGEST: usize = 25;
const LEFT: f64 = 184.0;
const TOP: f64 = 58.0;
const ROW: f64 = 30.0;
const SCALE_WIDTH: f64 = 220.0;
/// The margin on the right, in pixels.
const RIGHT: f64 = 16.0;
/// The free horizontal space that a text must leave in a cell, in pixels.
const BESIDE: f64 = 6.0;

impl HeatMap {
    /// Returns the heat map as SVG for a screen.
    pub fn svg(&self) -> String {
        let column = (600.0 / self.columns.len().max(1) as f64).clamp(52.0, 84.0).max(self.width_of_texts());
        let width = (LEFT + self.columns.len() as f64 * column + RIGHT)
            .max(640.0)
            .max(7.6 * self.title.chars().count() as f64 + 32.0);
        let worst = self.worst();
        let mut svg = Svg::default();
        svg.text("title", [16.0, 18.0], Anchor::Start, &self.title);
        let hatch = self.hatch(&mut svg, "wide");
        for (index, name) in self.columns.iter().enumerate() {
            let x = LEFT + (index as f64 + 0.5) * column;
            svg.text_in("faint", FAINT, [x, TOP - 9.0], Anchor::Middle, name);
        }
        svg.text_in("faint", FAINT, [LEFT - 10.0, TOP - 9.0], Anchor::End, &self.x_label);
        let names: Vec<&str> = self.rows.iter().map(|(name, _)| name.as_str()).collect();
        let names = shorten_all(&names, LONGEST);
        for (row, ((_, cells), name)) in self.rows.iter().zip(&names).enumerate() {
            let y = TOP + row as f64 * ROW;
            svg.text("label", [LEFT - 10.0, y + 19.0], Anchor::End, name);
            for (index, cell) in cells.iter().enumerate() {
                let at = [LEFT + index as f64 * column, y];
                draw_cell(&mut svg, cell, at, column, worst, &hatch);
            }
        }
        let bottom = TOP + self.rows.len() as f64 * ROW + 16.0;
        let end = self.draw_legend(&mut svg, bottom, width - RIGHT, worst, &hatch);
        svg.finish([width, end], &self.title, "A heat map. Each cell shows its value as text, too.")
    }

    /// Returns the width that a cell needs for the longest of the columns' names and of the texts in cells, in
    /// pixels.
    pub(super) fn width_of_texts(&self) -> f64 {
        let cells = self.rows.iter().flat_map(|(_, cells)| cells).map(Cell::text);
        let texts = self.columns.iter().map(String::as_str).chain(cells);
        let longest = texts.map(|text| text.chars().count()).max().unwrap_or(0);
        LETTER * longest as f64 + BESIDE
    }

    pub(super) fn worst(&self) -> f64 {
        let cells = self.rows.iter().flat_map(|(_, cells)| cells);
        let slower = cells.filter_map(|cell| match cell {
            Cell::Time { slower, .. } => Some(*slower),
            _ => None,
        });
        slower.fold(2.0, f64::max)
    }

    /// Defines the SVG pattern with which cells are hatched, for one form of the heat map ("wide" or
    /// "narrow"). Returns the value of the SVG attribute `fill` that refers to this pattern.
    pub(super) fn hatch(&self, svg: &mut Svg, form: &str) -> String {
        let id = format!("hatch-{}-{form}", self.id);
        svg.open("defs", &[]);
        svg.open(
            "pattern",
            &[
                ("id", &id),
                ("width", &7),
                ("height", &7),
                ("patternUnits", &"userSpaceOnUse"),
                ("patternTransform", &"rotate(45)"),
            ],
        );
        svg.element(
            "rect",
            &[("class", &"hatch-ground"), ("width", &7), ("height", &7), ("fill", &"#f1f4f7")],
        );
        svg.element("rect", &[("class", &"hatch-line"), ("width", &2), ("height", &7), ("fill", &"#ccd5de")]);
        svg.close("pattern");
        svg.close("defs");
        format!("url(#{id})")
    }

    /// Returns true if at least one cell has a time that can be compared. A heat map without such times has no colour
    /// scale.
    pub(super) fn has_times(&self) -> bool {
        self.rows.iter().flat_map(|(_, cells)| cells).any(|cell| matches!(cell, Cell::Time { .. }))
    }

    /// Draws the legend, up to the x coordinate `right`: the colour scale, the meaning of a ring, and the meanings of
    /// the words in cells without a time. Returns the y coordinate of the legend's lower end.
    fn draw_legend(&self, svg: &mut Svg, top: f64, right: f64, worst: f64, hatch: &str) -> f64 {
        if !self.has_times() {
            return self.draw_codes(svg, [LEFT, top - 8.0], right, hatch);
        }
        draw_scale(svg, [LEFT, top], worst);
        svg.text_in(
            "faint small",
            FAINT,
            [LEFT + SCALE_WIDTH + 18.0, top + 9.0],
            Anchor::Start,
            &format!("ringed: {}", self.ringed),
        );
        self.draw_codes(svg, [LEFT, top + 24.0], right, hatch)
    }

    /// Draws the meanings of the words in cells without a time, between the x coordinates `left` and `right`,
    /// below `y`. Returns the y coordinate of the lower end.
    pub(super) fn draw_codes(&self, svg: &mut Svg, [left, mut y]: [f64; 2], right: f64, hatch: &str) -> f64 {
        for (code, meaning) in &self.codes {
            y += 19.0 - LINE;
            let width = draw_legend_cell(svg, [left, y + LINE], code, hatch);
            let most = ((right - left - width - 8.0) / LETTER) as usize;
            for line in lines_of(meaning, most) {
                y += LINE;
                let line = shorten(&line, most);
                svg.text_in("faint small", FAINT, [left + width + 8.0, y], Anchor::Start, &line);
            }
        }
        y + 14.0
    }
}

/// Draws the colour scale with its labels, from the colour of the fastest point to the colour of a point that takes
/// `worst` times as long.
pub(super) fn draw_scale(svg: &mut Svg, [left, top]: [f64; 2], worst: f64) {
    const STEPS: usize = 44;
    let step = SCALE_WIDTH / STEPS as f64;
    for index in 0..STEPS {
        let colour = hex(viridis(1.0 - index as f64 / (STEPS - 1) as f64));
        let x = number(left + index as f64 * step);
        let width = number(step + 0.3);
        svg.element(
            "rect",
            &[("x", &x), ("y", &number(top)), ("width", &width), ("height", &10), ("fill", &colour)],
        );
    }
    svg.text_in("faint small", FAINT, [left, top + 24.0], Anchor::Start, "fastest");
    let worst = format!("{worst:.1} times as slow");
    svg.text_in("faint small", FAINT, [left + SCALE_WIDTH, top + 24.0], Anchor::End, &worst);
}

/// Draws a hatched cell with a word (such as "local"), for the legend. Returns the cell's width in pixels.
fn draw_legend_cell(svg: &mut Svg, [x, y]: [f64; 2], code: &str, hatch: &str) -> f64 {
    let width = (LETTER * code.chars().count() as f64 + 6.0).max(20.0);
    svg.element(
        "rect",
        &[("x", &x), ("y", &number(y - 11.0)), ("width", &width), ("height", &14), ("fill", &hatch)],
    );
    svg.text("small label", [x + width / 2.0, y], Anchor::Middle, code);
    width
}

fn draw_cell(svg: &mut Svg, cell: &Cell, [x, y]: [f64; 2], width: f64, worst: f64, hatch: &str) {
    let middle = [x + width / 2.0, y + 19.0];
    match cell {
        Cell::Empty => {}
        Cell::Nothing { code, tip } => {
            svg.open("g", &[("class", &"mark"), ("data-tip", tip)]);
            rect(svg, [x, y], [width, ROW], hatch);
            svg.text("label", middle, Anchor::Middle, code);
            svg.close("g");
        }
        Cell::Time { slower, text, wins, tip } => {
            let position = 1.0 - slower.max(1.0).ln() / worst.ln();
            let colour = viridis(position);
            svg.open("g", &[("class", &"mark"), ("data-tip", tip)]);
            rect(svg, [x, y], [width, ROW], &hex(colour));
            svg.text_in("", ink_on(colour), middle, Anchor::Middle, text);
            if *wins {
                ring(svg, [x, y], [width, ROW]);
            }
            svg.close("g");
        }
    }
}

/// Draws the background of a cell of the heat map.
pub(super) fn rect(svg: &mut Svg, [x, y]: [f64; 2], [width, height]: [f64; 2], fill: &str) {
    svg.element(
        "rect",
        &[
            ("class", &"cell"),
            ("x", &number(x + 1.0)),
            ("y", &number(y + 1.0)),
            ("width", &number(width - 2.0)),
            ("height", &number(height - 2.0)),
            ("rx", &3),
            ("fill", &fill),
        ],
    );
}

/// Draws two rings that mark the cell of a winner. One ring is dark and one is light, so that at least one of them is
/// visible on any background.
pub(super) fn ring(svg: &mut Svg, [x, y]: [f64; 2], [width, height]: [f64; 2]) {
    for (inset, colour, stroke) in [(1.5, INK, 3.0), (4.0, "#ffffff", 1.5)] {
        svg.element(
            "rect",
            &[
                ("class", &if inset < 2.0 { "ring" } else { "ring-inner" }),
                ("x", &number(x + inset)),
                ("y", &number(y + inset)),
                ("width", &number(width - 2.0 * inset)),
                ("height", &number(height - 2.0 * inset)),
                ("rx", &3),
                ("fill", &"none"),
                ("stroke", &colour),
                ("stroke-width", &stroke),
            ],
        );
    }
}

pub(super) fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Returns the colour of text on a background colour: black or white, whichever has more contrast (by WCAG
/// 2.2).
pub(super) fn ink_on(colour: [u8; 3]) -> &'static str {
    let white = 1.05 / (luminance(colour) + 0.05);
    let dark = (luminance(colour) + 0.05) / 0.05;
    if dark > white { "#000000" } else { "#ffffff" }
}

/// Returns the relative luminance of an sRGB colour, 0 to 1 (WCAG 2.2).
fn luminance(colour: [u8; 3]) -> f64 {
    let linear = |channel: u8| match f64::from(channel) / 255.0 {
        part if part <= 0.04045 => part / 12.92,
        part => ((part + 0.055) / 1.055).powf(2.4),
    };
    let [red, green, blue] = colour.map(linear);
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

#[cfg(test)]
mod tests {
    use super::*;
    use resvg::usvg;

    #[test]
    fn what_stands_on_any_colour_can_be_read() {
        for percent in 0..=100 {
            let colour = viridis(f64::from(percent) / 100.0);
            let ink = if ink_on(colour) == "#ffffff" { 1.0 } else { 0.0 };
            let [one, other] = [ink, luminance(colour)].map(|part| part + 0.05);
            assert!(one.max(other) / one.min(other) >= 4.5, "{colour:?}");
        }
    }

    #[test]
    fn cells_say_their_time_or_why_there_is_none() {
        let time = |slower: f64| Cell::Time {
            slower,
            text: format!("{slower}"),
            wins: slower == 1.0,
            tip: format!("{slower} ms"),
        };
        let none = Cell::Nothing { code: "L".into(), tip: "__local: 110592 B > 49152 B".into() };
        let map = HeatMap {
            id: "teapot".into(),
            title: "teapot".into(),
            x_label: "local size".into(),
            columns: vec!["8x8".into(), "16x16".into(), "32x32".into()],
            rows: vec![
                ("naive".into(), vec![time(1.0), time(4.5), none]),
                ("wide".into(), vec![Cell::Empty]),
            ],
            ringed: "any",
            codes: vec![("L".into(), "__local memory is too small".into())],
        };
        let text = map.svg();
        assert_eq!(text.matches("class=\"mark\"").count(), 3);
        assert_eq!(text.matches("class=\"ring\"").count(), 1);
        assert!(text.contains("110592 B &gt; 49152 B") && text.contains("4.5 times as slow"), "{text}");
    }

    #[test]
    fn only_a_heat_map_with_a_time_has_a_colour_scale() {
        let time = Cell::Time { slower: 1.0, text: "1.00".into(), wins: true, tip: "ms".into() };
        let none = Cell::Nothing { code: "build".into(), tip: "no".into() };
        let legends = |cells: Vec<Cell>| {
            let map = HeatMap {
                id: "a".into(),
                title: "a".into(),
                x_label: "local size".into(),
                columns: vec!["8x8".into(); cells.len()],
                rows: vec![("naive".into(), cells)],
                ringed: "any",
                codes: vec![("build".into(), "did not compile".into())],
            };
            [map.svg(), map.narrow_svg()].map(|svg| {
                assert!(svg.contains("did not compile"), "{svg}");
                ["times as slow", "ringed: "].map(|text| svg.contains(text))
            })
        };
        assert_eq!(legends(vec![time, none.clone()]), [[true; 2]; 2]);
        assert_eq!(legends(vec![none, Cell::Empty]), [[false; 2]; 2]);
    }

    /// A page contains each heat map in a wide and in a narrow form. The hatching patterns of the two forms need
    /// different names, since a name may occur only once on a page.
    #[test]
    fn the_hatching_of_each_form_of_a_map_has_a_name_of_its_own() {
        let map = HeatMap {
            id: "teapot".into(),
            title: "teapot".into(),
            x_label: "local size".into(),
            columns: vec!["8x8".into()],
            rows: vec![("naive".into(), vec![Cell::Nothing { code: "L".into(), tip: "no".into() }])],
            ringed: "any",
            codes: vec![("L".into(), "too small".into())],
        };
        for (form, text) in [("wide", map.svg()), ("narrow", map.narrow_svg())] {
            let name = format!("hatch-teapot-{form}");
            assert_eq!(text.matches(&format!("id=\"{name}\"")).count(), 1, "{text}");
            assert!(text.contains(&format!("url(#{name})")), "{text}");
        }
    }

    #[test]
    fn no_two_rows_have_the_same_name() {
        let name = |test: &str| format!("deferred+intersector={test}+records=each-test");
        let map = HeatMap {
            id: "teapot".into(),
            title: "teapot".into(),
            x_label: "local size".into(),
            columns: Vec::new(),
            rows: vec![(name("my-test"), Vec::new()), (name("plucker"), Vec::new())],
            ringed: "any",
            codes: Vec::new(),
        };
        let text = map.svg();
        assert!(text.contains("=my-test…") && text.contains("=plucker…"), "{text}");
    }

    /// Returns the left and the right end of each text of an SVG document, and the text's y coordinate. The
    /// width of a text is estimated.
    fn texts(svg: &str) -> Vec<([f64; 2], String)> {
        let document = usvg::roxmltree::Document::parse(svg).expect("well-formed");
        let texts = document.descendants().filter(|node| node.tag_name().name() == "text");
        texts
            .map(|node| {
                let width = LETTER * node.text().unwrap_or_default().chars().count() as f64;
                let x: f64 = node.attribute("x").and_then(|x| x.parse().ok()).expect("a number");
                let left = match node.attribute("text-anchor") {
                    Some("middle") => x - width / 2.0,
                    Some("end") => x - width,
                    _ => x,
                };
                ([left, left + width], node.attribute("y").unwrap_or_default().to_owned())
            })
            .collect()
    }

    /// In this test, the names of columns, the texts in cells and the meanings of words are long.
    #[test]
    fn no_text_is_cut_off_or_overlaps_another_text() {
        let time = Cell::Time { slower: 1.0, text: "1.00 (1 of 2)".into(), wins: false, tip: "ms".into() };
        let none = Cell::Nothing { code: "constant".into(), tip: "no".into() };
        let meaning =
            format!("naive at 32 x 32: __constant memory {}: {}", "is too small ".repeat(9), "x".repeat(200));
        for columns in [3, 9] {
            let [times, nothing] = [&time, &none].map(|cell| vec![cell.clone(); columns]);
            let map = HeatMap {
                id: "a".into(),
                title: "Strategies by device".into(),
                x_label: "device".into(),
                columns: vec!["NVID…GPU 192".into(); columns],
                rows: vec![("naive".into(), times), ("wide".into(), nothing)],
                ringed: "any",
                codes: ["constant", "group"].map(|code| (code.to_owned(), meaning.clone())).to_vec(),
            };
            let svg = map.svg();
            let width = 640.0_f64.max(LEFT + columns as f64 * map.width_of_texts() + RIGHT);
            assert!(svg.contains(&format!(" width=\"{}\"", number(width))), "{svg}");
            let mut texts = texts(&svg);
            assert!(texts.iter().all(|([left, right], _)| *left >= 0.0 && *right <= width), "{texts:?}");
            texts.sort_by(|([a, _], one), ([b, _], other)| one.cmp(other).then(a.total_cmp(b)));
            let overlap = |pair: &[([f64; 2], String)]| pair[0].1 == pair[1].1 && pair[0].0[1] > pair[1].0[0];
            assert!(!texts.windows(2).any(overlap), "{texts:?}");
        }
    }

    /// Returns the attributes of an SVG element as numbers.
    fn numbers(node: &usvg::roxmltree::Node<'_, '_>, names: [&str; 4]) -> [f64; 4] {
        names.map(|name| node.attribute(name).and_then(|text| text.parse().ok()).expect("a number"))
    }

    #[test]
    fn cells_lie_in_rows_and_columns_without_touching_each_other() {
        let time = |slower: f64| Cell::Time {
            slower,
            text: format!("{slower}"),
            wins: slower == 1.0,
            tip: "ms".into(),
        };
        let none = Cell::Nothing { code: "L".into(), tip: "no".into() };
        let map = HeatMap {
            id: "a".into(),
            title: "a".into(),
            x_label: "local size".into(),
            columns: vec!["8x8".into(), "16x16".into()],
            rows: vec![("b".into(), vec![time(1.0), time(3.0)]), ("c".into(), vec![none, Cell::Empty])],
            ringed: "any",
            codes: vec![("L".into(), "too small".into())],
        };
        let svg = map.svg();
        let document = usvg::roxmltree::Document::parse(&svg).expect("well-formed");
        let of_class = |class: &str| {
            document.descendants().filter(|n| n.attribute("class") == Some(class)).collect::<Vec<_>>()
        };
        let marks = of_class("mark");
        assert!(
            marks.iter().all(|mark| mark.parent().is_some_and(|parent| parent.tag_name().name() == "svg"))
        );
        let boxes = of_class("cell")
            .iter()
            .map(|node| numbers(node, ["x", "y", "width", "height"]))
            .collect::<Vec<_>>();
        let [first, beside, below] = boxes[..] else { panic!("{boxes:?}") };
        assert_eq!([first[1], first[0], first[3]], [beside[1], below[0], below[3]]);
        assert_eq!(beside[0] - first[0], first[2] + 2.0, "a gap of two pixels across");
        assert_eq!(below[1] - first[1], first[3] + 2.0, "a gap of two pixels down");
        assert!(first[2] > first[3], "a column is wider than a row is high");
    }

    #[test]
    fn the_fastest_cell_is_the_lightest_and_columns_have_the_room_there_is() {
        let map = |times: &[f64]| {
            let cell =
                |slower: &f64| Cell::Time { slower: *slower, text: "a".into(), wins: false, tip: "b".into() };
            HeatMap {
                id: "a".into(),
                title: "a".into(),
                x_label: "local size".into(),
                columns: vec!["8x8".into(); times.len()],
                rows: vec![("b".into(), times.iter().map(cell).collect())],
                ringed: "any",
                codes: Vec::new(),
            }
        };
        let cells = |map: &HeatMap| -> Vec<(String, String)> {
            let value = |cell: &str, name: &str| {
                let rest = cell.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
                rest.unwrap_or_default().to_owned()
            };
            map.svg()
                .split("class=\"cell\"")
                .skip(1)
                .map(|cell| (value(cell, "fill"), value(cell, "width")))
                .collect()
        };
        let colours: Vec<String> = cells(&map(&[1.0, 2.0, 4.0])).into_iter().map(|(fill, _)| fill).collect();
        assert_eq!(colours, [1.0, 0.5, 0.0].map(|position| hex(viridis(position))));
        // Even if all times are similar, the colour scale extends to twice the fastest time, so that noise
        // does not look like a difference.
        assert_eq!([map(&[1.0, 1.1]).worst(), map(&[1.0, 3.0]).worst()], [2.0, 3.0]);
        let width = |columns: usize| cells(&map(&vec![1.0; columns])).remove(0).1;
        assert_eq!([width(2), width(10), width(40)], ["82", "58", "50"]);
    }

    #[test]
    fn the_scale_goes_from_the_colour_of_the_fastest_to_that_of_the_slowest() {
        let mut svg = Svg::default();
        draw_scale(&mut svg, [10.0, 20.0], 3.0);
        let text = svg.finish([300.0, 60.0], "a", "b");
        let colours: Vec<&str> = text
            .split("<rect")
            .filter(|element| element.contains(" height=\"10\""))
            .filter_map(|element| element.split(" fill=\"").nth(1)?.split('"').next())
            .collect();
        let [fastest, slowest] = [1.0, 0.0].map(|position| hex(viridis(position)));
        assert_eq!((colours.first(), colours.last()), (Some(&&*fastest), Some(&&*slowest)), "{text}");
        let places = ["fastest", "3.0 times as slow"].map(|label| text.find(label));
        assert!(places[0].is_some() && places[0] < places[1], "{text}");
    }
}
