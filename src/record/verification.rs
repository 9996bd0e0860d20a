//! Counts the points whose images could hardly be verified, because too many pixels of these images are
//! uncertain (rounding may decide the values of these pixels).

use super::outcome::Outcome;
use super::types::Record;
use crate::numbers::by;
use crate::verify::hardly_verified;
use crate::words::counted_of_were;

/// Returns a note on the measured points in whose images too many pixels are uncertain; `None` if there are
/// no such points.
pub(crate) fn hardly_verified_images(records: &[Record]) -> Option<String> {
    let measured = || records.iter().filter(|record| record.outcome == Outcome::Measured);
    let why = |record: &Record| {
        // Records of earlier versions of raycl do not state how many pixels' rays hit something. In records
        // without the number of hits, all pixels of the image count.
        let hits = [record.uncertain_hits, record.hits].map(|count| count.unwrap_or(0) as usize);
        hardly_verified([record.uncertain_pixels? as usize, record.pixels() as usize], hits)
    };
    let (first, reason) = measured().find_map(|record| Some((record, why(record)?)))?;
    let count = measured().filter(|record| why(record).is_some()).count();
    let were = counted_of_were(count, measured().count(), "image");
    Some(format!(
        "{were} hardly verified. In the first, of {} {}, {reason}.",
        first.scene,
        by(first.image_size)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_with_few_certain_pixels_are_counted_and_the_first_is_named() {
        let of = |outcome, uncertain_pixels| Record {
            scene: "fence".to_owned(),
            image_size: [40, 25],
            outcome,
            uncertain_pixels,
            ..Record::default()
        };
        let fine = [
            of(Outcome::Measured, Some(900)),
            of(Outcome::WrongImage, Some(1000)),
            of(Outcome::Measured, None),
        ];
        assert_eq!(hardly_verified_images(&fine), None);
        let few = of(Outcome::Measured, Some(901));
        let note = hardly_verified_images(&[&fine[..], &[few]].concat()).unwrap_or_default();
        let start = "1 of 3 images was hardly verified. In the first, of fence 40 x 25, 99 of 1000 pixels were certain";
        assert!(note.starts_with(start), "{note}");
        // If the number of pixels whose rays hit something is known, only pixels whose rays hit something
        // count.
        let hits = |uncertain, hits| Record {
            uncertain_hits: Some(uncertain),
            hits: Some(hits),
            ..of(Outcome::Measured, Some(500))
        };
        let note = hardly_verified_images(&[hits(500, 500)]).unwrap_or_default();
        assert!(note.contains(", 0 of 500 pixels with a surface were certain"), "{note}");
        assert_eq!(hardly_verified_images(&[hits(450, 500)]), None);
    }
}
