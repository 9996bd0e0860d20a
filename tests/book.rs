//! Tests of the book that is made from docs/, and of the links in the documents. Each link, except web addresses,
//! must lead to a file that exists and, if the link names a heading, to a heading of that file. These tests need the
//! repository, since the package contains neither docs/images nor docs/results. Another test checks that
//! ARCHITECTURE.md lists every file and folder directly in src/.

use crate::binary::repository;
use std::collections::BTreeSet;
use std::fs::{read_dir, read_to_string};
use std::path::{Path, PathBuf};

/// Returns the paths of the book's pages in docs/: the Markdown files directly in docs/ except SUMMARY.md, and the
/// page on the stored results.
fn pages() -> BTreeSet<String> {
    let entries =
        read_dir(repository("docs")).expect("docs").map(|entry| entry.expect("an entry").file_name());
    let names = entries.filter_map(|name| name.into_string().ok());
    let own = names.filter(|name| name.ends_with(".md") && name != "SUMMARY.md");
    own.chain(["results/README.md".to_owned()]).collect()
}

/// Returns a text without code, which is in fenced blocks or between backticks.
fn without_code(text: &str) -> String {
    let mut fenced = false;
    let mut prose = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            prose.extend(line.split('`').step_by(2));
            prose.push('\n');
        }
    }
    prose
}

/// Returns the targets of a page's links and pictures, except web addresses.
pub(crate) fn links(text: &str) -> Vec<String> {
    let targets = without_code(text)
        .split("](")
        .skip(1)
        .filter_map(|rest| Some(rest.split_once(')')?.0.to_owned()))
        .collect::<Vec<_>>();
    targets.into_iter().filter(|target| !target.contains("://")).collect()
}

/// Returns the name by which links refer to a heading, as GitHub and mdBook derive it.
fn anchor(heading: &str) -> String {
    let words = heading.trim().to_lowercase().replace(' ', "-");
    words.chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_')).collect()
}

fn anchors(path: &Path) -> BTreeSet<String> {
    let text = read_to_string(path).expect("a page");
    text.lines()
        .filter(|line| line.starts_with('#'))
        .map(|line| anchor(line.trim_start_matches('#')))
        .collect()
}

#[test]
fn every_page_is_in_the_book_once() {
    let summary = read_to_string(repository("docs/SUMMARY.md")).expect("the table of contents");
    let listed = links(&summary);
    let distinct: BTreeSet<String> = listed.iter().cloned().collect();
    assert_eq!(listed.len(), distinct.len(), "a page is listed twice");
    assert_eq!(distinct, pages());
    let parts: Vec<_> = summary.lines().filter_map(|line| line.strip_prefix("# For ")).collect();
    assert_eq!(parts, ["pictures", "students", "engineers"]);
    let book: toml::Table = read_to_string(repository("book.toml")).expect("the book").parse().expect("TOML");
    assert_eq!(book["book"]["src"].as_str(), Some("docs"));
}

#[test]
fn the_architecture_lists_every_file_and_folder_of_src() {
    let text = read_to_string(repository("ARCHITECTURE.md")).expect("the page");
    let list =
        text.split_once("\nsrc/\n").and_then(|(_, rest)| rest.split_once("\ncl/\n")).expect("the list").0;
    let words: BTreeSet<&str> =
        list.split_whitespace().map(|word| word.trim_end_matches([':', ',', ';'])).collect();
    for entry in read_dir(repository("src")).expect("src") {
        let name = entry.expect("an entry").file_name().into_string().expect("UTF-8");
        // A file and the folder of its submodules are one line of the list in ARCHITECTURE.md.
        let stem = name.trim_end_matches(".rs");
        let forms = [format!("{stem}.rs"), format!("{stem}/")];
        assert!(forms.iter().any(|form| words.contains(form.as_str())), "ARCHITECTURE.md lacks src/{name}");
    }
}

/// Returns false for a Markdown file in docs/ that is not a page of the book: mdBook does not copy such a file.
fn is_in_book(path: &Path) -> bool {
    let [path, docs] = [path, &repository("docs")].map(|path| path.canonicalize().expect("a path"));
    let inside = path.strip_prefix(docs).ok().and_then(Path::to_str);
    inside.is_none_or(|name| !name.ends_with(".md") || name == "SUMMARY.md" || pages().contains(name))
}

#[test]
fn every_link_of_the_documents_leads_somewhere() {
    let own = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/SUMMARY.md"]
        .map(str::to_owned);
    let documents = own.into_iter().chain(pages().into_iter().map(|name| format!("docs/{name}")));
    let mut seen = 0;
    for name in documents {
        let page = repository(&name);
        for link in links(&read_to_string(&page).expect("a page")) {
            let (file, heading) = link.split_once('#').unwrap_or((&link, ""));
            let path: PathBuf =
                if file.is_empty() { page.clone() } else { page.parent().expect("a folder").join(file) };
            assert!(path.exists(), "{name}: there is no {link}");
            assert!(is_in_book(&path), "{name}: docs/SUMMARY.md does not list {link}, so the book lacks it");
            let known = heading.is_empty() || anchors(&path).contains(heading);
            assert!(known, "{name}: {file} has no heading for {link}: {:?}", anchors(&path));
            seen += 1;
        }
    }
    assert!(seen > 100, "only {seen} links");
}
