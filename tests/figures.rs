//! Every number in the prose and tables of README.md, docs/kernels.md, docs/paper.md and docs/performance.md agrees
//! with the stored records, or is listed under `[facts]` in docs/figures.toml. The check of the documents notices if
//! such a number is changed. The records, docs/results, are in the repository and not in the package.

use raycl::documents::{DOCUMENTS, Difference, Documents};
use raycl::rule::{Sweep, source};
use std::ops::Range;
use std::path::Path;

fn documents() -> Documents {
    Documents::read(Path::new(env!("CARGO_MANIFEST_DIR"))).expect("the documents and docs/figures.toml")
}

fn message_of(differences: &[(&str, Difference)]) -> String {
    let one = |(file, Difference { line, stands, records_say }): &(&str, Difference)| {
        format!("{file}:{line}: the document has '{stands}', the records give {records_say}\n")
    };
    differences.iter().map(one).collect()
}

#[test]
fn every_number_of_the_documents_has_its_record() {
    let differences = documents().differences();
    assert!(differences.is_empty(), "`make figures` makes them again:\n{}", message_of(&differences));
}

#[test]
fn the_rules_constants_are_made_of_the_stored_sweeps() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = std::fs::read_dir(root.join("docs/results/rule")).expect("stored sweeps");
    let mut paths: Vec<_> = folder.map(|entry| entry.expect("a file").path()).collect();
    paths.sort_unstable();
    let read = |path| -> Sweep {
        serde_json::from_slice(&std::fs::read(path).expect("a sweep")).expect("a sweep's fields")
    };
    let sweeps: Vec<Sweep> = paths.iter().map(read).collect();
    let stored = std::fs::read_to_string(root.join("src/strategy/constants.rs")).expect("the constants");
    let made = source(&sweeps);
    assert!(
        made == stored,
        "`raycl rule --fit docs/results/rule/*.json > src/strategy/constants.rs` makes:\n{made}"
    );
}

/// Returns the positions of the numbers in a document's prose and tables, but not in comments, code or the targets of
/// links.
fn numbers(text: &str) -> Vec<Range<usize>> {
    let mut positions: Vec<Range<usize>> = Vec::new();
    let mut start = 0;
    let mut fenced = false;
    for line in text.split_inclusive('\n') {
        fenced ^= line.starts_with("```");
        let mut at = 0;
        while at < line.len() && !fenced {
            let rest = &line[at..];
            let skip = [("<!--", "-->"), ("`", "`"), ("](", ")")]
                .into_iter()
                .find(|(open, _)| rest.starts_with(open));
            if let Some((open, close)) = skip {
                at += open.len()
                    + rest[open.len()..].find(close).map_or(rest.len() - open.len(), |end| end + close.len());
                continue;
            }
            let digits = rest.chars().take_while(char::is_ascii_digit).count();
            if digits > 0 {
                positions.push(start + at..start + at + digits);
            }
            at += digits.max(rest.chars().next().map_or(1, char::len_utf8));
        }
        start += line.len();
    }
    positions
}

#[test]
fn a_number_changed_by_hand_is_noticed_wherever_it_stands() {
    let documents = documents();
    for name in DOCUMENTS {
        let text = documents.text(name).expect("it was read");
        let numbers = numbers(text);
        assert!(numbers.len() > 20, "{name} has {} numbers", numbers.len());
        for (index, at) in numbers.into_iter().enumerate() {
            // For each generated part of a document, the check generates the part's text again from the
            // records, and compares both texts as a whole. The check therefore notices any wrong number in
            // such a part, so the test changes only every 20th number there.
            let is_made =
                text[..at.start].rfind("<!-- figures: ") > text[..at.start].rfind("<!-- end of figures");
            if is_made && index % 20 != 0 {
                continue;
            }
            let word = text[..at.start].rsplit(char::is_whitespace).next().unwrap_or_default();
            let word = word.trim_start_matches(|c: char| !c.is_alphanumeric());
            if word.starts_with(|c: char| c.is_ascii_alphabetic()) {
                continue; // A name, such as H200.
            }
            let mut changed = text.to_owned();
            // The test changes a number by inserting the digit 7 before its digits, or before those after its decimal
            // point. The check is unlikely to accept the changed number.
            changed.insert(at.start, '7');
            assert!(
                !documents.check(&changed).is_empty(),
                "{name}:{}: {:?} became 7{:?}",
                text[..at.start].matches('\n').count() + 1,
                &text[at.clone()],
                &text[at]
            );
        }
    }
}

#[test]
fn a_figure_that_is_off_by_one_in_its_last_digit_is_noticed() {
    let documents = documents();
    let text = documents.text("docs/paper.md").expect("it was read");
    let is_figure = |at: &Range<usize>| text[at.end..].starts_with("<!-- ");
    let figures: Vec<_> = numbers(text).into_iter().filter(is_figure).collect();
    assert!(figures.len() > 10, "{} figures in sentences", figures.len());
    for at in figures {
        let last = text[..at.end].bytes().last().expect("a digit") - b'0';
        let mut changed = text.to_owned();
        changed.replace_range(at.end - 1..at.end, &((last + 1) % 10).to_string());
        let differences = documents.check(&changed);
        assert!(
            matches!(&differences[..], [one] if one.line > 0 && one.stands != one.records_say),
            "{differences:?}"
        );
    }
}
