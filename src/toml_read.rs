//! Reads TOML documents with serde. serde's derived code accepts a list of values in place of a table, in the
//! order of a struct's fields. In a file that a person writes, a list in place of a table is a mistake, so
//! the code in this file refuses such a list.

use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, EnumAccess, Error as _, MapAccess, SeqAccess,
    Unexpected, Visitor,
};
use std::fmt;
use toml::Spanned;
use toml::de::{DeTable, Error};

/// Parses the TOML document `text`, and converts it to a `T`.
///
/// # Errors
///
/// Returns an error with its location if the text is not TOML, or not a `T`.
pub fn from_text<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    T::deserialize(Strict(toml::Deserializer::parse(text)?))
}

/// Converts a parsed TOML document to a `T`.
///
/// # Errors
///
/// Returns an error with its location if the document is not a `T`.
pub fn from_table<T: DeserializeOwned>(table: Spanned<DeTable<'_>>) -> Result<T, Error> {
    T::deserialize(Strict(toml::Deserializer::from(table)))
}

/// Wraps a deserialiser of serde, or one of serde's readers of the inner values of a list or a table, so that a
/// list in place of a table is refused. The deserialisers of the values in lists and tables are wrapped, too.
struct Strict<T>(T);

impl<'de, D: Deserializer<'de>> Deserializer<'de> for Strict<D> {
    type Error = D::Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, D::Error> {
        self.0.deserialize_any(StrictVisitor { visitor, is_table: false })
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, D::Error> {
        self.0.deserialize_option(StrictVisitor { visitor, is_table: false })
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_newtype_struct(name, StrictVisitor { visitor, is_table: false })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_struct(name, fields, StrictVisitor { visitor, is_table: true })
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_enum(name, variants, StrictVisitor { visitor, is_table: false })
    }

    // A TOML value states its own type, so in the crate `toml`, each of the following methods does the same
    // as `deserialize_any`.
    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple
        tuple_struct map identifier ignored_any
    }
}

struct StrictVisitor<V> {
    visitor: V,
    /// True if serde's code expects a struct, for which a file must have a table.
    is_table: bool,
}

/// Passes a value that has no inner values to the wrapped visitor (the object that receives values from serde).
macro_rules! passes_on {
    ($($visit:ident $value:ty),*) => {$(
        fn $visit<E: serde::de::Error>(self, value: $value) -> Result<V::Value, E> {
            self.visitor.$visit(value)
        }
    )*};
}

impl<'de, V: Visitor<'de>> Visitor<'de> for StrictVisitor<V> {
    type Value = V::Value;

    passes_on!(visit_bool bool, visit_i64 i64, visit_u64 u64, visit_f64 f64, visit_str &str);

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.visitor.expecting(out)
    }

    fn visit_some<D: Deserializer<'de>>(self, value: D) -> Result<V::Value, D::Error> {
        self.visitor.visit_some(Strict(value))
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, value: D) -> Result<V::Value, D::Error> {
        self.visitor.visit_newtype_struct(Strict(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<V::Value, A::Error> {
        match self.is_table {
            true => Err(A::Error::invalid_type(Unexpected::Seq, &self)),
            false => self.visitor.visit_seq(Strict(list)),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<V::Value, A::Error> {
        self.visitor.visit_map(Strict(table))
    }

    // In raycl's files, all values that serde reads by this method are words without inner values. The method therefore
    // has nothing to wrap in `Strict`.
    fn visit_enum<A: EnumAccess<'de>>(self, value: A) -> Result<V::Value, A::Error> {
        self.visitor.visit_enum(value)
    }
}

impl<'de, A: SeqAccess<'de>> SeqAccess<'de> for Strict<A> {
    type Error = A::Error;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, A::Error> {
        self.0.next_element_seed(Strict(seed))
    }

    fn size_hint(&self) -> Option<usize> {
        self.0.size_hint()
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Strict<A> {
    type Error = A::Error;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, A::Error> {
        self.0.next_key_seed(seed)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, A::Error> {
        self.0.next_value_seed(Strict(seed))
    }

    fn size_hint(&self) -> Option<usize> {
        self.0.size_hint()
    }
}

impl<'de, S: DeserializeSeed<'de>> DeserializeSeed<'de> for Strict<S> {
    type Value = S::Value;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<S::Value, D::Error> {
        self.0.deserialize(Strict(value))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use serde::Deserialize;
    use std::collections::BTreeMap;
    use toml::Value;

    #[derive(Debug, Default, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    struct Inner {
        number: i64,
        pair: [f64; 2],
    }

    #[derive(Debug, Default, PartialEq, Deserialize)]
    #[serde(default)]
    struct Outer {
        plain: Inner,
        may_be: Option<Inner>,
        spanned: Option<Spanned<Inner>>,
        list: Vec<Spanned<Inner>>,
        named: BTreeMap<Spanned<String>, Inner>,
        any: Option<Value>,
        colour: Option<crate::cli::colour::Colour>,
    }

    #[test]
    fn a_list_in_place_of_a_table_is_refused_at_its_position() {
        for text in
            ["plain = L", "may_be = L", "spanned = L", "list = [{}, L]", "named = { a = L }", "plain = []"]
        {
            let text = text.replace('L', "[3, [1.0, 2.0]]");
            let error = from_text::<Outer>(&text).unwrap_err();
            assert_eq!(error.message(), "invalid type: sequence, expected struct Inner", "{text}");
            let span = error.span().unwrap();
            assert!(["[3, [1.0, 2.0]]", "[]"].contains(&&text[span]), "{text}");
            let table = DeTable::parse(&text).unwrap();
            assert_eq!(from_table::<Outer>(table).unwrap_err().span(), error.span(), "{text}");
        }
    }

    #[test]
    fn everything_else_is_read_as_the_crate_toml_reads_it() {
        let text = "plain = { number = 3, pair = [1, 2.5] }\nmay_be = { number = -4 }\nspanned = { number = 5 }\n\
            list = [{ number = 6 }, {}]\nnamed = { a = { pair = [0.5, 7] } }\ncolour = \"never\"\n\
            any = [1, [true, \"a\"], { b = 1979-05-27T07:32:00Z, c = nan }]\n";
        let (ours, theirs): (Outer, Outer) = (from_text(text).unwrap(), toml::from_str(text).unwrap());
        // NaN is not equal to itself, so the texts are compared.
        assert_eq!(format!("{ours:?}"), format!("{theirs:?}"));
        assert_eq!(ours.list[0].span(), theirs.list[0].span());
        for wrong in [
            "plain = 3",
            "plain = { nmber = 3 }",
            "list = 3",
            "any = ",
            "plain = { pair = [1] }",
            "colour = 3",
        ] {
            let [ours, theirs] = [from_text::<Outer>(wrong), toml::from_str(wrong)].map(Result::unwrap_err);
            assert_eq!((ours.message(), ours.span()), (theirs.message(), theirs.span()), "{wrong}");
        }
    }
}
