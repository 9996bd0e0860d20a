//! Checks that a list of a config is not empty, and removes repeated elements from a list.

use toml::Spanned;

use super::document::Document;
use crate::error::Result;

/// Returns an error if the list is empty. The error's message names `key`, and its label is "expected at least" with
/// the text `expected`.
pub fn not_empty<T>(document: &Document, list: &Spanned<Vec<T>>, key: &str, expected: &str) -> Result<()> {
    if !list.get_ref().is_empty() {
        return Ok(());
    }
    Err(document.error(list.span(), format!("'{key}' is empty"), format!("expected at least {expected}")))
}

/// Returns the list without repeated elements, in the original order.
pub fn distinct<T: PartialEq>(list: Vec<T>) -> Vec<T> {
    let mut unique = Vec::new();
    for item in list {
        if !unique.contains(&item) {
            unique.push(item);
        }
    }
    unique
}
