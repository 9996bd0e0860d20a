//! Shortens names to the space that plots have for them.

use std::collections::{HashMap, HashSet};

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
/// cut instead of the middle. Different names stay different: if this does not suffice, a number ends the label.
pub fn shorten_all(names: &[&str], longest: usize) -> Vec<String> {
    let sets = unlike_sets(names, longest);
    let label_of: HashMap<&str, String> =
        sets.iter().flat_map(|set| labels(set, longest)).map(|label| (label.name, label.text)).collect();
    let mut short: Vec<String> = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let same = names[..index].iter().position(|earlier| earlier == name);
        let label = match same {
            Some(same) => short[same].clone(),
            None => with_number(&label_of[*name], &short, longest),
        };
        short.push(label);
    }
    short
}

/// A shortened name.
struct Label<'a> {
    /// The whole name.
    name: &'a str,
    /// The part that tells the name from the others of its set; the whole label if the name is alone in its set.
    middle: String,
    /// The label.
    text: String,
}

/// Returns the sets of names that are cut together. No label's middle is in two sets. (What remains beside the middle
/// is often too short to tell names apart, as `…k` of `culling=back`.)
fn unlike_sets<'a>(names: &[&'a str], longest: usize) -> Vec<Vec<&'a str>> {
    let mut different = names.to_vec();
    different.sort_unstable();
    different.dedup();
    let mut sets: Vec<Vec<&str>> = different.into_iter().map(|name| vec![name]).collect();
    // The names of a united set share less, so their labels change, and may equal those of another set. Each round but
    // the last reduces the number of sets, so the loop ends.
    loop {
        let count = sets.len();
        sets = unite(sets, longest);
        if sets.len() == count {
            return sets;
        }
    }
}

/// Unites the sets that have a label's middle in common.
fn unite(sets: Vec<Vec<&str>>, longest: usize) -> Vec<Vec<&str>> {
    let mut united: Vec<(Vec<&str>, HashSet<String>)> = Vec::new();
    for mut set in sets {
        let mut middles: HashSet<String> =
            labels(&set, longest).into_iter().map(|label| label.middle).collect();
        let (alike, others): (Vec<_>, Vec<_>) =
            united.into_iter().partition(|(_, known)| !known.is_disjoint(&middles));
        united = others;
        for (names, known) in alike {
            set.extend(names);
            middles.extend(known);
        }
        united.push((set, middles));
    }
    united.into_iter().map(|(set, _)| set).collect()
}

/// Returns the labels of a set of different names. Some labels may be equal.
fn labels<'a>(set: &[&'a str], longest: usize) -> Vec<Label<'a>> {
    if let &[name] = set {
        let text = shorten(name, longest);
        return vec![Label { name, middle: text.clone(), text }];
    }
    let long: Vec<Vec<char>> = set.iter().map(|name| name.chars().collect()).collect();
    let shared = shared_words(&long, longest.saturating_sub(2));
    let label = |(&name, long): (&&'a str, &Vec<char>)| {
        let [middle, text] = cut(long, shared, longest);
        Label { name, middle, text }
    };
    set.iter().zip(&long).map(label).collect()
}

/// Returns a label that is not among `others`: `label`, with a number at its end if necessary.
fn with_number(label: &str, others: &[String], longest: usize) -> String {
    let mut free = label.to_owned();
    let mut number = 1;
    while others.contains(&free) {
        number += 1;
        let ending = format!("…{number}");
        let room = longest.saturating_sub(ending.chars().count());
        free = label.chars().take(room).chain(ending.chars()).collect();
    }
    free
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
    let fits = |name: &Vec<char>| middle(name, [words_head, words_tail], room).chars().count() <= room;
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

/// Returns what lies between the first `head` and the last `tail` characters of a name. If this is longer than `room`,
/// the keys of its words are left out: "plucker+records=once" becomes "plucker+once".
fn middle(name: &[char], [head, tail]: [usize; 2], room: usize) -> String {
    let whole: String = name[head..name.len() - tail].iter().collect();
    if whole.chars().count() <= room {
        return whole;
    }
    let value = |word: &str| word.split_once('=').map_or(word, |(_, value)| value).to_owned();
    whole.split('+').map(value).collect::<Vec<_>>().join("+")
}

/// Shortens a name to at most `longest` characters by cutting its first `head` and its last `tail` characters. What lies
/// between them remains if it is short enough. Returns the shortened middle and the whole label.
fn cut(name: &[char], [head, tail]: [usize; 2], longest: usize) -> [String; 2] {
    let room = longest.saturating_sub(2);
    let text = |part: &[char]| part.iter().collect::<String>();
    let middle = shorten(&middle(name, [head, tail], room), room);
    let left = room.saturating_sub(middle.chars().count());
    let before = head.min(left - tail.min(left / 2));
    let after = tail.min(left - before);
    let gap = |is_cut: bool| if is_cut { "…" } else { "" };
    let [start, end] = [text(&name[..before]), text(&name[name.len() - after..])];
    let short = format!("{start}{}{middle}{}{end}", gap(before < head), gap(after < tail));
    // If nothing lies between the cut parts, one ellipsis is enough.
    let short = short.replace("……", "…");
    [middle, short]
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
            let different: HashSet<&String> = short.iter().collect();
            assert_eq!(different.len(), names.len(), "{short:?}");
            assert!(short.iter().all(|name| name.chars().count() <= longest), "{short:?}");
        }
    }

    /// Returns the names of all combinations of the words, one word of each list.
    fn grid(lists: &[&[&str]]) -> Vec<String> {
        lists.iter().fold(vec![String::new()], |names, words| {
            let longer = |name: &String| words.iter().map(|word| format!("{name}{word}")).collect::<Vec<_>>();
            names.iter().flat_map(longer).collect()
        })
    }

    fn shortened(names: &[String], longest: usize) -> Vec<String> {
        shorten_all(&names.iter().map(String::as_str).collect::<Vec<_>>(), longest)
    }

    /// Returns the labels of a grid, and checks that they differ and are short enough.
    fn labels_of_grid(lists: &[&[&str]], longest: usize) -> Vec<String> {
        let names = grid(lists);
        let short = shortened(&names, longest);
        let different: HashSet<&String> = short.iter().collect();
        assert_eq!(different.len(), names.len(), "{longest} {short:?}");
        assert!(short.iter().all(|name| name.chars().count() <= longest), "{longest} {short:?}");
        short
    }

    /// The first cut makes two pairs, each with the middles "none" and "back".
    #[test]
    fn a_grid_of_two_axes_has_labels_with_both_values() {
        let lists: [&[&str]; 4] = [
            &["tile-group"],
            &["+culling=none", "+culling=back"],
            &["+width=8", "+width=16"],
            &["+tile=16x8"],
        ];
        let expected = [
            "tile-…none+width=8…=16x8",
            "tile-…none+width=16…16x8",
            "tile-…back+width=8…=16x8",
            "tile-…back+width=16…16x8",
        ];
        assert_eq!(labels_of_grid(&lists, 24), expected);
    }

    #[test]
    fn a_grid_of_three_axes_has_labels_with_all_values() {
        let lists: [&[&str]; 3] = [
            &["deferred+intersector=plucker", "deferred+intersector=watertight"],
            &["+records=once", "+records=each-test"],
            &["+culling=none", "+culling=back"],
        ];
        let expected = [
            "defer…plucker+once+none",
            "defer…plucker+once+back",
            "…plucker+each-test+none",
            "…plucker+each-test+back",
            "de…watertight+once+none",
            "de…watertight+once+back",
            "…waterti…each-test+none",
            "…waterti…each-test+back",
        ];
        assert_eq!(labels_of_grid(&lists, 24), expected);
    }

    /// A word may be empty: the name of a strategy leaves out the values of its preset.
    #[test]
    fn no_two_labels_of_a_grid_are_equal_and_none_is_too_long() {
        let axes: [&[&str]; 5] = [
            &["+intersector=watertight", "+intersector=plucker", ""],
            &["+vectors=private", "+vectors=prepared"],
            &["+records=each-test", "+records=once", ""],
            &["+culling=none", "+culling=back"],
            &["+width=8", "+width=16", ""],
        ];
        let presets: &[&str] = &["deferred", "tile-group"];
        for choice in 0..32 {
            let is_chosen = |axis: usize| (choice >> axis) & 1 == 1;
            let words = |axis: usize| if is_chosen(axis) { axes[axis] } else { &axes[axis][..1] };
            let lists: Vec<&[&str]> = std::iter::once(presets).chain((0..axes.len()).map(words)).collect();
            for longest in [12, 20, 24, 25] {
                labels_of_grid(&lists, longest);
            }
        }
    }

    /// There is no room for the middle value, in which two names each differ.
    #[test]
    fn labels_that_would_still_be_equal_end_with_a_number() {
        let ends: &[&str] = &["aaaaaaaaaaaa", "bbbbbbbbbbbb"];
        let lists: [&[&str]; 3] = [ends, &["xxxxxxxxxxxx", "yyyyyyyyyyyy"], ends];
        let short = labels_of_grid(&lists, 12);
        assert_eq!(short[..4], ["aaa…aaaaaa", "aaa…bbbbbb", "aaa…aaaaaa…2", "aaa…bbbbbb…2"]);
        let names = grid(&lists);
        let twice = shortened(&[&names[..], &names].concat(), 12);
        assert_eq!(twice, [&short[..], &short].concat(), "equal names have equal labels");
    }
}
