//! `raycl completions`: prints a script with which a shell completes raycl's arguments.

use crate::error::{Error, Result};
use clap::{Command, CommandFactory as _};
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

/// Prints the completion script.
pub fn run(args: Args) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut shown(), "raycl", &mut script);
    let script = String::from_utf8(script)
        .map_err(|error| Error::fault(format!("the completion script is not UTF-8: {error}")))?;
    super::print(script.trim_end())
}

/// Returns raycl's command line without the hidden subcommands, since clap_complete (the library that generates the
/// script) would include them in the completions.
fn shown() -> Command {
    let whole = super::Cli::command();
    let shown = whole.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    let own = whole.get_arguments().cloned();
    Command::new("raycl").version(env!("RAYCL_VERSION")).args(own).subcommands(shown)
}
