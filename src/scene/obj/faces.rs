//! The last pass over an OBJ file: reads faces, cuts them into triangles, and checks every index.

use super::coordinates::Coordinates;
use super::odd::Odd;
use super::points::PointChunk;
use super::polygon::{MAX_CONCAVE_CORNERS, triangulate};
use super::smoothing::{self, Smoothing};
use super::text::{
    Chunk, Mistake, Seen, Source, after_blanks, keyword, leading_index, possible_names, quoted, tokens, words,
};
use crate::scene::material::DEFAULT_LAMBERTIAN;
use crate::scene::mesh::Triangle;
use crate::scene::normals::MISSING;
use crate::words::{counted, counted_are};
use glam::Vec3;
use std::collections::{BTreeSet, HashMap};

/// The numbers of positions, normals and texture coordinates before a piece of the file, and the names of the
/// material and the smoothing group that are current where the piece begins.
#[derive(Clone, Copy, Default)]
pub(super) struct Start<'a> {
    pub positions: usize,
    pub normals: usize,
    pub coordinates: usize,
    /// `None` before the file's first `usemtl`.
    material: Option<&'a str>,
    smoothing: &'a str,
}

/// Returns a [`Start`] for each piece of the file, and then one for the end of the file. `coordinates` has
/// the texture coordinates of each piece of the file; it is empty if texture coordinates were not read.
pub(super) fn starts<'a>(points: &'a [PointChunk], coordinates: &[Coordinates]) -> Vec<Start<'a>> {
    let mut start = Start::default();
    let mut starts = vec![start];
    for (number, chunk) in points.iter().enumerate() {
        start.coordinates += coordinates.get(number).map_or(0, Coordinates::count);
        start.positions += chunk.positions.len();
        start.normals += chunk.normals.len();
        start.material = chunk.last_material.as_deref().or(start.material);
        start.smoothing = chunk.last_smoothing.as_deref().unwrap_or(start.smoothing);
        starts.push(start);
    }
    starts
}

/// Data of the whole file that are needed for reading the faces of a piece.
pub(super) struct FaceContext<'a> {
    pub positions: &'a [Vec3],
    /// The normals that are not valid, sorted by index.
    pub odd_normals: &'a [Odd],
    pub total: Start<'a>,
    /// The index of each material, by the material's name; index 0 is the default material.
    pub materials: &'a HashMap<String, u32>,
    /// True if texture coordinates were read.
    pub mapped: bool,
}

impl FaceContext<'_> {
    /// Returns true if the normal with the index `normal` is not valid.
    fn is_odd(&self, normal: u32) -> bool {
        self.odd_normals.binary_search_by_key(&(normal as usize), |odd| odd.number).is_ok()
    }
}

/// The triangles of a piece of the file. The index of a missing normal is [`MISSING`].
#[derive(Default)]
pub(super) struct FaceChunk {
    pub triangles: Vec<Triangle>,
    /// For each triangle, the indices of its corners' texture coordinates. The index of a corner without a
    /// texture coordinate is [`MISSING`]. The list is empty if no texture coordinates were read.
    pub coordinate_indices: Vec<[u32; 3]>,
    unknown_materials: BTreeSet<String>,
    /// Number of triangles with the default material before the file's first `usemtl`.
    early: usize,
    /// True if a corner names a normal, even one that does not exist or is not valid.
    names_normal: bool,
    /// `usemtl` lines without a name, if no material has the empty name.
    nameless: Seen,
    /// Faces that have normals at some corners only.
    partial_normals: Seen,
    /// Faces that name a normal that does not exist in the file.
    lost_normals: Seen,
    /// Faces with fewer than three corners.
    short: Seen,
    /// The smoothing groups, of which raycl makes only a note.
    pub smoothing: Smoothing,
}

/// Reads the faces of a piece of the file. `triangles` is an empty list whose memory is reused: it becomes
/// the result's list of triangles.
pub(super) fn read(
    context: &FaceContext,
    chunk: &Chunk,
    start: &Start,
    triangles: Vec<Triangle>,
) -> Result<FaceChunk, Mistake> {
    let smoothing = Smoothing::starting(start.smoothing);
    let mut faces = FaceChunk { triangles, smoothing, ..FaceChunk::default() };
    let mut seen = *start;
    let mut material = faces.material(context, start.material.unwrap_or_default());
    let mut is_early = start.material.is_none() && material == 0;
    let mut corners = Vec::new();
    for (offset, line) in chunk.lines() {
        match keyword(line) {
            (b"v", _) => seen.positions += 1,
            (b"vn", _) => seen.normals += 1,
            (b"vt", _) => seen.coordinates += 1,
            (b"usemtl", rest) => {
                let name = words(rest);
                faces.end_early(&mut is_early);
                faces.nameless.at_if(is_nameless(context, &name), offset);
                material = faces.material(context, &name);
            }
            (b"s", rest) => faces.smoothing.begin(smoothing::group(rest)),
            // Older versions of OBJ write `fo` for `f`.
            (b"f" | b"fo", rest) => {
                let read = read_corners(context, &seen, rest, &mut corners);
                faces.look_at(offset, &mut corners);
                read.map_err(|message| Mistake::new(offset, message))?;
                faces.push(context, offset, &corners, material)?;
            }
            _ => {}
        }
    }
    faces.end_early(&mut is_early);
    faces.smoothing.begin(String::new());
    Ok(faces)
}

/// One corner of a face: the indices of its position, its normal and its texture coordinate. The index of a
/// missing normal or texture coordinate is [`MISSING`].
type Corner = (u32, u32, u32);

/// The number that a [`Corner`] contains instead of a normal's index if the file has no normal with this
/// index.
const LOST: u32 = MISSING - 1;

/// The number that a [`Corner`] contains instead of a normal's index if this normal is not valid: one of its
/// numbers is missing, not finite or out of range.
const ODD: u32 = MISSING - 2;

/// Returns true if some corners have a normal and others have none.
fn some_normals_missing(corners: &[Corner]) -> bool {
    let missing = corners.iter().filter(|corner| corner.1 == MISSING).count();
    0 < missing && missing < corners.len()
}

/// Returns true if the text after `usemtl` is empty or a comment, and names no material.
fn is_nameless(context: &FaceContext, text: &str) -> bool {
    let names = possible_names(text);
    names[1].is_empty() && !names.into_iter().any(|name| context.materials.contains_key(name))
}

impl FaceChunk {
    /// Returns the index of the material that the text after `usemtl` names. If there is no such material,
    /// records the name and returns 0, the default material.
    fn material(&mut self, context: &FaceContext, text: &str) -> u32 {
        let names = possible_names(text);
        if let Some(&index) = names.into_iter().find_map(|name| context.materials.get(name)) {
            return index;
        }
        // The note shows the text after `usemtl`, without what is certainly a comment.
        let [_, name, _] = names;
        if !name.is_empty() {
            self.unknown_materials.insert(name.to_owned());
        }
        0
    }

    /// Counts the triangles so far as early if `is_early` is true, and sets `is_early` to false.
    fn end_early(&mut self, is_early: &mut bool) {
        if std::mem::take(is_early) {
            self.early = self.triangles.len();
        }
    }

    /// Counts irregularities of a face, and records whether the face names a normal. If a normal of the face does not
    /// exist or is not valid, removes all normals of the face. (Normals that are not valid are counted where they are
    /// defined.)
    fn look_at(&mut self, offset: usize, corners: &mut [Corner]) {
        self.names_normal |= corners.iter().any(|corner| corner.1 != MISSING);
        if corners.len() < 3 {
            self.short.at(offset);
        } else if corners.iter().any(|corner| matches!(corner.1, ODD | LOST)) {
            if corners.iter().any(|corner| corner.1 == LOST) {
                self.lost_normals.at(offset);
            }
            corners.iter_mut().for_each(|corner| corner.1 = MISSING);
        } else if some_normals_missing(corners) {
            self.partial_normals.at(offset);
        }
    }

    fn push(
        &mut self,
        context: &FaceContext,
        offset: usize,
        corners: &[Corner],
        material: u32,
    ) -> Result<(), Mistake> {
        if corners.len() < 3 {
            return Ok(());
        }
        // Normals can be interpolated only if all corners have one; otherwise no normal is used.
        let complete = corners.iter().all(|corner| corner.1 != MISSING);
        let mut push = |[a, b, c]: [usize; 3]| {
            let [a, b, c] = [corners[a], corners[b], corners[c]];
            let normals = if complete {
                [a.1, b.1, c.1]
            } else {
                self.smoothing.count();
                [MISSING; 3]
            };
            self.triangles.push(Triangle { positions: [a.0, b.0, c.0], normals, material });
            if context.mapped {
                self.coordinate_indices.push([a.2, b.2, c.2]);
            }
        };
        if corners.len() == 3 {
            push([0, 1, 2]);
            return Ok(());
        }
        let outline: Vec<_> = corners.iter().map(|c| context.positions[c.0 as usize].as_dvec3()).collect();
        let triangles = triangulate(&outline).ok_or_else(|| {
            let most = MAX_CONCAVE_CORNERS;
            let message = format!("a concave face of {} corners; expected at most {most}", corners.len());
            let expected = format!("at most {most} corners in a concave face: divide it into smaller faces");
            Mistake::new(offset, message).expecting(expected)
        })?;
        triangles.into_iter().for_each(&mut push);
        Ok(())
    }
}

/// Reads the corners of a face into `corners`.
fn read_corners(
    context: &FaceContext,
    seen: &Start,
    rest: &[u8],
    corners: &mut Vec<Corner>,
) -> Result<(), String> {
    corners.clear();
    if read_usual_corners(context, rest, corners) {
        return Ok(());
    }
    corners.clear();
    for token in tokens(rest) {
        corners.push(corner(context, seen, token)?);
    }
    Ok(())
}

/// Appends the corners of a face to `corners` and returns true if the line has the most frequent form: blanks
/// before each corner, and only corners that [`usual_corner`] accepts. Returns false if the line has another form. In
/// this case, some of the line's corners may have been appended, and the caller reads the line again with [`corner`].
fn read_usual_corners(context: &FaceContext, line: &[u8], corners: &mut Vec<Corner>) -> bool {
    let mut rest = line;
    while let Some(text) = after_blanks(rest) {
        let Some((corner, after)) = usual_corner(context, text) else { return false };
        corners.push(corner);
        rest = after;
    }
    rest.is_empty()
}

/// Parses `position`, `position/texture`, `position//normal` or `position/texture/normal`; a part after a slash may be
/// empty. Returns an error if a part is not a whole number, if there are more than three parts, or if the file has no
/// such position. If the file does not have the texture coordinate or the normal of a corner, this is no error.
fn corner(context: &FaceContext, seen: &Start, token: &[u8]) -> Result<Corner, String> {
    let mut parts = token.split(|&byte| byte == b'/');
    let first = parts.next().unwrap_or_default();
    let position = resolve(first, token, "vertex", seen.positions, context.total.positions)?;
    let texture = parts.next().unwrap_or_default();
    // A texture coordinate that does not exist in the file counts as missing, so that the triangle has no
    // texture.
    let coordinate = match integer(texture) {
        None if texture.is_empty() => MISSING,
        None => return Err(not_an_index(texture, token)),
        Some(_) if !context.mapped => MISSING,
        Some(_) => resolve(texture, token, "texture coordinate", seen.coordinates, context.total.coordinates)
            .unwrap_or(MISSING),
    };
    let normal = match parts.next().unwrap_or_default() {
        [] => MISSING,
        part => normal(context, seen, part, token)?,
    };
    if parts.next().is_some() {
        return Err(format!("{} has too many slashes; expected vertex/texture/normal", quoted(token)));
    }
    Ok((position, normal, coordinate))
}

/// Returns a normal's index, [`LOST`] if the file has no normal with this index, or [`ODD`] if the normal is
/// not valid. Returns an error if `part` is not a number.
fn normal(context: &FaceContext, seen: &Start, part: &[u8], token: &[u8]) -> Result<u32, String> {
    match resolve(part, token, "normal", seen.normals, context.total.normals) {
        Err(_) if integer(part).is_some() => Ok(LOST),
        Ok(index) if context.is_odd(index) => Ok(ODD),
        other => other,
    }
}

/// Splits a corner in the form `1`, `1/`, `1/2`, `1//3` or `1/2/3` off the beginning of a text. Returns `None`
/// if the corner has another form, if one of its indices does not exist in the file, or if its normal is not
/// valid. The index of a texture coordinate is not checked if texture coordinates were not read.
fn usual_corner<'a>(context: &FaceContext, text: &'a [u8]) -> Option<(Corner, &'a [u8])> {
    let index = |number: u32, total: usize| (number as usize <= total).then(|| number - 1);
    let (position, mut rest) = leading_index(text)?;
    let mut corner = (index(position, context.total.positions)?, MISSING, MISSING);
    if let Some(after) = rest.strip_prefix(b"/") {
        rest = after;
        if let Some((texture, after)) = leading_index(rest) {
            if context.mapped {
                corner.2 = index(texture, context.total.coordinates)?;
            }
            rest = after;
        }
        if let Some(after) = rest.strip_prefix(b"/") {
            let (normal, after) = leading_index(after)?;
            corner.1 = index(normal, context.total.normals).filter(|index| !context.is_odd(*index))?;
            rest = after;
        }
    }
    Some((corner, rest))
}

/// Returns the index, from 0, of the element that the number in `part` means. `what` names the kind of elements, such
/// as "vertex". The number of the first element is one. Negative numbers count backwards: -1 means the last element
/// before the face. `seen` is the number of elements before the face, and `total` the number of elements in the whole
/// file. Returns an error if `part` is not a whole number, or if the file has no element with this number. `token` is
/// the whole corner, for the error's message.
fn resolve(part: &[u8], token: &[u8], what: &str, seen: usize, total: usize) -> Result<u32, String> {
    let value = integer(part).ok_or_else(|| not_an_index(part, token))?;
    let index = if value < 0 { seen as i64 + value } else { value - 1 };
    if value != 0 && (0..total as i64).contains(&index) {
        return Ok(index as u32);
    }
    let why = match (value, total) {
        (_, 0) => format!("the file has {}", counted(0, what)),
        (..0, _) if seen == 0 => {
            format!(
                "expected 1 to {total} (no {what} precedes this line, so a negative index refers to none)"
            )
        }
        (..0, _) => {
            format!("expected -{seen} to -1 (before this line, the file has {})", counted(seen, what))
        }
        _ => format!("expected 1 to {total}"),
    };
    Err(format!("{what} index {} in {} does not exist; {why}", quoted(part), quoted(token)))
}

fn not_an_index(part: &[u8], token: &[u8]) -> String {
    format!("{} in {} is not an index; expected a whole number", quoted(part), quoted(token))
}

/// Parses an integer. An integer beyond half of the largest i64, with either sign, is replaced by this half.
/// The replacement does not matter: no mesh has so many elements, so callers refuse every index of this size.
fn integer(token: &[u8]) -> Option<i64> {
    let (negative, digits) = match token {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let size = digits.iter().fold(0_i64, |value, digit| {
        value.saturating_mul(10).saturating_add(i64::from(digit - b'0')).min(i64::MAX / 2)
    });
    Some(if negative { -size } else { size })
}

/// Joins the counts of one kind of irregularity (`of` returns a piece's count) in all pieces of the file.
fn seen(faces: &[FaceChunk], of: fn(&FaceChunk) -> Seen) -> Seen {
    Seen::of_all(faces.iter().map(of))
}

/// Adds a note on faces that have normals at some corners only.
pub(super) fn note_partial_normals(faces: &[FaceChunk], source: &Source, notes: &mut Vec<String>) {
    let partial = seen(faces, |chunk| chunk.partial_normals);
    let note = || {
        let have = if partial.count == 1 { "has" } else { "have" };
        format!(
            "line {}: {} {have} a normal index at some corners only, so normals are computed from the faces' \
             shape; give every corner a normal index, as in `f 1//1 2//1 3//1`",
            source.line(partial.first),
            counted(partial.count, "face")
        )
    };
    notes.extend((partial.count > 0).then(note));
}

/// Adds a note on `usemtl` lines without a name.
pub(super) fn note_nameless(faces: &[FaceChunk], source: &Source, notes: &mut Vec<String>) {
    let nameless = seen(faces, |chunk| chunk.nameless);
    notes.extend(source.note_on_lines(
        "line ",
        nameless,
        "`usemtl` without a name selects the default material",
    ));
}

/// Adds a note on faces whose normals do not exist in the file, and a note on faces that were left out
/// because they have too few corners.
pub(super) fn note_odd_faces(faces: &[FaceChunk], source: &Source, notes: &mut Vec<String>) {
    let (lost, short) = (seen(faces, |chunk| chunk.lost_normals), seen(faces, |chunk| chunk.short));
    if lost.count > 0 {
        notes.push(format!(
            "line {}: {} normals (vn) that do not exist in the file; normals are computed from the faces' shape instead",
            source.line(lost.first),
            naming(lost.count)
        ));
    }
    if short.count > 0 {
        let faces = counted_are(short.count, "face of fewer than three corners");
        notes.push(format!("line {}: {faces} left out", source.line(short.first)));
    }
}

/// Returns, for example, "1 face names" or "2 faces name".
fn naming(count: usize) -> String {
    format!("{} {}", counted(count, "face"), if count == 1 { "names" } else { "name" })
}

/// Adds a note on the materials that `usemtl` names but no MTL file defines. `is_coloured` is true if vertices
/// have colours.
pub(super) fn note_unknown_materials(
    faces: &[FaceChunk],
    is_coloured: bool,
    quotes: bool,
    notes: &mut Vec<String>,
) {
    let names: BTreeSet<_> = faces.iter().flat_map(|chunk| &chunk.unknown_materials).collect();
    let Some(first) = names.first() else { return };
    let such_as = if names.len() == 1 { "material " } else { "for example material " };
    let materials = counted_are(names.len(), "material named by `usemtl`");
    let first = if quotes { format!(" ({such_as}{})", quoted(first.as_bytes())) } else { String::new() };
    notes.push(format!("{materials} defined in no MTL file{first}: {}", instead_of_material(is_coloured)));
}

/// Adds a note on the triangles before the first `usemtl`, if MTL files define materials. `triangles` is the number of
/// the mesh's triangles, and `materials` that of the materials in MTL files. `is_coloured` is true if vertices have
/// colours.
pub(super) fn note_early(
    faces: &[FaceChunk],
    (triangles, materials): (usize, usize),
    is_coloured: bool,
    notes: &mut Vec<String>,
) {
    let early = faces.iter().map(|chunk| chunk.early).sum();
    if early == 0 || materials == 0 {
        return;
    }
    let what = match early == triangles {
        true => {
            let of_files = counted_are(materials, "material of the MTL files");
            format!("no `usemtl` selects a material for the faces, so {of_files} not used")
        }
        false => {
            let have = if early == 1 { "has" } else { "have" };
            format!("{} before the first `usemtl` {have} no material", counted(early, "triangle"))
        }
    };
    notes.push(format!("{what}: {}", instead_of_material(is_coloured)));
}

/// Returns the end of a note on faces without a material, which says what raycl uses instead.
fn instead_of_material(is_coloured: bool) -> String {
    match is_coloured {
        true => "only the vertices' colours are shown, unless the scene sets a `k_l`".to_owned(),
        false => format!(
            "the default, k_L {DEFAULT_LAMBERTIAN} (grey), is used, unless the scene sets another `k_l`"
        ),
    }
}

/// Adds a note if the file has normals, but no face names one. `normals` is the number of the file's valid normals.
pub(super) fn note_unnamed_normals(faces: &[FaceChunk], normals: usize, notes: &mut Vec<String>) {
    let is_unnamed = normals > 0 && !faces.iter().any(|chunk| chunk.names_normal);
    let note = || {
        let are = if normals == 1 { "is" } else { "are" };
        format!(
            "{} (vn) {are} not used, since no face names a normal (as `f 1//1 2//2 3//3` would); normals are computed \
             from the faces' shape instead",
            counted(normals, "normal")
        )
    };
    notes.extend(is_unnamed.then(note));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A file with 50 vertices, 7 texture coordinates and 5 normals, of which the third is not valid.
    fn context(materials: &HashMap<String, u32>, mapped: bool) -> FaceContext<'_> {
        let total = Start { positions: 50, coordinates: 7, normals: 5, ..Start::default() };
        FaceContext { positions: &[], odd_normals: &[Odd { number: 2, offset: 0 }], total, materials, mapped }
    }

    proptest! {
        #[test]
        fn a_face_in_the_most_frequent_form_is_read_like_any_other(
            line in "([ \t]{1,2}[0-9]{1,2}(/[0-9]?(/[0-9]?)?)?){2,5}",
            mapped: bool,
        ) {
            let materials = HashMap::new();
            let context = context(&materials, mapped);
            let mut usual = Vec::new();
            if read_usual_corners(&context, line.as_bytes(), &mut usual) {
                let corners = tokens(line.as_bytes()).map(|token| corner(&context, &Start::default(), token));
                prop_assert_eq!(corners.collect::<Result<Vec<_>, _>>(), Ok(usual));
            }
        }
    }

    #[test]
    fn only_corners_that_exist_in_usual_forms_are_read_in_one_pass() {
        let materials = HashMap::new();
        let context = context(&materials, true);
        let is_usual = |line: &str| read_usual_corners(&context, line.as_bytes(), &mut Vec::new());
        for line in [" 1 2 50", "\t1/7  2/ 3/1 4", " 1//5 2/2/4 3//1", " 000000001 2 3", " 1 2", ""] {
            assert!(is_usual(line), "{line}");
        }
        for line in [" 1 2 51", " 0 1 2", " -1 -2 -3", "1 2 3", " 1 2 3 ", " 1 2 3#", " 1 2,3", " 1 2 3 # 4"]
        {
            assert!(!is_usual(line), "{line}");
        }
        for line in
            [" 1/8 2 3", " 1//3 2//1 3//1", " 1//6 2 3", " 1// 2 3", " 1/2/3/4 2 3", " 0000000001 2 3"]
        {
            assert!(!is_usual(line), "{line}");
        }
    }

    #[test]
    fn an_index_may_have_either_sign() {
        let all = ["12", "+12", "-12", "+", "1+", "++1"].map(|token| integer(token.as_bytes()));
        assert_eq!(all, [Some(12), Some(12), Some(-12), None, None, None]);
    }

    #[test]
    fn a_material_and_a_smoothing_group_go_on_through_all_pieces_that_name_none() {
        let piece = |name: Option<&str>| PointChunk {
            last_material: name.map(str::to_owned),
            last_smoothing: name.map(str::to_owned),
            ..PointChunk::default()
        };
        let points = [None, Some("a"), None, None, Some("b")].map(piece);
        let names: Vec<_> = starts(&points, &[])
            .iter()
            .map(|start| [start.material.unwrap_or(""), start.smoothing])
            .collect();
        assert_eq!(names, ["", "", "a", "a", "a", "b"].map(|name| [name; 2]));
    }
}
