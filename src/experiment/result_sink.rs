//! Receives a run's results and messages, stores the results in the folder of results, and passes messages on
//! to the observer.

use super::past::MeasuredOn;
use super::taken::Taken;
use super::{Observer, Results};
use crate::error::Result;
use crate::peak::Peak;
use crate::record::{AnchorSample, LaunchEnd, Record, RoundLoad};
use std::collections::HashMap;

/// Receives the results of a run's measurements, and the messages about the run's progress.
pub trait ResultSink {
    /// Is called with a short description of the current work.
    fn works_on(&mut self, what: &str);
    /// Prints a line at once.
    fn says(&mut self, line: &str);
    /// Is called several times per second while the run waits for a device that another process uses.
    fn waits(&mut self) {}
    /// Stores a complete record.
    fn keep(&mut self, record: Record) -> Result<()>;
    /// Stores a sample of a point; `record` is the point's record so far. If points are distributed over several
    /// devices of the same model, `measured_by` is the UUID or the PCI address of the point's device; otherwise, and if
    /// both are unknown, `measured_by` is `None`.
    fn sample(&mut self, record: &Record, round: u32, measured_by: Option<&str>, taken: &Taken)
    -> Result<()>;
    /// Stores the end of a launch that a stopping rule ended: the rule, and each point's number of samples.
    fn launch_end(&mut self, end: &LaunchEnd) -> Result<()>;
    /// Stores the machine's load while rounds were timed, and the core-to-core latency after these rounds.
    fn load(&mut self, load: &RoundLoad) -> Result<()>;
    /// Stores a time of the anchor.
    fn anchor(&mut self, sample: &AnchorSample) -> Result<()>;
    /// Returns a number for a new launch. The number is unique in the folder.
    fn next_launch(&mut self) -> u32;
    /// Is called when `steps` further steps are finished or will not take place. A step is the measurement of
    /// one point in one launch.
    fn advances(&mut self, steps: usize);
    /// Returns the samples of a point from earlier sessions in the folder, or from earlier attempts.
    fn past(&self, key: &str) -> Vec<Taken>;
    /// Returns the end of a launch of an earlier session or attempt; `None` if no end is stored.
    fn past_end(&self, launch: u32) -> Option<LaunchEnd>;
    /// Returns the device that measured a launch of an earlier session or attempt, if points were distributed
    /// over several devices of the same model. Returns `None` if points were not distributed over devices:
    /// each record then names the device that measured its point. Also returns `None` if the launch measured
    /// only baselines.
    fn measured_on(&self, launch: u32) -> Option<MeasuredOn>;
    /// Returns the core-to-core latency of near processors in nanoseconds; infinity if the latency is unknown.
    /// Processors are near if they run on cores at their usual distance from each other. The latency is computed from
    /// all readings in the folder's journals of rounds and samples, `rounds.jsonl` and `samples.jsonl`.
    fn near_ns(&self) -> f64;
}

/// Stores a run's results as soon as they are known.
pub struct FolderSink<'a> {
    /// The folder of results in which everything is stored.
    pub results: &'a mut Results,
    /// The observer, to which messages about the run's progress are passed on.
    pub observer: &'a mut dyn Observer,
    /// The names of the scenes in messages to the observer, by the hashes of the scenes' contents. Two scenes have
    /// different names in `names`, whereas the records of two scenes may contain the same name.
    pub names: HashMap<String, String>,
    /// Number of points of the experiment that are finished, including those that earlier sessions finished.
    pub done: usize,
}

impl ResultSink for FolderSink<'_> {
    fn works_on(&mut self, what: &str) {
        self.observer.works_on(what);
    }

    fn says(&mut self, line: &str) {
        self.observer.says(line);
    }

    fn waits(&mut self) {
        self.observer.waits();
    }

    fn launch_end(&mut self, end: &LaunchEnd) -> Result<()> {
        self.results.launch_end(end)
    }

    fn load(&mut self, load: &RoundLoad) -> Result<()> {
        self.results.load(load)
    }

    fn anchor(&mut self, sample: &AnchorSample) -> Result<()> {
        self.results.anchor(sample)
    }

    fn next_launch(&mut self) -> u32 {
        self.results.next_launch()
    }

    fn advances(&mut self, steps: usize) {
        self.observer.advances(steps);
    }

    fn past(&self, key: &str) -> Vec<Taken> {
        self.results.past().samples.get(key).cloned().unwrap_or_default()
    }

    fn past_end(&self, launch: u32) -> Option<LaunchEnd> {
        self.results.past().ends.get(&launch).cloned()
    }

    fn measured_on(&self, launch: u32) -> Option<MeasuredOn> {
        self.results.past().devices.get(&launch).cloned()
    }

    fn near_ns(&self) -> f64 {
        self.results.near_ns()
    }

    /// Adds to the record: the date, the machine's name (if the experiment is divided into shards), the device's peak
    /// rate, and the fraction of the peak rate that the point reached (if the rates are known). Then writes the record
    /// to disk, and informs the observer. The observer is not told about a control point that is measured only for
    /// comparison.
    fn keep(&mut self, mut record: Record) -> Result<()> {
        Peak::apply(self.results.peak(), &mut record);
        record.timestamp = Some(jiff::Timestamp::now().to_string());
        record.host = self.results.host().map(str::to_owned);
        if record.is_control {
            return self.results.control(&record);
        }
        self.results.record(&record)?;
        if let Some(name) = record.scene_hash.as_ref().and_then(|hash| self.names.get(hash)) {
            record.scene.clone_from(name);
        }
        self.observer.finished(&record);
        self.done += 1;
        Ok(())
    }

    fn sample(
        &mut self,
        record: &Record,
        round: u32,
        measured_by: Option<&str>,
        taken: &Taken,
    ) -> Result<()> {
        self.results.sample(&taken.to_sample(record, round, measured_by))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::asleep;
    use super::*;
    use crate::device::DeviceInfo;
    use crate::launch::FrameTimes;
    use crate::measure::StopReason;
    use crate::peak::Figure;
    use crate::record::{Environment, read_lines};
    use crate::sensor::SensorReading;
    use std::path::Path;

    /// Counts finished points and steps.
    #[derive(Default)]
    struct Counting {
        finished: Vec<String>,
        scenes: Vec<String>,
        steps: usize,
    }

    impl Observer for Counting {
        fn begins(&mut self, _points: usize, _steps: usize) {}
        fn advances(&mut self, steps: usize) {
            self.steps += steps;
        }
        fn works_on(&mut self, _what: &str) {}
        fn finished(&mut self, record: &Record) {
            self.finished.push(record.key.clone());
            self.scenes.push(record.scene.clone());
        }
        fn ends(&mut self) {}
    }

    fn records(folder: &Path, name: &str) -> Vec<Record> {
        read_lines(&folder.join(name)).unwrap().lines
    }

    #[test]
    fn a_later_session_reads_each_sample_as_it_was_taken() {
        let folder = tempfile::tempdir().unwrap();
        let times = FrameTimes {
            frame_ms: 1.0,
            primary_ms: Some(2.0),
            shadow_ms: Some(3.0),
            shade_ms: Some(4.0),
            host_ms: 5.0,
            processor_ms: Some(6.0),
            batch: Some(7),
            sensed: Some(SensorReading { clock_mhz: Some(8.0), throttled: true, ..SensorReading::default() }),
        };
        let taken = Taken { launch: 9, at_ms: 10.5, core_to_core_ns: Some(14.0), times };
        let times = FrameTimes::whole(12.0, 13.0);
        let plain = Taken { launch: 3, at_ms: 11.5, core_to_core_ns: None, times };
        let mut results = Results::create(folder.path(), &Environment::default()).unwrap();
        let mut sink =
            FolderSink { results: &mut results, observer: &mut (), names: HashMap::new(), done: 0 };
        let record = Record { key: "a".into(), ..Record::default() };
        let of_second = Record { measured_on: Some("the second".into()), ..record.clone() };
        sink.sample(&of_second, 1, Some("a UUID"), &taken).unwrap();
        sink.sample(&record, 2, None, &plain).unwrap();
        let samples = [("a".to_owned(), 1)].into();
        let end = LaunchEnd { launch: 12, stop_reason: StopReason::TimeLimit, samples };
        sink.launch_end(&end).unwrap();
        for ns in 20..30 {
            for (launch, core_to_core_ns) in [(3, Some(f64::from(ns))), (9, None)] {
                sink.load(&RoundLoad { launch, core_to_core_ns, ..RoundLoad::default() }).unwrap();
            }
        }
        assert_eq!(sink.near_ns(), 21.0);
        drop(results);
        let mut results = Results::resume(folder.path(), &Environment::default()).unwrap();
        let mut sink =
            FolderSink { results: &mut results, observer: &mut (), names: HashMap::new(), done: 0 };
        assert_eq!(sink.near_ns(), 21.0);
        assert_eq!((sink.past("a"), sink.past("b")), (vec![taken, plain], Vec::new()));
        let second = MeasuredOn { slug: "the second".into(), hardware: Some("a UUID".into()) };
        assert_eq!((sink.measured_on(9), sink.measured_on(3)), (Some(second), None));
        assert_eq!((sink.past_end(12), sink.past_end(9)), (Some(end), None));
        assert_eq!([sink.next_launch(), sink.next_launch()], [13, 14]);
    }

    /// The device has one thread. The rates were measured with one thread or with two.
    #[test]
    fn a_record_states_no_share_of_the_rates_of_its_device_in_another_state() {
        let with = |threads| DeviceInfo { threads: Some(threads), ..asleep::device(1.0) };
        let share = |threads| {
            let DeviceInfo { label, platform, driver, .. } = with(threads);
            let (fma_per_s, state) = (Figure::of(&[3e12]), Some(with(threads).state()));
            let peak = Peak { device: label.clone(), platform, driver, state, fma_per_s, ..Peak::default() };
            let folder = tempfile::tempdir().unwrap();
            let mut results = Results::create(folder.path(), &Environment::default()).unwrap();
            let left_out = results.keep_peak(vec![peak], &[&with(1)]).unwrap();
            let mut sink =
                FolderSink { results: &mut results, observer: &mut (), names: HashMap::new(), done: 0 };
            sink.keep(Record {
                device: label,
                tests_per_s: Some(1e9),
                operations_per_test: Some(3),
                threads: Some(1),
                ..Record::default()
            })
            .unwrap();
            (left_out.len(), records(folder.path(), "records.jsonl")[0].limit_fraction)
        };
        assert_eq!([1, 2].map(share), [(0, Some(1e9 * 3.0 / 3e12)), (1, None)]);
    }

    #[test]
    fn a_record_is_stored_with_its_host_its_date_and_its_share_of_the_peak() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("attempt");
        let peak = Peak { device: "gpu".into(), ..crate::peak::fixtures::rates() };
        let mut results =
            Results::of_attempt(&folder, &Environment::default(), "node7", &[], false, false).unwrap();
        results.keep_peak(vec![peak.clone()], &[]).unwrap();
        let mut counting = Counting::default();
        let names = HashMap::from([("content".to_owned(), "a/tri".to_owned())]);
        let mut sink = FolderSink { results: &mut results, observer: &mut counting, names, done: 4 };
        let record = |key: &str| Record {
            key: key.into(),
            device: "gpu".into(),
            scene: "tri".into(),
            scene_hash: Some("content".into()),
            ..Record::default()
        };
        sink.keep(record("a")).unwrap();
        sink.keep(Record { is_control: true, ..record("control") }).unwrap();
        sink.advances(3);
        assert_eq!(sink.done, 5, "a control point is no point of its own");
        assert_eq!((counting.finished, counting.steps), (vec!["a".to_owned()], 3));
        assert_eq!(counting.scenes, ["a/tri"]);
        drop(results);
        let [stored, controls] = ["records.jsonl", "controls.jsonl"].map(|name| records(&folder, name));
        assert_eq!((stored.len(), controls.len(), controls[0].key.as_str()), (1, 1, "control"));
        assert_eq!((stored[0].host.as_deref(), stored[0].fma_per_s), (Some("node7"), Some(3e12)));
        let timestamp = stored[0].timestamp.as_deref().unwrap();
        assert!(timestamp.parse::<jiff::Timestamp>().is_ok(), "{timestamp}");
        // A later session reads the device's peak rate from the folder, and does not measure it again.
        let results = Results::resume(&folder, &Environment::default()).unwrap();
        assert_eq!(results.peak(), [peak]);
    }
}
