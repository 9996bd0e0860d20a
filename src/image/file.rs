//! Reads and writes picture files; a file is written completely or not at all.

use super::decode::{decoder_message, is_animated, picture_reader};
use super::encode::{exr, frame_png, hdr, jpeg, png, shown_png};
use super::hdr_header::{HdrExposure, with_usual_signature};
use super::{Frame, Radiance, to_rgb8};
use crate::error::{Error, Result, nearest};
use crate::filetype::standard_input;
use crate::memory::Available;
use crate::output::{Target, mark};
use crate::reader::{self, is_standard_input, names_a_folder};
use crate::scene::Display;
use image::{DynamicImage, ImageDecoder, ImageError, RgbImage};
use std::path::{Path, PathBuf};

/// The format of a picture file, recognised by the file's extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Png,
    Jpeg,
    Exr,
    Hdr,
}

/// All known extensions of picture files. An extension may also be written in upper case.
const EXTENSIONS: [(&str, Format); 5] = [
    ("png", Format::Png),
    ("jpg", Format::Jpeg),
    ("jpeg", Format::Jpeg),
    ("exr", Format::Exr),
    ("hdr", Format::Hdr),
];

/// The advice to a user who names a device or a pipe as the path of a picture.
const TO_STANDARD_OUTPUT: &str = "`-o -` writes a PNG to standard output";

/// The advice to a user who names an animated picture where a single picture is expected.
const NUMBERED: &str = "compare numbered pictures, which `raycl render` writes with `-o NAME.png`";

/// Bytes per pixel that reading a picture needs in addition to the decoded picture: two copies of at most
/// four floats.
const CONVERTING_BYTES: u64 = 32;

/// The largest width or height of a JPEG in pixels, which the format stores in 16 bits.
const MOST_OF_JPEG: u32 = u16::MAX as u32;

/// The only width in pixels with which raycl cannot write an HDR file. The crate `image` 0.25.10 compresses rows of
/// this width, although the format has only 15 bits for the number of pixels of a compressed row. No program could
/// read the file.
const NO_HDR_WIDTH: u32 = 1 << 15;

/// Writes an image in the format of its file's extension. PNG and JPEG (quality 95) have the values that
/// `display` shows; EXR and HDR have linear radiance. The file is written completely or not at all. A file that
/// raycl did not make, or that was changed since, is replaced only if the user allows it (`--force`).
///
/// An unknown extension, a missing folder, or a file that may not be replaced is a user error. If writing
/// fails although the user made no mistake, the error says that the run failed.
pub fn save(image: &Radiance, display: Display, target: &Target) -> Result<()> {
    let format = format_of(target)?;
    target.write(|file| match format {
        Format::Png => shown_png(image, display, file),
        Format::Jpeg => jpeg(&to_rgb8(image, display), file),
        Format::Exr => exr(image, file),
        Format::Hdr => hdr(image, file),
    })
}

/// Returns an error, before any work is done, if [`save`] would refuse a picture of this size, or would write a
/// file that no program can read. The reason can be the size, the file's extension, a folder that is missing or
/// cannot be written to, or an existing file.
pub fn check_target(target: &Target, size: [u32; 2]) -> Result<()> {
    check_size(target, size)?;
    target.check()
}

/// Returns an error if the file's format cannot hold a picture of this size.
fn check_size(target: &Target, [across, down]: [u32; 2]) -> Result<()> {
    let (why, ending) = match format_of(target)? {
        Format::Jpeg if across.max(down) > MOST_OF_JPEG => {
            (format!("a JPEG has at most {MOST_OF_JPEG} in each direction"), "png")
        }
        Format::Hdr if across == NO_HDR_WIDTH => {
            (format!("raycl cannot write an HDR with rows of {NO_HDR_WIDTH} pixels"), "exr")
        }
        _ => return Ok(()),
    };
    let (name, other) = (target.path().display(), target.path().with_extension(ending));
    let message = format!("cannot write '{name}': the picture has {across} x {down} pixels; {why}");
    Err(Error::input(message).with_help(format!("name the file '{}'", other.display())))
}

/// Returns an error if an image has no pixels, if its lists of pixels do not match its size, or if the file's
/// format cannot hold its values. An image that raycl has cast, and that no program has changed,
/// is refused only if a pixel is not finite and the file is an HDR.
pub fn check_image(image: &Radiance, target: &Target) -> Result<()> {
    let Radiance { width, height, pixels, coverage } = image;
    let refused = |why: String, remedy: &str| {
        Err(Error::input(format!("cannot write '{}': {why}", target.path().display())).with_help(remedy))
    };
    let count = u64::from(*width) * u64::from(*height);
    if count == 0 {
        let why = format!("the picture has {width} x {height} pixels; expected at least 1 in each direction");
        return refused(why, "cast a larger picture");
    }
    let coverage_fits = coverage.is_empty() || coverage.len() as u64 == count;
    if pixels.len() as u64 != count || !coverage_fits {
        let (colours, shares) = (pixels.len(), coverage.len());
        let why = format!(
            "the picture has {width} x {height} = {count} pixels, but `pixels` has {colours} elements and `coverage` has {shares}"
        );
        return refused(why, "`pixels` needs one element per pixel; `coverage` needs as many, or none");
    }
    if format_of(target)? == Format::Hdr
        && let Some(([x, y], _)) = image.not_finite()
    {
        let why = format!("the pixel in column {x} of row {y} is not finite, which an HDR cannot hold");
        return refused(why, "replace pixels that are not finite, or write an .exr file");
    }
    Ok(())
}

/// Returns an error if the file's format has no alpha channel, which a picture with a transparent background
/// needs.
pub fn check_alpha(target: &Target) -> Result<()> {
    let what = match format_of(target)? {
        Format::Png | Format::Exr => return Ok(()),
        Format::Jpeg => "a JPEG",
        Format::Hdr => "an HDR",
    };
    let name = target.path().display();
    let message =
        format!("cannot write '{name}': {what} has no alpha channel, which a transparent background needs");
    let [png, exr] = ["png", "exr"].map(|ending| target.path().with_extension(ending));
    Err(Error::input(message).with_help(format!("name the file '{}' or '{}'", png.display(), exr.display())))
}

/// Returns the format that a file's extension names. On standard output, which has no extension, the format
/// is PNG.
fn format_of(target: &Target) -> Result<Format> {
    if target.is_standard_output() {
        return Ok(Format::Png);
    }
    format(target.path()).map_err(|error| {
        if is_of_system(target.path()) { error.with_help(TO_STANDARD_OUTPUT) } else { error }
    })
}

/// Whether the channels of a picture contain displayed values or radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Displayed values from 0 to 1: the integers in the file, divided by the largest integer that fits into
    /// the file's bits per channel.
    Displayed,
    /// Linear radiance, as floating-point numbers.
    Radiance,
}

/// Reads a picture: the integers of a PNG or JPEG as displayed values from 0 to 1, the floating-point numbers
/// of an EXR or HDR as linear radiance. The returned `coverage` is the picture's alpha channel, or empty if
/// the picture is opaque. The colours of a transparent PNG are returned as in the file, not multiplied by
/// alpha. The values of an HDR are divided by the file's [`HdrExposure`].
///
/// The path `-` means standard input.
///
/// A missing file, a file that is not a picture, an animated picture, or a picture that does not fit into memory is a
/// user error.
pub fn read_picture(path: &Path) -> Result<(Radiance, Values)> {
    read_within(path, Available::read)
}

/// The remedy for a file that cannot be read as a picture.
const READABLE: &str = "raycl reads .png, .jpg, .exr and .hdr pictures";

/// Reads a picture, as [`read_picture`] does. `available` returns the memory that is free when it is called.
fn read_within(path: &Path, available: impl Fn() -> Available) -> Result<(Radiance, Values)> {
    let unreadable = |why: &dyn std::fmt::Display| {
        Error::input(format!("cannot read the picture '{}': {why}", path.display())).with_help(READABLE)
    };
    let bytes = with_usual_signature(match is_standard_input(path) {
        true => piped().map_err(|error| unreadable(&error))?,
        false => stored(path, &available())?,
    });
    if bytes.is_empty() {
        return Err(unreadable(&"it is empty"));
    }
    let exposure = HdrExposure::of(&bytes).map_err(|why| unreadable(&format!("it {why}")))?;
    let by_name = image::ImageFormat::from_path(path).ok();
    let mut picture = picture_reader(&bytes, by_name).map_err(|why| unreadable(&why))?;
    if is_animated(&bytes) {
        return Err(unreadable(&"it is an animated picture").with_help(NUMBERED));
    }
    // The limit of the crate `image`, 512 MiB by default, is switched off, since this limit does not depend
    // on the memory of this machine. Instead, `room_for` compares the picture's size with the free memory.
    picture.no_limits();
    let damaged = |error: ImageError| unreadable(&decoder_message(error));
    let decoder = picture.into_decoder().map_err(damaged)?;
    room_for(&decoder, path, &available())?;
    let picture = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    let is_radiance = matches!(picture, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let values = if is_radiance { Values::Radiance } else { Values::Displayed };
    Ok((radiance(picture, exposure), values))
}

/// Reads a picture's bytes from standard input.
fn piped() -> std::io::Result<Vec<u8>> {
    reader::within(standard_input()?, reader::Kind::Picture)
}

/// Reads the file of a picture, if it fits into the available memory.
fn stored(path: &Path, available: &Available) -> Result<Vec<u8>> {
    let unreadable = |error| Error::unreadable("picture", path, &error, READABLE);
    let file = reader::open(path).map_err(unreadable)?;
    let length = file.metadata().map_err(unreadable)?.len();
    available.hold(length, &format!("reading the picture '{}'", path.display()), "the file's length")?;
    reader::rest(file, Vec::new(), reader::Kind::Picture).map_err(unreadable)
}

/// Returns an error if a picture does not fit into the free memory.
fn room_for(decoder: &impl ImageDecoder, path: &Path, available: &Available) -> Result<()> {
    let (width, height) = decoder.dimensions();
    let per_pixel = u64::from(decoder.color_type().bytes_per_pixel()) + CONVERTING_BYTES;
    let needed = u64::from(width).saturating_mul(u64::from(height)).saturating_mul(per_pixel);
    let sum = format!("{per_pixel} B x {width} x {height} pixels");
    available.hold(needed, &format!("the picture '{}'", path.display()), &sum)
}

/// Turns a grey picture into a picture with three colour channels of the same number of bits. To convert values to
/// floats, the crate `image` divides colour values by 255 (or 65,535), but multiplies grey values by the rounded
/// reciprocal. Equal grey and colour values would therefore differ.
fn with_colour_channels(picture: DynamicImage) -> DynamicImage {
    match picture {
        DynamicImage::ImageLuma8(_) => DynamicImage::ImageRgb8(picture.into_rgb8()),
        DynamicImage::ImageLumaA8(_) => DynamicImage::ImageRgba8(picture.into_rgba8()),
        DynamicImage::ImageLuma16(_) => DynamicImage::ImageRgb16(picture.into_rgb16()),
        DynamicImage::ImageLumaA16(_) => DynamicImage::ImageRgba16(picture.into_rgba16()),
        coloured => coloured,
    }
}

fn radiance(picture: DynamicImage, exposure: HdrExposure) -> Radiance {
    let picture = with_colour_channels(picture);
    let (width, height) = (picture.width(), picture.height());
    if !picture.color().has_alpha() {
        let pixels = picture.into_rgb32f().pixels().map(|pixel| exposure.radiance(pixel.0)).collect();
        return Radiance { width, height, pixels, coverage: Vec::new() };
    }
    let picture = picture.into_rgba32f();
    let pixels = picture.pixels().map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let is_opaque = picture.pixels().all(|pixel| pixel[3] == 1.0);
    let coverage = if is_opaque { Vec::new() } else { picture.pixels().map(|pixel| pixel[3]).collect() };
    Radiance { width, height, pixels, coverage }
}

/// Writes one of several frames as PNG, with a key that identifies the frame.
pub fn save_frame(frame: Frame, key: &str, target: &Target) -> Result<()> {
    let picture = frame.into_8_bits();
    target.write(|file| frame_png(&picture, key, file))
}

/// Returns the key that identifies a frame, from the frame's PNG file. Returns `None` if raycl did not write the file
/// as a frame, or if the file has been changed since.
pub fn frame_key(path: &Path) -> Option<String> {
    mark::key(&mut reader::open(path).ok()?)
}

/// Returns a user error if an output file is not a .png file, or if the file may not be written.
pub fn check_png(target: &Target) -> Result<()> {
    if format(target.path())? != Format::Png {
        let name = target.path().display();
        let error =
            Error::input(format!("cannot write '{name}': a picture of differences must be a .png file"));
        return Err(
            error.with_help(format!("name the file '{}'", target.path().with_extension("png").display()))
        );
    }
    target.check()
}

/// Writes an 8-bit picture as PNG, or as JPEG if the file's extension says so. The file is written completely
/// or not at all.
pub fn save_rgb8(picture: &RgbImage, target: &Target) -> Result<()> {
    let format = format(target.path())?;
    target.write(|file| if format == Format::Jpeg { jpeg(picture, file) } else { png(picture, file) })
}

/// Returns true if the target's picture has 8 bits per channel.
pub fn shows_8_bits(target: &Target) -> bool {
    format_of(target).is_ok_and(|format| matches!(format, Format::Png | Format::Jpeg))
}

/// Returns true if a file of this name contains radiance instead of displayed colours.
pub fn holds_radiance(path: &Path) -> bool {
    format(path).is_ok_and(|format| matches!(format, Format::Exr | Format::Hdr))
}

/// Returns true if a file of this name is a JPEG.
pub fn is_jpeg(path: &Path) -> bool {
    format(path).is_ok_and(|format| format == Format::Jpeg)
}

/// Returns a path's extension in lower case.
fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Returns the format that a path's extension names; `None` if the extension is not known.
fn known(path: &Path) -> Option<Format> {
    let extension = extension(path);
    EXTENSIONS.iter().find(|(name, _)| *name == extension).map(|(_, format)| *format)
}

/// Returns a path that a message can suggest in place of `path`, which has no known extension. If `path`
/// names a folder, suggests the path of a picture in the folder. For `a.png.gz`, suggests `a.png`, and likewise
/// for other extensions of pictures. For any other path, suggests the path with `.png` in place of its last extension.
fn picture_for(path: &Path) -> PathBuf {
    if names_a_folder(path) || path.is_dir() {
        return path.join("picture.png");
    }
    let stem = path.with_extension("");
    if known(&stem).is_some() { stem } else { path.with_extension("png") }
}

fn format(path: &Path) -> Result<Format> {
    known(path).ok_or_else(|| {
        let names = EXTENSIONS.map(|(name, _)| name);
        let choices = names.map(|name| format!(".{name}")).join(", ");
        let error = Error::input(format!(
            "cannot write '{}': the name of a picture must end in one of {choices}",
            path.display()
        ));
        match nearest(&extension(path), names) {
            Some(meant) => {
                error.with_help(format!("did you mean '{}'?", path.with_extension(meant).display()))
            }
            None => error.with_help(format!("name the file '{}'", picture_for(path).display())),
        }
    })
}

/// Returns true if a path is in a folder of the system, such as /dev. A user who names a path in /dev or
/// /proc for a picture probably means standard output or a pipe, as in `-o /dev/stdout` or `-o >(command)`.
/// /dev/shm does not count, since users may store files there.
fn is_of_system(path: &Path) -> bool {
    let is_in = |folder: &str| path.starts_with(folder);
    cfg!(unix) && (is_in("/proc") || is_in("/dev") && !is_in("/dev/shm"))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::output::Choice;

    fn target(path: &Path, force: bool) -> Target {
        Target::new(path, Choice::new(force, "-o FILE"))
    }

    fn gradient(width: u32, height: u32) -> Radiance {
        let pixel = |i| {
            [(i % width) as f32 / width as f32, (i / width) as f32 / height as f32, 0.01].map(|c| c * 0.06)
        };
        Radiance { pixels: (0..width * height).map(pixel).collect(), ..Radiance::new(width, height) }
    }

    fn saved(name: &str, image: &Radiance) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        save(image, Display::default(), &target(&path, false)).unwrap();
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
        assert_eq!(image::open(&path).unwrap().to_rgb32f().as_raw(), image.pixels.as_flattened());
        // The EXR format stores the flag for tiles in the second byte of the version.
        assert_eq!(std::fs::read(&path).unwrap()[5] & 0x02, 0, "its blocks are tiles");
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
    fn hdr_rounds_every_channel_to_the_nearest_step() {
        // The fractional parts of the multiples of an irrational number are spread evenly from 0 to 1.
        let spread = |number: u32, factor: f64| (f64::from(number) * factor).fract();
        let pixel = |number: u32| {
            let largest = 2.0_f64.powf(40.0 * spread(number, std::f64::consts::SQRT_2) - 20.0);
            [0.618_034, 0.754_878, 0.819_173].map(|factor| (largest * spread(number, factor)) as f32)
        };
        let image = Radiance { pixels: (1..4097).map(pixel).collect(), ..Radiance::new(64, 64) };
        let (_folder, path) = saved("picture.hdr", &image);
        let read = read_picture(&path).unwrap().0;
        let mut sum = 0.0;
        for (written, read) in image.pixels.iter().zip(&read.pixels) {
            let most = f64::from(written.iter().copied().fold(0.0, f32::max));
            let step = 2.0_f64.powi(most.log2().floor() as i32 - 7);
            // A channel is stored in one byte as a number of steps. One byte cannot hold 256 steps, but it
            // can hold 128 steps if each step is twice as large.
            let step = if most >= 255.5 * step { 2.0 * step } else { step };
            let errors = [0, 1, 2].map(|i| (f64::from(read[i]) - f64::from(written[i])) / step);
            assert!(errors.iter().all(|error| error.abs() < 0.500_1), "{written:?}: {read:?}");
            sum += errors.iter().sum::<f64>();
        }
        let mean = sum / (3 * image.pixels.len()) as f64;
        assert!(mean.abs() < 0.05, "the mean error is {mean} steps");
    }

    #[test]
    fn hdr_keeps_multiples_of_steps_and_shows_pixels_near_zero_in_black() {
        for (pixel, expected) in [
            ([0.0; 3], [0.0; 3]),
            ([1e-40; 3], [0.0; 3]),
            ([1.0, 0.5, 0.0], [1.0, 0.5, 0.0]),
            ([255.0, 1.0, 0.0], [255.0, 1.0, 0.0]),
            ([0.999; 3], [1.0; 3]),
            ([-1.0, 1.0, 1.0], [0.0, 1.0, 1.0]),
        ] {
            let image = Radiance { pixels: vec![pixel], ..Radiance::new(1, 1) };
            let (_folder, path) = saved("picture.hdr", &image);
            assert_eq!(read_picture(&path).unwrap().0.pixels, [expected], "{pixel:?}");
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
    fn the_comment_of_a_jpeg_ends_where_its_length_says() {
        let (_folder, path) = saved("picture.jpg", &gradient(61, 37));
        let bytes = std::fs::read(path).unwrap();
        let begin = bytes.windows(2).position(|marker| marker == [0xff, 0xfe]).unwrap() + 2;
        // The length of the JPEG's comment segment includes the two bytes of the length itself. Another JPEG
        // marker follows the comment segment.
        let after = begin + usize::from(u16::from_be_bytes([bytes[begin], bytes[begin + 1]]));
        assert!(bytes[begin + 2..after].starts_with(b"made by raycl"), "{:?}", &bytes[..after]);
        assert!(bytes[after] == 0xff && bytes[after + 1] != 0, "{:?}", &bytes[after..after + 2]);
    }

    #[test]
    fn an_unknown_extension_names_the_choices_and_a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["picture.pnf", "picture"] {
            let error = save(&gradient(2, 2), Display::default(), &target(&folder.path().join(name), false))
                .unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(".png, .jpg, .jpeg, .exr, .hdr"), "{error}");
        }
        let nowhere = folder.path().join("nowhere/picture.png");
        let error = save(&gradient(2, 2), Display::default(), &target(&nowhere, false)).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("no folder"), "{error}");
    }

    #[test]
    fn a_failed_write_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        std::fs::create_dir(&path).unwrap(); // a folder cannot be replaced by a file
        for force in [false, true] {
            assert_eq!(
                save(&gradient(2, 2), Display::default(), &target(&path, force)).unwrap_err().exit_code(),
                2
            );
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    const NAMES: [&str; 5] = ["a.png", "a.jpg", "a.jpeg", "a.exr", "a.hdr"];

    #[test]
    fn a_jpeg_that_has_no_room_for_the_pixels_is_refused_before_any_work() {
        let folder = tempfile::tempdir().unwrap();
        let check = |name: &str, size| check_target(&target(&folder.path().join(name), false), size);
        let refused = check("a.jpg", [65_536, 1]).unwrap_err();
        assert!(
            refused.to_string().ends_with("65536 x 1 pixels; a JPEG has at most 65535 in each direction"),
            "{refused}"
        );
        assert!(refused.remedy().ends_with("a.png'") && refused.exit_code() == 2);
        assert!(check("a.jpg", [1, 65_536]).is_err());
        assert!(check("a.jpg", [65_535, 65_535]).is_ok() && check("a.png", [65_536, 1]).is_ok());
    }

    #[test]
    fn the_only_width_of_which_no_hdr_can_be_read_is_refused_before_any_work() {
        for width in [32_767, 32_768, 32_769] {
            let image = gradient(width, 1);
            let (_folder, path) = saved("a.hdr", &image);
            let is_near = |read: &Radiance| {
                let mut values = read.pixels.as_flattened().iter().zip(image.pixels.as_flattened());
                values.all(|(a, b)| (a - b).abs() < 0.06 / 128.0)
            };
            let is_readable = read_picture(&path).is_ok_and(|(read, _)| is_near(&read));
            assert_eq!(check_target(&target(&path, false), [width, 1]).is_ok(), is_readable, "{width}");
        }
        let folder = tempfile::tempdir().unwrap();
        let check = |size| check_target(&target(&folder.path().join("a.hdr"), false), size);
        let refused = check([32_768, 1]).unwrap_err();
        let why = "32768 x 1 pixels; raycl cannot write an HDR with rows of 32768 pixels";
        assert!(refused.exit_code() == 2 && refused.to_string().ends_with(why), "{refused}");
        assert!(refused.remedy().ends_with("a.exr'"), "{}", refused.remedy());
        assert!(check([1, 32_768]).is_ok());
    }

    /// Saves an image to the existing file `path`. Returns the error's message if raycl refuses to replace
    /// the file.
    fn again(path: &Path, force: bool) -> Option<String> {
        let target = target(path, force);
        let (checked, image) = (check_target(&target, [9, 7]), gradient(9, 7));
        let saved = save(&image, Display::default(), &target);
        assert_eq!(checked.is_ok(), saved.is_ok(), "both or none");
        saved.err().inspect(|error| assert_eq!(error.exit_code(), 2)).map(|error| error.to_string())
    }

    #[test]
    fn a_picture_that_raycl_made_is_replaced_and_no_other() {
        for name in NAMES {
            let (_folder, path) = saved(name, &gradient(61, 37));
            assert_eq!(again(&path, false), None, "{name}");
            assert_eq!(image::image_dimensions(&path).unwrap(), (9, 7), "{name}");
            let mut edited = std::fs::read(&path).unwrap();
            *edited.last_mut().unwrap() ^= 1;
            std::fs::write(&path, &edited).unwrap();
            assert!(again(&path, false).unwrap().contains("has been changed since raycl made it"), "{name}");
            let other = b"a photograph of somebody's";
            std::fs::write(&path, other).unwrap();
            assert!(again(&path, false).unwrap().contains("raycl did not make it"), "{name}");
            assert_eq!(std::fs::read(&path).unwrap(), other, "{name}");
            assert_eq!(again(&path, true), None, "{name}");
            assert_eq!(again(&path, false), None, "{name}");
        }
    }

    #[test]
    fn an_exr_with_an_alpha_channel_is_recognised_as_raycls_own_and_has_no_tiles() {
        let image = Radiance { coverage: vec![0.5; 61 * 37], ..gradient(61, 37) };
        let (_folder, path) = saved("a.exr", &image);
        // The EXR format stores the flag for tiles in the second byte of the version.
        assert_eq!(std::fs::read(&path).unwrap()[5] & 0x02, 0, "its blocks are tiles");
        assert_eq!(again(&path, false), None);
    }

    /// Returns a file that is put together from the files of two pictures. Up to the end of the mark (by
    /// which raycl recognises its own files), the bytes are those of one file; after the mark, they are those
    /// of the other file.
    fn with_the_mark_of_another(name: &str) -> Vec<u8> {
        let mut pictures = [0.0, 1.0].map(|light| {
            let image = Radiance { pixels: vec![[light; 3]; 64 * 64], ..Radiance::new(64, 64) };
            let (_folder, path) = saved(name, &image);
            std::fs::read(path).unwrap()
        });
        // Returns the offset at which raycl's mark in a picture file ends. A mark ends with this label and a
        // hash of 64 digits.
        let mark = |bytes: &[u8]| {
            let label = b"blake3 of the rest: ";
            bytes.windows(label.len()).position(|window| window == label).unwrap() + label.len() + 64
        };
        let [one, other] = &mut pictures;
        let end = mark(one) + if name == "a.png" { 4 } else { 0 };
        assert_eq!(mark(one), mark(other));
        assert_ne!(one[..end], other[..end], "their hashes differ");
        [&one[..end], &other[end..]].concat()
    }

    #[test]
    fn a_mark_on_other_pixels_proves_nothing() {
        for name in NAMES {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join(name);
            std::fs::write(&path, with_the_mark_of_another(name)).unwrap();
            assert!(image::open(&path).is_ok(), "{name} is a picture");
            assert!(again(&path, false).unwrap().contains("has been changed since"), "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_what_it_points_to_is_never_written_to() {
        let (folder, path) = saved("a.png", &gradient(61, 37));
        let link = folder.path().join("link.png");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert!(again(&link, false).unwrap().contains("is a link"));
        assert_eq!(again(&link, true), None);
        assert!(!link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(image::image_dimensions(&path).unwrap(), (61, 37));
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

    #[test]
    fn only_formats_with_alpha_may_have_a_transparent_background() {
        for (name, has_alpha) in
            [("a.png", true), ("a.exr", true), ("-", true), ("a.jpg", false), ("a.hdr", false)]
        {
            assert_eq!(check_alpha(&target(Path::new(name), false)).is_ok(), has_alpha, "{name}");
        }
        let error = check_alpha(&target(Path::new("a.jpg"), false)).unwrap_err().to_string();
        assert!(error.contains("a JPEG has no alpha channel"), "{error}");
    }

    #[test]
    fn a_picture_of_differences_is_a_png() {
        let folder = tempfile::tempdir().unwrap();
        let check = |name: &str| check_png(&target(&folder.path().join(name), false));
        assert!(check("a.png").is_ok());
        let error = check("a.exr").unwrap_err().to_string();
        assert!(error.contains("a picture of differences must be a .png file"), "{error}");
        std::fs::write(folder.path().join("mine.png"), "mine").unwrap();
        assert!(check("mine.png").is_err(), "raycl did not make this file");
    }

    #[test]
    fn a_picture_comes_back_and_other_files_are_refused() {
        let image = gradient(7, 5);
        let (folder, path) = saved("picture.exr", &image);
        let (read, values) = read_picture(&path).unwrap();
        assert_eq!((read.width, read.height, read.pixels), (7, 5, image.pixels));
        assert_eq!(values, Values::Radiance);
        let [text, palette, cut] =
            ["text.png", "palette.png", "cut.jpg"].map(|name| folder.path().join(name));
        std::fs::write(&text, "no picture").unwrap();
        std::fs::write(&palette, crate::image::ODD_PALETTE).unwrap();
        let (_whole_folder, whole) = saved("whole.jpg", &gradient(64, 64));
        let whole = std::fs::read(whole).unwrap();
        std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
        for path in [text, palette, cut, folder.path().join("missing.png")] {
            let error = read_picture(&path).unwrap_err();
            assert!(
                error.exit_code() == 2 && error.to_string().contains("cannot read the picture"),
                "{error}"
            );
        }
    }

    #[test]
    fn a_misspelt_picture_is_answered_with_the_picture_beside_it() {
        let (folder, there) = saved("picture.png", &gradient(2, 2));
        let remedy = |name: &str| read_picture(&folder.path().join(name)).unwrap_err().remedy().to_owned();
        assert_eq!(remedy("picture.pgn"), format!("did you mean `{}`?", there.display()));
        assert_eq!(remedy("other.exr"), READABLE);
    }

    #[test]
    fn an_empty_picture_is_called_empty() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = read_picture(file.path()).unwrap_err();
        assert!(error.to_string().ends_with(": it is empty"), "{error}");
        assert_eq!((error.exit_code(), error.remedy()), (2, READABLE));
    }

    #[test]
    fn an_animated_picture_is_refused_since_only_one_of_its_frames_would_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.apng");
        let film = crate::image::Movie::apng(target(&path, false), [2, 1], 30, 2);
        let frames = [0_u8, 255].map(|grey| Frame::Shown(RgbImage::from_pixel(2, 1, [grey; 3].into())));
        film.write(frames.into_iter()).unwrap();
        let refused = read_picture(&path).unwrap_err();
        assert!(refused.to_string().ends_with("a.apng': it is an animated picture"), "{refused}");
        assert_eq!((refused.exit_code(), refused.remedy()), (2, NUMBERED));
        // A texture may be an animated picture; its first frame is used.
        assert!(picture_reader(&std::fs::read(&path).unwrap(), None).unwrap().decode().is_ok());
    }

    #[test]
    fn a_radiance_hdr_of_another_program_is_read_as_radiance() {
        let (_folder, path) = saved("a.hdr", &Radiance { pixels: vec![[4.0; 3]], ..Radiance::new(1, 1) });
        let own = std::fs::read(&path).unwrap();
        // The test keeps the header's line `FORMAT=` and all bytes after this line, and replaces the lines
        // before it.
        let rest = own.windows(7).position(|window| window == b"FORMAT=").unwrap();
        let write = |exposure: &str| {
            let begin = format!("#?RGBE\nEXPOSURE={exposure}\n");
            std::fs::write(&path, [begin.as_bytes(), &own[rest..]].concat()).unwrap();
        };
        write("2");
        assert_eq!(read_picture(&path).unwrap().0.pixels, [[2.0; 3]]);
        write("0");
        let refused = read_picture(&path).unwrap_err().to_string();
        let expected = "it has the EXPOSURE 0 in its header; expected a positive, finite number";
        assert!(refused.ends_with(expected), "{refused}");
    }

    #[test]
    fn the_alpha_of_a_picture_comes_back_unless_the_picture_is_opaque() {
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str, alpha: [u8; 2]| {
            let path = folder.path().join(name);
            let pixel = |x: u32, _| image::Rgba([255, 51, 0, alpha[x as usize]]);
            let picture = DynamicImage::from(image::RgbaImage::from_fn(2, 1, pixel));
            // An EXR contains floats, so the picture is converted to floats.
            let picture = if name == "a.exr" { picture.into_rgba32f().into() } else { picture };
            picture.save(&path).unwrap();
            let (Radiance { pixels, coverage, .. }, values) = read_picture(&path).unwrap();
            assert_eq!(pixels, [[1.0, 0.2, 0.0]; 2], "{name}");
            assert_eq!(values == Values::Radiance, name == "a.exr", "{name}");
            coverage
        };
        for name in ["a.png", "a.exr"] {
            assert_eq!(read(name, [51, 255]), [0.2, 1.0], "{name}");
            assert!(read(name, [255, 255]).is_empty(), "{name}");
        }
    }

    #[test]
    fn a_grey_picture_has_the_values_of_the_same_picture_in_colour() {
        use image::{ImageBuffer, Luma, LumaA, Rgb, Rgba};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let read = |picture: DynamicImage| {
            picture.save(&path).unwrap();
            read_picture(&path).unwrap().0
        };
        let is_read_alike = |grey: DynamicImage, coloured: DynamicImage| {
            let colour = grey.color();
            let [grey, coloured] = [grey, coloured].map(read);
            assert!(grey.pixels == coloured.pixels, "{colour:?}");
            assert!(grey.coverage == coloured.coverage, "{colour:?}: alpha");
        };
        // Each picture contains every value that its number of bits per channel allows.
        let grey = ImageBuffer::from_fn(256, 1, |x, _| Luma([x as u8]));
        let coloured = ImageBuffer::from_fn(256, 1, |x, _| Rgb([x as u8; 3]));
        is_read_alike(DynamicImage::ImageLuma8(grey), DynamicImage::ImageRgb8(coloured.clone()));
        let opaque = ImageBuffer::from_fn(256, 1, |x, _| LumaA([x as u8, 255]));
        is_read_alike(DynamicImage::ImageLumaA8(opaque), DynamicImage::ImageRgb8(coloured));
        let grey = ImageBuffer::from_fn(256, 1, |x, _| LumaA([x as u8; 2]));
        let coloured = ImageBuffer::from_fn(256, 1, |x, _| Rgba([x as u8; 4]));
        is_read_alike(DynamicImage::ImageLumaA8(grey), DynamicImage::ImageRgba8(coloured));
        let value = |x: u32, y: u32| (x + 256 * y) as u16;
        let grey = ImageBuffer::from_fn(256, 256, |x, y| Luma([value(x, y)]));
        let coloured = ImageBuffer::from_fn(256, 256, |x, y| Rgb([value(x, y); 3]));
        is_read_alike(DynamicImage::ImageLuma16(grey), DynamicImage::ImageRgb16(coloured));
        let grey = ImageBuffer::from_fn(256, 256, |x, y| LumaA([value(x, y); 2]));
        let coloured = ImageBuffer::from_fn(256, 256, |x, y| Rgba([value(x, y); 4]));
        is_read_alike(DynamicImage::ImageLumaA16(grey), DynamicImage::ImageRgba16(coloured));
    }

    #[test]
    fn a_picture_is_not_refused_because_it_has_more_than_512_mib() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        image::DynamicImage::new_rgba16(1, 1).save(&path).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        // The test changes the header so that it states a row of 70 million pixels of 8 bytes, and the file
        // seems to be cut off. The test needs such a long row, since the decoder's own limit on memory
        // applies only to the length of a row.
        bytes[16..24].copy_from_slice(&[70_000_000_u32.to_be_bytes(), 1_u32.to_be_bytes()].concat());
        let mut check = flate2::Crc::new();
        check.update(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&check.sum().to_be_bytes());
        std::fs::write(&path, bytes).unwrap();
        let refused = read_within(&path, || memory(u64::MAX)).unwrap_err().to_string();
        assert!(refused.starts_with("cannot read the picture"), "{refused}");
        assert!(!refused.contains("limit"), "{refused}");
    }

    /// Returns an `Available` that states the given number of free bytes.
    fn memory(bytes: u64) -> Available {
        Available { bytes, source: "a test".to_owned() }
    }

    #[test]
    fn a_file_that_does_not_fit_into_memory_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::File::create(&path).unwrap().set_len(1_000_000).unwrap();
        let refused = |bytes| read_within(&path, || memory(bytes)).unwrap_err().to_string();
        let large = refused(999_999);
        assert!(large.starts_with("reading the picture '"), "{large}");
        assert!(large.contains("needs about 1.0 MB"), "{large}");
        assert!(large.contains("(the file's length = 1000000 B)"), "{large}");
        let no_picture = refused(1_000_000);
        assert!(no_picture.starts_with("cannot read the picture"), "{no_picture}");
    }

    #[test]
    fn only_a_picture_that_does_not_fit_into_memory_is_refused() {
        /// A picture of 20,000 x 10,000 pixels, of 16 bytes each, whose pixels are never decoded.
        struct Large;
        impl ImageDecoder for Large {
            fn dimensions(&self) -> (u32, u32) {
                (20_000, 10_000)
            }
            fn color_type(&self) -> image::ColorType {
                image::ColorType::Rgba32F
            }
            fn read_image(self, _: &mut [u8]) -> image::ImageResult<()> {
                Ok(())
            }
            fn read_image_boxed(self: Box<Self>, _: &mut [u8]) -> image::ImageResult<()> {
                Ok(())
            }
        }
        let check =
            |bytes| room_for(&Large, Path::new("a.exr"), &memory(bytes)).map_err(|error| error.to_string());
        assert_eq!(check(9_600_000_000), Ok(()));
        let refused = check(9_599_999_999).unwrap_err();
        assert!(refused.starts_with("the picture 'a.exr' needs about 9.6 GB"), "{refused}");
        assert!(refused.contains("(48 B x 20000 x 10000 pixels = 9600000000 B)"), "{refused}");
    }

    #[test]
    fn an_exr_with_alpha_keeps_the_coverage_of_each_pixel() {
        let pixels = (0..6).map(|index| [index as f32, 10.0, 20.0]).collect();
        let coverage = vec![0.0, 0.125, 0.25, 0.5, 0.75, 1.0];
        let image = Radiance { width: 3, height: 2, pixels, coverage: coverage.clone() };
        let (_folder, path) = saved("a.exr", &image);
        let read = image::open(path).unwrap().to_rgba32f();
        assert_eq!(read.dimensions(), (3, 2));
        assert_eq!(read.pixels().map(|pixel| pixel.0[0]).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(read.pixels().map(|pixel| pixel.0[3]).collect::<Vec<_>>(), coverage);
    }

    #[test]
    fn an_image_is_refused_if_its_lists_do_not_match_its_size_or_a_format_cannot_hold_it() {
        let refused = |image: &Radiance, name: &str| {
            let checked = check_image(image, &target(Path::new(name), false));
            checked.err().map(|error| (error.exit_code(), error.to_string()))
        };
        let coverage = |length| Radiance { coverage: vec![1.0; length], ..gradient(3, 2) };
        for (image, why) in [
            (Radiance::new(0, 5), "the picture has 0 x 5 pixels"),
            (Radiance { width: 4, ..gradient(3, 2) }, "4 x 2 = 8 pixels, but `pixels` has 6"),
            (Radiance { height: 1, ..gradient(3, 2) }, "3 x 1 = 3 pixels, but `pixels` has 6"),
            (coverage(5), "`coverage` has 5"),
        ] {
            for name in ["a.png", "a.jpg", "a.exr", "a.hdr"] {
                let (code, message) = refused(&image, name).unwrap();
                assert!(code == 2 && message.contains(why), "{name}: {message}");
            }
        }
        assert_eq!(refused(&coverage(6), "a.png"), None);
        let mut bright = gradient(3, 2);
        bright.pixels[4][1] = f32::INFINITY;
        assert_eq!((refused(&bright, "a.exr"), refused(&bright, "-")), (None, None));
        let (code, message) = refused(&bright, "a.hdr").unwrap();
        assert!(code == 2 && message.contains("column 1 of row 1 is not finite"), "{message}");
    }

    #[test]
    fn a_file_that_cannot_be_written_is_an_error_in_every_format() {
        let image = gradient(3, 2);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "").unwrap();
        let file = || std::fs::File::open(&path).unwrap(); // for reading only
        let display = Display::default();
        assert!(exr(&image, &mut file()).is_err() && hdr(&image, &mut file()).is_err());
        assert!(shown_png(&image, display, &mut file()).is_err());
        assert!(jpeg(&to_rgb8(&image, display), &mut file()).is_err());
    }

    #[test]
    fn a_jpeg_has_the_quality_95() {
        let (image, mut expected) = (gradient(3, 2), Vec::new());
        let shown = to_rgb8(&image, Display::default());
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut expected, 95).encode_image(&shown).unwrap();
        let tables = |file: &[u8]| {
            let begin = file.windows(2).position(|marker| marker == [0xff, 0xdb]).unwrap();
            file[begin..begin + 69].to_vec()
        };
        let (_folder, path) = saved("a.jpg", &image);
        assert_eq!(tables(&std::fs::read(path).unwrap()), tables(&expected));
    }

    #[test]
    fn an_8_bit_picture_is_a_jpeg_only_if_its_name_says_so() {
        let folder = tempfile::tempdir().unwrap();
        for (name, begin) in [("a.jpg", &b"\xff\xd8"[..]), ("a.JPEG", b"\xff\xd8"), ("a.png", b"\x89PNG")] {
            let path = folder.path().join(name);
            save_rgb8(&RgbImage::new(2, 2), &target(&path, false)).unwrap();
            assert!(std::fs::read(&path).unwrap().starts_with(begin), "{name}");
            assert!(shows_8_bits(&target(&path, false)), "{name}");
            assert!(is_jpeg(&path) == (name != "a.png"), "{name}");
        }
        // On standard output, the picture is a PNG.
        assert!(shows_8_bits(&target(Path::new("-"), false)) && !is_jpeg(Path::new("-")));
        assert!(!shows_8_bits(&target(Path::new("a.exr"), false)) && !is_jpeg(Path::new("a.exr")));
    }

    #[test]
    fn a_frame_keeps_its_key_and_another_picture_has_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a-1.png");
        let key = "7".repeat(64);
        let frame = Frame::Radiance(gradient(3, 2), Display::default());
        save_frame(frame, &key, &target(&path, false)).unwrap();
        assert_eq!(frame_key(&path), Some(key));
        assert_eq!(image::open(&path).unwrap().to_rgb8(), to_rgb8(&gradient(3, 2), Display::default()));
        let (_folder, other) = saved("a.png", &gradient(3, 2));
        assert_eq!(frame_key(&other), None);
    }

    #[cfg(unix)]
    #[test]
    fn no_picture_among_devices_is_suggested() {
        for path in ["/dev/stdout", "/dev/fd/63", "/proc/self/fd/1"] {
            let error = check_target(&target(Path::new(path), false), [8, 8]).unwrap_err();
            assert_eq!((error.exit_code(), error.remedy()), (2, TO_STANDARD_OUTPUT), "{path}");
        }
        for path in ["dev/stdout", "/dev/shm/a"] {
            let error = check_target(&target(Path::new(path), false), [8, 8]).unwrap_err();
            assert_eq!(error.remedy(), format!("name the file '{path}.png'"));
        }
    }

    #[test]
    fn a_refusal_names_files_that_would_do() {
        let remedy = |error: Error| error.remedy().to_owned();
        let of = |name: &str| target(Path::new(name), false);
        for name in ["b/a.jpg", "b/a.hdr"] {
            let refused = check_alpha(&of(name)).unwrap_err();
            assert_eq!(remedy(refused), "name the file 'b/a.png' or 'b/a.exr'");
        }
        assert!(check_alpha(&of("a.hdr")).unwrap_err().to_string().contains(": an HDR has no alpha"));
        assert_eq!(remedy(check_png(&of("b/a.exr")).unwrap_err()), "name the file 'b/a.png'");
        assert_eq!(remedy(format(Path::new("b/a.jpgg")).unwrap_err()), "did you mean 'b/a.jpg'?");
        assert_eq!(remedy(format(Path::new("b/a")).unwrap_err()), "name the file 'b/a.png'");
        for (path, meant) in [
            (".", "./picture.png"),
            ("..", "../picture.png"),
            ("b/", "b/picture.png"),
            // Cargo runs the tests in the repository's folder, in which `src` is a folder.
            ("src", "src/picture.png"),
            ("a.png.gz", "a.png"),
            ("b.c/a.tar.gz", "b.c/a.tar.png"),
        ] {
            let refused = format(Path::new(path)).unwrap_err();
            assert_eq!(remedy(refused), format!("name the file '{meant}'"), "{path}");
        }
    }
}
