//! Checks that a progressive JPEG (ITU-T T.81, annex G) has its last scans. A block of a component has 64 coefficients;
//! each scan contains some bits of some coefficients of one or more components. The decoder also decodes a file without
//! its last scans: the picture is then blurred or has wrong colours.

use super::decode::segments_of;
use super::jpeg::{END_OF_IMAGE, MARKER, START_OF_SCAN};

/// The second byte of the marker of a progressive frame with Huffman coding.
const PROGRESSIVE: u8 = 0xc2;
/// Largest number of components of a progressive frame, and of a scan.
const MOST_COMPONENTS: usize = 4;

/// Returns true if, for some coefficient of some component, no scan of a progressive JPEG has the coefficient's last
/// bit. Programs write all bits of all coefficients. If the last bit of a coefficient is missing, the file has
/// therefore lost scans, for example because the file was cut off. Returns false for other JPEGs, and if the header of
/// the frame is not valid.
pub(super) fn are_missing(bytes: &[u8]) -> bool {
    // For each component: its identifier in the file, and a word with one bit for each coefficient. The bit is set if
    // no scan so far has the coefficient's last bit.
    let mut components: Vec<(u8, u64)> = Vec::new();
    let mut rest = bytes.get(2..).unwrap_or_default();
    while let Some(scan) = pass_header(rest, &mut components) {
        rest = scan;
    }
    components.iter().any(|(_, missing)| *missing != 0)
}

/// Reads the segments up to the header of the next scan. Removes from `components` the coefficients whose last bits are
/// in this scan. Returns the bytes after this scan; `None` if there is no further scan, or if a header is not valid.
fn pass_header<'a>(rest: &'a [u8], components: &mut Vec<(u8, u64)>) -> Option<&'a [u8]> {
    for (kind, data, after) in segments_of(rest) {
        match kind {
            PROGRESSIVE => {
                let parts = data.get(6..)?.chunks_exact(3).take(MOST_COMPONENTS);
                *components = parts.map(|part| (part[0], u64::MAX)).collect();
            }
            START_OF_SCAN => {
                let count = usize::from(*data.first()?).min(MOST_COMPONENTS);
                let names = data.get(1..1 + 2 * count)?;
                let [start, end, bits] = *data.get(1 + names.len()..)?.first_chunk()?;
                if start <= end && end < 64 && bits & 15 == 0 {
                    let coefficients = u64::MAX >> (63 - (end - start)) << start;
                    let is_named = |name: u8| names.chunks_exact(2).any(|named| named[0] == name);
                    let named = components.iter_mut().filter(|(name, _)| is_named(*name));
                    named.for_each(|(_, missing)| *missing &= !coefficients);
                }
                return pass_scan(after);
            }
            // The picture ends here; another picture may follow in the file.
            kind if kind == END_OF_IMAGE[1] => return None,
            _ => {}
        }
    }
    None
}

/// Returns the rest of the file, from the first marker after a scan.
fn pass_scan(rest: &[u8]) -> Option<&[u8]> {
    // If a zero or the number of a restart follows the first byte of a marker, the scan goes on.
    let ends = |pair: &[u8]| pair[0] == MARKER && !matches!(pair[1], 0 | 0xd0..=0xd7 | MARKER);
    rest.windows(2).position(ends).map(|at| &rest[at..])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a progressive JPEG with the components 1 and 2, and with these scans: the identifiers of their
    /// components, the first and the last coefficient, and a byte with the last bit of the earlier scan (the upper
    /// four bits) and of this scan (the lower four).
    fn of_scans(scans: &[(&[u8], [u8; 2], u8)]) -> Vec<u8> {
        let frame = [MARKER, 0xd8, MARKER, PROGRESSIVE, 0, 14, 8, 0, 8, 0, 8, 2, 1, 0x11, 0, 2, 0x11, 0];
        let scan = |(names, [start, end], bit): &(&[u8], [u8; 2], u8)| {
            let named: Vec<u8> = names.iter().flat_map(|name| [*name, 0]).collect();
            let length = 6 + named.len() as u8;
            let header =
                [&[MARKER, START_OF_SCAN, 0, length, names.len() as u8][..], &named, &[*start, *end, *bit]];
            [&header.concat()[..], &[7, MARKER, 0, MARKER, 0xd0, 9]].concat()
        };
        [&frame[..], &scans.iter().flat_map(scan).collect::<Vec<_>>(), &[MARKER, 0xd9]].concat()
    }

    #[test]
    fn every_coefficient_of_a_progressive_picture_needs_a_scan_with_its_last_bit() {
        let all: [(&[u8], [u8; 2], u8); 5] = [
            (&[1, 2], [0, 0], 0x01),
            (&[2], [1, 63], 0),
            (&[1], [1, 63], 0x01),
            (&[1], [1, 63], 0x10),
            (&[1, 2], [0, 0], 0x10),
        ];
        assert!(!are_missing(&of_scans(&all)));
        let more = [&of_scans(&all)[..], &of_scans(&all[..1])].concat();
        assert!(!are_missing(&more), "another picture follows");
        assert!((0..5).all(|count| are_missing(&of_scans(&all[..count]))));
        let without = |number: usize| are_missing(&of_scans(&[&all[..number], &all[number + 1..]].concat()));
        assert_eq!([0, 1, 2, 3, 4].map(without), [false, true, false, true, true]);
        let split = [(&[1_u8, 2][..], [0, 0], 0), (&[2], [1, 63], 0), (&[1], [1, 8], 0), (&[1], [9, 63], 0)];
        assert!(!are_missing(&of_scans(&split)) && are_missing(&of_scans(&split[..3])));
    }

    /// A header with thousands of components, and thousands of scans, would take half a minute without the limit.
    #[test]
    fn only_four_components_count() {
        let four: [u8; 4] = [1, 2, 3, 4];
        let mut five = of_scans(&[(&four, [0, 63], 0), (&[5], [0, 63], 0)]);
        let frame = [MARKER, PROGRESSIVE, 0, 23, 8, 0, 8, 0, 8, 5];
        let parts: Vec<u8> = (1..=5).flat_map(|name| [name, 0x11, 0]).collect();
        five.splice(2..18, [&frame[..], &parts].concat());
        let mut components = Vec::new();
        assert!(pass_header(&five[2..], &mut components).is_some());
        assert_eq!(components, four.map(|name| (name, 0)));
    }

    #[test]
    fn what_is_not_progressive_or_damaged_in_its_header_has_no_missing_scans() {
        let mut other = of_scans(&[(&[1], [0, 63], 0)]);
        assert!(are_missing(&other));
        assert!(!are_missing(&[&other[..], b"\xff\xd9"].concat()[..2]) && !are_missing(&[]));
        other[3] = 0xc0;
        assert!(!are_missing(&other));
    }
}
