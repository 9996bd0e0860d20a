//! Reads textures from picture files.

use crate::memory::Available;
use crate::reader::{self, Kind};
use crate::scene::obj::Reach;
use crate::scene::{Texture, Wrap};
use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use std::collections::HashMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest width and height of a texture in texels.
const MOST_ACROSS: u32 = 1 << 14;
/// Largest number of texels of all textures of a mesh: 1 GiB.
const MOST_TEXELS: usize = 1 << 28;
/// Largest memory for decoding a picture: texels with 16 bits per channel.
const DECODING_BYTES: u64 = 8 * (MOST_ACROSS as u64) * (MOST_ACROSS as u64);
/// Formats that are recognised by a file's first bytes. TGA is recognised by the file's extension.
const FORMATS: [ImageFormat; 4] = [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::Tga];

/// An error about a picture, in words that follow the picture's name.
type Parsed<T> = std::result::Result<T, String>;

/// A picture's texels.
type Decoded = ([u32; 2], Arc<[u32]>);

/// The textures of a mesh; each picture is decoded once.
#[derive(Default)]
pub(in crate::scene) struct Pictures {
    pub list: Vec<Texture>,
    files: HashMap<PathBuf, Parsed<Decoded>>,
    known: HashMap<(PathBuf, [Wrap; 2]), u32>,
    texels: usize,
}

impl Pictures {
    /// Returns the number of the texture from a file.
    pub fn file(&mut self, reach: Reach<'_>, name: &str, wrap: [Wrap; 2]) -> Parsed<u32> {
        let path = reach.locate(name)?;
        if let Some(number) = self.known.get(&(path.clone(), wrap)) {
            return Ok(*number);
        }
        let read = || -> Parsed<Decoded> {
            let bytes =
                reader::bytes(&path, Kind::Texture).map_err(|error| format!("cannot be read ({error})"))?;
            decoded(&bytes, ImageFormat::from_path(&path).ok())
        };
        let picture = self.files.entry(path.clone()).or_insert_with(read).clone()?;
        let number = self.add(picture, wrap)?;
        self.known.insert((path, wrap), number);
        Ok(number)
    }

    /// Returns the number of the texture from a picture's bytes; `key` identifies the picture within the mesh
    /// file.
    pub fn bytes(&mut self, key: &str, bytes: &[u8], wrap: [Wrap; 2]) -> Parsed<u32> {
        // Resolved paths are never relative, so they cannot equal this key.
        let key = (Path::new("in the file").join(key), wrap);
        if let Some(number) = self.known.get(&key) {
            return Ok(*number);
        }
        let number = self.add(decoded(bytes, None)?, wrap)?;
        self.known.insert(key, number);
        Ok(number)
    }

    fn add(&mut self, (size, texels): Decoded, wrap: [Wrap; 2]) -> Parsed<u32> {
        self.texels += texels.len();
        if self.texels > MOST_TEXELS {
            self.texels -= texels.len();
            return Err(format!("is too much: all textures have at most {MOST_TEXELS} texels"));
        }
        self.list.push(Texture { size, wrap, texels });
        Ok(self.list.len() as u32 - 1)
    }
}

/// Decodes a picture.
fn decoded(bytes: &[u8], ending: Option<ImageFormat>) -> Parsed<Decoded> {
    let ending = ending.filter(|format| *format == ImageFormat::Tga);
    let format = image::guess_format(bytes).ok().or(ending);
    let format = format.filter(|format| FORMATS.contains(format));
    let format = format.ok_or("is not a PNG, JPEG, BMP or TGA")?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let damaged = |error: image::ImageError| format!("cannot be decoded ({error})");
    let size = ImageReader::with_format(Cursor::new(bytes), format).into_dimensions().map_err(damaged)?;
    let (width, height) = size;
    if width == 0 || height == 0 || width.max(height) > MOST_ACROSS {
        return Err(format!("has {width} x {height} texels; expected 1 to {MOST_ACROSS} each way"));
    }
    // Needed twice: as decoded, and as stored.
    let needed = 8 * u64::from(width) * u64::from(height);
    let sum = format!("8 B x {width} x {height} texels");
    Available::read()
        .hold(2 * needed, "decoding it", &sum)
        .map_err(|error| format!("is too large ({error})"))?;
    let mut limits = Limits::no_limits();
    limits.max_image_width = Some(MOST_ACROSS);
    limits.max_image_height = Some(MOST_ACROSS);
    limits.max_alloc = Some(DECODING_BYTES);
    reader.limits(limits);
    let picture = reader.decode().map_err(damaged)?;
    Ok(([width, height], words(&picture)))
}

fn words(picture: &DynamicImage) -> Arc<[u32]> {
    picture.to_rgba8().pixels().map(|pixel| u32::from_le_bytes(pixel.0)).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::obj::Permitted;

    fn png(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let picture =
            image::RgbaImage::from_fn(width, height, |x, y| image::Rgba([x as u8, y as u8, 7, 255]));
        picture.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
        bytes
    }

    #[test]
    fn a_picture_is_decoded_once_however_often_it_is_named() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.png"), png(3, 2)).unwrap();
        let reach = Reach { folder: folder.path(), permitted: Permitted { beyond: false, quotes: true } };
        let mut pictures = Pictures::default();
        let [repeat, clamp] = [Wrap::Repeat, Wrap::Clamp].map(|wrap| [wrap; 2]);
        assert_eq!(pictures.file(reach, "a.png", repeat), Ok(0));
        assert_eq!(pictures.file(reach, "./a.png", repeat), Ok(0));
        assert_eq!(pictures.file(reach, "a.png", clamp), Ok(1));
        assert_eq!(pictures.list[0].size, [3, 2]);
        assert_eq!(pictures.list[0].texels[4], 0xff07_0101);
        assert!(Arc::ptr_eq(&pictures.list[0].texels, &pictures.list[1].texels));
    }

    #[test]
    fn what_is_no_picture_or_too_large_is_refused() {
        assert!(decoded(b"nothing", None).unwrap_err().contains("not a PNG"));
        assert!(decoded(&png(2, 2)[..20], None).unwrap_err().contains("cannot be decoded"));
        let mut huge = png(2, 2);
        // The width in the header.
        huge[16..20].copy_from_slice(&40_000_u32.to_be_bytes());
        assert!(decoded(&huge, None).is_err());
        assert!(decoded(b"#?RADIANCE\n", None).unwrap_err().contains("not a PNG"));
    }
}
