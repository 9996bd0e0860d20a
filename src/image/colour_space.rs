//! Finds the colour space that a picture of 8 or 16 bits per channel states.

use super::exif::states_adobe_rgb;
use super::icc::is_srgb;
use super::png_chunks::png_chunks;
use super::stated::{CLOSE, SRGB, is_srgb_gamma};
use super::{bmp, tga};
use image::{ImageDecoder, ImageFormat};

/// Returns the colour space that a picture states, as text for messages; `None` if the picture states sRGB or no colour
/// space.
/// `decoder` is a decoder of the picture.
pub fn other_colour_space(
    bytes: &[u8],
    format: ImageFormat,
    decoder: &mut impl ImageDecoder,
) -> Option<String> {
    let profile = decoder.icc_profile().ok().flatten();
    match (format, profile.as_deref()) {
        (ImageFormat::Png, profile) => of_png(bytes, profile),
        (_, Some(profile)) => (!is_srgb(profile)).then(|| "an ICC profile".to_owned()),
        (ImageFormat::Jpeg, None) => {
            let exif = decoder.exif_metadata().ok().flatten();
            exif.is_some_and(|exif| states_adobe_rgb(&exif)).then(|| "Adobe RGB in Exif".to_owned())
        }
        (ImageFormat::Bmp, None) => bmp::other_space(bytes),
        (ImageFormat::Tga, None) => tga::other_gamma(bytes),
        _ => None,
    }
}

/// Returns the colour space that a PNG states. `profile` is the picture's ICC profile.
fn of_png(bytes: &[u8], profile: Option<&[u8]>) -> Option<String> {
    let other_profile = || (!profile.is_some_and(is_srgb)).then(|| "an ICC profile".to_owned());
    let header: Vec<_> = png_chunks(bytes).take_while(|(kind, ..)| *kind != b"IDAT").collect();
    let chunk = |name: &[u8]| header.iter().find(|(kind, ..)| *kind == name).map(|(_, _, data)| *data);
    // A reader uses the first of these chunks that the picture has: cICP, iCCP, sRGB, or gAMA and cHRM together (PNG,
    // third edition, 4.3).
    if let Some(code) = chunk(b"cICP") {
        // In a cICP chunk, the number of sRGB's primaries is 1, and the number of its transfer function is 13 (ITU-T
        // H.273). The fourth byte is 1 if the channels use the full range of values.
        return (!matches!(code, [1, 13, _, 1])).then(|| format!("cICP {code:?}"));
    }
    if chunk(b"iCCP").is_some() {
        return other_profile();
    }
    if chunk(b"sRGB").is_some() {
        return None;
    }
    chunk(b"gAMA").and_then(other_gamma).or_else(|| chunk(b"cHRM").and_then(other_primaries))
}

fn other_gamma(data: &[u8]) -> Option<String> {
    // A PNG states the reciprocal of gamma, in 100,000ths.
    let gamma = f64::from(u32::from_be_bytes(*data.first_chunk()?)) / 1e5;
    (!is_srgb_gamma(gamma)).then(|| format!("gAMA {gamma}"))
}

/// In a PNG's chunk cHRM, the numbers of white come first; in [`SRGB`], they come last.
fn other_primaries(data: &[u8]) -> Option<String> {
    let usual = SRGB[6..].iter().chain(&SRGB[..6]);
    let stated = data.chunks_exact(4).filter_map(|bytes| bytes.first_chunk());
    let stated: Vec<f32> = stated.map(|bytes| u32::from_be_bytes(*bytes) as f32 / 1e5).collect();
    let is_other = stated.iter().zip(usual).any(|(value, usual)| (value - usual).abs() > CLOSE);
    is_other.then(|| format!("cHRM {stated:?}"))
}

#[cfg(test)]
mod tests {
    use super::super::exif::tests::exif;
    use super::super::tga::tests::tga;
    use super::*;
    use image::codecs::{jpeg::JpegDecoder, tga::TgaDecoder};
    use std::io::Cursor;

    /// The types and the data of chunks.
    type Chunks<'a> = &'a [(&'a [u8], &'a [u8])];

    fn png(chunks: Chunks<'_>) -> Vec<u8> {
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        for (kind, data) in chunks {
            bytes.extend([&(data.len() as u32).to_be_bytes(), *kind, *data, &[0; 4]].concat());
        }
        bytes
    }

    #[test]
    fn a_png_states_its_colour_space_in_one_of_several_chunks() {
        let words = |list: &[u32]| list.iter().flat_map(|word| word.to_be_bytes()).collect::<Vec<u8>>();
        let usual = words(&[31_270, 32_900, 64_000, 33_000, 30_000, 60_000, 15_000, 6_000]);
        let other = words(&[31_270, 32_900, 70_800, 29_200, 17_000, 79_700, 13_100, 4_600]);
        let (linear, curved) = (words(&[100_000]), words(&[45_455]));
        let cases: [(Chunks<'_>, Option<&str>); 10] = [
            (&[], None),
            (&[(b"gAMA", &curved), (b"cHRM", &usual)], None),
            (&[(b"gAMA", &linear)], Some("gAMA 1")),
            (&[(b"sRGB", &[0]), (b"gAMA", &linear)], None),
            (&[(b"cHRM", &other)], Some("cHRM [0.3127, 0.329, 0.708, 0.292, 0.17, 0.797, 0.131, 0.046]")),
            (&[(b"sRGB", &[0]), (b"cICP", &[9, 16, 0, 1])], Some("cICP [9, 16, 0, 1]")),
            (&[(b"cICP", &[1, 13, 0, 1]), (b"gAMA", &linear)], None),
            (&[(b"cICP", &[1, 13, 0, 0])], Some("cICP [1, 13, 0, 0]")),
            (&[(b"iCCP", b"junk"), (b"sRGB", &[0])], Some("an ICC profile")),
            (&[(b"IDAT", &[]), (b"gAMA", &linear)], None),
        ];
        for (chunks, expected) in cases {
            assert_eq!(of_png(&png(chunks), None).as_deref(), expected, "{chunks:?}");
        }
    }

    #[test]
    fn another_picture_states_its_colour_space_in_a_profile_in_exif_or_in_its_header() {
        let mut bytes = Cursor::new(Vec::new());
        let _ = image::RgbImage::new(1, 1).write_to(&mut bytes, ImageFormat::Jpeg);
        let jpeg = bytes.into_inner();
        let with = |segments: &[&[u8]]| {
            let segment = |data: &&[u8]| [&[0, data.len() as u8 + 2], *data].concat();
            let segments =
                segments.iter().flat_map(|data| [vec![0xff, data[0]], segment(&&data[1..])].concat());
            [&jpeg[..2], &segments.collect::<Vec<_>>(), &jpeg[2..]].concat()
        };
        let stated = |bytes: &[u8]| {
            let mut decoder = JpegDecoder::new(Cursor::new(bytes)).ok()?;
            other_colour_space(bytes, ImageFormat::Jpeg, &mut decoder)
        };
        let adobe = [&b"\xe1Exif\0\0"[..], &exif(false, 2, b"R03\0")].concat();
        let usual = [&b"\xe1Exif\0\0"[..], &exif(false, 1, b"R98\0")].concat();
        let profile = b"\xe2ICC_PROFILE\0\x01\x01junk";
        assert_eq!([stated(&jpeg), stated(&with(&[&usual]))], [None, None]);
        assert_eq!(stated(&with(&[&adobe])).as_deref(), Some("Adobe RGB in Exif"));
        assert_eq!(stated(&with(&[&adobe, profile])).as_deref(), Some("an ICC profile"));
        let tga = tga([0; 4], [10, 10], 3);
        let mut decoder = TgaDecoder::new(Cursor::new(&tga)).ok();
        let stated = decoder.as_mut().and_then(|decoder| other_colour_space(&tga, ImageFormat::Tga, decoder));
        assert_eq!(stated.as_deref(), Some("gamma 1.00"));
    }

    #[test]
    fn a_bmp_states_its_colour_space_in_its_header() {
        let mut bmp = [0; 140];
        (bmp[14], bmp[14 + 98]) = (108, 1);
        // The decoder of any picture without a profile will do.
        let tga = tga([0; 4], [0; 2], 3);
        let mut decoder = TgaDecoder::new(Cursor::new(&tga)).ok();
        let stated = decoder.as_mut().and_then(|decoder| other_colour_space(&bmp, ImageFormat::Bmp, decoder));
        assert_eq!(stated.as_deref(), Some("gamma 1.00"));
    }
}
