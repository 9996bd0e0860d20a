//! The false colours that show differences and counts, and the colour scale below such pictures.

use image::{Rgb, RgbImage};

/// Red, the colour of pixels with a value that is not finite, and of pixels that only one of two compared
/// pictures has. Red does not occur in the colour map.
pub const WRONG: [u8; 3] = [255, 0, 0];
/// Height in pixels of the colour scale below a picture.
pub const SCALE_HEIGHT: u32 = 18;

/// Nine evenly spaced colours of the colour map viridis, whose lightness grows evenly. The authors of viridis
/// are Stéfan van der Walt, Nathaniel Smith and Eric Firing (licence CC0).
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];
/// Number of decades (factors of ten) that the colour map covers, up to a relative difference of 1.
const DECADES: u32 = 6;

/// Returns the colour that shows a relative difference. Differences below 1e-6 are black. From 1e-6 to 1, each factor
/// of ten takes a sixth of the colour map. Differences above 1 have the colour of 1. A difference that is not finite is
/// red ([`WRONG`]).
pub fn of_difference(relative: f64) -> Rgb<u8> {
    let position = 1.0 + relative.log10() / f64::from(DECADES);
    match relative {
        _ if !relative.is_finite() => Rgb(WRONG),
        _ if position < 0.0 => Rgb([0; 3]),
        _ => Rgb(viridis(position.min(1.0))),
    }
}

/// Returns the colour of the colour map at `position`, from 0 (dark) to 1 (light).
pub fn viridis(position: f64) -> [u8; 3] {
    let along = position * (VIRIDIS.len() - 1) as f64;
    let below = (along as usize).min(VIRIDIS.len() - 2);
    let part = along - below as f64;
    std::array::from_fn(|channel| {
        let [a, b] = [VIRIDIS[below][channel], VIRIDIS[below + 1][channel]].map(f64::from);
        (a + (b - a) * part).round() as u8
    })
}

/// Draws the colour map from left to right, in a strip whose first row is `top`, with a tick at each power of
/// ten. Below each tick is the exponent (`-6` to `0`), if the picture is wide enough.
pub fn draw_scale(picture: &mut RgbImage, top: u32) {
    let last = picture.width().saturating_sub(1);
    for (x, y) in (0..=last).flat_map(|x| (2..8).map(move |y| (x, y))) {
        put(picture, x, top + y, viridis(f64::from(x) / f64::from(last.max(1))));
    }
    for decade in 0..=DECADES {
        let x = last * decade / DECADES;
        (2..10).for_each(|y| put(picture, x, top + y, [255; 3]));
        let power = format!("{}", i64::from(decade) - i64::from(DECADES));
        let text_width = 4 * power.len() as u32;
        if (DECADES + 1) * (text_width + 4) < last {
            draw_text(picture, x.min(last - text_width), top + 11, &power);
        }
    }
}

/// Height in pixels of the scale that [`draw_count_scale`] draws.
pub const COUNT_SCALE_HEIGHT: u32 = SCALE_HEIGHT;

/// Draws the colour map from left to right, in a strip whose first row is `top`, with 0 below its left end and `most`
/// below its right end.
pub fn draw_count_scale(picture: &mut RgbImage, top: u32, most: u32) {
    let last = picture.width().saturating_sub(1);
    for (x, y) in (0..=last).flat_map(|x| (2..8).map(move |y| (x, y))) {
        put(picture, x, top + y, viridis(f64::from(x) / f64::from(last.max(1))));
    }
    let text = most.to_string();
    draw_text(picture, 0, top + 11, "0");
    draw_text(picture, last.saturating_sub(4 * text.len() as u32), top + 11, &text);
}

fn draw_text(picture: &mut RgbImage, left: u32, top: u32, text: &str) {
    for (index, rows) in (0..).zip(text.chars().map(glyph)) {
        for (y, x) in (0..5).flat_map(|y| (0..3).map(move |x| (y, x))) {
            if rows[y as usize] & (4 >> x) != 0 {
                put(picture, left + 4 * index + x, top + y, [255; 3]);
            }
        }
    }
}

/// Returns the glyph of a character: five rows of three dots. The lowest three bits of a byte are the dots of
/// one row.
fn glyph(character: char) -> [u8; 5] {
    match character {
        '-' => [0, 0, 7, 0, 0],
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        '2' => [7, 1, 7, 4, 7],
        '3' => [7, 1, 7, 1, 7],
        '4' => [5, 5, 7, 1, 1],
        '5' => [7, 4, 7, 1, 7],
        '6' => [7, 4, 7, 5, 7],
        '7' => [7, 1, 1, 1, 1],
        '8' => [7, 5, 7, 5, 7],
        '9' => [7, 5, 7, 1, 7],
        _ => [0; 5],
    }
}

fn put(picture: &mut RgbImage, x: u32, y: u32, colour: [u8; 3]) {
    if let Some(pixel) = picture.get_pixel_mut_checked(x, y) {
        *pixel = Rgb(colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_decade_is_lighter_than_the_one_before() {
        let light = |relative| {
            let [r, g, b] = of_difference(relative).0.map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let lights = [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0].map(light);
        assert!(lights.is_sorted_by(|a, b| a < b), "{lights:?}");
        assert_eq!(light(1.0), light(50.0));
    }

    #[test]
    fn the_map_goes_from_purple_to_yellow() {
        // The second expected colour is halfway between the first two colours of the colour map.
        let colours = [0.0, 1.0 / 16.0, 0.5, 1.0].map(viridis);
        assert_eq!(colours, [[68, 1, 84], [70, 23, 103], [33, 144, 141], [253, 231, 37]]);
        assert_eq!(
            [1e-7, 1e-3, 1.0, f64::NAN].map(|relative| of_difference(relative).0),
            [[0; 3], [33, 144, 141], [253, 231, 37], [255, 0, 0]]
        );
    }

    /// The colours are those of matplotlib's colour map viridis.
    #[test]
    fn the_map_is_viridis() {
        let colours = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|eighth| {
            let [r, g, b] = viridis(f64::from(eighth) / 8.0);
            format!("{r:02x}{g:02x}{b:02x}")
        });
        let expected = "440154 472c7a 3b518b 2c718e 21908d 27ad81 5cc863 aadc32 fde725";
        assert_eq!(colours.join(" "), expected);
    }

    /// Returns the dots of two characters below a colour scale. `left` is the column of the first character.
    fn text(picture: &RgbImage, left: u32) -> [String; 5] {
        dots(picture, left, 7)
    }

    /// Returns the dots of a text below a colour scale, from the column `left`.
    fn dots(picture: &RgbImage, left: u32, width: u32) -> [String; 5] {
        let dot = |x: u32, y: u32| if picture[(x, y)].0 == [255; 3] { '#' } else { ' ' };
        [0, 1, 2, 3, 4].map(|y| (left..left + width).map(|x| dot(x, 11 + y)).collect())
    }

    /// The other tests of this file draw the other digits.
    #[test]
    fn each_digit_has_its_own_dots() {
        let mut picture = RgbImage::new(23, SCALE_HEIGHT);
        draw_text(&mut picture, 0, 11, "134578");
        let expected = [
            " #  ### # # ### ### ###",
            "##    # # # #     # # #",
            " #  ### ### ###   # ###",
            " #    #   #   #   # # #",
            "### ###   # ###   # ###",
        ];
        assert_eq!(dots(&picture, 0, 23), expected);
    }

    #[test]
    fn the_scale_begins_with_minus_six() {
        let mut picture = RgbImage::new(500, SCALE_HEIGHT);
        draw_scale(&mut picture, 0);
        assert_eq!(text(&picture, 0), ["    ###", "    #  ", "### ###", "    # #", "    ###"]);
    }

    #[test]
    fn the_count_scale_ends_with_the_largest_count() {
        let mut picture = RgbImage::new(500, COUNT_SCALE_HEIGHT);
        draw_count_scale(&mut picture, 0, 29);
        assert_eq!(text(&picture, 491), ["### ###", "  # # #", "### ###", "#     #", "### ###"]);
    }

    #[test]
    fn both_scales_show_the_whole_map() {
        let (mut decades, mut counts) = (RgbImage::new(500, SCALE_HEIGHT), RgbImage::new(500, SCALE_HEIGHT));
        draw_scale(&mut decades, 0);
        draw_count_scale(&mut counts, 0, 1);
        // The columns that this loop checks contain no tick of a colour scale.
        for x in [1_u32, 100, 200, 400, 498] {
            let expected = viridis(f64::from(x) / 499.0);
            assert_eq!([decades[(x, 5)].0, counts[(x, 5)].0], [expected; 2], "column {x}");
        }
    }

    #[test]
    fn the_scale_fits_any_width() {
        for width in [0, 1, 2, 30, 500] {
            draw_scale(&mut RgbImage::new(width, SCALE_HEIGHT), 0);
        }
    }

    #[test]
    fn scales_stand_below_the_row_that_is_asked_for() {
        let (mut decades, mut counts) = (RgbImage::new(500, 30), RgbImage::new(500, 30));
        draw_scale(&mut decades, 7);
        draw_count_scale(&mut counts, 7, 29);
        for picture in [decades, counts] {
            // Column 100 contains no tick of a colour scale. From row 7 down, the column has two empty rows,
            // six rows of colour, and then only empty rows.
            let coloured: Vec<u32> = (0..30).filter(|&y| picture[(100, y)].0 != [0; 3]).collect();
            assert_eq!(coloured, [9, 10, 11, 12, 13, 14]);
            let written: Vec<u32> =
                (18..30).filter(|&y| (0..500).any(|x| picture[(x, y)].0 == [255; 3])).collect();
            assert_eq!(written, [18, 19, 20, 21, 22]);
        }
    }

    #[test]
    fn both_scales_have_a_zero_at_one_end() {
        let zero = ["###", "# #", "# #", "# #", "###"];
        let (mut decades, mut counts) = (RgbImage::new(500, SCALE_HEIGHT), RgbImage::new(500, SCALE_HEIGHT));
        draw_scale(&mut decades, 0);
        draw_count_scale(&mut counts, 0, 29);
        assert_eq!(text(&decades, 491), zero.map(|row| format!("    {row}")));
        assert_eq!(text(&counts, 0), zero.map(|row| format!("{row}    ")));
    }
}
