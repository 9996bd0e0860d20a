//! Converts plots from SVG to PNG, with a font that the program contains, so that the PNGs are the same on
//! every machine.

use crate::error::{Error, Result};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};
use resvg::{tiny_skia, usvg};
use std::sync::Arc;

/// The font DejaVu Sans (Bitstream Vera licence), reduced to Latin, Greek and Cyrillic letters and some signs. In place
/// of any other character, the PNG shows the font's glyph of missing characters, an empty box.
const FONT: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");
const FAMILY: &str = "DejaVu Sans";
/// Number of pixels of the PNG per unit of length of the SVG.
const SCALE: f32 = 2.0;

/// Converts SVG to PNG, with two pixels per unit of length of the SVG across and down, so that the picture is
/// sharp in print.
pub fn png(svg: &str) -> Result<Vec<u8>> {
    let fail = |error: &dyn std::fmt::Display| Error::fault(format!("a plot could not be drawn: {error}"));
    let mut options = usvg::Options { font_family: FAMILY.to_owned(), ..usvg::Options::default() };
    let fonts = Arc::make_mut(&mut options.fontdb);
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family(FAMILY);
    let tree = usvg::Tree::from_str(svg, &options).map_err(|error| fail(&error))?;
    let size = tree.size().to_int_size().scale_by(SCALE).ok_or_else(|| fail(&"it has no size"))?;
    let mut pixels =
        tiny_skia::Pixmap::new(size.width(), size.height()).ok_or_else(|| fail(&"it is too large"))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    let (width, height) = (size.width(), size.height());
    let mut bytes = Vec::new();
    // The PNG encoder compresses fast rather than well, since a report can have hundreds of plots.
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive);
    encoder
        .write_image(&pixels.take_demultiplied(), width, height, ExtendedColorType::Rgba8)
        .map_err(|error| fail(&error))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::svg::{Anchor, Svg};
    use super::*;

    fn drawn(text: &str) -> image::RgbImage {
        let mut svg = Svg::default();
        svg.text("", [50.0, 25.0], Anchor::Middle, text);
        let bytes = png(&svg.finish([100.0, 50.0], "", "")).expect("it draws");
        image::load_from_memory(&bytes).expect("a PNG").to_rgb8()
    }

    fn ink(picture: &image::RgbImage) -> usize {
        picture.pixels().filter(|pixel| pixel.0[0] < 128).count()
    }

    #[test]
    fn text_is_drawn_without_any_font_of_the_system() {
        let picture = drawn("8x8 µs ×");
        assert_eq!(picture.dimensions(), (200, 100));
        assert!(ink(&picture) > 50, "no ink");
    }

    #[test]
    fn a_letter_without_a_glyph_is_a_box_and_not_left_out() {
        let missing = drawn("漢");
        assert!(ink(&missing) > 20, "no ink");
        assert!(drawn("字") == missing, "another box");
        for letter in ["ł", "č", "ő", "ế", "Я", "ґ", "Ω", "€"] {
            let picture = drawn(letter);
            assert!(ink(&picture) > 10 && picture != missing, "{letter}");
        }
    }
}
