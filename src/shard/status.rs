//! The state of each attempt in a folder: `Begun`, `Going`, `Hung`, `Lost` or `Ended`. Each attempt increases a counter
//! in its own folder while it runs. This module reads all counters twice, to find out which counters increase.

use super::{Attempt, Beat, End};
use crate::error::Result;
use std::fmt;
use std::path::Path;
use std::time::Duration;

/// The state of an attempt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// The attempt (a process that measures a shard) has made its folder, but has not written the counter
    /// that shows that the attempt is alive.
    Begun,
    /// The attempt's counter (its sign of life) increases, and the attempt is not hung. Within the time limit of a
    /// step, the attempt has made progress, or has waited for another process (a process that uses the device, or that
    /// measures the device's peak rates for the attempt).
    Going,
    /// The attempt's counter increases, but for longer than the time limit of a step, the attempt has neither made
    /// progress nor waited for another process. `Hung` contains the length of this time in seconds.
    Hung(u64),
    /// The attempt's counter does not increase, and the attempt did not report its end. Probably, the attempt was
    /// killed, or its machine failed. (A network file system that shows old data can also be the reason.)
    Lost,
    /// The attempt reported how it ended.
    Ended(End),
}

/// An attempt and its state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Status {
    /// The attempt's name, which consists of the shard, the machine, the job and the restart.
    pub name: String,
    /// The attempt's state.
    pub state: State,
    /// The contents of the attempt's counter by the second of two readings or, if the second reading found no counter,
    /// by the first. All three numbers in the counter are 0 if the attempt has not written a counter yet.
    pub beat: Beat,
}

/// Returns the state of all attempts in a folder, from two readings. The time `between` should be several
/// seconds, since a network file system may show old data.
pub fn status(out: &Path, between: Duration) -> Result<Vec<Status>> {
    read_twice(out, || std::thread::sleep(between))
}

/// Reads all attempts twice. Calls `wait` between the first and the second reading of the attempts, unless
/// all attempts have ended.
fn read_twice(out: &Path, wait: impl FnOnce()) -> Result<Vec<Status>> {
    let attempts = Attempt::all(out)?;
    let read = |attempt: &Attempt| Beat::read(&attempt.folder);
    let first: Vec<Option<Beat>> = attempts.iter().map(read).collect();
    let ends = attempts.iter().map(Attempt::end).collect::<Result<Vec<_>>>()?;
    if ends.iter().any(Option::is_none) {
        wait();
    }
    let of = |(attempt, first): (&Attempt, Option<Beat>)| -> Result<Status> {
        let second = read(attempt).or(first);
        let limit = attempt.about()?.map_or(f64::MAX, |about| about.hang_limit_s);
        Ok(Status {
            name: attempt.name.clone(),
            state: state(attempt.end()?, [first, second], limit),
            beat: second.unwrap_or_default(),
        })
    };
    attempts.iter().zip(first).map(of).collect()
}

fn state(end: Option<End>, [first, second]: [Option<Beat>; 2], hang_limit_s: f64) -> State {
    match (end, first, second) {
        (Some(end), ..) => State::Ended(end),
        (None, _, None) => State::Begun,
        (None, Some(first), Some(second)) if second.beats == first.beats => State::Lost,
        (None, _, Some(second)) if second.quiet as f64 > hang_limit_s => State::Hung(second.quiet),
        (None, ..) => State::Going,
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Begun => write!(f, "begun: the attempt's folder has no counter yet"),
            Self::Going => write!(f, "going"),
            Self::Hung(seconds) => write!(
                f,
                "hung: for {seconds} s, no build, check or frame has begun, and no launch or point has ended"
            ),
            Self::Lost => write!(
                f,
                "lost: the counter in the attempt's folder no longer increases; probably, the attempt was killed, or its machine failed"
            ),
            Self::Ended(End::Done) => write!(f, "done"),
            Self::Ended(End::Interrupted) => write!(f, "interrupted"),
            Self::Ended(End::LauncherLost(why)) => write!(f, "launcher lost: {why}"),
            Self::Ended(End::Failed(why)) => write!(f, "failed: {why}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shard::About;

    #[test]
    fn counters_tell_going_lost_and_hung_apart() {
        let beat = |beats, quiet| Some(Beat { beats, quiet, steps: 1 });
        assert_eq!(state(None, [beat(7, 0), beat(9, 0)], 600.0), State::Going);
        assert_eq!(state(None, [beat(7, 60), beat(9, 62)], 600.0), State::Going, "a long step");
        assert_eq!(state(None, [beat(700, 690), beat(702, 692)], 600.0), State::Hung(692));
        assert_eq!(state(None, [beat(7, 0), beat(7, 0)], 600.0), State::Lost);
        assert_eq!(state(Some(End::Done), [beat(7, 0), beat(7, 0)], 600.0), State::Ended(End::Done));
    }

    #[test]
    fn an_attempt_without_a_counter_is_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let about = About { shard: 1, of: 2, hang_limit_s: 600.0, ..About::default() };
        let attempt = Attempt::begin(folder.path(), &about).unwrap();
        let state = |wait: &dyn Fn()| read_twice(folder.path(), wait).unwrap().remove(0).state;
        assert_eq!(state(&|| ()), State::Begun);
        let count = || std::fs::write(attempt.folder.join("pulse"), "0 0 0\n").unwrap();
        assert_eq!(state(&count), State::Going, "it began to count between the readings");
        assert_eq!(state(&|| ()), State::Lost);
    }

    #[test]
    fn an_attempt_that_counts_beside_one_that_has_ended_is_going() {
        let folder = tempfile::tempdir().unwrap();
        let about = |shard: u32| About { shard, of: 2, hang_limit_s: 600.0, ..About::default() };
        let [ended, going] = [1, 2].map(|shard| Attempt::begin(folder.path(), &about(shard)).unwrap());
        ended.ended(&End::Done).unwrap();
        let count =
            |beats: u64| std::fs::write(going.folder.join("pulse"), format!("{beats} 0 1\n")).unwrap();
        count(7);
        let statuses = read_twice(folder.path(), || count(9)).unwrap();
        let states: Vec<_> = statuses.into_iter().map(|status| status.state).collect();
        assert_eq!(states, [State::Ended(End::Done), State::Going]);
    }

    #[test]
    fn an_attempt_whose_counter_vanishes_between_the_readings_is_lost() {
        let folder = tempfile::tempdir().unwrap();
        let about = About { shard: 1, of: 2, hang_limit_s: 600.0, ..About::default() };
        let attempt = Attempt::begin(folder.path(), &about).unwrap();
        let pulse = attempt.folder.join("pulse");
        std::fs::write(&pulse, "7 0 1\n").unwrap();
        let statuses = read_twice(folder.path(), || std::fs::remove_file(&pulse).unwrap()).unwrap();
        assert_eq!(statuses[0].state, State::Lost);
    }

    #[test]
    fn an_attempt_whose_description_cannot_be_read_has_no_limit() {
        let folder = tempfile::tempdir().unwrap();
        let about = About { shard: 1, of: 2, hang_limit_s: 600.0, ..About::default() };
        let attempt = Attempt::begin(folder.path(), &about).unwrap();
        std::fs::write(attempt.folder.join("attempt.json"), "torn").unwrap();
        assert_eq!(attempt.about().unwrap(), None);
        let count = |line: &str| std::fs::write(attempt.folder.join("pulse"), line).unwrap();
        count("700 690 1\n");
        let statuses = read_twice(folder.path(), || count("702 692 1\n")).unwrap();
        assert_eq!(statuses[0].state, State::Going);
    }

    #[test]
    fn a_step_that_takes_just_its_limit_is_no_hang() {
        let beat = |beats, quiet| Some(Beat { beats, quiet, steps: 1 });
        assert_eq!(state(None, [beat(1, 598), beat(3, 600)], 600.0), State::Going);
        assert_eq!(state(None, [beat(1, 599), beat(3, 601)], 600.0), State::Hung(601));
        assert_eq!(state(None, [None, beat(3, 601)], 600.0), State::Hung(601));
    }

    #[test]
    fn a_status_has_its_attempts_name_its_limit_and_the_second_reading() {
        let folder = tempfile::tempdir().unwrap();
        let about = About { shard: 1, of: 2, host: "n1".into(), hang_limit_s: 2.0, ..About::default() };
        let attempt = Attempt::begin(folder.path(), &about).unwrap();
        let count = |line: &str| std::fs::write(attempt.folder.join("pulse"), line).unwrap();
        count("7 0 4\n");
        let statuses = read_twice(folder.path(), || count("10 3 5\n")).unwrap();
        let beat = Beat { beats: 10, quiet: 3, steps: 5 };
        assert_eq!(statuses, [Status { name: "shard-00001.n1..r00".into(), state: State::Hung(3), beat }]);
    }

    #[test]
    fn every_state_is_described_in_words() {
        for (state, words) in [
            (State::Begun, "begun: the attempt's folder has no counter yet"),
            (State::Going, "going"),
            (
                State::Hung(42),
                "hung: for 42 s, no build, check or frame has begun, and no launch or point has ended",
            ),
            (
                State::Lost,
                "lost: the counter in the attempt's folder no longer increases; probably, the attempt was killed, or its machine failed",
            ),
            (State::Ended(End::Done), "done"),
            (State::Ended(End::Interrupted), "interrupted"),
            (State::Ended(End::LauncherLost("sh has ended".into())), "launcher lost: sh has ended"),
            (State::Ended(End::Failed("no disk".into())), "failed: no disk"),
        ] {
            assert_eq!(state.to_string(), words);
        }
    }
}
