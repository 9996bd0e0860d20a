//! Where frames go: numbered pictures, one animated picture, or a stream for an encoder.

use super::super::{Args, target};
use super::frames::{Frames, Numbered};
use crate::error::{Error, Result};
use crate::image::{Movie, Radiance};
use crate::scene::Display;
use std::sync::mpsc::Receiver;

/// The names of moving pictures.
const NAMES: &str =
    "NAME.png writes NAME-0001.png and so on, NAME.apng one animated picture, `-o -` a y4m stream";

/// The output for frames.
pub enum Sink {
    Numbered(Numbered),
    Movie(Movie),
}

/// A frame to be written: its number, key and image.
pub type Cast = (u32, String, Radiance);

impl Sink {
    /// Refuses a name that moving pictures cannot have, before the scene is loaded.
    pub fn check(args: &Args) -> Result<()> {
        let target = target(args);
        let ending = target.path().extension().unwrap_or_default().to_ascii_lowercase();
        if args.motion.shard.is_some() && (target.is_standard_output() || ending != "png") {
            return Err(Error::input(
                "--shard needs numbered pictures, since two processes cannot write to one file",
            )
            .with_help("name them NAME.png, which writes NAME-0001.png and so on; encoders read these"));
        }
        if target.is_standard_output() {
            return Ok(());
        }
        if ending != "apng" && ending != "png" {
            let message = format!("'{}' is not a valid name for moving pictures", target.path().display());
            return Err(Error::input(message).with_help(NAMES));
        }
        if ending == "apng" { target.check() } else { target.check_folder() }
    }

    /// Makes the output that the file's name asks for, for some of `count` frames.
    pub fn of(args: &Args, wanted: Frames, count: u32, rate: u16) -> Result<Self> {
        let (target, size) = (target(args), args.subject.size());
        if target.is_standard_output() {
            return Ok(Self::Movie(Movie::y4m(target, size, rate)));
        }
        if target.path().extension().is_some_and(|ending| ending.eq_ignore_ascii_case("apng")) {
            return Ok(Self::Movie(Movie::apng(target, size, rate, wanted.len())));
        }
        Ok(Self::Numbered(Numbered::new(&target, args.force, wanted, count)?))
    }

    /// Returns the names of the files, for messages.
    pub fn name(&self) -> String {
        match self {
            Self::Numbered(numbered) => numbered.name(),
            Self::Movie(movie) => movie.name(),
        }
    }

    /// Refuses a stream, which has no alpha channel.
    pub fn check_alpha(&self) -> Result<()> {
        if !matches!(self, Self::Movie(movie) if movie.is_stream()) {
            return Ok(());
        }
        let message = "a y4m stream has no alpha channel, which a transparent background needs";
        Err(Error::input(message)
            .with_help("NAME.png writes NAME-0001.png and so on, NAME.apng one animated picture"))
    }

    /// Writes frames as they come, until the last.
    pub fn write(self, frames: &Receiver<(Cast, Display)>) -> Result<()> {
        match self {
            Self::Numbered(numbered) => frames
                .iter()
                .try_for_each(|((number, key, image), display)| numbered.save(number, &key, &image, display)),
            Self::Movie(movie) => movie.write(frames.iter().map(|((_, _, image), display)| (image, display))),
        }
    }
}
