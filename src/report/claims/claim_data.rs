//! The data of one device in one run, and how a test finds its points in it.

use super::point::{Point, Size};
use super::sure::Ratio;
use super::verdict::Line;
use crate::peak::Peak;
use crate::record::{Folder, Group, Outcome, Record, Sample, duration, median, ranking, read_lines};
use crate::report::words::{first_line, title};
use std::ops::RangeInclusive;
use std::path::Path;

/// A run. A comparison takes both sides from one run, at one image size.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// Its folder.
    pub folder: &'a Folder,
    /// Its records.
    pub groups: Vec<Group<'a>>,
}

impl<'a> Run<'a> {
    /// The records of a folder, a run for every image size.
    pub fn of(folder: &'a Folder, groups: Vec<Group<'a>>) -> Vec<Self> {
        let mut runs: Vec<Self> = Vec::new();
        for group in groups {
            match runs.iter_mut().find(|run| run.groups[0].image_size == group.image_size) {
                Some(run) => run.groups.push(group),
                None => runs.push(Self { folder, groups: vec![group] }),
            }
        }
        runs
    }

    /// The folder that it lies in.
    pub fn path(&self) -> &Path {
        &self.folder.path
    }
}

/// A run as one device's claims see it.
pub(super) struct ClaimData<'a> {
    pub(super) run: &'a Run<'a>,
    pub(super) device: &'a str,
    /// The configs that measure a claim's points.
    pub(super) configs: &'a [String],
}

impl<'a> ClaimData<'a> {
    /// The records that a point means.
    pub(super) fn records(&self, point: &Point) -> Vec<&'a Record> {
        let all = self.run.groups.iter().flat_map(|group| group.records.iter().copied());
        all.filter(|record| point.is(record, self.device)).collect()
    }

    /// The measured record of a point, the fastest if there are several; or the reason why there is none.
    pub(super) fn measured(&self, point: &Point) -> Result<&'a Record, Line> {
        let records = self.records(point);
        if let Some(best) = ranking(records.iter().copied()).all().first() {
            return Ok(best);
        }
        let Some(refused) = records.first() else { return Err(self.missing(&point.to_string())) };
        let text = format!("{point} has no time: {}", first_line(refused));
        Err(Line::cannot(text, format!("a device on which {point} runs")))
    }

    /// The line for a point without a record.
    pub(super) fn missing(&self, what: &str) -> Line {
        let commands: Vec<_> =
            self.configs.iter().map(|config| format!("`raycl run configs/{config}.toml`")).collect();
        Line::cannot(format!("no record of {what}"), format!("its record: {}", commands.join(", ")))
    }

    /// Whether the ratio of two points' times is within bounds.
    pub(super) fn ratio(&self, of: &Point, to: &Point, held: RangeInclusive<f64>) -> Line {
        let (slow, fast) = match (self.measured(of), self.measured(to)) {
            (Ok(slow), Ok(fast)) => (slow, fast),
            (Err(line), _) | (_, Err(line)) => return line,
        };
        let Some(ratio) = Ratio::of(slow, fast) else { return self.missing(&of.to_string()) };
        ratio.line(ratio.between(&side(of, slow), &side(to, fast)), held)
    }

    /// Whether the points run, of which one record is enough; a point that means several tells of the first that ran.
    pub(super) fn runs(&self, point: &Point, wanted: bool) -> Line {
        let records = self.records(point);
        let ran = records.iter().find(|record| median(record).is_some());
        let Some(told) = ran.or(records.first()) else { return self.missing(&point.to_string()) };
        let name = title(told);
        match told.outcome {
            Outcome::Measured => {
                let time = median(told).map_or(String::new(), duration);
                Line::decided(format!("{name} on {} runs: {time}", point.scene), wanted)
            }
            Outcome::Infeasible | Outcome::BuildFailed | Outcome::LaunchFailed => Line::decided(
                format!("{name} on {} does not run: {}", point.scene, first_line(told)),
                !wanted,
            ),
            other => Line::unclear(
                format!("{name} on {}: {}: {}", point.scene, other.name(), first_line(told)),
                "a run of it that ends".to_owned(),
            ),
        }
    }

    /// The samples of a record, from its run's journal.
    pub(super) fn samples(&self, record: &Record) -> Vec<Sample> {
        let read = read_lines::<Sample>(&self.run.path().join("samples.jsonl"));
        let all = read.map(|lines| lines.lines).unwrap_or_default();
        all.into_iter().filter(|sample| sample.key == record.key).collect()
    }

    /// The device's peak rates, if its run measured them.
    pub(super) fn peak(&self) -> Option<Peak> {
        let kept = Peak::kept_in(self.run.path()).unwrap_or_default();
        kept.into_iter().find(|peak| peak.device == self.device)
    }

    /// Whether the run's environment calls the device a CPU.
    pub(super) fn is_cpu(&self) -> bool {
        let devices = self.run.folder.environment["devices"].as_array();
        let own = devices.into_iter().flatten().find(|one| one["device"].as_str() == Some(self.device));
        own.is_some_and(|one| one["kind"] == "cpu")
    }
}

/// A point with its time, as a side of a comparison; of the fastest, which one that is.
fn side(point: &Point, record: &Record) -> String {
    let best = if point.size == Size::Best { "its best, " } else { "" };
    let time = median(record).map_or(String::new(), duration);
    format!("{} on {} ({best}{time})", title(record), point.scene)
}
