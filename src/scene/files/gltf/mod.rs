//! glTF 2.0, as JSON with its buffers or as one binary file. `gltf-json` reads the JSON; every index and every byte is
//! checked here.

mod accessors;
mod buffers;
mod materials;
mod nodes;
mod primitives;
mod textures;

use super::{MeshFile, Pictures, mistake};
use crate::error::{Error, Result};
use crate::scene::obj::{self, Reach, quoted};
use gltf::binary::Glb;
use gltf::json::Root;
use nodes::Walk;
use std::borrow::Cow;
use textures::Files;

/// An error in a file, in words.
type Parsed<T> = std::result::Result<T, String>;

/// Extensions that a file may require: raycl supports them, or adds a note if a material uses them.
const KNOWN: [&str; 4] =
    ["KHR_lights_punctual", "KHR_mesh_quantization", "KHR_texture_transform", "KHR_texture_basisu"];
/// Families of extensions that a file may also require, since they only concern surfaces.
const KNOWN_FAMILIES: [&str; 3] = ["KHR_materials_", "EXT_texture_", "MSFT_texture_"];

/// Reads a file named `name`, and the buffers that it names, if they may be read.
pub(super) fn parse(name: &str, reach: Reach<'_>, bytes: &[u8]) -> Result<MeshFile> {
    let (json, binary) = split(name, bytes)?;
    let root: Root = serde_json::from_slice(&json).map_err(|error| misread(name, &json, &error))?;
    refuse_required(name, &root)?;
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
    file.notes.extend(animations(&root));
    file.notes.extend(passed_over(&root));
    Ok(file)
}

/// The remedy for a buffer that cannot be read.
const BUFFERS: &str =
    "keep the files that a .gltf file names in its folder, or export everything as one .glb file";

/// The JSON and, of a binary file, its first buffer.
type Halves<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

fn split<'a>(name: &str, bytes: &'a [u8]) -> Result<Halves<'a>> {
    if !bytes.starts_with(b"glTF") {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        return Ok((Cow::Borrowed(text), None));
    }
    let glb = Glb::from_slice(bytes)
        .map_err(|error| mistake(name, format!("not a binary glTF 2.0 file: {error}")))?;
    Ok((glb.json, glb.bin))
}

/// Returns the error for JSON that is not glTF 2.0.
fn misread(name: &str, json: &[u8], error: &serde_json::Error) -> Error {
    let version = serde_json::from_slice::<serde_json::Value>(json).ok();
    let version = version.and_then(|value| value["asset"]["version"].as_str().map(str::to_owned));
    match version {
        Some(version) if !version.starts_with('2') => {
            Error::input(format!("{name}: glTF {} is not read; expected 2.0", quoted(version.as_bytes())))
                .with_help("export it as glTF 2.0")
        }
        _ => {
            let message = error.to_string();
            // The line is said before the message.
            let what = message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what);
            mistake(&format!("{name}:{}", error.line()), format!("not valid glTF 2.0: {what}"))
        }
    }
}

fn is_known(extension: &str) -> bool {
    KNOWN.contains(&extension) || KNOWN_FAMILIES.iter().any(|family| extension.starts_with(family))
}

/// Returns a note on unsupported extensions that no other note mentions.
fn passed_over(root: &Root) -> Option<String> {
    let unknown: Vec<String> = root
        .extensions_used
        .iter()
        .filter(|extension| !is_known(extension))
        .take(8)
        .map(|extension| quoted(extension.as_bytes()))
        .collect();
    (!unknown.is_empty()).then(|| format!("unsupported extensions are ignored: {}", unknown.join(", ")))
}

/// Refuses a file that requires unsupported extensions, and names them.
fn refuse_required(name: &str, root: &Root) -> Result<()> {
    let lacking: Vec<String> = root
        .extensions_required
        .iter()
        .filter(|extension| !is_known(extension))
        .map(|e| quoted(e.as_bytes()))
        .collect();
    if lacking.is_empty() {
        return Ok(());
    }
    let what = if lacking.len() == 1 { "the extension" } else { "the extensions" };
    let is_compression =
        |extension: &String| ["draco", "meshopt", "basisu"].iter().any(|word| extension.contains(word));
    let remedy = match root.extensions_required.iter().any(is_compression) {
        true => "export it without compression, with `gltf-transform copy` or Blender for example",
        false => {
            "export it without this extension, or remove it from `extensionsRequired` if the mesh makes sense without it"
        }
    };
    Err(Error::input(format!("{name} requires {what} {}, which raycl does not support", lacking.join(", ")))
        .with_help(remedy))
}

fn animations(root: &Root) -> Option<String> {
    let count = root.animations.len();
    (count > 0).then(|| {
        format!(
            "{} left out: objects stay where the file places them",
            match count {
                1 => "1 animation is".to_owned(),
                _ => format!("{count} animations are"),
            }
        )
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
