//! Divides polygons into triangles. A convex polygon becomes a fan of triangles, and so does a polygon of many
//! corners that only rounding errors make concave. Any other polygon is divided by ear clipping, or refused if
//! it has too many corners.

use glam::{DVec2, DVec3};

/// The time of ear clipping grows with the square of the number of corners: it is up to two seconds for
/// `MAX_CONCAVE_CORNERS` corners. A concave face with more corners is refused, unless only rounding errors make it
/// concave.
pub(in crate::scene) const MAX_CONCAVE_CORNERS: usize = 32_768;

/// An outline with more than `MANY_CORNERS` corners is divided into a fan even if it is concave, provided that only
/// rounding errors make it concave. A concave outline with at most `MANY_CORNERS` corners is divided by ear clipping,
/// which is then fast and reverses no triangle.
const MANY_CORNERS: usize = 1_024;

/// The largest width of a seam (see [`has_sound_fan`]), as a fraction of the outline's size.
const WIDEST_SEAM: f64 = 1e-4;

/// Divides an outline of at least three corners into triangles. Each triangle has three indices of corners,
/// in the outline's orientation. Corners that repeat the corner before them get no triangle, unless fewer than
/// three other corners are left. Returns `None` if the outline has more than [`MAX_CONCAVE_CORNERS`] corners
/// and is concave by more than rounding explains. For a self-intersecting outline, the triangles are
/// arbitrary.
pub(in crate::scene) fn triangulate(outline: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let count = outline.len();
    let kept: Vec<usize> = (0..count).filter(|&i| outline[i] != outline[(i + count - 1) % count]).collect();
    if !(3..count).contains(&kept.len()) {
        return divide(outline);
    }
    let corners: Vec<DVec3> = kept.iter().map(|&i| outline[i]).collect();
    Some(divide(&corners)?.into_iter().map(|triangle| triangle.map(|i| kept[i])).collect())
}

/// Divides an outline as [`triangulate`] does, but does not leave out corners that repeat the corner before
/// them. The angle at a repeated corner is unknown, so a concave corner that is repeated looks straight.
fn divide(outline: &[DVec3]) -> Option<Vec<[usize; 3]>> {
    let flat = flatten(outline);
    if is_convex(&flat) || (flat.len() > MANY_CORNERS && has_sound_fan(&flat)) {
        return Some((1..outline.len() - 1).map(|i| [0, i, i + 1]).collect());
    }
    (outline.len() <= MAX_CONCAVE_CORNERS).then(|| clip_ears(&in_single_precision(&flat)))
}

/// Returns the positions relative to the first corner, rounded to single precision. In ear clipping, the signs
/// of the areas of different triangles must not contradict each other. Unless a triangle between rounded
/// corners has no area, its area is far larger than the rounding errors of [`area`]. If the corners were not
/// rounded, a triangle of three corners on a line could have an area as small as these errors, so the area's
/// sign would be arbitrary.
fn in_single_precision(flat: &[DVec2]) -> Vec<DVec2> {
    flat.iter().map(|corner| (*corner - flat[0]).as_vec2().as_dvec2()).collect()
}

/// Projects the outline onto the coordinate plane in which its area is largest. The projected corners run
/// counter-clockwise.
fn flatten(outline: &[DVec3]) -> Vec<DVec2> {
    let next = outline.iter().cycle().skip(1);
    // This is Newell's normal, which also exists for outlines that are not quite flat.
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

/// Returns true if a fan covers an outline once, except for overlaps that rounding explains. Positions are
/// rounded to single precision. In a circle of very many corners, the angles are so flat that rounding makes
/// some corners concave. If corners are concave, triangles of the fan may be reversed. Twice the total area
/// of the reversed triangles may be at most the area of a seam, a narrow strip along the outline. The seam's
/// width is four times the largest rounding error of a coordinate. The seam's width is limited to a fraction
/// of the outline's size ([`WIDEST_SEAM`]), because an outline in double precision may be small and far from
/// the origin.
fn has_sound_fan(flat: &[DVec2]) -> bool {
    let first = flat[0];
    let largest = |from: DVec2| flat.iter().map(|p| (*p - from).abs().max_element()).fold(0.0, f64::max);
    let seam = (2.0 * f64::from(f32::EPSILON) * largest(DVec2::ZERO)).min(WIDEST_SEAM * largest(first));
    let sides = || flat.windows(2).map(|side| (side[0], side[1]));
    let length: f64 = sides().map(|(a, b)| a.distance(b)).sum();
    let reversed: f64 = sides().map(|(a, b)| -area(first, a, b).min(0.0)).sum();
    reversed <= seam * length
}

/// Divides a polygon into triangles by cutting off one ear after the other.
fn clip_ears(flat: &[DVec2]) -> Vec<[usize; 3]> {
    let mut left = Remaining::of(flat);
    let mut triangles = Vec::with_capacity(flat.len() - 2);
    while left.corners.len() > 3 {
        // A self-intersecting polygon may have no ear. If there is no ear, the first corner is cut off.
        let ear = left.is_ear.iter().position(|is_ear| *is_ear).unwrap_or(0);
        triangles.push(left.around(ear));
        left.cut(ear);
    }
    triangles.push([left.corners[0], left.corners[1], left.corners[2]]);
    triangles
}

/// The part of a polygon that is not yet divided.
struct Remaining<'a> {
    flat: &'a [DVec2],
    /// The corners, in the order of the outline.
    corners: Vec<usize>,
    /// For each element of `corners`, true if the corner is an ear: if the triangle of the corner and its two
    /// neighbours can be cut off.
    is_ear: Vec<bool>,
    /// For each corner of the whole outline, true if the corner is convex in the part that is not yet
    /// divided.
    is_convex: Vec<bool>,
}

impl<'a> Remaining<'a> {
    fn of(flat: &'a [DVec2]) -> Self {
        let count = flat.len();
        let mut all = Self {
            flat,
            corners: (0..count).collect(),
            is_ear: vec![false; count],
            is_convex: vec![false; count],
        };
        (0..count).for_each(|at| all.is_convex[at] = all.area(at) > 0.0);
        (0..count).for_each(|at| all.is_ear[at] = all.has_ear(at));
        all
    }

    /// Returns the corner before the position `at` in `corners`, the corner at this position, and the corner
    /// after it.
    fn around(&self, at: usize) -> [usize; 3] {
        let count = self.corners.len();
        [(at + count - 1) % count, at, (at + 1) % count].map(|at| self.corners[at])
    }

    /// Returns twice the signed area of the triangle of a remaining corner and its two neighbours.
    fn area(&self, at: usize) -> f64 {
        let [a, b, c] = self.around(at).map(|corner| self.flat[corner]);
        area(a, b, c)
    }

    /// Cuts a corner off. Cutting off a corner changes only the triangles of the corner's two neighbours, so
    /// only these two corners are tested again.
    fn cut(&mut self, at: usize) {
        self.corners.remove(at);
        self.is_ear.remove(at);
        let count = self.corners.len();
        let neighbours = [(at + count - 1) % count, at % count];
        neighbours.iter().for_each(|at| self.is_convex[self.corners[*at]] = self.area(*at) > 0.0);
        neighbours.iter().for_each(|at| self.is_ear[*at] = self.has_ear(*at));
    }

    /// Returns true if a corner is an ear: if it is convex and no other corner lies in its triangle. Only
    /// corners that are not convex are tested: if a corner lies in the triangle, a corner that is not convex
    /// lies there too. Corners at the positions of the triangle's own corners are not tested. If a polygon
    /// has a hole, its outline contains a bridge, a line from the outer edge to the hole. The outline passes
    /// twice through both ends of the bridge, so several of its corners have the same position.
    fn has_ear(&self, at: usize) -> bool {
        let corners = self.around(at);
        let [a, b, c] = corners.map(|corner| self.flat[corner]);
        let may_lie_inside =
            |corner: &&usize| !self.is_convex[**corner] && ![a, b, c].contains(&self.flat[**corner]);
        self.is_convex[corners[1]]
            && self.corners.iter().filter(may_lie_inside).all(|corner| {
                let p = self.flat[*corner];
                area(a, b, p) < 0.0 || area(b, c, p) < 0.0 || area(c, a, p) < 0.0
            })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

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
        for points in [2, 3, 5, 17, 1500] {
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

    /// Returns the corners of an outline like a comb, with long teeth on a bar.
    fn comb(teeth: usize) -> Vec<DVec3> {
        let tooth = |i: usize| {
            let x = i as f64;
            [(x, 1.0), (x, 9.0), (x + 0.5, 9.0), (x + 0.5, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0))
        };
        let mut outline = vec![DVec3::ZERO];
        outline.extend((0..teeth).flat_map(tooth));
        outline.extend([DVec3::new(teeth as f64, 1.0, 0.0), DVec3::X * teeth as f64]);
        outline
    }

    /// Returns the corners of a spiral band, with `corners` corners on each of its two sides. A spiral band
    /// with 200 corners on each side winds five times around the origin.
    fn spiral(corners: usize) -> Vec<DVec3> {
        let at = |i: usize, inner: f64| {
            let (radius, angle) = (inner + 0.01 * i as f64, std::f64::consts::TAU * i as f64 / 40.0);
            DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
        };
        (0..corners).map(|i| at(i, 1.0)).chain((0..corners).rev().map(|i| at(i, 0.7))).collect()
    }

    #[test]
    fn a_corner_becomes_an_ear_after_its_neighbour_is_cut_off() {
        let teeth = 200;
        let (sum, oriented) = total_area(&comb(teeth));
        let expected = teeth as f64 * (1.0 + 0.5 * 8.0);
        assert!((sum - expected).abs() < 1e-9 && (oriented - expected).abs() < 1e-9, "{sum} {oriented}");
        let mut outline = spiral(200);
        for first in 0..outline.len() {
            let (sum, oriented) = total_area(&outline);
            assert!((sum - oriented).abs() < 1e-9, "overlap: {sum} against {oriented}, corner {first} first");
            outline.rotate_left(1);
        }
    }

    #[test]
    fn a_concave_outline_with_too_many_corners_is_refused_and_a_convex_one_is_not() {
        let circle = |count: usize| -> Vec<DVec3> {
            let corner = |i| {
                let angle = std::f64::consts::TAU * i as f64 / count as f64;
                DVec3::new(angle.cos(), angle.sin(), 0.0)
            };
            (0..count).map(corner).collect()
        };
        let mut outline = circle(MAX_CONCAVE_CORNERS + 1);
        assert_eq!(triangulate(&outline).unwrap().len(), MAX_CONCAVE_CORNERS - 1);
        outline[7] = DVec3::ZERO;
        assert_eq!(triangulate(&outline), None);
    }

    #[test]
    fn a_circle_that_only_rounding_makes_concave_is_divided_by_a_fan() {
        let circle = |count: usize| -> Vec<DVec3> {
            let corner = |i| {
                let angle = std::f64::consts::TAU * i as f64 / count as f64;
                DVec3::new(0.7 * angle.cos(), 5.0 + 0.7 * angle.sin(), 0.2 * angle.cos()).as_vec3().as_dvec3()
            };
            (0..count).map(corner).collect()
        };
        let mut outline = circle(40_000);
        assert!(!is_convex(&flatten(&outline)) && outline.len() > MAX_CONCAVE_CORNERS);
        let (sum, oriented) = total_area(&outline);
        assert!((sum - oriented).abs() < 1e-5, "overlap: {sum} against {oriented}");
        // One corner of the circle is moved inwards, farther than rounding could move it. `triangulate`
        // refuses the changed outline, also after the outline is moved far from the origin.
        outline[100].x -= 0.3;
        assert_eq!(triangulate(&outline), None);
        outline.iter_mut().for_each(|corner| corner.y += 1e7);
        assert_eq!(triangulate(&outline), None);
        // In a fan from the first corner of this quadrilateral, the first triangle would be reversed, so
        // `triangulate` must not divide the quadrilateral into a fan.
        let quad = [(0.0, 0.0), (1.0, 1e-7), (2.0, 0.0), (1.0, 2.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
        assert_eq!(triangulate(&quad).map(|triangles| triangles.contains(&[0, 1, 2])), Some(false));
    }

    /// The first triangle of a fan over this outline is reversed. Twice the area of this triangle is twice
    /// the height of the outline's second corner. The outline's largest coordinate is 2, so the seam (see
    /// [`has_sound_fan`]) has a width of 4.768e-7. The three sides of the outline along which the seam runs
    /// have a length of 4.236 together.
    #[test]
    fn reversed_triangles_of_a_fan_are_at_most_as_large_as_a_seam_along_its_outline() {
        let outline = |height: f64| [(0.0, 0.0), (1.0, height), (2.0, 0.0), (1.0, 2.0)].map(DVec2::from);
        assert_eq!([0.9e-6, 1.1e-6].map(|height| has_sound_fan(&outline(height))), [true, false]);
    }

    #[test]
    fn two_holes_stay_open() {
        let vertices = [
            (0, 0),
            (12, 0),
            (12, 12),
            (0, 12),
            (8, 10),
            (9, 10),
            (9, 1),
            (8, 1),
            (2, 4),
            (2, 7),
            (5, 7),
            (5, 4),
        ];
        let face = [1, 2, 3, 5, 6, 7, 8, 5, 3, 4, 9, 10, 11, 12, 9, 4];
        let corner =
            |number: usize| DVec3::new(vertices[number - 1].0.into(), vertices[number - 1].1.into(), 0.0);
        assert_eq!(total_area(&face.map(corner)), (126.0, 126.0));
    }

    /// Returns a polygon around a point, counter-clockwise, with corners at random distances of up to
    /// `radius`.
    fn blob(random: &mut ChaCha8Rng, centre: DVec2, radius: f64, corners: usize) -> Vec<DVec2> {
        let corner = |i: usize| {
            let turns = (i as f64 + random.random_range(0.0..0.9)) / corners as f64;
            let direction = DVec2::from_angle(std::f64::consts::TAU * turns);
            centre + direction * radius * random.random_range(0.3..1.0)
        };
        (0..corners).map(corner).collect()
    }

    /// Two sides of an outline meet at the corner `at`. Returns true if the point `p` lies in the angle
    /// between the two sides, on their left. This angle may be larger than 180 degrees. If an outline has a
    /// bridge (a line from the outer edge to a hole), several of its corners have the same position. Of
    /// several corners with the same position, at most one is a corner for which the function returns true.
    fn faces(outline: &[DVec2], at: usize, p: DVec2) -> bool {
        let count = outline.len();
        let [a, b, c] = [at + count - 1, at, at + 1].map(|at| outline[at % count]);
        let (before, after) = (area(a, b, p) > 0.0, area(b, c, p) > 0.0);
        if area(a, b, c) > 0.0 { before && after } else { before || after }
    }

    /// Returns true if the line from p to q crosses no side of the outlines.
    fn sees(outlines: &[Vec<DVec2>], p: DVec2, q: DVec2) -> bool {
        // If the side from a to b ends at p or q, one of the areas below is 0, so the line from p to q does
        // not cross the side.
        let crosses =
            |a: DVec2, b: DVec2| area(p, q, a) * area(p, q, b) < 0.0 && area(a, b, p) * area(a, b, q) < 0.0;
        let mut sides =
            outlines.iter().flat_map(|outline| outline.iter().zip(outline.iter().cycle().skip(1)));
        sides.all(|(a, b)| !crosses(*a, *b))
    }

    /// Joins the last outline, a hole, to the first by a bridge between two random corners that see each
    /// other.
    fn bridge(random: &mut ChaCha8Rng, outlines: &mut Vec<Vec<DVec2>>) {
        loop {
            let (outline, hole) = (&outlines[0], &outlines[outlines.len() - 1]);
            let [i, j] = [outline, hole].map(|list| random.random_range(0..list.len()));
            let (p, q) = (outline[i], hole[j]);
            if faces(outline, i, q) && faces(hole, j, p) && sees(outlines, p, q) {
                let around = hole[j..].iter().chain(&hole[..=j]);
                let joined = outline[..=i].iter().chain(around).chain(&outline[i..]).copied().collect();
                outlines.pop();
                outlines[0] = joined;
                return;
            }
        }
    }

    #[test]
    fn outlines_of_one_to_three_holes_are_covered_once_without_their_holes() {
        let signed = |list: &[DVec2]| {
            (1..list.len() - 1).map(|i| area(list[0], list[i], list[i + 1])).sum::<f64>() / 2.0
        };
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for case in 0..300 {
            let holes = 1 + case % 3;
            let mut outlines = vec![blob(&mut random, DVec2::ZERO, 100.0, 12)];
            // The outer outline stays at least 26 units away from its centre, and the holes stay within 16
            // units of this centre.
            for hole in 0..holes {
                let centre = DVec2::from_angle(std::f64::consts::TAU * hole as f64 / 3.0) * 9.0;
                let corners = random.random_range(5..9);
                let mut hole = blob(&mut random, centre, 7.0, corners);
                hole.reverse();
                outlines.push(hole);
            }
            let expected: f64 = outlines.iter().map(|outline| signed(outline)).sum();
            while outlines.len() > 1 {
                bridge(&mut random, &mut outlines);
            }
            let outline: Vec<DVec3> = outlines[0].iter().map(|p| p.extend(0.0)).collect();
            let (sum, oriented) = total_area(&outline);
            assert!(
                (sum - expected).abs() < 1e-6 && (oriented - expected).abs() < 1e-6,
                "{case}: {sum} {oriented}"
            );
        }
    }

    /// Returns the area of an outline's triangles.
    fn covered(outline: &[DVec3]) -> f64 {
        let area = |[a, b, c]: [usize; 3]| (outline[b] - outline[a]).cross(outline[c] - outline[a]).length();
        triangulate(outline).unwrap().into_iter().map(area).sum::<f64>() / 2.0
    }

    /// The outline has the shape of an L. Each of its corners in turn is given three times.
    #[test]
    fn a_repeated_corner_does_not_fill_a_notch() {
        let l = [(2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 0)];
        let l = l.map(|(x, y)| DVec3::new(x.into(), y.into(), 0.0));
        for repeated in 0..l.len() {
            let outline: Vec<_> = [&l[..repeated], &[l[repeated]; 2], &l[repeated..]].concat();
            assert_eq!(covered(&outline), 3.0, "corner {repeated}");
            assert_eq!(triangulate(&outline).unwrap().len(), 4, "corner {repeated}");
        }
    }

    /// Several corners of this outline lie on a line, apart from the rounding errors of double precision.
    #[test]
    fn a_notch_stays_open_if_corners_in_double_precision_lie_on_a_line() {
        let mut outline = [
            (2.6085161983357295, 1.4817703071056976),
            (-1.8367947229813635, 9.307318902112886),
            (-2.7063001224266063, 8.813395466410988),
            (-1.7184532510228079, 7.0743846675205),
            (-2.587958650468051, 6.580461231818601),
            (-0.6122649076604544, 3.1024396340376286),
            (-1.4817703071056976, 2.6085161983357295),
            (0.0, 0.0),
        ]
        .map(|(x, y)| DVec3::new(x, y, 0.0));
        for first in 0..outline.len() {
            let sum = covered(&outline);
            assert!((sum - 19.0).abs() < 1e-4, "{sum}, corner {first} first");
            outline.rotate_left(1);
        }
    }

    #[test]
    fn degenerate_outlines_give_triangles_too() {
        assert_eq!(triangulate(&[DVec3::ONE; 5]).unwrap().len(), 3);
    }
}
