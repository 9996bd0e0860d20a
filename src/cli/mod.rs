//! The command line. The file of each subcommand contains the subcommand's arguments (`Args`) and its
//! function `run`. Files that belong to no single subcommand contain code that several subcommands share.

mod blanks;
pub mod cache;
pub(crate) mod choice;
pub mod colour;
pub mod compare;
pub mod compare_images;
pub mod compile;
pub mod completions;
pub mod devices;
pub mod figures;
mod guarded;
mod guesses;
pub mod kernel;
mod keys_as_options;
pub mod man;
mod measured;
pub mod merge;
pub mod noise;
pub mod occupancy;
mod output;
pub mod peak;
mod progress;
mod renamed;
pub mod render;
pub mod repair;
pub mod report;
pub mod reproduce;
pub mod rule;
pub mod run;
pub mod schema;
pub mod strategies;
pub(crate) mod subject;
mod turn;
mod undecodable;
pub mod view;
mod watch;

pub use output::{end_at_once, print, print_coloured, print_json, print_report, table};

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::Path;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::device::{cache_variables, loop_variables, pinning_variables, thread_variables, variables};
use crate::error::{Error, Result};
use crate::filetype::is_standard_input;
use crate::own_program::remember_libraries;
use crate::sources::Sources;
use crate::threads::start_pool;
use crate::{printer, settings};
use colour::Colour;
use guarded::{Guarded, Screen};

/// Casts rays through triangle scenes with OpenCL, and finds by experiment the fastest way to cast them.
#[derive(Debug, Parser)]
#[command(name = "raycl", version = env!("RAYCL_VERSION"), arg_required_else_help = true, max_term_width = 100)]
#[command(after_help = "Examples:
  raycl devices                              the devices that can cast rays
  raycl render scenes/teapot.toml            a picture, and a table of its times
  raycl view scenes/teapot.toml              a window to look around in
  raycl run configs/quick.toml               an experiment: pictures, tables, records
  raycl run configs/figure-8.toml --dry-run  the list of the experiment's points, without measuring
  raycl strategies                           axes of strategies with their values, and presets
  raycl kernel naive                         the source of one strategy

`raycl help COMMAND` explains each command. The exit code is 0 if the command has succeeded, 1 if it has failed, 2 for a mistake in the arguments or files, 130 if Ctrl-C has stopped the command (for run, reproduce and noise: also if SIGTERM has), and 128 + N if signal number N has ended it.

The file ~/.config/raycl/config.toml may contain your own defaults: device, color, and results (the folder for results). If the environment variable XDG_CONFIG_HOME names a folder, the file is raycl/config.toml in that folder.

The environment variables RAYCL_DEVICE, NO_COLOR and RAYCL_RESULTS override these defaults. Options override both the variables and the defaults.")]
pub struct Cli {
    /// When to use colours: auto (on a terminal, unless TERM is dumb), always or never [default: never if NO_COLOR is
    /// set and not empty, else the value of color in your settings, else auto]
    #[arg(long, global = true, value_name = "WHEN", value_enum, hide_possible_values = true)]
    color: Option<Colour>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render pictures of a scene or a mesh
    Render(render::Args),
    /// Look at a scene from all sides, in a window or in the terminal
    View(view::Args),
    /// Run an experiment: verify, time and record every point (combination of strategy, scene, sizes and device)
    Run(run::Args),
    /// Merge the shards of an experiment into one folder of results
    Merge(merge::Args),
    /// Generate a page, plots and exports from results
    Report(report::Args),
    /// Run the experiments of a student paper on ray casting, and judge the paper's claims
    Reproduce(reproduce::Args),
    /// Compare two folders of results, and report which points are faster, slower, the same or unclear
    Compare(compare::Args),
    /// Remove damaged lines from a folder of results, and keep copies of the original files
    Repair(repair::Args),
    /// Compare two pictures
    CompareImages(compare_images::Args),
    /// List OpenCL platforms and devices, with their limits
    Devices(devices::Args),
    /// List the axes of strategies with their values, and the presets
    Strategies(strategies::Args),
    /// Internal: raycl starts this process to measure points, to list the devices or to compile a program
    #[command(hide = true)]
    Worker {
        /// List the devices and end
        #[arg(long)]
        list: bool,
        /// Read a task from standard input, list the devices if the cache has no list of them, compile and store the
        /// task's program (if it has one), and end
        #[arg(long, conflicts_with = "list")]
        keep: bool,
        /// Use the kernel files in this folder
        #[arg(long, requires = "list", conflicts_with = "keep")]
        cl_dir: Option<std::path::PathBuf>,
    },
    /// Print a strategy's kernels as the compiler sees them
    Kernel(kernel::Args),
    /// Compile kernels, and report how many registers, bytes of memory and memory instructions they use
    Compile(compile::Args),
    /// Measure a device's peak rates (multiply-adds, copies, local memory) and the times of kernel launches and of
    /// single operations
    Peak(peak::Args),
    /// Measure the noise of times on this machine, and the smallest difference between two times that a run can show
    Noise(noise::Args),
    /// Predict how many work-groups and threads an NVIDIA multiprocessor holds, as in Figure 5 of the student paper
    /// whose experiments raycl repeats
    Occupancy(occupancy::Args),
    /// Update the numbers in raycl's documents from stored records, for contributors
    #[command(hide = true)]
    Figures(figures::Args),
    /// Check `render`'s choices of strategies against measurements, for contributors
    #[command(hide = true)]
    Rule(rule::Args),
    /// Show or clear the cache of compiled programs and lists of devices
    Cache(cache::Args),
    /// Print completions for a shell
    Completions(completions::Args),
    /// Print or write the man pages
    Man(man::Args),
    /// Print the JSON schema of scenes, configs or records, for editors and other programs
    Schema(schema::Args),
}

impl Command {
    /// Returns true if the command starts drivers in its own process. Commands that measure an experiment's
    /// points start worker processes, which start the drivers.
    fn starts_drivers(&self) -> bool {
        match self {
            Self::Render(_) | Self::View(_) | Self::Devices(_) | Self::Compile(_) | Self::Peak(_) => true,
            Self::Kernel(args) => args.asks_a_device(),
            Self::Rule(args) => args.measures(),
            _ => false,
        }
    }

    /// Returns true if the command may use parallel iterators in its own process, for example to read a mesh.
    /// Returns false for workers: a worker starts the threads of parallel iterators only when it needs them.
    fn computes_in_parallel(&self) -> bool {
        let casts = matches!(self, Self::Render(_) | Self::View(_) | Self::Kernel(_) | Self::Compile(_));
        let measures = matches!(self, Self::Run(_) | Self::Noise(_) | Self::Reproduce(_) | Self::Rule(_));
        let writes_pages = matches!(self, Self::Merge(_) | Self::Report(_) | Self::Compare(_));
        casts || measures || writes_pages || matches!(self, Self::CompareImages(_))
    }

    /// Returns true if PoCL (an OpenCL driver for CPUs) must pin its threads, because the command measures times itself
    /// or through workers. For `raycl render`, returns true only if the picture is cast several times (`--repeat`).
    /// Also returns true for workers, unless they only compile a program. Returns false for the commands for
    /// contributors, even if they measure times.
    fn measures(&self) -> bool {
        match self {
            Self::Run(_) | Self::Reproduce(_) | Self::Peak(_) | Self::Noise(_) => true,
            Self::Worker { keep, .. } => !keep,
            Self::Render(args) => args.repeats(),
            _ => false,
        }
    }

    /// Returns what raycl must know of the command to run it in a child process.
    fn guarded(&self) -> Guarded<'_> {
        Guarded {
            reads_standard_input: self.reads_standard_input(),
            streams: self.streams(),
            // `raycl compile` always compiles, since some compilers report a kernel's registers only then.
            loads_stored_programs: !matches!(self, Self::Compile(_)),
            shown_scene: match self {
                Self::Render(render::Args { subject, .. }) | Self::View(view::Args { subject, .. }) => {
                    Some(&subject.scene)
                }
                _ => None,
            },
            screen: match self {
                Self::View(args) if args.uses_terminal() => Screen::Terminal,
                Self::View(_) => Screen::Window,
                _ => Screen::None,
            },
            cl_dir: self.cl_dir(),
        }
    }

    /// Returns true if the command reads a scene from standard input, which can only be read once.
    fn reads_standard_input(&self) -> bool {
        match self {
            Self::Render(render::Args { subject, .. }) | Self::View(view::Args { subject, .. }) => {
                subject.reads_standard_input()
            }
            Self::Compile(compile::Args { scene, .. }) => is_standard_input(scene),
            Self::Kernel(kernel::Args { scene, .. }) => scene.as_deref().is_some_and(is_standard_input),
            _ => false,
        }
    }

    /// Returns true if the command writes frames to standard output, one by one.
    fn streams(&self) -> bool {
        match self {
            Self::Render(args) => args.streams(),
            Self::View(args) => args.streams(),
            _ => false,
        }
    }

    /// Returns the folder of `--cl-dir` for commands that can start drivers in their own process. Returns `None` for
    /// all other commands, and if `--cl-dir` is not given.
    fn cl_dir(&self) -> Option<&Path> {
        match self {
            Self::Render(render::Args { subject, .. }) | Self::View(view::Args { subject, .. }) => {
                subject.cl_dir.as_deref()
            }
            Self::Compile(compile::Args { cl_dir, .. })
            | Self::Kernel(kernel::Args { cl_dir, .. })
            | Self::Peak(peak::Args { cl_dir, .. }) => cl_dir.as_deref(),
            _ => None,
        }
    }
}

/// Installs a handler for SIGXFSZ, the signal that a process gets when a file would become larger than
/// `ulimit -f` allows. With a handler for SIGXFSZ, the write to the file fails, but the process continues.
/// Without the handler, the signal ends the process: no message is printed, and temporary files stay.
#[cfg(unix)]
fn outlive_large_files() {
    use std::sync::{Arc, atomic::AtomicBool};
    // If the handler cannot be installed, the signal SIGXFSZ ends the process, as it would without this call.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

/// Does nothing: only Unix has the signal SIGXFSZ.
#[cfg(not(unix))]
fn outlive_large_files() {}

/// Prints the help, the version or a mistake in the arguments, and ends the process.
///
/// # Errors
///
/// Fails if standard output cannot be written to. A closed pipe is not an error.
fn end<T>(said: &clap::Error) -> Result<T> {
    match said.print() {
        Err(error) if !said.use_stderr() && error.kind() != ErrorKind::BrokenPipe => {
            Err(Error::unwritable_output(&error))
        }
        _ => std::process::exit(said.exit_code()),
    }
}

impl Cli {
    /// Parses the process's arguments. A mistake in the arguments ends the process with exit code 2, after a message
    /// that describes the mistake. `--help` and `--version` end the process after the text is printed.
    ///
    /// # Errors
    ///
    /// Fails if the user's settings or raycl's environment variables contain a mistake, or if the help or the version
    /// cannot be printed. A worker ignores a mistake in the settings or in the variables.
    pub fn read() -> Result<Self> {
        outlive_large_files();
        let words: Vec<OsString> = std::env::args_os().collect();
        let settings = settings::load();
        // The value of `--color` also applies to a message about a mistake in the arguments, so this value is
        // read before clap parses the arguments.
        colour::choose(colour::typed(&words), settings::colour());
        let read = Self::parse_words(&words);
        let read = read.or_else(|error| end(&explained(shown(error, words.iter().cloned()), &words)))?;
        colour::choose(read.color, settings::colour());
        if !matches!(read.command, Command::Worker { .. }) {
            settings?;
        }
        Ok(read)
    }

    fn parse_words(words: &[OsString]) -> std::result::Result<Self, clap::Error> {
        let mut command = with_negative_numbers(Self::command()).color(colour::of_clap());
        let mut matches = command.try_get_matches_from_mut(words)?;
        Self::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut command))
    }

    /// Runs the subcommand. The process must not have loaded a driver or started a thread before.
    pub fn run(self) -> Result<()> {
        prepare_for_drivers(self.command.measures());
        if self.command.starts_drivers() {
            if !guarded::is_inside() {
                return guarded::run(&self.command.guarded());
            }
            guarded::ends_with_its_parent();
        }
        if self.command.computes_in_parallel() {
            // Rayon's threads start now, before a driver is loaded: while the system loads a driver's
            // libraries, a new thread would have to wait.
            start_pool()?;
        }
        match self.command {
            Command::Render(args) => render::run(args),
            Command::View(args) => view::run(args),
            Command::Run(args) => run::run(args),
            Command::Merge(args) => merge::run(args),
            Command::Report(args) => report::run(args),
            Command::Reproduce(args) => reproduce::run(args),
            Command::Compare(args) => compare::run(args),
            Command::Repair(args) => repair::run(args),
            Command::CompareImages(args) => compare_images::run(args),
            Command::Devices(args) => devices::run(args),
            Command::Strategies(args) => strategies::run(args),
            // The list of devices begins on a new line, since a driver may have printed an unfinished line.
            Command::Worker { list: true, cl_dir, .. } => {
                let sources = Sources::of(cl_dir)?;
                print(format!("\n{}", crate::experiment::list_devices(&sources)?))
            }
            Command::Worker { keep: true, .. } => render::keeping::serve(),
            Command::Worker { list: false, .. } => crate::experiment::serve(),
            Command::Kernel(args) => kernel::run(args),
            Command::Compile(args) => compile::run(args),
            Command::Peak(args) => peak::run(args),
            Command::Noise(args) => noise::run(args),
            Command::Occupancy(args) => occupancy::run(args),
            Command::Figures(args) => figures::run(args),
            Command::Rule(args) => rule::run(args),
            Command::Cache(args) => cache::run(args),
            Command::Completions(args) => completions::run(args),
            Command::Man(args) => man::run(args),
            Command::Schema(args) => schema::run(args),
        }
    }
}

/// Prepares this process and its child processes for drivers. First stores the values that the drivers'
/// environment variables have now, then sets the variables that raycl chooses for drivers. A driver reads its
/// variables when it is loaded; child processes inherit the variables. If `measures` is true, raycl asks PoCL
/// (an OpenCL driver for CPUs) to pin its threads, where this is possible. The process must not have loaded a
/// driver or started a thread before.
pub(crate) fn prepare_for_drivers(measures: bool) {
    remember_libraries();
    variables::of_user();
    let pinning = if measures { pinning_variables() } else { Vec::new() };
    let own = [thread_variables(), cache_variables(), loop_variables(), pinning];
    for (name, value) in own.into_iter().flatten() {
        // SAFETY: the program has just begun. No driver is loaded, and no other thread exists that could read
        // the environment at the same time.
        unsafe { std::env::set_var(name, value) };
    }
}

/// Returns `command`, changed so that every option with a value accepts a negative number. By default, clap
/// (the library that parses the arguments) reports the `-3` of `--samples -3` as an unknown option. If
/// options accept negative numbers, clap's message about `-3` says which values are expected.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let allow = |arg: clap::Arg| match !arg.is_positional() && arg.get_action().takes_values() {
        true => arg.allow_negative_numbers(true),
        false => arg,
    };
    command.mut_args(allow).mut_subcommands(with_negative_numbers)
}

/// Returns clap's error for the arguments `words` with tips about mistakes that raycl recognises.
fn explained(error: clap::Error, words: &[OsString]) -> clap::Error {
    let error = undecodable::explain(error, words);
    blanks::explain(renamed::explain(guesses::explain(error, words)), words)
}

/// Returns clap's error for the arguments `words` with a message that contains no control characters. clap
/// quotes arguments unchanged, so the message of `error` contains the control characters of the arguments.
fn shown(error: clap::Error, words: impl Iterator<Item = OsString>) -> clap::Error {
    let words = words.map(|word| printer::line(&word.to_string_lossy()).into_owned().into());
    Cli::parse_words(&words.collect::<Vec<OsString>>()).err().unwrap_or(error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::builder::ValueParser;
    use clap::error::{ContextKind, ContextValue};

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
        with_negative_numbers(Cli::command()).debug_assert();
    }

    #[test]
    fn commands_that_show_a_scene_name_it() {
        for (words, expected) in [
            (&["render", "a.obj"][..], Some("a.obj")),
            (&["view", "b.toml"], Some("b.toml")),
            (&["devices"], None),
        ] {
            let words: Vec<OsString> = ["raycl"].iter().chain(words).map(Into::into).collect();
            let shown = Cli::parse_words(&words).expect("a command");
            let shown = shown.command.guarded().shown_scene.map(Path::to_owned);
            assert_eq!(shown.as_deref(), expected.map(Path::new));
        }
    }

    #[test]
    fn a_negative_number_is_a_value_and_its_mistake_says_what_is_expected() {
        let words = |words: &[&str]| words.iter().map(OsString::from).collect::<Vec<_>>();
        assert!(Cli::parse_words(&words(&["raycl", "render", "a.obj", "--azimuth", "-30"])).is_ok());
        for option in ["--samples", "--width"] {
            let typed = words(&["raycl", "render", "a.obj", option, "-3"]);
            let text = Cli::parse_words(&typed).expect_err("a mistake").to_string();
            assert!(text.contains("'-3'") && text.contains("whole number from 1 to"), "{text}");
        }
        for unknown in ["-j", "-8"] {
            let typed = words(&["raycl", "render", unknown, "a.obj"]);
            let text = Cli::parse_words(&typed).expect_err("a mistake").to_string();
            assert!(text.contains(&format!("unexpected argument '{unknown}'")), "{text}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn the_error_about_an_argument_that_is_not_utf_8_names_it() {
        use std::os::unix::ffi::OsStringExt as _;
        let words = ["raycl", "render", "a.toml", "--strategy"].map(OsString::from).into_iter();
        let words: Vec<OsString> = words.chain([OsString::from_vec(b"width=\xff".to_vec())]).collect();
        let error = explained(Cli::parse_words(&words).expect_err("a mistake"), &words);
        assert!(error.to_string().contains("not UTF-8: 'width="), "{error}");
    }

    /// Splits a command line into words, as a shell does. Spaces between single quotes do not split a word.
    fn words(line: &str) -> Vec<OsString> {
        let space = '\u{1}';
        let unsplit = line.split('\'').enumerate().map(|(index, part)| match index % 2 {
            1 => part.replace(' ', &space.to_string()),
            _ => part.to_owned(),
        });
        let line = unsplit.collect::<String>();
        line.split_whitespace().map(|word| word.replace(space, " ").into()).collect()
    }

    #[test]
    fn every_example_names_a_strategy_that_is_allowed_on_every_device() {
        use crate::device::{DeviceLimits, EXAMPLE_LIMITS, LaneOperations};
        use crate::strategy::Task;
        let all = Cli::command();
        let of = |command: &str| all.find_subcommand(command)?.get_after_help().map(ToString::to_string);
        let help = ["render", "view"].map(|command| of(command).expect("a help with examples"));
        let page = |page: &str| {
            std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(page)).expect("a page")
        };
        let text = [page("README.md"), page("docs/render.md"), help.join("\n")].join("\n");
        let cpu = DeviceLimits { is_cpu: true, native_width: 16, ..EXAMPLE_LIMITS };
        let gpu = DeviceLimits { lane_operations: LaneOperations::Ptx, ..EXAMPLE_LIMITS };
        let mut seen = 0;
        for line in text.lines().map(|line| line.trim().split(" | ").next().unwrap_or_default()) {
            // An example may begin with a command that makes a folder, followed by `&&`.
            let line = line.rsplit(" && ").next().unwrap_or(line);
            if !line.starts_with("raycl render ") && !line.starts_with("raycl view ") {
                continue;
            }
            // The ray-triangle test `my-test` in README.md is a copy of moller_trumbore.cl, made by the
            // command `cp`.
            let line = &line.replace("=my-test", "=moller-trumbore");
            let cli = Cli::parse_words(&words(line)).unwrap_or_else(|error| panic!("{line}: {error}"));
            let subject = match &cli.command {
                Command::Render(args) => &args.subject,
                Command::View(args) => &args.subject,
                _ => continue,
            };
            for limits in [cpu, gpu, EXAMPLE_LIMITS] {
                let task = Task::covering(1026, 1280 * 800);
                choice::chosen_strategy(subject.strategy.as_deref(), &subject.set, &limits, task)
                    .unwrap_or_else(|error| panic!("{line}: {error}"));
            }
            seen += 1;
        }
        assert!(seen >= 20, "only {seen} examples");
    }

    #[test]
    fn every_example_that_writes_into_a_folder_makes_the_folder() {
        let mut seen = 0;
        for command in Cli::command().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            for line in help.lines() {
                let Some((before, file)) = line.split_once(" -o ") else { continue };
                let Some((folder, _)) = file.split(' ').next().unwrap_or(file).rsplit_once('/') else {
                    continue;
                };
                assert!(before.contains(&format!("mkdir -p {folder} && ")), "{line}");
                seen += 1;
            }
        }
        assert!(seen > 0, "no example writes into a folder");
    }

    /// Returns the name of a command and the text after its help, and those of all its subcommands.
    fn texts_after_help(command: &clap::Command) -> Vec<(String, String)> {
        let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        let below = command.get_subcommands().flat_map(texts_after_help);
        std::iter::once((command.get_name().to_owned(), text)).chain(below).collect()
    }

    /// clap prints at most 100 columns (`max_term_width`). If an example were longer, clap would print it on two lines,
    /// and a shell would run a copy of these lines as two commands.
    #[test]
    fn an_example_fits_on_a_line_of_the_help() {
        let mut seen = 0;
        for (name, text) in texts_after_help(&Cli::command()) {
            for line in text.lines().filter(|line| line.starts_with("  ")) {
                assert!(line.chars().count() <= 100, "{name}: more than 100 columns: {line}");
                seen += 1;
            }
        }
        assert!(seen >= 40, "only {seen} lines of examples and keys");
    }

    /// clap keeps the line breaks of the source. If a paragraph had several lines in the source, clap would
    /// print short lines in the paragraph's middle.
    #[test]
    fn a_paragraph_after_the_help_is_one_line_of_the_source() {
        for (name, text) in texts_after_help(&Cli::command()) {
            for paragraph in text.split("\n\n") {
                let lines = paragraph.lines().filter(|line| !line.starts_with(' ')).count();
                assert!(lines <= 1, "{name}: a paragraph of {lines} lines: {paragraph}");
            }
        }
    }

    /// The test gives each option a value that is too large for every option. If the option has a range,
    /// raycl's error message about the value states this range. The option's help must state the range too.
    #[test]
    fn the_help_of_an_option_states_its_range() {
        let mut seen = 0;
        for command in Cli::command().get_subcommands() {
            for option in command.get_arguments() {
                let value = format!("--{}=99999999999", option.get_long().unwrap_or_default());
                let typed = ["raycl", command.get_name(), &value].map(OsString::from);
                let Err(mistake) = Cli::parse_words(&typed) else { continue };
                let mistake = mistake.to_string();
                let Some((_, range)) = mistake.split_once("is not a whole number from ") else { continue };
                let range = range.split_whitespace().take(3).collect::<Vec<_>>().join(" ");
                let help = option.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(help.replace(',', "").contains(&range), "{value}: no '{range}' in '{help}'");
                seen += 1;
            }
        }
        assert!(seen >= 8, "only {seen} options have a range");
    }

    #[test]
    fn options_that_would_have_no_effect_are_refused() {
        let is_accepted =
            |line: &str| Cli::parse_words(&line.split(' ').map(OsString::from).collect::<Vec<_>>()).is_ok();
        for line in ["raycl occupancy --results out", "raycl reproduce --page-only --force --quiet"] {
            assert!(is_accepted(line), "{line}");
        }
        for line in [
            "raycl occupancy --results out --local-sizes 8x8",
            "raycl reproduce --page-only --device cpu",
            "raycl reproduce --page-only --set timing.launches=1",
            "raycl reproduce --page-only --resume",
            "raycl reproduce --page-only --no-wait",
            "raycl reproduce --page-only --verbose",
            "raycl reproduce --page-only --retry-failed",
            "raycl reproduce --retry-failed",
            "raycl run a.toml --sbatch 2 --retry-failed",
            "raycl render a.toml --every-device --device cpu",
            "raycl render a.toml --every-device --layers a.exr",
            "raycl render a.toml --every-device --turntable 2",
            "raycl render a.toml --turntable 2 --no-wait",
            "raycl render a.toml --no-wait",
            "raycl render a.toml --verify=0",
            "raycl rule --show a.json --no-wait",
            "raycl rule --fit a.json --no-wait",
            "raycl man render --force",
            "raycl merge out --device cpu --between 3",
            "raycl merge out --quiet --between 3",
        ] {
            assert!(!is_accepted(line), "{line}");
        }
    }

    #[test]
    fn a_picture_that_is_rendered_again_and_again_has_no_json_object() {
        let is_accepted = |line: &str| Cli::parse_words(&words(line)).is_ok();
        assert!(is_accepted("raycl render a.toml --watch") && is_accepted("raycl render a.toml --json"));
        assert!(!is_accepted("raycl render a.toml --watch --json"));
    }

    /// Suppose that an option A requires an option B, and that B conflicts with an option C. If A is given without B,
    /// clap (the library that parses the arguments) reports that B is missing. But if C is given too, clap reports no
    /// mistake: it would accept A and C together, and A would have no effect. To prevent this, A itself must conflict
    /// with C.
    #[test]
    fn an_option_conflicts_with_all_that_conflicts_with_the_option_that_it_requires() {
        let mut all = with_any_values(Cli::command());
        all.build();
        let seen = inherited_conflicts(&all, &all, &["raycl"]);
        assert!(seen >= 10, "only {seen} conflicts");
    }

    /// Checks the options of `command` and of its subcommands: if an option A requires an option B, A must
    /// conflict with every option that conflicts with B. Returns how many conflicts between options were
    /// checked. `all` is the command `raycl`, and `words` are the words of a command line that select
    /// `command`.
    fn inherited_conflicts(all: &clap::Command, command: &clap::Command, words: &[&str]) -> usize {
        let always_missing = missing_options(all, words);
        let mut seen = 0;
        for option in command.get_arguments() {
            let Some(name) = option.get_long() else { continue };
            let value = if option.get_action().takes_values() { "=1" } else { "" };
            let typed = format!("--{name}{value}");
            let missing = missing_options(all, &[words, &[typed.as_str()]].concat());
            let is_required = |other: &&clap::Arg| {
                let other = other.to_string();
                missing.contains(&other) && !always_missing.contains(&other)
            };
            for required in command.get_arguments().filter(is_required) {
                for other in command.get_arguments().filter(|other| conflict(command, required, other)) {
                    assert!(
                        conflict(command, option, other),
                        "{words:?}: {option} needs {required}, and only {required} conflicts with {other}"
                    );
                    seen += 1;
                }
            }
        }
        for inner in command.get_subcommands() {
            seen += inherited_conflicts(all, inner, &[words, &[inner.get_name()]].concat());
        }
        seen
    }

    /// Returns the options and arguments that are missing in the command line `words`, as clap's message
    /// names them.
    fn missing_options(all: &clap::Command, words: &[&str]) -> Vec<String> {
        let mistake = all.clone().try_get_matches_from(words).err();
        match mistake.as_ref().and_then(|mistake| mistake.get(ContextKind::InvalidArg)) {
            Some(ContextValue::Strings(missing)) => missing.clone(),
            _ => Vec::new(),
        }
    }

    /// Returns true if `one` or `other` (arguments of `command`) declares a conflict between the two.
    fn conflict(command: &clap::Command, one: &clap::Arg, other: &clap::Arg) -> bool {
        let declares = |one: &clap::Arg, other: &clap::Arg| {
            command.get_arg_conflicts_with(one).iter().any(|named| named.get_id() == other.get_id())
        };
        declares(one, other) || declares(other, one)
    }

    /// Returns `command`, changed so that every argument accepts any value. With the changed command, a test
    /// can give the same value to all options.
    fn with_any_values(command: clap::Command) -> clap::Command {
        let any = |arg: clap::Arg| match arg.get_action().takes_values() {
            true => arg.value_parser(ValueParser::os_string()),
            false => arg,
        };
        command.mut_args(any).mut_subcommands(with_any_values)
    }

    #[test]
    fn mistakes_quote_words_that_no_terminal_obeys() {
        let red = "\u{1b}[31m\u{9b}2J\nx";
        for words in [
            vec!["raycl", red],
            vec!["raycl", "render", red, "--local-size", red],
            vec!["raycl", "render", red, "--width", red],
            vec!["raycl", "run", "a.toml", "--set", red],
            vec!["raycl", "run", "a.toml", "--fail-on-regression", red],
        ] {
            let error = Cli::try_parse_from(&words).expect_err("a mistake");
            let text = shown(error, words.iter().map(OsString::from)).render().ansi().to_string();
            assert!(text.contains("\\u001b[31m\\u009b2J\\u000ax"), "{text:?}");
            assert!(!text.contains(red) && !text.contains('\u{9b}'), "{text:?}");
        }
    }

    /// Returns the subcommand of a command line.
    fn command(line: &str) -> Command {
        Cli::parse_words(&words(line)).unwrap_or_else(|error| panic!("{line}: {error}")).command
    }

    #[test]
    fn pocl_pins_its_threads_for_commands_and_workers_that_measure() {
        for line in ["raycl run a.toml", "raycl peak", "raycl render a.toml --repeat 2", "raycl worker"] {
            assert!(command(line).measures(), "{line}");
        }
        for line in ["raycl render a.toml", "raycl view a.toml", "raycl worker --keep"] {
            assert!(!command(line).measures(), "{line}");
        }
    }

    #[test]
    fn only_compile_never_loads_a_stored_program_that_may_crash_a_driver() {
        let loads = |words: &str| command(&format!("raycl {words}")).guarded().loads_stored_programs;
        assert!(loads("render a.toml") && loads("view a.toml") && !loads("compile a.toml --strategy naive"));
    }

    #[test]
    fn a_command_that_reads_its_scene_from_standard_input_reads_it_only_once() {
        let reads = |words: &str| command(&format!("raycl {words}")).guarded().reads_standard_input;
        for words in ["render -", "view -", "compile - --strategy naive", "kernel naive --scene -"] {
            assert!(reads(words), "{words}");
        }
        for words in ["render ./-", "compile a.toml --strategy naive", "kernel naive", "peak"] {
            assert!(!reads(words), "{words}");
        }
    }

    #[test]
    fn if_a_driver_crashes_the_kernel_files_of_every_command_that_has_some_may_be_blamed() {
        for words in
            ["render a.toml", "view a.toml", "compile a.toml --strategy naive", "kernel naive", "peak"]
        {
            let command = command(&format!("raycl {words} --cl-dir mine"));
            assert_eq!(command.guarded().cl_dir, Some(Path::new("mine")), "{words}");
        }
        assert_eq!(command("raycl peak").guarded().cl_dir, None);
    }

    #[test]
    fn only_frames_on_standard_output_are_a_stream() {
        let streams = |words: &str| command(&format!("raycl {words}")).guarded().streams;
        for words in ["render a.toml --turntable 2 -o -", "render a.toml --animate -o -"] {
            assert!(streams(words), "{words}");
        }
        // A single picture is written only when it is complete.
        for words in ["render a.toml -o -", "render a.toml --turntable 2 -o a.png", "view a.toml", "peak"] {
            assert!(!streams(words), "{words}");
        }
    }
}
