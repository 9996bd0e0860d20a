//! The scene file as TOML has it. Its number types refuse what is out of range, so
//! that `toml` points at the place.

use super::material::{MAX_REFLECTANCE, MAX_SHININESS};
use super::validate::MAX_POWER;
use serde::de::{Deserialize, Deserializer, Error as _, SeqAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;
use toml::Spanned;

/// A whole scene file.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneWire {
    pub name: Option<String>,
    #[serde(default)]
    pub camera: CameraWire,
    #[serde(default)]
    pub object: Vec<Spanned<ObjectWire>>,
    pub light: Option<Vec<LightWire>>,
    pub background: Option<BackgroundWire>,
    pub two_sided: Option<bool>,
    pub textures: Option<bool>,
    pub crease: Option<Number<Crease>>,
    pub shadow_bias: Option<Number<NonNegative>>,
    #[serde(default)]
    pub display: DisplayWire,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraWire {
    pub position: Option<Spanned<Vector>>,
    pub look_at: Option<Spanned<Vector>>,
    pub up: Option<Spanned<Vector>>,
    pub fov_x_degrees: Option<Spanned<Number<Angle>>>,
    pub fov_y_degrees: Option<Spanned<Number<Angle>>>,
    pub z_near: Option<Number<NonNegative>>,
    pub azimuth_degrees: Option<Number<Finite>>,
    pub elevation_degrees: Option<Number<Elevation>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectWire {
    #[serde(alias = "mesh")]
    pub obj: Option<Spanned<String>>,
    pub shape: Option<Spanned<String>>,
    pub triangles: Option<Spanned<u32>>,
    pub fineness: Option<Spanned<u32>>,
    pub seed: Option<Spanned<u32>>,
    pub vertices: Option<Spanned<Vec<Vector>>>,
    pub faces: Option<Spanned<Vec<Spanned<Vec<u32>>>>>,
    pub normals: Option<Spanned<Vec<Vector>>>,
    pub face_normals: Option<Spanned<Vec<Spanned<Vec<u32>>>>>,
    pub scale: Option<Triple<NonZero>>,
    pub rotation: Option<Vector>,
    pub translation: Option<Vector>,
    #[serde(default)]
    pub flat: bool,
    pub crease: Option<Spanned<Number<Crease>>>,
    pub material: Option<MaterialWire>,
    pub outside_materials: Option<Spanned<bool>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialWire {
    pub k_l: Option<Triple<Reflectance>>,
    pub k_g: Option<Triple<Reflectance>>,
    pub shininess: Option<Number<Shininess>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LightWire {
    pub position: Spanned<Vector>,
    pub power: Spanned<Triple<Power>>,
    pub radius: Option<Number<NonNegative>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DisplayWire {
    pub exposure: Option<Number<NonNegative>>,
    pub gamma: Option<Number<Positive>>,
}

/// A range of numbers, and its name in messages.
pub(super) trait Range {
    const EXPECTED: &'static str;
    fn contains(value: f32) -> bool;
}

macro_rules! ranges {
    ($($(#[$doc:meta])* $name:ident: $expected:literal, $holds:expr;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(super) struct $name;
        impl Range for $name {
            const EXPECTED: &'static str = $expected;
            fn contains(value: f32) -> bool {
                let holds: fn(f32) -> bool = $holds;
                value.is_finite() && holds(value)
            }
        }
    )*};
}

ranges! {
    /// Any that f32 holds.
    Finite: "a finite number", |_| true;
    /// For what has no sign.
    NonNegative: "a finite number of at least 0", |value| value >= 0.0;
    /// For k_L and k_G.
    Reflectance: "a number from 0 to 1e6", |value| (0.0..=MAX_REFLECTANCE).contains(&value);
    /// For s.
    Shininess: "a number from 0 to 1e6", |value| (0.0..=MAX_SHININESS).contains(&value);
    /// For lights.
    Power: "a number from 0 to 1e28", |value| (0.0..=MAX_POWER).contains(&value);
    /// For divisors.
    Positive: "a finite number of more than 0", |value| value > 0.0;
    /// For scales.
    NonZero: "a finite number other than 0", |value| value != 0.0;
    /// For how high a camera stands.
    Elevation: "degrees from -90 to 90", |value| (-90.0..=90.0).contains(&value);
    /// For angles between faces.
    Crease: "degrees from 0 to 180", |value| (0.0..=180.0).contains(&value);
    /// For fields of view; near the ends their tangent leaves f32.
    Angle: "degrees between 0 and 180", |value| value > 1e-3 && value < 179.99;
}

/// Radiance, or a colour as displays have it.
#[derive(Clone, Copy)]
pub(super) enum BackgroundWire {
    Radiance([f32; 3]),
    /// Red, green and blue of 255.
    Displayed([u8; 3]),
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
        out.write_str("a display colour such as \"#203040\", or radiance: ")?;
        self.0.expecting(out)
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<BackgroundWire, E> {
        let wrong = || E::custom(format!("{text:?} is not a display colour such as \"#203040\""));
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

/// `#203040`, `#234`, `black` or `white`.
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

/// Three numbers in a range; one number stands for three of it.
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
