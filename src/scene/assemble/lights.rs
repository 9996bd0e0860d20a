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
use crate::scene::{Area, Camera, Light};
use glam::Vec3;

/// Returns the lights of a scene. The first of these rules that applies determines the lights:
///
/// - If there is a `studio` (the default surroundings of a bare mesh), the lights are those of the studio.
/// - If the scene file or the user sets lights, the lights are these.
/// - For a bare mesh whose own file has lights, the lights are those of this file.
/// - For a bare mesh without a sky, the lights are a key light and a fill light.
///
/// If no rule applies, the function returns no lights. Adds a note if the scene has no sky, and either no light or only
/// lights of power 0. (In an animation, lights of power 0 cause no note.)
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
    } else if wire.sky.is_none()
        && lights.iter().all(|light| light.power == Vec3::ZERO)
        && !document.is_animated()
    {
        let what = if lights.len() == 1 { "the only light has" } else { "all lights have" };
        notes.push(format!("{}: {what} power 0, so surfaces that emit no light are black", document.name));
    }
    lights
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
