//! Notes on scenes that are too small or too far from the origin for single precision, and the default shadow
//! bias, which depends on the precision of coordinates.

use crate::scene::document::Document;
use crate::scene::files::Placement;
use glam::Vec3;

/// The default shadow bias, as a fraction of the scene's diagonal.
const RELATIVE_SHADOW_BIAS: f32 = 1e-4;
/// The least default shadow bias, as a fraction of the largest coordinate of the surfaces and of the eye.
/// Along each axis, rounding moves a hit by up to half of `EPSILON` times this coordinate, so the hit is less
/// than `EPSILON` times this coordinate away from its surface. With eight times `EPSILON`, only shadow rays
/// that nearly graze the surface start below the surface.
const ROUNDING_SHADOW_BIAS: f32 = 8.0 * f32::EPSILON;
/// A scene counts as far from the origin if its largest coordinate is more than this many times its diagonal.
/// At this distance, ten of the 24 significant bits of a coordinate are the same for all points of the scene.
const FAR_DIAGONALS: f32 = 1000.0;

/// Returns a note if a scene with these bounds is so small that the kernels may miss its triangles. A bare
/// mesh has no note, since it is scaled when it is read.
pub(super) fn too_small(document: &Document, (low, high): (Vec3, Vec3)) -> Option<String> {
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    let note = || {
        let radius = (high - low).length() / 2.0;
        format!(
            "{}: the scene's radius is only {radius:.1e}; products of such small lengths round to 0, so triangles may \
             be missing: give the objects a larger `scale`",
            document.name
        )
    };
    (Placement::of(low, high).scale > 1.0).then(note)
}

/// Returns a note if a scene with these bounds is so far from the origin that single precision distinguishes
/// few of its points. A bare mesh has no note, since it is moved to the origin when it is read.
pub(super) fn too_far(document: &Document, (low, high): (Vec3, Vec3)) -> Option<String> {
    // The diagonal is computed in double precision, since the squares of very small lengths are 0 in single
    // precision.
    let (farthest, diagonal) =
        (largest_coordinate(low, high), high.as_dvec3().distance(low.as_dvec3()) as f32);
    let note = || {
        format!(
            "{}: the diagonal of the scene's box is only {diagonal}, but coordinates reach {farthest}, where single \
             precision rounds them to steps of about {:.1e}; surfaces and shadows may look rough: subtract about {} \
             from all positions (the camera's, those of lights and the `translation` of objects)",
            document.name,
            f32::EPSILON * farthest,
            (low + high) / 2.0
        )
    };
    (farthest > FAR_DIAGONALS * diagonal).then(note)
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
