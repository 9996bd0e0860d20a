//! `raycl completions`: prints a script with which a shell completes raycl's arguments.

use crate::error::{Error, Result};
use clap::{Arg, ArgGroup, Command, CommandFactory as _, Id};
use clap_complete::Shell;

/// Arguments of `raycl completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl completions bash > ~/.local/share/bash-completion/completions/raycl
  raycl completions zsh > ~/.zfunc/_raycl
  raycl completions fish > ~/.config/fish/completions/raycl.fish")]
pub struct Args {
    /// The shell for which to print a completion script
    shell: Shell,
}

/// The line of the bash script that stores in `prev` the word before the word at the cursor.
const PREVIOUS_WORD: &str = "    prev=\"$3\"\n";

/// Prints the completion script.
pub fn run(args: Args) -> Result<()> {
    super::print(script(args.shell)?.trim_end())
}

fn script(shell: Shell) -> Result<String> {
    let mut whole = shown(&super::Cli::command()).version(env!("RAYCL_VERSION"));
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut whole, "raycl", &mut script);
    let script = String::from_utf8(script)
        .map_err(|error| Error::fault(format!("the completion script is not UTF-8: {error}")))?;
    Ok(match shell {
        Shell::Bash => with_equals_signs(&script, &whole),
        _ => script,
    })
}

/// Returns a command without its hidden arguments and subcommands, since `clap_complete` (the library that generates
/// the script) would include them in the completions.
fn shown(command: &Command) -> Command {
    let hidden: Vec<&Id> = command.get_arguments().filter(|one| one.is_hide_set()).map(Arg::get_id).collect();
    let is_shown = |id: &&Id| !hidden.contains(id);
    let groups = command.get_groups().map(|group| {
        let members = group.get_args().filter(is_shown);
        ArgGroup::new(group.get_id()).multiple(true).args(members)
    });
    Command::new(command.get_name().to_owned())
        .about(command.get_about().cloned().unwrap_or_default())
        .args(command.get_arguments().filter(|one| !one.is_hide_set()))
        .groups(groups)
        .subcommands(command.get_subcommands().filter(|one| !one.is_hide_set()).map(shown))
}

/// Returns the bash script `script`, changed so that it also completes the value in `--option=value`. Bash
/// divides `--option=value` into three words: `--option`, `=` and `value`. The script that clap_complete
/// generates expects the option directly before the value, without the word `=`. If an option requires the
/// `=`, the changed script completes no value after the option and a space. `whole` is the command `raycl`.
fn with_equals_signs(script: &str, whole: &Command) -> String {
    let options = whole.get_subcommands().flat_map(Command::get_arguments);
    let options = options.filter(|one| one.is_require_equals_set()).filter_map(Arg::get_long);
    let options: String = options.map(|long| format!("--{long} ")).collect();
    let replacement = format!(
        r#"{PREVIOUS_WORD}    if [[ "$prev" == "=" ]]; then
        prev="${{COMP_WORDS[COMP_CWORD-2]}}"
    elif [[ "${{COMP_WORDS[COMP_CWORD]}}" != "=" && " {options}" == *" $prev "* ]]; then
        prev=""
    fi
"#
    );
    script.replacen(PREVIOUS_WORD, &replacement, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum as _;

    #[test]
    fn no_script_has_hidden_options_or_commands() {
        for shell in Shell::value_variants() {
            let script = script(*shell).expect("a script");
            for hidden in ["asleep", "For tests", "--fault", "figures"] {
                assert!(!script.contains(hidden), "{shell}: {hidden}");
            }
            assert!(script.contains("fail-on-regression") && script.contains("compare-images"), "{shell}");
        }
    }
}
