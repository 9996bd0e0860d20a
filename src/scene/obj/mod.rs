//! Reads Wavefront OBJ files into a [`Mesh`], including files with mistakes or in unusual forms.
//!
//! This module does not use the OBJ reader of the crate `tobj`, because version 4.0.5 has several limits. The
//! reader accepts NaN, infinities and `1e400`, and returns fewer normals than positions for `f 1//1 2 3`.
//! `tobj` turns `l 1 2 3` into a triangle, and divides concave polygons into fans. `tobj` ignores the first
//! line of a file with a byte order mark, and refuses `\` continuations and Latin-1 text. `tobj` reports no
//! line numbers, and uses one core. Tests compare the meshes that raycl reads with the meshes that `tobj`
//! reads. raycl reads MTL files with the MTL reader of `tobj` ([`mtl`]).
//!
//! The text is divided into pieces of whole lines, which are read in parallel. A first pass over the text
//! reads vertices and normals. If a material has a texture, a second pass over the text reads texture
//! coordinates. The last pass reads faces; it can check every index, because the numbers of vertices and
//! normals are known.

mod asked;
mod coordinates;
mod faces;
mod flaws;
mod mtl;
mod namesakes;
mod notes;
mod odd;
mod points;
mod polygon;
mod smoothing;
mod text;
mod textures;
mod values;
mod vertex_colours;
mod wishes;

use super::files::{MeshFile, Part, Placement, note_inexact, note_points, paint};
use super::mesh::{Mesh, Triangle};
use crate::error::{Error, Result};
use crate::words::counted;
use coordinates::{Coordinates, Unread};
use faces::{FaceChunk, FaceContext};
use flaws::Flaws;
use glam::Vec3;
use points::{PointChunk, Reading};
use rayon::prelude::*;
use std::ops::ControlFlow;
use text::{Chunk, Mistake, PIECES_PER_THREAD, Seen, Source};
use textures::{FaceCoordinates, Maps};
use vertex_colours::VertexColours;

pub(in crate::scene) use asked::{Asked, Wish};
pub(in crate::scene) use mtl::Reach;
pub(in crate::scene) use notes::of_materials as note_materials;
pub(in crate::scene) use polygon::{MAX_CONCAVE_CORNERS, triangulate};
pub(in crate::scene) use text::{
    decimal, has_decimal_comma, quoted, quoted_name, quoted_number, split_lines,
};
pub(in crate::scene) use textures::{finite, unmapped};

/// The permissions for reading a mesh.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Permitted {
    /// True if MTL files, pictures and glTF buffers outside the mesh's folder may be read.
    pub beyond: bool,
    /// True if messages may quote the mesh.
    pub quotes: bool,
    /// True if the mesh may be scaled: if the scene consists of a single bare mesh. All objects of a scene have the
    /// same unit of length, so one of several objects cannot be scaled alone.
    pub scaled: bool,
}

/// Reads the OBJ text `bytes`, and the MTL files and pictures that the text names. `name` is the file's name
/// in messages, and `reach` says which files may be read.
pub(in crate::scene) fn parse(name: &str, reach: Reach<'_>, bytes: &[u8]) -> Result<MeshFile> {
    let text = text::normalise(bytes);
    let quotes = reach.permitted.quotes;
    let source = Source { name, text: &text, quotes };
    let mut reading = Reading::USUAL;
    loop {
        match read(&source, reach, &reading)? {
            ControlFlow::Break(file) => return Ok(file),
            ControlFlow::Continue(again) => reading = again,
        }
    }
}

/// Reads a mesh. Returns the mesh or, if it must be read again, the way in which it must be read. A mesh must
/// be read again if some triangles have coordinates that are valid only if the mesh is scaled. A mesh must
/// also be read again if its placement (how it is moved and scaled) was influenced by vertices that belong to no
/// triangle that a ray can hit.
fn read(source: &Source, reach: Reach<'_>, reading: &Reading) -> Result<ControlFlow<MeshFile, Reading>> {
    let chunks = text::chunks(source.text);
    let (points, placement) = read_points(&chunks, reading);
    let mut notes = Vec::new();
    points::note_flat(&points, &mut notes);
    let before_materials = notes.len();
    let libraries = points.iter().flat_map(|chunk| &chunk.libraries);
    let materials = mtl::load_all(reach, libraries, vertex_colours::are_any(&points), &mut notes)?;
    let mut of_textures = Vec::new();
    let coordinates = match materials.maps.iter().any(Maps::has_any) {
        true => read_coordinates(source, &chunks, &mut of_textures),
        false => Vec::new(),
    };
    let starts = faces::starts(&points, &coordinates);
    let total = starts[points.len()];
    check_total(source.name, total)?;
    let mut mesh = Mesh { materials: materials.list, ..Mesh::default() };
    add_points(&mut mesh, &points, total);
    let (odd_vertices, odd_normals) = (odd::vertices(&points, &starts), odd::normals(&points, &starts));
    odd::replace(&mut mesh.positions, &odd_vertices);
    let mapped = !coordinates.is_empty();
    let context = FaceContext {
        positions: &mesh.positions,
        odd_normals: &odd_normals,
        total,
        materials: &materials.by_name,
        mapped,
    };
    let at_a_time = PIECES_PER_THREAD * rayon::current_num_threads();
    let (triangles, faces) = read_faces(source, &context, &chunks, &starts, at_a_time)?;
    mesh.triangles = triangles;
    if mesh.triangles.is_empty() {
        return Err(source.error(without_triangles(source.text, total.positions, &points)));
    }
    if reach.permitted.scaled && !reading.is_large && odd::use_large(&odd_vertices, &mesh, source) {
        return Ok(ControlFlow::Continue(Reading::LARGE));
    }
    if let Some(placement) = placement_of_used(&mesh, placement, &chunks, &points, &starts, reading) {
        return Ok(ControlFlow::Continue(Reading { placement: Some(placement), ..*reading }));
    }
    odd::check_vertices(&odd_vertices, &mesh, source, reach.permitted.scaled, &mut notes)
        .map_err(|mistake| source.error(mistake))?;
    notes.extend(note_on_shapes(&mesh, &chunks, placement.scale, reading));
    odd::note_normals(&odd_normals, source, &mut notes);
    note_flaws(materials.flaws, &mesh, before_materials, &mut notes);
    let (colours, unused_colours) = VertexColours::of(&points, &starts, &mesh);
    let counts = [mesh.triangles.len(), total.normals - odd_normals.len(), materials.asked.len() - 1];
    notes.extend(note_unused(&points, &mesh, odd_vertices.len()));
    add_notes(source, &points, &faces, counts, colours.as_ref(), &mut notes);
    unused_colours.add_notes(source, &mut notes);
    notes::of_statements(&points, source.quotes, &mut notes);
    let quotes = reach.permitted.quotes;
    of_textures.extend(notes::of_materials_and_textures(&materials.asked, &mesh, quotes, &mut notes));
    if mapped {
        let corners = faces.iter().flat_map(|chunk| chunk.coordinate_indices.iter().copied()).collect();
        let texture_coordinates = FaceCoordinates { coordinates: Coordinates::joined(coordinates), corners };
        textures::apply(&mut mesh, &materials.maps, &texture_coordinates, reach, &mut of_textures);
    }
    let mut notes_on = notes_on(&faces, of_textures);
    notes_on.extend(paint_vertices(&mut mesh, colours));
    Ok(ControlFlow::Break(MeshFile { mesh, placement, notes, notes_on, ..MeshFile::default() }))
}

/// Returns a note on triangles that single precision distorts. `scale` is the factor by which the mesh was scaled.
fn note_on_shapes(mesh: &Mesh, chunks: &[Chunk<'_>], scale: f64, reading: &Reading) -> Option<String> {
    note_inexact(&mesh.triangles, &mesh.positions, scale, || {
        chunks.par_iter().flat_map_iter(|chunk| points::exact_positions(chunk, reading)).collect()
    })
}

/// Inserts notes on lines of MTL files that are not valid, before the note with the index `at`. Materials that no
/// triangle uses cause no notes.
fn note_flaws(flaws: Flaws, mesh: &Mesh, at: usize, notes: &mut Vec<String>) {
    if !flaws.is_empty() {
        notes.splice(at..at, flaws.notes(&mesh.materials_of_triangles()));
    }
}

/// Returns a note on vertices that no face uses, unless lines or points use vertices, which have a note of their own.
/// `invalid` is the number of vertices that are not valid.
fn note_unused(points: &[PointChunk], mesh: &Mesh, invalid: usize) -> Option<String> {
    if notes::have_other_elements(points) { None } else { note_points(mesh, invalid) }
}

/// Returns the notes on smooth edges and on textures, each with the part of the mesh that it concerns. A scene that leaves
/// out or replaces the part does not show them.
fn notes_on(faces: &[FaceChunk], of_textures: Vec<String>) -> Vec<(Part, String)> {
    let smoothing = smoothing::note(faces.iter().map(|chunk| &chunk.smoothing));
    let smoothing = smoothing.into_iter().map(|note| (Part::SmoothEdges, note));
    smoothing.chain(of_textures.into_iter().map(|note| (Part::Textures, note))).collect()
}

/// Refuses a mesh with 2^31 - 1 or more vertices or normals, so that every index fits into 31 bits.
fn check_total(name: &str, total: faces::Start) -> Result<()> {
    if total.positions.max(total.normals) < i32::MAX as usize {
        return Ok(());
    }
    Err(Error::input(format!("{name}: too many vertices or normals; expected fewer than 2^31 - 1"))
        .with_help("split the mesh into several files"))
}

/// Adds the positions and normals of all pieces of the file to a mesh. `total` has the numbers of positions
/// and normals of the whole file.
fn add_points(mesh: &mut Mesh, points: &[PointChunk], total: faces::Start) {
    mesh.positions.reserve_exact(total.positions);
    mesh.normals.reserve_exact(total.normals);
    for chunk in points {
        mesh.positions.extend_from_slice(&chunk.positions);
        mesh.normals.extend_from_slice(&chunk.normals);
    }
}

/// Adds notes on faces, colours and statements of which raycl ignores or replaces parts. The array has the numbers of
/// the file's triangles and valid normals, and of the materials in its MTL files.
fn add_notes(
    source: &Source,
    points: &[PointChunk],
    faces: &[FaceChunk],
    [triangles, normals, materials]: [usize; 3],
    colours: Option<&VertexColours>,
    notes: &mut Vec<String>,
) {
    faces::note_unnamed_normals(faces, normals, notes);
    faces::note_partial_normals(faces, source, notes);
    faces::note_odd_faces(faces, source, notes);
    faces::note_nameless(faces, source, notes);
    faces::note_unknown_materials(faces, colours.is_some(), source.quotes, notes);
    faces::note_early(faces, (triangles, materials), colours.is_some(), notes);
    points::note_surplus(points, source, notes);
    colours.iter().for_each(|colours| colours.add_notes(notes));
}

/// Returns the error for a file without triangles that has `vertices` vertices.
fn without_triangles(text: &[u8], vertices: usize, points: &[PointChunk]) -> Mistake {
    let (vertices, unknown) = (counted(vertices, "vertex"), unknown_keywords(points));
    let what = match text.trim_ascii() {
        [] => "no triangles; the file is empty".to_owned(),
        _ => format!(
            "no triangles; the file has {vertices} and no face (`f`) with at least three corners{unknown}"
        ),
    };
    Mistake::new(text.len(), what)
}

/// Returns the end of a message, which names the file's unknown keywords; empty if there are none. `V` and
/// `F` are unknown keywords; for these, the message suggests `v` and `f`.
fn unknown_keywords(points: &[PointChunk]) -> String {
    let mut asked = Asked::default();
    points.iter().for_each(|chunk| asked.extend(&chunk.asked));
    let Some(names) = asked.keywords(Wish::Unknown) else { return String::new() };
    let is_upper = |word: &&str| asked.has(Wish::Unknown, word.to_ascii_uppercase().as_bytes());
    let meant: Vec<_> = ["v", "f"].into_iter().filter(is_upper).map(|word| format!("`{word}`")).collect();
    match meant[..] {
        [] => format!("; unknown keywords: {names}"),
        _ => format!("; unknown keywords: {names}; did you mean {}?", meant.join(", ")),
    }
}

/// Gives triangles the colours of their vertices, if vertices have colours. Returns notes on textures that these colours
/// change, and on materials that change these colours.
fn paint_vertices(mesh: &mut Mesh, colours: Option<VertexColours>) -> Vec<(Part, String)> {
    let Some(colours) = colours else { return Vec::new() };
    // The colour of a vertex is multiplied by the material's colour, so the default material becomes white.
    mesh.materials[0].lambertian = Vec3::ONE;
    let linear = colours.linear();
    let tinted = vertex_colours::note_textured(mesh, &linear).map(|note| (Part::TintedTextures, note));
    let darkened = vertex_colours::note_darkened(mesh, &linear).map(|note| (Part::VertexColours, note));
    paint(mesh, &linear);
    tinted.into_iter().chain(darkened).collect()
}

/// Returns the points of all pieces of the file, and their placement (how they are moved and scaled). If
/// `reading` has no placement, the placement is computed from the bounding box of all vertices. If a mesh is
/// far from its origin, or is extremely small or large, the bounding box is computed again and the points are read
/// again, both in double precision.
fn read_points(chunks: &[Chunk], reading: &Reading) -> (Vec<PointChunk>, Placement) {
    let read = |reading: &Reading| {
        let mut points: Vec<_> = chunks.par_iter().map(|chunk| points::read(chunk, reading)).collect();
        points::drop_mixed(&mut points);
        points
    };
    let points = read(reading);
    if let Some(placement) = reading.placement {
        return (points, placement);
    }
    let rounded = points.iter().filter_map(PointChunk::bounds).reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
    let (low, high) = rounded.unwrap_or((Vec3::ZERO, Vec3::ZERO));
    let placement = Placement::of_rounded(low, high)
        .unwrap_or_else(|| exact_placement(chunks, &points, reading, |_, _| true));
    if placement == Placement::IDENTITY {
        return (points, placement);
    }
    (read(&Reading { placement: Some(placement), ..*reading }), placement)
}

/// Returns the placement (how the mesh is moved and scaled), computed from the vertices' bounding box in
/// double precision. The box includes only the vertices for which `counts` returns true. The arguments of
/// `counts` are the index of a piece, and the vertex's index within this piece.
fn exact_placement(
    chunks: &[Chunk],
    points: &[PointChunk],
    reading: &Reading,
    counts: impl Fn(usize, usize) -> bool + Sync,
) -> Placement {
    let bounds = points.par_iter().zip(chunks).enumerate().filter_map(|(piece, (points, chunk))| {
        points.exact_bounds(chunk, reading, |number| counts(piece, number))
    });
    let bounds = bounds.reduce_with(|(a, b), (c, d)| (a.min(c), b.max(d)));
    bounds.map_or(Placement::IDENTITY, |(low, high)| Placement::of(low, high))
}

/// Returns the placement (how the mesh is moved and scaled), computed only from vertices of triangles that a ray can
/// hit. Returns `None` if the computed placement equals `placement`, the placement that was computed from all
/// vertices of the file. Also returns `None` if `reading.placement` is already set, or if the mesh has no
/// triangles. If a placement is returned, the mesh must be read again with the returned placement, because
/// the argument `placement` moves or scales the mesh wrongly.
fn placement_of_used(
    mesh: &Mesh,
    placement: Placement,
    chunks: &[Chunk],
    points: &[PointChunk],
    starts: &[faces::Start],
    reading: &Reading,
) -> Option<Placement> {
    // Often, the bounds of the triangles show that `placement` is right. The vertices are read once more only
    // if the bounds do not show that `placement` is right.
    let (low, high) = mesh.bounds()?;
    let is_usual = placement == Placement::IDENTITY && Placement::of_rounded(low, high).is_some();
    let is_whole = || mesh.positions.iter().all(|p| p.cmpge(low).all() && p.cmple(high).all());
    if reading.placement.is_some() || is_usual || is_whole() {
        return None;
    }
    let used = mesh.visible_positions();
    let counts = |piece: usize, number: usize| used[starts[piece].positions + number];
    let wanted = exact_placement(chunks, points, reading, counts);
    (wanted != placement).then_some(wanted)
}

/// Returns the texture coordinates of each piece. Adds notes on coordinates that are not valid, and on coordinates with
/// a word other than 0 after the second number.
fn read_coordinates(source: &Source, chunks: &[Chunk], notes: &mut Vec<String>) -> Vec<Coordinates> {
    let (coordinates, unread): (_, Vec<Unread>) = chunks.par_iter().map(coordinates::read).unzip();
    odd::note_coordinates(Seen::of_all(unread.iter().map(|unread| unread.odd)), source, notes);
    let surplus = Seen::of_all(unread.iter().map(|unread| unread.surplus));
    notes.extend(source.note_on_lines("line ", surplus, "numbers after the second of `vt` are ignored"));
    coordinates
}

/// Reads the faces of all pieces. Returns the triangles of the whole file, and the other results of each
/// piece.
///
/// The pieces are read in groups of `at_a_time`. When a group has been read, its triangles are moved to the
/// end of the list, and the next group is read into the same memory. For large files, reading into the same
/// memory is faster than reading into new memory, since the system fills new memory with zeros. All threads
/// together move the triangles, so that they also share the work of filling the list's new memory with zeros.
/// After the last group of pieces, the memory of each piece is freed as soon as its triangles are moved.
fn read_faces(
    source: &Source,
    context: &FaceContext,
    chunks: &[Chunk],
    starts: &[faces::Start],
    at_a_time: usize,
) -> Result<(Vec<Triangle>, Vec<FaceChunk>)> {
    let count = chunks.len();
    let mut buffers = vec![Vec::new(); at_a_time.min(count)];
    let (mut triangles, mut pieces) = (Vec::new(), Vec::with_capacity(count));
    for (chunks, starts) in chunks.chunks(at_a_time).zip(starts.chunks(at_a_time)) {
        let is_last = pieces.len() + chunks.len() == count;
        let group = chunks.par_iter().zip(starts).zip(&mut buffers);
        let read =
            group.map(|((chunk, start), buffer)| faces::read(context, chunk, start, std::mem::take(buffer)));
        let read = in_order(source, read.collect())?;
        triangles.reserve(read.iter().map(|piece| piece.triangles.len()).sum());
        for (mut piece, buffer) in read.into_iter().zip(&mut buffers) {
            let mut own = std::mem::take(&mut piece.triangles);
            triangles.par_extend(own.par_drain(..));
            if !is_last {
                *buffer = own;
            }
            pieces.push(piece);
        }
    }
    triangles.shrink_to_fit();
    Ok((triangles, pieces))
}

/// Returns the results of all pieces, or the error for the first mistake in the file.
fn in_order<T>(source: &Source, results: Vec<std::result::Result<T, Mistake>>) -> Result<Vec<T>> {
    results.into_iter().collect::<std::result::Result<_, _>>().map_err(|mistake| source.error(mistake))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
