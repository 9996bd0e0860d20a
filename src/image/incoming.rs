//! An 8-bit picture whose rows arrive one after another, from the top.

use super::encode::{JPEG_QUALITY, jpeg_of};
use super::file::{is_jpeg, save_rgb8};
use super::jpeg::Encoding;
use crate::error::Result;
use crate::output::Target;
use image::RgbImage;
use rayon::prelude::*;
use std::io::Error;

/// Number of bytes that a thread copies in one task.
const COPIED_TOGETHER: usize = 1 << 18;

/// A picture whose rows arrive one after another, from the top.
pub enum Incoming {
    /// A picture that is kept in memory until all rows have arrived, and the number of bytes that have
    /// arrived so far.
    Whole(RgbImage, usize),
    /// A JPEG, whose bands of rows are encoded while further rows arrive.
    Jpeg(Encoding),
}

impl Incoming {
    /// Makes an empty picture that will be written to the file `target`.
    pub fn new(target: &Target, size: [u32; 2]) -> Self {
        match is_jpeg(target.path()) {
            true => Self::Jpeg(Encoding::new(size, JPEG_QUALITY)),
            false => Self::Whole(RgbImage::new(size[0], size[1]), 0),
        }
    }

    /// Returns the number of picture rows that are encoded together. Each call of `take` must get a multiple
    /// of this number of rows, except the last call, which may get any number.
    pub fn rows_together(&self) -> usize {
        match self {
            Self::Whole(..) => 1,
            Self::Jpeg(encoding) => encoding.rows_together(),
        }
    }

    /// Adds the next rows of the picture: red, green and blue of each pixel.
    pub fn take(&mut self, rows: &[u8]) {
        match self {
            Self::Whole(picture, there) => {
                let bytes: &mut [u8] = picture;
                let target = &mut bytes[*there..*there + rows.len()];
                // All cores copy parts of the rows, since the first access to the picture's new memory is
                // slow.
                let pairs = target.par_chunks_mut(COPIED_TOGETHER).zip(rows.par_chunks(COPIED_TOGETHER));
                pairs.for_each(|(to, from)| to.copy_from_slice(from));
                *there += rows.len();
            }
            Self::Jpeg(encoding) => encoding.take(rows),
        }
    }

    /// Writes the picture to a file, once all rows have arrived. The file is written completely or not at
    /// all.
    pub fn save(self, target: &Target) -> Result<()> {
        match self {
            Self::Whole(picture, _) => save_rgb8(&picture, target),
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

    #[test]
    fn each_band_of_rows_is_below_the_one_before() {
        let mut incoming = Incoming::new(&Target::of_results("a.png"), [1, 4]);
        for rows in [&[1_u8; 3][..], &[2; 6], &[3; 3]] {
            incoming.take(rows);
        }
        let Incoming::Whole(picture, _) = incoming else { panic!("a PNG is stored whole") };
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
