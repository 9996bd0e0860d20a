//! Notes on the parts of pictures that raycl does not use, or that are damaged.

use crate::words::counted;
use std::collections::BTreeMap;

/// A part of a picture that raycl does not use, or that is damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::scene) enum Part {
    ColourSpace,
    Orientation,
    Animation,
    Data,
    FourthChannel,
    Alpha,
    Opacity,
    Mask,
}

impl Part {
    /// Returns the part's name, what is the matter with it, and what raycl does instead, all for messages.
    fn words(self) -> (&'static str, &'static str, &'static str) {
        let (what, instead) = match self {
            Self::Data => return ("data", "is damaged", "some texels are probably wrong"),
            Self::ColourSpace => ("colour space", "values are read as sRGB"),
            Self::Orientation => ("orientation", "the picture is neither turned nor mirrored"),
            Self::Animation => ("animation", "only one picture is shown"),
            Self::FourthChannel => ("fourth channel", "it does not count as alpha"),
            Self::Alpha => ("alpha", "without a map_d, a surface has no holes"),
            Self::Opacity => ("partial opacity", "every point is either opaque or a hole"),
            Self::Mask => ("mask", "map_Kd names the same picture, which is opaque"),
        };
        (what, "is not used", instead)
    }
}

/// For each part, the pictures of which this part is not used: the name of each picture, and what the picture states
/// about the part, such as `gAMA 1` (empty if there is nothing to quote).
#[derive(Default)]
pub(in crate::scene) struct UnusedParts(BTreeMap<Part, BTreeMap<String, String>>);

impl UnusedParts {
    pub fn add(&mut self, part: Part, name: String, stated: &str) {
        self.0.entry(part).or_default().insert(name, stated.to_owned());
    }

    /// Returns a note for each part, except for the parts `unnoted`. If `quotes` is true, the notes name a picture.
    pub fn notes(&self, quotes: bool, unnoted: &[Part]) -> impl Iterator<Item = String> {
        self.0.iter().filter(|(part, _)| !unnoted.contains(part)).filter_map(move |(part, pictures)| {
            let ((what, state, instead), (name, stated)) = (part.words(), pictures.first_key_value()?);
            let such_as = if pictures.len() == 1 { "" } else { "for example " };
            let stated = if stated.is_empty() { String::new() } else { format!(": {stated}") };
            let example = if quotes { format!(" ({such_as}{name}{stated})") } else { String::new() };
            let textures = counted(pictures.len(), "texture");
            Some(format!("{what} of {textures} {state}{example}: {instead}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_has_one_note_that_names_a_picture_where_that_is_permitted() {
        let mut unused = UnusedParts::default();
        for name in ["`b.png`", "`a.png`", "`a.png`"] {
            unused.add(Part::Alpha, name.to_owned(), "");
        }
        unused.add(Part::ColourSpace, "`c.png`".to_owned(), "gAMA 1");
        unused.add(Part::Data, "`d.jpg`".to_owned(), "");
        let expected = [
            "colour space of 1 texture is not used (`c.png`: gAMA 1): values are read as sRGB",
            "data of 1 texture is damaged (`d.jpg`): some texels are probably wrong",
            "alpha of 2 textures is not used (for example `a.png`): without a map_d, a surface has no holes",
        ];
        assert_eq!(unused.notes(true, &[]).collect::<Vec<_>>(), expected);
        let first = unused.notes(false, &[]).next();
        assert_eq!(first.as_deref(), Some("colour space of 1 texture is not used: values are read as sRGB"));
        assert_eq!(unused.notes(true, &[Part::ColourSpace]).collect::<Vec<_>>(), expected[1..]);
    }
}
