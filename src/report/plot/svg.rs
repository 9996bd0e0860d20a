//! Writes SVG documents element by element, and escapes all text.

use std::fmt::{Display, Write};

/// Escapes text for SVG, XML and HTML, in elements and in quoted attributes. Control characters other than line breaks
/// become blanks.
fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\n' => safe.push_str("&#10;"),
            // XML cannot represent most other control characters, even when escaped.
            control if control.is_control() => safe.push(' '),
            other => safe.push(other),
        }
    }
    safe
}

/// Formats a number with at most two decimals. More decimals would not be visible, since a hundredth of the
/// SVG's unit of length is only a fiftieth of a pixel of the PNG.
pub fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Height of a line of text in pixels.
pub const LINE: f64 = 16.0;

/// An SVG document to which elements are being added.
#[derive(Clone, Debug, Default)]
pub struct Svg {
    body: String,
}

/// The part of a text that is placed at a given position; SVG calls this part the text anchor. (The anchor of an
/// experiment is something else.)
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The left end of the text is at the position.
    Start,
    /// The middle of the text is at the position.
    Middle,
    /// The right end of the text is at the position.
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

impl Svg {
    /// Writes an SVG element without content.
    pub fn element(&mut self, name: &str, attributes: &[(&str, &dyn Display)]) {
        self.tag(name, attributes);
        self.body.push_str("/>");
    }

    /// Writes the start tag of an SVG element. [`Svg::close`] writes the end tag.
    pub fn open(&mut self, name: &str, attributes: &[(&str, &dyn Display)]) {
        self.tag(name, attributes);
        self.body.push('>');
    }

    /// Writes the end tag of an SVG element. The caller must close elements in the reverse of the order in
    /// which they were opened.
    pub fn close(&mut self, name: &str) {
        // Writing to a String cannot fail, so the `Result`s of `write!` are ignored here and below.
        let _ = writeln!(self.body, "</{name}>");
    }

    fn tag(&mut self, name: &str, attributes: &[(&str, &dyn Display)]) {
        let _ = write!(self.body, "<{name}");
        for (key, value) in attributes {
            let _ = write!(self.body, " {key}=\"{}\"", escape(&value.to_string()));
        }
    }

    /// Draws a straight line. The line has the colour `colour`, unless a style sheet sets another colour for
    /// `class`.
    pub fn line(&mut self, class: &str, colour: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) {
        let (x1, y1, x2, y2) = (number(x1), number(y1), number(x2), number(y2));
        self.element(
            "line",
            &[("class", &class), ("stroke", &colour), ("x1", &x1), ("y1", &y1), ("x2", &x2), ("y2", &y2)],
        );
    }

    /// Writes a line of text.
    pub fn text(&mut self, class: &str, [x, y]: [f64; 2], anchor: Anchor, text: &str) {
        self.text_in(class, super::palette::INK, [x, y], anchor, text);
    }

    /// Writes a line of text in the given colour.
    pub fn text_in(&mut self, class: &str, colour: &str, [x, y]: [f64; 2], anchor: Anchor, text: &str) {
        let size = if class.contains("small") { 11 } else { 12 };
        self.open(
            "text",
            &[
                ("class", &class),
                ("fill", &colour),
                ("x", &number(x)),
                ("y", &number(y)),
                ("text-anchor", &anchor.name()),
                ("font-size", &size),
            ],
        );
        self.body.push_str(&escape(text));
        self.close("text");
    }

    /// Writes several lines of text.
    pub fn lines(&mut self, class: &str, [x, y]: [f64; 2], anchor: Anchor, lines: &[String]) {
        for (index, line) in (0..).zip(lines) {
            self.text(class, [x, y + LINE * f64::from(index)], anchor, line);
        }
    }

    /// Writes a text that runs upwards and has its middle at the position `x`, `y`.
    pub fn upright_text(&mut self, class: &str, [x, y]: [f64; 2], text: &str) {
        let turn = format!("translate({} {}) rotate(-90)", number(x), number(y));
        self.open("g", &[("transform", &turn)]);
        self.text(class, [0.0, 0.0], Anchor::Middle, text);
        self.close("g");
    }

    /// Writes a slanted text that ends at the position `x`, `y`.
    pub fn slanted_text(&mut self, class: &str, colour: &str, [x, y]: [f64; 2], text: &str) {
        let turn = format!("translate({} {}) rotate(-35)", number(x), number(y));
        self.open("g", &[("transform", &turn)]);
        self.text_in(class, colour, [0.0, 0.0], Anchor::End, text);
        self.close("g");
    }

    /// Returns the finished SVG document, which an HTML page can also embed. Screen readers read `name` and
    /// `about` aloud.
    pub fn finish(self, [width, height]: [f64; 2], name: &str, about: &str) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" \
             height=\"{h}\" style=\"--w:{w}\" role=\"img\" aria-label=\"{}\" tabindex=\"0\" font-family=\"system-ui, -apple-system, \
             'Segoe UI', 'DejaVu Sans', sans-serif\">\
             <desc>{}</desc><rect class=\"paper\" width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{}</svg>",
            escape(name),
            escape(about),
            self.body,
            w = number(width),
            h = number(height),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_put_in_becomes_markup() {
        let mut svg = Svg::default();
        svg.text("a\" onload=\"x", [0.0, 0.0], Anchor::Start, "<script>alert(1)</script>");
        let text = svg.finish([10.0, 10.0], "\"><script>", "&");
        assert!(!text.contains("<script") && !text.contains("\" onload"), "{text}");
        assert!(text.contains("&lt;script&gt;alert(1)"), "{text}");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([1.0, 0.5, 12.346].map(number), ["1", "0.5", "12.35"]);
    }

    #[test]
    fn a_line_is_drawn_from_one_point_to_the_other_and_text_at_its_position() {
        let mut svg = Svg::default();
        svg.line("axis", "#123456", [1.0, 2.0], [3.5, 4.0]);
        svg.lines("small", [5.0, 6.0], Anchor::End, &["a".to_owned(), "b".to_owned()]);
        svg.upright_text("c", [7.0, 8.0], "up");
        let text = svg.finish([10.0, 20.0], "name", "about");
        let document = resvg::usvg::roxmltree::Document::parse(&text).expect("well-formed");
        let nodes = |name: &str| {
            document
                .descendants()
                .filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", name)))
                .collect::<Vec<_>>()
        };
        let line = nodes("line")[0];
        assert_eq!(
            ["x1", "y1", "x2", "y2"].map(|name| line.attribute(name)),
            ["1", "2", "3.5", "4"].map(Some)
        );
        assert_eq!((line.attribute("class"), line.attribute("stroke")), (Some("axis"), Some("#123456")));
        let actual: Vec<_> = nodes("text").iter().map(|node| (node.text(), node.attribute("y"))).collect();
        assert_eq!(actual, [(Some("a"), Some("6")), (Some("b"), Some("22")), (Some("up"), Some("0"))]);
        assert_eq!(nodes("text")[0].attribute("text-anchor"), Some("end"));
        let sizes = [0, 2].map(|index| nodes("text")[index].attribute("font-size"));
        assert_eq!(sizes, [Some("11"), Some("12")], "a small text and another");
        assert_eq!(nodes("g")[0].attribute("transform"), Some("translate(7 8) rotate(-90)"));
    }

    #[test]
    fn what_xml_cannot_hold_becomes_a_blank() {
        assert_eq!(escape("a\u{1}b\nc\u{7f}'"), "a b&#10;c &#39;");
    }
}
