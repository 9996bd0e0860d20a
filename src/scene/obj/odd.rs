//! Vertices, normals and texture coordinates that are not valid, because a number is missing, not finite or out
//! of range. For example, some programs write vertices with NaN for points that were not measured. A vertex
//! that is not valid is a mistake only if a face uses the vertex. A normal or a texture coordinate that is not
//! valid counts as missing.

use super::coordinates::mistake_in_coordinate;
use super::faces::Start;
use super::points::{PointChunk, is_large, mistake_in_normal, mistake_in_vertex};
use super::text::{Mistake, Seen, Source, keyword};
use crate::scene::Mesh;
use crate::words::counted_are;
use glam::Vec3;

/// A vertex or a normal that is not valid, or a vertex with only two coordinates.
#[derive(Clone, Copy)]
pub(super) struct Odd {
    /// The index of the vertex or the normal within a piece of the file. In the results of [`vertices`] and
    /// [`normals`], `number` is the index within the whole file.
    pub number: usize,
    /// The byte offset of the vertex's or normal's line in the text.
    pub offset: usize,
}

/// Returns the file's vertices that are not valid, with their indices within the whole file.
pub(super) fn vertices(points: &[PointChunk], starts: &[Start]) -> Vec<Odd> {
    let numbered = |(chunk, start): (&PointChunk, &Start)| after(&chunk.odd_vertices, start.positions);
    points.iter().zip(starts).flat_map(numbered).collect()
}

/// Returns the file's normals that are not valid, with their indices within the whole file.
pub(super) fn normals(points: &[PointChunk], starts: &[Start]) -> Vec<Odd> {
    let numbered = |(chunk, start): (&PointChunk, &Start)| after(&chunk.odd_normals, start.normals);
    points.iter().zip(starts).flat_map(numbered).collect()
}

fn after(list: &[Odd], start: usize) -> Vec<Odd> {
    list.iter().map(|odd| Odd { number: start + odd.number, ..*odd }).collect()
}

/// Moves vertices that are not valid to the position of a valid vertex, so that they do not enlarge the mesh.
pub(super) fn replace(positions: &mut [Vec3], odd: &[Odd]) {
    if odd.is_empty() {
        return;
    }
    let instead = positions.iter().copied().find(|position| !position.is_nan()).unwrap_or_default();
    odd.iter().for_each(|odd| positions[odd.number] = instead);
}

/// Returns true if a triangle uses a vertex in `odd` that would be valid if the mesh was scaled.
pub(super) fn use_large(odd: &[Odd], mesh: &Mesh, source: &Source) -> bool {
    let mut large = odd.iter().filter(|odd| is_large(rest_of_line(source, odd.offset))).peekable();
    large.peek().is_some() && {
        let used = mesh.positions_of_triangles();
        large.any(|odd| used[odd.number])
    }
}

/// Returns an error if a triangle uses a vertex that is not valid. If there are vertices that are not valid,
/// but no triangle uses them, adds a note on these vertices. `scaled` is true if the mesh may be scaled.
pub(super) fn check_vertices(
    odd: &[Odd],
    mesh: &Mesh,
    source: &Source,
    scaled: bool,
    notes: &mut Vec<String>,
) -> Result<(), Mistake> {
    let Some(first) = odd.first() else { return Ok(()) };
    let mistake = |odd: &Odd| mistake_in_vertex(odd.offset, rest_of_line(source, odd.offset), scaled);
    let used = mesh.positions_of_triangles();
    if let Some(odd) = odd.iter().find(|odd| used[odd.number]) {
        return Err(mistake(odd));
    }
    let ignored = counted_are(odd.len(), "such vertex that no face uses");
    notes.push(format!("{}: {ignored} ignored", source.note_of(&mistake(first))));
    Ok(())
}

/// Adds a note on normals that are not valid, if there are any.
pub(super) fn note_normals(odd: &[Odd], source: &Source, notes: &mut Vec<String>) {
    let Some(first) = odd.first() else { return };
    let mistake = mistake_in_normal(first.offset, rest_of_line(source, first.offset));
    notes.push(format!(
        "{}: {} ignored; normals of faces that name such a normal are computed from the faces' shape",
        source.note_of(&mistake),
        counted_are(odd.len(), "such normal")
    ));
}

/// Adds a note on texture coordinates that are not valid, if there are any.
pub(super) fn note_coordinates(odd: Seen, source: &Source, notes: &mut Vec<String>) {
    if odd.count == 0 {
        return;
    }
    let mistake = mistake_in_coordinate(odd.first, rest_of_line(source, odd.first));
    notes.push(format!(
        "{}: {} ignored",
        source.note_of(&mistake),
        counted_are(odd.count, "such texture coordinate")
    ));
}

/// Returns the line that begins at `offset`, without its first word.
fn rest_of_line<'a>(source: &Source<'a>, offset: usize) -> &'a [u8] {
    let line = source.text[offset..].split(|&byte| byte == b'\n').next().unwrap_or_default();
    keyword(line.trim_ascii()).1
}
