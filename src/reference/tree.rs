//! A bounding volume hierarchy, so that the oracle can judge large meshes in seconds. It finds
//! exactly the hits the exhaustive search finds: its boxes are padded far beyond `f64`'s rounding.

use super::intersect::{Hit, moller_trumbore};
use super::ray::Ray;
use super::traverse::Finder;
use crate::scene::Mesh;
use crate::strategy::Culling;
use glam::DVec3;

/// At most this many triangles per leaf.
const LEAF: usize = 4;
/// How much boxes grow, as a part of the largest coordinate.
const PADDING: f64 = 1e-9;

/// Triangles under a binary tree of boxes, split at the median of their centres.
#[derive(Clone, Debug)]
pub struct Tree {
    /// Depth first: an inner node's left child follows it.
    nodes: Vec<Node>,
    /// In the order of the leaves, each with its place in the mesh.
    triangles: Vec<Indexed>,
    culling: Culling,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    children: Children,
}

#[derive(Clone, Copy, Debug)]
enum Children {
    Inner { right: usize },
    Leaf { first: usize, end: usize },
}

#[derive(Clone, Copy, Debug)]
struct Indexed {
    corners: [DVec3; 3],
    triangle: u32,
}

impl Tree {
    /// A tree over the mesh's triangles.
    pub fn new(mesh: &Mesh, culling: Culling) -> Self {
        let indexed = |(i, t)| Indexed { corners: mesh.corners(t).map(|c| c.as_dvec3()), triangle: i as u32 };
        let triangles = mesh.triangles.iter().enumerate().map(indexed).collect();
        let mut tree = Self { nodes: Vec::new(), triangles, culling };
        tree.build(0, tree.triangles.len());
        let scale = tree.nodes.first().map_or(0.0, |root| root.low.abs().max(root.high.abs()).max_element());
        for node in &mut tree.nodes {
            node.low -= PADDING * scale;
            node.high += PADDING * scale;
        }
        tree
    }

    /// Adds the node over the triangles `first..end` and all below it.
    fn build(&mut self, first: usize, end: usize) {
        let corners = || self.triangles[first..end].iter().flat_map(|t| t.corners);
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let place = self.nodes.len();
        self.nodes.push(Node { low, high, children: Children::Leaf { first, end } });
        if end - first > LEAF {
            let middle = first + (end - first) / 2;
            self.halve(first, middle, end);
            self.build(first, middle);
            self.nodes[place].children = Children::Inner { right: self.nodes.len() };
            self.build(middle, end);
        }
    }

    /// Puts the triangles with the smaller centres before `middle`, along the axis on which centres spread most.
    fn halve(&mut self, first: usize, middle: usize, end: usize) {
        let centre = |t: &Indexed| t.corners[0] + t.corners[1] + t.corners[2];
        let part = &mut self.triangles[first..end];
        let low = part.iter().map(centre).fold(DVec3::INFINITY, DVec3::min);
        let high = part.iter().map(centre).fold(DVec3::NEG_INFINITY, DVec3::max);
        let axis = (high - low).max_position();
        part.select_nth_unstable_by(middle - first, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
    }
}

impl Finder<f64> for Tree {
    fn visit(&self, ray: &Ray<f64>, visitor: &mut dyn FnMut(Hit<f64>) -> f64) {
        if self.triangles.is_empty() {
            return;
        }
        // A component of zero would make NaN of 0 * infinity where the ray lies in a box's face.
        let inverse = 1.0 / ray.direction.map(|d| if d.abs() < 1e-100 { 1e-100 } else { d });
        Search { tree: self, ray, inverse, far: ray.far, visitor }.node(0);
    }
}

/// One ray on its way through the tree.
struct Search<'a> {
    tree: &'a Tree,
    ray: &'a Ray<f64>,
    inverse: DVec3,
    far: f64,
    visitor: &'a mut dyn FnMut(Hit<f64>) -> f64,
}

impl Search<'_> {
    /// Where the ray enters a node's box, if it does before `far`.
    fn entry(&self, node: usize) -> Option<f64> {
        let node = &self.tree.nodes[node];
        let a = (node.low - self.ray.origin) * self.inverse;
        let b = (node.high - self.ray.origin) * self.inverse;
        let enter = a.min(b).max_element().max(self.ray.near);
        let leave = a.max(b).min_element().min(self.far);
        (enter <= leave * (1.0 + PADDING)).then_some(enter)
    }

    fn node(&mut self, node: usize) {
        let (left, right) = match self.tree.nodes[node].children {
            Children::Leaf { first, end } => return self.leaf(first, end),
            Children::Inner { right } => (node + 1, right),
        };
        let nearer_left =
            self.entry(left).unwrap_or(f64::INFINITY) <= self.entry(right).unwrap_or(f64::INFINITY);
        let order = if nearer_left { [left, right] } else { [right, left] };
        for child in order {
            // Asked again, since the first child's hits may hide the second.
            if self.far > self.ray.near && self.entry(child).is_some() {
                self.node(child);
            }
        }
    }

    fn leaf(&mut self, first: usize, end: usize) {
        for Indexed { corners, triangle } in &self.tree.triangles[first..end] {
            let Some((t, weights)) = moller_trumbore(self.ray, *corners, self.tree.culling) else { continue };
            if t <= self.far && self.far > self.ray.near {
                self.far = (self.visitor)(Hit { t, weights, triangle: *triangle });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::super::ray::Frame;
    use super::super::traverse::Exhaustive;
    use super::*;
    use crate::scene::Scene;

    fn agree(scene: &Scene, culling: Culling) -> usize {
        let (tree, exhaustive) = (Tree::new(&scene.mesh, culling), Exhaustive::new(&scene.mesh, culling));
        let frame = Frame::new(&scene.camera.pixel_frame(80, 50));
        let mut hits = 0;
        for pixel in 0..80 * 50 {
            let ray = frame.primary(f64::from(pixel % 80) + 0.5, f64::from(pixel / 80) + 0.5);
            let hit = exhaustive.closest(&ray);
            assert_eq!(tree.closest(&ray), hit, "{} at pixel {pixel}", scene.name);
            let Some(hit) = hit else { continue };
            hits += 1;
            for light in &scene.lights {
                let origin = ray.origin + ray.direction * hit.t;
                let off = light.position.as_dvec3() - origin;
                let shadow = Ray { origin, direction: off.normalize(), near: 1e-4, far: off.length() };
                assert_eq!(tree.any(&shadow), exhaustive.any(&shadow), "{} shadow at {pixel}", scene.name);
            }
        }
        hits
    }

    #[test]
    fn the_tree_finds_what_the_exhaustive_search_finds() {
        for scene in [
            fixtures::single_triangle(),
            fixtures::figure_4(),
            fixtures::pyramid_lower(),
            fixtures::random(700, 1),
            fixtures::sphere(24),
        ] {
            for culling in [Culling::None, Culling::Back] {
                assert!(agree(&scene, culling) > 100, "{}", scene.name);
            }
        }
    }

    #[test]
    fn no_triangles_are_never_hit() {
        let tree = Tree::new(&Mesh::default(), Culling::None);
        let ray = Ray { origin: DVec3::ZERO, direction: DVec3::X, near: 0.0, far: f64::INFINITY };
        assert!(tree.closest(&ray).is_none());
    }
}
