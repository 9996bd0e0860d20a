//! Reads the texture coordinates (`vt`) of OBJ files. Coordinates far from 0 are stored in double precision,
//! since single precision would lose the digits after the point. The digits after the point decide where a
//! repeated texture lies on a triangle.

use super::text::{Chunk, Mistake, Seen, decimal, keyword, number, quoted_number, tokens};
use crate::scene::Mapped;

/// The texture coordinates of a file, or of a piece of it.
#[derive(Default)]
pub(super) struct Coordinates {
    /// All coordinates, rounded to single precision.
    rounded: Vec<[f32; 2]>,
    /// The coordinates far from 0, in double precision, each with its index in `rounded`. The list is sorted
    /// by the index in `rounded`.
    far: Vec<(usize, [f64; 2])>,
}

impl Coordinates {
    fn push(&mut self, coordinate: [f64; 2]) {
        if coordinate.iter().any(|value| value.abs() > Mapped::NEAR) {
            self.far.push((self.rounded.len(), coordinate));
        }
        self.rounded.push(coordinate.map(|value| value as f32));
    }

    /// Joins the coordinates of all pieces of a file, in the order of the pieces.
    pub fn joined(pieces: Vec<Self>) -> Self {
        let mut all = Self::default();
        all.rounded.reserve_exact(pieces.iter().map(Self::count).sum());
        for piece in pieces {
            let before = all.count();
            all.far.extend(piece.far.into_iter().map(|(index, exact)| (before + index, exact)));
            all.rounded.extend(piece.rounded);
        }
        all
    }

    /// Returns the number of coordinates.
    pub fn count(&self) -> usize {
        self.rounded.len()
    }

    /// Returns the texture coordinate with the index `index`.
    pub fn at(&self, index: u32) -> [f64; 2] {
        let index = index as usize;
        match self.far.binary_search_by_key(&index, |(far, _)| *far) {
            Ok(found) => self.far[found].1,
            Err(_) => self.rounded[index].map(f64::from),
        }
    }
}

/// The lines with texture coordinates of which raycl ignores something.
#[derive(Clone, Copy, Default)]
pub(super) struct Unread {
    /// Coordinates that are not valid.
    pub odd: Seen,
    /// Coordinates with a word other than 0 after the second number. Pictures have only two directions.
    pub surplus: Seen,
}

/// Reads the texture coordinates of a piece. Coordinates that are not valid become NaN.
pub(super) fn read(chunk: &Chunk) -> (Coordinates, Unread) {
    let (mut coordinates, mut unread) = (Coordinates::default(), Unread::default());
    for (offset, line) in chunk.lines() {
        if let (b"vt", rest) = keyword(line) {
            let mut words = tokens(rest);
            let read = coordinate(offset, &mut words);
            match read {
                Ok(_) => unread.surplus.at_if(words.any(|word| number(word) != Some(0.0)), offset),
                Err(_) => unread.odd.at(offset),
            }
            coordinates.push(read.unwrap_or([f64::NAN; 2]));
        }
    }
    (coordinates, unread)
}

/// Reads the two numbers of a texture coordinate. If the second number of the coordinate is missing, 0 is used.
fn coordinate<'a>(offset: usize, tokens: &mut impl Iterator<Item = &'a [u8]>) -> Result<[f64; 2], Mistake> {
    let mut next = |usual: Option<&'static [u8]>| {
        let token = tokens.next().or(usual).unwrap_or_default();
        let wrong = "in a texture coordinate (vt); expected a finite decimal number";
        value(token).ok_or_else(|| Mistake::new(offset, format!("{} {wrong}", quoted_number(token))))
    };
    Ok([next(None)?, next(Some(b"0"))?])
}

/// Parses a number in single precision, which is fast. If the number is far from 0, parses it again in double
/// precision. Returns `None` if `token` is not a finite decimal number.
fn value(token: &[u8]) -> Option<f64> {
    let rounded = f64::from(number(token)?);
    if rounded.abs() > Mapped::NEAR { decimal(token) } else { Some(rounded) }
}

/// Returns the error for a texture coordinate that is not valid.
pub(super) fn mistake_in_coordinate(offset: usize, rest: &[u8]) -> Mistake {
    let none = |_| Mistake::new(offset, "a texture coordinate is not valid");
    coordinate(offset, &mut tokens(rest)).map_or_else(|mistake| mistake, none)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn only_coordinates_far_from_0_are_read_in_double_precision() {
        let read = |line: &[u8]| coordinate(0, &mut tokens(line));
        assert_eq!(read(b" 0.1 64.000001").unwrap(), [f64::from(0.1_f32), 64.0]);
        assert_eq!(read(b" 500000.1 -64.1").unwrap(), [500_000.1, -64.1]);
        // The number 1e39 is finite in double precision, but not in single precision. The coordinate 1e39 is
        // refused, because raycl shifts coordinates and then stores them in single precision.
        assert!(read(b" 1e39 0").is_err());
    }

    #[test]
    fn pieces_are_joined_with_their_coordinates_far_from_0() {
        let piece = |list: &[[f64; 2]]| {
            let mut piece = Coordinates::default();
            list.iter().for_each(|coordinate| piece.push(*coordinate));
            piece
        };
        let lists: [&[[f64; 2]]; 3] = [&[[0.5, 0.25], [1e6 + 0.1, 0.75]], &[], &[[2.0, 3.0], [0.0, -64.1]]];
        let all = Coordinates::joined(lists.map(piece).into());
        assert_eq!((all.count(), all.far.len()), (4, 2));
        let found: Vec<_> = (0..4).map(|index| all.at(index)).collect();
        assert_eq!(found, lists.concat());
    }
}
