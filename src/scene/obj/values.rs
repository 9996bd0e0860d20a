//! Parses the numbers in MTL files. Lines with numbers that raycl cannot use are ignored, with a note.

use super::text::{Seen, Source, number, quoted_number, tokens, words};
use super::wishes;
use crate::scene::material::{DEFAULT_LAMBERTIAN, MAX_REFLECTANCE, MAX_SHININESS, PAPER_SHININESS};
use crate::words::counted;

/// The reason why a line is ignored.
#[derive(Debug)]
pub(super) struct Unfit {
    /// The keyword, such as `Kd`. For a form of colours that raycl does not support, the name of the form is
    /// added: `Kd spectral`. Ignored lines of the same kind share one note.
    kind: String,
    /// What is wrong with the line. This description may quote the file.
    found: String,
    /// The form of the line that raycl accepts.
    expected: String,
    /// A sentence, without its full stop, that says what raycl uses instead of the ignored line.
    instead: String,
}

/// The ignored lines of an MTL file. Each kind of ignored line has one element: the reason why its first
/// line is ignored, and the number of its lines.
#[derive(Default)]
pub(super) struct Ignored(Vec<(Unfit, Seen)>);

impl Ignored {
    /// Counts an ignored line. `offset` is the line's byte offset in the text.
    pub fn add(&mut self, offset: usize, unfit: Unfit) {
        self.extend(Self(vec![(unfit, Seen { count: 1, first: offset })]));
    }

    /// Returns true if no line is ignored.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds ignored lines of a later part of the text.
    pub fn extend(&mut self, later: Self) {
        for (unfit, lines) in later.0 {
            match self.0.iter_mut().find(|(known, _)| known.kind == unfit.kind) {
                Some((_, known)) => *known = known.joined(lines),
                None => self.0.push((unfit, lines)),
            }
        }
    }

    /// Returns a note for each kind of ignored lines.
    pub fn notes(&self, source: &Source) -> impl Iterator<Item = String> {
        self.0.iter().map(|(Unfit { kind, found, expected, instead }, lines)| {
            let found =
                if source.quotes { found.clone() } else { format!("a line with {kind} cannot be used") };
            let (line, ignored) = (source.line(lines.first), counted(lines.count, "such line"));
            format!(
                "{}:{line}: {found} (expected {expected}). raycl ignores {ignored}. {instead}.",
                source.name
            )
        })
    }
}

/// Parses the three values of `Kd`, `Ks` or `Ke`, or one value that sets all three, as MTL allows.
pub(super) fn colour(key: &str, rest: &[u8]) -> Result<[f32; 3], Unfit> {
    let unfit = |kind: String, found: String| {
        let expected = format!("one or three numbers from 0 to {MAX_REFLECTANCE:e}");
        let instead = match key {
            "Kd" => format!(
                "Without Kd, the diffuse reflectance is {DEFAULT_LAMBERTIAN} (grey), or 1 if there is a \
                 texture"
            ),
            "Ke" => "Without Ke, the surface emits no light".to_owned(),
            _ => format!("Without {key}, there is no highlight"),
        };
        Unfit { kind, found, expected, instead }
    };
    // MTL also allows `Kd spectral FILE FACTOR` and `Kd xyz X Y Z`.
    if let Some(form @ (b"spectral" | b"xyz")) = tokens(rest).next() {
        let form = format!("{key} {}", words(form));
        let found = format!("`{form}` is a form of colours that raycl does not support");
        return Err(unfit(form, found));
    }
    let values = tokens(rest).take(3).map(|token| {
        let value = number(token).filter(|value| (0.0..=MAX_REFLECTANCE).contains(value));
        value.ok_or_else(|| unfit(key.to_owned(), format!("{} in {key}", quoted_number(token))))
    });
    match values.collect::<Result<Vec<f32>, _>>()?[..] {
        [grey] => Ok([grey; 3]),
        [r, g, b] => Ok([r, g, b]),
        ref values => Err(unfit(key.to_owned(), format!("{key} with {}", counted(values.len(), "number")))),
    }
}

/// What raycl does with lines that [`has_more`] finds.
pub(super) const MORE: &str =
    "values after the third of Kd, Ks or Ke, or after the first of Ns, are not read";

/// Returns true if a line has more values than raycl reads of `Kd`, `Ks`, `Ke` or `Ns`.
pub(super) fn has_more(key: &[u8], rest: &[u8]) -> bool {
    let most = match key {
        _ if key.eq_ignore_ascii_case(b"Ke") => 3,
        b"Kd" | b"Ks" => 3,
        b"Ns" => 1,
        _ => return false,
    };
    tokens(rest).nth(most).is_some()
}

/// The least value of `Kd` or `Ks` that is probably meant as a channel from 0 to 255.
const LEAST_OF_BYTES: f32 = 16.0;

/// What raycl does with lines for which [`is_bright`] returns true.
pub(super) const BRIGHT: &str =
    "a Kd or Ks of 16 or more is read as a reflectance (1 is white), not as a channel from 0 to 255";

/// Returns true if a line with `Kd` or `Ks` has a value that is probably meant as a channel from 0 to 255.
pub(super) fn is_bright(key: &[u8], rest: &[u8]) -> bool {
    let is_byte = |token| number(token).is_some_and(|value| value >= LEAST_OF_BYTES);
    matches!(key, b"Kd" | b"Ks") && tokens(rest).take(3).any(is_byte)
}

/// Parses the value of `Ns`.
pub(super) fn shininess(rest: &[u8]) -> Result<f32, Unfit> {
    let token = tokens(rest).next();
    let value = token.and_then(number).filter(|value| (0.0..=MAX_SHININESS).contains(value));
    value.ok_or_else(|| Unfit {
        kind: "Ns".to_owned(),
        found: token
            .map_or("Ns with 0 numbers".to_owned(), |token| format!("{} in Ns", quoted_number(token))),
        expected: format!("a number from 0 to {MAX_SHININESS:e}"),
        instead: format!("Without Ns, the shininess is {PAPER_SHININESS}"),
    })
}

/// Returns the reason why a line that names a texture is ignored. `key` is the line's keyword, such as `map_Kd`.
pub(super) fn unfit_map(key: &str, found: String, expected: &str) -> Unfit {
    let instead = match key {
        "map_d" => "the surface has no holes",
        "map_Ke" => "the material's own emitted light is used",
        _ => "the material's own colour is used",
    };
    Unfit {
        kind: key.to_owned(),
        found,
        expected: expected.to_owned(),
        instead: format!("Without {key}, {instead}"),
    }
}

/// Checks the numbers of a feature that raycl does not support. raycl does not use these numbers, so every
/// finite number is valid.
pub(super) fn unused(key: &[u8], rest: &[u8]) -> Result<(), Unfit> {
    let Some((wish, most)) = wishes::of_numbers(key) else { return Ok(()) };
    let options: [&[u8]; 3] = [b"-halo", b"spectral", b"xyz"];
    let mut values = tokens(rest).take(most).take_while(|token| !options.contains(token));
    let Some(token) = values.find(|token| number(token).is_none()) else { return Ok(()) };
    let (what, instead) = wish.words();
    Err(Unfit {
        kind: words(key),
        found: format!("{} in {}", quoted_number(token), words(key)),
        expected: "a finite number".to_owned(),
        instead: format!("raycl does not support {what}: {instead}"),
    })
}
