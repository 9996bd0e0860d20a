//! Checks a tree, for tests: every triangle occurs once, boxes enclose their contents, indices are in range.

use super::{Bvh, Node, WideBvh};
use crate::scene::Mesh;

/// The result of checking a tree. If the tree has a problem, the result is an error with a message about the first
/// problem.
type Verdict = Result<(), String>;

impl Bvh {
    /// Checks that every triangle lies in exactly one leaf, every box encloses its children and triangles,
    /// every node is reached once, and the stored numbers of triangles and the depth are right.
    ///
    /// # Errors
    ///
    /// Returns a message about the first problem in the tree.
    pub fn validate(&self, mesh: &Mesh) -> Verdict {
        is_permutation(&self.order, mesh.triangles.len())?;
        if self.nodes.is_empty() != self.order.is_empty() {
            return Err(format!(
                "the tree has {} nodes and {} triangles; expected both numbers to be 0, or neither",
                self.nodes.len(),
                self.order.len()
            ));
        }
        let (mut reached, mut depth) = (0, 0);
        let mut waiting = Vec::new();
        if let Some(root) = self.nodes.first() {
            expect_equal("the root's triangles", root.count as usize, self.order.len())?;
            waiting.push((0, 0, 0));
        }
        while let Some((number, first, level)) = waiting.pop() {
            // A depth-first walk must reach the nodes in the order of their numbers. If a depth-first walk
            // reaches the nodes in this order, it reaches each node once, and the tree has no cycle.
            expect_equal("the next node in depth-first order", number, reached)?;
            reached += 1;
            depth = depth.max(level);
            let node = &self.nodes[number];
            if node.is_leaf() {
                let range = first..first + node.count as usize;
                encloses_triangles(mesh, &self.order[range], (node.low, node.high))?;
            } else {
                let [left, right] = self.checked_children(number, node)?;
                let right_first = first + self.nodes[left].count as usize;
                waiting.extend([(right, right_first, level + 1), (left, first, level + 1)]);
            }
        }
        expect_equal("nodes reached", reached, self.nodes.len())?;
        expect_equal("depth", depth as usize, self.depth as usize)
    }

    fn checked_children(&self, number: usize, node: &Node) -> Result<[usize; 2], String> {
        let children = [number + 1, number + node.right as usize];
        let [Some(left), Some(right)] = children.map(|child| self.nodes.get(child)) else {
            return Err(format!("node {number} has a child beyond the last node: {children:?}"));
        };
        if left.count == 0 || right.count == 0 {
            return Err(format!("node {number} has a child without triangles"));
        }
        expect_equal(
            "triangles below both children",
            (left.count + right.count) as usize,
            node.count as usize,
        )?;
        for child in [left, right] {
            encloses((node.low, node.high), (child.low, child.high))?;
        }
        Ok(children)
    }
}

impl WideBvh {
    /// Checks that every triangle lies in exactly one leaf of the layout, and that every child's box encloses
    /// all triangles below this child. The function also checks that every node is reached once, that unused
    /// child slots are marked as unused, and that the depth is right.
    ///
    /// # Errors
    ///
    /// Returns a message about the first problem in the tree.
    pub fn validate(&self, mesh: &Mesh) -> Verdict {
        is_permutation(&self.order, mesh.triangles.len())?;
        let mut held = vec![0u32; self.order.len()];
        let mut reached = vec![false; self.node_count()];
        let mut depth = 0;
        let everything = ([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
        let mut waiting = vec![(0, everything, 1)];
        while let Some((node, bounds, level)) = waiting.pop() {
            match reached.get_mut(node) {
                Some(seen) if !*seen => *seen = true,
                Some(_) => return Err(format!("node {node} has two parents")),
                None => {
                    return Err(format!(
                        "a parent names node {node}, but the tree has only {} nodes",
                        self.node_count()
                    ));
                }
            }
            depth = depth.max(level);
            for slot in 0..self.width {
                let [low, high] = self.child_box(node, slot);
                let word = self.child(node, slot);
                let Some(range) = Self::leaf_range(word) else {
                    encloses(bounds, (low, high))?;
                    waiting.push((word as usize, (low, high), level + 1));
                    continue;
                };
                if range.is_empty() {
                    let is_marked = word == Self::UNUSED && [low, high] == [[f32::MAX; 3]; 2];
                    is_marked
                        .then_some(())
                        .ok_or(format!("child {slot} of node {node} is empty but not marked unused"))?;
                    continue;
                }
                encloses(bounds, (low, high))?;
                let triangles =
                    self.order.get(range.clone()).ok_or("a leaf ends beyond the last triangle")?;
                encloses_triangles(mesh, triangles, (low, high))?;
                held[range].iter_mut().for_each(|count| *count += 1);
            }
        }
        if let Some(position) = held.iter().position(|&count| count != 1) {
            return Err(format!(
                "the triangle at place {position} of the leaf order lies in {} leaves; expected 1",
                held[position]
            ));
        }
        expect_equal("nodes reached", reached.iter().filter(|&&seen| seen).count(), self.node_count())?;
        expect_equal("depth", depth, self.depth as usize)
    }
}

/// A box, given by the corner with its smallest coordinates and the corner with its largest coordinates.
type Corners = ([f32; 3], [f32; 3]);

fn expect_equal(what: &str, actual: usize, expected: usize) -> Verdict {
    (actual == expected).then_some(()).ok_or(format!("{what}: {actual}, expected {expected}"))
}

fn encloses(outer: Corners, inner: Corners) -> Verdict {
    let is_inside = |axis: usize| outer.0[axis] <= inner.0[axis] && inner.1[axis] <= outer.1[axis];
    (0..3).all(is_inside).then_some(()).ok_or(format!("the box {outer:?} does not enclose {inner:?}"))
}

fn encloses_triangles(mesh: &Mesh, triangles: &[u32], bounds: Corners) -> Verdict {
    for &number in triangles {
        for corner in mesh.corners(&mesh.triangles[number as usize]) {
            encloses(bounds, (corner.to_array(), corner.to_array()))?;
        }
    }
    Ok(())
}

fn is_permutation(order: &[u32], count: usize) -> Verdict {
    expect_equal("triangles in leaf order", order.len(), count)?;
    let mut seen = vec![false; count];
    for &number in order {
        match seen.get_mut(number as usize) {
            Some(seen) if !*seen => *seen = true,
            _ => {
                return Err(format!(
                    "triangle {number} occurs twice in the leaf order, or the mesh of {count} triangles lacks it"
                ));
            }
        }
    }
    Ok(())
}
