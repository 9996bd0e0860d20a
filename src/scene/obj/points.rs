//! The first pass over an OBJ file: reads vertices and normals, and the names of MTL files, materials and
//! smoothing groups, and counts unsupported statements. This pass only records vertices and normals that are
//! not valid. A later step refuses the file if a face uses a vertex that is not valid ([`super::odd`]).

use super::asked::Asked;
use super::odd::Odd;
use super::smoothing;
use super::text::{
    Chunk, Mistake, Seen, Source, decimal, keyword, number, quoted_number, tokens, usual_vector, words,
};
use super::vertex_colours::UNCOLOURED;
use super::wishes;
use crate::scene::files::{LARGEST, Placement};
use crate::scene::validate::MAX_COORDINATE;
use crate::words::counted;
use glam::{DVec3, Vec3};

/// How positions are read.
#[derive(Clone, Copy)]
pub(super) struct Reading {
    /// How positions are moved and scaled before they are rounded to single precision; `None` if this is not
    /// known yet; positions then stay unchanged.
    pub placement: Option<Placement>,
    /// True if coordinates up to [`LARGEST`] are valid.
    pub is_large: bool,
}

impl Reading {
    /// Positions are neither moved nor scaled. A position is valid if its coordinates are within
    /// +-`MAX_COORDINATE`.
    pub const USUAL: Self = Self { placement: None, is_large: false };
    /// Positions are neither moved nor scaled. A position is valid if its coordinates are within
    /// +-[`LARGEST`].
    pub const LARGE: Self = Self { is_large: true, ..Self::USUAL };

    /// Returns the form that a vertex's line should have.
    fn expected_vertex(&self) -> String {
        format!("`v x y z`: three finite numbers within +-{}", self.limit())
    }

    /// Returns the largest valid coordinate, for messages.
    fn limit(&self) -> String {
        if self.is_large { format!("{LARGEST:e}") } else { format!("{MAX_COORDINATE:e}") }
    }

    /// Returns true if positions are neither moved nor scaled, and if large coordinates are not valid.
    fn is_unchanged(&self) -> bool {
        !self.is_large && self.placement.is_none_or(|placement| placement == Placement::IDENTITY)
    }

    /// Reads a position in the most frequent form (see [`usual_vector`]). Returns `None` if `rest` has another
    /// form, if positions are moved or scaled, or if large coordinates are valid.
    fn usual_position(&self, rest: &[u8]) -> Option<Vec3> {
        if self.is_unchanged() { usual_vector(rest).map(Vec3::from_array) } else { None }
    }

    /// Reads a position, moves and scales it, and rounds it to single precision. Returns `None` if the
    /// position is not valid.
    fn position<'a>(&self, tokens: &mut impl Iterator<Item = &'a [u8]>) -> Option<Vec3> {
        if self.is_unchanged() {
            return position(0, tokens, self).ok();
        }
        let exact = self.exact(tokens)?;
        Some(self.placement.map_or(exact.as_vec3(), |placement| placement.settled(exact)))
    }

    /// Reads a position in double precision, without moving or scaling it. Returns `None` if the position is
    /// not valid.
    fn exact<'a>(&self, tokens: &mut impl Iterator<Item = &'a [u8]>) -> Option<DVec3> {
        let mut values = [0.0; 3];
        for value in &mut values {
            *value = decimal(tokens.next()?)?;
        }
        values.iter().all(|value| self.is_valid(*value)).then_some(DVec3::from_array(values))
    }

    fn is_valid(&self, value: f64) -> bool {
        match self.is_large {
            true => value.abs() <= LARGEST,
            false => (value as f32).abs() <= MAX_COORDINATE,
        }
    }

    /// Reads a number in single precision. A number that is too large for single precision becomes infinite if
    /// coordinates of this size are valid, and `None` otherwise.
    fn number(&self, token: &[u8]) -> Option<f32> {
        match self.is_large {
            true => decimal(token).filter(|value| self.is_valid(*value)).map(|value| value as f32),
            false => number(token),
        }
    }
}

/// The contents of a piece of the file, except its faces and texture coordinates.
#[derive(Default)]
pub(super) struct PointChunk {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// The names in `mtllib` lines.
    pub libraries: Vec<String>,
    /// The text after the last `usemtl` of the piece; `None` if there is no `usemtl`.
    pub last_material: Option<String>,
    /// Number of vertices with a colour.
    pub coloured: usize,
    /// Colours as they are in the file: one per vertex, up to the last vertex with a colour. A vertex without
    /// a colour has [`UNCOLOURED`].
    pub colours: Vec<Vec3>,
    /// The index within the piece and the alpha, as it is in the file, of each vertex with an alpha.
    pub alphas: Vec<(u32, f32)>,
    /// Vertices with a colour that is not valid. These vertices count as vertices without a colour.
    pub odd_colours: Vec<Odd>,
    /// Vertices with a weight other than 1.
    pub weights: Seen,
    /// Vertices with numbers after their alpha, and normals with more than three numbers.
    pub surplus: Seen,
    /// The smoothing group of the last `s` line of the piece; `None` if there is no `s` line.
    pub last_smoothing: Option<String>,
    /// The vertices with exactly two coordinates, if both coordinates are valid.
    pub flat: Vec<Odd>,
    /// The vertices that are not valid. In `positions`, the coordinates of vertices that are not valid are
    /// NaN.
    pub odd_vertices: Vec<Odd>,
    /// The normals that are not valid. In `normals`, normals that are not valid are zero.
    pub odd_normals: Vec<Odd>,
    /// Unsupported statements.
    pub asked: Asked,
}

impl PointChunk {
    /// Reads the words after a vertex's coordinates. Three numbers are a colour, and a fourth number is its alpha. A
    /// single number is ignored: it is a weight, which concerns only curves and surfaces. Other words are recorded as a
    /// colour that is not valid, and the vertex gets no colour.
    fn colour<'a>(&mut self, mut tokens: impl Iterator<Item = &'a [u8]>, offset: usize) {
        let vertex = self.positions.len() - 1;
        let mut next = || tokens.next().map(number);
        let (red, green, blue) = match (next(), next(), next()) {
            (Some(Some(red)), Some(Some(green)), Some(Some(blue))) => (red, green, blue),
            (None, ..) => return,
            (Some(Some(weight)), None, _) => return self.weights.at_if(weight != 1.0, offset),
            _ => return self.odd_colours.push(Odd { number: vertex, offset }),
        };
        if let Some(alpha) = next() {
            // A fourth word that is not a number counts as an alpha of 0, so that the note on ignored alphas
            // counts it.
            self.alphas.push((vertex as u32, alpha.unwrap_or_default()));
            self.surplus.at_if(next().is_some(), offset);
        }
        self.coloured += 1;
        self.colours.resize(vertex, UNCOLOURED);
        self.colours.push(Vec3::new(red, green, blue));
    }

    fn vertex(&mut self, rest: &[u8], offset: usize, reading: &Reading) {
        if let Some(position) = reading.usual_position(rest) {
            self.positions.push(position);
            return;
        }
        let mut words = tokens(rest);
        match reading.position(&mut words) {
            Some(position) => {
                self.positions.push(position);
                self.colour(words, offset);
            }
            None => self.odd_vertex(rest, offset, reading),
        }
    }

    /// Reads a vertex that does not have three valid coordinates. If the vertex has only two coordinates and
    /// both are valid, its z is 0.
    fn odd_vertex(&mut self, rest: &[u8], offset: usize, reading: &Reading) {
        let odd = Odd { number: self.positions.len(), offset };
        let with_z = || reading.position(&mut tokens(rest).chain([&b"0"[..]]));
        let flat = (tokens(rest).count() == 2).then(with_z).flatten();
        let list = if flat.is_some() { &mut self.flat } else { &mut self.odd_vertices };
        list.push(odd);
        self.positions.push(flat.unwrap_or(Vec3::NAN));
    }

    fn normal(&mut self, rest: &[u8], offset: usize) {
        if let Some(normal) = usual_vector(rest) {
            self.normals.push(Vec3::from_array(normal));
            return;
        }
        let mut words = tokens(rest);
        let normal = vector(offset, "normal", &mut words, &Reading::USUAL);
        self.surplus.at_if(normal.is_ok() && words.next().is_some(), offset);
        self.normals.push(normal.unwrap_or_else(|_| {
            self.odd_normals.push(Odd { number: self.normals.len(), offset });
            Vec3::ZERO
        }));
    }

    /// Marks the vertices with only two coordinates as not valid.
    fn drop_flat(&mut self) {
        self.flat.iter().for_each(|flat| self.positions[flat.number] = Vec3::NAN);
        self.odd_vertices.append(&mut self.flat);
        self.odd_vertices.sort_unstable_by_key(|odd| odd.number);
    }

    /// Returns the bounding box of the valid positions; `None` if there are none.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut valid = self.positions.iter().filter(|position| !position.is_nan());
        let first = *valid.next()?;
        Some(valid.fold((first, first), |(low, high), p| (low.min(*p), high.max(*p))))
    }

    /// Returns the bounding box of the valid positions of this piece, in double precision. The box includes
    /// only the vertices for which `counts` returns true. The argument of `counts` is a vertex's index within
    /// the piece. Returns `None` if the box includes no vertex.
    pub fn exact_bounds(
        &self,
        chunk: &Chunk,
        reading: &Reading,
        counts: impl Fn(usize) -> bool,
    ) -> Option<(DVec3, DVec3)> {
        let is_odd = |number| self.odd_vertices.binary_search_by_key(&number, |odd| odd.number).is_ok();
        let position = |(number, rest): (usize, &[u8])| {
            let is_wanted = counts(number) && !is_odd(number);
            // The appended 0 is the z of a vertex with only two coordinates.
            is_wanted.then(|| reading.exact(&mut tokens(rest).chain([&b"0"[..]]))).flatten()
        };
        let mut positions = vertices(chunk).enumerate().filter_map(position);
        let first = positions.next()?;
        Some(positions.fold((first, first), |(low, high), p| (low.min(p), high.max(p))))
    }
}

/// Returns the text after the `v` of each vertex.
fn vertices<'a>(chunk: &'a Chunk) -> impl Iterator<Item = &'a [u8]> {
    chunk.lines().filter_map(|(_, line)| match keyword(line) {
        (b"v", rest) => Some(rest),
        _ => None,
    })
}

/// Returns the positions of all vertices of a piece of the file, in double precision. Vertices that are not valid are
/// zero.
pub(super) fn exact_positions(chunk: &Chunk, reading: &Reading) -> Vec<DVec3> {
    // The appended 0 is the z of a vertex with only two coordinates.
    let exact = |rest| reading.exact(&mut tokens(rest).chain([&b"0"[..]])).unwrap_or_default();
    vertices(chunk).map(exact).collect()
}

/// Reads a piece of the file, except its faces and texture coordinates.
pub(super) fn read(chunk: &Chunk, reading: &Reading) -> PointChunk {
    let mut points = PointChunk::default();
    for (offset, line) in chunk.lines() {
        match keyword(line) {
            (b"v", rest) => points.vertex(rest, offset, reading),
            (b"vn", rest) => points.normal(rest, offset),
            (b"f" | b"fo" | b"vt" | b"", _) => {}
            (b"mtllib", rest) => points.libraries.push(words(rest)),
            (b"usemtl", rest) => points.last_material = Some(words(rest)),
            (b"s", rest) => points.last_smoothing = Some(smoothing::group(rest)),
            (word, rest) => wishes::of_line(&mut points.asked, word, rest),
        }
    }
    points
}

/// If some vertices of the file have two coordinates and others three, marks the vertices with two
/// coordinates as not valid. If all valid vertices have two coordinates, as in a plane drawing, nothing
/// changes.
pub(super) fn drop_mixed(chunks: &mut [PointChunk]) {
    let flat: usize = chunks.iter().map(|chunk| chunk.flat.len()).sum();
    let valid: usize = chunks.iter().map(|chunk| chunk.positions.len() - chunk.odd_vertices.len()).sum();
    if 0 < flat && flat < valid {
        chunks.iter_mut().for_each(PointChunk::drop_flat);
    }
}

/// Adds a note on vertices with only two coordinates, if there are any.
pub(super) fn note_flat(chunks: &[PointChunk], notes: &mut Vec<String>) {
    let flat = chunks.iter().map(|chunk| chunk.flat.len()).sum();
    let note = || format!("{} with two numbers each: z is 0", counted(flat, "vertex"));
    notes.extend((flat > 0).then(note));
}

/// Adds a note on the weights of vertices, and a note on vertices and normals with more numbers than raycl reads, if
/// there are any.
pub(super) fn note_surplus(chunks: &[PointChunk], source: &Source, notes: &mut Vec<String>) {
    let weights = Seen::of_all(chunks.iter().map(|chunk| chunk.weights));
    notes.extend(source.note_on_lines(
        "line ",
        weights,
        "a single number other than 1 after `v x y z` is ignored",
    ));
    let surplus = Seen::of_all(chunks.iter().map(|chunk| chunk.surplus));
    let what = "numbers after the seventh of `v` or the third of `vn` are ignored";
    notes.extend(source.note_on_lines("line ", surplus, what));
}

/// Returns the error for a vertex that is not valid. `scaled` is true if the mesh may be scaled. The error then usually
/// names the limit [`LARGEST`]. The error names `MAX_COORDINATE` if the vertex exceeds only this limit: such a vertex
/// would be valid if a face used it, since raycl would then scale the mesh.
pub(super) fn mistake_in_vertex(offset: usize, rest: &[u8], scaled: bool) -> Mistake {
    let reading = if scaled && !is_large(rest) { Reading::LARGE } else { Reading::USUAL };
    let flat = |_| Mistake::new(offset, "a vertex with 2 numbers; expected three: x y z");
    let mistake = position(offset, &mut tokens(rest), &reading).map_or_else(|mistake| mistake, flat);
    mistake.expecting(reading.expected_vertex())
}

/// Returns the error for a normal that is not valid.
pub(super) fn mistake_in_normal(offset: usize, rest: &[u8]) -> Mistake {
    let none = |_| Mistake::new(offset, "a normal is not valid");
    vector(offset, "normal", &mut tokens(rest), &Reading::USUAL).map_or_else(|mistake| mistake, none)
}

fn position<'a>(
    offset: usize,
    tokens: &mut impl Iterator<Item = &'a [u8]>,
    reading: &Reading,
) -> Result<Vec3, Mistake> {
    let position = vector(offset, "vertex", tokens, reading)?;
    if position.abs().max_element() <= MAX_COORDINATE {
        return Ok(position);
    }
    let message = format!(
        "vertex ({:e}, {:e}, {:e}) is out of range; expected coordinates within +-{MAX_COORDINATE:e}, \
         since products of larger coordinates overflow in single precision",
        position.x, position.y, position.z
    );
    Err(Mistake::new(offset, message))
}

/// Returns true if the numbers in `rest` would be a valid vertex of a mesh that may be scaled.
pub(super) fn is_large(rest: &[u8]) -> bool {
    Reading::LARGE.exact(&mut tokens(rest)).is_some()
}

/// Reads the first three numbers of a line; further numbers may follow. `what` is "vertex" or "normal", for
/// messages.
fn vector<'a>(
    offset: usize,
    what: &str,
    tokens: &mut impl Iterator<Item = &'a [u8]>,
    reading: &Reading,
) -> Result<Vec3, Mistake> {
    let mut values = [0.0; 3];
    for (count, value) in values.iter_mut().enumerate() {
        let token = tokens.next().ok_or_else(|| {
            let numbers = counted(count, "number");
            Mistake::new(offset, format!("a {what} with {numbers}; expected three: x y z"))
        })?;
        *value = reading.number(token).ok_or_else(|| {
            let expected = match decimal(token) {
                // A normal may be as large as single precision allows.
                Some(_) if what == "normal" => format!("expected a number within +-{:e}", f32::MAX),
                Some(_) => format!("expected a number within +-{}", reading.limit()),
                None => "expected a finite decimal number".to_owned(),
            };
            Mistake::new(offset, format!("{} in a {what}; {expected}", quoted_number(token)))
        })?;
    }
    Ok(Vec3::from_array(values))
}
