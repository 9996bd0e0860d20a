//! The background of a scene file: radiance, a displayed colour, or none.

use super::numbers::{Power, TripleVisitor};
use serde::de::{Deserialize, Deserializer, SeqAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// Radiance, a displayed colour, or no background.
#[derive(Clone, Copy)]
pub(in crate::scene) enum BackgroundWire {
    Radiance([f32; 3]),
    /// Red, green and blue from 0 to 255.
    Displayed([u8; 3]),
    /// No background: pictures have an alpha channel.
    Transparent,
}

impl<'de> Deserialize<'de> for BackgroundWire {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let visitor = TripleVisitor::<Power> { single: true, range: PhantomData };
        deserializer.deserialize_any(BackgroundVisitor(visitor))
    }
}

fn radiance(channels: [f64; 3]) -> BackgroundWire {
    BackgroundWire::Radiance(channels.map(|channel| channel as f32))
}

struct BackgroundVisitor(TripleVisitor<Power>);

impl<'de> Visitor<'de> for BackgroundVisitor {
    type Value = BackgroundWire;

    fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.write_str("a display colour such as \"#203040\" or \"black\", \"transparent\", or radiance: ")?;
        self.0.expecting(out)
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<BackgroundWire, E> {
        if text == "transparent" {
            return Ok(BackgroundWire::Transparent);
        }
        let wrong = || {
            let others = "\"black\", \"white\" or \"transparent\"";
            E::custom(format!("{text:?} is neither a display colour such as \"#203040\" nor {others}"))
        };
        displayed(text).map(BackgroundWire::Displayed).ok_or_else(wrong)
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<BackgroundWire, E> {
        self.0.visit_f64(value).map(radiance)
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<BackgroundWire, E> {
        self.0.visit_i64(value).map(radiance)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<BackgroundWire, A::Error> {
        self.0.visit_seq(sequence).map(radiance)
    }
}

/// Parses a colour such as `#203040` or `#234`, or `black` or `white`. Returns `None` for a text that is no
/// such colour.
fn displayed(text: &str) -> Option<[u8; 3]> {
    match text {
        "black" => return Some([0; 3]),
        "white" => return Some([255; 3]),
        _ => {}
    }
    let is_number = |digits: &&str| digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    let digits = text.strip_prefix('#').filter(is_number)?;
    let channel = |part: &str| u8::from_str_radix(part, 16).ok();
    match digits.len() {
        6 => Some([channel(&digits[..2])?, channel(&digits[2..4])?, channel(&digits[4..])?]),
        3 => Some([channel(&digits[..1])? * 17, channel(&digits[1..2])? * 17, channel(&digits[2..])? * 17]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_have_six_digits_or_three_or_a_name() {
        for (text, colour) in [
            ("#203040", Some([32, 48, 64])),
            ("#234", Some([34, 51, 68])),
            ("#FfA", Some([255, 255, 170])),
            ("black", Some([0; 3])),
            ("white", Some([255; 3])),
            ("#2030", None),
            ("#20304g", None),
            ("203040", None),
            ("", None),
        ] {
            assert_eq!(displayed(text), colour, "{text}");
        }
    }

    /// In the refused texts, some letters have an accent and take two bytes, and some digits have a sign.
    #[test]
    fn a_colour_has_nothing_but_digits() {
        for text in ["#aé", "#éa", "#é", "#éééé", "#aé34", "#2030é", "#+2+3+4", "#-2-3-4", "#+23"] {
            assert_eq!(displayed(text), None, "{text}");
        }
    }
}
