//! Adds advice to errors of clap (the library that parses the arguments) in three cases. First, the user wrote a
//! strategy or a value of `--set` with blanks, such as `--strategy deferred, width=4`. Second, the user wrote a blank
//! after an option that needs `=`. Third, a shell took a colour for a comment, because the colour begins with `#` and
//! is not in quotes.

use super::Cli;
use super::guesses::with_tip;
use crate::words::quote;
use clap::CommandFactory as _;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::ffi::OsString;

/// The option whose value is the strategy.
const STRATEGY: &str = "--strategy";
/// The option whose value may be a list or a table, in TOML.
const SET: &str = "--set";

/// Returns the error of clap for the arguments `words`. If the shell split or cut a value, the error says how to write
/// the value.
pub fn explain(error: clap::Error, words: &[OsString]) -> clap::Error {
    let tip = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(option)) if is_without_value(&error) => cut_colour(option),
        Some(ContextValue::String(unexpected)) => strategy(unexpected, words)
            .or_else(|| set(unexpected, words))
            .or_else(|| after_blank(unexpected, words)),
        _ => None,
    };
    match tip {
        Some(tip) => with_tip(error, tip),
        None => error,
    }
}

/// Returns true if the error says that an option has no value.
fn is_without_value(error: &clap::Error) -> bool {
    let value = error.get(ContextKind::InvalidValue);
    error.kind() == ErrorKind::InvalidValue
        && matches!(value, Some(ContextValue::String(value)) if value.is_empty())
}

/// Returns the tip about a colour that begins with `#` and is not in quotes: the shell does not pass such a colour on.
/// Returns `None` if `option` takes no colour.
fn cut_colour(option: &str) -> Option<String> {
    option
        .starts_with("--background")
        .then(|| "put a colour that begins with # in quotes: '#203040'".to_owned())
}

/// Returns the tip with the strategy without blanks; `None` if the word `unexpected` does not belong to a strategy.
fn strategy(unexpected: &str, words: &[OsString]) -> Option<String> {
    let (value, at) = split_value(STRATEGY, unexpected, words)?;
    // A comma before or after a blank shows that the strategy continues after the blank.
    let goes_on = |pair: &&[&str]| matches!(pair, [one, next] if one.ends_with(',') || next.starts_with(','));
    let last = value.windows(2).take_while(goes_on).count();
    let joined = || value.iter().take(last + 1).copied().collect::<String>();
    (last > 0 && last >= at).then(|| format!("write the strategy without blanks: {}", joined()))
}

/// Returns the tip with the quoted value of `--set`; `None` if the word `unexpected` does not belong to such a value.
fn set(unexpected: &str, words: &[OsString]) -> Option<String> {
    let (value, at) = split_value(SET, unexpected, words)?;
    let open = value.iter().scan(0, |open, word| {
        *open += brackets(word);
        Some(*open)
    });
    // The value ends with the word that closes the last bracket.
    let last = open.take_while(|open| *open > 0).count();
    let is_split = last >= at && last < value.len();
    is_split.then(|| format!("quote the value for the shell: {SET} {}", quote(&value[..=last].join(" "))))
}

/// Returns the number of brackets that `word` opens, less the number of brackets that it closes.
fn brackets(word: &str) -> i64 {
    let change = |c| match c {
        '[' | '{' => 1_i64,
        ']' | '}' => -1,
        _ => 0,
    };
    word.chars().map(change).sum()
}

/// Finds the last option `option` before the word `unexpected`. Returns all words from this option's value on, and the
/// position of the word `unexpected` among these words. Returns `None` if there is no such option.
fn split_value<'a>(option: &str, unexpected: &str, words: &'a [OsString]) -> Option<(Vec<&'a str>, usize)> {
    let words: Vec<&str> = words.iter().filter_map(|word| word.to_str()).collect();
    // If a word begins with a single `-`, such as `-1,`, clap names only its first two characters: `-1`.
    let is_short = unexpected.starts_with('-') && !unexpected.starts_with("--");
    let is_unexpected = |word: &&str| *word == unexpected || (is_short && word.starts_with(unexpected));
    let at = words.iter().position(is_unexpected)?;
    let start = words.get(..at)?.iter().rposition(|word| word.starts_with(option))?;
    let rest = words.get(start + 1..)?.iter().copied();
    // The value's first word is the word after the option, or the text after `=` in the same word.
    Some(match words.get(start)?.strip_prefix(option)?.strip_prefix('=') {
        Some(first) => (std::iter::once(first).chain(rest).collect(), at - start),
        None => (rest.collect(), at - start - 1),
    })
}

/// Returns the tip for an option that needs `=` before its value, but is followed by a blank. Returns `None` in two
/// cases: the arguments would still be wrong with `=` in place of the blank, or the word `unexpected` does not follow
/// such an option.
fn after_blank(unexpected: &str, words: &[OsString]) -> Option<String> {
    let at = words.iter().position(|word| word.to_str() == Some(unexpected))?;
    let (option, value) = (0..at).rev().find_map(|option| {
        let [name, value] = [words.get(option)?.to_str()?, words.get(option + 1)?.to_str()?];
        let fixed =
            [words.get(..option)?, &[OsString::from(format!("{name}={value}"))], words.get(option + 2..)?]
                .concat();
        (needs_equals(name, words) && Cli::parse_words(&fixed).is_ok()).then_some((name, value))
    })?;
    Some(format!("write the value with '=': {option}={}", quote(value)))
}

/// Returns true if the command in `words` has the option `option`, and the option's value must follow `=`.
fn needs_equals(option: &str, words: &[OsString]) -> bool {
    let cli = Cli::command();
    let command = words.iter().skip(1).find_map(|word| cli.find_subcommand(word));
    let name = option.strip_prefix("--");
    name.is_some()
        && command.is_some_and(|command| {
            command.get_arguments().any(|own| own.get_long() == name && own.is_require_equals_set())
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    fn message(line: &str) -> String {
        let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        explain(Cli::try_parse_from(&words).expect_err("a mistake"), &words).to_string()
    }

    #[test]
    fn a_strategy_with_blanks_is_answered_with_the_strategy_without_blanks() {
        for (line, joined) in [
            ("raycl render a.toml --strategy naive, epsilons=paper", "naive,epsilons=paper"),
            ("raycl render a.toml --strategy naive ,epsilons=paper --verify", "naive,epsilons=paper"),
            ("raycl render a.toml --strategy=naive, epsilons=paper", "naive,epsilons=paper"),
            (
                "raycl compile a.toml --strategy bvh --strategy naive, width=4, math=fast",
                "naive,width=4,math=fast",
            ),
        ] {
            let said = message(line);
            assert!(said.contains(&format!("write the strategy without blanks: {joined}")), "{said}");
        }
        for line in
            ["raycl render a.toml --strategy naive width=4", "raycl render a.toml b.toml --strategy naive"]
        {
            let said = message(line);
            assert!(said.contains("unexpected argument") && !said.contains("blanks"), "{said}");
        }
    }

    #[test]
    fn a_value_of_set_with_blanks_is_answered_with_quotes() {
        for (line, quoted) in [
            ("raycl render a.toml --set camera.position=[0, 1, 1] --verify", "'camera.position=[0, 1, 1]'"),
            ("raycl view a.toml --set camera.position=[0, -1, 1]", "'camera.position=[0, -1, 1]'"),
            ("raycl run a.toml --set=image_sizes=[[800, 500]]", "'image_sizes=[[800, 500]]'"),
            ("raycl run a.toml --set a=1 --set scene=[{ file", ""),
            ("raycl render a.toml b.toml --set samples=[1]", ""),
            ("raycl render a.toml --set samples=[1] b.toml", ""),
        ] {
            let said = message(line);
            let tip = format!("quote the value for the shell: --set {quoted}");
            assert_eq!(said.contains(&tip), !quoted.is_empty(), "{said}");
        }
    }

    #[test]
    fn a_value_after_a_blank_instead_of_an_equals_sign_is_answered_with_the_sign() {
        for (line, meant) in [
            ("raycl render a.obj --verify 100", "--verify=100"),
            ("raycl render --verify 100 a.obj", "--verify=100"),
            ("raycl run a.toml --peak p.json", "--peak=p.json"),
            ("raycl run --peak p.json a.toml", "--peak=p.json"),
            ("raycl view a.obj --terminal kitty", "--terminal=kitty"),
        ] {
            let said = message(line);
            assert!(said.contains(&format!("write the value with '=': {meant}\n")), "{said}");
        }
        for line in ["raycl render a.obj --verify b.obj", "raycl render a.obj b.obj --verify"] {
            let said = message(line);
            assert!(said.contains("'b.obj'") && !said.contains("with '='"), "{said}");
        }
    }

    #[test]
    fn a_colour_that_the_shell_took_for_a_comment_is_answered_with_quotes() {
        for line in ["raycl render a.obj --background", "raycl view a.obj --background --plain"] {
            let said = message(line);
            assert!(said.contains("put a colour that begins with # in quotes: '#203040'"), "{said}");
        }
        let other = message("raycl render a.obj --exposure");
        assert!(!other.contains("colour"), "{other}");
    }
}
