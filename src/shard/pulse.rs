//! A counter in an attempt's folder that increases while the attempt's process is alive. With this counter, other
//! processes can distinguish a running attempt from one that was killed, without comparing the clocks of two machines.

use crate::error::{Error, Result};
use crate::experiment::Observer;
use crate::record::Record;
use std::fs::File;
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// The name of the file that contains the counter.
const FILE: &str = "pulse";
/// The time after which an attempt's process increases its counter again.
const BEAT: Duration = Duration::from_secs(1);
/// The time between two checks whether the attempt has ended.
const LOOK_UP: Duration = Duration::from_millis(50);

/// The contents of the counter's file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Beat {
    /// How often the attempt's process has increased its counter so far. The process increases the counter
    /// once per second.
    pub beats: u64,
    /// How often the counter has increased since the attempt's last step. The number also starts again at 0
    /// when the attempt has waited for another process (a process that uses the device, or that measures the
    /// device's peak rates for the attempt).
    pub quiet: u64,
    /// The number of steps so far: builds, checks, casts and some waits that have begun, and launches (of worker
    /// processes) and points that have finished.
    pub steps: u64,
}

impl Beat {
    /// Reads the counter in an attempt's folder; `None` if there is no counter or the counter cannot be read.
    pub fn read(folder: &Path) -> Option<Self> {
        let text = std::fs::read_to_string(folder.join(FILE)).ok()?;
        let mut numbers = text.split_whitespace().map(|word| word.parse().ok());
        Some(Self { beats: numbers.next()??, quiet: numbers.next()??, steps: numbers.next()?? })
    }

    /// Returns the contents of the counter's file after the counter's next increase. `waits` is true if the
    /// attempt has waited for another process since the counter last increased.
    fn after(self, steps: u64, waits: bool) -> Self {
        let quiet = if steps == self.steps && !waits { self.quiet + 1 } else { 0 };
        Self { beats: self.beats + 1, quiet, steps }
    }

    /// Returns the only line of the counter's file. The line's length is constant, so that a simultaneous reader sees
    /// either the old line or the new one.
    fn line(self) -> String {
        format!("{:>12} {:>12} {:>12}\n", self.beats, self.quiet, self.steps)
    }
}

/// An observer that counts steps, notes when the attempt waits for another process, and passes every call on to another
/// observer.
pub struct Steps<'a> {
    steps: Arc<AtomicU64>,
    waits: Arc<AtomicBool>,
    listener: &'a mut dyn Observer,
}

/// A thread that counts until this value is dropped.
pub struct Pulse {
    steps: Arc<AtomicU64>,
    /// True if the attempt has waited for another process since the attempt's counter last increased.
    waits: Arc<AtomicBool>,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Pulse {
    /// Starts counting in an attempt's folder.
    pub fn start(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let mut file = File::create(&path).map_err(|error| Error::unwritable(&path, &error))?;
        let (steps, waits, ended): (Arc<AtomicU64>, Arc<AtomicBool>, Arc<AtomicBool>) = Default::default();
        let thread = {
            let (steps, waits, ended) = (Arc::clone(&steps), Arc::clone(&waits), Arc::clone(&ended));
            let count = move || {
                // If a count cannot be written, the error is ignored: the next count is written a second
                // later.
                let mut write = |beat: Beat| {
                    let _ =
                        file.seek(SeekFrom::Start(0)).and_then(|_| file.write_all(beat.line().as_bytes()));
                };
                let mut beat = Beat::default();
                write(beat);
                while !sleeps_through_beat(&ended) {
                    beat = beat.after(steps.load(Ordering::Relaxed), taken(&waits));
                    write(beat);
                }
                // The steps since the last count are written now, so that the status of the ended attempt
                // includes these steps.
                write(Beat { steps: steps.load(Ordering::Relaxed), ..beat });
            };
            Builder::new().spawn(count).map_err(|error| Error::no_thread(&error))?
        };
        Ok(Self { steps, waits, ended, thread: Some(thread) })
    }

    /// Returns an observer that passes every call on to `listener`. Each call that shows progress counts as a step.
    pub fn listening<'a>(&self, listener: &'a mut dyn Observer) -> Steps<'a> {
        Steps { steps: Arc::clone(&self.steps), waits: Arc::clone(&self.waits), listener }
    }
}

/// Returns true if the attempt has waited for another process since the last call of this function. The next
/// call of this function returns false, unless the attempt waits again before the call.
fn taken(waits: &AtomicBool) -> bool {
    waits.swap(false, Ordering::Relaxed)
}

/// Sleeps for the time [`BEAT`], or until the attempt ends. Returns true if the attempt has ended.
fn sleeps_through_beat(ended: &AtomicBool) -> bool {
    let mut left = BEAT;
    while !left.is_zero() && !ended.load(Ordering::Relaxed) {
        let nap = left.min(LOOK_UP);
        std::thread::sleep(nap);
        left -= nap;
    }
    // Together with `Release` in `drop`, `Acquire` ensures that this thread sees all steps that were counted before the
    // attempt ended.
    ended.load(Ordering::Acquire)
}

impl Drop for Pulse {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl Steps<'_> {
    fn step(&self) {
        self.steps.fetch_add(1, Ordering::Relaxed);
    }
}

impl Observer for Steps<'_> {
    fn enters(&mut self, stage: &str) {
        self.listener.enters(stage);
    }

    fn begins(&mut self, points: usize, steps: usize) {
        self.listener.begins(points, steps);
    }

    fn resumes(&mut self, points: usize, steps: usize) {
        self.listener.resumes(points, steps);
    }

    fn advances(&mut self, steps: usize) {
        self.step();
        self.listener.advances(steps);
    }

    fn works_on(&mut self, what: &str) {
        self.step();
        self.listener.works_on(what);
    }

    fn says(&mut self, line: &str) {
        self.listener.says(line);
    }

    fn waits(&mut self) {
        self.waits.store(true, Ordering::Relaxed);
        self.listener.waits();
    }

    fn finished(&mut self, record: &Record) {
        self.step();
        self.listener.finished(record);
    }

    fn ends(&mut self) {
        self.listener.ends();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beat_counts_how_long_nothing_was_done() {
        let next = |beat: Beat, steps| beat.after(steps, false);
        let first = next(Beat::default(), 3);
        assert_eq!(first, Beat { beats: 1, quiet: 0, steps: 3 });
        let second = next(first, 3);
        assert_eq!(next(second, 3), Beat { beats: 3, quiet: 2, steps: 3 });
        assert_eq!(next(second, 4).quiet, 0);
        // An attempt that waits for a device is not hung.
        assert_eq!(second.after(3, true), Beat { beats: 3, quiet: 0, steps: 3 });
    }

    #[test]
    fn after_a_wait_quiet_counts_grow_again() {
        let waits = AtomicBool::new(true);
        let first = Beat::default().after(0, taken(&waits));
        let second = first.after(0, taken(&waits));
        assert_eq!([first.quiet, second.quiet], [0, 1]);
    }

    #[test]
    fn the_file_is_there_at_once_and_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Beat::read(folder.path()), None);
        let pulse = Pulse::start(folder.path()).unwrap();
        let mut nobody = ();
        pulse.listening(&mut nobody).works_on("x");
        let start = std::time::Instant::now();
        while Beat::read(folder.path()).is_none_or(|beat| beat.steps == 0) {
            assert!(start.elapsed() < Duration::from_secs(120), "no beat");
            std::thread::sleep(LOOK_UP);
        }
        drop(pulse);
    }

    #[test]
    fn an_ended_attempt_has_all_its_steps() {
        let folder = tempfile::tempdir().unwrap();
        let pulse = Pulse::start(folder.path()).unwrap();
        let mut nobody = ();
        let mut steps = pulse.listening(&mut nobody);
        (0..3).for_each(|_| steps.works_on("x"));
        drop(pulse);
        assert_eq!(Beat::read(folder.path()).map(|beat| beat.steps), Some(3));
    }

    /// Stores the name and the arguments of every call.
    #[derive(Default)]
    struct Events(Vec<String>);

    impl Observer for Events {
        fn enters(&mut self, stage: &str) {
            self.0.push(format!("enters {stage}"));
        }
        fn begins(&mut self, points: usize, steps: usize) {
            self.0.push(format!("begins {points} {steps}"));
        }
        fn resumes(&mut self, points: usize, steps: usize) {
            self.0.push(format!("resumes {points} {steps}"));
        }
        fn advances(&mut self, steps: usize) {
            self.0.push(format!("advances {steps}"));
        }
        fn works_on(&mut self, what: &str) {
            self.0.push(format!("works on {what}"));
        }
        fn says(&mut self, line: &str) {
            self.0.push(format!("says {line}"));
        }
        fn waits(&mut self) {
            self.0.push("waits".to_owned());
        }
        fn finished(&mut self, record: &Record) {
            self.0.push(format!("finished {}", record.name));
        }
        fn ends(&mut self) {
            self.0.push("ends".to_owned());
        }
    }

    #[test]
    fn every_call_is_passed_on_and_those_that_show_progress_are_steps() {
        let folder = tempfile::tempdir().unwrap();
        let pulse = Pulse::start(folder.path()).unwrap();
        let mut events = Events::default();
        let mut steps = pulse.listening(&mut events);
        let mut taken = Vec::new();
        let calls: [&dyn Fn(&mut Steps<'_>); 9] = [
            &|steps| steps.enters("a"),
            &|steps| steps.begins(4, 8),
            &|steps| steps.resumes(1, 2),
            &|steps| steps.advances(3),
            &|steps| steps.works_on("b"),
            &|steps| steps.says("c"),
            &|steps| steps.waits(),
            &|steps| steps.finished(&Record { name: "d".into(), ..Record::default() }),
            &|steps| steps.ends(),
        ];
        for call in calls {
            call(&mut steps);
            taken.push(pulse.steps.load(Ordering::Relaxed));
        }
        assert_eq!(taken, [0, 0, 0, 1, 2, 2, 2, 3, 3]);
        let expected = [
            "enters a",
            "begins 4 8",
            "resumes 1 2",
            "advances 3",
            "works on b",
            "says c",
            "waits",
            "finished d",
            "ends",
        ];
        assert_eq!(events.0, expected);
    }

    #[test]
    fn a_beat_is_read_as_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let beat = Beat { beats: 12, quiet: 3, steps: 45 };
        std::fs::write(folder.path().join(FILE), beat.line()).unwrap();
        assert_eq!(Beat::read(folder.path()), Some(beat));
        assert_eq!(beat.line().len(), Beat::default().line().len());
        std::fs::write(folder.path().join(FILE), "12 3\n").unwrap();
        assert_eq!(Beat::read(folder.path()), None);
    }
}
