//! glTF 2.0, as JSON with its buffers or as one binary file. `gltf-json` reads the JSON; every index and every byte is
//! checked here.

mod accessors;
mod buffers;
mod container;
mod extensions;
mod json;
mod left_out;
mod materials;
mod nodes;
mod primitives;
mod textures;

use super::{MeshFile, Pictures, mistake};
use crate::error::{Error, Result};
use crate::scene::obj::{self, Reach, quoted};
use crate::words::counted_are;
use nodes::Walk;
use textures::Files;

/// A result whose error is a message about a mistake in the file.
type Parsed<T> = std::result::Result<T, String>;

/// Reads a file named `name`, and the files that it names; `reach` says which files may be read.
pub(super) fn parse(name: &str, reach: Reach<'_>, bytes: &[u8]) -> Result<MeshFile> {
    let (json, binary) = container::split(name, bytes)?;
    let json::Read { root, animations } = json::read(name, json)?;
    extensions::refuse(name, &root)?;
    let buffers =
        buffers::load(&root, reach, binary).map_err(|what| mistake(name, what).with_help(BUFFERS))?;
    let materials = materials::read(&root);
    let (mut pictures, mut notes) = (Pictures::default(), Vec::new());
    let maps = Files { root: &root, buffers: &buffers, reach }.colour_maps(&mut pictures, &mut notes);
    let walk = Walk::of(&root, &buffers, &maps).map_err(|what| mistake(name, what))?;
    let mut file = walk.settled(name, (materials.list, pictures.list), &mut |mesh, all| {
        all.append(&mut notes);
        obj::note_materials(&materials.asked, mesh, reach.permitted.quotes, all);
    })?;
    file.notes.extend(note_animations(animations));
    file.notes.extend(extensions::notes(&root));
    Ok(file)
}

/// The remedy for a buffer that cannot be read.
const BUFFERS: &str =
    "put the files that a .gltf file names into its folder, or export everything as one .glb file";

fn note_animations(count: usize) -> Option<String> {
    (count > 0).then(|| {
        format!("{} left out: objects stay where the file places them", counted_are(count, "animation"))
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
