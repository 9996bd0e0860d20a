//! Formats that are recognised by their first words.

use super::signatures::{CONVERT, DOWNLOAD, EXPORT, OWN, POINTS, contains};
use super::{FileType, Foreign, JSON, MTL, MeshFormat, UNKNOWN};

/// The words with which OBJ statements begin.
const OBJ_WORDS: &[&str] = &[
    "v",
    "vn",
    "vt",
    "vp",
    "f",
    "l",
    "p",
    "o",
    "g",
    "s",
    "mg",
    "mtllib",
    "usemtl",
    "usemap",
    "maplib",
    "cstype",
    "deg",
    "surf",
    "curv",
    "curv2",
    "bevel",
    "lod",
    "shadow_obj",
    "trace_obj",
];

/// The words that pbrt scenes begin with.
const PBRT_WORDS: &[&str] = &[
    "LookAt",
    "Camera",
    "Film",
    "Sampler",
    "Integrator",
    "Accelerator",
    "PixelFilter",
    "ColorSpace",
    "Option",
    "Scale",
    "Rotate",
    "Translate",
    "Transform",
    "ConcatTransform",
    "Identity",
    "WorldBegin",
    "AttributeBegin",
    "Include",
    "Import",
    "Shape",
    "MakeNamedMaterial",
    "SurfaceIntegrator",
    "Renderer",
];

/// The words that Abaqus files begin with.
const ABAQUS_WORDS: [&str; 3] = ["*HEADING", "*NODE", "*PART"];

/// Types of XML files, by the name of the root element.
const XML_ROOTS: &[(&str, &str)] = &[
    ("COLLADA", "a COLLADA scene"),
    ("X3D", "an X3D scene"),
    ("scene", "a Mitsuba scene (XML)"),
    ("model", "a 3MF model (XML)"),
    ("amf", "an AMF model"),
];

/// Recognises a file without a signature by its first statement. Returns `Unclear` if no format matches.
pub(super) fn recognise(head: &[u8]) -> FileType {
    let Some(line) = first_statement(head) else { return FileType::Unclear };
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    let (word, rest) = line.split_at(end);
    let (word, rest) = (std::str::from_utf8(word).unwrap_or_default(), rest.trim_ascii());
    match word {
        _ if is_toml(line) => FileType::Toml,
        _ if OBJ_WORDS.contains(&word) => FileType::Mesh(MeshFormat::Obj),
        _ => foreign(head, word, rest).unwrap_or(FileType::Unclear),
    }
}

fn foreign(head: &[u8], word: &str, rest: &[u8]) -> Option<FileType> {
    let named = |name, remedy| Some(FileType::Foreign(Foreign { name, remedy }));
    match word {
        "ply" if rest.is_empty() => Some(FileType::Mesh(MeshFormat::Ply)),
        _ if word.eq_ignore_ascii_case("solid") => Some(FileType::Mesh(MeshFormat::Stl)),
        "OFF" | "COFF" | "NOFF" | "CNOFF" | "STOFF" | "4OFF" | "nOFF" => named("an OFF mesh", EXPORT),
        // Some OBJ files begin with the definitions of their materials.
        "newmtl" if has_vertex(head) => Some(FileType::Mesh(MeshFormat::Obj)),
        "newmtl" => named(MTL, "name the .obj file that refers to this material file"),
        "0" if contains(head, b"SECTION") => named("a DXF drawing", EXPORT),
        "*3DSMAX_ASCIIEXPORT" => named("a 3ds Max scene (ASE)", OWN),
        "VERSION" if contains(head, b"\nFIELDS ") => named("a point cloud (PCD)", POINTS),
        _ if ABAQUS_WORDS.iter().any(|known| is_word(word, known)) => named("an Abaqus mesh (INP)", CONVERT),
        _ if PBRT_WORDS.contains(&word) => named("a pbrt scene", EXPORT),
        _ if word.starts_with('<') => xml(head).and_then(|(name, remedy)| named(name, remedy)),
        _ if word.starts_with(['{', '[']) && is_gltf(head) => Some(FileType::Mesh(MeshFormat::Gltf)),
        _ if word.starts_with(['{', '[']) => named(JSON, ""),
        _ if is_binary(head) => named(UNKNOWN, ""),
        _ => None,
    }
}

/// Returns the lines, each without the blanks at its two ends.
fn lines(head: &[u8]) -> impl Iterator<Item = &[u8]> {
    head.split(|&byte| byte == b'\n' || byte == b'\r').map(<[u8]>::trim_ascii)
}

/// Returns the first line that is neither empty nor a comment, without blanks at both ends.
fn first_statement(head: &[u8]) -> Option<&[u8]> {
    lines(head).find(|line| !line.is_empty() && !line.starts_with(b"#"))
}

/// Returns true if one of the lines is a vertex of an OBJ file. An MTL file has no vertices.
fn has_vertex(head: &[u8]) -> bool {
    lines(head).any(|line| line.starts_with(b"v ") || line.starts_with(b"v\t"))
}

/// Returns true if a line has the form `[table]`, `[[table]]` or `key = ...`.
fn is_toml(line: &[u8]) -> bool {
    let of_key = |byte: &u8| byte.is_ascii_alphanumeric() || b"_-.\"'".contains(byte);
    let key = |text: &[u8]| !text.trim_ascii().is_empty() && text.trim_ascii().iter().all(of_key);
    let inner = line.strip_prefix(b"[").map(|rest| rest.strip_prefix(b"[").unwrap_or(rest));
    let (text, end) = inner.map_or((line, b'='), |inner| (inner, b']'));
    let named = inner.is_none_or(|inner| inner.trim_ascii().first().is_some_and(u8::is_ascii_alphabetic));
    named && text.iter().position(|&byte| byte == end).is_some_and(|at| key(&text[..at]))
}

/// Returns true if JSON has the keys `asset` and `version`, or one of three other keys that are typical of glTF.
fn is_gltf(head: &[u8]) -> bool {
    let has = |key: &str| contains(head, key.as_bytes());
    has("\"asset\"") && has("\"version\"")
        || has("\"bufferViews\"")
        || has("\"byteLength\"")
        || has("\"accessors\"")
}

fn xml(head: &[u8]) -> Option<(&'static str, &'static str)> {
    let root = root_element(head);
    match XML_ROOTS.iter().find(|(name, _)| *name == root) {
        Some((_, name)) => Some((name, EXPORT)),
        None if root == "VTKFile" => Some(("a VTK file (XML)", CONVERT)),
        None if root.eq_ignore_ascii_case("html") => {
            Some(("a web page (HTML), perhaps the error page of a download", DOWNLOAD))
        }
        None if root.eq_ignore_ascii_case("svg") => Some(("an SVG picture", "")),
        None => Some(("an XML file", "")),
    }
}

/// Returns the name of the first tag that is neither a declaration nor in a comment; empty if there is no such
/// tag.
fn root_element(head: &[u8]) -> String {
    let text = String::from_utf8_lossy(head);
    let mut rest = text.as_ref();
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = comment.find("-->").map_or("", |end| &comment[end..]);
        } else if rest.starts_with(|c: char| c.is_alphabetic()) {
            return rest.chars().take_while(|c| c.is_alphanumeric()).collect();
        }
    }
    String::new()
}

/// Returns true if the part of `word` before its first comma equals `known`. Upper and lower case count as
/// equal.
fn is_word(word: &str, known: &str) -> bool {
    word.split(',').next().is_some_and(|first| first.eq_ignore_ascii_case(known))
}

/// Returns true if the first lines are rows of at least three numbers, such as the coordinates of points. A
/// line with the number of rows or the names of the columns may precede the rows of numbers.
pub(super) fn is_list_of_numbers(head: &[u8]) -> bool {
    let statements: Vec<&[u8]> =
        lines(head).filter(|line| !line.is_empty() && !line.starts_with(b"#")).take(3).collect();
    let rows = match statements[..] {
        [first, ref rest @ ..] if is_title(first, rest) => rest,
        ref all => all,
    };
    let is_row = |line: &&[u8]| count_fields(line) >= 3 && are_numbers(line);
    !rows.is_empty() && rows.iter().all(is_row)
}

/// Returns true if the first line is a single number, or has as many fields as the next line and a field that
/// is no number.
fn is_title(first: &[u8], rest: &[&[u8]]) -> bool {
    let columns = rest.first().map_or(0, |line| count_fields(line));
    count_fields(first) == if are_numbers(first) { 1 } else { columns }
}

/// Returns the fields of a line. Blanks, commas or semicolons separate the fields.
fn fields(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let separates = |byte: &u8| byte.is_ascii_whitespace() || b",;".contains(byte);
    line.split(separates).filter(|field| !field.is_empty())
}

fn count_fields(line: &[u8]) -> usize {
    fields(line).count()
}

fn are_numbers(line: &[u8]) -> bool {
    fields(line).all(|field| std::str::from_utf8(field).is_ok_and(|text| text.parse::<f64>().is_ok()))
}

/// Returns true if the bytes are binary: at least one byte is 0, or more than a tenth of the bytes are
/// control characters that texts do not contain.
pub(super) fn is_binary(head: &[u8]) -> bool {
    let controls = head.iter().filter(|&&byte| byte < b' ' && !b"\t\n\r\x0c\x1b".contains(&byte)).count();
    head.contains(&0) || controls * 10 > head.len()
}
