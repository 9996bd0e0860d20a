//! Suggests `--set KEY=VALUE` for an unknown option that has the name of a key of the command's scene or config.

use super::Cli;
use super::guesses::with_tip;
use crate::{config, scene};
use clap::CommandFactory as _;
use clap::error::{ContextKind, ContextValue};
use serde_json::Value;
use std::ffi::OsString;

/// Returns clap's error on an unknown option in the arguments `words`. If the option is named like a key that `--set`
/// can change, the error suggests `--set`.
pub fn suggest_set(error: clap::Error, words: &[OsString]) -> clap::Error {
    match tip(&error, words) {
        Some(tip) => with_tip(error, tip),
        None => error,
    }
}

fn tip(error: &clap::Error, words: &[OsString]) -> Option<String> {
    let Some(ContextValue::String(option)) = error.get(ContextKind::InvalidArg) else { return None };
    let name = option.strip_prefix("--")?.split('=').next()?.replace('-', "_");
    let cli = Cli::command();
    let command = words.iter().skip(1).find_map(|word| cli.find_subcommand(word))?;
    let has_set = command.get_arguments().any(|argument| argument.get_long() == Some("set"));
    let (file, schema) = match command.get_name() {
        _ if !has_set => return None,
        "run" | "reproduce" => ("config", config::schema()),
        _ => ("scene", scene::schema()),
    };
    let settings: Vec<String> =
        paths(&schema, &name).iter().map(|path| format!("`--set {path}=VALUE`")).collect();
    let key = if settings.len() == 1 { "this key" } else { "a key" };
    (!settings.is_empty()).then(|| format!("to change {key} of the {file}, use {}", settings.join(" or ")))
}

/// Returns the paths of the keys whose name is `name`, or begins with `name` and an underscore. Leaves out keys of
/// tables and of lists of tables. Of the other keys, returns only those in the outermost tables that have such a key.
fn paths(schema: &Value, name: &str) -> Vec<String> {
    let is_named =
        |key: &str| key.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'));
    let mut tables = vec![(String::new(), schema)];
    while !tables.is_empty() {
        let keys: Vec<(String, &String, &Value)> =
            tables.iter().flat_map(|(path, table)| keys(path, table)).collect();
        let (inner, values): (Vec<_>, Vec<_>) = keys.into_iter().partition(|(.., value)| has_keys(value));
        let found: Vec<String> =
            values.into_iter().filter(|(_, key, _)| is_named(key)).map(|(path, ..)| path).collect();
        if !found.is_empty() {
            return found;
        }
        tables = inner.into_iter().map(|(path, _, value)| (path, value)).collect();
    }
    Vec::new()
}

/// Returns the keys of a table or, with the index 0, of the elements of a list: their paths, names and schemas. `path`
/// is the path of the table or list.
fn keys<'s>(path: &str, schema: &'s Value) -> Vec<(String, &'s String, &'s Value)> {
    let of_table = schema["properties"].as_object();
    let of_list = schema["items"]["properties"].as_object();
    let start = match (path, of_table) {
        ("", _) => String::new(),
        (_, Some(_)) => format!("{path}."),
        (_, None) => format!("{path}.0."),
    };
    let all = of_table.or(of_list).into_iter().flatten();
    all.map(|(key, value)| (format!("{start}{key}"), key, value)).collect()
}

fn has_keys(schema: &Value) -> bool {
    schema["properties"].is_object() || schema["items"]["properties"].is_object()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;

    fn message(words: &[&str]) -> String {
        let words: Vec<OsString> = ["raycl"].iter().chain(words).map(OsString::from).collect();
        suggest_set(Cli::try_parse_from(&words).expect_err("a mistake"), &words).to_string()
    }

    #[test]
    fn an_option_named_like_a_key_is_answered_with_the_setting() {
        for (words, tip) in [
            (
                ["run", "a.toml", "--launches"],
                "to change this key of the config, use `--set timing.launches=VALUE`",
            ),
            (
                ["run", "a.toml", "--baselines=[]"],
                "to change this key of the config, use `--set baselines=VALUE`",
            ),
            (
                ["render", "a.obj", "--shadow-bias"],
                "to change this key of the scene, use `--set shadow_bias=VALUE`",
            ),
            (
                ["view", "a.obj", "--power"],
                "to change this key of the scene, use `--set light.0.power=VALUE`",
            ),
            (
                ["render", "a.obj", "--fov"],
                "to change a key of the scene, use `--set camera.fov_x_degrees=VALUE` or `--set camera.fov_y_degrees=VALUE`",
            ),
        ] {
            let said = message(&words);
            assert!(said.contains(tip) && !said.contains("similar"), "{said}");
        }
        // `compile` has no option --set, `light` is a list of tables, and no key begins with `sampl_`.
        for words in
            [["compile", "a.obj", "--fov"], ["render", "a.obj", "--light"], ["render", "a.obj", "--sampl"]]
        {
            assert!(!message(&words).contains("--set"), "{words:?}");
        }
    }
}
