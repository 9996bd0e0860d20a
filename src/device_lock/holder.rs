//! The process that holds a device's lock. The lock's file describes this process, so that waiting processes
//! can name it.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::File;
use std::io::{Read as _, Seek as _, Write as _};
use std::path::Path;

/// Largest number of bytes that are read from a lock's file, since anybody may have written the file.
const LONGEST_BYTES: u64 = 4096;
/// Largest number of a command's characters that are shown.
const LONGEST_COMMAND: usize = 200;

/// A process that holds a device's lock, as the lock's file describes the process. Fields that the file lacks
/// are 0 or empty.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(default)]
pub struct Holder {
    process: u32,
    command: String,
    folder: String,
}

impl Holder {
    /// Returns the description of this process.
    pub fn of_this_process() -> Self {
        // The conversion is lossy, since an argument need not be UTF-8.
        let mut words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
        let program = words.next().unwrap_or_default();
        let program = Path::new(&program).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let command = std::iter::once(program).chain(words).collect::<Vec<_>>().join(" ");
        let folder = std::env::current_dir().unwrap_or_default().display().to_string();
        Self { process: std::process::id(), command, folder }
    }

    /// Replaces the contents of a lock's file by the description of this holder.
    pub fn write(&self, file: &mut File) -> std::io::Result<()> {
        file.set_len(0)?;
        file.rewind()?;
        file.write_all(&serde_json::to_vec(self)?)
    }

    /// Reads a lock's file. If the file cannot be read, all fields are 0 or empty.
    pub fn read(path: &Path) -> Self {
        let mut text = String::new();
        let read = File::open(path).and_then(|file| file.take(LONGEST_BYTES).read_to_string(&mut text));
        read.ok().and_then(|_| serde_json::from_str(&text).ok()).unwrap_or_default()
    }
}

impl fmt::Display for Holder {
    /// Formats a holder as "process 123, `raycl run configs/quick.toml` in /home/ada".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.process == 0 {
            return f.write_str("another process");
        }
        // Text from another user must not control this user's terminal.
        let shown = |text: &str| text.replace(char::is_control, "?");
        let command: String = shown(&self.command).chars().take(LONGEST_COMMAND).collect();
        write!(f, "process {}, `{command}` in {}", self.process, shown(&self.folder))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_nonsense_names_nobody() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        std::fs::write(&path, "x".repeat(10_000)).unwrap();
        assert_eq!(Holder::read(&path).to_string(), "another process");
        let mut file = File::options().write(true).open(&path).unwrap();
        let holder = Holder { process: 7, command: "raycl run \u{1b}[2J".into(), folder: "/home/ada".into() };
        holder.write(&mut file).unwrap();
        assert_eq!(Holder::read(&path), holder);
        assert_eq!(holder.to_string(), "process 7, `raycl run ?[2J` in /home/ada");
        // The description of a lock's later holder replaces the description of an earlier holder. Messages
        // show only the first 200 characters of a holder's command.
        let long = Holder { command: "x".repeat(300), ..holder };
        long.write(&mut file).unwrap();
        assert_eq!(Holder::read(&path), long);
        assert_eq!(long.to_string(), format!("process 7, `{}` in /home/ada", "x".repeat(200)));
        let elsewhere = Holder { folder: "/tmp/\u{1b}[2J".into(), ..long };
        assert!(elsewhere.to_string().ends_with(" in /tmp/?[2J"), "{elsewhere}");
        assert_eq!(Holder::read(&folder.path().join("none")).to_string(), "another process");
    }
}
