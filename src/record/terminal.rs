//! Formats the tables that commands such as `raycl run` and `raycl merge` print at their end, with a row per
//! strategy and a column per local size.

use comfy_table::{Attribute, Cell, CellAlignment, Color, Table, presets};

use super::modes::to_mind;
use super::outcome::Outcome;
use super::point_times::{fewest, is_below_resolution, median};
use super::summary::{Group, groups, not_enough, scene_notes};
use super::types::{HOST, Record};
use crate::device::common_names;
use crate::entry::entry;
use crate::measure::Ranking;
use crate::numbers::{by, duration, ms, significant};
use crate::printer::{line, plain};
use crate::strategy::Infeasible;
use std::collections::HashMap;

/// For each device, its common name.
type Names<'a> = HashMap<&'a str, String>;

/// Returns a table of medians for every scene, image size and device. For the host, returns a line with the times of
/// the baselines instead of a table. A legend and the notes on scenes follow the tables. A star marks the fastest
/// points. For a point without a time, the table shows a word for the reason, which the legend explains. If
/// `coloured` is true, winners are green and points without a time are yellow.
pub fn summary_terminal(records: &[Record], coloured: bool) -> String {
    let groups = groups(records);
    let names = common_names(groups.iter().map(|group| group.device));
    let parts = groups.iter().map(|group| match group.device {
        HOST => plain(&host_line(group)).into_owned(),
        device => matrix(group, &names[device], coloured),
    });
    let mut text = parts.collect::<Vec<_>>().join("\n");
    text.push_str(&plain(&legend(&groups, &names)));
    let notes = scene_notes(records);
    text.extend(notes.iter().map(|(scene, note)| format!("note on {}: {}\n", line(scene), plain(note))));
    text
}

/// Formats the times of the host's baselines as "teapot, 800 x 500, host: serial-f32 1.80 s, not enough samples (n =
/// 1); parallel-f32 210.0 ms". For a baseline without a time, the line contains the outcome instead.
fn host_line(group: &Group<'_>) -> String {
    let cell = |record: &&Record| match median(record) {
        Some(time) => {
            let few = not_enough(record).map_or(String::new(), |why| format!(", {why}"));
            format!("{} {}{few}", record.strategy, duration(time))
        }
        None => format!("{} {}", record.strategy, record.outcome.name()),
    };
    let cells: Vec<_> = group.records.iter().map(cell).collect();
    format!("{}, {}, host: {}\n", group.scene, by(group.image_size), cells.join("; "))
}

/// Returns a group's table, with a title above and the line of [`peak_line`] below; `device` is the common name of the
/// group's device.
fn matrix(group: &Group<'_>, device: &str, coloured: bool) -> String {
    let (mut names, mut sizes) = (Vec::new(), Vec::new());
    for record in &group.records {
        if !names.contains(&&record.name) {
            names.push(&record.name);
        }
        sizes.push(record.local_size);
    }
    sizes.sort_by_key(|size| size.map(|[across, down]| (across * down, across)));
    sizes.dedup();
    let winners = group.ranking().winners;
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    if coloured {
        table.enforce_styling();
    } else {
        table.force_no_tty();
    }
    let heads = sizes.iter().map(|size| size.map_or("-".into(), |[across, down]| format!("{across}x{down}")));
    table.set_header(std::iter::once(Cell::new("strategy")).chain(heads.map(number)));
    for name in names {
        let cells = sizes.iter().map(|size| {
            let record =
                group.records.iter().find(|record| &record.name == name && &record.local_size == size);
            record.map_or(number(String::new()), |record| {
                cell(record, winners.iter().any(|winner| winner.key == record.key))
            })
        });
        table.add_row(std::iter::once(Cell::new(line(name))).chain(cells));
    }
    let peak = peak_line(group);
    let (scene, device) = (line(group.scene), line(device));
    format!("{scene}, {}, {device}: median ms\n{table}\n{}", by(group.image_size), plain(&peak))
}

/// Returns a line with the largest fraction of the device's peak rate of multiply-adds that each strategy
/// reaches. The fraction is "unknown" if a strategy's rate of ray-triangle tests is known, but the number of
/// operations per test is not. Strategies with an unknown rate of tests are left out. The line is empty if the
/// peak was not measured, or if all strategies are left out.
fn peak_line(group: &Group<'_>) -> String {
    let (mut parts, mut unknown): (Vec<(&str, f64)>, Vec<&str>) = (Vec::new(), Vec::new());
    for record in group.ranking().ranked {
        let Some(fraction) = record.limit_fraction else {
            let are_counted = record.fma_per_s.is_some() && record.tests_per_s.is_some();
            if are_counted && !unknown.contains(&record.name.as_str()) {
                unknown.push(&record.name);
            }
            continue;
        };
        let name = record.name.as_str();
        let (_, most) = entry(&mut parts, |(known, _)| *known == name, || (name, fraction));
        *most = most.max(fraction);
    }
    if parts.is_empty() && unknown.is_empty() {
        return String::new();
    }
    let known = parts.iter().map(|(name, part)| format!("{name} {}", percent(*part)));
    let parts: Vec<_> = known.chain(unknown.iter().map(|name| format!("{name} unknown"))).collect();
    let why = match unknown.is_empty() {
        true => "",
        false => "unknown: the header of the ray-triangle test states no `operations`\n",
    };
    format!("fraction of the device's peak rate of multiply-adds: {}\n{why}", parts.join(", "))
}

/// Formats a fraction as a percentage with two significant digits, such as "2.4%".
pub(crate) fn percent(part: f64) -> String {
    format!("{}%", significant(100.0 * part, 2))
}

fn number(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

fn cell(record: &Record, wins: bool) -> Cell {
    match median(record) {
        Some(time) if wins => {
            number(format!("*{}{}", ms(time), mark(record))).fg(Color::Green).add_attribute(Attribute::Bold)
        }
        Some(time) => number(format!("{}{}{}", ms(time), mark(record), few(record))),
        None => number(line(&word(record)).into_owned()).fg(Color::Yellow),
    }
}

/// Returns why a record's time has no rank: " n=3" if the record has too few samples, and " <timer" if some
/// samples are 0. Returns an empty text if the record's time has a rank among the times of its group.
fn few(record: &Record) -> String {
    match is_below_resolution(record) {
        true => " <timer".to_owned(),
        false => not_enough(record).map_or(String::new(), |_| format!(" n={}", fewest(record))),
    }
}

/// Returns "!" for a record with a warning or with two modes, and an empty text for all other records.
fn mark(record: &Record) -> &'static str {
    if to_mind(record).is_some() { "!" } else { "" }
}

/// Returns a short text that says why a record has no time. For every outcome except "infeasible", the text
/// is the outcome's name. For the outcome "infeasible", the text is the part of the reason before the first
/// colon. Underscores at the beginning of this part and " memory" at its end are left out, so the text is
/// "local" for the reason "__local memory: ...". If the reason is that the host has too little memory, the
/// returned text is "host". If the reason has no colon, or if the text would be longer than 16 bytes, the
/// text is "infeasible".
pub(crate) fn word(record: &Record) -> String {
    if record.outcome != Outcome::Infeasible {
        return record.outcome.name().into();
    }
    let reason = record.reason.as_deref().unwrap_or_default();
    let short = match reason.split_once(':') {
        Some((what, _)) if what.starts_with(Infeasible::ON_HOST) => "host",
        Some((what, _)) => what.trim_start_matches('_').trim_end_matches(" memory"),
        None => "infeasible",
    };
    if short.len() <= 16 { short.into() } else { "infeasible".into() }
}

/// Returns lines that explain the marks in the tables, and the words for points without a time.
fn legend(groups: &[Group<'_>], names: &Names<'_>) -> String {
    let kernels = || groups.iter().filter(|group| group.device != HOST);
    let mut text = String::new();
    let rankings: Vec<_> = kernels().map(Group::ranking).collect();
    if rankings.iter().any(|ranking| !ranking.winners.is_empty()) {
        text.push_str("* fastest. If several points are marked, they tie: the samples do not show that any of them takes more than 1% longer than the fastest. If points were measured in the same rounds, raycl finds ties by comparing the samples of each round; the medians in the table may suggest something else\n");
    }
    let (below, few): (Vec<&Record>, Vec<&Record>) = rankings
        .iter()
        .flat_map(|ranking| ranking.unranked.clone())
        .partition(|record| is_below_resolution(record));
    if !below.is_empty() {
        text.push_str(
            "<timer times below the timer's resolution: a frame takes less than a step of the timer, so the point has no rank; use larger images\n",
        );
    }
    if !few.is_empty() {
        text.push_str(
            "n=... not enough samples: a point with fewer than five samples in a launch has no rank; `timing.max_samples` must be at least five\n",
        );
    }
    let warned = rankings.iter().flat_map(Ranking::all).filter_map(|one| Some((one, to_mind(one)?)));
    if let Some((record, warning)) = warned.clone().next() {
        let count = warned.count();
        text.push_str(&format!(
            "! a warning on {count} of these times, for example {}: {warning}\n",
            example(groups, names, record)
        ));
    }
    let mut explained: Vec<(String, &str)> = Vec::new();
    for (record, reason) in kernels().flat_map(|group| group.failures()) {
        let word = word(record);
        if !explained.iter().any(|(what, name)| *what == word && *name == record.name) {
            let first = reason.lines().next().unwrap_or_default();
            text.push_str(&format!(
                "{word}: {}, for example {}: {first}\n",
                meaning(record),
                example(groups, names, record)
            ));
            explained.push((word, &record.name));
        }
    }
    text
}

/// Returns a point's strategy and local size and, if there are several tables, the title of the point's table.
fn example(groups: &[Group<'_>], names: &Names<'_>, record: &Record) -> String {
    let point = format!("{}{}", record.name, record.at_local_size());
    match groups.iter().filter(|group| group.device != HOST).count() {
        0 | 1 => point,
        _ => format!(
            "{point} ({}, {}, {})",
            record.scene,
            by(record.image_size),
            names[record.device.as_str()]
        ),
    }
}

fn meaning(record: &Record) -> &'static str {
    match record.outcome {
        Outcome::Measured => "measured",
        Outcome::Infeasible => obstacle(record.reason.as_deref().unwrap_or_default()),
        Outcome::OtherKind => "the preset is meant for devices of another kind",
        Outcome::BuildFailed => "the program did not compile",
        Outcome::LaunchFailed => "the kernel could not be run or timed",
        Outcome::WrongImage => "the image differs from the reference",
        Outcome::TimedOut => "a frame, or the build with the first frame, took longer than --hang-limit",
        Outcome::Crashed => "the measuring process crashed",
    }
}

/// Returns in general words why the kernels of an infeasible point could not run. The function finds the cause in
/// the text of the record's reason, since a record contains no other data about the cause.
fn obstacle(reason: &str) -> &'static str {
    if reason.ends_with(Infeasible::EMULATED) {
        "the device that `[emulate]` in the config imitates has too little memory"
    } else if reason.contains(" B > ") {
        "the device or the host has too little memory"
    } else if reason.contains("does not support") {
        "the strategy does not support something that the scene has"
    } else if reason.starts_with("work-group") || reason.contains("the local size") {
        "the device or the kernel does not support the local size"
    } else {
        "the point exceeds a limit of its strategy or its device"
    }
}

#[cfg(test)]
mod tests {
    use super::super::summary::tests::{few, infeasible, judged, measured};
    use super::*;

    #[test]
    fn the_matrix_stars_winners_and_says_why_cells_are_empty() {
        let records = judged([
            measured("host", "serial-f32", 0, 420.0),
            measured("pocl", "naive", 8, 84.0),
            measured("pocl", "naive", 16, 80.5),
            measured("pocl", "local-vectors", 8, 80.5),
            infeasible("pocl", "local-vectors", 32, "__local memory: 108 B x 32 x 32 = 110592 B > 49152 B"),
        ]);
        let text = summary_terminal(&records, false).replace('│', " ");
        let line =
            |start: &str| text.lines().find(|line| line.trim_start().starts_with(start)).unwrap_or_default();
        assert!(line("teapot, 800 x 500, host").ends_with("serial-f32 420.0 ms"), "{text}");
        let cells: Vec<_> = line("naive").split_whitespace().collect();
        assert_eq!(cells, ["naive", "84.00", "*80.50"], "{text}");
        let cells: Vec<_> = line("local-vectors").split_whitespace().collect();
        assert_eq!(cells, ["local-vectors", "*80.50", "local"], "{text}");
        assert!(line("local:").contains("110592 B > 49152 B"), "{text}");
        assert!(line("* fastest").contains("tie"), "{text}");
        assert!(line("* fastest").contains("comparing the samples of each round; the medians"), "{text}");
    }

    #[test]
    fn the_legend_blames_memory_and_the_local_size_only_for_what_they_cause() {
        let summary = |reason: &str| summary_terminal(&[infeasible("gpu", "naive", 32, reason)], false);
        let cases = [
            ("__local memory: 108 B x 32 x 32 = 110592 B > 49152 B", "the host has too little memory"),
            (
                "__local memory: 108 B x 32 x 32 = 110592 B > 49152 B, the limit in [emulate]",
                "local: the device that `[emulate]` in the config imitates has too little memory",
            ),
            ("traversal = raster does not support a sky, which the scene has", "that the scene has, for"),
            ("work-group: 64 x 64 = 4096 work-items > the device's 1024", "support the local size"),
            (
                "the local size has 1024 work-items; the compiled kernel cast_frame supports at most 256",
                "support the local size",
            ),
            ("16-bit indices: 70000 entries > 65536", "exceeds a limit of its strategy"),
            (
                "heap: 27 values x 16384 x 10000 work-items = 4423680000 > 4294967295",
                "exceeds a limit of its strategy",
            ),
        ];
        for (reason, expected) in cases {
            let text = summary(reason);
            assert!(text.contains(expected) && text.contains(reason), "{expected:?} is not in\n{text}");
        }
    }

    #[test]
    fn a_strategys_share_of_the_peak_is_that_of_its_best_point() {
        let at =
            |side, ms, part| Record { limit_fraction: Some(part), ..measured("pocl", "naive", side, ms) };
        let text = summary_terminal(&judged([at(8, 80.0, 0.25), at(16, 100.0, 0.2)]), false);
        assert!(text.contains("peak rate of multiply-adds: naive 25%\n"), "{text}");
    }

    #[test]
    fn a_strategy_whose_test_has_no_count_of_operations_has_an_unknown_share_of_the_peak() {
        let own = |side, ms| Record { fma_per_s: Some(1e12), ..measured("pocl", "mine", side, ms) };
        let walks_tree = Record { tests_per_s: None, name: "bvh".into(), ..own(2, 70.0) };
        let naive = Record { limit_fraction: Some(0.25), ..measured("pocl", "naive", 8, 80.0) };
        let text = summary_terminal(&judged([own(8, 80.0), own(16, 90.0), naive, walks_tree]), false);
        let line = "multiply-adds: naive 25%, mine unknown\n";
        let why = "unknown: the header of the ray-triangle test states no `operations`\n";
        assert!(text.contains(&format!("{line}{why}")), "{text}");
        let text = summary_terminal(&judged([own(8, 80.0)]), false);
        assert!(text.contains(&format!("multiply-adds: mine unknown\n{why}")), "{text}");
    }

    #[test]
    fn few_samples_are_said_and_never_starred() {
        let records = judged([
            few("host", "serial-f32", 0, 1798.0, 1),
            few("pocl", "naive", 8, 5.0, 3),
            measured("pocl", "wide", 1, 10.0),
            few("gpu", "naive", 8, 7.0, 3),
        ]);
        let text = summary_terminal(&records, false);
        for expected in ["not enough samples (n = 1)", "5.000 n=3", "*10.00", "n=... not enough samples"] {
            assert!(text.contains(expected), "{expected:?} is not in\n{text}");
        }
        assert!(text.contains("* fastest"), "the star is not explained in\n{text}");
        let none = summary_terminal(&records[..2], false);
        assert!(!none.contains('*'), "{none}");
    }

    #[test]
    fn times_of_zero_have_a_mark_of_their_own() {
        let records = judged([few("gpu", "naive", 8, 0.0, 30), measured("gpu", "wide", 1, 10.0)]);
        let text = summary_terminal(&records, false);
        for expected in ["0 <timer", "<timer times below the timer's resolution"] {
            assert!(text.contains(expected), "{expected:?} is not in\n{text}");
        }
        assert!(!text.contains("n="), "{text}");
    }

    #[test]
    fn the_only_colours_are_the_summarys_own() {
        let red = "\u{1b}[31mred";
        let mut records = judged([
            measured("host", red, 0, 420.0),
            measured(red, red, 8, 84.0),
            infeasible(red, "local", 32, &format!("{red}: {red}")),
        ]);
        for record in &mut records {
            (record.scene, record.warning) = (red.into(), Some(red.into()));
        }
        for coloured in [false, true] {
            let text = summary_terminal(&records, coloured);
            assert!(text.contains("\\u001b[31mred") && !text.contains(red), "{text}");
        }
    }

    #[test]
    fn colours_are_there_only_where_they_are_wanted() {
        let records = judged([measured("pocl", "naive", 8, 84.0)]);
        assert!(!summary_terminal(&records, false).contains('\u{1b}'));
        assert!(summary_terminal(&records, true).contains("\u{1b}["));
    }

    #[test]
    fn an_infeasible_point_is_named_by_what_is_too_small_if_that_is_short() {
        let word = |reason: &str| word(&infeasible("gpu", "naive", 32, reason));
        assert_eq!(word("__local memory: 2 B > 1 B"), "local");
        assert_eq!(word("__constant memory: 2 B > 1 B"), "constant");
        assert_eq!(word("the host's memory (free now): 2 B > 1 B"), "host");
        assert_eq!(word("sixteen letters.: 2 B > 1 B"), "sixteen letters.");
        assert_eq!(word("seventeen letters: 2 B > 1 B"), "infeasible");
        assert_eq!(word("no colon"), "infeasible");
    }

    #[test]
    fn local_sizes_are_columns_in_the_order_of_their_products() {
        let at = |size: [u32; 2], ms| Record {
            local_size: Some(size),
            key: format!("{size:?}"),
            ..measured("gpu", "naive", 8, ms)
        };
        let records = judged([at([16, 2], 1.0), at([2, 16], 2.0), at([4, 4], 4.0), at([64, 1], 8.0)]);
        let text = summary_terminal(&records, false).replace('│', " ");
        let words = |start: &str| -> Vec<&str> {
            let line = text.lines().find(|line| line.trim_start().starts_with(start)).unwrap_or_default();
            line.split_whitespace().collect()
        };
        assert_eq!(words("strategy"), ["strategy", "4x4", "2x16", "16x2", "64x1"], "{text}");
        assert_eq!(words("naive"), ["naive", "4.000", "2.000", "*1.000", "8.000"], "{text}");
        assert!(text.starts_with("teapot, 800 x 500, gpu: median ms\n"), "{text}");
    }

    #[test]
    fn a_warning_is_marked_and_counted_and_scenes_have_their_notes() {
        let warned =
            |name: &str, ms| Record { warning: Some("it throttled".into()), ..measured("gpu", name, 8, ms) };
        let noted = Record { scene_notes: vec!["no normals".into()], ..measured("gpu", "tile", 4, 9.0) };
        let text = summary_terminal(&judged([warned("naive", 10.0), warned("wide", 20.0), noted]), false);
        for expected in [
            " 10.00! ",
            " 20.00! ",
            " *9.000 ",
            "! a warning on 2 of these times, for example naive at 8 x 8: it throttled\n",
            "note on teapot: no normals\n",
        ] {
            assert!(text.contains(expected), "{expected:?} is not in\n{text}");
        }
        assert!(!summary_terminal(&judged([measured("gpu", "tile", 4, 9.0)]), false).contains("warning"));
        let elsewhere = Record { scene: "roll".into(), ..measured("gpu", "tile", 4, 9.0) };
        let text = summary_terminal(&judged([warned("naive", 10.0), elsewhere]), false);
        let expected = "for example naive at 8 x 8 (teapot, 800 x 500, gpu): it throttled\n";
        assert!(text.contains(expected), "{expected:?} is not in\n{text}");
    }

    #[test]
    fn the_legend_explains_each_word_once_for_each_strategy() {
        use Outcome::{BuildFailed, Crashed, LaunchFailed, OtherKind, TimedOut, WrongImage};
        for (outcome, line) in [
            (OtherKind, "other-kind: the preset is meant for devices of another kind, "),
            (BuildFailed, "build-failed: the program did not compile, "),
            (LaunchFailed, "launch-failed: the kernel could not be run or timed, "),
            (WrongImage, "wrong-image: the image differs from the reference, "),
            (
                TimedOut,
                "timed-out: a frame, or the build with the first frame, took longer than --hang-limit, ",
            ),
            (Crashed, "crashed: the measuring process crashed, "),
        ] {
            let at = |name: &str, side| Record { outcome, ..infeasible("gpu", name, side, "first\nsecond") };
            let text = summary_terminal(&[at("naive", 4), at("naive", 8), at("wide", 8)], false);
            for example in ["for example naive at 4 x 4: first\n", "for example wide at 8 x 8: first\n"] {
                assert!(text.contains(&format!("{line}{example}")), "{line:?} is not in\n{text}");
            }
            assert_eq!(text.matches("for example").count(), 2, "{text}");
        }
    }
}
