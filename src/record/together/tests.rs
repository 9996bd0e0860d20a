//! Tests of comparisons of records that were measured together.

use super::super::point_times::{interval, is_below_resolution, launches};
use super::super::ranking::ranking;
use super::super::ratios::{anchored, anchored_mean, are_together, ratio};
use super::super::smallest_difference::how_sure;
use super::super::summary::tests::{judged, measured, sampled};
use super::*;
use crate::measure::Relative;

/// Returns a record with five samples in each of two launches. A sample of the first launch takes `ms`, and a
/// sample of the second launch takes longer by the fraction `slower`.
pub fn in_two_launches(name: &str, ms: f64, slower: f64) -> Record {
    let at = |index: u32| if index < 5 { ms } else { ms * (1.0 + slower) };
    sampled(name, (0..10).map(|index| (index / 5, at(index))))
}

/// The launches of one group narrow the intervals of another group only if the two groups were measured on
/// the same machine and devices.
#[test]
fn only_groups_of_the_same_machine_and_devices_show_how_much_launches_differ() {
    let of = |host: Option<&str>, device: &str| Record {
        host: host.map(str::to_owned),
        device: device.into(),
        ..in_two_launches("naive", 10.0, 0.1)
    };
    let other = |host: Option<&str>, device: &str| {
        let mut record = Record { key: "other".into(), ..of(host, device) };
        record.sample_launches.iter_mut().for_each(|launch| *launch += 7);
        record
    };
    let width = |records: &[Record]| {
        let [low, high] = interval(&judged(records)[0]).expect("enough samples");
        high / low
    };
    let alone = width(&[of(Some("n1"), "gpu")]);
    assert!(width(&[of(Some("n1"), "gpu"), other(Some("n1"), "gpu")]) < 0.98 * alone);
    assert!(width(&[of(None, "gpu"), other(None, "gpu")]) < 0.98 * alone);
    for (host, device) in [(Some("n2"), "gpu"), (Some("n1"), "cpu"), (Some("n1"), HOST), (None, "gpu")] {
        assert_eq!(width(&[of(Some("n1"), "gpu"), other(host, device)]), alone, "{host:?} {device}");
    }
    // With `--spread`, the points of a run are distributed over devices of the same model. The records of all these
    // devices have the same `device`; only `measured_on` tells which device measured the point.
    let on = |measured_on: &str, record: Record| Record { measured_on: Some(measured_on.into()), ..record };
    let [one, same, another] =
        [on("a", of(None, "gpu")), on("a", other(None, "gpu")), on("b", other(None, "gpu"))];
    assert!(width(&[one.clone(), same]) < 0.98 * alone);
    assert_eq!(width(&[one, another]), alone);
    // In each group of the following records, a baseline (a ray caster on the host) was measured with the
    // point.
    let baseline =
        |record: Record| Record { key: format!("{} on the host", record.key), device: HOST.into(), ..record };
    let one = [of(None, "gpu"), baseline(of(None, "gpu"))];
    let both = [one.to_vec(), vec![other(None, "gpu"), baseline(other(None, "gpu"))]].concat();
    assert!(width(&both) < 0.98 * width(&one));
}

#[test]
fn samples_are_paired_in_the_order_they_were_taken() {
    let mut one = in_two_launches("naive", 10.0, 0.0);
    one.samples_at_ms = (0..10).map(|index| f64::from(2 * index)).collect();
    let mut other = in_two_launches("wide", 5.0, 0.0);
    other.samples_at_ms = (0..10).map(|index| f64::from(2 * index + 1)).collect();
    let order: Vec<usize> =
        in_order([one, other].iter(), &[]).into_iter().map(|sample| sample.point).collect();
    assert_eq!(order, [0, 1].repeat(10));
}

#[test]
fn equal_times_of_other_launches_were_not_measured_together() {
    let one = in_two_launches("naive", 10.0, 0.0);
    let mut other = Record { key: "other".into(), ..one.clone() };
    other.sample_launches.iter_mut().for_each(|launch| *launch += 7);
    let records = judged([one, other]);
    assert!(!are_together(&records[0], &records[1]));
}

#[test]
fn each_device_is_compared_with_its_own_anchor() {
    let on = |device: &str, ms| {
        let record = in_two_launches("naive", ms, 0.0);
        Record { device: device.into(), key: device.into(), ..record }
    };
    let anchor = |name: &str, device: &str, launch: u32, ms: f64| AnchorSample {
        anchor: name.into(),
        device: device.into(),
        launch,
        ms,
        ..AnchorSample::default()
    };
    let both = |launch: u32| {
        let each = move |round: u32| {
            let at_ms = f64::from(5 * launch + round) + 0.5;
            let [one, other] = [anchor("one", "gpu", launch, 2.0), anchor("one", "cpu", launch, 5.0)];
            [AnchorSample { at_ms, round, ..one }, AnchorSample { at_ms, round, ..other }]
        };
        (0..5).flat_map(each)
    };
    // The anchor of the device `tpu` was timed only in launch 9, in which no record was measured. The record
    // of the device `tpu` has no anchor, since no anchor was timed in the launches of this record.
    let anchors: Vec<AnchorSample> = both(0).chain(both(1)).chain([anchor("third", "tpu", 9, 1.0)]).collect();
    let mut records = vec![on("gpu", 10.0), on("cpu", 10.0), on("tpu", 10.0)];
    judge_with_anchors(&mut records, &anchors);
    let actual: Vec<_> = records
        .iter()
        .map(|record| anchored(record).map(|(name, ratio)| (name, ratio.middle.round())))
        .collect();
    assert_eq!(actual, [Some(("one", 5.0)), Some(("one", 2.0)), None]);
    let mean = Relative::mean(&[anchored_mean(&[&records[0]]).expect("an anchor")]).expect("one ratio");
    assert_eq!(mean.middle.round(), 5.0);
    judge(&mut records);
    assert!(records.iter().all(|record| anchored(record).is_none()), "anchors were not requested");
}

#[test]
fn anchors_do_not_change_the_interval_of_a_median_that_was_shown_without_them() {
    let mut records = judged([measured("gpu", "naive", 8, 10.0)]);
    let times = records[0].relative_times.as_mut().expect("enough samples");
    times.median_ms = Interval { low: 7.0, high: 12.0, ..times.median_ms };
    judge_with_anchors(&mut records, &[]);
    assert_eq!(interval(&records[0]), Some([7.0, 12.0]));
}

/// In the second launch, the four points of this test take 1.1, 2, 0.5 and 1 times as long as in the first
/// launch.
#[test]
fn only_a_steady_anchor_that_no_processor_runs_is_compared_with_the_usual_spread_of_points() {
    let degrees = |threads: Option<u32>, slower: f64| {
        let points = [("naive", 0.1), ("wide", 1.0), ("bvh", -0.5), ("tile", 0.0)];
        let mut records =
            points.map(|(name, slower)| Record { threads, ..in_two_launches(name, 10.0, slower) });
        let anchor = |index: u32| AnchorSample {
            anchor: "a".into(),
            device: records[0].device.clone(),
            launch: index / 5,
            at_ms: f64::from(index) + 0.5,
            ms: if index < 5 { 2.0 } else { 2.0 * slower },
            ..AnchorSample::default()
        };
        let anchors: Vec<AnchorSample> = (0..10).map(anchor).collect();
        judge_with_anchors(&mut records, &anchors);
        anchored(&records[0]).map(|(_, ratio)| ratio.degrees.round())
    };
    // Two launches leave one degree of freedom. If no processor runs the anchor (the work with which the
    // points are compared), the usual spread of the points adds two degrees of freedom: four points, less one
    // for the compared point and one for the anchor.
    assert_eq!((degrees(Some(2), 1.0), degrees(None, 1.0)), (Some(1.0), Some(3.0)));
    // If the anchor's time changes far more than the points' times, the usual spread of the points says
    // nothing about the anchor.
    assert_eq!(degrees(None, 20.0), Some(1.0));
}

/// The baseline takes 1.4 times as long in one of four launches. Each of the two kernels takes the same time in
/// all launches.
#[test]
fn a_noisy_baseline_does_not_hide_differences_between_kernels() {
    let point = |name: &str, device: &str, ms: f64, slow: f64| {
        let samples = (0..20).map(move |index| (index / 5, if index < 5 { slow * ms } else { ms }));
        Record { device: device.into(), key: name.into(), ..sampled(name, samples) }
    };
    let kernels = [point("naive", "gpu", 10.0, 1.0), point("wide", "gpu", 11.0, 1.0)];
    let [alone, with] = [None, Some(point("serial", HOST, 100.0, 1.4))].map(|baseline| {
        let records: Vec<Record> = kernels.iter().cloned().chain(baseline).collect();
        judged(records)
    });
    assert_eq!(how_sure(&with), how_sure(&alone));
    let of = |records: &[Record]| ratio(&records[1], &records[0]).expect("enough samples");
    assert_eq!(of(&with), of(&alone));
    // The interval of a ratio to the baseline follows from the baseline's own times.
    let to_baseline = ratio(&with[2], &with[0]).expect("enough samples");
    assert!(to_baseline.high / to_baseline.low > 1.5, "{to_baseline:?}");
    // If a kernel was measured together with a baseline, but with no other kernel, the kernel is still
    // compared with the baseline.
    let one = judged([with[0].clone(), with[2].clone()]);
    assert!(how_sure(&one).len() == 1 && how_sure(&one) != how_sure(&alone), "{:?}", how_sure(&one));
}

/// In each launch, one sample of the point or of the anchor is 0. Without the sample of 0, the launch's nine
/// other samples would be enough for a comparison.
#[test]
fn a_sample_of_zero_is_no_time_of_a_point_or_an_anchor() {
    let zero = |index: u32| index.is_multiple_of(10);
    let some = sampled("wide", (0..20).map(|index| (index / 10, if zero(index) { 0.0 } else { 0.001 })));
    let whole = |name: &str| sampled(name, (0..20).map(|index| (index / 10, 0.002)));
    let records = judged([some, whole("naive"), whole("bvh")]);
    assert_eq!(records.iter().map(is_below_resolution).collect::<Vec<_>>(), [true, false, false]);
    assert_eq!((interval(&records[0]), ranking(&records).unranked.len()), (None, 1));
    assert!(ratio(&records[0], &records[1]).is_none() && ratio(&records[2], &records[1]).is_some());
    let anchored_to = |least: f64| {
        let mut records = [whole("naive"), whole("bvh")];
        let anchor = |index: u32| AnchorSample {
            anchor: "a".into(),
            device: records[0].device.clone(),
            launch: index / 10,
            at_ms: f64::from(index) + 0.5,
            ms: if zero(index) { least } else { 1.0 },
            ..AnchorSample::default()
        };
        let anchors: Vec<AnchorSample> = (0..20).map(anchor).collect();
        judge_with_anchors(&mut records, &anchors);
        anchored(&records[0]).is_some()
    };
    assert_eq!([0.0, 0.5].map(anchored_to), [false, true]);
}

#[test]
fn a_devices_kind_decides_how_much_runs_differ_and_only_without_it_its_threads() {
    let of = |device: &str, kind: Option<&str>, threads| {
        let record = Record {
            device: device.into(),
            device_kind: kind.map(str::to_owned),
            threads,
            ..Record::default()
        };
        between_runs(&record)
    };
    for on_processors in [of("a", Some("cpu"), None), of("a", None, Some(2)), of(HOST, None, None)] {
        assert_eq!(on_processors, BetweenRuns::ON_PROCESSORS);
    }
    for elsewhere in [of("a", Some("gpu"), Some(2)), of("a", Some("accelerator"), None), of("a", None, None)]
    {
        assert_eq!(elsewhere, BetweenRuns::ON_OTHER_DEVICES);
    }
}

#[test]
fn records_without_launch_numbers_were_measured_together_if_all_that_is_compared_is_the_same() {
    let old = |name: &str| Record { sample_launches: Vec::new(), ..measured("gpu", name, 8, 10.0) };
    let records = judged([
        old("naive"),
        old("wide"),
        Record { device: "cpu".into(), ..old("naive") },
        Record { image_size: [80, 50], ..old("naive") },
        Record { scene: "room".into(), ..old("naive") },
        Record { scene_hash: Some("1".into()), ..old("naive") },
    ]);
    let together: Vec<usize> =
        (0..records.len()).filter(|index| are_together(&records[0], &records[*index])).collect();
    assert_eq!(together, [0, 1]);
    assert_eq!((launches(&records[0]), launches(&Record::default())), (1, 0));
}
