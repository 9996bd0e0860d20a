//! Plots as SVG: readable as they are, and made interactive by the page that holds them.

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

pub use legend::shorten;

/// A finished plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Its name as a file, without an ending.
    pub name: String,
    /// Its caption, a sentence or two.
    pub caption: String,
    /// The drawing.
    pub svg: String,
    /// The same plot for a phone; empty if there is none.
    pub narrow: String,
}

impl Plot {
    /// A plot of a chart, for screens and for phones.
    pub fn of(name: impl Into<String>, caption: impl Into<String>, chart: &chart::Chart) -> Self {
        let (svg, narrow) = (chart.svg(), chart.narrow_svg());
        Self { name: name.into(), caption: caption.into(), svg, narrow }
    }
}
