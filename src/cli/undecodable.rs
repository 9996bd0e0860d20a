//! Names the arguments that are not UTF-8 in the error of clap (the library that parses the arguments), whose own
//! message does not name them.

use super::guesses::with_tip;
use crate::printer::line;
use clap::error::ErrorKind;
use std::ffi::OsString;

/// Returns clap's error for the arguments `words`. If an argument had to be UTF-8 but is not, the error has a tip with
/// all arguments that are not UTF-8.
pub fn explain(error: clap::Error, words: &[OsString]) -> clap::Error {
    if error.kind() != ErrorKind::InvalidUtf8 {
        return error;
    }
    let wrong = words.iter().filter(|word| word.to_str().is_none());
    let wrong: Vec<String> = wrong.map(|word| format!("'{}'", line(&word.to_string_lossy()))).collect();
    with_tip(error, format!("arguments other than paths must be UTF-8; not UTF-8: {}", wrong.join(", ")))
}

#[cfg(all(test, unix))]
mod tests {
    use super::super::Cli;
    use super::*;
    use std::os::unix::ffi::OsStringExt as _;

    #[test]
    fn a_word_that_is_not_utf_8_is_named() {
        let wrong = OsString::from_vec(b"width=\xff".to_vec());
        let words = ["raycl", "render", "a.toml", "--strategy"].map(OsString::from);
        let words: Vec<OsString> = words.into_iter().chain([wrong]).collect();
        let error = explain(Cli::parse_words(&words).expect_err("a mistake"), &words);
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("not UTF-8: 'width=\u{fffd}'"), "{error}");
    }

    #[test]
    fn a_path_that_is_not_utf_8_is_not_named_in_an_error_about_another_word() {
        let path = OsString::from_vec(b"\xff.toml".to_vec());
        let words = ["raycl", "render"].map(OsString::from).into_iter();
        let words: Vec<OsString> = words.chain([path, "--nonsense".into()]).collect();
        let error = explain(Cli::parse_words(&words).expect_err("a mistake"), &words);
        assert!(!error.to_string().contains("not UTF-8"), "{error}");
    }
}
