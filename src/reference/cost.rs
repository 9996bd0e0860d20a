//! Counts the ray-triangle tests of each pixel's rays, in exhaustive casting and with a tree. With a tree, also counts
//! the nodes that the rays visit.

use super::cast::Caster;
use super::count;
use super::intersect::{Hit, moller_trumbore};
use super::ray::Ray;
use super::soft::Seen;
use super::traverse::Finder;
use super::tree::Tree;
use crate::accel::{Bvh, WideBvh};
use crate::error::Result;
use crate::scene::{Mesh, Sample, Scene};
use crate::strategy::Culling;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Largest number of children of a node in the tree for which costs are counted, as in the preset `bvh`.
pub const NODE_WIDTH: usize = 4;
/// Largest number of triangles in a leaf of the tree for which costs are counted.
pub const LEAF_SIZE: usize = 4;

/// The cost of a pixel's primary ray and its shadow rays together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Number of triangle tests: the sum over the rays.
    pub tests: u32,
    /// Number of nodes whose children's boxes are tested: the sum over the rays.
    pub nodes: u32,
}

/// The pixels of an image whose costs are counted: one pixel of each block of pixels.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// The image's size in pixels, across and down.
    pub size: [u32; 2],
    /// Pixels across and down in a block. Blocks at the image's right and lower edges may be smaller.
    pub block: u32,
}

impl Grid {
    /// Returns all pixels of an image.
    pub fn all(size: [u32; 2]) -> Self {
        Self { size, block: 1 }
    }

    /// Returns the number of blocks across and down.
    pub fn blocks(&self) -> [u32; 2] {
        self.size.map(|side| side.div_ceil(self.block))
    }

    /// Returns the column and the row of a block's middle pixel. If the middle column or row of a block at an edge
    /// lies outside the image, the image's last column or row is returned instead. `index` counts the blocks row by
    /// row.
    fn pixel(&self, index: usize) -> [u32; 2] {
        let at = pixel_at(index, self.blocks()[0]);
        [0, 1].map(|axis| (at[axis] * self.block + self.block / 2).min(self.size[axis] - 1))
    }
}

/// Returns the cost (numbers of tests and nodes) of every pixel in `grid` if each ray tests triangles in the mesh's
/// order. A primary ray tests all triangles; a shadow ray stops at the first occluder. In a scene with
/// cut-outs, a shadow ray is counted as if it tested all triangles.
pub fn exhaustive(scene: &Scene, grid: Grid, culling: Culling) -> Vec<Cost> {
    let tree = Tree::new(&scene.mesh, culling);
    let count = scene.mesh.triangles.len() as u32;
    each_pixel(scene, grid, |tally| InOrder { tree: &tree, count, tally })
}

/// Returns the cost (numbers of tests and nodes) of every pixel if each ray traverses a tree, nearer boxes first.
///
/// # Errors
///
/// Fails if the scene has more triangles than a tree can index.
pub fn in_tree(scene: &Scene, size: [u32; 2], culling: Culling) -> Result<Vec<Cost>> {
    Ok(in_built(scene, &tree_of(&scene.mesh)?, Grid::all(size), culling))
}

/// Builds the tree for which costs (numbers of tests and nodes) are counted.
///
/// # Errors
///
/// Fails if the scene has more triangles than a tree can index.
pub fn tree_of(mesh: &Mesh) -> Result<WideBvh> {
    widened(Bvh::build(mesh, LEAF_SIZE))
}

/// Converts a binary tree to the tree for which costs are counted. This tree is the same for all strategies. If it
/// cannot index all triangles, another strategy would therefore not help, and the error does not recommend one.
fn widened(bvh: Bvh) -> Result<WideBvh> {
    let wide = WideBvh::new(bvh, NODE_WIDTH, LEAF_SIZE);
    wide.map_err(|error| error.with_help("use a scene with fewer triangles"))
}

/// Returns the cost (numbers of tests and nodes) of every pixel in `grid` if each ray traverses this tree.
pub fn in_built(scene: &Scene, tree: &WideBvh, grid: Grid, culling: Culling) -> Vec<Cost> {
    each_pixel(scene, grid, |tally| Walking { tree, mesh: &scene.mesh, culling, tally })
}

/// The numbers of tests and nodes of one pixel's rays. A single thread counts these tests and nodes. The
/// numbers are atomic nevertheless, because the trait [`Finder`] (a search for hits) requires that several
/// threads can share an implementation.
#[derive(Debug, Default)]
struct Tally {
    tests: AtomicU32,
    nodes: AtomicU32,
}

/// Casts the ray through the centre of each pixel in `grid`. For each pixel, a separate `Finder` (a search for hits)
/// counts tests and nodes. Returns these counts.
fn each_pixel<'a, F: Finder<f64> + 'a>(
    scene: &Scene,
    grid: Grid,
    finder: impl Fn(Arc<Tally>) -> F + Sync,
) -> Vec<Cost> {
    let cost = |index: usize| {
        let [x, y] = grid.pixel(index);
        let tally = Arc::<Tally>::default();
        let caster = Caster::new(scene, grid.size, finder(Arc::clone(&tally)));
        let (ray, hit) = caster.look(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let seen = Seen::of(scene, Sample::CENTRE, [x, y]);
        caster.radiance(&seen, &ray, hit.as_ref(), f64::from(scene.shadow_bias));
        let read = |count: &AtomicU32| count.load(Ordering::Relaxed);
        Cost { tests: read(&tally.tests), nodes: read(&tally.nodes) }
    };
    (0..count(grid.blocks())).into_par_iter().map(cost).collect()
}

/// Returns the column and the row of the pixel with this index. The index is not a `u32`, since the largest
/// image has more pixels than a `u32` can count.
pub(super) fn pixel_at(index: usize, width: u32) -> [u32; 2] {
    [index % width as usize, index / width as usize].map(|coordinate| coordinate as u32)
}

/// Counts the tests that an exhaustive search would need, but finds hits with a tree, which is faster.
struct InOrder<'a> {
    tree: &'a Tree,
    count: u32,
    tally: Arc<Tally>,
}

impl Finder<f64> for InOrder<'_> {
    fn visit(&self, ray: &Ray<f64>, visitor: &mut dyn FnMut(Hit<f64>) -> f64) {
        self.tally.tests.fetch_add(self.count, Ordering::Relaxed);
        self.tree.visit(ray, visitor);
    }

    /// Counts the tests up to the first occluder in the mesh's order, where an exhaustive search ends.
    /// Returns true if there is an occluder.
    fn any(&self, ray: &Ray<f64>) -> bool {
        let mut first: Option<u32> = None;
        self.tree.visit(ray, &mut |hit| {
            first = Some(first.map_or(hit.triangle, |known| known.min(hit.triangle)));
            ray.far
        });
        self.tally.tests.fetch_add(first.map_or(self.count, |index| index + 1), Ordering::Relaxed);
        first.is_some()
    }
}

/// Traverses a tree, and counts the tests and the nodes.
struct Walking<'a> {
    tree: &'a WideBvh,
    mesh: &'a Mesh,
    culling: Culling,
    tally: Arc<Tally>,
}

impl Finder<f64> for Walking<'_> {
    fn visit(&self, ray: &Ray<f64>, visitor: &mut dyn FnMut(Hit<f64>) -> f64) {
        let walk = self.tree.closest_hit(ray.origin, ray.direction, ray.far, |triangle, reach| {
            let corners = self.mesh.corners(&self.mesh.triangles[triangle as usize]).map(|c| c.as_dvec3());
            let (t, weights) = moller_trumbore(ray, corners, self.culling)?;
            (t <= reach).then(|| visitor(Hit { t, weights, triangle }))
        });
        self.tally.tests.fetch_add(walk.triangles, Ordering::Relaxed);
        self.tally.nodes.fetch_add(walk.nodes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::super::traverse::Exhaustive;
    use super::*;

    /// An exhaustive search that counts its tests directly.
    struct Plain {
        inner: Exhaustive<f64>,
        corners: Vec<[glam::DVec3; 3]>,
        tally: Arc<Tally>,
    }

    impl Finder<f64> for Plain {
        fn visit(&self, ray: &Ray<f64>, visitor: &mut dyn FnMut(Hit<f64>) -> f64) {
            self.tally.tests.fetch_add(self.corners.len() as u32, Ordering::Relaxed);
            self.inner.visit(ray, visitor);
        }

        fn any(&self, ray: &Ray<f64>) -> bool {
            let hits = |corners: &[glam::DVec3; 3]| moller_trumbore(ray, *corners, Culling::None).is_some();
            let first = self.corners.iter().position(hits);
            let tests = first.map_or(self.corners.len(), |index| index + 1);
            self.tally.tests.fetch_add(tests as u32, Ordering::Relaxed);
            first.is_some()
        }
    }

    #[test]
    fn exhaustive_costs_are_those_of_the_search_itself() {
        // In the second scene, some shadow rays have several occluders.
        for scene in [fixtures::pyramid_lower(), fixtures::random(60, 3)] {
            let corners: Vec<_> =
                scene.mesh.triangles.iter().map(|t| scene.mesh.corners(t).map(|c| c.as_dvec3())).collect();
            let grid = Grid::all([40, 25]);
            let plain = each_pixel(&scene, grid, |tally| Plain {
                inner: Exhaustive::new(&scene.mesh, Culling::None),
                corners: corners.clone(),
                tally,
            });
            let costs = exhaustive(&scene, grid, Culling::None);
            assert_eq!(costs, plain);
            let count = scene.mesh.triangles.len() as u32;
            assert!(costs.iter().all(|cost| cost.tests >= count && cost.nodes == 0));
            assert!(costs.iter().any(|cost| cost.tests != costs[0].tests), "all pixels cost the same");
        }
    }

    #[test]
    fn a_tree_saves_tests() {
        let scene = fixtures::random(700, 1);
        let size = [40, 25];
        let total = |costs: &[Cost]| costs.iter().map(|cost| u64::from(cost.tests)).sum::<u64>();
        let tree = in_tree(&scene, size, Culling::None).expect("a small scene");
        assert!(tree.iter().any(|cost| cost.nodes > 1));
        assert!(10 * total(&tree) < total(&exhaustive(&scene, Grid::all(size), Culling::None)));
    }

    #[test]
    fn no_strategy_is_advised_for_too_many_triangles() {
        let bvh = Bvh { nodes: Vec::new(), order: vec![0; WideBvh::MAX_INDEX + 1], depth: 0 };
        let error = widened(bvh).expect_err("the mesh has one triangle more than a tree can index");
        assert!(error.to_string().contains("33554433 triangles"), "{error}");
        assert_eq!(error.remedy(), "use a scene with fewer triangles");
    }

    #[test]
    fn the_largest_image_has_an_index_for_each_pixel() {
        assert_eq!(pixel_at(count([65_536, 65_536]) - 1, 65_536), [65_535, 65_535]);
        assert_eq!([0, 39, 40].map(|index| pixel_at(index, 40)), [[0, 0], [39, 0], [0, 1]]);
    }

    #[test]
    fn a_block_has_the_cost_of_its_middle_pixel_in_the_whole_image() {
        let (scene, size) = (fixtures::random(60, 3), [41, 23]);
        let tree = tree_of(&scene.mesh).expect("a small scene");
        let costs = |block| in_built(&scene, &tree, Grid { size, block }, Culling::None);
        let all = costs(1);
        for block in [2_u32, 4, 8] {
            let middles = |side: u32| {
                (0..side).step_by(block as usize).map(move |begin| (begin + block / 2).min(side - 1))
            };
            let pixels = middles(23).flat_map(|y| middles(41).map(move |x| [x, y]));
            let expected: Vec<Cost> = pixels.map(|[x, y]| all[(41 * y + x) as usize]).collect();
            assert_eq!(costs(block), expected, "{block}");
        }
        let last = Grid { size, block: 8 };
        assert_eq!((last.blocks(), last.pixel(17)), ([6, 3], [40, 20]));
    }

    #[test]
    fn each_pixel_has_its_cost_in_the_order_of_rows() {
        let costs = exhaustive(&fixtures::single_triangle(), Grid::all([40, 25]), Culling::None);
        let tests = |[x, y]: [usize; 2]| costs[40 * y + x].tests;
        assert_eq!(costs.len(), 40 * 25);
        // A ray that hits the triangle is followed by a shadow ray, which is also tested against the triangle.
        assert_eq!([[20, 12], [20, 3], [34, 17]].map(tests), [2; 3]);
        assert_eq!([[0, 0], [39, 24], [20, 2], [36, 17], [12, 21]].map(tests), [1; 5]);
    }
}
