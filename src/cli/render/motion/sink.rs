//! Writes the frames of a moving picture to their output: numbered pictures, one animated picture, or a
//! stream for an encoder.

use super::super::{Args, refuse_scene_file, target};
use super::frames::{Frames, Numbered};
use crate::error::{Error, Result};
use crate::image::{Frame, Movie};
use crate::output::Target;
use crate::threads::{cores, locked};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::thread::Builder;

/// The help of the error about a file name to which moving pictures cannot be written.
const NAMES: &str =
    "`-o NAME.png` writes NAME-0001.png and so on, `-o NAME.apng` one animated picture, `-o -` a y4m stream";

/// The output for frames.
pub enum Sink {
    Numbered(Numbered),
    Movie(Movie),
}

/// A frame to be written: its number, its key (a hash that identifies the picture) and its image.
pub type Cast = (u32, String, Frame);

impl Sink {
    /// Returns an error, before the scene is loaded, if moving pictures cannot be written to the output's file name, or
    /// if `--shard` or `--rate` does not suit the kind of output.
    pub fn check(args: &Args) -> Result<()> {
        let target = target(args);
        let ending = target.path().extension().unwrap_or_default().to_ascii_lowercase();
        if args.motion.shard.is_some() && (target.is_standard_output() || ending != "png") {
            return Err(Error::input(
                "--shard needs numbered pictures, since two processes cannot write to one file or stream",
            )
            .with_help("`-o NAME.png` writes NAME-0001.png and so on, which video encoders can read"));
        }
        if target.is_standard_output() {
            return Ok(());
        }
        if ending != "apng" && ending != "png" {
            let message = format!("'{}' is not a valid name for moving pictures", target.path().display());
            return Err(Error::input(message).with_help(NAMES));
        }
        if ending == "apng" {
            return target.check();
        }
        if let Some(rate) = args.motion.rate {
            return Err(no_rate(rate, &target));
        }
        target.check_folder()
    }

    /// Returns the output for the frames `wanted`, out of `count` frames. The kind of output follows from the file's
    /// name. Fails if a file of the output is a file of the scene. The scene must be loaded before this call, since
    /// its files are not known earlier.
    pub fn of(args: &Args, wanted: Frames, count: u32, rate: u16) -> Result<Self> {
        let (target, size) = (target(args), args.subject.size());
        if target.is_standard_output() {
            return Ok(Self::Movie(Movie::y4m(target, size, rate)));
        }
        if is_apng(&target) {
            refuse_scene_file(&target)?;
            return Ok(Self::Movie(Movie::apng(target, size, rate, wanted.len())));
        }
        let numbered = Numbered::new(&target, args.force, wanted, count);
        numbered.check()?;
        Ok(Self::Numbered(numbered))
    }

    /// Returns true if writing the frames `wanted`, out of `count` frames, may replace a file.
    pub fn may_replace(args: &Args, wanted: Frames, count: u32) -> bool {
        let target = target(args);
        if target.is_standard_output() {
            return false;
        }
        if is_apng(&target) {
            return target.path().exists();
        }
        Numbered::new(&target, args.force, wanted, count).may_replace()
    }

    /// Returns the names of the files, for messages.
    pub fn name(&self) -> String {
        match self {
            Self::Numbered(numbered) => numbered.name(),
            Self::Movie(movie) => movie.name(),
        }
    }

    /// Returns an error if this output is a y4m stream, which has no alpha channel.
    pub fn check_alpha(&self) -> Result<()> {
        if !matches!(self, Self::Movie(movie) if movie.is_stream()) {
            return Ok(());
        }
        let message = "a y4m stream has no alpha channel, which a transparent background needs";
        Err(Error::input(message)
            .with_help("`-o NAME.png` writes NAME-0001.png and so on, `-o NAME.apng` one animated picture"))
    }

    /// Writes frames as they arrive from `frames`, up to the last. Returns true if the reader of a stream closed
    /// the stream before the last frame was written.
    pub fn write(self, size: [u32; 2], frames: Receiver<Cast>) -> Result<bool> {
        match self {
            Self::Numbered(numbered) => {
                let others = (1..writers(size)).map(|_| Builder::new());
                let save = |(number, key, frame): Cast| numbered.save(number, &key, frame);
                each_of(frames, others, save).map(|()| false)
            }
            Self::Movie(movie) => movie.write(frames.iter().map(|(_, _, frame)| frame)),
        }
    }
}

/// Returns true if the frames are written to one animated picture.
fn is_apng(target: &Target) -> bool {
    target.path().extension().is_some_and(|ending| ending.eq_ignore_ascii_case("apng"))
}

/// Returns the error for a `--rate` (frames per second) that is given with numbered pictures, which have no
/// rate.
fn no_rate(rate: u16, target: &Target) -> Error {
    let name = target.path().display();
    Error::input(format!("--rate {rate} has no effect: '{name}' is written as numbered pictures"))
        .with_help("leave out --rate, or write an .apng or a y4m stream (`-o -`): only these have a rate")
}

/// The largest number of pictures that are encoded at the same time; encoding more pictures at once does not let a GPU
/// cast more frames per second.
const MOST_WRITERS: usize = 8;
/// Number of cores per picture that is being encoded. Of the two cores, one runs the encoder, and the other one reads
/// and casts frames.
const CORES_OF_WRITER: usize = 2;

/// Returns how many pictures of a size are encoded at the same time. On a machine with few cores, only one picture is
/// encoded at a time, since casting needs the cores too.
fn writers(size: [u32; 2]) -> usize {
    writers_on(cores(), size)
}

fn writers_on(cores: usize, [width, height]: [u32; 2]) -> usize {
    let few_pixels = MOST_PIXELS / (u64::from(width) * u64::from(height)).max(1);
    (cores / CORES_OF_WRITER).min(few_pixels as usize).clamp(1, MOST_WRITERS)
}

/// The largest number of pixels in all pictures that are encoded at the same time, unless a single picture has more; a
/// pixel takes 3 bytes, or 16 if the background is transparent.
const MOST_PIXELS: u64 = 1 << 26;

/// A guard that each writing thread owns. If the thread panics, its guard is dropped, and tells the other threads to
/// stop.
struct StopsOthers<'a>(&'a AtomicBool);

impl Drop for StopsOthers<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

/// Calls `work` for every received item, until a call fails. If calls failed, returns the error of one of the failed
/// calls. The calls are made on this thread and on the threads that `others` start. If the system refuses to start one
/// of these threads, fewer calls run at the same time.
fn each_of<T: Send>(
    received: Receiver<T>,
    others: impl Iterator<Item = Builder>,
    work: impl Fn(T) -> Result<()> + Sync,
) -> Result<()> {
    let (received, failed) = (Mutex::new(received), AtomicBool::new(false));
    let next = || locked(&received).recv().ok();
    let on_thread = || -> Result<()> {
        let _stops = StopsOthers(&failed);
        while let Some(next) = next() {
            if failed.load(Ordering::Relaxed) {
                break;
            }
            work(next).inspect_err(|_| failed.store(true, Ordering::Relaxed))?;
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let others: Vec<_> = others.filter_map(|other| other.spawn_scoped(scope, on_thread).ok()).collect();
        let own = on_thread();
        let ended = others.into_iter().try_for_each(|thread| {
            thread.join().map_err(|_| Error::fault("writing the frames panicked")).and_then(|result| result)
        });
        own.and(ended)
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use clap::Parser;
    use image::RgbImage;
    use std::sync::mpsc::sync_channel;

    #[test]
    fn writers_take_every_frame_once_and_stop_at_an_error() {
        let written = Mutex::new(Vec::new());
        let write = |wrong: usize, frames: usize| {
            written.lock().unwrap().clear();
            let (sender, receiver) = sync_channel(1);
            std::thread::scope(|scope| {
                let writers = scope.spawn(|| {
                    each_of(receiver, (0..2).map(|_| Builder::new()), |number: usize| {
                        if number == wrong {
                            return Err(Error::run("full"));
                        }
                        written.lock().unwrap().push(number);
                        Ok(())
                    })
                });
                let sent = (0..frames).take_while(|number| sender.send(*number).is_ok()).count();
                drop(sender);
                (sent, writers.join().unwrap().is_ok())
            })
        };
        assert_eq!(write(usize::MAX, 1000), (1000, true));
        let mut all = written.lock().unwrap().clone();
        all.sort_unstable();
        assert_eq!(all, (0..1000).collect::<Vec<_>>());
        // Writing frame 10 fails. On a busy machine, the other threads may write many frames before the thread of frame
        // 10 tells them to stop.
        let (sent, ok) = write(10, 10_000_000);
        assert!(!ok && sent < 10_000_000, "{sent} frames were sent");
    }

    #[test]
    fn frames_are_written_even_if_the_system_refuses_further_threads() {
        // No address space can hold such a large stack, so the threads cannot start.
        let refused = (0..3).map(|_| Builder::new().stack_size(1 << (usize::BITS - 1)));
        let (sender, receiver) = sync_channel(10);
        (0..10_usize).for_each(|number| sender.send(number).unwrap());
        drop(sender);
        let written = Mutex::new(Vec::new());
        let write = |number: usize| {
            written.lock().unwrap().push(number);
            Ok(())
        };
        assert!(each_of(receiver, refused, write).is_ok());
        assert_eq!(written.into_inner().unwrap(), (0..10).collect::<Vec<_>>());
    }

    #[derive(clap::Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn the_name_says_what_frames_are_written_as_and_what_cannot_be_a_stream() {
        let folder = tempfile::tempdir().unwrap();
        let args = |name: &str, more: &[&str]| {
            let name =
                if name == "-" { name.to_owned() } else { folder.path().join(name).display().to_string() };
            let words = ["render", "a.toml", "--turntable", "4", "-o", &name];
            Command::parse_from([&words[..], more].concat()).args
        };
        let of = |name: &str| Sink::of(&args(name, &[]), Frames { first: 1, last: 2 }, 4, 30).unwrap();
        assert!(matches!(of("a.png"), Sink::Numbered(_)));
        assert!(of("a.png").name().ends_with("a-0002.png"), "{}", of("a.png").name());
        let is_stream = |sink: &Sink| matches!(sink, Sink::Movie(movie) if movie.is_stream());
        assert!(is_stream(&of("-")) && of("-").check_alpha().is_err());
        for name in ["a.png", "a.apng", "a.APNG"] {
            assert!(!is_stream(&of(name)) && of(name).check_alpha().is_ok(), "{name}");
        }
        let refused = |name: &str, more: &[&str]| Sink::check(&args(name, more)).is_err();
        for name in ["a.png", "a.PNG", "a.apng", "-"] {
            assert!(!refused(name, &[]), "{name}");
        }
        assert!(refused("a.jpg", &[]) && refused("nowhere/a.png", &[]));
        assert!(refused("a.png", &["--rate", "12"]) && !refused("a.apng", &["--rate", "12"]));
        let shard = ["--shard", "1/2"];
        assert!(refused("a.apng", &shard) && refused("-", &shard) && !refused("a.png", &shard));
    }

    #[test]
    fn few_large_pictures_are_encoded_at_the_same_time() {
        let sizes = [[1280, 800], [8192, 4096], [8192, 8192], [65536, 65536]];
        assert_eq!(sizes.map(|size| writers_on(64, size)), [8, 2, 1, 1]);
        assert_eq!([1, 8, 64].map(|cores| writers_on(cores, [1280, 800])), [1, 4, 8]);
    }

    #[test]
    fn an_animated_picture_has_the_frames_that_are_wanted_and_not_all_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.apng");
        let (name, size) = (path.display().to_string(), ["--width", "2", "--height", "1"]);
        let words = ["render", "a.toml", "--turntable", "4", "-o", &name];
        let args = Command::parse_from([&words[..], &size].concat()).args;
        let sink = Sink::of(&args, Frames { first: 2, last: 3 }, 4, 30).unwrap();
        let (sender, receiver) = sync_channel(2);
        for number in [2, 3] {
            sender.send((number, String::new(), Frame::Shown(RgbImage::new(2, 1)))).unwrap();
        }
        drop(sender);
        sink.write([2, 1], receiver).unwrap();
        let file = std::fs::read(&path).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 2);
    }
}
