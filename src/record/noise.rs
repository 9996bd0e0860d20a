//! Computes the smallest differences between points that the records of a run can show, and lists causes of
//! noise.

use super::point_times::median;
use super::ranking::{resolution, resolution_within};
use super::ratios::are_together;
use super::rounds::{core_to_core_ns, mean_load};
use super::summary::{first_line, not_enough};
use super::types::{HOST, Record};
use super::{Folder, interval};
use crate::measure::median_of;
use crate::words::counted_of_were;
use serde::Serialize;
use std::collections::HashSet;

/// The smallest differences between the times of points that a run on one device can show, as fractions: 0.03 is 3%.
/// A difference is `None` if no two of the device's points have enough samples of the same rounds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Noise {
    /// The device's name.
    pub device: String,
    /// The largest number of launches in which one of the device's points was measured.
    pub launches: usize,
    /// Number of samples of all points together.
    pub samples: usize,
    /// The smallest difference between two points that a single launch can show, computed in the same way as
    /// `between_launches`. The value is the median over the launches in which at least two points have enough
    /// samples.
    pub within_launch: Option<f64>,
    /// The smallest difference between two points that all launches together can show (the largest value of
    /// all groups of points).
    pub between_launches: Option<f64>,
    /// How far the upper end of a point's 95% interval lies above the point's median time, as a fraction of
    /// the median time. The value of the field is the median over all points.
    pub own_time: Option<f64>,
    /// A text that says how many points have no time, too few samples or times of 0, with the reason for the first
    /// of these points. If there are no such points, but no two points were measured together, a text that says so.
    /// Otherwise `None`.
    pub not_compared: Option<String>,
    /// Readings that may explain the noise, such as the load by other processes.
    pub causes: Causes,
}

/// Readings that may explain noise in the times. A value is `None` if it is unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Causes {
    /// Number of processors of the machine.
    pub processors: Option<f64>,
    /// Mean number of processors that other processes kept busy.
    pub others: Option<f64>,
    /// Mean number of processors that other virtual machines on the same hardware took from this machine.
    pub stolen: Option<f64>,
    /// 10th and 90th percentile of the time in which a cache line moves from one processor to
    /// another, ns.
    pub core_to_core_ns: Option<[f64; 2]>,
    /// The frequency governor of the first processor, such as "performance" or "powersave".
    pub governor: Option<String>,
    /// Lowest and highest frequency of any processor at the beginning of the run, MHz.
    pub clocks_mhz: Option<[f64; 2]>,
    /// The mean clock frequency of the device while points were timed, MHz.
    pub device_clock_mhz: Option<f64>,
    /// Number of samples that were left out because other programs probably used the processors at the same time.
    pub preempted_samples: Option<u32>,
    /// Number of samples that were measured while the device throttled its clock.
    pub throttled_samples: Option<u32>,
    /// Number of threads with which the device executed kernels.
    pub threads: Option<u32>,
}

impl Noise {
    /// Returns one `Noise` per device of the folder's records, except the host.
    pub fn of(folder: &Folder) -> Vec<Self> {
        let mut devices: Vec<&str> = folder.records.iter().map(|record| record.device.as_str()).collect();
        let mut seen = HashSet::from([HOST]);
        devices.retain(|device| seen.insert(*device));
        devices.into_iter().map(|device| Self::of_device(folder, device)).collect()
    }

    fn of_device(folder: &Folder, device: &str) -> Self {
        let own = |record: &&Record| record.device == device;
        let records: Vec<Record> = folder.records.iter().filter(own).cloned().collect();
        let half = |record: &Record| Some((interval(record)?[1] / record.median_ms?).ln().exp_m1());
        let halves: Vec<f64> = records.iter().filter_map(half).collect();
        Self {
            device: device.to_owned(),
            launches: records.iter().map(super::launches).max().unwrap_or(0),
            samples: records.iter().map(|record| record.samples_ms.len()).sum(),
            within_launch: resolution_within(&folder.records, device),
            between_launches: resolution(compared(&records)).map(|[_, most]| most),
            own_time: median_of(&halves),
            not_compared: not_compared(&records),
            causes: Causes::of(folder, &records),
        }
    }
}

/// Returns the records that were measured in the same rounds as at least one other record in `records`.
fn compared(records: &[Record]) -> impl Iterator<Item = &Record> {
    let is_beside = |one: &Record, other: &Record| !std::ptr::eq(one, other) && are_together(one, other);
    records.iter().filter(move |one| records.iter().any(|other| is_beside(one, other)))
}

/// Returns a text that says how many points were not compared with other points because they have no time, too
/// few samples or times of 0. The text also states the reason for the first of these points. If all points have
/// enough samples, but no two of them were measured in the same rounds (for example, because there is only one
/// point), the text says so. Returns `None` if all points have enough samples, and at least two of them were
/// measured in the same rounds.
fn not_compared(records: &[Record]) -> Option<String> {
    let why = |record: &Record| match median(record) {
        Some(_) => not_enough(record),
        None => Some(format!("{}: {}", record.outcome.name(), first_line(record))),
    };
    let lacking: Vec<_> = records.iter().filter_map(|record| Some((record, why(record)?))).collect();
    let Some((record, why)) = lacking.first() else {
        let why = match records.len() {
            1 => "only one point was measured, and a difference needs two points",
            _ => "no two points were measured in the same rounds, so no difference between points is known",
        };
        let is_compared = compared(records).next().is_some();
        return (!is_compared).then(|| why.to_owned());
    };
    let were = counted_of_were(lacking.len(), records.len(), "point");
    let size = record.at_local_size();
    let first = if lacking.len() == 1 { ": " } else { ". The first is " };
    Some(format!("{were} not compared{first}{}{size} ({why})", record.name))
}

impl Causes {
    fn of(folder: &Folder, records: &[Record]) -> Self {
        let load = mean_load(&folder.rounds);
        let clocks = &folder.environment["host"]["clocks"];
        let range = |at: usize| clocks["now_mhz"][at].as_f64();
        let total = |of: fn(&Record) -> Option<u32>| records.iter().filter_map(of).reduce(|a, b| a + b);
        let sensed: Vec<f64> =
            records.iter().filter_map(|record| record.sensed.as_ref()?.clock_mhz).collect();
        Self {
            processors: load.map(|load| load.processors),
            others: load.map(|load| load.others),
            stolen: load.map(|load| load.stolen),
            core_to_core_ns: core_to_core_ns(&folder.rounds),
            governor: clocks["governor"].as_str().map(str::to_owned),
            clocks_mhz: range(0).zip(range(1)).map(|(least, most)| [least, most]),
            device_clock_mhz: (!sensed.is_empty()).then(|| sensed.iter().sum::<f64>() / sensed.len() as f64),
            preempted_samples: total(|record| record.preempted_samples),
            throttled_samples: total(|record| record.throttled_samples),
            threads: records.iter().find_map(|record| record.threads),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{judged, measured, sampled};
    use super::*;

    #[test]
    fn each_device_has_its_noise_and_the_host_none() {
        let mut wobbly = measured("gpu", "naive", 8, 10.0);
        wobbly.samples_ms = (0..10).map(|n| 10.0 * (1.0 + 0.01 * f64::from(n % 3))).collect();
        let records = [
            measured("host", "serial", 0, 9.0),
            wobbly,
            measured("cpu", "naive", 8, 50.0),
            measured("gpu", "wide", 1, 1.0),
        ];
        let folder = Folder { records: judged(records), ..Folder::default() };
        let [gpu, cpu] = &Noise::of(&folder)[..] else { panic!("two devices") };
        assert_eq!((cpu.device.as_str(), cpu.samples), ("cpu", 10));
        assert_eq!((gpu.device.as_str(), gpu.launches, gpu.samples), ("gpu", 2, 20));
        assert!(gpu.between_launches.is_some_and(|part| part >= 0.01), "{gpu:?}");
        assert!(gpu.within_launch.is_some(), "{gpu:?}");
        // `half` returns the distance from a record's median to the upper end of its interval, as a fraction
        // of the median. With two points, the median of these distances is the mean of the two distances.
        let half = |index: usize| {
            let record = &folder.records[index];
            interval(record).unwrap()[1] / record.median_ms.unwrap() - 1.0
        };
        let middle = 0.5 * (half(1) + half(3));
        assert!(gpu.own_time.is_some_and(|part| (part - middle).abs() < 1e-12 && part > 0.0), "{gpu:?}");
    }

    #[test]
    fn points_that_were_not_compared_have_a_reason() {
        use super::super::summary::tests::{few, infeasible};
        let not_compared = |records: &[Record]| {
            let folder = Folder { records: judged(records), ..Folder::default() };
            Noise::of(&folder).remove(0).not_compared
        };
        let (naive, wide) = (measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 1, 1.0));
        let (zero, refused) =
            (few("gpu", "bvh", 8, 0.0, 30), infeasible("gpu", "tile", 8, "too large\nmore"));
        assert_eq!(not_compared(&[naive.clone(), wide.clone()]), None);
        let one = not_compared(std::slice::from_ref(&naive));
        assert!(one.is_some_and(|why| why.starts_with("only one point was measured")));
        let all = not_compared(&[zero, refused.clone()]);
        let first =
            "2 of 2 points were not compared. The first is bvh at 8 x 8 (times below the timer's resolution)";
        assert_eq!(all.as_deref(), Some(first));
        let some = not_compared(&[naive, wide, refused]);
        let first = "1 of 3 points was not compared: tile at 8 x 8 (infeasible: too large)";
        assert_eq!(some.as_deref(), Some(first));
    }

    /// `within_launch` is about one launch, and `between_launches` about all launches together. In a run with
    /// a single launch, `within_launch` and `between_launches` are therefore equal.
    #[test]
    fn what_one_launch_can_show_has_the_terms_of_what_all_launches_can_show() {
        let one_launch = |record: Record| Record { sample_launches: vec![0; 10], ..record };
        let steady = [measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 1, 1.0)];
        let folder = Folder { records: judged(steady.map(one_launch)), ..Folder::default() };
        let [gpu] = &Noise::of(&folder)[..] else { panic!("one device") };
        let expected = (1.96 * 0.004 * 2.0_f64.sqrt()).exp() * 1.01 - 1.0;
        assert!(gpu.within_launch.is_some_and(|part| (part - expected).abs() < 1e-5), "{gpu:?}");
        assert_eq!(gpu.within_launch, gpu.between_launches);
    }

    /// The baseline `parallel` was measured in the same rounds as the kernels, and its times vary more. The run has
    /// one launch, so both smallest differences must be equal.
    #[test]
    fn what_one_launch_can_show_counts_a_baseline_as_what_all_launches_can_show() {
        let varied = |device: &str, name: &str, step: f64| {
            let ms = move |index: u32| 10.0 + step * f64::from(index / 3 % 5);
            let record = sampled(name, (0..15).map(move |index| (0, ms(index))));
            Record { key: name.into(), device: device.into(), ..record }
        };
        let baseline = varied(HOST, "parallel", 0.5);
        let noise_of = |kernels: &[Record]| {
            let records = judged([kernels, std::slice::from_ref(&baseline)].concat());
            Noise::of(&Folder { records, ..Folder::default() }).remove(0)
        };
        let [naive, wide] = [("naive", 0.01), ("wide", -0.02)].map(|(name, step)| varied("gpu", name, step));
        let both = noise_of(&[naive.clone(), wide.clone()]);
        let [within, between] = [both.within_launch, both.between_launches].map(Option::unwrap);
        assert!((within / between - 1.0).abs() < 1e-9, "{both:?}");
        // A baseline shows nothing about differences between kernels of a device.
        let alone = noise_of(std::slice::from_ref(&naive));
        assert_eq!((alone.within_launch, alone.between_launches), (None, None));
        let why = "only one point was measured, and a difference needs two points";
        assert_eq!(alone.not_compared.as_deref(), Some(why));
        let later = Record { sample_launches: vec![1; 15], ..wide };
        let apart = noise_of(&[naive, later]);
        assert_eq!((apart.within_launch, apart.between_launches), (None, None));
        let why = "no two points were measured in the same rounds, so no difference between points is known";
        assert_eq!(apart.not_compared.as_deref(), Some(why));
    }

    #[test]
    fn of_an_even_number_of_launches_the_middle_two_count() {
        // In the first launch, both points always take 10 ms. In the second launch, the ratio of the two
        // points' times changes every three samples.
        let varied = |name: &str, sign: f64| {
            let ms = move |index: u32| 10.0 + if index < 15 { 0.0 } else { sign * f64::from(index % 15 / 3) };
            sampled(name, (0..30).map(move |index| (index / 15, ms(index))))
        };
        let within = |launches: std::ops::Range<usize>| {
            let part = |record: Record| Record {
                sample_launches: record.sample_launches[launches.clone()].to_vec(),
                samples_at_ms: record.samples_at_ms[launches.clone()].to_vec(),
                samples_ms: record.samples_ms[launches.clone()].to_vec(),
                ..record
            };
            let records = [varied("naive", 0.2), varied("wide", -0.2)].map(part);
            resolution_within(&records, "gpu").unwrap()
        };
        let [both, first, second] = [0..30, 0..15, 15..30].map(within);
        assert!(
            second > first + 0.005 && (both - 0.5 * (first + second)).abs() < 1e-12,
            "{both} {first} {second}"
        );
    }

    #[test]
    fn what_all_launches_can_show_is_that_of_the_group_that_varies_most() {
        // Each of the three launches has five samples; the samples of the second launch differ from those of
        // the first and third launches.
        let varied = |name: &str, second: f64| {
            let ms = move |launch: u32| if launch == 3 { second } else { 10.0 };
            sampled(name, (0..15).map(move |index| (2 + index / 5, ms(2 + index / 5))))
        };
        let steady = [measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 1, 5.0)];
        let records = [&steady[..], &[varied("naive", 11.0), varied("wide", 9.0)]].concat();
        let folder = Folder { records: judged(records), ..Folder::default() };
        let [gpu] = &Noise::of(&folder)[..] else { panic!("one device") };
        assert!(gpu.between_launches.is_some_and(|part| part > 0.05), "{gpu:?}");
    }

    #[test]
    fn causes_of_noise_are_those_of_the_folder_and_of_the_devices_own_points() {
        use crate::record::RoundLoad;
        use crate::sensor::SensorReading;
        let sensed =
            |clock_mhz: f64| SensorReading { clock_mhz: Some(clock_mhz), ..SensorReading::default() };
        let gpu = |name: &str, clock_mhz: f64| Record {
            sensed: Some(sensed(clock_mhz)),
            throttled_samples: Some(3),
            preempted_samples: Some(2),
            ..measured("gpu", name, 8, 10.0)
        };
        let cpu =
            Record { threads: Some(4), preempted_samples: Some(5), ..measured("cpu", "naive", 8, 10.0) };
        let load = |n: u32| RoundLoad {
            ms: 500.0,
            processors: 8,
            others: 0.5,
            stolen: 0.25,
            core_to_core_ns: Some(f64::from(60 + n)),
            ..RoundLoad::default()
        };
        let clocks =
            serde_json::json!({ "governor": "powersave", "now_mhz": [1000.0, 2000.0], "max_mhz": 3000.0 });
        let folder = Folder {
            records: judged([gpu("naive", 1500.0), cpu, gpu("wide", 1700.0)]),
            rounds: (0..10).map(load).collect(),
            environment: serde_json::json!({ "host": { "clocks": clocks } }),
            ..Folder::default()
        };
        let causes: Vec<Causes> = Noise::of(&folder).into_iter().map(|noise| noise.causes).collect();
        let of_gpu = Causes {
            processors: Some(8.0),
            others: Some(0.5),
            stolen: Some(0.25),
            core_to_core_ns: Some([61.0, 68.0]),
            governor: Some("powersave".into()),
            clocks_mhz: Some([1000.0, 2000.0]),
            device_clock_mhz: Some(1600.0),
            preempted_samples: Some(4),
            throttled_samples: Some(6),
            threads: None,
        };
        let of_cpu = Causes {
            device_clock_mhz: None,
            preempted_samples: Some(5),
            throttled_samples: None,
            threads: Some(4),
            ..of_gpu.clone()
        };
        assert_eq!(causes, [of_gpu, of_cpu]);
        let [unknown] = &Noise::of(&Folder { records: vec![gpu("naive", 1.0)], ..Folder::default() })[..]
        else {
            panic!("one device")
        };
        assert_eq!(
            (unknown.causes.processors, unknown.causes.clocks_mhz, &unknown.causes.governor),
            (None, None, &None)
        );
    }
}
