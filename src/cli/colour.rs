//! `--color`: when raycl prints in colour. The option takes precedence over the environment variable
//! `NO_COLOR` (<https://no-color.org>), and `NO_COLOR` takes precedence over the user's settings. If neither
//! the option, nor `NO_COLOR`, nor the settings decide, raycl prints in colour if the output is a terminal
//! and the variable `TERM` is not `dumb`.

use clap::ColorChoice;
use std::ffi::OsString;
use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicU8, Ordering};

/// When to use colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Colour {
    /// Use colours if the output goes to a terminal and the variable `TERM` is not `dumb`.
    Auto,
    /// Always use colours, also in files and pipes.
    Always,
    /// Never use colours.
    Never,
}

/// The choice made by [`choose`]: 1 means `always`, 2 means `never`, and 0 means `auto`, or that nothing was chosen.
static CHOSEN: AtomicU8 = AtomicU8::new(0);

/// Decides for the whole process when colours are used. The option `--color` takes precedence over the environment
/// variable `NO_COLOR` (an empty value does not count), and `NO_COLOR` takes precedence over the user's settings.
pub fn choose(option: Option<Colour>, setting: Option<Colour>) {
    let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let code = match preferred(option, refused, setting) {
        Some(Colour::Always) => 1,
        Some(Colour::Never) => 2,
        None | Some(Colour::Auto) => 0,
    };
    CHOSEN.store(code, Ordering::Relaxed);
}

/// Returns the choice of colours that takes precedence. `refused` is true if `NO_COLOR` is set and not empty.
fn preferred(option: Option<Colour>, refused: bool, setting: Option<Colour>) -> Option<Colour> {
    option.or(refused.then_some(Colour::Never)).or(setting)
}

/// Returns true if the user chose `always` and false if the user chose `never`; `None` if colours depend on the output.
pub fn chosen() -> Option<bool> {
    match CHOSEN.load(Ordering::Relaxed) {
        1 => Some(true),
        2 => Some(false),
        _ => None,
    }
}

/// Returns true if raycl prints in colour to standard output.
pub fn on_output() -> bool {
    let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    chosen().unwrap_or_else(|| std::io::stdout().is_terminal() && !dumb)
}

/// Returns the choice of colour for the texts that clap (the library that parses the arguments) prints: the
/// help and messages about mistakes.
pub(super) fn of_clap() -> ColorChoice {
    chosen()
        .map_or(ColorChoice::Auto, |coloured| if coloured { ColorChoice::Always } else { ColorChoice::Never })
}

/// Returns the last valid value of `--color` on the command line. The value also applies to messages about
/// mistakes in the arguments, so raycl needs the value of `--color` before it parses the arguments.
pub(super) fn typed(words: &[OsString]) -> Option<Colour> {
    let mut words =
        words.iter().map(|word| word.to_str().unwrap_or_default()).take_while(|word| *word != "--");
    let mut last = None;
    while let Some(word) = words.next() {
        let value = match word {
            "--color" => words.next(),
            _ => word.strip_prefix("--color="),
        };
        last = value.and_then(|value| clap::ValueEnum::from_str(value, false).ok()).or(last);
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_word_counts_and_what_follows_two_dashes_does_not() {
        let typed = |line: &str| typed(&line.split(' ').map(OsString::from).collect::<Vec<_>>());
        assert_eq!(typed("raycl run a.toml"), None);
        assert_eq!(typed("raycl run --color never a.toml"), Some(Colour::Never));
        assert_eq!(typed("raycl --color=auto run --color=always"), Some(Colour::Always));
        assert_eq!(typed("raycl run --color=sometimes"), None);
        assert_eq!(typed("raycl run -- --color=always"), None);
    }

    #[test]
    fn the_option_counts_before_the_variable_and_the_variable_before_the_setting() {
        let (auto, always) = (Some(Colour::Auto), Some(Colour::Always));
        assert_eq!([preferred(always, true, auto), preferred(always, false, auto)], [always; 2]);
        assert_eq!([preferred(None, true, always), preferred(None, true, None)], [Some(Colour::Never); 2]);
        assert_eq!([preferred(None, false, always), preferred(None, false, None)], [always, None]);
    }
}
