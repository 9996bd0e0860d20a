//! Errors of the `toml` crate, with their location and the most similar valid name.

use crate::error::{Error, nearest};

/// Returns the part of serde's message that states which value was expected. This part contains no text of the
/// document. `None` if the message has no such part.
pub fn expectation(error: &toml::de::Error) -> Option<&str> {
    let message = error.message();
    let told = ["invalid type: ", "invalid value: ", "invalid length ", "unknown field ", "unknown variant "];
    let told = told.iter().any(|start| message.starts_with(start));
    told.then(|| message.rsplit_once(", expected ")).flatten().map(|(_, expected)| expected.trim_end())
}

/// Returns the error for a document that cannot be parsed, with the location of the mistake. `help` is the
/// remedy unless a name was misspelt.
pub fn toml_error(name: &str, text: &str, error: &toml::de::Error, help: &str) -> Error {
    let span = error.span().unwrap_or(0..0);
    let message = error.message().trim_end().to_owned();
    // serde's message for a key is: unknown field `a`, expected one of `b`, `c`. serde's message for a value begins
    // with: unknown variant `a`, expected ...
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let what = [("unknown field", "key", "keys"), ("unknown variant", "value", "values")]
        .into_iter()
        .find(|(start, ..)| message.starts_with(start));
    match (&quoted[..], what) {
        ([key, known @ ..], Some((_, one, all))) => {
            let meant = nearest(key, known.iter().copied());
            let suggestion = meant.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default();
            let label = format!("not a {one} here");
            Error::in_file(name, text, span, format!("unknown {one} `{key}`{suggestion}"), label)
                .with_help(format!("the valid {all} here are {}", known.join(", ")))
        }
        _ => Error::in_file(name, text, span, in_plain_words(&message), "here").with_help(help),
    }
}

/// Returns serde's message, with TOML's words instead of serde's names for types.
fn in_plain_words(message: &str) -> String {
    let message = message.replace("invalid type: ", "wrong type: ");
    // serde writes the name of a Rust type after these words.
    match message.split_once("expected struct ") {
        Some((before, _)) => format!("{before}expected a table"),
        None => message,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_no_types_of_rust() {
        let plain = in_plain_words("invalid type: integer `3`, expected struct SkyWire");
        assert_eq!(plain, "wrong type: integer `3`, expected a table");
        assert_eq!(
            in_plain_words("invalid type: string \"a\", expected f64"),
            "wrong type: string \"a\", expected f64"
        );
    }
}
