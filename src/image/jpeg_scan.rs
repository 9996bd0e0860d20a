//! Checks the compressed values of a baseline JPEG (ITU-T T.81, Huffman coding), which the decoder does not check: the
//! decoder replaces values that are missing or damaged by others without an error. Only the lengths of the values are
//! read, so the check takes less time than decoding.

use super::decode::segments;
use super::jpeg::{MARKER, START_OF_SCAN};
use super::jpeg_scans;

/// The second bytes of markers: the two kinds of frames that are checked (baseline, and extended with Huffman coding),
/// code tables, and the number of groups of blocks between markers for restarts.
const FRAMES: [u8; 2] = [0xc0, 0xc1];
const CODES: u8 = 0xc4;
const RESTARTS: u8 = 0xdd;
/// The second byte of the first of the eight markers for restarts.
const FIRST_RESTART: u8 = 0xd0;

/// For each possible value of the next 16 bits, the length of the code with which they begin, and the code's value. The
/// length is 0 if they begin with no code.
type Codes = Vec<[u8; 2]>;

/// Returns true if the compressed values end too early for the picture's number of blocks, or contain a code that does
/// not exist. Nearly all losses of many bytes have one of these effects. Bytes that are left after the last block do
/// not count, since some programs write such bytes. Of a progressive picture, only missing scans are noticed (see
/// the module `jpeg_scans`). Other pictures with another kind of frame than `FRAMES`, or with several scans, are not checked.
pub fn is_damaged(bytes: &[u8]) -> bool {
    let Some((blocks, mut bits)) = blocks_of(bytes) else { return jpeg_scans::are_missing(bytes) };
    blocks.pass_all(&mut bits).is_none()
}

/// The blocks of a picture's scan.
struct Blocks {
    /// Number of groups of blocks. A group has the blocks of each component for the same part of the picture.
    groups: usize,
    /// For each block of a group, the tables of codes of the block's first value and of its other values.
    tables: Vec<[usize; 2]>,
    codes: [Codes; 8],
    /// Number of groups between markers for restarts; 0 if there are no such markers.
    restarts: usize,
}

/// Returns the blocks of a JPEG with a frame of [`FRAMES`] and a single scan, and the bits of this scan; `None` for
/// other pictures.
fn blocks_of(bytes: &[u8]) -> Option<(Blocks, Bits<'_>)> {
    let (mut codes, mut restarts, mut frame) = ([const { Vec::new() }; 8], 0, None);
    for (kind, data, rest) in segments(bytes) {
        match kind {
            CODES => add_codes(&mut codes, data)?,
            RESTARTS => restarts = usize::from(number(data, 0)?),
            START_OF_SCAN => {
                let (groups, tables) = groups_of(frame?, data)?;
                let is_known = tables.iter().flatten().all(|table| !codes[*table].is_empty());
                let blocks = Blocks { groups, tables, codes, restarts };
                return is_known.then_some((blocks, Bits { rest, word: 0, count: 0, is_padded: false }));
            }
            kind if FRAMES.contains(&kind) => frame = Some(data),
            _ => {}
        }
    }
    None
}

/// Adds the tables of codes of a segment to `codes`.
fn add_codes(codes: &mut [Codes; 8], mut data: &[u8]) -> Option<()> {
    while let Some((kind, rest)) = data.split_first() {
        let (lengths, mut rest) = rest.split_first_chunk::<16>()?;
        let mut table = Vec::with_capacity(1 << 16);
        for (length, count) in (1..).zip(lengths) {
            let (values, after) = rest.split_at_checked(usize::from(*count))?;
            values
                .iter()
                .for_each(|value| table.resize(table.len() + (1 << (16 - length)), [length as u8, *value]));
            rest = after;
        }
        table.resize(1 << 16, [0, 0]);
        *codes.get_mut(usize::from(kind >> 4 & 1) * 4 + usize::from(kind & 3))? = table;
        data = rest;
    }
    Some(())
}

/// Returns the number of groups of blocks, and the tables of each block of a group, from the data of a frame and of the
/// scan of all its components.
fn groups_of(frame: &[u8], scan: &[u8]) -> Option<(usize, Vec<[usize; 2]>)> {
    let [height, width] = [number(frame, 1)?, number(frame, 3)?].map(usize::from);
    let parts = frame.get(6..)?.chunks_exact(3).zip(scan.get(1..)?.chunks_exact(2));
    let count = usize::from(*frame.get(5)?);
    if scan.first()? != frame.get(5)? || parts.len() < count || height == 0 {
        return None;
    }
    let mut tables = Vec::new();
    let [mut across, mut down] = [1, 1];
    for (part, of_scan) in parts.take(count) {
        let sampling = [part[1] >> 4, part[1] & 15].map(usize::from);
        // The blocks of a single component are not grouped.
        let [h, v] = if count == 1 { [1, 1] } else { sampling };
        [across, down] = [across.max(h), down.max(v)];
        let own = [usize::from(of_scan[1] >> 4 & 3), 4 + usize::from(of_scan[1] & 3)];
        tables.extend(std::iter::repeat_n(own, h * v));
    }
    Some((width.div_ceil(8 * across) * height.div_ceil(8 * down), tables))
}

impl Blocks {
    /// Passes all blocks; returns `None` if the bits end early or have a code that does not exist.
    fn pass_all(&self, bits: &mut Bits<'_>) -> Option<()> {
        for group in 0..self.groups {
            if self.restarts > 0 && group > 0 && group % self.restarts == 0 {
                bits.pass_restart((group / self.restarts - 1) as u8 % 8)?;
            }
            for [first, others] in &self.tables {
                bits.pass_block(&self.codes[*first], &self.codes[*others])?;
            }
        }
        Some(())
    }
}

/// The bits of a scan.
struct Bits<'a> {
    /// The bytes that are not in `word` yet.
    rest: &'a [u8],
    /// The next bits, of which the lowest is the last.
    word: u64,
    /// Number of bits in `word`.
    count: u32,
    /// True if `word` has eight zeros after the last byte before a marker. Photoshop leaves out the last bits of some
    /// pictures, if they are zeros.
    is_padded: bool,
}

impl<'a> Bits<'a> {
    fn of(rest: &'a [u8]) -> Self {
        Self { rest, word: 0, count: 0, is_padded: false }
    }

    /// Fills `word` with the bits before the next marker. If there are too few, adds eight zeros once.
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

    /// Passes a code and the bits after it. The lower half of the code's value states how many bits these are. Returns
    /// the code's value.
    fn pass(&mut self, codes: &Codes) -> Option<u8> {
        if self.count < 32 {
            self.fill();
        }
        let next =
            if self.count < 16 { self.word << (16 - self.count) } else { self.word >> (self.count - 16) };
        let [length, value] = codes[next as usize & 0xffff];
        self.count = self.count.checked_sub(u32::from(length) + u32::from(value & 15))?;
        (length > 0).then_some(value)
    }

    /// Passes a block of 64 values.
    fn pass_block(&mut self, first: &Codes, others: &Codes) -> Option<()> {
        self.pass(first)?;
        let mut at = 1;
        while at < 64 {
            // The upper half of a code's value is the number of zeros before the value. The value 0 ends a block.
            match self.pass(others)? {
                0 => return Some(()),
                value => at += usize::from(value >> 4) + 1,
            }
        }
        (at == 64).then_some(())
    }

    /// Passes the marker for the restart `index`.
    fn pass_restart(&mut self, index: u8) -> Option<()> {
        self.pass_rest();
        let kind = self.rest.iter().position(|byte| *byte != MARKER)?;
        let is_next = self.rest[kind] == FIRST_RESTART + index;
        *self = Self::of(&self.rest[kind + 1..]);
        is_next.then_some(())
    }

    /// Passes all bytes before the next marker.
    fn pass_rest(&mut self) {
        while let [MARKER, 0, rest @ ..] | [0..=0xfe, rest @ ..] = self.rest {
            self.rest = rest;
        }
    }
}

fn number(data: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes(*data.get(at..)?.first_chunk()?))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};

    const END: [u8; 2] = [MARKER, 0xd9];

    /// Returns a JPEG of three components, the first with 2 x 2 blocks per group. Its only code is the bit 0, which
    /// means the value 0, so a block takes 2 bits and a group takes 12.
    fn of_groups(width: u8, restarts: u8, values: &[u8]) -> Vec<u8> {
        let table = |kind: u8| [&[MARKER, CODES, 0, 20, kind, 1], &[0; 16][..]].concat();
        let frame = [MARKER, 0xc0, 0, 17, 8, 0, 16, 0, width, 3, 1, 0x22, 0, 2, 0x11, 0, 3, 0x11, 0];
        let scan = [MARKER, START_OF_SCAN, 0, 12, 3, 1, 0, 2, 0, 3, 0, 0, 63, 0];
        let restarts = [MARKER, RESTARTS, 0, 4, 0, restarts];
        [&[MARKER, 0xd8], &table(0)[..], &table(0x10), &frame, &restarts, &scan, values, &END].concat()
    }

    #[test]
    fn a_picture_has_the_values_of_all_its_blocks_and_perhaps_more() {
        let is_whole = |width, restarts, values: &[u8]| !is_damaged(&of_groups(width, restarts, values));
        // 33 pixels are three groups, which take 36 bits.
        let of_bytes = |count: usize| is_whole(33, 0, &vec![0; count]);
        assert_eq!([3, 4, 5, 8, 9].map(of_bytes), [false, true, true, true, true]);
        assert!(
            is_whole(16, 0, &[0; 2]) && !is_whole(33, 0, &[0, 0x80, 0, 0, 0]),
            "a code that does not exist"
        );
        let with =
            |first: u8| [0, 0, MARKER, FIRST_RESTART + first, 0, 0, MARKER, MARKER, FIRST_RESTART + 1, 0, 0];
        assert!(is_whole(33, 1, &with(0)) && !is_whole(33, 1, &with(1)) && !is_whole(33, 0, &with(0)));
        assert!(!is_whole(33, 1, &[0; 6]));
    }

    #[test]
    fn what_is_cut_is_damaged_and_whole_pictures_are_not() {
        let picture = |width, height| {
            let pixel = |x: u32, y: u32| Rgb([(x * 7) as u8, (y * 5) as u8, (x * y) as u8]);
            super::super::jpeg::encode(&RgbImage::from_fn(width, height, pixel), 95).unwrap()
        };
        for whole in [picture(40, 30), picture(24, 400), picture(1, 1)] {
            assert!(!is_damaged(&whole) && !is_damaged(&[&whole[..], b"more"].concat()));
        }
        let whole = picture(40, 30);
        let part = |end: usize| &whole[..whole.len() - end];
        let quarter = (whole.len() - 623) / 4;
        assert!(is_damaged(&[part(quarter), &END].concat()));
        assert!(!is_damaged(&[part(2), &vec![0; quarter], &END].concat()));
    }

    #[test]
    fn headers_that_are_damaged_are_left_to_the_decoder() {
        let whole = of_groups(33, 1, &[0; 6]);
        let header = whole.len() - 8;
        assert!((0..header).all(|end| !is_damaged(&whole[..end])));
        for at in 2..header {
            for value in [0, 1, 0x7f, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] = value;
                is_damaged(&bytes);
            }
        }
    }

    #[test]
    fn a_block_with_more_than_64_values_is_damaged() {
        let mut bytes = of_groups(16, 0, &[0; 4]);
        // The only code of all values but the first then means 16 values of 0.
        bytes[45] = 0xf0;
        assert!(is_damaged(&bytes));
    }

    #[test]
    fn a_segment_may_have_several_tables() {
        let merged = |values: &[u8]| {
            let bytes = of_groups(33, 0, values);
            [&bytes[..4], &[0, 38], &bytes[6..24], &bytes[28..]].concat()
        };
        assert!(!is_damaged(&merged(&[0; 5])) && is_damaged(&merged(&[0; 3])));
    }

    #[test]
    fn blocks_of_a_single_component_are_not_grouped() {
        let tables = &of_groups(16, 0, &[])[..46];
        let frame = [MARKER, 0xc0, 0, 11, 8, 0, 8, 0, 72, 1, 1, 0x22, 0];
        let scan = [MARKER, START_OF_SCAN, 0, 8, 1, 1, 0, 0, 63, 0];
        // Nine blocks, which take 18 bits.
        assert!(!is_damaged(&[tables, &frame, &scan, &[0; 3], &END].concat()));
    }

    #[test]
    fn numbers_of_restarts_go_from_0_to_7_and_bytes_may_be_left_before_a_restart() {
        let values = |group: u8| match group {
            0 => vec![0, 0],
            _ => vec![MARKER, FIRST_RESTART + (group - 1) % 8, 0, 0],
        };
        let groups: Vec<u8> = (0..10).flat_map(values).collect();
        assert!(!is_damaged(&of_groups(160, 1, &groups)));
        let more = [&[0; 20][..], &[MARKER, 0], &groups].concat();
        assert!(!is_damaged(&of_groups(160, 1, &more)) && is_damaged(&of_groups(160, 1, &more[..40])));
    }
}
