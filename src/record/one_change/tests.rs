use super::super::summary::groups;
use super::super::summary::tests::{few, infeasible, judged, measured};
use super::*;

/// Returns a measured record of a strategy with the given values of the axes `vectors` and `triangles`.
fn point(name: &str, vectors: &str, triangles: &str, side: u32, ms: f64) -> Record {
    with_axes(measured("gpu", name, side, ms), vectors, triangles)
}

fn with_axes(record: Record, vectors: &str, triangles: &str) -> Record {
    let strategy = format!("traversal=exhaustive vectors={vectors} triangles={triangles}");
    Record { strategy, ..record }
}

fn naive(side: u32, ms: f64) -> Record {
    point("naive", "heap", "global", side, ms)
}

fn local(side: u32, ms: f64) -> Record {
    point("local-vectors", "local", "global", side, ms)
}

fn in_scene(scene: &str, record: Record) -> Record {
    Record { scene: scene.to_owned(), ..record }
}

/// Returns each change with its results as text: the ratio with its interval, the effect and the local size of each
/// strategy, or the reason why there is no ratio.
fn shown(records: impl Into<Vec<Record>>) -> Vec<(String, Vec<String>)> {
    let records = judged(records);
    let result = |result: &Compared| match result {
        Compared::Times { ratio, effect, local_sizes } => {
            format!("{} {} at {}", with_interval(*ratio), effect.name(), both_sizes(*local_sizes))
        }
        Compared::Nothing { why } => why.clone(),
    };
    let change = |change: &Change<'_>| -> (String, Vec<String>) {
        let text = format!("{} ({})", change.what(), change.whose());
        (text, change.results.iter().map(result).collect())
    };
    changes(&records, &groups(&records)).iter().flat_map(|one| one.rows.iter().map(change)).collect()
}

/// Returns the results of the only change of an axis that `records` contain.
fn results(records: impl Into<Vec<Record>>) -> Vec<String> {
    let all = shown(records);
    let [(_, results)] = &all[..] else { panic!("{all:?}") };
    results.clone()
}

#[test]
fn a_change_of_one_axis_has_the_ratio_of_its_times() {
    let records = [
        naive(8, 10.0),
        local(8, 5.0),
        // The strategy `compounded` differs from `naive` in two axes, and from `local-vectors` in one axis.
        point("compounded", "local", "local", 8, 9.0),
    ];
    // All samples of a point are equal, so only the assumed differences between runs make the intervals wide.
    let expected = [
        ("vectors: heap → local (naive → local-vectors)", "2.00 (1.98 to 2.02) faster at 8 x 8"),
        ("triangles: global → local (local-vectors → compounded)", "0.556 (0.549 to 0.562) slower at 8 x 8"),
    ];
    let expected = expected.map(|(change, result)| (change.to_owned(), vec![result.to_owned()]));
    assert_eq!(shown(records), expected);
}

#[test]
fn the_first_strategy_is_the_one_that_comes_first_in_the_plan() {
    let changes = |records: [Record; 2]| shown(records).remove(0);
    assert_eq!(changes([naive(8, 10.0), local(8, 5.0)]).0, "vectors: heap → local (naive → local-vectors)");
    let (change, results) = changes([local(8, 5.0), naive(8, 10.0)]);
    assert_eq!(change, "vectors: local → heap (local-vectors → naive)");
    assert_eq!(results, ["0.500 (0.494 to 0.506) slower at 8 x 8"]);
}

/// In the first case, the samples show that the first strategy takes at least 0.2% longer than the second,
/// but not that it takes at least 1% longer.
#[test]
fn a_hundredth_is_a_tie_as_among_winners() {
    assert_eq!(results([naive(8, 10.14), local(8, 10.0)]), ["1.01 (1.00 to 1.03) tie at 8 x 8"]);
    assert_eq!(results([naive(8, 10.0), local(8, 10.14)]), ["0.986 (0.975 to 0.997) tie at 8 x 8"]);
    assert_eq!(results([naive(8, 10.3), local(8, 10.0)]), ["1.03 (1.02 to 1.04) faster at 8 x 8"]);
    assert_eq!(results([naive(8, 10.0), local(8, 10.3)]), ["0.971 (0.960 to 0.982) slower at 8 x 8"]);
}

/// At 2 x 2, the second strategy has too few samples for a rank.
#[test]
fn each_strategy_has_the_local_size_at_which_it_is_fastest() {
    let few = with_axes(few("gpu", "local-vectors", 2, 0.1, 3), "local", "global");
    let second = [few, local(4, 1.0), local(8, 3.0), local(16, 8.0)];
    let first = [naive(2, 2.0), naive(8, 10.0), naive(16, 4.0)];
    assert_eq!(results([&first[..], &second].concat()), ["2.00 (1.98 to 2.02) faster at 2 x 2 → 4 x 4"]);
    let first = [naive(4, 0.5), naive(8, 10.0)];
    assert_eq!(results([&first[..], &second].concat()), ["0.500 (0.494 to 0.506) slower at 4 x 4"]);
}

#[test]
fn without_a_ratio_there_is_the_reason() {
    let local_in = |scene: &str, record: Record| in_scene(scene, with_axes(record, "local", "global"));
    let scenes = ["teapot", "room", "table", "gourd", "pyramid"];
    let records = scenes.map(|scene| in_scene(scene, naive(8, 10.0)));
    let others = [
        in_scene("teapot", local(8, 5.0)),
        local_in("room", few("gpu", "local-vectors", 8, 5.0, 3)),
        local_in("table", infeasible("gpu", "local-vectors", 8, "__local memory: 2 B > 1 B\nand more")),
        in_scene("gourd", local(16, 5.0)),
    ];
    let expected = [
        "2.00 (1.98 to 2.02) faster at 8 x 8",
        "local-vectors at 8 x 8: not enough samples (n = 3)",
        "local-vectors at 8 x 8: infeasible: __local memory: 2 B > 1 B",
        "2.00 (1.98 to 2.02) faster at 8 x 8 → 16 x 16",
        "there is no point of local-vectors",
    ];
    assert_eq!(results([&records[..], &others].concat()), expected);
}

#[test]
fn of_points_without_a_rank_one_with_a_time_has_the_reason() {
    let of_local = |record: Record| with_axes(record, "local", "global");
    let failed = of_local(infeasible("gpu", "local-vectors", 8, "__local memory: 2 B > 1 B"));
    let few = of_local(few("gpu", "local-vectors", 16, 5.0, 3));
    let expected = ["local-vectors at 16 x 16: not enough samples (n = 3)"];
    assert_eq!(results([naive(8, 10.0), failed, few]), expected);
}

#[test]
fn a_change_without_times_on_a_device_is_not_shown() {
    let fails = with_axes(infeasible("gpu", "local-vectors", 8, "no"), "local", "global");
    assert!(shown([naive(8, 10.0), fails]).is_empty());
    let few = with_axes(few("gpu", "local-vectors", 8, 5.0, 3), "local", "global");
    assert_eq!(results([naive(8, 10.0), few]), ["local-vectors at 8 x 8: not enough samples (n = 3)"]);
}

#[test]
fn strategies_with_kernels_of_two_folders_are_no_change_of_an_axis() {
    let of = |folder: &str, record: Record| Record { kernels_of: Some(folder.to_owned()), ..record };
    assert!(shown([of("a", naive(8, 10.0)), of("b", local(8, 5.0))]).is_empty());
    assert_eq!(shown([of("a", naive(8, 10.0)), of("a", local(8, 5.0))]).len(), 1);
}

/// Earlier versions of raycl wrote records without the axis `records`.
#[test]
fn an_axis_that_is_newer_than_a_record_has_its_earlier_value() {
    let with = |name: &str, axis: &str, ms: f64| Record {
        strategy: format!("traversal=bvh vectors=private{axis}"),
        ..measured("gpu", name, 8, ms)
    };
    let all = shown([with("old", "", 10.0), with("new", " records=once", 5.0)]);
    assert_eq!(all[0].0, "records: each-test → once (old → new)");
    assert!(shown([with("old", "", 10.0), with("new", " records=each-test", 5.0)]).is_empty());
    // A report that compares an older folder with a newer folder must find the same strategies in both
    // folders.
    let newer = [with("one", " records=each-test", 10.0), with("two", " records=once", 5.0)];
    let newer = newer.map(|record| in_scene("room", record));
    let all = shown([&[with("one", "", 10.0), with("two", " records=once", 5.0)][..], &newer].concat());
    assert_eq!(all.len(), 1, "{all:?}");
    assert_eq!(all[0].1, ["2.00 (1.98 to 2.02) faster at 8 x 8"; 2]);
}

#[test]
fn each_device_has_its_own_scenes_and_changes() {
    let on = |device: &str, record: Record| Record { device: device.to_owned(), ..record };
    let large = |record: Record| Record { image_size: [1600, 1000], ..record };
    let records = judged([
        measured(HOST, "serial-f32", 0, 100.0),
        on("cpu", naive(8, 10.0)),
        on("cpu", local(8, 5.0)),
        on("gpu", naive(8, 10.0)),
        on("gpu", local(8, 40.0)),
        large(on("gpu", naive(8, 10.0))),
        large(on("gpu", local(8, 20.0))),
    ]);
    let all = changes(&records, &groups(&records));
    let devices: Vec<_> = all.iter().map(|one| (one.device, one.column_names(), one.image_size())).collect();
    let on_gpu = ["teapot 800x500", "teapot 1600x1000"].map(str::to_owned).to_vec();
    let expected = [("cpu", vec!["teapot".to_owned()], Some([800, 500])), ("gpu", on_gpu, None)];
    assert_eq!(devices, expected);
    assert_eq!(all.iter().map(|one| one.rows[0].results.len()).collect::<Vec<_>>(), [1, 2]);
}

/// Returns a record of a strategy with the given value of the axis `width`.
fn wide(width: u32, ms: f64) -> Record {
    Record {
        strategy: format!("traversal=exhaustive width={width}"),
        ..measured("gpu", &format!("w{width}"), 8, ms)
    }
}

#[test]
fn the_largest_effects_come_first_and_ties_last() {
    let all = shown([wide(1, 10.0), wide(2, 10.05), wide(4, 5.0), wide(8, 40.0)]);
    let named: Vec<&str> = all.iter().map(|(change, _)| change.split(' ').next_back().unwrap()).collect();
    assert_eq!(named, ["w8)", "w8)", "w8)", "w4)", "w4)", "w2)"], "{all:?}");
    // From width 4 to 8, the time changes by a factor of 8; from width 1 to 8, it changes by a factor of 4.
    assert!(all[0].0.starts_with("width: 4 → 8") && all[1].0.starts_with("width: 1 → 8"), "{all:?}");
    assert!(all[5].1[0].contains("tie"), "{all:?}");
}

#[test]
fn of_many_changes_those_with_the_largest_effects_are_shown() {
    let of = |count: u32| {
        let one = |width: u32| wide(width, 1.2_f64.powf(width.into()));
        let records = judged((1..=count).map(one).collect::<Vec<_>>());
        let all = changes(&records, &groups(&records));
        let [one] = &all[..] else { panic!("{all:?}") };
        let first = format!("width: 1 → {count}");
        assert_eq!(one.rows[0].what(), first);
        (one.rows.len(), one.note())
    };
    assert_eq!(of(9), (36, None));
    let note = "5 further changes are left out: only the 40 with the largest effects are shown.";
    assert_eq!(of(10), (40, Some(note.to_owned())));
}

#[test]
fn records_without_axes_have_no_changes() {
    assert!(shown([measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 8, 5.0)]).is_empty());
    assert!(shown(Vec::<Record>::new()).is_empty());
}

#[test]
fn a_tie_comes_after_a_certain_effect_however_large_the_ratio_of_the_tie_is() {
    let mut noisy = wide(2, 10.0);
    noisy.samples_ms[5..].iter_mut().for_each(|ms| *ms = 30.0);
    let all = shown([wide(1, 10.0), noisy, wide(4, 12.0)]);
    assert!(all[0].0.starts_with("width: 1 → 4"), "{all:?}");
    assert!(all[1..].iter().all(|(_, results)| results[0].contains(" tie ")), "{all:?}");
}
