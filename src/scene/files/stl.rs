//! Reads ASCII and binary STL. Triangles in STL share no corners. Equal corners are joined, so that surfaces
//! can be smooth. The facets' normals are not used, since the order of the corners determines the normals.

mod normals;

use super::MeshFile;
use super::flaw::{Flaw, Named};
use super::joined::{Sorted, joined, key};
use super::origin::{Limit, note_coarse, note_inexact, settle};
use crate::error::Result;
use crate::memory::Available;
use crate::scene::material::Material;
use crate::scene::mesh::{Mesh, Triangle};
use crate::scene::normals::MISSING;
use crate::scene::obj::{Asked, Wish, decimal, split_lines};
use crate::words::{counted, counted_are};
use glam::DVec3;
use normals::Normal;
use std::borrow::Cow;

/// The remedy for facets that are not triangles.
const DIVIDE: &str = "divide the faces into triangles, and export the file again";
/// Number of bytes before the triangles of a binary file.
const HEADER_BYTES: usize = 84;
/// Number of bytes of a triangle: a normal, three corners and two further bytes.
const TRIANGLE_BYTES: usize = 50;
/// Number of bytes at the beginning of a file that show whether the file is text. A file is not text if its
/// first `HEAD_BYTES` bytes contain a zero byte and no word `vertex`.
const HEAD_BYTES: usize = 1 << 10;
/// Keys in the header of a binary file, each with the word for its value in messages. The program Materialise Magics
/// writes such a key before the colour or the material of all facets.
const HEADER_KEYS: [(&str, &str); 2] = [("COLOR=", "colour"), ("MATERIAL=", "material")];

/// The bits of a corner's coordinates, by which corners are sorted.
type Key = [u64; 3];

/// Memory for a triangle of a binary file while equal corners are joined, in bytes. In memory are the triangle
/// and, for each of its three corners, four values: the corner as it is in the file, the corner's entry in the sorted
/// list, the index of the corner's position, and this position.
const JOINING_BYTES: u64 = (3 * (2 * size_of::<DVec3>() + size_of::<Sorted<Key>>() + size_of::<u32>())
    + size_of::<Triangle>()) as u64;

/// Reads an STL file from its bytes. Corners must be within `limit`.
pub(super) fn parse(named: Named<'_>, bytes: &[u8], limit: Limit) -> Result<MeshFile> {
    let failed = |flaw: Flaw| named.error(flaw);
    let (corners, mut notes) = match is_binary(bytes) {
        true => {
            let count = held(bytes).map_err(failed)?;
            hold(named.name, count as u64, &Available::read())?;
            let corners = binary(bytes, count);
            check(&corners, limit).map_err(failed)?;
            let mut notes = notes(bytes, count);
            notes.extend(normals::note(normals::opposite_of_rows(&bytes[HEADER_BYTES..], &corners)));
            (corners, notes)
        }
        // In a text file, a triangle usually takes 100 bytes or more. The check in `files::read` demands
        // memory of four times the file's size, which is enough for triangles of 100 bytes or more.
        false => {
            let Text { corners, unknown, stray, opposite, is_in_solid } =
                ascii(bytes, limit).map_err(failed)?;
            let mut notes: Vec<String> = unknown.notes("statement", named.quotes).collect();
            let numbers = counted_are(stray, "number after a complete statement");
            notes.extend((stray > 0).then(|| format!("{numbers} ignored")));
            notes.extend(normals::note(opposite));
            notes.extend(
                is_in_solid.then(|| "the file has no `endsolid` at its end: it may be cut off".to_owned()),
            );
            (corners, notes)
        }
    };
    let (exact, numbers) = joined(&corners, |corner| -> Key { key(corner.to_array(), f64::to_bits) });
    let triangles = triangles_of(&numbers);
    let (positions, placement) = settle(&exact, &triangles, limit).map_err(failed)?;
    notes.extend(is_binary(bytes).then(|| note_coarse(&triangles, &exact)).flatten());
    notes.extend(note_inexact(&triangles, &positions, placement.scale, || Cow::from(&exact)));
    let mesh = Mesh { positions, triangles, materials: vec![Material::default()], ..Mesh::default() };
    Ok(MeshFile { mesh, placement, notes, ..MeshFile::default() })
}

/// Refuses a binary file whose triangles do not fit into the available memory.
fn hold(name: &str, triangles: u64, available: &Available) -> Result<()> {
    let sum = format!("{JOINING_BYTES} B x {triangles} triangles");
    available.hold(JOINING_BYTES * triangles, &format!("reading {name}"), &sum)
}

/// Returns true if the file is binary: if its length matches the number of triangles in the header, or if its first
/// bytes are not text. A file that is shorter than a binary header counts as text. The word `solid` at the beginning is
/// no proof of a text file, because a binary file may also begin with it.
fn is_binary(bytes: &[u8]) -> bool {
    let Some(count) = count(bytes) else { return false };
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    let is_text = !head.contains(&0) || contains(head, b"vertex");
    HEADER_BYTES + TRIANGLE_BYTES * count == bytes.len() || !is_text
}

fn contains(text: &[u8], part: &[u8]) -> bool {
    text.windows(part.len()).any(|window| window == part)
}

/// Returns the number of triangles that the header states; `None` if the file is shorter than a header.
fn count(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u32::from_le_bytes(count.try_into().ok()?) as usize)
}

/// Returns the number of triangles to be read: the number in the header or, if the header has a 0, the number
/// of all triangles in the file. A program that writes to a stream may leave a 0 in the header. Returns an
/// error if the header states more triangles than the file contains.
fn held(bytes: &[u8]) -> std::result::Result<usize, Flaw> {
    let (said, held) = (count(bytes).unwrap_or(0), (bytes.len() - HEADER_BYTES) / TRIANGLE_BYTES);
    match said {
        0 => Ok(held),
        _ if said <= held => Ok(said),
        _ => Err(Flaw::quoting(
            format!("the header says {said} triangles, but the file holds {held}"),
            format!("the header says more triangles than the file holds ({held})"),
        )),
    }
}

fn rows(bytes: &[u8], count: usize) -> impl Iterator<Item = &[u8]> {
    bytes[HEADER_BYTES..].chunks_exact(TRIANGLE_BYTES).take(count)
}

/// Returns notes on parts of a binary file that are not read, and on a header that states 0 triangles
/// although the file contains triangles.
fn notes(bytes: &[u8], triangles: usize) -> Vec<String> {
    let mut notes = Vec::new();
    let attributes = rows(bytes, triangles).filter(|row| row[48..] != [0, 0]).count();
    if attributes > 0 {
        let facets = counted(attributes, "facet");
        notes.push(format!("attributes of {facets}, such as a colour, are not read"));
    }
    for (key, what) in HEADER_KEYS {
        if contains(&bytes[..HEADER_BYTES], key.as_bytes()) {
            notes.push(format!("the {what} in the header ({key}) is not read"));
        }
    }
    if count(bytes) == Some(0) && triangles > 0 {
        notes.push(format!("the header says 0 triangles: all {triangles} in the file are read"));
    }
    let rest = bytes.len() - HEADER_BYTES - TRIANGLE_BYTES * triangles;
    if rest > 0 {
        notes.push(format!("{} ignored", counted_are(rest, "byte after the last triangle")));
    }
    notes
}

/// Returns the corners of the triangles of a binary file, three corners per triangle.
fn binary(bytes: &[u8], count: usize) -> Vec<DVec3> {
    rows(bytes, count).flat_map(|row| [12, 24, 36].map(|at| vector(&row[at..]))).collect()
}

/// Returns the vector at the beginning of `bytes`, a corner or a normal of a binary file.
fn vector(bytes: &[u8]) -> DVec3 {
    let float = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    DVec3::new(float(bytes), float(&bytes[4..]), float(&bytes[8..]))
}

/// Returns an error if a corner of a binary file is not valid. The error names the corner as it is in the file,
/// before equal corners are joined.
fn check(corners: &[DVec3], limit: Limit) -> std::result::Result<(), Flaw> {
    let Some(at) = corners.iter().position(|corner| !limit.has(corner)) else { return Ok(()) };
    Err(limit.invalid(&format!("vertex {} of facet {}", at % 3, at / 3), &corners[at]))
}

/// The words that STL defines for a text file.
const WORDS: [&str; 9] =
    ["solid", "endsolid", "facet", "normal", "endfacet", "outer", "loop", "endloop", "vertex"];

/// The number of a line, from 1, and a word in this line.
type Word<'a> = (usize, &'a [u8]);

/// The contents of a text file.
struct Text {
    /// Three corners per triangle.
    corners: Vec<DVec3>,
    /// The words that STL does not define, such as `color`.
    unknown: Asked,
    /// The number of numbers that belong neither to a statement nor to an unknown word.
    stray: usize,
    /// The number of facets whose stated normal contradicts their corners.
    opposite: usize,
    /// True if the file ends within a solid.
    is_in_solid: bool,
}

/// Reads a text file. The mesh consists of the statements `vertex x y z`, three in each facet. Normals are compared
/// with the corners, but not used otherwise. Some programs write several statements into a line, so line ends count
/// only after the name of a solid.
fn ascii(bytes: &[u8], limit: Limit) -> std::result::Result<Text, Flaw> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let (mut corners, mut normals, mut unknown) = (Vec::new(), Vec::new(), Asked::default());
    let (mut stray, mut follows_unknown) = (0, false);
    let (mut is_in_solid, mut is_in_facet) = (false, false);
    // The number of corners before the current facet.
    let mut before = 0;
    let mut words = (1..).zip(split_lines(bytes)).flat_map(words_of).peekable();
    let mut last: &[u8] = b"";
    while let Some((line, word)) = words.next() {
        // Some programs write `end facet` for `endfacet`.
        let ends = is(std::mem::replace(&mut last, word), "end");
        if is(word, "vertex") {
            corners.push(vertex(line, &mut words, limit)?);
            follows_unknown = false;
        } else if is(word, "endfacet") && corners.len() - before != 3 {
            let flaw = Flaw::from("a facet without exactly three vertices").at(line);
            let has_more = corners.len() - before > 3;
            return Err(if has_more { flaw.with_remedy(DIVIDE) } else { flaw });
        } else if is(word, "facet") || is(word, "endfacet") {
            (is_in_facet, before) = (is(word, "facet") && !ends, corners.len());
        } else if is(word, "solid") || is(word, "endsolid") {
            is_in_solid = is(word, "solid") && !ends;
            skip_name(line, &mut words);
        } else if is(word, "normal") {
            // Up to three words after `normal` are skipped even if they are not numbers, because some
            // programs write words such as `-nan(ind)`.
            let mut next = || Some(words.next_if(|(_, word)| !is_known(word))?.1);
            if let [Some(x), Some(y), Some(z)] = [next(), next(), next()] {
                normals.push(Normal { corner: corners.len(), words: [x, y, z] });
            }
            follows_unknown = false;
        } else if word.starts_with(b"#") {
            // Some programs begin comments with this character.
            skip_name(line, &mut words);
            follows_unknown = false;
        } else if is_known(word) {
            follows_unknown = false;
        } else if decimal(word).is_some() {
            stray += usize::from(!follows_unknown);
        } else {
            unknown.add(Wish::Unknown, word);
            follows_unknown = true;
        }
    }
    let is_cut_off = is_in_facet && corners.len() == before;
    if corners.len().is_multiple_of(3) && !is_cut_off {
        let opposite = normals::opposite_of_words(&normals, &corners);
        return Ok(Text { corners, unknown, stray, opposite, is_in_solid });
    }
    let last = split_lines(bytes).count();
    Err(Flaw::from("the last facet ends before its third vertex").at(last))
}

fn words_of((number, line): (usize, &[u8])) -> impl Iterator<Item = Word<'_>> + Clone {
    let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.map(move |word| (number, word))
}

fn is(word: &[u8], expected: &str) -> bool {
    word.eq_ignore_ascii_case(expected.as_bytes())
}

fn is_known(word: &[u8]) -> bool {
    WORDS.iter().any(|known| is(word, known))
}

/// Skips the name of a solid, which may be any text. The name ends at the end of the line `line`, or before
/// `facet normal` in this line.
fn skip_name<'a>(line: usize, words: &mut (impl Iterator<Item = Word<'a>> + Clone)) {
    loop {
        let mut ahead = words.clone();
        let Some((_, first)) = ahead.next().filter(|(number, _)| *number == line) else { return };
        if is(first, "facet") && ahead.next().is_some_and(|(_, second)| is(second, "normal")) {
            return;
        }
        words.next();
    }
}

fn vertex<'a>(
    line: usize,
    words: &mut impl Iterator<Item = Word<'a>>,
    limit: Limit,
) -> std::result::Result<DVec3, Flaw> {
    let mut number = || {
        let next = words.next().filter(|(_, word)| !is_known(word));
        let short = || Flaw::from("a vertex with fewer than three numbers").at(line);
        let (line, word) = next.ok_or_else(short)?;
        decimal(word).ok_or_else(|| {
            let expected = "in a vertex; expected a finite decimal number";
            Flaw::not_a_number(word, &format!(" {expected}"), format!("not a number {expected}")).at(line)
        })
    };
    let corner = DVec3::new(number()?, number()?, number()?);
    if limit.has(&corner) { Ok(corner) } else { Err(limit.invalid("a vertex", &corner).at(line)) }
}

/// Returns one triangle for every three corners. `corners` has the index of each corner's position.
fn triangles_of(corners: &[u32]) -> Vec<Triangle> {
    let triangle = |corners: &[u32]| Triangle {
        positions: [corners[0], corners[1], corners[2]],
        normals: [MISSING; 3],
        material: 0,
    };
    corners.chunks_exact(3).map(triangle).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use glam::Vec3;

    fn parse(name: &str, bytes: &[u8]) -> Result<MeshFile> {
        super::parse(Named { name, quotes: true }, bytes, Limit::Usual)
    }

    const TWO: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
        endsolid a\nSOLID\n FACET NORMAL 0 0 1\n  OUTER LOOP\n  VERTEX 1 0 0\r\n  VERTEX 1. 1e0 -0\n  VERTEX .0 1 0\n  ENDLOOP\n ENDFACET\nENDSOLID\n";

    fn binary_of(corners: &[Vec3]) -> Vec<u8> {
        let mut bytes = b"solid, says this header of a binary file".to_vec();
        bytes.resize(80, b' ');
        bytes.extend((corners.len() as u32 / 3).to_le_bytes());
        for triangle in corners.chunks(3) {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flat_map(|c| c.to_array()).flat_map(f32::to_le_bytes));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn two_solids_in_any_case_share_their_equal_corners() {
        let mesh = parse("a.stl", TWO.as_bytes()).unwrap().mesh;
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 2));
        assert_eq!(mesh.corners(&mesh.triangles[1]), [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    }

    #[test]
    fn zero_and_minus_zero_are_one_corner() {
        let text = TWO.replace("VERTEX 1 0 0", "VERTEX 1 -0 -0").replace("VERTEX .0 1 0", "VERTEX -.0 1 0");
        assert_eq!(parse("a.stl", text.as_bytes()).unwrap().mesh.positions.len(), 4);
    }

    #[test]
    fn a_binary_file_holds_the_same() {
        let ascii = parse("a.stl", TWO.as_bytes()).unwrap().mesh;
        let corners: Vec<Vec3> = ascii.triangles.iter().flat_map(|t| ascii.corners(t)).collect();
        assert_eq!(parse("b.stl", &binary_of(&corners)).unwrap().mesh, ascii);
    }

    #[test]
    fn a_count_that_differs_from_the_file_is_noted_or_refused() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y].repeat(2);
        let whole = binary_of(&corners);
        let read = |change: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = whole.clone();
            change(&mut bytes);
            parse("b.stl", &bytes).map(|file| (file.mesh.triangles.len(), file.notes))
        };
        let noted = |note: &str| vec![note.to_owned()];
        let one = noted("50 bytes after the last triangle are ignored");
        assert_eq!(read(&|bytes| bytes[80] = 1).unwrap(), (1, one));
        let padded = noted("1 byte after the last triangle is ignored");
        assert_eq!(read(&|bytes| bytes.push(0)).unwrap(), (2, padded));
        let all = noted("the header says 0 triangles: all 2 in the file are read");
        assert_eq!(read(&|bytes| bytes[80] = 0).unwrap(), (2, all));
        for (key, what) in HEADER_KEYS {
            let note = noted(&format!("the {what} in the header ({key}) is not read"));
            let with_key = |bytes: &mut Vec<u8>| bytes[10..10 + key.len()].copy_from_slice(key.as_bytes());
            assert_eq!(read(&with_key).unwrap(), (2, note));
        }
        let error = read(&|bytes| bytes.truncate(150)).err().unwrap().to_string();
        assert!(error.contains("the header says 2 triangles, but the file holds 1"), "{error}");
    }

    /// The attribute of a facet is a number of two bytes.
    #[test]
    fn either_byte_of_an_attribute_counts() {
        for at in [132, 133] {
            let mut bytes = binary_of(&[Vec3::ZERO, Vec3::X, Vec3::Y]);
            bytes[at] = 1;
            let notes = parse("b.stl", &bytes).unwrap().notes;
            assert_eq!(notes, ["attributes of 1 facet, such as a colour, are not read"], "byte {at}");
        }
    }

    #[test]
    fn the_number_of_facets_with_attributes_is_reported() {
        let mut bytes = binary_of(&[Vec3::ZERO, Vec3::X, Vec3::Y].repeat(2));
        for (at, facets) in [(132, "1 facet"), (182, "2 facets")] {
            bytes[at] = 1;
            let notes = parse("b.stl", &bytes).unwrap().notes;
            assert_eq!(notes, [format!("attributes of {facets}, such as a colour, are not read")]);
        }
    }

    /// The test adds up the sizes of the five lists that are in memory while equal corners are joined. The
    /// bytes of the file are in memory, too, but are not counted here.
    #[test]
    fn a_binary_file_is_refused_if_its_corners_cannot_be_joined() {
        let (corners, sorted, numbers, positions, triangle) = (3 * 24, 3 * 32, 3 * 4, 3 * 24, 28);
        let needed = corners + sorted + numbers + positions + triangle;
        assert_eq!(JOINING_BYTES, needed);
        let held = |bytes: u64| hold("a.stl", 1000, &Available { bytes, source: "a test".to_owned() });
        assert!(held(1000 * needed).is_ok());
        let message = held(1000 * needed - 1).unwrap_err().to_string();
        assert!(message.starts_with("reading a.stl needs about"), "{message}");
        assert!(message.contains(&format!("({needed} B x 1000 triangles = ")), "{message}");
    }

    #[test]
    fn ends_in_two_words_end_what_they_name() {
        let mesh = parse("a.stl", TWO.as_bytes()).unwrap();
        let spaced = TWO.replace("endfacet", "end facet").replace("endsolid", "end solid");
        let spaced = spaced.replace("ENDFACET", "END FACET").replace("ENDSOLID", "END SOLID");
        assert_ne!(spaced, TWO);
        let read = parse("a.stl", spaced.as_bytes()).unwrap();
        assert_eq!(read.mesh, mesh.mesh);
        assert!(!format!("{:?}", read.notes).contains("cut off"), "{:?}", read.notes);
    }

    #[test]
    fn mistakes_have_their_lines() {
        for (from, to, message) in [
            ("vertex 0 1 0", "vertex 0 x 0", "a.stl:6: `x` in a vertex"),
            ("vertex 0 1 0\n", "", "a.stl:7: a facet without exactly three"),
            ("vertex 0 1 0", "vertex 0 nan 0", "a.stl:6"),
            ("vertex 0 1 0", "vertex 0", "a.stl:6: a vertex with fewer"),
            ("vertex 0 1 0", "vertex 0 1e13 0", "a.stl:6: a vertex is at [0, 10000000000000, 0]; expected"),
            (
                "endloop",
                "vertex 5 0 0\nvertex 5 1 0\nvertex 5 0 1\nendloop",
                "a.stl:11: a facet without exactly",
            ),
            ("endfacet\n", "endfacet\nfacet normal 0 0 1\nendfacet\n", "a.stl:10: a facet without exactly"),
        ] {
            let error = parse("a.stl", TWO.replacen(from, to, 1).as_bytes()).err().unwrap().to_string();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn a_facet_with_more_than_three_corners_is_not_called_damaged() {
        let remedy = |with: &str| {
            let text = TWO.replacen("vertex 0 1 0\n", with, 1);
            parse("a.stl", text.as_bytes()).err().unwrap().remedy().to_owned()
        };
        assert_eq!(remedy("vertex 0 1 0\nvertex 1 1 0\n"), DIVIDE);
        assert_ne!(remedy(""), DIVIDE);
    }

    #[test]
    fn a_corner_that_is_not_valid_is_named_by_its_facet() {
        for x in [f32::NAN, f32::INFINITY, 1e13] {
            let corners = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::X, Vec3::new(x, 0.0, 0.0), Vec3::Y];
            let error = parse("b.stl", &binary_of(&corners)).err().unwrap().to_string();
            assert!(error.starts_with("b.stl: vertex 1 of facet 1 is at ["), "{error}");
        }
    }

    #[test]
    fn statements_may_stand_in_any_lines() {
        let mesh = parse("a.stl", TWO.as_bytes()).unwrap().mesh;
        let one_line = TWO.replace(['\r', '\n'], " ");
        let odd_lines =
            TWO.replace("vertex 1 0 0", "vertex\n1\n\n0 0").replace("normal 0 0 1\n", "normal 0 0 1 ");
        for text in [TWO.replace("\r\n", "\n").replace('\n', "\r"), one_line, odd_lines] {
            assert_eq!(parse("a.stl", text.as_bytes()).unwrap().mesh, mesh, "{text:?}");
        }
        for (text, message) in [
            (TWO.replace("\r\n", "\n").replace('\n', "\r"), "a.stl:6: `x` in a vertex"),
            (TWO.replace("outer loop\nvertex", "outer loop vertex"), "a.stl:5: `x` in a vertex"),
            (TWO.replace("vertex 0 1 0", "vertex\n0\n1 0"), "a.stl:8: `x` in a vertex"),
        ] {
            let text =
                text.replacen("1 0\rendloop", "x 0\rendloop", 1).replacen("1 0\nendloop", "x 0\nendloop", 1);
            let error = parse("a.stl", text.as_bytes()).err().unwrap().to_string();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn the_name_of_a_solid_may_be_any_text() {
        let mesh = parse("a.stl", TWO.as_bytes()).unwrap().mesh;
        for name in ["vertex", "my facet vertex 1", "", "solid endfacet vertex"] {
            let text = TWO.replace("solid a", &format!("solid {name}"));
            assert_eq!(parse("a.stl", text.as_bytes()).unwrap().mesh, mesh, "{name}");
        }
    }

    #[test]
    fn words_that_stl_does_not_define_are_noted() {
        let notes =
            |from: &str, to: &str| parse("a.stl", TWO.replacen(from, to, 1).as_bytes()).unwrap().notes;
        for (from, to) in [
            ("solid a", "solid color 1 0 0"),
            ("endsolid a", "endsolid color"),
            ("normal 0 0 1", "normal -nan(ind) 1.#QNAN x"),
            ("normal 0 0 1", "normal 0 0"),
            ("normal 0 0 1", ""),
            ("solid a", "\u{feff}solid a"),
            ("solid a", "# exported by A 1.2\nsolid a\n#b 3"),
        ] {
            assert_eq!(notes(from, to), [""; 0], "{to}");
        }
        let colour = "unknown keywords of 1 statement are ignored (`color`)";
        assert_eq!(notes("solid a\n", "solid a\ncolor 1 0 0\n"), [colour]);
        assert_eq!(notes("vertex 0 0 0\n", "vertex 0 0 0 color 1 0 0\n"), [colour]);
        // The numbers after an unknown word belong to this word. Numbers after a complete statement belong to nothing,
        // and are counted.
        let stray = |count: &str| format!("{count} after a complete statement are ignored");
        assert_eq!(notes("vertex 0 0 0\n", "vertex 0 0 0 7 8\n"), [stray("2 numbers")]);
        assert_eq!(notes("endloop\n", "1 2 3\nendloop\n"), [stray("3 numbers")]);
        assert_eq!(
            notes("outer loop\n", "color 1 0 0\nouter loop 4 5\n"),
            [colour.to_owned(), stray("2 numbers")]
        );
        assert_eq!(
            notes("normal 0 0 1\n", "color 1 normal 0 0 1 4 5\n"),
            [colour.to_owned(), stray("2 numbers")]
        );
        assert_eq!(
            notes("vertex 0 0 0\n", "color 1 vertex 0 0 0 4 5\n"),
            [colour.to_owned(), stray("2 numbers")]
        );
        let withheld = super::parse(
            Named { name: "a.stl", quotes: false },
            TWO.replacen("solid a\n", "solid a\nsecret\n", 1).as_bytes(),
            Limit::Usual,
        );
        assert_eq!(withheld.unwrap().notes, ["unknown keywords of 1 statement are ignored"]);
    }

    #[test]
    fn facets_whose_normal_contradicts_the_corners_are_counted() {
        const COUNTS: &str =
            "a normal that contradicts the order of the corners; this order decides which side is the front";
        let one = vec![format!("1 facet states {COUNTS}")];
        let two = vec![format!("2 facets state {COUNTS}")];
        let down = |text: &str| text.replacen("normal 0 0 1", "normal 0 0 -1", 1);
        let both = down(TWO).replace("NORMAL 0 0 1", "NORMAL 1 0 -0.1");
        for (text, expected) in [
            (TWO.to_owned(), &[][..]),
            (down(TWO), &one),
            (both, &two),
            (TWO.replacen("normal 0 0 1", "normal 0 0 0", 1), &[]),
            (TWO.replacen("normal 0 0 1", "normal 0 0 x", 1), &[]),
            (down(TWO).replacen("vertex 0 1 0", "vertex 2 0 0", 1), &[]),
        ] {
            assert_eq!(parse("a.stl", text.as_bytes()).unwrap().notes, expected, "{text}");
        }
        let mut bytes = binary_of(&[Vec3::ZERO, Vec3::X, Vec3::Y].repeat(2));
        for (facet, z, expected) in [(0, 1.0, &[][..]), (0, -1.0, &one), (1, f32::NAN, &one), (1, -0.5, &two)]
        {
            let at = HEADER_BYTES + TRIANGLE_BYTES * facet + 8;
            bytes[at..at + 4].copy_from_slice(&f32::to_le_bytes(z));
            assert_eq!(parse("b.stl", &bytes).unwrap().notes, expected, "{facet} {z}");
        }
    }

    #[test]
    fn a_header_may_contain_the_word_vertex_and_a_text_a_zero_byte() {
        let mut binary = binary_of(&[Vec3::ZERO, Vec3::X, Vec3::Y]);
        binary[20..26].copy_from_slice(b"vertex");
        assert_eq!(parse("b.stl", &binary).unwrap().mesh.triangles.len(), 1);
        let text = TWO.replacen("solid a", "solid \0", 1);
        assert_eq!(parse("a.stl", text.as_bytes()).unwrap().mesh.triangles.len(), 2);
    }

    #[test]
    fn a_text_that_ends_in_a_facet_is_refused() {
        for next in ["vertex 0 1 0", "vertex 0 0 0", "outer loop", "VERTEX .0 1 0", "OUTER LOOP"] {
            let end = TWO.find(next).unwrap();
            let error = parse("a.stl", &TWO.as_bytes()[..end]).err().unwrap().to_string();
            assert!(error.contains("the last facet ends before its third vertex"), "{next}: {error}");
        }
    }

    #[test]
    fn a_text_that_ends_in_a_solid_is_noted() {
        let cut_off = ["the file has no `endsolid` at its end: it may be cut off"];
        for next in ["endsolid a", " FACET", "ENDLOOP", "ENDFACET", "ENDSOLID"] {
            let end = TWO.find(next).unwrap();
            assert_eq!(parse("a.stl", &TWO.as_bytes()[..end]).unwrap().notes, cut_off, "{next}");
        }
        for whole in [TWO.to_owned(), TWO.replacen("solid a\n", "", 1), TWO.replace("endfacet\n", "")] {
            assert_eq!(parse("a.stl", whole.as_bytes()).unwrap().notes, [""; 0], "{whole}");
        }
    }
}
