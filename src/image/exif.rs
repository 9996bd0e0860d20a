//! Reads the colour space from the Exif data of a picture (JEITA CP-3451, "Exchangeable image file format").

/// The tags of two entries that point to further lists. The first list has an entry `EXIF`, which points to the second
/// list, that of Exif. The second list has an entry `INTEROPERABILITY`, which points to a third list.
const EXIF: u16 = 0x8769;
const INTEROPERABILITY: u16 = 0xa005;
const COLOUR_SPACE: u16 = 0xa001;
/// The tag of the name of the rules by which a camera has written a picture. The rules `R03` are those for Adobe RGB.
const RULES: u16 = 1;

/// Returns true if Exif data, which begin with the byte order, state the colour space Adobe RGB. The number 65535 for
/// the colour space means that none is stated: Photoshop writes this number into many sRGB pictures. Therefore, the
/// function returns false for the number 65535.
pub fn states_adobe_rgb(exif: &[u8]) -> bool {
    let exif = Exif { bytes: exif, is_little: exif.starts_with(b"II") };
    let Some(list) = exif.u32(4).and_then(|first| exif.pointer(first, EXIF)) else { return false };
    let is_adobe = exif.entry(list, COLOUR_SPACE).and_then(|value| exif.u16(value)) == Some(2);
    let rules = exif.pointer(list, INTEROPERABILITY).and_then(|list| exif.entry(list, RULES));
    is_adobe || rules.is_some_and(|at| exif.bytes.get(at..).is_some_and(|text| text.starts_with(b"R03")))
}

struct Exif<'a> {
    bytes: &'a [u8],
    is_little: bool,
}

impl Exif<'_> {
    fn u16(&self, at: usize) -> Option<u16> {
        let bytes = *self.bytes.get(at..)?.first_chunk()?;
        Some(if self.is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn u32(&self, at: usize) -> Option<usize> {
        let bytes = *self.bytes.get(at..)?.first_chunk()?;
        let value = if self.is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) };
        Some(value as usize)
    }

    /// Returns the position, in the Exif data, of the value of the entry with the tag `tag`. `list` is the position of
    /// the entry's list.
    fn entry(&self, list: usize, tag: u16) -> Option<usize> {
        let entries = (0..usize::from(self.u16(list)?)).map(|index| list + 2 + 12 * index);
        entries.into_iter().find(|entry| self.u16(*entry) == Some(tag)).map(|entry| entry + 8)
    }

    /// Returns the position of the list to which an entry points.
    fn pointer(&self, list: usize, tag: u16) -> Option<usize> {
        self.entry(list, tag).and_then(|value| self.u32(value))
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Returns Exif data that state a colour space and the name of rules.
    pub fn exif(is_little: bool, space: u16, rules: &[u8; 4]) -> Vec<u8> {
        let u16 = |value: u16| if is_little { value.to_le_bytes() } else { value.to_be_bytes() };
        let u32 = |value: u32| if is_little { value.to_le_bytes() } else { value.to_be_bytes() };
        let short = |value: u16| [u16(value), [0; 2]].concat();
        let entry = |tag: u16, kind: u16, value: &[u8]| [&u16(tag), &u16(kind), &u32(1)[..], value].concat();
        [
            if is_little { &b"II"[..] } else { b"MM" },
            &u16(42),
            &u32(8),
            &[&u16(1)[..], &entry(EXIF, 4, &u32(26)), &[0; 4]].concat(),
            &[&u16(2)[..], &entry(COLOUR_SPACE, 3, &short(space))].concat(),
            &[&entry(INTEROPERABILITY, 4, &u32(56))[..], &[0; 4]].concat(),
            &[&u16(1)[..], &entry(RULES, 2, rules), &[0; 4]].concat(),
        ]
        .concat()
    }

    #[test]
    fn adobe_rgb_is_stated_by_its_number_or_by_the_rules_for_it() {
        for is_little in [false, true] {
            for (space, rules, expected) in [
                (1, b"R98\0", false),
                (0xffff, b"R98\0", false),
                (0xffff, b"R03\0", true),
                (2, b"R98\0", true),
            ] {
                let exif = exif(is_little, space, rules);
                assert_eq!(states_adobe_rgb(&exif), expected, "{is_little} {space} {rules:?}");
                let is_read = |end: usize| states_adobe_rgb(&exif[..end]);
                assert!(expected || !(0..exif.len()).any(is_read), "Exif that is cut off");
            }
        }
    }

    #[test]
    fn the_first_list_is_where_the_header_says() {
        let mut bytes = exif(true, 2, b"R98\0");
        let (list, place) = (bytes[8..26].to_vec(), bytes.len() as u32);
        bytes[4..8].copy_from_slice(&place.to_le_bytes());
        bytes[8..26].fill(0);
        assert!(states_adobe_rgb(&[bytes, list].concat()));
    }
}
