//! Draws two kinds of plots of several groups of points: plots of all scenes on a device, and plots of pairs of
//! devices.

use super::merged::Origins;
use super::plot::Plot;
use super::plot::chart::{Across, Chart, Mark, Series};
use super::plot::scale::Kind;
use super::words::{Looks, series_name, tip};
use crate::numbers::by;
use crate::record::{Group, HOST, Record, interval, median};
use std::collections::HashMap;

/// The largest number of devices for which each pair of devices has a plot. With more devices, each device is compared
/// only with the device that has the most times, since the number of pairs grows with the square of the number of
/// devices.
const MOST_WITH_ALL_PAIRS: usize = 8;

/// A device's name, and the device's records that have a time. Within each group of points, the fastest records come
/// first, and records without a rank last.
type OfDevice<'a> = (&'a str, Vec<&'a Record>);

/// Returns a plot for each device with several scenes or image sizes. The plot shows the best time of every
/// strategy, and of every baseline of the device's machine, for each scene and image size. `origins` tells
/// which baselines the machine measured.
pub fn scenes(groups: &[Group<'_>], looks: &Looks, origins: &Origins<'_>) -> Vec<Plot> {
    let plot = |(index, device): (usize, &str)| {
        let own: Vec<_> = groups.iter().filter(|group| group.device == device).collect();
        let columns: Vec<_> = own.iter().map(|group| (group.scene, group.image_size)).collect();
        if columns.len() < 2 {
            return None;
        }
        let hosts: Vec<_> = own.iter().map(|group| of_host(group, groups, origins)).collect();
        let shown: Vec<_> = own.iter().copied().chain(&hosts).collect();
        let one_size = columns.iter().all(|(_, size)| *size == columns[0].1);
        let series = best_of_each(&shown, &columns, looks);
        let chart = Chart {
            title: format!("Each strategy's best time, scene by scene: {device}"),
            x_label: if one_size {
                format!("scene, at {}", by(columns[0].1))
            } else {
                "scene and image size".into()
            },
            y_label: "median time of a frame, ms".into(),
            across: Across::Names(columns.iter().map(|column| column_name(*column, one_size)).collect()),
            up: Kind::Log,
            diagonal: false,
            series,
        };
        let caption = "Each mark shows a strategy at the local size at which it is fastest for the scene and image size of the mark's column. Lower marks are faster. Baselines on the host are included, if there are any.";
        Some(Plot::of(numbered("scenes", index), caption, &chart))
    };
    devices(groups).into_iter().enumerate().filter_map(plot).collect()
}

/// Returns, as a group, the baselines of the machine that measured the fastest point of `group`. These baselines have
/// the scene and the image size of `group`.
fn of_host<'a>(group: &Group<'a>, groups: &[Group<'a>], origins: &'a Origins<'_>) -> Group<'a> {
    let records = origins.baselines(group, groups);
    Group { scene: group.scene, image_size: group.image_size, device: HOST, records }
}

pub(super) fn numbered(name: &str, index: usize) -> String {
    if index == 0 { name.to_owned() } else { format!("{name}-{}", index + 1) }
}

fn column_name((scene, size): (&str, [u32; 2]), one_size: bool) -> String {
    if one_size { scene.to_owned() } else { format!("{scene} {}x{}", size[0], size[1]) }
}

/// Returns the names of the devices that have records, each name once, without the host.
pub(super) fn devices<'a: 'g, 'g>(groups: impl IntoIterator<Item = &'g Group<'a>>) -> Vec<&'a str> {
    let mut devices = Vec::new();
    for group in groups.into_iter().filter(|group| group.device != HOST) {
        if !devices.contains(&group.device) {
            devices.push(group.device);
        }
    }
    devices
}

/// Returns a series for each strategy, with a mark for the strategy's fastest point in every group. A mark's
/// x is the index of the group's scene and image size in `columns`. Groups whose scene and image size are not
/// in `columns` have no marks.
pub(super) fn best_of_each(
    groups: &[&Group<'_>],
    columns: &[(&str, [u32; 2])],
    looks: &Looks,
) -> Vec<Series> {
    let mut series: Vec<Series> = Vec::new();
    for group in groups {
        let Some(x) = columns.iter().position(|column| *column == (group.scene, group.image_size)) else {
            continue;
        };
        let mut seen: Vec<String> = Vec::new();
        // The ranking lists the fastest records first, so the first record of each strategy is the strategy's best.
        // Records with too few samples, or with times of 0, come last.
        for record in group.ranking().all() {
            let name = series_name(record);
            if seen.contains(&name) {
                continue;
            }
            let mark = Mark {
                x: x as f64,
                y: median(record).unwrap_or_default(),
                interval: interval(record),
                tip: format!("{}\n{}", group.scene, tip(record)),
            };
            Series::add(&mut series, &name, looks.look(&name), true, mark);
            seen.push(name);
        }
    }
    for one in &mut series {
        one.marks.sort_by(|a, b| a.x.total_cmp(&b.x));
    }
    series.sort_by_key(|one| looks.look(&one.name).number);
    series
}

/// Returns a plot for each pair of devices that both have a time for at least one common combination of scene, image
/// size, strategy and local size. The plot shows one device's times against the other device's times. With more than
/// `MOST_WITH_ALL_PAIRS` devices, only the pairs that include the device with the most times have plots, and the
/// returned note says so.
pub fn device_against_device(groups: &[Group<'_>], looks: &Looks) -> (Vec<Plot>, Option<String>) {
    // To rank a group takes time, since a ratio is computed for every point. Each group is therefore ranked once, and
    // not again for every pair.
    let of = |device| -> OfDevice<'_> {
        let own = groups.iter().filter(|group| group.device == device);
        (device, own.flat_map(|group| group.ranking().all()).collect())
    };
    let mut all: Vec<OfDevice<'_>> = devices(groups).into_iter().map(of).collect();
    let has_all_pairs = all.len() <= MOST_WITH_ALL_PAIRS;
    if !has_all_pairs {
        let times = |one: &OfDevice<'_>| one.1.iter().filter(|record| median(record).is_some()).count();
        all.sort_by_key(|one| std::cmp::Reverse(times(one)));
    }
    let compared = if has_all_pairs { all.len() } else { 1 };
    let mut plots = Vec::new();
    for (index, one) in all.iter().enumerate().take(compared) {
        for other in &all[index + 1..] {
            plots.extend(pair(looks, one, other, plots.len()));
        }
    }
    let note = || {
        format!(
            "There are {} devices. The plots \"Device against device\" therefore compare each device only with {}, \
             which has the most times. With up to {MOST_WITH_ALL_PAIRS} devices, every pair has a plot.",
            all.len(),
            all[0].0
        )
    };
    let note = (!has_all_pairs && !plots.is_empty()).then(note);
    (plots, note)
}

fn pair(
    looks: &Looks,
    (one, records): &OfDevice<'_>,
    (other, other_records): &OfDevice<'_>,
    index: usize,
) -> Option<Plot> {
    let point =
        |record: &Record| (record.scene.clone(), record.image_size, record.name.clone(), record.local_size);
    let others: HashMap<_, _> = other_records.iter().map(|record| (point(record), *record)).collect();
    let mut series: Vec<Series> = Vec::new();
    for record in records {
        let Some(match_) = others.get(&point(record)) else { continue };
        let (Some(x), Some(y)) = (median(record), median(match_)) else { continue };
        let tip = format!("{}\n{one}: {}\n{other}: {}", record.scene, tip(record), tip(match_));
        let mark = Mark { x, y, interval: interval(match_), tip };
        Series::add(&mut series, &record.name, looks.look(&record.name), false, mark);
    }
    series.sort_by_key(|one| looks.look(&one.name).number);
    let chart = Chart {
        title: "Device against device".into(),
        x_label: format!("{one}: median ms"),
        y_label: format!("{other}: median ms"),
        across: Across::Numbers(Kind::Log),
        up: Kind::Log,
        diagonal: true,
        series,
    };
    let caption = format!(
        "Each mark shows a point that was measured on both devices. Below the line of equal times, {other} is faster; above this line, {one} is faster. Bars are 95% intervals of the times on {other}."
    );
    (!chart.series.is_empty()).then(|| Plot::of(numbered("devices", index), caption, &chart))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{few, judged, measured, sampled};
    use crate::record::groups;

    /// Returns the plots of groups whose folders are unknown. Each plot therefore shows all baselines of its scenes and
    /// image sizes.
    fn scenes(groups: &[Group<'_>], looks: &Looks) -> Vec<Plot> {
        super::scenes(groups, looks, &Origins::of(&[]))
    }

    #[test]
    fn bars_of_device_against_device_are_the_second_devices() {
        // The times of the two launches of `wide` are far apart (10 and 15 ms), so its interval is wide. The
        // three samples of `none` are too few for an interval.
        let wide = |device: &str| {
            let samples = (0..10).map(|index| (index / 5, if index < 5 { 10.0 } else { 15.0 }));
            Record { device: device.into(), ..sampled("naive", samples) }
        };
        let none = |device: &str| few(device, "naive", 8, 10.0, 3);
        let has_bar = |records: [Record; 2]| {
            let records = judged(records);
            let groups = groups(&records);
            let (plots, _) = device_against_device(&groups, &Looks::of(&groups));
            plots[0].svg.contains("class=\"interval\"")
        };
        assert!(has_bar([none("a"), wide("b")]));
        assert!(!has_bar([wide("a"), none("b")]));
    }

    #[test]
    fn of_many_devices_each_is_compared_with_one_only_and_a_note_says_so() {
        let of = |count: usize| {
            let devices = (0..count).map(|number| format!("gpu {number:02}"));
            let records = judged(devices.map(|name| measured(&name, "naive", 8, 10.0)).collect::<Vec<_>>());
            let groups = groups(&records);
            let (plots, note) = device_against_device(&groups, &Looks::of(&groups));
            (plots.len(), note)
        };
        assert_eq!(of(MOST_WITH_ALL_PAIRS), (28, None));
        let (plots, note) = of(40);
        assert_eq!(plots, 39);
        let note = note.expect("a note");
        assert!(note.contains("40 devices") && note.contains("gpu 00"), "{note}");
    }

    #[test]
    fn of_many_devices_one_without_times_is_compared_with_none() {
        let names = (0..=MOST_WITH_ALL_PAIRS).map(|number| format!("gpu {number:02}"));
        let mut records: Vec<_> = names.map(|name| measured(&name, "naive", 8, 10.0)).collect();
        let nothing = Record { samples_ms: Vec::new(), sample_launches: Vec::new(), ..records[0].clone() };
        records[0] = Record { outcome: crate::record::Outcome::Crashed, ..nothing };
        let records = judged(records);
        let groups = groups(&records);
        let (plots, note) = device_against_device(&groups, &Looks::of(&groups));
        assert_eq!(plots.len(), MOST_WITH_ALL_PAIRS - 1);
        assert!(note.is_some_and(|note| note.contains("gpu 01")));
    }

    #[test]
    fn device_against_device_has_a_line_on_which_both_are_equally_fast() {
        let records = judged(["a", "b"].map(|device| measured(device, "naive", 8, 10.0)));
        let groups = groups(&records);
        let (plots, _) = device_against_device(&groups, &Looks::of(&groups));
        assert!(plots[0].svg.contains(">equal<"), "{}", plots[0].svg);
        let caption = &plots[0].caption;
        assert!(caption.contains("equal times, b is faster; above this line, a is faster."), "{caption}");
    }

    #[test]
    fn devices_whose_times_have_no_range_in_common_have_no_such_line() {
        let records =
            judged([("a", 1.0), ("b", 1000.0)].map(|(device, ms)| measured(device, "naive", 8, ms)));
        let groups = groups(&records);
        let (plots, _) = device_against_device(&groups, &Looks::of(&groups));
        assert!(!plots[0].svg.contains(">equal<"), "{}", plots[0].svg);
    }

    #[test]
    fn a_mark_is_the_best_point_of_a_strategy_in_its_scenes_column() {
        let of = |scene: &str, name: &str, side: u32, ms: f64| Record {
            scene: scene.into(),
            key: format!("{scene} {name} {side}"),
            ..measured("gpu", name, side, ms)
        };
        let records = judged([
            of("room", "naive", 8, 30.0),
            of("room", "naive", 4, 20.0),
            of("teapot", "wide", 1, 1.0),
            of("teapot", "naive", 8, 10.0),
        ]);
        let groups = groups(&records);
        let shown: Vec<_> = groups.iter().collect();
        let size = [800, 500];
        let series = best_of_each(&shown, &[("teapot", size), ("room", size)], &Looks::of(&groups));
        let marks = |name: &str| {
            let one = series.iter().find(|one| one.name == name).expect("a series");
            one.marks.iter().map(|mark| (mark.x, mark.y)).collect::<Vec<_>>()
        };
        assert_eq!(marks("naive"), [(0.0, 10.0), (1.0, 20.0)]);
        assert_eq!(marks("wide"), [(0.0, 1.0)]);
        let other = best_of_each(&shown, &[("teapot", [80, 50])], &Looks::of(&groups));
        assert!(other.is_empty(), "no group has this image size");
    }

    #[test]
    fn scenes_are_plotted_for_each_device_that_has_several() {
        let of = |scene: &str, device: &str, width: u32| Record {
            scene: scene.into(),
            key: format!("{scene} {device} {width}"),
            image_size: [width, 500],
            ..measured(device, "naive", 8, 1.0)
        };
        let plots_of = |records: Vec<Record>| {
            let records = judged(records);
            let groups = groups(&records);
            scenes(&groups, &Looks::of(&groups))
                .into_iter()
                .map(|plot| (plot.name, plot.svg))
                .collect::<Vec<_>>()
        };
        let plots = plots_of(vec![of("teapot", "a", 800), of("teapot", "b", 800), of("room", "b", 800)]);
        assert_eq!(plots.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["scenes-2"]);
        assert!(
            plots[0].1.contains("scene, at 800 x 500") && plots[0].1.contains(">room<"),
            "{}",
            plots[0].1
        );
        let plots = plots_of(vec![of("teapot", "a", 800), of("teapot", "a", 400)]);
        assert_eq!(plots[0].0, "scenes");
        assert!(
            plots[0].1.contains("scene and image size") && plots[0].1.contains(">teapot 400x500<"),
            "{}",
            plots[0].1
        );
    }

    #[test]
    fn the_baselines_of_the_host_are_in_the_plot_of_each_device() {
        let on = |device: &str, name: &str, scene: &str| Record {
            scene: scene.into(),
            key: format!("{device} {scene}"),
            ..measured(device, name, 8, 1.0)
        };
        let records = judged([
            on("gpu", "naive", "teapot"),
            on("gpu", "naive", "room"),
            on(HOST, "serial-f32", "room"),
        ]);
        let groups = groups(&records);
        let plots = scenes(&groups, &Looks::of(&groups));
        assert_eq!(plots.len(), 1, "the host has no plot of its own");
        assert!(plots[0].svg.contains("serial-f32 (host)"), "{}", plots[0].svg);
    }

    #[test]
    fn the_first_device_is_across_and_each_point_is_compared_at_its_own_local_size() {
        let points = [("a", 4, 10.0), ("a", 8, 40.0), ("b", 4, 20.0), ("b", 8, 5.0)];
        let records = judged(points.map(|(device, side, ms)| measured(device, "naive", side, ms)));
        let groups = groups(&records);
        let (plots, _) = device_against_device(&groups, &Looks::of(&groups));
        let series = plots[0].svg.split("class=\"series s0\"").nth(1).expect("a series");
        let position = |dot: &str| -> Option<[f64; 2]> {
            let start =
                dot.split(" d=\"M").nth(1)?.split(|letter: char| letter.is_ascii_alphabetic()).next()?;
            let (x, y) = start.split_once(' ')?;
            Some([x.parse().ok()?, y.parse().ok()?])
        };
        let dots: Vec<_> = series.split("class=\"dot\"").skip(1).take(2).filter_map(position).collect();
        // The x axis shows the times of `a` (10 ms and 40 ms), and the y axis those of `b` (20 ms and 5 ms). In SVG, y
        // coordinates grow downwards, so the mark of 5 ms has the larger y coordinate.
        assert!(dots[0][0] < dots[1][0] && dots[0][1] < dots[1][1], "{dots:?}");
        let labels = "<desc>b: median ms against a: median ms</desc>";
        assert!(plots[0].svg.contains(labels), "{}", plots[0].svg);
    }
}
