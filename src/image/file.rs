//! Pictures as files, whole or not at all.

use super::{Radiance, to_rgb8};
use crate::error::{Error, Result, nearest};
use crate::record::temporary_in;
use crate::scene::Display;
use image::codecs::hdr::HdrEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::openexr::OpenExrEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageResult, RgbImage};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use tempfile::NamedTempFile;

/// The paper's, for its figures.
const JPEG_QUALITY: u8 = 95;

/// A file format, known by its extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Png,
    Jpeg,
    Exr,
    Hdr,
}

/// Every extension, in any case.
const EXTENSIONS: [(&str, Format); 5] = [
    ("png", Format::Png),
    ("jpg", Format::Jpeg),
    ("jpeg", Format::Jpeg),
    ("exr", Format::Exr),
    ("hdr", Format::Hdr),
];

/// Writes an image as its file's extension says: PNG and JPEG (quality 95) as `display` shows it,
/// EXR and HDR as linear radiance. The file is written whole or not at all.
///
/// An extension that is none of these, or a folder that is not there, is the user's mistake; a file
/// that cannot be written is a failed run.
pub fn save(image: &Radiance, display: Display, path: &Path) -> Result<()> {
    let format = format(path)?;
    replace(path, |file| match format {
        Format::Png => write_png(&to_rgb8(image, display), file),
        Format::Jpeg => {
            JpegEncoder::new_with_quality(file, JPEG_QUALITY).encode_image(&to_rgb8(image, display))
        }
        Format::Exr => write_linear(image, OpenExrEncoder::new(file)),
        Format::Hdr => write_linear(image, HdrEncoder::new(file)),
    })
}

/// Finds out before any work is done whether [`save`] would refuse `path`: by its extension, or for want
/// of its folder.
pub fn check_path(path: &Path) -> Result<()> {
    format(path)?;
    folder_of(path).map(|_| ())
}

/// Reads a picture: 8-bit formats as parts of white (0 to 1, as displayed), EXR and HDR as linear radiance.
///
/// A file that is not there or is no picture is the user's mistake.
pub fn read_picture(path: &Path) -> Result<Radiance> {
    let unreadable = |why: &dyn std::fmt::Display| {
        Error::input(format!("cannot read the picture '{}': {why}", path.display()))
            .with_help("pictures are .png, .jpg, .exr or .hdr")
    };
    let reader = image::ImageReader::open(path).map_err(|error| unreadable(&error))?;
    let reader = reader.with_guessed_format().map_err(|error| unreadable(&error))?;
    let picture = reader.decode().map_err(|error| unreadable(&error))?.into_rgb32f();
    let (width, height) = picture.dimensions();
    Ok(Radiance { width, height, pixels: picture.pixels().map(|pixel| pixel.0).collect() })
}

/// Writes an 8-bit picture as PNG, whole or not at all.
pub fn save_rgb8(picture: &RgbImage, path: &Path) -> Result<()> {
    replace(path, |file| write_png(picture, file))
}

fn format(path: &Path) -> Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let known = EXTENSIONS.iter().find(|(name, _)| *name == extension).map(|(_, format)| *format);
    known.ok_or_else(|| {
        let names = EXTENSIONS.map(|(name, _)| name);
        let choices = names.map(|name| format!(".{name}")).join(", ");
        let error = Error::input(format!(
            "cannot tell from '{}' what kind of picture to write: its name must end in one of {choices}",
            path.display()
        ));
        match nearest(&extension, names) {
            Some(meant) => {
                error.with_help(format!("did you mean '{}'?", path.with_extension(meant).display()))
            }
            None => error,
        }
    })
}

/// Fast settings, since saving counts in a render's time: 4 ms for 1920 x 1080 pixels.
fn write_png(picture: &RgbImage, file: impl Write) -> ImageResult<()> {
    let encoder = PngEncoder::new_with_quality(file, CompressionType::Fast, FilterType::Adaptive);
    encoder.write_image(picture, picture.width(), picture.height(), ExtendedColorType::Rgb8)
}

fn write_linear(image: &Radiance, encoder: impl ImageEncoder) -> ImageResult<()> {
    let bytes: Vec<u8> = image.pixels.as_flattened().iter().flat_map(|value| value.to_ne_bytes()).collect();
    encoder.write_image(&bytes, image.width, image.height, ExtendedColorType::Rgb32F)
}

/// Writes a file beside `path`, then puts it in its place.
fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<&mut File>) -> ImageResult<()>) -> Result<()> {
    let failed =
        |why: &dyn std::fmt::Display| Error::run(format!("cannot write '{}': {why}", path.display()));
    let mut temporary = temporary_beside(path)?;
    let mut writer = BufWriter::new(temporary.as_file_mut());
    write(&mut writer).map_err(|error| failed(&error))?;
    writer.flush().map_err(|error| failed(&error))?;
    drop(writer);
    temporary.persist(path).map_err(|error| failed(&error.error))?;
    Ok(())
}

/// The folder a file is to lie in, which must be there.
fn folder_of(path: &Path) -> Result<&Path> {
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    if folder.is_dir() {
        return Ok(folder);
    }
    let message = format!("cannot write '{}': there is no folder '{}'", path.display(), folder.display());
    Err(Error::input(message).with_help(format!("make it first: mkdir -p '{}'", folder.display())))
}

fn temporary_beside(path: &Path) -> Result<NamedTempFile> {
    temporary_in(folder_of(path)?)
        .map_err(|error| Error::run(format!("cannot write '{}': {error}", path.display())))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn gradient(width: u32, height: u32) -> Radiance {
        let pixel = |i| {
            [(i % width) as f32 / width as f32, (i / width) as f32 / height as f32, 0.01].map(|c| c * 0.06)
        };
        Radiance { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    fn saved(name: &str, image: &Radiance) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        save(image, Display::default(), &path).unwrap();
        (folder, path)
    }

    #[test]
    fn png_keeps_every_byte() {
        let image = gradient(61, 37);
        let (_folder, path) = saved("picture.PNG", &image);
        assert_eq!(image::open(path).unwrap().to_rgb8(), to_rgb8(&image, Display::default()));
    }

    #[test]
    fn exr_keeps_every_float() {
        let image = gradient(61, 37);
        let (_folder, path) = saved("picture.exr", &image);
        assert_eq!(image::open(path).unwrap().to_rgb32f().as_raw(), image.pixels.as_flattened());
    }

    #[test]
    fn hdr_keeps_radiance_to_its_precision() {
        let image = gradient(61, 37);
        let (_folder, path) = saved("picture.hdr", &image);
        let read = image::open(path).unwrap().to_rgb32f();
        for (a, b) in read.as_raw().iter().zip(image.pixels.as_flattened()) {
            assert!((a - b).abs() < 0.06 / 128.0, "{a} {b}");
        }
    }

    #[test]
    fn jpeg_looks_the_same() {
        let image = gradient(61, 37);
        let (_folder, path) = saved("picture.jpg", &image);
        let read = image::open(path).unwrap().to_rgb8();
        assert!(super::super::psnr_db(&read, &to_rgb8(&image, Display::default())) > 35.0);
    }

    #[test]
    fn an_unknown_extension_names_the_choices_and_a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["picture.pnf", "picture"] {
            let error = save(&gradient(2, 2), Display::default(), &folder.path().join(name)).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(".png, .jpg, .jpeg, .exr, .hdr"), "{error}");
        }
        let nowhere = folder.path().join("nowhere/picture.png");
        let error = save(&gradient(2, 2), Display::default(), &nowhere).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("no folder"), "{error}");
    }

    #[test]
    fn a_failed_write_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        std::fs::create_dir(&path).unwrap(); // a folder cannot be replaced by a file
        assert_eq!(save(&gradient(2, 2), Display::default(), &path).unwrap_err().exit_code(), 1);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_picture_can_be_read_by_others_as_the_umask_says() {
        use std::os::unix::fs::PermissionsExt;
        let (folder, path) = saved("picture.png", &gradient(2, 2));
        let plain = folder.path().join("plain");
        std::fs::write(&plain, "").unwrap();
        let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(path), mode(plain));
    }
}
