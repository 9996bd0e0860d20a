//! Plots as SVG: readable as they are, and made interactive by the page that holds them.

pub mod chart;
pub mod heat;
mod legend;
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
    /// What to see in it, in a sentence or two.
    pub caption: String,
    /// The drawing.
    pub svg: String,
}
