//! Reads the frame that a caster has cast last.

use super::Caster;
use crate::image::{Radiance, Shown, TOGETHER};
use crate::launch::buffers::read_rows;
use crate::launch::setup::Working;
use crate::launch::{LaunchError, ShowProgram};
use crate::scene::Display;
use image::RgbImage;
use ocl::prm::Float4;
use rayon::prelude::*;

impl Caster {
    /// Reads the image of the last frame, and counts the pixels that hit something. Returns an error if the heap of the
    /// working vectors was too small.
    pub fn read(&self) -> Result<(Radiance, usize), LaunchError> {
        self.read_rows([0, self.size[1]])
    }

    /// Reads the image's rows from `first` up to but not including `end`, and counts the pixels in these rows that hit
    /// something. The range of rows may be empty. Returns an error if the heap of the working vectors was too small.
    pub fn read_rows(&self, [first, end]: [u32; 2]) -> Result<(Radiance, usize), LaunchError> {
        self.check_heap()?;
        let mut image = Radiance::new(self.size[0], end - first);
        let (width, first, end) = (self.size[0] as usize, first as usize, end as usize);
        let mut hits = 0;
        read_rows(&self.queue, &self.image, (first..end, width), |rows, values| {
            let pixels = &mut image.pixels[width * (rows.start - first)..width * (rows.end - first)];
            pixels
                .par_iter_mut()
                .zip(values)
                .for_each(|(pixel, value)| *pixel = [value[0], value[1], value[2]]);
            hits += values.par_iter().filter(|pixel| pixel[3] > 0.0).count();
            if self.transparent {
                image.coverage.extend(values.iter().map(|pixel| pixel[3]));
            }
        })?;
        Ok((image, hits))
    }

    /// Reads the image of the last frame and applies the display transform. Also counts the pixels that hit
    /// something. If the device shares the host's memory, the image is read in place. Returns `None` if a pixel is
    /// not finite, since it cannot be displayed.
    pub fn read_shown(&self, display: Display) -> Result<Option<(RgbImage, usize)>, LaunchError> {
        self.check_heap()?;
        let [width, height] = self.size;
        let mut picture = RgbImage::new(width, height);
        let shown = Shown::of(display);
        let show = |(bytes, pixels): (&mut [u8], &[Float4])| {
            let (mut hits, mut finite, mut convert) = (0, true, shown.converter());
            // A copy waits for many pixels from memory at once, the conversion only for a few.
            let near = pixels.to_vec();
            for (bytes, pixel) in bytes.as_chunks_mut().0.iter_mut().zip(&near) {
                let radiance = [pixel[0], pixel[1], pixel[2]];
                *bytes = convert(radiance);
                finite &= radiance.iter().all(|channel| channel.is_finite());
                hits += usize::from(pixel[3] > 0.0);
            }
            finite.then_some(hits)
        };
        let (width, height) = (width as usize, height as usize);
        let mut hits = Some(0);
        read_rows(&self.queue, &self.image, (0..height, width), |rows, values| {
            let bytes: &mut [u8] = &mut picture;
            let bytes = &mut bytes[3 * width * rows.start..3 * width * rows.end];
            let hits_of_rows: Option<usize> =
                bytes.par_chunks_mut(3 * TOGETHER).zip(values.par_chunks(TOGETHER)).map(show).sum();
            hits = hits.zip(hits_of_rows).map(|(all, more)| all + more);
        })?;
        Ok(hits.map(|hits| (picture, hits)))
    }

    /// Reads the displayed image from a device with separate memory. The device applies the display transform
    /// itself. Each call of `take` passes some of the rows, from the top to the bottom, with three bytes per
    /// pixel (red, green and blue). Each call except the last passes a multiple of `together` rows. Returns
    /// the number of pixels that hit something, or `None` if a pixel is not finite, since it cannot be
    /// displayed.
    pub fn show(
        &self,
        program: &ShowProgram,
        display: Display,
        together: usize,
        take: impl FnMut(&[u8]),
    ) -> Result<Option<usize>, LaunchError> {
        self.check_heap()?;
        program.read(&self.queue, (&self.image, self.size), &Shown::of(display), together, take)
    }

    /// Returns how many samples of the last picture hit something. Each pixel of this picture has `count`
    /// samples.
    pub fn read_sample_hits(&self, count: u32) -> Result<u64, LaunchError> {
        // The share of a pixel's samples that hit something is the mean of `count` zeros and ones, so the
        // share's product with `count` is nearly a whole number.
        let hits = |share: f32| f64::from(share * count as f32).round() as u64;
        Ok(self.read_hit_shares()?.into_iter().map(hits).sum())
    }

    /// Reads the share of each pixel's samples that hit something.
    pub(in crate::launch) fn read_hit_shares(&self) -> Result<Vec<f32>, LaunchError> {
        let [width, height] = self.size.map(|side| side as usize);
        let mut shares = Vec::with_capacity(width * height);
        read_rows(&self.queue, &self.image, (0..height, width), |_, values| {
            shares.extend(values.iter().map(|pixel| pixel[3]));
        })?;
        Ok(shares)
    }

    /// Returns an error if the last kernel requested more values than the heap holds. The heap is the buffer from which
    /// a kernel allocates its working vectors (`vectors = heap`).
    fn check_heap(&self) -> Result<(), LaunchError> {
        let Working::Heap { top, size, .. } = &self.working else { return Ok(()) };
        let mut used = [0];
        top.read(&mut used[..]).enq()?;
        let (used, size) = (u64::from(used[0] as u32), u64::from(*size));
        let has_own_file = self.has_own_file;
        if used > size { Err(LaunchError::HeapExhausted { used, size, has_own_file }) } else { Ok(()) }
    }
}
