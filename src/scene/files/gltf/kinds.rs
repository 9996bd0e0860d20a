//! The keys that glTF 2.0, and the extensions that raycl reads, define for each kind of object.

use super::node_extensions;
use crate::error::nearest;

/// A kind of object in the JSON. Besides its own keys, every object may have `extensions` and `extras`.
pub(super) struct Kind {
    /// The name of the kind in notes.
    pub name: &'static str,
    /// The keys of values that have no keys of their own, such as numbers.
    keys: &'static [&'static str],
    /// The keys of objects, and of lists of objects, with the kinds of these objects.
    parts: &'static [(&'static str, &'static Kind)],
    /// The extensions that raycl reads in objects of this kind, with the kinds of the extensions' own objects.
    extensions: &'static [(&'static str, &'static Kind)],
}

impl Kind {
    /// Returns true if objects of this kind may have this key. Some exporters also name objects that have no name in
    /// glTF; a name never changes the picture.
    pub fn has(&self, key: &str) -> bool {
        ["extensions", "extras", "name"].contains(&key)
            || self.keys.contains(&key)
            || self.part(key).is_some()
    }

    /// Returns the kind of the object, or of the objects in the list, under a key; `None` if glTF defines no such key.
    pub fn part(&self, key: &str) -> Option<&'static Self> {
        kind_under(self.parts, key)
    }

    /// Returns the kind of the object of an extension; `None` if raycl does not read this extension in objects of this
    /// kind.
    pub fn extension(&self, name: &str) -> Option<&'static Self> {
        kind_under(self.extensions, name)
    }

    /// Returns true if an extension belongs to objects of this kind. The function knows only extensions that raycl
    /// reads, extensions of materials, and the extensions of nodes that [`node_extensions`] knows. For other
    /// extensions, the result may be wrong.
    pub fn takes(&self, extension: &str) -> bool {
        let is_of_material = extension.starts_with("KHR_materials_") && std::ptr::eq(self, &MATERIAL);
        let is_of_node = node_extensions::are_noted(extension) && std::ptr::eq(self, &NODE);
        is_of_material || is_of_node || self.extension(extension).is_some()
    }

    /// Returns words, in brackets, on the key that an unknown key probably stands for: the same key of an object below,
    /// or the most similar key of this kind with the same first letter. Returns an empty text if there is no such key.
    pub fn meant(&self, unknown: &str) -> String {
        let mut below = self.parts.iter().chain(self.extensions);
        if let Some((part, _)) = below.find(|(_, part)| part.own().any(|key| key == unknown)) {
            return format!(" (a key of `{part}`)");
        }
        let first = |key: &str| key.chars().next().map(|letter| letter.to_ascii_lowercase());
        let own = self.own().filter(|key| first(key) == first(unknown));
        nearest(unknown, own).map_or(String::new(), |key| format!(" (did you mean `{key}`?)"))
    }

    /// Returns the keys of this kind, without those that every object may have.
    fn own(&self) -> impl Iterator<Item = &'static str> + use<> {
        self.keys.iter().copied().chain(self.parts.iter().map(|(key, _)| *key))
    }
}

fn kind_under(list: &[(&str, &'static Kind)], key: &str) -> Option<&'static Kind> {
    list.iter().find(|(known, _)| *known == key).map(|(_, kind)| *kind)
}

/// Returns a kind without extensions that raycl reads.
const fn kind(
    name: &'static str,
    keys: &'static [&'static str],
    parts: &'static [(&'static str, &'static Kind)],
) -> Kind {
    Kind { name, keys, parts, extensions: &[] }
}

/// The whole file.
pub(super) static FILE: Kind = Kind {
    name: "the file",
    keys: &["extensionsRequired", "extensionsUsed", "scene"],
    parts: &[
        ("accessors", &ACCESSOR),
        ("animations", &ANIMATION),
        ("asset", &ASSET),
        ("bufferViews", &BUFFER_VIEW),
        ("buffers", &BUFFER),
        ("cameras", &CAMERA),
        ("images", &IMAGE),
        ("materials", &MATERIAL),
        ("meshes", &MESH),
        ("nodes", &NODE),
        ("samplers", &SAMPLER),
        ("scenes", &SCENE),
        ("skins", &SKIN),
        ("textures", &TEXTURE),
    ],
    extensions: &[("KHR_lights_punctual", &LIGHTS)],
};
static ASSET: Kind = kind("asset", &["copyright", "generator", "minVersion", "version"], &[]);
static SCENE: Kind = kind("a scene", &["name", "nodes"], &[]);
static NODE: Kind = Kind {
    extensions: &[("KHR_lights_punctual", &LIGHT_OF_NODE)],
    ..kind(
        "a node",
        &[
            "camera",
            "children",
            "matrix",
            "mesh",
            "name",
            "rotation",
            "scale",
            "skin",
            "translation",
            "weights",
        ],
        &[],
    )
};
static LIGHT_OF_NODE: Kind = kind("KHR_lights_punctual", &["light"], &[]);
static LIGHTS: Kind = kind("KHR_lights_punctual", &[], &[("lights", &LIGHT)]);
static LIGHT: Kind = kind("a light", &["color", "intensity", "name", "range", "type"], &[("spot", &SPOT)]);
static SPOT: Kind = kind("a spot light", &["innerConeAngle", "outerConeAngle"], &[]);

static MESH: Kind = kind("a mesh", &["name", "weights"], &[("primitives", &PRIMITIVE)]);
/// The keys in `attributes` and `targets` are names of attributes.
static PRIMITIVE: Kind = kind("a primitive", &["attributes", "indices", "material", "mode", "targets"], &[]);
static SKIN: Kind = kind("a skin", &["inverseBindMatrices", "joints", "name", "skeleton"], &[]);

static MATERIAL: Kind = Kind {
    name: "a material",
    keys: &["alphaCutoff", "alphaMode", "doubleSided", "emissiveFactor", "name"],
    parts: &[
        ("emissiveTexture", &TEXTURE_INFO),
        ("normalTexture", &NORMAL_INFO),
        ("occlusionTexture", &OCCLUSION_INFO),
        ("pbrMetallicRoughness", &METAL),
    ],
    extensions: &[
        ("KHR_materials_emissive_strength", &STRENGTH),
        ("KHR_materials_pbrSpecularGlossiness", &GLOSS),
    ],
};
static METAL: Kind = kind(
    "pbrMetallicRoughness",
    &["baseColorFactor", "metallicFactor", "roughnessFactor"],
    &[("baseColorTexture", &TEXTURE_INFO), ("metallicRoughnessTexture", &TEXTURE_INFO)],
);
static STRENGTH: Kind = kind("KHR_materials_emissive_strength", &["emissiveStrength"], &[]);
static GLOSS: Kind = kind(
    "KHR_materials_pbrSpecularGlossiness",
    &["diffuseFactor", "glossinessFactor", "specularFactor"],
    &[("diffuseTexture", &TEXTURE_INFO), ("specularGlossinessTexture", &TEXTURE_INFO)],
);

const TRANSFORMED: &[(&str, &Kind)] = &[("KHR_texture_transform", &TRANSFORM)];
static TRANSFORM: Kind = kind("KHR_texture_transform", &["offset", "rotation", "scale", "texCoord"], &[]);
static TEXTURE_INFO: Kind =
    Kind { extensions: TRANSFORMED, ..kind("a texture of a material", &["index", "texCoord"], &[]) };
static NORMAL_INFO: Kind =
    Kind { extensions: TRANSFORMED, ..kind("normalTexture", &["index", "scale", "texCoord"], &[]) };
static OCCLUSION_INFO: Kind =
    Kind { extensions: TRANSFORMED, ..kind("occlusionTexture", &["index", "strength", "texCoord"], &[]) };
static TEXTURE: Kind = kind("a texture", &["name", "sampler", "source"], &[]);
static IMAGE: Kind = kind("an image", &["bufferView", "mimeType", "name", "uri"], &[]);
static SAMPLER: Kind = kind("a sampler", &["magFilter", "minFilter", "name", "wrapS", "wrapT"], &[]);

static ACCESSOR: Kind = kind(
    "an accessor",
    &["bufferView", "byteOffset", "componentType", "count", "max", "min", "name", "normalized", "type"],
    &[("sparse", &SPARSE)],
);
static SPARSE: Kind = kind("sparse", &["count"], &[("indices", &SPARSE_INDICES), ("values", &SPARSE_VALUES)]);
static SPARSE_INDICES: Kind = kind("sparse indices", &["bufferView", "byteOffset", "componentType"], &[]);
static SPARSE_VALUES: Kind = kind("sparse values", &["bufferView", "byteOffset"], &[]);
static BUFFER_VIEW: Kind =
    kind("a buffer view", &["buffer", "byteLength", "byteOffset", "byteStride", "name", "target"], &[]);
static BUFFER: Kind = kind("a buffer", &["byteLength", "name", "uri"], &[]);

static CAMERA: Kind =
    kind("a camera", &["name", "type"], &[("orthographic", &ORTHOGRAPHIC), ("perspective", &PERSPECTIVE)]);
static ORTHOGRAPHIC: Kind = kind("orthographic", &["xmag", "ymag", "zfar", "znear"], &[]);
static PERSPECTIVE: Kind = kind("perspective", &["aspectRatio", "yfov", "zfar", "znear"], &[]);

static ANIMATION: Kind =
    kind("an animation", &["name"], &[("channels", &CHANNEL), ("samplers", &ANIMATION_SAMPLER)]);
static CHANNEL: Kind = kind("a channel", &["sampler"], &[("target", &TARGET)]);
static TARGET: Kind = kind("the target of a channel", &["node", "path"], &[]);
static ANIMATION_SAMPLER: Kind =
    kind("a sampler of an animation", &["input", "interpolation", "output"], &[]);
