//! The colours of vertices (the numbers after `v x y z`). Colours of vertices that no triangle uses have no effect.

use super::faces::Start;
use super::odd::Odd;
use super::points::PointChunk;
use super::text::Source;
use crate::scene::files::{full_channel, is_outside, linear, note_bytes, note_clear, note_outside};
use crate::scene::{Mesh, Triangle};
use crate::words::{counted, counted_are};
use glam::Vec3;

/// The colour of a vertex for which the file has no colour. Channels of colours are later limited to 1, so a
/// vertex without a colour becomes white.
pub(super) const UNCOLOURED: Vec3 = Vec3::INFINITY;
/// The smallest linear channel of a colour that counts as white.
const LEAST_WHITE: f32 = 0.99;

/// The colours of the vertices that triangles use.
pub(super) struct VertexColours {
    /// One colour per vertex, as it is in the file. A vertex without a colour, or that no triangle uses, has
    /// [`UNCOLOURED`].
    list: Vec<Vec3>,
    /// The largest channel of all colours.
    brightest: f32,
    /// The number of vertices that triangles use and that have no colour.
    without: usize,
}

/// Returns a note on the triangles on which colours of vertices change a texture; `None` if there are none. `linear`
/// has the linear colour of each vertex.
pub(super) fn note_textured(mesh: &Mesh, linear: &[Vec3]) -> Option<String> {
    let is_white = |vertex: &u32| linear[*vertex as usize].min_element() >= LEAST_WHITE;
    let rows = mesh.triangles.iter().zip(&mesh.textures.mapped);
    let changed =
        rows.filter(|(triangle, row)| row.texture.is_some() && !triangle.positions.iter().all(is_white));
    let count = changed.count();
    let note = || {
        format!(
            "textures of {} are multiplied by the colours of vertices, although many programs show the texture alone; \
             a scene that sets `k_l = 1` (for a bare mesh, --set object.0.material.k_l=1) leaves these colours out",
            counted(count, "triangle")
        )
    };
    (count > 0).then(note)
}

/// Returns a note on the triangles without a texture on which a material's `Kd` changes the colours of vertices; `None`
/// if there are none. `linear` has the linear colour of each vertex.
pub(super) fn note_darkened(mesh: &Mesh, linear: &[Vec3]) -> Option<String> {
    let is_textured =
        |number: usize| mesh.textures.mapped.get(number).is_some_and(|row| row.texture.is_some());
    // White usually means that a vertex has no colour of its own, and black stays black.
    let is_plain = |vertex: &u32| {
        let colour = linear[*vertex as usize];
        colour.min_element() >= LEAST_WHITE || colour == Vec3::ZERO
    };
    let is_changed = |(number, triangle): &(usize, &Triangle)| {
        let lambertian = mesh.material(triangle).lambertian;
        let is_white = lambertian.min_element() >= LEAST_WHITE && lambertian.max_element() <= 1.0;
        !is_white && !is_textured(*number) && !triangle.positions.iter().all(is_plain)
    };
    let count = mesh.triangles.iter().enumerate().filter(is_changed).count();
    let note = || {
        format!(
            "colours of vertices are multiplied by those of materials (Kd) on {}, although many programs show them alone",
            counted(count, "triangle")
        )
    };
    (count > 0).then(note)
}

/// The parts of vertices' colours that raycl does not use. Only vertices that triangles use count.
#[derive(Default)]
pub(super) struct Unused {
    alphas: Vec<f32>,
    /// The vertices with a colour that is not valid.
    odd: Vec<Odd>,
}

/// Returns true if at least one vertex of the file has a colour.
pub(super) fn are_any(chunks: &[PointChunk]) -> bool {
    chunks.iter().any(|chunk| chunk.coloured > 0)
}

impl VertexColours {
    /// Collects the colours of the vertices that triangles use (`None` if no such vertex has a colour), and the parts
    /// of these colours that raycl does not use. `starts` has the number of vertices before each piece.
    pub fn of(chunks: &[PointChunk], starts: &[Start], mesh: &Mesh) -> (Option<Self>, Unused) {
        if !are_any(chunks) && chunks.iter().all(|chunk| chunk.odd_colours.is_empty()) {
            return (None, Unused::default());
        }
        let used = mesh.positions_of_triangles();
        (Self::of_used(chunks, &used), Unused::of(chunks, starts, &used))
    }

    fn of_used(chunks: &[PointChunk], used: &[bool]) -> Option<Self> {
        if !are_any(chunks) {
            return None;
        }
        let mut list = Vec::with_capacity(used.len());
        for chunk in chunks {
            let end = list.len() + chunk.positions.len();
            list.extend_from_slice(&chunk.colours);
            list.resize(end, UNCOLOURED);
        }
        let (mut brightest, mut with, mut without) = (0.0_f32, 0, 0);
        for (colour, is_used) in list.iter_mut().zip(used) {
            match (*is_used, *colour == UNCOLOURED) {
                (true, true) => without += 1,
                (true, false) => {
                    with += 1;
                    brightest = brightest.max(colour.max_element());
                }
                (false, _) => *colour = UNCOLOURED,
            }
        }
        (with > 0).then_some(Self { list, brightest, without })
    }

    /// Adds notes on colours that raycl changes, and on vertices without a colour.
    pub fn add_notes(&self, notes: &mut Vec<String>) {
        let full = full_channel(self.brightest);
        let is_limited = |colour: &&Vec3| **colour != UNCOLOURED && is_outside(&(**colour / full));
        notes.extend(note_outside(self.list.iter().filter(is_limited).count(), "vertex"));
        notes.extend(note_bytes(self.brightest));
        let white = || format!("{} shown in white", counted_are(self.without, "vertex without a colour"));
        notes.extend((self.without > 0).then(white));
    }

    /// Returns the linear colours of all vertices.
    pub fn linear(self) -> Vec<Vec3> {
        let full = full_channel(self.brightest);
        self.list.into_iter().map(|colour| (colour / full).min(Vec3::ONE).map(linear)).collect()
    }
}

impl Unused {
    fn of(chunks: &[PointChunk], starts: &[Start], used: &[bool]) -> Self {
        let mut unused = Self::default();
        for (chunk, start) in chunks.iter().zip(starts) {
            let is_used = |number: usize| used[start.positions + number];
            let alphas = chunk.alphas.iter().filter(|(number, _)| is_used(*number as usize));
            unused.alphas.extend(alphas.map(|(_, alpha)| *alpha));
            unused.odd.extend(chunk.odd_colours.iter().filter(|odd| is_used(odd.number)));
        }
        unused
    }

    /// Adds notes on alpha, which raycl does not use, and on colours that are not valid.
    pub fn add_notes(&self, source: &Source, notes: &mut Vec<String>) {
        let opaque = full_channel(self.alphas.iter().copied().fold(0.0, f32::max));
        notes.extend(note_clear(self.alphas.iter().filter(|alpha| **alpha < opaque).count(), "vertex"));
        let Some(first) = self.odd.first() else { return };
        notes.push(format!(
            "line {}: colours of {} are not used: expected three finite numbers after x, y and z",
            source.line(first.offset),
            counted(self.odd.len(), "vertex")
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::super::faces::starts;
    use super::*;

    #[test]
    fn vertices_of_later_pieces_are_counted_from_the_files_first() {
        let piece = |alphas: Vec<(u32, f32)>, odd: Vec<Odd>| PointChunk {
            positions: vec![Vec3::ZERO; 2],
            alphas,
            odd_colours: odd,
            ..PointChunk::default()
        };
        let odd = vec![Odd { number: 1, offset: 7 }];
        let pieces = [piece(Vec::new(), Vec::new()), piece(vec![(0, 0.5), (1, 0.25)], odd)];
        let of = |used: [bool; 4]| Unused::of(&pieces, &starts(&pieces, &[]), &used);
        let third = of([false, false, true, false]);
        assert_eq!((third.alphas, third.odd.len()), (vec![0.5], 0));
        let fourth = of([false, false, false, true]);
        assert_eq!((fourth.alphas, fourth.odd.len()), (vec![0.25], 1));
    }
}
