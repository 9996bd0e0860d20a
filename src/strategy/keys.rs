//! The keys of headers: what the host must know of a value of each axis whose values are files.

use std::fmt;
use std::ops::RangeInclusive;

/// What a header says of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Said {
    /// One of the key's words.
    Word(&'static str),
    /// A number.
    Number(u32),
}

/// What a key takes.
pub(super) enum Takes {
    /// One of these.
    Words(&'static [&'static str]),
    /// A number from the first to the last, a multiple of the second field.
    Numbers(RangeInclusive<u32>, u32),
}

/// A key of the headers of an axis.
pub(super) struct Key {
    pub axis: &'static str,
    pub name: &'static str,
    /// What it says.
    pub about: &'static str,
    pub takes: Takes,
    pub optional: bool,
}

const fn key(axis: &'static str, name: &'static str, about: &'static str, takes: Takes) -> Key {
    Key { axis, name, about, takes, optional: false }
}

/// Every key but `meaning` and `contradicts`, which all axes have.
pub(super) static KEYS: [Key; 10] = [
    key(
        "vectors",
        "memory",
        "where the host has room for them",
        Takes::Words(&["private", "local", "scratch", "heap"]),
    ),
    key("vectors", "bytes_per_ray", "bytes of a ray's working vectors", Takes::Numbers(4..=4096, 4)),
    key(
        "triangles",
        "read_from",
        "the memory that the host puts them in",
        Takes::Words(&["global", "constant"]),
    ),
    key(
        "triangles",
        "copied",
        "what a work-group copies to __local memory",
        Takes::Words(&["nothing", "scene", "vertices", "normals", "rows"]),
    ),
    key(
        "layout",
        "index_bits",
        "bits of the OBJ's indices; none for the soup",
        Takes::Words(&["none", "16", "32"]),
    ),
    key("shading", "shades", "which hits it shades", Takes::Words(&["each-nearer-hit", "nearest-hit"])),
    key(
        "intersector",
        "record_floats",
        "floats of a triangle that is prepared for the test",
        Takes::Numbers(1..=64, 1),
    ),
    key(
        "intersector",
        "prepared_for",
        "the rays that a triangle is prepared for",
        Takes::Words(&["any-ray", "origin", "pixels", "tile"]),
    ),
    key("intersector", "exact_signs", "whether the test needs exact signs", Takes::Words(&["yes", "no"])),
    Key {
        optional: true,
        ..key(
            "intersector",
            "operations",
            "operations of a test up to the first proof of a miss",
            Takes::Numbers(1..=10_000, 1),
        )
    },
];

impl Takes {
    /// The words, if it takes words.
    pub fn words(&self) -> &'static [&'static str] {
        match self {
            Self::Words(words) => words,
            Self::Numbers(..) => &[],
        }
    }

    /// What a text says, if it is one of what is taken.
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
