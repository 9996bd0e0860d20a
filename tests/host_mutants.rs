//! Checks that the table of changes to Rust code (`tests/mutants/host.toml`) still fits the sources.
//! `make mutants` makes the changes of the table one at a time, and checks that a test fails for nearly every change.

use crate::binary::repository;
use serde::Deserialize;
use std::path::Path;

/// A row of `tests/mutants/host.toml`: a change to Rust code.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mutant {
    file: String,
    from: String,
    to: String,
    test: String,
    #[serde(default)]
    apart: bool,
    reason: Option<String>,
}

#[derive(Deserialize)]
struct Table {
    mutant: Vec<Mutant>,
}

fn mutants() -> Vec<Mutant> {
    let text = std::fs::read_to_string(repository("tests/mutants/host.toml")).expect("the table");
    toml::from_str::<Table>(&text).expect("rows").mutant
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_default()
}

/// Returns true if the library has the test with this path, such as
/// `measure::modes::tests::a_timers_steps_are_no_modes`.
fn is_there(test: &str) -> bool {
    let Some((module, name)) = test.rsplit_once("::") else { return false };
    let module = format!("src/{}", module.replace("::", "/"));
    let outer = module.trim_end_matches("/tests").to_owned();
    let files = [format!("{module}.rs"), format!("{outer}.rs"), format!("{outer}/mod.rs")];
    files.iter().any(|file| read(&repository(file)).contains(&format!("fn {name}(")))
}

#[test]
fn every_row_stands_once_in_its_file_and_names_a_test() {
    let all = mutants();
    assert!(all.len() >= 240, "{}", all.len());
    for Mutant { file, from, to, test, .. } in &all {
        let count = read(&repository(file)).matches(from.as_str()).count();
        assert_eq!(count, 1, "{file}: {from:?} has to be there once; adapt the row or replace it");
        assert_ne!(from, to, "{file}");
        assert!(is_there(test), "{file}: {from:?}: there is no test {test}");
    }
}

fn block(text: &str) -> Option<syn::Block> {
    syn::parse_str(&format!("{{ {text} }}")).ok()
}

/// Returns true if a block can replace these statements: none of them may define a variable, since this
/// variable would be unknown after the block.
fn are_statements(text: &str) -> bool {
    block(text)
        .is_some_and(|block| !block.stmts.iter().any(|statement| matches!(statement, syn::Stmt::Local(_))))
}

/// Each row of the table is a change to raycl's code. The changes of many rows without the key `apart` are built into
/// one program. For each of these rows, the program has a condition that chooses between the original code and the
/// changed code.
#[test]
fn rows_that_share_a_build_are_expressions_or_statements() {
    for Mutant { file, from, to, .. } in mutants().iter().filter(|row| !row.apart && row.reason.is_none()) {
        let fits = if from.ends_with(';') {
            are_statements(from)
        } else {
            syn::parse_str::<syn::Expr>(from).is_ok()
        };
        assert!(fits && block(to).is_some(), "{file}: {from:?}, {to:?}: this row needs `apart = true`");
    }
}

#[test]
fn few_rows_are_excused_or_take_a_build_of_their_own() {
    let all = mutants();
    let excused: Vec<&String> = all.iter().filter_map(|row| row.reason.as_ref()).collect();
    assert!(excused.iter().all(|reason| reason.len() > 20), "a reason says why: {excused:?}");
    assert!(20 * excused.len() <= all.len(), "{} excused", excused.len());
    let apart = all.iter().filter(|row| row.apart).count();
    assert!(5 * apart <= all.len(), "{apart} builds take too long");
}

#[test]
fn every_measured_part_is_broken() {
    let all = mutants();
    for part in ["measure", "strategy", "record", "verify", "accel", "reference", "report", "shard"] {
        let count = all.iter().filter(|row| row.file.starts_with(&format!("src/{part}/"))).count();
        assert!(count >= 8, "src/{part}: {count} rows");
    }
}
