//! Formats numbers and lists of names in sentences, and arguments of commands.

use crate::printer::steers;
use std::fmt::{Display, Write as _};
use std::path::Path;

/// Formats a count and its noun: "1 material", "2 entries", "12,345 vertices". The word before "of", "that",
/// "with", "without", "named" or "after" becomes plural ("3 primitives of lines"). If `what` contains none of
/// these words, the last word of `what` becomes plural ("2 compute units").
pub fn counted(count: usize, what: &str) -> String {
    let what = if count == 1 { what.to_owned() } else { plural(what) };
    format!("{} {what}", grouped(count))
}

/// Formats a count and its noun with the verb: "1 face is", "2 faces are", "3 primitives of lines are".
pub fn counted_are(count: usize, what: &str) -> String {
    format!("{} {}", counted(count, what), if count == 1 { "is" } else { "are" })
}

/// Formats a part of a count with the noun: "1 of 4 points", "1 of 1 point".
pub fn counted_of(part: usize, all: usize, what: &str) -> String {
    format!("{} of {}", grouped(part), counted(all, what))
}

/// Formats a part of a count with the noun and the verb: "1 of 4 points is", "2 of 4 points are", "1 of 1 point is".
pub fn counted_of_are(part: usize, all: usize, what: &str) -> String {
    format!("{} {}", counted_of(part, all, what), if part == 1 { "is" } else { "are" })
}

/// Formats a part of a count with the noun and the verb: "1 of 4 points was", "2 of 4 points were", "1 of 1 point was".
pub fn counted_of_were(part: usize, all: usize, what: &str) -> String {
    format!("{} {}", counted_of(part, all, what), if part == 1 { "was" } else { "were" })
}

/// Returns a part of a device's identity or state, such as "1 threads", with the noun in the singular if the
/// number before the noun is 1. In the text of a device's identity or state, counted nouns are always in the
/// plural. raycl corrects the plural only where it shows the text, since keys of records depend on the text.
/// Words such as "of the parallel caster" may follow the noun.
pub fn in_singular(part: &str) -> String {
    let (counted, rest) = part.split_at(part.find(" of ").unwrap_or(part.len()));
    match counted.strip_prefix("1 ").and_then(|noun| noun.strip_suffix('s')) {
        Some(noun) => format!("1 {noun}{rest}"),
        None => part.to_owned(),
    }
}

/// Returns a number as text. From 10,000 on, commas separate groups of three digits.
fn grouped(count: usize) -> String {
    let digits = count.to_string();
    if digits.len() < 5 {
        return digits;
    }
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy).collect();
    groups.join(",")
}

/// Formats a rate: "12.60 Gtests/s" for 12.6e9 `tests` per second.
pub fn rate(per_s: f64, what: &str) -> String {
    let (scale, prefix) = match per_s {
        1e9.. => (1e-9, "G"),
        1e6.. => (1e-6, "M"),
        1e3.. => (1e-3, "k"),
        _ => (1.0, ""),
    };
    format!("{:.2} {prefix}{what}/s", per_s * scale)
}

/// Returns an argument as a word for a shell: with quotes, unless it has only characters that every shell
/// reads unchanged.
pub fn quote(argument: &str) -> String {
    let harmless = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !argument.is_empty() && argument.chars().all(harmless) {
        return argument.to_owned();
    }
    if argument.contains(is_hidden) {
        return format!("$'{}'", escaped(argument));
    }
    format!("'{}'", argument.replace('\'', r"'\''"))
}

/// Returns true if messages show another text in place of the character, or may break their lines at the
/// character.
fn is_hidden(c: char) -> bool {
    c == '\n' || c == '\t' || steers(c)
}

/// Escapes an argument for the quotes `$'...'` of a shell. A line break becomes `\n`; the bytes of all other
/// hidden characters become octal numbers.
fn escaped(argument: &str) -> String {
    let mut text = String::new();
    for c in argument.chars() {
        match c {
            '\n' => text.push_str(r"\n"),
            '\'' | '\\' => text.extend(['\\', c]),
            _ if is_hidden(c) => c.encode_utf8(&mut [0; 4]).bytes().for_each(|byte| {
                // Writing to a String cannot fail.
                let _ = write!(text, "\\{byte:03o}");
            }),
            _ => text.push(c),
        }
    }
    text
}

/// Joins names with commas. Of more than four names, lists only the first four names and the number of all
/// further names: "a, b, c, d, and 2 more".
pub fn few(names: &[impl AsRef<str>]) -> String {
    first(names, 4)
}

/// Joins names with commas. Of more than `most` names, lists only the first `most` names and the number of all further
/// names.
pub fn first(names: &[impl AsRef<str>], most: usize) -> String {
    let more = names.len().checked_sub(most).filter(|more| *more > 0).map(|more| format!("and {more} more"));
    names.iter().take(most).map(|name| name.as_ref().to_owned()).chain(more).collect::<Vec<_>>().join(", ")
}

/// Joins names with commas. Lists only the first eight names, and the number of all further names:
/// "a, b, c, d, e, f, g, h and 2 more".
pub fn eight(names: &[impl AsRef<str>]) -> String {
    let first: Vec<&str> = names.iter().take(8).map(AsRef::as_ref).collect();
    let more = names.len() - first.len();
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    first.join(", ") + &more
}

/// Returns a command as a line for a shell: the assignments of environment variables (each given as
/// `NAME=VALUE`; texts without `=` are left out), then the command's words.
pub fn command_line<'a>(variables: impl IntoIterator<Item = &'a String>, words: &[String]) -> String {
    let assigned = |(name, value): (&str, &str)| format!("{name}={}", quote(value));
    let variables = variables.into_iter().filter_map(|setting| setting.split_once('=')).map(assigned);
    variables.chain(words.iter().map(|word| quote(word))).collect::<Vec<_>>().join(" ")
}

/// Returns an option and its value as words of a command. A value that begins with `-` is joined to the
/// option by `=`; as a separate word, such a value would be read as another option.
pub fn option(name: &str, value: impl Display) -> Vec<String> {
    let value = value.to_string();
    match value.starts_with('-') {
        true => vec![format!("{name}={value}")],
        false => vec![name.to_owned(), value],
    }
}

/// Returns a path as a word of a command. A path that begins with `-` gets the prefix `./`, since a command
/// would read it as an option.
pub fn path_word(path: &Path) -> String {
    let text = path.display().to_string();
    if text.starts_with('-') { format!("./{text}") } else { text }
}

fn plural(what: &str) -> String {
    for joint in [" that ", " of ", " with ", " without ", " named ", " after "] {
        if let Some((first, rest)) = what.split_once(joint) {
            return format!("{}{joint}{rest}", plural(first));
        }
    }
    if let Some(before) = what.strip_suffix("vertex") {
        return format!("{before}vertices");
    }
    match what {
        _ if what.ends_with("sh") || what.ends_with("ch") => format!("{what}es"),
        _ => match what.strip_suffix('y').filter(|stem| !stem.ends_with(['a', 'e', 'o', 'u'])) {
            Some(stem) => format!("{stem}ies"),
            None => format!("{what}s"),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::{counted, counted_are, counted_of_were, eight, few, in_singular, quote};

    #[test]
    fn of_many_names_only_the_first_four_are_listed() {
        let names = ["a", "b", "c", "d", "e"];
        assert_eq!([few(&names[..4]), few(&names)], ["a, b, c, d", "a, b, c, d, and 1 more"]);
    }

    #[test]
    fn of_more_than_eight_names_only_the_first_eight_are_listed() {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"];
        let listed = [2, 8, 10].map(|count| eight(&names[..count]));
        assert_eq!(listed, ["a, b", "a, b, c, d, e, f, g, h", "a, b, c, d, e, f, g, h and 2 more"]);
    }

    #[test]
    fn a_quoted_argument_has_no_hidden_character_and_a_shell_reads_it_unchanged() {
        for (argument, quoted) in [
            ("results/a", "results/a"),
            ("it's mine", r"'it'\''s mine'"),
            ("i\nn's", r"$'i\nn\'s'"),
            ("a\\\u{1b}1\u{200b}\t", r"$'a\\\0331\342\200\213\011'"),
        ] {
            assert_eq!(quote(argument), quoted);
            let command = format!("printf %s {quoted}");
            let printed = std::process::Command::new("bash").args(["-c", &command]).output();
            assert_eq!(printed.expect("bash starts").stdout, argument.as_bytes());
        }
    }

    #[test]
    fn only_a_part_whose_number_is_one_is_in_the_singular() {
        let said =
            ["1 compute units", "1 threads", "2 threads", "11 cores", "POCL_AFFINITY=1"].map(in_singular);
        assert_eq!(said, ["1 compute unit", "1 thread", "2 threads", "11 cores", "POCL_AFFINITY=1"]);
        let of_caster = ["1 threads of the parallel caster", "2 threads of the parallel caster"];
        assert_eq!(of_caster.map(in_singular), ["1 thread of the parallel caster", of_caster[1]]);
    }

    #[test]
    fn the_verb_follows_the_number() {
        let said = [0, 1, 2].map(|count| counted_are(count, "face of two corners"));
        assert_eq!(
            said,
            ["0 faces of two corners are", "1 face of two corners is", "2 faces of two corners are"]
        );
    }

    #[test]
    fn the_verb_follows_the_part_and_the_noun_follows_all() {
        let said = [(1, 1), (1, 4), (2, 4)].map(|(part, all)| counted_of_were(part, all, "point"));
        assert_eq!(said, ["1 of 1 point was", "1 of 4 points was", "2 of 4 points were"]);
    }

    #[test]
    fn words_follow_their_number() {
        let expected = [
            (1, "triangle", "1 triangle"),
            (2, "mesh that no node places", "2 meshes that no node places"),
            (2, "accessor without data", "2 accessors without data"),
            (0, "light", "0 lights"),
            (1026, "triangle", "1026 triangles"),
            (12345, "vertex", "12,345 vertices"),
            (1_000_000, "face", "1,000,000 faces"),
            (3, "launch", "3 launches"),
            (2, "skinned mesh", "2 skinned meshes"),
            (2, "entry", "2 entries"),
            (2, "compute unit", "2 compute units"),
            (4, "primitive of lines or points", "4 primitives of lines or points"),
            (4, "primitive with morph targets", "4 primitives with morph targets"),
        ];
        for (count, what, text) in expected {
            assert_eq!(counted(count, what), text);
        }
    }
}
