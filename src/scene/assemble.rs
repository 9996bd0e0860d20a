//! Makes a [`Scene`] from the types of the TOML file (`wire.rs`), and checks everything that these
//! types cannot check.

mod camera;
mod objects;
mod sky;
#[cfg(test)]
mod tests;

use super::document::Document;
use super::enclosed::encloses;
use super::files::{self, FileLight, Placement};
use super::frame_cache::FrameCache;
use super::studio::Studio;
use super::validate::{Brightness, check_camera, check_light, check_positions};
use super::wire::{BackgroundWire, LightWire, SceneWire};
use super::{
    Camera, Display, Light, Mesh, Orbit, PAPER_BACKGROUND, Scene, Shot, Textures, facing, framing, normals,
};
use crate::error::Result;
use crate::image::transform;
use camera::{base_camera, camera, field_of_view};
use framing::Ball;
use glam::{DVec3, Vec3};
use std::collections::HashSet;
use std::sync::Arc;

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

/// The scene that a document (the text of a scene file) describes, and what callers need beside the scene.
pub(super) struct Assembled {
    pub scene: Scene,
    /// The axis about which the scene turns on a turntable.
    pub orbit: Orbit,
    /// The index of the first triangle of each object. In a glTF file without a scene file, each node with a
    /// mesh counts as an object. A ground that raycl added counts as the last object.
    pub starts: Vec<u32>,
    /// True if raycl added soft light, a sky and usually a ground. raycl adds them only to a mesh that has no
    /// lights and that is given without a scene file.
    pub dressed: bool,
    /// True if the camera may depend on the pictures' aspect ratio, because raycl places it so that the whole
    /// scene is visible.
    pub is_framed: bool,
}

/// Builds the scene that a document describes, for the pictures that `shot` describes.
pub(super) fn assemble(
    document: &Document,
    wire: SceneWire,
    shot: Shot,
    cache: &mut FrameCache,
    notes: &mut Vec<String>,
) -> Result<Assembled> {
    let name = name(document, &wire)?;
    if let Some(most) = shot.most_triangles {
        objects::refuse_many(document, &wire.object, most)?;
    }
    let Joined { mut mesh, seen, mut starts } = cache.joined(|cache| join(document, &wire, cache, notes))?;
    if wire.textures == Some(false) && !mesh.textures.list.is_empty() {
        Arc::make_mut(&mut mesh).textures = Textures::default();
    }
    let framed = document.bare || wire.camera.is_framed();
    let around = (framed || shot.turns).then(|| Ball::around(&mesh, wire.camera.upright()));
    let ball = around.filter(|_| framed);
    let lens = field_of_view(document, &wire.camera)?;
    let base = base_camera(&wire.camera, lens, &mesh, ball, &seen, shot, notes);
    let camera = camera(document, &wire.camera, base, lens, ball)?;
    let eye = wire.camera.position.as_ref().map_or(0..0, toml::Spanned::span);
    check_camera(&camera).map_err(|error| document.located(eye, error, "this camera"))?;
    if wire.two_sided.unwrap_or(document.bare) {
        turn_normals(Arc::make_mut(&mut mesh), around, &camera, shot);
    }
    let bounds = cache.bounds(&mesh);
    notes.extend(too_small(document, bounds).into_iter().chain(too_far(document, bounds)));
    let shadow_bias = wire.shadow_bias.map_or_else(|| default_bias(bounds, camera.position), |bias| bias.0);
    let has_light = wire.light.is_some() || wire.sky.is_some() || !seen.lights.is_empty();
    let orbit = Orbit {
        centre: around.map_or(DVec3::ZERO, |ball| ball.centre),
        up: wire.camera.upright(),
        radius: around.map_or(1.0, |ball| ball.centre_and_radius().1),
        with_lights: document.bare && !has_light,
    };
    let around = ball.filter(|_| document.bare && shot.dressed && !has_light);
    let studio = around.map(|ball| Studio::around(&mesh, ball, &camera, wire.camera.upright()));
    let lights = match &studio {
        Some(studio) => studio.lights.clone(),
        None => lights(document, &wire, &seen, &camera, ball, notes),
    };
    let seen_from = (wire.camera.upright(), wire.background.is_none());
    let sky = wire.sky.as_ref().map(|sky| sky::build(document, sky, seen_from, cache, notes)).transpose()?;
    // If the user sets a background, the picture will probably be combined with another picture, so no ground is added.
    if let Some(ground) =
        studio.as_ref().and_then(|studio| studio.ground.clone()).filter(|_| wire.background.is_none())
    {
        starts.push(mesh.triangles.len() as u32);
        Arc::make_mut(&mut mesh).append(ground);
    }
    let brightness = Brightness::of(&mesh, cache.bounds(&mesh), lights.len(), shadow_bias);
    check_lights(document, &wire, &lights, &brightness)?;
    let display = display(&wire);
    let scene = Scene {
        name,
        shadow_bias,
        mesh,
        lights,
        sky: sky.or(studio.as_ref().map(|studio| studio.sky.clone())),
        camera,
        background: background(document, &wire, studio.as_ref(), display, notes),
        transparent: wire.is_transparent(),
        display,
    };
    let is_framed = framed && wire.camera.position.is_none();
    Ok(Assembled { scene, orbit, starts, dressed: studio.is_some(), is_framed })
}

/// Returns the scene's name. Refuses an empty name, since the names of result files contain the scene's name.
fn name(document: &Document, wire: &SceneWire) -> Result<String> {
    match &wire.name {
        None => Ok(document.stem.clone()),
        Some(name) if name.get_ref().trim().is_empty() => {
            Err(document.error(name.span(), "the name is empty", "some text belongs here"))
        }
        Some(name) => Ok(name.get_ref().clone()),
    }
}

/// Turns normals to the viewer. A scene on a turntable is seen from all sides, so either all of its normals
/// are reversed or none: if only some were reversed, dark surfaces would be visible at some angles. `around`
/// is the ball around the scene.
fn turn_normals(mesh: &mut Mesh, around: Option<Ball>, camera: &Camera, shot: Shot) {
    if !shot.turns {
        return normals::turn_towards(mesh, camera.position);
    }
    normals::turn_outwards(mesh);
    // In a room, the inner sides of the walls are visible at every angle. An open mesh, such as a sheet, has
    // no outside. In these two cases, the first view decides which side is lit.
    let has_outside = around.is_some_and(|ball| ball.is_closed()) && !encloses(mesh, camera.position);
    if !has_outside && facing::is_averted(mesh, camera, shot.aspect) {
        normals::reverse(mesh);
    }
}

fn display(wire: &SceneWire) -> Display {
    let usual = Display::default();
    Display {
        exposure: wire.display.exposure.map_or(usual.exposure, |value| value.0),
        gamma: wire.display.gamma.map_or(usual.gamma, |value| value.0),
    }
}

fn background(
    document: &Document,
    wire: &SceneWire,
    studio: Option<&Studio>,
    display: Display,
    notes: &mut Vec<String>,
) -> Vec3 {
    match wire.background {
        None => studio.map_or(PAPER_BACKGROUND, |studio| studio.background),
        Some(BackgroundWire::Radiance(radiance)) => Vec3::from_array(radiance),
        Some(BackgroundWire::Displayed(colour)) => {
            let radiance = display.radiance_of(colour);
            notes.extend(not_displayed(document, colour, radiance, display));
            radiance
        }
        // A transparent background adds no radiance. The radiance of a pixel is that of the visible surfaces,
        // multiplied by the share of the pixel that they cover.
        Some(BackgroundWire::Transparent) => Vec3::ZERO,
    }
}

/// Returns a note if the background's radiance is not displayed as `colour`, which the user wrote; otherwise
/// `None`.
fn not_displayed(document: &Document, colour: [u8; 3], radiance: Vec3, display: Display) -> Option<String> {
    let shown = radiance.to_array().map(|channel| transform(channel, display));
    let note = || {
        let name = |[red, green, blue]: [u8; 3]| format!("#{red:02x}{green:02x}{blue:02x}");
        let [wanted, shown] = [colour, shown].map(name);
        let Display { exposure, gamma } = display;
        format!(
            "{}: the background {wanted} is displayed as {shown}, since with display.exposure = {exposure:?} and \
             display.gamma = {gamma:?}, no radiance that a background may have is displayed as {wanted}",
            document.name
        )
    };
    (shown != colour).then(note)
}

/// The objects of a scene, joined into one mesh.
#[derive(Clone)]
pub(super) struct Joined {
    mesh: Arc<Mesh>,
    seen: Seen,
    /// The index of the first triangle of each object. In a glTF file without a scene file, each node with a
    /// mesh counts as an object.
    starts: Vec<u32>,
}

fn join(
    document: &Document,
    wire: &SceneWire,
    cache: &mut FrameCache,
    notes: &mut Vec<String>,
) -> Result<Joined> {
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
        let file = cache.mesh(number, made)?;
        let file = objects::placed(document, object.get_ref(), file);
        let first = mesh.triangles.len();
        if first + file.mesh.triangles.len() > super::shapes::MAX_TRIANGLES as usize {
            let message = format!(
                "the scene has more than {} triangles; use fewer objects, or objects with fewer triangles",
                super::shapes::MAX_TRIANGLES
            );
            return Err(document.error(object.span(), message, "this object exceeds the limit"));
        }
        check_positions(&file.mesh)
            .map_err(|error| document.located(object.span(), error, "of this object"))?;
        starts.push(first as u32);
        if document.bare {
            starts.extend(file.more_starts.iter().map(|start| start + first as u32));
            seen.camera_notes = file.camera_notes;
            seen.add(file.camera, file.lights);
        }
        mesh.append(file.mesh);
    }
    // Notes on a mesh that several objects use are kept only once.
    let mut known = HashSet::new();
    notes.retain(|note| known.insert(note.clone()));
    if mesh.triangles.is_empty() {
        return Err(document
            .error(0..0, "the scene has no triangles", "no [[object]] in this file")
            .with_help("add [[object]] with mesh = \"FILE\", shape = \"NAME\", or vertices and faces"));
    }
    Ok(Joined { mesh: mesh.into(), seen, starts })
}

/// Returns the lights of a scene. For a mesh without a scene file, these are the lights that the user sets.
/// If the user sets none, these are the lights of the mesh's own file. If this file has none and the user
/// sets no sky, these are a key light and a fill light.
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
            files::lights_of_file(&seen.lights, ball.centre_and_radius(), framing::key_at(ball))
        }
        (None, Some(ball)) if wire.sky.is_none() => framing::lights(camera, ball),
        (lights, _) => lights.iter().flatten().map(light).collect(),
    };
    if lights.is_empty() && wire.sky.is_none() {
        notes.push(format!(
            "{}: no light, so every surface is black; add [[light]] with position = [1, 3, 1] and power = 10",
            document.last_line()
        ));
    }
    lights
}

/// Refuses lights of the scene file that are too far away or too bright. The error has the light's location in the
/// file.
fn check_lights(
    document: &Document,
    wire: &SceneWire,
    lights: &[Light],
    brightness: &Brightness,
) -> Result<()> {
    for (wire, light) in wire.light.iter().flatten().zip(lights) {
        check_light(light).map_err(|error| document.located(wire.position.span(), error, "this light"))?;
        brightness
            .check(light)
            .map_err(|error| document.located(wire.power.span(), error, "too much for single precision"))?;
    }
    Ok(())
}

/// Returns a note if a scene with these bounds is so small that the kernels may miss its triangles. A mesh
/// without a scene file has no note, since it is scaled when it is read.
fn too_small(document: &Document, (low, high): (Vec3, Vec3)) -> Option<String> {
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
/// few of its points. A mesh without a scene file has no note, since it is moved to the origin when it is
/// read.
fn too_far(document: &Document, (low, high): (Vec3, Vec3)) -> Option<String> {
    // The diagonal is computed in double precision, since the squares of very small lengths are 0 in single precision.
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
fn default_bias((low, high): (Vec3, Vec3), eye: Vec3) -> f32 {
    let rounding = ROUNDING_SHADOW_BIAS * largest_coordinate(low.min(eye), high.max(eye));
    rounding.max(RELATIVE_SHADOW_BIAS * high.distance(low))
}

/// Returns the largest absolute value of the coordinates within these bounds.
fn largest_coordinate(low: Vec3, high: Vec3) -> f32 {
    low.abs().max(high.abs()).max_element()
}

fn light(wire: &LightWire) -> Light {
    let (position, power) = (wire.position.get_ref().0, wire.power.get_ref().0);
    let radius = wire.radius.map_or(0.0, |radius| radius.0);
    Light { position: Vec3::from_array(position), power: Vec3::from_array(power), radius }
}

/// The camera and the lights in the file of a mesh that is given without a scene file.
#[derive(Clone, Default)]
struct Seen {
    camera: Option<Camera>,
    /// Notes that are shown only if the camera of the mesh's file is used.
    camera_notes: Vec<String>,
    lights: Vec<FileLight>,
}

impl Seen {
    fn add(&mut self, camera: Option<Camera>, lights: Vec<FileLight>) {
        self.camera = self.camera.or(camera);
        self.lights.extend(lights);
    }
}
