//! Prints Figure 5 of the student paper that raycl reproduces, as a table. The paper's predictions in Figure 5 use only
//! two limits: the largest numbers of work-groups and of threads that a multiprocessor holds at the same time. Beside
//! the paper's predictions, the table shows the occupancy that compute capability 2.0 allows.

use serde_json::{Value, json};

use super::{Question, items, named};
use crate::device::occupancy::{Limiter, Occupancy, PAPER_CAPABILITY, PAPER_REGISTERS, multiprocessor};
use crate::error::Result;

/// The largest number of work-groups that a multiprocessor holds at the same time. [`THREADS`] is the largest
/// number of threads that it holds. The paper's Figure 5 uses only these two limits: of work-groups and of
/// threads.
const GROUPS: u32 = 8;
const THREADS: u32 = 1536;
/// The size in bytes of a work-item's nine vectors, which the paper's optimisation 1 puts into `__local` memory.
const VECTOR_BYTES: u32 = 108;

/// Returns the number of threads per multiprocessor that Figure 5 predicts: the threads of as many whole
/// work-groups as [`GROUPS`] and [`THREADS`] allow.
fn predicted(items: u32) -> u32 {
    GROUPS.min(THREADS / items.max(1)) * items
}

struct Row {
    size: [u32; 2],
    predicted: u32,
    /// The occupancy with the paper's 63 registers per work-item.
    held: Occupancy,
    /// The occupancy with the paper's 63 registers per work-item, and with a work-item's nine vectors in
    /// `__local` memory (the paper's optimisation 1).
    held_with_vectors: Occupancy,
}

impl Row {
    fn contradicted(&self) -> bool {
        u64::from(self.predicted) != self.held.threads
    }
}

pub(super) fn run(sizes: &[[u32; 2]], as_json: bool) -> Result<()> {
    let rows = rows(sizes)?;
    if as_json {
        return crate::cli::print_json(&json(&rows));
    }
    crate::cli::print(text(&rows))
}

fn rows(sizes: &[[u32; 2]]) -> Result<Vec<Row>> {
    let sm = multiprocessor(PAPER_CAPABILITY)?;
    let bare = Question { sm, registers: PAPER_REGISTERS, local_bytes: 0, local_bytes_per_item: 0 };
    let vectors = Question { local_bytes_per_item: VECTOR_BYTES, ..bare };
    let row = |&size: &[u32; 2]| Row {
        size,
        predicted: predicted(items(size)),
        held: bare.answer(size),
        held_with_vectors: vectors.answer(size),
    };
    Ok(sizes.iter().map(row).collect())
}

fn text(rows: &[Row]) -> String {
    let header = [
        "local size",
        "threads per multiprocessor,\nfrom Figure 5's two limits",
        "with 63 registers\n(compute capability 2.0)",
        "and with optimisation 1's\n108 B per work-item",
        "63 registers and\nFigure 5",
    ];
    let mut table = crate::cli::table(&header, 1);
    for row in rows {
        table.add_row([
            named(row.size),
            row.predicted.to_string(),
            threads(&row.held),
            threads(&row.held_with_vectors),
            if row.contradicted() { "differ" } else { "agree" }.to_owned(),
        ]);
    }
    let mut text = format!(
        "The student paper names four limits for its Figure 5: {GROUPS} blocks, {THREADS} threads and 48 KB of shared memory per multiprocessor,\nand {PAPER_REGISTERS} registers per thread. The figure uses only the limits of blocks and threads:\nthreads = min({GROUPS}, floor({THREADS} / block)) x block,\nwhere block is the number of threads in a block.\n{table}"
    );
    for row in rows.iter().filter(|row| row.contradicted()) {
        text += &format!("\n{}: {}", named(row.size), contradiction(row));
    }
    text
}

fn threads(held: &Occupancy) -> String {
    match &held.limiter {
        Limiter::CannotLaunch(_) => "cannot launch".to_owned(),
        limiter => format!("{} ({limiter})", held.threads),
    }
}

fn contradiction(row: &Row) -> String {
    match &row.held.limiter {
        Limiter::CannotLaunch(reason) => format!("cannot launch: {reason}."),
        _ => format!(
            "with {PAPER_REGISTERS} registers per thread, a multiprocessor holds {} threads, not the {} of Figure 5.",
            row.held.threads, row.predicted
        ),
    }
}

fn json(rows: &[Row]) -> Value {
    let row = |row: &Row| {
        json!({
            "local_size": row.size,
            "predicted_threads": row.predicted,
            "threads": row.held.threads,
            "threads_with_local_vectors": row.held_with_vectors.threads,
            "contradiction": row.contradicted().then(|| contradiction(row)),
        })
    };
    json!({
        "groups_cap": GROUPS,
        "threads_cap": THREADS,
        "registers_per_item": PAPER_REGISTERS,
        "rows": rows.iter().map(row).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::LOCAL_SIZES;
    use super::*;
    use crate::cli::choice::parse_size;

    fn sizes() -> [[u32; 2]; 9] {
        LOCAL_SIZES.map(|size| parse_size(size).unwrap())
    }

    #[test]
    fn figure_5_from_its_caps() {
        let predicted = sizes().map(|size| predicted(items(size)));
        assert_eq!(predicted, [32, 128, 288, 512, 800, 1152, 1372, 1536, 1024]);
    }

    #[test]
    fn its_registers_contradict_it_at_16x16_and_32x32() {
        let text = text(&rows(&sizes()).unwrap());
        assert!(
            text.contains(
                "\n16x16: with 63 registers per thread, a multiprocessor holds 512 threads, not the 1536 of Figure 5."
            ),
            "{text}"
        );
        assert!(text.contains("\n32x32: cannot launch: registers:"), "{text}");
        assert!(!text.contains("\n4x4: "), "{text}");
    }

    #[test]
    fn the_json_has_the_threads_without_and_with_vectors_in_local_memory() {
        let all = rows(&[[8, 8]]).unwrap();
        let json = json(&all);
        let row = &json["rows"][0];
        let [bare, with_vectors] = ["threads", "threads_with_local_vectors"].map(|key| row[key].as_u64());
        let held = [&all[0].held, &all[0].held_with_vectors].map(|held| Some(held.threads));
        assert_eq!([bare, with_vectors], held);
        assert!(with_vectors < bare, "{row}");
    }

    /// In the row of the local size 16x16, the three numbers of threads in the printed table differ from each
    /// other.
    #[test]
    fn each_number_of_threads_is_in_its_own_column_and_under_its_own_key() {
        let all = rows(&[[16, 16]]).unwrap();
        assert_eq!(json(&all)["rows"][0]["threads"], 512);
        let [bare, with_vectors] = [&all[0].held, &all[0].held_with_vectors].map(threads);
        assert!(bare.starts_with("512 (") && with_vectors.starts_with("256 ("), "{bare}, {with_vectors}");
        let text = text(&all);
        let row = text.lines().find(|line| line.contains(" 16x16 ")).unwrap();
        let places = ["1536", bare.as_str(), with_vectors.as_str(), "differ"].map(|cell| row.find(cell));
        assert!(!places.contains(&None) && places.is_sorted(), "{row}");
    }
}
