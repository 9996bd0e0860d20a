//! The keys in the headers of kernel files, by axis. If a value of an axis is a file, the file's header
//! states the properties that the host needs.

use std::fmt;
use std::ops::RangeInclusive;

/// The value that a header states for a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Said {
    /// One of the key's allowed words.
    Word(&'static str),
    /// A number in the key's allowed range.
    Number(u32),
}

/// The allowed values of a key.
pub(super) enum Takes {
    /// The key's value must be one of the words in the list.
    Words(&'static [&'static str]),
    /// The value must be a number that lies in the range in the first field and is a multiple of the second
    /// field.
    Numbers(RangeInclusive<u32>, u32),
}

/// A key that the headers of one axis can have.
pub(super) struct Key {
    pub axis: &'static str,
    pub name: &'static str,
    /// What this key of a header states about a value of `axis`.
    pub about: &'static str,
    pub takes: Takes,
    pub optional: bool,
}

const fn key(axis: &'static str, name: &'static str, about: &'static str, takes: Takes) -> Key {
    Key { axis, name, about, takes, optional: false }
}

/// Every key of a header, except `meaning` and `contradicts`: these two keys belong to all axes.
pub(super) static KEYS: [Key; 10] = [
    key(
        "vectors",
        "memory",
        "the memory in which working vectors lie",
        Takes::Words(&["private", "local", "scratch", "heap"]),
    ),
    key("vectors", "bytes_per_ray", "bytes of a ray's working vectors", Takes::Numbers(4..=4096, 4)),
    key(
        "triangles",
        "read_from",
        "the memory into which the host writes triangles",
        Takes::Words(&["global", "constant"]),
    ),
    key(
        "triangles",
        "copied",
        "the data that a work-group copies to __local memory",
        Takes::Words(&["nothing", "scene", "vertices", "normals", "rows"]),
    ),
    key(
        "layout",
        "index_bits",
        "bits of an index into the lists of positions, normals and materials; `none` for a triangle soup",
        Takes::Words(&["none", "16", "32"]),
    ),
    key("shading", "shades", "the hits that are shaded", Takes::Words(&["each-nearer-hit", "nearest-hit"])),
    key(
        "intersector",
        "record_floats",
        "number of floats that the test reads of each triangle",
        Takes::Numbers(1..=64, 1),
    ),
    key(
        "intersector",
        "prepared_for",
        "the rays that a triangle is prepared for",
        Takes::Words(&["any-ray", "origin", "pixels", "tile"]),
    ),
    key(
        "intersector",
        "exact_signs",
        "whether the test needs the exact signs of its numbers, which `math = fast` may change",
        Takes::Words(&["yes", "no"]),
    ),
    Key {
        optional: true,
        ..key(
            "intersector",
            "operations",
            "number of arithmetic operations in a test up to the point where most misses are found",
            Takes::Numbers(1..=10_000, 1),
        )
    },
];

impl Takes {
    /// Returns the words that are allowed as the key's value; empty if the value must be a number.
    pub fn words(&self) -> &'static [&'static str] {
        match self {
            Self::Words(words) => words,
            Self::Numbers(..) => &[],
        }
    }

    /// Parses a key's value; returns `None` if the value is not allowed.
    pub fn parse(&self, text: &str) -> Option<Said> {
        match self {
            Self::Words(words) => words.iter().find(|word| **word == text).map(|word| Said::Word(word)),
            Self::Numbers(range, step) => {
                let number = text.parse().ok()?;
                (range.contains(&number) && number % step == 0).then_some(Said::Number(number))
            }
        }
    }
}

impl fmt::Display for Takes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Words(words) => f.write_str(&words.join(" or ")),
            Self::Numbers(range, 1) => write!(f, "{} to {}", range.start(), range.end()),
            Self::Numbers(range, step) => {
                write!(f, "a multiple of {step} from {} to {}", range.start(), range.end())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::FOLDERS;
    use std::collections::BTreeSet;

    const DOCUMENT: &str = include_str!("../../docs/own-kernels.md");

    /// Returns the cells of each row of the table in docs/own-kernels.md that has these column headings.
    fn table(heads: &str) -> Vec<Vec<&'static str>> {
        let lines = DOCUMENT.lines().skip_while(|line| *line != heads).skip(2);
        let rows = lines.take_while(|line| line.starts_with('|'));
        let rows: Vec<_> =
            rows.map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect();
        assert!(!rows.is_empty(), "no table {heads}");
        rows
    }

    fn in_quotes(cell: &str) -> Vec<&str> {
        cell.split('`').skip(1).step_by(2).collect()
    }

    #[test]
    fn numbers_are_taken_within_their_range_and_in_their_steps() {
        let takes = Takes::Numbers(4..=16, 4);
        let taken = ["3", "4", "6", "16", "20", "-4", "four"].map(|text| takes.parse(text).is_some());
        assert_eq!(taken, [false, true, false, true, false, false, false]);
        assert_eq!(takes.parse("8"), Some(Said::Number(8)));
    }

    #[test]
    fn the_document_names_every_key_and_no_other() {
        let rows = table("| key | axis | required | meaning |");
        let known = |key: &Key| (key.name, key.axis, !key.optional);
        let all: BTreeSet<_> =
            KEYS.iter().map(known).chain([("meaning", "all", true), ("contradicts", "all", false)]).collect();
        let documented: BTreeSet<_> = rows
            .iter()
            .map(|row| (row[0].trim_matches('`'), row[1].trim_matches('`'), row[2] == "yes"))
            .collect();
        assert_eq!(documented, all);
        assert_eq!(rows.len(), all.len(), "a key has two rows");
    }

    #[test]
    fn the_document_says_what_every_key_takes() {
        for row in table("| key | axis | required | meaning |") {
            let Some(key) = KEYS.iter().find(|key| key.name == row[0].trim_matches('`')) else { continue };
            let says = in_quotes(row[3]);
            for word in key.takes.words() {
                assert!(says.contains(word), "{}: {word} is not mentioned", key.name);
            }
            if let Takes::Numbers(..) = key.takes {
                assert!(row[3].contains(&key.takes.to_string()), "{}: not told: {}", key.name, key.takes);
            }
        }
    }

    #[test]
    fn the_document_names_every_folder_of_values_and_no_other() {
        let rows = table("| folder | axis | families that can use a new file |");
        let documented: BTreeSet<_> = rows.iter().flat_map(|row| in_quotes(row[0])).collect();
        assert_eq!(documented, FOLDERS.iter().map(|(folder, _)| *folder).collect());
        for (folder, axis) in FOLDERS {
            let row = rows.iter().find(|row| in_quotes(row[0]).contains(&folder));
            let axes = row.map(|row| in_quotes(row[1])).unwrap_or_default();
            assert_eq!(axes, [axis], "{folder}");
        }
    }
}
