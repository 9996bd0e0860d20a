//! Builds the sky of a scene from `[sky]` in the scene's file.

use crate::error::{Result, nearest_file};
use crate::reader::lies_in;
use crate::scene::document::Document;
use crate::scene::frame_cache::FrameCache;
use crate::scene::obj::quoted;
use crate::scene::sky::FileTexels;
use crate::scene::wire::SkyWire;
use crate::scene::{Sky, SkyPicture};
use crate::words::{counted, eight};
use glam::{DVec3, Vec3};
use std::sync::Arc;
use toml::Spanned;

/// Returns the sky of a scene file. `up` is the direction of the zenith. `is_seen` is true if rays that hit nothing see
/// the sky's picture instead of the background. Adds a note if the picture has values that are clearly negative or not
/// a number. Also adds notes on properties of the picture that raycl ignores, such as other primary colours than those
/// of sRGB. Returns an error if the picture cannot be used, or if the sky's keys do not fit together, such as a picture
/// with a zenith.
pub(super) fn build(
    document: &Document,
    sky: &Spanned<SkyWire>,
    (up, is_seen): (DVec3, bool),
    cache: &mut FrameCache,
    notes: &mut Vec<String>,
) -> Result<Sky> {
    let wire = sky.get_ref();
    let refused = |message: &str, label: &str| Err(document.error(sky.span(), message, label));
    let picture = match (&wire.picture, wire.zenith) {
        (Some(_), _) if wire.zenith.is_some() || wire.horizon.is_some() => {
            return refused("a sky is a picture, or has a zenith and a horizon", "this sky has both");
        }
        (Some(file), _) => {
            let FileTexels { size, texels, invalid, mut remarks, unread } =
                texels(document, wire, file, cache)?;
            remarks.extend((invalid > 0).then(|| {
                format!("has negative values or NaN in {}; such values count as 0", counted(invalid, "texel"))
            }));
            remarks.extend(unread_channels(document, file, &unread));
            let name = file.get_ref();
            notes.extend(remarks.iter().map(|remark| format!("the sky's picture `{name}` {remark}")));
            let turn_degrees = wire.turn_degrees.map_or(0.0, |degrees| f64::from(degrees.0));
            Some(Arc::new(SkyPicture { size, texels, ahead: SkyPicture::middle(up, turn_degrees), is_seen }))
        }
        (None, _) if wire.strength.is_some() || wire.turn_degrees.is_some() => {
            return refused("strength and turn_degrees belong to a picture", "this sky has no picture");
        }
        (None, None) => return refused("a sky has a zenith or a picture", "this sky has neither"),
        (None, Some(_)) => None,
    };
    let zenith = wire.zenith.map_or(Vec3::ZERO, |zenith| Vec3::from_array(zenith.0));
    let horizon = wire.horizon.map_or(zenith, |horizon| Vec3::from_array(horizon.0));
    let reach = wire.reach.map_or(f32::MAX, |reach| reach.0);
    Ok(Sky { zenith, horizon, up: up.as_vec3(), reach, picture })
}

/// Returns a remark on the channels of the sky's picture that are not read; `None` if there are none. The remark names
/// the channels if messages may quote the picture's file.
fn unread_channels(document: &Document, file: &Spanned<String>, unread: &[String]) -> Option<String> {
    let quotes = document.quotes || lies_in(&document.folder.join(file.get_ref()), &document.folder);
    let names: Vec<String> = unread.iter().map(|name| quoted(name.as_bytes())).collect();
    let names = if quotes { format!(": {}", eight(&names)) } else { String::new() };
    let verb = if unread.len() == 1 { "is" } else { "are" };
    (!unread.is_empty())
        .then(|| format!("has {} that {verb} not read{names}", counted(unread.len(), "further channel")))
}

/// Returns the sky's picture, with its texels multiplied by the sky's `strength`.
fn texels(
    document: &Document,
    wire: &SkyWire,
    file: &Spanned<String>,
    cache: &mut FrameCache,
) -> Result<FileTexels> {
    let path = document.folder.join(file.get_ref());
    let strength = wire.strength.map_or(1.0, |strength| strength.0);
    cache.picture(&path, strength).map_err(|why| {
        let quotes = document.quotes || lies_in(&path, &document.folder);
        let why = if quotes { why } else { "cannot be used".to_owned() };
        let message = format!("the sky's picture `{}` {why}", path.display());
        let error = document.error(file.span(), message, "here");
        if path.is_file() {
            return error
                .with_help("a sky's picture is a Radiance HDR (RGBE, -Y +X) or an OpenEXR; convert pictures of other formats");
        }
        let meant = nearest_file(&path);
        let meant = meant.map(|meant| format!("did you mean `{}`? ", meant.display())).unwrap_or_default();
        error.with_help(format!("{meant}the path is relative to the folder of the scene file or mesh"))
    })
}
