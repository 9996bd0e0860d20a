//! Removes two kinds of guesses of clap (the library that parses the arguments) that do not help: names of hidden
//! commands, and the advice to put `--` before an unknown option. If a file stands in place of a command, the error
//! suggests the command that reads this file. If an unknown option is named like a key of a scene or a config, the
//! error suggests `--set`.

use super::Cli;
use super::keys_as_options::suggest_set;
use crate::filetype::experiment_instead;
use crate::reader;
use crate::words::{path_word, quote};
use clap::CommandFactory as _;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::ffi::OsString;
use std::path::Path;

/// Returns clap's error for the arguments `words` without guesses that do not help. If a file stands in place of a
/// command, the error suggests the command that reads this file.
pub fn explain(error: clap::Error, words: &[OsString]) -> clap::Error {
    match error.kind() {
        ErrorKind::InvalidSubcommand => without_hidden_commands(with_command_of_file(error, words)),
        ErrorKind::UnknownArgument => suggest_set(without_double_dash(error), words),
        _ => error,
    }
}

/// Returns the error with `tip` in place of clap's guesses.
pub fn with_tip(mut error: clap::Error, tip: String) -> clap::Error {
    for guessed in [ContextKind::SuggestedSubcommand, ContextKind::SuggestedArg] {
        error.remove(guessed);
    }
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(tip)]));
    error
}

/// If the unknown command is the path of a file, returns the error with the command that reads this file. If a command
/// such as `cache` stands before the path, the user means that command, which reads no file; the error is then returned
/// unchanged.
fn with_command_of_file(error: clap::Error, words: &[OsString]) -> clap::Error {
    let cli = Cli::command();
    let command = match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(word)) => {
            let mut before = words.iter().skip(1).take_while(|other| *other != word.as_str());
            let is_first = !before.any(|other| cli.find_subcommand(other).is_some());
            is_first.then(|| command_of(Path::new(word))).flatten()
        }
        _ => None,
    };
    match command {
        Some(command) => with_tip(error, format!("did you mean `{command}`?")),
        None => error,
    }
}

/// Returns the command that reads the file; `None` if there is no such file.
fn command_of(path: &Path) -> Option<String> {
    // Only TOML files are read here, since a mesh may be large.
    let is_toml = || path.extension().is_some_and(|extension| extension == "toml");
    let is_experiment = |text: String| experiment_instead(path, &text).is_some();
    path.is_file().then(|| {
        let runs = is_toml() && reader::text(path, reader::Kind::Toml).is_ok_and(is_experiment);
        format!("raycl {} {}", if runs { "run" } else { "render" }, quote(&path_word(path)))
    })
}

/// Returns the error without guesses that name hidden commands. A word with a slash or a dot is a path rather than a
/// misspelt command, so no command is suggested for it.
fn without_hidden_commands(mut error: clap::Error) -> clap::Error {
    let is_path = match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(word)) => word.contains(['/', '.']),
        _ => false,
    };
    let Some(ContextValue::Strings(guessed)) = error.remove(ContextKind::SuggestedSubcommand) else {
        return error;
    };
    let cli = Cli::command();
    let is_hidden = |name: &String| cli.find_subcommand(name).is_some_and(clap::Command::is_hide_set);
    let shown: Vec<String> = guessed.into_iter().filter(|name| !is_path && !is_hidden(name)).collect();
    if !shown.is_empty() {
        error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(shown));
    }
    error
}

/// Returns the error without clap's advice to put `--` before an unknown option. With `--`, the option would count as a
/// value, such as the path of a scene, but hardly any user means this.
fn without_double_dash(mut error: clap::Error) -> clap::Error {
    let has_dashes = match error.get(ContextKind::Suggested) {
        Some(ContextValue::StyledStrs(tips)) => tips.iter().any(|tip| tip.to_string().contains("use '-- ")),
        _ => false,
    };
    if has_dashes {
        error.remove(ContextKind::Suggested);
    }
    error
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use clap::Parser as _;

    fn message(words: &[&str]) -> String {
        let words: Vec<OsString> = ["raycl"].iter().chain(words).map(OsString::from).collect();
        explain(Cli::try_parse_from(&words).expect_err("a mistake"), &words).to_string()
    }

    #[test]
    fn a_file_in_place_of_a_command_is_answered_with_the_command_that_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text, command) in [
            ("a.obj", "v 0 0 0\n", "render"),
            ("scene.toml", "[[object]]\nshape = \"sphere\"\n", "render"),
            ("config.toml", "scenes = [\"scene.toml\"]\n", "run"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            let word = path.to_str().unwrap();
            let said = message(&[word]);
            let tip = format!("did you mean `raycl {command} {}`?", quote(word));
            assert!(said.contains(&tip), "{said}");
            let said = message(&["cache", word]);
            assert!(said.contains("unrecognized subcommand") && !said.contains("did you mean"), "{said}");
        }
        let missing = folder.path().join("b.obj");
        for missing in [missing.to_str().unwrap(), "/tmp/man", "man.obj"] {
            let said = message(&[missing]);
            assert!(said.contains("unrecognized subcommand") && !said.contains("tip:"), "{said}");
        }
    }

    #[test]
    fn neither_a_hidden_command_nor_dashes_before_an_option_are_suggested() {
        let hidden = message(&["figure"]);
        assert!(hidden.contains("'figure'") && !hidden.contains("figures"), "{hidden}");
        let shown = message(&["rendr"]);
        assert!(shown.contains("'render'"), "{shown}");
        let option = message(&["render", "a.toml", "--zzzzzz"]);
        assert!(option.contains("'--zzzzzz'") && !option.contains("-- --zzzzzz"), "{option}");
    }
}
