//! The keys of the option `--set` of `raycl render` and `raycl view`: axes of the strategy, and keys of the scene.

use crate::cli::Cli;
use crate::error::{Error, Result, meant};
use crate::scene;
use crate::strategy::AXES;
use crate::words::quote;
use clap::CommandFactory as _;

/// Returns true if `key` is the name of a strategy's axis, such as `width`.
pub fn is_axis(key: &str) -> bool {
    AXES.iter().any(|axis| axis.name == key)
}

/// Returns an error if `key`, a key of `--set`, is the name of an option that both `render` and `view` have, such as
/// `local_size`, and is not a key of a scene. The error's advice is the option, such as `--local-size 8`. The advice
/// includes the value if the option takes a value.
pub fn refuse_option(key: &str, value: &str) -> Result<()> {
    let (all, name) = (Cli::command(), key.replace('_', "-"));
    let of = |command: &str| {
        let mut options = all.find_subcommand(command)?.get_arguments();
        options.find(|option| option.get_long() == Some(&*name))
    };
    let (Some(option), Some(_)) = (of("render"), of("view")) else { return Ok(()) };
    // `background`, for example, is both an option and a key of a scene.
    if scene::schema()["properties"].get(key).is_some() {
        return Ok(());
    }
    let value = if option.get_action().takes_values() { format!(" {}", quote(value)) } else { String::new() };
    Err(no_key(key).with_help(format!("{key} is an option: --{name}{value}")))
}

/// Returns the error for a key of `--set` that is neither an axis nor a key of a scene.
fn no_key(key: &str) -> Error {
    Error::input(format!("--set {key}: '{key}' is neither an axis of the strategy nor a key of the scene"))
}

/// Returns an error if `key`, a key of `--set`, resembles the name of a strategy's axis; the error suggests
/// this axis. No valid key of a scene resembles the name of an axis.
pub fn refuse_misspelt_axis(key: &str) -> Result<()> {
    let names: Vec<_> = AXES.iter().map(|axis| axis.name).collect();
    match meant(key, names.iter().copied()) {
        Some(meant) => Err(no_key(key).with_help(format!("{meant} the axes are {}", names.join(", ")))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_axis_is_distinguished_from_a_key_of_the_scene() {
        for key in ["wdith", "vectros", "layuot"] {
            assert!(refuse_misspelt_axis(key).is_err(), "{key}");
        }
        let keys = ["name", "camera.z_near", "object.0.triangles", "light.0.power", "background"];
        for key in keys.into_iter().chain(["shadow_bias", "display.gamma", "light", "object", "display"]) {
            assert!(refuse_misspelt_axis(key).is_ok(), "{key}");
        }
    }

    #[test]
    fn a_key_that_is_an_option_is_answered_with_the_option() {
        for (key, value, option) in [
            ("local_size", "8", "--local-size 8"),
            ("strategy", "wide", "--strategy wide"),
            ("samples", "4", "--samples 4"),
            ("device", "Tesla T4", "--device 'Tesla T4'"),
            ("plain", "true", "--plain"),
        ] {
            let error = refuse_option(key, value).expect_err(key);
            assert_eq!((error.exit_code(), error.remedy()), (2, &*format!("{key} is an option: {option}")));
        }
        // `background`, `two_sided` and `crease` are names of options, but also keys of a scene.
        for key in ["background", "two_sided", "crease", "name", "camera.up", "object.0.seed", "wdith"] {
            assert!(refuse_option(key, "1").is_ok(), "{key}");
        }
    }
}
