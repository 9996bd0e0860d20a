//! Compares the header of a Radiance HDR or OpenEXR picture with what raycl assumes about the picture's
//! channels, colours, projection and the shape of its pixels.

use crate::words::eight;
use exr::meta::MetaData;
use exr::meta::attribute::{Chromaticities, EnvironmentMap, Text};
use exr::meta::header::Header;
use image::codecs::hdr::{HdrDecoder, HdrMetadata};
use std::io::Cursor;

/// The chromaticities (x and y in the CIE 1931 diagram) of sRGB's red, green, blue and white.
pub(super) const SRGB: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
/// raycl treats chromaticities as sRGB's if each of the eight numbers differs from sRGB's by at most `CLOSE`. This
/// tolerance is large enough for the chromaticities that the program Radiance assumes.
pub(super) const CLOSE: f32 = 0.03;
/// The exponent of the power that is nearly equal to sRGB's curve.
const GAMMA: f64 = 2.2;
/// raycl treats a gamma as sRGB's if the gamma differs from [`GAMMA`] by at most the fraction `CLOSE_GAMMA` of
/// [`GAMMA`].
const CLOSE_GAMMA: f64 = 0.05;
/// The channels of an OpenEXR picture that the decoder reads.
const READ: [&str; 4] = ["R", "G", "B", "A"];

/// Returns true if a gamma is nearly sRGB's. Some programs state the reciprocal.
pub(super) fn is_srgb_gamma(gamma: f64) -> bool {
    [gamma, 1.0 / gamma].iter().any(|gamma| (gamma / GAMMA - 1.0).abs() <= CLOSE_GAMMA)
}

/// Returns an error if the decoder can read no layer of an OpenEXR picture, because each layer lacks R, G or B, or is
/// deep data. The decoder refuses these pictures, too, but its message does not name the channels that the file has.
/// Pictures in other formats are not checked. The caller puts the file's name before the error's text.
pub fn check_channels(bytes: &[u8]) -> Result<(), String> {
    let headers = exr_headers(bytes);
    if headers.is_empty() || headers.iter().any(is_decoded) {
        return Ok(());
    }
    let channels = headers.iter().flat_map(|header| &header.channels.list);
    let names: Vec<String> = channels.map(|channel| channel.name.to_string()).collect();
    Err(format!(
        "has the channels {}; expected R, G and B, without a layer's name and not as deep data",
        eight(&names)
    ))
}

/// Returns the names of an OpenEXR picture's channels that the decoder does not read. The decoder reads the channels R,
/// G, B and A of one layer. For pictures in other formats, and if the decoder can read no layer, returns no names.
pub fn unread_channels(bytes: &[u8]) -> Vec<String> {
    let headers = exr_headers(bytes);
    let Some(decoded) = headers.iter().position(is_decoded) else { return Vec::new() };
    let names = |(part, header): (usize, &Header)| {
        let layer = header.own_attributes.layer_name.as_ref().filter(|_| part != decoded);
        let layer = layer.map(|name| format!("{name}.")).unwrap_or_default();
        let channels = header.channels.list.iter().map(|channel| channel.name.to_string());
        let unread = channels.filter(|name| part != decoded || !READ.contains(&name.as_str()));
        unread.map(|name| layer.clone() + &name).collect::<Vec<_>>()
    };
    headers.iter().enumerate().flat_map(names).collect()
}

/// Returns remarks on a picture's header: on other primaries or another white than sRGB's, on a cube map, on a pixel
/// aspect ratio other than 1, on a luminance of white, on a GAMMA other than 1 and on a VIEW. The caller
/// puts the file's name before each remark.
pub fn header_remarks(bytes: &[u8]) -> Vec<String> {
    let headers = exr_headers(bytes);
    let header = headers.iter().find(|header| is_decoded(header));
    // If there is no OpenEXR layer that can be decoded, the bytes are read as a Radiance HDR picture. For other
    // pictures, `hdr_primaries` returns `None`.
    let stated = header.map_or_else(|| hdr_primaries(bytes), exr_primaries);
    // Some programs write eight zeros instead of chromaticities. raycl treats such a header as a header without
    // chromaticities.
    let differs = |stated: &[f32; 8]| {
        let is_close = stated.iter().zip(SRGB).all(|(value, usual)| (value - usual).abs() <= CLOSE);
        !is_close && stated.iter().any(|value| *value != 0.0)
    };
    let primaries = stated.filter(differs).map(|[rx, ry, gx, gy, bx, by, wx, wy]| {
        format!(
            "has other primaries or another white than sRGB (red at {rx} {ry}, green at {gx} {gy}, \
             blue at {bx} {by}, white at {wx} {wy}); raycl does not convert its values to sRGB, so its colours differ \
             from the intended ones"
        )
    });
    let map = header.and_then(|header| header.own_attributes.environment_map);
    let cube = (map == Some(EnvironmentMap::Cube))
        .then(|| "is a cube map, but is used as an equirectangular picture".to_owned());
    let aspect = header.map_or_else(|| hdr_header(bytes)?.pixel_aspect_ratio, exr_aspect);
    let aspect = aspect
        .filter(|aspect| *aspect != 1.0)
        .map(|aspect| format!("states a pixel aspect ratio of {aspect}, which raycl ignores"));
    let gamma = hdr_gamma(bytes).filter(|gamma| *gamma != 1.0).map(|gamma| {
        format!("states GAMMA={gamma}, which raycl ignores: the picture's values are read as linear light")
    });
    let luminance =
        header.and_then(|header| header.own_attributes.white_luminance).filter(|stated| *stated != 1.0);
    let luminance = luminance.map(|stated| {
        format!(
            "states that white is {stated} cd/m2, which raycl ignores: the picture's values are read as radiance"
        )
    });
    let view = hdr_view(bytes).map(|view| {
        format!("states the projection {view} (in VIEW), but is used as an equirectangular picture")
    });
    let remarks = primaries.into_iter().chain(cube).chain(aspect).chain(luminance);
    remarks.chain(gamma).chain(view).collect()
}

/// Returns the bytes after the last block of an OpenEXR picture; no bytes if the file is damaged, or if its blocks do
/// not follow each other.
pub fn exr_rest(bytes: &[u8]) -> &[u8] {
    let mut source = Cursor::new(bytes);
    let blocks = exr::block::read(&mut source, false).and_then(|reader| reader.all_chunks(false));
    let is_whole = blocks.is_ok_and(|mut blocks| blocks.all(|block| block.is_ok()));
    if is_whole { &bytes[source.position() as usize..] } else { &[] }
}

/// Returns the headers of an OpenEXR picture, one per layer. Returns no header if the bytes are not an
/// OpenEXR file, or are damaged.
fn exr_headers(bytes: &[u8]) -> Vec<Header> {
    MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_or_else(|_| Vec::new(), |data| data.headers.into_vec())
}

/// Returns true if the decoder of the crate `image` can read this layer. The decoder reads a file's first
/// layer for which this function returns true.
fn is_decoded(header: &Header) -> bool {
    let has = |name: &&str| header.channels.find_index_of_channel(&Text::from(*name)).is_some();
    !header.deep && ["R", "G", "B"].iter().all(has)
}

fn exr_aspect(header: &Header) -> Option<f32> {
    Some(header.shared_attributes.pixel_aspect)
}

fn exr_primaries(header: &Header) -> Option<[f32; 8]> {
    let Chromaticities { red, green, blue, white } = header.shared_attributes.chromaticities?;
    Some([red.0, red.1, green.0, green.1, blue.0, blue.1, white.0, white.1])
}

/// Returns the header of a Radiance HDR picture; `None` for other pictures and damaged headers.
fn hdr_header(bytes: &[u8]) -> Option<HdrMetadata> {
    Some(HdrDecoder::new(Cursor::new(bytes)).ok()?.metadata())
}

/// Returns the number of the last line GAMMA in the header of a Radiance HDR picture, which some programs write; `None`
/// if the header has no such line, or if the line has no number.
fn hdr_gamma(bytes: &[u8]) -> Option<f32> {
    let header = hdr_header(bytes)?;
    let (_, text) = header.custom_attributes.iter().rfind(|(key, _)| key == "GAMMA")?;
    text.trim().parse().ok()
}

/// Returns the projection that the last line VIEW in the header of a Radiance HDR picture states, such as `-vta`;
/// `None` if the header has no such line. Radiance has no name for an equirectangular picture, so each stated
/// projection is another one.
fn hdr_view(bytes: &[u8]) -> Option<String> {
    let header = hdr_header(bytes)?;
    let (_, text) = header.custom_attributes.iter().rfind(|(key, _)| key == "VIEW")?;
    text.split_whitespace().find(|option| option.starts_with("-vt")).map(str::to_owned)
}

/// Returns the numbers of the last line PRIMARIES in the header of a Radiance HDR picture; `None` if the
/// header has no such line, or if the line does not consist of eight numbers.
fn hdr_primaries(bytes: &[u8]) -> Option<[f32; 8]> {
    let header = hdr_header(bytes)?;
    let (_, text) = header.custom_attributes.iter().rfind(|(key, _)| key == "PRIMARIES")?;
    let numbers: Vec<f32> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    numbers.try_into().ok()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
        LayerAttributes, SpecificChannels, Vec2, WritableImage as _,
    };

    /// The chromaticities of the film colour space ACES.
    const ACES: [f32; 8] = [0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767];

    fn exr(stated: Option<[f32; 8]>, map: Option<EnvironmentMap>) -> Vec<u8> {
        let grey = |_: Vec2<usize>| (0.5_f32, 0.5_f32, 0.5_f32);
        let mut image = Image::from_channels((4, 2), SpecificChannels::rgb(grey));
        image.attributes.chromaticities = stated.map(|[rx, ry, gx, gy, bx, by, wx, wy]| Chromaticities {
            red: Vec2(rx, ry),
            green: Vec2(gx, gy),
            blue: Vec2(bx, by),
            white: Vec2(wx, wy),
        });
        image.layer_data.attributes.environment_map = map;
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn exr_of_channels(names: &[&str]) -> Vec<u8> {
        let channel = |name: &&str| AnyChannel::new(*name, FlatSamples::F32(vec![0.5; 8]));
        let channels = AnyChannels::sort(names.iter().map(channel).collect());
        let image = Image::from_encoded_channels((4, 2), Encoding::SMALL_LOSSLESS, channels);
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn hdr(lines: &str) -> Vec<u8> {
        let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{lines}\n-Y 1 +X 1\n");
        [header.as_bytes(), &[128, 64, 32, 129]].concat()
    }

    #[test]
    fn other_primaries_than_those_of_srgb_are_remarked() {
        let aces = "PRIMARIES=0.7347 0.2653 0 1 0.0001 -0.077 0.32168 0.33767\n";
        for bytes in [exr(Some(ACES), None), hdr(aces), hdr(&format!("PRIMARIES=0 0 0 0 0 0 0 0\n{aces}"))] {
            let said = header_remarks(&bytes);
            let start = "has other primaries or another white than sRGB (red at 0.7347 0.2653, green at 0 1, \
                         blue at 0.0001 -0.077,";
            assert!(said.len() == 1 && said[0].starts_with(start), "{said:?}");
        }
        let radiance = "PRIMARIES=0.640 0.330 0.290 0.600 0.150 0.060 0.333 0.333\n";
        for lines in ["", radiance, "PRIMARIES=0 0 0 0 0 0 0 0\n", "PRIMARIES=\n", "PRIMARIES=1 2\n"] {
            assert_eq!(header_remarks(&hdr(lines)), [""; 0], "{lines}");
        }
        // Display-P3 (SMPTE EG 432-1) has other primaries than sRGB, but the same white. The second line has the
        // primaries of sRGB with another white, D50 (ICC.1).
        for line in
            ["0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329", "0.64 0.33 0.3 0.6 0.15 0.06 0.3457 0.3585"]
        {
            let said = header_remarks(&hdr(&format!("PRIMARIES={line}\n")));
            assert!(
                said.len() == 1 && said[0].starts_with("has other primaries or another white than sRGB"),
                "{line}: {said:?}"
            );
        }
        assert_eq!(header_remarks(&exr(Some(SRGB), None)), [""; 0]);
        assert_eq!(header_remarks(&exr(None, None)), [""; 0]);
        assert_eq!(header_remarks(b"no picture"), [""; 0]);
    }

    #[test]
    fn a_cube_map_is_remarked() {
        let said = header_remarks(&exr(None, Some(EnvironmentMap::Cube)));
        assert_eq!(said, ["is a cube map, but is used as an equirectangular picture"]);
        assert_eq!(header_remarks(&exr(None, Some(EnvironmentMap::LatitudeLongitude))), [""; 0]);
    }

    #[test]
    fn a_pixel_aspect_ratio_a_gamma_a_view_and_a_luminance_are_remarked() {
        let aspect = "states a pixel aspect ratio of 2, which raycl ignores";
        let gamma = "states GAMMA=2.2, which raycl ignores: the picture's values are read as linear light";
        assert_eq!(header_remarks(&hdr("PIXASPECT=2\n")), [aspect]);
        assert_eq!(header_remarks(&hdr("PIXASPECT=2\nGAMMA= 2.2\n")), [aspect, gamma]);
        assert_eq!(header_remarks(&hdr("PIXASPECT=1\nGAMMA=1.0\n")), [""; 0]);
        let view = "states the projection -vta (in VIEW), but is used as an equirectangular picture";
        assert_eq!(header_remarks(&hdr("VIEW= -vta -vh 180 -vv 180\n")), [view]);
        assert_eq!(header_remarks(&hdr("VIEW= -vh 180 -vv 180\n")), [""; 0]);
        let mut image =
            Image::from_channels((4, 2), SpecificChannels::rgb(|_: Vec2<usize>| (0.5_f32, 0.5_f32, 0.5_f32)));
        image.attributes.pixel_aspect = 2.0;
        image.layer_data.attributes.white_luminance = Some(100.0);
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        let luminance =
            "states that white is 100 cd/m2, which raycl ignores: the picture's values are read as radiance";
        assert_eq!(header_remarks(bytes.get_ref()), [aspect, luminance]);
    }

    #[test]
    fn channels_and_parts_beside_the_colour_are_named() {
        let unread = |names: &[&str]| unread_channels(&exr_of_channels(names));
        assert_eq!(unread(&["A", "B", "G", "R", "Z", "diffuse.R"]), ["Z", "diffuse.R"]);
        assert_eq!(unread(&["A", "B", "G", "R"]), [""; 0]);
        assert_eq!(unread(&["Y"]), [""; 0]);
        assert_eq!(unread_channels(&hdr("")), [""; 0]);
        let layer = |name: &str| {
            let grey = |_: Vec2<usize>| (0.5_f32, 0.5_f32, 0.5_f32);
            Layer::new(
                (4, 2),
                LayerAttributes::named(name),
                Encoding::SMALL_LOSSLESS,
                SpecificChannels::rgb(grey),
            )
        };
        let image = Image::empty(ImageAttributes::new(IntegerBounds::from_dimensions((4, 2))));
        let mut bytes = Cursor::new(Vec::new());
        image.with_layer(layer("left")).with_layer(layer("right")).write().to_buffered(&mut bytes).unwrap();
        assert_eq!(unread_channels(bytes.get_ref()), ["right.B", "right.G", "right.R"]);
    }

    #[test]
    fn channels_that_are_not_read_are_named() {
        let refused = |names: &[&str]| check_channels(&exr_of_channels(names)).unwrap_err();
        assert!(refused(&["Y"]).starts_with("has the channels Y; expected R, G and B,"));
        let left = refused(&["left.R", "left.G", "left.B"]);
        assert!(left.starts_with("has the channels left.B, left.G, left.R; expected R, G and B,"), "{left}");
        let many = refused(&["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"]);
        assert!(many.starts_with("has the channels a, b, c, d, e, f, g, h and 2 more; expected"), "{many}");
        assert_eq!(check_channels(&exr_of_channels(&["R", "G", "B", "Z"])), Ok(()));
        // `check_channels` accepts damaged files, since the decoder says what is wrong with them.
        for bytes in [&exr_of_channels(&["Y"])[..40], &hdr("")[..], &b""[..]] {
            assert_eq!(check_channels(bytes), Ok(()));
        }
    }

    #[test]
    fn the_last_view_counts_and_a_luminance_of_1_is_usual() {
        let view = "states the projection -vta (in VIEW), but is used as an equirectangular picture";
        assert_eq!(header_remarks(&hdr("VIEW= -vtl\nVIEW= -vta\n")), [view]);
        let mut image =
            Image::from_channels((4, 2), SpecificChannels::rgb(|_: Vec2<usize>| (0.5_f32, 0.5_f32, 0.5_f32)));
        image.layer_data.attributes.white_luminance = Some(1.0);
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        assert_eq!(header_remarks(bytes.get_ref()), [""; 0]);
    }

    #[test]
    fn the_rest_of_a_picture_of_several_blocks_begins_after_the_last_one() {
        let grey = |_: Vec2<usize>| (0.5_f32, 0.5_f32, 0.5_f32);
        let mut bytes = Cursor::new(Vec::new());
        let image = Image::from_channels((200, 130), SpecificChannels::rgb(grey));
        image.write().to_buffered(&mut bytes).unwrap();
        let whole = bytes.into_inner();
        assert_eq!(exr_rest(&whole), b"");
        assert_eq!(exr_rest(&[&whole[..], b"abc"].concat()), b"abc");
    }
}
