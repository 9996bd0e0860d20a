//! A picture as text. Each character is a half block (`▀`): its upper half shows one pixel, and its lower half the
//! pixel below.

use image::RgbImage;
use std::fmt::Write as _;

/// Returns a picture as lines of half blocks, one line for two rows of pixels. Each line ends with `end`. Codes for
/// colours are written at the beginning of each line, and then only where the colours change. If the number of rows is
/// odd, both halves of the last line show the last row.
pub fn blocks(picture: &RgbImage, end: &str) -> String {
    let [width, height] = [picture.width(), picture.height()];
    let mut text = String::new();
    for top in (0..height).step_by(2) {
        let mut last = None;
        for x in 0..width {
            let below = (top + 1).min(height - 1);
            let colours = [picture.get_pixel(x, top).0, picture.get_pixel(x, below).0];
            if last != Some(colours) {
                let [[r, g, b], [red, green, blue]] = colours;
                // Writing to a String cannot fail.
                let _ = write!(text, "\x1b[38;2;{r};{g};{b};48;2;{red};{green};{blue}m");
                last = Some(colours);
            }
            text.push('▀');
        }
        let _ = write!(text, "\x1b[0m{end}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn two_rows_are_a_line_and_a_colour_is_set_once() {
        let mut picture = RgbImage::from_pixel(3, 3, Rgb([1, 2, 3]));
        picture.put_pixel(2, 1, Rgb([9, 8, 7]));
        let lines = "\x1b[38;2;1;2;3;48;2;1;2;3m▀▀\x1b[38;2;1;2;3;48;2;9;8;7m▀\x1b[0m\n\
                     \x1b[38;2;1;2;3;48;2;1;2;3m▀▀▀\x1b[0m\n";
        assert_eq!(blocks(&picture, "\n"), lines);
    }
}
