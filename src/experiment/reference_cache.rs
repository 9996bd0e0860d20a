//! The references with which images are compared, computed when they are first needed.

use crate::reference::{Reference, reference};
use crate::scene::Scene;
use crate::strategy::Culling;

/// The references of the current scene and image size. Points with the same scene and image size are checked
/// one after another, so the references are dropped when a point has another scene or image size.
#[derive(Default)]
pub struct ReferenceCache {
    at: Option<(usize, [u32; 2])>,
    made: Vec<(Culling, Reference)>,
}

impl ReferenceCache {
    /// Returns the reference for a scene, an image size and a culling. `number` is the scene's number in the
    /// experiment; scenes with equal numbers are taken to be equal.
    pub fn reference(
        &mut self,
        number: usize,
        scene: &Scene,
        size: [u32; 2],
        culling: Culling,
    ) -> &Reference {
        if self.at != Some((number, size)) {
            self.at = Some((number, size));
            self.made.clear();
        }
        let index = self.made.iter().position(|(made, _)| *made == culling).unwrap_or_else(|| {
            self.made.push((culling, reference(scene, size, culling)));
            self.made.len() - 1
        });
        &self.made[index].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::fixtures;

    #[test]
    fn a_reference_is_that_of_its_scene_its_size_and_its_culling() {
        let mut cache = ReferenceCache::default();
        let scenes = [fixtures::random(30, 1), fixtures::single_triangle()];
        let mut checks = |number: usize, size, culling| {
            let scene = &scenes[number];
            let radiance = cache.reference(number, scene, size, culling).radiance.clone();
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
