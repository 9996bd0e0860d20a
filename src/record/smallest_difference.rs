//! Writes notes on the certainty of results, in particular on the smallest difference in time that the
//! samples can show between two points.

use super::ranking::resolution;
use super::ratios::rounds_of;
use super::relative_times::RelativeTimes;
use super::summary::{Group, groups};
use super::types::{HOST, Record};
use crate::numbers::{by, significant};
use crate::words::counted_of;
use std::collections::{BTreeMap, HashSet};

/// The times of points are noisy if the points must differ by more than this fraction before the samples show
/// a difference. For noisy points, the smallest difference that can be shown is stated as a factor and not as
/// a percentage.
const NOISY: f64 = 1.0;
/// The largest factor that a note states as the smallest difference between points with noisy times. A factor
/// above this limit would be meaningless, since factors are computed from the spread of only a few launches.
const LARGEST_FACTOR: f64 = 100.0;
/// Properties of points. The smallest difference between two points that the samples can show may depend on
/// these properties.
const PROPERTIES: [&str; 3] = ["scene", "image size", "device"];

/// Returns notes on the certainty of results: how many points were measured in a single launch only, and which
/// differences are too small to be detected.
pub(crate) fn how_sure(records: &[Record]) -> Vec<String> {
    let of_one_launch = || records.iter().filter(|record| has_one_launch(record));
    let mut notes = Vec::new();
    if let Some(one) = of_one_launch().next() {
        let measured = records.iter().filter(|record| record.relative_times.is_some()).count();
        let whose = match of_one_launch().count() {
            all if all == measured => "all points".to_owned(),
            some => format!("{some} of {measured} points, such as {} {}", one.scene, by(one.image_size)),
        };
        notes.push(format!(
            "Measured in only one launch of the program: {whose}. The intervals of these points do not include differences between launches. To measure these differences, set more launches (`launches` in the config's `[timing]`). If a note says that launches were left out, run the experiment again."
        ));
    }
    notes.extend(smallest_difference_note(records));
    notes
}

/// Returns a note if raycl computes the ratios of some points of a group from their medians; otherwise `None`. raycl
/// does so if the points were measured neither in the same rounds nor in blocks (parts of a group) with the same
/// control point. Baselines are left out.
pub(crate) fn apart_note(records: &[Record]) -> Option<String> {
    let groups = groups(records);
    let kernels: Vec<&Group<'_>> = groups.iter().filter(|group| group.device != HOST).collect();
    let apart: Vec<&Group<'_>> = kernels.iter().copied().filter(|group| has_points_apart(group)).collect();
    let Group { scene, image_size, device, .. } = apart.first()?;
    Some(format!(
        "In {}, such as {scene} {} on {device}, not all points were measured together, for example because of \
         `--resume` or because they come from several folders. If two points were not measured together, raycl \
         computes their ratio from their medians. This ratio includes every change of the machine between the two \
         measurements, so only larger differences are detected.",
        counted_of(apart.len(), kernels.len(), "group of points"),
        by(*image_size)
    ))
}

/// Returns true if the levels of two points in the group cannot be compared (see [`RelativeTimes::family`]).
fn has_points_apart(group: &Group<'_>) -> bool {
    let times = group.records.iter().filter_map(|record| record.relative_times.as_ref());
    times.map(RelativeTimes::family).collect::<HashSet<_>>().len() > 1
}

/// Returns the note on the smallest difference between the times of two points that the samples can show. The
/// smallest difference between two baselines (ray casters on the host) says nothing about kernels, so
/// baselines are used only if the records contain no kernels. Returns `None` if the smallest difference is
/// unknown.
pub(crate) fn smallest_difference_note<'a>(records: impl IntoIterator<Item = &'a Record>) -> Option<String> {
    let judged = records.into_iter().filter(|record| record.relative_times.is_some());
    let (baselines, kernels): (Vec<&Record>, Vec<&Record>) = judged.partition(|record| record.is_baseline());
    let points = if kernels.is_empty() { baselines } else { kernels };
    let is_noisy = |point: &&Record| resolution([*point]).is_some_and(|[part, _]| part > NOISY);
    let known = points.into_iter().filter(|point| resolution([*point]).is_some());
    let (noisy, fine): (Vec<&Record>, Vec<&Record>) = known.partition(is_noisy);
    let below = |amount: &str| {
        format!("Differences below {amount} between two points are mostly not detected in these results.")
    };
    let count =
        |points: &[&Record]| points.iter().filter_map(|point| rounds_of(point)).collect::<HashSet<_>>().len();
    match (smallest_difference(&fine), smallest_difference(&noisy)) {
        (None, None) => None,
        (Some(amount), None) | (None, Some(amount)) => Some(below(&amount)),
        (Some(percents), Some(factors)) => Some(format!(
            "{} In {} of {} sets of points that were measured together, the times are noisier: differences below \
             {factors} are mostly not detected in these sets.",
            below(&percents),
            count(&noisy),
            count(&[&noisy[..], &fine].concat())
        )),
    }
}

/// Returns the smallest difference that can be shown between two of the points, such as "2.1 to 4.1%
/// (depending on device)". For noisy points, the difference is a factor, such as "a factor of 3.2". Either
/// all of these points must be noisy, or none of them. Returns `None` if the smallest difference is unknown.
fn smallest_difference(points: &[&Record]) -> Option<String> {
    let [part, _] = resolution(points.iter().copied())?;
    let amount = |shown: &str| match part > NOISY {
        true => format!("a factor of {shown}"),
        false => format!("{shown}%"),
    };
    let [least, most] = shown_resolution(points)?;
    Some(match least == most {
        true => amount(&most),
        false => {
            format!("{} (depending on {})", amount(&format!("{least} to {most}")), what_it_depends_on(points))
        }
    })
}

/// Returns, as texts, the least and the greatest value of [`resolution`], which is the smallest difference
/// that the samples can show. The texts are percentages or, for noisy points, factors. Returns `None` if the
/// values are unknown.
fn shown_resolution(points: &[&Record]) -> Option<[String; 2]> {
    let shown = |part: f64| match part > NOISY {
        true => significant((1.0 + part).min(LARGEST_FACTOR), 2),
        false => significant(100.0 * part, 2),
    };
    Some(resolution(points.iter().copied())?.map(shown))
}

/// Names the properties on which the smallest difference between points depends: "scene", "scene and device",
/// "when the points were measured". The returned text names a property if the smallest difference varies
/// among points that are equal in all other properties. If points of different scenes also have different
/// devices, for example, this rule alone would name neither the scene nor the device. Therefore, if the smallest
/// difference varies even among points that are equal in all named properties, the text names all properties in which
/// the points differ.
fn what_it_depends_on(points: &[&Record]) -> String {
    let mut equal: BTreeMap<[String; 3], Vec<&Record>> = BTreeMap::new();
    for point in points {
        let properties = [point.scene.clone(), by(point.image_size), point.device.clone()];
        equal.entry(properties).or_default().push(point);
    }
    let shown: Vec<([String; 3], Option<[String; 2]>)> =
        equal.into_iter().map(|(properties, points)| (properties, shown_resolution(&points))).collect();
    let explain = |named: [bool; 3]| {
        let are_equal = |one: &[String; 3], other: &[String; 3]| {
            (0..named.len()).all(|index| !named[index] || one[index] == other[index])
        };
        let is_explained = |(one, range): &([String; 3], Option<[String; 2]>)| {
            shown.iter().all(|(other, others)| range == others || !are_equal(one, other))
        };
        shown.iter().all(is_explained)
    };
    let without = |left_out: usize| std::array::from_fn(|index| index != left_out);
    let mut named: [bool; 3] = std::array::from_fn(|index| !explain(without(index)));
    if !explain(named) {
        let differs = |index: usize| shown.iter().any(|(one, _)| one[index] != shown[0].0[index]);
        named = std::array::from_fn(differs);
    }
    let of_times = |range: &Option<[String; 2]>| range.as_ref().is_some_and(|[least, most]| least != most);
    let times = shown.iter().any(|(_, range)| of_times(range)).then_some("when the points were measured");
    let properties = PROPERTIES.into_iter().zip(named).filter(|(_, named)| *named).map(|(name, _)| name);
    let names: Vec<&str> = properties.chain(times).collect();
    match names[..] {
        [] => String::new(),
        [one] => one.to_owned(),
        [ref first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Returns true if a record's relative times come from a single launch.
fn has_one_launch(record: &Record) -> bool {
    record.relative_times.as_ref().is_some_and(|times| times.standing.launches() == 1)
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{few, judged, measured, sampled};
    use super::super::together::tests::in_two_launches;
    use super::*;

    #[test]
    fn one_launch_is_said_to_be_a_look() {
        let look = judged([few("gpu", "naive", 8, 10.0, 5)]);
        assert!(how_sure(&look)[0].starts_with("Measured in only one launch"), "{:?}", how_sure(&look));
        let several = judged([in_two_launches("naive", 10.0, 0.0), in_two_launches("wide", 5.0, 0.0)]);
        assert_eq!(
            how_sure(&several),
            ["Differences below 2.1% between two points are mostly not detected in these results."]
        );
        let on_processors = |name| Record { threads: Some(2), ..in_two_launches(name, 10.0, 0.0) };
        let several = judged([on_processors("naive"), on_processors("wide")]);
        assert_eq!(
            how_sure(&several),
            ["Differences below 4.1% between two points are mostly not detected in these results."]
        );
        assert!(how_sure(&[]).is_empty());
    }

    /// The note must not say that the smallest difference depends on the scene merely because a scene has
    /// baselines or several devices.
    #[test]
    fn what_can_be_told_apart_is_that_of_kernels_and_depends_only_on_what_differs() {
        let said = |records: &[Record]| how_sure(&judged(records)).remove(0);
        let on_gpu = [measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 1, 5.0)];
        let baselines = ["serial-f32", "serial-f64"].map(|name| measured(HOST, name, 0, 100.0));
        let with = |more: &[Record]| said(&[&on_gpu[..], more].concat());
        assert_eq!(
            with(&baselines[..1]),
            "Differences below 2.1% between two points are mostly not detected in these results."
        );
        // The times of baselines differ from run to run as much as the times of kernels on a CPU.
        assert_eq!(
            said(&baselines),
            "Differences below 4.1% between two points are mostly not detected in these results."
        );
        let on_cpu =
            ["naive", "wide"].map(|name| Record { threads: Some(2), ..measured("cpu", name, 8, 50.0) });
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
        let below = "Differences below 2.1% between two points are mostly not detected in these results.";
        let noisier = "In 1 of 2 sets of points that were measured together, the times are noisier: differences \
                       below a factor of 100 are mostly not detected in these sets.";
        assert_eq!(both, format!("{below} {noisier}"));
        let all = said(&[noisy]);
        assert_eq!(
            all,
            "Differences below a factor of 100 between two points are mostly not detected in these results."
        );
    }

    /// Returns the two points `naive` and `wide`, measured in two launches. In the first launch, `naive`
    /// takes longer than `wide` by the fraction `apart`. In the second launch, `wide` takes longer than
    /// `naive` by this fraction.
    fn two_points(
        scene: &str,
        image_size: [u32; 2],
        device: &str,
        first_launch: u32,
        apart: f64,
    ) -> [Record; 2] {
        ["naive", "wide"].map(|name| {
            let ms = |index: u32| if (index < 5) == (name == "naive") { 10.0 * (1.0 + apart) } else { 10.0 };
            let record = sampled(name, (0..10).map(|index| (first_launch + index / 5, ms(index))));
            let key = format!("{name} {scene} {image_size:?} {device} {first_launch}");
            Record { key, scene: scene.into(), image_size, device: device.into(), ..record }
        })
    }

    #[test]
    fn a_difference_between_noisy_points_is_a_factor_and_not_only_its_part_above_one() {
        let points = judged(two_points("room", [64, 40], "gpu", 0, 0.2));
        let [part, _] = resolution(&points).unwrap();
        assert!(part > NOISY && 1.0 + part < LARGEST_FACTOR, "{part}");
        let said = how_sure(&points).remove(0);
        let factor = significant(1.0 + part, 2);
        assert!(
            said.starts_with(&format!("Differences below a factor of {factor} between")),
            "{said} {part}"
        );
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

    #[test]
    fn points_of_a_group_that_were_not_measured_together_are_noted() {
        let at = |scene: &str, launch: u32| two_points(scene, [64, 40], "gpu", launch, 0.0);
        let note = |points: &[[Record; 2]]| apart_note(&judged(points.concat()));
        assert_eq!(note(&[at("a", 0), at("b", 2)]), None);
        let said = note(&[at("a", 0), at("a", 2), at("b", 4)]).expect("a note");
        let start =
            "In 1 of 2 groups of points, such as a 64 x 40 on gpu, not all points were measured together";
        assert!(said.starts_with(start), "{said}");
        // Points of blocks with the same control point are compared by their ratios to this point.
        let block = |launch: u32| {
            at("a", launch).map(|record| Record {
                key: if record.name == "naive" { "control".into() } else { record.key.clone() },
                control: Some("control".into()),
                ..record
            })
        };
        assert_eq!(note(&[block(0), block(2)]), None);
    }

    #[test]
    fn if_some_points_have_one_launch_they_are_counted_and_one_is_named() {
        let look = Record { image_size: [80, 50], ..few("gpu", "naive", 8, 10.0, 5) };
        let records = judged([look, in_two_launches("naive", 10.0, 0.0), in_two_launches("wide", 5.0, 0.0)]);
        let said = how_sure(&records);
        assert!(said[0].contains("program: 1 of 3 points, such as teapot 80 x 50."), "{said:?}");
    }
}
