//! Types for the numbers of a scene file. These types refuse values out of range.

use crate::scene::material::{MAX_EMITTED, MAX_REFLECTANCE, MAX_SHININESS};
use crate::scene::validate::MAX_POWER;
use crate::words::counted;
use glam::{DVec3, Vec3};
use serde::de::{Deserialize, Deserializer, Error as _, SeqAccess, Unexpected, Visitor};
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
    /// The range of values that must not be negative.
    NonNegative: "a finite number of at least 0", |value| value >= 0.0, { "minimum": 0 };
    /// The range of the reflectances k_L and k_G.
    Reflectance: "a number from 0 to 1e6", |value| (0.0..=MAX_REFLECTANCE).contains(&value),
        { "minimum": 0, "maximum": MAX_REFLECTANCE };
    /// The range of the radiance that a surface emits.
    Emission: "a number from 0 to 1e6", |value| (0.0..=MAX_EMITTED).contains(&value),
        { "minimum": 0, "maximum": MAX_EMITTED };
    /// The range of s, the exponent of a highlight.
    Shininess: "a number from 0 to 1e6", |value| (0.0..=MAX_SHININESS).contains(&value),
        { "minimum": 0, "maximum": MAX_SHININESS };
    /// The range of the powers of lights, and of the radiances of the sky and the background.
    Power: "a number from 0 to 1e28", |value| (0.0..=MAX_POWER).contains(&value),
        { "minimum": 0, "maximum": 1e28 };
    /// The range of values that must be more than 0.
    Positive: "a finite number of more than 0", |value| value > 0.0, { "exclusiveMinimum": 0 };
    /// The range of scales, which must not be 0.
    NonZero: "a finite number other than 0", |value| value != 0.0, { "not": { "const": 0 } };
    /// The range of the angle of a camera above the horizon.
    Elevation: "an angle from -90 to 90 degrees", |value| (-90.0..=90.0).contains(&value),
        { "minimum": -90, "maximum": 90 };
    /// The range of crease angles, which are angles between the normals of two faces.
    Crease: "an angle from 0 to 180 degrees", |value| (0.0..=180.0).contains(&value),
        { "minimum": 0, "maximum": 180 };
    /// The range of fields of view. Angles near 0 and 180 degrees are refused, since the tangent of half such
    /// an angle is almost 0 or very large.
    Angle: "an angle between 0.001 and 179.99 degrees", |value| value > 1e-3 && value < 179.99,
        { "exclusiveMinimum": 0.001, "exclusiveMaximum": 179.99 };
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

/// Two edges of a rectangle.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Edges(pub [Vector; 2]);

/// A position of a scene file, in double precision. A scene that lies far from the file's origin, such as a map, gets
/// an origin of its own before its positions are rounded to single precision.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Position {
    /// The position in the file's coordinates.
    pub in_file: DVec3,
    /// The scene's origin in the file's coordinates; zero unless the scene lies far from the file's origin.
    pub origin: DVec3,
}

impl Position {
    /// Returns the position in the scene's coordinates.
    pub fn in_scene(&self) -> Vec3 {
        (self.in_file - self.origin).as_vec3()
    }
}

/// A whole number from `LEAST` to `MOST`.
#[derive(Clone, Copy)]
pub(in crate::scene) struct Whole<const LEAST: u32, const MOST: u32>(pub u32);

impl<'de, R: Range> Deserialize<'de> for Number<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Wide::<R>::deserialize(deserializer).map(|Wide(value, range)| Self(value as f32, range))
    }
}

impl<'de, R: Range> Deserialize<'de> for Triple<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let visitor = TripleVisitor::<R> { single: true, range: PhantomData };
        deserializer
            .deserialize_any(visitor)
            .map(|values| Self(values.map(|value| value as f32), PhantomData))
    }
}

impl<'de> Deserialize<'de> for Vector {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Position::deserialize(deserializer).map(|position| Self(position.in_scene().to_array()))
    }
}

impl<'de> Deserialize<'de> for Edges {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let edges = Vec::<Vector>::deserialize(deserializer)?;
        let wrong = |edges: Vec<Vector>| {
            let expected = "expected the two edges of a rectangle, [[x, y, z], [x, y, z]]";
            D::Error::custom(format!("{}; {expected}", counted(edges.len(), "edge")))
        };
        edges.try_into().map(Self).map_err(wrong)
    }
}

impl<'de> Deserialize<'de> for Position {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let visitor = TripleVisitor::<Finite> { single: false, range: PhantomData };
        let in_file = deserializer.deserialize_any(visitor).map(DVec3::from_array)?;
        Ok(Self { in_file, origin: DVec3::ZERO })
    }
}

impl<'de, const LEAST: u32, const MOST: u32> Deserialize<'de> for Whole<LEAST, MOST> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WholeVisitor::<LEAST, MOST>).map(Self)
    }
}

struct WholeVisitor<const LEAST: u32, const MOST: u32>;

impl<const LEAST: u32, const MOST: u32> Visitor<'_> for WholeVisitor<LEAST, MOST> {
    type Value = u32;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "a whole number from {LEAST} to {MOST}")
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<u32, E> {
        let whole = u32::try_from(value).ok().filter(|whole| (LEAST..=MOST).contains(whole));
        whole.ok_or_else(|| E::invalid_value(Unexpected::Signed(value), &self))
    }
}

/// A number from a file, in double precision. Rounded to single precision, the number is in the range `R`.
struct Wide<R>(f64, PhantomData<R>);

impl<'de, R: Range> Deserialize<'de> for Wide<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor::<R>(PhantomData)).map(|value| Self(value, PhantomData))
    }
}

fn checked<R: Range, E: serde::de::Error>(value: f64) -> Result<f64, E> {
    if R::contains(value as f32) { Ok(value) } else { Err(E::custom(refusal::<R>(value))) }
}

/// Returns the message for a number out of its range.
fn refusal<R: Range>(value: f64) -> String {
    let (narrow, shown, expected) = (value as f32, short(value), R::EXPECTED);
    if value.is_finite() && narrow.is_infinite() {
        return format!(
            "{shown} does not fit into single precision, whose range is about -3.4e38 to 3.4e38; expected {expected}"
        );
    }
    if value != 0.0 && narrow == 0.0 {
        return format!("{shown} rounds to 0 in single precision; expected {expected}");
    }
    format!("{shown} is not {expected}")
}

/// Returns a number as decimal text. The text has an exponent if it would otherwise have many zeros.
fn short(value: f64) -> String {
    let has_many_zeros = value != 0.0 && value.is_finite() && !(1e-5..1e16).contains(&value.abs());
    if has_many_zeros { format!("{value:e}") } else { value.to_string() }
}

struct NumberVisitor<R>(PhantomData<R>);

impl<R: Range> Visitor<'_> for NumberVisitor<R> {
    type Value = f64;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str(R::EXPECTED)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<f64, E> {
        checked::<R, E>(value)
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<f64, E> {
        checked::<R, E>(value as f64)
    }
}

/// Reads three numbers in a range or, with `single`, also a single number that sets all three.
pub(super) struct TripleVisitor<R> {
    pub single: bool,
    pub range: PhantomData<R>,
}

impl<'de, R: Range> Visitor<'de> for TripleVisitor<R> {
    type Value = [f64; 3];

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let single = if self.single { "a number or " } else { "" };
        write!(out, "{single}three numbers [x, y, z], each {}", R::EXPECTED)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<[f64; 3], E> {
        if self.single {
            return checked::<R, E>(value).map(|value| [value; 3]);
        }
        Err(E::invalid_type(serde::de::Unexpected::Float(value), &self))
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<[f64; 3], E> {
        if self.single {
            return checked::<R, E>(value as f64).map(|value| [value; 3]);
        }
        Err(E::invalid_type(serde::de::Unexpected::Signed(value), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<[f64; 3], A::Error> {
        let mut values = Vec::with_capacity(3);
        while let Some(Wide::<R>(value, _)) = sequence.next_element()? {
            values.push(value);
        }
        <[f64; 3]>::try_from(values).map_err(|values| A::Error::invalid_length(values.len(), &self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::de::DeserializeOwned;
    use std::collections::BTreeMap;

    #[test]
    fn numbers_beyond_single_precision_are_reported_with_the_range_that_fits() {
        let fits = "does not fit into single precision, whose range is about -3.4e38 to 3.4e38; expected";
        assert_eq!(refusal::<NonNegative>(1e39), format!("1e39 {fits} a finite number of at least 0"));
        assert_eq!(refusal::<Power>(-2e300), format!("-2e300 {fits} a number from 0 to 1e28"));
        assert_eq!(
            refusal::<Positive>(1e-50),
            "1e-50 rounds to 0 in single precision; expected a finite number of more than 0"
        );
    }

    #[test]
    fn whole_numbers_are_reported_with_their_own_range() {
        #[derive(serde::Deserialize)]
        struct File {
            frames: Whole<1, 1000>,
        }
        let read =
            |value: &str| toml::from_str::<File>(&format!("frames = {value}")).map(|file| file.frames.0);
        assert_eq!([read("1"), read("1000")].map(Result::ok), [Some(1), Some(1000)]);
        for (value, found) in [
            ("0", "invalid value: integer `0`"),
            ("1001", "invalid value: integer `1001`"),
            ("-4_294_967_295", "invalid value: integer `-4294967295`"),
            ("29.97", "invalid type: floating point `29.97`"),
        ] {
            let error = read(value).expect_err(value);
            assert_eq!(error.message(), format!("{found}, expected a whole number from 1 to 1000"));
        }
    }

    #[test]
    fn other_numbers_out_of_range_are_shown_as_they_are() {
        for (value, shown) in [(-1.5, "-1.5"), (f64::NAN, "NaN"), (f64::INFINITY, "inf"), (-1e20, "-1e20")] {
            assert_eq!(refusal::<Power>(value), format!("{shown} is not a number from 0 to 1e28"));
        }
        assert_eq!(
            ["0", "1234567.5", "1e16"],
            [0.0, 1_234_567.5, 1e16].map(short).each_ref().map(|s| s.as_str())
        );
        assert_eq!(refusal::<NonZero>(0.0), "0 is not a finite number other than 0");
    }

    #[test]
    fn a_single_number_is_expected_only_where_it_sets_all_three() {
        fn expected<T: DeserializeOwned>() -> String {
            let read = toml::from_str::<BTreeMap<String, T>>("key = true");
            read.err().map(|error| error.message().to_owned()).unwrap_or_default()
        }
        let (one_or_three, three) = (expected::<Triple<Power>>(), expected::<Vector>());
        let numbers = "three numbers [x, y, z], each ";
        assert!(one_or_three.contains(&format!(", expected a number or {numbers}")), "{one_or_three}");
        assert!(three.contains(&format!(", expected {numbers}")), "{three}");
    }
}
