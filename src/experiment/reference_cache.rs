//! The references with which images are compared, computed when they are first needed.

use crate::reference::{Reference, reference};
use crate::scene::Scene;
use crate::strategy::Culling;

/// The references of the current scene and image size. Points are sorted by scene and image size, so older
/// references are dropped.
#[derive(Default)]
pub struct ReferenceCache {
    at: Option<(usize, [u32; 2])>,
    made: Vec<(Culling, Reference)>,
}

impl ReferenceCache {
    /// Returns the reference for the scene numbered `number`.
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
        let place = self.made.iter().position(|(made, _)| *made == culling).unwrap_or_else(|| {
            self.made.push((culling, reference(scene, size, culling)));
            self.made.len() - 1
        });
        &self.made[place].1
    }
}
