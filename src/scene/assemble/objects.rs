//! Makes the mesh of one `[[object]]` from a mesh file, a generated shape or inline triangles. Also transforms the
//! mesh, and sets its materials.

use crate::error::{Error, Result, broken_link, nearest_file_among, or_meant};
use crate::filetype::{MeshFormat, Opened, Wanted};
use crate::memory::Available;
use crate::reader::lies_in;
use crate::scene::document::{BARE_CREASE_DEGREES, Document};
use crate::scene::files::{self, MeshFile, Part, Placement, is_valid};
use crate::scene::material::{PAPER_GLOSSY, PAPER_SHININESS, WHITE_RADIANCE};
use crate::scene::normals::{self, MISSING};
use crate::scene::obj::Permitted;
use crate::scene::shapes::{self, Shape};
use crate::scene::transform::Transform;
use crate::scene::wire::{MaterialWire, ObjectWire, Position, SceneWire, Whole};
use crate::scene::{Material, MaterialKind, Mesh, Triangle, obj};
use crate::words::{counted, counted_are};
use glam::{DVec3, Vec3};
use std::ops::Range;
use std::path::Path;
use toml::Spanned;

/// Returns true if the scene is a single bare mesh. raycl may move and scale such a mesh while reading it. If the user
/// adds objects to a bare mesh, all meshes keep the positions and sizes that their files state, as in a scene file.
pub(super) fn is_alone(document: &Document, objects: &[Spanned<ObjectWire>]) -> bool {
    document.bare && matches!(objects, [only] if only.get_ref().obj.is_some())
}

/// The values of a scene file that decide how a mesh is shown.
struct Look {
    /// False if the scene leaves out textures.
    textures: bool,
    /// True if the object's `material` replaces the colours of the mesh.
    is_painted: bool,
    /// The crease angle in degrees, of the object or else of the scene; `None` if all edges are smooth.
    crease: Option<f32>,
    /// True if each triangle gets the normal of its plane.
    flat: bool,
}

impl Look {
    fn of(scene: &SceneWire, object: &ObjectWire) -> Self {
        let crease = object.crease.as_ref().or(scene.crease.as_ref());
        Self {
            textures: scene.textures != Some(false),
            is_painted: object.material.as_ref().is_some_and(|material| material.k_l.is_some()),
            crease: crease.map(|crease| crease.get_ref().0),
            flat: object.flat,
        }
    }

    /// Returns true if the scene uses the part `part` of a mesh file.
    fn uses(&self, part: Part) -> bool {
        match part {
            Part::Textures => self.textures,
            Part::TintedTextures => self.textures && !self.is_painted,
            Part::VertexColours => !self.is_painted,
            // A crease angle of 0 makes all edges sharp.
            Part::SmoothEdges => !self.flat && self.crease != Some(0.0),
        }
    }

    /// Returns true if all edges are smooth where a mesh file has no normals.
    fn is_smooth(&self) -> bool {
        self.crease.is_none() && !self.flat
    }
}

/// Returns the object's mesh in the object's own coordinates, with normals. `alone` is true for a single bare mesh
/// ([`is_alone`]).
pub(super) fn make(
    document: &Document,
    scene: &SceneWire,
    object: &Spanned<ObjectWire>,
    alone: bool,
) -> Result<MeshFile> {
    let (wire, span) = (object.get_ref(), object.span());
    refuse_strays(document, wire)?;
    let made = |mesh| MeshFile { mesh, ..MeshFile::default() };
    let look = Look::of(scene, wire);
    let mut file = match (&wire.obj, &wire.shape, &wire.vertices) {
        (Some(file), None, None) => {
            let beyond = wire.outside_materials.as_ref().is_some_and(|allowed| *allowed.get_ref());
            read_file(document, file, beyond, alone, &look)?
        }
        (None, Some(name), None) => {
            let shape = shape(document, wire, name)?;
            room_for(&shape).map_err(|error| {
                document.located(name.span(), error, "this shape has too many triangles for this machine")
            })?;
            made(shapes::generate(&shape))
        }
        (None, None, Some(vertices)) => inline(document, wire, vertices)?,
        _ => {
            let message = "an object is one of: mesh = \"FILE\", shape = \"NAME\", vertices and faces";
            return Err(document.error(span, message, "this object has none or several of them"));
        }
    };
    file.creased = normals::complete(&mut file.mesh, look.crease) && !wire.flat;
    if wire.flat {
        normals::flatten(&mut file.mesh);
    }
    Ok(file)
}

/// Returns a note on each crease angle that has no effect: that of an object without generated normals, and that of the
/// scene if no object uses it. The default of a bare mesh causes no note. `files` has the mesh of each object.
pub(super) fn unused_creases(document: &Document, scene: &SceneWire, files: &[MeshFile]) -> Vec<String> {
    let objects = || scene.object.iter().map(Spanned::get_ref).zip(files);
    let own = objects().filter(|(_, file)| !file.creased).filter_map(|(object, _)| {
        let reason =
            if object.flat { "the object is flat" } else { "all corners of the object have normals" };
        Some((object.crease.as_ref()?.span(), reason))
    });
    let uses_that_of_scene =
        |(object, file): (&ObjectWire, &MeshFile)| object.crease.is_none() && file.creased;
    let of_scene = scene.crease.as_ref().map(Spanned::span);
    let of_scene = of_scene.filter(|span| document.is_written(span) && !objects().any(uses_that_of_scene));
    let reason = match &scene.object[..] {
        [only] if only.get_ref().crease.is_some() => "the object has a crease angle of its own",
        [_] => "the object has normals at all corners, or is flat (as is a glTF without normals)",
        _ => {
            "each object has normals at all corners, is flat (as is a glTF without normals), or has a crease angle of \
             its own"
        }
    };
    own.chain(of_scene.map(|span| (span, reason)))
        .map(|(span, reason)| {
            format!("{}: this crease angle has no effect, since {reason}", document.location_of(&span))
        })
        .collect()
}

fn transform(wire: &ObjectWire) -> Transform {
    let vector = |values: Option<[f32; 3]>, default| values.map_or(default, Vec3::from_array);
    Transform {
        scale: vector(wire.scale.map(|v| v.0), Vec3::ONE),
        rotation_degrees: vector(wire.rotation.map(|v| v.0), Vec3::ZERO),
        translation: wire.translation.map_or(DVec3::ZERO, |translation| translation.in_file),
    }
}

/// Returns the origin of a scene with these objects, in the file's coordinates: zero, unless the scene is far from the
/// file's origin. The result is zero for a single bare mesh, too: if it was far from its file's origin, it was moved
/// when its file was read.
pub(super) fn origin(document: &Document, objects: &[Spanned<ObjectWire>], files: &[MeshFile]) -> DVec3 {
    if is_alone(document, objects) {
        return DVec3::ZERO;
    }
    let bounds = objects.iter().zip(files).filter_map(|(wire, file)| {
        let (low, high) = file.mesh.bounds()?;
        let in_file = [low, high].map(|corner| corner.as_dvec3() + file.placement.origin);
        Some(transform(wire.get_ref()).bounds(in_file.into()))
    });
    let all = bounds.reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
    // Positions that are not valid stay where they are; the caller refuses them.
    let movable = all.filter(|(low, high)| is_valid(low) && is_valid(high));
    movable.map_or(DVec3::ZERO, |(low, high)| Placement::of(low, high).origin)
}

/// Returns a note if the object's place in the scene makes the shapes of many triangles inexact. The scene's origin is
/// at `origin` in the scene file's coordinates.
pub(super) fn note_inexact(
    document: &Document,
    wire: &Spanned<ObjectWire>,
    file: &MeshFile,
    origin: DVec3,
) -> Option<String> {
    let (transform, from) = (transform(wire.get_ref()), file.placement.origin);
    if transform == Transform::IDENTITY && from == origin {
        return None;
    }
    let placed = transform.placing(from, origin);
    let note =
        files::note_rounded(&file.mesh.triangles, |index| placed(file.mesh.positions[index as usize]))?;
    Some(format!("{}: {note}", document.location_of(&wire.span())))
}

/// Transforms the object's triangles to the coordinates of the scene, whose origin is at `origin` in the scene
/// file's coordinates. Moves the camera and the lights of the object's file to these coordinates. Converts the
/// emitted light of the object's file to the scene's unit of radiance. Applies the object's `material` to the
/// triangles.
pub(super) fn placed(wire: &ObjectWire, mut file: MeshFile, origin: DVec3) -> MeshFile {
    let from = file.placement.origin;
    let mut transform = transform(wire);
    if origin == DVec3::ZERO && from == DVec3::ZERO {
        // Neither the scene nor the mesh has an origin of its own. The translation is then rounded to single precision,
        // in which the positions of the mesh, of cameras and of lights are stored, too.
        transform.translation = transform.translation.as_vec3().as_dvec3();
    }
    transform.apply(&mut file.mesh, from, origin);
    file.place_seen(&Placement { origin: origin - from, scale: 1.0 });
    file.mesh.materials.iter_mut().for_each(|material| material.emitted *= WHITE_RADIANCE);
    if let Some(material) = &wire.material {
        file.mesh.materials.iter_mut().for_each(|base| *base = paint(base, material));
        // A `k_l` in the scene file replaces the colours of the mesh, even colours that vary within
        // triangles.
        if material.k_l.is_some() {
            file.mesh.corner_colours.clear();
        }
    }
    file
}

/// Returns the material `base` with the values that the scene file sets. If the file sets only one of k_g and
/// shininess, the other one gets the paper's value.
fn paint(base: &Material, wire: &MaterialWire) -> Material {
    let lambertian = wire.k_l.map_or(base.lambertian, |k| Vec3::from_array(k.0));
    let emitted = wire.emitted.map_or(base.emitted, |radiance| Vec3::from_array(radiance.0));
    let diffuse = Material { lambertian, emitted, ..*base };
    if wire.k_g.is_none() && wire.shininess.is_none() {
        return diffuse;
    }
    let glossy = wire.k_g.map_or(Vec3::splat(PAPER_GLOSSY), |k| Vec3::from_array(k.0));
    let shininess = wire.shininess.map_or(PAPER_SHININESS, |s| s.0);
    Material { glossy, shininess, kind: MaterialKind::BlinnPhong, ..diffuse }
}

/// Reads an object's mesh. Adds notes on the file, except on parts that `look` leaves out or replaces.
fn read_file(
    document: &Document,
    file: &Spanned<String>,
    beyond: bool,
    alone: bool,
    look: &Look,
) -> Result<MeshFile> {
    let path = document.folder.join(file.get_ref());
    if !document.bare && !path.is_file() {
        return Err(no_mesh(document, file, &path));
    }
    let opened = document
        .open(&path)
        .map_err(|error| Error::unreadable("mesh", &path, &error, "give the path of a mesh"))?;
    refuse_foreign(document, file, &path, &opened)?;
    // Messages may quote a bare mesh if `document.quotes` is true. If a scene file names the mesh, messages may
    // quote the mesh only if it is in the scene file's folder.
    let quotes = if document.bare { document.quotes } else { lies_in(&path, &document.folder) };
    let format = files::format(&opened, &path);
    // `Document::unexpected_ending` makes this note for a bare mesh.
    let is_unexpected = !document.bare && format.is_some();
    let ending = is_unexpected.then(|| files::unexpected_ending(format, &path)).flatten();
    let format = format.unwrap_or(MeshFormat::Obj);
    let mut read = files::read(&path, opened, format, Permitted { beyond, quotes, scaled: alone })?;
    read.notes.splice(0..0, ending);
    read.keep_notes(|part| look.uses(part));
    match alone {
        // After this step, the coordinates of the moved and scaled mesh count as those of the file.
        true => read.notes.extend(std::mem::take(&mut read.placement).notes()),
        false => read = read.unscaled(),
    }
    if !document.bare && (read.camera.is_some() || !read.lights.is_empty()) {
        read.notes.push("this file's cameras and lights are not used, only those of the scene".to_owned());
    }
    if look.is_smooth() && read.joined > 0 {
        read.notes.push(format!(
            "{} joined with others at equal positions, so that edges are smooth; `crease = {BARE_CREASE_DEGREES}` \
             keeps edges sharp",
            counted_are(read.joined, "vertex")
        ));
    }
    let named = |note: String| format!("{}: {note}", path.display());
    read.camera_notes = read.camera_notes.drain(..).map(named).collect();
    read.light_notes = read.light_notes.drain(..).map(named).collect();
    read.notes = read.notes.drain(..).map(named).collect();
    Ok(read)
}

/// Returns a note on the `count` materials of the object's mesh that ask for light on both sides of their surfaces;
/// `None` if there are no such materials. The note is for a scene that lights only fronts because it does not set
/// `two_sided`.
pub(super) fn note_double_sided(document: &Document, wire: &ObjectWire, count: usize) -> Option<String> {
    let path = document.folder.join(wire.obj.as_ref()?.get_ref());
    let verb = if count == 1 { "asks" } else { "ask" };
    let note = || {
        format!(
            "{}: {} {verb} for light on both sides (doubleSided), but this scene lights only fronts; \
             `two_sided = true` lights both sides of all its surfaces",
            path.display(),
            counted(count, "material")
        )
    };
    (count > 0).then(note)
}

/// Returns the error for a mesh that is missing or not an ordinary file.
fn no_mesh(document: &Document, file: &Spanned<String>, path: &Path) -> Error {
    let name = path.display();
    let (message, label) = match (path.is_dir(), path.exists()) {
        (true, _) => (format!("`{name}` is a folder; expected a mesh file"), "a folder"),
        (_, true) => {
            (format!("`{name}` is a pipe or a device; expected a mesh file"), "not an ordinary file")
        }
        (_, false) => match broken_link(path) {
            Some(link) => (format!("`{name}` {link}"), "a broken link"),
            None => (format!("no mesh file `{name}`"), "not found"),
        },
    };
    let is_mesh = |path: &Path| MeshFormat::from_ending(path).is_some();
    let meant = nearest_file_among(path, is_mesh).filter(|_| !path.exists());
    let meant = meant.map(|meant| format!("did you mean `{}`? ", meant.display())).unwrap_or_default();
    let help = format!("{meant}the path is relative to the scene file's folder");
    document.error(file.span(), message, label).with_help(help)
}

/// Refuses a file of a type that raycl does not read as a mesh. The message begins with the place where the user named
/// the file: a line of the scene file, or a setting such as `--set`. The message does not quote this line.
fn refuse_foreign(document: &Document, file: &Spanned<String>, path: &Path, opened: &Opened) -> Result<()> {
    let name = format!("{}: {}", document.location_of(&file.span()), path.display());
    opened.filetype.refusal(&name, Wanted::Mesh).map_or(Ok(()), Err)
}

/// Refuses keys that would have no effect because they belong to another kind of object.
fn refuse_strays(document: &Document, wire: &ObjectWire) -> Result<()> {
    let spans = |keys: [(&'static str, Option<Range<usize>>); 3]| {
        keys.into_iter().find_map(|(key, span)| span.map(|span| (key, span)))
    };
    let of_shapes = spans([
        ("triangles", wire.triangles.as_ref().map(Spanned::span)),
        ("fineness", wire.fineness.as_ref().map(Spanned::span)),
        ("seed", wire.seed.as_ref().map(Spanned::span)),
    ]);
    let of_vertices = spans([
        ("faces", wire.faces.as_ref().map(Spanned::span)),
        ("normals", wire.normals.as_ref().map(Spanned::span)),
        ("face_normals", wire.face_normals.as_ref().map(Spanned::span)),
    ]);
    let of_obj = wire.outside_materials.as_ref().map(|key| ("outside_materials", key.span()));
    let of_meshes = wire.crease.as_ref().map(|key| ("crease", key.span()));
    let stray = of_shapes
        .filter(|_| wire.shape.is_none())
        .map(|key| (key, "shape"))
        .or(of_obj.filter(|_| wire.obj.is_none()).map(|key| (key, "mesh")))
        .or(of_meshes.filter(|_| wire.shape.is_some()).map(|key| (key, "mesh` or `vertices")))
        .or(of_vertices.filter(|_| wire.vertices.is_none()).map(|key| (key, "vertices")));
    match stray {
        Some(((key, span), owner)) => {
            Err(document.error(span, format!("`{key}` without `{owner}`"), "does nothing here"))
        }
        None => Ok(()),
    }
}

/// Returns the shape with this name and with the object's parameters. Returns an error if no shape has this
/// name, if the object sets a parameter that the shape lacks, or if a parameter's value is out of range.
fn shape(document: &Document, wire: &ObjectWire, name: &Spanned<String>) -> Result<Shape> {
    let Some(mut shape) = Shape::from_name(name.get_ref()) else {
        let suggestion = or_meant(name.get_ref(), Shape::NAMES);
        let message = format!("unknown shape `{}`{suggestion}", name.get_ref());
        return Err(document
            .error(name.span(), message, "not a shape")
            .with_help(format!("the shapes are {}", Shape::NAMES.join(", "))));
    };
    let [triangles, fineness, seed] = [whole(&wire.triangles), whole(&wire.fineness), whole(&wire.seed)];
    for (key, value) in [("triangles", triangles), ("fineness", fineness), ("seed", seed)] {
        let Some((value, span)) = value else { continue };
        shape.set(key, value).map_err(|message| document.error(span, message, "here"))?;
    }
    Ok(shape)
}

/// Returns a number and its location in the document; `None` if the number is not set.
fn whole<const LEAST: u32, const MOST: u32>(
    number: &Option<Spanned<Whole<LEAST, MOST>>>,
) -> Option<(u32, Range<usize>)> {
    number.as_ref().map(|number| (number.get_ref().0, number.span()))
}

/// Refuses shapes that together have more than `most` triangles. Before the shapes are made, only their
/// target numbers of triangles are known. A shape may have slightly fewer triangles than its target, so a
/// sixteenth of the sum of the targets is subtracted from this sum.
pub(super) fn refuse_many(document: &Document, objects: &[Spanned<ObjectWire>], most: u64) -> Result<()> {
    let mut triangles = 0;
    for wire in objects.iter().map(Spanned::get_ref) {
        let Some(name) = &wire.shape else { continue };
        triangles += shape(document, wire, name)?.triangles();
        let least = triangles - triangles / 16;
        if least > most {
            let message = format!(
                "this shape and the shapes before it have at least {least} triangles in all; expected at most \
                 {most}, the largest number that a tree can index"
            );
            return Err(document
                .error(name.span(), message, "too many triangles")
                .with_help("make fewer triangles, or use a strategy without a tree, such as deferred"));
        }
    }
    Ok(())
}

/// Refuses a shape whose mesh does not fit into the host's memory. For every two triangles, the mesh has about one
/// position and one normal. Joining this mesh with the scene's other meshes takes at least half as much
/// memory again. In total, the shape needs one and a half times the mesh's memory. For every two triangles,
/// the shape thus needs the memory of three triangles, one and a half positions and one and a half normals.
/// The function counts two positions and two normals instead of one and a half.
fn room_for(shape: &Shape) -> Result<()> {
    let triangles = shape.triangles();
    let bytes = Mesh::bytes(3, 2, 2) / 2;
    let sum = format!("{bytes} B x {triangles} triangles");
    Available::read().hold(bytes * triangles, "this shape", &sum)
}

/// For each face, the indices of its corners' vertices or normals.
type Faces = Spanned<Vec<Spanned<Vec<u32>>>>;

/// Returns the mesh of an object whose vertices and faces are in the scene file itself. Adds the same notes as for a
/// mesh file: on normals that are zero, on vertices that no face uses (if these are most vertices), and on a mesh in
/// which no triangle has an area.
fn inline(document: &Document, wire: &ObjectWire, vertices: &Spanned<Vec<Position>>) -> Result<MeshFile> {
    let location = document.location_of(&vertices.span());
    let Some(faces) = &wire.faces else {
        return Err(document.error(
            vertices.span(),
            "`vertices` without `faces`",
            "these vertices are in no face",
        ));
    };
    let vertices: Vec<DVec3> = vertices.get_ref().iter().map(|position| position.in_file).collect();
    let mut mesh = Mesh { materials: vec![Material::default()], ..Mesh::default() };
    let normals = wire.normals.as_ref().map(Spanned::get_ref);
    mesh.normals = normals.into_iter().flatten().map(|normal| Vec3::from_array(normal.0)).collect();
    // Without `face_normals`, each vertex has the normal with the vertex's own number.
    if let (Some(normals), None) = (&wire.normals, &wire.face_normals) {
        check_count(document, normals, vertices.len())?;
    }
    let face_normals = wire.face_normals.as_ref().or(wire.normals.as_ref().map(|_| faces));
    check_indices(document, faces, vertices.len(), "vertex")?;
    if let Some(face_normals) = face_normals {
        check_indices(document, face_normals, mesh.normals.len(), "normal")?;
        check_lengths(document, faces, face_normals)?;
    }
    for (at, face) in faces.get_ref().iter().enumerate() {
        let normals = face_normals.map(|lists| lists.get_ref()[at].get_ref().as_slice());
        push_face(document, &mut mesh, &vertices, face, normals)?;
    }
    if mesh.triangles.is_empty() {
        return Err(document.error(faces.span(), "`faces` is empty: no triangles", "here"));
    }
    // If vertices are far from the origin, their positions are stored relative to a nearer origin until they
    // are converted to the scene's coordinates.
    let placement = Placement { scale: 1.0, ..files::placement_of(used(&mesh, &vertices)) };
    mesh.positions = vertices.into_iter().map(|vertex| placement.apply(vertex).as_vec3()).collect();
    let own = [files::note_normals(&mesh), files::note_points(&mesh, 0), files::invisible(&mesh)];
    let notes = own.into_iter().flatten().map(|note| format!("{location}: {note}")).collect();
    Ok(MeshFile { mesh, placement, notes, ..MeshFile::default() })
}

/// Returns the vertices of the triangles of `mesh`.
fn used<'a>(mesh: &'a Mesh, vertices: &'a [DVec3]) -> impl Iterator<Item = &'a DVec3> {
    mesh.triangles.iter().flat_map(|triangle| triangle.positions).map(|corner| &vertices[corner as usize])
}

fn push_face(
    document: &Document,
    mesh: &mut Mesh,
    vertices: &[DVec3],
    face: &Spanned<Vec<u32>>,
    normals: Option<&[u32]>,
) -> Result<()> {
    let corners = face.get_ref();
    if corners.len() < 3 {
        let message = format!("a face of {} corners; expected three or more", corners.len());
        return Err(document.error(face.span(), message, "here"));
    }
    let outline: Vec<_> = corners.iter().map(|&i| vertices[i as usize]).collect();
    let triangles = obj::triangulate(&outline).ok_or_else(|| {
        let message = format!(
            "a concave face of more than {} corners; divide it into smaller faces",
            obj::MAX_CONCAVE_CORNERS
        );
        document.error(face.span(), message, "here")
    })?;
    mesh.triangles.extend(triangles.into_iter().map(|triangle| Triangle {
        positions: triangle.map(|i| corners[i]),
        normals: triangle.map(|i| normals.map_or(MISSING, |normals| normals[i])),
        material: 0,
    }));
    Ok(())
}

fn check_indices(document: &Document, faces: &Faces, count: usize, what: &str) -> Result<()> {
    for face in faces.get_ref() {
        if let Some(index) = face.get_ref().iter().find(|&&index| index as usize >= count) {
            let expected = match count {
                0 => format!("the object has no {what}"),
                _ => format!("expected 0 to {}", count - 1),
            };
            let message = format!("{what} {index} does not exist; {expected}");
            return Err(document.error(face.span(), message, "here"));
        }
    }
    Ok(())
}

/// Returns an error if the number of normals differs from the number of vertices.
fn check_count<T>(document: &Document, normals: &Spanned<Vec<T>>, vertices: usize) -> Result<()> {
    let count = normals.get_ref().len();
    if count == vertices {
        return Ok(());
    }
    let message = format!("{} for {}", counted(count, "normal"), counted(vertices, "vertex"));
    let error = document.error(normals.span(), message, "expected one normal per vertex");
    Err(error.with_help("`face_normals` assigns normals to the corners of faces"))
}

fn check_lengths(document: &Document, faces: &Faces, normals: &Faces) -> Result<()> {
    let (faces, lists) = (faces.get_ref(), normals.get_ref());
    if faces.len() != lists.len() {
        let message = format!("{} lists of normals for {} faces", lists.len(), faces.len());
        return Err(document.error(normals.span(), message, "expected one list per face"));
    }
    match faces.iter().zip(lists).find(|(face, list)| face.get_ref().len() != list.get_ref().len()) {
        Some((_, list)) => {
            let mistake = |list: &Spanned<Vec<u32>>| -> Error {
                document.error(
                    list.span(),
                    "the number of normals differs from the number of corners",
                    "here",
                )
            };
            Err(mistake(list))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MaterialKind;

    #[test]
    fn a_scene_changes_only_the_given_values_of_a_material_and_completes_its_highlight() {
        let base = Material::blinn_phong(Vec3::splat(0.5), Vec3::splat(0.75), 30.0);
        let painted = |text: &str| {
            let painted = paint(&base, &toml::from_str::<MaterialWire>(text).unwrap());
            assert_eq!(painted.kind, MaterialKind::BlinnPhong);
            (painted.lambertian.x, painted.glossy.x, painted.shininess)
        };
        assert_eq!(painted("k_l = 0.25"), (0.25, 0.75, 30.0));
        assert_eq!(painted("k_g = 0.125"), (0.5, 0.125, 100.0));
        assert_eq!(painted("shininess = 8"), (0.5, 0.2, 8.0));
        assert_eq!(painted("k_g = 0.125\nshininess = 8"), (0.5, 0.125, 8.0));
    }
}
