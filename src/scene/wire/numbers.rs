//! Types for the numbers of a scene file. These types refuse values out of range.

use crate::scene::material::{MAX_REFLECTANCE, MAX_SHININESS};
use crate::scene::validate::MAX_POWER;
use serde::de::{Deserialize, Deserializer, Error as _, SeqAccess, Visitor};
use serde_json::{Value, json};
use std::fmt;
use std::marker::PhantomData;

/// A range of numbers, and its name in messages.
pub(in crate::scene) trait Range {
    const EXPECTED: &'static str;
    fn contains(value: f32) -> bool;
    /// Returns the ends of the range for a JSON schema.
    fn bounds() -> Value;
}

macro_rules! ranges {
    ($($(#[$doc:meta])* $name:ident: $expected:literal, $holds:expr, $bounds:tt;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(in crate::scene) struct $name;
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
    /// For values that must not be negative.
    NonNegative: "a finite number of at least 0", |value| value >= 0.0, { "minimum": 0 };
    /// For k_L and k_G.
    Reflectance: "a number from 0 to 1e6", |value| (0.0..=MAX_REFLECTANCE).contains(&value),
        { "minimum": 0, "maximum": MAX_REFLECTANCE };
    /// For s, the exponent of a highlight.
    Shininess: "a number from 0 to 1e6", |value| (0.0..=MAX_SHININESS).contains(&value),
        { "minimum": 0, "maximum": MAX_SHININESS };
    /// For lights and the sky.
    Power: "a number from 0 to 1e28", |value| (0.0..=MAX_POWER).contains(&value),
        { "minimum": 0, "maximum": 1e28 };
    /// For divisors.
    Positive: "a finite number of more than 0", |value| value > 0.0, { "exclusiveMinimum": 0 };
    /// For scales.
    NonZero: "a finite number other than 0", |value| value != 0.0, { "not": { "const": 0 } };
    /// For the angle of a camera above the horizon.
    Elevation: "degrees from -90 to 90", |value| (-90.0..=90.0).contains(&value),
        { "minimum": -90, "maximum": 90 };
    /// For angles between faces.
    Crease: "degrees from 0 to 180", |value| (0.0..=180.0).contains(&value),
        { "minimum": 0, "maximum": 180 };
    /// For fields of view. Angles of at most 0.001 degrees or at least 179.99 degrees are refused too, since the
    /// tangent of half the angle is almost 0 or very large.
    Angle: "degrees between 0 and 180", |value| value > 1e-3 && value < 179.99,
        { "exclusiveMinimum": 0, "exclusiveMaximum": 180 };
}

/// A number in a range.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Number<R>(pub f32, PhantomData<R>);

/// Three numbers in a range; a single number sets all three.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Triple<R>(pub [f32; 3], PhantomData<R>);

/// Three finite numbers.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Vector(pub [f32; 3]);

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

/// Reads three numbers in a range or, with `single`, also a single number that sets all three.
pub(super) struct TripleVisitor<R> {
    pub single: bool,
    pub range: PhantomData<R>,
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
