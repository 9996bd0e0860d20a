//! A folder into which a command of raycl writes several files.

use super::mark::Maker;
use super::replace::{Choice, permit, put};
use crate::error::{Error, Result};
use crate::existing;
use crate::record::journals::RECORDS;
use crate::record::{cannot_make, ordinary, own_folder, refuse_closed, refuse_file, write_page};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Result as IoResult, Write as _};
use std::path::{Component, Path, PathBuf};

/// The name of the file that lists raycl's files in a folder. Each line of the list has the format of `b3sum`: a hash,
/// two spaces, a name.
const LIST: &str = "raycl.b3sum";

/// A folder, and the list of files that raycl wrote into it.
pub struct OutFolder {
    path: PathBuf,
    choice: Choice,
    /// True if `path` is a folder of results. A folder of results has no list: raycl assumes that it made
    /// each file there that has one of raycl's file names.
    results: bool,
    /// Hash and name of every file that raycl wrote into the folder.
    made: BTreeSet<(String, String)>,
}

impl OutFolder {
    /// Reads a folder's list of the files that raycl made (`raycl.b3sum`). Neither the folder nor its list
    /// needs to exist. Fails if `path` is a file instead of a folder, or if this process may not make the
    /// folder or create files in it. Without `--force`, also fails if the folder's file `raycl.b3sum` is not
    /// a list in the format of `b3sum`. In a folder of results, a file of this name is ignored.
    pub fn open(path: &Path, choice: Choice) -> Result<Self> {
        refuse_file(path).map_err(|error| error.with_help(remedy(choice)))?;
        refuse_closed(path, remedy(choice))?;
        let results = existing::is_file(&path.join(RECORDS))?;
        let list = path.join(LIST);
        let made = if results { Some(BTreeSet::new()) } else { read_list(&list) };
        match made {
            Some(made) => Ok(Self { path: path.to_owned(), choice, results, made }),
            None => {
                permit(&list, choice, |_| Ok(Maker::Other))?;
                Ok(Self { path: path.to_owned(), choice, results, made: BTreeSet::new() })
            }
        }
    }

    /// Returns the folder's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the user's choice for files that raycl did not make.
    pub fn choice(&self) -> Choice {
        self.choice
    }

    /// Returns true if raycl has written into the folder before: the folder is a folder of results, or its list of
    /// raycl's files names at least one file.
    pub fn is_known(&self) -> bool {
        self.results || !self.made.is_empty()
    }

    /// Returns an error if [`write`](Self::write) would refuse files with the names in `names`. Commands call this
    /// function before their work, when the contents of the new files are not known yet. `check` therefore also refuses
    /// an existing file that raycl did not make, even if the file equals the content that would be written. In a folder
    /// of results, raycl may replace every file, so `check` returns no error.
    pub fn check<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<()> {
        if self.results {
            return Ok(());
        }
        let mut names = names.into_iter();
        names.try_for_each(|name| {
            permit(&self.path.join(name), self.choice, |file| self.maker(name, file, None)).map(drop)
        })
    }

    /// Writes files, given as names and contents. If one of the files exists and may not be replaced, no file is
    /// written. The names are paths in the folder; a name that leads out of the folder is an error. In a folder of
    /// results, every file may be replaced.
    pub fn write(&mut self, files: &[(String, Vec<u8>)]) -> Result<()> {
        if let Some((name, _)) = files.iter().find(|(name, _)| !is_inside(name)) {
            let folder = self.path.display();
            return Err(Error::fault(format!(
                "cannot write '{name}', which is not in the folder '{folder}'"
            )));
        }
        let new: BTreeSet<_> = files.iter().map(|(name, bytes)| (hash(bytes), name.clone())).collect();
        if !self.results {
            for (name, bytes) in files {
                let maker = |file: &mut File| self.maker(name, file, Some(bytes));
                permit(&self.path.join(name), self.choice, maker)?;
            }
        }
        self.make_folders(files)?;
        if self.results {
            return files.iter().try_for_each(|(name, bytes)| write_page(&self.path.join(name), bytes));
        }
        // raycl writes the folder's list of hashes before the files, so that the list includes the files even
        // if the command is killed before or while it writes them. Once the files are written, raycl writes
        // the list of hashes again, without the hashes that the replaced files had before.
        self.made.extend(new.iter().cloned());
        self.write_list()?;
        files.iter().try_for_each(|(name, bytes)| self.put(name, bytes))?;
        let replaced = |name: &String| files.iter().any(|(written, _)| written == name);
        self.made.retain(|entry| new.contains(entry) || !replaced(&entry.1));
        self.write_list()
    }

    /// Removes the plots and exports of an earlier report that are not among `written`, the files of the new
    /// report. Keeps plots of pages other than reports, files that cannot be removed, and files that somebody
    /// changed. A folder of results has no list of hashes, so changed files cannot be recognised there and
    /// are removed.
    pub fn remove_stale(&mut self, written: &[(String, Vec<u8>)]) -> Result<()> {
        let is_written = |name: &str| written.iter().any(|(other, _)| other == name);
        if self.results {
            super::stale::remove(&self.path, is_written);
            return Ok(());
        }
        self.remove_listed(|name| super::stale::is_of_report(name) && !is_written(name))
    }

    /// Removes the listed files for whose names `is_stale` is true. Keeps files that somebody changed, and
    /// files that cannot be removed. Removes nothing from a folder of results, which has no list.
    pub fn remove_listed(&mut self, is_stale: impl Fn(&str) -> bool) -> Result<()> {
        let old: Vec<_> = self.made.iter().filter(|(_, name)| is_stale(name)).cloned().collect();
        if old.is_empty() {
            return Ok(());
        }
        for entry in old {
            let path = self.path.join(&entry.1);
            let unchanged =
                ordinary(&path).is_ok() && std::fs::read(&path).is_ok_and(|bytes| hash(&bytes) == entry.0);
            if unchanged && std::fs::remove_file(&path).is_ok() {
                self.made.remove(&entry);
            }
        }
        self.write_list()
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let maker = |file: &mut File| self.maker(name, file, Some(bytes));
        put(&self.path.join(name), self.choice, maker, |file| file.write_all(bytes))
    }

    /// Finds out whether raycl made a file. The file counts as made by raycl if the list has the file's name
    /// with the file's hash, or if the file equals the new content. The file counts as changed if the list
    /// has the file's name, but only with hashes of other contents.
    fn maker(&self, name: &str, file: &mut File, new: Option<&[u8]>) -> IoResult<Maker> {
        let mut hasher = blake3::Hasher::new();
        let old_hash = hasher.update_reader(file)?.finalize().to_hex().to_string();
        let same = new.is_some_and(|new| hash(new) == old_hash);
        let listed = self.made.iter().any(|(_, made)| made == name);
        let made = self.made.contains(&(old_hash, name.to_owned()));
        Ok(match (same || made, listed) {
            (true, _) => Maker::Raycl,
            (false, true) => Maker::Changed,
            (false, false) => Maker::Other,
        })
    }

    /// Creates the folder and the subfolders in which `files` are written; returns an error if a link is in
    /// the place of a subfolder.
    fn make_folders(&self, files: &[(String, Vec<u8>)]) -> Result<()> {
        let remedy = remedy(self.choice);
        let failed = |folder: &Path, error: std::io::Error| cannot_make(folder, &error, remedy.as_str());
        std::fs::create_dir_all(&self.path).map_err(|error| failed(&self.path, error))?;
        let inner: BTreeSet<_> = files.iter().filter_map(|(name, _)| Path::new(name).parent()).collect();
        for folder in inner.into_iter().filter(|folder| *folder != Path::new("")) {
            let folder = self.path.join(folder);
            own_folder(&folder).map_err(|error| failed(&folder, error))?;
        }
        Ok(())
    }

    fn write_list(&self) -> Result<()> {
        let mut lines: Vec<_> = self.made.iter().map(|(hash, name)| format!("{hash}  {name}\n")).collect();
        lines.sort_by(|a, b| a[66..].cmp(&b[66..]));
        write_page(&self.path.join(LIST), lines.concat().as_bytes())
    }
}

/// Returns the advice to a user whose output folder cannot be made or written to.
fn remedy(choice: Choice) -> String {
    format!("`{}` writes elsewhere", choice.elsewhere)
}

/// Returns true if a path made of a folder and `name` surely leads to a file in this folder. A name with `..`
/// may lead out of the folder. If the name is an absolute path, `Path::join` drops the folder.
fn is_inside(name: &str) -> bool {
    Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Returns the hashes and names in a list of files. If the list does not exist, the result has no entries. If the file
/// at `path` is not a list, the result is `None`.
fn read_list(path: &Path) -> Option<BTreeSet<(String, String)>> {
    if path.symlink_metadata().is_err() {
        return Some(BTreeSet::new());
    }
    ordinary(path).ok()?;
    let entry = |line: &str| {
        let (hash, name) = line.split_once("  ")?;
        (hash.len() == 64 && hash.bytes().all(|digit| digit.is_ascii_hexdigit()))
            .then(|| (hash.to_owned(), name.to_owned()))
    };
    std::fs::read_to_string(path).ok()?.lines().map(entry).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    const KEEP: Choice = Choice::new(false, "--out DIR");

    fn files(text: &str) -> Vec<(String, Vec<u8>)> {
        ["page.html", "plots/one.svg"].map(|name| (name.to_owned(), text.into())).to_vec()
    }

    fn write(path: &Path, choice: Choice, text: &str) -> Result<()> {
        OutFolder::open(path, choice)?.write(&files(text))
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_in_which_no_file_can_be_created_is_refused_before_any_work() {
        // Not even the superuser can create files in /proc/sys.
        for (path, start) in [("/proc/sys", ""), ("/proc/sys/new", "cannot make /proc/sys/new: ")] {
            let error = OutFolder::open(Path::new(path), KEEP).err().unwrap();
            assert_eq!((error.exit_code(), error.remedy()), (2, "`--out DIR` writes elsewhere"));
            let expected = format!("{start}the folder '/proc/sys' cannot be written to (");
            assert!(error.to_string().starts_with(&expected), "{error}");
        }
    }

    #[test]
    fn what_raycl_wrote_is_replaced_and_what_was_changed_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new");
        write(&out, KEEP, "one").unwrap();
        write(&out, KEEP, "two").unwrap();
        std::fs::write(out.join("plots/one.svg"), "mine").unwrap();
        let error = OutFolder::open(&out, KEEP).unwrap().check(["page.html", "plots/one.svg"]).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("plots/one.svg' has been changed since"), "{error}");
        assert!(write(&out, KEEP, "three").is_err());
        // Since one of the files could not be replaced, no file was written.
        assert_eq!(std::fs::read(out.join("page.html")).unwrap(), b"two");
        write(&out, Choice { force: true, ..KEEP }, "four").unwrap();
        assert_eq!(std::fs::read(out.join("plots/one.svg")).unwrap(), b"four");
        write(&out, KEEP, "five").unwrap();
        assert_eq!(std::fs::read_to_string(out.join(LIST)).unwrap().lines().count(), 2);
    }

    #[test]
    fn a_file_in_the_place_of_the_folder_is_a_mistake_of_the_user() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "mine").unwrap();
        for (out, end) in [(file.clone(), "a folder is needed here"), (file.join("inner"), "file' is a file")]
        {
            let error = OutFolder::open(&out, KEEP).err().unwrap();
            assert!(error.exit_code() == 2 && error.to_string().ends_with(end), "{error}");
            // Another program may also create a file at the folder's path while the command works.
            let made = OutFolder { path: out, choice: KEEP, results: false, made: BTreeSet::new() };
            let error = made.make_folders(&[]).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().ends_with(end), "{error}");
        }
        assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    }

    #[test]
    fn no_name_leads_out_of_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let absolute = folder.path().join("other.txt").display().to_string();
        for name in [absolute.as_str(), "../other.txt", "plots/../../other.txt"] {
            let out = folder.path().join("out");
            let files = [("page.html".to_owned(), b"page".to_vec()), (name.to_owned(), b"other".to_vec())];
            let error = OutFolder::open(&out, KEEP).unwrap().write(&files).unwrap_err();
            assert!(error.to_string().contains(&format!("cannot write '{name}'")), "{error}");
            assert!(!folder.path().join("other.txt").exists() && !out.exists(), "{name}");
        }
    }

    #[test]
    fn others_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("page.html"), "mine").unwrap();
        let error = write(folder.path(), KEEP, "one").unwrap_err();
        assert!(error.to_string().contains("raycl did not make it"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        // A file that already has the content that would be written may be replaced, even if raycl did not
        // make it.
        std::fs::write(folder.path().join("page.html"), "one").unwrap();
        write(folder.path(), KEEP, "one").unwrap();
        std::fs::write(folder.path().join(LIST), "my notes").unwrap();
        let error = write(folder.path(), KEEP, "two").unwrap_err();
        assert!(error.to_string().contains(LIST), "{error}");
    }

    #[test]
    fn a_copy_of_another_file_of_the_folder_stays() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let files = |page: &str, plot: &str| {
            [("page.html", page), ("plot.svg", plot)].map(|(n, t)| (n.to_owned(), t.into()))
        };
        OutFolder::open(out, KEEP).unwrap().write(&files("page", "plot")).unwrap();
        std::fs::copy(out.join("plot.svg"), out.join("page.html")).unwrap();
        let error = OutFolder::open(out, KEEP).unwrap().write(&files("new page", "new plot")).unwrap_err();
        assert!(error.to_string().contains("page.html' has been changed since"), "{error}");
        assert_eq!(std::fs::read(out.join("page.html")).unwrap(), b"plot");
    }

    #[test]
    fn plots_of_what_is_no_longer_shown_go_unless_somebody_changed_them() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let files = |names: &[&str]| {
            names.iter().map(|name| (name.to_string(), b"plot".to_vec())).collect::<Vec<_>>()
        };
        let mut opened = OutFolder::open(out, KEEP).unwrap();
        let plots = ["plots/scenes-1.svg", "plots/scenes-2.svg", "plots/scenes-3.svg"];
        opened.write(&files(&["page.html", "plots/answer-teapot.svg", "plots/compare.svg"])).unwrap();
        opened.write(&files(&plots)).unwrap();
        std::fs::write(out.join(plots[1]), "mine").unwrap();
        std::fs::write(out.join("plots/scenes.svg"), "mine too").unwrap();
        let now = files(&plots[2..]);
        opened.write(&now).unwrap();
        opened.remove_stale(&now).unwrap();
        let there = |name: &str| out.join(name).exists();
        assert_eq!(plots.map(there), [false, true, true]);
        assert!(there("plots/scenes.svg") && there("page.html"));
        assert!(there("plots/answer-teapot.svg") && there("plots/compare.svg"), "plots of other pages");
    }

    #[test]
    fn what_a_killed_command_left_is_known() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), KEEP, "one").unwrap();
        let mut killed = OutFolder::open(folder.path(), KEEP).unwrap();
        killed.made.extend(files("two").iter().map(|(name, bytes)| (hash(bytes), name.clone())));
        killed.write_list().unwrap();
        killed.put("page.html", b"two").unwrap();
        write(folder.path(), KEEP, "three").unwrap();
    }

    #[test]
    fn the_list_is_sorted_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["b1", "a2", "a1"].map(|name| (name.to_owned(), name.as_bytes().to_vec()));
        OutFolder::open(folder.path(), KEEP).unwrap().write(&files).unwrap();
        let list = std::fs::read_to_string(folder.path().join(LIST)).unwrap();
        let names: Vec<_> =
            list.lines().filter_map(|line| line.split_once("  ")).map(|(_, name)| name).collect();
        assert_eq!(names, ["a1", "a2", "b1"]);
    }

    #[test]
    fn a_folder_is_known_once_raycl_wrote_into_it_or_if_it_has_records() {
        let folder = tempfile::tempdir().unwrap();
        let is_known = || OutFolder::open(folder.path(), KEEP).unwrap().is_known();
        assert!(!is_known());
        write(folder.path(), KEEP, "one").unwrap();
        assert!(is_known());
        let results = tempfile::tempdir().unwrap();
        std::fs::write(results.path().join("records.jsonl"), "").unwrap();
        assert!(OutFolder::open(results.path(), KEEP).unwrap().is_known());
    }

    /// A folder of results has no list; raycl assumes that it made every file there that has one of raycl's
    /// file names.
    #[test]
    fn files_of_results_are_replaced_and_stale_plots_removed_without_a_list() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        std::fs::write(out.join("records.jsonl"), "").unwrap();
        std::fs::create_dir(out.join("plots")).unwrap();
        for name in ["page.html", "plots/one.svg", "plots/scenes.svg"] {
            std::fs::write(out.join(name), "earlier").unwrap();
        }
        let mut opened = OutFolder::open(out, KEEP).unwrap();
        opened.check(["page.html"]).unwrap();
        opened.write(&files("new")).unwrap();
        opened.remove_stale(&files("new")).unwrap();
        let text = |name: &str| std::fs::read_to_string(out.join(name)).ok();
        let new = Some("new".to_owned());
        assert_eq!(
            [text("page.html"), text("plots/one.svg"), text("plots/scenes.svg")],
            [new.clone(), new, None]
        );
        assert_eq!(text(LIST), None);
    }

    #[test]
    fn what_was_removed_is_no_longer_listed() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), KEEP, "one").unwrap();
        let mut opened = OutFolder::open(folder.path(), KEEP).unwrap();
        opened.remove_listed(|name| name == "page.html").unwrap();
        assert!(!folder.path().join("page.html").exists());
        let list = std::fs::read_to_string(folder.path().join(LIST)).unwrap();
        assert_eq!(list, format!("{}  plots/one.svg\n", hash(b"one")));
    }

    #[test]
    fn only_lines_of_a_hash_and_a_name_are_a_list() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LIST);
        let opens = |text: &str| {
            std::fs::write(&path, text).unwrap();
            OutFolder::open(folder.path(), KEEP).is_ok()
        };
        let hash = hash(b"one");
        assert!(opens(&format!("{hash}  a\n")));
        for text in
            [format!("{hash} a\n"), format!("{}  a\n", &hash[1..]), format!("{}  a\n", "x".repeat(64))]
        {
            assert!(!opens(&text), "{text}");
        }
    }
}
