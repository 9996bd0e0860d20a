//! Finds the attempt whose worker processes measured a launch (one measurement of a group of points). An
//! attempt that continues an earlier attempt copies the results of launches from the earlier attempt. The
//! folders of both attempts then contain the lines of the copied launches.

use super::lines;
use crate::error::Result;
use crate::record::journals::SAMPLES;
use crate::record::{AnchorSample, Record, RoundLoad, Sample};
use crate::shard::Attempt;
use serde::de::DeserializeOwned;
use std::collections::{BTreeSet, HashMap};

/// A launch (of worker processes): the index of an attempt, and the launch's number in this attempt.
pub type Launch = (usize, u32);

/// Which attempt measured each launch, and on which machine.
#[derive(Clone, Debug, Default)]
pub struct Origins {
    /// For each copied launch (whose results an attempt copied from an earlier attempt): the original launch.
    originals: HashMap<Launch, Launch>,
    /// The name of each attempt's machine. The list begins with the machines of the attempts in the folder.
    /// The machines of attempts whose folders are missing, but from which other attempts copied launches,
    /// follow at the end of the list. The machine of an attempt without a folder is known from the attempt's
    /// name.
    hosts: Vec<String>,
}

impl Origins {
    /// Reads which launches were copied: each copied sample names its origin.
    pub fn read(attempts: &[Attempt]) -> Result<Self> {
        let host = |attempt: &Attempt| -> Result<String> {
            Ok(attempt.about()?.map_or_else(|| of_name(&attempt.name), |about| about.host))
        };
        let mut hosts = attempts.iter().map(host).collect::<Result<Vec<_>>>()?;
        let mut originals = HashMap::new();
        let names = attempts.iter().enumerate().map(|(index, attempt)| (attempt.name.clone(), index));
        let mut indices: HashMap<String, usize> = names.collect();
        for (index, attempt) in attempts.iter().enumerate() {
            for sample in lines::<Sample>(&attempt.folder.join(SAMPLES))? {
                let Some((name, launch)) = sample.origin.as_deref().and_then(parsed) else { continue };
                let original = *indices.entry(name.to_owned()).or_insert_with(|| {
                    hosts.push(of_name(name));
                    hosts.len() - 1
                });
                originals.insert((index, sample.launch), (original, launch));
            }
        }
        Ok(Self { originals, hosts })
    }

    /// Returns `launch` or, if `launch` is a copy, the original launch.
    pub fn of(&self, launch: Launch) -> Launch {
        self.originals.get(&launch).copied().unwrap_or(launch)
    }

    /// Returns the launches in which a record's samples were measured. For a copied launch, returns the
    /// original launch.
    pub fn of_record(&self, attempt: usize, record: &Record) -> BTreeSet<Launch> {
        record.sample_launches.iter().map(|launch| self.of((attempt, *launch))).collect()
    }

    /// Returns the machine that measured a record's samples. The names of several machines are separated by
    /// `, `. Returns `None` if the record has no samples.
    pub fn host(&self, attempt: usize, record: &Record) -> Option<String> {
        let launches = self.of_record(attempt, record);
        let hosts: BTreeSet<&str> =
            launches.iter().filter_map(|(index, _)| self.hosts.get(*index)).map(String::as_str).collect();
        (!hosts.is_empty()).then(|| hosts.into_iter().collect::<Vec<_>>().join(", "))
    }
}

/// Returns the machine's name in the name of an attempt, such as `shard-00001.node7.77-1.r00`; the whole name if it has
/// another form.
fn of_name(attempt: &str) -> String {
    attempt.split('.').nth(1).unwrap_or(attempt).to_owned()
}

/// Returns the attempt and the launch that the field `origin` of a sample names; `None` if the field has another form.
fn parsed(origin: &str) -> Option<(&str, u32)> {
    let (name, launch) = origin.rsplit_once(" launch ")?;
    Some((name, launch.parse().ok()?))
}

/// A line of a journal (a file with one JSON object per line) that is about one launch (of worker processes).
pub trait OfLaunch: DeserializeOwned {
    /// The launch's number in the attempt.
    fn launch(&mut self) -> &mut u32;
    /// The key of the point, or the name of the device, that the line is about. The text is empty if the
    /// journal's lines are about neither points nor devices.
    fn subject(&self) -> &str;
}

impl OfLaunch for Sample {
    fn launch(&mut self) -> &mut u32 {
        &mut self.launch
    }

    fn subject(&self) -> &str {
        &self.key
    }
}

impl OfLaunch for AnchorSample {
    fn launch(&mut self) -> &mut u32 {
        &mut self.launch
    }

    fn subject(&self) -> &str {
        &self.device
    }
}

impl OfLaunch for RoundLoad {
    fn launch(&mut self) -> &mut u32 {
        &mut self.launch
    }

    fn subject(&self) -> &str {
        ""
    }
}

/// Reads the file `journal` in the folder of each attempt. Calls `use_line` with each line of these files,
/// and with the index of the line's attempt. `use_line` returns true if it used the line. If a line was used,
/// the copies of this line in other attempts' folders are left out. Original lines are read before lines that
/// attempts copied, so a copied line is used only if the original line is missing.
pub fn each_line<T: OfLaunch>(
    attempts: &[Attempt],
    journal: &str,
    origins: &Origins,
    mut use_line: impl FnMut(usize, T) -> std::io::Result<bool>,
) -> std::io::Result<()> {
    let copying: BTreeSet<usize> = origins.originals.keys().map(|(index, _)| *index).collect();
    let mut sources: HashMap<(Launch, String), usize> = HashMap::new();
    for copies in [false, true] {
        let may_have = |(index, _): &(usize, &Attempt)| !copies || copying.contains(index);
        for (index, attempt) in attempts.iter().enumerate().filter(may_have) {
            for mut line in lines::<T>(&attempt.folder.join(journal)).map_err(std::io::Error::other)? {
                let launch = (index, *line.launch());
                if origins.originals.contains_key(&launch) != copies {
                    continue;
                }
                let subject = (origins.of(launch), line.subject().to_owned());
                let is_used = sources.get(&subject).is_some_and(|source| *source != index);
                if !is_used && use_line(index, line)? {
                    sources.insert(subject, index);
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::record::JsonLines;
    use crate::shard::About;
    use std::path::Path;

    /// Makes an attempt at the first shard with these samples. Each sample is given by the number of its
    /// launch and, if it was copied from another attempt, the text of its field `origin`.
    fn attempt(out: &Path, host: &str, samples: &[(u32, Option<String>)]) -> Attempt {
        let about = About { shard: 1, of: 1, host: host.into(), ..About::default() };
        let attempt = Attempt::begin(out, &about).unwrap();
        let sample = |(launch, origin): &(u32, Option<String>)| Sample {
            key: "k".into(),
            launch: *launch,
            origin: origin.clone(),
            ..Sample::default()
        };
        let samples: Vec<Sample> = samples.iter().map(sample).collect();
        JsonLines::append_to(&attempt.folder.join(SAMPLES)).unwrap().append_all(&samples).unwrap();
        attempt
    }

    /// Returns the attempt and the launch of each line that is used.
    fn used(attempts: &[Attempt], origins: &Origins) -> Vec<Launch> {
        let mut used = Vec::new();
        each_line::<Sample>(attempts, SAMPLES, origins, |index, sample| {
            used.push((index, sample.launch));
            Ok(true)
        })
        .unwrap();
        used
    }

    #[test]
    fn a_copied_launch_is_of_the_machine_that_measured_it_and_is_used_once() {
        let out = tempfile::tempdir().unwrap();
        let second = attempt(out.path(), "n2", &[(3, None), (3, None), (4, None)]);
        let from = |name: &str, launch: u32| Some(format!("{name} launch {launch}"));
        let samples =
            [(0, from(&second.name, 3)), (0, from(&second.name, 3)), (1, from("gone", 7)), (2, None)];
        let first = attempt(out.path(), "n1", &samples);
        let third = attempt(out.path(), "n3", &[(5, from("gone", 7))]);
        let attempts = [first, second, third];
        let origins = Origins::read(&attempts).unwrap();
        let originals = [(0, 0), (0, 1), (0, 2), (2, 5)].map(|launch| origins.of(launch));
        assert_eq!(originals, [(1, 3), (3, 7), (0, 2), (3, 7)]);
        let host = |attempt, launches: &[u32]| {
            origins.host(attempt, &Record { sample_launches: launches.to_vec(), ..Record::default() })
        };
        assert_eq!(host(0, &[0, 0]).as_deref(), Some("n2"));
        assert_eq!(host(0, &[0, 2, 2]).as_deref(), Some("n1, n2"));
        assert_eq!((host(2, &[5]).as_deref(), host(2, &[])), (Some("gone"), None));
        // The folder of the attempt `gone` is missing, so the lines of its launch are taken from the first
        // attempt that copied them.
        assert_eq!(used(&attempts, &origins), [(0, 2), (1, 3), (1, 3), (1, 4), (0, 1)]);
        // If the original lines of a copied launch are missing, the lines of the copy are used.
        std::fs::write(attempts[1].folder.join(SAMPLES), "").unwrap();
        assert_eq!(used(&attempts, &origins), [(0, 2), (0, 0), (0, 0), (0, 1)]);
    }
}
