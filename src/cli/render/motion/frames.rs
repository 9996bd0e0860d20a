//! Ranges of frames, and the numbered picture files.

use super::super::refuse_scene_file;
use crate::error::{Error, Result};
use crate::image::{Frame, frame_key, save_frame};
use crate::output::Target;
use crate::shard::Shard;
use crate::words::counted;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Frames from the first to the last, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    pub first: u32,
    pub last: u32,
}

/// Parses `3..7`, or `3` for one frame.
pub fn parse(text: &str) -> std::result::Result<Frames, String> {
    let (first, last) = match text.split_once("..") {
        // The form `3..=7`, in which Rust writes this range, is accepted too.
        Some((first, last)) => (first, last.strip_prefix('=').unwrap_or(last)),
        None => (text, text),
    };
    let number = |part: &str| part.parse::<u32>().ok().filter(|number| *number > 0);
    match (number(first), number(last)) {
        (Some(first), Some(last)) if first <= last => Ok(Frames { first, last }),
        (Some(first), Some(last)) => {
            Err(format!("the first frame, {first}, is after the last, {last}; write {last}..{first}"))
        }
        _ => Err("expected the first and last frame number, such as 1..30; numbers start at 1".to_owned()),
    }
}

impl Frames {
    /// Returns this range, or an error if the range ends after the last of `count` frames.
    pub fn within(self, count: u32) -> Result<Self> {
        if self.last <= count {
            return Ok(self);
        }
        let are = if count == 1 { "is" } else { "are" };
        let there = counted(count as usize, "frame");
        let message = format!("--frames {}..{}, but there {are} {there}", self.first, self.last);
        Err(Error::input(message).with_help(format!("expected frame numbers from 1 to {count}")))
    }

    /// Returns the frames of one shard, which are consecutive. All shards get about the same number of frames. `None`
    /// if this shard gets no frame.
    pub fn of_shard(self, shard: Shard) -> Option<Self> {
        let before = |number: u32| (u64::from(self.len()) * u64::from(number) / u64::from(shard.of)) as u32;
        let (begin, end) = (before(shard.number - 1), before(shard.number));
        (begin < end).then(|| Self { first: self.first + begin, last: self.first + end - 1 })
    }

    pub fn numbers(self) -> impl Iterator<Item = u32> {
        self.first..=self.last
    }

    pub fn len(self) -> u32 {
        self.last - self.first + 1
    }
}

/// Numbered picture files: the path `turn/dragon.png` gives the files `turn/dragon-0001.png` and so on.
#[derive(Debug)]
pub struct Numbered {
    /// The path from which the names of the numbered picture files are made.
    pattern: Target,
    digits: usize,
    force: bool,
    wanted: Frames,
}

impl Numbered {
    /// Returns the numbered files whose names follow from the path of `target`.
    pub fn new(target: &Target, force: bool, wanted: Frames, count: u32) -> Self {
        Self { pattern: target.clone(), digits: count.to_string().len().max(4), force, wanted }
    }

    /// Returns an error if the files' folder does not exist, or if one of the files is a file of the scene. The scene
    /// must be loaded before this call, since its files are not known earlier.
    pub fn check(&self) -> Result<()> {
        self.target(self.wanted.first).check_folder()?;
        self.wanted.numbers().try_for_each(|number| refuse_scene_file(&self.target(number)))
    }

    /// Returns true if a picture file may be replaced: `--force` is given, and at least one of the numbered
    /// files exists.
    pub fn may_replace(&self) -> bool {
        self.force && self.wanted.numbers().any(|number| self.file(number).exists())
    }

    fn target(&self, number: u32) -> Target {
        self.pattern.with_ending(&format!("-{number:0digits$}.png", digits = self.digits))
    }

    fn file(&self, number: u32) -> PathBuf {
        self.target(number).path().to_owned()
    }

    /// Returns the files' names, for messages.
    pub fn name(&self) -> String {
        let [first, last] = [self.wanted.first, self.wanted.last].map(|number| self.file(number));
        if first == last {
            return first.display().to_string();
        }
        format!("{} to {}", first.display(), last.display())
    }

    /// Returns the numbers of the frames that are still to be rendered. The function `key` returns the key of a frame,
    /// a hash that identifies the frame's picture. `key` is called only for a frame whose file has a valid key, that
    /// is, a file that raycl made as a frame and that nobody has changed. Without `--force`, a file with another key,
    /// or without a valid key, is an error; with `--force`, the frame of this file is rendered again. Files that need
    /// not be rendered again get the current time as their modification time ([`made_now`]).
    pub fn missing(&self, mut key: impl FnMut(u32) -> Result<String>) -> Result<Vec<u32>> {
        let mut missing = Vec::new();
        for number in self.wanted.numbers() {
            let file = self.file(number);
            let exists = file.exists();
            match frame_key(&file) {
                Some(existing) if existing == key(number)? => {
                    made_now(&file);
                    continue;
                }
                Some(_) if !self.force => return Err(other(&file, number)),
                _ => self.target(number).check()?,
            }
            // `Target::check` above permits the replacement of every file that raycl made and nobody has changed
            // since. However, raycl replaces a still picture by a frame only with `--force`, since the still picture
            // may have taken an hour to cast.
            if exists && !self.force {
                return Err(still(&file));
            }
            missing.push(number);
        }
        Ok(missing)
    }

    /// Writes the picture file of a frame, with the frame's key in it.
    pub fn save(&self, number: u32, key: &str, frame: Frame) -> Result<()> {
        save_frame(frame, key, &self.target(number))
    }
}

/// Sets the modification time of a frame's file to the current time, since the existing file need not be
/// rendered again. A rule of a makefile whose target is the file then has nothing left to do. If the system
/// refuses, for example because the file belongs to another user, the file keeps its modification time.
fn made_now(file: &Path) {
    // On Windows, a program can set a file's times only if it has opened the file for writing. On Unix, it is enough to
    // open the file for reading.
    let opened = File::options().read(true).write(cfg!(windows)).open(file);
    let _ = opened.and_then(|file| file.set_modified(SystemTime::now()));
}

fn other(file: &Path, number: u32) -> Error {
    let message = format!(
        "'{}' exists and is not frame {number} as this command would render it: the scene, the options, the strategy, the kernels or the version of raycl differs",
        file.display()
    );
    Error::input(message).with_help(
        "`--force` replaces the file, `-o FILE` writes elsewhere; if the frame was cast on another kind of device, raycl may have chosen another strategy there: name that strategy with `--strategy`, so that raycl recognises the frame",
    )
}

fn still(file: &Path) -> Error {
    let message =
        format!("'{}' exists and is not a frame: it is a single picture that raycl made", file.display());
    Error::input(message).with_help("`--force` replaces it, `-o FILE` writes elsewhere")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::image::save_rgb8;
    use crate::output::Choice;
    use image::RgbImage;

    #[test]
    fn shards_have_each_frame_once_and_about_as_many() {
        for (last, of) in [(10, 3), (7, 7), (3, 5), (100, 1)] {
            let all = Frames { first: 3, last: last + 2 };
            let shards: Vec<_> = (1..=of).filter_map(|number| all.of_shard(Shard { number, of })).collect();
            assert!(shards.iter().copied().flat_map(Frames::numbers).eq(all.numbers()), "{shards:?}");
            let most = shards.iter().map(|frames| frames.len()).max();
            assert_eq!(most, Some(last.div_ceil(of)), "{shards:?}");
        }
    }

    #[test]
    fn one_frame_has_one_name_and_several_are_named_by_their_ends() {
        let named = |first, last| {
            let pattern = Target::new("turn/a.png", Choice::new(false, "-o FILE"));
            Numbered { pattern, digits: 4, force: false, wanted: Frames { first, last } }.name()
        };
        assert_eq!(named(3, 3), "turn/a-0003.png");
        assert_eq!(named(1, 3), "turn/a-0001.png to turn/a-0003.png");
    }

    #[test]
    fn names_have_as_many_digits_as_the_last_frame_but_at_least_four() {
        let parent = tempfile::tempdir().unwrap();
        let choice = Choice::new(false, "-o FILE");
        let of = |folder: &str, count| {
            let target = Target::new(parent.path().join(folder).join("a.png"), choice);
            let numbered = Numbered::new(&target, false, Frames { first: 7, last: 7 }, count);
            numbered.check()?;
            Ok::<_, Error>(numbered.file(7).strip_prefix(parent.path()).unwrap().display().to_string())
        };
        assert_eq!([of("", 9999), of("", 10_000)].map(Result::unwrap), ["a-0007.png", "a-00007.png"]);
        assert!(of("nowhere", 9).is_err());
    }

    #[test]
    fn only_frames_with_the_same_key_stay_and_other_pictures_are_replaced_only_with_force() {
        let parent = tempfile::tempdir().unwrap();
        let frame = || Frame::Shown(RgbImage::new(3, 2));
        let [key, another] = ["5", "6"].map(|digit| digit.repeat(64));
        let of = |folder: &str, force| {
            let target = Target::new(parent.path().join(folder).join("a.png"), Choice::new(force, "-o FILE"));
            Numbered::new(&target, force, Frames { first: 1, last: 3 }, 3)
        };
        let missing = |folder: &str, force| {
            let missing = of(folder, force).missing(|_| Ok(key.clone()));
            missing.map_err(|error| error.to_string())
        };
        for folder in ["frames", "still"] {
            std::fs::create_dir(parent.path().join(folder)).unwrap();
        }
        assert_eq!(missing("frames", false), Ok(vec![1, 2, 3]));
        of("frames", false).save(2, &key, frame()).unwrap();
        let right = parent.path().join("frames/a-0002.png");
        File::options().write(true).open(&right).unwrap().set_modified(SystemTime::UNIX_EPOCH).unwrap();
        assert_eq!(missing("frames", false), Ok(vec![1, 3]));
        assert_ne!(right.metadata().unwrap().modified().unwrap(), SystemTime::UNIX_EPOCH, "for make");
        of("frames", false).save(1, &another, frame()).unwrap();
        let error = missing("frames", false).unwrap_err();
        assert!(error.contains("a-0001.png' exists and is not frame 1 as"), "{error}");
        assert_eq!(missing("frames", true), Ok(vec![1, 3]));
        let may_replace = [("frames", true), ("frames", false), ("still", true)];
        assert_eq!(may_replace.map(|(folder, force)| of(folder, force).may_replace()), [true, false, false]);
        // In this test, a still picture that raycl has saved has the name of a frame's file.
        save_rgb8(&RgbImage::new(3, 2), &of("still", false).target(2)).unwrap();
        let error = missing("still", false).unwrap_err();
        assert!(error.contains("a-0002.png' exists and is not a frame"), "{error}");
        assert_eq!(missing("still", true), Ok(vec![1, 2, 3]));
    }

    #[test]
    fn a_message_counts_one_frame_as_one() {
        let checked = |count| Frames { first: 5, last: 5 }.within(count).map_err(|error| error.to_string());
        assert_eq!(checked(1), Err("--frames 5..5, but there is 1 frame".to_owned()));
        assert_eq!(checked(4), Err("--frames 5..5, but there are 4 frames".to_owned()));
    }

    #[test]
    fn both_ends_are_included() {
        let frames = parse("3..5").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(frames.numbers().collect::<Vec<_>>(), [3, 4, 5]);
        assert_eq!((frames.len(), parse("7").map(Frames::len)), (3, Ok(1)));
        assert_eq!(parse("3..=5"), Ok(frames));
        assert!(frames.within(5).is_ok() && frames.within(4).is_err());
        for wrong in ["", "0..4", "5..3", "..", "a..b", "1..", "-1..2", "3..==5", "=3..5", "=3"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        let turned = "the first frame, 5, is after the last, 3; write 3..5";
        assert_eq!(parse("5..3"), Err(turned.to_owned()));
    }
}
