//! Encodes pictures as files. Every encoded file contains the [mark] by which raycl recognises its own files.

use super::display::to_rgba8;
use super::{Radiance, jpeg, to_rgb8};
use crate::output::mark::{self, Insert};
use crate::scene::Display;
use exr::prelude::{
    Blocks, Compression, Encoding, Image, LineOrder, SpecificChannels, Text, Vec2, WritableImage as _,
};
use image::codecs::hdr::HdrEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder as _, ImageResult, RgbImage};
use png::{BitDepth, ColorType, Filter};
use std::fs::File;
use std::io::{BufWriter, Error, Result, Write};

/// The JPEG quality of the figures in the student paper that raycl reproduces.
pub const JPEG_QUALITY: u8 = 95;
/// Length of the first two segments of a JPEG file: the start marker and JFIF's header. raycl inserts the
/// comment with its mark after these two segments.
const JPEG_BEGIN_BYTES: usize = 20;
/// The first line of an HDR file.
const HDR_SIGNATURE: &str = "#?RADIANCE\n";

/// Writes a PNG with fast settings, since saving is part of a render's time.
pub fn png(picture: &RgbImage, file: &mut File) -> Result<()> {
    png_with((picture, picture.dimensions(), ColorType::Rgb), mark::png(), file)
}

/// Writes an image as PNG, with an alpha channel if the background is transparent.
pub fn shown_png(image: &Radiance, display: Display, file: &mut File) -> Result<()> {
    match to_rgba8(image, display) {
        Some(picture) => png_with((&picture, picture.dimensions(), ColorType::Rgba), mark::png(), file),
        None => png(&to_rgb8(image, display), file),
    }
}

/// Writes one of several frames as PNG. The PNG contains the frame's key after the mark by which raycl recognises its
/// own files.
pub fn frame_png(picture: &DynamicImage, key: &str, file: &mut File) -> Result<()> {
    let size = (picture.width(), picture.height());
    let colour = if picture.has_alpha() { ColorType::Rgba } else { ColorType::Rgb };
    png_with((picture.as_bytes(), size, colour), mark::keyed_png(key), file)
}

/// Writes the bytes of a PNG that is already encoded, with raycl's mark inserted.
pub fn png_of(encoded: &[u8], file: &mut File) -> Result<()> {
    encode(file, mark::png(), |writer| Ok(writer.write_all(encoded)?))
}

/// Returns an encoder of a PNG with 8 bits per channel, with settings that make encoding fast.
pub fn png_encoder<W: Write>(
    to: W,
    (width, height): (u32, u32),
    colour: ColorType,
) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(to, width, height);
    encoder.set_color(colour);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(Filter::Paeth);
    encoder
}

type Bytes<'a> = (&'a [u8], (u32, u32), ColorType);

fn png_with((bytes, size, colour): Bytes<'_>, piece: (usize, Vec<u8>), file: &mut File) -> Result<()> {
    encode(file, piece, |writer| {
        let mut writer = png_encoder(writer, size, colour).write_header().map_err(Error::other)?;
        writer.write_image_data(bytes).map_err(Error::other)?;
        Ok(writer.finish().map_err(Error::other)?)
    })
}

pub fn jpeg(picture: &RgbImage, file: &mut File) -> Result<()> {
    jpeg_of(&jpeg::encode(picture, JPEG_QUALITY).map_err(Error::other)?, file)
}

/// Writes the bytes of a JPEG that is already encoded, with raycl's mark inserted as a comment.
pub fn jpeg_of(encoded: &[u8], file: &mut File) -> Result<()> {
    let text = mark::blank();
    let length = (text.len() as u16 + 2).to_be_bytes();
    let comment = [b"\xff\xfe", &length[..], text.as_bytes()].concat();
    encode(file, (JPEG_BEGIN_BYTES, comment), |writer| Ok(writer.write_all(encoded)?))
}

pub fn hdr(image: &Radiance, file: &mut File) -> Result<()> {
    let comment = format!("# {}\n", mark::blank()).into_bytes();
    let values = image.pixels.iter().flat_map(|pixel| in_steps(*pixel));
    let bytes: Vec<u8> = values.flat_map(f32::to_ne_bytes).collect();
    encode(file, (HDR_SIGNATURE.len(), comment), |writer| {
        HdrEncoder::new(writer).write_image(&bytes, image.width, image.height, ExtendedColorType::Rgb32F)
    })
}

/// Rounds a pixel to the nearest values that an HDR file can hold: multiples of a step, with whole factors from
/// 0 to 255. (The encoder turns negative multiples into 0.) All channels of a pixel share one step, a power of
/// two that follows from the largest channel. Without this rounding, pictures would become darker, since
/// the encoder itself rounds down to multiples of the step. If all channels of a pixel are below the smallest normal
/// f32, the pixel becomes black, since this function computes the step from the bits of a normal f32.
fn in_steps(pixel: [f32; 3]) -> [f32; 3] {
    let most = pixel.into_iter().fold(0.0, f32::max);
    if most < f32::MIN_POSITIVE {
        return [0.0; 3];
    }
    // The HDR format cannot hold half of `f32::MAX` or more. Rounding up could exceed this limit, so pixels near
    // the limit stay unchanged.
    if most > f32::MAX / 4.0 {
        return pixel;
    }
    // Clearing the mantissa bits of a float gives the largest power of two that is not larger than the float.
    let step = f32::from_bits(most.to_bits() & f32::INFINITY.to_bits()) / 128.0;
    let step = if (most / step).round() > 255.0 { 2.0 * step } else { step };
    pixel.map(|value| (value / step).round() * step)
}

/// The encoding of an EXR: fast compression without loss, line by line. The EXR stores lines instead of
/// tiles, because simple readers of EXR files cannot read tiles.
const LINES: Encoding =
    Encoding { compression: Compression::RLE, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };

/// Writes an EXR. If the background is transparent, the EXR has an alpha channel, and its colours are
/// multiplied by alpha, as the EXR format requires. An EXR file contains offsets of its blocks, so raycl
/// cannot insert its mark into the finished file. raycl therefore writes the mark as the EXR's attribute for
/// comments.
pub fn exr(image: &Radiance, file: &mut File) -> Result<()> {
    let width = image.width as usize;
    let size = (width, image.height as usize);
    let pixel = |Vec2(x, y): Vec2<usize>| <(f32, f32, f32)>::from(image.pixels[y * width + x]);
    let with_alpha = |Vec2(x, y): Vec2<usize>| {
        let [red, green, blue] = image.pixels[y * width + x];
        (red, green, blue, image.coverage[y * width + x])
    };
    let mark = Some(Text::from(mark::blank().as_str()));
    let mut writer = BufWriter::new(file);
    let written = if image.coverage.is_empty() {
        let mut exr = Image::from_channels(size, SpecificChannels::rgb(pixel));
        exr.layer_data.encoding = LINES;
        exr.layer_data.attributes.comments = mark;
        exr.write().to_buffered(&mut writer)
    } else {
        let mut exr = Image::from_channels(size, SpecificChannels::rgba(with_alpha));
        exr.layer_data.encoding = LINES;
        exr.layer_data.attributes.comments = mark;
        exr.write().to_buffered(&mut writer)
    };
    written.map_err(Error::other)?;
    writer.flush()
}

/// Writes the output of `write` to the file. `piece` consists of an offset in the output of `write`, and the
/// bytes that are inserted at this offset.
fn encode(
    file: &mut File,
    piece: (usize, Vec<u8>),
    write: impl FnOnce(&mut Insert<BufWriter<&mut File>>) -> ImageResult<()>,
) -> Result<()> {
    let mut writer = Insert::new(BufWriter::new(file), piece);
    write(&mut writer).map_err(Error::other)?;
    writer.flush()
}
