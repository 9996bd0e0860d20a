//! Writes moving pictures to one file or stream.

use super::Frame;
use crate::error::Result;
use crate::output::{Target, mark};
use image::RgbImage;
use rayon::prelude::*;
use std::io::{BufWriter, Error, ErrorKind, Result as IoResult, Write};

/// A moving picture: a file or stream of frames.
#[derive(Debug)]
pub struct Movie {
    target: Target,
    size: [u32; 2],
    /// Frames per second.
    rate: u16,
    format: Format,
}

#[derive(Clone, Copy, Debug)]
enum Format {
    /// An animated PNG with this number of frames.
    Apng(u32),
    /// A stream in the format YUV4MPEG2, with the colours of BT.709 in the limited range (Y from 16 to 235), and one
    /// chroma sample per 2 x 2 pixels (4:2:0).
    Y4m,
}

impl Movie {
    /// Makes a movie that is an animated PNG, which repeats without end.
    pub fn apng(target: Target, size: [u32; 2], rate: u16, frames: u32) -> Self {
        Self { target, size, rate, format: Format::Apng(frames) }
    }

    /// Makes a movie that is a stream on standard output, for a video encoder.
    pub fn y4m(target: Target, size: [u32; 2], rate: u16) -> Self {
        Self { target, size, rate, format: Format::Y4m }
    }

    /// Returns true if the movie is a stream for an encoder.
    pub fn is_stream(&self) -> bool {
        matches!(self.format, Format::Y4m)
    }

    /// Returns the name that messages use for the file or stream.
    pub fn name(&self) -> String {
        match self.format {
            Format::Apng(_) => self.target.path().display().to_string(),
            Format::Y4m => "standard output (y4m)".to_owned(),
        }
    }

    /// Writes each frame as soon as it arrives, with the frame's own display settings. An animated PNG appears at its
    /// path only when it is complete. Returns true if the reader of a stream closed the stream before the last frame
    /// was written.
    pub fn write(&self, frames: impl Iterator<Item = Frame>) -> Result<bool> {
        match self.format {
            Format::Apng(count) => {
                self.target.write(|file| self.write_apng(file, frames, count)).map(|()| false)
            }
            Format::Y4m => {
                let frames = frames.map(|frame| frame.into_8_bits().into_rgb8());
                let mut out = BufWriter::new(std::io::stdout().lock());
                was_closed(write_y4m(&mut out, frames, self.size, self.rate).and_then(|()| out.flush()))
            }
        }
    }

    fn write_apng(
        &self,
        file: &mut std::fs::File,
        frames: impl Iterator<Item = Frame>,
        count: u32,
    ) -> IoResult<()> {
        let mut frames = frames.peekable();
        let has_alpha = frames.peek().is_some_and(Frame::has_alpha);
        let mut out = mark::Insert::new(BufWriter::new(file), mark::png());
        let mut encoder = png::Encoder::new(&mut out, self.size[0], self.size[1]);
        encoder.set_color(if has_alpha { png::ColorType::Rgba } else { png::ColorType::Rgb });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_animated(count, 0).map_err(Error::other)?;
        encoder.set_frame_delay(1, self.rate).map_err(Error::other)?;
        // If casting a frame fails, fewer frames arrive than the header promises. `finish` then fails, and the file is
        // not replaced.
        encoder.validate_sequence(true);
        let mut writer = encoder.write_header().map_err(Error::other)?;
        for frame in frames {
            writer.write_image_data(frame.into_8_bits().as_bytes()).map_err(Error::other)?;
        }
        writer.finish().map_err(Error::other)?;
        out.flush()
    }
}

/// Returns true if a stream was not written to its end because its reader has closed it. A closed stream is no
/// error: a video encoder closes the stream if it needs no more frames.
fn was_closed(written: IoResult<()>) -> Result<bool> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(true),
        other => other.map(|()| false).map_err(|error| crate::Error::unwritable_output(&error)),
    }
}

/// Writes frames as YUV4MPEG2, with one chroma sample in the middle of each block of 2 x 2 pixels.
fn write_y4m(
    out: &mut impl Write,
    frames: impl Iterator<Item = RgbImage>,
    [width, height]: [u32; 2],
    rate: u16,
) -> IoResult<()> {
    writeln!(out, "YUV4MPEG2 W{width} H{height} F{rate}:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED")?;
    for frame in frames {
        out.write_all(b"FRAME\n")?;
        out.write_all(&yuv(&frame))?;
    }
    Ok(())
}

/// Weights of red, green and blue in luma: ITU-R BT.709-6, items 3.2 to 3.4.
const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Returns the planes Y, Cb and Cr of a frame in 8 bits and the limited range (Y from 16 to 235, Cb and Cr from 16 to
/// 240).
fn yuv(frame: &RgbImage) -> Vec<u8> {
    let (width, height) = (frame.width() as usize, frame.height() as usize);
    let row = |y: usize| frame.as_raw()[3 * width * y..3 * width * (y + 1)].as_chunks().0;
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut planes = vec![0; width * height + 2 * half_width * half_height];
    let (lumas, chroma) = planes.split_at_mut(width * height);
    lumas.par_chunks_mut(width).enumerate().for_each(|(y, lumas)| {
        lumas
            .iter_mut()
            .zip(row(y))
            .for_each(|(value, rgb)| *value = rounded(16.0 + 219.0 * luma(parts(rgb))));
    });
    // The plane Cb, which is computed from blue, comes before the plane Cr, which is computed from red.
    let (blue, red) = chroma.split_at_mut(half_width * half_height);
    let rows = blue.par_chunks_mut(half_width).zip(red.par_chunks_mut(half_width)).enumerate();
    rows.for_each(|(y, (blue, red))| {
        let rows = [row(2 * y), row((2 * y + 1).min(height - 1))];
        for (x, (blue, red)) in blue.iter_mut().zip(red).enumerate() {
            let mean = mean(rows, [2 * x, (2 * x + 1).min(width - 1)]);
            let grey = luma(mean);
            for (value, channel) in [(blue, 2), (red, 0)] {
                let difference = (mean[channel] - grey) / (2.0 * (1.0 - WEIGHTS[channel]));
                *value = rounded(128.0 + 224.0 * difference);
            }
        }
    });
    planes
}

/// Returns a pixel's channels as numbers from 0 to 1.
fn parts(rgb: &[u8; 3]) -> [f32; 3] {
    rgb.map(|value| f32::from(value) / 255.0)
}

fn luma(rgb: [f32; 3]) -> f32 {
    WEIGHTS.iter().zip(rgb).map(|(weight, value)| weight * value).sum()
}

/// Returns the mean colour of four pixels: those at two columns of two rows.
fn mean([above, below]: [&[[u8; 3]]; 2], [left, right]: [usize; 2]) -> [f32; 3] {
    let four = [above[left], above[right], below[left], below[right]].map(|rgb| parts(&rgb));
    std::array::from_fn(|channel| four.iter().map(|rgb| rgb[channel]).sum::<f32>() / 4.0)
}

/// Rounds a positive value of a plane.
fn rounded(value: f32) -> u8 {
    (value + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Radiance;
    use crate::scene::Display;
    use image::Rgb;

    #[test]
    fn known_colours_have_the_standards_numbers() {
        // The expected Y, Cb and Cr of white, black, red, green and blue, by BT.709 in 8 bits.
        for (rgb, expected) in [
            ([255, 255, 255], [235, 128, 128]),
            ([0, 0, 0], [16, 128, 128]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 255, 0], [173, 42, 26]),
            ([0, 0, 255], [32, 240, 118]),
        ] {
            let planes = yuv(&RgbImage::from_pixel(3, 1, Rgb(rgb)));
            assert_eq!(planes.len(), 3 + 2 + 2, "odd sizes are rounded up");
            assert_eq!([planes[0], planes[3], planes[5]], expected, "{rgb:?}");
        }
    }

    #[test]
    fn a_chroma_sample_is_that_of_the_mean_of_its_four_pixels() {
        // The blocks of this picture have 2 x 2, 1 x 2, 2 x 1 and 1 x 1 pixels.
        let picture =
            RgbImage::from_fn(3, 3, |x, y| Rgb([40 * x as u8, 80 * y as u8, 20 + 50 * (x + y) as u8]));
        let planes = yuv(&picture);
        for (at, rgb) in [[20, 40, 70], [80, 40, 145], [20, 160, 145], [80, 160, 220]].into_iter().enumerate()
        {
            let even = yuv(&RgbImage::from_pixel(1, 1, Rgb(rgb)));
            assert_eq!([planes[9 + at], planes[13 + at]], even[1..], "block {at}");
        }
        let lumas = picture.pixels().map(|pixel| yuv(&RgbImage::from_pixel(1, 1, *pixel))[0]);
        assert!(lumas.eq(planes[..9].iter().copied()));
    }

    #[test]
    fn a_stream_has_a_header_and_a_mark_before_each_frame() {
        let mut out = Vec::new();
        let frames = [RgbImage::new(4, 2), RgbImage::new(4, 2)];
        write_y4m(&mut out, frames.into_iter(), [4, 2], 30).unwrap_or_else(|error| panic!("{error}"));
        let header = b"YUV4MPEG2 W4 H2 F30:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
        assert!(out.starts_with(header));
        assert_eq!(out.len(), header.len() + 2 * (6 + 8 + 2 + 2));
    }

    #[test]
    fn a_stream_that_its_reader_has_closed_is_distinguished_from_a_complete_one() {
        let of = |kind: ErrorKind| was_closed(Err(Error::from(kind)));
        assert!(matches!((was_closed(Ok(())), of(ErrorKind::BrokenPipe)), (Ok(false), Ok(true))));
        let error = of(ErrorKind::StorageFull).unwrap_err().to_string();
        assert!(error.starts_with("cannot write to standard output: "), "{error}");
    }

    /// Writes an animated PNG of two frames, 25 per second. Only the first `count` of the two frames are
    /// given to the writer.
    fn write_frames(path: &std::path::Path, count: usize) -> Result<bool> {
        let frames = [0.0, 1.0].map(|light| Radiance { pixels: vec![[light; 3]; 2], ..Radiance::new(2, 1) });
        let frames = frames.into_iter().take(count).map(|frame| Frame::Radiance(frame, Display::default()));
        Movie::apng(Target::of_results(path), [2, 1], 25, 2).write(frames)
    }

    /// Returns the bytes of an animated PNG of two frames, 25 per second.
    fn animated() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.apng");
        write_frames(&path, 2).unwrap();
        std::fs::read(&path).unwrap()
    }

    #[test]
    fn an_animated_png_that_lacks_frames_does_not_replace_a_complete_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.apng");
        write_frames(&path, 2).unwrap();
        let complete = std::fs::read(&path).unwrap();
        for count in [0, 1] {
            assert!(write_frames(&path, count).is_err(), "{count}");
            assert_eq!(std::fs::read(&path).unwrap(), complete, "{count}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
    }

    #[test]
    fn messages_name_the_file_or_the_stream_with_its_format() {
        let [file, stream] = ["film/a.apng", "-"].map(Target::of_results);
        let movies = [Movie::apng(file, [2, 1], 25, 2), Movie::y4m(stream, [2, 1], 25)];
        assert_eq!(movies.each_ref().map(Movie::name), ["film/a.apng", "standard output (y4m)"]);
        assert_eq!(movies.each_ref().map(Movie::is_stream), [false, true]);
    }

    #[test]
    fn an_animated_png_repeats_for_ever() {
        let file = animated();
        let reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info().unwrap();
        let control = reader.info().animation_control().expect("it is animated");
        assert_eq!((control.num_frames, control.num_plays), (2, 0), "0 is for ever");
    }

    #[test]
    fn each_frame_of_an_animated_png_is_shown_for_its_part_of_a_second() {
        let file = animated();
        // In the chunk `fcTL`, five numbers of 32 bits follow the name. Then come two numbers of 16 bits: the
        // numerator and denominator of the frame's delay in seconds.
        let chunks = file.windows(28).filter(|bytes| bytes.starts_with(b"fcTL"));
        let delays: Vec<Vec<u8>> = chunks.map(|chunk| chunk[24..].to_vec()).collect();
        assert_eq!(delays, vec![vec![0, 1, 0, 25]; 2]);
    }
}
