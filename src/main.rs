//! Parses arguments, calls one function of [`raycl::cli`], and maps its error to an exit code.

use std::io::IsTerminal as _;
use std::process::ExitCode;

use miette::MietteHandlerOpts;

fn main() -> ExitCode {
    set(raycl::device::thread_variables());
    set(raycl::device::cache_variables());
    match raycl::cli::Cli::read().and_then(run) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            choose_look();
            let code = ExitCode::from(error.exit_code());
            // If standard error is closed, the message is lost.
            raycl::printer::tell(format!("{:?}", miette::Report::new(error)));
            code
        }
    }
}

/// Runs a command. If the command measures, the function first sets the variables with which PoCL pins its threads.
fn run(cli: raycl::cli::Cli) -> raycl::Result<()> {
    if cli.measures() {
        set(raycl::device::pinning_variables());
    }
    cli.run()
}

/// Sets environment variables for drivers. A driver reads these variables when it is loaded, in this process or in a
/// worker process, which inherits them.
fn set(variables: Vec<(&str, String)>) {
    for (name, value) in variables {
        // SAFETY: the program has just begun. No driver is loaded, and no other thread exists that could read
        // the environment at the same time.
        unsafe { std::env::set_var(name, value) };
    }
}

/// Sets how errors are printed: coloured as the user chose, and wrapped only on a terminal. In a log, a
/// message stays on one line, so that a search finds it.
fn choose_look() {
    let look = MietteHandlerOpts::new().wrap_lines(std::io::stderr().is_terminal());
    let look = match raycl::cli::colour::told() {
        Some(coloured) => look.color(coloured),
        None => look,
    };
    // Setting the hook fails only if there already is a hook, which is then used.
    let _ = miette::set_hook(Box::new(move |_| Box::new(look.clone().build())));
}
