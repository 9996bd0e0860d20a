//! Runs assemblers and disassemblers, if they are installed, with a time limit.

use crate::child::output_within;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// The time limit for one run of an assembler or disassembler, which usually needs far less time for a
/// kernel.
const LIMIT: Duration = Duration::from_secs(60);

/// An installed assembler or disassembler.
pub struct Tool {
    name: &'static str,
    path: PathBuf,
}

/// The output of a program.
pub struct Written {
    /// The text on the program's standard output.
    pub stdout: String,
    /// The text on the program's standard error stream.
    pub stderr: String,
}

impl Tool {
    /// Finds a program in the folders of the environment variable PATH.
    pub fn find(name: &'static str) -> Option<Self> {
        let folders = std::env::var_os("PATH")?;
        let mut paths = std::env::split_paths(&folders).map(|folder| folder.join(name));
        let path = paths.find(|path| path.is_file())?;
        Some(Self { name, path })
    }

    /// Runs the program in a folder. The error says how the program failed.
    pub fn run(&self, folder: &Folder, arguments: &[&str]) -> Result<Written, String> {
        let mut command = Command::new(&self.path);
        // raycl parses the program's messages, so the messages have to be in English.
        command.args(arguments).current_dir(folder.0.path()).env("LC_ALL", "C");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let ended = command.spawn().and_then(|child| output_within(child, LIMIT));
        let output = ended.map_err(|error| format!("{} could not be run: {error}", self.name))?;
        let Some(output) = output else {
            return Err(format!(
                "{} was stopped because it took longer than {} s",
                self.name,
                LIMIT.as_secs()
            ));
        };
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let written = Written { stdout: text(&output.stdout), stderr: text(&output.stderr) };
        if output.status.success() {
            return Ok(written);
        }
        let said = written.stderr.lines().find(|line| !line.trim().is_empty()).unwrap_or("no message");
        let said = said.strip_prefix(&format!("{}: ", self.name)).unwrap_or(said);
        Err(format!("{} failed: {}", self.name, said.trim_end_matches('.')))
    }
}

/// A temporary folder for the input and output files of an assembler or disassembler.
pub struct Folder(TempDir);

impl Folder {
    /// Creates a temporary folder with one file in it.
    pub fn with(name: &str, bytes: &[u8]) -> Result<Self, String> {
        let made = tempfile::tempdir().and_then(|folder| {
            std::fs::write(folder.path().join(name), bytes)?;
            Ok(Self(folder))
        });
        made.map_err(|error| format!("a temporary file could not be written: {error}"))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// Runs a command of the shell in a folder with one file.
    fn run(command: &str) -> Result<Written, String> {
        let folder = Folder::with("kernel.so", b"its bytes").unwrap();
        Tool::find("sh").unwrap().run(&folder, &["-c", command])
    }

    #[test]
    fn a_program_runs_in_the_folder_in_english_and_its_streams_are_told_apart() {
        let written = run("cat kernel.so; echo \" $LC_ALL\"; echo warning >&2").unwrap();
        assert_eq!((written.stdout.as_str(), written.stderr.as_str()), ("its bytes C\n", "warning\n"));
    }

    #[test]
    fn a_failure_is_reported_by_the_first_line_of_the_programs_message() {
        let failure = |command: &str| run(command).err().unwrap();
        assert_eq!(
            failure("echo out; printf '\\nsh: no such file.\\nmore\\n' >&2; exit 1"),
            "sh failed: no such file"
        );
        assert_eq!(failure("exit 3"), "sh failed: no message");
        assert!(Tool::find("no-such-program-anywhere").is_none());
    }
}
