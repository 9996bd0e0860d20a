//! Builds a binary tree from the root down on all cores, by the binned surface-area heuristic.
//!
//! A primitive is the box and the number of a triangle, in 32 bytes. A node's primitives are contiguous in a
//! buffer, and a cut of the node reorders these primitives in place. To find a cut, a node is divided into
//! slices along each axis, and the primitives of each slice are counted. In large nodes, all cores count and
//! move the primitives, chunk by chunk. The two sides of a cut are built as independent tasks, except in
//! small subtrees.
//!
//! If a large tree is for one frame only, its upper part is built over the cells of a grid, which have many
//! primitives on average: see `cells.rs`.

use super::bins::{Bins, Boxed, Cut, Slicer};
use super::bounds::{Bounds, Primitive};
use super::cells::{Cell, Sorted, most_cells};
use super::partition::{partition, partition_chunks};
use super::{Bvh, Node, TreeUse};
use crate::scene::Mesh;
use rayon::prelude::*;

/// In a node with more triangles than this number, all cores together count the triangles of each slice and
/// move the triangles to the sides of a cut.
const PARALLEL_NODE: usize = 1 << 16;
/// Number of triangles in a chunk, the unit of work when all cores compute boxes. In a node with more than
/// `PARALLEL_NODE` triangles, all cores also count and move the triangles chunk by chunk.
pub(super) const CHUNK: usize = 1 << 14;
/// A subtree with at most this many triangles is built by a single task, unless the subtree has several grid cells.
const TASK: usize = 1 << 12;
/// If a subtree has at most this many triangles, and its parent's subtree has more, the builder joins the subtree's
/// nodes into one allocation as soon as the subtree is finished. When a large allocation is freed, the allocator
/// returns its memory to the system. If the nodes stayed in many small allocations, the allocator would keep their
/// memory, and large meshes would need a tenth more memory.
const JOINED: usize = 1 << 19;
/// To find a cut, nodes with more triangles than this number are divided into `FINE` slices along each axis.
/// Nodes with at most this many triangles are divided into `COARSE` slices. To find a cut of a list of grid
/// cells (see `cells.rs`), the list is divided into `FINE` slices, whatever its number of triangles.
const FINE_NODE: usize = 64;
const FINE: usize = 16;
const COARSE: usize = 8;
/// From this depth on, a node is divided into two halves whose numbers of triangles differ by at most one.
/// Halving limits the depth of the tree of any mesh.
const HALVING_DEPTH: u32 = 64;
/// From this depth on, a list of grid cells is divided into two halves. A mesh has at most 2^16 cells, so 16
/// halvings divide any list of cells into single cells. The subtree over a cell's triangles therefore begins at
/// depth 48 + 16 = 64 (`HALVING_DEPTH`) or less.
const CELLS_HALVING_DEPTH: u32 = 48;
/// If a tree is for one frame, and the mesh has at least this many triangles, the upper part of the tree is
/// built over the cells of a grid. Cuts between cells usually cost more than the best cuts between triangles, so
/// casting takes longer: by 3.5% for ten million triangles on an H200 (docs/log.md, 2026-11-28). For a mesh of
/// 200,000 triangles, building a tree over cells was only 7 ms faster than building it over triangles.
const LARGE_MESH: usize = 1 << 19;

/// A subtree that has not been built yet.
struct Work<'a> {
    /// The boxes and numbers of the subtree's triangles.
    primitives: &'a mut [Primitive],
    /// The slice of the leaf order (the list of all triangles) that belongs to this subtree.
    order: &'a mut [u32],
    /// The box around all triangles of the subtree.
    bounds: Bounds,
    /// A box that contains the doubled centres of all primitives (see `Primitive::centre`).
    region: Bounds,
    /// Number of cuts between the root of the whole tree and this subtree.
    depth: u32,
}

/// A finished subtree: the subtree's nodes in depth-first order, in several vectors.
#[derive(Default)]
struct Subtree {
    pieces: Vec<Vec<Node>>,
    /// Number of nodes in all vectors of `pieces`.
    nodes: usize,
    /// Number of edges from the root of the whole tree to the deepest leaf of this subtree.
    depth: u32,
}

impl Subtree {
    /// Returns the same subtree with all nodes in one vector.
    fn joined(self) -> Self {
        Self { pieces: vec![self.pieces.concat()], ..self }
    }
}

/// Returns the largest number of cells over which the upper part of a mesh's tree is built; `None` if the whole tree is
/// built over triangles.
pub(super) fn cells_for(tree_use: TreeUse, triangles: usize) -> Option<usize> {
    (tree_use == TreeUse::OneFrame && triangles >= LARGE_MESH).then(|| most_cells(triangles))
}

/// Builds a tree; see [`Bvh::build`]. With `cells`, the upper part of the tree is built over at most this many cells.
pub(super) fn build(mesh: &Mesh, leaf_size: usize, cells: Option<usize>) -> Bvh {
    let leaf_size = leaf_size.max(1);
    let mut order = vec![0; mesh.triangles.len()];
    let tree = match cells {
        _ if order.is_empty() => Subtree::default(),
        None => grow_from_primitives(mesh, &mut order, leaf_size),
        Some(most) => grow_cells(&mut Sorted::of(mesh, most).cells(), &mut order, 0, leaf_size),
    };
    // At this point, the triangles' boxes have already been freed. Joining the vectors of nodes needs memory
    // for a second copy of the nodes.
    Bvh { nodes: tree.pieces.concat(), order, depth: tree.depth }
}

/// Builds a tree from the primitives of all triangles.
fn grow_from_primitives(mesh: &Mesh, order: &mut [u32], leaf_size: usize) -> Subtree {
    let mut primitives: Vec<Primitive> = Vec::new();
    let primitive = |(i, t)| Primitive::new(mesh.corners(t), i as u32);
    mesh.triangles.par_iter().enumerate().map(primitive).collect_into_vec(&mut primitives);
    let (bounds, region) = boxes_of(&primitives);
    grow(Work { primitives: &mut primitives, order, bounds, region, depth: 0 }, leaf_size)
}

/// Returns the box around all primitives, and the box around the primitives' doubled centres (see
/// `Primitive::centre`).
pub(super) fn boxes_of(primitives: &[Primitive]) -> (Bounds, Bounds) {
    primitives
        .par_chunks(CHUNK)
        .map(|chunk| (Primitive::bounds(chunk), Primitive::centre_bounds(chunk)))
        .reduce(|| (Bounds::EMPTY, Bounds::EMPTY), |a, b| (a.0.union(b.0), a.1.union(b.1)))
}

/// Builds the subtree over a list of at least one cell.
fn grow_cells(cells: &mut [Cell], order: &mut [u32], depth: u32, leaf_size: usize) -> Subtree {
    let bounds = cells.iter().map(|cell| cell.primitive().0).fold(Bounds::EMPTY, Bounds::union);
    if let [cell] = cells {
        let primitives = std::mem::take(&mut cell.primitives);
        return grow(Work { primitives, order, bounds, region: cell.region, depth }, leaf_size);
    }
    let cut = if depth < CELLS_HALVING_DEPTH { cut_cells(cells) } else { None };
    let (left, right) = cells.split_at_mut(cut.unwrap_or(cells.len() / 2));
    let count: u32 = left.iter().map(Cell::count).sum();
    let (left_order, right_order) = order.split_at_mut(count as usize);
    let counts = [left_order.len(), right_order.len()];
    grow_both(
        bounds,
        counts,
        || grow_cells(left, left_order, depth + 1, leaf_size),
        || grow_cells(right, right_order, depth + 1, leaf_size),
    )
}

/// Finds the best cut of a list of cells, moves the cells to the two sides of the cut, and returns the number
/// of cells on the left side; `None` if no cut has a finite cost.
fn cut_cells(cells: &mut [Cell]) -> Option<usize> {
    let centres = cells.iter().map(|cell| Bounds::point(cell.primitive().centre()));
    let region = centres.fold(Bounds::EMPTY, Bounds::union);
    let slicer = Slicer::<FINE>::new(region);
    let cut = Bins::of(cells, &slicer).best_cut(&slicer, region)?;
    Some(partition(cells, &slicer, &cut))
}

/// Builds a subtree of the tree over a mesh's triangles. The two sides of a large subtree are built as two
/// parallel tasks. A small subtree is built in the current task.
fn grow(work: Work, leaf_size: usize) -> Subtree {
    let count = work.primitives.len();
    if count <= TASK.max(leaf_size) {
        let mut nodes = Vec::with_capacity(2 * count / leaf_size + 1);
        let depth = grow_serially(work, leaf_size, &mut nodes);
        return Subtree { nodes: nodes.len(), pieces: vec![nodes], depth };
    }
    let bounds = work.bounds;
    let [left, right] = divide(work);
    let counts = [left.primitives.len(), right.primitives.len()];
    grow_both(bounds, counts, || grow(left, leaf_size), || grow(right, leaf_size))
}

/// Builds the two subtrees below a node as two parallel tasks, and puts the node before the subtrees' nodes.
/// `bounds` is the node's box, and `counts` has the subtrees' numbers of triangles.
fn grow_both(
    bounds: Bounds,
    counts: [usize; 2],
    left: impl FnOnce() -> Subtree + Send,
    right: impl FnOnce() -> Subtree + Send,
) -> Subtree {
    let count = counts[0] + counts[1];
    let side = |subtree: Subtree, triangles: usize| {
        let joins = count > JOINED && triangles <= JOINED;
        if joins { subtree.joined() } else { subtree }
    };
    let (left, right) = rayon::join(|| side(left(), counts[0]), || side(right(), counts[1]));
    let root = Node::inner(bounds, left.nodes as u32 + 1, count);
    let mut pieces = vec![vec![root]];
    pieces.extend(left.pieces);
    pieces.extend(right.pieces);
    Subtree { pieces, nodes: 1 + left.nodes + right.nodes, depth: left.depth.max(right.depth) }
}

/// Builds a subtree in the current task, appends its nodes to `nodes`, and returns the depth of its deepest
/// node.
fn grow_serially(work: Work, leaf_size: usize, nodes: &mut Vec<Node>) -> u32 {
    let (count, depth, index) = (work.primitives.len(), work.depth, nodes.len());
    nodes.push(Node::leaf(work.bounds, count));
    if count <= leaf_size {
        for (number, primitive) in work.order.iter_mut().zip(work.primitives.iter()) {
            *number = primitive.triangle();
        }
        // Kernels keep the first of two hits at the same distance. If triangles of this leaf coincide, rays
        // therefore hit the triangle that comes first in the mesh, since the leaf's triangles are sorted by
        // number. Coincident triangles have equal centres, so only `halve` can put them into different leaves.
        work.order.sort_unstable();
        return depth;
    }
    let [left, right] = divide(work);
    let left_depth = grow_serially(left, leaf_size, nodes);
    nodes[index].right = (nodes.len() - index) as u32;
    left_depth.max(grow_serially(right, leaf_size, nodes))
}

/// Divides a subtree's triangles between the two children of the subtree's root.
fn divide(work: Work) -> [Work; 2] {
    let count = work.primitives.len();
    let cut = if work.depth >= HALVING_DEPTH {
        None
    } else if count > PARALLEL_NODE {
        cut_in_chunks(work.primitives, work.region)
    } else if count > FINE_NODE {
        cut::<FINE>(work.primitives, work.region)
    } else {
        cut::<COARSE>(work.primitives, work.region)
    };
    match cut {
        Some(cut) => work.split(cut),
        None => work.halve(),
    }
}

/// Finds the best cut, moves the primitives to the two sides of the cut, and returns the cut; `None` if no
/// cut has a finite cost. `region` contains the doubled centres of all primitives. As a part of the parent
/// node's region, `region` may be larger than the smallest box around these centres. If no cut is found in
/// `region`, the search is repeated with this smallest box.
fn cut<const N: usize>(primitives: &mut [Primitive], region: Bounds) -> Option<Cut> {
    let try_region = |region: Bounds| {
        let slicer = Slicer::<N>::new(region);
        Bins::of(primitives, &slicer).best_cut(&slicer, region).map(|cut| (slicer, cut))
    };
    let (slicer, cut) = try_region(region).or_else(|| try_region(Primitive::centre_bounds(primitives)))?;
    partition(primitives, &slicer, &cut);
    Some(cut)
}

/// Finds the best cut and moves the primitives, like [`cut`], but on all cores.
fn cut_in_chunks(primitives: &mut [Primitive], region: Bounds) -> Option<Cut> {
    let try_region = |region: Bounds| {
        let slicer = Slicer::<FINE>::new(region);
        let bins: Vec<_> = primitives.par_chunks(CHUNK).map(|chunk| Bins::of(chunk, &slicer)).collect();
        let sum = bins[1..].iter().fold(bins[0].clone(), |sum, bins| sum.merge(bins));
        sum.best_cut(&slicer, region).map(|cut| (slicer, bins, cut))
    };
    let (slicer, bins, cut) =
        try_region(region).or_else(|| try_region(Primitive::centre_bounds(primitives)))?;
    partition_chunks(primitives, CHUNK, &bins, &slicer, &cut);
    Some(cut)
}

impl<'a> Work<'a> {
    /// Returns the two subtrees into which a cut divides this subtree. The primitives have already been moved
    /// to their sides of the cut.
    fn split(self, cut: Cut) -> [Self; 2] {
        let (left, right) = self.primitives.split_at_mut(cut.left_count);
        let (order_left, order_right) = self.order.split_at_mut(cut.left_count);
        let side = |primitives, order, i: usize| Work {
            primitives,
            order,
            bounds: cut.bounds[i],
            region: cut.regions[i],
            depth: self.depth + 1,
        };
        [side(left, order_left, 0), side(right, order_right, 1)]
    }

    /// Divides the subtree into two halves whose numbers of triangles differ by at most one. [`divide`] uses
    /// these halves if no cut is found, and for all nodes from [`HALVING_DEPTH`] on.
    fn halve(self) -> [Self; 2] {
        let middle = self.primitives.len() / 2;
        let (left, right) = self.primitives.split_at(middle);
        let cut = Cut {
            axis: 0,
            slice: 0,
            left_count: middle,
            bounds: [left, right].map(Primitive::bounds),
            regions: [left, right].map(Primitive::centre_bounds),
        };
        self.split(cut)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Triangle;
    use glam::Vec3;

    #[test]
    fn only_trees_of_large_meshes_for_one_frame_are_built_over_cells() {
        let of = |tree_use| [LARGE_MESH - 1, LARGE_MESH].map(|triangles| cells_for(tree_use, triangles));
        assert_eq!(of(TreeUse::OneFrame), [None, Some(2048)]);
        assert_eq!(of(TreeUse::ManyFrames), [None, None]);
    }

    /// The triangles' sizes grow along a row, so that a cut separates only the few largest triangles from all
    /// others. Without halving, the tree would therefore be deep.
    #[test]
    fn cells_are_halved_from_a_depth_on() {
        let mut mesh = Mesh::default();
        for number in 0..60_000 {
            let (x, size) = ((number / 256) as f32, 1.345_f32.powi(number / 256) * 1e-15);
            let first = mesh.positions.len() as u32;
            mesh.positions
                .extend([[-size, -size], [size, size], [size, -size]].map(|[y, z]| Vec3::new(x, y, z)));
            let positions = [first, first + 1, first + 2];
            mesh.triangles.push(Triangle { positions, normals: [0; 3], material: 0 });
        }
        let mut order = vec![0; 60_000];
        let mut sorted = Sorted::of(&mesh, most_cells(60_000));
        let tree = grow_cells(&mut sorted.cells(), &mut order, CELLS_HALVING_DEPTH, 1);
        // Halving 234 cells down to single cells takes 8 levels. A cell has at most 352 triangles with nearly
        // the same centre, and halving these takes 9 levels.
        assert!(tree.depth <= CELLS_HALVING_DEPTH + 8 + 9, "depth {}", tree.depth);
    }
}
