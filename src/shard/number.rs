//! The part of an experiment or of a moving picture that a process computes, as set by `--shard`: `3/16`, `auto` or
//! `auto/16`.

use super::launcher;
use crate::error::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// One of several parts of an experiment or of a moving picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// The shard's number, from 1.
    pub number: u32,
    /// The number of shards.
    pub of: u32,
}

/// The largest number of shards. Users hardly need more than `MOST` shards, so a larger number is probably a
/// typing mistake.
const MOST: u32 = 100_000;

impl Shard {
    /// Returns the shard with this number, from 1.
    pub fn new(number: u32, of: u32) -> Result<Self> {
        match (1..=MOST).contains(&of) && (1..=of).contains(&number) {
            true => Ok(Self { number, of }),
            false => Err(Error::input(format!("there is no shard {number} of {of}")).with_help(format!(
                "the number of shards may be 1 to {MOST}; a shard's number may be 1 to the number of shards"
            ))),
        }
    }
}

impl fmt::Display for Shard {
    /// Formats shard 3 of 16 as "3/16".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

/// The value of the option `--shard`: which shard this process computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// A shard by its number.
    Given(Shard),
    /// The launcher (the program that started this process, such as Slurm or `mpirun`) sets the shard's number. The
    /// launcher also sets the number of shards, unless the user gives this number.
    Auto(Option<u32>),
}

impl Asked {
    /// Returns the shard of this process: the given shard or, for `Auto`, the shard that the launcher's
    /// environment variables state. `variable` returns the value of an environment variable.
    pub fn resolve(self, variable: &dyn Fn(&str) -> Option<String>) -> Result<Shard> {
        match self {
            Self::Given(shard) => Ok(shard),
            Self::Auto(of) => launcher::shard(of, variable),
        }
    }

    /// Returns true if a launcher assigns the shard's number.
    pub fn is_auto(self) -> bool {
        matches!(self, Self::Auto(_))
    }
}

impl FromStr for Asked {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || {
            format!(
                "'{text}' is not a shard; expected a shard's number and the number of shards, such as 3/16, or auto, or auto/16"
            )
        };
        let (number, of) = match text.split_once('/') {
            Some((number, of)) => (number, Some(of.parse().map_err(|_| wrong())?)),
            None => (text, None),
        };
        match (number, of) {
            ("auto", Some(0)) => Err(wrong()),
            ("auto", of) => Ok(Self::Auto(of)),
            (number, Some(of)) => {
                let number = number.parse().map_err(|_| wrong())?;
                // Clap (the library that parses the arguments) prints only the message, so the message contains the
                // remedy.
                let with_remedy = |error: Error| format!("{error}; {}", error.remedy());
                Shard::new(number, of).map(Self::Given).map_err(with_remedy)
            }
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_numbered_from_one_to_their_count() {
        assert_eq!("3/16".parse(), Ok(Asked::Given(Shard { number: 3, of: 16 })));
        assert_eq!(("auto".parse(), "auto/16".parse()), (Ok(Asked::Auto(None)), Ok(Asked::Auto(Some(16)))));
        let autos = ["3/16", "auto", "auto/16"].map(|text| text.parse().is_ok_and(Asked::is_auto));
        assert_eq!(autos, [false, true, true]);
        for wrong in ["", "3", "0/4", "5/4", "-1/4", "1/0", "auto/0", "auto/x", "x/4", "1/4/4", "1/99999999"]
        {
            assert!(wrong.parse::<Asked>().is_err(), "{wrong}");
        }
        let expected = "there is no shard 5 of 4; the number of shards may be 1 to 100000; a shard's number may be 1 to \
                        the number of shards";
        assert_eq!("5/4".parse::<Asked>(), Err(expected.to_owned()));
    }
}
