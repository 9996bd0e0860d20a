//! Two folders of results, point by point: faster, slower, same or unclear.

mod page;

use super::merged::{labels, merged};
use super::words::{size_name, title};
use crate::measure::{Summary, Verdict, compare};
use crate::record::{Folder, HOST, Outcome, Record, by, median, significant};
use serde::Serialize;
use std::collections::HashMap;

/// A point that both folders measured.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Its record in the first folder.
    pub before: Record,
    /// Its record in the second.
    pub after: Record,
    /// How the second stands to the first.
    pub verdict: Verdict,
    /// The second's time as a percentage of the first's, less 100: positive is slower. None where there are not enough samples.
    pub change_percent: Option<f64>,
}

/// A pair as `--json` prints it.
#[derive(Debug, Serialize)]
pub struct PairLine<'a> {
    scene: &'a str,
    image_size: [u32; 2],
    device: [&'a str; 2],
    name: &'a str,
    local_size: Option<[u32; 2]>,
    median_ms: [Option<f64>; 2],
    change_percent: Option<f64>,
    verdict: &'static str,
}

/// What comparing two folders found.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// What the folders are called.
    pub labels: [String; 2],
    /// The points that both measured, in the first's order.
    pub pairs: Vec<Pair>,
    /// Points that only one measured, or that another outcome replaced: what happened, in a line.
    pub others: Vec<String>,
    /// What is to be said of the folders, each under its name.
    pub notes: Vec<String>,
    /// Changes of less than this part are the same.
    pub threshold: f64,
}

impl Pair {
    /// "+12.3%"; "496× as long" from tenfold on, where per cent say little; "n = 10 and 3" where there are not enough samples.
    pub fn change(&self) -> String {
        let Some(percent) = self.change_percent else {
            return format!("n = {} and {}", self.before.samples_ms.len(), self.after.samples_ms.len());
        };
        match 1.0 + percent / 100.0 {
            ratio if ratio >= 10.0 => format!("{}× as long", significant(ratio, 3)),
            ratio if ratio > 0.0 && ratio <= 0.1 => format!("{}× as fast", significant(1.0 / ratio, 3)),
            _ => format!("{percent:+.1}%"),
        }
    }

    /// "teapot 800 x 500, naive 8x8"; with `device` where a folder has several.
    pub fn point(&self, device: bool) -> String {
        let on = if device && !self.before.is_baseline() {
            format!(", {}", self.before.device)
        } else {
            String::new()
        };
        format!("{}{on}", name(&self.before))
    }
}

impl Comparison {
    /// Whether the folders have several devices, so that a point is not named without its own.
    pub fn has_several_devices(&self) -> bool {
        let mut devices = self.pairs.iter().map(|pair| &pair.before).filter(|record| !record.is_baseline());
        let first = devices.next().map(|record| &record.device);
        devices.any(|record| Some(&record.device) != first)
    }

    /// Compares two folders. `threshold` is a part: 0.02 is 2%.
    ///
    /// Points correspond where scene, image size, strategy and local size are equal. Devices correspond by name, or,
    /// where each folder has but one, to each other: another machine's results can be compared. Scenes correspond by content where both
    /// folders have recorded it, else by name.
    pub fn of(before: &Folder, after: &Folder, threshold: f64) -> Self {
        let one_each = devices(before).len() == 1 && devices(after).len() == 1;
        let by_content = [before, after].iter().all(|folder| has_content(folder));
        let point = |record: &Record| {
            let device = if one_each && !record.is_baseline() { "the device" } else { &record.device };
            let scene = record.scene_hash.as_ref().filter(|_| by_content).unwrap_or(&record.scene);
            (scene.clone(), record.image_size, device.to_owned(), record.name.clone(), record.local_size)
        };
        let after_records = merged(std::slice::from_ref(after));
        let mut found: HashMap<_, _> = after_records.iter().map(|record| (point(record), record)).collect();
        let mut comparison = Self::without_points([before, after], threshold);
        let mut only = [Vec::new(), Vec::new()];
        for record in merged(std::slice::from_ref(before)) {
            match found.remove(&point(&record)) {
                Some(other) => comparison.add(record, other),
                None => only[0].push(record),
            }
        }
        only[1].extend(after_records.iter().filter(|record| found.contains_key(&point(record))).cloned());
        comparison.say_what_only_one_has(&only);
        comparison
    }

    fn without_points(folders: [&Folder; 2], threshold: f64) -> Self {
        let labels = labels(&folders.map(Folder::clone));
        let notes_of = |(folder, label): (&&Folder, &String)| -> Vec<String> {
            folder.notes.iter().map(|note| format!("{label}: {note}")).collect()
        };
        let notes = folders.iter().zip(&labels).flat_map(notes_of).collect();
        let labels = labels.try_into().unwrap_or_default();
        Self { labels, pairs: Vec::new(), others: Vec::new(), notes, threshold }
    }

    /// A line a point; but one a scene, where both folders have one of its name and another content.
    fn say_what_only_one_has(&mut self, only: &[Vec<Record>; 2]) {
        let [before, after] = only;
        let changed = |record: &Record, others: &[Record]| {
            others.iter().any(|other| other.scene == record.scene && other.scene_hash != record.scene_hash)
        };
        for (records, others, label) in [(before, after, 0), (after, before, 1)] {
            for record in records {
                let line = match changed(record, others) {
                    true => format!("{}: another scene in each, by its content", record.scene),
                    false => format!("{}: only in {}", name(record), self.labels[label]),
                };
                if !self.others.contains(&line) {
                    self.others.push(line);
                }
            }
        }
    }

    fn add(&mut self, before: Record, after: &Record) {
        let summaries =
            [&before, after].map(|record| median(record).and_then(|_| Summary::of(&record.samples_ms)));
        if let [Some(a), Some(b)] = summaries {
            let verdict = compare(&a, &b, self.threshold);
            let change = 100.0 * (b.median_ms / a.median_ms - 1.0);
            let change_percent = (verdict != Verdict::NotEnough).then_some(change);
            self.pairs.push(Pair { before, after: after.clone(), verdict, change_percent });
        } else if before.outcome != after.outcome {
            let [a, b] = [before.outcome, after.outcome].map(Outcome::name);
            self.others.push(format!("{}: was {a}, is {b}", name(&before)));
        }
    }

    /// How many points have this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.pairs.iter().filter(|pair| pair.verdict == verdict).count()
    }

    /// The points that are surely slower by more than `percent`, and those that ran before and fail now.
    pub fn regressions(&self, percent: f64) -> Vec<String> {
        let several = self.has_several_devices();
        let slower = self.pairs.iter().filter(|pair| pair.verdict == Verdict::Slower);
        let slower = slower.filter_map(|pair| {
            let change = pair.change_percent.filter(|change| *change > percent)?;
            Some(format!("{} is {change:.1}% slower", pair.point(several)))
        });
        let broken = self.others.iter().filter(|line| line.contains(": was measured, is ")).cloned();
        slower.chain(broken).collect()
    }

    /// "12 faster, 3 slower, 40 same, 5 unclear", and, where there are such, "2 not enough samples".
    pub fn summary(&self) -> String {
        let counts = Verdict::ALL.map(|verdict| (verdict, self.count(verdict)));
        let shown = counts.iter().filter(|(verdict, count)| *verdict != Verdict::NotEnough || *count > 0);
        shown.map(|(verdict, count)| format!("{count} {}", verdict.name())).collect::<Vec<_>>().join(", ")
    }

    /// The pairs as JSON lines would have them.
    pub fn lines(&self) -> Vec<PairLine<'_>> {
        self.pairs.iter().map(line).collect()
    }
}

fn line(pair: &Pair) -> PairLine<'_> {
    PairLine {
        scene: &pair.before.scene,
        image_size: pair.before.image_size,
        device: [&pair.before.device, &pair.after.device],
        name: &pair.before.name,
        local_size: pair.before.local_size,
        median_ms: [median(&pair.before), median(&pair.after)],
        change_percent: pair.change_percent,
        verdict: pair.verdict.name(),
    }
}

fn name(record: &Record) -> String {
    if record.is_baseline() {
        return format!("{} {}, {}", record.scene, by(record.image_size), title(record));
    }
    format!("{} {}, {} {}", record.scene, by(record.image_size), record.name, size_name(record))
}

fn devices(folder: &Folder) -> Vec<&str> {
    let mut devices: Vec<&str> =
        folder.records.iter().map(|record| record.device.as_str()).filter(|device| *device != HOST).collect();
    devices.sort_unstable();
    devices.dedup();
    devices
}

/// Whether all its records say what their scenes hold.
fn has_content(folder: &Folder) -> bool {
    folder.records.iter().all(|record| record.scene_hash.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{few, infeasible, measured};

    fn folder(label: &str, records: Vec<Record>) -> Folder {
        Folder { label: label.into(), records, ..Folder::default() }
    }

    fn timed(device: &str, name: &str, around: f64) -> Record {
        let mut record = measured(device, name, 8, [around * 0.99, around * 1.01]);
        record.samples_ms = (0..10).map(|n| around * (0.99 + 0.002 * f64::from(n))).collect();
        record
    }

    #[test]
    fn another_machines_results_are_compared_point_by_point() {
        let before = folder(
            "old",
            vec![timed("a", "naive", 10.0), timed("a", "wide", 1.0), timed("a", "private", 5.0)],
        );
        let after = folder(
            "new",
            vec![
                timed("b", "naive", 20.0),
                timed("b", "wide", 0.5),
                infeasible("b", "private", 8, "no"),
                timed("b", "raster", 1.0),
            ],
        );
        let comparison = Comparison::of(&before, &after, 0.02);
        assert_eq!(comparison.summary(), "1 faster, 1 slower, 0 same, 0 unclear");
        let regressions = comparison.regressions(5.0);
        assert_eq!(regressions.len(), 2, "{regressions:?}");
        assert!(comparison.regressions(150.0)[0].contains("was measured, is infeasible"));
        assert!(comparison.others.iter().any(|line| line.contains("only in new")), "{:?}", comparison.others);
        assert!(comparison.markdown().contains("| +100.0% | slower |"), "{}", comparison.markdown());
    }

    #[test]
    fn a_scene_that_was_edited_is_another() {
        let of = |hash: &str, name: &str| Record { scene_hash: Some(hash.into()), ..timed("a", name, 10.0) };
        let before = folder("old", vec![of("1", "naive"), of("1", "wide")]);
        let after = folder("new", vec![of("2", "naive"), of("2", "wide")]);
        let comparison = Comparison::of(&before, &after, 0.02);
        assert!(comparison.pairs.is_empty());
        assert_eq!(comparison.others, ["teapot: another scene in each, by its content"]);
    }

    #[test]
    fn few_samples_of_either_are_no_verdict() {
        let before = folder("old", vec![timed("a", "naive", 10.0), few("a", "wide", 8, 1.0, 3)]);
        let after = folder("new", vec![few("a", "naive", 8, 99.0, 4), timed("a", "wide", 99.0)]);
        let comparison = Comparison::of(&before, &after, 0.02);
        assert_eq!(comparison.summary(), "0 faster, 0 slower, 0 same, 0 unclear, 2 not enough samples");
        assert!(comparison.regressions(5.0).is_empty(), "{:?}", comparison.regressions(5.0));
        let markdown = comparison.markdown();
        assert!(markdown.contains("| n = 10 and 4 | not enough samples |"), "{markdown}");
        assert!(!markdown.contains("as long"), "{markdown}");
        let html = comparison.html().expect("it renders");
        assert!(html.contains("not enough samples (n = 4)") && !html.contains("99.00 to 99.00"), "{html}");
    }

    #[test]
    fn a_folder_is_the_same_as_itself() {
        let one = folder("one", vec![timed("a", "naive", 10.0)]);
        let comparison = Comparison::of(&one, &one, 0.02);
        assert_eq!(comparison.summary(), "0 faster, 0 slower, 1 same, 0 unclear");
        assert!(comparison.html().expect("it renders").contains("class=\"mark\""));
    }
}
