//! `raycl cache`: shows or clears the data stored between runs, or prints the path of the folder with these
//! data.

use crate::cache::{Cache, Entry, LIMIT};
use crate::error::{Error, Result};
use crate::memory::readable;
use crate::words::counted;
use serde::Serialize;

/// Arguments of `raycl cache`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl cache
  raycl cache clear
  RAYCL_CACHE_MIB=0 raycl render scenes/teapot.toml   without the cache

The cache is the folder $XDG_CACHE_HOME/raycl, or ~/.cache/raycl if XDG_CACHE_HOME is not set to an absolute path. It contains lists of the OpenCL devices, compiled programs, and short notes about programs, such as which program a scene needed last time. raycl stores one compiled program for each combination of source code, compiler options, device, driver and values of the driver's environment variables. The environment variable RAYCL_CACHE_MIB is the cache's limit in MiB (default: 512; 0 turns the cache off). If the cache exceeds this limit, raycl removes the least recently used entries. Each entry counts towards the limit as at least 4,096 bytes, since a file takes at least that much space on most disks. `raycl cache` shows the sum of the sizes that count towards the limit. raycl can regenerate every entry, and does so if an entry is corrupt. raycl stores entries only if the folder belongs to you, if nobody else may write into it, and if raycl can list it and write into it. Otherwise, `raycl cache` says why raycl stores nothing.")]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// Print one JSON object instead of text
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Clone, Copy, Debug, clap::Subcommand)]
enum Action {
    /// Show the cache's folder, number of entries and size [default]
    Show,
    /// Remove all entries of the cache
    Clear,
    /// Print the path of the cache's folder
    Path,
}

/// The output of `raycl cache show --json` and `raycl cache clear --json`. With `show`, `entries` and `bytes`
/// are the number and the size of the cache's entries; with `clear`, they are the number and the size of the
/// removed entries.
#[derive(Serialize)]
struct Shown {
    /// The path of the cache's folder. Null if the cache has no folder; raycl then stores nothing between runs.
    folder: Option<String>,
    /// The reason why raycl cannot use the folder, and therefore stores nothing between runs. Null if raycl
    /// can use the folder, or if the cache has no folder.
    unusable: Option<&'static str>,
    entries: usize,
    bytes: u64,
    /// The size that raycl compares with the cache's limit: the sum of the entries' sizes, each counted as at
    /// least 4,096 bytes. Absent with `clear`.
    #[serde(skip_serializing_if = "Option::is_none")]
    counted_bytes: Option<u64>,
    limit_bytes: u64,
}

/// Shows or clears the cache, or prints the path of its folder.
pub fn run(args: Args) -> Result<()> {
    let cache = Cache::of_user();
    match args.action.unwrap_or(Action::Show) {
        Action::Show => show(&cache, args.json),
        Action::Clear => clear(&cache, args.json),
        Action::Path => path(&cache, args.json),
    }
}

fn folder(cache: &Cache) -> Result<String> {
    let folder = cache.folder().map(|folder| folder.display().to_string());
    folder.ok_or_else(|| Error::run("the cache is off: nothing is stored").with_help(why_none(cache)))
}

fn path(cache: &Cache, json: bool) -> Result<()> {
    let folder = folder(cache)?;
    match json {
        true => super::print_json(&serde_json::json!({ "folder": folder })),
        false => super::print(folder),
    }
}

fn why_none(cache: &Cache) -> String {
    match cache.limit_bytes() {
        0 => format!("the environment variable {LIMIT} is 0; unset it to get a cache of at most 512 MiB"),
        _ => "neither XDG_CACHE_HOME nor HOME is an absolute path; set one of these environment variables"
            .to_owned(),
    }
}

fn show(cache: &Cache, json: bool) -> Result<()> {
    let shown = Shown::of(cache);
    if json {
        return super::print_json(&shown);
    }
    let Some(folder) = &shown.folder else {
        return super::print(format!("Nothing is stored between runs: {}", why_none(cache)));
    };
    super::print(format!("{folder}: {}", shown.size()))?;
    match shown.unusable {
        Some(why) => super::print(format!("raycl stores nothing in this folder: {why}")),
        None => Ok(()),
    }
}

impl Shown {
    /// Returns what `raycl cache show` prints: the cache's folder, the number and total size of its entries,
    /// the cache's limit, and the reason if the folder cannot be used.
    fn of(cache: &Cache) -> Self {
        let entries = cache.entries();
        Self {
            folder: cache.folder().map(|folder| folder.display().to_string()),
            unusable: cache.why_unusable(),
            entries: entries.len(),
            bytes: entries.iter().map(|entry| entry.bytes).sum(),
            counted_bytes: Some(entries.iter().map(Entry::counted_bytes).sum()),
            limit_bytes: cache.limit_bytes(),
        }
    }

    /// Returns a text with the number of the cache's entries, the size that counts towards the limit, and the
    /// limit.
    fn size(&self) -> String {
        let counted_bytes = self.counted_bytes.unwrap_or(self.bytes);
        let [taken, limit] = [counted_bytes, self.limit_bytes].map(readable);
        format!("{}, {taken} of at most {limit}", counted(self.entries, "entry"))
    }
}

fn clear(cache: &Cache, json: bool) -> Result<()> {
    let folder = folder(cache)?;
    let (entries, bytes) = cache.clear().map_err(|error| {
        Error::run(format!("the cache cannot be cleared: {error}"))
            .with_help(format!("check that you may list and delete files in the cache's folder, {folder}"))
    })?;
    if json {
        let removed = Shown {
            folder: Some(folder),
            unusable: cache.why_unusable(),
            entries,
            bytes,
            counted_bytes: None,
            limit_bytes: cache.limit_bytes(),
        };
        return super::print_json(&removed);
    }
    super::print(format!("{folder}: {} removed, {}", counted(entries, "entry"), readable(bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_entries_are_shown_as_they_count_towards_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::at(folder.path(), 100_000);
        assert!((0..5).all(|key| cache.put("program", &key.to_string(), b"1")));
        let shown = Shown::of(&cache);
        assert_eq!((shown.entries, shown.counted_bytes), (5, Some(20_480)));
        assert!(shown.bytes < 5_000, "{} bytes", shown.bytes);
        assert_eq!(shown.size(), format!("5 entries, {} of at most {}", readable(20_480), readable(100_000)));
    }
}
