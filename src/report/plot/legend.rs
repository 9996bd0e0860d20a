//! Draws the legend of a chart. On a page, the legend's entries are buttons.

use super::look::Look;
use super::shorten::shorten_all;
use super::svg::{Anchor, Svg};

/// The vertical distance between two entries of the legend, in pixels.
const STEP: f64 = 19.0;
/// The largest number of characters of a name in the legend. Longer names are shortened; on a page, a tooltip
/// shows the full name.
const LONGEST: usize = 24;

/// Draws the legend's entries below each other, the first entry at the position `left`, `top`. Returns the y
/// coordinate of the legend's lower end.
pub fn draw(svg: &mut Svg, [left, top]: [f64; 2], entries: &[(&str, Look)]) -> f64 {
    let names: Vec<&str> = entries.iter().map(|(name, _)| *name).collect();
    let labels = shorten_all(&names, LONGEST);
    for (index, ((name, look), label)) in entries.iter().zip(&labels).enumerate() {
        let y = top + index as f64 * STEP;
        let class = format!("entry {}", look.class());
        svg.open("g", &[("class", &class), ("data-for", &index), ("data-tip", name)]);
        svg.element(
            "rect",
            &[
                ("class", &"hit"),
                ("x", &(left - 8.0)),
                ("y", &(y - 9.5)),
                ("width", &186),
                ("height", &STEP),
                ("fill", &"none"),
            ],
        );
        look.marker(svg, [left, y]);
        svg.text("label", [left + 11.0, y + 4.0], Anchor::Start, label);
        svg.close("g");
    }
    top + entries.len() as f64 * STEP
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_stand_below_each_other_with_their_whole_names_as_tips() {
        let mut svg = Svg::default();
        let long = "tile-group+intersector=common-origin";
        let end = draw(&mut svg, [10.0, 20.0], &[("naive", Look::of(3)), (long, Look::of(5))]);
        let text = svg.finish([1.0, 1.0], "", "");
        assert_eq!(end, 20.0 + 2.0 * STEP);
        let entries: Vec<&str> = text.split("class=\"entry ").skip(1).collect();
        for (entry, (class, number, name, y)) in
            entries.iter().zip([("s3", "0", "naive", "10.5"), ("s5", "1", long, "29.5")])
        {
            let start = format!("{class}\" data-for=\"{number}\" data-tip=\"{name}\"");
            assert!(entry.starts_with(&start) && entry.contains(&format!(" y=\"{y}\"")), "{entry}");
        }
        assert!(entries[1].contains(">tile-group+common-origin<"), "{text}");
    }

    #[test]
    fn no_two_strategies_have_the_same_entry() {
        let names =
            ["my-test", "plucker"].map(|test| format!("deferred+intersector={test}+records=each-test"));
        let mut svg = Svg::default();
        let [one, other] = names.each_ref().map(String::as_str);
        draw(&mut svg, [10.0, 20.0], &[(one, Look::of(0)), (other, Look::of(1))]);
        let text = svg.finish([1.0, 1.0], "", "");
        for label in [">…intersector=my-test…<", ">…intersector=plucker…<"] {
            assert!(text.contains(label), "{label} is not in {text}");
        }
    }
}
