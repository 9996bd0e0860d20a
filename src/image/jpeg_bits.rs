//! The compressed values of a JPEG's scan (ITU-T T.81, annex F): the code tables, and the bits in which the values are
//! stored as codes.

use super::jpeg::MARKER;

/// The second byte of the first restart marker. (There are eight restart markers, and their second bytes are
/// consecutive.)
pub(super) const FIRST_RESTART: u8 = 0xd0;

/// For each possible value of the next 16 bits: the length and the value of the code with which these 16 bits begin.
/// The length is 0 if the 16 bits begin with no code.
pub(super) type Codes = Vec<[u8; 2]>;

/// Adds the code tables in the segment `data` to `codes`.
pub(super) fn add_codes(codes: &mut [Codes; 8], mut data: &[u8]) -> Option<()> {
    while let Some((kind, rest)) = data.split_first() {
        let (lengths, mut rest) = rest.split_first_chunk::<16>()?;
        let mut table = Vec::with_capacity(1 << 16);
        for (length, count) in (1..).zip(lengths) {
            let (values, after) = rest.split_at_checked(usize::from(*count))?;
            let places = 1 << (16 - length);
            // A table with more codes than 16 bits can distinguish is not valid, and would take much memory.
            if table.len() + values.len() * places > 1 << 16 {
                return None;
            }
            values.iter().for_each(|value| table.resize(table.len() + places, [length as u8, *value]));
            rest = after;
        }
        table.resize(1 << 16, [0, 0]);
        *codes.get_mut(usize::from(kind >> 4 & 1) * 4 + usize::from(kind & 3))? = table;
        data = rest;
    }
    Some(())
}

/// The bits of a scan.
pub(super) struct Bits<'a> {
    /// The bytes that are not in `word` yet.
    pub(super) rest: &'a [u8],
    /// The next bits of the scan. The lowest bit of `word` is the last of these bits.
    word: u64,
    /// Number of bits in `word`.
    count: u32,
    /// True if `word` has eight zeros after the last byte before a marker. Photoshop leaves out the last bits of some
    /// pictures, if they are zeros.
    is_padded: bool,
}

impl<'a> Bits<'a> {
    pub(super) fn of(rest: &'a [u8]) -> Self {
        Self { rest, word: 0, count: 0, is_padded: false }
    }

    /// Fills `word` with the bits before the next marker. If too few bits are left before the marker, adds eight zeros
    /// once.
    fn fill(&mut self) {
        while self.count <= 56 {
            let (byte, length) = match *self.rest {
                [MARKER, 0, ..] => (MARKER, 2),
                [byte, ..] if byte != MARKER => (byte, 1),
                _ if self.is_padded => return,
                _ => {
                    self.is_padded = true;
                    (0, 0)
                }
            };
            self.word = self.word << 8 | u64::from(byte);
            self.count += 8;
            self.rest = &self.rest[length..];
        }
    }

    /// Skips a code and the additional bits that follow the code, and returns the code's value. The lower half of the
    /// code's value is the number of additional bits.
    pub(super) fn pass(&mut self, codes: &Codes) -> Option<u8> {
        if self.count < 32 {
            self.fill();
        }
        let next =
            if self.count < 16 { self.word << (16 - self.count) } else { self.word >> (self.count - 16) };
        let [length, value] = codes[next as usize & 0xffff];
        self.count = self.count.checked_sub(u32::from(length) + u32::from(value & 15))?;
        (length > 0).then_some(value)
    }

    /// Reads a number of at most 16 bits.
    pub(super) fn number(&mut self, bits: u32) -> Option<u32> {
        if self.count < bits {
            self.fill();
        }
        self.count = self.count.checked_sub(bits)?;
        Some((self.word >> self.count) as u32 & ((1 << bits) - 1))
    }

    /// Skips `count` bits.
    pub(super) fn pass_bits(&mut self, mut count: u32) -> Option<()> {
        while count > 0 {
            let part = count.min(16);
            self.number(part)?;
            count -= part;
        }
        Some(())
    }

    /// Returns true if more than one byte is left before the next marker.
    pub(super) fn has_more(&mut self) -> bool {
        self.fill();
        let added = if self.is_padded { 8 } else { 0 };
        self.count.saturating_sub(added) >= 16
    }

    /// Skips the next restart marker; returns `None` if its number is not `index`.
    pub(super) fn pass_restart(&mut self, index: u8) -> Option<()> {
        self.pass_rest();
        let kind = self.rest.iter().position(|byte| *byte != MARKER)?;
        let is_next = self.rest[kind] == FIRST_RESTART + index;
        *self = Self::of(&self.rest[kind + 1..]);
        is_next.then_some(())
    }

    /// Skips all bytes before the next marker.
    pub(super) fn pass_rest(&mut self) {
        while let [MARKER, 0, rest @ ..] | [0..=0xfe, rest @ ..] = self.rest {
            self.rest = rest;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns the table of a segment with one table, which has these values for codes of one and of two bits.
    pub(in crate::image) fn table(one: &[u8], two: &[u8]) -> Option<Codes> {
        let mut codes = <[Codes; 8]>::default();
        let mut data = vec![0x12, one.len() as u8, two.len() as u8];
        data.resize(17, 0);
        data.extend(one.iter().chain(two));
        add_codes(&mut codes, &data)?;
        Some(std::mem::take(&mut codes[4 + 2]))
    }

    #[test]
    fn a_table_has_at_most_as_many_codes_as_there_are_bits_for() {
        assert!(table(&[1, 2], &[]).is_some() && table(&[1], &[2, 3]).is_some());
        assert!(table(&[1, 2, 3], &[]).is_none() && table(&[1], &[2, 3, 4]).is_none());
    }

    #[test]
    fn bits_end_eight_zeros_after_the_last_byte_and_any_number_can_be_passed() {
        let mut bits = Bits::of(&[MARKER, 0, 0x12, 0x34, 0x56, 0x78, 0x9a, 0xbc, MARKER, 0xd9]);
        assert_eq!((bits.number(8), bits.pass_bits(36), bits.number(8)), (Some(0xff), Some(()), Some(0xab)));
        assert_eq!([4, 8, 1].map(|count| bits.number(count)), [Some(0xc), Some(0), None]);
        assert_eq!(Bits::of(&[0; 4]).pass_bits(41), None);
    }

    #[test]
    fn more_than_a_byte_is_left_wherever_reading_stopped() {
        for length in 3..20 {
            let data = vec![0; length];
            for read in 0..8 * length as u32 {
                let mut bits = Bits::of(&data);
                assert_eq!((0..read).find_map(|_| bits.number(1).is_none().then_some(())), None);
                assert_eq!(bits.has_more(), 8 * length as u32 - read >= 16, "{read} of {length} bytes");
            }
        }
    }
}
