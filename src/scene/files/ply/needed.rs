//! Checks that a PLY file has the elements and properties that a mesh needs. The header of a PLY file may
//! define any elements with any properties. Without the checks of this module, a missing property would be
//! read as zeros.

use super::colour::CHANNELS;
use super::elements::is_corners;
use crate::error::or_meant;
use crate::scene::files::flaw::Flaw;
use crate::scene::obj::quoted;
use crate::words::counted;
use ply_rs_bw::ply::{ElementDef, Header, PropertyDef, PropertyType, ScalarType};

/// Largest number of properties that a message lists.
const MOST_LISTED: usize = 8;

/// Returns an error if vertices have no x or y, or if faces or strips have no list of corners. Also returns an error if
/// the header lacks vertices or faces, but has an element with a similar name.
pub(super) fn check(header: &Header) -> Result<(), Flaw> {
    check_names(header)?;
    let element = |name: &str| header.elements.get(name).filter(|element| element.count > 0);
    if let Some(vertex) = element("vertex")
        && let Some(name) = ["x", "y"].into_iter().find(|name| !has_number(vertex, name))
    {
        return Err(without(vertex, &format!("no number `{name}`")));
    }
    let mut faces = ["face", "tristrips"].into_iter().filter_map(element);
    match faces.find(|faces| !faces.properties.values().any(has_corners)) {
        Some(faces) => Err(without(faces, "no list `vertex_indices` (or `vertex_index`) of whole numbers")),
        None => Ok(()),
    }
}

/// Returns an error if the header lacks vertices, or lacks both faces and strips, but has an element with a
/// similar name.
fn check_names(header: &Header) -> Result<(), Flaw> {
    let lacks = |names: &[&str]| !names.iter().any(|name| header.elements.contains_key(*name));
    for (name, others) in [("vertex", &["vertex"][..]), ("face", &["face", "tristrips"])] {
        let meant = or_meant(name, header.elements.keys().map(String::as_str));
        if lacks(others) && !meant.is_empty() {
            let what = format!("the header has no element `{name}`");
            return Err(Flaw::quoting(format!("{what}{meant}"), what));
        }
    }
    Ok(())
}

/// Returns the error for an element that lacks a property. `what` says which property is missing.
fn without(element: &ElementDef, what: &str) -> Flaw {
    let mut names: Vec<String> = element.properties.values().take(MOST_LISTED).map(described).collect();
    names.extend((element.properties.len() > MOST_LISTED).then(|| "...".to_owned()));
    let what = format!("`{}` has {what}", element.name);
    Flaw::quoting(format!("{what}; it has {}", names.join(", ")), what)
}

/// Returns the words for a property in messages: its name, and its type if it is a list.
fn described(property: &PropertyDef) -> String {
    let name = quoted(property.name.as_bytes());
    match &property.data_type {
        PropertyType::Scalar(_) => name,
        PropertyType::List(_, kind) if is_whole(kind) => format!("{name} (a list)"),
        PropertyType::List(..) => format!("{name} (a list of decimal numbers)"),
    }
}

fn is_whole(kind: &ScalarType) -> bool {
    !matches!(kind, ScalarType::Float | ScalarType::Double)
}

fn has_corners(property: &PropertyDef) -> bool {
    let is_list = matches!(&property.data_type, PropertyType::List(_, kind) if is_whole(kind));
    is_list && is_corners(&property.name)
}

/// Returns true if an element has a property of this name, and the property is a number, not a list.
pub(super) fn has_number(element: &ElementDef, name: &str) -> bool {
    let property = element.properties.get(name);
    property.is_some_and(|property| matches!(property.data_type, PropertyType::Scalar(_)))
}

/// Returns a note if vertices have no z, and a note on each group of properties, such as nx, ny and nz, of
/// which only some exist.
pub(super) fn notes(header: &Header) -> Vec<String> {
    let Some(vertex) = header.elements.get("vertex") else { return Vec::new() };
    let mut notes = Vec::new();
    if !has_number(vertex, "z") {
        notes.push(format!("{}: z is 0", counted(vertex.count, "vertex without z")));
    }
    // The names r, g and b are not checked, since a single `r` may also be a radius.
    let [colours, diffuse, _] = CHANNELS;
    let of_vertices = [["nx", "ny", "nz"], colours, diffuse].map(|names| ("vertices", vertex, names));
    let face = header.elements.get("face");
    let of_faces = face.map(|face| [colours, diffuse].map(|names| ("faces", face, names)));
    for (who, element, names) in of_vertices.into_iter().chain(of_faces.into_iter().flatten()) {
        let count = names.iter().filter(|name| has_number(element, name)).count();
        if (1..names.len()).contains(&count) {
            let all = names.join(", ");
            notes.push(format!(
                "{who} have only {count} of the properties {all}, so raycl reads none of these properties"
            ));
        }
    }
    notes
}
