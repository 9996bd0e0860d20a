//! Draws plots as SVG. A plot is a picture that can be read without a script. In a report, the page's script adds
//! tooltips and switches.

pub mod chart;
pub mod heat;
mod heat_narrow;
mod layout;
pub mod legend;
pub mod look;
pub mod palette;
pub mod png;
pub mod scale;
pub mod shorten;
pub mod strip;
pub mod svg;

/// A finished plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// The plot's file name without extension.
    pub name: String,
    /// The plot's caption, a few sentences.
    pub caption: String,
    /// The drawing for a screen, as SVG.
    pub svg: String,
    /// The drawing for a phone, as SVG; empty if there is none.
    pub narrow: String,
}

impl Plot {
    /// Draws a chart for screens and for phones.
    pub fn of(name: impl Into<String>, caption: impl Into<String>, chart: &chart::Chart) -> Self {
        let (svg, narrow) = (chart.svg(), chart.narrow_svg());
        Self { name: name.into(), caption: caption.into(), svg, narrow }
    }
}
