//! How the attempts of a folder are: at work, hung, lost, or ended. Each counts in its own folder; whoever looks twice sees which counters
//! go on.

use super::{Attempt, Beat, End};
use std::fmt;
use std::path::Path;
use std::time::Duration;

/// How an attempt is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// Its counter goes on, and so does its work.
    Going,
    /// Its counter goes on, but it has done nothing for longer than a step may take, in seconds.
    Hung(u64),
    /// Its counter stands still, and it did not say how it ended: it was killed, or its machine is gone.
    Lost,
    /// It said how it ended.
    Ended(End),
}

/// An attempt, and how it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Status {
    /// Its name: shard, machine, job, restart.
    pub name: String,
    /// How it is.
    pub state: State,
    /// What it counted.
    pub beat: Beat,
}

/// How all attempts of a folder are, by looking twice with `between` in the middle, which should be some seconds: a file system on a
/// network may show what it was like a while ago.
pub fn status(out: &Path, between: Duration) -> Vec<Status> {
    let attempts = Attempt::all(out);
    let first: Vec<Beat> = attempts.iter().map(beat).collect();
    if attempts.iter().any(|attempt| attempt.end().is_none()) {
        std::thread::sleep(between);
    }
    let of = |(attempt, first): (&Attempt, Beat)| {
        let second = beat(attempt);
        let limit = attempt.about().map_or(f64::MAX, |about| about.hang_limit_s);
        Status {
            name: attempt.name.clone(),
            state: state(attempt.end(), [first, second], limit),
            beat: second,
        }
    };
    attempts.iter().zip(first).map(of).collect()
}

fn beat(attempt: &Attempt) -> Beat {
    Beat::read(&attempt.folder).unwrap_or_default()
}

fn state(end: Option<End>, [first, second]: [Beat; 2], hang_limit_s: f64) -> State {
    match end {
        Some(end) => State::Ended(end),
        None if second.beats == first.beats => State::Lost,
        None if second.quiet as f64 > hang_limit_s => State::Hung(second.quiet),
        None => State::Going,
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Going => write!(f, "going"),
            Self::Hung(seconds) => write!(f, "hung: no step for {seconds} s"),
            Self::Lost => write!(f, "lost: its counter stands still"),
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

    #[test]
    fn counters_tell_going_lost_and_hung_apart() {
        let beat = |beats, quiet| Beat { beats, quiet, steps: 1 };
        assert_eq!(state(None, [beat(7, 0), beat(9, 0)], 600.0), State::Going);
        assert_eq!(state(None, [beat(7, 60), beat(9, 62)], 600.0), State::Going, "a long step");
        assert_eq!(state(None, [beat(700, 690), beat(702, 692)], 600.0), State::Hung(692));
        assert_eq!(state(None, [beat(7, 0), beat(7, 0)], 600.0), State::Lost);
        assert_eq!(state(Some(End::Done), [beat(7, 0), beat(7, 0)], 600.0), State::Ended(End::Done));
    }
}
