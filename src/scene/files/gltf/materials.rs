//! Reads the base colours and the emitted light of glTF materials, and counts the materials' unsupported
//! features.

use super::textures::{ColourMap, colour_texture, emissive_is_apart, unsupported_options};
use crate::scene::Texture;
use crate::scene::files::colours::is_outside;
use crate::scene::material::{MAX_EMITTED, Material};
use crate::scene::obj::{Asked, Wish};
use glam::Vec3;
use gltf::json::material::{AlphaMode, Material as Wire};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Root, extensions::material::Material as Extensions};
use std::collections::HashSet;

/// Materials and their unsupported features. Material 0 is for primitives without a material and without
/// colours. [`white`] returns the index of the material for primitives that have colours but no material.
pub(super) struct Materials {
    pub list: Vec<Material>,
    pub asked: Vec<Asked>,
}

pub(super) fn read(root: &Root) -> Materials {
    // In glTF, a primitive without a material is white. raycl gives it a diffuse reflectance (k_L) of 0.8,
    // the default for meshes of all formats.
    let mut materials = Materials { list: vec![Material::default()], asked: vec![Asked::default()] };
    for wire in &root.materials {
        materials.list.push(Material { emitted: emitted(wire), ..Material::lambertian(base_colour(wire)) });
        materials.asked.push(asked(root, wire));
    }
    let is_white = |primitive: &Primitive| primitive.material.is_none() && has_colours(primitive);
    if root.meshes.iter().flat_map(|mesh| &mesh.primitives).any(is_white) {
        // The colours of a primitive's corners are multiplied by its material's colour. If the primitive has no
        // material, glTF uses white.
        materials.list.push(Material::lambertian(Vec3::ONE));
        materials.asked.push(Asked::default());
    }
    materials
}

/// Returns the index of the material for primitives that have colours but no material.
pub(super) fn white(root: &Root) -> u32 {
    root.materials.len() as u32 + 1
}

fn has_colours(primitive: &Primitive) -> bool {
    primitive.attributes.contains_key(&Checked::Valid(Semantic::Colors(0)))
}

/// raycl does not blend a surface with the surfaces behind it. If a material asks for blending, points with an alpha of
/// at least `BLENDED` are opaque, and all other points are holes. [`least_alpha`] says what happens if all points would
/// be holes.
const BLENDED: f32 = 0.5;

/// Returns the smallest alpha, from 0 to 1, of a texel that is not in a hole; 0 if there are no holes.
pub(super) fn least_alpha(wire: &Wire) -> f32 {
    match wire.alpha_mode {
        // Here, the factor by which the texture's alpha is multiplied is below one half, so every point would
        // be a hole. A flat mesh that imitates a soft shadow has such a factor, for example. Without holes,
        // the surface would hide the surfaces behind it. raycl therefore ignores the factor of alpha: only
        // the texture's alpha decides which points are holes.
        Checked::Valid(AlphaMode::Blend) if factor(wire) > 0.0 && is_hidden(wire) => BLENDED,
        Checked::Valid(AlphaMode::Mask | AlphaMode::Blend) if !is_hidden(wire) => cutoff(wire) / factor(wire),
        _ => 0.0,
    }
}

/// Returns true if the material's alpha masks or blends the surface.
pub(super) fn uses_alpha(wire: &Wire) -> bool {
    matches!(wire.alpha_mode, Checked::Valid(AlphaMode::Mask | AlphaMode::Blend))
}

/// Returns the cutoff, 0 or more: a point is in a hole if its alpha, the texture's alpha times the factor, is
/// less than the cutoff.
fn cutoff(wire: &Wire) -> f32 {
    match wire.alpha_mode {
        Checked::Valid(AlphaMode::Blend) => BLENDED,
        _ => wire.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0.max(0.0)),
    }
}

/// Returns the factor by which the texture's alpha is multiplied, from 0 to 1.
fn factor(wire: &Wire) -> f32 {
    stated_alpha(wire).clamp(0.0, 1.0)
}

fn stated_alpha(wire: &Wire) -> f32 {
    let older = extension(wire, "KHR_materials_pbrSpecularGlossiness");
    let of = |older: &serde_json::Value| older["diffuseFactor"][3].as_f64().unwrap_or(1.0) as f32;
    older.map_or(wire.pbr_metallic_roughness.base_color_factor.0[3], of)
}

/// Returns true if the factor of alpha is 0 or less than the cutoff. If the factor is less than the cutoff, every point
/// of the surface would be a hole, whatever its texture is. raycl draws such a surface without holes, unless it is
/// blended and its factor is above 0 (see [`least_alpha`]).
fn is_hidden(wire: &Wire) -> bool {
    !(factor(wire) > 0.0 && factor(wire) >= cutoff(wire))
}

/// Returns the base colour in linear light, with channels from 0 to 1.
fn base_colour(wire: &Wire) -> Vec3 {
    stated_colour(wire).1.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Returns the key and the value of the base colour in the file. A material with the older extension
/// KHR_materials_pbrSpecularGlossiness has this colour under the key `diffuseFactor`.
fn stated_colour(wire: &Wire) -> (&'static str, Vec3) {
    if let Some(older) = extension(wire, "KHR_materials_pbrSpecularGlossiness") {
        let channel = |at: usize| older["diffuseFactor"][at].as_f64().unwrap_or(1.0) as f32;
        return ("diffuseFactor", Vec3::new(channel(0), channel(1), channel(2)));
    }
    let [red, green, blue, _] = wire.pbr_metallic_roughness.base_color_factor.0;
    ("baseColorFactor", Vec3::new(red, green, blue))
}

/// Returns the emitted light, in units of the radiance that the default display shows as white: the emissive
/// factor, with channels from 0 to 1, times the strength that the extension KHR_materials_emissive_strength
/// states. The strength is 1 without this extension, and at most `MAX_EMITTED`.
fn emitted(wire: &Wire) -> Vec3 {
    let factor = Vec3::from_array(wire.emissive_factor.0).clamp(Vec3::ZERO, Vec3::ONE);
    factor * stated_strength(wire).clamp(0.0, MAX_EMITTED)
}

fn stated_strength(wire: &Wire) -> f32 {
    let strength = extension(wire, "KHR_materials_emissive_strength");
    strength.and_then(|strength| strength["emissiveStrength"].as_f64()).unwrap_or(1.0) as f32
}

/// Returns true if a material emits light. An emissive texture is multiplied by `emissiveFactor`, which is 0
/// by default. If `emissiveFactor` is 0, the emissive texture has no effect.
pub(super) fn emits(wire: &Wire) -> bool {
    emitted(wire) != Vec3::ZERO
}

fn others(wire: &Wire) -> impl Iterator<Item = (&String, &serde_json::Value)> {
    let others = wire.extensions.as_ref().map(|Extensions { others, .. }| others.iter());
    others.into_iter().flatten()
}

pub(super) fn extension<'a>(wire: &'a Wire, name: &str) -> Option<&'a serde_json::Value> {
    others(wire).find(|(key, _)| *key == name).map(|(_, value)| value)
}

/// Counts a material's unsupported features.
fn asked(root: &Root, wire: &Wire) -> Asked {
    let mut asked = Asked::default();
    let pbr = &wire.pbr_metallic_roughness;
    let textures = [
        ("metallicRoughnessTexture", pbr.metallic_roughness_texture.is_some()),
        ("normalTexture", wire.normal_texture.is_some()),
        ("occlusionTexture", wire.occlusion_texture.is_some()),
    ];
    textures.iter().filter(|(_, has)| *has).for_each(|(name, _)| asked.add(Wish::Texture, name.as_bytes()));
    if let Some((wish, key)) = alpha_wish(wire) {
        asked.add(wish, key.as_bytes());
    }
    let (key, colour) = stated_colour(wire);
    let alpha = if uses_alpha(wire) { stated_alpha(wire) } else { 1.0 };
    if is_outside(&colour) || is_outside(&Vec3::splat(alpha)) {
        asked.add(Wish::Colour, key.as_bytes());
    }
    for option in unsupported_options(root, wire) {
        asked.add(Wish::TextureOption, option.as_bytes());
    }
    if is_outside(&Vec3::from_array(wire.emissive_factor.0)) {
        asked.add(Wish::Colour, b"emissiveFactor");
    }
    if emissive_is_apart(root, wire) {
        asked.add(Wish::EmissionPlace, b"emissiveTexture");
    }
    // In a material with one of these extensions, `metallicFactor` and `roughnessFactor` have no effect. A
    // material that does not state `metallicFactor` is metal.
    let replacing = ["KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit"];
    let is_replaced = replacing.iter().any(|name| extension(wire, name).is_some());
    if pbr.metallic_factor.0 > 0.0 && !is_replaced {
        asked.add(Wish::Metal, b"metallicFactor");
    }
    if pbr.roughness_factor.0 < 1.0 && !is_replaced {
        asked.add(Wish::Gloss, b"roughnessFactor");
    }
    let is_odd = |factor: f32| !is_replaced && is_outside(&Vec3::splat(factor));
    let limited = [
        (is_odd(pbr.metallic_factor.0), "metallicFactor"),
        (is_odd(pbr.roughness_factor.0), "roughnessFactor"),
        (wire.alpha_cutoff.is_some_and(|cutoff| cutoff.0 < 0.0) && uses_alpha(wire), "alphaCutoff"),
        (stated_strength(wire) > MAX_EMITTED, "emissiveStrength"),
    ];
    limited
        .iter()
        .filter(|(is_limited, _)| *is_limited)
        .for_each(|(_, key)| asked.add(Wish::Range, key.as_bytes()));
    for (name, values) in others(wire) {
        if let Some(wish) = extension_wish(name).filter(|_| !has_no_effect(name, values)) {
            asked.add(wish, name.as_bytes());
        }
    }
    asked
}

/// Corrects what blended materials with opaque textures ask for, once the textures were read. `maps` has the texture of
/// each material.
pub(super) fn correct_blending(
    root: &Root,
    maps: &[Option<ColourMap>],
    pictures: &[Texture],
    asked: &mut [Asked],
) {
    for ((wire, map), asked) in root.materials.iter().zip(maps).zip(asked) {
        let mask = map.and_then(|map| map.mask()).filter(|mask| pictures[*mask as usize].is_opaque());
        if mask.is_some() && wire.alpha_mode == Checked::Valid(AlphaMode::Blend) {
            asked.remove(Wish::Blending);
            if stated_alpha(wire) < 1.0 {
                asked.add(Wish::Transparency, b"alphaMode BLEND");
            }
        }
    }
}

/// Returns how many of the materials with the indices `used` ask for light on both sides of their surfaces.
pub(super) fn double_sided(root: &Root, used: &HashSet<usize>) -> usize {
    let asks = |index: &&usize| root.materials.get(**index).is_some_and(|wire| wire.double_sided);
    used.iter().filter(asks).count()
}

/// Returns the unsupported kind of transparency for which a material asks, and the words with which notes name
/// this kind; `None` if the material asks for none.
fn alpha_wish(wire: &Wire) -> Option<(Wish, &'static str)> {
    match (wire.alpha_mode, colour_texture(wire)) {
        (Checked::Valid(AlphaMode::Mask), _) if is_hidden(wire) => {
            Some((Wish::Transparency, "alphaMode MASK"))
        }
        (Checked::Valid(AlphaMode::Blend), Some(_)) if factor(wire) > 0.0 => {
            Some((Wish::Blending, "alphaMode BLEND"))
        }
        // An opaque surface is not blended. Notes on vertices count the alphas of vertices.
        (Checked::Valid(AlphaMode::Blend), None) if stated_alpha(wire) >= 1.0 => None,
        (Checked::Valid(AlphaMode::Blend), _) => Some((Wish::Transparency, "alphaMode BLEND")),
        (Checked::Invalid, _) => Some((Wish::UnknownAlpha, "alphaMode")),
        _ => None,
    }
}

/// Returns the unsupported feature for which an extension of a material asks; `None` if there is no note on the
/// extension, or if the note on unknown extensions names it.
pub(super) fn extension_wish(name: &str) -> Option<Wish> {
    match name.strip_prefix("KHR_materials_")? {
        "transmission" | "volume" | "volume_scatter" | "diffuse_transmission" | "dispersion" => {
            Some(Wish::Refraction)
        }
        "unlit" => Some(Wish::Unlit),
        "anisotropy"
        | "clearcoat"
        | "ior"
        | "iridescence"
        | "pbrSpecularGlossiness"
        | "sheen"
        | "specular" => Some(Wish::Shine),
        _ => None,
    }
}

fn is_black(colour: &serde_json::Value) -> bool {
    colour.as_array().is_some_and(|channels| channels.iter().all(|channel| channel.as_f64() == Some(0.0)))
}

/// Returns true if a material would look the same without this extension, because of the value of the extension's
/// factor. Without the factor, the default applies.
fn has_no_effect(extension: &str, values: &serde_json::Value) -> bool {
    let factor = |key: &str| values.get(key).map_or(Some(0.0), serde_json::Value::as_f64);
    match extension.strip_prefix("KHR_materials_").unwrap_or_default() {
        "transmission" => factor("transmissionFactor") == Some(0.0),
        "volume" => factor("thicknessFactor") == Some(0.0),
        "diffuse_transmission" => factor("diffuseTransmissionFactor") == Some(0.0),
        "dispersion" => factor("dispersion") == Some(0.0),
        "clearcoat" => factor("clearcoatFactor") == Some(0.0),
        "iridescence" => factor("iridescenceFactor") == Some(0.0),
        "anisotropy" => factor("anisotropyStrength") == Some(0.0),
        "sheen" => values.get("sheenColorFactor").is_none_or(is_black),
        // The index of refraction that all materials have without this extension.
        "ior" => values.get("ior").is_none_or(|index| index.as_f64() == Some(1.5)),
        _ => false,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_texel_is_a_hole_below_the_cutoff_divided_by_the_factor() {
        let of = |mode: &str, alpha: f32, cutoff: f32| {
            let factor = format!("\"pbrMetallicRoughness\": {{\"baseColorFactor\": [1, 1, 1, {alpha}]}}");
            let json = format!("{{\"alphaMode\": \"{mode}\", \"alphaCutoff\": {cutoff}, {factor}}}");
            let wire: Wire = serde_json::from_str(&json).unwrap();
            (least_alpha(&wire), is_hidden(&wire), uses_alpha(&wire))
        };
        assert_eq!(of("MASK", 0.5, 0.25), (0.5, false, true));
        assert_eq!(of("MASK", 0.25, 0.25), (1.0, false, true));
        assert_eq!(of("MASK", 0.25, 0.5), (0.0, true, true), "no texel reaches the cutoff");
        assert_eq!(of("MASK", 0.0, 0.0), (0.0, true, true));
        assert_eq!(of("BLEND", 1.0, 0.125), (0.5, false, true), "blending has no cutoff");
        assert_eq!(of("BLEND", 0.5, 0.125), (1.0, false, true));
        assert_eq!(of("BLEND", 0.25, 0.125), (0.5, true, true), "the texture keeps its shape");
        assert_eq!(of("BLEND", 0.0, 0.125), (0.0, true, true), "no point is visible");
        assert_eq!((of("OPAQUE", 0.5, 0.25).0, of("OPAQUE", 0.5, 0.25).2), (0.0, false));
    }

    #[test]
    fn values_that_are_replaced_are_noted() {
        let of = |json: &str| {
            let root: Root = serde_json::from_str(r#"{"asset": {"version": "2.0"}}"#).unwrap();
            let wire: Wire = serde_json::from_str(json).unwrap();
            let asked = asked(&root, &wire);
            let notes = asked.notes("material", true).filter(|note| !note.contains("(metallicFactor)"));
            (base_colour(&wire), notes.collect::<Vec<_>>())
        };
        let object = |key: &str, value: &str| format!("{{\"{key}\": {value}}}");
        let coloured = |colour: &str| object("pbrMetallicRoughness", &object("baseColorFactor", colour));
        for rounded in ["[1, 0, 0.5, 1]", "[1.0000001, -1e-9, 0.5, 1]"] {
            assert_eq!(of(&coloured(rounded)), (Vec3::new(1.0, 0.0, 0.5), Vec::new()), "{rounded}");
        }
        let expected = "1 material asks for a colour outside 0 to 1 (baseColorFactor), which raycl does not support: \
                        channels are limited to this range";
        let actual = of(&coloured("[2, -1, 0.5, 1]"));
        assert_eq!(actual, (Vec3::new(1.0, 0.0, 0.5), vec![expected.to_owned()]));
        let older = object("diffuseFactor", "[1e39, 0, 0.5, 1]");
        let (colour, notes) =
            of(&object("extensions", &object("KHR_materials_pbrSpecularGlossiness", &older)));
        assert_eq!(colour, Vec3::new(1.0, 0.0, 0.5));
        assert!(notes.iter().any(|note| note.contains(" (diffuseFactor), ")), "{notes:?}");
        let expected = "1 material asks for an unknown kind of transparency (alphaMode), which raycl does not support: \
                        the surface is opaque; expected OPAQUE, MASK or BLEND";
        assert_eq!(of(&object("alphaMode", "\"mask\"")).1, [expected]);
    }

    #[test]
    fn an_extension_without_effect_is_not_noted() {
        let asks = |name: &str, values: &str| {
            let root: Root = serde_json::from_str(r#"{"asset": {"version": "2.0"}}"#).unwrap();
            let json = format!("{{\"extensions\": {{\"KHR_materials_{name}\": {values}}}}}");
            let asked = asked(&root, &serde_json::from_str(&json).unwrap());
            asked.notes("material", true).any(|note| note.contains(&format!("KHR_materials_{name}")))
        };
        let factors = [
            ("transmission", "transmissionFactor"),
            ("volume", "thicknessFactor"),
            ("diffuse_transmission", "diffuseTransmissionFactor"),
            ("dispersion", "dispersion"),
            ("clearcoat", "clearcoatFactor"),
            ("iridescence", "iridescenceFactor"),
            ("anisotropy", "anisotropyStrength"),
        ];
        for (name, key) in factors {
            let with = |value: &str| asks(name, &format!("{{\"{key}\": {value}}}"));
            assert_eq!(
                [with("0"), with("0.0"), asks(name, "{}"), with("0.5")],
                [false, false, false, true],
                "{name}"
            );
        }
        let sheen = |colour: &str| asks("sheen", &format!("{{\"sheenColorFactor\": {colour}}}"));
        assert_eq!(
            [sheen("[0, 0, 0]"), sheen("[0.0, 0.0, 0.0]"), sheen("[0, 0.1, 0]")],
            [false, false, true]
        );
        let ior = |index: &str| asks("ior", &format!("{{\"ior\": {index}}}"));
        assert_eq!([ior("1.5"), ior("1.33")], [false, true]);
        assert!(asks("specular", "{}") && !asks("ior", "{}") && !asks("sheen", "{}"));
    }

    #[test]
    fn a_material_without_light_or_of_the_older_extension_asks_for_no_metal() {
        let notes = |extensions: &str| {
            let root: Root = serde_json::from_str(r#"{"asset": {"version": "2.0"}}"#).unwrap();
            let wire: Wire = serde_json::from_str(&format!("{{\"extensions\": {{{extensions}}}}}")).unwrap();
            asked(&root, &wire).notes("material", true).collect::<Vec<_>>().concat()
        };
        assert!(notes("").contains("(metallicFactor)"), "{}", notes(""));
        let unlit = notes("\"KHR_materials_unlit\": {}");
        assert!(unlit.contains("KHR_materials_unlit") && !unlit.contains("metal"), "{unlit}");
        let older = notes("\"KHR_materials_pbrSpecularGlossiness\": {}");
        assert!(!older.contains("metal"), "{older}");
    }
}
