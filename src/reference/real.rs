//! The type of numbers with which a ray is cast: `f32` or `f64`, with glam's vectors.

use glam::{DVec3, Vec3};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A floating-point type.
pub trait Real:
    Copy
    + PartialOrd
    + Send
    + Sync
    + From<f32>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    /// A vector of three numbers of this type.
    type Vector: Vector<Self>;
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Infinity.
    const INFINITY: Self;
    /// Pi.
    const PI: Self;
    /// Returns the value of this type that is nearest to `value`.
    fn of(value: f64) -> Self;
    /// Returns the larger of two numbers.
    fn max(self, other: Self) -> Self;
    /// Returns the smaller of two numbers.
    fn min(self, other: Self) -> Self;
    /// Returns the absolute value.
    fn abs(self) -> Self;
    /// Returns the square root.
    fn sqrt(self) -> Self;
    /// Returns the angle of the point (other, self), from -pi to pi.
    fn atan2(self, other: Self) -> Self;
    /// Rounds down to a whole number.
    fn floor(self) -> Self;
    /// Rounds towards zero to a 32-bit integer.
    fn to_i32(self) -> i32;
    /// Returns this number to the power of `exponent`.
    fn powf(self, exponent: Self) -> Self;
    /// Returns the logarithm to base 2.
    fn log2(self) -> Self;
}

/// A point, a direction or a colour. The operator `*` multiplies two vectors component by
/// component.
pub trait Vector<R: Real>:
    Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<Output = Self>
    + Mul<R, Output = Self>
    + 'static
{
    /// The zero vector.
    const ZERO: Self;
    /// The unit vectors along the axes.
    const AXES: [Self; 3];
    /// Converts a scene's value exactly.
    fn of(value: Vec3) -> Self;
    /// Returns the vector of this type that is nearest to `value`.
    fn round(value: DVec3) -> Self;
    /// Rounds to single precision.
    fn to_f32(self) -> [f32; 3];
    /// Returns the inner product.
    fn dot(self, other: Self) -> R;
    /// Returns the cross product.
    fn cross(self, other: Self) -> Self;

    /// Returns the unit vector in this direction; zero for the zero vector. For a finite vector, the
    /// result is never NaN.
    fn normalize_or_zero(self) -> Self {
        let length = self.dot(self).sqrt();
        if length > R::ZERO { self * (R::ONE / length) } else { Self::ZERO }
    }
}

macro_rules! real {
    ($real:ident, $vector:ident) => {
        impl Real for $real {
            type Vector = $vector;
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const INFINITY: Self = $real::INFINITY;
            const PI: Self = std::$real::consts::PI;
            fn of(value: f64) -> Self {
                value as $real
            }
            fn max(self, other: Self) -> Self {
                $real::max(self, other)
            }
            fn min(self, other: Self) -> Self {
                $real::min(self, other)
            }
            fn abs(self) -> Self {
                $real::abs(self)
            }
            fn sqrt(self) -> Self {
                $real::sqrt(self)
            }
            fn atan2(self, other: Self) -> Self {
                $real::atan2(self, other)
            }
            fn floor(self) -> Self {
                $real::floor(self)
            }
            fn to_i32(self) -> i32 {
                self as i32
            }
            fn powf(self, exponent: Self) -> Self {
                $real::powf(self, exponent)
            }
            fn log2(self) -> Self {
                $real::log2(self)
            }
        }
        impl Vector<$real> for $vector {
            const ZERO: Self = $vector::ZERO;
            const AXES: [Self; 3] = $vector::AXES;
            fn of(value: Vec3) -> Self {
                let [x, y, z] = value.to_array();
                $vector::new(x.into(), y.into(), z.into())
            }
            fn round(value: DVec3) -> Self {
                $vector::new(value.x as $real, value.y as $real, value.z as $real)
            }
            fn to_f32(self) -> [f32; 3] {
                self.to_array().map(|component| component as f32)
            }
            fn dot(self, other: Self) -> $real {
                $vector::dot(self, other)
            }
            fn cross(self, other: Self) -> Self {
                $vector::cross(self, other)
            }
        }
    };
}

real!(f32, Vec3);
real!(f64, DVec3);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_zero_vector_has_no_direction_and_is_not_nan() {
        assert_eq!(Vector::normalize_or_zero(DVec3::ZERO), DVec3::ZERO);
        assert_eq!(Vector::normalize_or_zero(Vec3::new(0.0, -3.0, 0.0)), Vec3::NEG_Y);
    }
}
