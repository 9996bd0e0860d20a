//! Reads base-colour textures and emissive textures. The pictures of these textures are in a buffer, in a
//! separate file, or in the JSON as base64.

use super::Parsed;
use super::buffers::{Bytes, decoded, is_data, unescaped};
use super::materials::{emits, extension, least_alpha};
use super::{fallbacks, json};
use crate::scene::few_notes::FewNotes;
use crate::scene::files::{Pictures, Usage};
use crate::scene::obj::{Reach, quoted_name};
use crate::scene::{Mapped, Material, Wrap};
use glam::{DAffine2, DVec2};
use gltf::json::material::Material as Wire;
use gltf::json::texture::{Info, MagFilter, MinFilter, Sampler, Texture, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root, image::Image};
use std::borrow::Cow;
use std::collections::{BTreeSet, HashSet};
use std::iter;

/// Texture coordinates with a larger absolute value are inexact. glTF stores coordinates in single precision,
/// and beyond this value, neighbouring numbers differ by at least 1/2048 of the picture's side.
const COARSE: f64 = 4096.0;

/// A material's base-colour texture, and how the file's texture coordinates become coordinates in the
/// material's textures.
#[derive(Clone, Copy, Debug)]
pub(super) struct ColourMap {
    /// The texture's index in `Pictures::list`, not in the glTF file; `None` if the material has only an
    /// emissive texture.
    texture: Option<u32>,
    usage: Usage,
    /// The index of the set of texture coordinates in a primitive.
    pub set: u32,
    /// The transform from the file's texture coordinates to those of the picture.
    transform: DAffine2,
}

impl ColourMap {
    /// Returns the texture coordinates of a triangle with this material.
    pub fn mapped(&self, corners: [[f32; 2]; 3]) -> Mapped {
        let transformed = |corner| self.transform.transform_point2(vector(corner)).to_array();
        Mapped::new(corners.map(transformed), self.texture, self.mask(), self.usage.wrap)
    }

    /// Returns the texture if its alpha makes holes.
    pub fn mask(&self) -> Option<u32> {
        self.texture.filter(|_| self.usage.least_alpha > 0)
    }

    /// Returns true if the coordinates of a triangle with this material are so far from 0 that they are
    /// inexact in single precision. Coordinates of a clamped picture never count as inexact: far from 0, a
    /// clamped picture looks the same everywhere.
    pub fn is_coarse(&self, corners: [[f32; 2]; 3]) -> bool {
        corners.into_iter().any(|corner| {
            // The transform's offset is left out: it is added in double precision, so it makes no coordinate
            // less exact.
            let scaled = self.transform.transform_vector2(vector(corner)).abs().to_array();
            scaled.into_iter().zip(self.usage.wrap).any(|(value, wrap)| value > COARSE && wrap != Wrap::Clamp)
        })
    }
}

/// Where pictures are read from: the JSON and the buffers of the glTF file, and the files that the JSON may
/// name (`reach`).
#[derive(Clone, Copy)]
pub(super) struct Files<'a> {
    pub root: &'a Root,
    pub buffers: &'a [Bytes<'a>],
    pub reach: Reach<'a>,
}

impl Files<'_> {
    /// Makes sure that no command writes to a picture's file that the JSON names, even if raycl does not use the
    /// picture ([`Reach::keep`]).
    pub fn keep_pictures(self) {
        self.root.images.iter().for_each(|image| self.reach.keep(file_name(image).into_iter()));
    }

    /// Returns the texture of each material, in the file's order. A material without a texture gets `None`, and so does
    /// a material whose index is not in `used`. If a texture cannot be read, the function adds a note to `notes`; the
    /// material then keeps its own colour or, if the texture is emissive, emits no light. The function also gives the
    /// emissive textures to `materials`, in the same order, and returns the indices of the textures that cannot be
    /// read.
    pub fn colour_maps(
        self,
        used: &HashSet<usize>,
        materials: &mut [Material],
        pictures: &mut Pictures,
        notes: &mut Vec<String>,
    ) -> (Vec<Option<ColourMap>>, HashSet<usize>) {
        let (mut unusable, mut unread) = (FewNotes::default(), HashSet::new());
        let mut read = |info: Option<Info>, least_alpha: f32, instead: &str, notes: &mut Vec<String>| {
            let info = info?;
            let number = info.index.value();
            self.map(&info, least_alpha, pictures)
                .map_err(|why| {
                    // The reason may quote the file, so it is shown only if messages may quote the file.
                    let why = if self.reach.permitted.quotes {
                        format!(" {why}")
                    } else {
                        " cannot be read".to_owned()
                    };
                    let note = format!("texture {number}{why}: {instead}");
                    unusable.add(note.clone(), || note, notes);
                    unread.insert(number);
                })
                .ok()
        };
        let mut maps = Vec::new();
        for ((index, wire), material) in self.root.materials.iter().enumerate().zip(materials) {
            let is_used = used.contains(&index);
            let colour = colour_texture(wire).filter(|_| is_used);
            let least = least_alpha(wire);
            let own = match least > 0.0 {
                true => "its material's own colour is used, without holes",
                false => "its material's own colour is used",
            };
            let colour = read(colour, least, own, notes);
            let emissive = emissive_texture(self.root, wire).filter(|_| is_used);
            let emissive =
                read(emissive, 0.0, "its material emits no light, unless the scene sets `emitted`", notes);
            if wire.emissive_texture.is_some() {
                material.set_emission_texture(emissive.and_then(|map| map.texture));
            }
            maps.push(colour.or(emissive.map(|map| ColourMap { texture: None, ..map })));
        }
        notes.extend(unusable.rest("texture"));
        (maps, unread)
    }

    fn map(self, info: &Info, least_alpha: f32, pictures: &mut Pictures) -> Parsed<ColourMap> {
        let texture = self.root.get(info.index).ok_or("does not exist")?;
        let usage = Usage::mask(wrap(self.root, texture), least_alpha);
        let image = self.root.get(texture.source);
        let image = image.ok_or_else(|| fallbacks::missing(texture))?;
        let (transform, set) = transform(info);
        if !transform.as_affine2().is_finite() {
            return Err("has a transform that is not finite".to_owned());
        }
        let number = self.picture(texture.source, image, usage, pictures)?;
        Ok(ColourMap { texture: Some(number), usage, set, transform })
    }

    fn picture(
        self,
        index: Index<Image>,
        image: &Image,
        usage: Usage,
        pictures: &mut Pictures,
    ) -> Parsed<u32> {
        if let Some(name) = file_name(image) {
            let file = pictures.file(self.reach, &name, usage);
            let similar = || self.reach.other_case(iter::once(&name));
            return file.map_err(|why| format!("{} {why}{}", quoted_name(&name), similar()));
        }
        let key = index.value().to_string();
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) if is_data(uri) => pictures.bytes(&key, || decoded(uri).map(Cow::Owned), usage),
            (Some(uri), _) => Err(format!("{} is not a file; nothing is downloaded", quoted_name(uri))),
            (None, Some(view)) => {
                let view = self.root.get(view).ok_or("has a buffer view that does not exist")?;
                let buffer =
                    self.buffers.get(view.buffer.value()).ok_or("has a buffer that does not exist")?;
                let start = view.byte_offset.unwrap_or_default().0;
                let end = start.saturating_add(view.byte_length.0).min(buffer.len() as u64);
                let bytes = &buffer[start.min(end) as usize..end as usize];
                pictures.bytes(&key, || Ok(Cow::Borrowed(bytes)), usage)
            }
            (None, None) => Err("has an image with neither a `uri` nor a `bufferView`".to_owned()),
        }
    }
}

/// Returns the name of a picture's file; `None` if the picture is not in a file of its own.
fn file_name(image: &Image) -> Option<String> {
    let uri = image.uri.as_ref().filter(|uri| !is_data(uri) && !uri.contains("://"))?;
    Some(unescaped(uri))
}

fn wrap(root: &Root, texture: &Texture) -> [Wrap; 2] {
    let of = |mode| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    let wrap = |sampler: &Sampler| [of(sampler.wrap_s), of(sampler.wrap_t)];
    sampler_of(root, texture).map_or([Wrap::Repeat; 2], wrap)
}

fn sampler_of<'a>(root: &'a Root, texture: &Texture) -> Option<&'a Sampler> {
    root.get(texture.sampler?)
}

/// Returns the unsupported options in the samplers of a material's colour texture and its emissive texture: hard edges
/// between texels, no mip levels, filters and wrap modes that glTF does not define, and samplers that do not exist.
pub(super) fn unsupported_options(root: &Root, wire: &Wire) -> impl Iterator<Item = &'static str> {
    let all = [colour_texture(wire), emissive_texture(root, wire)];
    let mut options: Vec<_> =
        all.into_iter().flatten().flat_map(|info| sampler_options(root, info)).collect();
    options.sort_unstable();
    options.dedup();
    options.into_iter()
}

fn sampler_options(root: &Root, info: Info) -> impl Iterator<Item = &'static str> + use<> {
    let texture = root.get(info.index);
    let sampler = texture.and_then(|texture| sampler_of(root, texture));
    let is_missing = texture.is_some_and(|texture| texture.sampler.is_some()) && sampler.is_none();
    let of_sampler = |sampler: &Sampler| {
        let filters = [
            match sampler.mag_filter {
                Some(Checked::Valid(MagFilter::Nearest)) => Some("magFilter NEAREST"),
                Some(Checked::Invalid) => Some("unknown magFilter"),
                _ => None,
            },
            match sampler.min_filter {
                Some(Checked::Valid(MinFilter::Nearest)) => Some("minFilter NEAREST"),
                Some(Checked::Valid(MinFilter::Linear)) => Some("minFilter LINEAR"),
                Some(Checked::Valid(MinFilter::NearestMipmapNearest)) => {
                    Some("minFilter NEAREST_MIPMAP_NEAREST")
                }
                Some(Checked::Invalid) => Some("unknown minFilter"),
                // All other filters mix texels or mip levels, as raycl's filter does, and hardly look different from
                // it. Exporters write these filters even if nobody asks for them, so a note would be useless.
                _ => None,
            },
        ];
        let unknown = |wrap, option| matches!(wrap, Checked::Invalid).then_some(option);
        let wraps = [unknown(sampler.wrap_s, "unknown wrapS"), unknown(sampler.wrap_t, "unknown wrapT")];
        filters.into_iter().chain(wraps).flatten()
    };
    let missing = is_missing.then_some("a sampler that does not exist");
    missing.into_iter().chain(sampler.map(of_sampler).into_iter().flatten())
}

/// Returns the texture of a material's colour; `None` if there is none. A material with the older extension
/// KHR_materials_pbrSpecularGlossiness has its colour texture under the key `diffuseTexture`.
pub(super) fn colour_texture(wire: &Wire) -> Option<Info> {
    let older = extension(wire, "KHR_materials_pbrSpecularGlossiness");
    match older {
        Some(older) => texture_info(older.get("diffuseTexture")?),
        None => wire.pbr_metallic_roughness.base_color_texture.clone(),
    }
}

/// Reads a texture in an extension of a material; `None` if `value` is not a texture. Its `extras` may be anything.
pub(super) fn texture_info(value: &serde_json::Value) -> Option<Info> {
    let mut value = value.clone();
    json::strip(&mut value);
    serde_json::from_value(value).ok()
}

/// Returns the indices of the colour textures and the emissive textures of the materials with the indices `used`.
pub(super) fn used_by(root: &Root, used: &HashSet<usize>) -> BTreeSet<usize> {
    let materials = used.iter().filter_map(|index| root.materials.get(*index));
    let infos = materials.flat_map(|wire| [colour_texture(wire), emissive_texture(root, wire)]);
    infos.flatten().map(|info| info.index.value()).collect()
}

/// Returns the texture of a material's emitted light; `None` if there is none, if the material emits no light, or if
/// the texture is placed differently from the colour texture.
fn emissive_texture(root: &Root, wire: &Wire) -> Option<Info> {
    wire.emissive_texture.clone().filter(|_| emits(wire) && !emissive_is_apart(root, wire))
}

/// Returns true if a material emits light from a texture, and has a colour texture with other texture
/// coordinates, another transform or other wrap modes than the emissive texture. A triangle has only one set
/// of coordinates for all of its textures.
pub(super) fn emissive_is_apart(root: &Root, wire: &Wire) -> bool {
    let (Some(emissive), Some(colour)) = (&wire.emissive_texture, &colour_texture(wire)) else {
        return false;
    };
    let place = |info: &Info| {
        let (transform, set) = transform(info);
        let wrap = root.get(info.index).map(|texture| wrap(root, texture));
        (transform, set, wrap)
    };
    emits(wire) && place(emissive) != place(colour)
}

/// Converts a texture coordinate to double precision, so that its transform is exact enough.
fn vector(coordinate: [f32; 2]) -> DVec2 {
    DVec2::from_array(coordinate.map(f64::from))
}

/// The extension that transforms texture coordinates.
pub(super) const TRANSFORM: &str = "KHR_texture_transform";

/// Returns the extension [`TRANSFORM`] of a texture.
pub(super) fn texture_extension(info: &Info) -> Option<&serde_json::Value> {
    info.extensions.as_ref().and_then(|extensions| extensions.others.get(TRANSFORM))
}

/// Returns the transform that the extension [`TRANSFORM`] states, or the identity. Also returns the index of the
/// texture's set of texture coordinates; the extension may state another index than the texture.
fn transform(info: &Info) -> (DAffine2, u32) {
    let Some(named) = texture_extension(info) else { return (DAffine2::IDENTITY, info.tex_coord) };
    let pair = |key: &str, usual: f64| {
        let value = |at: usize| named[key][at].as_f64().unwrap_or(usual);
        DVec2::new(value(0), value(1))
    };
    let rotation = named["rotation"].as_f64().unwrap_or(0.0);
    // The angle is negated: glTF's rotation is counter-clockwise as seen in the picture, where v grows downwards.
    let transform =
        DAffine2::from_scale_angle_translation(pair("scale", 1.0), -rotation, pair("offset", 0.0));
    let set = named["texCoord"].as_u64().and_then(|set| u32::try_from(set).ok());
    (transform, set.unwrap_or(info.tex_coord))
}
