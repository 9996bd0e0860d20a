//! Encodes JPEG in bands of rows on several cores. Restart markers separate the bands: a JPEG decoder resets
//! its state at each of these markers. The decoded pixels are the same as if the picture were encoded in one
//! piece.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageError, ImageResult, RgbImage};
use rayon::prelude::*;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Width and height of a block in pixels. The encoder does not subsample any channel, so the blocks of all
/// channels have this size.
const BLOCK: usize = 8;
/// The largest number of blocks between two restart markers, which is stored in 16 bits.
const MOST_BLOCKS: usize = u16::MAX as usize;
/// Number of block rows (rows of blocks) in a band, unless [`MOST_BLOCKS`] allows fewer. Encoding a band of this height
/// takes long enough to be worth a separate task.
const BAND_ROWS: usize = 16;
pub(super) const MARKER: u8 = 0xff;
const START_OF_FRAME: u8 = 0xc0;
const FIRST_RESTART: u8 = 0xd0;
const RESTARTS: usize = 8;
pub(super) const START_OF_SCAN: u8 = 0xda;
pub(super) const END_OF_IMAGE: [u8; 2] = [MARKER, 0xd9];
const RESTART_INTERVAL: u8 = 0xdd;

/// Encodes a picture, and returns the bytes of the JPEG file.
pub fn encode(picture: &RgbImage, quality: u8) -> ImageResult<Vec<u8>> {
    let cut = Cut::of(picture.width());
    let encode = |rows: &[u8]| band(rows, picture.width(), quality);
    let bands: Vec<Vec<u8>> =
        picture.as_raw().par_chunks(cut.band_bytes()).map(encode).collect::<ImageResult<_>>()?;
    cut.joined(bands, picture.height())
}

/// A JPEG that is being encoded while rows of the picture still arrive.
pub struct Encoding {
    cut: Cut,
    height: u32,
    quality: u8,
    /// Number of bands whose encoding has begun.
    begun: usize,
    /// The channel through which the threads that encode bands send the encoded bands.
    done: (Sender<Numbered>, Receiver<Numbered>),
}

/// A band's number, counted from the top of the picture, and the band encoded as a JPEG file.
type Numbered = (usize, ImageResult<Vec<u8>>);

impl Encoding {
    /// Starts to encode a picture of the given size in pixels.
    pub fn new([width, height]: [u32; 2], quality: u8) -> Self {
        Self { cut: Cut::of(width), height, quality, begun: 0, done: channel() }
    }

    /// Returns the number of picture rows in a band. Each call of `take` must get a multiple of this number of rows,
    /// except the last call, which may get any number.
    pub fn rows_together(&self) -> usize {
        self.cut.rows()
    }

    /// Adds the next rows of the picture, and starts to encode these rows on other cores.
    pub fn take(&mut self, rows: &[u8]) {
        for rows in rows.chunks(self.cut.band_bytes()) {
            let (rows, sender) = (rows.to_vec(), self.done.0.clone());
            let (number, width, quality) = (self.begun, self.cut.width, self.quality);
            self.begun += 1;
            // Sending fails only if the receiver of encoded bands is gone; then the band is no longer needed.
            rayon::spawn(move || drop(sender.send((number, band(&rows, width, quality)))));
        }
    }

    /// Waits until all bands are encoded, and returns the bytes of the JPEG file.
    pub fn finish(self) -> ImageResult<Vec<u8>> {
        let (sender, receiver) = self.done;
        drop(sender);
        let mut bands: Vec<Numbered> = receiver.into_iter().collect();
        bands.sort_unstable_by_key(|(number, _)| *number);
        let bands = bands.into_iter().map(|(_, band)| band).collect::<ImageResult<_>>()?;
        self.cut.joined(bands, self.height)
    }
}

/// The division of a picture into bands of rows. Each band is first encoded as a separate JPEG.
#[derive(Clone, Copy)]
struct Cut {
    width: u32,
    blocks_across: usize,
    /// Number of block rows in a band.
    block_rows: usize,
}

impl Cut {
    fn of(width: u32) -> Self {
        let blocks_across = (width as usize).div_ceil(BLOCK);
        Self { width, blocks_across, block_rows: (MOST_BLOCKS / blocks_across.max(1)).clamp(1, BAND_ROWS) }
    }

    fn rows(self) -> usize {
        BLOCK * self.block_rows
    }

    fn band_bytes(self) -> usize {
        (3 * self.width as usize * self.rows()).max(1)
    }

    /// Joins the JPEG files of all bands into one.
    fn joined(self, mut bands: Vec<Vec<u8>>, height: u32) -> ImageResult<Vec<u8>> {
        if bands.len() == 1 {
            return Ok(bands.remove(0));
        }
        join(&bands, height, self.blocks_across * self.block_rows).ok_or_else(|| {
            ImageError::IoError(std::io::Error::other(
                "the JPEG encoder wrote parts of the picture with a structure that raycl cannot join",
            ))
        })
    }
}

fn band(rows: &[u8], width: u32, quality: u8) -> ImageResult<Vec<u8>> {
    let height = (rows.len() / 3).checked_div(width as usize).unwrap_or(0) as u32;
    let mut file = Vec::new();
    JpegEncoder::new_with_quality(&mut file, quality).encode(rows, width, height, ExtendedColorType::Rgb8)?;
    Ok(file)
}

/// Joins the scan data (compressed pixels) of all bands, with a restart marker between bands. The header of
/// the joined file is the header of the first band, with the height of the whole picture.
fn join(bands: &[Vec<u8>], height: u32, blocks: usize) -> Option<Vec<u8>> {
    let first = bands.first()?;
    let scan = segment(first, START_OF_SCAN)?;
    let mut file = first[..scan].to_vec();
    // In the segment with the marker `START_OF_FRAME`, the height follows the marker (2 bytes), the segment's
    // length (2 bytes) and the precision (1 byte).
    let of_height = segment(first, START_OF_FRAME)? + 5;
    file.get_mut(of_height..of_height + 2)?.copy_from_slice(&u16::try_from(height).ok()?.to_be_bytes());
    let [high, low] = u16::try_from(blocks).ok()?.to_be_bytes();
    file.extend([MARKER, RESTART_INTERVAL, 0, 4, high, low]);
    let scan_bytes = 2 + usize::from(u16::from_be_bytes(first.get(scan + 2..scan + 4)?.try_into().ok()?));
    file.extend(first.get(scan..scan + scan_bytes)?);
    for (number, band) in bands.iter().enumerate() {
        if number > 0 {
            file.extend([MARKER, FIRST_RESTART + ((number - 1) % RESTARTS) as u8]);
        }
        let begin = segment(band, START_OF_SCAN)? + scan_bytes;
        file.extend(band.get(begin..)?.strip_suffix(&END_OF_IMAGE)?);
    }
    file.extend(END_OF_IMAGE);
    Some(file)
}

/// Returns the offset of the header's first segment with the marker `wanted`; `None` if the header has no
/// such segment.
fn segment(file: &[u8], wanted: u8) -> Option<usize> {
    let mut at = 2;
    loop {
        let [marker, kind, high, low] = *file.get(at..at + 4)?.first_chunk::<4>()?;
        match (marker, kind) {
            (MARKER, kind) if kind == wanted => return Some(at),
            (MARKER, kind) if kind != START_OF_SCAN => at += 2 + usize::from(u16::from_be_bytes([high, low])),
            _ => return None,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32) -> RgbImage {
        let mut seed = 7_u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 27) as u8
        };
        RgbImage::from_fn(width, height, |x, y| {
            image::Rgb([(x / 3) as u8 ^ noise(), (y / 2) as u8, (x + y) as u8 | noise()])
        })
    }

    fn decoded(file: &[u8]) -> RgbImage {
        image::load_from_memory_with_format(file, image::ImageFormat::Jpeg).unwrap().to_rgb8()
    }

    #[test]
    fn bands_show_what_the_whole_shows() {
        // The five pictures have, in this order: one band of rows; a band and a single row; only whole bands;
        // more bands than the eight different restart markers; a width that is not a multiple of 8.
        for (width, height) in [(40, 30), (40, 129), (64, 256), (33, 128 * 11 + 5), (9, 1)] {
            let picture = picture(width, height);
            let (bands, whole) = (encode(&picture, 95).unwrap(), band(picture.as_raw(), width, 95).unwrap());
            assert_eq!(decoded(&bands), decoded(&whole), "{width} x {height}");
        }
    }

    #[test]
    fn rows_that_come_one_after_another_make_the_same_file() {
        for (width, height) in [(40, 30), (40, 129), (33, 128 * 11 + 5)] {
            let picture = picture(width, height);
            let mut encoding = Encoding::new([width, height], 95);
            let together = 3 * width as usize * encoding.rows_together();
            picture.as_raw().chunks(2 * together).for_each(|rows| encoding.take(rows));
            assert!(encoding.finish().unwrap() == encode(&picture, 95).unwrap(), "{width} x {height}");
        }
    }

    #[test]
    fn restart_markers_are_numbered_from_0_to_7_again_and_again() {
        // The test's picture has eleven bands, and therefore ten restart markers.
        let file = encode(&picture(40, 128 * 10 + 1), 95).unwrap();
        let scan = segment(&file, START_OF_SCAN).unwrap();
        let restart = |pair: &[u8]| match pair {
            [MARKER, kind @ FIRST_RESTART..=0xd7] => Some(kind - FIRST_RESTART),
            _ => None,
        };
        let numbers: Vec<u8> = file[scan..].windows(2).filter_map(restart).collect();
        assert_eq!(numbers, [0, 1, 2, 3, 4, 5, 6, 7, 0, 1]);
    }

    #[test]
    fn a_wide_picture_has_as_many_blocks_between_markers_as_their_number_can_say() {
        let picture = picture(40_000, 130);
        let file = encode(&picture, 95).unwrap();
        assert_eq!(decoded(&file), decoded(&band(picture.as_raw(), 40_000, 95).unwrap()));
        let interval = segment(&file, RESTART_INTERVAL).unwrap() + 4;
        assert_eq!(file[interval..interval + 2], (5_000_u16 * 13).to_be_bytes());
    }

    /// Threads may finish bands in any order.
    #[test]
    fn bands_are_joined_in_the_order_of_their_numbers() {
        let picture = picture(40, 300);
        let encoding = Encoding::new([40, 300], 95);
        let bands: Vec<&[u8]> = picture.as_raw().chunks(encoding.cut.band_bytes()).collect();
        assert_eq!(bands.len(), 3);
        for number in [2, 0, 1] {
            encoding.done.0.send((number, band(bands[number], 40, 95))).unwrap();
        }
        assert!(encoding.finish().unwrap() == encode(&picture, 95).unwrap());
    }
}
