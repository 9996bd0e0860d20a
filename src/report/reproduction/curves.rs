//! Plots the curves in Figures 6 to 8 of the student paper that raycl reproduces, together with raycl's
//! measurements. A curve shows the times for several block sizes.

use super::with_most;
use crate::numbers::{by, duration};
use crate::record::{Group, Record, interval, median, not_enough, ranking, ratio};
use crate::report::claims::Run;
use crate::report::paper::{self, CURVES};
use crate::report::plot::Plot;
use crate::report::plot::chart::{Across, Chart, Mark, Series};
use crate::report::plot::look::Look;
use crate::report::plot::scale::Kind;
use crate::report::view::PAPER_SIZE;
use crate::report::words::{other_size, times, tip};

/// A curve in a figure of the paper, and raycl's measurements of the same points.
struct Curve<'a> {
    name: &'static str,
    number: usize,
    published: Vec<(u32, f64)>,
    ours: Vec<&'a Record>,
}

fn curves<'a>(figure: u32, groups: &[Group<'a>], device: &str) -> Vec<Curve<'a>> {
    let of_figure = CURVES.iter().filter(|(of, ..)| *of == figure);
    of_figure
        .enumerate()
        .filter_map(|(number, (_, name, scene, preset))| {
            let (_, published) = paper::curve(scene, preset)?;
            let group = groups.iter().find(|group| group.scene == *scene && group.device == device);
            let records = group.map(|group| group.records.as_slice()).unwrap_or_default();
            let of_preset = records.iter().copied().filter(|record| record.preset.as_deref() == Some(preset));
            let square = of_preset.filter(|record| record.local_size.is_some_and(|[x, y]| x == y));
            let ours = square.filter(|record| median(record).is_some()).collect();
            Some(Curve { name, number, published, ours })
        })
        .collect()
}

/// Returns two plots of the paper's figure `number`, and the rows of the figure's table (see [`rows`]). The
/// first plot shows the curves' shapes (times relative to the fastest point of each curve), and the second
/// plot shows milliseconds. All measurements come from one run, since times of different runs must not be
/// joined to a curve. Returns `None` if no point of the figure was measured.
pub(super) fn curves_of(
    number: u32,
    runs: &[Run<'_>],
    device: &str,
    suffix: &str,
) -> Option<(Vec<Plot>, Vec<[String; 5]>)> {
    let points = |run: &Run<'_>| {
        curves(number, &run.groups, device).iter().map(|curve| curve.ours.len()).sum::<usize>()
    };
    // The experiment of another figure may contain a few points of this figure at the paper's image size. A
    // curve of a few points would say little, so a run is used only if it has at least half as many of the
    // figure's points as the run with the most points.
    let most = runs.iter().map(points).max().unwrap_or(0);
    let run = with_most(runs, most.div_ceil(2).max(1), points)?;
    let curves = curves(number, &run.groups, device);
    let device = match other_size(run.image_size()) {
        Some(size) => format!("{device}, {size} (the paper: {})", by(PAPER_SIZE)),
        None => device.to_owned(),
    };
    let shapes = Plot::of(
        format!("figure-{number}-shapes{suffix}"),
        "Each curve is divided by the time of its own fastest point, so that shapes can be compared although the devices differ. Points with fewer than five samples in a launch, or with a sample of the time 0, are left out.",
        &drawn(&curves, number, &device, true),
    );
    let times = Plot::of(
        format!("figure-{number}{suffix}"),
        "Solid lines are our times on this device. Dashed lines are the paper's times, on a device that the paper does not name. The scale is logarithmic.",
        &drawn(&curves, number, &device, false),
    );
    Some((vec![shapes, times], curves.iter().flat_map(rows).collect()))
}

/// Draws the curves of a figure, with block sizes on the horizontal axis. If `as_shapes` is false, the curves show
/// milliseconds; if `as_shapes` is true, each time is divided by the time of the curve's fastest point.
fn drawn(curves: &[Curve<'_>], number: u32, device: &str, as_shapes: bool) -> Chart {
    let mut blocks: Vec<u32> = curves
        .iter()
        .flat_map(|curve| {
            let ours = curve.ours.iter().filter_map(|record| record.local_size.map(|size| size[0]));
            curve.published.iter().map(|(block, _)| *block).chain(ours)
        })
        .collect();
    blocks.sort_unstable();
    blocks.dedup();
    let x_of = |block: u32| blocks.iter().position(|known| *known == block).map(|index| index as f64);
    let series = curves.iter().flat_map(|curve| both(curve, &x_of, as_shapes)).collect();
    Chart {
        title: if as_shapes {
            format!("Figure {number} as shapes: {device}")
        } else {
            format!("Figure {number}: {device}")
        },
        x_label: "block size".into(),
        y_label: if as_shapes {
            "time divided by that of the curve's fastest point".into()
        } else {
            "time, ms".into()
        },
        across: Across::Names(blocks.iter().map(|block| format!("{block}x{block}")).collect()),
        up: Kind::Log,
        diagonal: false,
        series,
    }
}

fn both(curve: &Curve<'_>, x_of: &dyn Fn(u32) -> Option<f64>, as_shapes: bool) -> Vec<Series> {
    let least = |values: &mut dyn Iterator<Item = f64>| {
        if as_shapes { values.fold(f64::INFINITY, f64::min) } else { 1.0 }
    };
    let theirs = least(&mut curve.published.iter().map(|(_, ms)| *ms));
    // A curve's shape consists of ratios of times, so points with too few samples for a ratio are left out.
    let ours = || curve.ours.iter().copied().filter(|record| !as_shapes || interval(record).is_some());
    // The fastest point is found by ratios, too. By these ratios, another point may be faster than the point with
    // the least median.
    let fastest = ranking(ours()).ranked.first().copied();
    let published = curve.published.iter().filter_map(|(block, ms)| {
        let tip = format!("{} at {block} x {block}\npublished {}", curve.name, duration(*ms));
        Some(Mark { x: x_of(*block)?, y: ms / theirs, interval: None, tip })
    });
    let ours = ours().filter_map(|record| {
        let (y, interval) = match as_shapes {
            true => multiple(record, fastest?)?,
            false => (median(record)?, interval(record)),
        };
        Some(Mark { x: x_of(record.local_size?[0])?, y, interval, tip: tip(record) })
    });
    let series = |name: String, dashed, marks| Series {
        name,
        look: Look { number: curve.number, dashed },
        joined: true,
        marks,
    };
    let all = [
        series(format!("{}, ours", curve.name), false, ours.collect::<Vec<_>>()),
        series(format!("{}, paper", curve.name), true, published.collect()),
    ];
    all.into_iter().filter(|one| !one.marks.is_empty()).collect()
}

/// Returns a record's time as a multiple of the fastest record's time, and the 95% interval of this ratio. The ratio of
/// the fastest record to itself is exactly 1.
fn multiple(record: &Record, fastest: &Record) -> Option<(f64, Option<[f64; 2]>)> {
    if record.key == fastest.key {
        return Some((1.0, None));
    }
    ratio(record, fastest).map(|ratio| (ratio.middle, Some([ratio.low, ratio.high])))
}

/// Returns table rows: curve, block size, published time, raycl's time, and the published time divided by raycl's time.
/// If raycl's image size differs from the paper's, or if raycl's point has too few samples or times of 0, the last text
/// of a row says so instead of a ratio. The text "-" stands for an unknown time or ratio.
fn rows(curve: &Curve<'_>) -> Vec<[String; 5]> {
    let ours = |block: u32| curve.ours.iter().find(|record| record.local_size == Some([block; 2]));
    let row = |(block, ms): &(u32, f64)| {
        let time = ours(*block).and_then(|record| median(record));
        let obstacle = |record: &&Record| match other_size(record.image_size) {
            Some(_) => Some("other image size".to_owned()),
            None => not_enough(record),
        };
        [
            curve.name.to_owned(),
            format!("{block} x {block}"),
            crate::numbers::ms(*ms),
            time.map_or("-".into(), crate::numbers::ms),
            ours(*block).and_then(obstacle).or(time.map(|time| times(*ms, time))).unwrap_or("-".into()),
        ]
    };
    curve.published.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{few, judged, measured, sampled};
    use crate::record::groups;

    #[test]
    fn only_square_groups_are_points_of_the_papers_curves() {
        let oblong =
            Record { key: "oblong".into(), local_size: Some([8, 4]), ..measured("gpu", "naive", 4, 1.0) };
        let records = judged([measured("gpu", "naive", 8, 2.0), oblong]);
        let groups = groups(&records);
        let teapot = &curves(6, &groups, "gpu")[0];
        let sizes: Vec<_> = teapot.ours.iter().map(|record| record.local_size).collect();
        assert_eq!(sizes, [Some([8, 8])]);
    }

    #[test]
    fn a_curve_has_only_the_points_of_its_own_device() {
        let records = judged([measured("cpu", "naive", 8, 5.0), measured("gpu", "naive", 8, 2.0)]);
        let groups = groups(&records);
        let devices = |device: &str| {
            let teapot = curves(6, &groups, device).swap_remove(0);
            teapot.ours.iter().map(|record| record.device.clone()).collect::<Vec<_>>()
        };
        assert_eq!(devices("cpu"), ["cpu"]);
        assert_eq!(devices("gpu"), ["gpu"]);
        assert!(devices("accelerator").is_empty());
    }

    #[test]
    fn a_curve_is_drawn_in_milliseconds_or_as_a_multiple_of_its_fastest_points_time() {
        let records = judged([measured("gpu", "naive", 4, 6.0), measured("gpu", "naive", 8, 2.0)]);
        let curve = Curve {
            name: "naive",
            number: 1,
            published: vec![(4, 300.0), (8, 100.0), (16, 200.0)],
            ours: records.iter().collect(),
        };
        let drawn = drawn(std::slice::from_ref(&curve), 6, "gpu", false);
        let heights = |chart: &Chart| -> Vec<Vec<[f64; 2]>> {
            chart.series.iter().map(|one| one.marks.iter().map(|mark| [mark.x, mark.y]).collect()).collect()
        };
        assert_eq!(
            heights(&drawn),
            [vec![[0.0, 6.0], [1.0, 2.0]], vec![[0.0, 300.0], [1.0, 100.0], [2.0, 200.0]],]
        );
        assert_eq!(drawn.series.iter().map(|one| one.look.dashed).collect::<Vec<_>>(), [false, true]);
        let shapes = heights(&super::drawn(std::slice::from_ref(&curve), 6, "gpu", true));
        assert_eq!(shapes[1], [[0.0, 3.0], [1.0, 1.0], [2.0, 2.0]]);
        assert!((shapes[0][0][1] - 3.0).abs() < 1e-9 && (shapes[0][1][1] - 1.0).abs() < 1e-9, "{shapes:?}");
        let labels = |as_shapes| {
            let chart = super::drawn(std::slice::from_ref(&curve), 6, "gpu", as_shapes);
            [chart.title, chart.y_label]
        };
        assert_eq!(labels(false), ["Figure 6: gpu", "time, ms"]);
        let of_shapes = ["Figure 6 as shapes: gpu", "time divided by that of the curve's fastest point"];
        assert_eq!(labels(true), of_shapes);
        let rows = rows(&curve);
        assert_eq!(rows[1], ["naive", "8 x 8", "100.0", "2.000", "50.0×"]);
        assert_eq!(rows[2][3..], ["-", "-"]);
    }

    /// At the local size 4 x 4, the point is slow in one of three launches. Its median is the least, but it takes
    /// longer on average.
    #[test]
    fn no_point_of_a_shape_is_below_the_fastest_point() {
        let at = |side: u32, ms: [f64; 3]| {
            let samples = (0..15).map(move |index| (index / 5, ms[index as usize / 5]));
            Record { key: format!("{side}"), local_size: Some([side; 2]), ..sampled("naive", samples) }
        };
        let records = judged([at(4, [1.0, 1.0, 4.0]), at(8, [1.2; 3])]);
        let ours = records.iter().collect();
        let curve = Curve { name: "naive", number: 1, published: vec![(4, 300.0)], ours };
        let shape = drawn(std::slice::from_ref(&curve), 6, "gpu", true).series.remove(0);
        let [slow, fastest] = &shape.marks[..] else { panic!("two marks") };
        assert!(slow.y > 1.0 && slow.interval.is_some(), "{}", slow.y);
        assert_eq!((fastest.y, fastest.interval), (1.0, None));
    }

    #[test]
    fn a_point_with_too_few_samples_has_no_place_in_a_shape_even_if_it_is_the_fastest() {
        let records = judged([
            few("gpu", "naive", 4, 1.0, 3),
            measured("gpu", "naive", 8, 2.0),
            measured("gpu", "naive", 16, 4.0),
        ]);
        let ours = records.iter().collect();
        let curve = Curve { name: "naive", number: 1, published: vec![(4, 300.0)], ours };
        let marks = |as_shapes| {
            let first = drawn(std::slice::from_ref(&curve), 6, "gpu", as_shapes).series.remove(0);
            let marks: Vec<_> = first.marks.iter().map(|mark| (mark.x, mark.y.round())).collect();
            (first.name, marks)
        };
        let name = "naive, ours".to_owned();
        assert_eq!(marks(false), (name.clone(), vec![(0.0, 1.0), (1.0, 2.0), (2.0, 4.0)]));
        assert_eq!(marks(true), (name, vec![(1.0, 1.0), (2.0, 2.0)]));
    }
}
