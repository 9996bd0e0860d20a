//! Draws plots as SVG. A plot can be read without JavaScript. In a report, the page's JavaScript gives the plots
//! tooltips, and legends whose entries hide or show series.

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
    /// The plot's caption, which consists of a few sentences.
    pub caption: String,
    /// The plot as drawn for a screen, as SVG.
    pub svg: String,
    /// The plot as drawn for a phone, as SVG; empty if the plot has no separate form for phones.
    pub narrow: String,
}

impl Plot {
    /// Draws a chart for screens and for phones.
    pub fn of(name: impl Into<String>, caption: impl Into<String>, chart: &chart::Chart) -> Self {
        let (svg, narrow) = (chart.svg(), chart.narrow_svg());
        Self { name: name.into(), caption: caption.into(), svg, narrow }
    }
}
