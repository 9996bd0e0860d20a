//! The first pass: vertices, normals, which materials are spoken of, and what is asked for that is not done.

use super::asked::Asked;
use super::text::{Chunk, Mistake, keyword, number, quoted, tokens, words};
use super::wishes;
use crate::scene::MAX_COORDINATE;
use glam::Vec3;
use std::collections::BTreeSet;

/// What a piece of the file says before its faces are read.
#[derive(Default)]
pub(super) struct PointChunk {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// What `mtllib` lines name.
    pub libraries: Vec<String>,
    /// The material that holds after the piece, if it changed.
    pub last_material: Option<String>,
    /// Vertices with a colour.
    pub colours: usize,
    /// The smoothing groups that `s` lines name; `off` is one.
    pub smoothing: BTreeSet<String>,
    /// What other statements ask for.
    pub asked: Asked,
}

pub(super) fn read(chunk: &Chunk) -> Result<PointChunk, Mistake> {
    let mut points = PointChunk::default();
    for (offset, line) in chunk.lines() {
        match keyword(line) {
            (b"v", rest) => {
                let mut tokens = tokens(rest);
                points.positions.push(position(offset, &mut tokens)?);
                // One more number is a weight; three are a colour.
                points.colours += usize::from(tokens.nth(2).is_some());
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

/// A group's number; none is as good as `off`.
fn smoothing_group(rest: &[u8]) -> String {
    match tokens(rest).next() {
        None | Some(b"0" | b"off") => "off".to_owned(),
        Some(group) => words(group),
    }
}

fn position<'a>(offset: usize, tokens: &mut impl Iterator<Item = &'a [u8]>) -> Result<Vec3, Mistake> {
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

/// The first three numbers; a weight or a colour may follow.
fn vector<'a>(
    offset: usize,
    what: &str,
    tokens: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<Vec3, Mistake> {
    let mut values = [0.0; 3];
    for (count, value) in values.iter_mut().enumerate() {
        let token = tokens.next().ok_or_else(|| {
            Mistake::new(offset, format!("a {what} of {count} numbers; expected three: x y z"))
        })?;
        *value = number(token).ok_or_else(|| {
            let expected = "expected a finite decimal number";
            Mistake::new(offset, format!("{} in a {what}; {expected}", quoted(token)))
        })?;
    }
    Ok(Vec3::from_array(values))
}
