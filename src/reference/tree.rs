//! A bounding volume hierarchy, so that the reference can judge large meshes in seconds. It finds
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

/// Parts of more triangles are built beside each other.
const PARALLEL: usize = 1 << 14;

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
    /// How many nodes after this one the right child is.
    Inner {
        right: usize,
    },
    Leaf {
        first: usize,
        end: usize,
    },
}

/// A triangle, with its place in the mesh.
#[derive(Clone, Copy, Debug)]
pub struct Indexed {
    /// Its corners.
    pub corners: [DVec3; 3],
    /// Its place in `Mesh::triangles`.
    pub triangle: u32,
}

impl Tree {
    /// A tree over the mesh's triangles.
    pub fn new(mesh: &Mesh, culling: Culling) -> Self {
        let indexed = |(i, t)| Indexed { corners: mesh.corners(t).map(|c| c.as_dvec3()), triangle: i as u32 };
        let mut triangles: Vec<_> = mesh.triangles.iter().enumerate().map(indexed).collect();
        let mut nodes = build(&mut triangles, 0);
        let scale = nodes.first().map_or(0.0, |root| root.low.abs().max(root.high.abs()).max_element());
        for node in &mut nodes {
            node.low -= PADDING * scale;
            node.high += PADDING * scale;
        }
        Self { nodes, triangles, culling }
    }

    /// Which side of triangles is seen.
    pub fn culling(&self) -> Culling {
        self.culling
    }

    /// The farthest that anything is from a point.
    pub fn reach(&self, point: DVec3) -> f64 {
        self.nodes
            .first()
            .map_or(0.0, |root| (root.low - point).abs().max((root.high - point).abs()).length())
    }

    /// Shows `visitor` every triangle whose box, grown by `around`, the ray meets before `far`, in about the order of their
    /// distance. It returns how far triangles still matter; what is not more than `ray.near` ends the walk.
    pub fn walk(&self, ray: &Ray<f64>, around: f64, mut visitor: impl FnMut(&Indexed, f64) -> f64) {
        // A component of zero would make NaN of 0 * infinity where the ray lies in a box's face.
        let inverse = 1.0 / ray.direction.map(|d| if d.abs() < 1e-100 { 1e-100 } else { d });
        let entry = |node: &Node, far: f64| {
            let a = (node.low - around - ray.origin) * inverse;
            let b = (node.high + around - ray.origin) * inverse;
            let enter = a.min(b).max_element().max(ray.near);
            let leave = a.max(b).min_element().min(far);
            if enter <= leave * (1.0 + PADDING) { enter } else { f64::INFINITY }
        };
        let mut far = ray.far;
        let mut open = [(0, 0.0); DEPTH];
        let mut count = self.nodes.first().map_or(0, |root| usize::from(entry(root, far) < f64::INFINITY));
        while count > 0 && far > ray.near {
            count -= 1;
            let (place, entered) = open[count];
            if entered > far * (1.0 + PADDING) {
                continue;
            }
            match self.nodes[place].children {
                Children::Leaf { first, end } => {
                    for triangle in &self.triangles[first..end] {
                        far = visitor(triangle, far);
                    }
                }
                Children::Inner { right } => {
                    let children =
                        [place + 1, place + right].map(|child| (child, entry(&self.nodes[child], far)));
                    let [near, other] = children;
                    let order = if near.1 <= other.1 { [other, near] } else { [near, other] };
                    for child in order.into_iter().filter(|child| child.1 < f64::INFINITY) {
                        open[count] = child;
                        count += 1;
                    }
                }
            }
        }
    }
}

/// More than a tree over any mesh has levels, as each halves what is left.
const DEPTH: usize = 64;

/// The nodes over a part of the triangles, the first of which is the whole tree's number `base`.
fn build(part: &mut [Indexed], base: usize) -> Vec<Node> {
    if part.is_empty() {
        return Vec::new();
    }
    if part.len() <= LEAF {
        let corners = || part.iter().flat_map(|t| t.corners);
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        return vec![Node { low, high, children: Children::Leaf { first: base, end: base + part.len() } }];
    }
    let middle = part.len() / 2;
    halve(part, middle);
    let (several, (first, second)) = (part.len() > PARALLEL, part.split_at_mut(middle));
    let (left, right) = match several {
        true => rayon::join(|| build(first, base), || build(second, base + middle)),
        false => (build(first, base), build(second, base + middle)),
    };
    let (low, high) = (left[0].low.min(right[0].low), left[0].high.max(right[0].high));
    let mut nodes = Vec::with_capacity(1 + left.len() + right.len());
    nodes.push(Node { low, high, children: Children::Inner { right: 1 + left.len() } });
    nodes.extend(left);
    nodes.extend(right);
    nodes
}

/// Puts the triangles with the smaller centres before `middle`, along the axis on which centres spread most.
fn halve(part: &mut [Indexed], middle: usize) {
    let centre = |t: &Indexed| t.corners[0] + t.corners[1] + t.corners[2];
    let low = part.iter().map(centre).fold(DVec3::INFINITY, DVec3::min);
    let high = part.iter().map(centre).fold(DVec3::NEG_INFINITY, DVec3::max);
    let axis = (high - low).max_position();
    part.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
}

impl Finder<f64> for Tree {
    fn visit(&self, ray: &Ray<f64>, visitor: &mut dyn FnMut(Hit<f64>) -> f64) {
        self.walk(ray, 0.0, |Indexed { corners, triangle }, far| {
            match moller_trumbore(ray, *corners, self.culling) {
                Some((t, weights)) if t <= far && far > ray.near => {
                    visitor(Hit { t, weights, triangle: *triangle })
                }
                _ => far,
            }
        });
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
