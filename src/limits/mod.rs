//! What a device can do at most: multiply-adds, copies, `__local` reads, launches, latencies. Measured with the
//! kernels of `cl/limits/`, so that a caster's speed can be told as a part of what is possible.

mod measure;
mod operations;
mod rig;

pub use measure::measure;
pub use operations::operations_per_test;

use crate::error::{Error, Result};
use crate::measure::Summary;
use crate::record::{Record, write_whole};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The file of a results' folder that holds its devices' limits.
pub const FILE: &str = "limits.json";

/// A measured figure: the median of its repeats, and their quartiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// The median.
    pub median: f64,
    /// The first quartile.
    pub q1: f64,
    /// The third quartile.
    pub q3: f64,
    /// How many repeats.
    pub repeats: usize,
}

/// The measured limits of one device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// What records call the device.
    pub device: String,
    /// Its platform's name.
    pub platform: String,
    /// Its driver's version.
    pub driver: String,
    /// When they were measured, RFC 3339.
    pub timestamp: String,
    /// raycl's version.
    pub raycl_version: String,
    /// The highest clock, as the driver says: what cycles are counted in.
    pub max_clock_mhz: Option<u64>,
    /// Fused multiply-adds a second, single precision, all units busy.
    pub fma_per_s: Figure,
    /// Bytes read and bytes written a second, added up, by a copy in global memory.
    pub copy_bytes_per_s: Figure,
    /// Bytes of `__local` memory read a second, all units together.
    pub local_bytes_per_s: Figure,
    /// Device time of a kernel that does nothing, in microseconds.
    pub launch_device_us: Figure,
    /// The host's clock from enqueueing it to its end.
    pub launch_host_us: Figure,
    /// The host's clock a launch, of many enqueued one after another.
    pub launch_batched_us: Figure,
    /// Latency of a multiply-add on private values, in nanoseconds.
    pub private_ns: Figure,
    /// Latency of a read of a private array that is not in registers.
    pub private_array_ns: Figure,
    /// Latency of a read of `__local` memory.
    pub local_ns: Figure,
    /// Latency of a read of global memory that no cache holds.
    pub global_ns: Figure,
}

impl Figure {
    /// Of repeats; zero where there are none.
    pub fn of(values: &[f64]) -> Self {
        let found = Summary::of(values).map(|summary| Self {
            median: summary.median_ms,
            q1: summary.q1_ms,
            q3: summary.q3_ms,
            repeats: values.len(),
        });
        found.unwrap_or_default()
    }
}

impl Limits {
    /// Cycles of a latency at the device's highest clock; none where it is not known.
    pub fn cycles(&self, latency_ns: &Figure) -> Option<f64> {
        self.max_clock_mhz.map(|mhz| latency_ns.median * mhz as f64 * 1e-3)
    }

    /// Reads one device's limits, or a list of several's.
    pub fn read(path: &Path) -> Result<Vec<Self>> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| Error::input(format!("cannot read {}: {error}", path.display())))?;
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum File {
            Several(Vec<Limits>),
            One(Box<Limits>),
        }
        match serde_json::from_str(&text) {
            Ok(File::Several(several)) => Ok(several),
            Ok(File::One(one)) => Ok(vec![*one]),
            Err(_) => {
                let error = Error::input(format!("{} holds no device's limits", path.display()));
                Err(error.with_help("`raycl limits --out FILE` writes such a file"))
            }
        }
    }

    /// Writes a list.
    pub fn write(all: &[Self], path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(all).map_err(|error| Error::run(error.to_string()))?;
        write_whole(path, format!("{text}\n").as_bytes())
    }

    /// Writes into a record what part of its device's arithmetic limit its tests reach.
    pub fn apply(all: &[Self], record: &mut Record) {
        let Some(limits) = all.iter().find(|one| one.device == record.device) else { return };
        record.fma_per_s = Some(limits.fma_per_s.median).filter(|rate| *rate > 0.0);
        record.operations_per_test = operations_per_test(&record.strategy);
        if let (Some(tests), Some(operations), Some(fma)) =
            (record.tests_per_s, record.operations_per_test, record.fma_per_s)
        {
            record.limit_fraction = Some(tests * f64::from(operations) / fma);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(device: &str) -> Limits {
        let fma_per_s = Figure::of(&[3.0e12, 2.0e12, 4.0e12]);
        Limits { device: device.into(), fma_per_s, max_clock_mhz: Some(2000), ..Limits::default() }
    }

    #[test]
    fn a_record_learns_its_part_of_the_limit() {
        let strategy = "traversal=exhaustive intersector=common-origin vectors=private".to_owned();
        let mut record = Record { device: "gpu".into(), strategy, ..Record::default() };
        record.tests_per_s = Some(1.0e11);
        Limits::apply(&[limits("cpu"), limits("gpu")], &mut record);
        let operations = record.operations_per_test.expect("a count");
        assert_eq!(record.fma_per_s, Some(3.0e12));
        assert_eq!(record.limit_fraction, Some(1.0e11 * f64::from(operations) / 3.0e12));
        let mut other = Record { device: "other".into(), ..record.clone() };
        other.limit_fraction = None;
        Limits::apply(&[limits("cpu"), limits("gpu")], &mut other);
        assert_eq!(other.limit_fraction, None);
    }

    #[test]
    fn a_file_of_one_or_several_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("limits.json");
        Limits::write(&[limits("a"), limits("b")], &path).unwrap();
        assert_eq!(Limits::read(&path).unwrap(), [limits("a"), limits("b")]);
        std::fs::write(&path, serde_json::to_string(&limits("a")).unwrap()).unwrap();
        assert_eq!(Limits::read(&path).unwrap(), [limits("a")]);
        for wrong in ["", "{}", "[1]", "{\"device\": 3}"] {
            std::fs::write(&path, wrong).unwrap();
            assert_eq!(Limits::read(&path).unwrap_err().exit_code(), 2, "{wrong}");
        }
    }

    #[test]
    fn cycles_follow_from_the_clock() {
        assert_eq!(limits("a").cycles(&Figure::of(&[250.0])), Some(500.0));
        let unknown = Limits { max_clock_mhz: None, ..limits("a") };
        assert_eq!(unknown.cycles(&Figure::of(&[250.0])), None);
    }
}
