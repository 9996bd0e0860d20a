//! Parses arguments, calls one function of [`raycl::cli`], and maps its error to an exit code.

use std::io::IsTerminal as _;
use std::process::ExitCode;

use miette::MietteHandlerOpts;

fn main() -> ExitCode {
    limit_threads();
    match raycl::cli::Cli::read().and_then(raycl::cli::Cli::run) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            choose_look();
            let code = ExitCode::from(error.exit_code());
            // Nobody is left to tell when standard error is closed too.
            raycl::printer::tell(format!("{:?}", miette::Report::new(error)));
            code
        }
    }
}

/// Drivers read these when they are loaded, in this process or in a worker, which inherits them.
fn limit_threads() {
    for (name, value) in raycl::device::thread_variables() {
        // SAFETY: the program has just begun: no driver is loaded and no other thread runs that could read the
        // environment meanwhile.
        unsafe { std::env::set_var(name, value) };
    }
}

/// How errors look: lines are wrapped for a terminal only (in a log, a message stays in one line and can be searched for), and
/// coloured as the user says.
fn choose_look() {
    let look = MietteHandlerOpts::new().wrap_lines(std::io::stderr().is_terminal());
    let look = match raycl::cli::colour::told() {
        Some(coloured) => look.color(coloured),
        None => look,
    };
    // It fails only where a hook is set already, and then that one will do.
    let _ = miette::set_hook(Box::new(move |_| Box::new(look.clone().build())));
}
