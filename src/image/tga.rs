//! Reads from a TGA's footer and extension area what the decoder does not use (Truevision, "TGA File Format
//! Specification", 1991).

use super::stated::is_srgb_gamma;

/// The last bytes of a TGA of version 2. Files of older versions have no footer.
pub const TGA_FOOTER: &[u8] = b"TRUEVISION-XFILE.\0";
/// Number of bytes of the header.
const HEADER_BYTES: usize = 18;
/// The type, in the header, of a picture that is neither compressed nor grey, and that has no palette.
const UNCOMPRESSED: u8 = 2;
/// Number of bytes of the extension area.
const EXTENSION_BYTES: usize = 495;

/// What the fourth byte of a TGA's texel means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TgaAlpha {
    /// The byte is alpha, and the colours are not multiplied by it.
    Straight,
    /// The byte is alpha, and the colours are multiplied by it.
    Premultiplied,
    /// The byte has no meaning: the texel is opaque.
    Undefined,
}

impl TgaAlpha {
    pub fn of(bytes: &[u8]) -> Self {
        match extension(bytes).map(|extension| extension[494]) {
            Some(1 | 2) => Self::Undefined,
            Some(4) => Self::Premultiplied,
            _ => Self::Straight,
        }
    }
}

/// Returns the gamma that a TGA states, as text for messages; `None` if the TGA states no gamma, or a gamma that is
/// nearly sRGB's.
pub fn other_gamma(bytes: &[u8]) -> Option<String> {
    let extension = extension(bytes)?;
    let number = |at: usize| f64::from(u16::from_le_bytes([extension[at], extension[at + 1]]));
    let (above, below) = (number(478), number(480));
    let gamma = above / below;
    (above > 0.0 && below > 0.0 && !is_srgb_gamma(gamma)).then(|| format!("gamma {gamma:.2}"))
}

/// Returns true if three conditions hold: a TGA has 16 bits per texel, one of these bits is alpha, and this bit is not
/// the same in all texels. The decoder does not use this bit. The bits of a compressed TGA are not compared.
pub fn has_alpha_bits(bytes: &[u8]) -> bool {
    let states_alpha = matches!(bytes.get(16..18), Some([16, description]) if description & 15 == 1);
    states_alpha && TgaAlpha::of(bytes) != TgaAlpha::Undefined && alpha_bits_differ(bytes) == Some(true)
}

/// Returns true if the uppermost bits of the texels differ in an uncompressed TGA of 16 bits per texel.
fn alpha_bits_differ(bytes: &[u8]) -> Option<bool> {
    let number = |at: usize| Some(usize::from(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?)));
    // Two parts precede the texels: a text, whose length is the file's first byte, and a palette, which this kind of
    // picture does not use.
    let start = HEADER_BYTES + usize::from(*bytes.first()?);
    let is_plain = bytes.get(1..3)? == [0, UNCOMPRESSED];
    let texels = bytes.get(start..)?.chunks_exact(2).take(number(12)? * number(14)?);
    let mut bits = texels.map(|texel| texel[1] >> 7);
    let first = bits.next()?;
    Some(is_plain && bits.any(|bit| bit != first))
}

/// Returns the extension area, whose position the footer states; `None` if a TGA has no extension area.
fn extension(bytes: &[u8]) -> Option<&[u8; EXTENSION_BYTES]> {
    let place = bytes.strip_suffix(TGA_FOOTER)?.last_chunk::<8>()?.first_chunk()?;
    let place = u32::from_le_bytes(*place) as usize;
    bytes.get(place..).filter(|_| place > 0)?.first_chunk()
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Returns a TGA of one texel with an extension area that states a gamma and the meaning of the fourth byte.
    pub fn tga(texel: [u8; 4], gamma: [u8; 2], attributes: u8) -> Vec<u8> {
        let header = [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 8];
        let mut extension = [0; EXTENSION_BYTES];
        (extension[478], extension[480], extension[494]) = (gamma[0], gamma[1], attributes);
        [&header[..], &texel, &extension, &[22, 0, 0, 0], &[0; 4], TGA_FOOTER].concat()
    }

    #[test]
    fn the_extension_area_states_a_gamma() {
        let stated = |gamma| other_gamma(&tga([0; 4], gamma, 3));
        let expected = [None, None, None, Some("gamma 1.00".to_owned())];
        assert_eq!([[0, 0], [22, 10], [45, 99], [10, 10]].map(stated), expected);
        assert_eq!(other_gamma(&tga([0; 4], [10, 10], 3)[..100]), None, "a file without a footer");
    }

    #[test]
    fn the_extension_area_states_what_the_fourth_byte_means() {
        let stated = |attributes| TgaAlpha::of(&tga([0; 4], [0; 2], attributes));
        let (straight, undefined) = (TgaAlpha::Straight, TgaAlpha::Undefined);
        let expected = [straight, undefined, undefined, straight, TgaAlpha::Premultiplied];
        assert_eq!([0, 1, 2, 3, 4].map(stated), expected);
        assert_eq!(TgaAlpha::of(b""), straight);
    }

    #[test]
    fn a_gamma_is_the_quotient_of_its_two_numbers() {
        let stated = other_gamma(&tga([0; 4], [15, 10], 3));
        assert_eq!(stated.as_deref(), Some("gamma 1.50"));
    }

    #[test]
    fn a_place_of_0_means_that_there_is_no_extension_area() {
        let bytes = [&[1_u8; 500][..], &[0; 8], TGA_FOOTER].concat();
        assert_eq!(TgaAlpha::of(&bytes), TgaAlpha::Straight);
    }

    /// Returns a TGA of two texels of 16 bits, the second byte of which is the texel's upper one.
    fn tga16(texels: [u8; 4], attributes: u8) -> Vec<u8> {
        let mut bytes = tga(texels, [0; 2], attributes);
        (bytes[12], bytes[16], bytes[17]) = (2, 16, 0x21);
        bytes
    }

    #[test]
    fn alpha_bits_count_if_they_differ() {
        let has = |first, second, attributes| has_alpha_bits(&tga16([0x80, first, 0x80, second], attributes));
        assert_eq!([has(0, 0, 3), has(0xff, 0x80, 3), has(0, 0x80, 3)], [false, false, true]);
        assert!(!has(0, 0x80, 2), "the extension area says that alpha is undefined");
        let bytes = tga16([0, 0, 0, 0x80], 3);
        assert!(bytes.iter().enumerate().all(|(end, _)| end >= 22 || !has_alpha_bits(&bytes[..end])));
        let compressed = [&bytes[..2], &[10], &bytes[3..]].concat();
        assert!(!has_alpha_bits(&compressed));
    }

    #[test]
    fn texels_begin_after_a_text_and_end_before_the_extension_area() {
        let bytes = tga16([0, 0x80, 0, 0], 3);
        let with_text =
            |text: &[u8]| [&[text.len() as u8], &bytes[1..18], text, &bytes[18..22], &[0, 0x80]].concat();
        assert!(has_alpha_bits(&with_text(b"text")));
        let whole = tga16([0; 4], 3);
        assert!(!has_alpha_bits(&[&whole[..22], &[0, 0x80]].concat()));
    }
}
