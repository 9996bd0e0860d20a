//! Values of axes that are files of a user's folder: `cast/intersect/baldwin_weber.cl` is `intersector = baldwin-weber`.
//!
//! A header in the file says what the host must know. Whatever it does not say is as of a value that is built in, which it
//! names: what is allocated, bound and refused follows from that one.

use super::{AXES, AxisInfo, Strategy};
use crate::error::{Error, Result, nearest};
use std::sync::{PoisonError, RwLock};

/// The axes whose values are files, and the folder that their first file lies in.
pub const FOLDERS: [(&str, &str); 5] = [
    ("vectors", "cast/vectors/"),
    ("triangles", "cast/triangles/"),
    ("layout", "cast/layout/"),
    ("shading", "cast/shading/"),
    ("intersector", "cast/intersect/"),
];
/// The keys of a header.
const KEYS: [&str; 3] = ["meaning", "like", "contradicts"];

/// A value that a file adds to an axis.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct Added {
    /// The axis.
    pub axis: &'static str,
    /// The value's name: the file's, with `-` for `_`.
    pub name: String,
    /// What it means, in a line.
    pub meaning: String,
    /// The value that is built in whose needs it shares.
    pub like: &'static str,
    /// Values of other axes that make no sense with it.
    pub contradicts: Vec<(&'static str, String)>,
}

/// The added values of a strategy: at most one of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AddedValues([Option<&'static Added>; FOLDERS.len()]);

impl AddedValues {
    /// None of any axis.
    pub const NONE: Self = Self([None; FOLDERS.len()]);

    /// That of an axis.
    pub(super) fn of(&self, axis: &str) -> Option<&'static Added> {
        self.all().find(|added| added.axis == axis)
    }

    /// All of them.
    pub(super) fn all(&self) -> impl Iterator<Item = &'static Added> {
        self.0.into_iter().flatten()
    }

    /// Puts another, or none, in the place of an axis's.
    pub(super) fn replace(&mut self, axis: &str, added: Option<&'static Added>) {
        if let Some(place) = FOLDERS.iter().position(|(name, _)| *name == axis) {
            self.0[place] = added;
        }
    }
}

/// Which there are is a fact of the process, as what is built in is: they come from its one `--cl-dir`, before any name is
/// read. They live as long as the process, so that a strategy can be copied.
static ALL: RwLock<Vec<&'static Added>> = RwLock::new(Vec::new());

/// Makes a value known; a changed one takes the place of the one before.
pub(crate) fn make_known(added: Added) {
    let mut all = ALL.write().unwrap_or_else(PoisonError::into_inner);
    if all.iter().any(|known| **known == added) {
        return;
    }
    all.retain(|known| (known.axis, &known.name) != (added.axis, &added.name));
    all.push(Box::leak(Box::new(added)));
}

/// The added values of an axis.
pub fn added_values(axis: &str) -> Vec<&'static Added> {
    let all = ALL.read().unwrap_or_else(PoisonError::into_inner);
    all.iter().copied().filter(|added| added.axis == axis).collect()
}

impl AxisInfo {
    /// Each value's name and what it means: those built in, then those that files added.
    pub fn all_values(&self) -> Vec<(&'static str, &'static str)> {
        let added = added_values(self.name);
        let added = added.iter().map(|added| (added.name.as_str(), added.meaning.as_str()));
        self.values.iter().copied().chain(added).collect()
    }
}

impl Strategy {
    /// Why an added value contradicts another, if so.
    pub(super) fn added_conflict(&self) -> Option<String> {
        let axes = self.axes();
        self.added.all().find_map(|added| {
            let (axis, value) =
                added.contradicts.iter().find(|(axis, value)| axes.contains(&(*axis, value.as_str())))?;
            Some(format!("{} = {} contradicts {axis} = {value}, as its file says", added.axis, added.name))
        })
    }
}

/// Reads the header of a file in one of [`FOLDERS`]; `path` is what messages call it.
pub(crate) fn read_header(axis: &'static str, file: &str, path: &str, text: &str) -> Result<Added> {
    let stem = file.rsplit('/').next().unwrap_or(file).trim_end_matches(".cl");
    let name = stem.replace('_', "-");
    let mut header = Header { axis, path, meaning: None, like: None, contradicts: Vec::new() };
    for (number, line) in text.lines().enumerate() {
        let Some(comment) = line.strip_prefix("//") else { break };
        if let Some((key, value)) = comment.split_once(':') {
            header.take(number + 1, key.trim(), value.trim())?;
        }
    }
    let meaning = header.meaning.take().ok_or_else(|| header.lacks("meaning", "what it is, in a line"))?;
    let like = header.like.ok_or_else(|| header.lacks("like", "the built-in value whose needs it shares"))?;
    Ok(Added { axis, name, meaning, like, contradicts: header.contradicts })
}

struct Header<'a> {
    axis: &'static str,
    path: &'a str,
    meaning: Option<String>,
    like: Option<&'static str>,
    contradicts: Vec<(&'static str, String)>,
}

impl Header<'_> {
    fn take(&mut self, line: usize, key: &str, value: &str) -> Result<()> {
        if !key.chars().all(|c| c.is_ascii_lowercase() || c == '_') {
            return Ok(()); // a sentence with a colon
        }
        match key {
            "meaning" if value.is_empty() => Err(self.wrong(line, "'meaning' is empty".to_owned(), None)),
            "meaning" => {
                self.meaning = Some(value.to_owned());
                Ok(())
            }
            "like" => {
                let values = info(self.axis).values.iter().map(|(name, _)| *name).collect();
                self.like = Some(self.one_of(line, "a built-in value", self.axis, value, values)?);
                Ok(())
            }
            "contradicts" => value.split(',').try_for_each(|pair| self.contradiction(line, pair.trim())),
            _ => match nearest(key, KEYS) {
                Some(meant) => Err(self.wrong(line, format!("'{key}' is no key of a header"), Some(meant))),
                None => Ok(()),
            },
        }
    }

    fn contradiction(&mut self, line: usize, pair: &str) -> Result<()> {
        let Some((axis, value)) = pair.split_once('=') else {
            return Err(self.wrong(line, format!("'{pair}' is not axis=value"), None));
        };
        let axes = AXES.iter().map(|info| info.name).collect();
        let axis = self.one_of(line, "an axis", "strategies", axis.trim(), axes)?;
        let values = info(axis).all_values().iter().map(|(name, _)| *name).collect();
        let value = self.one_of(line, "a value", axis, value.trim(), values)?;
        self.contradicts.push((axis, value.to_owned()));
        Ok(())
    }

    fn one_of(
        &self,
        line: usize,
        what: &str,
        of: &str,
        name: &str,
        all: Vec<&'static str>,
    ) -> Result<&'static str> {
        all.iter().copied().find(|one| *one == name).ok_or_else(|| {
            let message = format!("'{name}' is not {what} of {of}; expected one of {}", all.join(", "));
            self.wrong(line, message, nearest(name, all))
        })
    }

    fn wrong(&self, line: usize, message: String, meant: Option<&str>) -> Error {
        let error = Error::input(format!("{}, line {line}: {message}", self.path));
        error.with_help(match meant {
            Some(meant) => format!("did you mean '{meant}'?"),
            None => "docs/kernels.md says what a header holds".to_owned(),
        })
    }

    fn lacks(&self, key: &str, what: &str) -> Error {
        let message = format!("{}, line 1: its header has no '{key}': {what}", self.path);
        let like = info(self.axis).values[0].0;
        Error::input(message).with_help(format!(
            "begin the file with `// meaning: ...` and `// like: {like}`; docs/kernels.md says more"
        ))
    }
}

fn info(axis: &str) -> &'static AxisInfo {
    // The axes of a header are those of FOLDERS or were found in AXES; the first stands for none.
    AXES.iter().find(|info| info.name == axis).unwrap_or(&AXES[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Result<Added> {
        read_header("intersector", "cast/intersect/my_test.cl", "kernels/my_test.cl", text)
    }

    #[test]
    fn a_header_says_what_the_host_must_know() {
        let text = "// A test of mine: see below.\n// meaning: mine\n// like: moller-trumbore\n// contradicts: culling=back, math=fast\n\n// like: nothing\n";
        let added = header(text).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            (added.name.as_str(), added.meaning.as_str(), added.like),
            ("my-test", "mine", "moller-trumbore")
        );
        assert_eq!(added.contradicts, [("culling", "back".to_owned()), ("math", "fast".to_owned())]);
    }

    #[test]
    fn a_wrong_header_has_its_file_line_and_remedy() {
        for (text, said, help) in [
            ("int x;", "line 1: its header has no 'meaning'", "// like: moller-trumbore"),
            ("// meaning: a\n", "line 1: its header has no 'like'", "// meaning: ..."),
            ("// meaning:\n", "line 1: 'meaning' is empty", "docs/kernels.md"),
            (
                "// meaning: a\n// like: mollertrumbore\n",
                "line 2: 'mollertrumbore' is not a built-in value of intersector",
                "'moller-trumbore'",
            ),
            ("// meanin: a\n", "line 1: 'meanin' is no key", "'meaning'"),
            ("// contradicts: culling\n", "line 1: 'culling' is not axis=value", "docs/kernels.md"),
            ("// contradicts: cullin=back\n", "line 1: 'cullin' is not an axis", "'culling'"),
            ("// contradicts: culling=bakc\n", "line 1: 'bakc' is not a value of culling", "'back'"),
        ] {
            let error = header(text).err().unwrap_or_else(|| panic!("{text} is taken"));
            let help_of = format!("{error:?}");
            assert!(error.to_string().contains(said), "{error}");
            assert!(error.to_string().starts_with("kernels/my_test.cl, "), "{error}");
            assert!(help_of.contains(help), "{help_of}");
            assert_eq!(error.exit_code(), 2);
        }
    }
}
