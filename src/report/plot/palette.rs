//! The colours of plots, which colour-blind readers can distinguish.

/// The colours of the series in a plot. They are the palette of Masataka Okabe and Kei Ito (2008) with a
/// darker orange, and with grey instead of black and yellow. Black and yellow are replaced because black is
/// hard to see on a dark background, and yellow on a white background.
pub const SERIES: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b58900", "#56b4e9", "#5b5b6b"];
/// The colour of text.
pub const INK: &str = "#1c2530";
/// The colour of the grid lines behind a plot's marks.
pub const GRID: &str = "#dde3ea";
/// The colour of less important text and lines.
pub const FAINT: &str = "#5c6b7a";
