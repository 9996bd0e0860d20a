//! What `toml` found wrong, with its place and the nearest right name.

use crate::error::{Error, nearest};

/// The error for a document that does not parse, shown where it is wrong.
pub(super) fn toml_error(name: &str, text: &str, error: &toml::de::Error) -> Error {
    let span = error.span().unwrap_or(0..0);
    let message = error.message().trim_end().to_owned();
    // serde says: unknown field `a`, expected one of `b`, `c`
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match quoted[..] {
        [key, ref known @ ..] if message.starts_with("unknown field") => {
            let meant = nearest(key, known.iter().copied());
            let suggestion = meant.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default();
            Error::in_file(name, text, span, format!("unknown key `{key}`{suggestion}"), "not a key here")
                .with_help(format!("the keys here are {}", known.join(", ")))
        }
        _ => Error::in_file(name, text, span, message.replace("invalid type: ", "wrong type: "), "here")
            .with_help("docs/scenes.md has every key of a scene, with its type"),
    }
}
