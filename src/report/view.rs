//! Draws the plots of one group of points, which is one scene at one image size on one device.

use super::paper;
use super::plot::Plot;
use super::plot::chart::{Across, Chart, Mark, Series};
use super::plot::heat::{Cell, HeatMap};
use super::plot::look::Look;
use super::plot::scale::Kind;
use super::plot::strip::{Row, Strip};
use super::words::{Looks, group_title, series_name, size_name, tip, title};
use crate::measure::Ranking;
use crate::numbers::{duration, ms};
use crate::record::{Group, Outcome, Record, interval, median, quartiles, ratio, word};

/// The image size in the figures of the student paper that raycl reproduces, in pixels across and down. The plots of
/// [`lines`] show the times that the paper published only at this image size.
pub const PAPER_SIZE: [u32; 2] = [800, 500];
/// In a heat map, the cell of an infeasible point shows a word for the reason. If the word has more
/// characters than `LONGEST_CODE`, the cell shows "unfit" instead.
const LONGEST_CODE: usize = 8;
/// The largest number of points (rows) in the plot of samples.
const STRIPS: usize = 14;

/// Returns the different local sizes of the records, sorted by the number of work-items and then by the
/// number of work-items across.
pub fn sizes<'a>(records: impl Iterator<Item = &'a Record>) -> Vec<[u32; 2]> {
    let mut sizes: Vec<_> = records.filter_map(|record| record.local_size).collect();
    sizes.sort_by_key(|[across, down]| (across * down, *across));
    sizes.dedup();
    sizes
}

/// Formats each local size as "16x16".
fn size_names(sizes: &[[u32; 2]]) -> Vec<String> {
    sizes.iter().map(|[across, down]| format!("{across}x{down}")).collect()
}

/// Returns the names of a group's strategies in the order of the group's records, each name once.
pub fn names<'a>(group: &Group<'a>) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for record in &group.records {
        if names.last() != Some(&record.name.as_str()) && !names.contains(&record.name.as_str()) {
            names.push(&record.name);
        }
    }
    names
}

/// Plots the time of a group's points over their local size, with a line per strategy. Returns `None` if no
/// point with a local size has a time. If `paper` is true, the plot of a group with the paper's image size
/// also shows the times that the paper published.
pub fn lines(group: &Group<'_>, looks: &Looks, kind: Kind, name: &str, paper: bool) -> Option<Plot> {
    let sizes = sizes(group.records.iter().copied());
    let x_of = |size: [u32; 2]| sizes.iter().position(|known| *known == size).map(|index| index as f64);
    let mut series = Vec::new();
    for strategy in names(group) {
        let records = group.records.iter().filter(|record| record.name == strategy);
        let marks = records.filter_map(|record| {
            let (x, y) = (x_of(record.local_size?)?, median(record)?);
            Some(Mark { x, y, interval: interval(record), tip: tip(record) })
        });
        let marks: Vec<_> = marks.collect();
        if !marks.is_empty() {
            series.push(Series {
                name: strategy.to_owned(),
                look: looks.look(strategy),
                joined: true,
                marks,
            });
        }
    }
    let published = if paper { published(group, looks, &x_of) } else { Vec::new() };
    if series.is_empty() {
        return None;
    }
    let beside = if published.is_empty() {
        String::new()
    } else {
        " Dashed lines are the paper's published points, measured on a device that the paper does not name."
            .to_owned()
    };
    series.extend(published);
    let chart = Chart {
        title: format!("Time against local size: {}", group_title(group)),
        x_label: "local size, in work-items across x down (ordered by the number of work-items)".into(),
        y_label: "median device time of a frame, ms".into(),
        across: Across::Names(size_names(&sizes)),
        up: kind,
        diagonal: false,
        series,
    };
    let caption = format!(
        "Bars are 95% intervals of the median. A mark has no bar if its interval is too short to be drawn, if at least one launch has fewer than five samples of the point, or if a sample has the time 0.{beside}"
    );
    Some(Plot::of(name, caption, &chart))
}

/// Returns the curves that the paper published for a group's scene and strategies. Returns no curves if the
/// group's image size is not the paper's.
fn published(group: &Group<'_>, looks: &Looks, x_of: &dyn Fn([u32; 2]) -> Option<f64>) -> Vec<Series> {
    if group.image_size != PAPER_SIZE {
        return Vec::new();
    }
    let curve = |strategy: &str| {
        let (figure, points) = paper::curve(group.scene, strategy)?;
        let marks = points.into_iter().filter_map(|(block, ms)| {
            let tip = format!("{strategy} at {block} x {block}\npublished {}\npaper, Figure {figure}: one value, no interval", duration(ms));
            Some(Mark { x: x_of([block; 2])?, y: ms, interval: None, tip })
        });
        let look = Look { dashed: true, ..looks.look(strategy) };
        Some(Series { name: format!("{strategy}, paper"), look, joined: true, marks: marks.collect() })
    };
    names(group).into_iter().filter_map(curve).collect()
}

/// Draws a heat map of a group's times, with a row per strategy and a column per local size. A cell's colour
/// shows the ratio of the point's time to the fastest point's time. The cell of a point without a time shows
/// a word for the reason. The cell of a point with too few samples, or with times of 0, has no colour.
pub fn heat(group: &Group<'_>, name: &str) -> Plot {
    let sizes = sizes(group.records.iter().copied());
    let Ranking { winners, ranked, .. } = group.ranking();
    let slower = |record: &Record| Some(ratio(record, ranked.first()?)?.middle);
    let mut codes: Vec<(String, String)> = Vec::new();
    let mut rows = Vec::new();
    for strategy in names(group) {
        let cell = |size: &[u32; 2]| {
            let mut records = group.records.iter().filter(|record| record.name == strategy);
            let Some(record) = records.find(|record| record.local_size == Some(*size)) else {
                return Cell::Empty;
            };
            let wins = winners.iter().any(|winner| winner.key == record.key);
            cell(record, slower(record), wins)
        };
        rows.push((strategy.to_owned(), sizes.iter().map(cell).collect()));
    }
    for record in group.records.iter().filter(|record| median(record).is_none()) {
        let code = code(record);
        if !codes.iter().any(|(known, _)| *known == code) {
            codes.push((code, meaning(record)));
        }
    }
    let map = HeatMap {
        id: name.to_owned(),
        title: format!("Median ms: {}", group_title(group)),
        x_label: "local size".into(),
        columns: size_names(&sizes),
        rows,
        ringed: "fastest or tied",
        codes,
    };
    let caption = "Light is fast, and dark is slow, on a logarithmic scale. A cell is hatched if its point has no time, or cannot be compared because it has too few samples or times of 0. Move the mouse pointer over a cell to see its interval, or the reason for the missing time."
        .to_owned();
    Plot { name: name.to_owned(), caption, svg: map.svg(), narrow: map.narrow_svg() }
}

/// Returns a record's cell in the heat map. `slower` is the ratio of the record's time to the fastest point's
/// time; `None` if the record has too few samples, or times of 0.
fn cell(record: &Record, slower: Option<f64>, wins: bool) -> Cell {
    let tip = tip(record);
    match (median(record), slower) {
        (Some(time), Some(slower)) => Cell::Time { slower, text: ms(time), wins, tip },
        (Some(time), None) => Cell::Nothing { code: ms(time), tip },
        (None, _) => Cell::Nothing { code: code(record), tip },
    }
}

/// Returns a word for the reason why a record has no time. The word is short enough for a cell of a heat map.
fn code(record: &Record) -> String {
    match record.outcome {
        Outcome::Measured => "?".into(),
        Outcome::Infeasible => {
            let word = word(record);
            // In "work-group" and "largest buffer", the last word ("group", "buffer") says more than the
            // first word, so the cell shows the last word.
            let last = word.rsplit([' ', '-']).next().unwrap_or_default();
            if (1..=LONGEST_CODE).contains(&last.chars().count()) {
                last.to_owned()
            } else {
                "unfit".to_owned()
            }
        }
        Outcome::OtherKind => "kind".into(),
        Outcome::BuildFailed => "build".into(),
        Outcome::LaunchFailed => "launch".into(),
        Outcome::WrongImage => "wrong".into(),
        Outcome::TimedOut => "slow".into(),
        Outcome::Crashed => "crash".into(),
    }
}

/// Returns a line that explains the word ([`code`]) which the heat map shows in a cell without a time. The
/// line names the point of `record` as an example.
fn meaning(record: &Record) -> String {
    let what = match record.outcome {
        Outcome::Infeasible => return format!("{}: {}", title(record), super::words::first_line(record)),
        Outcome::OtherKind => "the preset is meant for devices of another kind",
        Outcome::BuildFailed => "the program did not compile",
        Outcome::LaunchFailed => "the kernel could not be run or timed",
        Outcome::WrongImage => "the image differs from the reference",
        Outcome::TimedOut => "a frame, or the build with the first frame, took longer than --hang-limit",
        Outcome::Crashed | Outcome::Measured => "the measuring process crashed",
    };
    format!("{what}; {}: {}", title(record), super::words::first_line(record))
}

/// Plots the samples of a group's points, to show the noise of the times. Points with a rank (enough samples,
/// none of which is 0) come first, the fastest point at the top. The plot shows at most `STRIPS` points.
/// Returns `None` if none of these points has a median above 0.
pub fn strip(group: &Group<'_>, name: &str) -> Option<Plot> {
    let all = group.ranking().all();
    let rows: Vec<_> = all.iter().take(STRIPS).filter_map(|record| strip_row(record)).collect();
    if rows.is_empty() {
        return None;
    }
    let shown = if all.len() > rows.len() {
        format!(
            " Only {} of {} points are shown. Points without a rank come after the points with a rank.",
            rows.len(),
            all.len()
        )
    } else {
        String::new()
    };
    let strip = Strip { title: format!("Samples: {}", group_title(group)), rows };
    let caption = format!(
        "Each dot is a sample; within a row, earlier samples are further up. If a point has more than 120 samples, only every second, third, ... sample has a dot. The pale, low bar spans the quartiles, and the strong, tall bar spans the 95% interval of the median. If a point's times drift, its dots lie along a slope. Dots at the left or right edge stand for values beyond the edge. Points with fewer than five samples in a launch, or with a sample of the time 0, have no bars.{shown}"
    );
    Some(Plot { name: name.to_owned(), caption, svg: strip.svg(), narrow: strip.narrow_svg() })
}

fn strip_row(record: &Record) -> Option<Row> {
    let middle = median(record).filter(|middle| *middle > 0.0)?;
    let percent = |value: f64| 100.0 * (value / middle - 1.0);
    Some(Row {
        name: record
            .local_size
            .map_or(series_name(record), |_| format!("{} {}", record.name, size_name(record))),
        value: duration(middle),
        deviations: record.samples_ms.iter().copied().map(percent).collect(),
        interval: interval(record).map(|ends| ends.map(percent)),
        quartiles: quartiles(record).map(|ends| ends.map(percent)),
        tip: tip(record),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{judged, measured, sampled};
    use crate::record::groups;

    #[test]
    fn the_papers_times_are_shown_only_at_its_image_size() {
        let shows_them = |image_size: [u32; 2]| {
            let record = |side| Record { image_size, ..measured("gpu", "naive", side, 10.0) };
            let records = judged([4, 8].map(record));
            let groups = groups(&records);
            let plot = lines(&groups[0], &Looks::of(&groups), Kind::Log, "lines", true).unwrap();
            let is_dashed = plot.svg.contains("stroke-dasharray=\"5 4\"") && plot.svg.contains("dot hollow");
            assert_eq!(plot.caption.contains("the paper's published points"), is_dashed, "{}", plot.svg);
            // The paper has times at more local sizes than the two that were measured. The plot shows only
            // the paper's times at the two measured sizes, each with a hollow marker; the third hollow marker
            // is in the legend.
            assert_eq!(plot.svg.matches("dot hollow").count(), if is_dashed { 3 } else { 0 });
            is_dashed
        };
        assert_eq!([PAPER_SIZE, [1600, 1000]].map(shows_them), [true, false]);
    }

    #[test]
    fn a_sample_is_shown_as_a_percentage_above_the_median() {
        let record = sampled("naive", (0..5).map(|index| (0, if index == 4 { 12.0 } else { 10.0 })));
        let deviations = strip_row(&record).unwrap().deviations.into_iter();
        assert_eq!(deviations.map(f64::round).collect::<Vec<_>>(), [0.0, 0.0, 0.0, 0.0, 20.0]);
    }

    #[test]
    fn a_cell_has_a_time_or_the_reason_why_there_is_none() {
        use crate::record::fixtures::infeasible;
        let failed = |outcome, side| Record { outcome, ..infeasible("gpu", "naive", side, "why") };
        let records = judged([
            measured("gpu", "naive", 4, 10.0),
            measured("gpu", "naive", 8, 30.0),
            infeasible("gpu", "naive", 16, "__local memory: 2 B > 1 B"),
            failed(Outcome::WrongImage, 32),
            failed(Outcome::WrongImage, 2),
            failed(Outcome::TimedOut, 1),
        ]);
        let plot = heat(&groups(&records)[0], "heat");
        for (text, count) in [
            (">10.00<", 1),
            (">30.00<", 1),
            ("class=\"ring\"", 1),
            (">wrong<", 3),
            (">slow<", 2),
            (">local<", 2),
        ] {
            assert_eq!(plot.svg.matches(text).count(), count, "{text}: {}", plot.svg);
        }
        assert!(plot.svg.contains("3.0 times as slow"), "{}", plot.svg);
        assert!(plot.svg.contains("the image differs from the reference; naive at"), "{}", plot.svg);
    }

    #[test]
    fn a_time_of_few_samples_or_of_zero_has_no_colour_and_does_not_set_the_scale() {
        use crate::record::fixtures::few;
        let records = judged([
            few("gpu", "naive", 1, 0.01, 3),
            few("gpu", "naive", 2, 0.0, 30),
            measured("gpu", "naive", 4, 10.0),
            measured("gpu", "naive", 8, 30.0),
            few("gpu", "naive", 16, 9000.0, 3),
        ]);
        let groups = groups(&records);
        let plot = heat(&groups[0], "heat");
        assert!(plot.svg.contains("3.0 times as slow"), "{}", plot.svg);
        assert_eq!(plot.svg.matches("class=\"ring\"").count(), 1);
        for text in [">0.01000<", ">0<", ">9000<", "times below the timer", "not enough samples (n = 3)"] {
            assert!(plot.svg.contains(text), "{text}: {}", plot.svg);
        }
        let few = judged([few("gpu", "naive", 1, 0.01, 3)]);
        assert!(heat(&crate::record::groups(&few)[0], "heat").svg.contains(">0.01000<"));
    }

    #[test]
    fn every_outcome_without_a_time_has_a_code_and_a_meaning() {
        use crate::record::fixtures::infeasible;
        for (outcome, expected, means) in [
            (Outcome::OtherKind, "kind", "the preset is meant for devices of another kind; naive"),
            (Outcome::BuildFailed, "build", "the program did not compile; naive"),
            (Outcome::LaunchFailed, "launch", "the kernel could not be run or timed; naive"),
            (Outcome::WrongImage, "wrong", "the image differs from the reference; naive"),
            (
                Outcome::TimedOut,
                "slow",
                "a frame, or the build with the first frame, took longer than --hang-limit; naive",
            ),
            (Outcome::Crashed, "crash", "the measuring process crashed; naive"),
        ] {
            let record = Record { outcome, ..infeasible("gpu", "naive", 8, "first\nsecond") };
            assert_eq!(code(&record), expected);
            let text = meaning(&record);
            assert!(text.starts_with(means) && text.ends_with(": first"), "{text}");
        }
        let of = |reason: &str| code(&infeasible("gpu", "naive", 8, reason));
        for (reason, expected) in [
            ("__local memory: 2 B > 1 B", "local"),
            ("__constant memory: 2 B > 1 B", "constant"),
            ("the host's memory (free now): 2 B > 1 B", "host"),
            ("work-group: 64 x 64 = 4096 work-items > the device's limit of 1024", "group"),
            ("largest buffer: 2 B > 1 B", "buffer"),
            ("a reason that is long: 2 B > 1 B", "unfit"),
            ("no colon", "unfit"),
            (": 2 B > 1 B", "unfit"),
        ] {
            assert_eq!(of(reason), expected);
        }
    }

    #[test]
    fn sizes_and_strategies_are_listed_once_in_their_order() {
        let at = |name: &str, size: [u32; 2]| Record {
            local_size: Some(size),
            key: format!("{name} {size:?}"),
            ..measured("gpu", name, 8, 10.0)
        };
        let records =
            judged([at("wide", [16, 2]), at("naive", [2, 16]), at("naive", [4, 4]), at("wide", [4, 4])]);
        assert_eq!(sizes(records.iter()), [[4, 4], [2, 16], [16, 2]]);
        assert_eq!(size_names(&[[16, 2]]), ["16x2"]);
        assert_eq!(names(&groups(&records)[0]), ["naive", "wide"]);
    }

    #[test]
    fn of_many_points_only_the_fastest_have_their_samples_shown() {
        let shown = |count: u32| {
            let records: Vec<Record> =
                (1..=count).map(|side| measured("gpu", "naive", side, f64::from(side))).collect();
            let records = judged(records);
            strip(&groups(&records)[0], "samples").unwrap()
        };
        let all = shown(14);
        assert!(!all.caption.contains("are shown") && all.svg.contains("naive 14x14"), "{}", all.caption);
        let some = shown(16);
        assert!(
            some.caption.ends_with(
                " Only 14 of 16 points are shown. Points without a rank come after the points with a rank."
            ),
            "{}",
            some.caption
        );
        assert!(some.svg.contains("naive 14x14") && !some.svg.contains("naive 15x15"));
        assert!(
            strip(&groups(&[Record { median_ms: None, ..measured("gpu", "naive", 8, 1.0) }])[0], "a")
                .is_none()
        );
    }

    #[test]
    fn a_row_of_samples_has_the_points_name_time_and_bars() {
        let record = Record { q1_ms: Some(9.0), q3_ms: Some(12.0), ..measured("gpu", "naive", 8, 10.0) };
        let row = strip_row(&judged([record])[0]).unwrap();
        assert_eq!((row.name.as_str(), row.value.as_str()), ("naive 8x8", "10.00 ms"));
        let [low, high] = row.quartiles.unwrap();
        assert!((low + 10.0).abs() < 1e-9 && (high - 20.0).abs() < 1e-9, "{low} {high}");
        let [low, high] = row.interval.unwrap();
        assert!(low < 0.0 && high > 0.0, "{low} {high}");
    }
}
