//! Rays, and the ray through each pixel; the counterpart for devices is `cl/common/camera`.

use super::real::{Real, Vector};
use crate::scene::PixelFrame;

/// A half-line. Only hits at `near < t < far` count.
#[derive(Clone, Copy, Debug)]
pub struct Ray<R: Real> {
    /// The origin.
    pub origin: R::Vector,
    /// A unit vector.
    pub direction: R::Vector,
    /// Hits at this distance or nearer are ignored.
    pub near: R,
    /// Hits at this distance or farther are ignored.
    pub far: R,
    /// True if a light is at the ray's far end. Devices may cast such a ray from either end.
    pub to_light: bool,
    /// True if the ray starts beside a surface, at the shadow bias from a hit.
    pub is_shadow: bool,
}

/// The rays of an image, with one type of numbers. [`PixelFrame`] explains the fields; `src/scene/camera.rs` computes
/// them.
#[derive(Clone, Copy, Debug)]
pub struct Frame<R: Real> {
    eye: R::Vector,
    corner: R::Vector,
    step_x: R::Vector,
    step_y: R::Vector,
    z_near: R,
    cone: R::Vector,
}

impl<R: Real> Frame<R> {
    /// Makes a camera's rays, rounded to this type.
    pub fn new(frame: &PixelFrame) -> Self {
        Self {
            eye: Vector::round(frame.eye),
            corner: Vector::round(frame.corner),
            step_x: Vector::round(frame.step_x),
            step_y: Vector::round(frame.step_y),
            z_near: R::of(frame.z_near),
            cone: Vector::round(frame.cone),
        }
    }

    /// Returns the width of a pixel's cone at distance `t` along a ray from the eye: the width at depth 1 times the
    /// depth. (The vector `cone` has the direction of the camera's forward axis, and the cone's width at depth 1 as its
    /// length.)
    pub fn cone_width(&self, ray: &Ray<R>, t: R) -> R {
        self.cone.dot(ray.direction) * t
    }

    /// Returns the ray through pixel coordinates (x, y); a pixel's centre is at half-integers.
    pub fn primary(&self, x: R, y: R) -> Ray<R> {
        // The direction has depth 1, so its length converts the depth z_near to a distance along the ray. Only
        // hits behind the near plane count: the book's rays start at this plane.
        let towards = self.corner + self.step_x * x + self.step_y * y;
        let length = towards.dot(towards).sqrt();
        Ray {
            origin: self.eye,
            direction: towards * (R::ONE / length),
            near: self.z_near * length,
            far: R::INFINITY,
            to_light: false,
            is_shadow: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_width_of_a_cone_grows_with_the_depth_and_not_with_the_distance() {
        let frame = PixelFrame {
            eye: DVec3::ONE,
            corner: DVec3::new(0.75, 0.0, -1.0),
            step_x: DVec3::X,
            step_y: DVec3::NEG_Y,
            z_near: 0.0,
            cone: DVec3::new(0.0, 0.0, -0.01),
        };
        let frame = Frame::<f64>::new(&frame);
        // The rays' depths at a distance of 5 are 5 and 4, and the second ray's direction is (0.6, 0, -0.8).
        for (x, expected) in [(-0.75, 0.05), (0.0, 0.04)] {
            let width = frame.cone_width(&frame.primary(x, 0.0), 5.0);
            assert!((width - expected).abs() < 1e-12, "{x}: {width}");
        }
    }
}
