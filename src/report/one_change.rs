//! Formats the tables "One change at a time", which compare strategies that differ in a single axis.

use crate::numbers::by;
use crate::record::{Change, Changes, Compared, Group, Record, both_sizes, changes, with_interval};

/// The table of a device, with a row per change of a single axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The device's name and, if all columns have the same image size, this size.
    pub caption: String,
    /// The name of each column: the column's scene and, if the columns have several image sizes, the image
    /// size.
    pub columns: Vec<String>,
    /// The rows of the table, sorted by the effect of the changed axis on the time, from the largest effect
    /// down.
    pub rows: Vec<Row>,
    /// A sentence that says how many changes the table leaves out; empty if the table has all changes.
    pub note: String,
}

/// A row of a table: a change of a single axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The axis and its two values, such as "vectors: heap → local".
    pub what: String,
    /// The names of the two strategies, such as "naive → local-vectors".
    pub whose: String,
    /// A cell for each column.
    pub cells: Vec<Cell>,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// How many times as fast the second strategy is as the first, with the 95% interval; "-" if the ratio is
    /// unknown.
    pub ratio: String,
    /// The effect in a word: "faster", "slower" or "tie"; empty if the ratio is unknown.
    pub effect: &'static str,
    /// The local sizes at which the two strategies are compared, such as "8 x 8" or "8 x 8 → 4 x 4"; empty if
    /// the ratio is unknown.
    pub size: String,
    /// The cell's tooltip: the result as a sentence, or the reason why the ratio is unknown.
    pub tip: String,
}

/// Returns at most one table per device. A device has a table if, in at least one of its groups of points, two
/// strategies that differ in a single axis both have a time. `groups` are the groups of `records`.
pub fn tables(records: &[Record], groups: &[Group<'_>]) -> Vec<Table> {
    changes(records, groups).iter().map(table).collect()
}

fn table(changes: &Changes<'_>) -> Table {
    let size = changes.image_size().map_or(String::new(), |size| format!(", {}", by(size)));
    Table {
        caption: format!("{}{size}", changes.device),
        columns: changes.column_names(),
        rows: changes.rows.iter().map(row).collect(),
        note: changes.note().unwrap_or_default(),
    }
}

fn row(change: &Change<'_>) -> Row {
    let cells = change.results.iter().map(|result| cell(result, change.names)).collect();
    Row { what: change.what(), whose: change.whose(), cells }
}

fn cell(result: &Compared, [first, second]: [&str; 2]) -> Cell {
    match result {
        Compared::Times { ratio, effect, local_sizes } => {
            let ratio = with_interval(*ratio);
            let [one, two] =
                local_sizes.map(|size| size.map_or(String::new(), |size| format!(" at {}", by(size))));
            let tip = format!("{second}{two} is {ratio} times as fast as {first}{one}");
            Cell { ratio, effect: effect.name(), size: both_sizes(*local_sizes), tip }
        }
        Compared::Nothing { why } => {
            Cell { ratio: "-".to_owned(), effect: "", size: String::new(), tip: why.clone() }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::fixtures::{few, in_memory, judged, measured};
    use crate::record::groups;

    fn tables_of(records: impl Into<Vec<Record>>) -> Vec<Table> {
        let records = judged(records);
        tables(&records, &groups(&records))
    }

    #[test]
    fn a_cell_has_the_ratio_in_a_word_and_in_a_sentence_or_the_reason_why_there_is_none() {
        let in_room = |record: Record| Record { scene: "room".into(), ..record };
        let tables = tables_of([
            in_memory(measured("gpu", "naive", 8, 10.0), "heap"),
            in_memory(measured("gpu", "private", 8, 5.0), "private"),
            in_room(in_memory(measured("gpu", "naive", 8, 10.0), "heap")),
            in_room(in_memory(few("gpu", "private", 8, 5.0, 3), "private")),
        ]);
        let cell = |ratio: &str, effect, size: &str, tip: &str| {
            let [ratio, size, tip] = [ratio, size, tip].map(str::to_owned);
            Cell { ratio, effect, size, tip }
        };
        let sentence = "private at 8 x 8 is 2.00 (1.98 to 2.02) times as fast as naive at 8 x 8";
        let cells = vec![
            cell("2.00 (1.98 to 2.02)", "faster", "8 x 8", sentence),
            cell("-", "", "", "private at 8 x 8: not enough samples (n = 3)"),
        ];
        let row = Row { what: "vectors: heap → private".into(), whose: "naive → private".into(), cells };
        let expected = Table {
            caption: "gpu, 800 x 500".into(),
            columns: vec!["teapot".into(), "room".into()],
            rows: vec![row],
            note: String::new(),
        };
        assert_eq!(tables, [expected]);
    }

    #[test]
    fn each_device_has_a_table_and_strategies_that_differ_in_more_have_none() {
        let of = |device: &str| {
            [("naive", "heap", 10.0), ("private", "private", 5.0)]
                .map(|(name, vectors, ms)| in_memory(measured(device, name, 8, ms), vectors))
        };
        let captions: Vec<_> =
            tables_of([of("cpu"), of("gpu")].concat()).into_iter().map(|table| table.caption).collect();
        assert_eq!(captions, ["cpu, 800 x 500", "gpu, 800 x 500"]);
        let more =
            Record { strategy: "traversal=bvh vectors=private".into(), ..measured("gpu", "bvh", 8, 1.0) };
        assert!(tables_of([in_memory(measured("gpu", "naive", 8, 10.0), "heap"), more]).is_empty());
    }

    #[test]
    fn a_tip_has_the_local_size_of_each_strategy() {
        let tables = tables_of([
            in_memory(measured("gpu", "naive", 8, 10.0), "heap"),
            in_memory(measured("gpu", "private", 4, 5.0), "private"),
        ]);
        let cell = &tables[0].rows[0].cells[0];
        assert_eq!(cell.size, "8 x 8 → 4 x 4");
        assert_eq!(cell.tip, "private at 4 x 4 is 2.00 (1.98 to 2.02) times as fast as naive at 8 x 8");
    }

    #[test]
    fn a_note_counts_the_changes_that_are_left_out() {
        let wide = |width: u32| Record {
            strategy: format!("traversal=exhaustive width={width}"),
            ..measured("gpu", &format!("w{width}"), 8, 1.2_f64.powf(width.into()))
        };
        let tables = tables_of((1..=10).map(wide).collect::<Vec<_>>());
        let note = "5 further changes are left out: only the 40 with the largest effects are shown.";
        assert_eq!((tables[0].rows.len(), tables[0].note.as_str()), (40, note));
    }
}
