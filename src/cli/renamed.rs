//! Recognises old names of commands and options on the command line, and names that other programs use. The error
//! message then suggests raycl's name.

use super::Cli;
use super::guesses::with_tip;
use clap::CommandFactory as _;
use clap::error::{ContextKind, ContextValue};

/// For each renamed word, three elements. The first is the context in which clap (the library that parses the
/// arguments) reports the old word. The second is the old word, and the third contains the new words, in backticks. If
/// the new words are several options, a command has either all of these options or none.
const RENAMED: [(ContextKind, &str, &str); 3] = [
    (ContextKind::InvalidSubcommand, "limits", "`raycl peak`"),
    (ContextKind::InvalidArg, "--limits", "`--peak`"),
    (ContextKind::InvalidArg, "--size", "`--width` and `--height`"),
];

/// Returns the error of clap (the library that parses the arguments). If the user typed an old name, the error suggests
/// the new name, unless the new name is an option that the subcommand does not have.
pub fn explain(error: clap::Error) -> clap::Error {
    let typed = |kind, old: &str| match error.get(kind) {
        Some(ContextValue::String(word)) => word.split('=').next() == Some(old),
        _ => false,
    };
    let Some((_, _, new)) = RENAMED.iter().find(|(kind, old, _)| typed(*kind, old)) else { return error };
    let option = new.strip_prefix("`--").and_then(|options| options.split('`').next());
    if option.is_some_and(|option| !has_option(&error, option)) {
        return error;
    }
    with_tip(error, format!("did you mean {new}?"))
}

/// Returns true if the subcommand in the error's usage line has the option `option`.
fn has_option(error: &clap::Error, option: &str) -> bool {
    let Some(ContextValue::StyledStr(usage)) = error.get(ContextKind::Usage) else { return false };
    let (usage, command) = (usage.to_string(), Cli::command());
    let is_shown = |name: &str| usage.split_whitespace().any(|word| word == name);
    let shown = command.get_subcommands().find(|subcommand| is_shown(subcommand.get_name()));
    shown.is_some_and(|subcommand| subcommand.get_arguments().any(|own| own.get_long() == Some(option)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    #[test]
    fn an_old_word_is_answered_with_the_new_one() {
        for (words, new) in [
            (vec!["raycl", "limits", "--device", "cpu"], "did you mean `raycl peak`?"),
            (vec!["raycl", "run", "a.toml", "--limits"], "did you mean `--peak`?"),
            (vec!["raycl", "run", "a.toml", "--limits=limits.json"], "did you mean `--peak`?"),
            (vec!["raycl", "render", "a.toml", "--size", "64x40"], "did you mean `--width` and `--height`?"),
        ] {
            let error = explain(Cli::try_parse_from(&words).expect_err("an old word"));
            assert_eq!(error.exit_code(), 2);
            assert_eq!(error.to_string().matches("tip:").count(), 1, "{error}");
            assert!(error.to_string().contains(new), "{error}");
        }
        // `--limits` is an old name of `--peak`. If a command has no option `--peak`, the error does not
        // suggest `--peak`.
        let other =
            explain(Cli::try_parse_from(["raycl", "render", "a.toml", "--limits"]).expect_err("no option"));
        assert!(!other.to_string().contains("--peak"), "{other}");
        let other = explain(Cli::try_parse_from(["raycl", "devices", "--size"]).expect_err("no option"));
        assert!(!other.to_string().contains("--width"), "{other}");
        let other = explain(Cli::try_parse_from(["raycl", "peek"]).expect_err("a misspelt word"));
        assert!(other.to_string().contains("'peak'"), "{other}");
    }
}
