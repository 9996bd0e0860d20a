//! Timing points in interleaved rounds: every round takes one sample of each point that has not stopped, in a
//! seeded random order, so that a drift of the machine is not read as a difference between points.

use crate::error::Result;
use crate::launch::FrameTimes;
use crate::measure::{StopReason, StoppingRule, round_order};

/// Times points while [`measure`] decides which and how often.
pub trait Rounds {
    /// Casts one frame of a point; none when the point failed, which is then not cast again.
    fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>>;
    /// A sample was taken.
    fn sampled(&mut self, point: usize, round: u32, times: &FrameTimes) -> Result<()>;
    /// A point has all its samples, in the order taken.
    fn stopped(&mut self, point: usize, frames: Vec<FrameTimes>, reason: StopReason) -> Result<()>;
}

/// Where measuring starts: at nothing, or where an earlier run left off.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Start {
    /// The samples that each point has already.
    pub frames: Vec<Vec<FrameTimes>>,
    /// The first round.
    pub round: u32,
}

/// Times points until each has stopped or failed.
pub fn measure(start: Start, rule: &StoppingRule, seed: u64, rounds: &mut impl Rounds) -> Result<()> {
    let mut frames = Vec::with_capacity(start.frames.len());
    for (point, before) in start.frames.into_iter().enumerate() {
        frames.push(judge(point, before, rule, rounds)?);
    }
    for round in start.round.. {
        let active: Vec<usize> = (0..frames.len()).filter(|&point| frames[point].is_some()).collect();
        if active.is_empty() {
            break;
        }
        for place in round_order(active.len(), u64::from(round), seed) {
            let point = active[place];
            let before = frames[point].take().unwrap_or_default();
            frames[point] = sample(point, round, before, rule, rounds)?;
        }
    }
    Ok(())
}

/// Takes one sample of a point; none when it was the last.
fn sample(
    point: usize,
    round: u32,
    mut frames: Vec<FrameTimes>,
    rule: &StoppingRule,
    rounds: &mut impl Rounds,
) -> Result<Option<Vec<FrameTimes>>> {
    let Some(times) = rounds.cast(point)? else { return Ok(None) };
    rounds.sampled(point, round, &times)?;
    frames.push(times);
    judge(point, frames, rule, rounds)
}

/// Whether a point has been sampled enough; if so there is nothing left of it.
fn judge(
    point: usize,
    frames: Vec<FrameTimes>,
    rule: &StoppingRule,
    rounds: &mut impl Rounds,
) -> Result<Option<Vec<FrameTimes>>> {
    let samples_ms: Vec<f64> = frames.iter().map(|frame| frame.frame_ms).collect();
    let elapsed_ms = frames.iter().map(FrameTimes::elapsed_ms).sum();
    match rule.stop(&samples_ms, elapsed_ms).filter(|_| !frames.is_empty()) {
        None => Ok(Some(frames)),
        Some(reason) => rounds.stopped(point, frames, reason).map(|()| None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points whose frames take as long as their number; one fails at its third frame.
    #[derive(Default)]
    struct Fake {
        order: Vec<usize>,
        stopped: Vec<(usize, usize)>,
        failing: Option<usize>,
    }

    impl Rounds for Fake {
        fn cast(&mut self, point: usize) -> Result<Option<FrameTimes>> {
            self.order.push(point);
            let casts = self.order.iter().filter(|&&cast| cast == point).count();
            if self.failing == Some(point) && casts == 3 {
                return Ok(None);
            }
            let ms = (point + 1) as f64 + 0.1 * (casts % 3) as f64;
            Ok(Some(FrameTimes::whole(ms, ms)))
        }
        fn sampled(&mut self, _point: usize, _round: u32, _times: &FrameTimes) -> Result<()> {
            Ok(())
        }
        fn stopped(&mut self, point: usize, frames: Vec<FrameTimes>, _reason: StopReason) -> Result<()> {
            self.stopped.push((point, frames.len()));
            Ok(())
        }
    }

    const RULE: StoppingRule =
        StoppingRule { min_samples: 4, max_samples: 7, relative_sigma: 1e-9, time_limit_ms: 1e9 };

    fn fresh(points: usize) -> Start {
        Start { frames: vec![Vec::new(); points], round: 0 }
    }

    #[test]
    fn an_earlier_runs_samples_count() -> Result<()> {
        let times = FrameTimes::whole(1.0, 1.0);
        let before =
            |samples: usize| (0..samples).map(|i| FrameTimes { frame_ms: i as f64 + 1.0, ..times }).collect();
        let mut fake = Fake::default();
        measure(Start { frames: vec![before(7), before(2), before(0)], round: 2 }, &RULE, 1, &mut fake)?;
        assert_eq!(fake.stopped[0], (0, 7), "it had all its samples");
        let casts = |point| fake.order.iter().filter(|&&cast| cast == point).count();
        assert_eq!([casts(0), casts(1), casts(2)], [0, 5, 7]);
        Ok(())
    }

    #[test]
    fn each_round_takes_one_sample_of_every_point() -> Result<()> {
        let mut fake = Fake::default();
        measure(fresh(3), &RULE, 1, &mut fake)?;
        for round in fake.order.chunks(3) {
            let mut points = round.to_vec();
            points.sort_unstable();
            assert_eq!(points, [0, 1, 2]);
        }
        assert!(fake.order.chunks(3).any(|round| round != [0, 1, 2]), "never shuffled");
        assert_eq!(fake.stopped.len(), 3);
        assert!(fake.stopped.iter().all(|(_, n)| *n == 7));
        Ok(())
    }

    #[test]
    fn a_failing_point_is_not_cast_again_and_costs_the_others_nothing() -> Result<()> {
        let mut fake = Fake { failing: Some(1), ..Fake::default() };
        measure(fresh(3), &RULE, 1, &mut fake)?;
        assert_eq!(fake.order.iter().filter(|&&point| point == 1).count(), 3);
        assert_eq!(fake.stopped.len(), 2);
        Ok(())
    }
}
