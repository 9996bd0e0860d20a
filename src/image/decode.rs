//! Opens the bytes of picture files for decoding. With [`picture_reader`], raycl opens the pictures that a user or a
//! folder of results names, except the sky's pictures (HDR and EXR files that `scene::sky` opens). The function
//! refuses three kinds of files that the decoders of the crate `image` would not refuse.

use super::jpeg::{END_OF_IMAGE, MARKER, START_OF_SCAN};
use super::png_chunks::png_chunks;
use image::codecs::png::PngDecoder;
use image::{ImageError, ImageFormat, ImageReader};
use std::io::{Cursor, ErrorKind};

/// The second byte of the marker of a segment in which Adobe's programs state how a JPEG stores its colours.
const APP14: u8 = 0xee;
/// The message about a picture file whose last bytes are missing.
const CUT_OFF: &str = "the file ends before the picture is complete";

/// Returns a reader of a picture. The picture's first bytes show the format. If the first bytes fit no known
/// format, the reader uses `by_name`, the format that the file's name suggests.
///
/// # Errors
///
/// Fails if neither the bytes nor the file's name show the format, or if the file is damaged or unclear in a way
/// that the decoder would not report. The error's text says why the picture cannot be decoded.
pub fn picture_reader(
    bytes: &[u8],
    by_name: Option<ImageFormat>,
) -> Result<ImageReader<Cursor<&[u8]>>, String> {
    let shown = image::guess_format(bytes).ok();
    match shown {
        Some(ImageFormat::Png) => check_palette(bytes)?,
        Some(ImageFormat::Jpeg) if !has_end(bytes) => {
            return Err(CUT_OFF.to_owned());
        }
        Some(ImageFormat::Jpeg) => check_channels(bytes)?,
        _ => {}
    }
    let format = shown.or(by_name).ok_or("its first bytes are those of no known format")?;
    Ok(ImageReader::with_format(Cursor::new(bytes), format))
}

/// Returns true if a picture is an animated PNG. The reader that [`picture_reader`] returns decodes only one picture of
/// an animated PNG. Call this function only after [`picture_reader`], which refuses files at which the decoder panics.
pub fn is_animated(bytes: &[u8]) -> bool {
    let decoder = PngDecoder::new(Cursor::new(bytes));
    decoder.and_then(|decoder| decoder.is_apng()).unwrap_or(false)
}

/// Returns a decoder's message as a part of a sentence: in one line, without a full stop. The crate `png`
/// names a chunk in the form of Rust's debug output; the returned text has only the chunk's type. For a file
/// that is cut off, several decoders report only that reading has failed; the returned text says that the
/// file is cut off.
pub fn decoder_message(error: ImageError) -> String {
    if matches!(&error, ImageError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof) {
        return CUT_OFF.to_owned();
    }
    let text = error.to_string();
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let line = with_plain_chunk(&line).unwrap_or(line);
    line.trim_end_matches(['.', ':']).to_owned()
}

/// Replaces `ChunkType { type: IDAT, critical: true, .. }` by `IDAT`.
fn with_plain_chunk(line: &str) -> Option<String> {
    let (before, rest) = line.split_once("ChunkType { type: ")?;
    let (kind, rest) = rest.split_once(", critical: ")?;
    let (_, after) = rest.split_once(" }")?;
    Some(format!("{before}{kind}{after}"))
}

/// Returns an error if the palette of a PNG ends within a colour. The crate `png` 0.18.1 panics if a palette
/// ends within a colour.
fn check_palette(bytes: &[u8]) -> Result<(), String> {
    let odd = png_chunks(bytes).find(|(kind, length, _)| *kind == b"PLTE" && !length.is_multiple_of(3));
    odd.map_or(Ok(()), |(_, length, _)| {
        Err(format!("its palette has {length} bytes; expected a multiple of 3"))
    })
}

/// Returns an error if a JPEG has four channels (CMYK), but no Adobe marker. Programs disagree about whether the
/// values of such a picture are inverted.
fn check_channels(bytes: &[u8]) -> Result<(), String> {
    let is_frame = |kind: u8| matches!(kind, 0xc0..=0xcf) && !matches!(kind, 0xc4 | 0xc8 | 0xcc);
    let mut segments = header_segments(bytes);
    let has_four = |(kind, data): (u8, &[u8])| is_frame(kind) && data.get(5) == Some(&4);
    let is_adobe = |(kind, data): (u8, &[u8])| kind == APP14 && data.starts_with(b"Adobe");
    if !segments.any(has_four) || header_segments(bytes).any(is_adobe) {
        return Ok(());
    }
    Err("it has four channels (CMYK), but no Adobe marker".to_owned())
}

/// Returns the segments (blocks) of a JPEG before its first scan: for each, the second byte of its marker and its data.
fn header_segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let header = segments(bytes).take_while(|(kind, ..)| *kind != START_OF_SCAN);
    header.map(|(kind, data, _)| (kind, data))
}

/// Returns the segments of a JPEG up to the header of its first scan: for each, the second byte of its marker, its
/// data, and the bytes of the file after the segment.
pub(super) fn segments(bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8], &[u8])> {
    segments_of(bytes.get(2..).unwrap_or_default())
}

/// Returns the segments of a JPEG at the beginning of `rest`, up to the header of the next scan.
pub(super) fn segments_of(mut rest: &[u8]) -> impl Iterator<Item = (u8, &[u8], &[u8])> {
    std::iter::from_fn(move || {
        while let [MARKER, MARKER, ..] = rest {
            rest = &rest[1..];
        }
        let [MARKER, kind, high, low, ..] = *rest else { return None };
        let end = 2 + usize::from(u16::from_be_bytes([high, low]));
        let data = rest.get(4..end)?;
        rest = &rest[end..];
        Some((kind, data, rest))
    })
}

/// Returns true if a JPEG has a marker for the end of the picture after a scan. If the end of a file is missing, the
/// decoder reports no error, and the missing part of the picture becomes grey. The markers of a preview picture in the
/// header do not count: they lie in a segment (a block of the header that begins with its length), and this function
/// skips segments.
fn has_end(bytes: &[u8]) -> bool {
    let (mut rest, mut has_scan) = (bytes, false);
    while let Some(at) = rest.iter().position(|&byte| byte == MARKER) {
        rest = &rest[at + 1..];
        match *rest {
            [kind, ..] if has_scan && [MARKER, kind] == END_OF_IMAGE => return true,
            // The byte after 0xff shows what the two bytes are: 0 means a byte 0xff of a scan, 0xff means
            // padding before a marker, and 1 or 0xd0 to 0xd9 means a marker without a segment.
            [0 | 1 | 0xd0..=0xd9 | MARKER, ..] => {}
            [kind, high, low, ..] => {
                has_scan |= kind == START_OF_SCAN;
                let length = usize::from(u16::from_be_bytes([high, low]));
                rest = rest.get(1 + length..).unwrap_or_default();
            }
            _ => return false,
        }
    }
    false
}

/// A damaged PNG of one pixel: the palette has four bytes, which is not a multiple of three.
#[cfg(test)]
pub const ODD_PALETTE: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01\0\0\0\x01\x08\x03\0\0\0(\xcb4\xbb\
    \0\0\0\x04PLTE\x01\x02\x03\x04#\xdb\x8a\xab\0\0\0\x0aIDATx\x9cc`\0\0\0\x02\0\x01H\xaf\xa4q\
    \0\0\0\0IEND\xaeB`\x82";

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use image::error::DecodingError;
    use image::{Rgb, RgbImage};

    fn picture(width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |x, y| Rgb([(x * 7) as u8, (y * 5) as u8, (x * y) as u8]))
    }

    fn jpeg(width: u32, height: u32) -> Vec<u8> {
        super::super::jpeg::encode(&picture(width, height), 95).unwrap()
    }

    /// Returns the reason why `picture_reader` refuses a picture, or an empty text if it opens the picture.
    fn refusal(bytes: &[u8]) -> String {
        picture_reader(bytes, None).err().unwrap_or_default()
    }

    #[test]
    fn a_palette_that_ends_within_a_colour_is_refused() {
        assert_eq!(refusal(ODD_PALETTE), "its palette has 4 bytes; expected a multiple of 3");
        let mut whole = ODD_PALETTE.to_vec();
        let palette = whole.windows(4).position(|bytes| bytes == b"PLTE").unwrap();
        whole.remove(palette + 4);
        whole[palette - 1] = 3;
        assert_eq!(refusal(&whole), "");
        assert_eq!(refusal(&ODD_PALETTE[..palette - 2]), "", "the decoder refuses what is cut off");
    }

    #[test]
    fn a_jpeg_without_its_end_is_refused() {
        // The second JPEG consists of several bands, with restart markers between the bands.
        for whole in [jpeg(40, 30), jpeg(24, 400)] {
            assert_eq!(refusal(&whole), "");
            assert!(picture_reader(&whole, None).unwrap().decode().is_ok());
            assert_eq!(refusal(&[&whole[..], b"bytes after the picture"].concat()), "");
            let (scan, end) = whole.split_at(whole.len() - 2);
            assert_eq!(refusal(&[scan, &[MARKER], end].concat()), "", "a byte that fills space");
            for end in [3, whole.len() / 2, whole.len() - 1] {
                assert_eq!(refusal(&whole[..end]), "the file ends before the picture is complete", "{end}");
            }
        }
    }

    #[test]
    fn a_jpeg_of_four_channels_needs_an_adobe_marker() {
        let frame = [MARKER, 0xc0, 0, 20, 8, 0, 1, 0, 1, 4, 1, 17, 0, 2, 17, 0, 3, 17, 0, 4, 17, 0];
        let adobe = [&[MARKER, APP14, 0, 14], &b"Adobe\0\x64\0\0\0\0\0"[..]].concat();
        let scan = [MARKER, START_OF_SCAN, 0, 2, MARKER, 0xd9];
        let picture = |segments: &[&[u8]]| [&[MARKER, 0xd8], &segments.concat()[..], &scan].concat();
        let refused = "it has four channels (CMYK), but no Adobe marker";
        assert_eq!(refusal(&picture(&[&frame])), refused);
        assert_eq!(refusal(&picture(&[&[MARKER], &frame])), refused, "a byte that fills space");
        assert_eq!(refusal(&picture(&[&adobe, &frame])), "");
        assert_eq!(refusal(&picture(&[&frame, &adobe])), "");
    }

    #[test]
    fn the_end_of_a_preview_is_not_the_end_of_the_picture() {
        let (preview, whole) = (jpeg(8, 8), jpeg(40, 30));
        let length = u16::try_from(preview.len() + 2).unwrap().to_be_bytes();
        let header = [&whole[..2], &[MARKER, 0xe1], &length, &preview].concat();
        let with_preview = [&header[..], &whole[2..]].concat();
        assert_eq!(refusal(&with_preview), "");
        assert_ne!(refusal(&with_preview[..with_preview.len() - 2]), "");
        assert_ne!(refusal(&header), "");
    }

    #[test]
    fn bytes_of_no_format_have_the_format_that_the_name_suggests() {
        assert_eq!(refusal(b"nothing"), "its first bytes are those of no known format");
        let reader = picture_reader(b"nothing", Some(ImageFormat::Tga)).unwrap();
        assert_eq!(reader.format(), Some(ImageFormat::Tga));
        // `picture_reader` looks for the end of the picture only in a file whose bytes show that it is a
        // JPEG, not in a file that only has a JPEG's name.
        assert!(picture_reader(b"nothing", Some(ImageFormat::Jpeg)).is_ok());
    }

    #[test]
    fn a_decoders_message_is_one_line_without_debug_output() {
        let end_first = b"\x89PNG\r\n\x1a\n\0\0\0\0IEND\xaeB`\x82";
        let error = picture_reader(end_first, None).unwrap().decode().unwrap_err();
        assert!(error.to_string().contains("{ type:"), "{error}");
        let message = "Format error decoding Png: IEND chunk appeared before IHDR chunk";
        assert_eq!(decoder_message(error), message);
        let of_lines = DecodingError::new(ImageFormat::Bmp.into(), "two lines:\n\tthe end.");
        let message = "Format error decoding Bmp: two lines: the end";
        assert_eq!(decoder_message(ImageError::Decoding(of_lines)), message);
    }

    #[test]
    fn the_first_bytes_count_before_the_name() {
        let bytes = jpeg(8, 8);
        let reader = picture_reader(&bytes, Some(ImageFormat::Png)).unwrap();
        assert_eq!(reader.format(), Some(ImageFormat::Jpeg));
    }
}
