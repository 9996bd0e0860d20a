//! Measures the peak rates of a device: multiply-adds, copies, `__local` reads, launches, latencies. The kernels are in
//! `cl/peak/`. The speed at which a strategy casts rays can then be stated as a share of a peak rate.

mod measure;
mod operations;
mod rig;
mod traffic;

pub use measure::measure;
pub use operations::operations_per_test;
pub use traffic::Traffic;

use crate::device::DeviceInfo;
use crate::error::{Error, Result, shortened};
use crate::existing;
use crate::measure::Summary;
use crate::reader::{self, Kind};
use crate::record::{Record, write_json};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::path::Path;

/// The name of the file with the devices' peak rates in a folder of results.
pub const FILE: &str = "peak.json";
/// The rates per second that a device can have. The rates of real devices and simulators are far from both
/// ends of the range `POSSIBLE_PER_S`.
const POSSIBLE_PER_S: RangeInclusive<f64> = 1.0..=1e18;
/// The help in error messages about a file from which raycl cannot read peak rates.
const WRITTEN_BY: &str = "`raycl peak --out FILE` writes a file of peak rates";
/// The help in the error message about a folder of results whose peak rates cannot be read.
const MEASURED_AGAIN: &str = "delete the file; then measure the rates again, with `raycl run CONFIG --peak --resume` \
    or, if `raycl reproduce` wrote the folder, with `raycl reproduce --resume`";
/// The name of the file with the peak rates in folders that older versions of raycl wrote.
const OLD_FILE: &str = "limits.json";

/// A measured rate or time: the median and the quartiles of its repeats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// The median of the repeats.
    pub median: f64,
    /// The first quartile of the repeats.
    pub q1: f64,
    /// The third quartile of the repeats.
    pub q3: f64,
    /// Number of repeats of the measurement.
    pub repeats: usize,
}

/// The measured peak rates of a device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// The device's name in records.
    pub device: String,
    /// The name of the device's platform.
    pub platform: String,
    /// The version of the device's driver.
    pub driver: String,
    /// The device's state when the rates were measured ([`DeviceInfo::state`]); `None` if an earlier version of raycl,
    /// which did not store the state, measured them.
    #[serde(default)]
    pub state: Option<String>,
    /// Date and time of the measurement, RFC 3339.
    pub timestamp: String,
    /// raycl's version.
    pub raycl_version: String,
    /// The highest clock that the driver reports, used to convert latencies to cycles; `None` if the driver
    /// reports no clock.
    pub max_clock_mhz: Option<u64>,
    /// Single-precision fused multiply-adds per second with all units busy.
    pub fma_per_s: Figure,
    /// Bytes read plus bytes written per second by a copy in global memory.
    pub copy_bytes_per_s: Figure,
    /// Bytes of `__local` memory read per second by all units together.
    pub local_bytes_per_s: Figure,
    /// Device time of a kernel that stores only one number, in microseconds.
    pub launch_device_us: Figure,
    /// Host time of a kernel that stores only one number, from enqueueing to its end, in microseconds.
    pub launch_host_us: Figure,
    /// Host time per kernel if many kernels that store only one number are enqueued one after another, in microseconds.
    pub launch_batched_us: Figure,
    /// Latency of a multiply-add on private values, in nanoseconds.
    pub private_ns: Figure,
    /// Latency of a read of a private array that is not in registers, in nanoseconds.
    pub private_array_ns: Figure,
    /// Latency of a read of `__local` memory, in nanoseconds.
    pub local_ns: Figure,
    /// Latency of a read of global memory that no cache holds, in nanoseconds.
    pub global_ns: Figure,
}

impl Figure {
    /// Summarises repeats. If the measurement has no repeats, the median and the quartiles are zero.
    pub fn of(values: &[f64]) -> Self {
        let summary = Summary::of(values).map(|summary| Self {
            median: summary.median,
            q1: summary.q1,
            q3: summary.q3,
            repeats: values.len(),
        });
        summary.unwrap_or_default()
    }
}

impl Peak {
    /// Converts a latency to cycles of the device's highest clock; `None` if the driver reports no clock.
    pub fn cycles(&self, latency_ns: &Figure) -> Option<f64> {
        self.max_clock_mhz.map(|mhz| latency_ns.median * mhz as f64 * 1e-3)
    }

    /// Reads a file with the rates of one device, or with a list of the rates of several devices.
    pub fn read(path: &Path) -> Result<Vec<Self>> {
        let text = reader::text(path, Kind::Peaks)
            .map_err(|error| Error::unreadable("peak rates", path, &error, WRITTEN_BY))?;
        // An untagged enum of the library serde would accept both forms (one device or a list) too, but the
        // error of such an enum would state neither the mistake nor its line.
        let read = match text.trim_start().starts_with('[') {
            true => serde_json::from_str(&text),
            false => serde_json::from_str(&text).map(|one| vec![one]),
        };
        let all: Vec<Self> = read.map_err(|error| {
            let message = format!("{} does not contain peak rates: {error}", path.display());
            Error::input(shortened(message)).with_help(WRITTEN_BY)
        })?;
        all.iter().try_for_each(|peak| peak.check(path))?;
        Ok(all)
    }

    /// Returns an error if no device can have the rates in `self`, which were read from the file `path`.
    fn check(&self, path: &Path) -> Result<()> {
        let rates = [
            ("fma_per_s", self.fma_per_s),
            ("copy_bytes_per_s", self.copy_bytes_per_s),
            ("local_bytes_per_s", self.local_bytes_per_s),
        ];
        let wrong = rates.into_iter().find(|(_, rate)| !POSSIBLE_PER_S.contains(&rate.median));
        wrong.map_or(Ok(()), |(field, Figure { median, .. })| {
            let message = format!(
                "{}: `{field}.median` of the device '{}' is {median:?}, expected a number from {} to {:e}",
                path.display(),
                self.device,
                POSSIBLE_PER_S.start(),
                POSSIBLE_PER_S.end()
            );
            Err(Error::input(shortened(message)).with_help(WRITTEN_BY))
        })
    }

    /// Reads the peak rates that are stored in a folder of results. Returns an empty list if the folder has
    /// no file of peak rates.
    pub fn stored_in(folder: &Path) -> Result<Vec<Self>> {
        for path in [FILE, OLD_FILE].map(|name| folder.join(name)) {
            if existing::exists(&path)? {
                return Self::read(&path).map_err(|error| error.with_help(MEASURED_AGAIN));
            }
        }
        Ok(Vec::new())
    }

    /// Writes a file with a list of the rates of several devices.
    pub fn write(all: &[Self], path: &Path) -> Result<()> {
        write_json(path, all)
    }

    /// Returns true if these peak rates may have been measured on `device`. The name of a device in records
    /// depends on the machine's other devices, so `self.device` may be any of the names that records can use
    /// for `device`.
    pub fn may_be_of(&self, device: &DeviceInfo) -> bool {
        [&device.label, &device.name, &device.slug()].contains(&&self.device)
    }

    /// Returns true if the rates may have been measured on one of `devices`, but with another driver or in another
    /// state. Peak rates for which the device's state was not stored count as rates of every state.
    pub fn are_outdated(&self, devices: &[&DeviceInfo]) -> bool {
        let fits = |device: &&DeviceInfo| {
            (&self.platform, &self.driver) == (&device.platform, &device.driver)
                && self.state.as_ref().is_none_or(|state| *state == device.state())
        };
        let own: Vec<&DeviceInfo> = devices.iter().copied().filter(|device| self.may_be_of(device)).collect();
        !own.is_empty() && !own.iter().any(fits)
    }

    /// Returns true if these rates and `earlier` were measured on the same device with the same driver and in
    /// the same state. Earlier rates for which the device's state was not stored count as rates of every
    /// state.
    pub fn is_of_state_of(&self, earlier: &Self) -> bool {
        (&self.device, &self.platform, &self.driver) == (&earlier.device, &earlier.platform, &earlier.driver)
            && (earlier.state.is_none() || earlier.state == self.state)
    }

    /// Adds the rates `more` to `all`, except the rates of devices that already have rates in `all`.
    pub fn add_new(all: &mut Vec<Self>, more: Vec<Self>) {
        for peak in more {
            if all.iter().all(|known| known.device != peak.device) {
                all.push(peak);
            }
        }
    }

    /// Computes how many operations per second a record's ray-triangle tests execute, as a share of the device's peak
    /// rate of multiply-adds. Adds this share of the peak rate, and the peak rate itself, to the record. Leaves the
    /// record unchanged if `all` has no rates of the record's device; adds no share if the record lacks the rate of
    /// tests or the operations per test.
    pub fn apply(all: &[Self], record: &mut Record) {
        let Some(peak) = all.iter().find(|one| one.device == record.device) else { return };
        record.fma_per_s = Some(peak.fma_per_s.median).filter(|rate| *rate > 0.0);
        if let (Some(tests), Some(operations), Some(fma)) =
            (record.tests_per_s, record.operations_per_test, record.fma_per_s)
        {
            record.limit_fraction = Some(tests * f64::from(operations) / fma);
        }
    }
}

/// Adds to the draft of a record how many operations the strategy's ray-triangle test takes, and how many
/// bytes the test reads. The numbers of operations and bytes depend on the headers of the strategy's kernel
/// files. The numbers of operations and bytes are stored in the record, since a process that reads the record
/// later may have read other kernel files.
pub fn describe_test(record: &mut Record) {
    record.operations_per_test = operations_per_test(&record.strategy);
    if let Some(traffic) = Traffic::by_headers(record) {
        record.triangle_bytes_per_test = Some(traffic.triangle_bytes);
        record.triangle_memory = Some(traffic.triangle_in.to_owned());
        record.ray_bytes_per_test = Some(traffic.ray_bytes);
        record.ray_memory = Some(traffic.ray_in.to_owned());
    }
}

#[cfg(test)]
pub(crate) mod fixtures {
    use super::{Figure, Peak};

    /// Returns, for tests, peak rates that a real device could have.
    pub fn rates() -> Peak {
        let rate = Figure::of(&[3.0e12, 2.0e12, 4.0e12]);
        Peak { fma_per_s: rate, copy_bytes_per_s: rate, local_bytes_per_s: rate, ..Peak::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peak(device: &str) -> Peak {
        Peak { device: device.into(), max_clock_mhz: Some(2000), ..fixtures::rates() }
    }

    #[test]
    fn a_record_learns_its_part_of_the_peak() {
        let strategy = "traversal=exhaustive intersector=common-origin vectors=private".to_owned();
        let mut record = Record { device: "gpu".into(), strategy, ..Record::default() };
        record.tests_per_s = Some(1.0e11);
        // The number of operations is taken from the record, since this process may have read the headers of
        // another folder of kernels.
        record.operations_per_test = Some(7);
        Peak::apply(&[peak("cpu"), peak("gpu")], &mut record);
        assert_eq!((record.operations_per_test, record.fma_per_s), (Some(7), Some(3.0e12)));
        assert_eq!(record.limit_fraction, Some(1.0e11 * 7.0 / 3.0e12));
        let mut other = Record { device: "other".into(), ..record.clone() };
        other.limit_fraction = None;
        Peak::apply(&[peak("cpu"), peak("gpu")], &mut other);
        assert_eq!(other.limit_fraction, None);
    }

    #[test]
    fn rates_of_another_driver_or_another_state_are_outdated() {
        let device = DeviceInfo { threads: Some(1), ..crate::experiment::asleep::device(1.0) };
        let of = |threads| DeviceInfo { threads: Some(threads), ..device.clone() }.state();
        let rates = |driver: &str, state: Option<String>| Peak {
            device: device.slug(),
            platform: device.platform.clone(),
            driver: driver.into(),
            state,
            ..Peak::default()
        };
        for (driver, state, are_outdated) in [
            (device.driver.as_str(), Some(of(1)), false),
            (device.driver.as_str(), None, false),
            (device.driver.as_str(), Some(of(2)), true),
            ("another", Some(of(1)), true),
            ("another", None, true),
        ] {
            let rates = rates(driver, state);
            assert_eq!(rates.are_outdated(&[&device]), are_outdated, "{rates:?}");
        }
        let of_another = Peak { device: "another".into(), ..rates("another", None) };
        assert!(!of_another.are_outdated(&[&device]), "the run has no device of this name");
        // The second of two devices of the same name has one more thread.
        let twin = DeviceInfo { threads: Some(2), ..device.clone() };
        assert!(!rates(&device.driver, Some(of(2))).are_outdated(&[&device, &twin]));
    }

    #[test]
    fn a_draft_states_the_operations_and_the_bytes_of_its_test() {
        let described = |name: &str| {
            let strategy = crate::strategy::preset(name).unwrap().strategy.to_string();
            let mut record = Record { strategy, ..Record::default() };
            describe_test(&mut record);
            record
        };
        let naive = described("naive");
        assert_eq!(naive.operations_per_test, Some(15));
        let memories = [&naive.triangle_memory, &naive.ray_memory].map(Option::as_deref);
        assert_eq!(memories, [Some("global"); 2]);
        assert_eq!((naive.triangle_bytes_per_test, naive.ray_bytes_per_test), (Some(36.0), Some(24.0)));
        assert_eq!(Traffic::of(&naive), Traffic::by_headers(&naive));
        let moved = Record { triangle_bytes_per_test: Some(5.0), ..naive };
        assert_eq!(Traffic::of(&moved).map(|traffic| traffic.bytes()), Some(29.0));
        let local = described("local-vectors");
        let memories = [&local.triangle_memory, &local.ray_memory].map(Option::as_deref);
        assert_eq!(memories, [Some("global"), Some("__local")]);
        assert_eq!(Traffic::of(&local), Traffic::by_headers(&local));
        let bvh = described("bvh");
        assert!(bvh.operations_per_test.is_some() && bvh.triangle_bytes_per_test.is_none());
    }

    #[cfg(unix)]
    #[test]
    fn rates_that_cannot_be_found_do_not_count_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Peak::stored_in(folder.path()).unwrap(), []);
        let path = folder.path().join(FILE);
        std::os::unix::fs::symlink(&path, &path).unwrap();
        assert!(Peak::stored_in(folder.path()).is_err(), "the link leads to itself");
    }

    #[test]
    fn a_file_of_one_or_several_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        Peak::write(&[peak("a"), peak("b")], &path).unwrap();
        assert_eq!(Peak::read(&path).unwrap(), [peak("a"), peak("b")]);
        let mut earlier = serde_json::to_value(peak("a")).unwrap();
        earlier.as_object_mut().unwrap().remove("state");
        std::fs::write(&path, earlier.to_string()).unwrap();
        assert_eq!(Peak::read(&path).unwrap(), [peak("a")], "earlier versions did not store the state");
        for wrong in ["", "{}", "[1]", "{\"device\": 3}"] {
            std::fs::write(&path, wrong).unwrap();
            assert_eq!(Peak::read(&path).unwrap_err().exit_code(), 2, "{wrong}");
        }
    }

    #[test]
    fn a_file_that_cannot_be_read_is_reported_with_its_line_and_a_folders_own_file_with_its_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        for (wrong, message) in [
            ("no rates", "expected ident at line 1 "),
            ("[\n  {\"device\": 3}\n]", "invalid type: integer `3`, expected a string at line 2 "),
            ("{\n\"device\": \"a\"\n}", "missing field `platform` at line 3 "),
        ] {
            std::fs::write(&path, wrong).unwrap();
            let [given, stored] = [Peak::read(&path), Peak::stored_in(folder.path())].map(Result::unwrap_err);
            let expected = format!("{} does not contain peak rates: {message}", path.display());
            assert!(given.to_string().starts_with(&expected), "{given}");
            assert_eq!(given.to_string(), stored.to_string());
            assert_eq!((given.remedy(), stored.remedy()), (WRITTEN_BY, MEASURED_AGAIN));
        }
    }

    #[test]
    fn rates_that_no_device_can_have_are_refused_with_their_field() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILE);
        let (right, fields) = (peak("a gpu"), ["fma_per_s", "copy_bytes_per_s", "local_bytes_per_s"]);
        for (median, said) in [(0.0, "0.0"), (-1e9, "-1000000000.0"), (1e300, "1e300"), (1e-300, "1e-300")] {
            for field in fields {
                let mut wrong = serde_json::to_value(&right).unwrap();
                wrong[field]["median"] = median.into();
                std::fs::write(&path, wrong.to_string()).unwrap();
                let error = Peak::read(&path).unwrap_err();
                let expected = format!(
                    "{}: `{field}.median` of the device 'a gpu' is {said}, expected a number from 1 to 1e18",
                    path.display()
                );
                assert_eq!((error.to_string(), error.exit_code()), (expected, 2));
            }
        }
    }

    #[test]
    fn a_folder_of_an_older_raycl_is_read() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Peak::stored_in(folder.path()).unwrap(), []);
        Peak::write(&[peak("old")], &folder.path().join("limits.json")).unwrap();
        assert_eq!(Peak::stored_in(folder.path()).unwrap(), [peak("old")]);
        Peak::write(&[peak("new")], &folder.path().join("peak.json")).unwrap();
        assert_eq!(Peak::stored_in(folder.path()).unwrap(), [peak("new")]);
    }

    #[test]
    fn cycles_follow_from_the_clock() {
        assert_eq!(peak("a").cycles(&Figure::of(&[250.0])), Some(500.0));
        let unknown = Peak { max_clock_mhz: None, ..peak("a") };
        assert_eq!(unknown.cycles(&Figure::of(&[250.0])), None);
    }

    #[test]
    fn a_device_whose_peak_was_not_measured_has_no_share_of_it() {
        let strategy = "traversal=exhaustive intersector=common-origin".to_owned();
        let mut record =
            Record { device: "gpu".into(), strategy, tests_per_s: Some(1e11), ..Record::default() };
        Peak::apply(&[Peak { fma_per_s: Figure::default(), ..peak("gpu") }], &mut record);
        assert_eq!((record.fma_per_s, record.limit_fraction), (None, None));
        let figure = Figure::of(&[1.0, 2.0, 3.0, 4.0, 9.0]);
        assert_eq!(figure, Figure { median: 3.0, q1: 2.0, q3: 4.0, repeats: 5 });
        assert_eq!(Figure::of(&[]), Figure::default());
    }
}
