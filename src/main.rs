//! Parses the arguments and runs the subcommand. An error in the arguments or in the subcommand is printed,
//! and determines the exit code.

use std::io::IsTerminal as _;
use std::process::ExitCode;

use miette::MietteHandlerOpts;

fn main() -> ExitCode {
    raycl::inherited::repair();
    choose_look();
    raycl::device::report_panics();
    match raycl::cli::Cli::read().and_then(raycl::cli::Cli::run) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = ExitCode::from(error.exit_code());
            // If standard error is closed, the message is lost.
            raycl::printer::tell(format!("{:?}", miette::Report::new(error)));
            code
        }
    }
}

/// Sets how errors are printed: coloured as the user chose, and wrapped only on a terminal. In a log, long
/// lines are not broken, so that a search for the words of a message finds them. The user's choice of colours
/// is known only after this function has returned, so the choice is looked up for each message.
fn choose_look() {
    let look = || {
        let look = MietteHandlerOpts::new().wrap_lines(std::io::stderr().is_terminal());
        match raycl::cli::colour::chosen() {
            Some(coloured) => look.color(coloured),
            None => look,
        }
    };
    // Setting the hook (the function that miette calls to print an error) fails only if a hook is already set. miette
    // then uses that hook.
    let _ = miette::set_hook(Box::new(move |_| Box::new(look().build())));
}
