//! Writes the section "One change at a time" of `summary.md`, which compares strategies that differ in a
//! single axis.

use super::lay_out;
use crate::numbers::by;
use crate::printer::markdown;
use crate::record::one_change::{
    Change, Changes, Compared, HOW_TO_READ_CHANGES, both_sizes, changes, with_interval,
};
use crate::record::summary::Group;
use crate::record::types::Record;
use std::collections::HashMap;

/// Returns the text of the section "One change at a time", with a table for each device. The text is empty if
/// no two strategies that have times on the same device, scene and image size differ in a single axis. `groups`
/// are the groups of `records`, and `names` contains the name to show for each device.
pub(super) fn section(records: &[Record], groups: &[Group<'_>], names: &HashMap<&str, String>) -> String {
    let changes = changes(records, groups);
    if changes.is_empty() {
        return String::new();
    }
    let tables: String = changes.iter().map(|changes| on_device(changes, names)).collect();
    format!("\n## One change at a time\n\n{HOW_TO_READ_CHANGES}\n{tables}")
}

fn on_device(changes: &Changes<'_>, names: &HashMap<&str, String>) -> String {
    let device = markdown(names.get(changes.device).map_or(changes.device, String::as_str));
    let size = changes.image_size().map_or(String::new(), |size| format!(", {}", by(size)));
    let scenes = changes.column_names().into_iter().map(|name| markdown(&name));
    let header: Vec<String> = std::iter::once("change".to_owned()).chain(scenes).collect();
    let rows: Vec<Vec<String>> = changes.rows.iter().map(row).collect();
    let note = changes.note().map_or(String::new(), |note| format!("\n{note}\n"));
    format!("\nOn {device}{size}:\n\n{}{note}", lay_out(&header, &rows, &[0]))
}

fn row(change: &Change<'_>) -> Vec<String> {
    let title = markdown(&format!("{} ({})", change.what(), change.whose()));
    std::iter::once(title).chain(change.results.iter().map(cell)).collect()
}

fn cell(result: &Compared) -> String {
    match result {
        Compared::Times { ratio, effect, local_sizes } => {
            let parts = [with_interval(*ratio), effect.name().to_owned(), both_sizes(*local_sizes)];
            parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ")
        }
        Compared::Nothing { .. } => "-".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::summary_markdown;
    use super::*;
    use crate::record::fixtures::{few, in_memory, judged, measured};

    fn summary(records: impl Into<Vec<Record>>) -> String {
        summary_markdown(&judged(records), &[], "?", "!")
    }

    #[test]
    fn a_summary_has_the_ratio_of_strategies_that_differ_in_one_axis() {
        let in_room = |record: Record| Record { scene: "a|room".into(), ..record };
        let text = summary([
            in_memory(measured("a_gpu", "naive", 8, 10.0), "heap"),
            in_memory(measured("a_gpu", "private", 8, 5.0), "private"),
            in_room(in_memory(measured("a_gpu", "naive", 8, 10.0), "heap")),
            in_room(in_memory(few("a_gpu", "private", 8, 5.0, 3), "private")),
        ]);
        let (before, section) = text.split_once("\n## One change at a time\n").expect("the section");
        assert!(before.contains("Fastest: **private at 8 x 8**"), "the winners come first: {text}");
        let expected = "\nOn a\\_gpu, 800 x 500:\n\n\
            | change                                   |                               teapot | a\\|room |\n\
            | ---------------------------------------- | -----------------------------------: | ------: |\n\
            | vectors: heap → private (naive → private) | 2.00 (1.98 to 2.02), faster, 8 x 8 |       - |\n";
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let table = section.split_once(HOW_TO_READ_CHANGES).expect("the explanation").1;
        let is_rule = |word: &String| word.starts_with("--");
        let shown = words(table).into_iter().filter(|word| !is_rule(word));
        let expected: Vec<String> = words(expected).into_iter().filter(|word| !is_rule(word)).collect();
        assert_eq!(shown.take(expected.len()).collect::<Vec<_>>(), expected, "{text}");
        let rows: Vec<usize> =
            table.lines().filter(|line| line.starts_with('|')).map(|line| line.chars().count()).collect();
        assert!(rows.len() == 3 && rows.iter().all(|width| *width == rows[0]), "{table}");
    }

    #[test]
    fn a_device_has_its_common_name_as_in_the_other_sections() {
        let driver = "pthread-znver4-AMD EPYC 9B45";
        let text = summary([
            in_memory(measured(driver, "naive", 8, 10.0), "heap"),
            in_memory(measured(driver, "private", 8, 5.0), "private"),
        ]);
        let (_, section) = text.split_once("\n## One change at a time\n").expect("the section");
        assert!(section.contains("\nOn AMD EPYC 9B45, PoCL, 800 x 500:\n"), "{text}");
    }

    #[test]
    fn a_summary_without_such_strategies_lacks_the_section() {
        let text = summary([measured("gpu", "naive", 8, 10.0), measured("gpu", "wide", 8, 5.0)]);
        assert!(!text.contains("One change"), "{text}");
    }
}
