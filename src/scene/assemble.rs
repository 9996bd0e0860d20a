//! Makes a [`Scene`] from the wire types, with the checks that TOML types cannot make.

mod objects;
mod sky;

use super::document::Document;
use super::files::{self, FileLight};
use super::kept::Kept;
use super::studio::Studio;
use super::validate::{Brightness, check_camera, check_light, check_positions};
use super::wire::{BackgroundWire, CameraWire, LightWire, SceneWire};
use super::{Camera, Display, Light, Mesh, Orbit, PAPER_BACKGROUND, Scene, Shot, Textures, framing, normals};
use crate::error::{Error, Result};
use framing::{Ball, View};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// The default shadow bias: this fraction of the scene's diagonal.
const RELATIVE_SHADOW_BIAS: f32 = 1e-4;

/// The result for a document.
pub(super) struct Assembled {
    pub scene: Scene,
    /// The axis of a turntable.
    pub orbit: Orbit,
    /// The number of each object's first triangle.
    pub starts: Vec<u32>,
    /// True if a ground, soft light and a sky were added to a bare mesh.
    pub dressed: bool,
}

/// Builds the scene that a document describes, for a shot.
pub(super) fn assemble(
    document: &Document,
    wire: SceneWire,
    shot: Shot,
    kept: &mut Kept,
    notes: &mut Vec<String>,
) -> Result<Assembled> {
    let Joined { mut mesh, seen, mut starts } = kept.joined(|kept| join(document, &wire, kept, notes))?;
    if wire.textures == Some(false) && !mesh.textures.list.is_empty() {
        Arc::make_mut(&mut mesh).textures = Textures::default();
    }
    let framed = document.bare || wire.camera.is_framed();
    let around = (framed || shot.turns).then(|| Ball::around(&mesh, wire.camera.upright()));
    let ball = around.filter(|_| framed);
    let base = base_camera(&wire.camera, &mesh, ball, &seen, shot, notes);
    let camera = camera(document, &wire.camera, base, ball)?;
    let eye = wire.camera.position.as_ref().map_or(0..0, toml::Spanned::span);
    check_camera(&camera).map_err(|error| document.place(eye, error, "this camera"))?;
    match wire.two_sided.unwrap_or(document.bare) {
        // A scene that is seen from all sides is turned as a whole; otherwise parts of it would be dark from
        // behind.
        true if shot.turns => normals::turn_outwards(Arc::make_mut(&mut mesh)),
        true => normals::turn_towards(Arc::make_mut(&mut mesh), camera.position),
        false => {}
    }
    let shadow_bias = wire.shadow_bias.map_or_else(|| default_bias(kept.bounds(&mesh)), |bias| bias.0);
    let has_light = wire.light.is_some() || wire.sky.is_some() || !seen.lights.is_empty();
    let orbit = Orbit {
        centre: around.map_or(DVec3::ZERO, |ball| ball.centre),
        up: wire.camera.upright(),
        with_lights: document.bare && !has_light,
    };
    let around = ball.filter(|_| document.bare && shot.dressed && !has_light);
    let studio = around.map(|ball| Studio::around(&mesh, ball, &camera, wire.camera.upright()));
    let lights = match &studio {
        Some(studio) => studio.lights.clone(),
        None => lights(document, &wire, &seen, &camera, ball, notes),
    };
    let is_seen = wire.background.is_none();
    let sky = wire.sky.as_ref().map(|sky| sky::build(document, sky, (wire.camera.upright(), is_seen), kept));
    let sky = sky.transpose()?;
    // A picture with a given background is probably to be combined with something else, so no ground is
    // added.
    if let Some(ground) =
        studio.as_ref().and_then(|studio| studio.ground.clone()).filter(|_| wire.background.is_none())
    {
        starts.push(mesh.triangles.len() as u32);
        Arc::make_mut(&mut mesh).append(ground);
    }
    let brightness = Brightness::of(&mesh, kept.bounds(&mesh), lights.len(), shadow_bias);
    check_lights(document, &wire, &lights, &brightness)?;
    let display = display(&wire);
    let scene = Scene {
        name: wire.name.clone().unwrap_or_else(|| document.stem.clone()),
        shadow_bias,
        mesh,
        lights,
        sky: sky.or(studio.as_ref().map(|studio| studio.sky.clone())),
        camera,
        background: background(&wire, studio.as_ref(), display),
        transparent: wire.is_transparent(),
        display,
    };
    Ok(Assembled { scene, orbit, starts, dressed: studio.is_some() })
}

fn display(wire: &SceneWire) -> Display {
    let usual = Display::default();
    Display {
        exposure: wire.display.exposure.map_or(usual.exposure, |value| value.0),
        gamma: wire.display.gamma.map_or(usual.gamma, |value| value.0),
    }
}

fn background(wire: &SceneWire, studio: Option<&Studio>, display: Display) -> Vec3 {
    match wire.background {
        None => studio.map_or(PAPER_BACKGROUND, |studio| studio.background),
        Some(BackgroundWire::Radiance(radiance)) => Vec3::from_array(radiance),
        Some(BackgroundWire::Displayed(colour)) => display.radiance_of(colour),
        // This is added to the surfaces' radiance, which is multiplied by the share of the pixel that they
        // cover.
        Some(BackgroundWire::Transparent) => Vec3::ZERO,
    }
}

/// The objects of a scene, joined into one mesh.
#[derive(Clone)]
pub(super) struct Joined {
    mesh: Arc<Mesh>,
    seen: Seen,
    /// The number of each object's first triangle.
    starts: Vec<u32>,
}

fn join(document: &Document, wire: &SceneWire, kept: &mut Kept, notes: &mut Vec<String>) -> Result<Joined> {
    let (mut mesh, mut seen, mut starts) = (Mesh::default(), Seen::default(), Vec::new());
    let crease = wire.crease.map(|crease| crease.0);
    for (number, object) in wire.object.iter().enumerate() {
        let made = || -> Result<_> {
            let mut file = objects::make(document, object, crease, notes)?;
            if wire.mip_levels != Some(false) {
                file.mesh.textures.add_levels();
            }
            Ok(file)
        };
        let file = kept.mesh(number, made)?;
        let file = objects::placed(document, object.get_ref(), file);
        let first = mesh.triangles.len();
        if first + file.mesh.triangles.len() > super::shapes::MAX_TRIANGLES as usize {
            let message = format!("more than {} triangles in all", super::shapes::MAX_TRIANGLES);
            return Err(document.error(object.span(), message, "this object exceeds the limit"));
        }
        check_positions(&file.mesh)
            .map_err(|error| document.place(object.span(), error, "of this object"))?;
        starts.push(first as u32);
        if document.bare {
            starts.extend(file.more_starts.iter().map(|start| start + first as u32));
            seen.camera_note = file.camera_note;
            seen.add(file.camera, file.lights, file.origin, notes);
        }
        mesh.append(file.mesh);
    }
    if mesh.triangles.is_empty() {
        return Err(document
            .error(0..0, "the scene has no triangles", "no [[object]] in this file")
            .with_help("add [[object]] with mesh = \"FILE\", shape = \"NAME\", or vertices and faces"));
    }
    Ok(Joined { mesh: mesh.into(), seen, starts })
}

/// Returns the lights of a scene. A bare mesh has those of its file, or a key light and a fill light.
fn lights(
    document: &Document,
    wire: &SceneWire,
    seen: &Seen,
    camera: &Camera,
    ball: Option<Ball>,
    notes: &mut Vec<String>,
) -> Vec<Light> {
    let lights = match (&wire.light, ball.filter(|_| document.bare)) {
        (None, Some(ball)) if !seen.lights.is_empty() => {
            files::lights_of_file(&seen.lights, ball.place(), framing::key_at(ball))
        }
        (None, Some(ball)) if wire.sky.is_none() => framing::lights(camera, ball),
        (lights, _) => lights.iter().flatten().map(light).collect(),
    };
    if lights.is_empty() && wire.sky.is_none() {
        notes.push(format!(
            "{}:{}: no light: every surface is black; add [[light]] with position = [1, 3, 1] and power = 10",
            document.name,
            document.text.lines().count()
        ));
    }
    lights
}

/// Refuses lights of the file that are too far away or too bright, with their locations in the file.
fn check_lights(
    document: &Document,
    wire: &SceneWire,
    lights: &[Light],
    brightness: &Brightness,
) -> Result<()> {
    for (wire, light) in wire.light.iter().flatten().zip(lights) {
        check_light(light).map_err(|error| document.place(wire.position.span(), error, "this light"))?;
        brightness
            .check(light)
            .map_err(|error| document.place(wire.power.span(), error, "too much for single precision"))?;
    }
    Ok(())
}

/// Returns the default shadow bias of surfaces within these bounds.
fn default_bias((low, high): (Vec3, Vec3)) -> f32 {
    RELATIVE_SHADOW_BIAS * high.distance(low)
}

fn light(wire: &LightWire) -> Light {
    let (position, power) = (wire.position.get_ref().0, wire.power.get_ref().0);
    let radius = wire.radius.map_or(0.0, |radius| radius.0);
    Light { position: Vec3::from_array(position), power: Vec3::from_array(power), radius }
}

/// The settings of a bare mesh's file that concern its view.
#[derive(Clone, Default)]
struct Seen {
    camera: Option<Camera>,
    /// A note that is shown only if this camera is used.
    camera_note: Option<String>,
    lights: Vec<FileLight>,
}

impl Seen {
    fn add(
        &mut self,
        camera: Option<Camera>,
        lights: Vec<FileLight>,
        origin: DVec3,
        notes: &mut Vec<String>,
    ) {
        self.camera = self.camera.or(camera);
        self.lights.extend(lights);
        if origin != DVec3::ZERO {
            let [x, y, z] = origin.to_array();
            notes.push(format!(
                "the mesh lies far from its origin: ({x}, {y}, {z}) was subtracted from its positions"
            ));
        }
    }
}

impl CameraWire {
    /// Returns whether the camera is placed so that it sees the whole scene from an angle.
    fn is_framed(&self) -> bool {
        self.azimuth_degrees.is_some() || self.elevation_degrees.is_some()
    }

    /// Returns the scene's upward direction.
    fn upright(&self) -> DVec3 {
        let given = self.up.as_ref().map(|up| Vec3::from_array(up.get_ref().0).as_dvec3());
        given.and_then(DVec3::try_normalize).unwrap_or(DVec3::Y)
    }
}

/// Returns the camera that the file's keys modify: the paper's; for a framed scene, the camera of the mesh's
/// file or one that sees the whole scene.
fn base_camera(
    wire: &CameraWire,
    mesh: &Mesh,
    ball: Option<Ball>,
    seen: &Seen,
    shot: Shot,
    notes: &mut Vec<String>,
) -> Camera {
    let Some(ball) = ball else { return Camera { z_near: 0.0, ..Camera::PAPER } };
    if let Some(camera) = seen.camera.filter(|_| !wire.is_framed() && wire.up.is_none()) {
        notes.extend(seen.camera_note.clone());
        return camera;
    }
    let degrees = |azimuth: Option<f32>| azimuth.map(f64::from);
    let view = View {
        up: wire.upright(),
        azimuth_degrees: degrees(wire.azimuth_degrees.map(|azimuth| azimuth.0)),
        elevation_degrees: degrees(wire.elevation_degrees.map(|elevation| elevation.0)),
        shot,
    };
    framing::camera(mesh, ball, &view)
}

/// Returns the camera; keys that are missing from the file are taken from the base camera.
fn camera(document: &Document, wire: &CameraWire, base: Camera, ball: Option<Ball>) -> Result<Camera> {
    let z_near = wire.z_near.map_or(base.z_near, |value| value.0);
    let fov = field_of_view(document, wire)?;
    let (tan_half_fov, fov_is_vertical) = fov.unwrap_or((base.tan_half_fov, base.fov_is_vertical));
    let lens = Camera { tan_half_fov, fov_is_vertical, z_near, ..base };
    if wire.position.is_none() && wire.look_at.is_none() && (wire.up.is_none() || ball.is_some()) {
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

/// Returns the tangent of half the field of view, and whether it applies to the height.
fn field_of_view(document: &Document, wire: &CameraWire) -> Result<Option<(f32, bool)>> {
    let tangent = |degrees: f32| (f64::from(degrees).to_radians() / 2.0).tan() as f32;
    match (&wire.fov_x_degrees, &wire.fov_y_degrees) {
        (Some(_), Some(second)) => Err(document
            .error(second.span(), "both fov_x_degrees and fov_y_degrees", "the second field of view")
            .with_help("set only one: the other follows from the image's shape")),
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
    let message = format!("the camera's up {up} is zero or parallel to its view {}", target - position);
    document
        .error(at([0, 1, 2]), message, "no upright")
        .with_help("choose an `up` that is not parallel to the view, such as [0, 0, 1]")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use crate::scene::load_scene_with;
    use glam::Vec3;
    use std::path::Path;
    use toml::Value;

    /// A triangle, and a camera in front of it.
    const SEEN: &str = r#"{"asset": {"version": "2.0"},
"scenes": [{"nodes": [0, 1]}],
"nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 5]}],
"cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
"buffers": [{"byteLength": 36, "uri":
"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
"bufferViews": [{"buffer": 0, "byteLength": 36}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
"min": [0, 0, 0], "max": [1, 1, 0]}]}"#;

    #[test]
    fn only_added_lights_turn_with_the_camera() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        let turns = |text: &str| {
            std::fs::write(&path, text).unwrap();
            load_scene_with(&path, &[]).unwrap().orbit.with_lights
        };
        assert!(turns(SEEN));
        let light =
            r#"{"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 2}]}}, "#;
        let lit = SEEN.replacen('{', light, 1);
        let at = r#"{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}"#;
        assert!(!turns(&lit.replace(r#"{"mesh": 0}"#, at)));
    }

    #[test]
    fn a_sky_replaces_the_lights_of_a_bare_mesh() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let zenith = ("sky.zenith".to_owned(), Value::Float(0.5));
        let scene = load_scene_with(&path, &[zenith]).unwrap().scene;
        assert!(scene.lights.is_empty() && scene.sky.is_some(), "{:?}", scene.lights);
    }

    #[test]
    fn the_camera_of_a_file_counts_unless_an_upward_direction_is_given() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, SEEN).unwrap();
        let camera = |values: &[(String, Value)]| load_scene_with(&path, values).unwrap().scene.camera;
        let of_file = camera(&[]);
        assert_eq!((of_file.position, of_file.up), (Vec3::Z * 5.0, Vec3::Y));
        let up = Value::Array([0, 0, 1].map(Value::Integer).to_vec());
        let framed = camera(&[("camera.up".to_owned(), up)]);
        assert!(framed.up.z > 0.9, "{}", framed.up);
    }

    #[test]
    fn a_file_of_several_cameras_is_noted_only_if_one_of_them_is_used() {
        let folder = tempfile::tempdir().unwrap();
        let [path, scene] = ["a.gltf", "a.toml"].map(|name| folder.path().join(name));
        let two = SEEN.replace(r#"{"camera": 0, "#, r#"{"camera": 0}, {"camera": 0, "#);
        std::fs::write(&path, two.replace("[0, 1]", "[0, 1, 2]")).unwrap();
        let text = "[[light]]\nposition = [1, 3, 5]\npower = 60\n[[object]]\nmesh = \"a.gltf\"\n";
        std::fs::write(&scene, text).unwrap();
        let notes = |path: &Path, values: &[(String, Value)]| load_scene_with(path, values).unwrap().notes;
        let note = format!("{}: of 2 cameras, the first is used", path.display());
        assert_eq!(notes(&path, &[]), [note]);
        let up = Value::Array([0, 0, 1].map(Value::Integer).to_vec());
        for value in [("camera.up".to_owned(), up), ("camera.azimuth_degrees".to_owned(), Value::Float(90.0))]
        {
            assert_eq!(notes(&path, &[value]), [""; 0]);
        }
        let unused =
            format!("{}: its cameras and lights are not used: those of the scene are", path.display());
        assert!(notes(&scene, &[]).contains(&unused));
        assert!(!notes(&scene, &[]).iter().any(|note| note.contains("of 2 cameras")));
    }

    #[test]
    fn a_camera_with_a_position_only_looks_at_the_middle_of_the_mesh() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        std::fs::write(&path, "v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n").unwrap();
        // Without a position, the camera would look along -z, at the triangle's front.
        let behind = Value::Array([1, 1, -5].map(Value::Integer).to_vec());
        let scene = load_scene_with(&path, &[("camera.position".to_owned(), behind)]).unwrap().scene;
        assert!(scene.camera.forward.distance(Vec3::Z) < 1e-6, "{}", scene.camera.forward);
    }

    #[test]
    fn the_crease_of_an_object_counts_before_that_of_the_scene() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        // The two faces of the roof meet at 90 degrees.
        let roof =
            "vertices = [[0, 0, -1], [0, 0, 1], [1, -1, 0], [-1, -1, 0]]\nfaces = [[0, 1, 2], [1, 0, 3]]";
        let sharp = Vec3::new(1.0, 1.0, 0.0).normalize();
        for (of_scene, own, expected) in [(100, 40, sharp), (40, 100, Vec3::Y)] {
            let text = format!("crease = {of_scene}\n[[object]]\n{roof}\ncrease = {own}\n");
            std::fs::write(&path, text).unwrap();
            let mesh = load_scene_with(&path, &[]).unwrap().scene.mesh;
            let at_ridge = mesh.corner_normals(&mesh.triangles[0])[0];
            assert!(at_ridge.distance(expected) < 1e-6, "{of_scene}, {own}: {at_ridge}");
        }
    }
}
