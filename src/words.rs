//! Formats numbers in sentences, and arguments of commands.

/// Formats a count and its noun: "1 material", "2 entries", "12,345 vertices". The word before "of", "that", "with",
/// "without", "named" or "after" becomes plural ("3 primitives of lines"). If there is no such word, the last word
/// becomes plural ("2 compute units").
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

/// Formats a part of a count with the noun and the verb: "1 of 4 points was", "2 of 4 points were", "1 of 1 point was".
pub fn counted_of_were(part: usize, all: usize, what: &str) -> String {
    format!("{} {}", counted_of(part, all, what), if part == 1 { "was" } else { "were" })
}

/// Groups digits by thousands from 10,000 on.
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

/// Quotes an argument, unless it has only characters that every shell reads unchanged.
pub fn quote(argument: &str) -> String {
    let harmless = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !argument.is_empty() && argument.chars().all(harmless) {
        return argument.to_owned();
    }
    format!("'{}'", argument.replace('\'', r"'\''"))
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
        _ => match what.strip_suffix("ry") {
            Some(stem) => format!("{stem}ries"),
            None => format!("{what}s"),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::{counted, counted_are, counted_of_were};

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
        for (count, what, told) in expected {
            assert_eq!(counted(count, what), told);
        }
    }
}
