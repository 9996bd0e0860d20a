//! Shortens names to the space that plots have for them.

use crate::entry::entry;

/// Shortens a name to at most `longest` characters; an ellipsis replaces its middle. The beginning and the end of the
/// name remain, since names differ there. A name begins with the preset, and may end with the value of an axis or with
/// the exponent of a fitted power law.
pub fn shorten(name: &str, longest: usize) -> String {
    let length = name.chars().count();
    if length <= longest {
        return name.to_owned();
    }
    let head = longest / 3;
    let tail = longest.saturating_sub(head + 1);
    name.chars().take(head).chain(['…']).chain(name.chars().skip(length - tail)).collect()
}

/// Shortens the names of a plot like [`shorten`]. If different names would become equal, the parts that they share are
/// cut instead of the middle, so that the names stay different.
pub fn shorten_all(names: &[&str], longest: usize) -> Vec<String> {
    let mut short: Vec<String> = names.iter().map(|name| shorten(name, longest)).collect();
    let all: Vec<usize> = (0..names.len()).collect();
    let mut alike = alike_of(names, &short, &all);
    while let Some(set) = alike.pop() {
        let long: Vec<Vec<char>> = set.iter().map(|index| names[*index].chars().collect()).collect();
        let shared = shared_words(&long, longest.saturating_sub(2));
        for (index, name) in set.iter().zip(&long) {
            short[*index] = cut(name, shared, longest);
        }
        // Each set that is still alike must be smaller, so that the loop ends.
        let smaller = alike_of(names, &short, &set).into_iter().filter(|rest| rest.len() < set.len());
        alike.extend(smaller);
    }
    short
}

/// Returns the sets of indices of different names with the same short name, among the indices `among`.
fn alike_of(names: &[&str], short: &[String], among: &[usize]) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for index in among {
        entry(&mut sets, |set| short[set[0]] == short[*index], Vec::new).push(*index);
    }
    sets.retain(|set| set.iter().any(|index| names[*index] != names[set[0]]));
    sets
}

/// Returns how many characters all names share at the beginning, and how many at the end. Only whole words are counted,
/// unless what remains between them is longer than `room` in some name.
fn shared_words(names: &[Vec<char>], room: usize) -> [usize; 2] {
    let [head, tail] = shared_characters(names);
    let Some(first) = names.first() else { return [0; 2] };
    let is_end = |c: &char| matches!(c, '+' | '=' | ',' | ':' | ' ');
    let words_head = first[..head].iter().rposition(is_end).map_or(0, |index| index + 1);
    let ending = &first[first.len() - tail..];
    let words_tail = ending.iter().position(is_end).map_or(0, |index| tail - index);
    let fits = |name: &Vec<char>| name.len() - words_head - words_tail <= room;
    if names.iter().all(fits) { [words_head, words_tail] } else { [head, tail] }
}

/// Returns how many characters all names share at the beginning, and how many at the end. The two parts overlap in no
/// name.
fn shared_characters(names: &[Vec<char>]) -> [usize; 2] {
    let Some(first) = names.first() else { return [0; 2] };
    let shortest = names.iter().map(Vec::len).min().unwrap_or(0);
    let at_head = |index: &usize| names.iter().all(|name| name[*index] == first[*index]);
    let head = (0..shortest).take_while(at_head).count();
    let from_end = |name: &[char], index: usize| name[name.len() - index];
    let at_tail = |index: &usize| names.iter().all(|name| from_end(name, *index) == from_end(first, *index));
    let tail = (1..=shortest - head).take_while(at_tail).count();
    [head, tail]
}

/// Shortens a name to at most `longest` characters by cutting its first `head` and its last `tail` characters. What lies
/// between them remains if it is short enough.
fn cut(name: &[char], [head, tail]: [usize; 2], longest: usize) -> String {
    let room = longest.saturating_sub(2);
    let text = |part: &[char]| part.iter().collect::<String>();
    let middle = shorten(&text(&name[head..name.len() - tail]), room);
    let left = room.saturating_sub(middle.chars().count());
    let before = head.min(left - tail.min(left / 2));
    let after = tail.min(left - before);
    let gap = |is_cut: bool| if is_cut { "…" } else { "" };
    let [start, end] = [text(&name[..before]), text(&name[name.len() - after..])];
    let short = format!("{start}{}{middle}{}{end}", gap(before < head), gap(after < tail));
    // If nothing lies between the cut parts, one ellipsis is enough.
    short.replace("……", "…")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_keep_both_ends() {
        assert_eq!(shorten("tile-group", 24), "tile-group");
        let long = shorten("tile-group+intersector=common-origin: ^0.36", 24);
        assert_eq!(long, "tile-gro…n-origin: ^0.36");
        assert_eq!(long.chars().count(), 24);
    }

    #[test]
    fn names_that_stay_different_are_shortened_as_if_alone() {
        let names = ["naive", "tile-group+intersector=common-origin", "tile-group+intersector=edge-planes"];
        assert_eq!(shorten_all(&names, 24), names.map(|name| shorten(name, 24)));
        assert!(shorten_all(&[], 24).is_empty());
    }

    #[test]
    fn names_that_would_become_equal_lose_what_they_share() {
        let name = |test: &str| format!("deferred+intersector={test}+records=each-test");
        let names = ["my-test", "plucker"].map(name);
        assert_eq!(shorten(&names[0], 24), shorten(&names[1], 24));
        let names = names.each_ref().map(String::as_str);
        assert_eq!(shorten_all(&names, 24), ["deferred…my-test…ch-test", "deferred…plucker…ch-test"]);
        let all = ["naive", names[0], names[1], names[0]];
        let short = shorten_all(&all, 24);
        assert_eq!(short[0], "naive");
        assert!(short[1] == short[3] && short[1] != short[2], "{short:?}");
    }

    /// All names begin with "deferred+vectors=pr", which ends within a word.
    #[test]
    fn words_stay_whole_where_there_is_room() {
        let names = [
            "deferred+vectors=private+records=each-test",
            "deferred+vectors=prepared+records=each-test",
            "deferred+vectors=private+culling=back+records=each-test",
        ];
        let short = shorten_all(&names, 24);
        let expected = ["deferred…private…ch-test", "deferre…prepared…ch-test", "d…private+culling=back…t"];
        assert_eq!(short, expected);
    }

    #[test]
    fn long_middles_stay_different_and_short_enough() {
        let name = |middle: String| format!("tile-group{middle}+culling=back");
        let names: Vec<String> =
            (0..40).map(|n| name(format!("{n:02}{}", "x".repeat(30)))).chain([name(String::new())]).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        for longest in [12, 20, 24] {
            let short = shorten_all(&names, longest);
            let different: std::collections::HashSet<&String> = short.iter().collect();
            assert_eq!(different.len(), names.len(), "{short:?}");
            assert!(short.iter().all(|name| name.chars().count() <= longest), "{short:?}");
        }
    }
}
