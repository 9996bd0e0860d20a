//! The first pass over an OBJ file: reads vertices and normals, the names of materials, and unsupported statements.

use super::asked::Asked;
use super::text::{Chunk, Mistake, Seen, decimal, keyword, number, quoted, tokens, words};
use super::wishes;
use crate::scene::MAX_COORDINATE;
use crate::scene::files::{Placement, linear};
use crate::words::counted;
use glam::{DVec3, Vec3};
use std::collections::BTreeSet;

/// The colour of a vertex for which the file has no colour. This colour is brighter than every
/// colour in a file, and so becomes white.
pub(super) const UNCOLOURED: Vec3 = Vec3::INFINITY;
/// If a channel exceeds this, the file's colours are from 0 to 255. The limit is above 1 because rounded channels may
/// exceed 1 slightly.
const MOST_OF_UNIT: f32 = 1.5;

/// The contents of a piece of the file, except its faces.
#[derive(Default)]
pub(super) struct PointChunk {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// The names in `mtllib` lines.
    pub libraries: Vec<String>,
    /// The last `usemtl` of the piece, if there is one.
    pub last_material: Option<String>,
    /// Number of vertices with a colour.
    pub coloured: usize,
    /// Colours as the file states them: one per vertex, up to the last vertex with a colour. A
    /// vertex without a colour has [`UNCOLOURED`].
    pub colours: Vec<Vec3>,
    /// The largest channel of all colours.
    pub brightest: f32,
    /// The smoothing groups in `s` lines, including `off`.
    pub smoothing: BTreeSet<String>,
    /// Number of vertices with only two coordinates.
    pub flat: Seen,
    /// Unsupported statements.
    pub asked: Asked,
}

impl PointChunk {
    /// Reads the numbers after a vertex's coordinates: a single number is a weight, three are a
    /// colour.
    fn colour<'a>(&mut self, mut tokens: impl Iterator<Item = &'a [u8]>) {
        let mut channel = || tokens.next().and_then(number);
        let (Some(red), Some(green), Some(blue)) = (channel(), channel(), channel()) else { return };
        self.coloured += 1;
        self.colours.resize(self.positions.len() - 1, UNCOLOURED);
        self.colours.push(Vec3::new(red, green, blue));
        self.brightest = self.brightest.max(red).max(green).max(blue);
    }

    /// Reads a vertex with only two coordinates (z is 0), and counts it. For any other number of
    /// coordinates, returns the given mistake.
    fn flat_vertex(
        &mut self,
        offset: usize,
        rest: &[u8],
        placement: &Placement,
        mistake: Mistake,
    ) -> Result<Vec3, Mistake> {
        if tokens(rest).count() != 2 {
            return Err(mistake);
        }
        self.flat.at(offset);
        position(offset, &mut tokens(rest).chain([&b"0"[..]]), placement)
    }

    /// Returns the bounding box of the positions.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p))))
    }
}

/// Reads a piece; `placement` changes its positions.
pub(super) fn read(chunk: &Chunk, placement: &Placement) -> Result<PointChunk, Mistake> {
    let mut points = PointChunk::default();
    for (offset, line) in chunk.lines() {
        match keyword(line) {
            (b"v", rest) => {
                let mut words = tokens(rest);
                let position = position(offset, &mut words, placement)
                    .or_else(|mistake| points.flat_vertex(offset, rest, placement, mistake))?;
                points.positions.push(position);
                points.colour(words);
            }
            (b"vn", rest) => points.normals.push(vector(offset, "normal", &mut tokens(rest))?),
            (b"f" | b"vt" | b"", _) => {}
            (b"mtllib", rest) => points.libraries.push(words(rest)),
            (b"usemtl", rest) => points.last_material = Some(words(rest)),
            (b"s", rest) => {
                points.smoothing.insert(smoothing_group(rest));
            }
            (word, rest) => wishes::of_line(&mut points.asked, word, rest),
        }
    }
    Ok(points)
}

/// Returns the linear colours of the file's vertices. Some programs write colours from 0 to 255, and all colours
/// of a file have the same range.
pub(super) fn linear_colours(chunks: &[PointChunk]) -> Vec<Vec3> {
    let brightest = chunks.iter().map(|chunk| chunk.brightest).fold(0.0, f32::max);
    let full = if brightest > MOST_OF_UNIT { 255.0 } else { 1.0 };
    let mut colours = Vec::with_capacity(chunks.iter().map(|chunk| chunk.positions.len()).sum());
    for chunk in chunks {
        let end = colours.len() + chunk.positions.len();
        colours.extend(chunk.colours.iter().map(|colour| (colour / full).min(Vec3::ONE).map(linear)));
        colours.resize(end, Vec3::ONE);
    }
    colours
}

/// Accepts vertices with only two coordinates if the file has no others, as in a plane drawing. If other
/// vertices have more coordinates, the first vertex with two coordinates is a mistake.
pub(super) fn check_flat(chunks: &[PointChunk], notes: &mut Vec<String>) -> Result<(), Mistake> {
    let flat = chunks.iter().map(|chunk| chunk.flat).fold(Seen::default(), Seen::joined);
    let total: usize = chunks.iter().map(|chunk| chunk.positions.len()).sum();
    if 0 < flat.count && flat.count < total {
        return Err(Mistake::new(flat.first, "a vertex with 2 numbers; expected three: x y z"));
    }
    let note = || format!("{} with two numbers each: z is 0", counted(flat.count, "vertex"));
    notes.extend((flat.count > 0).then(note));
    Ok(())
}

/// Reads the texture coordinates of a piece: two numbers each. The second number may be missing, and a
/// third number is ignored.
pub(super) fn texture_coordinates(chunk: &Chunk) -> Result<Vec<[f32; 2]>, Mistake> {
    let lines = chunk.lines().map(|(offset, line)| (offset, keyword(line)));
    let coordinates = lines.filter(|(_, (word, _))| *word == b"vt").map(|(offset, (_, rest))| {
        let mut tokens = tokens(rest);
        let mut next = |usual: Option<&'static [u8]>| {
            let token = tokens.next().or(usual).unwrap_or_default();
            let wrong = "in a texture coordinate (vt); expected a finite decimal number";
            number(token).ok_or_else(|| Mistake::new(offset, format!("{} {wrong}", quoted(token))))
        };
        Ok::<_, Mistake>([next(None)?, next(Some(b"0"))?])
    });
    coordinates.collect()
}

/// Returns the number of a smoothing group; a missing number means `off`.
fn smoothing_group(rest: &[u8]) -> String {
    match tokens(rest).next() {
        None | Some(b"0" | b"off") => "off".to_owned(),
        Some(group) => words(group),
    }
}

/// Returns the bounding box of a piece's positions, in double precision. The piece was read before, so every position
/// has two or three numbers, and z is 0 if it is missing.
pub(super) fn exact_bounds(chunk: &Chunk) -> Result<Option<(DVec3, DVec3)>, Mistake> {
    let mut bounds = None;
    for (offset, line) in chunk.lines() {
        let (b"v", rest) = keyword(line) else { continue };
        let at = exact(offset, &mut tokens(rest).chain([&b"0"[..]]))?;
        let (low, high) = bounds.unwrap_or((at, at));
        bounds = Some((at.min(low), at.max(high)));
    }
    Ok(bounds)
}

/// Reads a position, which `placement` changes. If there is a change, the mesh was at first read in single precision
/// and without it.
fn position<'a>(
    offset: usize,
    tokens: &mut impl Iterator<Item = &'a [u8]>,
    placement: &Placement,
) -> Result<Vec3, Mistake> {
    if *placement != Placement::IDENTITY {
        return Ok(placement.place(exact(offset, tokens)?).as_vec3());
    }
    let position = vector(offset, "vertex", tokens)?;
    if position.abs().max_element() <= MAX_COORDINATE {
        return Ok(position);
    }
    let message = format!(
        "vertex ({:e}, {:e}, {:e}) is out of range; expected coordinates within +-{MAX_COORDINATE:e}, \
         beyond which 32-bit products overflow",
        position.x, position.y, position.z
    );
    Err(Mistake::new(offset, message))
}

/// Reads a position in double precision.
fn exact<'a>(offset: usize, tokens: &mut impl Iterator<Item = &'a [u8]>) -> Result<DVec3, Mistake> {
    let mut values = [0.0; 3];
    for value in &mut values {
        let token = tokens.next().unwrap_or_default();
        let what = || {
            Mistake::new(offset, format!("{} in a vertex; expected a finite decimal number", quoted(token)))
        };
        *value = decimal(token).ok_or_else(what)?;
    }
    Ok(DVec3::from_array(values))
}

/// Reads the first three numbers; a weight or a colour may follow.
fn vector<'a>(
    offset: usize,
    what: &str,
    tokens: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<Vec3, Mistake> {
    let mut values = [0.0; 3];
    for (count, value) in values.iter_mut().enumerate() {
        let token = tokens.next().ok_or_else(|| {
            Mistake::new(offset, format!("a {what} with {count} numbers; expected three: x y z"))
        })?;
        *value = number(token).ok_or_else(|| {
            let expected = "expected a finite decimal number";
            Mistake::new(offset, format!("{} in a {what}; {expected}", quoted(token)))
        })?;
    }
    Ok(Vec3::from_array(values))
}
