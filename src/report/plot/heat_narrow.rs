//! Draws a heat map for phones. Each row's name is above the row's cells. Long rows continue on further
//! lines, so each cell contains the name of its column. The legend is at the bottom.

use super::heat::{Cell, HeatMap, draw_scale, hex, ink_on, rect, ring};
use super::layout::NARROW;
use super::palette::FAINT;
use super::svg::{Anchor, LINE, Svg};
use crate::image::viridis;

/// The largest number of cells per line. A line has fewer cells if the texts in the cells are long.
const MOST_ACROSS: usize = 6;
const LEFT: f64 = 8.0;
const HEIGHT: f64 = 36.0;
/// The gap between two rows, in pixels.
const GAP: f64 = 8.0;

impl HeatMap {
    /// Returns the heat map as SVG, as wide as a phone's screen.
    pub fn narrow_svg(&self) -> String {
        let width = NARROW.whole_width();
        let mut svg = Svg::default();
        let title = NARROW.lines(&self.title);
        svg.lines("title", [LEFT, 18.0], Anchor::Start, &title);
        let hatch = self.hatch(&mut svg, "narrow");
        let mut y = 18.0 + LINE * title.len() as f64;
        let worst = self.worst();
        for (name, cells) in &self.rows {
            y = self.narrow_row(&mut svg, name, cells, y, worst, &hatch);
        }
        let end = self.narrow_legend(&mut svg, y + GAP, worst, &hatch);
        svg.finish([width, end], &self.title, "A heat map. Each cell shows its value as text, too.")
    }

    /// Returns the number of cells per line of the heat map.
    fn across(&self) -> usize {
        let room = NARROW.whole_width() - 2.0 * LEFT;
        ((room / self.width_of_texts()) as usize).clamp(1, MOST_ACROSS)
    }

    /// Draws the name and the cells of a row of the heat map from `y` downwards. Returns the y coordinate at
    /// which the next row begins.
    fn narrow_row(&self, svg: &mut Svg, name: &str, cells: &[Cell], y: f64, worst: f64, hatch: &str) -> f64 {
        let names = NARROW.lines(name);
        svg.lines("label", [LEFT, y + 12.0], Anchor::Start, &names);
        let top = y + 2.0 + LINE * names.len() as f64;
        let across = self.across();
        let width = (NARROW.whole_width() - 2.0 * LEFT) / across as f64;
        for (index, (column, cell)) in self.columns.iter().zip(cells).enumerate() {
            let at = [LEFT + (index % across) as f64 * width, top + (index / across) as f64 * HEIGHT];
            draw(svg, column, cell, (at, [width, HEIGHT]), (worst, hatch));
        }
        top + cells.len().div_ceil(across) as f64 * HEIGHT + GAP
    }

    /// Draws the legend: the colour scale, the meaning of a ring, and the meanings of the words in cells without a
    /// time. Returns the y coordinate of the legend's lower end.
    fn narrow_legend(&self, svg: &mut Svg, top: f64, worst: f64, hatch: &str) -> f64 {
        let right = NARROW.whole_width() - LEFT;
        if !self.has_times() {
            return self.draw_codes(svg, [LEFT, top - 8.0], right, hatch);
        }
        draw_scale(svg, [LEFT, top], worst);
        let y = top + 24.0 + LINE;
        svg.text_in("faint small", FAINT, [LEFT, y], Anchor::Start, &format!("ringed: {}", self.ringed));
        self.draw_codes(svg, [LEFT, y], right, hatch)
    }
}

fn draw(
    svg: &mut Svg,
    column: &str,
    cell: &Cell,
    (at, size): ([f64; 2], [f64; 2]),
    (worst, hatch): (f64, &str),
) {
    let [x, y] = [at[0] + size[0] / 2.0, at[1]];
    let [small, large] = [[x, y + 14.0], [x, y + 29.0]];
    match cell {
        Cell::Empty => {}
        Cell::Nothing { code, tip } => {
            svg.open("g", &[("class", &"mark"), ("data-tip", tip)]);
            rect(svg, at, size, hatch);
            svg.text("small label", small, Anchor::Middle, column);
            svg.text("label", large, Anchor::Middle, code);
            svg.close("g");
        }
        Cell::Time { slower, text, wins, tip } => {
            let colour = viridis(1.0 - slower.max(1.0).ln() / worst.ln());
            svg.open("g", &[("class", &"mark"), ("data-tip", tip)]);
            rect(svg, at, size, &hex(colour));
            svg.text_in("", ink_on(colour), small, Anchor::Middle, column);
            svg.text_in("", ink_on(colour), large, Anchor::Middle, text);
            if *wins {
                ring(svg, at, size);
            }
            svg.close("g");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> HeatMap {
        let time = |slower: f64| Cell::Time {
            slower,
            text: format!("{slower}"),
            wins: slower == 1.0,
            tip: "ms".into(),
        };
        let none = Cell::Nothing { code: "L".into(), tip: "110592 B > 49152 B".into() };
        let sizes = ["1x1", "2x2", "4x4", "6x6", "8x8", "10x10", "12x12", "16x16"];
        HeatMap {
            id: "teapot".into(),
            title: "teapot".into(),
            x_label: "local size".into(),
            columns: sizes.map(str::to_owned).to_vec(),
            rows: vec![(
                "naive".into(),
                (0..7).map(|index| time(1.0 + f64::from(index))).chain([none]).collect(),
            )],
            ringed: "any",
            codes: vec![(
                "L".into(),
                "__local memory is too small for the triangles of the scene, by arithmetic".into(),
            )],
        }
    }

    /// Returns the x coordinate of the right end of every SVG rectangle that has an x and a width.
    fn ends(svg: &str) -> Vec<f64> {
        let value = |part: &str, name: &str| -> Option<f64> {
            part.split_once(&format!(" {name}=\"")).and_then(|(_, rest)| rest.split('"').next()?.parse().ok())
        };
        svg.split("<rect")
            .skip(1)
            .filter_map(|part| part.split('>').next())
            .filter_map(|part| Some(value(part, "x")? + value(part, "width")?))
            .collect()
    }

    #[test]
    fn long_names_of_columns_leave_fewer_cells_per_line() {
        assert_eq!(map().across(), MOST_ACROSS);
        let devices = ["pthread-EPYC", "NVIDIA H200"].map(str::to_owned).to_vec();
        let across = HeatMap { columns: devices, ..map() }.across();
        assert!((2..MOST_ACROSS).contains(&across), "{across}");
        assert_eq!(HeatMap { columns: vec!["a".repeat(99)], ..map() }.across(), 1);
        let none = Cell::Nothing { code: "a".repeat(20), tip: "no".into() };
        assert_eq!(HeatMap { rows: vec![("naive".into(), vec![none])], ..map() }.across(), 2);
    }

    #[test]
    fn every_cell_and_the_legend_are_as_wide_as_a_phone() {
        let svg = map().narrow_svg();
        assert_eq!(svg.matches("class=\"mark\"").count(), 8);
        assert!(ends(&svg).len() > 50 && ends(&svg).iter().all(|end| *end <= NARROW.whole_width()), "{svg}");
        assert!(svg.contains("16x16") && svg.contains("by arithmetic"));
        assert!(svg.contains("hatch-teapot-narrow"), "a pattern is found by name in the whole page");
    }

    #[test]
    fn a_long_row_continues_below_and_each_cell_has_its_column_and_its_value() {
        let svg = map().narrow_svg();
        let value = |part: &str, name: &str| -> f64 {
            let rest = part.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
            rest.and_then(|text| text.parse().ok()).expect("a number")
        };
        let marks: Vec<&str> = svg.split("class=\"mark\"").skip(1).collect();
        let bounds = |mark: &str| {
            let cell = mark.split("class=\"cell\"").nth(1).expect("a cell");
            ["x", "y", "width"].map(|name| value(cell, name))
        };
        let [first, sixth, seventh] = [0, 5, 6].map(|number| bounds(marks[number]));
        assert_eq!([first[1], first[0]], [sixth[1], seventh[0]]);
        assert_eq!(seventh[1] - first[1], HEIGHT);
        assert!(sixth[0] - first[0] > 5.0 * first[2] && sixth[0] + sixth[2] < NARROW.whole_width());
        let texts = |mark: &str| -> Vec<String> {
            let of = |part: &str| Some(part.split('>').nth(1)?.split('<').next()?.to_owned());
            mark.split("</g>").next().unwrap_or_default().split("<text").skip(1).filter_map(of).collect()
        };
        assert_eq!([texts(marks[0]), texts(marks[7])], [["1x1", "1"], ["16x16", "L"]]);
        assert!(svg.contains("7.0 times as slow"), "{svg}");
    }

    #[test]
    fn the_fastest_cell_is_the_lightest_as_in_the_wide_form() {
        let svg = map().narrow_svg();
        let fill = |cell: &str| Some(cell.split(" fill=\"").nth(1)?.split('"').next()?.to_owned());
        let fills: Vec<String> = svg.split("class=\"cell\"").skip(1).filter_map(fill).collect();
        let expected = [1.0, 0.0].map(|position| hex(viridis(position)));
        assert_eq!([&fills[0], &fills[6]], expected.each_ref());
    }
}
