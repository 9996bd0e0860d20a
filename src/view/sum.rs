//! Samples of every pixel that add up while nothing moves.

use crate::image::Radiance;
use crate::scene::{Sample, pixel_samples};

/// The samples of one view: how many are cast, and their sum.
pub struct Sum {
    samples: Vec<Sample>,
    cast: usize,
    radiance: Option<Radiance>,
}

impl Sum {
    /// Of so many samples: the same that `render --samples` casts.
    pub fn of(samples: u32) -> Self {
        Self { samples: pixel_samples(samples), cast: 0, radiance: None }
    }

    /// Forgets what is cast: something has changed.
    pub fn restart(&mut self) {
        (self.cast, self.radiance) = (0, None);
    }

    /// The next sample; none where all are cast.
    pub fn next(&self) -> Option<Sample> {
        self.samples.get(self.cast).copied()
    }

    /// Samples that are cast, and all there are.
    pub fn progress(&self) -> [usize; 2] {
        [self.cast, self.samples.len()]
    }

    /// Counts a sample whose image nobody has read yet.
    pub fn skip(&mut self) {
        self.cast += 1;
    }

    /// Whether the image of a sample that was cast is missing in the sum.
    pub fn lacks_image(&self) -> bool {
        self.cast > 0 && self.radiance.is_none()
    }

    /// Adds the image of a sample that was skipped.
    pub fn fill(&mut self, image: Radiance) {
        self.radiance = Some(image);
    }

    /// Adds the next sample's image, and gives the mean of all so far.
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
        Radiance { pixels: vec![[value, 2.0 * value, 0.0]; 2], ..Radiance::new(2, 1) }
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
