//! Notes on scenes that are too small for single precision, and the default shadow bias, which depends on the
//! precision of coordinates.

use crate::scene::document::Document;
use crate::scene::files::Placement;
use glam::Vec3;

/// The default shadow bias, as a fraction of the scene's diagonal.
const RELATIVE_SHADOW_BIAS: f32 = 1e-4;
/// The least default shadow bias, as a fraction of the largest coordinate of the surfaces and of the eye.
/// Along each axis, rounding moves a hit by up to half of `EPSILON` times the largest coordinate. The distance of the
/// hit from its surface is thus less than `EPSILON` times the largest coordinate. With eight times `EPSILON`, only
/// shadow rays that nearly graze the surface start below the surface.
const ROUNDING_SHADOW_BIAS: f32 = 8.0 * f32::EPSILON;

/// Returns a note if a scene with these bounds is so small that the kernels may miss its triangles. A bare mesh is
/// usually scaled when it is read, so the function then returns no note. A glTF mesh is not scaled if its file's camera
/// or lights would then be beyond raycl's limits.
pub(super) fn too_small(document: &Document, (low, high): (Vec3, Vec3)) -> Option<String> {
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    let note = || {
        let radius = (high - low).length() / 2.0;
        let objects = if document.bare { "mesh (`object.0`)" } else { "objects" };
        format!(
            "{}: the scene's radius is only {radius:.1e}; products of such small lengths round to 0, so triangles may \
             be missing: give the {objects} a larger `scale`",
            document.name
        )
    };
    (Placement::of(low, high).scale > 1.0).then(note)
}

/// Returns the default shadow bias, in the scene's units, of surfaces within these bounds that are seen from
/// `eye`. The bias depends on the distance from the origin only if the surfaces or the eye are far from the
/// origin.
pub(super) fn default_bias((low, high): (Vec3, Vec3), eye: Vec3) -> f32 {
    let rounding = ROUNDING_SHADOW_BIAS * largest_coordinate(low.min(eye), high.max(eye));
    rounding.max(RELATIVE_SHADOW_BIAS * high.distance(low))
}

/// Returns the largest absolute value of the coordinates within these bounds.
fn largest_coordinate(low: Vec3, high: Vec3) -> f32 {
    low.abs().max(high.abs()).max_element()
}
