//! The first pass: vertices, normals, and which materials are spoken of.

use super::text::{Chunk, Mistake, keyword, number, quoted, tokens, words};
use crate::scene::MAX_COORDINATE;
use glam::Vec3;

/// What a piece of the file says before its faces are read.
#[derive(Default)]
pub(super) struct PointChunk {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// What `mtllib` lines name.
    pub libraries: Vec<String>,
    /// The material that holds after the piece, if it changed.
    pub last_material: Option<String>,
}

pub(super) fn read(chunk: &Chunk) -> Result<PointChunk, Mistake> {
    let mut points = PointChunk::default();
    for (offset, line) in chunk.lines() {
        match keyword(line) {
            (b"v", rest) => points.positions.push(position(offset, rest)?),
            (b"vn", rest) => points.normals.push(vector(offset, "normal", rest)?),
            (b"mtllib", rest) => points.libraries.push(words(rest)),
            (b"usemtl", rest) => points.last_material = Some(words(rest)),
            _ => {}
        }
    }
    Ok(points)
}

fn position(offset: usize, rest: &[u8]) -> Result<Vec3, Mistake> {
    let position = vector(offset, "vertex", rest)?;
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

/// The first three numbers; a weight or a colour may follow and is passed over.
fn vector(offset: usize, what: &str, rest: &[u8]) -> Result<Vec3, Mistake> {
    let mut tokens = tokens(rest);
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
