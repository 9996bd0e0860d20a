//! Divides the bytes of a PNG into chunks.

/// Number of bytes of a PNG before its first chunk.
const SIGNATURE_BYTES: usize = 8;
/// Number of bytes for the length of a chunk.
const LENGTH_BYTES: usize = 4;
/// Number of bytes for the type and the checksum of a chunk. The chunk's length and data are not included.
const FRAME_BYTES: usize = 8;

/// Returns the chunks of a PNG: for each, its type, its stated length and the bytes of its data. If the file ends
/// within the data of a chunk, these data are shorter than stated.
pub fn png_chunks(bytes: &[u8]) -> impl Iterator<Item = (&[u8], usize, &[u8])> {
    let mut rest = bytes.get(SIGNATURE_BYTES..).unwrap_or_default();
    std::iter::from_fn(move || {
        let (length, after) = rest.split_first_chunk::<LENGTH_BYTES>()?;
        let length = u32::from_be_bytes(*length) as usize;
        let (kind, data) = after.split_at_checked(4)?;
        rest = after.get(length.saturating_add(FRAME_BYTES)..).unwrap_or_default();
        Some((kind, length, &data[..length.min(data.len())]))
    })
}
