//! The samples of every pixel, which add up while nothing moves.

use crate::image::Radiance;
use crate::scene::{Sample, pixel_samples};

/// The samples of one view: their number so far, and their sum.
pub struct Sum {
    samples: Vec<Sample>,
    cast: usize,
    radiance: Option<Radiance>,
}

impl Sum {
    /// Makes an empty sum of this many samples, the same ones that `render --samples` casts.
    pub fn of(samples: u32) -> Self {
        Self { samples: pixel_samples(samples), cast: 0, radiance: None }
    }

    /// Forgets all samples, because something has changed.
    pub fn restart(&mut self) {
        (self.cast, self.radiance) = (0, None);
    }

    /// Returns the next sample; `None` if all are cast.
    pub fn next(&self) -> Option<Sample> {
        self.samples.get(self.cast).copied()
    }

    /// Returns the number of samples that are cast, and the number of all samples.
    pub fn progress(&self) -> [usize; 2] {
        [self.cast, self.samples.len()]
    }

    /// Counts a sample whose image nobody has read yet.
    pub fn skip(&mut self) {
        self.cast += 1;
    }

    /// Returns whether a sample was cast whose image is missing in the sum.
    pub fn lacks_image(&self) -> bool {
        self.cast > 0 && self.radiance.is_none()
    }

    /// Adds the image of a sample that was skipped.
    pub fn fill(&mut self, image: Radiance) {
        self.radiance = Some(image);
    }

    /// Adds the next sample's image, and returns the mean of all samples so far.
    pub fn add(&mut self, image: Radiance) -> Radiance {
        self.cast += 1;
        let sum = match self.radiance.take() {
            Some(mut sum) => {
                sum.add(&image);
                sum
            }
            None => image,
        };
        self.radiance.insert(sum).clone().part(self.cast)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(value: f32) -> Radiance {
        Radiance { width: 2, height: 1, pixels: vec![[value, 2.0 * value, 0.0]; 2] }
    }

    #[test]
    fn the_mean_is_of_the_samples_so_far() {
        let mut sum = Sum::of(3);
        assert_eq!(sum.next(), Some(pixel_samples(3)[0]));
        sum.skip();
        assert!(sum.lacks_image());
        sum.fill(image(1.0));
        assert_eq!((sum.next(), sum.lacks_image()), (Some(pixel_samples(3)[1]), false));
        assert_eq!(sum.add(image(3.0)), image(2.0));
        assert_eq!(sum.add(image(5.0)), image(3.0));
        assert_eq!((sum.next(), sum.progress()), (None, [3, 3]));
        sum.restart();
        assert_eq!((sum.next(), sum.progress()), (Some(pixel_samples(3)[0]), [0, 3]));
        assert!(!sum.lacks_image());
    }
}
