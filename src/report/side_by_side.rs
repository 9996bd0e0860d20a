//! Compares devices: how fast each strategy is on each device, and how much longer a device takes with the
//! point (strategy and local size) that is the fastest on another device.

use super::overview::devices;
use super::plot::Plot;
use super::plot::heat::{Cell, HeatMap};
use super::plot::shorten::shorten_all;
use super::words::title;
use crate::numbers::significant;
use crate::record::{Group, HOST, Record, ratio};

/// Number of characters of a device's name that fit into a column of a heat map.
const ROOM: usize = 12;

/// The end of the captions of both heat maps.
const HOW_TO_READ: &str = " A ring marks a mean below 1.01 over all combinations of scene and image size. \
                           (1 of 2) means that the value is the mean over only one of two combinations: in the \
                           other combination, there is no time, or the time cannot be compared because the point \
                           has too few samples or samples of 0 ms. A mean over only a part of the combinations \
                           has no ring.";

/// A group, and the group's records that have a rank (enough samples, none of which is 0), the fastest
/// first.
type Ranked<'g, 'a> = (&'g Group<'a>, Vec<&'a Record>);

/// Returns two heat maps. The first heat map shows how fast each strategy is on each device. The second heat
/// map shows how much longer each device takes with another device's fastest point. Returns no heat map if
/// `groups` have fewer than two devices.
pub fn side_by_side(groups: &[Group<'_>]) -> Vec<Plot> {
    let devices = devices(groups);
    if devices.len() < 2 {
        return Vec::new();
    }
    // To rank a group takes time, since a ratio is computed for every point. Each group is therefore ranked once, and
    // not again for every cell.
    let groups: Vec<Ranked<'_, '_>> = groups.iter().map(|group| (group, group.ranking().ranked)).collect();
    vec![strategies(&groups, &devices), losses(&groups, &devices)]
}

/// Returns a heat map with a row per strategy and a column per device. A cell shows the strategy's best time
/// divided by the best time of all strategies on the same device, for the same scene and image size. The
/// cell's value is the geometric mean of this ratio over scenes and image sizes.
fn strategies(groups: &[Ranked<'_, '_>], devices: &[&str]) -> Plot {
    let mut names: Vec<&str> = Vec::new();
    let kernels = groups.iter().filter(|(group, _)| group.device != HOST);
    for record in kernels.flat_map(|(group, _)| &group.records) {
        if !names.contains(&record.name.as_str()) {
            names.push(&record.name);
        }
    }
    let row = |name: &&str| {
        let cell = |device: &&str| {
            let own: Vec<_> = groups.iter().filter(|ranked| is_ranked_on(device, ranked)).collect();
            let slower = own.iter().filter_map(|ranked| {
                over_best(ranked, ranked.1.iter().find(|record| record.name == **name)?)
            });
            cell(
                slower.collect(),
                own.len(),
                &format!(
                    "{name} on {device}: time of the strategy at its best local size, divided by the best time of all \
                     strategies, for each scene and image size"
                ),
            )
        };
        ((*name).to_owned(), devices.iter().map(cell).collect())
    };
    let rows = names.iter().map(row).collect();
    let caption = "Each cell compares a strategy, at its best local size, with the best strategy for the \
        same scene, image size and device. The cell shows the strategy's time divided by the best strategy's time, as \
        the geometric mean over the combinations of scene and image size.";
    plot(
        "strategies-by-device",
        "Strategies by device: time relative to the device's best",
        devices,
        rows,
        caption,
    )
}

/// Returns a heat map with a row and a column per device. A cell is computed from the points (strategy and local size)
/// that are the fastest on the row's device, one point for each scene and image size. Each point's time on the column's
/// device is divided by the best time on the column's device. The cell shows the geometric mean of these ratios.
fn losses(groups: &[Ranked<'_, '_>], devices: &[&str]) -> Plot {
    let row = |from: &&str| {
        let cell = |on: &&str| {
            let own = groups.iter().filter(|ranked| is_ranked_on(on, ranked));
            let both: Vec<_> =
                own.filter_map(|ranked| Some((ranked, best_on(from, groups, ranked.0)?))).collect();
            let slower = both.iter().filter_map(|(ranked, best)| {
                let (group, point) = (ranked.0, (&best.name, best.local_size));
                let there = group.records.iter().find(|record| (&record.name, record.local_size) == point)?;
                Some((over_best(ranked, there)?.0, format!("{}: {}", group.scene, title(best))))
            });
            let what = format!(
                "the fastest points of {from}, measured on {on}: time divided by the best time on {on}, for each \
                 scene and image size"
            );
            cell(slower.collect(), both.len(), &what)
        };
        (format!("best of {from}"), devices.iter().map(cell).collect())
    };
    let rows = devices.iter().map(row).collect();
    let caption = "Each cell is computed from the points (strategy and local size) that are the fastest on the row's \
        device, one point for each combination of scene and image size. Each point's time on the column's device is \
        divided by the best time on the column's device. The cell shows the geometric mean of these ratios over the \
        combinations that were measured on both devices.";
    plot(
        "losses-by-device",
        "Time of one device's fastest point on another device, relative to the other device's best time",
        devices,
        rows,
        caption,
    )
}

/// Returns true if a group belongs to the device, and one of its records has a rank.
fn is_ranked_on(device: &str, (group, ranked): &Ranked<'_, '_>) -> bool {
    group.device == device && !ranked.is_empty()
}

/// Returns the fastest record of the device for the scene and image size of `group`, which may belong to
/// another device. Returns `None` if no record has a rank.
fn best_on<'a>(device: &str, groups: &[Ranked<'_, 'a>], group: &Group<'_>) -> Option<&'a Record> {
    let same = |(other, _): &&Ranked<'_, '_>| {
        other.device == device && (other.scene, other.image_size) == (group.scene, group.image_size)
    };
    groups.iter().find(same)?.1.first().copied()
}

/// Returns the ratio of a record's time to the best time of the record's group, and the names of the scene
/// and the point. Returns `None` if the record has too few samples or times of 0, or if no record of the
/// group has a rank.
fn over_best((group, ranked): &Ranked<'_, '_>, record: &Record) -> Option<(f64, String)> {
    let best = *ranked.first()?;
    Some((ratio(record, best)?.middle, format!("{}: {}", group.scene, title(record))))
}

/// Returns a cell with the mean of the ratios in `slower`; `of` is the number of combinations of scene and image size.
/// If some combinations have no ratio, the cell shows the number of ratios, such as "(1 of 2)", and has no ring.
/// Without ratios, the cell is empty.
fn cell(slower: Vec<(f64, String)>, of: usize, what: &str) -> Cell {
    if slower.is_empty() {
        return Cell::Empty;
    }
    let count = slower.len();
    let part = if count < of { format!(" ({count} of {of})") } else { String::new() };
    let mean = (slower.iter().map(|(times, _)| times.ln()).sum::<f64>() / slower.len() as f64).exp();
    let lines = slower.iter().take(12).map(|(times, point)| format!("{}× {point}", significant(*times, 3)));
    let tip = std::iter::once(what.to_owned()).chain(lines).collect::<Vec<_>>().join("\n");
    let text = format!("{}{part}", significant(mean, 3));
    Cell::Time { slower: mean.max(1.0), text, wins: mean < 1.01 && part.is_empty(), tip }
}

fn plot(name: &str, title: &str, devices: &[&str], rows: Vec<(String, Vec<Cell>)>, caption: &str) -> Plot {
    let map = HeatMap {
        id: name.to_owned(),
        title: title.to_owned(),
        x_label: "device".into(),
        columns: shorten_all(devices, ROOM),
        rows,
        ringed: "mean below 1.01",
        codes: Vec::new(),
    };
    let caption = format!("{caption}{HOW_TO_READ}");
    Plot { name: name.to_owned(), caption, svg: map.svg(), narrow: map.narrow_svg() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{fixtures::few, fixtures::judged, fixtures::measured, groups};

    /// In this test, the point with the smallest median on each device has too few samples.
    #[test]
    fn a_point_with_too_few_samples_has_no_ratio_and_is_no_devices_best() {
        let of = |device: &str| {
            [
                few(device, "private", 8, 0.01, 3),
                measured(device, "naive", 8, 1.0),
                measured(device, "wide", 1, 3.0),
            ]
        };
        let records = judged([of("gpu"), of("cpu")].concat());
        let [strategies, losses] = &side_by_side(&groups(&records))[..] else { panic!("two plots") };
        assert_eq!(strategies.svg.matches(">3.00<").count(), 2, "{}", strategies.svg);
        assert!(!strategies.svg.contains("private on"), "{}", strategies.svg);
        assert_eq!(losses.svg.matches(">1.00<").count(), 4, "{}", losses.svg);
        let none = judged([few("gpu", "naive", 8, 1.0, 3), few("cpu", "naive", 8, 1.0, 3)]);
        assert!(side_by_side(&groups(&none)).iter().all(|plot| !plot.svg.contains("class=\"mark\"")));
    }

    /// In this test, one of two points is slow in half of its launches. The two points are compared by their
    /// times in each launch, not by the medians of all their times.
    #[test]
    fn ratios_are_those_of_all_other_views() {
        let mut uneven = measured("gpu", "wide", 1, 2.0);
        uneven.samples_ms[5..].fill(8.0);
        let records = judged([
            measured("gpu", "naive", 8, 1.0),
            uneven,
            measured("cpu", "naive", 8, 1.0),
            measured("cpu", "wide", 1, 1.0),
        ]);
        let middle = ratio(&records[1], &records[0]).map(|ratio| significant(ratio.middle, 3)).unwrap();
        assert_ne!(middle, "2.00");
        let plots = side_by_side(&groups(&records));
        assert!(plots[0].svg.contains(&format!(">{middle}<")), "{middle}: {}", plots[0].svg);
        assert!(plots[0].narrow.contains(&format!(">{middle}<")), "{middle}: {}", plots[0].narrow);
    }

    #[test]
    fn one_devices_best_costs_what_it_costs_on_another() {
        let records = judged([
            measured("gpu", "naive", 8, 1.0),
            measured("gpu", "wide", 1, 3.0),
            measured("cpu", "naive", 8, 20.0),
            measured("cpu", "wide", 1, 10.0),
        ]);
        let groups = groups(&records);
        let plots = side_by_side(&groups);
        assert_eq!(plots.len(), 2);
        assert!(
            plots[1].svg.contains("the fastest points of gpu, measured on cpu: ")
                && plots[1].svg.contains(">2.00<"),
            "{}",
            plots[1].svg
        );
        assert!(plots[0].svg.contains("wide on gpu") && plots[0].svg.contains(">3.00<"));
        assert!(
            plots[0].svg.contains(
                "wide on gpu: time of the strategy at its best local size, divided by the best time of all strategies, for each scene and image size&#10;3.00× teapot: wide"
            ),
            "{}",
            plots[0].svg
        );
        assert!(side_by_side(&groups[..1]).is_empty(), "one device");
    }

    /// In this test, the gpu has no time of `wide` in the room. On both devices, `wide` is the fastest everywhere
    /// else.
    #[test]
    fn what_has_no_time_in_a_scene_is_not_ringed_as_the_best_for_all_scenes() {
        let of = |scene: &str, device: &str, name: &str, ms: f64| Record {
            scene: scene.to_owned(),
            key: format!("{scene} {device} {name}"),
            ..measured(device, name, 8, ms)
        };
        let records = judged([
            of("teapot", "gpu", "naive", 1.5),
            of("teapot", "gpu", "wide", 1.0),
            of("room", "gpu", "naive", 1.0),
            of("teapot", "cpu", "naive", 2.0),
            of("teapot", "cpu", "wide", 1.0),
            of("room", "cpu", "naive", 3.0),
            of("room", "cpu", "wide", 1.0),
        ]);
        let plots = side_by_side(&groups(&records));
        for (plot, rings) in plots.iter().zip([1, 2]) {
            for svg in [&plot.svg, &plot.narrow] {
                assert_eq!(svg.matches(">1.00 (1 of 2)<").count(), 1, "{svg}");
                assert!(svg.contains(">ringed: mean below 1.01<"), "{svg}");
                assert_eq!(svg.matches("class=\"ring\"").count(), rings, "{svg}");
            }
        }
    }

    /// In this test, the two devices are fastest with the same strategy, but at different local sizes.
    #[test]
    fn a_loss_is_that_of_the_best_local_size_of_the_other_device() {
        let records = judged([
            measured("gpu", "naive", 8, 3.0),
            measured("gpu", "naive", 16, 1.0),
            measured("cpu", "naive", 8, 1.0),
            measured("cpu", "naive", 16, 2.0),
        ]);
        let losses = &side_by_side(&groups(&records))[1].svg;
        let counts = [">1.00<", ">2.00<", ">3.00<"].map(|cell| losses.matches(cell).count());
        assert_eq!(counts, [2, 1, 1], "{losses}");
    }

    #[test]
    fn means_over_scenes_are_geometric() {
        let of = |scene: &str, device: &str, name: &str, ms: f64| Record {
            scene: scene.to_owned(),
            ..measured(device, name, 8, ms)
        };
        let records = judged([
            of("teapot", "gpu", "naive", 1.0),
            of("teapot", "gpu", "wide", 4.0),
            of("teapot", "cpu", "naive", 9.0),
            of("teapot", "cpu", "wide", 1.0),
            of("room", "gpu", "naive", 9.0),
            of("room", "gpu", "wide", 1.0),
            of("room", "cpu", "naive", 9.0),
            of("room", "cpu", "wide", 1.0),
        ]);
        // On the gpu, `naive` is the best for the teapot, where `wide` takes 4 times as long;
        // `wide` is the best for the room, where `naive` takes 9 times as long. On the cpu, `wide`
        // is the best for both scenes. The gpu's best strategy for the teapot, `naive`, takes 9 times the
        // best time on the cpu. The gpu's best strategy for the room, `wide`, takes the best time on the cpu.
        for plot in side_by_side(&groups(&records)) {
            assert!(plot.svg.contains(">3.00<") && plot.svg.contains(">2.00<"), "{}", plot.svg);
        }
    }

    #[test]
    fn a_loss_is_that_of_the_strategy_that_is_best_at_the_same_image_size() {
        let of = |width: u32, device: &str, name: &str, ms: f64| Record {
            key: format!("{device} {name} {width}"),
            image_size: [width, 500],
            ..measured(device, name, 8, ms)
        };
        let records = judged([
            of(800, "gpu", "naive", 1.0),
            of(800, "gpu", "wide", 4.0),
            of(1600, "gpu", "naive", 4.0),
            of(1600, "gpu", "wide", 1.0),
            of(800, "cpu", "naive", 9.0),
            of(800, "cpu", "wide", 1.0),
            of(1600, "cpu", "naive", 3.0),
            of(1600, "cpu", "wide", 1.0),
        ]);
        // The gpu's best strategy is `naive` for small images and `wide` for large images. On the
        // cpu, `naive` takes 9 times the best time for small images, and `wide` takes the best time
        // for large images.
        let plots = side_by_side(&groups(&records));
        assert!(plots[1].svg.contains(">3.00<"), "{}", plots[1].svg);
    }
}
