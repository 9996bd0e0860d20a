//! Encodes pictures; every format has room for raycl's [mark].

use super::{Radiance, jpeg};
use crate::output::mark::{self, Insert};
use exr::prelude::{Image, SpecificChannels, Text, Vec2, WritableImage as _};
use image::codecs::hdr::HdrEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _, ImageResult, RgbImage};
use std::fs::File;
use std::io::{BufWriter, Error, Result, Write as _};

/// The quality that the paper uses for its figures.
pub const JPEG_QUALITY: u8 = 95;
/// Length of a JPEG's first two segments, the start and JFIF's header. A comment follows them.
const JPEG_BEGIN_BYTES: usize = 20;
/// The first line of an HDR file.
const HDR_SIGNATURE: &str = "#?RADIANCE\n";

/// Writes a PNG with fast settings, since saving is part of a render's time: 4 ms for 1920 x 1080 pixels.
pub fn png(picture: &RgbImage, file: &mut File) -> Result<()> {
    png_with(picture, mark::png(), file)
}

/// Writes a PNG with a key next to the mark.
pub fn keyed_png(picture: &RgbImage, key: &str, file: &mut File) -> Result<()> {
    png_with(picture, mark::keyed_png(key), file)
}

fn png_with(picture: &RgbImage, piece: (usize, Vec<u8>), file: &mut File) -> Result<()> {
    encode(file, piece, |writer| {
        let encoder = PngEncoder::new_with_quality(writer, CompressionType::Fast, FilterType::Adaptive);
        encoder.write_image(picture, picture.width(), picture.height(), ExtendedColorType::Rgb8)
    })
}

pub fn jpeg(picture: &RgbImage, file: &mut File) -> Result<()> {
    jpeg_of(&jpeg::encode(picture, JPEG_QUALITY).map_err(Error::other)?, file)
}

/// Writes a JPEG that is already encoded.
pub fn jpeg_of(encoded: &[u8], file: &mut File) -> Result<()> {
    let text = mark::blank();
    let length = (text.len() as u16 + 2).to_be_bytes();
    let comment = [b"\xff\xfe", &length[..], text.as_bytes()].concat();
    encode(file, (JPEG_BEGIN_BYTES, comment), |writer| Ok(writer.write_all(encoded)?))
}

pub fn hdr(image: &Radiance, file: &mut File) -> Result<()> {
    let comment = format!("# {}\n", mark::blank()).into_bytes();
    let bytes: Vec<u8> = image.pixels.as_flattened().iter().flat_map(|value| value.to_ne_bytes()).collect();
    encode(file, (HDR_SIGNATURE.len(), comment), |writer| {
        HdrEncoder::new(writer).write_image(&bytes, image.width, image.height, ExtendedColorType::Rgb32F)
    })
}

/// Writes an EXR. The format stores the offsets of its parts, so the mark cannot be inserted afterwards.
pub fn exr(image: &Radiance, file: &mut File) -> Result<()> {
    let width = image.width as usize;
    let pixel = |Vec2(x, y)| <(f32, f32, f32)>::from(image.pixels[y * width + x]);
    let size = (width, image.height as usize);
    let mut exr = Image::from_channels(size, SpecificChannels::rgb(pixel));
    let mark = Text::from(mark::blank().as_str());
    exr.layer_data.attributes.comments = Some(mark);
    let mut writer = BufWriter::new(file);
    exr.write().to_buffered(&mut writer).map_err(Error::other)?;
    writer.flush()
}

/// Writes the output of `write`, with `piece` inserted at this offset.
fn encode(
    file: &mut File,
    piece: (usize, Vec<u8>),
    write: impl FnOnce(&mut Insert<BufWriter<&mut File>>) -> ImageResult<()>,
) -> Result<()> {
    let mut writer = Insert::new(BufWriter::new(file), piece);
    write(&mut writer).map_err(Error::other)?;
    writer.flush()
}
