//! Traverses a tree with a single ray on the host, in f64, with the same steps as the kernels of `traversal = bvh`.

use super::WideBvh;
use glam::DVec3;

/// The closest triangle that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The triangle's number in the mesh.
    pub triangle: u32,
    /// Distance along the ray, in units of the length of the ray's direction.
    pub distance: f64,
}

/// The closest hit that a traversal finds, and the traversal's cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Walk {
    /// The closest hit; `None` if the ray hits no triangle.
    pub hit: Option<Hit>,
    /// Number of nodes whose children's boxes were tested.
    pub nodes: u32,
    /// Number of triangles against which the ray was tested.
    pub triangles: u32,
}

impl WideBvh {
    /// Finds the closest hit at a distance below `reach`. Of a node's children, those whose boxes the ray enters
    /// earlier are visited first.
    ///
    /// `test(triangle, reach)` returns the distance at which the ray hits a triangle of the mesh. `test`
    /// returns `None` if the ray misses the triangle, or if the distance is not below `reach`. If several
    /// triangles are hit at the closest distance, returns the hit that the traversal finds first.
    pub fn closest_hit(
        &self,
        origin: DVec3,
        direction: DVec3,
        mut reach: f64,
        mut test: impl FnMut(u32, f64) -> Option<f64>,
    ) -> Walk {
        let mut walk = Walk::default();
        let mut waiting = vec![(0.0, 0)];
        while let Some((near, word)) = waiting.pop() {
            if near > reach {
                continue;
            }
            if let Some(range) = Self::leaf_range(word) {
                for &triangle in &self.order[range] {
                    walk.triangles += 1;
                    if let Some(distance) = test(triangle, reach) {
                        walk.hit = Some(Hit { triangle, distance });
                        reach = distance;
                    }
                }
            } else {
                walk.nodes += 1;
                let begin = waiting.len();
                waiting.extend((0..self.width).filter_map(|slot| {
                    let entry = enter(origin, direction, self.child_box(word as usize, slot))?;
                    (entry <= reach).then_some((entry, self.child(word as usize, slot)))
                }));
                waiting[begin..].sort_by(|a, b| b.0.total_cmp(&a.0));
            }
        }
        walk
    }
}

/// Returns the distance at which a ray enters a box, or 0 if the ray begins in the box. Returns `None` if the ray
/// misses the box. If a ray misses a box by no more than a few rounding errors of f64, the function treats the ray as
/// if it hit the box.
fn enter(origin: DVec3, direction: DVec3, [low, high]: [[f32; 3]; 2]) -> Option<f64> {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let (from, to) = (f64::from(low[axis]) - origin[axis], f64::from(high[axis]) - origin[axis]);
        if direction[axis] == 0.0 {
            if from > 0.0 || to < 0.0 {
                return None;
            }
            continue;
        }
        let (t0, t1) = (from / direction[axis], to / direction[axis]);
        near = near.max(t0.min(t1) * (1.0 - 1e-15));
        far = far.min(t0.max(t1) * (1.0 + 1e-15));
    }
    (near <= far).then_some(near)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_in_the_plane_of_a_flat_box_enters_it() {
        let from = DVec3::new(-1.0, 0.0, 0.5);
        assert!(enter(from, DVec3::X, [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]).is_some());
        for side in [[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], [[0.0, -1.0, 0.0], [1.0, 0.0, 1.0]]] {
            assert!(enter(from, DVec3::X, side).is_some(), "{side:?}");
        }
        assert_eq!(enter(from, DVec3::X, [[0.0, 0.1, 0.0], [1.0, 1.0, 1.0]]), None);
        assert_eq!(enter(from, DVec3::X, [[0.0, -1.0, 0.0], [1.0, -0.1, 1.0]]), None);
    }
}
