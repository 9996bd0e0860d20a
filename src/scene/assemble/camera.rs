//! Builds the camera of a scene from a base camera. The base camera is the paper's camera, the camera of a
//! mesh's file, or a camera that shows the whole scene. Keys of the scene file replace values of the base
//! camera.

use super::super::document::Document;
use super::super::framing::{self, Ball, Lens, View};
use super::super::validate::check_camera;
use super::super::wire::{CameraWire, Position};
use super::super::{Camera, Mesh, Shot};
use super::Seen;
use crate::error::{Error, Result};
use glam::{BVec3, DVec3, Vec3};
use toml::Spanned;

impl CameraWire {
    /// Returns true if the scene file sets an azimuth or an elevation. The base camera then shows the whole
    /// scene.
    pub(super) fn is_framed(&self) -> bool {
        self.azimuth_degrees.is_some() || self.elevation_degrees.is_some()
    }

    /// Returns the scene's upward direction, of length 1; the y axis if `up` is not set or zero.
    pub(super) fn upright(&self) -> DVec3 {
        let given = self.up.as_ref().map(|up| Vec3::from_array(up.get_ref().0).as_dvec3());
        given.and_then(DVec3::try_normalize).unwrap_or(DVec3::Y)
    }
}

/// Returns the scene's camera: the base camera with the values that the scene file sets. `ball` is the ball
/// around the scene; `None` unless the scene is a bare mesh, or the scene file sets an azimuth or an
/// elevation. Refuses a camera with values out of range.
pub(super) fn camera(
    document: &Document,
    wire: &CameraWire,
    mesh: &Mesh,
    ball: Option<Ball>,
    seen: &Seen,
    shot: Shot,
    notes: &mut Vec<String>,
) -> Result<Camera> {
    let lens = field_of_view(document, wire)?;
    let base = base_camera(wire, lens, mesh, ball, seen, shot, notes);
    let camera = with_values(document, wire, base, lens, ball)?;
    notes.extend(unused_angles(document, wire));
    let eye = wire.position.as_ref().map_or(0..0, Spanned::span);
    check_camera(&camera).map_err(|error| document.located(eye, error, "this camera"))?;
    Ok(camera)
}

/// Returns a note on angles that do not turn the camera, because the scene file sets the camera's position; `None` if
/// there are none.
fn unused_angles(document: &Document, wire: &CameraWire) -> Option<String> {
    let location = document.location_of(&wire.position.as_ref()?.span());
    let angles = [
        ("azimuth_degrees", wire.azimuth_degrees.is_some()),
        ("elevation_degrees", wire.elevation_degrees.is_some()),
    ];
    let set: Vec<&str> = angles.into_iter().filter(|(_, is_set)| *is_set).map(|(key, _)| key).collect();
    let (turn, change) = match set.len() {
        1 => ("does not turn the camera", "this angle only changes"),
        _ => ("do not turn the camera", "these angles only change"),
    };
    let has_lens = wire.fov_x_degrees.is_some() || wire.fov_y_degrees.is_some();
    let changed = match (wire.look_at.is_some(), has_lens) {
        (false, false) => format!("; {change} the defaults of `look_at` and of the field of view"),
        (false, true) => format!("; {change} the default of `look_at`"),
        (true, false) => format!("; {change} the default of the field of view"),
        (true, true) => String::new(),
    };
    let note =
        || format!("{location}: the camera's position is set, so {} {turn}{changed}", set.join(" and "));
    (!set.is_empty()).then(note)
}

/// Returns the base camera. Without a `ball` (the ball around the scene), the base camera is the paper's
/// camera, at the file's origin and with a z_near of 0. With a `ball`, there are two cases. If the file of a bare
/// mesh has a camera, and the user sets no azimuth, no elevation and no `up`, the base camera is the file's
/// camera, and `notes` receives the notes on this camera. Otherwise, the base camera shows the whole scene
/// with the field of view `lens`.
fn base_camera(
    wire: &CameraWire,
    lens: Option<Lens>,
    mesh: &Mesh,
    ball: Option<Ball>,
    seen: &Seen,
    shot: Shot,
    notes: &mut Vec<String>,
) -> Camera {
    let Some(ball) = ball else {
        let eye = Position { in_file: DVec3::ZERO, origin: wire.origin };
        return Camera { position: eye.in_scene(), z_near: 0.0, ..Camera::PAPER };
    };
    if let Some(camera) = seen.camera.filter(|_| !wire.is_framed() && wire.up.is_none()) {
        notes.extend(seen.camera_notes.iter().cloned());
        notes.extend(seen.camera_aspect.and_then(|aspect| note_aspect(aspect, shot.aspect)));
        notes.extend(note_beside(&camera, mesh, shot.aspect));
        return camera;
    }
    let degrees = |azimuth: Option<f32>| azimuth.map(f64::from);
    let view = View {
        up: wire.upright(),
        azimuth_degrees: degrees(wire.azimuth_degrees.map(|azimuth| azimuth.0)),
        elevation_degrees: degrees(wire.elevation_degrees.map(|elevation| elevation.0)),
        lens,
        shot,
    };
    framing::camera(mesh, ball, &view)
}

/// Returns a note if the camera of a mesh file does not see the mesh, because the mesh's bounding box lies to the left
/// or right of the camera's view, or above or below it. `aspect` is the aspect ratio of the pictures. (Other notes say
/// if a mesh is behind the camera.)
fn note_beside(camera: &Camera, mesh: &Mesh, aspect: f64) -> Option<String> {
    let (low, high) = mesh.bounds()?;
    let tan = f64::from(camera.tan_half_fov);
    let (tan_x, tan_y) = if camera.fov_is_vertical { (tan * aspect, tan) } else { (tan, tan / aspect) };
    let corners = (0..8).map(|number| {
        let is_high = BVec3::new(number & 1 != 0, number & 2 != 0, number & 4 != 0);
        Vec3::select(is_high, high, low).as_dvec3() - camera.position.as_dvec3()
    });
    let corners: Vec<[f64; 3]> = corners
        .map(|corner| [camera.right, camera.up, camera.forward].map(|axis| corner.dot(axis.as_dvec3())))
        .collect();
    let all_beside =
        |axis: usize, tan: f64, side: f64| corners.iter().all(|corner| side * corner[axis] > tan * corner[2]);
    let is_beside = [-1.0, 1.0].iter().any(|side| all_beside(0, tan_x, *side) || all_beside(1, tan_y, *side));
    is_beside.then(|| {
        "the file's camera looks past the mesh: --azimuth 31 uses raycl's own camera instead".to_owned()
    })
}

/// Returns a note if a mesh file's camera is meant for pictures of another aspect ratio (`stated`) than that of the
/// pictures (`own`); `None` if the two differ by at most a hundredth.
fn note_aspect(stated: f32, own: f64) -> Option<String> {
    let differs = (f64::from(stated) / own - 1.0).abs() > 0.01;
    differs.then(|| {
        format!(
            "the camera's aspectRatio of {stated} is not used: the picture's aspect ratio is {own:.3} (set by --width and --height)"
        )
    })
}

/// Returns the base camera with the values that the scene file sets, including the field of view `lens`. If
/// the file sets `position` but not `look_at`, the camera looks at the centre of the `ball` (the ball around
/// the scene) or, without a `ball`, in the base camera's direction. If the file sets `position` or `look_at`
/// but not `up`, the y axis points up. Returns an error if the camera looks at its own position, or if `up`
/// is zero or parallel to the viewing direction.
fn with_values(
    document: &Document,
    wire: &CameraWire,
    base: Camera,
    lens: Option<Lens>,
    ball: Option<Ball>,
) -> Result<Camera> {
    let z_near = wire.z_near.map_or(base.z_near, |value| value.0);
    let base = Camera { z_near, ..lens.map_or(base, |lens| lens.on(base)) };
    let given = |position: &Option<Spanned<Position>>| position.as_ref().map(|p| p.get_ref().in_scene());
    let up = wire.up.as_ref().map(|up| Vec3::from_array(up.get_ref().0));
    // If there is a ball around the scene, the base camera was already built with the file's `up`.
    let up_is_used = up.is_none() || ball.is_some() && up != Some(Vec3::ZERO);
    if wire.position.is_none() && wire.look_at.is_none() && up_is_used {
        return Ok(base);
    }
    let position = given(&wire.position).unwrap_or(base.position);
    let target = given(&wire.look_at).or(ball.map(|ball| ball.centre.as_vec3()));
    // The base camera's direction is not converted to a target point: far from the origin, the sum of the
    // position and the direction could round to the position.
    let direction = target.map_or(base.forward.as_dvec3(), |target| target.as_dvec3() - position.as_dvec3());
    let up = up.unwrap_or(Vec3::Y);
    let looking = Camera::looking_along(position, direction, up, 90.0, false)
        .ok_or_else(|| no_direction(document, wire, position, direction, up))?;
    let Camera { tan_half_fov, fov_is_vertical, .. } = base;
    Ok(Camera { tan_half_fov, fov_is_vertical, z_near, ..looking })
}

/// Returns the field of view that the scene file sets; `None` if the file sets none. Returns an error if the
/// file sets both fields of view.
fn field_of_view(document: &Document, wire: &CameraWire) -> Result<Option<Lens>> {
    let lens = |degrees: f32, fov_is_vertical: bool| Lens {
        tan_half_fov: (f64::from(degrees).to_radians() / 2.0).tan() as f32,
        fov_is_vertical,
    };
    match (&wire.fov_x_degrees, &wire.fov_y_degrees) {
        (Some(_), Some(second)) => Err(document
            .error(second.span(), "both fov_x_degrees and fov_y_degrees are set", "one of the two")
            .with_help("set only one of them: the other follows from the image's aspect ratio")),
        (Some(fov), None) => Ok(Some(lens(fov.get_ref().0, false))),
        (None, Some(fov)) => Ok(Some(lens(fov.get_ref().0, true))),
        (None, None) => Ok(None),
    }
}

fn no_direction(document: &Document, wire: &CameraWire, position: Vec3, direction: DVec3, up: Vec3) -> Error {
    let span = |position: &Option<Spanned<Position>>| position.as_ref().map(Spanned::span);
    let keys = [wire.up.as_ref().map(Spanned::span), span(&wire.look_at), span(&wire.position)];
    let at = |order: [usize; 3]| order.iter().find_map(|&i| keys[i].clone()).unwrap_or_default();
    if direction == DVec3::ZERO {
        // The camera looks at its own position. If the file does not set `position`, the point `look_at` is thus the
        // camera's position too.
        let given = wire.position.as_ref().or(wire.look_at.as_ref());
        let in_file = given.map_or(position.as_dvec3(), |given| given.get_ref().in_file);
        let message = format!("the camera at {in_file} looks at its own position");
        let span = at([1, 2, 0]);
        let error = document.error(span.clone(), message, "no direction");
        return document.with_settings(&span, error.with_help("move position or look_at"));
    }
    let direction = direction.as_vec3();
    let message = format!("the camera's `up`, {up}, is zero or parallel to its view direction {direction}");
    // The help suggests y as the upward direction, or z if the camera looks mostly along y.
    let direction = direction.abs();
    let usable = if direction.y <= direction.x.max(direction.z) { "[0, 1, 0]" } else { "[0, 0, 1]" };
    document
        .error(at([0, 1, 2]), message, "no upward direction")
        .with_help(format!("choose an `up` that is not parallel to the view direction, such as {usable}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::Triangle;

    #[test]
    fn a_camera_that_looks_past_the_mesh_is_noted() {
        let positions =
            vec![Vec3::new(-1.0, -1.0, -5.0), Vec3::new(1.0, 1.0, -4.0), Vec3::new(-1.0, 1.0, -5.0)];
        let triangles = vec![Triangle { positions: [0, 1, 2], normals: [0; 3], material: 0 }];
        let mesh = Mesh { positions, triangles, ..Mesh::default() };
        let is_noted = |x: f32, y: f32, aspect: f64, fov_is_vertical: bool| {
            let camera = Camera { position: Vec3::new(x, y, 0.0), fov_is_vertical, ..Camera::PAPER };
            note_beside(&camera, &mesh, aspect).is_some()
        };
        // With a field of view of 90 degrees, the view is 5 units wide or high on each side at a depth of 5.
        for side in [-1.0, 1.0] {
            let noted = |distance: f32, aspect, vertical| {
                let distance = side * distance;
                [is_noted(distance, 0.0, aspect, vertical), is_noted(0.0, distance, aspect, vertical)]
            };
            assert_eq!([noted(5.9, 1.0, false), noted(6.1, 1.0, true)], [[false; 2], [true; 2]]);
            assert_eq!(noted(6.1, 2.0, true), [false, true]);
            assert_eq!(noted(4.0, 2.0, false), [false, true]);
        }
        assert_eq!(note_beside(&Camera::PAPER, &Mesh::default(), 1.0), None);
    }

    #[test]
    fn the_aspect_ratio_of_a_files_camera_is_noted_if_the_pictures_have_another() {
        let note = "the camera's aspectRatio of 1.5 is not used: the picture's aspect ratio is 1.778 (set by --width and --height)";
        assert_eq!(note_aspect(1.5, 16.0 / 9.0).as_deref(), Some(note));
        assert_eq!(note_aspect(1.777_777_8, 1920.0 / 1080.0), None);
        assert_eq!(note_aspect(1.5, 1.5 * 1.009), None);
    }
}
