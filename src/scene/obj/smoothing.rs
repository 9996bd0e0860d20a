//! Smoothing groups: the lines `s` of a file say which faces are smooth together. raycl does not use these groups, but
//! makes all faces without normals smooth, up to the crease angle. If the groups ask for a sharp edge, a note counts
//! the triangles without normals.

use super::text::{tokens, words};
use crate::words::counted_are;
use std::collections::{BTreeMap, BTreeSet};

/// The name of the group of faces that are not smooth.
const OFF: &str = "off";

/// The smoothing groups of a piece of the file, and the numbers of their triangles without normals.
#[derive(Default)]
pub(super) struct Smoothing {
    /// The current group; empty before the file's first line `s`.
    group: String,
    /// The number of triangles without normals in the current group since its line `s` or the piece's beginning.
    recent: usize,
    /// For each group, the number of its triangles without normals; triangles in `recent` are not included. Groups
    /// without such triangles are left out.
    triangles: BTreeMap<String, usize>,
}

impl Smoothing {
    /// Returns the groups of a piece that begins in the group `group`.
    pub fn starting(group: &str) -> Self {
        Self { group: group.to_owned(), ..Self::default() }
    }

    /// Counts a triangle without normals.
    pub fn count(&mut self) {
        self.recent += 1;
    }

    /// Ends the current group and begins the group `group`.
    pub fn begin(&mut self, group: String) {
        let ended = std::mem::replace(&mut self.group, group);
        let triangles = std::mem::take(&mut self.recent);
        if triangles > 0 {
            *self.triangles.entry(ended).or_default() += triangles;
        }
    }
}

/// Returns the name of the group in a line `s`; `off` if the line has no name, or the name `0` or `off`.
pub(super) fn group(rest: &[u8]) -> String {
    match tokens(rest).next() {
        None | Some(b"0" | b"off") => OFF.to_owned(),
        Some(group) => words(group),
    }
}

/// Returns a note on smoothing groups if the file asks for an edge that is not smooth; otherwise `None`. `pieces` has
/// the groups of all pieces of the file.
pub(super) fn note<'a>(pieces: impl Iterator<Item = &'a Smoothing>) -> Option<String> {
    let counts: Vec<_> = pieces.flat_map(|piece| &piece.triangles).collect();
    let groups: BTreeSet<_> = counts.iter().map(|(group, _)| group.as_str()).collect();
    // A file without smoothing groups, or with a single one, needs no note, since all faces without normals become
    // smooth anyway.
    let note = || {
        format!(
            "smoothing groups (s) are not read: {} smooth, except at edges with an angle above the `crease` angle of the \
             scene (a bare mesh has a default). `flat = true` in an [[object]] (for a bare mesh, --set object.0.flat=true) \
             gives every face its own normal",
            counted_are(counts.iter().map(|(_, count)| **count).sum(), "triangle without normals")
        )
    };
    (groups.len() > 1 || groups.contains(OFF)).then(note)
}
