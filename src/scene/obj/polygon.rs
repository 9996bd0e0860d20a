//! Triangulates polygons: a fan for a convex polygon, ear clipping for others.

use glam::{DVec2, DVec3};

/// Ear clipping takes cubic time in the worst case, so concave faces with more corners are refused.
pub(super) const MAX_CONCAVE_CORNERS: usize = 1024;

/// Divides an outline of at least three corners into triangles of corner indices, in the outline's
/// orientation. Returns `None` if the outline is concave and has more than 1024 corners. For a
/// self-intersecting outline the triangles are arbitrary, but the function never fails.
pub(in crate::scene) fn triangulate(outline: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let flat = flatten(outline);
    if is_convex(&flat) {
        return Some((1..outline.len() - 1).map(|i| [0, i, i + 1]).collect());
    }
    (outline.len() <= MAX_CONCAVE_CORNERS).then(|| clip_ears(&flat))
}

/// Projects the outline onto the coordinate plane in which its area is largest, counter-clockwise.
fn flatten(outline: &[DVec3]) -> Vec<DVec2> {
    let next = outline.iter().cycle().skip(1);
    // Newell's normal, which also works for outlines that are not quite flat.
    let normal: DVec3 = outline.iter().zip(next).map(|(a, b)| (a - outline[0]).cross(b - outline[0])).sum();
    let size = normal.abs();
    let project = |p: &DVec3| {
        if size.z >= size.x && size.z >= size.y {
            DVec2::new(p.x * sign(normal.z), p.y)
        } else if size.x >= size.y {
            DVec2::new(p.y * sign(normal.x), p.z)
        } else {
            DVec2::new(p.z * sign(normal.y), p.x)
        }
    };
    outline.iter().map(project).collect()
}

fn sign(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// Returns twice the signed area of a triangle.
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

fn is_convex(flat: &[DVec2]) -> bool {
    let count = flat.len();
    (0..count).all(|i| area(flat[i], flat[(i + 1) % count], flat[(i + 2) % count]) >= 0.0)
}

fn clip_ears(flat: &[DVec2]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..flat.len()).collect();
    let mut triangles = Vec::with_capacity(flat.len() - 2);
    while left.len() > 3 {
        // A self-intersecting polygon may have no ear; then any corner is cut off.
        let ear = (0..left.len()).find(|&at| is_ear(flat, &left, at)).unwrap_or(0);
        triangles.push(around(&left, ear));
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

fn around(left: &[usize], at: usize) -> [usize; 3] {
    let count = left.len();
    [left[(at + count - 1) % count], left[at], left[(at + 1) % count]]
}

/// Returns whether the corner is convex and no other corner lies in its triangle.
fn is_ear(flat: &[DVec2], left: &[usize], at: usize) -> bool {
    let corners = around(left, at);
    let [a, b, c] = corners.map(|i| flat[i]);
    area(a, b, c) > 0.0
        && left.iter().filter(|i| !corners.contains(i)).all(|&i| {
            let p = flat[i];
            area(a, b, p) < 0.0 || area(b, c, p) < 0.0 || area(c, a, p) < 0.0
        })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn total_area(outline: &[DVec3]) -> (f64, f64) {
        let triangles = triangulate(outline).unwrap();
        assert_eq!(triangles.len(), outline.len() - 2);
        let areas =
            triangles.iter().map(|t| (outline[t[1]] - outline[t[0]]).cross(outline[t[2]] - outline[t[0]]));
        (areas.clone().map(|a| a.length()).sum::<f64>() / 2.0, areas.sum::<DVec3>().length() / 2.0)
    }

    fn star(points: usize) -> Vec<DVec3> {
        (0..2 * points)
            .map(|i| {
                let angle = std::f64::consts::PI * i as f64 / points as f64;
                let radius = if i % 2 == 0 { 1.0 } else { 0.3 };
                // The star lies in a tilted plane, so that the projection is tested too.
                DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.5 * radius * angle.cos())
            })
            .collect()
    }

    #[test]
    fn concave_polygons_are_covered_once_without_overlap() {
        for points in [2, 3, 5, 17] {
            let (forward, backward) = (star(points), star(points).into_iter().rev().collect::<Vec<_>>());
            for outline in [forward, backward] {
                let (sum, oriented) = total_area(&outline);
                assert!((sum - oriented).abs() < 1e-9, "overlap: {sum} against {oriented}");
            }
        }
    }

    #[test]
    fn a_dart_is_cut_at_its_reflex_corner() {
        let flat = [(0.0, 0.0), (2.0, 1.0), (0.0, 2.0), (0.5, 1.0)];
        for axis in ["z", "x", "y"] {
            let facing = |(x, y)| match axis {
                "x" => DVec3::new(0.0, x, y),
                "y" => DVec3::new(y, 0.0, x),
                _ => DVec3::new(x, y, 0.0),
            };
            let mut dart = flat.map(facing);
            for direction in ["+", "-"] {
                let (sum, oriented) = total_area(&dart);
                assert!(
                    (sum - oriented).abs() < 1e-12 && (sum - 1.5).abs() < 1e-12,
                    "{direction}{axis}: {sum}"
                );
                dart.reverse();
            }
        }
    }

    #[test]
    fn degenerate_outlines_give_triangles_too() {
        assert_eq!(triangulate(&[DVec3::ONE; 5]).unwrap().len(), 3);
    }
}
