//! Finds the numbers in a document that have no source. A number has a source if a *query* follows it (a comment that
//! says how to compute the number from stored records), or if it is in a *fact* (a phrase listed in docs/figures.toml).

/// What must be known about the earlier lines of a document in order to read the next line.
#[derive(Default)]
pub struct Fences {
    /// True if the next line is in a fenced block of code.
    within: bool,
    /// The number of the last item that was read in a numbered list.
    item: usize,
}

impl Fences {
    /// Returns a line without the number that marks the line as an item of a numbered list. A number counts as a list's
    /// number only if it is 1, or exceeds the number of the list's last item by 1.
    fn without_number<'a>(&mut self, line: &'a str) -> &'a str {
        let item = line.split_once(". ").and_then(|(number, rest)| Some((number.parse().ok()?, rest)));
        match item {
            Some((number, rest)) if number == 1 || number == self.item + 1 => {
                self.item = number;
                rest
            }
            _ => line,
        }
    }
}

/// Units of measured numbers. A code span (text between backticks) is checked if it contains a number with
/// one of the units in `UNITS`. Code spans without a unit contain options and names, and are not checked.
const UNITS: [&str; 12] =
    ["ms", "us", "ns", "s", "%", "times", "GB/s", "MB", "Gtests/s", "Mrays/s", "Grays/s", "fold"];

/// Returns a line's words that contain digits, except fenced blocks of code, code spans without a unit, targets of
/// links, names, words of facts, and the number of an item in a numbered list. Updates `fences` for the next line. If
/// one fact contains another, the longer fact must come first in `facts`.
pub fn unrecorded(line: &str, facts: &[String], fences: &mut Fences) -> Vec<String> {
    if line.trim_start().starts_with("```") {
        fences.within = !fences.within;
        return Vec::new();
    }
    if fences.within {
        return Vec::new();
    }
    let mut text = without_links(&without_code(fences.without_number(line)));
    for fact in facts {
        text = without(&text, fact);
    }
    let words = text.split(|c: char| c.is_whitespace() || "|()[]*".contains(c));
    let words = words.map(|word| word.trim_matches(|c: char| ".,:;\"'!?".contains(c)));
    words.filter(|word| has_digit(word) && !is_name(word)).map(str::to_owned).collect()
}

fn has_digit(word: &str) -> bool {
    word.contains(|c: char| c.is_ascii_digit())
}

/// Returns true if a word is a name, such as H200, f32 or AVX-512: a name begins with a letter and contains
/// no `=`.
fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_alphabetic()) && !word.contains('=')
}

/// Returns a line in which the word "code" replaces each code span without a unit. Code spans that contain a
/// number with a unit stay in the line, without their backticks.
fn without_code(line: &str) -> String {
    let part = |(index, part): (usize, &str)| {
        let is_code = index % 2 == 1 && !has_unit(part);
        if is_code { "code".to_owned() } else { part.to_owned() }
    };
    line.split('`').enumerate().map(part).collect()
}

fn has_unit(code: &str) -> bool {
    let words: Vec<&str> = code.split_whitespace().collect();
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    words.windows(2).any(|pair| is_number(pair[0]) && UNITS.contains(&pair[1]))
        || words.iter().any(|word| word.strip_suffix('%').is_some_and(is_number))
}

/// Returns a line without the targets of its links and pictures.
fn without_links(line: &str) -> String {
    let mut parts = line.split("](");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + "] " + part.split_once(')').map_or(part, |(_, after)| after))
}

/// Returns `text` with the word "fact" in place of the phrase `phrase` (a fact listed in docs/figures.toml). The phrase
/// stays in the text wherever the phrase adjoins a letter, a digit or a part of a number.
fn without(text: &str, phrase: &str) -> String {
    let mut rest = text;
    let mut result = String::new();
    while let Some(at) = rest.find(phrase) {
        let (before, after) = (&rest[..at], &rest[at + phrase.len()..]);
        let whole = result.clone() + before;
        let touches_before = whole.ends_with(|c: char| c.is_alphanumeric() || ".,-±~<>".contains(c))
            && number_begins(phrase, &whole);
        let alone = !touches_before && !number_goes_on(after);
        result = whole + if alone { " fact " } else { phrase };
        rest = after;
    }
    result + rest
}

/// Returns true if `phrase` continues the last word or number of `before`, the text in front of the phrase.
fn number_begins(phrase: &str, before: &str) -> bool {
    let first_is_number = phrase.starts_with(|c: char| c.is_alphanumeric());
    let part = before.ends_with(|c: char| c.is_alphanumeric() || c == '-' || c == '±');
    let decimal = before.ends_with(['.', ','])
        && before.trim_end_matches(['.', ',']).ends_with(|c: char| c.is_ascii_digit());
    first_is_number && (part || decimal)
}

/// Returns true if the text after a phrase continues the phrase's last word or number.
fn number_goes_on(after: &str) -> bool {
    let mut next = after.chars();
    match next.next() {
        Some('.' | ',') => next.next().is_some_and(|c| c.is_ascii_digit()),
        Some(c) => c.is_alphanumeric() || c == '%',
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers_in(line: &str, facts: &[&str]) -> Vec<String> {
        let facts: Vec<String> = facts.iter().map(|fact| (*fact).to_owned()).collect();
        unrecorded(line, &facts, &mut Fences::default())
    }

    #[test]
    fn numbers_without_a_record_are_found() {
        assert_eq!(numbers_in("The H200 takes 3.2 ms, 17% of `width=4`.", &[]), ["3.2", "17%"]);
        assert_eq!(numbers_in("A frame of `3.2 ms` at n=5", &[]), ["3.2", "n=5"]);
        assert!(numbers_in("`--repeat 3` or `width = 4`", &[]).is_empty());
        assert!(numbers_in("![x 1](images/a-2.png), [AVX-512](x-3)", &["x 1"]).is_empty());
        assert_eq!(numbers_in("[a 1](b-2) and 3, [c](d-4)", &[]), ["1", "3"]);
    }

    #[test]
    fn the_numbers_of_a_list_are_no_figures_but_other_numbers_there_are() {
        let mut fences = Fences::default();
        let numbers = ["1. one", "   more", "2. two", "73. three", "3. of 5"]
            .map(|line| unrecorded(line, &[], &mut fences));
        assert_eq!(numbers, [vec![], vec![], vec![], vec!["73".to_owned()], vec!["5".to_owned()]]);
        let second = ["1. one", "2. two"].map(|line| unrecorded(line, &[], &mut fences));
        assert!(second.iter().all(Vec::is_empty), "a second list begins at 1: {second:?}");
    }

    #[test]
    fn a_fact_answers_for_its_own_words_only() {
        let facts = ["1026 triangles", "800 x 500", "8 blocks"];
        assert!(numbers_in("1026 triangles at 800 x 500, 8 blocks.", &facts).is_empty());
        assert_eq!(
            numbers_in("1027 triangles, 11026 triangles, 1.8 blocks", &facts),
            ["1027", "11026", "1.8"]
        );
        assert_eq!(numbers_in("800 x 5000", &facts), ["800", "5000"]);
        // A sign, or a group of digits, before a phrase is part of the phrase's first number.
        assert_eq!(numbers_in("-8 blocks, ±8 blocks, 1,800 x 500", &facts), ["-8", "±8", "1,800", "500"]);
        assert_eq!(numbers_in("12% of 12 groups", &["12"]), ["12%"]);
    }
}
