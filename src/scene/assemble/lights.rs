//! The lights of a scene, which come from the scene file, from a bare mesh's own file or from a studio (the
//! default surroundings of a bare mesh). A bare mesh without lights, without a sky and without a studio gets a
//! key light and a fill light.

use super::Seen;
use crate::error::Result;
use crate::scene::document::Document;
use crate::scene::files;
use crate::scene::framing::{self, Ball};
use crate::scene::studio::Studio;
use crate::scene::validate::{Brightness, check_light};
use crate::scene::wire::{LightWire, SceneWire};
use crate::scene::{Area, Camera, Light, Sky};
use glam::Vec3;

/// Returns the lights of a scene. The first of these rules that applies determines the lights:
///
/// - If there is a `studio` (the default surroundings of a bare mesh), the lights are those of the studio.
/// - If the scene file or the user sets lights, the lights are these.
/// - For a bare mesh whose own file has lights, the lights are those of this file.
/// - For a bare mesh without a sky, the lights are a key light and a fill light.
///
/// If no rule applies, the function returns no lights. Adds a note if the scene has neither lights nor a sky.
pub(super) fn lights(
    document: &Document,
    wire: &SceneWire,
    seen: &Seen,
    camera: &Camera,
    ball: Option<Ball>,
    studio: Option<&Studio>,
    notes: &mut Vec<String>,
) -> Vec<Light> {
    if let Some(studio) = studio {
        return studio.lights.clone();
    }
    let lights = match (&wire.light, ball.filter(|_| document.bare)) {
        (None, Some(ball)) if !seen.lights.is_empty() => {
            files::lights_of_file(&seen.lights, ball.centre_and_radius(), framing::key_at(ball))
        }
        (None, Some(ball)) if wire.sky.is_none() => framing::lights(camera, ball),
        (lights, _) => lights.iter().flatten().map(light).collect(),
    };
    if lights.is_empty() && wire.sky.is_none() {
        let black = "no light, so surfaces that emit no light are black";
        notes.push(match document.setting_of("light") {
            Some(setting) => format!("{setting}: {black}"),
            None => format!(
                "{}: {black}; add [[light]] with position = [1, 3, 1] and power = 10",
                document.last_line()
            ),
        });
    }
    lights
}

/// Returns a note if no light and no sky illuminates the mesh, although the scene has a light or a sky: if lights have
/// power 0 or shine away from the mesh, and the sky's radiance is 0. `bounds` is the mesh's bounding box.
pub(super) fn note_dark(
    document: &Document,
    lights: &[Light],
    sky: Option<&Sky>,
    bounds: (Vec3, Vec3),
) -> Option<String> {
    let is_lit = sky.is_some_and(|sky| !sky.is_black());
    if is_lit || lights.is_empty() && sky.is_none() {
        return None;
    }
    let all = |one, many| if lights.len() == 1 { one } else { many };
    let is_off = |light: &Light| light.power == Vec3::ZERO;
    let (why, remedy) = if lights.is_empty() {
        ("the sky has radiance 0 and there is no light", "")
    } else if lights.iter().all(is_off) {
        (all("the only light has power 0", "all lights have power 0"), "")
    } else if lights.iter().all(|light| is_off(light) || shines_away(light, bounds)) {
        (
            all("the only light shines away from all surfaces", "all lights shine away from all surfaces"),
            "; the order of a light's `edges` decides which side shines",
        )
    } else {
        return None;
    };
    Some(format!("{}: {why}, so surfaces that emit no light are black{remedy}", document.name))
}

/// Returns true if a light has a front, and the whole box `low`..`high` is behind it.
fn shines_away(light: &Light, (low, high): (Vec3, Vec3)) -> bool {
    let Some(area) = &light.area else { return false };
    let front = area.front();
    // Of all corners of the box, this corner is farthest in the front's direction.
    let farthest = Vec3::select(front.cmpgt(Vec3::ZERO), high, low);
    (farthest.as_dvec3() - light.position.as_dvec3()).dot(front.as_dvec3()) <= 0.0
}

/// Refuses lights of the scene file that have a value out of range, are too bright, or have a shape but no edges. The
/// error states the light's location in the file.
pub(super) fn check_lights(
    document: &Document,
    wire: &SceneWire,
    lights: &[Light],
    brightness: &Brightness,
) -> Result<()> {
    for (wire, light) in wire.light.iter().flatten().zip(lights) {
        if let (Some(shape), None) = (&wire.shape, &wire.edges) {
            let message = "a light has a shape but no edges; expected edges = [[x, y, z], [x, y, z]]";
            return Err(document.error(shape.span(), message, "the edges of this shape are missing"));
        }
        let span = wire.edges.as_ref().map_or(wire.position.span(), |edges| edges.span());
        check_light(light).map_err(|error| document.located(span, error, "this light"))?;
        brightness
            .check(light)
            .map_err(|error| document.located(wire.power.span(), error, "too much for single precision"))?;
    }
    Ok(())
}

fn light(wire: &LightWire) -> Light {
    let power = wire.power.get_ref().0;
    let radius = wire.radius.map_or(0.0, |radius| radius.0);
    let area = wire.edges.as_ref().map(|edges| {
        let shape = wire.shape.as_ref().map(|shape| *shape.get_ref()).unwrap_or_default();
        Area { shape, edges: edges.get_ref().0.map(|edge| Vec3::from_array(edge.0)) }
    });
    Light { position: wire.position.get_ref().in_scene(), power: Vec3::from_array(power), radius, area }
}
