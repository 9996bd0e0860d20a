//! The surfaces of area lights: rectangles and discs.

use glam::Vec3;
use schemars::JsonSchema;

/// The smallest sine of the angle between the edges of an area light.
pub(super) const LEAST_SINE: f64 = 1e-6;

/// The shape of an area light [default: rectangle].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AreaShape {
    /// A rectangle with the light's two edges; a parallelogram if these edges are not perpendicular.
    #[default]
    Rectangle = 1,
    /// The disc that touches the four sides of the rectangle with the light's two edges; an ellipse if these
    /// edges differ in length or are not perpendicular.
    Disc = 2,
}

/// The surface of an area light, with its centre at the light's position. The front of the surface has the
/// same radiance in all directions (it is a Lambertian emitter), and the back is dark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Whether the surface is a rectangle or a disc.
    pub shape: AreaShape,
    /// Two edges of the rectangle (for a disc: of the rectangle around it), in the scene's units. The light's
    /// front is the side to which the cross product of the two edges points.
    pub edges: [Vec3; 2],
}

impl Area {
    /// Returns the unit normal of the light's front. Devices and the reference use the returned vector, which
    /// is rounded to single precision.
    pub fn front(&self) -> Vec3 {
        let [first, second] = self.edges.map(|edge| edge.as_dvec3().normalize_or_zero());
        first.cross(second).normalize_or_zero().as_vec3()
    }

    /// Returns half of the rectangle's longer diagonal: the largest distance of a point of the rectangle from
    /// the rectangle's centre.
    pub fn reach(&self) -> f32 {
        let [first, second] = self.edges;
        (first + second).length().max((first - second).length()) / 2.0
    }

    /// Returns the sine of the angle between the edges; 0 if an edge is zero.
    pub(super) fn sine(&self) -> f64 {
        let [first, second] = self.edges.map(|edge| edge.as_dvec3().normalize_or_zero());
        first.cross(second).length()
    }

    /// Returns a copy of this surface in which each edge is replaced by the vector that `turn` returns for
    /// it.
    #[must_use]
    pub(super) fn turned(&self, turn: impl Fn(Vec3) -> Vec3) -> Self {
        Self { edges: self.edges.map(turn), ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_where_the_cross_product_points_however_long_the_edges_are() {
        let of = |first, second| Area { shape: AreaShape::Rectangle, edges: [first, second] };
        for [a, b] in [[2.0, 3.0], [1e12, 1e-12], [1e-30, 1e12]] {
            assert_eq!(of(a * Vec3::X, b * Vec3::Y).front(), Vec3::Z, "{a:e} {b:e}");
            assert_eq!(of(b * Vec3::Y, a * Vec3::X).front(), Vec3::NEG_Z, "{a:e} {b:e}");
        }
        // If the edges are not perpendicular, the front still has the direction of their cross product.
        assert_eq!(of(Vec3::X, Vec3::new(5.0, 1.0, 0.0)).front(), Vec3::Z);
    }

    #[test]
    fn the_farthest_point_is_a_corner() {
        let area = Area { shape: AreaShape::Rectangle, edges: [4.0 * Vec3::X, 3.0 * Vec3::Y] };
        assert_eq!(area.reach(), 2.5);
        let slanted = Area { edges: [Vec3::X, Vec3::new(-3.0, 3.0, 0.0)], ..area };
        assert_eq!(slanted.reach(), 2.5);
        assert!((slanted.sine() - 0.5_f64.sqrt()).abs() < 1e-9);
    }
}
