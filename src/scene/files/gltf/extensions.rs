//! The extensions that a glTF file uses: which are supported, which are noted, and which are refused.

use super::accessors::is_empty;
use super::fallbacks::Fallbacks;
use super::materials::extension_wish;
use super::node_extensions;
use super::survey::Survey;
use super::{Flaw, Named, Result, quoted};
use crate::words::{counted, first};
use gltf::json::Root;
use gltf::json::buffer::Buffer;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use std::collections::BTreeSet;

/// Extensions that raycl supports.
const SUPPORTED: [&str; 5] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];
/// raycl assumes that an extension whose name contains one of these words compresses vertices in a form that
/// raycl cannot read.
const COMPRESSIONS: [&str; 3] = ["compression", "draco", "meshopt"];
/// Largest number of extensions that a note lists.
const MOST_LISTED: usize = 8;

/// The extension that stores the vertices and triangles of a primitive (a part of a mesh) in compressed form.
const DRACO: &str = "KHR_draco_mesh_compression";

/// Returns true if raycl supports an extension, or if another module writes a note on each part of the file that has
/// it.
fn is_known(extension: &str, survey: &Survey, fallbacks: &Fallbacks<'_>) -> bool {
    let is_of_material = extension_wish(extension).is_some();
    let is_of_node = node_extensions::are_noted(extension) && survey.extensions.contains_key(extension);
    SUPPORTED.contains(&extension) || is_of_material || is_of_node || fallbacks.are_noted(extension)
}

fn is_compression(extension: &str) -> bool {
    COMPRESSIONS.iter().any(|part| extension.contains(part))
}

/// Refuses a file that requires an extension which compresses vertices, and a file that has vertices in
/// compressed form only. The error names the unsupported extensions if messages may quote the glTF file.
pub(super) fn refuse(named: Named<'_>, root: &Root) -> Result<()> {
    let mut lacking = list(root.extensions_required.iter().filter(|extension| is_compression(extension)));
    if lacking.is_empty() {
        lacking.extend(root.buffers.iter().find_map(compression_of).map(|name| quoted(name.as_bytes())));
    }
    let mut primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if lacking.is_empty() && primitives.any(|primitive| is_compressed(root, primitive)) {
        lacking.push(quoted(DRACO.as_bytes()));
    }
    let what = match lacking.len() {
        0 => return Ok(()),
        1 => "the extension",
        _ => "the extensions",
    };
    let text = |what: &str| format!("the file requires {what}, which raycl does not support");
    let quoting = text(&format!("{what} {}", first(&lacking, MOST_LISTED)));
    Err(named
        .error(Flaw::quoting(quoting, text("an extension that compresses its vertices")))
        .with_help("export the file without compression, for example with `gltf-transform copy` or Blender"))
}

/// Returns the name of the extension that decompresses vertices into this buffer; `None` if the buffer has a URI, or
/// has no such extension. A buffer with such an extension stores nothing itself.
fn compression_of(buffer: &Buffer) -> Option<&String> {
    let extensions = buffer.extensions.as_ref().filter(|_| buffer.uri.is_none())?;
    extensions.others.keys().find(|name| is_compression(name))
}

/// Returns true if a primitive (a part of a mesh) has its vertices in compressed form only.
fn is_compressed(root: &Root, primitive: &Primitive) -> bool {
    let compressed =
        primitive.extensions.as_ref().is_some_and(|extensions| extensions.others.contains_key(DRACO));
    let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
    compressed && positions.is_none_or(|index| is_empty(root, *index))
}

/// Returns notes on unsupported extensions, except those on which other modules write notes, and on supported
/// extensions in places where raycl does not read them. The notes concern the extensions that the file lists, and
/// those that a part of the file has without being listed. The notes contain the names of the extensions only if
/// `quotes` is true.
pub(super) fn notes(
    root: &Root,
    survey: &Survey,
    fallbacks: &Fallbacks<'_>,
    quotes: bool,
) -> impl Iterator<Item = String> {
    let is_known = |name: &str| is_known(name, survey, fallbacks);
    // No other module writes a note on an extension that no part of the file has.
    let is_noted = |name: &String| is_known(name) && survey.extensions.contains_key(name);
    let needed = root.extensions_required.iter();
    let needed = needed.filter(|name| !SUPPORTED.contains(&name.as_str()) && !is_noted(name));
    let used: BTreeSet<_> = root.extensions_used.iter().chain(survey.extensions.keys()).collect();
    let ignored = used.into_iter().filter(|name| !is_known(name) && !root.extensions_required.contains(name));
    let misplaced =
        survey.misplaced.iter().filter(|((name, _), _)| is_known(name) && !fallbacks.are_noted(name));
    let misplaced = misplaced
        .map(|((name, place), count)| format!("{} in {place}{}", quoted(name.as_bytes()), times(*count)));
    let with_count = |name: &String| {
        let count = survey.extensions.get(name).copied().unwrap_or_default();
        quoted(name.as_bytes()) + &times(count)
    };
    let note = |what: &str, names: Vec<String>| {
        let listed = || if quotes { format!(": {}", first(&names, MOST_LISTED)) } else { String::new() };
        (!names.is_empty()).then(|| what.to_owned() + &listed())
    };
    let what = "the file requires extensions that raycl does not support, so the picture may be wrong";
    let notes = [
        note(what, needed.map(with_count).collect()),
        note("unsupported extensions are ignored", ignored.map(with_count).collect()),
        note("extensions in places where they have no meaning are ignored", misplaced.collect()),
    ];
    notes.into_iter().flatten()
}

/// Returns words, in brackets, on the number of objects that have an extension. Returns an empty text if only one
/// object has the extension.
fn times(count: usize) -> String {
    if count > 1 { format!(" ({})", counted(count, "time")) } else { String::new() }
}

fn list<'a>(extensions: impl Iterator<Item = &'a String>) -> Vec<String> {
    extensions.map(|extension| quoted(extension.as_bytes())).collect()
}
