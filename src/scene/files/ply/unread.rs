//! Finds the properties of vertices, faces and strips that raycl does not read. Also refuses files with two
//! properties for one value that raycl reads.

use super::colour::channels;
use super::elements::{CORNERS, NORMAL, is_corners};
use super::needed::{groups, incomplete};
use crate::scene::files::flaw::Flaw;
use crate::scene::obj::quoted;
use crate::words::{counted, counted_are, eight};
use ply_rs_bw::ply::{ElementDef, Header, PropertyDef, PropertyType};

/// The elements of which raycl reads properties, and the words for them in messages.
const KINDS: [(&str, &str); 3] = [("vertex", "vertex"), ("face", "face"), ("tristrips", "strip")];

/// Returns an error if an element has two properties for the same value: two lists of corners, or two properties of the
/// same name. If raycl reads neither of the two, they cause no error.
pub(super) fn check(header: &Header) -> Result<(), Flaw> {
    let elements = KINDS.into_iter().filter_map(|(kind, _)| Some((kind, header.elements.get(kind)?)));
    elements
        .filter(|(_, element)| element.count > 0)
        .try_for_each(|(kind, element)| check_twice(kind, element))
}

fn check_twice(kind: &str, element: &ElementDef) -> Result<(), Flaw> {
    let (read, unread) = parted(kind, element);
    let is_list = |property: &&PropertyDef| {
        kind != "vertex" && is_corners(&property.name) && matches!(property.data_type, PropertyType::List(..))
    };
    let mut lists = element.properties.values().filter(is_list);
    let two = (lists.next(), lists.next());
    let same = unread.iter().find(|other| read.iter().any(|one| one.name == other.name));
    let shown = |property: &PropertyDef| quoted(property.name.as_bytes());
    let what = match (two, same) {
        ((Some(one), Some(other)), _) => format!("lists of corners, {} and {}", shown(one), shown(other)),
        (_, Some(one)) => format!("properties {}", shown(one)),
        _ => return Ok(()),
    };
    // The names are known to raycl, so they are no quotation of the file.
    let flaw = Flaw::from(format!("`{}` has two {what}; expected one of them", element.name));
    Err(flaw.with_remedy("export the file again with one of the two"))
}

/// Returns, for vertices, faces and strips, a note with the names and the number of the properties that are not read.
/// The notes have names from the file only if `quotes` is true.
pub(super) fn notes(header: &Header, quotes: bool) -> Vec<String> {
    let note_on = |(kind, word)| note(kind, word, header.elements.get(kind)?, quotes);
    KINDS.into_iter().filter_map(note_on).collect()
}

fn note(kind: &str, word: &str, element: &ElementDef, quotes: bool) -> Option<String> {
    let (_, unread) = parted(kind, element);
    if unread.is_empty() || element.count == 0 {
        return None;
    }
    let names: Vec<String> = unread.iter().map(|property| quoted(property.name.as_bytes())).collect();
    let names = if quotes { format!(" ({})", eight(&names)) } else { String::new() };
    let who = counted(element.count, word);
    Some(format!("{} not read{names}", counted_are(unread.len(), &format!("property of {who}"))))
}

/// Returns the properties of an element of the type `kind` (`vertex`, `face` or `tristrips`): first those that raycl
/// reads, then those that it does not read. A property of an incomplete group counts as read, because a note on the
/// whole group names it.
fn parted<'a>(kind: &str, element: &'a ElementDef) -> (Vec<&'a PropertyDef>, Vec<&'a PropertyDef>) {
    let known = known(kind, element);
    let is_read = |(name, property): (&String, &PropertyDef)| {
        let is_list = matches!(property.data_type, PropertyType::List(..));
        known.contains(&name.as_str()) && is_list == is_corners(name)
    };
    let (read, unread): (Vec<_>, Vec<_>) = element.properties.iter().partition(|of| is_read(*of));
    let defs = |list: Vec<(_, &'a PropertyDef)>| list.into_iter().map(|(_, property)| property).collect();
    (defs(read), defs(unread))
}

/// Returns the names of the properties that raycl reads, or that another note counts or names.
fn known(kind: &str, element: &ElementDef) -> Vec<&'static str> {
    let mut known = match kind {
        "vertex" => [&["x", "y", "z"], &NORMAL[..]].concat(),
        _ => CORNERS.to_vec(),
    };
    match channels(element).filter(|_| kind != "tristrips") {
        Some(channels) => known.extend(channels),
        // Without a colour, a vertex's `alpha` can only be opacity, on which there is a note.
        None if kind == "vertex" => known.push("alpha"),
        None => {}
    }
    known.extend(groups(kind).into_iter().filter(|group| incomplete(element, group).is_some()).flatten());
    known
}
