//! Reads glTF 2.0: a JSON file with separate or embedded buffers, or one binary file. The crate `gltf-json`
//! reads the JSON. This module checks each index of the JSON before it uses the index, and checks that the buffers
//! contain the bytes that it reads.

mod accessors;
mod buffers;
mod container;
mod extension_values;
mod extensions;
mod fallbacks;
mod json;
mod kinds;
mod left_out;
mod locals;
mod materials;
mod memory;
mod node_extensions;
mod nodes;
mod primitives;
mod replaced;
mod skins;
mod survey;
mod textures;
mod transforms;

use super::flaw::{Flaw, Named};
use super::origin::Limit;
use super::unused_parts::Part;
use super::{MeshFile, Pictures};
use crate::error::Result;
use crate::scene::obj::{self, Reach, quoted};
use crate::words::counted_are;
use accessors::Numbers;
use fallbacks::Fallbacks;
use nodes::Walk;
use survey::Survey;
use textures::Files;

/// A result whose error is a message about a mistake in the file. The message quotes the file only if messages may
/// quote the file.
type Parsed<T> = std::result::Result<T, String>;

/// Reads the glTF file `bytes`, and the files that it names. `name` is the file's name in messages, and
/// `reach` says which files may be read.
pub(super) fn parse(name: &str, reach: Reach<'_>, bytes: &[u8]) -> Result<MeshFile> {
    let quotes = reach.permitted.quotes;
    let named = Named { name, quotes };
    let (json, binary) = container::split(named, bytes)?;
    let survey = Survey::of(named, json)?;
    let json::Read { root, locals, animations } = json::read(named, json)?;
    extensions::refuse(named, &root)?;
    extension_values::check(&root).map_err(|what| named.error(what))?;
    let binary_bytes = binary.as_ref().map_or(0, |bytes| bytes.len());
    let buffers = buffers::load(&root, reach, binary).map_err(|flaw| named.error(flaw))?;
    let mut materials = materials::read(&root);
    let placed = transforms::placed(&root, &locals).map_err(|what| named.error(what))?;
    let used = nodes::materials_of(&root, &placed);
    let (mut pictures, mut notes) = (Pictures::default(), Vec::new());
    let files = Files { root: &root, buffers: &buffers, reach };
    files.keep_pictures();
    let (maps, unread) = files.colour_maps(&used, &mut materials.list[1..], &mut pictures, &mut notes);
    materials::correct_blending(&root, &maps, &pictures.list, &mut materials.asked[1..]);
    let fallbacks = Fallbacks::of(&root, &used, &unread);
    notes.extend(fallbacks.note(quotes));
    // glTF orders readers to ignore colour profiles and animations of pictures (2.0, 3.8.2).
    notes.extend(pictures.notes(quotes, &[Part::ColourSpace, Part::Animation]));
    let numbers = Numbers::of_file(&root, &buffers);
    memory::hold(name, numbers, &placed, &maps)?;
    let walk = Walk::of(numbers, (&locals, &placed), &maps, Limit::of(reach.permitted.scaled))
        .map_err(|flaw| named.error(flaw))?;
    let settled = walk.settled((materials.list, pictures.list), &mut |mesh, all| {
        all.append(&mut notes);
        obj::note_materials(&materials.asked, mesh, quotes, all);
    });
    let mut file = settled.map_err(|flaw| named.error(flaw))?;
    file.double_sided = materials::double_sided(&root, &used);
    file.notes.extend(note_animations(animations));
    file.notes.extend(replaced::notes(&root));
    file.notes.extend(survey.notes(quotes));
    file.notes.extend(node_extensions::notes(&root, &placed));
    file.light_notes.extend(node_extensions::note_lights(&root, &placed));
    file.notes.extend(extensions::notes(&root, &survey, &fallbacks, quotes));
    file.notes.extend(json::note_version(&root, quotes));
    file.notes.extend(accessors::notes(numbers));
    file.notes.extend(buffers::notes(&root, &buffers, binary_bytes));
    file.notes.extend(container::notes(bytes));
    Ok(file)
}

fn note_animations(count: usize) -> Option<String> {
    (count > 0).then(|| {
        format!("{} left out: objects stay where the file places them", counted_are(count, "animation"))
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
