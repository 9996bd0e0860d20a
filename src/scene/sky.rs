//! The sky: light from all directions. A sky is either a gradient from the horizon to the zenith, or a
//! picture.

use super::{INPUTS, files};
use crate::error::why_unread;
use crate::filetype::FileType;
use crate::image::{
    HdrExposure, check_channels, decoder_message, exr_rest, header_remarks, unread_channels,
    with_usual_signature,
};
use crate::memory::Available;
use crate::reader::{self, Kind};
use crate::words::counted;
use glam::{DQuat, DVec3, Vec3};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

/// Largest width and height of a sky's picture in texels.
const MOST_ACROSS: u32 = 1 << 13;
/// Largest memory for decoding a picture, in bytes: two copies of four floats per texel.
const DECODING_BYTES: u64 = 32 * (MOST_ACROSS as u64) * (MOST_ACROSS as u64);
/// Memory per texel while a picture is read, in bytes. During decoding, up to two copies of four floats (32
/// bytes) are in memory. After decoding, up to three copies of three floats (36 bytes) are in memory. `TEXEL_BYTES` has
/// 4 bytes more than these 36, as a reserve.
const TEXEL_BYTES: u64 = 40;
/// A value below zero is reported in a note if its absolute value exceeds this share of the picture's mean
/// value. Negative values with a smaller absolute value are common, because filters of other programs produce
/// them.
const CLEARLY: f64 = 1e-3;

/// A sky: light from all directions, unless something occludes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    /// The radiance from directly above; 0 if a picture defines the sky.
    pub zenith: Vec3,
    /// The radiance from the horizon and from below it; 0 if a picture defines the sky.
    pub horizon: Vec3,
    /// The direction of the zenith, of unit length.
    pub up: Vec3,
    /// Surfaces farther from a hit than this distance, in the scene's units, do not occlude the sky.
    pub reach: f32,
    /// The radiance from each direction, if a picture defines it.
    pub picture: Option<Arc<SkyPicture>>,
}

impl Sky {
    /// Returns true if the radiance from all directions is 0.
    pub(super) fn is_black(&self) -> bool {
        let is_black = |picture: &Arc<SkyPicture>| picture.texels.iter().all(|texel| *texel == [0.0; 3]);
        [self.zenith, self.horizon] == [Vec3::ZERO; 2] && self.picture.as_ref().is_none_or(is_black)
    }
}

/// A picture of all directions (equirectangular): columns are angles around the zenith, and rows
/// are angles from the zenith.
#[derive(Clone, Debug)]
pub struct SkyPicture {
    /// Number of texels across and down.
    pub size: [u32; 2],
    /// The radiance of each texel, row by row from the zenith.
    pub texels: Arc<[[f32; 3]]>,
    /// The direction of the picture's middle, of unit length and perpendicular to the zenith.
    pub ahead: Vec3,
    /// True if rays that hit nothing see the picture instead of the background.
    pub is_seen: bool,
}

impl PartialEq for SkyPicture {
    /// Compares two pictures. If both pictures refer to the same texels in memory, the texels are not
    /// compared one by one.
    fn eq(&self, other: &Self) -> bool {
        let same_texels = || Arc::ptr_eq(&self.texels, &other.texels) || self.texels == other.texels;
        (self.size, self.ahead, self.is_seen) == (other.size, other.ahead, other.is_seen) && same_texels()
    }
}

/// The values of a picture's file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FileTexels {
    /// Number of texels across and down.
    pub size: [u32; 2],
    /// Each texel's red, green and blue. No value is negative or NaN.
    pub texels: Arc<[[f32; 3]]>,
    /// The number of texels with a value that was clearly negative or not a number.
    pub invalid: usize,
    /// Remarks on unsuitable properties of the picture, for example that it is not twice as wide as high. Each
    /// remark continues a sentence that begins with the file's name.
    pub remarks: Vec<String>,
    /// The names of the picture's channels that are not read.
    pub unread: Vec<String>,
}

impl FileTexels {
    /// Replaces values that are negative or not a number by 0, since no light is negative. Single texels of stitched
    /// and baked pictures can have values that are negative or not a number. Counts the texels with a value that is
    /// clearly negative ([`CLEARLY`]) or not a number.
    fn of(size: [u32; 2], mut texels: Vec<[f32; 3]>) -> Self {
        let values = texels.as_flattened();
        let sum: f64 = values.iter().map(|value| f64::from(value.max(0.0))).sum();
        let least = -CLEARLY * sum / values.len() as f64;
        let is_invalid =
            |texel: &&[f32; 3]| texel.iter().any(|value| value.is_nan() || f64::from(*value) < least);
        let invalid = texels.iter().filter(is_invalid).count();
        // For a value that is not a number, `max` returns 0.
        texels.as_flattened_mut().iter_mut().for_each(|value| *value = value.max(0.0));
        Self { size, texels: texels.into(), invalid, remarks: Vec::new(), unread: Vec::new() }
    }
}

impl SkyPicture {
    /// Reads a picture (Radiance HDR or OpenEXR), and adds its path to [`INPUTS`], the list of the files that were
    /// read. The text of an error continues a sentence that begins with the file's name.
    pub(super) fn read(path: &Path) -> Result<FileTexels, String> {
        INPUTS.add(path);
        let bytes = reader::bytes(path, Kind::Texture).map_err(|error| why_unread(path, &error))?;
        Self::decoded(&with_usual_signature(bytes), &Available::read())
    }

    /// Decodes a picture. Returns an error if `bytes` is not a valid Radiance HDR or OpenEXR, if the picture is too
    /// large, or if the available memory is not enough.
    fn decoded(bytes: &[u8], available: &Available) -> Result<FileTexels, String> {
        let format = image::guess_format(bytes).ok();
        let Some(format @ (ImageFormat::Hdr | ImageFormat::OpenExr)) = format else {
            return Err(match FileType::of(bytes, bytes.len() as u64) {
                FileType::Foreign(foreign) => {
                    format!("is {}; expected a Radiance HDR or an OpenEXR", foreign.name)
                }
                _ => "is neither a Radiance HDR nor an OpenEXR".to_owned(),
            });
        };
        let damaged = |why: String| format!("cannot be decoded ({why})");
        check_channels(bytes)?;
        let mut source = Cursor::new(bytes);
        let mut reader = ImageReader::with_format(&mut source, format);
        let mut limits = image::Limits::no_limits();
        limits.max_alloc = Some(DECODING_BYTES);
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(decoder_message).map_err(damaged)?;
        let size = decoder.dimensions();
        if size.0 == 0 || size.1 == 0 || size.0.max(size.1) > MOST_ACROSS {
            return Err(format!(
                "has {} x {} texels; expected 1 to {MOST_ACROSS} in each direction",
                size.0, size.1
            ));
        }
        files::room_for(size, TEXEL_BYTES, available)?;
        let exposure = HdrExposure::of(bytes)?;
        let picture = DynamicImage::from_decoder(decoder).map_err(decoder_message).map_err(damaged)?;
        let clear = clear_texels(&picture);
        let picture = picture.into_rgb32f();
        let texels = picture.pixels().map(|texel| exposure.radiance(texel.0)).collect();
        let rest = match format {
            ImageFormat::Hdr => &bytes[source.position() as usize..],
            _ => exr_rest(bytes),
        };
        let remarks =
            header_remarks(bytes).into_iter().chain(stretched(size)).chain(clear).chain(surplus(rest));
        let (remarks, unread) = (remarks.collect(), unread_channels(bytes));
        Ok(FileTexels { remarks, unread, ..FileTexels::of([size.0, size.1], texels) })
    }

    /// Returns a file's picture multiplied by `strength`. Returns an error if a product is more than `most`, or not a
    /// number (infinity times 0). The text of the error continues a sentence that begins with the file's name.
    pub(super) fn strengthened(file: &FileTexels, strength: f32, most: f32) -> Result<FileTexels, String> {
        let texels = if strength == 1.0 {
            Arc::clone(&file.texels)
        } else {
            file.texels.iter().map(|texel| texel.map(|value| value * strength)).collect()
        };
        match wrong_value(file.size, &texels, most) {
            None => Ok(FileTexels { texels, ..file.clone() }),
            Some(wrong) => Err(format!(
                "has {wrong} after multiplication by the sky's strength; expected at most {most:e}"
            )),
        }
    }

    /// Returns the first texel with a number that is not from 0 to `most`, as text; `None` if there is no such texel.
    pub(crate) fn wrong_value(&self, most: f32) -> Option<String> {
        wrong_value(self.size, &self.texels, most)
    }

    /// Returns the direction of the picture's middle. If `turn_degrees` is 0, the direction is -z (or +y if
    /// the zenith `up` is close to +z or -z), made perpendicular to the zenith. Otherwise, the direction of
    /// the middle is also turned by `turn_degrees`, counter-clockwise as seen from the zenith.
    pub fn middle(up: DVec3, turn_degrees: f64) -> Vec3 {
        let forward = if up.z.abs() > 0.9 { DVec3::Y } else { DVec3::NEG_Z };
        let level = (forward - up * forward.dot(up)).normalize_or_zero();
        (DQuat::from_axis_angle(up, turn_degrees.to_radians()) * level).as_vec3()
    }
}

/// Returns the value and the position of the first texel with a number that is not from 0 to `most`, as text.
fn wrong_value([across, _]: [u32; 2], texels: &[[f32; 3]], most: f32) -> Option<String> {
    let is_valid = |texel: &[f32; 3]| texel.iter().all(|value| (0.0..=most).contains(value));
    let at = texels.iter().position(|texel| !is_valid(texel))?;
    let [x, y] = [at % across as usize, at / across as usize];
    Some(format!("a value of {:?} in column {x}, row {y} (from 0)", texels[at]))
}

/// Returns a remark on texels with an alpha other than 1, apart from rounding errors; `None` if there are none.
fn clear_texels(picture: &DynamicImage) -> Option<String> {
    let DynamicImage::ImageRgba32F(picture) = picture else { return None };
    let is_opaque = |alpha: f32| (alpha - 1.0).abs() <= 1e-3;
    let count = picture.pixels().filter(|texel| !is_opaque(texel.0[3])).count();
    (count > 0)
        .then(|| format!("has an alpha other than 1 in {}; alpha is not used", counted(count, "texel")))
}

/// Returns a remark on the bytes after a picture's last row; `None` if there are only blanks and line ends.
fn surplus(rest: &[u8]) -> Option<String> {
    let bytes = || counted(rest.len(), "byte after its last row");
    (!rest.trim_ascii().is_empty()).then(|| format!("has {}, which raycl ignores", bytes()))
}

/// Returns a remark on a picture that is not twice as wide as high; otherwise `None`. The width may differ by
/// 1, since an odd width cannot be exactly twice the height.
fn stretched((width, height): (u32, u32)) -> Option<String> {
    let remark = || {
        format!(
            "has {width} x {height} texels, but is used as an equirectangular picture, which is twice as wide as high"
        )
    };
    (width.abs_diff(2 * height) > 1).then(remark)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn texels_are_read_in_rows_and_none_is_negative() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        let texels = [-0.5, 1.0, 2.0, 3.0, 4.0, 5.0];
        image::Rgb32FImage::from_vec(2, 1, texels.to_vec()).unwrap().save(&path).unwrap();
        let read = SkyPicture::read(&path).unwrap();
        assert_eq!((read.size, &*read.texels), ([2, 1], &[[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]][..]));
        assert_eq!(read.invalid, 1);
    }

    #[test]
    fn only_texels_that_are_clearly_negative_are_counted() {
        // With negative values counted as 0, the mean of the picture's 12 values is 1, so values below -1e-3
        // are clearly negative.
        let texels = vec![[4.0; 3], [0.0, -0.9e-3, 0.0], [0.0, -1.1e-3, -5.0], [0.0; 3]];
        let file = FileTexels::of([4, 1], texels);
        assert_eq!((file.invalid, &file.texels[1..]), (1, &[[0.0; 3]; 3][..]));
        assert_eq!(FileTexels::of([1, 1], vec![[0.0, 0.0, -1e-9]]).invalid, 1);
        assert_eq!(FileTexels::of([1, 1], vec![[0.0, -0.0, 1.0]]).invalid, 0);
    }

    #[test]
    fn a_value_that_is_not_a_number_counts_as_0_and_an_infinite_one_is_refused_with_its_position() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        let read = |value: f32| {
            let texels = [0.0, 1.0, 2.0, 3.0, value, 5.0];
            image::Rgb32FImage::from_vec(1, 2, texels.to_vec()).unwrap().save(&path).unwrap();
            SkyPicture::read(&path).unwrap()
        };
        let nan = read(f32::NAN);
        assert_eq!((nan.invalid, &*nan.texels), (1, &[[0.0, 1.0, 2.0], [3.0, 0.0, 5.0]][..]));
        let message = SkyPicture::strengthened(&read(f32::INFINITY), 1.0, 8.0).unwrap_err();
        assert!(message.starts_with("has a value of [3.0, inf, 5.0] in column 0, row 1"), "{message}");
    }

    #[test]
    fn a_radiance_hdr_of_another_program_is_read_as_radiance() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.hdr");
        let write = |exposure: &str| {
            let header = format!("#?RGBE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE={exposure}\n\n-Y 1 +X 1\n");
            std::fs::write(&path, [header.as_bytes(), &[128, 64, 32, 129]].concat()).unwrap();
        };
        write("0.5");
        // A channel's value is b / 256 * 2^(e - 128), where b is the channel's byte and e the texel's last
        // byte. The radiance is the channel's value divided by EXPOSURE.
        assert_eq!(*SkyPicture::read(&path).unwrap().texels, [[2.0, 1.0, 0.5]]);
        write("-1");
        assert!(SkyPicture::read(&path).unwrap_err().starts_with("has the EXPOSURE -1 in its header"));
    }

    #[test]
    fn a_picture_that_does_not_fit_into_the_memory_is_refused_before_it_is_decoded() {
        let mut bytes = Cursor::new(Vec::new());
        image::Rgb32FImage::new(8, 8).write_to(&mut bytes, ImageFormat::OpenExr).unwrap();
        let decoded = |available: u64| {
            let available = Available { bytes: available, source: "a test".to_owned() };
            SkyPicture::decoded(bytes.get_ref(), &available).map(|file| file.size)
        };
        assert_eq!(decoded(40 * 64), Ok([8, 8]));
        let message = decoded(40 * 64 - 1).unwrap_err();
        let expected = "is too large (decoding it needs about 2.6 kB of memory (40 B x 8 x 8 texels";
        assert!(message.starts_with(expected), "{message}");
    }

    #[test]
    fn a_picture_has_at_most_8192_texels_in_each_direction() {
        let available = Available { bytes: 1 << 30, source: "a test".to_owned() };
        let message = |[width, height]: [u32; 2]| {
            let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
            SkyPicture::decoded(header.as_bytes(), &available).unwrap_err()
        };
        for [width, height] in [[8193, 1], [1, 8193]] {
            let expected = format!("has {width} x {height} texels; expected 1 to 8192 in each direction");
            assert_eq!(message([width, height]), expected);
        }
        // The header has an allowed size, but no texels follow.
        for size in [[8192, 1], [1, 8192]] {
            assert!(message(size).starts_with("cannot be decoded"), "{}", message(size));
        }
    }

    #[test]
    fn a_strength_multiplies_texels_and_the_first_one_that_is_too_bright_is_reported() {
        let file = FileTexels::of([2, 2], vec![[1.0, 2.0, 3.0], [0.0; 3], [0.5; 3], [4.0, 0.0, 0.0]]);
        let doubled = SkyPicture::strengthened(&file, 2.0, 8.0).unwrap();
        assert_eq!(doubled.texels[0], [2.0, 4.0, 6.0]);
        assert_eq!(SkyPicture::strengthened(&file, 1.0, 4.0).unwrap(), file);
        let message = SkyPicture::strengthened(&file, 2.0, 7.0).unwrap_err();
        assert!(message.starts_with("has a value of [8.0, 0.0, 0.0] in column 1, row 1"), "{message}");
    }

    #[test]
    fn alpha_and_bytes_after_the_last_row_are_remarked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        let remarks = |alpha: [f32; 2]| {
            let texels = alpha.map(|alpha| [1.0, 2.0, 3.0, alpha]).concat();
            image::Rgba32FImage::from_vec(2, 1, texels).unwrap().save(&path).unwrap();
            let read = SkyPicture::read(&path).unwrap();
            assert_eq!((&*read.texels, read.unread.len()), (&[[1.0, 2.0, 3.0]; 2][..], 0));
            read.remarks
        };
        assert_eq!(remarks([1.0, 0.999_999_9]), [""; 0]);
        assert_eq!(remarks([1.0, 0.0]), ["has an alpha other than 1 in 1 texel; alpha is not used"]);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&whole[..], b"abc"].concat()).unwrap();
        let after = "has 3 bytes after its last row, which raycl ignores";
        assert_eq!(SkyPicture::read(&path).unwrap().remarks[1..], [after]);
        let path = folder.path().join("sky.hdr");
        let remarks = |rest: &[u8]| {
            let header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n";
            std::fs::write(&path, [header, &[128, 64, 32, 129].repeat(2)[..], rest].concat()).unwrap();
            SkyPicture::read(&path).unwrap().remarks
        };
        assert_eq!([&b""[..], b" \r\n"].map(remarks), [[""; 0]; 2]);
        assert_eq!(remarks(b"abc"), [after]);
    }

    #[test]
    fn a_picture_that_is_not_twice_as_wide_as_high_is_remarked() {
        for size in [(2, 1), (8192, 4096), (1, 1), (1025, 512), (1023, 512)] {
            assert_eq!(stretched(size), None, "{size:?}");
        }
        let start = "has 4 x 4 texels, but is used as an equirectangular picture";
        assert!(stretched((4, 4)).is_some_and(|remark| remark.starts_with(start)));
        assert!(stretched((1026, 512)).is_some() && stretched((512, 1024)).is_some());
    }

    #[test]
    fn of_several_texels_that_are_too_bright_the_first_is_reported() {
        let file = FileTexels::of([2, 2], vec![[0.0; 3], [9.0, 0.0, 0.0], [0.0; 3], [8.0, 0.0, 0.0]]);
        let message = SkyPicture::strengthened(&file, 1.0, 7.0).unwrap_err();
        assert!(message.starts_with("has a value of [9.0, 0.0, 0.0] in column 1, row 0"), "{message}");
    }

    #[test]
    fn a_pictures_middle_is_ahead_and_turns_counter_clockwise() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (up, turn_degrees, expected) in [
            (DVec3::Y, 0.0, Vec3::NEG_Z),
            (DVec3::Y, 90.0, Vec3::NEG_X),
            (DVec3::Z, 0.0, Vec3::Y),
            (DVec3::Z, 90.0, Vec3::NEG_X),
            (DVec3::NEG_Z, 0.0, Vec3::Y),
            (DVec3::new(0.0, half, half), 0.0, Vec3::new(0.0, half as f32, -half as f32)),
        ] {
            let middle = SkyPicture::middle(up, turn_degrees);
            assert!(middle.distance(expected) < 1e-6, "{up}, {turn_degrees}: {middle}");
        }
    }

    #[test]
    fn pictures_are_equal_if_their_texels_and_all_else_are() {
        let texels = |value: f32| Arc::from([[value; 3]; 2]);
        let picture = SkyPicture { size: [2, 1], texels: texels(1.0), ahead: Vec3::X, is_seen: true };
        let other = picture.clone();
        assert_eq!(picture, SkyPicture { texels: texels(1.0), ..other.clone() });
        for different in [
            SkyPicture { size: [1, 2], ..other.clone() },
            SkyPicture { ahead: Vec3::Z, ..other.clone() },
            SkyPicture { is_seen: false, ..other.clone() },
            SkyPicture { texels: texels(2.0), ..other },
        ] {
            assert_ne!(picture, different);
        }
    }
}
