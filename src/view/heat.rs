//! The heat map of tests: how many triangles each pixel's rays are tested against. The reference (the ray
//! caster on the host) counts the tests.

use super::Live;
use super::room::check_room;
use crate::accel::WideBvh;
use crate::error::Result;
use crate::image::viridis;
use crate::memory::Available;
use crate::reference::cost::{self, Cost, Grid};
use crate::scene::{Camera, Light, Scene};
use image::{Rgb, RgbImage};
use std::sync::Arc;

/// The sides, in pixels, of the blocks into which the map divides the picture. All pixels of a block show the number of
/// tests of the block's middle pixel. The first heat map has large blocks. While nothing in the picture moves, the heat
/// map is computed again with smaller blocks.
const BLOCKS: [u32; 3] = [8, 4, 2];

/// The largest number of trees in memory while tests are counted: the tree of [`Heat`] and, for a strategy
/// that casts exhaustively, a second tree.
const MOST_TREES: u64 = 2;

/// The heat map of one scene, which becomes finer step by step.
pub struct Heat {
    of: Arc<Scene>,
    /// A copy of the scene `of`; each map sets this copy's camera and lights.
    scene: Scene,
    tree: WideBvh,
    steps: usize,
}

/// A heat map, and the largest number of ray-triangle tests for the rays of one of its pixels.
pub struct Map {
    pub picture: RgbImage,
    pub most: u32,
}

impl Heat {
    /// Builds the tree with which [`Self::next`] computes the maps of a scene.
    ///
    /// # Errors
    ///
    /// Fails if the scene has more triangles than a tree can index, or if the maps need more memory than is `available`.
    pub fn new(scene: &Arc<Scene>, available: &Available) -> Result<Self> {
        check_room(&scene.mesh, MOST_TREES, "counting the tests of a heat map", available)?;
        let tree = cost::tree_of(&scene.mesh)?;
        Ok(Self { of: Arc::clone(scene), scene: scene.as_ref().clone(), tree, steps: 0 })
    }

    /// Returns true if this heat map was made for the scene `scene`.
    pub fn is_of(&self, scene: &Arc<Scene>) -> bool {
        Arc::ptr_eq(&self.of, scene)
    }

    /// Returns the size of the tree in memory, in bytes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.tree.nodes[..]) + size_of_val(&self.tree.order[..])) as u64
    }

    /// Begins again with the coarsest map, because something that the map shows has changed.
    pub fn restart(&mut self) {
        self.steps = 0;
    }

    /// Returns the next heat map of the scene, seen with `camera` and lit by `lights`. Each map is finer than
    /// the one before, until [`Self::restart`] is called. Returns `None` after the finest map. If the
    /// strategy casts exhaustively, the map counts the tests of an exhaustive search. If the strategy does
    /// not cast exhaustively, the map counts the tests in a tree. Faces that the strategy culls count as not
    /// hit.
    pub fn next(&mut self, live: &Live, (camera, lights): (Camera, Vec<Light>)) -> Option<Map> {
        let block = *BLOCKS.get(self.steps)?;
        self.steps += 1;
        (self.scene.camera, self.scene.lights) = (camera, lights);
        let grid = Grid { size: live.size(), block };
        let strategy = live.strategy();
        let costs = if strategy.tests_every_triangle() {
            cost::exhaustive(&self.scene, grid, strategy.culling)
        } else {
            cost::in_built(&self.scene, &self.tree, grid, strategy.culling)
        };
        Some(map(&costs, grid))
    }
}

/// Returns a picture with one block of pixels for each element of `costs`, and the largest number of tests.
/// The colour of a block shows its number of tests.
fn map(costs: &[Cost], grid: Grid) -> Map {
    let (block, [width, height], [across, _]) = (grid.block, grid.size, grid.blocks());
    let most = costs.iter().map(|cost| cost.tests).max().unwrap_or(0);
    let colours: Vec<_> =
        costs.iter().map(|cost| Rgb(viridis(f64::from(cost.tests) / f64::from(most.max(1))))).collect();
    let picture = RgbImage::from_fn(width, height, |x, y| colours[(y / block * across + x / block) as usize]);
    Map { picture, most }
}

#[cfg(test)]
mod tests {
    use super::super::Pose;
    use super::super::tests::{back_face_in, live_of};
    use super::*;

    #[test]
    fn lights_that_were_added_to_a_mesh_move_with_the_eye_in_the_map_too() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("a file");
        let live = live_of(&path, ["8", "8"], &["--plain"], 1);
        let mut heat = Heat::new(live.scene(), &Available::read()).expect("a small scene");
        let view = live.view(&Pose { turn: 1.0, ..Pose::START });
        assert_ne!(view.1, live.scene().lights);
        heat.next(&live, view.clone()).expect("a map");
        assert_eq!((heat.scene.camera, heat.scene.lights), view);
    }

    #[test]
    fn rays_miss_the_faces_that_the_strategy_culls() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = back_face_in(folder.path());
        let most = |strategy: &str, culling: &str| {
            let options = ["--strategy", strategy, "--set", culling];
            let live = live_of(&path, ["40", "20"], &options, 1);
            let mut heat = Heat::new(live.scene(), &Available::read()).expect("a small scene");
            heat.next(&live, live.view(&Pose::START)).expect("a map").most
        };
        // The primary ray is tested against the only triangle. A shadow ray is cast only if the primary ray
        // hits the triangle.
        assert_eq!([most("naive", "culling=none"), most("naive", "culling=back")], [2, 1]);
        assert_eq!(most("bvh", "culling=back"), 1);
    }

    #[test]
    fn a_count_is_a_block_and_the_most_is_the_lightest() {
        let costs = [0, 1, 2, 4, 3, 0].map(|tests| Cost { tests, nodes: 9 });
        let Map { picture, most } = map(&costs, Grid { size: [5, 4], block: 2 });
        assert_eq!((most, picture.dimensions()), (4, (5, 4)));
        assert_eq!(picture.get_pixel(0, 2).0, viridis(1.0));
        assert_eq!(picture.get_pixel(1, 3), picture.get_pixel(0, 2));
        assert_eq!(picture.get_pixel(4, 1).0, viridis(0.5));
        assert_eq!(picture.get_pixel(1, 1).0, viridis(0.0));
    }

    #[test]
    fn a_map_that_needs_more_memory_than_is_available_is_refused() {
        let scene = Arc::new(crate::reference::fixtures::single_triangle());
        let refused = |bytes| {
            let available = Available { bytes, source: "a test".to_owned() };
            Heat::new(&scene, &available).err().map(|error| error.to_string())
        };
        let expected =
            "counting the tests of a heat map needs about 304 B of memory (304 B x 1 triangles = 304 B)";
        assert!(refused(303).is_some_and(|message| message.starts_with(expected)), "{:?}", refused(303));
        assert_eq!(refused(304), None);
    }

    #[test]
    fn a_map_is_of_the_scene_it_was_made_for_and_of_no_equal_one() {
        let scene = Arc::new(crate::reference::fixtures::single_triangle());
        let heat = Heat::new(&scene, &Available::read()).expect("a small scene");
        assert!(heat.is_of(&scene) && !heat.is_of(&Arc::new(scene.as_ref().clone())));
    }
}
