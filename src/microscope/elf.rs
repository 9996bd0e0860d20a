//! Finds the ELF files within a program's binary. A driver for a CPU may store whole ELF files in the binary. For
//! example, PoCL's binary contains the files of a folder, one after another.

/// The bytes with which a 64-bit, little-endian ELF file begins.
const MAGIC: [u8; 6] = [0x7f, b'E', b'L', b'F', 2, 1];

/// Returns every whole ELF file in `binary`, in order, each with the number of bytes before the file.
pub fn files(binary: &[u8]) -> Vec<(usize, &[u8])> {
    let mut files = Vec::new();
    let mut at = 0;
    while let Some(offset) = binary[at..].windows(MAGIC.len()).position(|bytes| bytes == MAGIC) {
        let rest = &binary[at + offset..];
        let file = length(rest).and_then(|length| rest.get(..length));
        files.extend(file.map(|file| (at + offset, file)));
        at += offset + file.map_or(MAGIC.len(), <[u8]>::len);
    }
    files
}

/// Returns the length of the ELF file at the start of `file`. Linkers write the section table at the end of a
/// file, so the file ends where the section table ends. Returns `None` if the file has no section table.
fn length(file: &[u8]) -> Option<usize> {
    let u16_at = |at: usize| Some(u16::from_le_bytes(file.get(at..at + 2)?.try_into().ok()?));
    let table = u64::from_le_bytes(file.get(40..48)?.try_into().ok()?);
    let (entry_bytes, entries) = (u16_at(58)?, u16_at(60)?);
    let length = usize::try_from(table).ok()?.checked_add(usize::from(entry_bytes) * usize::from(entries))?;
    (table >= 64).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes an ELF file of `bytes` bytes, which ends with a table of two sections.
    fn file(bytes: usize, fill: u8) -> Vec<u8> {
        let mut file = vec![fill; bytes];
        file[..6].copy_from_slice(&MAGIC);
        file[40..48].copy_from_slice(&(bytes as u64 - 128).to_le_bytes());
        file[58..62].copy_from_slice(&[64, 0, 2, 0]);
        file
    }

    #[test]
    fn files_are_found_between_other_bytes_and_torn_ones_are_left_out() {
        let (one, other) = (file(300, 1), file(200, 2));
        let binary = [b"poclbin\0", &one[..], b"name.so", &other[..], b"rest", &one[..250]].concat();
        assert_eq!(files(&binary), [(8, &one[..]), (315, &other[..])]);
        // In this ELF header, the offset of the section table is 0: the file has no section table.
        let header = [&MAGIC[..], &[0; 58]].concat();
        for none in [&header, &b""[..], b"\x7fELF", &MAGIC, &one[..299], b".version 8.0"] {
            assert!(files(none).is_empty(), "{none:?}");
        }
    }
}
