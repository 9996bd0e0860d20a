//! Moves a mesh that is far from the origin, such as a map, to the origin, since single precision could not
//! distinguish many of its points. Scales a mesh of extreme size, since products of its lengths would
//! underflow or overflow single precision.

use super::flaw::Flaw;
use crate::scene::Camera;
use crate::scene::mesh::{Triangle, are_apart};
use crate::scene::validate::MAX_COORDINATE;
use crate::words::counted_of_are;
use glam::{DVec3, Vec3};
use std::borrow::Cow;

/// The largest valid coordinate of a mesh that may be scaled. The distance between two points within this
/// limit is finite in double precision.
pub(in crate::scene) const LARGEST: f64 = 1e300;
/// A mesh counts as far from the origin if its centre is more than `FAR_RADII` of its radii away from the origin. At
/// this distance, coordinates in single precision are 16 times as coarse as they would be at a distance of one radius.
const FAR_RADII: f64 = 16.0;
/// A mesh with a smaller radius than `SMALLEST_RADIUS` is scaled, because products of its lengths could underflow. A
/// ray-triangle test multiplies up to four lengths. If the edges of a mesh have a thousandth of the length
/// `SMALLEST_RADIUS`, the product of four edges is 1e-36. The smallest normal number of single precision is 1.2e-38.
const SMALLEST_RADIUS: f64 = 1e-6;
/// A mesh with a larger radius than `LARGEST_RADIUS` is scaled. raycl adds lights at a distance of ten radii from the
/// mesh, and a ground whose edges are 60 radii away. The coordinates of these lights and edges must be within +-1e12.
const LARGEST_RADIUS: f64 = 1e9;

/// A triangle is inexact if the rounding of its corners to single precision changes one of its sides by more than the
/// fraction `INEXACT` of its longest side.
const INEXACT: f64 = 1.0 / 64.0;
/// A triangle can be inexact only if its longest side is shorter than `FEW_STEPS` steps. A step is the distance between
/// neighbouring numbers of single precision. Rounding changes each coordinate of a side by at most one step.
const FEW_STEPS: f32 = 128.0;
/// If a file stores positions in single precision, triangles whose sides are at most `COARSE_STEPS` steps long are
/// probably inexact.
const COARSE_STEPS: f32 = 16.0;
/// Largest number of triangles in the sample that decides whether all triangles of a mesh are examined. Examining all
/// triangles takes time.
const SAMPLE: usize = 1024;

/// Which coordinates of a mesh file are valid.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Limit {
    /// Coordinates within +-`MAX_COORDINATE`.
    Usual,
    /// Coordinates within +-[`LARGEST`], since the mesh may be scaled.
    Large,
}

impl Limit {
    /// Returns the limit for a mesh, depending on whether it may be scaled.
    pub fn of(scaled: bool) -> Self {
        if scaled { Self::Large } else { Self::Usual }
    }

    /// Returns true if a position is finite and within this limit.
    pub fn has(self, position: &DVec3) -> bool {
        match self {
            Self::Usual => is_valid(position),
            Self::Large => position.is_finite() && position.abs().max_element() <= LARGEST,
        }
    }

    /// Returns the largest valid coordinate, for messages.
    pub fn shown(self) -> String {
        match self {
            Self::Usual => format!("{MAX_COORDINATE:e}"),
            Self::Large => format!("{LARGEST:e}"),
        }
    }

    /// Returns the mistake, as a [`Flaw`], that a file with an invalid position has. `vertex` names the vertex at this
    /// position as the file's author knows it.
    pub fn invalid(self, vertex: &str, position: &DVec3) -> Flaw {
        let expected = format!("expected finite coordinates within +-{}", self.shown());
        let [x, y, z] = position.to_array().map(coordinate);
        Flaw::quoting(
            format!("{vertex} is at [{x}, {y}, {z}]; {expected}"),
            format!("{vertex} is not valid; {expected}"),
        )
    }

    /// Returns an error if a triangle has a position that is not valid.
    fn check(self, positions: &[DVec3], triangles: &[Triangle]) -> Result<(), Flaw> {
        let mut used = triangles.iter().flat_map(|triangle| triangle.positions).map(|corner| corner as usize);
        let Some(vertex) = used.find(|&vertex| !self.has(&positions[vertex])) else { return Ok(()) };
        Err(self.invalid(&format!("vertex {vertex}"), &positions[vertex]))
    }
}

/// Writes a coordinate. Without an exponent, the smallest and the largest numbers would have hundreds of digits.
fn coordinate(value: f64) -> String {
    let is_usual = value == 0.0 || (1e-6..1e15).contains(&value.abs());
    if is_usual { value.to_string() } else { format!("{value:e}") }
}

/// How a mesh is moved and scaled before its positions are rounded to single precision: a vector is
/// subtracted from each position, and the result is multiplied by a power of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::scene) struct Placement {
    /// The vector that is subtracted from each position; zero unless the mesh lies far from the file's
    /// origin.
    pub origin: DVec3,
    /// The power of two by which each position is multiplied; 1 unless the mesh is extremely small or large.
    pub scale: f64,
}

impl Default for Placement {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Placement {
    /// The placement that changes nothing.
    pub const IDENTITY: Self = Self { origin: DVec3::ZERO, scale: 1.0 };

    /// Returns the placement for a mesh with these bounds.
    pub fn of(low: DVec3, high: DVec3) -> Self {
        let (centre, radius) = ((low + high) / 2.0, length(high - low) / 2.0);
        Self { origin: origin_of(centre, radius), scale: scale_of(radius) }
    }

    /// Returns the identity if the bounds, although they are rounded to single precision, show that the mesh is neither
    /// far away nor of extreme size. Otherwise returns `None`: the placement must then be computed from the bounds in
    /// double precision.
    pub fn of_rounded(low: Vec3, high: Vec3) -> Option<Self> {
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        let radius = length(high - low) / 2.0;
        let is_usual =
            radius >= SMALLEST_RADIUS && radius.is_finite() && Self::of(low, high) == Self::IDENTITY;
        is_usual.then_some(Self::IDENTITY)
    }

    /// Converts a position from the file's coordinates to the mesh's coordinates.
    pub fn apply(&self, position: DVec3) -> DVec3 {
        (position - self.origin) * self.scale
    }

    /// Converts a position of the mesh from the file's coordinates to the mesh's coordinates, in single
    /// precision. After the conversion, a position that no visible triangle uses may be beyond `MAX_COORDINATE`; it
    /// is then moved to this limit.
    pub fn settled(&self, position: DVec3) -> Vec3 {
        let most = DVec3::splat(MAX_COORDINATE.into());
        self.apply(position).clamp(-most, most).as_vec3()
    }

    /// Converts a camera from the file's coordinates to the mesh's coordinates. `position` is the camera's
    /// position in the file, and replaces `camera.position`.
    pub fn camera(&self, position: DVec3, camera: &Camera) -> Camera {
        let z_near = (f64::from(camera.z_near) * self.scale) as f32;
        Camera { position: self.apply(position).as_vec3(), z_near, ..*camera }
    }

    /// Returns notes that tell the user how the mesh was moved and scaled; no notes if it was neither moved nor scaled.
    /// The notes are for a bare mesh: if a scene has several meshes or a scene file, raycl undoes the scaling.
    pub fn notes(&self) -> Vec<String> {
        let [x, y, z] = self.origin.to_array().map(coordinate);
        let moved = || {
            format!("the mesh lies far from its origin, so ({x}, {y}, {z}) was subtracted from its positions")
        };
        let scaled = || {
            let (scale, extreme) = (self.scale, if self.scale > 1.0 { "small" } else { "large" });
            format!(
                "the mesh is too {extreme} for single precision, so its positions were multiplied by 2^{} ({scale:.1e}); \
                 camera.position, the layer `depth` and other lengths refer to the scaled mesh",
                scale.log2()
            )
        };
        let moved = (self.origin != DVec3::ZERO).then(moved);
        moved.into_iter().chain((self.scale != 1.0).then(scaled)).collect()
    }
}

/// Returns the vector to be subtracted from the positions of a mesh with this centre and radius. If the
/// centre is far from the origin, the returned vector is the centre; if the radius is also above 1, the
/// vector is rounded to whole numbers. If the centre is not far from the origin, the returned vector is zero.
fn origin_of(centre: DVec3, radius: f64) -> DVec3 {
    let far = centre.is_finite() && length(centre) > FAR_RADII * radius;
    // The centre of a small mesh is not rounded, because the nearest point with whole coordinates may lie
    // outside the mesh.
    let rounded = if radius > 1.0 { centre.round() } else { centre };
    if far { rounded } else { DVec3::ZERO }
}

/// Returns the power of two by which a mesh with this radius is multiplied. If the radius is extreme (not
/// from `SMALLEST_RADIUS` to `LARGEST_RADIUS`), the product of the radius and the power of two is at least 1
/// and less than 2. If the radius is not extreme, the power of two is 1. The power of two is also 1 for the
/// radius 0 of a point, and for a radius below the smallest normal number of double precision.
fn scale_of(radius: f64) -> f64 {
    if !radius.is_normal() || (SMALLEST_RADIUS..=LARGEST_RADIUS).contains(&radius) {
        return 1.0;
    }
    2_f64.powi(-radius.log2().floor() as i32)
}

/// Returns the length of a vector, even if the squares of the vector's components underflow or overflow.
fn length(vector: DVec3) -> f64 {
    let largest = vector.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (vector / largest).length() * largest } else { largest }
}

/// Returns positions in single precision, and their placement (how they were moved and scaled). If there are triangles,
/// the placement depends only on positions that triangles use. Triangles with two corners at the same position, which
/// no ray hits, do not count if there are others. Positions that no triangle uses need not be finite:
/// scanners write NaN or zeros for points that they did not measure. Returns an error if a triangle uses a position
/// that is not valid.
pub(super) fn settle(
    positions: &[DVec3],
    triangles: &[Triangle],
    limit: Limit,
) -> Result<(Vec<Vec3>, Placement), Flaw> {
    settle_if(positions, triangles, limit, |_| true)
}

/// Does the same as [`settle`], but scales the mesh only if `fits` returns true for the placement. If it returns false,
/// the positions of triangles must be within the usual limit.
pub(super) fn settle_if(
    positions: &[DVec3],
    triangles: &[Triangle],
    limit: Limit,
    fits: impl Fn(&Placement) -> bool,
) -> Result<(Vec<Vec3>, Placement), Flaw> {
    if !positions.iter().all(|position| limit.has(position)) {
        limit.check(positions, triangles)?;
    }
    let corners = |triangle: &Triangle| triangle.positions.map(|corner| &positions[corner as usize]);
    let is_visible = |triangle: &&Triangle| are_apart(&corners(triangle));
    let wanted = if triangles.iter().any(|triangle| is_visible(&triangle)) {
        placement_of(triangles.iter().filter(is_visible).flat_map(corners))
    } else if triangles.is_empty() {
        placement_of(positions.iter())
    } else {
        placement_of(triangles.iter().flat_map(corners))
    };
    let placement = match fits(&wanted) {
        true => wanted,
        false => {
            Limit::Usual.check(positions, triangles)?;
            Placement { scale: 1.0, ..wanted }
        }
    };
    // A position that is not valid, and that no triangle uses, is replaced by a position that does not
    // enlarge the mesh.
    let instead = positions.iter().copied().find(|position| limit.has(position)).unwrap_or(placement.origin);
    let settled = |position: &DVec3| placement.settled(if limit.has(position) { *position } else { instead });
    Ok((positions.iter().map(settled).collect(), placement))
}

/// Returns the number of inexact `triangles` if more than a tenth of all are inexact; otherwise `None`. A triangle is
/// inexact if the rounding of its corners to single precision changes one of its sides by more than the part
/// [`INEXACT`] of its longest side. `settled` has the positions after they were moved, multiplied by `scale` and
/// rounded. `exact` returns the positions in the file, and is called only if a sample of the triangles shows that many
/// triangles could be inexact.
pub(in crate::scene) fn inexact<'a>(
    triangles: &[Triangle],
    settled: &[Vec3],
    scale: f64,
    exact: impl FnOnce() -> Cow<'a, [DVec3]>,
) -> Option<usize> {
    let settled = |index: u32| settled[index as usize];
    if !may_be_inexact(triangles, settled) {
        return None;
    }
    let exact = exact();
    count_inexact(triangles, |index| exact[index as usize] * scale, settled)
}

/// Returns the number of `triangles` that rounding makes inexact, as [`inexact`] does. `exact` returns a position, by
/// its index, before it is rounded.
fn inexact_when_rounded(triangles: &[Triangle], exact: impl Fn(u32) -> DVec3) -> Option<usize> {
    let rounded = |index| exact(index).as_vec3();
    if may_be_inexact(triangles, rounded) { count_inexact(triangles, &exact, rounded) } else { None }
}

fn count_inexact(
    triangles: &[Triangle],
    exact: impl Fn(u32) -> DVec3,
    rounded: impl Fn(u32) -> Vec3,
) -> Option<usize> {
    let is_inexact = |triangle: &&Triangle| {
        let exact = triangle.positions.map(&exact);
        let rounded = triangle.positions.map(|index| rounded(index).as_dvec3());
        let sides = [(0, 1), (1, 2), (2, 0)].map(|(from, to)| {
            let side = exact[to] - exact[from];
            (side.length_squared(), (rounded[to] - rounded[from] - side).length_squared())
        });
        let [longest, change] = sides
            .into_iter()
            .fold([0.0_f64; 2], |[longest, most], (side, change)| [longest.max(side), most.max(change)]);
        change > INEXACT * INEXACT * longest
    };
    let count = triangles.iter().filter(is_inexact).count();
    (10 * count > triangles.len()).then_some(count)
}

/// Examines a sample of the triangles. Returns true if at least a twentieth of the sample's triangles are so small that
/// they could be inexact.
fn may_be_inexact(triangles: &[Triangle], settled: impl Fn(u32) -> Vec3) -> bool {
    let is_small = |triangle: &&Triangle| is_small(triangle.positions.map(&settled), FEW_STEPS);
    20 * sample(triangles).filter(is_small).count() >= sample(triangles).count().max(1)
}

fn sample<T>(triangles: &[T]) -> impl Iterator<Item = &T> {
    triangles.iter().step_by(triangles.len().div_ceil(SAMPLE).max(1))
}

/// Returns true if no coordinate of a triangle's sides is longer than about `steps` steps. A step is the distance
/// between neighbouring numbers of single precision near the triangle's largest coordinate.
fn is_small([a, b, c]: [Vec3; 3], steps: f32) -> bool {
    let sides = [b - a, c - b, a - c].map(|side| side.abs().max_element());
    let farthest = a.abs().max(b.abs()).max(c.abs()).max_element();
    sides.into_iter().fold(0.0, f32::max) <= steps * f32::EPSILON * farthest
}

/// Examines a file that stores positions in single precision. Returns true if the sides of most triangles are only a
/// few steps of single precision long: the program that wrote the file has then probably rounded the corners. If the
/// largest coordinates of nearly all triangles have the same last bit, as in a grid of whole numbers, or of whole
/// numbers plus one half, the program has probably not rounded the corners, and the function returns false.
pub(super) fn are_coarse<T>(triangles: &[T], corners: impl Fn(&T) -> [Vec3; 3]) -> bool {
    let last_bit = |corner: Vec3| corner.abs().max_element().to_bits() & 1;
    let visible = || sample(triangles).map(&corners).filter(are_apart);
    let have_most = |bit: u32| {
        let is_coarse = |corners: &[Vec3; 3]| {
            is_small(*corners, COARSE_STEPS) && corners.iter().any(|corner| last_bit(*corner) == bit)
        };
        2 * visible().filter(is_coarse).count() > visible().count()
    };
    have_most(0) && have_most(1)
}

/// Returns a note on a file that stores positions in single precision, if these are coarse (see [`are_coarse`]).
pub(super) fn note_coarse(triangles: &[Triangle], exact: &[DVec3]) -> Option<String> {
    let corners = |triangle: &Triangle| triangle.positions.map(|index| exact[index as usize].as_vec3());
    are_coarse(triangles, corners).then(|| {
        "the file stores positions in single precision, which is coarse for such large coordinates: the shapes of \
         most triangles may be inexact"
            .to_owned()
    })
}

/// Returns a note on a mesh of which many triangles are inexact (see [`inexact`]).
pub(in crate::scene) fn note_inexact<'a>(
    triangles: &[Triangle],
    settled: &[Vec3],
    scale: f64,
    exact: impl FnOnce() -> Cow<'a, [DVec3]>,
) -> Option<String> {
    inexact(triangles, settled, scale, exact).map(|count| inexact_shapes(count, triangles))
}

/// Returns a note on a mesh of which many triangles become inexact if the positions that `exact` returns are rounded
/// (see [`inexact`]).
pub(in crate::scene) fn note_rounded(triangles: &[Triangle], exact: impl Fn(u32) -> DVec3) -> Option<String> {
    inexact_when_rounded(triangles, exact).map(|count| inexact_shapes(count, triangles))
}

fn inexact_shapes(count: usize, triangles: &[Triangle]) -> String {
    let are = counted_of_are(count, triangles.len(), "triangle");
    format!(
        "{are} shown with inexact shapes: at their distance from the origin, they are too small for single precision"
    )
}

/// Returns the placement (how positions are moved and scaled) for a mesh, or for the outline of a polygon,
/// with these positions. Positions that are not valid for any mesh are ignored.
pub(in crate::scene) fn placement_of<'a>(positions: impl Iterator<Item = &'a DVec3>) -> Placement {
    let valid = positions.filter(|position| Limit::Large.has(position));
    let (low, high) = valid.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), position| {
        (low.min(*position), high.max(*position))
    });
    Placement::of(low, high)
}

/// Returns true if a position is finite and within +-`MAX_COORDINATE`.
pub(in crate::scene) fn is_valid(position: &DVec3) -> bool {
    // The position is rounded to single precision before the comparison, since the limit of 1e12 is slightly
    // smaller in single precision.
    position.is_finite() && position.as_vec3().abs().max_element() <= MAX_COORDINATE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_settled_with_its_centimetres_and_a_mesh_nearby_keeps_its_bits() {
        let utm = DVec3::new(500_000.0, 5_400_000.0, 200.0);
        let corners = [utm, utm + DVec3::new(0.01, 0.0, 0.0), utm + DVec3::new(100.0, 80.0, 5.0)];
        let (positions, placement) = settle(&corners, &[], Limit::Usual).expect("finite positions");
        assert_eq!(placement.scale, 1.0);
        assert_eq!(placement.origin, (utm + DVec3::new(50.0, 40.0, 2.5)).round());
        assert!((positions[1].x - positions[0].x - 0.01).abs() < 1e-5);
        let near = [DVec3::new(0.1, 5.0, 0.0), DVec3::new(1.0, 6.0, 0.0)];
        let (positions, placement) = settle(&near, &[], Limit::Usual).expect("finite positions");
        assert_eq!((positions[0], placement), (Vec3::new(0.1, 5.0, 0.0), Placement::IDENTITY));
    }

    #[test]
    fn a_mesh_more_than_16_radii_away_is_far_from_its_origin() {
        // A cube of two units has a radius of 1.73, and 16 radii are 27.7.
        let origin = |x: f64| Placement::of(DVec3::X * x - 1.0, DVec3::X * x + 1.0).origin;
        assert_eq!([8.0, 27.0, 28.0, 30.0].map(origin), [0.0, 0.0, 28.0, 30.0].map(|x| DVec3::X * x));
    }

    #[test]
    fn a_position_that_no_triangle_uses_does_not_decide_the_placement() {
        let triangle = |positions| Triangle { positions, normals: [0; 3], material: 0 };
        let utm = DVec3::new(500_000.0, 5_400_000.0, 200.0);
        let map = [DVec3::ZERO, utm, utm + DVec3::X * 0.01, utm + DVec3::new(100.0, 80.0, 5.0)];
        let (positions, placement) =
            settle(&map, &[triangle([1, 2, 3])], Limit::Usual).expect("valid positions");
        assert_eq!(placement.origin, (utm + DVec3::new(50.0, 40.0, 2.5)).round());
        assert!((positions[2].x - positions[1].x - 0.01).abs() < 1e-5, "{positions:?}");
        // The last position, which no triangle uses, stays within the limit of coordinates, even if the mesh
        // is enlarged.
        for (edge, scale) in [(1.0, 1.0), (2e-9, 2_f64.powi(30))] {
            let corners = [DVec3::ZERO, DVec3::X * edge, DVec3::Y * edge, DVec3::X * 1e11];
            let (positions, placement) =
                settle(&corners, &[triangle([0, 1, 2])], Limit::Usual).expect("valid positions");
            assert_eq!((placement.origin, placement.scale), (DVec3::ZERO, scale), "{edge:e}");
            assert!(positions[3].x >= 1e11 && positions[3].x <= MAX_COORDINATE, "{edge:e}: {positions:?}");
        }
    }

    #[test]
    fn a_triangle_that_no_ray_hits_does_not_decide_the_placement_beside_others() {
        let triangle = |positions| Triangle { positions, normals: [0; 3], material: 0 };
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X * 1e11];
        let placement = |triangles: &[[u32; 3]]| {
            let triangles: Vec<_> = triangles.iter().copied().map(triangle).collect();
            settle(&corners, &triangles, Limit::Usual).expect("valid positions").1
        };
        for collapsed in [[3, 3, 3], [3, 3, 0], [0, 3, 3], [3, 0, 3]] {
            assert_eq!(placement(&[collapsed, [0, 1, 2]]), Placement::IDENTITY, "{collapsed:?}");
            assert_ne!(placement(&[collapsed]), Placement::IDENTITY, "{collapsed:?}");
        }
    }

    #[test]
    fn a_mesh_of_extreme_size_is_scaled_by_a_power_of_two_and_a_point_is_not() {
        let placed = |at: DVec3, edge: f64| {
            let corners = [at, at + DVec3::X * edge, at + DVec3::Y * edge];
            let (positions, placement) = settle(&corners, &[], Limit::Usual).expect("valid positions");
            ((positions[1] - positions[0]).as_dvec3(), placement)
        };
        for edge in [1e-300, 1e-46, 1e-30, 1e-20, 1e-10, 1e-7, 5e11, 1e12] {
            let (side, placement) = placed(DVec3::ZERO, edge);
            let radius = side.x * std::f64::consts::FRAC_1_SQRT_2;
            assert!((0.999..2.001).contains(&radius), "{edge:e}: {radius}");
            assert!(((edge * placement.scale) / side.x - 1.0).abs() < 1e-7, "{edge:e}");
            assert_eq!(placement.scale.to_bits() << 12, 0, "{edge:e}: not a power of two");
        }
        for edge in [0.0, 5e-324, 2e-6, 1.0, 1e9] {
            assert_eq!(placed(DVec3::ZERO, edge).1.scale, 1.0, "{edge:e}");
        }
        // This mesh is moved and scaled, since single precision could not distinguish its corners near (1, 1,
        // 1).
        let (side, placement) = placed(DVec3::ONE, 1e-10);
        assert!((side.x - 1e-10 * placement.scale).abs() < 1e-5 * side.x && side.x > 1.0, "{side}");
        assert!(placement.origin.distance(DVec3::ONE) < 1e-9);
        let notes = placement.notes();
        assert!(
            notes[0].contains("subtracted")
                && placed(DVec3::X * 1e-200, 0.0).1.notes()[0].contains("(1e-200, 0, 0)")
        );
        assert!(notes[1].contains("by 2^34 (1.7e10)"), "{notes:?}");
    }

    /// The sides of the triangles are at most 6 units long. Single precision stores whole numbers exactly up to 2^24,
    /// and multiples of 0.5 from 2^22 to 2^23.
    #[test]
    fn a_file_of_single_precision_is_coarse_if_its_triangles_are_small_and_rounded() {
        let is_coarse = |x: f64, step: f64, count: u32| {
            let rounded = |value: f64| f64::from(value as f32);
            let corner = |number: u32| {
                DVec3::new(rounded(x + step * f64::from(number)), step * f64::from(number % 2), 0.0)
            };
            let positions: Vec<_> = (0..3 * count).map(corner).collect();
            let triangle =
                |at: u32| Triangle { positions: [at, at + 1, at + 2], normals: [0; 3], material: 0 };
            let triangles: Vec<_> = (0..count).map(|number| triangle(3 * number)).collect();
            note_coarse(&triangles, &positions).is_some()
        };
        assert_eq!([1e3, 1e6, 5_400_000.0].map(|x| is_coarse(x, 2.7, 9)), [false, false, true]);
        assert!(is_coarse(5_400_000.0, 2.7, 5000));
        assert!([5_400_000.0, 5_400_000.5].map(|x| is_coarse(x, 3.0, 9)) == [false; 2], "nothing is rounded");
        assert!(!is_coarse(0.0, 1.0, 0) && !is_coarse(0.1, 0.0, 9), "without visible triangles");
    }

    #[test]
    fn only_a_sample_of_the_triangles_of_a_usual_mesh_is_compared_with_the_file() {
        let triangles = |count: u32, far: u32| -> Vec<Triangle> {
            let corners = |number| if number % 20 < far { [3, 4, 5] } else { [0, 1, 2] };
            (0..count)
                .map(|number| Triangle { positions: corners(number), normals: [0; 3], material: 0 })
                .collect()
        };
        let far = DVec3::X * 5e6;
        let exact = [DVec3::ZERO, DVec3::X, DVec3::Y, far, far + DVec3::X * 0.3, far + DVec3::Y * 0.3];
        let settled = exact.map(|position| position.as_vec3());
        let count = |count: u32, far: u32| {
            let mut is_read = false;
            let exact = || {
                is_read = true;
                Cow::Borrowed(&exact[..])
            };
            (inexact(&triangles(count, far), &settled, 1.0, exact), is_read)
        };
        assert_eq!(count(0, 0), (None, false));
        assert_eq!(count(20, 0), (None, false));
        for triangles in [20, 4098] {
            assert_eq!(count(triangles, 3).0.map(|count| count > triangles as usize / 10), Some(true));
        }
        assert_eq!(count(20, 2), (None, true), "a tenth is not more than a tenth");
        assert_eq!(count(20, 3), (Some(3), true));
        // Single precision stores these positions exactly.
        let whole = exact.map(|position| position.round());
        let read = inexact(&triangles(4, 4), &whole.map(|position| position.as_vec3()), 1.0, || {
            Cow::Borrowed(&whole[..])
        });
        assert_eq!(read, None);
    }

    #[test]
    fn a_mesh_is_not_scaled_if_something_else_of_its_file_does_not_fit() {
        let corners = [DVec3::ZERO, DVec3::X * 1e-9];
        let (positions, placement) =
            settle_if(&corners, &[], Limit::Usual, |_| false).expect("valid positions");
        assert_eq!((positions[1], placement), (Vec3::X * 1e-9, Placement::IDENTITY));
    }

    #[test]
    fn what_is_not_finite_or_too_far_is_refused() {
        for x in [f64::NAN, f64::INFINITY, 1e13] {
            let positions = [DVec3::ONE, DVec3::X * x];
            let triangle = |positions| Triangle { positions, normals: [0; 3], material: 0 };
            assert!(settle(&positions, &[triangle([0, 0, 1])], Limit::Usual).is_err(), "{x}");
            let (settled, placement) =
                settle(&positions, &[triangle([0; 3])], Limit::Usual).expect("valid positions");
            assert_eq!(
                settled.iter().map(|p| p.as_dvec3() + placement.origin).collect::<Vec<_>>(),
                [DVec3::ONE; 2],
                "{x}"
            );
        }
    }
}
