//! The records of one device in one run. The tests of a claim of the student paper that raycl reproduces look
//! up the claim's points in these records.

use super::point::{Point, Size};
use super::sure::Ratio;
use super::verdict::{Data, Line};
use crate::entry::entry;
use crate::numbers::duration;
use crate::peak::Peak;
use crate::record::journals::SAMPLES;
use crate::record::{Folder, Group, Outcome, Record, Sample, is_shown_as, median, ranking, read_lines};
use crate::report::words::{at_size, first_line, title};
use crate::words::{option, quote};
use serde_json::Value;
use std::ops::RangeInclusive;
use std::path::Path;

/// The records of one image size in a folder of results. A test of a claim compares only points that come
/// from the same run.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// The run's folder.
    pub folder: &'a Folder,
    /// The run's records, grouped by scene and device.
    pub groups: Vec<Group<'a>>,
}

impl<'a> Run<'a> {
    /// Creates one run for every image size in a folder.
    pub fn of(folder: &'a Folder, groups: Vec<Group<'a>>) -> Vec<Self> {
        let mut runs: Vec<Self> = Vec::new();
        for group in groups {
            let is_its = |run: &Self| run.image_size() == group.image_size;
            entry(&mut runs, is_its, || Self { folder, groups: Vec::new() }).groups.push(group);
        }
        runs
    }

    /// Returns the size of the run's images in pixels, across and down.
    pub fn image_size(&self) -> [u32; 2] {
        self.groups[0].image_size
    }

    /// Returns the path of the run's folder.
    pub fn path(&self) -> &Path {
        &self.folder.path
    }

    /// Returns the command that measures the points that are still missing on the page of `raycl reproduce`.
    /// The page is in the folder that contains the run's folder. The command has the run's options `--device`
    /// and `--set`. Without the run's `--device` and `--set`, the command would make another plan, and the
    /// page would hide those records of the run that are not in the new plan. `more` is appended to the
    /// command.
    pub fn completion(&self, more: &str) -> String {
        let page = self.path().parent().filter(|folder| !folder.as_os_str().is_empty());
        let page = page.unwrap_or(Path::new(".")).display();
        let environment = &self.folder.environment;
        let words = option("--out", page).into_iter().chain(devices(environment)).chain(changes(environment));
        let words: Vec<_> = words.map(|word| quote(&word)).collect();
        format!("raycl reproduce {} --resume{more}", words.join(" "))
    }
}

/// Returns the options `--device` with which a run was started, from the run's `environment.json`.
fn devices(environment: &Value) -> Vec<String> {
    let words = texts(environment, "command_line");
    let given = words.iter().enumerate().filter_map(|(index, word)| match *word {
        "--device" => words.get(index + 1).copied(),
        joined => joined.strip_prefix("--device="),
    });
    given.flat_map(|name| option("--device", name)).collect()
}

/// Returns an option `--set` for each value of the config that a run changed. The run's `environment.json`
/// has the changed values as lines of TOML.
fn changes(environment: &Value) -> Vec<String> {
    let lines = texts(environment, "overrides");
    lines.iter().flat_map(|line| option("--set", line.replacen(" = ", "=", 1))).collect()
}

/// Returns the texts of the list `key` in a run's `environment.json`. Returns no texts if the list does not
/// exist.
fn texts<'a>(environment: &'a Value, key: &str) -> Vec<&'a str> {
    environment[key].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

/// Returns the command that measures the points of a device that are still missing on the page of `raycl
/// reproduce`; `None` if `runs` is empty. If the measurement of some of the device's points was not
/// completed, the command measures these points again.
pub fn completion(runs: &[Run<'_>], device: &str) -> Option<String> {
    let groups = runs.iter().flat_map(|run| &run.groups).filter(|group| group.device == device);
    let is_retried = groups.flat_map(|group| &group.records).any(|record| is_incomplete(record));
    Some(runs.first()?.completion(if is_retried { " --retry-failed" } else { "" }))
}

/// A run and a device. The tests of a claim use only the device's records in this run.
pub(super) struct ClaimData<'a> {
    pub(super) run: &'a Run<'a>,
    pub(super) device: &'a str,
}

/// Returns true if the measurement of a record's point was not completed: the process crashed or took too
/// long, the image was wrong, or too little memory was free when the point was to be measured. The record of
/// an incomplete measurement does not show whether the point runs, or how fast the point is.
pub(super) fn is_incomplete(record: &Record) -> bool {
    let lacked_for_a_moment = record.outcome == Outcome::Infeasible && !record.is_final();
    lacked_for_a_moment
        || matches!(record.outcome, Outcome::TimedOut | Outcome::Crashed | Outcome::WrongImage)
}

impl<'a> ClaimData<'a> {
    /// Returns the run's records that match a point of a claim.
    pub(super) fn records(&self, point: &Point) -> Vec<&'a Record> {
        let all = self.run.groups.iter().flat_map(|group| group.records.iter().copied());
        all.filter(|record| point.is(record, self.device)).collect()
    }

    /// Returns the fastest measured record that matches a point. If no matching record has a rank, returns any
    /// measured record that matches. If no measured record matches, the error is a [`Line`] for the page that says
    /// why.
    pub(super) fn measured(&self, point: &Point) -> Result<&'a Record, Line> {
        let records = self.records(point);
        if let Some(best) = ranking(records.iter().copied()).all().first() {
            return Ok(best);
        }
        let incomplete = records.iter().find(|record| is_incomplete(record));
        let Some(untimed) = incomplete.or(records.first()) else {
            return Err(self.missing(&point.to_string()));
        };
        let name = at_size(&point.to_string(), untimed.image_size);
        let text = format!("{name} has no time: {}", first_line(untimed));
        Err(match is_incomplete(untimed) {
            true => self.incomplete(text),
            false => Line::cannot(text, format!("a device on which {point} runs")),
        })
    }

    /// Returns the result line for a missing record, with the command that would make the record. `what` names
    /// the point or the latency that has no record.
    pub(super) fn missing(&self, what: &str) -> Line {
        let decides = format!("the missing record: `{}`", self.run.completion(""));
        Line { data: Data::NoRecord, ..Line::cannot(format!("no record of {what}"), decides) }
    }

    /// Returns the result line for a point whose measurement was not completed, with the command that would measure
    /// this point again.
    fn incomplete(&self, text: String) -> Line {
        Line {
            data: Data::Incomplete,
            ..Line::unclear(text, self.complete("a complete measurement of this point"))
        }
    }

    /// Returns the text `what`, followed by the command that repeats the measurements that the run did not
    /// complete.
    pub(super) fn complete(&self, what: &str) -> String {
        format!("{what}: `{}`", self.run.completion(" --retry-failed"))
    }

    /// Tests whether the time of `of` divided by the time of `to` is in the range `held`.
    pub(super) fn ratio(&self, of: &Point, to: &Point, held: RangeInclusive<f64>) -> Line {
        let (slow, fast) = match (self.measured(of), self.measured(to)) {
            (Ok(slow), Ok(fast)) => (slow, fast),
            (Err(line), _) | (_, Err(line)) => return line,
        };
        let Some(ratio) = Ratio::of(slow, fast) else { return self.missing(&of.to_string()) };
        ratio.line(ratio.between(&side(of, slow), &side(to, fast)), held)
    }

    /// Tests the claim that a point runs or, if `wanted` is false, that the point does not run. If several
    /// records match the point, the point counts as running if at least one of these records has a time. The
    /// result line names the first record with a time or, if no record has a time, the first record.
    pub(super) fn runs(&self, point: &Point, wanted: bool) -> Line {
        let records = self.records(point);
        let ran = records.iter().find(|record| median(record).is_some());
        let Some(record) = ran.or(records.first()) else { return self.missing(&point.to_string()) };
        let (name, scene) = (title(record), at_size(&point.scene, record.image_size));
        match record.outcome {
            Outcome::Measured => {
                let time = median(record).map_or(String::new(), duration);
                Line::decided(format!("{name} runs on {scene}: {time}"), wanted)
            }
            Outcome::Infeasible | Outcome::BuildFailed | Outcome::LaunchFailed if !is_incomplete(record) => {
                Line::decided(format!("{name} on {scene} does not run: {}", first_line(record)), !wanted)
            }
            Outcome::OtherKind => Line::unclear(
                format!("{name} on {scene}: {}", first_line(record)),
                format!("a device of the kind for which {} is meant", record.name),
            ),
            other => self.incomplete(format!("{name} on {scene} ({}): {}", other.name(), first_line(record))),
        }
    }

    /// Returns the samples of a record from the run's file samples.jsonl, or no samples if the file cannot be
    /// read.
    pub(super) fn samples(&self, record: &Record) -> Vec<Sample> {
        let read = read_lines::<Sample>(&self.run.path().join(SAMPLES));
        let all = read.map(|lines| lines.lines).unwrap_or_default();
        all.into_iter().filter(|sample| sample.key == record.key).collect()
    }

    /// Returns the device's peak rates, which the run stored. The error is a result line that says why the peak rates
    /// are missing or cannot be read; `what` names the missing latency in this line.
    pub(super) fn peak(&self, what: &str) -> Result<Peak, Line> {
        let peaks = Peak::stored_in(self.run.path()).map_err(|error| {
            let decides = format!(
                "a new measurement: delete the run's file peak.json, then `{}`",
                self.run.completion("")
            );
            Line::cannot(error.to_string(), decides)
        })?;
        peaks
            .into_iter()
            .find(|peak| is_shown_as(&peak.device, self.device))
            .ok_or_else(|| self.missing(what))
    }

    /// Returns true if the run's `environment.json` describes the device as a CPU.
    pub(super) fn is_cpu(&self) -> bool {
        let devices = self.run.folder.environment["devices"].as_array();
        let is_own = |one: &&Value| one["device"].as_str().is_some_and(|name| is_shown_as(name, self.device));
        devices.into_iter().flatten().find(is_own).is_some_and(|one| one["kind"] == "cpu")
    }
}

/// Formats a point with its time, as one side of a comparison: "naive at 8 x 8 on teapot (its best-ranked size,
/// 1.2 ms)". If the point's size is [`Size::Best`], `record` is the fastest of several records, and the text contains
/// "its best-ranked size". Points are ranked by ratios of samples, so another size may have a smaller median.
pub(super) fn side(point: &Point, record: &Record) -> String {
    let best = if point.size == Size::Best { "its best-ranked size, " } else { "" };
    let time = median(record).map_or(String::new(), duration);
    format!("{} on {} ({best}{time})", title(record), at_size(&point.scene, record.image_size))
}
