//! Writes `summary.md`, with the experiment's question, the expected answer, and the results.

mod changes;

use std::fmt::Write;

use super::modes::{to_mind, two_modes};
use super::point_times::{interval, launches, median};
use super::ranking::may_be_faster;
use super::ratios::ratio;
use super::smallest_difference::smallest_difference_note;
use super::summary::{Group, few_names, groups, not_enough, quartiles, scene_notes};
use super::terminal::percent;
use super::types::{HOST, Record};
use crate::device::common_names;
use crate::numbers::{align_points, by, duration, ms, significant};
use crate::printer::{line, markdown};

/// Number of columns in the table of a group's records.
const COLUMNS: usize = 11;
const HEADER: [&str; COLUMNS] = [
    "strategy",
    "local size",
    "median ms",
    "IQR ms",
    "95% interval ms",
    "n",
    "frame Mrays/s",
    "primary Mrays/s",
    "Gtests/s",
    "of peak",
    "outcome",
];
/// The indices of the left-aligned columns, which contain words. All other columns are for numbers.
const LEFT: [usize; 2] = [0, 10];
/// The indices of the columns of numbers whose decimal points are aligned.
const DECIMAL: [usize; 5] = [2, 3, 6, 7, 8];

/// Returns the summary as Markdown. The summary depends only on the function's arguments, so the same records
/// always yield the same summary.
pub fn summary_markdown(records: &[Record], notes: &[String], question: &str, expectation: &str) -> String {
    let mut text = format!("# {}\n", markdown(question));
    if !expectation.is_empty() {
        text += &format!("\nExpected: {}\n", markdown(expectation));
    }
    text.extend(notes.iter().map(|note| format!("\nNote: {}\n", line(note))));
    let groups = groups(records);
    let names = common_names(groups.iter().map(|group| group.device));
    for group in &groups {
        let size = by(group.image_size);
        let device = names[group.device].as_str();
        // Writing to a String cannot fail, so the `Result`s of `write!` are ignored.
        let _ = write!(text, "\n## {}, {size}, {}\n\n", markdown(group.scene), markdown(device));
        if device != group.device {
            let _ = write!(text, "The device's name in the records is {}.\n\n", markdown(group.device));
        }
        if group.device != HOST {
            text.push_str(&verdict(group, &groups));
            text.push('\n');
        }
        text.push_str(&table(group));
        text.push_str(&warnings(group));
        text.push_str(&failures(group));
    }
    text.push_str(&changes::section(records, &groups, &names));
    let notes = scene_notes(records);
    if !notes.is_empty() {
        text.push_str("\n## Notes on scenes\n\n");
        text.extend(notes.iter().map(|(scene, note)| format!("- {}: {}\n", markdown(scene), line(note))));
    }
    text.push_str(
        "\nTimes of kernels are device times of whole frames; times of baselines, which run on the host, are from the host's clock. On a CPU, samples are left out if threads probably had to wait for a processor, or if the host of a virtual machine had probably moved the machine's processors to other cores. IQR is the distance between the quartiles. The interval is the 95% interval of the median, computed from the differences between launches and the usual difference between runs. The ratio of the times of two points that were measured together is computed from samples that were taken close together in time. If two points were not measured together, their ratio is computed from the ratios of both times to the time of a control point that was measured with both. If there is no such control point, their ratio is computed from their medians. A ratio has a 95% interval of its own. \"Two modes\" means that the samples lie around two values; the median may be close to either value. A point ties with the fastest if the samples do not show that the point takes more than 1% longer. Points with fewer than five samples in a launch, or with times of 0, have neither an interval nor a rank. \
         If the driver caches compiled programs, all launches run the same compiled program, so the intervals do not include differences between builds. \"Frame rays per second\" is the number of all rays of a frame, primary and shadow, divided by the frame's time. \"Primary rays per second\" is the number of rays of a separate primary pass, divided by that pass's time. \"Tests per second\" is the number of primary rays times the number of triangles, divided by the time of the primary pass or, if passes are fused, by the time of the frame. \"Of peak\" is the achieved fraction of the device's measured peak rate of \
         multiply-adds.\n",
    );
    text
}

/// Names the fastest point, or the points that tie for the fastest. If a point without a rank may be as fast
/// as these points, says that the result is not certain. Says how much faster the fastest point is than the
/// baselines and the best point of the preset `naive`. Also names points without a rank, and states the
/// smallest difference that the samples can show. If no point has a rank, says that there is no winner, or
/// that nothing could be measured.
fn verdict(group: &Group<'_>, groups: &[Group<'_>]) -> String {
    let ranking = group.ranking();
    let Some(best) = ranking.winners.first() else {
        return match ranking.unranked.is_empty() {
            true => "Nothing could be measured.\n".into(),
            false => format!("No winner.{}\n", unranked(&ranking.unranked)),
        };
    };
    let names: Vec<_> = ranking.winners.iter().map(|record| title(record)).collect();
    let mut text = match names.as_slice() {
        [one] => format!("Fastest: **{one}**"),
        several => format!("Fastest, a tie: **{}**", several.join("**, **")),
    };
    let doubt = match may_be_faster(&ranking) {
        true => ", which is not certain: a point without a rank may be as fast",
        false => "",
    };
    let _ = write!(text, " at {}{doubt}.", duration(median(best).unwrap_or_default()));
    text += &(speed_ups(group, groups, best) + &unranked(&ranking.unranked));
    text.extend(smallest_difference_note(group.records.iter().copied()).map(|note| format!(" {note}")));
    text + "\n"
}

/// Returns sentences with the speed-up of the best point over each of the host's baselines, and over the best point of
/// the preset `naive` (unless this point is the best point itself). If a speed-up is unknown, the sentence states the
/// reason.
fn speed_ups(group: &Group<'_>, groups: &[Group<'_>], best: &Record) -> String {
    let naive = group.naive().filter(|naive| naive.key != best.key);
    let others = group.baselines(groups).into_iter().chain(naive);
    let than = |other: &Record| match ratio(other, best) {
        None => format!(" Against {}: {}.", title(other), not_enough(other).unwrap_or_default()),
        Some(ratio) => {
            let [middle, low, high] = [ratio.middle, ratio.low, ratio.high].map(|part| significant(part, 3));
            format!(" The fastest point is {middle} times ({low} to {high}) as fast as {}.", title(other))
        }
    };
    others.map(than).collect()
}

/// Returns a sentence that names up to four of the points without a rank; empty if all points have a rank.
fn unranked(records: &[&Record]) -> String {
    match records.is_empty() {
        true => String::new(),
        false => format!(" Points without a rank: {}.", few_names(records, title)),
    }
}

/// Returns a point's strategy and local size, such as "naive at 8 x 8".
fn title(record: &Record) -> String {
    match record.local_size {
        Some(size) => format!("{} at {}", markdown(&record.name), by(size)),
        None => markdown(&record.strategy),
    }
}

/// Returns a table of all records in the group: ranked records from the fastest to the slowest, then records
/// without a rank, then records without a time.
fn table(group: &Group<'_>) -> String {
    let ranking = group.ranking();
    let failed = group.failures().into_iter().map(|(record, _)| record);
    let mut rows: Vec<_> = ranking
        .all()
        .into_iter()
        .chain(failed)
        .map(|record| row(record, ranking.winners.iter().any(|winner| winner.key == record.key)))
        .collect();
    for column in DECIMAL {
        align_points(rows.iter_mut().map(|row| &mut row[column]).collect());
    }
    lay_out(&HEADER.map(String::from), &rows, &LEFT)
}

fn row(record: &Record, wins: bool) -> [String; COLUMNS] {
    let time = median(record);
    let number = |value: Option<f64>, text: fn(f64) -> String| {
        value.filter(|_| time.is_some()).map_or("-".into(), text)
    };
    let name = markdown(if record.is_baseline() { &record.strategy } else { &record.name });
    let interval = interval(record).map(|[low, high]| format!("{} to {}", ms(low), ms(high)));
    [
        if wins && !record.is_baseline() { format!("**{name}**") } else { name },
        record.local_size.map_or("-".into(), by),
        number(time, ms),
        number(quartiles(record).map(|[q1, q3]| q3 - q1), |iqr| significant(iqr, 2)),
        interval.or(not_enough(record)).unwrap_or("-".into()),
        samples(record),
        number(record.frame_rays_per_s(), |rays| significant(rays / 1e6, 3)),
        number(record.primary_rays_per_s(), |rays| significant(rays / 1e6, 3)),
        number(record.tests_per_s, |tests| significant(tests / 1e9, 3)),
        number(record.limit_fraction, percent),
        outcome(record),
    ]
}

/// Formats an outcome, such as "measured" or "measured, two modes".
fn outcome(record: &Record) -> String {
    let modes = if two_modes(record).is_some() { ", two modes" } else { "" };
    format!("{}{modes}", record.outcome.name())
}

/// Formats the number of a record's samples: "10" for a single launch, "15 in 3" for 15 samples in 3
/// launches.
fn samples(record: &Record) -> String {
    match (record.samples_ms.len(), launches(record)) {
        (n, 0 | 1) => n.to_string(),
        (n, launches) => format!("{n} in {launches}"),
    }
}

/// Returns a Markdown table. The cells are padded with blanks, so that the columns are also aligned in the
/// source text. `left` contains the indices of the left-aligned columns; all other columns are right-aligned.
fn lay_out<R: AsRef<[String]>>(header: &[String], rows: &[R], left: &[usize]) -> String {
    let all = || std::iter::once(header).chain(rows.iter().map(R::as_ref));
    // Some Markdown parsers require at least three dashes below a column's heading.
    let widest =
        |column: usize| all().map(|row| row[column].chars().count()).max().unwrap_or_default().max(3);
    let widths: Vec<usize> = (0..header.len()).map(widest).collect();
    let rule = |(column, width): (usize, &usize)| {
        let end = if left.contains(&column) { "-" } else { ":" };
        "-".repeat(width - 1) + end
    };
    let rule: Vec<String> = widths.iter().enumerate().map(rule).collect();
    let line = |row: &[String]| {
        let pad = |(column, cell): (usize, &String)| {
            let width = widths[column];
            if left.contains(&column) { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        };
        format!("| {} |\n", row.iter().enumerate().map(pad).collect::<Vec<_>>().join(" | "))
    };
    let body: String = rows.iter().map(|row| line(row.as_ref())).collect();
    line(header) + &line(&rule) + &body
}

/// Returns a Markdown list of the warnings about measured times, each with its point.
fn warnings(group: &Group<'_>) -> String {
    let warned = group.ranking().all().into_iter().filter_map(|record| Some((record, to_mind(record)?)));
    let lines: String =
        warned.map(|(record, warning)| format!("- {}: {}\n", title(record), line(&warning))).collect();
    if lines.is_empty() { lines } else { format!("\nWarnings:\n\n{lines}") }
}

/// Returns a Markdown list of the points without a time, each with the reason; an empty text if all points have a time.
fn failures(group: &Group<'_>) -> String {
    let failures = group.failures();
    if failures.is_empty() {
        return String::new();
    }
    let mut text = "\nPoints without a time:\n\n".to_string();
    for (record, reason) in failures {
        // A compiler's log has many lines. The summary shows only the log's first line; the record contains
        // the whole log.
        let first = reason.lines().next().unwrap_or_default();
        let _ = writeln!(text, "- {}, {}: {}", title(record), record.outcome.name(), markdown(first));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{few, infeasible, judged, measured, sampled};
    use super::*;

    #[test]
    fn a_summary_says_question_winner_speed_up_and_reasons() {
        let records = judged([
            measured("host", "serial-f32", 0, 420.0),
            measured("pocl", "naive", 8, 84.0),
            measured("pocl", "wide", 1, 10.0),
            measured("pocl", "wide", 2, 10.05),
            infeasible("pocl", "local-vectors", 32, "__local: 108 B x 32 x 32 = 110592 B > 49152 B"),
        ]);
        let text = summary_markdown(&records, &["1 point.".to_owned()], "Which is best?", "Wide is.");
        assert!(text.starts_with("# Which is best?\n\nExpected: Wide is.\n\nNote: 1 point.\n"), "{text}");
        for expected in [
            "## teapot, 800 x 500, pocl",
            "Fastest, a tie: **wide at 1 x 1**, **wide at 2 x 2** at 10.00 ms.",
            // All samples of a point are equal, so only the assumed differences between runs make the ranges wide.
            "The fastest point is 42.0 times (39.6 to 44.5) as fast as serial-f32.",
            "8.40 times (8.31 to 8.49) as fast as naive at 8 x 8.",
            "- local-vectors at 32 x 32, infeasible: \\_\\_local: 108 B x 32 x 32 = 110592 B > 49152 B",
        ] {
            assert!(text.contains(expected), "{expected:?} is not in\n{text}");
        }
        let rows: Vec<_> = text.lines().filter(|line| line.starts_with('|')).collect();
        let pocl = &rows[rows.len() - 6..];
        assert!(pocl.iter().all(|row| row.chars().count() == pocl[0].chars().count()), "{pocl:#?}");
        assert!(pocl[2].starts_with("| **wide**"), "{pocl:#?}");
    }

    #[test]
    fn the_winner_is_compared_with_the_host_at_the_same_scene_and_image_size() {
        let host = |ms: f64| measured("host", "serial-f32", 0, ms);
        let records = judged([
            Record { image_size: [1600, 1000], ..host(840.0) },
            Record { scene: "room".into(), ..host(210.0) },
            host(420.0),
            measured("pocl", "wide", 1, 10.0),
        ]);
        let text = summary_markdown(&records, &[], "?", "!");
        let fastest = text.lines().find(|line| line.starts_with("Fastest")).expect("a winner");
        assert!(fastest.contains(" 42.0 times (39.6 to 44.5) as fast as serial-f32."), "{text}");
    }

    #[test]
    fn rates_have_the_units_of_their_columns() {
        // The frame takes 10 ms, of which its 400,000 primary rays take 5 ms. The frame has half as many
        // shadow rays as primary rays.
        let (primary_ms, shadow_rays) = (Some(5.0), Some(200_000));
        let record = Record { primary_ms, shadow_rays, ..measured("pocl", "wide", 1, 10.0) };
        let text = summary_markdown(&judged([record]), &[], "?", "!");
        let row =
            text.lines().find(|line| line.contains("**wide**") && line.starts_with('|')).expect("a row");
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        assert_eq!(cells[7..10], ["60.0", "80.0", "40.0"], "{text}");
    }

    #[test]
    fn a_summary_without_an_expectation_has_no_line_for_it() {
        let summary = |expectation| summary_markdown(&[], &[], "Which?", expectation);
        assert!(summary("This.").starts_with("# Which?\n\nExpected: This.\n"));
        assert!(!summary("").contains("Expected"));
    }

    #[test]
    fn names_and_questions_are_text_and_no_markdown() {
        let hostile = "<b>|\n# \u{1b}";
        let records = judged([measured(hostile, hostile, 8, 84.0)]);
        let text = summary_markdown(&records, &[hostile.to_owned()], hostile, hostile);
        assert!(!text.contains("\n# ") && !text.contains('\u{1b}'), "{text}");
        assert!(text.starts_with("# \\<b>\\| \\# \\\\u001b\n"), "{text}");
    }

    #[test]
    fn few_samples_have_no_interval_and_no_say() {
        let records = judged([
            few("host", "serial-f32", 0, 1798.0, 1),
            few("pocl", "naive", 8, 5.0, 3),
            measured("pocl", "wide", 1, 10.0),
        ]);
        let text = summary_markdown(&records, &[], "Which is best?", "Wide is.");
        for expected in [
            "Fastest: **wide at 1 x 1** at 10.00 ms, which is not certain: a point without a rank may be as fast. \
             Against serial-f32: not enough samples (n = 1). Against naive at 8 x 8: not enough samples (n = 3). \
             Points without a rank: naive at 8 x 8 (n = 3).",
            "| not enough samples (n = 1) |",
        ] {
            assert!(text.contains(expected), "{expected:?} is not in\n{text}");
        }
        assert!(!text.contains("times as fast") && !text.contains("1798 to"), "{text}");
        let none = summary_markdown(&records[..2], &[], "Which is best?", "Wide is.");
        assert!(none.contains("No winner. Points without a rank: naive at 8 x 8 (n = 3).\n"), "{none}");
    }

    #[test]
    fn no_records_is_no_panic() {
        assert!(summary_markdown(&[], &[], "Q?", "E.").contains("# Q?"));
    }

    #[test]
    fn a_row_has_the_quartiles_distance_and_columns_of_numbers_have_their_points_below_each_other() {
        let of_ten = Record { q1_ms: Some(9.5), q3_ms: Some(11.0), ..measured("gpu", "naive", 8, 10.0) };
        let records = judged([of_ten, measured("gpu", "wide", 8, 1234.5)]);
        let text = summary_markdown(&records, &[], "?", "!");
        assert!(!text.contains("without a rank"), "{text}");
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with("| ")).collect();
        let cells = |row: &str| row.split('|').map(str::to_owned).collect::<Vec<_>>();
        let [naive, wide] =
            ["naive", "wide"].map(|name| cells(rows.iter().find(|row| row.contains(name)).expect("a row")));
        assert_eq!(naive[4].trim(), "1.5", "{text}");
        let point = |cell: &str| cell.find('.').or(cell.trim_end().len().into());
        assert_eq!(point(&naive[3]), point(&wide[3]), "{text}");
    }

    #[test]
    fn a_row_has_its_cells_in_the_order_of_the_columns() {
        let record = Record {
            local_size: Some([16, 2]),
            limit_fraction: Some(0.25),
            ..measured("gpu", "naive", 8, 10.0)
        };
        let text = summary_markdown(&judged([record]), &[], "?", "!");
        let rows: Vec<Vec<&str>> = text
            .lines()
            .filter(|line| line.starts_with('|'))
            .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
            .collect();
        let [head, _, cells] = &rows[..] else { panic!("{text}") };
        let cell = |name: &str| cells[head.iter().position(|column| *column == name).expect("a column")];
        for (name, expected) in [
            ("strategy", "**naive**"),
            ("local size", "16 x 2"),
            ("median ms", "10.00"),
            ("IQR ms", "0.20"),
            ("n", "10 in 2"),
            ("frame Mrays/s", "-"),
            ("primary Mrays/s", "-"),
            ("Gtests/s", "40.0"),
            ("of peak", "25%"),
            ("outcome", "measured"),
        ] {
            assert_eq!(cell(name), expected, "{name}\n{text}");
        }
        let ends: Vec<f64> =
            cell("95% interval ms").split(" to ").map(|end| end.parse().expect("a number")).collect();
        assert!(ends.len() == 2 && ends[0] < 10.0 && 10.0 < ends[1], "{text}");
    }

    #[test]
    fn rows_are_ordered_from_the_fastest_to_points_without_a_time() {
        let records = judged([
            infeasible("gpu", "wide", 32, "too large"),
            measured("gpu", "naive", 8, 20.0),
            few("gpu", "naive", 4, 1.0, 3),
            measured("gpu", "naive", 2, 10.0),
        ]);
        let text = summary_markdown(&records, &[], "?", "!");
        let cell = |row: &str| row.split('|').nth(2).map(|cell| cell.trim().to_owned());
        let sizes: Vec<_> =
            text.lines().filter(|line| line.starts_with('|')).skip(2).filter_map(cell).collect();
        assert_eq!(sizes, ["2 x 2", "8 x 8", "4 x 4", "32 x 32"], "{text}");
    }

    #[test]
    fn warnings_reasons_and_notes_on_scenes_are_shown_with_what_they_are_about() {
        use crate::record::Outcome;
        let records = judged([
            Record { warning: Some("it throttled".into()), ..measured("gpu", "naive", 8, 10.0) },
            Record {
                outcome: Outcome::BuildFailed,
                reason: Some("line 7: no such name\nand much more".into()),
                ..infeasible("gpu", "wide", 4, "")
            },
            Record { scene_notes: vec!["it has no normals".into()], ..measured("gpu", "tile", 8, 12.0) },
        ]);
        let text = summary_markdown(&records, &[], "?", "!");
        for expected in [
            "\nWarnings:\n\n- naive at 8 x 8: it throttled\n",
            "\nPoints without a time:\n\n- wide at 4 x 4, build-failed: line 7: no such name\n",
            "\n## Notes on scenes\n\n- teapot: it has no normals\n",
            " Differences below 2.1% between two points are mostly not detected in these results.\n",
        ] {
            assert!(text.contains(expected), "{expected:?} is not in\n{text}");
        }
        assert!(!text.contains("much more"), "{text}");
        let noisy = ["naive", "wide"].map(|name| {
            let ms = if name == "naive" { [1.0, 20.0] } else { [20.0, 1.0] };
            sampled(name, (0..10).map(move |index| (index / 5, ms[index as usize / 5])))
        });
        let noisy = summary_markdown(&judged(noisy), &[], "?", "!");
        let below = " Differences below a factor of 100 between two points are mostly not detected in these results.\n";
        assert!(noisy.contains(below), "{noisy}");
        let quiet = summary_markdown(&judged([measured("gpu", "naive", 8, 10.0)]), &[], "?", "!");
        for heading in ["Warnings", "Points without a time", "Notes on scenes"] {
            assert!(!quiet.contains(heading), "{quiet}");
        }
    }

    /// The point `naive` takes about six times as long as the point `wide`. From launch to launch, the times
    /// of both points change by a tenth, in opposite directions.
    #[test]
    fn noisy_times_are_not_said_to_be_incomparable_beside_a_clear_winner() {
        let wavers = |name: &str, ms: [f64; 2]| sampled(name, (0..10).map(|n| (n / 5, ms[n as usize / 5])));
        let [naive, wide] = [wavers("naive", [6.0, 6.6]), wavers("wide", [1.1, 1.0])];
        let text = summary_markdown(&judged([naive, wide]), &[], "?", "!");
        assert!(text.contains("Fastest: **wide at 8 x 8**"), "{text}");
        assert!(text.contains(" Differences below a factor of ") && !text.contains("compared"), "{text}");
    }

    /// Two sessions measured the points of a group. The times of the second session are less steady.
    #[test]
    fn the_smallest_difference_of_a_group_is_that_of_all_its_sessions() {
        let session = |number: u32, factor: f64| {
            ["naive", "wide"].map(|name| {
                let slow = |n: u32| if (n < 5) == (name == "naive") { factor } else { 1.0 };
                let samples = (0..10).map(move |n| (2 * number + n / 5, 10.0 * slow(n)));
                Record { key: format!("{name} {number}"), ..sampled(name, samples) }
            })
        };
        let text = summary_markdown(&judged([session(0, 1.0), session(1, 1.01)].concat()), &[], "?", "!");
        let range = " Differences below 2.1 to ";
        let when =
            "% (depending on when the points were measured) between two points are mostly not detected";
        assert!(text.contains(range) && text.contains(when), "{text}");
    }

    #[test]
    fn a_sample_of_two_modes_is_said_in_the_row() {
        let ms =
            |index: u32| if index < 20 { 110.0 } else { 170.0 } * (1.0 + 0.001 * f64::from(index * 7 % 10));
        let record = crate::record::fixtures::sampled("naive", (0..30).map(|index| (index / 10, ms(index))));
        let text = summary_markdown(&judged([record]), &[], "?", "!");
        assert!(text.contains("| measured, two modes |") && text.contains("| 30 in 3 |"), "{text}");
    }

    #[test]
    fn a_winner_is_not_compared_with_itself_and_baselines_do_not_win() {
        let alone = summary_markdown(&judged([measured("pocl", "naive", 8, 10.0)]), &[], "?", "!");
        assert!(
            alone.contains("Fastest: **naive at 8 x 8** at 10.00 ms.") && !alone.contains("as fast as"),
            "{alone}"
        );
        let records = judged([measured("host", "serial-f32", 0, 420.0), measured("pocl", "naive", 8, 10.0)]);
        let text = summary_markdown(&records, &[], "?", "!");
        assert!(text.contains("| serial-f32 ") && !text.contains("**serial-f32**"), "{text}");
    }

    #[test]
    fn a_heading_has_the_common_name_of_a_device_and_the_text_below_it_the_drivers_name() {
        let name = "cpu-znver4-AMD EPYC 9B45 96-Core Processor";
        let text = summary_markdown(&judged([measured(name, "naive", 8, 10.0)]), &[], "?", "!");
        let expected = format!(
            "\n## teapot, 800 x 500, AMD EPYC 9B45, PoCL\n\nThe device's name in the records is {name}.\n\n"
        );
        assert!(text.contains(&expected), "{text}");
        let other = summary_markdown(&judged([measured("gpu", "naive", 8, 10.0)]), &[], "?", "!");
        assert!(!other.contains("in the records is"), "{other}");
    }
}
