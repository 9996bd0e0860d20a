//! Checks the sizes of images and of work-groups in a config.

use std::ops::{Range, RangeInclusive};

use toml::Spanned;

use super::document::Document;
use super::lists::{distinct, not_empty};
use super::numbers::whole;
use super::wire;
use crate::error::Result;

/// The allowed range of an image's width and height in pixels.
pub(super) const IMAGE_SIDE: RangeInclusive<i64> = 1..=65_536;
/// Range of a work-group's width and height in work-items; a device may allow fewer.
pub(super) const LOCAL_SIDE: RangeInclusive<i64> = 1..=4096;
/// The largest number of pixels of an image.
pub(super) const IMAGE_PIXELS: u64 = u32::MAX as u64;
/// The largest number of work-items in a work-group that a config may ask for.
pub(super) const LOCAL_ITEMS: u64 = 4096;

/// Returns the image sizes in the file's order, without repetitions. Returns an error if the list is empty, or if a
/// size is out of range.
pub fn image_sizes(document: &Document, list: &Spanned<Vec<Spanned<wire::Size>>>) -> Result<Vec<[u32; 2]>> {
    not_empty(document, list, "image_sizes", "a size, such as [800, 500]")?;
    let parse =
        |wire: &Spanned<wire::Size>| size(document, wire, "image size", &IMAGE_SIDE, IMAGE_PIXELS, "pixels");
    Ok(distinct(list.get_ref().iter().map(parse).collect::<Result<_>>()?))
}

/// Returns the local sizes in the file's order, without repetitions; the list may be empty. Returns an error if a size
/// is out of range.
pub fn local_sizes(document: &Document, list: &[Spanned<wire::Size>]) -> Result<Vec<[u32; 2]>> {
    let parse = |wire: &Spanned<wire::Size>| {
        size(document, wire, "local size", &LOCAL_SIDE, LOCAL_ITEMS, "work-items")
    };
    Ok(distinct(list.iter().map(parse).collect::<Result<_>>()?))
}

fn size(
    document: &Document,
    wire: &Spanned<wire::Size>,
    what: &str,
    side: &RangeInclusive<i64>,
    most: u64,
    unit: &str,
) -> Result<[u32; 2]> {
    let check = |value: i64, span: Range<usize>| whole(document, value, span, what, side);
    let [across, down] = match wire.get_ref() {
        wire::Size::Square(value) => [check(*value, wire.span())?; 2],
        wire::Size::List(values) => match values.as_slice() {
            [across, down] => {
                [check(*across.get_ref(), across.span())?, check(*down.get_ref(), down.span())?]
            }
            other => {
                let message = format!("{what} must have two numbers, not {}", other.len());
                return Err(document.error(wire.span(), message, "expected [across, down]"));
            }
        },
    };
    if u64::from(across) * u64::from(down) > most {
        let message = format!("{what} {across} x {down} is too large");
        return Err(document.error(wire.span(), message, format!("expected at most {most} {unit}")));
    }
    Ok([across, down])
}
