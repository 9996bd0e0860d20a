//! Mistakes in mesh files, and the errors that report these mistakes. A scene file may name a mesh outside the scene
//! file's folder. This mesh may belong to somebody else, so errors must not quote it.

use crate::error::Error;
use crate::scene::obj::{has_decimal_comma, quoted_number};

/// The remedy, in the help of an error, for a mesh file with a mistake.
const EXPORT: &str = "the file may be cut off or damaged; export it again, or convert it to OBJ";
/// The remedy for a mesh file whose numbers have decimal commas.
const POINTS: &str = "set the program that wrote the file to decimal points (often a setting of its language or number \
     format), and export the file again";
/// The remedy if the error must not quote the mesh file.
const OUTSIDE: &str = "the mesh's text is not shown, since the mesh is outside the folder of the file that names it; \
     `raycl render MESH` shows the mistake";

/// A mistake in a mesh file.
#[derive(Clone, Debug)]
pub(super) struct Flaw {
    /// The number of the line with the mistake, if it is known.
    line: Option<usize>,
    /// The description of the mistake.
    what: String,
    /// The description of the mistake without text of the file; `None` if `what` quotes nothing from the
    /// file.
    unquoted: Option<String>,
    /// The remedy in the help of an error that shows `what`. The help of an error that shows `unquoted` is
    /// `OUTSIDE`.
    remedy: &'static str,
}

impl Flaw {
    /// Returns a `Flaw` whose description `what` quotes the file. `unquoted` describes the same mistake
    /// without text of the file.
    pub fn quoting(what: impl Into<String>, unquoted: impl Into<String>) -> Self {
        Self { unquoted: Some(unquoted.into()), ..Self::from(what) }
    }

    /// Returns a `Flaw` with a token of the file that is not a valid number. `what` follows the token in the description
    /// that quotes the file; `unquoted` is the other description.
    pub fn not_a_number(token: &[u8], what: &str, unquoted: impl Into<String>) -> Self {
        let flaw = Self::quoting(format!("{}{what}", quoted_number(token)), unquoted);
        if has_decimal_comma(token) { flaw.with_remedy(POINTS) } else { flaw }
    }

    /// Sets the number of the line that contains the mistake.
    pub fn at(self, line: usize) -> Self {
        Self { line: Some(line), ..self }
    }

    /// Puts the name of the part of the file that contains the mistake before the description.
    pub fn within(self, part: &str) -> Self {
        let named = |what: String| format!("{part}: {what}");
        Self { what: named(self.what), unquoted: self.unquoted.map(named), ..self }
    }

    /// Replaces the default remedy, which says that the file may be cut off or damaged.
    pub fn with_remedy(self, remedy: &'static str) -> Self {
        Self { remedy, ..self }
    }
}

/// Makes a `Flaw` whose description quotes no text from the file. The description may contain counts, indices and
/// offsets, which are no quotations.
impl<T: Into<String>> From<T> for Flaw {
    fn from(what: T) -> Self {
        Self { line: None, what: what.into(), unquoted: None, remedy: EXPORT }
    }
}

/// The name of a mesh file for errors and notes, with the permission to quote the file.
#[derive(Clone, Copy)]
pub(super) struct Named<'a> {
    pub name: &'a str,
    /// True if errors and notes may quote the file.
    pub quotes: bool,
}

impl Named<'_> {
    /// Returns the error that reports a mistake: its location and its description. The description quotes the file only
    /// if `quotes` is true.
    pub fn error(&self, flaw: impl Into<Flaw>) -> Error {
        let Flaw { line, what, unquoted, remedy } = flaw.into();
        let location = line.map_or_else(|| self.name.to_owned(), |line| format!("{}:{line}", self.name));
        match unquoted.filter(|_| !self.quotes) {
            Some(unquoted) => Error::input(format!("{location}: {unquoted}")).with_help(OUTSIDE),
            None => Error::input(format!("{location}: {what}")).with_help(remedy),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_with_a_decimal_comma_has_a_remedy_of_its_own() {
        let error = |token: &[u8], quotes| {
            Named { name: "a", quotes }.error(Flaw::not_a_number(token, "; expected a number", "no number"))
        };
        let comma = error(b"0,5", true);
        assert_eq!(comma.to_string(), "a: `0,5` (a comma instead of a decimal point); expected a number");
        assert_eq!([comma.remedy(), error(b"x", true).remedy()], [POINTS, EXPORT]);
        assert_eq!([error(b"0,5", false).to_string(), error(b"x", false).to_string()], ["a: no number"; 2]);
    }

    #[test]
    fn a_mistake_is_quoted_only_where_that_is_permitted_and_reported_in_any_case() {
        let errors = |flaw: Flaw| [true, false].map(|quotes| Named { name: "a", quotes }.error(flaw.clone()));
        let [shown, withheld] = errors(Flaw::quoting("`x` is wrong", "a word is wrong").at(7));
        assert_eq!([shown.to_string(), withheld.to_string()], ["a:7: `x` is wrong", "a:7: a word is wrong"]);
        assert_eq!([shown.remedy(), withheld.remedy()], [EXPORT, OUTSIDE]);
        let [shown, withheld] = errors(Flaw::quoting("`x` is wrong", "a word is wrong").within("node 2"));
        let expected = ["a: node 2: `x` is wrong", "a: node 2: a word is wrong"];
        assert_eq!([shown.to_string(), withheld.to_string()], expected);
        let [shown, withheld] = errors(Flaw::from("it is too large"));
        assert_eq!([shown.to_string(), withheld.to_string()], ["a: it is too large"; 2]);
        assert_eq!([shown.remedy(), withheld.remedy()], [EXPORT; 2]);
        let [shown, withheld] = errors(Flaw::from("it is too large").with_remedy("make it smaller"));
        assert_eq!([shown.remedy(), withheld.remedy()], ["make it smaller"; 2]);
    }
}
