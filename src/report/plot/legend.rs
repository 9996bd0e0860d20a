//! Draws the legend of a chart. In a page, the legend's entries are buttons.

use super::look::Look;
use super::svg::{Anchor, Svg};

/// The distance between two entries in pixels.
const STEP: f64 = 19.0;
/// The largest number of characters of a name. Longer names are shortened; in a page, a tooltip
/// shows the full name.
const LONGEST: usize = 24;

/// Draws the entries below each other, the first at the position `left`, `top`. Returns the y coordinate of
/// the legend's lower end.
pub fn draw(svg: &mut Svg, [left, top]: [f64; 2], entries: &[(&str, Look)]) -> f64 {
    for (index, (name, look)) in entries.iter().enumerate() {
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
        svg.text("label", [left + 11.0, y + 4.0], Anchor::Start, &shorten(name, LONGEST));
        svg.close("g");
    }
    top + entries.len() as f64 * STEP
}

/// Shortens a name to at most `longest` characters; an ellipsis replaces its middle. The beginning and the end of the
/// name remain, since names differ there. A name begins with the preset, and may end with the value of an axis or with
/// the exponent of a fitted power law.
pub fn shorten(name: &str, longest: usize) -> String {
    let length = name.chars().count();
    if length <= longest {
        return name.to_owned();
    }
    let head = longest / 3;
    let tail = longest.saturating_sub(head + 1);
    name.chars().take(head).chain(['…']).chain(name.chars().skip(length - tail)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_keep_both_ends() {
        assert_eq!(shorten("tile-group", 24), "tile-group");
        let long = shorten("tile-group+intersector=common-origin: ^0.36", 24);
        assert_eq!(long, "tile-gro…n-origin: ^0.36");
        assert_eq!(long.chars().count(), 24);
    }

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
        assert!(entries[1].contains(&format!(">{}<", shorten(long, LONGEST))), "{text}");
    }
}
