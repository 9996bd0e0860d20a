//! Reads the elements of an ASCII PLY file, one per line. The reader of the crate `ply-rs-bw` is not used here, because
//! it refuses numbers such as `nan`, `.5` and `5.`, which some programs write.

use crate::scene::files::flaw::Flaw;
use crate::scene::obj::{quoted, split_lines};
use ply_rs_bw::ply::{ElementDef, Property, PropertyAccess, PropertyType, ScalarType};
use std::str::FromStr;

/// The lines after the header that are neither empty nor comments.
pub(super) struct Lines<'a> {
    /// The lines that are not read yet, and their numbers.
    unread: Box<dyn Iterator<Item = (usize, &'a [u8])> + 'a>,
    /// The number of lines that were read and that have words after the last property.
    longer: usize,
}

impl<'a> Lines<'a> {
    /// Returns the lines of `text`. The number of its first line is `first`.
    pub fn of(text: &'a [u8], first: usize) -> Self {
        let lines = (first..).zip(split_lines(text));
        Self { unread: Box::new(lines.filter(|(_, line)| !is_ignored(line))), longer: 0 }
    }

    /// Reads all elements of the type `of`.
    pub fn elements<E: PropertyAccess>(&mut self, of: &ElementDef) -> Result<Vec<E>, Flaw> {
        let ends = |read: usize| {
            let (name, count) = (quoted(of.name.as_bytes()), of.count);
            let counts = format!("the file ends after {read} of {count} elements");
            Flaw::quoting(format!("{counts} {name}"), format!("{counts} of a type"))
        };
        let element = |read| {
            let (number, line) = self.unread.next().ok_or_else(|| ends(read))?;
            let (element, is_longer) = element(of, line).map_err(|flaw| flaw.at(number))?;
            self.longer += usize::from(is_longer);
            Ok(element)
        };
        (0..of.count).map(element).collect()
    }

    /// Returns the number of read lines with words after the last property, and the number of lines that are not read
    /// yet.
    pub fn ignored(self) -> (usize, usize) {
        (self.longer, self.unread.count())
    }
}

/// Returns true if a line is empty or a comment. PLY allows comments only in the header, but some files also
/// have comments between elements.
fn is_ignored(line: &[u8]) -> bool {
    line.split(u8::is_ascii_whitespace).find(|word| !word.is_empty()).is_none_or(|word| word == b"comment")
}

/// Reads an element of the type `of` from its line. The second result is true if the line has words after the last
/// property.
fn element<E: PropertyAccess>(of: &ElementDef, line: &[u8]) -> Result<(E, bool), Flaw> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let mut element = E::new();
    for (name, property) in &of.properties {
        let value = match &property.data_type {
            PropertyType::Scalar(kind) => scalar(kind, &mut words)?,
            PropertyType::List(_, kind) => {
                let count = next(&mut words, whole, WHOLE)?;
                list(kind, count, &mut words)?
            }
        };
        element.set_property(name, value);
    }
    Ok((element, words.next().is_some()))
}

/// The expected form of a number of an integer type.
const WHOLE: &str = "a whole number in the range of its type";
/// The expected form of a number of a floating-point type.
const DECIMAL: &str = "a decimal number";

fn scalar<'a>(kind: &ScalarType, words: &mut impl Iterator<Item = &'a [u8]>) -> Result<Property, Flaw> {
    Ok(match kind {
        ScalarType::Char => Property::Char(next(words, whole, WHOLE)?),
        ScalarType::UChar => Property::UChar(next(words, whole, WHOLE)?),
        ScalarType::Short => Property::Short(next(words, whole, WHOLE)?),
        ScalarType::UShort => Property::UShort(next(words, whole, WHOLE)?),
        ScalarType::Int => Property::Int(next(words, whole, WHOLE)?),
        ScalarType::UInt => Property::UInt(next(words, whole, WHOLE)?),
        // Numbers of the type `float` are read in double precision, too: some programs write more digits than
        // single precision has. A mesh far from the origin is moved to the origin before positions are rounded.
        ScalarType::Float | ScalarType::Double => Property::Double(next(words, parsed, DECIMAL)?),
    })
}

fn list<'a>(
    kind: &ScalarType,
    count: usize,
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<Property, Flaw> {
    Ok(match kind {
        ScalarType::Char => Property::ListChar(several(count, words, whole, WHOLE)?),
        ScalarType::UChar => Property::ListUChar(several(count, words, whole, WHOLE)?),
        ScalarType::Short => Property::ListShort(several(count, words, whole, WHOLE)?),
        ScalarType::UShort => Property::ListUShort(several(count, words, whole, WHOLE)?),
        ScalarType::Int => Property::ListInt(several(count, words, whole, WHOLE)?),
        ScalarType::UInt => Property::ListUInt(several(count, words, whole, WHOLE)?),
        ScalarType::Float => Property::ListFloat(several(count, words, parsed, DECIMAL)?),
        ScalarType::Double => Property::ListDouble(several(count, words, parsed, DECIMAL)?),
    })
}

/// Reads the `count` numbers of a list.
fn several<'a, T>(
    count: usize,
    words: &mut impl Iterator<Item = &'a [u8]>,
    read: fn(&[u8]) -> Option<T>,
    expected: &str,
) -> Result<Vec<T>, Flaw> {
    (0..count).map(|_| next(words, read, expected)).collect()
}

/// Reads the next word with `read`. Returns an error if there is no word, or if `read` returns `None`.
fn next<'a, T>(
    words: &mut impl Iterator<Item = &'a [u8]>,
    read: fn(&[u8]) -> Option<T>,
    expected: &str,
) -> Result<T, Flaw> {
    let word = words.next().ok_or("the line has fewer numbers than its element needs")?;
    read(word).ok_or_else(|| {
        let unquoted = format!("a value is not valid; expected {expected}");
        Flaw::not_a_number(word, &format!("; expected {expected}"), unquoted)
    })
}

/// Parses a number, which need not be finite: scanners write NaN for points that they did not measure.
fn parsed<T: FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Parses a whole number. Some programs write whole numbers with a decimal point or an exponent. Returns
/// `None` if the number is not whole or does not fit into `T`.
fn whole<T: TryFrom<i64>>(word: &[u8]) -> Option<T> {
    // All whole numbers up to this one are exact in double precision.
    const MOST: f64 = (1_u64 << 53) as f64;
    let is_whole = |value: &f64| value.fract() == 0.0 && value.abs() <= MOST;
    let decimal = || parsed(word).filter(is_whole).map(|value| value as i64);
    T::try_from(parsed(word).or_else(decimal)?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_read_in_every_form_and_only_within_their_range() {
        let bytes = ["0", "255", "+7", "7.", "7.0", "2.55e2"].map(|text| whole::<u8>(text.as_bytes()));
        assert_eq!(bytes, [Some(0), Some(255), Some(7), Some(7), Some(7), Some(255)]);
        for text in ["256", "-1", "7.5", "nan", "inf", "", "x", "1e300", "9223372036854775808"] {
            assert_eq!(whole::<u8>(text.as_bytes()), None, "{text}");
        }
        assert_eq!(whole::<u32>(b"4294967295"), Some(u32::MAX));
    }
}
