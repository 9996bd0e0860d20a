//! The samples of every pixel, which `raycl view` adds up while nothing moves. The device stores the mean of
//! the samples that have been cast.

use crate::scene::{Sample, pixel_samples};

/// The samples that the view casts for every pixel from one position of the eye, and the number of these
/// samples that have been cast.
pub struct Sum {
    samples: Vec<Sample>,
    cast: usize,
}

impl Sum {
    /// Makes an empty sum for this number of samples per pixel. The view casts the same samples as `render
    /// --samples`.
    pub fn of(samples: u32) -> Self {
        Self { samples: pixel_samples(samples), cast: 0 }
    }

    /// Forgets all samples, because the next frame will differ, for example after a movement of the eye.
    pub fn restart(&mut self) {
        self.cast = 0;
    }

    /// Returns the next sample; `None` if all samples have been cast.
    pub fn next(&self) -> Option<Sample> {
        self.samples.get(self.cast).copied()
    }

    /// Returns the number of samples per pixel that have been cast so far, and the number of samples per
    /// pixel that will be cast in all.
    pub fn progress(&self) -> [usize; 2] {
        [self.cast, self.samples.len()]
    }

    /// Counts a sample that has been cast.
    pub fn add(&mut self) {
        self.cast += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_follow_each_other_until_something_changes() {
        let mut sum = Sum::of(3);
        assert_eq!(sum.next(), Some(pixel_samples(3)[0]));
        sum.add();
        assert_eq!(sum.next(), Some(pixel_samples(3)[1]));
        (0..2).for_each(|_| sum.add());
        assert_eq!((sum.next(), sum.progress()), (None, [3, 3]));
        sum.restart();
        assert_eq!((sum.next(), sum.progress()), (Some(pixel_samples(3)[0]), [0, 3]));
    }
}
