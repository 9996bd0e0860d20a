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

/// The host converts at least this many pixels, in whole rows, before it passes them on. The last rows may have fewer
/// pixels.
const PIXELS_TOGETHER: usize = 1 << 17;

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
        read_rows(&self.queue, &self.image, (first..end, width, 1), |rows, values| {
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

    /// Reads the displayed image of the last frame. The program `program` applies the display transform on the device;
    /// if `program` is `None`, the host applies it. Each call of `take` passes some of the rows, from the top to the
    /// bottom, with three bytes per pixel (red, green and blue). Each call except the last passes a multiple of
    /// `together` rows, or no rows. Returns the number of pixels that hit something, or `None` if a pixel is not
    /// finite, since it cannot be displayed.
    pub fn show(
        &self,
        program: Option<&ShowProgram>,
        display: Display,
        together: usize,
        take: impl FnMut(&[u8]) + Send,
    ) -> Result<Option<usize>, LaunchError> {
        self.check_heap()?;
        match program {
            Some(program) => {
                program.read(&self.queue, (&self.image, self.size), &Shown::of(display), together, take)
            }
            None => self.show_on_host(&Shown::of(display), together, take),
        }
    }

    /// Does the work of [`Self::show`] if the host applies the display transform. If the device shares the host's
    /// memory, the image is read in place. While `take` processes rows, other threads convert the next rows.
    fn show_on_host(
        &self,
        shown: &Shown,
        together: usize,
        mut take: impl FnMut(&[u8]) + Send,
    ) -> Result<Option<usize>, LaunchError> {
        let [width, height] = self.size.map(|side| side as usize);
        let pixels_together = width * PIXELS_TOGETHER.div_ceil(width).next_multiple_of(together);
        let mut hits = Some(0);
        read_rows(&self.queue, &self.image, (0..height, width, together), |_, values| {
            let mut ready = Vec::new();
            for pixels in values.chunks(pixels_together) {
                let next = || converted(pixels, shown);
                let ((), (bytes, hits_of_rows)) = rayon::join(|| take(&ready), next);
                ready = bytes;
                hits = hits.zip(hits_of_rows).map(|(all, more)| all + more);
            }
            take(&ready);
        })?;
        Ok(hits)
    }

    /// Reads the displayed image of the last frame as a whole, and returns it together with the number of pixels that
    /// hit something. Returns `None` if a pixel is not finite. For `program`, see [`Self::show`].
    pub fn read_8_bits(
        &self,
        program: Option<&ShowProgram>,
        display: Display,
    ) -> Result<Option<(RgbImage, usize)>, LaunchError> {
        let [width, height] = self.size;
        let mut bytes = Vec::with_capacity(3 * width as usize * height as usize);
        let hits = self.show(program, display, 1, |rows| bytes.extend_from_slice(rows))?;
        Ok(hits.and_then(|hits| Some((RgbImage::from_raw(width, height, bytes)?, hits))))
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
        read_rows(&self.queue, &self.image, (0..height, width, 1), |_, values| {
            shares.extend(values.iter().map(|pixel| pixel[3]));
        })?;
        Ok(shares)
    }

    /// Returns an error if the last kernel with working vectors requested more values than the heap holds. The heap is
    /// the buffer from which a kernel allocates its working vectors (`vectors = heap`).
    fn check_heap(&self) -> Result<(), LaunchError> {
        let Working::Heap { top, size, .. } = &self.working else { return Ok(()) };
        let mut used = [0];
        top.read(&mut used[..]).enq()?;
        let (used, size) = (u64::from(used[0] as u32), u64::from(*size));
        let has_own_file = self.has_own_file;
        if used > size { Err(LaunchError::HeapExhausted { used, size, has_own_file }) } else { Ok(()) }
    }
}

/// Converts pixels to three bytes each, on all cores. Also counts the pixels that hit something; the count is `None` if
/// a pixel is not finite.
fn converted(pixels: &[Float4], shown: &Shown) -> (Vec<u8>, Option<usize>) {
    let mut bytes = vec![0; 3 * pixels.len()];
    let convert = |(bytes, pixels): (&mut [u8], &[Float4])| {
        let mut convert = shown.converter();
        for (bytes, pixel) in bytes.as_chunks_mut().0.iter_mut().zip(pixels) {
            *bytes = convert([pixel[0], pixel[1], pixel[2]]);
        }
        // Two separate loops check whether pixels are finite and count hits, because the compiler turns such loops into
        // vector instructions. In the loop above, these checks would take more time.
        let finite =
            |finite, pixel: &Float4| (0..3).fold(finite, |all, channel| all & pixel[channel].is_finite());
        let hits = pixels.iter().filter(|pixel| pixel[3] > 0.0).count();
        pixels.iter().fold(true, finite).then_some(hits)
    };
    let hits = bytes.par_chunks_mut(3 * TOGETHER).zip(pixels.par_chunks(TOGETHER)).map(convert).sum();
    (bytes, hits)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::device::discover;
    use crate::launch::Session;
    use crate::program::Sources;
    use crate::scene::load_scene;
    use crate::strategy::preset;
    use std::path::Path;
    use std::sync::Arc;

    #[test]
    fn a_channel_that_is_not_finite_cannot_be_displayed() {
        let shown = Shown::of(Display::default());
        for channel in 0..3 {
            for (wrong, is_shown) in [(1.0, true), (f32::NAN, false), (f32::NEG_INFINITY, false)] {
                let mut pixels = [Float4::new(0.5, 0.5, 0.5, 1.0); 5];
                pixels[1][channel] = wrong;
                let hits = converted(&pixels, &shown).1;
                assert_eq!(hits, is_shown.then_some(5), "{channel} {wrong}");
            }
        }
    }

    /// The host converts this picture in three pieces.
    #[test]
    fn a_picture_with_a_pixel_that_is_not_finite_in_any_piece_is_not_displayed() {
        let device = discover(&Sources::Embedded).unwrap().into_iter().next().expect("a device");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/still-life.toml");
        let scene = Arc::new(load_scene(&path).unwrap().scene);
        let mut session = Session::open(&device, &Sources::Embedded, Arc::clone(&scene)).unwrap();
        let size = [700, 500];
        let prepared = session.prepare(&preset("bvh").unwrap().strategy, size, [1, 1]);
        let caster = prepared.map_err(|refused| refused.reason()).unwrap().caster();
        let caster = caster.map_err(|refused| refused.reason()).unwrap();
        caster.cast().unwrap();
        assert!(caster.read_8_bits(None, scene.display).unwrap().is_some());
        for row in [0, 250, 499] {
            caster.cast().unwrap();
            let wrong = [Float4::new(0.0, 0.0, f32::NAN, 1.0)];
            caster.image.write(&wrong[..]).offset(row * 700).enq().unwrap();
            assert_eq!(caster.read_8_bits(None, scene.display).unwrap(), None, "{row}");
        }
    }
}
