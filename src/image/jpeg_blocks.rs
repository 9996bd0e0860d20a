//! Skips the blocks of a JPEG's scan, without decoding them. A scan contains whole blocks (ITU-T T.81, annex F) or, in
//! a progressive picture, some bits of some coefficients of each block (annex G).

use super::jpeg_bits::{Bits, Codes};
use super::jpeg_frame::Layer;

/// Number of coefficients of a block.
const COEFFICIENTS: u32 = 64;
/// If the lower half of a code's value is 0 and the upper half is `SIXTEEN_ZEROS`, the code stands for 16 coefficients
/// that are 0. If the lower half is 0 and the upper half is less than `SIXTEEN_ZEROS`, no further coefficient of the
/// block becomes nonzero in this scan.
const SIXTEEN_ZEROS: u8 = 15;
/// The largest number of bits of a block's first coefficient.
const MOST_BITS: u8 = 15;

/// Skips a whole block.
pub(super) fn pass_whole(bits: &mut Bits<'_>, [first, others]: [&Codes; 2]) -> Option<()> {
    bits.pass(first)?;
    let mut at = 1;
    while at < COEFFICIENTS {
        // The upper half of a code's value is the number of coefficients that are 0 before the coefficient to which the
        // code belongs. The value 0 ends the block.
        match bits.pass(others)? {
            0 => return Some(()),
            value => at += u32::from(value >> 4) + 1,
        }
    }
    (at == COEFFICIENTS).then_some(())
}

/// A scan of a progressive picture whose blocks are being skipped.
pub(super) struct Layered {
    layer: Layer,
    /// The number of blocks, counted from the current block, in which no further coefficient becomes nonzero in this
    /// scan.
    ended: u32,
}

impl Layered {
    pub fn new(layer: Layer) -> Self {
        Self { layer, ended: 0 }
    }

    /// Skips the part of a block that this scan contains. In `nonzero`, the bit of each coefficient that is not 0 is
    /// set; this function sets the bits of coefficients that become nonzero in this scan.
    pub fn pass(
        &mut self,
        bits: &mut Bits<'_>,
        [first, others]: [&Codes; 2],
        nonzero: &mut u64,
    ) -> Option<()> {
        match (self.layer.first, self.layer.is_refinement) {
            (0, false) => bits.pass(first).filter(|length| *length <= MOST_BITS).map(drop),
            (0, true) => bits.number(1).map(drop),
            (_, false) => self.pass_upper(bits, others, nonzero),
            (_, true) => self.pass_next(bits, others, nonzero),
        }
    }

    /// Skips the upper bits of a block's coefficients.
    fn pass_upper(&mut self, bits: &mut Bits<'_>, codes: &Codes, nonzero: &mut u64) -> Option<()> {
        let mut at = self.layer.first;
        while self.ended == 0 && at <= self.layer.last {
            let Some((zeros, has_more)) = self.zeros(bits, codes)? else { continue };
            at += zeros;
            if has_more > 0 {
                *nonzero |= self.bit(at)?;
            }
            at += 1;
        }
        self.ended = self.ended.saturating_sub(1);
        Some(())
    }

    /// Skips one further bit of each coefficient that is not 0, and the first bit of each coefficient that becomes
    /// nonzero in this scan.
    fn pass_next(&mut self, bits: &mut Bits<'_>, codes: &Codes, nonzero: &mut u64) -> Option<()> {
        let mut at = self.layer.first;
        while self.ended == 0 && at <= self.layer.last {
            let Some((zeros, length)) = self.zeros(bits, codes)? else { continue };
            at = self.after_zeros(bits, at, zeros, *nonzero)?;
            match length {
                0 => {}
                1 => *nonzero |= self.bit(at)?,
                _ => return None,
            }
            at += 1;
        }
        if self.ended > 0 {
            // The scan has one bit of each remaining coefficient that is not 0.
            let remaining = *nonzero & u64::MAX << at & u64::MAX >> (COEFFICIENTS - 1 - self.layer.last);
            bits.pass_bits(remaining.count_ones())?;
            self.ended -= 1;
        }
        Some(())
    }

    /// Skips a code and the bits of the coefficient to which the code belongs. Returns how many coefficients before
    /// this coefficient are 0, and the number of this coefficient's bits; 0 bits mean that the coefficient stays 0. If
    /// no further coefficient of this block becomes nonzero, sets `ended` and returns `Some(None)`.
    fn zeros(&mut self, bits: &mut Bits<'_>, codes: &Codes) -> Option<Option<(u32, u8)>> {
        let value = bits.pass(codes)?;
        let (upper, length) = (value >> 4, value & 15);
        if length == 0 && upper < SIXTEEN_ZEROS {
            self.ended = (1 << upper) + bits.number(u32::from(upper))?;
            return Some(None);
        }
        Some(Some((u32::from(upper), length)))
    }

    /// Returns a word in which only the bit of the coefficient `at` is set; `None` if the scan does not contain this
    /// coefficient.
    fn bit(&self, at: u32) -> Option<u64> {
        (at <= self.layer.last).then(|| 1 << at)
    }

    /// Skips `zeros` coefficients that are 0, from the position `at`, and one bit of each nonzero coefficient up to the
    /// next coefficient that is 0. Returns the position of the latter.
    fn after_zeros(&self, bits: &mut Bits<'_>, mut at: u32, mut zeros: u32, nonzero: u64) -> Option<u32> {
        while at <= self.layer.last {
            if nonzero >> at & 1 == 1 {
                bits.number(1)?;
            } else if zeros == 0 {
                break;
            } else {
                zeros -= 1;
            }
            at += 1;
        }
        Some(at)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::jpeg::MARKER;
    use super::super::jpeg_bits::tests::table;
    use super::*;

    /// Passes a block of a first scan of the coefficients `first` to `last`. The code 0 means `value`, and the code 10
    /// ends the block. Returns the coefficients that are not 0, and the next eight bits.
    fn passed(first: u32, last: u32, value: u8, data: &[u8]) -> Option<(u64, Option<u32>)> {
        let codes = table(&[value], &[0]).unwrap();
        let mut layered = Layered::new(Layer { first, last, is_refinement: false });
        let (mut bits, mut nonzero) = (Bits::of(data), 0);
        layered.pass(&mut bits, [&codes; 2], &mut nonzero)?;
        Some((nonzero, bits.number(8)))
    }

    #[test]
    fn a_first_coefficient_has_at_most_fifteen_bits() {
        assert_eq!(passed(0, 0, 15, &[0x7f, MARKER, 0, 0xab]), Some((0, Some(0xab))));
        assert_eq!(passed(0, 0, 16, &[0; 4]), None);
    }

    #[test]
    fn sixteen_zeros_end_no_block_and_are_no_coefficients() {
        // The code of sixteen zeros occurs twice, then the end of the block.
        assert_eq!(passed(1, 63, 0xf0, &[0b0010_1010, 0b1011_0000]), Some((0, Some(0b1010_1011))));
        assert_eq!(passed(1, 63, 0x21, &[0b0110_1010, 0b1011_0000]), Some((1 << 3, Some(0b1010_1011))));
    }

    #[test]
    fn no_coefficient_is_beyond_the_last_one_of_the_scan() {
        assert_eq!(passed(1, 3, 0x31, &[0; 4]), None);
        assert!(passed(1, 3, 0x21, &[0; 4]).is_some());
    }
}
