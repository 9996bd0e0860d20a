//! Draws plots as SVG. The plots can be read without a script; the page's script makes them
//! interactive.

pub mod chart;
pub mod heat;
mod heat_narrow;
mod layout;
pub mod legend;
pub mod look;
pub mod palette;
pub mod png;
pub mod scale;
pub mod strip;
pub mod svg;

/// A finished plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// The plot's file name without extension.
    pub name: String,
    /// The plot's caption, a few sentences.
    pub caption: String,
    /// The drawing.
    pub svg: String,
    /// The drawing for a phone; empty if there is none.
    pub narrow: String,
}

impl Plot {
    /// Draws a chart for screens and for phones.
    pub fn of(name: impl Into<String>, caption: impl Into<String>, chart: &chart::Chart) -> Self {
        let (svg, narrow) = (chart.svg(), chart.narrow_svg());
        Self { name: name.into(), caption: caption.into(), svg, narrow }
    }
}
