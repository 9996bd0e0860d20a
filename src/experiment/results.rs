//! The folder into which a run writes its results.

use super::earlier;
use super::lock::Lock;
use super::moved_processors::Latencies;
use super::past::{Past, by_launch};
use crate::device::DeviceInfo;
use crate::error::{Error, Result};
use crate::existing;
use crate::peak::{self, Peak};
use crate::record::journals::{
    ANCHORS, CONTROLS, ENVIRONMENT, IMAGES, LAUNCHES, RECORDS, ROUNDS, SAMPLES, earlier_environment,
};
use crate::record::{
    AnchorSample, CurrentPlan, Environment, Folder, JsonLines, LaunchEnd, Record, RoundLoad, Sample,
    cannot_make, own_folder, refuse_closed, remove_leftovers, renew_intervals, sync_folder,
};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A folder of results. During a run, the folder has the plan, the journals (files to which a run appends lines, such
/// as records), the pictures and the environment. At the end of the run, the summaries, the report, the plots and the
/// exports are added. docs/format.md documents each file.
pub struct Results {
    folder: PathBuf,
    records: JsonLines<Record>,
    samples: JsonLines<Sample>,
    launch_ends: JsonLines<LaunchEnd>,
    rounds: JsonLines<RoundLoad>,
    anchors: JsonLines<AnchorSample>,
    /// The journal of control points; `None` until this session stores the first record of a control point.
    controls: Option<JsonLines<Record>>,
    /// The machine's name, if the experiment is divided into shards.
    host: Option<String>,
    /// The core-to-core latencies in the folder's journals of rounds and samples. Samples and rounds that were copied
    /// from earlier attempts have no latencies.
    latencies: Latencies,
    past: Past,
    peak: Vec<Peak>,
    _lock: Lock,
}

/// The remedy if the folder cannot be made or written to.
const ELSEWHERE: &str = "choose another folder with --out DIR";

impl Results {
    /// Makes a new folder of results. A folder that already has a journal of records is refused, so that no measurement
    /// is ever overwritten.
    pub fn create(folder: &Path, environment: &Environment) -> Result<Self> {
        if existing::exists(&folder.join(RECORDS))? {
            let error = Error::input(format!("{} already holds results", folder.display()));
            return Err(
                error.with_help("continue the run with --resume, or choose another folder with --out")
            );
        }
        Self::resume(folder, environment)
    }

    /// Makes the folder of an attempt at a shard (a part of an experiment); `host` is this machine's name. The attempt
    /// continues where earlier attempts ended. Points with a record in an earlier attempt count as finished, except
    /// points that exceeded a limit of the device that may differ from session to session
    /// ([`Record::is_of_the_session`]). If `retry_failed` is true, a point is also unfinished if its record is not
    /// final ([`Record::is_final`]): a failure, or a lack of memory that may be temporary. If a launch has samples of
    /// unfinished points, the following data of this launch are copied: all samples that count, the end, the anchor's
    /// times, and the load of the rounds. Each copied sample names the attempt and launch that took the sample. Unless
    /// `keeps_moved_samples` is true, samples whose core-to-core latency was far from their attempt's usual latency do
    /// not count. The folders of the earlier attempts are not changed.
    pub fn of_attempt(
        folder: &Path,
        environment: &Environment,
        host: &str,
        earlier: &[PathBuf],
        keeps_moved_samples: bool,
        retry_failed: bool,
    ) -> Result<Self> {
        let mut results = Self::create(folder, environment)?;
        results.host = Some(host.to_owned());
        let before = earlier::read(earlier, keeps_moved_samples, retry_failed)?;
        results.samples.append_all(&before.samples)?;
        results.launch_ends.append_all(&before.ends)?;
        results.anchors.append_all(&before.anchors)?;
        results.rounds.append_all(&before.rounds)?;
        let ends = by_launch(before.ends);
        results.past = Past { ends, ..Past::of(before.records, before.samples) };
        Ok(results)
    }

    /// Continues in an existing folder, or makes the folder if it does not exist. Takes the folder's lock, reads the
    /// results of earlier sessions, removes temporary files that killed processes left, and writes the environment of
    /// this session.
    pub fn resume(folder: &Path, environment: &Environment) -> Result<Self> {
        Self::begin(folder, |path| environment.write(path))
    }

    /// Continues in an existing folder, or makes the folder if it does not exist. `write_environment` writes the
    /// file of the environment.
    fn begin(folder: &Path, write_environment: impl Fn(&Path) -> Result<()>) -> Result<Self> {
        refuse_closed(folder, ELSEWHERE)?;
        let images = folder.join(IMAGES);
        own_folder(&images).map_err(|error| {
            cannot_make(if folder.is_dir() { &images } else { folder }, &error, ELSEWHERE)
        })?;
        let lock = Lock::take(folder)?;
        // The folder's results are read before any file of the folder is changed. A folder that is refused,
        // such as another program's folder, thus keeps its files.
        let mut past = Past::in_folder(folder)?;
        let peak = Peak::stored_in(folder)?;
        let [records, samples, launch_ends, rounds, anchors] =
            [RECORDS, SAMPLES, LAUNCHES, ROUNDS, ANCHORS].map(|name| folder.join(name));
        // No other run writes to the folder while this run holds the lock.
        remove_leftovers(folder, Duration::ZERO);
        let open_records = || JsonLines::append_to(&records);
        let earlier_records = existing::is_entry(&records)?.then(open_records).transpose()?;
        let (samples, launch_ends) = (JsonLines::append_to(&samples)?, JsonLines::append_to(&launch_ends)?);
        let (rounds, anchors) = (JsonLines::append_to(&rounds)?, JsonLines::append_to(&anchors)?);
        // The journals are opened first: a session that cannot open its journals does not begin, and leaves the earlier
        // session's environment file unchanged.
        keep_environment(folder, write_environment)?;
        // `create` refuses a folder with a journal of records. This journal is made last, so that a new run can still
        // use the folder if an earlier step fails.
        let records = earlier_records.map_or_else(open_records, Ok)?;
        sync_folder(folder).map_err(|error| cannot_make(folder, &error, ELSEWHERE))?;
        Ok(Self {
            folder: folder.to_owned(),
            records,
            samples,
            launch_ends,
            rounds,
            anchors,
            controls: None,
            host: None,
            latencies: std::mem::take(&mut past.latencies),
            past,
            peak,
            _lock: lock,
        })
    }

    /// Returns the results of earlier sessions in the folder, or of earlier attempts.
    pub fn past(&self) -> &Past {
        &self.past
    }

    /// Returns the devices' peak rates, if they were measured.
    pub fn peak(&self) -> &[Peak] {
        &self.peak
    }

    /// Returns true if the folder has the peak rates of each device, measured with the device's driver and in the
    /// device's state.
    pub fn has_peak_of(&self, devices: &[&DeviceInfo]) -> bool {
        devices.iter().all(|&device| {
            let is_usable = |peak: &Peak| peak.device == device.label && !peak.are_outdated(&[device]);
            self.peak.iter().any(is_usable)
        })
    }

    /// Stores the peak rates of devices. The folder keeps its earlier rates of devices that `peak` does not contain. If
    /// rates of the run's `devices` were measured with another driver or other settings of the device, they are left
    /// out, since these devices no longer have these rates. Returns the peak rates that are left out.
    pub fn keep_peak(&mut self, peak: Vec<Peak>, devices: &[&DeviceInfo]) -> Result<Vec<Peak>> {
        let all = peak.into_iter().chain(self.peak.clone());
        let (left_out, usable): (Vec<Peak>, Vec<Peak>) = all.partition(|peak| peak.are_outdated(devices));
        let mut kept = Vec::new();
        Peak::add_new(&mut kept, usable);
        if kept != self.peak {
            Peak::write(&kept, &self.folder.join(peak::FILE))?;
            self.peak = kept;
        }
        Ok(left_out)
    }

    /// Stores a record. Fails if the folder or its journal of records, samples or rounds was removed or replaced. The
    /// run then ends at once, and not only after it has measured all points.
    pub fn record(&mut self, record: &Record) -> Result<()> {
        self.records.check_place()?;
        self.samples.check_place()?;
        self.rounds.check_place()?;
        self.records.append(record)
    }

    /// Stores a record of a control point, which is only measured for comparison with other blocks.
    pub fn control(&mut self, record: &Record) -> Result<()> {
        if self.controls.is_none() {
            self.controls = Some(JsonLines::append_to(&self.folder.join(CONTROLS))?);
        }
        self.controls.as_mut().map_or(Ok(()), |controls| controls.append(record))
    }

    /// Returns the machine's name, if the experiment is divided into shards.
    pub fn host(&self) -> Option<&str> {
        self.host.as_deref()
    }

    /// Returns a number for a new launch. The number is unique in the folder.
    pub fn next_launch(&mut self) -> u32 {
        self.past.next_launch += 1;
        self.past.next_launch - 1
    }

    /// Appends a sample to the folder's journal of samples.
    pub fn sample(&mut self, sample: &Sample) -> Result<()> {
        self.latencies.add(sample.core_to_core_ns);
        self.samples.append(sample)
    }

    /// Stores the end of a launch that a stopping rule ended. Fails if the folder or its `records.jsonl` was removed or
    /// replaced.
    pub fn launch_end(&mut self, end: &LaunchEnd) -> Result<()> {
        self.records.check_place()?;
        self.launch_ends.append(end)
    }

    /// Stores the machine's load while rounds were timed, and the core-to-core latency after these rounds.
    pub fn load(&mut self, load: &RoundLoad) -> Result<()> {
        self.latencies.add(load.core_to_core_ns);
        self.rounds.append(load)
    }

    /// Returns the core-to-core latency of near processors in nanoseconds, from the folder's journals of rounds
    /// and samples, `rounds.jsonl` and `samples.jsonl`; infinity if the journals have too few readings. Processors
    /// are near if they run on cores at their usual distance from each other.
    pub fn near_ns(&self) -> f64 {
        self.latencies.near_ns()
    }

    /// Stores a time of the anchor.
    pub fn anchor(&mut self, sample: &AnchorSample) -> Result<()> {
        self.anchors.append(sample)
    }

    /// Stores which points of the experiment belong to the current run. In the folder's peak rates, each
    /// device gets the name that this run gives to it.
    pub fn plan(&mut self, plan: &CurrentPlan) -> Result<()> {
        self.rename_peak(plan)?;
        plan.write(&self.folder)
    }

    /// In the peak rates, replaces the devices' names by the names that the plan uses. A device's name depends on the
    /// machine's other devices, so an earlier session may have used another name.
    fn rename_peak(&mut self, plan: &CurrentPlan) -> Result<()> {
        // An earlier plan that cannot be read is treated as empty, since the new plan replaces it.
        let earlier = CurrentPlan::read(&self.folder).ok().flatten().unwrap_or_default();
        let of_records = self.past.records.iter().map(|record| (record.key.as_str(), record.device.as_str()));
        let points = || earlier.devices().into_iter().chain(of_records.clone());
        let renamed = |peak: &Peak| {
            let device = plan.device_called(&peak.device, points()).unwrap_or(&peak.device);
            Peak { device: device.to_owned(), ..peak.clone() }
        };
        let mut all = Vec::new();
        Peak::add_new(&mut all, self.peak.iter().map(renamed).collect());
        if all != self.peak {
            Peak::write(&all, &self.folder.join(peak::FILE))?;
            self.peak = all;
        }
        Ok(())
    }

    /// Writes the summaries of the points in the folder's plan, and updates the 95% intervals in the journal
    /// of records. Returns the records of the points in the plan.
    pub fn summarise(&mut self, question: &str, expectation: &str) -> Result<Vec<Record>> {
        self.records.check_place()?;
        let shown = Folder::read(&self.folder)?;
        let journal = self.folder.join(RECORDS);
        if renew_intervals(&journal, &shown.records)? {
            self.records = JsonLines::append_to(&journal)?;
        }
        shown.summarise(question, expectation)?;
        Ok(shown.records)
    }
}

/// Writes the environment with `write`, which replaces the file completely or not at all. The file of the previous run
/// is kept under another name.
fn keep_environment(folder: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let path = folder.join(ENVIRONMENT);
    if !existing::exists(&path)? {
        return write(&path);
    }
    let earlier = |number: usize| folder.join(earlier_environment(number));
    let mut number = 1;
    while existing::exists(&earlier(number))? {
        number += 1;
    }
    let kept = earlier(number);
    // The old environment file gets a second name, and keeps its first name until the new file replaces it.
    // If the disk is full, or if this process is killed now, the folder thus still has an environment file.
    // On a file system without hard links, the old file is renamed.
    let linked = std::fs::hard_link(&path, &kept);
    linked.or_else(|_| std::fs::rename(&path, &kept)).map_err(|error| Error::unwritable(&kept, &error))?;
    write(&path).inspect_err(|_| {
        // If the new file cannot be written, this session does not begin. The environment file of the
        // previous session then has only its first name again, since the previous session is still the latest
        // one. If the second name cannot be removed, the file keeps both names. If only the folder's list of
        // files could not be written to the disk, the new file is already at `path`, and both the old and the
        // new file stay.
        let is_old =
            || matches!((std::fs::read(&path), std::fs::read(&kept)), (Ok(now), Ok(old)) if now == old);
        let _ = match existing::exists(&path) {
            Ok(false) => std::fs::rename(&kept, &path),
            Ok(true) if is_old() => std::fs::remove_file(&kept),
            _ => Ok(()),
        };
    })
}

#[cfg(test)]
mod tests {
    use super::super::earlier::lines;
    use super::*;
    use crate::measure::StopReason;
    use crate::record::Outcome;
    use std::collections::HashMap;

    fn record(key: &str, outcome: Outcome) -> Record {
        Record { key: key.into(), outcome, ..Record::default() }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_in_which_no_file_can_be_created_is_the_users_mistake() {
        // Not even the superuser can create files in /proc/sys.
        let refused = Results::resume(Path::new("/proc/sys"), &Environment::default()).err().unwrap();
        assert_eq!((refused.exit_code(), refused.remedy()), (2, ELSEWHERE));
        let message = refused.to_string();
        assert!(message.starts_with("the folder '/proc/sys' cannot be written to ("), "{message}");
    }

    #[test]
    fn results_are_never_overwritten_and_go_on_where_asked() {
        let folder = tempfile::tempdir().unwrap();
        let environment = Environment::default();
        let mut first = Results::create(folder.path(), &environment).unwrap();
        first.record(&record("a", Outcome::Crashed)).unwrap();
        first.record(&record("b", Outcome::Measured)).unwrap();
        first.record(&record("a", Outcome::Measured)).unwrap();
        for round in [0, 1] {
            first.sample(&Sample { key: "c".into(), round, ms: 1.5, ..Sample::default() }).unwrap();
        }
        assert_eq!(
            Results::resume(folder.path(), &environment).err().unwrap().exit_code(),
            2,
            "it is locked"
        );
        drop(first);
        std::fs::write(folder.path().join("images/.raycl-abc"), "half a picture").unwrap();
        assert_eq!(Results::create(folder.path(), &environment).err().unwrap().exit_code(), 2);

        let second = Results::resume(folder.path(), &environment).unwrap();
        let past = second.past();
        let actual: Vec<_> = past.records.iter().map(|r| (r.key.as_str(), r.outcome)).collect();
        assert_eq!(actual, [("a", Outcome::Measured), ("b", Outcome::Measured)]);
        let taken = &past.samples["c"];
        assert_eq!((taken.len(), past.next_launch, taken[0].times.host_ms), (2, 1, 1.5));
        assert_eq!([taken[0].at_ms, taken[1].at_ms], [0.0, 1.0], "without times, rounds order samples");
        assert!(folder.path().join("environment-1.json").exists());
        assert!(!folder.path().join("images/.raycl-abc").exists());
    }

    #[test]
    fn a_folder_that_is_refused_keeps_its_files() {
        let peaks = [(peak::FILE, "rubbish")];
        let array = [(RECORDS, "[{\"id\":1},{\"id\":2}]"), (SAMPLES, "mine"), (ENVIRONMENT, "{\"my\":1}")];
        let lines = [(RECORDS, "{\"id\":1}\n{\"id\":2}"), (ENVIRONMENT, "{}"), (ROUNDS, "[")];
        for files in [&peaks[..], &array, &lines] {
            let folder = tempfile::tempdir().unwrap();
            let path = |name: &str| folder.path().join(name);
            files.iter().for_each(|(name, text)| std::fs::write(path(name), text).unwrap());
            let refused = Results::resume(folder.path(), &Environment::default()).err().unwrap();
            assert_eq!(refused.exit_code(), 2, "{refused}");
            for (name, text) in files {
                assert_eq!(std::fs::read_to_string(path(name)).unwrap(), *text, "{name}");
            }
            // The refused session adds its lock and a folder for pictures.
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), files.len() + 2, "{refused}");
        }
    }

    /// git-annex and DataLad replace files by links.
    #[cfg(unix)]
    #[test]
    fn a_journal_that_is_a_link_is_the_users_mistake_and_leaves_the_environment() {
        for name in [ANCHORS, RECORDS] {
            let folder = tempfile::tempdir().unwrap();
            drop(Results::create(folder.path(), &Environment::default()).unwrap());
            let [journal, outer] = [name, "outer"].map(|name| folder.path().join(name));
            std::fs::rename(&journal, &outer).unwrap();
            std::os::unix::fs::symlink(&outer, &journal).unwrap();
            let refused = Results::resume(folder.path(), &Environment::default()).err().unwrap();
            assert!(refused.exit_code() == 2 && refused.to_string().contains("it is a link"), "{refused}");
            assert!(!folder.path().join(earlier_environment(1)).exists(), "{name}");
        }
    }

    #[test]
    fn a_run_that_cannot_write_its_environment_leaves_a_folder_in_which_a_new_run_can_begin() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Results::begin(folder.path(), |_| Err(Error::run("the disk is full"))).is_err());
        assert!(!folder.path().join(RECORDS).exists());
        assert!(Results::create(folder.path(), &Environment::default()).is_ok());
    }

    #[test]
    fn a_session_that_does_not_begin_leaves_the_environment_of_the_earlier_one() {
        let folder = tempfile::tempdir().unwrap();
        let [now, earlier] = ["environment.json", "environment-1.json"].map(|name| folder.path().join(name));
        let write = |text: &'static str| {
            keep_environment(folder.path(), |path| {
                // The environment file of the earlier session keeps its name until the new file replaces it.
                assert_eq!(path.exists(), text != "first");
                crate::record::write_whole(path, text.as_bytes())
            })
        };
        write("first").unwrap();
        assert!(keep_environment(folder.path(), |_| Err(Error::run("the disk is full"))).is_err());
        assert_eq!((std::fs::read_to_string(&now).unwrap().as_str(), earlier.exists()), ("first", false));
        write("second").unwrap();
        assert_eq!([&now, &earlier].map(|path| std::fs::read_to_string(path).unwrap()), ["second", "first"]);
        let replaced = |path: &Path| -> Result<()> {
            crate::record::write_whole(path, b"third")?;
            Err(Error::run("the folder cannot be written to the disk"))
        };
        assert!(keep_environment(folder.path(), replaced).is_err());
        let second = folder.path().join("environment-2.json");
        assert_eq!([&now, &second].map(|path| std::fs::read_to_string(path).unwrap()), ["third", "second"]);
    }

    /// If the run went on, it would measure all points, and nobody would find the results.
    #[cfg(unix)]
    #[test]
    fn a_run_whose_folder_is_removed_or_replaced_ends_at_the_next_launch_or_point() {
        let parent = tempfile::tempdir().unwrap();
        let [folder, moved] = ["out", "old"].map(|name| parent.path().join(name));
        let mut results = Results::create(&folder, &Environment::default()).unwrap();
        results.record(&record("a", Outcome::Measured)).unwrap();
        let end = LaunchEnd { launch: 0, stop_reason: StopReason::Precise, samples: Default::default() };
        results.launch_end(&end).unwrap();
        std::fs::rename(&folder, &moved).unwrap();
        std::fs::create_dir(&folder).unwrap();
        for ended in [
            results.launch_end(&end),
            results.record(&record("b", Outcome::Measured)),
            results.summarise("", "").map(drop),
        ] {
            let error = ended.unwrap_err();
            assert_eq!(error.exit_code(), 1);
            assert!(error.to_string().contains("was removed or replaced"), "{error}");
        }
        assert_eq!(Past::in_folder(&moved).unwrap().records.len(), 1);
    }

    #[test]
    fn the_rates_of_one_device_replace_its_own_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let peak = |device: &str, driver: &str| Peak {
            device: device.into(),
            driver: driver.into(),
            ..crate::peak::fixtures::rates()
        };
        let mut first = Results::create(folder.path(), &Environment::default()).unwrap();
        first.keep_peak(vec![peak("cpu", "1"), peak("gpu", "1")], &[]).unwrap();
        drop(first);
        let mut second = Results::resume(folder.path(), &Environment::default()).unwrap();
        second.keep_peak(vec![peak("gpu", "2")], &[]).unwrap();
        let expected = [peak("gpu", "2"), peak("cpu", "1")];
        assert_eq!(second.peak(), expected);
        assert_eq!(Peak::stored_in(folder.path()).unwrap(), expected);
    }

    /// The folder's rates are from an earlier session, in which the device had another driver or other settings.
    #[test]
    fn rates_of_a_device_with_another_driver_or_in_another_state_are_left_out() {
        let device = super::super::asleep::device(1.0);
        let peak = |driver: &str, state: Option<String>| Peak {
            device: device.label.clone(),
            platform: device.platform.clone(),
            driver: driver.into(),
            state,
            ..crate::peak::fixtures::rates()
        };
        let now = device.driver.as_str();
        let other = Peak { device: "another".into(), ..peak("another", None) };
        for (own, is_usable) in [
            (peak(now, Some(device.state())), true),
            (peak(now, None), true),
            (peak(now, Some("9 compute units".into())), false),
            (peak("another", None), false),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let mut first = Results::create(folder.path(), &Environment::default()).unwrap();
            first.keep_peak(vec![own.clone(), other.clone()], &[]).unwrap();
            drop(first);
            let mut second = Results::resume(folder.path(), &Environment::default()).unwrap();
            assert_eq!(second.has_peak_of(&[&device]), is_usable, "{own:?}");
            let left_out = second.keep_peak(Vec::new(), &[&device]).unwrap();
            let (usable, outdated): (Vec<Peak>, Vec<Peak>) = match is_usable {
                true => (vec![own, other.clone()], Vec::new()),
                false => (vec![other.clone()], vec![own]),
            };
            assert_eq!((second.peak(), &left_out), (&usable[..], &outdated));
            assert_eq!(Peak::stored_in(folder.path()).unwrap(), usable);
        }
    }

    #[test]
    fn rates_get_the_names_that_a_later_session_gives_to_their_devices() {
        let folder = tempfile::tempdir().unwrap();
        let peaks = |devices: &[&str]| -> Vec<Peak> {
            devices
                .iter()
                .map(|device| Peak { device: (*device).into(), ..crate::peak::fixtures::rates() })
                .collect()
        };
        let of = |key: &str, device: &str| Record { device: device.into(), ..record(key, Outcome::Measured) };
        let mut first = Results::create(folder.path(), &Environment::default()).unwrap();
        first.keep_peak(peaks(&["gpu", "cpu", "other"]), &[]).unwrap();
        // The first session finished measuring a point on the CPU, and no point on the GPU. The first
        // session's plan names the devices of all points.
        first.record(&of("b", "cpu")).unwrap();
        first.plan(&CurrentPlan::of(&[of("a", "gpu"), of("b", "cpu")])).unwrap();
        assert_eq!(first.peak(), peaks(&["gpu", "cpu", "other"]));
        drop(first);
        let mut second = Results::resume(folder.path(), &Environment::default()).unwrap();
        let now = [of("a", "cuda-gpu"), of("c", "cuda-gpu-2"), of("b", "pocl-cpu")];
        second.plan(&CurrentPlan::of(&now)).unwrap();
        let expected = peaks(&["cuda-gpu", "pocl-cpu", "other"]);
        assert_eq!(second.peak(), expected);
        assert_eq!(Peak::stored_in(folder.path()).unwrap(), expected);
    }

    #[test]
    fn an_attempt_continues_launches_of_earlier_ones_with_their_anchors_and_their_load() {
        let parent = tempfile::tempdir().unwrap();
        let [first, second] = ["first", "second"].map(|name| parent.path().join(name));
        let mut earlier = Results::create(&first, &Environment::default()).unwrap();
        let core_to_core_ns = Some(20.0);
        earlier.sample(&Sample { key: "a".into(), launch: 4, core_to_core_ns, ..Sample::default() }).unwrap();
        earlier.anchor(&AnchorSample { launch: 4, ms: 2.5, ..AnchorSample::default() }).unwrap();
        let load = RoundLoad { launch: 4, ms: 3.5, core_to_core_ns, ..RoundLoad::default() };
        earlier.load(&load).unwrap();
        let end = |launch: u32| LaunchEnd {
            launch,
            stop_reason: StopReason::Precise,
            samples: [("a".to_owned(), 1)].into(),
        };
        earlier.launch_end(&end(4)).unwrap();
        drop(earlier);
        let results =
            Results::of_attempt(&second, &Environment::default(), "node7", &[first], false, false).unwrap();
        assert_eq!((results.past().samples["a"].len(), results.past().next_launch), (1, 1));
        assert_eq!(results.past().ends, HashMap::from([(0, end(0))]));
        assert_eq!(lines::<LaunchEnd>(&second, LAUNCHES).unwrap(), [end(0)]);
        // Latencies of the earlier attempt are not used, since that attempt may have run on another machine.
        let taken = &results.past().samples["a"][0];
        assert_eq!((results.near_ns(), taken.core_to_core_ns), (f64::INFINITY, None));
        let anchors = lines::<AnchorSample>(&second, ANCHORS).unwrap();
        let rounds = lines::<RoundLoad>(&second, ROUNDS).unwrap();
        assert_eq!((anchors[0].launch, anchors[0].ms), (0, 2.5));
        assert_eq!((rounds[0].launch, rounds[0].ms), (0, 3.5));
    }

    #[test]
    fn damage_to_the_only_line_of_a_journal_costs_only_this_line() {
        let folder = tempfile::tempdir().unwrap();
        let mut first = Results::create(folder.path(), &Environment::default()).unwrap();
        first.record(&record("a", Outcome::Measured)).unwrap();
        first.plan(&CurrentPlan::default()).unwrap();
        drop(first);
        let resumed = || {
            let results = Results::resume(folder.path(), &Environment::default()).unwrap();
            results.past().records.len()
        };
        for name in [ANCHORS, ROUNDS, CONTROLS, LAUNCHES, SAMPLES] {
            std::fs::write(folder.path().join(name), "nonsense\n").unwrap();
            assert_eq!(resumed(), 1, "{name}");
        }
        std::fs::write(folder.path().join(RECORDS), "nonsense\n").unwrap();
        assert_eq!(resumed(), 0);
        // If the folder has no plan, a journal of records without an intact line may be another program's file, so the
        // folder is refused.
        std::fs::remove_file(folder.path().join("plan.json")).unwrap();
        let refused = Results::resume(folder.path(), &Environment::default()).err().unwrap();
        assert_eq!(refused.exit_code(), 2);
    }

    #[test]
    fn the_latency_of_near_processors_is_that_of_all_rounds_and_samples_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut first = Results::create(folder.path(), &Environment::default()).unwrap();
        for (of_round, of_sample) in [(90.0, 20.0), (80.0, 85.0), (40.0, 30.0), (25.0, 95.0), (35.0, 45.0)] {
            assert_eq!(first.near_ns(), f64::INFINITY, "too few readings");
            first.load(&RoundLoad { core_to_core_ns: Some(of_round), ..RoundLoad::default() }).unwrap();
            first.sample(&Sample { core_to_core_ns: Some(of_sample), ..Sample::default() }).unwrap();
        }
        assert_eq!(first.near_ns(), 30.0);
        drop(first);
        let second = Results::resume(folder.path(), &Environment::default()).unwrap();
        assert_eq!(second.near_ns(), 30.0);
    }
}
