//! Encodes a PNG while further rows of the picture still arrive. The compression is chosen before the rows are known.
//! The file of a picture of noise, which cannot be compressed, therefore has over a third more bytes than the
//! picture's pixels.

use super::encode::png_encoder;
use png::{ColorType, StreamWriter};
use std::io::{Error, Result, Write};
use std::sync::mpsc::{Receiver, Sender, channel};

/// Number of bytes of compressed pixels in a chunk of the PNG file.
const CHUNK_BYTES: usize = 1 << 16;

/// A PNG that is being encoded while rows of the picture still arrive.
pub struct Encoding {
    /// The encoder, or the error with which it failed.
    encoder: Result<Box<StreamWriter<'static, Pieces>>>,
    /// The channel through which the encoder passes the bytes of the PNG file.
    encoded: Receiver<Vec<u8>>,
}

impl Encoding {
    /// Starts to encode a picture of the given size in pixels, with red, green and blue.
    pub fn new([width, height]: [u32; 2]) -> Self {
        let (pieces, encoded) = channel();
        let encoder = png_encoder(Pieces(pieces), (width, height), ColorType::Rgb).write_header();
        let encoder = encoder.and_then(|writer| writer.into_stream_writer_with_size(CHUNK_BYTES));
        Self { encoder: encoder.map(Box::new).map_err(Error::other), encoded }
    }

    /// Adds the next rows of the picture, and encodes them.
    pub fn take(&mut self, rows: &[u8]) {
        if let Ok(encoder) = &mut self.encoder
            && let Err(error) = encoder.write_all(rows)
        {
            self.encoder = Err(error);
        }
    }

    /// Returns the bytes of the PNG file, once all rows have been added. Fails if rows are missing.
    pub fn finish(self) -> Result<Vec<u8>> {
        self.encoder?.finish().map_err(Error::other)?;
        Ok(self.encoded.into_iter().collect::<Vec<_>>().concat())
    }
}

/// Passes all bytes that are written to it through a channel.
struct Pieces(Sender<Vec<u8>>);

impl Write for Pieces {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        // Sending fails only if the receiver is gone; then nobody needs the bytes.
        let _ = self.0.send(bytes.to_vec());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_without_all_its_rows_is_an_error() {
        for (rows, is_whole) in [(&[5; 12][..], true), (&[5; 6], false), (&[5; 18], false)] {
            let mut encoding = Encoding::new([2, 2]);
            encoding.take(rows);
            assert_eq!(encoding.finish().is_ok(), is_whole, "{} bytes", rows.len());
        }
    }
}
