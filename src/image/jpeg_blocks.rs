//! Passes the blocks of a JPEG's scan: whole blocks (ITU-T T.81, annex F), or what a scan of a progressive picture has
//! of each block (annex G).

use super::jpeg_bits::{Bits, Codes};
use super::jpeg_frame::Layer;

/// Number of coefficients of a block.
const COEFFICIENTS: u32 = 64;
/// If the lower half of a code's value is 0 and the upper half is this number, then 16 zeros follow. If the upper half
/// is smaller, then no further coefficient of the block becomes nonzero.
const SIXTEEN_ZEROS: u8 = 15;
/// The largest number of bits of a block's first coefficient.
const MOST_BITS: u8 = 15;

/// Passes a whole block.
pub(super) fn pass_whole(bits: &mut Bits<'_>, [first, others]: [&Codes; 2]) -> Option<()> {
    bits.pass(first)?;
    let mut at = 1;
    while at < COEFFICIENTS {
        // The upper half of a code's value is the number of zeros before the coefficient. The value 0 ends a block.
        match bits.pass(others)? {
            0 => return Some(()),
            value => at += u32::from(value >> 4) + 1,
        }
    }
    (at == COEFFICIENTS).then_some(())
}

/// A scan of a progressive picture that is being passed.
pub(super) struct Layered {
    layer: Layer,
    /// Number of the next blocks in which no further coefficient becomes nonzero.
    ended: u32,
}

impl Layered {
    pub fn new(layer: Layer) -> Self {
        Self { layer, ended: 0 }
    }

    /// Passes what the scan has of a block. In `nonzero`, the bits of the coefficients that are not 0 are set.
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

    /// Passes the upper bits of coefficients.
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

    /// Passes the next bit of coefficients that are not 0, and the first bits of others.
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
            // Each coefficient that is not 0 has one bit.
            let remaining = *nonzero & u64::MAX << at & u64::MAX >> (COEFFICIENTS - 1 - self.layer.last);
            bits.pass_bits(remaining.count_ones())?;
            self.ended -= 1;
        }
        Some(())
    }

    /// Passes a code. Returns the number of zeros before the next coefficient, and the number of this coefficient's
    /// bits, which are passed, too; 0 bits mean that the coefficient stays 0. Returns `Some(None)` if no further
    /// coefficient of this block becomes nonzero, and sets `ended`.
    fn zeros(&mut self, bits: &mut Bits<'_>, codes: &Codes) -> Option<Option<(u32, u8)>> {
        let value = bits.pass(codes)?;
        let (upper, length) = (value >> 4, value & 15);
        if length == 0 && upper < SIXTEEN_ZEROS {
            self.ended = (1 << upper) + bits.number(u32::from(upper))?;
            return Some(None);
        }
        Some(Some((u32::from(upper), length)))
    }

    /// Returns the bit of a coefficient of the scan; `None` if it has no such coefficient.
    fn bit(&self, at: u32) -> Option<u64> {
        (at <= self.layer.last).then(|| 1 << at)
    }

    /// Passes `zeros` coefficients that are 0, and one bit of each other coefficient up to the next zero. Returns the
    /// position of this zero.
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
