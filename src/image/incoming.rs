//! An 8-bit picture whose rows arrive one after another, from the top.

use super::encode::{JPEG_QUALITY, jpeg_of, png_of};
use super::file::is_jpeg;
use super::{jpeg, png_rows};
use crate::error::Result;
use crate::output::Target;
use std::io::Error;

/// A picture whose rows arrive one after another, from the top. Rows are encoded while further rows arrive.
pub enum Incoming {
    Png(png_rows::Encoding),
    /// A JPEG is encoded in bands of rows, by several threads.
    Jpeg(jpeg::Encoding),
}

impl Incoming {
    /// Makes an empty picture that will be written to the file `target`.
    pub fn new(target: &Target, size: [u32; 2]) -> Self {
        match is_jpeg(target.path()) {
            true => Self::Jpeg(jpeg::Encoding::new(size, JPEG_QUALITY)),
            false => Self::Png(png_rows::Encoding::new(size)),
        }
    }

    /// Returns the number of picture rows that are encoded together. Each call of `take` must get a multiple
    /// of this number of rows, except the last call, which may get any number.
    pub fn rows_together(&self) -> usize {
        match self {
            Self::Png(_) => 1,
            Self::Jpeg(encoding) => encoding.rows_together(),
        }
    }

    /// Adds the next rows of the picture: red, green and blue of each pixel.
    pub fn take(&mut self, rows: &[u8]) {
        match self {
            Self::Png(encoding) => encoding.take(rows),
            Self::Jpeg(encoding) => encoding.take(rows),
        }
    }

    /// Writes the picture to a file, once all rows have arrived. The file is written completely or not at
    /// all.
    pub fn save(self, target: &Target) -> Result<()> {
        match self {
            Self::Png(encoding) => {
                let encoded = encoding.finish();
                target.write(|file| png_of(&encoded?, file))
            }
            Self::Jpeg(encoding) => {
                let encoded = encoding.finish();
                target.write(|file| jpeg_of(&encoded.map_err(Error::other)?, file))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::RgbImage;

    #[test]
    fn each_band_of_rows_is_below_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::of_results(folder.path().join("a.png"));
        let mut incoming = Incoming::new(&target, [1, 4]);
        for rows in [&[1_u8; 3][..], &[2; 6], &[], &[3; 3]] {
            incoming.take(rows);
        }
        incoming.save(&target).unwrap();
        let picture = image::open(target.path()).unwrap().to_rgb8();
        assert_eq!(picture.into_raw(), [1, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3]);
    }

    #[test]
    fn a_picture_that_came_in_rows_is_the_file_that_its_name_says() {
        let folder = tempfile::tempdir().unwrap();
        for (name, together, begin) in [("a.png", 1, &b"\x89PNG"[..]), ("a.jpg", 128, b"\xff\xd8")] {
            let target = Target::of_results(folder.path().join(name));
            let mut incoming = Incoming::new(&target, [2, 3]);
            assert_eq!(incoming.rows_together(), together, "{name}");
            incoming.take(&[200; 18]);
            incoming.save(&target).unwrap();
            assert!(std::fs::read(target.path()).unwrap().starts_with(begin), "{name}");
            let shown = image::open(target.path()).unwrap().to_rgb8();
            assert_eq!(shown, RgbImage::from_pixel(2, 3, image::Rgb([200; 3])), "{name}");
        }
    }
}
