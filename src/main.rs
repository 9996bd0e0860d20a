//! Parses arguments, calls one function of [`raycl::cli`], and maps its error to an exit code.

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;

use miette::MietteHandlerOpts;

fn main() -> ExitCode {
    keep_lines_whole();
    match raycl::cli::Cli::read().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = ExitCode::from(error.exit_code());
            // Nobody is left to tell when standard error is closed too.
            let _ = writeln!(std::io::stderr(), "{:?}", miette::Report::new(error));
            code
        }
    }
}

/// Wraps an error's lines for a terminal only: who searches a log for a message finds it in one line.
fn keep_lines_whole() {
    if std::io::stderr().is_terminal() {
        return;
    }
    // It fails only where a hook is set already, and then that one will do.
    let _ = miette::set_hook(Box::new(|_| Box::new(MietteHandlerOpts::new().wrap_lines(false).build())));
}
