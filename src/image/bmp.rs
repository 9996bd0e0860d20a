//! Reads from a BMP's header what the decoder does not use (Microsoft, "BITMAPV5HEADER structure").

use super::icc::is_srgb;
use super::stated::is_srgb_gamma;
use super::stated::{CLOSE, SRGB};

/// Number of bytes of a BMP before its header.
const FILE_HEADER_BYTES: usize = 14;

/// If the sum of X, Y and Z of a primary is less than a thousandth, raycl assumes that the BMP does not state the
/// primary: some programs write small numbers in the places of primaries.
const LEAST_SUM: f32 = (1 << 20) as f32;

/// Returns the colour space that a BMP states, as text for messages; `None` if the BMP states sRGB or no colour space.
pub fn other_space(bytes: &[u8]) -> Option<String> {
    let header = bytes.get(FILE_HEADER_BYTES..)?;
    // Shorter headers have no colour space.
    let stated = header.get(..108).filter(|_| u32_at(header, 0) >= Some(108))?;
    match &stated[56..60] {
        [0, 0, 0, 0] => {
            let gammas = [96, 100, 104].map(|at| f64::from(u32_at(stated, at).unwrap_or(0)) / 65536.0);
            let other = gammas.into_iter().find(|gamma| *gamma != 0.0 && !is_srgb_gamma(*gamma));
            let primaries = || has_other_primaries(stated).then(|| "other primaries".to_owned());
            other.map(|gamma| format!("gamma {gamma:.2}")).or_else(primaries)
        }
        b"DEBM" | b"KNIL" => {
            let (at, length) = (u32_at(header, 112)? as usize, u32_at(header, 116)? as usize);
            let profile = header.get(at..).and_then(|rest| rest.get(..length));
            (!profile.is_some_and(is_srgb)).then(|| "an ICC profile".to_owned())
        }
        _ => None,
    }
}

/// Returns true if a header states all three primaries (as X, Y and Z), and at least one of them differs from the same
/// primary of sRGB.
fn has_other_primaries(header: &[u8]) -> bool {
    let stated =
        [60, 72, 84].map(|at| [0, 4, 8].map(|offset| u32_at(header, at + offset).unwrap_or(0) as f32));
    let is_stated = stated.iter().all(|primary| primary.iter().sum::<f32>() >= LEAST_SUM);
    let ratios = stated.map(|[x, y, z]| [x / (x + y + z), y / (x + y + z)]);
    let is_other = |(value, usual): (&f32, f32)| (value - usual).abs() > CLOSE;
    is_stated && ratios.as_flattened().iter().zip(SRGB).any(is_other)
}

/// Returns true if a BMP has 32 bits per texel without bit masks, and the fourth bytes of its texels are neither all 0
/// nor all 255. By the format's definition, the fourth bytes have no meaning, but some programs store alpha in them.
pub fn has_fourth_channel(bytes: &[u8]) -> bool {
    let states = || {
        let header = bytes.get(FILE_HEADER_BYTES..)?;
        let has_no_masks = header.get(14..20)? == [32, 0, 0, 0, 0, 0] && u32_at(header, 0)? >= 40;
        let [width, height] =
            [u32_at(header, 4)?, u32_at(header, 8)?].map(|size| i64::from(size as i32).abs());
        let texels =
            bytes.get(u32_at(bytes, 10)? as usize..)?.chunks_exact(4).take((width * height) as usize);
        let is_filled = |fill: u8| texels.clone().all(|texel| texel[3] == fill);
        Some(has_no_masks && !is_filled(0) && !is_filled(255))
    };
    states() == Some(true)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a BMP of two texels with this header size, colour space, primaries, gamma and fourth bytes.
    fn bmp(header: u32, space: &[u8; 4], primaries: [f32; 9], gamma: f64, fourth: [u8; 2]) -> Vec<u8> {
        let words = |list: &[u32]| list.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        let fixed = primaries.map(|value| (value * (1 << 30) as f32) as u32);
        let mut bytes = [
            &b"BM"[..],
            &words(&[0, 0, 14 + header, header, 2, 1]),
            &[1, 0, 32, 0],
            &[0; 40],
            space,
            &words(&fixed),
            &words(&[(gamma * 65536.0) as u32; 3]),
            &[0; 16],
        ]
        .concat();
        bytes.truncate(14 + header as usize);
        [bytes, vec![1, 2, 3, fourth[0], 4, 5, 6, fourth[1]]].concat()
    }

    const USUAL: [f32; 9] = [0.64, 0.33, 0.03, 0.3, 0.6, 0.1, 0.15, 0.06, 0.79];
    /// The number 2 in the place of the last number of the primaries, in units of 2 to the power of -30.
    const LAST: [f32; 9] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0 / (1 << 30) as f32];

    #[test]
    fn a_calibrated_colour_space_is_compared_with_srgb() {
        let adobe = [0.64, 0.33, 0.03, 0.21, 0.71, 0.08, 0.15, 0.06, 0.79];
        for (header, space, primaries, gamma, expected) in [
            (40, b"\0\0\0\0", USUAL, 1.0, None),
            (108, b"\0\0\0\0", USUAL, 2.2, None),
            (124, b"\0\0\0\0", USUAL, 0.4545, None),
            (108, b"\0\0\0\0", [0.0; 9], 0.0, None),
            (108, b"\0\0\0\0", LAST, 0.0, None),
            (108, b"BGRs", adobe, 1.0, None),
            (108, b"\0\0\0\0", USUAL, 1.0, Some("gamma 1.00")),
            (108, b"\0\0\0\0", adobe, 2.2, Some("other primaries")),
            (124, b"DEBM", [0.0; 9], 0.0, Some("an ICC profile")),
        ] {
            let bytes = bmp(header, space, primaries, gamma, [0; 2]);
            assert_eq!(other_space(&bytes).as_deref(), expected, "{header} {space:?} {gamma}");
            (0..bytes.len()).for_each(|end| drop(other_space(&bytes[..end])));
        }
    }

    #[test]
    fn fourth_bytes_that_differ_may_be_alpha() {
        let has = |fourth| has_fourth_channel(&bmp(40, b"\0\0\0\0", USUAL, 0.0, fourth));
        assert_eq!([[0, 0], [255, 255], [0, 255], [9, 9]].map(has), [false, false, true, true]);
        let mut with_masks = bmp(40, b"\0\0\0\0", USUAL, 0.0, [0, 255]);
        with_masks[30] = 3;
        assert!(!has_fourth_channel(&with_masks) && !has_fourth_channel(&with_masks[..30]));
    }

    #[test]
    fn texels_after_a_short_header_state_no_colour_space() {
        let mut bytes = bmp(108, b"\0\0\0\0", USUAL, 1.0, [0; 2]);
        bytes[14] = 40;
        assert_eq!(other_space(&bytes), None);
    }

    #[test]
    fn primaries_with_smaller_numbers_than_those_of_srgb_are_others() {
        let primaries = [0.64, 0.33, 0.03, 0.3, 0.6, 0.1, 0.1, 0.06, 0.84];
        let stated = other_space(&bmp(108, b"\0\0\0\0", primaries, 2.2, [0; 2]));
        assert_eq!(stated.as_deref(), Some("other primaries"));
    }

    #[test]
    fn an_embedded_profile_is_found_by_its_place_and_length() {
        let [one, start, length] = [1_u32, 144, 14].map(u32::to_be_bytes);
        // A curve with the exponent 563 / 256, which is nearly 2.2.
        let curve = [&b"curv\0\0\0\0"[..], &one[..], &[2, 51]].concat();
        let profile = [&[0_u8; 128][..], &one, b"kTRC", &start, &length, &curve].concat();
        let mut bytes = bmp(124, b"DEBM", USUAL, 0.0, [0; 2]);
        let place = bytes.len() as u32 - 14;
        bytes[14 + 112..14 + 116].copy_from_slice(&place.to_le_bytes());
        bytes[14 + 116..14 + 120].copy_from_slice(&(profile.len() as u32).to_le_bytes());
        assert_eq!(other_space(&[bytes, profile].concat()), None);
    }

    #[test]
    fn only_texels_decide_whether_fourth_bytes_differ() {
        let usual = bmp(40, b"\0\0\0\0", USUAL, 0.0, [0; 2]);
        // A negative height means that the first row is the upper one.
        let mut upside_down = [&usual[..], &[9; 4]].concat();
        upside_down[22..26].copy_from_slice(&(-1_i32).to_le_bytes());
        assert!(!has_fourth_channel(&upside_down));
        let mut with_gap = usual;
        with_gap.splice(54..54, [9; 4]);
        with_gap[10] += 4;
        assert!(!has_fourth_channel(&with_gap));
    }
}
