use super::pair::Against;
use super::*;
use crate::record::fixtures::{few, infeasible, judged, measured};
use crate::record::{AnchorSample, RoundLoad, interval};
use crate::report::compare::lines::PairLine;

fn folder(label: &str, records: Vec<Record>) -> Folder {
    Folder { label: label.into(), records: judged(records), ..Folder::default() }
}

/// Returns a record whose samples are 0%, 0.5% and 1% above `around`, in turn.
fn timed(device: &str, name: &str, around: f64) -> Record {
    let mut record = measured(device, name, 8, around);
    record.samples_ms = (0..10).map(|n| around * (1.0 + 0.005 * f64::from(n % 3))).collect();
    record
}

fn of(before: &Folder, after: &Folder) -> Comparison {
    Comparison::of(before, after, 0.02, false)
}

#[test]
fn another_machines_results_are_compared_point_by_point() {
    let of_a = [("naive", 10.0), ("wide", 1.0), ("bvh", 2.0), ("tile", 1.0), ("private", 5.0)];
    let before = folder("old", of_a.map(|(name, ms)| timed("a", name, ms)).to_vec());
    let of_b = [("naive", 20.0), ("wide", 0.6), ("bvh", 2.0), ("tile", 1.0), ("raster", 1.0)];
    let mut after = of_b.map(|(name, ms)| timed("b", name, ms)).to_vec();
    after.push(infeasible("b", "private", 8, "no"));
    let comparison = of(&before, &folder("new", after));
    assert_eq!(comparison.summary(), "1 faster, 1 slower, 2 same, 0 unclear");
    let regressions = comparison.regressions(5.0);
    assert_eq!(regressions.len(), 2, "{regressions:?}");
    assert!(comparison.regressions(150.0)[0].contains("was measured, is infeasible"));
    assert!(comparison.others.iter().any(|line| line.contains("only in new")), "{:?}", comparison.others);
    let markdown = comparison.markdown();
    assert!(markdown.contains("| slower |"), "{markdown}");
    // The rows with the largest changes come first: 2 times as long, then 0.6 times as long, then no change.
    let positions = ["naive", "wide", "bvh"].map(|name| markdown.find(name).unwrap());
    assert!(positions.is_sorted(), "{markdown}");
}

/// The first device is a CPU, and the second device takes a hundredth of its times. The host of each device
/// also timed a baseline; two records of a baseline have equal keys only if processors of the same model ran it.
#[test]
fn a_faster_device_is_faster_although_all_points_share_the_factor() {
    let run = |device: &str, factor: f64, (host, ms): (&str, f64)| {
        let kernels =
            [("naive", 10.0), ("wide", 1.0), ("bvh", 2.0)].map(|(name, ms)| timed(device, name, factor * ms));
        let host = Record { key: host.into(), ..timed("host", "serial", ms) };
        folder(device, [kernels.to_vec(), vec![host]].concat())
    };
    let (cpu, gpu) = (run("cpu", 1.0, ("old", 300.0)), run("gpu", 0.01, ("new", 100.0)));
    let comparison = of(&cpu, &gpu);
    assert_eq!(comparison.summary(), "4 faster, 0 slower, 0 same, 0 unclear");
    assert!(comparison.pairs.iter().all(|pair| matches!(pair.change, Some((_, Against::BareTimes)))));
    assert!(comparison.lines()[0].change_percent.is_some_and(|percent| (percent + 99.0).abs() < 0.1));
    let notes = &comparison.notes;
    let is_said = |note: &String| note.starts_with("Plain times are compared, because the devices differ");
    assert!(notes.iter().any(is_said), "{notes:?}");
    assert!(notes.iter().all(|note| !note.contains("cannot be detected")), "{notes:?}");
    let regressions = of(&gpu, &cpu).regressions(5.0);
    assert!(regressions[0].starts_with("all points together are 9900."), "{regressions:?}");
    // Relative to a baseline that ran on the same model of processor in both folders, the GPU is faster, too.
    let of_same_host = of(&cpu, &run("gpu", 0.01, ("old", 300.0)));
    assert_eq!(of_same_host.summary(), "3 faster, 0 slower, 0 same, 0 unclear, 1 not comparable");
    assert!(matches!(of_same_host.pairs[0].change, Some((_, Against::Baselines))));
}

#[test]
fn what_all_points_share_needs_a_baseline() {
    let kernels = |slower: f64| {
        [("naive", 10.0), ("wide", 1.0), ("bvh", 2.0)]
            .map(|(name, ms)| timed("a", name, slower * ms))
            .to_vec()
    };
    let all = of(&folder("old", kernels(1.0)), &folder("new", kernels(1.5)));
    assert_eq!((all.count(Verdict::Same), all.regressions(5.0).len()), (3, 0));
    assert!(all.notes.iter().any(|note| note.contains("cannot be detected")), "{:?}", all.notes);
    let with = |slower| [kernels(slower), vec![timed("host", "serial", 100.0)]].concat();
    let against = of(&folder("old", with(1.0)), &folder("new", with(1.5)));
    assert_eq!((against.count(Verdict::Slower), against.regressions(30.0).len()), (3, 4));
    let bare = Comparison::of(&folder("old", kernels(1.0)), &folder("new", kernels(1.5)), 0.02, true);
    assert_eq!(bare.regressions(40.0).len(), 4);
    for tested in [&against, &bare] {
        assert!(tested.regressions(30.0)[0].starts_with("all points together are 50.0% slower"));
        assert_eq!(tested.left_out_of_means(), None);
    }
}

/// Returns a folder with points of three strategies at two sizes each, and possibly a baseline. `slow` returns the
/// factor by which a strategy is slower than usual.
fn strategies(label: &str, baseline: Option<f64>, slow: impl Fn(&str) -> f64) -> Folder {
    let each = |name: &'static str| [4, 8].map(|side| (name, side));
    let mut records: Vec<Record> = ["naive", "wide", "bvh"]
        .into_iter()
        .flat_map(each)
        .map(|(name, side)| Record {
            key: format!("{name} {side}"),
            local_size: Some([side, side]),
            ..timed("a", name, slow(name) * f64::from(side))
        })
        .collect();
    records.extend(baseline.map(|ms| timed("host", "serial", ms)));
    folder(label, records)
}

#[test]
fn the_mean_of_a_strategy_is_tested_relative_to_baselines_or_to_other_strategies() {
    let before = |baseline| strategies("old", baseline, |_| 1.0);
    let slow = |name: &str| if name == "wide" { 1.5 } else { 1.0 };
    let against = of(&before(Some(100.0)), &strategies("new", Some(100.0), slow));
    let regressions = against.regressions(25.0);
    assert!(regressions[0].starts_with("wide at its 2 points is 50.0% slower"), "{regressions:?}");
    assert_eq!((regressions.len(), against.left_out_of_means()), (3, None), "{regressions:?}");
    let in_common = of(&before(None), &strategies("new", None, slow));
    let regressions = in_common.regressions(25.0);
    assert!(regressions[0].starts_with("wide at its 2 points is 50.0% slower"), "{regressions:?}");
    assert_eq!(regressions.len(), 3, "{regressions:?}");
    // Without a baseline, nothing shows whether all points became slower. The mean change of the strategy
    // `wide` must not be computed relative to points of `wide` itself.
    let note = in_common.left_out_of_means().unwrap();
    let why =
        "(without 6 of 6 points). These points are left out because they are compared only with each other";
    assert!(note.contains(&format!("without some points: all points together {why}")), "{note}");
    // If nothing shows which of the points changed, the note gives another reason.
    let two = folder("two", vec![timed("a", "naive", 10.0), timed("a", "wide", 1.0)]);
    let note = of(&two, &two).left_out_of_means().unwrap();
    assert!(
        note.contains("(without 2 of 2 points). A point is left out if it has too few samples"),
        "{note}"
    );
}

/// In this test, one of the two groups of points in the first run has no anchor.
#[test]
fn a_group_without_an_anchor_does_not_hide_the_others() {
    let run = |label: &str, slower: f64, launches: u32| {
        let mut both = and(anchored(label, 1.0, |_| slower), anchored(label, 1.0, |_| slower), 10, "gpu");
        both.anchors.retain(|anchor| anchor.launch < launches);
        both
    };
    let comparison = of(&run("old", 1.0, 10), &run("new", 1.2, 20));
    let regressions = comparison.regressions(5.0);
    assert!(regressions[0].starts_with("all points together are 20.0% slower"), "{regressions:?}");
    let note = comparison.left_out_of_means().unwrap();
    assert!(note.contains("all points together (without 4 of 8 points)"), "{note}");
}

/// The points of ten scenes were measured with the same anchor. raycl assumes that the time of each point differs
/// from run to run, with a standard deviation of 0.4%. In a mean over all points, the differences of single points
/// average out. The difference of the anchor (the fixed work by whose time the points' times are divided) does not
/// average out.
#[test]
fn the_anchors_own_difference_between_runs_does_not_average_out() {
    let record = |number: u32, record: &Record| Record {
        scene: format!("scene {number}"),
        key: format!("{number} {}", record.key),
        sample_launches: record.sample_launches.iter().map(|launch| launch + 10 * number).collect(),
        ..record.clone()
    };
    let anchor = |number: u32, sample: &AnchorSample| AnchorSample {
        launch: sample.launch + 10 * number,
        ..sample.clone()
    };
    let run = |label: &str, slower: f64| {
        let one = anchored(label, 1.0, |_| slower);
        let records = |number: u32| one.records.iter().map(move |each| record(number, each));
        let anchors = |number: u32| one.anchors.iter().map(move |each| anchor(number, each));
        Folder {
            label: label.into(),
            records: judged((0..10).flat_map(records).collect::<Vec<_>>()),
            anchors: (0..10).flat_map(anchors).collect(),
            ..Folder::default()
        }
    };
    let comparison = of(&run("old", 1.0), &run("new", 1.02));
    // The difference between the two runs' anchors has a standard deviation of 0.4% times the square root of
    // 2. In one of 150 comparisons, the difference is above 1.4%.
    assert_eq!(comparison.regressions(1.0), Vec::<String>::new());
    let regressions = comparison.regressions(0.3);
    assert!(regressions[0].starts_with("all points together are 2.0% slower"), "{regressions:?}");
}

#[test]
fn a_baseline_whose_program_changed_is_none() {
    let run = |label: &str, host: Record| {
        let kernels = [("naive", 10.0), ("wide", 1.0), ("bvh", 2.0)].map(|(name, ms)| timed("a", name, ms));
        folder(label, [kernels.to_vec(), vec![host]].concat())
    };
    let faster = Record { key: "another program".into(), ..timed("host", "serial", 50.0) };
    let comparison = of(&run("old", timed("host", "serial", 100.0)), &run("new", faster));
    assert_eq!(comparison.summary(), "0 faster, 0 slower, 3 same, 0 unclear, 1 not comparable");
    assert!(comparison.regressions(5.0).is_empty(), "{:?}", comparison.regressions(5.0));
    let notes = &comparison.notes;
    assert!(notes.iter().any(|note| note.starts_with("No baseline was measured")), "{notes:?}");
}

#[test]
fn an_estimate_that_is_not_certain_is_no_regression() {
    let names = ["naive", "wide", "bvh", "tile", "raster"];
    let before = names.map(|name| timed("a", name, 5.0)).to_vec();
    // The point is 10% slower in one launch and 50% slower in another. Even the fastest samples are
    // therefore slower than before, but the 95% interval of the mean change is wide.
    let mut after = before.clone();
    after[2].samples_ms[..5].iter_mut().for_each(|ms| *ms *= 1.1);
    after[2].samples_ms[5..].iter_mut().for_each(|ms| *ms *= 1.5);
    after[2].median_ms = Some(6.5);
    let comparison = of(&folder("old", before), &folder("new", after));
    let change = comparison.pairs[2].change_percent();
    assert!(change.is_some_and(|percent| percent > 20.0), "{change:?}");
    assert!(comparison.regressions(5.0).is_empty(), "{:?}", comparison.regressions(5.0));
}

#[test]
fn one_kernel_that_is_slower_is_found_among_others() {
    let names = ["naive", "wide", "bvh", "tile", "raster"];
    let run =
        |slow: f64| names.map(|name| timed("a", name, if name == "bvh" { slow * 5.0 } else { 5.0 })).to_vec();
    let comparison = of(&folder("old", run(1.0)), &folder("new", run(1.1)));
    assert_eq!(comparison.summary(), "0 faster, 1 slower, 4 same, 0 unclear");
    let regressions = comparison.regressions(5.0);
    assert!(regressions[0].contains("bvh"), "{regressions:?}");
    // The permitted probability of a false report is 2%. The tests of single points together may use a third
    // of this probability. These are five tests, so each of them may use a fifteenth of the 2%.
    let (change, _) = comparison.pairs.iter().find(|pair| pair.before.name == "bvh").unwrap().change.unwrap();
    let least = |risk: f64| format!("at least {:.1}%", super::pair::percent(change.surely_above(risk)));
    assert_ne!(least(0.02 / 3.0 / 5.0), least(0.02 / 5.0));
    assert!(regressions.iter().any(|line| line.contains(&least(0.02 / 3.0 / 5.0))), "{regressions:?}");
}

#[test]
fn a_machine_of_two_speeds_is_no_regression() {
    let names = ["naive", "wide", "bvh", "tile", "raster"];
    let before = names.map(|name| timed("a", name, 5.0)).to_vec();
    let slow_from = |fast: usize| {
        let mut after = before.clone();
        let is_slow = |(index, _): &(usize, &mut f64)| index % 5 >= fast;
        after[2].samples_ms.iter_mut().enumerate().filter(is_slow).for_each(|(_, ms)| *ms *= 1.5);
        after[2].median_ms = Some(7.5);
        of(&folder("old", before.clone()), &folder("new", after))
    };
    // In the comparison `some`, one sample in five of the second folder's slow point is as fast as in the
    // first folder. In the comparison `all`, every sample of this point is slower than in the first folder.
    let [some, all] = [1, 0].map(slow_from);
    let change = some.pairs[2].change_percent();
    assert!(change.is_some_and(|percent| percent > 40.0), "{change:?}");
    assert!(some.regressions(5.0).is_empty(), "{:?}", some.regressions(5.0));
    assert_eq!(all.regressions(5.0).len(), 1);
}

#[test]
fn a_scene_that_was_edited_is_another() {
    let of_scene = |hash: &str, name: &str| Record {
        scene_hash: Some(hash.into()),
        key: format!("{hash} {name}"),
        ..timed("a", name, 10.0)
    };
    let before = folder("old", vec![of_scene("1", "naive"), of_scene("1", "wide")]);
    let after = folder("new", vec![of_scene("2", "naive"), of_scene("2", "wide")]);
    let comparison = of(&before, &after);
    assert!(comparison.pairs.is_empty());
    assert_eq!(comparison.others, ["teapot: the two folders have different scenes of this name"]);
}

#[test]
fn scenes_correspond_by_name_if_a_folder_has_not_recorded_their_content() {
    let known = |name: &str| Record {
        scene_hash: Some("a".into()),
        key: format!("of another program: {name}"),
        ..timed("a", name, 10.0)
    };
    let before = folder("old", vec![timed("a", "naive", 10.0)]);
    let comparison = of(&before, &folder("new", vec![known("naive")]));
    assert_eq!((comparison.pairs.len(), comparison.others.len()), (1, 0), "{:?}", comparison.others);
    // The first folder has no hashes of scenes, so nothing shows that the two scenes with the same name
    // differ.
    let before = folder("old", vec![timed("a", "naive", 10.0), timed("a", "wide", 10.0)]);
    let comparison = of(&before, &folder("new", vec![known("naive"), known("bvh")]));
    assert_eq!(comparison.pairs.len(), 1);
    let only = ["teapot 800 x 500, wide 8x8: only in old", "teapot 800 x 500, bvh 8x8: only in new"];
    assert_eq!(comparison.others, only);
}

#[test]
fn few_samples_of_either_are_no_verdict() {
    let before = folder("old", vec![timed("a", "naive", 10.0), few("a", "wide", 8, 1.0, 3)]);
    let after = folder("new", vec![few("a", "naive", 8, 99.0, 4), timed("a", "wide", 99.0)]);
    let comparison = of(&before, &after);
    assert_eq!(comparison.summary(), "0 faster, 0 slower, 0 same, 0 unclear, 2 not enough samples");
    assert!(comparison.regressions(5.0).is_empty(), "{:?}", comparison.regressions(5.0));
    let markdown = comparison.markdown();
    assert!(markdown.contains("| n = 5 and 4 | not enough samples |"), "{markdown}");
    assert!(!markdown.contains("as long"), "{markdown}");
    let html = comparison.html().expect("it renders");
    assert!(html.contains("not enough samples (n = 4)") && !html.contains("99.00 to 99.00"), "{html}");
}

#[test]
fn times_of_zero_are_reported_as_such() {
    let run = |label: &str| folder(label, vec![few("a", "naive", 8, 0.0, 30), timed("a", "wide", 1.0)]);
    let comparison = of(&run("old"), &run("new"));
    let markdown = comparison.markdown();
    assert!(markdown.contains("| ? | below the timer's resolution |"), "{markdown}");
    assert!(!markdown.contains("not enough samples"), "{markdown}");
    let counts = "0 faster, 0 slower, 0 same, 0 unclear, 1 not comparable, 1 below the timer's resolution";
    assert_eq!(comparison.summary(), counts);
    assert!(comparison.lines().iter().any(|line| line.verdict == "below the timer's resolution"));
}

#[test]
fn a_folder_is_the_same_as_itself_and_one_point_tells_nothing() {
    let points = [("naive", 10.0), ("wide", 1.0), ("bvh", 2.0)].map(|(name, ms)| timed("a", name, ms));
    let three = folder("three", points.to_vec());
    assert_eq!(of(&three, &three).summary(), "0 faster, 0 slower, 3 same, 0 unclear");
    assert!(of(&three, &three).html().expect("it renders").contains("class=\"mark\""));
    let two = folder("two", points[..2].to_vec());
    assert_eq!(of(&two, &two).summary(), "0 faster, 0 slower, 0 same, 0 unclear, 2 not comparable");
    let one = folder("one", vec![timed("a", "naive", 10.0)]);
    assert_eq!(of(&one, &one).summary(), "0 faster, 0 slower, 0 same, 0 unclear, 1 not comparable");
}

/// Without an anchor and baselines, the unchanged half of the kernels must not be judged relative to the slower half.
#[test]
fn half_of_the_kernels_being_slower_makes_the_others_not_faster() {
    let run = |label: &str, slow: f64| {
        let points = [("naive", 10.0), ("wide", 1.0), ("bvh", 2.0 * slow), ("tile", 3.0 * slow)];
        folder(label, points.map(|(name, ms)| timed("a", name, ms)).to_vec())
    };
    let comparison = of(&run("old", 1.0), &run("new", 1.5));
    assert_eq!(comparison.summary(), "0 faster, 0 slower, 0 same, 0 unclear, 4 not comparable");
    let is_said = |note: &String| note.contains("most of which changed by similar factors");
    assert!(comparison.notes.iter().any(is_said), "{:?}", comparison.notes);
    let note = comparison.left_out_of_means().expect("a note");
    assert!(note.contains("all points together (without 4 of 4 points)"), "{note}");
    assert!(note.ends_with("a majority of the device's kernels that changed by similar factors."), "{note}");
}

/// In the run `one`, the driver had one thread, because the user had set an environment variable.
#[test]
fn devices_whose_states_differ_are_named_with_what_differs() {
    let run = |label: &str, device: &str, more: serde_json::Value| {
        let mut described = serde_json::json!({
            "device": device, "platform": "PoCL", "driver": "3.1", "compute_units": 2, "cores": 2,
        });
        let more = more.as_object().cloned().unwrap_or_default();
        described.as_object_mut().unwrap().extend(more);
        let environment = serde_json::json!({ "devices": [{ "device": "another" }, described] });
        Folder { environment, ..folder(label, vec![timed(device, "naive", 10.0)]) }
    };
    let note = |before: &Folder, after: &Folder| {
        of(before, after).notes.into_iter().find(|note| note.starts_with("The devices differ"))
    };
    let two = run("two", "a", serde_json::json!({ "threads": 2, "settings": ["X=1"] }));
    let settings = ["POCL_MAX_PTHREAD_COUNT=1", "X=1"];
    let one = run("one", "a", serde_json::json!({ "threads": 1, "compute_units": 1, "settings": settings }));
    let expected = "The devices differ. In two: a, 2 threads. In one: a, 1 thread, POCL_MAX_PTHREAD_COUNT=1.";
    assert_eq!(note(&two, &one).as_deref(), Some(expected));
    assert!(of(&two, &one).markdown().contains(&format!("\nNote: {expected}\n")));
    // In the run `own`, raycl has set the number of threads and pinned the threads.
    let set = ["POCL_AFFINITY=1", "POCL_MAX_PTHREAD_COUNT=2", "X=1"];
    let description = serde_json::json!({ "threads": 2, "settings": set, "set_by_raycl": set[..2] });
    let expected = "The devices differ. In own: a, 2 threads, POCL_AFFINITY=1 (set by raycl). In one: a, 1 thread, POCL_MAX_PTHREAD_COUNT=1.";
    assert_eq!(note(&run("own", "a", description), &one).as_deref(), Some(expected));
    let other = run("other", "b", serde_json::json!({ "driver": "5.0" }));
    let plain = run("plain", "a", serde_json::json!({}));
    let expected = "The devices differ. In plain: a, driver 3.1. In other: b, driver 5.0.";
    assert_eq!(note(&plain, &other).as_deref(), Some(expected));
    // Folders that earlier versions of raycl wrote contain neither the settings nor the number of threads.
    assert_eq!([note(&two, &two), note(&two, &plain)], [None, None]);
}

/// The second machine has two devices of one name, so the second folder has a longer name for the compared
/// device. The second config gives another name to a strategy, and the program of `wide` has changed.
#[test]
fn records_of_one_key_correspond_whatever_their_names_are() {
    let before = ["naive", "wide", "bvh"].map(|name| timed("cpu", name, 10.0));
    let [mut naive, mut wide, mut bvh] = before.clone();
    naive.name = "mine".into();
    wide.key = "of another program".into();
    for record in [&mut naive, &mut wide, &mut bvh] {
        record.device = "pocl-cpu".into();
    }
    let tile = Record { device: "pocl-cpu".into(), ..timed("cpu", "tile", 10.0) };
    let after = vec![naive, wide, bvh, timed("pocl-cpu-2", "naive", 10.0), tile];
    let comparison = of(&folder("old", before.to_vec()), &folder("new", after));
    let names = comparison.pairs.iter().map(|pair| [pair.before.name.as_str(), pair.after.name.as_str()]);
    assert_eq!(names.collect::<Vec<_>>(), [["naive", "mine"], ["wide", "wide"], ["bvh", "bvh"]]);
    let others = ["naive 8x8, pocl-cpu-2", "tile 8x8, cpu"];
    assert_eq!(comparison.others, others.map(|name| format!("teapot 800 x 500, {name}: only in new")));
    let named = |line: &PairLine<'_>| line.point.ends_with(", cpu");
    assert!(comparison.lines().iter().all(named), "the names are those of the first folder");
    let notes = &comparison.notes;
    assert!(notes.iter().all(|note| !note.starts_with("The devices differ")), "{notes:?}");
    assert_eq!(comparison.lost_points(), None);
    // The device only has another name, so times are relative to the points that changed by similar factors.
    let is_relative = |pair: &Pair| matches!(pair.change, Some((_, Against::PointsInCommon)));
    assert!(comparison.pairs.iter().all(is_relative));
}

#[test]
fn points_that_the_second_folder_lacks_are_noted() {
    let points = ["naive", "wide", "bvh", "tile", "raster", "private"].map(|name| timed("a", name, 10.0));
    let few = vec![points[0].clone(), points[1].clone(), infeasible("a", "deferred", 8, "no")];
    let (all, few) = (folder("all", points.to_vec()), folder("few", few));
    let note = of(&all, &few).lost_points().unwrap();
    let first = "`--fail-on-regression` does not test these points: teapot 800 x 500, bvh 8x8; teapot";
    assert!(note.starts_with(first) && note.ends_with("in all, and few has no records of them."), "{note}");
    // The point `deferred` has no time in the folder `few`, so it does not count as lost if the folder `all`
    // does not contain it.
    assert_eq!(of(&few, &all).lost_points(), None);
    let many = of(&all, &folder("none", vec![infeasible("a", "naive", 8, "no")])).lost_points().unwrap();
    assert!(
        many.contains("does not test 5 of the points (teapot") && many.contains("raster 8x8, ...)"),
        "{many}"
    );
}

#[test]
fn kernels_about_which_nothing_can_be_told_are_noted_with_the_reason() {
    let two = folder("two", vec![timed("a", "naive", 10.0), timed("a", "wide", 1.0)]);
    let notes = of(&two, &two).notes;
    let expected = "The verdict is \"not comparable\" for these points: teapot 800 x 500, naive 8x8; teapot";
    let is_said = |notes: &[String]| notes.iter().any(|note| note.starts_with(expected));
    assert!(is_said(&notes), "{notes:?}");
    assert!(!is_said(&Comparison::of(&two, &two, 0.02, true).notes));
    // The verdict on the baseline is "not comparable", because there is no other baseline. The note on the
    // verdict "not comparable" is only about kernels.
    let with_host =
        |label: &str| folder(label, vec![timed("a", "naive", 10.0), timed("host", "serial", 10.0)]);
    let notes = of(&with_host("old"), &with_host("new")).notes;
    assert!(notes.iter().all(|note| !note.starts_with("The verdict is")), "{notes:?}");
}

/// Returns the records of a group of five points. `slow` returns the factor by which a point is slower than usual.
fn five_points(slow: impl Fn(&str) -> f64) -> Vec<Record> {
    ["wide", "naive", "bvh", "tile", "raster"].map(|name| timed("a", name, slow(name))).to_vec()
}

/// Returns the points of [`five_points`] as a group of two blocks (parts that are measured separately). The
/// first block has the first three points. One of these, `wide`, is the control point, which every block
/// measures. The second block has the last two points, and also measures (borrows) the control point `wide`.
fn two_blocks(label: &str, slow: impl Fn(&str) -> f64) -> Folder {
    let mut records = five_points(slow);
    records.push(Record { is_control: true, ..records[0].clone() });
    let control = records[0].key.clone();
    for (index, record) in records.iter_mut().enumerate() {
        record.control = Some(control.clone());
        record.sample_launches.iter_mut().for_each(|launch| *launch += if index < 3 { 0 } else { 2 });
    }
    let mut records = judged(records);
    let controls = records.split_off(5);
    Folder { label: label.into(), records, controls, ..Folder::default() }
}

#[test]
fn a_control_point_that_a_block_borrowed_is_one_of_the_points_of_the_same_rounds() {
    let blocks = two_blocks("blocks", |_| 1.0);
    assert_eq!(of(&blocks, &blocks).summary(), "0 faster, 0 slower, 5 same, 0 unclear");
    let slow = two_blocks("slow", |name| if name == "tile" { 1.5 } else { 1.0 });
    let changed = of(&blocks, &slow);
    assert_eq!(changed.summary(), "0 faster, 1 slower, 4 same, 0 unclear");
    let tile = changed.pairs.iter().find(|pair| pair.before.name == "tile").unwrap();
    assert_eq!(tile.change_percent().map(f64::round), Some(50.0));
    // The mean of all points is not tested: its points could be compared only with the control point, which is one of
    // these points.
    let note = changed.left_out_of_means().unwrap();
    assert!(note.contains("all points together (without 5 of 5 points)"), "{note}");
    // The folder `whole` has the same points, but they were not divided into blocks: all points were measured
    // in the same rounds. All five points are compared with the folder `whole`, too.
    let whole = folder("whole", five_points(|_| 1.0));
    for comparison in [of(&blocks, &whole), of(&whole, &blocks)] {
        assert_eq!(comparison.summary(), "0 faster, 0 slower, 5 same, 0 unclear");
    }
}

/// The second block has a point of the same strategy as the control point, and a point of another strategy
/// that became slower.
#[test]
fn the_mean_of_a_strategy_is_not_relative_to_a_borrowed_control_point_of_the_same_strategy() {
    let run = |tile: f64| {
        let mut folder = two_blocks("run", |name| if name == "tile" { tile } else { 1.0 });
        let other = &mut folder.records[4];
        (other.name, other.local_size) = ("wide".into(), Some([4, 4]));
        folder
    };
    let comparison = of(&run(1.0), &run(1.5));
    assert_eq!(comparison.summary(), "0 faster, 1 slower, 4 same, 0 unclear");
    let note = comparison.left_out_of_means().unwrap();
    assert!(note.contains("wide (without 2 of 2 points)"), "{note}");
}

/// Returns a folder with two strategies at two sizes each, measured together with an anchor in
/// three launches. `machine` is the factor by which the machine is slower than
/// usual, and `slow` returns the factor by which a strategy is slower than usual.
fn anchored(label: &str, machine: f64, slow: impl Fn(&str) -> f64) -> Folder {
    let mut records = Vec::new();
    let mut anchors = Vec::new();
    let speed = |launch: u32| machine * (1.0 + 0.1 * f64::from(launch));
    for (index, (name, side)) in
        [("naive", 4), ("naive", 8), ("wide", 4), ("wide", 8)].into_iter().enumerate()
    {
        let mut record = measured("gpu", name, side, 1.0);
        let at = |n: u32| (n / 6, f64::from(10 * (n % 6) + index as u32));
        record.sample_launches = (0..18).map(|n| at(n).0).collect();
        record.samples_at_ms = (0..18).map(|n| at(n).1).collect();
        let wobble = |n: u32| 1.0 + 0.004 * f64::from((n * 7 + index as u32 * 3) % 5);
        record.samples_ms =
            (0..18).map(|n| slow(name) * speed(at(n).0) * wobble(n) * f64::from(side)).collect();
        record.median_ms = Some(f64::from(side));
        records.push(record);
    }
    for n in 0..18_u32 {
        let (launch, at_ms) = (n / 6, f64::from(10 * (n % 6)) + 5.0);
        let ms = 3.0 * speed(launch) * (1.0 + 0.004 * f64::from(n * 3 % 5));
        anchors.push(AnchorSample {
            anchor: "a".into(),
            device: "gpu".into(),
            launch,
            round: n % 6,
            at_ms,
            ms,
            ..AnchorSample::default()
        });
    }
    Folder { label: label.into(), records: judged(records), anchors, ..Folder::default() }
}

#[test]
fn beside_an_anchor_a_slower_machine_is_no_regression_and_a_slower_kernel_is() {
    let usual = anchored("old", 1.0, |_| 1.0);
    let slow_machine = of(&usual, &anchored("new", 1.5, |_| 1.0));
    assert_eq!(slow_machine.summary(), "0 faster, 0 slower, 4 same, 0 unclear");
    assert!(slow_machine.regressions(5.0).is_empty(), "{:?}", slow_machine.regressions(5.0));
    let all = of(&usual, &anchored("new", 0.7, |_| 1.1));
    assert!(all.regressions(5.0)[0].starts_with("all points together are 10"), "{:?}", all.regressions(5.0));
    assert_eq!(all.summary(), "0 faster, 4 slower, 0 same, 0 unclear");
    let one = of(&usual, &anchored("new", 1.2, |name| if name == "wide" { 1.1 } else { 1.0 }));
    assert_eq!(one.summary(), "0 faster, 2 slower, 2 same, 0 unclear");
    let regressions = one.regressions(5.0);
    assert!(regressions[0].starts_with("wide at its 2 points is 10"), "{regressions:?}");
    assert!(
        regressions.iter().all(|line| !line.contains("naive") && !line.contains("all points")),
        "{regressions:?}"
    );
    assert!(one.pairs.iter().all(|pair| matches!(pair.change, Some((_, Against::Anchor)))));
}

/// Before raycl computes a point's ratio to the anchor (fixed work), it subtracts the drift (a change of the
/// machine's speed) from the logarithms of all times. The drift is computed from the samples of all points that
/// were measured in the same rounds, including borrowed control points.
#[test]
fn a_change_relative_to_an_anchor_uses_the_samples_of_a_borrowed_control_point_too() {
    let run = |label: &str, unsteady: f64| {
        let mut whole = anchored(label, 1.0, |_| 1.0);
        for (index, ms) in whole.records[3].samples_ms.iter_mut().enumerate() {
            *ms *= 1.0 + unsteady * (index % 2) as f64;
        }
        whole.records = judged(whole.records);
        let mut block = whole.clone();
        block.controls = block.records.split_off(3);
        (whole, block)
    };
    let changes = |before: &Folder, after: &Folder| -> Vec<_> {
        of(before, after).pairs.into_iter().map(|pair| (pair.before.key, pair.change)).collect()
    };
    let ((old, old_block), (new, new_block)) = (run("old", 0.0), run("new", 0.1));
    let actual = changes(&old_block, &new_block);
    assert!(actual.iter().all(|(_, change)| matches!(change, Some((_, Against::Anchor)))), "{actual:?}");
    assert_eq!(actual, changes(&old, &new)[..3]);
}

/// Returns a folder with the points and anchors of `one` and `other`. The points and anchors of `other` get
/// the device `device` and launch numbers that are larger by `launches`. The points of `other` get the scene
/// "room", so that they differ from the points of `one`.
fn and(one: Folder, other: Folder, launches: u32, device: &str) -> Folder {
    let record = |record: &Record| Record {
        scene: "room".into(),
        key: format!("room {}", record.key),
        device: device.into(),
        sample_launches: record.sample_launches.iter().map(|launch| launch + launches).collect(),
        ..record.clone()
    };
    let anchor = |sample: &AnchorSample| AnchorSample {
        device: device.into(),
        launch: sample.launch + launches,
        ..sample.clone()
    };
    let records = one.records.iter().cloned().chain(other.records.iter().map(record)).collect::<Vec<_>>();
    let anchors = one.anchors.iter().cloned().chain(other.anchors.iter().map(anchor)).collect();
    Folder { label: one.label, records: judged(records), anchors, ..Folder::default() }
}

#[test]
fn each_group_and_each_device_is_compared_with_the_anchor_of_its_own() {
    for (launches, device) in [(10, "gpu"), (0, "another")] {
        let run = |label: &str, machine: f64, slower: f64| {
            and(anchored(label, 1.0, |_| 1.0), anchored(label, machine, |_| slower), launches, device)
        };
        let usual = run("old", 1.0, 1.0);
        let slow_machine = of(&usual, &run("new", 2.0, 1.0));
        assert_eq!(slow_machine.summary(), "0 faster, 0 slower, 8 same, 0 unclear", "{device}");
        assert!(slow_machine.regressions(5.0).is_empty(), "{:?}", slow_machine.regressions(5.0));
        // Relative to their anchors, the points of the second group take 1.2 times as long as before, and the
        // points of the first group take as long as before. Both groups have four points, so the geometric
        // mean of all changes is the square root of 1.2.
        let slow_kernels = of(&usual, &run("new", 2.0, 1.2));
        assert_eq!(slow_kernels.summary(), "0 faster, 4 slower, 4 same, 0 unclear", "{device}");
        let regressions = slow_kernels.regressions(5.0);
        assert!(regressions[0].starts_with("all points together are 9."), "{regressions:?}");
        assert!(regressions[1].starts_with("naive at its 4 points is 9."), "{regressions:?}");
        assert_eq!(regressions.iter().filter(|line| line.starts_with("room ")).count(), 4, "{regressions:?}");
        let on = regressions.iter().filter(|line| line.contains(", another is ")).count();
        assert_eq!(on, if device == "another" { 4 } else { 0 }, "{regressions:?}");
    }
}

#[test]
fn points_of_one_group_that_were_two_groups_in_the_other_run_are_compared_with_their_own_anchors() {
    let run = |label: &str, machine: f64, launches: u32| {
        and(anchored(label, 1.0, |_| 1.0), anchored(label, machine, |_| 1.0), launches, "gpu")
    };
    let together = run("together", 1.0, 0);
    // The anchor is fixed work that is timed with each group of points. Relative to the anchor of another
    // group, the points would appear to be slower in the second run.
    let (fast, slow) = (run("fast", 0.5, 10), run("slow", 2.0, 10));
    for (before, after) in [(&together, &slow), (&fast, &together)] {
        let comparison = of(before, after);
        assert_eq!([Verdict::Faster, Verdict::Slower].map(|verdict| comparison.count(verdict)), [0, 0]);
        assert_eq!(comparison.regressions(5.0), Vec::<String>::new());
    }
}

/// Returns a folder in which other programs delayed every sample of the anchor by the factor `delay`, but no
/// sample of a point. The anchor is the fixed work by whose time the points' times are divided.
fn with_delayed_anchor(mut folder: Folder, delay: f64) -> Folder {
    folder.records.iter_mut().for_each(|record| record.utilization = Some(2.0));
    for anchor in &mut folder.anchors {
        anchor.processor_ms = Some(2.0 * anchor.ms);
        anchor.ms *= delay;
        anchor.host_ms = Some(anchor.ms);
    }
    folder
}

#[test]
fn an_anchor_that_other_programs_delayed_makes_no_point_faster_or_slower() {
    let run = |label: &str, delay: f64| with_delayed_anchor(anchored(label, 1.0, |_| 1.0), delay);
    let (quiet, busy) = (run("quiet", 1.0), run("busy", 1.6));
    for comparison in [of(&quiet, &busy), of(&busy, &quiet)] {
        assert_eq!(comparison.summary(), "0 faster, 0 slower, 0 same, 4 unclear");
        assert_eq!(comparison.regressions(5.0), Vec::<String>::new());
        let notes = &comparison.notes;
        assert!(notes.iter().any(|note| note.contains("factors that differ by up to 60%")), "{notes:?}");
    }
    assert_eq!(of(&quiet, &quiet).summary(), "0 faster, 0 slower, 4 same, 0 unclear");
    assert!(!of(&quiet, &quiet).notes.iter().any(|note| note.contains("factors that differ")));
}

/// The points take twice as long, but seem to take 3.2 times as long, because the anchor was delayed by the
/// factor 1.6 in the first run. This delay of the anchor can explain only the factor 1.6 of these 3.2.
#[test]
fn a_slowdown_of_all_points_that_exceeds_the_anchors_delay_is_found_in_the_means() {
    let busy = with_delayed_anchor(anchored("busy", 1.0, |_| 1.0), 1.6);
    let slow = with_delayed_anchor(anchored("slow", 1.0, |_| 2.0), 1.0);
    let regressions = of(&busy, &slow).regressions(5.0);
    for mean in ["all points together are ", "naive at its 2 points is ", "wide at its 2 points is "] {
        assert!(regressions.iter().any(|line| line.starts_with(mean)), "{mean}: {regressions:?}");
    }
}

/// In both runs, other programs delayed two of three samples of the anchor. An earlier version of raycl, which did not
/// record processor times, measured one of the runs.
#[test]
fn preempted_samples_of_an_anchor_are_left_out_in_both_runs_or_in_none() {
    let run = |label: &str, has_processor_times: bool| {
        let mut folder = anchored(label, 1.0, |_| 1.0);
        let delayed = |sample: &AnchorSample, delay: f64| AnchorSample {
            ms: sample.ms * delay,
            host_ms: has_processor_times.then_some(sample.ms * delay),
            processor_ms: has_processor_times.then_some(2.0 * sample.ms),
            ..sample.clone()
        };
        let thrice = |sample: &AnchorSample| [1.0, 1.5, 1.5].map(|delay| delayed(sample, delay));
        folder.anchors = folder.anchors.iter().flat_map(thrice).collect();
        folder
    };
    let (old, new) = (run("old", false), run("new", true));
    for comparison in [of(&old, &new), of(&new, &old), of(&new, &new)] {
        assert!(comparison.pairs.iter().all(|pair| matches!(pair.change, Some((_, Against::Anchor)))));
        assert_eq!([Verdict::Faster, Verdict::Slower].map(|verdict| comparison.count(verdict)), [0, 0]);
    }
}

#[test]
fn another_anchor_tells_nothing() {
    let mut other = anchored("new", 1.0, |_| 1.1);
    other.anchors.iter_mut().for_each(|sample| sample.anchor = "b".into());
    let comparison = of(&anchored("old", 1.0, |_| 1.0), &other);
    assert!(comparison.pairs.iter().all(|pair| !matches!(pair.change, Some((_, Against::Anchor)))));
    assert!(comparison.regressions(5.0).is_empty(), "{:?}", comparison.regressions(5.0));
}

/// In this test, the time of the anchor (fixed work) varies far more from launch to launch than the points' times.
#[test]
fn intervals_of_times_are_those_of_all_other_views() {
    let run = |label: &str| {
        let mut folder = anchored(label, 1.0, |_| 1.0);
        folder.anchors.iter_mut().for_each(|sample| sample.ms *= 1.0 + f64::from(sample.launch));
        folder
    };
    let (old, new) = (run("old"), run("new"));
    let comparison = of(&old, &new);
    assert!(comparison.pairs.iter().all(|pair| matches!(pair.change, Some((_, Against::Anchor)))));
    let shown = comparison.pairs.iter().map(Pair::both).map(|(one, other)| [one, other].map(interval));
    let expected = old.records.iter().zip(&new.records).map(|(one, other)| [one, other].map(interval));
    assert_eq!(shown.collect::<Vec<_>>(), expected.collect::<Vec<_>>());
}

#[test]
fn from_tenfold_on_a_change_is_said_as_a_factor() {
    let changed = |ms: f64| {
        let kernels = |own: f64| {
            [("naive", own), ("wide", 1.0), ("bvh", 2.0), ("tile", 1.0)]
                .map(|(name, ms)| timed("a", name, ms))
                .to_vec()
        };
        let comparison = of(&folder("old", kernels(10.0)), &folder("new", kernels(ms)));
        let pair = comparison.pairs.iter().find(|pair| pair.before.name == "naive");
        pair.map(Pair::change).unwrap_or_default()
    };
    assert_eq!((changed(200.0), changed(0.5)), ("20.0× as long".to_owned(), "20.0× as fast".to_owned()));
}

#[test]
fn a_point_that_is_a_hundred_times_as_fast_changed_more_than_one_that_takes_twice_as_long() {
    let run = |label: &str, wide: f64, naive: f64| {
        let few = few("a", "bvh", 8, 1.0, 3);
        folder(label, vec![timed("a", "wide", wide), timed("a", "naive", naive), few])
    };
    let comparison = Comparison::of(&run("old", 1.0, 100.0), &run("new", 2.0, 1.0), 0.02, true);
    let markdown = comparison.markdown();
    let positions = ["naive", "wide", "bvh"].map(|name| markdown.find(name).unwrap());
    assert!(positions.is_sorted(), "{markdown}");
    // The page sorts its rows by the values of `data-v`, which are the changes in percent.
    let html = comparison.html().expect("it renders");
    let values = html.split("data-v=\"").skip(1).map(|rest| rest.split('"').next()?.parse::<f64>().ok());
    let rounded = |value: Option<f64>| value.map(f64::round);
    assert_eq!(values.map(rounded).collect::<Vec<_>>(), [Some(-99.0), Some(100.0), None]);
}

#[test]
fn a_point_that_takes_longer_with_the_second_folder_of_kernels_is_slower() {
    let with = |kernels: &str, ms| Record { kernels_of: Some(kernels.into()), ..timed("a", "naive", ms) };
    let run = folder("run", vec![with("old", 10.0), with("new", 20.0)]);
    let comparison = Comparison::of_kernels(&run, 0.02);
    assert_eq!(comparison.labels, ["old", "new"]);
    assert_eq!(comparison.summary(), "0 faster, 1 slower, 0 same, 0 unclear");
    let change = comparison.pairs[0].change_percent();
    assert!(change.is_some_and(|percent| percent > 90.0), "{change:?}");
    assert!(comparison.notes.iter().any(|note| note.contains("close together")), "{:?}", comparison.notes);
}

/// `--resume` measured the points of the second folder of kernels in another session, when the machine was slower.
#[test]
fn kernels_of_two_sessions_are_not_compared_as_if_they_were_measured_in_the_same_rounds() {
    let with = |kernels: &str, name: &str, session: u32, ms: f64| {
        let record = measured("a", name, 8, ms);
        Record {
            kernels_of: Some(kernels.into()),
            key: format!("{name} {kernels}"),
            threads: Some(2),
            sample_launches: record.sample_launches.iter().map(|launch| launch + 2 * session).collect(),
            ..record
        }
    };
    let run = |slower: f64| {
        let of_session = |(session, kernels, ms): (u32, &'static str, f64)| {
            ["naive", "wide"].map(|name| with(kernels, name, session, ms))
        };
        folder("run", [(0, "old", 1.0), (1, "new", slower)].map(of_session).concat())
    };
    let comparison = Comparison::of_kernels(&run(1.04), 0.02);
    assert_eq!(comparison.pairs.len(), 2);
    assert!(comparison.pairs.iter().all(|pair| matches!(pair.change, Some((_, Against::BareTimes)))));
    assert_eq!(comparison.regressions(0.0), Vec::<String>::new());
    let notes = &comparison.notes;
    assert!(matches!(&notes[..], [note] if note.contains("in an earlier session")), "{notes:?}");
    let regressions = Comparison::of_kernels(&run(2.0), 0.02).regressions(5.0);
    assert!(
        regressions.iter().any(|line| line.starts_with("all points together are 100.0% slower")),
        "{regressions:?}"
    );
}

/// If a run compares two folders of kernels, a point's name ends with the folder of its kernels. The message
/// on a regression names the pair of compared points without the folder, because the kernels of the two
/// points are from different folders.
#[test]
fn a_regression_does_not_name_the_old_folder_of_kernels() {
    let with = |kernels: &str, ms| Record {
        name: format!("naive ({kernels})"),
        kernels_of: Some(kernels.into()),
        ..timed("a", "naive", ms)
    };
    let comparison = Comparison::of_kernels(&folder("run", vec![with("old", 10.0), with("new", 20.0)]), 0.02);
    let regressions = comparison.regressions(5.0);
    assert!(regressions[0].starts_with("all points together are 100.0% slower"), "{regressions:?}");
    assert!(regressions[1].starts_with("teapot 800 x 500, naive 8x8 is 100.0% slower"), "{regressions:?}");
}

/// Each of the two runs measured the kernels of two folders. In the second run, the kernels of one folder are slower.
#[test]
fn points_of_two_runs_are_named_with_the_folder_of_their_kernels() {
    let of_folder = |name: &str, kernels: &str, side: u32, ms: f64| Record {
        kernels_of: Some(kernels.into()),
        ..measured("a", &format!("{name} ({kernels})"), side, ms)
    };
    let run = |label: &str, slower: f64| {
        let both =
            |side: u32| [of_folder("naive", "old", side, 5.0), of_folder("naive", "new", side, slower)];
        let only = of_folder("wide", label, 8, 2.0);
        folder(label, [&both(4)[..], &both(8), &[only, timed("host", "serial", 100.0)]].concat())
    };
    let comparison = of(&run("one", 6.0), &run("two", 18.0));
    let names: Vec<String> = comparison.lines().into_iter().map(|line| line.point).collect();
    let named = |side: u32, kernels: &str| format!("teapot 800 x 500, naive ({kernels}) {side}x{side}");
    assert_eq!(names[..4], [named(4, "old"), named(4, "new"), named(8, "old"), named(8, "new")]);
    let wide = ["one", "two"].map(|run| format!("teapot 800 x 500, wide ({run}) 8x8: only in {run}"));
    assert_eq!(comparison.others, wide);
    let lost = comparison.lost_points().expect("the first run's point is lost");
    assert!(lost.contains("wide (one) 8x8"), "{lost}");
    let regressions = comparison.regressions(5.0);
    let of_new = "naive (new) at its 2 points is 200.0% slower";
    assert!(regressions.iter().any(|line| line.starts_with(of_new)), "{regressions:?}");
    assert!(
        regressions.iter().all(|line| !line.contains("4 points") && !line.contains("(old)")),
        "{regressions:?}"
    );
}

#[test]
fn points_are_named_with_their_device_where_there_are_several() {
    let run = |devices: &[&str]| {
        let kernels = devices.iter().map(|device| timed(device, "naive", 10.0));
        kernels.chain([timed("host", "serial", 100.0)]).collect::<Vec<_>>()
    };
    let compared = |devices: &[&str]| of(&folder("old", run(devices)), &folder("new", run(devices)));
    let [one, two] = [compared(&["a"]), compared(&["a", "b"])];
    // The host, which measures the baselines, does not count as a second device.
    assert_eq!([one.has_several_devices(), two.has_several_devices()], [false, true]);
    let kernel = &two.pairs[0];
    assert_eq!(kernel.point(true), "teapot 800 x 500, naive 8x8, a");
    assert_eq!(kernel.point(false), "teapot 800 x 500, naive 8x8");
    let baseline = two.pairs.iter().find(|pair| pair.before.is_baseline()).expect("a baseline");
    assert_eq!(baseline.point(true), baseline.point(false));
}

#[test]
fn points_are_named_with_their_device_if_one_of_the_folders_has_several() {
    let run = |label: &str, devices: &[&str]| {
        folder(label, devices.iter().map(|device| timed(device, "naive", 10.0)).collect())
    };
    let (one, two) = (run("one", &["a"]), run("two", &["a", "b"]));
    for comparison in [of(&one, &two), of(&two, &one)] {
        assert!(comparison.has_several_devices());
        assert_eq!(comparison.others, ["teapot 800 x 500, naive 8x8, b: only in two"]);
    }
}

/// The test covers a point that fails on one of two devices, on both devices, or on the only device of a folder, and
/// points that one of the folders lacks.
#[test]
fn points_that_are_not_compared_are_named_with_their_device_too() {
    let fails = |device: &str| infeasible(device, "naive", 8, "no");
    let [on_a, on_b] = ["a", "b"].map(|device| timed(device, "naive", 10.0));
    let compared = |before: &[&Record], after: &[&Record]| {
        let records = |all: &[&Record]| all.iter().map(|record| (*record).clone()).collect::<Vec<_>>();
        of(&folder("old", records(before)), &folder("new", records(after)))
    };
    let line = |device: &str| format!("teapot 800 x 500, naive 8x8, {device}: was measured, is infeasible");
    let one = compared(&[&on_a, &on_b], &[&on_a, &fails("b")]);
    assert_eq!((one.others.clone(), one.regressions(5.0)), (vec![line("b")], vec![line("b")]));
    assert!(one.has_several_devices());
    let both = compared(&[&on_a, &on_b], &[&fails("a"), &fails("b")]);
    assert_eq!(both.others, [line("a"), line("b")]);
    let absent = compared(&[&on_a, &on_b], &[&on_a, &timed("c", "naive", 10.0)]);
    let only = ["b: only in old", "c: only in new"].map(|end| format!("teapot 800 x 500, naive 8x8, {end}"));
    assert_eq!(absent.others, only);
    // Two devices of different names are compared if each folder has only one device, so the names of points do not
    // include a device.
    let single = compared(&[&on_a], &[&fails("b")]);
    assert_eq!(single.others, ["teapot 800 x 500, naive 8x8: was measured, is infeasible"]);
}

#[test]
fn a_page_lists_what_is_not_compared_only_if_there_is_something_and_states_the_threshold() {
    let (naive, wide) = (timed("a", "naive", 10.0), timed("a", "wide", 10.0));
    let page = |after: Vec<Record>, threshold: f64| {
        let before = folder("old", vec![naive.clone(), wide.clone()]);
        Comparison::of(&before, &folder("new", after), threshold, false).markdown()
    };
    let whole = page(vec![naive.clone(), wide.clone()], 0.005);
    assert!(!whole.contains("Not compared"), "{whole}");
    assert!(whole.contains("a decrease (or an increase) of more than 0.5%."), "{whole}");
    let part = page(vec![naive.clone()], 0.02);
    assert!(part.contains("\nNot compared:\n\n- ") && part.contains("only in old"), "{part}");
    assert!(part.contains("a decrease (or an increase) of more than 2%."), "{part}");
}

#[test]
fn devices_correspond_by_name_in_any_order() {
    let (one, other) = (timed("a", "naive", 10.0), timed("b", "naive", 20.0));
    let before = folder("old", vec![one.clone(), other.clone()]);
    let comparison = Comparison::of(&before, &folder("new", vec![other, one]), 0.02, true);
    assert_eq!(comparison.summary(), "0 faster, 0 slower, 2 same, 0 unclear");
    assert!(comparison.pairs.iter().all(|pair| pair.before.device == pair.after.device));
}

#[test]
fn a_pair_is_written_in_json_and_in_a_table_with_the_first_folder_first() {
    let before = Folder { notes: vec!["a note".into()], ..folder("old", vec![timed("a", "naive", 10.0)]) };
    let after = Folder { notes: vec!["another".into()], ..folder("new", vec![timed("b", "naive", 20.0)]) };
    let comparison = Comparison::of(&before, &after, 0.02, true);
    let line = serde_json::to_value(&comparison.lines()[0]).unwrap();
    for (key, expected) in [
        ("point", serde_json::json!("teapot 800 x 500, naive 8x8")),
        ("scene", serde_json::json!("teapot")),
        ("image_size", serde_json::json!([800, 500])),
        ("device", serde_json::json!(["a", "b"])),
        ("name", serde_json::json!("naive")),
        ("local_size", serde_json::json!([8, 8])),
        ("median_ms", serde_json::json!([10.0, 20.0])),
        ("against", serde_json::json!("bare-times")),
        ("verdict", serde_json::json!("slower")),
    ] {
        assert_eq!(line[key], expected, "{key}: {line}");
    }
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let [low, middle, high] =
        [&line["interval_percent"][0], &line["change_percent"], &line["interval_percent"][1]].map(number);
    assert!((middle - 100.0).abs() < 1e-6 && 0.0 < low && low < middle && middle < high, "{line}");
    let markdown = comparison.markdown();
    for part in [
        "# new against old\n",
        "| point | old, ms | new, ms | change | verdict |\n",
        "| teapot 800 x 500, naive 8x8 | 10.00 | 20.00 | +100.0% (",
        "\nNote: old: a note\n",
        "\nNote: new: another\n",
        "\nNote: Plain times are compared",
    ] {
        assert!(markdown.contains(part), "{part:?} is not in\n{markdown}");
    }
}

#[test]
fn notes_tell_what_changes_are_relative_to() {
    let about =
        |comparison: &Comparison, what: &str| comparison.notes.iter().any(|note| note.starts_with(what));
    let starts = ["Changes are relative to work that is the same", "No baseline was measured", "Plain times"];
    let has_notes = |comparison: &Comparison| starts.map(|start| about(comparison, start));
    let kernels = || vec![timed("a", "naive", 10.0), timed("a", "wide", 1.0), timed("a", "bvh", 2.0)];
    let with_host = || [kernels(), vec![timed("host", "serial", 100.0)]].concat();
    let hosts = of(&folder("old", with_host()), &folder("new", with_host()));
    assert_eq!(has_notes(&hosts), [true, false, false]);
    assert_eq!(has_notes(&of(&folder("old", kernels()), &folder("new", kernels()))), [false, true, false]);
    let bare = Comparison::of(&folder("old", kernels()), &folder("new", kernels()), 0.02, true);
    assert_eq!(has_notes(&bare), [false, false, true]);
    let anchor = anchored("a", 1.0, |_| 1.0);
    assert_eq!(has_notes(&of(&anchor, &anchor)), [true, false, false]);
}

/// Returns a folder with an anchor, as [`anchored`] does, and a baseline with the key `key`.
fn with_baseline(key: &str, slow: impl Fn(&str) -> f64) -> Folder {
    let mut folder = anchored(key, 1.0, slow);
    let Record { sample_launches, samples_at_ms, .. } = folder.records[0].clone();
    let samples_ms = vec![100.0; sample_launches.len()];
    let host = timed("host", "serial", 100.0);
    let host = Record { key: key.into(), sample_launches, samples_at_ms, samples_ms, ..host };
    folder.records = judged([folder.records, vec![host]].concat());
    folder
}

/// The key of a record depends on settings such as the seed, so the only baseline has different keys in runs
/// with different seeds. The kernels cannot show how the speed of the host changed: if the kernels became
/// faster, the baseline would seem to be slower.
#[test]
fn a_baseline_is_not_relative_to_kernels() {
    let comparison = of(&with_baseline("seed 1", |_| 1.0), &with_baseline("seed 2", |_| 0.5));
    assert_eq!(comparison.summary(), "4 faster, 0 slower, 0 same, 0 unclear, 1 not comparable");
    assert_eq!(comparison.regressions(5.0), Vec::<String>::new());
}

/// The second device has no anchor, unlike the first.
#[test]
fn only_kernels_without_a_baseline_and_an_anchor_are_said_to_be_relative_to_others() {
    let run = |label: &str| {
        let one = anchored(label, 1.0, |_| 1.0);
        let mut both = and(one.clone(), one, 0, "another");
        both.anchors.retain(|anchor| anchor.device == "gpu");
        both
    };
    let comparison = of(&run("old"), &run("new"));
    let notes = comparison.notes;
    let note = notes.iter().find(|note| note.starts_with("No baseline was measured")).unwrap();
    let names = [("naive", 4), ("naive", 8), ("wide", 4), ("wide", 8)]
        .map(|(name, side)| format!("room 800 x 500, {name} {side}x{side}, another"));
    let part = format!("as these points: {}. Their changes are", names.join("; "));
    assert!(note.contains(&part), "{note}");
}

#[test]
fn runs_whose_processors_were_at_different_distances_say_so() {
    let at = |label: &str, ns: f64| {
        let records = vec![timed("a", "naive", 10.0)];
        let launch = records[0].sample_launches.first().copied().unwrap_or(0);
        let line = RoundLoad { launch, core_to_core_ns: Some(ns), ..RoundLoad::default() };
        Folder { rounds: vec![line; 3], ..folder(label, records) }
    };
    let said = |before: f64, after: f64| {
        let notes = of(&at("old", before), &at("new", after)).notes;
        notes.into_iter().find(|note| note.starts_with("The core-to-core latency"))
    };
    let part = "was 23 ns in old and 180 ns in new";
    assert!(said(23.0, 180.0).is_some_and(|note| note.contains(part)));
    assert!(said(180.0, 23.0).is_some() && said(20.0, 31.0).is_some());
    assert_eq!([said(20.0, 30.0), said(180.0, 190.0)], [None, None]);
}

#[test]
fn a_point_that_fails_now_is_a_regression_and_one_that_failed_before_is_none() {
    let fails = |name: &str| infeasible("a", name, 8, "no");
    let before = folder("old", vec![timed("a", "naive", 10.0), fails("wide"), fails("bvh")]);
    let after = folder("new", vec![fails("naive"), timed("a", "wide", 1.0), fails("bvh")]);
    let comparison = of(&before, &after);
    let [broken, mended] = [
        "teapot 800 x 500, naive 8x8: was measured, is infeasible",
        "teapot 800 x 500, wide 8x8: was infeasible, is measured",
    ];
    assert_eq!(
        (comparison.others.clone(), comparison.regressions(5.0)),
        (vec![broken.into(), mended.into()], vec![broken.into()])
    );
    // Even if no point was measured in both folders, the point that fails now is a regression.
    let all = of(&folder("old", vec![timed("a", "naive", 10.0)]), &folder("new", vec![fails("naive")]));
    assert_eq!((all.has_points_in_common(), all.regressions(5.0)), (true, vec![broken.into()]));
    let never = of(&folder("old", vec![fails("bvh")]), &folder("new", vec![fails("bvh")]));
    assert!(!never.has_points_in_common());
}

#[test]
fn kernels_are_compared_only_with_those_of_the_same_point() {
    let with = |kernels: &str, side: u32, ms: f64| {
        let record = measured("a", "naive", side, ms);
        Record { kernels_of: Some(kernels.into()), key: format!("{kernels} {side}"), ..record }
    };
    let room = Record { scene: "room".into(), key: "room".into(), ..with("new", 8, 3.0) };
    let small = Record { image_size: [80, 50], key: "small".into(), ..with("new", 8, 4.0) };
    let same = Record { kernels_of: None, ..measured("a", "wide", 8, 5.0) };
    let run = folder(
        "run",
        vec![with("old", 4, 1.0), with("old", 8, 2.0), room, small, same, with("new", 8, 20.0)],
    );
    let comparison = Comparison::of_kernels(&run, 0.02);
    let times: Vec<_> =
        comparison.pairs.iter().map(|pair| (median(&pair.before), median(&pair.after))).collect();
    assert_eq!(times, [(Some(2.0), Some(20.0))]);
    assert!(comparison.pairs.iter().all(|pair| matches!(pair.change, Some((_, Against::SameRounds)))));
    let none = Comparison::of_kernels(&folder("run", vec![timed("a", "naive", 1.0)]), 0.02);
    assert!(none.notes[0].contains("compile to the same programs"), "{:?}", none.notes);
}

#[test]
fn the_plot_has_the_first_folder_across_and_a_colour_for_each_verdict() {
    let before = [("naive", 4, 10.0), ("naive", 8, 20.0), ("wide", 4, 90.0), ("bvh", 4, 40.0)];
    let of = |records: [(&str, u32, f64); 4], ms: Option<f64>| {
        records.map(|(name, side, own)| measured("a", name, side, ms.unwrap_or(own))).to_vec()
    };
    let comparison =
        Comparison::of(&folder("old", of(before, None)), &folder("new", of(before, Some(40.0))), 0.02, true);
    assert_eq!(comparison.summary(), "1 faster, 2 slower, 1 same, 0 unclear");
    let plot = comparison.plot();
    let (svg, caption) = (&plot.svg, &plot.caption);
    assert!(caption.contains("equal times, new is faster; above this line, old is faster."), "{caption}");
    assert!(svg.contains("<desc>new: median ms against old: median ms</desc>"), "{svg}");
    // In the plot, green means faster, vermilion means slower, and blue means the same.
    for (class, name) in [("s2", "faster (1)"), ("s1", "slower (2)"), ("s0", "same (1)")] {
        let entry = svg.split(&format!("class=\"entry {class}\"")).nth(1).unwrap_or_default();
        assert!(entry.split("</g>").next().is_some_and(|entry| entry.contains(name)), "{name}: {svg}");
    }
    let slower = svg.split("class=\"series s1\"").nth(1).unwrap();
    let positions: Vec<[f64; 2]> = slower
        .split("class=\"dot\"")
        .skip(1)
        .take(2)
        .filter_map(|dot| {
            let (x, y) = dot.split(" d=\"M").nth(1)?.split('L').next()?.split_once(' ')?;
            Some([x.parse().ok()?, y.parse().ok()?])
        })
        .collect();
    assert!(positions[0][0] < positions[1][0] && positions[0][1] == positions[1][1], "{positions:?}");
    let bar =
        slower.split("class=\"interval\" d=\"M").nth(1).and_then(|rest| rest.split('M').next()).unwrap();
    let (low, high) = bar.split_once(' ').and_then(|(_, ends)| ends.split_once('V')).unwrap();
    let [low, high] = [low, high].map(|end| end.parse::<f64>().unwrap());
    assert!(
        high < positions[0][1] && positions[0][1] < low,
        "the interval of the second time: {bar} {positions:?}"
    );
}
