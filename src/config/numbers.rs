//! Checks that the numbers of a config are in their allowed ranges.

use std::fmt::Display;
use std::ops::{Range, RangeInclusive};

use toml::Spanned;

use super::document::Document;
use crate::error::Result;

/// Returns `value` if it is in `range`. If `value` is outside `range`, returns an error at `span`, in which
/// `what` names the value.
pub fn whole(
    document: &Document,
    value: i64,
    span: Range<usize>,
    what: &str,
    range: &RangeInclusive<i64>,
) -> Result<u32> {
    match u32::try_from(value) {
        Ok(number) if range.contains(&value) => Ok(number),
        _ => Err(out_of_range(document, span, what, value, "a whole number", range)),
    }
}

/// Returns the number in `value` if it is in `range`, and `default` if the config sets no number. For a
/// number outside the range, returns an error, in which `what` names the number.
pub fn real(
    document: &Document,
    value: &Option<Spanned<f64>>,
    what: &str,
    range: RangeInclusive<f64>,
    default: f64,
) -> Result<f64> {
    let Some(spanned) = value else { return Ok(default) };
    let value = *spanned.get_ref();
    if range.contains(&value) {
        return Ok(value);
    }
    Err(out_of_range(document, spanned.span(), what, value, "a number", &range))
}

fn out_of_range<T: Display>(
    document: &Document,
    span: Range<usize>,
    what: &str,
    value: T,
    kind: &str,
    range: &RangeInclusive<T>,
) -> crate::Error {
    let label = format!("expected {kind} from {} to {}", range.start(), range.end());
    document.error(span, format!("{what} {value} is out of range"), label)
}
