//! Trees in the form that OpenCL devices read: each node has up to 32 children, whose boxes are stored in the
//! node as rows of floats.

use super::{Bvh, Node, TreeUse};
use crate::error::{Error, Result};
use crate::scene::Mesh;
use rayon::prelude::*;

/// A tree of `width` children per node in the layout that kernels read, made from a [`Bvh`].
///
/// # Nodes
///
/// Node `n` begins at word `n * stride` of `nodes`; the root is node 0. A node consists of rows of `width`
/// 32-bit words, one word per child (W = width):
///
/// | words | row | content |
/// |---|---|---|
/// | 0 .. W | 0 | smallest x of the child's box, a float |
/// | W .. 2W | 1 | largest x |
/// | 2W .. 3W, 3W .. 4W | 2, 3 | smallest and largest y |
/// | 4W .. 5W, 5W .. 6W | 4, 5 | smallest and largest z |
/// | 6W .. 7W | 6 | the child word |
/// | 7W .. stride | | zeros that pad nodes of up to 8 children to whole cache lines; wider nodes have no padding |
///
/// The plane of `axis` on `side` (0 low, 1 high) is therefore row `2 * axis + side`. A child's box is exact:
/// its bounds are the smallest and the largest coordinates of the corners of all triangles below the child.
///
/// # Child words
///
/// | bits | inner child | leaf |
/// |---|---|---|
/// | 31 | 0 | 1, which makes the word negative if it is read as a signed integer |
/// | 25 .. 31 | 0 | number of triangles, 0 to 63 |
/// | 0 .. 25 | its node number | index of its first triangle in leaf order |
///
/// A node has W slots for children. The used slots come first, the unused slots last. An unused slot is a
/// leaf without triangles ([`WideBvh::UNUSED`]). The box of an unused slot is the point (`f32::MAX`,
/// `f32::MAX`, `f32::MAX`), and a leaf without triangles does no harm if a traversal visits it.
///
/// # Order
///
/// The inner children of a node are contiguous. After the inner children of a node come all nodes below the
/// first of these children, then all nodes below the second, and so on. A node's triangles are contiguous in
/// leaf order; `order` maps an index in leaf order to the triangle's number in the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct WideBvh {
    /// Children per node: 2, 4, 8, 16 or 32.
    pub width: usize,
    /// Number of words from the start of one node to the start of the next.
    pub stride: usize,
    /// The 32-bit words of all nodes. A float is stored as its bits.
    pub nodes: Vec<u32>,
    /// The triangles' numbers in the mesh, in leaf order.
    pub order: Vec<u32>,
    /// Number of nodes on the longest path from the root to a leaf, at least 1.
    pub depth: u32,
}

/// A subtree of the binary tree ([`Bvh`]) from which the wide tree is made.
#[derive(Clone, Copy)]
struct Subtree {
    /// The index of the subtree's root in the binary tree.
    node: usize,
    /// Index of the subtree's first triangle in leaf order.
    first: u32,
    count: u32,
    is_leaf: bool,
    half_area: f32,
}

impl Subtree {
    fn new(bvh: &Bvh, node: usize, first: u32) -> Self {
        let root = &bvh.nodes[node];
        Self { node, first, count: root.count, is_leaf: root.is_leaf(), half_area: root.half_area() }
    }

    /// Returns true if the subtree becomes an inner node of the wide tree. A subtree becomes a leaf if a leaf
    /// of `leaf_size` triangles can hold all triangles of the subtree.
    fn is_inner(&self, leaf_size: usize) -> bool {
        self.count as usize > leaf_size && !self.is_leaf
    }

    fn children(&self, bvh: &Bvh) -> [Self; 2] {
        let left = Self::new(bvh, self.node + 1, self.first);
        let right = self.node + bvh.nodes[self.node].right as usize;
        [left, Self::new(bvh, right, self.first + left.count)]
    }
}

impl WideBvh {
    /// The supported numbers of children per node.
    pub const WIDTHS: [usize; 5] = [2, 4, 8, 16, 32];
    /// The largest supported number of triangles in a leaf.
    pub const MAX_LEAF_SIZE: usize = 63;
    /// The largest number of triangles, and of nodes, that a child word (the 32 bits that refer to a child)
    /// can index.
    pub const MAX_INDEX: usize = 1 << 25;
    /// The bit of a child word that marks a leaf.
    pub const LEAF: u32 = 1 << 31;
    /// The child word of an unused slot: a leaf without triangles.
    pub const UNUSED: u32 = Self::LEAF;
    /// The position of the lowest bit of a leaf's triangle count in its child word.
    pub const COUNT_SHIFT: u32 = Self::MAX_INDEX.ilog2();

    /// Returns the number of words in a node with `width` slots for children.
    pub const fn stride(width: usize) -> usize {
        if width <= 8 { 8 * width } else { 7 * width }
    }

    /// Builds a mesh's tree in the form that a device reads. With fewer than 32 children per node, the leaves of the
    /// binary tree are small, and several of these leaves together can form one wide leaf of up to `leaf_size`
    /// triangles. If a node would have unused slots, wide leaves are split to fill the slots. With 32 children per
    /// node, leaves are not split: 32 work-items prepare the triangles of a leaf in parallel, so smaller leaves would
    /// save no time, and more leaves would be visited.
    ///
    /// # Errors
    ///
    /// Fails like [`Self::new`].
    pub fn of_mesh(mesh: &Mesh, width: usize, leaf_size: usize) -> Result<Self> {
        Self::of_mesh_for(TreeUse::ManyFrames, mesh, width, leaf_size)
    }

    /// Builds a tree like [`Self::of_mesh`], but for one frame or many frames, as `tree_use` says. A tree for
    /// one frame may differ from a tree for many frames.
    ///
    /// # Errors
    ///
    /// Fails like [`Self::new`].
    pub fn of_mesh_for(tree_use: TreeUse, mesh: &Mesh, width: usize, leaf_size: usize) -> Result<Self> {
        let own = if width < 32 { Bvh::LEAF_SIZE } else { leaf_size };
        Self::new(Bvh::build_for(tree_use, mesh, leaf_size.min(own)), width, leaf_size)
    }

    /// Collapses a binary tree into a tree whose nodes have up to `width` children. To find the children of a wide
    /// node, the function starts with a list of one subtree of the binary tree: the subtree below this node. The
    /// function then repeatedly replaces a subtree in the list by the two subtrees below its root, until the list fills
    /// all slots of the node, or only leaves of the binary tree are left. At first, only subtrees with more than
    /// `leaf_size` triangles are replaced, always the subtree with the largest surface area first. If slots of the node
    /// are still unused, smaller subtrees are replaced too, again by surface area, since testing an unused slot costs
    /// as much as testing a used slot. Therefore the leaves of the wide tree become as small as the slots for children
    /// allow, but never smaller than the leaves of the binary tree. The binary tree should therefore have the leaf size
    /// with which rays are cast fastest.
    ///
    /// # Errors
    ///
    /// Fails if the width is not one of [`Self::WIDTHS`], if the leaf size is not in `1..=63`, if a leaf of
    /// the binary tree has more triangles than the leaf size, or if there are more than 33,554,432 triangles
    /// or nodes.
    pub fn new(bvh: Bvh, width: usize, leaf_size: usize) -> Result<Self> {
        check(&bvh, width, leaf_size)?;
        let mut wide = Self::unused(width);
        if !bvh.nodes.is_empty() {
            let inner = wide.collapse_node(&bvh, 0, Subtree::new(&bvh, 0, 0), leaf_size);
            let collapse = |child| Self::collapse(&bvh, child, width, leaf_size);
            let parts: Vec<Self> = inner.into_par_iter().map(collapse).collect();
            // The trees of large meshes take hundreds of megabytes, so the nodes of the binary tree are freed
            // as soon as the wide nodes are made from them.
            drop(bvh.nodes);
            wide.append(parts);
        }
        wide.order = bvh.order;
        if wide.node_count() > Self::MAX_INDEX {
            return Err(Error::run(
                "the tree has more than 33,554,432 nodes; references to child nodes cannot index more",
            )
            .with_help(
                "choose a larger leaf size (axis leaf_size), or more children per node (axis node_width)",
            ));
        }
        Ok(wide)
    }

    /// Returns a tree of one node whose slots for children are all unused.
    fn unused(width: usize) -> Self {
        let stride = Self::stride(width);
        let mut wide = Self { width, stride, nodes: Vec::new(), order: Vec::new(), depth: 1 };
        wide.add_nodes(1);
        wide
    }

    /// Makes a wide tree from a subtree of the binary tree. The subtree's root becomes node 0.
    fn collapse(bvh: &Bvh, subtree: Subtree, width: usize, leaf_size: usize) -> Self {
        let mut wide = Self::unused(width);
        let mut waiting = vec![(0, 1, subtree)];
        while let Some((node, depth, subtree)) = waiting.pop() {
            wide.depth = wide.depth.max(depth);
            let first = wide.node_count();
            let inner = wide.collapse_node(bvh, node, subtree, leaf_size);
            let numbered = (first..first + inner.len()).zip(inner);
            waiting.extend(numbered.rev().map(|(node, child)| (node, depth + 1, child)));
        }
        wide
    }

    /// Writes the node `node` of the wide tree. For each inner child of the node, appends a node whose slots
    /// for children are still unused. Returns the binary subtrees of the inner children.
    fn collapse_node(&mut self, bvh: &Bvh, node: usize, subtree: Subtree, leaf_size: usize) -> Vec<Subtree> {
        let mut children = Vec::with_capacity(self.width);
        children.push(subtree);
        open(bvh, &mut children, self.width, leaf_size);
        open(bvh, &mut children, self.width, 0);
        self.write(bvh, node, &children, leaf_size);
        children.retain(|child| child.is_inner(leaf_size));
        self.add_nodes(children.len());
        children
    }

    /// Appends the wide trees `parts`. Each part was made from the subtree below one inner child of the root;
    /// the parts have the order of these children. The root of a part replaces the placeholder node that
    /// stands for the child; the other nodes of the part are appended. All threads copy, so that they share the cost of
    /// new memory. When a page of memory is first written, the system fills the page with zeros, which takes longer
    /// than copying.
    fn append(&mut self, parts: Vec<Self>) {
        let (width, stride, own) = (self.width, self.stride, self.nodes.len());
        self.depth = parts.iter().map(|part| part.depth + 1).fold(self.depth, u32::max);
        let lengths = parts.iter().map(|part| part.nodes.len() - stride);
        let mut nodes = vec![0; own + lengths.sum::<usize>()];
        nodes[..own].copy_from_slice(&self.nodes);
        let (roots, mut rest) = nodes.split_at_mut(own);
        let mut first = own / stride;
        let mut copies = Vec::with_capacity(parts.len());
        for (root, part) in roots.chunks_exact_mut(stride).skip(1).zip(parts) {
            let (others, after) = rest.split_at_mut(part.nodes.len() - stride);
            rest = after;
            let count = others.len() / stride;
            copies.push((root, others, first, part));
            first += count;
        }
        copies.into_par_iter().for_each(|(root, others, first, part)| {
            root.copy_from_slice(&part.nodes[..stride]);
            others.copy_from_slice(&part.nodes[stride..]);
            for node in std::iter::once(root).chain(others.chunks_exact_mut(stride)) {
                let words = &mut node[6 * width..][..width];
                let inner = words.iter_mut().filter(|word| **word & Self::LEAF == 0);
                inner.for_each(|word| *word += first as u32 - 1);
            }
        });
        self.nodes = nodes;
    }

    /// Returns the number of nodes in the tree.
    pub fn node_count(&self) -> usize {
        self.nodes.len() / self.stride
    }

    /// Returns the largest number of stack entries that a traversal needs. The stack holds all children that
    /// are not yet visited, including the current node's children.
    pub fn stack_size(&self) -> usize {
        self.depth as usize * (self.width - 1) + 1
    }

    /// Returns the word that describes a child (see the table "Child words" of [`WideBvh`]).
    pub fn child(&self, node: usize, slot: usize) -> u32 {
        self.nodes[node * self.stride + 6 * self.width + slot]
    }

    /// Returns a child's box: its smallest and its largest corner.
    pub fn child_box(&self, node: usize, slot: usize) -> [[f32; 3]; 2] {
        let row = |row: usize| f32::from_bits(self.nodes[node * self.stride + row * self.width + slot]);
        [[row(0), row(2), row(4)], [row(1), row(3), row(5)]]
    }

    /// Returns the range of a leaf's triangles in leaf order, from its child word; `None` for an inner node.
    pub fn leaf_range(word: u32) -> Option<std::ops::Range<usize>> {
        let first = word as usize & (Self::MAX_INDEX - 1);
        let count = (word & !Self::LEAF) >> Self::COUNT_SHIFT;
        (word & Self::LEAF != 0).then_some(first..first + count as usize)
    }

    /// Appends nodes whose slots for children are all unused.
    fn add_nodes(&mut self, count: usize) {
        let (words, boxes) = (7 * self.width, 6 * self.width);
        for _ in 0..count {
            let begin = self.nodes.len();
            self.nodes.resize(begin + boxes, f32::MAX.to_bits());
            self.nodes.resize(begin + words, Self::UNUSED);
            self.nodes.resize(begin + self.stride, 0);
        }
    }

    /// Writes the boxes and child words of a node. The caller must append the nodes of the inner children next. The
    /// child words (the references to the node's children) already contain the numbers that these nodes will get.
    fn write(&mut self, bvh: &Bvh, node: usize, children: &[Subtree], leaf_size: usize) {
        let mut next = self.node_count() as u32;
        for (slot, child) in children.iter().enumerate() {
            let word = if child.is_inner(leaf_size) {
                next += 1;
                next - 1
            } else {
                Self::LEAF | child.count << Self::COUNT_SHIFT | child.first
            };
            self.write_child(node, slot, &bvh.nodes[child.node], word);
        }
    }

    fn write_child(&mut self, node: usize, slot: usize, child: &Node, word: u32) {
        let begin = node * self.stride + slot;
        for axis in 0..3 {
            self.nodes[begin + 2 * axis * self.width] = child.low[axis].to_bits();
            self.nodes[begin + (2 * axis + 1) * self.width] = child.high[axis].to_bits();
        }
        self.nodes[begin + 6 * self.width] = word;
    }
}

/// Replaces subtrees with more than `least` triangles by their two children, always the subtree whose box has
/// the largest surface first. Stops when `children` has `width` subtrees, or when only leaves of the binary
/// tree and subtrees with at most `least` triangles are left.
fn open(bvh: &Bvh, children: &mut Vec<Subtree>, width: usize, least: usize) {
    while children.len() < width {
        let candidates = children.iter().enumerate().filter(|(_, child)| child.is_inner(least));
        let Some((largest, _)) = candidates.max_by(|a, b| a.1.half_area.total_cmp(&b.1.half_area)) else {
            return;
        };
        let [left, right] = children[largest].children(bvh);
        children[largest] = left;
        children.push(right);
    }
}

fn check(bvh: &Bvh, width: usize, leaf_size: usize) -> Result<()> {
    if !WideBvh::WIDTHS.contains(&width) {
        return Err(Error::input(format!("a node cannot have {width} children; expected 2, 4, 8, 16 or 32"))
            .with_help("choose one of these numbers of children"));
    }
    let own =
        bvh.nodes.iter().filter(|node| node.is_leaf()).map(|node| node.count).max().unwrap_or(1) as usize;
    if !(own..=WideBvh::MAX_LEAF_SIZE).contains(&leaf_size) {
        return Err(Error::input(format!(
            "a leaf size of {leaf_size} is not possible; expected {own} to {} for this tree",
            WideBvh::MAX_LEAF_SIZE
        ))
        .with_help("choose a leaf size in this range"));
    }
    if bvh.order.len() > WideBvh::MAX_INDEX {
        return Err(Error::run(format!(
            "the scene has {} triangles; a tree's leaves can index at most {}",
            bvh.order.len(),
            WideBvh::MAX_INDEX
        ))
        .with_help("use a scene with fewer triangles, or a strategy without a tree: --strategy deferred"));
    }
    Ok(())
}
