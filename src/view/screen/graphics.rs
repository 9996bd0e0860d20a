//! The forms in which a terminal shows a picture: half blocks (characters that show two pixels each), kitty's graphics
//! protocol, and sixels.

use super::blocks::blocks;
use crate::error::{Error, Result};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use icy_sixel::SixelImage;
use image::RgbImage;
use std::fmt::Write as _;
use std::io::Write as _;

/// The form in which a terminal shows a picture.
#[derive(Clone, Copy, Debug, Eq, PartialEq, clap::ValueEnum)]
pub enum Graphics {
    /// Half blocks: characters that show two pixels each
    Blocks,
    /// Pixels, by kitty's graphics protocol (kitty, Ghostty, WezTerm, Konsole)
    Kitty,
    /// Pixels in 256 colours, as sixels (foot, Windows Terminal, xterm -ti vt340)
    Sixel,
}

/// Two questions to the terminal. The first question, in kitty's protocol, asks whether the terminal can show a picture
/// of one pixel; the terminal does not store this picture. The second question asks which kind of device the terminal
/// is. Nearly every terminal answers the question about its kind.
/// <https://sw.kovidgoyal.net/kitty/graphics-protocol/#querying-support-and-available-transmission-mediums>
const QUESTION: &str = "\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[c";
/// Longest wait for the terminal's answer, in milliseconds. A terminal behind a slow line may need a few
/// tenths of a second.
const PATIENCE_MS: u64 = 500;
/// The feature in a terminal's answer that shows that the terminal draws sixels (DEC STD 070).
const SIXELS: &str = "4";
/// Largest width and height, in pixels, of a picture of sixels: xterm cuts off the rest of a larger picture.
const MOST_SIXELS: u32 = 1000;
/// Largest part of a picture in one command of kitty's protocol, in bytes.
const CHUNK_BYTES: usize = 4096;

impl Graphics {
    /// Asks the terminal which graphics it can show. The terminal must be in raw mode.
    pub fn of_terminal() -> Self {
        let answer = xterm_query::query_osc(QUESTION, PATIENCE_MS);
        let best = answer.map_or(Self::Blocks, |answer| Self::answered(&answer));
        best.shown_by_tmux(std::env::var_os("TMUX").is_some())
    }

    /// Returns half blocks instead of sixels if tmux (a program that divides a terminal into several)
    /// answered the question which graphics the terminal can show. Since version 3.4, tmux says that it
    /// supports sixels even if the terminal around tmux cannot draw sixels; tmux then shows nothing or a
    /// placeholder.
    fn shown_by_tmux(self, is_tmux: bool) -> Self {
        if is_tmux && self == Self::Sixel { Self::Blocks } else { self }
    }

    /// Returns the best form in which a terminal that answers [`QUESTION`] with this text can show pictures.
    fn answered(answer: &str) -> Self {
        if answer.starts_with("_Gi=31;OK") {
            return Self::Kitty;
        }
        // An example of the answer is `[?62;4;22c`: 62 is the terminal's class, and 4 and 22 are its features.
        let features = answer.strip_prefix("[?").and_then(|rest| rest.split('c').next());
        match features.is_some_and(|features| features.split(';').skip(1).any(|one| one == SIXELS)) {
            true => Self::Sixel,
            false => Self::Blocks,
        }
    }

    /// Returns the size in pixels of a picture that fills `cells` characters across and down. A picture of
    /// sixels is at most `MOST_SIXELS` wide and high.
    ///
    /// `cell` is the size of a character in pixels.
    pub fn size(self, cells: [u32; 2], cell: [u32; 2]) -> [u32; 2] {
        let [across, down] = [0, 1].map(|axis| cells[axis] * self.pixels_of(cell)[axis]);
        match self {
            Self::Sixel => [across.min(MOST_SIXELS), down.min(MOST_SIXELS)],
            Self::Blocks | Self::Kitty => [across, down],
        }
    }

    /// Returns the number of pixels that a character of this size shows, across and down.
    pub fn pixels_of(self, cell: [u32; 2]) -> [u32; 2] {
        if self == Self::Blocks { [1, 2] } else { cell }
    }

    /// Returns the text that shows a picture. If the text has lines, each of them ends with `end`.
    pub fn text(self, picture: &RgbImage, end: &str) -> Result<String> {
        match self {
            Self::Blocks => Ok(blocks(picture, end)),
            Self::Kitty => kitty(picture).map_err(|error| failed(&error)),
            Self::Sixel => sixels(picture),
        }
    }

    /// Returns the text that removes the last picture from the terminal; empty unless the form is kitty's.
    pub fn end(self) -> &'static str {
        if self == Self::Kitty { "\x1b_Ga=d,d=I,i=1,q=2\x1b\\" } else { "" }
    }
}

/// Returns the commands of kitty's protocol that show `picture` in place of the last picture. The new picture
/// replaces the last one because both have the number 1. The commands contain the picture's red, green and
/// blue bytes, compressed by deflate and encoded in base64. The commands leave the cursor where it is, and do
/// not ask the terminal for an answer.
fn kitty(picture: &RgbImage) -> std::io::Result<String> {
    let mut deflated = ZlibEncoder::new(Vec::new(), Compression::fast());
    deflated.write_all(picture)?;
    let encoded = STANDARD.encode(deflated.finish()?);
    let mut keys = format!("a=T,f=24,o=z,s={},v={},i=1,p=1,C=1,", picture.width(), picture.height());
    let mut text = String::with_capacity(encoded.len() + encoded.len() / 64);
    let mut left = encoded.as_str();
    while !left.is_empty() {
        // Base64 is ASCII, so each byte is a character, and the text can be split after any byte.
        let (chunk, rest) = left.split_at(left.len().min(CHUNK_BYTES));
        // Writing to a String cannot fail.
        let _ = write!(text, "\x1b_G{keys}q=2,m={};{chunk}\x1b\\", u8::from(!rest.is_empty()));
        keys.clear();
        left = rest;
    }
    Ok(text)
}

fn sixels(picture: &RgbImage) -> Result<String> {
    let opaque = picture.pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2], u8::MAX]).collect();
    let [width, height] = [picture.width(), picture.height()].map(|length| length as usize);
    SixelImage::try_from_rgba(opaque, width, height)
        .and_then(|image| image.encode())
        .map_err(|error| failed(&error))
}

fn failed(error: &dyn std::error::Error) -> Error {
    Error::run(format!("the picture cannot be encoded for the terminal: {error}"))
        .with_help("--terminal=blocks draws the picture with half-block characters")
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::ZlibDecoder;
    use image::Rgb;
    use std::io::Read as _;

    #[test]
    fn terminals_say_what_they_can_show() {
        let answered = |answer| Graphics::answered(answer);
        assert_eq!(answered("_Gi=31;OK\x1b"), Graphics::Kitty);
        assert_eq!(answered("_Gi=31;EINVAL:what\x1b"), Graphics::Blocks);
        assert_eq!(answered("[?62;4;22c\x1b"), Graphics::Sixel);
        assert_eq!(answered("[?63;1;2;4c\x1b"), Graphics::Sixel);
        assert_eq!(answered("[?4;6c\x1b"), Graphics::Blocks, "a VT132 is of class 4");
        assert_eq!(answered("[?1;2c\x1b"), Graphics::Blocks);
        assert_eq!(answered("[?62;14;44c\x1b"), Graphics::Blocks);
        assert_eq!(answered(""), Graphics::Blocks);
    }

    #[test]
    fn tmux_is_not_believed_that_sixels_are_shown() {
        assert_eq!(Graphics::Sixel.shown_by_tmux(true), Graphics::Blocks);
        assert_eq!(Graphics::Sixel.shown_by_tmux(false), Graphics::Sixel);
        assert_eq!(Graphics::Kitty.shown_by_tmux(true), Graphics::Kitty);
    }

    #[test]
    fn a_picture_fills_the_characters() {
        assert_eq!(Graphics::Blocks.size([80, 23], [9, 18]), [80, 46]);
        assert_eq!(Graphics::Kitty.size([200, 60], [9, 18]), [1800, 1080]);
        assert_eq!(Graphics::Sixel.size([80, 60], [9, 18]), [720, 1000]);
    }

    /// Returns a picture in which no two pixels are equal, so that its compressed bytes need
    /// several chunks.
    fn noise() -> RgbImage {
        RgbImage::from_fn(70, 50, |x, y| {
            let mixed = (x * 50 + y).wrapping_mul(2_654_435_761);
            Rgb([(mixed >> 24) as u8, (mixed >> 16) as u8, (mixed >> 8) as u8])
        })
    }

    #[test]
    fn kitty_gets_the_bytes_in_chunks() {
        let picture = noise();
        let text = Graphics::Kitty.text(&picture, "\n").expect("it is encoded");
        let chunks: Vec<&str> = text.split_terminator("\x1b\\").collect();
        assert!(chunks.len() > 2, "{}", chunks.len());
        let mut encoded = String::new();
        for (number, chunk) in chunks.iter().enumerate() {
            let first = if number == 0 { "a=T,f=24,o=z,s=70,v=50,i=1,p=1,C=1," } else { "" };
            let more = u8::from(number + 1 < chunks.len());
            let data = chunk.strip_prefix(&format!("\x1b_G{first}q=2,m={more};")).expect("these keys");
            assert!(data.len() <= 4096 && (more == 0 || data.len() % 4 == 0), "{}", data.len());
            encoded.push_str(data);
        }
        let mut bytes = Vec::new();
        let deflated = STANDARD.decode(encoded).expect("base64");
        ZlibDecoder::new(&deflated[..]).read_to_end(&mut bytes).expect("zlib");
        assert!(bytes == picture.into_raw(), "the same bytes");
    }

    #[test]
    fn sixels_show_the_picture() {
        let picture =
            RgbImage::from_fn(20, 13, |x, y| Rgb([if x < 10 { 200 } else { 20 }, 40, y as u8 * 19]));
        let text = Graphics::Sixel.text(&picture, "\n").expect("it is encoded");
        let shown = SixelImage::decode(text.as_bytes()).expect("sixels");
        // Sixels are six rows high, so the picture's 13 rows become 18.
        assert_eq!(shown.dimensions(), (20, 18));
        let off = picture
            .pixels()
            .zip(shown.pixels.chunks_exact(4))
            .flat_map(|(pixel, rgba)| [0, 1, 2].map(|channel| pixel[channel].abs_diff(rgba[channel])));
        // Sixels have colours in per cent, and the error of a pixel's colour is distributed over the
        // neighbouring pixels. The colours that the terminal shows may therefore differ a little from the
        // picture's colours.
        assert!(off.clone().all(|off| off <= 24), "{:?}", off.max());
    }

    #[test]
    fn only_kitty_has_to_remove_its_picture() {
        assert_eq!(Graphics::Kitty.end(), "\x1b_Ga=d,d=I,i=1,q=2\x1b\\");
        assert_eq!([Graphics::Blocks, Graphics::Sixel].map(Graphics::end), [""; 2]);
    }
}
