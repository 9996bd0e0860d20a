//! The folder a run writes its results to.

use crate::error::{Error, Result};
use crate::image::{Radiance, save, save_rgb8};
use crate::record::{Environment, JsonLines, Record, Sample, summary_csv, summary_markdown};
use crate::scene::Display;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// A folder of results: `records.jsonl`, `samples.jsonl`, `images/`, `environment.json`, and at the end
/// `summary.md` and `summary.csv`. docs/format.md documents each.
pub struct Results {
    folder: PathBuf,
    records: JsonLines<Record>,
    samples: JsonLines<Sample>,
    /// Pictures saved, by what they show, so that points which agree to the last bit share one.
    pictures: HashMap<blake3::Hash, String>,
    /// Every picture's path.
    made: HashSet<String>,
}

impl Results {
    /// Makes the folder. One that holds records already is refused: nothing measured is ever overwritten.
    pub fn create(folder: &Path, environment: &Environment) -> Result<Self> {
        let records = folder.join("records.jsonl");
        if records.exists() {
            let error = Error::input(format!("{} already holds results", folder.display()));
            return Err(error.with_help("name another folder with --out, or remove this one"));
        }
        std::fs::create_dir_all(folder.join("images"))
            .map_err(|error| Error::input(format!("cannot make {}: {error}", folder.display())))?;
        environment.write(&folder.join("environment.json"))?;
        Ok(Self {
            folder: folder.to_owned(),
            records: JsonLines::append_to(&records)?,
            samples: JsonLines::append_to(&folder.join("samples.jsonl"))?,
            pictures: HashMap::new(),
            made: HashSet::new(),
        })
    }

    /// Keeps a record.
    pub fn record(&mut self, record: &Record) -> Result<()> {
        self.records.append(record)
    }

    /// Keeps a sample.
    pub fn sample(&mut self, sample: &Sample) -> Result<()> {
        self.samples.append(sample)
    }

    /// Saves a picture under `images/` and returns its path relative to the folder. A picture equal to one
    /// saved before shares its file.
    pub fn picture(&mut self, name: &str, image: &Radiance, display: Display) -> Result<String> {
        let mut hasher = blake3::Hasher::new();
        for pixel in &image.pixels {
            for channel in pixel {
                hasher.update(&channel.to_le_bytes());
            }
        }
        let hash = hasher.finalize();
        if let Some(path) = self.pictures.get(&hash) {
            return Ok(path.clone());
        }
        let path = self.free_path(name);
        save(image, display, &self.folder.join(&path))?;
        self.pictures.insert(hash, path.clone());
        Ok(path)
    }

    /// A path that no other picture has: points of one strategy may differ in their last bits.
    fn free_path(&mut self, name: &str) -> String {
        let path = |number: u32| match number {
            1 => format!("images/{}.png", file_name(name)),
            _ => format!("images/{}-{number}.png", file_name(name)),
        };
        let free = (1..).map(path).find(|path| !self.made.contains(path)).unwrap_or_else(|| path(1));
        self.made.insert(free.clone());
        free
    }

    /// Makes and saves the picture of this name, unless it was saved before, and returns its path.
    pub fn picture_once(&mut self, name: &str, make: impl FnOnce() -> ::image::RgbImage) -> Result<String> {
        let path = format!("images/{}.png", file_name(name));
        if self.made.insert(path.clone()) {
            save_rgb8(&make(), &self.folder.join(&path))?;
        }
        Ok(path)
    }

    /// Writes the summaries.
    pub fn summarise(&self, records: &[Record], question: &str, expectation: &str) -> Result<()> {
        let write = |name: &str, bytes: &[u8]| {
            let path = self.folder.join(name);
            std::fs::write(&path, bytes)
                .map_err(|error| Error::run(format!("cannot write {}: {error}", path.display())))
        };
        write("summary.md", summary_markdown(records, question, expectation).as_bytes())?;
        write("summary.csv", &summary_csv(records)?)
    }
}

/// A name that is one file in one folder on any system.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_leaves_the_folder() {
        assert_eq!(file_name("../../etc/passwd"), "..-..-etc-passwd");
        assert_eq!(file_name("a b/c\\d<e>"), "a-b-c-d-e-");
    }

    #[test]
    fn results_are_never_overwritten() -> Result<()> {
        let folder = tempfile::tempdir().map_err(|error| Error::run(error.to_string()))?;
        let mut first = Results::create(folder.path(), &Environment::default())?;
        first.record(&Record::default())?;
        let second = Results::create(folder.path(), &Environment::default()).err();
        assert!(second.is_some_and(|error| error.exit_code() == 2));
        Ok(())
    }
}
