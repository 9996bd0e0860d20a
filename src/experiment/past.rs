//! The results that existed before a run's current session, which the session continues.

use super::earlier::{intact_lines, lines};
use super::moved_processors::Latencies;
use super::taken::Taken;
use crate::device::DeviceInfo;
use crate::error::Result;
use crate::existing;
use crate::record::journals::{ANCHORS, CONTROLS, LAUNCHES, RECORDS, ROUNDS, SAMPLES};
use crate::record::{AnchorSample, LaunchEnd, Lines, Record, RoundLoad, Sample, latest, read_records};
use std::collections::HashMap;
use std::path::Path;

/// The device that measured a launch, if points were distributed over several devices of the same model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeasuredOn {
    /// The device's name in the form that is used in names of files.
    pub slug: String,
    /// The device's UUID or PCI address, if one of them is known.
    pub hardware: Option<String>,
}

impl MeasuredOn {
    /// Returns true if the launch may have been measured on `device`: the names are equal, and the UUIDs or PCI
    /// addresses are equal or unknown. Equal names alone do not show that two devices are the same. The names of
    /// devices of the same model differ only in a number, since each session numbers the devices that the session
    /// finds. Another session may find other devices, or find them in another order.
    pub fn may_be(&self, device: &DeviceInfo) -> bool {
        let known = self.hardware.as_deref().zip(device.hardware.id());
        self.slug == device.slug() && known.is_none_or(|(one, other)| one == other)
    }
}

/// The results that existed before the current session: results of earlier sessions in the folder, or of
/// earlier attempts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Past {
    /// The last record of each finished point. The points are in the order in which they first occur in the journal.
    pub records: Vec<Record>,
    /// The samples of every point, by the point's key, in the order of measurement.
    pub samples: HashMap<String, Vec<Taken>>,
    /// The ends (reasons and numbers of samples) of launches whose points had enough samples. The map's keys
    /// are the launches' numbers.
    pub ends: HashMap<u32, LaunchEnd>,
    /// The device that measured a launch, by the launch's number, if points were distributed over several devices.
    pub devices: HashMap<u32, MeasuredOn>,
    /// The readings of the core-to-core latency around samples, and while the rounds of a launch were timed.
    pub latencies: Latencies,
    /// The number that the next launch of this session will get.
    pub next_launch: u32,
}

impl Past {
    /// Reads the results that `--resume` continues. A journal that the folder lacks counts as empty. Damaged lines are
    /// reported and ignored; a point whose record is damaged is measured again. The caller need not hold the folder's
    /// lock: a run that writes to the folder at the same time only appends lines to the journals.
    pub fn in_folder(folder: &Path) -> Result<Self> {
        let journal = folder.join(RECORDS);
        let records = if existing::exists(&journal)? { read_records(folder)? } else { Lines::default() };
        let records = intact_lines(records, journal.display());
        let controls = lines::<Record>(folder, CONTROLS)?;
        let (samples, rounds) = (lines::<Sample>(folder, SAMPLES)?, lines::<RoundLoad>(folder, ROUNDS)?);
        let anchors = lines::<AnchorSample>(folder, ANCHORS)?;
        let ends = lines::<LaunchEnd>(folder, LAUNCHES)?;
        // A launch's number is never used again, even if a journal was lost or damaged. Records whose
        // launches have equal numbers would be compared as if they had been measured together.
        let of_records = records.iter().chain(&controls).flat_map(|record| &record.sample_launches).copied();
        let of_lines = rounds.iter().map(|line| line.launch).chain(anchors.iter().map(|line| line.launch));
        let of_ends = ends.iter().map(|end| end.launch);
        let next = of_records.chain(of_lines).chain(of_ends).max().map_or(0, |last| last.saturating_add(1));
        let of_samples = samples.iter().map(|sample| sample.core_to_core_ns);
        let latencies = Latencies::of(of_samples.chain(rounds.iter().map(|line| line.core_to_core_ns)));
        let past = Self::of(records, samples);
        Ok(Self { ends: by_launch(ends), latencies, next_launch: past.next_launch.max(next), ..past })
    }

    /// Returns true if earlier sessions measured nothing in the folder.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty() && self.samples.is_empty()
    }

    /// Takes the last record of each finished point from `lines`, and sorts the samples by their points. Also finds out
    /// which device measured each launch, and which number the next launch gets.
    pub(super) fn of(lines: Vec<Record>, samples: Vec<Sample>) -> Self {
        let records = latest(lines, |record| record.key.clone());
        let mut past = Self { records, ..Self::default() };
        for sample in samples {
            let taken = Taken::of_sample(&sample);
            past.next_launch = past.next_launch.max(sample.launch.saturating_add(1));
            let hardware = sample.measured_by;
            let device = sample.measured_on.map(|slug| MeasuredOn { slug, hardware });
            past.devices.extend(device.map(|device| (sample.launch, device)));
            past.samples.entry(sample.key).or_default().push(taken);
        }
        past
    }
}

/// Returns the ends of launches by the launches' numbers.
pub(super) fn by_launch(ends: Vec<LaunchEnd>) -> HashMap<u32, LaunchEnd> {
    ends.into_iter().map(|end| (end.launch, end)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Results;
    use super::*;
    use crate::measure::StopReason;
    use crate::record::{Environment, Outcome};

    #[cfg(unix)]
    #[test]
    fn results_that_cannot_be_found_do_not_count_as_missing() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Past::in_folder(folder.path()).unwrap(), Past::default());
        Results::create(folder.path(), &Environment::default()).unwrap();
        // A symbolic link to itself cannot be opened; it stands for a file on a failing disk.
        for name in [RECORDS, SAMPLES, CONTROLS, ROUNDS, ANCHORS, LAUNCHES] {
            let path = folder.path().join(name);
            let text = std::fs::read(&path).unwrap_or_default();
            let _ = std::fs::remove_file(&path);
            symlink(&path, &path).unwrap();
            let error = Past::in_folder(folder.path()).unwrap_err();
            assert!(error.to_string().starts_with(&format!("cannot read {}", path.display())), "{error}");
            std::fs::remove_file(&path).unwrap();
            std::fs::write(&path, text).unwrap();
        }
        assert_eq!(Past::in_folder(folder.path()).unwrap(), Past::default());
    }

    #[test]
    fn samples_without_records_are_results_too() {
        let sample = Sample { key: "a".into(), ..Sample::default() };
        let record = Record { key: "a".into(), ..Record::default() };
        let is_empty = |records: Vec<Record>, samples: Vec<Sample>| Past::of(records, samples).is_empty();
        assert!(is_empty(Vec::new(), Vec::new()));
        assert!(!is_empty(vec![record], Vec::new()) && !is_empty(Vec::new(), vec![sample]));
    }

    #[test]
    fn no_launch_of_any_journal_is_used_again() {
        let next = |store: &dyn Fn(&mut Results)| {
            let folder = tempfile::tempdir().unwrap();
            store(&mut Results::create(folder.path(), &Environment::default()).unwrap());
            Results::resume(folder.path(), &Environment::default()).unwrap().next_launch()
        };
        let of = |launch: u32| Record {
            key: "a".into(),
            outcome: Outcome::Measured,
            sample_launches: vec![0, launch],
            ..Record::default()
        };
        assert_eq!(next(&|_| ()), 0);
        assert_eq!(next(&|results| results.record(&of(3)).unwrap()), 4);
        assert_eq!(next(&|results| results.control(&of(4)).unwrap()), 5);
        assert_eq!(
            next(&|results| results.load(&RoundLoad { launch: 5, ..RoundLoad::default() }).unwrap()),
            6
        );
        let anchor = AnchorSample { launch: 6, ..AnchorSample::default() };
        assert_eq!(next(&|results| results.anchor(&anchor).unwrap()), 7);
        let sample = Sample { launch: 7, ..Sample::default() };
        assert_eq!(next(&|results| results.sample(&sample).unwrap()), 8);
        let end = LaunchEnd { launch: 8, stop_reason: StopReason::Precise, samples: Default::default() };
        assert_eq!(next(&|results| results.launch_end(&end).unwrap()), 9);
    }
}
