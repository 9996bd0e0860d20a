//! The reference pictures with which images are compared. Each reference is computed when it is first needed.

use crate::reference::{Reference, all_pixels, reference_of};
use crate::scene::{Sampling, Scene};
use crate::strategy::Culling;

/// The reference pictures of one scene at one image size. Points with the same scene and image size are
/// checked one after another, so the references are dropped when a point has another scene or image size.
#[derive(Default)]
pub struct ReferenceCache {
    at: Option<(usize, [u32; 2])>,
    made: Vec<(Culling, Reference)>,
}

impl ReferenceCache {
    /// Returns the reference for a scene, its samples per pixel, an image size and a culling. `number` is the scene's
    /// number in the experiment; scenes with equal numbers are taken to be equal, and to have equal samplings.
    pub fn reference(
        &mut self,
        number: usize,
        (scene, sampling): (&Scene, &Sampling),
        size: [u32; 2],
        culling: Culling,
    ) -> &Reference {
        if self.at != Some((number, size)) {
            self.at = Some((number, size));
            self.made.clear();
        }
        let index = self.made.iter().position(|(made, _)| *made == culling).unwrap_or_else(|| {
            let samples = sampling.rounds().concat();
            let all = all_pixels(size);
            self.made
                .push((culling, reference_of(scene, size, culling, &all, (&samples, &|_| sampling.most))));
            self.made.len() - 1
        });
        &self.made[index].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{fixtures, reference};

    #[test]
    fn a_reference_has_the_samples_of_its_scene() {
        let scene = fixtures::random(30, 1);
        let (size, sampling) = ([12, 8], Sampling::all(5));
        let mut cache = ReferenceCache::default();
        let mut radiance = |number, sampling: &Sampling| {
            cache.reference(number, (&scene, sampling), size, Culling::None).radiance.clone()
        };
        let [one, five] = [radiance(0, &Sampling::ONE), radiance(1, &sampling)];
        let samples = sampling.rounds().concat();
        let expected = reference_of(&scene, size, Culling::None, &all_pixels(size), (&samples, &|_| 5));
        assert!(five == expected.radiance && five != one);
    }

    #[test]
    fn a_reference_is_that_of_its_scene_its_size_and_its_culling() {
        let mut cache = ReferenceCache::default();
        let scenes = [fixtures::random(30, 1), fixtures::single_triangle()];
        let mut checks = |number: usize, size, culling| {
            let scene = &scenes[number];
            let radiance = cache.reference(number, (scene, &Sampling::ONE), size, culling).radiance.clone();
            assert!(radiance == reference(scene, size, culling).radiance, "{number} {size:?} {culling:?}");
        };
        for number in [0, 1, 0] {
            for size in [[12, 8], [8, 12]] {
                checks(number, size, Culling::None);
                checks(number, size, Culling::Back);
                checks(number, size, Culling::None);
            }
        }
    }
}
