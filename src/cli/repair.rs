//! `raycl repair`: removes damaged lines from a folder's journals (the files to which a run appends lines, such as
//! records.jsonl), and names other files that cannot be read.

use crate::error::{Error, Result};
use crate::existing;
use crate::experiment::Lock;
use crate::peak::Peak;
use crate::record::journals::{RECORDS, SHARDS};
use crate::record::{CurrentPlan, Repaired, no_results, refuse_closed, repair};
use crate::shard::{Attempt, Kind, ShardPlan, State, status};
use crate::words::counted_are;
use serde_json::{Value, json};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The time between two readings of the attempts' counters. A running attempt increases its counter once per second.
const BETWEEN: Duration = Duration::from_secs(5);

/// Arguments of `raycl repair`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  raycl repair results/quick
  raycl run configs/quick.toml --resume      measures the points of the removed lines again
  raycl repair /shared/figure-8              also repairs the results of each shard of an experiment")]
pub struct Args {
    /// The folder of results that `raycl run` or `raycl run --shard` wrote
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// Removes damaged lines from the folder's journals: records, samples, ends of launches, rounds, samples of
/// the anchor and records of control points. A copy of each changed file's original stays in the same folder.
/// Other files, such as plan.json, cannot be repaired. If a file other than a journal cannot be read, the
/// command says what to do. If the folder is that of an experiment in shards, the journals of all attempts
/// are repaired too, except those of attempts that may be running. A running attempt increases a counter once
/// per second. If some attempts have not reported their end, the repair reads the counters of all attempts
/// twice, five seconds apart. If an attempt has not reported its end, but its counter has not increased, the attempt
/// was lost, so its journals are repaired. If a journal cannot be read, no journal in its folder is changed. A repair
/// is impossible if a journal cannot be read, if a link is in the place of a file, or if a file cannot be written. The
/// command then repairs everything else that it can repair, and ends with an error.
pub fn run(args: Args) -> Result<()> {
    let findings = Findings::of(&args.folder, BETWEEN)?;
    findings.print(args.json)?;
    findings.end()
}

/// The remedy for a folder in which this process may not create files.
const CLOSED: &str = "change the folder's permissions, or repair a copy";
/// The remedy for a file that cannot be written, for example because the disk is full.
const FULL: &str =
    "free up space on the file's disk, or repair a copy on another disk; then run the command again";

/// The remedy for a lock whose file is a link, a pipe or a device.
const NO_LOCK: &str = "remove this file, since raycl makes a new one";
/// The remedy if another process holds the lock of the folder.
const WAIT: &str = "wait until that run ends";

/// What `raycl repair` found in a folder of results.
#[derive(Default)]
struct Findings {
    /// The journals that were repaired, each with the path of the copy of its original.
    repaired: Vec<Repaired>,
    /// The errors about unreadable files other than journals (for example plan.json), and the errors that prevented a
    /// repair. The error in `failure` is left out.
    unreadable: Vec<Error>,
    /// Number of attempts that could not be repaired because of mistakes of the user.
    refused: usize,
    /// The folders of attempts that may still be running, whose journals were therefore not repaired.
    running: Vec<PathBuf>,
    /// The first error that ends the command; `None` if there is no such error. A mistake of the user that prevents the
    /// repair of an attempt is not such an error: it is only counted in `refused`. Later errors are in `unreadable`.
    failure: Option<Error>,
}

impl Findings {
    /// Repairs the journals of a folder: files to which a run appends lines, such as records.jsonl. If the
    /// folder is that of an experiment in shards, also repairs the journals of all attempts that have ended
    /// or were lost. To find the attempts that have ended or were lost, reads the counters of all attempts
    /// twice (a running attempt increases its counter once per second). `between` is the time from the first
    /// reading to the second.
    fn of(folder: &Path, between: Duration) -> Result<Self> {
        // A damaged plan does not prevent the repair of the attempts' journals.
        let has_shards = existing::is_file(&folder.join(SHARDS))?;
        if !has_shards && !existing::is_file(&folder.join(RECORDS))? {
            return Err(no_results(folder));
        }
        let _lock = lock_of(folder)?;
        let mut findings = Self::default();
        findings.repair_all(folder, has_shards.then_some(between));
        Ok(findings)
    }

    /// Repairs the journals in `folder` and, if `between` is given, those of the attempts.
    fn repair_all(&mut self, folder: &Path, between: Option<Duration>) {
        let repaired = repair(folder, &mut self.repaired);
        self.keep(repaired);
        self.unreadable.extend(unreadable(folder));
        if let Some(between) = between {
            let repaired = self.repair_attempts(folder, between);
            self.keep(repaired);
        }
    }

    fn repair_attempts(&mut self, folder: &Path, between: Duration) -> Result<()> {
        let stopped = stopped(folder, between)?;
        for attempt in Attempt::all(folder)? {
            match self.repair(attempt.folder, stopped.contains(&attempt.name)) {
                Err(error @ Error::Input(_)) => {
                    self.refused += 1;
                    self.unreadable.push(error);
                }
                other => self.keep(other),
            }
        }
        Ok(())
    }

    /// Repairs the journals in `attempt`, an attempt's folder. If the attempt may be running, adds the folder
    /// to `running` instead.
    fn repair(&mut self, attempt: PathBuf, is_stopped: bool) -> Result<()> {
        if is_stopped {
            refuse_lockless(&attempt)?;
        }
        match is_stopped.then(|| Lock::take(&attempt)) {
            Some(Ok(_lock)) => {
                repair(&attempt, &mut self.repaired)?;
                self.unreadable.extend(unreadable(&attempt));
            }
            // The attempt may be running: its state is neither `Ended` nor `Lost`, or another process holds the
            // lock of its folder.
            None | Some(Err(Error::Input(_))) => self.running.push(attempt),
            Some(Err(error)) => return Err(error),
        }
        Ok(())
    }

    /// Stores the error of a repair, so that the other journals are still repaired.
    fn keep(&mut self, repaired: Result<()>) {
        let Err(error) = repaired.map_err(|error| error.without_out(FULL, CLOSED)) else { return };
        match self.failure {
            None => self.failure = Some(error),
            Some(_) => self.unreadable.push(error),
        }
    }

    /// Prints the findings, unless the repair failed before it found anything.
    fn print(&self, json: bool) -> Result<()> {
        match self.text() {
            text if text.is_empty() => Ok(()),
            _ if json => super::print_json(&self.json()),
            text => super::print(text),
        }
    }

    /// Returns the first error of the repair, or an error if the user's mistakes prevented the repair of attempts.
    fn end(self) -> Result<()> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        if self.refused == 0 {
            return Ok(());
        }
        let message = format!("{} not repaired", counted_are(self.refused, "attempt"));
        Err(Error::input(message).with_help("the output says what to do; then run the command again"))
    }

    /// Returns a text for the user, with one line for each repaired journal, each unreadable file and each attempt that
    /// may be running. If nothing was repaired and every file can be read, the text says that no line is damaged, even
    /// if attempts that may be running were not checked. If the repair failed before it found anything, the text is
    /// empty.
    fn text(&self) -> String {
        let line = |Repaired { file, copy, damaged, kept }: &Repaired| {
            let (file, copy) = (file.display(), copy.display());
            format!(
                "{file}: removed damaged lines: {damaged}, lines kept: {kept}; copy of the original: {copy}"
            )
        };
        let mut lines: Vec<String> = self.repaired.iter().map(line).collect();
        lines.extend(self.unreadable.iter().map(|error| format!("{error}; {}", error.remedy())));
        let is_sound = lines.is_empty() && self.failure.is_none();
        lines.extend(is_sound.then(|| "no line is damaged".to_owned()));
        let running = |folder: &PathBuf| {
            format!("{}: not repaired, since the attempt may still be running", folder.display())
        };
        lines.extend(self.running.iter().map(running));
        lines.join("\n")
    }

    /// Returns the object for `--json`. JSON requires UTF-8, so `display` replaces the bytes of a path that
    /// are not UTF-8.
    fn json(&self) -> Value {
        let shown = |path: &PathBuf| path.display().to_string();
        let one = |Repaired { file, copy, damaged, kept }: &Repaired| {
            let [file, copy] = [file, copy].map(shown);
            json!({ "file": file, "copy": copy, "damaged": damaged, "kept": kept })
        };
        let problem = |error: &Error| json!({ "message": error.to_string(), "remedy": error.remedy() });
        json!({
            "repaired": self.repaired.iter().map(one).collect::<Vec<_>>(),
            "unreadable": self.unreadable.iter().map(problem).collect::<Vec<_>>(),
            "running": self.running.iter().map(shown).collect::<Vec<_>>(),
        })
    }
}

/// Returns an error for each file of a folder, other than a journal, that cannot be read. The checked files
/// are the plan, the peak rates and, for an experiment in shards, the shards' plan and one file per kind of device. If
/// several of the files for kinds of devices cannot be read, only the first of them is reported. Some other commands
/// refuse a folder with a file that cannot be read.
fn unreadable(folder: &Path) -> Vec<Error> {
    let errors = [
        ShardPlan::read(folder).err(),
        CurrentPlan::read(folder).err(),
        Peak::stored_in(folder).err(),
        Kind::all(folder).err(),
    ];
    errors.into_iter().flatten().collect()
}

/// Takes the lock of `folder`. Returns an error if this process may not create files in the folder, if another process
/// holds the lock, or if the lock's file is a link, a pipe or a device.
fn lock_of(folder: &Path) -> Result<Lock> {
    refuse_lockless(folder)?;
    Lock::take(folder).map_err(|error| advised(error, WAIT))
}

/// Returns an error if this process may not create files in `folder`, or if the file of the folder's lock is a link, a
/// pipe or a device.
fn refuse_lockless(folder: &Path) -> Result<()> {
    refuse_closed(folder, CLOSED)?;
    Lock::refuse_link(folder).map_err(|error| advised(error, NO_LOCK))
}

/// Replaces the remedy of a user's mistake, or of a file that cannot be written. The usual remedies name `--out`, which
/// `raycl repair` lacks.
fn advised(error: Error, remedy: &str) -> Error {
    match error {
        Error::Input(_) => error.with_help(remedy),
        _ => error.without_out(FULL, CLOSED),
    }
}

/// Returns the names of the attempts that have ended or were lost. The lock of an attempt's folder does not show
/// reliably whether the attempt has ended: a file system may have no locks, and a machine may not see the locks of
/// another machine.
fn stopped(folder: &Path, between: Duration) -> Result<HashSet<String>> {
    let all = status(folder, between)?.into_iter();
    Ok(all.filter(|one| matches!(one.state, State::Ended(_) | State::Lost)).map(|one| one.name).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::record::journals::SAMPLES;
    use crate::shard::{About, End};

    /// A folder of shards that has not been merged yet has no journal of records.
    #[test]
    fn the_journals_of_attempts_are_repaired_unless_an_attempt_is_running() {
        let folder_of_results = tempfile::tempdir().unwrap();
        let out = folder_of_results.path();
        let journals = [1, 2].map(|shard| {
            let attempt = Attempt::begin(out, &About { shard, of: 2, ..About::default() }).unwrap();
            std::fs::write(attempt.folder.join(RECORDS), "rubbish\n").unwrap();
            attempt.ended(&End::Interrupted).unwrap();
            attempt.folder.join(RECORDS)
        });
        let of = |out| Findings::of(out, Duration::ZERO);
        let error = of(out).err().unwrap();
        assert!(error.exit_code() == 2 && error.to_string().contains("holds no results"), "{error}");
        let plan = serde_json::to_string(&ShardPlan::default()).unwrap();
        std::fs::write(out.join("shards.json"), plan).unwrap();
        let running = Lock::take(journals[1].parent().unwrap()).unwrap();
        let [first, second] = journals.each_ref().map(|journal| journal.display().to_string());
        let findings = of(out).unwrap();
        let text = findings.text();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with(&format!("{first}: removed damaged lines: 1, lines kept: 0")), "{text}");
        let folder = second.strip_suffix("/records.jsonl").unwrap();
        assert_eq!(lines[1..], [format!("{folder}: not repaired, since the attempt may still be running")]);
        assert_eq!(
            (&findings.json()["repaired"][0]["file"], &findings.json()["running"][0]),
            (&first.into(), &folder.into())
        );
        drop(running);
        assert!(of(out).unwrap().text().starts_with(&second));
        assert_eq!(of(out).unwrap().text(), "no line is damaged");
    }

    #[test]
    fn other_files_that_cannot_be_read_are_reported_with_their_remedies() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        std::fs::write(out.join(RECORDS), "").unwrap();
        let of = || Findings::of(out, Duration::ZERO).unwrap();
        assert_eq!(of().text(), "no line is damaged");
        std::fs::create_dir(out.join("kinds")).unwrap();
        let files = ["shards.json", "plan.json", "peak.json", "kinds/gpu-1.jsonl"].map(|file| out.join(file));
        files.iter().for_each(|file| std::fs::write(file, "rubbish\n").unwrap());
        let (text, json) = (of().text(), of().json());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), files.len(), "{text}");
        for (index, file) in files.iter().enumerate() {
            let file = file.display().to_string();
            let [message, remedy] = ["message", "remedy"].map(|key| json["unreadable"][index][key].as_str());
            assert!(message.unwrap().contains(&file), "{json}");
            assert_eq!(lines[index], format!("{}; {}", message.unwrap(), remedy.unwrap()));
        }
        // An unreadable file in an attempt's folder is reported too, since `raycl merge` would refuse the
        // folder.
        files.iter().for_each(|file| std::fs::remove_file(file).unwrap());
        std::fs::write(out.join("shards.json"), serde_json::to_string(&ShardPlan::default()).unwrap())
            .unwrap();
        let attempt = Attempt::begin(out, &About { shard: 1, of: 1, ..About::default() }).unwrap();
        attempt.ended(&End::Interrupted).unwrap();
        let rates = attempt.folder.join("peak.json");
        std::fs::write(&rates, "rubbish\n").unwrap();
        let text = of().text();
        assert!(text.starts_with(&format!("{} does not contain", rates.display())), "{text}");
    }

    #[test]
    fn a_plan_of_shards_that_violates_a_rule_does_not_prevent_the_repair_of_the_attempts() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let plan = ShardPlan { points: vec!["a point of no block".into()], ..ShardPlan::default() };
        std::fs::write(out.join(SHARDS), serde_json::to_string(&plan).unwrap()).unwrap();
        let attempt = Attempt::begin(out, &About { shard: 1, of: 1, ..About::default() }).unwrap();
        std::fs::write(attempt.folder.join(RECORDS), "rubbish\n").unwrap();
        attempt.ended(&End::Interrupted).unwrap();
        let findings = Findings::of(out, Duration::ZERO).unwrap();
        assert_eq!(findings.repaired.len(), 1, "{}", findings.text());
        let messages: Vec<String> = findings.unreadable.iter().map(Error::to_string).collect();
        assert!(messages.len() == 1 && messages[0].contains("shards.json is damaged: "), "{messages:?}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_in_which_no_file_can_be_created_is_the_users_mistake() {
        // Not even the superuser can create files in /proc/sys.
        let closed = || PathBuf::from("/proc/sys");
        let mut findings = Findings::default();
        for error in [lock_of(&closed()).err().unwrap(), findings.repair(closed(), true).unwrap_err()] {
            assert_eq!((error.exit_code(), error.remedy()), (2, CLOSED));
            let message = error.to_string();
            assert!(message.starts_with("the folder '/proc/sys' cannot be written to ("), "{message}");
        }
        findings.repair(closed(), false).unwrap();
        assert_eq!(findings.running, [closed()]);
    }

    #[test]
    fn an_attempt_whose_lock_cannot_be_opened_is_an_error_and_not_taken_for_running() {
        let folder = tempfile::tempdir().unwrap();
        // The test makes a folder with the name of the lock's file, so raycl cannot open the lock.
        std::fs::create_dir(folder.path().join(".lock")).unwrap();
        let mut findings = Findings::default();
        let error = findings.repair(folder.path().to_owned(), true).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().starts_with("cannot write ") && findings.running.is_empty(), "{error}");
    }

    #[test]
    fn what_was_repaired_before_and_after_a_failure_is_reported_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        std::fs::write(out.join("shards.json"), serde_json::to_string(&ShardPlan::default()).unwrap())
            .unwrap();
        let attempts = [1, 2, 3].map(|shard| {
            let attempt = Attempt::begin(out, &About { shard, of: 3, ..About::default() }).unwrap();
            attempt.ended(&End::Interrupted).unwrap();
            attempt.folder
        });
        let last = attempts[2].join(RECORDS);
        for journal in [&out.join(RECORDS), &last] {
            std::fs::write(journal, "rubbish\n").unwrap();
        }
        // raycl cannot open a lock whose file is a folder.
        attempts[..2].iter().for_each(|attempt| std::fs::create_dir(attempt.join(".lock")).unwrap());
        let text_of = |findings: Findings| (findings.text(), findings.end().unwrap_err());
        let (text, error) = text_of(Findings::of(out, Duration::ZERO).unwrap());
        let journal = out.join(RECORDS).display().to_string();
        assert!(text.starts_with(&format!("{journal}: removed damaged lines: 1")), "{text}");
        assert!(text.contains(&format!("{}: removed damaged lines: 1", last.display())), "{text}");
        let second = attempts[1].join(".lock").display().to_string();
        assert!(text.lines().any(|line| line.starts_with(&format!("cannot write {second}"))), "{text}");
        assert!(error.exit_code() == 1 && error.to_string().starts_with("cannot write "), "{error}");
        assert_eq!(error.remedy(), FULL);
        std::fs::remove_dir(attempts[1].join(".lock")).unwrap();
        let (text, _) = text_of(Findings::of(out, Duration::ZERO).unwrap());
        assert_eq!(text, "", "a failed repair must not print \"no line is damaged\"");
    }

    #[cfg(unix)]
    #[test]
    fn an_attempt_whose_lock_is_a_link_is_an_error_and_not_taken_for_running() {
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink("elsewhere", folder.path().join(".lock")).unwrap();
        let mut findings = Findings::default();
        let error = findings.repair(folder.path().to_owned(), true).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("it is a link"), "{error}");
        assert!(findings.running.is_empty() && !folder.path().join("elsewhere").exists());
        assert_eq!(lock_of(folder.path()).err().unwrap().remedy(), NO_LOCK);
    }

    #[cfg(unix)]
    #[test]
    fn an_attempt_that_is_refused_does_not_stop_the_repair_of_the_others() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        std::fs::write(out.join("shards.json"), serde_json::to_string(&ShardPlan::default()).unwrap())
            .unwrap();
        let attempts = [1, 2, 3].map(|shard| {
            let attempt = Attempt::begin(out, &About { shard, of: 3, ..About::default() }).unwrap();
            std::fs::write(attempt.folder.join(RECORDS), "rubbish\n").unwrap();
            attempt.ended(&End::Interrupted).unwrap();
            attempt.folder
        });
        std::os::unix::fs::symlink("elsewhere", attempts[0].join(".lock")).unwrap();
        std::fs::write(out.join("elsewhere"), "rubbish\n").unwrap();
        std::os::unix::fs::symlink(out.join("elsewhere"), attempts[1].join(SAMPLES)).unwrap();
        let findings = Findings::of(out, Duration::ZERO).unwrap();
        assert_eq!(findings.repaired.len(), 1, "{}", findings.text());
        // One of the journals of this attempt is a link, so raycl reports an error and changes none of these journals.
        assert_eq!(std::fs::read_to_string(attempts[1].join(RECORDS)).unwrap(), "rubbish\n");
        let messages: Vec<String> = findings.unreadable.iter().map(Error::to_string).collect();
        assert!(messages.len() == 2 && messages.iter().all(|it| it.contains("it is a link")), "{messages:?}");
        assert!(findings.unreadable.iter().any(|error| error.remedy() == NO_LOCK), "{messages:?}");
        let end = findings.end().unwrap_err();
        assert_eq!((end.exit_code(), end.to_string().as_str()), (2, "2 attempts are not repaired"));
        std::fs::remove_file(attempts[0].join(".lock")).unwrap();
        std::fs::remove_file(attempts[1].join(SAMPLES)).unwrap();
        let findings = Findings::of(out, Duration::ZERO).unwrap();
        let text = findings.text();
        assert!(findings.repaired.len() == 2 && findings.end().is_ok(), "{text}");
    }

    #[test]
    fn a_folder_to_which_another_run_writes_is_refused_with_a_remedy_that_repair_offers() {
        let folder = tempfile::tempdir().unwrap();
        let _held = Lock::take(folder.path()).unwrap();
        let refused = lock_of(folder.path()).err().unwrap();
        assert_eq!((refused.exit_code(), refused.remedy()), (2, WAIT));
    }

    /// On a file system without locks, only an attempt's counter shows that the attempt is running.
    #[test]
    fn an_attempt_that_may_be_running_is_not_repaired_even_without_a_lock() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let plan = serde_json::to_string(&ShardPlan::default()).unwrap();
        let attempt = Attempt::begin(out, &About { shard: 1, of: 1, ..About::default() }).unwrap();
        std::fs::write(out.join("shards.json"), plan).unwrap();
        std::fs::write(attempt.folder.join(RECORDS), "rubbish\n").unwrap();
        let findings = Findings::of(out, Duration::ZERO).unwrap();
        assert!(
            findings.repaired.is_empty() && findings.running == [attempt.folder.clone()],
            "{}",
            findings.text()
        );
        // The counter of an attempt that was lost (whose process was killed) does not increase.
        std::fs::write(attempt.folder.join("pulse"), "7 0 1\n").unwrap();
        let findings = Findings::of(out, Duration::ZERO).unwrap();
        assert!(findings.repaired.len() == 1 && findings.running.is_empty(), "{}", findings.text());
    }
}
