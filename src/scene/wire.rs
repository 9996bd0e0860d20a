//! The types that a scene file's TOML is read into. The number types refuse values out of range, so that
//! `toml` reports the location.

use super::animation::AnimationWire;
use super::material::{MAX_REFLECTANCE, MAX_SHININESS};
use super::schema::{ShapeName, both_names_of_mesh};
use super::shapes::{MAX_FINENESS, MAX_TRIANGLES};
use super::validate::MAX_POWER;
use schemars::JsonSchema;
use serde::de::{Deserialize, Deserializer, Error as _, SeqAccess, Visitor};
use serde_json::{Value, json};
use std::fmt;
use std::marker::PhantomData;
use toml::Spanned;

/// A scene: objects, lights and a camera.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneWire {
    /// The scene's name in records and reports [default: the file's].
    pub name: Option<String>,
    /// A pinhole camera [default: the paper's, at the origin, looking along -z].
    #[serde(default)]
    pub camera: CameraWire,
    /// Meshes, generated shapes, and inline triangles; at least one.
    #[serde(default)]
    #[schemars(with = "Vec<ObjectWire>")]
    pub object: Vec<Spanned<ObjectWire>>,
    /// Point lights [default: none, so that everything hit is black].
    pub light: Option<Vec<LightWire>>,
    /// Light from all directions, unless something occludes it [default: none].
    #[schemars(with = "Option<SkyWire>")]
    pub sky: Option<Spanned<SkyWire>>,
    /// Radiance of a ray that hits nothing, one number or three, a display colour such as "#204060", or "transparent".
    pub background: Option<BackgroundWire>,
    /// Reverse the normals of triangles that face away from the camera, so that they are lit from the front
    /// [default: false].
    pub two_sided: Option<bool>,
    /// Use the colour textures of meshes [default: true].
    pub textures: Option<bool>,
    /// Distant textures are mixed from smaller versions of their pictures, instead of the full ones [default: true].
    pub mip_levels: Option<bool>,
    /// Degrees: edges of meshes without normals stay sharp if their faces meet at a larger angle [default:
    /// all are smooth].
    pub crease: Option<Number<Crease>>,
    /// The distance from its surface at which a shadow ray starts [default: 1e-4 of the diagonal of the scene's box].
    pub shadow_bias: Option<Number<NonNegative>>,
    /// How radiance is converted to 8-bit colours.
    #[serde(default)]
    pub display: DisplayWire,
    /// Values that change from frame to frame [default: none].
    pub animation: Option<AnimationWire>,
}

/// A pinhole camera.
#[derive(Default, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraWire {
    /// The eye [default: the origin].
    #[schemars(with = "Option<Vector>")]
    pub position: Option<Spanned<Vector>>,
    /// The point in the middle of the picture [default: position + [0, 0, -1]].
    #[schemars(with = "Option<Vector>")]
    pub look_at: Option<Spanned<Vector>>,
    /// The direction that points up in the picture [default: [0, 1, 0]].
    #[schemars(with = "Option<Vector>")]
    pub up: Option<Spanned<Vector>>,
    /// Field of view across the width [default: 90].
    #[schemars(with = "Option<Number<Angle>>")]
    pub fov_x_degrees: Option<Spanned<Number<Angle>>>,
    /// Field of view across the height, instead of fov_x_degrees.
    #[schemars(with = "Option<Number<Angle>>")]
    pub fov_y_degrees: Option<Spanned<Number<Angle>>>,
    /// Hits whose depth along the view is not larger than this are ignored [default: 0].
    pub z_near: Option<Number<NonNegative>>,
    /// See the whole scene from this direction: degrees to the right of its front.
    pub azimuth_degrees: Option<Number<Finite>>,
    /// See the whole scene from this height: degrees above the horizon.
    pub elevation_degrees: Option<Number<Elevation>>,
}

/// A mesh file, a generated shape, or inline triangles; scaled, rotated, then translated.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = both_names_of_mesh)]
pub(super) struct ObjectWire {
    /// A mesh: OBJ, PLY, STL, glTF or GLB, also as .gz; relative to this file.
    #[serde(alias = "mesh")]
    #[schemars(with = "Option<String>")]
    pub obj: Option<Spanned<String>>,
    /// A generated shape.
    #[schemars(with = "Option<ShapeName>")]
    pub shape: Option<Spanned<String>>,
    /// With a shape: the target number of triangles.
    #[schemars(with = "Option<u32>", range(min = 1, max = MAX_TRIANGLES))]
    pub triangles: Option<Spanned<u32>>,
    /// With the teapot: quads along the side of each of its 32 patches.
    #[schemars(with = "Option<u32>", range(min = 1, max = MAX_FINENESS))]
    pub fineness: Option<Spanned<u32>>,
    /// With the terrain: the seed for the shape of the hills.
    #[schemars(with = "Option<u32>")]
    pub seed: Option<Spanned<u32>>,
    /// Points of inline triangles.
    #[schemars(with = "Option<Vec<Vector>>")]
    pub vertices: Option<Spanned<Vec<Vector>>>,
    /// Corners of each face: indices in `vertices`, from 0; a face with more than three is a polygon.
    #[schemars(with = "Option<Vec<Vec<u32>>>")]
    pub faces: Option<Spanned<Vec<Spanned<Vec<u32>>>>>,
    /// Normals; without `face_normals`, one per vertex.
    #[schemars(with = "Option<Vec<Vector>>")]
    pub normals: Option<Spanned<Vec<Vector>>>,
    /// For each corner of each face: the index of its normal, from 0.
    #[schemars(with = "Option<Vec<Vec<u32>>>")]
    pub face_normals: Option<Spanned<Vec<Spanned<Vec<u32>>>>>,
    /// Scale along the object's own axes, applied first; negative mirrors [default: 1].
    pub scale: Option<Triple<NonZero>>,
    /// Rotation in degrees about x, then y, then z, applied second.
    pub rotation: Option<Vector>,
    /// Translation, applied last.
    pub translation: Option<Vector>,
    /// Give every triangle its own normal, so that facets are visible [default: false].
    #[serde(default)]
    pub flat: bool,
    /// With a mesh or vertices: like the scene's key, for this object.
    #[schemars(with = "Option<Number<Crease>>")]
    pub crease: Option<Spanned<Number<Crease>>>,
    /// Replaces these values in every material of the object.
    pub material: Option<MaterialWire>,
    /// With a mesh: also read MTL files and glTF buffers outside of its folder [default: false].
    #[schemars(with = "Option<bool>")]
    pub outside_materials: Option<Spanned<bool>>,
}

/// The material of a surface.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialWire {
    /// The diffuse reflectance, one number or three [default: 0.8].
    pub k_l: Option<Triple<Reflectance>>,
    /// The highlight's strength, one number or three [default: none; 0.2 with shininess].
    pub k_g: Option<Triple<Reflectance>>,
    /// The highlight's exponent [default: none; 100 with k_g].
    pub shininess: Option<Number<Shininess>>,
}

/// A point light: a surface at distance r receives power / (4 pi r^2).
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LightWire {
    /// Its position.
    #[schemars(with = "Vector")]
    pub position: Spanned<Vector>,
    /// Its power: one number is white, three are red, green and blue.
    #[schemars(with = "Triple<Power>")]
    pub power: Spanned<Triple<Power>>,
    /// The radius of a ball that replaces the point if there are several samples per pixel [default: 0, a
    /// point].
    pub radius: Option<Number<NonNegative>>,
}

/// Light from all directions: a horizontal surface under the whole sky, with a k_L of 1, has the sky's
/// radiance.
#[derive(serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SkyWire {
    /// Radiance from directly above: one number is white, three are red, green and blue [needed without a picture].
    pub zenith: Option<Triple<Power>>,
    /// Radiance from the horizon and below [default: the zenith's].
    pub horizon: Option<Triple<Power>>,
    /// A picture of all directions, instead of zenith and horizon: a Radiance HDR or an OpenEXR, relative to this
    /// file.
    #[schemars(with = "Option<String>")]
    pub picture: Option<Spanned<String>>,
    /// The factor of the picture's radiance [default: 1].
    pub strength: Option<Number<NonNegative>>,
    /// Degrees by which the picture is turned around the zenith, counter-clockwise from above [default: 0].
    pub turn_degrees: Option<Number<Finite>>,
    /// Surfaces farther away than this do not occlude the sky [default: all occlude it].
    pub reach: Option<Number<Positive>>,
}

/// How radiance is converted to 8-bit colours: 255 * clamp(exposure * L, 0, 1)^(1 / gamma).
#[derive(Default, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DisplayWire {
    /// The factor before the exponent is applied [default: 15].
    pub exposure: Option<Number<NonNegative>>,
    /// The inverse of the exponent [default: 2.2].
    pub gamma: Option<Number<Positive>>,
}

/// A range of numbers, and its name in messages.
pub(super) trait Range {
    const EXPECTED: &'static str;
    fn contains(value: f32) -> bool;
    /// Returns its ends for a JSON schema.
    fn bounds() -> Value;
}

macro_rules! ranges {
    ($($(#[$doc:meta])* $name:ident: $expected:literal, $holds:expr, $bounds:tt;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(super) struct $name;
        impl Range for $name {
            const EXPECTED: &'static str = $expected;
            fn contains(value: f32) -> bool {
                let holds: fn(f32) -> bool = $holds;
                value.is_finite() && holds(value)
            }
            fn bounds() -> Value {
                json!($bounds)
            }
        }
    )*};
}

ranges! {
    /// Any f32 that is finite.
    Finite: "a finite number", |_| true, {};
    /// For values without a sign.
    NonNegative: "a finite number of at least 0", |value| value >= 0.0, { "minimum": 0 };
    /// For k_L and k_G.
    Reflectance: "a number from 0 to 1e6", |value| (0.0..=MAX_REFLECTANCE).contains(&value),
        { "minimum": 0, "maximum": MAX_REFLECTANCE };
    /// For s.
    Shininess: "a number from 0 to 1e6", |value| (0.0..=MAX_SHININESS).contains(&value),
        { "minimum": 0, "maximum": MAX_SHININESS };
    /// For lights and the sky.
    Power: "a number from 0 to 1e28", |value| (0.0..=MAX_POWER).contains(&value),
        { "minimum": 0, "maximum": 1e28 };
    /// For divisors.
    Positive: "a finite number of more than 0", |value| value > 0.0, { "exclusiveMinimum": 0 };
    /// For scales.
    NonZero: "a finite number other than 0", |value| value != 0.0, { "not": { "const": 0 } };
    /// For the height of a camera.
    Elevation: "degrees from -90 to 90", |value| (-90.0..=90.0).contains(&value),
        { "minimum": -90, "maximum": 90 };
    /// For angles between faces.
    Crease: "degrees from 0 to 180", |value| (0.0..=180.0).contains(&value),
        { "minimum": 0, "maximum": 180 };
    /// For fields of view; near the ends their tangent exceeds f32.
    Angle: "degrees between 0 and 180", |value| value > 1e-3 && value < 179.99,
        { "exclusiveMinimum": 0, "exclusiveMaximum": 180 };
}

impl SceneWire {
    /// Returns whether pictures of the scene have an alpha channel.
    pub(super) fn is_transparent(&self) -> bool {
        matches!(self.background, Some(BackgroundWire::Transparent))
    }
}

/// Radiance, or a displayed colour.
#[derive(Clone, Copy)]
pub(super) enum BackgroundWire {
    Radiance([f32; 3]),
    /// Red, green and blue from 0 to 255.
    Displayed([u8; 3]),
    /// None: pictures have an alpha channel.
    Transparent,
}

impl<'de> Deserialize<'de> for BackgroundWire {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let visitor = TripleVisitor::<NonNegative> { single: true, range: PhantomData };
        deserializer.deserialize_any(BackgroundVisitor(visitor))
    }
}

struct BackgroundVisitor(TripleVisitor<NonNegative>);

impl<'de> Visitor<'de> for BackgroundVisitor {
    type Value = BackgroundWire;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str("a display colour such as \"#203040\", \"transparent\", or radiance: ")?;
        self.0.expecting(out)
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<BackgroundWire, E> {
        if text == "transparent" {
            return Ok(BackgroundWire::Transparent);
        }
        let wrong = || {
            E::custom(format!("{text:?} is neither a display colour such as \"#203040\" nor \"transparent\""))
        };
        displayed(text).map(BackgroundWire::Displayed).ok_or_else(wrong)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<BackgroundWire, E> {
        self.0.visit_f64(value).map(BackgroundWire::Radiance)
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<BackgroundWire, E> {
        self.0.visit_i64(value).map(BackgroundWire::Radiance)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<BackgroundWire, A::Error> {
        self.0.visit_seq(sequence).map(BackgroundWire::Radiance)
    }
}

/// Parses `#203040`, `#234`, `black` or `white`.
fn displayed(text: &str) -> Option<[u8; 3]> {
    match text {
        "black" => return Some([0; 3]),
        "white" => return Some([255; 3]),
        _ => {}
    }
    let digits = text.strip_prefix('#').filter(|digits| digits.is_ascii())?;
    let channel = |part: &str| u8::from_str_radix(part, 16).ok();
    match digits.len() {
        6 => Some([channel(&digits[..2])?, channel(&digits[2..4])?, channel(&digits[4..])?]),
        3 => Some([channel(&digits[..1])? * 17, channel(&digits[1..2])? * 17, channel(&digits[2..])? * 17]),
        _ => None,
    }
}

/// A number in a range.
#[derive(Clone, Copy)]
pub(super) struct Number<R>(pub f32, PhantomData<R>);

/// Three numbers in a range; a single number stands for all three.
#[derive(Clone, Copy)]
pub(super) struct Triple<R>(pub [f32; 3], PhantomData<R>);

/// Three finite numbers.
#[derive(Clone, Copy)]
pub(super) struct Vector(pub [f32; 3]);

impl<'de, R: Range> Deserialize<'de> for Number<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor::<R>(PhantomData)).map(|value| Self(value, PhantomData))
    }
}

impl<'de, R: Range> Deserialize<'de> for Triple<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let visitor = TripleVisitor::<R> { single: true, range: PhantomData };
        deserializer.deserialize_any(visitor).map(|values| Self(values, PhantomData))
    }
}

impl<'de> Deserialize<'de> for Vector {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let visitor = TripleVisitor::<Finite> { single: false, range: PhantomData };
        deserializer.deserialize_any(visitor).map(Self)
    }
}

fn checked<R: Range, E: serde::de::Error>(value: f64) -> Result<f32, E> {
    let narrow = value as f32;
    if R::contains(narrow) { Ok(narrow) } else { Err(E::custom(format!("{value} is not {}", R::EXPECTED))) }
}

struct NumberVisitor<R>(PhantomData<R>);

impl<R: Range> Visitor<'_> for NumberVisitor<R> {
    type Value = f32;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str(R::EXPECTED)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<f32, E> {
        checked::<R, E>(value)
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<f32, E> {
        checked::<R, E>(value as f64)
    }
}

struct TripleVisitor<R> {
    single: bool,
    range: PhantomData<R>,
}

impl<'de, R: Range> Visitor<'de> for TripleVisitor<R> {
    type Value = [f32; 3];

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let single = if self.single { "a number or " } else { "" };
        write!(out, "{single}three numbers [x, y, z], each {}", R::EXPECTED)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<[f32; 3], E> {
        if self.single {
            return checked::<R, E>(value).map(|value| [value; 3]);
        }
        Err(E::invalid_type(serde::de::Unexpected::Float(value), &self))
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<[f32; 3], E> {
        if self.single {
            return checked::<R, E>(value as f64).map(|value| [value; 3]);
        }
        Err(E::invalid_type(serde::de::Unexpected::Signed(value), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<[f32; 3], A::Error> {
        let mut values = Vec::with_capacity(3);
        while let Some(Number::<R>(value, _)) = sequence.next_element()? {
            values.push(value);
        }
        <[f32; 3]>::try_from(values).map_err(|values| A::Error::invalid_length(values.len(), &self))
    }
}
