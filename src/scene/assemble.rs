//! Makes a [`Scene`] from the values of a scene file, which are parsed into the types of `wire.rs`. Also makes
//! checks that these types cannot make, for example whether keys fit together.

mod camera;
mod lights;
mod notes;
mod objects;
mod precision;
mod sky;
#[cfg(test)]
mod tests;

use super::coarse::{is_coarse, is_lifted};
use super::document::Document;
use super::enclosed::encloses;
use super::files::{self, FileLight, MeshFile};
use super::frame_cache::FrameCache;
use super::framing::Ball;
use super::setting::error_in;
use super::studio::Studio;
use super::validate::{Brightness, check_positions};
use super::wire::{BackgroundWire, SceneWire};
use super::{Camera, Display, Mesh, Orbit, PAPER_BACKGROUND, Scene, Shot, facing, normals};
use crate::error::Result;
use crate::image::transform;
use crate::printer::line;
use camera::camera;
use glam::{DVec3, Vec3};
use lights::{check_lights, lights, note_dark};
pub(super) use notes::Notes;
use precision::{default_bias, too_small};
use std::collections::HashSet;
use std::sync::Arc;

/// The scene that a document (the text of a scene file) describes, and further data that callers need.
pub(super) struct Assembled {
    pub scene: Scene,
    /// The axis about which the scene turns on a turntable.
    pub orbit: Orbit,
    /// The index of the first triangle of each object. In a glTF file without a scene file, each node with a
    /// mesh counts as an object. A ground that raycl added counts as the last object.
    pub starts: Vec<u32>,
    /// Number of triangles, not counting those of a ground that raycl added.
    pub own_triangles: usize,
    /// True if raycl added soft light, a sky and usually a ground. raycl adds them only to a bare mesh that has
    /// neither lights nor a sky.
    pub dressed: bool,
    /// True if the scene file or a setting sets the camera's position.
    pub eye_is_set: bool,
    /// True if the camera may depend on the pictures' aspect ratio. Two conditions must hold. First, the scene is a
    /// bare mesh, or sets an azimuth or an elevation. Second, the scene does not set the camera's position. raycl then
    /// places the camera so that the whole scene is visible, unless the file of a bare mesh has a camera.
    pub is_framed: bool,
    /// True if raycl reverses normals that face away from the camera.
    pub two_sided: bool,
    pub notes: Notes,
}

/// Builds the scene that a document describes, for the pictures that `shot` describes.
pub(super) fn assemble(
    document: &Document,
    mut wire: SceneWire,
    shot: Shot,
    cache: &mut FrameCache,
) -> Result<Assembled> {
    let name = name(document, &wire)?;
    if let Some(most) = shot.most_triangles {
        objects::refuse_many(document, &wire.object, most)?;
    }
    let Joined { mut mesh, origin, seen, mut starts, notes: of_objects, mut idle } =
        cache.joined(|cache| join(document, &wire, cache))?;
    wire.set_origin(origin);
    let mut notes = Vec::new();
    if document.bare && mesh.is_emissive() {
        notes.push("surfaces that emit light do not light other surfaces".to_owned());
    }
    if document.bare && wire.light.is_none() {
        notes.extend(seen.light_notes.iter().cloned());
        notes.extend(files::note_lights(&seen.lights, mesh.is_emissive()));
    }
    let framed = document.bare || wire.camera.is_framed();
    let around = (framed || shot.turns).then(|| Ball::around(&mesh, wire.camera.upright()));
    let ball = around.filter(|_| framed);
    let camera = camera(document, &wire.camera, &mesh, ball, &seen, shot, &mut notes)?;
    let two_sided = wire.two_sided.unwrap_or(document.bare);
    if two_sided {
        turn_normals(Arc::make_mut(&mut mesh), around, &camera, shot);
    }
    let bounds = cache.bounds(&mesh);
    notes.extend(too_small(document, bounds));
    let shadow_bias = wire.shadow_bias.map_or_else(|| default_bias(bounds, camera.position), |bias| bias.0);
    let has_light = wire.light.is_some() || wire.sky.is_some() || !seen.lights.is_empty();
    let orbit = orbit(around, wire.camera.upright(), document.bare && !has_light);
    let dressed = ball.filter(|_| document.bare && shot.dressed && !has_light);
    let studio = dressed.map(|ball| Studio::around(&mesh, ball, &camera, wire.camera.upright()));
    let smooth_shadows =
        wire.smooth_shadows.unwrap_or_else(|| dressed.is_some_and(|ball| is_coarse(&mesh, ball)));
    idle.extend(note_smooth_shadows(document, &wire, &mesh));
    let lights = lights(document, &wire, &seen, &camera, ball, studio.as_ref(), &mut notes);
    let seen_from = (wire.camera.upright(), wire.background.is_none());
    let sky =
        wire.sky.as_ref().map(|sky| sky::build(document, sky, seen_from, cache, &mut notes)).transpose()?;
    let dark = note_dark(document, &lights, sky.as_ref(), bounds).filter(|_| studio.is_none());
    let own_triangles = mesh.triangles.len();
    studio.iter().for_each(|studio| add_ground(studio, &wire, &mut mesh, &mut starts));
    let brightness = Brightness::of(&mesh, cache.bounds(&mesh), lights.len(), shadow_bias);
    check_lights(document, &wire, &lights, &brightness)?;
    let display = display(&wire);
    let scene = Scene {
        name,
        shadow_bias,
        smooth_shadows,
        mesh,
        lights,
        sky: sky.or(studio.as_ref().map(|studio| studio.sky.clone())),
        camera,
        background: background(document, &wire, studio.as_ref(), display, &mut notes),
        transparent: wire.is_transparent(),
        display,
    };
    let eye_is_set = wire.camera.position.is_some();
    let is_framed = framed && !eye_is_set;
    let dressed = studio.is_some();
    let notes = Notes { of_objects, others: notes, idle, dark };
    Ok(Assembled { scene, orbit, starts, own_triangles, dressed, eye_is_set, is_framed, two_sided, notes })
}

impl Assembled {
    /// Adds a note if most of the visible surface faces away from the camera. If raycl reverses normals and the scene
    /// is not on a turntable, no surface faces away.
    pub fn note_averted(&mut self, shot: Shot) {
        if !self.two_sided || shot.turns {
            let objects = (&self.starts[..], self.own_triangles);
            self.notes.others.extend(facing::note(
                &self.scene,
                objects,
                shot,
                self.two_sided,
                self.eye_is_set,
            ));
        }
    }
}

/// Returns the scene's name. Refuses an empty name, since the names of result files contain the scene's name.
/// Lines of results contain the name too, so a line break in the name could forge a line. Control characters
/// and invisible characters are therefore replaced by escapes such as `\u000a`.
fn name(document: &Document, wire: &SceneWire) -> Result<String> {
    let name = match &wire.name {
        None => &document.stem,
        Some(name) if name.get_ref().trim().is_empty() => {
            return Err(document.error(name.span(), "the name is empty", "some text belongs here"));
        }
        Some(name) => name.get_ref(),
    };
    Ok(line(name).into_owned())
}

/// Returns a note if the scene asks for smooth shadows, and they change nothing.
fn note_smooth_shadows(document: &Document, wire: &SceneWire, mesh: &Mesh) -> Option<String> {
    let origin = || document.setting_of("smooth_shadows").unwrap_or_else(|| document.name.clone());
    let note = || format!("{}: smooth_shadows has no effect: no surface is both smooth and convex", origin());
    (wire.smooth_shadows == Some(true) && !is_lifted(mesh)).then(note)
}

/// Returns the turntable of a scene. `around` is the ball around the scene; `None` if the ball was not
/// computed. `up` is the scene's upward direction.
fn orbit(around: Option<Ball>, up: DVec3, with_lights: bool) -> Orbit {
    let (centre, radius) = around.map_or((DVec3::ZERO, 1.0), |ball| ball.centre_and_radius());
    Orbit { centre, up, radius, with_lights }
}

/// Reverses the normals of triangles that face away from the camera. A scene on a turntable is seen from all
/// sides, so either all of its normals are reversed or none. If only some of the scene's normals were
/// reversed, dark surfaces would be visible at some angles. `around` is the ball around the scene.
fn turn_normals(mesh: &mut Mesh, around: Option<Ball>, camera: &Camera, shot: Shot) {
    if !shot.turns {
        return normals::turn_towards(mesh, camera.position);
    }
    normals::turn_outwards(mesh);
    // In a room, the camera sees the inner sides of the walls at all angles of the turntable. An open mesh, such as a
    // sheet, has no outside. In a room and for an open mesh, the turntable's first view decides which side is lit.
    let has_outside = around.is_some_and(|ball| ball.is_closed()) && !encloses(mesh, camera.position);
    if !has_outside && facing::is_averted(mesh, camera, shot.aspect) {
        normals::reverse(mesh);
    }
}

/// Appends the ground of a studio (the default surroundings of a bare mesh) to the mesh, as the last object.
/// If the user sets a background, the picture will probably be combined with another picture, so no ground is
/// added.
fn add_ground(studio: &Studio, wire: &SceneWire, mesh: &mut Arc<Mesh>, starts: &mut Vec<u32>) {
    let Some(ground) = studio.ground.clone().filter(|_| wire.background.is_none()) else { return };
    starts.push(mesh.triangles.len() as u32);
    Arc::make_mut(mesh).append(ground);
}

fn display(wire: &SceneWire) -> Display {
    let usual = Display::default();
    Display {
        exposure: wire.display.exposure.map_or(usual.exposure, |value| value.0),
        tone: wire.display.tone.unwrap_or(usual.tone),
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
        let Display { exposure, tone, gamma } = display;
        format!(
            "{}: the background is displayed as {shown}, not as {wanted}: with display.exposure = {exposure:?}, \
             display.gamma = {gamma:?} and display.tone = {:?}, no allowed radiance of a background is displayed as {wanted}",
            document.name,
            tone.name()
        )
    };
    (shown != colour).then(note)
}

/// The objects of a scene, joined into one mesh.
#[derive(Clone)]
pub(super) struct Joined {
    mesh: Arc<Mesh>,
    /// The scene's origin in the coordinates of the scene file; zero unless the scene lies far from the file's origin.
    origin: DVec3,
    seen: Seen,
    /// The index of the first triangle of each object. In a glTF file without a scene file, each node with a
    /// mesh counts as an object.
    starts: Vec<u32>,
    /// The notes on the objects, each text once.
    notes: Vec<String>,
    /// The notes on the objects' settings that have no effect.
    idle: Vec<String>,
}

fn join(document: &Document, wire: &SceneWire, cache: &mut FrameCache) -> Result<Joined> {
    let (mut mesh, mut seen, mut starts) = (Mesh::default(), Seen::default(), Vec::new());
    let files = made(document, wire, cache)?;
    let origin = objects::origin(document, &wire.object, &files);
    let mut notes: Vec<String> = files.iter().flat_map(|file| file.notes.iter().cloned()).collect();
    let idle = objects::unused_creases(document, wire, &files);
    for (object, file) in wire.object.iter().zip(files) {
        notes.extend(objects::note_inexact(document, object, &file, origin));
        let file = objects::placed(object.get_ref(), file, origin);
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
            seen.add(file.camera, (file.camera_aspect, file.camera_notes), (file.lights, file.light_notes));
        }
        mesh.append(file.mesh);
    }
    // Notes on a mesh that several objects use are kept only once.
    let mut known = HashSet::new();
    notes.retain(|note| known.insert(note.clone()));
    if mesh.triangles.is_empty() {
        let message = "the scene has no triangles";
        return Err(document
            .setting_of("object")
            .map_or_else(
                || document.error(0..0, message, "no [[object]] in this file"),
                |setting| error_in(&setting, message),
            )
            .with_help("add [[object]] with mesh = \"FILE\", shape = \"NAME\", or vertices and faces"));
    }
    mesh.darken_unused_materials();
    Ok(Joined { mesh: mesh.into(), origin, seen, starts, notes, idle })
}

/// Returns the mesh of each object in the object's own coordinates.
fn made(document: &Document, wire: &SceneWire, cache: &mut FrameCache) -> Result<Vec<MeshFile>> {
    let alone = objects::is_alone(document, &wire.object);
    let mut one = |(number, object)| {
        cache.mesh(number, || {
            let mut file = objects::make(document, wire, object, alone)?;
            if !document.bare && wire.two_sided.is_none() {
                let note = objects::note_double_sided(document, object.get_ref(), file.double_sided);
                file.notes.extend(note);
            }
            // Textures are left out before the object's `material` is applied. Without its emission texture,
            // a surface emits only the light that the object's `material` sets (`emitted`).
            if wire.textures == Some(false) {
                file.mesh.leave_out_textures();
            } else if wire.mip_levels != Some(false) {
                file.mesh.add_levels();
            }
            Ok(file)
        })
    };
    wire.object.iter().enumerate().map(&mut one).collect()
}

/// The camera and the lights of the objects' mesh files. Only glTF files can contain a camera or lights.
#[derive(Clone, Default)]
struct Seen {
    camera: Option<Camera>,
    /// The ratio of a picture's width to its height for which this camera is meant; `None` if the file has none.
    camera_aspect: Option<f32>,
    /// Notes that are shown only if the camera of the mesh's file is used.
    camera_notes: Vec<String>,
    lights: Vec<FileLight>,
    /// Notes that are shown only if the lights of the mesh's file are used.
    light_notes: Vec<String>,
}

impl Seen {
    /// Adds the camera and the lights of a mesh's file. Of the cameras of several files, the first is used.
    fn add(
        &mut self,
        camera: Option<Camera>,
        (aspect, notes): (Option<f32>, Vec<String>),
        (lights, light_notes): (Vec<FileLight>, Vec<String>),
    ) {
        if self.camera.is_none() {
            (self.camera, self.camera_aspect, self.camera_notes) = (camera, aspect, notes);
        }
        self.lights.extend(lights);
        self.light_notes.extend(light_notes);
    }
}
