//! Examples in README.md and in pages of docs/ work: the TOML of some pages loads, the command lines of some pages
//! parse, and the lines of code that docs/kernels.md quotes are in the kernels.

use clap::Parser as _;
use raycl::cli::Cli;
use raycl::experiment::Plan;
use std::fs;
use std::path::Path;

const PAGES: [&str; 3] = ["README.md", "docs/scenes.md", EXPERIMENTS];
const EXPERIMENTS: &str = "docs/experiments.md";

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the fenced blocks of a page that are marked with one of `languages`.
fn blocks(page: &str, languages: &[&str]) -> Vec<String> {
    let text = fs::read_to_string(repository().join(page)).expect("a page");
    let fences = text.split("\n```").skip(1).step_by(2);
    let marked = fences.filter_map(|block| block.split_once('\n'));
    marked.filter(|(language, _)| languages.contains(language)).map(|(_, body)| body.to_owned()).collect()
}

/// Returns a folder with the repository's scenes in it, as the snippets assume.
fn folder_with_scenes() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = folder.path().join("scenes");
    fs::create_dir(&scenes).expect("a folder");
    for entry in fs::read_dir(repository().join("scenes")).expect("scenes") {
        let path = entry.expect("an entry").path();
        // Subfolders contain only files of scenes/table.toml, which no snippet needs.
        if path.is_dir() {
            continue;
        }
        fs::copy(&path, scenes.join(path.file_name().expect("a name"))).expect("a copy");
    }
    folder
}

/// Returns a block's name, if its first line is a comment with a file's name, as in `# my-scene.toml`.
fn name(block: &str) -> &str {
    let first = block.lines().next().and_then(|line| line.strip_prefix("# ")).unwrap_or_default();
    if first.contains('.') && !first.contains(' ') { first } else { "snippet.toml" }
}

#[test]
fn every_toml_block_loads() {
    for page in PAGES {
        let folder = folder_with_scenes();
        let blocks = blocks(page, &["toml", "obj", "mtl"]);
        assert!(blocks.len() >= 2, "{page} has {} blocks", blocks.len());
        for block in &blocks {
            fs::write(folder.path().join(name(block)), block).expect("a file");
        }
        for block in blocks.iter().filter(|block| name(block).ends_with(".toml")) {
            let path = folder.path().join(name(block));
            // All blocks without a name share one file, which now contains the text of the last block without
            // a name. Before a block of TOML is loaded, its text is therefore written to its file again.
            fs::write(&path, block).expect("a file");
            if block.contains("question = ") {
                let experiment = raycl::config::load(&path, &[]).unwrap_or_else(|e| panic!("{page}: {e}"));
                assert!(!Plan::new(&experiment, 1).points.is_empty(), "{page}: {block}");
            } else {
                let loaded =
                    raycl::scene::load_scene(&path).unwrap_or_else(|e| panic!("{page}: {e}\n{block}"));
                assert!(loaded.notes.is_empty(), "{page}: {:?}", loaded.notes);
            }
        }
    }
}

/// Splits a command line into words. Spaces between single quotes do not split a word.
fn words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    for (part, text) in line.split('\'').enumerate() {
        if part % 2 == 1 {
            words.last_mut().expect("a word").push_str(text);
            continue;
        }
        for (number, word) in text.split(' ').enumerate() {
            if number > 0 {
                words.push(String::new());
            }
            words.last_mut().expect("a word").push_str(word);
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[test]
fn every_command_line_parses_and_names_files_that_are_there() {
    let mut seen = 0;
    let pages = ["README.md", "docs/render.md", "docs/tools.md", EXPERIMENTS];
    for block in pages.into_iter().flat_map(|page| blocks(page, &["sh"])) {
        for line in block.lines().filter(|line| line.starts_with("raycl ")) {
            let words = words(line);
            Cli::try_parse_from(&words).unwrap_or_else(|error| panic!("{line}: {error}"));
            let of_repository = |word: &&String| word.starts_with("scenes/") || word.starts_with("configs/");
            for file in words.iter().filter(of_repository) {
                assert!(repository().join(file).is_file(), "{line}: no {file}");
            }
            seen += 1;
        }
    }
    assert!(seen >= 10, "only {seen} command lines");
}

#[test]
fn the_experiments_page_sets_keys_that_its_configs_have() {
    let mut seen = 0;
    for line in blocks(EXPERIMENTS, &["sh"]).iter().flat_map(|block| block.lines()) {
        let words = words(line);
        let options = words.windows(2).filter(|pair| pair[0] == "--set");
        let sets: Vec<_> = options.filter_map(|pair| pair[1].split_once('=')).collect();
        if sets.is_empty() {
            continue;
        }
        let owned: Vec<_> = sets.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
        let load = |sets: &[_]| {
            let experiment = raycl::config::load(&repository().join(&words[2]), sets);
            experiment.map(|experiment| raycl::config::Experiment { overrides: Vec::new(), ..experiment })
        };
        let changed = load(&owned).unwrap_or_else(|error| panic!("{line}: {error}"));
        // Each `--set` in a command line has an effect. If one `--set` is left out, raycl refuses the
        // experiment, or loads another experiment than with every `--set`.
        for index in 0..owned.len() {
            let mut fewer = owned.clone();
            let left_out = fewer.remove(index);
            assert!(load(&fewer).ok().as_ref() != Some(&changed), "{line}: {left_out:?} changes nothing");
        }
        seen += sets.len();
    }
    assert!(seen >= 8, "only {seen} changes");
}

#[test]
fn the_lines_that_the_kernels_page_quotes_stand_in_their_files() {
    let page = fs::read_to_string(repository().join("docs/kernels.md")).expect("a page");
    let quotes: Vec<_> =
        page.split("\n```c cl/").skip(1).filter_map(|quote| quote.split_once('\n')).collect();
    assert!(quotes.len() > 10, "{} quotes", quotes.len());
    for (file, rest) in quotes {
        let body = rest.split("\n```").next().unwrap_or_default();
        let source = fs::read_to_string(repository().join("cl").join(file)).expect("a kernel file");
        let mut lines = source.lines().map(str::trim);
        let mut may_omit_code = true;
        for quoted in body.lines().map(str::trim) {
            if quoted == "..." {
                may_omit_code = true;
                continue;
            }
            let mut omitted = Vec::new();
            let is_there = lines.any(|line| {
                omitted.push(line);
                line == quoted
            });
            assert!(is_there, "cl/{file} has no line, or not there: {quoted}");
            omitted.pop();
            let is_code = |line: &&str| !line.is_empty() && !line.starts_with("//");
            let code = omitted.into_iter().find(is_code).filter(|_| !may_omit_code);
            assert_eq!(code, None, "cl/{file}: a line before {quoted:?} is omitted without a mark");
            may_omit_code = false;
        }
    }
}
