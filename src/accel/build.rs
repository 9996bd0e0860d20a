//! Builds a binary tree from the root down on all cores, by the binned surface-area heuristic.
//!
//! A primitive is the box and the number of a triangle, in 32 bytes. A node's primitives are contiguous in a
//! buffer, and a cut moves them within this part of the buffer. To find a cut, a node is divided into slices
//! along each axis, and the primitives of each slice are counted. In large nodes, all cores count and move
//! the primitives, chunk by chunk. The two sides of a cut are independent tasks, except in small subtrees.

use super::bins::{Bins, Cut, Slicer};
use super::bounds::{Bounds, Primitive};
use super::partition::{partition, partition_chunks};
use super::{Bvh, Node};
use crate::scene::Mesh;
use rayon::prelude::*;

/// In nodes with more triangles than this, all cores count the triangles of each slice and move them to the sides of a
/// cut.
const PARALLEL_NODE: usize = 1 << 16;
/// Number of triangles in a chunk. All cores compute the root's box chunk by chunk. In a node with more than
/// `PARALLEL_NODE` triangles, all cores also count and move the triangles chunk by chunk.
const CHUNK: usize = 1 << 14;
/// A subtree with at most this many triangles is built by one task.
const TASK: usize = 1 << 12;
/// If a subtree has at most this many triangles, and its parent has more, the subtree's nodes are joined into one
/// piece as soon as the subtree is finished. Most of these pieces are large, and the allocator returns the memory of
/// a large piece to the system when the piece is freed. The allocator would keep the memory of many small pieces, so
/// large meshes would need a tenth more memory.
const JOINED: usize = 1 << 19;
/// To find a cut, nodes with more triangles than this are divided into `FINE` slices along each axis. All other
/// nodes are divided into `COARSE` slices.
const FINE_NODE: usize = 64;
const FINE: usize = 16;
const COARSE: usize = 8;
/// From this depth on, a node is divided into two halves whose numbers of triangles differ by at most one. The halving
/// limits the depth of every mesh's tree.
const HALVING_DEPTH: u32 = 64;

/// A subtree to be built.
struct Work<'a> {
    /// The subtree's primitives.
    primitives: &'a mut [Primitive],
    /// The part of the leaf order that belongs to this subtree.
    order: &'a mut [u32],
    /// The subtree's box.
    bounds: Bounds,
    /// A box that contains twice the centre of each primitive's box.
    region: Bounds,
    /// Number of cuts above this subtree.
    depth: u32,
}

/// A finished subtree: its nodes in depth-first order, in several pieces.
#[derive(Default)]
struct Subtree {
    pieces: Vec<Vec<Node>>,
    /// Number of nodes in all pieces.
    nodes: usize,
    /// Number of edges from the root of the whole tree to the deepest leaf of this subtree.
    depth: u32,
}

impl Subtree {
    /// Returns the same subtree in one piece.
    fn joined(self) -> Self {
        Self { pieces: vec![self.pieces.concat()], ..self }
    }
}

/// Builds a tree; see [`Bvh::build`].
pub(super) fn build(mesh: &Mesh, leaf_size: usize) -> Bvh {
    let leaf_size = leaf_size.max(1);
    let mut primitives: Vec<Primitive> = Vec::new();
    let primitive = |(i, t)| Primitive::new(mesh.corners(t), i as u32);
    mesh.triangles.par_iter().enumerate().map(primitive).collect_into_vec(&mut primitives);
    if primitives.is_empty() {
        return Bvh { nodes: Vec::new(), order: Vec::new(), depth: 0 };
    }
    let mut order = vec![0; primitives.len()];
    let (bounds, region) = primitives
        .par_chunks(CHUNK)
        .map(|chunk| (Primitive::bounds(chunk), Primitive::centre_bounds(chunk)))
        .reduce(|| (Bounds::EMPTY, Bounds::EMPTY), |a, b| (a.0.union(b.0), a.1.union(b.1)));
    let root = Work { primitives: &mut primitives, order: &mut order, bounds, region, depth: 0 };
    let tree = grow(root, leaf_size);
    // For large meshes, the use of memory is highest here, so the triangles' boxes are freed before the pieces of the
    // tree are joined.
    drop(primitives);
    Bvh { nodes: tree.pieces.concat(), order, depth: tree.depth }
}

/// Builds a subtree: a large subtree as two tasks, a small one in this task.
fn grow(work: Work, leaf_size: usize) -> Subtree {
    let count = work.primitives.len();
    if count <= TASK.max(leaf_size) {
        let mut nodes = Vec::with_capacity(2 * count / leaf_size + 1);
        let depth = grow_serially(work, leaf_size, &mut nodes);
        return Subtree { nodes: nodes.len(), pieces: vec![nodes], depth };
    }
    let bounds = work.bounds;
    let [left, right] = divide(work);
    let side = |work: Work| {
        let joins = count > JOINED && work.primitives.len() <= JOINED;
        let subtree = grow(work, leaf_size);
        if joins { subtree.joined() } else { subtree }
    };
    let (left, right) = rayon::join(|| side(left), || side(right));
    let root = Node::inner(bounds, left.nodes as u32 + 1, count);
    let mut pieces = vec![vec![root]];
    pieces.extend(left.pieces);
    pieces.extend(right.pieces);
    Subtree { pieces, nodes: 1 + left.nodes + right.nodes, depth: left.depth.max(right.depth) }
}

/// Builds a subtree in this task, appends its nodes to `nodes`, and returns the depth of its deepest node.
fn grow_serially(work: Work, leaf_size: usize, nodes: &mut Vec<Node>) -> u32 {
    let (count, depth, index) = (work.primitives.len(), work.depth, nodes.len());
    nodes.push(Node::leaf(work.bounds, count));
    if count <= leaf_size {
        for (number, primitive) in work.order.iter_mut().zip(work.primitives.iter()) {
            *number = primitive.triangle();
        }
        // Kernels keep the first of two hits at the same distance. If two triangles of a leaf lie in the same
        // place, rays therefore hit the triangle that comes first in the mesh. Triangles in the same place
        // have equal centres, so only `halve` can put them into different leaves.
        work.order.sort_unstable();
        return depth;
    }
    let [left, right] = divide(work);
    let left_depth = grow_serially(left, leaf_size, nodes);
    nodes[index].right = (nodes.len() - index) as u32;
    left_depth.max(grow_serially(right, leaf_size, nodes))
}

/// Cuts a subtree's triangles in two.
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

/// Finds the best cut, moves the primitives to its two sides, and returns the cut; `None` if there is no cut.
/// `region` comes from cutting the parent's region, so it may be larger than the bounds of the primitives'
/// doubled centres. If no cut is found in `region`, the search is repeated with the exact bounds.
fn cut<const N: usize>(primitives: &mut [Primitive], region: Bounds) -> Option<Cut> {
    let try_region = |region: Bounds| {
        let slicer = Slicer::<N>::new(region);
        Bins::of(primitives, &slicer).best_cut(&slicer, region).map(|cut| (slicer, cut))
    };
    let (slicer, cut) = try_region(region).or_else(|| try_region(Primitive::centre_bounds(primitives)))?;
    partition(primitives, &slicer, &cut);
    Some(cut)
}

/// Does the same as `cut`, but on all cores.
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
    /// Returns the two sides of a cut. The primitives have already been moved to their sides.
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

    /// Returns two halves whose numbers of triangles differ by at most one. [`divide`] uses these halves if
    /// no cut is found, and for all nodes from [`HALVING_DEPTH`] on.
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
