//! Shortens names so that they fit into the space that plots have for names.

/// Shortens a name to at most `longest` characters; an ellipsis replaces the middle of a longer name. The
/// beginning and the end of the name remain, since names usually differ there. For example, the name of a strategy
/// begins with the preset, and may end with the value of an axis; in a legend, the exponent of a fitted power law may
/// follow.
pub fn shorten(name: &str, longest: usize) -> String {
    let length = name.chars().count();
    if length <= longest {
        return name.to_owned();
    }
    let head = longest / 3;
    let tail = longest.saturating_sub(head + 1);
    name.chars().take(head).chain(['…']).chain(name.chars().skip(length - tail)).collect()
}

/// Shortens the names of a plot to at most `longest` characters. If all names that are too long share some
/// words, such as the preset, these words are left out of these names. If a name is still too long, the keys
/// of its words (`axis=`) are left out. If the name is too long even then, [`shorten`] leaves out its middle. Different
/// names get different labels: a label that would equal an earlier label ends with a number.
pub fn shorten_all(names: &[&str], longest: usize) -> Vec<String> {
    let long: Vec<&str> = names.iter().copied().filter(|name| name.chars().count() > longest).collect();
    let mut labels: Vec<String> = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let same = names[..index].iter().position(|earlier| earlier == name);
        let text = match same {
            Some(same) => labels[same].clone(),
            None => with_number(&label(name, &long, longest), &labels, longest),
        };
        labels.push(text);
    }
    labels
}

/// Returns the shortened name of a series or point, given all names of the plot that are too long (`long`).
/// Different names may get equal labels.
fn label(name: &str, long: &[&str], longest: usize) -> String {
    let fits = |text: &str| text.chars().count() <= longest;
    if fits(name) {
        return name.to_owned();
    }
    let words = own_words(name, long);
    let values: Vec<&str> = words.iter().copied().map(value).collect();
    let text = |joined: String| joined.replace("…+", "…").replace("+…", "…");
    let with_keys = text(words.join("+"));
    if fits(&with_keys) { with_keys } else { shorten(&text(values.join("+")), longest) }
}

/// Returns the value in a word of the form `axis=value`. Returns a word of another form unchanged.
fn value(word: &str) -> &str {
    let is_axis =
        |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
    match word.split_once('=') {
        Some((axis, value)) if is_axis(axis) && !value.is_empty() => value,
        _ => word,
    }
}

/// Returns the words of a name. An ellipsis replaces adjacent words that all names in `long` share, unless
/// all words of the name are shared.
fn own_words<'a>(name: &'a str, long: &[&str]) -> Vec<&'a str> {
    let is_shared = |word: &str| long.iter().all(|other| other.split('+').any(|one| one == word));
    if name.split('+').all(is_shared) {
        return name.split('+').collect();
    }
    let mut words: Vec<&str> = name.split('+').map(|word| if is_shared(word) { "…" } else { word }).collect();
    words.dedup_by(|word, before| *word == "…" && *before == "…");
    words
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn long_names_keep_both_ends() {
        assert_eq!(shorten("tile-group", 24), "tile-group");
        let long = shorten("tile-group+intersector=common-origin: ^0.36", 24);
        assert_eq!(long, "tile-gro…n-origin: ^0.36");
        assert_eq!(long.chars().count(), 24);
    }

    #[test]
    fn names_that_share_no_word_are_shortened_as_if_alone() {
        let names = ["NVIDIA H200", "AMD EPYC 9B45, PoCL", "NVIDIA H100 80GB HBM3"];
        assert_eq!(shorten_all(&names, 12), names.map(|name| shorten(name, 12)));
        assert!(shorten_all(&[], 24).is_empty());
    }

    #[test]
    fn a_name_that_fits_stays_whole_and_the_others_lose_what_they_share() {
        let names = ["naive", "tile-group+intersector=common-origin", "tile-group+intersector=edge-planes"];
        assert_eq!(shorten_all(&names, 24), ["naive", "…common-origin", "…intersector=edge-planes"]);
    }

    #[test]
    fn a_name_that_has_only_shared_words_keeps_them() {
        let alone = "tile-group+intersector=common-origin";
        assert_eq!(shorten_all(&["naive", alone], 24), ["naive", "tile-group+common-origin"]);
        let longer = format!("{alone}+culling=back");
        assert_eq!(shorten_all(&[alone, &longer], 24), ["tile-group+common-origin", "…culling=back"]);
    }

    #[test]
    fn names_that_would_become_equal_lose_what_they_share() {
        let name = |test: &str| format!("deferred+intersector={test}+records=each-test");
        let names = ["my-test", "plucker"].map(name);
        assert_eq!(shorten(&names[0], 24), shorten(&names[1], 24));
        let names = names.each_ref().map(String::as_str);
        assert_eq!(shorten_all(&names, 24), ["…intersector=my-test…", "…intersector=plucker…"]);
        let all = ["naive", names[0], names[1], names[0]];
        let short = shorten_all(&all, 24);
        assert_eq!(short[0], "naive");
        assert!(short[1] == short[3] && short[1] != short[2], "{short:?}");
    }

    /// In this test, the third name is too long to keep the keys (`axis=`) of its words.
    #[test]
    fn words_keep_their_keys_where_there_is_room() {
        let names = [
            "deferred+vectors=private+records=each-test",
            "deferred+vectors=prepared+records=each-test",
            "deferred+vectors=private+culling=back+records=each-test",
        ];
        let short = shorten_all(&names, 24);
        assert_eq!(short, ["…vectors=private…", "…vectors=prepared…", "…private+back…"]);
    }

    #[test]
    fn only_ellipses_are_joined() {
        let names = ["tile-group+intersector=plucker+a+a", "tile-group+intersector=plucker+b"];
        assert_eq!(shorten_all(&names, 24), ["…a+a", "…b"]);
    }

    /// The name of a device may end with the label of a folder, which may contain `=`.
    #[test]
    fn only_an_axis_is_a_key() {
        let names = ["NVIDIA H200 (results/width=8)", "NVIDIA H200 results=16", "axis-without-a-value="];
        assert_eq!(shorten_all(&names, 20), names.map(|name| shorten(name, 20)));
    }

    #[test]
    fn long_words_stay_different_and_short_enough() {
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

    /// Returns the names of all combinations of words, with one word from each list.
    fn grid(lists: &[&[&str]]) -> Vec<String> {
        lists.iter().fold(vec![String::new()], |names, words| {
            let longer = |name: &String| words.iter().map(|word| format!("{name}{word}")).collect::<Vec<_>>();
            names.iter().flat_map(longer).collect()
        })
    }

    fn shortened(names: &[String], longest: usize) -> Vec<String> {
        shorten_all(&names.iter().map(String::as_str).collect::<Vec<_>>(), longest)
    }

    /// Returns the labels of the names in [`grid`], and checks that the labels differ and are short enough.
    fn labels_of_grid(lists: &[&[&str]], longest: usize) -> Vec<String> {
        let names = grid(lists);
        let short = shortened(&names, longest);
        let different: HashSet<&String> = short.iter().collect();
        assert_eq!(different.len(), names.len(), "{longest} {short:?}");
        assert!(short.iter().all(|name| name.chars().count() <= longest), "{longest} {short:?}");
        short
    }

    #[test]
    fn a_grid_of_two_axes_has_labels_with_both_values() {
        let lists: [&[&str]; 4] = [
            &["tile-group"],
            &["+culling=none", "+culling=back"],
            &["+width=8", "+width=16"],
            &["+tile=16x8"],
        ];
        let expected = [
            "…culling=none+width=8…",
            "…culling=none+width=16…",
            "…culling=back+width=8…",
            "…culling=back+width=16…",
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
            "…plucker+once+none",
            "…plucker+once+back",
            "…plucker+each-test+none",
            "…plucker+each-test+back",
            "…watertight+once+none",
            "…watertight+once+back",
            "…waterti…+each-test+none",
            "…waterti…+each-test+back",
        ];
        assert_eq!(labels_of_grid(&lists, 24), expected);
    }

    /// Some words are empty, because the name of a strategy leaves out those values that its preset has.
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

    /// Some names differ only in their middle, and the labels are too short to show the middle of a name.
    #[test]
    fn labels_that_would_still_be_equal_end_with_a_number() {
        let ends: &[&str] = &["aaaaaaaaaaaa", "bbbbbbbbbbbb"];
        let lists: [&[&str]; 3] = [ends, &["xxxxxxxxxxxx", "yyyyyyyyyyyy"], ends];
        let short = labels_of_grid(&lists, 12);
        assert_eq!(short[..4], ["aaaa…aaaaaaa", "aaaa…bbbbbbb", "aaaa…aaaaa…2", "aaaa…bbbbb…2"]);
        let names = grid(&lists);
        let twice = shortened(&[&names[..], &names].concat(), 12);
        assert_eq!(twice, [&short[..], &short].concat(), "equal names have equal labels");
    }
}
