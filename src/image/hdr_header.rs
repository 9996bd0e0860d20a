//! Reads the header of Radiance HDR pictures.

use super::decode::decoder_message;
use image::codecs::hdr::HdrDecoder;
use std::io::Cursor;

/// The first bytes of a Radiance HDR picture.
const SIGNATURE: &[u8] = b"#?RADIANCE";
/// The first bytes of the Radiance HDR pictures that some programs write. The decoder does not know the
/// signature `#?RGBE`.
const OTHER_SIGNATURE: &[u8] = b"#?RGBE";

/// Returns a file's bytes. If the file is a Radiance HDR picture with the signature `#?RGBE`, replaces this
/// signature by the usual signature, `#?RADIANCE`.
pub fn with_usual_signature(mut bytes: Vec<u8>) -> Vec<u8> {
    if bytes.starts_with(OTHER_SIGNATURE) {
        drop(bytes.splice(..OTHER_SIGNATURE.len(), SIGNATURE.iter().copied()));
    }
    bytes
}

/// The numbers by which a program has multiplied the radiance before it wrote a picture, one number per channel. In a
/// Radiance HDR picture, a channel's number is the product of all EXPOSUREs and COLORCORRs in the header. For pictures
/// in formats other than Radiance HDR, the number of each channel is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HdrExposure([f64; 3]);

impl HdrExposure {
    /// Reads the three numbers of [`HdrExposure`] from the bytes of a picture file.
    ///
    /// # Errors
    ///
    /// Fails if the header cannot be read, or if a number is not positive and finite. The caller puts the
    /// file's name before the error's text.
    pub fn of(bytes: &[u8]) -> Result<Self, String> {
        if !bytes.starts_with(SIGNATURE) {
            return Ok(Self([1.0; 3]));
        }
        let decoder = HdrDecoder::new(Cursor::new(bytes));
        let damaged = |error| format!("cannot be decoded ({})", decoder_message(error));
        let header = decoder.map_err(damaged)?.metadata();
        let of = |key: &str, value: f32| {
            let lines = header.custom_attributes.iter().filter(|(name, _)| name == key).count();
            positive(key, lines, value)
        };
        let exposure = of("EXPOSURE", header.exposure.unwrap_or(1.0))?;
        let (red, green, blue) = header.color_correction.unwrap_or((1.0, 1.0, 1.0));
        let correction = |value: f32| of("COLORCORR", value);
        Ok(Self([correction(red)?, correction(green)?, correction(blue)?].map(|value| exposure * value)))
    }

    /// Returns the radiance of a pixel whose values in the file are `pixel`.
    pub fn radiance(self, pixel: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|channel| (f64::from(pixel[channel]) / self.0[channel]) as f32)
    }
}

/// Returns the product of the numbers of all lines `key`, or an error if it is not positive and finite.
fn positive(key: &str, lines: usize, product: f32) -> Result<f64, String> {
    if product > 0.0 && product.is_finite() {
        return Ok(f64::from(product));
    }
    let stated = match lines {
        1 => format!("the {key} {product}"),
        _ => format!("{lines} lines {key} with the product {product}"),
    };
    Err(format!("has {stated} in its header; expected a positive, finite number"))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn picture(signature: &str, lines: &str) -> Vec<u8> {
        let header = format!("{signature}\nFORMAT=32-bit_rle_rgbe\n{lines}\n-Y 1 +X 1\n");
        [header.as_bytes(), &[128, 64, 32, 129]].concat()
    }

    #[test]
    fn the_radiance_is_divided_by_all_exposures_and_corrections() {
        for (lines, expected) in [
            ("", [8.0, 8.0, 8.0]),
            ("EXPOSURE=2\n", [4.0, 4.0, 4.0]),
            ("EXPOSURE=2\nEXPOSURE= 0.5\nEXPOSURE=4\n", [2.0, 2.0, 2.0]),
            ("COLORCORR=1 2 4\n", [8.0, 4.0, 2.0]),
            ("EXPOSURE=2\nCOLORCORR=1 2 4\nCOLORCORR=2 2 1\n", [2.0, 1.0, 1.0]),
            ("EXPOSURE=3e38\nCOLORCORR=1 1 3e38\n", [8.0 / 3e38, 8.0 / 3e38, 0.0]),
        ] {
            let exposure = HdrExposure::of(&picture("#?RADIANCE", lines)).unwrap();
            assert_eq!(exposure.radiance([8.0; 3]), expected, "{lines}");
        }
        let other = HdrExposure::of(b"\x89PNG EXPOSURE=2\n").unwrap();
        assert_eq!(other.radiance([0.1, f32::MAX, f32::MIN_POSITIVE]), [0.1, f32::MAX, f32::MIN_POSITIVE]);
    }

    #[test]
    fn an_exposure_that_is_not_positive_is_refused() {
        for (lines, expected) in [
            ("EXPOSURE=0\n", "has the EXPOSURE 0 in its header; expected a positive, finite number"),
            ("EXPOSURE=-1\n", "EXPOSURE -1 "),
            ("EXPOSURE=nan\n", "EXPOSURE NaN "),
            ("EXPOSURE=inf\n", "EXPOSURE inf "),
            ("COLORCORR=1 0 1\n", "COLORCORR 0 "),
            ("EXPOSURE=2\nEXPOSURE=0\n", "has 2 lines EXPOSURE with the product 0 in its header; "),
            ("COLORCORR=1 1 3e38\nCOLORCORR=1 1 9\n", "2 lines COLORCORR with the product inf "),
        ] {
            let refused = HdrExposure::of(&picture("#?RADIANCE", lines)).unwrap_err();
            assert!(refused.contains(expected), "{lines}: {refused}");
        }
    }

    #[test]
    fn the_other_signature_is_replaced_and_nothing_else_changes() {
        let [usual, other] = ["#?RADIANCE", "#?RGBE"].map(|signature| picture(signature, "EXPOSURE=2\n"));
        assert_eq!(with_usual_signature(other), usual);
        for bytes in [usual, b"v 0 0 0".to_vec(), Vec::new()] {
            assert_eq!(with_usual_signature(bytes.clone()), bytes);
        }
    }
}
