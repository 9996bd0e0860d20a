//! A bounding volume hierarchy. With the tree, each ray is tested against few triangles even if the mesh is large.
//! The tree yields exactly the hits of an exhaustive search, since the tree's boxes are padded by far more
//! than the rounding errors of `f64`.

use super::intersect::{Hit, moller_trumbore};
use super::leaning::{LargerHit, larger_hit, margin};
use super::ray::Ray;
use super::traverse::Finder;
use crate::scene::Mesh;
use crate::strategy::Culling;
use glam::{DVec3, Vec3};

/// Largest number of triangles in a leaf.
const LEAF: usize = 4;
/// Padding of boxes, relative to the largest coordinate.
const PADDING: f64 = 1e-9;

/// Subtrees with more triangles than this are built in parallel.
const PARALLEL: usize = 1 << 14;

/// A binary tree of boxes around triangles.
#[derive(Clone, Debug)]
pub struct Tree {
    /// The nodes in depth-first order: the left child of an inner node directly follows this node.
    nodes: Vec<Node>,
    /// The triangles in leaf order, each with its index in the mesh.
    triangles: Vec<Indexed>,
    culling: Culling,
}

/// A node with the box around all triangles below the node. The box is in single precision, which halves the
/// memory of the box. No hit is lost, since the triangles' corners have single precision too, and boxes are
/// rounded outwards.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vec3,
    high: Vec3,
    children: Children,
}

#[derive(Clone, Copy, Debug)]
enum Children {
    Inner {
        /// Number of nodes from this node to its right child, in the list of all nodes.
        right: u32,
    },
    Leaf {
        first: u32,
        end: u32,
    },
}

/// A triangle with its index in the mesh.
#[derive(Clone, Copy, Debug)]
pub struct Indexed {
    corners: [Vec3; 3],
    /// The triangle's index in `Mesh::triangles`.
    pub triangle: u32,
    /// True if the triangle has a mask, and so may have holes.
    pub has_holes: bool,
}

impl Indexed {
    /// Returns the triangle's corners.
    pub fn corners(&self) -> [DVec3; 3] {
        self.corners.map(Vec3::as_dvec3)
    }
}

impl Tree {
    /// Builds a tree over the mesh's triangles.
    pub fn new(mesh: &Mesh, culling: Culling) -> Self {
        let has_holes = |i: usize| mesh.textures.mapped.get(i).is_some_and(|row| row.mask.is_some());
        let indexed =
            |(i, t)| Indexed { corners: mesh.corners(t), triangle: i as u32, has_holes: has_holes(i) };
        let mut triangles: Vec<_> = mesh.triangles.iter().enumerate().map(indexed).collect();
        let mut nodes = build(&mut triangles, 0, 0);
        let scale = nodes.first().map_or(0.0, |root| root.low.abs().max(root.high.abs()).max_element());
        let padding = PADDING * f64::from(scale);
        for node in &mut nodes {
            node.low = Vec3::from_array(node.low.to_array().map(|low| below(f64::from(low) - padding)));
            node.high = Vec3::from_array(node.high.to_array().map(|high| -below(-f64::from(high) - padding)));
        }
        Self { nodes, triangles, culling }
    }

    /// Returns the size of the tree in memory, in bytes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.nodes[..]) + size_of_val(&self.triangles[..])) as u64
    }

    /// Returns which faces of triangles rays ignore (culling).
    pub fn culling(&self) -> Culling {
        self.culling
    }

    /// Returns an upper bound of the distances of all corners from `point`; 0 without triangles.
    pub fn reach(&self, point: DVec3) -> f64 {
        self.nodes.first().map_or(0.0, |root| {
            (root.low.as_dvec3() - point).abs().max((root.high.as_dvec3() - point).abs()).length()
        })
    }

    /// Passes triangles to `visitor`, approximately in the order of distance. Boxes are first enlarged by
    /// `around` on each side. The visitor gets the triangles of all leaves whose enlarged boxes the ray hits
    /// between the distances `ray.near` and `far`. At first, `far` is `ray.far`. Each call of the visitor gets a
    /// triangle and `far`, and returns the new value of `far`: the distance up to which further triangles matter.
    /// The traversal ends if `far` is not above `ray.near`.
    pub fn walk(&self, ray: &Ray<f64>, around: f64, mut visitor: impl FnMut(&Indexed, f64) -> f64) {
        // A zero component of a ray's direction would give NaN (0 * infinity) if the ray lies in a face of a
        // box.
        let inverse = 1.0 / ray.direction.map(|d| if d.abs() < 1e-100 { 1e-100 } else { d });
        let entry = |node: &Node, far: f64| {
            let a = (node.low.as_dvec3() - around - ray.origin) * inverse;
            let b = (node.high.as_dvec3() + around - ray.origin) * inverse;
            let enter = a.min(b).max_element().max(ray.near);
            let leave = a.max(b).min_element().min(far);
            if enter <= leave * (1.0 + PADDING) { enter } else { f64::INFINITY }
        };
        let mut far = ray.far;
        let mut open = [(0, 0.0); DEPTH];
        let mut count = self.nodes.first().map_or(0, |root| usize::from(entry(root, far) < f64::INFINITY));
        while count > 0 && far > ray.near {
            count -= 1;
            let (index, entered) = open[count];
            if entered > far * (1.0 + PADDING) {
                continue;
            }
            match self.nodes[index].children {
                Children::Leaf { first, end } => {
                    for triangle in &self.triangles[first as usize..end as usize] {
                        far = visitor(triangle, far);
                    }
                }
                Children::Inner { right } => {
                    let children = [index + 1, index + right as usize]
                        .map(|child| (child, entry(&self.nodes[child], far)));
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

/// An upper bound of the number of levels of a tree over any mesh.
const DEPTH: usize = 72;
/// Number of levels, from the root down, whose nodes are split where the cost is least (see `cheapest`). Nodes of
/// deeper levels are split into two parts with nearly equal numbers of triangles.
const LEVELS_BY_COST: usize = 36;
/// Number of bins along an axis. A node may be split at the borders between bins.
const BINS: usize = 16;

/// Builds the nodes over a part of the triangles. `base` is the index of the part's first triangle among all triangles.
/// `level` is the number of levels from the tree's root to the node that contains all triangles of the part.
fn build(part: &mut [Indexed], base: u32, level: usize) -> Vec<Node> {
    if part.is_empty() {
        return Vec::new();
    }
    if part.len() <= LEAF {
        let Bounds { low, high } = part.iter().fold(Bounds::NONE, |bounds, t| bounds.with(t));
        return vec![Node {
            low,
            high,
            children: Children::Leaf { first: base, end: base + part.len() as u32 },
        }];
    }
    let middle = split(part, level);
    let (several, (first, second)) = (part.len() > PARALLEL, part.split_at_mut(middle));
    let (left, right) = match several {
        true => {
            rayon::join(|| build(first, base, level + 1), || build(second, base + middle as u32, level + 1))
        }
        false => (build(first, base, level + 1), build(second, base + middle as u32, level + 1)),
    };
    let (low, high) = (left[0].low.min(right[0].low), left[0].high.max(right[0].high));
    let mut nodes = Vec::with_capacity(1 + left.len() + right.len());
    nodes.push(Node { low, high, children: Children::Inner { right: 1 + left.len() as u32 } });
    nodes.extend(left);
    nodes.extend(right);
    nodes
}

/// Returns the largest `f32` that is not greater than `value`.
fn below(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) > value { nearest.next_down() } else { nearest }
}

fn centre(t: &Indexed) -> DVec3 {
    let [a, b, c] = t.corners();
    a + b + c
}

/// Splits a node's triangles into two non-empty parts, and returns the number of triangles in the first part.
/// The triangles are split along the axis along which their centres are spread most. The split is where a ray
/// is expected to test the fewest triangles (the surface area heuristic over bins of centres, from "On fast
/// Construction of SAH-based Bounding Volume Hierarchies" by Ingo Wald, 2007). If `level` is at least
/// `LEVELS_BY_COST`, or if the centres of all triangles are in one bin, the two parts get nearly equal numbers
/// of triangles.
fn split(part: &mut [Indexed], level: usize) -> usize {
    let low = part.iter().map(centre).fold(DVec3::INFINITY, DVec3::min);
    let high = part.iter().map(centre).fold(DVec3::NEG_INFINITY, DVec3::max);
    let axis = (high - low).max_position();
    let per_length = BINS as f64 / (high - low)[axis];
    let bin = |t: &Indexed| (((centre(t)[axis] - low[axis]) * per_length) as usize).min(BINS - 1);
    if level < LEVELS_BY_COST
        && per_length.is_finite()
        && let Some(first_of_right) = cheapest(part, bin)
    {
        return partition(part, |t| bin(t) < first_of_right);
    }
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
    middle
}

/// Returns the first bin (interval of the axis) of the right part for the cheapest split. The cost of a split is the
/// sum, over both parts, of the box's area times the number of triangles. Returns `None` if all triangles are in one
/// bin.
fn cheapest(part: &[Indexed], bin: impl Fn(&Indexed) -> usize) -> Option<usize> {
    let mut bins = [(Bounds::NONE, 0_usize); BINS];
    for t in part {
        let (bounds, count) = &mut bins[bin(t)];
        (*bounds, *count) = (bounds.with(t), *count + 1);
    }
    let join = |(a, n): (Bounds, usize), (b, m): (Bounds, usize)| (a.join(b), n + m);
    let of = |bins: &[(Bounds, usize)]| bins.iter().copied().fold((Bounds::NONE, 0), join);
    let cost = |at: usize| {
        let sides = [of(&bins[..at]), of(&bins[at..])];
        let is_whole = sides.iter().any(|(_, count)| *count == 0);
        (!is_whole).then(|| sides.iter().map(|(bounds, count)| bounds.area() * *count as f64).sum::<f64>())
    };
    let splits = (1..BINS).filter_map(|at| Some((at, cost(at)?)));
    splits.min_by(|(_, one), (_, other)| one.total_cmp(other)).map(|(at, _)| at)
}

/// Moves the triangles for which `is_left` is true to the front of `part`, and returns their number.
fn partition(part: &mut [Indexed], is_left: impl Fn(&Indexed) -> bool) -> usize {
    let mut left = 0;
    for index in 0..part.len() {
        if is_left(&part[index]) {
            part.swap(left, index);
            left += 1;
        }
    }
    left
}

/// An axis-parallel box; it is empty if `low` is greater than `high`.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    const NONE: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    fn with(self, t: &Indexed) -> Self {
        let [a, b, c] = t.corners;
        Self { low: self.low.min(a).min(b).min(c), high: self.high.max(a).max(b).max(c) }
    }

    fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Returns half of the box's surface area.
    fn area(self) -> f64 {
        let side = (self.high.as_dvec3() - self.low.as_dvec3()).max(DVec3::ZERO);
        side.x * side.y + side.y * side.z + side.z * side.x
    }
}

impl Finder<f64> for Tree {
    fn visit(&self, ray: &Ray<f64>, visitor: &mut dyn FnMut(Hit<f64>) -> f64) {
        self.walk(ray, 0.0, |indexed, far| match moller_trumbore(ray, indexed.corners(), self.culling) {
            Some((t, weights)) if t <= far && far > ray.near => {
                visitor(Hit { t, weights, triangle: indexed.triangle })
            }
            _ => far,
        });
    }

    fn visit_larger(&self, ray: &Ray<f64>, visitor: &mut dyn FnMut(LargerHit<f64>) -> f64) {
        let end = if ray.to_light { ray.origin + ray.direction * ray.far } else { ray.origin };
        let around = margin(self.reach(ray.origin).max(self.reach(end)));
        self.walk(ray, around, |indexed, far| {
            let larger = larger_hit(ray, indexed.triangle, indexed.corners(), self.culling);
            larger.map_or(far, &mut *visitor)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::super::ray::Frame;
    use super::super::traverse::Exhaustive;
    use super::*;
    use crate::scene::{Scene, Triangle};

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
                let shadow = Ray {
                    origin,
                    direction: off.normalize(),
                    near: 1e-4,
                    far: off.length(),
                    to_light: true,
                    is_shadow: true,
                };
                assert_eq!(tree.any(&shadow), exhaustive.any(&shadow), "{} shadow at {pixel}", scene.name);
            }
        }
        hits
    }

    #[test]
    fn no_corner_is_farther_from_a_point_than_the_trees_reach() {
        let scene = fixtures::sphere(24);
        let tree = Tree::new(&scene.mesh, Culling::None);
        for point in [DVec3::ZERO, DVec3::new(0.5, -0.2, 0.1), DVec3::new(-3.0, 7.0, 1.0)] {
            let distances = scene.mesh.positions.iter().map(|corner| corner.as_dvec3().distance(point));
            let farthest = distances.fold(0.0, f64::max);
            let reach = tree.reach(point);
            assert!((farthest..2.0 * farthest).contains(&reach), "{point}: {reach}, farthest {farthest}");
        }
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
    fn the_leaves_of_a_tree_that_is_built_in_parallel_have_each_triangle_once() {
        let scene = fixtures::random(PARALLEL + 1000, 3);
        let tree = Tree::new(&scene.mesh, Culling::None);
        let ranges = tree.nodes.iter().filter_map(|node| match node.children {
            Children::Leaf { first, end } => Some(first..end),
            Children::Inner { .. } => None,
        });
        assert!(ranges.flatten().eq(0..PARALLEL as u32 + 1000));
    }

    #[test]
    fn a_tree_over_triangles_that_shrink_by_powers_is_no_deeper_than_its_stack() {
        // Each split by cost separates only the largest triangle.
        let mut mesh = (*fixtures::single_triangle().mesh).clone();
        for power in (0..56).map(|i| 1e36 * 0.05_f32.powi(i)) {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|corner| power * (Vec3::X + 0.1 * corner)));
            let triangle = Triangle { positions: [first, first + 1, first + 2], ..mesh.triangles[0] };
            mesh.triangles.push(triangle);
        }
        let levels = levels(&Tree::new(&mesh, Culling::None).nodes, 0);
        assert!(levels > LEVELS_BY_COST && levels < LEVELS_BY_COST + 8, "{levels}");
    }

    fn levels(nodes: &[Node], at: usize) -> usize {
        match nodes[at].children {
            Children::Leaf { .. } => 1,
            Children::Inner { right } => 1 + levels(nodes, at + 1).max(levels(nodes, at + right as usize)),
        }
    }

    #[test]
    fn no_triangles_are_never_hit() {
        let tree = Tree::new(&Mesh::default(), Culling::None);
        let ray = Ray {
            origin: DVec3::ZERO,
            direction: DVec3::X,
            near: 0.0,
            far: f64::INFINITY,
            to_light: false,
            is_shadow: false,
        };
        assert!(tree.closest(&ray).is_none());
    }

    #[test]
    fn a_triangle_within_the_distance_around_a_ray_is_visited_on_either_side_of_the_ray() {
        let tree = Tree::new(&fixtures::single_triangle().mesh, Culling::None);
        let Node { low, high, .. } = tree.nodes[0];
        let visits = |x: f32, around: f64| {
            let origin = DVec3::new(f64::from(x), f64::from(0.5 * (low.y + high.y)), 9.0);
            let ray = Ray {
                origin,
                direction: DVec3::NEG_Z,
                near: 0.0,
                far: f64::INFINITY,
                to_light: false,
                is_shadow: false,
            };
            let mut count = 0;
            tree.walk(&ray, around, |_, far| {
                count += 1;
                far
            });
            count
        };
        for x in [low.x - 0.5, high.x + 0.5] {
            assert_eq!([0.0, 0.4, 0.6].map(|around| visits(x, around)), [0, 0, 1], "{x}");
        }
    }
}
