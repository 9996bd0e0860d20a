//! `--color`: whether what raycl prints has colours. The option decides, else `NO_COLOR` (<https://no-color.org>), else the user's
//! settings, else whether somebody reads it at a terminal.

use clap::ColorChoice;
use std::ffi::OsString;
use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicU8, Ordering};

/// When to use colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Colour {
    /// On a terminal.
    Auto,
    /// Always, in files and pipes too.
    Always,
    /// Never.
    Never,
}

/// What [`choose`] was given: 0 for nothing and for `auto`.
static CHOSEN: AtomicU8 = AtomicU8::new(0);

/// Decides for the rest of the process: by the option, else the environment, else the setting.
pub fn choose(option: Option<Colour>, setting: Option<Colour>) {
    let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let code = match option.or(refused.then_some(Colour::Never)).or(setting) {
        Some(Colour::Always) => 1,
        Some(Colour::Never) => 2,
        None | Some(Colour::Auto) => 0,
    };
    CHOSEN.store(code, Ordering::Relaxed);
}

/// Whether the user said always or never; none where each stream decides for itself.
pub fn told() -> Option<bool> {
    match CHOSEN.load(Ordering::Relaxed) {
        1 => Some(true),
        2 => Some(false),
        _ => None,
    }
}

/// Whether standard output gets colours.
pub fn on_output() -> bool {
    let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    told().unwrap_or_else(|| std::io::stdout().is_terminal() && !dumb)
}

/// The same for clap's help and messages.
pub(super) fn of_clap() -> ColorChoice {
    told()
        .map_or(ColorChoice::Auto, |coloured| if coloured { ColorChoice::Always } else { ColorChoice::Never })
}

/// The last `--color` among the process's words, before anything is known of the others.
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
}
