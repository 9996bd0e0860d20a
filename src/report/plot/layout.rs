//! The two layouts of a chart. On a screen, the legend is on the right of the chart; on a phone, the legend
//! is below the chart.

/// Approximate width of a letter in pixels.
pub const LETTER: f64 = 7.0;

/// Positions and sizes of a chart's parts, in pixels.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Distance from the left edge to the y axis.
    pub left: f64,
    /// Distance from the upper edge to the upper end of the y axis, if the title has one line.
    pub top: f64,
    /// Length of the x axis.
    pub width: f64,
    /// Length of the y axis.
    pub height: f64,
    /// True if the legend is below the chart, and false if the legend is on the right.
    pub legend_below: bool,
}

/// The layout of a chart for screens.
pub const WIDE: Layout = Layout { left: 66.0, top: 34.0, width: 640.0, height: 330.0, legend_below: false };
/// The layout of a chart for phones.
pub const NARROW: Layout = Layout { left: 60.0, top: 34.0, width: 286.0, height: 270.0, legend_below: true };

/// Approximate width of a letter in a title, in pixels.
const BOLD_LETTER: f64 = 7.8;
/// The margin on both sides of a title, in pixels.
const MARGIN: f64 = 12.0;
/// Width of a legend on the right of a chart, in pixels.
const LEGEND: f64 = 190.0;

impl Layout {
    /// Returns the width of the chart with its margins and legend, in pixels.
    pub fn whole_width(&self) -> f64 {
        self.left + self.width + if self.legend_below { 12.0 } else { 18.0 + LEGEND }
    }

    /// Splits a title or an axis's label into lines that fit into the chart's width. On a screen, a line of
    /// the title or label must end before the end of the x axis, since not every plot has a legend on the
    /// right. Words are not split.
    pub fn lines(&self, text: &str) -> Vec<String> {
        let whole = if self.legend_below { self.whole_width() } else { self.left + self.width };
        lines_of(text, ((whole - 2.0 * MARGIN) / BOLD_LETTER) as usize)
    }
}

/// Splits a text into lines of at most `most` characters. A word with more than `most` characters gets a
/// separate line.
pub fn lines_of(text: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut().filter(|line| line.chars().count() + 1 + word.chars().count() <= most) {
            Some(line) => *line = format!("{line} {word}"),
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_as_many_words_as_fit() {
        assert_eq!(lines_of("one two three", 7), ["one two", "three"]);
        assert_eq!(lines_of("one two three", 6), ["one", "two", "three"]);
        assert_eq!(lines_of("one elephant", 4), ["one", "elephant"]);
    }

    #[test]
    fn a_long_title_is_one_line_on_a_screen_and_several_on_a_phone() {
        let title = "Figure 8 as shapes: cpu-skylake-avx512-AMD EPYC 9B45 128-Core Processor";
        assert_eq!(WIDE.lines(title), [title]);
        assert_eq!(WIDE.lines(&[title; 2].join(", ")).len(), 2, "a title of two devices is cut nowhere");
        let lines = NARROW.lines(title);
        assert_eq!((lines.len(), lines.join(" ").as_str()), (2, title));
        assert!(lines.iter().all(|line| line.chars().count() as f64 * LETTER <= NARROW.whole_width()));
        assert_eq!(NARROW.lines(""), [""]);
        // On a phone, a line of a title has room for 42 letters.
        let words = |second: usize| format!("{} {}", "a".repeat(20), "b".repeat(second));
        assert_eq!([21, 22].map(|second| NARROW.lines(&words(second)).len()), [1, 2]);
    }
}
