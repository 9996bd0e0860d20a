//! Tests of comparisons of records that were measured together.

use super::super::summary::tests::{few, judged, measured, sampled};
use super::*;

/// Returns a record with five samples in each of two launches. A sample of the first launch takes `ms`. A sample of the
/// second launch takes longer by the fraction `slower`.
fn launches(name: &str, ms: f64, slower: f64) -> Record {
    let at = |index: u32| if index < 5 { ms } else { ms * (1.0 + slower) };
    sampled(name, (0..10).map(|index| (index / 5, at(index))))
}

#[test]
fn what_slows_all_is_in_the_interval_and_not_in_the_ratio() {
    let records = judged([launches("naive", 10.0, 0.5), launches("wide", 5.0, 0.5)]);
    let ratio = ratio(&records[0], &records[1]).expect("enough samples");
    let only_runs = 1.96 * BetweenRuns::ON_OTHER_DEVICES.own * 2.0_f64.sqrt();
    assert!((ratio.high / ratio.low - (2.0 * only_runs).exp()).abs() < 1e-5, "{ratio:?}");
    let [low, high] = interval(&records[0]).expect("enough samples");
    assert!(low < 5.0 && high > 20.0, "{low} {high}");
}

#[test]
fn a_ratio_of_two_kinds_of_devices_has_the_differences_between_runs_of_both() {
    let on_cpu = Record { threads: Some(2), ..launches("naive", 10.0, 0.0) };
    let records = judged([on_cpu, launches("wide", 5.0, 0.0)]);
    let variance = |of: BetweenRuns| of.shared.powi(2) + of.own.powi(2);
    let both = variance(BetweenRuns::ON_PROCESSORS) + variance(BetweenRuns::ON_OTHER_DEVICES);
    for [one, other] in [[0, 1], [1, 0]] {
        let ratio = ratio(&records[one], &records[other]).expect("enough samples");
        assert!(((ratio.high / ratio.low).ln() - 2.0 * 1.96 * both.sqrt()).abs() < 1e-4, "{ratio:?}");
    }
}

#[test]
fn what_was_measured_apart_is_not_paired() {
    let mut records = judged([launches("naive", 10.0, 0.1), launches("wide", 5.0, 0.1)]);
    let paired = ratio(&records[0], &records[1]).expect("enough samples");
    records[1].sample_launches.iter_mut().for_each(|launch| *launch += 7);
    let records = judged(records);
    let apart = ratio(&records[0], &records[1]).expect("enough samples");
    assert!(apart.high / apart.low > 1.4 * paired.high / paired.low, "{apart:?} {paired:?}");
}

#[test]
fn a_launch_without_times_above_0_has_the_fewest_samples() {
    let record = launches("naive", 10.0, 0.0);
    assert_eq!(fewest(&record), 5);
    let zeros = launches("naive", 10.0, -1.0);
    assert_eq!((fewest(&zeros), fewest_where(&zeros, |_| true)), (0, 5));
    // Records of earlier versions have no numbers of launches.
    let old = Record { sample_launches: Vec::new(), ..record };
    assert_eq!(fewest(&old), 10);
}

#[test]
fn a_hundredth_is_a_tie_and_few_samples_have_no_rank() {
    let records = judged([
        measured("gpu", "naive", 8, 10.0),
        measured("gpu", "wide", 1, 10.09),
        // The samples show that this point takes at least 0.4% longer than the fastest point. They do not
        // show that the point takes at least 1% longer.
        measured("gpu", "wide", 4, 10.15),
        measured("gpu", "wide", 2, 10.3),
        few("gpu", "naive", 4, 1.0, 4),
    ]);
    let ranking = ranking(&records);
    let names = |of: &[&Record]| of.iter().map(|record| record.samples_ms[0]).collect::<Vec<_>>();
    assert_eq!((names(&ranking.winners), names(&ranking.unranked)), (vec![10.0, 10.09, 10.15], vec![1.0]));
}

#[test]
fn one_launch_is_said_to_be_a_look() {
    let look = judged([few("gpu", "naive", 8, 10.0, 5)]);
    assert!(how_sure(&look)[0].starts_with("Measured in only one launch"), "{:?}", how_sure(&look));
    let several = judged([launches("naive", 10.0, 0.0), launches("wide", 5.0, 0.0)]);
    assert_eq!(
        how_sure(&several),
        ["Differences below 2.1% between two points are mostly not detected here."]
    );
    let on_processors = |name| Record { threads: Some(2), ..launches(name, 10.0, 0.0) };
    let several = judged([on_processors("naive"), on_processors("wide")]);
    assert_eq!(
        how_sure(&several),
        ["Differences below 4.1% between two points are mostly not detected here."]
    );
    assert!(how_sure(&[]).is_empty());
}

/// Baselines in a scene, and different devices in a scene, must not make the smallest difference that can be shown seem
/// to depend on the scene.
#[test]
fn what_can_be_told_apart_is_that_of_kernels_and_depends_only_on_what_differs() {
    let said = |records: &[Record]| how_sure(&judged(records)).remove(0);
    let on_gpu = [measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 1, 5.0)];
    let baselines = ["serial-f32", "serial-f64"].map(|name| measured(HOST, name, 0, 100.0));
    let with = |more: &[Record]| said(&[&on_gpu[..], more].concat());
    assert_eq!(
        with(&baselines[..1]),
        "Differences below 2.1% between two points are mostly not detected here."
    );
    // The times of baselines differ from run to run as much as the times of kernels on a CPU.
    assert_eq!(said(&baselines), "Differences below 4.1% between two points are mostly not detected here.");
    let on_cpu = ["naive", "wide"].map(|name| Record { threads: Some(2), ..measured("cpu", name, 8, 50.0) });
    let of_both = with(&on_cpu);
    assert!(of_both.contains(" 2.1 to 4.1% (depending on device) between"), "{of_both}");
    let elsewhere = on_cpu.map(|record| Record { scene: "room".into(), ..record });
    let of_both = with(&elsewhere);
    assert!(of_both.contains(" (depending on scene and device) between"), "{of_both}");
    let elsewhere = elsewhere.map(|record| Record { image_size: [80, 50], ..record });
    let of_both = with(&elsewhere);
    assert!(of_both.contains(" (depending on scene, image size and device) between"), "{of_both}");
}

#[test]
fn where_times_are_too_noisy_no_percentage_is_said() {
    let group = |scene: &str, first_launch: u32, factor: f64| {
        ["naive", "wide"].map(|name| {
            let slow = |index: u32| if (index < 5) == (name == "naive") { factor } else { 1.0 };
            let samples = (0..10).map(move |index| (first_launch + index / 5, 10.0 * slow(index)));
            let key = format!("{name} {scene}");
            Record { scene: scene.into(), key, ..sampled(name, samples) }
        })
    };
    let said = |groups: &[[Record; 2]]| how_sure(&judged(groups.concat())).remove(0);
    let [quiet, noisy] = [group("room", 0, 1.0), group("table", 2, 20.0)];
    let both = said(&[quiet.clone(), noisy.clone()]);
    let below = "Differences below 2.1% between two points are mostly not detected here.";
    let noisier = "In 1 of 2 groups of points, the times are noisier: differences below a factor of 100 are mostly \
                   not detected there.";
    assert_eq!(both, format!("{below} {noisier}"));
    let all = said(&[noisy]);
    assert_eq!(all, "Differences below a factor of 100 between two points are mostly not detected here.");
}

/// Returns two points that were measured in two launches. In the first launch, `naive` takes longer than the other
/// point by the fraction `apart`. In the second launch, `wide` takes longer by this fraction.
fn two_points(scene: &str, image_size: [u32; 2], device: &str, first_launch: u32, apart: f64) -> [Record; 2] {
    ["naive", "wide"].map(|name| {
        let ms = |index: u32| if (index < 5) == (name == "naive") { 10.0 * (1.0 + apart) } else { 10.0 };
        let record = sampled(name, (0..10).map(|index| (first_launch + index / 5, ms(index))));
        let key = format!("{name} {scene} {image_size:?} {device} {first_launch}");
        Record { key, scene: scene.into(), image_size, device: device.into(), ..record }
    })
}

#[test]
fn only_what_the_smallest_difference_depends_on_is_named() {
    let depends = |points: &[[Record; 2]]| {
        let said = how_sure(&judged(points.concat())).remove(0);
        let named = said.split_once(" (depending on ").and_then(|(_, rest)| rest.split_once(") between"));
        named.unwrap_or_else(|| panic!("{said}")).0.to_owned()
    };
    let (small, large, steady, unsteady) = ([64, 40], [96, 60], 0.0, 0.01);
    // The points of two devices were measured in the same rounds.
    let of_scene = |scene: &str, launch: u32, apart: f64| {
        ["gpu", "other"].map(|device| two_points(scene, small, device, launch, apart))
    };
    let scenes = [of_scene("a", 0, steady), of_scene("b", 2, unsteady)].concat();
    assert_eq!(depends(&scenes), "scene");
    // The points of two scenes were measured in the same rounds.
    let of_size = |size: [u32; 2], launch: u32, apart: f64| {
        ["a", "b"].map(|scene| two_points(scene, size, "gpu", launch, apart))
    };
    let sizes = [of_size(small, 0, steady), of_size(large, 2, unsteady)].concat();
    assert_eq!(depends(&sizes), "image size");
    let at = |scene: &str, launch: u32, apart: f64| two_points(scene, small, "gpu", launch, apart);
    let sessions = [at("a", 0, steady), at("a", 2, unsteady)];
    assert_eq!(depends(&sessions), "when the points were measured");
    let alike = [at("a", 0, steady), at("a", 2, unsteady), at("b", 4, steady), at("b", 6, unsteady)];
    assert_eq!(depends(&alike), "when the points were measured");
    assert_eq!(depends(&alike[..3]), "scene and when the points were measured");
}

/// The samples of two sessions cannot be paired, so the ratio of their points is the ratio of two medians. By
/// the means of their three launches, `naive` takes longer than `wide`. By the medians of all samples,
/// `naive` takes less time than `wide`.
#[test]
fn points_of_several_sessions_are_ranked_by_the_medians_of_which_their_ratios_are_computed() {
    let session = |name: &str, first_launch: u32, ms: [f64; 3]| {
        sampled(name, (0..15).map(|index| (first_launch + index / 5, ms[index as usize / 5])))
    };
    let records = judged([session("wide", 0, [1.2; 3]), session("naive", 3, [1.0, 1.0, 4.0])]);
    let ranked = ranking(&records).ranked;
    assert_eq!(ranked[0].name, "naive");
    let ratios = ranked.iter().map(|record| ratio(record, ranked[0]).expect("enough samples").middle);
    assert!(ratios.clone().all(|ratio| ratio >= 1.0), "{:?}", ratios.collect::<Vec<_>>());
    // Samples of the same rounds are paired, and their points are ranked by the means.
    let same = [session("wide", 0, [1.2; 3]), session("naive", 0, [1.0, 1.0, 4.0])];
    assert_eq!(ranking(&judged(same.clone())).ranked[0].name, "wide");
    // A point of another session does not change this order.
    let records = judged([&same[..], &[session("tile", 3, [5.0; 3])]].concat());
    let ranked = ranking(&records).ranked;
    let names: Vec<_> = ranked.iter().map(|record| record.name.as_str()).collect();
    assert_eq!(names, ["wide", "naive", "tile"]);
}

/// Two groups of points have equally many launches. How much launches differ on one machine or device says
/// nothing about other machines or devices.
#[test]
fn only_groups_of_the_same_machine_and_devices_show_how_much_launches_differ() {
    let of = |host: Option<&str>, device: &str| Record {
        host: host.map(str::to_owned),
        device: device.into(),
        ..launches("naive", 10.0, 0.1)
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
    // In each of these groups, a baseline was measured with the point.
    let baseline =
        |record: Record| Record { key: format!("{} on the host", record.key), device: HOST.into(), ..record };
    let one = [of(None, "gpu"), baseline(of(None, "gpu"))];
    let both = [one.to_vec(), vec![other(None, "gpu"), baseline(other(None, "gpu"))]].concat();
    assert!(width(&both) < 0.98 * width(&one));
}

#[test]
fn a_tie_is_decided_by_the_intervals_end() {
    // In one launch, this point is as fast as the other point; in the other launch, it is 6% slower. The mean
    // difference is 3%, but this mean is uncertain.
    let wavers = sampled("wide", (0..10).map(|index| (index / 5, if index < 5 { 10.0 } else { 10.6 })));
    let records = judged([launches("naive", 10.0, 0.0), wavers]);
    assert!(ratio(&records[1], &records[0]).expect("enough samples").middle > 1.02);
    assert_eq!(ranking(&records).winners.len(), 2);
}

#[test]
fn what_can_be_told_apart_is_beyond_a_tie() {
    let records = judged([launches("naive", 10.0, 0.0), launches("wide", 5.0, 0.0)]);
    let [low, high] = resolution(&records).expect("two points");
    let only_runs = 1.96 * BetweenRuns::ON_OTHER_DEVICES.own * 2.0_f64.sqrt();
    let expected = only_runs.exp() * (1.0 + TIE) - 1.0;
    assert!((low - expected).abs() < 1e-5 && (high - expected).abs() < 1e-5, "{low} {high}");
}

#[test]
fn samples_are_paired_in_the_order_they_were_taken() {
    let mut one = launches("naive", 10.0, 0.0);
    one.samples_at_ms = (0..10).map(|index| f64::from(2 * index)).collect();
    let mut other = launches("wide", 5.0, 0.0);
    other.samples_at_ms = (0..10).map(|index| f64::from(2 * index + 1)).collect();
    let order: Vec<usize> =
        in_order([one, other].iter(), &[]).into_iter().map(|sample| sample.point).collect();
    assert_eq!(order, [0, 1].repeat(10));
}

#[test]
fn records_without_enough_samples_were_measured_with_no_other() {
    let records = judged([measured("gpu", "naive", 8, 10.0), few("gpu", "wide", 1, 5.0, 2)]);
    assert!(are_together(&records[0], &records[0]));
    assert!(!are_together(&records[0], &records[1]) && !are_together(&records[1], &records[1]));
}

#[test]
fn if_some_points_have_one_launch_they_are_counted_and_one_is_named() {
    let look = Record { image_size: [80, 50], ..few("gpu", "naive", 8, 10.0, 5) };
    let records = judged([look, launches("naive", 10.0, 0.0), launches("wide", 5.0, 0.0)]);
    let said = how_sure(&records);
    assert!(said[0].contains("program: 1 of 3 points, such as teapot 80 x 50."), "{said:?}");
}

#[test]
fn equal_times_of_other_launches_were_not_measured_together() {
    let one = launches("naive", 10.0, 0.0);
    let mut other = Record { key: "other".into(), ..one.clone() };
    other.sample_launches.iter_mut().for_each(|launch| *launch += 7);
    let records = judged([one, other]);
    assert!(!are_together(&records[0], &records[1]));
}

#[test]
fn each_device_is_compared_with_its_own_anchor() {
    let on = |device: &str, ms| {
        let record = launches("naive", ms, 0.0);
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
    // The last anchor was timed only in launch 9, in which no record was measured. The record of the device `tpu`
    // therefore has no anchor.
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

/// In the second launch, four points take 1.1, 2, 0.5 and 1 times as long as in the first.
#[test]
fn only_a_steady_anchor_that_no_processor_runs_is_compared_with_the_usual_spread_of_points() {
    let degrees = |threads: Option<u32>, slower: f64| {
        let points = [("naive", 0.1), ("wide", 1.0), ("bvh", -0.5), ("tile", 0.0)];
        let mut records = points.map(|(name, slower)| Record { threads, ..launches(name, 10.0, slower) });
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
    // Two launches leave one degree of freedom. If no processor runs the anchor, the usual spread of the four
    // points adds two degrees of freedom: four points, less one for the point and one for the anchor.
    assert_eq!((degrees(Some(2), 1.0), degrees(None, 1.0)), (Some(1.0), Some(3.0)));
    // If the anchor's time changes far more than the points' times, the usual spread of the points says
    // nothing about the anchor.
    assert_eq!(degrees(None, 20.0), Some(1.0));
}

/// The baseline takes 1.4 times as long in one of four launches. The two kernels are equally fast in all launches.
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
    // A single kernel is compared with the baseline as before.
    let one = judged([with[0].clone(), with[2].clone()]);
    assert!(how_sure(&one).len() == 1 && how_sure(&one) != how_sure(&alone), "{:?}", how_sure(&one));
}

/// In each launch, one sample of the point or of the anchor is 0. The other nine samples would be enough.
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
    assert_eq!((super::launches(&records[0]), super::launches(&Record::default())), (1, 0));
}
