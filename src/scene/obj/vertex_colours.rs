//! The colours of vertices (the numbers after `v x y z`). Colours of vertices that no triangle uses have no effect.

use super::points::PointChunk;
use super::text::{Seen, Source};
use crate::scene::Mesh;
use crate::scene::files::{is_outside, linear, note_clear, note_outside};
use crate::words::{counted, counted_are};
use glam::Vec3;

/// The colour of a vertex for which the file has no colour. Channels of colours are later limited to 1, so a
/// vertex without a colour becomes white.
pub(super) const UNCOLOURED: Vec3 = Vec3::INFINITY;
/// If a triangle uses a vertex whose colour has a channel larger than this, all channels in the file count as
/// numbers from 0 to 255. If an alpha in the file is larger than this, all alphas count as numbers from 0 to 255.
/// The limit is above 1, because rounded channels may be slightly larger than 1.
const MOST_OF_UNIT: f32 = 1.5;
/// If the largest channel is smaller than this, it is doubtful that channels are numbers from 0 to 255, since all
/// colours would be almost black.
const LEAST_OF_BYTES: f32 = 16.0;

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

/// Returns true if at least one vertex of the file has a colour.
pub(super) fn are_any(chunks: &[PointChunk]) -> bool {
    chunks.iter().any(|chunk| chunk.coloured > 0)
}

/// Returns the value of a channel at full intensity. Some programs write colours from 0 to 255, others from 0 to 1. All
/// colours of a file have the same range.
fn full_channel(brightest: f32) -> f32 {
    if brightest > MOST_OF_UNIT { 255.0 } else { 1.0 }
}

impl VertexColours {
    /// Collects the colours of the vertices that triangles use. Returns `None` if no such vertex has a colour.
    pub fn of(chunks: &[PointChunk], mesh: &Mesh) -> Option<Self> {
        if !are_any(chunks) {
            return None;
        }
        let mut list = Vec::with_capacity(mesh.positions.len());
        for chunk in chunks {
            let end = list.len() + chunk.positions.len();
            list.extend_from_slice(&chunk.colours);
            list.resize(end, UNCOLOURED);
        }
        let (mut brightest, mut with, mut without) = (0.0_f32, 0, 0);
        for (colour, is_used) in list.iter_mut().zip(mesh.positions_of_triangles()) {
            match (is_used, *colour == UNCOLOURED) {
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
        let range = || {
            format!(
                "channels of vertices' colours count as numbers from 0 to 255, since one is {}",
                self.brightest
            )
        };
        notes.extend((full > 1.0 && self.brightest < LEAST_OF_BYTES).then(range));
        let white = || format!("{} shown in white", counted_are(self.without, "vertex without a colour"));
        notes.extend((self.without > 0).then(white));
    }

    /// Returns the linear colours of all vertices.
    pub fn linear(self) -> Vec<Vec3> {
        let full = full_channel(self.brightest);
        self.list.into_iter().map(|colour| (colour / full).min(Vec3::ONE).map(linear)).collect()
    }
}

/// Adds notes on alpha, which raycl does not use, and on colours that are not valid.
pub(super) fn note_unread(chunks: &[PointChunk], source: &Source, notes: &mut Vec<String>) {
    let alphas = || chunks.iter().flat_map(|chunk| &chunk.alphas).copied();
    let opaque = full_channel(alphas().fold(0.0, f32::max));
    notes.extend(note_clear(alphas().filter(|alpha| *alpha < opaque).count(), "vertex"));
    let odd = Seen::of_all(chunks.iter().map(|chunk| chunk.odd_colours));
    let note = || {
        let (line, vertices) = (source.line(odd.first), counted(odd.count, "vertex"));
        format!(
            "line {line}: colours of {vertices} are not used: expected three finite numbers after x, y and z"
        )
    };
    notes.extend((odd.count > 0).then(note));
}
