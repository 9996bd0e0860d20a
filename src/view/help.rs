//! The list of keys, drawn over a picture.

use super::keys::KEYS;
use crate::error::{Error, Result};
use crate::report::plot::png::png;
use crate::report::plot::svg::{Anchor, LINE, Svg};
use image::RgbImage;
use image::imageops::replace;

/// The size of the drawing, in units of two pixels.
const SIZE: [f64; 2] = [340.0, 200.0];

/// Returns the drawing of the list of keys, on white.
pub fn panel() -> Result<RgbImage> {
    let mut svg = Svg::default();
    svg.element("rect", &[("fill", &"#ffffff"), ("width", &SIZE[0]), ("height", &SIZE[1])]);
    for (index, row) in KEYS.iter().enumerate() {
        let y = LINE * (index as f64 + 1.5);
        svg.text("", [14.0, y], Anchor::Start, row.names);
        svg.text("", [84.0, y], Anchor::Start, row.about);
    }
    let drawn = image::load_from_memory(&png(&svg.finish(SIZE, "", ""))?);
    drawn
        .map(|panel| panel.to_rgb8())
        .map_err(|error| Error::fault(format!("cannot draw the list of keys: {error}")))
}

/// Draws a panel over the upper left corner of a picture, and returns true. If the panel is wider or higher
/// than the picture, draws nothing and returns false.
pub fn lay(panel: &RgbImage, picture: &mut RgbImage) -> bool {
    let fits = panel.width() <= picture.width() && panel.height() <= picture.height();
    if fits {
        replace(picture, panel, 0, 0);
    }
    fits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_has_a_line_with_ink_and_room() {
        let panel = panel().expect("it draws");
        let [width, height] = [panel.width(), panel.height()];
        let scale = f64::from(width) / SIZE[0];
        let is_dark = |x: u32, y: u32| panel.get_pixel(x, y).0[0] < 128;
        for index in 0..KEYS.len() {
            let rows = [index as f64 + 0.5, index as f64 + 1.6].map(|lines| (lines * LINE * scale) as u32);
            assert!((rows[0]..rows[1]).any(|y| (0..width).any(|x| is_dark(x, y))), "line {index}");
        }
        assert!((0..height).all(|y| !is_dark(width - 1, y)), "a line is cut off");
        assert!((0..width).all(|x| !is_dark(x, height - 1)), "the last line is cut off");
    }

    #[test]
    fn a_small_picture_has_no_room() {
        let panel = RgbImage::from_pixel(4, 2, image::Rgb([9; 3]));
        let mut picture = RgbImage::new(5, 3);
        assert!(lay(&panel, &mut picture));
        assert_eq!((picture.get_pixel(3, 1).0, picture.get_pixel(4, 2).0), ([9; 3], [0; 3]));
        assert!(lay(&panel, &mut RgbImage::new(4, 2)), "a picture of the panel's size has room");
        assert!(!lay(&panel, &mut RgbImage::new(3, 3)) && !lay(&panel, &mut RgbImage::new(5, 1)));
    }
}
