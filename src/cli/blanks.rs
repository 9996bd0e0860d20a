//! Recognises a strategy that the user wrote with blanks, such as `--strategy deferred, width=4`. A shell
//! passes a strategy with blanks as several words, and clap (the library that parses the arguments) does not
//! expect the strategy's second word.

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue};
use std::ffi::OsString;

/// The option whose value is the strategy.
const OPTION: &str = "--strategy";

/// Returns the error of clap for the arguments `words`. If the unexpected word belongs to a strategy that was written
/// with blanks, the error suggests the strategy without blanks.
pub fn explain(mut error: clap::Error, words: &[OsString]) -> clap::Error {
    let joined = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(unexpected)) => joined(unexpected, words),
        _ => None,
    };
    if let Some(joined) = joined {
        let tip = StyledStr::from(format!("write the strategy without blanks: {joined}"));
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
    }
    error
}

/// Returns the strategy without blanks; `None` if the word `unexpected` does not belong to a strategy.
fn joined(unexpected: &str, words: &[OsString]) -> Option<String> {
    let words: Vec<&str> = words.iter().filter_map(|word| word.to_str()).collect();
    let at = words.iter().position(|word| *word == unexpected)?;
    let before = words.get(..at)?;
    let option = before.iter().rposition(|word| word.starts_with(OPTION))?;
    // The strategy's first word is the word after `--strategy`, or the text after `--strategy=` in the same
    // word.
    let (start, first) = match words.get(option)?.strip_prefix(OPTION)?.strip_prefix('=') {
        Some(first) => (option, first),
        None => (option + 1, *words.get(option + 1)?),
    };
    let strategy: Vec<&str> = std::iter::once(first).chain(words.iter().skip(start + 1).copied()).collect();
    // A comma before or after a blank shows that the strategy continues after the blank.
    let goes_on = |pair: &&[&str]| matches!(pair, [one, next] if one.ends_with(',') || next.starts_with(','));
    let last = strategy.windows(2).take_while(goes_on).count();
    (last > 0 && start + last >= at).then(|| strategy.iter().take(last + 1).copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::Parser as _;

    #[test]
    fn a_strategy_with_blanks_is_answered_with_the_strategy_without_blanks() {
        let message = |line: &str| {
            let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
            explain(Cli::try_parse_from(&words).expect_err("a mistake"), &words).to_string()
        };
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
}
