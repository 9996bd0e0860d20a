//! Merges the results of attempts (processes that each measured a shard) into one folder, like the folder of a run
//! without shards. A merge needs no device, and its results depend on no clock. A merge does not change the attempts'
//! folders.

mod again;
mod choice;
mod controls;
mod environment;
mod launches;
mod meant;
mod origins;
mod other_plan;
mod pictures;
mod planned;

use super::missing::{self, Missing, Wanted};
use super::{About, Attempt, End, Kind, ShardPlan};
use crate::error::{Error, Result};
use crate::existing;
use crate::peak::{self, Peak};
use crate::record::journals::{ANCHORS, CONTROLS, LAUNCHES, RECORDS, ROUNDS, SAMPLES};
use crate::record::{
    AnchorSample, CurrentPlan, LaunchEnd, MERGE, Record, RoundLoad, Sample, not_a_folder, read_lines_if_any,
};
use crate::record::{remove_leftovers, write_json, write_whole_by};
use crate::words::counted;
use choice::{Chosen, choose};
use controls::controls;
use launches::Launches;
use meant::{meant_kinds, types_of_devices};
use origins::{OfLaunch, Origins, each_line};
use planned::Planned;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Duration;

/// A merge removes temporary files whose age is at least `ABANDONED`. Another process may still be writing a
/// younger temporary file. The results of a merge do not depend on `ABANDONED`.
const ABANDONED: Duration = Duration::from_secs(3600);

/// What a merge of attempts has written, and what is still missing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Merged {
    /// Number of attempts at the experiment's shards, with or without records.
    pub attempts: usize,
    /// Number of merged records. On each selected kind of device, each point with a record counts once.
    pub records: usize,
    /// Three numbers of samples: samples of the merged records, samples of the records in `controls.jsonl`,
    /// and all other samples.
    pub samples: [usize; 3],
    /// Notes to be shown with the results.
    pub notes: Vec<String>,
    /// The points that still have to be measured, and the points that failed.
    pub missing: Missing,
}

/// A record, and the index of the attempt that measured it.
type Measured = (usize, Record);

/// Merges the attempts of a folder, and writes all files except the summaries, the report, and the report's plots and
/// exports. `meant` contains words that select kinds of device. Each word is `all`, a type of device (`cpu`, `gpu`,
/// `accelerator`) or a part of a kind's description. A word that consists only of digits matches a whole number in the
/// description, but not a part of a longer number. Without words, the results of all kinds of device that took part are
/// merged. The results of baselines, which run on the host, are always merged. If kinds of device took part, but no
/// word selects one of them, returns an error and writes nothing.
pub fn merge(out: &Path, meant: &[String]) -> Result<Merged> {
    let plan = ShardPlan::read(out)?.ok_or_else(|| no_shards(out))?;
    refuse_other_results(out)?;
    let attempts = Attempt::all(out)?;
    refuse_lost_attempts(out, &attempts)?;
    let chosen = choose(&attempts)?;
    // The kinds of device are read after the records. An attempt writes the files of its kinds of device
    // before its first record. For each record that was read, the record's kind of device is therefore read
    // too, even if the record's attempt has only just begun.
    let all = Kind::all(out)?;
    let (kinds, not_begun) = meant_kinds(&all, &types_of_devices(&attempts)?, meant)?;
    chosen.refuse_unlisted(out, &all, &attempts)?;
    remove_leftovers(out, ABANDONED);
    let planned = Planned::of(&plan, &kinds);
    let wanted = Wanted { all: &all, kinds: &kinds, not_begun: &not_begun };
    let abouts = attempts.iter().map(Attempt::about).collect::<Result<Vec<_>>>()?;
    let abouts: Vec<About> = abouts.into_iter().flatten().collect();
    let missing = missing::missing(out, &plan, wanted, &abouts, &|key| chosen.outcome(key));
    let mut notes = notes(&plan, &chosen, &attempts)?;
    let mut records: Vec<Measured> = chosen.of_keys(planned.keys());
    let origins = Origins::read(&attempts)?;
    let mut controls = controls(&attempts, &origins, &records)?;
    let launches = Launches::of(origins, records.iter().chain(&controls));
    // The file `merge.json`, which shows that a merge wrote the folder, is written first. If this merge is
    // killed, the next merge finds the file, and does not refuse the folder as the folder of a run without
    // shards.
    write_about(out, &attempts, &notes)?;
    environment::write(out, &attempts)?;
    let samples = write_samples(out, &attempts, [&records, &controls], &launches)?;
    let devices = planned.devices(records.iter().chain(&controls));
    let name = |attempt, device: &str| devices.get(&(attempt, device.to_owned())).cloned();
    write_renumbered::<RoundLoad>(out, ROUNDS, &attempts, &launches, |_, line| Some(line))?;
    write_renumbered::<AnchorSample>(out, ANCHORS, &attempts, &launches, |attempt, line| {
        Some(AnchorSample { device: name(attempt, &line.device)?, ..line })
    })?;
    write_peak(out, &attempts, name)?;
    let mut lost = Vec::new();
    for (attempt, record) in records.iter_mut().chain(&mut controls) {
        launches.renumber(*attempt, record);
        planned.tell_apart(record);
        record.attempt = Some(attempts[*attempt].name.clone());
        lost.extend(pictures::copy(out, &attempts[*attempt].folder, record)?);
    }
    if let Some(note) = pictures::note(&lost) {
        notes.push(note);
        write_about(out, &attempts, &notes)?;
    }
    write_lines(&out.join(CONTROLS), controls.iter().map(|(_, record)| record))?;
    CurrentPlan { points: planned.points }.write(out)?;
    write_lines(&out.join(RECORDS), records.iter().map(|(_, record)| record))?;
    Ok(Merged { attempts: attempts.len(), records: records.len(), samples, notes, missing })
}

/// The remedy if a path does not name a folder of shards.
const OF_SHARDS: &str = "give the path of the folder that `raycl run --shard` wrote (its --out)";

/// Returns the error for a folder that has no shards.
pub fn no_shards(out: &Path) -> Error {
    match existing::is_folder(out) {
        Ok(true) => {}
        Ok(false) if out.exists() => return not_a_folder(out, OF_SHARDS),
        Ok(false) => return Error::no_folder(out, OF_SHARDS),
        Err(error) => return error,
    }
    Error::input(format!("{} holds no experiment that is divided into shards", out.display()))
        .with_help(OF_SHARDS)
}

/// Refuses a folder with the results of a run without shards, which a merge would overwrite.
fn refuse_other_results(out: &Path) -> Result<()> {
    match existing::exists(&out.join(RECORDS))? && !existing::exists(&out.join(MERGE))? {
        true => Err(Error::input(format!(
            "{} holds the results of a run without shards, which a merge would overwrite",
            out.display()
        ))
        .with_help("choose another folder for the shards with --out")),
        false => Ok(()),
    }
}

/// Refuses a folder that has merged records, but whose attempts are gone: a merge would replace the merged results by
/// empty files.
fn refuse_lost_attempts(out: &Path, attempts: &[Attempt]) -> Result<()> {
    let records = out.join(RECORDS);
    let has_records = existing::is_file(&records)? && records.metadata().is_ok_and(|file| file.len() > 0);
    match attempts.is_empty() && has_records {
        true => Err(Error::input(format!(
            "{} was not merged again: its folder parts/ has no attempts; its merged results are unchanged",
            out.display()
        ))
        .with_help("put the attempts' folders back into parts/ to merge again")),
        false => Ok(()),
    }
}

/// Returns notes on the attempts, and on points that have records of several attempts.
fn notes(plan: &ShardPlan, chosen: &Chosen, attempts: &[Attempt]) -> Result<Vec<String>> {
    let mut notes = chosen.notes(attempts);
    notes.extend(again::attempted_again(attempts)?);
    notes.extend(other_plan::other_plan(plan, attempts)?);
    notes.extend(ended_early(&attempts.iter().map(Attempt::end).collect::<Result<Vec<_>>>()?));
    notes.extend(damage(attempts)?);
    for attempt in attempts {
        notes.extend(lost_samples(attempt)?);
    }
    Ok(notes)
}

/// Returns a note on the attempts that have not finished; `None` if all attempts have finished. The note has the number
/// of attempts for each of four reasons: the attempt was killed or is still running; its launcher (the program that
/// started it) has ended; the user interrupted it; or it ended with an error.
fn ended_early(ends: &[Option<End>]) -> Option<String> {
    let count = |wanted: &dyn Fn(&Option<End>) -> bool| ends.iter().filter(|end| wanted(end)).count();
    let words = [
        (count(&|end| end.is_none()), "was killed or is still running", "were killed or are still running"),
        (count(&|end| matches!(end, Some(End::LauncherLost(_)))), "lost its launcher", "lost their launcher"),
        (count(&|end| matches!(end, Some(End::Interrupted))), "was interrupted", "were interrupted"),
        (count(&|end| matches!(end, Some(End::Failed(_)))), "ended with an error", "ended with an error"),
    ];
    let words: Vec<String> = words
        .into_iter()
        .filter(|(count, ..)| *count > 0)
        .map(|(count, one, several)| format!("{count} {}", if count == 1 { one } else { several }))
        .collect();
    (!words.is_empty()).then(|| format!("Of {}, {}.", counted(ends.len(), "attempt"), words.join(", ")))
}

/// Returns a note on each journal (a file with one JSON object per line) with damaged lines, in the folder of any
/// attempt. The merged journals do not have the damaged lines, so only this note reports the damage to the user.
fn damage(attempts: &[Attempt]) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    for attempt in attempts {
        notes.extend(damage_to::<Record>(attempt, RECORDS)?);
        notes.extend(damage_to::<Sample>(attempt, SAMPLES)?);
        notes.extend(damage_to::<RoundLoad>(attempt, ROUNDS)?);
        notes.extend(damage_to::<AnchorSample>(attempt, ANCHORS)?);
        notes.extend(damage_to::<Record>(attempt, CONTROLS)?);
        notes.extend(damage_to::<LaunchEnd>(attempt, LAUNCHES)?);
    }
    Ok(notes)
}

fn damage_to<T: DeserializeOwned>(attempt: &Attempt, journal: &str) -> Result<Option<String>> {
    let read = read_lines_if_any::<T>(&attempt.folder.join(journal))?;
    Ok(read.damage(&format!("parts/{}/{journal}", attempt.name)))
}

/// Returns a note if an attempt has records of measured points, but no samples in its file of samples. If an
/// attempt has lost its samples, only its records contain the times.
fn lost_samples(attempt: &Attempt) -> Result<Option<String>> {
    if !lines::<Sample>(&attempt.folder.join(SAMPLES))?.is_empty() {
        return Ok(None);
    }
    let records = lines::<Record>(&attempt.folder.join(RECORDS))?;
    let points = records.iter().filter(|record| !record.sample_launches.is_empty()).count();
    Ok((points > 0).then(|| {
        format!(
            "parts/{}/{SAMPLES} is missing or has no readable lines, so the merged {SAMPLES} lacks this attempt's \
             samples of {}. The times of these samples are in the attempt's {RECORDS}.",
            attempt.name,
            counted(points, "point")
        )
    }))
}

fn write_about(out: &Path, attempts: &[Attempt], notes: &[String]) -> Result<()> {
    let about = |attempt: &Attempt| -> Result<Value> {
        Ok(json!({ "name": attempt.name, "about": attempt.about()?, "end": attempt.end()? }))
    };
    let all = json!({ "notes": notes, "attempts": attempts.iter().map(about).collect::<Result<Vec<_>>>()? });
    write_json(&out.join(MERGE), &all)
}

/// Writes the samples of the chosen records, with the new numbers of their launches (of worker processes). Returns the
/// number of samples that were written, the number of samples of the control points in `controls`, and the number of
/// all other samples. A sample and its copies count as one. The samples of `controls` are not written, since the
/// records of control points contain the times.
fn write_samples(
    out: &Path,
    attempts: &[Attempt],
    [records, controls]: [&[Measured]; 2],
    launches: &Launches,
) -> Result<[usize; 3]> {
    let used = [records, controls].map(|records| launches.counted(records));
    let mut counts = [0; 3];
    write_whole_by(&out.join(SAMPLES), |file| {
        each_line::<Sample>(attempts, SAMPLES, launches.origins(), |index, mut sample| {
            let own = (launches.origins().of((index, sample.launch)), sample.key.as_str());
            let class = used.iter().position(|used| used.contains(&own)).unwrap_or(used.len());
            counts[class] += 1;
            if class == 0 {
                sample.launch = launches.number(index, sample.launch).unwrap_or(sample.launch);
                write_line(file, &sample)?;
            }
            Ok(true)
        })
    })?;
    Ok(counts)
}

/// Joins the attempts' journals (files with one JSON object per line) that have this name. Only lines about
/// launches (of worker processes) that records use are written, each once, with the launches' new numbers.
/// `change` is called with each line about such a launch, and with the index of the line's attempt. `change`
/// returns the line to be written, or `None` if the line is left out.
fn write_renumbered<T: Serialize + OfLaunch>(
    out: &Path,
    name: &str,
    attempts: &[Attempt],
    launches: &Launches,
    change: impl Fn(usize, T) -> Option<T>,
) -> Result<()> {
    write_whole_by(&out.join(name), |file| {
        each_line::<T>(attempts, name, launches.origins(), |index, mut line| {
            let Some(number) = launches.number(index, *line.launch()) else { return Ok(false) };
            let Some(mut line) = change(index, line) else { return Ok(false) };
            *line.launch() = number;
            write_line(file, &line)?;
            Ok(true)
        })
    })
}

/// Writes the devices' peak rates that attempts stored. `name` is called with an attempt's index and a device's name
/// in this attempt. `name` returns the device's name in the merged folder; `None` if the merged folder has no record
/// that the attempt measured on this device. Rates for which `name` returns `None` are left out: a reader might
/// mistake such rates for the rates of a selected kind of device that has the same name. If several attempts have
/// rates of devices that have the same name in the merged folder, the rates of the first of these attempts are used.
/// If no attempt stored rates, no file is written.
fn write_peak(out: &Path, attempts: &[Attempt], name: impl Fn(usize, &str) -> Option<String>) -> Result<()> {
    let mut all: Vec<Peak> = Vec::new();
    let mut has_rates = false;
    for (index, attempt) in attempts.iter().enumerate() {
        let own = Peak::stored_in(&attempt.folder)?;
        has_rates |= !own.is_empty();
        let renamed = |peak: Peak| Some(Peak { device: name(index, &peak.device)?, ..peak });
        Peak::add_new(&mut all, own.into_iter().filter_map(renamed).collect());
    }
    // If all rates are left out, an empty list replaces the rates that an earlier merge of other kinds wrote.
    if has_rates { Peak::write(&all, &out.join(peak::FILE)) } else { Ok(()) }
}

fn write_lines<'a, T: Serialize + 'a>(path: &Path, lines: impl Iterator<Item = &'a T>) -> Result<()> {
    write_whole_by(path, |file| {
        for line in lines {
            write_line(file, line)?;
        }
        Ok(())
    })
}

fn write_line(file: &mut dyn std::io::Write, line: &impl Serialize) -> std::io::Result<()> {
    let mut text = serde_json::to_vec(line)?;
    text.push(b'\n');
    file.write_all(&text)
}

/// Returns the readable lines of a journal (a file with one JSON object per line).
fn lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>> {
    Ok(read_lines_if_any(path)?.lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::read_lines;

    /// Makes a folder of one shard with this plan.
    fn one_shard(out: &Path, plan: ShardPlan) {
        let header = crate::shard::Header { shards: 1, ..Default::default() };
        let plan = ShardPlan { header: header.clone(), ..plan };
        ShardPlan::open(out, &header, || Ok(plan)).unwrap();
    }

    #[test]
    fn a_path_without_shards_is_answered_with_what_is_there() {
        let parent = tempfile::tempdir().unwrap();
        let [folder, missing, file] = ["shards", "shrads", "file"].map(|name| parent.path().join(name));
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(&file, "").unwrap();
        let misspelt = no_shards(&missing);
        assert_eq!(misspelt.to_string(), format!("there is no folder {}", missing.display()));
        assert_eq!(misspelt.remedy(), format!("did you mean `{}`?", folder.display()));
        for (path, what) in
            [(folder, "holds no experiment that is divided into shards"), (file, "is not a folder")]
        {
            let error = no_shards(&path);
            assert_eq!(error.to_string(), format!("{} {what}", path.display()));
            assert_eq!(error.remedy(), OF_SHARDS);
        }
        let plan = parent.path().join("shards.json");
        std::fs::write(&plan, "{}").unwrap();
        let folder = format!("give the path of the folder: {}", parent.path().display());
        assert_eq!(no_shards(&plan).remedy(), folder);
    }

    #[test]
    fn one_attempt_was_and_several_were() {
        let said = |ends: &[Option<End>]| ended_early(ends).unwrap_or_default();
        let done = || Some(End::Done);
        let interrupted = || Some(End::Interrupted);
        assert_eq!(said(&[done(), done()]), "");
        assert_eq!(said(&[interrupted()]), "Of 1 attempt, 1 was interrupted.");
        assert_eq!(
            said(&[None, interrupted(), done(), interrupted()]),
            "Of 4 attempts, 1 was killed or is still running, 2 were interrupted."
        );
    }

    #[test]
    fn lines_of_launches_that_records_use_are_joined_with_the_launches_new_numbers() {
        use crate::record::JsonLines;
        use crate::shard::About;
        let out = tempfile::tempdir().unwrap();
        let attempts = [1, 2].map(|shard| {
            let about = About { shard, of: 2, ..About::default() };
            let attempt = Attempt::begin(out.path(), &about).unwrap();
            let mut rounds = JsonLines::append_to(&attempt.folder.join(ROUNDS)).unwrap();
            let mut samples = JsonLines::append_to(&attempt.folder.join(SAMPLES)).unwrap();
            for launch in 0..3 {
                let ms = f64::from(10 * shard + launch);
                rounds.append(&RoundLoad { launch, ms, ..RoundLoad::default() }).unwrap();
                for key in ["k", "other"] {
                    samples.append(&Sample { key: key.into(), launch, ms, ..Sample::default() }).unwrap();
                }
            }
            attempt
        });
        let record = |launches: &[u32]| Record {
            key: "k".into(),
            sample_launches: launches.to_vec(),
            ..Record::default()
        };
        let records = [(0, record(&[2, 2])), (1, record(&[0, 1]))];
        let launches = Launches::of(Origins::default(), records.iter());
        write_renumbered::<RoundLoad>(out.path(), ROUNDS, &attempts, &launches, |_, line| Some(line))
            .unwrap();
        let rounds = read_lines::<RoundLoad>(&out.path().join(ROUNDS)).unwrap().lines;
        let actual: Vec<_> = rounds.iter().map(|line| (line.launch, line.ms)).collect();
        assert_eq!(actual, [(0, 12.0), (1, 20.0), (2, 21.0)]);
        // The sample of a control point (a point that every block of a cut group measures) is counted, but
        // not written.
        let controls = [(0, record(&[1]))];
        let counts = write_samples(out.path(), &attempts, [&records, &controls], &launches).unwrap();
        assert_eq!(counts, [3, 1, 8]);
        let samples = read_lines::<Sample>(&out.path().join(SAMPLES)).unwrap().lines;
        let actual: Vec<_> =
            samples.iter().map(|sample| (sample.launch, sample.ms, sample.key.as_str())).collect();
        assert_eq!(actual, [(0, 12.0, "k"), (1, 20.0, "k"), (2, 21.0, "k")]);
    }

    #[test]
    fn of_several_peaks_of_a_device_the_first_attempts_is_used() {
        use crate::shard::About;
        let out = tempfile::tempdir().unwrap();
        let attempts = [1, 2]
            .map(|shard| Attempt::begin(out.path(), &About { shard, of: 2, ..About::default() }).unwrap());
        let same = |_: usize, device: &str| Some(device.to_owned());
        write_peak(out.path(), &attempts, same).unwrap();
        assert!(!out.path().join(peak::FILE).exists(), "no attempt has measured any");
        let peak = |device: &str, driver: &str| Peak {
            device: device.into(),
            driver: driver.into(),
            ..crate::peak::fixtures::rates()
        };
        Peak::write(&[peak("gpu", "first")], &attempts[0].folder.join(peak::FILE)).unwrap();
        Peak::write(&[peak("gpu", "second"), peak("cpu", "second")], &attempts[1].folder.join(peak::FILE))
            .unwrap();
        write_peak(out.path(), &attempts, same).unwrap();
        assert_eq!(Peak::stored_in(out.path()).unwrap(), [peak("gpu", "first"), peak("cpu", "second")]);
        // Two kinds of device have the name "gpu". The kind "cpu" is not selected.
        let by_attempt =
            |attempt: usize, device: &str| (device == "gpu").then(|| format!("gpu ({})", attempt + 1));
        write_peak(out.path(), &attempts, by_attempt).unwrap();
        let expected = [peak("gpu (1)", "first"), peak("gpu (2)", "second")];
        assert_eq!(Peak::stored_in(out.path()).unwrap(), expected);
        write_peak(out.path(), &attempts, |_: usize, _: &str| None).unwrap();
        assert_eq!(Peak::stored_in(out.path()).unwrap(), []);
    }

    #[test]
    fn each_way_to_end_early_has_its_words() {
        let ends = [
            Some(End::LauncherLost("sh".into())),
            Some(End::Failed("a".into())),
            Some(End::Failed("b".into())),
            Some(End::LauncherLost("sh".into())),
            Some(End::LauncherLost("sh".into())),
            None,
            None,
        ];
        assert_eq!(
            ended_early(&ends).as_deref(),
            Some(
                "Of 7 attempts, 2 were killed or are still running, 3 lost their launcher, 2 ended with an error."
            )
        );
        assert_eq!(
            ended_early(&ends[..2]).as_deref(),
            Some("Of 2 attempts, 1 lost its launcher, 1 ended with an error.")
        );
    }

    /// Writes the file that describes a kind of device. One point of the plan is measured on this kind of
    /// device.
    fn write_kind(out: &Path, device: &str, identity: &str, point: usize) {
        use crate::record::PlannedPoint;
        use crate::shard::KindPoint;
        let planned = PlannedPoint {
            key: format!("{identity} {point}"),
            device: device.into(),
            name: "a point".into(),
            ..PlannedPoint::default()
        };
        let points = vec![KindPoint { point, planned }];
        let kind = Kind { device: device.into(), identity: identity.into(), points, ..Kind::default() };
        kind.write(&Kind::file(out, device, identity)).unwrap();
    }

    /// Makes the folder of an attempt at the first shard. The folder has one record, which was measured in
    /// the attempt's fourth launch, and the record's picture.
    fn write_attempt(out: &Path, host: &str, key: &str, device: &str) {
        use crate::record::{JsonLines, Outcome};
        use crate::shard::About;
        let about =
            About { shard: 1, of: 1, host: host.into(), devices: vec!["x".into()], ..About::default() };
        let attempt = Attempt::begin(out, &about).unwrap();
        std::fs::create_dir(attempt.folder.join("images")).unwrap();
        std::fs::write(attempt.folder.join("images/a.png"), host).unwrap();
        let record = Record {
            key: key.into(),
            device: device.into(),
            strategy: "serial-f32".into(),
            outcome: Outcome::Measured,
            samples_ms: vec![1.0, 1.0],
            sample_launches: vec![3; 2],
            image: Some("images/a.png".into()),
            ..Record::default()
        };
        JsonLines::append_to(&attempt.folder.join(RECORDS)).unwrap().append(&record).unwrap();
        let sample = Sample { key: key.into(), launch: 3, ms: 1.0, ..Sample::default() };
        let samples = [sample.clone(), sample];
        JsonLines::append_to(&attempt.folder.join(SAMPLES)).unwrap().append_all(&samples).unwrap();
    }

    #[test]
    fn damaged_lines_of_an_attempts_journals_are_noted() {
        let folder = tempfile::tempdir().unwrap();
        write_attempt(folder.path(), "n1", "k", "gpu");
        let attempts = Attempt::all(folder.path()).unwrap();
        assert!(damage(&attempts).unwrap().is_empty());
        for journal in [SAMPLES, ROUNDS, ANCHORS, CONTROLS, LAUNCHES] {
            std::fs::write(attempts[0].folder.join(journal), "nonsense\n").unwrap();
        }
        let notes = damage(&attempts).unwrap();
        let first =
            "raycl ignores 1 damaged line of parts/shard-00001.n1..r00/samples.jsonl; the first is line 1.";
        assert!(notes.len() == 5 && notes[0].starts_with(first), "{notes:?}");
        std::fs::write(attempts[0].folder.join(RECORDS), "nonsense\n").unwrap();
        let notes = damage(&attempts).unwrap();
        assert!(notes.len() == 6 && notes[0].contains("n1..r00/records.jsonl"), "{notes:?}");
    }

    #[test]
    fn an_attempt_whose_samples_are_lost_is_noted() {
        let folder = tempfile::tempdir().unwrap();
        write_attempt(folder.path(), "n1", "k", "gpu");
        let [attempt] = &Attempt::all(folder.path()).unwrap()[..] else { panic!("one attempt") };
        assert_eq!(lost_samples(attempt).unwrap(), None);
        std::fs::remove_file(attempt.folder.join(SAMPLES)).unwrap();
        let note = "parts/shard-00001.n1..r00/samples.jsonl is missing or has no readable lines, so the merged samples.jsonl lacks this attempt's samples of 1 point. The times of these samples are in the attempt's records.jsonl.";
        assert_eq!(lost_samples(attempt).unwrap().as_deref(), Some(note));
    }

    #[test]
    fn a_merge_notes_what_is_damaged_and_what_is_lost() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        one_shard(out, ShardPlan::default());
        write_kind(out, "gpu", "x", 0);
        write_attempt(out, "n1", "x 0", "gpu");
        let attempts = Attempt::all(out).unwrap();
        std::fs::remove_file(attempts[0].folder.join(SAMPLES)).unwrap();
        std::fs::write(attempts[0].folder.join(ROUNDS), "nonsense\n").unwrap();
        std::fs::remove_file(attempts[0].folder.join("images/a.png")).unwrap();
        let notes = merge(out, &[]).unwrap().notes;
        for part in [
            "n1..r00/rounds.jsonl; the first is line 1",
            "n1..r00/samples.jsonl is missing",
            "1 picture could not be copied; the first is parts/shard-00001.n1..r00/images/a.png: ",
        ] {
            assert!(notes.iter().any(|note| note.contains(part)), "{part}: {notes:?}");
        }
        let about: Value = serde_json::from_slice(&std::fs::read(out.join(MERGE)).unwrap()).unwrap();
        assert_eq!(about["notes"], json!(notes));
    }

    #[test]
    fn failed_points_have_no_samples_that_can_be_lost() {
        use crate::record::{JsonLines, Outcome};
        let folder = tempfile::tempdir().unwrap();
        write_attempt(folder.path(), "n1", "k", "gpu");
        let [attempt] = &Attempt::all(folder.path()).unwrap()[..] else { panic!("one attempt") };
        std::fs::remove_file(attempt.folder.join(SAMPLES)).unwrap();
        let records = attempt.folder.join(RECORDS);
        let failed = Record { key: "failed".into(), outcome: Outcome::Crashed, ..Record::default() };
        JsonLines::append_to(&records).unwrap().append(&failed).unwrap();
        let note = lost_samples(attempt).unwrap().unwrap();
        assert!(note.contains("lacks this attempt's samples of 1 point."), "{note}");
        std::fs::remove_file(&records).unwrap();
        JsonLines::append_to(&records).unwrap().append(&failed).unwrap();
        assert_eq!(lost_samples(attempt).unwrap(), None);
    }

    /// Writes what an attempt measured in two launches (of worker processes). In each launch, it measured a
    /// sample of a point and of a control point, a sample of the anchor (work whose time shows the machine's
    /// speed), and the machine's load. The record of the control point is written too. If the attempt copied
    /// the two launches, `origin` is the attempt that measured them: they are the launches 5 and 6 of
    /// `origin`.
    fn write_launches(attempt: &Attempt, origin: Option<&Attempt>, launches: [u32; 2]) {
        use crate::record::JsonLines;
        let journal = |name: &str| attempt.folder.join(name);
        for (launch, number) in launches.into_iter().zip(5..) {
            let sample = |key: &str| Sample {
                key: key.into(),
                launch,
                origin: origin.map(|first| format!("{} launch {number}", first.name)),
                ..Sample::default()
            };
            let samples = ["x 0", "control"].map(sample);
            JsonLines::append_to(&journal(SAMPLES)).unwrap().append_all(&samples).unwrap();
            let anchor = AnchorSample { device: "gpu".into(), launch, ..AnchorSample::default() };
            JsonLines::append_to(&journal(ANCHORS)).unwrap().append(&anchor).unwrap();
            let round = RoundLoad { launch, ..RoundLoad::default() };
            JsonLines::append_to(&journal(ROUNDS)).unwrap().append(&round).unwrap();
        }
        let control = Record { is_control: true, ..measured("control", launches) };
        JsonLines::append_to(&journal(CONTROLS)).unwrap().append(&control).unwrap();
    }

    /// Returns the record of a point with one sample of each launch.
    fn measured(key: &str, launches: [u32; 2]) -> Record {
        Record {
            key: key.into(),
            device: "gpu".into(),
            outcome: crate::record::Outcome::Measured,
            samples_ms: vec![1.0; 2],
            sample_launches: launches.to_vec(),
            ..Record::default()
        }
    }

    /// The first attempt measured the launches of its block, but was killed before it wrote the record. The
    /// second attempt copied the results of these launches from the first attempt and wrote the record.
    #[test]
    fn a_copied_launch_counts_as_measured_by_the_attempt_that_measured_it() {
        use crate::record::JsonLines;
        use crate::shard::About;
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let block = crate::experiment::Block { number: 1, shard: 1, points: vec![0], control: None };
        let (points, cases) = (vec!["a point".into()], vec![0]);
        one_shard(out, ShardPlan { points, cases, blocks: vec![block], ..ShardPlan::default() });
        write_kind(out, "gpu", "x", 0);
        // The attempts are read in the order of their names.
        let [first, second] = ["n2", "n1"].map(|host| {
            let about = About { shard: 1, of: 1, host: host.into(), ..About::default() };
            Attempt::begin(out, &about).unwrap()
        });
        write_launches(&first, None, [5, 6]);
        write_launches(&second, Some(&first), [0, 1]);
        let journal = second.folder.join(RECORDS);
        // An attempt's record names the attempt's own machine.
        let record = Record { host: Some("n1".into()), ..measured("x 0", [0, 1]) };
        JsonLines::append_to(&journal).unwrap().append(&record).unwrap();
        let merged = merge(out, &[]).unwrap();
        assert_eq!(merged.samples, [2, 2, 0]);
        for (name, key) in [(RECORDS, "x 0"), (CONTROLS, "control")] {
            let records = read_lines::<Record>(&out.join(name)).unwrap().lines;
            let [record] = &records[..] else { panic!("{name} has one record: {records:?}") };
            assert_eq!((record.key.as_str(), record.host.as_deref()), (key, Some("n2")));
            assert_eq!(record.sample_launches, [0, 1]);
        }
        let anchors = read_lines::<AnchorSample>(&out.join(ANCHORS)).unwrap().lines;
        assert_eq!(anchors.iter().map(|anchor| anchor.launch).collect::<Vec<_>>(), [0, 1]);
        let rounds = read_lines::<RoundLoad>(&out.join(ROUNDS)).unwrap().lines;
        assert_eq!(rounds.iter().map(|round| round.launch).collect::<Vec<_>>(), [0, 1]);
    }

    /// Makes the folder of an attempt at the first shard. The attempt measured `record` and, in the launches
    /// `launches`, a control point that belongs to another block.
    fn write_block(out: &Path, host: &str, record: &Record, launches: [u32; 2]) {
        use crate::record::JsonLines;
        use crate::shard::About;
        let about = About { shard: 1, of: 1, host: host.into(), ..About::default() };
        let attempt = Attempt::begin(out, &about).unwrap();
        write_launches(&attempt, None, launches);
        JsonLines::append_to(&attempt.folder.join(RECORDS)).unwrap().append(record).unwrap();
    }

    /// Returns the launches of each merged record in `records.jsonl`, of each record in `controls.jsonl`, and
    /// of all lines in `rounds.jsonl`.
    fn merged_launches(out: &Path) -> [Vec<Vec<u32>>; 3] {
        let [records, controls] = [RECORDS, CONTROLS].map(|name| {
            let records = read_lines::<Record>(&out.join(name)).unwrap().lines;
            records.into_iter().map(|record| record.sample_launches).collect()
        });
        let rounds = read_lines::<RoundLoad>(&out.join(ROUNDS)).unwrap().lines;
        [records, controls, vec![rounds.iter().map(|round| round.launch).collect()]]
    }

    /// All samples of the second launch were left out of the point's record, but not out of the control
    /// point's record.
    #[test]
    fn launches_that_only_a_control_point_uses_get_new_numbers_too() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        one_shard(out, ShardPlan::default());
        write_kind(out, "gpu", "x", 0);
        write_block(out, "n1", &measured("x 0", [4, 4]), [4, 5]);
        merge(out, &[]).unwrap();
        assert_eq!(merged_launches(out), [[0, 0], [0, 1], [0, 1]].map(|launches| vec![launches.to_vec()]));
    }

    /// The second attempt measured the same block as the first, and none of its records is used. The third
    /// attempt measured a kind of device that is not selected.
    #[test]
    fn control_points_of_other_kinds_and_of_unused_attempts_are_not_merged() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        one_shard(out, ShardPlan::default());
        write_kind(out, "gpu", "x", 0);
        write_kind(out, "cpu", "y", 0);
        let of_cpu = Record { device: "cpu".into(), ..measured("y 0", [0, 1]) };
        for (host, record) in
            [("n1", measured("x 0", [0, 1])), ("n2", measured("x 0", [0, 1])), ("n3", of_cpu)]
        {
            write_block(out, host, &record, [0, 1]);
        }
        let merged = merge(out, &["gpu".to_owned()]).unwrap();
        assert_eq!((merged.records, merged.samples), (1, [2, 2, 8]));
        assert_eq!(merged_launches(out), [[0, 1]; 3].map(|launches| vec![launches.to_vec()]));
    }

    /// Merges an attempt that has one record.
    fn merge_one_record(out: &Path) {
        one_shard(out, ShardPlan::default());
        write_kind(out, "gpu", "x", 0);
        write_attempt(out, "n1", "x 0", "gpu");
        assert_eq!(merge(out, &[]).unwrap().records, 1);
    }

    #[test]
    fn a_merge_without_a_kinds_file_leaves_the_results_of_an_earlier_merge() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        merge_one_record(out);
        std::fs::remove_file(Kind::file(out, "gpu", "x")).unwrap();
        // A merge that fails changes nothing: it does not even remove the unfinished file that an earlier,
        // killed merge has left.
        let killed = out.join(".raycl-killed");
        let file = std::fs::File::create(&killed).unwrap();
        let hours = |count: f64| std::time::SystemTime::now() - Duration::from_secs_f64(3600.0 * count);
        file.set_modified(hours(1.1)).unwrap();
        // A merge that still runs may have made a file less than an hour ago.
        let recent = out.join(".raycl-recent");
        std::fs::File::create(&recent).unwrap().set_modified(hours(0.8)).unwrap();
        assert!(merge(out, &[]).is_err() && killed.exists());
        assert_eq!(read_lines::<Record>(&out.join(RECORDS)).unwrap().lines.len(), 1);
        write_kind(out, "gpu", "x", 0);
        assert!(merge(out, &[]).is_ok() && !killed.exists() && recent.exists());
    }

    #[test]
    fn a_merge_without_attempts_leaves_the_results_of_an_earlier_merge() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        merge_one_record(out);
        let parts = out.join("parts");
        let expected = format!(
            "{} was not merged again: its folder parts/ has no attempts; its merged results are unchanged",
            out.display()
        );
        std::fs::remove_dir_all(&parts).unwrap();
        for _ in ["no folder", "an empty folder"] {
            let error = merge(out, &[]).unwrap_err();
            assert_eq!((error.to_string(), error.exit_code()), (expected.clone(), 2));
            assert_eq!(read_lines::<Record>(&out.join(RECORDS)).unwrap().lines.len(), 1);
            std::fs::create_dir_all(&parts).unwrap();
        }
        std::fs::write(out.join(RECORDS), "").unwrap();
        assert!(merge(out, &[]).is_ok(), "no results can be lost");
    }

    #[test]
    fn a_merge_of_no_kind_leaves_the_results_of_an_earlier_merge() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        merge_one_record(out);
        for word in ["h200", ""] {
            let error = merge(out, &[word.to_owned()]).unwrap_err();
            assert_eq!(error.to_string(), format!("no device with results matches '{word}'"));
            assert_eq!(read_lines::<Record>(&out.join(RECORDS)).unwrap().lines.len(), 1);
        }
    }

    /// In this test, a link that leads to itself stands for any file or folder that cannot be read, for
    /// example because of its permissions or a failed disk. If a merge took an unreadable file for a missing
    /// one, the merge would replace the merged results by fewer results.
    #[cfg(unix)]
    #[test]
    fn a_merge_that_cannot_read_an_attempt_leaves_the_results_of_an_earlier_merge() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        merge_one_record(out);
        let attempt = Attempt::all(out).unwrap().remove(0).folder;
        let aside = folder.path().join("aside");
        let journals = [RECORDS, SAMPLES, CONTROLS, ROUNDS, ANCHORS].map(|name| attempt.join(name));
        let others = ["attempt.json", "end.json", "environment.json", peak::FILE];
        let others = others.map(|name| attempt.join(name));
        let outer = ["parts", "kinds", "shards.json", "merge.json"].map(|name| out.join(name));
        for path in journals.iter().chain(&others).chain(&outer) {
            let exists = path.exists();
            if exists {
                std::fs::rename(path, &aside).unwrap();
            }
            symlink(path, path).unwrap();
            let error = merge(out, &[]).unwrap_err().to_string();
            assert!(error.starts_with(&format!("cannot read {}", path.display())), "{error}");
            std::fs::remove_file(path).unwrap();
            if exists {
                std::fs::rename(&aside, path).unwrap();
            }
            assert_eq!(read_lines::<Record>(&out.join(RECORDS)).unwrap().lines.len(), 1, "{error}");
            assert_eq!(read_lines::<Sample>(&out.join(SAMPLES)).unwrap().lines.len(), 2, "{error}");
        }
    }

    /// Two shards measured devices of the same name with different drivers.
    #[test]
    fn anchors_and_peaks_have_the_names_of_the_merged_folders_devices() {
        use crate::experiment::Block;
        use crate::record::{Folder, JsonLines};
        let temporary = tempfile::tempdir().unwrap();
        let out = temporary.path();
        one_shard(
            out,
            ShardPlan {
                points: vec!["a point".into()],
                cases: vec![0],
                blocks: vec![Block { number: 1, shard: 1, points: vec![0], control: None }],
                ..ShardPlan::default()
            },
        );
        for (host, driver) in [("n1", "3.1"), ("n2", "7.0")] {
            write_kind(out, "cpu", driver, 0);
            write_attempt(out, host, &format!("{driver} 0"), "cpu");
        }
        for attempt in Attempt::all(out).unwrap() {
            let mut anchors = JsonLines::append_to(&attempt.folder.join(ANCHORS)).unwrap();
            // The attempt has no record of the device "gpu".
            for device in ["cpu", "gpu"] {
                let anchor = AnchorSample { device: device.into(), launch: 3, ..AnchorSample::default() };
                anchors.append(&anchor).unwrap();
            }
            let driver = attempt.name.clone();
            let peak = Peak { device: "cpu".into(), driver, ..crate::peak::fixtures::rates() };
            Peak::write(&[peak], &attempt.folder.join(peak::FILE)).unwrap();
        }
        merge(out, &[]).unwrap();
        let folder = Folder::read(out).unwrap();
        // A record and an anchor of the same launch belong to the same device.
        let of_launch = |launch: u32| {
            let record = folder.records.iter().find(|record| record.sample_launches.contains(&launch));
            let anchor = folder.anchors.iter().find(|anchor| anchor.launch == launch);
            [record.map(|record| record.device.clone()), anchor.map(|anchor| anchor.device.clone())]
        };
        let expected = ["cpu (3.1)", "cpu (7.0)"].map(|device| Some(device.to_owned()));
        let actual = [of_launch(0), of_launch(1)];
        assert_eq!(actual.each_ref().map(|[record, _]| record.clone()), expected);
        assert_eq!(actual.map(|[_, anchor]| anchor), expected);
        assert_eq!(folder.anchors.len(), 2, "the anchors of devices without records are left out");
        let peaks = Peak::stored_in(out).unwrap();
        assert_eq!([0, 1].map(|index| peaks.get(index).map(|peak| peak.device.clone())), expected);
        // If only one of the two kinds of device is selected, the name of this kind in the merged folder does
        // not contain the driver.
        merge(out, &["7.0".to_owned()]).unwrap();
        let driver = Attempt::all(out).unwrap()[1].name.clone();
        let of_second = Peak { device: "cpu".into(), driver, ..crate::peak::fixtures::rates() };
        assert_eq!(Peak::stored_in(out).unwrap(), [of_second]);
    }

    #[test]
    fn merged_records_name_their_attempts_and_hosts_and_have_their_pictures() {
        use crate::experiment::Block;
        use crate::record::HOST;
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        let block = Block { number: 1, shard: 1, points: vec![0, 1], control: None };
        one_shard(
            out,
            ShardPlan {
                points: vec!["on the host".into(), "on a device".into()],
                cases: vec![0, 0],
                blocks: vec![block],
                ..ShardPlan::default()
            },
        );
        for (device, identity, point) in [(HOST, "amd", 0), (HOST, "intel", 0), ("gpu", "x", 1)] {
            write_kind(out, device, identity, point);
        }
        write_attempt(out, "n1", "amd 0", HOST);
        write_attempt(out, "n2", "x 1", "gpu");
        let merged = merge(out, &[]).unwrap();
        assert_eq!((merged.attempts, merged.records, merged.missing.count()), (2, 2, 0));
        let notes = merged.notes.join("\n");
        let names = ["shard-00001.n1..r00", "shard-00001.n2..r00"];
        let again = format!("There were 2 attempts at shard 1 ({}).", names.join(", "));
        assert!(
            notes.contains(&again) && notes.contains("Of 2 attempts, 2 were killed or are still running."),
            "{notes}"
        );
        let records = read_lines::<Record>(&out.join(RECORDS)).unwrap().lines;
        let text = |record: &Record| {
            let picture = std::fs::read_to_string(out.join(record.image.as_deref().unwrap())).unwrap();
            format!("{} {:?} {:?} {picture}", record.strategy, record.attempt, record.sample_launches)
        };
        let actual: Vec<_> = records.iter().map(text).collect();
        let expected = [
            format!("serial-f32 (amd) Some({:?}) [0, 0] n1", names[0]),
            format!("serial-f32 Some({:?}) [1, 1] n2", names[1]),
        ];
        assert_eq!(actual, expected);
        let about: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join(MERGE)).unwrap()).unwrap();
        assert_eq!(
            (about["notes"].as_array().map(Vec::len), &about["attempts"][1]["name"]),
            (Some(2), &json!(names[1]))
        );
        assert!(["about", "end"].iter().all(|key| about["attempts"][1].get(key).is_some()), "{about}");
        assert!(merge(out, &["amd".to_owned()]).is_err(), "only the host's processor matches");
        assert_eq!(read_lines::<Record>(&out.join(RECORDS)).unwrap().lines.len(), 2);
        let of_host = merge(out, &[HOST.to_owned()]).unwrap();
        assert_eq!((of_host.records, of_host.missing.count()), (1, 0), "a gpu is not selected");
    }
}
