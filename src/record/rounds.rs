//! Reads and interprets `rounds.jsonl`: how much other processes and virtual machines used the machine while
//! rounds were timed.

use super::types::Record;
use crate::load::Load;
use crate::measure::quantile;
use crate::numbers::significant;
use crate::words::{counted, counted_are};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, HashSet};

/// A line of `rounds.jsonl`: the machine's load during consecutive rounds of a launch, which together take
/// long enough to measure the load.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoundLoad {
    /// The launch's number, which is unique in the folder of results.
    pub launch: u32,
    /// The number of the last round that the line describes.
    pub round: u32,
    /// The total duration of the rounds that the line describes, in milliseconds.
    pub ms: f64,
    /// Number of processors of the machine.
    pub processors: usize,
    /// Mean number of processors that other processes kept busy.
    pub others: f64,
    /// Mean number of processors that other virtual machines on the same hardware took from this machine.
    pub stolen: f64,
    /// The system's load average of the last minute: the mean number of threads that ran, waited to run, or
    /// waited for a disk. Null if the system does not report the load average.
    pub load_1m: Option<f64>,
    /// The core-to-core latency (the time in which a cache line moves from one processor to another) after
    /// the rounds that the line describes, in nanoseconds; null if the latency was not measured.
    #[serde(default)]
    pub core_to_core_ns: Option<f64>,
}

/// The least number of readings of the core-to-core latency from which raycl computes percentiles. With fewer readings,
/// the lowest and the highest reading would be the percentiles.
pub(crate) const LEAST_READINGS: usize = 10;
/// The least number of readings of the core-to-core latency from which raycl computes the median.
const LEAST_OF_MEDIAN: usize = 3;
/// If the core-to-core latency differs by more than this factor between rounds or between two runs, raycl assumes
/// that a virtual machine's processors were moved to other cores.
pub(crate) const MOVED: f64 = 1.5;

/// Other processes and virtual machines that together used more than this fraction of the machine may have
/// disturbed the measurements. The note that [`disturbance`] returns states `DISTURBED` as a percentage.
const DISTURBED: f64 = 0.05;

/// Says that a number of launches is a sum over all groups of points. Elsewhere, a run states the number of launches
/// of a single point, which is smaller if there are several groups.
const PER_GROUP: &str = " (counted for each group of points)";

impl RoundLoad {
    /// Makes a line of `rounds.jsonl` from the load that was measured while rounds were timed.
    pub fn of(launch: u32, round: u32, load: &Load) -> Self {
        let Load { ms, others, stolen, processors, load_1m, core_to_core_ns } = *load;
        Self { launch, round, ms, processors, others, stolen, load_1m, core_to_core_ns }
    }
}

/// The mean load over some rounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeanLoad {
    /// Number of processors of the machine.
    pub(crate) processors: f64,
    /// Number of processors that other processes kept busy.
    pub(crate) others: f64,
    /// Number of processors that other virtual machines on the same hardware took from this machine.
    pub(crate) stolen: f64,
}

impl MeanLoad {
    fn taken(&self) -> f64 {
        self.others + self.stolen
    }
}

/// Returns the mean load over some rounds, weighted by the rounds' durations; `None` if `lines` is empty.
pub(crate) fn mean_load<'a>(lines: impl IntoIterator<Item = &'a RoundLoad>) -> Option<MeanLoad> {
    let lines: Vec<&RoundLoad> = lines.into_iter().collect();
    let all_ms: f64 = lines.iter().map(|line| line.ms).sum();
    let mean = |of: fn(&RoundLoad) -> f64| lines.iter().map(|line| of(line) * line.ms).sum::<f64>() / all_ms;
    let processors = lines.iter().map(|line| line.processors).max()? as f64;
    Some(MeanLoad { processors, others: mean(|line| line.others), stolen: mean(|line| line.stolen) })
}

/// Returns the numbers of the launches in which the records' samples were measured.
fn launches_of(records: &[Record]) -> HashSet<u32> {
    records.iter().flat_map(|record| &record.sample_launches).copied().collect()
}

/// Returns a note if other processes or virtual machines disturbed launches in which these records were
/// measured; otherwise `None`. The load of a launch is unknown if no rounds of the launch took long enough to
/// measure the load.
pub(crate) fn disturbance(lines: &[RoundLoad], records: &[Record]) -> Option<String> {
    let shown = launches_of(records);
    let mean = |launch: &u32| mean_load(lines.iter().filter(|line| line.launch == *launch));
    let means: Vec<_> = shown.iter().filter_map(mean).collect();
    let bad = means.iter().filter(|mean| mean.taken() > DISTURBED * mean.processors);
    let worst = bad.clone().max_by(|a, b| a.taken().total_cmp(&b.taken()))?;
    let stolen = match worst.stolen > 0.01 {
        true => {
            let stolen = significant(worst.stolen, 2);
            format!(", and other virtual machines on the same hardware used {stolen} more")
        }
        false => String::new(),
    };
    let bad = bad.count();
    let launches = match (shown.len(), means.len()) {
        (all, known) if all == known => format!("in {bad} of {}{PER_GROUP}", counted(all, "launch")),
        (all, 1) => {
            format!("how busy the machine was is known for 1 of {all} launches{PER_GROUP}. In this launch")
        }
        (all, known) => format!(
            "how busy the machine was is known for {known} of {all} launches{PER_GROUP}. In {bad} of these {known} launches"
        ),
    };
    Some(format!(
        "Disturbed: {launches}, other programs and virtual machines together used more than 5% of the machine. In the worst launch, other processes kept \
         {} of {} processors busy{stolen}. This load may have made times longer. If \
         possible, stop the other programs and run the experiment again.",
        significant(worst.others, 2),
        worst.processors
    ))
}

/// Returns a note on the samples that raycl left out because threads probably had to wait for a processor; `None` if no
/// samples were left out for this reason.
pub(crate) fn preempted(records: &[Record]) -> Option<String> {
    let samples: u32 = records.iter().filter_map(|record| record.preempted_samples).sum();
    (samples > 0).then(|| {
        let are = counted_are(samples as usize, "sample");
        format!("{are} left out, because a thread that cast the frame probably had to wait for a processor.")
    })
}

/// Returns the 10th and the 90th percentile of the core-to-core latency, in nanoseconds; `None` if `lines`
/// contain too few readings.
pub(crate) fn core_to_core_ns<'a>(lines: impl IntoIterator<Item = &'a RoundLoad>) -> Option<[f64; 2]> {
    let mut readings: Vec<f64> = lines.into_iter().filter_map(|line| line.core_to_core_ns).collect();
    readings.sort_unstable_by(f64::total_cmp);
    let tenth = readings.len() / 10;
    (readings.len() >= LEAST_READINGS).then(|| [readings[tenth], readings[readings.len() - 1 - tenth]])
}

/// Returns the number of launches that raycl left out. In these launches, the core-to-core latency was unusual.
/// Probably, the processors of a virtual machine ran on cores further apart than in other samples, or several of the
/// processors shared a core. Records that share a launch belong to the same group, so their left-out launches are
/// counted once. (After `--retry-failed`, a point has some launches that other points of its group lack.) The result
/// may be too small, since a record does not state which launches were left out.
fn moved_launches(records: &[Record]) -> u32 {
    let mut groups: Vec<(BTreeSet<u32>, u32)> = Vec::new();
    for record in records {
        let Some(mut most) = record.moved_launches else { continue };
        let mut launches: BTreeSet<u32> = record.sample_launches.iter().copied().collect();
        groups.retain(|(others, count)| {
            let is_apart = *others != launches && others.is_disjoint(&launches);
            if !is_apart {
                launches.extend(others);
                most = most.max(*count);
            }
            is_apart
        });
        groups.push((launches, most));
    }
    groups.iter().map(|(_, most)| most).sum()
}

/// Returns a note on the launches and samples that were left out because the core-to-core latency was far from
/// its usual value. If no launch and no sample was left out, but the core-to-core latency changed by more than
/// the factor [`MOVED`] while `records` were measured, returns a note on the change of the latency. In all
/// other cases, returns `None`. Both notes say "if this machine is virtual", since raycl does not know whether
/// the machine is virtual.
pub(crate) fn moved_processors(lines: &[RoundLoad], records: &[Record]) -> Option<String> {
    let samples = records.iter().filter_map(|record| record.moved_samples).sum::<u32>() as usize;
    let launches = moved_launches(records) as usize;
    let left_out = match [launches, samples] {
        [0, samples] => counted_are(samples, "sample"),
        [launches, 0] => counted_are(launches, "launch"),
        [launches, samples] => {
            format!("{} and {} are", counted(launches, "launch"), counted(samples, "sample"))
        }
    };
    if launches + samples > 0 {
        return Some(format!(
            "{left_out} left out, because the core-to-core latency was unusual. If this machine is virtual, its host \
             probably moved its processors to cores further apart than in other samples, or to one core. Times are \
             different on distant or shared cores."
        ));
    }
    let shown = launches_of(records);
    let [low, high] = core_to_core_ns(lines.iter().filter(|line| shown.contains(&line.launch)))?;
    (high > MOVED * low).then(|| {
        format!(
            "The core-to-core latency changed between {} and {} ns. If this machine is virtual, its host probably \
             moved its processors to other cores. Moving to other cores changes the times of everything that runs on \
             these processors, above all of kernels whose work-groups share data.",
            significant(low, 2),
            significant(high, 2)
        )
    })
}

/// Returns the median of readings of the core-to-core latency, in nanoseconds; `None` if `readings_ns` has
/// fewer than [`LEAST_OF_MEDIAN`] readings.
fn median_latency_ns(mut readings_ns: Vec<f64>) -> Option<f64> {
    readings_ns.sort_unstable_by(f64::total_cmp);
    (readings_ns.len() >= LEAST_OF_MEDIAN).then(|| quantile(&readings_ns, 0.5))
}

/// Returns the median core-to-core latency in the launches of some records, in nanoseconds; `None` if these
/// launches have too few readings.
pub(crate) fn latency_ns(lines: &[RoundLoad], records: &[Record]) -> Option<f64> {
    let shown = launches_of(records);
    let of_shown = lines.iter().filter(|line| shown.contains(&line.launch));
    median_latency_ns(of_shown.filter_map(|line| line.core_to_core_ns).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a record whose group used the given launches, with the numbers of samples and launches that
    /// were left out.
    fn left_out(launches: &[u32], moved_samples: Option<u32>, moved_launches: Option<u32>) -> Record {
        Record { sample_launches: launches.to_vec(), moved_samples, moved_launches, ..Record::default() }
    }

    #[test]
    fn samples_that_are_left_out_are_counted_over_all_points() {
        let of = |counts: &[Option<u32>]| {
            let record = |count: &Option<u32>| left_out(&[0], *count, None);
            moved_processors(&[], &counts.iter().map(record).collect::<Vec<_>>())
        };
        assert!(of(&[Some(2), None, Some(3)]).unwrap().starts_with("5 samples are left out, because"));
        assert!(of(&[Some(1)]).unwrap().starts_with("1 sample is left out, because"));
        assert_eq!(of(&[Some(0), None]), None);
    }

    #[test]
    fn launches_that_are_left_out_are_counted_once_per_group() {
        let one = left_out(&[1, 1, 2], Some(0), Some(1));
        let same = left_out(&[1, 2, 2], Some(0), Some(1));
        let other = left_out(&[4, 5], Some(0), Some(2));
        let none = left_out(&[6, 7], Some(0), Some(0));
        let of = |records: &[&Record]| {
            moved_processors(&[], &records.iter().map(|&record| record.clone()).collect::<Vec<_>>())
        };
        assert!(of(&[&one, &same]).unwrap().starts_with("1 launch is left out, because"));
        assert!(of(&[&one, &same, &other, &none]).unwrap().starts_with("3 launches are left out, because"));
        assert_eq!(of(&[&none, &left_out(&[8], None, None)]), None);
        // A further session measured a point of the first group again, in two new launches.
        let again = left_out(&[1, 8, 9], Some(0), Some(2));
        assert!(of(&[&one, &same, &again]).unwrap().starts_with("2 launches are left out, because"));
        assert!(of(&[&again, &other, &one]).unwrap().starts_with("4 launches are left out, because"));
        let samples = left_out(&[4, 5], Some(7), Some(2));
        assert!(of(&[&samples]).unwrap().starts_with("2 launches and 7 samples are left out, because"));
    }

    #[test]
    fn a_latency_is_that_of_the_records_launches() {
        let of =
            |(launch, ns): (u32, f64)| vec![RoundLoad { core_to_core_ns: Some(ns), ..line(launch, 0.0) }; 3];
        let lines: Vec<RoundLoad> = (0..).zip([180.0, 23.0, 34.0, 195.0]).flat_map(of).collect();
        let latency = |launches: &[u32]| latency_ns(&lines, &[left_out(launches, None, None)]);
        assert_eq!([latency(&[0]), latency(&[1, 2, 3]), latency(&[])], [Some(180.0), Some(34.0), None]);
        assert_eq!(latency_ns(&lines[..2], &[left_out(&[0], None, None)]), None, "two readings");
    }

    fn line(launch: u32, others: f64) -> RoundLoad {
        RoundLoad { launch, ms: 500.0, processors: 2, others, ..RoundLoad::default() }
    }

    #[test]
    fn launches_are_disturbed_where_others_take_much_of_the_machine() {
        let records = [Record { sample_launches: vec![0, 1, 1], ..Record::default() }];
        let quiet = [line(0, 0.02), line(1, 0.05)];
        assert_eq!(disturbance(&quiet, &records), None);
        let said = disturbance(&[line(0, 0.02), line(1, 0.9), line(1, 0.1), line(7, 2.0)], &records);
        let expected = "Disturbed: in 1 of 2 launches (counted for each group of points), other programs and virtual machines together used more than 5% of the machine. In the worst launch, other \
            processes kept 0.50 of 2 processors busy. This load may have made times longer. If possible, stop the \
            other programs and run the experiment again.";
        assert_eq!(said.as_deref(), Some(expected));
        assert_eq!(disturbance(&[], &records), None);
        // 0.08 of two processors is 4% of the machine, which is less than the limit of 5%.
        assert_eq!(disturbance(&[line(0, 0.08), line(1, 0.08)], &records), None);
    }

    #[test]
    fn launches_of_unknown_load_are_not_among_those_of_known_load() {
        let records = [Record { sample_launches: vec![0, 1, 2], ..Record::default() }];
        let said = disturbance(&[line(0, 0.9), line(1, 0.9)], &records).unwrap();
        let expected = "Disturbed: how busy the machine was is known for 2 of 3 launches (counted for each group of points). In 2 of these 2 launches, other programs";
        assert!(said.starts_with(expected), "{said}");
    }

    #[test]
    fn preempted_samples_are_noted_without_any_round_of_known_load() {
        let record = |count| Record { preempted_samples: count, ..Record::default() };
        let why = "left out, because a thread that cast the frame probably had to wait for a processor.";
        let said = |counts: &[Option<u32>]| {
            preempted(&counts.iter().map(|count| record(*count)).collect::<Vec<_>>())
        };
        assert_eq!(said(&[Some(3), None, Some(4)]), Some(format!("7 samples are {why}")));
        assert_eq!(said(&[Some(1)]), Some(format!("1 sample is {why}")));
        assert_eq!(said(&[Some(0), None]), None);
    }

    #[test]
    fn processors_were_moved_where_a_cache_line_takes_longer_at_times() {
        let records = [Record { sample_launches: vec![0, 0], ..Record::default() }];
        let lines = |ns: [f64; 2], launch: u32| -> Vec<RoundLoad> {
            let of = |at: usize| RoundLoad { core_to_core_ns: Some(ns[at % 2]), ..line(launch, 0.0) };
            (0..10).map(of).collect()
        };
        let said = moved_processors(&lines([60.0, 320.0], 0), &records).unwrap();
        assert!(said.contains("between 60 and 320 ns"), "{said}");
        assert_eq!(moved_processors(&lines([60.0, 85.0], 0), &records), None, "within the usual spread");
        assert!(
            moved_processors(&lines([60.0, 100.0], 0), &records).is_some(),
            "more than 1.5 times as long"
        );
        assert_eq!(moved_processors(&lines([60.0, 320.0], 1), &records), None, "another launch");
        assert_eq!(moved_processors(&lines([60.0, 320.0], 0)[..9], &records), None, "too few");
        // With one high reading of the core-to-core latency, the 90th percentile stays low, so the function
        // returns no note.
        let mut one = lines([60.0, 60.0], 0);
        one[3].core_to_core_ns = Some(900.0);
        assert_eq!(moved_processors(&one, &records), None);
    }

    #[test]
    fn what_other_guests_take_disturbs_too() {
        let records = [Record { sample_launches: vec![0], ..Record::default() }];
        let said = disturbance(&[RoundLoad { stolen: 0.4, ..line(0, 0.01) }], &records).unwrap();
        assert!(
            said.ends_with(
                "kept 0.010 of 2 processors busy, and other virtual machines on the same hardware used 0.40 more. This \
                 load may have made times longer. If possible, stop the other programs and run the experiment again."
            ),
            "{said}"
        );
    }

    #[test]
    fn what_other_guests_take_is_reported_from_a_hundredth_of_a_processor_on() {
        let records = [Record { sample_launches: vec![0], ..Record::default() }];
        let is_reported = |stolen: f64| {
            let said = disturbance(&[RoundLoad { stolen, ..line(0, 0.5) }], &records).unwrap();
            said.contains("other virtual machines on the same hardware used")
        };
        assert_eq!([is_reported(0.0), is_reported(0.01), is_reported(0.02)], [false, false, true]);
    }

    #[test]
    fn what_processes_and_guests_take_adds_up() {
        let records = [Record { sample_launches: vec![0], ..Record::default() }];
        // The note names the worst launch: the launch in which other processes and virtual machines together
        // used the most processors.
        let launches = [line(0, 0.3), RoundLoad { stolen: 0.4, ..line(1, 0.2) }];
        let both = [Record { sample_launches: vec![0, 1], ..Record::default() }];
        let said = disturbance(&launches, &both).unwrap();
        assert!(
            said.contains(
                "kept 0.20 of 2 processors busy, and other virtual machines on the same hardware used 0.40 more"
            ),
            "{said}"
        );
        // Neither other virtual machines alone nor other processes alone use enough of the machine to count
        // as a disturbance. Together, other virtual machines and other processes count as a disturbance.
        let halves = [RoundLoad { stolen: 0.08, ..line(0, 0.0) }, line(0, 0.08)];
        assert!(halves.iter().all(|half| disturbance(std::slice::from_ref(half), &records).is_none()));
        assert!(disturbance(&[RoundLoad { stolen: 0.08, ..line(0, 0.08) }], &records).is_some());
    }

    #[test]
    fn a_mean_is_weighted_by_how_long_rounds_took() {
        let mean = mean_load(&[line(0, 0.9), RoundLoad { ms: 1500.0, ..line(0, 0.1) }]).unwrap();
        assert!((mean.others - 0.3).abs() < 1e-12, "{mean:?}");
        assert_eq!(mean_load(&[]), None);
    }

    #[test]
    fn a_line_has_what_was_measured() {
        let load = Load {
            ms: 500.0,
            others: 0.25,
            stolen: 0.125,
            processors: 4,
            load_1m: Some(1.5),
            core_to_core_ns: Some(60.0),
        };
        let expected = serde_json::json!({
            "launch": 3, "round": 9, "ms": 500.0, "processors": 4, "others": 0.25, "stolen": 0.125, "load_1m": 1.5,
            "core_to_core_ns": 60.0,
        });
        assert_eq!(serde_json::to_value(RoundLoad::of(3, 9, &load)).unwrap(), expected);
    }

    #[test]
    fn a_tenth_of_the_readings_lies_beyond_each_percentile() {
        let of = |count: u32| -> Vec<RoundLoad> {
            // The readings are not in ascending order, so that the function has to sort them.
            (0..count)
                .map(|n| RoundLoad { core_to_core_ns: Some(f64::from(n * 7 % count)), ..line(0, 0.0) })
                .collect()
        };
        assert_eq!(core_to_core_ns(&of(20)), Some([2.0, 17.0]));
        assert_eq!((core_to_core_ns(&of(10)), core_to_core_ns(&of(9))), (Some([1.0, 8.0]), None));
        let mean =
            mean_load(&[line(0, 0.5), RoundLoad { processors: 8, stolen: 1.0, ..line(0, 0.5) }]).unwrap();
        assert_eq!((mean.processors, mean.others, mean.stolen), (8.0, 0.5, 0.5));
    }
}
