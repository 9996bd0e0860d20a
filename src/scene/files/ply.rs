//! Reads PLY files, ASCII or binary in either byte order. The crate `ply-rs-bw` reads the header of each file and, if
//! the file is binary, the elements.

mod ascii;
mod colour;
mod elements;
mod header;
mod needed;
mod unread;

use super::MeshFile;
use super::colours;
use super::flaw::{Flaw, Named};
use super::note_points;
use super::origin::{Limit, note_coarse, note_inexact, placement_of, settle};
use crate::error::Result;
use crate::memory::Available;
use crate::scene::material::Material;
use crate::scene::mesh::{Mesh, Triangle};
use crate::scene::normals::MISSING;
use crate::scene::obj::{MAX_CONCAVE_CORNERS, quoted, triangulate};
use crate::words::{counted, counted_are};
use colour::{Colour, channels, with_known_channels};
use elements::{ColouredFace, Face, NORMAL, Skipped, Vertex};
use glam::{DVec3, Vec3};
use header::Tidied;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, PropertyAccess, PropertyType, ScalarType, Version};
use std::borrow::Cow;

/// Memory for a vertex while a file is read, in bytes: the vertex itself, its position in double and in
/// single precision, its normal and its colour.
const VERTEX_BYTES: u64 = (size_of::<Vertex>() + size_of::<DVec3>() + 3 * size_of::<Vec3>()) as u64;
/// Memory for the list of a triangle's corners, in bytes: 12 bytes for the corners, and the rest for the
/// allocator.
const LIST_BYTES: usize = 32;
/// Memory for a face while a file is read, in bytes: the face itself, the list of its corners, and one
/// triangle.
const FACE_BYTES: u64 = (size_of::<Face>() + LIST_BYTES + size_of::<Triangle>()) as u64;
/// Additional memory for a face if the colours of faces are used, in bytes: a copy of the face with its colour, and
/// the colour of one triangle.
const FACE_COLOUR_BYTES: u64 = (size_of::<ColouredFace>() + size_of::<Vec3>()) as u64;
/// Memory for each different colour of triangles, in bytes: a material, and an entry in the map of colours.
/// This memory is doubled, because up to half of the list of materials and of the map may be unused.
const COLOUR_BYTES: u64 = 2 * (size_of::<Material>() + size_of::<((u32, [u32; 3]), u32)>()) as u64;
/// The largest number of different colours of triangles: a colour has three channels of 8 bits.
const MAX_COLOURS: u64 = 1 << 24;

/// The words for the elements that are left out, in a note. If a header defines several types of elements
/// with the same name, only the elements of the first of these types are used.
const OTHERS: &str = "elements other than `vertex`, `face` and `tristrips`, and second definitions of these,";

/// The first words, in lower case, of comments with the name of a texture or an MTL file.
const TEXTURE_KEYS: [&str; 4] = ["texturefile", "texture_file", "texture", "material"];

/// The endings, in lower case, of the names of pictures and MTL files in such comments.
const NAMED_ENDINGS: [&str; 16] = [
    "bmp", "dds", "exr", "gif", "hdr", "jpeg", "jpg", "ktx", "ktx2", "mtl", "png", "ppm", "tga", "tif",
    "tiff", "webp",
];

/// Reads a PLY file from its bytes. The vertices of faces must be within `limit`.
pub(super) fn parse(named: Named<'_>, bytes: &[u8], limit: Limit) -> Result<MeshFile> {
    let Tidied { header: text, payload, strange, names } =
        header::tidied(bytes).map_err(|flaw| named.error(flaw))?;
    let mut header =
        Parser::<Skipped>::new().read_header(&mut Reader::new(text.as_bytes())).map_err(|error| {
            let plain = error.line().and_then(|line| Some(header::mistake(&text, line)?.at(line)));
            named.error(plain.unwrap_or_else(|| misread(&error, error.line())))
        })?;
    // `header::tidied` may have renamed elements and properties, but messages show the names in the file.
    for (name, element) in &mut header.elements {
        let original = |property: &str| names.get(&[name.clone(), property.to_owned()]).cloned();
        element.name = original("").unwrap_or_else(|| name.clone());
        for (key, property) in &mut element.properties {
            property.name = original(key).unwrap_or_else(|| key.clone());
        }
    }
    let checked = check_sizes(&header, payload.len())
        .and_then(|()| needed::check(&header))
        .and_then(|()| unread::check(&header));
    checked.map_err(|flaw| named.error(flaw))?;
    hold(named.name, &header)?;
    let mut elements = match header.encoding {
        Encoding::Ascii => Elements::Ascii(ascii::Lines::of(payload, 1 + text.lines().count())),
        _ => Elements::Binary(Reader::new(payload)),
    };
    let mut parts = Parts::default();
    for (name, element) in &header.elements {
        parts.read(name, element, &header, &mut elements).map_err(|flaw| named.error(flaw))?;
    }
    let mut file = parts.mesh(named.quotes, &header, limit).map_err(|flaw| named.error(flaw))?;
    if strange > 0 {
        let they_do = if strange == 1 { "it does" } else { "they do" };
        file.notes.push(format!(
            "ignored {} in the header: {they_do} not begin with a keyword of PLY",
            counted(strange, "line")
        ));
    }
    file.notes.extend(elements.notes());
    Ok(file)
}

/// Converts an error of the crate `ply-rs-bw`. Of the crate's message, only the first line is used.
fn misread(error: &ParseError, line: Option<usize>) -> Flaw {
    let message = error.to_string();
    let what = message.lines().next().unwrap_or_default();
    let what = what.split_once(": ").map_or(what, |(_, what)| what).trim_end_matches(['.', ':']);
    // The first line of some messages contains a name from the header, so every message is treated as a
    // quotation of the file.
    let flaw =
        Flaw::quoting(what, "not valid PLY; expected a header, and elements as the header defines them");
    match line {
        Some(line) => flaw.at(line),
        None => flaw,
    }
}

/// Returns an error if the file is too short for the elements that its header states, or if elements have no
/// properties. Without this check, a small file could state a huge number of elements, and would take much
/// memory and time.
fn check_sizes(header: &Header, payload: usize) -> std::result::Result<(), Flaw> {
    let mut left = payload as u64;
    // In an ASCII file, a separator follows each number. After the last number of the file, no separator is
    // needed.
    let unneeded = u64::from(header.encoding == Encoding::Ascii);
    for element in header.elements.values().filter(|element| element.count > 0) {
        let name = quoted(element.name.as_bytes());
        let least: u64 = element.properties.values().map(|of| least_bytes(header, &of.data_type)).sum();
        if least == 0 {
            let without = "has elements without properties";
            return Err(Flaw::quoting(
                format!("the header {without} ({name})"),
                format!("the header {without}"),
            ));
        }
        let needed = least.saturating_mul(element.count as u64);
        if needed > left + unneeded {
            let (elements, size) = (counted(element.count, "element"), counted(least as usize, "byte"));
            let states = format!("its header states {elements} {name} of at least {size} each");
            let left = counted_are(left as usize, "byte");
            return Err(Flaw::quoting(
                format!("the file is too short: {states}, but only {left} left for them"),
                "the file is too short for the elements that its header states",
            ));
        }
        left = left.saturating_sub(needed);
    }
    Ok(())
}

/// Returns the smallest number of bytes that a property takes in the file. An empty list takes only the bytes
/// of its count.
fn least_bytes(header: &Header, kind: &PropertyType) -> u64 {
    let (PropertyType::Scalar(kind) | PropertyType::List(kind, _)) = kind;
    match (header.encoding, kind) {
        // Each number consists of at least one digit, and a separator follows it.
        (Encoding::Ascii, _) => 2,
        (_, ScalarType::Char | ScalarType::UChar) => 1,
        (_, ScalarType::Short | ScalarType::UShort) => 2,
        (_, ScalarType::Int | ScalarType::UInt | ScalarType::Float) => 4,
        (_, ScalarType::Double) => 8,
    }
}

/// Returns true if elements of the type `element` have all properties `names`, and each of them is a number.
fn has(header: &Header, element: &str, names: [&str; 3]) -> bool {
    let element = header.elements.get(element);
    names.iter().all(|name| element.is_some_and(|element| needed::has_number(element, name)))
}

/// Returns true if the coordinates of vertices are stored in single precision. Numbers in ASCII may have more digits,
/// whatever their type is.
fn has_single_precision(header: &Header) -> bool {
    let is_float = |element: &ElementDef| {
        let x = element.properties.get("x").map(|property| &property.data_type);
        x == Some(&PropertyType::Scalar(ScalarType::Float))
    };
    header.encoding != Encoding::Ascii && header.elements.get("vertex").is_some_and(is_float)
}

/// Returns true if elements of the type `element` have colours.
fn have_colours(header: &Header, element: &str) -> bool {
    header.elements.get(element).is_some_and(|element| channels(element).is_some())
}

/// Returns true if triangles get the colours of their faces: if faces have colours and vertices have none.
fn use_face_colours(header: &Header) -> bool {
    have_colours(header, "face") && !have_colours(header, "vertex")
}

/// Refuses a file whose vertices, faces and colours do not fit into the host's memory.
fn hold(name: &str, header: &Header) -> Result<()> {
    let count = |name: &str| header.elements.get(name).map_or(0, |element| element.count as u64);
    let (vertices, faces) = (count("vertex"), count("face").saturating_add(count("tristrips")));
    let face_bytes = FACE_BYTES + if use_face_colours(header) { FACE_COLOUR_BYTES } else { 0 };
    let bytes = VERTEX_BYTES.saturating_mul(vertices).saturating_add(face_bytes.saturating_mul(faces));
    let mut sum =
        format!("{VERTEX_BYTES} B x {vertices} vertices + {face_bytes} B x {faces} faces or strips");
    let are_coloured = ["vertex", "face"].into_iter().any(|element| have_colours(header, element));
    let colours = if are_coloured { faces.min(MAX_COLOURS) } else { 0 };
    if colours > 0 {
        sum += &format!(" + {COLOUR_BYTES} B x {colours} colours");
    }
    let bytes = bytes.saturating_add(COLOUR_BYTES * colours);
    Available::read().hold(bytes, &format!("reading {name}"), &sum)
}

/// The elements that are not read yet.
enum Elements<'a> {
    Ascii(ascii::Lines<'a>),
    Binary(Reader<&'a [u8]>),
}

impl Elements<'_> {
    /// Reads all elements of the type `of`, which is the next type in the file.
    fn next<E: PropertyAccess>(
        &mut self,
        of: &ElementDef,
        header: &Header,
    ) -> std::result::Result<Vec<E>, Flaw> {
        match self {
            Self::Ascii(lines) => lines.elements(of),
            // A binary file has no lines, so the line number in the error of `ply-rs-bw` is not used.
            Self::Binary(reader) => Parser::new()
                .read_payload_for_element(reader, of, header)
                .map_err(|error| misread(&error, None)),
        }
    }

    /// Returns a note on lines with text after the last property, and a note on lines or bytes after the last
    /// element. Blanks, line ends and, in an ASCII file, lines of comments cause no note.
    fn notes(self) -> Vec<String> {
        let (longer, (rest, what)) = match self {
            Self::Ascii(lines) => {
                let (longer, rest) = lines.ignored();
                (longer, (rest, "line after the last element"))
            }
            Self::Binary(reader) => {
                let rest = reader.into_inner();
                let count = if rest.trim_ascii().is_empty() { 0 } else { rest.len() };
                (0, (count, "byte after the last element"))
            }
        };
        let of_lines = || format!("text after the last property is ignored in {}", counted(longer, "line"));
        let of_rest = || format!("{} ignored", counted_are(rest, what));
        (longer > 0).then(of_lines).into_iter().chain((rest > 0).then(of_rest)).collect()
    }
}

/// The vertices, faces and strips of a file, and the names and counts of its other elements.
#[derive(Default)]
struct Parts {
    vertices: Vec<Vertex>,
    faces: Vec<Face>,
    /// The colour of each face; empty if the colours of faces are not used.
    face_colours: Vec<Colour>,
    strips: Vec<Face>,
    /// The types of elements that are in none of the lists `vertices`, `faces` and `strips`: the name of each
    /// type, and the number of its elements.
    others: Vec<(String, usize)>,
}

impl Parts {
    /// Reads all elements of the type `element`, which is the next type in the file. `name` is the type's
    /// name in the tidied header. Of several types that have the same name in the file, only the first keeps
    /// this name.
    fn read(
        &mut self,
        name: &str,
        element: &ElementDef,
        header: &Header,
        elements: &mut Elements<'_>,
    ) -> std::result::Result<(), Flaw> {
        match name {
            "vertex" => self.vertices = elements.next(&with_known_channels(element), header)?,
            "face" if use_face_colours(header) => {
                let coloured: Vec<ColouredFace> = elements.next(&with_known_channels(element), header)?;
                let parts = coloured.into_iter().map(|ColouredFace { face, colour }| (face, colour));
                (self.faces, self.face_colours) = parts.unzip();
            }
            "face" => self.faces = elements.next(element, header)?,
            "tristrips" => self.strips = elements.next(element, header)?,
            _ => {
                self.others.push((element.name.clone(), element.count));
                elements.next::<Skipped>(element, header)?;
            }
        }
        Ok(())
    }

    fn mesh(mut self, quotes: bool, header: &Header, limit: Limit) -> std::result::Result<MeshFile, Flaw> {
        let mut notes: Vec<String> = self.check_range(header).into_iter().collect();
        let positions: Vec<DVec3> = self.vertices.iter().map(|vertex| vertex.position).collect();
        let with_normals = has(header, "vertex", NORMAL);
        let Triangles { list, colours, short } = self.triangles(&positions, with_normals)?;
        let (settled, placement) = settle(&positions, &list, limit)?;
        notes.extend(has_single_precision(header).then(|| note_coarse(&list, &positions)).flatten());
        notes.extend(note_inexact(&list, &settled, placement.scale, || Cow::from(&positions)));
        let materials = vec![Material::default()];
        let mut mesh = Mesh { positions: settled, triangles: list, materials, ..Mesh::default() };
        if with_normals {
            mesh.normals = self.vertices.iter().map(|vertex| vertex.normal).collect();
            // Normals that are not finite become zero; zero normals are replaced later.
            mesh.normals.iter_mut().filter(|normal| !normal.is_finite()).for_each(|n| *n = Vec3::ZERO);
        }
        if !mesh.triangles.is_empty() {
            self.paint(&mut mesh, header, colours, &mut notes);
        }
        for (clear, element) in [
            (self.vertices.iter().filter(|vertex| vertex.colour.is_clear()).count(), "vertex"),
            (self.face_colours.iter().filter(|colour| colour.is_clear()).count(), "face"),
        ] {
            notes.extend(colours::note_clear(clear, element));
        }
        notes.extend(self.notes(quotes, header, short));
        let invalid = positions.iter().filter(|position| !limit.has(position)).count();
        notes.extend(note_invalid(invalid, limit));
        notes.extend(note_points(&mesh, invalid));
        Ok(MeshFile { mesh, placement, notes, ..MeshFile::default() })
    }

    /// Checks the range of the colours of vertices or, if vertices have no colours, of faces ([`colour::check_range`]).
    fn check_range(&mut self, header: &Header) -> Option<String> {
        let of_faces = use_face_colours(header);
        let element = header.elements.get(if of_faces { "face" } else { "vertex" })?;
        colour::check_range(element, move || match of_faces {
            true => self.face_colours.iter_mut().collect(),
            false => self.vertices.iter_mut().map(|vertex| &mut vertex.colour).collect(),
        })
    }

    /// Divides faces and strips into triangles.
    fn triangles(&self, positions: &[DVec3], with_normals: bool) -> std::result::Result<Triangles, Flaw> {
        let mut all = Triangles::default();
        all.list.reserve(self.faces.len());
        let triangle = |corners: [u32; 3]| {
            let normals = if with_normals { corners } else { [MISSING; 3] };
            Triangle { positions: corners, normals, material: 0 }
        };
        for (number, face) in self.faces.iter().enumerate() {
            let corners = face.corners(positions.len()).map_err(|what| missing("face", number, &what))?;
            match corners[..] {
                [a, b, c] => all.list.push(triangle([a, b, c])),
                [] | [_] | [_, _] => all.short += 1,
                _ => {
                    let mut outline: Vec<DVec3> = corners.iter().map(|&i| positions[i as usize]).collect();
                    // Products of the lengths of a tiny outline would underflow, so the outline is scaled
                    // before it is triangulated.
                    let scale = placement_of(outline.iter()).scale;
                    outline.iter_mut().for_each(|corner| *corner *= scale);
                    let parts = triangulate(&outline).ok_or_else(|| too_large(number))?;
                    all.list.extend(parts.into_iter().map(|part| triangle(part.map(|i| corners[i]))));
                }
            }
            if let Some(colour) = self.face_colours.get(number) {
                all.colours.resize(all.list.len(), colour.linear());
            }
        }
        for (number, strip) in self.strips.iter().enumerate() {
            let mut push = |corners| all.list.push(triangle(corners));
            strip.triangles(positions.len(), &mut push).map_err(|what| missing("strip", number, &what))?;
        }
        Ok(all)
    }

    /// Gives the triangles the colours of their vertices or, if vertices have no colours, of their faces.
    /// `of_faces` has the linear colour of each triangle of a face.
    fn paint(&self, mesh: &mut Mesh, header: &Header, mut of_faces: Vec<Vec3>, notes: &mut Vec<String>) {
        let white = vec![Material::lambertian(Vec3::ONE)];
        let outside = |of: &[Vec3]| of.iter().filter(|colour| colours::is_outside(colour)).count();
        if have_colours(header, "vertex") {
            mesh.materials = white;
            let linear: Vec<Vec3> = self.vertices.iter().map(|vertex| vertex.colour.linear()).collect();
            colours::paint(mesh, &linear);
            notes.extend(colours::note_outside(outside(&linear), "vertex"));
        } else if use_face_colours(header) {
            // Triangles of strips come last, and get the colour of the default material.
            of_faces.resize(mesh.triangles.len(), mesh.materials[0].lambertian);
            mesh.materials = white;
            colours::paint_triangles(mesh, &of_faces);
            let linear: Vec<Vec3> = self.face_colours.iter().map(Colour::linear).collect();
            notes.extend(colours::note_outside(outside(&linear), "face"));
        }
    }

    /// Returns notes on ignored parts of the file, with text of the file only if `quotes` is true.
    fn notes(&self, quotes: bool, header: &Header, short: usize) -> Vec<String> {
        let mut notes: Vec<String> = note_version(header).into_iter().collect();
        notes.extend(needed::notes(header));
        notes.extend(unread::notes(header, quotes));
        let comments = header.comments.iter().chain(&header.obj_infos);
        let textures = comments.filter(|comment| names_texture(comment)).count();
        if textures > 0 {
            let comments = counted_are(textures, "comment with the name of a texture or an MTL file");
            notes.push(format!(
                "{comments} ignored: PLY files get no textures, only the colours of their vertices or faces"
            ));
        }
        if have_colours(header, "face") && !use_face_colours(header) {
            let faces = counted(self.faces.len(), "face");
            notes.push(format!("colours of {faces} are not used, since vertices have colours"));
        }
        if short > 0 {
            notes.push(format!("{} left out", counted_are(short, "face of fewer than three corners")));
        }
        let others: Vec<_> = self
            .others
            .iter()
            .filter(|(_, count)| *count > 0)
            .map(|(name, count)| format!("{} {count}", quoted(name.as_bytes())))
            .collect();
        if !others.is_empty() {
            let names = if quotes { format!(" ({})", others.join(", ")) } else { String::new() };
            notes.push(format!("{OTHERS} are left out{names}"));
        }
        notes
    }
}

/// The triangles of faces and strips.
#[derive(Default)]
struct Triangles {
    list: Vec<Triangle>,
    /// The linear colour of each triangle of a face; empty if the colours of faces are not used.
    colours: Vec<Vec3>,
    /// The number of faces with fewer than three corners.
    short: usize,
}

/// Returns a note on a version that the header states, but that raycl does not know; `None` for version 1.0.
fn note_version(header: &Header) -> Option<String> {
    let Version { major, minor } = header.version;
    let note =
        || format!("the header states version {major}.{minor} of PLY; the file is read as version 1.0");
    ((major, minor) != (1, 0)).then(note)
}

/// Returns true if a comment names a texture or an MTL file, as in `TextureFile a.png`.
fn names_texture(comment: &str) -> bool {
    let mut words = comment.split_whitespace();
    let key = words.next().unwrap_or_default().trim_end_matches([':', '=']).to_ascii_lowercase();
    let has_ending = |name: &str| {
        let ending =
            name.trim_end_matches('"').rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
        ending.is_some_and(|ending| NAMED_ENDINGS.contains(&&*ending))
    };
    TEXTURE_KEYS.contains(&&*key) && words.last().is_some_and(has_ending)
}

/// Returns a note on the `count` vertices whose position is not valid; `None` if there are none. No triangle uses these
/// vertices: [`settle`], which is called earlier, refuses a file with such a triangle.
fn note_invalid(count: usize, limit: Limit) -> Option<String> {
    let vertices = counted_are(count, "vertex that no face uses");
    let most = limit.shown();
    (count > 0).then(|| format!("{vertices} ignored: a coordinate is not finite or beyond +-{most}"))
}

/// Returns the error for a concave face that has too many corners to be divided into triangles.
fn too_large(number: usize) -> Flaw {
    let most = MAX_CONCAVE_CORNERS;
    Flaw::from(format!("face {number} is concave and has more than {most} corners"))
        .with_remedy("divide the face into smaller ones")
}

/// Returns the error for a face or a strip with a vertex that does not exist. `kind` is "face" or "strip",
/// and `what` says which vertex does not exist.
fn missing(kind: &str, number: usize, what: &str) -> Flaw {
    Flaw::quoting(
        format!("{kind} {number}: {what}"),
        format!("{kind} {number} has a vertex that does not exist in the file"),
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
