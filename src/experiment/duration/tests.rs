//! Tests of the predicted duration of a run.

use super::*;
use crate::device::DeviceInfo;
use crate::experiment::fixtures;
use crate::launch::FrameTimes;
use crate::measure::StopReason;
use crate::record::LaunchEnd;

/// The earlier times of three points. The first two of the three points were sampled four times per launch.
/// The number of rounds of the third point in `POINTS` is unknown, so the estimate assumes four rounds for
/// the third point too.
const POINTS: [Known; 3] = [
    Known { sample_ms: 2.0, check_ms: [10.0, 300.0], rounds: Some(4) },
    Known { sample_ms: 5.0, check_ms: [20.0, 400.0], rounds: Some(4) },
    Known { sample_ms: 13.0, check_ms: [70.0, 100.0], rounds: None },
];

/// Returns the expected time of the points in [`POINTS`], in `launches` launches. In each launch, each point casts
/// at most `warmup` warm-up frames.
fn group_ms(launches: u32, warmup: u32) -> f64 {
    let timing = format!("timing = {{ launches = {launches}, warmup = {warmup}, time_limit_ms = 30 }}");
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    fixtures::run(&experiment, &[], &fixtures::own_locks()).group_ms(&POINTS, launches as usize)
}

#[test]
fn every_launch_checks_its_points_and_only_the_first_compares_them_with_the_reference() {
    // A launch consists of the start of a worker, the checks of the points, and four rounds of 20 ms
    // each. The value `launch_ms` does not include the checks. The checks take 800 ms in the first
    // launch, and 100 ms in each later launch.
    let launch_ms = START_MS + 4.0 * 20.0;
    assert_eq!(group_ms(1, 0), launch_ms + 800.0);
    assert_eq!(group_ms(3, 0), 3.0 * launch_ms + 800.0 + 2.0 * 100.0);
}

#[test]
fn a_group_takes_at_most_twice_its_launches_with_twice_their_rounds_and_waits() {
    let timing = "timing = { launches = 3, warmup = 0, time_limit_ms = 30 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    let locks = fixtures::own_locks();
    let run = fixtures::run(&experiment, &[], &locks);
    // In the worst case, additional launches replace all three launches of the group. An additional launch
    // consists of the start of a worker, the checks (100 ms) and four rounds of 20 ms. Each of the six
    // launches may take four more rounds, and wait for half the time of all eight rounds.
    let replaced_ms = 3.0 * (START_MS + 100.0 + 80.0);
    assert_eq!(run.most_additional_ms(&POINTS, 3), replaced_ms + 6.0 * 160.0);
    assert_eq!(run.most_additional_ms(&POINTS, 1), replaced_ms + 4.0 * 160.0);
    assert_eq!(run.most_additional_ms(&[], 3), 0.0);
}

#[test]
fn additional_launches_are_said_beside_the_expected_time() {
    let minutes = |n: u64| Duration::from_secs(60 * n + 5);
    let expected = Expected { points: 2, known: 2, launches: 3, time: minutes(4), ..Expected::default() };
    assert_eq!(expected.to_string(), "2 points in 3 launches: about 4m 5s, based on earlier times");
    let additional = Expected { additional: minutes(3), ..expected }.to_string();
    let more = "(up to 3m 5s more if samples must be repeated)";
    assert_eq!(additional, format!("2 points in 3 launches: about 4m 5s {more}, based on earlier times"));
}

#[test]
fn the_time_is_known_only_if_every_point_was_measured_before() {
    let is_known = |(points, known)| Expected { points, known, ..Expected::default() }.is_known();
    assert_eq!([(0, 0), (2, 0), (2, 1), (2, 2)].map(is_known), [false, false, false, true]);
}

#[test]
fn finished_points_that_are_not_in_the_plan_are_said() {
    let of = |others| Expected { points: 2, launches: 3, least_frames: 15, others, ..Expected::default() };
    let plan =
        "2 points in 3 launches: the duration is unknown; measuring each point takes at least 15 frames";
    assert_eq!(of(0).to_string(), plan);
    let one = "1 record in this folder is of an earlier plan; it is kept, but not shown";
    assert_eq!(of(1).to_string(), format!("{plan}\n{one}"));
    let two = "2 records in this folder are of earlier plans; they are kept, but not shown";
    assert_eq!(of(2).to_string(), format!("{plan}\n{two}"));
    let finished = Expected { points: 0, ..of(2) };
    assert_eq!(finished.to_string(), format!("no point is left to measure\n{two}"));
}

/// Both folders have the built-in kernels. The baseline uses no kernels.
#[test]
fn a_point_with_the_same_program_in_both_folders_of_kernels_is_counted_once_and_said() {
    let experiment = fixtures::experiment("baselines = ['serial']\nlocal_sizes = [4, 8]");
    let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let one_folder = fixtures::run(&experiment, &devices, &locks);
    let expected = |run: &Run<'_>| run.expected(&[], &Past::default()).unwrap();
    assert_eq!((expected(&one_folder).points, expected(&one_folder).of_both_folders), (3, 0));
    let two_folders = Run { other_sources: Some(&crate::program::Sources::Embedded), ..one_folder };
    let both = expected(&two_folders);
    assert_eq!((both.points, both.of_both_folders), (3, 2));
    let said = both.to_string();
    assert!(
        said.ends_with("\n2 points have the same programs in both folders of kernels, and are measured once"),
        "{said}"
    );
    let one = Expected { of_both_folders: 1, ..both }.to_string();
    assert!(
        one.ends_with("\n1 point has the same program in both folders of kernels, and is measured once"),
        "{one}"
    );
}

#[test]
fn samples_that_are_left_out_took_time_too() {
    let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 3 }");
    let of = |count, preempted_samples, moved_samples| {
        let record = Record {
            samples_ms: vec![1.0; count],
            preempted_samples,
            moved_samples,
            host_median_ms: Some(1.0),
            image_size: [8, 5],
            ..Record::default()
        };
        let known = fixtures::run(&experiment, &[], &fixtures::own_locks()).known(&record, &record);
        known.and_then(|known| known.rounds)
    };
    let known =
        [of(30, None, None), of(30, Some(0), Some(0)), of(21, Some(9), None), of(17, Some(9), Some(4))];
    assert_eq!(known, [Some(10); 4]);
}

#[test]
fn one_point_and_one_frame_are_in_the_singular() {
    let expected = |points, least_frames| {
        Expected { points, launches: 3, least_frames, ..Expected::default() }.to_string()
    };
    let unknown = "in 3 launches: the duration is unknown; measuring each point takes at least";
    assert_eq!(expected(1, 1), format!("1 point {unknown} 1 frame"));
    assert_eq!(expected(2, 15), format!("2 points {unknown} 15 frames"));
}

/// The device in this test is a GPU, and the preset `wide` is meant for CPUs.
#[test]
fn a_point_for_another_kind_of_device_takes_no_time_and_is_no_control_point() {
    let lines = "baselines = ['serial']\nlocal_sizes = [4]\n[[strategy]]\npreset = 'wide'";
    let experiment = fixtures::experiment(lines);
    let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let expected = run.expected(&[], &Past::default()).unwrap();
    assert_eq!((expected.points, expected.known), (2, 0), "the caster on the host and `naive`");
    let plan = run.plan();
    let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
    let [host, naive, wide] =
        [0, 1, 2].map(|index| groups.iter().flatten().nth(index).unwrap().record.clone());
    let of = |earlier: &[Record]| -> Vec<(usize, f64, bool)> {
        let costs = run.costs(earlier).unwrap().concat();
        costs.iter().map(|cost| (cost.point, cost.ms, cost.may_control)).collect()
    };
    let guesses = of(&[]);
    let seen: Vec<_> = guesses.iter().map(|(point, _, may_control)| (*point, *may_control)).collect();
    assert_eq!(seen, [(0, true), (1, true), (2, false)]);
    // A point that is skipped takes less time than any point whose program is compiled.
    assert!(guesses[2].1 < guesses[1].1, "{guesses:?}");
    // A point that failed may fail again, so it must not become a block's control point.
    let failed = Record { outcome: Outcome::Crashed, ..naive.clone() };
    let measured = Record { outcome: Outcome::Measured, host_median_ms: Some(1e6), ..host };
    let known = of(&[failed, measured, wide]);
    assert_eq!([known[0].2, known[1].2], [true, false]);
    assert!(known[0].1 > 1e6 && guesses[0].1 < 1e6, "{known:?}");
}

/// The imitated device has too little `__local` memory for the preset `local-vectors`. The loop tests two cases:
/// no earlier run, and an earlier run that measured both points, for example on another device of the same name.
#[test]
fn a_point_that_does_not_fit_takes_no_time_and_is_no_control_point() {
    let lines = "local_sizes = [4]\n[[strategy]]\npreset = 'local-vectors'\n[emulate]\nlocal_bytes = 100";
    let (both, naive) = (fixtures::experiment(lines), fixtures::experiment("local_sizes = [4]"));
    let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let [both, alone] = [&both, &naive].map(|experiment| fixtures::run(experiment, &devices, &locks));
    let plan = both.plan();
    let groups = both.pending_points(&plan, &plan.by_device()).unwrap();
    let measured = |pending: &PendingPoint| Record {
        outcome: Outcome::Measured,
        host_median_ms: Some(1000.0),
        samples_ms: vec![1000.0; 20],
        ..pending.record.clone()
    };
    let known: Vec<Record> = groups.iter().flatten().map(measured).collect();
    for earlier in [Vec::new(), known] {
        let expected = |run: &Run<'_>| run.expected(&earlier, &Past::default()).unwrap();
        assert_eq!((expected(&both).points, expected(&both).most), (1, expected(&alone).most));
        let costs = both.costs(&earlier).unwrap().concat();
        let [naive, local] = &costs[..] else { panic!("{costs:?}") };
        assert!(naive.may_control && naive.ms > 0.0, "{naive:?}");
        assert!(!local.may_control && local.ms == 0.0, "{local:?}");
    }
}

/// A baseline casts only one sample per pixel, so it is refused at once if the scene has several samples.
#[test]
fn a_baseline_that_cannot_cast_the_samples_takes_no_time_and_is_no_control_point() {
    let costs_of = |samples: u32| {
        let experiment = fixtures::experiment_of(&format!(
            "strategies = ['naive']\nbaselines = ['serial']\nlocal_sizes = [4]\n[[scene]]\n\
             file = 'scenes/triangle.toml'\nsamples = [{samples}]"
        ));
        let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let costs = run.costs(&[]).unwrap().concat();
        costs.iter().map(|cost| (cost.ms > 0.0, cost.may_control)).collect::<Vec<_>>()
    };
    assert_eq!(costs_of(1), [(true, true), (true, true)]);
    assert_eq!(costs_of(4), [(false, false), (true, true)]);
}

/// The points of a group have the same workers, so the start of workers is no part of a point's own time.
#[test]
fn the_cost_of_a_point_is_the_time_of_all_its_launches_without_the_starts_of_workers() {
    let cost_ms = |launches: u32| {
        let timing = format!("timing = {{ launches = {launches}, warmup = 0 }}");
        let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
        let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
        let devices = [&device];
        let run = fixtures::run(&experiment, &devices, &locks);
        let plan = run.plan();
        let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
        let measured = |pending: &PendingPoint| Record {
            outcome: Outcome::Measured,
            host_median_ms: Some(1000.0),
            samples_ms: vec![1000.0; 5 * launches as usize],
            ..pending.record.clone()
        };
        let earlier: Vec<Record> = groups.iter().flatten().map(measured).collect();
        let [cost] = run.costs(&earlier).unwrap().concat()[..] else { panic!("one point") };
        (cost.ms, cost.start_ms)
    };
    // A launch consists of the start of a worker, a check with one frame, and five rounds.
    let launch_ms = 6.0 * 1000.0;
    assert_eq!([cost_ms(1), cost_ms(3)], [(launch_ms, START_MS), (3.0 * launch_ms, 3.0 * START_MS)]);
}

/// Each of the two devices measures all points with kernels. The baseline, which runs on the host, is measured once.
#[test]
fn the_cost_of_a_point_is_the_sum_of_its_times_on_all_devices() {
    let timing = "timing = { launches = 1, warmup = 0 }";
    let lines = format!("baselines = ['serial']\nlocal_sizes = [4, 8]\n{timing}");
    let experiment = fixtures::experiment(&lines);
    let [one, two] = ["one", "two"]
        .map(|label| DeviceInfo { label: label.into(), ..crate::experiment::asleep::device(1.0) });
    let (devices, locks) = ([&one, &two], fixtures::own_locks());
    let run = fixtures::run(&experiment, &devices, &locks);
    let plan = run.plan();
    let groups = run.pending_points(&plan, &plan.by_device()).unwrap();
    let frame_ms = |record: &Record| match record.device.as_str() {
        "one" => 1000.0,
        "two" => 3000.0,
        _ => 10_000.0,
    };
    let measured = |pending: &PendingPoint| Record {
        outcome: Outcome::Measured,
        host_median_ms: Some(frame_ms(&pending.record)),
        samples_ms: vec![frame_ms(&pending.record); 5],
        ..pending.record.clone()
    };
    let mut earlier: Vec<Record> = groups.iter().flatten().map(measured).collect();
    // A launch consists of the start of a worker, a check with one frame, and five rounds.
    let launch_ms = |frame_ms: f64| 6.0 * frame_ms;
    let both_ms = launch_ms(1000.0) + launch_ms(3000.0);
    let costs = |earlier: &[Record]| run.costs(earlier).unwrap();
    let points: Vec<Vec<_>> = costs(&earlier)
        .iter()
        .map(|group| group.iter().map(|cost| (cost.point, cost.ms)).collect())
        .collect();
    assert_eq!(points, [vec![(0, launch_ms(10_000.0))], vec![(1, both_ms), (2, both_ms)]]);
    let starts_ms: Vec<f64> = costs(&earlier).concat().iter().map(|cost| cost.start_ms).collect();
    assert_eq!(starts_ms, [START_MS, 2.0 * START_MS, 2.0 * START_MS], "each device has its own worker");
    // A point that failed on one of the devices may fail again, so it must not become a control point.
    let last = earlier.last_mut().unwrap();
    assert_eq!(last.device, "two");
    last.outcome = Outcome::Crashed;
    let may_control: Vec<bool> = costs(&earlier).concat().iter().map(|cost| cost.may_control).collect();
    assert_eq!(may_control, [true, true, false]);
    // If the devices share the points (`spread`), only one of them measures each point.
    let shared = Run { spread: true, ..fixtures::run(&experiment, &devices, &locks) };
    assert_eq!(shared.costs(&earlier).unwrap()[1][0].ms, launch_ms(1000.0));
}

#[test]
fn a_control_point_is_measured_again_only_beside_unfinished_points_of_its_block() {
    let pending = |key: &str, is_control| {
        let record = Record { key: key.into(), control: Some("c".into()), is_control, ..Record::default() };
        PendingPoint::new([0; 3], String::new(), record)
    };
    let keys = |group: &[PendingPoint], done: &[&str]| {
        let done: HashSet<String> = done.iter().map(|key| (*key).to_owned()).collect();
        let (own, again) = left(group, &done);
        [own, again].map(|points| points.iter().map(|one| one.record.key.as_str()).collect::<String>())
    };
    let lends = [pending("c", false), pending("a", false)];
    assert_eq!([keys(&lends, &[]), keys(&lends, &["c"])], [["ca", ""], ["a", "c"]]);
    let borrows = [pending("c", true), pending("b", false)];
    assert_eq!([keys(&borrows, &["c"]), keys(&borrows, &["c", "b"])], [["b", "c"], ["", ""]]);
}

#[test]
fn devices_that_share_the_points_measure_them_at_the_same_time() {
    let lines = "local_sizes = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]\ntiming = { launches = 2 }";
    let experiment = fixtures::experiment(lines);
    let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
    let devices = [&device, &device];
    let alone = fixtures::run(&experiment, &devices[..1], &locks);
    let plan = alone.plan();
    let groups = alone.pending_points(&plan, &plan.by_device()).unwrap();
    let measured = |pending: &PendingPoint| Record {
        outcome: Outcome::Measured,
        host_median_ms: Some(1000.0),
        samples_ms: vec![1000.0; 10],
        ..pending.record.clone()
    };
    let earlier: Vec<Record> = groups.iter().flatten().map(measured).collect();
    let blocks = crate::experiment::cut(&alone.costs(&earlier).unwrap(), 2);
    assert!(blocks.iter().any(crate::experiment::Block::borrows_control), "{blocks:?}");
    let shared =
        Run { spread: true, blocks: Some(&blocks[..]), ..fixtures::run(&experiment, &devices, &locks) };
    let of_earlier_plan = Record { key: "of an earlier plan".into(), ..Record::default() };
    let past = Past { records: vec![of_earlier_plan], ..Past::default() };
    let expected = |run: &Run<'_>| run.expected(&earlier, &past).unwrap();
    let (alone, shared) = (expected(&alone), expected(&shared));
    assert_eq!((alone.points, alone.known, alone.others), (12, 12, 1));
    assert_eq!((shared.points, shared.known, shared.others), (12, 12, 1));
    // One of the two devices measures seven points: the six points of its own block, and the control
    // point of the other block.
    let share = shared.time.as_secs_f64() / alone.time.as_secs_f64();
    assert!((0.5..0.7).contains(&share), "{share}: {blocks:?}");
    // Groups on the host are measured while no other group is measured, and a group is not divided.
    let mut groups = Together::default();
    for (is_on_host, ms) in [(true, 5.0), (false, 6.0), (false, 1.0), (false, 2.0)] {
        groups.add(is_on_host, ms);
    }
    assert_eq!([1, 2, 0].map(|devices| groups.ms_on(devices)), [14.0, 11.0, 14.0]);
}

#[test]
fn launches_that_are_complete_are_not_expected_again() {
    let timing = "timing = { launches = 4, min_samples = 20, max_samples = 20 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4, 8]\n{timing}"));
    let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let groups = run.pending_points(&run.plan(), &run.plan().whole()).unwrap();
    let timed = |pending: &PendingPoint| Record {
        outcome: Outcome::Measured,
        host_median_ms: Some(1000.0),
        samples_ms: vec![1000.0; 20],
        ..pending.record.clone()
    };
    let earlier: Vec<Record> = groups.iter().flatten().map(timed).collect();
    let times = FrameTimes::whole(1.0, 1.0);
    let sample = |launch: u32| Taken { launch, at_ms: 0.0, core_to_core_ns: None, times };
    // In the last launch of `launches`, the second point lacks one sample.
    let expected = |launches: &[u32]| {
        let all: Vec<Taken> =
            launches.iter().flat_map(|launch| std::iter::repeat_n(sample(*launch), 5)).collect();
        let fewer = all[..all.len().saturating_sub(1)].to_vec();
        let keys = earlier.iter().map(|record| record.key.clone());
        let samples: HashMap<String, Vec<Taken>> = keys.zip([all, fewer]).collect();
        let past = Past { samples, ..Past::default() };
        let of = |earlier: &[Record]| run.expected(earlier, &past).unwrap();
        (of(&earlier).time.as_secs_f64(), of(&[]).least_frames)
    };
    let (all_s, frames) = expected(&[]);
    let (half_s, frames_of_half) = expected(&[3, 5, 6]);
    assert!((half_s / all_s - 0.5).abs() < 1e-6, "{half_s} of {all_s} s");
    assert_eq!([frames, frames_of_half], [20, 10]);
    // Even if earlier sessions have taken all samples, the points are checked once more, in one launch.
    let (least_s, _) = expected(&[0, 1, 2, 3, 4, 5, 6]);
    assert!((least_s / all_s - 0.25).abs() < 1e-6, "{least_s} of {all_s} s");
}

#[test]
fn a_launch_that_was_interrupted_is_expected_again() {
    let timing = "timing = { launches = 4, min_samples = 400, max_samples = 400, time_limit_ms = 10000 }";
    let experiment = fixtures::experiment(&format!("local_sizes = [4]\n{timing}"));
    let (device, locks) = (crate::experiment::asleep::device(1.0), fixtures::own_locks());
    let devices = [&device];
    let run = fixtures::run(&experiment, &devices, &locks);
    let [(_, _, point)] = &run.planned_points().unwrap()[..] else { panic!("one point") };
    let times = FrameTimes::whole(1.0, 1.0);
    let taken = Taken { launch: 0, at_ms: 0.0, core_to_core_ns: None, times };
    let samples = |count| HashMap::from([(point.key.clone(), vec![taken; count])]);
    let frames = |past: &Past| run.expected(&[], past).unwrap().least_frames;
    let interrupted = Past { samples: samples(20), ..Past::default() };
    let complete = Past { samples: samples(100), ..Past::default() };
    assert_eq!([frames(&interrupted), frames(&complete)], [20, 15]);
    let end = LaunchEnd {
        launch: 0,
        stop_reason: StopReason::TimeLimit,
        samples: [(point.key.clone(), 20)].into(),
    };
    assert_eq!(frames(&Past { ends: HashMap::from([(0, end)]), ..interrupted }), 15);
}

#[test]
fn a_warm_up_of_long_frames_ends_early() {
    // The point with frames of 2 ms casts both of its warm-up frames. For the two points with longer frames,
    // the estimate of the warm-up is a tenth of the 30 ms limit, plus one frame.
    let warm_ms = 4.0 + (3.0 + 5.0) + (3.0 + 13.0);
    assert_eq!(group_ms(1, 2) - group_ms(1, 0), warm_ms);
}

#[test]
fn a_time_of_another_size_is_scaled_by_the_number_of_pixels() {
    let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 2 }");
    let locks = fixtures::own_locks();
    let run = fixtures::run(&experiment, &[], &locks);
    let earlier = Record {
        key: "small".into(),
        image_size: [8, 5],
        host_median_ms: Some(1.5),
        batch: Some(4),
        build_ms: Some(10.0),
        check_ms: Some(100.0),
        samples_ms: vec![1.5; 20],
        ..Record::default()
    };
    let same = run.known(&earlier, &earlier).unwrap();
    assert_eq!((same.sample_ms, same.check_ms, same.rounds), (6.0, [16.0, 100.0], Some(10)));
    let larger = Record { key: "large".into(), image_size: [16, 10], ..earlier.clone() };
    let scaled = run.known(&larger, &earlier).unwrap();
    assert_eq!((scaled.sample_ms, scaled.check_ms, scaled.rounds), (24.0, [34.0, 400.0], None));
    let smaller = Record { key: "tiny".into(), image_size: [4, 5], ..earlier.clone() };
    // A part of a check's time does not depend on the image size. For a smaller image, the time of a point's
    // first check is therefore not scaled down.
    assert_eq!(run.known(&smaller, &earlier).unwrap().check_ms, [13.0, 100.0]);
    let refused = Record { outcome: Outcome::Infeasible, host_median_ms: None, ..earlier.clone() };
    assert_eq!(run.known(&refused, &refused).unwrap().sample_ms, 0.0);
    let reason = Some("the host's memory (casting): 2 B > 1 B according to a test".to_owned());
    let lacked = Record { reason, ..refused.clone() };
    assert!(run.known(&lacked, &lacked).is_none(), "the point may fit at another moment");
    let crashed = Record { outcome: Outcome::Crashed, ..refused };
    assert!(run.known(&crashed, &crashed).is_none());
}

/// In the first case, a builder of the earlier run compiled the program for 10 s before the check. The check only
/// loaded the program, and took 100 ms.
#[test]
fn a_program_that_an_earlier_run_compiled_is_not_compiled_in_each_launch() {
    let experiment = fixtures::experiment("local_sizes = [4]\ntiming = { launches = 2, warmup = 0 }");
    let locks = fixtures::own_locks();
    let run = fixtures::run(&experiment, &[], &locks);
    let of = |build_from_cache: bool, check_ms: f64| {
        let record = Record {
            image_size: [8, 5],
            host_median_ms: Some(1.5),
            build_ms: Some(10_000.0),
            build_from_cache: Some(build_from_cache),
            check_ms: Some(check_ms),
            samples_ms: vec![1.5; 10],
            ..Record::default()
        };
        run.known(&record, &record).unwrap()
    };
    let compiled = of(false, 100.0);
    assert_eq!(compiled.check_ms, [1.5, 100.0]);
    // Each of the two launches has five rounds and a check; the first check compares pictures.
    assert_eq!(run.group_ms(&[compiled], 2), 2.0 * (START_MS + 6.0 * 1.5) + 98.5);
    assert_eq!(of(true, 10_100.0).check_ms, [10_001.5, 10_100.0], "loading takes this time in each launch");
    assert_eq!(of(false, 1.0).check_ms, [1.5, 1.5], "the first check is not shorter than later ones");
}

#[test]
fn without_a_cache_each_launch_compiles_the_program() {
    let experiment = fixtures::experiment("local_sizes = [4]");
    let locks = fixtures::own_locks();
    let run = Run { caches_programs: false, ..fixtures::run(&experiment, &[], &locks) };
    let check_ms = |build_from_cache: bool, build_ms: f64| {
        let record = Record {
            image_size: [8, 5],
            host_median_ms: Some(1.5),
            build_ms: Some(build_ms),
            build_from_cache: Some(build_from_cache),
            ..Record::default()
        };
        run.known(&record, &record).unwrap().check_ms
    };
    assert_eq!(check_ms(false, 10_000.0), [10_001.5; 2]);
    assert_eq!(check_ms(true, 20.0), [COMPILE_MS + 1.5; 2], "the earlier run only loaded the program");
}

#[test]
fn a_point_is_known_by_its_own_name_and_otherwise_by_a_timed_point_of_its_strategy() {
    let of = |side: u32, host_median_ms: Option<f64>| Record {
        name: "naive".into(),
        local_size: Some([side; 2]),
        image_size: [8, 5],
        host_median_ms,
        ..Record::default()
    };
    let earlier = [of(4, Some(1.0)), of(8, None)];
    let known = ByName::of(&earlier);
    let size = |side: u32| known.of_same(&of(side, None)).and_then(|record| record.local_size);
    assert_eq!([size(4), size(8)], [Some([4; 2]), Some([8; 2])]);
    assert_eq!(size(16), Some([4; 2]), "only this one has a time");
}

/// 10 x 10 pixels with two lights make 300 rays: a primary ray and two shadow rays for each pixel.
#[test]
fn a_guess_counts_rays_and_the_tests_of_each_ray() {
    let draft = |strategy: &str| Record {
        strategy: strategy.into(),
        image_size: [10, 10],
        lights: Some(2),
        triangles: Some(1023),
        local_size: Some([8, 8]),
        ..Record::default()
    };
    let of = |name: &str| guessed(&draft(&crate::strategy::preset(name).unwrap().strategy.to_string()));
    let every = of("naive");
    assert!((every.sample_ms - 300.0 * 1023.0 / 1e6).abs() < 1e-9, "{}", every.sample_ms);
    // Only the first launch compiles the program.
    assert_eq!(every.check_ms, [every.sample_ms, COMPILE_MS + 2.0 * every.sample_ms]);
    // 300 rays, with 300 tests each: 30 tests in each of the log2(1023 triangles + 1) = 10 levels of the tree.
    assert!((of("bvh").sample_ms - 300.0 * 300.0 / 1e6).abs() < 1e-9, "{}", of("bvh").sample_ms);
    let host = Record { device: crate::record::HOST.into(), local_size: None, ..draft("serial-f32") };
    assert!((guessed(&host).sample_ms / every.sample_ms - 10.0).abs() < 1e-9);
}
