//! From the wire types to a [`Scene`]: what TOML alone cannot check.

mod objects;

use super::document::Document;
use super::validate::{Brightness, check_camera, check_light, check_positions};
use super::wire::{CameraWire, LightWire, SceneWire};
use super::{Camera, Display, Light, Mesh, PAPER_BACKGROUND, Scene, framing, normals};
use crate::error::{Error, Result};
use framing::Ball;
use glam::Vec3;

/// A shadow ray starts this part of the scene's diagonal from its surface.
const RELATIVE_SHADOW_BIAS: f32 = 1e-4;

/// Builds the scene a document describes.
pub(super) fn assemble(document: &Document, wire: SceneWire, notes: &mut Vec<String>) -> Result<Scene> {
    let mut mesh = Mesh::default();
    for object in &wire.object {
        let part = objects::build(document, object, notes)?;
        if mesh.triangles.len() + part.triangles.len() > super::shapes::MAX_TRIANGLES as usize {
            let message = format!("more than {} triangles in all", super::shapes::MAX_TRIANGLES);
            return Err(document.error(object.span(), message, "this object is too many"));
        }
        check_positions(&part).map_err(|error| document.place(object.span(), error, "of this object"))?;
        mesh.append(part);
    }
    if mesh.triangles.is_empty() {
        return Err(document
            .error(0..0, "the scene has no triangles", "no [[object]] in this file")
            .with_help("add [[object]] with obj = \"FILE\", shape = \"NAME\", or vertices and faces"));
    }
    let ball = document.bare_ball(&mesh);
    let camera = camera(document, &wire.camera, &mesh, ball)?;
    let eye = wire.camera.position.as_ref().map_or(0..0, toml::Spanned::span);
    check_camera(&camera).map_err(|error| document.place(eye, error, "this camera"))?;
    if document.bare {
        normals::turn_towards(&mut mesh, camera.position);
    }
    let lights = match (&wire.light, ball) {
        (None, Some(ball)) => framing::lights(&camera, ball),
        (lights, _) => lights.iter().flatten().map(light).collect::<Vec<_>>(),
    };
    if lights.is_empty() {
        notes.push(format!(
            "{}:{}: no light: every surface is black; add [[light]] with position = [1, 3, 1] and power = 10",
            document.name,
            document.text.lines().count()
        ));
    }
    let display = Display::default();
    let shadow_bias = wire.shadow_bias.map_or_else(|| default_bias(&mesh), |bias| bias.0);
    let brightness = Brightness::of(&mesh, lights.len(), shadow_bias);
    for (wire, light) in wire.light.iter().flatten().zip(&lights) {
        check_light(light).map_err(|error| document.place(wire.position.span(), error, "this light"))?;
        brightness
            .check(light)
            .map_err(|error| document.place(wire.power.span(), error, "too much for single precision"))?;
    }
    Ok(Scene {
        name: wire.name.unwrap_or_else(|| document.stem.clone()),
        shadow_bias,
        mesh,
        lights,
        camera,
        background: wire.background.map_or(PAPER_BACKGROUND, |colour| Vec3::from_array(colour.0)),
        display: Display {
            exposure: wire.display.exposure.map_or(display.exposure, |value| value.0),
            gamma: wire.display.gamma.map_or(display.gamma, |value| value.0),
        },
    })
}

fn default_bias(mesh: &Mesh) -> f32 {
    mesh.bounds().map_or(0.0, |(low, high)| RELATIVE_SHADOW_BIAS * high.distance(low))
}

fn light(wire: &LightWire) -> Light {
    let (position, power) = (wire.position.get_ref().0, wire.power.get_ref().0);
    Light { position: Vec3::from_array(position), power: Vec3::from_array(power) }
}

/// The camera: what the file leaves out is the paper's, or for a bare mesh the framing's.
fn camera(document: &Document, wire: &CameraWire, mesh: &Mesh, ball: Option<Ball>) -> Result<Camera> {
    let base = match ball {
        Some(ball) => framing::camera(mesh, ball),
        None => Camera { z_near: 0.0, ..Camera::PAPER },
    };
    let z_near = wire.z_near.map_or(base.z_near, |value| value.0);
    let fov = field_of_view(document, wire)?;
    let (tan_half_fov, fov_is_vertical) = fov.unwrap_or((base.tan_half_fov, base.fov_is_vertical));
    let lens = Camera { tan_half_fov, fov_is_vertical, z_near, ..base };
    if wire.position.is_none() && wire.look_at.is_none() && wire.up.is_none() {
        return Ok(lens);
    }
    let given =
        |v: &Option<toml::Spanned<super::wire::Vector>>| v.as_ref().map(|v| Vec3::from_array(v.get_ref().0));
    let position = given(&wire.position).unwrap_or(base.position);
    let ahead = ball.map_or(position + base.forward, |ball| ball.centre.as_vec3());
    let target = given(&wire.look_at).unwrap_or(ahead);
    let up = given(&wire.up).unwrap_or(Vec3::Y);
    let looking = Camera::looking_at(position, target, up, 90.0, false)
        .ok_or_else(|| no_direction(document, wire, position, target, up))?;
    Ok(Camera { tan_half_fov, fov_is_vertical, z_near, ..looking })
}

/// The tangent of half the field of view, and whether it spans the height.
fn field_of_view(document: &Document, wire: &CameraWire) -> Result<Option<(f32, bool)>> {
    let tangent = |degrees: f32| (f64::from(degrees).to_radians() / 2.0).tan() as f32;
    match (&wire.fov_x_degrees, &wire.fov_y_degrees) {
        (Some(_), Some(second)) => Err(document
            .error(second.span(), "both fov_x_degrees and fov_y_degrees", "the second field of view")
            .with_help("give one: the other follows from the image's shape")),
        (Some(fov), None) => Ok(Some((tangent(fov.get_ref().0), false))),
        (None, Some(fov)) => Ok(Some((tangent(fov.get_ref().0), true))),
        (None, None) => Ok(None),
    }
}

fn no_direction(document: &Document, wire: &CameraWire, position: Vec3, target: Vec3, up: Vec3) -> Error {
    let place = [&wire.up, &wire.look_at, &wire.position];
    let at =
        |order: [usize; 3]| order.iter().find_map(|&i| place[i].as_ref()).map_or(0..0, toml::Spanned::span);
    if position == target {
        let message = format!("the camera is at {position} and looks at the same point");
        return document.error(at([1, 2, 0]), message, "no direction").with_help("move position or look_at");
    }
    let message = format!("the camera's up {up} is zero or along its view {}", target - position);
    document
        .error(at([0, 1, 2]), message, "no upright")
        .with_help("give an `up` across the view, such as [0, 0, 1]")
}
