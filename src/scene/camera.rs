//! Cameras, and the ray of each pixel.

use super::Sample;
use glam::{DVec3, Vec3};

/// A pinhole camera. `right`, `up` and `forward` are an orthonormal basis. Row 0 of a picture is at the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The position of the eye, where all rays start.
    pub position: Vec3,
    /// Unit vector towards larger pixel x.
    pub right: Vec3,
    /// Unit vector towards smaller pixel y.
    pub up: Vec3,
    /// Unit vector in the viewing direction.
    pub forward: Vec3,
    /// Tangent of half the field of view.
    pub tan_half_fov: f32,
    /// True if the field of view is measured across the height; otherwise across the width.
    pub fov_is_vertical: bool,
    /// Hits are ignored if their depth along `forward` is at most this distance.
    pub z_near: f32,
    /// Offset of a pixel's ray from the pixel's centre, in pixels to the right and down. The offset is zero
    /// if the pixel has a single sample.
    pub shift: [f32; 2],
    /// The width of the ray cone around a pixel's ray, as a share of the pixel's width. The cone's share is
    /// less than 1 if the pixel's area is divided among several samples.
    pub cone_share: f32,
    /// The size, in pixels, of the image whose aspect ratio determines the field of view; `None` for the
    /// camera's own image. For a half picture (of half the width and height), `covers` is the size of the whole
    /// picture: if a side of the whole picture is odd, the half picture has a slightly different aspect ratio.
    pub covers: Option<[u32; 2]>,
}

/// The rays of an image. The ray through pixel coordinates (x, y) starts at `eye` in the direction `corner +
/// x * step_x + y * step_y`; pixels have their centres at half-integers. The ray's direction has depth 1
/// along the camera's forward axis and is not normalised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelFrame {
    /// The origin of all rays.
    pub eye: DVec3,
    /// The direction through the image's top left corner, moved by the offset of the pixels' rays
    /// ([`Camera::shift`]).
    pub corner: DVec3,
    /// The difference between the directions of a pixel's ray and of the ray of the next pixel on the right.
    pub step_x: DVec3,
    /// The difference between the directions of a pixel's ray and of the ray of the next pixel below.
    pub step_y: DVec3,
    /// Hits are ignored if their depth is at most this distance.
    pub z_near: f64,
    /// The inner product of `cone` and the vector from the eye to a point is the width of a pixel's ray cone
    /// at this point. The ray cone's width grows with the point's depth.
    pub cone: DVec3,
}

impl Camera {
    /// The paper's camera: it is at the origin and looks along -z, with a field of view of 90 degrees across
    /// the width and a z_near of 0.1.
    pub const PAPER: Self = Self {
        position: Vec3::ZERO,
        right: Vec3::X,
        up: Vec3::Y,
        forward: Vec3::NEG_Z,
        tan_half_fov: 1.0,
        fov_is_vertical: false,
        z_near: 0.1,
        shift: [0.0; 2],
        cone_share: 1.0,
        covers: None,
    };

    /// Returns a camera at `position` that looks at `target`, with a z_near of 0. The field of view, across
    /// the height or the width, must be less than 180 degrees. Returns `None` if the two points are equal, or
    /// if `up` is zero or parallel to the viewing direction.
    pub fn looking_at(
        position: Vec3,
        target: Vec3,
        up: Vec3,
        fov_degrees: f32,
        fov_is_vertical: bool,
    ) -> Option<Self> {
        let direction = target.as_dvec3() - position.as_dvec3();
        Self::looking_along(position, direction, up, fov_degrees, fov_is_vertical)
    }

    /// Returns a camera like [`Camera::looking_at`] that looks in the direction `direction`, which may have any length
    /// above 0. Returns `None` if `direction` or `up` is zero, or if the two vectors are almost parallel (the sine of
    /// the angle between them is below 1e-5).
    pub(super) fn looking_along(
        position: Vec3,
        direction: DVec3,
        up: Vec3,
        fov_degrees: f32,
        fov_is_vertical: bool,
    ) -> Option<Self> {
        let forward = direction.try_normalize()?;
        let up = up.as_dvec3().try_normalize()?;
        let right = forward.cross(up);
        if right.length() < 1e-5 {
            return None;
        }
        let right = right.normalize();
        // Adding zero changes -0 to 0, so that equal axes have equal bytes.
        let axis = |v: DVec3| v.as_vec3() + Vec3::ZERO;
        Some(Self {
            position,
            right: axis(right),
            up: axis(right.cross(forward)),
            forward: axis(forward),
            tan_half_fov: (f64::from(fov_degrees).to_radians() / 2.0).tan() as f32,
            fov_is_vertical,
            z_near: 0.0,
            shift: [0.0; 2],
            cone_share: 1.0,
            covers: None,
        })
    }

    /// Returns the camera that casts the sample `sample` of each pixel. The rays are shifted by the sample's
    /// offset, and the ray cones have the sample's share of a pixel's width.
    #[must_use]
    pub fn of_sample(&self, sample: &Sample) -> Self {
        Self { shift: sample.offset, cone_share: sample.cone_share(), ..*self }
    }

    /// Returns the camera of an image that shows the same field of view as another image. `size` is the size,
    /// in pixels, of this other image.
    #[must_use]
    pub fn covering(&self, size: [u32; 2]) -> Self {
        Self { covers: Some(size), ..*self }
    }

    /// Returns the rays of an image of `width` x `height` pixels.
    pub fn pixel_frame(&self, width: u32, height: u32) -> PixelFrame {
        let [across, down] = self.covers.unwrap_or([width, height]).map(f64::from);
        let (width, height) = (f64::from(width), f64::from(height));
        let tan = f64::from(self.tan_half_fov);
        let (tan_x, tan_y) =
            if self.fov_is_vertical { (tan * across / down, tan) } else { (tan, tan * down / across) };
        let (right, up, forward) = (self.right.as_dvec3(), self.up.as_dvec3(), self.forward.as_dvec3());
        let (step_x, step_y) = (right * (2.0 * tan_x / width), up * (-2.0 * tan_y / height));
        let [x, y] = self.shift.map(f64::from);
        PixelFrame {
            eye: self.position.as_dvec3(),
            corner: forward - right * tan_x + up * tan_y + (step_x * x + step_y * y),
            step_x,
            step_y,
            z_near: f64::from(self.z_near),
            cone: forward * (step_x.length() * f64::from(self.cone_share)),
        }
    }
}

impl PixelFrame {
    /// Returns the direction of the ray through pixel coordinates (x, y). The direction has depth 1 along the
    /// camera's forward axis.
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        self.corner + self.step_x * x + self.step_y * y
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_half_picture_of_an_odd_size_shows_the_same_field_of_view() {
        for fov_is_vertical in [false, true] {
            let camera = Camera { fov_is_vertical, ..Camera::PAPER };
            for [width, height] in [[1921, 1080], [1600, 9], [1000, 1]] {
                let half = [width, height].map(|side: u32| side.div_ceil(2));
                let whole = camera.pixel_frame(width, height);
                let other = camera.covering([width, height]).pixel_frame(half[0], half[1]);
                for [x, y] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
                    let at = |frame: &PixelFrame, [w, h]: [u32; 2]| {
                        frame.direction(x * f64::from(w), y * f64::from(h))
                    };
                    assert!(
                        at(&whole, [width, height]).distance(at(&other, half)) < 1e-9,
                        "{width} x {height}"
                    );
                }
            }
        }
    }

    #[test]
    fn looking_down_negative_z_is_the_papers_camera() {
        let camera = Camera::looking_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 90.0, false).unwrap();
        assert_eq!(camera, Camera { z_near: 0.0, ..Camera::PAPER });
    }

    #[test]
    fn a_cone_is_as_wide_as_a_pixel_at_each_depth_and_narrower_for_one_of_several_samples() {
        let position = Vec3::new(3.0, -2.0, 5.0);
        let camera = Camera::looking_at(position, Vec3::ZERO, Vec3::Y, 40.0, false).unwrap();
        let width = |camera: &Camera| {
            let frame = camera.pixel_frame(80, 50);
            frame.cone.dot(frame.direction(80.0, 0.0) * 7.0)
        };
        let pixel = 7.0 * 2.0 * 20.0_f64.to_radians().tan() / 80.0;
        assert!((width(&camera) / pixel - 1.0).abs() < 1e-6);
        let sample = Sample { count: 4, ..Sample::CENTRE };
        assert!((width(&camera.of_sample(&sample)) / pixel - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_camera_without_a_direction_is_refused() {
        assert!(Camera::looking_at(Vec3::ONE, Vec3::ONE, Vec3::Y, 90.0, false).is_none());
        assert!(Camera::looking_at(Vec3::ZERO, Vec3::Y, Vec3::Y, 90.0, false).is_none());
        assert!(Camera::looking_at(Vec3::ZERO, Vec3::X, Vec3::ZERO, 90.0, false).is_none());
    }

    #[test]
    fn the_rays_of_a_picture_go_to_the_right_and_down_from_its_corner() {
        let frame = Camera::PAPER.pixel_frame(4, 2);
        assert_eq!(
            (frame.corner, frame.eye, frame.z_near as f32),
            (DVec3::new(-1.0, 0.5, -1.0), DVec3::ZERO, 0.1)
        );
        assert_eq!((frame.step_x, frame.step_y), (DVec3::X * 0.5, DVec3::Y * -0.5));
        assert_eq!(frame.direction(1.0, 0.5), DVec3::new(-0.5, 0.25, -1.0));
        let sample = Sample { offset: [0.5, 0.25], count: 4, ..Sample::CENTRE };
        let shifted = Camera::PAPER.of_sample(&sample).pixel_frame(4, 2);
        assert_eq!(shifted.corner, DVec3::new(-0.75, 0.375, -1.0));
        let tall = Camera { fov_is_vertical: true, ..Camera::PAPER }.pixel_frame(4, 2);
        assert_eq!(tall.corner, DVec3::new(-2.0, 1.0, -1.0));
    }

    /// The hash of a scene depends on the bits of the camera's axes.
    #[test]
    fn no_axis_of_a_camera_has_a_negative_zero() {
        for (ahead, up) in [
            (Vec3::NEG_Z, Vec3::Y),
            (Vec3::Z, Vec3::Y),
            (Vec3::X, Vec3::Y),
            (Vec3::NEG_X, Vec3::Z),
            (Vec3::Y, Vec3::Z),
            (Vec3::NEG_Y, Vec3::X),
        ] {
            let camera = Camera::looking_at(Vec3::ONE, Vec3::ONE + ahead, up, 90.0, false).unwrap();
            for axis in [camera.right, camera.up, camera.forward] {
                let is_negative_zero = |part: &f32| *part == 0.0 && part.is_sign_negative();
                assert!(!axis.to_array().iter().any(is_negative_zero), "{ahead} {up}: {axis:?}");
            }
        }
    }

    #[test]
    fn the_length_of_the_upward_direction_does_not_matter() {
        let of = |up: Vec3| Camera::looking_at(Vec3::ZERO, Vec3::NEG_Z, up, 90.0, false);
        assert!(of(Vec3::Y).is_some());
        assert_eq!([1e-6, 1e6].map(|length| of(Vec3::Y * length)), [of(Vec3::Y); 2]);
    }
}
