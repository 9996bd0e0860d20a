//! Reads textures from picture files.

use super::unused_parts::{Part, UnusedParts};
use crate::image::{
    TGA_FOOTER, TgaAlpha, decoder_message, has_alpha_bits, has_fourth_channel, is_animated, is_damaged,
    other_colour_space, picture_reader,
};
use crate::memory::Available;
use crate::reader::{self, Kind};
use crate::scene::obj::{Reach, quoted_name};
use crate::scene::{Texture, Wrap};
use image::{DynamicImage, ImageDecoder, ImageFormat, Limits};
use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest width and height of a texture in texels.
const MOST_ACROSS: u32 = 1 << 14;
/// Largest total number of texels in the pictures of a mesh's textures; this many texels take 1 GiB.
const MOST_TEXELS: usize = 1 << 28;
/// Largest memory for decoding a picture, in bytes: enough for the largest picture with 16 bits per channel.
const DECODING_BYTES: u64 = 8 * (MOST_ACROSS as u64) * (MOST_ACROSS as u64);
/// The supported formats. The first bytes of a file show its format, except for TGA, which has no typical first
/// bytes. A file whose first bytes are of no known format counts as a TGA if it has the footer or the extension of a
/// TGA.
const FORMATS: [ImageFormat; 4] = [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::Tga];

/// Alphas that are clearly neither transparent nor opaque.
const PARTIAL_ALPHAS: RangeInclusive<u32> = 16..=239;
/// A mask counts as translucent if more than one in `LEAST_SHARE` of its texels lies in a square (see [`SQUARE`]) whose
/// texels are all neither transparent nor opaque.
const LEAST_SHARE: usize = 20;
/// To find translucent masks, raycl divides a mask into squares. A square's side in texels is the larger of two
/// numbers: the first element of `SQUARE`, and the shorter side of the picture divided by the second element. Squares
/// are wider than the soft edges of ordinary masks.
const SQUARE: [usize; 2] = [8, 64];

/// A result whose error continues a message that begins with the picture's name.
type Parsed<T> = std::result::Result<T, String>;

/// A picture's width and height in texels, its texels, and the parts of the picture that are not used. With each part
/// is a text for messages, such as `gAMA 1`; the text may be empty.
type Decoded = ([u32; 2], Arc<[u32]>, Vec<(Part, String)>);

/// How a mesh uses a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::scene) struct Usage {
    pub wrap: [Wrap; 2],
    /// The smallest alpha of a point that is not in a hole, in 65535ths; 0 if the picture is not a mask.
    pub least_alpha: u16,
}

impl Usage {
    /// Returns the usage of a picture that gives surfaces their colour.
    pub fn colour(wrap: [Wrap; 2]) -> Self {
        Self { wrap, least_alpha: 0 }
    }

    /// Returns the usage of a picture that is a mask: surfaces have holes where the picture's alpha is less
    /// than `least_alpha`, a number from 0 to 1.
    pub fn mask(wrap: [Wrap; 2], least_alpha: f32) -> Self {
        Self { wrap, least_alpha: (least_alpha * f32::from(u16::MAX)).round() as u16 }
    }
}

/// The textures of a mesh. A picture is decoded once, even if several textures use it.
#[derive(Default)]
pub(in crate::scene) struct Pictures {
    pub list: Vec<Texture>,
    /// The decoded pictures, and the reasons why pictures cannot be used.
    decoded: HashMap<PathBuf, Parsed<Decoded>>,
    /// The index in `list` of each texture, by picture and usage.
    known: HashMap<(PathBuf, Usage), u32>,
    /// For textures in `list`, by their indices: true if a texel of the texture is not opaque or, for a mask, if the
    /// mask is translucent (see [`is_translucent`]).
    alphas: HashMap<u32, bool>,
    /// The number of texels of all pictures in `decoded`. Textures of the same picture share its texels, except masks
    /// whose alpha is made from brightness; the texels of such masks are not counted.
    texels: usize,
    unused: UnusedParts,
}

impl Pictures {
    /// Returns the index in `list` of the texture with this picture file and usage. Adds the texture if it is
    /// not in the list.
    pub fn file(&mut self, reach: Reach<'_>, name: &str, usage: Usage) -> Parsed<u32> {
        let path = reach.locate(name)?;
        let picture = || {
            let bytes =
                reader::bytes(&path, Kind::Texture).map_err(|error| format!("cannot be read ({error})"))?;
            decoded(&bytes, ImageFormat::from_path(&path).ok())
        };
        self.texture(path.clone(), &quoted_name(name), usage, picture)
    }

    /// Does the same as [`Self::file`] for a picture without a file of its own: its bytes are in the mesh file or in a
    /// glTF buffer. `key` identifies the picture within the mesh file. `bytes` returns the bytes, and is called only if
    /// the picture is not decoded yet.
    pub fn bytes<'a>(
        &mut self,
        key: &str,
        bytes: impl FnOnce() -> Parsed<Cow<'a, [u8]>>,
        usage: Usage,
    ) -> Parsed<u32> {
        // The picture's key becomes a relative path, so it differs from every path that `Reach::locate`
        // returns: those paths are absolute.
        let name = format!("image {key}");
        let key = Path::new("in the file").join(key);
        self.texture(key, &name, usage, || decoded(&bytes()?, None))
    }

    /// Returns the index in `list` of the texture with this picture and usage. `key` identifies the picture,
    /// which `picture` decodes if it is not decoded yet. `name` is the picture's name in messages.
    fn texture(
        &mut self,
        key: PathBuf,
        name: &str,
        usage: Usage,
        picture: impl FnOnce() -> Parsed<Decoded>,
    ) -> Parsed<u32> {
        if let Some(number) = self.known.get(&(key.clone(), usage)) {
            return Ok(*number);
        }
        let sum = &mut self.texels;
        let picture = || picture().and_then(|picture| within_limit(picture, sum));
        let (size, texels, unused) = self.decoded.entry(key.clone()).or_insert_with(picture).clone()?;
        unused.iter().for_each(|(part, stated)| self.unused.add(*part, name.to_owned(), stated));
        let number = self.list.len() as u32;
        self.list.push(Texture { size, wrap: usage.wrap, least_alpha: usage.least_alpha, texels });
        self.known.insert((key, usage), number);
        Ok(number)
    }

    /// Records that the alpha of a texture is not used, if a texel is not opaque. `number` is the texture's index in
    /// `list`, and `name` the name of its file.
    pub fn leave_out_alpha(&mut self, number: u32, name: &str) {
        self.leave_out(Part::Alpha, number, name, has_alpha);
    }

    /// If a mask is translucent, records that its partial opacity is not used. `number` is the index of the mask's
    /// texture in `list`, and `name` the name of its file.
    pub fn leave_out_opacity(&mut self, number: u32, name: &str) {
        self.leave_out(Part::Opacity, number, name, is_translucent);
    }

    /// Records that a mask is not used because it is an opaque picture that also gives the surface its colour.
    pub fn leave_out_mask(&mut self, name: &str) {
        self.unused.add(Part::Mask, quoted_name(name), "");
    }

    /// Returns true if all texels of a texture are opaque. `number` is the index in `list` of a texture that gives
    /// surfaces their colour.
    pub fn is_opaque(&mut self, number: u32) -> bool {
        !self.has(has_alpha, number)
    }

    fn leave_out(&mut self, part: Part, number: u32, name: &str, has_part: fn(&Texture) -> bool) {
        if self.has(has_part, number) {
            self.unused.add(part, quoted_name(name), "");
        }
    }

    /// Returns `has_part` of a texture. Many materials may use the same texture, and looking at all texels takes time,
    /// so a texture is looked at once.
    fn has(&mut self, has_part: fn(&Texture) -> bool, number: u32) -> bool {
        *self.alphas.entry(number).or_insert_with(|| has_part(&self.list[number as usize]))
    }

    /// Returns notes on the parts of pictures that are not used, except the parts `unnoted`. If `quotes` is true, the
    /// notes name a picture.
    pub fn notes(&self, quotes: bool, unnoted: &[Part]) -> impl Iterator<Item = String> {
        self.unused.notes(quotes, unnoted)
    }
}

/// Returns true if a texel of a texture is not opaque.
fn has_alpha(texture: &Texture) -> bool {
    texture.texels.iter().any(|texel| texel >> 24 < 255)
}

/// Returns true if many texels of a mask are neither transparent nor opaque. The mask is divided into squares. A texel
/// counts only if all texels of its square are neither transparent nor opaque, so the soft edges of opaque parts do not
/// count.
fn is_translucent(texture: &Texture) -> bool {
    let [width, height] = texture.size.map(|side| side as usize);
    let side = SQUARE[0].max(width.min(height) / SQUARE[1]);
    let [across, down] = [width, height].map(|length| side.min(length));
    let is_partial = |texel: &u32| PARTIAL_ALPHAS.contains(&(texel >> 24));
    let is_square = |rows: &[u32], left: usize| {
        rows.chunks_exact(width).all(|row| row[left..left + across].iter().all(is_partial))
    };
    let of_rows = |rows| (0..=width - across).step_by(across).filter(|left| is_square(rows, *left)).count();
    let squares: usize = texture.texels.chunks_exact(down * width).map(of_rows).sum();
    LEAST_SHARE * squares * across * down > width * height
}

/// Adds the number of a picture's texels to `sum`, which is the number of texels of all earlier pictures. Returns an
/// error, and leaves `sum` unchanged, if the pictures together have too many texels.
fn within_limit(picture: Decoded, sum: &mut usize) -> Parsed<Decoded> {
    let all = *sum + picture.1.len();
    if all > MOST_TEXELS {
        return Err(format!(
            "makes the textures of the mesh too large: all together may have at most {MOST_TEXELS} texels"
        ));
    }
    *sum = all;
    Ok(picture)
}

/// Sets the alpha of each texel to the texel's brightness, unless some texels are already transparent.
pub(in crate::scene) fn brightness_to_alpha(texture: &mut Texture) {
    if has_alpha(texture) {
        return;
    }
    let with_alpha = |texel: &u32| {
        let [red, green, blue, _] = texel.to_le_bytes();
        // This is the luma (the brightness) that Rec. 709 defines, with weights in 256ths.
        let luma = (54 * u32::from(red) + 183 * u32::from(green) + 19 * u32::from(blue)) >> 8;
        texel & 0x00ff_ffff | luma << 24
    };
    texture.texels = texture.texels.iter().map(with_alpha).collect();
}

/// Decodes a picture. `ending` is the format for which the extension of the picture's file stands; `None` if
/// the extension is unknown or missing.
fn decoded(bytes: &[u8], ending: Option<ImageFormat>) -> Parsed<Decoded> {
    let is_tga = ending == Some(ImageFormat::Tga) || bytes.ends_with(TGA_FOOTER);
    let format = image::guess_format(bytes).ok().or(is_tga.then_some(ImageFormat::Tga));
    let format = format.ok_or(
        "is not a PNG, JPEG, BMP or TGA (a TGA without a footer is recognised only if its name ends in .tga)",
    )?;
    if !FORMATS.contains(&format) {
        return Err("is not a PNG, JPEG, BMP or TGA".to_owned());
    }
    // On an idle core, the check takes no time: it ends before the decoder.
    let is_jpeg = format == ImageFormat::Jpeg;
    let (picture, has_damage) = rayon::join(|| decoded_as(bytes, format), || is_jpeg && is_damaged(bytes));
    let (size, texels, mut unused) = picture?;
    unused.extend(has_damage.then(|| (Part::Data, String::new())));
    Ok((size, texels, unused))
}

/// Decodes a picture of this format.
fn decoded_as(bytes: &[u8], format: ImageFormat) -> Parsed<Decoded> {
    let damaged = |why: String| format!("cannot be decoded ({why})");
    let mut reader = picture_reader(bytes, Some(format)).map_err(damaged)?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(DECODING_BYTES);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(decoder_message).map_err(damaged)?;
    let size = decoder.dimensions();
    let (width, height) = size;
    if width == 0 || height == 0 || width.max(height) > MOST_ACROSS {
        return Err(format!("has {width} x {height} texels; expected 1 to {MOST_ACROSS} in each direction"));
    }
    // A decoded texel takes at most 8 bytes. The conversion to four channels of 8 bits takes at most another
    // 8 bytes.
    room_for(size, 16, &Available::read())?;
    let unused = unused_parts(bytes, format, &mut decoder);
    let picture = DynamicImage::from_decoder(decoder).map_err(decoder_message).map_err(damaged)?;
    let texels = words(&picture);
    let texels = if format == ImageFormat::Tga { with_tga_alpha(bytes, texels) } else { texels };
    Ok(([width, height], texels, unused))
}

/// Returns the texels of a TGA with the alpha that the file states.
fn with_tga_alpha(bytes: &[u8], texels: Arc<[u32]>) -> Arc<[u32]> {
    match TgaAlpha::of(bytes) {
        TgaAlpha::Straight if !has_unused_alpha(bytes, &texels) => texels,
        TgaAlpha::Premultiplied => texels.iter().map(|texel| divided_by_alpha(*texel)).collect(),
        TgaAlpha::Straight | TgaAlpha::Undefined => texels.iter().map(|texel| texel | 0xff00_0000).collect(),
    }
}

/// Returns a texel whose colours are not multiplied by alpha, from a texel whose colours are.
fn divided_by_alpha(texel: u32) -> u32 {
    let [colours @ .., alpha] = texel.to_le_bytes();
    let whole = u32::from(alpha).max(1);
    let [red, green, blue] =
        colours.map(|value| ((u32::from(value) * 255 + whole / 2) / whole).min(255) as u8);
    u32::from_le_bytes([red, green, blue, alpha])
}

/// Returns the parts of a picture that are not used, each with a text for messages (see [`Decoded`]).
fn unused_parts(bytes: &[u8], format: ImageFormat, decoder: &mut impl ImageDecoder) -> Vec<(Part, String)> {
    let space = other_colour_space(bytes, format, decoder).map(|space| (Part::ColourSpace, space));
    let orientation = decoder.orientation().map_or(1, |orientation| orientation.to_exif());
    let turned = (orientation != 1).then(|| (Part::Orientation, format!("Exif {orientation}")));
    let animated = format == ImageFormat::Png && is_animated(bytes);
    let animated = animated.then(|| (Part::Animation, String::new()));
    let fourth = match format {
        ImageFormat::Bmp => !decoder.color_type().has_alpha() && has_fourth_channel(bytes),
        _ => format == ImageFormat::Tga && has_alpha_bits(bytes),
    };
    let fourth = fourth.then(|| (Part::FourthChannel, String::new()));
    space.into_iter().chain(turned).chain(animated).chain(fourth).collect()
}

/// Refuses a picture of this width and height if decoding it needs more memory than is available.
/// `texel_bytes` is the memory for one texel.
pub(in crate::scene) fn room_for(
    (width, height): (u32, u32),
    texel_bytes: u64,
    available: &Available,
) -> Parsed<()> {
    let needed = texel_bytes * u64::from(width) * u64::from(height);
    let sum = format!("{texel_bytes} B x {width} x {height} texels");
    available.hold(needed, "decoding it", &sum).map_err(|error| format!("is too large ({error})"))
}

/// Returns true if a TGA has 32 bits per texel, but does not use any of them for alpha: its header states 0
/// bits of alpha, and all of its texels have an alpha of 0. Some programs write the alpha of a picture, but
/// state 0 bits; the alpha of such a picture is used.
fn has_unused_alpha(bytes: &[u8], texels: &[u32]) -> bool {
    let states_none = matches!(bytes.get(16..18), Some([32, description]) if description & 15 == 0);
    states_none && texels.iter().all(|texel| texel >> 24 == 0)
}

fn words(picture: &DynamicImage) -> Arc<[u32]> {
    picture.to_rgba8().pixels().map(|pixel| u32::from_le_bytes(pixel.0)).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::image::tga as tga_file;
    use crate::scene::obj::Permitted;
    use std::io::Cursor;

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
        let reach = Reach {
            folder: folder.path(),
            permitted: Permitted { beyond: false, quotes: true, scaled: false },
        };
        let mut pictures = Pictures::default();
        let [repeat, clamp] = [Wrap::Repeat, Wrap::Clamp].map(|wrap| Usage::colour([wrap; 2]));
        assert_eq!(pictures.file(reach, "a.png", repeat), Ok(0));
        assert_eq!(pictures.file(reach, "./a.png", repeat), Ok(0));
        assert_eq!(pictures.file(reach, "a.png", clamp), Ok(1));
        assert_eq!((pictures.list[0].size, pictures.list[0].least_alpha), ([3, 2], 0));
        assert_eq!(pictures.list[0].texels[4], 0xff07_0101);
        assert!(Arc::ptr_eq(&pictures.list[0].texels, &pictures.list[1].texels));
        let mask = Usage::mask(repeat.wrap, 0.5);
        assert_eq!((pictures.file(reach, "a.png", mask), pictures.list[2].least_alpha), (Ok(2), 0x8000));
    }

    #[test]
    fn a_picture_in_the_mesh_file_is_decoded_once_however_often_it_is_used_and_even_if_it_is_damaged() {
        let mut pictures = Pictures::default();
        let [whole, damaged] = [png(3, 2), png(3, 2)[..20].to_vec()];
        let mut calls = 0;
        let mut add = |key: &str, bytes: &[u8], usage| {
            let bytes = || {
                calls += 1;
                Ok(Cow::Borrowed(bytes))
            };
            pictures.bytes(key, bytes, usage)
        };
        let colour = Usage::colour([Wrap::Repeat; 2]);
        let mask = Usage::mask(colour.wrap, 0.5);
        assert_eq!([add("0", &whole, colour), add("0", &whole, mask)], [Ok(0), Ok(1)]);
        assert_eq!(add("0", &whole, colour), Ok(0));
        let errors = [add("1", &damaged, colour), add("1", &damaged, mask)].map(Result::unwrap_err);
        assert!(errors[0].contains("cannot be decoded") && errors[0] == errors[1], "{errors:?}");
        assert_eq!(calls, 2, "each picture is decoded once");
        assert!(Arc::ptr_eq(&pictures.list[0].texels, &pictures.list[1].texels));
    }

    #[test]
    fn what_a_picture_states_in_vain_is_noted_once_with_its_name() {
        let mut pictures = Pictures::default();
        let plain = png(3, 2);
        let with = |kind: &[u8], data: &[u8]| {
            // The signature of a PNG and its first chunk, IHDR, take 33 bytes. The new chunk follows them.
            let mut sum = flate2::Crc::new();
            [kind, data].iter().for_each(|bytes| sum.update(bytes));
            let length = (data.len() as u32).to_be_bytes();
            [&plain[..33], &length, kind, data, &sum.sum().to_be_bytes(), &plain[33..]].concat()
        };
        let exif = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0";
        let files = [
            with(b"gAMA", &100_000_u32.to_be_bytes()),
            with(b"eXIf", exif),
            with(b"acTL", &[0, 0, 0, 1, 0, 0, 0, 0]),
            plain.clone(),
        ];
        for (key, bytes) in files.iter().enumerate() {
            for usage in [Usage::colour([Wrap::Repeat; 2]), Usage::colour([Wrap::Clamp; 2])] {
                pictures.bytes(&key.to_string(), || Ok(Cow::Borrowed(bytes)), usage).unwrap();
            }
        }
        let expected = [
            "colour space of 1 texture is not used (image 0: gAMA 1): values are read as sRGB",
            "orientation of 1 texture is not used (image 1: Exif 3): the picture is neither turned nor mirrored",
            "animation of 1 texture is not used (image 2): only one picture is shown",
        ];
        assert_eq!(pictures.notes(true, &[]).collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_texture_that_makes_all_textures_together_too_large_is_refused() {
        let colour = Usage::colour([Wrap::Repeat; 2]);
        // A picture of 3 x 2 texels is added.
        let added = |texels| {
            let mut pictures = Pictures { texels, ..Pictures::default() };
            pictures.bytes("0", || Ok(Cow::Owned(png(3, 2))), colour)
        };
        assert_eq!(added(MOST_TEXELS - 6), Ok(0));
        let message = added(MOST_TEXELS - 5).unwrap_err();
        let expected =
            "makes the textures of the mesh too large: all together may have at most 268435456 texels";
        assert_eq!(message, expected);
    }

    #[test]
    fn a_picture_of_several_textures_counts_once() {
        let colour = Usage::colour([Wrap::Repeat; 2]);
        // There is room for one picture of 3 x 2 texels.
        let mut pictures = Pictures { texels: MOST_TEXELS - 6, ..Pictures::default() };
        let mut added = |usage| pictures.bytes("0", || Ok(Cow::Owned(png(3, 2))), usage);
        assert_eq!([added(colour), added(Usage::mask(colour.wrap, 0.5))], [Ok(0), Ok(1)]);
    }

    #[test]
    fn a_texture_that_was_refused_takes_no_room_from_others() {
        let colour = Usage::colour([Wrap::Repeat; 2]);
        // There is room for five texels.
        let mut pictures = Pictures { texels: MOST_TEXELS - 5, ..Pictures::default() };
        let mut added = |key: &str, width: u32| {
            pictures.bytes(key, || Ok(Cow::Owned(png(width, 1))), colour).map_err(|_| "too large")
        };
        let of = [("a", 6), ("b", 3), ("c", 3), ("d", 2), ("e", 1)].map(|(key, width)| added(key, width));
        let refused = Err("too large");
        assert_eq!(of, [refused, Ok(0), refused, Ok(1), refused]);
    }

    #[test]
    fn an_opaque_mask_is_where_it_is_bright() {
        let texture = |texels: [u32; 2]| Texture {
            size: [2, 1],
            wrap: [Wrap::Repeat; 2],
            least_alpha: 0x8000,
            texels: Arc::from(texels),
        };
        let masked = |texels| {
            let mut texture = texture(texels);
            brightness_to_alpha(&mut texture);
            [texture.texels[0], texture.texels[1]]
        };
        assert_eq!(masked([0xffff_ffff, 0xff00_0000]), [0xffff_ffff, 0]);
        assert_eq!(masked([0xff80_8080, 0xff00_00ff]), [0x8080_8080, 0x3500_00ff]);
        assert_eq!(masked([0xffff_ffff, 0x7f00_0000]), [0xffff_ffff, 0x7f00_0000]);
    }

    #[test]
    fn a_mask_is_translucent_if_its_areas_are_and_not_if_only_its_edges_are() {
        let is_translucent = |size: [u32; 2], alpha: fn(u32) -> u32| {
            let texels = (0..size[0] * size[1]).map(|texel| alpha(texel % size[0]) << 24).collect();
            is_translucent(&Texture { size, wrap: [Wrap::Repeat; 2], least_alpha: 0x8000, texels })
        };
        // Edges of 6 texels, areas of 20, and edges of 12 in a picture with squares of 16.
        fn part(x: u32, of: u32, width: u32) -> u32 {
            if x % of < width { 128 } else { 255 }
        }
        assert_eq!([16, 17].map(|side| is_translucent([side; 2], |x| part(x, 16, 6))), [false; 2]);
        assert!(is_translucent([64; 2], |x| part(x, 32, 20)));
        assert!(!is_translucent([1024; 2], |x| part(x, 64, 12)));
        assert!(is_translucent([1, 1], |_| 160) && is_translucent([256, 1], |x| x));
        assert!(![15, 240].map(|_| is_translucent([4, 4], |x| [15, 240][x as usize % 2])).contains(&true));
        // A hundredth of the texels, all side by side.
        assert!(!is_translucent([1000, 3], |x| if x < 10 { 128 } else { 255 }));
    }

    #[test]
    fn what_is_no_picture_or_too_large_is_refused() {
        assert!(decoded(b"nothing", None).unwrap_err().contains("not a PNG"));
        assert!(decoded(&png(2, 2)[..20], None).unwrap_err().contains("cannot be decoded"));
        let mut huge = png(2, 2);
        // Bytes 16 to 19 of a PNG file contain the picture's width.
        huge[16..20].copy_from_slice(&40_000_u32.to_be_bytes());
        assert!(decoded(&huge, None).is_err());
        assert!(decoded(b"#?RADIANCE\n", None).unwrap_err().contains("not a PNG"));
    }

    #[test]
    fn a_damaged_picture_is_reported_in_one_line_without_debug_output() {
        let mut jpeg = Vec::new();
        let picture = image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([x as u8, y as u8, 7]));
        picture.write_to(&mut Cursor::new(&mut jpeg), ImageFormat::Jpeg).unwrap();
        assert_eq!(decoded(&jpeg, None).unwrap().0, [64, 64]);
        let end_first = &b"\x89PNG\r\n\x1a\n\0\0\0\0IEND\xaeB`\x82"[..];
        for (bytes, why) in [
            (crate::image::ODD_PALETTE, "its palette has 4 bytes; expected a multiple of 3"),
            (&jpeg[..jpeg.len() / 2], "the file ends before the picture is complete"),
            (end_first, "Format error decoding Png: IEND chunk appeared before IHDR chunk"),
        ] {
            assert_eq!(decoded(bytes, None).unwrap_err(), format!("cannot be decoded ({why})"));
        }
    }

    /// Returns the beginning of a TGA of this size: 24 bits per texel, without a palette.
    fn tga(width: u16, height: u16) -> Vec<u8> {
        let size = [width.to_le_bytes(), height.to_le_bytes()].concat();
        [&[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &size, &[24, 0]].concat()
    }

    /// `description` is the header's byte that states the number of bits of alpha. `alpha` is the second texel's
    /// alpha; the first texel's alpha is 0.
    #[test]
    fn a_tga_whose_alpha_is_unused_is_opaque() {
        let texels = |description: u8, alpha: u8| {
            let mut header = tga(2, 1);
            (header[16], header[17]) = (32, description);
            let bytes = [header, vec![1, 2, 3, 0, 4, 5, 6, alpha]].concat();
            decoded(&bytes, Some(ImageFormat::Tga)).unwrap().1.to_vec()
        };
        assert_eq!(texels(0, 0), [0xff01_0203, 0xff04_0506]);
        assert_eq!(texels(0, 9), [0x0001_0203, 0x0904_0506]);
        assert_eq!(texels(8, 0), [0x0001_0203, 0x0004_0506]);
    }

    #[test]
    fn a_tga_is_read_as_its_extension_area_says() {
        let texel =
            |attributes| decoded(&tga_file([10, 20, 100, 50], [0; 2], attributes), None).unwrap().1[0];
        assert_eq!([3, 1, 4].map(texel), [0x320a_1464, 0xff0a_1464, 0x3233_66ff]);
    }

    #[test]
    fn bytes_that_are_not_used_are_noted() {
        let mut bytes = Cursor::new(Vec::new());
        image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([0, 0, 0, 90 * x as u8]))
            .write_to(&mut bytes, ImageFormat::Bmp)
            .unwrap();
        let mut bmp = bytes.into_inner();
        // A BMP with bit masks has alpha. Without masks (compression 0), the bytes are reserved.
        assert_eq!(decoded(&bmp, None).unwrap().2, []);
        bmp[30..34].fill(0);
        let mut tga = [tga(2, 1), vec![0, 0, 0, 0x80]].concat();
        (tga[16], tga[17]) = (16, 1);
        for bytes in [bmp, tga] {
            let unused = decoded(&bytes, Some(ImageFormat::Tga)).unwrap().2;
            assert_eq!(unused, [(Part::FourthChannel, String::new())]);
        }
    }

    #[test]
    fn bytes_after_the_end_of_a_picture_are_not_noted() {
        let mut jpeg = Cursor::new(Vec::new());
        image::RgbImage::new(2, 1).write_to(&mut jpeg, ImageFormat::Jpeg).unwrap();
        for whole in [png(2, 1), jpeg.into_inner()] {
            for more in [&b"more"[..], &whole] {
                assert_eq!(decoded(&[&whole, more].concat(), None).unwrap().2, []);
            }
        }
    }

    #[test]
    fn a_side_has_at_most_16384_texels() {
        for (width, height) in [(16_385, 2), (2, 16_385)] {
            let error = decoded(&tga(width, height), Some(ImageFormat::Tga)).unwrap_err();
            let expected = format!("has {width} x {height} texels; expected 1 to 16384 in each direction");
            assert_eq!(error, expected);
        }
    }

    #[test]
    fn a_tga_is_recognised_by_its_name_or_its_footer() {
        let older = [tga(2, 1), vec![1, 2, 3, 4, 5, 6]].concat();
        assert_eq!(decoded(&older, Some(ImageFormat::Tga)).unwrap().0, [2, 1]);
        // The footer of version 2 begins with two offsets, which are 0 here.
        let newer = [&older[..], &[0; 8], TGA_FOOTER].concat();
        for ending in [None, Some(ImageFormat::Png)] {
            let expected = "is not a PNG, JPEG, BMP or TGA (a TGA without a footer is recognised only if its name \
                            ends in .tga)";
            assert_eq!(decoded(&older, ending).unwrap_err(), expected);
            assert_eq!(decoded(&newer, ending).unwrap().0, [2, 1]);
        }
        let gif = decoded(b"GIF89a", Some(ImageFormat::Tga)).unwrap_err();
        assert_eq!(gif, "is not a PNG, JPEG, BMP or TGA", "its first bytes are those of another format");
    }

    #[test]
    fn a_tga_file_without_a_footer_is_recognised_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let texels = [tga(2, 1), vec![1, 2, 3, 4, 5, 6]].concat();
        std::fs::write(folder.path().join("a.tga"), texels).unwrap();
        let permitted = Permitted { beyond: false, quotes: true, scaled: false };
        let reach = Reach { folder: folder.path(), permitted };
        let mut pictures = Pictures::default();
        assert_eq!(pictures.file(reach, "a.tga", Usage::colour([Wrap::Repeat; 2])), Ok(0));
        assert_eq!(pictures.list[0].size, [2, 1]);
    }

    #[test]
    fn a_picture_that_is_cut_off_is_called_so_in_every_format() {
        let picture = image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([x as u8, y as u8, 7]));
        for format in [ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::Tga] {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, format).unwrap();
            let (bytes, ending) = (bytes.into_inner(), Some(format));
            assert_eq!(decoded(&bytes, ending).unwrap().0, [64, 64]);
            let error = decoded(&bytes[..bytes.len() / 2], ending).unwrap_err();
            assert_eq!(
                error, "cannot be decoded (the file ends before the picture is complete)",
                "{format:?}"
            );
        }
    }

    #[test]
    fn colours_divided_by_alpha_are_rounded_and_clear_texels_stay() {
        let divided = |bytes| divided_by_alpha(u32::from_le_bytes(bytes)).to_le_bytes();
        assert_eq!([divided([1, 0, 0, 2]), divided([0; 4])], [[128, 0, 0, 2], [0; 4]]);
    }

    #[test]
    fn a_mask_is_not_translucent_if_only_its_level_edges_are() {
        // Of 32 rows, this many are neither transparent nor opaque.
        let is_translucent = |rows: usize| {
            let texels = (0..32 * 32).map(|texel| if texel / 32 < rows { 128 << 24 } else { 0 }).collect();
            is_translucent(&Texture { size: [32; 2], wrap: [Wrap::Repeat; 2], least_alpha: 0x8000, texels })
        };
        assert_eq!([7, 8].map(is_translucent), [false, true]);
    }

    #[test]
    fn damaged_data_of_a_jpeg_are_noted() {
        let mut bytes = Cursor::new(Vec::new());
        let pixel = |x: u32, y: u32| image::Rgb([(x * 7) as u8, (y * 5) as u8, (x * y) as u8]);
        image::RgbImage::from_fn(40, 30, pixel).write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        let whole = bytes.into_inner();
        assert_eq!(decoded(&whole, None).unwrap().2, []);
        let cut = [&whole[..whole.len() - 100], &[0xff, 0xd9]].concat();
        assert_eq!(decoded(&cut, None).unwrap().2, [(Part::Data, String::new())]);
    }
}
