//! Checks that a PLY file has the elements and properties that a mesh needs. The header of a PLY file may
//! define any elements with any properties. Without the checks of this module, a missing property would be
//! read as zeros.

use super::colour::CHANNELS;
use super::elements::{NORMAL, is_corners};
use crate::error::or_meant;
use crate::scene::files::flaw::Flaw;
use crate::scene::obj::quoted;
use crate::words::counted;
use ply_rs_bw::ply::{ElementDef, Header, PropertyDef, PropertyType, ScalarType};

/// Largest number of properties that a message lists.
const MOST_LISTED: usize = 8;

/// Returns an error if vertices have no x or y, or if faces or strips have no list of corners. Also returns the error
/// of [`check_names`].
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
    Flaw::quoting(format!("{what}; it has {}", names.join(", ")), what).with_remedy(
        "rename the properties as expected (vertices have x, y and z), or convert the file to OBJ",
    )
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

/// Returns the groups of properties, such as nx, ny and nz, that elements of the type `kind` may have only together.
/// The names r, g and b are no group, since a single `r` may also be a radius.
pub(super) fn groups(kind: &str) -> Vec<[&'static str; 3]> {
    let [colours, diffuse, _] = CHANNELS;
    match kind {
        "vertex" => vec![NORMAL, colours, diffuse],
        "face" => vec![colours, diffuse],
        _ => Vec::new(),
    }
}

/// Returns how many properties of a group an element has; `None` if it has all or none of them.
pub(super) fn incomplete(element: &ElementDef, group: &[&str; 3]) -> Option<usize> {
    let count = group.iter().filter(|name| has_number(element, name)).count();
    (1..group.len()).contains(&count).then_some(count)
}

/// Returns a note if vertices have no z, and a note on each group of properties, such as nx, ny and nz, of
/// which only some exist.
pub(super) fn notes(header: &Header) -> Vec<String> {
    let Some(vertex) = header.elements.get("vertex") else { return Vec::new() };
    let mut notes = Vec::new();
    if !has_number(vertex, "z") {
        notes.push(format!("{}: z is 0", counted(vertex.count, "vertex without z")));
    }
    for (kind, who) in [("vertex", "vertices"), ("face", "faces")] {
        let Some(element) = header.elements.get(kind) else { continue };
        notes.extend(groups(kind).iter().filter_map(|names| {
            let (count, all) = (incomplete(element, names)?, names.join(", "));
            Some(format!(
                "{who} have only {count} of the properties {all}, so raycl reads none of these properties"
            ))
        }));
    }
    notes
}
