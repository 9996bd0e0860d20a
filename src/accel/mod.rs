//! Bounding volume hierarchies over a mesh's triangles, so that a ray need not be tested against all
//! triangles.
//!
//! [`Bvh`] is a binary tree, built on all cores. [`WideBvh`] is the form that a device reads: the same tree
//! collapsed to 2 to 32 children per node, as rows of 32-bit words. [`validate`](Bvh::validate) checks a tree
//! of either form, and [`WideBvh::closest_hit`] traverses a tree on the host.

mod bins;
mod bounds;
mod build;
mod cells;
mod partition;
#[cfg(test)]
mod tests;
mod triangles;
mod validate;
mod walk;
mod wide;

use crate::scene::Mesh;
use bounds::Bounds;

pub use triangles::{NORMAL_FLOATS, PADDING_ROWS, TRIANGLE_WORDS, write_normal_rows, write_triangle_rows};
pub use wide::WideBvh;

/// A hash of the trees over a few fixed meshes. Each measured point (a strategy with a local size, an image
/// size, a scene and a device) is stored under a key. If a point uses a tree, the point's key contains this
/// hash of trees. If the trees over the fixed meshes change, because the code that builds trees or the trees'
/// layout has changed, a test fails until the hash is updated. With a new hash, points that use a tree are
/// measured again. The hash covers trees for many frames ([`TreeUse::ManyFrames`]), with which points are
/// measured.
pub const FINGERPRINT: &str = "9bed1dff56cfc58f";

/// Whether a tree is built for one frame or for many frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeUse {
    /// Many frames are cast with the tree, so the whole tree is built over triangles, for fast casting.
    ManyFrames,
    /// Only one frame is cast with the tree, so the upper part of a large mesh's tree is built over the cells
    /// of a grid, for fast building. With ten million triangles, building a tree for one frame takes three
    /// quarters of the time of building a tree for many frames. Casting with a tree for one frame takes a few per cent
    /// longer than casting with a tree for many frames.
    OneFrame,
}

/// A node of a [`Bvh`]: 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// The smallest corner of the node's box.
    pub low: [f32; 3],
    /// Number of nodes from this node to its right child, in the list of all nodes; 0 in a leaf. The left
    /// child directly follows its parent in the list.
    pub right: u32,
    /// The largest corner of the node's box.
    pub high: [f32; 3],
    /// Number of triangles below this node, at least 1.
    pub count: u32,
}

impl Node {
    fn inner(bounds: Bounds, right: u32, count: usize) -> Self {
        let (low, high) = (bounds.low.truncate(), bounds.high.truncate());
        Self { low: low.to_array(), right, high: high.to_array(), count: count as u32 }
    }

    fn leaf(bounds: Bounds, count: usize) -> Self {
        Self::inner(bounds, 0, count)
    }

    /// Returns true if the node is a leaf.
    pub fn is_leaf(&self) -> bool {
        self.right == 0
    }

    /// Returns half the surface area of the node's box.
    pub fn half_area(&self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.high[axis] - self.low[axis]);
        x * (y + z) + y * z
    }
}

/// A binary bounding volume hierarchy, stored depth first: the root is node 0, and a left child follows its
/// parent.
///
/// The triangles of each subtree are contiguous in `order`. The triangles of the root begin at index 0 of
/// `order`. The triangles of a left child begin where the parent's triangles begin, and the triangles of a
/// right child follow the triangles of the left child.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bvh {
    /// The nodes in depth-first order; empty if the mesh has no triangles.
    pub nodes: Vec<Node>,
    /// The triangles' numbers in the mesh, in leaf order.
    pub order: Vec<u32>,
    /// Number of edges from the root to the deepest leaf.
    pub depth: u32,
}

impl Bvh {
    /// A good leaf size for most purposes. The ray tracing library Embree, too, makes a leaf of every node
    /// that has at most 4 triangles (at medium build quality).
    pub const LEAF_SIZE: usize = 4;

    /// Builds a tree over a mesh's triangles on all of rayon's threads.
    ///
    /// `leaf_size` is the largest number of triangles in a leaf. Triangles that no plane separates, such as
    /// coincident ones, are divided into two halves whose numbers of triangles differ by at most one. From
    /// depth 64 on, the triangles of every node are divided into two such halves. The depth is therefore at
    /// most 64 plus the binary logarithm of the number of triangles, rounded up. Positions must be finite, as a
    /// [`Scene`](crate::scene::Scene)'s are.
    pub fn build(mesh: &Mesh, leaf_size: usize) -> Self {
        Self::build_for(TreeUse::ManyFrames, mesh, leaf_size)
    }

    /// Builds a tree like [`Self::build`], but for one frame or many frames, as `tree_use` says. A tree for
    /// one frame may differ from a tree for many frames.
    pub fn build_for(tree_use: TreeUse, mesh: &Mesh, leaf_size: usize) -> Self {
        build::build(mesh, leaf_size, build::cells_for(tree_use, mesh.triangles.len()))
    }

    /// Returns an estimate of the memory in bytes that the host needs to build a tree over `triangles` triangles. The
    /// estimate is the sum of the bytes of the leaf order, of the nodes, and of the larger one of two buffers. The
    /// builder never needs both buffers at the same time. One buffer has the triangles' boxes. The other buffer is a
    /// second copy of the nodes, which the builder makes when it joins vectors of nodes. The estimate assumes that a
    /// leaf contains (`leaf_size` + 1) / 2 triangles on average. If leaves contain more triangles, the tree has fewer
    /// nodes, and takes less memory. The estimate of the memory holds for leaf sizes up to 31. With larger leaves,
    /// ordering a large mesh's triangles by cells can take slightly more memory than this estimate.
    pub const fn build_bytes(triangles: u64, leaf_size: u64) -> u64 {
        let nodes = 2 * (2 * triangles / (leaf_size + 1) + 1) * size_of::<Node>() as u64;
        let boxes = triangles * size_of::<bounds::Primitive>() as u64;
        triangles * size_of::<u32>() as u64 + nodes + if boxes > nodes { boxes } else { nodes }
    }
}
