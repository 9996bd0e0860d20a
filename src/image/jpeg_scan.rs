//! Checks the compressed values of a JPEG (ITU-T T.81, Huffman coding), which the decoder does not check: the decoder
//! replaces missing or damaged values by other values, and reports no error. The check reads only the lengths of the
//! values, so it takes less time than decoding.

use super::decode::segments_of;
use super::jpeg::START_OF_SCAN;
use super::jpeg_bits::{Bits, Codes, add_codes};
use super::jpeg_blocks::{Layered, pass_whole};
use super::jpeg_frame::{Frame, Scan, number};
use super::jpeg_scans;

/// The second bytes of the markers of two kinds of segments: code tables, and the number of groups of blocks between
/// restart markers.
const CODES: u8 = 0xc4;
const RESTARTS: u8 = 0xdd;
/// The largest number of scans that are checked. The decoder refuses pictures with more scans.
const MOST_SCANS: usize = 100;

/// Returns true if the compressed values of a scan end before the scan's last block, if they contain a code that does
/// not exist, or if a progressive picture lacks scans. If a file has lost many bytes, the loss nearly always has one of
/// these effects. A progressive picture also counts as damaged if bytes are left after a scan's last block. In other
/// pictures, such bytes are no damage, since some programs write them. A scan whose headers are not valid is not
/// checked, and neither are the scans after it.
pub fn is_damaged(bytes: &[u8]) -> bool {
    jpeg_scans::are_missing(bytes) || has_damaged_scan(bytes)
}

fn has_damaged_scan(bytes: &[u8]) -> bool {
    let (mut header, mut rest) = (Header::default(), bytes.get(2..).unwrap_or_default());
    for _ in 0..MOST_SCANS {
        let Some((scan, mut bits)) = header.next_scan(rest) else { return false };
        if header.pass_scan(&scan, &mut bits).is_none() {
            return true;
        }
        bits.pass_rest();
        rest = bits.rest;
    }
    false
}

/// The tables and settings that the segments before a scan define.
#[derive(Default)]
struct Header {
    codes: [Codes; 8],
    /// Number of groups of blocks between restart markers; 0 if there are no restart markers.
    restarts: usize,
    frame: Option<Frame>,
}

impl Header {
    /// Reads the segments up to the header of the next scan. Returns the scan and its bits; `None` if there is no
    /// further scan, or if a segment is not valid.
    fn next_scan<'a>(&mut self, rest: &'a [u8]) -> Option<(Scan, Bits<'a>)> {
        for (kind, data, rest) in segments_of(rest) {
            match kind {
                CODES => add_codes(&mut self.codes, data)?,
                RESTARTS => self.restarts = usize::from(number(data, 0)?),
                START_OF_SCAN => {
                    let scan = self.frame.as_ref()?.scan(data)?;
                    let is_known = scan.tables().all(|table| !self.codes[table].is_empty());
                    return is_known.then_some((scan, Bits::of(rest)));
                }
                // This is a second frame, or the end of the picture; another picture may follow the end.
                0xc0..=0xcf | 0xd8 | 0xd9 if self.frame.is_some() => return None,
                0xc0..=0xcf => self.frame = Some(Frame::of_segment(kind, data)?),
                _ => {}
            }
        }
        None
    }

    /// Skips all blocks of a scan. Returns `None` if the bits end before the last block, if they contain a code that
    /// does not exist, or if the scan of a progressive picture has further bits after its last block.
    fn pass_scan(&mut self, scan: &Scan, bits: &mut Bits<'_>) -> Option<()> {
        let nonzero = self.frame.as_mut()?.nonzero(scan);
        let (mut layered, mut unused) = (scan.layer.map(Layered::new), 0);
        for group in 0..scan.groups {
            if self.restarts > 0 && group > 0 && group % self.restarts == 0 {
                bits.pass_restart((group / self.restarts - 1) as u8 % 8)?;
                layered = scan.layer.map(Layered::new);
            }
            for part in &scan.parts {
                let codes = part.tables.map(|table| &self.codes[table]);
                let nonzero = nonzero.get_mut(group).unwrap_or(&mut unused);
                for _ in 0..part.blocks {
                    match &mut layered {
                        None => pass_whole(bits, codes)?,
                        Some(layered) => layered.pass(bits, codes, nonzero)?,
                    }
                }
            }
        }
        (scan.layer.is_none() || !bits.has_more()).then_some(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::jpeg::MARKER;
    use super::super::jpeg_bits::FIRST_RESTART;
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

    /// A progressive picture of 24 x 16 pixels as the library libjpeg-turbo writes it: ten scans, of which four have
    /// further bits of coefficients.
    const PROGRESSIVE: &str = "\
        ffd8ffe000104a46494600010100000100010000ffdb004300140e0f120f0d14121012171514181e32211e1c1c1e3d2c\
        2e243249404c4b47404645505a736250556d5645466488656d777b8182814e608d978c7d96737e817cffdb0043011517\
        171e1a1e3b21213b7c5346537c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c7c\
        7c7c7c7c7c7c7c7c7c7c7c7c7c7cffc20011080010001803012200021101031101ffc400170000030100000000000000\
        00000000000000030405ffc40014010100000000000000000000000000000004ffda000c030100021003100000017912\
        888b0cf121ffc40017100101010100000000000000000000000000010211ffda00080101000105029a5daedd5aebffc4\
        0017110101010100000000000000000000000002010011ffda0008010301013f014219a8eeffc4001911000105000000\
        00000000000000000000000102030411ffda0008010201013f016c5a2573ffc400141001000000000000000000000000\
        00000020ffda0008010100063f025fffc40017100101010100000000000000000000000001001151ffda000801010001\
        3f210820eda25b4b7fffda000c0301000200030000001018efffc4001511010100000000000000000000000000001100\
        ffda0008010301013f102131bfffc400161101010100000000000000000000000000010011ffda0008010201013f1017\
        0e5fffc400191001010003010000000000000000000000010011213141ffda0008010100013f101019b9c793bc4ef6ec\
        fc2bab897fffd9";

    fn progressive() -> Vec<u8> {
        let digit = |digit: u8| char::from(digit).to_digit(16).unwrap() as u8;
        PROGRESSIVE.as_bytes().chunks_exact(2).map(|pair| digit(pair[0]) << 4 | digit(pair[1])).collect()
    }

    /// Returns the ranges of the scans' values in a file.
    fn scans(file: &[u8]) -> Vec<std::ops::Range<usize>> {
        let starts = file.windows(2).enumerate().filter(|(_, pair)| *pair == [MARKER, START_OF_SCAN]);
        let of_start = |(at, _): (usize, &[u8])| {
            let begin = at + 2 + usize::from(number(file, at + 2).unwrap());
            let mut bits = Bits::of(&file[begin..]);
            bits.pass_rest();
            begin..file.len() - bits.rest.len()
        };
        starts.map(of_start).collect()
    }

    #[test]
    fn each_scan_of_a_progressive_picture_has_the_values_of_its_blocks_and_no_more() {
        let whole = progressive();
        assert!(!is_damaged(&whole));
        let scans = scans(&whole);
        assert_eq!(scans.len(), 10);
        for scan in scans {
            let with = |values: &[u8]| [&whole[..scan.start], values, &whole[scan.end..]].concat();
            let values = &whole[scan.clone()];
            let is_long = values.len() > 3;
            assert!(!is_long || is_damaged(&with(&values[..values.len() - 3])), "{scan:?}: cut off");
            assert!(is_damaged(&with(&[values, &[0; 3]].concat())), "{scan:?}: more");
            assert!(!is_damaged(&with(&[values, &[0]].concat())), "{scan:?}: one byte more");
        }
        let last = whole.windows(2).rposition(|pair| pair == [MARKER, START_OF_SCAN]).unwrap();
        assert!(is_damaged(&[&whole[..last], &END].concat()), "without the last scan");
    }
}
