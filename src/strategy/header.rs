//! The headers of kernel files that define values of axes. A header is a comment at the beginning of a file; it
//! tells the host the properties of the value. If a value has several files, only the first of them has a
//! header.

use super::keys::{KEYS, Key, Said};
use crate::error::{Error, Result, meant};

/// The properties of a value of an axis, if the value is a kernel file.
#[derive(Debug, PartialEq, Eq)]
pub struct Header {
    /// The axis to which the file's value belongs.
    pub axis: &'static str,
    /// The value's name: the file's name with `-` in place of `_`.
    pub name: String,
    /// The meaning of the value, in a line.
    pub meaning: String,
    /// The folders that contain a kernel file for this value of the axis. Each folder belongs to one or
    /// several kernel families.
    pub folders: Vec<&'static str>,
    /// The values of other axes with which this value cannot be combined.
    pub contradicts: Vec<Contradiction>,
    facts: Vec<(&'static str, Said)>,
}

/// A value of another axis that cannot be combined with the value that the header describes.
#[derive(Debug, PartialEq, Eq)]
pub struct Contradiction {
    /// The axis of the value that cannot be combined with the value that the header describes.
    pub axis: &'static str,
    /// The name of the value that cannot be combined with the value that the header describes.
    pub value: String,
    /// The reason for the contradiction, if the header states one.
    pub because: Option<String>,
}

impl Header {
    /// An empty header, for a value without a kernel file. The empty header states no properties.
    pub(super) const NONE: Self = Self {
        axis: "",
        name: String::new(),
        meaning: String::new(),
        folders: Vec::new(),
        contradicts: Vec::new(),
        facts: Vec::new(),
    };

    /// Returns the word that the header has for a key; an empty word if the header does not have the key.
    pub(super) fn word(&self, key: &str) -> &'static str {
        match self.fact(key) {
            Some(Said::Word(word)) => word,
            _ => "",
        }
    }

    /// Returns the number that the header has for a key; `None` if the header does not have the key.
    pub(super) fn number(&self, key: &str) -> Option<u32> {
        match self.fact(key) {
            Some(Said::Number(number)) => Some(number),
            _ => None,
        }
    }

    fn fact(&self, key: &str) -> Option<Said> {
        self.facts.iter().find(|(name, _)| *name == key).map(|(_, said)| *said)
    }
}

/// A file whose header is to be read.
pub(super) struct Reader<'a> {
    /// The axis to which the value belongs.
    pub axis: &'static str,
    /// The file's path, relative to `cl/` or to the user's folder (`--cl-dir`).
    pub file: &'a str,
    /// The file's path, as messages show it.
    pub path: &'a str,
    /// Returns the names of an axis's values; an empty list if there is no such axis.
    pub names_of: &'a dyn Fn(&str) -> Vec<String>,
    /// Returns the location of an `#include` that names this file, perhaps by a wrong path. Returns `None` if
    /// there is none, or if a built-in file has the same path as this file.
    pub included_at: &'a dyn Fn() -> Option<String>,
    /// Returns true if this file includes another file, directly or through other files. The argument is the
    /// other file's path, relative to `cl/`.
    pub includes: &'a dyn Fn(&str) -> Result<bool>,
}

/// The entries of a header that have been read so far. Each entry that may occur only once is stored with the
/// number of its line.
#[derive(Default)]
struct Entries {
    meaning: Option<(usize, String)>,
    facts: Vec<(usize, &'static str, Said)>,
    contradicts: Vec<Contradiction>,
}

impl Reader<'_> {
    /// Reads the comment that a file begins with, up to the comment's first empty line. A line `// key: value` sets a
    /// key; all other lines are prose.
    pub fn read(&self, name: String, folders: Vec<&'static str>, text: &str) -> Result<Header> {
        let mut parsed = Entries::default();
        for (line, key, value) in entries(text) {
            self.take(&mut parsed, line, key, value)?;
        }
        let meaning = parsed.meaning.take().map(|(_, meaning)| meaning);
        let meaning = meaning.ok_or_else(|| self.no_meaning(text))?;
        let said = |key: &Key| parsed.facts.iter().any(|(_, name, _)| *name == key.name);
        if let Some(key) = self.keys().find(|key| !key.optional && !said(key)) {
            if let Some(error) = self.lacks_colon(text, key.name) {
                return Err(error);
            }
            let what = format!("{}; expected {}", key.about, key.takes);
            return Err(self.lacks(&format!("the file's header has no '{}' ({what})", key.name)));
        }
        self.check_planes(&parsed)?;
        self.check_tile(&parsed, &folders)?;
        self.check_exact_signs(&parsed, &folders)?;
        let facts = parsed.facts.into_iter().map(|(_, name, said)| (name, said)).collect();
        Ok(Header { axis: self.axis, name, meaning, folders, contradicts: parsed.contradicts, facts })
    }

    /// Checks another kernel file that the value has for another kernel family. The comment at the file's
    /// start must contain no key of a header, because raycl reads only the header in the first of a value's
    /// files.
    pub fn refuse_another(&self, path: &str, text: &str) -> Result<()> {
        match entries(text).find(|(_, key, _)| self.key_names().any(|own| own == *key)) {
            Some((line, key, _)) => Err(Error::input(format!(
                "{path}, line {line}: '{key}' is a key of a header, but the header for this value of the axis '{}' is in {}",
                self.axis, self.path
            ))
            .with_help(
                "a value of an axis has only one header: remove the line, or write it in the other file's header",
            )),
            None => Ok(()),
        }
    }

    /// Returns the error for a kernel file whose header does not state what the file's value means. The key
    /// `meaning` is usually missing from a header for one of two reasons: the header is not at the file's
    /// start, or the file is meant only to be included by other files.
    fn no_meaning(&self, text: &str) -> Error {
        if let Some(error) = self.lacks_colon(text, "meaning") {
            return error;
        }
        let bare = |line: &str| line.trim_start_matches(['/', '*', ' ', '\t']).starts_with("meaning:");
        let further_down = text.lines().position(bare).map(|row| row + 1);
        let mut why = match text.starts_with("//") {
            true => "the file's header has no 'meaning' (the value's meaning, in a line)".to_owned(),
            false => "the file has no header: it does not begin with a `//` comment".to_owned(),
        };
        if let Some(line) = further_down {
            why += &format!("; 'meaning' is only in line {line}");
        }
        let error = self.lacks(&why);
        let (top, name) = (self.file.split('/').next(), self.file.rsplit('/').next());
        match ((self.included_at)(), top, name) {
            (Some(location), Some(top), Some(name)) => error.with_help(format!(
                "{location} includes this file: a file that is not itself a value of '{}' must be in another folder; move it, for example to {top}/{name}, and write #include \"{top}/{name}\"",
                self.axis
            )),
            _ => error,
        }
    }

    /// Returns the error for a line of the header that begins with the missing key `key`, but has no colon directly
    /// after it. Returns `None` if there is no such line.
    fn lacks_colon(&self, text: &str, key: &str) -> Option<Error> {
        let (line, rest) = header_lines(text).find_map(|(line, words)| {
            let rest = words.strip_prefix(key)?;
            (rest.is_empty() || rest.starts_with([' ', '\t', '='])).then_some((line, rest))
        })?;
        let value = match rest.trim_start_matches([' ', '\t', '=', ':']) {
            "" => "...",
            value => value,
        };
        let message = format!("the header's key '{key}' is not directly followed by a colon");
        Some(self.wrong(line, message, Some(format!("write `// {key}: {value}`"))))
    }

    fn lacks(&self, why: &str) -> Error {
        Error::input(format!("{}, line 1: {why}", self.path)).with_help(format!(
            "begin the file with these lines, and choose one value in each: {}; docs/own-kernels.md describes headers",
            self.example()
        ))
    }

    /// Returns the keys that headers of the file's axis can have, except `meaning` and `contradicts`, which
    /// headers of every axis can have.
    fn keys(&self) -> impl Iterator<Item = &'static Key> {
        KEYS.iter().filter(|key| key.axis == self.axis)
    }

    /// Returns the names of all keys that headers of the file's axis can have.
    fn key_names(&self) -> impl Iterator<Item = &'static str> {
        ["meaning", "contradicts"].into_iter().chain(self.keys().map(|key| key.name))
    }

    fn take(&self, parsed: &mut Entries, line: usize, key: &str, value: &str) -> Result<()> {
        match key {
            _ if value.is_empty() => {
                Err(self.wrong(line, format!("'{key}' is empty; expected a value after the colon"), None))
            }
            "meaning" => match parsed.meaning.replace((line, value.to_owned())) {
                Some((first, _)) => Err(self.twice(line, key, first)),
                None => Ok(()),
            },
            "contradicts" => {
                parsed.contradicts.extend(self.contradictions(line, value)?);
                Ok(())
            }
            _ => {
                let key = self.keys().find(|own| own.name == key).ok_or_else(|| self.unknown(line, key))?;
                if let Some((first, ..)) = parsed.facts.iter().find(|(_, name, _)| *name == key.name) {
                    return Err(self.twice(line, key.name, *first));
                }
                let said = key.takes.parse(value).ok_or_else(|| {
                    let message = format!("'{value}' is not a valid '{}'; expected {}", key.name, key.takes);
                    self.wrong(line, message, meant(value, key.takes.words().iter().copied()))
                })?;
                parsed.facts.push((line, key.name, said));
                Ok(())
            }
        }
    }

    /// Parses `axis=value, axis=value because reason`. The reason after `because` applies to all pairs
    /// `axis=value` before it.
    fn contradictions(&self, line: usize, text: &str) -> Result<Vec<Contradiction>> {
        let (pairs, because) = match text.split_once(" because ") {
            Some((pairs, because)) => (pairs, Some(because.trim().to_owned())),
            None => (text, None),
        };
        let one = |pair: &str| {
            let pair = pair.trim();
            let Some((axis, value)) = pair.split_once('=') else {
                let message = format!(
                    "'{pair}' is not axis=value; expected a value of another axis, such as culling=back"
                );
                return Err(self.wrong(line, message, None));
            };
            let axis = self.other_axis(line, axis.trim())?;
            let (value, names) = (value.trim(), (self.names_of)(axis));
            if !names.iter().any(|name| name == value) {
                let message =
                    format!("'{value}' is not a value of {axis}; expected one of {}", names.join(", "));
                return Err(self.wrong(line, message, meant(value, names.iter().map(String::as_str))));
            }
            Ok(Contradiction { axis, value: value.to_owned(), because: because.clone() })
        };
        pairs.split(',').map(one).collect()
    }

    fn other_axis(&self, line: usize, name: &str) -> Result<&'static str> {
        let others: Vec<_> =
            super::AXES.iter().map(|info| info.name).filter(|axis| *axis != self.axis).collect();
        others.iter().copied().find(|axis| *axis == name).ok_or_else(|| {
            let message = format!(
                "'contradicts' in a header of the axis '{}' cannot name '{name}'; expected one of {}",
                self.axis,
                others.join(", ")
            );
            self.wrong(line, message, meant(name, others))
        })
    }

    /// Checks `record_floats` if a kernel prepares planes for each triangle and each origin (eye or light): the planes
    /// of a triangle always have [`PLANES_FLOATS`] floats.
    fn check_planes(&self, parsed: &Entries) -> Result<()> {
        let said = |name: &str| parsed.facts.iter().find(|(_, key, _)| *key == name);
        let planes =
            said("prepared_for").filter(|(_, _, said)| matches!(said, Said::Word("origin" | "pixels")));
        match (planes, said("record_floats")) {
            (Some((other, ..)), Some((line, _, Said::Number(floats)))) if *floats != PLANES_FLOATS => {
                let message = format!(
                    "'record_floats' is {floats}; expected {PLANES_FLOATS}, since 'prepared_for' in line {other} is origin or pixels"
                );
                Err(self.wrong(*line, message, None))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a header with `prepared_for: tile` (the test prepares triangles for a tile of rays) if the
    /// file is in the folder of the families without tiles of rays.
    fn check_tile(&self, parsed: &Entries, folders: &[&str]) -> Result<()> {
        match parsed.facts.iter().find(|(_, key, _)| *key == "prepared_for") {
            Some((line, _, Said::Word("tile"))) if folders.contains(&NO_TILES) => {
                let message = format!(
                    "'prepared_for' is tile, but the kernels that include files of {NO_TILES} have no tiles of rays; expected any-ray, origin or pixels"
                );
                Err(self.wrong(*line, message, None))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a header with `exact_signs: yes` if the file does not include [`EXACT_SIGNS`]: without this
    /// include, compilers may contract products and sums to fma. The families with tiles of rays include
    /// [`EXACT_SIGNS`] themselves.
    fn check_exact_signs(&self, parsed: &Entries, folders: &[&str]) -> Result<()> {
        let is_yes = |key: &str, said: &Said| key == "exact_signs" && matches!(said, Said::Word("yes"));
        let yes = parsed.facts.iter().find(|(_, key, said)| is_yes(key, said));
        match yes {
            Some((line, ..)) if folders.contains(&NO_TILES) && !(self.includes)(EXACT_SIGNS)? => {
                let message = format!(
                    "'exact_signs' is yes, but the file does not include {EXACT_SIGNS}; without this include, compilers may contract products and sums to fma, and an fma can change a sign"
                );
                let help =
                    format!("write #include \"{EXACT_SIGNS}\" between the header and the first function");
                Err(self.wrong(*line, message, Some(help)))
            }
            _ => Ok(()),
        }
    }

    fn unknown(&self, line: usize, key: &str) -> Error {
        let own: Vec<_> = self.key_names().collect();
        let message = format!(
            "'{key}' is not a key in headers of the axis '{}'; expected one of {}",
            self.axis,
            own.join(", ")
        );
        self.wrong(line, message, meant(key, own))
    }

    fn twice(&self, line: usize, key: &str, first: usize) -> Error {
        self.wrong(line, format!("'{key}' occurs twice: first in line {first}"), None)
    }

    fn wrong(&self, line: usize, message: String, meant: Option<String>) -> Error {
        Error::input(format!("{}, line {line}: {message}", self.path))
            .with_help(meant.unwrap_or_else(|| "docs/own-kernels.md describes headers".to_owned()))
    }

    /// Returns a header with all required keys, as an example.
    fn example(&self) -> String {
        let facts =
            self.keys().filter(|key| !key.optional).map(|key| format!("`// {}: {}`", key.name, key.takes));
        ["`// meaning: ...`".to_owned()].into_iter().chain(facts).collect::<Vec<_>>().join(", ")
    }
}

/// Number of floats of the planes that are prepared for a triangle and an origin (the eye or a light).
const PLANES_FLOATS: u32 = crate::manifest::ROW_FLOATS as u32;

/// The folder of the ray-triangle tests of the families that have no tiles of rays.
const NO_TILES: &str = "cast/intersect/";

/// The file that forbids compilers to contract expressions to fma. The file `EXACT_SIGNS` affects only the
/// code after the line that includes it.
const EXACT_SIGNS: &str = "common/exact_signs.cl";

/// Returns the entries `// key: value` of the comment that a file begins with, up to the comment's first empty line.
/// Each entry comes with the number of its line.
fn entries(text: &str) -> impl Iterator<Item = (usize, &str, &str)> {
    header_lines(text).filter_map(|(number, line)| {
        // A line with a URL has a colon, but sets no key.
        let (key, value) = line.split_once(':')?;
        (is_key(key) && !value.starts_with("//")).then(|| (number, key, value.trim()))
    })
}

/// Returns the lines of the comment that a file begins with, up to the comment's first empty line, each with its number
/// and without the `//`.
fn header_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let comment = text.lines().map_while(|line| line.strip_prefix("//").map(str::trim));
    (1..).zip(comment.take_while(|line| !line.is_empty()))
}

/// Returns true if the text before a colon can be a key: one word of lower-case letters and underscores.
fn is_key(word: &str) -> bool {
    !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase() || c == '_')
}

#[cfg(test)]
mod tests;
