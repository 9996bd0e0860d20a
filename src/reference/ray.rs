//! Rays, and the one through each pixel: the twin of `cl/common/camera`.

use super::real::{Real, Vector};
use crate::scene::PixelFrame;

/// A half line. Only hits at `near < t < far` count.
#[derive(Clone, Copy, Debug)]
pub struct Ray<R: Real> {
    /// Where it starts.
    pub origin: R::Vector,
    /// A unit vector.
    pub direction: R::Vector,
    /// Hits at this distance or nearer are not seen.
    pub near: R,
    /// Hits at this distance or farther are not seen.
    pub far: R,
}

/// The rays of an image, in the arithmetic they are cast in.
#[derive(Clone, Copy, Debug)]
pub struct Frame<R: Real> {
    eye: R::Vector,
    corner: R::Vector,
    step_x: R::Vector,
    step_y: R::Vector,
    z_near: R,
}

impl<R: Real> Frame<R> {
    /// A camera's rays, rounded to this arithmetic.
    pub fn new(frame: &PixelFrame) -> Self {
        Self {
            eye: Vector::round(frame.eye),
            corner: Vector::round(frame.corner),
            step_x: Vector::round(frame.step_x),
            step_y: Vector::round(frame.step_y),
            z_near: R::of(frame.z_near),
        }
    }

    /// The ray through pixel coordinates (x, y); a pixel's centre is at half-integers.
    pub fn primary(&self, x: R, y: R) -> Ray<R> {
        // The direction has depth 1, so its length is what a depth of z_near is along the ray:
        // the same as the book's start on the near plane.
        let towards = self.corner + self.step_x * x + self.step_y * y;
        let length = towards.dot(towards).sqrt();
        Ray {
            origin: self.eye,
            direction: towards * (R::ONE / length),
            near: self.z_near * length,
            far: R::INFINITY,
        }
    }
}
