//! Reads PLY files, ASCII or binary in either byte order. The crate `ply-rs-bw` reads the headers and the elements of
//! binary files.

mod ascii;
mod header;
mod needed;

use super::MeshFile;
use super::colours;
use super::flaw::{Flaw, Named};
use super::origin::{placement_of, settle};
use crate::error::Result;
use crate::memory::Available;
use crate::scene::material::Material;
use crate::scene::mesh::{Mesh, Triangle};
use crate::scene::normals::MISSING;
use crate::scene::obj::{MAX_CONCAVE_CORNERS, quoted, triangulate};
use crate::words::{counted, counted_are};
use glam::{DVec3, Vec3};
use header::Tidied;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

/// Memory for a vertex while a file is read: the vertex itself, its position in double and in single precision, its
/// normal and its colour.
const VERTEX_BYTES: u64 = (size_of::<Vertex>() + size_of::<DVec3>() + 3 * size_of::<Vec3>()) as u64;
/// Memory for the list of a triangle's corners: 12 bytes, and the bytes that an allocator adds to each block.
const LIST_BYTES: usize = 32;
/// Memory for a face while a file is read: the face itself, the list of its corners, and one triangle.
const FACE_BYTES: u64 = (size_of::<Face>() + LIST_BYTES + size_of::<Triangle>()) as u64;
/// Memory for a colour of triangles while a file is read: a material, and the colour's entry in the map of colours.
/// The sum is doubled, because the list of materials and the map may be half empty.
const COLOUR_BYTES: u64 = 2 * (size_of::<Material>() + size_of::<((u32, [u32; 3]), u32)>()) as u64;
/// The largest number of different colours of triangles: a colour has three channels of 8 bits.
const MAX_COLOURS: u64 = 1 << 24;
/// The names of a vertex's colour channels. A file uses one row of them.
const CHANNELS: [[&str; 3]; 3] =
    [["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"], ["r", "g", "b"]];

/// The words by which a note names the elements that are left out. If a header defines several types of elements with
/// the same name, only the first of these types is read.
const OTHERS: &str = "elements other than the first `vertex`, `face` and `tristrips`";

/// Reads a file.
pub(super) fn parse(named: Named<'_>, bytes: &[u8]) -> Result<MeshFile> {
    let Tidied { header: text, payload, strange, elements: names } =
        header::tidied(bytes).map_err(|flaw| named.error(flaw))?;
    let mut header =
        Parser::<Skipped>::new().read_header(&mut Reader::new(text.as_bytes())).map_err(|error| {
            let plain = error.line().and_then(|line| Some(header::mistake(&text, line)?.at(line)));
            named.error(plain.unwrap_or_else(|| misread(&error, error.line())))
        })?;
    // `header::tidied` may have renamed elements, but messages show the name that an element has in the file.
    for (name, element) in &mut header.elements {
        names.get(name).into_iter().for_each(|original| element.name.clone_from(original));
    }
    let checked = check_sizes(&header, payload.len()).and_then(|()| needed::check(&header));
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
    let mut file = parts.mesh(named.quotes, &header).map_err(|flaw| named.error(flaw))?;
    if strange > 0 {
        file.notes.push(format!(
            "ignored {} in the header: PLY does not define such lines",
            counted(strange, "line")
        ));
    }
    file.notes.extend(elements.note_rest());
    Ok(file)
}

/// Returns the mistake that `ply-rs-bw` found, without the file's text.
fn misread(error: &ParseError, line: Option<usize>) -> Flaw {
    let message = error.to_string();
    let what = message.lines().next().unwrap_or_default();
    let what = what.split_once(": ").map_or(what, |(_, what)| what).trim_end_matches(['.', ':']);
    // Even the first line of some messages contains a name from the header, so the message counts as a quotation.
    let flaw = Flaw::quoting(what, "not valid PLY; expected elements as the header defines them");
    match line {
        Some(line) => flaw.at(line),
        None => flaw,
    }
}

/// Refuses a file that is too short for the elements that its header states. Without this check, the number of elements
/// alone would decide how much memory and time a file takes, since elements may take few bytes or none.
fn check_sizes(header: &Header, payload: usize) -> std::result::Result<(), Flaw> {
    let mut left = payload as u64;
    // In an ASCII file, the last number needs no separator after it.
    left += u64::from(header.encoding == Encoding::Ascii);
    for element in header.elements.values().filter(|element| element.count > 0) {
        let (name, count) = (quoted(element.name.as_bytes()), element.count as u64);
        let least: u64 = element.properties.values().map(|of| least_bytes(header, &of.data_type)).sum();
        if least == 0 {
            let without = "has elements without properties";
            return Err(Flaw::quoting(
                format!("the header {without} ({name})"),
                format!("the header {without}"),
            ));
        }
        left = left.checked_sub(count.saturating_mul(least)).ok_or_else(|| {
            let what = format!("the header states {count} elements {name} of at least {least} bytes");
            let unquoted = "the file has fewer bytes than the elements of its header need";
            Flaw::quoting(format!("{what}, but {left} bytes are left for them"), unquoted)
        })?;
    }
    Ok(())
}

/// Returns the smallest number of bytes that a property takes. An empty list takes only the bytes of its count.
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

/// Returns whether vertices have a number for each of the property names `names`.
fn has(header: &Header, names: [&str; 3]) -> bool {
    let vertex = header.elements.get("vertex");
    names.iter().all(|name| vertex.is_some_and(|vertex| needed::has_number(vertex, name)))
}

/// Returns whether vertices have colours.
fn has_colours(header: &Header) -> bool {
    CHANNELS.into_iter().any(|names| has(header, names))
}

/// Refuses a file whose vertices, faces and colours do not fit into the host's memory.
fn hold(name: &str, header: &Header) -> Result<()> {
    let count = |name: &str| header.elements.get(name).map_or(0, |element| element.count as u64);
    let (vertices, faces) = (count("vertex"), count("face").saturating_add(count("tristrips")));
    let bytes = VERTEX_BYTES.saturating_mul(vertices).saturating_add(FACE_BYTES.saturating_mul(faces));
    let mut sum = format!("{VERTEX_BYTES} B x {vertices} vertices + {FACE_BYTES} B x {faces} faces");
    let colours = if has_colours(header) { faces.min(MAX_COLOURS) } else { 0 };
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
    /// Reads all elements of the next type.
    fn next<E: PropertyAccess>(
        &mut self,
        of: &ElementDef,
        header: &Header,
    ) -> std::result::Result<Vec<E>, Flaw> {
        match self {
            Self::Ascii(lines) => lines.elements(of),
            // A binary file has no lines, so the line number in the crate's error is not used.
            Self::Binary(reader) => Parser::new()
                .read_payload_for_element(reader, of, header)
                .map_err(|error| misread(&error, None)),
        }
    }

    /// Returns a note on what follows the last element. Blanks and line ends alone need no note.
    fn note_rest(self) -> Option<String> {
        let (count, what) = match self {
            Self::Ascii(lines) => (lines.rest(), "line after the last element"),
            Self::Binary(reader) => {
                let rest = reader.into_inner();
                (if rest.trim_ascii().is_empty() { 0 } else { rest.len() }, "byte after the last element")
            }
        };
        (count > 0).then(|| format!("{} ignored", counted_are(count, what)))
    }
}

/// The vertices, faces and strips of a file, and the names and counts of its other elements.
#[derive(Default)]
struct Parts {
    vertices: Vec<Vertex>,
    faces: Vec<Face>,
    strips: Vec<Face>,
    /// Elements of other types: name and count.
    others: Vec<(String, usize)>,
}

impl Parts {
    /// Reads all elements of the next type. `name` is unique in the header; of several types that have the same name in
    /// the file, only the first keeps it.
    fn read(
        &mut self,
        name: &str,
        element: &ElementDef,
        header: &Header,
        elements: &mut Elements<'_>,
    ) -> std::result::Result<(), Flaw> {
        match name {
            "vertex" => self.vertices = elements.next(element, header)?,
            "face" => self.faces = elements.next(element, header)?,
            "tristrips" => self.strips = elements.next(element, header)?,
            _ => {
                self.others.push((element.name.clone(), element.count));
                elements.next::<Skipped>(element, header)?;
            }
        }
        Ok(())
    }

    fn mesh(self, quotes: bool, header: &Header) -> std::result::Result<MeshFile, Flaw> {
        let positions: Vec<DVec3> = self.vertices.iter().map(|vertex| vertex.position).collect();
        let with_normals = has(header, ["nx", "ny", "nz"]);
        let mut mesh = Mesh { materials: vec![Material::default()], ..Mesh::default() };
        if with_normals {
            mesh.normals = self.vertices.iter().map(|vertex| vertex.normal).collect();
            // Normals that are not finite become zero; zero normals are replaced later.
            mesh.normals.iter_mut().filter(|normal| !normal.is_finite()).for_each(|n| *n = Vec3::ZERO);
        }
        mesh.triangles.reserve(self.faces.len());
        let mut push = |corners: [u32; 3]| {
            let normals = if with_normals { corners } else { [MISSING; 3] };
            mesh.triangles.push(Triangle { positions: corners, normals, material: 0 });
        };
        let mut short = 0;
        for (number, face) in self.faces.iter().enumerate() {
            let corners = face.corners(positions.len()).map_err(|what| missing("face", number, &what))?;
            match corners[..] {
                [a, b, c] => push([a, b, c]),
                [] | [_] | [_, _] => short += 1,
                _ => {
                    let mut outline: Vec<DVec3> = corners.iter().map(|&i| positions[i as usize]).collect();
                    // Products of the lengths of a tiny outline would underflow, so the outline is scaled first.
                    let scale = placement_of(outline.iter()).scale;
                    outline.iter_mut().for_each(|corner| *corner *= scale);
                    let triangles = triangulate(&outline).ok_or_else(|| too_large(number))?;
                    triangles.into_iter().for_each(|triangle| push(triangle.map(|i| corners[i])));
                }
            }
        }
        for (number, strip) in self.strips.iter().enumerate() {
            strip.triangles(positions.len(), &mut push).map_err(|what| missing("strip", number, &what))?;
        }
        let (settled, placement) = settle(&positions, &mesh.triangles)?;
        mesh.positions = settled;
        let mut notes = Vec::new();
        if has_colours(header) && !mesh.triangles.is_empty() {
            mesh.materials = vec![Material::lambertian(Vec3::ONE)];
            let linear: Vec<Vec3> = self.vertices.iter().map(Vertex::linear).collect();
            colours::paint(&mut mesh, &linear);
            notes.push(colours::note(linear.len()));
            let outside = linear.iter().filter(|colour| colours::is_outside(colour)).count();
            notes.extend(colours::note_outside(outside));
        }
        let clear = self.vertices.iter().filter(|vertex| vertex.alpha < 1.0).count();
        if clear > 0 {
            notes.push(format!("alpha of {} is not used: every surface is opaque", counted(clear, "vertex")));
        }
        notes.extend(self.notes(quotes, header, short));
        Ok(MeshFile { mesh, placement, notes, ..MeshFile::default() })
    }

    /// Returns notes on ignored parts of the file, with text of the file only if `quotes` is true.
    fn notes(&self, quotes: bool, header: &Header, short: usize) -> Vec<String> {
        let mut notes = needed::notes(header);
        let textures = header.comments.iter().filter(|comment| comment.starts_with("TextureFile")).count();
        if textures > 0 {
            let comments = counted_are(textures, "TextureFile comment");
            notes.push(format!("{comments} ignored: PLY files get no textures, but one colour per triangle"));
        }
        let of_faces = header.elements.get("face").filter(|face| face.properties.contains_key("red"));
        if let Some(face) = of_faces {
            notes.push(format!("colours of {} are not read", counted(face.count, "face")));
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

/// A vertex. A property that the file does not have stays 0, or 1 for alpha.
struct Vertex {
    position: DVec3,
    normal: Vec3,
    /// The colour as displayed; each channel is from 0 to 1.
    colour: Vec3,
    alpha: f32,
}

impl Vertex {
    fn linear(&self) -> Vec3 {
        self.colour.map(colours::linear)
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: DVec3::ZERO, normal: Vec3::ZERO, colour: Vec3::ZERO, alpha: 1.0 }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(value) = number(&property) else { return PropertyAccessResult::Ignored };
        let channel = || (value / full_channel(&property)) as f32;
        match name {
            "x" => self.position.x = value,
            "y" => self.position.y = value,
            "z" => self.position.z = value,
            "nx" => self.normal.x = value as f32,
            "ny" => self.normal.y = value as f32,
            "nz" => self.normal.z = value as f32,
            "red" | "diffuse_red" | "r" => self.colour.x = channel(),
            "green" | "diffuse_green" | "g" => self.colour.y = channel(),
            "blue" | "diffuse_blue" | "b" => self.colour.z = channel(),
            "alpha" | "diffuse_alpha" | "a" => self.alpha = channel(),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Returns the mistake of a face that is too large to be divided into triangles.
fn too_large(number: usize) -> Flaw {
    let most = MAX_CONCAVE_CORNERS;
    Flaw::from(format!("face {number} is concave and has more than {most} corners"))
        .with_remedy("divide the face into smaller ones")
}

/// Returns the mistake of a face or a strip with a vertex that does not exist; `what` quotes the vertex.
fn missing(kind: &str, number: usize, what: &str) -> Flaw {
    Flaw::quoting(
        format!("{kind} {number}: {what}"),
        format!("{kind} {number} has a vertex that does not exist in the file"),
    )
}

/// Returns the channel value of full intensity. Files with `short`, `int` or `uint` channels store values from 0
/// to 255.
fn full_channel(property: &Property) -> f64 {
    match property {
        Property::Float(_) | Property::Double(_) => 1.0,
        Property::UShort(_) => 65535.0,
        Property::Char(_) => 127.0,
        _ => 255.0,
    }
}

fn number(property: &Property) -> Option<f64> {
    Some(match property {
        Property::Char(value) => f64::from(*value),
        Property::UChar(value) => f64::from(*value),
        Property::Short(value) => f64::from(*value),
        Property::UShort(value) => f64::from(*value),
        Property::Int(value) => f64::from(*value),
        Property::UInt(value) => f64::from(*value),
        Property::Float(value) => f64::from(*value),
        Property::Double(value) => *value,
        _ => return None,
    })
}

/// A face or a strip: indices of vertices.
struct Face(Option<Property>);

impl Face {
    fn numbers(&self) -> Vec<i64> {
        match &self.0 {
            Some(Property::ListChar(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListUChar(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListShort(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListUShort(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListInt(list)) => list.iter().map(|&i| i.into()).collect(),
            Some(Property::ListUInt(list)) => list.iter().map(|&i| i.into()).collect(),
            _ => Vec::new(),
        }
    }

    fn corners(&self, count: usize) -> std::result::Result<Vec<u32>, String> {
        self.numbers().into_iter().map(|number| corner(number, count)).collect()
    }

    /// Passes the triangles of a strip to `push`. Every second triangle is reversed, and -1 starts
    /// a new strip.
    fn triangles(&self, count: usize, push: &mut impl FnMut([u32; 3])) -> std::result::Result<(), String> {
        for strip in self.numbers().split(|&number| number == -1) {
            let corners: Vec<u32> =
                strip.iter().map(|&number| corner(number, count)).collect::<std::result::Result<_, _>>()?;
            for (index, window) in corners.windows(3).enumerate() {
                let [a, b, c] = [window[0], window[1], window[2]];
                push(if index.is_multiple_of(2) { [a, b, c] } else { [b, a, c] });
            }
        }
        Ok(())
    }
}

fn corner(number: i64, count: usize) -> std::result::Result<u32, String> {
    match u32::try_from(number) {
        Ok(index) if (index as usize) < count => Ok(index),
        _ => Err(format!("vertex {number} does not exist; the file has {count} vertices, numbered from 0")),
    }
}

/// Returns whether a face's property of this name has the face's corners.
fn is_corners(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(None)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if is_corners(name) {
            self.0 = Some(property);
            return PropertyAccessResult::Set;
        }
        PropertyAccessResult::Ignored
    }
}

/// An element that is ignored.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
