//! Axis-aligned boxes. The box and the number of a triangle together take 32 bytes.

use glam::{Vec3, Vec4};

/// An axis-aligned box. The vector of a corner has four lanes, so that it fills one register. The coordinates
/// of a corner take only three of its four lanes. In a [`Primitive`], the fourth lane of `low` holds the
/// triangle's number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// The corner with the smallest coordinates.
    pub low: Vec4,
    /// The corner with the largest coordinates.
    pub high: Vec4,
}

impl Bounds {
    /// The empty box. The union of the empty box and any other box equals that other box.
    pub const EMPTY: Self = Self { low: Vec4::INFINITY, high: Vec4::NEG_INFINITY };

    /// Returns the box that contains a single point.
    pub fn point(point: Vec4) -> Self {
        Self { low: point, high: point }
    }

    /// Returns the smallest box that contains both `self` and `other`.
    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Returns the intersection of the boxes `self` and `other`. If `self` and `other` do not overlap, the result's
    /// `low` is larger than its `high` in at least one coordinate.
    pub fn intersection(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    /// Returns half the box's surface area; infinity for the empty box.
    #[inline(always)]
    pub fn half_area(self) -> f32 {
        let e = self.high - self.low;
        e.x * (e.y + e.z) + e.y * e.z
    }
}

/// A triangle's box and number. The triangle's number is stored in `low.w` as the bits of a normal float: arithmetic on
/// the vector register of `low` includes the lane `w`, and would be slow if this lane held a denormal float.
#[derive(Clone, Copy, Debug)]
pub(super) struct Primitive(pub Bounds);

/// The bits of 1.0. The bits of 1.0 plus a triangle's number are the bits of a normal float.
const NUMBER_BASE: u32 = 0x3f80_0000;

impl Primitive {
    /// Makes the primitive of the triangle with the given corners and the number `triangle`.
    #[inline(always)]
    pub fn new(corners: [Vec3; 3], triangle: u32) -> Self {
        let [a, b, c] = corners;
        let low = a.min(b).min(c).extend(f32::from_bits(NUMBER_BASE + triangle));
        Self(Bounds { low, high: a.max(b).max(c).extend(1.0) })
    }

    /// Returns the triangle's number in the mesh.
    #[inline(always)]
    pub fn triangle(self) -> u32 {
        self.0.low.w.to_bits() - NUMBER_BASE
    }

    /// Returns the doubled centre of the box; computing the centre itself would need one more multiplication.
    #[inline(always)]
    pub fn centre(self) -> Vec4 {
        self.0.low + self.0.high
    }

    /// Returns the smallest box around the doubled centres of all primitives.
    pub fn centre_bounds(primitives: &[Self]) -> Bounds {
        primitives.iter().map(|p| Bounds::point(p.centre())).fold(Bounds::EMPTY, Bounds::union)
    }

    /// Returns the smallest box around the boxes of all primitives.
    pub fn bounds(primitives: &[Self]) -> Bounds {
        primitives.iter().map(|p| p.0).fold(Bounds::EMPTY, Bounds::union)
    }
}
